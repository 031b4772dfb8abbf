// Energies and Jacobians of one cell. Equations: src/engine/elements.rs, Elements::measure.
struct CellEnergy {
    // Stored energy and hourglass energy [J], the part of the first that Prony terms hold.
    elastic: f32,
    hourglass: f32,
    held: f32,
    // Part of the stiffness that is left.
    intact: f32,
    // J at the centre and the smallest J at a corner (of a tetrahedron the same).
    jacobian: f32,
    corner_jacobian: f32,
}

// What `measure_cells` reads off one cell.
struct MeasuredCell {
    energy: CellEnergy,
    // V [m^3].
    volume: f32,
    // Part of the stiffness that the cell keeps for other reasons than its material's.
    kept: f32,
    // Largest difference of a displacement component between its corners [m].
    apart: f32,
}

// Largest component of a difference.
fn largest_component(v: vec3<f32>) -> f32 {
    let a = abs(v);
    return max(a.x, max(a.y, a.z));
}
