//! Points that were set in 3D Slicer: `.mrk.json` and the older `.fcsv`.
//!
//! Source: the schema "markups-schema-v1.0.3" of 3D Slicer, and "Markups" in its developer guide. Coordinates are LPS or RAS, as the file says;
//! in tables of version 4.10 and before, 0 stands for RAS and 1 for LPS.

use std::path::Path;

use glam::DVec3;
use serde::Deserialize;

use super::voxels::{self, shown};
use crate::reading::{self, most};
use crate::{Error, Result};

const SAVE_AGAIN: &str = "save the points again with 3D Slicer (.mrk.json)";

/// A point with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkupPoint {
    /// Name as in the file; empty where it has none.
    pub label: String,
    /// Place, RAS [m].
    pub position: DVec3,
}

/// Reads the points of a `.mrk.json` or `.fcsv` file. Points that were never set are left out.
///
/// # Errors
/// Where the file cannot be read, is none of both, or a point is not finite.
pub fn read(path: &Path) -> Result<Vec<MarkupPoint>> {
    let bytes = reading::bytes(path, most::CURVE)
        .map_err(|unread| unread.of(path, "check the name, and that you may read the file"))?;
    parse(&path.display().to_string(), &bytes)
}

/// The same from memory; `name` stands for the file in messages.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, bytes: &[u8]) -> Result<Vec<MarkupPoint>> {
    let text = std::str::from_utf8(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
        .map_err(|reason| Error::input(format!("{name}: this is no text in UTF-8: {reason}"), SAVE_AGAIN))?;
    match text.trim_start().chars().next() {
        Some('{') => json(name, text),
        Some('#') => table(name, text),
        Some(_) => Err(Error::input(format!("{name}: this is neither .mrk.json nor .fcsv of 3D Slicer"), SAVE_AGAIN)),
        None => Err(Error::input(format!("{name}: the file is empty"), SAVE_AGAIN)),
    }
}

/// The frame that coordinates stand in: signs that make RAS of them.
fn frame(word: &str) -> Option<DVec3> {
    match word.trim().to_ascii_uppercase().as_str() {
        "LPS" | "1" => Some(DVec3::new(-1.0, -1.0, 1.0)),
        "RAS" | "0" => Some(DVec3::ONE),
        _ => None,
    }
}

fn unknown_frame(place: &str, word: &str) -> Error {
    let message = format!("{place}: the coordinate system `{}` is not LPS or RAS", shown(word));
    Error::input(message, "save the points in patient coordinates (LPS or RAS) with 3D Slicer")
}

/// A place in RAS [m]; refused where it is nowhere.
fn point(place: &str, label: &str, position: DVec3) -> Result<MarkupPoint> {
    if !voxels::is_near(position) {
        let message = format!("{place}: point `{}` is not within 1 km of the patient", shown(label));
        return Err(Error::input(message, "set the point again in 3D Slicer"));
    }
    Ok(MarkupPoint { label: label.into(), position })
}

#[derive(Deserialize)]
struct File {
    markups: Vec<Markup>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    coordinate_system: Option<Word>,
    coordinate_units: Option<Word>,
    #[serde(default)]
    control_points: Vec<ControlPoint>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    label: Option<String>,
    position: Option<Vec<Option<f64>>>,
    position_status: Option<String>,
}

/// A word, or the number that stood for it once.
#[derive(Deserialize)]
#[serde(untagged)]
enum Word {
    Text(String),
    Number(i64),
}

impl Word {
    fn text(&self) -> String {
        match self {
            Word::Text(text) => text.clone(),
            Word::Number(number) => number.to_string(),
        }
    }
}

fn json(name: &str, text: &str) -> Result<Vec<MarkupPoint>> {
    let file: File = serde_json::from_str(text)
        .map_err(|reason| Error::input(format!("{name}: these are no markups of 3D Slicer: {reason}"), SAVE_AGAIN))?;
    let mut points = Vec::new();
    for (list, markup) in file.markups.iter().enumerate() {
        // The schema has LPS and mm where nothing else is said.
        let word = markup.coordinate_system.as_ref().map_or("LPS".into(), Word::text);
        let place = format!("{name}: markups[{list}]");
        let signs = frame(&word).ok_or_else(|| unknown_frame(&place, &word))?;
        let unit = markup.coordinate_units.as_ref().map_or("mm".into(), Word::text);
        let Some(per_metre) = voxels::per_metre(&unit) else {
            let message = format!("{place}: the unit of length `{}` is not known", shown(&unit));
            return Err(Error::input(message, "write mm, cm, m or um there, whichever is right"));
        };
        for (number, control) in markup.control_points.iter().enumerate() {
            if control.position_status.as_deref().is_some_and(|status| status != "defined") {
                continue;
            }
            let label = control.label.as_deref().unwrap_or_default();
            let place = format!("{place}.controlPoints[{number}]");
            match control.position.as_deref() {
                Some([Some(x), Some(y), Some(z)]) => {
                    points.push(point(&place, label, signs * DVec3::new(*x, *y, *z) / per_metre)?);
                }
                _ => {
                    let message = format!("{place}: point `{}` has no position of three numbers", shown(label));
                    return Err(Error::input(
                        message,
                        "set the point in 3D Slicer, or remove it, and save the list again",
                    ));
                }
            }
        }
    }
    Ok(points)
}

fn table(name: &str, text: &str) -> Result<Vec<MarkupPoint>> {
    let mut signs = None;
    let mut columns: Vec<String> = ["id", "x", "y", "z"].map(String::from).to_vec();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| line.starts_with('#')) {
        let Some((key, value)) = line.trim_start_matches('#').split_once('=') else { continue };
        match key.trim() {
            "CoordinateSystem" => {
                let unknown = || unknown_frame(&format!("{name}:{}", number + 1), value.trim());
                signs = Some(frame(value).ok_or_else(unknown)?);
            }
            "columns" => columns = value.split(',').take(1000).map(|column| column.trim().to_string()).collect(),
            _ => {}
        }
    }
    let Some(signs) = signs else {
        let message = format!("{name}: no line `# CoordinateSystem = ...` says whether the points are LPS or RAS");
        return Err(Error::input(message, "add the line that is right, or save the points again with 3D Slicer"));
    };
    let column = |key: &str| columns.iter().position(|column| column == key);
    let Some(axes) = column("x").zip(column("y")).zip(column("z")).map(|((x, y), z)| [x, y, z]) else {
        return Err(Error::input(format!("{name}: the columns x, y and z are not all there"), SAVE_AGAIN));
    };
    let label_column = column("label");
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).comment(Some(b'#')).from_reader(text.as_bytes());
    let (mut points, mut record) = (Vec::new(), csv::StringRecord::new());
    loop {
        let begin = reader.position().line();
        match reader.read_record(&mut record) {
            Ok(true) => {}
            Ok(false) => return Ok(points),
            Err(reason) => return Err(Error::input(format!("{name}:{begin}: {reason}"), SAVE_AGAIN)),
        }
        let place = format!("{name}:{}", record.position().map_or(begin, csv::Position::line));
        let numbers = axes.map(|axis| record.get(axis).and_then(|word| word.trim().parse::<f64>().ok()));
        let [Some(x), Some(y), Some(z)] = numbers else {
            return Err(Error::input(format!("{place}: x, y and z are not all numbers"), SAVE_AGAIN));
        };
        let label = label_column.and_then(|column| record.get(column)).unwrap_or_default();
        points.push(point(&place, label, signs * DVec3::new(x, y, z) / 1e3)?);
    }
}
