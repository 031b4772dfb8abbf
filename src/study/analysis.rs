//! From finished runs to what they tell: errors against the reference, fronts, orders, costs of effects.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::advice::{self, Candidate};
use super::metrics::{Errors, curve_error};
use super::order::{self, Fit, Richardson};
use super::pareto;
use super::plan::{LeftOut, Plan, Role};
use super::store::{RunRecord, Store};
use super::{Settings, scene_hash};
use crate::error::{Error, Result};
use crate::reading;
use crate::scene::Scene;
use crate::units::{three_decimals, trimmed};

/// What the errors and orders of the whole curve are called.
const FORCE_CURVE: &str = "force curve";

/// One finished run beside the reference.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    pub role: Role,
    pub settings: Settings,
    pub run: RunRecord,
    /// Against the reference; all `None` for a run that failed.
    pub errors: Errors,
    /// Relative L2 norm over depth of the difference of its force from that of the base.
    pub change: Option<f64>,
    /// On the Pareto front of force error and wall time.
    pub front: bool,
}

impl Row {
    /// True where its settings are a choice: all effects of the scene, the run kept its energy to the end, and it is no
    /// reference.
    pub fn is_choice(&self) -> bool {
        !matches!(self.role, Role::Reference | Role::Again | Role::Effects) && self.run.unfit().is_none()
    }
}

/// How far the times of two runs of the same settings are apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scatter {
    pub first_wall_s: f64,
    pub second_wall_s: f64,
    /// Relative L2 norm of the difference of their forces.
    pub force_curve: Option<f64>,
}

impl Scatter {
    /// The longer over the shorter.
    pub fn ratio(&self) -> f64 {
        self.first_wall_s.max(self.second_wall_s) / self.first_wall_s.min(self.second_wall_s)
    }
}

/// Convergence of one quantity in mesh size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// What it is, for people.
    pub what: String,
    /// (edge [mm], error against the reference), fine to coarse; meshes as fine as that of the reference are left out.
    pub errors: Vec<(f64, f64)>,
    pub fit: Option<Fit>,
    /// (edge [mm], value) of the three finest meshes, where the quantity is one number.
    pub values: Vec<(f64, f64)>,
    pub richardson: Option<Richardson>,
}

/// Order of the force curve that the study in this folder found; `None` where it holds none of this scene with these overrides, and where the
/// curves did not converge.
pub fn observed_order(folder: &Path, scene: &Scene, overrides: &[String]) -> Option<f64> {
    let (store, plan) = Store::existing(folder).ok()?;
    let text = reading::text(&scene.path, reading::most::SCENE).ok()?;
    if plan.scene_hash != scene_hash(&text, overrides) {
        return None;
    }
    let analysis = Analysis::read(&store, &plan).ok()?;
    let curve = analysis.orders.iter().find(|order| order.what == FORCE_CURVE)?;
    curve.fit.filter(|fit| fit.converges()).map(|fit| fit.order)
}

/// What an effect costs and what it changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EffectCost {
    /// Keys of the effects that came or went together.
    pub keys: Vec<String>,
    /// True where the scene does not have it.
    pub added: bool,
    /// Time per cell and step with it over without; processor time on software adapters, wall time on others.
    pub time_ratio: Option<f64>,
    /// Wall time of the whole run with it over without: its stable step counts too.
    pub wall_ratio: f64,
    /// Device memory per cell that it takes [byte].
    pub bytes_per_cell: f64,
    /// Relative L2 norm of the difference of the force over depth.
    pub force_curve: Option<f64>,
    /// Puncture peak and force at the deepest point, variant and base [N].
    pub puncture_n: [Option<f64>; 2],
    pub deepest_n: [Option<f64>; 2],
    pub failure: Option<String>,
}

/// A study as far as it is finished.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    pub plan: Plan,
    /// In the order of the plan.
    pub rows: Vec<Row>,
    /// Planned runs that are not there.
    pub missing: Vec<LeftOut>,
    pub scatter: Option<Scatter>,
    pub orders: Vec<Order>,
    pub effects: Vec<EffectCost>,
    /// What to choose, one sentence each.
    pub sentences: Vec<String>,
}

