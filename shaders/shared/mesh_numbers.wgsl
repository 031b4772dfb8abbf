// Numbers of the mesh and of what holds it: constants of the pipeline, so that a kernel computes its indices with them.
// Software adapters load a number of a uniform lane by lane; as loads they took a tenth of the step.

// Cells and nodes per axis, and in all.
override CELLS_X: u32 = 1u;
override CELLS_Y: u32 = 1u;
override CELLS_Z: u32 = 1u;
override NODES_X: u32 = 2u;
override NODES_Y: u32 = 2u;
override NODES_Z: u32 = 2u;
override CELL_COUNT: u32 = 1u;
override NODE_COUNT: u32 = 8u;
// Vertical columns of cells, and what the corner-force layout needs: cell layers per strip, number of strips, columns with a
// rim of empty ones.
override COLUMN_COUNT: u32 = 1u;
override STRIP_LAYERS: u32 = 1u;
override STRIP_COUNT: u32 = 1u;
override PADDED_COLUMNS: u32 = 9u;
// Strips that hold tissue, and nodes in groups of 64 among which one moves.
override BUSY_STRIP_COUNT: u32 = 1u;
override BUSY_NODE_COUNT: u32 = 64u;
// Threads of the measuring stages.
override MEASURE_THREADS: u32 = 64u;
// Fixed displacement components per face, bits 0..2 = x, y, z.
override FIXED_X_MIN: u32 = 0u;
override FIXED_X_MAX: u32 = 0u;
override FIXED_Y_MIN: u32 = 0u;
override FIXED_Y_MAX: u32 = 0u;
override FIXED_Z_MIN: u32 = 0u;
override FIXED_Z_MAX: u32 = 0u;
