//! What a run does about trouble: goes back and halves its step, or leaves forensics and says what would have helped.

use super::Run;
use super::words::tried_in_words;
use crate::error::{Error, Result};
use crate::output::folder;
use crate::output::forensics::{FORENSICS, write_forensics};
use crate::scene::OnTrouble;
use crate::simulation::checkpoint::Checkpoint;

/// Frames before a failure from which on an image is taken: the guard waits for a few frames.
const BEFORE_FAILURE: u64 = 5;

/// Most frames over which a shorter step is tried.
const MOST_TRIED_FRAMES: u64 = 20;

/// How often a run may halve its time step.
const MOST_HALVINGS: u32 = 4;

impl Run<'_> {
    /// After the device is lost: writes the newest image as checkpoint, and tells how to go on from there.
    fn leave_checkpoint(&self, text: &str) -> Error {
        let Some(image) = self.images.back().cloned() else { return Error::Device(text.into()) };
        let checkpoint = self.checkpoint(image);
        let time = checkpoint.records.last().map_or(0.0, |r| r.time);
        match checkpoint.write(&self.output.file(folder::CHECKPOINT)) {
            Ok(()) => Error::Device(format!(
                "{text}\n  way out: the run is kept up to {time:.3} s; go on with: stylet run --resume {}",
                self.output.path().display()
            )),
            Err(error) => Error::Device(format!("{text}\n  and the run up to {time:.3} s could not be kept: {error}")),
        }
    }

    /// What can be done after a failure: half the step, if the scene wants that, else the folder `forensics` and the error.
    pub(super) fn recover(&mut self, error: Error) -> Result<()> {
        if let Error::Device(text) = &error {
            return Err(self.leave_checkpoint(text));
        }
        let Error::Diverged { frame, .. } = &error else { return Err(error) };
        let (frame, text) = (*frame, error.to_string());
        let early = self.images.iter().rposition(|image| image.frames + BEFORE_FAILURE <= frame).unwrap_or(0);
        let Some(image) = self.images.get(early).cloned() else { return Err(error) };
        // A cure needs a state from before the trouble began, which may be long before it stops the run.
        let sound = self.before_doubt.clone().filter(|early| early.frames <= image.frames).unwrap_or(image.clone());
        if self.scene.solver.on_trouble == OnTrouble::HalveStep && self.halvings < MOST_HALVINGS {
            let image = sound;
            self.before_doubt = None;
            self.halvings += 1;
            let mut next = self.simulation.halved(&image)?;
            next.notices.push(format!(
                "{text}\n      on_trouble = \"halve_step\": the run goes on from frame {} with steps of {:.3} us ({} of {MOST_HALVINGS})",
                image.frames,
                next.dt() * 1e6,
                self.halvings
            ));
            self.simulation = next;
            let records = self.records[..image.frames as usize].to_vec();
            self.keep_records(records)?;
            self.images.clear();
            self.plan_stops();
            self.keep_image()?;
            return Ok(());
        }
        // A replay of a failure leaves the folder that it came from as it is.
        if self.output.path().ends_with(FORENSICS) {
            return Err(error);
        }
        let finding = match self.simulation.investigate(&image, frame) {
            Ok(finding) => finding,
            Err(reason) => {
                eprintln!("warning: no forensics, the steps before the failure could not be repeated: {reason}");
                return Err(error);
            }
        };
        let advice = self.tried_on_trouble(&sound, frame);
        let error = match error {
            Error::Diverged { frame, step, time_s, message } => {
                Error::Diverged { frame, step, time_s, message: format!("{message}\n  tried: {advice}") }
            }
            other => other,
        };
        let text = error.to_string();
        let (checkpoint, model) = (self.checkpoint(image), self.simulation.model.clone());
        match write_forensics(&self.output, &model, &finding, &text, &checkpoint, self.device.as_ref()) {
            Ok((folder, missing)) if missing.is_empty() => {
                eprintln!("where it began, and how to see it again: {}", folder.display());
            }
            Ok((folder, missing)) => {
                eprintln!("warning: the forensics in {} are not complete", folder.display());
                missing.iter().for_each(|reason| eprintln!("warning: {reason}"));
            }
            Err(reason) => eprintln!("warning: no forensics: {reason}"),
        }
        Err(error)
    }

    /// What a shorter step does about a doubt: it is tried from the image before the doubt began. `None` where nothing can be tried.
    pub(super) fn tried_on_doubt(&mut self) -> Option<String> {
        let image = self.before_doubt.take()?;
        let doubt = self.simulation.verdict().doubts.first()?.clone();
        // As far as the doubt had grown to most of what it is, some frames at least.
        let last = (doubt.frame + MOST_TRIED_FRAMES / 2).min(self.records.len() as u64 - 1);
        let tried = self.clock.aside(|| self.simulation.try_cures(&image, last));
        Some(tried_in_words(tried))
    }

    /// The same for a run that is stopped in frame `frame`.
    fn tried_on_trouble(&mut self, image: &Checkpoint, frame: u64) -> String {
        let last = (frame + BEFORE_FAILURE).min(self.simulation.frame_count() - 1);
        let tried = self.clock.aside(|| self.simulation.try_cures(image, last));
        tried_in_words(tried)
    }
}
