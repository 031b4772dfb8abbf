//! A flexible needle: corotational Euler-Bernoulli beam in space, clamped in its hub. CPU, f64.
//!
//! Every node carries a position `x` and a unit tangent `t`. An element of rest length `h` between two nodes has the chord
//! `d = x2 - x1`, `l = |d|`, `e = d/l` and the end slopes against its chord `w_i = e x t_i`, `c_i = e . t_i`:
//! ```text
//! q_ii = (1 - c_i^2)/3 + 4 (1 - c_i)/3,   q_12 = w_1 . w_2
//! energy     E/2h A (l - h + h/30 (2 q11 - q12 + 2 q22))^2 + 2 E I/h (q11 + q12 + q22)                              [J]
//! ```
//! the strain energy of a cubic deflection over the chord, in which the axial strain counts the length that the deflection
//! takes up, averaged over the element (shallow arch, [Crisfield1991], Ch. 7). `q_ii` stands for the square of the angle; of
//! the functions with that limit it is the one whose sum with `q_12` is exact to the fourth order on a circle. The chord turns with the element, so that
//! rigid turns of any size store nothing; forces and tangent stiffness are the exact derivatives of the energy.
//! Torsion is left out: a round section bends alike in all directions, and what turns the needle about its own axis is
//! prescribed at the hub. Shear is left out: 0.2 % of the deflection at a slenderness of 50 (Timoshenko).
//!
//! Time: implicit, as the minimum of a potential, `Pi(y) = energy - loads . y + springs + c/2 m |x - x*|^2`, by Newton's
//! method on the tangents' spheres with a shifted band factor and a line search, so that a needle that buckles goes down
//! into its bent state instead of running away. Mass is lumped into the positions; tangents carry none.
//! ```text
//! backward Euler   c = 1/dt^2,  x* = x + dt v,              v+ = (x+ - x)/dt
//! trapezoidal      c = 4/dt^2,  x* = x + dt v + dt^2/4 a,   v+ = v + dt/2 (a + a+),  a+ = c (x+ - x*)
//! ```
//! Range of validity: small strain (slopes within an element below 0.3 rad), large rotation.

mod element;
mod parts;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::banded::{BandFactor, SymmetricBand};
use super::lateral_axes;
use element::{Element, cubic_shape};
pub use parts::*;

/// Unknowns per node: three of the position, two of the tangent.
const NODE: usize = 5;

/// Newton iterations of one solution before it is called not converged.
const ITERATIONS: usize = 400;

/// Largest turn of a tangent or a chord in one Newton iteration [rad].
const LARGEST_TURN: f64 = 0.3;

/// State of a flexible needle.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Beam {
    pub params: BeamParams,
    hub: HubPose,
    /// Node positions [m], from hub to tip.
    pub position: Vec<DVec3>,
    /// Unit tangents, towards the tip.
    pub tangent: Vec<DVec3>,
    /// Node velocities [m/s].
    pub velocity: Vec<DVec3>,
    acceleration: Vec<DVec3>,
    /// What the hub exerted at the end of the last step.
    hub_force: DVec3,
    hub_moment: DVec3,
}

/// Inertia in the potential: `c` [1/s^2] and where the nodes would go without forces [m].
struct Inertia {
    c: f64,
    aim: Vec<DVec3>,
}

/// Potential of a needle and its derivatives.
struct Slopes {
    /// Derivative by positions [N] and by tangents in space [N m].
    position: Vec<DVec3>,
    tangent: Vec<DVec3>,
    /// The same for the unknowns: nodes 1.., position and tangent plane.
    reduced: Vec<f64>,
    /// Sum of the magnitudes of nodal forces, for what counts as zero [N].
    scale: f64,
}

impl Beam {
    /// A straight needle at rest.
    pub fn straight(params: BeamParams, hub: HubPose) -> Self {
        assert!(params.elements > 0 && params.length > 0.0, "a needle has a length and at least one element");
        let count = params.elements + 1;
        let h = params.length / params.elements as f64;
        Beam {
            params,
            hub,
            position: (0..count).map(|i| hub.position + hub.direction * (h * i as f64)).collect(),
            tangent: vec![hub.direction; count],
            velocity: vec![hub.velocity; count],
            acceleration: vec![DVec3::ZERO; count],
            hub_force: DVec3::ZERO,
            hub_moment: DVec3::ZERO,
        }
    }

