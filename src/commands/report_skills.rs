//! `stylet report skills`: attempts of synthetic trainees through the simulator, and which figures of their scores tell the levels apart.
//!
//! Every finished attempt is a line of its own in the folder, so that an interrupted report goes on where it was.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use serde::{Deserialize, Serialize};

use super::report::{ReportArgs, ReportOutcome};
use crate::error::{Error, Result};
use crate::output::checkpoint::fingerprint;
use crate::output::folder::safe_name;
use crate::reading;
use crate::scene::Scene;
use crate::session::Session;
use crate::simulation::EngineChoice;
use crate::training::skill::{Aim, Level};
use crate::training::skill_evidence::{self, Evidence, Subject, TaskEvidence};
use crate::training::skill_page::{csv, page};
use crate::training::skill_run::{Outcome, attempt};
use crate::whole_file;

/// Name of the report.
pub const SKILLS: &str = "skills";

/// Scene where none is named.
const SCENE: &str = "scenes/training/avoid_vessel.toml";

/// Attempts of all levels where nothing is said.
const ATTEMPTS: u64 = 200;

const PLAN: &str = "plan.json";
const ROWS: &str = "attempts.jsonl";
/// Folder of the sessions of attempts that guard or verdict refused.
const REFUSED: &str = "refused";
/// The table of all tasks, and the key figures that follow from it.
const EVIDENCE: &str = "evidence.toml";
const KEY_FIGURES: &str = "key_figures.toml";

/// What the rows of a folder were made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Plan {
    scene: String,
    overrides: Vec<String>,
    fingerprint: u64,
    seed: u64,
    version: String,
}

/// `avoid_vessel`.
fn stem(scene: &Scene) -> String {
    scene.path.file_stem().map_or_else(|| scene.name.clone(), |name| name.to_string_lossy().into_owned())
}

/// Runs the attempts that are missing and writes page, table and figures.
///
/// # Errors
/// `Error::Input` for an option of another report, a scene that no trainee can do, or a folder of other attempts.
pub fn report(args: &ReportArgs, interrupted: &AtomicBool) -> Result<ReportOutcome> {
    let foreign = [
        ("--quick", args.quick),
        ("--scenes", args.scenes.is_some()),
        ("--data", args.data.is_some()),
        ("--engine", !matches!(args.engine, EngineChoice::Auto | EngineChoice::Cpu)),
    ];
    if let Some((option, _)) = foreign.iter().find(|(_, given)| *given) {
        return Err(Error::input(
            format!("{option} is of no use for the report {SKILLS}, whose attempts run on the processor"),
            "leave it out; --attempts says how many there are, --scene which task",
        ));
    }
    let path = args.scene.clone().unwrap_or_else(|| PathBuf::from(SCENE));
    let scene = Scene::load(&path, &args.overrides)?;
    Aim::of(&scene)?;
    let stem = stem(&scene);
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from(format!("out/report_{SKILLS}_{}", safe_name(&stem))));
    let plan = Plan {
        scene: stem.clone(),
        overrides: args.overrides.clone(),
        fingerprint: fingerprint(&scene),
        seed: args.seed,
        version: env!("CARGO_PKG_VERSION").into(),
    };
    let done = open(&out, &plan, args.force)?;
    let wanted = args.attempts.unwrap_or(ATTEMPTS);
    let outcomes = run(&scene, args, &out, done, wanted, interrupted)?;
    if (outcomes.len() as u64) < wanted {
        return Ok(ReportOutcome::Interrupted { done: outcomes.len(), of: wanted as usize });
    }
    let task = scene.task.as_ref().map_or("", |task| &task.name);
    let subject = Subject { scene: &stem, overrides: &args.overrides, task, seed: args.seed };
    let evidence = TaskEvidence::of(subject, &outcomes);
    let path = write(&out, &evidence, &outcomes, &command_line(args))?;
    if let Some(folder) = &args.evidence {
        keep(folder, evidence)?;
    }
    // An attempt that was refused is a finding of the page, not a run of the report that failed.
    Ok(ReportOutcome::Page { path, failed: 0 })
}

