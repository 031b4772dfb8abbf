//! Three slices through a label map in the colours of its labels, with the line of the needle.
//!
//! Radiological order: seen from the feet, from the front and from the left, so that the right of the patient is on the left of the
//! axial and the coronal picture.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};

use super::line::{Course, shown};
use super::text;
use crate::anatomy::LabelMap;
use crate::anatomy::write_nrrd::colour;
use crate::error::{Error, Result};
use crate::render::picture::Vertex;
use crate::render::raster::render_on_processor;
use crate::render::{Picture, stroke_font, write_png};

/// Largest side of a slice, width of the column of names, and margins [px].
const SIDE: f64 = 760.0;
const NAMES: f64 = 300.0;
const MARGIN: f64 = 16.0;
const TOP: f64 = 46.0;
/// Height of capital letters [px].
const CAPITAL: f64 = 12.0;
/// Most names.
const MOST_NAMES: usize = 34;

const PAGE: [u8; 3] = [252, 252, 251];
const AIR: [u8; 3] = [222, 230, 237];
const INK: [u8; 3] = [28, 30, 36];
const NEEDLE: [u8; 3] = [215, 20, 20];

/// A slice: the axis that it is cut across, and those that run to the right and upwards in the picture.
struct View {
    name: &'static str,
    across: DVec3,
    right: DVec3,
    up: DVec3,
}

const VIEWS: [View; 3] = [
    View { name: "axial", across: DVec3::Z, right: DVec3::NEG_X, up: DVec3::Y },
    View { name: "sagittal", across: DVec3::X, right: DVec3::NEG_Y, up: DVec3::Z },
    View { name: "coronal", across: DVec3::Y, right: DVec3::NEG_X, up: DVec3::Z },
];

/// Writes the three pictures into a folder; their paths.
///
/// # Errors
/// Where there is no label, or a picture cannot be written.
pub fn draw(folder: &Path, map: &LabelMap, course: Option<&Course>) -> Result<Vec<PathBuf>> {
    let Some((low, high)) = map.bounds() else {
        return Err(Error::input("no voxel has a label but 0: nothing to draw", "segment the tissue first"));
    };
    std::fs::create_dir_all(folder).map_err(|source| Error::file(folder, source))?;
    let through = course.map_or(0.5 * (low + high), |course| 0.5 * (course.line.entry + course.line.target));
    let mut written = Vec::new();
    for view in &VIEWS {
        let path = folder.join(format!("{}.png", view.name));
        let picture = compose(view, map, (low, high), through, course);
        write_png(&path, &render_on_processor(&picture), picture.width, picture.height)?;
        written.push(path);
    }
    Ok(written)
}