    pub fn node_count(&self) -> usize {
        self.position.len()
    }

    pub fn hub(&self) -> HubPose {
        self.hub
    }

    /// Rest length of an element h [m].
    pub fn element_length(&self) -> f64 {
        self.params.length / self.params.elements as f64
    }

    /// Lumped mass of a node [kg].
    pub fn node_mass(&self, node: usize) -> f64 {
        let whole = self.params.line_mass() * self.element_length();
        if node == 0 || node == self.params.elements { 0.5 * whole } else { whole }
    }

    /// No loads yet.
    pub fn loads(&self) -> Loads {
        let count = self.node_count();
        Loads {
            force: vec![DVec3::ZERO; count],
            slope_force: vec![DVec3::ZERO; count],
            springs: vec![None; count],
            gravity: DVec3::ZERO,
        }
    }

    /// Element and local coordinate 0..1 of the arc position `s` from the hub [m].
    fn locate(&self, s: f64) -> (usize, f64) {
        let at = (s / self.element_length()).clamp(0.0, self.params.elements as f64);
        let element = (at as usize).min(self.params.elements - 1);
        (element, at - element as f64)
    }

    /// Adds a force [N] at the arc position `s` from the hub [m]: shared over positions and tangents of its element as the
    /// deflection is, so that `force . dx(s)` is its work.
    pub fn add_force(&self, loads: &mut Loads, s: f64, force: DVec3) {
        let (element, at) = self.locate(s);
        let shape = cubic_shape(at, self.element_length());
        loads.force[element] += force * shape[0];
        loads.slope_force[element] += force * shape[1];
        loads.force[element + 1] += force * shape[2];
        loads.slope_force[element + 1] += force * shape[3];
    }

    /// Adds a constant force per length [N/m] on the whole needle.
    pub fn add_line_force(&self, loads: &mut Loads, per_length: DVec3) {
        let h = self.element_length();
        for element in 0..self.params.elements {
            loads.force[element] += per_length * (0.5 * h);
            loads.slope_force[element] += per_length * (h * h / 12.0);
            loads.force[element + 1] += per_length * (0.5 * h);
            loads.slope_force[element + 1] -= per_length * (h * h / 12.0);
        }
    }

    /// Adds a moment [N m] at a node; it acts across the tangent that the node has now.
    pub fn add_moment(&self, loads: &mut Loads, node: usize, moment: DVec3) {
        loads.slope_force[node] += moment.cross(self.tangent[node]);
    }

    /// Position of the centre-line at the arc position `s` from the hub [m].
    pub fn position_at(&self, s: f64) -> DVec3 {
        let (i, at) = self.locate(s);
        let shape = cubic_shape(at, self.element_length());
        self.position[i] * shape[0]
            + self.tangent[i] * shape[1]
            + self.position[i + 1] * shape[2]
            + self.tangent[i + 1] * shape[3]
    }

    pub fn tip(&self) -> DVec3 {
        *self.position.last().expect("a needle has nodes")
    }

    /// Where the tip is off the straight needle [m].
    pub fn tip_deflection(&self) -> DVec3 {
        self.tip() - self.hub.position - self.hub.direction * self.params.length
    }

    /// Angle between the tangent at the tip and the clamp [rad].
    pub fn tip_slope(&self) -> f64 {
        let tip = *self.tangent.last().expect("a needle has nodes");
        // By the sine as well: the cosine alone has no digits for a small angle.
        self.hub.direction.cross(tip).length().atan2(self.hub.direction.dot(tip))
    }

    /// Stored and kinetic energy [J].
    pub fn energy(&self) -> BeamEnergy {
        let (mut bending, mut stretching) = (0.0, 0.0);
        for i in 0..self.params.elements {
            let (b, s) = self.element(i).energy();
            bending += b;
            stretching += s;
        }
        let kinetic = self.velocity.iter().enumerate().map(|(n, v)| 0.5 * self.node_mass(n) * v.length_squared()).sum();
        BeamEnergy { bending, stretching, kinetic }
    }

