//! One chart in the house style from areas, lines and marks: charts whose curves are not known beforehand, as files and
//! inside a page.

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::chart::{Curve, FINER, HEAD, SIZE, draw_head, fine, house_style, range, tick, widened};

pub(crate) type PlotResult = std::result::Result<String, Box<dyn std::error::Error>>;

/// Size of a chart inside a page, where several stand beside one another and a phone shows one [px].
pub(super) const PAGE_SIZE: (u32, u32) = (440, 320);

/// A filled area; corners in units of the axes.
pub(crate) struct Area {
    pub label: &'static str,
    pub colour: RGBColor,
    pub opacity: f64,
    pub corners: Vec<(f64, f64)>,
}

/// A point; one with a text beside it is drawn larger.
pub(crate) struct Mark {
    pub at: (f64, f64),
    pub colour: RGBColor,
    pub text: Option<String>,
}

/// What is drawn, from the back to the front.
#[derive(Default)]
pub(crate) struct Plot {
    pub x_label: &'static str,
    pub y_label: &'static str,
    pub areas: Vec<Area>,
    pub curves: Vec<Curve>,
    pub marks: Vec<Mark>,
}

impl Plot {
    /// A file of its own, with title and legend.
    pub fn file(&self, title: &str) -> PlotResult {
        let (width, height) = (fine(SIZE.0), fine(SIZE.1));
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
            root.fill(&WHITE)?;
            let (head, body) = root.split_vertically(fine(HEAD));
            let swatches = self.areas.iter().map(|area| Curve {
                label: area.label,
                colour: area.colour,
                width: fine(12),
                dash: None,
                points: Vec::new(),
            });
            let lines = self.curves.iter().map(|curve| Curve { points: Vec::new(), ..*curve });
            draw_head(&head, title, &swatches.chain(lines).collect::<Vec<_>>())?;
            self.draw(&body, 12, 9)?;
            root.present()?;
        }
        let drawn = format!("width=\"{width}\" height=\"{height}\"");
        Ok(text.replacen(&drawn, &format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1), 1))
    }

    /// A part of a page that says title and legend itself: as wide as its place, in the colour of the text around it.
    pub fn inline(&self, description: &str) -> PlotResult {
        let (width, height) = (fine(PAGE_SIZE.0), fine(PAGE_SIZE.1));
        let mut text = String::new();
        {
            let root = SVGBackend::with_string(&mut text, (width, height)).into_drawing_area();
            self.draw(&root, 7, 9)?;
            root.present()?;
        }
        Ok(in_page(&text, description))
    }

    /// Draws the axes with about as many ticks as asked for, and what lies between them.
    fn draw<DB: DrawingBackend>(
        &self,
        area: &DrawingArea<DB, plotters::coord::Shift>,
        x_ticks: usize,
        y_ticks: usize,
    ) -> std::result::Result<(), Box<dyn std::error::Error>>
    where
        DB::ErrorType: 'static,
    {
        let points = || {
            let areas = self.areas.iter().flat_map(|a| a.corners.iter());
            let curves = self.curves.iter().flat_map(|c| c.points.iter());
            areas.chain(curves).copied().chain(self.marks.iter().map(|m| m.at))
        };
        let (x_min, x_max) = range(points().map(|p| p.0)).unwrap_or((0.0, 1.0));
        let (y_min, y_max) = range(points().map(|p| p.1)).unwrap_or((0.0, 1.0));
        let (x_min, x_max) = widened(x_min.min(0.0), x_max, 0.02);
        let (y_min, y_max) = widened(y_min.min(0.0), y_max.max(0.0), 0.08);
        let mut chart = ChartBuilder::on(area)
            .margin_left(fine(10))
            .margin_right(fine(24))
            .margin_top(fine(8))
            .margin_bottom(fine(10))
            .x_label_area_size(fine(48))
            .y_label_area_size(fine(68))
            .build_cartesian_2d(x_min..x_max, y_min..y_max)?;
        house_style(&mut chart.configure_mesh())
            .x_desc(self.x_label)
            .y_desc(self.y_label)
            .x_labels(x_ticks)
            .y_labels(y_ticks)
            .x_label_formatter(&|v| tick(*v, x_max - x_min))
            .y_label_formatter(&|v| tick(*v, y_max - y_min))
            .draw()?;
        for area in &self.areas {
            let style = area.colour.mix(area.opacity).filled();
            chart.draw_series([Polygon::new(area.corners.clone(), style)])?;
        }
        chart.draw_series(LineSeries::new([(x_min, 0.0), (x_max, 0.0)], BLACK.mix(0.6).stroke_width(fine(1))))?;
        for curve in &self.curves {
            let style = curve.colour.stroke_width(curve.width);
            let points = curve.points.iter().copied();
            match curve.dash {
                None => chart.draw_series(LineSeries::new(points, style))?,
                Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(points, fine(dash), fine(gap), style))?,
            };
        }
        for mark in &self.marks {
            let radius = if mark.text.is_some() { fine(5) } else { fine(3) };
            chart.draw_series([Circle::new(mark.at, radius, mark.colour.filled())])?;
            chart.draw_series([Circle::new(mark.at, radius, BLACK.stroke_width(fine(1)))])?;
            if let Some(text) = &mark.text {
                // Left of a peak the force is still below it: the text stands free there, unless the peak is near the axis.
                let near_axis = (mark.at.0 - x_min) < 0.4 * (x_max - x_min);
                let (anchor, shift) = if near_axis { (HPos::Left, 10) } else { (HPos::Right, -10) };
                let style = ("sans-serif", fine(15)).into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Bottom));
                let shift = (shift * FINER as i32, -6 * FINER as i32);
                chart.draw_series([EmptyElement::at(mark.at) + Text::new(text.clone(), shift, style)])?;
            }
        }
        Ok(())
    }
}

