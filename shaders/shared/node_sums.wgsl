// Sums of one measuring thread over its nodes.
struct NodeSums {
    // Kinetic energy, energy taken by mass damping in this frame, work of supports and loads [J].
    kinetic: f32,
    damping: f32,
    work: f32,
    // Sum of mass times displacement half a step ago, where the velocity is known [kg m], for the work of a uniform field.
    moment_x: f32,
    moment_y: f32,
    moment_z: f32,
    max_speed: f32,
    // Steps times nodes with raised mass; nodes with a number out of range; steps times nodes whose speed was clamped.
    raised_mass: u32,
    out_of_range: u32,
    clamped_nodes: u32,
    // Taken by raised masses and by the speed limit in this frame [J]; largest step ratio, see node_cures.
    raised_energy: f32,
    clamped_energy: f32,
    step_ratio: f32,
    // What the stored energy of the last forces, half a step before the velocities, loses until then [J].
    half_step: f32,
    _pad0: u32,
    _pad1: u32,
}

@group(2) @binding(6) var<storage, read_write> node_sums: array<NodeSums>;
