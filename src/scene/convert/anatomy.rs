//! Tissue from a label map: which way the block lies in the patient, how large it is, and the labels of regions.

use std::sync::Arc;

use glam::DVec3;

use super::super::file::{LabelEntry, MotionTable, SceneFile, TissueTable};
use super::{Check, MM, Within};
use crate::Error;
use crate::anatomy::{self, Case, Frame, LabelMap, markups, surface};
use crate::mesh::{Placement, Tissue};
use crate::units::four_digits;

/// Width of the block where the scene states none [m].
const WIDTH: f64 = 40.0 * MM;
/// Depth of the block over that of the path, where the scene states none.
const DEPTH_OVER_PATH: f64 = 1.5;
/// Least way from skin to target [m].
const SHORTEST_PATH: f64 = 0.5 * MM;
/// How far the block reaches above the entry point at most, where the skin around it is higher [m].
const HIGHEST_TOP: f64 = 40.0 * MM;
/// Edge of the voxels that closed surfaces are filled with, in cells.
const VOXELS_PER_CELL: f64 = 0.25;
/// Step in which that is looked for [m].
const TOP_STEP: f64 = 0.5 * MM;
/// Gaps in the tissue along the path that are shorter are passed over [m].
const SHORTEST_GAP: f64 = 0.3 * MM;
/// Largest coordinate in a patient [mm].
const FARTHEST: f64 = 10_000.0;

/// A label map in a scene, and how long the planned way into it is.
pub struct PlacedCase {
    pub case: Arc<Case>,
    /// From the skin to the target [m].
    pub path: Option<f64>,
}

