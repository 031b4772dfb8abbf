//! The straight path of a tool into a mesh of tetrahedra: where its line meets the surface, and whether it stays in the tissue.

use glam::DVec3;

use super::super::file::{MotionTable, SceneFile};
use super::{Check, MM, PATH_MARGIN};
use crate::effects::puncture::SchemeWord;
use crate::mesh::tet_path::{NoPath, TetPath};
use crate::mesh::{TetMesh, Tissue};
use crate::needle::tip_contact::DISC;
use crate::needle::{Motion, Phase, Tool, disc_lines, tip_lines};
use crate::scene::{FaceCondition, Target};
use crate::units::four_digits;

/// Steepest entry against the normal of the surface, as [`super::tool`] has it for a block [deg].
const MOST_GRAZING: f64 = 80.0;
/// Distance of the entry point from the surface that is told [m].
const TOLD: f64 = 0.5 * MM;
/// Radius of an indenter in edges of the mesh below which it is told that it may pass between nodes.
const NARROW: f64 = 2.0;
/// Largest coordinate of a point of a mesh [mm].
const FARTHEST: f64 = 10_000.0;

/// Where a straight motion begins, and where it leads.
pub(super) struct Entry {
    /// [m]
    pub entry: DVec3,
    /// Unit vector.
    pub direction: DVec3,
}

/// Lines around the axis of a tool that must lie in the tissue; in the scheme `opening` they lie farther from the axis than the needle is thick.
fn lines_of(tool: Option<&Tool>, direction: DVec3, scheme: SchemeWord) -> Vec<DVec3> {
    match (tool, scheme) {
        (Some(Tool::Needle(needle)), SchemeWord::Opening) => disc_lines(direction, needle.radius).collect(),
        (Some(Tool::Needle(needle)), SchemeWord::Ring) => tip_lines(direction, needle.radius, 0.0, true),
        _ => Vec::new(),
    }
}

/// Coordinates of a point for people [mm].
fn shown(x: DVec3) -> String {
    let mm = x / MM;
    format!("({:.3}, {:.3}, {:.3})", mm.x, mm.y, mm.z)
}

