//! Meshes: the structured, graded hexahedral block and unstructured tetrahedra.

pub mod block;
pub mod import;
pub mod material_place;
pub mod placement;
pub mod tet_line;
pub mod tet_path;
pub mod tets;
pub mod tissue_point;

use std::sync::Arc;

use glam::DVec3;

pub use block::{BlockMesh, Bore, CORNERS, Tissue, trilinear};
pub use placement::Placement;
pub use tet_line::TetLine;
pub use tet_path::TetPath;
pub use tets::TetMesh;
pub use tissue_point::TissuePoint;

/// The mesh of a model.
#[derive(Debug, Clone, PartialEq)]
pub enum Mesh {
    Block(BlockMesh),
    Tets(Arc<TetMesh>),
}

/// Nodes of one cell: eight of a hexahedron in VTK order, four of a tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CellNodes {
    nodes: [usize; 8],
    count: usize,
}

impl std::ops::Deref for CellNodes {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.nodes[..self.count]
    }
}

impl From<BlockMesh> for Mesh {
    fn from(mesh: BlockMesh) -> Self {
        Mesh::Block(mesh)
    }
}

impl From<Arc<TetMesh>> for Mesh {
    fn from(mesh: Arc<TetMesh>) -> Self {
        Mesh::Tets(mesh)
    }
}

impl Mesh {
    pub fn node_count(&self) -> usize {
        match self {
            Mesh::Block(mesh) => mesh.node_count(),
            Mesh::Tets(mesh) => mesh.positions.len(),
        }
    }

    pub fn cell_count(&self) -> usize {
        match self {
            Mesh::Block(mesh) => mesh.cell_count(),
            Mesh::Tets(mesh) => mesh.tets.len(),
        }
    }

    /// Rest position X of a node [m].
    pub fn rest_position(&self, node: usize) -> DVec3 {
        match self {
            Mesh::Block(mesh) => mesh.rest_position(node),
            Mesh::Tets(mesh) => mesh.positions[node],
        }
    }

    pub fn cell_nodes(&self, cell: usize) -> CellNodes {
        match self {
            Mesh::Block(mesh) => CellNodes { nodes: mesh.cell_nodes(cell), count: 8 },
            Mesh::Tets(mesh) => {
                let [a, b, c, d] = mesh.tets[cell].map(|n| n as usize);
                CellNodes { nodes: [a, b, c, d, 0, 0, 0, 0], count: 4 }
            }
        }
    }

    /// Rest volume of a cell [m^3].
    pub fn cell_volume(&self, cell: usize) -> f64 {
        match self {
            Mesh::Block(mesh) => {
                let size = mesh.cell_size(cell);
                if mesh.bore.is_none() {
                    return size.x * size.y * size.z;
                }
                // Prisms: the area of a quadrilateral is half the cross product of its diagonals.
                let [a, b, c, d, ..] = mesh.cell_nodes(cell).map(|n| mesh.rest_position(n).truncate());
                0.5 * (c - a).perp_dot(d - b) * size.z
            }
            Mesh::Tets(mesh) => mesh.volume(cell),
        }
    }

    /// True for a flat cell between two copies of a grid line, which is no tissue.
    pub fn is_gap(&self, cell: usize) -> bool {
        self.as_block().is_some_and(|block| block.is_gap(cell))
    }

    /// True where the cell holds tissue that deforms.
    pub fn is_tissue(&self, cell: usize) -> bool {
        self.as_block().is_none_or(|block| block.is_tissue(cell))
    }

    /// True where nothing is in the cell, or what does not deform.
    pub fn is_empty(&self, cell: usize) -> bool {
        self.as_block().is_some_and(|block| block.is_empty(cell))
    }

    /// Centre of a cell at rest [m].
    pub fn cell_centre(&self, cell: usize) -> DVec3 {
        let nodes = self.cell_nodes(cell);
        nodes.iter().map(|n| self.rest_position(*n)).sum::<DVec3>() / nodes.len() as f64
    }

    /// Smallest edge of a hexahedron or altitude of a tetrahedron [m].
    pub fn smallest_edge(&self) -> f64 {
        match self {
            Mesh::Block(mesh) => {
                let steps = mesh.lines.iter().flat_map(|l| l.windows(2).map(|w| w[1] - w[0]));
                steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
            }
            Mesh::Tets(mesh) => (0..mesh.tets.len()).map(|t| mesh.smallest_altitude(t)).fold(f64::INFINITY, f64::min),
        }
    }

    /// Lowest and highest corner of the bounding box at rest [m].
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match self {
            Mesh::Block(mesh) => {
                let end = |last: bool| {
                    DVec3::from(std::array::from_fn(|a| {
                        let lines = &mesh.lines[a];
                        lines[if last { lines.len() - 1 } else { 0 }]
                    }))
                };
                (end(false), end(true))
            }
            Mesh::Tets(mesh) => mesh.bounds(),
        }
    }

    /// The structured block, if it is one.
    pub fn as_block(&self) -> Option<&BlockMesh> {
        match self {
            Mesh::Block(mesh) => Some(mesh),
            Mesh::Tets(_) => None,
        }
    }

    /// The structured block, where the caller knows that it is one.
    pub fn block(&self) -> &BlockMesh {
        self.as_block().expect("this part of the program serves the structured block only")
    }

    /// The tetrahedra, if they are.
    pub fn as_tets(&self) -> Option<&Arc<TetMesh>> {
        match self {
            Mesh::Block(_) => None,
            Mesh::Tets(mesh) => Some(mesh),
        }
    }
}
