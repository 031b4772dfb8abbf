//! The picture that shows what is there: parts of the tissue in natural colours with their names, the needle and the axes of the patient.
//!
//! ```text
//! title
//! +--------------A--------------+  1 [] skin
//! |          tool               |  2 [] fat
//! R    1 ~~~~||~~~~~~~          L  3 [] muscle
//! |    2     \/                 |
//! +--------------P--------------+  R right  L left
//! depth, force, time     scale bar
//! ```

use glam::{DVec2, DVec3};

use super::super::anatomy::{Anatomy, NOTHING, Part};
use super::super::slice::{Plane, SliceTriangle};
use super::super::stroke_font;
use super::labelled::{self, paint_parts};
use super::numbers::Areas;
use super::tool::ToolDrawing;
use super::{AIR, Canvas, Colour, INK, Layout, OPENED, PAGE, Picture, Rectangle, TARGET, WHITE};
use crate::anatomy::Frame;
use crate::mesh::Mesh;
use crate::observables::FieldSnapshot;
use crate::scene::Scene;

/// Width of the column with the names, in a picture of the width of the design [px].
const COLUMN: std::ops::RangeInclusive<f64> = 170.0..=320.0;
/// Largest distance between two names.
const ROW: f64 = 27.0;
const CAPITAL: f64 = 10.5;
/// Share of the natural colour where the tip has opened the tissue.
const OPENED_SHARE: f32 = 0.45;
/// Axes of the patient, RAS: letter and word to either side.
const AXES: [[(&str, &str); 2]; 3] =
    [[("R", "right"), ("L", "left")], [("A", "front"), ("P", "back")], [("S", "head"), ("I", "feet")]];
/// Cosine above which a direction has a letter.
const LEANS: f64 = 0.38;

/// A picture and the names that stand beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct AnatomyPicture {
    /// To be drawn as any other.
    pub picture: Picture,
    /// Names of the parts that are seen, in the order of the legend.
    pub names: Vec<String>,
}

impl AnatomyPicture {
    /// Composes the picture of one moment; none for a scene without labels and regions.
    pub fn compose(scene: &Scene, mesh: &Mesh, snapshot: &FieldSnapshot) -> Option<Self> {
        let anatomy = Anatomy::of_scene(scene)?;
        let plane = Plane::of_scene(scene, mesh, snapshot);
        let slice = labelled::cut(&anatomy, mesh, snapshot, &plane, scene);
        let longest = anatomy.parts().iter().map(|part| stroke_font::width(&part.name, CAPITAL)).fold(0.0, f64::max);
        let column = (longest + 90.0).clamp(*COLUMN.start(), *COLUMN.end());
        let layout = Layout::new(scene, mesh, &plane, &slice, column);
        let tool = ToolDrawing::new(scene, snapshot, &plane);

        let mut canvas = Canvas::default();
        canvas.rectangle(layout.plot, AIR);
        let mut areas = Areas::new(&layout);
        let mut is_opened = false;
        let mut paint = |t: &SliceTriangle, part: usize, _: [DVec3; 3], at: [DVec2; 3]| {
            let colour = colour_of(&anatomy.parts()[part]).linear(1.0);
            let pale = OPENED.linear(1.0);
            let opened = std::array::from_fn(|n| pale[n] + OPENED_SHARE * (colour[n] - pale[n]));
            is_opened |= t.opened;
            canvas.triangle(at, if t.opened { opened } else { colour });
            areas.fill(part, at);
        };
        let boundaries = paint_parts(&layout, (&slice, &plane), &anatomy, &mut paint);
        for boundary in &boundaries {
            let of_air = boundary.parts.contains(&NOTHING);
            let (width, colour) = if of_air { (2.0, INK.linear(1.0)) } else { (1.2, INK.linear(0.55)) };
            canvas.line(boundary.ends, width * layout.unit, colour);
        }
        labelled::draw_edges(&mut canvas, &layout, &slice, &anatomy, [0.0; 4]);
        if let Some(tool) = &tool {
            tool.draw(&mut canvas, &layout);
        }
        // Numbers stand beside targets.
        let marked: Vec<(DVec2, f64)> = scene
            .targets
            .iter()
            .zip(&snapshot.targets)
            .map(|(target, place)| {
                let radius = target.radius * layout.pixels_per_metre;
                (layout.place(plane.project(*place)), radius.max(5.0 * layout.unit) + 3.0 * layout.unit)
            })
            .collect();
        let seen: Vec<usize> = (1..anatomy.parts().len()).filter(|part| areas.holds(*part)).collect();
        areas.cover(|point| {
            marked.iter().any(|(centre, radius)| centre.distance(point) < *radius)
                || tool.as_ref().is_some_and(|tool| tool.covers(layout.unplace(point)))
        });
        draw_numbers(&mut canvas, &layout, &anatomy, &seen, &areas);
        for (target, place) in scene.targets.iter().zip(&snapshot.targets) {
            super::draw_target(&mut canvas, &layout, &plane, *place, target.radius);
        }
        super::draw_frame(&mut canvas, &layout);
        super::draw_texts(&mut canvas, &layout, scene, snapshot, (&plane, &slice));
        let words = match &scene.case {
            Some(case) => draw_axes(&mut canvas, &layout, &plane, &case.frame, tool.as_ref()),
            None => Vec::new(),
        };
        let legend = Legend { anatomy: &anatomy, seen: &seen, scene, is_opened, words: &words };
        legend.draw(&mut canvas, &layout);
        let names = seen.iter().map(|part| anatomy.parts()[*part].name.clone()).collect();
        Some(AnatomyPicture { picture: Picture::of(&layout, canvas), names })
    }
}

