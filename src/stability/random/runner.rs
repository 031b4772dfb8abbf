//! Runs one scene, and says how it ended and whether it may end so.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use glam::DVec3;
use serde::Serialize;

use super::MOST_IMBALANCE;
use super::generator::RandomScene;
use super::reasonable::beyond;
use crate::Error;
use crate::gpu::Gpu;
use crate::model::Model;
use crate::observables::FrameRecord;
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::verdict::{Quantity, Verdict};

/// Wall time that a scene may take beside its steps, and so many times the time that they are expected to take.
const PATIENCE: Duration = Duration::from_secs(60);
const TIMES: f64 = 25.0;
/// A step of a cell, on either engine of a slow machine [s].
const CELL_STEP: f64 = 1.5e-6;

/// Strain whose energy in the whole tissue is rounding.
const ROUNDING_STRAIN: f64 = 1e-4;

/// Steps of the work of a frame below which no work is measured on its own, as docs/verdict.md states it. Contact begins within a step: what is
/// wrong then is a part of one step's work.
const FLOOR_STEPS: f64 = 50.0;

/// How a scene ended on an engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    Ok,
    Doubtful,
    Refused,
    Stopped,
    /// Its energy is out of balance, and it says ok.
    Silent,
    /// It ended as it may, and does not say why or what to do.
    Unexplained,
    /// A mistake was not refused.
    Missed,
    Panicked,
    Hung,
    /// The device or the disk failed.
    Broken,
}

impl End {
    pub const ALL: [End; 10] = [
        End::Ok,
        End::Doubtful,
        End::Refused,
        End::Stopped,
        End::Silent,
        End::Unexplained,
        End::Missed,
        End::Panicked,
        End::Hung,
        End::Broken,
    ];

    pub fn word(self) -> &'static str {
        match self {
            End::Ok => "ok",
            End::Doubtful => "doubtful",
            End::Refused => "refused",
            End::Stopped => "stopped",
            End::Silent => "SILENT IMBALANCE",
            End::Unexplained => "UNEXPLAINED",
            End::Missed => "MISTAKE NOT SEEN",
            End::Panicked => "PANIC",
            End::Hung => "HANG",
            End::Broken => "BROKEN",
        }
    }

    /// Only these may be.
    pub fn allowed(self) -> bool {
        matches!(self, End::Ok | End::Doubtful | End::Refused | End::Stopped)
    }
}

/// What is known of a run.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    pub engine: &'static str,
    pub end: End,
    /// What the program said, or what is wrong.
    pub reason: String,
    /// Why the scene is beyond what a user would do; empty: reasonable.
    pub beyond: Vec<String>,
    pub cells: usize,
    pub steps: u64,
    /// Largest (external - accounted)/scale of all frames, and the frame.
    pub imbalance: f64,
    pub imbalance_frame: u64,
    /// Largest force on the tool or of a face [N].
    pub peak_force: f64,
    /// [s]
    pub wall_s: f64,
    /// Of every frame: axial force and reactions of the six faces [N].
    #[serde(skip)]
    pub forces: Vec<Vec<DVec3>>,
}

impl Outcome {
    fn new(engine: &'static str) -> Self {
        Outcome {
            engine,
            end: End::Ok,
            reason: String::new(),
            beyond: Vec::new(),
            cells: 0,
            steps: 0,
            imbalance: 0.0,
            imbalance_frame: 0,
            peak_force: 0.0,
            wall_s: 0.0,
            forces: Vec::new(),
        }
    }

    /// True where the scene is within what a user would do.
    pub fn reasonable(&self) -> bool {
        self.beyond.is_empty()
    }
}

/// Independent account of the energy, frame by frame:
///
/// `(external - accounted)/max(largest |external| so far, floor)`
///
/// Floor: the energy of a strain of 1e-4 in the whole tissue, and the work of [`FLOOR_STEPS`] steps at the rate of the frame. It is no
/// constant of the verdict's, so that a floor that hides a loss there shows here.
#[derive(Debug, Clone, Default)]
struct Balance {
    scale: f64,
    /// Work at the end of the last frame [J], and its last step.
    last: (f64, u64),
    /// Frame, what is missing and the scale then [J].
    frames: Vec<(u64, f64, f64)>,
}

