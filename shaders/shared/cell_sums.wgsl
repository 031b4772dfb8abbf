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
    _pad: u32,
}

@group(2) @binding(5) var<storage, read_write> cell_sums: array<CellSums>;
