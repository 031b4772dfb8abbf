//! `[tissue.transform]`: where a file of tissue is put.

use glam::DVec3;

use super::super::file::TissueTable;
use super::{Check, MM};
use crate::mesh::Placement;
use crate::units::four_digits;

/// Largest coordinate of a way or an axis that is written [mm].
const FARTHEST: f64 = 1e5;

impl Check<'_> {
    /// How the file of the tissue is placed; as it is after a reported problem.
    pub(super) fn placement(&mut self, table: &TissueTable) -> Placement {
        let Some(transform) = &table.transform else { return Placement::NONE };
        let mut vector = |key: &str, value: Option<[f64; 3]>| {
            value.map(|value| self.vector(&format!("tissue.transform.{key}"), value, FARTHEST))
        };
        let axis = vector("axis", transform.axis);
        let shift = vector("translation_mm", transform.translation_mm).unwrap_or_default() * MM;
        match Placement::new(transform.scale.unwrap_or(1.0), axis, transform.angle_deg, shift) {
            Ok(placement) => placement,
            Err(wrong) => {
                self.problems.report(
                    &format!("tissue.transform.{}", wrong.key),
                    wrong.message,
                    "places nothing",
                    wrong.way_out,
                );
                Placement::NONE
            }
        }
    }

    /// Tells where a file came to lie: every other coordinate of the scene is one behind it.
    pub(super) fn tell_placement(&mut self, placement: &Placement, bounds: Option<(DVec3, DVec3)>) {
        if placement.is_none() {
            return;
        }
        let show = |x: DVec3| (x / MM).to_array().map(|x| (four_digits(x) + 0.0).to_string()).join(", ");
        let place = bounds.map_or(String::new(), |(low, high)| {
            format!(
                " It lies within ({}) to ({}) mm now, and entry, target and regions are places there.",
                show(low),
                show(high)
            )
        });
        self.notices.push(format!("The file of the tissue was {}.{place}", placement.text()));
    }

    /// A block is made where it is written.
    pub(super) fn no_placement(&mut self, table: &TissueTable) {
        if table.transform.is_some() {
            self.problems.report(
                "tissue.transform",
                "the tissue is a block, which no file places",
                "nothing to place",
                "remove it, or name a file: mesh, labels or surfaces",
            );
        }
    }
}
