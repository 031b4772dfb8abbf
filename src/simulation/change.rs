//! A changed scene takes the place of the one that runs, between two frames: other constants, other effects.
//!
//! Constants are written into the buffers that are there. Other effects are other kernels: an engine of their own is made, beside the run
//! where somebody waits for the next frame, and takes over the state. What the old effects remember and the new ones do not have is
//! dropped; what the new ones remember begins now. A change of the same state's energy is booked as work of the change
//! ([`crate::observables::EnergyAccount::changes`]), so the balance goes on.

use std::sync::Arc;

use super::carried::carried;
use super::flexible_needle::FlexibleNeedle;
use super::run_engine::takes_lanes;
use super::start::{choose_step, sizes, too_many_steps};
use super::{LONGEST_LED, Purpose, RunEngine, Simulation, stretch};
use crate::engine::clock::Clock;
use crate::engine::stable_dt::wave_speed_bound;
use crate::engine::{Engine, FramePlan, FrameSums, StepInput};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, GpuEngine};
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::{MOST_STEPS_PER_FRAME, Scene};

/// A step is kept while it is at most so much shorter than the one that a scene would get.
const KEPT_STEP: f64 = 1.25;

/// How far a change reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reach {
    /// Numbers only: the next frame has them.
    Constants,
    /// Effects: another engine takes over the state.
    Kernels,
    /// The mesh, the path or what touches the tissue is another: the run begins anew.
    Start,
}

/// A change that was thought through: the model of the changed scene and its step.
pub struct Change {
    pub reach: Reach,
    model: Arc<Model>,
    stable_dt: f64,
    dt: f64,
    steps_per_frame: u64,
    device: Option<Gpu>,
    purpose: Purpose,
}

impl Change {
    pub fn scene(&self) -> &Scene {
        &self.model.scene
    }

    pub(super) fn model(&self) -> &Model {
        &self.model
    }

    /// The same scene with its path along another line, and its steps: the stable one and the one that is taken [s], and steps per frame.
    pub(super) fn to_line(
        model: Arc<Model>,
        (stable_dt, dt, steps_per_frame): (f64, f64, u64),
        device: Option<Gpu>,
        purpose: Purpose,
    ) -> Self {
        Change { reach: Reach::Kernels, model, stable_dt, dt, steps_per_frame, device, purpose }
    }

    /// The engine of the changed scene; takes as long as starting does, on any thread.
    ///
    /// # Errors
    /// As [`GpuEngine::new`].
    pub fn engine(&self) -> Result<RunEngine> {
        let most_steps = self.purpose.most_steps(self.steps_per_frame);
        RunEngine::new(&self.model, self.device.as_ref(), self.dt, most_steps, self.purpose)
    }

    fn gpu_engine(&self, gpu: &Gpu) -> Result<GpuEngine> {
        let most_steps = self.purpose.most_steps(self.steps_per_frame);
        GpuEngine::for_purpose(self.model.clone(), gpu.clone(), self.dt, most_steps, self.purpose.drawn)
    }

    /// Makes an engine of the changed scene and lets it go after one step: its device keeps the kernels, and its driver may keep
    /// them on disk, so that the change itself finds them compiled. Drivers compile when a kernel is first used. Without a device
    /// there is nothing to do.
    ///
    /// # Errors
    /// As [`GpuEngine::new`], and `Error::Device`.
    pub fn prepare(&self) -> Result<()> {
        let Some(gpu) = &self.device else { return Ok(()) };
        let mut engine = self.gpu_engine(gpu)?;
        let steps_elsewhere = takes_lanes(&self.model, gpu, self.purpose);
        if self.purpose.drawn {
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            engine.encode_fields(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
        }
        if steps_elsewhere {
            return Ok(());
        }
        let steps = vec![StepInput::at(&self.model, 0.0, self.dt)];
        engine.start_frame(&FramePlan { frame: 0, first_step: 0, steps, centre_line: None })?;
        engine.collect(true)?;
        Ok(())
    }
}

impl Simulation {
    /// Thinks a changed scene through; nothing has changed yet.
    ///
    /// # Errors
    /// `Error::Input` where a frame would need too many steps.
    pub fn plan_change(&self, mut scene: Scene) -> Result<Change> {
        let now = &self.model.scene;
        if self.purpose.led {
            scene = scene.for_hand();
        }
        let same_mesh = now.tissue == scene.tissue && now.mesh == scene.mesh;
        let same_lines = |mesh: &Mesh| *mesh == self.model.mesh;
        let mesh = if same_mesh && now.mesh.is_some() { self.model.mesh.clone() } else { Mesh::of_scene(&scene) };
        let stays = same_lines(&mesh)
            && now.motion == scene.motion
            && now.tool == scene.tool
            && now.faces == scene.faces
            && now.supports == scene.supports
            && now.loads == scene.loads
            && now.skin_free == scene.skin_free
            && touching(now) == touching(&scene)
            && now.effects.flexible_needle == scene.effects.flexible_needle;
        let mut model = Model::new(scene, mesh);
        if let Some(laying) = self.laying.as_ref().filter(|_| model.laid.is_some()) {
            model = model.relaid(laying.line().clone());
        }
        let model = Arc::new(model);
        let stable_dt = wave_speed_bound(&model);
        let (mut dt, mut steps_per_frame) = choose_step(&model, stable_dt);
        if steps_per_frame > MOST_STEPS_PER_FRAME {
            return Err(too_many_steps(&model.scene, stable_dt, steps_per_frame));
        }
        let same_frames = model.scene.solver.frame_rate == now.solver.frame_rate;
        if same_frames && model.scene.solver.time_step.is_none() && self.dt() <= dt && dt <= KEPT_STEP * self.dt() {
            (dt, steps_per_frame) = (self.dt(), self.steps_per_frame());
        }
        let reach = match (stays && same_frames, now.effects.keys() == model.scene.effects.keys()) {
            (false, _) => Reach::Start,
            (true, false) => Reach::Kernels,
            (true, true) => Reach::Constants,
        };
        let (device, purpose) = (self.device().cloned(), self.purpose);
        Ok(Change { reach, model, stable_dt, dt, steps_per_frame, device, purpose })
    }

