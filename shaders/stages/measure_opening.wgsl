// Stage measure_opening: energy that opening adds to the tissue, in 128 parts, and what the frame has summed.
#import shared/opening_cell

struct OpeningTotals {
    record: OpeningRecord,
    // Elastic energy [J].
    elastic: array<vec4<f32>, 32>,
}

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
    for (var index = thread; index < opening.counts.y; index += 128u) {
        let cluster = path_clusters[index];
        let station = path_stations[cluster.points.z];
        let section = PathSection(station.centre_rate.xyz, station.centre.w * scale, station.centre_rate.w);
        let end = select(cluster.points.x, cluster.points.y, station.centre.w > 0.0);
        let modes = cell_modes(cluster.cell.xyz);
        let origin = cluster.middle.xyz - station.centre.xyz;
        for (var i = cluster.points.x; i < end; i++) {
            let p = path_points[i].xyz;
            let H = strain_at(modes, p, cluster.inverse.xyz);
            let y = origin + p / cluster.inverse.xyz + displacement_at(modes, p);
            let place = opened_place(section, across(y) * scale, deformation_gradient(H));
            energy += path_points[i].w * opened_energy(cluster.cell.w, place, H);
        }
    }
    for (var index = thread; index < opening.counts.z; index += 128u) {
        let cell = near_cells[index];
        let mean = mean_of_stations(cell.stations.x, cell.stations.y);
        for (var once = select(1u, 0u, mean.middle.w > 0.0); once == 0u; once++) {
            let section = PathSection(mean.rate.xyz, mean.middle.w * scale, mean.rate.w);
            let modes = cell_modes(cell.cell.xyz);
            let H = strain_at(modes, vec3<f32>(0.0), cell.inverse.xyz);
            let gradient = deformation_gradient(H);
            let width = 1.0 / cell.inverse.xyz;
            let volume = width.x * width.y * width.z;
            let middle = cell.middle.xyz + modes.mean - mean.middle.xyz;
            var dilated = 0.0;
            for (var at = 0u; at < 8u; at++) {
                let eta = across(middle + gradient * (gauss_place(at) * width)) * scale;
                dilated += 0.125 * (dilation(section.radius, dot(eta, eta)).x - 1.0);
            }
            let dj = jacobian_minus_one(H);
            let open = dj + (1.0 + dj) * dilated;
            energy += 0.5 * materials[cell.cell.w].bulk_modulus * volume * (open * open - dj * dj);
            let whole = cell.stations.z == 8u;
            for (var at = cell.stations.z; at < cell.stations.w; at++) {
                let eta = across(middle + gradient * (gauss_place(at) * width)) * scale;
                let part = select(0.125 * volume * share_of(cell, at), volume, whole);
                energy += part * opened_energy(cell.cell.w, opened_place(section, eta, gradient), H);
            }
        }
    }
    opening_totals.elastic[thread / 4u][thread % 4u] = energy;
#ifdef FLEXIBLE_NEEDLE
    // The loads are shared over the entries of the centre-line.
    for (var entry = select(32u, 0u, thread == 0u); entry < 32u; entry++) {
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
