//! `fit.svg`: measured points and fitted laws, one panel per mode of loading.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{FINER, fine, house_style, range, tick};
use crate::material::fit::{LawFit, Point, nominal_stress};
use crate::material::{Isochoric, Mode, Verdict};

/// Size of one panel [px]; a single one is drawn larger.
const PANEL: (u32, u32) = (600, 420);
const SINGLE_PANEL: (u32, u32) = (900, 520);
/// Heights of the title, and of a row of the legend [px].
const TITLE: u32 = 50;
const LEGEND_ROW: u32 = 26;
/// Left end of title and legend, length of a line sample, and gap between two entries [px].
const LEFT: u32 = 78;
const SAMPLE: u32 = 34;
const GAP: u32 = 26;
/// Mean width of a letter of the legend [px].
const LETTER: u32 = 8;

/// Dash and gap of a fit that is not stable for every deformation [px].
const DASH: (u32, u32) = (8, 5);
const CURVE_POINTS: u32 = 400;

const MEASURED: RGBColor = RGBColor(90, 90, 90);

type ChartResult<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// One fitted law in every panel and in the legend.
struct Line {
    label: String,
    colour: RGBColor,
    /// [1/FINER px]
    width: u32,
    dashed: bool,
    law: Isochoric,
}

/// Text of the chart; `best` is the law drawn thickest.
pub fn fit_chart(title: &str, points: &[Point], fits: &[LawFit], best: Option<&str>) -> ChartResult<String> {
    let modes: Vec<Mode> = Mode::ALL.into_iter().filter(|m| points.iter().any(|p| p.mode == *m)).collect();
    let lines = lines(fits, best);
    let (columns, rows) = match modes.len() {
        0 | 1 => (1, 1),
        2 => (2, 1),
        _ => (2, 2),
    };
    let panel = if columns == 1 { SINGLE_PANEL } else { PANEL };
    let width = columns * panel.0;
    let (places, legend_rows) = legend_places(&lines, width);
    let head = TITLE + legend_rows * LEGEND_ROW;
    let size = (width, head + rows * panel.1);

    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (fine(size.0), fine(size.1))).into_drawing_area();
        root.fill(&WHITE)?;
        let (top, body) = root.split_vertically(fine(head));
        draw_head(&top, title, width, &lines, &places)?;
        for (area, mode) in body.split_evenly((rows as usize, columns as usize)).iter().zip(&modes) {
            draw_panel(area, *mode, points, &lines)?;
        }
        root.present()?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", fine(size.0), fine(size.1));
    let shown = format!("width=\"{}\" height=\"{}\"", size.0, size.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

/// Stable fits as solid lines; dashed beside them the best fits that are not stable. In order of drawing.
fn lines(fits: &[LawFit], best: Option<&str>) -> Vec<Line> {
    let mut lines = Vec::new();
    for fit in fits {
        let Some(law) = fit.stable.or(fit.unconstrained).map(|fit| fit.law.law()) else { continue };
        let [red, green, blue] = law.colour;
        let (name, colour) = (law.name, RGBColor(red, green, blue));
        let label = |rms: f64, what: &str| format!("{name}, rms {:.3} kPa{what}", rms * 1e-3);
        if let Some(stable) = fit.stable {
            let (width, what) = if best == Some(fit.key) { (3, " (best stable)") } else { (2, "") };
            let label = label(stable.rms, what);
            lines.push(Line { label, colour, width: width * FINER, dashed: false, law: stable.law });
        }
        if let Some(free) = fit.unconstrained.filter(|f| f.verdict != Verdict::Stable) {
            let what = if free.verdict == Verdict::Unstable { " (unstable)" } else { " (limited)" };
            lines.push(Line { label: label(free.rms, what), colour, width: 2 * FINER, dashed: true, law: free.law });
        }
    }
    // Solid above dashed, the best law on top; the legend goes the other way.
    lines.sort_by_key(|line| (line.width, !line.dashed));
    lines
}

/// Left ends and rows of the entries of the legend, the points first; and the number of rows.
fn legend_places(lines: &[Line], width: u32) -> (Vec<(u32, u32)>, u32) {
    let (mut x, mut row) = (LEFT, 0);
    let mut places = Vec::new();
    let letters = std::iter::once("measured".len()).chain(lines.iter().rev().map(|line| line.label.len()));
    for letters in letters {
        let entry = SAMPLE + 8 + letters as u32 * LETTER;
        if x > LEFT && x + entry > width {
            (x, row) = (LEFT, row + 1);
        }
        places.push((x, row));
        x += entry + GAP;
    }
    (places, row + 1)
}

fn draw_head<DB: DrawingBackend>(
    head: &DrawingArea<DB, Shift>,
    title: &str,
    width: u32,
    lines: &[Line],
    places: &[(u32, u32)],
) -> std::result::Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let place = |x: u32, y: u32| (fine(x) as i32, fine(y) as i32);
    let longest = (width as usize - 100) / 10;
    let title: String = if title.chars().count() > longest {
        title.chars().take(longest - 3).chain("...".chars()).collect()
    } else {
        title.to_string()
    };
    head.draw_text(&title, &("sans-serif", fine(21)).into_font().color(&BLACK), place(LEFT, 14))?;
    let labels = std::iter::once("measured").chain(lines.iter().rev().map(|line| line.label.as_str()));
    for (i, (label, (x, row))) in labels.zip(places).enumerate() {
        let y = TITLE + row * LEGEND_ROW + LEGEND_ROW / 2;
        let style = ("sans-serif", fine(15)).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        head.draw_text(label, &style, place(x + SAMPLE + 8, y))?;
        match i.checked_sub(1).map(|i| &lines[lines.len() - 1 - i]) {
            None => head.draw(&Circle::new(place(x + SAMPLE / 2, y), fine(4), MEASURED.stroke_width(fine(1))))?,
            Some(line) => {
                let (dash, gap) = if line.dashed { DASH } else { (SAMPLE, 1) };
                let mut start = *x;
                while start < x + SAMPLE {
                    let end = (start + dash).min(x + SAMPLE);
                    head.draw(&PathElement::new(vec![place(start, y), place(end, y)], line.style()))?;
                    start += dash + gap;
                }
            }
        }
    }
    Ok(())
}

