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

// A symmetric tensor [Pa] as bits of f32: xx, yy, zz and xy, yz, zx. Two vectors: a load or store of four lanes costs
// little more than one of a single lane.
struct ViscousStress {
    // w: see `update_interval`.
    normal: vec4<u32>,
    shear: vec4<u32>,
}

struct ViscousLayout {
    // Entries of one cell: the sum and the terms of the longest series; these terms.
    entries: u32,
    term_count: u32,
    _pad1: u32,
    _pad2: u32,
}

@group(0) @binding(9) var<uniform> prony: array<PronySeries, 256>;
@group(0) @binding(10) var<uniform> viscous_layout: ViscousLayout;
// Per cell the sum of all q_i, then q_1, q_2, ...
@group(3) @binding(10) var<storage, read_write> viscous_state: array<ViscousStress>;

fn viscous_tensor(q: ViscousStress) -> mat3x3<f32> {
    let n = bitcast<vec4<f32>>(q.normal);
    let s = bitcast<vec4<f32>>(q.shear);
    return mat3x3<f32>(vec3<f32>(n.x, s.x, s.z), vec3<f32>(s.x, n.y, s.y), vec3<f32>(s.z, s.y, n.z));
}

// The entries of T with the w lanes of `head`.
fn viscous_entries(T: mat3x3<f32>, head: ViscousStress) -> ViscousStress {
    return ViscousStress(
        vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(T[0].x, T[1].y, T[2].z)), head.normal.w),
        vec4<u32>(bitcast<vec3<u32>>(vec3<f32>(T[1].x, T[2].y, T[0].z)), head.shear.w),
    );
}

// Steps between two updates of term i: the w lanes of the first entry of a cell hold its binary logarithm, one byte each
// for the terms 1 to 4 and 5 to 8. Constant, and there because a branch that depends on uniforms alone, the step number
// among them, makes one software adapter compile the stage anew in every step.
fn update_interval(head: ViscousStress, i: u32) -> u32 {
    let bytes = select(head.shear.w, head.normal.w, i < 4u);
    return 1u << ((bytes >> (8u * (i & 3u))) & 31u);
}

// F^-1 P, symmetric; below J = 0.2 with J = 0.2.
fn second_piola_kirchhoff(P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> mat3x3<f32> {
    let S = (transpose(cof) * P) * (0.5 / max(1.0 + dj, 0.2));
    return S + transpose(S);
}

fn green_lagrange(H: mat3x3<f32>) -> mat3x3<f32> {
    return (H + transpose(H) + transpose(H) * H) * 0.5;
}

struct Relaxation {
    // Sum of all q_i [Pa], work sum E:dq of this step [J/m^3].
    sum: mat3x3<f32>,
    work: f32,
}

// Brings the terms of a cell that are due in this step up to date, each in the middle of its interval.
fn relax(number: u32, cell: u32, H: mat3x3<f32>, P: mat3x3<f32>, cof: mat3x3<f32>, dj: f32) -> Relaxation {
    let step = step_input.step;
    let base = cell * viscous_layout.entries;
    let head = viscous_state[base];
    var out = Relaxation(viscous_tensor(head), 0.0);
    var changed = false;
    for (var i = 0u; i < viscous_layout.term_count; i++) {
        let interval = update_interval(head, i);
        // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
        for (var once = select(1u, 0u, (step & (interval - 1u)) == interval / 2u); once == 0u; once++) {
            let term = prony[number].terms[i];
            let q = viscous_tensor(viscous_state[base + 1u + i]);
            let dq = (second_piola_kirchhoff(P, cof, dj) * term.ratio - q) * term.decay;
            viscous_state[base + 1u + i] = viscous_entries(q + dq, head);
            out.sum += dq;
            out.work += double_dot(green_lagrange(H), dq);
            changed = true;
        }
    }
    for (var once = select(1u, 0u, changed); once == 0u; once++) {
        viscous_state[base] = viscous_entries(out.sum, head);
    }
    return out;
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
