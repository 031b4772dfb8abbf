//! The tool: its shape and motion, where it is at a time, the beam of a flexible needle ([`beam`]), the geometry of paths and contact.

pub mod banded;
pub mod beam;
pub mod centre_line;
pub mod free_path;
pub mod gap;
pub mod motion;
pub mod opening;
pub mod path_line;
mod shape;
pub mod slit;
pub mod tip_contact;

use glam::DVec3;

pub use motion::{Motion, Phase, Vibration};
pub use shape::{BoreShape, NeedleShape, TipShape, Tool};

use motion::{HandPose, Leg, Placement};

/// Position and velocity of the tool tip at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolPose {
    /// Tip position [m].
    pub tip: DVec3,
    /// Velocity of the tip [m/s].
    pub velocity: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Angular velocity [rad/s]: a point of the tool at the lever l from the tip moves with v + omega x l.
    pub angular_velocity: DVec3,
    /// The same two over the step that begins with this pose [m/s], [rad/s]; they differ where a phase begins or ends within the steps
    /// before and after.
    pub velocity_ahead: DVec3,
    pub angular_velocity_ahead: DVec3,
    /// Depth along the direction from the entry point [m].
    pub depth: f64,
    /// Index of the phase.
    pub phase: usize,
}

impl ToolPose {
    /// Mean velocity over the step that ends with this pose [m/s]: by what the tool has moved, as nodes have with their velocity.
    pub fn velocity_behind(&self) -> DVec3 {
        2.0 * self.velocity - self.velocity_ahead
    }

    /// Mean angular velocity over the step that ends with this pose [rad/s].
    pub fn angular_velocity_behind(&self) -> DVec3 {
        2.0 * self.angular_velocity - self.angular_velocity_ahead
    }
}

/// Pose of the tool over time, one leg per phase; a vibration of the hub on top.
#[derive(Debug, Clone)]
pub struct Kinematics {
    /// Direction at the beginning: the tool is turned out of it without spin.
    reference: DVec3,
    /// Start time [s] and leg of each phase.
    legs: Vec<(f64, Leg)>,
    end: f64,
    at_end: Placement,
    vibration: Option<Vibration>,
    /// True where a hand leads: legs are no phases.
    led: bool,
    /// Depth along the needle that the tip does not get beyond [m]: it stands there until the phases take it back.
    deepest: f64,
    /// When it gets there, and when it leaves [s].
    stops: Vec<f64>,
}

impl Kinematics {
    /// Strings the phases together; the tool starts with its tip on the surface.
    pub fn new(motion: &Motion) -> Self {
        let mut time = 0.0;
        let mut legs = Vec::with_capacity(motion.phases.len());
        for leg in motion.legs() {
            legs.push((time, leg));
            time += leg.duration;
        }
        Kinematics {
            reference: motion.direction,
            legs,
            end: time,
            at_end: motion.end(),
            vibration: motion.vibration,
            led: false,
            deepest: f64::INFINITY,
            stops: Vec::new(),
        }
    }

    /// The same with a tip that does not get beyond a depth along the needle [m]: something holds it there.
    pub fn no_deeper_than(mut self, depth: Option<f64>) -> Self {
        let Some(depth) = depth else { return self };
        self.deepest = depth;
        for (start, leg) in &self.legs {
            let (from, to) = (leg.at(0.0).depth, leg.at(leg.duration).depth);
            if (from - depth) * (to - depth) < 0.0 {
                self.stops.push(start + leg.duration * (depth - from) / (to - from));
            }
        }
        self
    }

    /// A motion that a hand leads, see [`Kinematics::lead`]: it starts where the phases would.
    pub fn led(motion: &Motion) -> Self {
        Kinematics {
            reference: motion.direction,
            legs: Vec::new(),
            end: 0.0,
            at_end: motion.begin(),
            vibration: motion.vibration,
            led: true,
            deepest: f64::INFINITY,
            stops: Vec::new(),
        }
    }

    /// Goes on from the present end to `pose` at `until` [s].
    pub fn lead(&mut self, pose: &HandPose, until: f64) {
        let leg = Leg::led(&self.at_end, pose, until - self.end);
        self.at_end = Placement { velocity: DVec3::ZERO, turning: DVec3::ZERO, ..leg.at(leg.duration) };
        self.legs.push((self.end, leg));
        self.end = until;
    }

    /// Keeps the first `legs` of those that were led; `motion`: the one that the hand began with.
    pub fn keep(&mut self, legs: usize, motion: &Motion) {
        let Some((end, _)) = self.legs.get(legs) else { return };
        self.end = *end;
        self.legs.truncate(legs);
        self.at_end = match self.legs.last() {
            Some((_, leg)) => Placement { velocity: DVec3::ZERO, turning: DVec3::ZERO, ..leg.at(leg.duration) },
            None => motion.begin(),
        };
    }

