//! Conditions of the six faces: what holds, moves or loads them.

use glam::DVec3;

use super::super::file::{BoundariesTable, FaceEntry, FaceKind, FaceTable};
use super::super::{Face, FaceCondition, FaceDrive};
use super::{Check, KPA, MM, Within};
use crate::mesh::TetMesh;
use crate::units::four_digits;

impl Check<'_> {
    /// Conditions of the six faces, those of a mesh on the sides of its bounding box; `by_words`: what they are unless written.
    pub(super) fn faces(&mut self, table: &BoundariesTable, by_words: [FaceKind; 6]) -> [FaceCondition; 6] {
        let entries = [&table.x_min, &table.x_max, &table.y_min, &table.y_max, &table.z_min, &table.z_max];
        let conditions = Face::ALL.map(|face| match entries[face as usize] {
            None => face_of_kind(face, by_words[face as usize]),
            Some(FaceEntry::Kind(kind)) => face_of_kind(face, *kind),
            Some(FaceEntry::Table(table)) => self.face(face, table),
        });
        self.one_ramp(&conditions);
        conditions
    }

    /// A load on a side of the bounding box of a mesh has triangles there that carry it.
    pub(super) fn loads_on_mesh(&mut self, conditions: &[FaceCondition; 6], mesh: &TetMesh) {
        let loaded = Face::ALL.into_iter().filter(|face| conditions[*face as usize].traction.is_some());
        for face in loaded.filter(|face| mesh.surface_on_side(face.axis(), face.is_max()).is_empty()) {
            self.problems.report(
                &format!("boundaries.{}.traction_kpa", face.key()),
                format!("no triangle of the mesh lies on the side {} of its bounding box", face.key()),
                "nothing to pull at",
                "load a side where the mesh is flat, e.g. the cut through an arm, or drive nodes with displacement_mm",
            );
        }
    }

    /// One factor scales the loads of a run: they grow together.
    fn one_ramp(&mut self, conditions: &[FaceCondition; 6]) {
        let mut loaded = Face::ALL.into_iter().filter(|face| conditions[*face as usize].traction.is_some());
        let ramp = |face: Face| conditions[face as usize].traction_ramp;
        let Some(first) = loaded.next() else { return };
        for other in loaded.filter(|other| ramp(*other) != ramp(first)) {
            let (one, two) = (four_digits(ramp(first)), four_digits(ramp(other)));
            self.problems.report(
                &format!("boundaries.{}.traction_ramp_s", other.key()),
                format!(
                    "the load of face {} grows over {two} s and that of face {} over {one} s",
                    other.key(),
                    first.key()
                ),
                "the loads of a scene grow together",
                format!("write the same traction_ramp_s for both faces, e.g. {one}"),
            );
        }
    }

    fn face(&mut self, face: Face, table: &FaceTable) -> FaceCondition {
        let at = |key: &str| format!("boundaries.{}.{key}", face.key());
        let mut condition = FaceCondition::default();
        for axis in &table.fixed {
            condition.fixed[*axis as usize] = true;
        }
        let displacement = table.displacement_mm.map(|value| self.vector(&at("displacement_mm"), value, 1000.0) * MM);
        let rotation = table
            .rotation_deg
            .map(|value| self.number(&at("rotation_deg"), value, Within::Between(-3600.0, 3600.0)).to_radians());
        condition.drive = self.drive(face, table, displacement, rotation);
        let names = ["x", "y", "z"];
        for axis in 0..3 {
            if displacement.is_some_and(|d| d[axis] != 0.0) && !condition.fixed[axis] {
                self.problems.report(
                    &at("displacement_mm"),
                    format!("face {} moves along {} but is not fixed along it", face.key(), names[axis]),
                    "a free component cannot be prescribed",
                    format!("add \"{}\" to `fixed`, or write 0 for this component", names[axis]),
                );
            }
            if rotation.is_some_and(|r| r != 0.0) && axis != face.axis() && !condition.fixed[axis] {
                self.problems.report(
                    &at("rotation_deg"),
                    format!("face {} turns but is not fixed along {}", face.key(), names[axis]),
                    "both tangential components must be fixed",
                    format!("add \"{}\" to `fixed`", names[axis]),
                );
            }
            if table.traction_kpa.is_some_and(|t| t[axis] != 0.0) && condition.fixed[axis] {
                self.problems.report(
                    &at("traction_kpa"),
                    format!("face {} is loaded along {} and fixed along it", face.key(), names[axis]),
                    "a fixed component carries no load",
                    format!("remove \"{}\" from `fixed`, or write 0 for this component", names[axis]),
                );
            }
        }
        condition.traction = table.traction_kpa.map(|value| self.vector(&at("traction_kpa"), value, 1e4) * KPA);
        condition.traction_ramp =
            self.optional(&at("traction_ramp_s"), table.traction_ramp_s, 1.0, 0.0, Within::NotNegative(3600.0));
        condition
    }

    /// The prescribed motion of a face: `displacement` [m], `rotation` [rad], and the time they take.
    fn drive(
        &mut self,
        face: Face,
        table: &FaceTable,
        displacement: Option<DVec3>,
        rotation: Option<f64>,
    ) -> Option<FaceDrive> {
        let at = |key: &str| format!("boundaries.{}.{key}", face.key());
        if displacement.is_none() && rotation.is_none() {
            for (key, written) in [
                ("duration_s", table.duration_s.is_some()),
                ("speed_mm_min", table.speed_mm_min.is_some()),
                ("cycles", table.cycles.is_some()),
            ] {
                if written {
                    self.notices.push(format!("`{}` has no effect without displacement_mm or rotation_deg.", at(key)));
                }
            }
            return None;
        }
        let cycles = table.cycles.unwrap_or(0);
        if table.cycles.is_some() {
            self.number(&at("cycles"), f64::from(cycles), Within::Between(1.0, 1e6));
        }
        let duration = match (table.duration_s, table.speed_mm_min) {
            (Some(_), Some(_)) => {
                self.problems.report(
                    &at("speed_mm_min"),
                    "`duration_s` and `speed_mm_min` both say how long the motion takes",
                    "second of two",
                    "keep one of them",
                );
                return None;
            }
            (Some(duration), None) => self.number(&at("duration_s"), duration, Within::Positive(3600.0)),
            (None, Some(speed)) => {
                let speed = self.number(&at("speed_mm_min"), speed, Within::Positive(1e5)) * MM / 60.0;
                let length = displacement.unwrap_or_default().length();
                if length == 0.0 || speed <= 0.0 {
                    self.problems.report(
                        &at("speed_mm_min"),
                        "a speed needs a displacement that is not zero",
                        "no length to divide by",
                        "write displacement_mm, or duration_s instead of the speed",
                    );
                    return None;
                }
                let duration = length / speed;
                if duration > 3600.0 {
                    self.problems.report(
                        &at("speed_mm_min"),
                        format!("the motion takes {} s, more than an hour", four_digits(duration)),
                        "too slow",
                        format!("write at least {}", four_digits(length / MM / 60.0)),
                    );
                }
                duration
            }
            (None, None) => {
                self.problems.report(
                    &at(if displacement.is_some() { "displacement_mm" } else { "rotation_deg" }),
                    format!("the motion of face {} has no duration", face.key()),
                    "no duration_s beside it",
                    "add duration_s, the time over which the motion grows, e.g. duration_s = 0.5, or speed_mm_min",
                );
                return None;
            }
        };
        Some(FaceDrive {
            displacement: displacement.unwrap_or_default(),
            rotation: rotation.unwrap_or(0.0),
            duration,
            cycles,
        })
    }
}

/// A face held as a whole, along its normal, or not at all.
fn face_of_kind(face: Face, kind: FaceKind) -> FaceCondition {
    FaceCondition {
        fixed: match kind {
            FaceKind::Free => [false; 3],
            FaceKind::Fixed => [true; 3],
            FaceKind::Roller => std::array::from_fn(|axis| axis == face.axis()),
        },
        ..FaceCondition::default()
    }
}
