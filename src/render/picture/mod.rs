//! Composes the picture of a run: one list of triangles in pixels, in the order in which they are drawn.
//!
//! Layout for a width of 900 pixels; everything scales with the width.
//! ```text
//! title
//! +-----------------------------+  von Mises
//! |          tool               |  stress, kPa
//! |  ~~~~~~~~||~~~~~~~~~~~~~~~  |  colour bar
//! |  tissue  \/                 |
//! +-----------------------------+
//! depth, force, time     scale bar
//! ```

pub mod anatomy;
mod labelled;
mod numbers;
mod tool;

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3};

use self::tool::ToolDrawing;
use super::anatomy::Anatomy;
use super::slice::{self, EdgeKind, Plane, Slice};
use super::stroke_font;
use crate::mesh::Mesh;
use crate::observables::FieldSnapshot;
use crate::observables::field::VON_MISES;
use crate::scene::Scene;
use crate::units::{KILOPASCAL, MEGAPASCAL, PASCAL, three_digits};

/// Width where the scene names none, and bounds of what it may name [px].
const DEFAULT_WIDTH: u32 = 900;
const WIDTHS: std::ops::RangeInclusive<u32> = 320..=4096;
/// Width that the lengths below are given for [px].
const DESIGN_WIDTH: f64 = 900.0;
const TITLE_STRIP: f64 = 52.0;
const CAPTION_STRIP: f64 = 48.0;
const LEFT_MARGIN: f64 = 16.0;
const RIGHT_COLUMN: f64 = 126.0;
/// Smallest and largest height of the plot over the width of the picture.
const PLOT_HEIGHTS: [f64; 2] = [0.35, 1.1];
/// Air above and room around the tissue, over its width in the cut.
const HEADROOM: f64 = 0.2;
const ROOM: f64 = 0.02;

/// A corner of a triangle.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Vertex {
    /// From the upper left corner of the picture, y downwards [px].
    pub position: [f32; 2],
    /// Position in the colour table, 0..1.
    pub field_value: f32,
    /// Share of the table's colour, 0 = only `colour`, 1 = only the table.
    pub field_weight: f32,
    /// Red, green, blue, alpha; linear light.
    pub colour: [f32; 4],
}

/// Everything that a renderer needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// [px]
    pub width: u32,
    pub height: u32,
    /// Red, green, blue, alpha; linear light.
    pub background: [f32; 4],
    /// Colours of the field from 0 to 1; linear light.
    pub colour_table: [[f32; 4]; 256],
    /// Three per triangle; later triangles cover earlier ones.
    pub vertices: Vec<Vertex>,
}

impl Picture {
    /// Composes the picture of one moment.
    pub fn compose(scene: &Scene, mesh: &Mesh, snapshot: &FieldSnapshot) -> Self {
        let plane = Plane::of_scene(scene, mesh, snapshot);
        // With a label map or shapes of regions, cells of a block hold mixtures; tetrahedra are of one region each.
        let has_mixtures = scene.case.is_some() || mesh.as_block().is_some();
        let anatomy = has_mixtures.then(|| Anatomy::of_scene(scene)).flatten();
        let slice = match &anatomy {
            Some(anatomy) => labelled::cut(anatomy, mesh, snapshot, &plane, scene),
            None => slice::cut(mesh, snapshot, &plane, scene.tissue.cell_size),
        };
        let layout = Layout::new(scene, mesh, &plane, &slice, RIGHT_COLUMN);
        let scale = StressScale::new(scene.outputs.stress_scale, &slice);
        let tool = ToolDrawing::new(scene, snapshot, &plane);

        let mut canvas = Canvas::default();
        canvas.rectangle(layout.plot, AIR);
        match &anatomy {
            Some(anatomy) => {
                let scale = (&scale, scene.tissue.cell_size);
                labelled::draw_stress(&mut canvas, &layout, (&slice, &plane), anatomy, scale);
            }
            None => draw_tissue(&mut canvas, &layout, &slice, &scale, scene.tissue.cell_size),
        }
        if let Some(tool) = &tool {
            tool.draw(&mut canvas, &layout);
        }
        for (target, place) in scene.targets.iter().zip(&snapshot.targets) {
            draw_target(&mut canvas, &layout, &plane, *place, target.radius);
        }
        draw_frame(&mut canvas, &layout);
        draw_texts(&mut canvas, &layout, scene, snapshot, (&plane, &slice));
        draw_colour_bar(&mut canvas, &layout, &scale);
        if path_is_visible(&slice, tool.as_ref()) {
            draw_path_legend(&mut canvas, &layout);
        }
        Self::of(&layout, canvas)
    }

