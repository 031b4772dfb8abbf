//! Notes at moments of an attempt, on a line of its time.

use egui_plot::{Plot, PlotPoints, Points, VLine};

use super::{Teacher, choose_attempt};
use crate::training::history::Attempt;
use crate::training::notes::{self, Note};
use crate::training::report;
use crate::words::{say, say_with};
use crate::{Result, whole_file};

/// Height of the line of time, in lines of text.
const LINE: f32 = 4.0;

/// What is being written about which attempt.
#[derive(Default)]
pub struct Notes {
    chosen: Option<usize>,
    kept: Vec<Note>,
    time: f64,
    author: String,
    text: String,
}

/// The page.
pub fn show(ui: &mut egui::Ui, teacher: &mut Teacher) {
    let changed = ui
        .horizontal_wrapped(|ui| choose_attempt(ui, &teacher.class, say("teacher-attempt"), &mut teacher.notes.chosen))
        .inner;
    let attempt = teacher.notes.chosen.and_then(|n| teacher.class.attempts().nth(n)).cloned();
    let Some(attempt) = attempt else {
        ui.label(say("teacher-choose-one"));
        return;
    };
    if changed {
        let found = notes::read(&teacher.root, &attempt);
        teacher.notes.kept = found.as_ref().map_or(Vec::new(), Clone::clone);
        teacher.notes.time = 0.0;
        if let Err(error) = found {
            teacher.tell(Err(error));
        }
    }
    ui.label(report::verdict(&attempt.score));
    let end = attempt.score.value("elapsed_time").unwrap_or(0.0).max(0.1);
    time_line(ui, &mut teacher.notes, end);
    let wish = list(ui, &mut teacher.notes, end);
    let done: Option<Result<String>> = match wish {
        Some(Wish::Add) => {
            let n = &mut teacher.notes;
            let note = Note { time: n.time, author: n.author.trim().into(), text: n.text.trim().into() };
            let kept: Vec<Note> = n.kept.iter().cloned().chain([note]).collect();
            Some(keep(teacher, &attempt, kept))
        }
        Some(Wish::Remove(index)) => {
            let mut kept = teacher.notes.kept.clone();
            kept.remove(index);
            Some(keep(teacher, &attempt, kept))
        }
        Some(Wish::Print) => Some(print(teacher, &attempt)),
        None => None,
    };
    if let Some(done) = done {
        teacher.tell(done);
    }
}

enum Wish {
    Add,
    Remove(usize),
    Print,
}

/// The time of the attempt with its notes; a click chooses a moment.
fn time_line(ui: &mut egui::Ui, notes: &mut Notes, end: f64) {
    let ink = ui.visuals().strong_text_color();
    let height = LINE * ui.text_style_height(&egui::TextStyle::Body);
    let shown = Plot::new("notes")
        .height(height)
        .include_x(0.0)
        .include_x(end)
        .include_y(-1.0)
        .include_y(1.0)
        .show_y(false)
        .show_axes([true, false])
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            for note in &notes.kept {
                let at: PlotPoints<'_> = vec![[note.time, 0.0]].into();
                plot.points(Points::new(note.text.as_str(), at).radius(6.0).color(ink));
            }
            plot.vline(VLine::new(say("report-moment"), notes.time).color(egui::Color32::from_rgb(204, 121, 167)));
            plot.pointer_coordinate().map(|at| at.x)
        });
    shown.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, say("teacher-time-line")));
    if let Some(time) = shown.inner.filter(|_| shown.response.clicked()) {
        notes.time = time.clamp(0.0, end);
    }
}

/// The notes, and the one that is being written.
fn list(ui: &mut egui::Ui, notes: &mut Notes, end: f64) -> Option<Wish> {
    let mut wish = None;
    for (n, note) in notes.kept.iter().enumerate() {
        ui.horizontal_wrapped(|ui| {
            if ui.button(format!("{:.1} s", note.time)).on_hover_text(say("report-moment")).clicked() {
                notes.time = note.time;
            }
            if !note.author.is_empty() {
                ui.strong(&note.author);
            }
            ui.label(&note.text);
            if ui.small_button(say("teacher-remove")).clicked() {
                wish = Some(Wish::Remove(n));
            }
        });
    }
    ui.separator();
    ui.horizontal_wrapped(|ui| {
        ui.add(egui::Slider::new(&mut notes.time, 0.0..=end).suffix(" s").text(say("report-moment")));
        let label = ui.label(say("report-author")).id;
        ui.add(egui::TextEdit::singleline(&mut notes.author).desired_width(110.0)).labelled_by(label);
    });
    let label = ui.label(say("report-note")).id;
    ui.add(egui::TextEdit::multiline(&mut notes.text).desired_rows(2).desired_width(420.0)).labelled_by(label);
    ui.horizontal_wrapped(|ui| {
        let filled = !notes.text.trim().is_empty();
        if ui.add_enabled(filled, egui::Button::new(say("teacher-add-note"))).clicked() {
            wish = Some(Wish::Add);
        }
        if ui.button(say("teacher-report")).clicked() {
            wish = Some(Wish::Print);
        }
    });
    wish
}

/// Writes the notes; what is shown is what is in the file.
fn keep(teacher: &mut Teacher, attempt: &Attempt, kept: Vec<Note>) -> Result<String> {
    let path = notes::write(&teacher.root, attempt, &kept)?;
    teacher.notes.kept = notes::read(&teacher.root, attempt)?;
    teacher.notes.text.clear();
    Ok(say_with("teacher-written", &[("file", path.display().to_string().into())]))
}

/// The page of the attempt with its notes, beside them.
fn print(teacher: &Teacher, attempt: &Attempt) -> Result<String> {
    let path = notes::path(&teacher.root, attempt)?.with_extension("html");
    whole_file::write(&path, report::of_attempt(attempt, &teacher.notes.kept).as_bytes())?;
    Ok(say_with("teacher-written", &[("file", path.display().to_string().into())]))
}
