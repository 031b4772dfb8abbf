// Stage element_forces: one-point hexahedra with quartic hourglass control, total Lagrangian.
//
// One thread walks up a strip of cells in one column. It keeps the plane of four nodes between two cells, so that
// every cell loads four nodes and stores four forces instead of eight. On a rectilinear grid all gradients and the
// four hourglass vectors are one 8-point Walsh-Hadamard transform: sums over xi, eta, zeta, eta zeta, zeta xi,
// xi eta, xi eta zeta. The sums are formed in integers and are exact. Equations: src/engine/elements.rs.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/cell_edge
#import shared/material_point
#import shared/corner_force
#ifdef PUNCTURE
#import effects/puncture
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

// Writes the forces of one plane from their transform: z (all corners alike), x, y, xy.
fn store_plane(slot: u32, z: vec3<f32>, x: vec3<f32>, y: vec3<f32>, xy: vec3<f32>, bound: f32) {
    let stride = PADDED_COLUMNS;
    corner_force[slot] = vec4<f32>(x + y - z - xy, bound);
    corner_force[slot + stride] = vec4<f32>(y + xy - z - x, bound);
    corner_force[slot + 2u * stride] = vec4<f32>(x + xy - z - y, bound);
    corner_force[slot + 3u * stride] = vec4<f32>(-(z + x + y + xy), bound);
}

// 1 where a cell ends at a face of the block that does not hold its normal component.
fn open_side(at: u32, last: u32, normal: u32, fixed_min: u32, fixed_max: u32) -> u32 {
    return select(0u, 1u, (at == 0u && (fixed_min & normal) == 0u) || (at == last && (fixed_max & normal) == 0u));
}

// Bound of |sum of t_m a_m|^2 from the Gram matrix of three vectors, diagonal and the others' magnitudes: unit vectors t within
// the block; on its open edges each |t_m| <= 1.
fn largest_square(diagonal: vec3<f32>, xy: f32, yz: f32, zx: f32, on_edge: bool) -> f32 {
    let row = max(max(diagonal.x + xy + zx, diagonal.y + xy + yz), diagonal.z + yz + zx);
    let all = diagonal.x + diagonal.y + diagonal.z + 2.0 * (xy + yz + zx);
    return select(row, all, on_edge);
}

@compute @workgroup_size(64)
fn element_forces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let thread = thread_index(id, groups);
#ifdef EMPTY_CELLS
    if (thread >= BUSY_STRIP_COUNT) {
        return;
    }
    let busy = cell_material[CELL_COUNT + thread];
    let strip = quotient(busy, COLUMN_COUNT);
    let column = busy - strip * COLUMN_COUNT;
#else
    if (thread >= COLUMN_COUNT * STRIP_COUNT) {
        return;
    }
    let strip = quotient(thread, COLUMN_COUNT);
    let column = thread - strip * COLUMN_COUNT;
