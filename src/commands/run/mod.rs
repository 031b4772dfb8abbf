//! `stylet run`: from a scene to a folder of results.

mod clock;
mod error_bar;
mod trouble;
mod words;

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use clap::Args;

use self::clock::Clock;
use self::error_bar::Beside;
pub use self::words::describe;
use self::words::reason_of;
use super::SceneArgs;
use crate::ending;
use crate::engine::EngineInfo;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::observables::FrameRecord;
use crate::output::checkpoint::{RunCheckpoint, fingerprint};
use crate::output::forensics::FORENSICS;
use crate::output::{
    CurveFigures, DrivenFace, FieldFiles, OutputFolder, PictureMoment, Progress, Status, Summary, Tables,
    TargetFigures, folder, volumes, write_force_chart, write_parts_chart, write_sample_chart,
};
use crate::process;
use crate::reading;
use crate::render;
use crate::scene::Scene;
use crate::simulation::checkpoint::Checkpoint;
use crate::simulation::{EngineChoice, Simulation};

#[derive(Debug, Clone, Default, Args)]
pub struct RunArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// auto, gpu, cpu or cpu64; WGPU_BACKEND and WGPU_ADAPTER_NAME choose the adapter
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Folder of the results [default: the next out/<scene>/001, 002, ...]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    pub force: bool,
    /// Seconds of wall time between two checkpoints; 0: only where the run is stopped
    #[arg(long, value_name = "SECONDS", default_value_t = 30.0)]
    pub checkpoint: f64,
    /// A doubtful run exits with 3, as one that is stopped
    #[arg(long)]
    pub strict: bool,
    /// Print by which bounds a run is ok, doubtful or stopped
    #[arg(long)]
    pub explain: bool,
    /// Run a companion with twice the cell edge beside it, and put a band around the force
    #[arg(long)]
    pub error_bar: bool,
    /// Choose cell edge and mass scaling for this error of the force, e.g. 5%, at the least time; with the error bar
    #[arg(long, value_name = "ERROR", conflicts_with = "resume")]
    pub error: Option<String>,
    /// Order of the error in the cell edge that the band counts with, where that is decided: observed, or the assumed one.
    #[arg(skip)]
    pub order: Option<Option<f64>>,
    /// Go on with the run in this folder, which was stopped; scene and overrides are those of the run
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["out", "force", "overrides"])]
    pub resume: Option<PathBuf>,
}

impl RunArgs {
    /// Seconds of wall time between two checkpoints; `None`: none are written.
    fn checkpoint_every(&self) -> Option<f64> {
        (self.checkpoint > 0.0).then_some(self.checkpoint)
    }

    /// Those of the run in this folder, which goes on.
    fn of_resumed(&self, folder: &Path, checkpoint: &RunCheckpoint) -> Self {
        let mut args = self.clone();
        args.engine = match (self.engine, checkpoint.simulation.engine.engine()) {
            (EngineChoice::Auto, wrote) => wrote.parse().unwrap_or_default(),
            (chosen, _) => chosen,
        };
        args.out = Some(folder.to_path_buf());
        args.scene.overrides = checkpoint.overrides.clone();
        (args.error_bar, args.order) = (args.error_bar || checkpoint.error_bar.is_some(), checkpoint.error_bar);
        args
    }
}

/// What a run left behind.
#[derive(Debug, Clone)]
pub struct RunOutcome {
    pub folder: PathBuf,
    pub summary: Summary,
}

/// A moment at which the scene wants a picture, a field file or volumes.
#[derive(Debug, Clone, Copy)]
struct Moment {
    frame: u64,
    picture: Option<PictureMoment>,
    field: bool,
    /// Volumes for the patient.
    volumes: Option<PictureMoment>,
}

/// Frames between two images that a run keeps in memory, to go back to when something goes wrong.
const IMAGE_FRAMES: u64 = 10;
/// Images that are kept.
const IMAGES: usize = 3;

/// A run under way: the simulation and what it has written.
struct Run<'a> {
    args: &'a RunArgs,
    scene: Scene,
    simulation: Simulation,
    beside: Option<Beside>,
    info: EngineInfo,
    device: Option<Gpu>,
    output: OutputFolder,
    driven: Vec<DrivenFace>,
    tables: Tables,
    fields: FieldFiles,
    moments: Vec<Moment>,
    records: Vec<FrameRecord>,
    cells_in_needle: Option<u64>,
    clock: Clock,
    /// The simulation a little ago, oldest first.
    images: VecDeque<Checkpoint>,
    /// The one before the run became doubtful.
    before_doubt: Option<Checkpoint>,
    halvings: u32,
}

