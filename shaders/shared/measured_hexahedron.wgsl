// A hexahedron at the end of a frame.
#import shared/hexahedron_energy
#ifdef PUNCTURE
#import effects/puncture
#endif

fn measured_cell(index: u32) -> MeasuredCell {
    let layer = CELLS_X * CELLS_Y;
    let k = quotient(index, layer);
    let j = quotient(index - k * layer, CELLS_X);
    let cell = vec3<u32>(index - k * layer - j * CELLS_X, j, k);
    var out: MeasuredCell;
    var u: array<vec3<f32>, 8>;
    // Relative to the first corner in integers: differences stay exact.
    let origin = node_displacement[corner_node(cell, 0u)].xyz;
    for (var corner = 0u; corner < 8u; corner++) {
        u[corner] = vec3<f32>(node_displacement[corner_node(cell, corner)].xyz - origin) * DISPLACEMENT_UNIT;
        out.apart = max(out.apart, largest_component(u[corner]));
    }
    out.kept = 1.0;
#ifdef PUNCTURE
    out.kept = cell_stiffness[index];
#endif
    out.energy = cell_energy(cell, material_of(index), out.kept, &u);
    out.volume = column_area(column_at(cell.x, cell.y)) * layer_edge(cell.z).length;
#ifdef EMPTY_CELLS
    // No tissue, like a gap.
    out.volume = select(0.0, out.volume, materials[material_of(index)].bulk_modulus > 0.0);
#endif
    return out;
}
