//! Indentation: penalty contact of the top face with a rigid sphere or flat punch.
//!
//! Gap `g` along the outward normal `n` of the tool; `f = k <-g> n - 2 zeta sqrt(k m) v_n n`, never tensile.
//! A bonded punch keeps the node at the place of its first touch by a spring of stiffness `k` in all
//! directions. `k = stiffness_factor (K + 4/3 mu) l^2/h` with `h` the fine cell edge, l = 0.6 mm.

use super::Effect;
use super::parameter::Parameter;

pub const EFFECT: Effect = Effect {
    key: "indentation",
    define: "INDENTATION",
    summary: "contact of the top face with a rigid sphere or flat punch",
    source: "Wriggers2006",
    cost: "one dispatch and 160 B per top-face node near the tool",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 2] = [
    Parameter::new("indentation.contact_stiffness_factor", "contact stiffness", "-", [0.05, 5.0], "numerical", |s| {
        s.effects.indentation.as_ref().map(|p| p.stiffness_factor)
    })
    .logarithmic(),
    Parameter::new("indentation.contact_damping", "contact damping", "of critical", [0.0, 1.0], "numerical", |s| {
        s.effects.indentation.as_ref().map(|p| p.contact_damping)
    }),
];

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Penalty stiffness factor (dimensionless).
    pub stiffness_factor: f64,
    /// Fraction of critical damping in the normal direction (dimensionless).
    pub contact_damping: f64,
}

impl Default for Params {
    fn default() -> Self {
        Params { stiffness_factor: 2.35, contact_damping: 0.2 }
    }
}