/// The command: runs, or goes on with a run that was stopped, and prints its folder.
///
/// # Errors
/// Of what was asked for; a run that fails has said why, and its exit code is returned.
pub fn execute(args: &RunArgs, start: Instant) -> Result<u8> {
    if args.explain {
        println!("{}", crate::verdict::explain().trim_end());
        return Ok(0);
    }
    if !(args.checkpoint >= 0.0 && args.checkpoint.is_finite()) {
        return Err(Error::input(
            format!("--checkpoint {} is no time", args.checkpoint),
            "write the seconds between two checkpoints, e.g. 30, or 0 for none",
        ));
    }
    let asked = ending::watch();
    let outcome = match &args.resume {
        Some(folder) => {
            let checkpoint = RunCheckpoint::of_run(folder)?;
            let args = args.of_resumed(folder, &checkpoint);
            run(checkpoint.load_scene()?, &args, Some(&checkpoint), start, asked)
        }
        None => {
            let chosen = args.error.as_deref().map(|error| error_bar::choose(error, args, asked)).transpose()?;
            let args = chosen.as_ref().unwrap_or(args);
            run(args.scene.load()?, args, None, start, asked)
        }
    };
    let code = exit_code(&outcome, args.strict);
    match outcome {
        Ok(outcome) => {
            eprintln!("{}", describe(&outcome.summary));
            println!("{}", outcome.folder.display());
        }
        Err(error) if code == 2 => return Err(error),
        Err(error) => eprintln!("error: {error}"),
    }
    Ok(code)
}

/// Simulates the scene and writes everything that it asks for; with `resumed` it goes on with the run in the folder `out`.
/// `program_start` is when the process began, `interrupted` ends the run cleanly with what is there.
///
/// # Errors
/// The input errors of [`Simulation::new`] and of the output folder come before anything is written. A run that fails
/// half-way writes all results up to there, with the reason in `summary.json`, and returns the error.
pub fn run(
    scene: Scene,
    args: &RunArgs,
    resumed: Option<&RunCheckpoint>,
    program_start: Instant,
    interrupted: &AtomicBool,
) -> Result<RunOutcome> {
    for notice in &scene.notices {
        eprintln!("note: {notice}");
    }
    let mut run = Run::new(scene, args, resumed)?;
    let progress = Progress::new(run.simulation.duration());
    let course = run.follow(&progress, program_start, interrupted);
    progress.finish();
    run.close(course)
}

/// How the frames of a run went.
struct Course {
    status: Status,
    failure: Option<Error>,
    first_step_ms: Option<f64>,
    /// Notices of the simulation that were told.
    told: usize,
}

impl<'a> Run<'a> {
    /// Prepares the simulation, then the folder; goes to where a resumed run was.
    fn new(scene: Scene, args: &'a RunArgs, resumed: Option<&RunCheckpoint>) -> Result<Self> {
        let mut simulation = Simulation::new(scene, args.engine)?;
        let scene = simulation.model.scene.clone();
        let mut beside = args.error_bar.then(|| Beside::of(&simulation, args)).transpose()?;
        // From here on there is something to keep.
        ending::begin();
        let resumed = resumed.zip(args.out.as_deref());
        let output = match resumed {
            Some((checkpoint, out)) => {
                simulation.resume(&checkpoint.simulation)?;
                OutputFolder::reopen(out)?
            }
            None => OutputFolder::create(args.out.as_deref(), &scene.name, args.force)?,
        };
        let info = simulation.engine().info().clone();
        eprintln!("{}: {} on {} ({})", scene.name, info.engine, info.adapter, info.driver);
        let driven = DrivenFace::of_scene(&scene.faces, &simulation.model.mesh);
        let mut records = resumed.map_or(Vec::new(), |(checkpoint, _)| checkpoint.records.clone());
        if let Some(beside) = &mut beside {
            beside.follow(&mut records);
        }
        let hollow = simulation.model.has_bore();
        let tables = Tables::with_band(&output, &driven, hollow, &scene, &records, beside.is_some())?;
        let mut run = Run {
            moments: moments(&simulation),
            fields: FieldFiles::new(&output).naming(material_names(&scene)),
            device: simulation.device().cloned(),
            clock: Clock::start((0.0, Some(0.0))),
            records,
            cells_in_needle: None,
            images: VecDeque::new(),
            before_doubt: None,
            halvings: 0,
            args,
            scene,
            simulation,
            beside,
            info,
            output,
            driven,
            tables,
        };
        if let Some((checkpoint, _)) = resumed {
            eprintln!("going on at {:.3} s", checkpoint.records.last().map_or(0.0, |r| r.time));
            if checkpoint.adapter != run.info.adapter {
                eprintln!(
                    "note: the run began on {}; on another adapter the numbers go on alike, not bit for bit",
                    checkpoint.adapter
                );
            }
            let written = checkpoint.fields.clone();
            run.fields = FieldFiles::resumed(&run.output, written).naming(material_names(&run.scene));
            run.cells_in_needle = checkpoint.cells_in_needle;
            run.clock = Clock::start((checkpoint.wall, checkpoint.cpu));
        }
        run.plan_stops();
        run.keep_image()?;
        Ok(run)
    }

