// Viscoelasticity: Prony terms on the isochoric second Piola-Kirchhoff stress. Equations: src/effects/viscoelastic.rs.
#import shared/step_input

struct PronyTerm {
    // Share g of the stress, 1 - e^-x of one update, 1/(4 mu0 g) [1/Pa].
    ratio: f32,
    decay: f32,
    compliance: f32,
    // Steps between two updates less one; a power of two less one.
    interval_mask: u32,
}

// Terms of one material; those that it lacks have no share and never change.
struct PronySeries {
    terms: array<PronyTerm, 8>,
}

// A symmetric tensor [Pa]: xx, yy, zz and xy, yz, zx.
struct ViscousStress {
    normal: vec4<f32>,
    shear: vec4<f32>,
}

struct ViscousCounts {
    // Terms of the longest series.
    term_count: u32,
    // Some term is due only where these bits of the step number are zero.
    interval_mask: u32,
    _pad0: u32,
    _pad1: u32,
}

@group(0) @binding(9) var<uniform> prony: array<PronySeries, 16>;
@group(0) @binding(10) var<uniform> viscous_counts: ViscousCounts;
// Per cell the sum of all q_i, then q_1, q_2, ...
@group(3) @binding(10) var<storage, read_write> viscous_state: array<ViscousStress>;

fn viscous_tensor(q: ViscousStress) -> mat3x3<f32> {
    return mat3x3<f32>(
        vec3<f32>(q.normal.x, q.shear.x, q.shear.z),
        vec3<f32>(q.shear.x, q.normal.y, q.shear.y),
        vec3<f32>(q.shear.z, q.shear.y, q.normal.z),
    );
}

// F^-1 P, symmetric; below J = 0.2 with J = 0.2.
fn second_piola_kirchhoff(P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> ViscousStress {
    let S = (transpose(cof) * P) * (1.0 / max(1.0 + dj, 0.2));
    return ViscousStress(
        vec4<f32>(S[0].x, S[1].y, S[2].z, 0.0),
        vec4<f32>(S[0].y + S[1].x, S[1].z + S[2].y, S[2].x + S[0].z, 0.0) * 0.5,
    );
}

fn green_lagrange(H: mat3x3<f32>) -> mat3x3<f32> {
    return (H + transpose(H) + transpose(H) * H) * 0.5;
}

// Contraction of a tensor with a symmetric strain.
fn contract(q: ViscousStress, E: mat3x3<f32>) -> f32 {
    return dot(q.normal.xyz, vec3<f32>(E[0].x, E[1].y, E[2].z))
        + 2.0 * dot(q.shear.xyz, vec3<f32>(E[1].x, E[2].y, E[0].z));
}

// Brings the terms of a cell to this step; returns sum E:dq [J/m^3].
fn relax(number: u32, cell: u32, H: mat3x3<f32>, P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> f32 {
    var work = 0.0;
    let step = step_input.step;
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    let due = (step & viscous_counts.interval_mask) == 0u;
    for (var once = select(1u, 0u, due); once == 0u; once++) {
        let S = second_piola_kirchhoff(P, cof, dj);
        let E = green_lagrange(H);
        let base = cell * (viscous_counts.term_count + 1u);
        var sum = ViscousStress(vec4<f32>(0.0), vec4<f32>(0.0));
        for (var i = 0u; i < viscous_counts.term_count; i++) {
            let term = prony[number].terms[i];
            var q = viscous_state[base + 1u + i];
            let decay = select(0.0, term.decay, (step & term.interval_mask) == (term.interval_mask + 1u) / 2u);
            let dq = ViscousStress(
                (S.normal * term.ratio - q.normal) * decay,
                (S.shear * term.ratio - q.shear) * decay,
            );
            q.normal += dq.normal;
            q.shear += dq.shear;
            viscous_state[base + 1u + i] = q;
            sum.normal += q.normal;
            sum.shear += q.shear;
            work += contract(dq, E);
        }
        viscous_state[base] = sum;
    }
    return work;
}

fn viscous_sum(cell: u32) -> ViscousStress {
    return viscous_state[cell * (viscous_counts.term_count + 1u)];
}

// Xi, the energy that the terms hold [J/m^3].
fn viscous_energy(number: u32, cell: u32) -> f32 {
    var energy = 0.0;
    for (var i = 0u; i < viscous_counts.term_count; i++) {
        let q = viscous_state[cell * (viscous_counts.term_count + 1u) + 1u + i];
        energy += prony[number].terms[i].compliance
            * (dot(q.normal.xyz, q.normal.xyz) + 2.0 * dot(q.shear.xyz, q.shear.xyz));
    }
    return energy;
}
