//! Measured curves: points of tests in CSV files, in the columns and units that people write.

use std::path::{Path, PathBuf};

use super::Mode;
use super::fit::Point;
use crate::error::{Error, Result};
use crate::reading;

/// Fewest points away from rest: Yeoh's law has three constants.
const FEWEST_POINTS: usize = 3;
/// Most points of all files: what a fit takes grows with them.
const MOST_POINTS: usize = 10_000;
/// Stretches outside are mistakes of column or unit, not of measurement.
const POSSIBLE_STRETCH: (f64, f64) = (0.1, 20.0);

/// A header that is understood.
pub const EXAMPLE: &str = "mode, stretch, nominal_stress_kpa";

/// Measured points of all files.
#[derive(Debug, Clone, Default)]
pub struct Curves {
    pub points: Vec<Point>,
    /// What was taken for granted.
    pub notes: Vec<String>,
}

/// Reads the points of all files.
pub fn read_curves(files: &[PathBuf]) -> Result<Curves> {
    let mut curves = Curves::default();
    for path in files {
        let bytes = reading::bytes(path, reading::most::CURVE)
            .map_err(|unread| unread.of(path, "check the name; a curve is a CSV file, see `stylet fit --help`"))?;
        if reading::is_built_in(path) {
            curves
                .notes
                .push(format!("there is no file {} here: the one built into the program is used", path.display()));
        }
        read_bytes(path, bytes, &mut curves)?;
    }
    enough(curves, files)
}

/// Reads the points of one file from its bytes; `path` stands for it in messages.
pub fn parse_curves(path: &Path, bytes: Vec<u8>) -> Result<Curves> {
    let mut curves = Curves::default();
    read_bytes(path, bytes, &mut curves)?;
    enough(curves, &[path.to_path_buf()])
}

fn read_bytes(path: &Path, bytes: Vec<u8>, curves: &mut Curves) -> Result<()> {
    let text = String::from_utf8(bytes).map_err(|_| {
        Error::input(
            format!("{}: is not text in UTF-8", path.display()),
            "export the table as CSV in UTF-8 (a spreadsheet file such as .xlsx is none)",
        )
    })?;
    read_table(path, &text, curves)
}

/// The points, if they are enough for a fit.
fn enough(curves: Curves, files: &[PathBuf]) -> Result<Curves> {
    let away = curves.points.iter().filter(|p| p.x != p.mode.at_rest());
    if away.clone().count() < FEWEST_POINTS {
        return Err(Error::input(
            format!(
                "{}: {} away from rest, at least {FEWEST_POINTS} are needed",
                names(files),
                counted(away.count(), "point")
            ),
            "give more rows, or further files of the same tissue",
        ));
    }
    if curves.points.iter().all(|p| p.stress == 0.0) {
        return Err(Error::input(format!("{}: every stress is zero", names(files)), "check the column of the stress"));
    }
    Ok(curves)
}

/// Where the numbers of a row stand.
struct Columns {
    names: Vec<String>,
    mode: Option<usize>,
    weight: Option<usize>,
    deformation: Option<(usize, Deformation)>,
    shear: Option<usize>,
    /// Column, factor to Pa, true for a Cauchy stress.
    stress: (usize, f64, bool),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Deformation {
    Stretch,
    /// Factor to a strain of one.
    Strain(f64),
}

/// A place in a file, for messages.
struct Place<'a> {
    path: &'a Path,
    line: u64,
}

impl Place<'_> {
    fn error(&self, message: impl std::fmt::Display, way_out: impl Into<String>) -> Error {
        Error::input(format!("{}:{}: {message}", self.path.display(), self.line), way_out)
    }
}

