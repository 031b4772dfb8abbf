//! `stylet study`: runs a scene over mesh size, mass scaling, step, engine and effects, and writes one page on what accuracy
//! costs.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use super::report::moment;
use super::{SceneArgs, ended_between_runs, until_ended};
use crate::error::{Error, Result};
use crate::output::folder::safe_name;
use crate::output::progress::time_left;
use crate::simulation::EngineChoice;
use crate::study::analysis::Analysis;
use crate::study::plan::{Costs, LeftOut, Plan, PlannedRun, Role, shard};
use crate::study::store::{FIGURES, PAGE, RunRecord, Store, TABLE, default_folder};
use crate::study::subject::Subject;
use crate::study::{Axis, Engine, page, runner, tables};
use crate::whole_file;

/// Part of the budget that may be used before another spare run is begun and predicted to end.
const SPARE_SHARE: f64 = 0.95;

/// A study has fewer runs.
const MOST_PARTS: usize = 1000;

#[derive(Debug, Clone, Default, Args)]
pub struct StudyArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// auto, gpu, cpu or cpu64; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// What is varied, separated by commas: mesh, mass, step, engine, effects [default: all]
    #[arg(long, value_name = "LIST")]
    pub axes: Option<String>,
    /// Time that the study may take; it chooses mesh sizes and reference
    #[arg(long, value_name = "MINUTES", default_value_t = 20.0)]
    pub budget: f64,
    /// Folder of the runs and of the page [default: out/study_<scene>]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Finest cell edge that may be planned [mm]
    #[arg(long, value_name = "MM")]
    pub finest: Option<f64>,
    /// Run only part K of N, for another machine or job; join the parts with --merge
    #[arg(long, value_name = "K/N")]
    pub shard: Option<String>,
    /// Join the parts in these folders and write the page into --out
    #[arg(long, value_name = "DIR", num_args = 1.., conflicts_with = "shard")]
    pub merge: Vec<PathBuf>,
    /// Compute everything again, and replace the study that the folder holds
    #[arg(long)]
    pub force: bool,
}

/// How a study ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StudyOutcome {
    /// The page, what to choose, and what the page lacks.
    Page { path: PathBuf, sentences: Vec<String>, missing: usize },
    /// A part is finished; its folder.
    Part { part: String, folder: PathBuf, runs: usize, of: usize },
    /// Stopped by the user; finished runs stay.
    Interrupted { done: usize, of: usize },
}

/// The command: prints the path of the page, or the folder of a part.
///
/// # Errors
/// As [`study`] and [`merge`].
pub fn execute(args: &StudyArgs) -> Result<u8> {
    let outcome = match args.merge.is_empty() {
        true => study(args, until_ended())?,
        false => merge(&args.merge, args.out.as_ref(), args.force)?,
    };
    match outcome {
        StudyOutcome::Page { path, sentences, missing } => {
            for sentence in sentences {
                eprintln!("{sentence}");
            }
            if missing > 0 {
                eprintln!("note: {missing} planned runs are not there; the page lists them");
            }
            println!("{}", path.display());
            Ok(0)
        }
        StudyOutcome::Part { part, folder, runs, of } => {
            eprintln!(
                "part {part}: {runs} of the {of} runs are here; join all parts with: stylet study --merge DIR... --out DIR"
            );
            println!("{}", folder.display());
            Ok(0)
        }
        StudyOutcome::Interrupted { done, of } => Ok(ended_between_runs(done, of)),
    }
}

