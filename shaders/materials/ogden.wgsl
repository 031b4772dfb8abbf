// One-term Ogden law; constants x: mu [Pa], y: alpha. Formulas in src/material/ogden.rs.
#import shared/symmetric_eigen

// Eigenvalue of C below which phi continues as a polynomial.
const SMALLEST_EIGENVALUE: f32 = 0.01;

// x^p for x >= low, its second-order Taylor polynomial at `low` below: value, first and second derivative.
fn continued_power(x: f32, p: f32, low: f32) -> vec3<f32> {
    let at = max(x, low);
    // Exact at 1, so that tissue at rest stays there.
    let value = select(exp2(p * log2(at)), 1.0, at == 1.0);
    let slope = p * value / at;
    let curvature = (p - 1.0) * slope / at;
    let d = min(x - low, 0.0);
    return vec3<f32>(value + d * (slope + 0.5 * d * curvature), slope + d * curvature, curvature);
}

struct OgdenState {
    // a(J), a'(J), a''(J).
    a: vec3<f32>,
    // phi, phi', phi'' of the three eigenvalues, and these.
    phi: vec3<f32>,
    slope: vec3<f32>,
    curvature: vec3<f32>,
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
        vec3<f32>(x.z, y.z, z.z),
        1.0 + eigen.values,
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
    // a' sum phi, in a form that cancels to the last bit at F = I, where a' = -alpha/3 and the sum is 3.
    let along = (s.a.y / (c.y * -0.33333333)) * (c.y * (sum * 0.33333333));
    out.P = (F * (scaled * transpose(n)) * (2.0 * s.a.x) - out.cof * along) * factor;
    // Bound of the tangent modulus: the largest second derivative by one principal stretch.
    let c_i = s.eigenvalues;
    let others = c_i.yzx * c_i.zxy;
    let rise = s.a.x * (2.0 * s.slope + 4.0 * c_i * s.curvature)
        + 4.0 * s.a.y * (1.0 + out.dj) * s.slope + s.a.z * sum * others;
    out.tangent = factor * max(max(rise.x, rise.y), max(rise.z, 0.0));
    out.turned_tangent = 0.0;
    return out;
}

fn ogden_energy(c: vec4<f32>, H: mat3x3<f32>, dj: f32) -> f32 {
    let s = ogden_state(c, H, 1.0 + dj);
    return 2.0 * c.x / (c.y * c.y) * (s.a.x * (s.phi.x + s.phi.y + s.phi.z) - 3.0);
}
