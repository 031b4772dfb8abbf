//! The effects of a scene: which are on, what they need around them.

use super::super::file::*;
use super::{Check, Within, parameters};
use crate::effects::mass_scaling::Loading;
use crate::effects::own::OwnEffect;
use crate::effects::parameters::Table;
use crate::effects::{self, EFFECTS, EffectSet, TissueMaterial};
use crate::needle::{Motion, NeedleShape, Tool};

/// The list `effects` of a scene.
#[derive(Clone, Copy)]
struct Listed<'a>(&'a [String]);

impl Listed<'_> {
    fn has(self, key: &str) -> bool {
        self.0.iter().any(|listed| listed == key)
    }

    /// Where the word stands.
    fn place(self, key: &str) -> String {
        format!("effects.{}", self.0.iter().position(|listed| listed == key).unwrap_or(0))
    }
}

impl Check<'_> {
    /// The effects that the scene lists, with their parameters.
    pub(super) fn effects(
        &mut self,
        file: &SceneFile,
        own: &[&'static OwnEffect],
        tool: &Option<Tool>,
        motion: &Motion,
        loading: &Loading,
        material: &TissueMaterial,
    ) -> EffectSet {
        let list = Listed(&file.effects);
        self.listed_effects(list, own);
        self.needs_of_touch(list, tool);
        self.needs_of_effects(list, tool, file.tissue.mesh.is_some());
        self.without_touch(list, tool);
        self.without_effect(list, file);
        let puncture = self.puncture(&file.puncture.clone().unwrap_or_default());
        let cohesive = self.cohesive(&file.cohesive.clone().unwrap_or_default(), &file.tissue);
        let free = motion.is_free() || puncture.always_free;
        self.straight_in_a_mesh(file, tool.as_ref(), motion, list.has("puncture") && puncture.always_free);
        if list.has("cohesive") {
            let planned = list.has("puncture") && !free;
            self.check_cohesive(&list.place("cohesive"), tool, motion, &cohesive, [list.has("puncture"), planned]);
        } else if let (Some(Tool::Needle(NeedleShape { bore: Some(_), .. })), None) = (tool, &file.tissue.mesh) {
            self.problems.report(
                "needle.bore_diameter_mm",
                "a hollow needle needs the effect `cohesive`: its core separates on the ring of the cutting edge",
                "no separation in this scene",
                "add \"cohesive\" to the list `effects`, or remove bore_diameter_mm",
            );
        }
        let adhesion = self.adhesion(&file.adhesion.clone().unwrap_or_default());
        let friction = self.table("friction", &file.friction.clone().unwrap_or_default());
        let indentation = self.table("indentation", &file.indentation.clone().unwrap_or_default());
        if free {
            self.needs_of_a_planned_path(list, tool);
        }
        let flexible = list.has("flexible_needle").then(|| {
            let weight =
                if list.has("gravity") { file.gravity.clone().unwrap_or_default() } else { GravityTable::none() };
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
            _ if list.has("mass_scaling") => self.automatic_mass_scaling(loading, material),
            _ => 1.0,
        };
        self.own_tables("", file.own_tables());
        let plasticity = file.plasticity.clone().unwrap_or_default().over(Default::default());
        EffectSet {
            mass_scaling: list.has("mass_scaling").then_some(effects::mass_scaling::Params { factor }),
            gravity: list.has("gravity").then_some(gravity),
            plasticity: list.has("plasticity").then_some(plasticity),
            fibres: list
                .has("fibres")
                .then(|| parameters::fibres_over(&file.fibres.clone().unwrap_or_default(), Default::default())),
            viscoelastic: list.has("viscoelastic").then(|| {
                parameters::viscoelastic_over(&file.viscoelastic.clone().unwrap_or_default(), Default::default())
            }),
            damage: list.has("damage").then(|| {
                parameters::damage_over(&file.damage.clone().unwrap_or_default(), Default::default(), plasticity)
            }),
            cohesive: list.has("cohesive").then_some(cohesive),
            puncture: list.has("puncture").then_some(puncture),
            adhesion: list.has("adhesion").then_some(adhesion),
            indentation: list.has("indentation").then_some(indentation),
            friction: list.has("friction").then_some(friction),
            flexible_needle: flexible,
            own: Vec::new(),
        }
    }

    /// Every word of the list is an effect, once.
    fn listed_effects(&mut self, list: Listed, own: &[&'static OwnEffect]) {
        let keys: Vec<&str> =
            EFFECTS.iter().chain(own.iter().map(|own| &own.effect)).map(|effect| effect.key).collect();
        for (index, key) in list.0.iter().enumerate() {
            if !keys.contains(&key.as_str()) {
                self.unknown_name(&format!("effects.{index}"), "effect", key, &keys);
            } else if list.0[..index].contains(key) {
                self.problems.report(
                    &format!("effects.{index}"),
                    format!("effect `{key}` is listed twice"),
                    "it is either on or not",
                    "remove one of the two",
                );
            }
        }
    }

    /// Touch needs a tool that touches, and friction needs touch.
    fn needs_of_touch(&mut self, list: Listed, tool: &Option<Tool>) {
        let is_needle = matches!(tool, Some(Tool::Needle(_)));
        let is_indenter = tool.is_some() && !is_needle;
        if list.has("puncture") && !is_needle {
            self.problems.report(
                &list.place("puncture"),
                "effect `puncture` needs a needle",
                "no [needle] in this scene",
                "add [needle] with gauge = \"16G\" and tip_half_angle_deg = 18, or remove the effect",
            );
        }
        if list.has("indentation") && !is_indenter {
            self.problems.report(
                &list.place("indentation"),
                "effect `indentation` needs a sphere or a flat punch",
                "no [sphere] or [flat_punch] in this scene",
                "add [sphere] with radius_mm = 5, or remove the effect",
            );
        }
        if list.has("friction") && tool.is_none() {
            self.problems.report(
                &list.place("friction"),
                "effect `friction` needs a tool",
                "nothing to rub on",
                "add [needle], [sphere] or [flat_punch], or remove the effect",
            );
        }
        for (with, key, touch) in [(is_needle, "puncture", "[needle]"), (is_indenter, "indentation", "this tool")] {
            if list.has("friction") && with && !list.has(key) {
                self.problems.report(
                    &list.place("friction"),
                    format!("effect `friction` needs `{key}`: without it {touch} does not touch the tissue"),
                    "nothing to rub on",
                    format!("add \"{key}\" to the list `effects`, or remove \"friction\""),
                );
            }
        }
    }

    /// What the other effects need.
    fn needs_of_effects(&mut self, list: Listed, tool: &Option<Tool>, of_mesh: bool) {
        let is_needle = matches!(tool, Some(Tool::Needle(_)));
        if list.has("flexible_needle") && !(is_needle && list.has("puncture")) {
            self.problems.report(
                &list.place("flexible_needle"),
                "effect `flexible_needle` needs a needle and the effect `puncture`",
                "nothing bends the needle",
                "add [needle] and \"puncture\" to the list `effects`, or remove the effect",
            );
        }
        if list.has("adhesion") && !list.has("puncture") {
            self.problems.report(
                &list.place("adhesion"),
                "effect `adhesion` needs `puncture`: tissue sticks to a tip that is in it",
                "nothing enters the tissue",
                "add \"puncture\" to the list `effects`, or remove \"adhesion\"",
            );
        }
        if list.has("damage") && !list.has("plasticity") {
            self.problems.report(
                &list.place("damage"),
                "effect `damage` needs `plasticity`: it grows with the plastic displacement",
                "nothing drives the damage",
                "add \"plasticity\" to the list `effects`, or remove \"damage\"",
            );
        }
        if of_mesh {
            for key in ["cohesive", "flexible_needle"] {
                if list.has(key) {
                    self.needs_block(&list.place(key), &format!("effect `{key}`"));
                }
            }
        }
    }

    /// Tells of a tool that moves through the tissue without touching it.
    fn without_touch(&mut self, list: Listed, tool: &Option<Tool>) {
        let is_needle = matches!(tool, Some(Tool::Needle(_)));
        let is_indenter = tool.is_some() && !is_needle;
        if is_needle && !list.has("puncture") {
            self.notices.push(
                "The needle does not touch the tissue and feels nothing of it: add \"puncture\" to the list `effects`, or remove \
                 [needle] and [motion]."
                    .into(),
            );
        }
        if is_indenter && !list.has("indentation") {
            self.notices.push(
                "The tool does not touch the tissue and feels nothing of it: add \"indentation\" to the list `effects`, or remove \
                 the tool and [motion]."
                    .into(),
            );
        }
    }

    /// Tells of tables whose effect is not listed.
    fn without_effect(&mut self, list: Listed, file: &SceneFile) {
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
            if present && !list.has(key) {
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
                if present && !list.has(key) {
                    self.notices.push(format!(
                        "Table [region.{key}] of `{}` has no effect: `{key}` is not in the list `effects`.",
                        region.name
                    ));
                }
            }
        }
        if file.solver.mass_scaling.is_some() && !list.has("mass_scaling") {
            self.notices
                .push("`solver.mass_scaling` has no effect: `mass_scaling` is not in the list `effects`.".into());
        }
    }

    /// Adhesion, a bore and a flexible needle need a path that is planned before the run; asked where it is found while the tip moves.
    fn needs_of_a_planned_path(&mut self, list: Listed, tool: &Option<Tool>) {
        if list.has("adhesion") {
            self.problems.report(
                &list.place("adhesion"),
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
        } else if list.has("cohesive") {
            self.notices.push(
                "On a free path the needle opens no cohesive faces: it softens what it passes; planes of [cohesive] still \
                 separate."
                    .into(),
            );
        }
        if list.has("flexible_needle") {
            self.problems.report(
                &list.place("flexible_needle"),
                "a flexible needle keeps to its planned path",
                "with a free motion or puncture.path = \"free\"",
                "move along one straight line, or remove the effect",
            );
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
}