/// Runs what is missing and writes the page, the table and the figures into the folder.
///
/// # Errors
/// Wrong options, scenes and folders come before anything is run.
pub fn study(args: &StudyArgs, interrupted: &AtomicBool) -> Result<StudyOutcome> {
    let axes = args.axes.as_deref().map_or(Ok(Axis::ALL.to_vec()), Axis::list)?;
    if !(args.budget > 0.0 && args.budget.is_finite()) {
        return Err(Error::input(
            format!("a budget of {} minutes is none", args.budget),
            "give the minutes that the study may take, e.g. --budget 20",
        ));
    }
    if let Some(finest) = args.finest.filter(|finest| !(*finest > 0.0 && finest.is_finite())) {
        return Err(Error::input(
            format!("a finest edge of {finest} mm is none"),
            "give the edge of the finest cells in mm, e.g. --finest 0.4",
        ));
    }
    let part = args.shard.as_deref().map(parse_shard).transpose()?;
    let subject = Subject::load(&args.scene.file, &args.scene.overrides, args.engine)?;
    let name = safe_name(&subject.scene.name);
    let out = args.out.clone().unwrap_or_else(|| match part {
        None => default_folder(&subject.scene.name),
        Some((part, of)) => PathBuf::from(format!("out/study_{name}_part_{part}_of_{of}")),
    });
    let store = Store::open(&out, &subject.scene.name, args.force)?;
    let mut plan = plan(&store, &subject, &axes, args, part.is_some())?;
    tell_finished(&Row { store: &store, subject: &subject, plan: &plan, part: None, budget: 0.0, interrupted });
    if part.is_none()
        && let Done::Interrupted { done } = settle_reference(&store, &subject, &mut plan, interrupted)?
    {
        return Ok(StudyOutcome::Interrupted { done, of: plan.runs.len() });
    }
    let mine: Vec<&PlannedRun> = match part {
        None => plan.runs.iter().collect(),
        Some((part, of)) => shard(&plan.runs, part, of),
    };
    eprintln!(
        "{}: {} of {} runs, about {} on {}",
        plan.scene,
        mine.len(),
        plan.runs.len(),
        time_left(mine.iter().map(|run| run.predicted_s).sum()),
        subject.adapter.as_deref().unwrap_or("the processor")
    );
    // A part does as it is told: the budget is kept by the plan of the whole.
    let budget = if part.is_some() { f64::INFINITY } else { plan.budget_s };
    let label = part.map(|(part, of)| format!("{part}/{of}"));
    let row = Row { store: &store, subject: &subject, plan: &plan, part: label.as_deref(), budget, interrupted };
    let given_up = match row.run(&mine)? {
        Done::All(given_up) => given_up,
        Done::Interrupted { done } => return Ok(StudyOutcome::Interrupted { done, of: mine.len() }),
    };
    if let Some(part) = label {
        let runs = mine.len();
        return Ok(StudyOutcome::Part { part, folder: out, runs, of: plan.runs.len() });
    }
    if !given_up.is_empty() {
        plan.given_up.extend(given_up);
        // So that the same call gives up the same.
        store.write_plan(&plan)?;
    }
    // A machine that is faster than predicted has time for more.
    while let Some(place) = plan.spare.iter().position(|run| fits(&store, &plan, run)) {
        let run = plan.spare.remove(place);
        plan.runs.push(run.clone());
        store.write_plan(&plan)?;
        let row = Row { store: &store, subject: &subject, plan: &plan, part: None, budget, interrupted };
        if let Done::Interrupted { .. } = row.run(&[&run])? {
            let of = plan.runs.len();
            return Ok(StudyOutcome::Interrupted { done: of - 1 - plan.given_up.len(), of });
        }
    }
    write(&store, &plan, &command_line(args))
}

/// How many runs the folder holds.
fn tell_finished(row: &Row) {
    let finished = row.plan.runs.iter().filter(|run| row.finished(run).is_some()).count();
    if finished > 0 {
        eprintln!("{finished} of {} runs are finished already", row.plan.runs.len());
    }
}

/// Runs base and reference, and plans with a coarser one as long as the reference is not fit to be one: it may be the first
/// to be computed on a mesh that fine.
fn settle_reference(store: &Store, subject: &Subject, plan: &mut Plan, interrupted: &AtomicBool) -> Result<Done> {
    loop {
        let first: Vec<&PlannedRun> =
            plan.runs.iter().filter(|run| matches!(run.role, Role::Base | Role::Reference)).collect();
        let row = Row { store, subject, plan, part: None, budget: plan.budget_s, interrupted };
        if let Done::Interrupted { done } = row.run(&first)? {
            return Ok(Done::Interrupted { done });
        }
        let reference = plan.reference().and_then(|planned| store.run(&planned.id));
        let Some((run, reason)) = reference.and_then(|run| run.unfit().map(|reason| (run, reason))) else {
            return Ok(Done::All(Vec::new()));
        };
        eprintln!("{} is no reference: {reason}; a coarser one is taken", run.id);
        *plan = plan.with_coarser_reference(subject, reason, run.wall_s + run.setup_s)?;
        store.write_plan(plan)?;
    }
}

/// Time that the finished runs of the plan took, and that they were predicted to take [s].
fn pace(store: &Store, plan: &Plan) -> (f64, f64) {
    let finished = plan.runs.iter().filter_map(|planned| {
        let run = store.run(&planned.id).filter(|run| run.belongs_to(plan, &planned.settings))?;
        Some((run.wall_s + run.setup_s, planned.predicted_s))
    });
    finished.fold((0.0, 0.0), |sum, run| (sum.0 + run.0, sum.1 + run.1))
}

/// True where a run more keeps the budget at the pace of the runs so far.
fn fits(store: &Store, plan: &Plan, run: &PlannedRun) -> bool {
    let (spent, predicted) = pace(store, plan);
    predicted > 0.0 && plan.lost_s() + spent + spent / predicted * run.predicted_s <= SPARE_SHARE * plan.budget_s
}

