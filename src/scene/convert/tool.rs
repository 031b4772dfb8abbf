//! The tool of a scene and its motion.

use glam::DVec3;

use super::super::file::*;
use super::super::needles;
use super::mesh_path::Entry;
use super::{Check, MM, Within};
use crate::mesh::TetMesh;
use crate::needle::motion::Placement;
use crate::needle::{BoreShape, Motion, NeedleShape, Phase, TipShape, Tool, Vibration};
use crate::units::four_digits;

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
        let (mut name, mut diameter, mut inner_diameter) = (String::new(), MM, 0.0);
        match (&table.gauge, table.outer_diameter_mm) {
            (Some(gauge), None) => match needles::needle(gauge) {
                Some(preset) => {
                    (name, diameter) = (preset.gauge.clone(), preset.outer_diameter);
                    inner_diameter = preset.inner_diameter;
                }
                None => {
                    let names: Vec<&str> = needles::needles().iter().map(|p| p.gauge.as_str()).collect();
                    let meant = format!("{gauge}G");
                    if names.contains(&meant.as_str()) {
                        self.problems.report(
                            "needle.gauge",
                            format!("a gauge is a text that ends in G, and {gauge} is not"),
                            "a number",
                            format!("did you mean \"{meant}\"? There are: {}", names.join(", ")),
                        );
                    } else {
                        self.unknown_name("needle.gauge", "needle gauge", gauge, &names);
                    }
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
        let bore = self.bore(table, radius);
        let length = self.optional("needle.length_mm", table.length_mm, MM, 100.0 * MM, Within::Between(1.0, 1000.0));
        let steel = NeedleShape::cone(&name, radius, tip_length);
        // The bore that takes a core is that of the tube.
        let inner_diameter = bore.map_or(inner_diameter, |b| 2.0 * b.radius);
        let shape = NeedleShape { tip, bore, inner_diameter, length, ..steel };
        match &table.material {
            None => shape,
            Some(NeedleMaterialEntry::Preset(name)) => match needles::needle_material(name) {
                Some(m) => NeedleShape {
                    material: name.clone(),
                    youngs_modulus: m.youngs_modulus,
                    density: m.density,
                    ..shape
                },
                None => {
                    let names: Vec<&str> = needles::needle_materials().iter().map(|m| m.name.as_str()).collect();
                    self.unknown_name("needle.material", "needle material", name, &names);
                    shape
                }
            },
            Some(NeedleMaterialEntry::Table(table)) => {
                let (youngs_modulus, density) = self.needle_material(table);
                NeedleShape { material: "constants".into(), youngs_modulus, density, ..shape }
            }
        }
    }

    /// What makes the needle hollow.
    fn bore(&mut self, table: &NeedleTable, radius: f64) -> Option<BoreShape> {
        let edge = self.optional("needle.cutting_edge", table.cutting_edge, 1.0, 0.25, Within::Between(0.0, 1.0));
        let friction = self.optional("needle.bore_friction", table.bore_friction, 1.0, 0.05, Within::NotNegative(2.0));
        let Some(diameter) = table.bore_diameter_mm else {
            for (key, given) in [("cutting_edge", table.cutting_edge), ("bore_friction", table.bore_friction)] {
                if given.is_some() {
                    self.notices.push(format!("`needle.{key}` has no effect without needle.bore_diameter_mm."));
                }
            }
            return None;
        };
        let inner = 0.5 * self.number("needle.bore_diameter_mm", diameter, Within::Between(0.02, 20.0)) * MM;
        if inner >= radius {
            self.problems.report(
                "needle.bore_diameter_mm",
                format!("the bore of {diameter} mm does not fit into the needle of {} mm", 2e3 * radius),
                "must be smaller than the outer diameter",
                "write e.g. bore_diameter_mm = 1.194 for 16G",
            );
        }
        if table.bevel_angle_deg.is_some() {
            self.problems.report(
                "needle.bevel_angle_deg",
                "a hollow needle has a ring for a tip, no bevel",
                "bevel and bore",
                "write tip_length_mm = 1.0 for the length of the ground edge",
            );
        }
        Some(BoreShape { radius: inner, edge: inner + edge * (radius - inner), friction })
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

    /// Young's modulus [Pa] and density [kg/m^3].
    fn needle_material(&mut self, table: &NeedleMaterialTable) -> (f64, f64) {
        let key = "needle.material.youngs_modulus_gpa";
        let youngs_modulus = self.number(key, table.youngs_modulus_gpa, Within::Between(0.1, 2000.0)) * 1e9;
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
                return (youngs_modulus, 7900.0);
            }
        };
        if (800.0..=25_000.0).contains(&density) {
            return (youngs_modulus, density);
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
        (youngs_modulus, density)
    }

    pub(super) fn motion(&mut self, file: &SceneFile, tool: Option<&Tool>, mesh: Option<&TetMesh>) -> Motion {
        let has_tool = tool.is_some();
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
        let Entry { entry, direction } = match file.tissue.mesh.is_some() {
            true => match self.mesh_entry(table, mesh, tool) {
                Some(entry) => entry,
                None => return Motion { direction: DVec3::NEG_Z, ..Motion::default() },
            },
            false => self.block_entry(table),
        };
        let phases = self.phases(&table.phase, entry, direction);
        let vibration = table.vibration.as_ref().map(|v| self.vibration(v, direction));
        Motion { entry, direction, phases, vibration }
    }

    /// Entry point and direction of a motion into a block.
    fn block_entry(&mut self, table: &MotionTable) -> Entry {
        self.keys_of_a_mesh(table);
        let entry = table.entry_mm.unwrap_or([0.0, 0.0]);
        for (index, value) in entry.iter().enumerate() {
            self.number(&format!("motion.entry_mm.{index}"), *value, Within::Between(-1000.0, 1000.0));
        }
        let direction = self.direction(table);
        Entry { entry: DVec3::new(entry[0], entry[1], 0.0) * MM, direction }
    }

    fn vibration(&mut self, table: &VibrationTable, insertion: DVec3) -> Vibration {
        let direction = match table.direction {
            None => insertion,
            Some(vector) => {
                let unit = self.vector("motion.vibration.direction", vector, 1e6).normalize_or_zero();
                if unit == DVec3::ZERO {
                    self.problems.report(
                        "motion.vibration.direction",
                        "the vibration has no direction",
                        "a vector of length zero",
                        "write e.g. direction = [1, 0, 0], or leave the key away: along the insertion",
                    );
                    insertion
                } else {
                    unit
                }
            }
        };
        Vibration {
            amplitude: self.number("motion.vibration.amplitude_mm", table.amplitude_mm, Within::Positive(5.0)) * MM,
            frequency: self.number("motion.vibration.frequency_hz", table.frequency_hz, Within::Positive(1000.0)),
            direction,
        }
    }

    pub(super) fn direction(&mut self, table: &MotionTable) -> DVec3 {
        self.stated_direction("motion", table.direction, table.angle_deg, table.azimuth_deg).unwrap_or(DVec3::NEG_Z)
    }

    /// The direction that a table states as a vector or by angles; `None` where it states none.
    fn stated_direction(
        &mut self,
        table: &str,
        direction: Option<[f64; 3]>,
        angle_deg: Option<f64>,
        azimuth_deg: Option<f64>,
    ) -> Option<DVec3> {
        let at = |key: &str| format!("{table}.{key}");
        match (direction, angle_deg) {
            (Some(_), Some(_)) => {
                self.problems.report(
                    &at("angle_deg"),
                    "the motion has two directions",
                    "`direction` and `angle_deg`",
                    "keep one of them",
                );
                None
            }
            (Some(vector), None) => {
                let vector = self.vector(&at("direction"), vector, 1e6);
                let unit = vector.normalize_or_zero();
                // 80 degrees from the vertical, as for angle_deg.
                if unit.z > -(80.0_f64.to_radians().cos()) {
                    self.problems.report(
                        &at("direction"),
                        "the direction does not lead into the tissue",
                        "must point down, at most 80 degrees from the vertical",
                        "write a vector with a negative z, e.g. direction = [0, 0, -1]",
                    );
                    return None;
                }
                Some(unit)
            }
            (None, None) => {
                if azimuth_deg.is_some() {
                    self.notices.push(format!("`{}` has no effect without {}.", at("azimuth_deg"), at("angle_deg")));
                }
                None
            }
            (None, Some(angle)) => {
                let angle = self.number(&at("angle_deg"), angle, Within::Between(0.0, 80.0)).to_radians();
                let azimuth = self
                    .optional(&at("azimuth_deg"), azimuth_deg, 1.0, 0.0, Within::Between(-360.0, 360.0))
                    .to_radians();
                Some(DVec3::new(angle.sin() * azimuth.cos(), angle.sin() * azimuth.sin(), -angle.cos()))
            }
        }
    }

    fn phases(&mut self, tables: &[PhaseTable], entry: DVec3, direction: DVec3) -> Vec<Phase> {
        if tables.is_empty() {
            self.problems.report(
                "motion",
                "the motion has no phase",
                "nothing moves",
                "add [[motion.phase]] with kind = \"insert\", speed_mm_s = 2, depth_mm = 12",
            );
        }
        let mut motion = Motion { entry, direction, phases: Vec::new(), vibration: None };
        for (index, table) in tables.iter().enumerate() {
            self.keys_of_other_kinds(index, table);
            let begin = motion.end();
            let phase = match table.kind {
                PhaseKind::Hold => self.hold(index, table),
                PhaseKind::Insert => self.insertion(index, table, begin.depth),
                PhaseKind::Withdraw => {
                    let inserted = motion.phases.iter().any(|p| !matches!(p, Phase::Hold { .. }));
                    self.withdrawal(index, table, begin.depth, inserted)
                }
                PhaseKind::Move => self.free_move(index, table, &begin),
                PhaseKind::Turn => self.turn(index, table, &begin),
                PhaseKind::Reposition => self.reposition(index, table, &begin),
            };
            motion.phases.extend(phase);
        }
        motion.phases
    }

    /// Keys that mean nothing for the kind of a phase.
    fn keys_of_other_kinds(&mut self, index: usize, table: &PhaseTable) {
        use PhaseKind::{Hold, Insert, Move, Reposition, Turn, Withdraw};
        let turning = [Move, Turn, Reposition];
        let keys: [(&str, bool, &[PhaseKind], &str); 10] = [
            ("speed_mm_s", table.speed_mm_s.is_some(), &[Insert, Withdraw, Move], "for insert, withdraw and move"),
            ("depth_mm", table.depth_mm.is_some(), &[Insert, Withdraw], "for insert and withdraw"),
            ("duration_s", table.duration_s.is_some(), &[Hold], "for hold only"),
            ("to_mm", table.to_mm.is_some(), &[Move], "for move only"),
            ("direction", table.direction.is_some(), &turning, "for move, turn and reposition"),
            ("angle_deg", table.angle_deg.is_some(), &turning, "for move, turn and reposition"),
            ("azimuth_deg", table.azimuth_deg.is_some(), &turning, "for move, turn and reposition"),
            ("rate_deg_s", table.rate_deg_s.is_some(), &[Turn], "for turn only"),
            ("pivot_mm", table.pivot_mm.is_some(), &[Turn], "for turn only"),
            ("entry_mm", table.entry_mm.is_some(), &[Reposition], "for reposition only"),
        ];
        for (key, present, kinds, label) in keys {
            if !present || kinds.contains(&table.kind) {
                continue;
            }
            let message = match (table.kind, key) {
                (Hold, "speed_mm_s" | "depth_mm") => "a hold has no speed and no depth".to_string(),
                (Insert | Withdraw, "duration_s") => "speed and depth fix how long this phase takes".into(),
                _ => format!("`{key}` means nothing in this kind of phase"),
            };
            let label = if table.kind == Hold { "not for hold" } else { label };
            self.problems.report(&format!("motion.phase.{index}.{key}"), message, label, "remove this key");
        }
    }

    /// A number that a phase cannot do without.
    fn needed(&mut self, index: usize, key: &str, value: Option<f64>, example: &str, within: Within) -> Option<f64> {
        match value {
            Some(value) => Some(self.number(&format!("motion.phase.{index}.{key}"), value, within)),
            None => {
                self.missing_in_phase(index, key, example);
                None
            }
        }
    }

    fn hold(&mut self, index: usize, table: &PhaseTable) -> Option<Phase> {
        let duration =
            self.needed(index, "duration_s", table.duration_s, "duration_s = 0.5", Within::Positive(600.0))?;
        Some(Phase::Hold { duration })
    }

    /// Speed [m/s] and depth [mm] of an insertion or a withdrawal.
    fn speed_and_depth(&mut self, index: usize, table: &PhaseTable, within: Within) -> Option<(f64, f64)> {
        let speed = self.needed(index, "speed_mm_s", table.speed_mm_s, "speed_mm_s = 2", Within::Positive(1000.0));
        // An insertion into a patient goes to its target.
        if self.has_labels && self.path.is_none() && table.depth_mm.is_none() {
            // Why there is no target has been told.
            return None;
        }
        let to_target = self.path.filter(|_| table.kind == PhaseKind::Insert).map(|path| path / MM);
        let depth = self.needed(index, "depth_mm", table.depth_mm.or(to_target), "depth_mm = 12", within);
        Some((speed? * MM, depth?))
    }

    fn insertion(&mut self, index: usize, table: &PhaseTable, from: f64) -> Option<Phase> {
        let (speed, depth) = self.speed_and_depth(index, table, Within::Positive(1000.0))?;
        if depth * MM <= from * (1.0 + 1e-12) {
            let reached = four_digits(from / MM);
            self.problems.report(
                &format!("motion.phase.{index}.depth_mm"),
                format!("an insertion to {depth} mm from {reached} mm does not go deeper"),
                "not deeper than where the tool stands",
                format!("write a depth above {reached}, or kind = \"withdraw\""),
            );
        }
        Some(Phase::Insert { speed, depth: depth * MM })
    }

    fn withdrawal(&mut self, index: usize, table: &PhaseTable, from: f64, inserted: bool) -> Option<Phase> {
        let (speed, depth) = self.speed_and_depth(index, table, Within::Between(-100.0, 1000.0))?;
        if !inserted {
            self.problems.report(
                &format!("motion.phase.{index}.kind"),
                "the motion withdraws before it inserts",
                "no insertion before this phase",
                "put a phase with kind = \"insert\" first",
            );
        } else if depth * MM >= from * (1.0 - 1e-12) {
            let reached = four_digits(from / MM);
            self.problems.report(
                &format!("motion.phase.{index}.depth_mm"),
                format!("a withdrawal to {depth} mm from {reached} mm does not go back"),
                "not shallower than where the tool stands",
                format!("write a depth below {reached}, or kind = \"insert\""),
            );
        }
        Some(Phase::Withdraw { speed, depth: depth * MM })
    }

    fn free_move(&mut self, index: usize, table: &PhaseTable, begin: &Placement) -> Option<Phase> {
        let place = format!("motion.phase.{index}");
        let speed = self.needed(index, "speed_mm_s", table.speed_mm_s, "speed_mm_s = 2", Within::Positive(1000.0));
        let Some(to) = table.to_mm else {
            self.missing_in_phase(index, "to_mm", "to_mm = [3, 0, -8], where the tip goes");
            return None;
        };
        let to = self.vector(&format!("{place}.to_mm"), to, 1000.0) * MM;
        if to.distance(begin.tip) < 1e-9 {
            self.problems.report(
                &format!("{place}.to_mm"),
                "the tip is there already",
                "a move of no length",
                "write another place, or kind = \"turn\" to change the direction alone",
            );
        }
        let direction = self.stated_direction(&place, table.direction, table.angle_deg, table.azimuth_deg);
        Some(Phase::Move { to, speed: speed? * MM, direction: direction.unwrap_or(begin.direction) })
    }

    fn turn(&mut self, index: usize, table: &PhaseTable, begin: &Placement) -> Option<Phase> {
        let place = format!("motion.phase.{index}");
        let rate = self.needed(index, "rate_deg_s", table.rate_deg_s, "rate_deg_s = 10", Within::Positive(3600.0));
        let direction = self.stated_direction(&place, table.direction, table.angle_deg, table.azimuth_deg);
        let Some(direction) = direction else {
            self.missing_in_phase(index, "angle_deg", "angle_deg = 20 or a direction");
            return None;
        };
        if direction.angle_between(begin.direction) < 1e-6 {
            self.problems.report(
                &place,
                "the needle has this direction already",
                "a turn of no angle",
                "write another direction, or remove this phase",
            );
        }
        let pivot = table.pivot_mm.map(|p| self.vector(&format!("{place}.pivot_mm"), p, 1000.0) * MM);
        Some(Phase::Turn { direction, rate: rate?.to_radians(), pivot: pivot.unwrap_or(begin.tip) })
    }

    fn reposition(&mut self, index: usize, table: &PhaseTable, begin: &Placement) -> Option<Phase> {
        let place = format!("motion.phase.{index}");
        if begin.depth > 0.0 {
            self.problems.report(
                &format!("{place}.kind"),
                format!("the needle is {} mm deep in the tissue", four_digits(begin.depth / MM)),
                "outside the tissue only",
                "put a phase with kind = \"withdraw\", depth_mm = -3 before it, or write kind = \"move\"",
            );
        }
        let Some([x, y]) = table.entry_mm else {
            self.missing_in_phase(index, "entry_mm", "entry_mm = [3, 0]");
            return None;
        };
        for (axis, value) in [x, y].into_iter().enumerate() {
            self.number(&format!("{place}.entry_mm.{axis}"), value, Within::Between(-1000.0, 1000.0));
        }
        let direction = self.stated_direction(&place, table.direction, table.angle_deg, table.azimuth_deg);
        let entry = DVec3::new(x, y, 0.0) * MM;
        Some(Phase::Reposition { entry, direction: direction.unwrap_or(begin.direction) })
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
