//! Cells in f64: displacement gradients, nodal forces, stiffness bounds and energies of both elements.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::effects::puncture::FLAT_UNDER_NEEDLE;
use crate::material::TangentBound;
use crate::material::kinematics::{J_CONTINUATION, cofactor, jacobian_minus_one};
use crate::material_point::{Material, PointState, Surroundings, Volumetric};
use crate::mesh::tets::TetMesh;
use crate::mesh::{BlockMesh, CORNERS, CellNodes, Mesh};
use crate::model::Model;

/// Hourglass coefficient of a linear elastic cube, [Joldes2008] via physics of the one-point hexahedron.
pub const HOURGLASS_MODULUS: f64 = 3.11;

/// The four hourglass base vectors at a corner: eta zeta, zeta xi, xi eta, xi eta zeta.
fn hourglass_signs([x, y, z]: [f64; 3]) -> [f64; 4] {
    [y * z, z * x, x * y, x * y * z]
}

/// A cell at rest.
#[derive(Debug, Clone, Copy)]
pub struct CellShape {
    pub nodes: CellNodes,
    /// Rest volume V [m^3].
    pub volume: f64,
    /// Gradients `B_i` [1/m], one per node: `H = sum_i u_i (x) B_i`.
    gradients: [DVec3; 8],
    /// What only a hexahedron has.
    hexahedron: Option<Hexahedron>,
}

/// The base of a column of cells: what the shaders know of it.
#[derive(Debug, Clone, Copy)]
pub struct PrismBase {
    /// An eighth of the gradients of xi and eta at the centre [1/m]; zero for a gap.
    pub gradients: [DVec3; 2],
    /// [m]
    pub taper: DVec3,
    /// [m^2]
    pub area: f64,
}

impl PrismBase {
    /// The base of the column that `cell` stands in.
    pub fn new(block: &BlockMesh, cell: usize) -> Self {
        let hexahedron = Hexahedron::new(block, cell);
        let [xi, eta, _] = hexahedron.modes;
        let cross = 4.0 * hexahedron.edges[0].truncate().perp_dot(hexahedron.edges[1].truncate());
        // A rounded zero would have a cube root that is none.
        let area = if block.is_gap(cell) { 0.0 } else { cross };
        PrismBase { gradients: [xi, eta], taper: hexahedron.taper, area }
    }
}

/// A prism between two planes z = const, bilinear in the plane: `X = centre + xi E_xi + eta E_eta + xi eta taper + zeta E_zeta`.
#[derive(Debug, Clone, Copy)]
struct Hexahedron {
    /// Half edges through the centre, E_xi, E_eta, E_zeta [m].
    edges: [DVec3; 3],
    /// [m]; zero for a box.
    taper: DVec3,
    /// An eighth of the gradients of xi, eta and zeta at the centre [1/m]; zero for a gap cell, which carries nothing.
    modes: [DVec3; 3],
}

impl Hexahedron {
    fn new(block: &BlockMesh, cell: usize) -> Self {
        let (edges, taper) = match block.bore {
            None => {
                let half = 0.5 * block.cell_size(cell);
                ([DVec3::X * half.x, DVec3::Y * half.y, DVec3::Z * half.z], DVec3::ZERO)
            }
            Some(_) => {
                let corners = block.cell_nodes(cell).map(|n| block.rest_position(n));
                let sum = |sign: fn([f64; 3]) -> f64| {
                    CORNERS.iter().zip(corners).map(|(c, x)| x * sign(*c)).sum::<DVec3>() / 8.0
                };
                ([sum(|c| c[0]), sum(|c| c[1]), sum(|c| c[2])], sum(|c| c[0] * c[1]))
            }
        };
        let modes = match block.is_gap(cell) {
            true => [DVec3::ZERO; 3],
            false => {
                let inverse = DMat3::from_cols(edges[0], edges[1], edges[2]).inverse().transpose();
                [inverse.x_axis / 8.0, inverse.y_axis / 8.0, inverse.z_axis / 8.0]
            }
        };
        Hexahedron { edges, taper, modes }
    }

