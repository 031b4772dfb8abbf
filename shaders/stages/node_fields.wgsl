// Stage node_fields: means over the cells around every node, of those that are tissue.
#import shared/params
#import shared/thread_index
#ifdef TETRAHEDRA
#import shared/mesh_node
#endif

@group(2) @binding(20) var<storage, read_write> drawn_cells: array<vec4<f32>>;
@group(2) @binding(21) var<storage, read_write> drawn_nodes: array<vec4<f32>>;
#ifdef TETRAHEDRA
@group(1) @binding(10) var<storage, read> node_cells: array<vec4<u32>>;
#endif

// Adds a cell to the sum of the fields and to the number of cells.
fn add_cell(sum: ptr<function, vec4<f32>>, count: ptr<function, f32>, cell: u32) {
    let field = drawn_cells[min(cell, CELL_COUNT)];
    let weight = select(0.0, 1.0, cell < CELL_COUNT && field.w >= 0.0);
    *sum += field * weight;
    *count += weight;
}

@compute @workgroup_size(64)
fn node_fields(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let node = thread_index(id, groups);
    if (node >= NODE_COUNT) {
        return;
    }
    var sum = vec4<f32>(0.0);
    var count = 0.0;
#ifdef TETRAHEDRA
    let place = mesh_nodes[node];
    for (var four = place.first_four; four < place.end_four; four++) {
        let cells = node_cells[four];
        add_cell(&sum, &count, cells.x);
        add_cell(&sum, &count, cells.y);
        add_cell(&sum, &count, cells.z);
        add_cell(&sum, &count, cells.w);
    }
#else
    let layer = NODES_X * NODES_Y;
    let k = quotient(node, layer);
    let j = quotient(node - k * layer, NODES_X);
    let i = node - k * layer - j * NODES_X;
    for (var corner = 0u; corner < 8u; corner++) {
        // Cells around the node; below zero an index wraps to one that is too large.
        let at = vec3<u32>(i, j, k) - vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let inside = at.x < CELLS_X && at.y < CELLS_Y && at.z < CELLS_Z;
        let cell = (at.z * CELLS_Y + at.y) * CELLS_X + at.x;
        add_cell(&sum, &count, select(CELL_COUNT, cell, inside));
    }
#endif
    drawn_nodes[node] = sum / max(count, 1.0);
}