    /// Axial force of each element, tension positive [N].
    pub fn axial_forces(&self) -> Vec<f64> {
        (0..self.params.elements).map(|i| self.element(i).axial_force()).collect()
    }

    fn element(&self, i: usize) -> Element {
        let d = self.position[i + 1] - self.position[i];
        let h = self.element_length();
        let l = d.length();
        Element {
            h,
            l,
            e: d / l,
            t: [self.tangent[i], self.tangent[i + 1]],
            axial: self.params.axial_stiffness() / h,
            bending: 2.0 * self.params.bending_stiffness() / h,
        }
    }

    /// Weight of the needle as consistent loads.
    fn with_weight(&self, loads: &Loads) -> Loads {
        let mut all = loads.clone();
        self.add_line_force(&mut all, loads.gravity * self.params.line_mass());
        all
    }

    /// Potential [J]; `loads` with the weight in them.
    fn potential(&self, loads: &Loads, inertia: Option<&Inertia>, origin: DVec3) -> f64 {
        let stored: f64 = (0..self.params.elements)
            .map(|i| {
                let (b, s) = self.element(i).energy();
                b + s
            })
            .sum();
        let mut rest = 0.0;
        for n in 0..self.node_count() {
            // About the clamp, so that a far origin costs no digits.
            rest -= loads.force[n].dot(self.position[n] - origin) + loads.slope_force[n].dot(self.tangent[n]);
            if let Some(spring) = &loads.springs[n] {
                rest += spring.energy(self.position[n]);
            }
            if let Some(inertia) = inertia.filter(|_| n > 0) {
                rest += 0.5 * inertia.c * self.node_mass(n) * (self.position[n] - inertia.aim[n]).length_squared();
            }
        }
        stored + rest
    }

    /// First derivatives, and the tangent stiffness where it is asked for. Directions are measured as turn times h, so that
    /// all unknowns are lengths.
    fn derivatives(&self, loads: &Loads, inertia: Option<&Inertia>) -> (Slopes, SymmetricBand) {
        let count = self.node_count();
        let h = self.element_length();
        let planes: Vec<[DVec3; 2]> = self
            .tangent
            .iter()
            .map(|t| {
                let (a, b) = lateral_axes(*t);
                [a / h, b / h]
            })
            .collect();
        let mut position = vec![DVec3::ZERO; count];
        let mut tangent = vec![DVec3::ZERO; count];
        let mut scale = 0.0;
        let mut band = SymmetricBand::new(NODE * (count - 1), 2 * NODE - 1);
        for i in 0..self.params.elements {
            let element = self.element(i);
            let (gradient, hessian) = element.derivatives();
            let part = |at: usize| DVec3::new(gradient[at], gradient[at + 1], gradient[at + 2]);
            position[i] -= part(0);
            position[i + 1] += part(0);
            tangent[i] += part(3);
            tangent[i + 1] += part(6);
            scale += part(0).length();
            // From (d, t1, t2) to the ten unknowns of the element's nodes.
            let mut map = [[0.0; 2 * NODE]; 9];
            for a in 0..3 {
                map[a][a] = -1.0;
                map[a][NODE + a] = 1.0;
                for k in 0..2 {
                    map[3 + a][3 + k] = planes[i][k][a];
                    map[6 + a][NODE + 3 + k] = planes[i + 1][k][a];
                }
            }
            let half: [[f64; 2 * NODE]; 9] =
                hessian.map(|row| std::array::from_fn(|c| (0..9).map(|k| row[k] * map[k][c]).sum()));
            let stiffness = |r: usize, c: usize| -> f64 { (0..9).map(|k| map[k][r] * half[k][c]).sum() };
            for r in 0..2 * NODE {
                for c in 0..=r {
                    let (row, column) = (NODE * i + r, NODE * i + c);
                    if column >= NODE {
                        band.add(row - NODE, column - NODE, stiffness(r, c));
                    }
                }
            }
        }
        for n in 0..count {
            position[n] -= loads.force[n];
            tangent[n] -= loads.slope_force[n];
            scale += loads.force[n].length() + loads.slope_force[n].length() / h;
            let mut stiffness = DMat3::ZERO;
            if let Some(spring) = &loads.springs[n] {
                let force = spring.force(self.position[n]);
                position[n] -= force;
                scale += force.length();
                stiffness += spring.stiffness;
            }
            if n == 0 {
                continue;
            }
            if let Some(inertia) = inertia {
                let force = (self.position[n] - inertia.aim[n]) * (inertia.c * self.node_mass(n));
                position[n] += force;
                scale += force.length();
                stiffness += DMat3::from_diagonal(DVec3::splat(inertia.c * self.node_mass(n)));
            }
            let at = NODE * (n - 1);
            for r in 0..3 {
                for c in 0..=r {
                    band.add(at + r, at + c, stiffness.col(c)[r]);
                }
            }
            // On a sphere the second derivative along it loses what the normal part of the first one adds.
            let normal = tangent[n].dot(self.tangent[n]) / (h * h);
            band.add(at + 3, at + 3, -normal);
            band.add(at + 4, at + 4, -normal);
        }
        let mut reduced = Vec::with_capacity(NODE * (count - 1));
        for n in 1..count {
            reduced.extend(position[n].to_array());
            reduced.extend(planes[n].iter().map(|p| p.dot(tangent[n])));
        }
        (Slopes { position, tangent, reduced, scale }, band)
    }

