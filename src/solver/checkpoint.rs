//! A simulation between two frames, exactly: a run that goes on from it gives the same numbers bit for bit on the same
//! adapter.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::clock::Clock;
use super::engine::State;
use super::stiffening::DueStep;
use crate::error::Error;
use crate::needle::flexible::NeedleImage;
use crate::observables::{FrameEnergies, Recorder};
use crate::verdict::Judge;

/// What an engine holds between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum EngineImage {
    /// Every device buffer that a shader writes and that later steps read, by name; work of gravity since t = 0 [J].
    Gpu { buffers: Vec<(String, Vec<u8>)>, gravity_work: f64 },
    /// The state, and what its points have dissipated and earlier frames have told.
    Cpu { state: Box<State>, booked: FrameEnergies },
}

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
}

impl EngineImage {
    /// Key of the engine that it belongs to.
    pub fn engine(&self) -> &'static str {
        match self {
            EngineImage::Gpu { .. } => "gpu",
            EngineImage::Cpu { .. } => "cpu",
        }
    }
}

/// The image does not belong to the engine `wanted` and its model.
pub fn foreign_image(wanted: &str, image: &EngineImage) -> Error {
    let (reason, way_out) = match image.engine() == wanted {
        true => ("it belongs to another scene, mesh or version".to_string(), "start the run anew".to_string()),
        false => (
            format!("it was written by the engine `{}`, this is `{wanted}`", image.engine()),
            format!("resume with --engine {}", image.engine()),
        ),
    };
    Error::input(format!("the checkpoint does not fit: {reason}"), way_out)
}
