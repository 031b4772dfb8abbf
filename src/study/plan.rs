//! Which runs a study makes: axes around a base, a small grid, and the reference, as far as a budget of time allows.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::subject::{DECIMALS, Subject, Variant};
use super::{Axis, Engine, MeshSize, Settings};
use crate::error::{Error, Result};
use crate::units::{rounded, trimmed};

/// Part of the budget that the reference may take, and that all runs together may be predicted to take: predictions from short
/// runs are off by some, and machines drift.
const REFERENCE_SHARE: f64 = 0.35;
const PLANNED_SHARE: f64 = 0.85;
/// Mesh sizes follow one another by this ratio; levels finer and coarser than the base that are looked at.
const MESH_RATIO: f64 = std::f64::consts::SQRT_2;
const FINER_LEVELS: i32 = 6;
const COARSER_LEVELS: i32 = 2;
/// Factors on the mass scaling of the base.
const MASS_FACTORS: [f64; 4] = [4.0, 0.25, 16.0, 0.0625];
/// Those that a reference may have, best first; it keeps that of the base where only the mesh is varied.
const REFERENCE_MASS_FACTORS: [f64; 2] = [0.0625, 0.25];
/// Factors on the safety of the base; 1 is the most that a scene may have.
const STEP_FACTORS: [f64; 2] = [0.5, 1.25];
/// Mesh levels (positive: coarser) and factors on the mass scaling of the grid: the corners that axes alone do not show.
const GRID: [(i32, f64); 8] = [(1, 4.0), (1, 16.0), (2, 4.0), (2, 16.0), (-1, 4.0), (-1, 16.0), (-2, 4.0), (-2, 16.0)];
/// Predicted cost of a run with an effect more over the same without.
const ADDED_EFFECT: f64 = 1.5;
/// Preparation of a run beside its steps [s]: mesh, model, shaders.
const SETUP_S: f64 = 0.2;

/// Wall time of one step [s]: `step_s + cells * cell_step_s`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct UnitCost {
    pub step_s: f64,
    pub cell_step_s: f64,
}

impl UnitCost {
    /// Cost of two meshes (cells, wall time of a step [s]) as a straight line that is never negative.
    pub fn through(small: (u64, f64), large: (u64, f64)) -> Self {
        let span = large.0 as f64 - small.0 as f64;
        let least = large.1 / large.0 as f64;
        let slope = if span > 0.0 { (large.1 - small.1) / span } else { least };
        // Noise may tilt the line beyond "all of it per step" and "all of it per cell".
        let cell_step_s = slope.clamp(0.25 * least, least);
        UnitCost { step_s: (large.1 - large.0 as f64 * cell_step_s).max(0.0), cell_step_s }
    }

    pub fn of_step(&self, cells: u64) -> f64 {
        self.step_s + cells as f64 * self.cell_step_s
    }
}

/// Costs by which a plan is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Costs {
    pub engines: BTreeMap<Engine, UnitCost>,
    /// True where they were measured on this machine.
    pub measured: bool,
}

impl Costs {
    /// Fixed costs, about those of two cores with a software adapter: parts of a study on several machines must agree on the
    /// plan without talking to one another.
    pub fn assumed() -> Self {
        let cost = |step_s: f64, cell_step_s: f64| UnitCost { step_s, cell_step_s };
        let engines = [
            (Engine::Gpu, cost(100e-6, 60e-9)),
            (Engine::Cpu, cost(20e-6, 40e-9)),
            (Engine::Cpu64, cost(20e-6, 190e-9)),
        ];
        Costs { engines: engines.into(), measured: false }
    }
}

/// Why a run is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    Base,
    /// The base a second time.
    Again,
    Reference,
    Mesh,
    Mass,
    Step,
    Engine,
    /// The base with an effect more or less.
    Effects,
    /// Mesh size and mass scaling changed together.
    Grid,
}

impl Role {
    /// For tables.
    pub fn key(self) -> &'static str {
        match self {
            Role::Base => "base",
            Role::Again => "base again",
            Role::Reference => "reference",
            Role::Mesh => "mesh",
            Role::Mass => "mass",
            Role::Step => "step",
            Role::Engine => "engine",
            Role::Effects => "effects",
            Role::Grid => "grid",
        }
    }
}

/// One run of the plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlannedRun {
    pub id: String,
    pub role: Role,
    pub settings: Settings,
    pub cells: u64,
    pub steps: u64,
    /// Wall time [s].
    pub predicted_s: f64,
}