fn colour_of(part: &Part) -> Colour {
    let [r, g, b] = part.colour;
    Colour(r, g, b)
}

/// The number of every part in each of its areas that has room for it.
fn draw_numbers(canvas: &mut Canvas, layout: &Layout, anatomy: &Anatomy, seen: &[usize], areas: &Areas) {
    for (number, part) in (1..).zip(seen) {
        let text = format!("{number}");
        for (centre, room) in areas.middles(*part) {
            let capital = (0.9 * room / layout.unit).min(CAPITAL) * layout.unit;
            if capital < 5.5 * layout.unit {
                continue;
            }
            let [r, g, b] = anatomy.parts()[*part].colour.map(f64::from);
            let is_light = 0.3 * r + 0.6 * g + 0.1 * b > 135.0;
            let origin = centre + DVec2::new(-0.5 * stroke_font::width(&text, capital), 0.5 * capital);
            canvas.text(&text, origin, capital, if is_light { INK } else { WHITE });
        }
    }
}

/// Letters of a direction of the picture in the patient, the nearest axis first.
fn letters(frame: &Frame, direction: DVec3) -> Vec<(&'static str, &'static str)> {
    let d = frame.axes * direction;
    let mut axes: Vec<usize> = (0..3).filter(|axis| d[*axis].abs() > LEANS).collect();
    axes.sort_by(|a, b| d[*b].abs().total_cmp(&d[*a].abs()));
    axes.into_iter().map(|axis| AXES[axis][usize::from(d[axis] < 0.0)]).collect()
}

