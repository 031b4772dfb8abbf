//! When a frame of the tissue is due and when a picture: the tissue keeps its pace, pictures fill what is left.

use std::time::{Duration, Instant};

use super::practice_screen::PracticeScreen;
use super::stage::{PICTURE, Stage};
use crate::Result;
use crate::window::hand::InputDevice;
use crate::window::panels::Wishes;
use crate::window::practice::{Renewed, State};
use crate::window::settings::Settings;

/// Longest time between two pictures while the tissue lags behind [s].
const SLOWEST_PICTURE: f64 = 1.0 / 21.0;
/// Longest simulated time that is made up for [s].
const DEBT: f64 = 0.2;
/// Time between two looks at the range of the field [s].
const LOOK_AT_RANGE: f64 = 0.4;

impl PracticeScreen {
    /// True where a frame of the tissue is due. Time that a picture took is made up for; a slow machine shows slow motion and owes
    /// nothing beyond that.
    fn frame_is_due(&mut self) -> bool {
        let passed = self.counted.elapsed().as_secs_f64();
        self.counted = Instant::now();
        if self.practice.waits_for_a_hand() && self.recording.is_none() && self.devices.asks(&self.desk) {
            self.practice.state = State::Running;
        }
        if self.practice.state != State::Running {
            self.due = 0.0;
            // An input that nothing answers is no latency.
            let _ = self.desk.fresh_input();
            return false;
        }
        self.practice.timing.running += passed;
        let frame = self.practice.timing.simulated;
        self.due = (self.due + passed * self.choices.pace).min(DEBT.max(2.0 * frame));
        let due = self.due >= frame;
        if due {
            self.due -= frame;
        }
        due
    }

    /// Draws a picture, and computes the frame of the tissue that is due beside it.
    pub(super) fn picture(&mut self, stage: &mut Stage, settings: &mut Settings) -> Result<Wishes> {
        let begin = Instant::now();
        stage.next = begin + Duration::from_secs_f64(PICTURE);
        self.devices.tend(&mut self.practice, &self.desk);
        let due = std::mem::take(&mut self.ahead) || self.start_if_due(stage)?;
        // Tissue that lags behind goes first, as long as the eye does not see it.
        let late = self.due >= self.practice.timing.simulated;
        if due && late && self.shown.elapsed().as_secs_f64() < SLOWEST_PICTURE {
            stage.next = begin;
            self.finish(stage)?;
            return Ok(Wishes::default());
        }
        self.shown = begin;
        let mut wishes = Wishes::default();
        let mut encoder = stage.gpu.device.create_command_encoder(&Default::default());
        let panels = self.panels_are_due(stage).then(|| self.run_panels(stage, settings, &mut wishes));
        self.draw(stage, &mut encoder, panels)?;
        // Nothing to show it on: the tissue goes on, the picture is left out.
        let shown = stage.copied(&mut encoder);
        stage.gpu.queue.submit([encoder.finish()]);
        if wishes.step && !due {
            self.start(stage)?;
        }
        if due || wishes.step {
            self.finish(stage)?;
        }
        // A software adapter shows a picture by copying it, on this thread: the tissue goes on meanwhile.
        let wished = wishes != Wishes::default() || self.practice.tuning.waits();
        self.ahead = stage.gpu.is_software() && !wished && self.start_if_due(stage)?;
        if stage.present(shown) {
            self.practice.drawn();
        }
        stage.gpu.check()?;
        if self.choices.automatic
            && self.shows_fields()
            && self.ranged.is_none_or(|at| at.elapsed().as_secs_f64() >= LOOK_AT_RANGE)
        {
            self.ranged = Some(begin);
            self.follow_range(&stage.gpu)?;
        }
        Ok(wishes)
    }

    fn start_if_due(&mut self, stage: &mut Stage) -> Result<bool> {
        let due = self.frame_is_due();
        if due {
            self.start(stage)?;
        }
        Ok(due)
    }

    /// Waits for the frame that was begun ahead, if one was: nothing is under way then.
    pub(super) fn settle(&mut self, stage: &mut Stage) -> Result<()> {
        match std::mem::take(&mut self.ahead) {
            true => self.finish(stage),
            false => Ok(()),
        }
    }

    /// Gives the device the next frame.
    fn start(&mut self, stage: &mut Stage) -> Result<()> {
        if let Some(session) = &self.recorded
            && self.practice.follow(session)? == Renewed::Buffers
        {
            self.take_buffers(stage)?;
        }
        match &mut self.recording {
            Some(recording) => self.practice.start(recording),
            None => self.practice.start(&mut self.devices.with(&mut self.desk)),
        }
    }

    /// Waits for the frame that was given.
    fn finish(&mut self, stage: &mut Stage) -> Result<()> {
        let inputs = self.practice.latency.count;
        match &mut self.recording {
            Some(recording) => self.practice.finish(recording)?,
            None => self.practice.finish(&mut self.devices.with(&mut self.desk))?,
        }
        self.devices.felt(&self.practice);
        self.lesson.tend(&self.practice);
        // The force that answers an input is read at once.
        stage.stale |= self.practice.latency.count > inputs;
        Ok(())
    }
}
