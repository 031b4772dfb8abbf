//! The lesson beside the view: steps of the task with the present one, figures as they are now, what has happened. What it shows comes from
//! [`crate::training::events`] and [`crate::training::guide`], frame by frame.

mod signs;

pub use signs::{Sign, colour, sign};

use std::cmp::Ordering;

use super::practice::Practice;
use super::sound::{BUILT, Speaker};
use crate::scene::Scene;
use crate::training::events::{Event, Gravity, Watcher};
use crate::training::guide::{ENTRY, Guide, Hint};
use crate::words::{say, say_with};

/// Events that the list shows at most.
const SHOWN: usize = 8;
/// Simulated time for which an event stands over the view [s].
const TOAST: f64 = 2.5;
/// Height of the strip over the view, in lines of text: of a wide view, and of a narrow one, where a sentence takes two; and the width
/// from which on it is wide.
const STRIP: [f32; 2] = [1.6, 2.6];
const WIDE: f32 = 42.0;

/// The lesson of one scene.
pub struct Lesson {
    /// Events are heard.
    sound: bool,
    guided: bool,
    watcher: Watcher,
    guide: Option<Guide>,
    events: Vec<Event>,
    /// Frames that were looked at.
    seen: usize,
    time: f64,
    speaker: Option<Speaker>,
    /// Why there is no sound, once that is known.
    silent: Option<String>,
    fingerprint: u64,
}

impl Lesson {
    /// For the scene of an attempt; `watcher`: one of that scene, at its beginning.
    pub fn with(practice: &Practice, watcher: Watcher) -> Lesson {
        Lesson {
            guided: true,
            sound: false,
            watcher,
            guide: Guide::new(practice.scene()),
            events: Vec::new(),
            seen: 0,
            time: 0.0,
            speaker: None,
            silent: None,
            fingerprint: practice.session.fingerprint,
        }
    }

    /// The same where nobody has made one; regions that are to be avoided take a tenth of a second each.
    pub fn new(practice: &Practice) -> Lesson {
        Lesson::with(practice, Watcher::new(practice.scene()))
    }

    /// A watcher that has seen nothing of this attempt yet, for its debriefing.
    pub fn watcher(&self) -> Watcher {
        self.watcher.again()
    }

    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// Begins anew with the attempt.
    pub fn restart(&mut self, scene: &Scene) {
        self.watcher = self.watcher.again();
        self.guide = Guide::new(scene);
        self.events.clear();
        (self.seen, self.time) = (0, 0.0);
    }

    /// Looks at the frames that have come since the last time.
    pub fn tend(&mut self, practice: &Practice) {
        if practice.session.fingerprint != self.fingerprint {
            let (guided, sound, speaker) = (self.guided, self.sound, self.speaker.take());
            *self = Lesson { guided, sound, speaker, ..Lesson::new(practice) };
        } else if practice.records.len() < self.seen {
            self.restart(practice.scene());
        }
        let scene = practice.scene();
        let before = self.events.len();
        for record in &practice.records[self.seen..] {
            let Some(sample) = practice.sample(record) else { continue };
            self.watcher.look(scene, &sample, record, &mut self.events);
            if let Some(guide) = &mut self.guide {
                guide.look(scene, &self.watcher, &sample, record);
            }
            self.time = record.time;
        }
        self.seen = practice.records.len();
        // Several at once are one tone: the worst.
        let worst = self.events[before..].iter().map(Event::gravity).max();
        if let Some(gravity) = worst.filter(|_| self.sound) {
            self.play(gravity);
        }
    }

    fn play(&mut self, gravity: Gravity) {
        if self.speaker.is_none() && self.silent.is_none() {
            match Speaker::open() {
                Ok(speaker) => self.speaker = Some(speaker),
                Err(reason) => self.silent = Some(reason),
            }
        }
        if let Some(speaker) = &self.speaker {
            speaker.play(gravity);
        }
    }

