// Numbers of the mesh, the tissue law and the time integration.
struct Params {
    // Cells and nodes per axis.
    cells_x: u32,
    cells_y: u32,
    cells_z: u32,
    nodes_x: u32,
    nodes_y: u32,
    nodes_z: u32,
    // Vertical columns of cells, and what the corner-force layout needs: cell layers per strip, number of
    // strips, columns with a rim of empty ones.
    column_count: u32,
    strip_layers: u32,
    strip_count: u32,
    padded_columns: u32,
    // Threads of the measuring stages.
    measure_threads: u32,
    // Fixed displacement components per face, bits 0..2 = x, y, z; faces in the order x-, x+, y-, y+, z-, z+.
    fixed_x_min: u32,
    fixed_x_max: u32,
    fixed_y_min: u32,
    fixed_y_max: u32,
    fixed_z_min: u32,
    fixed_z_max: u32,
    // Quartic hourglass factor c.
    quartic: f32,
    // Time step [s].
    dt: f32,
    // Mass-proportional damping alpha [1/s].
    mass_damping: f32,
    // Largest nodal speed that is let through [m/s].
    speed_limit: f32,
    // Cells and nodes of the whole mesh.
    cell_count: u32,
    node_count: u32,
    _pad0: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
