// Points in one cell, as both the stage of their forces and that of their energies read them.
#import shared/opened_point
#import shared/displacement

struct OpeningCluster {
    // Cell, of tetrahedra its number; w: index of its material.
    cell: vec4<u32>,
    // First point, end; zw unused.
    points: vec4<u32>,
    // Middle of the cell from the entry of the path [m]; one over its edges, of a tetrahedron those of the cube of its volume [1/m]. w unused.
    middle: vec4<f32>,
    inverse: vec4<f32>,
}

struct OpeningPoint {
    // Place in the cell from its middle in edges; w: rest volume [m^3].
    place: vec4<f32>,
    // Station; the sum that its derivatives go into, and 1 at the last point of that sum. w unused.
    numbers: vec4<u32>,
}

@group(1) @binding(20) var<storage, read> path_clusters: array<OpeningCluster>;
// In the order in which they are cut.
@group(1) @binding(21) var<storage, read> path_points: array<OpeningPoint>;
@group(3) @binding(20) var<storage, read> path_stations: array<OpeningStation>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

#ifdef TETRAHEDRA
#import shared/opening_tetrahedron
#else
#import shared/opening_hexahedron
#endif

// Displacement in a cell as `mean + p.x x + p.y y + p.z z + p.x p.y xy + p.y p.z yz + p.z p.x zx + p.x p.y p.z xyz`, with the place p from
// the middle in edges; forces on the same. A tetrahedron has the first four.
struct CellModes {
    mean: vec3<f32>,
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    xy: vec3<f32>,
    yz: vec3<f32>,
    zx: vec3<f32>,
    xyz: vec3<f32>,
}

// End of points first and end of a cluster that are opened: none where the first is not cut.
fn opened_end(points: vec2<u32>) -> u32 {
    return select(points.x, points.y, path_stations[path_points[points.x].numbers.x].place.y > 0.0);
}

fn displacement_at(m: CellModes, p: vec3<f32>) -> vec3<f32> {
    return m.mean + m.x * p.x + m.y * p.y + m.z * p.z
        + m.xy * (p.x * p.y) + m.yz * (p.y * p.z) + m.zx * (p.z * p.x) + m.xyz * (p.x * p.y * p.z);
}

// H = F_h - I at a place.
fn strain_at(m: CellModes, p: vec3<f32>, inverse: vec3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(
        (m.x + m.xy * p.y + m.zx * p.z + m.xyz * (p.y * p.z)) * inverse.x,
        (m.y + m.yz * p.z + m.xy * p.x + m.xyz * (p.z * p.x)) * inverse.y,
        (m.z + m.zx * p.x + m.yz * p.y + m.xyz * (p.x * p.y)) * inverse.z,
    );
}
