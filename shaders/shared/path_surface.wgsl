// The surface of a solid needle in the path that its tip has opened. The same functions as in shared/tube_surface.

// How deep a node lies in the needle; `less`: what fades out after the entry.
fn overlap_of(contact: Contact, touch: Touch, from_axis: vec3<f32>, d: vec3<f32>, s: f32, less: vec2<f32>) -> Overlap {
    return opened_path(from_axis, d, s, touch.rest_radius, less);
}

// Stiffness of the contact [N/m].
fn surface_stiffness(contact: Contact, touch: Touch) -> f32 {
    return puncture.ring_stiffness * contact.share * touch_weight(touch);
}

// Coefficient mu, from that of the shaft.
fn surface_coefficient(contact: Contact, of_shaft: f32) -> f32 {
    return of_shaft;
}
