//! `sample.svg`: what a specimen carries, one colour per driven face: stress against stretch, shear or rotation, and
//! against time where the face is held.

use std::path::Path;

use plotters::prelude::*;

use super::chart::{Curve, FINER, GREEN, HEAD, INWARD, ORANGE, OUTWARD, PINK, SIZE, draw_head, fine};
use super::material_chart::{Mark, Panel};
use super::sample::{DrivenFace, Motion, SamplePoint};
use crate::observables::FrameRecord;
use crate::whole_file;
use crate::{Error, Result};

const COLOURS: [RGBColor; 6] = [INWARD, OUTWARD, GREEN, PINK, ORANGE, RGBColor(86, 180, 233)];

/// Writes the chart, whole or not at all.
pub fn write_sample_chart(path: &Path, title: &str, faces: &[DrivenFace], records: &[FrameRecord]) -> Result<()> {
    let text = sample_chart(title, faces, records)
        .map_err(|reason| Error::file(path, std::io::Error::other(format!("chart: {reason}"))))?;
    whole_file::write(path, text.as_bytes())
}

/// Text of the chart.
pub fn sample_chart(
    title: &str,
    faces: &[DrivenFace],
    records: &[FrameRecord],
) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let end = records.last().map_or(0.0, |r| r.time);
    let series: Vec<Series> =
        faces.iter().zip(COLOURS).map(|(face, colour)| Series::new(face, colour, records)).collect();
    let held = faces.iter().any(|face| face.is_held(end));
    let mut text = String::new();
    {
        let root = SVGBackend::with_string(&mut text, (fine(SIZE.0), fine(SIZE.1))).into_drawing_area();
        root.fill(&WHITE)?;
        let (head, body) = root.split_vertically(fine(HEAD));
        // The head lists the last curve first.
        let legend: Vec<Curve> = series.iter().rev().map(|s| s.curve(Vec::new())).collect();
        draw_head(&head, title, &legend)?;
        let abscissa = abscissa(faces);
        let rest = if faces.iter().any(|f| f.motion() == Motion::Normal) { 1.0 } else { 0.0 };
        let over_motion = Panel {
            abscissa,
            ordinate: ordinate(faces),
            rest,
            lines: series.iter().map(|s| s.curve(s.over(|p| s.deformation(p)))).collect(),
            marks: series.iter().filter_map(Series::mark).collect(),
        };
        if held {
            let (left, right) = body.split_horizontally(fine(SIZE.0 / 2));
            over_motion.draw(&left)?;
            Panel {
                abscissa: "time [s]",
                ordinate: ordinate(faces),
                rest: 0.0,
                lines: series.iter().map(|s| s.curve(s.over(|p| p.time))).collect(),
                marks: Vec::new(),
            }
            .draw(&right)?;
        } else {
            over_motion.draw(&body)?;
        }
        root.present()?;
    }
    let drawn = format!("width=\"{}\" height=\"{}\"", fine(SIZE.0), fine(SIZE.1));
    let shown = format!("width=\"{}\" height=\"{}\"", SIZE.0, SIZE.1);
    Ok(text.replacen(&drawn, &shown, 1))
}

/// One driven face.
struct Series<'a> {
    face: &'a DrivenFace,
    colour: RGBColor,
    points: Vec<SamplePoint>,
}

impl<'a> Series<'a> {
    fn new(face: &'a DrivenFace, colour: RGBColor, records: &[FrameRecord]) -> Self {
        Series { face, colour, points: records.iter().map(|r| face.point(r)).collect() }
    }

    fn deformation(&self, p: &SamplePoint) -> f64 {
        match self.face.motion() {
            Motion::Normal => p.stretch,
            Motion::Tangential => p.shear,
            Motion::Rotation => p.rotation.to_degrees(),
        }
    }

    /// [kPa]
    fn stress(&self, p: &SamplePoint) -> Option<f64> {
        let stress = match self.face.motion() {
            Motion::Tangential => p.shear_stress,
            Motion::Normal | Motion::Rotation => p.nominal_stress,
        };
        stress.filter(|s| s.is_finite()).map(|s| s * 1e-3)
    }

    fn over(&self, abscissa: impl Fn(&SamplePoint) -> f64) -> Vec<(f64, f64)> {
        self.points.iter().filter_map(|p| Some((abscissa(p), self.stress(p)?))).collect()
    }

    fn curve(&self, points: Vec<(f64, f64)>) -> Curve {
        Curve { label: self.face.face.key(), colour: self.colour, width: FINER * 5 / 2, dash: None, points }
    }

    fn mark(&self) -> Option<Mark> {
        let points = self.over(|p| self.deformation(p));
        let at = points.into_iter().reduce(|a, b| if b.1.abs() > a.1.abs() { b } else { a })?;
        let label = match self.face.motion() {
            Motion::Rotation => format!("{:.2} kPa at {:.1} deg", at.1, at.0),
            Motion::Normal | Motion::Tangential => format!("{:.2} kPa at {:.3}", at.1, at.0),
        };
        (at.1 != 0.0).then_some(Mark { at, colour: self.colour, label })
    }
}

fn abscissa(faces: &[DrivenFace]) -> &'static str {
    let has = |motion: Motion| faces.iter().any(|f| f.motion() == motion);
    match (has(Motion::Normal), has(Motion::Tangential), has(Motion::Rotation)) {
        (true, false, false) => "stretch",
        (false, true, false) => "amount of shear",
        (false, false, true) => "rotation [deg]",
        _ => "stretch, amount of shear, rotation [deg]",
    }
}

fn ordinate(faces: &[DrivenFace]) -> &'static str {
    let tangential = faces.iter().filter(|f| f.motion() == Motion::Tangential).count();
    match tangential {
        0 => "nominal stress [kPa]",
        n if n == faces.len() => "shear stress [kPa]",
        _ => "nominal, shear stress [kPa]",
    }
}
