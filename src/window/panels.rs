//! The panels around the view: what is shown, who leads, forces, energies, health and times.

use egui_plot::{AxisHints, Corner, FilledArea, GridInput, GridMark, Legend, Line, Plot, PlotPoints};

use super::accuracy::Accuracy;
use super::anatomy_view::Entry;
use super::appearance::{self, ColourMap, Look};
use super::camera::{Camera, Preset};
use super::hand::Desk;
use super::practice::{Leader, Practice, State};
use super::scene_view::Scale;
use super::texts;
use crate::haptic::LoopTiming;
use crate::observables::field::{Field, Range, VON_MISES};
use crate::observables::{ForceParts, FrameRecord};
use crate::output::curve::frames_on_the_way_in;
use crate::training::score::Score;

/// What the user has chosen.
pub struct Choices {
    pub scale: Scale,
    /// Ends of the scale follow the largest value seen.
    pub automatic: bool,
    /// Cut plane: axis 0..2 and where between the faces, 0..1.
    pub cut: Option<(usize, f64)>,
    /// Simulated time over wall time that is aimed at.
    pub pace: f64,
    pub show_parts: bool,
    /// A band around the force.
    pub error_bar: bool,
    /// File that the scene is saved as; empty: beside the one that runs.
    pub save_as: String,
    /// Made when it is looked at first.
    pub accuracy: Option<Accuracy>,
    pub look: Look,
    /// Names and colours of the parts of a scene with labels.
    pub parts: Vec<Entry>,
}

impl Choices {
    pub fn new(cut: Option<(usize, f64)>, pace: f64) -> Self {
        Choices {
            scale: default_scale(&VON_MISES),
            automatic: true,
            cut,
            pace,
            show_parts: false,
            error_bar: false,
            save_as: String::new(),
            accuracy: None,
            look: Look::default(),
            parts: Vec::new(),
        }
    }
}

/// What the panels ask the window to do.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wishes {
    pub restart: Option<Leader>,
    pub step: bool,
    /// The folder may have room again.
    pub write_again: bool,
    /// To this moment of the script [s].
    pub go_back: Option<f64>,
    pub recut: bool,
    /// The attempt is over: what is it worth?
    pub debrief: bool,
}

/// A curve that lies behind the live one: depth [mm], force [N].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReferenceCurve {
    pub name: String,
    pub points: Vec<[f64; 2]>,
}

/// Buttons and sliders on the left.
pub fn controls(
    ui: &mut egui::Ui,
    practice: &mut Practice,
    choices: &mut Choices,
    camera: &mut Camera,
    desk: &mut Desk,
) -> Wishes {
    let mut wishes = Wishes::default();
    ui.heading(&practice.scene().title);
    run_buttons(ui, practice, &mut wishes);
    if let Some(reason) = &practice.unwritten {
        ui.colored_label(ui.visuals().error_fg_color, format!("{} {reason}", texts::UNWRITTEN));
        wishes.write_again = ui.button(texts::WRITE_AGAIN).clicked();
    }
    if let Some(task) = &practice.scene().task {
        ui.group(|ui| {
            ui.strong(&task.name);
            ui.label(&task.briefing);
        });
    }
    ui.horizontal(|ui| {
        for (leader, name) in [(Leader::Hand, texts::HAND), (Leader::Script, texts::SCRIPT)] {
            if ui.radio(practice.leader == leader, name).clicked() && practice.leader != leader {
                wishes.restart = Some(leader);
            }
        }
    });
    ui.add(egui::Slider::new(&mut choices.pace, super::PACES).logarithmic(true).text(texts::PACE));
    if practice.may_go_back() {
        let last = practice.records.last().map_or(0.0, |r| r.time);
        let mut time = last;
        let slider = ui.add(egui::Slider::new(&mut time, 0.0..=last).text(texts::MOMENT));
        if slider.changed() && time < last {
            wishes.go_back = Some(time);
        }
    }
    if practice.leader == Leader::Hand {
        hand(ui, practice, desk);
    }
    tuning(ui, practice, choices);
    ui.separator();
    let natural = appearance::parts(ui, &mut choices.look, &choices.parts);
    if !natural {
        field(ui, practice, choices);
    }
    appearance::controls(ui, &mut choices.look, !practice.scene().targets.is_empty(), natural);
    let regions = &practice.scene().regions;
    if !regions.is_empty() && !natural {
        let names = std::iter::once(texts::REMAINDER).chain(regions.iter().map(|region| region.name.as_str()));
        wishes.recut |= appearance::layers(ui, &mut choices.look, names);
    }
    ui.separator();
    wishes.recut |= cut(ui, choices);
    ui.horizontal(|ui| {
        for (preset, name) in Preset::ALL {
            if ui.small_button(name).clicked() {
                camera.preset(preset);
            }
        }
    });
    wishes
}

