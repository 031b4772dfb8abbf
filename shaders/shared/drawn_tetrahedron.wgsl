// A tetrahedron as a window draws it.
#import shared/drawn_cell
#import shared/tetrahedron
#import shared/averaged_dilatation
#ifdef PUNCTURE
#import effects/puncture
#endif

fn drawn_cell(index: u32) -> DrawnCell {
    let tet = tetrahedra[index];
    let a = pressed_nodes[tet.nodes.x];
    let b = pressed_nodes[tet.nodes.y];
    let c = pressed_nodes[tet.nodes.z];
    let d = pressed_nodes[tet.nodes.w];
    var out: DrawnCell;
    out.H = tetrahedron_gradient(
        tet,
        relative_displacement(b, a),
        relative_displacement(c, a),
        relative_displacement(d, a),
    );
    out.pressure = 0.25
        * ((averaged_pressure(a) + averaged_pressure(b)) + (averaged_pressure(c) + averaged_pressure(d)));
    out.material = material_number(tet);
    out.length = tet.gradient_c_and_edge.w;
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    out.tissue = true;
    return out;
}
