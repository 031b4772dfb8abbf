// One-term Ogden law; constants x: mu [Pa], y: alpha. Formulas in src/material/ogden.rs.
#import shared/symmetric_eigen

// The same as `continued_measure` for any degree m; the equations are at `isochoric_measure`.
fn continued_measure_of_degree(S: f32, J: f32, m: f32) -> Measure {
    const GAIN: f32 = 0.06;
    const FLOOR: f32 = 0.002;
    // v^(8/3); beyond 2^40 the scale is 1.
    let volume = exp2(min(2.6666667 / m * log2(max(S, 1e-12) * 0.33333333), 40.0));
    let floored = volume + FLOOR;
    let scale = 0.375 * log2(1.0 + GAIN / floored);
    let k3 = exp2(scale);
    let k3m = exp2(m * scale);
    // d ln k^3 / d ln v.
    let fall = -GAIN * (volume / floored) / (floored + GAIN);
    let a = continued_power(k3 * J, k3 * J - 1.0, -m, J_CONTINUATION);
    let least = 3.0 / continued_power(J_CONTINUATION, J_CONTINUATION - 1.0, -m, J_CONTINUATION).x;
    let scaled = k3m * S;
    let p = 1.0 / m;
    let x = clamp(scaled / least, 1e-12, 1.0);
    let r = continued_power(x, x - 1.0, p, select(1.0, ZERO, m <= 1.0)).xy;
    let b = continued_power(J_CONTINUATION * r.x, J_CONTINUATION * r.x - 1.0, -m, J_CONTINUATION);
    let below = scaled < least;
    let g = select(scaled, 3.0 / b.x, below);
    let slope = select(1.0, -3.0 * b.y / (b.x * b.x) * J_CONTINUATION * r.y / least, below);
    var out: Measure;
    out.value = a.x * g;
    out.by_s = a.y * k3 * J * (fall / (m * max(S, 1e-12))) * g + a.x * slope * k3m * (1.0 + fall);
    out.by_j = a.y * k3 * g;
    out.by_jj = a.z * k3 * k3 * g;
    return out;
}

// Eigenvalue of C, and product of two of them, below which phi continues as a polynomial where |alpha| < 2; what counts as
// zero for other exponents.
const SMALLEST_EIGENVALUE: f32 = 0.01;
const SMALLEST_PRODUCT: f32 = 1e-4;
const ZERO: f32 = 1e-12;

struct OgdenState {
    // M and its derivatives, M - 3, J d2M/dSdJ, and -dM/dJ in a form that is exact at F = I.
    measure: Measure,
    measure_3: f32,
    mixed: f32,
    along: f32,
    // dS/dc_i of the three eigenvalues, d2S/dl_i^2 by the principal stretches, and c_i.
    by_c: vec3<f32>,
    by_stretch: vec3<f32>,
    eigenvalues: vec3<f32>,
    directions: mat3x3<f32>,
}

fn ogden_state(c: vec4<f32>, H: mat3x3<f32>, dj: f32) -> OgdenState {
    var out: OgdenState;
    let J = 1.0 + dj;
    // C - I, so that small strains keep their digits.
    let eigen = symmetric_eigen(H + transpose(H) + transpose(H) * H);
    out.directions = eigen.vectors;
    out.eigenvalues = max(1.0 + eigen.values, vec3<f32>(0.0));
    let p = 0.5 * abs(c.y);
    let by_areas = c.y < 0.0;
    // Stretches, or areas where alpha is negative, less 1.
    let e = max(eigen.values, vec3<f32>(-1.0));
    let others = e.yzx + e.zxy + e.yzx * e.zxy;
    let at = select(e, others, by_areas);
    let low = select(ZERO, select(SMALLEST_EIGENVALUE, SMALLEST_PRODUCT, by_areas), p < 1.0);
    let x = continued_power(1.0 + at.x, at.x, p, low);
    let y = continued_power(1.0 + at.y, at.y, p, low);
    let z = continued_power(1.0 + at.z, at.z, p, low);
    let phi = vec3<f32>(x.x, y.x, z.x);
    let slope = vec3<f32>(x.y, y.y, z.y);
    let curvature = vec3<f32>(x.z, y.z, z.z);
    let sum = phi.x + phi.y + phi.z;
    let sum_3 = x.w + y.w + z.w;
    // c_i stands in the two products that are not the i-th.
    let area_slope = slope.yzx * out.eigenvalues.zxy + slope.zxy * out.eigenvalues.yzx;
    let area_curvature = curvature.yzx * out.eigenvalues.zxy * out.eigenvalues.zxy
        + curvature.zxy * out.eigenvalues.yzx * out.eigenvalues.yzx;
    out.by_c = select(slope, area_slope, by_areas);
    out.by_stretch = 2.0 * out.by_c + 4.0 * out.eigenvalues * select(curvature, area_curvature, by_areas);
    // Degree of S in the stretches.
    let degree = select(c.y, -2.0 * c.y, by_areas);
    let m = degree * 0.33333333;
    let a = continued_power(J, dj, -m, J_CONTINUATION);
    out.measure = Measure(a.x * sum, a.x, a.y * sum, a.z * sum);
    out.measure_3 = a.x * sum_3 + 3.0 * a.w;
    // At F = I a' = -m and the sum is 3.
    out.along = (a.y / -m) * (degree * (sum * 0.33333333));
    out.mixed = J * a.y;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, J < J_CONTINUATION); once == 0u; once++) {
        out.measure = continued_measure_of_degree(sum, J, m);
        out.measure_3 = out.measure.value - 3.0;
        out.along = -out.measure.by_j;
        out.mixed = max(J * out.measure.by_j / sum, 0.0);
        out.by_stretch = max(out.by_stretch, 2.0 * out.by_c);
    }
    return out;
}

fn ogden_stress(c: vec4<f32>, H: mat3x3<f32>) -> IsochoricStress {
    var out: IsochoricStress;
    let F = deformation_gradient(H);
    out.cof = cofactor(F);
    out.dj = jacobian_minus_one(H);
    let s = ogden_state(c, H, out.dj);
    let n = s.directions;
    let scaled = mat3x3<f32>(n[0] * s.by_c.x, n[1] * s.by_c.y, n[2] * s.by_c.z);
    let factor = 2.0 * c.x / (c.y * c.y);
    out.P = (F * (scaled * transpose(n)) * (2.0 * s.measure.by_s) - out.cof * s.along) * factor;
    // Bound of the tangent modulus: the largest second derivative by one principal stretch.
    let others = s.eigenvalues.yzx * s.eigenvalues.zxy;
    let rise = s.measure.by_s * s.by_stretch + 4.0 * s.mixed * s.by_c + s.measure.by_jj * others;
    out.tangent = factor * max(max(rise.x, rise.y), max(rise.z, 0.0));
    out.turned_tangent = 0.0;
    return out;
}

fn ogden_energy(c: vec4<f32>, H: mat3x3<f32>, dj: f32) -> f32 {
    return 2.0 * c.x / (c.y * c.y) * ogden_state(c, H, dj).measure_3;
}
