// Kinematics that all laws share; formulas in src/material/kinematics.rs.

// J below which isochoric factors and measures continue.
const J_CONTINUATION: f32 = 0.3;
// Value, first and second derivative of J^(-2/3) at 0.3.
const A0: f32 = 2.2314431;
const A1: f32 = -4.9587624;
const A2: f32 = 27.548680;

// J^(-1/3) for J >= 0.3: first guess from the exponent bits (3 % off), three Newton steps. The last one corrects, so that
// J = 1 gives exactly 1.
fn inverse_cube_root(J: f32) -> f32 {
    let bits = 1419967785.0 - f32(bitcast<i32>(J)) * 0.33333333;
    var r = bitcast<f32>(i32(bits));
    r = r * (1.3333333 - 0.33333333 * J * r * r * r);
    r = r * (1.3333333 - 0.33333333 * J * r * r * r);
    r += 0.33333333 * r * (1.0 - J * r * r * r);
    return r;
}

struct IsochoricFactors {
    // a = J^(-2/3), b = J^(-4/3), and -3/2 da/dJ, -3/4 db/dJ: at J = 1 all four are exactly 1. Below J = 0.3 a continues as
    // its second-order Taylor polynomial; all others but its slope stay those of 0.3.
    a: f32,
    a_fall: f32,
    b: f32,
    b_fall: f32,
    // Second derivatives.
    a_curvature: f32,
    b_curvature: f32,
}

fn isochoric_factors(J: f32) -> IsochoricFactors {
    let r = inverse_cube_root(max(J, J_CONTINUATION));
    let r2 = r * r;
    let r4 = r2 * r2;
    let r3 = r2 * r;
    let d = J - J_CONTINUATION;
    let below = J < J_CONTINUATION;
    var f: IsochoricFactors;
    f.a = select(r2, A0 + d * (A1 + 0.5 * d * A2), below);
    f.a_fall = select(r2 * r3, -1.5 * (A1 + d * A2), below);
    f.b = r4;
    f.b_fall = r4 * r3;
    f.a_curvature = 1.1111111 * (r4 * r4);
    f.b_curvature = 3.1111111 * (r4 * r4 * r2);
    return f;
}

// An isochoric measure M and its derivatives; never below 3.
struct Measure {
    value: f32,
    by_s: f32,
    by_j: f32,
    by_jj: f32,
}

// ln x for x = 1 + e. A device may round its logarithm to 2^-21 near 1, which is all of a small strain: there the series of the inverse
// hyperbolic tangent.
fn logarithm(x: f32, e: f32) -> f32 {
    let z = e / (2.0 + e);
    let s = z * z;
    let series = 2.0 * z * (1.0 + s * (0.33333333 + s * (0.2 + s * (0.14285714 + s * 0.11111111))));
    return select(0.6931472 * log2(x), series, abs(e) < 0.4);
}

// exp(x) - 1, in the same way.
fn exp_minus_one(x: f32) -> f32 {
    let tail = 0.041666667 + x * (0.0083333333 + x * (0.0013888889 + x * (1.984127e-4 + x * 2.4801587e-5)));
    let series = x * (1.0 + x * (0.5 + x * (0.16666667 + x * tail)));
    return select(exp2(1.442695 * x) - 1.0, series, abs(x) < 0.5);
}

// x^p for x >= low, its second-order Taylor polynomial at `low` below: value, first and second derivative; w: value - 1. e: x - 1.
fn continued_power(x: f32, e: f32, p: f32, low: f32) -> vec4<f32> {
    let at = max(x, low);
    // Exact at 1, so that tissue at rest stays there.
    let of_log = p * logarithm(at, max(e, low - 1.0));
    let beyond = exp_minus_one(of_log);
    let value = select(exp2(1.442695 * of_log), 1.0 + beyond, abs(of_log) < 0.5);
    let slope = p * value / at;
    let curvature = (p - 1.0) * slope / at;
    let d = min(x - low, 0.0);
    let added = d * (slope + 0.5 * d * curvature);
    return vec4<f32>(value + added, slope + d * curvature, curvature, beyond + added);
}

