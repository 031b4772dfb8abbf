//! Gravity: weight of the tissue, `f = m_true g` per node; mass scaling does not change it.

use glam::DVec3;

use super::Effect;

pub const EFFECT: Effect = Effect {
    key: "gravity",
    define: "GRAVITY",
    summary: "weight of the tissue",
    source: "Newton",
    cost: "no buffer; one multiply-add per node",
};

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Acceleration of free fall [m/s^2].
    pub acceleration: DVec3,
}
