//! The tool of a scene and its motion.

use glam::DVec3;

use super::super::file::*;
use super::super::{Motion, NeedleShape, Phase, TipShape, Tool, presets};
use super::{Check, MM, Within};
use crate::material::four_digits;

impl Check<'_> {
    pub(super) fn tool(&mut self, file: &SceneFile) -> Option<Tool> {
        let present: Vec<&str> = [
            ("needle", file.needle.is_some()),
            ("sphere", file.sphere.is_some()),
            ("flat_punch", file.flat_punch.is_some()),
        ]
        .into_iter()
        .filter_map(|(key, on)| on.then_some(key))
        .collect();
        if present.len() > 1 {
            self.problems.report(
                present[1],
                format!("the scene has {} tools: {}", present.len(), present.join(", ")),
                "second tool",
                "keep one of the tables",
            );
        }
        if let Some(table) = &file.needle {
            return Some(Tool::Needle(self.needle(table)));
        }
        if let Some(table) = &file.sphere {
            let radius = self.number("sphere.radius_mm", table.radius_mm, Within::Between(0.01, 1000.0)) * MM;
            return Some(Tool::Sphere { radius });
        }
        file.flat_punch.as_ref().map(|table| Tool::FlatPunch {
            radius: self.number("flat_punch.radius_mm", table.radius_mm, Within::Between(0.01, 1000.0)) * MM,
            bonded: table.bonded,
        })
    }

    fn needle(&mut self, table: &NeedleTable) -> NeedleShape {
        let (mut name, mut diameter) = (String::new(), MM);
        match (&table.gauge, table.outer_diameter_mm) {
            (Some(gauge), None) => match presets::needle(gauge) {
                Some(preset) => (name, diameter) = (preset.gauge.clone(), preset.outer_diameter),
                None => {
                    let names: Vec<&str> = presets::needles().iter().map(|p| p.gauge.as_str()).collect();
                    self.unknown_name("needle.gauge", "needle gauge", gauge, &names);
                }
            },
            (None, Some(outer)) => {
                diameter = self.number("needle.outer_diameter_mm", outer, Within::Between(0.05, 20.0)) * MM;
                name = format!("{outer} mm");
            }
            (gauge, _) => self.problems.report(
                "needle",
                if gauge.is_some() { "the needle has two diameters" } else { "the needle has no diameter" },
                "exactly one of gauge and outer_diameter_mm",
                "write gauge = \"16G\" or outer_diameter_mm = 1.65",
            ),
        }
        let radius = 0.5 * diameter;
        let (tip, tip_length) = self.needle_tip(table, radius);
        let length = self.optional("needle.length_mm", table.length_mm, MM, 100.0 * MM, Within::Between(1.0, 1000.0));
        let steel = presets::needle_material("steel-304").map_or(7.93e3, |m| m.density);
        let (material, density) = match &table.material {
            None => ("steel-304".to_string(), steel),
            Some(NeedleMaterialEntry::Preset(name)) => {
                let found = presets::needle_material(name);
                if found.is_none() {
                    let names: Vec<&str> = presets::needle_materials().iter().map(|m| m.name.as_str()).collect();
                    self.unknown_name("needle.material", "needle material", name, &names);
                }
                (name.clone(), found.map_or(steel, |m| m.density))
            }
            Some(NeedleMaterialEntry::Table(table)) => ("constants".to_string(), self.needle_material(table)),
        };
        NeedleShape { name, radius, tip_length, tip, material, length, density }
    }

    /// Shape and length of the tip.
    fn needle_tip(&mut self, table: &NeedleTable, radius: f64) -> (TipShape, f64) {
        if table.bevel_heading_deg.is_some() && table.bevel_angle_deg.is_none() {
            self.notices.push("`needle.bevel_heading_deg` has no effect without needle.bevel_angle_deg.".into());
        }
        match (table.tip_length_mm, table.tip_half_angle_deg, table.bevel_angle_deg) {
            (Some(length), None, None) => {
                (TipShape::Cone, self.number("needle.tip_length_mm", length, Within::Between(0.05, 50.0)) * MM)
            }
            (None, Some(angle), None) => {
                let angle = self.number("needle.tip_half_angle_deg", angle, Within::Between(3.0, 80.0));
                (TipShape::Cone, radius / angle.to_radians().tan())
            }
            (None, None, Some(angle)) => {
                let angle = self.number("needle.bevel_angle_deg", angle, Within::Between(5.0, 80.0));
                let heading = self.optional(
                    "needle.bevel_heading_deg",
                    table.bevel_heading_deg,
                    1.0,
                    0.0,
                    Within::Between(-360.0, 360.0),
                );
                let length = 2.0 * radius / angle.to_radians().tan();
                (TipShape::Bevel { heading: heading.to_radians() }, length)
            }
            (length, angle, bevel) => {
                let count = [length, angle, bevel].iter().flatten().count();
                self.problems.report(
                    "needle",
                    if count > 1 { format!("the tip has {count} shapes") } else { "the tip has no shape".into() },
                    "exactly one of tip_length_mm, tip_half_angle_deg and bevel_angle_deg",
                    "write tip_half_angle_deg = 18 (cone) or bevel_angle_deg = 20",
                );
                (TipShape::Cone, MM)
            }
        }
    }

    /// Checks a table of constants; returns its density [kg/m^3].
    fn needle_material(&mut self, table: &NeedleMaterialTable) -> f64 {
        self.number("needle.material.youngs_modulus_gpa", table.youngs_modulus_gpa, Within::Between(0.1, 2000.0));
        self.number("needle.material.poisson_ratio", table.poisson_ratio, Within::Between(0.0, 0.4999));
        // Density [kg/m^3] and how the file writes it.
        let (path, written, density) = match (table.density_g_cm3, table.density_g_mm3) {
            (Some(value), None) => ("needle.material.density_g_cm3", format!("{value} g/cm^3"), value * 1e3),
            (None, Some(value)) => ("needle.material.density_g_mm3", format!("{value:e} g/mm^3"), value * 1e6),
            _ => {
                self.problems.report(
                    "needle.material",
                    "the needle material needs exactly one density",
                    "density_g_cm3 or density_g_mm3",
                    "write density_g_cm3 = 7.9 (steel)",
                );
                return 7.9e3;
            }
        };
        if (800.0..=25_000.0).contains(&density) {
            return density;
        }
        // A density in t/mm^3 taken for g/mm^3 is a million times too small.
        let as_tonnes = density * 1e6;
        let guess = if (800.0..=25_000.0).contains(&as_tonnes) {
            format!(
                "did you mean {:.3e} t/mm^3 = {:.1} g/cm^3{}? Then write density_g_cm3 = {:.1}",
                density * 1e-6,
                as_tonnes * 1e-3,
                if as_tonnes > 12_000.0 { " (tungsten carbide)" } else { "" },
                as_tonnes * 1e-3
            )
        } else {
            "write the density of the metal, e.g. density_g_cm3 = 7.9, or material = \"steel-304\"".into()
        };
        self.problems.report(
            path,
            format!("REFUSED needle: density {written} is {} kg/m^3 (air: 1.2, steel: 7900)", four_digits(density)),
            "no needle material",
            guess,
        );
        density
    }

    pub(super) fn motion(&mut self, file: &SceneFile, has_tool: bool) -> Motion {
        let Some(table) = &file.motion else {
            if has_tool {
                self.problems.report(
                    "",
                    "the scene has a tool but no motion",
                    "no table [motion] in this file",
                    "add [[motion.phase]] with kind = \"insert\", speed_mm_s = 2, depth_mm = 12",
                );
            }
            return Motion::default();
        };
        if !has_tool {
            self.problems.report(
                "motion",
                "the scene has a motion but no tool",
                "nothing to move",
                "add [needle], [sphere] or [flat_punch], or remove [motion]",
            );
            return Motion::default();
        }
        let entry = table.entry_mm.unwrap_or([0.0, 0.0]);
        for (index, value) in entry.iter().enumerate() {
            self.number(&format!("motion.entry_mm.{index}"), *value, Within::Between(-1000.0, 1000.0));
        }
        let direction = self.direction(table);
        let phases = self.phases(&table.phase);
        Motion { entry: DVec3::new(entry[0], entry[1], 0.0) * MM, direction, phases }
    }

    fn direction(&mut self, table: &MotionTable) -> DVec3 {
        match (table.direction, table.angle_deg) {
            (Some(_), Some(_)) => {
                self.problems.report(
                    "motion.angle_deg",
                    "the motion has two directions",
                    "`direction` and `angle_deg`",
                    "keep one of them",
                );
                DVec3::NEG_Z
            }
            (Some(vector), None) => {
                let vector = self.vector("motion.direction", vector, 1e6);
                let unit = vector.normalize_or_zero();
                // 80 degrees from the vertical, as for angle_deg.
                if unit.z > -(80.0_f64.to_radians().cos()) {
                    self.problems.report(
                        "motion.direction",
                        "the direction does not lead into the tissue",
                        "must point down, at most 80 degrees from the vertical",
                        "write a vector with a negative z, e.g. direction = [0, 0, -1]",
                    );
                    return DVec3::NEG_Z;
                }
                unit
            }
            (None, angle) => {
                if angle.is_none() && table.azimuth_deg.is_some() {
                    self.notices.push("`motion.azimuth_deg` has no effect without motion.angle_deg.".into());
                }
                let angle =
                    angle.map_or(0.0, |value| self.number("motion.angle_deg", value, Within::Between(0.0, 80.0)));
                let azimuth =
                    self.optional("motion.azimuth_deg", table.azimuth_deg, 1.0, 0.0, Within::Between(-360.0, 360.0));
                let (angle, azimuth) = (angle.to_radians(), azimuth.to_radians());
                DVec3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), -angle.cos())
            }
        }
    }

    fn phases(&mut self, tables: &[PhaseTable]) -> Vec<Phase> {
        if tables.is_empty() {
            self.problems.report(
                "motion",
                "the motion has no phase",
                "nothing moves",
                "add [[motion.phase]] with kind = \"insert\", speed_mm_s = 2, depth_mm = 12",
            );
        }
        let mut phases = Vec::new();
        let mut reached = 0.0;
        for (index, table) in tables.iter().enumerate() {
            let at = |key: &str| format!("motion.phase.{index}.{key}");
            if table.kind == PhaseKind::Hold {
                if table.speed_mm_s.is_some() || table.depth_mm.is_some() {
                    let key = if table.speed_mm_s.is_some() { "speed_mm_s" } else { "depth_mm" };
                    self.problems.report(
                        &at(key),
                        "a hold has no speed and no depth",
                        "not for hold",
                        "remove this key",
                    );
                }
                let Some(duration) = table.duration_s else {
                    self.missing_in_phase(index, "duration_s", "duration_s = 0.5");
                    continue;
                };
                phases
                    .push(Phase::Hold { duration: self.number(&at("duration_s"), duration, Within::Positive(600.0)) });
                continue;
            }
            if table.duration_s.is_some() {
                self.problems.report(
                    &at("duration_s"),
                    "speed and depth fix how long this phase takes",
                    "for hold only",
                    "remove this key",
                );
            }
            let (Some(speed), Some(depth)) = (table.speed_mm_s, table.depth_mm) else {
                if table.speed_mm_s.is_none() {
                    self.missing_in_phase(index, "speed_mm_s", "speed_mm_s = 2");
                }
                if table.depth_mm.is_none() {
                    self.missing_in_phase(index, "depth_mm", "depth_mm = 12");
                }
                continue;
            };
            let speed = self.number(&at("speed_mm_s"), speed, Within::Positive(1000.0)) * MM;
            if table.kind == PhaseKind::Insert {
                let depth = self.number(&at("depth_mm"), depth, Within::Positive(1000.0));
                if depth <= reached {
                    self.problems.report(
                        &at("depth_mm"),
                        format!("an insertion to {depth} mm from {reached} mm does not go deeper"),
                        "not deeper than where the tool stands",
                        format!("write a depth above {reached}, or kind = \"withdraw\""),
                    );
                }
                reached = depth;
                phases.push(Phase::Insert { speed, depth: depth * MM });
            } else {
                let depth = self.number(&at("depth_mm"), depth, Within::Between(-100.0, 1000.0));
                if !phases.iter().any(|phase| matches!(phase, Phase::Insert { .. })) {
                    self.problems.report(
                        &at("kind"),
                        "the motion withdraws before it inserts",
                        "no insertion before this phase",
                        "put a phase with kind = \"insert\" first",
                    );
                } else if depth >= reached {
                    self.problems.report(
                        &at("depth_mm"),
                        format!("a withdrawal to {depth} mm from {reached} mm does not go back"),
                        "not shallower than where the tool stands",
                        format!("write a depth below {reached}, or kind = \"insert\""),
                    );
                }
                reached = depth;
                phases.push(Phase::Withdraw { speed, depth: depth * MM });
            }
        }
        phases
    }

    fn missing_in_phase(&mut self, index: usize, key: &str, example: &str) {
        self.problems.report(
            &format!("motion.phase.{index}"),
            format!("phase {index} has no `{key}`"),
            "incomplete phase",
            format!("add {example}"),
        );
    }
}
