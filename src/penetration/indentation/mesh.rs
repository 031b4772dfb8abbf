//! Mesh of the meridional quarter plane under a free surface, for [`super`]: rings around the origin of
//! the surface, their distances in geometric progression, crossed by rays from the axis (angle 0, straight down) to the
//! surface (angle pi/2). Lengths in units of the radius R of the indenter.
//!
//! The cells at the origin are quads collapsed to triangles, linear along the ray: they hold a displacement that is
//! proportional to the distance from the origin, which is what a sharp apex makes of its neighbourhood. Elsewhere
//! quadratic displacement with nine nodes, linear discontinuous pressure (Q2/P1).

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::penetration::mixed_cell::{self, CELL_NODES, FIXED, GAUSS_3, add_mass, quadratic, quadratic_nodes, simpson};

/// One cell: rings outermost; gradients by (r, z) and the shape function over r.
pub type Cell = mixed_cell::Cell<3>;
/// One integration point.
pub type GaussPoint = mixed_cell::GaussPoint<3>;

/// The body under the indenter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Domain {
    /// Half space, meshed up to `radius` [R]; beyond it the decay of a point load (Boussinesq) as springs.
    HalfSpace {
        /// Radius of the meshed hemisphere [R].
        radius: f64,
    },
    /// Cylinder on a fixed bottom.
    Cylinder {
        /// Radius of the body [R].
        radius: f64,
        /// Height of the body [R].
        height: f64,
        /// Whether the lateral face is fixed too (else it is free of traction).
        side_fixed: bool,
    },
}

/// How fine the mesh is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndentationMeshSize {
    /// Rays: cells from the axis to the surface.
    pub rays: usize,
    /// Ratio of the distances of neighbouring rings, above 1.
    pub ring_ratio: f64,
    /// Rings inside `disc`.
    pub inner: InnerRings,
    /// Ring on which a corner of cells must lie [R].
    pub disc: f64,
}

/// Rings next to the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InnerRings {
    /// Geometric progression from an innermost ring of about this distance [R].
    Core(f64),
    /// So many even steps from the origin to the disc.
    Even(usize),
}

/// A node of the far hemisphere.
#[derive(Clone, Copy, Debug)]
pub struct FarNode {
    /// Node index.
    pub node: usize,
    /// Outward unit normal (r, z).
    pub normal: [f64; 2],
    /// Area of the hemisphere that the node stands for, over its radius [R].
    pub area_over_radius: f64,
}

/// The mesh of the meridional quarter plane.
#[derive(Clone, Debug)]
pub struct IndentationMesh {
    /// Rest positions (r, z) of the nodes [R], z up, the surface at z = 0.
    pub rest: Vec<[f64; 2]>,
    /// Equation of both displacement components of every node, or `FIXED`.
    pub equations: Vec<[usize; 2]>,
    /// Number of equations.
    pub equation_count: usize,
    /// Cells.
    pub cells: Vec<Cell>,
    /// Nodes on the surface, from the axis outwards: the origin, the corner of the innermost cell, then mid nodes and
    /// corners in turn.
    pub surface: Vec<usize>,
    /// Nodes of the far hemisphere (half space only).
    pub far: Vec<FarNode>,
    /// Part of a load, spread evenly over the disc at rest, that every node of `surface` takes; sum 1.
    pub disc_load: Vec<f64>,
}