fn compose(
    view: &View,
    map: &LabelMap,
    (low, high): (DVec3, DVec3),
    through: DVec3,
    course: Option<&Course>,
) -> Picture {
    // A little air around everything, and the whole line.
    let (mut low, mut high) = (low, high);
    for x in course.iter().flat_map(|course| [course.line.entry, course.line.target]) {
        (low, high) = (low.min(x), high.max(x));
    }
    let room = 0.02 * (high - low).max_element();
    let flat = |x: DVec3| DVec2::new(x.dot(view.right), x.dot(view.up));
    let (a, b) = (flat(low - room), flat(high + room));
    let (from, to) = (a.min(b), a.max(b));
    let scale = SIDE / (to - from).max_element();
    let size = (to - from) * scale;
    let (columns, rows) = (size.x.ceil().max(1.0) as usize, size.y.ceil().max(1.0) as usize);
    let mut canvas = Canvas::default();
    canvas.rectangle([MARGIN, TOP], [columns as f64, rows as f64], AIR);
    let at = |column: usize, row: usize| {
        let flat = DVec2::new(from.x + (column as f64 + 0.5) / scale, to.y - (row as f64 + 0.5) / scale);
        view.right * flat.x + view.up * flat.y + view.across * through.dot(view.across)
    };
    let found = paint(&mut canvas, map, [columns, rows], at);
    let pixel = |x: DVec3| {
        let at = flat(x);
        DVec2::new(MARGIN + (at.x - from.x) * scale, TOP + (to.y - at.y) * scale)
    };
    if let Some(course) = course {
        let [entry, target] = [course.line.entry, course.line.target].map(pixel);
        canvas.line([entry, target], 5.0, [255, 255, 255]);
        canvas.line([entry, target], 2.5, NEEDLE);
        canvas.line([target - DVec2::X * 6.0, target + DVec2::X * 6.0], 2.0, INK);
        canvas.line([target - DVec2::Y * 6.0, target + DVec2::Y * 6.0], 2.0, INK);
    }
    let (w, h) = (columns as f64, rows as f64);
    directions(&mut canvas, view, [w, h]);
    let axis =
        ["x", "y", "z"][[view.across.x, view.across.y, view.across.z].iter().position(|c| *c != 0.0).unwrap_or(0)];
    let title = format!("{}, through {axis} = {:.1} mm RAS", view.name, through.dot(view.across) * 1e3 + 0.0);
    canvas.text(&title, [MARGIN, 30.0], CAPITAL * 1.2);
    let height = names(&mut canvas, map, &found, MARGIN + w + 18.0).max(TOP + h + 40.0);
    scale_bar(&mut canvas, scale, TOP + h + 24.0);
    if let Some(course) = course {
        let text = format!("({}) to ({})", shown(course.line.entry), shown(course.line.target));
        canvas.text(&text, [MARGIN + 220.0, TOP + h + 28.0], CAPITAL * 0.8);
    }
    Picture {
        width: (MARGIN + w + NAMES).max(560.0) as u32,
        height: height as u32,
        background: linear(PAGE),
        colour_table: [[0.0; 4]; 256],
        vertices: canvas.vertices,
    }
}

/// Draws the labels of a slice, whose pixels lie at `at`; how many pixels each has.
fn paint(
    canvas: &mut Canvas,
    map: &LabelMap,
    [columns, rows]: [usize; 2],
    at: impl Fn(usize, usize) -> DVec3,
) -> BTreeMap<u16, usize> {
    let sampler = map.sampler();
    let mut found = BTreeMap::<u16, usize>::new();
    for row in 0..rows {
        // Where the label of the present pixels began.
        let mut run = (0, 0_u16);
        for column in 0..=columns {
            let label = if column == columns { 0 } else { sampler.label_at(at(column, row)) };
            if column < columns && label == run.1 {
                continue;
            }
            if run.1 != 0 {
                *found.entry(run.1).or_default() += column - run.0;
                let corner = [MARGIN + run.0 as f64, TOP + row as f64];
                canvas.rectangle(corner, [(column - run.0) as f64, 1.0], colour(run.1));
            }
            run = (column, label);
        }
    }
    found
}

/// The letters of the patient's directions at the sides of a slice of this size [px].
fn directions(canvas: &mut Canvas, view: &View, [w, h]: [f64; 2]) {
    let letters = |axis: DVec3| -> [&str; 2] {
        let ends = [["L", "R"], ["P", "A"], ["I", "S"]];
        let n = (0..3).max_by(|a, b| axis[*a].abs().total_cmp(&axis[*b].abs())).unwrap_or(0);
        if axis[n] > 0.0 { ends[n] } else { [ends[n][1], ends[n][0]] }
    };
    let ([left, right], [down, up]) = (letters(view.right), letters(view.up));
    for (letter, x, y) in [
        (left, MARGIN + 5.0, TOP + 0.5 * h),
        (right, MARGIN + w - 15.0, TOP + 0.5 * h),
        (up, MARGIN + 0.5 * w, TOP + 18.0),
        (down, MARGIN + 0.5 * w, TOP + h - 6.0),
    ] {
        canvas.text(letter, [x, y], CAPITAL);
    }
}

