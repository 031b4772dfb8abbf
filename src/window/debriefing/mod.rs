//! The debriefing of an attempt as a view of its own: verdict, why, force and depth over time, the path beside the reference attempt, the
//! figures that matter. What it says is [`crate::training::debrief`].

mod after;
mod figures;
mod path;
mod section;
mod timeline;

use std::sync::Arc;

pub use after::After;

use super::lesson;
use crate::scene::Scene;
use crate::training::debrief::{Debrief, Verdict};
use crate::training::events::{Gravity, Watcher};
use crate::training::scene_words;
use crate::words::{say, say_with};

use path::Orbit;
use section::Section;

/// Width from which on there are two columns, in heights of a line of text.
const TWO_COLUMNS: f32 = 52.0;
/// Parts of the height that the curves and the pictures have, and their least heights in lines of text.
const CURVES: (f32, f32) = (0.36, 15.0);
const PICTURES: (f32, f32) = (0.42, 14.0);

/// What the trainee wants next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    Again,
    NextTask,
    Start,
    /// Back to the attempt as it stands.
    Close,
    /// The attempt computed again, from this moment on [s].
    InTissue(f64),
}

/// The debriefing that is shown.
pub struct Debriefing {
    debrief: Debrief,
    scene: Arc<Scene>,
    obstacles: Vec<path::Body>,
    orbit: Orbit,
    section: Section,
    /// The moment that is shown [s].
    time: f64,
    playing: bool,
    /// A hand led, so that the attempt can be computed again.
    pub may_see_again: bool,
}

impl Debriefing {
    /// Shows a debriefing; `watcher` has the obstacles of the scene.
    pub fn new(debrief: Debrief, scene: &Scene, watcher: &Watcher, may_see_again: bool) -> Debriefing {
        let scene = Arc::new(scene.clone());
        Debriefing {
            obstacles: path::bodies(&scene, watcher),
            section: Section::begin(scene.clone(), &debrief),
            orbit: Orbit::default(),
            time: debrief.simulated,
            playing: false,
            may_see_again,
            debrief,
            scene,
        }
    }

    pub fn debrief(&self) -> &Debrief {
        &self.debrief
    }

    /// True while it changes by itself.
    pub fn moves(&self) -> bool {
        self.playing || !self.section.is_ready()
    }

