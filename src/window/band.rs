//! The band around the force of an attempt: a companion with wider cells follows the hand, or the script, frame by frame.

use std::time::{Duration, Instant};

use super::source::Source;
use crate::Result;
use crate::needle::motion::HandPose;
use crate::observables::FrameRecord;
use crate::simulation::Simulation;
use crate::simulation::companion::{Companion, WIDER};
use crate::study::analysis::observed_order;
use crate::study::store::default_folder;

/// Longest time that a companion, switched on late, may take of a frame to catch up [s].
const CATCHING_UP: Duration = Duration::from_millis(8);

/// A companion and how far it has come.
pub struct Band {
    companion: Companion,
    /// Frames that have their band.
    done: usize,
}

impl Band {
    /// The companion of a simulation that a hand may have led through `poses`.
    ///
    /// # Errors
    /// `Error::Input` and `Error::Scene` where there can be no wider cells; as [`Companion::of`].
    pub fn of(main: &Simulation, source: &Source, poses: &[HandPose]) -> Result<Self> {
        let scene = &main.model.scene;
        let wider = scene.wider_cells(WIDER)?;
        let order = observed_order(&default_folder(&scene.name), scene, &source.overrides);
        let mut companion = Companion::of(main, source.with(&wider).scene()?, order)?;
        poses.iter().for_each(|pose| companion.lead(pose));
        Ok(Band { companion, done: 0 })
    }

    /// Leads the companion where the hand leads the tool.
    pub fn lead(&mut self, pose: &HandPose) {
        self.companion.lead(pose);
    }

    /// Gives the frames their bands: the last one, and of those before it as many as time allows.
    pub fn fill(&mut self, records: &mut [FrameRecord]) {
        let begin = Instant::now();
        while self.done < records.len() && (self.done + 1 == records.len() || begin.elapsed() < CATCHING_UP) {
            let record = &mut records[self.done];
            record.force_error = self.companion.error_of(record);
            self.done += 1;
        }
    }

    /// Goes back to the first frames, which the companion has kept.
    pub fn go_back(&mut self, records: &mut [FrameRecord]) {
        self.companion.begin_again();
        for record in records.iter_mut().take(self.done) {
            record.force_error = self.companion.error_of(record);
        }
        self.done = self.done.min(records.len());
    }

    /// Why there is no band any more, where the companion was stopped.
    pub fn stopped(&self) -> Option<&str> {
        self.companion.stopped.as_deref()
    }
}
