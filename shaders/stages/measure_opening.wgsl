// Stage measure_opening: energy that opening adds to the tissue, in 128 parts, and what the frame has summed.
#import shared/opening_cell

struct OpeningTotals {
    record: OpeningRecord,
    // Elastic energy [J].
    elastic: array<vec4<f32>, 32>,
}

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
        let corners = corner_displacements(cluster.cell.xyz);
        let origin = cluster.low.xyz + corners.first - station.centre.xyz;
        for (var p = cluster.points.x; p < end; p++) {
            let local = path_points[p].xyz;
            var H = mat3x3<f32>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
            var y = origin + local * cluster.width.xyz;
            for (var c = 0u; c < 8u; c++) {
                let weight = corner_weight(c, local, cluster.width.xyz);
                let u = corners.from_first[c];
                y += u * weight.value;
                H += mat3x3<f32>(u * weight.gradient.x, u * weight.gradient.y, u * weight.gradient.z);
            }
            let place = opened_place(section, across(y) * scale, deformation_gradient(H));
            energy += path_points[p].w * opened_energy(cluster.cell.w, place, H);
        }
    }
    for (var index = thread; index < opening.counts.z; index += 128u) {
        let cell = near_cells[index];
        let width = cell.width.xyz;
        let mean = mean_of_stations(cell.stations.x, cell.stations.y);
        for (var once = select(1u, 0u, mean.middle.w > 0.0); once == 0u; once++) {
            let section = PathSection(mean.rate.xyz, mean.middle.w * scale, mean.rate.w);
            let corners = corner_displacements(cell.cell.xyz);
            let origin = cell.low.xyz + corners.first - mean.middle.xyz;
            let H = middle_gradient(corners, width);
            let gradient = deformation_gradient(H);
            let volume = width.x * width.y * width.z;
            var dilated = 0.0;
            for (var at = 0u; at < 8u; at++) {
                let eta = across(place_in_cell(corners, origin, gauss_place(at), width)) * scale;
                dilated += 0.125 * (dilation(section.radius, dot(eta, eta)).x - 1.0);
            }
            let dj = jacobian_minus_one(H);
            let open = dj + (1.0 + dj) * dilated;
            energy += 0.5 * materials[cell.cell.w].bulk_modulus * volume * (open * open - dj * dj);
            let whole = cell.stations.z == 1u;
            for (var at = select(0u, 8u, whole); at < select(8u, 9u, whole); at++) {
                let eta = across(place_in_cell(corners, origin, gauss_place(at), width)) * scale;
                let part = select(0.125 * volume * share_of(cell, at), volume, whole);
                energy += part * opened_energy(cell.cell.w, opened_place(section, eta, gradient), H);
            }
        }
    }
    opening_totals.elastic[thread / 4u][thread % 4u] = energy;
    if (thread == 0u) {
        opening_totals.record = opening_record;
        opening_record.impulse = vec4<f32>(0.0);
        opening_record.angular_impulse = vec4<f32>(0.0);
        opening_record.parts = vec4<f32>(0.0);
    }
}