    /// This needle moved by `step` times `part`; `turning`: chords turn and lengthen instead of moving straight.
    fn moved(&self, step: &[f64], part: f64, turning: bool) -> Beam {
        let h = self.element_length();
        let mut next = self.clone();
        let change = |n: usize| match n {
            0 => DVec3::ZERO,
            _ => DVec3::from_slice(&step[NODE * (n - 1)..]) * part,
        };
        for n in 1..self.node_count() {
            next.position[n] = if turning {
                let d = self.position[n] - self.position[n - 1];
                let delta = change(n) - change(n - 1);
                let length = d.length() + delta.dot(d.normalize());
                next.position[n - 1] + (d + delta).normalize() * length
            } else {
                self.position[n] + change(n)
            };
            let (a, b) = lateral_axes(self.tangent[n]);
            let turn = &step[NODE * (n - 1) + 3..];
            next.tangent[n] = (self.tangent[n] + (a * turn[0] + b * turn[1]) * (part / h)).normalize();
        }
        next
    }

    /// Largest turn of a tangent or chord in `step` [rad].
    fn largest_turn(&self, step: &[f64]) -> f64 {
        let h = self.element_length();
        let mut last = DVec3::ZERO;
        let mut largest: f64 = 0.0;
        for n in 1..self.node_count() {
            let at = NODE * (n - 1);
            let change = DVec3::from_slice(&step[at..]);
            let delta = (change - last).length() / h;
            last = change;
            largest = largest.max(delta).max(step[at + 3].hypot(step[at + 4]) / h);
        }
        largest
    }

