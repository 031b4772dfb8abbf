//! `force.svg`: axial force against depth, the way in and the way out, and the parts of the force.

use std::path::Path;

use plotters::chart::MeshStyle;
use plotters::coord::ranged1d::Ranged;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::curve::CurveFigures;
use crate::observables::{ForceParts, FrameRecord};
use crate::whole_file;
use crate::{Error, Result};

/// Size of the chart [px].
pub(crate) const SIZE: (u32, u32) = (900, 600);
/// plotters rounds to whole units of the drawing: it draws this many times larger, and the viewer scales down.
pub(crate) const FINER: u32 = 8;
/// Height of the strip above the chart that holds title and legend [px].
pub(crate) const HEAD: u32 = 84;

// Colours that people with colour-blindness tell apart (Okabe and Ito 2008), each with its own dash or width.
pub(crate) const INWARD: RGBColor = RGBColor(0, 114, 178);
pub(crate) const OUTWARD: RGBColor = RGBColor(213, 94, 0);
/// Of the band around the inward curve: its colour, pale enough for the lines upon it.
const BAND: RGBColor = RGBColor(190, 220, 238);
pub(crate) const PINK: RGBColor = RGBColor(204, 121, 167);
pub(crate) const GREEN: RGBColor = RGBColor(0, 158, 115);
pub(crate) const ORANGE: RGBColor = RGBColor(230, 159, 0);

/// Dash and gap of the parts of the force, in their order [px].
const PART_DASHES: [Option<(u32, u32)>; 6] =
    [Some((7, 3)), None, Some((2, 3)), Some((10, 3)), Some((4, 2)), Some((1, 2))];

/// Travel below which a run counts as one without insertion and is drawn over time [m].
const LEAST_TRAVEL: f64 = 1e-6;

/// One line of the chart and of its legend.
pub(crate) struct Curve {
    pub label: &'static str,
    pub colour: RGBColor,
    /// [1/FINER px]
    pub width: u32,
    /// Length of dash and gap [px]; `None`: a solid line.
    pub dash: Option<(u32, u32)>,
    pub points: Vec<(f64, f64)>,
}

/// Writes the chart, whole or not at all.
pub fn write_force_chart(path: &Path, title: &str, records: &[FrameRecord], figures: &CurveFigures) -> Result<()> {
    let text = force_chart(title, records, figures)
        .map_err(|reason| Error::file(path, std::io::Error::other(format!("chart: {reason}"))))?;
    whole_file::write(path, text.as_bytes())
}

