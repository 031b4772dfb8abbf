//! From a wanted error to cell edge and mass scaling: `stylet run --error 5%`.
//!
//! Coarse runs tell how the band of the force ([`crate::observables::error_bar`]) falls with the cell edge, `A h^p`, and how the force hangs on the
//! mass scaling, `B S`: inertia forces go with the mass. A run costs `h^-4 S^-1/2`, since cells go with `h^-3` and steps with `1/(h sqrt(S))`. The
//! least cost with `A h^p + B S = e` has `B S = e p/(p + 8)`. The time step is what the stable step of these cells allows: its own error is of second
//! order, and far below the other two.
//!
//! The error is the mean of the difference over depth, over the mean force. The L2 norm of the study would fall with the root of the cell edge
//! alone wherever a force drops at a depth that hangs on the cells: its square counts the drop.

use std::sync::atomic::AtomicBool;

use super::metrics::mean_error;
use super::plan::{PlannedRun, Role};
use super::store::RunRecord;
use super::subject::{DECIMALS, Subject};
use super::{Settings, runner};
use crate::error::{Error, Result};
use crate::observables::error_bar::{ASSUMED_ORDER, ORDERS, factor};
use crate::simulation::advice::COARSEST;
use crate::units::{rounded, three_digits, trimmed};

/// Errors that can be asked for.
const ASKED: [f64; 2] = [1e-3, 1.0];
/// Part of the asked error that is planned for: what coarse runs predict is off by some.
const PLANNED: f64 = 0.85;
/// Widest cells of the first pair over those of the scene, and of each pair over the one before.
const FIRST: f64 = 2.0;
const FINER: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Factor between the two mass scalings that are compared.
const LIGHTER: f64 = 4.0;
/// Largest mass scaling over the one that was tried.
const HEAVIER: f64 = 4.0;
/// Most pairs that are run.
const MOST_PAIRS: usize = 8;
/// Part of the edge of the finest pair that the wanted edge may be: further, its law is not believed.
const NEAR: f64 = 0.5;
/// Longest predicted run that is begun [s].
const LONGEST_S: f64 = 1800.0;

/// The settings that were chosen, and why.
#[derive(Debug, Clone)]
pub struct Choice {
    pub settings: Settings,
    /// Edge and relative error of every band that was measured, coarse to fine [mm, 1].
    pub bands: Vec<(f64, f64)>,
    /// Error of the cells and of the mass scaling that are predicted with these settings.
    pub predicted: [f64; 2],
    /// Runs that were made, and their wall time [s].
    pub runs: usize,
    pub took_s: f64,
    /// Order of the error in the cell edge, where three meshes or more have shown it.
    pub order: Option<f64>,
}

impl Choice {
    /// Two sentences.
    pub fn describe(&self) -> String {
        let bands: Vec<String> =
            self.bands.iter().map(|(h, e)| format!("{:.1} % on cells of {} mm", 100.0 * e, trimmed(*h))).collect();
        format!(
            "chosen: cells of {} mm, mass scaling {}: predicted {:.1} % from the cells and {:.1} % from inertia. Band: {}; {} runs, {:.1} s",
            trimmed(self.settings.cell_size_mm),
            trimmed(self.settings.mass_scaling),
            100.0 * self.predicted[0],
            100.0 * self.predicted[1],
            bands.join(", "),
            self.runs,
            self.took_s
        )
    }

    /// The overrides that give a scene these settings.
    pub fn overrides(&self) -> Vec<String> {
        let cells = format!("tissue.cell_size_mm={}", trimmed(self.settings.cell_size_mm));
        let inertia = format!("solver.mass_scaling={:?}", self.settings.mass_scaling);
        let scaled = self.settings.effects.iter().any(|key| key == "mass_scaling");
        [cells].into_iter().chain(scaled.then_some(inertia)).collect()
    }
}

