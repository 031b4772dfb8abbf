//! `stylet bench --effects`: what every effect costs, with and without, in one run.
//!
//! Every effect is measured beside the same block without it, in turn, so that a drifting machine hits both. Two loads:
//! `rest`, where the effect is on and has nothing to do, and `work`, where the block swings so strongly that flow, damage
//! and relaxation happen in every cell. Off is free by construction: the shaders of a run are composed from text, and
//! without an effect the text is the same as if the effect had never been written; the report says whether that holds.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::bench::{BenchArgs, Place, Subject, open, scene, uniform_mesh};
use crate::effects::{self, EFFECTS, EffectSet, Kind, damage, fibres, gravity, plasticity, viscoelastic};
use crate::ending;
use crate::error::Result;
use crate::gpu::compose::{compose, compose_without_effects};
use crate::gpu::plan::{Features, defines, stages};
use crate::material::LAWS;
use crate::model::Model;
use crate::needle::{Motion, Phase, Tool};
use crate::scene::Scene;
use crate::simulation::EngineChoice;

/// Cells per axis of the block: 20 k.
const CELLS: [usize; 3] = [28, 28, 26];
/// Steps per frame.
const STEPS: usize = 60;
/// Pairs of rounds per effect; the median of their ratios counts.
const PAIRS: usize = 5;

/// Cost of one effect, or of several together.
#[derive(Debug, Clone, Serialize)]
pub struct EffectCost {
    /// Keys of the effects, joined by ` + `.
    pub effects: String,
    /// What it is compared with: keys of the effects of the other run, or `nothing`.
    pub beside: String,
    /// `rest` or `work`.
    pub load: &'static str,
    /// Device memory per cell with and without [bytes].
    pub bytes_with: f64,
    pub bytes_without: f64,
    /// Process CPU time (wall time on hardware) per cell and step with and without [ns].
    pub ns_with: f64,
    pub ns_without: f64,
    /// Median of the ratios of neighbouring rounds.
    pub ratio: f64,
}

/// All costs of one machine.
#[derive(Debug, Clone, Serialize)]
pub struct EffectReport {
    pub engine: String,
    pub adapter: String,
    pub costs: Vec<EffectCost>,
    /// True where the composed text of the bare stages is that of shaders which never had an effect.
    pub off_is_absent: bool,
    /// Cost of all constitutive effects together over the bare tissue step, at rest; the goal is 2.3.
    pub all_over_bare: f64,
}

/// Mass scaling of the scenes of the bench.
const SCALED: f64 = 1000.0;

/// Constitutive effects whose thresholds are so low that a swinging block passes them.
fn with_effects(effects: &mut EffectSet, keys: &[&str], low: bool) {
    for key in keys {
        match *key {
            // The density carries the factor of mass scaling: under a thousand times its weight the block would be crushed.
            "gravity" => effects.gravity = Some(gravity::Params { acceleration: DVec3::NEG_Z * (9.81 / SCALED) }),
            "plasticity" => {
                let yield_stress = if low { 50.0 } else { 23.4e3 };
                effects.plasticity = Some(plasticity::Params { yield_stress, hardening: 1e4 });
            }
            "fibres" => effects.fibres = Some(fibres::Params::default()),
            "viscoelastic" => effects.viscoelastic = Some(viscoelastic::Params::default()),
            "damage" => {
                let onset = if low { 1e-4 } else { 0.0652 };
                effects.damage = Some(damage::Params { onset, failure_displacement: 1.0, ..Default::default() });
            }
            // Those of the bench scene itself: mass scaling and what a tool brings.
            _ => {}
        }
    }
}