    /// All frames, with the checkpoints between them.
    fn follow(&mut self, progress: &Progress, program_start: Instant, interrupted: &AtomicBool) -> Course {
        let mut told = 0;
        let mut first_step_ms = None;
        let mut status = Status::Ok;
        let mut failure = None;
        // Frame after which a checkpoint is written, when the last one was, and whether the run ends with it.
        let (mut due, mut written, mut ending) = (None, Instant::now(), false);
        let mut checkpoint_every = self.args.checkpoint_every();
        loop {
            if interrupted.load(Ordering::Relaxed) && !ending {
                ending = true;
                due = Some(self.simulation.stop_soon());
            }
            for notice in &self.simulation.notices[told..] {
                eprintln!("note: {notice}");
            }
            told = self.simulation.notices.len();
            let frame = match self.advance(progress) {
                Ok(Some(frame)) => frame,
                Ok(None) => break,
                // The frame under way takes long: the run is kept up to the newest image.
                Err(Error::Ended(_)) => {
                    (failure, status) = (self.keep_newest_image().err(), Status::Interrupted);
                    break;
                }
                Err(error) => match self.recover(error) {
                    Ok(()) => {
                        (due, told) = (None, 0);
                        continue;
                    }
                    Err(error) => {
                        failure = Some(error);
                        break;
                    }
                },
            };
            first_step_ms.get_or_insert_with(|| program_start.elapsed().as_secs_f64() * 1e3);
            if due == Some(frame) {
                match self.write_checkpoint() {
                    Ok(()) => {}
                    // What a run goes on from is worth less than the run itself.
                    Err(error @ Error::File { .. }) if !ending => {
                        self.tell_of_no_checkpoint(&error);
                        checkpoint_every = None;
                    }
                    Err(error) => {
                        failure = Some(error);
                        break;
                    }
                }
                (due, written) = (None, Instant::now());
                if ending {
                    status = Status::Interrupted;
                    break;
                }
            } else if due.is_none() && checkpoint_every.is_some_and(|s| written.elapsed().as_secs_f64() >= s) {
                due = Some(self.simulation.stop_soon());
            }
        }
        if let Some(error) = &failure {
            status = Status::Failed(error.to_string());
        }
        Course { status, failure, first_step_ms, told }
    }

    /// Writes the results, and tells what there is to tell of them.
    fn close(self, course: Course) -> Result<RunOutcome> {
        for notice in &self.simulation.notices[course.told..] {
            eprintln!("note: {notice}");
        }
        let Course { status, failure, first_step_ms, .. } = course;
        let folder = self.output.path().to_path_buf();
        let interrupted = status == Status::Interrupted;
        let checkpoint = self.output.file(folder::CHECKPOINT);
        let (reached, of) = (self.records.last().map_or(0.0, |r| r.time), self.simulation.duration());
        // Results come first where there is little room: a checkpoint takes what they leave.
        let full = matches!(failure, Some(Error::File { .. })) && !checkpoint.exists();
        let newest = self.images.back().filter(|_| full).cloned().map(|image| self.checkpoint(image));
        let (summary, missing) = self.finish(status, first_step_ms);
        if let Some(newest) = newest
            && let Err(error) = newest.write(&checkpoint)
        {
            eprintln!(
                "note: no checkpoint could be written either, so the run cannot go on from here: {}",
                reason_of(&error)
            );
        }
        // What stopped the run comes first, then what of its results could not be written.
        let mut errors = failure.into_iter().chain(missing);
        let first = errors.next();
        for error in errors {
            eprintln!("warning: {error}");
        }
        if interrupted {
            eprintln!(
                "stopped by {} at {reached:.3} s of {of:.3} s: results and a checkpoint are in {}",
                ending::reason(),
                folder.display()
            );
        }
        if (interrupted || matches!(first, Some(Error::File { .. }))) && checkpoint.exists() {
            eprintln!("go on with: stylet run --resume {}", folder.display());
        }
        match first {
            Some(error) => {
                eprintln!("results up to the failure are in {}", folder.display());
                Err(error)
            }
            None => Ok(RunOutcome { folder, summary }),
        }
    }