/// Text of the chart.
pub fn force_chart(
    title: &str,
    records: &[FrameRecord],
    figures: &CurveFigures,
) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let finite: Vec<&FrameRecord> =
        records.iter().filter(|r| r.depth.is_finite() && r.time.is_finite() && r.force.axial.is_finite()).collect();
    let over_depth = range(finite.iter().map(|r| r.depth)).is_some_and(|(a, b)| b - a > LEAST_TRAVEL);
    let abscissa = |r: &FrameRecord| if over_depth { r.depth * 1e3 } else { r.time };
    let mut curves = curves(&finite, over_depth, abscissa);
    let band = band(&finite, over_depth, abscissa);

    let xs = curves.iter().flat_map(|c| c.points.iter().map(|p| p.0));
    let ys = curves.iter().flat_map(|c| c.points.iter()).chain(&band).map(|p| p.1);
    let (x_min, x_max) = range(xs).unwrap_or((0.0, 1.0));
    let (y_min, y_max) = range(ys).unwrap_or((0.0, 1.0));
    let (x_min, x_max) = widened(x_min.min(0.0), x_max, 0.02);
    let (y_min, y_max) = widened(y_min.min(0.0), y_max.max(0.0), 0.08);

    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (fine(SIZE.0), fine(SIZE.1))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, body) = root.split_vertically(fine(HEAD));
        if !band.is_empty() {
            // Its place in the legend; it is drawn below the others.
            let last = curves.len() - 1;
            let (label, width) = ("error of the cells", FINER * 10);
            curves.insert(last, Curve { label, colour: BAND, width, dash: None, points: Vec::new() });
        }
        draw_head(&head, title, &curves)?;

        let mut chart = ChartBuilder::on(&body)
            .margin_left(fine(10))
            .margin_right(fine(24))
            .margin_bottom(fine(10))
            .x_label_area_size(fine(48))
            .y_label_area_size(fine(68))
            .build_cartesian_2d(x_min..x_max, y_min..y_max)?;
        house_style(&mut chart.configure_mesh())
            .x_desc(if over_depth { "depth of the tip [mm]" } else { "time [s]" })
            .y_desc("force on the tissue [N]")
            .x_labels(12)
            .y_labels(9)
            .x_label_formatter(&|v| tick(*v, x_max - x_min))
            .y_label_formatter(&|v| tick(*v, y_max - y_min))
            .draw()?;
        if !band.is_empty() {
            chart.draw_series([Polygon::new(band, BAND.filled())])?;
        }
        chart.draw_series(LineSeries::new([(x_min, 0.0), (x_max, 0.0)], BLACK.mix(0.6).stroke_width(fine(1))))?;
        for curve in &curves {
            let style = curve.colour.stroke_width(curve.width);
            match curve.dash {
                None => {
                    chart.draw_series(LineSeries::new(curve.points.iter().copied(), style))?;
                }
                Some((dash, gap)) => {
                    chart.draw_series(DashedLineSeries::new(
                        curve.points.iter().copied(),
                        fine(dash),
                        fine(gap),
                        style,
                    ))?;
                }
            }
        }
        if let (true, Some(depth), Some(force)) = (over_depth, figures.puncture_depth, figures.puncture_force) {
            let at = (depth * 1e3, force);
            chart.draw_series([Circle::new(at, fine(5), INWARD.filled())])?;
            chart.draw_series([Circle::new(at, fine(5), BLACK.stroke_width(fine(1)))])?;
            // Left of the peak the force is still below it: the text stands free there, unless the peak is near the axis.
            let near_axis = (at.0 - x_min) < 0.25 * (x_max - x_min);
            let (anchor, shift) =
                if near_axis { (HPos::Left, 10 * FINER as i32) } else { (HPos::Right, -10 * FINER as i32) };
            let style = ("sans-serif", fine(15)).into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Bottom));
            chart.draw_series([EmptyElement::at(at)
                + Text::new(format!("puncture {force:.2} N at {:.2} mm", at.0), (shift, -6 * FINER as i32), style)])?;
        }
        root.present()?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", fine(SIZE.0), fine(SIZE.1));
    let shown = format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

/// Where the way in ends: at the deepest frame, without an insertion at the last one.
fn turn(records: &[&FrameRecord], over_depth: bool) -> usize {
    let deeper =
        |a: &(usize, &&FrameRecord), b: &(usize, &&FrameRecord)| a.1.depth.total_cmp(&b.1.depth).then(b.0.cmp(&a.0));
    let deepest = records.iter().enumerate().max_by(deeper).map_or(0, |(i, _)| i);
    if over_depth { deepest } else { records.len().saturating_sub(1) }
}

/// Outline of the band around the axial force on the way in; empty without one.
fn band(records: &[&FrameRecord], over_depth: bool, abscissa: impl Fn(&FrameRecord) -> f64) -> Vec<(f64, f64)> {
    let inward = records.get(..=turn(records, over_depth)).unwrap_or(&[]);
    let edge = |r: &&FrameRecord, side: f64| {
        let error = r.force_error.filter(|error| error.is_finite())?;
        Some((abscissa(r), r.force.axial + side * error))
    };
    let upper = inward.iter().filter_map(|r| edge(r, 1.0));
    upper.chain(inward.iter().rev().filter_map(|r| edge(r, -1.0))).collect()
}

fn curves(records: &[&FrameRecord], over_depth: bool, abscissa: impl Fn(&FrameRecord) -> f64) -> Vec<Curve> {
    let turn = turn(records, over_depth);
    let inward = records.get(..=turn).unwrap_or(&[]);
    let outward = records.get(turn..).filter(|rest| rest.len() > 1).unwrap_or(&[]);
    let axial = |label, colour, dash, records: &[&FrameRecord]| Curve {
        label,
        colour,
        width: FINER * 3,
        dash,
        points: records.iter().map(|r| (abscissa(r), r.force.axial)).collect(),
    };
    let mut curves: Vec<Curve> = ForceParts::PARTS
        .iter()
        .zip(PART_DASHES.into_iter().cycle())
        // A part that the scene does not have has no line.
        .filter(|(part, _)| inward.iter().any(|r| (part.of)(&r.force) != 0.0))
        .map(|(part, dash)| Curve {
            label: part.name,
            colour: rgb(part.colour),
            width: FINER * 3 / 2,
            dash,
            points: inward.iter().map(|r| (abscissa(r), (part.of)(&r.force))).filter(|p| p.1.is_finite()).collect(),
        })
        // Most runs have few of the parts.
        .filter(|curve: &Curve| curve.points.iter().any(|p| p.1 != 0.0))
        .collect();
    if !outward.is_empty() {
        curves.push(axial("axial, after full depth", OUTWARD, Some((9, 5)), outward));
    }
    let label = if over_depth { "axial, way in" } else { "axial" };
    curves.push(axial(label, INWARD, None, inward));
    curves
}

