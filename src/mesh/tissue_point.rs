//! A material point of the tissue, which moves with it.

use glam::DVec3;

use super::{BlockMesh, Mesh};

/// The nodes around a material point and their weights: trilinear in a hexahedron, linear in a tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TissuePoint {
    /// Node indices. In a block bit 0 of the place is the upper corner in x, bit 1 in y, bit 2 in z; a tetrahedron has four, the first
    /// of which fills the rest.
    pub nodes: [u32; 8],
    /// From 0 to 1, their sum is 1; those of the rest are 0.
    pub weights: [f64; 8],
}

impl TissuePoint {
    /// The point with the rest position `x` [m] inside the mesh; outside of tetrahedra the node nearest to it.
    pub fn in_mesh(mesh: &Mesh, x: DVec3) -> Self {
        let tets = match mesh {
            Mesh::Block(block) => return Self::new(block, x),
            Mesh::Tets(tets) => tets,
        };
        match tets.locate(x) {
            Some((tet, weights)) => Self::in_tetrahedron(tets.tets[tet], weights),
            None => {
                let distance = |node: &u32| tets.positions[*node as usize].distance_squared(x);
                let nodes = 0..tets.positions.len() as u32;
                let nearest = nodes.min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
                Self::in_tetrahedron([nearest; 4], [1.0, 0.0, 0.0, 0.0])
            }
        }
    }

    /// The point with these barycentric coordinates in a tetrahedron.
    pub fn in_tetrahedron([a, b, c, d]: [u32; 4], weights: [f64; 4]) -> Self {
        let [wa, wb, wc, wd] = weights;
        TissuePoint { nodes: [a, b, c, d, a, a, a, a], weights: [wa, wb, wc, wd, 0.0, 0.0, 0.0, 0.0] }
    }

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
