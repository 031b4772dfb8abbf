//! What is written over the view: a ruler, the axes in words of the patient, names of the parts, and how far the tip is from its target.

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Stroke, Vec2};
use glam::{DVec3, Vec3};

use super::camera::Camera;
use crate::anatomy::Frame;
use crate::training::scene_words;
use crate::words::say;

/// Length of the ruler on the screen, at least and at most [points].
const RULER: [f32; 2] = [70.0, 175.0];
/// Room between the edge of the view and what stands in it [points].
const MARGIN: f32 = 14.0;
/// Length of an axis on the screen [points].
const AXIS: f32 = 34.0;

const INK: Color32 = Color32::from_rgb(240, 242, 245);
const SHADOW: Color32 = Color32::from_rgba_premultiplied(0, 0, 0, 170);

/// The view that is written over.
pub struct Overlay<'a> {
    pub painter: &'a Painter,
    pub area: Rect,
    pub camera: &'a Camera,
}

impl Overlay<'_> {
    /// Where a point [m] is seen; `None` behind the eye and beside the view.
    fn seen(&self, x: DVec3) -> Option<Pos2> {
        let aspect = self.area.width() / self.area.height().max(1.0);
        let clip = self.camera.view_projection(aspect) * x.as_vec3().extend(1.0);
        if clip.w <= 0.0 {
            return None;
        }
        let (x, y) = (clip.x / clip.w, clip.y / clip.w);
        let at = self.area.min + Vec2::new(0.5 * (x + 1.0), 0.5 * (1.0 - y)) * self.area.size();
        self.area.contains(at).then_some(at)
    }

    /// A text that is read on light and on dark ground; where it stands.
    fn write(&self, at: Pos2, align: Align2, text: &str) -> Rect {
        let font = FontId::proportional(13.0);
        for way in [Vec2::new(1.0, 1.0), Vec2::new(-1.0, 1.0), Vec2::new(1.0, -1.0), Vec2::new(-1.0, -1.0)] {
            self.painter.text(at + way, align, text, font.clone(), SHADOW);
        }
        self.painter.text(at, align, text, font, INK)
    }

    fn line(&self, from: Pos2, to: Pos2) {
        self.painter.line_segment([from, to], Stroke::new(4.0, SHADOW));
        self.painter.line_segment([from, to], Stroke::new(1.8, INK));
    }

    /// A length of 1, 2 or 5 times a power of ten, as it is seen at the middle of the view.
    pub fn ruler(&self) {
        let centre = self.camera.centre.as_dvec3();
        let [right, _] = self.camera.level();
        let step = 1e-3;
        let (Some(a), Some(b)) = (self.seen(centre), self.seen(centre + right.as_dvec3() * step)) else { return };
        let per_metre = f64::from(a.distance(b)) / step;
        let Some(length) = ruler_length(per_metre) else { return };
        let width = (length * per_metre) as f32;
        let left = self.area.left_bottom() + Vec2::new(MARGIN, -MARGIN);
        let end = left + Vec2::new(width, 0.0);
        self.line(left, end);
        for at in [left, end] {
            self.line(at, at - Vec2::new(0.0, 7.0));
        }
        let text = format!("{} mm", crate::units::number(length * 1e3));
        self.write(left + Vec2::new(0.5 * width, -8.0), Align2::CENTER_BOTTOM, &text);
    }

    /// The axes of the patient, or of the scene where there is no patient.
    pub fn axes(&self, frame: Option<&Frame>) {
        let names = match frame {
            Some(_) => [say("axis-right"), say("axis-front"), say("axis-head")],
            None => ["x", "y", "z"],
        };
        let corner = self.area.right_bottom() - Vec2::splat(MARGIN + AXIS + 12.0);
        let away = (self.camera.centre - self.camera.eye()).normalize();
        let right = away.cross(Vec3::Z).normalize();
        let up = right.cross(away);
        for (axis, name) in DVec3::AXES.into_iter().zip(names) {
            // In RAS the first axis runs to the patient's right.
            let way = frame.map_or(axis, |frame| frame.axes.transpose() * axis).as_vec3();
            let on_screen = Vec2::new(way.dot(right), -way.dot(up)) * AXIS;
            // Seen from its end it has no length and no name.
            if on_screen.length() < 0.25 * AXIS {
                continue;
            }
            self.line(corner, corner + on_screen);
            self.write(corner + on_screen * 1.3, Align2::CENTER_CENTER, name);
        }
    }

    /// Names at points of their parts, the nearer ones to the eye first; a name that would cover another is left out.
    pub fn names(&self, anchors: &[(String, DVec3)]) {
        let eye = self.camera.eye().as_dvec3();
        let mut order: Vec<&(String, DVec3)> = anchors.iter().collect();
        order.sort_by(|a, b| a.1.distance(eye).total_cmp(&b.1.distance(eye)));
        let mut taken: Vec<Rect> = Vec::new();
        for (name, x) in order {
            let name = scene_words::name(name);
            let Some(at) = self.seen(*x) else { continue };
            let size = Vec2::new(7.0 * name.chars().count() as f32, 16.0);
            let room = Rect::from_center_size(at, size);
            if taken.iter().any(|other| other.intersects(room)) || !self.area.contains_rect(room) {
                continue;
            }
            taken.push(self.write(at, Align2::CENTER_CENTER, name));
        }
    }

    /// How the tip stands to its target, or whatever else is known now, in the upper left corner.
    pub fn lines(&self, lines: &[String]) {
        let mut at = self.area.left_top() + Vec2::splat(MARGIN);
        for line in lines {
            at.y = self.write(at, Align2::LEFT_TOP, line).bottom() + 2.0;
        }
    }
}

/// The length of a ruler [m] on a screen with so many points per metre; `None` where none fits.
fn ruler_length(per_metre: f64) -> Option<f64> {
    (-5..2).flat_map(|power| [1.0, 2.0, 5.0].map(|n| n * 10f64.powi(power))).find(|length| {
        let width = (length * per_metre) as f32;
        (RULER[0]..=RULER[1]).contains(&width)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ruler_is_a_round_length_that_fits() {
        for per_metre in [800.0, 5e3, 12e3, 33e3, 90e3, 4e5] {
            let length = ruler_length(per_metre).unwrap();
            let width = (length * per_metre) as f32;
            assert!((RULER[0]..=RULER[1]).contains(&width), "{width}");
            let digits = length / 10f64.powf(length.log10().floor() + 1e-9);
            assert!([1.0, 2.0, 5.0].iter().any(|n| (digits / n - 1.0).abs() < 1e-6), "{length}");
        }
    }
}
