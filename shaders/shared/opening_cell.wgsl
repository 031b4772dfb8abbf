// A cell that the map reaches, as both the stage of its forces and that of its energies read it.
#import shared/opening_cluster

struct OpeningCell {
    // Cell, w: index of its material.
    cell: vec4<u32>,
    // Run of cells that it is of; the others unused.
    stations: vec4<u32>,
    // Middle of the cell from the entry of the path [m]; one over its edges [1/m]. w: mean and variance of the growth, over rc^2 [R].
    middle: vec4<f32>,
    inverse: vec4<f32>,
    // Middle of what points do not carry, from the middle of the cell in edges; w: part of the volume.
    place: vec4<f32>,
}

@group(1) @binding(23) var<storage, read> near_cells: array<OpeningCell>;

// Places of Gauss' rule of two points per axis, four of eight, no two on one edge: as good to second order, and all four across a path along
// an edge.
fn volume_place(i: u32) -> vec3<f32> {
    let signs = vec3<f32>(vec3<u32>(i & 1u, i >> 1u, (i ^ (i >> 1u)) & 1u)) * 2.0 - 1.0;
    return signs * 0.28867513;
}