/// The wanted error of a text such as `5%` or `0.05`, as a fraction.
///
/// # Errors
/// `Error::Input` for anything else.
pub fn parse(text: &str) -> Result<f64> {
    let (number, scale) = match text.trim().strip_suffix('%') {
        Some(percent) => (percent, 0.01),
        None => (text, 1.0),
    };
    let error = number.trim().parse().map_or(f64::NAN, |n: f64| n * scale);
    match (ASKED[0]..=ASKED[1]).contains(&error) {
        true => Ok(error),
        false => Err(Error::input(
            format!("--error {text} is no error that can be aimed at"),
            "write a part of the force from 0.1% to 100%, e.g. --error 5% or --error 0.05",
        )),
    }
}

/// Least-cost edge [mm] and mass scaling, where the error is that of the law and `b S`; `most`: the largest mass scaling.
fn least_cost(asked: f64, law: &Law, b: f64, most: f64) -> (f64, f64) {
    let of_mass = asked * law.order / (law.order + 8.0);
    let mass = if b > 0.0 { (of_mass / b).clamp(1.0, most) } else { most };
    // What the mass does not use is for the cells; a mass that cannot fall below 1 leaves what it leaves.
    let of_cells = (asked - b * mass).max(0.1 * asked);
    (law.edge(of_cells), mass)
}

/// A search under way.
struct Search<'a> {
    subject: &'a Subject,
    interrupted: &'a AtomicBool,
    told: &'a mut dyn FnMut(&str),
    done: Vec<RunRecord>,
}

impl Search<'_> {
    /// The run with these settings, made once.
    fn run(&mut self, cell_size_mm: f64, mass_scaling: f64) -> Result<RunRecord> {
        let settings = Settings {
            cell_size_mm: rounded(cell_size_mm, DECIMALS),
            mass_scaling: rounded(mass_scaling, DECIMALS),
            ..self.subject.base.clone()
        };
        if let Some(known) = self.done.iter().find(|run| run.settings.as_ref() == Some(&settings)) {
            return Ok(known.clone());
        }
        (self.told)(&settings.describe());
        let id = settings.id(&self.subject.base);
        let planned = PlannedRun { id, role: Role::Mesh, settings, cells: 0, steps: 0, predicted_s: 0.0 };
        match runner::run(self.subject, &planned, None, self.interrupted, &mut |_| {})? {
            Some(run) => {
                self.done.push(run.clone());
                Ok(run)
            }
            None => Err(Error::Ended("while cells were chosen")),
        }
    }

    /// How far a run on these cells and its companion are apart; `None` where one of them is not sound.
    fn apart(&mut self, cell_size_mm: f64) -> Result<Option<f64>> {
        let mass = self.subject.base.mass_scaling;
        let companion = self.run(2.0 * cell_size_mm, mass)?;
        if companion.unfit().is_some() {
            return Ok(None);
        }
        let run = self.run(cell_size_mm, mass)?;
        let sound = run.unfit().is_none();
        Ok(mean_error(&companion.curve(), &run.curve()).filter(|_| sound))
    }

    /// Error per unit of mass scaling, from a run beside one of lighter tissue, and whether that is known.
    fn inertia(&mut self, heavy: &RunRecord) -> Result<(f64, bool)> {
        let Some(of) = heavy.settings.clone() else { return Ok((0.0, false)) };
        let lighter = rounded((of.mass_scaling / LIGHTER).max(1.0), DECIMALS);
        if lighter >= of.mass_scaling {
            return Ok((0.0, false));
        }
        let light = self.run(of.cell_size_mm, lighter)?;
        let b = difference(&heavy.curve(), &light.curve()) / (of.mass_scaling - lighter);
        Ok(if light.unfit().is_none() { (b, true) } else { (0.0, false) })
    }

    /// Wall time that a run with these settings is predicted to take [s], from the largest run so far.
    fn predicted_s(&self, cell_size_mm: f64, mass_scaling: f64) -> f64 {
        let largest = self.done.iter().max_by_key(|run| run.cells * run.steps);
        let Some((run, settings)) = largest.and_then(|run| Some((run, run.settings.as_ref()?))) else { return 0.0 };
        let (cells, steps) = (settings.cell_size_mm / cell_size_mm, (settings.mass_scaling / mass_scaling).sqrt());
        run.wall_s * cells.powi(4) * steps
    }

    /// A run that nobody waits for is refused. `wanted`: the edge that the pairs ask for.
    fn refuse_if_long(&self, asked: f64, cell_size_mm: f64, wanted: Option<f64>, mass_scaling: f64) -> Result<()> {
        if self.predicted_s(cell_size_mm, mass_scaling) <= LONGEST_S {
            return Ok(());
        }
        let cell = wanted.unwrap_or(cell_size_mm);
        let (least, minutes) = (three_digits(cell), three_digits(self.predicted_s(cell, mass_scaling) / 60.0));
        Err(Error::input(
            format!(
                "an error of {} % takes cells of {least} mm or less, a run of {minutes} min or more, as {} coarse runs have it",
                trimmed(100.0 * asked),
                self.done.len()
            ),
            format!("ask for a larger error, or begin that run: --set tissue.cell_size_mm={least} --error-bar"),
        ))
    }
}

