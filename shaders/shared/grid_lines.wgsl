// Grid lines [m]: x, then y, then z.
@group(1) @binding(3) var<storage, read> grid_lines: array<f32>;

// Cell of a grid coordinate: lines `offset .. offset + count`.
fn find_cell(x: f32, offset: u32, count: u32) -> u32 {
    var low = 0u;
    var high = count - 1u;
    while (high - low > 1u) {
        let middle = (low + high) / 2u;
        if (grid_lines[offset + middle] <= x) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}
