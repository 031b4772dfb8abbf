//! `stylet bench`: this machine against the performance goals.
//!
//! Figures are process CPU time per cell and step where the adapter is a software one (wall time moves by two on a
//! shared machine), wall time beside it, and ratios inside one run. Every figure is the smallest of several rounds.

use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use glam::DVec3;
use serde::Serialize;

use super::bench_stages;
use crate::cpu::CpuEngine;
use crate::effects::puncture::SchemeWord;
use crate::effects::{TissueMaterial, friction, mass_scaling};
use crate::ending;
use crate::engine::stable_dt::wave_speed_bound;
use crate::engine::{Engine, FramePlan, StepInput};
use crate::error::Result;
use crate::gpu::layout::strip_layers;
use crate::gpu::plan::{Features, stages};
use crate::gpu::{Gpu, GpuEngine};
use crate::material::ElasticLaw;
use crate::mesh::tets::TetMesh;
use crate::mesh::{BlockMesh, Tissue};
use crate::model::Model;
use crate::needle::{NeedleShape, Phase, Tool};
use crate::process;
use crate::scene::Scene;
use crate::simulation::{EngineChoice, Simulation};
use crate::units::digits;

#[derive(Debug, Clone, Args)]
pub struct BenchArgs {
    /// auto, place, cpu or cpu64
    #[arg(long, default_value = "auto")]
    pub engine: EngineChoice,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
    /// Measure what every effect costs instead
    #[arg(long)]
    pub effects: bool,
    /// Measure what every stage of a step costs instead
    #[arg(long, conflicts_with = "effects")]
    pub stages: bool,
    /// Count what every stage moves and computes, beside what this adapter can
    #[arg(long, conflicts_with_all = ["effects", "stages"])]
    pub roofline: bool,
    /// Largest number of cells
    #[arg(long, default_value_t = 500_000)]
    pub max_cells: usize,
}

/// Cells along x, y, z of the measured blocks, edges of 0.8 mm.
pub(super) const SIZES: [[usize; 3]; 6] =
    [[17, 17, 17], [28, 28, 26], [46, 46, 47], [79, 79, 80], [100, 100, 100], [126, 126, 126]];

/// Rounds per figure; the smallest counts.
const ROUNDS: usize = 3;

/// Turns in which blocks of all sizes are measured.
const TURNS: usize = 5;

/// Wall time of one round [s]; the clock of processor time ticks in 10 ms.
const ROUND_SECONDS: f64 = 0.8;

/// One measured block.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    pub cells: usize,
    pub needle: bool,
    /// Process CPU time per cell and step [ns].
    pub cpu_ns_per_cell_step: Option<f64>,
    /// Wall time per cell and step [ns], and per step [us].
    pub wall_ns_per_cell_step: f64,
    pub wall_us_per_step: f64,
    /// Time step at mass scaling 1000 [us] and the real-time factor with it.
    pub dt_us: f64,
    pub real_time_factor: f64,
    pub device_bytes_per_cell: f64,
    /// Recording of commands per dispatch [us].
    pub record_us_per_dispatch: f64,
}

/// One line of the goals.
#[derive(Debug, Clone, Serialize)]
pub struct Goal {
    pub what: String,
    pub measured: f64,
    pub unit: String,
    /// Bound and whether the measured value must stay below (`<=`) or above (`>=`) it.
    pub sense: String,
    pub bound: f64,
    pub met: bool,
}

/// All figures of one machine.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    pub engine: String,
    pub adapter: String,
    pub driver: String,
    pub rows: Vec<Row>,
    pub goals: Vec<Goal>,
}

/// A block of 0.8 mm cells with nu 0.45 at mass scaling 1000, with or without a 16G needle going in at 2 mm/s.
pub(super) fn scene(cells: [usize; 3], needle: bool) -> Scene {
    let h = 0.8e-3;
    let shear = 60e3 / 2.9;
    let size = DVec3::new(cells[0] as f64, cells[1] as f64, cells[2] as f64) * h;
    let law = ElasticLaw::from_moduli(shear, 60e3 / 0.3, 0.7);
    let mut scene = Scene::block(size, h, TissueMaterial::new("bench", "E 60 kPa, nu 0.45", law, 1060.0)).lasting(1.0);
    scene.tissue = Tissue { fine_radius: 0.0, growth: 1.0, axis_offset_cells: [0.0, 0.0], ..scene.tissue };
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor: 1000.0 });
    if needle {
        // Off the grid lines, as scenes have it.
        let entry = DVec3::new(0.23 * h, 0.31 * h, 0.0);
        let phases = vec![Phase::Insert { speed: 2e-3, depth: 10e-3 }];
        let tool = Tool::Needle(NeedleShape::cone("16G", 0.8255e-3, 2.5e-3));
        scene = scene.with_tool(tool, entry, DVec3::NEG_Z, phases);
        scene.effects.friction = Some(friction::Params::default());
    }
    scene.motion.direction = DVec3::NEG_Z;
    scene.solver.hourglass_quartic = 15_000.0;
    scene
}

