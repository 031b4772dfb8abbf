//! `stylet run`: from a scene to a folder of results.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::ending;
use crate::engine::EngineInfo;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::observables::FrameRecord;
use crate::output::checkpoint::{RunCheckpoint, fingerprint};
use crate::output::forensics::{FORENSICS, write_forensics};
use crate::output::{
    CurveFigures, DrivenFace, FieldFiles, OutputFolder, PictureMoment, Progress, Status, Summary, Tables,
    TargetFigures, folder, write_force_chart, write_parts_chart, write_sample_chart,
};
use crate::process;
use crate::reading;
use crate::render;
use crate::scene::{OnTrouble, Scene};
use crate::simulation::checkpoint::Checkpoint;
use crate::simulation::trial::Trial;
use crate::simulation::{EngineChoice, Simulation};

/// What the command line adds to the scene.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    pub engine: EngineChoice,
    /// Folder of the results; `None`: the next numbered one.
    pub out: Option<PathBuf>,
    /// Replace the results that a named folder holds.
    pub force: bool,
    /// Seconds of wall time between two checkpoints; `None`: none are written.
    pub checkpoint_every: Option<f64>,
    /// Overrides that the scene was loaded with: a checkpoint names them.
    pub overrides: Vec<String>,
    /// The run that goes on, in the folder `out`.
    pub resume: Option<Box<RunCheckpoint>>,
}

/// What a run left behind.
#[derive(Debug, Clone)]
pub struct RunOutcome {
    pub folder: PathBuf,
    pub summary: Summary,
}

/// A moment at which the scene wants a picture or a field file.
#[derive(Debug, Clone, Copy)]
struct Moment {
    frame: u64,
    picture: Option<PictureMoment>,
    field: bool,
}

/// Frames between two images that a run keeps in memory, to go back to when something goes wrong.
const IMAGE_FRAMES: u64 = 10;
/// Images that are kept, and frames before a failure from which on one is taken: the guard waits for a few frames.
const IMAGES: usize = 3;
const BEFORE_FAILURE: u64 = 5;

/// Most frames over which a shorter step is tried.
const MOST_TRIED_FRAMES: u64 = 20;

/// How often a run may halve its time step.
const MOST_HALVINGS: u32 = 4;

/// Wall and CPU time of the steps [s]; pictures, field files and checkpoints are no part of them.
struct Clock {
    begin: Instant,
    cpu_begin: Option<f64>,
    /// Spent on something else.
    aside: (f64, f64),
    /// Of the run before it was resumed.
    earlier: (f64, Option<f64>),
}

impl Clock {
    fn start(earlier: (f64, Option<f64>)) -> Self {
        Clock { begin: Instant::now(), cpu_begin: process::cpu_seconds(), aside: (0.0, 0.0), earlier }
    }

    /// Runs something that is no part of the steps.
    fn aside<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), process::cpu_seconds());
        let done = work();
        self.aside.0 += wall.elapsed().as_secs_f64();
        self.aside.1 += difference(process::cpu_seconds(), cpu).unwrap_or(0.0);
        done
    }

    /// Since the program began.
    fn here(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() - self.aside.0
    }

    fn wall(&self) -> f64 {
        self.earlier.0 + self.here()
    }

    fn cpu(&self) -> Option<f64> {
        Some(self.earlier.1? + difference(process::cpu_seconds(), self.cpu_begin)? - self.aside.1)
    }
}

/// A run under way: the simulation and what it has written.
struct Run<'a> {
    options: &'a RunOptions,
    scene: Scene,
    simulation: Simulation,
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