/// The names of the labels of a slice, the largest first; the height that they need.
fn names(canvas: &mut Canvas, map: &LabelMap, found: &BTreeMap<u16, usize>, left: f64) -> f64 {
    let mut order: Vec<(&u16, &usize)> = found.iter().collect();
    order.sort_by_key(|(label, count)| (std::cmp::Reverse(**count), **label));
    let mut y = TOP + CAPITAL;
    for (label, _) in order.iter().take(MOST_NAMES) {
        canvas.rectangle([left, y - CAPITAL], [16.0, CAPITAL + 2.0], colour(**label));
        let name = map.names.get(label).map_or(format!("label {label}"), |name| text::name(name, 60));
        canvas.text(&stroke_font::shortened(&name, CAPITAL, NAMES - 60.0), [left + 24.0, y], CAPITAL);
        y += CAPITAL + 11.0;
    }
    if order.len() > MOST_NAMES {
        canvas.text(&format!("and {} more", order.len() - MOST_NAMES), [left + 24.0, y], CAPITAL);
        y += CAPITAL + 11.0;
    }
    y + 20.0
}

/// A length that is about 100 px, with its number.
fn scale_bar(canvas: &mut Canvas, scale: f64, y: f64) {
    let wanted = 110.0 / scale * 1e3;
    let power = 10f64.powf(wanted.log10().floor());
    let mm = [5.0, 2.0, 1.0].into_iter().map(|digit| digit * power).find(|mm| *mm <= wanted).unwrap_or(power);
    let length = mm * 1e-3 * scale;
    canvas.rectangle([MARGIN, y], [length, 3.0], INK);
    canvas.text(&format!("{} mm", (mm * 1e6).round() / 1e6), [MARGIN + length + 10.0, y + 5.0], CAPITAL);
}

/// Triangles of one colour each.
#[derive(Default)]
struct Canvas {
    vertices: Vec<Vertex>,
}

impl Canvas {
    fn quad(&mut self, corners: [DVec2; 4], colour: [u8; 3]) {
        let colour = linear(colour);
        for n in [0, 1, 2, 0, 2, 3] {
            let position = [corners[n].x as f32, corners[n].y as f32];
            self.vertices.push(Vertex { position, field_value: 0.0, field_weight: 0.0, colour });
        }
    }

    fn rectangle(&mut self, [x, y]: [f64; 2], [w, h]: [f64; 2], colour: [u8; 3]) {
        let corner = |dx: f64, dy: f64| DVec2::new(x + dx, y + dy);
        self.quad([corner(0.0, 0.0), corner(w, 0.0), corner(w, h), corner(0.0, h)], colour);
    }

    /// A line with square ends.
    fn line(&mut self, [a, b]: [DVec2; 2], width: f64, colour: [u8; 3]) {
        let along = (b - a).normalize_or(DVec2::X) * 0.5 * width;
        let side = along.perp();
        let (a, b) = (a - along, b + along);
        self.quad([a - side, b - side, b + side, a + side], colour);
    }

    fn text(&mut self, text: &str, origin: [f64; 2], capital: f64) {
        let width = stroke_font::stroke_width(capital);
        for ends in stroke_font::segments(text, DVec2::from(origin), capital) {
            self.line(ends, width, INK);
        }
    }
}

/// sRGB bytes to linear light (IEC 61966-2-1), opaque.
fn linear(colour: [u8; 3]) -> [f32; 4] {
    let [r, g, b] = colour.map(|byte| {
        let c = f32::from(byte) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    });
    [r, g, b, 1.0]
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::render::Image;

    /// Label 1 to the right of the patient, 2 to the left.
    #[test]
    fn the_right_of_the_patient_is_on_the_left_of_the_picture() {
        let labels = (0..1000).map(|n| if n % 10 < 5 { 2 } else { 1 }).collect();
        let map = LabelMap {
            size: [10; 3],
            steps: DMat3::from_diagonal(DVec3::splat(1e-3)),
            origin: DVec3::ZERO,
            labels,
            names: BTreeMap::new(),
        };
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(draw(folder.path(), &map, None).unwrap().len(), 3);
        let picture = compose(&VIEWS[0], &map, map.bounds().unwrap(), DVec3::splat(5e-3), None);
        let image = Image { width: picture.width, height: picture.height, rgba: render_on_processor(&picture) };
        let at = |part: f64| image.pixel((MARGIN + part * SIDE) as u32, (TOP + 0.3 * SIDE) as u32);
        assert_eq!(at(0.25)[..3], colour(1));
        assert_eq!(at(0.75)[..3], colour(2));
    }
}