    fn of(layout: &Layout, canvas: Canvas) -> Self {
        Self {
            width: layout.size.0,
            height: layout.size.1,
            background: PAGE.linear(1.0),
            colour_table: std::array::from_fn(|i| {
                let at = DARKEST + (1.0 - DARKEST) * i as f64 / 255.0;
                let c = colorous::INFERNO.eval_continuous(at);
                Colour(c.r, c.g, c.b).linear(1.0)
            }),
            vertices: canvas.vertices,
        }
    }

    /// Colour of the table at 0..1, linear between its entries.
    pub fn table_colour(&self, value: f32) -> [f32; 4] {
        let at = value.clamp(0.0, 1.0) * 255.0;
        let low = at as usize;
        let (a, b) = (self.colour_table[low], self.colour_table[(low + 1).min(255)]);
        std::array::from_fn(|i| a[i] + (at - low as f32) * (b[i] - a[i]))
    }
}

/// Red, green, blue as in an image file (sRGB).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Colour(u8, u8, u8);

const PAGE: Colour = Colour(252, 252, 251);
const AIR: Colour = Colour(222, 230, 237);
const INK: Colour = Colour(28, 30, 36);
const WHITE: Colour = Colour(255, 255, 255);
const WARNING: Colour = Colour(170, 20, 20);
/// Neither in the colour table nor in steel.
const TARGET: Colour = Colour(0, 225, 190);
/// Where the colour table starts in the map `inferno`: its black would swallow outlines and look like a hole.
const DARKEST: f64 = 0.1;
/// Mixed into the field where the tip has opened the tissue.
const OPENED: Colour = Colour(205, 214, 222);
/// Share of the field's colour there.
const OPENED_FIELD_WEIGHT: f32 = 0.25;

impl Colour {
    fn linear(self, alpha: f32) -> [f32; 4] {
        [decode_srgb(self.0), decode_srgb(self.1), decode_srgb(self.2), alpha]
    }
}

