//! A rigid needle tip pressed into compressible neo-Hookean tissue without cutting it: axisymmetric, large strain.
//!
//! Lengths are in units of the radius R of the needle, stresses in units of the shear modulus mu, so forces in units of
//! mu R^2. Strain energy `W = mu/2 (I1 J^(-2/3) - 3) + K/2 (J - 1)^2` per rest volume. The indenter is a cone with a
//! sharp apex that runs into a cylinder of radius R over a rounded shoulder ([`outline`]).
//!
//! Lagrangian, stationary in displacement u, cell pressures p and contact forces f >= 0 of the surface nodes with gap
//! g: `L = int mu/2 (I1 J^(-2/3) - 3) + p (J - 1) - p^2/(2 K) dV - sum (f g + f^2/(2 k_c)) + far`. p and f are
//! condensed out of every Newton step. The node on the axis stays at the apex.
//!
//! Small strain: `F = (2/pi) E* delta^2 tan(alpha)`, `E* = E/(1 - nu^2) = 2 mu/(1 - nu)` (Love 1939; Sneddon 1965);
//! mean displacement under an even load on a disc of radius R_s: `16 F/(3 pi^2 E* R_s)`. At large strain F/delta^2
//! stays constant as long as only the cone touches: nothing but delta sets a length.
//!
//! Limits of the model, not of the mesh: under a slender tip that slides without friction, neo-Hookean tissue next to
//! the apex is drawn out without bound (its energy grows with the square of the stretch only), and the tip breaks
//! through; the force falls slowly as the mesh gets finer and the curve ends. Tissue that sticks where it has been
//! touched has a limit. An even dead load above about one mu makes a free surface buckle in waves of any length; two
//! cells over the disc leave them out.

mod cell;
mod curve;
mod mesh;
mod outline;

use super::mixed_cell::{CELL_DOFS, FIXED, PressureStep, condense};
use super::skyline::SkylineMatrix;
use cell::{cell_system, deformation, volume_ratio};
pub use curve::{CurveLimit, IndentationCurve, IndentationFailure, IndentationPoint};
pub use mesh::Domain;
use mesh::{IndentationMesh, IndentationMeshSize, InnerRings};
use outline::{Gap, Outline};

/// Stiffness of a contact node over mu R.
const CONTACT_STIFFNESS: f64 = 1e7;
/// Newton steps at most.
const NEWTON_MAX: usize = 25;
/// Halvings of Newton steps that turn cells inside out, in one solution.
const BACKTRACKS: usize = 12;
/// Converged if the last Newton step moved no node by more than this part of the innermost cell. What is left is its
/// square.
const STEP_TOLERANCE: f64 = 1e-3;
/// Least growth of the load from one solution to the next before the curve is given up.
const LEAST_GROWTH: f64 = 5e-4;

/// What happens where tissue touches the indenter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ContactLaw {
    /// It slides without friction.
    Sliding,
    /// It stays where it has touched until it is pulled off.
    Sticking,
}

/// What is pressed into what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IndentationOptions {
    /// Angle between the axis and the flank of the tip [rad], below pi/2.
    pub half_angle: f64,
    /// Bulk modulus over shear modulus.
    pub bulk_over_mu: f64,
    /// Friction.
    pub contact: ContactLaw,
    /// If given, no indenter: an axial dead load spread evenly over a disc of this rest radius [R].
    pub disc: Option<f64>,
    /// Cells over the radius of the disc.
    pub disc_cells: usize,
    /// Size of the cells at the apex [R]: tissue within it is not resolved, and so not drawn out without bound.
    pub core: f64,
    /// Fineness of the rest of the mesh, 1 for errors of about 1 %.
    pub refinement: f64,
    /// Largest relative growth of the load from one solution to the next.
    pub growth: f64,
    /// The body.
    pub domain: Domain,
}

impl IndentationOptions {
    /// A tip with sticking contact on a half space. The core is the smallest with which forces of 40 mu R^2 were
    /// reached.
    pub fn tip(half_angle: f64, bulk_over_mu: f64) -> Self {
        Self {
            half_angle,
            bulk_over_mu,
            contact: ContactLaw::Sticking,
            disc: None,
            disc_cells: 2,
            core: 0.2 * (0.25 / half_angle.tan()).powf(3.2).clamp(1.0, 3.0),
            refinement: 1.0,
            growth: 0.05,
            domain: Domain::HalfSpace { radius: 60.0 },
        }
    }

