// Plasticity: return mapping on the Mandel stress. Equations: src/effects/plasticity.rs.
// Yield stress sigma_y and hardening modulus H [Pa].
#params PlasticityParams

struct PlasticState {
    // Columns of G - I, G = Fp^-1; w: equivalent plastic strain alpha.
    x: vec4<f32>,
    y: vec4<f32>,
    z: vec4<f32>,
}

@group(0) @binding(7) var<uniform> plasticity: array<PlasticityParams, 256>;
@group(3) @binding(9) var<storage, read_write> plastic_state: array<PlasticState>;

// Flow begins where the overstress is worth a thousandth of the strain at yield within these limits, and ends where it is
// worth a tenth of that: smaller increments would vanish in the last digits of G and alpha.
const SMALLEST_FLOW: f32 = 1e-6;
const WORTHWHILE_FLOW: f32 = 2e-6;
const LARGEST_FLOW: f32 = 0.05;
const FLOW_ITERATIONS: u32 = 40u;

struct PlasticAnswer {
    // Answer of the law to Fe, with P = P_law G^T; cof and J - 1 are those of Fe.
    elastic: IsochoricStress,
    // He = Fe - I.
    He: mat3x3<f32>,
    // alpha before and after this step, dissipated energy [J/m^3], 1 where the flow failed.
    alpha_before: f32,
    alpha: f32,
    dissipation: f32,
    failure: f32,
}

struct MandelStress {
    // Deviator and its equivalent [Pa].
    deviator: mat3x3<f32>,
    q: f32,
}

fn mandel_stress(He: mat3x3<f32>, P: mat3x3<f32>) -> MandelStress {
    var s = transpose(deformation_gradient(He)) * P;
    s = (s + transpose(s)) * 0.5;
    let mean = (s[0].x + s[1].y + s[2].z) * 0.33333333;
    s[0].x -= mean;
    s[1].y -= mean;
    s[2].z -= mean;
    return MandelStress(s, sqrt(1.5 * double_dot(s, s)));
}

// exp(A) - I for a small symmetric A.
fn exponential_minus_one(A: mat3x3<f32>) -> mat3x3<f32> {
    let A2 = A * A;
    return A + A2 * 0.5 + A2 * A * 0.16666667 + A2 * A2 * 0.041666667;
}

fn flow_plastically(material: Material, number: u32, cell: u32, H: mat3x3<f32>, advance: bool) -> PlasticAnswer {
    let params = plasticity[number];
    let state = plastic_state[cell];
    var G = mat3x3<f32>(state.x.xyz, state.y.xyz, state.z.xyz);
    var out: PlasticAnswer;
    out.alpha = state.x.w;
    out.alpha_before = state.x.w;
    out.He = H + G + H * G;
    out.elastic = isochoric_stress(material, out.He);
    var mandel = mandel_stress(out.He, out.elastic.P);
    var overstress = mandel.q - (params.yield_stress + params.hardening * out.alpha);
    var slope = 3.0 * material.shear_modulus + params.hardening;
    let threshold = clamp(1e-3 * params.yield_stress, SMALLEST_FLOW * slope, WORTHWHILE_FLOW * slope);
    let tolerance = 0.1 * threshold;
    var going = advance && overstress > threshold;
    let flows = going;
    for (var i = 0u; going && i < FLOW_ITERATIONS; i++) {
        let step = clamp(overstress / slope, -LARGEST_FLOW, LARGEST_FLOW);
        let M = exponential_minus_one(mandel.deviator * (-1.5 * step / mandel.q));
        var G_next = G + M + G * M;
        // det G = 1.
        G_next -= deformation_gradient(G_next) * (jacobian_minus_one(G_next) * 0.33333333);
        let He = H + G_next + H * G_next;
        let elastic = isochoric_stress(material, He);
        let next = mandel_stress(He, elastic.P);
        // A step through zero stress would end on the far side of the yield surface: its stress counts as negative, the
        // slope that follows shortens the step, and the step is taken again.
        let reversed = double_dot(next.deviator, mandel.deviator) < 0.0;
        let signed_q = select(next.q, -next.q, reversed);
        let left = signed_q - (params.yield_stress + params.hardening * (out.alpha + step));
        let secant = (overstress - left) / step;
        slope = select(slope, secant, secant > 0.1 * slope);
        if (!reversed) {
            G = G_next;
            out.alpha += step;
            out.He = He;
            out.elastic = elastic;
            out.dissipation += 0.5 * (mandel.q + next.q) * step;
            mandel = next;
            overstress = left;
            going = abs(left) > tolerance;
        }
    }
    out.failure = select(0.0, 1.0, going);
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, flows); once == 0u; once++) {
        plastic_state[cell].x = vec4<f32>(G[0], out.alpha);
        plastic_state[cell].y = vec4<f32>(G[1], 0.0);
        plastic_state[cell].z = vec4<f32>(G[2], 0.0);
    }
    out.elastic.P = out.elastic.P * transpose(deformation_gradient(G));
    return out;
}
