// A path that is found while the tip moves: state and pure functions. Equations: src/needle/free_path.rs.
#import shared/swing

// Where the tip is in the material.
struct FreeTip {
    // Material point X of the tip [m]; direction T of its advance; axis of the anchors' angles, normal to T; w unused.
    place: vec4<f32>,
    along: vec4<f32>,
    across: vec4<f32>,
    // Force across the needle on every anchor [N], w unused.
    sway: vec4<f32>,
    // Way since the surface a [m], its value where the tip entered the present material.
    coordinate: f32,
    entry: f32,
    // Way through the material in this step that marks cells [m].
    advance: f32,
    // 1 in the tissue.
    inside: f32,
    // Index of the material at the tip.
    material: u32,
    // Dissipated by the tip law in this frame [J]; stored in the tip springs now [J].
    dissipation: f32,
    spring_energy: f32,
    // Dissipated in this frame beyond the threshold, while the cap on the advance holds the force above it [J].
    cap_dissipation: f32,
}

// A cell of the box that the tip may open.
struct FreeCell {
    // Lowest corner and edges at rest [m]; w: height of the skin over the corners x0 y0 and x1 y0 of the column [m].
    low: vec4<f32>,
    size: vec4<f32>,
    cell: u32,
    // Index of its material.
    material: u32,
    // Sample points that have been cut, bit = x + 4 y + 16 z: the first and the last 32.
    marked_low: u32,
    marked_high: u32,
    // Energy that softening took in this frame [J].
    dissipation: f32,
    // Index of the forces that the tip finds in it, AS_BEFORE: those that it had before.
    tissue: u32,
    // Height of the skin over the corners x0 y1 and x1 y1 [m].
    height_01: f32,
    height_11: f32,
}

@group(3) @binding(11) var<storage, read_write> free_tip: FreeTip;
@group(3) @binding(12) var<storage, read_write> free_cells: array<FreeCell>;

// Constants of src/needle/free_path.rs.
#const SAMPLES
#const SLACK
#const TURNING
#const MARKED_BEHIND
#const LOOK_AHEAD
#const PASSED_MARGIN
#const WATCHED
#const SLIP_CAP
#const SOFTENING_RATE
#const END_FADE
#const NO_SKIN
// Also there.
const AS_BEFORE = 255u;

// Place of an anchor in the tip's plane, along `across` and along T x `across` [m].
fn anchor_offset(anchor: u32) -> vec2<f32> {
    let inner = anchor < 7u;
    let count = select(12.0, 6.0, inner);
    let number = f32(anchor) - select(7.0, 1.0, inner);
    let angle = 6.2831853 * number / count;
    let radius = select(puncture.needle_radius, 0.5 * puncture.needle_radius, inner);
    return vec2<f32>(cos(angle), sin(angle)) * select(radius, 0.0, anchor == 0u);
}

// Columns of the inverse of F, transposed, times v; v itself where the material is turned inside out.
fn pulled_back(fx: vec3<f32>, fy: vec3<f32>, fz: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let cx = cross(fy, fz);
    let j = dot(fx, cx);
    let back = vec3<f32>(dot(cx, v), dot(cross(fz, fx), v), dot(cross(fx, fy), v));
    return select(v, back / select(1.0, j, j > 0.02), j > 0.02);
}

// The overlap of a node at `s` behind the tip, faded behind the front end of what it touches; `d` is the gradient of s.
fn faded_at_end(overlap: Overlap, d: vec3<f32>, s: f32, end: f32) -> Overlap {
    let length = END_FADE * puncture.tip_length;
    let part = min((s - end) / length, 1.0);
    let slope = select(0.0, 1.0 / length, part < 1.0);
    return Overlap(overlap.value * part, overlap.gradient * part + d * (overlap.value * slope));
}