/// The bench block with the effects `keys`; mass scaling, puncture and friction by `needle` as in the bench.
fn subject(keys: &[&str], low: bool, place: &Place) -> Result<Subject> {
    let needle = keys.contains(&"puncture") || keys.contains(&"friction");
    let mut scene: Scene = scene(CELLS, needle);
    if !keys.contains(&"mass_scaling") {
        // The uniform factor sets the step; without it the same step is kept by the density.
        scene.effects.mass_scaling = None;
        scene.material.density *= SCALED;
    }
    if !keys.contains(&"friction") {
        scene.effects.friction = None;
    }
    with_effects(&mut scene.effects, keys, low);
    let indents = keys.contains(&"indentation");
    if indents {
        let speed = 2e-3;
        scene.tool = Some(Tool::Sphere { radius: 4e-3 });
        scene.motion = Motion {
            entry: DVec3::ZERO,
            direction: DVec3::NEG_Z,
            phases: vec![Phase::Insert { speed, depth: 3e-3 }],
            vibration: None,
        };
        scene.effects.indentation = Some(Default::default());
    }
    let mesh = uniform_mesh(CELLS, scene.tissue.cell_size);
    let mut subject = Subject::of_model(Arc::new(Model::new(scene, mesh)), place, STEPS)?;
    if needle {
        subject.advance_tool(6e-3, STEPS)?;
    } else if indents {
        subject.advance_tool(1e-3, STEPS)?;
    }
    if low {
        // A swing of all nodes, different from node to node.
        let mut state = subject.engine.read_state()?;
        let amplitude = 0.02 * subject.model.speed_limit(subject.dt);
        for (n, v) in state.velocity.iter_mut().enumerate() {
            let phase =
                |k: u64| ((n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15 ^ (k << 7)) >> 40) as f64 / 8388608.0 - 1.0;
            *v = DVec3::new(phase(1), phase(2), phase(3)) * amplitude;
        }
        subject.engine.write_state(&state)?;
    }
    subject.frame(STEPS, 1.0)?;
    Ok(subject)
}

fn cost(keys: &[&str], beside: &[&str], low: bool, place: &Place) -> Result<EffectCost> {
    let mut with = subject(keys, low, place)?;
    let mut without = subject(beside, low, place)?;
    let software = place.is_software();
    let (mut ratios, mut best) = (Vec::new(), (f64::INFINITY, f64::INFINITY));
    for _ in 0..PAIRS {
        let one = |subject: &mut Subject| -> Result<f64> {
            let (wall, cpu) = subject.round(STEPS)?;
            Ok(cpu.filter(|_| software).unwrap_or(wall))
        };
        let (a, b) = (one(&mut with)?, one(&mut without)?);
        ratios.push(a / b);
        best = (best.0.min(a), best.1.min(b));
    }
    ratios.sort_by(f64::total_cmp);
    let count = with.model.mesh.cell_count() as f64;
    let name = |keys: &[&str]| if keys.is_empty() { "nothing".to_string() } else { keys.join(" + ") };
    Ok(EffectCost {
        effects: name(keys),
        beside: name(beside),
        load: if low { "work" } else { "rest" },
        bytes_with: with.engine.info().device_bytes as f64 / count,
        bytes_without: without.engine.info().device_bytes as f64 / count,
        ns_with: best.0 * 1e9 / count,
        ns_without: best.1 * 1e9 / count,
        ratio: ratios[ratios.len() / 2],
    })
}

