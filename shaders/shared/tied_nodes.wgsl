// Copies of a node that move as one, where grid lines are doubled.
struct TiedNode {
    // The copies, the node itself among them, ascending; unused places hold NO_NODE.
    copies: vec4<u32>,
    // Mass of the node and of all copies [kg].
    mass: f32,
    whole_mass: f32,
    _pad0: f32,
    _pad1: f32,
}

@group(1) @binding(12) var<storage, read> tied_nodes: array<TiedNode>;

const NO_NODE: u32 = 0xffffffffu;
