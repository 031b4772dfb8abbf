//! `stylet fit`: constants of the elastic laws from measured curves.
//!
//! A file is a table with a header: `stretch`, `strain`, `strain_percent` or `shear`; one stress with its unit
//! (`stress_kpa`, `nominal_stress_pa`, `cauchy_stress_mpa`, ...); and, where wanted, `mode` and `weight`. In `compression`
//! both columns may hold magnitudes: where the compressive rows of a file add up to a positive strain or stress, that
//! column is turned round.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::error::{Error, Result};
use crate::material::Mode;
use crate::material::fit::{Fit, LawFit, Point, best_stable, fit_all, nominal_stress};
use crate::material::{ElasticLaw, Isochoric, LAWS, Verdict, describe_verdict};
use crate::output::fit_chart::fit_chart;
use crate::output::folder::probe;
use crate::reading;
use crate::scene::presets::bulk_modulus_from_poisson;
use crate::units::{digits, significant};
use crate::whole_file;

/// Names of the files in the folder `--out`.
pub const CHART: &str = "fit.svg";
pub const TABLE: &str = "fit.csv";

/// Fewest points away from rest: Yeoh's law has three constants.
const FEWEST_POINTS: usize = 3;
/// Most points of all files: what a fit takes grows with them.
const MOST_POINTS: usize = 10_000;
/// Stretches outside are mistakes of column or unit, not of measurement.
const POSSIBLE_STRETCH: (f64, f64) = (0.1, 20.0);

const EXAMPLE: &str = "mode, stretch, nominal_stress_kpa";

/// What the user asked for.
#[derive(Debug, Clone)]
pub struct FitOptions {
    pub files: Vec<PathBuf>,
    pub volumetric: Volumetric,
    /// Density of the preset [kg/m^3].
    pub density: f64,
    /// Law of the preset; without it the best stable one.
    pub law: Option<String>,
    /// Name of the preset to write.
    pub preset: Option<String>,
    /// Folder for chart, table and preset.
    pub out: Option<PathBuf>,
    /// Replace the files that the folder holds.
    pub force: bool,
}

/// The volumetric constant of a preset: samples count as incompressible, so no curve gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Volumetric {
    PoissonRatio(f64),
    /// [Pa]
    BulkModulus(f64),
}

impl Default for FitOptions {
    fn default() -> Self {
        FitOptions {
            files: Vec::new(),
            volumetric: Volumetric::PoissonRatio(0.49),
            density: 1060.0,
            law: None,
            preset: None,
            out: None,
            force: false,
        }
    }
}

/// Measured points of all files.
#[derive(Debug, Clone, Default)]
pub struct Curves {
    pub points: Vec<Point>,
    /// What was taken for granted.
    pub notes: Vec<String>,
}

/// Everything that the command found out.
#[derive(Debug, Clone)]
pub struct FitReport {
    pub curves: Curves,
    pub fits: Vec<LawFit>,
    /// Text of the preset.
    pub preset: Option<String>,
    /// Files that were written.
    pub written: Vec<PathBuf>,
    files: Vec<String>,
    volumetric: Volumetric,
}

/// Reads, fits, and writes what was asked for.
pub fn fit(options: &FitOptions) -> Result<FitReport> {
    check_options(options)?;
    let curves = read_curves(&options.files)?;
    if let Some(folder) = &options.out {
        check_folder(folder, options)?;
    }
    let fits = fit_all(&curves.points);
    let files = options
        .files
        .iter()
        .map(|path| path.file_name().map_or(path.display().to_string(), |n| n.to_string_lossy().into()));
    let mut report = FitReport {
        curves,
        fits,
        preset: None,
        written: Vec::new(),
        files: files.collect(),
        volumetric: options.volumetric,
    };
    if let Some(name) = &options.preset {
        report.preset = Some(report.preset_text(name, options)?);
    }
    if let Some(folder) = &options.out {
        report.write(folder, options)?;
    }
    Ok(report)
}

