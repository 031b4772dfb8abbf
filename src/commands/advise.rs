//! `stylet advise`: settings with which a scene keeps real time on this machine, and the error to expect.

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;

use super::SceneArgs;
use super::report::moment;
use crate::effects::mass_scaling::{AUTO_MACH, Loading};
use crate::error::{Error, Result};
use crate::simulation::EngineChoice;
use crate::study::advice::{Candidate, best_in_real_time, speed};
use crate::study::analysis::Analysis;
use crate::study::plan::UnitCost;
use crate::study::runner::{measure_engine, predicted_factor};
use crate::study::store::{Store, default_folder};
use crate::study::subject::Subject;
use crate::study::{MeshSize, Settings};
use crate::units::{rounded, three_decimals, trimmed};

/// Wall time of the measurement of one mesh [s].
const MEASURED_S: f64 = 0.4;
/// Part of a frame that the steps may take: the rest is for drawing, and for a machine that drifts.
const SHARE: f64 = 0.8;
/// Edges that are tried without a study, over that of the scene.
const EDGES: [f64; 9] = [0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0];

#[derive(Debug, Clone, Default, Args)]
pub struct AdviseArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// auto, gpu, cpu or cpu64; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Ask for settings that keep real time
    #[arg(long)]
    pub real_time: bool,
    /// Frames per second
    #[arg(long, default_value_t = 60.0)]
    pub rate: f64,
    /// Folder of a study of the scene [default: out/study_<scene>, if it is there]
    #[arg(long)]
    pub study: Option<PathBuf>,
}

/// A proposal with what it rests on.
struct Proposal {
    settings: Settings,
    size: MeshSize,
    factor: f64,
    /// Of the force curve, from the study.
    error: Option<f64>,
    /// The mesh is that of the study's reference: the error holds no part of it.
    same_mesh: bool,
}

/// The command: prints the proposal.
///
/// # Errors
/// As [`advise`]; without what the settings are for.
pub fn execute(args: &AdviseArgs) -> Result<u8> {
    if !args.real_time {
        return Err(Error::input("advise needs to know what for", "ask for real time with --real-time"));
    }
    println!("{}", advise(args)?);
    Ok(0)
}

/// Measures this machine for about a second and proposes settings.
///
/// # Errors
/// Wrong options and scenes; a folder given by the user that holds no study.
pub fn advise(args: &AdviseArgs) -> Result<String> {
    if !(1.0..=1000.0).contains(&args.rate) {
        return Err(Error::input(
            format!("a rate of {} frames per second is none", args.rate),
            "give a number from 1 to 1000, e.g. --rate 60",
        ));
    }
    let subject = Subject::load(&args.scene.file, &args.scene.overrides, args.engine)?;
    let folder = default_folder(&subject.scene.name);
    let study = match &args.study {
        Some(folder) => Some(Store::existing(folder)?),
        None => Store::existing(&folder).ok(),
    };
    // What a frame costs beside its steps counts at the wanted rate.
    let at_rate: Vec<String> =
        args.scene.overrides.iter().cloned().chain([format!("solver.frame_rate_hz={:?}", args.rate)]).collect();
    let measured = Subject::load(&args.scene.file, &at_rate, args.engine)?;
    let cost = measure_engine(&measured, measured.base.engine, MEASURED_S)?;

    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |head: &str, text: String| {
        let _ = writeln!(out, "{head:<11} {text}");
    };
    let adapter = subject.adapter.as_deref().unwrap_or("the processor");
    line("scene", format!("{} ({})", subject.scene.name, args.scene.file.display()));
    line(
        "measured",
        format!(
            "{} on {adapter}, {:.1} s: {:.0} us per step and {:.1} ns per cell-step of wall time",
            subject.base.engine.describe(),
            2.0 * MEASURED_S,
            cost.step_s * 1e6,
            cost.cell_step_s * 1e9
        ),
    );
    let mut assumptions = vec![
        format!(
            "steps may take {:.0} % of a frame; the rest is for drawing and for a machine that drifts",
            100.0 * SHARE
        ),
        "the cost of a step on the way in is that of the first frames".to_string(),
    ];

    let usable = study.as_ref().map(|(store, plan)| {
        if plan.scene_hash != subject.scene_hash() {
            return Err(format!(
                "the study in {} is of another text of this scene; it is not used",
                store.path().display()
            ));
        }
        Analysis::read(store, plan).map_err(|error| error.to_string().lines().next().unwrap_or_default().to_string())
    });
    let command = study_command(args);
    let proposal = match usable {
        Some(Ok(analysis)) => {
            let last = analysis.rows.iter().map(|row| row.run.finished).max().unwrap_or(0);
            let reference = analysis.reference().map_or(String::new(), |row| row.settings.describe());
            let folder = study.as_ref().map_or(String::new(), |(store, _)| store.path().display().to_string());
            line("study", format!("{folder}, {}; errors are against {reference}", moment(last)));
            assumptions
                .push("only settings that the study ran are proposed; their errors are those measured there".into());
            of_study(&subject, &analysis, &cost, args.rate)
        }
        other => {
            match other {
                Some(Err(reason)) => line("study", reason),
                _ => line("study", format!("none of this scene in {}", folder.display())),
            }
            line("", format!("its errors are not known; this finds them: {command}"));
            assumptions.push(format!(
                "without a study: mass scaling so that the needle moves at {AUTO_MACH} of the shear wave speed or as the scene \
                 has it, whichever is more, and the finest mesh that keeps the rate"
            ));
            by_rule(&subject, &cost, args.rate)
        }
    };
    match proposal {
        Ok(p) => {
            for (head, text) in in_words(&p, args) {
                line(head, text);
            }
        }
        Err(reason) => line("proposal", reason),
    }
    for (number, text) in assumptions.into_iter().enumerate() {
        line(if number == 0 { "assumes" } else { "" }, text);
    }
    Ok(out.trim_end().to_string())
}

