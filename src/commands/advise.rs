//! `stylet advise`: settings with which a scene keeps real time on this machine, and the error to expect.

use std::fmt::Write;
use std::path::PathBuf;

use super::report::moment;
use crate::effects::mass_scaling::{AUTO_MACH, Loading};
use crate::error::{Error, Result};
use crate::output::folder::safe_name;
use crate::simulation::EngineChoice;
use crate::study::advice::{Candidate, best_in_real_time, speed};
use crate::study::analysis::Analysis;
use crate::study::plan::UnitCost;
use crate::study::runner::{measure_engine, predicted_factor};
use crate::study::store::Store;
use crate::study::subject::Subject;
use crate::study::{MeshSize, Settings};
use crate::units::{rounded, three_decimals, trimmed};

/// Wall time of the measurement of one mesh [s].
const MEASURED_S: f64 = 0.4;
/// Part of a frame that the steps may take: the rest is for drawing, and for a machine that drifts.
const SHARE: f64 = 0.8;
/// Edges that are tried without a study, over that of the scene.
const EDGES: [f64; 9] = [0.5, 0.6, 0.7, 0.85, 1.0, 1.2, 1.4, 1.7, 2.0];

/// What the command line says.
#[derive(Debug, Clone, Default)]
pub struct AdviseOptions {
    pub scene: PathBuf,
    pub overrides: Vec<String>,
    pub engine: EngineChoice,
    /// Frames per second.
    pub rate: f64,
    /// Folder of a study of the scene; `None`: `out/study_<scene>`, if it is there.
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

/// Measures this machine for about a second and proposes settings.
///
/// # Errors
/// Wrong options and scenes; a folder given by the user that holds no study.
pub fn advise(options: &AdviseOptions) -> Result<String> {
    if !(1.0..=1000.0).contains(&options.rate) {
        return Err(Error::input(
            format!("a rate of {} frames per second is none", options.rate),
            "give a number from 1 to 1000, e.g. --rate 60",
        ));
    }
    let subject = Subject::load(&options.scene, &options.overrides, options.engine)?;
    let folder = PathBuf::from(format!("out/study_{}", safe_name(&subject.scene.name)));
    let study = match &options.study {
        Some(folder) => Some(Store::existing(folder)?),
        None => Store::existing(&folder).ok(),
    };
    // What a frame costs beside its steps counts at the wanted rate.
    let at_rate: Vec<String> =
        options.overrides.iter().cloned().chain([format!("solver.frame_rate_hz={:?}", options.rate)]).collect();
    let measured = Subject::load(&options.scene, &at_rate, options.engine)?;
    let cost = measure_engine(&measured, measured.base.engine, MEASURED_S)?;

    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut line = |head: &str, text: String| {
        let _ = writeln!(out, "{head:<11} {text}");
    };
    let adapter = subject.adapter.as_deref().unwrap_or("the processor");
    line("scene", format!("{} ({})", subject.scene.name, options.scene.display()));
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
    let command = study_command(options);
    let proposal = match usable {
        Some(Ok(analysis)) => {
            let last = analysis.rows.iter().map(|row| row.run.finished).max().unwrap_or(0);
            let reference = analysis.reference().map_or(String::new(), |row| row.settings.describe());
            let folder = study.as_ref().map_or(String::new(), |(store, _)| store.path().display().to_string());
            line("study", format!("{folder}, {}; errors are against {reference}", moment(last)));
            assumptions
                .push("only settings that the study ran are proposed; their errors are those measured there".into());
            of_study(&subject, &analysis, &cost, options.rate)
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
            by_rule(&subject, &cost, options.rate)
        }
    };
    match proposal {
        Ok(p) => {
            line("proposal", p.settings.describe());
            line(
                "",
                format!(
                    "{} cells, frames of {:.1} ms: {:.1} ms of steps, {}",
                    p.size.cells,
                    1e3 / options.rate,
                    1e3 / options.rate / p.factor,
                    speed(p.factor)
                ),
            );
            line(
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
            );
            line(
                "run it",
                format!(
                    "stylet run {}{} --engine {} --set tissue.cell_size_mm={} --set solver.mass_scaling={} --set \
                     solver.safety={} --set solver.frame_rate_hz={}",
                    options.scene.display(),
                    sets(&options.overrides),
                    p.settings.engine.key(),
                    trimmed(p.settings.cell_size_mm),
                    trimmed(p.settings.mass_scaling),
                    trimmed(p.settings.safety),
                    trimmed(options.rate)
                ),
            );
        }
        Err(reason) => line("proposal", reason),
    }
    for (number, text) in assumptions.into_iter().enumerate() {
        line(if number == 0 { "assumes" } else { "" }, text);
    }
    Ok(out.trim_end().to_string())
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
    let by_speed = Loading::of(Some(&scene.motion), &scene.faces, scene.tissue.size).auto_factor(wave).unwrap_or(1.0);
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
fn study_command(options: &AdviseOptions) -> String {
    let engine = match options.engine {
        EngineChoice::Auto => String::new(),
        engine => format!(" --engine {}", engine.key()),
    };
    format!("stylet study {}{}{engine}", options.scene.display(), sets(&options.overrides))
}
