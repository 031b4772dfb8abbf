// Viscoelasticity: Prony terms on the isochoric second Piola-Kirchhoff stress. Equations: src/effects/viscoelastic.rs.
#import shared/step_input

struct PronyTerm {
    // Share g of the stress, 1 - e^-x of one update, 1/(4 mu0 g) [1/Pa].
    ratio: f32,
    decay: f32,
    compliance: f32,
    _pad: f32,
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
    // In the sum of a cell: binary logarithm of the steps between two updates, one byte for each of the terms 1 to 4 and
    // (below) 5 to 8. Constant, and here because a branch that depends on uniforms alone, the step number among them,
    // makes one software adapter compile the stage anew in every step.
    first_intervals: u32,
    xy: f32,
    yz: f32,
    zx: f32,
    last_intervals: u32,
}

struct ViscousLayout {
    // Entries of one cell: the sum and the terms of the longest series; these terms.
    entries: u32,
    term_count: u32,
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
    return ViscousStress(T[0].x, T[1].y, T[2].z, sum.first_intervals, T[1].x, T[2].y, T[0].z, sum.last_intervals);
}

// F^-1 P, symmetric; below J = 0.2 with J = 0.2.
fn second_piola_kirchhoff(P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> mat3x3<f32> {
    let S = (transpose(cof) * P) * (0.5 / max(1.0 + dj, 0.2));
    return S + transpose(S);
}

fn green_lagrange(H: mat3x3<f32>) -> mat3x3<f32> {
    return (H + transpose(H) + transpose(H) * H) * 0.5;
}

// Brings the terms of a cell that are due in this step up to date, each in the middle of its interval; returns the work
// sum E:dq [J/m^3].
fn relax(number: u32, cell: u32, H: mat3x3<f32>, P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> f32 {
    var work = 0.0;
    let step = step_input.step;
    let base = cell * viscous_layout.entries;
    let head = viscous_state[base];
    for (var i = 0u; i < viscous_layout.term_count; i++) {
        let bytes = select(head.last_intervals, head.first_intervals, i < 4u);
        let interval = 1u << ((bytes >> (8u * (i & 3u))) & 31u);
        let due = (step & (interval - 1u)) == interval / 2u;
        // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
        for (var once = select(1u, 0u, due); once == 0u; once++) {
            let term = prony[number].terms[i];
            let S = second_piola_kirchhoff(P, cof, dj);
            let q = viscous_tensor(viscous_state[base + 1u + i]);
            let dq = (S * term.ratio - q) * term.decay;
            viscous_state[base + 1u + i] = viscous_entries(q + dq, head);
            viscous_state[base] = viscous_entries(viscous_sum(cell) + dq, head);
            work += double_dot(green_lagrange(H), dq);
        }
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
    for (var i = 0u; i < viscous_layout.term_count; i++) {
        let q = viscous_tensor(viscous_state[base + 1u + i]);
        energy += prony[number].terms[i].compliance * double_dot(q, q);
    }
    return energy;
}
