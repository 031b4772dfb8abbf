//! A homogeneous sample: one material point that is pulled, squeezed or sheared, with sides that are free.
//!
//! ```text
//! uniaxial      F = diag(l, a, b)          P22 = P33 = 0
//! equibiaxial   F = diag(l, l, b)          P33 = 0
//! planar        F = diag(l, 1, b)          P33 = 0
//! shear         F = I + g e1 (x) e2        nothing free, J = 1
//! ```
//! Axis 1 is the loading axis. The free stretches `a`, `b` solve the vanishing nominal stress with the true bulk modulus,
//! by a damped Newton iteration; each trial advances a copy of the history. Shear strains that the mode does not name stay
//! zero, as between grips: fibres at an angle to the axes put a shear stress into the sample, they do not shear it.
//!
//! Time. A step of `dt` relaxes the Prony terms over `dt/2` with the stress at its beginning and over `dt/2` with that at
//! its end: the midpoint rule of `effects/viscoelastic.rs` with the terms brought to full steps, of second order for
//! steps that change.

use glam::DMat3;

use crate::effects::viscoelastic;
use crate::material::kinematics::{double_dot, jacobian_minus_one};
use crate::material::{Continuation, Mode};
use crate::material_point::{Material, PointEnergy, PointState, Surroundings};
use crate::{Error, Result};

/// One material point under a prescribed deformation with free axes.
#[derive(Debug, Clone)]
pub struct Sample<'m> {
    material: &'m Material,
    /// Edge of the cell that the damage regularisation sees [m].
    length: f64,
    pub state: PointState,
    /// H = F - I.
    pub displacement_gradient: DMat3,
    /// First Piola-Kirchhoff stress P [Pa].
    pub stress: DMat3,
    /// Time [s].
    pub time: f64,
    /// Work of the stress per rest volume since t = 0 [J/m^3], trapezoidal.
    pub work: f64,
}

/// Iterations after which the free stretches count as not found.
const NEWTON_ITERATIONS: usize = 60;
/// Halvings of one Newton step.
const HALVINGS: usize = 30;
/// Largest change of the logarithm of a free stretch in one iteration.
const LARGEST_LOG_STEP: f64 = 0.1;

impl<'m> Sample<'m> {
    /// At rest. `length`: edge of the cell for damage [m].
    pub fn new(material: &'m Material, length: f64) -> Self {
        Sample {
            material,
            length,
            state: PointState::default(),
            displacement_gradient: DMat3::ZERO,
            stress: DMat3::ZERO,
            time: 0.0,
            work: 0.0,
        }
    }

    fn surroundings(&self, dt: f64) -> Surroundings {
        Surroundings { length: self.length, dt, step: 0, remaining: 1.0, other_energy: 0.0 }
    }

    /// Degradation d.
    pub fn damage(&self) -> f64 {
        self.material.degradation(&self.state, self.length)
    }

    /// Jacobian J.
    pub fn jacobian(&self) -> f64 {
        1.0 + jacobian_minus_one(self.displacement_gradient)
    }

    /// Cauchy stress P F^T / J [Pa].
    pub fn cauchy(&self) -> DMat3 {
        self.stress * (DMat3::IDENTITY + self.displacement_gradient).transpose() * (1.0 / self.jacobian())
    }

    /// Energies per rest volume [J/m^3].
    pub fn energy(&self) -> PointEnergy {
        let h = self.displacement_gradient;
        self.material.energy(h, self.material.volumetric(h, 1.0).energy, 1.0 - self.damage(), &self.state)
    }

    /// Energy dissipated by flow, damage and relaxation per rest volume [J/m^3].
    pub fn dissipated(&self) -> f64 {
        let s = &self.state;
        s.plastic_dissipation + s.damage_dissipation + s.viscous_work - self.energy().viscous_stored
    }

    /// State and stress that the deformation `h` leaves, from `state`; the flag is false where flow failed.
    fn trial(&self, h: DMat3, dt: f64, state: &PointState) -> (PointState, DMat3, bool) {
        let mut state = state.clone();
        let energy = self.material.volumetric(h, 1.0).energy;
        let met = self.material.advance_every_term(h, energy, &self.surroundings(0.5 * dt), &mut state);
        let intact = 1.0 - self.material.degradation(&state, self.length);
        let stress = self.material.stress(h, self.material.volumetric(h, intact), intact, &state);
        (state, stress, met)
    }

