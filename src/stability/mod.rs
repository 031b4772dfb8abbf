//! The stability suite: hard cases, each with numbers that must hold, and the same cases without what cures them, which
//! must then fail.
//!
//! A case is a scene of `scenes/hard`, run once or several times with overrides, and an expectation: it survives with its
//! energy in balance and no cell inverted at the end, it is stopped by a guard that says why, or it is refused before it
//! starts. `prepare` holds what a scene cannot say (inverted cells, slivers, steps in parts of the critical one), `measure`
//! the answers that single cases must give.

mod cases;
mod measure;
mod prepare;
pub mod random;
mod report;
mod run;
mod trace;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::engine::State;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::scene::Scene;
use crate::simulation::{EngineChoice, Simulation};
use crate::{Error, Result};

pub use cases::CASES;
pub use report::{CaseReport, EngineReport, RunReport, Suite, list};
pub use trace::Trace;

/// Folder of the scenes.
pub const SCENES: &str = "scenes";

/// One hard case.
#[derive(Debug, Clone, Copy)]
pub struct Case {
    /// Name on the command line and in the table, at most 13 characters.
    pub name: &'static str,
    /// What is hard about it, at most 22 characters.
    pub hard: &'static str,
    /// File below the folder of the scenes.
    pub scene: &'static str,
    /// Overrides of the short form.
    pub short: &'static [&'static str],
    /// In order; the case holds where all of them do.
    pub parts: &'static [Part],
    /// Largest over smallest answer of the parts, less one, that may be; `None`: they are not compared.
    pub spread: Option<f64>,
    pub cure: Cure,
}

/// One run of a case.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// Which of several; empty where there is one only.
    pub label: &'static str,
    pub overrides: &'static [&'static str],
    pub setup: Setup,
    /// What happens to the program in the middle of the run.
    pub interruption: Option<Interruption>,
    /// How the energy of its frames is compared.
    pub balance: Balance,
    pub expected: Expected,
    pub answer: Option<Answer>,
}

/// What happens to the program in the middle of a run. It goes on from a checkpoint, and must give the records of a run
/// without it, bit for bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interruption {
    /// Stopped, written as bytes, and resumed by a new simulation.
    Paused,
    /// The device is lost some frames after the checkpoint; the engine must say so. On the CPU engine there is none, and the
    /// simulation is thrown away.
    DeviceLost,
}

/// How the energy of a run is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Balance {
    /// In every frame, with the work done and the energy at the start; over the larger of the two.
    Frames,
    /// Mean over the last tenth of the run with that over the first, for bodies that swing freely: velocities belong to half
    /// steps, so that the sum of one frame swings by some omega dt, and its mean does not.
    Means,
}

/// What a scene cannot say.
#[derive(Debug, Clone, Copy)]
pub struct Setup {
    /// Mesh instead of the block of the scene.
    pub mesh: Option<fn(&Scene) -> Mesh>,
    /// Last change of the scene, on its mesh.
    pub scene: Option<fn(&mut Scene, &Mesh)>,
    /// State before the first step.
    pub state: Option<fn(&Model, &mut State)>,
}

impl Setup {
    /// The scene as it is written.
    pub const NONE: Setup = Setup { mesh: None, scene: None, state: None };
}

/// How a run must end.
#[derive(Debug, Clone, Copy)]
pub enum Expected {
    /// By itself, with no cell inverted in the last frame and at most this part of the energy lost or created.
    Survives { imbalance: f64 },
    /// Stopped by a guard, with an error that contains this text.
    Caught(&'static str),
    /// Refused before it starts, with an error that contains this text.
    Refused(&'static str),
}

/// A number that a surviving run must give.
#[derive(Debug, Clone, Copy)]
pub struct Answer {
    /// With its unit.
    pub what: &'static str,
    pub of: fn(&mut Simulation, &Trace) -> Result<f64>,
    pub at_least: f64,
    pub at_most: f64,
}

/// What carries the case, and whether it can be taken away.
#[derive(Debug, Clone, Copy)]
pub enum Cure {
    /// Overrides that take it away; the case must fail with them.
    Switch {
        /// At most 22 characters.
        what: &'static str,
        overrides: &'static [&'static str],
    },
    /// What it is; no key of a scene switches it off.
    Fixed(&'static str),
}

/// What the command line says, but for the engine.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Names of the cases; empty: all.
    pub only: Vec<String>,
    pub short: bool,
    /// Run the cases whose cure can be taken away, without it.
    pub without_cure: bool,
    /// Folder of the scenes; `None`: that of the repository.
    pub scenes: Option<PathBuf>,
}

/// The cases that the options name, in the order of [`CASES`].
///
/// # Errors
/// `Error::Input` for a name that no case has.
pub fn chosen(options: &Options) -> Result<Vec<&'static Case>> {
    for name in &options.only {
        if !CASES.iter().any(|case| case.name == name) {
            let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
            return Err(Error::input(
                format!("there is no stability case `{name}`"),
                format!("write one of: {}", names.join(", ")),
            ));
        }
    }
    let wanted = |case: &&Case| options.only.is_empty() || options.only.iter().any(|name| name == case.name);
    let curable = |case: &&Case| !options.without_cure || matches!(case.cure, Cure::Switch { .. });
    Ok(CASES.iter().filter(wanted).filter(curable).collect())
}

/// Runs the chosen cases on one engine. `before` is told each case before it starts; `interrupted` ends the suite after the
/// frame under way, with the cases that are done.
///
/// # Errors
/// `Error::Input` where a scene file is missing, `Error::Adapter` where the engine is not to be had. A case that fails is
/// no error.
pub fn run(
    options: &Options,
    engine: EngineChoice,
    before: &mut dyn FnMut(&Case),
    interrupted: &AtomicBool,
) -> Result<EngineReport> {
    let folder = options.scenes.clone().unwrap_or_else(|| PathBuf::from(SCENES));
    let cases = chosen(options)?;
    for case in &cases {
        let path = folder.join(case.scene);
        if !path.is_file() && !crate::reading::is_built_in(&path) {
            return Err(Error::input(
                format!("there is no scene {}", path.display()),
                "name the folder of the scenes with --scenes; without it the built-in ones are taken",
            ));
        }
    }
    let mut report = EngineReport::new(engine, options);
    for case in cases {
        before(case);
        match run::case(case, options, &folder, engine, interrupted)? {
            Some((result, info)) => report.add(result, info),
            None => break,
        }
    }
    report.interrupted = interrupted.load(Ordering::Relaxed);
    Ok(report)
}
