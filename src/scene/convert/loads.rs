//! `[[load]]`: tractions and pressures on named sets of a mesh.

use super::super::file::{LoadTable, SceneFile};
use super::super::{FaceCondition, LoadKind, SetLoad, Support};
use super::{Check, KPA, Within};
use crate::mesh::TetMesh;
use crate::units::four_digits;

/// Most loads of a scene.
const LARGEST_LOAD_COUNT: usize = 64;
/// Largest load that is written [kPa], as on faces.
const LARGEST_LOAD: f64 = 1e4;

impl Check<'_> {
    /// The loads of a scene. Without a mesh (or after it could not be read) names cannot be checked.
    pub(super) fn loads(
        &mut self,
        file: &SceneFile,
        mesh: Option<&TetMesh>,
        supports: &[Support],
        faces: &[FaceCondition; 6],
    ) -> Vec<SetLoad> {
        if file.load.len() > LARGEST_LOAD_COUNT {
            self.problems.report(
                &format!("load.{LARGEST_LOAD_COUNT}"),
                format!("the scene has {} loads", file.load.len()),
                "too many",
                format!("keep at most {LARGEST_LOAD_COUNT} loads; join their sets in the mesh generator"),
            );
        }
        if !file.load.is_empty() && file.tissue.mesh.is_none() {
            self.problems.report(
                "load.0",
                "a load acts on a set of a mesh, and the tissue is a block",
                "no sets in a block",
                "load faces of the block under [boundaries], e.g. z_max = { traction_kpa = [0, 0, -1] }, or give tissue.mesh",
            );
            return Vec::new();
        }
        let mut loads: Vec<SetLoad> = Vec::new();
        for (index, table) in file.load.iter().enumerate() {
            let Some(load) = self.load(index, table, mesh, supports) else { continue };
            // One factor scales the loads of a run: they grow together.
            let of_face = faces.iter().find(|face| face.traction.is_some()).map(|face| face.traction_ramp);
            if let Some(other) = of_face.or(loads.first().map(|first| first.ramp)).filter(|other| *other != load.ramp) {
                let (one, two) = (four_digits(other), four_digits(load.ramp));
                self.problems.report(
                    &format!("load.{index}.ramp_s"),
                    format!("this load grows over {two} s and another of the scene over {one} s"),
                    "the loads of a scene grow together",
                    format!(
                        "write ramp_s = {one} here, and the same in all loads and in traction_ramp_s of [boundaries]"
                    ),
                );
            }
            loads.push(load);
        }
        loads
    }

    fn load(
        &mut self,
        index: usize,
        table: &LoadTable,
        mesh: Option<&TetMesh>,
        supports: &[Support],
    ) -> Option<SetLoad> {
        let at = |key: &str| format!("load.{index}.{key}");
        let within = Within::Between(-LARGEST_LOAD, LARGEST_LOAD);
        let kind = match (table.traction_kpa, table.pressure_kpa) {
            (Some(traction), None) => {
                LoadKind::Traction(self.vector(&at("traction_kpa"), traction, LARGEST_LOAD) * KPA)
            }
            (None, Some(pressure)) => LoadKind::Pressure(self.number(&at("pressure_kpa"), pressure, within) * KPA),
            (traction, _) => {
                self.problems.report(
                    &format!("load.{index}"),
                    if traction.is_some() { "the load has a traction and a pressure" } else { "the load has no size" },
                    "exactly one of traction_kpa and pressure_kpa",
                    "write traction_kpa = [0, 0, 1], along the axes of the mesh, or pressure_kpa = 1, against its surface",
                );
                return None;
            }
        };
        let ramp = self.optional(&at("ramp_s"), table.ramp_s, 1.0, 0.0, Within::NotNegative(3600.0));
        let load = SetLoad { set: table.set.clone(), kind, ramp };
        if let Some(mesh) = mesh {
            self.load_carried(index, &load, mesh, supports);
        }
        Some(load)
    }

    /// A load has triangles that carry it, and not all of their nodes are held.
    fn load_carried(&mut self, index: usize, load: &SetLoad, mesh: &TetMesh, supports: &[Support]) {
        let at = format!("load.{index}.set");
        let Some(triangles) = mesh.surface_of(load.set.as_deref()) else {
            let name = load.set.as_deref().unwrap_or_default();
            self.problems.report(
                &at,
                format!("the mesh has no set called \"{name}\""),
                "unknown set",
                super::mesh::list_sets(mesh),
            );
            return;
        };
        if triangles.is_empty() {
            let name = load.set.as_deref().unwrap_or_default();
            self.problems.report(
                &at,
                format!("no triangle of the surface has all its nodes in the set \"{name}\""),
                "nothing to press at",
                "name a group of surface triangles in the mesh generator; a load needs an area",
            );
            return;
        }
        let is_held = |node: u32| {
            let of =
                |support: &Support| mesh.node_sets.get(&support.set).is_some_and(|s| s.binary_search(&node).is_ok());
            supports.iter().any(|support| support.fixed == [true; 3] && of(support))
        };
        if triangles.iter().flatten().all(|node| is_held(*node)) {
            self.problems.report(
                &at,
                "all nodes that the load acts on are held by a [[support]]",
                "nothing moves there",
                "load another set, or leave a component free: fixed = [\"x\", \"y\"]",
            );
        }
    }
}
