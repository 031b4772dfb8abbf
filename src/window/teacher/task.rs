//! A task of one's own: a form over the scene of another, saved as a scene.

use std::path::PathBuf;

use super::{Teacher, path_of};
use crate::reading;
use crate::scene::Goal;
use crate::training::debrief::spoken;
use crate::training::own_task::{Aim, Avoided, Kept, OwnTask, Way};
use crate::training::scene_words;
use crate::window::screens::Next;
use crate::words::{say, say_of, say_with};

/// Folders of the built-in scenes with tasks.
const FOLDERS: [&str; 2] = ["scenes/training/", "scenes/anatomy/"];

/// What is filled in.
#[derive(Default)]
pub struct Form {
    task: Option<OwnTask>,
    /// File of another scene to begin with, and of the task.
    base: String,
    file: String,
    /// Where it was saved.
    saved: Option<PathBuf>,
}

/// The page; the task that is to be tried.
pub fn show(ui: &mut egui::Ui, teacher: &mut Teacher) -> Option<Next> {
    let mut wanted = None;
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(say("own-base")).id;
        let field = ui.add(egui::TextEdit::singleline(&mut teacher.task.base).desired_width(300.0)).labelled_by(label);
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        if ui.button(say("own-take")).clicked() || entered {
            wanted = Some(teacher.task.base.clone());
        }
        ui.menu_button(say("own-built-in"), |ui| {
            for name in FOLDERS.into_iter().flat_map(reading::built_in_below).filter(|name| name.ends_with(".toml")) {
                if ui.button(name).clicked() {
                    wanted = Some(name.to_string());
                    ui.close();
                }
            }
        });
    });
    if let Some(base) = wanted {
        take(teacher, base);
    }
    let Some(task) = &mut teacher.task.task else {
        ui.label(say("own-hint"));
        return None;
    };
    ui.separator();
    fields(ui, task);
    ui.separator();
    let (mut save, mut next) = (false, None);
    ui.horizontal_wrapped(|ui| {
        let label = ui.label(say("own-file")).id;
        ui.add(egui::TextEdit::singleline(&mut teacher.task.file).desired_width(300.0)).labelled_by(label);
        save = ui.button(say("own-save")).clicked();
        if let Some(path) = teacher.task.saved.clone()
            && ui.button(say("own-try")).clicked()
        {
            next = Some(Next::Scene(path));
        }
    });
    if save {
        let saved = path_of(&teacher.task.file, "toml").and_then(|path| task.save(&path).map(|()| path));
        teacher.task.saved = saved.as_ref().ok().cloned();
        teacher.tell(saved.map(|path| say_with("teacher-written", &[("file", path.display().to_string().into())])));
    }
    next
}

/// Fills the form in with a scene.
fn take(teacher: &mut Teacher, base: String) {
    let form = &mut teacher.task;
    match OwnTask::from_scene(&PathBuf::from(base.trim())) {
        Ok(task) => {
            form.file = teacher.root.join("tasks").join("my_task.toml").display().to_string();
            (form.task, form.base, form.saved) = (Some(task), base, None);
            teacher.told = None;
        }
        Err(error) => teacher.tell(Err(error)),
    }
}

/// A number with its label and unit.
fn number(ui: &mut egui::Ui, label: &str, value: &mut f64, unit: &str, range: std::ops::RangeInclusive<f64>) {
    let id = ui.label(label).id;
    ui.add(egui::DragValue::new(value).speed(0.1).range(range).max_decimals(3).suffix(format!(" {unit}")))
        .labelled_by(id);
}

/// Numbers of a point.
fn point(ui: &mut egui::Ui, label: &str, at: &mut [f64]) {
    ui.label(label);
    for (axis, value) in ["x", "y", "z"].iter().zip(at) {
        number(ui, axis, value, "mm", -500.0..=500.0);
    }
}

