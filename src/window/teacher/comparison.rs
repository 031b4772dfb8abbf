//! Two attempts side by side.

use super::{Teacher, choose_attempt};
use crate::training::history::{Attempt, file_name};
use crate::training::report::{Side, name_of, of_two, pairs, verdict};
use crate::training::scene_words;
use crate::training::texts::short;
use crate::words::{say, say_with};
use crate::{Error, whole_file};

/// Which two, by their place among all attempts.
#[derive(Default)]
pub struct Comparison {
    chosen: [Option<usize>; 2],
}

/// The page.
pub fn show(ui: &mut egui::Ui, teacher: &mut Teacher) {
    let keys = ["teacher-first", "teacher-second"];
    for (chosen, key) in teacher.comparison.chosen.iter_mut().zip(keys) {
        ui.horizontal_wrapped(|ui| {
            choose_attempt(ui, &teacher.class, crate::words::say_of(key).unwrap_or(key), chosen)
        });
    }
    let attempts: Vec<&Attempt> = teacher.class.attempts().collect();
    let of = |n: Option<usize>| n.and_then(|n| attempts.get(n)).copied();
    let [Some(first), Some(second)] = teacher.comparison.chosen.map(of) else {
        ui.label(say("teacher-choose-two"));
        return;
    };
    let written = ui.button(say("teacher-comparison-page")).clicked().then(|| {
        let [a, b] = [first, second].map(|a| format!("{}_{}_{}", file_name(&a.trainee), file_name(&a.task), a.number));
        let path = teacher.root.join(format!("comparison_{a}_{b}.html"));
        std::fs::create_dir_all(&teacher.root).map_err(|source| Error::file(&teacher.root, source))?;
        whole_file::write(&path, of_two(first, second).as_bytes())?;
        Ok(say_with("teacher-written", &[("file", path.display().to_string().into())]))
    });
    if first.task != second.task {
        let [a, b] = [first, second].map(|attempt| scene_words::task(&attempt.task).into());
        let places = [("first", a), ("second", b)];
        ui.colored_label(ui.visuals().warn_fg_color, say_with("report-other-task", &places));
    }
    for attempt in [first, second] {
        ui.label(format!("{}: {}", name_of(attempt), verdict(&attempt.score)));
    }
    ui.add_space(6.0);
    egui::Grid::new("comparison").striped(true).spacing([16.0, 4.0]).show(ui, |ui| {
        ui.strong(say("report-figure"));
        ui.strong(name_of(first));
        ui.strong(name_of(second));
        ui.strong(say("report-unit"));
        ui.strong(say("report-better"));
        ui.end_row();
        for pair in pairs(&first.score, &second.score) {
            ui.label(&pair.label);
            for (value, side) in pair.values.iter().zip([Side::First, Side::Second]) {
                let text = value.map_or("-".into(), short);
                if pair.better == side {
                    ui.strong(text)
                } else {
                    ui.label(text)
                };
            }
            ui.label(&pair.unit);
            ui.label(match pair.better {
                Side::First => name_of(first),
                Side::Second => name_of(second),
                Side::Neither => "-".into(),
            });
            ui.end_row();
        }
    });
    if let Some(done) = written {
        teacher.tell(done);
    }
}
