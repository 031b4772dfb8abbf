//! The contract between a run and its engines: what an engine is asked and answers ([`Engine`]), what passes between them ([`frame`],
//! [`state`], [`image`]), the stages of a step ([`stage`]), when steps happen ([`clock`]), how long they may be ([`stable_dt`]), and the
//! finite elements in f64 that both sides measure with ([`elements`]).
//!
//! Nothing here knows an engine, nor the run.

pub mod clock;
pub mod elements;
pub mod energy;
pub mod frame;
pub mod image;
pub mod stable_dt;
pub mod stage;
pub mod state;

use std::sync::Arc;

use glam::DVec3;

pub use energy::{EnergyAccount, EnergyPart, FrameEnergies};
pub use frame::{DriveStep, FramePlan, FrameSums, Health, LARGEST_DISPLACEMENT, StepInput, WATCHED_STEP_RATIO};
pub use image::{EngineImage, foreign_image};
pub use stage::Stage;
pub use state::{ContactState, State};

use crate::error::Result;
use crate::model::Model;

/// What an engine tells about itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EngineInfo {
    /// `gpu` or `cpu`.
    pub engine: String,
    pub adapter: String,
    pub driver: String,
    /// Bytes of all buffers on the device (or of the arrays of the CPU engine).
    pub device_bytes: u64,
    /// True for a software adapter.
    pub software: bool,
}

/// A solver that can advance a model. Frames are started in order; results come in the same order, possibly a
/// frame or two later.
pub trait Engine: Send {
    fn info(&self) -> &EngineInfo;
    /// Starts one frame. Returns as soon as the work is submitted.
    fn start_frame(&mut self, plan: &FramePlan) -> Result<()>;
    /// The next finished frame. With `wait`, blocks until one is there; `None` when none is under way (or
    /// finished, without `wait`).
    fn collect(&mut self, wait: bool) -> Result<Option<FrameSums>>;
    /// Takes the constants of `model`, which has the mesh and the effects of the present one, and steps of `dt` [s], `steps` of them in
    /// a frame; the state stays. Call it between frames. False where other buffers or kernels would be needed; nothing has changed then.
    fn retune(&mut self, model: Arc<Model>, dt: f64, steps: usize) -> Result<bool>;
    /// The present state (waits for all frames under way).
    fn read_state(&mut self) -> Result<State>;
    /// Replaces the state, for tests, resumed runs and bisecting.
    fn write_state(&mut self, state: &State) -> Result<()>;
    /// Everything between two frames, exactly (waits for all frames under way).
    fn save(&mut self) -> Result<EngineImage>;
    /// Goes back to an image of the same model and time step.
    ///
    /// # Errors
    /// `Error::Input` where the image is that of another engine or model.
    fn restore(&mut self, image: &EngineImage) -> Result<()>;
    /// Loses the device, as when a driver resets it, to see what follows: every later call fails with `Error::Device`. Nothing on
    /// an engine without one.
    fn lose_device(&mut self) {}
    /// Internal nodal forces of the present displacement, `f_int` [N] (the tissue pushes the node with -f_int).
    fn internal_forces(&mut self) -> Result<Vec<DVec3>>;
}
