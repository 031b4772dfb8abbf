//! A still picture in three dimensions of a scene with labels: the half behind the plane of the needle with bone, vessels and other
//! parts in natural colours, cut there; fat, muscle and skin are seen through, the needle and the targets.
//!
//! Drawn on the processor with a depth for every sample: what is solid first, then the nearest skin over it. Two by two samples per pixel.

use glam::{DVec2, DVec3};

use super::Image;
use super::anatomy::Anatomy;
use super::picture::encode_srgb;
use super::slice::Plane;
use super::stroke_font;
use super::surfaces::{self, Corner, Detail, Embedding, Layer, Triangle};
use crate::anatomy::Frame;
use crate::anatomy::colours::Rgb;
use crate::mesh::{BlockMesh, Mesh};
use crate::needle::{Tool, lateral_axes};
use crate::observables::FieldSnapshot;
use crate::scene::Scene;

/// Samples of a pixel along each axis.
const SAMPLES: usize = 2;
/// Width where the scene names none; height over width.
const DEFAULT_WIDTH: u32 = 900;
const HEIGHT: f64 = 0.9;
/// How much of the skin, and of fat, muscle and organs, is drawn over what lies behind them.
const SKIN: f32 = 0.32;
const ORGAN: f32 = 0.45;
/// The eye stands so far around the upward axis and above the horizon of the plane [rad].
const AROUND: f64 = 0.42;
const ABOVE: f64 = 0.38;
/// sRGB.
const BACKDROP: Rgb = [236, 240, 244];
const INK: Rgb = [28, 30, 36];
const STEEL: Rgb = [168, 174, 184];
const TARGET: Rgb = [0, 225, 190];

/// What is seen of a scene with labels in a block; none without.
pub fn draw(scene: &Scene, mesh: &Mesh, snapshot: &FieldSnapshot) -> Option<Image> {
    let (Some(case), Mesh::Block(block)) = (&scene.case, mesh) else { return None };
    let anatomy = Anatomy::of_scene(scene)?;
    let plane = Plane::of_scene(scene, mesh, snapshot);
    let mut seen = moved(scene, block, &anatomy, &plane, snapshot);
    let view = View::around(&seen, &plane, scene);
    add_tool(scene, snapshot, &view, &mut seen);
    let mut canvas = Canvas::new(view.size);
    for layer in [Layer::Solid, Layer::Organ, Layer::Skin] {
        let of_layer = seen.iter().filter(|triangle| triangle.layer == layer);
        match layer {
            Layer::Solid => of_layer.for_each(|triangle| canvas.solid(&view, triangle)),
            Layer::Organ => canvas.veil(&view, of_layer, ORGAN),
            Layer::Skin => canvas.veil(&view, of_layer, SKIN),
        }
    }
    let title = if scene.title.is_empty() { &scene.name } else { &scene.title };
    let unit = f64::from(view.size.0) / f64::from(DEFAULT_WIDTH);
    let capital = 15.0 * unit;
    let room = f64::from(view.size.0) - 32.0 * unit;
    canvas.text(&stroke_font::shortened(title, capital, room), DVec2::new(16.0, 35.0) * unit, capital);
    canvas.axes(&view, &case.frame, unit);
    Some(canvas.image(view.size))
}

/// Triangles at their places in the deformed tissue, cut at the plane.
fn moved(
    scene: &Scene,
    block: &BlockMesh,
    anatomy: &Anatomy,
    plane: &Plane,
    snapshot: &FieldSnapshot,
) -> Vec<Triangle> {
    // The half towards the viewer is taken away; a little behind the axis, so that the needle stands before the cut.
    let offset = plane.normal.dot(plane.origin) - 1e-6;
    let mut all = surfaces::cut(&surfaces::surfaces(scene, block, anatomy, &Detail::FULL), plane.normal, offset);
    surfaces::face(block, (plane.normal, offset), (true, &Detail::FULL), anatomy, &mut all);
    let embedding = Embedding::new(block, anatomy);
    for corner in all.iter_mut().flat_map(|triangle| &mut triangle.corners) {
        corner.place = embedding.moved(corner.place, &snapshot.displacement);
    }
    all.retain(|triangle| triangle.corners.iter().all(|corner| corner.place.is_finite()));
    all
}

/// Where the eye stands, and how the world comes onto the picture.
struct View {
    /// [px]
    size: (u32, u32),
    right: DVec3,
    up: DVec3,
    towards: DVec3,
    centre: DVec3,
    /// [px/m]
    scale: f64,
}

