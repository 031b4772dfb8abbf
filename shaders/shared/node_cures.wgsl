// What keeps a node stable takes energy: sums over the steps of a frame, written in the few steps in which something is taken.
struct NodeCures {
    // Taken by the raised mass and by the speed limit [J].
    raised_energy: f32,
    clamped_energy: f32,
    // Steps in which the speed was clamped.
    clamped_steps: f32,
    // Largest k dt^2 / (4 m) beyond WATCHED_STEP_RATIO, with the bound k of the stiffness and the mass m of the step.
    step_ratio: f32,
}

// Steps are unstable beyond 1; raised masses have 0.81.
#const WATCHED_STEP_RATIO

@group(2) @binding(3) var<storage, read_write> node_cures: array<NodeCures>;