/// Writes at the borders of the plot where the patient's sides lie; returns the letters that stand there, with their words.
fn draw_axes(
    canvas: &mut Canvas,
    layout: &Layout,
    plane: &Plane,
    frame: &Frame,
    tool: Option<&ToolDrawing>,
) -> Vec<(&'static str, &'static str)> {
    let (unit, plot) = (layout.unit, layout.plot);
    let capital = 13.0 * unit;
    let middle = 0.5 * DVec2::new(plot.left + plot.right, plot.top + plot.bottom);
    let inside = 20.0 * unit;
    let mut words: Vec<(&str, &str)> = Vec::new();
    for (direction, at, aside) in [
        (-plane.right, DVec2::new(plot.left + inside, middle.y), DVec2::Y),
        (plane.right, DVec2::new(plot.right - inside, middle.y), DVec2::Y),
        (plane.up, DVec2::new(middle.x, plot.top + inside), DVec2::X),
        (-plane.up, DVec2::new(middle.x, plot.bottom - inside), DVec2::X),
    ] {
        let found = letters(frame, direction);
        let text: String = found.iter().map(|(letter, _)| *letter).collect();
        words.extend(found);
        // The needle often comes in at the middle of a border.
        let is_free = |at: &DVec2| {
            let near = [-1.5, 0.0, 1.5].map(|n| *at + n * inside * aside);
            !tool.is_some_and(|tool| near.iter().any(|p| tool.covers(layout.unplace(*p))))
        };
        let tried = [0.0, 3.0, -3.0, 8.0, -8.0].map(|n| at + n * inside * aside);
        let at = tried.into_iter().find(is_free).unwrap_or(at);
        let half = DVec2::new(0.5 * stroke_font::width(&text, capital) + 6.0 * unit, 0.5 * capital + 6.0 * unit);
        let (low, high) = (at - half, at + half);
        let chip = Rectangle { left: low.x, right: high.x, top: low.y, bottom: high.y };
        canvas.rectangle(chip, PAGE);
        super::outline(canvas, chip, unit);
        canvas.text(&text, DVec2::new(low.x + 6.0 * unit, high.y - 6.0 * unit), capital, INK);
    }
    words
}

/// What stands beside the plot.
struct Legend<'a> {
    anatomy: &'a Anatomy<'a>,
    seen: &'a [usize],
    scene: &'a Scene,
    is_opened: bool,
    words: &'a [(&'static str, &'static str)],
}

impl Legend<'_> {
    fn draw(&self, canvas: &mut Canvas, layout: &Layout) {
        let (unit, plot) = (layout.unit, layout.plot);
        let axes: Vec<String> = AXES
            .iter()
            .map(|sides| {
                let used = sides.iter().filter(|side| self.words.contains(side));
                used.map(|(letter, word)| format!("{letter} {word}")).collect::<Vec<_>>().join("   ")
            })
            .filter(|line| !line.is_empty())
            .collect();
        let rows = self.seen.len() + self.scene.targets.len() + usize::from(self.is_opened) + axes.len() + 1;
        let row = (ROW * unit).min((plot.bottom - plot.top) / rows as f64);
        let capital = (CAPITAL * unit).min(0.5 * row);
        let left = plot.right + 14.0 * unit;
        let names = left + 56.0 * unit;
        let right = f64::from(layout.size.0) - 8.0 * unit;
        let name = |canvas: &mut Canvas, text: &str, from: f64, middle: f64| {
            let text = stroke_font::shortened(text, capital, right - from);
            canvas.text(&text, DVec2::new(from, middle + 0.5 * capital), capital, INK);
        };
        let swatch = |canvas: &mut Canvas, colour: Colour, middle: f64| {
            let half = 0.32 * row;
            let r = Rectangle {
                left: left + 24.0 * unit,
                right: left + 48.0 * unit,
                top: middle - half,
                bottom: middle + half,
            };
            canvas.rectangle(r, colour);
            super::outline(canvas, r, unit);
        };
        let mut middle = plot.top + 0.5 * row;
        for (number, part) in (1..).zip(self.seen) {
            let part = &self.anatomy.parts()[*part];
            swatch(canvas, colour_of(part), middle);
            let text = format!("{number}");
            let from = left + 18.0 * unit - stroke_font::width(&text, capital);
            canvas.text(&text, DVec2::new(from, middle + 0.5 * capital), capital, INK);
            name(canvas, &part.name, names, middle);
            middle += row;
        }
        for target in &self.scene.targets {
            let centre = DVec2::new(left + 36.0 * unit, middle);
            for (width, colour) in [(4.0, INK), (2.0, TARGET)] {
                for arm in [DVec2::X, DVec2::Y].map(|a| 5.0 * unit * a) {
                    canvas.round_line([centre - arm, centre + arm], width * unit, colour);
                }
            }
            name(canvas, &format!("target: {}", target.name), names, middle);
            middle += row;
        }
        if self.is_opened {
            swatch(canvas, OPENED, middle);
            name(canvas, "cut path", names, middle);
        }
        for (n, line) in axes.iter().rev().enumerate() {
            name(canvas, line, left, plot.bottom - (n as f64 + 0.5) * row);
        }
    }
}