/// Run, pause, step, begin anew and finish.
fn run_buttons(ui: &mut egui::Ui, practice: &mut Practice, wishes: &mut Wishes) {
    ui.horizontal(|ui| {
        let running = practice.state == State::Running;
        let may_run = matches!(practice.state, State::Running | State::Paused);
        let label = if running { texts::PAUSE } else { texts::PLAY };
        if ui.add_enabled(may_run, egui::Button::new(label)).clicked() {
            practice.state = if running { State::Paused } else { State::Running };
        }
        wishes.step = ui.add_enabled(practice.state == State::Paused, egui::Button::new(texts::STEP)).clicked();
        if ui.button(texts::RESTART).clicked() {
            wishes.restart = Some(practice.leader);
        }
        let done = egui::Button::new(texts::FINISH);
        wishes.debrief = ui.add_enabled(!practice.records.is_empty(), done).clicked();
    });
}

/// What a hand needs to know and to choose.
fn hand(ui: &mut egui::Ui, practice: &Practice, desk: &mut Desk) {
    let mut speed = desk.speed * 1e3;
    let largest = (practice.speed_limit * 1e3).min(50.0);
    if ui.add(egui::Slider::new(&mut speed, 0.5..=largest).text(texts::HAND_SPEED)).changed() {
        desk.speed = speed * 1e-3;
    }
    ui.small(texts::KEYS);
    ui.small(if practice.path_is_free() { texts::FREE_PATH } else { texts::PLANNED_PATH });
}

/// Effects with their sliders, and accuracy against cost.
fn tuning(ui: &mut egui::Ui, practice: &mut Practice, choices: &mut Choices) {
    egui::CollapsingHeader::new(texts::EFFECTS).show(ui, |ui| {
        let (scene, tuning) = practice.tunable();
        super::effects_panel::effects(ui, scene, tuning);
        super::effects_panel::saving(ui, tuning, &mut choices.save_as);
    });
    egui::CollapsingHeader::new(texts::ACCURACY).show(ui, |ui| {
        let now = (practice.simulation.model.mesh.cell_count() as u64, practice.simulation.steps_per_frame());
        let timing = practice.timing;
        let (scene, tuning) = practice.tunable();
        choices.accuracy.get_or_insert_with(|| Accuracy::new(scene)).show(ui, scene, tuning, &timing, now);
    });
}

/// Which field is drawn, and its scale.
fn field(ui: &mut egui::Ui, practice: &Practice, choices: &mut Choices) {
    egui::ComboBox::from_label(texts::FIELD).selected_text(choices.scale.field.label).show_ui(ui, |ui| {
        for field in Field::drawn_of(practice.scene()) {
            if ui.selectable_label(choices.scale.field == field, field.label).clicked() {
                choices.scale = default_scale(field);
            }
        }
    });
    let unit = choices.scale.field.unit;
    ui.checkbox(&mut choices.automatic, texts::AUTOMATIC);
    ui.add_enabled_ui(!choices.automatic, |ui| {
        let (mut low, mut high) = (unit.show(choices.scale.low), unit.show(choices.scale.high));
        ui.horizontal(|ui| {
            ui.add(egui::DragValue::new(&mut low).speed(0.1).suffix(format!(" {}", unit.word())));
            ui.add(egui::DragValue::new(&mut high).speed(0.1).suffix(format!(" {}", unit.word())));
        });
        (choices.scale.low, choices.scale.high) = (unit.read(low), unit.read(high.max(low + 1e-6)));
    });
    if matches!(choices.scale.field.range, Range::Positive(_)) {
        ui.checkbox(&mut choices.scale.logarithmic, texts::LOGARITHMIC);
    }
    colour_bar(ui, &choices.scale, choices.look.map);
}