impl View {
    fn around(seen: &[Triangle], plane: &Plane, scene: &Scene) -> Self {
        let width = match scene.outputs.picture_width {
            0 => DEFAULT_WIDTH,
            width => width.clamp(320, 4096),
        };
        let size = (width, (HEIGHT * f64::from(width)) as u32);
        let (sin, cos) = AROUND.sin_cos();
        let level = plane.normal * cos + plane.right * sin;
        let towards = level * ABOVE.cos() + plane.up * ABOVE.sin();
        let right = plane.up.cross(level).normalize();
        let up = towards.cross(right);
        let mut view = View { size, right, up, towards, centre: DVec3::ZERO, scale: 1.0 };
        let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        for corner in seen.iter().flat_map(|triangle| &triangle.corners) {
            let at = DVec2::new(corner.place.dot(right), corner.place.dot(up));
            (low, high) = (low.min(at), high.max(at));
        }
        if low.x < high.x {
            // Room above for the needle.
            let room = DVec2::new(0.08, 0.1) * (high - low).max_element();
            (low, high) = (low - room, high + DVec2::new(room.x, 2.0 * room.y));
            let middle = 0.5 * (low + high);
            view.centre = right * middle.x + up * middle.y;
            view.scale = (f64::from(size.0) / (high.x - low.x)).min(f64::from(size.1) / (high.y - low.y));
        }
        view
    }

    /// In samples from the upper left corner, and depth towards the eye [m].
    fn place(&self, x: DVec3) -> DVec3 {
        let p = x - self.centre;
        let scale = self.scale * SAMPLES as f64;
        let middle = 0.5 * SAMPLES as f64 * DVec2::new(f64::from(self.size.0), f64::from(self.size.1));
        DVec3::new(middle.x + p.dot(self.right) * scale, middle.y - p.dot(self.up) * scale, x.dot(self.towards))
    }

    /// Light from the eye and a little from above on a face, whichever side it shows; linear.
    fn lit(&self, normal: DVec3, colour: Rgb) -> [f32; 3] {
        let light = 0.58 + 0.36 * normal.dot(self.towards).abs() + 0.08 * normal.dot(self.up);
        colour.map(|byte| linear((f64::from(byte) * light).clamp(0.0, 255.0) / 255.0))
    }
}

fn linear(part: f64) -> f32 {
    (if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }) as f32
}

/// The needle and the targets as triangles.
fn add_tool(scene: &Scene, snapshot: &FieldSnapshot, view: &View, out: &mut Vec<Triangle>) {
    const AROUND_SHAFT: usize = 28;
    if let (Some(Tool::Needle(needle)), Some((tip, direction))) = (&scene.tool, snapshot.tool_pose)
        && tip.is_finite()
    {
        let (first, second) = lateral_axes(direction);
        let length = 2.0 * f64::from(view.size.1) / view.scale;
        let steps = (1..=40).map(|n| needle.tip_length + (length - needle.tip_length) * f64::from(n) / 40.0);
        let stations: Vec<f64> = [0.0, needle.tip_length].into_iter().chain(steps).collect();
        let corner = |s: f64, n: usize| {
            let normal = DVec2::from_angle(std::f64::consts::TAU * n as f64 / AROUND_SHAFT as f64);
            let normal = first * normal.x + second * normal.y;
            let bend = snapshot.centre_line.map_or(DVec3::ZERO, |line| line.at(s, 0.0).offset);
            let radius = needle.radius * (s / needle.tip_length.max(1e-9)).min(1.0);
            Corner { place: tip - direction * s + bend + normal * radius, normal }
        };
        for ends in stations.windows(2) {
            for n in 0..AROUND_SHAFT {
                let [a, b] = [n, n + 1].map(|n| [corner(ends[0], n), corner(ends[1], n)]);
                for corners in [[a[0], b[0], b[1]], [a[0], b[1], a[1]]] {
                    out.push(Triangle { corners, colour: STEEL, layer: Layer::Solid });
                }
            }
        }
    }
    for (target, place) in scene.targets.iter().zip(&snapshot.targets).filter(|(_, place)| place.is_finite()) {
        const RINGS: usize = 12;
        let corner = |ring: usize, n: usize| {
            let polar = std::f64::consts::PI * ring as f64 / RINGS as f64;
            let flat = DVec2::from_angle(std::f64::consts::TAU * n as f64 / (2 * RINGS) as f64) * polar.sin();
            let normal = flat.extend(polar.cos());
            Corner { place: *place + normal * target.radius, normal }
        };
        for ring in 0..RINGS {
            for n in 0..2 * RINGS {
                let [a, b] = [corner(ring, n), corner(ring, n + 1)];
                let [c, d] = [corner(ring + 1, n + 1), corner(ring + 1, n)];
                for corners in [[a, b, c], [a, c, d]] {
                    out.push(Triangle { corners, colour: TARGET, layer: Layer::Solid });
                }
            }
        }
    }
}

/// Colour and depth of every sample.
struct Canvas {
    width: usize,
    colours: Vec<[f32; 3]>,
    depths: Vec<f64>,
}

impl Canvas {
    fn new((width, height): (u32, u32)) -> Self {
        let width = width as usize * SAMPLES;
        let count = width * height as usize * SAMPLES;
        let backdrop = BACKDROP.map(|byte| linear(f64::from(byte) / 255.0));
        Canvas { width, colours: vec![backdrop; count], depths: vec![f64::NEG_INFINITY; count] }
    }

