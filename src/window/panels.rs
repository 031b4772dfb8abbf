//! The panels around the view: what is shown, who leads, forces, energies, health and times.

use egui::Key;
use egui_plot::{AxisHints, Corner, FilledArea, GridInput, GridMark, Legend, Line, Plot, PlotPoints};

use super::accuracy::Accuracy;
use super::anatomy_view::Entry;
use super::appearance::{self, ColourMap, Look};
use super::camera::{Camera, Preset};
use super::debriefing::Answer;
use super::hand::{Desk, Drag};
use super::practice::{Leader, Practice, State};
use super::preferences;
use super::scene_view::Scale;
use super::screens::Next;
use super::settings::{Fold, Settings};
use super::slider::named;
use super::theme::{self, Tint};
use crate::haptic::LoopTiming;
use crate::observables::field::{Field, Range, VON_MISES};
use crate::observables::{ForceParts, FrameRecord};
use crate::output::curve::frames_on_the_way_in;
use crate::training::debrief::spoken;
use crate::training::scene_words;
use crate::words::{say, say_of, say_with};

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
#[derive(Debug, Clone, Default, PartialEq)]
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
    /// What was clicked in the debriefing.
    pub answer: Option<Answer>,
    /// To another screen, or to another attempt.
    pub next: Option<Next>,
}

/// A curve that lies behind the live one: depth [mm], force [N].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ReferenceCurve {
    pub name: String,
    pub points: Vec<[f64; 2]>,
}

/// Widest and narrowest panels on the left and on the right, and their part of the window.
const LEFT: (f32, f32, f32) = (200.0, 285.0, 0.23);
const RIGHT: (f32, f32, f32) = (215.0, 345.0, 0.27);

/// Widths of both panels in a window that is so wide [points]. They keep them whatever they show.
pub fn widths(window: f32) -> [f32; 2] {
    [LEFT, RIGHT].map(|(least, most, part)| (part * window).clamp(least, most).round())
}

/// The bar above the view: the way back, the scene, what is folded, what is chosen for good.
pub fn bar(ui: &mut egui::Ui, title: &str, settings: &mut Settings, wishes: &mut Wishes, help: &mut bool) {
    let key = |key| ui.input(|input| input.key_pressed(key));
    let (left, right, leave) = (key(Key::F2), key(Key::F3), key(Key::F8));
    ui.horizontal(|ui| {
        if ui.button(say("bar-start")).on_hover_text("F8").clicked() || leave {
            wishes.next = Some(Next::Start);
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            *help |= ui.button(say("help-button")).clicked();
            preferences::menu(ui, settings);
            for (part, name, hint, pressed) in
                [(Fold::Right, "bar-readings", "F3", right), (Fold::Left, "bar-controls", "F2", left)]
            {
                let shown = !settings.is_folded(part);
                if ui.selectable_label(shown, say(name)).on_hover_text(hint).clicked() || pressed {
                    settings.fold(part, shown);
                }
            }
            ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                ui.add(egui::Label::new(egui::RichText::new(scene_words::title(title)).strong()).truncate());
            });
        });
    });
}

/// What stands on the left: the task and the run first, then the needle and the view, behind a fold what an engineer needs.
pub fn controls(
    ui: &mut egui::Ui,
    practice: &mut Practice,
    choices: &mut Choices,
    camera: &mut Camera,
    desk: &mut Desk,
) -> Wishes {
    let mut wishes = Wishes::default();
    ui.spacing_mut().slider_width = (0.34 * ui.available_width()).clamp(60.0, 110.0);
    if let Some(task) = &practice.scene().task {
        ui.group(|ui| {
            ui.set_width(ui.available_width());
            ui.strong(scene_words::task(&task.name));
            ui.label(scene_words::briefing(&task.briefing));
            for (key, place, limit) in
                [("limit-force", "newtons", task.force_limit), ("limit-time", "seconds", task.time_limit)]
            {
                if let Some(limit) = limit {
                    ui.label(say_with(key, &[(place, spoken(limit).into())]));
                }
            }
        });
    }
    run_buttons(ui, practice, &mut wishes);
    if let Some(reason) = &practice.unwritten {
        ui.colored_label(ui.visuals().error_fg_color, format!("{} {reason}", say("unwritten")));
        wishes.write_again = ui.button(say("write-again")).clicked();
    }
    if practice.leader == Leader::Hand {
        hand(ui, practice, desk);
    }
    ui.separator();
    wishes.recut |= view(ui, practice, choices, camera);
    // Who practises a task is not asked about meshes.
    let engineer = practice.scene().task.is_none();
    let fold = egui::CollapsingHeader::new(say("engineer")).id_salt(("engineer", engineer)).default_open(engineer);
    fold.show(ui, |ui| engineering(ui, practice, choices, &mut wishes));
    wishes
}