    /// Bound of |sum of t_m a_m|^2 from the Gram matrix of three vectors: over unit vectors t, or `on_edge` with every
    /// |t_m| <= 1.
    fn largest_square(a: [DVec3; 3], on_edge: bool) -> f64 {
        let [xx, yy, zz] = a.map(|a| a.length_squared());
        let [xy, yz, zx] = [a[0].dot(a[1]).abs(), a[1].dot(a[2]).abs(), a[2].dot(a[0]).abs()];
        match on_edge {
            false => (xx + xy + zx).max(yy + xy + yz).max(zz + yz + zx),
            true => xx + yy + zz + 2.0 * (xy + yz + zx),
        }
    }

    /// Smallest J at a corner, from its three edges.
    fn smallest_corner_jacobian(&self, u: &[DVec3; 8]) -> f64 {
        // Edges that meet in a corner, along xi, eta, zeta: node order of `cell_nodes`.
        const NEIGHBOURS: [[usize; 3]; 8] =
            [[1, 3, 4], [0, 2, 5], [3, 1, 6], [2, 0, 7], [5, 7, 0], [4, 6, 1], [7, 5, 2], [6, 4, 3]];
        (0..8)
            .map(|i| {
                let c = CORNERS[i];
                let rest = [
                    (self.edges[0] + self.taper * c[1]) * 2.0,
                    (self.edges[1] + self.taper * c[0]) * 2.0,
                    self.edges[2] * 2.0,
                ];
                let now = |a: usize| rest[a] - (u[NEIGHBOURS[i][a]] - u[i]) * c[a];
                DMat3::from_cols(now(0), now(1), now(2)).determinant()
                    / DMat3::from_cols(rest[0], rest[1], rest[2]).determinant()
            })
            .fold(f64::INFINITY, f64::min)
    }
}

impl CellShape {
    pub fn new(mesh: &Mesh, cell: usize) -> Self {
        let nodes = mesh.cell_nodes(cell);
        match mesh {
            Mesh::Block(block) => {
                let hexahedron = Hexahedron::new(block, cell);
                let [x, y, z] = hexahedron.modes;
                CellShape {
                    nodes,
                    volume: mesh.cell_volume(cell),
                    gradients: CORNERS.map(|c| x * c[0] + y * c[1] + z * c[2]),
                    hexahedron: Some(hexahedron),
                }
            }
            Mesh::Tets(tets) => {
                let [a, b, c, d] = tets.gradients(cell);
                let none = DVec3::ZERO;
                CellShape {
                    nodes,
                    volume: tets.volume(cell),
                    gradients: [a, b, c, d, none, none, none, none],
                    hexahedron: None,
                }
            }
        }
    }

    pub fn gradients(&self) -> &[DVec3] {
        &self.gradients[..self.nodes.len()]
    }

    /// V^(1/3) [m].
    pub fn edge(&self) -> f64 {
        self.volume.cbrt()
    }

    /// Values at the corners.
    pub fn gather(&self, values: &[DVec3]) -> [DVec3; 8] {
        let mut corners = [DVec3::ZERO; 8];
        for (corner, node) in corners.iter_mut().zip(self.nodes.iter()) {
            *corner = values[*node];
        }
        corners
    }

    /// H = F - I of the cell (at the centre of a hexahedron) from its corner displacements.
    pub fn displacement_gradient(&self, u: &[DVec3; 8]) -> DMat3 {
        let mut h = DMat3::ZERO;
        for (u, b) in u.iter().zip(self.gradients()) {
            h += DMat3::from_cols(*u * b.x, *u * b.y, *u * b.z);
        }
        h
    }

