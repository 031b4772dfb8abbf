//! Parts of the tissue with a material of their own: shapes, what they cover, and the tip forces of all materials.

use std::sync::Arc;

use glam::DVec3;

use super::super::file::*;
use super::super::tissue_preset::TissuePreset;
use super::super::{CELL_SAMPLES, Region, RegionShape, sample_points};
use super::mesh::list_tags;
use super::parameters::{all_materials, cutting, damage_limit, preset_cutting, written_cutting};
use super::{Check, MM, Within};
use crate::anatomy::Case;
use crate::effects::puncture::SchemeWord;
use crate::effects::{EffectSet, TissueMaterial};
use crate::material::ElasticLaw;
use crate::mesh::{BlockMesh, Mesh, TetMesh, Tissue};
use crate::needle::Tool;
use crate::units::four_digits;

/// Most regions of a scene: the shaders hold 16 materials, and one is the tissue's own.
const LARGEST_REGION_COUNT: usize = 15;

/// Thinnest membrane: four of the largest advances of the tip in a step [m].
const THINNEST_MEMBRANE: f64 = 0.05e-3;

/// Keys of the shapes.
const SHAPES: [&str; 6] = ["layer_mm", "box_mm", "sphere_mm", "cylinder_mm", "mesh_tag", "label"];

