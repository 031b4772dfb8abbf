//! All trainees at all tasks, and what can be written of it.

use std::path::{Path, PathBuf};

use super::{Teacher, path_of};
use crate::training::class::{Class, Standing, goals_met};
use crate::training::report::{self, day, label_of, trend_in_words};
use crate::training::scene_words;
use crate::training::texts::short;
use crate::training::xapi;
use crate::words::{say, say_with};
use crate::{Result, whole_file};

/// What is written where, and whose attempts are listed.
pub struct Exports {
    folder: String,
    home_page: String,
    chosen: Option<usize>,
}

impl Exports {
    pub fn new(root: &Path) -> Self {
        Exports { folder: root.display().to_string(), home_page: xapi::HOME_PAGE.into(), chosen: None }
    }
}

/// The page.
pub fn show(ui: &mut egui::Ui, teacher: &mut Teacher) {
    for error in &teacher.class.broken {
        ui.colored_label(ui.visuals().warn_fg_color, error.to_string());
    }
    if teacher.class.standings.is_empty() {
        ui.label(say_with("teacher-nobody", &[("folder", teacher.root.display().to_string().into())]));
        return;
    }
    table(ui, &teacher.class, &mut teacher.exports.chosen);
    ui.add_space(8.0);
    writing(ui, teacher);
    if let Some(standing) = teacher.exports.chosen.and_then(|n| teacher.class.standings.get(n)) {
        ui.separator();
        attempts(ui, standing);
    }
}

fn table(ui: &mut egui::Ui, class: &Class, chosen: &mut Option<usize>) {
    let heads =
        ["teacher-trainee", "teacher-task", "teacher-attempts", "teacher-passed", "teacher-best", "teacher-last"];
    egui::Grid::new("class").striped(true).num_columns(7).spacing([16.0, 4.0]).show(ui, |ui| {
        for head in heads {
            ui.strong(crate::words::say_of(head).unwrap_or(head));
        }
        ui.vertical(|ui| {
            in_the_rest(ui);
            ui.strong(say("teacher-trend"));
        });
        ui.end_row();
        let mut before = "";
        for (n, s) in class.standings.iter().enumerate() {
            let name = if s.trainee == before { "" } else { &s.trainee };
            before = &s.trainee;
            ui.strong(name);
            if ui.selectable_label(*chosen == Some(n), scene_words::task(&s.task)).clicked() {
                *chosen = Some(n);
            }
            ui.label(s.attempts.len().to_string());
            ui.label(s.passed().to_string());
            let met = |of: Option<(usize, usize)>| of.map_or("-".into(), |(met, of)| format!("{met}/{of}"));
            ui.label(met(s.best().and_then(goals_met)));
            ui.label(met(s.last().and_then(goals_met)));
            ui.vertical(|ui| {
                in_the_rest(ui);
                for key in s.key_figures() {
                    ui.label(egui::RichText::new(trend(s, &key)).weak());
                }
            });
            ui.end_row();
        }
    });
}

/// The last column has the rest of the page, where its texts wrap: what lies beyond is found by nobody who does not scroll sideways.
fn in_the_rest(ui: &mut egui::Ui) {
    let rest = ui.clip_rect().right() - ui.cursor().left() - 12.0;
    ui.set_max_width(rest.max(160.0));
}

/// `Passes through the surface: 1 (getting better)`.
fn trend(standing: &Standing, key: &str) -> String {
    let row = standing.last().and_then(|a| a.score.rows.iter().find(|row| row.key == key));
    let (label, value) = row.map_or((key.into(), "-".into()), |row| {
        (label_of(row), row.value.map_or("-".into(), |v| format!("{} {}", short(v), row.unit).trim_end().to_string()))
    });
    format!("{label}: {value} ({})", trend_in_words(standing.trend(key)))
}

/// Attempts of one trainee at one task.
fn attempts(ui: &mut egui::Ui, standing: &Standing) {
    ui.strong(format!("{} - {}", standing.trainee, scene_words::task(&standing.task)));
    let keys = standing.key_figures();
    egui::Grid::new("attempts").striped(true).spacing([16.0, 4.0]).show(ui, |ui| {
        ui.strong(say("report-attempt"));
        ui.strong(say("report-when"));
        ui.strong(say("report-goals"));
        for row in keys.iter().filter_map(|key| standing.last()?.score.rows.iter().find(|row| row.key == *key)) {
            ui.strong(label_of(row));
        }
        ui.end_row();
        for attempt in &standing.attempts {
            ui.label(attempt.number.to_string());
            ui.label(day(attempt.finished));
            ui.label(match attempt.score.passed() {
                Some(true) => say("report-passed-short"),
                Some(false) => say("report-failed-short"),
                None => say("report-not-scored-short"),
            });
            for key in &keys {
                ui.label(attempt.score.value(key).map_or("-".into(), short));
            }
            ui.end_row();
        }
    });
}

/// Buttons that write files.
fn writing(ui: &mut egui::Ui, teacher: &mut Teacher) {
    let mut done: Option<Result<PathBuf>> = None;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(say("teacher-folder")).id;
        ui.add(egui::TextEdit::singleline(&mut teacher.exports.folder).desired_width(220.0)).labelled_by(label);
        let label = ui.label(say("teacher-home-page")).id;
        ui.add(egui::TextEdit::singleline(&mut teacher.exports.home_page).desired_width(220.0)).labelled_by(label);
    });
    let (class, exports) = (&teacher.class, &teacher.exports);
    let write = |name: &str, bytes: Result<Vec<u8>>| -> Result<PathBuf> {
        let folder = PathBuf::from(exports.folder.trim());
        std::fs::create_dir_all(&folder).map_err(|source| crate::Error::file(&folder, source))?;
        let path = path_of(&folder.join(name).display().to_string(), "txt")?;
        whole_file::write(&path, &bytes?)?;
        Ok(path)
    };
    ui.horizontal_wrapped(|ui| {
        if ui.button(say("teacher-csv")).clicked() {
            done = Some(write("class.csv", class.csv()));
        }
        if ui.button(say("teacher-xapi")).clicked() {
            let statements = xapi::statements(class.attempts(), &exports.home_page);
            done = Some(write("class_xapi.json", statements.map(String::into_bytes)));
        }
        let trainee = exports.chosen.and_then(|n| class.standings.get(n)).map(|s| s.trainee.clone());
        let button = ui.add_enabled(trainee.is_some(), egui::Button::new(say("teacher-report")));
        if let Some(trainee) = trainee.filter(|_| button.on_disabled_hover_text(say("teacher-report-whom")).clicked()) {
            let page = class.of(&trainee).and_then(|standings| report::of_trainee(&trainee, &standings));
            let name = format!("report_{}.html", crate::training::history::file_name(&trainee));
            done = Some(write(&name, page.map(String::into_bytes)));
        }
    });
    if let Some(done) = done {
        teacher.tell(done.map(|path| say_with("teacher-written", &[("file", path.display().to_string().into())])));
    }
}
