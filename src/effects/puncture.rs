//! Puncture: the tip law and the swept path.

use super::Effect;

pub const EFFECT: Effect = Effect {
    key: "puncture",
    define: "PUNCTURE",
    summary: "tip law (puncture, cutting) and contact with the opened path of the needle",
    source: "this project (README, Puncture); toughness: Gokgol2012, Azar2008",
    cost: "two dispatches per step; 4 B per cell; 96 B per node near the path",
};

/// Parameters in SI units. Those marked [calibration] set the force as much as the tissue does; they are the
/// same in every scene that compares materials.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Tip force at which the surface gives way, F_pun [N] [calibration].
    pub puncture_force: f64,
    /// Tip force of steady cutting, F_cut = G_c w [N] [calibration].
    pub cutting_force: f64,
    /// Length over which the threshold falls from F_pun to F_cut, l_p [m].
    pub transition_length: f64,
    /// Stiffness of all tip springs together, k_tip [N/m].
    pub tip_stiffness: f64,
    /// Radius of the softened path, a0 [m] [calibration].
    pub softened_radius: f64,
    /// Elastic stiffness left in a fully softened cell (fraction).
    pub residual_stiffness: f64,
    /// Outer radius of the ring of nodes that the shaft pushes [m] [calibration].
    pub ring_radius: f64,
    /// Contact stiffness factor: k = factor (K + 4/3 mu) l^2/h, l = 0.6 mm [calibration].
    pub contact_stiffness_factor: f64,
    /// Fraction of critical damping in the contact normal.
    pub contact_damping: f64,
    /// Travel over which an overlap found at activation fades out [m].
    pub entry_fade: f64,
}

impl Default for Params {
    fn default() -> Self {
        Params {
            puncture_force: 0.6,
            cutting_force: 0.3,
            transition_length: 0.5e-3,
            tip_stiffness: 2.0e3,
            softened_radius: 0.72e-3,
            residual_stiffness: 0.02,
            ring_radius: 2.0e-3,
            contact_stiffness_factor: 2.35,
            contact_damping: 0.2,
            entry_fade: 2.0e-3,
        }
    }
}
