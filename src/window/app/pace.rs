//! When a frame of the tissue is due and when a picture: the tissue keeps its pace, pictures fill what is left.

use std::time::{Duration, Instant};

use super::Open;
use crate::Result;
use crate::window::hand::InputDevice;
use crate::window::panels::{ReferenceCurve, Wishes};
use crate::window::practice::{Renewed, State};

/// Shortest time between two pictures [s].
const PICTURE: f64 = 1.0 / 60.0;
/// Longest time between two pictures while the tissue lags behind [s].
const SLOWEST_PICTURE: f64 = 1.0 / 21.0;
/// Longest simulated time that is made up for [s].
const DEBT: f64 = 0.2;
/// Pictures after which pauses are counted.
const WARM_UP: u64 = 5;
/// Time between two looks at the range of the field [s].
const LOOK_AT_RANGE: f64 = 0.4;

impl Open {
    /// True where a frame of the tissue is due. Time that a picture took is made up for; a slow machine shows slow motion and owes
    /// nothing beyond that.
    fn frame_is_due(&mut self) -> bool {
        let passed = self.counted.elapsed().as_secs_f64();
        self.counted = Instant::now();
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
    pub(super) fn picture(&mut self, reference: &[ReferenceCurve]) -> Result<Wishes> {
        let begin = Instant::now();
        self.next = begin + Duration::from_secs_f64(PICTURE);
        self.devices.tend(&mut self.practice, &self.desk);
        let due = std::mem::take(&mut self.ahead) || self.start_if_due()?;
        // Tissue that lags behind goes first, as long as the eye does not see it.
        let late = self.due >= self.practice.timing.simulated;
        if due && late && self.shown.elapsed().as_secs_f64() < SLOWEST_PICTURE {
            self.next = begin;
            self.finish()?;
            return Ok(Wishes::default());
        }
        self.shown = begin;
        let mut wishes = Wishes::default();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let panels = self.panels_are_due().then(|| self.run_panels(reference, &mut wishes));
        self.draw(&mut encoder, panels)?;
        // Nothing to show it on: the tissue goes on, the picture is left out.
        let shown = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(texture) | wgpu::CurrentSurfaceTexture::Suboptimal(texture) => {
                Some(texture).filter(|shown| shown.texture.size() == self.canvas.size())
            }
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                None
            }
            _ => None,
        };
        if let Some(shown) = &shown {
            let (from, to) = (self.canvas.as_image_copy(), shown.texture.as_image_copy());
            encoder.copy_texture_to_texture(from, to, self.canvas.size());
        }
        self.gpu.queue.submit([encoder.finish()]);
        if wishes.step && !due {
            self.start()?;
        }
        if due || wishes.step {
            self.finish()?;
        }
        // A software adapter shows a picture by copying it, on this thread: the tissue goes on meanwhile.
        let wished = wishes != Wishes::default() || self.practice.tuning.waits();
        self.ahead = self.gpu.is_software() && !wished && self.start_if_due()?;
        if let Some(shown) = shown {
            self.window.pre_present_notify();
            self.gpu.queue.present(shown);
            self.pictures += 1;
            self.practice.drawn();
            // The first pictures wait for their shaders.
            if let Some(before) = self.presented.replace(Instant::now())
                && self.pictures > WARM_UP
            {
                self.longest_pause = self.longest_pause.max(before.elapsed().as_secs_f64());
            }
        }
        self.gpu.check()?;
        if self.choices.automatic && self.ranged.is_none_or(|at| at.elapsed().as_secs_f64() >= LOOK_AT_RANGE) {
            self.ranged = Some(begin);
            self.follow_range()?;
        }
        Ok(wishes)
    }

    fn start_if_due(&mut self) -> Result<bool> {
        let due = self.frame_is_due();
        if due {
            self.start()?;
        }
        Ok(due)
    }

    /// Waits for the frame that was begun ahead, if one was: nothing is under way then.
    pub(super) fn settle(&mut self) -> Result<()> {
        match std::mem::take(&mut self.ahead) {
            true => self.finish(),
            false => Ok(()),
        }
    }

    /// Gives the device the next frame.
    fn start(&mut self) -> Result<()> {
        if let Some(session) = &self.recorded
            && self.practice.follow(session)? == Renewed::Buffers
        {
            self.take_buffers()?;
        }
        match &mut self.recording {
            Some(recording) => self.practice.start(recording),
            None => self.practice.start(&mut self.devices.with(&mut self.desk)),
        }
    }

    /// Waits for the frame that was given.
    fn finish(&mut self) -> Result<()> {
        let inputs = self.practice.latency.count;
        match &mut self.recording {
            Some(recording) => self.practice.finish(recording)?,
            None => self.practice.finish(&mut self.devices.with(&mut self.desk))?,
        }
        self.devices.felt(&self.practice);
        // The force that answers an input is read at once.
        self.stale |= self.practice.latency.count > inputs;
        Ok(())
    }
}
