// Stage opening_cells: what opening adds to the forces of the cells that the map reaches, one thread per cell.
// Equations: src/needle/opening.rs and near_cell_forces in src/cpu/opening.rs.
#import shared/thread_index
#import shared/opening_cell

// f_int on the eight corners of a slot [N]; w: bound of the stiffness there [N/m].
@group(3) @binding(21) var<storage, read_write> opening_corners: array<vec4<f32>>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

@compute @workgroup_size(64)
fn opening_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= opening.counts.z) {
        return;
    }
    let cell = near_cells[index];
    let width = cell.width.xyz;
    let mean = mean_of_stations(cell.stations.x, cell.stations.y);
    let scale = 1.0 / opening.direction.w;
    let section = PathSection(mean.rate.xyz, mean.middle.w * scale, mean.rate.w);
    let material = materials[cell.cell.w];
    var force: array<vec4<f32>, 8>;
    var sum = OpeningSum(vec4<f32>(0.0), vec4<f32>(0.0));
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, mean.middle.w > 0.0); once == 0u; once++) {
        let corners = corner_displacements(cell.cell.xyz);
        let origin = cell.low.xyz + corners.first - mean.middle.xyz;
        let H = middle_gradient(corners, width);
        let gradient = deformation_gradient(H);
        let cof = cofactor(gradient);
        let volume = width.x * width.y * width.z;
        // The volume is the cell's.
        var dilated = 0.0;
        for (var at = 0u; at < 8u; at++) {
            let eta = across(place_in_cell(corners, origin, gauss_place(at), width)) * scale;
            dilated += 0.125 * (dilation(section.radius, dot(eta, eta)).x - 1.0);
        }
        let dj = jacobian_minus_one(H);
        let J = 1.0 + dj;
        let open = dj + J * dilated;
        var by_gradient = cof * (material.bulk_modulus * (open * (1.0 + dilated) - dj) * volume);
        let by_dilation = material.bulk_modulus * open * J * volume * 0.125;
        for (var at = 0u; at < 8u; at++) {
            let local = gauss_place(at);
            let eta = across(place_in_cell(corners, origin, local, width)) * scale;
            let rate = dilation(section.radius, dot(eta, eta)) * by_dilation;
            let by_place = eta * (2.0 * rate.y * scale);
            for (var c = 0u; c < 8u; c++) {
                force[c] += vec4<f32>(by_place * corner_weight(c, local, width).value, 0.0);
            }
            sum.by_centre += vec4<f32>(-by_place, rate.z * scale);
        }
        // What keeps the shape, where points do not carry it: in the middle of a cell without points.
        let closed = isochoric_stress(material, H);
        var tangent = vec2<f32>(closed.tangent, closed.turned_tangent);
        var grown = 1.0;
        let whole = cell.stations.z == 1u;
        for (var at = select(0u, 8u, whole); at < select(8u, 9u, whole); at++) {
            let local = gauss_place(at);
            let place = opened_place(section, across(place_in_cell(corners, origin, local, width)) * scale, gradient);
            let part = select(0.125 * volume * share_of(cell, at), volume, whole);
            let now = opened_stress(cell.cell.w, place, H);
            let d = now.derivatives;
            by_gradient += d.gradient * part;
            for (var c = 0u; c < 8u; c++) {
                force[c] += vec4<f32>(d.place * (part * corner_weight(c, local, width).value), 0.0);
            }
            sum.by_centre += vec4<f32>(-d.place, d.radius) * part;
            sum.by_rate += vec4<f32>(d.centre_rate, d.radius_rate) * part;
            let growth = amplification(place);
            let size = pow(volume, 0.33333333);
            grown = max(grown, select(1.0, growth.x + growth.y * size, part > 0.0));
            tangent = max(tangent, select(vec2<f32>(0.0), vec2<f32>(now.tangent, now.turned_tangent), part > 0.0));
        }
        // Bound of the stiffness beyond that of the closed cell, in a cell where open faces may meet.
        let b = 0.5 / width;
        let most = 8.0 * volume;
        let cof_b = dot(abs(cof[0]) * b.x + abs(cof[1]) * b.y + abs(cof[2]) * b.z, abs(cof[0]) * b.x + abs(cof[1]) * b.y + abs(cof[2]) * b.z);
        let with_opening = (material.bulk_modulus + tangent.y) * cof_b * pow(max(1.0 + dilated, 1.0), 2.0)
            + tangent.x * grown * grown * dot(b, b);
        let without = (material.bulk_modulus + closed.turned_tangent) * cof_b + closed.tangent * dot(b, b);
        let bound = most * 0.25 * max(with_opening - without, 0.0);
        for (var c = 0u; c < 8u; c++) {
            let weight = corner_weight(c, vec3<f32>(0.5), width);
            force[c] = vec4<f32>(force[c].xyz + by_gradient * weight.gradient, bound);
        }
    }
    let slot = opening.counts.y + index;
    for (var c = 0u; c < 8u; c++) {
        opening_corners[8u * slot + c] = force[c];
    }
    opening_sums[slot] = sum;
}
