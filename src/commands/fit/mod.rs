//! `stylet fit`: constants of the elastic laws from measured curves.
//!
//! A file is a table with a header: `stretch`, `strain`, `strain_percent` or `shear`; one stress with its unit
//! (`stress_kpa`, `nominal_stress_pa`, `cauchy_stress_mpa`, ...); and, where wanted, `mode` and `weight`. In `compression`
//! both columns may hold magnitudes: where the compressive rows of a file add up to a positive strain or stress, that
//! column is turned round.

mod report;

use std::fs;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::material::Mode;
pub use crate::material::curves::Curves;
use crate::material::curves::{EXAMPLE, counted, read_curves};
use crate::material::fit::{Fit, LawFit, best_stable, fit_all, nominal_stress};
use crate::material::{ElasticLaw, Isochoric, LAWS, Verdict, describe_verdict};
use crate::output::fit_chart::fit_chart;
use crate::output::folder::probe;
use crate::scene::presets::bulk_modulus_from_poisson;
use crate::units::{digits, significant};
use crate::whole_file;

/// Names of the files in the folder `--out`.
pub const CHART: &str = "fit.svg";
pub const TABLE: &str = "fit.csv";

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
