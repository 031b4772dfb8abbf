//! The teacher's screen: the class and its progress, two attempts side by side, notes at moments of an attempt, tasks of one's own.
//!
//! [`Teacher`] holds what is shown, [`Teacher::show`] draws it and says where the user wants to go. [`class`], [`comparison`], [`notes`] and
//! [`task`] are its pages.

mod class;
mod comparison;
mod notes;
mod task;

use std::path::{Path, PathBuf};

use super::screens::Next;
use crate::training::class::Class;
use crate::training::history::Attempt;
use crate::training::report::{day, name_of};
use crate::training::scene_words;
use crate::words::say;
use crate::{Error, Result};

/// One page of the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Page {
    Class,
    Comparison,
    Notes,
    Task,
}

impl Page {
    const ALL: [Page; 4] = [Page::Class, Page::Comparison, Page::Notes, Page::Task];

    fn name(self) -> &'static str {
        match self {
            Page::Class => say("teacher-class"),
            Page::Comparison => say("teacher-comparison"),
            Page::Notes => say("teacher-notes"),
            Page::Task => say("teacher-own-task"),
        }
    }
}

/// What the last action came to.
enum Told {
    Done(String),
    Failed(String),
}

/// The screen.
pub struct Teacher {
    root: PathBuf,
    class: Class,
    page: Page,
    told: Option<Told>,
    exports: class::Exports,
    comparison: comparison::Comparison,
    notes: notes::Notes,
    task: task::Form,
}

impl Teacher {
    /// Reads the history in a folder; what cannot be read is told on the page.
    pub fn new(root: &Path) -> Self {
        let mut teacher = Teacher {
            root: root.to_path_buf(),
            class: Class::default(),
            page: Page::Class,
            told: None,
            exports: class::Exports::new(root),
            comparison: comparison::Comparison::default(),
            notes: notes::Notes::default(),
            task: task::Form::default(),
        };
        teacher.read();
        teacher
    }

    /// Opens a page.
    pub fn turn_to(&mut self, page: Page) {
        self.page = page;
    }

    fn read(&mut self) {
        // A history begins with its first attempt.
        if !self.root.is_dir() {
            self.class = Class::default();
            return;
        }
        match Class::read(&self.root) {
            Ok(class) => self.class = class,
            Err(error) => self.told = Some(Told::Failed(error.to_string())),
        }
    }

    /// Says what came of an action.
    fn tell(&mut self, done: Result<String>) {
        self.told = Some(match done {
            Ok(text) => Told::Done(text),
            Err(error) => Told::Failed(error.to_string()),
        });
    }

    /// Draws the screen; where the user wants to go.
    pub fn show(&mut self, ui: &mut egui::Ui) -> Option<Next> {
        let mut next = None;
        ui.horizontal_wrapped(|ui| {
            if ui.button(say("teacher-back")).clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape)) {
                next = Some(Next::Start);
            }
            ui.separator();
            for page in Page::ALL {
                if ui.selectable_label(self.page == page, page.name()).clicked() {
                    self.page = page;
                    self.told = None;
                }
            }
            if ui.button(say("teacher-read-again")).clicked() {
                self.read();
            }
        });
        ui.separator();
        match &self.told {
            Some(Told::Done(text)) => _ = ui.label(text),
            Some(Told::Failed(text)) => _ = ui.colored_label(ui.visuals().error_fg_color, text),
            None => {}
        }
        egui::ScrollArea::both().auto_shrink(false).show(ui, |ui| match self.page {
            Page::Class => class::show(ui, self),
            Page::Comparison => comparison::show(ui, self),
            Page::Notes => notes::show(ui, self),
            Page::Task => next = next.take().or(task::show(ui, self)),
        });
        next
    }
}

/// A list of all attempts to choose one from; true where another was chosen.
fn choose_attempt(ui: &mut egui::Ui, class: &Class, label: &str, chosen: &mut Option<usize>) -> bool {
    let attempts: Vec<&Attempt> = class.attempts().collect();
    let before = *chosen;
    let name = |attempt: &Attempt| {
        format!("{} - {} ({})", name_of(attempt), scene_words::task(&attempt.task), day(attempt.finished))
    };
    let shown = chosen.and_then(|n| attempts.get(n)).map_or_else(|| say("teacher-choose").to_string(), |a| name(a));
    let id = ui.label(label).id;
    let list = egui::ComboBox::from_id_salt(label).selected_text(shown).width(320.0).truncate().show_ui(ui, |ui| {
        for (n, attempt) in attempts.iter().enumerate() {
            ui.selectable_value(chosen, Some(n), name(attempt));
        }
    });
    list.response.labelled_by(id);
    *chosen != before
}

/// A path that a user wrote, with the ending that it needs.
fn path_of(text: &str, ending: &str) -> Result<PathBuf> {
    if text.trim().is_empty() {
        return Err(Error::input(say("teacher-no-file"), say("teacher-no-file-way-out")));
    }
    let path = PathBuf::from(text.trim());
    Ok(if path.extension().is_none() { path.with_extension(ending) } else { path })
}
