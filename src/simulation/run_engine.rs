//! The engine of a run, one of the two. The contract ([`crate::engine`]) knows neither; whoever draws from the buffers of a device asks
//! the run for it.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use crate::cpu::CpuEngine;
use crate::engine::Engine;
use crate::error::Result;
use crate::gpu::{Gpu, GpuEngine};
use crate::model::Model;

/// The engine of a run.
pub enum RunEngine {
    Gpu(Box<GpuEngine>),
    Cpu(Box<CpuEngine>),
}

impl RunEngine {
    /// An engine for this model on this device, without one the CPU engine.
    ///
    /// # Errors
    /// As [`GpuEngine::new`].
    pub fn new(model: &Arc<Model>, device: Option<&Gpu>, dt: f64, most_steps: usize, drawn: bool) -> Result<Self> {
        Ok(match device {
            Some(gpu) => {
                let engine = GpuEngine::for_purpose(model.clone(), gpu.clone(), dt, most_steps, drawn)?;
                RunEngine::Gpu(Box::new(engine))
            }
            None => RunEngine::Cpu(Box::new(CpuEngine::new(model.clone(), dt))),
        })
    }

    /// The engine on a device, for those who draw from its buffers.
    pub fn on_device(&self) -> Option<&GpuEngine> {
        match self {
            RunEngine::Gpu(engine) => Some(engine),
            RunEngine::Cpu(_) => None,
        }
    }
}

impl Deref for RunEngine {
    type Target = dyn Engine;

    fn deref(&self) -> &Self::Target {
        match self {
            RunEngine::Gpu(engine) => engine.as_ref(),
            RunEngine::Cpu(engine) => engine.as_ref(),
        }
    }
}

impl DerefMut for RunEngine {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            RunEngine::Gpu(engine) => engine.as_mut(),
            RunEngine::Cpu(engine) => engine.as_mut(),
        }
    }
}