pub(super) fn uniform_mesh(cells: [usize; 3], h: f64) -> BlockMesh {
    BlockMesh::new(std::array::from_fn(|a| {
        let n = cells[a];
        let start = if a == 2 { -(n as f64) * h } else { -0.5 * n as f64 * h };
        (0..=n).map(|i| start + i as f64 * h).collect()
    }))
}

/// A prepared block that steps on request.
pub(super) struct Subject {
    pub(super) model: Arc<Model>,
    pub(super) engine: Box<dyn Engine>,
    pub(super) dt: f64,
    step: u64,
    frame: u64,
    recording: f64,
    stages: usize,
}

impl Subject {
    fn new(cells: [usize; 3], needle: bool, place: &Place, max_steps: usize) -> Result<Self> {
        let scene = scene(cells, needle);
        let mesh = uniform_mesh(cells, scene.tissue.cell_size);
        Self::of_model(Arc::new(Model::new(scene, mesh)), place, max_steps)
    }

    /// A model of any scene.
    pub(super) fn of_model(model: Arc<Model>, place: &Place, max_steps: usize) -> Result<Self> {
        let dt = 0.8 * wave_speed_bound(&model);
        let engine: Box<dyn Engine> = match &place.gpu {
            Some(gpu) => Box::new(GpuEngine::new(model.clone(), gpu.clone(), dt, max_steps)?),
            None if place.lanes => Box::new(CpuEngine::in_lanes(model.clone(), dt)),
            None => Box::new(CpuEngine::new(model.clone(), dt)),
        };
        let stages = stages(&model.effects, &Features::of(&model)).iter().filter(|s| !s.once_per_frame()).count();
        Ok(Subject { model, engine, dt, step: 0, frame: 0, recording: 0.0, stages })
    }

    /// The next frame of `steps` steps; the tool moves `haste` times as fast as the scene says.
    pub(super) fn plan(&mut self, steps: usize, haste: f64) -> FramePlan {
        let inputs = (0..steps)
            .map(|i| {
                let time = (self.step + i as u64) as f64 * self.dt * haste;
                let mut input = StepInput::at(&self.model, time, self.dt);
                if let Some(pose) = &mut input.pose {
                    pose.velocity *= haste;
                }
                input
            })
            .collect();
        let plan = FramePlan { frame: self.frame, first_step: self.step, steps: inputs, centre_line: None };
        self.step += steps as u64;
        self.frame += 1;
        plan
    }

    /// Such a frame, waited for.
    pub(super) fn frame(&mut self, steps: usize, haste: f64) -> Result<()> {
        let plan = self.plan(steps, haste);
        let begin = Instant::now();
        self.engine.start_frame(&plan)?;
        self.recording = begin.elapsed().as_secs_f64();
        self.engine.collect(true)?;
        Ok(())
    }

    /// Brings the tool `depth` [m] in, ten times as fast as later: a needle of which 6 mm are in has punctured, and its
    /// shaft rubs.
    pub(super) fn advance_tool(&mut self, depth: f64, steps: usize) -> Result<()> {
        while (self.step as f64) * self.dt * 10.0 * 2e-3 < depth {
            self.frame(steps, 10.0)?;
        }
        self.step *= 10;
        Ok(())
    }

    /// Wall and CPU seconds per step over about `ROUND_SECONDS`, in frames of `steps`; as in a run without a window one frame is recorded
    /// while the one before is computed.
    pub(super) fn round(&mut self, steps: usize) -> Result<(f64, Option<f64>)> {
        let (begin, cpu) = (Instant::now(), process::cpu_seconds());
        let mut count = 0;
        while begin.elapsed().as_secs_f64() < ROUND_SECONDS {
            let plan = self.plan(steps, 1.0);
            self.engine.start_frame(&plan)?;
            if count > 0 {
                self.engine.collect(true)?;
            }
            count += steps;
        }
        self.engine.collect(true)?;
        let wall = begin.elapsed().as_secs_f64() / count as f64;
        let cpu = process::cpu_seconds().zip(cpu).map(|(b, a)| (b - a) / count as f64);
        Ok((wall, cpu))
    }

