//! Coulomb friction with stick memory on the shaft of the tool; none on the cone of a needle.
//!
//! `g` is the tangential stretch of an elastic stick spring [m], `N` the normal contact force [N]:
//! trial `g += v_t dt`, projected to the tangent plane; `F_t = -k_t g`, `k_t = ratio * k_n`; where
//! `|F_t| > mu(s) N` the stretch is scaled back (return mapping) and the difference is dissipated. On the
//! shaft of a needle `mu(s)` grows from 0 at the base of the cone to `mu` over `fade_length`, which removes a
//! force step for every layer of nodes that the base passes. A regularisation by `tanh` would creep and
//! cannot stick. Source: Wriggers 2006, ch. 5 (return mapping); coefficient 0.3: Lv2022, section 3.2.

use glam::DVec3;

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::units::{MILLIMETRE, ONE};
use crate::within::Within::{NotNegative, Positive};

/// What the stick spring of a contact does in one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stick {
    /// Its stretch g after the step [m].
    pub stretch: DVec3,
    /// Force on the tissue [N].
    pub force: DVec3,
    /// Dissipated by sliding in the step [J].
    pub dissipated: f64,
    /// Stored after it [J].
    pub stored: f64,
}

/// Return mapping of the stick spring with the stiffness `k_t` [N/m]: the stretch `old` [m] and the motion `v dt` [m] of the tissue
/// past the tool, `motion`, in the plane normal to `n`; beyond the largest friction `limit`, mu N [N], it slides. A spring without
/// a normal force lets go.
pub fn stick_or_slide(old: DVec3, motion: DVec3, n: DVec3, kt: f64, limit: f64) -> Stick {
    let trial = old + motion;
    let trial = trial - n * trial.dot(n);
    let (length, allowed) = (trial.length(), limit / kt);
    let stretch = if length > allowed { trial * (allowed / length) } else { trial };
    Stick {
        stretch,
        force: stretch * -kt,
        // Mean friction force of the last step and this one times slip.
        dissipated: 0.5 * kt * (old + stretch).dot(trial - stretch),
        stored: 0.5 * kt * stretch.length_squared(),
    }
}

/// Part of the coefficient that acts at `s` [m] behind the tip: none on the tip of the length `tip_length` [m], growing over `fade`
/// [m] behind it.
pub fn part_on_shaft(s: f64, tip_length: f64, fade: f64) -> f64 {
    ((s - tip_length) / fade).clamp(0.0, 1.0)
}

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "friction",
    kind: Kind::Tool,
    needs: &["puncture", "indentation"],
    define: "FRICTION",
    summary: "Coulomb friction with stick memory on the shaft, none on the cone",
    source: "Wriggers2006, Lv2022",
    cost: "no buffer: stick memory is a lane of the contact memory; about 40 operations per touching node",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `friction`.
    pub struct FrictionTable;
    /// Parameters in SI units.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "friction": numbers => numbers.effects.friction.as_ref();

    /// Friction coefficient mu.
    coefficient: ONE, NotNegative(2.0) =>
    /// Friction coefficient mu (dimensionless).
    coefficient = 0.3, slider("friction coefficient", [0.0, 1.0], "Lv2022, section 3.2");

    /// Tangential over normal contact stiffness.
    stiffness_ratio: ONE, Positive(1.0) =>
    /// Tangential over normal contact stiffness (dimensionless).
    stiffness_ratio = 0.5, slider("tangential over normal stiffness", [0.05, 1.0], "calibration");

    /// Length over which mu grows along the shaft behind the cone [mm].
    fade_length_mm: MILLIMETRE, NotNegative(100.0) =>
    /// Length over which mu grows along the shaft behind the cone [m].
    fade_length = 0.8e-3, slider("fade behind the cone", [0.1, 5.0], "one cell of the default mesh");
}
