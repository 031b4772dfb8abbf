//! A material point of the block, which moves with the tissue.

use glam::DVec3;

use super::BlockMesh;

/// The corners of the cell that holds a material point, and their trilinear weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TissuePoint {
    /// Node indices: bit 0 of the place is the upper corner in x, bit 1 in y, bit 2 in z.
    pub nodes: [u32; 8],
    /// From 0 to 1, their sum is 1.
    pub weights: [f64; 8],
}

impl TissuePoint {
    /// The point with the rest position `x` [m] inside the block.
    pub fn new(block: &BlockMesh, x: DVec3) -> Self {
        let (cell, local) = block.locate_exactly(x);
        let upper = |n: usize, a: usize| n >> a & 1;
        TissuePoint {
            nodes: std::array::from_fn(|n| {
                let [i, j, k] = std::array::from_fn(|a| cell[a] + upper(n, a));
                block.node_index(i, j, k) as u32
            }),
            weights: std::array::from_fn(|n| {
                (0..3).map(|a| if upper(n, a) == 1 { local[a] } else { 1.0 - local[a] }).product()
            }),
        }
    }

    /// Value of a field at the point, from those at the corners in the order of `nodes`.
    pub fn interpolated(&self, corners: [DVec3; 8]) -> DVec3 {
        corners.iter().zip(self.weights).map(|(u, w)| *u * w).sum()
    }

    /// Value of a field at the point, from its values per node.
    pub fn value(&self, field: &[DVec3]) -> DVec3 {
        self.interpolated(self.nodes.map(|n| field[n as usize]))
    }
}
