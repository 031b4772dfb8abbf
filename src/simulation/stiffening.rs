//! The step follows the stiffness of the state: cells that are stretched or squeezed, and contact, are stiffer than at rest.
//!
//! Every engine tells the largest `k dt^2 / (4 m)` of its nodes near the limit 1 ([`crate::engine::FrameSums::step_ratio`]). With
//! mass scaling the mass of a node is raised with its stiffness; without, or where that has reached its limit, later frames take
//! more steps. A run never goes back to longer steps. A step that the scene writes itself stays as it is.

use serde::{Deserialize, Serialize};

use super::flexible_needle::FlexibleNeedle;
use super::{AHEAD, LONGEST_LED, RunEngine, Simulation};
use crate::engine::clock::Clock;
use crate::error::Result;
use crate::observables::FrameRecord;
use crate::scene::MOST_STEPS_PER_FRAME;

/// Frames from `frame` on take at least `steps` steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct DueStep {
    pub frame: u64,
    pub steps: u64,
}

/// Stiffness that a state may still gain until the next frames are told, as a factor on the number of steps.
const FORESIGHT: f64 = 1.1;

impl Simulation {
    /// Asks for more steps where a frame came near the limit. They begin [`AHEAD`] frames later, whether those frames are under
    /// way or not: when they begin must not depend on who waits for whom.
    pub(super) fn watch_step(&mut self, record: &FrameRecord, ratio: f64) {
        let solver = &self.model.scene.solver;
        if ratio <= 0.0 || solver.time_step.is_some() {
            return;
        }
        let more = FORESIGHT * ratio.sqrt() / solver.safety.min(0.9);
        let steps = (self.clock.steps_per_frame as f64 * more).ceil().min(MOST_STEPS_PER_FRAME as f64) as u64;
        if steps > self.due_steps.back().map_or(self.clock.steps_per_frame, |due| due.steps) {
            self.due_steps.push_back(DueStep { frame: record.frame + AHEAD + 1, steps });
        }
    }

    /// True where the step changes before `frame`: the frames before it must be collected first.
    pub(super) fn changes_step_at(&self, frame: u64) -> bool {
        self.due_steps.front().is_some_and(|due| due.frame <= frame)
    }

    /// Takes the steps that are due in the next frame.
    pub(super) fn take_due_steps(&mut self) -> Result<()> {
        let mut wanted = self.clock.steps_per_frame;
        while let Some(due) = self.due_steps.pop_front_if(|due| due.frame <= self.started) {
            wanted = wanted.max(due.steps);
        }
        if wanted == self.clock.steps_per_frame {
            return Ok(());
        }
        let before = self.clock.dt;
        let dt = before * self.clock.steps_per_frame as f64 / wanted as f64;
        self.take_clock(self.clock.changed(self.started.max(1), dt, wanted))?;
        if !std::mem::replace(&mut self.stiffening_told, true) {
            self.notices.push(format!(
                "the tissue or its contact is stiffer than at rest: from frame {} on the step is {:.3} us instead of {:.3} us, and \
                 shorter still where that is needed",
                self.started,
                dt * 1e6,
                before * 1e6
            ));
        }
        Ok(())
    }

    /// Goes on with the steps of another clock; between frames.
    pub(super) fn take_clock(&mut self, clock: Clock) -> Result<()> {
        if clock == self.clock {
            return Ok(());
        }
        let steps = clock.steps_per_frame as usize;
        if clock.dt != self.clock.dt && !self.engine.retune(self.model.clone(), clock.dt, steps)? {
            let state = self.engine.read_state()?;
            let mut engine = RunEngine::new(
                &self.model,
                self.device(),
                clock.dt,
                self.purpose.most_steps(clock.steps_per_frame),
                self.purpose,
            )?;
            engine.write_state(&state)?;
            self.engine = engine;
            self.engines += 1;
        }
        let end = match self.purpose.led {
            true => LONGEST_LED,
            false => self.model.duration(),
        };
        self.clock = clock;
        self.total_steps = clock.steps_until(end);
        self.frames = 1 + clock.frame_of(self.total_steps);
        if let Some(image) = self.needle.as_ref().map(|needle| needle.save()) {
            self.needle = FlexibleNeedle::new(&self.model, self.kinematics.as_ref(), clock.dt);
            if let Some(needle) = &mut self.needle {
                needle.restore(&image);
            }
        }
        Ok(())
    }
}