    /// An even load over a disc of rest radius `disc` [R] on a half space.
    pub fn even_load(disc: f64, bulk_over_mu: f64) -> Self {
        Self { disc: Some(disc), ..Self::tip(std::f64::consts::FRAC_PI_4, bulk_over_mu) }
    }

    /// `E* = E/(1 - nu^2)` over mu.
    pub fn contact_modulus(&self) -> f64 {
        2.0 / (1.0 - self.poisson())
    }

    fn poisson(&self) -> f64 {
        (3.0 * self.bulk_over_mu - 2.0) / (6.0 * self.bulk_over_mu + 2.0)
    }

    fn mesh_size(&self) -> IndentationMeshSize {
        let inner = if self.disc.is_some() { InnerRings::Even(self.disc_cells) } else { InnerRings::Core(self.core) };
        IndentationMeshSize {
            rays: (12.0 * self.refinement).round().max(2.0) as usize,
            ring_ratio: 1.0 + 0.2 / self.refinement,
            inner,
            disc: self.disc.unwrap_or(1.0),
        }
    }
}

/// Follows the curve from rest to the limit.
pub fn indentation_curve(options: &IndentationOptions, limit: &CurveLimit) -> IndentationCurve {
    Indentation::new(options).follow(limit, &mut |_| {})
}

/// Unknowns.
#[derive(Clone, Debug)]
struct State {
    /// Depth of the tip [R], or dead load [mu R^2].
    load: f64,
    /// Displacement of the nodes [R].
    u: Vec<[f64; 2]>,
    /// Pressure modes of the cells [mu].
    p: Vec<[f64; 3]>,
    /// Normal contact force of every surface node [mu R^2].
    contact: Vec<f64>,
    /// Where a touching node sticks to the indenter: radius and height above the apex [R].
    anchor: Vec<Option<[f64; 2]>>,
}

impl State {
    /// `self + part (self - other)`.
    fn extrapolated(&self, other: &Self, part: f64) -> Self {
        let mix = |a: f64, b: f64| a + part * (a - b);
        Self {
            load: mix(self.load, other.load),
            u: self.u.iter().zip(&other.u).map(|(a, b)| std::array::from_fn(|d| mix(a[d], b[d]))).collect(),
            p: self.p.iter().zip(&other.p).map(|(a, b)| std::array::from_fn(|d| mix(a[d], b[d]))).collect(),
            contact: self.contact.iter().zip(&other.contact).map(|(&a, &b)| mix(a, b).max(0.0)).collect(),
            anchor: self.anchor.clone(),
        }
    }
}

/// The discrete problem: mesh, law and work space.
pub struct Indentation {
    options: IndentationOptions,
    /// Size of the innermost cell [R].
    core: f64,
    outline: Outline,
    mesh: IndentationMesh,
    matrix: SkylineMatrix,
    rhs: Vec<f64>,
    pressure_step: Vec<PressureStep>,
    /// Newton steps done so far.
    pub iterations: usize,
}

impl Indentation {
    /// Sets up the mesh.
    pub fn new(options: &IndentationOptions) -> Self {
        let mesh = IndentationMesh::new(&options.domain, &options.mesh_size());
        Self {
            options: *options,
            core: mesh.surface.get(1).map_or(options.core, |&node| mesh.rest[node][0]),
            outline: Outline::new(options.half_angle),
            matrix: SkylineMatrix::new(mesh.profile()),
            rhs: vec![0.0; mesh.equation_count],
            pressure_step: vec![PressureStep::ZERO; mesh.cells.len()],
            mesh,
            iterations: 0,
        }
    }

