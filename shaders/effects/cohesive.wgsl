// Faces that separate: state and pure functions. Equations: src/effects/cohesive.rs.
struct CohesiveParams {
    // Openings at the strengths, strength/K, in opening and in shear [m].
    onset: f32,
    shear_onset: f32,
    // Twice the fracture energies over K, G_I and G_II [m^2].
    energy: f32,
    shear_energy: f32,
    // Exponent of the mode mixity.
    exponent: f32,
    // K [Pa/m].
    penalty: f32,
    // One over the length over which the tip opens a pair [1/m].
    inverse_ramp: f32,
    // Overlap and slip within which torn faces touch [m].
    torn_reach: f32,
    pair_count: u32,
    _pad0: u32,
    _pad1: u32,
    _pad2: u32,
}

// Two copies of a node that may part.
struct FacePair {
    // Copies a and b; slots of `corner_force` that take the forces on them.
    nodes: vec4<u32>,
    // Neighbours of a: before and after along the one way on the surface, then along the other.
    ring: vec4<u32>,
    // Rest way between the first two neighbours [m], and area [m^2] in w.
    first_way_and_area: vec4<f32>,
    // Rest way between the other two [m], and in w the material coordinate s0 where the tip drives the pair, beyond every
    // path where it does not [m].
    second_way_and_start: vec4<f32>,
    // Contact nodes of the copies, a pair without any names one that is never touched; z, w unused.
    contacts: vec4<u32>,
}

// What a pair remembers.
struct PairState {
    // Damage D.
    damage: f32,
    // Dissipated in this frame [J]; stored at the last step [J].
    dissipation: f32,
    stored: f32,
    _pad: f32,
}

@group(0) @binding(12) var<uniform> cohesive: CohesiveParams;
@group(1) @binding(11) var<storage, read> face_pairs: array<FacePair>;
@group(3) @binding(14) var<storage, read_write> pair_states: array<PairState>;

// Damage that a monotonic opening reaches.
fn opening_damage(normal: f32, shear: f32) -> f32 {
    let open = max(normal, 0.0);
    let square = open * open + shear * shear;
    let share = select(0.0, shear * shear / square, square > 0.0);
    let inverse = (1.0 - share) / (cohesive.onset * cohesive.onset)
        + share / (cohesive.shear_onset * cohesive.shear_onset);
    let onset = inverseSqrt(inverse);
    // pow of zero is undefined in some drivers.
    let mix = select(0.0, pow(share, cohesive.exponent), share > 0.0);
    let end = (cohesive.energy + (cohesive.shear_energy - cohesive.energy) * mix) / onset;
    let lambda = sqrt(square);
    return clamp(end * (lambda - onset) / (max(lambda, onset) * (end - onset)), 0.0, 1.0);
}

// Contact of torn faces per K A: U [m^2], and dU/dg over the normal and over the shear opening.
struct TornContact {
    stored: f32,
    normal: f32,
    slip: f32,
}

// Of the squares of overlap and slip [m^2], or their products at two times.
fn torn_contact(overlap_square: f32, slip_square: f32) -> TornContact {
    let square = cohesive.torn_reach * cohesive.torn_reach;
    let left = 1.0 - clamp(overlap_square / square, 0.0, 1.0);
    let facing = 1.0 - clamp(slip_square / square, 0.0, 1.0);
    // 1 - left^3 without the difference of two numbers that are nearly one.
    let held = (1.0 - left) * (1.0 + left + left * left);
    return TornContact(
        square / 6.0 * held * facing * facing,
        left * left * facing * facing,
        -2.0 / 3.0 * held * facing,
    );
}
