//! Points on two logarithmic axes, in the house style, as a part of a page.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{Curve, FINER, fine, house_style, range};
use super::plot::{PAGE_SIZE, PlotResult, in_page};

/// Room beyond the outermost points, and the least span of an axis, as factors.
const ROOM: f64 = 1.3;
const LEAST_SPAN: f64 = 3.0;

/// Leading digits of the ticks, from sparse to dense.
const TICKS: [&[f64]; 4] = [&[1.0], &[1.0, 3.0], &[1.0, 2.0, 5.0], &[1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0]];
/// Fewest labelled ticks of an axis.
const LEAST_TICKS: usize = 3;

/// Mean width of a letter beside a point, and height of its row [px].
const LETTER: i32 = 7;
const ROW: i32 = 15;

/// Form of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Shape {
    Circle,
    Square,
}

/// One point; both coordinates are greater than zero.
pub(crate) struct Point {
    pub at: (f64, f64),
    pub colour: RGBColor,
    pub shape: Shape,
    /// Drawn larger.
    pub strong: bool,
    pub text: Option<String>,
}

/// What is drawn, lines below points; all coordinates are greater than zero.
#[derive(Default)]
pub(crate) struct LogPlot {
    pub x_label: &'static str,
    pub y_label: &'static str,
    pub lines: Vec<Curve>,
    pub points: Vec<Point>,
    /// A vertical line.
    pub guide: Option<f64>,
}

/// A logarithmic axis with ticks at round numbers.
struct Decades {
    low: f64,
    high: f64,
}

impl Decades {
    /// Around the values, a little wider.
    fn around(values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = range(values.filter(|v| *v > 0.0)).unwrap_or((1.0, 10.0));
        let (low, high) = (low / ROOM, high * ROOM);
        let missing = (LEAST_SPAN / (high / low)).max(1.0).sqrt();
        Decades { low: low / missing, high: high * missing }
    }

    /// Multiples of the powers of ten that lie on the axis.
    fn multiples(&self, leading: &[f64]) -> Vec<f64> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let all = decades.flat_map(|decade| leading.iter().map(move |digit| digit * 10f64.powi(decade)));
        all.filter(|v| (self.low..=self.high).contains(v)).collect()
    }
}