/// Run, pause, begin anew and finish.
fn run_buttons(ui: &mut egui::Ui, practice: &mut Practice, wishes: &mut Wishes) {
    let key = |key| ui.input(|input| input.key_pressed(key));
    let (again, finish) = (key(Key::F5), key(Key::F6));
    ui.horizontal_wrapped(|ui| {
        let running = practice.state == State::Running;
        let may_run = matches!(practice.state, State::Running | State::Paused);
        let label = if running { say("pause") } else { say("play") };
        if ui.add_enabled(may_run, egui::Button::new(label)).on_hover_text(say("key-space")).clicked() {
            practice.state = if running { State::Paused } else { State::Running };
        }
        if ui.button(say("restart")).on_hover_text("F5").clicked() || again {
            wishes.restart = Some(practice.leader);
        }
        let begun = !practice.records.is_empty();
        let done = ui.add_enabled(begun, egui::Button::new(say("finish"))).on_hover_text("F6");
        wishes.debrief = done.clicked() || (begun && finish);
    });
    if practice.tuning.is_busy() {
        ui.label(say("changing"));
    } else if practice.waits_for_a_hand() {
        ui.strong(say("begin"));
    }
}

/// What a hand needs to know and to choose.
fn hand(ui: &mut egui::Ui, practice: &Practice, desk: &mut Desk) {
    let mut speed = desk.speed * 1e3;
    let largest = (practice.speed_limit * 1e3).min(50.0);
    if named(ui, egui::Slider::new(&mut speed, 0.5..=largest), say("hand-speed")).changed() {
        desk.speed = speed * 1e-3;
    }
    ui.small(say("keys-lead"));
    if practice.path_is_free() {
        ui.horizontal_wrapped(|ui| {
            ui.label(say("drag"));
            for (drag, name) in Drag::ALL {
                ui.radio_value(&mut desk.drag, drag, say(name)).on_hover_text(say("drag-about"));
            }
        });
    } else {
        ui.small(say("planned-path"));
    }
    ui.small(say("keys-more"));
}

/// From where and how the tissue is seen; true where the cut has changed.
fn view(ui: &mut egui::Ui, practice: &Practice, choices: &mut Choices, camera: &mut Camera) -> bool {
    ui.horizontal_wrapped(|ui| {
        for (preset, name) in Preset::ALL {
            if ui.small_button(said("seen-from", name)).clicked() {
                camera.preset(preset);
            }
        }
    });
    appearance::parts(ui, &mut choices.look, &choices.parts);
    appearance::controls(ui, &mut choices.look, !practice.scene().targets.is_empty());
    cut(ui, choices)
}

/// Who leads and how fast, effects and accuracy, fields and layers.
fn engineering(ui: &mut egui::Ui, practice: &mut Practice, choices: &mut Choices, wishes: &mut Wishes) {
    ui.horizontal_wrapped(|ui| {
        for (leader, name) in [(Leader::Hand, say("hand")), (Leader::Script, say("script"))] {
            if ui.radio(practice.leader == leader, name).clicked() && practice.leader != leader {
                wishes.restart = Some(leader);
            }
        }
        wishes.step = ui.add_enabled(practice.state == State::Paused, egui::Button::new(say("step"))).clicked();
    });
    named(ui, egui::Slider::new(&mut choices.pace, super::PACES).logarithmic(true), say("pace"));
    if practice.may_go_back() {
        let last = practice.records.last().map_or(0.0, |r| r.time);
        let mut time = last;
        let slider = named(ui, egui::Slider::new(&mut time, 0.0..=last).max_decimals(2), say("moment"));
        if slider.changed() && time < last {
            wishes.go_back = Some(time);
        }
    }
    tuning(ui, practice, choices);
    ui.separator();
    if choices.parts.is_empty() || !choices.look.natural {
        field(ui, practice, choices);
        appearance::colours(ui, &mut choices.look);
        let regions = &practice.scene().regions;
        if !regions.is_empty() {
            let names =
                std::iter::once(say("remainder")).chain(regions.iter().map(|region| scene_words::name(&region.name)));
            wishes.recut |= appearance::layers(ui, &mut choices.look, names);
        }
    }
}

