// What keeps a node stable takes energy: sums over the steps of a frame, written in the few steps in which something is taken. One vector,
// since a software adapter pays for every access, hardly for its width:
// taken by the raised mass and by the speed limit [J]; steps in which the speed was clamped; largest k dt^2 / (4 m) beyond
// WATCHED_STEP_RATIO, with the bound k of the stiffness and the mass m of the step.

// Steps are unstable beyond 1; raised masses have 0.81.
#const WATCHED_STEP_RATIO

@group(2) @binding(3) var<storage, read_write> node_cures: array<vec4<f32>>;
