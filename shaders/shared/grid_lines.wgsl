// Grid lines [m]: x, then y, then z.
@group(1) @binding(3) var<storage, read> grid_lines: array<f32>;