impl Check<'_> {
    /// The regions and the presets of their materials, one entry per table of the file.
    pub(super) fn regions(
        &mut self,
        file: &SceneFile,
        tissue: &Tissue,
        (mesh, case): (Option<&TetMesh>, Option<&Arc<Case>>),
    ) -> (Vec<Region>, Vec<Option<TissuePreset>>) {
        if file.region.len() > LARGEST_REGION_COUNT {
            self.problems.report(
                &format!("region.{LARGEST_REGION_COUNT}.name"),
                format!("the scene has {} regions", file.region.len()),
                "too many: the GPU holds 16 materials, the tissue's own and 15 of regions",
                format!(
                    "keep at most {LARGEST_REGION_COUNT} regions; join those of one material where a shape allows it"
                ),
            );
        }
        let mut presets = Vec::new();
        let mut regions = Vec::new();
        for (index, table) in file.region.iter().enumerate() {
            let at = format!("region.{index}");
            if table.name.trim().is_empty() || file.region[..index].iter().any(|other| other.name == table.name) {
                self.problems.report(
                    &format!("{at}.name"),
                    format!("the name \"{}\" is empty or taken", table.name),
                    "no name of its own",
                    "write a name that no other region has",
                );
            }
            let shape = self.region_shape(&at, table, file.tissue.mesh.is_some(), (mesh, case));
            let (material, preset) = match table.rigid {
                true => (self.rigid(&at, table), None),
                false if table.material == MaterialTable::default() => {
                    self.problems.report(
                        &at,
                        format!("region `{}` has no material", table.name),
                        "neither material nor rigid",
                        "write material = { preset = \"fat\" }, or rigid = true for bone",
                    );
                    (self.rigid(&at, table), None)
                }
                false => self.material(&format!("{at}.material"), &table.material, tissue.cell_size),
            };
            self.own_tables(&format!("{at}."), table.own_tables());
            presets.push(preset);
            regions.push(Region { name: table.name.clone(), shape, material });
        }
        (regions, presets)
    }

    /// What does not deform.
    fn rigid(&mut self, at: &str, table: &RegionTable) -> TissueMaterial {
        if table.material != MaterialTable::default() {
            self.notices.push(format!("`{at}.material` has no effect: what is rigid does not deform."));
        }
        // The law of cortical bone, E 17 GPa, nu 0.3 [Rho1998]; no engine computes with it.
        const BONE: ElasticLaw = ElasticLaw::mooney_rivlin(2.29e9, 0.98e9, 14.2e9);
        TissueMaterial { rigid: true, ..TissueMaterial::new("rigid", "does not deform", BONE, 1900.0) }
    }

    /// The one shape of a region, in SI.
    fn region_shape(
        &mut self,
        at: &str,
        table: &RegionTable,
        of_mesh: bool,
        (mesh, case): (Option<&TetMesh>, Option<&Arc<Case>>),
    ) -> RegionShape {
        let path = |key: &str| format!("{at}.{key}");
        let written = [
            table.layer_mm.is_some(),
            table.box_mm.is_some(),
            table.sphere_mm.is_some(),
            table.cylinder_mm.is_some(),
            table.mesh_tag.is_some(),
            table.label.is_some(),
        ];
        let keys: Vec<&str> = SHAPES.into_iter().zip(written).filter_map(|(key, on)| on.then_some(key)).collect();
        if keys.len() != 1 {
            let (message, place) = match keys.get(1) {
                Some(second) => {
                    (format!("region `{}` has {} shapes: {}", table.name, keys.len(), keys.join(", ")), path(second))
                }
                None => (format!("region `{}` has no shape", table.name), at.to_string()),
            };
            self.problems.report(
                &place,
                message,
                "exactly one shape",
                "write one of layer_mm = [0, 2], box_mm = {low = [..], high = [..]}, \
                 sphere_mm = {centre = [..], radius = 3}, cylinder_mm = {from = [..], to = [..], radius = 1}, \
                 mesh_tag = \"skin\", label = 3",
            );
        }
        if let Some([top, bottom]) = table.layer_mm {
            for (index, value) in [top, bottom].into_iter().enumerate() {
                self.number(&format!("{at}.layer_mm.{index}"), value, Within::Between(-1000.0, 1000.0));
            }
            if top >= bottom {
                self.problems.report(
                    &path("layer_mm"),
                    format!("the layer begins at depth {top} mm and ends at {bottom} mm"),
                    "the first depth must be the smaller one",
                    "write [top, bottom] as depths below z = 0, e.g. layer_mm = [0, 2]",
                );
            }
            return RegionShape::Layer { top: top * MM, bottom: bottom * MM };
        }
        if let Some(BoxTable { low, high }) = table.box_mm {
            let low = self.vector(&path("box_mm.low"), low, 1000.0);
            let high = self.vector(&path("box_mm.high"), high, 1000.0);
            if !low.cmplt(high).all() {
                self.problems.report(
                    &path("box_mm"),
                    "a component of `low` is not below that of `high`",
                    "empty box",
                    "write the lowest and the highest corner, e.g. {low = [-2, -2, -6], high = [2, 2, -3]}",
                );
            }
            return RegionShape::Box { low: low * MM, high: high * MM };
        }
        if let Some(SphereShapeTable { centre, radius }) = table.sphere_mm {
            let centre = self.vector(&path("sphere_mm.centre"), centre, 1000.0);
            let radius = self.number(&path("sphere_mm.radius"), radius, Within::Positive(1000.0));
            return RegionShape::Sphere { centre: centre * MM, radius: radius * MM };
        }
        if let Some(CylinderTable { from, to, radius }) = table.cylinder_mm {
            let from = self.vector(&path("cylinder_mm.from"), from, 1000.0);
            let to = self.vector(&path("cylinder_mm.to"), to, 1000.0);
            let radius = self.number(&path("cylinder_mm.radius"), radius, Within::Positive(1000.0));
            if from.distance(to) < 1e-6 {
                self.problems.report(
                    &path("cylinder_mm"),
                    "both ends of the cylinder are the same point",
                    "no length",
                    "write two points of the axis, e.g. {from = [3, -8, -6], to = [3, 8, -6], radius = 1}",
                );
            }
            return RegionShape::Cylinder { from: from * MM, to: to * MM, radius: radius * MM };
        }
        if let Some(entries) = &table.label {
            let Some(case) = case else {
                // Where the label map could not be read that has been told.
                if of_mesh || !self.has_labels {
                    self.problems.report(
                        &path("label"),
                        "labels name what lies in a label map",
                        "no tissue.labels in this scene",
                        "write a shape, e.g. layer_mm = [0, 2], or give tissue.labels",
                    );
                }
                return RegionShape::MeshTag(String::new());
            };
            let mut labels = self.labels_of(&path("label"), entries.list(), &case.map);
            labels.sort_unstable();
            labels.dedup();
            return RegionShape::Labels { labels, case: case.clone() };
        }
        let tag = table.mesh_tag.clone().unwrap_or_default();
        if table.mesh_tag.is_some() {
            if !of_mesh {
                self.problems.report(
                    &path("mesh_tag"),
                    "a block has no tags; they name regions of a mesh file",
                    "no tissue.mesh in this scene",
                    "write a shape, e.g. layer_mm = [0, 2], or give tissue.mesh",
                );
            } else if let Some(mesh) = mesh
                && !mesh.regions.contains(&tag)
            {
                self.problems.report(
                    &path("mesh_tag"),
                    format!("the mesh has no region called \"{tag}\""),
                    "unknown tag",
                    list_tags(mesh),
                );
            }
        }
        RegionShape::MeshTag(tag)
    }

    /// Every shape reaches into the tissue.
    pub(super) fn overlaps(&mut self, regions: &[Region], tissue: &Tissue, mesh: Option<&TetMesh>) {
        let half = tissue.size * 0.5;
        let block = (DVec3::new(-half.x, -half.y, -tissue.size.z), DVec3::new(half.x, half.y, tissue.top));
        let (low, high) = mesh.map_or(block, TetMesh::bounds);
        for (index, region) in regions.iter().enumerate() {
            let (from, to) = match bounds(&region.shape) {
                Some(bounds) => bounds,
                None => continue,
            };
            if from.cmplt(high).all() && to.cmpgt(low).all() {
                continue;
            }
            let show = |p: DVec3| format!("({:.3}, {:.3}, {:.3})", p.x / MM, p.y / MM, p.z / MM);
            self.problems.report(
                &format!("region.{index}"),
                format!("region `{}` lies outside the tissue", region.name),
                "covers nothing",
                format!(
                    "the tissue spans {} to {} mm; z points up and is 0 at the top of a block",
                    show(low),
                    show(high)
                ),
            );
        }
    }

    /// What the regions cover, and whether coarse cells away from the path resolve the damage.
    pub(super) fn cells(
        &mut self,
        mesh: &Mesh,
        own: &TissueMaterial,
        regions: &[Region],
        tissue: &Tissue,
        effects: &EffectSet,
    ) {
        let materials: Vec<(Option<usize>, &TissueMaterial)> = all_materials(own, regions).collect();
        let mut count = vec![0usize; materials.len()];
        let mut largest = vec![0.0f64; materials.len()];
        for cell in 0..mesh.cell_count() {
            let centre = mesh.cell_centre(cell);
            let holds = |region: &Region| match (&region.shape, mesh) {
                (RegionShape::MeshTag(tag), Mesh::Tets(tets)) => tets.regions[tets.tags[cell] as usize] == *tag,
                (shape, _) => shape.contains(centre),
            };
            let material = regions.iter().rposition(holds).map_or(0, |region| region + 1);
            count[material] += 1;
            largest[material] = largest[material].max(mesh.cell_volume(cell).cbrt());
        }
        for (index, region) in regions.iter().enumerate() {
            // What has a label may lie elsewhere in the patient, and what is thin has its part of the cells.
            if matches!(region.shape, RegionShape::Labels { .. }) {
                continue;
            }
            let is_in_cells =
                count[index + 1] > 0 || mesh.as_block().is_some_and(|b| has_part_of_cells(b, regions, index));
            let no_line = mesh
                .as_block()
                .and_then(|block| region.shape.layer_faces()?.into_iter().find(|face| !block.has_line(2, *face)));
            match (no_line, thickness(&region.shape)) {
                _ if !is_in_cells => self.notices.push(format!(
                    "Region `{}` holds {} (too thin, or covered by a later region): only its tip forces act.",
                    region.name,
                    if mesh.as_block().is_some() { "no sampled point of a cell" } else { "the centre of no cell" }
                )),
                // Too close to another face for a line of its own.
                (Some(face), _) => self.notices.push(format!(
                    "The face of region `{}` {} mm below the top lies within cells of {} mm, too close to another for a \
                     grid line: cells there are a mixture.",
                    region.name,
                    four_digits(-face / MM),
                    four_digits(tissue.cell_size / MM)
                )),
                _ if mesh.as_block().is_some() && region.shape.layer_faces().is_some() => {}
                (_, Some(thickness)) if thickness < tissue.cell_size * (1.0 - 1e-9) => self.notices.push(format!(
                    "Region `{}` is {} mm thick, less than one cell of {} mm: {}.",
                    region.name,
                    four_digits(thickness / MM),
                    four_digits(tissue.cell_size / MM),
                    if mesh.as_block().is_some() { "its cells are a mixture" } else { "it is as thick as whole cells are" }
                )),
                _ => {}
            }
        }
        if effects.plasticity.is_none() || effects.damage.is_none() {
            return;
        }
        for (slot, (index, material)) in materials.into_iter().enumerate() {
            let limit = damage_limit(material, effects);
            if largest[slot] > limit {
                self.notices.push(format!(
                    "The largest cells {} have an edge of {} mm, above {} mm their softening branch snaps back: damage \
                     that reaches them depends on the mesh.",
                    index.map_or("of the tissue".into(), |i| format!("of region `{}`", regions[i].name)),
                    four_digits(largest[slot] / MM),
                    four_digits(limit / MM)
                ));
            }
        }
    }

    /// Puncture energy of a membrane [J]: as written, or a slit as wide as the needle through its thickness.
    fn membrane(
        &mut self,
        index: usize,
        table: &MembraneTable,
        shape: &RegionShape,
        diameter: Option<f64>,
    ) -> Option<f64> {
        let at = |key: &str| format!("region.{index}.membrane.{key}");
        let RegionShape::Layer { top, bottom } = shape else {
            self.problems.report(
                &format!("region.{index}.membrane"),
                "only a layer can be a membrane",
                "this region is no layer",
                "give the region layer_mm = [top, bottom], or write puncture_force_n instead of membrane",
            );
            return None;
        };
        if bottom - top < THINNEST_MEMBRANE {
            self.problems.report(
                &format!("region.{index}.layer_mm"),
                format!(
                    "a membrane of {} mm is thinner than a few advances of the tip",
                    four_digits((bottom - top) / MM)
                ),
                format!("must be {} mm thick at least", THINNEST_MEMBRANE / MM),
                "write a thicker layer; its puncture energy stays as written",
            );
        }
        match (table.puncture_energy_mj, table.toughness_j_m2) {
            (Some(energy), None) => {
                Some(self.number(&at("puncture_energy_mj"), energy, Within::Positive(100.0)) * 1e-3)
            }
            (None, Some(toughness)) => {
                let toughness = self.number(&at("toughness_j_m2"), toughness, Within::Positive(1e6));
                diameter.map(|diameter| toughness * diameter * (bottom - top))
            }
            (energy, _) => {
                self.problems.report(
                    &format!("region.{index}.membrane"),
                    format!("the membrane has {} energies", if energy.is_some() { "two" } else { "no" }),
                    "exactly one of puncture_energy_mj and toughness_j_m2",
                    "write e.g. membrane = { puncture_energy_mj = 0.1 }",
                );
                None
            }
        }
    }

    /// Tip forces of all materials.
    pub(super) fn cuttings(
        &mut self,
        file: &SceneFile,
        tool: &Option<Tool>,
        effects: &EffectSet,
        (own, own_preset): (&mut TissueMaterial, Option<TissuePreset>),
        (regions, presets): (&mut [Region], Vec<Option<TissuePreset>>),
    ) {
        let diameter = match tool {
            Some(Tool::Needle(needle)) => Some(2.0 * needle.radius),
            _ => None,
        };
        let scene = effects.puncture.unwrap_or_default();
        let none = CuttingTable::default();
        // The scheme opening derives what nobody writes, also what a preset would propose.
        let derived = scene.scheme == SchemeWord::Opening;
        let proposed = |preset: Option<&TissuePreset>| if derived { none } else { preset_cutting(preset) };
        let written = written_cutting(&file.material);
        self.cutting_table("material", &written);
        let in_puncture =
            file.puncture.as_ref().is_some_and(|t| t.puncture_force_n.is_some() || t.cutting_force_n.is_some());
        if written != none && in_puncture {
            self.notices
                .push("The tip forces of [material] replace those of [puncture] in the tissue's own material.".into());
        }
        let mut any = written != none;
        own.cutting = if written != none {
            cutting(&written, diameter, &scene)
        } else if in_puncture {
            // What the scene writes counts more than what a preset proposes.
            None
        } else {
            cutting(&proposed(own_preset.as_ref()), diameter, &scene)
        };
        for (index, (region, table)) in regions.iter_mut().zip(&file.region).enumerate() {
            let beside = CuttingTable {
                puncture_force_n: table.puncture_force_n,
                cutting_force_n: table.cutting_force_n,
                cutting_energy_j_m2: table.cutting_energy_j_m2,
            };
            let inside = written_cutting(&table.material);
            self.cutting_table(&format!("region.{index}"), &beside);
            self.cutting_table(&format!("region.{index}.material"), &inside);
            if beside != none && inside != none {
                self.problems.report(
                    &format!("region.{index}.material"),
                    format!("region `{}` states its tip forces twice: beside `material` and inside it", region.name),
                    "second of two",
                    "keep one of them",
                );
            }
            let written = if beside != none { beside } else { inside };
            any |= written != none;
            let chosen = if written != none { written } else { proposed(presets[index].as_ref()) };
            region.material.cutting = cutting(&chosen, diameter, &scene);
            if let Some(membrane) = &table.membrane {
                any = true;
                if table.puncture_force_n.or(table.material.puncture_force_n).is_some() {
                    self.problems.report(
                        &format!("region.{index}.membrane"),
                        format!("region `{}` states a puncture force and the energy of a membrane", region.name),
                        "both say how hard it is to puncture",
                        "keep puncture_force_n or membrane; cutting_force_n may stand beside either",
                    );
                }
                region.material.membrane_energy = self.membrane(index, membrane, &region.shape, diameter);
            }
        }
        if any && effects.puncture.is_none() {
            self.notices
                .push("Tip forces of materials have no effect: `puncture` is not in the list `effects`.".into());
        }
    }
}

