// The axis of a rigid needle. The same functions as in shared/bent_axis.

struct StraightAxis {
    // Of the needle there, over the step that ends now [m/s].
    velocity: vec3<f32>,
}

alias Axis = StraightAxis;

// The axis at the distance `s` behind the tip.
fn axis_at(s: f32) -> Axis {
    return Axis(velocity_behind());
}

// What `lever`, from the tip, is from the axis [m].
fn off_axis(axis: Axis, lever: vec3<f32>) -> vec3<f32> {
    return lever;
}

// Gradient of an overlap, from that with the section where it is; `d`: the gradient of s.
fn along_axis(axis: Axis, gradient: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    return gradient;
}

// Power of a force at the needle beside that of its motion as a whole [W].
fn axis_power(axis: Axis, force: vec3<f32>) -> f32 {
    return 0.0;
}