impl Balance {
    /// `rounding`: energy that is rounding [J].
    fn new(rounding: f64) -> Self {
        Balance { scale: rounding, ..Balance::default() }
    }

    fn take(&mut self, record: &FrameRecord) {
        let energy = &record.energy;
        let work = energy.external;
        let (before, step) = self.last;
        let steps = record.step.saturating_sub(step).max(1) as f64;
        self.last = (work, record.step);
        self.scale = self.scale.max(work.abs());
        let floor = FLOOR_STEPS * (work - before).abs() / steps;
        self.frames.push((record.frame, work - energy.accounted(), self.scale.max(floor)));
    }

    /// Largest part that is missing (positive) or too much, and its frame; what is no number is worst.
    fn worst(&self) -> (f64, u64) {
        let parts = self.frames.iter().map(|(frame, missing, scale)| (missing / scale, *frame));
        parts.fold((0.0, 0), |worst, next| if worst.0.is_nan() || next.0.abs() <= worst.0.abs() { worst } else { next })
    }
}

/// Why a doubt that the program tells cannot be: what it says of the run is not what its frames hold.
fn contradiction(verdict: &Verdict, records: &[FrameRecord], imbalance: f64) -> Option<String> {
    verdict.doubts.iter().find_map(|doubt| {
        let any = |of: fn(&FrameRecord) -> bool| records.iter().any(of);
        let seen = match doubt.quantity {
            Quantity::EnergyImbalance => imbalance.is_nan() || imbalance.abs() >= 0.25 * MOST_IMBALANCE,
            Quantity::ClampedShare => any(|r| r.health.clamped_nodes > 0),
            Quantity::RaisedShare => any(|r| r.health.raised_mass > 0),
            Quantity::InvertedCells | Quantity::FoldedCells => {
                records.last().is_some_and(|r| r.health.inverted_cells > 0)
            }
            Quantity::ClippedReturns => any(|r| r.health.return_failures > 0),
            Quantity::HourglassShare => any(|r| r.energy.hourglass > 0.1 * r.energy.elastic),
            Quantity::InertiaShare => any(|r| r.energy.kinetic > 0.05 * r.energy.elastic),
            Quantity::CuredEnergy => any(|r| r.energy.raised_mass != 0.0 || r.energy.speed_limit != 0.0),
            Quantity::UnbalancedNeedle => any(|r| r.needle.unbalanced),
            Quantity::NotFinite => any(|r| r.health.not_finite),
        };
        let holds = seen && (doubt.value > doubt.bound || doubt.value.is_nan()) && doubt.frame < records.len() as u64;
        (!holds).then(|| format!("told, and not so: {}", doubt.sentence()))
    })
}

/// Runs a scene on the device, or on the CPU engine without one, with bulk moduli of `1 + nudge` times those of its text. `folder` holds
/// its mesh.
pub fn run(scene: &RandomScene, folder: &Path, device: Option<Gpu>, nudge: f64) -> Outcome {
    let engine = if device.is_some() { "gpu" } else { "cpu" };
    let begin = Instant::now();
    let (told, results) = mpsc::channel();
    let cancelled = Arc::new(AtomicBool::new(false));
    let (own, path, stop) = (scene.clone(), folder.to_path_buf(), cancelled.clone());
    let thread = std::thread::Builder::new().name(scene.name.clone()).spawn(move || {
        let work = || simulate(&own, &path, device, nudge, &stop, &|limit| drop(told.send(Message::Limit(limit))));
        let outcome = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
            let text = payload.downcast_ref::<&str>().map(|t| t.to_string());
            let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
            Outcome { end: End::Panicked, reason: text.unwrap_or_default(), ..Outcome::new(engine) }
        });
        drop(told.send(Message::Done(Box::new(outcome))));
    });
    let mut outcome = Outcome::new(engine);
    if let Err(error) = thread {
        return Outcome { end: End::Broken, reason: error.to_string(), ..outcome };
    }
    let mut deadline = begin + PATIENCE;
    loop {
        match results.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(Message::Limit(limit)) => deadline = Instant::now() + limit,
            Ok(Message::Done(done)) => {
                outcome = *done;
                break;
            }
            Err(_) => {
                // What hangs within a frame stays behind; the program goes on without it.
                cancelled.store(true, Ordering::Relaxed);
                outcome.end = End::Hung;
                outcome.reason = format!("no end within {:.0} s", begin.elapsed().as_secs_f64());
                break;
            }
        }
    }
    outcome.wall_s = begin.elapsed().as_secs_f64();
    judge(scene, &mut outcome);
    outcome
}

