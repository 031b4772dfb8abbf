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
    let inverse = cell.inverse.xyz;
    let mean = mean_of_stations(cell.stations.x, cell.stations.y);
    let scale = 1.0 / opening.direction.w;
    let section = PathSection(mean.rate.xyz, mean.middle.w * scale, mean.rate.w);
    let material = materials[cell.cell.w];
    var f: CellModes;
    var sum = OpeningSum(vec4<f32>(0.0), vec4<f32>(0.0));
    var bound = 0.0;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, mean.middle.w > 0.0); once == 0u; once++) {
        let modes = cell_modes(cell.cell.xyz);
        let H = strain_at(modes, vec3<f32>(0.0), inverse);
        let gradient = deformation_gradient(H);
        let cof = cofactor(gradient);
        let width = 1.0 / inverse;
        let volume = width.x * width.y * width.z;
        // y is linear in the cell, as its gradient is one: a force at a place is one on the middle and one on the gradient.
        let middle = across(cell.middle.xyz + modes.mean - mean.middle.xyz) * scale;
        let lateral = mat3x3<f32>(
            across(gradient[0]) * (width.x * scale),
            across(gradient[1]) * (width.y * scale),
            across(gradient[2]) * (width.z * scale),
        );
        // The volume is the cell's.
        var dilated = 0.0;
        for (var at = 0u; at < 8u; at++) {
            let eta = middle + lateral * gauss_place(at);
            dilated += 0.125 * (dilation(section.radius, dot(eta, eta)).x - 1.0);
        }
        let dj = jacobian_minus_one(H);
        let J = 1.0 + dj;
        let open = dj + J * dilated;
        var by_gradient = cof * (material.bulk_modulus * (open * (1.0 + dilated) - dj) * volume);
        let by_dilation = material.bulk_modulus * open * J * volume * 0.125;
        var by_middle = vec3<f32>(0.0);
        for (var at = 0u; at < 8u; at++) {
            let p = gauss_place(at);
            let eta = middle + lateral * p;
            let rate = dilation(section.radius, dot(eta, eta)) * by_dilation;
            let by_place = eta * (2.0 * rate.y * scale);
            by_middle += by_place;
            by_gradient += outer(by_place, p * width);
            sum.by_centre += vec4<f32>(-by_place, rate.z * scale);
        }
        // What keeps the shape, where points do not carry it: in the middle of a cell without points.
        let closed = isochoric_stress(material, H);
        var tangent = vec2<f32>(closed.tangent, closed.turned_tangent);
        var grown = 1.0;
        let size = pow(volume, 0.33333333);
        let whole = cell.stations.z == 8u;
        for (var at = cell.stations.z; at < cell.stations.w; at++) {
            let p = gauss_place(at);
            let place = opened_place(section, middle + lateral * p, gradient);
            let part = select(0.125 * volume * share_of(cell, at), volume, whole);
            let now = opened_stress(cell.cell.w, place, H);
            let by_place = now.derivatives.place * part;
            by_middle += by_place;
            by_gradient += now.derivatives.gradient * part + outer(by_place, p * width);
            sum.by_centre += vec4<f32>(-by_place, now.derivatives.radius * part);
            sum.by_rate += vec4<f32>(now.derivatives.centre_rate, now.derivatives.radius_rate) * part;
            let growth = amplification(place);
            grown = max(grown, select(1.0, growth.x + growth.y * size, part > 0.0));
            tangent = max(tangent, select(vec2<f32>(0.0), vec2<f32>(now.tangent, now.turned_tangent), part > 0.0));
        }
        // Bound of the stiffness beyond that of the closed cell, where open faces may meet.
        let b = dot(inverse, inverse) * 0.0625;
        let cof_b = squared_norm_bound(cof) * b;
        let most = max(1.0 + dilated, 1.0);
        let with_opening = (material.bulk_modulus + tangent.y) * cof_b * most * most + tangent.x * grown * grown * b;
        let without = (material.bulk_modulus + closed.turned_tangent) * cof_b + closed.tangent * b;
        bound = 8.0 * volume * max(with_opening - without, 0.0);
        f.mean = by_middle;
        f.x = by_gradient[0] * inverse.x;
        f.y = by_gradient[1] * inverse.y;
        f.z = by_gradient[2] * inverse.z;
    }
    let slot = opening.counts.y + index;
    for (var c = 0u; c < 8u; c++) {
        opening_corners[8u * slot + c] = vec4<f32>(force_on_corner(f, c), bound);
    }
    opening_sums[slot] = sum;
}