    /// Hourglass vectors `gamma_mi/8` of a node: the four base vectors less what a linear field has of them,
    /// `gamma_xy = Gamma_xy - 8 taper.B` in a tapered prism [Flanagan1981]; zero in a gap.
    fn hourglass_vector(&self, corner: usize) -> [f64; 4] {
        let Some(hexahedron) = self.hexahedron else { return [0.0; 4] };
        if self.volume == 0.0 {
            return [0.0; 4];
        }
        let mut gamma = hourglass_signs(CORNERS[corner]).map(|g| g / 8.0);
        gamma[2] -= hexahedron.taper.dot(self.gradients[corner]);
        gamma
    }

    /// `q_m = sum_i gamma_mi u_i / 8`; zero for a tetrahedron, which has no hourglass modes.
    fn hourglass_modes(&self, u: &[DVec3; 8]) -> [DVec3; 4] {
        let mut q = [DVec3::ZERO; 4];
        for (corner, u) in u.iter().enumerate().take(self.nodes.len()) {
            for (q, gamma) in q.iter_mut().zip(self.hourglass_vector(corner)) {
                *q += *u * gamma;
            }
        }
        q
    }

    /// V^(1/3) for ratios, 1 where there is no volume [m].
    fn scale(&self) -> f64 {
        if self.volume > 0.0 { self.edge() } else { 1.0 }
    }
}

/// Forces of all cells.
///
/// One-point hexahedra on a rectilinear block:
/// ```text
/// H   = sum_i u_i (x) B_i,  B_i = (xi_i/(4 dx), eta_i/(4 dy), zeta_i/(4 dz))
/// f_i = V P B_i + hourglass,  q_m = sum_i Gamma_mi u_i / 8,  q2 = sum_m |q_m|^2
/// E_h = 1/2 kappa 3.11 mu0 V^(1/3) q2 (1 + c/2 q2 / V^(2/3))
/// ```
/// Source: Flanagan & Belytschko 1981; Joldes, Wittek & Miller 2008 (total Lagrangian); the quartic term is this
/// project's (a linear hourglass force lets surface cells fold under a needle tip).
///
/// Tetrahedra with averaged nodal pressure:
/// ```text
/// V_a = sum_e V_e/4,  Jbar_a = sum_e J_e V_e/4 / V_a,  K_a = sum_e w_e K_e V_e/4 / V_a
/// E_vol = sum_a 1/2 K_a V_a (Jbar_a - 1)^2 + sum_e 1/2 w_e K_e V_e min(0, J_e - J_c)^2,  J_c = 0.3 (0.75 under a needle)
/// p_e   = mean of K_a (Jbar_a - 1) over the corners + w_e K_e min(0, J_e - J_c)
/// ```
/// with the stiffness `w_e` that damage and path left; `p_e` is the derivative of E_vol, so energy is kept also between
/// materials. Source: Bonet & Burton 1998; the second term is this project's: an average over intact neighbours does not turn
/// a single cell back that is nearly flat or inside out.
#[derive(Debug, Clone)]
pub struct Elements {
    /// kappa 3.11 mu0 [Pa] per material.
    hourglass: Vec<f64>,
    /// c.
    quartic: f64,
    /// J_c, below which a tetrahedron has a pressure of its own.
    flat_below: f64,
    /// Node to cells of a tetrahedral mesh, else empty: offsets and cells.
    offsets: Vec<usize>,
    cells: Vec<u32>,
}

/// State of the cells that their forces depend on; empty slices stand for cells without history or path.
#[derive(Debug, Clone, Copy, Default)]
pub struct CellStates<'a> {
    pub points: &'a [PointState],
    /// Stiffness that the path left, per cell.
    pub stiffness: &'a [f64],
}

impl<'a> CellStates<'a> {
    pub fn point(&self, cell: usize) -> Option<&'a PointState> {
        self.points.get(cell)
    }

    pub fn remaining(&self, cell: usize) -> f64 {
        self.stiffness.get(cell).copied().unwrap_or(1.0)
    }
}

