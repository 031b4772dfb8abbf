// A tetrahedron as a window draws it.
#import shared/drawn_cell
#import shared/tetrahedron
#import shared/averaged_dilatation
#ifdef PUNCTURE
#import effects/puncture
#endif

#ifdef OPENING
#import shared/mesh_node
#import shared/needle_in_tissue

@group(2) @binding(22) var<uniform> drawn_needle: DrawnNeedle;

// Where a node is with the path closed [m]; `pressed`: its entry of `pressed_nodes`.
fn node_place(node: u32, pressed: vec4<i32>) -> vec3<f32> {
    return drawn_needle.middle.xyz + mesh_nodes[node].arm.xyz + vec3<f32>(pressed.xyz) * DISPLACEMENT_UNIT;
}

// F - I of a cell whose nodes are where they are seen; of one that the path runs through, where nodes tell nothing, by the map.
fn seen_strain(tet: Tetrahedron, H: mat3x3<f32>) -> mat3x3<f32> {
    let a = node_place(tet.nodes.x, pressed_nodes[tet.nodes.x]);
    let b = node_place(tet.nodes.y, pressed_nodes[tet.nodes.y]);
    let c = node_place(tet.nodes.z, pressed_nodes[tet.nodes.z]);
    let d = node_place(tet.nodes.w, pressed_nodes[tet.nodes.w]);
    let beside = beside_axis(drawn_needle, 0.25 * (a + b + c + d));
    if (length(beside.xyz) < drawn_needle.tip.w) {
        return strain_on_path(drawn_needle, H, beside);
    }
    let first = pushed_aside(drawn_needle, beside_axis(drawn_needle, a));
    return H + tetrahedron_gradient(
        tet,
        pushed_aside(drawn_needle, beside_axis(drawn_needle, b)) - first,
        pushed_aside(drawn_needle, beside_axis(drawn_needle, c)) - first,
        pushed_aside(drawn_needle, beside_axis(drawn_needle, d)) - first,
    );
}
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
#ifdef OPENING
    if (drawn_needle.tip.w > 0.0) {
        out.H = seen_strain(tet, out.H);
    }
#endif
    out.material = material_number(tet);
    out.length = tet.gradient_c_and_edge.w;
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    out.tissue = true;
    return out;
}
