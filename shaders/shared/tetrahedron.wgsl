// A tetrahedron at rest, corners a, b, c, d right-handed. Equations: src/engine/elements.rs.
struct Tetrahedron {
    // Nodes of the corners, and the slots of `corner_force` that take the forces on them.
    nodes: vec4<u32>,
    slots: vec4<u32>,
    // Gradients B [1/m] of b, c, d; that of a is minus their sum. In w: V [m^3], V^(1/3) [m], index of the material.
    gradient_b_and_volume: vec4<f32>,
    gradient_c_and_edge: vec4<f32>,
    gradient_d_and_material: vec4<f32>,
}

@group(1) @binding(8) var<storage, read> tetrahedra: array<Tetrahedron>;

fn material_number(tet: Tetrahedron) -> u32 {
#ifdef REGIONS
    return u32(tet.gradient_d_and_material.w);
#else
    return 0u;
#endif
}

// H = F - I from the displacements of b, c, d relative to a [m].
fn tetrahedron_gradient(tet: Tetrahedron, b: vec3<f32>, c: vec3<f32>, d: vec3<f32>) -> mat3x3<f32> {
    let B = tet.gradient_b_and_volume;
    let C = tet.gradient_c_and_edge;
    let D = tet.gradient_d_and_material;
    return mat3x3<f32>(
        b * B.x + c * C.x + d * D.x,
        b * B.y + c * C.y + d * D.y,
        b * B.z + c * C.z + d * D.z,
    );
}

// Displacement of one corner relative to another [m]; the difference is exact.
fn relative_displacement(u: vec4<i32>, origin: vec4<i32>) -> vec3<f32> {
    return vec3<f32>(u.xyz - origin.xyz) * DISPLACEMENT_UNIT;
}
