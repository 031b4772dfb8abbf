//! Motion of the tool: phases as a scene states them, and the legs of a rigid motion that they make.

#![warn(missing_docs)]

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// How far beyond the deepest phase a hand may go [m], and to which part of the height of the tissue.
const ROOM: f64 = 4e-3;
const ROOM_PART: f64 = 0.85;

/// Motion of the tool, phase after phase.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Motion {
    /// Entry point on the top face [m] (z = 0).
    pub entry: DVec3,
    /// Unit vector of the insertion, into the tissue (z < 0).
    pub direction: DVec3,
    /// One after the other; the tip stands on the surface before the first.
    pub phases: Vec<Phase>,
    /// What the hub does beside the phases.
    pub vibration: Option<Vibration>,
}

/// A sinusoidal motion of the hub from t = 0 on: `amplitude sin(2 pi frequency t)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vibration {
    /// Amplitude [m].
    pub amplitude: f64,
    /// Frequency [Hz].
    pub frequency: f64,
    /// Unit vector of the motion.
    pub direction: DVec3,
}

impl Vibration {
    /// Offset [m] and its exact derivative [m/s] at `time` [s].
    pub fn at(&self, time: f64) -> (DVec3, DVec3) {
        let rate = std::f64::consts::TAU * self.frequency;
        let (sine, cosine) = (rate * time).sin_cos();
        (self.direction * (self.amplitude * sine), self.direction * (self.amplitude * rate * cosine))
    }
}

/// One phase of the motion. Depth is measured along the needle from the point where its axis meets the top face at rest
/// [m]. With the last three kinds the motion is free: no longer one straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Phase {
    /// Advance to `depth` at `speed` [m/s].
    Insert {
        /// Along the needle [m/s].
        speed: f64,
        /// Of the tip at the end [m].
        depth: f64,
    },
    /// Stand still for `duration` [s].
    Hold {
        /// Until the next phase [s].
        duration: f64,
    },
    /// Go back to `depth` (>= 0 or slightly negative: out of the tissue) at `speed` [m/s].
    Withdraw {
        /// Along the needle, positive [m/s].
        speed: f64,
        /// Of the tip at the end [m].
        depth: f64,
    },
    /// Bring the tip to `to` [m] on a straight line at `speed` [m/s], and meanwhile the needle to `direction`.
    Move {
        /// Tip at the end [m].
        to: DVec3,
        /// Of the tip on its line [m/s].
        speed: f64,
        /// Unit vector of the insertion at the end.
        direction: DVec3,
    },
    /// Turn to `direction` at `rate` [rad/s] about `pivot` [m], a point fixed in space.
    Turn {
        /// Unit vector of the insertion at the end.
        direction: DVec3,
        /// Angular speed [rad/s].
        rate: f64,
        /// Stays where it is [m].
        pivot: DVec3,
    },
    /// Outside the tissue, in no time: to another `entry` [m] (z = 0) and `direction`, at the same height along the needle.
    Reposition {
        /// Where the axis then meets the top face [m].
        entry: DVec3,
        /// Unit vector of the insertion from then on.
        direction: DVec3,
    },
}

/// One phase as a rigid motion with constant rates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// [s]
    pub duration: f64,
    /// Unit vector of the insertion at its beginning.
    pub direction: DVec3,
    path: LegPath,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum LegPath {
    /// Along the needle: entry [m], depth at the beginning [m], rate of the depth [m/s].
    Along { entry: DVec3, depth: f64, rate: f64 },
    /// The tip goes from `tip` with `velocity` while the needle turns with `spin` [rad/s].
    Free { tip: DVec3, velocity: DVec3, spin: DVec3 },
    /// The needle turns with `spin` [rad/s] about `pivot`.
    Turn { tip: DVec3, pivot: DVec3, spin: DVec3 },
}

/// Where a hand wants the needle to be at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HandPose {
    /// Point of the top face at rest that the needle goes through [m].
    pub entry: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Distance of the tip behind the top face, along the needle [m]; negative outside.
    pub depth: f64,
}

/// Where the needle is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Tip [m], its velocity [m/s], direction (unit) and its rate of change [1/s].
    pub tip: DVec3,
    /// Of the tip [m/s].
    pub velocity: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Rate of change of the direction [1/s].
    pub turning: DVec3,
    /// Distance of the tip behind the top face at rest, along the needle [m].
    pub depth: f64,
}

/// Depth along a needle whose tip is at `tip` [m].
fn depth_along(tip: DVec3, direction: DVec3) -> f64 {
    tip.z / direction.z
}

/// Constant rotation from one unit vector to another in `duration` [s], as an angular velocity [rad/s].
fn spin_between(from: DVec3, to: DVec3, duration: f64) -> DVec3 {
    let axis = from.cross(to);
    let angle = axis.length().atan2(from.dot(to));
    if angle > 1e-12 && duration > 0.0 { axis.normalize() * (angle / duration) } else { DVec3::ZERO }
}

