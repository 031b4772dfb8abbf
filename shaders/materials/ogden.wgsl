// One-term Ogden law; constants x: mu [Pa], y: alpha. Formulas in src/material/ogden.rs.
#import shared/symmetric_eigen

// Eigenvalue of C below which phi continues as a polynomial.
const SMALLEST_EIGENVALUE: f32 = 0.01;

// x^p for x >= low, its second-order Taylor polynomial at `low` below: value and derivative.
fn continued_power(x: f32, p: f32, low: f32) -> vec2<f32> {
    let at = max(x, low);
    let value = exp2(p * log2(at));
    let slope = p * value / at;
    let curvature = (p - 1.0) * slope / at;
    let d = min(x - low, 0.0);
    return vec2<f32>(value + d * (slope + 0.5 * d * curvature), slope + d * curvature);
}

struct OgdenState {
    // a(J), a'(J).
    a: vec2<f32>,
    phi: vec3<f32>,
    slope: vec3<f32>,
    // Eigenvalues of C, not below the smallest.
    eigenvalues: vec3<f32>,
    directions: mat3x3<f32>,
}

fn ogden_state(c: vec4<f32>, H: mat3x3<f32>, J: f32) -> OgdenState {
    // C - I, so that small strains keep their digits.
    let eigen = symmetric_eigen(H + transpose(H) + transpose(H) * H);
    let p = 0.5 * c.y;
    let x = continued_power(1.0 + eigen.values.x, p, SMALLEST_EIGENVALUE);
    let y = continued_power(1.0 + eigen.values.y, p, SMALLEST_EIGENVALUE);
    let z = continued_power(1.0 + eigen.values.z, p, SMALLEST_EIGENVALUE);
    return OgdenState(
        continued_power(J, c.y * -0.33333333, J_CONTINUATION),
        vec3<f32>(x.x, y.x, z.x),
        vec3<f32>(x.y, y.y, z.y),
        max(1.0 + eigen.values, vec3<f32>(SMALLEST_EIGENVALUE)),
        eigen.vectors,
    );
}

fn ogden_stress(c: vec4<f32>, H: mat3x3<f32>) -> IsochoricStress {
    var out: IsochoricStress;
    let F = deformation_gradient(H);
    out.cof = cofactor(F);
    out.dj = jacobian_minus_one(H);
    let s = ogden_state(c, H, 1.0 + out.dj);
    let n = s.directions;
    let scaled = mat3x3<f32>(n[0] * s.slope.x, n[1] * s.slope.y, n[2] * s.slope.z);
    let factor = 2.0 * c.x / (c.y * c.y);
    let sum = s.phi.x + s.phi.y + s.phi.z;
    out.P = (F * (scaled * transpose(n)) * (2.0 * s.a.x) + out.cof * (s.a.y * sum)) * factor;
    // Bound of the tangent modulus, Ogden::tangent_bound.
    let size = abs(c.y);
    let ratio = s.phi / s.eigenvalues;
    let largest = max(1.0, s.a.x * max(max(ratio.x, ratio.y), max(ratio.z, 0.33333333 * sum)));
    out.tangent = 1.3333334 * c.x * max((size + 1.0) / size * max(size, 1.0), 1.0) * largest;
    return out;
}

fn ogden_energy(c: vec4<f32>, H: mat3x3<f32>, dj: f32) -> f32 {
    let s = ogden_state(c, H, 1.0 + dj);
    return 2.0 * c.x / (c.y * c.y) * (s.a.x * (s.phi.x + s.phi.y + s.phi.z) - 3.0);
}