/// Joins the parts of a study in one folder and writes the page.
///
/// # Errors
/// `Error::Input` where a folder holds no study, the studies are not parts of one, or none holds a finished run.
pub fn merge(folders: &[PathBuf], out: Option<&PathBuf>, force: bool) -> Result<StudyOutcome> {
    let Some(out) = out else {
        return Err(Error::input("--merge needs a folder for the whole", "name it with --out DIR"));
    };
    let parts = folders.iter().map(|folder| Store::existing(folder)).collect::<Result<Vec<_>>>()?;
    let Some((first, plan)) = parts.first() else {
        return Err(Error::input("--merge names no folder", "give the folders of the parts"));
    };
    for (store, other) in &parts[1..] {
        let (a, b) = (first.path().display(), store.path().display());
        let apart = |what: &str| format!("{a} and {b} are no parts of one study: {what}");
        let (message, way_out) = if other.scene_hash != plan.scene_hash || other.scene != plan.scene {
            (apart("their scenes or overrides differ"), "run all parts with the same scene file and the same --set")
        } else if other.version != plan.version {
            (apart("they are of different versions of the program"), "run all parts with one version")
        } else if other.axes != plan.axes || other.budget_s != plan.budget_s || other.base != plan.base {
            (
                apart("their axes, budgets or engines differ"),
                "run all parts with the same --axes, --budget and --engine",
            )
        } else if other.runs != plan.runs {
            (
                apart("their plans differ"),
                "make all parts with --shard, none without it, on machines with the same engines",
            )
        } else {
            continue;
        };
        return Err(Error::input(message, way_out));
    }
    let mut runs: Vec<RunRecord> = Vec::new();
    for planned in &plan.runs {
        let of_plan = |run: &RunRecord| run.belongs_to(plan, &planned.settings);
        runs.extend(parts.iter().find_map(|(store, _)| store.run(&planned.id).filter(of_plan)));
    }
    if runs.is_empty() {
        return Err(Error::input(
            "none of these folders holds a finished run",
            "run the parts first: stylet study SCENE --shard K/N --out DIR",
        ));
    }
    let plan = plan.clone();
    let store = Store::open(out, &plan.scene, force)?;
    store.write_plan(&plan)?;
    for run in &runs {
        store.write_run(run)?;
    }
    write(&store, &plan, "stylet study --merge DIR... --out DIR")
}

/// `K/N` with 1 <= K <= N.
fn parse_shard(text: &str) -> Result<(usize, usize)> {
    let parsed = text.split_once('/').and_then(|(part, of)| Some((part.parse().ok()?, of.parse().ok()?)));
    match parsed {
        Some((part, of)) if (1..=of).contains(&part) && of <= MOST_PARTS => Ok((part, of)),
        _ => Err(Error::input(
            format!("--shard {text} names no part"),
            "write K/N with K from 1 to N and N up to 1000, e.g. --shard 1/3, --shard 2/3 and --shard 3/3 for three parts",
        )),
    }
}

/// The plan that the folder holds, where it fits; else a new one, which is stored.
fn plan(store: &Store, subject: &Subject, axes: &[Axis], args: &StudyArgs, part: bool) -> Result<Plan> {
    let (budget, finest) = (60.0 * args.budget, args.finest.unwrap_or(0.0));
    let engines = &subject.engines;
    let old = store.plan()?;
    let current = |plan: &Plan| plan.scene_hash == subject.scene_hash() && plan.version == env!("CARGO_PKG_VERSION");
    let mut costs = None;
    if let Some(old) = old {
        if !current(&old) {
            eprintln!(
                "scene, overrides or version have changed since the study in {} was made",
                store.path().display()
            );
        } else {
            let fits = old.costs.measured != part && old.costs.engines.keys().eq(engines);
            let same = old.axes == axes && old.budget_s == budget && old.base == subject.base;
            if fits && same && old.asked_finest_mm == finest {
                return Ok(old);
            }
            costs = fits.then_some(old.costs);
        }
    }
    let costs = match costs {
        Some(costs) => costs,
        None if part => {
            let mut costs = Costs::assumed();
            costs.engines.retain(|engine, _| engines.contains(engine));
            costs
        }
        None => {
            eprintln!("measuring what a step costs here");
            runner::measure_costs(subject, engines)?
        }
    };
    let plan = Plan::new(subject, axes, budget, costs, finest)?;
    store.write_plan(&plan)?;
    Ok(plan)
}

/// How a row of runs ended.
enum Done {
    /// What was given up for the budget: the name of the run and the reason.
    All(Vec<LeftOut>),
    Interrupted {
        done: usize,
    },
}

/// What all runs of a call share.
struct Row<'a> {
    store: &'a Store,
    subject: &'a Subject,
    plan: &'a Plan,
    /// `K/N` of a part.
    part: Option<&'a str>,
    /// Wall time that all runs of the plan may take [s].
    budget: f64,
    interrupted: &'a AtomicBool,
}

