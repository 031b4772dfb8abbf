//! Measures what a step costs here, and runs single settings of a study.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use super::plan::{Costs, PlannedRun, UnitCost};
use super::store::RunRecord;
use super::subject::Subject;
use super::{Engine, MeshSize, Settings};
use crate::error::{Error, Result};
use crate::mesh::TissuePoint;
use crate::observables::FrameRecord;
use crate::output::curve::frames_on_the_way_in;
use crate::output::{CurveFigures, Summary};
use crate::process;
use crate::simulation::Simulation;

/// Wall time of the measurement of one mesh [s].
const MEASURED_S: f64 = 0.5;
/// Frames before it: they compile shaders and fill caches.
const WARM_FRAMES: usize = 2;
/// Edge of the coarse mesh of a measurement over that of the base.
const COARSE: f64 = 1.6;

/// Measures the cost of a step on every engine that is there, with two meshes each.
///
/// # Errors
/// As [`Simulation::new`]; a run that diverges within its first frames.
pub fn measure_costs(subject: &Subject, engines: &[Engine]) -> Result<Costs> {
    let mut costs = Costs { engines: Default::default(), measured: true };
    for engine in engines {
        costs.engines.insert(*engine, measure_engine(subject, *engine, MEASURED_S)?);
    }
    Ok(costs)
}

/// Cost of a step on one engine, each mesh measured for `seconds`.
pub fn measure_engine(subject: &Subject, engine: Engine, seconds: f64) -> Result<UnitCost> {
    let base = Settings { engine, ..subject.base.clone() };
    let fine = measure(subject, &base, seconds)?;
    if !subject.has_block() {
        return Ok(UnitCost { step_s: 0.0, cell_step_s: fine.1 / fine.0 as f64 });
    }
    let coarse = Settings { cell_size_mm: COARSE * base.cell_size_mm, ..base.clone() };
    // A base mesh that is as coarse as the scene allows has no coarser one.
    Ok(match measure(subject, &coarse, seconds) {
        Ok(coarse) => UnitCost::through(coarse, fine),
        Err(_) => UnitCost { step_s: 0.0, cell_step_s: fine.1 / fine.0 as f64 },
    })
}

/// Cells and wall time of a step [s].
fn measure(subject: &Subject, settings: &Settings, seconds: f64) -> Result<(u64, f64)> {
    let mut simulation = Simulation::new(subject.scene(settings)?, settings.engine.choice())?;
    let cells = simulation.model.mesh.cell_count() as u64;
    let mut first = 0;
    for _ in 0..WARM_FRAMES {
        if let Some(record) = simulation.next_frame()? {
            first = record.step;
        }
    }
    let (begin, mut last) = (Instant::now(), first);
    while begin.elapsed().as_secs_f64() < seconds {
        match simulation.next_frame()? {
            Some(record) => last = record.step,
            None => break,
        }
    }
    if last == first {
        // The whole scene is shorter than the warming up.
        return Ok((cells, 1e-6));
    }
    Ok((cells, begin.elapsed().as_secs_f64() / (last - first) as f64))
}

/// Runs the settings to the deepest point; `None`: interrupted. `told` hears the part that is done, 0..1.
///
/// A run that diverges is a finding and comes back with its failure.
///
/// # Errors
/// Everything else that keeps a run from its end.
pub fn run(
    subject: &Subject,
    planned: &PlannedRun,
    part: Option<&str>,
    interrupted: &AtomicBool,
    told: &mut dyn FnMut(f64),
) -> Result<Option<RunRecord>> {
    let settings = &planned.settings;
    let begin = Instant::now();
    let mut simulation = Simulation::new(subject.scene(settings)?, settings.engine.choice())?;
    let info = simulation.engine().info().clone();
    let mut run = RunRecord {
        id: planned.id.clone(),
        settings: Some(settings.clone()),
        hash: subject.hash(settings),
        scene_hash: subject.scene_hash(),
        version: env!("CARGO_PKG_VERSION").into(),
        adapter: info.adapter,
        driver: info.driver,
        software: info.software || settings.engine != Engine::Gpu,
        part: part.map(str::to_string),
        cells: simulation.model.mesh.cell_count() as u64,
        nodes: simulation.model.mesh.node_count() as u64,
        dt_s: simulation.dt(),
        device_bytes: info.device_bytes,
        ..Default::default()
    };
    let mut records: Vec<FrameRecord> = Vec::new();
    // The first frame is one step and compiles the shaders: it is no part of the time.
    let mut clock = None;
    loop {
        if interrupted.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let record = match simulation.next_frame() {
            Ok(Some(record)) => record,
            Ok(None) => break,
            Err(error @ Error::Diverged { .. }) => {
                run.failure = Some(error.to_string());
                break;
            }
            Err(Error::Ended(_)) => return Ok(None),
            Err(error) => return Err(error),
        };
        told(record.time / simulation.duration());
        records.push(record);
        clock.get_or_insert_with(|| {
            run.setup_s = begin.elapsed().as_secs_f64();
            (Instant::now(), process::cpu_seconds())
        });
    }
    if let Some((wall, cpu)) = clock {
        run.wall_s = wall.elapsed().as_secs_f64();
        run.cpu_s = process::cpu_seconds().zip(cpu).map(|(end, start)| end - start);
    }
    run.take_frames(&records);
    let model = simulation.model.clone();
    if run.failure.is_none()
        && let Some(block) = model.mesh.as_block()
    {
        let state = simulation.engine().read_state()?;
        let points = subject.sample_points();
        let at = points.iter().map(|x| TissuePoint::new(block, *x).value(&state.displacement).to_array());
        run.displacement_m = at.collect();
    }
    run.finished = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    Ok(Some(run))
}

impl RunRecord {
    fn take_frames(&mut self, records: &[FrameRecord]) {
        let figures = CurveFigures::from_records(records);
        self.steps = records.last().map_or(0, |r| r.step);
        self.simulated_s = records.last().map_or(0.0, |r| r.time);
        self.puncture_force_n = figures.puncture_force;
        self.puncture_depth_m = figures.puncture_depth;
        self.force_at_max_depth_n = figures.force_at_max_depth;
        self.max_depth_m = figures.max_depth;
        let way_in = frames_on_the_way_in(records).filter(|r| r.force.axial.is_finite());
        (self.depth_m, self.force_n) = way_in.map(|r| (r.depth, r.force.axial)).unzip();
        let mut summary = Summary { nodes: self.nodes, ..Default::default() };
        summary.take_frames(records);
        let finite = |value: f64| Some(value).filter(|v| v.is_finite());
        self.energy_imbalance = finite(summary.energy_imbalance);
        self.doubt = records.last().and_then(|r| r.verdict.sentence());
        self.kinetic_to_internal = finite(summary.kinetic_to_internal);
        self.hourglass_to_internal = finite(summary.hourglass_to_internal);
        self.clamped_nodes = summary.clamped_nodes;
        self.inverted_cells = summary.inverted_cells;
    }
}

/// Real-time factor that settings are predicted to reach.
pub fn predicted_factor(size: MeshSize, settings: &Settings, cost: &UnitCost, frame_rate: f64) -> f64 {
    let step = settings.safety * size.unit_step_s * settings.mass_scaling.sqrt();
    let per_frame = (1.0 / frame_rate / step).ceil().max(1.0);
    1.0 / frame_rate / (per_frame * cost.of_step(size.cells))
}
