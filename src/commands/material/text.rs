//! What the command prints and writes: head, table, CSV, JSON records.

use std::fmt::Write;

use super::*;
use crate::scene::tissue_preset::TissuePreset;

/// Keys of the effects that are on, or `elastic`.
pub(super) fn effect_keys(material: &Material) -> String {
    let mut keys = Vec::new();
    keys.extend(material.plasticity.map(|_| plasticity::EFFECT.key));
    keys.extend(material.fibres.map(|_| fibres::EFFECT.key));
    keys.extend(material.viscoelastic.as_ref().map(|_| viscoelastic::EFFECT.key));
    keys.extend(material.damage.map(|_| damage::EFFECT.key));
    keys.extend(material.own.iter().map(|chosen| chosen.effect.effect.key));
    if keys.is_empty() { "elastic".into() } else { keys.join(", ") }
}

/// One row in SI units; the first keys are a promise to programs that read it.
#[derive(Serialize)]
pub(super) struct Record {
    mode: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    stretch: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    shear: Option<f64>,
    nominal_stress_pa: f64,
    cauchy_stress_pa: f64,
    cycle: usize,
    leg: &'static str,
    time_s: f64,
    lateral_stretch: [f64; 2],
    j: f64,
    plastic_strain: f64,
    damage: f64,
    work_j_m3: f64,
    stored_j_m3: f64,
    dissipated_j_m3: f64,
    /// `volume`, `exponent`, `stretch` where the law is continued, else null.
    continuation: Option<&'static str>,
}

pub(super) fn record(mode: Mode, row: &Row) -> Record {
    let is_shear = mode == Mode::Shear;
    Record {
        mode: mode.key(),
        stretch: (!is_shear).then_some(row.control),
        shear: is_shear.then_some(row.control),
        nominal_stress_pa: row.nominal,
        cauchy_stress_pa: row.cauchy,
        cycle: row.cycle + 1,
        leg: row.leg.key(),
        time_s: row.time,
        lateral_stretch: row.lateral,
        j: row.jacobian,
        plastic_strain: row.plastic_strain,
        damage: row.damage,
        work_j_m3: row.work,
        stored_j_m3: row.stored,
        dissipated_j_m3: row.dissipated,
        continuation: row.continuation.map(Continuation::key),
    }
}

/// The rows as CSV; one of the columns `stretch` and `shear` is empty.
pub(super) fn csv(curves: &[(Mode, Vec<Row>)]) -> String {
    let mut text = String::from(
        "mode,stretch,shear,nominal_stress_pa,cauchy_stress_pa,cycle,leg,time_s,lateral_stretch_2,lateral_stretch_3,\
         j,plastic_strain,damage,work_j_m3,stored_j_m3,dissipated_j_m3,continuation\n",
    );
    let cell = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    for (mode, rows) in curves {
        for r in rows.iter().map(|row| record(*mode, row)) {
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                r.mode,
                cell(r.stretch),
                cell(r.shear),
                r.nominal_stress_pa,
                r.cauchy_stress_pa,
                r.cycle,
                r.leg,
                r.time_s,
                r.lateral_stretch[0],
                r.lateral_stretch[1],
                r.j,
                r.plastic_strain,
                r.damage,
                r.work_j_m3,
                r.stored_j_m3,
                r.dissipated_j_m3,
                r.continuation.unwrap_or_default()
            );
        }
    }
    text
}

/// Material, verdict, effects and test, one labelled line each.
pub(super) fn head(args: &MaterialArgs, subject: &Subject) -> String {
    let m = &subject.material;
    let mut text = String::new();
    let mut line = |label: &str, value: &str| wrapped(&mut text, label, value);
    let kpa = |v: f64| four_digits(v / KPA);
    line("material", &format!("{}, law {}", subject.name, m.law.isochoric.key()));
    line(if m.law.verdict() == Verdict::Stable { "verdict" } else { "WARNING" }, &describe_verdict(&m.law));
    line(
        "moduli",
        &format!(
            "at rest: shear {} kPa, bulk {} kPa, Young {} kPa, Poisson {}",
            kpa(m.law.shear_modulus()),
            kpa(m.law.bulk_modulus),
            kpa(m.law.youngs_modulus()),
            four_digits(m.law.poisson_ratio())
        ),
    );
    line("effects", &effect_keys(m));
    if let Some(p) = &m.plasticity {
        line("", &format!("plasticity: yield {} kPa, hardening {} kPa", kpa(p.yield_stress), kpa(p.hardening)));
    }
    if let Some(f) = &m.fibres {
        let [x, y, z] = f.direction.to_array().map(|c| four_digits(if c.abs() < 1e-12 { 0.0 } else { c }));
        line("", &format!("fibres: direction ({x}, {y}, {z}), k1 {} kPa, k2 {}", kpa(f.k1), four_digits(f.k2)));
    }
    if let Some(v) = &m.viscoelastic {
        let term = |t: &Term| format!("{} in {} s", four_digits(t.ratio), four_digits(t.time));
        line("", &format!("viscoelastic: {}", v.terms.iter().map(term).collect::<Vec<_>>().join(", ")));
    }
    if let Some(d) = &m.damage {
        line(
            "",
            &format!(
                "damage: from plastic strain {}, u_f {} mm, d_max {}, cell {} mm",
                four_digits(d.onset),
                four_digits(d.failure_displacement / MM),
                d.largest,
                args.cell_mm
            ),
        );
    }
    for chosen in &m.own {
        line("", &format!("{}: {}", chosen.effect.effect.key, chosen.describe()));
    }
    line("test", &format!("loading axis x, rate {} 1/s; stresses in kPa", args.rate));
    text
}

