// Where the sections of an opened path are, how far they are behind the tip, and what of them is cut.
// Equations: src/needle/opening.rs and CpuEngine::stations_now.
#import effects/opening
#import shared/beside_needle

#ifndef WIDE
@group(1) @binding(22) var<storage, read> path_entries: array<OpeningEntry>;
#endif
// Sections, and behind them one per run of cells: the mean of the sections in these.
@group(3) @binding(20) var<storage, read_write> path_stations: array<OpeningStation>;

// By one workgroup of LANES; `coordinate`: material coordinate of the tip; `shift`: by what the dimple brings it forward [m].
fn place_sections(lane: u32, coordinate: f32, shift: f32) {
    let count = opening.counts.x;
    let spacing = opening.numbers.x;
    let tip_length = opening.entry.w;
    for (var i = lane; i < count; i += LANES) {
        let depth = path_stations[i].depth;
#ifdef WIDE
        // By stage path_means.
        let middle = path_stations[i].centre.xyz;
#ifndef LAID
        let moved = path_stations[i].rubbing.y;
#endif
#else
        let lists = path_stations[i].lists;
        var middle = vec3<f32>(0.0);
#ifdef LAID
        var disc = path_stations[i].rest.xyz;
        middle = disc;
#else
        var moved = 0.0;
#endif
        for (var e = lists.x; e < lists.y; e++) {
            let entry = path_entries[e];
            let u = vec3<f32>(node_displacement[entry.index].xyz) * DISPLACEMENT_UNIT;
            middle += u * entry.first;
#ifdef LAID
            disc += u * entry.second;
#else
            moved += dot(u, opening.direction.xyz) * entry.second;
#endif
        }
#ifdef LAID
        path_stations[i].disc = vec4<f32>(disc, 0.0);
#else
        middle = across(middle);
#endif
#endif
#ifdef LAID
        // The needle may be turned against its path.
        let behind = dot(step_input.tip.xyz - opening.entry.xyz - path_stations[i].disc.xyz, step_input.direction.xyz) - shift;
#else
        let behind = step_input.depth - depth.x - moved - shift;
#endif
        // OpeningPlan::cut: grows over two spacings, with a rate without steps.
        let part = clamp((coordinate - depth.y) / spacing, -1.0, 1.0);
        let left = 1.0 - abs(part);
        let cut = select(1.0 - 0.5 * left * left, 0.5 * left * left, part < 0.0);
        let rate = left / spacing;
        let shaft = opening.direction.w * depth.z;
        // OpeningPlan::radius: the corner between tip and shaft is rounded.
        let steep = shaft / tip_length;
        let bend = clamp((tip_length - behind) / spacing + 0.5, 0.0, 1.0);
        let full = select(shaft - 0.5 * steep * spacing * bend * bend, steep * max(behind, 0.0), bend == 1.0);
        let slope = select(0.0, steep * bend, behind > 0.0);
        let still_open = left_beside(beside_needle(middle, behind, full, depth.z).offset).x;
        path_stations[i].centre = vec4<f32>(middle, full * cut * still_open);
        path_stations[i].place = vec4<f32>(behind, cut, rate, slope);
        path_stations[i].rubbing.x = full;
#ifdef VISCOELASTIC
        path_stations[i].relaxation.y += 1.0;
#endif
    }
    storageBarrier();
    for (var i = lane; i < count; i += LANES) {
        let before = max(i, 1u) - 1u;
        let behind = min(i + 1u, count - 1u);
        let by = 1.0 / (spacing * f32(behind - before));
        let rate = (path_stations[behind].centre - path_stations[before].centre) * by;
#ifdef LAID
        path_stations[i].centre_rate = vec4<f32>(across(rate.xyz), rate.w);
#else
        path_stations[i].centre_rate = rate;
#endif
    }
    storageBarrier();
    for (var run = lane; run < opening.sums.y; run += LANES) {
        let within = path_stations[count + run].lists;
        var centre = vec4<f32>(0.0);
        var rate = vec4<f32>(0.0);
        var cut = 0.0;
        for (var i = within.x; i < within.y; i++) {
            centre += path_stations[i].centre;
            rate += path_stations[i].centre_rate;
            cut += path_stations[i].place.y;
        }
        let by = 1.0 / f32(within.y - within.x);
        path_stations[count + run].centre = centre * by;
        path_stations[count + run].centre_rate = rate * by;
        path_stations[count + run].place.y = cut * by;
    }
}
