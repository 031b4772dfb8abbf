//! A simulation between two frames, exactly: a run that goes on from it gives the same numbers bit for bit on the same
//! adapter.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::flexible_needle::NeedleImage;
use super::laying::Laying;
use super::stiffening::DueStep;
use super::{Purpose, Simulation};
use crate::engine::clock::Clock;
use crate::engine::{EngineImage, foreign_image};
use crate::error::{Error, Result};
use crate::observables::{Judge, Recorder};
use crate::scene::Scene;

/// What a simulation holds between two frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Frames that were collected, and steps before the next one.
    pub frames: u64,
    pub steps: u64,
    /// Steps of the frames, and more of them that are due.
    pub(super) clock: Clock,
    pub(super) due_steps: VecDeque<DueStep>,
    pub(super) stiffening_told: bool,
    pub engine: EngineImage,
    pub(super) recorder: Recorder,
    pub(super) needle: Option<NeedleImage>,
    pub(super) judge: Judge,
    pub(super) unbalanced_frames: u64,
    pub(super) buckling_told: bool,
    /// Absent in checkpoints of scenes whose path is not laid.
    #[serde(default)]
    pub(super) laying: Option<Laying>,
}

impl Simulation {
    /// Everything between two frames, exactly; call it right after a frame registered with [`Simulation::stop_after`].
    pub fn checkpoint(&mut self) -> Result<Checkpoint> {
        if self.started != self.collected {
            return Err(Error::Device("a checkpoint between frames that are under way".into()));
        }
        Ok(Checkpoint {
            frames: self.collected,
            steps: self.clock.first_step(self.collected),
            clock: self.clock,
            due_steps: self.due_steps.clone(),
            stiffening_told: self.stiffening_told,
            engine: self.engine.save()?,
            recorder: self.recorder.clone(),
            needle: self.needle.as_ref().map(|needle| needle.save()),
            judge: self.judge.clone(),
            unbalanced_frames: self.unbalanced_frames,
            buckling_told: self.buckling_told,
            laying: self.laying.clone(),
        })
    }

    /// A simulation of the same scene with half the time step, which goes on from `checkpoint`, one of this simulation. What a
    /// state does not hold begins anew: the leapfrog velocities belong to a quarter of an old step earlier.
    ///
    /// # Errors
    /// As [`Simulation::resume`] and [`Simulation::new`].
    pub fn halved(&mut self, checkpoint: &Checkpoint) -> Result<Simulation> {
        let mut scene = self.model.scene.clone();
        scene.solver.time_step = Some(0.5 * checkpoint.clock.dt);
        self.forked(checkpoint, scene, checkpoint.clock.halved())
    }

    /// A simulation of `scene`, which has the mesh, the effects and the motion of this one, from `checkpoint` on with the steps of
    /// `clock`.
    pub(super) fn forked(&mut self, checkpoint: &Checkpoint, scene: Scene, clock: Clock) -> Result<Simulation> {
        self.resume(checkpoint)?;
        let state = self.engine.read_state()?;
        let (mesh, most_steps) = (self.model.mesh.clone(), clock.steps_per_frame);
        let mut next =
            Simulation::prepare(scene, mesh, self.device.clone(), Vec::new(), most_steps, Purpose::default())?;
        next.take_clock(clock)?;
        next.take_laying(checkpoint.laying.clone())?;
        next.engine.write_state(&state)?;
        if let (Some(needle), Some(image)) = (&mut next.needle, &checkpoint.needle) {
            needle.restore(image);
        }
        next.frames = self.frames;
        (next.started, next.collected) = (checkpoint.frames, checkpoint.frames);
        next.recorder = checkpoint.recorder.clone();
        next.judge = checkpoint.judge.clone();
        next.buckling_told = checkpoint.buckling_told;
        next.unbalanced_frames = checkpoint.unbalanced_frames;
        // What was told of the scene was told.
        next.notices.clear();
        Ok(next)
    }

    /// Goes on from a checkpoint of the same scene on the same kind of engine.
    ///
    /// # Errors
    /// `Error::Input` where it belongs to another engine, scene or time step.
    pub fn resume(&mut self, checkpoint: &Checkpoint) -> Result<()> {
        let frame = |clock: &Clock| clock.dt * clock.steps_per_frame as f64;
        let same = (frame(&checkpoint.clock) / frame(&self.clock) - 1.0).abs() < 1e-9
            && checkpoint.frames <= self.frames
            && checkpoint.steps == checkpoint.clock.first_step(checkpoint.frames)
            && checkpoint.needle.is_some() == self.needle.is_some();
        if checkpoint.engine.engine() == self.engine.info().engine && !same {
            return Err(foreign_image(checkpoint.engine.engine(), &checkpoint.engine));
        }
        if same {
            self.take_clock(checkpoint.clock)?;
        }
        self.take_laying(checkpoint.laying.clone())?;
        self.engine.restore(&checkpoint.engine)?;
        if let (Some(needle), Some(image)) = (&mut self.needle, &checkpoint.needle) {
            needle.restore(image);
        }
        (self.started, self.collected) = (checkpoint.frames, checkpoint.frames);
        self.recorder = checkpoint.recorder.clone();
        self.judge = checkpoint.judge.clone();
        self.due_steps = checkpoint.due_steps.clone();
        self.stiffening_told = checkpoint.stiffening_told;
        self.unbalanced_frames = checkpoint.unbalanced_frames;
        self.buckling_told = checkpoint.buckling_told;
        Ok(())
    }
}
