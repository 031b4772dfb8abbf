//! `stylet replay`: a recorded session without a window.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::{ended, until_ended};
use crate::ending;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::observables::FrameRecord;
use crate::output::{DrivenFace, OutputFolder, Tables};
use crate::session::{SESSION, Session};
use crate::simulation::{EngineChoice, Purpose, Simulation};
use crate::training::kinematic::Sample;
use crate::training::score::Score;

#[derive(Debug, Clone, Default, Args)]
pub struct ReplayArgs {
    /// A session.json that `stylet view` has written
    pub session: PathBuf,
    /// gpu or cpu; auto: the kind of engine that recorded it
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Folder of the results [default: the next out/<scene>/001, 002, ...]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    pub force: bool,
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct ReplayOutcome {
    pub folder: PathBuf,
    pub frames: u64,
    /// Largest axial force [N], and the largest energy imbalance, see [`crate::verdict`].
    pub largest_force: f64,
    pub imbalance: f64,
    /// Why the run is doubtful, see [`crate::verdict`].
    pub doubt: Option<String>,
    /// Simulated and wall time of the frames [s].
    pub simulated: f64,
    pub wall: f64,
    /// True where version, engine and adapter are those of the session: then the forces are the same bit for bit.
    pub same_place: bool,
    pub recorded_by: String,
    pub adapter: String,
}

/// The command: prints what came out.
///
/// # Errors
/// As [`replay`].
pub fn execute(args: &ReplayArgs) -> Result<u8> {
    until_ended();
    println!("{}", replay(args)?.text());
    Ok(ended("the tables go on to the last frame that was computed"))
}

/// Computes a session again and writes its tables.
///
/// # Errors
/// `Error::Input` for a session that is none or whose scene has changed; `Error::Diverged` where the guard stops the run, as it
/// did when it was recorded; what the folder cannot take.
pub fn replay(args: &ReplayArgs) -> Result<ReplayOutcome> {
    let session = Session::read(&session_file(&args.session))?;
    let scene = session.scene()?;
    let choice = match args.engine {
        EngineChoice::Auto => session.engine.parse().unwrap_or(EngineChoice::Gpu),
        chosen => chosen,
    };
    let device = match choice {
        EngineChoice::Cpu | EngineChoice::Cpu64 => None,
        EngineChoice::Gpu | EngineChoice::Auto => Some(Gpu::open()?),
    };
    let folder = OutputFolder::create(args.out.as_deref(), &scene.name, args.force)?;
    let mut simulation = Simulation::for_purpose(
        scene.clone(),
        device,
        Purpose { led: true, drawn: false, lanes: choice == EngineChoice::Cpu },
    )?;
    let info = simulation.engine().info().clone();
    let driven = DrivenFace::of_scene(&scene.faces, &simulation.model.mesh);
    let mut tables = Tables::create(&folder, &driven, simulation.model.has_bore(), &scene)?;
    let (begin, mut records) = (Instant::now(), Vec::new());
    let mut outcome = ReplayOutcome {
        folder: folder.path().to_path_buf(),
        frames: 0,
        largest_force: 0.0,
        imbalance: 0.0,
        doubt: None,
        simulated: 0.0,
        wall: 0.0,
        same_place: session.version == env!("CARGO_PKG_VERSION")
            && session.adapter == info.adapter
            && session.driver == info.driver,
        recorded_by: place(&session.version, &session.adapter),
        adapter: place(env!("CARGO_PKG_VERSION"), &info.adapter),
    };
    for (frame, pose) in (0..).zip(&session.poses) {
        if ending::is_asked() {
            break;
        }
        session.change(&mut simulation, frame)?;
        simulation.lead(pose);
        let record = match simulation.next_frame() {
            Ok(Some(record)) => record,
            Ok(None) | Err(Error::Ended(_)) => break,
            Err(error) => return Err(error),
        };
        tables.append(&record)?;
        records.push(record.clone());
        outcome.frames += 1;
        outcome.simulated = record.time;
        outcome.largest_force = outcome.largest_force.max(record.force.axial);
        outcome.imbalance = record.verdict.worst_imbalance;
        outcome.doubt = record.verdict.sentence();
    }
    outcome.wall = begin.elapsed().as_secs_f64();
    session.write(&folder.file(SESSION))?;
    // Half a session has no score.
    if ending::is_asked() {
        return Ok(outcome);
    }
    let sample = |record: &FrameRecord| {
        let pose = simulation.tool_pose(record.time)?;
        Some(Sample { time: record.time, tip: pose.tip, direction: pose.direction })
    };
    let samples: Vec<Sample> = records.iter().filter_map(sample).collect();
    if !samples.is_empty() {
        Score::of(&scene, &samples, &records, None)?.write(&folder)?;
    }
    Ok(outcome)
}

impl ReplayOutcome {
    fn text(&self) -> String {
        let same = match self.same_place {
            true => "the same bit for bit as recorded".to_string(),
            false => format!("recorded by {}, so within what adapters differ by", self.recorded_by),
        };
        let doubt = self.doubt.as_ref().map_or(String::new(), |why| format!("DOUBTFUL: {why}\n"));
        format!(
            "{doubt}{} frames, {:.2} s simulated in {:.2} s by {}: {same}\nlargest force {:.3} N; energy imbalance {:.2} %\n{}",
            self.frames,
            self.simulated,
            self.wall,
            self.adapter,
            self.largest_force,
            100.0 * self.imbalance,
            self.folder.display()
        )
    }
}

fn place(version: &str, adapter: &str) -> String {
    format!("stylet {version} on {adapter}")
}

/// A file of a folder or the file itself.
pub fn session_file(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(SESSION) } else { path.to_path_buf() }
}
