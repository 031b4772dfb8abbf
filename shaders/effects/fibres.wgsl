// Fibres: one family, exponential in I4bar. Equations: src/effects/fibres.rs.
#import shared/capped_exponential

struct FibreParams {
    // Unit vector along the fibres at rest, w unused.
    direction: vec4<f32>,
    // Stiffness k1 [Pa], exponent k2.
    k1: f32,
    k2: f32,
    _pad0: f32,
    _pad1: f32,
}

@group(0) @binding(8) var<uniform> fibres: array<FibreParams, 256>;

// Stress added to P_iso, and its tangent bound.
struct FibreStress {
    P: mat3x3<f32>,
    tangent: f32,
}

fn fibre_stress(number: u32, H: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> FibreStress {
    let n = fibres[number].direction.xyz;
    let lengthened = H * n;
    let stretched = n + lengthened;
    let f = isochoric_factors(1.0 + dj);
    let square = dot(stretched, stretched);
    // a |F n|^2 - 1 without cancellation.
    let square_1 = 2.0 * dot(n, lengthened) + dot(lengthened, lengthened);
    let e = max(f.a * square_1 + power_minus_one(dj, -0.6666667, f.a), 0.0);
    let exponential = capped_exponential(fibres[number].k2 * e * e);
    let slope = fibres[number].k1 * e * exponential.y;
    let along = stretched * (2.0 * f.a * slope);
    let across = -0.6666667 * f.a_fall * square * slope;
    let curvature = fibres[number].k1 * (exponential.y + 2.0 * fibres[number].k2 * e * e * exponential.z);
    return FibreStress(
        mat3x3<f32>(along * n.x + cof[0] * across, along * n.y + cof[1] * across, along * n.z + cof[2] * across),
        4.0 * f.a * f.a * square * curvature + 2.0 * f.a * slope,
    );
}

fn fibre_energy(number: u32, H: mat3x3<f32>, dj: f32) -> f32 {
    let n = fibres[number].direction.xyz;
    let stretched = H * n;
    let f = isochoric_factors(1.0 + dj);
    // |F n|^2 - 1 without cancellation.
    let square_1 = 2.0 * dot(n, stretched) + dot(stretched, stretched);
    let e = max(f.a * square_1 + power_minus_one(dj, -0.6666667, f.a), 0.0);
    return 0.5 * fibres[number].k1 / fibres[number].k2 * capped_exponential(fibres[number].k2 * e * e).x;
}
