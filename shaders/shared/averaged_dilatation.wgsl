// What tetrahedra share through their nodes: the averaged dilatation and its pressure.

// Per cell: V/4 (J - 1) [m^3]. A last entry of zero fills up the lists of cells around the nodes.
@group(2) @binding(8) var<storage, read_write> cell_dilatation: array<f32>;
#ifdef VARYING_STIFFNESS
// Per cell: V/4 w K [J] with the part w of the stiffness that is left; a last entry of zero as well.
@group(2) @binding(11) var<storage, read_write> cell_bulk_stiffness: array<f32>;
#endif
// Per node: displacement in fixed point, and in w the bits of the averaged pressure; one load gives both.
@group(2) @binding(9) var<storage, read_write> pressed_nodes: array<vec4<i32>>;
// Per node: averaged dilatation theta.
@group(2) @binding(10) var<storage, read_write> node_dilatation: array<f32>;

// K_a theta_a of a node [Pa].
fn averaged_pressure(pressed: vec4<i32>) -> f32 {
    return bitcast<f32>(pressed.w);
}

// Volumetric energy of an undamaged tetrahedron, mean of K/2 theta_a^2 over its corners [J/m^3].
fn averaged_energy(nodes: vec4<u32>, bulk_modulus: f32) -> f32 {
    let theta = vec4<f32>(
        node_dilatation[nodes.x],
        node_dilatation[nodes.y],
        node_dilatation[nodes.z],
        node_dilatation[nodes.w],
    );
    return 0.125 * bulk_modulus * dot(theta, theta);
}