    /// Moves to the minimum of the potential. Returns iterations, whether it converged, and whether a saddle was left.
    fn minimise(&mut self, loads: &Loads, inertia: Option<&Inertia>) -> (usize, bool, bool) {
        let origin = self.hub.position;
        // What rounding leaves of the axial force of an element.
        let noise = 1e-14 * self.params.axial_stiffness() * (1.0 + self.params.length / self.element_length());
        let mut buckled = false;
        for iteration in 0..ITERATIONS {
            let (slopes, band) = self.derivatives(loads, inertia);
            let residual = slopes.reduced.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            let balanced = residual <= 1e-9 * slopes.scale + noise;
            let factor = band.clone().factor();
            if balanced && factor.negative_pivots == 0 {
                return (iteration, true, buckled);
            }
            let (factor, stable) = definite(&band, factor);
            if balanced {
                // A balance that is no minimum: the straight needle above its critical load. Leave it along its softest mode.
                buckled = true;
                let mode = self.softest_mode(&factor);
                *self = self.moved(&mode, 1.0, true);
                continue;
            }
            let downhill: Vec<f64> = slopes.reduced.iter().map(|r| -r).collect();
            let step = factor.solve(&downhill);
            let slope: f64 = step.iter().zip(&slopes.reduced).map(|(s, r)| s * r).sum();
            let start = self.potential(loads, inertia, origin);
            let rounding = 1e-13 * (start.abs() + self.energy().total() + slopes.scale * self.params.length);
            let mut part = (LARGEST_TURN / self.largest_turn(&step)).min(1.0);
            let mut found = None;
            while part > 1e-12 {
                let tries = [true, false].map(|turning| {
                    let next = self.moved(&step, part, turning);
                    let value = next.potential(loads, inertia, origin);
                    (next, value)
                });
                let [a, b] = tries;
                // A comparison with NaN is false: a step that cannot be evaluated is never taken.
                let (next, value) = if b.1 < a.1 { b } else { a };
                if value <= start + 1e-4 * part * slope + rounding {
                    found = Some(next);
                    break;
                }
                part *= 0.5;
            }
            // Rounding may hide the rest of the descent.
            let good_enough = stable && residual <= 1e-6 * slopes.scale + 1e3 * noise;
            match found {
                Some(next) => *self = next,
                None => return (iteration, good_enough, buckled),
            }
            if good_enough && slope.abs() < 1e-4 * rounding {
                return (iteration + 1, true, buckled);
            }
        }
        (ITERATIONS, false, buckled)
    }

    /// The direction in which the (shifted) stiffness is softest, scaled to a hundredth of the length.
    fn softest_mode(&self, factor: &BandFactor) -> Vec<f64> {
        let (a, b) = lateral_axes(self.hub.direction);
        // One fixed start, so that equal runs buckle to the same side; both axes, so that no symmetry hides a mode.
        let aside = a + b * 0.3;
        let mut mode = vec![0.0; NODE * (self.node_count() - 1)];
        for n in 1..self.node_count() {
            let s = n as f64 / self.params.elements as f64;
            let x = aside * (s * s * (1.0 + 0.1 * (7.0 * s).sin()));
            mode[NODE * (n - 1)..NODE * (n - 1) + 3].copy_from_slice(&x.to_array());
        }
        for _ in 0..30 {
            mode = factor.solve(&mode);
            let largest = mode.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            mode.iter_mut().for_each(|x| *x *= 0.01 * self.params.length / largest);
        }
        mode
    }

    /// Puts the hub elsewhere and the needle with it, as a rigid body.
    fn carry(&mut self, hub: HubPose) {
        let turn = glam::DQuat::from_rotation_arc(self.hub.direction, hub.direction);
        for n in 0..self.node_count() {
            self.position[n] = hub.position + turn * (self.position[n] - self.hub.position);
            self.tangent[n] = turn * self.tangent[n];
        }
        self.hub = hub;
    }

    /// Quasi-static: moves to a stable balance under `loads` with the hub at `hub`. Velocities become those of the hub.
    pub fn settle(&mut self, hub: HubPose, loads: &Loads) -> BeamStep {
        let before = self.clone();
        self.carry(hub);
        let all = self.with_weight(loads);
        let done = self.minimise(&all, None);
        self.velocity.fill(hub.velocity);
        self.acceleration.fill(DVec3::ZERO);
        self.report(&before, loads, &all, done, DVec3::ZERO, 0.5)
    }

