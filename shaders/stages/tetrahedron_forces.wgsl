// Stage tetrahedron_forces: four-node tetrahedra with averaged nodal pressure, total Lagrangian.
//
// f_i = V (w P_iso + p cof F) B_i with the mean p of the pressures of the four nodes. The pressure carries over from
// neighbours that may be intact, so it is not weakened with the cell; a flat cell adds its own. Equations:
// src/engine/elements.rs.
#import shared/params
#import shared/thread_index
#import shared/displacement
#import shared/material_point
#import shared/tetrahedron
#import shared/averaged_dilatation
#ifdef PUNCTURE
#import effects/puncture
#endif

// Forces of cells on their corners, those of one node side by side: x, y, z [N]; w: bound of the stiffness there
// [N/m], zero without mass scaling.
@group(2) @binding(2) var<storage, read_write> corner_force: array<vec4<f32>>;

// Bounds of the stiffness that a cell adds to its corners [N/m]:
// V ((K + turned tangent) |cof B_i| sum|cof B_j| + tangent |B_i| sum|B_j|).
fn stiffness_bounds(tet: Tetrahedron, point: PointAnswer) -> vec4<f32> {
    let gb = tet.gradient_b_and_volume.xyz;
    let gc = tet.gradient_c_and_edge.xyz;
    let gd = tet.gradient_d_and_material.xyz;
    let ga = gb + gc + gd;
    let cb = point.cof * gb;
    let cc = point.cof * gc;
    let cd = point.cof * gd;
    let ca = cb + cc + cd;
    let turned = sqrt(vec4<f32>(dot(ca, ca), dot(cb, cb), dot(cc, cc), dot(cd, cd)));
    let straight = sqrt(vec4<f32>(dot(ga, ga), dot(gb, gb), dot(gc, gc), dot(gd, gd)));
    let turned_modulus = materials[material_number(tet)].bulk_modulus + point.turned_tangent;
    let one = vec4<f32>(1.0);
    return (turned * (turned_modulus * dot(turned, one)) + straight * (point.tangent * dot(straight, one)))
        * tet.gradient_b_and_volume.w;
}

@compute @workgroup_size(64)
fn tetrahedron_forces(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let cell = thread_index(id, groups);
    if (cell >= CELL_COUNT) {
        return;
    }
    let tet = tetrahedra[cell];
    let a = pressed_nodes[tet.nodes.x];
    let b = pressed_nodes[tet.nodes.y];
    let c = pressed_nodes[tet.nodes.z];
    let d = pressed_nodes[tet.nodes.w];
    let H = tetrahedron_gradient(
        tet,
        relative_displacement(b, a),
        relative_displacement(c, a),
        relative_displacement(d, a),
    );
    let pressure = 0.25
        * ((averaged_pressure(a) + averaged_pressure(b)) + (averaged_pressure(c) + averaged_pressure(d)));
    let number = material_number(tet);
    var energy = 0.0;
#ifdef DAMAGE
    energy = averaged_energy(tet.nodes, materials[number].bulk_modulus);
#endif
    var kept = 1.0;
#ifdef PUNCTURE
    kept = cell_stiffness[cell];
#endif
    let point = material_point(PointPlace(cell, number, tet.gradient_c_and_edge.w, kept, 0.0, energy), H);
    let volume = tet.gradient_b_and_volume.w;
    let gb = tet.gradient_b_and_volume.xyz;
    let gc = tet.gradient_c_and_edge.xyz;
    let gd = tet.gradient_d_and_material.xyz;
    let own = materials[number].bulk_modulus * flatness(point.dj);
    let stress = point.P * (-volume * point.intact) + point.cof * (-volume * (pressure + point.intact * own));
    let fb = stress * gb;
    let fc = stress * gc;
    let fd = stress * gd;
    let bound = stiffness_bounds(tet, point);
    corner_force[tet.slots.x] = vec4<f32>(-(fb + fc + fd), bound.x);
    corner_force[tet.slots.y] = vec4<f32>(fb, bound.y);
    corner_force[tet.slots.z] = vec4<f32>(fc, bound.z);
    corner_force[tet.slots.w] = vec4<f32>(fd, bound.w);
}