/// What the forces of one cell depend on beside the displacement.
#[derive(Debug)]
pub struct CellInput<'a> {
    /// Averaged volumetric answer of a tetrahedron; `None` for a hexahedron.
    pub averaged: Option<Volumetric>,
    /// Stiffness that the path left.
    pub remaining: f64,
    pub point: Option<&'a mut PointState>,
    /// Time step [s] and number of the step to which the history is brought first; `None`: it stays as it is.
    pub advance: Option<(f64, u64)>,
}

/// A cell beside an opened path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grown {
    pub cell: u32,
    /// Part of its volume by which it grows as the path opens.
    pub by: f64,
}

/// What one cell tells about itself.
#[derive(Debug, Clone, Copy, Default)]
pub struct CellMeasure {
    /// Stored energies [J], path and damage included.
    pub elastic: f64,
    pub hourglass: f64,
    /// Dissipated by the viscous terms since t = 0, and the part of `elastic` that they hold [J].
    pub viscous: f64,
    pub held: f64,
    pub jacobian: f64,
    pub corner_jacobian: f64,
    /// Degradation d.
    pub damage: f64,
}

impl CellMeasure {
    /// A cell without tissue.
    pub fn of_nothing() -> Self {
        CellMeasure { jacobian: 1.0, corner_jacobian: 1.0, ..CellMeasure::default() }
    }
}

/// Forces on the corners with the sign of f_int, and the stiffness bound of each corner [N/m].
#[derive(Debug, Clone, Copy, Default)]
pub struct CellForces {
    pub force: [DVec3; 8],
    pub bound: [f64; 8],
}

impl Elements {
    pub fn new(model: &Model) -> Self {
        let solver = &model.scene.solver;
        let hourglass = |m: &Material| solver.hourglass_stiffness * HOURGLASS_MODULUS * m.law.shear_modulus();
        let (offsets, cells) = match &model.mesh {
            Mesh::Block(_) => Default::default(),
            Mesh::Tets(tets) => cells_of_nodes(tets),
        };
        Elements {
            hourglass: model.materials.iter().map(hourglass).collect(),
            quartic: solver.hourglass_quartic,
            flat_below: if model.puncture.is_some() { FLAT_UNDER_NEEDLE } else { J_CONTINUATION },
            offsets,
            cells,
        }
    }

    /// Bound of the stiffness that a cell adds to each of its corners [N/m], with the tangent bound t of the material:
    /// ```text
    /// tetrahedron: V ((kappa + t_turned) |cof B_i| sum|cof B_j| + t_straight |B_i| sum|B_j|)
    /// hexahedron:  8 V ((kappa + t_turned) max|cof B t|^2 + t_straight max|B t|^2) + hourglass
    /// ```
    /// The first is Gershgorin's, by the rows of the cell's own stiffness; it exceeds the assembled stiffness by up to 3.
    /// The second is that of a plane wave in a regular block in this state. With the phases p_m from cell to cell, the
    /// gradient of one-point hexahedra is `sum_m t_m grad xi_m`,
    /// `t_m = 2 sin(p_m/2) product over n != m of cos(p_n/2)`, so `sum t_m^2 / 4 = sum_m s_m product (1 - s_n)` with
    /// `s = sin^2`: linear in every s, at most 1 in the corners of 0 <= s <= 1. Cells therefore never move along all three
    /// axes at once with their largest gradient, as rows of a single cell have it. At rest this is `(2 c_P / h)^2` times
    /// the mass, and the shortest edge alone counts. One open face changes nothing, since a chain of lumped masses keeps
    /// `s` within 0..1 at its ends. Where two of them meet, motions along both fall together: a free block of 8 x 8 x 8
    /// cells has a limit 1.17 times shorter, a column one cell wide 1.51, a single cell 1.72 times (`tests/dynamics.rs`);
    /// cells there, and all cells where faces may part or where mass scaling raises no mass, take every |t_m| as 1, which is
    /// Gershgorin's bound of the cell.
    pub fn stiffness_bound(&self, model: &Model, cell: usize, cof: DMat3, tangent: TangentBound, q2: f64) -> [f64; 8] {
        let shape = CellShape::new(&model.mesh, cell);
        let bulk = model.material(cell).law.bulk_modulus;
        let volume = shape.volume;
        let Some(hexahedron) = shape.hexahedron else {
            let mut bound = [0.0; 8];
            let lengths = shape.gradients().iter().map(|b| ((cof * *b).length(), b.length()));
            let (sum_cof, sum) = lengths.clone().fold((0.0, 0.0), |s, l| (s.0 + l.0, s.1 + l.1));
            for (bound, l) in bound.iter_mut().zip(lengths) {
                *bound = volume * ((bulk + tangent.turned) * l.0 * sum_cof + tangent.straight * l.1 * sum);
            }
            return bound;
        };
        let modes = hexahedron.modes;
        let on_edge = self.is_on_edge(model, cell);
        let cof_b = Hexahedron::largest_square(modes.map(|b| cof * b), on_edge);
        let b = Hexahedron::largest_square(modes, on_edge);
        let edge = shape.edge();
        let folding = q2 / (shape.scale() * shape.scale());
        let hourglass = self.hourglass(model, cell) * edge * (1.0 + 3.0 * self.quartic * folding) / 8.0;
        [8.0 * volume * ((bulk + tangent.turned) * cof_b + tangent.straight * b) + hourglass; 8]
    }