fn read_table(path: &Path, text: &str, curves: &mut Curves) -> Result<()> {
    let text = text.trim_start_matches('\u{feff}');
    let header = text.lines().find(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    let Some(header) = header else {
        return Err(Error::input(
            format!("{}: holds no table", path.display()),
            format!("begin with a header such as `{EXAMPLE}`, then one row per point"),
        ));
    };
    // A semicolon or tab in the header separates; numbers may then have a decimal comma.
    let separator = [b';', b'\t'].into_iter().find(|s| header.as_bytes().contains(s)).unwrap_or(b',');
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .flexible(true)
        .has_headers(false)
        .from_reader(text.as_bytes());
    let mut columns: Option<Columns> = None;
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|reason| {
            Error::input(format!("{}: {reason}", path.display()), "check the quotation marks of the file")
        })?;
        let place = Place { path, line: record.position().map_or(0, csv::Position::line) };
        match &columns {
            None => columns = Some(read_header(&place, &record, &mut curves.notes)?),
            Some(columns) if record.iter().all(str::is_empty) && columns.names.len() > 1 => {}
            Some(_) if curves.points.len() + rows.len() == MOST_POINTS => {
                return Err(place.error(
                    format!("more than {MOST_POINTS} rows, which a fit does not need"),
                    "keep every tenth or hundredth row: a hundred points along a curve tell its law as well",
                ));
            }
            Some(columns) => rows.push(read_row(&place, &record, columns, separator != b',')?),
        }
    }
    let turned: Vec<&str> =
        [Turn::Strain, Turn::Stress].into_iter().filter_map(|t| turn_magnitudes(&mut rows, t)).collect();
    if !turned.is_empty() {
        let what = turned.join(" and ");
        curves.notes.push(format!("{}: {what} in compression were read as magnitudes", path.display()));
    }
    let cauchy = columns.as_ref().is_some_and(|c| c.stress.2);
    let pulled_while_short = rows.iter().filter(|r| !r.compression && r.x < r.mode.at_rest() && r.stress > 0.0).count();
    for row in rows {
        // An incompressible sample of stretch l has 1/l of its section left.
        let stress = if cauchy && row.mode != Mode::Shear { row.stress / row.x } else { row.stress };
        curves.points.push(Point { mode: row.mode, x: row.x, stress, weight: row.weight });
        if row.x <= 0.0 && row.mode != Mode::Shear {
            return Err(Place { path, line: row.line }
                .error("a sample cannot be compressed by its whole length", "check the unit of the strain"));
        }
    }
    if pulled_while_short > 0 {
        curves.notes.push(format!(
            "{}: {} with a stretch below 1 and a pulling stress; if these are magnitudes of a compression, write `compression` in \
             the column `mode`",
            path.display(),
            counted(pulled_while_short, "row")
        ));
    }
    Ok(())
}

fn read_header(place: &Place, record: &csv::StringRecord, notes: &mut Vec<String>) -> Result<Columns> {
    let way_out = format!("write a header such as `{EXAMPLE}`");
    let names: Vec<String> = record.iter().map(plain_name).collect();
    if names.iter().all(|name| name.is_empty() || name.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'_' | b'e')))
    {
        return Err(place.error("the first row holds no names of columns", way_out));
    }
    let (mut mode, mut weight, mut shear) = (None, None, None);
    let mut deformation: Option<(usize, Deformation)> = None;
    let mut stress: Option<(usize, f64, bool)> = None;
    for (i, name) in names.iter().enumerate() {
        let twice = |first: usize| {
            let message = format!("columns `{}` and `{name}` say the same", names[first]);
            place.error(message, "keep one of them, or give two files")
        };
        let single = match name.as_str() {
            "mode" => Some(&mut mode),
            "weight" => Some(&mut weight),
            "shear" => Some(&mut shear),
            _ => None,
        };
        if let Some(single) = single {
            if let Some(first) = single.replace(i) {
                return Err(twice(first));
            }
            continue;
        }
        let kind = match name.as_str() {
            "stretch" => Some(Deformation::Stretch),
            "strain" => Some(Deformation::Strain(1.0)),
            "strain_percent" => Some(Deformation::Strain(0.01)),
            _ => None,
        };
        if let Some(kind) = kind {
            if let Some((first, _)) = deformation.replace((i, kind)) {
                return Err(twice(first));
            }
        } else if name.contains("stress") {
            let (stem, unit) = name.rsplit_once('_').unwrap_or((name, ""));
            let factor = match unit {
                "pa" => 1.0,
                "kpa" => 1e3,
                "mpa" => 1e6,
                _ => {
                    return Err(place.error(
                        format!("column `{}` names no unit of stress", &record[i]),
                        format!("end the name in _pa, _kpa or _mpa, e.g. `{}_kpa`", name.trim_end_matches('_')),
                    ));
                }
            };
            let cauchy = match stem {
                "stress" | "nominal_stress" | "engineering_stress" | "shear_stress" => false,
                "cauchy_stress" | "true_stress" => true,
                _ => {
                    return Err(place.error(
                        format!("column `{}` is no stress known here", &record[i]),
                        "use stress, nominal_stress or cauchy_stress with _pa, _kpa or _mpa",
                    ));
                }
            };
            if let Some((first, ..)) = stress.replace((i, factor, cauchy)) {
                return Err(twice(first));
            }
        } else if ["strain", "stretch", "mode", "shear", "weight"].iter().any(|known| name.contains(known)) {
            return Err(place.error(
                format!("unknown column `{}`", &record[i]),
                "use mode, weight, and stretch, strain, strain_percent or shear",
            ));
        } else {
            notes.push(format!("{}: column `{}` is not used", place.path.display(), &record[i]));
        }
    }
    if deformation.is_none() && shear.is_none() {
        let message = format!("no column of the deformation among `{}`", names.join(", "));
        return Err(place.error(message, "add stretch, strain, strain_percent or shear"));
    }
    let Some(stress) = stress else {
        let message = format!("no column of the stress among `{}`", names.join(", "));
        return Err(place.error(message, "add one with its unit, e.g. nominal_stress_kpa"));
    };
    Ok(Columns { names, mode, weight, deformation, shear, stress })
}

