//! The path of the tip beside that of the reference attempt, in space: turned with the mouse, drawn as lines.

use egui::{Color32, Pos2, Rect, Stroke, vec2};
use glam::DVec3;

use crate::anatomy::colours::of_kind;
use crate::scene::{Goal, Obstacle, Scene};
use crate::training::debrief::Debrief;
use crate::training::events::Watcher;
use crate::training::kinematic::Sample;
use crate::window::lesson::{self, Sign};
use crate::words::say;

/// Turn per point of a drag [rad].
const TURN: f32 = 0.01;
/// Points that an obstacle is drawn with at most.
const MOST_POINTS: usize = 700;
/// Points of a path that are drawn at most.
const MOST_STEPS: usize = 600;
/// Length of the needle that is drawn [m].
const NEEDLE: f64 = 30e-3;

/// Colour of the reference attempt and of a target.
pub const REFERENCE: Color32 = Color32::from_rgb(130, 130, 130);
pub const TARGET: Color32 = Color32::from_rgb(0, 158, 115);

/// Where one looks from.
#[derive(Debug, Clone, Copy)]
pub struct Orbit {
    yaw: f32,
    pitch: f32,
}

impl Default for Orbit {
    fn default() -> Self {
        Orbit { yaw: -0.5, pitch: 0.35 }
    }
}

/// What an obstacle is drawn as.
#[derive(Debug, Clone)]
pub enum Body {
    /// Points at its border [m].
    Points(Vec<DVec3>, Color32),
    Sphere(DVec3, f64, Color32),
    Cylinder(DVec3, DVec3, f64, Color32),
}

/// The obstacles of a task.
pub fn bodies(scene: &Scene, watcher: &Watcher) -> Vec<Body> {
    let goals = scene.task.as_ref().map_or(&[][..], |task| &task.goals);
    let mut known = watcher.obstacles();
    let body = |goal: &Goal| {
        let Goal::Avoid { name, obstacle, .. } = goal else { return None };
        let points = known.next().map(|(_, clearance)| clearance.points(MOST_POINTS));
        let [r, g, b] = of_kind(name).unwrap_or([150, 50, 120]);
        let colour = Color32::from_rgb(r, g, b);
        Some(match *obstacle {
            Obstacle::Sphere { centre, radius } => Body::Sphere(centre, radius, colour),
            Obstacle::Cylinder { from, to, radius } => Body::Cylinder(from, to, radius, colour),
            Obstacle::Region(_) => Body::Points(points.unwrap_or_default(), colour),
        })
    };
    goals.iter().filter_map(body).collect()
}

/// From the scene to the picture.
#[derive(Clone, Copy)]
struct Eye {
    right: DVec3,
    up: DVec3,
    middle: DVec3,
    centre: Pos2,
    /// Points per metre.
    scale: f64,
}

impl Eye {
    /// All of the block is seen.
    fn on(scene: &Scene, orbit: Orbit, rect: Rect) -> Eye {
        let (yaw, pitch) = (f64::from(orbit.yaw), f64::from(orbit.pitch));
        let right = DVec3::new(yaw.cos(), yaw.sin(), 0.0);
        let ahead = DVec3::new(-yaw.sin() * pitch.cos(), yaw.cos() * pitch.cos(), -pitch.sin());
        let size = scene.tissue.size + DVec3::Z * scene.tissue.top;
        let scale = f64::from(rect.width().min(rect.height())) / size.length();
        let middle = DVec3::Z * (0.5 * (scene.tissue.top - scene.tissue.size.z));
        Eye { right, up: right.cross(ahead), middle, centre: rect.center(), scale }
    }

    fn see(&self, x: DVec3) -> Pos2 {
        let way = x - self.middle;
        let (right, up) = (way.dot(self.right) * self.scale, way.dot(self.up) * self.scale);
        self.centre + vec2(right as f32, -up as f32)
    }
}

/// Colour of a moment: from blue to yellow, which all eyes tell apart.
pub fn of_time(part: f32) -> Color32 {
    let mix = |from: u8, to: u8| egui::lerp(f32::from(from)..=f32::from(to), part.clamp(0.0, 1.0)) as u8;
    Color32::from_rgb(mix(0, 240), mix(114, 200), mix(220, 40))
}

/// Draws a path, each part in the colour of its time.
pub fn draw_path(painter: &egui::Painter, path: &[Sample], see: impl Fn(DVec3) -> Pos2) {
    let every = path.len().div_ceil(MOST_STEPS).max(1);
    let points: Vec<Pos2> = path.iter().step_by(every).map(|s| see(s.tip)).collect();
    let count = points.len().max(2) as f32 - 1.0;
    for (n, pair) in points.windows(2).enumerate() {
        painter.line_segment([pair[0], pair[1]], Stroke::new(2.5, of_time(n as f32 / count)));
    }
}