    /// The same of a cell without history where the displacement of the nodes is `u`.
    pub fn stiffness_bound_at(&self, model: &Model, cell: usize, u: &[DVec3]) -> [f64; 8] {
        if model.mesh.is_empty(cell) {
            return [0.0; 8];
        }
        let shape = CellShape::new(&model.mesh, cell);
        let corners = shape.gather(u);
        let h = shape.displacement_gradient(&corners);
        let q2 = shape.hourglass_modes(&corners).iter().map(|q| q.length_squared()).sum();
        let tangent = model.material(cell).tangent_bound(h, &PointState::default());
        self.stiffness_bound(model, cell, cofactor(DMat3::IDENTITY + h), tangent, q2)
    }

    /// True where open faces of the block meet in a cell, and in all cells where the bound of inner ones does not serve.
    pub fn is_on_edge(&self, model: &Model, cell: usize) -> bool {
        if !model.effects.bounds_inner_cells() {
            return true;
        }
        let block = model.mesh.block();
        let (at, cells) = (block.cell_coordinates(cell), block.cells());
        let open = |face: usize| !model.scene.faces[face].fixed[face / 2];
        // Beside a cell in which nothing is the tissue ends, too; what does not deform holds it.
        let ends_beside = |a: usize, up: bool| {
            let mut beside = at;
            beside[a] = if up { at[a] + 1 } else { at[a] - 1 };
            let beside = block.cell_index(beside[0], beside[1], beside[2]);
            block.is_empty(beside) && !model.composition.rigid.get(beside).is_some_and(|rigid| *rigid)
        };
        let is_open = |a: &usize| {
            let low = if at[*a] == 0 { open(2 * a) } else { ends_beside(*a, false) };
            let high = if at[*a] + 1 == cells[*a] { open(2 * a + 1) } else { ends_beside(*a, true) };
            low || high
        };
        (0..3).filter(is_open).count() > 1
    }

    /// kappa 3.11 mu0 of a material [Pa].
    pub fn hourglass_of(&self, material: usize) -> f64 {
        self.hourglass[material]
    }

    /// J below which a tetrahedron has a pressure of its own.
    pub fn flat_below(&self) -> f64 {
        self.flat_below
    }

    /// Factor c of the quartic hourglass term.
    pub fn quartic(&self) -> f64 {
        self.quartic
    }

    fn hourglass(&self, model: &Model, cell: usize) -> f64 {
        self.hourglass[model.material_index(cell)]
    }