/// True where every bare stage is composed to the text that shaders without any effect would give.
pub fn off_is_absent() -> Result<bool> {
    let none = EffectSet::default();
    for law in &LAWS {
        let features = Features {
            loaded_faces: false,
            driven_faces: false,
            regions: false,
            bore: false,
            slit: false,
            free_path: false,
            opening: false,
            laid: false,
            drawn: true,
            wide: false,
            empty_cells: false,
            tetrahedra: false,
            laws: BTreeSet::from([law.key]),
        };
        let defines = defines(&none, &features);
        for stage in stages(&none, &features) {
            let path = format!("stages/{}", stage.name());
            if compose(&path, &defines)?.source != compose_without_effects(&path, &defines)?.source {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

/// The command with `--effects`: prints the report.
///
/// # Errors
/// As [`bench_effects`].
pub fn execute(args: &BenchArgs) -> Result<u8> {
    ending::watch();
    let report = bench_effects(args.engine)?;
    println!("{}", if args.json { report.json() } else { report.table() });
    Ok(0)
}

/// Measures every effect.
///
/// # Errors
/// `Error::Adapter` where the wanted engine is not to be had.
pub fn bench_effects(engine: EngineChoice) -> Result<EffectReport> {
    let place = &open(engine)?;
    let constitutive: Vec<&str> = effects::keys_of(Kind::Constitutive).collect();
    let mut costs = Vec::new();
    let plan: [(&[&str], &[&str], bool); 14] = [
        (&["mass_scaling"], &[], false),
        (&["gravity"], &[], false),
        (&["plasticity"], &[], false),
        (&["fibres"], &[], false),
        (&["viscoelastic"], &[], false),
        (&["plasticity", "damage"], &["plasticity"], false),
        (&constitutive, &[], false),
        (&["plasticity"], &[], true),
        (&["fibres"], &[], true),
        (&["viscoelastic"], &[], true),
        (&constitutive, &[], true),
        (&["mass_scaling", "indentation"], &["mass_scaling"], false),
        (&["mass_scaling", "puncture"], &["mass_scaling"], false),
        (&["mass_scaling", "puncture", "friction"], &["mass_scaling", "puncture"], false),
    ];
    for (keys, beside, low) in plan {
        eprintln!("  {} ({})", keys.join(" + "), if low { "work" } else { "rest" });
        costs.push(cost(keys, beside, low, place)?);
    }
    let all = costs.iter().find(|c| c.load == "rest" && c.effects == constitutive.join(" + "));
    let info = Subject::of_model(Arc::new(Model::new(scene([2; 3], false), uniform_mesh([2; 3], 0.8e-3))), place, 1)?;
    Ok(EffectReport {
        engine: info.engine.info().engine.clone(),
        adapter: info.engine.info().adapter.clone(),
        all_over_bare: all.map_or(f64::NAN, |c| c.ratio),
        off_is_absent: off_is_absent()?,
        costs,
    })
}

impl EffectReport {
    /// The table for people.
    pub fn table(&self) -> String {
        let mut out = format!("{} on {}, block of 20 k cells\n\n", self.engine, self.adapter);
        let _ = writeln!(
            out,
            "{:<46} {:>4}  {:>7} {:>7}  {:>6} {:>6}  {:>5}",
            "effect (beside)", "load", "B/cell", "without", "ns", "without", "ratio"
        );
        for c in &self.costs {
            let name = match c.beside.as_str() {
                "nothing" => c.effects.clone(),
                beside => format!("{} ({beside})", c.effects),
            };
            let _ = writeln!(
                out,
                "{name:<46} {:>4}  {:>7.0} {:>7.0}  {:>6.1} {:>6.1}  {:>5.2}",
                c.load, c.bytes_with, c.bytes_without, c.ns_with, c.ns_without, c.ratio
            );
        }
        let _ = writeln!(out, "\nns: per cell and step, process CPU time on software adapters, wall time on others");
        let _ = writeln!(
            out,
            "off is free: text of the bare stages {} that of shaders which never had an effect",
            if self.off_is_absent { "is" } else { "IS NOT" }
        );
        let met = if self.all_over_bare <= 2.3 { "met" } else { "missed" };
        let _ = writeln!(
            out,
            "all constitutive effects over the bare step: {:.2} (goal <= 2.3: {met})",
            self.all_over_bare
        );
        let known = EFFECTS.iter().map(|e| e.key).collect::<Vec<_>>().join(", ");
        let _ = write!(out, "effects of the program: {known}");
        out
    }

    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a report of numbers and texts is JSON")
    }
}