/// A drawing of [`PAGE_SIZE`] as a part of a page: as wide as its place, black in the colour of the text around it.
pub(super) fn in_page(drawing: &str, description: &str) -> String {
    let (width, height) = (fine(PAGE_SIZE.0), fine(PAGE_SIZE.1));
    let body = drawing.find('>').map_or("", |end| &drawing[end + 1..]);
    let body = body.replace("#000000", "currentColor");
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">{body}",
        super::page::escape(description)
    )
}

/// The entries of a legend beside one another, as markup.
pub(crate) fn legend_row(entries: &[String]) -> String {
    format!("<div class=\"legend\">{}</div>", entries.concat())
}

/// Entry of an area.
pub(crate) fn legend_swatch(colour: RGBColor, opacity: f64, text: &str) -> String {
    let colour = page_colour(colour);
    legend_entry(&format!("<rect width=\"34\" height=\"14\" fill=\"{colour}\" fill-opacity=\"{opacity}\"/>"), text)
}

/// Entry of a line of a width [px], with the length of dash and gap.
pub(crate) fn legend_line(colour: RGBColor, width: f64, dash: Option<(u32, u32)>, text: &str) -> String {
    let colour = page_colour(colour);
    let dash = dash.map_or(String::new(), |(dash, gap)| format!(" stroke-dasharray=\"{dash} {gap}\""));
    let line =
        format!("<line x1=\"0\" y1=\"7\" x2=\"34\" y2=\"7\" stroke=\"{colour}\" stroke-width=\"{width}\"{dash}/>");
    legend_entry(&line, text)
}

/// Entry of a mark.
pub(crate) fn legend_dot(colour: RGBColor, text: &str) -> String {
    let colour = page_colour(colour);
    legend_entry(&format!("<circle cx=\"17\" cy=\"7\" r=\"5.5\" fill=\"{colour}\" stroke=\"currentColor\"/>"), text)
}

fn legend_entry(sample: &str, text: &str) -> String {
    format!("<span><svg viewBox=\"0 0 34 14\" aria-hidden=\"true\">{sample}</svg>{}</span>", super::page::escape(text))
}

/// Black is the colour of the text around it, which a reader may have light on dark.
fn page_colour(colour: RGBColor) -> String {
    if colour == BLACK { "currentColor".into() } else { format!("#{:02x}{:02x}{:02x}", colour.0, colour.1, colour.2) }
}
