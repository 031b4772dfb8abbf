// Mooney-Rivlin law; constants x: c10, y: c01 [Pa]. Formulas in src/material/mooney_rivlin.rs.
fn mooney_rivlin_slopes(c: vec4<f32>, i1: f32) -> Slopes {
    return Slopes(c.x, c.y, 0.0);
}

fn mooney_rivlin_energy(c: vec4<f32>, i1: f32, i2: f32) -> f32 {
    return c.x * i1 + c.y * i2;
}
