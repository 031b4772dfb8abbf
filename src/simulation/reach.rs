//! What the tissue can follow of what a hand wants: ends of the way, speeds, angles.

use glam::{DQuat, DVec2, DVec3};

use super::advice::tool_mach;
use crate::mesh::BlockMesh;
use crate::model::{Model, Skin};
use crate::needle::motion::HandPose;

/// Tool speed over the scaled shear wave speed beyond which inertia, not tissue, answers the hand.
const LARGEST_MACH: f64 = 0.3;

/// How far out of the tissue a hand may lead the tip [m].
pub const OUTSIDE: f64 = 5e-3;

/// Largest angle to the vertical [rad]: a needle that lies on the surface has no point of entry.
pub const STEEPEST: f64 = 80.0 * std::f64::consts::PI / 180.0;

/// Largest angular speed [rad/s].
pub const TURNING: f64 = 1.0;

/// How deep a tip may be, as a part of the height of the tissue: below, the support answers and not the tissue.
const FLOOR_PART: f64 = 0.85;

/// Largest speed of a hand that is let through [m/s].
pub fn speed_limit(model: &Model) -> f64 {
    let script = model.scene.motion.largest_speed();
    let wave = tool_mach(model).map(|mach| script / mach);
    wave.map_or(f64::INFINITY, |wave| LARGEST_MACH * wave).max(script)
}

/// Where a hand may lead the needle on a free path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeReach<'a> {
    /// Corners of the top face within which a needle may enter [m].
    pub low: DVec2,
    pub high: DVec2,
    /// Height of the lowest place of a tip [m], < 0.
    pub floor: f64,
    /// What knows the skin; `None`: the top face, 0.
    pub skin: Option<(&'a Skin, &'a BlockMesh)>,
}

/// Where a hand may lead the needle, and how fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach<'a> {
    /// Largest speed of the tip and of the point of entry [m/s].
    pub speed: f64,
    /// Largest depth on a planned path [m].
    pub deepest: f64,
    /// `None` where the path is planned: a straight line, to which the needle keeps.
    pub free: Option<FreeReach<'a>>,
}

impl<'a> Reach<'a> {
    /// The reach in a model; `speed`: the largest that the tissue follows [m/s].
    pub fn of(model: &'a Model, speed: f64) -> Self {
        let (low, high) = model.mesh.bounds();
        // A tip that leaves through a side has nothing around it that holds it.
        let margin = 2.0 * model.scene.tissue.cell_size;
        let free = model.skin().map(|skin| FreeReach {
            low: low.truncate() + margin,
            high: high.truncate() - margin,
            floor: FLOOR_PART * low.z,
            skin: model.mesh.as_block().map(|mesh| (skin, mesh)),
        });
        Reach { speed, deepest: model.scene.motion.deepest(), free }
    }

    /// What a needle at `now` can do in `duration` [s] of what is wanted, and whether it was too fast.
    pub fn within(&self, now: &HandPose, wanted: &HandPose, duration: f64) -> (HandPose, bool) {
        let Some(free) = &self.free else { return self.along_the_path(now, wanted, duration) };
        let wanted = free.clamped(now, wanted);
        let (way, shift) = (wanted.depth - now.depth, wanted.entry - now.entry);
        let axis = now.direction.cross(wanted.direction);
        let angle = axis.length().atan2(now.direction.dot(wanted.direction));
        // The longest way of a point of the needle between tip and entry, all three together.
        let travel = way.abs() + shift.length() + angle * now.depth.abs().max(wanted.depth.abs());
        let part = (self.speed * duration / travel).min(TURNING * duration / angle);
        // Nothing to do makes it infinite.
        if part >= 1.0 || part.is_nan() {
            return (wanted, false);
        }
        let direction = match axis.length() > 0.0 {
            true => (DQuat::from_scaled_axis(axis.normalize() * (angle * part)) * now.direction).normalize(),
            false => now.direction,
        };
        (HandPose { entry: now.entry + shift * part, direction, depth: now.depth + way * part }, true)
    }