    /// Goes to the deformation `h` within `dt` [s]; the stretches of the axes `free` are found, those in `h` ignored.
    ///
    /// An error says what was not found; the sample then stays where it was.
    pub fn step(&mut self, h: DMat3, free: &[usize], dt: f64) -> std::result::Result<(), String> {
        let mut start = self.state.clone();
        let old = self.displacement_gradient;
        let energy = self.material.volumetric(old, 1.0).energy;
        self.material.advance_every_term(old, energy, &self.surroundings(0.5 * dt), &mut start);

        let mut h = h;
        for &axis in free {
            h.col_mut(axis)[axis] = old.col(axis)[axis];
        }
        // The first guess keeps the volume; from far away the stress alone need not lead there.
        let ratio = (1.0 + jacobian_minus_one(old)) / (1.0 + jacobian_minus_one(h));
        if ratio > 0.0 && ratio.is_finite() {
            for &axis in free {
                let stretch = h.col(axis)[axis] + 1.0;
                h.col_mut(axis)[axis] = stretch * ratio.powf(1.0 / free.len() as f64) - 1.0;
            }
        }
        // Rounding of the volumetric stress is 1e-16 of the modulus.
        let tolerance = 1e-13 * self.material.law.p_wave_modulus().abs();
        let residual = |h: DMat3, p: &DMat3| lateral(h, p, free).iter().map(|s| s * s).sum::<f64>().sqrt();
        let mut found = self.trial(h, dt, &start);
        let mut rest = residual(h, &found.1);
        for _ in 0..NEWTON_ITERATIONS {
            if rest <= tolerance {
                break;
            }
            let Some(direction) = self.newton_direction(h, free, dt, &start, &found.1) else { break };
            let mut part = 1.0;
            let mut better = None;
            for _ in 0..HALVINGS {
                let mut next = h;
                for (&axis, d) in free.iter().zip(direction) {
                    next.col_mut(axis)[axis] = (1.0 + h.col(axis)[axis]) * (part * d).exp() - 1.0;
                }
                let trial = self.trial(next, dt, &start);
                let r = residual(next, &trial.1);
                if r < rest {
                    better = Some((next, trial, r));
                    break;
                }
                part *= 0.5;
            }
            // No step lowers the residual: rounding, or no solution near; the test below decides.
            let Some((next, trial, r)) = better else { break };
            (h, found, rest) = (next, trial, r);
        }
        let scale = double_dot(found.1, found.1).sqrt();
        if !(rest <= 1e3 * tolerance || rest <= 1e-9 * scale) {
            return Err(format!("the free stretch was not found: a lateral stress of {rest:.3e} Pa is left"));
        }
        let (state, stress, met) = found;
        if !met {
            return Err("the return mapping of the plastic flow did not converge".into());
        }
        self.work += 0.5 * double_dot(self.stress + stress, h - old);
        (self.state, self.stress, self.displacement_gradient) = (state, stress, h);
        self.time += dt;
        Ok(())
    }

    /// Newton step in the logarithms of the free stretches, with derivatives by central differences; limited.
    fn newton_direction(
        &self,
        h: DMat3,
        free: &[usize],
        dt: f64,
        start: &PointState,
        stress: &DMat3,
    ) -> Option<[f64; 2]> {
        const STEP: f64 = 1e-6;
        let mut jacobian = [[0.0; 2]; 2];
        for (column, &axis) in free.iter().enumerate() {
            let moved = |sign: f64| {
                let mut h = h;
                h.col_mut(axis)[axis] = (1.0 + h.col(axis)[axis]) * (sign * STEP).exp() - 1.0;
                lateral(h, &self.trial(h, dt, start).1, free)
            };
            let (above, below) = (moved(1.0), moved(-1.0));
            for row in 0..free.len() {
                jacobian[row][column] = (above[row] - below[row]) / (2.0 * STEP);
            }
        }
        let r: Vec<f64> = lateral(h, stress, free).iter().map(|s| -s).collect();
        let [[a, b], [c, d]] = jacobian;
        let step = match r[..] {
            [r] => [r / a, 0.0],
            [r, s] => {
                let determinant = a * d - b * c;
                [(d * r - b * s) / determinant, (a * s - c * r) / determinant]
            }
            _ => return None,
        };
        let largest = step[0].abs().max(step[1].abs());
        let scale = (LARGEST_LOG_STEP / largest).min(1.0);
        largest.is_finite().then(|| step.map(|s| s * scale))
    }
}

