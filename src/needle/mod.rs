//! Motion of the tool on the CPU, the flexible needle ([`beam`]), and the geometry of a planned path.

pub mod banded;
pub mod beam;
pub mod centre_line;
pub mod flexible;

pub mod gap;

use glam::DVec3;

use crate::scene::{Motion, Phase, Vibration};

/// Position and velocity of the tool tip at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Tip position [m].
    pub tip: DVec3,
    /// Velocity [m/s].
    pub velocity: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Depth along the direction from the entry point [m].
    pub depth: f64,
    /// Index of the phase.
    pub phase: usize,
}

/// Depth of the tool over time: piecewise linear, one piece per phase; a vibration of the hub on top.
#[derive(Debug, Clone)]
pub struct Kinematics {
    entry: DVec3,
    direction: DVec3,
    /// Start time [s], start depth [m] and velocity along the direction [m/s] of each phase.
    pieces: Vec<(f64, f64, f64)>,
    end: f64,
    end_depth: f64,
    vibration: Option<Vibration>,
}

impl Kinematics {
    /// Strings the phases together; the tool starts with its tip on the surface.
    pub fn new(motion: &Motion) -> Self {
        let (mut time, mut depth) = (0.0, 0.0);
        let mut pieces = Vec::with_capacity(motion.phases.len());
        for phase in &motion.phases {
            let (target, rate, duration): (f64, f64, f64) = match *phase {
                Phase::Insert { speed, depth: to } => (to, speed, (to - depth) / speed),
                Phase::Hold { duration } => (depth, 0.0, duration),
                Phase::Withdraw { speed, depth: to } => (to, -speed, (depth - to) / speed),
            };
            pieces.push((time, depth, rate));
            time += duration;
            depth = target;
        }
        Kinematics {
            entry: motion.entry,
            direction: motion.direction,
            pieces,
            end: time,
            end_depth: depth,
            vibration: motion.vibration,
        }
    }

    /// Length of the motion [s].
    pub fn duration(&self) -> f64 {
        self.end
    }

    /// First time at which the tool gets as deep as `depth` [s]; `None` where it never does.
    pub fn time_of_depth(&self, depth: f64) -> Option<f64> {
        let ends = self.pieces.iter().skip(1).map(|p| p.0).chain([self.end]);
        self.pieces.iter().zip(ends).find_map(|(&(start, from, rate), end)| {
            let reached = from + rate * (end - start) >= depth - 1e-9;
            (rate > 0.0 && from <= depth && reached).then(|| (start + (depth - from) / rate).min(end))
        })
    }

    /// Pose at `time` [s]; after the end the phases stand still.
    pub fn pose(&self, time: f64) -> ToolPose {
        let last = self.pieces.len().saturating_sub(1);
        let phase = self.pieces.iter().rposition(|p| time >= p.0).unwrap_or(0);
        let (depth, rate) = if time >= self.end || self.pieces.is_empty() {
            (self.end_depth, 0.0)
        } else {
            let (start, depth, rate) = self.pieces[phase];
            (depth + rate * (time - start), rate)
        };
        let (offset, shaking) = self.vibration.map_or((DVec3::ZERO, DVec3::ZERO), |v| v.at(time));
        ToolPose {
            tip: self.entry + self.direction * depth + offset,
            velocity: self.direction * rate + shaking,
            direction: self.direction,
            depth: depth + offset.dot(self.direction),
            phase: phase.min(last),
        }
    }
}

/// Two unit vectors that complete `direction` to an orthonormal frame.
pub fn lateral_axes(direction: DVec3) -> (DVec3, DVec3) {
    // x is never parallel to a direction that points into the top face, except at grazing entry.
    let guess = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let first = (guess - direction * guess.dot(direction)).normalize();
    (first, direction.cross(first))
}

/// A straight planned path: from `entry` on the top face along `direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedPath {
    pub entry: DVec3,
    pub direction: DVec3,
}

impl PlannedPath {
    /// Material coordinates of a rest position [m]: distance r0 from the axis, and the axial distance s0 from
    /// the point where the line through `x` parallel to the path enters the top face (z = 0), so that at oblique
    /// entry the front of the path is parallel to the surface.
    pub fn material_coordinates(&self, x: DVec3) -> (f64, f64) {
        let relative = x - self.entry;
        let axial = relative.dot(self.direction);
        let radial = (relative - self.direction * axial).length();
        (radial, x.z / self.direction.z)
    }
}
