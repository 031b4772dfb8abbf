//! What comes behind an attempt: its debriefing, and the attempt seen again with the debriefing to go back to.

use std::time::Duration;

use super::{Answer, Debriefing};
use crate::Result;
use crate::training::debrief::{Circumstances, Debrief};
use crate::training::history::Attempt;
use crate::training::score::Score;
use crate::window::lesson::Lesson;
use crate::window::practice::{Practice, State};
use crate::words::{say, say_with};

/// Wall time of a picture that goes into frames on the way to a moment.
const CATCH_UP: Duration = Duration::from_millis(60);

/// Behind an attempt; nothing while it goes on.
#[derive(Default)]
pub struct After {
    debriefing: Option<Debriefing>,
    /// The attempt is seen again, the debriefing waits.
    aside: bool,
    /// Where the attempt that is seen again is to go [s].
    wanted: Option<f64>,
}

impl After {
    /// The attempt is over and was scored.
    pub fn begin(&mut self, practice: &Practice, lesson: &Lesson, score: Score, attempts: &[Attempt]) {
        let mut watcher = lesson.watcher();
        let about = Circumstances {
            wall: practice.timing.running,
            stopped: matches!(practice.state, State::Stopped(_)),
            attempts,
        };
        let run = (practice.samples(), practice.records.as_slice());
        let debrief = Debrief::of(practice.scene(), &mut watcher, run, score, about);
        let debriefing = Debriefing::new(debrief, practice.scene(), &watcher, practice.may_see_again());
        *self = After { debriefing: Some(debriefing), ..After::default() };
    }

    /// Another attempt begins.
    pub fn forget(&mut self) {
        *self = After::default();
    }

    /// True where the debriefing stands in the place of everything else.
    pub fn covers(&self) -> bool {
        self.debriefing.is_some() && !self.aside
    }

    /// True while something moves by itself.
    pub fn moves(&self) -> bool {
        self.covers() && self.debriefing.as_ref().is_some_and(Debriefing::moves)
    }

    /// The debriefing comes back.
    pub fn return_to(&mut self) {
        self.aside = false;
    }

    /// Draws the debriefing; what was clicked.
    pub fn show(&mut self, ui: &mut egui::Ui) -> Option<Answer> {
        self.debriefing.as_mut()?.show(ui)
    }

    /// Begins to show the attempt again from a moment [s]; call it between frames.
    ///
    /// # Errors
    /// As [`Practice::see_again`].
    pub fn see_again(&mut self, practice: &mut Practice, time: f64) -> Result<()> {
        practice.see_again()?;
        practice.go_to(time)?;
        self.aside = true;
        Ok(())
    }

    /// Goes where the bar was dragged to; call it between frames. True where there is more to compute before that moment is there.
    ///
    /// # Errors
    /// As [`Practice::go_to`].
    pub fn tend(&mut self, practice: &mut Practice) -> Result<bool> {
        if let Some(time) = self.wanted.take() {
            practice.go_to(time)?;
        }
        if practice.is_heading() {
            practice.catch_up(CATCH_UP)?;
        }
        Ok(practice.is_heading())
    }

    /// True where frames are to be computed, or a moment is asked for.
    pub fn is_asked(&self, practice: &Practice) -> bool {
        self.wanted.is_some() || practice.is_heading()
    }

    /// The bar over an attempt that is seen again.
    pub fn bar(&mut self, ui: &mut egui::Ui, practice: &Practice) {
        let Some(debriefing) = self.debriefing.as_ref().filter(|_| self.aside) else { return };
        let length = debriefing.debrief().simulated;
        ui.horizontal_wrapped(|ui| {
            ui.strong(say("replay-bar"));
            let mut time = practice.records.last().map_or(0.0, |r| r.time);
            // Without its number: a slider that rounds it says that it was changed.
            let slider = egui::Slider::new(&mut time, 0.0..=length.max(1e-3)).show_value(false);
            if ui.add(slider).on_hover_text(say("debrief-time")).changed() {
                self.wanted = Some(time);
            }
            ui.label(format!("{time:.1} s"));
            if ui.button(say("replay-back")).clicked() {
                self.aside = false;
            }
            if let Some(time) = practice.heading() {
                ui.label(say_with("replay-heading", &[("time", format!("{time:.1}").into())]));
            }
        });
    }
}
