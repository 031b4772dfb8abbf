// Kinematics that all laws share; formulas in src/material/kinematics.rs.

// J below which the isochoric factors continue as their second-order Taylor polynomials.
const J_CONTINUATION: f32 = 0.3;
// Values, first and second derivatives of J^(-2/3) and J^(-4/3) at 0.3.
const A0: f32 = 2.2314431;
const A1: f32 = -4.9587624;
const A2: f32 = 27.548680;
const B0: f32 = 4.9793386;
const B1: f32 = -22.130394;
const B2: f32 = 172.12529;

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
    // a = J^(-2/3), b = J^(-4/3), and -3/2 da/dJ, -3/4 db/dJ: at J = 1 all four are exactly 1.
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
    f.b = select(r4, B0 + d * (B1 + 0.5 * d * B2), below);
    f.b_fall = select(r4 * r3, -0.75 * (B1 + d * B2), below);
    // r is that of J = 0.3 below, as are the second derivatives.
    f.a_curvature = 1.1111111 * (r4 * r4);
    f.b_curvature = 3.1111111 * (r4 * r4 * r2);
    return f;
}

// J - 1 = tr H + (tr^2 H - tr H^2)/2 + det H, without cancellation.
fn jacobian_minus_one(H: mat3x3<f32>) -> f32 {
    let minors = H[0].x * H[1].y - H[1].x * H[0].y
        + H[1].y * H[2].z - H[2].y * H[1].z
        + H[0].x * H[2].z - H[2].x * H[0].z;
    return H[0].x + H[1].y + H[2].z + minors + dot(H[0], cross(H[1], H[2]));
}

// min(0, J - 0.3): how far a cell is on its way to being flat or inside out.
fn flatness(dj: f32) -> f32 {
    return min(1.0 + dj - J_CONTINUATION, 0.0);
}

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
