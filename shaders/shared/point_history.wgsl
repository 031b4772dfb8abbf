// What history effects report per cell, summed over the steps of a frame.
struct PointHistory {
    // Dissipated by flow and by degradation, and sum E:dq, per rest volume [J/m^3].
    flow: f32,
    degradation: f32,
    relaxation_work: f32,
    // Steps in which the flow did not come back to its surface.
    failures: f32,
}

@group(3) @binding(8) var<storage, read_write> point_history: array<PointHistory>;