/// Normal Cauchy stresses P_aa F_aa / J of the free axes [Pa]: unlike P_aa they grow steadily with the stretch.
fn lateral(h: DMat3, stress: &DMat3, free: &[usize]) -> Vec<f64> {
    let j = 1.0 + jacobian_minus_one(h);
    free.iter().map(|&a| stress.col(a)[a] * (1.0 + h.col(a)[a]) / j).collect()
}

/// What is done to the sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Protocol {
    /// Stretch (or amount of shear) at which a cycle begins and to which it goes.
    pub from: f64,
    pub to: f64,
    /// Rows of one leg, at least 2.
    pub points: usize,
    /// Rate of the stretch or of the shear [1/s].
    pub rate: f64,
    /// Time held after loading [s].
    pub hold: f64,
    pub cycles: usize,
    /// Go back to `from` after loading.
    pub unload: bool,
    /// Edge of the cell for damage [m].
    pub cell_length: f64,
}

/// Part of a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Leg {
    Loading,
    Holding,
    Unloading,
}

impl Leg {
    pub fn key(self) -> &'static str {
        match self {
            Leg::Loading => "loading",
            Leg::Holding => "holding",
            Leg::Unloading => "unloading",
        }
    }
}

/// One row of the answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    pub cycle: usize,
    pub leg: Leg,
    /// [s]
    pub time: f64,
    /// Stretch, or amount of shear.
    pub control: f64,
    /// Nominal stress P11, in shear P12 [Pa].
    pub nominal: f64,
    /// Cauchy stress sigma11, in shear sigma12 [Pa].
    pub cauchy: f64,
    /// Stretches of the axes 2 and 3.
    pub lateral: [f64; 2],
    /// Equivalent plastic strain alpha.
    pub plastic_strain: f64,
    pub damage: f64,
    pub jacobian: f64,
    /// Per rest volume [J/m^3]: work since t = 0, stored and dissipated energy.
    pub work: f64,
    pub stored: f64,
    pub dissipated: f64,
    /// Where the state has left its law.
    pub continuation: Option<Continuation>,
}

/// Largest step of the stretch, without and with an effect that has a history.
const CONTROL_STEP: f64 = 0.02;
const CONTROL_STEP_HISTORY: f64 = 5e-4;
/// Steps per relaxation time of the fastest Prony term.
const STEPS_PER_TIME: f64 = 50.0;
/// Steps between two rows at most; slower tests than that are quasi-static, and the midpoint rule is exact there.
const LARGEST_STEP_COUNT: f64 = 2000.0;

/// Runs the test. An error names the mode and the place that was reached.
pub fn run(material: &Material, mode: Mode, protocol: &Protocol) -> Result<Vec<Row>> {
    let mut test = Test { sample: Sample::new(material, protocol.cell_length), mode, rows: Vec::new() };
    let points = protocol.points.max(2);
    let at = |from: f64, to: f64, i: usize| from + (to - from) * i as f64 / (points - 1) as f64;
    for cycle in 0..protocol.cycles.max(1) {
        let begin = if cycle == 0 { mode.at_rest() } else { protocol.from };
        test.go(begin, protocol.from, protocol.rate)?;
        test.record(cycle, Leg::Loading, protocol.from);
        for i in 1..points {
            test.go(at(protocol.from, protocol.to, i - 1), at(protocol.from, protocol.to, i), protocol.rate)?;
            test.record(cycle, Leg::Loading, at(protocol.from, protocol.to, i));
        }
        if protocol.hold > 0.0 {
            // Relaxation is fast first: the rows are denser there.
            let time = |i: usize| protocol.hold * (i as f64 / (points - 1) as f64).powi(2);
            for i in 1..points {
                test.hold(protocol.to, time(i - 1), time(i))?;
                test.record(cycle, Leg::Holding, protocol.to);
            }
        }
        if protocol.unload {
            for i in 1..points {
                test.go(at(protocol.to, protocol.from, i - 1), at(protocol.to, protocol.from, i), protocol.rate)?;
                test.record(cycle, Leg::Unloading, at(protocol.to, protocol.from, i));
            }
        }
    }
    Ok(test.rows)
}

