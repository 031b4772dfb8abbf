//! One run in memory: model, engine, time step and the order of frames. Commands and tests use it alike.
//!
//! [`start`] prepares it, [`change`] puts another scene in its place, [`checkpoint`] keeps it and goes on from it, [`flexible_needle`] bends
//! its needle; `stretch` and `trouble` stop it, [`investigation`] and [`trial`] find out why. [`fields`] is what it shows,
//! [`reach`] what of a hand's wish the tissue can follow.

#![warn(missing_docs)]

pub mod advice;
#[allow(missing_docs)]
mod carried;
#[allow(missing_docs)]
pub mod change;
#[allow(missing_docs)]
pub mod checkpoint;
pub mod companion;
pub mod fields;
pub mod flexible_needle;
#[allow(missing_docs)]
pub mod investigation;
#[allow(missing_docs)]
mod laying;
#[allow(missing_docs)]
pub mod reach;
#[allow(missing_docs)]
mod relaying;
#[allow(missing_docs)]
mod run_engine;
#[allow(missing_docs)]
pub mod start;
#[allow(missing_docs)]
pub mod stiffening;
mod stretch;
#[allow(missing_docs)]
pub mod trial;
mod trouble;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

pub use run_engine::RunEngine;
use run_engine::Shown;
pub use start::{EngineChoice, choose_step};

use crate::engine::clock::Clock;
use crate::engine::{Engine, FramePlan, StepInput};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, GpuEngine};
use crate::model::Model;
use crate::needle::centre_line::CentreLine;
use crate::needle::motion::HandPose;
use crate::needle::{Kinematics, ToolPose};
use crate::observables::{CoreSample, FrameRecord, Judge, Recorder, TargetRecord};
use crate::scene::MOST_STEPS_PER_FRAME;
use crate::verdict::Verdict;
use flexible_needle::FlexibleNeedle;
use laying::Laying;
use stiffening::DueStep;

/// Frames that may be under way before the oldest result is awaited.
const AHEAD: u64 = 2;

/// Longest motion that a hand may lead [s].
const LONGEST_LED: f64 = 3600.0;

/// What a simulation is made for, beside records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Purpose {
    /// A hand leads the tool, not the phases of the scene.
    pub led: bool,
    /// The device keeps the fields that a window draws.
    pub drawn: bool,
    /// Without a device, cells are computed in lanes of f32 where these know the scene, not in f64.
    pub lanes: bool,
}

impl Purpose {
    /// Steps per frame that are made room for where `steps` are planned: tissue that stiffens takes more, and a hand that leads may
    /// change the scene too.
    pub fn most_steps(self, steps: u64) -> usize {
        (if self.led || self.drawn { 4 * steps } else { 2 * steps }).min(MOST_STEPS_PER_FRAME).max(steps) as usize
    }
}

/// A simulation that is advanced frame by frame.
pub struct Simulation {
    /// Scene, mesh and materials as the engine has them.
    pub model: Arc<Model>,
    /// Stable step: the wave-speed bound at rest [s].
    pub stable_dt: f64,
    engine: RunEngine,
    /// Engines before this one.
    engines: u64,
    device: Option<Gpu>,
    purpose: Purpose,
    recorder: Recorder,
    clock: Clock,
    total_steps: u64,
    frames: u64,
    /// Motion of the tool: the phases of the scene, or what a hand has led so far.
    kinematics: Option<Kinematics>,
    /// Frames that a hand has led.
    led_frames: u64,
    started: u64,
    collected: u64,
    /// Steps of [`Simulation::try_steps`].
    tried_steps: u64,
    judge: Judge,
    /// More steps that the stiffness of the tissue asks for.
    due_steps: VecDeque<DueStep>,
    stiffening_told: bool,
    /// Frames after which the state is read, so that no later frame may have been started.
    stops: BTreeSet<u64>,
    watch_stretch: bool,
    /// Where the path is laid while the needle comes.
    laying: Option<Laying>,
    /// The beam of a flexible needle; every frame waits for the one before.
    needle: Option<FlexibleNeedle>,
    /// Frames in which the beam did not find its balance.
    unbalanced_frames: u64,
    buckling_told: bool,
    /// Things the user should know, one sentence each.
    pub notices: Vec<String>,
}

impl Simulation {
    /// Where the hand has led the tool so far; `None` where no hand leads.
    pub fn hand(&self) -> Option<HandPose> {
        self.kinematics.as_ref().filter(|k| k.is_led()).map(|k| k.last())
    }