impl Line {
    fn style(&self) -> ShapeStyle {
        self.colour.stroke_width(self.width)
    }
}

fn draw_panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, Shift>,
    mode: Mode,
    points: &[Point],
    lines: &[Line],
) -> std::result::Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    let measured: Vec<(f64, f64)> = points.iter().filter(|p| p.mode == mode).map(|p| (p.x, p.stress * 1e-3)).collect();
    let (x_min, x_max) = around(measured.iter().map(|p| p.0).chain([mode.at_rest()]), 0.03);
    // Room for the fits that leave the points, but never more than for the points themselves.
    let (y_min, y_max) = around(measured.iter().map(|p| p.1).chain([0.0]), 0.12);
    let mut chart = ChartBuilder::on(area)
        .margin_left(fine(10))
        .margin_right(fine(24))
        .margin_top(fine(6))
        .margin_bottom(fine(10))
        .x_label_area_size(fine(48))
        .y_label_area_size(fine(68))
        .build_cartesian_2d(x_min..x_max, y_min..y_max)?;
    let (x_name, y_name) = match mode {
        Mode::Uniaxial => ("stretch, uniaxial", "nominal stress [kPa]"),
        Mode::Equibiaxial => ("stretch, equibiaxial", "nominal stress [kPa]"),
        Mode::Planar => ("stretch, planar", "nominal stress [kPa]"),
        Mode::Shear => ("amount of shear", "shear stress [kPa]"),
    };
    house_style(&mut chart.configure_mesh())
        .x_desc(x_name)
        .y_desc(y_name)
        .x_labels(8)
        .y_labels(8)
        .x_label_formatter(&|v| tick(*v, x_max - x_min))
        .y_label_formatter(&|v| tick(*v, y_max - y_min))
        .draw()?;
    let rule = BLACK.mix(0.6).stroke_width(fine(1));
    chart.draw_series(LineSeries::new([(x_min, 0.0), (x_max, 0.0)], rule))?;
    chart.draw_series(LineSeries::new([(mode.at_rest(), y_min), (mode.at_rest(), y_max)], rule))?;
    for line in lines {
        let at = |i: u32| {
            let x = x_min + (x_max - x_min) * f64::from(i) / f64::from(CURVE_POINTS);
            (x, nominal_stress(&line.law, mode, x) * 1e-3)
        };
        let curve: Vec<(f64, f64)> = (0..=CURVE_POINTS).map(at).collect();
        for part in curve.split(|p| !(y_min..=y_max).contains(&p.1)).filter(|part| part.len() > 1) {
            let part = part.iter().copied();
            if line.dashed {
                chart.draw_series(DashedLineSeries::new(part, fine(DASH.0), fine(DASH.1), line.style()))?;
            } else {
                chart.draw_series(LineSeries::new(part, line.style()))?;
            }
        }
    }
    // On top of the lines: a good fit would hide them.
    chart.draw_series(measured.iter().map(|at| Circle::new(*at, fine(4), MEASURED.stroke_width(fine(1)))))?;
    Ok(())
}

/// The range of the values, widened on both sides by this fraction.
fn around(values: impl Iterator<Item = f64>, fraction: f64) -> (f64, f64) {
    let (low, high) = range(values).unwrap_or((0.0, 1.0));
    let margin = fraction * if high > low { high - low } else { 1.0 };
    (low - margin, high + margin)
}