impl Row<'_> {
    /// The finished run, if the folder holds it: of the same scene, settings and version, on the same adapter.
    fn finished(&self, planned: &PlannedRun) -> Option<RunRecord> {
        let here = |run: &RunRecord| {
            planned.settings.engine != Engine::Gpu || self.subject.adapter.as_deref() == Some(run.adapter.as_str())
        };
        let run = self.store.run(&planned.id)?;
        (run.hash == self.subject.hash(&planned.settings) && here(&run)).then_some(run)
    }

    /// Runs one after the other what the folder does not hold yet.
    fn run(&self, runs: &[&PlannedRun]) -> Result<Done> {
        let given_up = |run: &PlannedRun| self.plan.given_up.iter().any(|l| l.what == run.id);
        let mut left: f64 = runs.iter().map(|run| run.predicted_s).sum();
        let mut todo: Vec<&PlannedRun> = Vec::new();
        let mut finished = 0;
        for planned in runs {
            if self.finished(planned).is_some() {
                finished += 1;
            } else if !given_up(planned) {
                todo.push(planned);
                continue;
            }
            left -= planned.predicted_s;
        }
        let mut left_out = Vec::new();
        let bar = progress();
        for planned in todo {
            let (spent, predicted) = pace(self.store, self.plan);
            // How much slower than predicted this machine is.
            let pace = if predicted > 0.0 { (spent / predicted).clamp(0.2, 10.0) } else { 1.0 };
            let number = self.plan.runs.iter().position(|run| run.id == planned.id).unwrap_or(0) + 1;
            let place = format!("{number} of {}", self.plan.runs.len());
            let needed = matches!(planned.role, Role::Base | Role::Again | Role::Reference);
            if !needed && self.plan.lost_s() + spent + pace * planned.predicted_s > self.budget {
                let reason = format!(
                    "the budget: {} of it were used, and this would have taken about {}",
                    time_left(self.plan.lost_s() + spent),
                    time_left(pace * planned.predicted_s)
                );
                eprintln!("{place}, {}: left out, {reason}", planned.id);
                left -= planned.predicted_s;
                left_out.push(LeftOut { what: planned.id.clone(), reason });
                continue;
            }
            let what = self.plan.describe(planned);
            if bar.is_hidden() {
                eprintln!("{place}, {} left: {what}", time_left(pace * left));
            }
            let mut told = |part: f64| {
                bar.set_position((1000.0 * part) as u64);
                bar.set_message(format!(
                    "{place}  {} left  {what}",
                    time_left(pace * (left - part * planned.predicted_s))
                ));
            };
            told(0.0);
            let Some(run) = runner::run(self.subject, planned, self.part, self.interrupted, &mut told)? else {
                bar.finish_and_clear();
                return Ok(Done::Interrupted { done: finished });
            };
            if let Some(why) = &run.failure {
                bar.suspend(|| eprintln!("{place}, {}: {why}", planned.id));
            }
            self.store.write_run(&run)?;
            finished += 1;
            left -= planned.predicted_s;
        }
        bar.finish_and_clear();
        Ok(Done::All(left_out))
    }
}

/// The line on the terminal; indicatif hides it where standard error is none.
fn progress() -> ProgressBar {
    let bar = ProgressBar::new(1000);
    let style = ProgressStyle::with_template("{bar:10} {percent:>3}% {wide_msg}")
        .expect("the template is a constant that every study on a terminal draws");
    bar.set_style(style.progress_chars("=> "));
    bar
}

/// Page, table and figures of what is finished.
fn write(store: &Store, plan: &Plan, command: &str) -> Result<StudyOutcome> {
    let analysis = Analysis::read(store, plan)?;
    tables::write_csv(&store.file(TABLE), &analysis)?;
    tables::write_figures(&store.file(FIGURES), &analysis)?;
    let path = store.file(PAGE);
    // Of the last run, so that writing the page again changes nothing.
    let last = analysis.rows.iter().map(|row| row.run.finished).max().unwrap_or(0);
    whole_file::write(&path, page::page(&analysis, command, &moment(last))?.as_bytes())?;
    Ok(StudyOutcome::Page { path, missing: analysis.missing.len(), sentences: analysis.sentences })
}

/// The command line that makes the same page, without the folder.
fn command_line(args: &StudyArgs) -> String {
    let mut text = format!("stylet study {}", args.scene.file.display());
    if let Some(axes) = &args.axes {
        text += &format!(" --axes {axes}");
    }
    text += &format!(" --budget {}", args.budget);
    if let Some(finest) = args.finest {
        text += &format!(" --finest {finest}");
    }
    if args.engine != EngineChoice::Auto {
        text += &format!(" --engine {}", args.engine.key());
    }
    for set in &args.scene.overrides {
        text += &format!(" --set {set}");
    }
    text
}
