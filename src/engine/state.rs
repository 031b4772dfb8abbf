//! The state of the tissue between two steps, as both engines give and take it.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::effects::adhesion::Bond;
use crate::effects::viscoelastic::SectionRelaxation;
use crate::material_point::PointState;
use crate::needle::free_path::FreeTip;
use crate::needle::tip_contact::{Spreading, TipContact, Touch};

/// The state that both engines can give and take, in f64 and SI, node order of the mesh.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct State {
    /// Displacement u [m].
    pub displacement: Vec<DVec3>,
    /// Velocity v at the last half step [m/s].
    pub velocity: Vec<DVec3>,
    /// Mass of the nodes in the last step over their mass at rest (see `src/effects/mass_scaling.rs`).
    pub inertia: Vec<f32>,
    /// Remaining stiffness per cell; empty without `puncture`.
    pub stiffness: Vec<f64>,
    /// Material coordinate of the tip [m].
    pub tip_coordinate: f64,
    /// Tip on a free path; at rest on a planned one.
    pub tip: FreeTip,
    /// Marked sample points per cell of the box of a free path, bit = x + 4 y + 16 z; empty on a planned one.
    pub cut_samples: Vec<u64>,
    /// Tissue that sticks to the tip.
    pub bond: Bond,
    /// Memory per contact node: stretch of the stick spring [m], overlap at activation [m], axial position at
    /// activation [m]; `touching` tells whether the last two are set.
    pub contact: Vec<ContactState>,
    /// Stretch of the stick spring of every station of the path along the needle [m]; empty without the scheme `opening`.
    pub stations: Vec<f64>,
    /// What every station has relaxed; empty without the scheme `opening` or without `viscoelastic`.
    pub relaxation: Vec<SectionRelaxation>,
    /// Force that opening took per advance of the tip in the last step, in the scheme `opening` [N].
    pub opening_resistance: f64,
    /// Force along the needle with which the tip spread the opened path in the last step, in the scheme `opening` [N].
    pub opening_spreading: f64,
    /// By how much this force falls per length that the path is shifted on, at most [N/m].
    pub opening_stiffness: f64,
    /// The tip on the surface, in the scheme `opening`.
    pub touch: Touch,
    /// Damage D of every pair of copies that may separate.
    pub pairs: Vec<f64>,
    /// History per cell; empty without `plasticity` and `viscoelastic`.
    pub points: Vec<PointState>,
}

impl State {
    /// What spreads the opened path.
    pub(crate) fn spreading(&self, contact: &TipContact) -> Spreading {
        let shift = contact.part(self.tip_coordinate) * self.touch.dimple;
        Spreading { force: self.opening_spreading, stiffness: self.opening_stiffness, shift }
    }

    /// True where both are states of one model.
    pub fn fits(&self, other: &State) -> bool {
        let sizes = |s: &State| {
            [
                s.displacement.len(),
                s.velocity.len(),
                s.inertia.len(),
                s.stiffness.len(),
                s.cut_samples.len(),
                s.contact.len(),
                s.stations.len(),
                s.relaxation.len(),
                s.pairs.len(),
                s.points.len(),
            ]
        };
        sizes(self) == sizes(other)
    }
}

/// Memory of one contact node.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ContactState {
    pub stick: DVec3,
    pub overlap: f64,
    pub axial_on: f64,
    pub touching: bool,
    /// True while it is pressed by the full shaft.
    pub on_shaft: bool,
    /// On a free path: distance r0 from the axis where the tip passed [m], and whether it has.
    pub rest_radius: f64,
    pub passed: bool,
    /// Held by its springs at the last step [J].
    pub stored: f64,
    /// Force of the contact damping at the last step [N].
    pub damping: DVec3,
}

impl ContactState {
    /// Takes the damping force of a step; dissipated in the last step of `dt` [J], in which the node moved with `v` past the tool: its
    /// mean force times the way. Forces belong to the beginnings of steps, velocities to their middles.
    pub fn damped(&mut self, force: DVec3, v: DVec3, dt: f64) -> f64 {
        let before = std::mem::replace(&mut self.damping, force);
        -0.5 * dt * (before + force).dot(v)
    }
}
