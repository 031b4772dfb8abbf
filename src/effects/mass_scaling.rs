//! Mass scaling: the tissue's inertia is multiplied so that the stable step grows.
//!
//! Uniform part: `m = S rho V / 8` per cell corner, so `dt ~ sqrt(S)`; weight is not scaled.
//! Selective part: where cells are squeezed and stiffen, the nodal mass of one step is raised to
//! `m* = max(m, k dt^2 / (4 * 0.9^2))` with `k` the bound of the nodal stiffness [N/m] (tissue, contact, tip springs;
//! `Elements::stiffness_bound`), which keeps
//! the step stable and leaves statics untouched. Range of validity: needle speed well below the scaled shear
//! wave speed; kinetic over internal energy is reported and should stay below 5 %.
//! Source: Olovsson, Simonsson & Unosson 2005 (selective mass scaling); Joldes et al. 2008 (tissue).

use super::Effect;
use super::parameter::Parameter;

pub const EFFECT: Effect = Effect {
    key: "mass_scaling",
    define: "MASS_SCALING",
    summary: "inertia of the tissue times S, so that the stable step grows with sqrt(S)",
    source: "Olovsson2005, Joldes2008",
    cost: "no buffer; a handful of operations per node",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 1] = [Parameter::new(
    "solver.mass_scaling",
    "mass scaling factor",
    "-",
    [1.0, 100000.0],
    "kinetic energy stays a small part of the elastic one",
    |s| s.effects.mass_scaling.as_ref().map(|p| p.factor),
)
.logarithmic()];

/// Largest ratio of needle speed to scaled shear wave speed that `auto` allows (dimensionless).
pub const AUTO_MACH: f64 = 0.03;

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Factor S >= 1 (dimensionless).
    pub factor: f64,
}

/// The factor that `auto` stands for: the largest S with `v sqrt(S) / c_s <= AUTO_MACH`, at least 1.
///
/// `speed`: largest tool speed [m/s]; `shear_wave_speed`: c_s at true density [m/s].
pub fn auto_factor(speed: f64, shear_wave_speed: f64) -> f64 {
    (AUTO_MACH * shear_wave_speed / speed).powi(2).max(1.0)
}