/// The text `<kind>-<name>` of something that has an English name; that name where no language has one.
fn said(kind: &str, name: &'static str) -> &'static str {
    let key: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    say_of(&format!("{kind}-{}", key.replace("--", "-"))).unwrap_or(name)
}

/// Effects with their sliders, and accuracy against cost.
fn tuning(ui: &mut egui::Ui, practice: &mut Practice, choices: &mut Choices) {
    egui::CollapsingHeader::new(say("effects")).show(ui, |ui| {
        let (scene, tuning) = practice.tunable();
        super::effects_panel::effects(ui, scene, tuning);
        super::effects_panel::saving(ui, tuning, &mut choices.save_as);
    });
    egui::CollapsingHeader::new(say("accuracy")).show(ui, |ui| {
        let now = (practice.simulation.model.mesh.cell_count() as u64, practice.simulation.steps_per_frame());
        let timing = practice.timing;
        let (scene, tuning) = practice.tunable();
        choices.accuracy.get_or_insert_with(|| Accuracy::new(scene)).show(ui, scene, tuning, &timing, now);
    });
}

/// Which field is drawn, and its scale.
fn field(ui: &mut egui::Ui, practice: &Practice, choices: &mut Choices) {
    let name = ui.label(say("field")).id;
    let list = egui::ComboBox::from_id_salt("field").width(0.9 * ui.available_width()).wrap();
    let list = list.selected_text(said("field", choices.scale.field.label)).show_ui(ui, |ui| {
        for field in Field::drawn_of(practice.scene()) {
            if ui.selectable_label(choices.scale.field == field, said("field", field.label)).clicked() {
                choices.scale = default_scale(field);
            }
        }
    });
    list.response.labelled_by(name);
    let unit = choices.scale.field.unit;
    ui.checkbox(&mut choices.automatic, say("automatic"));
    ui.add_enabled_ui(!choices.automatic, |ui| {
        let (mut low, mut high) = (unit.show(choices.scale.low), unit.show(choices.scale.high));
        ui.horizontal_wrapped(|ui| {
            ui.add(egui::DragValue::new(&mut low).speed(0.1).suffix(format!(" {}", unit.word())));
            ui.add(egui::DragValue::new(&mut high).speed(0.1).suffix(format!(" {}", unit.word())));
        });
        (choices.scale.low, choices.scale.high) = (unit.read(low), unit.read(high.max(low + 1e-6)));
    });
    if matches!(choices.scale.field.range, Range::Positive(_)) {
        ui.checkbox(&mut choices.scale.logarithmic, say("logarithmic"));
    }
    colour_bar(ui, &choices.scale, choices.look.map);
}

/// Where the tissue is cut open; true where that changed.
fn cut(ui: &mut egui::Ui, choices: &mut Choices) -> bool {
    let mut recut = false;
    let name = ui.label(say("cut")).id;
    ui.horizontal(|ui| {
        let mut axis = choices.cut.map(|(axis, _)| axis);
        for (value, name) in [(None, say("no-cut")), (Some(0), "x"), (Some(1), "y"), (Some(2), "z")] {
            if ui.radio(axis == value, name).clicked() {
                axis = value;
                choices.cut = value.map(|axis| (axis, 0.5));
                recut = true;
            }
        }
    });
    if let Some((_, at)) = &mut choices.cut {
        recut |= ui.add(egui::Slider::new(at, 0.0..=1.0).show_value(false)).labelled_by(name).changed();
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
    let font = egui::TextStyle::Small.resolve(ui.style());
    let colour = ui.visuals().text_color();
    let (line, _) = ui.allocate_exact_size(egui::vec2(rect.width(), 1.2 * font.size), egui::Sense::hover());
    for (at, align, text) in [
        (line.left_top(), egui::Align2::LEFT_TOP, format!("{:.2}", unit.show(scale.low))),
        (line.center_top(), egui::Align2::CENTER_TOP, format!("{:.2}", unit.show(middle))),
        (line.right_top(), egui::Align2::RIGHT_TOP, format!("{:.2} {}", unit.show(scale.high), unit.word())),
    ] {
        ui.painter().text(at, align, text, font.clone(), colour);
    }
}

/// Room for a number at a line of an axis, in the steps that the plot proposes for lines without numbers.
const ACROSS: f64 = 3.0;
/// The same beside an axis that stands.
pub(super) const UPRIGHT: f64 = 4.0;

/// Lines of an axis: 1, 2 or 5 times a power of ten apart, with `room` for a number at each. Powers of ten alone would leave a plot of some
/// millimetres, or of half a newton, without a number.
pub(super) fn axis_marks(input: GridInput, room: f64) -> Vec<GridMark> {
    let least = room * input.base_step_size;
    let power = 10f64.powf(least.log10().floor());
    let step_size = [1.0, 2.0, 5.0, 10.0].map(|n| n * power).into_iter().find(|s| *s >= least).unwrap_or(10.0 * power);
    // A number that stands half beyond the upper end of an upright axis lies over what is there.
    let inside = if room == UPRIGHT { input.base_step_size } else { 0.0 };
    let from = (input.bounds.0 / step_size).ceil() as i64;
    let to = ((input.bounds.1 - inside) / step_size).floor() as i64;
    (from..=to).map(|n| GridMark { value: n as f64 * step_size, step_size }).collect()
}

/// The number at a line of an axis, with the decimals that steps like 0.5 need.
pub(super) fn axis_label(mark: GridMark) -> String {
    let decimals = (-mark.step_size.log10().floor()).max(0.0) as usize;
    format!("{:.decimals$}", mark.value)
}

/// Force against depth on the right, behind a fold the numbers and lights of an engineer.
pub fn readings(
    ui: &mut egui::Ui,
    practice: &Practice,
    choices: &mut Choices,
    reference: &[ReferenceCurve],
    haptic: Option<LoopTiming>,
) {
    let Some(record) = practice.records.last() else {
        ui.label(say("nothing-yet"));
        return;
    };
    ui.horizontal_wrapped(|ui| {
        let error = record.force_error.map_or(String::new(), |e| format!(" \u{b1} {e:.3}"));
        ui.heading(format!("{:.3}{error} N", record.force.axial));
        ui.label(format!("{} {:.2} mm", say("at-depth"), record.depth * 1e3));
    });
    match &practice.state {
        State::Stopped(reason) => {
            ui.colored_label(Tint::Caution.of(ui), format!("{}\n{reason}", say("stopped")));
        }
        State::Ended => {
            ui.label(say("ended"));
        }
        State::Running | State::Paused => {}
    }
    if let Some(why) = record.verdict.sentence() {
        // A trainee is not asked about the balance of energies.
        match practice.scene().task {
            Some(_) => ui.colored_label(Tint::Caution.of(ui), say("doubtful-task")).on_hover_text(why),
            None => ui.colored_label(Tint::Caution.of(ui), format!("{}: {why}", say("doubtful"))),
        };
    }
    force_plot(ui, practice, choices.show_parts, reference);
    ui.checkbox(&mut choices.show_parts, say("parts"));
    ui.checkbox(&mut choices.error_bar, say("error-bar"));
    if let Some(why) = &practice.no_band {
        ui.label(why);
    }
    let engineer = practice.scene().task.is_none();
    let fold = egui::CollapsingHeader::new(say("figures")).id_salt(("figures", engineer)).default_open(engineer);
    fold.show(ui, |ui| {
        numbers(ui, practice, record, haptic);
        lights(ui, record);
    });
}

/// Force against depth, before the curves that it is compared with.
fn force_plot(ui: &mut egui::Ui, practice: &Practice, show_parts: bool, reference: &[ReferenceCurve]) {
    let curve = |of: &dyn Fn(&ForceParts) -> f64| -> PlotPoints<'static> {
        // A trainee's minutes are thousands of frames; the plot is some hundred pixels wide.
        let every = practice.records.len().div_ceil(500).max(1);
        practice.records.iter().step_by(every).map(|r| [r.depth * 1e3, of(&r.force)]).collect()
    };
    let colours: Vec<egui::Color32> = ForceParts::PARTS.iter().map(|part| theme::line(ui, part.colour)).collect();
    let (main, beside) = (theme::line(ui, Tint::Main.bytes(ui)), Tint::Beside.of(ui));
    let bands = band(&practice.records);
    let mut plot = Plot::new("force");
    // One curve needs no name, which would lie over it.
    if show_parts || !reference.is_empty() || !bands.is_empty() {
        plot = plot.legend(Legend::default().position(Corner::LeftTop));
    }
    plot.height((0.4 * ui.available_height()).max(140.0))
        .x_grid_spacer(|input| axis_marks(input, ACROSS))
        .y_grid_spacer(|input| axis_marks(input, UPRIGHT))
        .custom_x_axes(vec![
            AxisHints::new_x()
                .label(say("depth-axis"))
                .label_spacing(egui::Rangef::new(16.0, 28.0))
                .formatter(|mark, _| axis_label(mark)),
        ])
        .y_axis_label(say("force-axis"))
        .y_axis_formatter(|mark, _| axis_label(mark))
        // Room for the numbers in the corner.
        .set_margin_fraction(egui::vec2(0.06, 0.14))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            for [depths, lower, upper] in bands {
                let area = FilledArea::new(say("band"), &depths, &lower, &upper);
                plot.add(area.fill_color(egui::Color32::from_rgba_unmultiplied(0, 114, 178, 90)));
            }
            for curve in reference {
                let line = Line::new(curve.name.clone(), PlotPoints::from(curve.points.clone()));
                plot.line(line.color(beside).width(1.5));
            }
            // Bands of points that share a pixel are thin, broken lines where the curve is steep.
            plot.line(Line::new(say("axial"), curve(&|f| f.axial)).width(2.0).color(main).allow_band(false));
            if show_parts {
                for (part, colour) in ForceParts::PARTS.iter().zip(&colours) {
                    let points = curve(&|f| (part.of)(f));
                    plot.line(Line::new(said("force", part.name), points).color(*colour));
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
    // Names go on in the next line where there is no room for both columns.
    let half = 0.56 * ui.available_width();
    egui::Grid::new("numbers").num_columns(2).striped(true).max_col_width(half).show(ui, |ui| {
        let mut row = |name: &str, value: String| {
            ui.label(name);
            ui.label(value);
            ui.end_row();
        };
        let largest = practice.records.iter().map(|r| r.force.axial).fold(0.0, f64::max);
        row(say("largest-force"), format!("{largest:.3} N"));
        row(say("aside"), format!("{:.3} N", record.force.lateral.length()));
        row(say("work"), format!("{:.2} mJ", record.energy.external * 1e3));
        row(say("stored"), format!("{:.2} mJ", record.energy.elastic * 1e3));
        row(say("friction"), format!("{:.2} mJ", record.energy.friction * 1e3));
        row(say("cutting"), format!("{:.2} mJ", record.energy.cutting * 1e3));
        row(say("frames"), format!("{:.0} /s", practice.timing.frames_per_second()));
        row(say("physics"), format!("{:.1} ms", practice.timing.physics * 1e3));
        let factor = practice.timing.real_time_factor();
        row(say("real-time"), if factor > 0.0 { format!("{factor:.2}") } else { "-".into() });
        if practice.leader == Leader::Hand {
            let latency = practice.latency;
            let places =
                [("frames", latency.most_frames.into()), ("milliseconds", format!("{:.0}", latency.mean * 1e3).into())];
            let told = say_with("latency-told", &places);
            row(say("latency"), if latency.count > 0 { told } else { "-".into() });
            row(say("too-fast"), format!("{}", practice.limited_frames));
        }
        if let Some(timing) = haptic {
            row(say("haptic-rate"), format!("{:.0} /s", timing.rate()));
            let told = format!("{:.1} ms, {:.1} ms", timing.longest_gap * 1e3, timing.latency * 1e3);
            row(say("haptic-gap"), told);
        }
    });
}

/// Whether the run is healthy.
fn lights(ui: &mut egui::Ui, record: &FrameRecord) {
    ui.vertical(|ui| {
        let imbalance = record.verdict.worst_imbalance;
        let bound = crate::verdict::Quantity::EnergyImbalance.bound();
        let stops = bound.stop.map_or(f64::INFINITY, |stop| stop.0);
        light(
            ui,
            say("energy-light"),
            &format!("{:.2} %", 100.0 * imbalance),
            imbalance <= bound.ok,
            imbalance <= stops,
        );
        let clamped = record.health.clamped_nodes;
        light(ui, say("clamped-light"), &clamped.to_string(), clamped == 0, clamped < 10);
        let inverted = record.health.inverted_cells;
        light(ui, say("inverted-light"), &inverted.to_string(), inverted == 0, inverted < 5);
    });
}

/// A sign that does not need its colour to be read: a tick, a warning or a cross with its value.
fn light(ui: &mut egui::Ui, name: &str, value: &str, good: bool, bearable: bool) {
    let (sign, colour) = match (good, bearable) {
        (true, _) => ("ok", Tint::Good.of(ui)),
        (_, true) => ("!", Tint::Caution.of(ui)),
        _ => ("!!", Tint::Bad.of(ui)),
    };
    ui.colored_label(colour, format!("{name}: {value} {sign}"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_depth_axis_has_its_own_number() {
        let labels = |to: f64| -> Vec<String> {
            axis_marks(GridInput { bounds: (0.0, to), base_step_size: to / 10.0 }, ACROSS)
                .into_iter()
                .map(axis_label)
                .collect()
        };
        assert_eq!(labels(1.5), ["0.0", "0.5", "1.0", "1.5"]);
        assert_eq!(labels(0.5), ["0.0", "0.2", "0.4"]);
        assert_eq!(labels(12.0), ["0", "5", "10"]);
    }
}