    /// The same needle with its point of entry where its axis meets the skin.
    pub fn behind_the_skin(&self, mut pose: HandPose) -> HandPose {
        /// The skin is flat nearly enough over the way of one round.
        const ROUNDS: usize = 8;
        let Some(free) = &self.free else { return pose };
        for _ in 0..ROUNDS {
            let Some(skin) = free.on_skin(pose.entry.truncate()) else { break };
            let way = (skin.z - pose.entry.z) / pose.direction.z;
            if way == 0.0 {
                break;
            }
            pose.entry += pose.direction * way;
            pose.depth -= way;
        }
        pose
    }

    /// The wanted tip as a depth on the planned path.
    fn along_the_path(&self, now: &HandPose, wanted: &HandPose, duration: f64) -> (HandPose, bool) {
        let depth = match wanted.direction == now.direction && wanted.entry == now.entry {
            true => wanted.depth,
            false => (wanted.entry + wanted.direction * wanted.depth - now.entry).dot(now.direction),
        };
        let step = self.speed * duration;
        let way = depth.clamp(-OUTSIDE, self.deepest) - now.depth;
        let limited = way.clamp(-step, step);
        (HandPose { depth: now.depth + limited, ..*now }, limited != way)
    }
}

impl FreeReach<'_> {
    /// The point of the skin above or below a point; `None` where there is no tissue below.
    fn on_skin(&self, x: DVec2) -> Option<DVec3> {
        let height = self.skin.map_or(Some(0.0), |(skin, mesh)| skin.skin_at(mesh, x.extend(0.0)));
        height.map(|height| x.extend(height))
    }

    /// The nearest pose that a needle may have. What is wanted as it is stays bit for bit.
    fn clamped(&self, now: &HandPose, wanted: &HandPose) -> HandPose {
        let direction = match wanted.direction == now.direction {
            true => now.direction,
            false => not_too_flat(wanted.direction),
        };
        let entry = match wanted.entry == now.entry {
            true => now.entry,
            // Beside the tissue there is no point of entry.
            false => self.on_skin(wanted.entry.truncate().clamp(self.low, self.high)).unwrap_or(now.entry),
        };
        HandPose { entry, direction, depth: wanted.depth.clamp(-OUTSIDE, self.deepest(entry, direction)) }
    }

    /// Depth at which a tip comes to the floor or near a side [m].
    fn deepest(&self, entry: DVec3, direction: DVec3) -> f64 {
        let side = |axis: usize| match direction[axis] {
            d if d > 0.0 => (self.high[axis] - entry[axis]) / d,
            d if d < 0.0 => (self.low[axis] - entry[axis]) / d,
            _ => f64::INFINITY,
        };
        side(0).min(side(1)).min((self.floor - entry.z) / direction.z).max(0.0)
    }
}