    pub fn is_led(&self) -> bool {
        self.led
    }

    /// Where the tool is at the end of the motion so far.
    pub fn last(&self) -> HandPose {
        let at = self.at_end;
        HandPose { entry: at.tip - at.direction * at.depth, direction: at.direction, depth: at.depth }
    }

    /// Length of the motion [s].
    pub fn duration(&self) -> f64 {
        self.end
    }

    /// First time at which the tool gets as deep as `depth` [s]; `None` where it never does.
    pub fn time_of_depth(&self, depth: f64) -> Option<f64> {
        // The depth along a needle that turns is not linear in time.
        const PARTS: u32 = 64;
        self.legs.iter().find_map(|(start, leg)| {
            (0..PARTS).find_map(|i| {
                let time = |i: u32| leg.duration * f64::from(i) / f64::from(PARTS);
                let (from, to) = (leg.at(time(i)).depth, leg.at(time(i + 1)).depth);
                let reached = to > from && from <= depth && to >= depth - 1e-9;
                reached.then(|| {
                    let part = ((depth - from) / (to - from)).min(1.0);
                    start + time(i) + part * leg.duration / f64::from(PARTS)
                })
            })
        })
    }

    /// Pose at `time` [s]; after the end the phases stand still.
    pub fn pose(&self, time: f64) -> ToolPose {
        let last = self.legs.len().saturating_sub(1);
        let phase = self.legs.iter().rposition(|p| time >= p.0).unwrap_or(0);
        let at = if time >= self.end || self.legs.is_empty() {
            self.at_end
        } else {
            let (start, leg) = self.legs[phase];
            leg.at(time - start)
        };
        let at = if at.depth > self.deepest {
            let tip = at.tip - at.direction * (at.depth - self.deepest);
            Placement { tip, depth: self.deepest, velocity: DVec3::ZERO, ..at }
        } else {
            at
        };
        let (offset, shaking) = self.vibration.map_or((DVec3::ZERO, DVec3::ZERO), |v| v.at(time));
        let velocity = at.velocity + shaking;
        let angular_velocity = swing_rate(self.reference, at.direction, at.turning);
        ToolPose {
            tip: at.tip + offset,
            velocity,
            direction: at.direction,
            angular_velocity,
            velocity_ahead: velocity,
            angular_velocity_ahead: angular_velocity,
            depth: at.depth + offset.dot(at.direction),
            phase: if self.led { 0 } else { phase.min(last) },
        }
    }
}

impl Kinematics {
    /// Pose at the beginning `time` of a step of `dt` [s]. Its velocities are means over the steps before and after, so that a force there
    /// does the work of both halves, also where a phase begins or ends within them. Before t = 0 the tool stands still.
    pub fn pose_of_step(&self, time: f64, dt: f64) -> ToolPose {
        const PARTS: u32 = 8;
        let mut pose = self.pose(time);
        let (from, to) = (time - dt * (1.0 - 1e-6), time + dt * (1.0 - 1e-6));
        let kinks = self.legs.iter().map(|(start, _)| *start).chain([self.end]).chain(self.stops.iter().copied());
        let changes = kinks.into_iter().any(|t| from < t && t < to);
        if changes {
            // Means over half of the time: `from` is -1 for the step before, 0 for the step after.
            let mean = |from: f64| {
                let at = |i: u32| self.pose(time + dt * (from + (f64::from(i) + 0.5) / f64::from(PARTS)));
                let sums = (0..PARTS)
                    .map(at)
                    .fold((DVec3::ZERO, DVec3::ZERO), |s, p| (s.0 + p.velocity, s.1 + p.angular_velocity));
                (sums.0 / f64::from(PARTS), sums.1 / f64::from(PARTS))
            };
            let before = if time > 0.0 { mean(-1.0) } else { (DVec3::ZERO, DVec3::ZERO) };
            let after = mean(0.0);
            (pose.velocity, pose.angular_velocity) = (0.5 * (before.0 + after.0), 0.5 * (before.1 + after.1));
            (pose.velocity_ahead, pose.angular_velocity_ahead) = after;
        }
        pose
    }
}

/// The rotation without spin that brings the unit vector `from` to `to`, applied to `v`.
pub fn swing(from: DVec3, to: DVec3, v: DVec3) -> DVec3 {
    let w = from.cross(to);
    v + w.cross(v) + w.cross(w.cross(v)) / (1.0 + from.dot(to)).max(1e-6)
}

/// Angular velocity of [`swing`] when `to` changes at the rate `turning` [1/s]: twice the vector part of dQ/dt Q^-1 of the
/// quaternion Q = (1 + from.to, from x to).
fn swing_rate(from: DVec3, to: DVec3, turning: DVec3) -> DVec3 {
    if turning == DVec3::ZERO {
        return DVec3::ZERO;
    }
    let (real, vector) = (1.0 + from.dot(to), from.cross(to));
    let (real_rate, vector_rate) = (from.dot(turning), from.cross(turning));
    let square = (real * real + vector.length_squared()).max(1e-9);
    (vector_rate * real - vector * real_rate - vector_rate.cross(vector)) * (2.0 / square)
}

