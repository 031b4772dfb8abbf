// Stage measure_contact: one workgroup sums impulses, torque, work and dissipation over the contact nodes and clears
// them for the next frame; the host adds the 64 partial sums in f64.
#import shared/params
#import shared/step_input
#import shared/contact_node
#ifdef PUNCTURE
#import effects/puncture
#import shared/tip_written
#endif

@group(3) @binding(6) var<storage, read_write> contact_totals: array<ContactSums, 64>;
#ifdef FLEXIBLE_NEEDLE
#import shared/displacement
#import effects/flexible_needle
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;
// Impulse of this frame on the tissue by each entry of the centre-line [N s], w unused.
@group(3) @binding(16) var<storage, read_write> needle_loads: array<vec4<f32>, 64>;
#endif
#ifdef PUNCTURE
@group(3) @binding(7) var<storage, read_write> tip_result: TipState;
#endif
#ifdef FREE_PATH
var<workgroup> softened: array<f32, 64>;
#endif

@compute @workgroup_size(64)
fn measure_contact(@builtin(local_invocation_index) lane: u32) {
#ifdef FLEXIBLE_NEEDLE
    // The loads are shared over the entries of the centre-line.
    var load = vec4<f32>(0.0);
    for (var index = 0u; index < CONTACT_COUNT; index++) {
        let place = contact_nodes[index].rest.xyz
            + vec3<f32>(node_displacement[contact_nodes[index].numbers.x].xyz) * DISPLACEMENT_UNIT;
        let s = dot(step_input.tip.xyz - place, step_input.direction.xyz);
        load += contact_records[index].impulse * max(0.0, 1.0 - abs(centre_line_entry(s) - f32(lane)));
    }
    needle_loads[lane] = load;
    storageBarrier();
#endif
    var total: ContactSums;
    for (var index = lane; index < CONTACT_COUNT; index += 64u) {
        let record = contact_records[index];
        let booked_now = record.angular_impulse.w == step_mark();
        total.impulse += vec4<f32>(record.impulse.xyz, select(0.0, record.impulse.w, booked_now));
        total.angular_impulse += record.angular_impulse;
        total.parts += record.parts;
        total.energies += record.energies;
        contact_records[index].impulse = vec4<f32>(0.0);
        contact_records[index].angular_impulse = vec4<f32>(0.0);
        contact_records[index].parts = vec4<f32>(0.0);
        // What the springs hold is no sum over steps.
        contact_records[index].energies = vec4<f32>(0.0, 0.0, 0.0, record.energies.w);
    }
    contact_totals[lane] = total;
#ifdef FREE_PATH
    var taken = 0.0;
    for (var index = lane; index < puncture.path_cell_count; index += 64u) {
        taken += free_cells[index].dissipation;
        free_cells[index].dissipation = 0.0;
    }
    softened[lane] = taken;
    workgroupBarrier();
    if (lane == 0u) {
        var result = TipState();
        result.coordinate = free_tip.coordinate;
        result.dissipation = free_tip.dissipation;
        result.spring_energy = free_tip.spring_energy;
        result.cap_dissipation = free_tip.cap_dissipation;
        tip_result = result;
        free_tip.dissipation = 0.0;
        free_tip.cap_dissipation = 0.0;
        for (var other = 0u; other < 64u; other++) {
            tip_result.softening += softened[other];
        }
    }
#else
#ifdef PUNCTURE
    if (lane == 0u) {
        tip_result = tip_state;
        tip_state.dissipation = 0.0;
        tip_state.cap_dissipation = 0.0;
        tip_state.membrane_impulse = 0.0;
        tip_state.bond_impulse = 0.0;
        tip_state.bond_dissipation = 0.0;
        for (var index = 0u; index < puncture.path_cell_count; index++) {
            tip_result.softening += path_cells[index].dissipation;
            path_cells[index].dissipation = 0.0;
        }
    }
#endif
#endif
}
