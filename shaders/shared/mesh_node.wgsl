// A node of a tetrahedral mesh.
struct MeshNode {
    // Rest position relative to the centre of the bounding box [m], w unused.
    arm: vec4<f32>,
    // Its cells: entries `first_four .. end_four` of `node_cells`, its forces: the same fours of slots of `corner_force`.
    first_four: u32,
    end_four: u32,
    // Bits 0..2: held components x, y, z; bits 3..8: faces x-, x+, y-, y+, z-, z+ that it lies on.
    flags: u32,
    // One over its volume, a quarter of that of its cells [1/m^3].
    inverse_volume: f32,
}

@group(1) @binding(9) var<storage, read> mesh_nodes: array<MeshNode>;