/// Title and, below it, the legend outside the chart, in two rows where one is too short.
pub(crate) fn draw_head<DB: DrawingBackend>(
    head: &DrawingArea<DB, plotters::coord::Shift>,
    title: &str,
    curves: &[Curve],
) -> std::result::Result<(), DrawingAreaErrorKind<DB::ErrorType>> {
    const CHARACTER_WIDTH: usize = 8;
    const SAMPLE: i32 = 34;
    const LEFT: i32 = 78;
    let place = |x: i32, y: i32| (x * FINER as i32, y * FINER as i32);
    head.draw_text(&shortened(title), &("sans-serif", fine(21)).into_font().color(&BLACK), place(LEFT, 16))?;
    let width = |curve: &Curve| SAMPLE + 8 + (curve.label.chars().count() * CHARACTER_WIDTH) as i32 + 22;
    let one_row = LEFT + curves.iter().map(width).sum::<i32>() <= SIZE.0 as i32;
    let mut x = LEFT;
    let mut y = if one_row { 62 } else { 54 };
    // The two main lines first.
    for curve in curves.iter().rev() {
        if x > LEFT && x + width(curve) > SIZE.0 as i32 {
            (x, y) = (LEFT, y + 20);
        }
        let style = curve.colour.stroke_width(curve.width);
        match curve.dash {
            None => head.draw(&PathElement::new(vec![place(x, y), place(x + SAMPLE, y)], style))?,
            Some((dash, gap)) => {
                let mut start = x;
                while start < x + SAMPLE {
                    let end = (start + dash as i32).min(x + SAMPLE);
                    head.draw(&PathElement::new(vec![place(start, y), place(end, y)], style))?;
                    start += (dash + gap) as i32;
                }
            }
        }
        let label = ("sans-serif", fine(15)).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
        head.draw_text(curve.label, &label, place(x + SAMPLE + 8, y))?;
        x += width(curve);
    }
    Ok(())
}

/// A title that fits above the chart.
pub(crate) fn shortened(title: &str) -> String {
    let longest = (SIZE.0 as usize - 100) / 10;
    if title.chars().count() > longest {
        title.chars().take(longest - 3).chain("...".chars()).collect()
    } else {
        title.to_string()
    }
}

pub(crate) fn rgb([red, green, blue]: [u8; 3]) -> RGBColor {
    RGBColor(red, green, blue)
}

/// Pixels to units of the drawing.
pub(crate) fn fine(pixels: u32) -> u32 {
    pixels * FINER
}

pub(crate) fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| match range {
        None => Some((v, v)),
        Some((low, high)) => Some((low.min(v), high.max(v))),
    })
}

pub(crate) fn widened(low: f64, high: f64, fraction: f64) -> (f64, f64) {
    let span = if high > low { high - low } else { 1.0 };
    let below = if low < 0.0 { fraction * span } else { 0.0 };
    (low - below, low.max(high).max(low + span) + fraction * span)
}

/// Fonts, grid and axes of every chart of the program.
pub(crate) fn house_style<'m, 'a, 'b, X: Ranged, Y: Ranged, DB: DrawingBackend>(
    mesh: &'m mut MeshStyle<'a, 'b, X, Y, DB>,
) -> &'m mut MeshStyle<'a, 'b, X, Y, DB> {
    mesh.axis_desc_style(("sans-serif", fine(17)))
        .label_style(("sans-serif", fine(15)))
        .bold_line_style(BLACK.mix(0.14).stroke_width(fine(1)))
        .light_line_style(BLACK.mix(0.05).stroke_width(fine(1)))
        .axis_style(BLACK.mix(0.6).stroke_width(fine(1)))
        .set_all_tick_mark_size(fine(5))
        .max_light_lines(5)
}

/// A tick label with as many decimals as the span needs.
pub(crate) fn tick(value: f64, span: f64) -> String {
    let decimals = (1.0 - span.log10()).ceil().clamp(0.0, 9.0) as usize;
    let text = format!("{value:.decimals$}");
    if text.trim_start_matches('-').bytes().all(|b| matches!(b, b'0' | b'.')) { "0".into() } else { text }
}
