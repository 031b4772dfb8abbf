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

// The same for one that hardly moves: `guess` is where it was or nearly was. A search is a chain of accesses, each waiting for the last.
fn find_cell_near(x: f32, offset: u32, count: u32, guess: u32) -> u32 {
    let at = min(guess, count - 2u);
    let low = at == 0u || grid_lines[offset + at] <= x;
    let high = at == count - 2u || x < grid_lines[offset + at + 1u];
    // A loop that runs once or not at all: software adapters skip it, where they would walk through an `if`.
    var cell = at;
    for (var once = select(0u, 1u, low && high); once == 0u; once++) {
        cell = find_cell(x, offset, count);
    }
    return cell;
}
