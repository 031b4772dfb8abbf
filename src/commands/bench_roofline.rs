//! `stylet bench --roofline`: what the stages of a step move and compute, beside what this adapter copies and how fast it starts a dispatch.

use std::fmt::Write;
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::bench::{BenchArgs, SIZES, copy_bandwidth, open, scene, uniform_mesh};
use super::bench_stages::{subject, timed};
use crate::effects::puncture::SchemeWord;
use crate::ending;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::model::Model;

/// Dispatches in a row that are timed, and how often; the fastest counts.
const DISPATCHES: u32 = 2000;
const ROUNDS: usize = 5;

/// What this adapter can.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Adapter {
    /// Of a copy between two buffers of 128 MiB, read and written counted [byte/s].
    pub copy_bytes_per_s: f64,
    /// From one empty dispatch to the next [us].
    pub dispatch_us: f64,
}

/// One stage of a step.
#[derive(Debug, Clone, Serialize)]
pub struct StageRoof {
    pub stage: &'static str,
    pub threads: u32,
    /// Sizes of the arrays that it reads and of those that it writes [byte], and whether it goes through the whole of them.
    pub bytes: f64,
    pub whole: bool,
    pub flops: f64,
    /// Loops whose rounds the data say were counted once.
    pub flops_at_least: bool,
    /// Wall time of a dispatch; start of a dispatch with its bytes at the rate of a copy, where it goes through the whole of them [us].
    pub wall_us: f64,
    pub bound_us: f64,
}

/// The stages of a step of one block.
#[derive(Debug, Clone, Serialize)]
pub struct SubjectRoof {
    pub subject: String,
    pub cells: usize,
    pub stages: Vec<StageRoof>,
}

impl SubjectRoof {
    /// All stages of a step as one.
    fn step(&self) -> StageRoof {
        let sum = |of: fn(&StageRoof) -> f64| self.stages.iter().map(of).sum();
        StageRoof {
            stage: "step",
            threads: self.stages.len() as u32,
            bytes: self.stages.iter().filter(|s| s.whole).map(|s| s.bytes).sum(),
            whole: true,
            flops: sum(|s| s.flops),
            flops_at_least: self.stages.iter().any(|s| s.flops_at_least),
            wall_us: sum(|s| s.wall_us),
            bound_us: sum(|s| s.bound_us),
        }
    }
}

/// Everything, as JSON has it.
#[derive(Debug, Clone, Serialize)]
struct Roofline {
    adapter: String,
    can: Adapter,
    subjects: Vec<SubjectRoof>,
}

/// Time between two empty dispatches [s].
fn dispatch_time(gpu: &Gpu) -> Result<f64> {
    let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("empty"),
        source: wgpu::ShaderSource::Wgsl("@compute @workgroup_size(64) fn main() {}".into()),
    });
    let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("empty"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let mut best = f64::INFINITY;
    for _ in 0..ROUNDS {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&pipeline);
            (0..DISPATCHES).for_each(|_| pass.dispatch_workgroups(1, 1, 1));
        }
        let begin = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| Error::Device(e.to_string()))?;
        best = best.min(begin.elapsed().as_secs_f64());
    }
    Ok(best / f64::from(DISPATCHES))
}

fn roof(name: &str, model: Model, gpu: &Gpu, can: Adapter) -> Result<SubjectRoof> {
    let cells = model.mesh.cell_count();
    let (engine, costs) = timed(Arc::new(model), gpu)?;
    let wall = |stage: &str| costs.iter().find(|cost| cost.stage == stage).map_or(f64::NAN, |cost| cost.wall_us);
    let stages = engine.loads()?.into_iter().filter(|load| !load.stage.once_per_frame()).map(|load| StageRoof {
        stage: load.stage.name(),
        threads: load.threads,
        bytes: load.bytes,
        whole: load.whole,
        flops: load.flops,
        flops_at_least: load.at_least,
        wall_us: wall(load.stage.name()),
        bound_us: can.dispatch_us + if load.whole { 1e6 * load.bytes / can.copy_bytes_per_s } else { 0.0 },
    });
    Ok(SubjectRoof { subject: name.into(), cells, stages: stages.collect() })
}

/// The command: prints the table.
///
/// # Errors
/// [`Error::Input`] without an adapter: the CPU engine has no shaders to count.
pub fn execute(args: &BenchArgs) -> Result<u8> {
    ending::watch();
    let place = open(args.engine)?;
    let Some(gpu) = &place.gpu else {
        return Err(Error::input(
            "--roofline counts what an adapter is given, and the CPU engine gives nothing to one",
            "--engine gpu on a machine with an adapter (a software one will do)",
        ));
    };
    let can = Adapter { copy_bytes_per_s: copy_bandwidth(gpu)?, dispatch_us: 1e6 * dispatch_time(gpu)? };
    let mut subjects = Vec::new();
    let schemes =
        [("tissue", None), ("needle, ring", Some(SchemeWord::Ring)), ("needle, opening", Some(SchemeWord::Opening))];
    for (name, scheme) in schemes {
        eprintln!("measuring {name}");
        subjects.push(roof(name, subject(scheme), gpu, can)?);
    }
    // Large blocks show bytes, small ones dispatches.
    let most = if gpu.is_software() { 100_000 } else { args.max_cells };
    let large = SIZES.iter().rev().find(|cells| cells.iter().product::<usize>() <= most.min(args.max_cells));
    if let Some(cells) = large.filter(|cells| cells.iter().product::<usize>() > subjects[0].cells) {
        eprintln!("measuring {} cells", cells.iter().product::<usize>());
        let scene = scene(*cells, false);
        let mesh = uniform_mesh(*cells, scene.tissue.cell_size);
        subjects.push(roof("tissue", Model::new(scene, mesh), gpu, can)?);
    }
    let all = Roofline { adapter: crate::gpu::device::describe(&gpu.info), can, subjects };
    match args.json {
        true => println!("{}", serde_json::to_string_pretty(&all).unwrap_or_default()),
        false => print!("{}", table(&all)),
    }
    Ok(0)
}

fn table(all: &Roofline) -> String {
    let mut out = format!(
        "{}: copies {:.1} GB/s (read and written), an empty dispatch takes {:.2} us\n\n",
        all.adapter,
        all.can.copy_bytes_per_s * 1e-9,
        all.can.dispatch_us
    );
    let _ = writeln!(
        out,
        "{:<22} {:>9} {:>10} {:>10} {:>10} {:>10} {:>9}",
        "stage", "threads", "kB", "kflop", "flop/B", "wall us", "of copy"
    );
    for subject in &all.subjects {
        let _ = writeln!(out, "\n{}, {} cells", subject.subject, subject.cells);
        for s in subject.stages.iter().chain([&subject.step()]) {
            let _ = writeln!(
                out,
                "{:<22} {:>9} {:>10} {:>9.1}{} {:>10} {:>10.1} {:>7.1} %",
                s.stage,
                s.threads,
                if s.whole { format!("{:.1}", s.bytes * 1e-3) } else { "part".into() },
                s.flops * 1e-3,
                if s.flops_at_least { "+" } else { " " },
                if s.whole { format!("{:.2}", s.flops / s.bytes.max(1.0)) } else { "-".into() },
                s.wall_us,
                100.0 * s.bound_us / s.wall_us
            );
        }
    }
    out += "\nkB: the arrays that a stage reads and those that it writes, each once; part: it touches a part of them. of copy: the time\n\
            to start the dispatch and to copy as many bytes, over its wall time. +: loops whose rounds depend on data count once.\n\
            step: dispatches, and the sums of its stages.\n";
    out
}