/// Writes the page and its tables.
fn write(out: &Path, evidence: &TaskEvidence, outcomes: &[Outcome], command: &str) -> Result<PathBuf> {
    let lost: Vec<String> = outcomes.iter().filter(|o| !o.is_scored()).map(in_words).collect();
    let json = serde_json::to_string_pretty(evidence).map_err(|e| Error::file(out, std::io::Error::other(e)))?;
    whole_file::write(&out.join("skills.csv"), &csv(outcomes)?)?;
    whole_file::write(&out.join("skills.json"), (json + "\n").as_bytes())?;
    let path = out.join("skills.html");
    whole_file::write(&path, page(evidence, &lost, command).as_bytes())?;
    Ok(path)
}

/// Why an attempt is not scored, and where its session is.
fn in_words(o: &Outcome) -> String {
    let why = o.stopped.clone().unwrap_or_else(|| o.reasons.join("; "));
    format!("{} {}: {why} ({REFUSED}/{})", o.level.key(), o.index, session_name(o.level, o.index))
}

fn session_name(level: Level, index: u64) -> String {
    format!("{}_{index}.json", level.key())
}

/// The attempts that a folder holds already.
fn open(out: &Path, plan: &Plan, force: bool) -> Result<Vec<Outcome>> {
    let unusable = |reason: std::io::Error| {
        Error::input(
            format!("cannot write the report to {}: {reason}", out.display()),
            "give a folder that you may write to with --out",
        )
    };
    std::fs::create_dir_all(out).map_err(unusable)?;
    let path = out.join(PLAN);
    let found = match reading::text(&path, reading::most::OWN) {
        Ok(text) => serde_json::from_str::<Plan>(&text).ok(),
        Err(unread) if unread.is_missing() && !out.join(ROWS).exists() => Some(plan.clone()),
        Err(_) => None,
    };
    let mut rows = Vec::new();
    if found.as_ref() == Some(plan) && !force {
        rows = read_rows(&out.join(ROWS))?;
    } else if !force {
        return Err(Error::input(
            format!("folder {} holds attempts at another scene, seed or version", out.display()),
            "give another folder with --out, or replace the attempts with --force",
        ));
    }
    let text = serde_json::to_string_pretty(plan).map_err(|e| Error::file(&path, std::io::Error::other(e)))?;
    whole_file::write(&path, (text + "\n").as_bytes())?;
    // A line that was cut off goes.
    let lines: Result<Vec<String>> = rows.iter().map(line).collect();
    whole_file::write(&out.join(ROWS), lines?.concat().as_bytes())?;
    Ok(rows)
}

fn line(outcome: &Outcome) -> Result<String> {
    let text = serde_json::to_string(outcome).map_err(|e| Error::input(e.to_string(), "report this as a defect"))?;
    Ok(text + "\n")
}

/// The rows of a file; the last may be cut off.
fn read_rows(path: &Path) -> Result<Vec<Outcome>> {
    let text = match reading::text(path, reading::most::OWN) {
        Ok(text) => text,
        Err(unread) if unread.is_missing() => return Ok(Vec::new()),
        Err(unread) => return Err(unread.of(path, "give another folder with --out")),
    };
    let lines: Vec<&str> = text.lines().collect();
    let mut rows = Vec::with_capacity(lines.len());
    for (n, line) in lines.iter().enumerate() {
        match serde_json::from_str(line) {
            Ok(row) => rows.push(row),
            Err(_) if n + 1 == lines.len() => {}
            Err(reason) => {
                return Err(Error::input(
                    format!("{}:{}: no attempt: {reason}", path.display(), n + 1),
                    "take the line out, or begin anew with --force",
                ));
            }
        }
    }
    Ok(rows)
}

