// Puncture: state and pure functions of the tip law and of the opened path. Equations: src/effects/puncture.rs.
#ifdef FREE_PATH
#import effects/free_path
#endif
struct PunctureParams {
    // Material coordinate at which the path leaves the block through the bottom [m].
    exit: f32,
    // Stiffness of all tip springs together [N/m].
    tip_stiffness: f32,
    // Elastic stiffness left in a softened cell.
    residual_stiffness: f32,
    // Normal stiffness of the contact with a face that separates [N/m], fraction of critical damping, fading length of an overlap [m].
    contact_stiffness: f32,
    contact_damping: f32,
    entry_fade: f32,
    // Radius and cone length of the needle [m].
    needle_radius: f32,
    tip_length: f32,
    // Nodes farther than this from the tip coordinate along the path are on no cell that holds an anchor [m].
    anchor_reach: f32,
    path_cell_count: u32,
    // Radius of the softened path, and of the nodes around it that the shaft pushes [m].
    softened_radius: f32,
    ring_radius: f32,
    // Shift of a section's centre per radius: zero for a cone, from the apex to the axis for a bevel; w unused.
    shift: vec4<f32>,
    // Radii of the cutting edge and of the bore [m]; coefficient mu of the bore.
    edge_radius: f32,
    bore_radius: f32,
    bore_grip: f32,
    // Contact at the points of a slit: stiffness per area [Pa/m], damping over stiffness [s].
    face_stiffness: f32,
    face_damping: f32,
    // Stiffness of the ring around an opened path per rest volume [N/m^4].
    ring_stiffness: f32,
    _pad3: u32,
    _pad4: u32,
    // Of a free path: direction of the needle before the run, to which `shift` belongs; first cell and cells per axis of
    // the box of `free_cells`; w unused.
    reference: vec4<f32>,
    free_low: vec4<u32>,
    free_count: vec4<u32>,
    // Bit i: segment i is a membrane.
    membranes: u32,
    // Exponent of the speed in the tip forces, and the speed up to which they are the written ones [m/s].
    rate_exponent: f32,
    reference_speed: f32,
    // Length over which the threshold falls behind the entry of a material, and to nothing before the exit [m].
    transition_length: f32,
    // Of a free path: those of material number i, without the first. Of a planned path: stretches of the path through one
    // material: coordinate a where it begins [m], forces F_pun and F_cut [N], length over which the
    // threshold falls from one to the other [m].
    segments: array<vec4<f32>, 16>,
}

// Material line parallel to the path: where it enters the surface [m], w: unused.
struct TipAnchor {
    surface: vec4<f32>,
    // In a bent grid, whose columns it runs through: column (x, y) and place in it (0..1); z, w unused.
    column: vec4<u32>,
    local: vec4<f32>,
}

// Where an anchor sits now: cell (w unused); local coordinates 0..1, and force along the path [N].
struct TipAnchorLoad {
    cell: vec4<u32>,
    load: vec4<f32>,
}

struct TipState {
    // Material coordinate a of the tip [m].
    coordinate: f32,
    // Dissipated by the tip law in this frame [J]; stored in the tip springs now [J]; taken by softening [J].
    dissipation: f32,
    spring_energy: f32,
    softening: f32,
    // Impulse of the tip law in membranes and of tissue that holds on to the tip, in this frame [N s].
    membrane_impulse: f32,
    bond_impulse: f32,
    // Dissipated by that bond in this frame [J]; its stretch and the distance it slid [m].
    bond_dissipation: f32,
    bond_stretch: f32,
    bond_slid: f32,
    // Mean distance of the tip plane beyond the anchors [m].
    gap: f32,
    // Dissipated in this frame beyond the threshold, while the cap on the advance holds the force above it [J].
    cap_dissipation: f32,
    // In the scheme `opening`: depth of the dimple around the tip [m], force of the tip at its bottom [N].
    dimple: f32,
    touch_force: f32,
    // How far it advanced in this step, and how far the dimple shifted the path with it [m].
    advanced: f32,
    shifted: f32,
    // By how much the tissue at the tip moves along the needle per length of its path, d(x.t)/da.
    touch_stretch: f32,
}

