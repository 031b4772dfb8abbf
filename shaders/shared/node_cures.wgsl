// What keeps a node stable takes energy: sums over the steps of a frame, written in the few steps in which something is taken. One vector,
// since a software adapter pays for every access, hardly for its width:
// taken by the raised mass and by the speed limit [J]; steps with a raised mass and, times 2^16, those in which the speed was clamped; largest
// k dt^2 / (4 m) beyond WATCHED_STEP_RATIO, with the bound k of the stiffness and the mass m of the step. All but the third as the bits of f32.

// Steps are unstable beyond 1; raised masses have 0.81.
#const WATCHED_STEP_RATIO

@group(2) @binding(3) var<storage, read_write> node_cures: array<vec4<u32>>;
