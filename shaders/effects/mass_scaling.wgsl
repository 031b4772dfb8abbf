// Mass scaling: the uniform factor is in the nodal masses; here the selective part that keeps one step stable.
// Equations: src/effects/mass_scaling.rs.

#const RAISED_STEP_RATIO
#const MOST_RAISED

// m* = max(m, k dt^2 / (4 * 0.9^2)), at most 100 m; `bound` is the nodal stiffness bound k [N/m].
fn stable_mass(mass: f32, bound: f32) -> f32 {
    return clamp(bound * params.dt * params.dt / (4.0 * RAISED_STEP_RATIO), mass, MOST_RAISED * mass);
}