/// Where the tissue is cut open; true where that changed.
fn cut(ui: &mut egui::Ui, choices: &mut Choices) -> bool {
    let mut recut = false;
    ui.label(texts::CUT);
    ui.horizontal(|ui| {
        let mut axis = choices.cut.map(|(axis, _)| axis);
        for (value, name) in [(None, texts::NO_CUT), (Some(0), "x"), (Some(1), "y"), (Some(2), "z")] {
            if ui.radio(axis == value, name).clicked() {
                axis = value;
                choices.cut = value.map(|axis| (axis, 0.5));
                recut = true;
            }
        }
    });
    if let Some((_, at)) = &mut choices.cut {
        recut |= ui.add(egui::Slider::new(at, 0.0..=1.0).show_value(false)).changed();
    }
    recut
}

/// Scale that a field begins with.
pub fn default_scale(field: &'static Field) -> Scale {
    let (low, high) = field.range.ends();
    Scale { field, low, high, logarithmic: false }
}

/// The colours from low to high, with numbers and unit.
fn colour_bar(ui: &mut egui::Ui, scale: &Scale, map: ColourMap) {
    let (rect, _) = ui.allocate_exact_size(egui::vec2(ui.available_width(), 14.0), egui::Sense::hover());
    let painter = ui.painter();
    let count = 64;
    for n in 0..count {
        let [r, g, b] = map.colour((f64::from(n) + 0.5) / f64::from(count));
        let width = rect.width() / count as f32;
        let left = rect.left() + width * n as f32;
        let cell = egui::Rect::from_min_size(egui::pos2(left, rect.top()), egui::vec2(width + 0.5, rect.height()));
        painter.rect_filled(cell, 0.0, egui::Color32::from_rgb(r, g, b));
    }
    let unit = scale.field.unit;
    let middle = if scale.logarithmic { (scale.low * scale.high).sqrt() } else { 0.5 * (scale.low + scale.high) };
    ui.columns(3, |columns| {
        columns[0].label(format!("{:.2}", unit.show(scale.low)));
        columns[1].vertical_centered(|ui| ui.label(format!("{:.2}", unit.show(middle))));
        columns[2].with_layout(egui::Layout::right_to_left(egui::Align::TOP), |ui| {
            ui.label(format!("{:.2} {}", unit.show(scale.high), unit.word()))
        });
    });
}

/// Lines of the depth axis: 1, 2 or 5 times a power of ten apart, with room for a number at each.
fn depth_marks(input: GridInput) -> Vec<GridMark> {
    let least = 3.0 * input.base_step_size;
    let power = 10f64.powf(least.log10().floor());
    let step_size = [1.0, 2.0, 5.0, 10.0].map(|n| n * power).into_iter().find(|s| *s >= least).unwrap_or(10.0 * power);
    let (from, to) = ((input.bounds.0 / step_size).ceil() as i64, (input.bounds.1 / step_size).floor() as i64);
    (from..=to).map(|n| GridMark { value: n as f64 * step_size, step_size }).collect()
}

/// The number at a line of the depth axis, with the decimals that steps like 0.5 need.
fn depth_label(mark: GridMark) -> String {
    let decimals = (-mark.step_size.log10().floor()).max(0.0) as usize;
    format!("{:.decimals$}", mark.value)
}

/// Force against depth, numbers and lights on the right.
pub fn readings(
    ui: &mut egui::Ui,
    practice: &Practice,
    choices: &mut Choices,
    reference: &[ReferenceCurve],
    haptic: Option<LoopTiming>,
) {
    let Some(record) = practice.records.last() else {
        ui.label(texts::NOTHING_YET);
        return;
    };
    ui.horizontal(|ui| {
        let error = record.force_error.map_or(String::new(), |e| format!(" \u{b1} {e:.3}"));
        ui.heading(format!("{:.3}{error} N", record.force.axial));
        ui.label(format!("{} {:.2} mm", texts::AT_DEPTH, record.depth * 1e3));
    });
    ui.checkbox(&mut choices.show_parts, texts::PARTS);
    ui.checkbox(&mut choices.error_bar, texts::ERROR_BAR);
    if let Some(why) = &practice.no_band {
        ui.label(why);
    }
    force_plot(ui, practice, choices.show_parts, reference);
    numbers(ui, practice, record, haptic);
    lights(ui, record);
    if let Some(why) = record.verdict.sentence() {
        ui.colored_label(egui::Color32::from_rgb(230, 159, 0), format!("{}: {why}", texts::DOUBTFUL));
    }
    match &practice.state {
        State::Stopped(reason) => {
            ui.colored_label(egui::Color32::from_rgb(230, 159, 0), format!("{}\n{reason}", texts::STOPPED));
        }
        State::Ended => {
            ui.label(texts::ENDED);
        }
        State::Running | State::Paused => {}
    }
}