/// How the band falls with the cell edge: `a h^order`, from what runs and companions are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Law {
    a: f64,
    order: f64,
    /// Three meshes or more have shown the order.
    observed: bool,
}

impl Law {
    /// Of the order of the two finest pairs (edge [mm], apart), through the higher one of them; with one pair of the assumed order. `None` without
    /// a pair.
    fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let (h, apart) = *pairs.last()?;
        let before = pairs.iter().rev().nth(1);
        let seen = before.map(|(wide, further)| (further / apart).ln() / (wide / h).ln());
        let order = seen.map_or(ASSUMED_ORDER, |order| order.clamp(ORDERS[0], ORDERS[1]));
        let through = |(h, apart): &(f64, f64)| apart.max(1e-6) / h.powf(order);
        let a = factor(seen.map(|_| order)) * pairs.iter().rev().take(2).map(through).fold(0.0, f64::max);
        Some(Law { a, order, observed: seen.is_some() })
    }

    fn error(&self, h: f64) -> f64 {
        self.a * h.powf(self.order)
    }

    fn edge(&self, error: f64) -> f64 {
        (error / self.a).powf(1.0 / self.order)
    }
}

/// Chooses cell edge and mass scaling so that the band of the force is expected to be at most `asked` (mean over depth, over the mean force) at the
/// least time. `told` hears what is being run.
///
/// # Errors
/// `Error::Input` where the cells cannot be chosen, where no coarse run is sound, and where the run would take too long; `Error::Ended`.
pub fn choose(subject: &Subject, asked: f64, interrupted: &AtomicBool, told: &mut dyn FnMut(&str)) -> Result<Choice> {
    let base = &subject.base;
    if !subject.has_block() {
        // Says why.
        subject.scene.wider_cells(FIRST)?;
    }
    let mut search = Search { subject, interrupted, told, done: Vec::new() };
    let aim = PLANNED * asked;
    // Pairs from coarse to fine, until the last one is not far from what is wanted. A single one may agree by chance.
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let widest = subject.scene.needle().map_or(f64::INFINITY, |n| 1e3 * COARSEST * 2.0 * n.radius);
    let mut edge = widest.min(FIRST * base.cell_size_mm);
    for _ in 0..MOST_PAIRS {
        match search.apart(edge) {
            Ok(Some(apart)) => pairs.push((edge, apart)),
            // Cells that wide are no tissue: doubtful, stopped, or refused by the scene.
            Ok(None) | Err(Error::Scene(_)) => {}
            Err(error) => return Err(error),
        }
        let law = Law::of(&pairs).filter(|law| law.observed);
        let wanted = law.map(|law| law.edge(aim));
        if wanted.is_some_and(|wanted| wanted >= NEAR * edge) {
            break;
        }
        edge *= FINER;
        search.refuse_if_long(asked, edge, wanted, base.mass_scaling)?;
    }
    let Some(law) = Law::of(&pairs) else {
        return Err(Error::input(
            format!("no error can be told: none of the coarse runs of {} is sound", subject.scene.name),
            "look at the scene itself first: stylet run without --error",
        ));
    };
    let coarse = pairs[0].0;
    let heavy = search.run(coarse, base.mass_scaling)?;
    let (b, lighter) = search.inertia(&heavy)?;
    let most = if lighter { HEAVIER * base.mass_scaling } else { base.mass_scaling };
    let finest = pairs.iter().map(|(h, _)| *h).fold(f64::INFINITY, f64::min);
    let (mut cell, mut mass) = least_cost(aim, &law, b, most);
    // Heavier tissue than the scene has is tried before it is believed.
    if mass > base.mass_scaling {
        let tried = search.run(coarse, mass)?;
        let seen = difference(&tried.curve(), &heavy.curve());
        if tried.unfit().is_some() || seen > 1.5 * b * (mass - base.mass_scaling) {
            (cell, mass) = least_cost(aim, &law, b, base.mass_scaling);
        }
    }
    // Nobody has seen a band on wider cells than those of the pairs.
    cell = cell.min(finest);
    search.refuse_if_long(asked, cell, Some(cell), mass)?;
    let settings = Settings {
        // Down: what is chosen keeps the bound.
        cell_size_mm: (cell * 1e3).floor().max(1.0) * 1e-3,
        mass_scaling: mass.floor().max(1.0),
        ..base.clone()
    };
    let bands = pairs.iter().map(|(h, apart)| (*h, apart * factor(law.observed.then_some(law.order)))).collect();
    Ok(Choice {
        predicted: [law.error(settings.cell_size_mm), b * settings.mass_scaling],
        order: law.observed.then_some(law.order),
        settings,
        bands,
        runs: search.done.len(),
        took_s: search.done.iter().map(|run| run.wall_s + run.setup_s).sum(),
    })
}

