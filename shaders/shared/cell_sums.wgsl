// Sums of one measuring thread over its cells.
struct CellSums {
    // Elastic and hourglass energy [J].
    elastic: f32,
    hourglass: f32,
    min_jacobian: f32,
    min_corner_jacobian: f32,
    // Cells with J <= 0 at the centre or a corner, and the last of them.
    inverted_cells: u32,
    inverted_cell: u32,
    // Cells whose corners are farther apart than the integer sums of the element stage hold.
    overstretched_cells: u32,
    // Cells that carry nothing any more.
    deleted_cells: u32,
    // Dissipated by flow and degradation in this frame, by Prony terms since they were at rest [J].
    flow: f32,
    degradation: f32,
    relaxation: f32,
    // Smallest part of the stiffness that a material left; failures of the flow in this frame.
    least_intact: f32,
    failures: f32,
    // Of the inverted cells those with J > 0 at the centre, where the law is evaluated.
    folded_cells: u32,
    _pad0: u32,
    _pad1: u32,
}

@group(2) @binding(5) var<storage, read_write> cell_sums: array<CellSums>;
