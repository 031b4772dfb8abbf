// Gravity: weight of the true mass. Equations: src/effects/gravity.rs.
struct GravityParams {
    // Acceleration of free fall over the mass scaling factor [m/s^2], w unused: node masses are scaled, weight is not.
    acceleration: vec4<f32>,
}

@group(0) @binding(2) var<uniform> gravity: GravityParams;