/// Simulates the scene and writes everything that it asks for. `program_start` is when the process began,
/// `interrupted` ends the run cleanly with what is there.
///
/// # Errors
/// The input errors of [`Simulation::new`] and of the output folder come before anything is written. A run that fails
/// half-way writes all results up to there, with the reason in `summary.json`, and returns the error.
pub fn run(scene: Scene, options: &RunOptions, program_start: Instant, interrupted: &AtomicBool) -> Result<RunOutcome> {
    for notice in &scene.notices {
        eprintln!("note: {notice}");
    }
    let mut run = Run::new(scene, options)?;
    let mut told = 0;
    let progress = Progress::new(run.simulation.duration());
    let mut first_step_ms = None;
    let mut status = Status::Ok;
    let mut failure = None;
    // Frame after which a checkpoint is written, when the last one was, and whether the run ends with it.
    let (mut due, mut written, mut ending) = (None, Instant::now(), false);
    let mut checkpoint_every = options.checkpoint_every;
    loop {
        if interrupted.load(Ordering::Relaxed) && !ending {
            ending = true;
            due = Some(run.simulation.stop_soon());
        }
        for notice in &run.simulation.notices[told..] {
            eprintln!("note: {notice}");
        }
        told = run.simulation.notices.len();
        let frame = match run.advance(&progress) {
            Ok(Some(frame)) => frame,
            Ok(None) => break,
            // The frame under way takes long: the run is kept up to the newest image.
            Err(Error::Ended(_)) => {
                (failure, status) = (run.keep_newest_image().err(), Status::Interrupted);
                break;
            }
            Err(error) => match run.recover(error) {
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
            match run.write_checkpoint() {
                Ok(()) => {}
                // What a run goes on from is worth less than the run itself.
                Err(error @ Error::File { .. }) if !ending => {
                    run.tell_of_no_checkpoint(&error);
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
            due = Some(run.simulation.stop_soon());
        }
    }
    if let Some(error) = &failure {
        status = Status::Failed(error.to_string());
    }
    progress.finish();
    for notice in &run.simulation.notices[told..] {
        eprintln!("note: {notice}");
    }
    let folder = run.output.path().to_path_buf();
    let interrupted = status == Status::Interrupted;
    let checkpoint = run.output.file(folder::CHECKPOINT);
    let (reached, of) = (run.records.last().map_or(0.0, |r| r.time), run.simulation.duration());
    // Results come first where there is little room: a checkpoint takes what they leave.
    let full = matches!(failure, Some(Error::File { .. })) && !checkpoint.exists();
    let newest = run.images.back().filter(|_| full).cloned().map(|image| run.checkpoint(image));
    let (summary, missing) = run.finish(status, first_step_ms);
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

impl<'a> Run<'a> {
    /// Prepares the simulation, then the folder; goes to where a resumed run was.
    fn new(scene: Scene, options: &'a RunOptions) -> Result<Self> {
        let mut simulation = Simulation::new(scene, options.engine)?;
        let scene = simulation.model.scene.clone();
        // From here on there is something to keep.
        ending::begin();
        let resumed = options.resume.as_deref().zip(options.out.as_deref());
        let output = match resumed {
            Some((checkpoint, out)) => {
                simulation.resume(&checkpoint.simulation)?;
                OutputFolder::reopen(out)?
            }
            None => OutputFolder::create(options.out.as_deref(), &scene.name, options.force)?,
        };
        let info = simulation.engine().info().clone();
        eprintln!("{}: {} on {} ({})", scene.name, info.engine, info.adapter, info.driver);
        let driven = DrivenFace::of_scene(&scene.faces, &simulation.model.mesh);
        let records = resumed.map_or(&[][..], |(checkpoint, _)| &checkpoint.records);
        let tables = Tables::with_records(&output, &driven, simulation.model.has_bore(), &scene, records)?;
        let mut run = Run {
            moments: moments(&simulation),
            fields: FieldFiles::new(&output),
            device: simulation.device().cloned(),
            clock: Clock::start((0.0, Some(0.0))),
            records: records.to_vec(),
            cells_in_needle: None,
            images: VecDeque::new(),
            before_doubt: None,
            halvings: 0,
            options,
            scene,
            simulation,
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
            run.fields = FieldFiles::resumed(&run.output, checkpoint.fields.clone());
            run.cells_in_needle = checkpoint.cells_in_needle;
            run.clock = Clock::start((checkpoint.wall, checkpoint.cpu));
        }
        run.plan_stops();
        run.keep_image()?;
        Ok(run)
    }

    /// Starts the tables anew with these records.
    fn keep_records(&mut self, records: Vec<FrameRecord>) -> Result<()> {
        let hollow = self.simulation.model.has_bore();
        self.tables = Tables::with_records(&self.output, &self.driven, hollow, &self.scene, &records)?;
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
        let Some(record) = self.simulation.next_frame()? else { return Ok(None) };
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
            overrides: self.options.overrides.clone(),
            fingerprint: fingerprint(&self.scene),
            adapter: self.info.adapter.clone(),
            records: self.records[..simulation.frames as usize].to_vec(),
            cells_in_needle: self.cells_in_needle,
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

    /// After the device is lost: writes the newest image as checkpoint, and tells how to go on from there.
    fn leave_checkpoint(&self, text: &str) -> Error {
        let Some(image) = self.images.back().cloned() else { return Error::Device(text.into()) };
        let checkpoint = self.checkpoint(image);
        let time = checkpoint.records.last().map_or(0.0, |r| r.time);
        match checkpoint.write(&self.output.file(folder::CHECKPOINT)) {
            Ok(()) => Error::Device(format!(
                "{text}\n  way out: the run is kept up to {time:.3} s; go on with: stylet run --resume {}",
                self.output.path().display()
            )),
            Err(error) => Error::Device(format!("{text}\n  and the run up to {time:.3} s could not be kept: {error}")),
        }
    }

    /// What can be done after a failure: half the step, if the scene wants that, else the folder `forensics` and the error.
    fn recover(&mut self, error: Error) -> Result<()> {
        if let Error::Device(text) = &error {
            return Err(self.leave_checkpoint(text));
        }
        let Error::Diverged { frame, .. } = &error else { return Err(error) };
        let (frame, text) = (*frame, error.to_string());
        let early = self.images.iter().rposition(|image| image.frames + BEFORE_FAILURE <= frame).unwrap_or(0);
        let Some(image) = self.images.get(early).cloned() else { return Err(error) };
        // A cure needs a state from before the trouble began, which may be long before it stops the run.
        let sound = self.before_doubt.clone().filter(|early| early.frames <= image.frames).unwrap_or(image.clone());
        if self.scene.solver.on_trouble == OnTrouble::HalveStep && self.halvings < MOST_HALVINGS {
            let image = sound;
            self.before_doubt = None;
            self.halvings += 1;
            let mut next = self.simulation.halved(&image)?;
            next.notices.push(format!(
                "{text}\n      on_trouble = \"halve_step\": the run goes on from frame {} with steps of {:.3} us ({} of {MOST_HALVINGS})",
                image.frames,
                next.dt() * 1e6,
                self.halvings
            ));
            self.simulation = next;
            let records = self.records[..image.frames as usize].to_vec();
            self.keep_records(records)?;
            self.images.clear();
            self.plan_stops();
            self.keep_image()?;
            return Ok(());
        }
        // A replay of a failure leaves the folder that it came from as it is.
        if self.output.path().ends_with(FORENSICS) {
            return Err(error);
        }
        let finding = match self.simulation.investigate(&image, frame) {
            Ok(finding) => finding,
            Err(reason) => {
                eprintln!("warning: no forensics, the steps before the failure could not be repeated: {reason}");
                return Err(error);
            }
        };
        let advice = self.tried_on_trouble(&sound, frame);
        let error = match error {
            Error::Diverged { frame, step, time_s, message } => {
                Error::Diverged { frame, step, time_s, message: format!("{message}\n  tried: {advice}") }
            }
            other => other,
        };
        let text = error.to_string();
        let (checkpoint, model) = (self.checkpoint(image), self.simulation.model.clone());
        match write_forensics(&self.output, &model, &finding, &text, &checkpoint, self.device.as_ref()) {
            Ok((folder, missing)) if missing.is_empty() => {
                eprintln!("where it began, and how to see it again: {}", folder.display());
            }
            Ok((folder, missing)) => {
                eprintln!("warning: the forensics in {} are not complete", folder.display());
                missing.iter().for_each(|reason| eprintln!("warning: {reason}"));
            }
            Err(reason) => eprintln!("warning: no forensics: {reason}"),
        }
        Err(error)
    }

    /// What a shorter step does about a doubt: it is tried from the image before the doubt began. `None` where nothing can be tried.
    fn tried_on_doubt(&mut self) -> Option<String> {
        let image = self.before_doubt.take()?;
        let doubt = self.simulation.verdict().doubts.first()?.clone();
        // As far as the doubt had grown to most of what it is, some frames at least.
        let last = (doubt.frame + MOST_TRIED_FRAMES / 2).min(self.records.len() as u64 - 1);
        let tried = self.clock.aside(|| self.simulation.try_cures(&image, last));
        Some(tried_in_words(tried))
    }

    /// The same for a run that is stopped in frame `frame`.
    fn tried_on_trouble(&mut self, image: &Checkpoint, frame: u64) -> String {
        let last = (frame + BEFORE_FAILURE).min(self.simulation.frame_count() - 1);
        let tried = self.clock.aside(|| self.simulation.try_cures(image, last));
        tried_in_words(tried)
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
        let mut written = Vec::new();
        if !records.is_empty() {
            let figures = CurveFigures::from_records(records);
            written.push(write_force_chart(&output.file(folder::FORCE_CHART), &scene.title, records, &figures));
            if scene.tool.is_some() {
                written.push(write_parts_chart(&output.file(folder::FORCE_PARTS_CHART), &scene.title, records));
            }
            if !self.driven.is_empty() {
                let chart = output.file(folder::SAMPLE_CHART);
                written.push(write_sample_chart(&chart, &scene.title, &self.driven, records));
            }
        }
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

/// What came of the cures that were tried; one is named as a way out only where it was one.
fn tried_in_words(tried: Result<Trial>) -> String {
    let trial = match tried {
        Ok(trial) => trial,
        Err(error) => return format!("nothing, the run could not be repeated ({error})"),
    };
    let without = trial
        .without
        .map_or("where the run is stopped without it".into(), |x| format!("instead of {:.2} %", 100.0 * x));
    if let Some((cure, with)) = trial.best() {
        return format!(
            "{} from shortly before goes on to frame {} and gains {:.2} % imbalance, {without}; way out: {}",
            cure.name,
            trial.last,
            100.0 * with,
            cure.line
        );
    }
    let tried: Vec<String> = trial
        .with
        .iter()
        .map(|(cure, end)| match end {
            Ok(with) => format!("{}: {:.2} % imbalance gained, {without}", cure.name, 100.0 * with),
            Err(_) => format!("{}: stopped as well", cure.name),
        })
        .collect();
    format!("{}; none of them is a way out", tried.join(", "))
}

/// The first line of an error: what is wrong, without the way out.
fn reason_of(error: &Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}

fn difference(after: Option<f64>, before: Option<f64>) -> Option<f64> {
    Some(after? - before?)
}

/// The frames at which pictures and field files are due.
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
    let picture = |frame: Option<u64>, at| Some(Moment { frame: frame?, picture: Some(at), field: false });
    let field = |frame: Option<u64>| Some(Moment { frame: frame?, picture: None, field: true });
    let by_time = outputs.pictures_at_time.iter().map(|t| picture(frame_of_time(*t), PictureMoment::Time(*t)));
    let pictures = outputs.pictures_at.iter().map(|v| picture(frame_of(*v), name(*v))).chain(by_time);
    let fields = outputs.fields_at.iter().map(|v| field(frame_of(*v)));
    let fields = fields.chain(outputs.fields_at_time.iter().map(|t| field(frame_of_time(*t))));
    pictures.chain(fields).flatten().collect()
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
        image.write_png(&output.picture(at))?;
    }
    Ok(snapshot.cells_in_needle)
}

/// Short report for the terminal: what the run found.
pub fn describe(summary: &Summary) -> String {
    let newton = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.3} N"));
    let mm = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.2} mm", v * 1e3));
    let mut text = String::new();
    if let Status::Doubtful(why) = &summary.status {
        text += &format!("DOUBTFUL: {why}\n");
    }
    text += &format!(
        "{} cells, {} steps of {:.1} us (mass scaling {}), {:.2} s simulated in {:.2} s: real-time factor {:.2}\n",
        summary.cells,
        summary.steps,
        summary.dt_s * 1e6,
        summary.mass_scaling,
        summary.simulated_s,
        summary.wall_s,
        summary.real_time_factor
    );
    if let (Some(peak), Some(depth)) = (summary.puncture_force_n, summary.puncture_depth_m) {
        let after = newton(summary.force_after_puncture_n);
        text += &format!("puncture: {peak:.3} N at {:.2} mm, then {after}\n", depth * 1e3);
    }
    if summary.peak_force_n.is_some_and(|f| f != 0.0) {
        text += &format!(
            "force: {} at {}; largest {}\n",
            newton(summary.force_at_max_depth_n),
            mm(summary.max_depth_m),
            newton(summary.peak_force_n),
        );
    }
    if let (Some(face), Some(stress), Some(stretch)) =
        (&summary.face, summary.peak_nominal_stress_pa, summary.stretch_at_peak)
    {
        text += &format!(
            "sample: largest nominal stress {:.2} kPa at a stretch of {stretch:.3} on {face}\n",
            stress * 1e-3
        );
    }
    if let (Some(length), Some(rest), Some(mass)) =
        (summary.core_length_m, summary.core_rest_length_m, summary.core_mass_kg)
    {
        text += &format!(
            "core: {:.2} mm in the bore, {:.2} mm at rest ({:.0} % strain), {:.2} mg\n",
            length * 1e3,
            rest * 1e3,
            100.0 * summary.core_strain.unwrap_or(0.0),
            mass * 1e6
        );
    }
    for target in &summary.targets {
        text += &format!(
            "target {}: moves by {:.3} mm at most on the way in, at {:.2} mm",
            target.name,
            target.largest_displacement_m * 1e3,
            target.largest_displacement_depth_m * 1e3
        );
        if let (Some(smallest), Some(depth), Some(end), Some(hit)) = (
            target.smallest_tip_distance_m,
            target.smallest_tip_distance_depth_m,
            target.tip_distance_at_end_m,
            target.hit,
        ) {
            text += &format!(
                "; the tip comes to {:.3} mm at {:.2} mm, {:.3} mm at the end: {}",
                smallest * 1e3,
                depth * 1e3,
                end * 1e3,
                if hit { "hit" } else { "missed" }
            );
        }
        text.push('\n');
    }
    if let Some(count) = summary.cells_in_needle {
        text += &format!(
            "needle: {count} cells of tissue within its wall at most, over the times of pictures and fields\n"
        );
    }
    if let Some(area) = summary.torn_area_m2 {
        text += &format!("torn: {:.1} mm2 of the faces that may part\n", area * 1e6);
    }
    text += &format!(
        "energy: imbalance {:.2} % of the work so far at most, kinetic/internal {:.3} %, hourglass/internal {:.1} % (largest \
         {:.1} %); {} clamped nodes, {} inverted cells",
        100.0 * summary.energy_imbalance,
        100.0 * summary.kinetic_to_internal,
        100.0 * summary.hourglass_to_internal,
        100.0 * summary.hourglass_to_internal_max,
        summary.clamped_nodes,
        summary.inverted_cells
    );
    text
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
