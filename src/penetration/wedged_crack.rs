//! Equilibrium of a planar crack of rest half length `a = 1` that is wedged open by a rigid frictionless circle of radius R, in an infinite
//! incompressible hyperelastic medium in plane strain (Shergold and Fleck 2004, sharp punch).
//!
//! Lagrangian of the quarter plane, stationary in displacement u, cell pressures p and contact forces f >= 0 of the face nodes:
//! `L = int w(F:F + 1) - mu (J - 1) + p (J - 1) - p^2/(2 kappa) dA + sum f (R - |x|) - f^2/(2 k_c) + far`. p and f are condensed out of every
//! Newton step; `-mu (J - 1)` makes p = 0 the rest state, or the vast far field would collect an energy mu^2/kappa per area.
//! kappa and k_c are so large that they act as zero compliance; p and f are unknowns of their own, so Newton does not feel the penalty.
//! Far field: the boundary carries the springs `2 mu / B` of the exact decay u_r ~ 1/r outside it.

use super::law::{EnergyJet, PlaneStrainLaw};
use super::mixed_cell::{CELL_DOFS, CELL_NODES, CellSystem, FIXED, PressureStep, condense};
use super::skyline::SkylineMatrix;
use super::slit_mesh::{Cell, GaussPoint, MeshSize, SlitMesh};

/// Bulk modulus over shear modulus.
const BULK_OVER_MU: f64 = 1e7;
/// Stiffness of a contact node per length of shaft over shear modulus.
const CONTACT_OVER_MU: f64 = 1e7;
/// Newton steps at most.
const NEWTON_MAX: usize = 30;
/// Longest Newton step in units of R.
const STEP_LIMIT: f64 = 0.4;
/// Halvings of Newton steps that leave the domain of the law, in one solution.
const BACKTRACKS: usize = 16;
/// Converged if the last Newton step moved no node by more than this part of R. Convergence is quadratic: what is left is its square.
const STEP_TOLERANCE: f64 = 3e-4;

/// Unknowns of the quarter plane.
#[derive(Clone, Debug)]
pub struct WedgeState {
    /// Radius of the circle over a.
    pub radius: f64,
    /// Displacement of the nodes [a].
    pub u: Vec<[f64; 2]>,
    /// Modes of the reaction to volume change in every cell [Pa], tension positive.
    pub p: Vec<[f64; 3]>,
    /// Radial contact force on every face node of the quarter, per length of shaft [Pa a].
    pub contact: Vec<f64>,
}

impl WedgeState {
    /// Replaces the state by the mean of itself and `other`.
    fn move_halfway_to(&mut self, other: &Self) {
        for (a, b) in self.u.iter_mut().zip(&other.u) {
            *a = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        }
        for (a, b) in self.p.iter_mut().zip(&other.p) {
            *a = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])];
        }
        for (a, b) in self.contact.iter_mut().zip(&other.contact) {
            *a = 0.5 * (*a + b);
        }
    }
}

/// Why no equilibrium was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NewtonFailure {
    /// The law returned a number that is not finite (stretch beyond its limit, overflow).
    LawOutOfRange,
    /// The tangent is singular.
    Singular,
    /// The equilibrium found is a saddle of the energy (laws that soften).
    Unstable,
    /// Too many iterations or a step out of bounds.
    NotConverged,
}

/// The discrete problem: mesh, law and work space.
pub struct WedgedCrack<'a> {
    law: &'a dyn PlaneStrainLaw,
    rest_jet: EnergyJet,
    mu: f64,
    mesh: SlitMesh,
    matrix: SkylineMatrix,
    rhs: Vec<f64>,
    pressure_step: Vec<PressureStep>,
    /// Newton steps done so far.
    pub iterations: usize,
}

impl<'a> WedgedCrack<'a> {
    /// Sets up the mesh for a law.
    pub fn new(law: &'a dyn PlaneStrainLaw, size: &MeshSize) -> Self {
        let mesh = SlitMesh::new(size);
        let matrix = SkylineMatrix::new(mesh.profile());
        let rhs = vec![0.0; mesh.equation_count];
        let pressure_step = vec![PressureStep::ZERO; mesh.cells.len()];
        Self { law, rest_jet: law.jet(3.0), mu: law.shear_modulus(), mesh, matrix, rhs, pressure_step, iterations: 0 }
    }

    /// The law beyond its domain: pointwise F:F + 1 may fall a little below 3 as J is one on average only.
    fn jet(&self, i1: f64) -> EnergyJet {
        if i1 >= 3.0 {
            return self.law.jet(i1);
        }
        let (s, r) = (i1 - 3.0, self.rest_jet);
        EnergyJet { w: r.w + s * (r.dw + 0.5 * s * r.d2w), dw: r.dw + s * r.d2w, d2w: r.d2w }
    }