fn check_options(options: &FitOptions) -> Result<()> {
    match options.volumetric {
        Volumetric::PoissonRatio(nu) if !(nu > 0.0 && nu < 0.5) => {
            return Err(Error::input(
                format!("Poisson's ratio {nu} is not between 0 and 0.5"),
                "give e.g. --poisson-ratio 0.49",
            ));
        }
        Volumetric::BulkModulus(k) if !(k > 0.0 && k.is_finite()) => {
            return Err(Error::input(
                format!("bulk modulus {} kPa is not positive", k * 1e-3),
                "give e.g. --bulk-modulus-kpa 500",
            ));
        }
        _ => {}
    }
    if !(options.density > 0.0 && options.density.is_finite()) {
        return Err(Error::input(
            format!("density {} kg/m^3 is not positive", options.density),
            "give e.g. --density-kg-m3 1060",
        ));
    }
    if let Some(name) = &options.preset
        && (name.is_empty() || name.chars().any(|c| !c.is_ascii_alphanumeric() && !matches!(c, '-' | '_')))
    {
        return Err(Error::input(
            format!("`{name}` cannot be the name of a preset"),
            "use letters, digits, - and _, e.g. --preset my-muscle",
        ));
    }
    if let Some(law) = &options.law
        && !LAWS.iter().any(|l| l.key == law)
    {
        return Err(Error::input(
            format!("`{law}` is no law"),
            format!("use one of {}", LAWS.map(|l| l.key).join(", ")),
        ));
    }
    if options.files.is_empty() {
        return Err(Error::input("no file was given", format!("give a CSV file with the header `{EXAMPLE}`")));
    }
    Ok(())
}

/// Names of the files that go into the folder `--out`.
fn file_names(options: &FitOptions) -> Vec<String> {
    let preset = options.preset.iter().map(|name| format!("{name}.toml"));
    [CHART, TABLE].map(String::from).into_iter().chain(preset).collect()
}

