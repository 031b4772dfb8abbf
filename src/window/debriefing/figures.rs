//! The three figures that matter with their trend, and all others behind a fold.

use crate::training::debrief::{Debrief, KeyFigure, better, figure_name, spoken};
use crate::training::events::Gravity;
use crate::training::score::Score;
use crate::training::texts::Better;
use crate::units::short;
use crate::window::lesson;
use crate::words::{say, say_with};

/// Height of a trend, in lines of text.
const TREND: f32 = 2.0;

/// The figures that matter, one under the other.
pub fn key_figures(ui: &mut egui::Ui, debrief: &Debrief) {
    if debrief.figures.is_empty() {
        return;
    }
    ui.strong(say("debrief-key-figures"));
    for figure in &debrief.figures {
        ui.group(|ui| {
            ui.set_width(ui.available_width());
            ui.label(figure_name(&figure.row));
            ui.horizontal_wrapped(|ui| {
                let value = figure.row.value.map_or_else(|| "-".into(), spoken);
                ui.heading(format!("{value} {}", figure.row.unit));
                match figure.row.better {
                    Better::Lower => _ = ui.weak(say("lower-is-better")),
                    Better::Higher => _ = ui.weak(say("higher-is-better")),
                    Better::None => {}
                }
                if let Some(reference) = figure.row.reference {
                    ui.weak(format!("{} {}", say("debrief-reference"), spoken(reference)));
                }
            });
            match figure.trend.len() {
                0 => {}
                1 => _ = ui.small(say("debrief-first")),
                _ => trend(ui, figure),
            }
        });
    }
}

/// A line over the attempts, the last one marked.
fn trend(ui: &mut egui::Ui, figure: &KeyFigure) {
    let told = say_with("debrief-trend", &[("n", figure.trend.len().into())]);
    ui.small(&told);
    let height = TREND * ui.text_style_height(&egui::TextStyle::Body);
    let (rect, response) = ui.allocate_exact_size(egui::vec2(ui.available_width(), height), egui::Sense::hover());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, &told));
    let values = || figure.trend.iter().map(|(_, value)| *value);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let last = figure.trend.len() - 1;
    let at = |n: usize, value: f64| {
        let part = if high > low { (value - low) / (high - low) } else { 0.5 };
        let x = egui::lerp(rect.left() + 4.0..=rect.right() - 4.0, n as f32 / last as f32);
        egui::pos2(x, egui::lerp(rect.bottom() - 4.0..=rect.top() + 4.0, part as f32))
    };
    let points: Vec<egui::Pos2> = values().enumerate().map(|(n, value)| at(n, value)).collect();
    let colour = lesson::colour(Gravity::Good, ui);
    let painter = ui.painter_at(rect);
    points.iter().for_each(|point| _ = painter.circle_filled(*point, 2.0, colour));
    painter.circle_filled(points[last], 4.0, colour);
    painter.add(egui::Shape::line(points, egui::Stroke::new(1.5, colour)));
}

/// Every figure, and how far to trust them.
pub fn all(ui: &mut egui::Ui, score: &Score) {
    egui::CollapsingHeader::new(say("debrief-all-figures")).show(ui, |ui| {
        egui::ScrollArea::horizontal().show(ui, |ui| {
            egui::Grid::new("all figures").num_columns(5).striped(true).show(ui, |ui| {
                for heading in [
                    say("debrief-figure"),
                    say("debrief-value"),
                    say("debrief-unit"),
                    say("debrief-compared"),
                    say("debrief-better"),
                ] {
                    ui.strong(heading);
                }
                ui.end_row();
                let known = |value: Option<f64>| value.map_or_else(|| "-".to_string(), short);
                for row in &score.rows {
                    ui.label(figure_name(row));
                    ui.label(known(row.value));
                    ui.label(&row.unit);
                    ui.label(known(row.reference));
                    ui.label(better(row.better));
                    ui.end_row();
                }
            });
        });
    });
    if !score.trust.is_good() {
        egui::CollapsingHeader::new(say("debrief-trust")).show(ui, |ui| {
            for reason in &score.trust.reasons {
                ui.label(reason);
            }
        });
    }
}