impl Check<'_> {
    /// The label map of a scene; sets size and height of the block. `None` after a reported problem.
    pub(super) fn case(&mut self, file: &SceneFile, tissue: &mut Tissue) -> Option<PlacedCase> {
        let table = &file.tissue;
        let placement = self.placement(table);
        let mut map = match &table.labels {
            Some(name) => self.read_labels(name, table)?.placed(&placement),
            None => self.read_surfaces(table, &placement, tissue.cell_size)?,
        };
        self.tell_placement(&placement, map.bounds());
        if let Some(outside) = &table.outside {
            let labels = self.labels_of("tissue.outside", outside.list(), &map);
            map.labels.iter_mut().filter(|label| labels.contains(label)).for_each(|label| *label = 0);
        }
        if map.labels.iter().all(|label| *label == 0) {
            self.problems.report(
                if table.labels.is_some() { "tissue.labels" } else { "tissue.surfaces" },
                "there is no label but 0, which stands for nothing",
                "no tissue",
                "segment the tissue first; every voxel of it has a label",
            );
            return None;
        }
        let map = Arc::new(map);
        let placed = match file.motion.as_ref() {
            Some(motion) => self.on_a_path(map, motion, tissue)?,
            None => whole(map, tissue),
        };
        self.case_size(table, &placed, tissue);
        Some(placed)
    }

    fn read_labels(&mut self, name: &str, table: &TissueTable) -> Option<LabelMap> {
        for (key, written) in
            [("mesh", table.mesh.is_some()), ("unit", table.unit.is_some()), ("surfaces", !table.surfaces.is_empty())]
        {
            if written {
                self.problems.report(
                    &format!("tissue.{key}"),
                    format!("the tissue has labels and `{key}`"),
                    "a label map says its own unit, and it is all of the tissue",
                    format!("remove {key}, or remove labels"),
                );
                return None;
            }
        }
        match anatomy::read(&self.folder.join(name)) {
            Ok(read) => {
                self.notices.extend(read.notices);
                Some(read.map)
            }
            Err(error) => {
                self.unreadable_case("labels", error);
                None
            }
        }
    }

    /// Closed surfaces as a label map: voxels of a quarter of a cell, so that cells that a surface cuts are filled right.
    fn read_surfaces(&mut self, table: &TissueTable, placement: &Placement, cell_size: f64) -> Option<LabelMap> {
        if table.mesh.is_some() {
            self.problems.report(
                "tissue.mesh",
                "the tissue has surfaces and a mesh",
                "second of two",
                "remove one of them; a surface is filled with the cells of the block",
            );
            return None;
        }
        let unit = self.unit("surfaces", "a file of surfaces", table)?.to_metres(1.0);
        let mut surfaces = Vec::new();
        for (index, name) in table.surfaces.iter().enumerate() {
            match surface::read(&self.folder.join(name), unit) {
                Ok(read) => {
                    self.notices.extend(read.notices);
                    surfaces.extend(read.surfaces);
                }
                Err(error) => {
                    self.unreadable_case(&format!("surfaces.{index}"), error);
                    return None;
                }
            }
        }
        for surface in &mut surfaces {
            surface.points.iter_mut().for_each(|x| *x = placement.point(*x));
            self.notices.extend(surface::check::check(surface).notices);
        }
        match surface::voxels::label_map(&surfaces, VOXELS_PER_CELL * cell_size, cell_size) {
            Ok(voxels) => {
                self.notices.extend(voxels.notices);
                Some(voxels.map)
            }
            Err(error) => {
                self.unreadable_case("surfaces", error);
                None
            }
        }
    }

    fn unreadable_case(&mut self, key: &str, error: Error) {
        let (message, way_out) = match error {
            Error::Input { message, way_out } => (message, way_out),
            other => (other.to_string(), "write its path relative to the scene file".into()),
        };
        self.problems.report(&format!("tissue.{key}"), message, "this file", way_out);
    }

    /// Size of the block, and how far it reaches above the entry point.
    fn case_size(&mut self, table: &TissueTable, placed: &PlacedCase, tissue: &mut Tissue) {
        if let Some(size) = table.size_mm {
            for (index, size) in size.iter().enumerate() {
                self.number(&format!("tissue.size_mm.{index}"), *size, Within::Positive(1000.0));
            }
            tissue.size = DVec3::from(size) * MM;
        } else if let Some(path) = placed.path {
            tissue.size = DVec3::new(WIDTH, WIDTH, path * DEPTH_OVER_PATH);
        }
        let h = tissue.cell_size;
        if let (Some(_), true) = (placed.path, h > 0.0) {
            let top = highest_tissue(&placed.case, tissue.size);
            if top >= HIGHEST_TOP {
                self.notices.push(format!(
                    "Within the block the skin rises more than {} mm above the entry point; what is higher is left away.",
                    four_digits(HIGHEST_TOP / MM)
                ));
            }
            tissue.top = (top / h).ceil() * h;
        }
    }

    /// The block around a planned path: its frame, whose origin is where the path meets the skin.
    fn on_a_path(&mut self, map: Arc<LabelMap>, motion: &MotionTable, tissue: &mut Tissue) -> Option<PlacedCase> {
        let [entry, target] = self.planned_line(motion)?;
        for (key, written) in [
            ("entry_mm", motion.entry_mm.is_some()),
            ("direction", motion.direction.is_some()),
            ("angle_deg", motion.angle_deg.is_some()),
        ] {
            if written {
                self.problems.report(
                    &format!("motion.{key}"),
                    format!("`{key}` is one of a block, and this path is given in the patient"),
                    "two paths",
                    "remove it: the block is turned so that z runs against the needle",
                );
            }
        }
        let way = target - entry;
        if way.length() < SHORTEST_PATH {
            self.problems.report(
                "motion",
                format!("entry and target are {} mm apart", four_digits(way.length() / MM)),
                "no direction",
                format!("choose points at least {} mm apart", SHORTEST_PATH / MM),
            );
            return None;
        }
        let at_entry = Case::new(map.clone(), Frame::of_needle(entry, way));
        let Some(skin) = at_entry.skin_along(DVec3::ZERO, DVec3::NEG_Z) else {
            self.problems.report(
                "motion",
                format!("the line from ({}) to ({}) mm meets no tissue near its entry", shown(entry), shown(target)),
                "no skin on this line",
                format!(
                    "the labels lie within {}; are the points RAS, in mm? 3D Slicer shows them so",
                    extent_in_words(&Case::new(map, Frame::of_patient(DVec3::ZERO)))
                ),
            );
            return None;
        };
        let path = way.length() - skin;
        if path < SHORTEST_PATH {
            self.problems.report(
                "motion",
                format!("the skin lies {} mm behind the entry point, at or beyond the target", four_digits(skin / MM)),
                "the target is not in the tissue",
                "choose a target within the tissue; entry and target may be mixed up",
            );
            return None;
        }
        if skin.abs() > 0.5 * MM {
            let side = if skin > 0.0 { "behind" } else { "before" };
            self.notices.push(format!(
                "The path meets the skin {} mm {side} the entry point; depths count from there.",
                four_digits(skin.abs() / MM)
            ));
        }
        let frame = Frame { origin: entry + way.normalize() * skin, ..at_entry.frame };
        let case = Arc::new(Case::new(map, frame));
        let gap = first_gap(&case, path);
        if let Some(depth) = gap {
            self.problems.report(
                "motion",
                format!("the path leaves the tissue {} mm below the skin, before its target", four_digits(depth / MM)),
                "label 0 on the path",
                "choose another line, or give what lies there a label of its own",
            );
        }
        tissue.size = DVec3::new(WIDTH, WIDTH, path * DEPTH_OVER_PATH);
        Some(PlacedCase { case, path: Some(path) })
    }

    /// Entry and target in the patient, RAS [m].
    fn planned_line(&mut self, motion: &MotionTable) -> Option<[DVec3; 2]> {
        if let Some(name) = &motion.markups {
            if motion.entry_ras_mm.is_some() || motion.target_ras_mm.is_some() {
                self.problems.report(
                    "motion.markups",
                    "entry and target stand in the file and in the scene",
                    "second of two",
                    "keep either markups, or entry_ras_mm and target_ras_mm",
                );
            }
            return match markups::read(&self.folder.join(name)) {
                Ok(points) if points.len() >= 2 => Some([points[0].position, points[1].position]),
                Ok(points) => {
                    self.problems.report(
                        "motion.markups",
                        format!("{name} has {} points", points.len()),
                        "needs two: entry and target",
                        "place two points or a line in 3D Slicer, and save them again",
                    );
                    None
                }
                Err(error) => {
                    let (message, way_out) = match error {
                        Error::Input { message, way_out } => (message, way_out),
                        other => (other.to_string(), "write its path relative to the scene file".into()),
                    };
                    self.problems.report("motion.markups", message, "this file", way_out);
                    None
                }
            };
        }
        let mut point = |key: &str, value: Option<[f64; 3]>| {
            value.map(|value| self.vector(&format!("motion.{key}"), value, FARTHEST) * MM)
        };
        let points = (point("entry_ras_mm", motion.entry_ras_mm), point("target_ras_mm", motion.target_ras_mm));
        let (Some(entry), Some(target)) = points else {
            self.problems.report(
                "motion",
                "the motion has no line from an entry point to a target",
                "tissue.labels needs one",
                "add entry_ras_mm = [..] and target_ras_mm = [..] in mm, or markups = \"path.mrk.json\"",
            );
            return None;
        };
        Some([entry, target])
    }

    /// The labels that a region names, by number or by the name in the file.
    pub(super) fn labels_of(&mut self, at: &str, entries: &[LabelEntry], map: &LabelMap) -> Vec<u16> {
        let mut labels = Vec::new();
        for entry in entries {
            let found = match entry {
                LabelEntry::Number(number) => {
                    let label = u16::try_from(*number).ok().filter(|l| *l != 0);
                    label.filter(|label| map.labels.contains(label))
                }
                LabelEntry::Name(name) => {
                    let mut same = map.names.iter().filter(|(_, other)| other.eq_ignore_ascii_case(name));
                    same.next().map(|(label, _)| *label)
                }
            };
            match found {
                Some(label) => labels.push(label),
                None => self.problems.report(
                    at,
                    match entry {
                        LabelEntry::Number(number) => format!("the label map has no label {number}"),
                        LabelEntry::Name(name) => format!("the label map has no label called \"{name}\""),
                    },
                    "unknown label",
                    labels_in_words(map),
                ),
            }
        }
        labels
    }
}

