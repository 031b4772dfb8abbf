//! Arguments of `stylet fit`.

use std::path::PathBuf;

use clap::Args;

use super::fit::{FitOptions, Volumetric, fit};
use crate::ending;
use crate::error::Result;

#[derive(Debug, Clone, Args)]
pub struct FitArgs {
    /// CSV files; columns `stretch`, `strain`, `strain_percent` or `shear`, a stress with its unit such as
    /// `nominal_stress_kpa` or `cauchy_stress_pa`, and optionally `mode` (tension, compression, uniaxial, equibiaxial,
    /// planar, shear) and `weight`
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Poisson's ratio of the preset; the curves do not tell it
    #[arg(long, default_value_t = 0.49, conflicts_with = "bulk_modulus_kpa")]
    poisson_ratio: f64,
    /// Bulk modulus of the preset instead of Poisson's ratio
    #[arg(long)]
    bulk_modulus_kpa: Option<f64>,
    /// Density of the preset
    #[arg(long, default_value_t = 1060.0)]
    density_kg_m3: f64,
    /// Print a preset of this name for a library of materials
    #[arg(long, value_name = "NAME")]
    preset: Option<String>,
    /// Law of the preset [default: the best stable one]
    #[arg(long, requires = "preset")]
    law: Option<String>,
    /// Folder for the chart fit.svg, the table fit.csv and the preset
    #[arg(long)]
    out: Option<PathBuf>,
    /// Replace the files that the folder holds
    #[arg(long)]
    force: bool,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// The command: prints the report.
///
/// # Errors
/// As [`fit`].
pub fn execute(args: FitArgs) -> Result<u8> {
    ending::watch();
    let volumetric = match args.bulk_modulus_kpa {
        Some(modulus) => Volumetric::BulkModulus(modulus * 1e3),
        None => Volumetric::PoissonRatio(args.poisson_ratio),
    };
    let report = fit(&FitOptions {
        files: args.files,
        volumetric,
        density: args.density_kg_m3,
        law: args.law,
        preset: args.preset,
        out: args.out,
        force: args.force,
    })?;
    println!("{}", if args.json { report.json() } else { report.text() });
    Ok(0)
}
