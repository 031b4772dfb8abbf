//! Tissue from a file of tetrahedra: loading, supports, and what serves the block only.

use std::sync::Arc;

use glam::DVec3;

use super::super::Support;
use super::super::file::{SceneFile, TissueTable};
use super::Check;
use crate::Error;
use crate::mesh::TetMesh;
use crate::mesh::import::{self, ImportOptions, LengthUnit};

/// Size of the bounding box [m] and edge of the cells [m]: that of a regular tetrahedron of the mean volume,
/// `V = a^3/(6 sqrt 2)`.
pub fn extent(mesh: &TetMesh) -> (DVec3, f64) {
    let (low, high) = mesh.bounds();
    let volume: f64 = (0..mesh.tets.len()).map(|tet| mesh.volume(tet)).sum();
    (high - low, (6.0 * std::f64::consts::SQRT_2 * volume / mesh.tets.len() as f64).cbrt())
}

/// Names of node sets or regions for a way out, with their counts.
fn list<'a>(what: &str, counts: impl Iterator<Item = (&'a str, usize)>, unit: &str) -> String {
    let names: Vec<String> = counts.map(|(name, count)| format!("\"{name}\" ({count} {unit})")).collect();
    if names.is_empty() { format!("the mesh has no {what}") } else { format!("the mesh has {}", names.join(", ")) }
}

/// The regions of a mesh with their counts of cells.
pub fn list_tags(mesh: &TetMesh) -> String {
    let count = |tag: usize| mesh.tags.iter().filter(|t| **t as usize == tag).count();
    list("regions", mesh.regions.iter().enumerate().map(|(tag, name)| (name.as_str(), count(tag))), "cells")
}

/// Its node sets with their counts of nodes.
pub(super) fn list_sets(mesh: &TetMesh) -> String {
    let sets = mesh.node_sets.iter().map(|(name, nodes)| (name.as_str(), nodes.len()));
    list("node sets; name a group of faces or nodes in the mesh generator", sets, "nodes")
}

impl Check<'_> {
    /// Loads the mesh of a scene; `None` after a reported problem.
    pub(super) fn mesh(&mut self, name: &str, table: &TissueTable) -> Option<Arc<TetMesh>> {
        for (key, written) in [("size_mm", table.size_mm.is_some()), ("cell_size_mm", table.cell_size_mm.is_some())] {
            if written {
                self.problems.report(
                    &format!("tissue.{key}"),
                    format!("the tissue has a mesh and `{key}` of a block"),
                    "a mesh brings its own size and cells",
                    format!("remove {key}, or remove mesh to get a block"),
                );
                return None;
            }
        }
        for (key, written) in [
            ("fine_radius_mm", table.fine_radius_mm.is_some()),
            ("growth", table.growth.is_some()),
            ("axis_offset_cells", table.axis_offset_cells.is_some()),
        ] {
            if written {
                self.notices.push(format!("`tissue.{key}` has no effect on a mesh."));
            }
        }
        let unit = self.unit("mesh", "a mesh file", table)?;
        let placement = self.placement(table);
        let options = ImportOptions { unit, accept_size: table.accept_size.unwrap_or(false), placement };
        match import::read_with(&self.folder.join(name), options) {
            Ok(imported) => {
                self.notices.extend(imported.notices);
                self.tell_placement(&placement, Some(imported.mesh.bounds()));
                Some(Arc::new(imported.mesh))
            }
            Err(error) => {
                let (message, way_out) = match error {
                    Error::Input { message, way_out } => (message, way_out),
                    Error::File { path, source } => (
                        format!("cannot read the mesh {}: {source}", path.display()),
                        "write its path relative to the scene file, e.g. mesh = \"part.msh\"".into(),
                    ),
                    other => (other.to_string(), "write the mesh file again".into()),
                };
                self.problems.report("tissue.mesh", message, "this file", way_out);
                None
            }
        }
    }

    /// The unit of length of a file that does not say it, named under `tissue.<key>`.
    pub(super) fn unit(&mut self, key: &str, what: &str, table: &TissueTable) -> Option<LengthUnit> {
        let symbols: Vec<&str> = LengthUnit::ALL.into_iter().map(LengthUnit::symbol).collect();
        let Some(text) = table.unit.as_deref() else {
            self.problems.report(
                &format!("tissue.{key}"),
                format!("{what} does not say its unit of length"),
                "no tissue.unit beside it",
                format!("add unit = \"mm\", or one of {}", symbols.join(", ")),
            );
            return None;
        };
        let unit = text.parse::<LengthUnit>();
        if unit.is_err() {
            self.unknown_name("tissue.unit", "unit of length", text, &symbols);
        }
        unit.ok()
    }

    /// The held node sets. Without a mesh (or after it could not be read) names cannot be checked.
    pub(super) fn supports(&mut self, file: &SceneFile, mesh: Option<&TetMesh>) -> Vec<Support> {
        let mut supports = Vec::new();
        for (index, table) in file.support.iter().enumerate() {
            let at = |key: &str| format!("support.{index}.{key}");
            if file.tissue.mesh.is_none() {
                self.problems.report(
                    &at("set"),
                    "a support names a node set of a mesh, and the tissue is a block",
                    "no node sets in a block",
                    "hold faces of the block under [boundaries], e.g. z_min = \"fixed\", or give tissue.mesh",
                );
            } else if let Some(mesh) = mesh
                && !mesh.node_sets.contains_key(&table.set)
            {
                self.problems.report(
                    &at("set"),
                    format!("the mesh has no node set called \"{}\"", table.set),
                    "unknown set",
                    list_sets(mesh),
                );
            }
            if table.fixed.is_empty() {
                self.problems.report(
                    &at("fixed"),
                    format!("the support of \"{}\" holds nothing", table.set),
                    "empty list",
                    "write the held components, e.g. fixed = [\"x\", \"y\", \"z\"], or remove the support",
                );
            }
            let mut fixed = [false; 3];
            for axis in &table.fixed {
                fixed[*axis as usize] = true;
            }
            supports.push(Support { set: table.set.clone(), fixed });
        }
        supports
    }

    /// Refuses on a mesh what acts on the structured block only.
    pub(super) fn needs_block(&mut self, path: &str, what: &str) {
        self.problems.report(
            path,
            format!("{what} acts on the block only, and the tissue of this scene is a mesh"),
            "not on a mesh",
            "remove it, or write tissue.size_mm and tissue.cell_size_mm instead of tissue.mesh",
        );
    }
}
