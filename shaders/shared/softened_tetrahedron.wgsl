// What a tetrahedron holds that the path weakens.
#import shared/cell_energy
#import shared/tetrahedron
#import shared/averaged_dilatation

// Of the intact cell, at the forces of the last step: displacement and dilatation of its nodes lie side by side from then.
fn softened_energy(cell: u32, number: u32) -> CellEnergy {
    let tet = tetrahedra[cell];
    let origin = pressed_nodes[tet.nodes.x];
    let H = tetrahedron_gradient(
        tet,
        relative_displacement(pressed_nodes[tet.nodes.y], origin),
        relative_displacement(pressed_nodes[tet.nodes.z], origin),
        relative_displacement(pressed_nodes[tet.nodes.w], origin),
    );
    let averaged = averaged_energy(tet.nodes, materials[number].bulk_modulus);
    let point = point_energy(PointPlace(cell, number, tet.gradient_c_and_edge.w, 1.0, 0.0, averaged), H);
    var energy: CellEnergy;
    energy.elastic = tet.gradient_b_and_volume.w * point.stored;
    energy.held = tet.gradient_b_and_volume.w * point.held;
    return energy;
}
