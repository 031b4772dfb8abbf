//! Mass scaling: the tissue's inertia is multiplied so that the stable step grows.
//!
//! Uniform part: `m = S rho V / 8` per cell corner, so `dt ~ sqrt(S)`; weight is not scaled.
//! Selective part: where cells are squeezed and stiffen, the nodal mass of one step is raised to
//! `m* = max(m, k dt^2 / (4 * 0.9^2))` with `k` the bound of the nodal stiffness [N/m] (tissue, contact, tip springs;
//! `Elements::stiffness_bound`), which keeps
//! the step stable and leaves statics untouched. A node whose mass rises keeps its kinetic energy, `v sqrt(m*)` stays: with its velocity it
//! would gain energy, as much as all work in soft, tough tissue where the crack runs in and tissue that moves is opened. One whose mass falls
//! keeps its velocity. Range of validity: needle speed well below the scaled shear
//! wave speed; kinetic over internal energy is reported and should stay below 5 %.
//! Source: Olovsson, Simonsson & Unosson 2005 (selective mass scaling); Joldes et al. 2008 (tissue).

use super::parameter::Parameter;
use super::{Effect, Kind};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "mass_scaling",
    kind: Kind::Nodes,
    needs: &[],
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

/// Ratio `k dt^2 / (4 m)` of a node whose mass is raised: a step of 0.9 times the stable one (dimensionless).
pub const RAISED_STEP_RATIO: f64 = 0.81;

/// Most by which the mass of a node is raised (dimensionless).
pub const MOST_RAISED: f64 = 100.0;

/// What the shaders have of this file.
pub const SHADER_CONSTANTS: [(&str, f64); 2] = [("RAISED_STEP_RATIO", RAISED_STEP_RATIO), ("MOST_RAISED", MOST_RAISED)];

/// Mass m* of a node in one step of `dt` [s]: its own [kg], raised where the bound `bound` of its stiffness [N/m] asks for it.
pub fn stable_mass(mass: f64, bound: f64, dt: f64) -> f64 {
    (bound * dt * dt / (4.0 * RAISED_STEP_RATIO)).max(mass).min(MOST_RAISED * mass)
}

/// Factor of the velocity of a node whose mass over that at rest is `ratio` now; `inertia`: that of the step before, then this one. Not above
/// 1: a node that is light again would strike with all that it had.
pub fn change_of_mass(inertia: &mut f32, ratio: f64) -> f64 {
    let (before, now) = (*inertia, ratio as f32);
    *inertia = now;
    if now > before { f64::from(before / now).sqrt() } else { 1.0 }
}

/// Largest ratio of tool speed to scaled shear wave speed that `auto` allows (dimensionless).
pub const AUTO_MACH: f64 = 0.03;
/// The ratio beyond which a scene is told that inertia will show (dimensionless).
pub const MOST_MACH: f64 = 2.0 * AUTO_MACH;

/// Passages of a scaled shear wave through the tissue during which `auto` lets a face move or a load grow. Sheared by v t on one side, a block has `1/6 m v^2` of kinetic and `1/2 G (v t / L)^2 V` of elastic
/// energy: with p passages in all, and twice the kinetic energy for the wave of the sudden start, the sum of the one over the run is
/// 2/p^2 of the other: 3 % at 8 passages, 8 % at 5.
pub const AUTO_PASSAGES: f64 = 8.0;
/// Passages below which a scene is told that inertia will show.
pub const FEWEST_PASSAGES: f64 = 5.0;

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Factor S >= 1 (dimensionless).
    pub factor: f64,
}

/// What moves tissue in a scene, as far as its inertia can show.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Loading {
    /// Largest speed of a tool [m/s].
    pub tool_speed: f64,
    /// Shortest time in which a face moves or a load on it grows, over the length of the tissue across the face [s/m]; `None` without.
    pub slowness: Option<f64>,
}

impl Loading {
    /// Tool speed over the wave speed `wave` [m/s].
    pub fn mach(&self, wave: f64) -> f64 {
        self.tool_speed / wave
    }

    /// Fewest passages of that wave while a face moves or a load grows; infinite without.
    pub fn passages(&self, wave: f64) -> f64 {
        self.slowness.map_or(f64::INFINITY, |slowness| slowness * wave)
    }

    /// The factor that `auto` stands for, at least 1: the largest S with a tool within [`AUTO_MACH`] and faces that take
    /// [`AUTO_PASSAGES`]; `None` where nothing moves. `wave`: shear wave speed at true density [m/s].
    pub fn auto_factor(&self, wave: f64) -> Option<f64> {
        let by_tool = if self.tool_speed > 0.0 { AUTO_MACH / self.mach(wave) } else { f64::INFINITY };
        let root = by_tool.min(self.passages(wave) / AUTO_PASSAGES);
        (root.is_finite() && wave > 0.0).then(|| root.powi(2).max(1.0))
    }
}
