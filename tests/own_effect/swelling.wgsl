// Swelling: growth of the volume at rest with a constant rate. Equations: swelling.rs.

// memory: growth theta, and what its last sum lost to rounding.
fn swelling_advance(point: OwnPoint, memory: ptr<function, vec4<f32>>) -> f32 {
    let growth = point.numbers[0].x * point.dt - (*memory).y;
    let theta = (*memory).x + growth;
    let gained = theta - (*memory).x;
    let work = point.bulk_modulus * gained * ((*memory).x + 0.5 * gained - point.dj);
    *memory = vec4<f32>(theta, gained - growth, 0.0, 0.0);
    return work;
}

fn swelling_stress(point: OwnPoint, memory: vec4<f32>) -> mat3x3<f32> {
    return point.cof * (-point.bulk_modulus * memory.x);
}

fn swelling_energy(point: OwnPoint, memory: vec4<f32>) -> f32 {
    return point.bulk_modulus * memory.x * (0.5 * memory.x - point.dj);
}

fn swelling_tangent(point: OwnPoint, memory: vec4<f32>) -> f32 {
    return 0.0;
}
