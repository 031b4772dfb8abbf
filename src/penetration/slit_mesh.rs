//! Mesh of the quarter plane around a slit, in elliptic coordinates: `X = cosh(xi) cos(eta)`, `Y = sinh(xi) sin(eta)`, lengths in units of
//! the half length `a` of the slit. `xi = 0` is the face, (0, 0) the tip, `eta = 0` the symmetry line ahead of it, `eta = pi/2` the middle
//! line. The square root of a crack tip is smooth in (xi, eta), and equal steps in xi are equal ratios of distance in the far field.
//!
//! Quadratic displacement with nine nodes, linear discontinuous pressure (Q2/P1), both in (xi, eta).

use std::f64::consts::FRAC_PI_2;

use super::mixed_cell::{self, CELL_NODES, FIXED, GAUSS_3, add_mass, quadratic, quadratic_nodes, simpson};

/// One cell, xi outermost.
pub type Cell = mixed_cell::Cell<2>;
/// One integration point.
pub type GaussPoint = mixed_cell::GaussPoint<2>;

/// How fine the mesh is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshSize {
    /// Cells from the face to the far boundary.
    pub radial: usize,
    /// Cells from the tip to the middle of the slit.
    pub along: usize,
    /// Radius of the far boundary over a.
    pub far_radius: f64,
    /// Size of the last over the first step in xi.
    pub radial_grading: f64,
    /// Size of the step in eta at the tip over the one in the middle of the slit.
    pub along_grading: f64,
}

/// A node of the far boundary.
#[derive(Clone, Copy, Debug)]
pub struct FarNode {
    /// Node index.
    pub node: usize,
    /// Outward unit normal.
    pub normal: [f64; 2],
    /// Angle that the node stands for [rad].
    pub angle: f64,
}

/// The mesh of the quarter plane.
#[derive(Clone, Debug)]
pub struct SlitMesh {
    /// Elliptic coordinates (xi, eta) of the nodes.
    pub elliptic: Vec<[f64; 2]>,
    /// Rest positions of the nodes [a].
    pub rest: Vec<[f64; 2]>,
    /// Equation of both displacement components of every node, or `FIXED`.
    pub equations: Vec<[usize; 2]>,
    /// Number of equations.
    pub equation_count: usize,
    /// Cells.
    pub cells: Vec<Cell>,
    /// Nodes on the face of the slit, from the tip to the middle.
    pub face: Vec<usize>,
    /// Nodes of the far boundary.
    pub far: Vec<FarNode>,
}

impl SlitMesh {
    /// Builds the mesh.
    pub fn new(size: &MeshSize) -> Self {
        let size = MeshSize { radial: size.radial.max(1), along: size.along.max(1), ..*size };
        let xi_far = (2.0 * size.far_radius).ln();
        let xi = quadratic_nodes(&graded(size.radial, xi_far, size.radial_grading));
        let eta = quadratic_nodes(&graded(size.along, FRAC_PI_2, 1.0 / size.along_grading));
        let (rows, columns) = (eta.len(), xi.len());
        // number across the shorter side first: least profile
        let strides = if size.along <= size.radial { [rows, 1] } else { [1, columns] };
        let count = rows * columns;
        let mut mesh = Self {
            elliptic: vec![[0.0; 2]; count],
            rest: vec![[0.0; 2]; count],
            equations: vec![[FIXED; 2]; count],
            equation_count: 0,
            cells: vec![],
            face: (0..rows).map(|j| j * strides[1]).collect(),
            far: vec![],
        };
        for (i, &x) in xi.iter().enumerate() {
            for (j, &e) in eta.iter().enumerate() {
                let node = i * strides[0] + j * strides[1];
                mesh.elliptic[node] = [x, e];
                mesh.rest[node] = [x.cosh() * e.cos(), x.sinh() * e.sin()];
                if i + 1 == columns {
                    mesh.far.push(far_node(node, e, j, &eta));
                }
            }
        }
        for node in 0..count {
            let e = mesh.elliptic[node][1];
            for (d, fixed) in [e >= eta[rows - 1], e <= 0.0].into_iter().enumerate() {
                if !fixed {
                    mesh.equations[node][d] = mesh.equation_count;
                    mesh.equation_count += 1;
                }
            }
        }
        for i in 0..size.radial {
            for j in 0..size.along {
                let corner = 2 * i * strides[0] + 2 * j * strides[1];
                mesh.cells.push(cell(
                    corner,
                    strides,
                    [xi[2 * i], xi[2 * i + 2]],
                    [eta[2 * j], eta[2 * j + 2]],
                    &mesh.equations,
                ));
            }
        }
        mesh
    }

    /// First coupled equation of every equation, for profile storage.
    pub fn profile(&self) -> Vec<usize> {
        mixed_cell::profile(&self.cells, self.equation_count)
    }
}

/// `n + 1` points from 0 to `end`, steps in geometric progression, last over first = `ratio`.
fn graded(n: usize, end: f64, ratio: f64) -> Vec<f64> {
    let q = if n > 1 { ratio.powf(1.0 / (n as f64 - 1.0)) } else { 1.0 };
    let steps: Vec<f64> = (0..n).map(|k| q.powi(k as i32)).collect();
    let total: f64 = steps.iter().sum();
    let mut points = vec![0.0];
    let mut sum = 0.0;
    for s in steps {
        sum += s;
        points.push(end * sum / total);
    }
    points
}

/// Far node with its share of the angle by Simpson's rule. The far ellipse is a circle to 1/(4 far_radius^2).
fn far_node(node: usize, eta: f64, j: usize, etas: &[f64]) -> FarNode {
    FarNode { node, normal: [eta.cos(), eta.sin()], angle: simpson(etas, j) }
}

fn cell(corner: usize, strides: [usize; 2], xi: [f64; 2], eta: [f64; 2], equations: &[[usize; 2]]) -> Cell {
    let nodes = std::array::from_fn(|m| corner + (m / 3) * strides[0] + (m % 3) * strides[1]);
    let half = [0.5 * (xi[1] - xi[0]), 0.5 * (eta[1] - eta[0])];
    let mut points = Vec::with_capacity(9);
    let mut mass = [[0.0; 3]; 3];
    for (s, ws) in GAUSS_3 {
        for (t, wt) in GAUSS_3 {
            let (x, e) = (0.5 * (xi[0] + xi[1]) + half[0] * s, 0.5 * (eta[0] + eta[1]) + half[1] * t);
            // conformal map: the Jacobian is [[c, -d], [d, c]], its determinant c^2 + d^2
            let (c, d) = (x.sinh() * e.cos(), x.cosh() * e.sin());
            let det = c * c + d * d;
            let ((ns, gs), (nt, gt)) = (quadratic(s), quadratic(t));
            let mut gradient = [[0.0; 2]; CELL_NODES];
            for (m, g) in gradient.iter_mut().enumerate() {
                let by_xi = gs[m / 3] * nt[m % 3] / half[0];
                let by_eta = ns[m / 3] * gt[m % 3] / half[1];
                *g = [(c * by_xi - d * by_eta) / det, (d * by_xi + c * by_eta) / det];
            }
            let weight = ws * wt * half[0] * half[1] * det;
            let mode = [1.0, s, t];
            add_mass(&mut mass, weight, &mode);
            points.push(GaussPoint { gradient, weight, mode });
        }
    }
    Cell::new(nodes, equations, points, &mass)
}
