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

// A symmetric tensor [Pa].
struct ViscousStress {
    xx: f32,
    yy: f32,
    zz: f32,
    // In the sum of a cell: number of terms. Constant, and here because a loop whose end comes from a uniform beside the
    // step number makes one software adapter compile the stage anew in every step.
    term_count: u32,
    xy: f32,
    yz: f32,
    zx: f32,
    // In the sum of a cell: some term is due only where these bits of the step number are zero.
    interval_mask: u32,
}

struct ViscousLayout {
    // Entries of one cell: the sum and the terms of the longest series.
    entries: u32,
    _pad0: u32,
    _pad1: u32,
    _pad2: u32,
}

@group(0) @binding(9) var<uniform> prony: array<PronySeries, 16>;
@group(0) @binding(10) var<uniform> viscous_layout: ViscousLayout;
// Per cell the sum of all q_i, then q_1, q_2, ...
@group(3) @binding(10) var<storage, read_write> viscous_state: array<ViscousStress>;

fn viscous_tensor(q: ViscousStress) -> mat3x3<f32> {
    return mat3x3<f32>(vec3<f32>(q.xx, q.xy, q.zx), vec3<f32>(q.xy, q.yy, q.yz), vec3<f32>(q.zx, q.yz, q.zz));
}

fn viscous_entries(T: mat3x3<f32>, sum: ViscousStress) -> ViscousStress {
    return ViscousStress(T[0].x, T[1].y, T[2].z, sum.term_count, T[1].x, T[2].y, T[0].z, sum.interval_mask);
}

// F^-1 P, symmetric; below J = 0.2 with J = 0.2.
fn second_piola_kirchhoff(P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> mat3x3<f32> {
    let S = (transpose(cof) * P) * (0.5 / max(1.0 + dj, 0.2));
    return S + transpose(S);
}

fn green_lagrange(H: mat3x3<f32>) -> mat3x3<f32> {
    return (H + transpose(H) + transpose(H) * H) * 0.5;
}

// Brings the terms of a cell to this step; returns sum E:dq [J/m^3].
fn relax(number: u32, cell: u32, H: mat3x3<f32>, P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> f32 {
    var work = 0.0;
    let step = step_input.step;
    let base = cell * viscous_layout.entries;
    let head = viscous_state[base];
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    for (var once = select(1u, 0u, (step & head.interval_mask) == 0u); once == 0u; once++) {
        let S = second_piola_kirchhoff(P, cof, dj);
        let E = green_lagrange(H);
        var sum = S * 0.0;
        for (var i = 0u; i < head.term_count; i++) {
            let term = prony[number].terms[i];
            let q = viscous_tensor(viscous_state[base + 1u + i]);
            let decay = select(0.0, term.decay, (step & term.interval_mask) == (term.interval_mask + 1u) / 2u);
            let dq = (S * term.ratio - q) * decay;
            viscous_state[base + 1u + i] = viscous_entries(q + dq, head);
            sum += q + dq;
            work += double_dot(E, dq);
        }
        viscous_state[base] = viscous_entries(sum, head);
    }
    return work;
}

fn viscous_sum(cell: u32) -> mat3x3<f32> {
    return viscous_tensor(viscous_state[cell * viscous_layout.entries]);
}

// Xi, the energy that the terms hold [J/m^3].
fn viscous_energy(number: u32, cell: u32) -> f32 {
    var energy = 0.0;
    let base = cell * viscous_layout.entries;
    for (var i = 0u; i < viscous_state[base].term_count; i++) {
        let q = viscous_tensor(viscous_state[base + 1u + i]);
        energy += prony[number].terms[i].compliance * double_dot(q, q);
    }
    return energy;
}