    /// Starts the tables anew with these records.
    fn keep_records(&mut self, mut records: Vec<FrameRecord>) -> Result<()> {
        if let Some(beside) = &mut self.beside {
            self.clock.aside(|| beside.follow(&mut records));
        }
        let hollow = self.simulation.model.has_bore();
        let band = self.beside.is_some();
        self.tables = Tables::with_band(&self.output, &self.driven, hollow, &self.scene, &records, band)?;
        self.records = records;
        Ok(())
    }

    /// Tells the simulation after which frames its state will be read.
    fn plan_stops(&mut self) {
        let images = (0..self.simulation.frame_count()).step_by(IMAGE_FRAMES as usize);
        for frame in self.moments.iter().map(|m| m.frame).chain(images) {
            self.simulation.stop_after(frame);
        }
    }

    /// One frame with all that is due at its end; its number, `None` after the last one.
    fn advance(&mut self, progress: &Progress) -> Result<Option<u64>> {
        let Some(mut record) = self.simulation.next_frame()? else { return Ok(None) };
        if let Some(beside) = &mut self.beside {
            record.force_error = self.clock.aside(|| beside.error_of(&record));
        }
        self.tables.append(&record)?;
        progress.update(&record, record.time / self.clock.here().max(1e-9));
        let frame = record.frame;
        if !record.verdict.is_ok() && self.before_doubt.is_none() {
            self.before_doubt = self.images.front().cloned();
        }
        self.records.push(record);
        for moment in self.moments.iter().filter(|m| m.frame == frame) {
            let record = &self.records[self.records.len() - 1];
            let (simulation, output, fields) = (&mut self.simulation, &self.output, &mut self.fields);
            let device = self.device.as_ref();
            let inside = self.clock.aside(|| write_moment(simulation, record, moment, output, fields, device))?;
            // The most of all moments; `None` is less than any number.
            self.cells_in_needle = self.cells_in_needle.max(inside.map(|n| n as u64));
        }
        if frame % IMAGE_FRAMES == 0 {
            self.keep_image()?;
        }
        Ok(Some(frame))
    }

    fn keep_image(&mut self) -> Result<()> {
        if self.images.back().is_some_and(|newest| newest.frames == self.records.len() as u64) {
            return Ok(());
        }
        let simulation = &mut self.simulation;
        let image = self.clock.aside(|| simulation.checkpoint())?;
        if self.images.len() == IMAGES {
            self.images.pop_front();
        }
        self.images.push_back(image);
        Ok(())
    }

    /// The run as it was at the end of `simulation.frames` frames.
    fn checkpoint(&self, simulation: Checkpoint) -> RunCheckpoint {
        RunCheckpoint {
            version: env!("CARGO_PKG_VERSION").into(),
            scene: reading::from_everywhere(&self.scene.path),
            overrides: self.args.scene.overrides.clone(),
            fingerprint: fingerprint(&self.scene),
            adapter: self.info.adapter.clone(),
            records: self.records[..simulation.frames as usize].to_vec(),
            cells_in_needle: self.cells_in_needle,
            error_bar: self.beside.as_ref().map(|beside| beside.order),
            fields: self.fields.written().to_vec(),
            wall: self.clock.wall(),
            cpu: self.clock.cpu(),
            simulation,
        }
    }

    fn write_checkpoint(&mut self) -> Result<()> {
        self.keep_image()?;
        let Some(image) = self.images.back().cloned() else { return Ok(()) };
        let (checkpoint, path) = (self.checkpoint(image), self.output.file(folder::CHECKPOINT));
        self.clock.aside(|| checkpoint.write(&path))
    }

    /// Says that a checkpoint within the run could not be written, and that no other is tried before its end.
    fn tell_of_no_checkpoint(&self, error: &Error) {
        let time = self.records.last().map_or(0.0, |r| r.time);
        let kept = match self.output.file(folder::CHECKPOINT).exists() {
            true => "the one before is kept",
            false => "there is none",
        };
        eprintln!(
            "note: no checkpoint could be written at {time:.3} s: {}; {kept}, the run goes on without",
            reason_of(error)
        );
    }

