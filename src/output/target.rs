//! `targets.csv`: where the targets of an insertion are, one row per display frame and target, and what the way in came to.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::curve::frames_on_the_way_in;
use crate::observables::quantity::Fold::{Largest, Last, Smallest};
use crate::observables::quantity::{Quantity, known, number, word};
use crate::observables::{FrameRecord, TargetRecord};
use crate::scene::Target;
use crate::units::{METRE, SECOND};

/// What a row of `targets.csv` is read off.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetRow {
    name: String,
    /// [s], [m]
    time: f64,
    depth: f64,
    target: TargetRecord,
}

impl TargetRow {
    /// The target `name` at the end of the frame of `record`.
    pub fn new(name: &str, record: &FrameRecord, target: &TargetRecord) -> Self {
        TargetRow { name: name.into(), time: record.time, depth: record.depth, target: *target }
    }
}

/// `targets.csv`. Time and depth are those of `force.csv`, the rest belongs to the end of the frame; the last two are empty without a
/// tool.
pub const TARGETS: [Quantity<TargetRow>; 9] = [
    number("time_s", SECOND, Last, "end of the frame", |r| r.time),
    number("depth_m", METRE, Last, "that of `force.csv`", |r| r.depth),
    word("target", "its name", |r| &r.name),
    number("displacement_x_m", METRE, Last, "displacement", |r| r.target.displacement.x),
    number("displacement_y_m", METRE, Last, "displacement", |r| r.target.displacement.y),
    number("displacement_z_m", METRE, Last, "displacement", |r| r.target.displacement.z),
    number("displacement_m", METRE, Largest, "length of the displacement", |r| r.target.displacement.length()),
    known("axial_displacement_m", METRE, Largest, "its part along the tool, positive ahead", |r| r.target.axial),
    known("tip_distance_m", METRE, Smallest, "distance from the tip", |r| r.target.from_tip.map(|way| way.length())),
];

/// One target on the way in: the frames deeper than every frame before them, all frames where the tool stands still or there
/// is none. Depths are those of the tool.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct TargetFigures {
    pub name: String,
    pub radius_m: f64,
    /// Largest distance from where it lay at rest, and the depth at which it had moved so far.
    pub largest_displacement_m: f64,
    pub largest_displacement_depth_m: f64,
    /// Smallest distance from the tip with its depth, and the distance at the end; `null` without a tool.
    pub smallest_tip_distance_m: Option<f64>,
    pub smallest_tip_distance_depth_m: Option<f64>,
    pub tip_distance_at_end_m: Option<f64>,
    /// Whether the smallest distance is within the radius.
    pub hit: Option<bool>,
}

impl TargetFigures {
    /// The targets of a scene in its order, from the records of a run; none before the first frame.
    pub fn of_run(targets: &[Target], records: &[FrameRecord]) -> Vec<TargetFigures> {
        let mut inward: Vec<&FrameRecord> = frames_on_the_way_in(records).collect();
        if inward.len() < 2 {
            inward = records.iter().collect();
        }
        targets.iter().enumerate().filter_map(|(index, target)| TargetFigures::of(target, index, &inward)).collect()
    }

    fn of(target: &Target, index: usize, frames: &[&FrameRecord]) -> Option<TargetFigures> {
        let seen: Vec<(&FrameRecord, TargetRecord)> =
            frames.iter().filter_map(|r| Some((*r, *r.targets.get(index)?))).collect();
        let moved = seen.iter().map(|(r, t)| (t.displacement.length(), r.depth));
        let largest = moved.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        let ways: Vec<(&FrameRecord, DVec3)> = seen.iter().filter_map(|(r, t)| Some((*r, t.from_tip?))).collect();
        let at_frames = ways.iter().map(|(r, way)| (way.length(), r.depth));
        // Within a frame tip and target move in a straight line: a fast needle gets closest between two frames.
        let between = ways.windows(2).filter(|pair| pair[0].0.frame + 1 == pair[1].0.frame).map(|pair| {
            let [(before, a), (after, b)] = [pair[0], pair[1]];
            let square = (b - a).length_squared();
            let part = if square > 0.0 { (-a.dot(b - a) / square).clamp(0.0, 1.0) } else { 0.0 };
            (a.lerp(b, part).length(), before.depth + part * (after.depth - before.depth))
        });
        let smallest = at_frames.chain(between).reduce(|a, b| if b.0 < a.0 { b } else { a });
        Some(TargetFigures {
            name: target.name.clone(),
            radius_m: target.radius,
            largest_displacement_m: largest.0,
            largest_displacement_depth_m: largest.1,
            smallest_tip_distance_m: smallest.map(|s| s.0),
            smallest_tip_distance_depth_m: smallest.map(|s| s.1),
            tip_distance_at_end_m: ways.last().map(|(_, way)| way.length()),
            hit: smallest.map(|s| s.0 <= target.radius),
        })
    }
}