    /// One implicit step of `dt` [s] under constant `loads`, after which the hub is at `hub`.
    pub fn advance(&mut self, hub: HubPose, loads: &Loads, dt: f64, rule: TimeRule) -> BeamStep {
        let before = self.clone();
        let aim = |c: f64, a: f64| Inertia {
            c,
            aim: (0..before.node_count())
                .map(|n| before.position[n] + before.velocity[n] * dt + before.acceleration[n] * (a * dt * dt))
                .collect(),
        };
        let inertia = match rule {
            TimeRule::BackwardEuler => aim(1.0 / (dt * dt), 0.0),
            TimeRule::Trapezoidal => aim(4.0 / (dt * dt), 0.25),
        };
        self.carry(hub);
        let all = self.with_weight(loads);
        let done = self.minimise(&all, Some(&inertia));
        for n in 1..self.node_count() {
            let new = (self.position[n] - inertia.aim[n]) * inertia.c;
            self.velocity[n] = match rule {
                TimeRule::BackwardEuler => (self.position[n] - before.position[n]) / dt,
                TimeRule::Trapezoidal => before.velocity[n] + (before.acceleration[n] + new) * (0.5 * dt),
            };
            self.acceleration[n] = new;
        }
        self.velocity[0] = hub.velocity;
        // The clamped mass moves as the hub does.
        let clamped = (hub.velocity - before.hub.velocity) * (self.node_mass(0) / dt);
        let weight = match rule {
            TimeRule::BackwardEuler => 1.0,
            TimeRule::Trapezoidal => 0.5,
        };
        self.report(&before, loads, &all, done, clamped, weight)
    }

    /// Reaction and account of a step; `weight`: share of the reaction at its end in the work of the hub.
    fn report(
        &mut self,
        before: &Beam,
        loads: &Loads,
        all: &Loads,
        (iterations, converged, buckled): (usize, bool, bool),
        clamped: DVec3,
        weight: f64,
    ) -> BeamStep {
        let (slopes, _) = self.derivatives(all, None);
        let elastic = slopes.position[0];
        self.hub_force = elastic;
        self.hub_moment = self.tangent[0].cross(slopes.tangent[0]);
        let moved = self.position[0] - before.position[0];
        let turned = self.hub.direction.cross(before.hub.direction);
        // The turn vector from the old to the new direction.
        let turned = match turned.length() {
            sine if sine > 0.0 => -turned * (sine.asin() / sine),
            _ => DVec3::ZERO,
        };
        let mean = |new: DVec3, old: DVec3| new * weight + old * (1.0 - weight);
        let clamped_energy =
            0.5 * self.node_mass(0) * (self.velocity[0].length_squared() - before.velocity[0].length_squared());
        let hub_work = mean(self.hub_force, before.hub_force).dot(moved)
            + mean(self.hub_moment, before.hub_moment).dot(turned)
            + clamped_energy;
        let gravity = self.with_weight(&Loads { gravity: loads.gravity, ..self.loads() });
        let work = |l: &Loads| {
            (0..self.node_count())
                .map(|n| {
                    l.force[n].dot(self.position[n] - before.position[n])
                        + l.slope_force[n].dot(self.tangent[n] - before.tangent[n])
                })
                .sum::<f64>()
        };
        let spring_energy = loads
            .springs
            .iter()
            .enumerate()
            .filter_map(|(n, s)| s.map(|s| s.energy(self.position[n]) - s.energy(before.position[n])))
            .sum();
        let mut step = BeamStep {
            iterations,
            converged,
            buckled,
            hub_force: elastic + clamped,
            hub_moment: self.hub_moment,
            hub_work,
            load_work: work(loads),
            gravity_work: work(&gravity),
            spring_energy,
            dissipated: 0.0,
        };
        let gained = self.energy().total() - before.energy().total();
        step.dissipated = step.hub_work + step.load_work + step.gravity_work - step.spring_energy - gained;
        step
    }

    /// Number of unstable directions under `loads` in the present state: negative eigenvalues of the tangent stiffness.
    pub fn unstable_modes(&self, loads: &Loads) -> usize {
        let (_, band) = self.derivatives(&self.with_weight(loads), None);
        band.factor().negative_pivots
    }

