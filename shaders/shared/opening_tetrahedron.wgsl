// A tetrahedron beside an opened path, with the edges of the cube of its volume.
#import shared/tetrahedron
const CORNERS: u32 = 4u;
// Places of Gauss' rule of four points lie on the way from the middle to the corners, this part of it: 1/sqrt 5.
const CORNER_PART: f32 = 0.4472136;

fn cell_modes(cell: vec3<u32>) -> CellModes {
    let tet = tetrahedra[cell.x];
    // In integers: differences stay exact.
    let origin = node_displacement[tet.nodes.x];
    let b = relative_displacement(node_displacement[tet.nodes.y], origin);
    let c = relative_displacement(node_displacement[tet.nodes.z], origin);
    let d = relative_displacement(node_displacement[tet.nodes.w], origin);
    let H = tetrahedron_gradient(tet, b, c, d);
    let edge = tet.gradient_c_and_edge.w;
    var m: CellModes;
    m.mean = vec3<f32>(origin.xyz) * DISPLACEMENT_UNIT + (b + c + d) * 0.25;
    m.x = H[0] * edge;
    m.y = H[1] * edge;
    m.z = H[2] * edge;
    return m;
}

// Gradients B of all corners [1/m].
fn corner_gradients(tet: Tetrahedron) -> mat4x3<f32> {
    let b = tet.gradient_b_and_volume.xyz;
    let c = tet.gradient_c_and_edge.xyz;
    let d = tet.gradient_d_and_material.xyz;
    return mat4x3<f32>(-(b + c + d), b, c, d);
}

// Their lengths [1/m].
fn gradient_lengths(cell: vec3<u32>) -> vec4<f32> {
    let B = corner_gradients(tetrahedra[cell.x]);
    return vec4<f32>(length(B[0]), length(B[1]), length(B[2]), length(B[3]));
}

// Force on a corner from those on the modes.
fn force_on_corner(m: CellModes, cell: vec3<u32>, corner: u32) -> vec3<f32> {
    let tet = tetrahedra[cell.x];
    var B = corner_gradients(tet);
    let b = B[corner] * tet.gradient_c_and_edge.w;
    return m.mean * 0.25 + m.x * b.x + m.y * b.y + m.z * b.z;
}

fn volume_place(cell: vec3<u32>, i: u32) -> vec3<f32> {
    let tet = tetrahedra[cell.x];
    let B = corner_gradients(tet);
    // Edges from the first corner: the inverse of the gradients of the others.
    let six_volumes = 6.0 * tet.gradient_b_and_volume.w;
    let to_b = cross(B[2], B[3]) * six_volumes;
    let to_c = cross(B[3], B[1]) * six_volumes;
    let to_d = cross(B[1], B[2]) * six_volumes;
    var to_corner = mat4x3<f32>(vec3<f32>(0.0), to_b, to_c, to_d);
    return (to_corner[i] - (to_b + to_c + to_d) * 0.25) * (CORNER_PART / tet.gradient_c_and_edge.w);
}