impl Leg {
    /// The way from a placement to where a hand wants the needle, in `duration` [s]; along the needle where it only advances.
    pub fn led(from: &Placement, to: &HandPose, duration: f64) -> Self {
        let entry = from.tip - from.direction * from.depth;
        let path = if to.direction == from.direction && (to.entry - entry).length() < 1e-9 {
            LegPath::Along { entry: to.entry, depth: from.depth, rate: (to.depth - from.depth) / duration }
        } else {
            let velocity = (to.entry + to.direction * to.depth - from.tip) / duration;
            LegPath::Free { tip: from.tip, velocity, spin: spin_between(from.direction, to.direction, duration) }
        };
        Leg { duration, direction: from.direction, path }
    }

    /// Placement `time` [s] after the beginning of the leg.
    pub fn at(&self, time: f64) -> Placement {
        let turned = |spin: DVec3| {
            let rotation = DQuat::from_scaled_axis(spin * time);
            let direction = rotation * self.direction;
            (rotation, direction, spin.cross(direction))
        };
        match self.path {
            LegPath::Along { entry, depth, rate } => {
                let depth = depth + rate * time;
                Placement {
                    tip: entry + self.direction * depth,
                    velocity: self.direction * rate,
                    direction: self.direction,
                    turning: DVec3::ZERO,
                    depth,
                }
            }
            LegPath::Free { tip, velocity, spin } => {
                let (_, direction, turning) = turned(spin);
                let tip = tip + velocity * time;
                Placement { tip, velocity, direction, turning, depth: depth_along(tip, direction) }
            }
            LegPath::Turn { tip, pivot, spin } => {
                let (rotation, direction, turning) = turned(spin);
                let arm = rotation * (tip - pivot);
                let tip = pivot + arm;
                Placement { tip, velocity: spin.cross(arm), direction, turning, depth: depth_along(tip, direction) }
            }
        }
    }
}

impl Motion {
    /// True where the tip leaves one straight line.
    pub fn is_free(&self) -> bool {
        self.phases.iter().any(|p| matches!(p, Phase::Move { .. } | Phase::Turn { .. } | Phase::Reposition { .. }))
    }

    /// The phases as rigid motions, one leg each; the tool starts with its tip on the surface.
    pub fn legs(&self) -> Vec<Leg> {
        let (mut entry, mut direction, mut depth) = (self.entry, self.direction, 0.0);
        let mut legs = Vec::with_capacity(self.phases.len());
        for phase in &self.phases {
            let tip = entry + direction * depth;
            let along = |rate: f64| LegPath::Along { entry, depth, rate };
            let (target, duration, path) = match *phase {
                Phase::Insert { speed, depth: to } => (to, (to - depth) / speed, along(speed)),
                Phase::Hold { duration } => (depth, duration, along(0.0)),
                Phase::Withdraw { speed, depth: to } => (to, (depth - to) / speed, along(-speed)),
                Phase::Move { to, speed, direction: end } => {
                    let duration = (to - tip).length() / speed;
                    let velocity = if duration > 0.0 { (to - tip) / duration } else { DVec3::ZERO };
                    (0.0, duration, LegPath::Free { tip, velocity, spin: spin_between(direction, end, duration) })
                }
                Phase::Turn { direction: end, rate, pivot } => {
                    let duration = direction.angle_between(end) / rate;
                    (0.0, duration, LegPath::Turn { tip, pivot, spin: spin_between(direction, end, duration) })
                }
                Phase::Reposition { .. } => (depth.min(0.0), 0.0, along(0.0)),
            };
            let leg = Leg { duration, direction, path };
            legs.push(leg);
            match *phase {
                Phase::Move { direction: end, .. } | Phase::Turn { direction: end, .. } => {
                    let tip = leg.at(duration).tip;
                    direction = end;
                    depth = depth_along(tip, end);
                    entry = tip - end * depth;
                }
                Phase::Reposition { entry: point, direction: end } => {
                    (entry, direction, depth) = (point, end, target);
                }
                _ => depth = target,
            }
        }
        legs
    }

    /// Placement before the first phase: the tip on the surface.
    pub fn begin(&self) -> Placement {
        Placement {
            tip: self.entry,
            velocity: DVec3::ZERO,
            direction: self.direction,
            turning: DVec3::ZERO,
            depth: 0.0,
        }
    }

    /// Placement after the last phase.
    pub fn end(&self) -> Placement {
        match self.legs().last() {
            Some(leg) => Placement { velocity: DVec3::ZERO, turning: DVec3::ZERO, ..leg.at(leg.duration) },
            None => self.begin(),
        }
    }

    /// Placements all along the motion, at most `spacing` [m] of travel of tip or surface point apart.
    pub fn samples(&self, spacing: f64) -> Vec<Placement> {
        let mut all = Vec::new();
        for leg in self.legs() {
            let begin = leg.at(0.0);
            let arm = begin.depth.abs().max(leg.at(leg.duration).depth.abs());
            let travel = (begin.velocity.length() + begin.turning.length() * arm) * leg.duration;
            let count = (travel / spacing).ceil().clamp(1.0, 1e4) as usize;
            all.extend((0..=count).map(|i| leg.at(leg.duration * i as f64 / count as f64)));
        }
        all
    }

