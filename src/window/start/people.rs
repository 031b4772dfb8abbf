//! Trainees: choosing, making, hiding them.

use egui::text::{CCursor, CCursorRange};

use super::progress::Progress;
use crate::training::history::History;
use crate::training::trainees::{self, Trainee};
use crate::window::settings::Settings;
use crate::words::{say, say_with};

/// Longest name in the list [characters]; a longer one is cut in it.
const SHOWN: usize = 24;

/// Who can be chosen, and what is being written.
pub struct People {
    history: History,
    all: Vec<Trainee>,
    /// A name that is being written; `None`: nobody is being made.
    new: Option<String>,
    /// It was suggested just now: the field takes the keyboard, and what is typed replaces the name.
    suggested: bool,
    hidden_shown: bool,
    pub progress: Progress,
    /// What went wrong.
    pub messages: Vec<String>,
    /// Of whom the progress is.
    of: Option<String>,
}

impl People {
    pub fn new(history: History) -> Self {
        let mut people = People {
            history,
            all: Vec::new(),
            new: None,
            suggested: false,
            hidden_shown: false,
            progress: Progress::default(),
            messages: Vec::new(),
            of: None,
        };
        people.read();
        people
    }

    fn read(&mut self) {
        match trainees::list(&self.history) {
            Ok((all, broken)) => {
                self.all = all;
                self.messages = broken.iter().map(ToString::to_string).collect();
            }
            Err(error) => self.messages = vec![error.to_string()],
        }
    }

    /// The attempts of who is chosen.
    pub fn follow(&mut self, chosen: Option<&str>) {
        if self.of.as_deref() != chosen {
            self.of = chosen.map(str::to_string);
            self.progress = Progress::of(&self.history, chosen);
        }
    }

    /// The row with the trainee.
    pub fn show(&mut self, ui: &mut egui::Ui, settings: &mut Settings) {
        let label = ui.label(say("start-trainee")).id;
        let shown = settings.trainee.clone().unwrap_or_else(|| say("start-nobody").into());
        let list = egui::ComboBox::from_id_salt("trainee").selected_text(short(&shown)).show_ui(ui, |ui| {
            ui.selectable_value(&mut settings.trainee, None, say("start-nobody"));
            for trainee in self.all.iter().filter(|t| !t.hidden || self.hidden_shown) {
                ui.selectable_value(&mut settings.trainee, Some(trainee.name.clone()), short(&trainee.name));
            }
        });
        list.response.labelled_by(label);
        if self.new.is_none() && ui.button(say("start-new-trainee")).clicked() {
            (self.new, self.suggested) = (Some(self.suggestion()), true);
        }
        self.being_made(ui, settings);
        self.hiding(ui, settings);
    }

    /// A name that nobody has: a trainee can be made with a mouse alone.
    fn suggestion(&self) -> String {
        let numbered = |n: usize| say_with("start-suggestion", &[("n", n.into())]);
        let is_free = |name: &String| self.all.iter().all(|trainee| trainee.name != *name);
        (1..).map(numbered).find(is_free).unwrap_or_default()
    }

    /// The field for the name of a new trainee.
    fn being_made(&mut self, ui: &mut egui::Ui, settings: &mut Settings) {
        let Some(name) = &mut self.new else { return };
        // A name of its own: the button before it, whose place would number it, goes with the first picture.
        let field = egui::TextEdit::singleline(name).id_salt("new trainee");
        let field = field.hint_text(say("start-name")).desired_width(140.0);
        let mut field = field.show(ui);
        if std::mem::take(&mut self.suggested) {
            let whole = CCursorRange::two(CCursor::new(0), CCursor::new(name.chars().count()));
            field.state.cursor.set_char_range(Some(whole));
            field.state.store(ui.ctx(), field.response.id);
            field.response.request_focus();
        }
        let field = field.response;
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        let made = ui.add_enabled(!name.trim().is_empty(), egui::Button::new(say("start-create"))).clicked();
        let left = ui.button(say("start-cancel")).clicked() || ui.input(|i| i.key_pressed(egui::Key::Escape));
        if left {
            self.new = None;
        } else if (entered || made) && !name.trim().is_empty() {
            match trainees::create(&self.history, name) {
                Ok(name) => {
                    settings.trainee = Some(name);
                    self.new = None;
                    self.read();
                }
                Err(error) => self.messages = vec![error.to_string()],
            }
        }
    }

    /// Hides who is chosen, shows those who are hidden.
    fn hiding(&mut self, ui: &mut egui::Ui, settings: &mut Settings) {
        if let Some(name) = settings.trainee.clone() {
            let hidden = self.all.iter().any(|t| t.name == name && t.hidden);
            let text = if hidden { say("start-unhide") } else { say("start-hide") };
            if ui.button(text).on_hover_text(say("start-hide-told")).clicked() {
                match trainees::hide(&self.history, &name, !hidden) {
                    Ok(()) => {
                        settings.trainee = settings.trainee.take().filter(|_| hidden);
                        self.read();
                    }
                    Err(error) => self.messages = vec![error.to_string()],
                }
            }
        }
        if self.all.iter().any(|trainee| trainee.hidden) {
            ui.checkbox(&mut self.hidden_shown, say("start-hidden-too"));
        }
    }
}

/// A name as a list has room for it.
fn short(name: &str) -> String {
    match name.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_string(),
    }
}
