//! One run in memory: model, engine, time step and the order of frames. Commands and tests use it alike.

use std::collections::{BTreeSet, VecDeque};
use std::str::FromStr;
use std::sync::Arc;

use super::advice::advice;
use super::checkpoint::{Checkpoint, foreign_image};
use super::clock::Clock;
use super::elements::{CellShape, CellStates, Elements};
use super::engine::{Engine, FramePlan, FrameSums, State, StepInput};
use super::stable_dt::{power_iteration, wave_speed_bound};
use super::stiffening::DueStep;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::material::{Verdict, von_mises};
use crate::material_point::PointState;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::needle::centre_line::CentreLine;
use crate::needle::flexible::FlexibleNeedle;
use crate::needle::{Kinematics, ToolPose};
use crate::observables::{
    CoreSample, FieldSnapshot, FrameRecord, NeedleRecord, Recorder, TargetRecord, cells_in_needle,
};
use crate::scene::motion::HandPose;
use crate::scene::{MOST_STEPS_PER_FRAME, Scene};
use crate::verdict::{Judge, Sizes, Verdict as RunVerdict};

/// Which engine the user wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EngineChoice {
    /// The best adapter; the CPU where there is none.
    #[default]
    Auto,
    Gpu,
    Cpu,
}

impl EngineChoice {
    /// As the command line has it.
    pub fn key(self) -> &'static str {
        match self {
            EngineChoice::Auto => "auto",
            EngineChoice::Gpu => "gpu",
            EngineChoice::Cpu => "cpu",
        }
    }
}

impl FromStr for EngineChoice {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "auto" => Ok(EngineChoice::Auto),
            "gpu" => Ok(EngineChoice::Gpu),
            "cpu" => Ok(EngineChoice::Cpu),
            _ => Err(format!("there is no engine `{text}`; use auto, gpu or cpu")),
        }
    }
}

/// Frames that may be under way before the oldest result is awaited.
pub(super) const AHEAD: u64 = 2;

/// Longest motion that a hand may lead [s].
pub(super) const LONGEST_LED: f64 = 3600.0;

/// What a simulation is made for, beside records.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Purpose {
    /// A hand leads the tool, not the phases of the scene.
    pub led: bool,
    /// The device keeps the fields that a window draws.
    pub drawn: bool,
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
    pub model: Arc<Model>,
    /// Stable step: the wave-speed bound at rest [s].
    pub stable_dt: f64,
    pub(super) engine: Box<dyn Engine>,
    device: Option<Gpu>,
    pub(super) purpose: Purpose,
    pub(super) recorder: Recorder,
    pub(super) clock: Clock,
    pub(super) total_steps: u64,
    pub(super) frames: u64,
    /// Motion of the tool: the phases of the scene, or what a hand has led so far.
    pub(super) kinematics: Option<Kinematics>,
    /// Frames that a hand has led.
    led_frames: u64,
    pub(super) started: u64,
    pub(super) collected: u64,
    /// Steps of [`Simulation::try_steps`].
    tried_steps: u64,
    pub(super) judge: Judge,
    /// More steps that the stiffness of the tissue asks for.
    pub(super) due_steps: VecDeque<DueStep>,
    pub(super) stiffening_told: bool,
    /// Frames after which the state is read, so that no later frame may have been started.
    stops: BTreeSet<u64>,
    pub(super) watch_stretch: bool,
    /// The beam of a flexible needle; every frame waits for the one before.
    pub(super) needle: Option<FlexibleNeedle>,
    /// Frames in which the beam did not find its balance.
    unbalanced_frames: u64,
    buckling_told: bool,
    /// Things the user should know, one sentence each.
    pub notices: Vec<String>,
}

/// Time step and steps per frame that a model gets.
///
/// The computed step is `safety` times the stable one; a scene's own step is taken as it is. Both are shortened so that
/// a whole number of steps fills a frame.
pub fn choose_step(model: &Model, stable_dt: f64) -> (f64, u64) {
    let solver = &model.scene.solver;
    let wanted = solver.time_step.unwrap_or(solver.safety * stable_dt);
    let frame = 1.0 / solver.frame_rate;
    let steps = (frame / wanted * (1.0 - 1e-9)).ceil().max(1.0);
    (frame / steps, steps as u64)
}

