// The elastic law of a material: isochoric stress and energy. Formulas in src/material/mod.rs.
// `#for law ... #end` repeats its lines for every law of the scene; `$law` is the stem of its files. A law of the invariants gives
// `$law_slopes` and `$law_energy`, one of the principal stretches `$law_stress` and `$law_energy`.
#import shared/kinematics

struct Material {
    // Constants of the isochoric law; their meaning is in the file of the law.
    constants: vec4<f32>,
    bulk_modulus: f32,
    // mu0 [Pa].
    shear_modulus: f32,
    // Hourglass modulus kappa 3.11 mu0 [Pa].
    hourglass: f32,
    // Place of the law in `material::LAWS`, `$number` below.
    law: u32,
}

@group(0) @binding(6) var<uniform> materials: array<Material, 256>;

#ifdef REGIONS
// Index of the material per cell. Where cells are empty, 256 is added where open sides of the tissue meet, and behind the cells stand the
// strips that hold tissue: strip times the number of columns, and the column.
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

#for law
#import materials/$law
#end

fn material_of(cell: u32) -> u32 {
#ifdef EMPTY_CELLS
    return cell_material[cell] & 255u;
#else
#ifdef REGIONS
    return cell_material[cell];
#else
    return 0u;
#endif
#endif
}

#ifdef INVARIANT_LAWS
// Slopes at I1bar - 3.
fn isochoric_slopes(material: Material, i1: f32) -> Slopes {
    let c = material.constants;
#ifdef SEVERAL_LAWS
    var s = Slopes(0.0, 0.0, 0.0);
    switch material.law {
#for invariant law
        case $number: { s = $law_slopes(c, i1); }
#end
        default: {}
    }
    return s;
#else
#for invariant law
    return $law_slopes(c, i1);
#end
#endif
}

// Strain from which on the whole bound of the tangent is wanted.
const SMALL_STRAIN: f32 = 0.1;