    /// The panel, with the settings that it changes: steps and hints are shown, events are heard.
    pub fn panel(&mut self, ui: &mut egui::Ui, guided: &mut bool, sound: &mut bool) {
        ui.horizontal_wrapped(|ui| {
            ui.checkbox(guided, say("lesson-guided")).on_hover_text(say("lesson-guided-about"));
            let heard = egui::Checkbox::new(sound, say("lesson-sound"));
            let heard = ui.add_enabled(BUILT, heard).on_hover_text(say("lesson-sound-about"));
            if heard.on_disabled_hover_text(say("lesson-sound-not-built")).changed() {
                self.silent = None;
                // Heard at once, or told at once why not.
                if *sound {
                    self.play(Gravity::Good);
                }
            }
        });
        (self.guided, self.sound) = (*guided, *sound && BUILT);
        if let Some(reason) = self.silent.as_ref().filter(|_| self.sound) {
            ui.small(say_with("lesson-no-sound", &[("reason", reason.as_str().into())]));
        }
        if let Some(guide) = &self.guide {
            if self.guided {
                steps(ui, guide);
                hints(ui, guide.hints());
            }
            figures(ui, guide);
        }
        ui.strong(say("lesson-events"));
        if self.events.is_empty() {
            ui.label(say("lesson-no-events"));
        }
        for event in self.events.iter().rev().take(SHOWN) {
            line(ui, event);
        }
    }

    /// The strip over the view: what has just happened, else what is to be done.
    pub fn strip(&self, ui: &mut egui::Ui) {
        let line_height = ui.text_style_height(&egui::TextStyle::Body);
        let [one, two] = STRIP;
        // Its height stays, whatever it says: the view would jump.
        ui.set_height(line_height * if ui.available_width() > WIDE * line_height { one } else { two });
        let recent = self.events.iter().rev().take_while(|event| self.time - event.time < TOAST);
        let worst = recent.max_by_key(|event| event.gravity());
        if let Some(event) = worst {
            line(ui, event);
            return;
        }
        let Some(guide) = self.guide.as_ref().filter(|_| self.guided) else { return };
        match guide.hints().first() {
            Some(hint) => warning(ui, hint),
            None => _ = ui.label(guide.steps()[guide.present()].text()),
        }
    }
}

/// One event: sign, when, what.
pub fn line(ui: &mut egui::Ui, event: &Event) {
    marked(ui, event.gravity(), format!("{:.1} s  {}", event.time, event.text()));
}

/// A text with the sign and the colour of its gravity.
pub fn marked(ui: &mut egui::Ui, gravity: Gravity, text: String) {
    let colour = colour(gravity, ui);
    ui.horizontal_top(|ui| {
        sign(ui, gravity.into(), colour);
        ui.add(egui::Label::new(egui::RichText::new(text).color(colour)).wrap());
    });
}

fn warning(ui: &mut egui::Ui, hint: &Hint) {
    marked(ui, Gravity::Bad, hint.text());
}

fn steps(ui: &mut egui::Ui, guide: &Guide) {
    ui.strong(say("lesson-steps"));
    for (n, step) in guide.steps().iter().enumerate() {
        let (mark, told, colour) = match n.cmp(&guide.present()) {
            Ordering::Less => (Sign::Done, say("lesson-done"), colour(Gravity::Good, ui)),
            Ordering::Equal => (Sign::Now, say("lesson-now"), ui.visuals().strong_text_color()),
            Ordering::Greater => (Sign::Later, say("lesson-later"), ui.visuals().weak_text_color()),
        };
        ui.horizontal(|ui| {
            let drawn = sign(ui, mark, colour);
            drawn.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, told));
            ui.colored_label(colour, step.title());
        });
        if mark == Sign::Now {
            ui.indent("step", |ui| ui.label(step.text()));
        }
    }
}

fn hints(ui: &mut egui::Ui, hints: &[Hint]) {
    // The worst two: more are not read while a hand moves.
    for hint in hints.iter().take(2) {
        warning(ui, hint);
    }
}

/// What counts now.
fn figures(ui: &mut egui::Ui, guide: &Guide) {
    let place = guide.place();
    // Names wrap in a narrow panel, with their values behind them.
    let mut row = |name: &str, value: String| {
        ui.horizontal_wrapped(|ui| {
            ui.label(name);
            ui.monospace(value);
        });
    };
    let to_target = place.to_target.map_or_else(|| "-".to_string(), |way| format!("{:.1} mm", way * 1e3));
    row(say("lesson-target"), to_target);
    row(say("lesson-depth"), format!("{:.1} mm", place.depth * 1e3));
    row(say("lesson-speed"), format!("{:.1} mm/s", place.speed * 1e3));
    // What cannot be chosen is not off.
    if guide.path_is_free() {
        row(say("lesson-angle"), format!("{:.0}\u{b0}", place.angle.to_degrees()));
        let entry = if place.entry < 0.01 * ENTRY { 0.0 } else { place.entry };
        row(say("lesson-entry"), format!("{:.1} mm", entry * 1e3));
    }
}
