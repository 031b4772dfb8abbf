// Stage measure_opening: energy that opening adds to the tissue, in PARTS parts, and what the frame has summed.
#import shared/opened_energy

// As OPENING_PARTS in src/gpu/plan.rs.
const PARTS: u32 = 1024u;

#ifdef FLEXIBLE_NEEDLE
#import shared/step_input
#import effects/flexible_needle
@group(3) @binding(16) var<storage, read_write> needle_loads: array<vec4<f32>, 64>;
#endif
@group(3) @binding(23) var<storage, read_write> opening_record: OpeningRecord;
@group(3) @binding(24) var<storage, read_write> opening_totals: OpeningTotals;

@compute @workgroup_size(64)
fn measure_opening(@builtin(global_invocation_id) id: vec3<u32>) {
    let thread = id.x;
    let scale = 1.0 / opening.direction.w;
    var energy = 0.0;
    for (var index = thread; index < opening.counts.y; index += PARTS) {
        let cluster = path_clusters[index];
        let end = opened_end(cluster.points.xy);
        let modes = cell_modes(cluster.cell.xyz);
        for (var i = cluster.points.x; i < end; i++) {
            let point = path_points[i];
            energy += section_of(path_stations[point.numbers.x]).left * energy_of_point(cluster, modes, point);
        }
    }
    for (var index = thread; index < opening.counts.z; index += PARTS) {
        let cell = near_cells[index];
        let mean = path_stations[opening.counts.x + cell.stations.x];
        for (var once = select(1u, 0u, mean.centre.w > 0.0); once == 0u; once++) {
            let section = section_of(mean);
            let modes = cell_modes(cell.cell.xyz);
            let H = strain_at(modes, vec3<f32>(0.0), cell.inverse.xyz);
            let gradient = deformation_gradient(H);
            let width = 1.0 / cell.inverse.xyz;
            let volume = width.x * width.y * width.z;
            let middle = cell.middle.xyz + modes.mean - mean.centre.xyz;
            let lateral = lateral_edges(gradient, width);
            let dilated = dilated_cell(cell, section, across(middle) * scale, lateral).less_one;
            let area = section.radius * section.radius;
            let dj = jacobian_minus_one(H);
            let J = 1.0 + dj;
            var by_volume = J * J * area * area * cell.inverse.w;
#ifndef TETRAHEDRA
            // That of tetrahedra is in the averaged dilatation.
            let open = dj + J * dilated;
            by_volume += open * open - dj * dj;
#endif
            energy += 0.5 * materials[cell.cell.w].bulk_modulus * volume * by_volume;
            energy += section.left * energy_of_shape(cell, mean, modes, H);
        }
    }
    opening_totals.elastic[thread / 128u][thread / 4u % 32u][thread % 4u] = energy;
#ifdef FLEXIBLE_NEEDLE
    // The loads are shared over the entries of the centre-line.
    for (var entry = thread; entry < 32u; entry += PARTS) {
        var load = vec4<f32>(0.0);
        for (var i = 0u; i < opening.counts.x; i++) {
            let share = max(0.0, 1.0 - abs(centre_line_entry(path_stations[i].place.x) - f32(entry)));
            load += path_stations[i].impulse * share;
        }
        needle_loads[entry] += load;
    }
#endif
    if (thread == 0u) {
        opening_totals.record = opening_record;
        opening_record.impulse = vec4<f32>(0.0);
        opening_record.angular_impulse = vec4<f32>(0.0);
        opening_record.parts = vec4<f32>(0.0);
        opening_record.late = vec4<f32>(0.0);
    }
}
