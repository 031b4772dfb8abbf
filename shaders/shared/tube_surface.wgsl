// The walls of a hollow needle. The same functions as in shared/path_surface.

fn overlap_of(contact: Contact, touch: Touch, from_axis: vec3<f32>, d: vec3<f32>, s: f32, less: vec2<f32>) -> Overlap {
    return tube_wall(from_axis, d, s, contact.surface.w, less);
}

// Only the nodes on the walls are pushed.
fn surface_stiffness(contact: Contact, touch: Touch) -> f32 {
    return puncture.contact_stiffness;
}

// The bore has its own.
fn surface_coefficient(contact: Contact, of_shaft: f32) -> f32 {
    return select(puncture.bore_grip, of_shaft, contact.surface.w > 0.0);
}