impl Ranged for Decades {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let part = (value / self.low).ln() / (self.high / self.low).ln();
        limit.0 + (part * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            return self.multiples(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        }
        let enough = TICKS.iter().map(|leading| self.multiples(leading)).find(|ticks| ticks.len() >= LEAST_TICKS);
        enough.unwrap_or_else(|| self.multiples(TICKS[TICKS.len() - 1]))
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Decades {
    fn format(value: &f64) -> String {
        let decimals = (1.0 - value.log10().floor()).clamp(0.0, 9.0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    }
}

impl LogPlot {
    /// A part of a page that says title and legend itself: as wide as its place, in the colour of the text around it.
    pub fn inline(&self, description: &str) -> PlotResult {
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, (fine(PAGE_SIZE.0), fine(PAGE_SIZE.1))).into_drawing_area();
            self.draw(&root)?;
            root.present()?;
        }
        Ok(in_page(&text, description))
    }

    fn draw<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, plotters::coord::Shift>,
    ) -> std::result::Result<(), Box<dyn std::error::Error>>
    where
        DB::ErrorType: 'static,
    {
        let points = || {
            let lines = self.lines.iter().flat_map(|line| line.points.iter().copied());
            lines.chain(self.points.iter().map(|p| p.at))
        };
        let xs = Decades::around(points().map(|p| p.0).chain(self.guide));
        let ys = Decades::around(points().map(|p| p.1));
        let (x_low, x_high, y_low, y_high) = (xs.low, xs.high, ys.low, ys.high);
        let mut chart = ChartBuilder::on(area)
            .margin_left(fine(10))
            .margin_right(fine(24))
            .margin_top(fine(8))
            .margin_bottom(fine(10))
            .x_label_area_size(fine(48))
            .y_label_area_size(fine(68))
            .build_cartesian_2d(xs, ys)?;
        house_style(&mut chart.configure_mesh()).x_desc(self.x_label).y_desc(self.y_label).draw()?;
        if let Some(x) = self.guide.filter(|x| (x_low..=x_high).contains(x)) {
            let style = BLACK.mix(0.6).stroke_width(fine(1));
            chart.draw_series(DashedLineSeries::new([(x, y_low), (x, y_high)], fine(5), fine(4), style))?;
        }
        for line in &self.lines {
            let style = line.colour.stroke_width(line.width);
            let points = line.points.iter().copied();
            match line.dash {
                None => chart.draw_series(LineSeries::new(points, style))?,
                Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(points, fine(dash), fine(gap), style))?,
            };
        }
        let mut written: Vec<(i32, i32, i32)> = Vec::new();
        let places: Vec<(i32, i32)> = self.points.iter().map(|point| chart.backend_coord(&point.at)).collect();
        for point in &self.points {
            let radius = fine(if point.strong { 6 } else { 4 });
            let edge = BLACK.stroke_width(fine(1));
            match point.shape {
                Shape::Circle => {
                    chart.draw_series([Circle::new(point.at, radius, point.colour.filled())])?;
                    chart.draw_series([Circle::new(point.at, radius, edge)])?;
                }
                Shape::Square => {
                    let half = radius as i32 * 9 / 10;
                    let corners = [(-half, -half), (half, half)];
                    let square = |style: ShapeStyle| EmptyElement::at(point.at) + Rectangle::new(corners, style);
                    chart.draw_series([square(point.colour.filled())])?;
                    chart.draw_series([square(edge)])?;
                }
            }
            if let Some(text) = &point.text {
                // Towards the middle, or on the other side where another point is; where it would stand on another text it stays away.
                let inward = point.at.0 < (x_low * x_high).sqrt();
                let (x, y) = chart.backend_coord(&point.at);
                let width = LETTER * fine(text.chars().count() as u32) as i32;
                let row = ROW * FINER as i32;
                let begin = |left: bool| if left { x } else { x - width };
                let is_free = |left: bool| {
                    let (begin, end) = if left { (x, x + width + row) } else { (x - width - row, x) };
                    !places
                        .iter()
                        .any(|p| *p != (x, y) && p.0 > begin && p.0 < end && p.1 > y - row * 3 / 2 && p.1 < y + row / 2)
                };
                let left = if is_free(inward) || !is_free(!inward) { inward } else { !inward };
                let (anchor, shift) = if left { (HPos::Left, 9) } else { (HPos::Right, -9) };
                let begin = begin(left);
                if written.iter().any(|(a, b, r)| begin < *b && begin + width > *a && (y - r).abs() < row) {
                    continue;
                }
                written.push((begin, begin + width, y));
                let style = ("sans-serif", fine(13)).into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Bottom));
                let shift = (shift * FINER as i32, -4 * FINER as i32);
                chart.draw_series([EmptyElement::at(point.at) + Text::new(text.clone(), shift, style)])?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plotters::coord::ranged1d::BoldPoints;

    #[test]
    fn every_span_has_readable_ticks() {
        for low in [1e-4, 0.013, 0.7, 1.1, 42.0, 3.3e4] {
            for span in [1.0, 1.7, 4.0, 30.0, 1e3] {
                let axis = Decades::around([low, low * span].into_iter());
                let ticks = axis.key_points(BoldPoints(10));
                assert!((LEAST_TICKS..=9).contains(&ticks.len()), "{low} to {}: {ticks:?}", low * span);
                let labels: Vec<String> = ticks.iter().map(Decades::format).collect();
                let values: Vec<f64> = labels.iter().map(|l| l.parse().unwrap()).collect();
                assert!(values.iter().zip(&ticks).all(|(v, t)| (v / t - 1.0).abs() < 1e-9), "{labels:?}");
            }
        }
    }
}