fn fields(ui: &mut egui::Ui, task: &mut OwnTask) {
    let label = ui.label(say("own-name")).id;
    ui.add(egui::TextEdit::singleline(&mut task.name).desired_width(300.0)).labelled_by(label);
    let label = ui.label(say("own-briefing")).id;
    ui.add(egui::TextEdit::multiline(&mut task.briefing).desired_rows(3).desired_width(480.0)).labelled_by(label);
    ui.add_space(6.0);
    ui.strong(say("own-way"));
    match &mut task.way {
        Way::Block { entry, angle, heading, depth } => {
            ui.horizontal_wrapped(|ui| point(ui, say("own-entry"), entry));
            ui.horizontal_wrapped(|ui| {
                number(ui, say("own-angle"), angle, "°", 0.0..=80.0);
                number(ui, say("own-heading"), heading, "°", -180.0..=180.0);
                number(ui, say("own-depth"), depth, "mm", 0.1..=300.0);
            });
        }
        Way::Patient { entry, target } => {
            ui.horizontal_wrapped(|ui| point(ui, say("own-entry-ras"), entry));
            ui.horizontal_wrapped(|ui| point(ui, say("own-end-ras"), target));
        }
    }
    ui.add_space(6.0);
    ui.strong(say("own-aim"));
    aim(ui, task);
    ui.add_space(6.0);
    ui.strong(say("own-limits"));
    ui.horizontal_wrapped(|ui| {
        let mut limited = task.time_limit.is_some();
        let switch = ui.checkbox(&mut limited, say("own-time-limit"));
        if switch.changed() {
            task.time_limit = limited.then_some(60.0);
        }
        if let Some(limit) = &mut task.time_limit {
            ui.add(egui::DragValue::new(limit).range(1.0..=3600.0).max_decimals(1).suffix(" s")).labelled_by(switch.id);
        }
    });
    ui.horizontal_wrapped(|ui| {
        let mut limited = task.force_limit.is_some();
        let switch = ui.checkbox(&mut limited, say("own-force-limit"));
        if switch.changed() {
            task.force_limit = limited.then_some(2.0);
        }
        if let Some(limit) = &mut task.force_limit {
            let value = egui::DragValue::new(limit).range(0.1..=10.0).speed(0.05).max_decimals(2).suffix(" N");
            ui.add(value).labelled_by(switch.id);
        }
    });
    for region in &task.regions {
        let index = task.avoid.iter().position(|avoided| avoided.region == *region);
        ui.horizontal_wrapped(|ui| {
            let mut avoided = index.is_some();
            if ui
                .checkbox(&mut avoided, say_with("own-avoid", &[("region", scene_words::name(region).into())]))
                .changed()
            {
                match index {
                    Some(index) => drop(task.avoid.remove(index)),
                    None => task.avoid.push(Avoided { region: region.clone(), clearance: 0.5, weight: 1.0 }),
                }
            } else if let Some(index) = index {
                number(ui, say("own-clearance"), &mut task.avoid[index].clearance, "mm", 0.0..=50.0);
                weight(ui, &mut task.avoid[index].weight);
            }
        });
    }
    for kept in &mut task.kept {
        let text = told(kept);
        ui.checkbox(&mut kept.on, text);
    }
}

/// A goal of the scene that the form does not change, in a few words.
fn told(kept: &Kept) -> String {
    let named = |key: &str, name: &str| say_with(key, &[("region", scene_words::name(name).into())]);
    match &kept.goal {
        Goal::Figure { figure, most } => {
            let name = say_of(&format!("figure-{}", figure.key)).unwrap_or(figure.key);
            let most = format!("{} {}", spoken(figure.unit.show(*most)), figure.unit.name);
            say_with("own-kept-figure", &[("name", name.into()), ("most", most.trim().into())])
        }
        Goal::Avoid { name, .. } => named("own-kept-avoid", name),
        Goal::StopInLayer { name, .. } => named("own-kept-stop", name),
        Goal::HitTarget { .. } => say("own-kept-target").into(),
        Goal::CoreMass { .. } | Goal::CoreVolume { .. } => say("own-kept-core").into(),
    }
}

/// Its weight among the goals.
fn weight(ui: &mut egui::Ui, weight: &mut f64) {
    let id = ui.label(say("own-weight")).on_hover_text(say("own-weight-about")).id;
    ui.add(egui::DragValue::new(weight).speed(0.1).range(0.1..=100.0).max_decimals(1)).labelled_by(id);
}

fn aim(ui: &mut egui::Ui, task: &mut OwnTask) {
    let at_target = matches!(task.aim, Aim::Target { .. });
    ui.horizontal_wrapped(|ui| {
        if ui.radio(at_target, say("own-hit")).clicked() && !at_target {
            let at = match &task.way {
                Way::Patient { target, .. } => *target,
                Way::Block { depth, .. } => [0.0, 0.0, -*depth],
            };
            task.aim = Aim::Target { name: "target".into(), at, tolerance: 1.0 };
        }
        if ui.radio(!at_target, say("own-stop")).clicked() && at_target {
            task.aim = Aim::Depth { name: "depth".into(), from: 5.0, to: 10.0 };
        }
    });
    ui.horizontal_wrapped(|ui| match &mut task.aim {
        Aim::Target { name, at, tolerance } => {
            let label = ui.label(say("own-target")).id;
            ui.add(egui::TextEdit::singleline(name).desired_width(140.0)).labelled_by(label);
            point(ui, say("own-at"), at);
            number(ui, say("own-tolerance"), tolerance, "mm", 0.05..=50.0);
        }
        Aim::Depth { name, from, to } => {
            let label = ui.label(say("own-layer")).id;
            ui.add(egui::TextEdit::singleline(name).desired_width(140.0)).labelled_by(label);
            number(ui, say("own-from"), from, "mm", 0.0..=300.0);
            number(ui, say("own-to"), to, "mm", 0.0..=300.0);
        }
    });
    ui.horizontal_wrapped(|ui| weight(ui, &mut task.weight));
}