/// What a plan or a study leaves out, and why.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LeftOut {
    pub what: String,
    pub reason: String,
}

/// A reference that was run and cannot be one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Unfit {
    pub what: String,
    pub reason: String,
    /// Wall time that it took [s].
    pub took_s: f64,
}

/// The runs of a study in their order, and everything that they share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    pub scene: String,
    pub title: String,
    /// Of the text of the scene and its overrides.
    pub scene_hash: String,
    pub overrides: Vec<String>,
    /// Program version.
    pub version: String,
    pub axes: Vec<Axis>,
    pub budget_s: f64,
    pub base: Settings,
    pub costs: Costs,
    pub runs: Vec<PlannedRun>,
    /// Runs that did not fit into the budget, in the order in which they are run where the machine is faster than predicted.
    #[serde(default)]
    pub spare: Vec<PlannedRun>,
    pub left_out: Vec<LeftOut>,
    /// Finest edge that may be planned [mm], as the user wants it and as references that were not fit leave it; 0: no limit.
    #[serde(default)]
    pub asked_finest_mm: f64,
    #[serde(default)]
    pub finest_mm: f64,
    /// References that were run and were not fit.
    #[serde(default)]
    pub unfit: Vec<Unfit>,
    /// Planned runs that were given up because the machine was slower than predicted, by name.
    #[serde(default)]
    pub given_up: Vec<LeftOut>,
    /// Effects that are neither switched on nor off.
    pub skipped: Vec<LeftOut>,
    /// What is not as the scene has it, one sentence each.
    pub changes: Vec<String>,
}

/// What the choice of runs needs to know of a scene.
#[derive(Debug, Clone)]
pub struct Basis<'a> {
    pub base: &'a Settings,
    /// Simulated time of a run [s], and frames per simulated second [1/s].
    pub duration_s: f64,
    pub frame_rate: f64,
    /// True where the cells have an edge that can be chosen.
    pub has_block: bool,
    pub variants: &'a [Variant],
}

/// Chosen runs, and what had to be left out.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Choice {
    pub runs: Vec<PlannedRun>,
    /// Wanted, but too much for the budget.
    pub spare: Vec<PlannedRun>,
    /// What cannot be run, and why.
    pub left_out: Vec<LeftOut>,
}

/// Sizes of meshes by the level of their edge: `base * MESH_RATIO^level`.
struct Meshes<'a> {
    base_mm: f64,
    size_of: &'a mut dyn FnMut(f64) -> std::result::Result<MeshSize, String>,
    known: BTreeMap<i32, std::result::Result<MeshSize, String>>,
}

impl Meshes<'_> {
    fn edge(&self, level: i32) -> f64 {
        if level == 0 { self.base_mm } else { rounded(self.base_mm * MESH_RATIO.powi(level), DECIMALS) }
    }

    fn size(&mut self, level: i32) -> std::result::Result<MeshSize, String> {
        let edge = self.edge(level);
        self.known.entry(level).or_insert_with(|| (self.size_of)(edge)).clone()
    }
}

impl Plan {
    /// The plan of a subject.
    ///
    /// # Errors
    /// As [`choose`].
    pub fn new(subject: &Subject, axes: &[Axis], budget_s: f64, costs: Costs, finest_mm: f64) -> Result<Self> {
        Self::with_unfit(subject, axes, (budget_s, budget_s), costs, (finest_mm, finest_mm), Vec::new())
    }

    /// The plan without the meshes as fine as that of this plan's reference, which was not fit.
    ///
    /// # Errors
    /// As [`choose`].
    pub fn with_coarser_reference(&self, subject: &Subject, reason: String, took_s: f64) -> Result<Self> {
        let Some(reference) = self.reference() else { return Ok(self.clone()) };
        let mut unfit = self.unfit.clone();
        unfit.push(Unfit { what: reference.settings.describe(), reason, took_s });
        let left = self.budget_s - unfit.iter().map(|u| u.took_s).sum::<f64>();
        // Any edge between this one and the next.
        let finest = reference.settings.cell_size_mm * MESH_RATIO.sqrt();
        let costs = self.costs.clone();
        Self::with_unfit(subject, &self.axes, (self.budget_s, left), costs, (self.asked_finest_mm, finest), unfit)
    }

