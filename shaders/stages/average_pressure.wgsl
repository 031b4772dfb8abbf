// Stage average_pressure: dilatation and pressure of every node from the tetrahedra around it.
//
// theta_a = sum V_e/4 (J_e - 1) / V_a, K_a = sum V_e/4 w_e K_e / V_a, p_a = K_a theta_a.
#import shared/params
#import shared/thread_index
#import shared/elastic
#import shared/mesh_node
#import shared/averaged_dilatation

// Cells around the nodes, four at a time; the last four of a node are filled up with `CELL_COUNT`.
@group(1) @binding(10) var<storage, read> node_cells: array<vec4<u32>>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

@compute @workgroup_size(64)
fn average_pressure(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let node = thread_index(id, groups);
    if (node >= NODE_COUNT) {
        return;
    }
    let place = mesh_nodes[node];
    var dilatation = 0.0;
    var stiffness = 0.0;
    for (var four = place.first_four; four < place.end_four; four++) {
        let cells = node_cells[four];
        dilatation += (cell_dilatation[cells.x] + cell_dilatation[cells.y])
            + (cell_dilatation[cells.z] + cell_dilatation[cells.w]);
#ifdef VARYING_STIFFNESS
        stiffness += (cell_bulk_stiffness[cells.x] + cell_bulk_stiffness[cells.y])
            + (cell_bulk_stiffness[cells.z] + cell_bulk_stiffness[cells.w]);
#endif
    }
    dilatation *= place.inverse_volume;
    stiffness *= place.inverse_volume;
#ifndef VARYING_STIFFNESS
    stiffness = materials[0].bulk_modulus;
#endif
    pressed_nodes[node] = vec4<i32>(node_displacement[node].xyz, bitcast<i32>(stiffness * dilatation));
    node_dilatation[node] = dilatation;
}