/// sRGB byte to linear light (IEC 61966-2-1).
fn decode_srgb(byte: u8) -> f32 {
    let c = f32::from(byte) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Linear light to sRGB byte (IEC 61966-2-1).
pub(in crate::render) fn encode_srgb(linear: f32) -> u8 {
    let c = linear.clamp(0.0, 1.0);
    let encoded = if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// A rectangle in pixels.
#[derive(Debug, Clone, Copy)]
struct Rectangle {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

/// Where things stand, and how the plane maps to pixels.
struct Layout {
    size: (u32, u32),
    /// Picture width over the width of the design.
    unit: f64,
    plot: Rectangle,
    /// Right end of the scale bar [px].
    bar_right: f64,
    /// [px/m]
    pixels_per_metre: f64,
    /// Point of the plane in the middle of the plot [m].
    centre: DVec2,
}

impl Layout {
    /// `column`: what stands beside the plot, in a picture of the width of the design [px].
    fn new(scene: &Scene, mesh: &Mesh, plane: &Plane, slice: &Slice, column: f64) -> Self {
        let width = match scene.outputs.picture_width {
            0 => DEFAULT_WIDTH,
            width => width.clamp(*WIDTHS.start(), *WIDTHS.end()),
        };
        let unit = f64::from(width) / DESIGN_WIDTH;
        let (low, high) = extent(mesh, plane, slice);
        let span = high - low;
        let low = low - DVec2::splat(ROOM * span.x);
        let high = high + DVec2::new(ROOM, HEADROOM) * span.x;
        let view = high - low;

        let plot_width = f64::from(width) - unit * (LEFT_MARGIN + column);
        let [least, most] = PLOT_HEIGHTS.map(|h| h * f64::from(width));
        let mut pixels_per_metre = plot_width / view.x;
        if view.y * pixels_per_metre > most {
            pixels_per_metre = most / view.y;
        }
        let plot_height = (view.y * pixels_per_metre).clamp(least, most);
        let height = (plot_height + unit * (TITLE_STRIP + CAPTION_STRIP)).round();
        // Spare height goes above the tissue, where the tool is.
        let centre = DVec2::new(0.5 * (low.x + high.x), low.y + 0.5 * plot_height / pixels_per_metre);
        Self {
            size: (width, height as u32),
            unit,
            plot: Rectangle {
                left: unit * LEFT_MARGIN,
                top: unit * TITLE_STRIP,
                right: f64::from(width) - unit * column,
                bottom: height - unit * CAPTION_STRIP,
            },
            bar_right: f64::from(width) - unit * RIGHT_COLUMN,
            pixels_per_metre,
            centre,
        }
    }

    /// Plane [m] to picture [px].
    fn place(&self, point: DVec2) -> DVec2 {
        let p = (point - self.centre) * self.pixels_per_metre;
        DVec2::new(0.5 * (self.plot.left + self.plot.right) + p.x, 0.5 * (self.plot.top + self.plot.bottom) - p.y)
    }

    /// Picture [px] to plane [m].
    fn unplace(&self, at: DVec2) -> DVec2 {
        let middle = 0.5 * DVec2::new(self.plot.left + self.plot.right, self.plot.top + self.plot.bottom);
        self.centre + DVec2::new(at.x - middle.x, middle.y - at.y) / self.pixels_per_metre
    }
}

/// Bounds of the tissue in the cut [m]; at most a quarter larger than the block at rest, so that one wild cell does
/// not shrink the picture.
fn extent(mesh: &Mesh, plane: &Plane, slice: &Slice) -> (DVec2, DVec2) {
    let (low, high) = mesh.bounds();
    let ends = |axis: usize| [low[axis], high[axis]];
    let mut rest = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for x in ends(0) {
        for y in ends(1) {
            for z in ends(2) {
                let p = plane.project(glam::DVec3::new(x, y, z));
                rest = (rest.0.min(p), rest.1.max(p));
            }
        }
    }
    let mut cut = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for p in slice.triangles.iter().flat_map(|t| t.points) {
        cut = (cut.0.min(p), cut.1.max(p));
    }
    if slice.triangles.is_empty() {
        return rest;
    }
    let slack = 0.25 * (rest.1 - rest.0);
    (cut.0.max(rest.0 - slack), cut.1.min(rest.1 + slack))
}

/// Part of the tissue in a cut whose stress may lie above the scale, where a path is opened.
const BEYOND_SCALE: f64 = 0.02;

/// What the colours mean.
struct StressScale {
    /// Stress at the upper end of the colour bar [Pa].
    top: f64,
    /// Equal steps between the ticks.
    steps: usize,
    /// True where the picture holds larger values.
    exceeded: bool,
}

impl StressScale {
    fn new(chosen: Option<f64>, slice: &Slice) -> Self {
        // Opened cells are drawn pale: they set no scale.
        let shown = || slice.triangles.iter().filter(|t| !t.opened);
        let largest = shown().flat_map(|t| t.von_mises).fold(0.0, f64::max);
        if let Some(top) = chosen.filter(|top| *top > 0.0) {
            return Self { top, steps: 4, exceeded: largest > top };
        }
        // At the wall of an opened path the stress is tens of times that beside it, in a seam: some of the tissue may lie above the scale.
        let bulk = match slice.is_opened {
            false => largest,
            true => {
                let mut areas: Vec<(f64, f64)> =
                    shown().map(|t| (t.von_mises.iter().sum::<f64>() / 3.0, t.area())).collect();
                areas.sort_by(|a, b| b.0.total_cmp(&a.0));
                let mut left = BEYOND_SCALE * areas.iter().map(|(_, area)| area).sum::<f64>();
                let above = |(_, area): &(f64, f64)| {
                    left -= area;
                    left > 0.0
                };
                let beyond = areas.iter().copied().take_while(above).count();
                areas.get(beyond).map_or(largest, |(stress, _)| *stress)
            }
        };
        let (top, steps) = rounded_up(bulk);
        Self { top, steps, exceeded: largest > top }
    }
}

/// The next of 1, 1.5, 2, 3, 4, 5, 6, 8 times a power of ten, and into how many steps it divides well.
fn rounded_up(value: f64) -> (f64, usize) {
    const STEPS: [(f64, usize); 9] =
        [(1.0, 5), (1.5, 3), (2.0, 4), (3.0, 3), (4.0, 4), (5.0, 5), (6.0, 3), (8.0, 4), (10.0, 5)];
    if !(value > 0.0 && value.is_finite()) {
        return (1e3, 5);
    }
    let power = 10f64.powf(value.log10().floor());
    STEPS
        .into_iter()
        .map(|(factor, steps)| (factor * power, steps))
        .find(|(top, _)| *top >= value)
        .unwrap_or((10.0 * power, 5))
}

/// Collects triangles.
#[derive(Default)]
struct Canvas {
    vertices: Vec<Vertex>,
}

impl Canvas {
    fn vertex(&mut self, position: DVec2, colour: [f32; 4], field_value: f32, field_weight: f32) {
        self.vertices.push(Vertex {
            position: [position.x as f32, position.y as f32],
            field_value,
            field_weight,
            colour,
        });
    }

    fn triangle(&mut self, corners: [DVec2; 3], colour: [f32; 4]) {
        for corner in corners {
            self.vertex(corner, colour, 0.0, 0.0);
        }
    }

    /// A convex polygon of one colour.
    fn polygon(&mut self, corners: &[DVec2], colour: [f32; 4]) {
        for pair in corners[1..].windows(2) {
            self.triangle([corners[0], pair[0], pair[1]], colour);
        }
    }

    /// A four-cornered patch with a colour at each corner.
    fn patch(&mut self, corners: [DVec2; 4], colours: [[f32; 4]; 4]) {
        for i in [0, 1, 2, 0, 2, 3] {
            self.vertex(corners[i], colours[i], 0.0, 0.0);
        }
    }

    fn rectangle(&mut self, r: Rectangle, colour: Colour) {
        let corners = [
            DVec2::new(r.left, r.top),
            DVec2::new(r.right, r.top),
            DVec2::new(r.right, r.bottom),
            DVec2::new(r.left, r.bottom),
        ];
        self.polygon(&corners, colour.linear(1.0));
    }

    /// A line with butt ends.
    fn line(&mut self, ends: [DVec2; 2], width: f64, colour: [f32; 4]) {
        let Some(along) = (ends[1] - ends[0]).try_normalize() else {
            return;
        };
        let across = 0.5 * width * along.perp();
        self.polygon(&[ends[0] + across, ends[1] + across, ends[1] - across, ends[0] - across], colour);
    }

    /// A line with round ends, opaque.
    fn round_line(&mut self, ends: [DVec2; 2], width: f64, colour: Colour) {
        let colour = colour.linear(1.0);
        self.line(ends, width, colour);
        for end in ends {
            let disc: Vec<DVec2> =
                (0..8).map(|i| end + 0.5 * width * DVec2::from_angle(std::f64::consts::TAU * i as f64 / 8.0)).collect();
            self.polygon(&disc, colour);
        }
    }

    /// A line of text; `origin` is the left end of its baseline.
    fn text(&mut self, text: &str, origin: DVec2, capital: f64, colour: Colour) {
        let width = stroke_font::stroke_width(capital);
        for ends in stroke_font::segments(text, origin, capital) {
            self.round_line(ends, width, colour);
        }
    }
}

fn draw_tissue(canvas: &mut Canvas, layout: &Layout, slice: &Slice, scale: &StressScale, cell_size: f64) {
    for t in &slice.triangles {
        let (colour, weight) =
            if t.opened { (OPENED.linear(1.0), OPENED_FIELD_WEIGHT) } else { (WHITE.linear(1.0), 1.0) };
        for (point, stress) in t.points.iter().zip(t.von_mises) {
            canvas.vertex(layout.place(*point), colour, (stress / scale.top).clamp(0.0, 1.0) as f32, weight);
        }
    }
    let alpha = cell_edge_alpha(layout, cell_size);
    for (kind, width, colour) in [
        (EdgeKind::Cells, 1.0, WHITE.linear(alpha)),
        (EdgeKind::Materials, 1.5, WHITE.linear(0.6)),
        (EdgeKind::Surface, 2.0, INK.linear(1.0)),
    ] {
        for l in slice.lines.iter().filter(|l| l.kind == kind) {
            canvas.line(l.points.map(|p| layout.place(p)), width * layout.unit, colour);
        }
    }
}

/// Cell edges fade out where cells are only a few pixels wide.
fn cell_edge_alpha(layout: &Layout, cell_size: f64) -> f32 {
    let cell_pixels = cell_size * layout.pixels_per_metre / layout.unit;
    0.07 * ((cell_pixels - 3.0) / 9.0).clamp(0.0, 1.0) as f32
}

/// A cross where a target is now [m], seen from the front, and a circle where the plane cuts the sphere of its radius [m].
fn draw_target(canvas: &mut Canvas, layout: &Layout, plane: &Plane, place: DVec3, radius: f64) {
    const SECTORS: usize = 48;
    if !place.is_finite() {
        return;
    }
    let centre = layout.place(plane.project(place));
    let arm = 5.0 * layout.unit;
    let mut lines: Vec<[DVec2; 2]> = [DVec2::X, DVec2::Y].map(|a| [centre - arm * a, centre + arm * a]).to_vec();
    let beside = (place - plane.origin).dot(plane.normal);
    if beside.abs() < radius {
        let cut = (radius * radius - beside * beside).sqrt() * layout.pixels_per_metre;
        let rim = |i: usize| centre + cut * DVec2::from_angle(std::f64::consts::TAU * i as f64 / SECTORS as f64);
        lines.extend((0..SECTORS).map(|i| [rim(i), rim(i + 1)]));
    }
    for (width, colour) in [(4.0, INK), (2.0, TARGET)] {
        for ends in &lines {
            canvas.round_line(*ends, width * layout.unit, colour);
        }
    }
}

/// Covers everything outside the plot and draws its frame.
fn draw_frame(canvas: &mut Canvas, layout: &Layout) {
    let (width, height) = (f64::from(layout.size.0), f64::from(layout.size.1));
    let plot = layout.plot;
    let page = Rectangle { left: 0.0, top: 0.0, right: width, bottom: height };
    for margin in [
        Rectangle { bottom: plot.top, ..page },
        Rectangle { top: plot.bottom, ..page },
        Rectangle { right: plot.left, ..page },
        Rectangle { left: plot.right, ..page },
    ] {
        canvas.rectangle(margin, PAGE);
    }
    outline(canvas, plot, layout.unit);
}

fn outline(canvas: &mut Canvas, r: Rectangle, width: f64) {
    let corners = [
        DVec2::new(r.left, r.top),
        DVec2::new(r.right, r.top),
        DVec2::new(r.right, r.bottom),
        DVec2::new(r.left, r.bottom),
        DVec2::new(r.left, r.top),
    ];
    for ends in corners.windows(2) {
        canvas.round_line([ends[0], ends[1]], width, INK);
    }
}

fn draw_texts(
    canvas: &mut Canvas,
    layout: &Layout,
    scene: &Scene,
    snapshot: &FieldSnapshot,
    (plane, slice): (&Plane, &Slice),
) {
    let unit = layout.unit;
    let (width, height) = (f64::from(layout.size.0), f64::from(layout.size.1));
    let title = if scene.title.is_empty() { &scene.name } else { &scene.title };
    let capital = 15.0 * unit;
    let room = width - 2.0 * unit * LEFT_MARGIN;
    canvas.text(&stroke_font::shortened(title, capital, room), DVec2::new(layout.plot.left, 35.0 * unit), capital, INK);

    let baseline = height - 17.0 * unit;
    let bar_left = draw_scale_bar(canvas, layout, baseline);
    let mut caption = String::new();
    if snapshot.tool_pose.is_some() {
        caption += &format!("depth {:.1} mm   force {:.2} N   ", snapshot.depth * 1e3, snapshot.axial_force);
    }
    let decimals = if snapshot.time < 1.0 { 3 } else { 2 };
    caption += &format!("t = {:.decimals$} s   cells {} mm", snapshot.time, three_digits(scene.tissue.cell_size * 1e3));
    // A cut beside its usual place, through the mesh, says where it is.
    if plane.normal == DVec3::NEG_Y && plane.origin.y != scene.motion.entry.y {
        caption += &format!("   cut at y = {} mm", three_digits(plane.origin.y * 1e3));
    }
    let capital = 11.5 * unit;
    let room = bar_left - layout.plot.left - 20.0 * unit;
    canvas.text(&stroke_font::shortened(&caption, capital, room), DVec2::new(layout.plot.left, baseline), capital, INK);
    if slice.cells_left_out > 0 {
        canvas.text(
            &format!("{} cells not drawn: NaN or far outside", slice.cells_left_out),
            DVec2::new(layout.plot.left + 10.0 * unit, layout.plot.top + 22.0 * unit),
            capital,
            WARNING,
        );
    }
    if slice.triangles.is_empty() {
        canvas.text(
            "the cut meets no tissue",
            DVec2::new(layout.plot.left + 10.0 * unit, layout.plot.top + 46.0 * unit),
            capital,
            WARNING,
        );
    }
}

/// Draws the scale bar at the right end of the caption; returns its left end [px].
fn draw_scale_bar(canvas: &mut Canvas, layout: &Layout, baseline: f64) -> f64 {
    let unit = layout.unit;
    let longest = 0.26 * (layout.plot.right - layout.plot.left) / layout.pixels_per_metre;
    let power = 10f64.powf(longest.log10().floor());
    let length = [5.0, 2.0, 1.0].map(|factor| factor * power).into_iter().find(|&l| l <= longest).unwrap_or(power);
    let y = baseline - 5.0 * unit;
    let right = layout.bar_right;
    let left = right - length * layout.pixels_per_metre;
    for ends in [
        [DVec2::new(left, y), DVec2::new(right, y)],
        [DVec2::new(left, y - 6.0 * unit), DVec2::new(left, y + 6.0 * unit)],
        [DVec2::new(right, y - 6.0 * unit), DVec2::new(right, y + 6.0 * unit)],
    ] {
        canvas.round_line(ends, 2.0 * unit, INK);
    }
    let label = format!("{} mm", three_digits(length * 1e3));
    let capital = 11.5 * unit;
    let start = left - stroke_font::width(&label, capital) - 10.0 * unit;
    canvas.text(&label, DVec2::new(start, baseline), capital, INK);
    start
}

fn draw_colour_bar(canvas: &mut Canvas, layout: &Layout, scale: &StressScale) {
    let unit = layout.unit;
    let left = layout.plot.right + 16.0 * unit;
    let shown = [MEGAPASCAL, KILOPASCAL].into_iter().find(|u| scale.top >= u.si).unwrap_or(PASCAL);
    let capital = 10.5 * unit;
    let (first, last) = VON_MISES.label.rsplit_once(' ').unwrap_or(("", VON_MISES.label));
    for (line, text) in [first.to_string(), format!("{last}, {}", shown.name)].iter().enumerate() {
        let y = layout.plot.top + unit * (11.0 + 20.0 * line as f64);
        canvas.text(text, DVec2::new(left, y), capital, INK);
    }
    let top = layout.plot.top + 54.0 * unit;
    let bar = Rectangle { left, right: left + 22.0 * unit, top, bottom: top + 0.72 * (layout.plot.bottom - top) };
    let corners = [
        (bar.left, bar.bottom, 0.0),
        (bar.right, bar.bottom, 0.0),
        (bar.right, bar.top, 1.0),
        (bar.left, bar.top, 1.0),
    ];
    for i in [0, 1, 2, 0, 2, 3] {
        let (x, y, value) = corners[i];
        canvas.vertex(DVec2::new(x, y), WHITE.linear(1.0), value, 1.0);
    }
    outline(canvas, bar, unit);
    for step in 0..=scale.steps {
        let share = step as f64 / scale.steps as f64;
        let y = bar.bottom + share * (bar.top - bar.bottom);
        canvas.round_line([DVec2::new(bar.right, y), DVec2::new(bar.right + 6.0 * unit, y)], 1.5 * unit, INK);
        let mut label = three_digits(shown.show(scale.top) * share);
        if scale.exceeded && step == scale.steps {
            label.insert(0, '≥');
        }
        canvas.text(&label, DVec2::new(bar.right + 11.0 * unit, y + 0.5 * capital), capital, INK);
    }
}

/// True if opened cells are to be seen beside the tool.
fn path_is_visible(slice: &Slice, tool: Option<&ToolDrawing>) -> bool {
    slice.triangles.iter().filter(|t| t.opened).any(|t| {
        let centre = (t.points[0] + t.points[1] + t.points[2]) / 3.0;
        !tool.is_some_and(|tool| tool.covers(centre))
    })
}

/// Tells what the pale cells are, below the colour bar.
fn draw_path_legend(canvas: &mut Canvas, layout: &Layout) {
    let unit = layout.unit;
    let left = layout.plot.right + 16.0 * unit;
    let swatch = Rectangle {
        left,
        right: left + 22.0 * unit,
        top: layout.plot.bottom - 16.0 * unit,
        bottom: layout.plot.bottom,
    };
    canvas.rectangle(swatch, OPENED);
    outline(canvas, swatch, unit);
    let capital = 10.5 * unit;
    canvas.text("cut path", DVec2::new(swatch.right + 8.0 * unit, swatch.bottom - 3.0 * unit), capital, INK);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_end_on_round_numbers() {
        for (value, top) in [
            (870.0, 1e3),
            (1e3, 1e3),
            (1200.0, 1500.0),
            (21e3, 30e3),
            (7.1, 8.0),
            (9.3e5, 1e6),
            (0.0, 1e3),
            (f64::NAN, 1e3),
        ] {
            let (found, steps) = rounded_up(value);
            assert!((found / top - 1.0).abs() < 1e-12, "{value}: {found}");
            assert!((3..=5).contains(&steps));
        }
    }

    #[test]
    fn srgb_goes_there_and_back() {
        for byte in 0..=255 {
            assert_eq!(encode_srgb(decode_srgb(byte)), byte);
        }
    }
}
