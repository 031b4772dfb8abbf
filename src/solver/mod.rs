//! The step: one list of stages, two engines.

pub mod advice;
pub mod change;
pub mod checkpoint;
pub mod clock;
pub mod cpu;
pub mod elements;
pub mod engine;
pub mod investigation;
pub mod simulation;
pub mod stable_dt;
pub mod step;
pub mod stiffening;
pub mod trial;
mod trouble;
