// Demiray law; constants x: mu [Pa], y: b. Formulas in src/material/demiray.rs.
#import shared/capped_exponential

fn demiray_slopes(c: vec4<f32>, i1: f32) -> Slopes {
    let e = capped_exponential(c.y * i1);
    return Slopes(0.5 * c.x * e.y, 0.0, 0.5 * c.x * c.y * e.z);
}

fn demiray_energy(c: vec4<f32>, i1: f32, i2: f32) -> f32 {
    return 0.5 * c.x / c.y * capped_exponential(c.y * i1).x;
}
