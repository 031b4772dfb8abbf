//! The free path: where the needle has gone through the material is found while it goes.
//!
//! A planned path has material coordinates (r0, s0) that are known before the run. A motion with another direction inside, a
//! second track or a sideways move has none, so the state of the tip holds its material point `X` (rest position [m]) and
//! the direction `T` of its advance through the material; x(X) = X + u(X) and F are those of the mesh at X, F the mean over
//! the anchors.
//! ```text
//! anchors   X_k = X + o_k, o_k in the plane through X normal to T (not above the surface), k = 1..N
//! gaps      g_k = (p - x(X_k)).t + (X_k - X).T,  force k_tip/N max(0, g_k) along t
//! sway      l = (1 - t t)(p - <x(X_k)> + <X_k - X>),  force k_tip/N l on every anchor: the tissue holds the tip
//! advance   where F = sum of the forces > F_c:  X += T da,  da as in the tip law;  T follows F^-1 t/|F^-1 t| over TURNING
//! slip      where k_tip |l| > min(F, F_c):  X += F^-1 (the part of l that is too long)
//! retreat   where <g_k> < -SLACK:  X -= T (-SLACK - <g_k>)/lambda, without force: the needle draws back in its own track
//! ```
//! What the springs lose in these three moves is dissipated. `F_c(a)` as in the tip law, `a` [m] the way since the surface,
//! with the forces of the material at the tip, and 0 where the material just ahead has been cut before: a re-insertion along
//! an open track needs no cutting force until it comes to the end of the track.
//!
//! Material that has been cut: 4^3 sample points per cell, marked when they come to lie behind the tip within a0. Their
//! number is the fraction phi of the softened path, which follows it at a bounded rate. "Just ahead" is farther than any sample that the tip's own plane can
//! have marked, else the tip would find its own cut before it.
//!
//! Nodes. When the plane through X normal to T passes a node within the ring radius, its distance from the axis becomes its
//! r0 (not before the puncture); when the tip draws back over it, it is forgotten. Nodes with a0 < r0 keep to the opened path as in the planned case.
//! A node that the tip has not passed, met sideways by the shaft, stays outside the bare shaft, r >= R. Tissue that a
//! sideways load presses against the needle slides off its end: there the overlap fades, phi min(1, (s - s_e)/l), with the
//! gradient of the product, so that it lets go without a jump and gives back all that it holds. s_e: the tip (0), for the
//! bare shaft its front end (Lc).
//!
//! A track begins where the tip comes through the top face, and ends where it comes out of it; outside there is no force. The
//! tip springs pull along t and sideways with their exact gradients; with v + omega x lever as the velocity of the needle the
//! work of a turning needle is force . v + torque . omega. Source: this project.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::gap::Overlap;

/// Sample points of a cell along each axis.
pub const SAMPLES: usize = 4;

/// Gap between the retreating tip and the material point that it leaves behind [m].
pub const SLACK: f64 = 0.2e-3;

/// Way over which T turns to the pulled-back direction of the needle [m]. With T always there, the anchors follow every tilt
/// of the tissue around them instead of resisting it, and the tip rattles (438 clamped nodes on the way to 12 mm).
pub const TURNING: f64 = 0.3e-3;

/// Depth behind the tip's plane in which samples are marked, in softened radii.
pub const MARKED_BEHIND: f64 = 0.5;

/// How far ahead cut material is looked for, in extents of half a sample spacing along T.
pub const LOOK_AHEAD: f64 = 1.05;

/// How far before the tip a passed node may come in space until it counts as not passed [m]. In sheared tissue the plane
/// normal to T is oblique to the needle, and by that plane alone loaded nodes would be let go.
pub const PASSED_MARGIN: f64 = 0.05e-3;

/// Distance from the needle's axis, in needle radii, from which a node that the tip has not passed is watched.
pub const WATCHED: f64 = 1.5;

/// Largest sideways slip and retreat in one step beside what the needle travels [m].
pub const SLIP_CAP: f64 = 22e-6;

/// Largest loss of stiffness of a cell, as a part of the whole, per cell edge of advance: a plane of samples is passed at
/// once, and a jump of a quarter of the stiffness would shake the tissue.
pub const SOFTENING_RATE: f64 = 1.5;

/// Length over which the overlap fades at the front end of what a node touches, in tip lengths.
pub const END_FADE: f64 = 0.25;

/// Height of a skin that is not there [m]: far below every scene, so that a mean with others is, too.
pub const NO_SKIN: f64 = -1.0e3;

/// Regions of a scene with a free path: with the tissue's own material and nothing they fill the table of tip forces on the device.
pub const MOST_REGIONS: usize = 14;

/// Instead of the number of a tissue, for what does not deform: the tip finds the forces that it had before, and stops at the true
/// surface, which lies within a cell.
pub const AS_BEFORE: u8 = u8::MAX;

/// What the shaders have of this file.
pub const SHADER_CONSTANTS: [(&str, f64); 11] = [
    ("SAMPLES", SAMPLES as f64),
    ("SLACK", SLACK),
    ("TURNING", TURNING),
    ("MARKED_BEHIND", MARKED_BEHIND),
    ("LOOK_AHEAD", LOOK_AHEAD),
    ("PASSED_MARGIN", PASSED_MARGIN),
    ("WATCHED", WATCHED),
    ("SLIP_CAP", SLIP_CAP),
    ("SOFTENING_RATE", SOFTENING_RATE),
    ("END_FADE", END_FADE),
    ("NO_SKIN", NO_SKIN),
];

/// The overlap of a node at `s` behind the tip, faded over `length` [m] behind `end` [m]; `d` is the gradient of s.
pub fn faded_at_end(overlap: Overlap, d: DVec3, s: f64, end: f64, length: f64) -> Overlap {
    let part = ((s - end) / length).min(1.0);
    let slope = if part < 1.0 { 1.0 / length } else { 0.0 };
    Overlap { value: overlap.value * part, gradient: overlap.gradient * part + d * (overlap.value * slope) }
}

/// Where the tip is in the material.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FreeTip {
    /// Material point X of the tip, a rest position [m].
    pub place: DVec3,
    /// Direction T of the advance through the material (unit), and the axis of the anchors' angles, normal to it.
    pub along: DVec3,
    pub across: DVec3,
    /// Way since the surface a [m], and its value where the tip entered the present material.
    pub coordinate: f64,
    pub entry: f64,
    /// Way through the material in this step that marks cells, forwards or sideways [m].
    pub advance: f64,
    /// Index of the material at the tip.
    pub material: usize,
    /// True in the tissue.
    pub inside: bool,
}

/// Place of an anchor in the tip's plane, along `across` and along T x `across` [m]: one on the axis, 6 at R/2, 12 at R.
pub fn anchor_offset(anchor: usize, radius: f64) -> (f64, f64) {
    let on_ring = |i: usize, count: usize, r: f64| {
        let angle = std::f64::consts::TAU * i as f64 / count as f64;
        (r * angle.cos(), r * angle.sin())
    };
    match anchor {
        0 => (0.0, 0.0),
        1..=6 => on_ring(anchor - 1, 6, 0.5 * radius),
        _ => on_ring(anchor - 7, 12, radius),
    }
}
