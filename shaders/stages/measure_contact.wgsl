// Stage measure_contact: one workgroup sums impulses, torque, work and dissipation over the contact nodes and clears
// them for the next frame; the host adds the 64 partial sums in f64.
#import shared/params
#import shared/step_input
#import shared/contact_node
#ifdef PUNCTURE
#import effects/puncture
#endif

@group(3) @binding(6) var<storage, read_write> contact_totals: array<ContactSums, 64>;
#ifdef PUNCTURE
@group(3) @binding(7) var<storage, read_write> tip_result: TipState;
#endif

@compute @workgroup_size(64)
fn measure_contact(@builtin(local_invocation_index) lane: u32) {
    var total: ContactSums;
    for (var index = lane; index < arrayLength(&contact_nodes); index += 64u) {
        let sums = contact_sums[index];
        total.impulse += sums.impulse;
        total.angular_impulse += sums.angular_impulse;
        total.cutting += sums.cutting;
        total.spreading += sums.spreading;
        total.sliding += sums.sliding;
        total.work += sums.work;
        total.sliding_dissipation += sums.sliding_dissipation;
        total.damping_dissipation += sums.damping_dissipation;
        total.stored += sums.stored;
        total.shaft += sums.shaft;
        contact_sums[index] = ContactSums();
    }
    contact_totals[lane] = total;
#ifdef PUNCTURE
    if (lane == 0u) {
        tip_result = tip_state;
        tip_state.dissipation = 0.0;
        tip_state.membrane_impulse = 0.0;
        tip_state.bond_impulse = 0.0;
        tip_state.bond_dissipation = 0.0;
        for (var index = 0u; index < puncture.path_cell_count; index++) {
            tip_result.softening += path_cells[index].dissipation;
            path_cells[index].dissipation = 0.0;
        }
    }
#endif
}