impl IndentationMesh {
    /// Builds the mesh.
    pub fn new(domain: &Domain, size: &IndentationMeshSize) -> Self {
        let extent = match *domain {
            Domain::HalfSpace { radius } => radius,
            Domain::Cylinder { radius, height, .. } => radius.min(height),
        };
        let rings = quadratic_nodes(&ring_corners(size, extent));
        let rays = quadratic_nodes(&ray_corners(size.rays.max(2), domain));
        let (ring_count, ray_count) = (rings.len(), rays.len());
        let node_at = |i: usize, j: usize| if i == 0 { 0 } else { 1 + (i - 1) * ray_count + j };
        let mut mesh = Self {
            rest: vec![[0.0; 2]; 1 + (ring_count - 1) * ray_count],
            equations: vec![],
            equation_count: 0,
            cells: vec![],
            surface: (0..ring_count).filter(|&i| i != 1).map(|i| node_at(i, ray_count - 1)).collect(),
            far: vec![],
            disc_load: vec![0.0; ring_count - 1],
        };
        mesh.equations = vec![[FIXED; 2]; mesh.rest.len()];
        for (i, &ring) in rings.iter().enumerate() {
            for (j, &angle) in rays.iter().enumerate() {
                let (sn, cs) = (angle.sin(), angle.cos());
                let node = node_at(i, j);
                let stretch = match *domain {
                    Domain::HalfSpace { .. } => 1.0,
                    Domain::Cylinder { radius, height, .. } => {
                        let reach = if sn * height > cs * radius { radius / sn } else { height / cs };
                        1.0 + ring / extent * (reach / extent - 1.0)
                    }
                };
                let on_surface = j + 1 == ray_count;
                mesh.rest[node] = [
                    if j == 0 { 0.0 } else { ring * stretch * sn },
                    if on_surface { 0.0 } else { -ring * stretch * cs },
                ];
                let last = i + 1 == ring_count;
                if let (true, Domain::HalfSpace { .. }) = (last, domain) {
                    let area_over_radius = TAU * ring * sn * simpson(&rays, j);
                    mesh.far.push(FarNode { node, normal: [sn, -cs], area_over_radius });
                }
                let held = match *domain {
                    Domain::Cylinder { radius, height, side_fixed } if last => {
                        side_fixed || cs * radius >= sn * height * (1.0 - 1e-9)
                    }
                    _ => false,
                };
                let fixed = [held || i == 0 || j == 0 || i == 1, held || i == 1];
                for (equation, fixed) in mesh.equations[node].iter_mut().zip(fixed) {
                    if !fixed && *equation == FIXED {
                        *equation = mesh.equation_count;
                        mesh.equation_count += 1;
                    }
                }
            }
        }
        for i in (0..ring_count - 1).step_by(2) {
            for j in (0..ray_count - 1).step_by(2) {
                let nodes = std::array::from_fn(|m| node_at(i + m / 3, j + m % 3));
                mesh.cells.push(cell(nodes, &mesh.rest, &mesh.equations));
            }
            if rings[i + 1] < size.disc {
                mesh.load_edge(i, size.disc);
            }
        }
        mesh
    }

    /// Adds an even load on the edge from ring `i` to ring `i + 2` of the surface.
    fn load_edge(&mut self, i: usize, disc: f64) {
        // the innermost edge has no mid node
        let at: [usize; 3] = if i == 0 { [0, 0, 1] } else { [i - 1, i, i + 1] };
        let r = at.map(|k| self.rest[self.surface[k]][0]);
        for (s, w) in GAUSS_3 {
            let (n, g) = if i == 0 { linear(s) } else { quadratic(s) };
            let (mut x, mut slope) = (0.0, 0.0);
            for m in 0..3 {
                x += n[m] * r[m];
                slope += g[m] * r[m];
            }
            for (k, n) in at.into_iter().zip(n) {
                self.disc_load[k] += w * 2.0 * x * slope * n / (disc * disc);
            }
        }
    }

    /// First coupled equation of every equation, for profile storage.
    pub fn profile(&self) -> Vec<usize> {
        mixed_cell::profile(&self.cells, self.equation_count)
    }
}