    /// Follows the curve from rest to the limit; `report` is called with every equilibrium.
    pub fn follow(&mut self, limit: &CurveLimit, report: &mut dyn FnMut(&IndentationPoint)) -> IndentationCurve {
        let surface = self.mesh.surface.len();
        let rest = State {
            load: 0.0,
            u: vec![[0.0; 2]; self.mesh.rest.len()],
            p: vec![[0.0; 3]; self.mesh.cells.len()],
            contact: vec![0.0; surface],
            anchor: vec![None; surface],
        };
        let mut curve = IndentationCurve { points: vec![IndentationPoint::default()], failure: None };
        let end = if self.options.disc.is_some() { limit.force } else { limit.depth };
        let mut step = if self.options.disc.is_some() { 1e-3 * end } else { 0.25 * self.core };
        let floor = step;
        let (mut old, mut now): (Option<State>, _) = (None, rest);
        while now.load < end * (1.0 - 1e-9) {
            step = step.min(end - now.load);
            let mut next = match &old {
                Some(old) => now.extrapolated(old, step / (now.load - old.load)),
                None => now.clone(),
            };
            next.load = now.load + step;
            let before = self.iterations;
            match self.solve(&mut next, &now) {
                Ok(()) => {
                    if self.options.contact == ContactLaw::Sticking {
                        self.stick(&mut next);
                    }
                    let point = self.point(&next);
                    report(&point);
                    curve.points.push(point);
                    old = Some(std::mem::replace(&mut now, next));
                    let quick = self.iterations - before < 9;
                    step = (step * if quick { 1.5 } else { 0.8 }).min((self.options.growth * now.load).max(floor));
                    if point.force > limit.force {
                        break;
                    }
                }
                Err(failure) => {
                    step *= 0.5;
                    if step < LEAST_GROWTH * now.load || step < 1e-6 {
                        curve.failure = Some(failure);
                        break;
                    }
                }
            }
        }
        curve
    }

    /// Newton iteration to equilibrium at `state.load`. `inside` is a state without inverted cells, towards which the
    /// guess is moved.
    fn solve(&mut self, state: &mut State, inside: &State) -> Result<(), IndentationFailure> {
        let load = state.load;
        let mut active = self.contact_set(state);
        let mut before = inside.clone();
        let mut shortened = 0;
        for _ in 0..NEWTON_MAX {
            self.iterations += 1;
            if let Err(e) = self.assemble(state, &active) {
                shortened += 1;
                if shortened > BACKTRACKS {
                    return Err(e);
                }
                *state = state.extrapolated(&before, -0.5);
                state.load = load;
                active = self.contact_set(state);
                continue;
            }
            let negative = self.matrix.factor().map_err(|_| IndentationFailure::Singular)?;
            self.matrix.solve(&mut self.rhs);
            before = state.clone();
            let step = self.apply_step(state, &active);
            if !step.is_finite() || step > 100.0 {
                return Err(IndentationFailure::NotConverged);
            }
            let next = self.contact_set(state);
            let settled = next == active;
            active = next;
            if settled && step < STEP_TOLERANCE * self.core {
                // p and f are (nearly) exact multipliers: the condensed tangent is definite if and only if the
                // equilibrium is stable
                return if negative == 0 { Ok(()) } else { Err(IndentationFailure::Unstable) };
            }
        }
        Err(IndentationFailure::NotConverged)
    }

    /// Radius and height above the apex of a surface node.
    fn place(&self, state: &State, k: usize) -> [f64; 2] {
        let node = self.mesh.surface[k];
        [self.mesh.rest[node][0] + state.u[node][0], self.mesh.rest[node][1] + state.u[node][1] + state.load]
    }

    /// Gap between a surface node and the indenter; the one on the axis is held at the apex.
    fn gap(&self, state: &State, k: usize) -> Gap {
        let x = self.place(state, k);
        if k == 0 {
            return Gap { value: -x[1], normal: [0.0, -1.0], curvature: 0.0 };
        }
        self.outline.gap(x[0], x[1])
    }

    /// Lets every node that touches stick where it is.
    fn stick(&self, state: &mut State) {
        for k in 1..state.contact.len() {
            let touches = state.contact[k] > 0.0;
            state.anchor[k] = if touches { state.anchor[k].or(Some(self.place(state, k))) } else { None };
        }
    }

