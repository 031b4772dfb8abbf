//! What both plane and axisymmetric solutions are made of: quads of nine nodes with quadratic displacement and three discontinuous pressure
//! modes (Q2/P1), the pressure condensed out of every Newton step.

/// Nodes per cell.
pub const CELL_NODES: usize = 9;
/// Displacement components per cell.
pub const CELL_DOFS: usize = 18;
/// Marks a displacement component that is kept at zero.
pub const FIXED: usize = usize::MAX;

/// Three-point Gauss-Legendre rule on [-1, 1].
pub const GAUSS_3: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 9.0), (0.0, 8.0 / 9.0), (0.774_596_669_241_483_4, 5.0 / 9.0)];

/// One integration point, with N numbers per shape function: its rest gradient, and on a ring itself over the rest radius.
#[derive(Clone, Debug)]
pub struct GaussPoint<const N: usize> {
    /// Rest gradient of the nine shape functions [one over the unit of length].
    pub gradient: [[f64; N]; CELL_NODES],
    /// Rest area, or volume of the ring.
    pub weight: f64,
    /// The three pressure modes.
    pub mode: [f64; 3],
}

/// One cell.
#[derive(Clone, Debug)]
pub struct Cell<const N: usize> {
    /// Node indices, the first direction outermost.
    pub nodes: [usize; CELL_NODES],
    /// Equation of every displacement component, or `FIXED`.
    pub equations: [usize; CELL_DOFS],
    /// Integration points.
    pub points: Vec<GaussPoint<N>>,
    /// Inverse of the mass matrix of the pressure modes.
    pub inverse_mass: [[f64; 3]; 3],
}

impl<const N: usize> Cell<N> {
    /// A cell from its nodes, the equations of all nodes, its points and the mass matrix of their pressure modes.
    pub fn new(
        nodes: [usize; CELL_NODES],
        equations: &[[usize; 2]],
        points: Vec<GaussPoint<N>>,
        mass: &[[f64; 3]; 3],
    ) -> Self {
        let equations = std::array::from_fn(|i| equations[nodes[i / 2]][i % 2]);
        Cell { nodes, equations, points, inverse_mass: inverse(mass) }
    }
}

/// Adds the products of the pressure modes at a point to their mass matrix.
pub fn add_mass(mass: &mut [[f64; 3]; 3], weight: f64, mode: &[f64; 3]) {
    for (row, a) in mass.iter_mut().zip(mode) {
        for (entry, b) in row.iter_mut().zip(mode) {
            *entry += weight * a * b;
        }
    }
}

/// First coupled equation of every equation, for profile storage.
pub fn profile<const N: usize>(cells: &[Cell<N>], equation_count: usize) -> Vec<usize> {
    let mut first: Vec<usize> = (0..equation_count).collect();
    for cell in cells {
        let free = cell.equations.iter().filter(|&&e| e != FIXED);
        let low = free.clone().min().copied().unwrap_or(0);
        for &e in free {
            first[e] = first[e].min(low);
        }
    }
    first
}

/// Inserts the mid points.
pub fn quadratic_nodes(corners: &[f64]) -> Vec<f64> {
    let mut nodes = vec![corners[0]];
    for pair in corners.windows(2) {
        nodes.push(0.5 * (pair[0] + pair[1]));
        nodes.push(pair[1]);
    }
    nodes
}

/// Quadratic Lagrange polynomials at -1, 0, 1 and their slopes.
pub fn quadratic(s: f64) -> ([f64; 3], [f64; 3]) {
    ([0.5 * s * (s - 1.0), 1.0 - s * s, 0.5 * s * (s + 1.0)], [s - 0.5, -2.0 * s, s + 0.5])
}

/// Weight of point `j` in Simpson's rule over the points, odd ones being mid points.
pub fn simpson(x: &[f64], j: usize) -> f64 {
    if j % 2 == 1 {
        return 4.0 * (x[j + 1] - x[j - 1]) / 6.0;
    }
    let below = if j > 0 { x[j] - x[j - 2] } else { 0.0 };
    let above = if j + 2 < x.len() { x[j + 2] - x[j] } else { 0.0 };
    (below + above) / 6.0
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

/// Recovers the step of the pressure modes of a cell from its displacement step: `constant + by_u du`.
#[derive(Clone)]
pub struct PressureStep {
    /// Part that does not depend on the displacement step.
    pub constant: [f64; 3],
    /// Derivative by the displacement step.
    pub by_u: [[f64; CELL_DOFS]; 3],
}

impl PressureStep {
    /// No step.
    pub const ZERO: Self = Self { constant: [0.0; 3], by_u: [[0.0; CELL_DOFS]; 3] };
}

/// Linearisation of one cell.
pub struct CellSystem {
    /// Second derivative of the energy by the displacement, lower triangle.
    pub tangent: [[f64; CELL_DOFS]; CELL_DOFS],
    /// Nodal forces.
    pub force: [f64; CELL_DOFS],
    /// Derivative of the volume residual by the displacement.
    pub coupling: [[f64; CELL_DOFS]; 3],
    /// Volume residual of every pressure mode.
    pub volume: [f64; 3],
}

/// Adds `K coupling M^-1 coupling^T` to the tangent.
pub fn condense<const N: usize>(cell: &Cell<N>, bulk: f64, system: &mut CellSystem) -> PressureStep {
    let mut step = PressureStep { constant: [0.0; 3], by_u: [[0.0; CELL_DOFS]; 3] };
    for m in 0..3 {
        for l in 0..3 {
            let s = bulk * cell.inverse_mass[m][l];
            step.constant[m] += s * system.volume[l];
            for (d, v) in step.by_u[m].iter_mut().zip(&system.coupling[l]) {
                *d += s * v;
            }
        }
    }
    for (coupling, by_u) in system.coupling.iter().zip(&step.by_u) {
        for (i, row) in system.tangent.iter_mut().enumerate() {
            for (entry, d) in row[..=i].iter_mut().zip(by_u) {
                *entry += coupling[i] * d;
            }
        }
    }
    step
}