enum Message {
    /// Wall time from now on.
    Limit(Duration),
    Done(Box<Outcome>),
}

fn simulate(
    random: &RandomScene,
    folder: &Path,
    device: Option<Gpu>,
    nudge: f64,
    cancelled: &AtomicBool,
    expect: &dyn Fn(Duration),
) -> Outcome {
    let mut outcome = Outcome::new(if device.is_some() { "gpu" } else { "cpu" });
    let nudged = |mut scene: Scene| {
        scene.material.law.bulk_modulus *= 1.0 + nudge;
        scene.regions.iter_mut().for_each(|region| region.material.law.bulk_modulus *= 1.0 + nudge);
        scene
    };
    let simulation = random.scene(folder).and_then(|scene| Simulation::on(nudged(scene), device));
    let mut simulation = match simulation {
        Ok(simulation) => simulation,
        Err(error) => {
            end_with(&mut outcome, error);
            return outcome;
        }
    };
    let model = simulation.model.clone();
    outcome.beyond = beyond(&model, simulation.stable_dt);
    outcome.cells = model.mesh.cell_count();
    let work = simulation.total_steps() as f64 * outcome.cells as f64 * CELL_STEP;
    expect(PATIENCE + Duration::from_secs_f64(TIMES * work));
    let mut balance = Balance::new(rounding(&model));
    let mut records = Vec::new();
    while !cancelled.load(Ordering::Relaxed) {
        match simulation.next_frame() {
            Ok(Some(record)) => {
                balance.take(&record);
                outcome.steps = record.step;
                let forces: Vec<DVec3> =
                    std::iter::once(DVec3::X * record.force.axial).chain(record.reactions).collect();
                outcome.peak_force = forces.iter().map(|f| f.length()).fold(outcome.peak_force, f64::max);
                outcome.forces.push(forces);
                records.push(record);
            }
            Ok(None) => {
                let verdict = simulation.verdict().clone();
                if let Some(sentence) = verdict.sentence() {
                    (outcome.end, outcome.reason) = (End::Doubtful, sentence);
                }
                if let Some(text) = contradiction(&verdict, &records, balance.worst().0) {
                    (outcome.end, outcome.reason) = (End::Unexplained, text);
                }
                break;
            }
            Err(error) => {
                end_with(&mut outcome, error);
                break;
            }
        }
    }
    (outcome.imbalance, outcome.imbalance_frame) = balance.worst();
    outcome
}

/// Energy that is rounding [J].
fn rounding(model: &Model) -> f64 {
    let volume: f64 = (0..model.mesh.cell_count()).map(|cell| model.mesh.cell_volume(cell)).sum();
    model.scene.material.law.shear_modulus() * volume * ROUNDING_STRAIN.powi(2)
}

fn end_with(outcome: &mut Outcome, error: Error) {
    outcome.end = match &error {
        Error::Scene(_) | Error::Input { .. } => End::Refused,
        Error::Diverged { .. } => End::Stopped,
        _ => End::Broken,
    };
    outcome.reason = error.to_string();
}