// Cell that the path passes: part of its stiffness that is left then, s0 range of the part that opens [m].
struct PathCell {
    cell: u32,
    left: f32,
    axial_start: f32,
    axial_end: f32,
    // Energy that softening took in this frame [J].
    dissipation: f32,
    // Index of its material.
    material: u32,
    _pad0: u32,
    _pad1: u32,
}

@group(0) @binding(3) var<uniform> puncture: PunctureParams;
@group(1) @binding(5) var<storage, read> tip_anchors: array<TipAnchor>;
@group(3) @binding(3) var<storage, read_write> path_cells: array<PathCell>;
// Remaining stiffness per cell, 1 = intact.
@group(3) @binding(0) var<storage, read_write> cell_stiffness: array<f32>;

// Constants of src/effects/puncture.rs.
#const FIRST_ADVANCE
#const LARGEST_ADVANCE
#const LEAST_TRAVELS
#const MOST_TRAVELS
#const LEAST_STRETCH
#const MOST_STRETCH

// How far the tip may advance in a step in which the needle travels `travel` [m]; `first`: it is still at the surface.
fn advance_limit(first: bool, travel: f32) -> f32 {
    return min(max(select(LARGEST_ADVANCE, FIRST_ADVANCE, first), LEAST_TRAVELS * travel), MOST_TRAVELS * travel);
}

// Part of the tip force that is above the threshold.
fn share_beyond(force: f32, threshold: f32) -> f32 {
    return select(0.0, 1.0 - threshold / force, force > threshold);
}

#ifdef BORE
const ANCHOR_COUNT: u32 = 24u;
#else
#ifdef SLIT
const ANCHOR_COUNT: u32 = 18u;
#else
#ifdef OPENING
const ANCHOR_COUNT: u32 = 61u;
#else
const ANCHOR_COUNT: u32 = 19u;
#endif
#endif
#endif

// Factor of the tip forces at the speed of the needle [m/s].
fn rate_factor(speed: f32) -> f32 {
    let ratio = max(speed, puncture.reference_speed) / puncture.reference_speed;
    // Without a rate the law is exactly that without this factor.
    return select(pow(ratio, puncture.rate_exponent), 1.0, puncture.rate_exponent == 0.0);
}

// Threshold of the tip force at `way` [m] behind the entry of a material with the forces y and z, see `segments` [N].
fn material_threshold(forces: vec4<f32>, way: f32) -> f32 {
    let entry = max(0.0, 1.0 - way / forces.w);
    return forces.z + (forces.y - forces.z) * entry;
}

// Number of the stretch of the path at coordinate a.
fn segment_at(a: f32) -> u32 {
    var segment = 0u;
    for (var i = 1u; i < 16u; i++) {
        segment = select(segment, i, puncture.segments[i].x <= a);
    }
    return segment;
}

// Threshold of the tip force at material coordinate a of a needle that moves at `speed` [N].
fn tip_threshold(a: f32, speed: f32) -> f32 {
    let segment = puncture.segments[segment_at(a)];
    let left = clamp((puncture.exit - a) / puncture.transition_length, 0.0, 1.0);
    return material_threshold(segment, a - segment.x) * left * rate_factor(speed);
}

// 1 where the material at coordinate a is a membrane, else 0.
fn membrane_share(a: f32) -> f32 {
    return f32(extractBits(puncture.membranes, segment_at(a), 1u));
}

// Weight of a node of the ring around the opened path.
fn ring_weight(rest_radius: f32) -> f32 {
    let a0 = puncture.softened_radius;
    let outer = puncture.ring_radius;
    return smoothstep(a0, 2.0 * a0, rest_radius) * (1.0 - smoothstep(0.75 * outer, outer, rest_radius));
}

