//! How a run begins: device, mesh, model, step, engine.

use std::collections::{BTreeSet, VecDeque};
use std::str::FromStr;
use std::sync::Arc;

use super::advice::advice;
use super::flexible_needle::FlexibleNeedle;
use super::laying::Laying;
use super::{LONGEST_LED, Purpose, RunEngine, Simulation, stretch};
use crate::cpu::unknown_to_lanes;
use crate::engine::clock::Clock;
use crate::engine::stable_dt::{power_iteration, wave_speed_bound};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::device::adapter_wanted_by_name;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::needle::Kinematics;
use crate::observables::{Judge, Recorder, Sizes};
use crate::scene::{MOST_STEPS_PER_FRAME, Scene};
use crate::verdict::FLOOR_STRAIN;

/// Which engine the user wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EngineChoice {
    /// A hardware adapter; else the CPU engine where its lanes know the scene; else a software adapter; else the CPU engine.
    #[default]
    Auto,
    /// The best adapter, a software one where there is no other.
    Gpu,
    /// The CPU engine, cells in lanes of f32 where these know the scene.
    Cpu,
    /// The CPU engine in f64: the reference.
    Cpu64,
}

impl EngineChoice {
    /// As the command line has it.
    pub fn key(self) -> &'static str {
        match self {
            EngineChoice::Auto => "auto",
            EngineChoice::Gpu => "gpu",
            EngineChoice::Cpu => "cpu",
            EngineChoice::Cpu64 => "cpu64",
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
            "cpu64" => Ok(EngineChoice::Cpu64),
            _ => Err(format!("there is no engine `{text}`; use auto, gpu, cpu or cpu64")),
        }
    }
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
        let mesh = mesh.into();
        let (device, notices) = Self::choose_device(choice, &scene)?;
        let lanes = matches!(choice, EngineChoice::Auto | EngineChoice::Cpu);
        let purpose = Purpose { lanes, ..Purpose::default() };
        Self::prepare(scene, mesh, device, notices, MOST_STEPS_PER_FRAME, purpose)
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
        simulation.lead_ahead();
        Ok(simulation)
    }

    /// A needle that bends is solved one frame ahead: it follows the hand a frame later.
    pub(super) fn lead_ahead(&mut self) {
        if let (Some(_), Some(pose)) = (&self.needle, self.hand()) {
            self.lead(&pose);
        }
    }

    /// The device of a choice, and what is to be said about it; no device: the CPU engine.
    fn choose_device(choice: EngineChoice, scene: &Scene) -> Result<(Option<Gpu>, Vec<String>)> {
        let mut notices = Vec::new();
        let device = match choice {
            EngineChoice::Cpu | EngineChoice::Cpu64 => None,
            EngineChoice::Gpu => Some(Gpu::open()?),
            EngineChoice::Auto => match Gpu::open() {
                Ok(gpu) if gpu.is_software() && !adapter_wanted_by_name() && unknown_to_lanes(scene).is_none() => {
                    notices.push(format!(
                        "the adapter {} is software: the CPU engine takes this scene, in less time (--engine gpu: on the adapter)",
                        gpu.info.name
                    ));
                    None
                }
                Ok(gpu) => Some(gpu),
                // A name that fits nothing is the user's mistake; no adapter at all is not.
                Err(error) if adapter_wanted_by_name() => return Err(error),
                Err(error) => {
                    notices.push(format!("running on the CPU engine: {error}"));
                    None
                }
            },
        };
        Ok((device, notices))
    }

    /// Model, step and engine, with at most `most_steps` steps per frame.
    pub(super) fn prepare(
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
            let how = match &model.laid {
                Some(_) => "the path is not planned but laid while the needle comes (free path)",
                None => "the path is not planned but found while the tip moves (free path)",
            };
            notices.push(format!("the motion leaves one straight line: {how}"));
        }
        notices.extend(advice(&model));
        let most = purpose.most_steps(steps_per_frame);
        let engine = RunEngine::new(&model, device.as_ref(), dt, most, purpose)?;
        let kinematics = match purpose.led {
            true => model.kinematics.is_some().then(|| Kinematics::led(&model.scene.motion)),
            false => model.kinematics.clone(),
        };
        let duration = if purpose.led { LONGEST_LED } else { model.duration() };
        let clock = Clock::new(dt, steps_per_frame);
        let total_steps = clock.steps_until(duration);
        let frames = 1 + clock.frame_of(total_steps);
        let watch_stretch = stretch::must_watch(&model);
        Ok(Simulation {
            stable_dt,
            clock,
            engine,
            engines: 0,
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
            laying: Laying::of(&model),
            led_frames: 0,
            unbalanced_frames: 0,
            buckling_told: false,
            notices,
            model,
        })
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
    let strain = FLOOR_STRAIN;
    Sizes {
        nodes: model.mesh.node_count(),
        cells: model.mesh.cell_count(),
        floor: model.scene.material.law.shear_modulus().abs() * volume * strain * strain,
        mass_scaling: model.mass_scaling(),
    }
}
