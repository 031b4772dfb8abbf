//! `stylet report`: runs the scenes of a publication and writes one page with its numbers beside ours. `report predictions`, which runs
//! nothing, is in `report_predictions.rs`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use serde::{Deserialize, Serialize};

use super::report_skills::{self, SKILLS};
use super::run::{self, RunArgs};
use super::{ended_between_runs, report_predictions, until_ended};
use crate::error::{Error, Result};
use crate::output::Status;
use crate::output::report::CaseResults;
use crate::output::report::lv2022::{CASES, Case, Report, SCENES};
use crate::reading;
use crate::scene::Scene;
use crate::simulation::EngineChoice;
use crate::units::calendar;
use crate::whole_file;

/// The report that runs nothing.
pub const PREDICTIONS: &str = "predictions";

/// Names of the reports.
pub const NAMES: [&str; 3] = ["lv2022", PREDICTIONS, SKILLS];

/// Written beside the folders of the runs: what has been computed from which scene.
const LEDGER: &str = "report.json";

#[derive(Debug, Clone, Default, Args)]
pub struct ReportArgs {
    /// Which report: lv2022 (runs of the paper's cases), predictions (published needle forces beside the theory) or skills (synthetic
    /// trainees at a task)
    pub name: String,
    /// Folder of the runs and of the page [default: out/report_<NAME>, with --quick out/report_<NAME>_quick]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// auto, gpu, cpu or cpu64; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Coarse cells: a look at the page within seconds, no result
    #[arg(long)]
    pub quick: bool,
    /// Override a key of all scenes; the page says so
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Folder of the scenes [default: scenes/<NAME>]
    #[arg(long)]
    pub scenes: Option<PathBuf>,
    /// File of experiments for predictions [default: the built-in assets/predictions.toml]
    #[arg(long, value_name = "FILE")]
    pub data: Option<PathBuf>,
    /// Scene with a task for skills [default: scenes/training/avoid_vessel.toml]
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Attempts of all three levels for skills [default: 200]
    #[arg(long, value_name = "N")]
    pub attempts: Option<u64>,
    /// Seed of the trainees for skills
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Attempts at once for skills [default: one per core]
    #[arg(long, value_name = "N")]
    pub jobs: Option<usize>,
    /// Folder of evidence.toml and key_figures.toml, which skills brings up to date
    #[arg(long, value_name = "FOLDER")]
    pub evidence: Option<PathBuf>,
    /// Compute everything again, and replace what the folder holds
    #[arg(long)]
    pub force: bool,
}

/// How a report ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ReportOutcome {
    /// The page, and how many runs failed.
    Page { path: PathBuf, failed: usize },
    /// Stopped by the user; finished runs stay.
    Interrupted { done: usize, of: usize },
}

/// The ledger: finished runs by name.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Ledger {
    report: String,
    cases: BTreeMap<String, Finished>,
}

/// What a finished run was made from; another scene, override, engine or version makes it out of date.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
struct Finished {
    scene: String,
    overrides: Vec<String>,
    engine: String,
    version: String,
    /// Seconds since 1970-01-01, UTC.
    at: u64,
}

impl Finished {
    fn is_made_from(&self, other: &Finished) -> bool {
        Finished { at: 0, ..self.clone() } == Finished { at: 0, ..other.clone() }
    }
}

/// A case that is to be run, its scene read and checked.
struct Planned {
    case: Case,
    scene: Scene,
    made_from: Finished,
}

/// The command: prints the path of the page; the exit code of a page that shows failed runs is that of a stopped one.
///
/// # Errors
/// As [`report`].
pub fn execute(args: &ReportArgs) -> Result<u8> {
    match report(args, until_ended())? {
        ReportOutcome::Page { path, failed } => {
            println!("{}", path.display());
            if failed > 0 {
                eprintln!("error: {failed} of the runs failed; the page says why");
            }
            Ok(if failed > 0 { run::EXIT_DIVERGED } else { 0 })
        }
        ReportOutcome::Interrupted { done, of } => Ok(ended_between_runs(done, of)),
    }
}

