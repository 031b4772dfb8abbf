// Stage opening_points: forces of the points beside the path, PIECES threads per cluster: points in one cell.
// Equations: src/needle/opening.rs and point_forces in src/cpu/opening.rs.
#import shared/thread_index
#import shared/opening_cluster

#ifdef WIDE
// As `pieces` in src/gpu/grain.rs. Hardware waits for one point after another; software would only do more.
const PIECES: u32 = 8u;
// What threads have for the modes of their cluster, w: for the bounds at its corners; its sums.
var<workgroup> shares: array<vec4<f32>, 512>;
var<workgroup> totals: array<vec4<f32>, 64>;
#endif

// f_int on the corners of a slot [N]; w: bound of the stiffness there [N/m].
@group(3) @binding(21) var<storage, read_write> opening_corners: array<vec4<f32>>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

@compute @workgroup_size(64)
fn opening_points(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
#ifdef WIDE
    // Threads beyond the last cluster have no points: all have to wait for each other below.
    let thread = thread_index(id, groups);
    let piece = thread % PIECES;
    let index = min(thread / PIECES, opening.counts.y - 1u);
    let cluster = path_clusters[index];
    let held = cluster.points.y - cluster.points.x;
    let first = cluster.points.x + held * piece / PIECES;
    let end = select(first, opened_end(vec2<u32>(first, cluster.points.x + held * (piece + 1u) / PIECES)), thread / PIECES == index);
#else
    let index = thread_index(id, groups);
    if (index >= opening.counts.y) {
        return;
    }
    let cluster = path_clusters[index];
    let first = cluster.points.x;
    // What is not opened is as its cells have it: no point at all.
    let end = opened_end(cluster.points.xy);
#endif
    let inverse = cluster.inverse.xyz;
    let scale = 1.0 / opening.direction.w;
    var f: CellModes;
#ifdef TETRAHEDRA
    let lengths = gradient_lengths(cluster.cell.xyz);
    let all_lengths = dot(lengths, vec4<f32>(1.0));
    // Bounds at all corners.
    var lower = vec4<f32>(0.0);
    let upper = vec4<f32>(0.0);
#else
    // Bounds at the corners below, and at those above.
    var lower = vec4<f32>(0.0);
    var upper = vec4<f32>(0.0);
#endif
    var sum = OpeningSum();
    let modes = cell_modes(cluster.cell.xyz);
    for (var i = first; i < end; i++) {
        let point = path_points[i];
        let station = path_stations[point.numbers.x];
        let section = section_of(station);
        let intact = select(0.0, point.place.w, section.radius > 0.0);
        let volume = intact * section.left;
        let p = point.place.xyz;
        let H = strain_at(modes, p, inverse);
        let y = cluster.middle.xyz - station.centre.xyz + p / inverse + displacement_at(modes, p);
        let place = opened_place(section, across(y) * scale, deformation_gradient(H));
        let now = opened_stress(cluster.cell.w, place, H, shape_stress(cluster.cell.w, H).P);
        let by_place = now.derivatives.place * volume;
        let x = now.derivatives.gradient[0] * (inverse.x * volume);
        let y_ = now.derivatives.gradient[1] * (inverse.y * volume);
        let z = now.derivatives.gradient[2] * (inverse.z * volume);
        f.mean += by_place;
        f.x += by_place * p.x + x;
        f.y += by_place * p.y + y_;
        f.z += by_place * p.z + z;
        f.xy += by_place * (p.x * p.y) + x * p.y + y_ * p.x;
        f.yz += by_place * (p.y * p.z) + y_ * p.z + z * p.y;
        f.zx += by_place * (p.z * p.x) + z * p.x + x * p.z;
        f.xyz += by_place * (p.x * p.y * p.z) + x * (p.y * p.z) + y_ * (p.z * p.x) + z * (p.x * p.y);
        // Bound of the stiffness: rows of the point's own.
        let growth = amplification(place);
        let grown = growth.x + growth.y * length(place.eta) * opening.direction.w;
        let stiffness = intact * (now.tangent * grown * grown
            + now.turned_tangent * squared_norm_bound(cofactor(deformation_gradient(H))));
#ifdef TETRAHEDRA
        lower += lengths * (all_lengths * stiffness);
#else
        let nx = vec4<f32>(0.5 - p.x, 0.5 + p.x, 0.5 - p.x, 0.5 + p.x);
        let ny = vec4<f32>(0.5 - p.y, 0.5 - p.y, 0.5 + p.y, 0.5 + p.y);
        let flat = (nx * nx) * (inverse.y * inverse.y) + (ny * ny) * (inverse.x * inverse.x);
        let steep = (nx * ny) * (nx * ny) * (inverse.z * inverse.z);
        let below = sqrt(flat * ((0.5 - p.z) * (0.5 - p.z)) + steep);
        let above = sqrt(flat * ((0.5 + p.z) * (0.5 + p.z)) + steep);
        let all = stiffness * dot(below + above, vec4<f32>(1.0));
        lower += below * all;
        upper += above * all;
#endif
        sum.by_centre += vec4<f32>(-now.derivatives.place, now.derivatives.radius) * volume;
        sum.by_rate += vec4<f32>(now.derivatives.centre_rate, now.derivatives.radius_rate) * volume;
#ifdef LAID
        let moment = moment_of(deformation_gradient(H), y, now.derivatives.gradient, now.derivatives.place);
        sum.by_moment += vec4<f32>(moment * volume, 0.0);
#endif
        for (var once = select(0u, 1u, point.numbers.z == 0u); once == 0u; once++) {
            opening_sums[point.numbers.y] = sum;
            sum = OpeningSum();
        }
    }
#ifdef WIDE
    let lane = thread % 64u;
    shares[lane] = vec4<f32>(f.mean, lower.x);
    shares[64u + lane] = vec4<f32>(f.x, lower.y);
    shares[128u + lane] = vec4<f32>(f.y, lower.z);
    shares[192u + lane] = vec4<f32>(f.z, lower.w);
    shares[256u + lane] = vec4<f32>(f.xy, upper.x);
    shares[320u + lane] = vec4<f32>(f.yz, upper.y);
    shares[384u + lane] = vec4<f32>(f.zx, upper.z);
    shares[448u + lane] = vec4<f32>(f.xyz, upper.w);
    workgroupBarrier();
    // A thread has as many modes and corners as there are threads to a cluster: one.
    let own = lane - piece;
    var total = vec4<f32>(0.0);
    for (var other = 0u; other < PIECES; other++) {
        total += shares[64u * piece + own + other];
    }
    totals[lane] = total;
    workgroupBarrier();
    f = CellModes(
        totals[own].xyz, totals[own + 1u].xyz, totals[own + 2u].xyz, totals[own + 3u].xyz,
        totals[own + 4u].xyz, totals[own + 5u].xyz, totals[own + 6u].xyz, totals[own + 7u].xyz,
    );
    if (thread / PIECES == index && piece < CORNERS) {
        opening_corners[CORNERS * index + piece] = vec4<f32>(force_on_corner(f, cluster.cell.xyz, piece), total.w);
    }
#else
    for (var c = 0u; c < 4u; c++) {
        opening_corners[CORNERS * index + c] = vec4<f32>(force_on_corner(f, cluster.cell.xyz, c), lower[c]);
#ifndef TETRAHEDRA
        opening_corners[CORNERS * index + c + 4u] = vec4<f32>(force_on_corner(f, cluster.cell.xyz, c + 4u), upper[c]);
#endif
    }
#endif
}
