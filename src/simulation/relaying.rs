//! A run goes on along the line that [`super::laying`] finds: another model and another engine between two frames.

use std::sync::Arc;

use super::Simulation;
use super::carried::{carried, on_the_same_path};
use super::change::Change;
use super::laying::{Found, Laying, touch_at};
use super::start::choose_step;
use crate::cpu::CpuEngine;
use crate::engine::State;
use crate::engine::stable_dt::wave_speed_bound;
use crate::error::Result;
use crate::model::Model;
use crate::needle::ToolPose;
use crate::needle::path_line::PathLine;

/// What a run goes on from on another line.
struct GoesOn<'a> {
    state: &'a State,
    /// How far that line is cut [m].
    cut: f64,
    /// The needle between the frames.
    pose: ToolPose,
    /// It was on a line.
    from_line: bool,
}

impl Simulation {
    /// Lays the path of the frame that starts next, where it has to be.
    pub(super) fn lay_path(&mut self) -> Result<()> {
        let (Some(laying), Some(kinematics)) = (&self.laying, &self.kinematics) else { return Ok(()) };
        let time = |frame: u64| self.clock.time_of(self.clock.first_step(frame));
        let (now, next) = (kinematics.pose(time(self.started)), kinematics.pose(time(self.started + 1)));
        let radius = self.model.scene.needle().map_or(0.0, |needle| needle.radius);
        if !laying.must_look(&next, radius) {
            return Ok(());
        }
        let state = self.engine.read_state()?;
        let found = laying.look(&self.model, &state, (&now, &next));
        let Some(laying) = &mut self.laying else { return Ok(()) };
        match found {
            Found::Nothing => Ok(()),
            Found::Left => {
                laying.leave(state.tip_coordinate);
                Ok(())
            }
            Found::Line(line, cut) => {
                let from_line = laying.is_on();
                if from_line && cut == 0.0 && state.tip_coordinate > 0.0 {
                    laying.leave(state.tip_coordinate);
                }
                laying.come(&line, &next);
                self.take_line(line, Some(GoesOn { state: &state, cut, pose: now, from_line }))
            }
        }
    }

    /// Goes on as far as the laying had come in a checkpoint.
    pub(super) fn take_laying(&mut self, laying: Option<Laying>) -> Result<()> {
        let line = |laying: &Option<Laying>| laying.as_ref().map(|l| l.line().clone());
        let (old, new) = (line(&self.laying), line(&laying));
        self.laying = laying;
        match new {
            Some(new) if old.as_ref() != Some(&new) => self.take_line(new, None),
            _ => Ok(()),
        }
    }

    /// Goes on along another line; without a state the engine has none yet.
    fn take_line(&mut self, line: PathLine, from: Option<GoesOn>) -> Result<()> {
        let model = Arc::new(self.model.relaid(line.clone()));
        let stable_dt = wave_speed_bound(&model);
        let (mut dt, mut steps_per_frame) = choose_step(&model, stable_dt);
        if self.dt() <= dt || model.scene.solver.time_step.is_some() {
            (dt, steps_per_frame) = (self.dt(), self.steps_per_frame());
        }
        let most_steps = self.purpose.most_steps(steps_per_frame);
        let device = self.device.clone();
        let mut engine = self.engine.on_another_line(&model, device.as_ref(), dt, most_steps, self.purpose)?;
        self.engines += 1;
        let Some(GoesOn { state, cut, pose, from_line }) = from else {
            (self.engine, self.model) = (engine, model);
            return Ok(());
        };
        let change = Change::to_line(model, (stable_dt, dt, steps_per_frame), self.device.clone(), self.purpose);
        let goes_on = self.laying.as_ref().is_some_and(|laying| laying.line().piece(0.0) == line.piece(0.0));
        let mut next = carried(state, &self.model, change.model());
        next.tip_coordinate = cut;
        if goes_on && cut > 0.0 {
            on_the_same_path(state, &mut next);
        }
        // The tip presses on another place of the tissue: what its springs hold there instead is work of the laying, and so is what a path
        // held that a needle leaves at its side.
        let held = |model: &Model, touch| model.tip_contact().map_or(0.0, |contact| contact.stored(touch));
        // The touch of the state is a step older than its displacements; over that step the old line works as ever. A needle that was on no
        // line held nothing.
        let old_touch = match from_line {
            true => touch_at(&self.model, state, state.tip_coordinate, &pose).1,
            false => state.touch,
        };
        let mut before = held(&self.model, old_touch);
        if from_line && !goes_on && state.tip_coordinate > 0.0 {
            before += CpuEngine::opening_energy(&self.model, state, &pose);
        }
        (next.bond.gap, next.touch) = touch_at(change.model(), state, cut, &pose);
        self.recorder.book_laying(held(change.model(), next.touch) - before);
        engine.write_state(&next)?;
        let due_steps = std::mem::take(&mut self.due_steps);
        self.engine = engine;
        if let Some(laying) = &mut self.laying {
            laying.take(line);
        }
        // No energy changes with what is ahead of the tip.
        self.adopted(&change, None)?;
        self.due_steps = due_steps;
        Ok(())
    }
}
