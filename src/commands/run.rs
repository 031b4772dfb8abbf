//! `stylet run`: from a scene to a folder of results.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::observables::FrameRecord;
use crate::output::checkpoint::{RunCheckpoint, fingerprint};
use crate::output::{
    CurveFigures, DrivenFace, FieldFiles, OutputFolder, PictureMoment, Progress, Status, Summary, Tables,
    TargetFigures, folder, write_force_chart, write_parts_chart, write_sample_chart,
};
use crate::process;
use crate::render;
use crate::scene::Scene;
use crate::solver::simulation::{EngineChoice, Simulation};

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
    let mut simulation = Simulation::new(scene, options.engine)?;
    let scene = simulation.model.scene.clone();
    let output = match (&options.resume, &options.out) {
        (Some(checkpoint), Some(out)) => {
            simulation.resume(&checkpoint.simulation)?;
            OutputFolder::reopen(out)?
        }
        _ => OutputFolder::create(options.out.as_deref(), &scene.name, options.force)?,
    };
    let info = simulation.engine().info().clone();
    eprintln!("{}: {} on {} ({})", scene.name, info.engine, info.adapter, info.driver);
    for notice in &simulation.notices {
        eprintln!("note: {notice}");
    }
    let told = simulation.notices.len();
    let moments = moments(&simulation);
    for moment in &moments {
        simulation.stop_after(moment.frame);
    }
    let driven = DrivenFace::of_scene(&scene.faces, &simulation.model.mesh);
    let mut tables = Tables::create(&output, &driven, simulation.model.has_bore(), &scene.targets)?;
    let mut fields = FieldFiles::new(&output);
    let mut records: Vec<FrameRecord> = Vec::new();
    let mut cells_in_needle = None;
    let (mut earlier_wall, mut earlier_cpu) = (0.0, Some(0.0));
    if let Some(checkpoint) = &options.resume {
        eprintln!("going on at {:.3} s", checkpoint.records.last().map_or(0.0, |r| r.time));
        if checkpoint.adapter != info.adapter {
            eprintln!(
                "note: the run began on {}; on another adapter the numbers go on alike, not bit for bit",
                checkpoint.adapter
            );
        }
        fields = FieldFiles::resumed(&output, checkpoint.fields.clone());
        records.clone_from(&checkpoint.records);
        cells_in_needle = checkpoint.cells_in_needle;
        (earlier_wall, earlier_cpu) = (checkpoint.wall, checkpoint.cpu);
        for record in &records {
            tables.append(record)?;
        }
    }
    let progress = Progress::new(simulation.duration());
    let device = simulation.device().cloned();
    let mut first_step_ms = None;
    let begin = Instant::now();
    let cpu_begin = process::cpu_seconds();
    // Pictures and field files are no part of the step: their time is told apart.
    let (mut drawing, mut drawing_cpu) = (0.0, 0.0);
    let mut status = Status::Ok;
    let mut failure = None;
    // Frame after which a checkpoint is written, when the last one was, and whether the run ends with it.
    let (mut due, mut written, mut ending) = (None, Instant::now(), false);
    loop {
        if interrupted.load(Ordering::Relaxed) && !ending {
            status = Status::Interrupted;
            if options.checkpoint_every.is_none() {
                break;
            }
            ending = true;
            due = Some(simulation.stop_soon());
        }
        let record = match simulation.next_frame() {
            Ok(Some(record)) => record,
            Ok(None) => break,
            Err(error) => {
                status = Status::Failed(error.to_string());
                failure = Some(error);
                break;
            }
        };
        first_step_ms.get_or_insert_with(|| program_start.elapsed().as_secs_f64() * 1e3);
        if let Err(error) = tables.append(&record) {
            status = Status::Failed(error.to_string());
            failure = Some(error);
            break;
        }
        let wall = begin.elapsed().as_secs_f64() - drawing;
        progress.update(&record, record.time / wall.max(1e-9));
        for moment in moments.iter().filter(|m| m.frame == record.frame) {
            let (wall, cpu) = (Instant::now(), process::cpu_seconds());
            match write_moment(&mut simulation, &record, moment, &output, &mut fields, device.as_ref()) {
                // The most of all moments; `None` is less than any number.
                Ok(inside) => cells_in_needle = cells_in_needle.max(inside.map(|n| n as u64)),
                Err(error) => {
                    status = Status::Failed(error.to_string());
                    failure.get_or_insert(error);
                }
            }
            drawing += wall.elapsed().as_secs_f64();
            drawing_cpu += difference(process::cpu_seconds(), cpu).unwrap_or(0.0);
        }
        let frame = record.frame;
        records.push(record);
        if failure.is_some() {
            break;
        }
        if due == Some(frame) {
            let now = Instant::now();
            let checkpoint = RunCheckpoint {
                version: env!("CARGO_PKG_VERSION").into(),
                scene: std::path::absolute(&scene.path).unwrap_or_else(|_| scene.path.clone()),
                overrides: options.overrides.clone(),
                fingerprint: fingerprint(&scene),
                adapter: info.adapter.clone(),
                records: records.clone(),
                cells_in_needle,
                fields: fields.written().to_vec(),
                wall: earlier_wall + begin.elapsed().as_secs_f64() - drawing,
                cpu: sum(earlier_cpu, difference(process::cpu_seconds(), cpu_begin).map(|c| c - drawing_cpu)),
                simulation: match simulation.checkpoint() {
                    Ok(checkpoint) => checkpoint,
                    Err(error) => {
                        failure = Some(error);
                        break;
                    }
                },
            };
            if let Err(error) = checkpoint.write(&output.file(folder::CHECKPOINT)) {
                failure = Some(error);
                break;
            }
            drawing += now.elapsed().as_secs_f64();
            (due, written) = (None, Instant::now());
            if ending {
                break;
            }
        } else if due.is_none() && options.checkpoint_every.is_some_and(|s| written.elapsed().as_secs_f64() >= s) {
            due = Some(simulation.stop_soon());
        }
    }
    if let Some(error) = &failure {
        status = Status::Failed(error.to_string());
    }
    let wall = earlier_wall + begin.elapsed().as_secs_f64() - drawing;
    let cpu = sum(earlier_cpu, difference(process::cpu_seconds(), cpu_begin).map(|c| c - drawing_cpu));
    progress.finish();
    for notice in &simulation.notices[told..] {
        eprintln!("note: {notice}");
    }

    let mesh = &simulation.model.mesh;
    let steps = records.last().map_or(0, |r| r.step);
    let simulated = records.last().map_or(0.0, |r| r.time);
    let cell_steps = (mesh.cell_count() as u64 * steps) as f64;
    let mut summary = Summary {
        status,
        scene: scene.name.clone(),
        version: env!("CARGO_PKG_VERSION").into(),
        engine: info.engine,
        adapter: info.adapter,
        driver: info.driver,
        effects: scene.effects.keys().iter().map(|k| k.to_string()).collect(),
        cells: mesh.cell_count() as u64,
        nodes: mesh.node_count() as u64,
        dt_s: simulation.dt,
        stable_dt_s: simulation.stable_dt,
        mass_scaling: simulation.model.mass_scaling(),
        steps,
        simulated_s: simulated,
        wall_s: wall,
        real_time_factor: simulated / wall.max(1e-9),
        cell_steps_per_s: cell_steps / wall.max(1e-9),
        cpu_ns_per_cell_step: cpu.filter(|_| steps > 0).map(|c| c * 1e9 / cell_steps),
        first_step_ms,
        host_peak_bytes: process::peak_bytes(),
        device_bytes: Some(info.device_bytes),
        ..Default::default()
    };
    summary.cells_in_needle = cells_in_needle;
    summary.take_frames(&records);
    summary.take_sample(&driven, &records);
    summary.targets = TargetFigures::of_run(&scene.targets, &records);
    if !records.is_empty() {
        let figures = CurveFigures::from_records(&records);
        write_force_chart(&output.file(folder::FORCE_CHART), &scene.title, &records, &figures)?;
        if scene.tool.is_some() {
            write_parts_chart(&output.file(folder::FORCE_PARTS_CHART), &scene.title, &records)?;
        }
        if !driven.is_empty() {
            write_sample_chart(&output.file(folder::SAMPLE_CHART), &scene.title, &driven, &records)?;
        }
    }
    summary.write(&output.file(folder::SUMMARY))?;
    let checkpoint = output.file(folder::CHECKPOINT);
    if summary.status == Status::Ok && checkpoint.exists() {
        std::fs::remove_file(&checkpoint).map_err(|source| Error::file(&checkpoint, source))?;
    }
    if summary.raised_mass_share > 0.2 {
        eprintln!(
            "note: {:.0} % of all node steps had their mass raised to keep the step stable: inertia is not what \
             mass_scaling says; lower solver.time_step_us or raise solver.mass_scaling",
            100.0 * summary.raised_mass_share
        );
    }
    if summary.return_failures > 0 {
        eprintln!(
            "warning: the return mapping of the effect plasticity missed the yield condition in {} of {cell_steps:.0} cell \
             steps; the first frame is marked in the column return_failures of {}",
            summary.return_failures,
            folder::ENERGY_TABLE
        );
    }
    match failure {
        Some(error) => {
            eprintln!("results up to the failure are in {}", output.path().display());
            Err(error)
        }
        None => Ok(RunOutcome { folder: output.path().to_path_buf(), summary }),
    }
}