    /// `budget`: whole and left [s]; `finest`: as asked and as it is [mm].
    fn with_unfit(
        subject: &Subject,
        axes: &[Axis],
        budget: (f64, f64),
        costs: Costs,
        finest: (f64, f64),
        unfit: Vec<Unfit>,
    ) -> Result<Self> {
        let basis = Basis {
            base: &subject.base,
            duration_s: subject.duration(),
            frame_rate: subject.scene.solver.frame_rate,
            has_block: subject.has_block(),
            variants: &subject.variants,
        };
        let coarsest = subject.coarsest_mm();
        let mut size_of = |edge: f64| match edge {
            _ if edge < finest.1 => {
                Err(format!("finer than {} mm is not planned", trimmed(rounded(finest.1, DECIMALS))))
            }
            _ if edge > coarsest => Err(format!(
                "wider than the path of the needle, {} mm: what such cells give does not converge",
                trimmed(rounded(coarsest, DECIMALS))
            )),
            _ => subject.mesh_size(edge),
        };
        let choice = choose(&basis, axes, budget.1, &costs, &mut size_of)?;
        let skipped = if axes.contains(&Axis::Effects) { &subject.skipped[..] } else { &[] };
        Ok(Plan {
            scene: subject.scene.name.clone(),
            title: subject.scene.title.clone(),
            scene_hash: subject.scene_hash(),
            overrides: subject.overrides.clone(),
            version: env!("CARGO_PKG_VERSION").into(),
            axes: axes.to_vec(),
            budget_s: budget.0,
            base: subject.base.clone(),
            costs,
            runs: choice.runs,
            spare: choice.spare,
            left_out: choice.left_out,
            asked_finest_mm: finest.0,
            finest_mm: finest.1,
            unfit,
            given_up: Vec::new(),
            skipped: skipped
                .iter()
                .map(|(what, reason)| LeftOut { what: what.clone(), reason: reason.clone() })
                .collect(),
            changes: subject.changes.clone(),
        })
    }

    pub fn reference(&self) -> Option<&PlannedRun> {
        self.runs.iter().find(|run| run.role == Role::Reference)
    }

    /// Wall time that went into references that were not fit [s].
    pub fn lost_s(&self) -> f64 {
        self.unfit.iter().map(|unfit| unfit.took_s).sum()
    }

    /// One line about a run, with the effects that it has more or less than the base.
    pub fn describe(&self, run: &PlannedRun) -> String {
        let (with, without) = run.settings.effects_beside(&self.base);
        let mut text = format!("{}: {}", run.role.key(), run.settings.describe());
        for (word, keys) in [("with", with), ("without", without)] {
            // Mass scaling comes and goes with its factor.
            let keys: Vec<String> = keys.into_iter().filter(|key| key != "mass_scaling").collect();
            if !keys.is_empty() {
                text += &format!(", {word} {}", keys.join(" and "));
            }
        }
        text
    }

    /// Wall time of all runs [s].
    pub fn predicted_s(&self) -> f64 {
        self.runs.iter().map(|run| run.predicted_s).sum()
    }
}

/// Chooses the runs. `size_of` tells the size of the mesh with cells of an edge [mm], or why there is none.
///
/// # Errors
/// `Error::Input` where the budget allows no reference that is better than the base.
pub fn choose(
    basis: &Basis,
    axes: &[Axis],
    budget_s: f64,
    costs: &Costs,
    size_of: &mut dyn FnMut(f64) -> std::result::Result<MeshSize, String>,
) -> Result<Choice> {
    let base = basis.base;
    let meshes = Meshes { base_mm: base.cell_size_mm, size_of, known: BTreeMap::new() };
    let mut planner = Planner { basis, axes, costs, meshes };
    let base_size = planner.meshes.size(0).map_err(|reason| {
        Error::input(format!("the scene does not run as it is: {reason}"), "see `stylet check` on the scene")
    })?;
    let base_run = planner
        .planned(Role::Base, base.clone(), base_size)
        .ok_or_else(|| Error::input("the cost of the base engine is not known", "measure it, or leave --shard away"))?;
    let Some((reference_level, reference)) = planner.reference(REFERENCE_SHARE * budget_s) else {
        // Four times the mass scaling less takes twice as many steps.
        let least = 2.0 * base_run.predicted_s / REFERENCE_SHARE;
        return Err(Error::input(
            format!(
                "{:.2} minutes allow no reference that is better than the base: that takes about {:.0} s alone",
                budget_s / 60.0,
                base_run.predicted_s
            ),
            format!("give more time, about --budget {:.1} or more, or more axes", (least / 60.0).max(0.1)),
        ));
    };
    let mut choice = Choice::default();
    if let Err(reason) = planner.meshes.size(reference_level - 1)
        && reference_level > planner.finest_level()
    {
        let what = format!("cells of {} mm", trimmed(planner.meshes.edge(reference_level - 1)));
        choice.left_out.push(LeftOut { what, reason });
    }
    let wanted = planner.wanted(reference_level, &mut choice.left_out);
    let mut left = PLANNED_SHARE * budget_s - 2.0 * base_run.predicted_s - reference.predicted_s;
    choice.runs = vec![base_run, reference];
    for (role, settings, level) in wanted {
        if choice.runs.iter().any(|run| run.settings == settings) {
            continue;
        }
        match planner.meshes.size(level) {
            Err(reason) => {
                let what = format!("{}: {}", role.key(), settings.describe());
                choice.left_out.push(LeftOut { what, reason });
            }
            Ok(size) => match planner.planned(role, settings, size) {
                Some(run) if role == Role::Again => choice.runs.push(run),
                Some(run) if run.predicted_s <= left => {
                    left -= run.predicted_s;
                    choice.runs.push(run);
                }
                Some(run) => choice.spare.push(run),
                None => {}
            },
        }
    }
    Ok(choice)
}

