//! Coulomb friction with stick memory on the shaft of the tool; none on the cone of a needle.
//!
//! `g` is the tangential stretch of an elastic stick spring [m], `N` the normal contact force [N]:
//! trial `g += v_t dt`, projected to the tangent plane; `F_t = -k_t g`, `k_t = ratio * k_n`; where
//! `|F_t| > mu(s) N` the stretch is scaled back (return mapping) and the difference is dissipated. On the
//! shaft of a needle `mu(s)` grows from 0 at the base of the cone to `mu` over `fade_length`, which removes a
//! force step for every layer of nodes that the base passes. A regularisation by `tanh` would creep and
//! cannot stick. Source: Wriggers 2006, ch. 5 (return mapping); coefficient 0.3: Lv2022, section 3.2.

use super::parameter::Parameter;
use super::{Effect, Kind};

pub const EFFECT: Effect = Effect {
    key: "friction",
    kind: Kind::Tool,
    needs: &["puncture", "indentation"],
    define: "FRICTION",
    summary: "Coulomb friction with stick memory on the shaft, none on the cone",
    source: "Wriggers2006, Lv2022",
    cost: "no buffer: stick memory is a lane of the contact memory; about 40 operations per touching node",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 3] = [
    Parameter::new("friction.coefficient", "friction coefficient", "-", [0.0, 1.0], "Lv2022, section 3.2", |s| {
        s.effects.friction.as_ref().map(|p| p.coefficient)
    }),
    Parameter::new(
        "friction.stiffness_ratio",
        "tangential over normal stiffness",
        "-",
        [0.05, 1.0],
        "calibration",
        |s| s.effects.friction.as_ref().map(|p| p.stiffness_ratio),
    ),
    Parameter::new(
        "friction.fade_length_mm",
        "fade behind the cone",
        "mm",
        [0.1, 5.0],
        "one cell of the default mesh",
        |s| s.effects.friction.as_ref().map(|p| p.fade_length / 1e-3),
    ),
];

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Friction coefficient mu (dimensionless).
    pub coefficient: f64,
    /// Tangential over normal contact stiffness (dimensionless).
    pub stiffness_ratio: f64,
    /// Length over which mu grows along the shaft behind the cone [m].
    pub fade_length: f64,
}

impl Default for Params {
    fn default() -> Self {
        Params { coefficient: 0.3, stiffness_ratio: 0.5, fade_length: 0.8e-3 }
    }
}
