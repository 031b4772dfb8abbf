//! The start screen: trainees and their progress, tasks as cards, recent files, scenes of the program, files that are brought.
//!
//! [`tasks`] is what can be opened, [`cards`] draws it, [`people`] chooses who practises, [`progress`] reads how they stand, [`bring`] takes
//! scenes and volumes that a path or a drag and drop names.

pub mod bring;
pub mod cards;
mod people;
pub mod progress;
pub mod tasks;

use std::path::{Path, PathBuf};

use self::bring::Brought;
use self::cards::Pictures;
use self::people::People;
use self::progress::Standing;
use self::tasks::{BuiltIn, Task};
use super::preferences;
use super::screens::Next;
use super::settings::Settings;
use crate::training::history::History;
use crate::words::{say, say_with};

/// Keys of the first tasks.
const DIGITS: [egui::Key; 9] = [
    egui::Key::Num1,
    egui::Key::Num2,
    egui::Key::Num3,
    egui::Key::Num4,
    egui::Key::Num5,
    egui::Key::Num6,
    egui::Key::Num7,
    egui::Key::Num8,
    egui::Key::Num9,
];

/// Longest path that is shown whole [characters].
const LONG_PATH: usize = 70;

/// What the start screen shows, and what is being written into it.
pub struct StartScreen {
    people: People,
    tasks: Vec<Task>,
    scenes: Vec<BuiltIn>,
    pictures: Pictures,
    brought: Option<Brought>,
    /// A path that is being written.
    path: String,
    /// What went wrong before, for people.
    message: Option<String>,
    help: bool,
}

impl StartScreen {
    /// `history`: folder of the trainees' attempts.
    pub fn new(history: &Path) -> Self {
        StartScreen {
            people: People::new(History::new(history)),
            tasks: tasks::tasks(),
            scenes: tasks::built_in(),
            pictures: Pictures::default(),
            brought: None,
            path: String::new(),
            message: None,
            help: false,
        }
    }

    /// Tells what went wrong before.
    pub fn tell(&mut self, message: String) {
        self.message = Some(message);
    }

    /// The task behind that of this file.
    pub fn task_behind(&self, path: &Path) -> Option<PathBuf> {
        tasks::behind(path)
    }

    /// Takes a file: a scene is opened, of everything else is told what it holds.
    pub fn bring(&mut self, path: PathBuf) -> Option<Next> {
        self.message = None;
        if bring::is_scene(&path) {
            return Some(Next::Scene(path));
        }
        self.brought = Some(Brought::new(path));
        None
    }

    /// True where the keys were asked for by a button.
    pub fn wants_help(&mut self) -> bool {
        std::mem::take(&mut self.help)
    }

