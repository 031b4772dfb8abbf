// A tetrahedron at the end of a frame.
#import shared/cell_energy
#import shared/tetrahedron
#import shared/averaged_dilatation
#ifdef PUNCTURE
#import effects/puncture
#endif

fn measured_cell(index: u32) -> MeasuredCell {
    let tet = tetrahedra[index];
    let origin = node_displacement[tet.nodes.x];
    let b = relative_displacement(node_displacement[tet.nodes.y], origin);
    let c = relative_displacement(node_displacement[tet.nodes.z], origin);
    let d = relative_displacement(node_displacement[tet.nodes.w], origin);
    let number = material_number(tet);
    let averaged = averaged_energy(tet.nodes, materials[number].bulk_modulus);
    var out: MeasuredCell;
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    let place = PointPlace(index, number, tet.gradient_c_and_edge.w, out.kept, 0.0, averaged);
    let point = point_energy(place, tetrahedron_gradient(tet, b, c, d));
    out.volume = tet.gradient_b_and_volume.w;
    let edges = max(max(abs(b), abs(c)), abs(d));
    let across = max(max(abs(c - b), abs(d - c)), abs(b - d));
    out.apart = largest_component(max(edges, across));
    out.energy.elastic = out.volume * point.stored;
    out.energy.held = out.volume * point.held;
    out.energy.intact = point.intact;
    out.energy.jacobian = 1.0 + point.dj;
    out.energy.corner_jacobian = out.energy.jacobian;
    return out;
}
