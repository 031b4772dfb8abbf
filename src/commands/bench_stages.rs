//! `stylet bench --stages`: what each stage of a step costs, for the bare tissue and for a needle under either scheme.

use std::fmt::Write;
use std::sync::Arc;

use serde::Serialize;

use super::bench::{BenchArgs, Place, Subject, open, scene, uniform_mesh};
use crate::effects::puncture::SchemeWord;
use crate::ending;
use crate::engine::Engine as _;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, GpuEngine};
use crate::model::Model;

/// Cells per axis of the block: 20 k.
const CELLS: [usize; 3] = [28, 28, 26];
/// Steps per frame while the needle goes in.
const STEPS: usize = 100;
/// Dispatches of a stage in a row, and how often; the median counts.
const REPEATS: u32 = 400;
const ROUNDS: usize = 5;
/// Depth of the needle [m].
const DEPTH: f64 = 6e-3;
/// Toughness of the tissue in the scheme `opening` [J/m^2].
const TOUGHNESS: f64 = 164.0;

/// Cost of one stage.
#[derive(Debug, Clone, Serialize)]
pub struct StageCost {
    pub stage: &'static str,
    /// Per dispatch: process CPU time (wall time on hardware) and wall time [us].
    pub microseconds: f64,
    pub wall_us: f64,
    /// True where it runs once per frame instead of once per step.
    pub once_per_frame: bool,
}

/// Stages of one block.
#[derive(Debug, Clone, Serialize)]
pub struct SubjectCosts {
    /// `bare`, `ring` or `opening`.
    pub subject: &'static str,
    pub stages: Vec<StageCost>,
}

impl SubjectCosts {
    /// Sum over the stages of a step [us].
    fn per_step(&self) -> f64 {
        self.stages.iter().filter(|s| !s.once_per_frame).map(|s| s.microseconds).sum()
    }

    fn wall_per_step(&self) -> f64 {
        self.stages.iter().filter(|s| !s.once_per_frame).map(|s| s.wall_us).sum()
    }
}

/// The block of the bench with a needle under a scheme, [`DEPTH`] deep; without one where there is no scheme.
pub(super) fn subject(scheme: Option<SchemeWord>) -> Model {
    let mut scene = scene(CELLS, scheme.is_some());
    if scheme == Some(SchemeWord::Opening) {
        scene.material.toughness = Some(TOUGHNESS);
    }
    if let (Some(scheme), Some(puncture)) = (scheme, &mut scene.effects.puncture) {
        puncture.scheme = scheme;
    }
    let edge = scene.tissue.cell_size;
    Model::new(scene, uniform_mesh(CELLS, edge))
}

fn costs(name: &'static str, scheme: Option<SchemeWord>, gpu: &Gpu) -> Result<SubjectCosts> {
    let (_, stages) = timed(Arc::new(subject(scheme)), gpu)?;
    Ok(SubjectCosts { subject: name, stages })
}

/// The engine of a model, and what its stages cost where its needle, if it has one, is [`DEPTH`] deep.
pub(super) fn timed(model: Arc<Model>, gpu: &Gpu) -> Result<(GpuEngine, Vec<StageCost>)> {
    let mut subject = Subject::of_model(model.clone(), &Place { gpu: Some(gpu.clone()), lanes: false }, STEPS)?;
    subject.advance_tool(if model.puncture.is_some() { DEPTH } else { 0.0 }, STEPS)?;
    subject.frame(STEPS, 1.0)?;
    let state = subject.engine.read_state()?;
    // The engine of the subject is known only as a trait: timing by stage needs the real one.
    let mut engine = GpuEngine::new(model, gpu.clone(), subject.dt, STEPS)?;
    let mut rounds: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut stages = Vec::new();
    for _ in 0..ROUNDS {
        engine.write_state(&state)?;
        engine.start_frame(&subject.plan(STEPS, 1.0))?;
        engine.collect(true)?;
        let times = engine.time_stages(REPEATS)?;
        let cost = |(_, wall, cpu): &(_, f64, Option<f64>)| {
            [cpu.filter(|_| gpu.is_software()).unwrap_or(*wall) * 1e6, wall * 1e6]
        };
        rounds.push(times.iter().map(cost).collect());
        stages = times.iter().map(|t| t.0).collect();
    }
    let median = |i: usize, which: usize| {
        let mut all: Vec<f64> = rounds.iter().map(|r| r[i][which]).collect();
        all.sort_by(f64::total_cmp);
        all[ROUNDS / 2]
    };
    let stages = stages
        .iter()
        .enumerate()
        .map(|(i, s)| StageCost {
            stage: s.name(),
            microseconds: median(i, 0),
            wall_us: median(i, 1),
            once_per_frame: s.once_per_frame(),
        })
        .collect();
    Ok((engine, stages))
}

/// The command: prints the table.
///
/// # Errors
/// [`Error::Input`] without an adapter: the CPU engine has no dispatches to time.
pub fn execute(args: &BenchArgs) -> Result<u8> {
    ending::watch();
    let place = open(args.engine)?;
    let Some(gpu) = &place.gpu else {
        return Err(Error::Input {
            message: "--stages times what is dispatched to an adapter, and the CPU engine dispatches nothing".into(),
            way_out: "--engine gpu on a machine with an adapter (a software one will do)".into(),
        });
    };
    let schemes = [("bare", None), ("ring", Some(SchemeWord::Ring)), ("opening", Some(SchemeWord::Opening))];
    let mut all = Vec::new();
    for (name, scheme) in schemes {
        eprintln!("measuring {name}");
        all.push(costs(name, scheme, gpu)?);
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&all).unwrap_or_default());
        return Ok(0);
    }
    let clock = if gpu.is_software() { "CPU time" } else { "wall time" };
    let mut out = format!("20 k cells, needle {} mm deep; {clock} and wall time per dispatch [us]\n", DEPTH * 1e3);
    for subject in &all {
        let part = |of: fn(&SubjectCosts) -> f64| 100.0 * (of(subject) / of(&all[0]) - 1.0);
        let (cost, wall) = (subject.per_step(), subject.wall_per_step());
        let (more, later) = (part(SubjectCosts::per_step), part(SubjectCosts::wall_per_step));
        let name = subject.subject;
        let _ = writeln!(out, "\n{name}: {cost:.0} us per step ({more:+.0} %), wall {wall:.0} us ({later:+.0} %)");
        for stage in &subject.stages {
            let when = if stage.once_per_frame { "  (once per frame)" } else { "" };
            let _ = writeln!(out, "  {:<22} {:>8.0} {:>8.0}{when}", stage.stage, stage.microseconds, stage.wall_us);
        }
    }
    print!("{out}");
    Ok(0)
}