    /// Leads the tool to `pose` within one more frame, which may then be started.
    pub fn lead(&mut self, pose: &HandPose) {
        let until = self.clock.time_of(self.clock.first_step(self.led_frames + 1));
        if let Some(kinematics) = self.kinematics.as_mut().filter(|k| k.is_led()) {
            kinematics.lead(&self.model.before_bone(&kinematics.last(), pose), until);
            self.led_frames += 1;
        }
    }

    /// Forgets what a hand has led beyond the frames that are collected, after [`Simulation::resume`]: the poses behind them can be led again,
    /// or others.
    pub fn forget_the_lead(&mut self) {
        // The beam of a needle that bends looks one frame ahead.
        let frames = self.collected + u64::from(self.needle.is_some());
        if let Some(kinematics) = self.kinematics.as_mut().filter(|k| k.is_led())
            && frames < self.led_frames
        {
            kinematics.keep(frames as usize, &self.model.scene.motion);
            self.led_frames = frames;
        }
    }

    /// Pose of the tool at `time` [s].
    pub fn tool_pose(&self, time: f64) -> Option<ToolPose> {
        self.kinematics.as_ref().map(|k| k.pose(time))
    }

    /// End of a frame [s].
    pub fn end_of(&self, frame: u64) -> f64 {
        self.clock.time_of(self.clock.first_step(frame + 1).min(self.total_steps.max(1)))
    }

    /// The verdict on the run so far.
    pub fn verdict(&self) -> &Verdict {
        self.judge.verdict()
    }

    /// For what no record has: state, forces, images.
    pub fn engine(&mut self) -> &mut dyn Engine {
        &mut *self.engine
    }

    /// The engine on a device, for those who draw from its buffers.
    pub fn on_device(&self) -> Option<&GpuEngine> {
        self.engine.on_device()
    }

    /// How often the engine was replaced: whoever draws from its buffers takes those of the new one.
    pub fn replaced_engines(&self) -> u64 {
        self.engines
    }