// Bound of the tangent modulus, beside |cof F N|^2 and beside |N|^2: ElasticLaw::tangent_bound. `entries`: C by xx, yy, zz, xy, yz, zx;
// derivatives of both measures by their sums, -1/2 of those by J, and second ones by J.
fn strained_tangent(
    material: Material,
    s: Slopes,
    entries: array<f32, 6>,
    i2: f32,
    dj: f32,
    by_sum: vec2<f32>,
    fall: vec2<f32>,
    curvature: vec2<f32>,
) -> vec2<f32> {
    let xx = entries[0];
    let yy = entries[1];
    let zz = entries[2];
    let xy = entries[3];
    let yz = entries[4];
    let zx = entries[5];
    let i1 = xx + yy + zz;
    let J = 1.0 + dj;
    // Largest eigenvalues of C and cof C by Gershgorin's circles.
    let off = abs(vec3<f32>(xy, yz, zx));
    let l1 = min(i1, max(xx + off.x + off.z, max(yy + off.x + off.y, zz + off.y + off.z)));
    let k = abs(vec3<f32>(yz * zx - xy * zz, zx * xy - yz * xx, xy * yz - zx * yy));
    let area = max(1e-12, min(i2, max(
        yy * zz - yz * yz + k.x + k.z,
        max(zz * xx - zx * zx + k.x + k.y, xx * yy - xy * xy + k.y + k.z),
    )));
    let l3 = min(J * J / area, l1);
    let l2 = clamp(i1 - l1 - l3, l3, l1);
    let falls = 2.0 * fall / max(vec2<f32>(i1, i2), vec2<f32>(1e-6));
    let c = 2.0 * by_sum - 4.0 * falls * max(J, 0.0);
    let along_area = min(c, vec2<f32>(0.0)) / area;
    let turned = max(0.0, s.w1 * (curvature.x + along_area.x) + s.w2 * (curvature.y + along_area.y * (i1 - l1)));
    let l = sqrt(vec3<f32>(l1, l2, l3));
    let across = max((l1 - l3) * l2 * l.y, max((l2 - l3) * l1 * l.x, (l1 - l2) * l3 * l.z));
    let sideways = 2.0 * s.w1 * by_sum.x + 2.0 * s.w2 * by_sum.y * l1;
    let straight = abs(s.w1) * falls.x * (l1 - l3) * l.y + 1.16 * abs(s.w2) * falls.y * across
        + s.w1 * max(c.x, 0.0) + s.w2 * max(c.y, 0.0) * (i1 - l3)
        + max(0.0, sideways - (material.bulk_modulus + turned) * J * J / max(l1, 1e-12));
    // Inside out, both terms of a wave along its direction add.
    let turning = 2.0 * by_sum + 4.0 * max(-J, 0.0) * falls;
    let least = select(0.0, s.w1 * turning.x + s.w2 * turning.y * i1, J < J_CONTINUATION);
    return vec2<f32>(turned, max(max(straight, least), 0.0));
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
    // Both measures by their derivatives; -3/2 and -3/4 times the ones by J: in this form what must cancel at F = I cancels
    // to the last bit, and tissue at rest stays there.
    var first_bar = f.a * i1;
    var by_first = f.a;
    var by_second = f.b;
    var first_fall = f.a_fall * (i1 * 0.33333333);
    var second_fall = f.b_fall * (i2 * 0.6666667);
    var first_curvature = f.a_curvature * i1;
    var second_curvature = f.b_curvature * i2;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, dj < J_CONTINUATION - 1.0); once == 0u; once++) {
        let of_first = continued_measure(i1, 1.0 + dj, false);
        let of_second = continued_measure(i2, 1.0 + dj, true);
        first_bar = of_first.value;
        by_first = of_first.by_s;
        by_second = of_second.by_s;
        first_fall = -0.5 * of_first.by_j;
        second_fall = -0.5 * of_second.by_j;
        first_curvature = of_first.by_jj;
        second_curvature = of_second.by_jj;
    }
    let s = isochoric_slopes(material, first_bar - 3.0);
    let first = 2.0 * s.w1 * by_first;
    let second = 2.0 * s.w2 * by_second;
    let along = -2.0 * s.w1 * first_fall - 2.0 * s.w2 * second_fall;
    // Columns of 2 w1 dI1bar/dI1 F + 2 w2 dI2bar/dI2 (I1 F - F C) + (...) cof F.
    out.P = mat3x3<f32>(
        x * (first + second * (yy + zz)) - (y * xy + z * zx) * second + cof[0] * along,
        y * (first + second * (zz + xx)) - (x * xy + z * yz) * second + cof[1] * along,
        z * (first + second * (xx + yy)) - (x * zx + y * yz) * second + cof[2] * along,
    );
    out.cof = cof;
    out.dj = dj;
    // A quarter of |dI1bar/dF|^2.
    let J = 1.0 + dj;
    let gradient_squared = by_first * (by_first * i1 - 6.0 * first_fall * J) + first_fall * first_fall * i2;
    let stiffening = 4.0 * max(s.w11, 0.0) * max(gradient_squared, 0.0);
    // Bound of the tangent: ElasticLaw::tangent_bound. Small strains first, most cells of a block.
    let off = abs(vec3<f32>(xy, yz, zx));
    let along_axes = abs(vec3<f32>(xx, yy, zz) - 1.0);
    let strain = max(along_axes.x, max(along_axes.y, along_axes.z)) + 2.0 * max(off.x, max(off.y, off.z));
    let w = abs(s.w1) + abs(s.w2);
    out.turned_tangent = 2.6666667 * (s.w1 + s.w2 + 6.0 * strain * w);
    out.tangent = 3.2 * strain * w + stiffening;
    for (var once = select(1u, 0u, strain >= SMALL_STRAIN); once == 0u; once++) {
        let entries = array<f32, 6>(xx, yy, zz, xy, yz, zx);
        let curvatures = vec2<f32>(first_curvature, second_curvature);
        let bound = strained_tangent(material, s, entries, i2, dj, vec2<f32>(by_first, by_second), vec2<f32>(first_fall, second_fall), curvatures);
        out.turned_tangent = bound.x;
        out.tangent = bound.y + stiffening;
    }
    return out;
}
#endif

// P_iso and what goes with it for H = F - I.
fn isochoric_stress(material: Material, H: mat3x3<f32>) -> IsochoricStress {
#ifdef INVARIANT_LAWS
    var out = invariant_stress(material, H);
#for stretch law
    if (material.law == $number) {
        out = $law_stress(material.constants, H);
    }
#end
    return out;
#else
#ifdef SEVERAL_LAWS
    var out: IsochoricStress;
#for stretch law
    if (material.law == $number) {
        out = $law_stress(material.constants, H);
    }
#end
    return out;
#else
#for stretch law
    return $law_stress(material.constants, H);
#end
#endif
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
    var i1 = f.a * i1_3 + 3.0 * power_minus_one(dj, -0.6666667, f.a);
    var i2 = f.b * i2_3 + 3.0 * power_minus_one(dj, -1.3333334, f.b);
    for (var once = select(1u, 0u, dj < J_CONTINUATION - 1.0); once == 0u; once++) {
        i1 = continued_measure(3.0 + i1_3, 1.0 + dj, false).value - 3.0;
        i2 = continued_measure(3.0 + i2_3, 1.0 + dj, true).value - 3.0;
    }
#for invariant law
    energy = select(energy, $law_energy(c, i1, i2), material.law == $number);
#end
#endif
#for stretch law
    energy = select(energy, $law_energy(c, H, dj), material.law == $number);
#end
    return energy;
}
