// Stage measure_dilatation: J - 1 and the volumetric stiffness of every tetrahedron, weighted for its nodes.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/elastic
#import shared/tetrahedron
#import shared/averaged_dilatation
#ifdef PLASTICITY
#import effects/plasticity
#endif
#ifdef DAMAGE
#import effects/damage
#endif
#ifdef PUNCTURE
#import effects/puncture
#endif

@group(2) @binding(0) var<storage, read> node_displacement: array<vec4<i32>>;

#ifdef VARYING_STIFFNESS
// Part of its stiffness that a cell has left from the last step.
fn stiffness_left(cell: u32, tet: Tetrahedron) -> f32 {
    var left = 1.0;
#ifdef DAMAGE
    var alpha = 0.0;
#ifdef PLASTICITY
    alpha = plastic_state[cell].x.w;
#endif
    left -= degradation(material_number(tet), alpha, tet.gradient_c_and_edge.w);
#endif
#ifdef PUNCTURE
    left *= cell_stiffness[cell];
#endif
    return left;
}
#endif

@compute @workgroup_size(64)
fn measure_dilatation(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let cell = thread_index(id, groups);
    if (cell >= CELL_COUNT) {
        return;
    }
    let tet = tetrahedra[cell];
    let origin = node_displacement[tet.nodes.x];
    let H = tetrahedron_gradient(
        tet,
        relative_displacement(node_displacement[tet.nodes.y], origin),
        relative_displacement(node_displacement[tet.nodes.z], origin),
        relative_displacement(node_displacement[tet.nodes.w], origin),
    );
    let share = 0.25 * tet.gradient_b_and_volume.w;
    cell_dilatation[cell] = share * jacobian_minus_one(H);
#ifdef VARYING_STIFFNESS
    let bulk_modulus = materials[material_number(tet)].bulk_modulus;
    cell_bulk_stiffness[cell] = share * stiffness_left(cell, tet) * bulk_modulus;
#endif
}