    /// E_h of an intact cell [J].
    fn hourglass_energy(&self, model: &Model, cell: usize, shape: &CellShape, q2: f64) -> f64 {
        let folding = q2 / (shape.scale() * shape.scale());
        0.5 * self.hourglass(model, cell) * shape.edge() * q2 * (1.0 + 0.5 * self.quartic * folding)
    }

    /// Volumetric answers of tetrahedra by averaged nodal pressure; `None` for hexahedra, which have their own. `opened`: cells beside an opened
    /// path, by what part of their volume that makes them grow.
    pub fn averaged_volumetrics(
        &self,
        model: &Model,
        u: &[DVec3],
        states: CellStates,
        opened: &[Grown],
    ) -> Option<Vec<Volumetric>> {
        let tets = model.mesh.as_tets()?;
        // Volume share V_e/4, J - 1 and w K of every cell.
        let mut cells: Vec<(f64, f64, f64)> = (0..tets.tets.len())
            .into_par_iter()
            .map(|cell| {
                let shape = CellShape::new(&model.mesh, cell);
                let dj = jacobian_minus_one(shape.displacement_gradient(&shape.gather(u)));
                let material = model.material(cell);
                let d = states.point(cell).map_or(0.0, |p| material.degradation(p, shape.edge()));
                (0.25 * shape.volume, dj, states.remaining(cell) * (1.0 - d) * material.law.bulk_modulus)
            })
            .collect();
        let closed: Vec<f64> = cells.iter().map(|(_, dj, _)| *dj).collect();
        for Grown { cell, by } in opened {
            let dj = &mut cells[*cell as usize].1;
            *dj += by * (1.0 + *dj);
        }
        // Jbar - 1 and K_a of every node.
        let nodes: Vec<(f64, f64)> = (0..u.len())
            .into_par_iter()
            .map(|node| {
                let around = &self.cells[self.offsets[node]..self.offsets[node + 1]];
                let sums = around
                    .iter()
                    .map(|c| cells[*c as usize])
                    .fold((0.0, 0.0, 0.0), |s, (v, dj, k)| (s.0 + v, s.1 + v * dj, s.2 + v * k));
                (sums.1 / sums.0, sums.2 / sums.0)
            })
            .collect();
        let answer = |cell: usize| {
            let corners = tets.tets[cell].map(|n| nodes[n as usize]);
            let bulk = model.material(cell).law.bulk_modulus;
            let (_, _, left) = cells[cell];
            let flat = (1.0 + closed[cell] - self.flat_below).min(0.0);
            Volumetric {
                stress: corners.iter().map(|(theta, k)| 0.25 * k * theta).sum::<f64>() + left * flat,
                energy: corners.iter().map(|(theta, _)| 0.125 * bulk * theta * theta).sum::<f64>()
                    + 0.5 * bulk * flat * flat,
            }
        };
        Some((0..tets.tets.len()).into_par_iter().map(answer).collect())
    }

    /// The averaged energy of one intact tetrahedron where the displacement of a node is `u`, for a look at a single cell (its stress
    /// is left away); `None` for a hexahedron.
    pub fn averaged_energy_of(&self, model: &Model, cell: usize, u: impl Fn(usize) -> DVec3) -> Option<Volumetric> {
        let tets = model.mesh.as_tets()?;
        // V_e/4 and J - 1.
        let dilatation = |cell: usize| {
            let shape = CellShape::new(&model.mesh, cell);
            let mut corners = [DVec3::ZERO; 8];
            corners.iter_mut().zip(shape.nodes.iter()).for_each(|(corner, node)| *corner = u(*node));
            (0.25 * shape.volume, jacobian_minus_one(shape.displacement_gradient(&corners)))
        };
        let theta = |node: usize| {
            let around = self.cells[self.offsets[node]..self.offsets[node + 1]].iter();
            let sums = around.map(|c| dilatation(*c as usize)).fold((0.0, 0.0), |s, (v, dj)| (s.0 + v, s.1 + v * dj));
            sums.1 / sums.0
        };
        let bulk = model.material(cell).law.bulk_modulus;
        let (_, dj) = dilatation(cell);
        let flat = (1.0 + dj - self.flat_below).min(0.0);
        let averaged: f64 = tets.tets[cell].iter().map(|n| 0.125 * bulk * theta(*n as usize).powi(2)).sum();
        Some(Volumetric { stress: 0.0, energy: averaged + 0.5 * bulk * flat * flat })
    }

