//! Figure of a material test: nominal stress against the deformation, one colour per mode, and against time where the
//! sample is held.

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{
    Curve, FINER, GREEN, HEAD, INWARD, OUTWARD, PINK, SIZE, draw_head, fine, house_style, range, tick, widened,
};
use crate::material::Mode;
use crate::material_test::{Leg, Row, peak};

type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

/// Dash of the way back [px].
const UNLOADING: (u32, u32) = (8, 5);

/// Text of the figure. `curves`: the rows of each mode.
pub fn material_chart(
    title: &str,
    curves: &[(Mode, Vec<Row>)],
) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (fine(SIZE.0), fine(SIZE.1))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, body) = root.split_vertically(fine(HEAD));
        let mut legend: Vec<Curve> =
            curves.iter().map(|(mode, _)| curve(mode.key(), *mode, None, Vec::new())).collect();
        if curves.iter().any(|(_, rows)| differs_on_the_way_back(rows)) {
            let grey = RGBColor(110, 110, 110);
            legend.push(Curve { colour: grey, ..curve("unloading", Mode::Uniaxial, Some(UNLOADING), Vec::new()) });
        }
        // The head lists the last curve first.
        legend.reverse();
        draw_head(&head, title, &legend)?;
        if curves.iter().any(|(_, rows)| rows.iter().any(|r| r.leg == Leg::Holding)) {
            let (left, right) = body.split_horizontally(fine(SIZE.0 / 2));
            over_deformation(&left, curves)?;
            over_time(&right, curves)?;
        } else {
            over_deformation(&body, curves)?;
        }
        root.present()?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", fine(SIZE.0), fine(SIZE.1));
    let shown = format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

fn colour(mode: Mode) -> RGBColor {
    match mode {
        Mode::Uniaxial => INWARD,
        Mode::Equibiaxial => OUTWARD,
        Mode::Planar => GREEN,
        Mode::Shear => PINK,
    }
}

fn curve(label: &'static str, mode: Mode, dash: Option<(u32, u32)>, points: Vec<(f64, f64)>) -> Curve {
    Curve { label, colour: colour(mode), width: FINER * 5 / 2, dash, points }
}

/// True where the stress on the way back is not that of the way out.
fn differs_on_the_way_back(rows: &[Row]) -> bool {
    let largest = rows.iter().map(|r| r.nominal.abs()).fold(0.0, f64::max);
    let loading: Vec<&Row> = rows.iter().filter(|r| r.leg == Leg::Loading).collect();
    rows.iter().filter(|r| r.leg == Leg::Unloading).any(|r| {
        let near =
            loading.iter().min_by(|a, b| (a.control - r.control).abs().total_cmp(&(b.control - r.control).abs()));
        near.is_some_and(|l| (l.nominal - r.nominal).abs() > 1e-3 * largest)
    })
}

/// Nominal stress [kPa] against stretch - 1 or the amount of shear.
fn over_deformation(area: &DrawingArea<SVGBackend, Shift>, curves: &[(Mode, Vec<Row>)]) -> Drawn {
    let mut lines = Vec::new();
    let mut marks = Vec::new();
    for (mode, rows) in curves {
        let point = |r: &Row| (r.control - mode.at_rest(), r.nominal * 1e-3);
        let back = differs_on_the_way_back(rows);
        let mut start = 0;
        while start < rows.len() {
            let (leg, cycle) = (rows[start].leg, rows[start].cycle);
            let end = rows[start..].iter().position(|r| (r.leg, r.cycle) != (leg, cycle));
            let end = end.map_or(rows.len(), |n| start + n);
            // Each leg begins where the last one ended.
            let points = rows[start.saturating_sub(1)..end].iter().map(point).collect();
            match leg {
                Leg::Unloading if !back => {}
                Leg::Unloading => lines.push(curve("", *mode, Some(UNLOADING), points)),
                _ => lines.push(curve("", *mode, None, points)),
            }
            start = end;
        }
        if let Some((control, stress)) = peak(rows) {
            let at = (control - mode.at_rest(), stress * 1e-3);
            let label = format!("{:.1} kPa at {control:.2}", at.1);
            marks.push(Mark { at, colour: colour(*mode), label });
        }
    }
    let only = match curves {
        [(Mode::Shear, _)] => "amount of shear",
        modes if modes.iter().all(|(m, _)| *m != Mode::Shear) => "stretch - 1",
        _ => "stretch - 1, amount of shear",
    };
    Panel { abscissa: only, ordinate: "nominal stress [kPa]", rest: 0.0, lines, marks }.draw(area)
}