    /// First frequency of small motion about the present state under `loads` [Hz]; inverse iteration.
    pub fn first_frequency(&self, loads: &Loads) -> f64 {
        let (_, band) = self.derivatives(&self.with_weight(loads), None);
        let factor = band.clone().factor();
        let mut mode = self.softest_mode(&factor);
        let mut square = 0.0;
        let mass_times = |x: &[f64]| -> Vec<f64> {
            let mass = |at: usize| if at % NODE < 3 { self.node_mass(at / NODE + 1) } else { 0.0 };
            x.iter().enumerate().map(|(at, x)| mass(at) * x).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        for _ in 0..30 {
            let inertia = mass_times(&mode);
            square = dot(&mode, &band.times(&mode)) / dot(&mode, &inertia);
            let next = factor.solve(&inertia);
            let largest = next.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
            mode = next.iter().map(|x| x / largest).collect();
        }
        square.sqrt() / std::f64::consts::TAU
    }
}

/// A factor without negative pivots: the matrix, or the matrix with as much added to its diagonal as it takes. The second
/// value tells whether nothing was added.
fn definite(band: &SymmetricBand, factor: BandFactor) -> (BandFactor, bool) {
    if factor.negative_pivots == 0 {
        return (factor, true);
    }
    let size = factor.size();
    let largest = (0..size).fold(0.0, |m: f64, i| m.max(band.diagonal(i).abs()));
    let mut shift = 1e-9 * largest;
    loop {
        let mut shifted = band.clone();
        (0..size).for_each(|i| shifted.add(i, i, shift));
        let factor = shifted.factor();
        // A finite band is definite once the shift passes its largest row sum; one that is not finite is given up.
        if factor.negative_pivots == 0 || shift > 1e3 * largest || !shift.is_finite() {
            return (factor, false);
        }
        shift *= 4.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gradient and Hessian of an element against central differences of energy and gradient.
    #[test]
    fn derivatives_follow_from_the_energy() {
        let build = |y: &[f64; 9]| {
            let d = DVec3::from_slice(&y[0..]);
            let t = [DVec3::from_slice(&y[3..]), DVec3::from_slice(&y[6..])];
            Element { h: 1.0, l: d.length(), e: d.normalize(), t, axial: 50.0, bending: 2.0 }
        };
        // The extension off the unit spheres that the derivatives use.
        let energy = |y: &[f64; 9]| {
            let element = build(y);
            let c = element.t.map(|t| element.e.dot(t));
            let square = |c: f64| (1.0 - c * c) / 3.0 + 4.0 / 3.0 * (1.0 - c);
            let q = [square(c[0]), element.t[0].dot(element.t[1]) - c[0] * c[1], square(c[1])];
            let long = element.l - 1.0 + (2.0 * q[0] - q[1] + 2.0 * q[2]) / 30.0;
            element.bending * (q[0] + q[1] + q[2]) + 0.5 * element.axial * long * long
        };
        let t1 = DVec3::new(0.2, -0.1, 1.0).normalize();
        let t2 = DVec3::new(-0.15, 0.25, 1.0).normalize();
        let y = [0.1, 0.05, 1.02, t1.x, t1.y, t1.z, t2.x, t2.y, t2.z];
        let (gradient, hessian) = build(&y).derivatives();
        let step = 1e-5;
        for a in 0..9 {
            let (mut up, mut down) = (y, y);
            up[a] += step;
            down[a] -= step;
            let slope = (energy(&up) - energy(&down)) / (2.0 * step);
            assert!((slope - gradient[a]).abs() < 1e-6, "gradient {a}: {} against {slope}", gradient[a]);
            // Off the spheres the axial force of `derivatives` uses |w|^2 = |t|^2 - c^2: compare along them only.
            let normal = if a < 3 { 0.0 } else { 1.0 };
            if normal == 0.0 {
                let (g1, g0) = (build(&up).derivatives().0, build(&down).derivatives().0);
                for b in 0..9 {
                    let slope = (g1[b] - g0[b]) / (2.0 * step);
                    assert!((slope - hessian[b][a]).abs() < 1e-5, "hessian {b} {a}: {} against {slope}", hessian[b][a]);
                }
            }
        }
        // Second differences of the energy for the tangents.
        for a in 3..9 {
            for b in 3..9 {
                let step = 1e-4;
                let at = |i: f64, j: f64| {
                    let mut z = y;
                    z[a] += i * step;
                    z[b] += j * step;
                    energy(&z)
                };
                let second = (at(1.0, 1.0) - at(1.0, -1.0) - at(-1.0, 1.0) + at(-1.0, -1.0)) / (4.0 * step * step);
                assert!((second - hessian[a][b]).abs() < 1e-5, "hessian {a} {b}: {} against {second}", hessian[a][b]);
            }
        }
    }
}