/// What is proposed, how fast and how good it is, and the command that runs it.
fn in_words(p: &Proposal, args: &AdviseArgs) -> [(&'static str, String); 4] {
    [
        ("proposal", p.settings.describe()),
        (
            "",
            format!(
                "{} cells, frames of {:.1} ms: {:.1} ms of steps, {}",
                p.size.cells,
                1e3 / args.rate,
                1e3 / args.rate / p.factor,
                speed(p.factor)
            ),
        ),
        (
            "error",
            match p.error {
                None => "not known without a study".into(),
                Some(e) if p.same_mesh => format!(
                    "{} % of the force over depth by mass scaling and step; that of the mesh is not known, it is the \
                     reference's own",
                    three_decimals(100.0 * e)
                ),
                Some(e) => format!("{} % of the force over depth", three_decimals(100.0 * e)),
            },
        ),
        (
            "run it",
            format!(
                "stylet run {}{} --engine {} --set tissue.cell_size_mm={} --set solver.mass_scaling={} --set \
                 solver.safety={} --set solver.frame_rate_hz={}",
                args.scene.file.display(),
                sets(&args.scene.overrides),
                p.settings.engine.key(),
                trimmed(p.settings.cell_size_mm),
                trimmed(p.settings.mass_scaling),
                trimmed(p.settings.safety),
                trimmed(args.rate)
            ),
        ),
    ]
}

/// The most accurate settings of the study that are predicted to keep the rate; else why there are none.
fn of_study(
    subject: &Subject,
    analysis: &Analysis,
    cost: &UnitCost,
    rate: f64,
) -> std::result::Result<Proposal, String> {
    let mut candidates: Vec<Candidate> = Vec::new();
    let mut sizes: Vec<MeshSize> = Vec::new();
    for candidate in analysis.candidates() {
        if candidate.settings.engine != subject.base.engine {
            continue;
        }
        let Ok(size) = subject.mesh_size(candidate.settings.cell_size_mm) else { continue };
        let real_time_factor = predicted_factor(size, &candidate.settings, cost, rate) * SHARE;
        candidates.push(Candidate { real_time_factor, ..candidate });
        sizes.push(size);
    }
    let fastest = candidates.iter().map(|c| c.real_time_factor / SHARE).fold(0.0, f64::max);
    // Of the reference's own mesh no error is known; it is proposed where nothing else is fast enough.
    let unjudged = || {
        let fast = candidates.iter().filter(|c| c.same_mesh && c.real_time_factor >= 1.0 && c.error.is_finite());
        fast.min_by(|a, b| a.error.total_cmp(&b.error))
    };
    match best_in_real_time(&candidates).or_else(unjudged) {
        Some(best) => {
            let place = candidates.iter().position(|c| c == best).unwrap_or(0);
            Ok(Proposal {
                settings: best.settings.clone(),
                size: sizes[place],
                factor: best.real_time_factor / SHARE,
                error: Some(best.error),
                same_mesh: best.same_mesh,
            })
        }
        None => Err(format!(
            "none: of the settings of the study the fastest is predicted at {}; give the study a coarser mesh with --set \
             tissue.cell_size_mm, or take a faster adapter",
            speed(fastest)
        )),
    }
}

/// Mass scaling by the speed of the tool, and the finest mesh that keeps the rate.
fn by_rule(subject: &Subject, cost: &UnitCost, rate: f64) -> std::result::Result<Proposal, String> {
    let scene = &subject.scene;
    let wave = (scene.material.law.shear_modulus() / scene.material.density).sqrt();
    let by_speed = Loading::of(Some(&scene.motion), &scene.faces, scene.tissue.size)
        .with_loads(&scene.loads, scene.tissue.size)
        .auto_factor(wave)
        .unwrap_or(1.0);
    // As many digits as the rule has.
    let by_speed = 100.0 * (by_speed / 100.0).floor();
    let mass_scaling = by_speed.max(subject.base.mass_scaling);
    let mut settings = Settings { mass_scaling, ..subject.base.clone() };
    if mass_scaling > 1.0 && !settings.effects.iter().any(|key| key == "mass_scaling") {
        settings.effects.insert(0, "mass_scaling".into());
    }
    let mut fastest: f64 = 0.0;
    let edges: &[f64] = if subject.has_block() { &EDGES } else { &[1.0] };
    for edge in edges {
        settings.cell_size_mm = rounded(edge * subject.base.cell_size_mm, 3);
        let Ok(size) = subject.mesh_size(settings.cell_size_mm) else { continue };
        let factor = predicted_factor(size, &settings, cost, rate);
        fastest = fastest.max(factor);
        if factor * SHARE >= 1.0 {
            return Ok(Proposal { settings, size, factor, error: None, same_mesh: false });
        }
    }
    Err(format!(
        "none: even the coarsest mesh tried is predicted at {}; take a faster adapter or a lower rate",
        speed(fastest)
    ))
}

fn sets(overrides: &[String]) -> String {
    overrides.iter().map(|set| format!(" --set {set}")).collect()
}

/// The study that would tell the errors.
fn study_command(args: &AdviseArgs) -> String {
    let engine = match args.engine {
        EngineChoice::Auto => String::new(),
        engine => format!(" --engine {}", engine.key()),
    };
    format!("stylet study {}{}{engine}", args.scene.file.display(), sets(&args.scene.overrides))
}
