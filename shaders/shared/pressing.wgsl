// What presses on a contact node in a step.
struct Pressing {
    // Force on the node [N]; unit normal of the surface, also where nothing presses.
    normal: vec3<f32>,
    n: vec3<f32>,
    // Velocity of the node past the needle [m/s].
    v: vec3<f32>,
    // The part of the contact damping in the force [N].
    damping: vec3<f32>,
    // Normal force times the part of the coefficient that acts where it rubs [N].
    rubbing: f32,
    // Stiffness of the contact, and the bound of the stiffness that it adds at the node [N/m].
    stiffness: f32,
    bound: f32,
}
