//! A run with wider cells beside another one: the same scene, motion and engine. How far their forces lie apart tells what the cells of
//! the finer one may be off ([`crate::observables::error_bar`]).

use std::time::{Duration, Instant};

use super::{Purpose, Simulation};
use crate::error::Result;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::needle::motion::HandPose;
use crate::observables::FrameRecord;
use crate::observables::error_bar::ErrorBar;
use crate::scene::{MOST_STEPS_PER_FRAME, Scene};

/// Cell edge of a companion over that of its run: what [`crate::observables::error_bar`] counts with.
pub const WIDER: f64 = 2.0;

/// The companion of a simulation, and the band that it gives.
pub struct Companion {
    simulation: Simulation,
    bar: ErrorBar,
    /// Its records so far.
    pub records: Vec<FrameRecord>,
    /// Why it has no force any more, where it was stopped.
    pub stopped: Option<String>,
    /// Wall time of its frames.
    pub taken: Duration,
}

impl Companion {
    /// A companion of `main`, which is at its beginning, with the scene `coarser`. `order`: that of the error in the cell edge, where a study has
    /// observed it.
    ///
    /// # Errors
    /// As [`Simulation::new`].
    pub fn of(main: &Simulation, coarser: Scene, order: Option<f64>) -> Result<Self> {
        let purpose = Purpose { drawn: false, ..main.purpose };
        let coarser = if purpose.led { coarser.for_hand() } else { coarser };
        let mesh = Mesh::of_scene(&coarser);
        let bar = ErrorBar::new(coarser.tissue.cell_size, order);
        let device = main.device.clone();
        let mut simulation = Simulation::prepare(coarser, mesh, device, Vec::new(), MOST_STEPS_PER_FRAME, purpose)?;
        simulation.lead_ahead();
        Ok(Companion { simulation, bar, records: Vec::new(), stopped: None, taken: Duration::ZERO })
    }

    /// Scene, mesh and materials.
    pub fn model(&self) -> &Model {
        &self.simulation.model
    }

    /// Begins the band anew, for a run that went back; the companion's own frames stay.
    pub fn begin_again(&mut self) {
        self.bar = self.bar.anew();
    }

    /// Leads the tool as [`Simulation::lead`] does.
    pub fn lead(&mut self, pose: &HandPose) {
        self.simulation.lead(pose);
    }

    /// Half-width of the band [N] in the frame of `record`; `None` where the companion was stopped before. A run that goes back finds the frames that
    /// the companion had then.
    pub fn error_of(&mut self, record: &FrameRecord) -> Option<f64> {
        let (frame, begin) = (record.frame as usize, Instant::now());
        while self.stopped.is_none() && self.records.len() <= frame {
            match self.simulation.next_frame() {
                Ok(Some(next)) => self.records.push(next),
                Ok(None) => break,
                Err(error) => self.stopped = error.to_string().lines().next().map(str::to_string),
            }
        }
        self.taken += begin.elapsed();
        let companion = self.records.get(frame)?;
        Some(self.bar.at(record.depth, record.force.axial, companion.force.axial))
    }
}