/// Whether the scene may end so, with this reason.
fn judge(scene: &RandomScene, outcome: &mut Outcome) {
    if !outcome.end.allowed() {
        return;
    }
    if let Some(expected) = scene.mistake
        && (outcome.end != End::Refused || !outcome.reason.contains(expected))
    {
        outcome.reason = format!("expected a refusal with `{expected}`, got: {}", outcome.reason);
        outcome.end = End::Missed;
    }
    match outcome.end {
        End::Ok if outcome.imbalance.is_nan() || outcome.imbalance.abs() > MOST_IMBALANCE => {
            outcome.reason =
                format!("{:.1} % of the energy in frame {}", 100.0 * outcome.imbalance, outcome.imbalance_frame);
            outcome.end = End::Silent;
        }
        // A run that is stopped names a cure only where one was tried, which `stylet run` does.
        End::Refused if !outcome.reason.contains("way out: ") => {
            outcome.reason = format!("refused without a way out: {}", outcome.reason);
            outcome.end = End::Unexplained;
        }
        End::Stopped if !outcome.reason.contains("run stopped in frame") => {
            outcome.reason = format!("stopped without a frame and a reason: {}", outcome.reason);
            outcome.end = End::Unexplained;
        }
        _ => {}
    }
}

/// Largest difference of the forces of two engines over the largest force of `reference`; `None` where they cannot be compared.
pub fn apart(found: &Outcome, reference: &Outcome) -> Option<f64> {
    let ended = |o: &Outcome| matches!(o.end, End::Ok | End::Doubtful | End::Silent);
    if !ended(found) || !ended(reference) || reference.peak_force <= 0.0 {
        return None;
    }
    let pairs = found.forces.iter().flatten().zip(reference.forces.iter().flatten());
    let largest = pairs
        .map(|(a, b)| (*a - *b).length())
        .fold(0.0, |most: f64, x| if x.is_finite() { most.max(x) } else { f64::INFINITY });
    Some(largest / reference.peak_force)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_measured_against_what_was_done_so_far() {
        let mut balance = Balance::new(1e-12);
        let mut frame = |number: u64, external: f64, elastic: f64| {
            let mut record = FrameRecord { frame: number, step: 1_000_000 * number, ..FrameRecord::default() };
            (record.energy.external, record.energy.elastic) = (external, elastic);
            balance.take(&record);
            balance.worst()
        };
        assert_eq!(frame(0, 0.0, 0.0), (0.0, 0));
        let (part, number) = frame(1, 1e-6, 0.75e-6);
        assert!((part - 0.25).abs() < 1e-12 && number == 1);
        // A frame early on keeps its part, however fast the run goes on.
        assert_eq!([frame(2, 5e-6, 5e-6).1, frame(3, 1.0, 0.99).1], [1, 1]);
        assert_eq!(frame(4, 0.0, 0.5), (-0.5, 4));
        assert!(frame(5, f64::NAN, 0.5).0.is_nan());
        assert!(frame(6, 0.0, 0.0).0.is_nan());
    }

    #[test]
    fn a_doubt_that_the_frames_do_not_hold_is_a_contradiction() {
        let doubt = |quantity| Verdict {
            doubts: vec![crate::verdict::Doubt {
                quantity,
                value: 0.5,
                bound: 0.02,
                frame: 0,
                time_s: 0.0,
                place: None,
            }],
            worst_imbalance: 0.0,
        };
        let mut record = FrameRecord::default();
        assert!(contradiction(&doubt(Quantity::ClampedShare), &[record.clone()], 0.0).is_some());
        record.health.clamped_nodes = 3;
        assert_eq!(contradiction(&doubt(Quantity::ClampedShare), &[record.clone()], 0.0), None);
        assert!(contradiction(&doubt(Quantity::EnergyImbalance), &[record.clone()], 0.001).is_some());
        assert_eq!(contradiction(&doubt(Quantity::EnergyImbalance), &[record], -0.03), None);
    }
}
