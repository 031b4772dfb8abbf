//! `stylet stability`: the hard cases, as a table or JSON.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::run::{EXIT_DIVERGED, EXIT_INTERRUPTED};
use crate::error::{Error, Result};
use crate::output::whole_file;
use crate::solver::simulation::EngineChoice;
use crate::stability::{self, Options, Suite};

/// Table and JSON in the folder of `--out`.
const TABLE: &str = "stability.txt";
const JSON: &str = "stability.json";

#[derive(Debug, Clone, Args)]
pub struct StabilityArgs {
    /// auto, gpu, cpu or both
    #[arg(long, default_value = "auto")]
    engine: Engines,
    /// Run this case only; may be given several times
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,
    /// Fewer steps and coarser cells: a minute instead of a quarter of an hour
    #[arg(long)]
    short: bool,
    /// Take away what cures each case, where a key of a scene can: every one must then fail
    #[arg(long)]
    without_cure: bool,
    /// List the cases, what they expect and what carries them, and run nothing
    #[arg(long, conflicts_with_all = ["only", "json", "out"])]
    list: bool,
    /// Print JSON instead of a table
    #[arg(long)]
    json: bool,
    /// Write stability.txt and stability.json into this folder, too
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the scenes [default: scenes]
    #[arg(long, value_name = "DIR")]
    scenes: Option<PathBuf>,
}

/// One engine, or one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engines {
    One(EngineChoice),
    Both,
}

impl FromStr for Engines {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "both" => Ok(Engines::Both),
            _ => EngineChoice::from_str(text)
                .map(Engines::One)
                .map_err(|_| format!("there is no engine `{text}`; use auto, gpu, cpu or both")),
        }
    }
}

/// Runs the suite. Returns what is to be printed, and the exit code: 0 where every case came out as it must, 3 where one
/// did not, 130 where Ctrl-C ended it.
///
/// # Errors
/// Wrong names and folders come before anything is run; `Error::Adapter` where the engine is not to be had.
pub fn stability(args: &StabilityArgs, interrupted: &AtomicBool) -> Result<(String, u8)> {
    if args.list {
        return Ok((stability::list(), 0));
    }
    let options = Options {
        only: args.only.clone(),
        short: args.short,
        without_cure: args.without_cure,
        scenes: args.scenes.clone(),
    };
    let cases = stability::chosen(&options)?;
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder).map_err(|reason| {
            Error::input(
                format!("cannot write to {}: {reason}", folder.display()),
                "give a folder that you may write to with --out",
            )
        })?;
    }
    let engines = match args.engine {
        Engines::One(engine) => vec![engine],
        Engines::Both => vec![EngineChoice::Gpu, EngineChoice::Cpu],
    };
    // Hidden where standard error is no terminal.
    let bar = ProgressBar::new((cases.len() * engines.len()) as u64);
    let style = ProgressStyle::with_template("{bar:10} {pos}/{len} {wide_msg}");
    bar.set_style(style.expect("the template is a constant that every run draws").progress_chars("=> "));
    let mut reports = Vec::new();
    for engine in engines {
        let mut before = |case: &stability::Case| {
            bar.set_message(format!("{} ({})", case.name, engine.key()));
            bar.tick();
            bar.inc(1);
        };
        let report = stability::run(&options, engine, &mut before, interrupted);
        if report.is_err() {
            bar.finish_and_clear();
        }
        reports.push(report?);
        if interrupted.load(Ordering::Relaxed) {
            break;
        }
    }
    bar.finish_and_clear();
    let suite = Suite::new(&options, reports);
    if let Some(folder) = &args.out {
        write(&suite, folder)?;
    }
    let code = match interrupted.load(Ordering::Relaxed) {
        true => EXIT_INTERRUPTED,
        false if suite.as_expected => 0,
        false => EXIT_DIVERGED,
    };
    Ok((if args.json { suite.json() } else { suite.table() }, code))
}

fn write(suite: &Suite, folder: &Path) -> Result<()> {
    whole_file::write(&folder.join(TABLE), (suite.table() + "\n").as_bytes())?;
    whole_file::write(&folder.join(JSON), (suite.json() + "\n").as_bytes())
}
