//! The one verdict on a run, by one table of bounds: `ok`, `doubtful` or `stopped`.
//!
//! After every frame the [`Judge`](crate::observables::Judge) compares what the frame tells with [`BOUNDS`]. A quantity beyond its first bound makes the
//! run doubtful, with the frame and the place where it began; beyond its second bound, for as many frames on end as the table
//! says, the run is stopped. Summary, score, study, window and reports take the verdict from the last [`FrameRecord`](crate::observables::FrameRecord) and
//! judge nothing themselves.
//!
//! The energy imbalance is what nobody can explain: external work less all parts of the account
//! ([`crate::observables::EnergyAccount::PARTS`]), which include what raised masses and the speed limit took. It is divided by
//! the largest work so far, at least by a floor: the energy of a strain of 1e-4 in the whole tissue, below which a
//! balance compares rounding with rounding, and the work of 50 steps at the rate of the frame: tools do work with the force at the
//! beginning of a step, so that it is known to half a step, and half a step at twice the mean rate is 2 % of 50. All other parts of the
//! account belong to the middle of the last step ([`crate::observables::EnergyAccount::half_step`]). What stops a run is measured
//! by the work alone.

#![warn(missing_docs)]

use serde::{Deserialize, Serialize};

/// Strain whose energy in the whole tissue is the floor of the imbalance.
pub const FLOOR_STRAIN: f64 = 1e-4;

/// What an account is measured by at least, since the work of tools is known to half a step only: steps of a frame with its rate of work.
pub const FLOOR_STEPS: f64 = 50.0;

/// What a run is judged by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Energy lost or created without a cause, over the largest external work so far.
    EnergyImbalance,
    /// Energy taken by raised masses and the speed limit, over the largest external work so far.
    CuredEnergy,
    /// Node steps that ran into the speed limit, of all of a frame.
    ClampedShare,
    /// Node steps with a raised mass, of all so far.
    RaisedShare,
    /// Cells inside out at their centre, of all cells.
    InvertedCells,
    /// Cells with a corner folded over and a sound centre, of all cells.
    FoldedCells,
    /// Hourglass over internal energy, sums over all frames so far.
    HourglassShare,
    /// Kinetic energy of the mass that mass scaling added, over internal energy, sums over all frames so far.
    InertiaShare,
    /// Cell steps whose return mapping missed the yield condition, of all so far.
    ClippedReturns,
    /// Frames without a balance of the flexible needle, of all so far.
    UnbalancedNeedle,
    /// 1 where a displacement or velocity is NaN or out of range, else 0.
    NotFinite,
}

/// One row of the table.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    /// What is limited.
    pub quantity: Quantity,
    /// Name in files.
    pub key: &'static str,
    /// What it is, in words that complete "... is x %".
    pub text: &'static str,
    /// Largest value of a run that is ok.
    pub ok: f64,
    /// Value beyond which the run is stopped, and for how many frames on end.
    pub stop: Option<(f64, u32)>,
    /// Shown in percent; else as a number.
    pub percent: bool,
    /// Why this bound.
    pub reason: &'static str,
}

/// The bounds, in the order in which they are told.
pub const BOUNDS: [Bound; 11] = [
    Bound {
        quantity: Quantity::NotFinite,
        key: "not_finite",
        text: "a displacement or velocity is NaN or out of the range of the engine",
        ok: 0.0,
        stop: Some((0.0, 1)),
        percent: false,
        reason: "nothing that follows means anything",
    },
    Bound {
        quantity: Quantity::EnergyImbalance,
        key: "energy_imbalance",
        text: "energy lost or created without a cause, over the largest external work so far",
        ok: 0.02,
        stop: Some((0.2, 10)),
        percent: true,
        reason: "forces are no better than the energy that they move",
    },
    Bound {
        quantity: Quantity::CuredEnergy,
        key: "cured_energy",
        text: "energy taken by raised masses and the speed limit until the end of the run, over the largest external work",
        ok: 0.05,
        stop: Some((0.5, 10)),
        percent: true,
        reason: "a cure may take a little of the work; where it takes much, the tissue does not answer with its own inertia",
    },
    Bound {
        quantity: Quantity::ClampedShare,
        key: "clamped_share",
        text: "node steps of a frame that ran into the speed limit",
        ok: 1e-3,
        stop: Some((0.05, 1)),
        percent: true,
        reason: "an unstable step clamps nearly all nodes and would go on for ever",
    },
    Bound {
        quantity: Quantity::RaisedShare,
        key: "raised_mass_share",
        text: "node steps so far whose mass was raised to keep the step stable",
        ok: 0.3,
        stop: None,
        percent: true,
        reason: "inertia is not what mass_scaling says",
    },
    Bound {
        quantity: Quantity::InvertedCells,
        key: "inverted_cells",
        text: "cells that are inside out at their centre at the end of the run, of all cells",
        ok: 0.0,
        stop: Some((0.05, 10)),
        percent: true,
        reason: "the law is evaluated at the centre: stress means nothing there; it stops where they do not get fewer",
    },
    Bound {
        quantity: Quantity::FoldedCells,
        key: "folded_cells",
        text: "cells with a corner folded over at the end of the run, of all cells",
        ok: 5e-3,
        stop: Some((0.05, 10)),
        percent: true,
        reason: "the law does not see the corner, its stabilisation does; pictures and fields are wrong there",
    },
    Bound {
        quantity: Quantity::HourglassShare,
        key: "hourglass_share",
        text: "hourglass over internal energy, sums over all frames so far",
        ok: 0.15,
        stop: None,
        percent: true,
        reason: "cells answer with their stabilisation, not with the law of the tissue",
    },
    Bound {
        quantity: Quantity::InertiaShare,
        key: "inertia_share",
        text: "kinetic energy of the mass that mass_scaling added, over internal energy, sums over all frames so far",
        ok: 0.1,
        stop: None,
        percent: true,
        reason: "mass scaling shows in the force",
    },
    Bound {
        quantity: Quantity::ClippedReturns,
        key: "clipped_returns",
        text: "cell steps so far whose return mapping missed the yield condition",
        ok: 1e-5,
        stop: Some((1e-3, 1)),
        percent: true,
        reason: "stress and dissipation are wrong there",
    },
    Bound {
        quantity: Quantity::UnbalancedNeedle,
        key: "unbalanced_needle",
        text: "frames so far in which the flexible needle did not find its balance",
        ok: 0.01,
        stop: None,
        percent: true,
        reason: "its shape there is the best one found, not the right one",
    },
];