/// Distances of the corners of cells from the origin: a geometric progression from the core on (even steps over a
/// loaded disc), one corner at the disc.
fn ring_corners(size: &IndentationMeshSize, extent: f64) -> Vec<f64> {
    let growth = (size.ring_ratio - 1.0).max(1e-3);
    let disc = size.disc.min(0.9 * extent);
    let mut rings: Vec<f64> = match size.inner {
        InnerRings::Even(count) => (0..=count.max(1)).map(|k| k as f64).collect(),
        InnerRings::Core(core) => {
            let core = core.clamp(1e-6, disc);
            let count = ((disc / core).ln() / (1.0 + growth).ln()).ceil();
            std::iter::once(0.0).chain((0..=count as usize).map(|k| (1.0 + growth).powi(k as i32))).collect()
        }
    };
    let last = rings.last().copied().unwrap_or(1.0);
    for ring in &mut rings {
        *ring *= disc / last;
    }
    let outer = ((extent / disc).ln() / (1.0 + growth).ln()).ceil().max(1.0);
    rings.extend((1..=outer as usize).map(|k| disc * (extent / disc).powf(k as f64 / outer)));
    rings
}

/// Angles of the rays [rad]; one meets the lower edge of a cylinder.
fn ray_corners(count: usize, domain: &Domain) -> Vec<f64> {
    let corner = match *domain {
        Domain::HalfSpace { .. } => FRAC_PI_2 * (count / 2) as f64 / count as f64,
        Domain::Cylinder { radius, height, .. } => (radius / height).atan(),
    };
    let inner = ((count as f64 * corner / FRAC_PI_2).round() as usize).clamp(1, count - 1);
    let lower = (0..inner).map(|k| corner * k as f64 / inner as f64);
    let outer = count - inner;
    lower.chain((0..=outer).map(|k| corner + (FRAC_PI_2 - corner) * k as f64 / outer as f64)).collect()
}

/// Linear polynomials at -1 and 1, none for the point between, and their slopes.
fn linear(s: f64) -> ([f64; 3], [f64; 3]) {
    ([0.5 * (1.0 - s), 0.0, 0.5 * (1.0 + s)], [-0.5, 0.0, 0.5])
}

fn cell(nodes: [usize; CELL_NODES], rest: &[[f64; 2]], equations: &[[usize; 2]]) -> Cell {
    let collapsed = nodes[0] == nodes[1];
    let mut points = Vec::with_capacity(9);
    let mut mass = [[0.0; 3]; 3];
    for (s, ws) in GAUSS_3 {
        for (t, wt) in GAUSS_3 {
            let ((ns, gs), (nt, gt)) = (if collapsed { linear(s) } else { quadratic(s) }, quadratic(t));
            // rows: by s, by t; columns: r, z
            let (mut jacobian, mut r) = ([[0.0; 2]; 2], 0.0);
            for (m, &node) in nodes.iter().enumerate() {
                let x = rest[node];
                r += ns[m / 3] * nt[m % 3] * x[0];
                for d in 0..2 {
                    jacobian[0][d] += gs[m / 3] * nt[m % 3] * x[d];
                    jacobian[1][d] += ns[m / 3] * gt[m % 3] * x[d];
                }
            }
            let det = jacobian[0][0] * jacobian[1][1] - jacobian[0][1] * jacobian[1][0];
            let mut gradient = [[0.0; 3]; CELL_NODES];
            for (m, g) in gradient.iter_mut().enumerate() {
                let (by_s, by_t) = (gs[m / 3] * nt[m % 3], ns[m / 3] * gt[m % 3]);
                *g = [
                    (jacobian[1][1] * by_s - jacobian[0][1] * by_t) / det,
                    (jacobian[0][0] * by_t - jacobian[1][0] * by_s) / det,
                    ns[m / 3] * nt[m % 3] / r,
                ];
            }
            let weight = ws * wt * det.abs() * TAU * r;
            // a displacement proportional to the distance from the origin changes the volume by the same ratio along a
            // ray
            let mode = [1.0, t, if collapsed { 0.0 } else { s }];
            add_mass(&mut mass, weight, &mode);
            points.push(GaussPoint { gradient, weight, mode });
        }
    }
    if collapsed {
        mass[2][2] = 1.0;
    }
    Cell::new(nodes, equations, points, &mass)
}