    /// Calls `each` with every sample of a triangle: its index, depth and normal.
    fn cover(&self, view: &View, triangle: &Triangle, mut each: impl FnMut(usize, f64, DVec3)) {
        let height = self.depths.len() / self.width;
        let [a, b, c] = triangle.corners.map(|corner| view.place(corner.place));
        let whole = (b - a).truncate().perp_dot((c - a).truncate());
        if whole.abs() < 1e-9 {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let range = |low: f64, high: f64, count: usize| {
            (low - 0.5).ceil().max(0.0) as usize..((high - 0.5).floor() + 1.0).clamp(0.0, count as f64) as usize
        };
        for y in range(low.y, high.y, height) {
            for x in range(low.x, high.x, self.width) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let share = |from: DVec3, to: DVec3| (to - from).truncate().perp_dot(p - from.truncate()) / whole;
                let (of_c, of_a, of_b) = (share(a, b), share(b, c), share(c, a));
                if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 {
                    let [na, nb, nc] = triangle.corners.map(|corner| corner.normal);
                    let normal = (na * of_a + nb * of_b + nc * of_c).normalize_or(na);
                    each(y * self.width + x, of_a * a.z + of_b * b.z + of_c * c.z, normal);
                }
            }
        }
    }

    fn solid(&mut self, view: &View, triangle: &Triangle) {
        let mut found = Vec::new();
        self.cover(view, triangle, |at, depth, normal| found.push((at, depth, normal)));
        for (at, depth, normal) in found {
            if depth > self.depths[at] {
                self.depths[at] = depth;
                self.colours[at] = view.lit(normal, triangle.colour);
            }
        }
    }

    /// The nearest of triangles that are seen through, `part` of it over what lies behind.
    fn veil<'a>(&mut self, view: &View, triangles: impl Iterator<Item = &'a Triangle>, part: f32) {
        let mut nearest: Vec<(f64, [f32; 3])> = vec![(f64::NEG_INFINITY, [0.0; 3]); self.depths.len()];
        for triangle in triangles {
            self.cover(view, triangle, |at, depth, normal| {
                if depth > nearest[at].0 {
                    nearest[at] = (depth, view.lit(normal, triangle.colour));
                }
            });
        }
        for (at, (depth, colour)) in nearest.into_iter().enumerate() {
            if depth > self.depths[at] {
                for (own, over) in self.colours[at].iter_mut().zip(colour) {
                    *own += part * (over - *own);
                }
            }
        }
    }

    /// A line with round ends [px].
    fn line(&mut self, ends: [DVec2; 2], width: f64) {
        let samples = SAMPLES as f64;
        let [a, b] = ends.map(|end| end * samples);
        let reach = 0.5 * width * samples;
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        let ink = INK.map(|byte| linear(f64::from(byte) / 255.0));
        let height = self.depths.len() / self.width;
        for y in low.y.max(0.0) as usize..(high.y.max(0.0) as usize + 1).min(height) {
            for x in low.x.max(0.0) as usize..(high.x.max(0.0) as usize + 1).min(self.width) {
                let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let along = ((p - a).dot(b - a) / (b - a).length_squared().max(1e-12)).clamp(0.0, 1.0);
                if p.distance(a.lerp(b, along)) <= reach {
                    self.colours[y * self.width + x] = ink;
                }
            }
        }
    }

    /// A line of text; `origin` is the left end of its baseline [px].
    fn text(&mut self, text: &str, origin: DVec2, capital: f64) {
        for ends in stroke_font::segments(text, origin, capital) {
            self.line(ends, stroke_font::stroke_width(capital));
        }
    }

    /// Arrows to the patient's right, front and head in the lower left corner.
    fn axes(&mut self, view: &View, frame: &Frame, unit: f64) {
        let origin = DVec2::new(70.0 * unit, f64::from(view.size.1) - 70.0 * unit);
        for (axis, letter) in DVec3::AXES.into_iter().zip(["R", "A", "S"]) {
            let way = frame.axes.transpose() * axis;
            let way = DVec2::new(way.dot(view.right), -way.dot(view.up));
            let end = origin + way * 38.0 * unit;
            self.line([origin, end], 2.5 * unit);
            let capital = 12.0 * unit;
            let half = DVec2::new(-0.5 * stroke_font::width(letter, capital), 0.5 * capital);
            // One that points at the viewer has its letter beside the origin.
            let out = way.normalize_or(DVec2::new(-1.0, 1.0)) * 14.0 * unit;
            self.text(letter, end + out + half, capital);
        }
    }

    fn image(&self, (width, height): (u32, u32)) -> Image {
        let mut rgba = Vec::with_capacity(4 * (width * height) as usize);
        for y in 0..height as usize {
            for x in 0..width as usize {
                let sum = |channel: usize| {
                    let row = |n: usize| (SAMPLES * y + n) * self.width + SAMPLES * x;
                    let of_row = |n: usize| (0..SAMPLES).map(|m| self.colours[row(n) + m][channel]).sum::<f32>();
                    (0..SAMPLES).map(of_row).sum::<f32>() / (SAMPLES * SAMPLES) as f32
                };
                rgba.extend([encode_srgb(sum(0)), encode_srgb(sum(1)), encode_srgb(sum(2)), 255]);
            }
        }
        Image { width, height, rgba }
    }
}