/// The block around everything, along the axes of the patient: its top is that of the tissue.
fn whole(map: Arc<LabelMap>, tissue: &mut Tissue) -> PlacedCase {
    let seen = Case::new(map.clone(), Frame::of_patient(DVec3::ZERO));
    let (low, high) = seen.bounds().unwrap_or((DVec3::splat(-MM), DVec3::splat(MM)));
    let middle = 0.5 * (low + high);
    tissue.size = high - low;
    let case = Arc::new(Case::new(map, Frame::of_patient(DVec3::new(middle.x, middle.y, high.z))));
    PlacedCase { case, path: None }
}

/// Height of the tissue above the entry point within a block of this size [m]; 0 where none is higher.
fn highest_tissue(case: &Case, size: DVec3) -> f64 {
    let along = |size: f64| (size / TOP_STEP).ceil() as i64;
    let place = |i: i64, size: f64| -0.5 * size + size * i as f64 / along(size) as f64;
    let mut top = 0.0;
    for (i, j) in (0..=along(size.x)).flat_map(|i| (0..=along(size.y)).map(move |j| (i, j))) {
        let at = DVec3::new(place(i, size.x), place(j, size.y), 0.0);
        while top < HIGHEST_TOP && case.fill_at(at + DVec3::Z * (top + 0.5 * TOP_STEP)) >= 0.5 {
            top += TOP_STEP;
        }
    }
    top
}

/// Depth at which the vertical path through the origin leaves the tissue before it is `length` long [m].
fn first_gap(case: &Case, length: f64) -> Option<f64> {
    let step = 0.1 * MM;
    let mut gap = 0.0;
    for i in 1..(length / step) as usize {
        let depth = i as f64 * step;
        gap = if case.fill_at(DVec3::NEG_Z * depth) < 0.5 { gap + step } else { 0.0 };
        if gap >= SHORTEST_GAP {
            return Some(depth - gap);
        }
    }
    None
}

fn shown(x: DVec3) -> String {
    let mm = x / MM;
    format!("{:.1}, {:.1}, {:.1}", mm.x, mm.y, mm.z)
}

/// Where the labels of a case lie.
fn extent_in_words(case: &Case) -> String {
    match case.bounds() {
        Some((low, high)) => format!("({}) to ({}) mm RAS", shown(low), shown(high)),
        None => "no voxel".into(),
    }
}

/// The labels that there are.
fn labels_in_words(map: &LabelMap) -> String {
    const MOST: usize = 40;
    let volumes = map.volumes();
    let labels: Vec<String> = volumes
        .keys()
        .take(MOST)
        .map(|label| match map.names.get(label) {
            Some(name) => format!("{label} \"{name}\""),
            None => label.to_string(),
        })
        .collect();
    let more = if volumes.len() > MOST { ", ..." } else { "" };
    format!("it has {}{more}", labels.join(", "))
}
