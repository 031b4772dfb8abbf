// Stage opening_cells: what opening adds to the forces of the cells that the map reaches, one thread per cell.
// Equations: src/needle/opening.rs and near_cell_forces in src/cpu/opening.rs.
#import shared/thread_index
#import shared/opening_cell
#ifdef TETRAHEDRA
#import shared/averaged_dilatation
#endif

// f_int on the corners of a slot [N]; w: bound of the stiffness there [N/m].
@group(3) @binding(21) var<storage, read_write> opening_corners: array<vec4<f32>>;
@group(3) @binding(22) var<storage, read_write> opening_sums: array<OpeningSum>;

@compute @workgroup_size(64)
fn opening_cells(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let index = thread_index(id, groups);
    if (index >= opening.counts.z) {
        return;
    }
    // Where nothing was ever cut nothing was ever written. A loop, since software adapters walk through an `if`.
    let run = opening.counts.x + near_cells[index].stations.x;
    for (var once = select(1u, 0u, path_stations[run].place.y > 0.0); once == 0u; once++) {
        open_cell(index, path_stations[run]);
    }
}

// `path`: the mean of the sections in it.
fn open_cell(index: u32, path: OpeningStation) {
    let centre = path.centre;
    let cell = near_cells[index];
    let inverse = cell.inverse.xyz;
    let scale = 1.0 / opening.direction.w;
    let section = section_of(path);
    let material = materials[cell.cell.w];
    var f: CellModes;
    var sum = OpeningSum();
    let modes = cell_modes(cell.cell.xyz);
    let H = strain_at(modes, vec3<f32>(0.0), inverse);
    let gradient = deformation_gradient(H);
    let cof = cofactor(gradient);
    let width = 1.0 / inverse;
    // Where the path has closed again all of it is zero.
    let volume = select(0.0, width.x * width.y * width.z, centre.w > 0.0);
    // y is linear in the cell, as its gradient is one: a force at a place is one on the middle and one on the gradient.
    let middle = across(cell.middle.xyz + modes.mean - centre.xyz) * scale;
    let lateral = lateral_edges(gradient, width);
    // The volume is the cell's, or that of the nodes around it: the mean of the dilation, with its derivatives.
    let dilated = dilated_cell(cell, section, middle, lateral);
    let area = section.radius * section.radius;
    // What grows unevenly in the cell.
    let uneven = area * area * cell.inverse.w;
    let dj = jacobian_minus_one(H);
    let J = 1.0 + dj;
#ifdef TETRAHEDRA
    let nodes = tetrahedra[cell.cell.x].nodes;
    let pressure = 0.25
        * ((averaged_pressure(pressed_nodes[nodes.x]) + averaged_pressure(pressed_nodes[nodes.y]))
        + (averaged_pressure(pressed_nodes[nodes.z]) + averaged_pressure(pressed_nodes[nodes.w])));
    let by_jacobian = pressure * dilated.less_one;
#else
    let pressure = material.bulk_modulus * (dj + J * dilated.less_one);
    let by_jacobian = pressure * dilated.less_one + material.bulk_modulus * J * dilated.less_one;
#endif
    let by_dilation = pressure * J * volume * 0.25 * scale;
    var by_gradient = cof * ((by_jacobian + material.bulk_modulus * J * uneven) * volume);
    let moments = dilated.moments;
    by_gradient += mat3x3<f32>(moments[0] * width.x, moments[1] * width.y, moments[2] * width.z) * by_dilation;
    let rates = dilated.rates;
    var by_middle = rates.xyz * by_dilation;
    sum.by_centre = vec4<f32>(-rates.xyz, rates.w) * by_dilation;
    sum.by_centre.w += 2.0 * J * section.radius * volume * scale
        * (pressure * cell.middle.w + material.bulk_modulus * J * area * cell.inverse.w);
    // What keeps the shape, of what points do not carry.
    let closed = shape_stress(cell.cell.w, H);
    let p = cell.place.xyz;
    let part = cell.place.w * volume * section.left;
    let place = opened_place(section, middle + lateral * p, gradient);
    let now = opened_stress(cell.cell.w, place, H, closed.P);
    let by_place = now.derivatives.place * part;
    by_middle += by_place;
    by_gradient += now.derivatives.gradient * part + outer(by_place, p * width);
    sum.by_centre += vec4<f32>(-by_place, now.derivatives.radius * part);
    sum.by_rate += vec4<f32>(now.derivatives.centre_rate, now.derivatives.radius_rate) * part;
#ifdef LAID
    let from_centre = cell.middle.xyz + modes.mean - centre.xyz;
    sum.by_moment = vec4<f32>(moment_of(gradient, from_centre, by_gradient, by_middle), 0.0);
#endif
    let growth = amplification(place);
    let carries = part > 0.0;
    let grown = select(1.0, max(1.0, growth.x + growth.y * pow(width.x * width.y * width.z, 0.33333333)), carries);
    let opened = select(vec2<f32>(0.0), vec2<f32>(now.tangent, now.turned_tangent), carries);
    let tangent = max(vec2<f32>(closed.tangent, closed.turned_tangent), opened);
    // Bound of the stiffness beyond that of the closed cell, where open faces may meet.
    let most = max(1.0 + dilated.less_one, 1.0);
    let widened = most * most + uneven;
#ifdef TETRAHEDRA
    // Rows of the cell's own: products of lengths and their sum.
    let B = corner_gradients(tetrahedra[cell.cell.x]);
    let steep = gradient_lengths(cell.cell.xyz);
    let turned = vec4<f32>(length(cof * B[0]), length(cof * B[1]), length(cof * B[2]), length(cof * B[3]));
    let b = steep * dot(steep, vec4<f32>(1.0));
    let cof_b = turned * dot(turned, vec4<f32>(1.0));
    let rows = 1.0;
#else
    let b = vec4<f32>(dot(inverse, inverse) * 0.0625);
    let cof_b = squared_norm_bound(cof) * b;
    let rows = 8.0;
#endif
    let with_opening = (material.bulk_modulus + tangent.y) * cof_b * widened + tangent.x * grown * grown * b;
    let without = (material.bulk_modulus + closed.turned_tangent) * cof_b + closed.tangent * b;
    let bound = rows * volume * max(with_opening - without, vec4<f32>(0.0));
    f.mean = by_middle;
    f.x = by_gradient[0] * inverse.x;
    f.y = by_gradient[1] * inverse.y;
    f.z = by_gradient[2] * inverse.z;
    let slot = opening.counts.y + index;
    for (var c = 0u; c < CORNERS; c++) {
        opening_corners[CORNERS * slot + c] = vec4<f32>(force_on_corner(f, cell.cell.xyz, c), bound[c & 3u]);
    }
    opening_sums[opening.sums.w + index] = sum;
}