impl Analysis {
    /// Reads the finished runs of a plan.
    ///
    /// # Errors
    /// `Error::Input` where base or reference are missing or failed: without them there is nothing to compare with.
    pub fn read(store: &Store, plan: &Plan) -> Result<Self> {
        let mut found: Vec<(Role, Settings, RunRecord)> = Vec::new();
        let mut missing = Vec::new();
        for planned in &plan.runs {
            let run = store.run(&planned.id).filter(|run| run.belongs_to(plan, &planned.settings));
            match run {
                Some(run) => found.push((planned.role, planned.settings.clone(), run)),
                None => {
                    let known = plan.given_up.iter().find(|l| l.what == planned.id);
                    let reason = known.map_or("not run yet".into(), |l| l.reason.clone());
                    missing.push(LeftOut { what: plan.describe(planned), reason });
                }
            }
        }
        let of = |role: Role| -> Result<RunRecord> {
            let name = role.key();
            let run = found.iter().find(|(r, ..)| *r == role).map(|(.., run)| run.clone()).ok_or_else(|| {
                Error::input(
                    format!("the run `{name}` of the study in {} is missing", store.path().display()),
                    "go on with `stylet study` on the same scene and folder, or join all parts with --merge",
                )
            })?;
            match &run.failure {
                None => Ok(run),
                Some(why) => Err(Error::input(
                    format!("the run `{name}` ({}) failed: {why}", run.id),
                    "mend the scene, or choose other --axes or another --budget, with --force",
                )),
            }
        };
        let (reference, base) = (of(Role::Reference)?, of(Role::Base)?);
        let mut rows: Vec<Row> = found
            .into_iter()
            .map(|(role, settings, run)| {
                let usable = run.failure.is_none();
                Row {
                    role,
                    settings,
                    errors: if usable { Errors::of(&run, &reference) } else { Errors::default() },
                    change: usable.then(|| curve_error(&run.curve(), &base.curve())).flatten(),
                    front: false,
                    run,
                }
            })
            .collect();
        let points: Vec<(f64, f64)> = rows
            .iter()
            .map(|row| match row.errors.force_curve.filter(|_| row.is_choice()) {
                Some(error) => (row.run.wall_s, error),
                None => (f64::NAN, f64::NAN),
            })
            .collect();
        for (row, front) in rows.iter_mut().zip(pareto::front(&points)) {
            row.front = front;
        }
        let again = rows.iter().find(|row| row.role == Role::Again).map(|row| &row.run);
        let scatter = again.map(|again| Scatter {
            first_wall_s: base.wall_s,
            second_wall_s: again.wall_s,
            force_curve: curve_error(&again.curve(), &base.curve()),
        });
        let mut analysis = Analysis {
            orders: orders(&rows, &reference),
            effects: effect_costs(&rows, &base, &plan.base),
            sentences: Vec::new(),
            plan: plan.clone(),
            rows,
            missing,
            scatter,
        };
        analysis.sentences = advice::sentences(&analysis.adapter(), &analysis.candidates());
        Ok(analysis)
    }

    pub fn of(&self, role: Role) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.role == role)
    }

    pub fn reference(&self) -> Option<&Row> {
        self.of(Role::Reference).next()
    }

    pub fn base(&self) -> Option<&Row> {
        self.of(Role::Base).next()
    }

    /// Adapter of the base.
    pub fn adapter(&self) -> String {
        self.base().map_or(String::new(), |row| row.run.adapter.clone())
    }

    /// All adapters, drivers and parts that runs come from, each once.
    pub fn origins(&self) -> Vec<String> {
        let mut origins: Vec<String> = Vec::new();
        for row in &self.rows {
            let adapter = &row.run.adapter;
            let driver = if row.run.driver.is_empty() { String::new() } else { format!(" ({})", row.run.driver) };
            let origin = format!("{adapter}{driver}");
            if !origins.contains(&origin) {
                origins.push(origin);
            }
        }
        origins
    }

    /// Settings to choose from.
    pub fn candidates(&self) -> Vec<Candidate> {
        let choices = self.rows.iter().filter(|row| row.is_choice());
        let finest = self.reference().map(|row| row.settings.cell_size_mm);
        choices
            .filter_map(|row| {
                Some(Candidate {
                    settings: row.settings.clone(),
                    real_time_factor: row.run.real_time_factor(),
                    error: row.errors.force_curve?,
                    same_mesh: Some(row.settings.cell_size_mm) == finest,
                })
            })
            .collect()
    }
}

impl RunRecord {
    /// True where the run is one of the plan's: same scene, version and settings.
    pub fn belongs_to(&self, plan: &Plan, settings: &Settings) -> bool {
        self.scene_hash == plan.scene_hash && self.version == plan.version && self.settings.as_ref() == Some(settings)
    }
}

fn orders(rows: &[Row], reference: &RunRecord) -> Vec<Order> {
    let mut meshes: Vec<&Row> =
        rows.iter().filter(|row| matches!(row.role, Role::Base | Role::Mesh) && row.run.unfit().is_none()).collect();
    meshes.sort_by(|a, b| a.settings.cell_size_mm.total_cmp(&b.settings.cell_size_mm));
    if meshes.len() < 2 {
        return Vec::new();
    }
    let finest = reference.settings.as_ref().map_or(0.0, |s| s.cell_size_mm);
    type Number = fn(&RunRecord) -> Option<f64>;
    type Of = fn(&Errors) -> Option<f64>;
    let quantities: [(&str, Of, Option<Number>); 5] = [
        (FORCE_CURVE, |e| e.force_curve, None),
        ("displacement field at the deepest point", |e| e.displacement, None),
        ("puncture force", |e| e.puncture_force, Some(|r| r.puncture_force_n)),
        ("depth of the puncture", |e| e.puncture_depth, Some(|r| r.puncture_depth_m.map(|d| d * 1e3))),
        ("force at the deepest point", |e| e.deepest_force, Some(|r| r.force_at_max_depth_n)),
    ];
    let mut orders = Vec::new();
    for (what, error, value) in quantities {
        let coarser = meshes.iter().filter(|row| row.settings.cell_size_mm > finest);
        let errors: Vec<(f64, f64)> =
            coarser.filter_map(|row| Some((row.settings.cell_size_mm, error(&row.errors)?))).collect();
        let values: Vec<(f64, f64)> = value.map_or(Vec::new(), |value| {
            meshes.iter().take(3).filter_map(|row| Some((row.settings.cell_size_mm, value(&row.run)?))).collect()
        });
        if errors.is_empty() && values.is_empty() {
            continue;
        }
        let three: Option<[(f64, f64); 3]> = values.clone().try_into().ok();
        orders.push(Order {
            what: what.into(),
            fit: order::fit(&errors),
            errors,
            richardson: three.and_then(order::richardson),
            values,
        });
    }
    orders
}

