// The elastic law of a material: isochoric stress and energy. Formulas in src/material/mod.rs.
#import shared/kinematics

struct Material {
    // Constants of the isochoric law; their meaning is in the file of the law.
    constants: vec4<f32>,
    bulk_modulus: f32,
    // mu0 [Pa].
    shear_modulus: f32,
    // Hourglass modulus kappa 3.11 mu0 [Pa].
    hourglass: f32,
    // 0 neo-Hookean, 1 Mooney-Rivlin, 2 Yeoh, 3 Ogden, 4 Demiray.
    law: u32,
}

@group(0) @binding(6) var<uniform> materials: array<Material, 16>;

#ifdef REGIONS
// Index of the material per cell.
@group(1) @binding(7) var<storage, read> cell_material: array<u32>;
#endif

// dW/dI1bar, dW/dI2bar, d^2W/dI1bar^2 [Pa].
struct Slopes {
    w1: f32,
    w2: f32,
    w11: f32,
}

struct IsochoricStress {
    // P_iso [Pa], by columns.
    P: mat3x3<f32>,
    // cof F, J - 1, and the bound of the tangent modulus: beside |N|^2, and beside |cof F N|^2 [Pa].
    cof: mat3x3<f32>,
    dj: f32,
    tangent: f32,
    turned_tangent: f32,
}

#ifdef NEO_HOOKEAN
#import materials/neo_hookean
#endif
#ifdef MOONEY_RIVLIN
#import materials/mooney_rivlin
#endif
#ifdef YEOH
#import materials/yeoh
#endif
#ifdef OGDEN
#import materials/ogden
#endif
#ifdef DEMIRAY
#import materials/demiray
#endif

fn material_of(cell: u32) -> u32 {
#ifdef REGIONS
    return cell_material[cell];
#else
    return 0u;
#endif
}

#ifdef INVARIANT_LAWS
// Slopes at I1bar - 3.
fn isochoric_slopes(material: Material, i1: f32) -> Slopes {
    let c = material.constants;
#ifdef SEVERAL_LAWS
    var s = Slopes(0.0, 0.0, 0.0);
    switch material.law {
#ifdef NEO_HOOKEAN
        case 0u: { s = neo_hookean_slopes(c); }
#endif
#ifdef MOONEY_RIVLIN
        case 1u: { s = mooney_rivlin_slopes(c); }
#endif
#ifdef YEOH
        case 2u: { s = yeoh_slopes(c, i1); }
#endif
#ifdef DEMIRAY
        case 4u: { s = demiray_slopes(c, i1); }
#endif
        default: {}
    }
    return s;
#else
#ifdef NEO_HOOKEAN
    return neo_hookean_slopes(c);
#endif
#ifdef MOONEY_RIVLIN
    return mooney_rivlin_slopes(c);
#endif
#ifdef YEOH
    return yeoh_slopes(c, i1);
#endif
#ifdef DEMIRAY
    return demiray_slopes(c, i1);
#endif
#endif
}

fn invariant_stress(material: Material, H: mat3x3<f32>) -> IsochoricStress {
    let F = deformation_gradient(H);
    let x = F[0];
    let y = F[1];
    let z = F[2];
    var out: IsochoricStress;
    let cof = cofactor(F);
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
    let s = isochoric_slopes(material, f.a * i1 - 3.0);
    let first = 2.0 * s.w1 * f.a;
    let second = 2.0 * s.w2 * f.b;
    // w1 a' I1 + w2 b' I2; in this form what must cancel at F = I cancels to the last bit, and tissue at rest stays there.
    let along = -2.0 * s.w1 * (f.a_fall * (i1 * 0.33333333)) - 2.0 * s.w2 * (f.b_fall * (i2 * 0.6666667));
    // Columns of 2 w1 a F + 2 w2 b (I1 F - F C) + (...) cof F.
    out.P = mat3x3<f32>(
        x * (first + second * (yy + zz)) - (y * xy + z * zx) * second + cof[0] * along,
        y * (first + second * (zz + xx)) - (x * xy + z * yz) * second + cof[1] * along,
        z * (first + second * (xx + yy)) - (x * zx + y * yz) * second + cof[2] * along,
    );
    out.cof = cof;
    out.dj = dj;
    let gradient_squared = f.a * f.a * i1 * (f.a * f.a * f.a * i1 * i2 * 0.11111111 - 1.0);
    out.tangent = 2.6666667 * (s.w1 + s.w2) * max(1.0, i1 * 0.33333333)
        + 4.0 * max(s.w11, 0.0) * max(gradient_squared, 0.0);
    out.turned_tangent = max(s.w1 * (f.a_curvature * i1 - 3.3333333) + s.w2 * (f.b_curvature * i2 - 9.3333333), 0.0);
    return out;
}
#endif

// P_iso and what goes with it for H = F - I.
fn isochoric_stress(material: Material, H: mat3x3<f32>) -> IsochoricStress {
#ifdef INVARIANT_LAWS
    var out = invariant_stress(material, H);
#ifdef OGDEN
    if (material.law == 3u) {
        out = ogden_stress(material.constants, H);
    }
#endif
    return out;
#else
    return ogden_stress(material.constants, H);
#endif
}

// W_iso [J/m^3] for H = F - I.
fn isochoric_energy(material: Material, H: mat3x3<f32>) -> f32 {
    let dj = jacobian_minus_one(H);
    let c = material.constants;
    var energy = 0.0;
#ifdef INVARIANT_LAWS
    let f = isochoric_factors(1.0 + dj);
    // I1 - 3 and I2 - 3 from H: I1 - 3 = 2 tr H + H:H, I2 - 3 = |cof F|^2 - 3 with cof F = I + G.
    let trace = H[0].x + H[1].y + H[2].z;
    let i1_3 = 2.0 * trace + double_dot(H, H);
    let ex = vec3<f32>(1.0, 0.0, 0.0);
    let ey = vec3<f32>(0.0, 1.0, 0.0);
    let ez = vec3<f32>(0.0, 0.0, 1.0);
    let gx = cross(ey, H[2]) + cross(H[1], ez) + cross(H[1], H[2]);
    let gy = cross(ez, H[0]) + cross(H[2], ex) + cross(H[2], H[0]);
    let gz = cross(ex, H[1]) + cross(H[0], ey) + cross(H[0], H[1]);
    let i2_3 = 2.0 * (gx.x + gy.y + gz.z) + dot(gx, gx) + dot(gy, gy) + dot(gz, gz);
    // I1bar - 3 and I2bar - 3.
    let i1 = f.a * i1_3 + 3.0 * power_minus_one(dj, -0.6666667, f.a);
    let i2 = f.b * i2_3 + 3.0 * power_minus_one(dj, -1.3333334, f.b);
#ifdef NEO_HOOKEAN
    energy = select(energy, neo_hookean_energy(c, i1), material.law == 0u);
#endif
#ifdef MOONEY_RIVLIN
    energy = select(energy, mooney_rivlin_energy(c, i1, i2), material.law == 1u);
#endif
#ifdef YEOH
    energy = select(energy, yeoh_energy(c, i1), material.law == 2u);
#endif
#ifdef DEMIRAY
    energy = select(energy, demiray_energy(c, i1), material.law == 4u);
#endif
#endif
#ifdef OGDEN
    energy = select(energy, ogden_energy(c, H, dj), material.law == 3u);
#endif
    return energy;
}
