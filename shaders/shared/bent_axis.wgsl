// The axis of a flexible needle. The same functions as in shared/straight_axis.
#import effects/flexible_needle

struct BentAxis {
    velocity: vec3<f32>,
    bend: Bend,
}

alias Axis = BentAxis;

fn axis_at(s: f32) -> Axis {
    let bend = bend_at(s);
    return Axis(velocity_behind() + bend.rate, bend);
}

fn off_axis(axis: Axis, lever: vec3<f32>) -> vec3<f32> {
    return lever - axis.bend.offset;
}

fn along_axis(axis: Axis, gradient: vec3<f32>, d: vec3<f32>) -> vec3<f32> {
    return gradient - d * dot(gradient, axis.bend.slope);
}

fn axis_power(axis: Axis, force: vec3<f32>) -> f32 {
    return dot(force, axis.bend.rate);
}
