// Stage opening_points: forces of the points beside the path, one thread per cluster: those of one station in one cell.
// Equations: src/needle/opening.rs and point_forces in src/cpu/opening.rs.
#import shared/thread_index
#import shared/opening_cluster

@group(3) @binding(20) var<storage, read> path_stations: array<OpeningStation>;
// f_int on the eight corners of a slot [N]; w: bound of the stiffness there [N/m].
@group(3) @binding(21) var<storage, read_write> opening_corners: array<vec4<f32>>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

@compute @workgroup_size(64)
fn opening_points(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= opening.counts.y) {
        return;
    }
    let cluster = path_clusters[index];
    let station = path_stations[cluster.points.z];
    let scale = 1.0 / opening.direction.w;
    let section = PathSection(station.centre_rate.xyz, station.centre.w * scale, station.centre_rate.w);
    var force: array<vec4<f32>, 8>;
    var sum = OpeningSum(vec4<f32>(0.0), vec4<f32>(0.0));
    // What is not opened is as its cells have it: no point at all.
    let end = select(cluster.points.x, cluster.points.y, station.centre.w > 0.0);
    let corners = corner_displacements(cluster.cell.xyz);
    // The first corner, from the middle of the path.
    let origin = cluster.low.xyz + corners.first - station.centre.xyz;
    for (var p = cluster.points.x; p < end; p++) {
        let point = path_points[p];
        let local = point.xyz;
        var H = mat3x3<f32>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
        var y = origin + local * cluster.width.xyz;
        for (var c = 0u; c < 8u; c++) {
            let weight = corner_weight(c, local, cluster.width.xyz);
            let u = corners.from_first[c];
            y += u * weight.value;
            H += mat3x3<f32>(u * weight.gradient.x, u * weight.gradient.y, u * weight.gradient.z);
        }
        let place = opened_place(section, across(y) * scale, deformation_gradient(H));
        let now = opened_stress(cluster.cell.w, place, H);
        let d = now.derivatives;
        let cof = cofactor(deformation_gradient(H));
        let grown = amplification(place);
        // Bound of the stiffness: rows of the point's own, with the weight of a corner from that at the middle of the path.
        var sizes: array<vec2<f32>, 8>;
        var all = vec2<f32>(0.0);
        let aside = clamp(local - across(y) / cluster.width.xyz, vec3<f32>(0.0), vec3<f32>(1.0));
        for (var c = 0u; c < 8u; c++) {
            let weight = corner_weight(c, local, cluster.width.xyz);
            let middle = corner_weight(c, aside, cluster.width.xyz);
            let size = vec2<f32>(
                grown.x * length(weight.gradient) + grown.y * abs(weight.value - middle.value),
                length(cof * weight.gradient),
            );
            sizes[c] = size;
            all += size;
            force[c] += vec4<f32>((d.gradient * weight.gradient + d.place * weight.value) * point.w, 0.0);
        }
        for (var c = 0u; c < 8u; c++) {
            force[c].w += point.w * (now.tangent * sizes[c].x * all.x + now.turned_tangent * sizes[c].y * all.y);
        }
        sum.by_centre += vec4<f32>(-d.place, d.radius) * point.w;
        sum.by_rate += vec4<f32>(d.centre_rate, d.radius_rate) * point.w;
    }
    for (var c = 0u; c < 8u; c++) {
        opening_corners[8u * index + c] = force[c];
    }
    opening_sums[index] = sum;
}