    /// Forces of one cell. The flag tells whether the return mapping met the yield condition.
    pub fn corner_forces(&self, model: &Model, cell: usize, u: &[DVec3], input: CellInput) -> (CellForces, bool) {
        let CellInput { averaged, remaining, point, advance } = input;
        if model.mesh.is_empty(cell) {
            return (CellForces::default(), true);
        }
        let shape = CellShape::new(&model.mesh, cell);
        let material = model.material(cell);
        let u = shape.gather(u);
        let h = shape.displacement_gradient(&u);
        let q = shape.hourglass_modes(&u);
        let q2: f64 = q.iter().map(|q| q.length_squared()).sum();
        let edge = shape.edge();
        let mut fresh = PointState::default();
        let state = point.unwrap_or(&mut fresh);
        let mut met = true;
        if let Some((dt, step)) = advance.filter(|_| material.has_history()) {
            let around = Surroundings {
                length: edge,
                dt,
                step,
                remaining,
                other_energy: self.hourglass_energy(model, cell, &shape, q2) / shape.volume.max(f64::MIN_POSITIVE),
            };
            let energy = averaged.unwrap_or_else(|| material.volumetric(h, 1.0)).energy;
            met = material.advance(h, energy, &around, state);
        }
        let intact = remaining * (1.0 - material.degradation(state, edge));
        let volumetric = averaged.unwrap_or_else(|| material.volumetric(h, intact));
        let p = material.stress(h, volumetric, intact, state);
        let folding = q2 / (shape.scale() * shape.scale());
        let kh = intact * self.hourglass(model, cell) * edge * (1.0 + self.quartic * folding);
        let mut out = CellForces::default();
        for (i, b) in shape.gradients().iter().enumerate() {
            out.force[i] = p * *b * shape.volume;
            for (q, gamma) in q.iter().zip(shape.hourglass_vector(i)) {
                out.force[i] += *q * (kh * gamma);
            }
        }
        let f = DMat3::IDENTITY + h;
        let bound = self.stiffness_bound(model, cell, cofactor(f), material.tangent_bound(h, state), q2);
        // Averaged pressure carries over from neighbours that may be intact, so it is not weakened with this cell.
        out.bound = bound.map(|b| if averaged.is_some() { b } else { b * intact });
        (out, met)
    }

    /// Energies and Jacobians of one cell.
    pub fn measure(
        &self,
        model: &Model,
        cell: usize,
        u: &[DVec3],
        averaged: Option<Volumetric>,
        states: CellStates,
    ) -> CellMeasure {
        let shape = CellShape::new(&model.mesh, cell);
        self.measure_corners(model, cell, &shape.gather(u), averaged, states)
    }

    /// The same from the displacements of the corners.
    pub fn measure_corners(
        &self,
        model: &Model,
        cell: usize,
        u: &[DVec3; 8],
        averaged: Option<Volumetric>,
        states: CellStates,
    ) -> CellMeasure {
        if model.mesh.is_empty(cell) {
            return CellMeasure::of_nothing();
        }
        let shape = CellShape::new(&model.mesh, cell);
        let material = model.material(cell);
        let h = shape.displacement_gradient(u);
        let q2: f64 = shape.hourglass_modes(u).iter().map(|q| q.length_squared()).sum();
        let edge = shape.edge();
        let fresh = PointState::default();
        let point = states.point(cell).unwrap_or(&fresh);
        let damage = material.degradation(point, edge);
        let intact = states.remaining(cell) * (1.0 - damage);
        let volumetric = averaged.unwrap_or_else(|| material.volumetric(h, 1.0)).energy;
        let energy = material.energy(h, volumetric, intact, point);
        let jacobian = 1.0 + jacobian_minus_one(h);
        CellMeasure {
            elastic: shape.volume * energy.stored,
            hourglass: intact * self.hourglass_energy(model, cell, &shape, q2),
            viscous: shape.volume * (point.viscous_work - energy.viscous_stored),
            held: shape.volume * energy.viscous_stored,
            jacobian,
            corner_jacobian: match shape.hexahedron {
                Some(hexahedron) if shape.volume > 0.0 => hexahedron.smallest_corner_jacobian(u),
                _ => jacobian,
            },
            damage,
        }
    }