    /// The smallest of several rounds.
    fn best(&mut self, steps: usize) -> Result<(f64, Option<f64>)> {
        let mut best = self.round(steps)?;
        for _ in 1..ROUNDS {
            let (wall, cpu) = self.round(steps)?;
            best = (best.0.min(wall), best.1.zip(cpu).map(|(a, b)| a.min(b)));
        }
        Ok(best)
    }
}

/// Cost of a step of blocks of these sizes, without and with the needle: all of them in turn, the least of several turns, so that what
/// the machine gives in one minute and not in the next does not look like the growth of the cost.
fn measure(sizes: &[([usize; 3], bool)], place: &Place) -> Result<Vec<Row>> {
    const STEPS: usize = 100;
    let mut subjects = Vec::new();
    for (cells, needle) in sizes {
        let mut subject = Subject::new(*cells, *needle, place, STEPS)?;
        match needle {
            true => subject.advance_tool(6e-3, STEPS)?,
            false => subject.frame(STEPS, 1.0)?,
        }
        subjects.push((subject, None::<(f64, Option<f64>)>));
    }
    for turn in 1..=TURNS {
        eprintln!("measuring blocks, turn {turn} of {TURNS}");
        for (subject, best) in &mut subjects {
            let (wall, cpu) = subject.round(STEPS)?;
            let least = |(w, c): (f64, Option<f64>)| (w.min(wall), c.zip(cpu).map(|(a, b)| a.min(b)));
            *best = Some(best.map_or((wall, cpu), least));
        }
    }
    let rows = subjects.into_iter().zip(sizes).map(|((mut subject, best), (_, needle))| {
        let mut recording = f64::INFINITY;
        for _ in 0..5 {
            subject.frame(STEPS, 1.0)?;
            recording = recording.min(subject.recording);
        }
        let (wall, cpu) = best.unwrap_or((f64::NAN, None));
        let count = subject.model.mesh.cell_count();
        let row = Row {
            cells: count,
            needle: *needle,
            cpu_ns_per_cell_step: cpu.map(|c| c * 1e9 / count as f64),
            wall_ns_per_cell_step: wall * 1e9 / count as f64,
            wall_us_per_step: wall * 1e6,
            dt_us: subject.dt * 1e6,
            real_time_factor: subject.dt / wall,
            device_bytes_per_cell: subject.engine.info().device_bytes as f64 / count as f64,
            record_us_per_dispatch: recording * 1e6 / (STEPS * subject.stages) as f64,
        };
        tell(&row);
        Ok(row)
    });
    rows.collect()
}

/// Cost of a step with the needle in the tissue over that of the bare tissue, 20 k cells: both in turn, median of the
/// ratios, so that a drifting machine does not count.
fn needle_over_bare(place: &Place, scheme: SchemeWord) -> Result<f64> {
    const STEPS: usize = 100;
    let mut bare = Subject::new(SIZES[1], false, place, STEPS)?;
    let mut needle = Subject::of_model(Arc::new(bench_stages::subject(Some(scheme))), place, STEPS)?;
    needle.advance_tool(6e-3, STEPS)?;
    bare.frame(STEPS, 1.0)?;
    let mut ratios = Vec::new();
    for _ in 0..7 {
        let (with, without) = (needle.round(STEPS)?, bare.round(STEPS)?);
        let software = place.is_software();
        ratios.push(match with.1.zip(without.1).filter(|_| software) {
            Some((with, without)) => with / without,
            None => with.0 / without.0,
        });
    }
    ratios.sort_by(f64::total_cmp);
    Ok(ratios[ratios.len() / 2])
}

/// Wall and CPU time per tetrahedron and step [ns] of 20 k tetrahedra with averaged pressure.
fn tetrahedra(place: &Place) -> Result<(f64, Option<f64>)> {
    const STEPS: usize = 100;
    const CELLS: [usize; 3] = [15; 3];
    let scene = scene(CELLS, false);
    let block = uniform_mesh(CELLS, scene.tissue.cell_size);
    let model = Arc::new(Model::new(scene, Arc::new(TetMesh::from_block(&block))));
    let mut subject = Subject::of_model(model, place, STEPS)?;
    subject.frame(STEPS, 1.0)?;
    let (wall, cpu) = subject.best(STEPS)?;
    let scale = 1e9 / subject.model.mesh.cell_count() as f64;
    Ok((wall * scale, cpu.map(|c| c * scale)))
}

