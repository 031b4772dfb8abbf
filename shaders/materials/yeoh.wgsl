// Yeoh law; constants x: c10, y: c20, z: c30 [Pa]. Formulas in src/material/yeoh.rs.
fn yeoh_slopes(c: vec4<f32>, i1: f32) -> Slopes {
    return Slopes(c.x + i1 * (2.0 * c.y + 3.0 * i1 * c.z), 0.0, 2.0 * c.y + 6.0 * i1 * c.z);
}

fn yeoh_energy(c: vec4<f32>, i1: f32, i2: f32) -> f32 {
    return i1 * (c.x + i1 * (c.y + i1 * c.z));
}