/// What [`choose`] knows while it chooses.
struct Planner<'a> {
    basis: &'a Basis<'a>,
    axes: &'a [Axis],
    costs: &'a Costs,
    meshes: Meshes<'a>,
}

impl Planner<'_> {
    fn has(&self, axis: Axis) -> bool {
        self.axes.contains(&axis)
    }

    /// Level of the finest mesh that is looked at.
    fn finest_level(&self) -> i32 {
        if self.has(Axis::Mesh) && self.basis.has_block { -FINER_LEVELS } else { 0 }
    }

    /// A run with its cost; `None` where that of its engine is not known.
    fn planned(&self, role: Role, settings: Settings, size: MeshSize) -> Option<PlannedRun> {
        let (basis, base) = (self.basis, self.basis.base);
        let cost = self.costs.engines.get(&settings.engine)?;
        let steps = steps(basis, size, &settings);
        let added = !settings.effects_beside(base).0.iter().all(|key| key == "mass_scaling");
        let factor = if added { ADDED_EFFECT } else { 1.0 };
        let predicted_s = SETUP_S + factor * steps as f64 * cost.of_step(size.cells);
        Some(PlannedRun { id: settings.id(base), role, settings, cells: size.cells, steps, predicted_s })
    }

    /// The settings with `factor` times the mass scaling of the base.
    fn with_mass(&self, settings: Settings, factor: f64) -> Settings {
        let mass_scaling = rounded((self.basis.base.mass_scaling * factor).max(1.0), DECIMALS);
        let mut settings = Settings { mass_scaling, ..settings };
        let key = "mass_scaling".to_string();
        if settings.mass_scaling > 1.0 && !settings.effects.contains(&key) {
            settings.effects.insert(0, key);
        }
        settings
    }

    /// The reference with the level of its mesh: the finest mesh on which it takes at most `share_s` [s]; on it lanes, which are
    /// 5e-5 of the peak from f64 in a fifth of its time (`tests/lanes.rs`), then f64, then a GPU; then the lowest mass scaling.
    fn reference(&mut self, share_s: f64) -> Option<(i32, PlannedRun)> {
        let base = self.basis.base;
        for level in self.finest_level()..=0 {
            let Ok(size) = self.meshes.size(level) else { continue };
            for engine in [Engine::Cpu, Engine::Cpu64, Engine::Gpu] {
                // Something has to be better than in the base.
                let lower = self.has(Axis::Mass) || !self.has(Axis::Mesh);
                let factors: &[f64] = if lower { &REFERENCE_MASS_FACTORS } else { &[1.0] };
                for factor in factors {
                    let settings = Settings { cell_size_mm: self.meshes.edge(level), engine, ..base.clone() };
                    let run = self.planned(Role::Reference, self.with_mass(settings, *factor), size);
                    let Some(run) = run.filter(|run| run.predicted_s <= share_s) else { continue };
                    if run.settings != *base {
                        return Some((level, run));
                    }
                }
            }
        }
        None
    }

    /// The runs that are wanted beside base and reference, with the levels of their meshes, by how much is wanted; adds what
    /// cannot be had.
    fn wanted(&self, reference_level: i32, left_out: &mut Vec<LeftOut>) -> Vec<(Role, Settings, i32)> {
        let (basis, base) = (self.basis, self.basis.base);
        let mut wanted: Vec<(Role, Settings, i32)> = Vec::new();
        let of_edge = |level: i32| Settings { cell_size_mm: self.meshes.edge(level), ..base.clone() };
        if self.has(Axis::Mesh) && basis.has_block {
            let mut levels: Vec<i32> = (reference_level..=COARSER_LEVELS).filter(|level| *level != 0).collect();
            levels.sort_by_key(|level| (level.abs(), *level));
            wanted.extend(levels.into_iter().map(|level| (Role::Mesh, of_edge(level), level)));
        }
        if self.has(Axis::Mesh) && !basis.has_block {
            left_out.push(LeftOut {
                what: "axis mesh".into(),
                reason: "the mesh of this scene is a file; its edges cannot be chosen".into(),
            });
        }
        // Minutes after the first run of the same, and never for want of time: without it no time means anything.
        let again = Settings { repetition: 1, ..base.clone() };
        wanted.push((Role::Again, again, 0));
        if self.has(Axis::Mass) {
            wanted.extend(MASS_FACTORS.map(|factor| (Role::Mass, self.with_mass(base.clone(), factor), 0)));
        }
        if self.has(Axis::Engine) {
            let others = self.costs.engines.keys().filter(|engine| **engine != base.engine);
            wanted.extend(others.map(|engine| (Role::Engine, Settings { engine: *engine, ..base.clone() }, 0)));
            if !self.costs.engines.contains_key(&Engine::Gpu) {
                left_out.push(LeftOut {
                    what: "engine gpu".into(),
                    reason: "no adapter was found, or --engine cpu looks for none".into(),
                });
            }
        }
        if self.has(Axis::Step) {
            let safeties = STEP_FACTORS.map(|factor| rounded((base.safety * factor).min(1.0), DECIMALS));
            wanted.extend(safeties.map(|safety| (Role::Step, Settings { safety, ..base.clone() }, 0)));
        }
        if self.has(Axis::Effects) {
            let variants = basis.variants.iter().map(|v| Settings { effects: v.effects.clone(), ..base.clone() });
            wanted.extend(variants.map(|settings| (Role::Effects, settings, 0)));
        }
        if self.has(Axis::Mesh) && self.has(Axis::Mass) && basis.has_block {
            let grid = GRID.iter().filter(|(level, _)| *level >= reference_level);
            wanted.extend(grid.map(|(level, factor)| (Role::Grid, self.with_mass(of_edge(*level), *factor), *level)));
        }
        wanted
    }
}