    /// First guess: a crack opened to an ellipse of half width `radius` by uniform pressure, linear theory (Westergaard 1939, nu = 1/2).
    pub fn initial_state(&self, radius: f64) -> WedgeState {
        let guess = |&[xi, eta]: &[f64; 2]| {
            let (sh, ch, sn, cs) = (xi.sinh(), xi.cosh(), eta.sin(), eta.cos());
            let size = sh * sh + sn * sn;
            if size < 1e-12 {
                return [0.0, 0.0];
            }
            // coth(xi + i eta)
            let (re, im) = (sh * ch / size, -sn * cs / size);
            let y = sh * sn;
            [-radius * y * im, radius * ((-xi).exp() * sn - y * (re - 1.0))]
        };
        let u = self.mesh.elliptic.iter().map(guess).collect();
        WedgeState { radius, u, p: vec![[0.0; 3]; self.mesh.cells.len()], contact: vec![0.0; self.mesh.face.len()] }
    }

    /// Newton iteration to equilibrium at `state.radius`, contact set included. `inside` is a state in the domain of the law, towards which
    /// the guess is moved if it is not.
    pub fn solve(&mut self, state: &mut WedgeState, inside: Option<&WedgeState>) -> Result<(), NewtonFailure> {
        let mut active = self.contact_set(state);
        let mut before = inside.cloned();
        let mut shortened = 0;
        for _ in 0..NEWTON_MAX {
            self.iterations += 1;
            if let Err(e) = self.assemble(state, &active) {
                // the last step overshot the domain of the law: take half of it
                shortened += 1;
                match &before {
                    Some(old) if shortened <= BACKTRACKS => state.move_halfway_to(old),
                    _ => return Err(e),
                }
                active = self.contact_set(state);
                continue;
            }
            let negative = self.matrix.factor().map_err(|_| NewtonFailure::Singular)?;
            self.matrix.solve(&mut self.rhs);
            before = Some(state.clone());
            let step = self.apply_step(state, &active);
            if !step.is_finite() || step > 4.0 * (1.0 + state.radius) {
                return Err(NewtonFailure::NotConverged);
            }
            let next = self.contact_set(state);
            let settled = next == active;
            active = next;
            if settled && step < STEP_TOLERANCE * state.radius {
                // p and f are (nearly) exact multipliers: the condensed tangent is definite if and only if the equilibrium is stable
                return if negative == 0 { Ok(()) } else { Err(NewtonFailure::Unstable) };
            }
        }
        Err(NewtonFailure::NotConverged)
    }

    /// Which face nodes touch the circle: those pushed by it, and those inside it.
    fn contact_set(&self, state: &mut WedgeState) -> Vec<bool> {
        let mut active = Vec::with_capacity(self.mesh.face.len());
        for (force, &node) in state.contact.iter_mut().zip(&self.mesh.face) {
            let r = norm(position(&self.mesh, state.u[node], node));
            let on = if *force != 0.0 { *force > 0.0 } else { r <= state.radius };
            if !on {
                *force = 0.0;
            }
            active.push(on);
        }
        active
    }

    /// Condensed tangent and right-hand side at `state`.
    fn assemble(&mut self, state: &WedgeState, active: &[bool]) -> Result<(), NewtonFailure> {
        self.matrix.clear();
        self.rhs.fill(0.0);
        for c in 0..self.mesh.cells.len() {
            let cell = &self.mesh.cells[c];
            let mut system = self.cell_system(cell, state, &state.p[c]).ok_or(NewtonFailure::LawOutOfRange)?;
            let step = condense(cell, self.mu * BULK_OVER_MU, &mut system);
            for i in 0..CELL_DOFS {
                let row = cell.equations[i];
                if row == FIXED {
                    continue;
                }
                self.rhs[row] -=
                    system.force[i] + (0..3).map(|m| system.coupling[m][i] * step.constant[m]).sum::<f64>();
                for (&column, &value) in cell.equations[..=i].iter().zip(&system.tangent[i]) {
                    if column != FIXED {
                        self.matrix.add(row.max(column), row.min(column), value);
                    }
                }
            }
            self.pressure_step[c] = step;
        }
        self.assemble_far(state);
        self.assemble_contact(state, active);
        Ok(())
    }

