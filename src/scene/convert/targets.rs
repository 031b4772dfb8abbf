//! Points of the tissue that the insertion wants to reach.

use glam::DVec3;

use super::super::Target;
use super::super::file::{SceneFile, TargetTable};
use super::{Check, MM, Within};
use crate::anatomy::Case;
use crate::mesh::Tissue;

/// Most targets of a scene: what is read back after every frame stays small.
const LARGEST_TARGET_COUNT: usize = 64;

/// Radius where the scene names none [m].
const RADIUS: f64 = 1.0 * MM;

/// How far beyond a face of the block rounding may carry a target that lies on it [m].
const ROUNDING: f64 = 1e-9;

impl Check<'_> {
    /// The targets in SI; whether they lie inside the tissue is looked at by `inside`.
    pub(super) fn targets(&mut self, file: &SceneFile, case: Option<&Case>) -> Vec<Target> {
        if file.target.len() > LARGEST_TARGET_COUNT {
            self.problems.report(
                &format!("target.{LARGEST_TARGET_COUNT}"),
                format!("the scene has {} targets", file.target.len()),
                "too many",
                format!("keep at most {LARGEST_TARGET_COUNT} targets"),
            );
        }
        let mut targets: Vec<Target> = Vec::new();
        for (index, table) in file.target.iter().enumerate() {
            let at = |key: &str| format!("target.{index}.{key}");
            let name = table.name.clone().unwrap_or_else(|| format!("target {}", index + 1));
            if name.trim().is_empty() || targets.iter().any(|other| other.name == name) {
                self.problems.report(
                    &at("name"),
                    format!("the name \"{name}\" is empty or taken"),
                    "no name of its own",
                    "write a name that no other target has; without one it is \"target 1\", \"target 2\", ...",
                );
            }
            if name.chars().any(|c| matches!(c, ',' | '"' | '\'') || c.is_control()) {
                self.problems.report(
                    &at("name"),
                    format!("the name {name:?} holds a comma, a quote or a control character"),
                    "it stands in a column of targets.csv",
                    "write letters, digits, spaces and signs like - and _",
                );
            }
            targets.push(Target {
                name,
                position: self.target_position(index, table, case),
                radius: self.optional(&at("radius_mm"), table.radius_mm, MM, RADIUS, Within::Positive(1000.0)),
            });
        }
        targets
    }

    /// Where a target lies in the scene [m].
    fn target_position(&mut self, index: usize, table: &TargetTable, case: Option<&Case>) -> DVec3 {
        let at = |key: &str| format!("target.{index}.{key}");
        match (table.position_mm, table.position_ras_mm, case) {
            (Some(position), None, _) => self.vector(&at("position_mm"), position, 1000.0) * MM,
            (None, Some(position), Some(case)) => {
                case.frame.to_scene(self.vector(&at("position_ras_mm"), position, 10_000.0) * MM)
            }
            (None, Some(_), None) => {
                self.problems.report(
                    &at("position_ras_mm"),
                    "a place in a patient needs a label map",
                    "no tissue.labels in this scene",
                    "write position_mm in the coordinates of the block",
                );
                DVec3::ZERO
            }
            (position, _, _) => {
                self.problems.report(
                    &format!("target.{index}"),
                    if position.is_some() { "the target has two places" } else { "the target has no place" },
                    "exactly one of position_mm and position_ras_mm",
                    "write position_mm = [0, 0, -9]",
                );
                DVec3::ZERO
            }
        }
    }

    /// Every target lies inside the block.
    pub(super) fn inside(&mut self, targets: &[Target], tissue: &Tissue) {
        let half = tissue.size * 0.5;
        let (low, high) = (DVec3::new(-half.x, -half.y, -tissue.size.z), DVec3::new(half.x, half.y, tissue.top));
        for (index, target) in targets.iter().enumerate() {
            let x = target.position;
            if x.cmpge(low - ROUNDING).all() && x.cmple(high + ROUNDING).all() {
                continue;
            }
            let show = |p: DVec3| format!("({:.3}, {:.3}, {:.3})", p.x / MM, p.y / MM, p.z / MM);
            self.problems.report(
                &format!("target.{index}.position_mm"),
                format!("target `{}` at {} mm lies outside the tissue", target.name, show(x)),
                "no tissue here",
                format!(
                    "the tissue spans {} to {} mm; z points up and is 0 at the top of a block",
                    show(low),
                    show(high)
                ),
            );
        }
    }
}