/// Runs what is missing and writes the page `<name>.html` into the folder.
///
/// # Errors
/// Wrong names, folders and scenes come before anything is run. A run that diverges does not stop the others: the page
/// says so, and the outcome counts it.
pub fn report(args: &ReportArgs, interrupted: &AtomicBool) -> Result<ReportOutcome> {
    if !NAMES.contains(&args.name.as_str()) {
        return Err(Error::input(
            format!("there is no report `{}`", args.name),
            format!("write one of: {}", NAMES.join(", ")),
        ));
    }
    if args.name == SKILLS {
        return report_skills::report(args, interrupted);
    }
    let of_skills = [
        ("--scene", args.scene.is_some()),
        ("--attempts", args.attempts.is_some()),
        ("--jobs", args.jobs.is_some()),
        ("--evidence", args.evidence.is_some()),
    ];
    if let Some((option, _)) = of_skills.iter().find(|(_, given)| *given) {
        return Err(Error::input(
            format!("{option} is of no use for the report {}", args.name),
            format!("leave it out, or write stylet report {SKILLS}"),
        ));
    }
    if args.name == PREDICTIONS {
        return report_predictions::report(args);
    }
    if args.data.is_some() {
        return Err(Error::input(
            format!("--data is of no use for the report {}", args.name),
            format!("leave it out, or write stylet report {PREDICTIONS}"),
        ));
    }
    let planned = plan(args)?;
    let out = args.out.clone().unwrap_or_else(|| default_out(args));
    let mut ledger = open_ledger(&out, args, &planned)?;
    let mut cases = Vec::new();
    for (number, plan) in planned.iter().enumerate() {
        let place = format!("case {} of {}, {}", number + 1, planned.len(), plan.case.name);
        let results = match reusable(plan, &ledger, &out, &place) {
            Some(results) => results,
            None => {
                eprintln!("{place}: {}", plan.scene.title);
                ledger.cases.remove(plan.case.name);
                ledger.write(&out)?;
                match compute(plan, args.engine, &out, interrupted)? {
                    Some((results, made_from)) => {
                        if results.summary.status == Status::Ok {
                            ledger.cases.insert(plan.case.name.into(), made_from);
                            ledger.write(&out)?;
                        }
                        results
                    }
                    None => return Ok(ReportOutcome::Interrupted { done: cases.len(), of: planned.len() }),
                }
            }
        };
        cases.push((plan.case, results));
    }
    let failed = cases.iter().filter(|(_, results)| results.summary.status != Status::Ok).count();
    let mut overrides: Vec<String> = Vec::new();
    for text in planned.iter().flat_map(|plan| &plan.made_from.overrides) {
        if !overrides.contains(text) {
            overrides.push(text.clone());
        }
    }
    let page = Report { cases, overrides, quick: args.quick, command: command_line(args), written: moment(now()) };
    let path = out.join(format!("{}.html", args.name));
    whole_file::write(&path, page.page()?.as_bytes())?;
    Ok(ReportOutcome::Page { path, failed })
}

fn default_out(args: &ReportArgs) -> PathBuf {
    PathBuf::from(format!("out/report_{}{}", args.name, if args.quick { "_quick" } else { "" }))
}

/// Reads and checks the scenes of all cases.
fn plan(args: &ReportArgs) -> Result<Vec<Planned>> {
    let folder = args.scenes.clone().unwrap_or_else(|| PathBuf::from(SCENES));
    let mut planned = Vec::new();
    for case in CASES {
        let path = folder.join(format!("{}.toml", case.name));
        let quick = if args.quick { case.quick } else { Some(&[][..]) };
        let Some(quick) = quick else { continue };
        let text = match reading::text(&path, reading::most::SCENE) {
            Ok(text) => text,
            Err(reason) if reason.is_missing() && case.optional => continue,
            Err(reason) => {
                return Err(Error::input(
                    format!("cannot read the scene {}: {reason}", path.display()),
                    reason
                        .way_out("name the folder of the scenes with --scenes; without it the built-in ones are taken"),
                ));
            }
        };
        let overrides: Vec<String> = quick.iter().map(|o| o.to_string()).chain(args.overrides.clone()).collect();
        let scene = Scene::load(&path, &overrides)?;
        let made_from = Finished {
            scene: text,
            overrides,
            engine: args.engine.key().into(),
            version: env!("CARGO_PKG_VERSION").into(),
            at: 0,
        };
        planned.push(Planned { case, scene, made_from });
    }
    Ok(planned)
}

impl Ledger {
    fn write(&self, out: &Path) -> Result<()> {
        let path = out.join(LEDGER);
        let text = serde_json::to_string_pretty(self).map_err(|e| Error::file(&path, std::io::Error::other(e)))?;
        whole_file::write(&path, (text + "\n").as_bytes())
    }
}

