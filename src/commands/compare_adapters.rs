//! `stylet compare-adapters`: one scene on every adapter that is here, beside the CPU engine in f64.
//!
//! Measures, of a run on an adapter against the run of the CPU engine:
//! ```text
//! force         largest |F - F_ref| of all frames / largest |F_ref|       axial force of the tool, reactions of driven faces
//! displacement  largest |u - u_ref| of all nodes / largest |u_ref|        at the deepest point, else half-way, and at the end
//! energy        largest |E - E_ref| of all frames / largest external work external work, elastic energy, all that is accounted for
//! ```

use std::fmt::Write as _;
use std::time::Instant;

use clap::Args;
use glam::DVec3;
use serde::Serialize;

use super::SceneArgs;
use crate::ending;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::device;
use crate::observables::{EnergyAccount, FrameRecord};
use crate::simulation::Simulation;

/// Most that a run on an adapter may differ from the CPU engine, in percent: what f32 costs in the main job (0.02 % of the force)
/// five times over. A wrong kernel is beyond it by orders of magnitude.
pub const BOUNDS: Differences = Differences { force: Some(0.1), displacement: Some(0.1), energy: Some(0.1) };

#[derive(Debug, Clone, Default, Args)]
pub struct CompareArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

/// Differences from the CPU engine, in percent of the largest value; `None` where the scene has no such quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Differences {
    pub force: Option<f64>,
    pub displacement: Option<f64>,
    pub energy: Option<f64>,
}

/// How a run on an adapter compares.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// What the others are compared with.
    Reference,
    Within,
    /// A bound is broken.
    Beyond,
    /// The run failed: why.
    Failed(String),
    /// The adapter does not offer what the engine needs: why. No statement about the engine.
    NotOpened(String),
}

/// One run.
#[derive(Debug, Clone, Serialize)]
pub struct AdapterRow {
    pub adapter: String,
    /// `vulkan`, `gl`, `metal`, `dx12`, or `cpu` for the CPU engine.
    pub backend: String,
    pub driver: String,
    pub differences: Option<Differences>,
    /// Wall time of all frames [s], without preparing.
    pub wall_s: Option<f64>,
    pub verdict: Verdict,
}

/// All runs of one scene.
#[derive(Debug, Clone, Serialize)]
pub struct AdapterTable {
    pub scene: String,
    pub cells: usize,
    pub frames: usize,
    pub steps: u64,
    /// [%]
    pub bounds: Differences,
    pub rows: Vec<AdapterRow>,
}

/// What is compared of a run.
struct Trace {
    records: Vec<FrameRecord>,
    /// Displacement of the nodes at the deepest point, without a tool half-way, and at the end [m].
    displacement: Vec<Vec<DVec3>>,
    wall: f64,
}

/// The command: prints the table. The exit code is 1 where a bound is broken.
///
/// # Errors
/// As [`compare_adapters`].
pub fn execute(args: &CompareArgs) -> Result<u8> {
    ending::watch();
    let table = compare_adapters(args)?;
    println!("{}", if args.json { table.json() } else { table.table() }.trim_end());
    Ok(u8::from(table.is_broken()))
}

