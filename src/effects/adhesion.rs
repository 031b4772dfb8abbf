//! Adhesion: tissue sticks to the tip, is dragged along and lets go. A model of a hypothesis.
//!
//! The sudden drops that follow one another in measured force curves have been explained by a "built-up edge": tissue that
//! adheres to the tip until it tears off ([Lv2022], section 4). This is the least law with that content, a spring and a slider
//! between the tip and the tissue at its material coordinate `a`, with the stretch `w` and the distance `q` slid since the
//! last sticking [m]:
//! ```text
//! F = k w,  |F| <= L(q) = F_s - (F_s - F_k) q/D                                           [N]
//! sticking: dw = dx;  where k |w| would pass L: slip dq = dx - dw, so that k |w| = L(q)
//! q = D: sticks anew, w = F_k/k, q = 0
//! dx = (p_tip - x(a)).t now - after the last step, mean over the anchors of the tip law   [m]
//! stored 1/2 k w^2, dissipated F dq                                                       [J]
//! ```
//! `dx` is the motion of the tip relative to the tissue at it; the advance of `a` itself does not count. One cycle takes
//! `(F_s - F_k)/k` of sticking and `D - (F_s - F_k)/k` of slipping: drops come every `D` of relative motion, whatever the speed,
//! so their frequency is proportional to it. In tissue of stiffness k_t the fall of the force is complete only where
//! `D > (F_s - F_k) (1/k + 1/k_t)`. The force acts on the anchors of the tip springs, from the puncture (a > 0) to the exit; a tip
//! drawn back by more than D lets go of the tissue. Not in the source: every number. Stick-slip as such: [Wriggers2006], ch. 5.

use serde::{Deserialize, Serialize};

use super::parameter::Parameter;
use super::{Effect, Kind};

pub const EFFECT: Effect = Effect {
    key: "adhesion",
    kind: Kind::Tool,
    needs: &["puncture"],
    define: "ADHESION",
    summary: "tissue sticks to the tip and lets go: drops at a fixed spacing; a model of the built-up-edge hypothesis",
    source: "hypothesis of Lv2022; law: this project",
    cost: "no buffer; 20 operations per step",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 4] = [
    Parameter::new(
        "adhesion.static_force_n",
        "force at which it lets go",
        "N",
        [0.0, 2.0],
        "hypothesis, see the effect",
        |s| s.effects.adhesion.as_ref().map(|p| p.static_force),
    ),
    Parameter::new(
        "adhesion.kinetic_force_n",
        "force after a slip",
        "N",
        [0.0, 2.0],
        "hypothesis, see the effect",
        |s| s.effects.adhesion.as_ref().map(|p| p.kinetic_force),
    ),
    Parameter::new(
        "adhesion.stiffness_n_mm",
        "stiffness of the bond",
        "N/mm",
        [0.05, 20.0],
        "hypothesis, see the effect",
        |s| s.effects.adhesion.as_ref().map(|p| p.stiffness / 1e3),
    )
    .logarithmic(),
    Parameter::new(
        "adhesion.sliding_distance_mm",
        "distance until it sticks anew",
        "mm",
        [0.1, 5.0],
        "hypothesis, see the effect",
        |s| s.effects.adhesion.as_ref().map(|p| p.sliding_distance / 1e-3),
    ),
];

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Force at which the tissue lets go, F_s [N].
    pub static_force: f64,
    /// Force at the end of a slip, F_k [N].
    pub kinetic_force: f64,
    /// Stiffness of the bond, k [N/m].
    pub stiffness: f64,
    /// Distance slid until it sticks anew, D [m]; larger than (F_s - F_k)/k.
    pub sliding_distance: f64,
}

impl Default for Params {
    fn default() -> Self {
        Params { static_force: 0.25, kinetic_force: 0.05, stiffness: 1.0e3, sliding_distance: 1.0e-3 }
    }
}

/// What the bond remembers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Bond {
    /// Stretch w of its spring [m], positive where the tip drags tissue forward.
    pub stretch: f64,
    /// Distance q slid since it stuck last [m].
    pub slid: f64,
    /// Mean distance of the tip plane from the anchors after the last step, unclamped [m].
    pub gap: f64,
}

impl Params {
    /// Largest force after a slip `q`, L(q) [N].
    pub fn limit(&self, slid: f64) -> f64 {
        self.static_force - (self.static_force - self.kinetic_force) * slid / self.sliding_distance
    }

    /// Stretch and distance slid after a relative motion `dx` [m].
    pub fn advance(&self, stretch: f64, slid: f64, dx: f64) -> (f64, f64) {
        let trial = stretch + dx;
        let excess = self.stiffness * trial.abs() - self.limit(slid);
        if excess <= 0.0 {
            return (trial, slid);
        }
        let softening = (self.static_force - self.kinetic_force) / self.sliding_distance;
        let slip = excess / (self.stiffness - softening);
        if slid + slip < self.sliding_distance {
            (trial.signum() * (trial.abs() - slip), slid + slip)
        } else {
            (trial.signum() * self.kinetic_force / self.stiffness, 0.0)
        }
    }
}
