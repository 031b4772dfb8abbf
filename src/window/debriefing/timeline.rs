//! Force and depth over simulated time, with what happened.

use egui_plot::{Line, MarkerShape, Plot, PlotPoints, Points, VLine};

use crate::training::debrief::{Debrief, Moment};
use crate::training::events::Gravity;
use crate::window::lesson;
use crate::window::panels::{UPRIGHT, axis_label, axis_marks};
use crate::words::say;

/// Part of the height that the force has; the rest is the depth.
const FORCE: f32 = 0.55;
/// Points of a curve: a plot is some hundred pixels wide.
const MOST_POINTS: usize = 1500;

/// Draws both, together so many points high; the moment that was clicked [s].
pub fn show(ui: &mut egui::Ui, debrief: &Debrief, now: f64, height: f32) -> Option<f64> {
    ui.strong(say("debrief-timeline"));
    let force = one(ui, debrief, now, ("debrief-force", FORCE * height, &|m| m.force));
    let depth = one(ui, debrief, now, ("debrief-depth", (1.0 - FORCE) * height, &|m| m.depth * 1e3));
    force.or(depth)
}

/// Key of its words and its name, height, value of a moment.
type Curve<'a> = (&'static str, f32, &'a dyn Fn(&Moment) -> f64);

fn one(ui: &mut egui::Ui, debrief: &Debrief, now: f64, (key, height, of): Curve<'_>) -> Option<f64> {
    let colours = [Gravity::Good, Gravity::Note, Gravity::Bad].map(|gravity| lesson::colour(gravity, ui));
    let ink = ui.visuals().strong_text_color();
    let shown = Plot::new(key)
        .height(height)
        .link_axis(egui::Id::unique("debrief time"), [true, false])
        .include_x(0.0)
        .include_x(debrief.simulated)
        .include_y(0.0)
        .y_axis_label(say(key))
        .y_grid_spacer(|input| axis_marks(input, UPRIGHT))
        .y_axis_formatter(|mark, _| axis_label(mark))
        .y_axis_min_width(2.6 * ui.text_style_height(&egui::TextStyle::Body))
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .show(ui, |plot| {
            let every = debrief.moments.len().div_ceil(MOST_POINTS).max(1);
            let points: PlotPoints<'_> = debrief.moments.iter().step_by(every).map(|m| [m.time, of(m)]).collect();
            plot.line(Line::new(say(key), points).color(ink).width(1.5).allow_band(false));
            for event in &debrief.events {
                let Some((moment, _)) = debrief.at(event.time) else { continue };
                let (shape, colour) = match event.gravity() {
                    Gravity::Good => (MarkerShape::Up, colours[0]),
                    Gravity::Note => (MarkerShape::Circle, colours[1]),
                    Gravity::Bad => (MarkerShape::Cross, colours[2]),
                };
                let point = Points::new(event.text(), vec![[event.time, of(&moment)]]).shape(shape).radius(5.0);
                plot.points(point.color(colour));
            }
            plot.vline(VLine::new(say("debrief-time"), now).color(egui::Color32::from_rgb(204, 121, 167)));
            plot.pointer_coordinate().map(|at| at.x)
        });
    shown.response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, say(key)));
    let asked = shown.inner.filter(|_| shown.response.clicked());
    asked.map(|time| time.clamp(0.0, debrief.simulated))
}