/// Steps of a run: whole steps in every frame, none longer than its settings allow.
pub fn steps(basis: &Basis, size: MeshSize, settings: &Settings) -> u64 {
    let step = settings.safety * size.unit_step_s * settings.mass_scaling.sqrt();
    let per_frame = (1.0 / basis.frame_rate / step).ceil().max(1.0);
    (basis.duration_s * basis.frame_rate * per_frame).ceil() as u64
}

/// The runs of part `part` of `of` (from 1): long ones first, each to the part that has least to do. The base and its
/// repetition stay together, because their times are compared.
pub fn shard(runs: &[PlannedRun], part: usize, of: usize) -> Vec<&PlannedRun> {
    let time = |run: &PlannedRun| match run.role {
        Role::Base => {
            run.predicted_s + runs.iter().filter(|r| r.role == Role::Again).map(|r| r.predicted_s).sum::<f64>()
        }
        _ => run.predicted_s,
    };
    let mut order: Vec<&PlannedRun> = runs.iter().filter(|run| run.role != Role::Again).collect();
    order.sort_by(|a, b| time(b).total_cmp(&time(a)).then_with(|| a.id.cmp(&b.id)));
    let mut loads = vec![0.0_f64; of];
    let mut mine: Vec<&str> = Vec::new();
    for run in order {
        let least = (0..of).min_by(|a, b| loads[*a].total_cmp(&loads[*b])).unwrap_or(0);
        loads[least] += time(run);
        if least + 1 == part {
            mine.push(&run.id);
            if run.role == Role::Base {
                mine.extend(runs.iter().filter(|r| r.role == Role::Again).map(|r| r.id.as_str()));
            }
        }
    }
    runs.iter().filter(|run| mine.contains(&run.id.as_str())).collect()
}
