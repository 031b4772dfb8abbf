//! What the theory says of one experiment: at its best inputs, and the band that the ranges of its inputs give.
//!
//! The band is the hull of all corners, 2^n for n inputs with a range, and of the best point. It is no confidence interval: inputs that are
//! at their ends at the same time are rarer than one alone.

use std::f64::consts::PI;

use super::{Experiment, Quantity, Tip, Variable};
use crate::material::Isochoric;
use crate::material::neo_hookean::NeoHookean;
use crate::material::ogden::Ogden;
use crate::penetration::steady::{Indenter, Resistance};
use crate::penetration::{Ring, Steady, Unsolved};

/// The band of a prediction [unit of the quantity].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prediction {
    /// Smallest of all corners.
    pub low: f64,
    /// At the best inputs.
    pub best: f64,
    /// Largest of all corners.
    pub high: f64,
    /// Corners that were evaluated.
    pub corners: usize,
}

impl Prediction {
    /// Whether the measured value, with its scatter, meets the band.
    pub fn meets(&self, measured: [f64; 3]) -> bool {
        measured[2] >= self.low && measured[0] <= self.high
    }

    /// Factor from the nearer end of the scatter to the band, at least 1; above 1 where the band lies above.
    pub fn miss(&self, measured: [f64; 3]) -> f64 {
        if measured[2] < self.low {
            self.low / measured[2]
        } else if measured[0] > self.high {
            measured[0] / self.high
        } else {
            1.0
        }
    }

    /// Width of the band, high over low.
    pub fn width(&self) -> f64 {
        self.high / self.low
    }
}

/// Evaluates an experiment.
///
/// # Errors
/// [`Unsolved`] where the best point or a corner has no answer: a band without it would be too narrow.
pub fn predict(experiment: &Experiment) -> Result<Prediction, Unsolved> {
    let at = |index: &dyn Fn(usize) -> usize| {
        let mut values = [None; Variable::COUNT];
        for (variable, input) in experiment.written() {
            values[variable as usize] = Some(input.values[index(variable as usize)]);
        }
        evaluate(experiment.quantity, experiment.tip, &values)
    };
    let best = at(&|_| 1)?;
    let ranges: Vec<usize> =
        experiment.written().filter(|(_, input)| input.varies()).map(|(variable, _)| variable as usize).collect();
    let (mut low, mut high) = (best, best);
    let corners = 1usize << ranges.len();
    for corner in 0..corners {
        let end = |variable: usize| match ranges.iter().position(|v| *v == variable) {
            Some(bit) if corner >> bit & 1 == 1 => 2,
            Some(_) => 0,
            None => 1,
        };
        let value = at(&end)?;
        (low, high) = (low.min(value), high.max(value));
    }
    Ok(Prediction { low, best, high, corners })
}

/// The crack, whichever it is.
struct Cut {
    tip_force: f64,
    puncture_force: f64,
    normal_force: f64,
    /// Length of the crack across the needle [m]: 2a of a slit, 2 pi c of a ring.
    length: f64,
}

/// The quantity at one point of the inputs [unit of the quantity].
fn evaluate(quantity: Quantity, tip: Tip, values: &[Option<f64>; Variable::COUNT]) -> Result<f64, Unsolved> {
    let of = |variable: Variable| values[variable as usize];
    let needed = |variable: Variable| of(variable).ok_or(Unsolved::Numbers);
    let (radius, mu, toughness) =
        (needed(Variable::Radius)?, needed(Variable::ShearModulus)?, needed(Variable::Toughness)?);
    let law = match of(Variable::OgdenAlpha) {
        Some(alpha) => Isochoric::Ogden(Ogden { mu, alpha }),
        None => Isochoric::NeoHookean(NeoHookean { c10: 0.5 * mu }),
    };
    let cut = match tip {
        Tip::Cone | Tip::Bevel => {
            let resistance = Resistance { toughness, tear_stretch: of(Variable::TearStretch) };
            let steady = Steady::new(&law, resistance, radius, Indenter::Pointed)?;
            Cut {
                tip_force: steady.tip_force,
                puncture_force: steady.puncture_force,
                normal_force: steady.normal_force,
                length: 2.0 * steady.crack_half_length,
            }
        }
        Tip::Blunt => {
            let ring = Ring::new(&law, toughness, radius)?;
            Cut {
                tip_force: ring.tip_force,
                puncture_force: Indenter::Flat.puncture_over_steady() * ring.tip_force,
                normal_force: ring.normal_force,
                length: 2.0 * PI * ring.core_radius,
            }
        }
    };
    let value = match quantity {
        Quantity::ForceAtDepth => {
            let shaft = needed(Variable::Depth)? - tip_length(tip, radius, of(Variable::HalfAngle));
            cut.tip_force + needed(Variable::Friction)? * cut.normal_force * shaft.max(0.0)
        }
        Quantity::TipForce => cut.tip_force,
        Quantity::PunctureForce => cut.puncture_force,
        Quantity::Slope => needed(Variable::Friction)? * cut.normal_force,
        Quantity::WallPressure => cut.normal_force / (2.0 * PI * radius),
        Quantity::SectionPressure => cut.tip_force / (PI * radius * radius),
        Quantity::SlitLength => cut.length,
        Quantity::DoubleInsertion => cut.length * toughness / (2.0 * radius),
    };
    Ok(value / quantity.unit().1)
}

/// Length of the tip [m]; without an angle the shaft is taken to begin at its point.
fn tip_length(tip: Tip, radius: f64, half_angle: Option<f64>) -> f64 {
    match (tip, half_angle) {
        (Tip::Cone, Some(angle)) => radius / angle.tan(),
        (Tip::Bevel, Some(angle)) => 2.0 * radius / angle.tan(),
        _ => 0.0,
    }
}