/// Two unit vectors that complete `direction` to an orthonormal frame.
pub fn lateral_axes(direction: DVec3) -> (DVec3, DVec3) {
    // x is never parallel to a direction that points into the top face, except at grazing entry.
    let guess = if direction.x.abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let first = (guess - direction * guess.dot(direction)).normalize();
    (first, direction.cross(first))
}

/// `count` vectors of the length `radius` [m] all around `direction`, the first turned by `turn` [rad] from the first lateral axis.
pub fn ring_around(direction: DVec3, count: usize, radius: f64, turn: f64) -> impl Iterator<Item = DVec3> {
    let (e1, e2) = lateral_axes(direction);
    (0..count).map(move |i| {
        let angle = std::f64::consts::TAU * i as f64 / count as f64 + turn;
        (e1 * angle.cos() + e2 * angle.sin()) * radius
    })
}

/// Rings of lines around the one on the axis in [`disc_lines`]: each has six more than the one within it.
pub const DISC_RINGS: usize = 4;

/// Vectors from the axis to the lines on which the tip of a needle of the radius `radius` [m] acts in the scheme `opening`: each stands for the
/// same part of a disc of the radius [`DISC`](tip_contact::DISC) R.
pub fn disc_lines(direction: DVec3, radius: f64) -> impl Iterator<Item = DVec3> {
    let within = |ring: usize| (1 + 3 * ring * (ring + 1)) as f64;
    (0..=DISC_RINGS).flat_map(move |ring| {
        // Half of the area of the ring lies within this distance.
        let part = 0.5 * (within(ring.max(1) - 1) + within(ring)) / within(DISC_RINGS);
        let from_axis = if ring == 0 { 0.0 } else { tip_contact::DISC * radius * part.sqrt() };
        ring_around(direction, (6 * ring).max(1), from_axis, 0.0)
    })
}

/// Vectors from the axis to the lines on which the tip springs of a solid needle of the radius `radius` [m] are anchored: 6 at R/2,
/// 12 at R, turned by `turn` [rad]; before them the axis itself where `centre` is true.
pub fn tip_lines(direction: DVec3, radius: f64, turn: f64, centre: bool) -> Vec<DVec3> {
    let rings = ring_around(direction, 6, 0.5 * radius, turn).chain(ring_around(direction, 12, radius, turn));
    centre.then_some(DVec3::ZERO).into_iter().chain(rings).collect()
}

/// A straight planned path: from `entry` on the surface along `direction`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannedPath {
    /// [m]
    pub entry: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Normal of the surface at the entry point, out of the tissue, of any length; +z for a block.
    pub normal: DVec3,
}

impl PlannedPath {
    /// Material coordinates of a rest position [m]: distance r0 from the axis, and the axial distance s0 from
    /// the point where the line through `x` parallel to the path enters the plane of the surface (the top face z = 0 of a
    /// block), so that at oblique entry the front of the path is parallel to the surface.
    pub fn material_coordinates(&self, x: DVec3) -> (f64, f64) {
        let relative = x - self.entry;
        let axial = relative.dot(self.direction);
        let radial = (relative - self.direction * axial).length();
        (radial, relative.dot(self.normal) / self.direction.dot(self.normal))
    }

    /// Axial coordinate [m], from the entry point, at which the line beside the axis by `offset` [m] enters that plane.
    pub fn entry_beside(&self, offset: DVec3) -> f64 {
        -offset.dot(self.normal) / self.direction.dot(self.normal)
    }

    /// A path into the top face of a block.
    pub fn into_block(entry: DVec3, direction: DVec3) -> Self {
        PlannedPath { entry, direction, normal: DVec3::Z }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// d/dt of a vector that swings with the needle is omega x vector.
    #[test]
    fn the_angular_velocity_is_that_of_the_swing() {
        let (from, spin) = (DVec3::new(0.1, 0.2, -0.9).normalize(), DVec3::new(0.4, -0.7, 0.2));
        let to = |t: f64| glam::DQuat::from_scaled_axis(spin * t) * DVec3::new(0.5, -0.1, -0.7).normalize();
        let v = DVec3::new(0.3, 0.8, 0.1);
        let h = 1e-6;
        let rate = (swing(from, to(h), v) - swing(from, to(-h), v)) / (2.0 * h);
        let omega = swing_rate(from, to(0.0), spin.cross(to(0.0)));
        assert!((rate - omega.cross(swing(from, to(0.0), v))).length() < 1e-8);
        assert!((omega.cross(to(0.0)) - spin.cross(to(0.0))).length() < 1e-12);
        assert!((swing(from, to(0.0), from) - to(0.0)).length() < 1e-12);
    }
}