/// Share of a 16-step frame that is no step: submission, measuring stages and read-back together.
fn frame_overhead(place: &Place) -> Result<f64> {
    let mut subject = Subject::new(SIZES[1], false, place, 160)?;
    subject.frame(160, 1.0)?;
    // Both in turn and the median of the pairs, so that a drifting machine does not count.
    let mut shares = Vec::new();
    for _ in 0..7 {
        let (short, long) = (subject.round(16)?.0 * 16.0, subject.round(160)?.0 * 160.0);
        let step = (long - short) / 144.0;
        shares.push((short - 16.0 * step) / short);
    }
    shares.sort_by(f64::total_cmp);
    Ok(shares[shares.len() / 2])
}

/// Time from program start to the first finished step of 20 k cells [ms] and peak memory [MB], in a fresh process.
fn start(cold: bool, engine: EngineChoice) -> Option<(f64, f64)> {
    let mut command = std::process::Command::new(std::env::current_exe().ok()?);
    command.arg("first-step").arg("--engine").arg(engine.key());
    if cold {
        // Drivers keep compiled shaders on disk; Mesa and NVIDIA have their own switches.
        command.env("MESA_SHADER_CACHE_DISABLE", "true").env("__GL_SHADER_DISK_CACHE", "0");
    }
    let output = command.output().ok().filter(|o| o.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    let (ms, bytes) = text.trim().split_once(' ')?;
    Some((ms.parse().ok()?, bytes.parse::<f64>().ok()? / 1e6))
}

/// `stylet first-step`: one step of the 20 k block; prints milliseconds since `program_start` and the peak memory.
pub fn first_step(engine: EngineChoice, program_start: Instant) -> Result<String> {
    let place = open(engine)?;
    let mut subject = Subject::new(SIZES[1], false, &place, 1)?;
    subject.frame(1, 1.0)?;
    let ms = program_start.elapsed().as_secs_f64() * 1e3;
    Ok(format!("{ms:.3} {}", process::peak_bytes().unwrap_or(0)))
}

/// Where a subject is computed: on a device, else on the CPU engine, in lanes or in f64.
pub(super) struct Place {
    pub gpu: Option<Gpu>,
    pub lanes: bool,
}

impl Place {
    pub fn is_software(&self) -> bool {
        self.gpu.as_ref().is_none_or(Gpu::is_software)
    }
}

pub(super) fn open(engine: EngineChoice) -> Result<Place> {
    let gpu = match engine {
        EngineChoice::Cpu | EngineChoice::Cpu64 => None,
        EngineChoice::Gpu => Some(Gpu::open()?),
        EngineChoice::Auto => Gpu::open().ok(),
    };
    Ok(Place { gpu, lanes: engine != EngineChoice::Cpu64 })
}

/// Real-time factor of the main job without its outputs.
fn main_job(engine: EngineChoice) -> Result<f64> {
    let path = std::path::Path::new("scenes/muscle_biopsy.toml");
    eprintln!("measuring the main job");
    let mut simulation = Simulation::new(Scene::load(path, &[])?, engine)?;
    simulation.next_frame()?;
    let begin = Instant::now();
    while simulation.next_frame()?.is_some() {}
    Ok(simulation.duration() / begin.elapsed().as_secs_f64())
}

/// Bytes per second that this adapter copies between buffers of 128 MiB, read and written counted: by its own command or by a shader,
/// whichever is faster (on an H100 the command reaches a quarter of what a shader does).
pub(super) fn copy_bandwidth(gpu: &Gpu) -> Result<f64> {
    const SIZE: u64 = 128 << 20;
    const COPIES: u32 = 20;
    const SHADER: &str = "
        @group(0) @binding(0) var<storage, read> from_here: array<vec4<u32>>;
        @group(0) @binding(1) var<storage, read_write> to_there: array<vec4<u32>>;
        @compute @workgroup_size(256)
        fn copy(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
            let i = id.y * groups.x * 256u + id.x;
            to_there[i] = from_here[i];
        }";
    let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::STORAGE;
    let label = Some("copy");
    let buffer =
        || gpu.device.create_buffer(&wgpu::BufferDescriptor { label, size: SIZE, usage, mapped_at_creation: false });
    let (a, b) = (buffer(), buffer());
    let source = wgpu::ShaderSource::Wgsl(SHADER.into());
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label, source });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: None,
        module: &module,
        entry_point: Some("copy"),
        compilation_options: Default::default(),
        cache: None,
    });
    let [from, to] = [&a, &b].map(wgpu::Buffer::as_entire_binding);
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: from },
            wgpu::BindGroupEntry { binding: 1, resource: to },
        ],
    });
    let mut best = f64::INFINITY;
    for round in 0..10 {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        if round % 2 == 0 {
            (0..COPIES).for_each(|_| encoder.copy_buffer_to_buffer(&a, 0, &b, 0, SIZE));
        } else {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &group, &[]);
            let groups = (SIZE / 16 / 256) as u32;
            (0..COPIES).for_each(|_| pass.dispatch_workgroups(groups / 16, 16, 1));
        }
        let begin = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| crate::Error::Device(e.to_string()))?;
        best = best.min(begin.elapsed().as_secs_f64());
    }
    Ok(2.0 * f64::from(COPIES) * SIZE as f64 / best)
}

