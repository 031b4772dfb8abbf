// Motion of one driven face during one step: rates of the translation [m/s] and of cosine and sine of the angle [1/s].
struct DriveStep {
    translation_rate: vec4<f32>,
    cosine_rate: f32,
    sine_rate: f32,
    _pad0: f32,
    _pad1: f32,
}

// What one step is given from outside.
struct StepInput {
    // Tip of the tool [m], its velocity [m/s] and the unit vector of the insertion; w: see `angular_velocity`.
    tip: vec4<f32>,
    velocity: vec4<f32>,
    direction: vec4<f32>,
    // Velocity and angular velocity over the step that begins now; the others are means over the steps before and after. w unused.
    velocity_ahead: vec4<f32>,
    angular_velocity_ahead: vec4<f32>,
    // Depth of the tip from the entry point along the direction [m].
    depth: f32,
    // Number of the step since t = 0.
    step: u32,
    // Factor of the ramped loads, 0..1.
    load_factor: f32,
    // Offset of this step for rounding prescribed motion to the fixed point, 0..1, equidistributed over the steps.
    rounding: f32,
    drives: array<DriveStep, 6>,
}

@group(0) @binding(1) var<uniform> step_input: StepInput;

// Mean velocity of the tool over the step that ends now [m/s]: by what it has moved, as nodes have with their velocity.
fn velocity_behind() -> vec3<f32> {
    return 2.0 * step_input.velocity.xyz - step_input.velocity_ahead.xyz;
}

#ifdef TURNS
// Angular velocity of the tool [rad/s]: its components stand beside tip, velocity and direction.
fn angular_velocity() -> vec3<f32> {
    return vec3<f32>(step_input.tip.w, step_input.velocity.w, step_input.direction.w);
}

// The same over the step that ends now.
fn angular_velocity_behind() -> vec3<f32> {
    return 2.0 * angular_velocity() - step_input.angular_velocity_ahead.xyz;
}
#endif