    /// Writes the newest image as checkpoint.
    fn keep_newest_image(&self) -> Result<()> {
        let Some(image) = self.images.back().cloned() else { return Ok(()) };
        self.checkpoint(image).write(&self.output.file(folder::CHECKPOINT))
    }

    /// Writes charts and summary; returns what could not be written. The checkpoint of a run that has ended well is removed once
    /// all is written.
    fn finish(mut self, status: Status, first_step_ms: Option<f64>) -> (Summary, Vec<Error>) {
        let status = match (status, self.simulation.verdict().sentence()) {
            (Status::Ok, Some(why)) => Status::Doubtful(why),
            (status, _) => status,
        };
        let advice = matches!(status, Status::Doubtful(_)).then(|| self.tried_on_doubt()).flatten();
        let (wall, cpu) = (self.clock.wall(), self.clock.cpu());
        let mesh = &self.simulation.model.mesh;
        let steps = self.records.last().map_or(0, |r| r.step);
        let simulated = self.records.last().map_or(0.0, |r| r.time);
        let cell_steps = (mesh.cell_count() as u64 * steps) as f64;
        let (scene, records, output) = (&self.scene, &self.records, &self.output);
        let mut summary = Summary {
            status,
            scene: scene.name.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            engine: self.info.engine,
            adapter: self.info.adapter,
            driver: self.info.driver,
            effects: scene.effects.keys().iter().map(|k| k.to_string()).collect(),
            cells: mesh.cell_count() as u64,
            nodes: mesh.node_count() as u64,
            dt_s: self.simulation.dt(),
            stable_dt_s: self.simulation.stable_dt,
            mass_scaling: self.simulation.model.mass_scaling(),
            halvings: self.halvings,
            steps,
            simulated_s: simulated,
            wall_s: wall,
            real_time_factor: simulated / wall.max(1e-9),
            cell_steps_per_s: cell_steps / wall.max(1e-9),
            cpu_ns_per_cell_step: cpu.filter(|_| steps > 0).map(|c| c * 1e9 / cell_steps),
            first_step_ms,
            host_peak_bytes: process::peak_bytes(),
            device_bytes: Some(self.info.device_bytes),
            ..Default::default()
        };
        summary.cells_in_needle = self.cells_in_needle;
        summary.take_frames(records);
        summary.take_sample(&self.driven, records);
        summary.targets = TargetFigures::of_run(&scene.targets, records);
        summary.error_bar = self.beside.as_ref().map(|beside| beside.band(records));
        let mut written = write_charts(scene, records, &self.driven, output);
        written.push(summary.write(&output.file(folder::SUMMARY)));
        let mut missing: Vec<Error> = written.into_iter().filter_map(Result::err).collect();
        let checkpoint = output.file(folder::CHECKPOINT);
        // A replay of a failure may be wanted again.
        let done = matches!(summary.status, Status::Ok | Status::Doubtful(_))
            && missing.is_empty()
            && !output.path().ends_with(FORENSICS);
        if done
            && checkpoint.exists()
            && let Err(source) = std::fs::remove_file(&checkpoint)
        {
            missing.push(Error::file(&checkpoint, source));
        }
        if let Some(advice) = advice {
            eprintln!("note: {advice}");
        }
        if summary.return_failures > 0 {
            eprintln!(
                "warning: the return mapping of the effect plasticity missed the yield condition in {} of {cell_steps:.0} \
                 cell steps; the first frame is marked in the column return_failures of {}",
                summary.return_failures,
                folder::ENERGY_TABLE
            );
        }
        if ending::is_overdue() {
            // A driver finishes the frame that was given up before it lets go; nobody waits for that.
            std::mem::forget(self.simulation);
        }
        (summary, missing)
    }
}

/// The charts of what the run has; what came of each.
fn write_charts(
    scene: &Scene,
    records: &[FrameRecord],
    driven: &[DrivenFace],
    output: &OutputFolder,
) -> Vec<Result<()>> {
    let mut written = Vec::new();
    if !records.is_empty() {
        let figures = CurveFigures::from_records(records);
        written.push(write_force_chart(&output.file(folder::FORCE_CHART), &scene.title, records, &figures));
        if scene.tool.is_some() {
            written.push(write_parts_chart(&output.file(folder::FORCE_PARTS_CHART), &scene.title, records));
        }
        if !driven.is_empty() {
            let chart = output.file(folder::SAMPLE_CHART);
            written.push(write_sample_chart(&chart, &scene.title, driven, records));
        }
    }
    written
}