/// The presets of a library: moduli at rest, toughness and summary in a row, aliases below it.
pub(super) fn preset_list(presets: &[TissuePreset]) -> String {
    let width = presets.iter().map(|preset| preset.name.chars().count()).max().unwrap_or_default();
    let mut text = format!("{:<width$} {:>9} {:>7} {:>9}  summary\n", "preset", "E kPa", "nu", "J_c J/m^2");
    for preset in presets {
        let young = four_digits(preset.law.youngs_modulus() / KPA);
        let nu = four_digits(preset.law.poisson_ratio());
        let toughness = preset.toughness.map_or("-".to_string(), |j| four_digits(j).to_string());
        let _ = writeln!(text, "{:<width$} {young:>9} {nu:>7} {toughness:>9}  {}", preset.name, preset.summary);
        if !preset.aliases.is_empty() {
            wrapped(&mut text, "", &format!("also: {}", preset.aliases.join(", ")));
        }
    }
    text
}

/// A labelled line, broken at words.
fn wrapped(text: &mut String, label: &str, value: &str) {
    const INDENT: usize = 10;
    let mut line = format!("{label:<INDENT$}");
    let mut is_empty = true;
    for word in value.split(' ') {
        if !is_empty && line.chars().count() + 1 + word.chars().count() > COLUMNS {
            *text += line.trim_end();
            *text += "\n";
            line = " ".repeat(INDENT);
            is_empty = true;
        }
        if !is_empty {
            line += " ";
        }
        line += word;
        is_empty = false;
    }
    *text += line.trim_end();
    *text += "\n";
}

/// A column: header, width, decimals, value. Columns that do not fit go first where `spare`.
struct Column {
    header: &'static str,
    width: usize,
    decimals: usize,
    value: fn(&Row) -> f64,
    spare: bool,
}

/// Columns of a table, as many as a narrow terminal holds.
fn columns(material: &Material, mode: Mode) -> Vec<Column> {
    let column = |header, width, decimals, value, spare| Column { header, width, decimals, value, spare };
    let mut columns = Vec::new();
    if material.viscoelastic.is_some() {
        columns.push(column("t [s]", 9, 2, |r| r.time, false));
    }
    columns.push(column(if mode == Mode::Shear { "shear" } else { "stretch" }, 9, 4, |r| r.control, false));
    columns.push(column("nominal", 10, 3, |r| r.nominal / KPA, false));
    columns.push(column("Cauchy", 10, 3, |r| r.cauchy / KPA, false));
    match mode {
        Mode::Shear => {}
        Mode::Uniaxial if material.fibres.is_some() => {
            columns.push(column("l2", 8, 4, |r| r.lateral[0], true));
            columns.push(column("l3", 8, 4, |r| r.lateral[1], true));
        }
        _ => columns.push(column("lateral", 9, 4, |r| r.lateral[1], true)),
    }
    if mode != Mode::Shear {
        columns.push(column("J", 8, 4, |r| r.jacobian, true));
    }
    if material.plasticity.is_some() {
        columns.push(column("plastic", 9, 4, |r| r.plastic_strain, false));
    }
    if material.damage.is_some() {
        columns.push(column("d", 7, 3, |r| r.damage, false));
    }
    while columns.iter().map(|c| c.width).sum::<usize>() + LEG_WIDTH > COLUMNS {
        match columns.iter().rposition(|c| c.spare) {
            Some(index) => columns.remove(index),
            None => break,
        };
    }
    columns
}

/// Width of the first column.
const LEG_WIDTH: usize = 11;
/// Place of the mark of a continued law in it.
const MARK_AT: usize = 9;

pub(super) fn table(text: &mut String, material: &Material, mode: Mode, rows: &[Row], fine: &[Row]) {
    let columns = columns(material, mode);
    // Writing to a String cannot fail.
    let _ = write!(text, "\n{:<LEG_WIDTH$}", mode.key());
    for c in &columns {
        let _ = write!(text, "{:>width$}", c.header, width = c.width);
    }
    text.push('\n');
    let mut last = None;
    // The way back of a sample without a memory would repeat the way out.
    let repeats = |row: &Row| !material.has_history() && row.leg != Leg::Loading;
    for row in rows.iter().filter(|row| !repeats(row)) {
        let leg = if last == Some((row.cycle, row.leg)) { "" } else { row.leg.key() };
        last = Some((row.cycle, row.leg));
        let mark = if row.continuation.is_some() { "*" } else { "" };
        let _ = write!(text, "{:<LEG_WIDTH$}", format!("{leg:<MARK_AT$}{mark}"));
        for c in &columns {
            // Rounding noise must not print as -0.000.
            let value = (c.value)(row);
            let value = if value.abs() < 0.5 * 0.1f64.powi(c.decimals as i32) { 0.0 } else { value };
            let _ = write!(text, "{value:>width$.decimals$}", width = c.width, decimals = c.decimals);
        }
        text.push('\n');
    }
    if rows.iter().any(repeats) {
        *text += "unloading  the same: no effect with a memory is on\n";
    }
    let mut named = Vec::new();
    for continuation in rows.iter().filter_map(|row| row.continuation) {
        if !named.contains(&continuation) {
            named.push(continuation);
            let _ = writeln!(text, "* {}", continuation.describe());
        }
    }
    if let Some((control, stress)) = material_test::peak(fine) {
        let quantity = if mode == Mode::Shear { "shear" } else { "stretch" };
        let _ = writeln!(text, "largest nominal stress {:.3} kPa at {quantity} {control:.3}", stress / KPA);
    }
}
