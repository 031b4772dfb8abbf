//! What is written, and when.

use super::super::Outputs;
use super::super::file::OutputsTable;
use super::{Check, KPA, MM, Within};
use crate::needle::Motion;

impl Check<'_> {
    /// Moments of pictures, field files and volumes, sorted; times stand beside depths in a scene with a tool.
    pub(super) fn outputs(
        &mut self,
        table: &OutputsTable,
        motion: &Motion,
        has_tool: bool,
        duration: Option<f64>,
    ) -> Outputs {
        let lists = [
            ("pictures_at_depth_mm", &table.pictures_at_depth_mm, true),
            ("fields_at_depth_mm", &table.fields_at_depth_mm, true),
            ("volumes_at_depth_mm", &table.volumes_at_depth_mm, true),
            ("pictures_at_s", &table.pictures_at_s, false),
            ("fields_at_s", &table.fields_at_s, false),
            ("volumes_at_s", &table.volumes_at_s, false),
        ];
        const KINDS: usize = 3;
        let mut values = [const { Vec::new() }; 2 * KINDS];
        for (slot, (key, list, by_depth)) in lists.into_iter().enumerate() {
            let Some(list) = list else { continue };
            let path = format!("outputs.{key}");
            if slot % KINDS == 2 && !self.has_labels {
                self.problems.report(
                    &path,
                    format!("the scene has no label map, so `{key}` has no patient to write volumes for"),
                    "needs tissue.labels",
                    "give tissue.labels, or write fields (VTU files) with fields_at_depth_mm or fields_at_s instead",
                );
                continue;
            }
            let by_time_too = has_tool && motion.is_free();
            if by_depth != has_tool && (by_depth || !by_time_too) {
                let (has, other) = if has_tool { ("a tool", "depth_mm") } else { ("no tool", "s") };
                let stem = key.trim_end_matches("_depth_mm").trim_end_matches("_s");
                self.problems.report(
                    &path,
                    format!("the scene has {has}, so `{key}` means nothing"),
                    "wrong list for this scene",
                    format!("write {stem}_{other} instead"),
                );
                continue;
            }
            let (unit, reach) =
                if by_depth { (MM, motion.deepest()) } else { (1.0, duration.unwrap_or(f64::INFINITY)) };
            for (index, value) in list.iter().enumerate() {
                let value = self.number(&format!("{path}.{index}"), *value, Within::NotNegative(3600.0)) * unit;
                if value > reach * (1.0 + 1e-9) {
                    self.notices.push(format!("`{path}` holds {}, which the run never reaches.", value / unit));
                }
                // In a scene with a tool times stand beside depths, elsewhere in their place.
                values[if has_tool { slot } else { slot % KINDS }].push(value);
            }
        }
        for list in &mut values {
            list.sort_by(f64::total_cmp);
            list.dedup();
        }
        let [pictures_at, fields_at, volumes_at, pictures_at_time, fields_at_time, volumes_at_time] = values;
        let stride = table.volume_stride.unwrap_or(1);
        self.number("outputs.volume_stride", stride as f64, Within::Between(1.0, 16.0));
        let width = table.picture_width_px.unwrap_or(900);
        self.number("outputs.picture_width_px", width as f64, Within::Between(64.0, 8192.0));
        Outputs {
            pictures_at,
            fields_at,
            pictures_at_time,
            fields_at_time,
            volumes_at,
            volumes_at_time,
            volume_stride: stride as usize,
            picture_width: width,
            stress_scale: table
                .stress_scale_kpa
                .map(|value| self.number("outputs.stress_scale_kpa", value, Within::Positive(1e6)) * KPA),
        }
    }
}