impl Simulation {
    /// Prepares a scene: mesh, model, stable step, engine.
    ///
    /// # Errors
    /// `Error::Adapter` where the wanted engine is not to be had, `Error::Input` where the mesh does not fit the device.
    pub fn new(scene: Scene, choice: EngineChoice) -> Result<Self> {
        let mesh = Mesh::of_scene(&scene);
        Self::with_mesh(scene, mesh, choice)
    }

    /// The same on a given mesh.
    pub fn with_mesh(scene: Scene, mesh: impl Into<Mesh>, choice: EngineChoice) -> Result<Self> {
        let (device, notices) = Self::choose_device(choice)?;
        Self::prepare(scene, mesh.into(), device, notices, MOST_STEPS_PER_FRAME, Purpose::default())
    }

    /// The same on this device, without one on the CPU engine.
    pub fn on(scene: Scene, device: Option<Gpu>) -> Result<Self> {
        Self::for_purpose(scene, device, Purpose::default())
    }

    /// The same for a purpose. A tool that a hand leads stands on the surface until [`Simulation::lead`] is called.
    pub fn for_purpose(mut scene: Scene, device: Option<Gpu>, purpose: Purpose) -> Result<Self> {
        if purpose.led {
            scene = scene.for_hand();
        }
        let mesh = Mesh::of_scene(&scene);
        let mut simulation = Self::prepare(scene, mesh, device, Vec::new(), MOST_STEPS_PER_FRAME, purpose)?;
        // A needle that bends is solved one frame ahead: it follows the hand a frame later.
        if let (Some(_), Some(pose)) = (&simulation.needle, simulation.hand()) {
            simulation.lead(&pose);
        }
        Ok(simulation)
    }

    /// Where the hand has led the tool so far; `None` where no hand leads.
    pub fn hand(&self) -> Option<HandPose> {
        self.kinematics.as_ref().filter(|k| k.is_led()).map(|k| k.last())
    }

