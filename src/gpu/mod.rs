//! The GPU engine: shaders composed from the chosen effects, one submission per display frame.

pub mod compose;
pub mod device;
pub mod engine;
pub mod kernel;
mod layout;
pub mod structs;
mod workers;

pub use device::Gpu;
pub use engine::GpuEngine;