/// Bytes that one cell and step move at least: four nodes of u loaded per plane and four forces stored by the element
/// stage; four forces, u, v and mass loaded, u and v stored by the node stage, with planes shared within a strip.
fn bytes_per_cell_step(strip_layers: f64) -> f64 {
    let planes = (strip_layers + 1.0) / strip_layers;
    planes * 4.0 * 16.0 * 3.0 + 16.0 * 4.0 + 4.0
}

/// A row that is there, on standard error: the table or the JSON comes when all is measured.
fn tell(row: &Row) {
    eprintln!(
        "  {} cells{}: {} ns of wall time per cell-step, real-time factor {:.2}",
        row.cells,
        if row.needle { " with the needle" } else { "" },
        digits(row.wall_ns_per_cell_step, 2),
        row.real_time_factor
    );
}

/// The command: prints the report.
///
/// # Errors
/// As [`bench`].
pub fn execute(args: &BenchArgs) -> Result<u8> {
    ending::watch();
    let report = bench(args)?;
    println!("{}", if args.json { report.json() } else { report.table() });
    Ok(0)
}

/// Measures everything that fits under `max_cells`. What is under way goes to standard error.
pub fn bench(args: &BenchArgs) -> Result<Report> {
    let place = open(args.engine)?;
    let software = place.is_software();
    // A software adapter is slow; a portable device binds no arrays for more than a million cells.
    let sizes = SIZES.iter().take(if place.lanes {
        6
    } else if software {
        4
    } else {
        5
    });
    let small = sizes.filter(|c| c.iter().product::<usize>() <= args.max_cells);
    let sizes: Vec<_> = small.map(|cells| (*cells, false)).chain([(SIZES[1], true)]).collect();
    let rows = measure(&sizes, &place)?;
    let needle = rows[rows.len() - 1].clone();
    let info = Subject::new(SIZES[0], false, &place, 1)?.engine.info().clone();
    let mut goals = Vec::new();
    let mut goal = |what: &str, measured: f64, unit: &str, sense: &str, bound: f64| {
        goals.push(Goal {
            what: what.into(),
            measured,
            unit: unit.into(),
            sense: sense.into(),
            bound,
            met: if sense == "<=" { measured <= bound } else { measured >= bound },
        });
    };
    // Work per cell: CPU time on a software adapter, wall time otherwise.
    let cost = |r: &Row| match r.cpu_ns_per_cell_step {
        Some(cpu) if software => cpu,
        _ => r.wall_ns_per_cell_step,
    };
    let unit = if software { "cpu-ns" } else { "ns" };
    let bare = rows.iter().find(|r| r.cells == needle.cells && !r.needle).cloned();
    for row in rows.iter().filter(|r| !r.needle) {
        if software && (row.cells == needle.cells || (90_000..110_000).contains(&row.cells)) {
            let what = format!("tissue step, {} k cells, per cell-step", row.cells / 1000);
            goal(&what, cost(row), unit, "<=", 120.0);
        }
    }
    eprintln!("measuring tetrahedra");
    let (wall, cpu) = tetrahedra(&place)?;
    let measured = cpu.filter(|_| software).unwrap_or(wall);
    goal("tet4 with averaged pressure, 20 k tets, per tet-step", measured, unit, "<=", 75.0);
    if let Some(bare) = &bare {
        eprintln!("measuring the needle beside the bare block, in turn");
        let extra = |scheme| needle_over_bare(&place, scheme).map(|ratio| 100.0 * (ratio - 1.0));
        goal("needle, contact and tip law on top, 20 k cells", extra(SchemeWord::Ring)?, "%", "<=", 25.0);
        goal("needle on an opened path on top, 20 k cells", extra(SchemeWord::Opening)?, "%", "<=", 30.0);
        goal("device memory, optional effects off", bare.device_bytes_per_cell, "B/cell", "<=", 200.0);
    }
    if place.gpu.is_some() {
        goal("recording per dispatch, 100 steps per frame", needle.record_us_per_dispatch, "us", "<=", 1.0);
        eprintln!("measuring submission and read-back");
        let overhead = 100.0 * frame_overhead(&place)?;
        goal("submission, measuring and read-back of a 16-step frame", overhead, "%", "<=", 5.0);
    }
    for (cold, bound) in [(true, 150.0), (false, 70.0)] {
        eprintln!("measuring the start with a {} cache", if cold { "cold" } else { "warm" });
        let tries: Vec<(f64, f64)> = (0..ROUNDS).filter_map(|_| start(cold, args.engine)).collect();
        let best = tries.iter().map(|t| t.0).fold(f64::INFINITY, f64::min);
        if !tries.is_empty() {
            let what = if cold { "start to first step, cold shader cache" } else { "start to first step, warm cache" };
            goal(what, best, "ms", "<=", bound);
            if !cold {
                let peak = tries.iter().map(|t| t.1).fold(0.0, f64::max);
                goal("host memory at 20 k cells", peak, "MB", "<=", 120.0);
            }
        }
    }
    goal("real-time factor, 20 k cells, S 1000, needle on", needle.real_time_factor, "x", ">=", 1.5);
    let factor = main_job(args.engine)?;
    goal("real-time factor, scenes/muscle_biopsy.toml, whole run", factor, "x", ">=", 1.0);
    let costs: Vec<f64> = rows.iter().filter(|r| !r.needle).map(cost).collect();
    let (low, high) = (costs.iter().copied().fold(f64::INFINITY, f64::min), costs.iter().copied().fold(0.0, f64::max));
    if software {
        goal("growth: worst over best cost per cell-step", high / low, "x", "<=", 1.5);
    } else {
        if let Some(bare) = &bare {
            goal("20 k cells, per step", bare.wall_us_per_step, "us", "<=", 10.0);
        }
        if let (Some(gpu), Some(row)) = (&place.gpu, rows.iter().find(|r| r.cells >= 1_000_000)) {
            let layers = f64::from(strip_layers(row.cells, false));
            let rate = bytes_per_cell_step(layers) / (row.wall_ns_per_cell_step * 1e-9);
            goal("share of the copy bandwidth at 1 M cells", 100.0 * rate / copy_bandwidth(gpu)?, "%", ">=", 60.0);
        }
    }
    Ok(Report { engine: info.engine, adapter: info.adapter, driver: info.driver, rows, goals })
}