/// Force against depth, before the curves that it is compared with.
fn force_plot(ui: &mut egui::Ui, practice: &Practice, show_parts: bool, reference: &[ReferenceCurve]) {
    let curve = |of: &dyn Fn(&ForceParts) -> f64| -> PlotPoints<'static> {
        // A trainee's minutes are thousands of frames; the plot is some hundred pixels wide.
        let every = practice.records.len().div_ceil(1500).max(1);
        practice.records.iter().step_by(every).map(|r| [r.depth * 1e3, of(&r.force)]).collect()
    };
    Plot::new("force")
        .height((0.4 * ui.available_height()).max(140.0))
        // Powers of ten would leave a narrow plot of some millimetres without a number.
        .x_grid_spacer(depth_marks)
        .custom_x_axes(vec![
            AxisHints::new_x()
                .label(texts::DEPTH_AXIS)
                .label_spacing(egui::Rangef::new(16.0, 28.0))
                .formatter(|mark, _| depth_label(mark)),
        ])
        .y_axis_label(texts::FORCE_AXIS)
        .legend(Legend::default().position(Corner::LeftTop))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            for [depths, lower, upper] in band(&practice.records) {
                let area = FilledArea::new(texts::BAND, &depths, &lower, &upper);
                plot.add(area.fill_color(egui::Color32::from_rgba_unmultiplied(0, 114, 178, 90)));
            }
            for curve in reference {
                let line = Line::new(curve.name.clone(), PlotPoints::from(curve.points.clone()));
                plot.line(line.color(egui::Color32::GRAY).width(1.5));
            }
            plot.line(Line::new(texts::AXIAL, curve(&|f| f.axial)).width(2.0).color(egui::Color32::WHITE));
            if show_parts {
                for part in &ForceParts::PARTS {
                    let [r, g, b] = part.colour;
                    let points = curve(&|f| (part.of)(f));
                    plot.line(Line::new(part.name, points).color(egui::Color32::from_rgb(r, g, b)));
                }
            }
        });
}

/// Depth [mm] and both edges of the band on the way in, in stretches without a gap.
fn band(records: &[FrameRecord]) -> Vec<[Vec<f64>; 3]> {
    let inward: Vec<&FrameRecord> = frames_on_the_way_in(records).collect();
    let every = inward.len().div_ceil(500).max(1);
    let mut stretches = vec![<[Vec<f64>; 3]>::default()];
    for record in inward.into_iter().step_by(every) {
        match (record.force_error, stretches.last_mut()) {
            (Some(error), Some([depths, lower, upper])) => {
                depths.push(record.depth * 1e3);
                lower.push(record.force.axial - error);
                upper.push(record.force.axial + error);
            }
            (None, Some([depths, ..])) if !depths.is_empty() => stretches.push(Default::default()),
            _ => {}
        }
    }
    stretches.retain(|[depths, ..]| !depths.is_empty());
    stretches
}

