//! Where the targets of an insertion are: the motion of the tissue takes them along.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::FrameRecord;
use crate::model::Model;
use crate::needle::Kinematics;

/// A target at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct TargetRecord {
    /// How far it is from where it lay at rest [m].
    pub displacement: DVec3,
    /// The part of it along the tool, positive ahead, and the way from the tip to the target [m]; `None` without a tool.
    pub axial: Option<f64>,
    pub from_tip: Option<DVec3>,
}

impl TargetRecord {
    /// The targets that have moved by `displacements` [m] at the end of the frame of `record`.
    pub fn of(
        model: &Model,
        kinematics: Option<&Kinematics>,
        record: &FrameRecord,
        displacements: &[DVec3],
    ) -> Vec<TargetRecord> {
        if displacements.is_empty() {
            return Vec::new();
        }
        let pose = kinematics.map(|k| k.pose(record.time));
        // A flexible needle has its tip beside and behind that of a straight one.
        let tip = pose.map(|p| p.tip + record.needle.tip_offset - p.direction * record.needle.retreat);
        let targets = model.scene.targets.iter().zip(displacements);
        targets
            .map(|(target, displacement)| TargetRecord {
                displacement: *displacement,
                axial: pose.map(|p| displacement.dot(p.direction)),
                from_tip: tip.map(|tip| target.position + *displacement - tip),
            })
            .collect()
    }
}
