//! Mesh of the quarter plane around a slit, in elliptic coordinates: `X = cosh(xi) cos(eta)`, `Y = sinh(xi) sin(eta)`, lengths in units of
//! the half length `a` of the slit. `xi = 0` is the face, (0, 0) the tip, `eta = 0` the symmetry line ahead of it, `eta = pi/2` the middle
//! line. The square root of a crack tip is smooth in (xi, eta), and equal steps in xi are equal ratios of distance in the far field.
//!
//! Quadratic displacement with nine nodes, linear discontinuous pressure (Q2/P1), both in (xi, eta).

use std::f64::consts::FRAC_PI_2;

/// Nodes per cell.
pub const CELL_NODES: usize = 9;
/// Displacement components per cell.
pub const CELL_DOFS: usize = 18;
/// Marks a displacement component that symmetry keeps at zero.
pub const FIXED: usize = usize::MAX;

/// Three-point Gauss-Legendre rule on [-1, 1].
const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

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

/// One integration point.
#[derive(Clone, Debug)]
pub struct GaussPoint {
    /// Rest gradient of the nine shape functions [1/a].
    pub gradient: [[f64; 2]; CELL_NODES],
    /// Rest area [a^2].
    pub weight: f64,
    /// The three pressure modes.
    pub mode: [f64; 3],
}

/// One cell.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Node indices, xi outermost.
    pub nodes: [usize; CELL_NODES],
    /// Equation of every displacement component, or `FIXED`.
    pub equations: [usize; CELL_DOFS],
    /// Integration points.
    pub points: Vec<GaussPoint>,
    /// Inverse of the mass matrix of the pressure modes [1/a^2].
    pub inverse_mass: [[f64; 3]; 3],
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
        let mut first: Vec<usize> = (0..self.equation_count).collect();
        for cell in &self.cells {
            let free = cell.equations.iter().filter(|&&e| e != FIXED);
            let low = free.clone().min().copied().unwrap_or(0);
            for &e in free {
                first[e] = first[e].min(low);
            }
        }
        first
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

/// Inserts the mid points.
fn quadratic_nodes(corners: &[f64]) -> Vec<f64> {
    let mut nodes = vec![corners[0]];
    for pair in corners.windows(2) {
        nodes.push(0.5 * (pair[0] + pair[1]));
        nodes.push(pair[1]);
    }
    nodes
}

/// Far node with its share of the angle by Simpson's rule. The far ellipse is a circle to 1/(4 far_radius^2).
fn far_node(node: usize, eta: f64, j: usize, etas: &[f64]) -> FarNode {
    let angle = if j % 2 == 1 {
        4.0 * (etas[j + 1] - etas[j - 1]) / 6.0
    } else {
        let below = if j > 0 { etas[j] - etas[j - 2] } else { 0.0 };
        let above = if j + 2 < etas.len() { etas[j + 2] - etas[j] } else { 0.0 };
        (below + above) / 6.0
    };
    FarNode { node, normal: [eta.cos(), eta.sin()], angle }
}

/// Quadratic Lagrange polynomials at -1, 0, 1 and their slopes.
fn quadratic(s: f64) -> ([f64; 3], [f64; 3]) {
    ([0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)], [s - 0.5, -2.0 * s, s + 0.5])
}

fn cell(corner: usize, strides: [usize; 2], xi: [f64; 2], eta: [f64; 2], equations: &[[usize; 2]]) -> Cell {
    let mut nodes = [0; CELL_NODES];
    let mut cell_equations = [FIXED; CELL_DOFS];
    for m in 0..CELL_NODES {
        nodes[m] = corner + (m / 3) * strides[0] + (m % 3) * strides[1];
        cell_equations[2 * m] = equations[nodes[m]][0];
        cell_equations[2 * m + 1] = equations[nodes[m]][1];
    }
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
            for k in 0..3 {
                for l in 0..3 {
                    mass[k][l] += weight * mode[k] * mode[l];
                }
            }
            points.push(GaussPoint { gradient, weight, mode });
        }
    }
    Cell { nodes, equations: cell_equations, points, inverse_mass: inverse(&mass) }
}

/// Inverse of a regular 3x3 matrix.
fn inverse(m: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
    };
    let det: f64 = (0..3).map(|c| m[0][c] * minor(0, c)).sum();
    let mut inv = [[0.0; 3]; 3];
    for (r, row) in inv.iter_mut().enumerate() {
        for (c, v) in row.iter_mut().enumerate() {
            *v = minor(c, r) / det;
        }
    }
    inv
}