    /// Tangent at the place where a node sticks, and how far the node is from it along that [R].
    fn slip(&self, state: &State, k: usize) -> Option<([f64; 2], f64)> {
        let anchor = state.anchor[k]?;
        let n = self.outline.gap(anchor[0], anchor[1]).normal;
        let (t, x) = ([-n[1], n[0]], self.place(state, k));
        Some((t, t[0] * (x[0] - anchor[0]) + t[1] * (x[1] - anchor[1])))
    }

    /// Which surface nodes touch: the one at the apex, those pushed, and those inside the indenter.
    fn contact_set(&self, state: &mut State) -> Vec<bool> {
        if self.options.disc.is_some() {
            return vec![false; self.mesh.surface.len()];
        }
        let on = |k: usize| {
            let force = state.contact[k];
            k == 0 || if force != 0.0 { force > 0.0 } else { self.gap(state, k).value <= 0.0 }
        };
        let active: Vec<bool> = (0..self.mesh.surface.len()).map(on).collect();
        for (force, on) in state.contact.iter_mut().zip(&active) {
            if !on {
                *force = 0.0;
            }
        }
        active
    }

    /// Condensed tangent and right-hand side at `state`.
    fn assemble(&mut self, state: &State, active: &[bool]) -> Result<(), IndentationFailure> {
        self.matrix.clear();
        self.rhs.fill(0.0);
        let bulk = self.options.bulk_over_mu;
        for (c, cell) in self.mesh.cells.iter().enumerate() {
            let mut system = cell_system(cell, &state.u, &state.p[c], bulk).ok_or(IndentationFailure::Inverted)?;
            let step = condense(cell, bulk, &mut system);
            for i in 0..CELL_DOFS {
                let row = cell.equations[i];
                if row == FIXED {
                    continue;
                }
                self.rhs[row] -=
                    system.force[i] + (0..3).map(|m| system.coupling[m][i] * step.constant[m]).sum::<f64>();
                for (j, (&column, &value)) in cell.equations[..=i].iter().zip(&system.tangent[i]).enumerate() {
                    if column != FIXED {
                        // a pair of components of the collapsed node stands for both triangles
                        let twice = if column == row && j != i { 2.0 } else { 1.0 };
                        self.matrix.add(row.max(column), row.min(column), twice * value);
                    }
                }
            }
            self.pressure_step[c] = step;
        }
        let stiffness = self.far_stiffness();
        for far in &self.mesh.far {
            let (n, k) = (far.normal, stiffness * far.area_over_radius);
            let outwards = state.u[far.node][0] * n[0] + state.u[far.node][1] * n[1];
            add_spring(&mut self.matrix, &mut self.rhs, self.mesh.equations[far.node], n, [k, 0.0], -k * outwards);
        }
        if self.options.disc.is_some() {
            for (&node, part) in self.mesh.surface.iter().zip(&self.mesh.disc_load) {
                if self.mesh.equations[node][1] != FIXED {
                    self.rhs[self.mesh.equations[node][1]] -= state.load * part;
                }
            }
        }
        self.assemble_contact(state, active);
        Ok(())
    }

    /// Radial stiffness of the half space outside the far hemisphere times its radius, over mu: exact on the axis for
    /// the field of a point load (Boussinesq), everywhere if nu = 1/2.
    fn far_stiffness(&self) -> f64 {
        6.0 / (3.0 - 2.0 * self.options.poisson())
    }

    /// Contact of the active surface nodes, their forces condensed out.
    fn assemble_contact(&mut self, state: &State, active: &[bool]) {
        let k = CONTACT_STIFFNESS;
        for node in (0..active.len()).filter(|&node| active[node]) {
            let equations = self.mesh.equations[self.mesh.surface[node]];
            let gap = self.gap(state, node);
            let stiffness = [k, -state.contact[node] * gap.curvature];
            add_spring(&mut self.matrix, &mut self.rhs, equations, gap.normal, stiffness, -k * gap.value);
            if let Some((t, slip)) = self.slip(state, node) {
                add_spring(&mut self.matrix, &mut self.rhs, equations, t, [k, 0.0], -k * slip);
            }
        }
    }