/// Nominal stress [kPa] against time.
fn over_time(area: &DrawingArea<SVGBackend, Shift>, curves: &[(Mode, Vec<Row>)]) -> Drawn {
    let line = |(mode, rows): &(Mode, Vec<Row>)| {
        curve("", *mode, None, rows.iter().map(|r| (r.time, r.nominal * 1e-3)).collect())
    };
    let lines = curves.iter().map(line).collect();
    Panel { abscissa: "time [s]", ordinate: "nominal stress [kPa]", rest: 0.0, lines, marks: Vec::new() }.draw(area)
}

/// A point of a curve that is named.
pub(super) struct Mark {
    pub at: (f64, f64),
    pub colour: RGBColor,
    pub label: String,
}

/// Curves of stress over one abscissa.
pub(super) struct Panel {
    pub abscissa: &'static str,
    pub ordinate: &'static str,
    /// Where the abscissa is at rest: always in view, with a line.
    pub rest: f64,
    pub lines: Vec<Curve>,
    pub marks: Vec<Mark>,
}

impl Panel {
    pub(super) fn draw(&self, area: &DrawingArea<SVGBackend, Shift>) -> Drawn {
        let rest = self.rest;
        let values = |pick: fn(&(f64, f64)) -> f64| range(self.lines.iter().flat_map(|c| c.points.iter().map(pick)));
        let (x_min, x_max) = values(|p| p.0).map_or((0.0, 1.0), |(low, high)| (low - rest, high - rest));
        let (y_min, y_max) = values(|p| p.1).unwrap_or((0.0, 1.0));
        // Squeezed samples stand left of the axis.
        let (x_min, x_max) = if x_max <= 0.0 && x_min < 0.0 {
            (1.02 * x_min, 0.02 * -x_min)
        } else {
            widened(x_min.min(0.0), x_max, 0.02)
        };
        let (x_min, x_max) = (x_min + rest, x_max + rest);
        let (y_min, y_max) = if y_max <= 0.0 && y_min < 0.0 {
            (1.08 * y_min, 0.04 * -y_min)
        } else {
            widened(y_min.min(0.0), y_max, 0.08)
        };
        let (width, _) = area.dim_in_pixel();
        let mut chart = ChartBuilder::on(area)
            .margin_left(fine(10))
            .margin_right(fine(24))
            .margin_bottom(fine(10))
            .x_label_area_size(fine(48))
            .y_label_area_size(fine(68))
            .build_cartesian_2d(x_min..x_max, y_min..y_max)?;
        house_style(&mut chart.configure_mesh())
            .x_desc(self.abscissa)
            .y_desc(self.ordinate)
            .x_labels((width / fine(90)) as usize)
            .y_labels(9)
            .x_label_formatter(&|v| tick(*v, x_max - x_min))
            .y_label_formatter(&|v| tick(*v, y_max - y_min))
            .draw()?;
        let zero = BLACK.mix(0.6).stroke_width(fine(1));
        chart.draw_series(LineSeries::new([(x_min, 0.0), (x_max, 0.0)], zero))?;
        chart.draw_series(LineSeries::new([(rest, y_min), (rest, y_max)], zero))?;
        for line in &self.lines {
            let style = line.colour.stroke_width(line.width);
            let points = line.points.iter().copied();
            match line.dash {
                None => chart.draw_series(LineSeries::new(points, style)).map(drop)?,
                Some((dash, gap)) => {
                    chart.draw_series(DashedLineSeries::new(points, fine(dash), fine(gap), style)).map(drop)?;
                }
            }
        }
        for mark in &self.marks {
            let (x, _) = mark.at;
            chart.draw_series([Circle::new(mark.at, fine(4), mark.colour.filled())])?;
            // Left of a peak the stress is still below it; near the left edge there is no room.
            let near_edge = (x - x_min) < 0.35 * (x_max - x_min);
            let (anchor, shift) =
                if near_edge { (HPos::Left, 8 * FINER as i32) } else { (HPos::Right, -8 * FINER as i32) };
            let style = ("sans-serif", fine(15)).into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Bottom));
            let text = Text::new(mark.label.clone(), (shift, -4 * FINER as i32), style);
            chart.draw_series([EmptyElement::at(mark.at) + text])?;
        }
        Ok(())
    }
}
