// What a window draws of a cell comes from these.
struct DrawnCell {
    // Displacement gradient F - I at its centre.
    H: mat3x3<f32>,
    // Volumetric stress dU/dJ [Pa]; edge V^(1/3) [m]; part of the stiffness that it keeps for other reasons than
    // its material's.
    pressure: f32,
    length: f32,
    kept: f32,
    // Index of the material; 0 where the cell is a gap between two copies of a line.
    material: u32,
    tissue: bool,
}
