// Damage: degradation by the plastic displacement. Equations: src/effects/damage.rs.
struct DamageParams {
    // Plastic strain at the onset, 1/u_f [1/m], d_max, 1 where a cell at d_max is deleted.
    onset: f32,
    inverse_displacement: f32,
    largest: f32,
    deletion: f32,
}

@group(0) @binding(11) var<uniform> damage: array<DamageParams, 256>;

// d for the equivalent plastic strain `alpha` of a cell of edge `length`.
fn degradation(number: u32, alpha: f32, length: f32) -> f32 {
    let params = damage[number];
    let d = max((alpha - params.onset) * length * params.inverse_displacement, 0.0);
    return select(d, max(params.largest, params.deletion), d >= params.largest);
}
