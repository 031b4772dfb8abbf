//! `study.csv` and `study.json`: every finished run with its errors and costs, and what they tell.

use std::path::Path;

use serde::Serialize;

use super::analysis::{Analysis, EffectCost, Order, Row, Scatter};
use super::metrics::Errors;
use super::plan::{LeftOut, PlannedRun};
use super::store::write_json;
use super::{Axis, Settings};
use crate::error::{Error, Result};
use crate::whole_file;

/// Columns of `study.csv`; relative errors are fractions.
const COLUMNS: [&str; 29] = [
    "run",
    "role",
    "cell_size_mm",
    "mass_scaling",
    "safety",
    "engine",
    "effects",
    "adapter",
    "status",
    "cells",
    "steps",
    "dt_s",
    "simulated_s",
    "wall_s",
    "setup_s",
    "real_time_factor",
    "cpu_ns_per_cell_step",
    "device_bytes",
    "force_curve_error",
    "puncture_force_error",
    "puncture_depth_error",
    "deepest_force_error",
    "displacement_error",
    "energy_imbalance",
    "force_curve_change_from_base",
    "puncture_force_n",
    "puncture_depth_m",
    "force_at_max_depth_n",
    "on_front",
];

/// Writes one row per finished run, whole or not at all.
pub fn write_csv(path: &Path, analysis: &Analysis) -> Result<()> {
    let failed = |reason: csv::Error| Error::file(path, reason.into());
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS).map_err(failed)?;
    for row in &analysis.rows {
        writer.write_record(fields(row)).map_err(failed)?;
    }
    let bytes = writer.into_inner().map_err(|reason| Error::file(path, reason.into_error()))?;
    whole_file::write(path, &bytes)
}

fn fields(row: &Row) -> [String; COLUMNS.len()] {
    let (s, r, e) = (&row.settings, &row.run, &row.errors);
    let number = |value: f64| format!("{value}");
    let optional = |value: Option<f64>| value.map_or(String::new(), number);
    [
        r.id.clone(),
        row.role.key().into(),
        number(s.cell_size_mm),
        number(s.mass_scaling),
        number(s.safety),
        s.engine.key().into(),
        s.effects.join(" "),
        r.adapter.clone(),
        r.failure.as_deref().map_or("ok".into(), |why| format!("failed: {why}")),
        r.cells.to_string(),
        r.steps.to_string(),
        number(r.dt_s),
        number(r.simulated_s),
        number(r.wall_s),
        number(r.setup_s),
        number(r.real_time_factor()),
        optional(r.cpu_ns_per_cell_step()),
        r.device_bytes.to_string(),
        optional(e.force_curve),
        optional(e.puncture_force),
        optional(e.puncture_depth),
        optional(e.deepest_force),
        optional(e.displacement),
        optional(r.energy_imbalance),
        optional(row.change),
        optional(r.puncture_force_n),
        optional(r.puncture_depth_m),
        optional(r.force_at_max_depth_n),
        row.front.to_string(),
    ]
}

/// The keys of `study.json`.
#[derive(Serialize)]
struct Figures<'a> {
    scene: &'a str,
    title: &'a str,
    version: &'a str,
    overrides: &'a [String],
    axes: &'a [Axis],
    budget_s: f64,
    adapter: String,
    sentences: &'a [String],
    changes: &'a [String],
    reference: Option<&'a Settings>,
    base: &'a Settings,
    scatter: Option<Scatter>,
    runs: Vec<RunFigures<'a>>,
    orders: &'a [Order],
    effects: &'a [EffectCost],
    skipped_effects: &'a [LeftOut],
    left_out: &'a [LeftOut],
    left_out_for_the_budget: &'a [PlannedRun],
    missing: &'a [LeftOut],
}

#[derive(Serialize)]
struct RunFigures<'a> {
    id: &'a str,
    role: &'a str,
    settings: &'a Settings,
    failure: Option<&'a str>,
    adapter: &'a str,
    cells: u64,
    steps: u64,
    dt_s: f64,
    wall_s: f64,
    real_time_factor: f64,
    cpu_ns_per_cell_step: Option<f64>,
    device_bytes: u64,
    errors: Errors,
    energy_imbalance: Option<f64>,
    force_curve_change_from_base: Option<f64>,
    puncture_force_n: Option<f64>,
    puncture_depth_m: Option<f64>,
    force_at_max_depth_n: Option<f64>,
    clamped_nodes: u64,
    inverted_cells: u64,
    on_front: bool,
}

/// Writes everything but the curves, whole or not at all.
pub fn write_figures(path: &Path, analysis: &Analysis) -> Result<()> {
    let plan = &analysis.plan;
    let runs = analysis.rows.iter().map(|row| RunFigures {
        id: &row.run.id,
        role: row.role.key(),
        settings: &row.settings,
        failure: row.run.failure.as_deref(),
        adapter: &row.run.adapter,
        cells: row.run.cells,
        steps: row.run.steps,
        dt_s: row.run.dt_s,
        wall_s: row.run.wall_s,
        real_time_factor: row.run.real_time_factor(),
        cpu_ns_per_cell_step: row.run.cpu_ns_per_cell_step(),
        device_bytes: row.run.device_bytes,
        errors: row.errors,
        energy_imbalance: row.run.energy_imbalance,
        force_curve_change_from_base: row.change,
        puncture_force_n: row.run.puncture_force_n,
        puncture_depth_m: row.run.puncture_depth_m,
        force_at_max_depth_n: row.run.force_at_max_depth_n,
        clamped_nodes: row.run.clamped_nodes,
        inverted_cells: row.run.inverted_cells,
        on_front: row.front,
    });
    let figures = Figures {
        scene: &plan.scene,
        title: &plan.title,
        version: &plan.version,
        overrides: &plan.overrides,
        axes: &plan.axes,
        budget_s: plan.budget_s,
        adapter: analysis.adapter(),
        sentences: &analysis.sentences,
        changes: &plan.changes,
        reference: analysis.reference().map(|row| &row.settings),
        base: &plan.base,
        scatter: analysis.scatter,
        runs: runs.collect(),
        orders: &analysis.orders,
        effects: &analysis.effects,
        skipped_effects: &plan.skipped,
        left_out: &plan.left_out,
        left_out_for_the_budget: &plan.spare,
        missing: &analysis.missing,
    };
    write_json(path, &figures)
}
