// Stage measure_separation: energies of the pairs, 64 partial sums; the host adds them in f64. Clears what is summed per
// frame.
#import shared/params
#import effects/cohesive

struct SeparationSums {
    // Dissipated in the frame, stored at its end [J]; torn area (damage times area) [m^2].
    dissipation: f32,
    stored: f32,
    torn_area: f32,
    _pad: f32,
}

@group(3) @binding(15) var<storage, read_write> separation_sums: array<SeparationSums, 64>;

@compute @workgroup_size(64)
fn measure_separation(@builtin(local_invocation_index) lane: u32) {
    var sums: SeparationSums;
    for (var index = lane; index < cohesive.pair_count; index += 64u) {
        let state = pair_states[index];
        sums.dissipation += state.dissipation;
        sums.stored += state.stored;
        sums.torn_area += state.damage * face_pairs[index].first_way_and_area.w;
        pair_states[index].dissipation = 0.0;
    }
    separation_sums[lane] = sums;
}