/// Runs the scene on the CPU engine and on every adapter of every backend.
///
/// # Errors
/// Those of the scene, and whatever stops the CPU engine: without it there is nothing to compare with.
pub fn compare_adapters(args: &CompareArgs) -> Result<AdapterTable> {
    let scene = args.scene.load()?;
    let mut simulation = Simulation::on(scene.clone(), None)?;
    let (cells, info) = (simulation.model.mesh.cell_count(), simulation.engine().info().clone());
    let reference = trace(&mut simulation)?;
    let mut table = AdapterTable {
        scene: scene.name.clone(),
        cells,
        frames: reference.records.len(),
        steps: simulation.total_steps(),
        bounds: BOUNDS,
        rows: vec![AdapterRow {
            adapter: info.adapter,
            backend: "cpu".into(),
            driver: info.driver,
            differences: None,
            wall_s: Some(reference.wall),
            verdict: Verdict::Reference,
        }],
    };
    for adapter in device::adapters()? {
        let info = adapter.get_info();
        let mut row = AdapterRow {
            adapter: info.name.clone(),
            backend: info.backend.to_str().into(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().into(),
            differences: None,
            wall_s: None,
            verdict: Verdict::Within,
        };
        eprintln!("{}", device::describe(&info));
        match Gpu::of_adapter(&adapter) {
            Err(error) => row.verdict = Verdict::NotOpened(first_line(&error)),
            Ok(gpu) => match Simulation::on(scene.clone(), Some(gpu)).and_then(|mut s| trace(&mut s)) {
                Err(error) => row.verdict = Verdict::Failed(first_line(&error)),
                Ok(found) => {
                    let differences = differences(&found, &reference);
                    row.wall_s = Some(found.wall);
                    row.differences = Some(differences);
                    if !differences.within(&BOUNDS) {
                        row.verdict = Verdict::Beyond;
                    }
                }
            },
        }
        table.rows.push(row);
    }
    Ok(table)
}

fn first_line(error: &Error) -> String {
    error.to_string().lines().next().unwrap_or_default().to_string()
}

fn trace(simulation: &mut Simulation) -> Result<Trace> {
    let last = simulation.frame_count() - 1;
    let depth = simulation.model.scene.motion.deepest();
    let deepest = simulation.model.kinematics.as_ref().and_then(|k| k.time_of_depth(depth));
    let stops = [deepest.map_or(last / 2, |time| simulation.frame_at(time)), last];
    stops.iter().for_each(|frame| simulation.stop_after(*frame));
    let mut found = Trace { records: Vec::new(), displacement: Vec::new(), wall: 0.0 };
    let begin = Instant::now();
    while let Some(record) = simulation.next_frame()? {
        if stops.contains(&record.frame) {
            found.displacement.push(simulation.engine().read_state()?.displacement);
        }
        found.records.push(record);
    }
    found.wall = begin.elapsed().as_secs_f64();
    Ok(found)
}

/// Largest difference over largest reference value, in percent; `None` where the reference is zero throughout. A value that is
/// no number counts as infinitely wrong.
fn percent(pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Option<f64> {
    let (mut difference, mut scale) = (0.0_f64, 0.0_f64);
    for (found, reference) in pairs {
        let apart = (found - reference).length();
        difference = if apart.is_finite() { difference.max(apart) } else { f64::INFINITY };
        scale = scale.max(reference.length());
    }
    (scale > 0.0).then(|| 100.0 * difference / scale)
}

fn differences(found: &Trace, reference: &Trace) -> Differences {
    let records = || found.records.iter().zip(&reference.records);
    let axial = percent(records().map(|(a, b)| (DVec3::X * a.force.axial, DVec3::X * b.force.axial)));
    let reactions = percent(records().flat_map(|(a, b)| a.reactions.into_iter().zip(b.reactions)));
    let work = reference.records.iter().map(|r| r.energy.external_max).fold(0.0, f64::max);
    let of: [fn(&EnergyAccount) -> f64; 3] = [|e| e.external, |e| e.elastic, EnergyAccount::accounted];
    let apart = records().flat_map(|(a, b)| of.map(|of| (of(&a.energy) - of(&b.energy)).abs()));
    let apart = apart.fold(0.0, |most: f64, x| if x.is_finite() { most.max(x) } else { f64::INFINITY });
    let nodes = found.displacement.iter().zip(&reference.displacement);
    Differences {
        // `None` is less than any number.
        force: if axial > reactions { axial } else { reactions },
        displacement: percent(nodes.flat_map(|(a, b)| a.iter().copied().zip(b.iter().copied()))),
        energy: (work > 0.0).then(|| 100.0 * apart / work),
    }
}

impl Differences {
    /// True where none is beyond its bound.
    pub fn within(&self, bounds: &Differences) -> bool {
        let parts = |d: &Differences| [d.force, d.displacement, d.energy];
        parts(self).iter().zip(parts(bounds)).all(|(value, bound)| value.is_none_or(|v| bound.is_none_or(|b| v <= b)))
    }
}

impl AdapterTable {
    /// True where an adapter breaks a bound or its run fails.
    pub fn is_broken(&self) -> bool {
        self.rows.iter().any(|row| matches!(row.verdict, Verdict::Beyond | Verdict::Failed(_)))
    }

    /// Adapters that were compared.
    pub fn compared(&self) -> usize {
        self.rows.iter().filter(|row| row.differences.is_some()).count()
    }

    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("numbers and texts can be written as JSON")
    }

    /// For the terminal.
    pub fn table(&self) -> String {
        let percent = |value: Option<f64>| value.map_or("-".into(), |v| format!("{v:.5} %"));
        let mut text = format!(
            "{}: {} cells, {} frames, {} steps; differences from the CPU engine (f64) in percent of the largest value\n",
            self.scene, self.cells, self.frames, self.steps
        );
        let mut line = |cells: [&str; 8]| {
            let [adapter, backend, driver, force, displacement, energy, wall, verdict] = cells;
            let row = format!(
                "{adapter:34} {backend:7} {driver:32} {force:>10} {displacement:>12} {energy:>10} {wall:>8} {verdict}"
            );
            writeln!(text, "{}", row.trim_end()).expect("text grows");
        };
        line(["adapter", "backend", "driver", "force", "displacement", "energy", "wall", "verdict"]);
        for row in &self.rows {
            let verdict = match &row.verdict {
                Verdict::Reference => "reference".to_string(),
                Verdict::Within => "within".into(),
                Verdict::Beyond => "BEYOND".into(),
                Verdict::Failed(reason) => format!("FAILED: {reason}"),
                Verdict::NotOpened(reason) => format!("not opened: {reason}"),
            };
            let d = row.differences;
            line([
                &shortened(&row.adapter, 34),
                &row.backend,
                &shortened(&row.driver, 32),
                &percent(d.and_then(|d| d.force)),
                &percent(d.and_then(|d| d.displacement)),
                &percent(d.and_then(|d| d.energy)),
                &row.wall_s.map_or("-".into(), |s| format!("{s:.2} s")),
                &verdict,
            ]);
        }
        let bounds = self.bounds;
        line(["bound", "", "", &percent(bounds.force), &percent(bounds.displacement), &percent(bounds.energy), "", ""]);
        if self.compared() == 0 {
            text += "no adapter was compared: `stylet adapters` tells which are there\n";
        }
        text
    }
}

fn shortened(text: &str, width: usize) -> String {
    match text.chars().count() > width {
        true => text.chars().take(width - 3).chain("...".chars()).collect(),
        false => text.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_beyond_a_bound_is_seen() {
        let pairs = |found: f64| [(DVec3::X * found, DVec3::X * 2.0), (DVec3::ZERO, DVec3::ZERO)].into_iter();
        assert_eq!(percent(pairs(2.0)), Some(0.0));
        assert!((percent(pairs(2.02)).unwrap() - 1.0).abs() < 1e-9);
        assert_eq!(percent(pairs(f64::NAN)), Some(f64::INFINITY));
        assert_eq!(percent([(DVec3::X, DVec3::ZERO)].into_iter()), None);
        let none = Differences { force: None, displacement: None, energy: None };
        assert!(none.within(&BOUNDS));
        assert!(Differences { force: Some(0.09), ..none }.within(&BOUNDS));
        for beyond in [
            Differences { force: Some(0.11), ..none },
            Differences { displacement: Some(f64::INFINITY), ..none },
            Differences { energy: Some(f64::NAN), ..none },
        ] {
            assert!(!beyond.within(&BOUNDS), "{beyond:?}");
        }
    }
}