impl Quantity {
    /// Its row of the table.
    pub fn bound(self) -> &'static Bound {
        BOUNDS.iter().find(|b| b.quantity == self).expect("every quantity has a row")
    }

    /// True for what is judged by its value at the end of the run: inverted cells, and totals over all frames so far.
    pub fn is_of_the_end(self) -> bool {
        use Quantity::*;
        matches!(
            self,
            CuredEnergy
                | RaisedShare
                | InvertedCells
                | FoldedCells
                | HourglassShare
                | InertiaShare
                | ClippedReturns
                | UnbalancedNeedle
        )
    }
}

impl Bound {
    /// A value of this quantity in words.
    pub fn show(&self, value: f64) -> String {
        match self.percent {
            true => format!("{} %", crate::units::four_digits(100.0 * value)),
            false => format!("{value}"),
        }
    }
}

/// Something that makes a run doubtful.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    /// What is beyond its first bound.
    pub quantity: Quantity,
    /// Largest value so far (at the end, where [`Quantity::is_of_the_end`]), and the bound that it left.
    pub value: f64,
    /// Largest value of a run that is ok, [`Bound::ok`].
    pub bound: f64,
    /// Frame and time [s] at which it began.
    pub frame: u64,
    /// End of that frame [s].
    pub time_s: f64,
    /// Where: the fastest node or the worst cell when it began.
    pub place: Option<String>,
}

impl Doubt {
    /// As one sentence.
    pub fn sentence(&self) -> String {
        let row = self.quantity.bound();
        let place = self.place.as_ref().map_or(String::new(), |p| format!("; {p}"));
        format!(
            "{}: {} (at most {}), from frame {} at {:.4} s{place}",
            row.text,
            row.show(self.value),
            row.show(self.bound),
            self.frame,
            self.time_s
        )
    }
}

/// The verdict on a run so far: ok without doubts. Runs that are stopped end with an error that says why.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Verdict {
    /// In the order of the table.
    pub doubts: Vec<Doubt>,
    /// Largest imbalance so far, over the work then or the floor.
    pub worst_imbalance: f64,
}

impl Verdict {
    /// True without doubts.
    pub fn is_ok(&self) -> bool {
        self.doubts.is_empty()
    }

    /// All doubts in one line; `None` where there are none.
    pub fn sentence(&self) -> Option<String> {
        (!self.is_ok()).then(|| self.doubts.iter().map(Doubt::sentence).collect::<Vec<_>>().join("; "))
    }
}

/// The table as `stylet run --explain` prints it.
pub fn explain() -> String {
    let mut text = String::from(
        "Every run ends as ok, doubtful or stopped. A doubtful run exits with 0 (--strict: with 3) and is neither scored nor taken as a \
         reference; a stopped run exits with 3 and leaves forensics.\n\n",
    );
    for bound in BOUNDS {
        let stop = match bound.stop {
            Some((0.0, _)) => "stops at once".to_string(),
            Some((value, 1)) => {
                format!("stops beyond {}", crate::units::four_digits(100.0 * value).to_string() + " %")
            }
            Some((value, frames)) => {
                format!("stops beyond {} % in {frames} frames on end", crate::units::four_digits(100.0 * value))
            }
            None => "never stops".into(),
        };
        let ok = match bound.stop {
            Some((0.0, _)) => "-".into(),
            _ => bound.show(bound.ok),
        };
        text += &format!("{:<18} ok up to {ok:<7} {stop}\n    {}\n    {}\n", bound.key, bound.text, bound.reason);
    }
    text += &format!(
        "\nThe imbalance is measured against the largest external work so far, at least against the energy of a strain of {FLOOR_STRAIN:e} in \
         the whole tissue and the work of {FLOOR_STEPS} steps at the rate of the frame. Energy that was created beyond half of the work stops a run after {PATIENCE} \
         frames, and {USELESS_PART} times the work, created or lost, at once.\n"
    );
    text
}

/// Energy that was created, over what was put in, beyond which a run stops after [`PATIENCE`] frames: it grows exponentially.
pub const CREATED_PART: f64 = 0.5;
/// Frames on end with more than [`CREATED_PART`] until a run stops.
pub const PATIENCE: u32 = 3;

/// Energy that was created or lost, over what was put in, beyond which a run stops at once: the step that follows such a state only
/// gets shorter, without an end.
pub const USELESS_PART: f64 = 10.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_names_every_quantity_once() {
        let text = explain();
        assert!(BOUNDS.iter().all(|b| text.matches(&format!("{} ", b.key)).count() >= 1));
        assert!(BOUNDS.iter().all(|b| b.quantity.bound().key == b.key));
    }
}