    /// The moment that is shown [s].
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Draws everything; what was clicked.
    pub fn show(&mut self, ui: &mut egui::Ui) -> Option<Answer> {
        self.section.poll(ui.ctx());
        self.play(ui);
        egui::Panel::top("debrief verdict").show(ui, |ui| self.verdict(ui));
        let answer = egui::Panel::bottom("debrief buttons").show(ui, |ui| self.buttons(ui)).inner;
        egui::CentralPanel::default().show(ui, |ui| {
            let line = ui.text_style_height(&egui::TextStyle::Body);
            let wide = ui.available_width() > TWO_COLUMNS * line;
            let heights = [CURVES, PICTURES].map(|(part, least)| (part * ui.available_height()).max(least * line));
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                if wide {
                    ui.columns(2, |columns| {
                        self.words(&mut columns[0]);
                        self.pictures(&mut columns[1], heights);
                    });
                } else {
                    self.words(ui);
                    self.pictures(ui, heights);
                }
            });
        });
        answer
    }

    /// The time goes on as it did.
    fn play(&mut self, ui: &egui::Ui) {
        if !self.playing {
            return;
        }
        self.time += f64::from(ui.input(|input| input.stable_dt.min(0.2)));
        if self.time >= self.debrief.simulated {
            (self.time, self.playing) = (self.debrief.simulated, false);
        }
        ui.ctx().request_repaint();
    }

    fn verdict(&self, ui: &mut egui::Ui) {
        let debrief = &self.debrief;
        let gravity = match debrief.verdict {
            Verdict::Passed => Gravity::Good,
            Verdict::Failed | Verdict::NotScored => Gravity::Bad,
            Verdict::NoTask => Gravity::Note,
        };
        ui.horizontal_wrapped(|ui| {
            let colour = lesson::colour(gravity, ui);
            lesson::sign(ui, gravity.into(), colour);
            ui.label(egui::RichText::new(debrief.verdict.text()).heading().strong().color(colour));
            ui.label(debrief.score.task.as_deref().map_or(debrief.score.scene.as_str(), scene_words::task));
            if let Some(share) = debrief.score.share() {
                let percent = format!("{:.0}", 100.0 * share);
                ui.label(say_with("debrief-share", &[("percent", percent.into())]));
            }
            let number = |value: f64| format!("{value:.1}").into();
            let times = [("simulated", number(debrief.simulated)), ("wall", number(debrief.wall))];
            ui.weak(say_with("debrief-times", &times));
        });
        for reason in debrief.reasons() {
            ui.label(reason);
        }
    }

    fn buttons(&mut self, ui: &mut egui::Ui) -> Option<Answer> {
        let mut answer = None;
        ui.horizontal_wrapped(|ui| {
            for (text, given, key, name) in [
                (say("debrief-again"), Answer::Again, egui::Key::F5, "F5"),
                (say("debrief-next"), Answer::NextTask, egui::Key::F7, "F7"),
                (say("debrief-start"), Answer::Start, egui::Key::F8, "F8"),
                (say("debrief-close"), Answer::Close, egui::Key::F9, "F9"),
            ] {
                let pressed = ui.input_mut(|input| input.consume_key(egui::Modifiers::NONE, key));
                if ui.button(text).on_hover_text(name).clicked() || pressed {
                    answer = Some(given);
                }
            }
            let seen = egui::Button::new(say("debrief-in-tissue"));
            let seen = ui.add_enabled(self.may_see_again, seen).on_hover_text(say("debrief-in-tissue-about"));
            if seen.clicked() {
                answer = Some(Answer::InTissue(self.time));
            }
        });
        answer
    }

    /// Why, and the figures.
    fn words(&mut self, ui: &mut egui::Ui) {
        ui.strong(say("debrief-why"));
        let mut asked = None;
        for finding in &self.debrief.findings {
            let gravity = match finding.goal.met {
                Some(true) => Gravity::Good,
                Some(false) => Gravity::Bad,
                None => Gravity::Note,
            };
            lesson::marked(ui, gravity, finding.text());
            let Some(moment) = finding.moment else { continue };
            // Under the text, not under its sign.
            ui.indent("moment", |ui| {
                ui.horizontal(|ui| {
                    let button = ui.small_button(format!("{} {moment:.1} s", say("debrief-show")));
                    if button.on_hover_text(say("debrief-show-about")).clicked() {
                        asked = Some(moment);
                    }
                });
            });
        }
        ui.add_space(6.0);
        figures::key_figures(ui, &self.debrief);
        ui.add_space(6.0);
        ui.strong(say("lesson-events"));
        for event in &self.debrief.events {
            lesson::line(ui, event);
        }
        if self.debrief.events.is_empty() {
            ui.label(say("lesson-no-events"));
        }
        figures::all(ui, &self.debrief.score);
        if let Some(time) = asked {
            (self.time, self.playing) = (time, false);
        }
    }

    /// Over time and in space, so many points high.
    fn pictures(&mut self, ui: &mut egui::Ui, [curves, height]: [f32; 2]) {
        if let Some(time) = timeline::show(ui, &self.debrief, self.time, curves) {
            (self.time, self.playing) = (time, false);
        }
        self.moment(ui);
        let wide = ui.available_width() > 26.0 * ui.text_style_height(&egui::TextStyle::Body);
        let now = self.debrief.at(self.time).map(|(_, sample)| sample);
        let scene = &*self.scene;
        let (debrief, orbit, section, bodies) = (&self.debrief, &mut self.orbit, &self.section, &self.obstacles);
        if wide {
            ui.columns(2, |columns| {
                path::show(&mut columns[0], (scene, debrief), bodies, orbit, (now, height));
                section.show(&mut columns[1], debrief, (now, height));
            });
        } else {
            path::show(ui, (scene, debrief), bodies, orbit, (now, height));
            section.show(ui, debrief, (now, height));
        }
        path::legend(ui);
    }

    /// Play, the moment, and the needle then.
    fn moment(&mut self, ui: &mut egui::Ui) {
        ui.horizontal_wrapped(|ui| {
            let label = if self.playing { say("debrief-pause") } else { say("debrief-play") };
            if ui.button(label).clicked() {
                self.playing = !self.playing;
                if self.playing && self.time >= self.debrief.simulated {
                    self.time = 0.0;
                }
            }
            let slider = egui::Slider::new(&mut self.time, 0.0..=self.debrief.simulated.max(1e-3)).show_value(false);
            if ui.add(slider).on_hover_text(say("debrief-time")).changed() {
                self.playing = false;
            }
            if let Some((moment, _)) = self.debrief.at(self.time) {
                let places = [
                    ("time", format!("{:.2}", moment.time).into()),
                    ("force", format!("{:.2}", moment.force).into()),
                    ("depth", format!("{:.1}", moment.depth * 1e3).into()),
                ];
                ui.label(say_with("debrief-moment", &places));
            }
        });
    }
}
