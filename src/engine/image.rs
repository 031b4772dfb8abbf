//! What an engine holds between two frames, exactly.

use serde::{Deserialize, Serialize};

use super::energy::FrameEnergies;
use super::state::State;
use crate::error::Error;

/// What an engine holds between two frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum EngineImage {
    /// Every device buffer that a shader writes and that later steps read, by name; work of gravity since t = 0 [J].
    Gpu { buffers: Vec<(String, Vec<u8>)>, gravity_work: f64 },
    /// The state, what its points have dissipated and earlier frames have told, and whether lanes were asked for.
    Cpu { state: Box<State>, booked: FrameEnergies, lanes: bool },
}

impl EngineImage {
    /// Key of the engine that it belongs to.
    pub fn engine(&self) -> &'static str {
        match self {
            EngineImage::Gpu { .. } => "gpu",
            EngineImage::Cpu { lanes: true, .. } => "cpu",
            EngineImage::Cpu { lanes: false, .. } => "cpu64",
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