// How deep a point lies inside the needle [m] and the gradient of that depth (src/needle/gap.rs).
struct Overlap {
    value: f32,
    gradient: vec3<f32>,
}

// Overlap with the opened path of a point whose material lay `rest_radius` from the line of the tip. `s`: distance behind
// the tip along `d`; `less`: value and slope of what is taken off the radius.
fn opened_path(lever: vec3<f32>, d: vec3<f32>, s: f32, rest_radius: f32, less: vec2<f32>) -> Overlap {
    let on_tip = s < puncture.tip_length;
    let full_slope = puncture.needle_radius / puncture.tip_length;
    let rc = select(puncture.needle_radius, full_slope * s, on_tip);
    let slope = select(0.0, full_slope, on_tip);
    var shift = puncture.shift.xyz;
#ifdef FREE_PATH
    shift = swing(puncture.reference.xyz, -d, shift);
#endif
    let radial = lever - d * s - shift * rc;
    let r = length(radial);
    let e = radial * select(0.0, 1.0 / r, r > 1e-9);
    let open = sqrt(rest_radius * rest_radius + rc * rc);
    let m = rc * slope / open - less.y + slope * dot(e, shift);
    return Overlap(open - less.x - r, d * m - e);
}

#ifdef SLIT
// Overlap of one face of a slit with the section, pushed to its own side; b = R/5.
fn slit_face(lever: vec3<f32>, d: vec3<f32>, s: f32, side: vec3<f32>, less: vec2<f32>) -> Overlap {
    let on_tip = s < puncture.tip_length;
    let full_slope = puncture.needle_radius / puncture.tip_length;
    let rc = select(puncture.needle_radius, full_slope * s, on_tip);
    let slope = select(0.0, full_slope, on_tip);
    let shift = puncture.shift.xyz;
    let rho = lever - d * s - shift * rc;
    let p = dot(rho, side);
    let q = rho - side * p;
    let square = rc * rc - dot(q, q);
    let inside = square > 0.0;
    let w = sqrt(select(1.0, square, inside));
    let wide = sqrt(max(square, 0.0) + 0.04 * puncture.needle_radius * puncture.needle_radius);
    // W, and p dW/dw^2.
    let reach = select(w, square / wide, p < 0.0);
    let rate = select(0.5 * min(p / w, 1.0), p * (1.0 - 0.5 * square / (wide * wide)) / wide, p < 0.0);
    let value = (square - p * reach) / rc;
    let lateral = (side * -reach - q * (2.0 * (1.0 - rate))) / rc;
    let along = (2.0 * (1.0 - rate) - value / rc - dot(lateral, shift)) * slope - less.y;
    return Overlap(select(-1.0, value - less.x, inside), select(-side, lateral + d * along, inside));
}
#endif
#ifdef BORE
#const CORE_TEARS

// Whether the tip of a hollow needle has gone back from where it has cut to, `gap` beyond it [m], so far that the core tears off there.
fn core_tears(coordinate: f32, gap: f32) -> bool {
    return coordinate > 0.0 && gap < -CORE_TEARS * puncture.bore_radius;
}

// Overlap of the tissue around a hollow needle with its outer wall (`outside` 1) or of the core with its bore (-1).
fn tube_wall(lever: vec3<f32>, d: vec3<f32>, s: f32, outside: f32, less: vec2<f32>) -> Overlap {
    let rho = lever - d * s;
    let r = length(rho);
    let e = rho * select(0.0, 1.0 / r, r > 1e-9);
    let growth = select(puncture.bore_radius, puncture.needle_radius, outside > 0.0) - puncture.edge_radius;
    let t = clamp(s / puncture.tip_length, 0.0, 1.0);
    let wall = puncture.edge_radius + growth * t * t * (3.0 - 2.0 * t);
    let slope = growth * 6.0 * t * (1.0 - t) / puncture.tip_length;
    return Overlap(outside * (wall - r) - less.x, (d * slope - e) * outside - d * less.y);
}
#endif