/// Runs what is missing of `wanted` attempts, the levels in turn; sorted by level and index.
fn run(
    scene: &Scene,
    args: &ReportArgs,
    out: &Path,
    done: Vec<Outcome>,
    wanted: u64,
    interrupted: &AtomicBool,
) -> Result<Vec<Outcome>> {
    let who = |n: u64| (Level::ALL[(n % 3) as usize], n / 3);
    let has = |(level, index): (Level, u64)| done.iter().any(|o| o.level == level && o.index == index);
    let missing: Vec<(Level, u64)> = (0..wanted).map(who).filter(|who| !has(*who)).collect();
    let path = out.join(ROWS);
    let file = File::options().append(true).open(&path).map_err(|e| Error::file(&path, e))?;
    let kept = Mutex::new((file, done));
    let next = AtomicUsize::new(0);
    let jobs = args.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from)).max(1);
    let work = || -> Result<()> {
        // An attempt alone would have all cores, and win little: several at once have one each.
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|e| Error::input(e.to_string(), "run fewer at once with --jobs"))?;
        while let Some((level, index)) = missing.get(next.fetch_add(1, Ordering::Relaxed)).copied() {
            let found = pool.install(|| attempt(scene, &args.overrides, (level, args.seed, index), interrupted))?;
            let Some((outcome, session)) = found else { return Ok(()) };
            if !outcome.is_scored() {
                keep_session(out, &outcome, &session)?;
                eprintln!("not scored: {}", in_words(&outcome));
            }
            let mut kept = kept.lock().unwrap_or_else(|e| e.into_inner());
            kept.0.write_all(line(&outcome)?.as_bytes()).map_err(|e| Error::file(&path, e))?;
            kept.1.push(outcome);
            if kept.1.len() % 10 == 0 {
                eprintln!("{} of {wanted} attempts", kept.1.len());
            }
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..jobs).map(|_| scope.spawn(work)).collect();
        workers.into_iter().try_for_each(|worker| match worker.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        })
    })?;
    let (_, mut outcomes) = kept.into_inner().unwrap_or_else(|e| e.into_inner());
    let belongs = |o: &Outcome| 3 * o.index + (o.level as u64) < wanted;
    outcomes.retain(belongs);
    outcomes.sort_by_key(|o| (o.level, o.index));
    Ok(outcomes)
}

fn keep_session(out: &Path, outcome: &Outcome, session: &Session) -> Result<()> {
    let folder = out.join(REFUSED);
    std::fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
    session.write(&folder.join(session_name(outcome.level, outcome.index)))
}

/// Puts the evidence of a task into the table of all tasks, and writes the key figures that follow.
fn keep(folder: &Path, evidence: TaskEvidence) -> Result<()> {
    let path = folder.join(EVIDENCE);
    let mut all: Evidence = match reading::text(&path, reading::most::TABLE) {
        Ok(text) => toml::from_str(&text).map_err(|reason| {
            Error::input(
                format!("{}: {reason}", path.display()),
                "mend the file, or name another folder with --evidence",
            )
        })?,
        Err(unread) if unread.is_missing() => Evidence::default(),
        Err(unread) => return Err(unread.of(&path, "name another folder with --evidence")),
    };
    all.task.retain(|task| task.scene != evidence.scene);
    all.task.push(evidence);
    all.task.sort_by(|a, b| a.scene.cmp(&b.scene));
    let head = "# Written by `stylet report skills --evidence`: which figures tell levels of skill apart, see docs/skills.md.\n\n";
    let text = toml::to_string(&all).map_err(|e| Error::input(e.to_string(), "report this as a defect"))?;
    whole_file::write(&path, (head.to_string() + &text).as_bytes())?;
    keep_key_figures(&folder.join(KEY_FIGURES), &all)
}

/// Tasks without evidence keep the key figures that they have, and so do kinds of tasks.
fn keep_key_figures(path: &Path, all: &Evidence) -> Result<()> {
    let unusable = |reason: String| {
        Error::input(format!("{}: {reason}", path.display()), "mend the file, or name another folder with --evidence")
    };
    let mut document: toml_edit::DocumentMut = match reading::text(path, reading::most::TABLE) {
        Ok(text) => text.parse().map_err(|e: toml_edit::TomlError| unusable(e.to_string()))?,
        Err(unread) if unread.is_missing() => toml_edit::DocumentMut::new(),
        Err(unread) => return Err(unread.of(path, "name another folder with --evidence")),
    };
    let tasks = document.entry("task").or_insert_with(|| toml_edit::Item::Table(Default::default()));
    let Some(tasks) = tasks.as_table_mut() else { return Err(unusable("`task` is no table".into())) };
    for evidence in all.task.iter().filter(|evidence| evidence.key_figures.len() == skill_evidence::KEY_FIGURES) {
        let figures: toml_edit::Array = evidence.key_figures.iter().map(String::as_str).collect();
        tasks.insert(&evidence.task, toml_edit::value(figures));
    }
    whole_file::write(path, document.to_string().as_bytes())
}

/// The command line that makes the same page, without the folder.
fn command_line(args: &ReportArgs) -> String {
    let mut text = format!("stylet report {SKILLS}");
    if let Some(scene) = &args.scene {
        text += &format!(" --scene {}", scene.display());
    }
    for set in &args.overrides {
        text += &format!(" --set {set}");
    }
    text + &format!(" --attempts {} --seed {}", args.attempts.unwrap_or(ATTEMPTS), args.seed)
}