/// True where a region has a part of some cell: it is the last that holds a point at which the cell is sampled.
fn has_part_of_cells(block: &BlockMesh, regions: &[Region], index: usize) -> bool {
    let shape = &regions[index].shape;
    (0..block.cell_count()).any(|cell| {
        let (low, size) = (block.rest_position(block.cell_nodes(cell)[0]), block.cell_size(cell));
        let is_last = |x| regions.iter().rposition(|region| region.shape.contains(x)) == Some(index);
        shape.may_cut(low, low + size) && sample_points(low, size, CELL_SAMPLES).any(is_last)
    })
}

/// Bounding box of a shape [m]; `None` for a tag.
fn bounds(shape: &RegionShape) -> Option<(DVec3, DVec3)> {
    Some(match shape {
        RegionShape::Layer { top, bottom } => {
            (DVec3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, -bottom), DVec3::new(f64::INFINITY, f64::INFINITY, -top))
        }
        RegionShape::Box { low, high } => (*low, *high),
        RegionShape::Sphere { centre, radius } => (*centre - *radius, *centre + *radius),
        RegionShape::Cylinder { from, to, radius } => {
            let axis = (*to - *from).normalize_or_zero();
            let reach = (DVec3::ONE - axis * axis).max(DVec3::ZERO).map(f64::sqrt) * *radius;
            (from.min(*to) - reach, from.max(*to) + reach)
        }
        RegionShape::MeshTag(_) | RegionShape::Labels { .. } => return None,
    })
}

/// Smallest extent of a shape [m]; `None` for a tag.
fn thickness(shape: &RegionShape) -> Option<f64> {
    match shape {
        RegionShape::Layer { top, bottom } => Some(bottom - top),
        RegionShape::Box { low, high } => Some((*high - *low).min_element()),
        RegionShape::Sphere { radius, .. } => Some(2.0 * radius),
        RegionShape::Cylinder { from, to, radius } => Some((2.0 * radius).min(from.distance(*to))),
        RegionShape::MeshTag(_) | RegionShape::Labels { .. } => None,
    }
}
