// Where a node lies, in both meshes: what holds it, on which faces it lies.
#ifdef TETRAHEDRA
#import shared/mesh_node

alias NodePlace = MeshNode;

fn node_place(node: u32) -> NodePlace {
    return mesh_nodes[node];
}

// Bits 0..2: held or driven components x, y, z.
fn held_components(place: NodePlace) -> u32 {
    return place.flags;
}
#else
// Grid coordinates.
struct NodePlace {
    i: u32,
    j: u32,
    k: u32,
}

fn node_place(node: u32) -> NodePlace {
    let layer = params.nodes_x * params.nodes_y;
    let k = quotient(node, layer);
    let j = quotient(node - k * layer, params.nodes_x);
    return NodePlace(node - k * layer - j * params.nodes_x, j, k);
}

// Bits 0..2: held or driven components x, y, z.
fn held_components(place: NodePlace) -> u32 {
    let i = place.i;
    let j = place.j;
    let k = place.k;
    var held = select(0u, params.fixed_x_min, i == 0u) | select(0u, params.fixed_x_max, i + 1u == params.nodes_x);
    held |= select(0u, params.fixed_y_min, j == 0u) | select(0u, params.fixed_y_max, j + 1u == params.nodes_y);
    held |= select(0u, params.fixed_z_min, k == 0u) | select(0u, params.fixed_z_max, k + 1u == params.nodes_z);
    return held;
}
#endif
