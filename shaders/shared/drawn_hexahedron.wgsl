// A hexahedron as a window draws it.
#import shared/drawn_cell
#import shared/hexahedron_energy
#ifdef PUNCTURE
#import effects/puncture
#endif

#ifdef OPENING
#import shared/grid_lines
#import shared/needle_in_tissue

@group(2) @binding(22) var<uniform> drawn_needle: DrawnNeedle;

// Where a corner is with the path closed [m].
fn corner_place(cell: vec3<u32>, corner: u32) -> vec3<f32> {
    let at = cell + vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
    let rest = vec3<f32>(grid_lines[at.x], grid_lines[NODES_X + at.y], grid_lines[NODES_X + NODES_Y + at.z]);
    return rest + vec3<f32>(node_displacement[corner_node(cell, corner)].xyz) * DISPLACEMENT_UNIT;
}

// F - I of a cell whose nodes are where they are seen; in the middle of one that the path runs through, where nodes tell nothing, by the map.
fn seen_strain(cell: vec3<u32>, H: mat3x3<f32>) -> mat3x3<f32> {
    let middle = 0.5 * (corner_place(cell, 0u) + corner_place(cell, 7u));
    let beside = beside_axis(drawn_needle, middle);
    let shaft = drawn_needle.tip.w;
    let distance = length(beside.xyz);
    var out = H;
    if (distance >= shaft) {
        let shape = column_at(cell.x, cell.y);
        var gradient = array<vec3<f32>, 3>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
        for (var corner = 0u; corner < 8u; corner++) {
            let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
            let pushed = pushed_aside(drawn_needle, beside_axis(drawn_needle, corner_place(cell, corner)));
            gradient[0] += pushed * s.x;
            gradient[1] += pushed * s.y;
            gradient[2] += pushed * s.z;
        }
        out += mat3x3<f32>(
            slope_x(shape, gradient[0], gradient[1]),
            slope_y(shape, gradient[0], gradient[1]),
            gradient[2] * layer_edge(cell.z).quarter_inverse,
        );
    } else {
        out = strain_on_path(drawn_needle, H, beside);
    }
    return out;
}
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
#ifdef OPENING
    if (drawn_needle.tip.w > 0.0) {
        out.H = seen_strain(cell, out.H);
    }
#endif
    out.length = column_cube_root(shape) * edge_z.cube_root;
    out.tissue = column_area(shape) * edge_z.length > 0.0;
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    return out;
}
