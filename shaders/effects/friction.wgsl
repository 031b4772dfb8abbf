// Friction with stick memory: pure functions. Equations: src/effects/friction.rs.
// Coefficient mu, tangential over normal stiffness, length over which mu grows along the shaft [m].
#params FrictionParams

@group(0) @binding(5) var<uniform> friction: FrictionParams;

// Stretch of the stick spring after a tangential motion `slip`; `n` the contact normal, `allowed` the longest stretch.
fn stick_trial(stretch: vec3<f32>, slip: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let trial = stretch + slip;
    return trial - n * dot(trial, n);
}

fn stick_return(trial: vec3<f32>, allowed: f32) -> vec3<f32> {
    let size = length(trial);
    return trial * select(1.0, allowed / size, size > allowed);
}
