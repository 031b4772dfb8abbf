//! The engine of a run, one of the two. The contract ([`crate::engine`]) knows neither; whoever draws from the buffers of a device asks
//! the run for it.

use std::ops::{Deref, DerefMut};
use std::sync::Arc;

use super::Purpose;
use super::carried::carried;
use crate::cpu::{CpuEngine, unknown_to_lanes};
use crate::engine::Engine;
use crate::error::Result;
use crate::gpu::device::adapter_wanted_by_name;
use crate::gpu::{Gpu, GpuEngine};
use crate::model::Model;

/// The engine of a run.
pub enum RunEngine {
    Gpu(Box<GpuEngine>),
    /// With an engine on a device that computes nothing: a window draws from its buffers, which get the state when it asks.
    Cpu {
        engine: Box<CpuEngine>,
        drawn: Option<Box<GpuEngine>>,
        shown: Shown,
    },
}

/// What the buffers of a device that computes nothing hold of the present state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Shown {
    /// That of an earlier moment.
    #[default]
    Nothing,
    Displacement,
    Everything,
}

/// True where the CPU engine takes a model although there is a device: a software adapter, whose work is the processor's too, that nobody has
/// asked for by name, and a model that lanes know.
pub(super) fn takes_lanes(model: &Model, device: &Gpu, purpose: Purpose) -> bool {
    let is_free = purpose.lanes && device.is_software() && !adapter_wanted_by_name();
    is_free && unknown_to_lanes(&model.scene).is_none()
}

impl RunEngine {
    /// An engine for this model on this device, without one the CPU engine.
    ///
    /// # Errors
    /// As [`GpuEngine::new`].
    pub fn new(model: &Arc<Model>, device: Option<&Gpu>, dt: f64, most_steps: usize, purpose: Purpose) -> Result<Self> {
        let on_processor = |drawn| {
            let make = if purpose.lanes { CpuEngine::in_lanes } else { CpuEngine::new };
            RunEngine::Cpu { engine: Box::new(make(model.clone(), dt)), drawn, shown: Shown::default() }
        };
        Ok(match device {
            Some(gpu) if takes_lanes(model, gpu, purpose) => {
                let drawn = || GpuEngine::for_purpose(model.clone(), gpu.clone(), dt, 1, true).map(Box::new);
                on_processor(purpose.drawn.then(drawn).transpose()?)
            }
            Some(gpu) => {
                let engine = GpuEngine::for_purpose(model.clone(), gpu.clone(), dt, most_steps, purpose.drawn)?;
                RunEngine::Gpu(Box::new(engine))
            }
            None => on_processor(None),
        })
    }

    /// An engine for the same scene on another line of its path; the old one gives what draws from a state that another engine computes.
    ///
    /// # Errors
    /// As [`GpuEngine::new`].
    pub(super) fn on_another_line(
        &mut self,
        model: &Arc<Model>,
        device: Option<&Gpu>,
        dt: f64,
        most_steps: usize,
        purpose: Purpose,
    ) -> Result<Self> {
        match self {
            RunEngine::Cpu { drawn, .. } => {
                let make = if purpose.lanes { CpuEngine::in_lanes } else { CpuEngine::new };
                let (engine, drawn) = (Box::new(make(model.clone(), dt)), drawn.take());
                Ok(RunEngine::Cpu { engine, drawn, shown: Shown::default() })
            }
            RunEngine::Gpu(_) => RunEngine::new(model, device, dt, most_steps, purpose),
        }
    }

    /// The engine on a device, for those who draw from its buffers.
    pub fn on_device(&self) -> Option<&GpuEngine> {
        match self {
            RunEngine::Gpu(engine) => Some(engine),
            RunEngine::Cpu { drawn, .. } => drawn.as_deref(),
        }
    }

    /// Gives so much of the state to those who draw, where another engine computed it and they do not have it yet.
    ///
    /// # Errors
    /// `Error::Device`.
    pub fn show(&mut self, wanted: Shown) -> Result<()> {
        let RunEngine::Cpu { engine, drawn: Some(drawn), shown } = self else { return Ok(()) };
        if *shown < wanted {
            match wanted {
                // A path that was laid meanwhile is not drawn.
                Shown::Everything if !Arc::ptr_eq(engine.model(), drawn.model()) => {
                    drawn.write_state(&carried(engine.state(), engine.model(), drawn.model()))?;
                }
                Shown::Everything => drawn.write_state(engine.state())?,
                _ => drawn.write_displacement(engine.state()),
            }
            *shown = wanted;
        }
        Ok(())
    }
}

impl Deref for RunEngine {
    type Target = dyn Engine;

    fn deref(&self) -> &Self::Target {
        match self {
            RunEngine::Gpu(engine) => engine.as_ref(),
            RunEngine::Cpu { engine, .. } => engine.as_ref(),
        }
    }
}

impl DerefMut for RunEngine {
    fn deref_mut(&mut self) -> &mut Self::Target {
        match self {
            RunEngine::Gpu(engine) => engine.as_mut(),
            RunEngine::Cpu { engine, shown, .. } => {
                // Whoever may change it may have.
                *shown = Shown::Nothing;
                engine.as_mut()
            }
        }
    }
}