impl Check<'_> {
    /// Refuses on a block the keys of a motion that belong to a mesh.
    pub(super) fn keys_of_a_mesh(&mut self, table: &MotionTable) {
        for (key, written) in
            [("entry_point_mm", table.entry_point_mm.is_some()), ("target_point_mm", table.target_point_mm.is_some())]
        {
            if written {
                self.problems.report(
                    &format!("motion.{key}"),
                    format!("`{key}` is a point of a mesh, and the tissue of this scene is none"),
                    "no tissue.mesh in this scene",
                    "write entry_mm = [x, y], a point of the top face, and direction or angle_deg",
                );
            }
        }
    }

    /// Entry point and direction of a motion into a mesh; the entry point is brought onto the surface along the direction. Where the
    /// motion names a target point an insertion goes to it that says no depth.
    pub(super) fn mesh_entry(
        &mut self,
        table: &MotionTable,
        mesh: Option<&TetMesh>,
        tool: Option<&Tool>,
    ) -> Option<Entry> {
        if table.entry_mm.is_some() {
            self.problems.report(
                "motion.entry_mm",
                "`entry_mm` is a point of the top face of a block, and the tissue of this scene is a mesh",
                "two coordinates",
                "write entry_point_mm = [x, y, z], a point on the surface of the mesh or near it",
            );
            return None;
        }
        let Some(near) = table.entry_point_mm else {
            let (low, high) = mesh.map_or((DVec3::ZERO, DVec3::ZERO), TetMesh::bounds);
            self.problems.report(
                "motion",
                "the motion into a mesh has no entry point",
                "no motion.entry_point_mm",
                format!(
                    "add entry_point_mm = [x, y, z], a point on the surface of the mesh or near it; the mesh spans {} to {} mm",
                    shown(low),
                    shown(high)
                ),
            );
            return None;
        };
        let near = self.vector("motion.entry_point_mm", near, FARTHEST) * MM;
        let target = table.target_point_mm.map(|x| self.vector("motion.target_point_mm", x, FARTHEST) * MM);
        let direction = match target {
            None => self.any_direction(table),
            Some(target) => {
                for (key, written) in
                    [("direction", table.direction.is_some()), ("angle_deg", table.angle_deg.is_some())]
                {
                    if written {
                        self.problems.report(
                            &format!("motion.{key}"),
                            "the motion has two directions: this one, and that from its entry to its target point",
                            "two directions",
                            format!("remove {key} or target_point_mm"),
                        );
                    }
                }
                (target - near).normalize_or_zero()
            }
        };
        if direction == DVec3::ZERO {
            self.problems.report(
                "motion",
                "the direction of the motion has no length",
                "no direction",
                "write entry_point_mm and target_point_mm some millimetres apart, or a direction such as [0, 0, -1]",
            );
            return None;
        }
        let Some(mesh) = mesh else { return Some(Entry { entry: near, direction }) };
        let way = match TetPath::new(mesh, near, direction, &lines_of(tool, direction, SchemeWord::Ring)) {
            Ok(way) => way,
            Err(why) => {
                self.no_path(why, near, direction, mesh);
                return None;
            }
        };
        let entry = way.path.entry;
        if -way.path.normal.normalize().dot(direction) < MOST_GRAZING.to_radians().cos() {
            self.problems.report(
                "motion",
                format!(
                    "the needle grazes the surface at {} mm: it enters at more than {MOST_GRAZING} degrees",
                    shown(entry)
                ),
                "too flat an entry",
                "choose a direction that leads into the tissue, or another entry point",
            );
        }
        let apart = (entry - near).dot(direction);
        if apart.abs() > TOLD {
            let side = if apart > 0.0 { "behind" } else { "before" };
            self.notices.push(format!(
                "The needle meets the surface {} mm {side} the entry point, at {} mm; depths count from there.",
                four_digits(apart.abs() / MM),
                shown(entry)
            ));
        }
        if let Some(target) = target {
            let depth = (target - entry).dot(direction);
            if depth <= 0.0 {
                self.problems.report(
                    "motion.target_point_mm",
                    format!("the target point {} mm lies before the surface at {} mm", shown(target), shown(entry)),
                    "not in the tissue",
                    "choose a target inside the mesh; entry and target may be mixed up",
                );
            }
            self.path = Some(depth);
        }
        Some(Entry { entry, direction })
    }

    /// The direction of a motion into a mesh, which may be any; straight down where it states none.
    fn any_direction(&mut self, table: &MotionTable) -> DVec3 {
        match (table.direction, table.angle_deg) {
            (Some(vector), None) => self.vector("motion.direction", vector, 1e6).normalize_or_zero(),
            _ => self.direction(table),
        }
    }

    fn no_path(&mut self, why: NoPath, near: DVec3, direction: DVec3, mesh: &TetMesh) {
        let (low, high) = mesh.bounds();
        let (message, label) = match why {
            NoPath::Missed => (
                format!(
                    "the line through {} mm along ({:.3}, {:.3}, {:.3}) meets no tissue",
                    shown(near),
                    direction.x,
                    direction.y,
                    direction.z
                ),
                "beside the mesh",
            ),
            NoPath::AtTheRim => (
                format!(
                    "around the line through {} mm the surface is narrower or more bent than the needle is thick, or the needle grazes it",
                    shown(near)
                ),
                "at the rim of the mesh",
            ),
        };
        self.problems.report(
            "motion.entry_point_mm",
            message,
            label,
            format!("choose another entry point or direction; the mesh spans {} to {} mm", shown(low), shown(high)),
        );
    }

    /// A motion in a mesh is straight, and its needle solid; asked of a scene with a mesh.
    pub(super) fn straight_in_a_mesh(
        &mut self,
        file: &SceneFile,
        tool: Option<&Tool>,
        motion: &Motion,
        always_free: bool,
    ) {
        if file.tissue.mesh.is_none() {
            return;
        }
        let free = |phase: &Phase| matches!(phase, Phase::Move { .. } | Phase::Turn { .. } | Phase::Reposition { .. });
        if let Some(index) = motion.phases.iter().position(free) {
            self.needs_block(&format!("motion.phase.{index}.kind"), "a motion that leaves one straight line");
        }
        if file.task.is_some() {
            self.needs_block("task", "the task of a trainee");
        }
        if always_free {
            self.needs_block("puncture.path", "a path that is found while the tip moves");
        }
        if matches!(tool, Some(Tool::Needle(needle)) if needle.bore.is_some()) {
            self.needs_block("needle.bore_diameter_mm", "a hollow needle");
        }
    }

    /// The path stays in the mesh, and loads find it.
    pub(super) fn geometry_of_mesh(
        &mut self,
        mesh: &TetMesh,
        tool: Option<&Tool>,
        (motion, scheme): (&Motion, SchemeWord),
        faces: &[FaceCondition; 6],
    ) {
        self.path_in_mesh(mesh, tool, motion, scheme);
        self.loads_on_mesh(faces, mesh);
    }

    /// The path stays in the mesh to its end, with room around it.
    fn path_in_mesh(&mut self, mesh: &TetMesh, tool: Option<&Tool>, motion: &Motion, scheme: SchemeWord) {
        if let Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. }) = tool {
            let (_, edge) = super::mesh::extent(mesh);
            if *radius < NARROW * edge {
                self.notices.push(format!(
                    "The tool is {} mm in radius and an edge of the mesh is {} mm long: it touches nodes alone and may pass between \
                     them; use a wider tool or a finer mesh.",
                    four_digits(radius / MM),
                    four_digits(edge / MM)
                ));
            }
        }
        let Some(Tool::Needle(needle)) = tool else { return };
        let lines = |scheme: SchemeWord| lines_of(tool, motion.direction, scheme);
        let Ok(way) = TetPath::new(mesh, motion.entry, motion.direction, &lines(SchemeWord::Ring)) else { return };
        if TetPath::new(mesh, motion.entry, motion.direction, &lines(scheme)).is_err() {
            self.problems.report(
                "motion.entry_point_mm",
                format!(
                    "the scheme opening presses on the surface within {} mm of the axis before the puncture, and there the surface is \
                     narrower or more bent than that at {} mm",
                    four_digits(DISC * needle.radius / MM),
                    shown(motion.entry)
                ),
                "at the rim of the mesh",
                "choose another entry point or direction, a thinner needle, or puncture.scheme = \"ring\"",
            );
        }
        let most = way.end().min(way.axis.end - PATH_MARGIN);
        let depth = |phase: &Phase| match *phase {
            Phase::Insert { depth, .. } => depth,
            _ => 0.0,
        };
        let Some(index) = motion.phases.iter().position(|phase| depth(phase) > most) else { return };
        self.problems.report(
            &format!("motion.phase.{index}.depth_mm"),
            format!(
                "the path leaves the tissue {:.3} mm below the surface at {} mm, and the needle goes {:.3} mm deep",
                way.end() / MM,
                shown(motion.entry),
                depth(&motion.phases[index]) / MM
            ),
            "too deep for this mesh",
            format!(
                "write depth_mm of at most {:.3}, or choose another entry point or direction",
                (most / MM * 1e3).floor() / 1e3
            ),
        );
    }

    /// Every target lies inside the mesh.
    pub(super) fn targets_in_mesh(&mut self, targets: &[Target], mesh: &TetMesh) {
        let (low, high) = mesh.bounds();
        for (index, target) in targets.iter().enumerate().filter(|(_, target)| mesh.locate(target.position).is_none()) {
            self.problems.report(
                &format!("target.{index}.position_mm"),
                format!("target `{}` at {} mm lies in no tetrahedron of the mesh", target.name, shown(target.position)),
                "no tissue here",
                format!("the mesh spans {} to {} mm; it may have holes", shown(low), shown(high)),
            );
        }
    }

    /// Every target lies inside the tissue.
    pub(super) fn targets_inside(&mut self, targets: &[Target], tissue: &Tissue, mesh: Option<&TetMesh>) {
        match mesh {
            Some(mesh) => self.targets_in_mesh(targets, mesh),
            None => self.inside(targets, tissue),
        }
    }
}