/// What lies between two curves, 0 where they share nothing.
fn difference(curve: &[(f64, f64)], reference: &[(f64, f64)]) -> f64 {
    mean_error(curve, reference).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_in_words() {
        assert_eq!(parse("5%").unwrap(), 0.05);
        assert_eq!(parse(" 2.5 % ").unwrap(), 0.025);
        assert_eq!(parse("0.1").unwrap(), 0.1);
        for wrong in ["", "5", "five", "0%", "-5%", "NaN", "inf", "0.01%"] {
            assert_eq!(parse(wrong).unwrap_err().exit_code(), 2, "{wrong}");
        }
    }

    #[test]
    fn the_law_is_read_off_the_pairs() {
        // F_h = 1 + 0.1 h^0.8: a pair is 0.1 h^0.8 (2^0.8 - 1) apart.
        let apart = |h: f64| 0.1 * h.powf(0.8) * (2f64.powf(0.8) - 1.0);
        let law = Law::of(&[(1.0, apart(1.0)), (0.5, apart(0.5))]).unwrap();
        assert!((law.order - 0.8).abs() < 1e-12 && law.observed);
        assert!((law.error(0.4) - 1.25 * 0.1 * 0.4f64.powf(0.8)).abs() < 1e-12);
        // What fell faster than it can is believed no better than the coarse pair allows.
        let lucky = Law::of(&[(1.0, 0.1), (0.5, 0.001)]).unwrap();
        assert_eq!(lucky.order, 1.0);
        assert!((lucky.error(0.5) - 1.25 * 0.05).abs() < 1e-12);
        assert!((law.edge(law.error(0.3)) - 0.3).abs() < 1e-12);
        let one = Law::of(&[(1.0, 0.02)]).unwrap();
        assert_eq!((one.order, one.observed), (1.0, false));
        assert!((one.error(0.5) - 0.03).abs() < 1e-12);
        assert_eq!(Law::of(&[]), None);
    }

    #[test]
    fn no_other_split_of_the_error_costs_less() {
        let law = Law { a: 0.2, order: 1.0, observed: true };
        let (asked, b) = (0.05, 2e-6);
        let (h, mass) = least_cost(asked, &law, b, 1e9);
        assert!((law.error(h) + b * mass - asked).abs() < 1e-12);
        let cost = |h: f64, mass: f64| h.powi(-4) / mass.sqrt();
        for share in 1..100 {
            let of_mass = asked * share as f64 / 100.0;
            assert!(cost(h, mass) <= cost(law.edge(asked - of_mass), of_mass / b) * (1.0 + 1e-12));
        }
        // A limit of the mass leaves more to the cells.
        let (wider, limited) = least_cost(asked, &law, b, 0.5 * mass);
        assert!(limited == 0.5 * mass && wider > h);
    }
}
