// Energies and Jacobians of one hexahedron from its eight corner displacements, corner index = x bit + 2 y bit + 4 z bit.
#import shared/cell_energy
#import shared/cell_edge

fn corner_node(cell: vec3<u32>, corner: u32) -> u32 {
    let at = cell + vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
    return (at.z * NODES_Y + at.y) * NODES_X + at.x;
}

// `number`: its material; `kept`: part of the stiffness that the cell keeps for other reasons than its material's.
fn cell_energy(cell: vec3<u32>, number: u32, kept: f32, u: ptr<function, array<vec3<f32>, 8>>) -> CellEnergy {
    let shape = column_at(cell.x, cell.y);
    let edge_z = layer_edge(cell.z);
    var gradient = array<vec3<f32>, 3>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    var q = array<vec3<f32>, 4>(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    for (var corner = 0u; corner < 8u; corner++) {
        let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
        let value = (*u)[corner];
        gradient[0] += value * s.x;
        gradient[1] += value * s.y;
        gradient[2] += value * s.z;
        q[0] += value * (s.y * s.z * 0.125);
        q[1] += value * (s.z * s.x * 0.125);
        q[2] += value * (s.x * s.y * 0.125);
        q[3] += value * (s.x * s.y * s.z * 0.125);
    }
    let H = mat3x3<f32>(
        slope_x(shape, gradient[0], gradient[1]),
        slope_y(shape, gradient[0], gradient[1]),
        gradient[2] * edge_z.quarter_inverse,
    );
    q[2] -= tapered(shape, H);
    var smallest = 1e30;
    for (var corner = 0u; corner < 8u; corner++) {
        // Each edge of the corner, from its low to its high end.
        let low_x = corner & 6u;
        let low_y = corner & 5u;
        let low_z = corner & 3u;
        let xi = (*u)[low_x | 1u] - (*u)[low_x];
        let eta = (*u)[low_y | 2u] - (*u)[low_y];
        let z = ((*u)[low_z | 4u] - (*u)[low_z]) * (4.0 * edge_z.quarter_inverse) + vec3<f32>(0.0, 0.0, 1.0);
        let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
        smallest = min(smallest, corner_jacobian(shape, s, xi, eta, z));
    }
    let volume = column_area(shape) * edge_z.length;
    let size = column_cube_root(shape) * edge_z.cube_root;
    let q2 = dot(q[0], q[0]) + dot(q[1], q[1]) + dot(q[2], q[2]) + dot(q[3], q[3]);
    var e: CellEnergy;
    let index = (cell.z * CELLS_Y + cell.y) * CELLS_X + cell.x;
    let point = point_energy(PointPlace(index, number, size, kept, 0.0, 0.0), H);
    e.elastic = volume * point.stored;
    e.held = volume * point.held;
    e.hourglass = 0.5 * materials[number].hourglass * size * q2
        * (1.0 + 0.5 * params.quartic * q2 / max(size * size, SMALLEST_SQUARE));
    e.hourglass *= point.intact;
    e.intact = point.intact;
    e.jacobian = 1.0 + point.dj;
    e.corner_jacobian = smallest;
    return e;
}