    /// Force on a node (-f_int) [N] and its stiffness bound [N/m].
    pub fn gather(&self, mesh: &Mesh, cells: &[CellForces], node: usize) -> (DVec3, f64) {
        let (mut force, mut bound) = (DVec3::ZERO, 0.0);
        match mesh {
            Mesh::Block(block) => {
                let (at, counts) = (block.node_coordinates(node), block.cells());
                for (corner, signs) in CORNERS.iter().enumerate() {
                    // The cell of which this node is `corner` lies on the other side of the sign.
                    let index = |a: usize| match signs[a] < 0.0 {
                        true => (at[a] < counts[a]).then_some(at[a]),
                        false => at[a].checked_sub(1),
                    };
                    if let (Some(i), Some(j), Some(k)) = (index(0), index(1), index(2)) {
                        let cell = &cells[block.cell_index(i, j, k)];
                        force -= cell.force[corner];
                        bound += cell.bound[corner];
                    }
                }
            }
            Mesh::Tets(tets) => {
                for cell in &self.cells[self.offsets[node]..self.offsets[node + 1]] {
                    let cell = *cell as usize;
                    let corner = tets.tets[cell].iter().position(|n| *n as usize == node).unwrap_or(0);
                    force -= cells[cell].force[corner];
                    bound += cells[cell].bound[corner];
                }
            }
        }
        (force, bound)
    }

    /// f_int of all nodes [N].
    pub fn nodal_forces(&self, mesh: &Mesh, cells: &[CellForces]) -> Vec<DVec3> {
        (0..mesh.node_count()).into_par_iter().map(|n| -self.gather(mesh, cells, n).0).collect()
    }

    /// Internal nodal forces f_int [N] of a displacement field.
    pub fn internal_forces(&self, model: &Model, u: &[DVec3], states: CellStates) -> Vec<DVec3> {
        let averaged = self.averaged_volumetrics(model, u, states, &[]);
        let cells: Vec<CellForces> = (0..model.mesh.cell_count())
            .into_par_iter()
            .map(|cell| {
                let volumetric = averaged.as_ref().map(|a| a[cell]);
                let mut point = states.point(cell).cloned();
                let remaining = states.remaining(cell);
                let input = CellInput { averaged: volumetric, remaining, point: point.as_mut(), advance: None };
                self.corner_forces(model, cell, u, input).0
            })
            .collect();
        self.nodal_forces(&model.mesh, &cells)
    }
}

/// Cells around every node in compressed rows.
pub fn cells_of_nodes(mesh: &TetMesh) -> (Vec<usize>, Vec<u32>) {
    let mut offsets = vec![0usize; mesh.positions.len() + 1];
    for node in mesh.tets.iter().flatten() {
        offsets[*node as usize + 1] += 1;
    }
    for i in 1..offsets.len() {
        offsets[i] += offsets[i - 1];
    }
    let mut next = offsets.clone();
    let mut cells = vec![0u32; mesh.tets.len() * 4];
    for (cell, tet) in mesh.tets.iter().enumerate() {
        for node in tet {
            cells[next[*node as usize]] = cell as u32;
            next[*node as usize] += 1;
        }
    }
    (offsets, cells)
}
