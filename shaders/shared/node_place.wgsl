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
    let layer = NODES_X * NODES_Y;
    let k = quotient(node, layer);
    let j = quotient(node - k * layer, NODES_X);
    return NodePlace(node - k * layer - j * NODES_X, j, k);
}

// Bits 0..2: held or driven components x, y, z.
fn held_components(place: NodePlace) -> u32 {
    let i = place.i;
    let j = place.j;
    let k = place.k;
    var held = select(0u, FIXED_X_MIN, i == 0u) | select(0u, FIXED_X_MAX, i + 1u == NODES_X);
    held |= select(0u, FIXED_Y_MIN, j == 0u) | select(0u, FIXED_Y_MAX, j + 1u == NODES_Y);
    held |= select(0u, FIXED_Z_MIN, k == 0u) | select(0u, FIXED_Z_MAX, k + 1u == NODES_Z);
    return held;
}
#endif