/// The direction itself, or the nearest one at the steepest angle allowed.
fn not_too_flat(direction: DVec3) -> DVec3 {
    let flattest = STEEPEST.cos();
    if -direction.z >= flattest && (direction.length_squared() - 1.0).abs() < 1e-9 {
        return direction;
    }
    let direction = direction.normalize();
    let aside = direction.truncate();
    if -direction.z >= flattest || aside == DVec2::ZERO {
        return DVec3 { z: -direction.z.abs(), ..direction };
    }
    (aside.normalize() * STEEPEST.sin()).extend(-STEEPEST.cos())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const FRAME: f64 = 1.0 / 60.0;

    fn free() -> Reach<'static> {
        let free = FreeReach { low: DVec2::new(-8e-3, -6e-3), high: DVec2::new(8e-3, 6e-3), floor: -12e-3, skin: None };
        Reach { speed: 10e-3, deepest: 9e-3, free: Some(free) }
    }

    fn upright(depth: f64) -> HandPose {
        HandPose { entry: DVec3::ZERO, direction: DVec3::NEG_Z, depth }
    }

    #[test]
    fn a_planned_path_takes_the_depth_alone() {
        let reach = Reach { free: None, ..free() };
        let now = upright(2e-3);
        let wanted = HandPose { entry: DVec3::X * 1e-3, direction: DVec3::new(0.6, 0.0, -0.8), depth: 2.1e-3 };
        let (pose, limited) = reach.within(&now, &wanted, FRAME);
        assert_eq!((pose.entry, pose.direction), (now.entry, now.direction));
        // Where the wanted tip is, seen along the path: 0.8 of 2.1 mm, faster than 10 mm/s.
        assert!(limited && (pose.depth - (2e-3 - 10e-3 * FRAME)).abs() < 1e-12);
        assert_eq!(reach.within(&now, &now, FRAME), (now, false));
        assert!(reach.within(&upright(9e-3), &upright(1.0), FRAME).0.depth <= 9e-3);
    }

    #[test]
    fn tilts_are_walked_off_at_a_bounded_rate_and_end_where_they_were_wanted() {
        let reach = free();
        let wanted = HandPose { direction: DVec3::new(0.5, 0.2, -0.8).normalize(), ..upright(4e-3) };
        let (mut now, mut frames) = (upright(4e-3), 0);
        while now != wanted {
            let (next, limited) = reach.within(&now, &wanted, FRAME);
            assert_eq!(limited, next != wanted);
            assert!((next.depth - 4e-3).abs() < 1e-15 && next.entry == DVec3::ZERO);
            let tip = |p: &HandPose| p.entry + p.direction * p.depth;
            assert!((tip(&next) - tip(&now)).length() <= reach.speed * FRAME * (1.0 + 1e-9));
            assert!(next.direction.angle_between(now.direction) <= TURNING * FRAME * (1.0 + 1e-6));
            (now, frames) = (next, frames + 1);
            assert!(frames < 100);
        }
        assert!(frames >= 33, "{frames}");
    }

    #[test]
    fn a_needle_as_flat_as_its_scene_wants_it_stays_so() {
        let flat = HandPose { direction: DVec3::new(0.99, 0.0, -(1.0f64 - 0.99 * 0.99).sqrt()), ..upright(1e-3) };
        let wanted = HandPose { depth: 1.1e-3, ..flat };
        assert_eq!(free().within(&flat, &wanted, FRAME), (wanted, false));
    }

    proptest! {
        /// Whatever is wanted, again and again, the needle stays a needle over the tissue.
        #[test]
        fn nothing_wanted_leads_out_of_reach(
            wanted in proptest::collection::vec(
                (-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64, -30e-3..30e-3f64, -30e-3..30e-3f64, -50e-3..50e-3f64), 1..40),
        ) {
            let reach = free();
            let bounds = reach.free.unwrap();
            let mut now = upright(0.0);
            for (x, y, z, ex, ey, depth) in wanted {
                let direction = DVec3::new(x, y, z).try_normalize().unwrap_or(DVec3::NEG_Z);
                let wanted = HandPose { entry: DVec3::new(ex, ey, 0.0), direction, depth };
                // Ten frames at once go farther.
                let (next, _) = reach.within(&now, &wanted, 10.0 * FRAME);
                prop_assert!((next.direction.length() - 1.0).abs() < 1e-9);
                prop_assert!(-next.direction.z >= STEEPEST.cos() - 1e-9);
                prop_assert!(next.entry.z == 0.0 && next.entry.truncate().cmple(bounds.high + 1e-12).all());
                prop_assert!(next.entry.truncate().cmpge(bounds.low - 1e-12).all());
                prop_assert!(next.depth >= -OUTSIDE - 1e-12);
                let tip = next.entry + next.direction * next.depth;
                // Half-way between two poses in reach a little more.
                prop_assert!(tip.z >= 1.2 * bounds.floor, "{tip}");
                now = next;
            }
        }
    }
}
