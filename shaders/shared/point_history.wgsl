// What history effects report per cell, summed over the steps of a frame.
struct PointHistory {
    // Dissipated by flow and by degradation, and sum E:dq, per rest volume [J/m^3].
    flow: f32,
    degradation: f32,
    relaxation_work: f32,
    // Steps in which the flow did not come back to its surface.
    failures: f32,
}

// One PointHistory per cell, its fields in this order: a vector costs one access, four numbers cost four.
@group(3) @binding(8) var<storage, read_write> point_history: array<vec4<f32>>;

fn read_history(cell: u32) -> PointHistory {
    let h = point_history[cell];
    return PointHistory(h.x, h.y, h.z, h.w);
}

fn write_history(cell: u32, h: PointHistory) {
    point_history[cell] = vec4<f32>(h.flow, h.degradation, h.relaxation_work, h.failures);
}
