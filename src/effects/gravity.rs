//! Gravity: weight of the tissue, `f = m_true g` per node; mass scaling does not change it.
//!
//! Its work is that of every load, `f.(v- + v+)/2 dt` per step, in which leapfrog turns work into kinetic energy exactly; the GPU
//! engine takes it as the change of `g . sum of m (u - v dt/2)`, the same sum without a term per step.

use glam::DVec3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::parameter::{Parameter, Value};
use super::{Effect, Kind};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "gravity",
    kind: Kind::Nodes,
    needs: &[],
    define: "GRAVITY",
    summary: "weight of the tissue",
    source: "Newton",
    cost: "no buffer; one multiply-add per node",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 1] = [Parameter::new(
    "gravity.acceleration_m_s2",
    "free fall x, y, z",
    "m/s^2",
    [-20.0, 20.0],
    "9.81 m/s^2 on earth",
    |_| None,
)
.holding(Value::List(|s| s.effects.gravity.map(|p| p.acceleration.to_array().to_vec()), None))];

/// Parameters of the effect `gravity`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityTable {
    /// Acceleration of free fall [m/s^2]; default [0, 0, -9.81].
    pub acceleration_m_s2: Option<[f64; 3]>,
}

impl GravityTable {
    /// Nothing weighs anything.
    pub fn none() -> Self {
        GravityTable { acceleration_m_s2: Some([0.0; 3]) }
    }
}

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Acceleration of free fall [m/s^2].
    pub acceleration: DVec3,
}
