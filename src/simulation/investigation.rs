//! After a run has stopped: goes back to a checkpoint, advances step by step, and finds the step and the cell where it began.

use glam::DVec3;

use super::Simulation;
use super::checkpoint::Checkpoint;
use super::fields::snapshot;
use crate::effects::Kind;
use crate::engine::{FramePlan, State};
use crate::error::Result;
use crate::model::Model;
use crate::observables::{FieldSnapshot, FrameRecord};

/// Node speed over the speed limit from which on a step shows the first sign.
const FAST: f64 = 0.5;

/// One step of the way into the trouble.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepRecord {
    /// Number since t = 0 (1 is the first), and time at its end [s].
    pub step: u64,
    pub time: f64,
    /// Energies [J].
    pub elastic: f64,
    pub kinetic: f64,
    pub hourglass: f64,
    /// Smallest J at centres and corners; cells inside out.
    pub min_j: f64,
    pub min_corner_j: f64,
    pub inverted_cells: u32,
    /// Largest node speed [m/s], nodes at the speed limit.
    pub max_speed: f64,
    pub clamped_nodes: u32,
    pub not_finite: bool,
}

/// Which quantity showed first that something is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sign {
    NotFinite,
    /// A node came near the speed limit.
    Speed,
    /// A cell turned inside out.
    Inversion,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Finding {
    /// Steps from the checkpoint to the first sign, or to the frame that stopped the run.
    pub steps: Vec<StepRecord>,
    /// The first sign; `None`: there was none but the one that stopped the run.
    pub sign: Option<Sign>,
    /// Fastest node there and its speed [m/s].
    pub node: usize,
    pub speed: f64,
    /// The cell around it with the largest stress, its centre at rest [m], J and von Mises stress [Pa].
    pub cell: usize,
    pub place: DVec3,
    pub jacobian: f64,
    pub von_mises: f64,
    /// What acts on that node, in words.
    pub acting: Vec<String>,
    /// Fields at that step, and its frame.
    pub fields: FieldSnapshot,
    pub frame: u64,
}

impl Simulation {
    /// Goes back to `from` and on to the first sign of trouble, at the latest to the end of frame `last`. The simulation is
    /// there afterwards; it cannot go on in whole frames.
    ///
    /// # Errors
    /// As [`Simulation::resume`], and those of the engine.
    pub fn investigate(&mut self, from: &Checkpoint, last: u64) -> Result<Finding> {
        self.resume(from)?;
        let limit = self.model.speed_limit(self.clock.dt);
        let mut steps = Vec::new();
        let mut sign = None;
        let mut frame = self.collected;
        'frames: while frame <= last {
            self.take_due_steps()?;
            let plan = self.plan(frame);
            self.started = frame + 1;
            let mut loads = [DVec3::ZERO; crate::needle::centre_line::ENTRY_COUNT];
            let count = plan.steps.len() as u64;
            for (n, input) in (0..).zip(&plan.steps) {
                let first_step = plan.first_step + n;
                let single = FramePlan { steps: vec![*input], first_step, ..plan.clone() };
                self.engine.start_frame(&single)?;
                let Some(mut sums) = self.engine.collect(true)? else { break 'frames };
                let record = StepRecord {
                    step: first_step + 1,
                    time: self.clock.time_of(first_step + 1),
                    elastic: sums.energy.elastic,
                    kinetic: sums.energy.kinetic,
                    hourglass: sums.energy.hourglass,
                    min_j: sums.health.min_j,
                    min_corner_j: sums.health.min_corner_j,
                    inverted_cells: sums.health.inverted_cells,
                    max_speed: sums.health.max_speed,
                    clamped_nodes: sums.health.clamped_nodes,
                    not_finite: sums.health.not_finite,
                };
                let new = |f: fn(&StepRecord) -> u32| f(&record) > steps.first().map_or(0, f);
                sign = match () {
                    () if record.not_finite => Some(Sign::NotFinite),
                    () if record.clamped_nodes > 0 || record.max_speed > FAST * limit => Some(Sign::Speed),
                    () if new(|r| r.inverted_cells) => Some(Sign::Inversion),
                    () => None,
                };
                steps.push(record);
                if sign.is_some() {
                    break 'frames;
                }
                for (sum, load) in loads.iter_mut().zip(&sums.needle_loads) {
                    *sum += *load;
                }
                if n + 1 == count {
                    (sums.needle_loads, sums.steps) = (loads, count as u32);
                    self.collected = frame + 1;
                    self.answer_of_the_needle(&mut sums);
                }
            }
            frame += 1;
        }
        let state = self.engine.read_state()?;
        let at = steps.last().copied().unwrap_or_default();
        let record = FrameRecord { frame, step: at.step, time: at.time, ..Default::default() };
        let line = self.needle.as_ref().map(|needle| needle.centre_line());
        let mut fields = snapshot(&self.model, self.kinematics.as_ref(), &record, state.clone(), line);
        fields.depth = self.kinematics.as_ref().map_or(0.0, |k| k.pose(at.time).depth);
        Ok(locate(&self.model, &state, fields, steps, sign, frame))
    }
}

/// Names the place of the trouble: the fastest node, and of the cells around it the one with the largest stress.
fn locate(
    model: &Model,
    state: &State,
    fields: FieldSnapshot,
    steps: Vec<StepRecord>,
    sign: Option<Sign>,
    frame: u64,
) -> Finding {
    // A value that is no number is faster than all.
    let speed = |v: &DVec3| if v.is_finite() { v.length() } else { f64::INFINITY };
    let speeds = state.velocity.iter().map(speed).enumerate();
    let (node, speed) = speeds.fold((0, -1.0), |a, b| if b.1 > a.1 { b } else { a });
    let around =
        (0..model.mesh.cell_count()).filter(|c| model.mesh.is_tissue(*c) && model.mesh.cell_nodes(*c).contains(&node));
    let stress = |cell: usize| {
        let value = fields.von_mises[cell];
        if value.is_finite() { value } else { f64::INFINITY }
    };
    let worst = match sign {
        Some(Sign::Inversion) => (0..model.mesh.cell_count())
            .filter(|c| model.mesh.is_tissue(*c))
            .min_by(|a, b| fields.jacobian[*a].total_cmp(&fields.jacobian[*b])),
        _ => around.max_by(|a, b| stress(*a).total_cmp(&stress(*b))),
    };
    let cell = worst.unwrap_or(0);
    let mut acting = Vec::new();
    let name = match model.region_index(cell) {
        0 => "the tissue".to_string(),
        n => format!("region \"{}\"", model.scene.regions[n - 1].name),
    };
    let law = model.material(cell).law.isochoric.key();
    let within: Vec<&str> =
        model.effects.active().filter(|e| e.kind == Kind::Constitutive).map(|effect| effect.key).collect();
    acting.push(match within.is_empty() {
        true => format!("element forces of {name} ({law})"),
        false => format!("element forces of {name} ({law} with {})", within.join(", ")),
    });
    let touching = model.contact_nodes.iter().zip(&state.contact).any(|(c, s)| c.node as usize == node && s.touching);
    if touching {
        acting.push("contact with the tool (puncture or indentation)".into());
    }
    if model.separation.pairs.iter().any(|p| p.nodes.contains(&(node as u32))) {
        acting.push("a face that may part (cohesive)".into());
    }
    Finding {
        place: model.mesh.cell_centre(cell),
        jacobian: fields.jacobian[cell],
        von_mises: fields.von_mises[cell],
        steps,
        sign,
        node,
        speed,
        cell,
        acting,
        fields,
        frame,
    }
}
