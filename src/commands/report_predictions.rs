//! `stylet report predictions`: published needle experiments beside the theory, as one page and a table. Nothing is run.

use std::path::PathBuf;

use super::report::{PREDICTIONS, ReportArgs, ReportOutcome};
use crate::error::{Error, Result};
use crate::output::report::predictions::{PAGE, TABLE, csv, page};
use crate::predictions::file;
use crate::simulation::EngineChoice;
use crate::whole_file;

/// Writes the page and the table into the folder.
///
/// # Errors
/// `Error::Scene` with every problem of the file of experiments; `Error::Input` where it cannot be read, where an option belongs to another
/// report, or where the folder takes no files.
pub fn report(args: &ReportArgs) -> Result<ReportOutcome> {
    let foreign = [
        ("--quick", args.quick),
        ("--set", !args.overrides.is_empty()),
        ("--scenes", args.scenes.is_some()),
        ("--engine", args.engine != EngineChoice::Auto),
    ];
    if let Some((option, _)) = foreign.iter().find(|(_, given)| *given) {
        return Err(Error::input(
            format!("{option} is of no use for the report {PREDICTIONS}, which runs nothing"),
            "leave it out; --data names a file of experiments",
        ));
    }
    let experiments = file::load(args.data.as_deref())?;
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("out/report_{PREDICTIONS}")));
    let mut command = format!("stylet report {PREDICTIONS}");
    if let Some(data) = &args.data {
        command += &format!(" --data {}", data.display());
    }
    let (page, table) = (page(&experiments, &command)?, csv(&experiments)?);
    let unusable = |reason: std::io::Error| {
        Error::input(
            format!("cannot write the report to {}: {reason}", out.display()),
            "give a folder that you may write to with --out",
        )
    };
    std::fs::create_dir_all(&out).map_err(unusable)?;
    let write = |name: &str, bytes: &[u8]| match whole_file::write(&out.join(name), bytes) {
        Err(Error::File { source, .. }) => Err(unusable(source)),
        other => other,
    };
    write(TABLE, &table)?;
    write(PAGE, page.as_bytes())?;
    Ok(ReportOutcome::Page { path: out.join(PAGE), failed: 0 })
}