// Continuation of M = J^-m S for J < 0.3, m = 2/3 or, `of_areas`, 4/3; the equations are at `isochoric_measure`. All powers are
// roots: a software adapter has no others without a call.
fn continued_measure(S: f32, J: f32, of_areas: bool) -> Measure {
    const GAIN: f32 = 0.06;
    const FLOOR: f32 = 0.002;
    let m = select(0.6666667, 1.3333334, of_areas);
    // v^(8/3), the fourth power of lengths or the second of areas; beyond 2^40 the scale is 1.
    let third = clamp(S * 0.33333333, 0.0, 1e6);
    let square = third * third;
    let volume = select(square * square, square, of_areas);
    let floored = volume + FLOOR;
    let root = sqrt(1.0 + GAIN / floored);
    let fourth = sqrt(root);
    let k3 = fourth * sqrt(fourth);
    let k3m = select(fourth, root, of_areas);
    // d ln k^3 / d ln v.
    let fall = -GAIN * (volume / floored) / (floored + GAIN);
    // a(q) and its derivatives.
    let q = k3 * J;
    let at = max(q, J_CONTINUATION);
    let c = inverse_cube_root(at);
    let value = select(c * c, c * c * c * c, of_areas);
    let slope_at = -m * value / at;
    let curvature = -(m + 1.0) * slope_at / at;
    let d = min(q - J_CONTINUATION, 0.0);
    let a = vec3<f32>(value + d * (slope_at + 0.5 * d * curvature), slope_at + d * curvature, curvature);
    // g and its slope: 3/b with b at 0.3 r.
    let start = select(A0, A0 * A0, of_areas);
    let scaled = k3m * S;
    let least = 3.0 / start;
    let x = clamp(scaled / least, 1e-12, 1.0);
    let below_one = x - 1.0;
    let side = sqrt(x);
    let r = select(
        vec2<f32>(x * side, 1.5 * side),
        vec2<f32>(1.0 + 0.75 * below_one * (1.0 - 0.125 * below_one), 0.75 * (1.0 - 0.25 * below_one)),
        of_areas,
    );
    let e = J_CONTINUATION * (r.x - 1.0);
    let start_slope = -m * start / J_CONTINUATION;
    let start_curvature = -(m + 1.0) * start_slope / J_CONTINUATION;
    let b = vec2<f32>(start + e * (start_slope + 0.5 * e * start_curvature), start_slope + e * start_curvature);
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

// J - 1 = tr H + (tr^2 H - tr H^2)/2 + det H, without cancellation.
fn jacobian_minus_one(H: mat3x3<f32>) -> f32 {
    let minors = H[0].x * H[1].y - H[1].x * H[0].y
        + H[1].y * H[2].z - H[2].y * H[1].z
        + H[0].x * H[2].z - H[2].x * H[0].z;
    return H[0].x + H[1].y + H[2].z + minors + dot(H[0], cross(H[1], H[2]));
}

#ifdef EARLY_FLATNESS
// Constant of src/effects/puncture.rs.
#const FLAT_UNDER_NEEDLE

// min(0, J - J_c): how far a tetrahedron under a needle is on its way to being flat or inside out.
fn flatness(dj: f32) -> f32 {
    return min(1.0 + dj - FLAT_UNDER_NEEDLE, 0.0);
}
#else
// min(0, J - 0.3): how far a cell is on its way to being flat or inside out.
fn flatness(dj: f32) -> f32 {
    return min(1.0 + dj - J_CONTINUATION, 0.0);
}
#endif

// F = I + H.
fn deformation_gradient(H: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(
        H[0] + vec3<f32>(1.0, 0.0, 0.0),
        H[1] + vec3<f32>(0.0, 1.0, 0.0),
        H[2] + vec3<f32>(0.0, 0.0, 1.0),
    );
}

fn cofactor(F: mat3x3<f32>) -> mat3x3<f32> {
    return mat3x3<f32>(cross(F[1], F[2]), cross(F[2], F[0]), cross(F[0], F[1]));
}

fn double_dot(A: mat3x3<f32>, B: mat3x3<f32>) -> f32 {
    return dot(A[0], B[0]) + dot(A[1], B[1]) + dot(A[2], B[2]);
}

// J^p - 1 from J - 1: series where J - 1 is small, else `value - 1`.
fn power_minus_one(dj: f32, p: f32, value: f32) -> f32 {
    let series = dj * p * (1.0 + 0.5 * dj * (p - 1.0) * (1.0 + 0.33333333 * dj * (p - 2.0)));
    return select(value - 1.0, series, abs(dj) < 0.01);
}
