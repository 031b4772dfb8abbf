// Prescribed motion of faces: translation and rotation about the axis of the face normal through its centre.
#import shared/node_place
#ifndef TETRAHEDRA
#import shared/grid_lines
#endif

// Velocity that one face prescribes at the place `arm` relative to the centre of the tissue.
fn face_velocity(face: u32, arm: vec3<f32>) -> vec3<f32> {
    let drive = step_input.drives[face];
    let axis = face / 2u;
    // Components b, c = axis + 1, axis + 2 (cyclic) turn into each other.
    let turned_x = vec3<f32>(0.0, drive.cosine_rate * arm.y - drive.sine_rate * arm.z,
        drive.sine_rate * arm.y + drive.cosine_rate * arm.z);
    let turned_y = vec3<f32>(drive.sine_rate * arm.z + drive.cosine_rate * arm.x, 0.0,
        drive.cosine_rate * arm.z - drive.sine_rate * arm.x);
    let turned_z = vec3<f32>(drive.cosine_rate * arm.x - drive.sine_rate * arm.y,
        drive.sine_rate * arm.x + drive.cosine_rate * arm.y, 0.0);
    return drive.translation_rate.xyz + select(select(turned_z, turned_y, axis == 1u), turned_x, axis == 0u);
}

// Sum over the faces that the node lies on. Faces that do not move carry zeros.
#ifdef TETRAHEDRA
fn prescribed_velocity(place: NodePlace) -> vec3<f32> {
    let faces = place.flags >> 3u;
    var v = vec3<f32>(0.0);
    // Nodes inside skip the loop.
    for (var face = select(0u, 6u, faces == 0u); face < 6u; face++) {
        v += face_velocity(face, place.arm.xyz) * f32((faces >> face) & 1u);
    }
    return v;
}
#else
fn prescribed_velocity(place: NodePlace) -> vec3<f32> {
    let i = place.i;
    let j = place.j;
    let k = place.k;
    let y0 = NODES_X;
    let z0 = NODES_X + NODES_Y;
    let X = vec3<f32>(grid_lines[i], grid_lines[y0 + j], grid_lines[z0 + k]);
    let low = vec3<f32>(grid_lines[0], grid_lines[y0], grid_lines[z0]);
    let high = vec3<f32>(grid_lines[y0 - 1u], grid_lines[z0 - 1u], grid_lines[z0 + NODES_Z - 1u]);
    let arm = X - 0.5 * (low + high);
    var v = vec3<f32>(0.0);
    if (i == 0u) { v += face_velocity(0u, arm); }
    if (i + 1u == NODES_X) { v += face_velocity(1u, arm); }
    if (j == 0u) { v += face_velocity(2u, arm); }
    if (j + 1u == NODES_Y) { v += face_velocity(3u, arm); }
    if (k == 0u) { v += face_velocity(4u, arm); }
    if (k + 1u == NODES_Z) { v += face_velocity(5u, arm); }
    return v;
}
#endif