/// What the folder holds already. A folder with results that no report made is refused unless `--force`.
fn open_ledger(out: &Path, args: &ReportArgs, planned: &[Planned]) -> Result<Ledger> {
    let new = Ledger { report: args.name.clone(), ..Default::default() };
    let path = out.join(LEDGER);
    let found = match reading::text(&path, reading::most::OWN) {
        Ok(text) => serde_json::from_str::<Ledger>(&text).ok().filter(|ledger| ledger.report == args.name),
        Err(unread) if unread.is_missing() => {
            // Without a ledger the folder is new, unless there are results.
            planned.iter().all(|plan| !out.join(plan.case.name).exists()).then(|| new.clone())
        }
        Err(_) => None,
    };
    let ledger = match found {
        _ if args.force => new,
        Some(ledger) => ledger,
        None => {
            return Err(Error::input(
                format!("folder {} holds results that are not those of the report {}", out.display(), args.name),
                "give another folder with --out, or replace the results with --force",
            ));
        }
    };
    let unusable = |reason: std::io::Error| {
        Error::input(
            format!("cannot write the report to {}: {reason}", out.display()),
            "give a folder that you may write to with --out",
        )
    };
    std::fs::create_dir_all(out).map_err(unusable)?;
    match ledger.write(out) {
        Err(Error::File { source, .. }) => Err(unusable(source)),
        Err(error) => Err(error),
        Ok(()) => Ok(ledger),
    }
}

/// Finished results of the same scene, if the folder holds them whole.
fn reusable(plan: &Planned, ledger: &Ledger, out: &Path, place: &str) -> Option<CaseResults> {
    let finished = ledger.cases.get(plan.case.name)?;
    if !finished.is_made_from(&plan.made_from) {
        eprintln!("{place}: scene, overrides, engine or version have changed since the results were made");
        return None;
    }
    let folder = out.join(plan.case.name);
    match CaseResults::read(plan.case.name, plan.scene.clone(), &folder, &moment(finished.at)) {
        Ok(results) if results.summary.status == Status::Ok => {
            eprintln!("{place}: results of {} reused", results.finished);
            Some(results)
        }
        Ok(_) => None,
        Err(reason) => {
            eprintln!("{place}: {reason}");
            None
        }
    }
}

/// Runs one case; `None`: interrupted.
fn compute(
    plan: &Planned,
    engine: EngineChoice,
    out: &Path,
    interrupted: &AtomicBool,
) -> Result<Option<(CaseResults, Finished)>> {
    let folder = out.join(plan.case.name);
    // What lies there is of a report: `open_ledger` has seen to it.
    let args = RunArgs { engine, out: Some(folder.clone()), force: true, ..RunArgs::default() };
    match run::run(plan.scene.clone(), &args, None, Instant::now(), interrupted) {
        Ok(outcome) if outcome.summary.status == Status::Interrupted => return Ok(None),
        Ok(outcome) => eprintln!("{}", run::describe(&outcome.summary)),
        // A failed run is a finding: its results stay, and the page tells why it ended.
        Err(error @ Error::Diverged { .. }) => eprintln!("error: {error}"),
        Err(error) => return Err(error),
    }
    let made_from = Finished { at: now(), ..plan.made_from.clone() };
    let results = CaseResults::read(plan.case.name, plan.scene.clone(), &folder, &moment(made_from.at))?;
    Ok(Some((results, made_from)))
}

/// The command line that makes the same page, without the folder.
fn command_line(args: &ReportArgs) -> String {
    let mut text = format!("stylet report {}", args.name);
    if args.quick {
        text += " --quick";
    }
    if args.engine != EngineChoice::Auto {
        text += &format!(" --engine {}", args.engine.key());
    }
    for set in &args.overrides {
        text += &format!(" --set {set}");
    }
    text
}

pub(super) fn now() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs())
}

/// `2022-03-01 14:05 UTC` from seconds since 1970.
pub(crate) fn moment(seconds: u64) -> String {
    let [year, month, day, hour, minute, _] = calendar(seconds);
    format!("{year}-{month:02}-{day:02} {hour:02}:{minute:02} UTC")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_in_words() {
        for (seconds, words) in [
            (0, "1970-01-01 00:00 UTC"),
            (951_782_400, "2000-02-29 00:00 UTC"),
            (1_646_143_500, "2022-03-01 14:05 UTC"),
            (4_107_542_399, "2100-02-28 23:59 UTC"),
            (4_107_542_400, "2100-03-01 00:00 UTC"),
        ] {
            assert_eq!(moment(seconds), words);
        }
    }
}