/// The stretch (or shear) at which the nominal stress of the first loading is largest in magnitude, and that stress [Pa];
/// `None` where it stands at the end of loading: nothing broke.
pub fn peak(rows: &[Row]) -> Option<(f64, f64)> {
    let loading = || rows.iter().filter(|r| r.cycle == 0 && r.leg == Leg::Loading);
    let peak = loading().max_by(|a, b| a.nominal.abs().total_cmp(&b.nominal.abs()))?;
    let end = loading().next_back()?;
    (end.nominal.abs() < 0.99 * peak.nominal.abs()).then_some((peak.control, peak.nominal))
}

struct Test<'m> {
    sample: Sample<'m>,
    mode: Mode,
    rows: Vec<Row>,
}

impl Test<'_> {
    fn terms(&self) -> &[viscoelastic::Term] {
        self.sample.material.viscoelastic.as_ref().map_or(&[], |v| &v.terms)
    }

    /// Fastest relaxation time [s].
    fn fastest(&self) -> f64 {
        self.terms().iter().map(|t| t.time).fold(f64::INFINITY, f64::min)
    }

    /// From one control value to the next at `rate`.
    fn go(&mut self, from: f64, to: f64, rate: f64) -> Result<()> {
        let (span, duration) = ((to - from).abs(), (to - from).abs() / rate);
        if span == 0.0 {
            return Ok(());
        }
        let largest = if self.sample.material.has_history() { CONTROL_STEP_HISTORY } else { CONTROL_STEP };
        let steps = (span / largest).max(duration * STEPS_PER_TIME / self.fastest()).clamp(1.0, LARGEST_STEP_COUNT);
        let steps = steps.ceil() as usize;
        for i in 1..=steps {
            let control = from + (to - from) * i as f64 / steps as f64;
            self.step(control, duration / steps as f64)?;
        }
        Ok(())
    }

    /// Stands still between two times after the begin of the hold [s].
    fn hold(&mut self, control: f64, from: f64, to: f64) -> Result<()> {
        let mut time = from;
        while time < to {
            // What relaxed long ago needs no small steps.
            let dt = (self.fastest().min(1e9).max(time) / STEPS_PER_TIME).min(to - time);
            self.step(control, dt)?;
            time = if to - time <= dt * (1.0 + 1e-9) { to } else { time + dt };
        }
        Ok(())
    }

    fn step(&mut self, control: f64, dt: f64) -> Result<()> {
        let mode = self.mode;
        self.sample.step(mode.displacement_gradient(control), mode.free_axes(), dt).map_err(|reason| {
            let quantity = if mode == Mode::Shear { "shear" } else { "stretch" };
            Error::input(
                format!("{} test at {quantity} {control:.4}: {reason}", mode.key()),
                "end the test before that point, or choose constants that are stable there",
            )
        })
    }

    fn record(&mut self, cycle: usize, leg: Leg, control: f64) {
        let s = &self.sample;
        let h = s.displacement_gradient;
        self.rows.push(Row {
            cycle,
            leg,
            time: s.time,
            control,
            nominal: self.mode.component(s.stress),
            cauchy: self.mode.component(s.cauchy()),
            lateral: [1.0 + h.y_axis.y, 1.0 + h.z_axis.z],
            plastic_strain: s.state.plastic.alpha,
            damage: s.damage(),
            jacobian: s.jacobian(),
            work: s.work,
            stored: s.energy().stored,
            dissipated: s.dissipated(),
            continuation: s.material.continuation(h, &s.state),
        });
    }
}