impl Report {
    /// As JSON.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_else(|e| format!("{{\"error\": \"{e}\"}}"))
    }

    /// As text for a terminal.
    pub fn table(&self) -> String {
        let mut out = format!("{} on {} ({})\n\n", self.engine, self.adapter, self.driver);
        let _ = writeln!(
            out,
            "{:>8} {:>7} {:>13} {:>13} {:>9} {:>9} {:>8} {:>8}",
            "cells", "needle", "cpu-ns/c-step", "wall-ns/c-st", "us/step", "dt us", "RTF", "B/cell"
        );
        for r in &self.rows {
            let _ = writeln!(
                out,
                "{:>8} {:>7} {:>13} {:>13.1} {:>9.1} {:>9.1} {:>8.2} {:>8.0}",
                r.cells,
                if r.needle { "yes" } else { "no" },
                r.cpu_ns_per_cell_step.map_or("-".into(), |v| format!("{v:.1}")),
                r.wall_ns_per_cell_step,
                r.wall_us_per_step,
                r.dt_us,
                r.real_time_factor,
                r.device_bytes_per_cell
            );
        }
        let _ = writeln!(out, "\n{:<56} {:>10} {:<7} {:>10}  met", "goal", "measured", "", "bound");
        for g in &self.goals {
            let _ = writeln!(
                out,
                "{:<56} {:>10.2} {:<7} {:>2} {:>7}  {}",
                g.what,
                g.measured,
                g.unit,
                g.sense,
                g.bound,
                if g.met { "yes" } else { "NO" }
            );
        }
        out.trim_end().into()
    }
}
