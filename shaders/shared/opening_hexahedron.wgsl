// A hexahedron beside an opened path.
const CORNERS: u32 = 8u;

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

// Force on a corner from those on the modes. Which cell it is makes no difference.
fn force_on_corner(m: CellModes, cell: vec3<u32>, corner: u32) -> vec3<f32> {
    let s = vec3<f32>(vec3<u32>(corner & 1u, (corner >> 1u) & 1u, corner >> 2u)) * 2.0 - 1.0;
    return m.mean * 0.125 + (m.x * s.x + m.y * s.y + m.z * s.z) * 0.25
        + (m.xy * (s.x * s.y) + m.yz * (s.y * s.z) + m.zx * (s.z * s.x)) * 0.5 + m.xyz * (s.x * s.y * s.z);
}

// Places of Gauss' rule of two points per axis, four of eight, no two on one edge: as good to second order, and all four across a path along
// an edge. They are the same in every cell.
fn volume_place(cell: vec3<u32>, i: u32) -> vec3<f32> {
    let signs = vec3<f32>(vec3<u32>(i & 1u, i >> 1u, (i ^ (i >> 1u)) & 1u)) * 2.0 - 1.0;
    return signs * 0.28867513;
}