    /// Brings the buffers on the device up to the present state, for those who draw from them: displacements, with `fields` all that
    /// stresses are computed from.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn show(&mut self, fields: bool) -> Result<()> {
        self.engine.show(if fields { Shown::Everything } else { Shown::Displacement })
    }

    /// The opened device, if the engine runs on one.
    pub fn device(&self) -> Option<&Gpu> {
        self.device.as_ref()
    }

    /// Number of frames of the whole run.
    pub fn frame_count(&self) -> u64 {
        self.frames
    }

    /// Time step [s].
    pub fn dt(&self) -> f64 {
        self.clock.dt
    }

    /// At present: tissue that stiffens takes more.
    pub fn steps_per_frame(&self) -> u64 {
        self.clock.steps_per_frame
    }

    /// Of the whole run, with the present time step.
    pub fn total_steps(&self) -> u64 {
        self.total_steps
    }

    /// Simulated length of the run [s].
    pub fn duration(&self) -> f64 {
        self.clock.time_of(self.total_steps)
    }

    /// Frame whose end is the first one at or after `time` [s].
    pub fn frame_at(&self, time: f64) -> u64 {
        self.clock.frame_of(self.clock.steps_until(time)).min(self.frames - 1)
    }

    /// Asks that the state can be read right after the record of `frame` has been returned.
    pub fn stop_after(&mut self, frame: u64) {
        self.stops.insert(frame);
    }

    /// Asks for the state as soon as the frames under way are collected; returns the last of them.
    pub fn stop_soon(&mut self) -> u64 {
        let frame = self.started.max(1) - 1;
        self.stops.insert(frame.max(self.collected));
        frame.max(self.collected)
    }

    fn plan(&self, frame: u64) -> FramePlan {
        let (clock, dt) = (&self.clock, self.clock.dt);
        let first_step = clock.first_step(frame);
        let last = clock.first_step(frame + 1).min(self.total_steps.max(1));
        let tool = self.kinematics.as_ref();
        let mut plan = FramePlan {
            frame,
            first_step,
            steps: (first_step..last)
                .map(|step| StepInput { step, ..StepInput::with(&self.model, tool, clock.time_of(step), dt) })
                .map(|input| self.laying.as_ref().map_or(input, |laying| laying.seen(input)))
                .collect(),
            centre_line: None,
        };
        if let Some(needle) = &self.needle {
            needle.bend(&mut plan, dt);
        }
        plan
    }

    /// Computes the next `count` steps for the sake of the time that they take, in frames of their own that leave no record; false
    /// where the run has no more of them. No frame can follow.
    ///
    /// # Errors
    /// `Error::Device` where the device fails, `Error::Ended` where the end was asked for.
    pub fn try_steps(&mut self, count: u64) -> Result<bool> {
        let most = self.clock.steps_per_frame;
        let (first, end) = (self.tried_steps, self.tried_steps + count);
        if end > self.total_steps {
            return Ok(false);
        }
        let (dt, tool) = (self.clock.dt, self.kinematics.as_ref());
        for begin in (first..end).step_by(most as usize) {
            let steps = begin..(begin + most).min(end);
            let inputs = steps.clone().map(|step| {
                let input = StepInput::with(&self.model, tool, self.clock.time_of(step), dt);
                StepInput { step, ..input }
            });
            let mut plan = FramePlan { frame: begin, first_step: begin, steps: inputs.collect(), centre_line: None };
            if let Some(needle) = &self.needle {
                needle.bend(&mut plan, dt);
            }
            self.engine.start_frame(&plan)?;
        }
        while self.engine.collect(true)?.is_some() {}
        self.tried_steps = end;
        Ok(true)
    }

    fn may_start(&self, frame: u64) -> bool {
        // A window wants each frame as soon as it can be had, not several at once.
        let waits = self.purpose.drawn
            || self.watch_stretch
            || self.laying.is_some()
            || self.needle.is_some()
            || self.model.has_bore()
            || self.changes_step_at(frame)
            || self.stops.range(self.collected..frame).next().is_some();
        // The beam of a needle that bends looks one frame ahead.
        let led = !self.kinematics.as_ref().is_some_and(|k| k.is_led())
            || frame + u64::from(self.needle.is_some()) < self.led_frames;
        led && frame < self.frames && frame - self.collected <= AHEAD && (!waits || frame == self.collected)
    }

    /// Gives the engine the frames that may be started; [`Simulation::next_frame`] does so by itself.
    ///
    /// # Errors
    /// `Error::Device` where the device fails, `Error::Ended` where the end was asked for; those of [`RunEngine::new`] where
    /// stiffer tissue takes an engine with more steps.
    pub fn start_frames(&mut self) -> Result<()> {
        while self.may_start(self.started) {
            self.take_due_steps()?;
            self.lay_path()?;
            let plan = self.plan(self.started);
            self.engine.start_frame(&plan)?;
            self.started += 1;
        }
        Ok(())
    }

    /// The next record; `None` after the last frame, and where no frame has been led.
    ///
    /// # Errors
    /// `Error::Diverged` when the state has left the range in which its numbers mean something; `Error::Device`.
    /// Those of [`Simulation::start_frames`] too.
    pub fn next_frame(&mut self) -> Result<Option<FrameRecord>> {
        self.start_frames()?;
        if self.collected == self.started {
            return Ok(None);
        }
        let Some(mut sums) = self.engine.collect(true)? else {
            return Err(Error::Device("the engine lost a frame".into()));
        };
        self.collected += 1;
        if let Some(laying) = &mut self.laying {
            // The engine keeps the line that a needle has left.
            if !laying.is_on() {
                sums.tip_coordinate = 0.0;
            }
            laying.follow(sums.tip_coordinate);
        }
        let bent = self.answer_of_the_needle(&mut sums);
        let when = (&self.clock, self.clock.first_step(sums.frame));
        let mut record = self.recorder.record(&self.model, self.kinematics.as_ref(), when, &sums);
        record.needle = bent;
        record.targets = TargetRecord::of(&self.model, self.kinematics.as_ref(), &record, &sums.targets);
        self.tell_of_the_needle(&record);
        let known = self.judge.verdict().doubts.len();
        if let Some(trouble) = self.judge.check(&record, sums.steps) {
            return Err(self.stopped(&record, trouble));
        }
        if self.judge.verdict().doubts.len() > known {
            let place = self.place_of_doubt(&record);
            self.judge.place(record.frame, &place);
        }
        record.verdict = self.judge.verdict().clone();
        self.watch_step(&record, sums.step_ratio);
        if self.model.has_bore() {
            let state = self.engine.read_state()?;
            let pose = self.kinematics.as_ref().map(|k| k.pose(record.time));
            record.core = pose.and_then(|pose| CoreSample::of(&self.model, &state, &pose));
        }
        if self.watch_stretch {
            self.check_stretch(&record)?;
        }
        Ok(Some(record))
    }

    /// The centre-line of a needle that bends, at the end of the frame that was collected last.
    pub fn centre_line(&self) -> Option<CentreLine> {
        self.needle.as_ref().map(|needle| needle.centre_line())
    }
}
