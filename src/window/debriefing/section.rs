//! The path on a slice through the tissue at rest, in natural colours. The slice stands in the planned path; it is found beside the window.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};

use egui::{Color32, ColorImage, Pos2, Rect, Stroke, vec2};
use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::path::{TARGET, draw_path, draw_reference};
use crate::anatomy::colours::{Rgb, of_kind};
use crate::render::anatomy::{Anatomy, NOTHING};
use crate::scene::Scene;
use crate::training::debrief::Debrief;
use crate::training::kinematic::Sample;
use crate::words::say;

/// Pixels along the longer edge.
const PIXELS: f64 = 360.0;
/// Colour where a scene tells no tissues apart.
const PLAIN: Rgb = [196, 140, 120];
/// Length of the needle that is drawn [m].
const NEEDLE: f64 = 30e-3;

/// A plane that contains z, and the part of it that lies in the block.
#[derive(Debug, Clone, Copy)]
struct Plane {
    origin: DVec3,
    right: DVec3,
    /// Corners in the plane [m].
    low: DVec2,
    high: DVec2,
}

impl Plane {
    /// Through the planned path; for one that is upright, through the way that was really taken where that leaves it.
    fn of(scene: &Scene, debrief: &Debrief) -> Plane {
        let flat = |way: DVec3| DVec3::new(way.x, way.y, 0.0);
        let taken = debrief.path.last().map_or(DVec3::ZERO, |s| s.direction);
        let leaning = [scene.motion.direction, taken].into_iter().map(flat).find(|way| way.length() > 0.05);
        let right = leaning.map_or(DVec3::X, DVec3::normalize);
        // Left and right as one who sees x to the right would have them.
        let right = if right.x < -1e-9 { -right } else { right };
        let origin = scene.motion.entry.with_z(0.0);
        let half = 0.5 * scene.tissue.size;
        // How far the plane reaches within the block to both sides.
        let reach = |way: DVec3| {
            let along =
                |d: f64, from: f64, half: f64| if d.abs() > 1e-9 { (half * d.signum() - from) / d } else { 1.0 };
            along(way.x, origin.x, half.x).min(along(way.y, origin.y, half.y)).max(1e-3)
        };
        let (left, right_end) = (-reach(-right), reach(right));
        let (bottom, top) = (-scene.tissue.size.z, scene.tissue.top);
        Plane { origin, right, low: DVec2::new(left, bottom), high: DVec2::new(right_end, top.max(1e-3)) }
    }

    fn at(&self, x: f64, z: f64) -> DVec3 {
        self.origin + self.right * x + DVec3::Z * z
    }

    /// Foot of a point [m].
    fn foot(&self, x: DVec3) -> DVec2 {
        DVec2::new((x - self.origin).dot(self.right), x.z)
    }
}

/// The slice, ready or not yet.
pub struct Section {
    plane: Plane,
    coming: Option<Receiver<ColorImage>>,
    texture: Option<egui::TextureHandle>,
    targets: Vec<(DVec3, f64)>,
}

impl Section {
    /// Begins to look for it.
    pub fn begin(scene: Arc<Scene>, debrief: &Debrief) -> Section {
        let plane = Plane::of(&scene, debrief);
        let targets = scene.targets.iter().map(|t| (t.position, t.radius)).collect();
        let (sender, coming) = channel();
        // Whoever closes the debriefing before it is ready wants it no more.
        std::thread::spawn(move || _ = sender.send(picture(&scene, &plane)));
        Section { plane, coming: Some(coming), texture: None, targets }
    }

    pub fn is_ready(&self) -> bool {
        self.coming.is_none()
    }

    /// Takes the picture once it is there.
    pub fn poll(&mut self, context: &egui::Context) {
        if let Some(image) = self.coming.as_ref().and_then(|coming| coming.try_recv().ok()) {
            self.texture = Some(context.load_texture("debrief section", image, egui::TextureOptions::NEAREST));
            self.coming = None;
        } else if self.coming.is_some() {
            context.request_repaint_after(std::time::Duration::from_millis(50));
        }
    }

    /// Draws it with both paths and the needle, so many points high.
    pub fn show(&self, ui: &mut egui::Ui, debrief: &Debrief, (now, height): (Option<Sample>, f32)) {
        ui.strong(say("debrief-section"));
        let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), egui::Sense::hover());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, say("debrief-section")));
        let painter = ui.painter_at(rect);
        painter.rect_filled(rect, 4.0, ui.visuals().extreme_bg_color);
        let size = self.plane.high - self.plane.low;
        let scale = (f64::from(rect.width()) / size.x).min(f64::from(rect.height()) / size.y);
        let drawn = Rect::from_center_size(rect.center(), vec2((size.x * scale) as f32, (size.y * scale) as f32));
        let see = |x: DVec3| -> Pos2 {
            let foot = self.plane.foot(x) - self.plane.low;
            drawn.left_bottom() + vec2((foot.x * scale) as f32, -(foot.y * scale) as f32)
        };
        if let Some(texture) = &self.texture {
            let whole = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            painter.image(texture.id(), drawn, whole, Color32::WHITE);
        }
        for (position, radius) in &self.targets {
            painter.circle_stroke(see(*position), (radius * scale).max(3.0) as f32, Stroke::new(2.0, TARGET));
        }
        if let Some(now) = now {
            let ends = [see(now.tip - now.direction * NEEDLE), see(now.tip)];
            // Dark with a light rim: it is seen on every tissue.
            painter.line_segment(ends, Stroke::new(3.5, Color32::WHITE));
            painter.line_segment(ends, Stroke::new(1.5, Color32::BLACK));
        }
        draw_reference(&painter, &debrief.reference, see);
        draw_path(&painter, &debrief.path, see);
    }
}

/// The tissue in the plane.
fn picture(scene: &Scene, plane: &Plane) -> ColorImage {
    let size = plane.high - plane.low;
    let pixel = size.max_element() / PIXELS;
    let [width, height] = [size.x, size.y].map(|edge| (edge / pixel).round().max(1.0) as usize);
    let anatomy = Anatomy::of_scene(scene);
    let [r, g, b] = of_kind("tissue").unwrap_or(PLAIN);
    let colour = |n: usize| {
        let (x, y) = (n % width, n / width);
        let at = plane.at(
            plane.low.x + (x as f64 + 0.5) * size.x / width as f64,
            plane.high.y - (y as f64 + 0.5) * size.y / height as f64,
        );
        match &anatomy {
            None if at.z <= 0.0 => Color32::from_rgb(r, g, b),
            None => Color32::TRANSPARENT,
            Some(anatomy) => match anatomy.part_at(at) {
                NOTHING => Color32::TRANSPARENT,
                part => {
                    let [r, g, b] = anatomy.parts()[part].colour;
                    Color32::from_rgb(r, g, b)
                }
            },
        }
    };
    let pixels: Vec<Color32> = (0..width * height).into_par_iter().map(colour).collect();
    ColorImage::new([width, height], pixels)
}