    /// Leads the tool to `pose` within one more frame, which may then be started.
    pub fn lead(&mut self, pose: &HandPose) {
        let until = self.clock.time_of(self.clock.first_step(self.led_frames + 1));
        if let Some(kinematics) = self.kinematics.as_mut().filter(|k| k.is_led()) {
            kinematics.lead(pose, until);
            self.led_frames += 1;
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

    /// The device of a choice, and what is to be said about it; no device: the CPU engine.
    fn choose_device(choice: EngineChoice) -> Result<(Option<Gpu>, Vec<String>)> {
        let mut notices = Vec::new();
        let device = match choice {
            EngineChoice::Cpu => None,
            EngineChoice::Gpu => Some(Gpu::open()?),
            EngineChoice::Auto => match Gpu::open() {
                Ok(gpu) => Some(gpu),
                // A name that fits nothing is the user's mistake; no adapter at all is not.
                Err(error) if crate::gpu::device::adapter_wanted_by_name() => return Err(error),
                Err(error) => {
                    notices.push(format!("running on the CPU engine (f64): {error}"));
                    None
                }
            },
        };
        Ok((device, notices))
    }

    /// Model, step and engine, with at most `most_steps` steps per frame.
    fn prepare(
        scene: Scene,
        mesh: Mesh,
        device: Option<Gpu>,
        mut notices: Vec<String>,
        most_steps: u64,
        purpose: Purpose,
    ) -> Result<Self> {
        let model = Arc::new(Model::new(scene, mesh));
        let stable_dt = wave_speed_bound(&model);
        let (dt, steps_per_frame) = choose_step(&model, stable_dt);
        if steps_per_frame > most_steps {
            return Err(too_many_steps(&model.scene, stable_dt, steps_per_frame));
        }
        if dt > stable_dt {
            let limit = power_iteration(&model);
            let verdict = match dt > limit {
                true => "above that limit: the run will fail",
                false => "within it at rest, but squeezed cells and contact may take the margin",
            };
            notices.push(format!(
                "the scene's time step gives {:.3} us, more than the stable step {:.3} us (wave-speed bound; limit by \
                 power iteration {:.3} us): {verdict}; drop solver.time_step_us or lower it",
                dt * 1e6,
                stable_dt * 1e6,
                limit * 1e6
            ));
        }
        if model.scene.motion.is_free() && model.puncture.is_some() {
            notices.push(
                "the motion leaves one straight line: the path is not planned but found while the tip moves (free path)"
                    .into(),
            );
        }
        notices.extend(advice(&model));
        let most = purpose.most_steps(steps_per_frame);
        let engine = super::change::engine(&model, device.as_ref(), dt, most, purpose.drawn)?;
        let kinematics = match purpose.led {
            true => model.kinematics.is_some().then(|| Kinematics::led(&model.scene.motion)),
            false => model.kinematics.clone(),
        };
        let duration = if purpose.led { LONGEST_LED } else { model.duration() };
        let clock = Clock::new(dt, steps_per_frame);
        let total_steps = clock.steps_until(duration);
        let frames = 1 + clock.frame_of(total_steps);
        let watch_stretch = model.materials.iter().any(|m| !matches!(m.law.verdict(), Verdict::Stable));
        Ok(Simulation {
            stable_dt,
            clock,
            engine,
            device,
            purpose,
            recorder: Recorder::default(),
            total_steps,
            frames,
            started: 0,
            collected: 0,
            tried_steps: 0,
            judge: Judge::new(sizes(&model)),
            due_steps: VecDeque::new(),
            stiffening_told: false,
            stops: BTreeSet::new(),
            watch_stretch,
            // The first frame is a single step.
            needle: FlexibleNeedle::new(&model, kinematics.as_ref(), dt),
            kinematics,
            led_frames: 0,
            unbalanced_frames: 0,
            buckling_told: false,
            notices,
            model,
        })
    }

    /// The verdict on the run so far.
    pub fn verdict(&self) -> &RunVerdict {
        self.judge.verdict()
    }

    pub fn engine(&mut self) -> &mut dyn Engine {
        self.engine.as_mut()
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

    pub fn steps_per_frame(&self) -> u64 {
        self.clock.steps_per_frame
    }

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

    pub(super) fn plan(&self, frame: u64) -> FramePlan {
        let (clock, dt) = (&self.clock, self.clock.dt);
        let first_step = clock.first_step(frame);
        let last = clock.first_step(frame + 1).min(self.total_steps.max(1));
        let tool = self.kinematics.as_ref();
        let mut plan = FramePlan {
            frame,
            first_step,
            steps: (first_step..last)
                .map(|step| StepInput { step, ..StepInput::with(&self.model, tool, clock.time_of(step), dt) })
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
    pub fn start_frames(&mut self) -> Result<()> {
        while self.may_start(self.started) {
            self.take_due_steps()?;
            self.engine.start_frame(&self.plan(self.started))?;
            self.started += 1;
        }
        Ok(())
    }

    /// The next record; `None` after the last frame, and where no frame has been led.
    ///
    /// # Errors
    /// `Error::Diverged` when the state has left the range in which its numbers mean something; `Error::Device`.
    pub fn next_frame(&mut self) -> Result<Option<FrameRecord>> {
        self.start_frames()?;
        if self.collected == self.started {
            return Ok(None);
        }
        let Some(mut sums) = self.engine.collect(true)? else {
            return Err(Error::Device("the engine lost a frame".into()));
        };
        self.collected += 1;
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

    /// The beam's answer to the loads of the frame that was collected last.
    pub(super) fn answer_of_the_needle(&mut self, sums: &mut FrameSums) -> NeedleRecord {
        let (clock, dt, last) = (&self.clock, self.clock.dt, self.total_steps.max(1));
        let end = |frame: u64| clock.time_of(clock.first_step(frame + 1).min(last));
        let next = (self.collected < self.frames)
            .then(|| (end(self.collected), end(self.collected) - clock.time_of(clock.first_step(self.collected))));
        let broken = sums.health.not_finite || !sums.needle_loads.iter().all(|l| l.is_finite());
        match (&mut self.needle, &self.kinematics) {
            // Loads of a broken state mean nothing; the run stops right after.
            (Some(needle), Some(tool)) if !broken => needle.answer(tool, sums, f64::from(sums.steps) * dt, next),
            _ => NeedleRecord::default(),
        }
    }

    /// Notices about a needle that has buckled or whose beam was not in balance.
    fn tell_of_the_needle(&mut self, record: &FrameRecord) {
        let bent = &record.needle;
        if bent.buckled && !self.buckling_told {
            self.buckling_told = true;
            self.notices.push(format!(
                "the needle buckles at a depth of {:.2} mm: {:.3} N of compression, {:.2} mm from its axis, its tip {:.2} mm behind; take a thicker or stiffer needle or a shorter flexible_needle.free_length_mm",
                record.depth * 1e3,
                bent.compression,
                bent.largest_offset * 1e3,
                bent.retreat * 1e3
            ));
        }
        if bent.unbalanced {
            self.unbalanced_frames += 1;
            if self.unbalanced_frames == 1 {
                self.notices.push(format!(
                    "the flexible needle did not find its balance at {:.4} s; its shape there is the best one found",
                    record.time
                ));
            }
        }
    }

    /// Stops when an element leaves the stretch range in which the material is stable.
    fn check_stretch(&mut self, record: &FrameRecord) -> Result<()> {
        let verdicts: Vec<Verdict> = self.model.materials.iter().map(|m| m.law.verdict()).collect();
        let state = self.engine.read_state()?;
        for (cell, h) in displacement_gradients(&self.model.mesh, &state).into_iter().enumerate() {
            let (low, high) = principal_stretch_range(glam::DMat3::IDENTITY + h);
            let (broken, limit, value) = match verdicts[self.model.material_index(cell)] {
                Verdict::StableBelow(limit) => (high > limit, limit, high),
                Verdict::StableAbove(limit) => (low < limit, limit, low),
                _ => (false, 0.0, 0.0),
            };
            if broken {
                let x = self.model.mesh.rest_position(self.model.mesh.cell_nodes(cell)[0]) * 1e3;
                return Err(Error::Diverged {
                    frame: record.frame,
                    step: record.step,
                    time_s: record.time,
                    message: format!(
                        "stage element_forces: cell {cell} at ({:.2}, {:.2}, {:.2}) mm has the principal stretch {value:.4}, \
                         beyond the limit {limit:.4} up to which these constants are stable",
                        x.x, x.y, x.z
                    ),
                });
            }
        }
        Ok(())
    }

    /// The centre-line of a needle that bends, at the end of the frame that was collected last.
    pub fn centre_line(&self) -> Option<CentreLine> {
        self.needle.as_ref().map(|needle| needle.centre_line())
    }

    /// Fields of the present state; call it right after a frame registered with [`Simulation::stop_after`].
    pub fn snapshot(&mut self, record: &FrameRecord) -> Result<FieldSnapshot> {
        let state = self.engine.read_state()?;
        let line = self.needle.as_ref().map(|needle| needle.centre_line());
        Ok(snapshot(&self.model, self.kinematics.as_ref(), record, state, line))
    }
}

/// The stable step of the model is too short for the frames of the scene.
pub(super) fn too_many_steps(scene: &Scene, stable_dt: f64, steps: u64) -> Error {
    let per_step = steps as f64 / MOST_STEPS_PER_FRAME as f64;
    Error::input(
        format!(
            "{}: a frame of {:.4} s needs {steps} steps of {:.3e} s (the stable step is {stable_dt:.3e} s), at most {MOST_STEPS_PER_FRAME} \
             are kept in memory",
            scene.path.display(),
            1.0 / scene.solver.frame_rate,
            1.0 / scene.solver.frame_rate / steps as f64
        ),
        format!(
            "raise solver.frame_rate_hz to {:.0} or more, or lengthen the step: larger cells (tissue.cell_size_mm), softer or \
             denser material, mass_scaling",
            (scene.solver.frame_rate * per_step).ceil()
        ),
    )
}

/// What the verdict on a run of this model is measured against.
pub(super) fn sizes(model: &Model) -> Sizes {
    let volume: f64 = (0..model.mesh.cell_count()).map(|cell| model.mesh.cell_volume(cell)).sum();
    let strain = crate::verdict::FLOOR_STRAIN;
    Sizes {
        nodes: model.mesh.node_count(),
        cells: model.mesh.cell_count(),
        floor: model.scene.material.law.shear_modulus().abs() * volume * strain * strain,
        mass_scaling: model.mass_scaling(),
    }
}

/// H = F - I at the centre of every cell.
fn displacement_gradients(mesh: &Mesh, state: &State) -> Vec<glam::DMat3> {
    (0..mesh.cell_count())
        .map(|cell| {
            let shape = CellShape::new(mesh, cell);
            shape.displacement_gradient(&shape.gather(&state.displacement))
        })
        .collect()
}

/// Smallest and largest principal stretch of F: roots of the eigenvalues of C, by the trigonometric solution of the
/// characteristic cubic.
fn principal_stretch_range(f: glam::DMat3) -> (f64, f64) {
    let c = f.transpose() * f;
    let mean = (c.x_axis.x + c.y_axis.y + c.z_axis.z) / 3.0;
    let d = c - glam::DMat3::IDENTITY * mean;
    let square = d.x_axis.length_squared() + d.y_axis.length_squared() + d.z_axis.length_squared();
    let p = (square / 6.0).sqrt();
    if p < 1e-15 {
        return (mean.sqrt(), mean.sqrt());
    }
    let angle = (d.determinant() / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * p * angle.cos();
    let smallest = mean + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos();
    (smallest.max(0.0).sqrt(), largest.max(0.0).sqrt())
}

/// Stresses and Jacobians of a state, in f64; `line`: the centre-line of a bent needle then.
pub fn snapshot(
    model: &Model,
    kinematics: Option<&Kinematics>,
    record: &FrameRecord,
    state: State,
    line: Option<CentreLine>,
) -> FieldSnapshot {
    let elements = Elements::new(model);
    let gradients = displacement_gradients(&model.mesh, &state);
    let mut fields = FieldSnapshot {
        frame: record.frame,
        time: record.time,
        depth: record.depth,
        axial_force: record.force.axial,
        centre_line: line,
        ..Default::default()
    };
    let pose = kinematics.map(|k| {
        let pose = k.pose(record.time);
        // The tip of a bent needle stays behind.
        ToolPose { tip: pose.tip - pose.direction * record.needle.retreat, ..pose }
    });
    fields.tool_pose = pose.map(|pose| (pose.tip, pose.direction));
    let cuts = pose.filter(|_| model.puncture.is_some());
    fields.cells_in_needle = cuts.map(|pose| cells_in_needle(model, &state, &pose, line.as_ref()));
    let targets = model.scene.targets.iter().zip(&model.targets);
    fields.targets = targets.map(|(target, point)| target.position + point.value(&state.displacement)).collect();
    let states = CellStates { points: &state.points, stiffness: &state.stiffness };
    let averaged = elements.averaged_volumetrics(model, &state.displacement, states);
    let fresh = PointState::default();
    for (cell, h) in gradients.into_iter().enumerate() {
        let f = glam::DMat3::IDENTITY + h;
        let j = f.determinant();
        let material = model.material(cell);
        let point = states.point(cell).unwrap_or(&fresh);
        let damage = material.degradation(point, model.mesh.cell_volume(cell).cbrt());
        let intact = states.remaining(cell) * (1.0 - damage);
        let volumetric = averaged.as_ref().map_or_else(|| material.volumetric(h, intact), |a| a[cell]);
        // An inverted cell has no Cauchy stress; its J tells.
        let sigma = match j > 0.0 {
            true => material.stress(h, volumetric, intact, point) * f.transpose() * (1.0 / j),
            false => glam::DMat3::ZERO,
        };
        fields.von_mises.push(von_mises(sigma));
        fields.jacobian.push(j);
        fields.pressure.push(-(sigma.x_axis.x + sigma.y_axis.y + sigma.z_axis.z) / 3.0);
        if model.effects.plasticity.is_some() {
            fields.plastic_strain.push(point.plastic.alpha);
        }
        if model.effects.damage.is_some() {
            fields.damage.push(damage);
        }
    }
    if !model.cell_material.is_empty() {
        fields.material = model.cell_material.iter().map(|m| f64::from(*m)).collect();
    }
    fields.displacement = state.displacement;
    fields.stiffness = state.stiffness;
    fields
}