    /// Adds the solved Newton step to all unknowns, shortened if large; the largest displacement before that.
    fn apply_step(&self, state: &mut State, active: &[bool]) -> f64 {
        let change = |node: usize| self.mesh.equations[node].map(|e| if e == FIXED { 0.0 } else { self.rhs[e] });
        let largest = self.rhs.iter().fold(0.0, |m: f64, d| if d.is_finite() { m.max(d.abs()) } else { f64::INFINITY });
        if !largest.is_finite() {
            return largest;
        }
        let part = (0.5 * (state.load + self.core) / largest).min(1.0);
        for ((cell, dp), p) in self.mesh.cells.iter().zip(&self.pressure_step).zip(&mut state.p) {
            for (m, p_m) in p.iter_mut().enumerate() {
                let free = cell.equations.iter().zip(&dp.by_u[m]).filter(|&(&e, _)| e != FIXED);
                *p_m += part * (dp.constant[m] + free.map(|(&e, d)| d * self.rhs[e]).sum::<f64>());
            }
        }
        for k in (0..active.len()).filter(|&k| active[k]) {
            let (gap, du) = (self.gap(state, k), change(self.mesh.surface[k]));
            let target = -CONTACT_STIFFNESS * (gap.value + gap.normal[0] * du[0] + gap.normal[1] * du[1]);
            state.contact[k] += part * (target - state.contact[k]);
        }
        for (node, u) in state.u.iter_mut().enumerate() {
            let du = change(node);
            u[0] += part * du[0];
            u[1] += part * du[1];
        }
        largest
    }

    /// What the state means.
    fn point(&self, state: &State) -> IndentationPoint {
        let energy = self.energy(state);
        if self.options.disc.is_some() {
            let mean = self.mesh.surface.iter().zip(&self.mesh.disc_load).map(|(&n, part)| -part * state.u[n][1]).sum();
            return IndentationPoint { depth: mean, force: state.load, energy, ..Default::default() };
        }
        let axial = |k: usize| {
            let along = self.slip(state, k).map_or(0.0, |(t, slip)| CONTACT_STIFFNESS * slip * t[1]);
            along - state.contact[k] * self.gap(state, k).normal[1]
        };
        let touching = |k: &usize| state.contact[*k] > 0.0;
        let last = (0..state.contact.len()).rfind(touching).unwrap_or(0);
        let node = self.mesh.surface[last];
        let (x, u) = (self.mesh.rest[node], state.u[node]);
        IndentationPoint {
            depth: state.load,
            force: axial(0) + (1..state.contact.len()).filter(touching).map(axial).sum::<f64>(),
            energy,
            contact_radius: x[0] + u[0],
            contact_rest_radius: x[0],
            contact_edge_depth: -u[1],
        }
    }

    /// Stored energy [mu R^3].
    fn energy(&self, state: &State) -> f64 {
        let mut sum = 0.0;
        for (cell, p) in self.mesh.cells.iter().zip(&state.p) {
            for point in &cell.points {
                let f = deformation(cell, point, &state.u);
                let pressure = p[0] * point.mode[0] + p[1] * point.mode[1] + p[2] * point.mode[2];
                let first: f64 = f.iter().map(|x| x * x).sum();
                let isochoric = first * volume_ratio(&f).powf(-2.0 / 3.0) - 3.0;
                sum += 0.5 * point.weight * (isochoric + pressure * pressure / self.options.bulk_over_mu);
            }
        }
        for far in &self.mesh.far {
            let outwards = state.u[far.node][0] * far.normal[0] + state.u[far.node][1] * far.normal[1];
            sum += 0.5 * self.far_stiffness() * far.area_over_radius * outwards * outwards;
        }
        sum
    }
}

/// Adds a spring of one node, with its stiffness along and across the unit vector `n`, and a force along `n`.
fn add_spring(
    matrix: &mut SkylineMatrix,
    rhs: &mut [f64],
    equations: [usize; 2],
    n: [f64; 2],
    [along, across]: [f64; 2],
    force: f64,
) {
    for i in 0..2 {
        if equations[i] == FIXED {
            continue;
        }
        rhs[equations[i]] += force * n[i];
        for j in 0..=i {
            if equations[j] != FIXED {
                let unit = if i == j { 1.0 } else { 0.0 };
                matrix.add(equations[i], equations[j], along * n[i] * n[j] + across * (unit - n[i] * n[j]));
            }
        }
    }
}
