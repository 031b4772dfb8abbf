// Numbers of the time integration, which may change while a run goes on.
#import shared/mesh_numbers
struct Params {
    // Quartic hourglass factor c.
    quartic: f32,
    // Time step [s].
    dt: f32,
    // Mass-proportional damping alpha [1/s].
    mass_damping: f32,
    // Largest nodal speed that is let through [m/s].
    speed_limit: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
