// A hexahedron as a window draws it.
#import shared/drawn_cell
#import shared/hexahedron_energy
#ifdef PUNCTURE
#import effects/puncture
#endif

fn drawn_cell(index: u32) -> DrawnCell {
    let layer = CELLS_X * CELLS_Y;
    let k = quotient(index, layer);
    let j = quotient(index - k * layer, CELLS_X);
    let cell = vec3<u32>(index - k * layer - j * CELLS_X, j, k);
    let shape = column_at(cell.x, cell.y);
    let edge_z = layer_edge(cell.z);
    var gradient = array<vec3<f32>, 3>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    let origin = node_displacement[corner_node(cell, 0u)].xyz;
    for (var corner = 0u; corner < 8u; corner++) {
        let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
        let value = vec3<f32>(node_displacement[corner_node(cell, corner)].xyz - origin) * DISPLACEMENT_UNIT;
        gradient[0] += value * s.x;
        gradient[1] += value * s.y;
        gradient[2] += value * s.z;
    }
    var out: DrawnCell;
    out.H = mat3x3<f32>(
        slope_x(shape, gradient[0], gradient[1]),
        slope_y(shape, gradient[0], gradient[1]),
        gradient[2] * edge_z.quarter_inverse,
    );
    out.material = material_of(index);
    out.pressure = materials[out.material].bulk_modulus * jacobian_minus_one(out.H);
    out.length = column_cube_root(shape) * edge_z.cube_root;
    out.tissue = column_area(shape) * edge_z.length > 0.0;
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    return out;
}
