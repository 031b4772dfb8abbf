// Adhesion: tissue sticks to the tip and lets go; pure functions. Equations: src/effects/adhesion.rs.
// Forces F_s and F_k [N], stiffness k [N/m], distance slid until it sticks anew D [m].
#params AdhesionParams

@group(0) @binding(14) var<uniform> adhesion: AdhesionParams;

// Stretch and distance slid after a relative motion dx; `p`: the uniform, read outside branches.
fn advance_adhesion(p: AdhesionParams, stretch: f32, slid: f32, dx: f32) -> vec2<f32> {
    let trial = stretch + dx;
    let softening = (p.static_force - p.kinetic_force) / p.sliding_distance;
    let excess = p.stiffness * abs(trial) - (p.static_force - softening * slid);
    let slip = max(0.0, excess) / (p.stiffness - softening);
    let slipping = vec2<f32>(sign(trial) * (abs(trial) - slip), slid + slip);
    let anew = vec2<f32>(sign(trial) * p.kinetic_force / p.stiffness, 0.0);
    return select(slipping, anew, excess > 0.0 && slid + slip >= p.sliding_distance);
}