    /// Gives the running engine the constants of a change. False where they do not fit its buffers or kernels; nothing has changed then.
    /// Waits for the frames under way.
    ///
    /// # Errors
    /// `Error::Device`; `Error::Input` in the middle of frames whose results nobody has collected.
    pub fn retune(&mut self, change: &Change) -> Result<bool> {
        self.between_frames()?;
        if change.reach != Reach::Constants {
            return Ok(false);
        }
        let present = self.on_the_present_line(change);
        let change = present.as_ref().unwrap_or(change);
        let before = self.measured()?;
        if !self.engine.retune(change.model.clone(), change.dt, change.steps_per_frame as usize)? {
            return Ok(false);
        }
        self.adopted(change, before)?;
        Ok(true)
    }

    /// Goes on with another engine of the changed scene, which takes over the state.
    ///
    /// # Errors
    /// As [`Simulation::retune`].
    pub fn adopt(&mut self, change: &Change, mut engine: RunEngine) -> Result<()> {
        self.between_frames()?;
        let present = self.on_the_present_line(change);
        if let Some(present) = &present {
            engine = present.engine()?;
        }
        let change = present.as_ref().unwrap_or(change);
        let before = self.measured()?;
        let state = self.engine.read_state()?;
        engine.write_state(&carried(&state, &self.model, &change.model))?;
        self.engine = engine;
        self.engines += 1;
        self.adopted(change, before)
    }

    /// A change that was thought through before the path was laid anew, on the line that it has now; `None` where it is that.
    fn on_the_present_line(&self, change: &Change) -> Option<Change> {
        let (laying, laid) = self.laying.as_ref().zip(change.model.laid.as_ref())?;
        (laid.line != *laying.line()).then(|| Change {
            reach: change.reach,
            model: Arc::new(change.model.relaid(laying.line().clone())),
            stable_dt: change.stable_dt,
            dt: change.dt,
            steps_per_frame: change.steps_per_frame,
            device: change.device.clone(),
            purpose: change.purpose,
        })
    }

    /// A change at once, whatever it takes; false where the run has to begin anew, and goes on unchanged.
    ///
    /// # Errors
    /// As [`Simulation::retune`] and [`Change::engine`].
    pub fn change(&mut self, scene: Scene) -> Result<bool> {
        let change = self.plan_change(scene)?;
        if change.reach == Reach::Start {
            return Ok(false);
        }
        if !self.retune(&change)? {
            self.adopt(&change, change.engine()?)?;
        }
        Ok(true)
    }

    fn between_frames(&self) -> Result<()> {
        match self.started == self.collected {
            true => Ok(()),
            false => Err(Error::Device("a change of the scene between frames that are under way".into())),
        }
    }

    /// The engine has the change; the rest of the simulation follows.
    pub(super) fn adopted(&mut self, change: &Change, before: Option<FrameSums>) -> Result<()> {
        if (change.dt, change.steps_per_frame) != (self.clock.dt, self.clock.steps_per_frame) {
            self.clock = match self.collected {
                0 => Clock::new(change.dt, change.steps_per_frame),
                frame => self.clock.changed(frame, change.dt, change.steps_per_frame),
            };
        }
        self.stable_dt = change.stable_dt;
        self.model = change.model.clone();
        self.judge.change(sizes(&self.model));
        self.due_steps.clear();
        let end = match self.purpose.led {
            true => LONGEST_LED,
            false => self.model.duration(),
        };
        self.total_steps = self.clock.steps_until(end);
        self.frames = 1 + self.clock.frame_of(self.total_steps);
        self.watch_stretch = stretch::must_watch(&self.model);
        if let Some(image) = self.needle.as_ref().map(|needle| needle.save()) {
            // The same beam in another tissue.
            self.needle = FlexibleNeedle::new(&self.model, self.kinematics.as_ref(), self.clock.dt);
            if let Some(needle) = &mut self.needle {
                needle.restore(&image);
            }
        }
        if let (Some(before), Some(after)) = (before, self.measured()?) {
            self.recorder.book_change(&before, &after);
        }
        Ok(())
    }

    /// The state as a frame without a step measures it; nothing before the first frame.
    pub(super) fn measured(&mut self) -> Result<Option<FrameSums>> {
        if self.collected == 0 {
            return Ok(None);
        }
        let (frame, first_step) = (self.collected, self.clock.first_step(self.collected));
        self.engine.start_frame(&FramePlan { frame, first_step, steps: Vec::new(), centre_line: None })?;
        let sums = self.engine.collect(true)?;
        Ok(Some(sums.ok_or_else(|| Error::Device("the engine lost a frame".into()))?))
    }
}

/// What touches the tissue: with another one the memory of contact and path means nothing.
fn touching(scene: &Scene) -> ([bool; 4], Option<Vec<crate::effects::cohesive::Plane>>) {
    let e = &scene.effects;
    let kinds = [e.puncture.is_some(), e.indentation.is_some(), e.cohesive.is_some(), e.flexible_needle.is_some()];
    (kinds, e.cohesive.as_ref().map(|c| c.planes.clone()))
}