    /// Largest depth along the needle [m].
    pub fn deepest(&self) -> f64 {
        if self.is_free() {
            return self.samples(1e-3).iter().map(|p| p.depth).fold(0.0, f64::max);
        }
        self.phases.iter().fold(0.0, |deepest, phase| match *phase {
            Phase::Insert { depth, .. } => depth.max(deepest),
            _ => deepest,
        })
    }

    /// A straight motion for a hand: as deep as the phases and up to `ROOM` beyond, so that one may overshoot, in tissue of the height
    /// `height` [m]. A free motion stays as it is: its path is found on the way.
    pub fn with_room(&self, height: f64) -> Motion {
        let deepest = self.deepest();
        if self.is_free() || deepest <= 0.0 {
            return self.clone();
        }
        let floor = ROOM_PART * height / -self.direction.z;
        let depth = (deepest + ROOM).min(floor).max(deepest);
        Motion { phases: vec![Phase::Insert { speed: self.largest_speed(), depth }], ..self.clone() }
    }

    /// Where the tip of a straight motion is at the largest depth [m].
    pub fn deepest_point(&self) -> DVec3 {
        self.entry + self.direction * self.deepest()
    }

    /// Distance of a point from the way of a straight motion, entry to deepest point [m].
    pub fn distance_from_path(&self) -> impl Fn(DVec3) -> f64 {
        let (entry, way) = (self.entry, self.deepest_point() - self.entry);
        let square = way.length_squared();
        move |x| {
            let part = if square > 0.0 { ((x - entry).dot(way) / square).clamp(0.0, 1.0) } else { 0.0 };
            x.distance(entry + way * part)
        }
    }

    /// The deepest point, not below the bottom of a block of height `height` [m].
    pub fn deepest_point_in(&self, height: f64) -> DVec3 {
        self.entry + self.direction * self.deepest().min(height / -self.direction.z)
    }

    /// Box of the part of the needle's axis that comes to lie in the tissue, a block of height `height` [m].
    pub fn reach(&self, height: f64) -> (DVec3, DVec3) {
        if !self.is_free() {
            let end = self.deepest_point_in(height);
            return (self.entry.min(end), self.entry.max(end));
        }
        let inside = |p: &Placement| {
            let surface = p.tip - p.direction * p.depth;
            [surface, if p.depth > 0.0 { p.tip } else { surface }]
        };
        let samples = self.samples(1e-3);
        let near = samples.iter().filter(|p| p.depth > -1e-3).flat_map(inside);
        near.fold((self.entry, self.entry), |(low, high), x| (low.min(x), high.max(x)))
    }

    /// Largest speed of all phases, of the tip or of the point at the surface [m/s].
    pub fn largest_speed(&self) -> f64 {
        let shaking = self.vibration.map_or(0.0, |v| v.at(0.0).1.length());
        if self.is_free() {
            let speed = |p: &Placement| p.velocity.length().max(p.turning.length() * p.depth.abs());
            return shaking + self.samples(1e-3).iter().map(speed).fold(0.0, f64::max);
        }
        let phases = self.phases.iter().fold(0.0, |largest, phase| match *phase {
            Phase::Insert { speed, .. } | Phase::Withdraw { speed, .. } => speed.max(largest),
            _ => largest,
        });
        shaking + phases
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Velocity and turning are the derivatives of tip and direction, and a leg begins where the one before it ends.
    #[test]
    fn legs_join_and_move_as_they_say() {
        let tilted = DVec3::new(0.3, 0.1, -0.9).normalize();
        let motion = Motion {
            entry: DVec3::new(1e-3, 0.0, 0.0),
            direction: DVec3::NEG_Z,
            phases: vec![
                Phase::Insert { speed: 2e-3, depth: 6e-3 },
                Phase::Turn { direction: tilted, rate: 0.5, pivot: DVec3::new(1e-3, 0.0, 0.0) },
                Phase::Move { to: DVec3::new(3e-3, 1e-3, -8e-3), speed: 1e-3, direction: DVec3::NEG_Z },
                Phase::Withdraw { speed: 2e-3, depth: -1e-3 },
            ],
            vibration: None,
        };
        let legs = motion.legs();
        for pair in legs.windows(2) {
            let (a, b) = (pair[0].at(pair[0].duration), pair[1].at(0.0));
            assert!((a.tip - b.tip).length() < 1e-15 && (a.direction - b.direction).length() < 1e-12);
            assert!((a.depth - b.depth).abs() < 1e-15);
        }
        for leg in &legs {
            let (t, h) = (0.4 * leg.duration, 1e-5);
            let (a, b, c) = (leg.at(t - h), leg.at(t), leg.at(t + h));
            assert!(((c.tip - a.tip) / (2.0 * h) - b.velocity).length() < 1e-9);
            assert!(((c.direction - a.direction) / (2.0 * h) - b.turning).length() < 1e-6);
        }
        assert!((legs[2].at(0.0).tip - tilted * 6e-3 - motion.entry).length() < 1e-12);
        assert!((motion.end().depth + 1e-3).abs() < 1e-15);
        assert!((motion.deepest() - 8e-3).abs() < 1e-12);
    }
}