/// `Nominal stress (kPa)` -> `nominal_stress_kpa`, `strain [%]` -> `strain_percent`.
fn plain_name(name: &str) -> String {
    let name = name.to_lowercase().replace('%', " percent");
    let words = name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_")
}

struct Row {
    line: u64,
    mode: Mode,
    compression: bool,
    x: f64,
    /// [Pa]
    stress: f64,
    weight: f64,
}

fn read_row(place: &Place, record: &csv::StringRecord, columns: &Columns, decimal_comma: bool) -> Result<Row> {
    if record.len() != columns.names.len() {
        let message = format!("{}, but the header has {}", counted(record.len(), "value"), columns.names.len());
        return Err(place.error(message, "give one value per column; decimals take a point where commas separate"));
    }
    let number = |column: usize| -> Result<f64> {
        let (text, name) = (&record[column], &columns.names[column]);
        let plain = if decimal_comma { text.replace(',', ".") } else { text.into() };
        match plain.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            Ok(_) => {
                Err(place.error(format!("column `{name}`: `{text}` is not finite"), "remove the row or mend the value"))
            }
            Err(_) if text.is_empty() => {
                Err(place.error(format!("column `{name}` is empty"), "give a number, or remove the row"))
            }
            Err(_) => Err(place.error(
                format!("column `{name}`: `{text}` is not a number"),
                "write a number such as 0.12; units belong into the header",
            )),
        }
    };
    let (mode, compression) = match columns.mode.map(|c| record[c].to_lowercase()) {
        None if columns.deformation.is_none() => (Mode::Shear, false),
        None => (Mode::Uniaxial, false),
        Some(name) => match name.as_str() {
            "uniaxial" | "tension" => (Mode::Uniaxial, false),
            "compression" => (Mode::Uniaxial, true),
            "equibiaxial" => (Mode::Equibiaxial, false),
            "planar" => (Mode::Planar, false),
            "shear" => (Mode::Shear, false),
            _ => {
                return Err(place.error(
                    format!("column `mode`: `{name}` is no mode"),
                    "use tension, compression, uniaxial, equibiaxial, planar or shear",
                ));
            }
        },
    };
    let x = match (mode, columns.shear, columns.deformation) {
        (Mode::Shear, Some(column), _) => number(column)?,
        (Mode::Shear, None, Some((column, Deformation::Strain(unit)))) => unit * number(column)?,
        (Mode::Shear, ..) => {
            return Err(place.error("a row in shear needs the amount of shear", "add the column `shear`"));
        }
        (_, _, Some((column, Deformation::Stretch))) => number(column)?,
        (_, _, Some((column, Deformation::Strain(unit)))) => 1.0 + unit * number(column)?,
        (_, _, None) => {
            return Err(place.error(
                format!("a row in {} needs its stretch or strain", mode.key()),
                "add the column `stretch`, `strain` or `strain_percent`",
            ));
        }
    };
    let (least, largest) = POSSIBLE_STRETCH;
    let farthest = if mode == Mode::Shear { x.abs() } else { x };
    if farthest > largest || (mode != Mode::Shear && columns.stretches() && x < least) {
        return Err(place.error(
            format!("{} {x} cannot be", if mode == Mode::Shear { "amount of shear" } else { "stretch" }),
            "stretch is length over rest length; a strain of 12 % stands as `strain` 0.12 or `strain_percent` 12",
        ));
    }
    let (column, unit, _) = columns.stress;
    let weight = match columns.weight {
        None => 1.0,
        Some(column) => number(column)?,
    };
    if weight <= 0.0 {
        return Err(place
            .error(format!("column `weight`: {weight} is not positive"), "give a weight above 0, or remove the row"));
    }
    Ok(Row { line: place.line, mode, compression, x, stress: unit * number(column)?, weight })
}

impl Columns {
    fn stretches(&self) -> bool {
        self.deformation.is_some_and(|(_, kind)| kind == Deformation::Stretch)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    Stress,
    Strain,
}

/// Compressive rows given as magnitudes get the sign of compression; tells what was turned.
fn turn_magnitudes(rows: &mut [Row], turn: Turn) -> Option<&'static str> {
    let compressed = || rows.iter().filter(|r| r.compression);
    let sum: f64 = compressed().map(|r| if turn == Turn::Stress { r.stress } else { r.x - 1.0 }).sum();
    if sum <= 0.0 {
        return None;
    }
    for row in rows.iter_mut().filter(|r| r.compression) {
        match turn {
            Turn::Stress => row.stress = -row.stress,
            Turn::Strain => row.x = 2.0 - row.x,
        }
    }
    Some(if turn == Turn::Stress { "stresses" } else { "strains" })
}

pub fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn names(files: &[PathBuf]) -> String {
    files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