    /// Draws it; where the user wants to go.
    pub fn show(&mut self, ui: &mut egui::Ui, settings: &mut Settings) -> Option<Next> {
        self.people.follow(settings.trainee.as_deref());
        let mut next = None;
        let free = ui.memory(|memory| memory.focused().is_none());
        if let Some(n) = DIGITS.iter().position(|key| free && ui.input(|i| i.key_pressed(*key)))
            && let Some(task) = self.tasks.get(n)
        {
            next = Some(Next::Scene(task.path.clone()));
        }
        next = next.take().or(self.head(ui, settings));
        ui.separator();
        egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            // Room for the bar.
            ui.set_max_width(ui.available_width() - 12.0);
            self.told(ui);
            if let Some(brought) = &mut self.brought {
                let (made, left) = brought.show(ui);
                if made.is_some() || left {
                    self.brought = None;
                }
                next = next.take().or(made.map(Next::Scene));
            }
            let with_trainee = settings.trainee.is_some();
            let standings: Option<Vec<Standing>> =
                with_trainee.then(|| self.tasks.iter().map(|t| self.people.progress.standing(&t.key)).collect());
            ui.add_space(4.0);
            ui.heading(say("start-tasks"));
            if let Some(n) = cards::cards(ui, &self.tasks, standings.as_deref(), &mut self.pictures) {
                next = Some(Next::Scene(self.tasks[n].path.clone()));
            }
            if let Some(standings) = &standings {
                egui::CollapsingHeader::new(say("start-progress")).show(ui, |ui| self.progress(ui, standings));
            }
            let files = self.files(ui, settings);
            next = next.take().or(files);
        });
        next
    }

    /// Name of the program, trainee, the way to the teacher's screen, what is chosen for good, help.
    fn head(&mut self, ui: &mut egui::Ui, settings: &mut Settings) -> Option<Next> {
        let mut next = None;
        ui.horizontal_wrapped(|ui| {
            ui.heading(say("title"));
            ui.add_space(12.0);
            self.people.show(ui, settings);
            ui.add_space(12.0);
            preferences::menu(ui, settings);
            if ui.button(say("teacher-open")).clicked() {
                next = Some(Next::Teacher);
            }
            self.help |= ui.button(say("help-button")).clicked();
        });
        next
    }

    /// What went wrong.
    fn told(&mut self, ui: &mut egui::Ui) {
        let mut read = false;
        let all = self.message.iter().chain(&self.people.messages).chain(&self.people.progress.broken);
        let all: Vec<&String> = all.collect();
        if !all.is_empty() {
            ui.group(|ui| {
                for message in all {
                    ui.colored_label(ui.visuals().error_fg_color, message);
                }
                read = ui.button(say("close-notice")).clicked();
            });
        }
        if read {
            self.message = None;
            self.people.messages.clear();
            self.people.progress.broken.clear();
        }
    }

    /// How the trainee stands at every task.
    fn progress(&self, ui: &mut egui::Ui, standings: &[Standing]) {
        let attempts: usize = standings.iter().map(|s| s.attempts).sum();
        let passed = standings.iter().filter(|s| s.passed > 0).count();
        let places = [("attempts", attempts.into()), ("passed", passed.into()), ("tasks", standings.len().into())];
        ui.label(say_with("start-summary", &places));
        egui::Grid::new("progress").num_columns(5).striped(true).show(ui, |ui| {
            for head in ["start-task", "start-attempts", "start-passes", "start-last", "start-result"] {
                ui.strong(say(head));
            }
            ui.end_row();
            for (task, standing) in self.tasks.iter().zip(standings) {
                ui.label(task.name());
                ui.label(standing.attempts.to_string());
                ui.label(standing.passed.to_string());
                cards::results(ui, Some(standing));
                ui.label(cards::told(Some(standing)));
                ui.end_row();
            }
        });
        ui.small(say("start-last-told"));
    }

    /// Recent files, a path, the scenes of the program.
    fn files(&mut self, ui: &mut egui::Ui, settings: &Settings) -> Option<Next> {
        let mut next = None;
        ui.add_space(4.0);
        ui.heading(say("start-files"));
        ui.horizontal_wrapped(|ui| {
            let width = (ui.available_width() - 90.0).clamp(120.0, 520.0);
            let field = egui::TextEdit::singleline(&mut self.path).hint_text(say("start-path")).desired_width(width);
            let entered = ui.add(field).lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
            let ready = !self.path.trim().is_empty();
            if (ui.add_enabled(ready, egui::Button::new(say("start-open"))).clicked() || entered) && ready {
                next = self.bring(PathBuf::from(self.path.trim()));
            }
        });
        ui.label(say("start-drop"));
        if !settings.recent.is_empty() {
            egui::CollapsingHeader::new(say("start-recent")).default_open(true).show(ui, |ui| {
                for path in &settings.recent {
                    if ui.link(short(path)).on_hover_text(path.display().to_string()).clicked() {
                        next = self.bring(path.clone());
                        break;
                    }
                }
            });
        }
        egui::CollapsingHeader::new(say("start-scenes")).show(ui, |ui| {
            for scene in &self.scenes {
                if ui.link(&scene.title).on_hover_text(scene.path.display().to_string()).clicked() {
                    next = Some(Next::Scene(scene.path.clone()));
                }
            }
        });
        next
    }
}

/// The end of a long path.
fn short(path: &Path) -> String {
    let whole = path.display().to_string();
    match whole.char_indices().rev().nth(LONG_PATH) {
        Some((at, _)) => format!("…{}", &whole[at..]),
        None => whole,
    }
}