    /// Linearisation of one cell; `None` if the law is out of range.
    fn cell_system(&self, cell: &Cell, state: &WedgeState, p: &[f64; 3]) -> Option<CellSystem> {
        let (mut k, mut r, mut kp, mut g) =
            ([[0.0; CELL_DOFS]; CELL_DOFS], [0.0; CELL_DOFS], [[0.0; CELL_DOFS]; 3], [0.0; 3]);
        let compliance = 1.0 / (self.mu * BULK_OVER_MU);
        for point in &cell.points {
            let f = deformation(cell, point, state);
            let jet = self.jet(invariant(&f));
            if !(jet.w.is_finite() && jet.dw.is_finite() && jet.d2w.is_finite()) {
                return None;
            }
            let pressure = p[0] * point.mode[0] + p[1] * point.mode[1] + p[2] * point.mode[2];
            let volume = f[0][0] * f[1][1] - f[0][1] * f[1][0] - 1.0 - compliance * pressure;
            let w = point.weight;
            let (iso, curve, press) = (2.0 * w * jet.dw, 4.0 * w * jet.d2w, w * (pressure - self.mu));
            let (mut fg, mut cg) = ([0.0; CELL_DOFS], [0.0; CELL_DOFS]);
            for (m, n) in point.gradient.iter().enumerate() {
                fg[2 * m] = f[0][0] * n[0] + f[0][1] * n[1];
                fg[2 * m + 1] = f[1][0] * n[0] + f[1][1] * n[1];
                // cofactor of F times the gradient: derivative of J
                cg[2 * m] = f[1][1] * n[0] - f[1][0] * n[1];
                cg[2 * m + 1] = -f[0][1] * n[0] + f[0][0] * n[1];
            }
            for i in 0..CELL_DOFS {
                r[i] += iso * fg[i] + press * cg[i];
                for (kp_m, mode) in kp.iter_mut().zip(point.mode) {
                    kp_m[i] += w * mode * cg[i];
                }
                let scaled = curve * fg[i];
                for (entry, v) in k[i][..=i].iter_mut().zip(&fg) {
                    *entry += scaled * v;
                }
            }
            for (g_m, mode) in g.iter_mut().zip(point.mode) {
                *g_m += w * mode * volume;
            }
            for m in 0..CELL_NODES {
                let a = point.gradient[m];
                for n in 0..=m {
                    let b = point.gradient[n];
                    let diagonal = iso * (a[0] * b[0] + a[1] * b[1]);
                    let turn = press * (a[0] * b[1] - a[1] * b[0]);
                    k[2 * m][2 * n] += diagonal;
                    k[2 * m + 1][2 * n + 1] += diagonal;
                    k[2 * m + 1][2 * n] -= turn;
                    if n < m {
                        k[2 * m][2 * n + 1] += turn;
                    }
                }
            }
        }
        Some(CellSystem { tangent: k, force: r, coupling: kp, volume: g })
    }

    /// Springs that stand for the medium outside the far boundary.
    fn assemble_far(&mut self, state: &WedgeState) {
        for far in &self.mesh.far {
            let (u, n) = (state.u[far.node], far.normal);
            let stiffness = 2.0 * self.mu * far.angle;
            let force = stiffness * (u[0] * n[0] + u[1] * n[1]);
            let block = [[stiffness * n[0] * n[0], 0.0], [stiffness * n[0] * n[1], stiffness * n[1] * n[1]]];
            add_node(
                &mut self.matrix,
                &mut self.rhs,
                self.mesh.equations[far.node],
                &block,
                [-force * n[0], -force * n[1]],
            );
        }
    }

    /// Contact of the active face nodes, their forces condensed out.
    fn assemble_contact(&mut self, state: &WedgeState, active: &[bool]) {
        let k = self.mu * CONTACT_OVER_MU;
        for ((&node, &force), _) in self.mesh.face.iter().zip(&state.contact).zip(active).filter(|&(_, &on)| on) {
            let x = position(&self.mesh, state.u[node], node);
            let r = norm(x);
            let n = [x[0] / r, x[1] / r];
            let side = force / r;
            let block = [
                [k * n[0] * n[0] - side * (1.0 - n[0] * n[0]), 0.0],
                [(k + side) * n[0] * n[1], k * n[1] * n[1] - side * (1.0 - n[1] * n[1])],
            ];
            let push = k * (state.radius - r);
            add_node(&mut self.matrix, &mut self.rhs, self.mesh.equations[node], &block, [push * n[0], push * n[1]]);
        }
    }

