//! `tissue.supports`: what holds the tissue, by words.

use glam::DVec3;

use super::super::file::{FaceKind, SceneFile, SupportWord, TissueTable};
use super::super::{Face, FaceCondition, Region, Support};
use super::{Check, MM, Within};
use crate::anatomy::Case;
use crate::mesh::{TetMesh, Tissue};
use crate::needle::Motion;
use crate::units::four_digits;

/// Distance from the path within which skin is free where the scene states none [m]: the dimple before a puncture is narrower.
const SKIN_FREE: f64 = 10.0 * MM;
/// Step in which skin is looked for beside the path, in parts of the block.
const LOOKS: i32 = 32;

/// What the scene has for the words to act on.
pub(super) struct Held<'a> {
    pub regions: &'a [Region],
    pub supports: &'a [Support],
    pub faces: &'a [FaceCondition; 6],
    pub motion: &'a Motion,
    pub tissue: &'a Tissue,
    pub mesh: Option<&'a TetMesh>,
    pub case: Option<&'a Case>,
}

impl Check<'_> {
    /// What the faces are where `[boundaries]` does not say it. The back is the side that the needle points at, of a block the bottom.
    pub(super) fn faces_by_words(&mut self, table: &TissueTable, motion: &Motion) -> [FaceKind; 6] {
        let of_mesh = table.mesh.is_some();
        let Some(words) = &table.supports else {
            return Face::ALL.map(|f| if of_mesh || f == Face::ZMax { FaceKind::Free } else { FaceKind::Fixed });
        };
        for (index, word) in words.iter().enumerate() {
            if words[..index].contains(word) {
                self.problems.report(
                    &format!("tissue.supports.{index}"),
                    format!("\"{}\" is listed twice", word.key()),
                    "it holds or it does not",
                    "remove one of the two",
                );
            }
        }
        let (axis, up) = if of_mesh && !motion.phases.is_empty() { main_axis(motion.direction) } else { (2, false) };
        Face::ALL.map(|face| {
            let held = match (face.axis() == axis, face.is_max() == up) {
                (true, true) => words.contains(&SupportWord::Back),
                (true, false) => false,
                (false, _) => words.contains(&SupportWord::Sides),
            };
            if held { FaceKind::Fixed } else { FaceKind::Free }
        })
    }

    /// Distance from the path beyond which skin is held [m]; `None`: all of it is free. Tells words that hold nothing.
    pub(super) fn skin_free(&mut self, file: &SceneFile, held: &Held) -> Option<f64> {
        let table = &file.tissue;
        let has = |word: SupportWord| table.supports.as_ref().is_some_and(|words| words.contains(&word));
        let rigid = held.regions.iter().find(|region| region.material.rigid);
        if let (Some(region), Some(_), false) = (rigid, &table.supports, has(SupportWord::Bones)) {
            self.problems.report(
                "tissue.supports",
                format!(
                    "region `{}` is rigid, and what is rigid stands still: nothing in a scene moves it",
                    region.name
                ),
                "without \"bones\"",
                "add \"bones\", or give the region a material instead of rigid = true, so that it goes with the tissue",
            );
        }
        if rigid.is_none() && has(SupportWord::Bones) {
            self.holds_nothing(
                table,
                SupportWord::Bones,
                "no region is rigid",
                "write rigid = true in the [[region]] of the bone",
            );
        }
        if !has(SupportWord::Skin) {
            if table.skin_free_mm.is_some() {
                self.notices.push("`tissue.skin_free_mm` has no effect without \"skin\" in tissue.supports.".into());
            }
            return None;
        }
        let free = self.optional("tissue.skin_free_mm", table.skin_free_mm, MM, SKIN_FREE, Within::Positive(1000.0));
        if held.motion.phases.is_empty() {
            self.holds_nothing(
                table,
                SupportWord::Skin,
                "there is no path that skin could be away from",
                "add a tool with its [motion], or hold faces under [boundaries]",
            );
        } else if self.problems.is_empty() && farthest_skin(held) <= free {
            let most = four_digits(farthest_skin(held) / MM);
            self.holds_nothing(
                table,
                SupportWord::Skin,
                &format!("no skin is farther than {} mm from the path", four_digits(free / MM)),
                &format!("write skin_free_mm below {most}, or enlarge the tissue with size_mm"),
            );
        }
        Some(free)
    }

    fn holds_nothing(&mut self, table: &TissueTable, word: SupportWord, why: &str, way_out: &str) {
        let at = table.supports.iter().flatten().position(|other| *other == word).unwrap_or(0);
        self.problems.report(
            &format!("tissue.supports.{at}"),
            format!("\"{}\" holds nothing: {why}", word.key()),
            "nothing to hold",
            format!("{way_out}; or remove the word"),
        );
    }

    /// Tells of a tissue that nothing holds.
    pub(super) fn floating(&mut self, table: &TissueTable, held: &Held, skin_free: Option<f64>) {
        let is_held = !held.supports.is_empty()
            || held.faces.iter().any(|face| face.fixed != [false; 3])
            || held.regions.iter().any(|region| region.material.rigid)
            || skin_free.is_some();
        if is_held {
            return;
        }
        if held.mesh.is_some() {
            self.notices.push(
                "Nothing holds the mesh, so it floats; add [[support]] with a node set, or fix a face of the \
                 bounding box, e.g. boundaries.z_min = \"fixed\"."
                    .into(),
            );
        } else if !held.motion.phases.is_empty() {
            self.notices.push(
                "No face of the block is fixed, so the tool pushes it away; set e.g. boundaries.z_min = \"fixed\"."
                    .into(),
            );
        } else if table.supports.is_some() {
            self.notices.push("Nothing holds the tissue, so it floats; write e.g. supports = [\"back\"].".into());
        }
    }
}

/// The axis that a direction follows most, and whether it goes up on it.
fn main_axis(direction: DVec3) -> (usize, bool) {
    let axis = (0..3).max_by(|a, b| direction[*a].abs().total_cmp(&direction[*b].abs())).unwrap_or(2);
    (axis, direction[axis] > 0.0)
}

/// Distance of the farthest skin from the path [m].
fn farthest_skin(held: &Held) -> f64 {
    let away = held.motion.distance_from_path();
    if let Some(mesh) = held.mesh {
        return mesh.skin(held.motion.entry).iter().map(|n| away(mesh.positions[*n as usize])).fold(0.0, f64::max);
    }
    let size = held.tissue.size;
    let place = |i: i32, size: f64| size * (f64::from(i) / f64::from(LOOKS) - 0.5);
    let skin = |x: f64, y: f64| match held.case {
        Some(case) => case.skin_over(x, y, -size.z..=held.tissue.top),
        None => Some(0.0),
    };
    let columns = (0..=LOOKS).flat_map(|i| (0..=LOOKS).map(move |j| (place(i, size.x), place(j, size.y))));
    columns.filter_map(|(x, y)| skin(x, y).map(|z| away(DVec3::new(x, y, z)))).fold(0.0, f64::max)
}
