// Neo-Hookean law; constants x: c10 [Pa]. Formulas in src/material/neo_hookean.rs.
fn neo_hookean_slopes(c: vec4<f32>, i1: f32) -> Slopes {
    return Slopes(c.x, 0.0, 0.0);
}

fn neo_hookean_energy(c: vec4<f32>, i1: f32, i2: f32) -> f32 {
    return c.x * i1;
}