/// Makes the folder, and refuses one that holds such files or cannot be written to: before the fit, which takes a while.
fn check_folder(folder: &Path, options: &FitOptions) -> Result<()> {
    let there = file_names(options).into_iter().map(|name| folder.join(name)).find(|path| path.exists());
    if let Some(path) = there.filter(|_| !options.force) {
        return Err(Error::input(
            format!("{} is already there", path.display()),
            "give another folder with --out, or replace the file with --force",
        ));
    }
    fs::create_dir_all(folder).and_then(|()| probe(folder)).map_err(|reason| {
        Error::input(
            format!("{}: cannot be used as a folder: {reason}", folder.display()),
            "give a folder that can be written to with --out",
        )
    })
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

impl FitReport {
    /// The law of a fit with the bulk modulus of the options.
    fn elastic(&self, isochoric: Isochoric) -> ElasticLaw {
        let bulk_modulus = match self.volumetric {
            // A negative shear modulus would make a negative bulk modulus, and the verdict would name the wrong one.
            Volumetric::PoissonRatio(nu) => bulk_modulus_from_poisson(isochoric.shear_modulus().abs(), nu),
            Volumetric::BulkModulus(k) => k,
        };
        ElasticLaw { isochoric, bulk_modulus }
    }

    /// Modes that occur, in the order of [`Mode::ALL`].
    fn modes(&self) -> Vec<Mode> {
        Mode::ALL.into_iter().filter(|mode| self.curves.points.iter().any(|p| p.mode == *mode)).collect()
    }

    /// Smallest and largest principal stretch of the points.
    fn principal_range(&self) -> (f64, f64) {
        let stretches = self.curves.points.iter().flat_map(|p| p.mode.principal_stretches(p.x));
        stretches.fold((1.0, 1.0), |(low, high), l| (low.min(l), high.max(l)))
    }

    /// Both variants of every law, with their names in tables.
    fn variants(&self) -> impl Iterator<Item = (&'static str, &'static str, Option<Fit>)> {
        self.fits.iter().flat_map(|f| [(f.key, "best", f.unconstrained), (f.key, "stable", f.stable)])
    }

    /// What a person reads.
    pub fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a String cannot fail.
        let mut line = |text: String| {
            let _ = writeln!(out, "{}", text.trim_end());
        };
        line(format!("data       {}", self.files.join(", ")));
        for mode in self.modes() {
            let of_mode = || self.curves.points.iter().filter(|p| p.mode == mode);
            let (x, s) = (range(of_mode().map(|p| p.x)), range(of_mode().map(|p| p.stress * 1e-3)));
            line(format!(
                "           {}: {}, {} {} to {}, nominal stress {} to {} kPa",
                mode.key(),
                counted(of_mode().count(), "point"),
                if mode == Mode::Shear { "amount of shear" } else { "stretch" },
                digits(x.0, 4),
                digits(x.1, 4),
                digits(s.0, 4),
                digits(s.1, 4)
            ));
        }
        for note in &self.curves.notes {
            line(format!("note       {note}"));
        }
        line("fit        closed forms of incompressible samples, least squares of the nominal stress".into());
        line(
            "           best: whatever the constants; stable: best of those stable for every deformation (Yeoh: none negative)"
                .into(),
        );
        line(String::new());
        line(format!(
            "{:<14} {:<7} {:<50} {:>9} {:>7} {:>8}  verdict",
            "law", "fit", "constants", "rms kPa", "rms %", "R2"
        ));
        for (key, variant, fit) in self.variants() {
            let name = if variant == "best" { key } else { "" };
            match fit {
                None => line(format!("{name:<14} {variant:<7} none: the points determine no such constants")),
                Some(fit) => line(format!(
                    "{name:<14} {variant:<7} {:<50} {:>9} {:>7} {:>8.5}  {}",
                    constants(&fit.law),
                    digits(fit.rms * 1e-3, 3),
                    digits(fit.relative * 1e2, 3),
                    fit.r2,
                    short_verdict(&fit)
                )),
            }
        }
        line(String::new());
        let (low, high) = self.principal_range();
        line(format!("verdicts   the points reach principal stretches {} to {}", digits(low, 4), digits(high, 4)));
        for fit in &self.fits {
            if let Some(best) = fit.unconstrained.filter(|f| f.verdict != Verdict::Stable) {
                line(format!("  {}, best: {}", fit.key, describe_verdict(&self.elastic(best.law))));
            }
            if let Some(stable) = fit.stable {
                line(format!("  {}, stable: {}", fit.key, describe_verdict(&self.elastic(stable.law))));
            }
        }
        line(String::new());
        match best_stable(&self.fits).and_then(|f| f.stable) {
            Some(fit) => line(format!(
                "best stable law: {} ({}), rms {} kPa, {} % of the largest stress",
                fit.law.key(),
                constants(&fit.law),
                digits(fit.rms * 1e-3, 3),
                digits(fit.relative * 1e2, 3)
            )),
            None => {
                line("best stable law: none; the stress falls with the deformation, check signs and columns".into())
            }
        }
        if let Some(preset) = &self.preset {
            line(String::new());
            line(preset.clone());
        }
        for path in &self.written {
            line(format!("wrote {}", path.display()));
        }
        out.trim_end().into()
    }

    /// The same for programs.
    pub fn json(&self) -> String {
        let fit = |fit: Option<Fit>| match fit {
            None => Value::Null,
            Some(fit) => {
                let limit = match fit.verdict {
                    Verdict::StableBelow(limit) => json!({ "stretch_below": limit }),
                    Verdict::StableAbove(limit) => json!({ "stretch_above": limit }),
                    Verdict::Stable | Verdict::Unstable => Value::Null,
                };
                json!({
                    "constants": fit.law.constants().into_iter().collect::<std::collections::BTreeMap<_, _>>(),
                    "rms_kpa": fit.rms * 1e-3,
                    "rms_percent": fit.relative * 1e2,
                    "r2": finite(fit.r2),
                    "stable": fit.verdict == Verdict::Stable,
                    "stable_limit": limit,
                    "stable_within_data": fit.stable_within_data,
                    "verdict": describe_verdict(&self.elastic(fit.law)),
                })
            }
        };
        let laws: Vec<Value> = self
            .fits
            .iter()
            .map(|f| json!({ "law": f.key, "best": fit(f.unconstrained), "stable": fit(f.stable) }))
            .collect();
        let report = json!({
            "files": self.files,
            "points": self.curves.points.len(),
            "modes": self.modes().into_iter().map(Mode::key).collect::<Vec<_>>(),
            "principal_stretches": [self.principal_range().0, self.principal_range().1],
            "notes": self.curves.notes,
            "laws": laws,
            "best_stable": best_stable(&self.fits).map(|f| f.key),
            "preset": self.preset,
            "written": self.written.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
        });
        format!("{report:#}")
    }

    /// A `[[material]]` block of a library of presets.
    fn preset_text(&self, name: &str, options: &FitOptions) -> Result<String> {
        let chosen = match &options.law {
            None => best_stable(&self.fits).and_then(|f| f.stable),
            Some(law) => self.fits.iter().find(|f| f.key == law).and_then(|f| f.stable),
        };
        let Some(fit) = chosen else {
            return Err(Error::input(
                format!("{} has no stable constants for these points", options.law.as_deref().unwrap_or("no law")),
                "look at the table without --preset; check signs and columns, or choose another --law",
            ));
        };
        let law = self.elastic(fit.law);
        let text = |value: String| toml::Value::String(value).to_string();
        let modes = self.modes().into_iter().map(Mode::key).collect::<Vec<_>>().join(", ");
        let (low, high) = self.principal_range();
        let mut out = String::from("[[material]]\n");
        let mut line = |key: &str, value: String| {
            let _ = writeln!(out, "{key} = {value}");
        };
        line("name", text(name.into()));
        line("summary", text(format!("{} law fitted to {}", fit.law.key(), self.files.join(", "))));
        line(
            "source",
            text(format!(
                "stylet fit, {} in {modes}; rms error {} kPa, {} % of the largest stress, R2 {:.5}",
                counted(self.curves.points.len(), "point"),
                digits(fit.rms * 1e-3, 3),
                digits(fit.relative * 1e2, 3),
                fit.r2
            )),
        );
        line(
            "range",
            text(format!(
                "fitted at principal stretches {} to {}; stable for every deformation; mu0 {} kPa, E0 {} kPa, nu0 {}",
                digits(low, 3),
                digits(high, 3),
                digits(law.shear_modulus() * 1e-3, 4),
                digits(law.youngs_modulus() * 1e-3, 4),
                digits(law.poisson_ratio(), 4)
            )),
        );
        line("law", text(fit.law.key().into()));
        for (key, value) in fit.law.constants() {
            line(key, number(value));
        }
        match self.volumetric {
            Volumetric::PoissonRatio(nu) => line("poisson_ratio", number(nu)),
            Volumetric::BulkModulus(k) => line("bulk_modulus_kpa", number(k * 1e-3)),
        }
        line("density_kg_m3", number(options.density));
        Ok(out)
    }

    fn write(&mut self, folder: &Path, options: &FitOptions) -> Result<()> {
        let contents = [self.chart(folder)?, self.table()].into_iter().chain(self.preset.clone());
        let files: Vec<(PathBuf, String)> =
            file_names(options).iter().map(|name| folder.join(name)).zip(contents).collect();
        for (path, text) in files {
            whole_file::write(&path, text.as_bytes())?;
            self.written.push(path);
        }
        Ok(())
    }

    fn chart(&self, folder: &Path) -> Result<String> {
        let best = best_stable(&self.fits).map(|f| f.key);
        let title = format!("Elastic laws fitted to {}", self.files.join(", "));
        fit_chart(&title, &self.curves.points, &self.fits, best)
            .map_err(|reason| Error::file(folder.join(CHART), std::io::Error::other(format!("chart: {reason}"))))
    }

    /// Points and fits as CSV.
    fn table(&self) -> String {
        let mut out = String::from("mode,stretch_or_shear,weight,nominal_stress_kpa");
        for (key, variant, _) in self.variants() {
            let _ = write!(out, ",{key}_{variant}_kpa");
        }
        for point in &self.curves.points {
            let _ = write!(out, "\n{},{},{},{}", point.mode.key(), point.x, point.weight, number(point.stress * 1e-3));
            for (_, _, fit) in self.variants() {
                // An empty cell where a law has no such fit.
                let value = fit.map(|f| number(nominal_stress(&f.law, point.mode, point.x) * 1e-3));
                let _ = write!(out, ",{}", value.unwrap_or_default());
            }
        }
        out + "\n"
    }
}

/// Constants with names and units.
fn constants(law: &Isochoric) -> String {
    let constant = |(key, value): (&str, f64)| match key.strip_suffix("_kpa") {
        Some(name) => format!("{name} {} kPa", digits(value, 4)),
        None => format!("{key} {}", digits(value, 4)),
    };
    law.constants().into_iter().map(constant).collect::<Vec<_>>().join(", ")
}

fn short_verdict(fit: &Fit) -> String {
    let within = if fit.stable_within_data { "data inside" } else { "data outside" };
    match fit.verdict {
        Verdict::Stable => "stable".into(),
        Verdict::StableBelow(limit) => format!("limited: stretches < {}, {within}", digits(limit, 4)),
        Verdict::StableAbove(limit) => format!("limited: stretches > {}, {within}", digits(limit, 4)),
        Verdict::Unstable => "REFUSED: unstable at rest".into(),
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// A number for a file: six significant digits, always read back as a floating-point number.
fn number(value: f64) -> String {
    format!("{:?}", significant(value, 6))
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn names(files: &[PathBuf]) -> String {
    files.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}