#endif
    let j = quotient(column, CELLS_X);
    let i = column - j * CELLS_X;
    let first = strip * STRIP_LAYERS;
    let last = min(first + STRIP_LAYERS, CELLS_Z);

    let shape = column_at(i, j);
    let open_sides = open_side(i, CELLS_X - 1u, 1u, FIXED_X_MIN, FIXED_X_MAX)
        + open_side(j, CELLS_Y - 1u, 2u, FIXED_Y_MIN, FIXED_Y_MAX);
    let area = column_area(shape);
    let area_cube_root = column_cube_root(shape);
    let row = NODES_X;
    let layer = NODES_X * NODES_Y;
    var node = first * layer + j * row + i;
    var b0 = node_displacement[node].xyz;
    var b1 = node_displacement[node + 1u].xyz;
    var b2 = node_displacement[node + row].xyz;
    var b3 = node_displacement[node + row + 1u].xyz;
    var lower_x = (b1 - b0) + (b3 - b2);
    var lower_y = (b2 - b0) + (b3 - b1);
    var lower_xy = (b0 - b1) + (b3 - b2);
    // What the cell below left on the plane.
    var left_z = vec3<f32>(0.0);
    var left_x = vec3<f32>(0.0);
    var left_y = vec3<f32>(0.0);
    var left_xy = vec3<f32>(0.0);
    var left_bound = 0.0;
    var slot = corner_slot(strip, 0u, 0u, padded_column(i, j));

    for (var k = first; k < last; k++) {
        let edge_z = layer_edge(k);
        node += layer;
        let t0 = node_displacement[node].xyz;
        let t1 = node_displacement[node + 1u].xyz;
        let t2 = node_displacement[node + row].xyz;
        let t3 = node_displacement[node + row + 1u].xyz;
        let upper_x = (t1 - t0) + (t3 - t2);
        let upper_y = (t2 - t0) + (t3 - t1);
        let upper_xy = (t0 - t1) + (t3 - t2);
        let rise = (t0 - b0) + (t1 - b1) + (t2 - b2) + (t3 - b3);

        let xi = vec3<f32>(upper_x + lower_x) * DISPLACEMENT_UNIT;
        let eta = vec3<f32>(upper_y + lower_y) * DISPLACEMENT_UNIT;
        let H = mat3x3<f32>(
            slope_x(shape, xi, eta),
            slope_y(shape, xi, eta),
            vec3<f32>(rise) * (DISPLACEMENT_UNIT * edge_z.quarter_inverse),
        );
        let volume = area * edge_z.length;
        let size = area_cube_root * edge_z.cube_root;

        // Hourglass: E = 1/2 kappa 3.11 mu0 V^(1/3) q2 (1 + c/2 q2/V^(2/3)), q = Gamma.u/8.
        let eighth = DISPLACEMENT_UNIT * 0.125;
        let q_yz = vec3<f32>(upper_y - lower_y) * eighth;
        let q_zx = vec3<f32>(upper_x - lower_x) * eighth;
        let q_xy = vec3<f32>(upper_xy + lower_xy) * eighth - tapered(shape, H);
        let q_xyz = vec3<f32>(upper_xy - lower_xy) * eighth;
        let q2 = (dot(q_yz, q_yz) + dot(q_zx, q_zx) + dot(q_xy, q_xy) + dot(q_xyz, q_xyz)) / max(size * size, SMALLEST_SQUARE);
        let cell = (k * CELLS_Y + j) * CELLS_X + i;
        let number = material_of(cell);
        let modulus = materials[number].hourglass;

        var kept = 1.0;
#ifdef PUNCTURE
        // The path softens the whole answer of a cell, whatever the material does.
        kept = cell_stiffness[cell];
#endif
        let hourglass_energy = 0.5 * modulus * q2 * (1.0 + 0.5 * params.quartic * q2);
        let point = material_point(PointPlace(cell, number, size, kept, hourglass_energy, 0.0), H);
        let hourglass = point.intact * modulus * size * (1.0 + params.quartic * q2) * 0.125;

        // Stiffness bound: 8 V ((K + turned tangent) max|cof B t|^2 + tangent max|B t|^2) + hourglass over the vectors t of waves.
        let cx = pull_xi(shape, point.cof[0], point.cof[1]);
        let cy = pull_eta(shape, point.cof[0], point.cof[1]);
        let cz = point.cof[2] * edge_z.quarter_inverse;
#ifdef INNER_BOUND
#ifdef EMPTY_CELLS
        let on_edge = cell_material[cell] >= 256u;
#else
        let on_edge = open_sides + open_side(k, CELLS_Z - 1u, 4u, FIXED_Z_MIN, FIXED_Z_MAX) > 1u;
#endif
#else
        let on_edge = true;
#endif
        let cof_b = largest_square(
            vec3<f32>(dot(cx, cx), dot(cy, cy), dot(cz, cz)),
            abs(dot(cx, cy)),
            abs(dot(cy, cz)),
            abs(dot(cz, cx)),
            on_edge,
        );
        let bx = pull_xi(shape, vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0));
        let by = pull_eta(shape, vec3<f32>(1.0, 0.0, 0.0), vec3<f32>(0.0, 1.0, 0.0));
        let bz = edge_z.quarter_inverse * edge_z.quarter_inverse;
        let b = largest_square(vec3<f32>(dot(bx, bx), dot(by, by), bz), abs(dot(bx, by)), 0.0, 0.0, on_edge);
        let bound = point.intact * (8.0 * volume
            * ((materials[number].bulk_modulus + point.turned_tangent) * cof_b + point.tangent * b)
            + modulus * size * (1.0 + 3.0 * params.quartic * q2) * 0.125);
        let factor = point.intact * volume;
        let pressure = materials[number].bulk_modulus * point.dj;
        let stress_x = point.P[0] + point.cof[0] * pressure;
        let stress_y = point.P[1] + point.cof[1] * pressure;
        let a_x = pull_xi(shape, stress_x, stress_y) * factor - taper_pull_xi(shape, q_xy * hourglass);
        let a_y = pull_eta(shape, stress_x, stress_y) * factor - taper_pull_eta(shape, q_xy * hourglass);
        let a_z = (point.P[2] + point.cof[2] * pressure) * (factor * edge_z.quarter_inverse);
        store_plane(
            slot,
            left_z - a_z,
            left_x + a_x - q_zx * hourglass,
            left_y + a_y - q_yz * hourglass,
            left_xy + (q_xy - q_xyz) * hourglass,
            left_bound + bound,
        );
        left_z = a_z;
        left_x = a_x + q_zx * hourglass;
        left_y = a_y + q_yz * hourglass;
        left_xy = (q_xy + q_xyz) * hourglass;
        left_bound = bound;
        slot += 4u * PADDED_COLUMNS;
        b0 = t0;
        b1 = t1;
        b2 = t2;
        b3 = t3;
        lower_x = upper_x;
        lower_y = upper_y;
        lower_xy = upper_xy;
    }
    store_plane(slot, left_z, left_x, left_y, left_xy, left_bound);
}
