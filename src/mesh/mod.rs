//! Meshes: the structured, graded hexahedral block and unstructured tetrahedra.

pub mod block;
pub mod import;
pub mod tets;

use glam::DVec3;

/// A rectilinear block of hexahedral cells: three lists of grid lines.
///
/// Node `(i, j, k)` has the index `(k * (ny + 1) + j) * (nx + 1) + i`, cell `(i, j, k)` the index
/// `(k * ny + j) * nx + i`; k grows upwards, the top face (z = 0) is the last plane.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMesh {
    /// Grid lines per axis [m], ascending.
    pub lines: [Vec<f64>; 3],
}

impl BlockMesh {
    /// Cells per axis.
    pub fn cells(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lines[a].len() - 1)
    }

    /// Nodes per axis.
    pub fn nodes(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lines[a].len())
    }

    pub fn cell_count(&self) -> usize {
        self.cells().iter().product()
    }

    pub fn node_count(&self) -> usize {
        self.nodes().iter().product()
    }

    pub fn node_index(&self, i: usize, j: usize, k: usize) -> usize {
        let [nx, ny, _] = self.nodes();
        (k * ny + j) * nx + i
    }

    pub fn cell_index(&self, i: usize, j: usize, k: usize) -> usize {
        let [nx, ny, _] = self.cells();
        (k * ny + j) * nx + i
    }

    /// Grid coordinates of a node.
    pub fn node_coordinates(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes();
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Grid coordinates of a cell.
    pub fn cell_coordinates(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells();
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Rest position X of a node [m].
    pub fn rest_position(&self, node: usize) -> DVec3 {
        let [i, j, k] = self.node_coordinates(node);
        DVec3::new(self.lines[0][i], self.lines[1][j], self.lines[2][k])
    }

    /// Edge lengths of a cell [m].
    pub fn cell_size(&self, cell: usize) -> DVec3 {
        let c = self.cell_coordinates(cell);
        let d = |a: usize| self.lines[a][c[a] + 1] - self.lines[a][c[a]];
        DVec3::new(d(0), d(1), d(2))
    }

    /// The eight nodes of a cell in VTK order (bottom ring, then top ring, both counter-clockwise).
    pub fn cell_nodes(&self, cell: usize) -> [usize; 8] {
        let [i, j, k] = self.cell_coordinates(cell);
        [
            self.node_index(i, j, k),
            self.node_index(i + 1, j, k),
            self.node_index(i + 1, j + 1, k),
            self.node_index(i, j + 1, k),
            self.node_index(i, j, k + 1),
            self.node_index(i + 1, j, k + 1),
            self.node_index(i + 1, j + 1, k + 1),
            self.node_index(i, j + 1, k + 1),
        ]
    }

    /// Tributary volume of a node, an eighth of every cell around it [m^3].
    pub fn node_volume(&self, node: usize) -> f64 {
        let c = self.node_coordinates(node);
        (0..3)
            .map(|a| {
                let l = &self.lines[a];
                let below = if c[a] > 0 { l[c[a]] - l[c[a] - 1] } else { 0.0 };
                let above = if c[a] + 1 < l.len() { l[c[a] + 1] - l[c[a]] } else { 0.0 };
                0.5 * (below + above)
            })
            .product()
    }
}