/// Draws the reference path.
pub fn draw_reference(painter: &egui::Painter, path: &[Sample], see: impl Fn(DVec3) -> Pos2) {
    let points: Vec<Pos2> = path.iter().map(|s| see(s.tip)).collect();
    painter.extend(egui::Shape::dashed_line(&points, Stroke::new(5.0, REFERENCE), 6.0, 4.0));
}

/// The picture in space, so many points high.
pub fn show(
    ui: &mut egui::Ui,
    (scene, debrief): (&Scene, &Debrief),
    bodies: &[Body],
    orbit: &mut Orbit,
    (now, height): (Option<Sample>, f32),
) {
    ui.strong(say("debrief-path"));
    let size = vec2(ui.available_width(), height);
    let (rect, response) = ui.allocate_exact_size(size, egui::Sense::drag());
    response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, say("debrief-path")));
    orbit.yaw -= TURN * response.drag_delta().x;
    orbit.pitch = (orbit.pitch + TURN * response.drag_delta().y).clamp(-1.5, 1.5);
    response.on_hover_text(say("debrief-turn"));
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 4.0, ui.visuals().extreme_bg_color);
    let eye = Eye::on(scene, *orbit, rect.shrink(4.0));
    block(&painter, scene, &eye, ui.visuals().weak_text_color());
    for body in bodies {
        draw_body(&painter, body, &eye);
    }
    for target in &scene.targets {
        let radius = (target.radius * eye.scale).max(3.0) as f32;
        painter.circle_stroke(eye.see(target.position), radius, Stroke::new(2.0, TARGET));
    }
    if let Some(now) = now {
        let ink = ui.visuals().strong_text_color();
        let hub = now.tip - now.direction * NEEDLE;
        painter.line_segment([eye.see(hub), eye.see(now.tip)], Stroke::new(1.5, ink));
        painter.circle_filled(eye.see(now.tip), 3.5, ink);
    }
    draw_reference(&painter, &debrief.reference, |x| eye.see(x));
    draw_path(&painter, &debrief.path, |x| eye.see(x));
}

/// The edges of the block; the top face is filled a little.
fn block(painter: &egui::Painter, scene: &Scene, eye: &Eye, ink: Color32) {
    let (size, top) = (scene.tissue.size, scene.tissue.top);
    let corner = |n: usize| {
        let side = |bit: usize, half: f64| if n >> bit & 1 == 1 { half } else { -half };
        let z = if n >> 2 & 1 == 1 { top } else { -size.z };
        eye.see(DVec3::new(side(0, 0.5 * size.x), side(1, 0.5 * size.y), z))
    };
    let face = [4, 5, 7, 6].map(corner).to_vec();
    painter.add(egui::Shape::convex_polygon(face, ink.gamma_multiply(0.12), Stroke::NONE));
    for n in 0..8usize {
        for bit in (0..3).filter(|bit| n >> bit & 1 == 0) {
            painter.line_segment([corner(n), corner(n | 1 << bit)], Stroke::new(1.0, ink.gamma_multiply(0.5)));
        }
    }
}

fn draw_body(painter: &egui::Painter, body: &Body, eye: &Eye) {
    match body {
        Body::Points(points, colour) => {
            let faint = colour.gamma_multiply(0.6);
            points.iter().for_each(|x| _ = painter.circle_filled(eye.see(*x), 1.2, faint));
        }
        Body::Sphere(centre, radius, colour) => {
            let size = (radius * eye.scale) as f32;
            painter.circle(eye.see(*centre), size, colour.gamma_multiply(0.3), Stroke::new(1.5, *colour));
        }
        Body::Cylinder(from, to, radius, colour) => {
            let (a, b) = (eye.see(*from), eye.see(*to));
            let width = (radius * eye.scale) as f32;
            painter.line_segment([a, b], Stroke::new(2.0 * width, colour.gamma_multiply(0.35)));
            let aside = (b - a).normalized().rot90() * width;
            for side in [aside, -aside] {
                painter.line_segment([a + side, b + side], Stroke::new(1.5, *colour));
            }
        }
    }
}

/// What the lines mean.
pub fn legend(ui: &mut egui::Ui) {
    ui.horizontal_wrapped(|ui| {
        for (colour, text) in [
            (of_time(0.0), say("debrief-yours")),
            (REFERENCE, say("debrief-reference")),
            (TARGET, say("debrief-target")),
        ] {
            lesson::sign(ui, Sign::Note, colour);
            ui.label(text);
        }
    });
}
