// Compressible Mooney-Rivlin with the inversion-safe continuation; formulas in src/material/mooney_rivlin.rs.

// J below which J^(-2/3) and J^(-4/3) continue as their second-order Taylor polynomials.
const J_CONTINUATION: f32 = 0.3;
// Values, first and second derivatives of both powers at 0.3.
const A0: f32 = 2.2314431;
const A1: f32 = -4.9587624;
const A2: f32 = 27.548680;
const B0: f32 = 4.9793386;
const B1: f32 = -22.130394;
const B2: f32 = 172.12529;

// J^(-1/3) for J >= 0.3: first guess from the exponent bits (3 % off), three Newton steps.
fn inverse_cube_root(J: f32) -> f32 {
    let bits = 1419967785.0 - f32(bitcast<i32>(J)) * 0.33333333;
    var r = bitcast<f32>(i32(bits));
    r = r * (1.3333333 - 0.33333333 * J * r * r * r);
    r = r * (1.3333333 - 0.33333333 * J * r * r * r);
    r = r * (1.3333333 - 0.33333333 * J * r * r * r);
    return r;
}

struct IsochoricFactors {
    // J^(-2/3) and its derivative, J^(-4/3) and its derivative.
    a: f32,
    da: f32,
    b: f32,
    db: f32,
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
    f.da = select(-0.6666667 * r2 * r3, A1 + d * A2, below);
    f.b = select(r4, B0 + d * (B1 + 0.5 * d * B2), below);
    f.db = select(-1.3333334 * r4 * r3, B1 + d * B2, below);
    return f;
}

// J - 1 = tr H + (tr^2 H - tr H^2)/2 + det H, without cancellation.
fn jacobian_minus_one(H: mat3x3<f32>) -> f32 {
    let minors = H[0].x * H[1].y - H[1].x * H[0].y
        + H[1].y * H[2].z - H[2].y * H[1].z
        + H[0].x * H[2].z - H[2].x * H[0].z;
    return H[0].x + H[1].y + H[2].z + minors + dot(H[0], cross(H[1], H[2]));
}

struct StressState {
    // First Piola-Kirchhoff stress [Pa], by columns.
    P: mat3x3<f32>,
    // cof F and I1, which the stiffness bound reuses.
    cof: mat3x3<f32>,
    i1: f32,
}

fn first_piola_kirchhoff(H: mat3x3<f32>) -> StressState {
    let x = H[0] + vec3<f32>(1.0, 0.0, 0.0);
    let y = H[1] + vec3<f32>(0.0, 1.0, 0.0);
    let z = H[2] + vec3<f32>(0.0, 0.0, 1.0);
    let cof = mat3x3<f32>(cross(y, z), cross(z, x), cross(x, y));
    let dj = jacobian_minus_one(H);
    let f = isochoric_factors(1.0 + dj);
    // C = F^T F by its six entries.
    let xx = dot(x, x);
    let yy = dot(y, y);
    let zz = dot(z, z);
    let xy = dot(x, y);
    let yz = dot(y, z);
    let zx = dot(z, x);
    let i1 = xx + yy + zz;
    let i2 = dot(cof[0], cof[0]) + dot(cof[1], cof[1]) + dot(cof[2], cof[2]);
    let first = 2.0 * params.c10 * f.a;
    let second = 2.0 * params.c01 * f.b;
    let volumetric = params.c10 * f.da * i1 + params.c01 * f.db * i2 + params.bulk_modulus * dj;
    var state: StressState;
    // Columns of 2 c10 a F + 2 c01 b (I1 F - F C) + (...) cof F.
    state.P = mat3x3<f32>(
        x * (first + second * (yy + zz)) - (y * xy + z * zx) * second + cof[0] * volumetric,
        y * (first + second * (zz + xx)) - (x * xy + z * yz) * second + cof[1] * volumetric,
        z * (first + second * (xx + yy)) - (x * zx + y * yz) * second + cof[2] * volumetric,
    );
    state.cof = cof;
    state.i1 = i1;
    return state;
}

// J^p - 1 for p = -2/3 and -4/3 without cancellation near J = 1.
fn energy_density(H: mat3x3<f32>) -> f32 {
    let x = H[0] + vec3<f32>(1.0, 0.0, 0.0);
    let y = H[1] + vec3<f32>(0.0, 1.0, 0.0);
    let z = H[2] + vec3<f32>(0.0, 0.0, 1.0);
    let dj = jacobian_minus_one(H);
    let f = isochoric_factors(1.0 + dj);
    // I1 - 3 and I2 - 3 from H: I1 - 3 = 2 tr H + H:H, I2 - 3 = |cof F|^2 - 3 with cof F = I + G.
    let trace = H[0].x + H[1].y + H[2].z;
    let i1_3 = 2.0 * trace + dot(H[0], H[0]) + dot(H[1], H[1]) + dot(H[2], H[2]);
    let ex = vec3<f32>(1.0, 0.0, 0.0);
    let ey = vec3<f32>(0.0, 1.0, 0.0);
    let ez = vec3<f32>(0.0, 0.0, 1.0);
    let gx = cross(ey, H[2]) + cross(H[1], ez) + cross(H[1], H[2]);
    let gy = cross(ez, H[0]) + cross(H[2], ex) + cross(H[2], H[0]);
    let gz = cross(ex, H[1]) + cross(H[0], ey) + cross(H[0], H[1]);
    let i2_3 = 2.0 * (gx.x + gy.y + gz.z) + dot(gx, gx) + dot(gy, gy) + dot(gz, gz);
    // a - 1: series of (1 + dj)^p where dj is small.
    let small = abs(dj) < 0.01;
    let a_1 = select(f.a - 1.0, dj * (-0.6666667 + dj * (0.5555556 - dj * 0.49382716)), small);
    let b_1 = select(f.b - 1.0, dj * (-1.3333334 + dj * (1.5555556 - dj * 1.7283951)), small);
    return params.c10 * (f.a * i1_3 + 3.0 * a_1)
        + params.c01 * (f.b * i2_3 + 3.0 * b_1)
        + 0.5 * params.bulk_modulus * dj * dj;
}