fn effect_costs(rows: &[Row], base: &RunRecord, settings: &Settings) -> Vec<EffectCost> {
    let time = |run: &RunRecord| match run.software {
        true => run.cpu_ns_per_cell_step(),
        false => Some(run.wall_s * 1e9 / (run.cells * run.steps) as f64),
    };
    let costs = rows.iter().filter(|row| row.role == Role::Effects).map(|row| {
        let run = &row.run;
        let (added, removed) = row.settings.effects_beside(settings);
        let with_is_run = removed.is_empty();
        let (with, without) = if with_is_run { (run, base) } else { (base, run) };
        let bytes = |run: &RunRecord| run.device_bytes as f64 / run.cells as f64;
        EffectCost {
            keys: if with_is_run { added } else { removed },
            added: with_is_run,
            time_ratio: time(with).zip(time(without)).map(|(a, b)| a / b),
            wall_ratio: with.wall_s / without.wall_s,
            bytes_per_cell: bytes(with) - bytes(without),
            force_curve: row.change,
            puncture_n: [run.puncture_force_n, base.puncture_force_n],
            deepest_n: [run.force_at_max_depth_n, base.force_at_max_depth_n],
            failure: run.failure.clone(),
        }
    });
    costs.collect()
}

/// Convergence in mesh size in plain words, one sentence for the force curve and one per number with a limit.
pub fn convergence_in_words(orders: &[Order]) -> Vec<String> {
    let mut sentences = Vec::new();
    let Some(curve) = orders.iter().find(|o| o.what == FORCE_CURVE) else {
        return vec!["Mesh size was not varied, so there is nothing to say about convergence in it.".into()];
    };
    let percent = |e: f64| format!("{} %", three_decimals(100.0 * e));
    let list: Vec<String> =
        curve.errors.iter().map(|(h, e)| format!("{} at {} mm", percent(*e), trimmed(*h))).collect();
    sentences.push(match curve.fit {
        Some(fit) if fit.converges() => format!(
            "The error of the force curve falls with the power {:.2} of the edge (least squares over {} meshes, R2 {:.2}): {}.",
            fit.order,
            fit.points,
            fit.r2,
            list.join(", ")
        ),
        Some(fit) => format!(
            "The data do not show convergence of the force curve in mesh size: the line through {} meshes has the slope {:.2} \
             with R2 {:.2} ({}).",
            fit.points,
            fit.order,
            fit.r2,
            list.join(", ")
        ),
        None => format!(
            "Too few meshes coarser than the reference for an order of the force curve ({}).",
            if list.is_empty() { "none".into() } else { list.join(", ") }
        ),
    });
    // Far from the reference its own error counts least.
    if let [.., (fine, near), (coarse, far)] = curve.errors[..]
        && curve.fit.is_some()
    {
        sentences.push(format!(
            "The error of the reference itself is in none of these numbers; it makes the finest meshes look better and the fitted \
             power larger. Between the two coarsest meshes alone the power is {:.2}.",
            (far / near).ln() / (coarse / fine).ln()
        ));
    }
    for order in orders.iter().filter(|o| !o.values.is_empty()) {
        let unit = if order.what.starts_with("depth") { "mm" } else { "N" };
        let values: Vec<String> =
            order.values.iter().map(|(h, v)| format!("{v:.4} {unit} at {} mm", trimmed(*h))).collect();
        sentences.push(match order.richardson {
            Some(r) if r.order < 10.0 => format!(
                "{}: {}; the three-mesh form gives the order {:.2} and the limit {:.4} {unit}, from which the finest of \
                 them is {} away.",
                sentence_case(&order.what),
                values.join(", "),
                r.order,
                r.limit,
                percent(r.error_of_finest)
            ),
            Some(_) => format!(
                "{}: {}; the two finest meshes are so close that the three-mesh form gives no order.",
                sentence_case(&order.what),
                values.join(", ")
            ),
            None if order.values.len() == 3 => format!(
                "{}: {}; the three finest meshes do not approach a limit from one side, so no order can be read off them.",
                sentence_case(&order.what),
                values.join(", ")
            ),
            None => format!("{}: {}; fewer than three meshes hold it.", sentence_case(&order.what), values.join(", ")),
        });
    }
    sentences
}

fn sentence_case(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}