/// What the last frame has, and how fast the run goes.
fn numbers(ui: &mut egui::Ui, practice: &Practice, record: &FrameRecord, haptic: Option<LoopTiming>) {
    egui::Grid::new("numbers").num_columns(2).striped(true).show(ui, |ui| {
        let mut row = |name: &str, value: String| {
            ui.label(name);
            ui.label(value);
            ui.end_row();
        };
        let largest = practice.records.iter().map(|r| r.force.axial).fold(0.0, f64::max);
        row(texts::LARGEST_FORCE, format!("{largest:.3} N"));
        row(texts::ASIDE, format!("{:.3} N", record.force.lateral.length()));
        row(texts::WORK, format!("{:.2} mJ", record.energy.external * 1e3));
        row(texts::STORED, format!("{:.2} mJ", record.energy.elastic * 1e3));
        row(texts::FRICTION, format!("{:.2} mJ", record.energy.friction * 1e3));
        row(texts::CUTTING, format!("{:.2} mJ", record.energy.cutting * 1e3));
        row(texts::FRAMES, format!("{:.0} /s", practice.timing.frames_per_second()));
        row(texts::PHYSICS, format!("{:.1} ms", practice.timing.physics * 1e3));
        let factor = practice.timing.real_time_factor();
        row(texts::REAL_TIME, if factor > 0.0 { format!("{factor:.2}") } else { "-".into() });
        if practice.leader == Leader::Hand {
            let latency = practice.latency;
            let told = format!("{} frame(s), {:.0} ms", latency.most_frames, latency.mean * 1e3);
            row(texts::LATENCY, if latency.count > 0 { told } else { "-".into() });
            row(texts::TOO_FAST, format!("{}", practice.limited_frames));
        }
        if let Some(timing) = haptic {
            row(texts::HAPTIC_RATE, format!("{:.0} /s", timing.rate()));
            let told = format!("{:.1} ms, {:.1} ms", timing.longest_gap * 1e3, timing.latency * 1e3);
            row(texts::HAPTIC_GAP, told);
        }
    });
}

/// Whether the run is healthy.
fn lights(ui: &mut egui::Ui, record: &FrameRecord) {
    ui.horizontal_wrapped(|ui| {
        let imbalance = record.verdict.worst_imbalance;
        let bound = crate::verdict::Quantity::EnergyImbalance.bound();
        let stops = bound.stop.map_or(f64::INFINITY, |stop| stop.0);
        light(
            ui,
            texts::ENERGY_LIGHT,
            &format!("{:.2} %", 100.0 * imbalance),
            imbalance <= bound.ok,
            imbalance <= stops,
        );
        let clamped = record.health.clamped_nodes;
        light(ui, texts::CLAMPED_LIGHT, &clamped.to_string(), clamped == 0, clamped < 10);
        let inverted = record.health.inverted_cells;
        light(ui, texts::INVERTED_LIGHT, &inverted.to_string(), inverted == 0, inverted < 5);
    });
}

/// What an attempt was worth; false where it was closed.
pub fn debriefing(context: &egui::Context, score: &Score, progress: &[(u32, u64, f64)]) -> bool {
    let mut open = true;
    egui::Window::new(texts::DEBRIEFING).open(&mut open).default_width(620.0).show(context, |ui| {
        egui::ScrollArea::vertical().max_height(480.0).show(ui, |ui| {
            ui.monospace(score.text());
            if progress.len() > 1 {
                let points: PlotPoints = progress.iter().map(|(n, _, value)| [f64::from(*n), *value]).collect();
                Plot::new("progress")
                    .height(140.0)
                    .x_axis_label(texts::ATTEMPT)
                    .y_axis_label(texts::PROGRESS)
                    .allow_scroll(false)
                    .show(ui, |plot| plot.line(Line::new(texts::PROGRESS, points)));
            }
        });
    });
    open
}

/// A sign that does not need its colour to be read: a tick, a warning or a cross with its value.
fn light(ui: &mut egui::Ui, name: &str, value: &str, good: bool, bearable: bool) {
    let (sign, colour) = match (good, bearable) {
        (true, _) => ("ok", egui::Color32::from_rgb(86, 180, 233)),
        (_, true) => ("!", egui::Color32::from_rgb(240, 228, 66)),
        _ => ("!!", egui::Color32::from_rgb(213, 94, 0)),
    };
    ui.colored_label(colour, format!("{name}: {value} {sign}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_depth_axis_has_its_own_number() {
        let labels = |to: f64| -> Vec<String> {
            depth_marks(GridInput { bounds: (0.0, to), base_step_size: to / 10.0 })
                .into_iter()
                .map(depth_label)
                .collect()
        };
        assert_eq!(labels(1.5), ["0.0", "0.5", "1.0", "1.5"]);
        assert_eq!(labels(0.5), ["0.0", "0.2", "0.4"]);
        assert_eq!(labels(12.0), ["0", "5", "10"]);
    }
}