/// Names for the numbers of the field `material`: the tissue itself, then its regions.
fn material_names(scene: &Scene) -> Vec<String> {
    let regions = scene.regions.iter().map(|region| region.name.clone());
    std::iter::once(scene.material.name.clone()).chain(regions).collect()
}

/// The frames at which pictures, field files and volumes are due.
fn moments(simulation: &Simulation) -> Vec<Moment> {
    let outputs = &simulation.model.scene.outputs;
    let frame_of_time = |t: f64| (t <= simulation.duration() + simulation.dt()).then(|| simulation.frame_at(t));
    let frame_of = |value: f64| match &simulation.model.kinematics {
        // A depth counts on the way in: the first time that the tool gets there.
        Some(k) => k.time_of_depth(value).map(|t| simulation.frame_at(t)),
        None => frame_of_time(value),
    };
    let has_tool = simulation.model.kinematics.is_some();
    let name = |v: f64| if has_tool { PictureMoment::Depth(v) } else { PictureMoment::Time(v) };
    let picture =
        |frame: Option<u64>, at| Some(Moment { frame: frame?, picture: Some(at), field: false, volumes: None });
    let field = |frame: Option<u64>| Some(Moment { frame: frame?, picture: None, field: true, volumes: None });
    let volume =
        |frame: Option<u64>, at| Some(Moment { frame: frame?, picture: None, field: false, volumes: Some(at) });
    let by_time = outputs.pictures_at_time.iter().map(|t| picture(frame_of_time(*t), PictureMoment::Time(*t)));
    let pictures = outputs.pictures_at.iter().map(|v| picture(frame_of(*v), name(*v))).chain(by_time);
    let fields = outputs.fields_at.iter().map(|v| field(frame_of(*v)));
    let fields = fields.chain(outputs.fields_at_time.iter().map(|t| field(frame_of_time(*t))));
    let volumes = outputs.volumes_at.iter().map(|v| volume(frame_of(*v), name(*v)));
    let volumes =
        volumes.chain(outputs.volumes_at_time.iter().map(|t| volume(frame_of_time(*t), PictureMoment::Time(*t))));
    pictures.chain(fields).chain(volumes).flatten().collect()
}

fn write_moment(
    simulation: &mut Simulation,
    record: &FrameRecord,
    moment: &Moment,
    output: &OutputFolder,
    fields: &mut FieldFiles,
    device: Option<&Gpu>,
) -> Result<Option<usize>> {
    let snapshot = simulation.snapshot(record)?;
    let model = &simulation.model;
    if moment.field {
        fields.write(&model.mesh, &snapshot)?;
    }
    if let Some(at) = moment.picture {
        let device = device.map(|g| (&g.device, &g.queue));
        let image = render::draw(&model.scene, &model.mesh, &snapshot, device)?;
        let path = output.picture(at);
        image.write_png(&path)?;
        if model.scene.case.is_some() {
            let (scene, mesh) = (&model.scene, &model.mesh);
            let images =
                [render::draw_anatomy(scene, mesh, &snapshot, device)?, render::body::draw(scene, mesh, &snapshot)];
            for (image, path) in images.iter().zip(OutputFolder::anatomy_beside(&path)) {
                image.as_ref().map(|image| image.write_png(&path)).transpose()?;
            }
        }
    }
    if let Some(at) = moment.volumes {
        volumes::write(output, model, &snapshot, at, model.scene.outputs.volume_stride)?;
    }
    Ok(snapshot.cells_in_needle)
}

/// Exit code of a run that left the range in which its numbers mean something.
pub const EXIT_DIVERGED: u8 = 3;

/// Exit code of a finished run; `strict`: a doubtful one has the code of one that was stopped.
pub fn exit_code(outcome: &Result<RunOutcome>, strict: bool) -> u8 {
    match outcome {
        Ok(o) if strict && matches!(o.summary.status, Status::Doubtful(_)) => EXIT_DIVERGED,
        Ok(o) if o.summary.status == Status::Interrupted => ending::exit_code(),
        Ok(_) => 0,
        Err(Error::Diverged { .. }) => EXIT_DIVERGED,
        Err(error) => error.exit_code(),
    }
}
