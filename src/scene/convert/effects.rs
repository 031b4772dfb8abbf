//! The effects of a scene: which are on, what they need, their parameters.

use super::super::FaceCondition;
use super::super::file::*;
use super::{Check, MM, Within, parameters};
use crate::effects::mass_scaling::Loading;
use crate::effects::{self, EFFECTS, EffectSet, TissueMaterial};
use crate::needle::beam::{BeamParams, Section};
use crate::needle::{Motion, NeedleShape, Tool};
use crate::units::four_digits;

impl Check<'_> {
    pub(super) fn effects(
        &mut self,
        file: &SceneFile,
        tool: &Option<Tool>,
        motion: &Motion,
        (faces, size): (&[FaceCondition; 6], glam::DVec3),
        material: &TissueMaterial,
    ) -> EffectSet {
        let keys: Vec<&str> = EFFECTS.iter().map(|effect| effect.key).collect();
        for (index, key) in file.effects.iter().enumerate() {
            if !keys.contains(&key.as_str()) {
                self.unknown_name(&format!("effects.{index}"), "effect", key, &keys);
            } else if file.effects[..index].contains(key) {
                self.problems.report(
                    &format!("effects.{index}"),
                    format!("effect `{key}` is listed twice"),
                    "it is either on or not",
                    "remove one of the two",
                );
            }
        }
        let listed = |key: &str| file.effects.iter().any(|listed| listed == key);
        let place = |key: &str| {
            let index = file.effects.iter().position(|listed| listed == key).unwrap_or(0);
            format!("effects.{index}")
        };
        let is_needle = matches!(tool, Some(Tool::Needle(_)));
        let is_indenter = tool.is_some() && !is_needle;
        if listed("puncture") && !is_needle {
            self.problems.report(
                &place("puncture"),
                "effect `puncture` needs a needle",
                "no [needle] in this scene",
                "add [needle] with gauge = \"16G\" and tip_half_angle_deg = 18, or remove the effect",
            );
        }
        if listed("indentation") && !is_indenter {
            self.problems.report(
                &place("indentation"),
                "effect `indentation` needs a sphere or a flat punch",
                "no [sphere] or [flat_punch] in this scene",
                "add [sphere] with radius_mm = 5, or remove the effect",
            );
        }
        if listed("friction") && tool.is_none() {
            self.problems.report(
                &place("friction"),
                "effect `friction` needs a tool",
                "nothing to rub on",
                "add [needle], [sphere] or [flat_punch], or remove the effect",
            );
        }
        for (with, key, touch) in [(is_needle, "puncture", "[needle]"), (is_indenter, "indentation", "this tool")] {
            if listed("friction") && with && !listed(key) {
                self.problems.report(
                    &place("friction"),
                    format!("effect `friction` needs `{key}`: without it {touch} does not touch the tissue"),
                    "nothing to rub on",
                    format!("add \"{key}\" to the list `effects`, or remove \"friction\""),
                );
            }
        }
        if listed("flexible_needle") && !(is_needle && listed("puncture")) {
            self.problems.report(
                &place("flexible_needle"),
                "effect `flexible_needle` needs a needle and the effect `puncture`",
                "nothing bends the needle",
                "add [needle] and \"puncture\" to the list `effects`, or remove the effect",
            );
        }
        if listed("adhesion") && !listed("puncture") {
            self.problems.report(
                &place("adhesion"),
                "effect `adhesion` needs `puncture`: tissue sticks to a tip that is in it",
                "nothing enters the tissue",
                "add \"puncture\" to the list `effects`, or remove \"adhesion\"",
            );
        }
        if listed("damage") && !listed("plasticity") {
            self.problems.report(
                &place("damage"),
                "effect `damage` needs `plasticity`: it grows with the plastic displacement",
                "nothing drives the damage",
                "add \"plasticity\" to the list `effects`, or remove \"damage\"",
            );
        }
        if file.tissue.mesh.is_some() {
            for key in ["puncture", "indentation", "cohesive"] {
                if listed(key) {
                    self.needs_block(&place(key), &format!("effect `{key}`"));
                }
            }
        }
        if is_needle && !listed("puncture") {
            self.notices.push(
                "The needle does not touch the tissue and feels nothing of it: add \"puncture\" to the list `effects`, or remove \
                 [needle] and [motion]."
                    .into(),
            );
        }
        if is_indenter && !listed("indentation") {
            self.notices.push(
                "The tool does not touch the tissue and feels nothing of it: add \"indentation\" to the list `effects`, or remove \
                 the tool and [motion]."
                    .into(),
            );
        }
        for (key, present) in [
            ("puncture", file.puncture.is_some()),
            ("cohesive", file.cohesive.is_some()),
            ("adhesion", file.adhesion.is_some()),
            ("friction", file.friction.is_some()),
            ("flexible_needle", file.flexible_needle.is_some()),
            ("indentation", file.indentation.is_some()),
            ("gravity", file.gravity.is_some()),
            ("plasticity", file.plasticity.is_some()),
            ("fibres", file.fibres.is_some()),
            ("viscoelastic", file.viscoelastic.is_some()),
            ("damage", file.damage.is_some()),
        ] {
            if present && !listed(key) {
                self.notices.push(format!("Table [{key}] has no effect: `{key}` is not in the list `effects`."));
            }
        }
        for region in &file.region {
            for (key, present) in [
                ("plasticity", region.plasticity.is_some()),
                ("fibres", region.fibres.is_some()),
                ("viscoelastic", region.viscoelastic.is_some()),
                ("damage", region.damage.is_some()),
            ] {
                if present && !listed(key) {
                    self.notices.push(format!(
                        "Table [region.{key}] of `{}` has no effect: `{key}` is not in the list `effects`.",
                        region.name
                    ));
                }
            }
        }
        if file.solver.mass_scaling.is_some() && !listed("mass_scaling") {
            self.notices
                .push("`solver.mass_scaling` has no effect: `mass_scaling` is not in the list `effects`.".into());
        }
        let puncture = self.puncture(&file.puncture.clone().unwrap_or_default());
        let cohesive = self.cohesive(&file.cohesive.clone().unwrap_or_default(), &file.tissue);
        if listed("cohesive") {
            let planned = listed("puncture") && !motion.is_free() && !puncture.always_free;
            self.check_cohesive(&place("cohesive"), tool, motion, &cohesive, [listed("puncture"), planned]);
        } else if let Some(Tool::Needle(NeedleShape { bore: Some(_), .. })) = tool {
            self.problems.report(
                "needle.bore_diameter_mm",
                "a hollow needle needs the effect `cohesive`: its core separates on the ring of the cutting edge",
                "no separation in this scene",
                "add \"cohesive\" to the list `effects`, or remove bore_diameter_mm",
            );
        }
        let adhesion = self.adhesion(&file.adhesion.clone().unwrap_or_default());
        let friction = self.friction(&file.friction.clone().unwrap_or_default());
        let indentation = self.indentation(&file.indentation.clone().unwrap_or_default());
        if motion.is_free() || puncture.always_free {
            if listed("adhesion") {
                self.problems.report(
                    &place("adhesion"),
                    "effect `adhesion` needs a path that is planned before the run",
                    "the path of this scene is found while the tip moves",
                    "write a straight motion and drop puncture.path = \"free\", or remove \"adhesion\"",
                );
            }
            if let Some(Tool::Needle(NeedleShape { bore: Some(_), .. })) = tool {
                self.problems.report(
                    "needle.bore_diameter_mm",
                    "a hollow needle needs a path that is planned before the run: the grid follows its bore",
                    "the path of this scene is found while the tip moves",
                    "write a straight motion and drop puncture.path = \"free\", or remove bore_diameter_mm",
                );
            } else if listed("cohesive") {
                self.notices.push(
                    "On a free path the needle opens no cohesive faces: it softens what it passes; planes of [cohesive] still \
                     separate."
                        .into(),
                );
            }
        }
        if listed("flexible_needle") && (motion.is_free() || puncture.always_free) {
            self.problems.report(
                &place("flexible_needle"),
                "a flexible needle keeps to its planned path",
                "with a free motion or puncture.path = \"free\"",
                "move along one straight line, or remove the effect",
            );
        }
        let flexible = listed("flexible_needle").then(|| {
            let weight =
                if listed("gravity") { file.gravity.clone().unwrap_or_default() } else { GravityTable::none() };
            self.flexible_needle(&file.flexible_needle.clone().unwrap_or_default(), tool, motion, &weight)
        });
        let acceleration = file.gravity.as_ref().and_then(|table| table.acceleration_m_s2);
        let gravity = effects::gravity::Params {
            acceleration: self.vector("gravity.acceleration_m_s2", acceleration.unwrap_or([0.0, 0.0, -9.81]), 1000.0),
        };
        let factor = match file.solver.mass_scaling {
            Some(MassScalingEntry::Factor(factor)) => {
                self.number("solver.mass_scaling", factor, Within::Between(1.0, 1e8))
            }
            _ if listed("mass_scaling") => {
                self.automatic_mass_scaling(&Loading::of(Some(motion), faces, size), material)
            }
            _ => 1.0,
        };
        self.own_tables("", file.own_tables());
        let plasticity = parameters::plasticity_over(&file.plasticity.clone().unwrap_or_default(), Default::default());
        EffectSet {
            mass_scaling: listed("mass_scaling").then_some(effects::mass_scaling::Params { factor }),
            gravity: listed("gravity").then_some(gravity),
            plasticity: listed("plasticity").then_some(plasticity),
            fibres: listed("fibres")
                .then(|| parameters::fibres_over(&file.fibres.clone().unwrap_or_default(), Default::default())),
            viscoelastic: listed("viscoelastic").then(|| {
                parameters::viscoelastic_over(&file.viscoelastic.clone().unwrap_or_default(), Default::default())
            }),
            damage: listed("damage").then(|| {
                parameters::damage_over(&file.damage.clone().unwrap_or_default(), Default::default(), plasticity)
            }),
            cohesive: listed("cohesive").then_some(cohesive),
            puncture: listed("puncture").then_some(puncture),
            adhesion: listed("adhesion").then_some(adhesion),
            indentation: listed("indentation").then_some(indentation),
            friction: listed("friction").then_some(friction),
            flexible_needle: flexible,
        }
    }

    fn flexible_needle(
        &mut self,
        table: &FlexibleNeedleTable,
        tool: &Option<Tool>,
        motion: &Motion,
        weight: &GravityTable,
    ) -> effects::flexible_needle::Params {
        let default = effects::flexible_needle::Params::default();
        // Reported above where there is none.
        let Some(Tool::Needle(needle)) = tool else { return default };
        let at = |key: &str| format!("flexible_needle.{key}");
        let length = self.optional(
            &at("free_length_mm"),
            table.free_length_mm,
            MM,
            default.beam.length,
            Within::Between(5.0, 500.0),
        );
        if length <= motion.deepest() {
            self.problems.report(
                &if table.free_length_mm.is_some() { at("free_length_mm") } else { "flexible_needle".into() },
                format!(
                    "the needle is {} mm long and goes {} mm deep: its hub would enter the tissue",
                    length / MM,
                    motion.deepest() / MM
                ),
                "longer than the deepest insertion",
                format!("write free_length_mm above {}", motion.deepest() / MM),
            );
        }
        let outer_diameter = 2.0 * needle.radius;
        let inner_diameter = self.optional(
            &at("inner_diameter_mm"),
            table.inner_diameter_mm,
            MM,
            needle.inner_diameter,
            Within::NotNegative(20.0),
        );
        if inner_diameter > 0.98 * outer_diameter {
            self.problems.report(
                &at("inner_diameter_mm"),
                format!("the bore of {} mm leaves no wall of {} mm", inner_diameter / MM, outer_diameter / MM),
                "at most 0.98 of the outer diameter",
                "write the inner diameter of the tube, or 0 for a solid needle",
            );
        }
        let elements = table.elements.map_or(default.beam.elements as f64, f64::from);
        let elements = self.number(&at("elements"), elements, Within::Between(4.0, 200.0));
        let acceleration = table.gravity_m_s2.or(weight.acceleration_m_s2).unwrap_or([0.0, 0.0, -9.81]);
        effects::flexible_needle::Params {
            beam: BeamParams {
                length,
                elements: elements as usize,
                section: Section { outer_diameter, inner_diameter },
                youngs_modulus: needle.youngs_modulus,
                density: needle.density,
            },
            gravity: self.vector(&at("gravity_m_s2"), acceleration, 1000.0),
        }
    }

    /// The factor of `mass_scaling = "auto"`, from what moves.
    fn automatic_mass_scaling(&mut self, loading: &Loading, material: &TissueMaterial) -> f64 {
        let wave = (material.law.shear_modulus() / material.density).sqrt();
        loading.auto_factor(wave).unwrap_or_else(|| {
            self.notices.push("solver.mass_scaling \"auto\" is 1: nothing in the scene moves at a known speed.".into());
            1.0
        })
    }

    fn puncture(&mut self, t: &PunctureTable) -> effects::puncture::Params {
        use Within::{Between, NotNegative, Positive};
        let d = effects::puncture::Params::default();
        let at = |key: &str| format!("puncture.{key}");
        let params = effects::puncture::Params {
            puncture_force: self.optional(
                &at("puncture_force_n"),
                t.puncture_force_n,
                1.0,
                d.puncture_force,
                Positive(100.0),
            ),
            cutting_force: self.optional(
                &at("cutting_force_n"),
                t.cutting_force_n,
                1.0,
                d.cutting_force,
                Positive(100.0),
            ),
            transition_length: self.optional(
                &at("transition_length_mm"),
                t.transition_length_mm,
                MM,
                d.transition_length,
                Positive(100.0),
            ),
            tip_stiffness: self.optional(
                &at("tip_stiffness_n_mm"),
                t.tip_stiffness_n_mm,
                1e3,
                d.tip_stiffness,
                Positive(1e4),
            ),
            softened_radius: self.optional(
                &at("softened_radius_mm"),
                t.softened_radius_mm,
                MM,
                d.softened_radius,
                Positive(100.0),
            ),
            residual_stiffness: self.optional(
                &at("residual_stiffness"),
                t.residual_stiffness,
                1.0,
                d.residual_stiffness,
                Between(1e-4, 1.0),
            ),
            ring_radius: self.optional(&at("ring_radius_mm"), t.ring_radius_mm, MM, d.ring_radius, Positive(100.0)),
            contact_stiffness_factor: self.optional(
                &at("contact_stiffness_factor"),
                t.contact_stiffness_factor,
                1.0,
                d.contact_stiffness_factor,
                Positive(100.0),
            ),
            contact_damping: self.optional(
                &at("contact_damping"),
                t.contact_damping,
                1.0,
                d.contact_damping,
                NotNegative(1.0),
            ),
            entry_fade: self.optional(&at("entry_fade_mm"), t.entry_fade_mm, MM, d.entry_fade, Positive(100.0)),
            always_free: t.path == Some(PathWord::Free),
            anywhere: false,
            rate_exponent: self.optional(&at("rate_exponent"), t.rate_exponent, 1.0, d.rate_exponent, NotNegative(1.0)),
            reference_speed: self.optional(
                &at("reference_speed_mm_s"),
                t.reference_speed_mm_s,
                MM,
                d.reference_speed,
                Between(1e-3, 1e3),
            ),
        };
        if params.softened_radius >= params.ring_radius {
            let key = if t.softened_radius_mm.is_some() { "softened_radius_mm" } else { "ring_radius_mm" };
            self.problems.report(
                &at(key),
                format!(
                    "the softened path ({} mm) reaches the ring of pushed nodes ({} mm)",
                    params.softened_radius / MM,
                    params.ring_radius / MM
                ),
                "softened_radius_mm must be smaller than ring_radius_mm",
                "write e.g. softened_radius_mm = 0.6 and ring_radius_mm = 2.0",
            );
        }
        if params.cutting_force > params.puncture_force {
            self.notices.push(format!(
                "The cutting force {} N is larger than the puncture force {} N: the force will not drop at the puncture.",
                params.cutting_force, params.puncture_force
            ));
        }
        params
    }

    fn cohesive(&mut self, t: &CohesiveTable, tissue: &TissueTable) -> effects::cohesive::Params {
        use Within::{Between, Positive};
        let d = effects::cohesive::Params::default();
        let at = |key: &str| format!("cohesive.{key}");
        let strength = self.optional(&at("strength_kpa"), t.strength_kpa, 1e3, d.strength, Positive(1e6));
        let energy = self.optional(&at("energy_j_m2"), t.energy_j_m2, 1.0, d.energy, Positive(1e6));
        let penalty = t.penalty_pa_m.map(|value| self.number(&at("penalty_pa_m"), value, Positive(1e15)));
        if t.penalty_factor.is_some() && penalty.is_some() {
            self.problems.report(
                &at("penalty_factor"),
                "the faces have two penalty stiffnesses",
                "`penalty_factor` and `penalty_pa_m`",
                "keep one of them",
            );
        }
        let size = tissue.size_mm.unwrap_or([1000.0; 3]);
        let planes = t
            .plane
            .iter()
            .enumerate()
            .filter_map(|(index, plane)| {
                let path = at(&format!("plane.{index}"));
                let Some(axis) = ["x", "y", "z"].iter().position(|a| *a == plane.axis) else {
                    self.unknown_name(&format!("{path}.axis"), "axis", &plane.axis, &["x", "y", "z"]);
                    return None;
                };
                let half = 0.5 * size[axis];
                let (low, high) = if axis == 2 { (-size[2], 0.0) } else { (-half, half) };
                let margin = 1e-3 * (high - low);
                let value = self.number(&format!("{path}.at_mm"), plane.at_mm, Between(low + margin, high - margin));
                Some(effects::cohesive::Plane { axis, at: value * MM, tip_driven: plane.tip_driven })
            })
            .collect();
        effects::cohesive::Params {
            strength,
            shear_strength: self.optional(
                &at("shear_strength_kpa"),
                t.shear_strength_kpa,
                1e3,
                strength,
                Positive(1e6),
            ),
            energy,
            shear_energy: self.optional(&at("shear_energy_j_m2"), t.shear_energy_j_m2, 1.0, energy, Positive(1e6)),
            exponent: self.optional(&at("exponent"), t.exponent, 1.0, d.exponent, Between(0.1, 10.0)),
            penalty,
            penalty_factor: self.optional(
                &at("penalty_factor"),
                t.penalty_factor,
                1.0,
                d.penalty_factor,
                Positive(1e6),
            ),
            planes,
        }
    }

    /// What the effect `cohesive` needs around it.
    fn check_cohesive(
        &mut self,
        place: &str,
        tool: &Option<Tool>,
        motion: &Motion,
        params: &effects::cohesive::Params,
        [cuts, planned]: [bool; 2],
    ) {
        let needle = match tool {
            Some(Tool::Needle(needle)) if cuts => Some(needle),
            _ => None,
        };
        if needle.is_none() && params.planes.is_empty() {
            self.problems.report(
                place,
                "effect `cohesive` has no face to separate",
                "no needle that cuts and no plane",
                "add [needle] with the effect `puncture`, or [[cohesive.plane]] with axis = \"z\" and at_mm = -5",
            );
        }
        let driven = params.planes.iter().position(|p| p.tip_driven);
        if let Some(index) = driven.filter(|_| needle.is_none() || !planned) {
            self.problems.report(
                &format!("cohesive.plane.{index}.tip_driven"),
                "no tip passes the plane",
                "no needle that cuts along a planned path",
                "add [needle] with the effect `puncture` and a straight motion, or remove tip_driven",
            );
        }
        let Some(needle) = needle else { return };
        let tilted = |axis: usize| motion.direction[axis].abs() > 1e-9;
        if needle.bore.is_some() && (tilted(0) || tilted(1)) {
            self.problems.report(
                "motion",
                "a hollow needle goes straight down: the grid follows its bore in vertical prisms",
                "inclined direction",
                "write direction = [0, 0, -1], or use a solid needle",
            );
        } else if tilted(0) && tilted(1) {
            self.problems.report(
                "motion",
                "a slit lies on a grid plane that holds the direction of the needle",
                "direction neither in the xz nor in the yz plane",
                "turn the azimuth to 0 or 90 degrees, or remove \"cohesive\" (the path then opens by softening)",
            );
        }
    }

    /// The faces carry more before they fail than at the moment at which they fail: `cohesive::LEAST_OPENING_RATIO`. Their penalty
    /// stiffness comes from the material of the scene and the edge of its cells [m].
    pub(super) fn cohesive_openings(
        &mut self,
        file: &SceneFile,
        material: &TissueMaterial,
        cell: f64,
        effects: &EffectSet,
    ) {
        const LEAST: f64 = effects::cohesive::LEAST_OPENING_RATIO;
        let Some(params) = &effects.cohesive else { return };
        let law = effects::cohesive::Law::new(params, material.law.youngs_modulus(), cell);
        let (ratio, share) = law.least_opening_ratio();
        if ratio >= LEAST {
            return;
        }
        let table = file.cohesive.clone().unwrap_or_default();
        let keys = [
            ("strength_kpa", table.strength_kpa.is_some()),
            ("energy_j_m2", table.energy_j_m2.is_some()),
            ("shear_strength_kpa", table.shear_strength_kpa.is_some()),
            ("shear_energy_j_m2", table.shear_energy_j_m2.is_some()),
        ];
        let place = match keys.iter().find(|(_, written)| *written) {
            Some((key, _)) => format!("cohesive.{key}"),
            None if file.cohesive.is_some() => "cohesive".into(),
            None => format!("effects.{}", file.effects.iter().position(|key| key == "cohesive").unwrap_or(0)),
        };
        let (onset, end) = law.openings(share);
        let mode = match share {
            0.0 => "opening".to_string(),
            1.0 => "shear".to_string(),
            _ => format!("openings with {:.0} % of shear", 100.0 * share),
        };
        // A little more than needed: the numbers are rounded, and a way out must lead out.
        let more = 1.01 * LEAST / ratio;
        let shear = |differs: bool, key: &str, value: f64| {
            if differs { format!(" and {key} {}", four_digits(value)) } else { String::new() }
        };
        let (energy, strength) = (params.energy * more, params.strength / more.sqrt());
        let shear_energy = shear(params.shear_energy != params.energy, "shear_energy_j_m2", params.shear_energy * more);
        let shear_strength = shear(
            params.shear_strength != params.strength,
            "shear_strength_kpa",
            params.shear_strength / more.sqrt() / 1e3,
        );
        let penalty = match params.penalty {
            Some(penalty) => format!("penalty_pa_m of at least {:.3e}", penalty * more),
            None => format!("penalty_factor of at least {}", four_digits(params.penalty_factor * more)),
        };
        self.problems.report(
            &place,
            format!(
                "REFUSED cohesion: in {mode} the faces begin to fail at {} mm (strength {} kPa over the penalty stiffness {:.3e} \
                 Pa/m) and have failed at {} mm (twice the energy {} J/m^2 over the strength): the second must be at \
                 least {LEAST} times the first",
                four_digits(onset / MM),
                four_digits(law.penalty * onset / 1e3),
                law.penalty,
                four_digits(end / MM),
                four_digits(law.fracture_energy(share)),
            ),
            format!("they would fail at {} times the opening at which they begin to", four_digits(ratio)),
            format!(
                "write under [cohesive] energy_j_m2 of at least {}{shear_energy}, or strength_kpa of at most {}{shear_strength}, or \
                 {penalty} (a shorter time step)",
                four_digits(energy),
                four_digits(strength / 1e3),
            ),
        );
    }

    fn adhesion(&mut self, t: &AdhesionTable) -> effects::adhesion::Params {
        use Within::{NotNegative, Positive};
        let d = effects::adhesion::Params::default();
        let at = |key: &str| format!("adhesion.{key}");
        let params = effects::adhesion::Params {
            static_force: self.optional(&at("static_force_n"), t.static_force_n, 1.0, d.static_force, Positive(100.0)),
            kinetic_force: self.optional(
                &at("kinetic_force_n"),
                t.kinetic_force_n,
                1.0,
                d.kinetic_force,
                NotNegative(100.0),
            ),
            stiffness: self.optional(&at("stiffness_n_mm"), t.stiffness_n_mm, 1e3, d.stiffness, Positive(1e4)),
            sliding_distance: self.optional(
                &at("sliding_distance_mm"),
                t.sliding_distance_mm,
                MM,
                d.sliding_distance,
                Positive(100.0),
            ),
        };
        let (fall, key) = (params.static_force - params.kinetic_force, |written: bool, key| {
            if written { format!("adhesion.{key}") } else { "adhesion".to_string() }
        });
        if fall < 0.0 {
            self.problems.report(
                &key(t.kinetic_force_n.is_some(), "kinetic_force_n"),
                format!(
                    "the kinetic force {} N is above the static one, {} N",
                    params.kinetic_force, params.static_force
                ),
                "nothing lets go",
                "write a kinetic_force_n below static_force_n, e.g. 0.05 and 0.25",
            );
        } else if params.stiffness * params.sliding_distance <= fall {
            self.problems.report(
                &key(t.sliding_distance_mm.is_some(), "sliding_distance_mm"),
                format!(
                    "the bond of {} N/mm snaps back: its force falls by {} N within {} mm",
                    params.stiffness * 1e-3,
                    four_digits(fall),
                    params.sliding_distance / MM
                ),
                "must be above (static_force_n - kinetic_force_n)/stiffness_n_mm",
                format!("write a sliding_distance_mm above {}", four_digits(fall / params.stiffness / MM)),
            );
        }
        params
    }

    fn friction(&mut self, table: &FrictionTable) -> effects::friction::Params {
        let default = effects::friction::Params::default();
        effects::friction::Params {
            coefficient: self.optional(
                "friction.coefficient",
                table.coefficient,
                1.0,
                default.coefficient,
                Within::NotNegative(2.0),
            ),
            stiffness_ratio: self.optional(
                "friction.stiffness_ratio",
                table.stiffness_ratio,
                1.0,
                default.stiffness_ratio,
                Within::Positive(1.0),
            ),
            fade_length: self.optional(
                "friction.fade_length_mm",
                table.fade_length_mm,
                MM,
                default.fade_length,
                Within::NotNegative(100.0),
            ),
        }
    }

    fn indentation(&mut self, table: &IndentationTable) -> effects::indentation::Params {
        let default = effects::indentation::Params::default();
        effects::indentation::Params {
            stiffness_factor: self.optional(
                "indentation.contact_stiffness_factor",
                table.contact_stiffness_factor,
                1.0,
                default.stiffness_factor,
                Within::Positive(100.0),
            ),
            contact_damping: self.optional(
                "indentation.contact_damping",
                table.contact_damping,
                1.0,
                default.contact_damping,
                Within::NotNegative(1.0),
            ),
        }
    }
}
