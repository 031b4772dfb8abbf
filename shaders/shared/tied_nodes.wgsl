// Copies of a node that move as one, itself among them, ascending; unused places hold NO_NODE.
@group(1) @binding(12) var<storage, read> tied_nodes: array<vec4<u32>>;

const NO_NODE: u32 = 0xffffffffu;
