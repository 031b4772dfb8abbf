//! The GPU engine: shaders composed from the chosen effects, one submission per display frame.

pub mod arrays;
pub mod compose;
pub mod device;
pub mod engine;
pub mod grain;
pub mod kernel;
pub mod layout;
mod memory;
mod pace;
pub mod plan;
pub mod roofline;
pub mod structs;
pub mod texels;
mod workers;

pub use device::Gpu;
pub use engine::GpuEngine;
pub use memory::{Bound, Memory};
