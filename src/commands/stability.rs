//! `stylet stability`: the hard cases, as a table or JSON.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::run::EXIT_DIVERGED;
use crate::error::{Error, Result};
use crate::simulation::EngineChoice;
use crate::stability::random::{self, RandomOptions, SceneReport};
use crate::stability::{self, Options, Suite};
use crate::whole_file;

/// Table and JSON in the folder of `--out`.
const TABLE: &str = "stability.txt";
const JSON: &str = "stability.json";

#[derive(Debug, Clone, Args)]
pub struct StabilityArgs {
    /// auto, gpu, cpu, cpu64 or both (gpu and cpu64)
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
    /// Run N random scenes instead of the hard cases; --only takes their indices
    #[arg(long, value_name = "N", conflicts_with_all = ["short", "without_cure", "list", "scenes"])]
    random: Option<u64>,
    /// Seed of the random scenes [default: a fresh one, which is printed]
    #[arg(long, value_name = "S", requires = "random")]
    seed: Option<u64>,
    /// Folder for the random scenes that end other than ok
    #[arg(long, value_name = "FOLDER", requires = "random")]
    keep: Option<PathBuf>,
}

/// One engine, or one after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Engines {
    One(EngineChoice),
    Both,
}

impl Engines {
    fn choices(self) -> Vec<EngineChoice> {
        match self {
            Engines::One(engine) => vec![engine],
            Engines::Both => vec![EngineChoice::Gpu, EngineChoice::Cpu64],
        }
    }
}

impl FromStr for Engines {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "both" => Ok(Engines::Both),
            _ => EngineChoice::from_str(text)
                .map(Engines::One)
                .map_err(|_| format!("there is no engine `{text}`; use auto, gpu, cpu, cpu64 or both")),
        }
    }
}

/// Runs the suite. Returns what is to be printed, and the exit code: 0 where every case came out as it must, 3 where one
/// did not, 130 where Ctrl-C ended it.
///
/// # Errors
/// Wrong names and folders come before anything is run; `Error::Adapter` where the engine is not to be had.
pub fn stability(args: &StabilityArgs, interrupted: &AtomicBool) -> Result<(String, u8)> {
    if let Some(count) = args.random {
        return random_scenes(args, count, interrupted);
    }
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
    make_folder(args)?;
    let engines = args.engine.choices();
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
        true => crate::ending::exit_code(),
        false if suite.as_expected => 0,
        false => EXIT_DIVERGED,
    };
    Ok((if args.json { suite.json() } else { suite.table() }, code))
}

/// Random scenes: a line for each as it ends, then the rates. The exit code is 3 where one ended as none may.
fn random_scenes(args: &StabilityArgs, count: u64, interrupted: &AtomicBool) -> Result<(String, u8)> {
    let index = |text: &String| {
        text.parse().map_err(|_| {
            Error::input(format!("`{text}` is no index of a random scene"), "write --only 17, a number from 0 on")
        })
    };
    let options = RandomOptions {
        count,
        seed: args.seed.unwrap_or_else(random::fresh_seed),
        only: args.only.iter().map(index).collect::<Result<_>>()?,
        engines: args.engine.choices(),
        keep: args.keep.clone(),
    };
    make_folder(args)?;
    eprintln!("seed {}", options.seed);
    let mut before = |index: u64| log::debug!("random scene {index}");
    let mut after = |scene: &SceneReport| eprintln!("{}", scene.line());
    let report = random::run(&options, &mut before, &mut after, interrupted)?;
    let text = match args.json {
        true => serde_json::to_string_pretty(&report).expect("numbers and texts can be written as JSON"),
        false => report.table(),
    };
    if let Some(folder) = &args.out {
        let name = if args.json { JSON } else { TABLE };
        whole_file::write(&folder.join(name), (text.clone() + "\n").as_bytes())?;
    }
    let code = match report.interrupted {
        true => crate::ending::exit_code(),
        false if report.problems().is_empty() => 0,
        false => EXIT_DIVERGED,
    };
    Ok((text, code))
}

/// The folder of --out, before anything is run.
fn make_folder(args: &StabilityArgs) -> Result<()> {
    let Some(folder) = &args.out else { return Ok(()) };
    std::fs::create_dir_all(folder).map_err(|reason| {
        Error::input(
            format!("cannot write to {}: {reason}", folder.display()),
            "give a folder that you may write to with --out",
        )
    })
}

fn write(suite: &Suite, folder: &Path) -> Result<()> {
    whole_file::write(&folder.join(TABLE), (suite.table() + "\n").as_bytes())?;
    whole_file::write(&folder.join(JSON), (suite.json() + "\n").as_bytes())
}
