// Points in one cell, as both the stage of their forces and that of their energies read them.
#import shared/opened_point
#import shared/displacement

struct OpeningCluster {
    // Cell, w: index of its material.
    cell: vec4<u32>,
    // First point, end; zw unused.
    points: vec4<u32>,
    // Middle of the cell from the entry of the path [m]; one over its edges [1/m]. w unused.
    middle: vec4<f32>,
    inverse: vec4<f32>,
}

struct OpeningPoint {
    // Place in the cell from its middle, -1/2..1/2; w: rest volume [m^3].
    place: vec4<f32>,
    // Station; the sum that its derivatives go into, and 1 at the last point of that sum. w unused.
    numbers: vec4<u32>,
}

@group(1) @binding(20) var<storage, read> path_clusters: array<OpeningCluster>;
// In the order in which they are cut.
@group(1) @binding(21) var<storage, read> path_points: array<OpeningPoint>;
@group(3) @binding(20) var<storage, read> path_stations: array<OpeningStation>;
@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

// Displacement in a cell as `mean + p.x x + p.y y + p.z z + p.x p.y xy + p.y p.z yz + p.z p.x zx + p.x p.y p.z xyz`, with the place p from
// the middle, -1/2..1/2; forces on the same.
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

fn cell_modes(cell: vec3<u32>) -> CellModes {
    // In integers: differences stay exact.
    let first = (cell.z * NODES_Y + cell.y) * NODES_X + cell.x;
    let origin = node_displacement[first].xyz;
    var m: CellModes;
    for (var corner = 0u; corner < 8u; corner++) {
        let bit = vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u);
        let node = first + (bit.z * NODES_Y + bit.y) * NODES_X + bit.x;
        let u = vec3<f32>(node_displacement[node].xyz - origin) * DISPLACEMENT_UNIT;
        let s = vec3<f32>(bit) * 2.0 - 1.0;
        m.mean += u * 0.125;
        m.x += u * (0.25 * s.x);
        m.y += u * (0.25 * s.y);
        m.z += u * (0.25 * s.z);
        m.xy += u * (0.5 * s.x * s.y);
        m.yz += u * (0.5 * s.y * s.z);
        m.zx += u * (0.5 * s.z * s.x);
        m.xyz += u * (s.x * s.y * s.z);
    }
    m.mean += vec3<f32>(origin) * DISPLACEMENT_UNIT;
    return m;
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

// Force on a corner from those on the modes.
fn force_on_corner(m: CellModes, corner: u32) -> vec3<f32> {
    let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
    return m.mean * 0.125 + (m.x * s.x + m.y * s.y + m.z * s.z) * 0.25
        + (m.xy * (s.x * s.y) + m.yz * (s.y * s.z) + m.zx * (s.z * s.x)) * 0.5 + m.xyz * (s.x * s.y * s.z);
}
