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

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::units::{MILLIMETRE, NEWTON, NEWTON_PER_MILLIMETRE};
use crate::within::Within::{NotNegative, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "adhesion",
    kind: Kind::Tool,
    needs: &["puncture"],
    define: "ADHESION",
    summary: "tissue sticks to the tip and lets go: drops at a fixed spacing; a model of the built-up-edge hypothesis",
    source: "hypothesis of Lv2022; law: this project",
    cost: "no buffer; 20 operations per step",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `adhesion`, which needs `puncture`: a model of the hypothesis that tissue sticks to the tip.
    pub struct AdhesionTable;
    /// Parameters in SI units.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "adhesion": numbers => numbers.effects.adhesion.as_ref();

    /// Force at which the tissue lets go [N]; default 0.25.
    static_force_n: NEWTON, Positive(100.0) =>
    /// Force at which the tissue lets go, F_s [N].
    static_force = 0.25, slider("force at which it lets go", [0.0, 2.0], "hypothesis, see the effect");

    /// Force at the end of a slip [N]; default 0.05.
    kinetic_force_n: NEWTON, NotNegative(100.0) =>
    /// Force at the end of a slip, F_k [N].
    kinetic_force = 0.05, slider("force after a slip", [0.0, 2.0], "hypothesis, see the effect");

    /// Stiffness of the bond [N/mm]; default 1.
    stiffness_n_mm: NEWTON_PER_MILLIMETRE, Positive(1e4) =>
    /// Stiffness of the bond, k [N/m].
    stiffness = 1.0e3, slider("stiffness of the bond", [0.05, 20.0], "hypothesis, see the effect").logarithmic();

    /// Distance slid until it sticks anew [mm]: the spacing of the drops; default 1.
    sliding_distance_mm: MILLIMETRE, Positive(100.0) =>
    /// Distance slid until it sticks anew, D [m]; larger than (F_s - F_k)/k.
    sliding_distance = 1.0e-3, slider("distance until it sticks anew", [0.1, 5.0], "hypothesis, see the effect");
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
