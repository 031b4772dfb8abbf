// Forces of cells on their corners, summed over the strip of cells that one thread walks through.
//
// A strip is `strip_layers` cells of one vertical column; its corners lie on `strip_layers + 1` node planes, four on
// each: (i,j), (i+1,j), (i,j+1), (i+1,j+1). Layout: [strip][plane][corner][padded column], columns with a rim of
// empty ones so that a node at the border reads zeros instead of branching.
// x, y, z: force on the node [N]; w: bound of the stiffness there [N/m].
@group(2) @binding(2) var<storage, read_write> corner_force: array<vec4<f32>>;

fn padded_column(i: u32, j: u32) -> u32 {
    return (j + 1u) * (CELLS_X + 2u) + i + 1u;
}

fn corner_slot(strip: u32, plane: u32, corner: u32, column: u32) -> u32 {
    return ((strip * (STRIP_LAYERS + 1u) + plane) * 4u + corner) * PADDED_COLUMNS + column;
}