    /// Adds the solved Newton step to all unknowns, shortened to a largest displacement of `STEP_LIMIT`; the largest displacement before that.
    fn apply_step(&self, state: &mut WedgeState, active: &[bool]) -> f64 {
        let change = |node: usize| self.mesh.equations[node].map(|e| if e == FIXED { 0.0 } else { self.rhs[e] });
        let largest = self.rhs.iter().fold(0.0, |m: f64, d| if d.is_finite() { m.max(d.abs()) } else { f64::INFINITY });
        if !largest.is_finite() {
            return largest;
        }
        let part = (STEP_LIMIT * state.radius / largest).min(1.0);
        for ((cell, dp), p) in self.mesh.cells.iter().zip(&self.pressure_step).zip(&mut state.p) {
            for (m, p_m) in p.iter_mut().enumerate() {
                let free = cell.equations.iter().zip(&dp.by_u[m]).filter(|&(&e, _)| e != FIXED);
                *p_m += part * (dp.constant[m] + free.map(|(&e, d)| d * self.rhs[e]).sum::<f64>());
            }
        }
        let k = self.mu * CONTACT_OVER_MU;
        for ((&node, force), _) in self.mesh.face.iter().zip(&mut state.contact).zip(active).filter(|&(_, &on)| on) {
            let x = position(&self.mesh, state.u[node], node);
            let (r, du) = (norm(x), change(node));
            *force += part * (k * (state.radius - r - (x[0] * du[0] + x[1] * du[1]) / r) - *force);
        }
        for (node, u) in state.u.iter_mut().enumerate() {
            let du = change(node);
            u[0] += part * du[0];
            u[1] += part * du[1];
        }
        largest
    }

    /// Strain energy of the whole plane per length of shaft [Pa a^2], with the far field and the (negligible) penalty energies.
    pub fn energy(&self, state: &WedgeState) -> f64 {
        let compliance = 1.0 / (self.mu * BULK_OVER_MU);
        let mut sum = 0.0;
        for (cell, p) in self.mesh.cells.iter().zip(&state.p) {
            for point in &cell.points {
                let f = deformation(cell, point, state);
                let pressure = p[0] * point.mode[0] + p[1] * point.mode[1] + p[2] * point.mode[2];
                let dilation = f[0][0] * f[1][1] - f[0][1] * f[1][0] - 1.0;
                sum += point.weight
                    * (self.jet(invariant(&f)).w - self.mu * dilation + 0.5 * compliance * pressure * pressure);
            }
        }
        for far in &self.mesh.far {
            let radial = state.u[far.node][0] * far.normal[0] + state.u[far.node][1] * far.normal[1];
            sum += self.mu * far.angle * radial * radial;
        }
        sum += state.contact.iter().map(|f| f * f).sum::<f64>() / (2.0 * self.mu * CONTACT_OVER_MU);
        4.0 * sum
    }

    /// Total normal force of the medium on unit length of the shaft [Pa a]: the sum of the contact forces of all four quarters.
    pub fn normal_force(&self, state: &WedgeState) -> f64 {
        4.0 * state.contact.iter().sum::<f64>()
    }

    /// Part of the half face that touches, as the smallest eta in contact [rad] (0 tip, pi/2 middle).
    pub fn contact_edge(&self, state: &WedgeState) -> f64 {
        let touching = self.mesh.face.iter().zip(&state.contact).find(|&(_, &f)| f > 0.0);
        touching.map_or(std::f64::consts::FRAC_PI_2, |(&node, _)| self.mesh.elliptic[node][1])
    }
}

/// Adds a symmetric 2x2 block (lower triangle) and a force of one node.
fn add_node(
    matrix: &mut SkylineMatrix,
    rhs: &mut [f64],
    equations: [usize; 2],
    block: &[[f64; 2]; 2],
    force: [f64; 2],
) {
    for i in 0..2 {
        if equations[i] == FIXED {
            continue;
        }
        rhs[equations[i]] += force[i];
        for j in 0..=i {
            if equations[j] != FIXED {
                matrix.add(equations[i], equations[j], block[i][j]);
            }
        }
    }
}

/// Deformation gradient at an integration point.
fn deformation(cell: &Cell, point: &GaussPoint, state: &WedgeState) -> [[f64; 2]; 2] {
    let mut f = [[1.0, 0.0], [0.0, 1.0]];
    for (&node, n) in cell.nodes.iter().zip(&point.gradient) {
        let u = state.u[node];
        f[0][0] += u[0] * n[0];
        f[0][1] += u[0] * n[1];
        f[1][0] += u[1] * n[0];
        f[1][1] += u[1] * n[1];
    }
    f
}

/// I = F:F + 1.
fn invariant(f: &[[f64; 2]; 2]) -> f64 {
    f[0][0] * f[0][0] + f[0][1] * f[0][1] + f[1][0] * f[1][0] + f[1][1] * f[1][1] + 1.0
}

/// Current position of a node, kept away from the axis of the circle.
fn position(mesh: &SlitMesh, u: [f64; 2], node: usize) -> [f64; 2] {
    [mesh.rest[node][0] + u[0], (mesh.rest[node][1] + u[1]).max(1e-12)]
}

fn norm(x: [f64; 2]) -> f64 {
    x[0].hypot(x[1])
}