fn sum(a: Option<f64>, b: Option<f64>) -> Option<f64> {
    Some(a? + b?)
}

fn difference(after: Option<f64>, before: Option<f64>) -> Option<f64> {
    Some(after? - before?)
}

/// The frames at which pictures and field files are due.
fn moments(simulation: &Simulation) -> Vec<Moment> {
    let outputs = &simulation.model.scene.outputs;
    let frame_of_time = |t: f64| (t <= simulation.duration() + simulation.dt).then(|| simulation.frame_at(t));
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
    let mut text = format!(
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
            "needle: {count} cells of tissue within its wall at most, over the moments of pictures and fields\n"
        );
    }
    if let Some(area) = summary.torn_area_m2 {
        text += &format!("torn: {:.1} mm2 of the faces that may part\n", area * 1e6);
    }
    text += &format!(
        "energy: imbalance {:.2} % of the external work, kinetic/internal {:.3} %, hourglass/internal {:.1} % (largest \
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

/// Exit code of an interrupted run, as shells have it for Ctrl-C.
pub const EXIT_INTERRUPTED: u8 = 130;

/// Exit code of a run that left the range in which its numbers mean something.
pub const EXIT_DIVERGED: u8 = 3;

/// Exit code of a finished run.
pub fn exit_code(outcome: &Result<RunOutcome>) -> u8 {
    match outcome {
        Ok(o) if o.summary.status == Status::Interrupted => EXIT_INTERRUPTED,
        Ok(_) => 0,
        Err(Error::Diverged { .. }) => EXIT_DIVERGED,
        Err(error) => error.exit_code(),
    }
}
