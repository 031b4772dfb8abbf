//! Tables of effects that are more than plain numbers: relations between their keys, and keys that need the tool, the motion or the
//! tissue.

use glam::{DMat3, DVec3};

use super::super::file::*;
use super::parameters::{all_materials, written_cutting};
use super::{Check, MM, Region, Within};

use crate::effects::cohesive::AXES;
use crate::effects::parameters::Table;
use crate::effects::puncture::{PathWord, SchemeWord};
use crate::effects::{self, EffectSet, TissueMaterial};
use crate::material::demiray::LARGEST_EXPONENT;
use crate::needle::beam::Section;
use crate::needle::free_path::MOST_REGIONS;
use crate::needle::{Motion, Tool};
use crate::penetration::steady::MOST_OPENED;
use crate::units::four_digits;

/// What fibres at the wall of an opened path may store, over what the matrix does there, in a scene that names no scheme: no more than a
/// two-hundredth of the work was lost with 900 times, and with 4,000 times where they stiffen; with some thousand times that hardly stiffen
/// cells turn inside out.
const MOST_FIBRES: f64 = 1000.0;

/// Fibres at the wall of an opened path, which is stretched so many times.
struct WallFibres {
    /// e = stretch^2 - 1, and k2 e^2.
    strain: f64,
    exponent: f64,
    /// What they store, over what the matrix does.
    over_matrix: f64,
}

impl WallFibres {
    /// `None` where there are none.
    fn of(effects: &EffectSet, material: &TissueMaterial, stretch: f64) -> Option<Self> {
        let fibres = effects.fibres.map(|common| material.fibres.unwrap_or(common)).filter(|f| f.k1 > 0.0)?;
        let strain = stretch * stretch - 1.0;
        let exponent = fibres.k2 * strain * strain;
        let grown = if exponent > 1e-9 { exponent.exp_m1() / exponent } else { 1.0 };
        let wall = DMat3::from_diagonal(DVec3::new(stretch - 1.0, 1.0 / stretch - 1.0, 0.0));
        let over_matrix = 0.5 * fibres.k1 * strain * strain * grown / material.law.energy_density(wall);
        Some(WallFibres { strain, exponent, over_matrix })
    }

    /// True where nothing was found to be lost with such fibres.
    fn are_carried(&self) -> bool {
        self.exponent <= LARGEST_EXPONENT && self.over_matrix <= MOST_FIBRES
    }
}

impl Check<'_> {
    pub(super) fn flexible_needle(
        &mut self,
        table: &FlexibleNeedleTable,
        tool: &Option<Tool>,
        motion: &Motion,
        weight: &GravityTable,
    ) -> effects::flexible_needle::Params {
        let mut default = effects::flexible_needle::Params::default();
        // Reported above where there is none.
        let Some(Tool::Needle(needle)) = tool else { return default };
        let at = |key: &str| format!("flexible_needle.{key}");
        let outer_diameter = 2.0 * needle.radius;
        default.beam.section = Section { outer_diameter, inner_diameter: needle.inner_diameter };
        self.ranges("flexible_needle", table);
        let mut params = table.over(default);
        let (length, inner_diameter) = (params.beam.length, params.beam.section.inner_diameter);
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
        if inner_diameter > 0.98 * outer_diameter {
            self.problems.report(
                &at("inner_diameter_mm"),
                format!("the bore of {} mm leaves no wall of {} mm", inner_diameter / MM, outer_diameter / MM),
                "at most 0.98 of the outer diameter",
                "write the inner diameter of the tube, or 0 for a solid needle",
            );
        }
        let elements = table.elements.map_or(params.beam.elements as f64, f64::from);
        params.beam.elements = self.number(&at("elements"), elements, Within::Between(4.0, 200.0)) as usize;
        (params.beam.youngs_modulus, params.beam.density) = (needle.youngs_modulus, needle.density);
        let acceleration = table.gravity_m_s2.or(weight.acceleration_m_s2).unwrap_or([0.0, 0.0, -9.81]);
        params.gravity = self.vector(&at("gravity_m_s2"), acceleration, 1000.0);
        params
    }

    pub(super) fn puncture(&mut self, t: &PunctureTable) -> effects::puncture::Params {
        let mut params = self.table("puncture", t);
        params.always_free = t.path == Some(PathWord::Free);
        // Where none is named: `scheme_of_the_scene`.
        params.scheme = t.scheme.unwrap_or(SchemeWord::Opening);
        params.puncture_stated = t.puncture_force_n.is_some();
        params.cutting_stated = t.cutting_force_n.is_some();
        if params.softened_radius >= params.ring_radius {
            let key = if t.softened_radius_mm.is_some() { "softened_radius_mm" } else { "ring_radius_mm" };
            self.problems.report(
                &format!("puncture.{key}"),
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

    /// The scheme of a scene that names none: `opening`, where nothing is calibrated, unless the scene writes numbers of the other one, asks
    /// for what that alone carries, or leaves out what `opening` needs.
    pub(super) fn scheme_of_the_scene(
        &mut self,
        file: &SceneFile,
        effects: &mut EffectSet,
        tool: Option<&Tool>,
        own: &TissueMaterial,
        regions: &[Region],
    ) {
        let is_named = file.puncture.as_ref().is_some_and(|t| t.scheme.is_some());
        let (Some(Tool::Needle(needle)), false) = (tool, is_named) else { return };
        let without = not_opened(effects, tool);
        let unknown = || {
            all_materials(own, regions)
                .filter(|(_, material)| !material.rigid)
                .find(|(_, material)| !matches!(material.steady(needle), Some(Ok(_))))
        };
        let stretched = || {
            all_materials(own, regions).filter(|(_, material)| !material.rigid).any(|(_, material)| {
                let Some(Ok(steady)) = material.opened(needle) else { return false };
                WallFibres::of(effects, material, steady.wall_stretch()).is_some_and(|fibres| !fibres.are_carried())
            })
        };
        let reason = match (without.first(), unknown()) {
            _ if writes_ring(file) => None,
            (Some(what), _) => Some(format!("the scheme opening does not carry {what} yet")),
            (None, Some((None, _))) => {
                Some("the tissue has no toughness_j_m2 that the scheme opening could take".into())
            }
            (None, Some((Some(i), _))) => {
                Some(format!("region `{}` has no toughness_j_m2 that the scheme opening could take", regions[i].name))
            }
            (None, None) if stretched() => {
                Some("the scheme opening would stretch the fibres beside the path too far".into())
            }
            (None, None) => return,
        };
        let Some(puncture) = &mut effects.puncture else { return };
        puncture.scheme = SchemeWord::Ring;
        if let Some(reason) = reason {
            self.notices
                .push(format!("Forces of the tip are calibrated (puncture.scheme = \"ring\"), since {reason}."));
        }
    }

    /// What the scheme `opening` does not carry yet.
    pub(super) fn opening_limits(&mut self, effects: &EffectSet, tool: Option<&Tool>) {
        if effects.puncture.is_none_or(|p| p.scheme != SchemeWord::Opening) {
            return;
        }
        let found = not_opened(effects, tool);
        if !found.is_empty() {
            self.problems.report(
                "puncture.scheme",
                format!("the scheme opening does not carry {} yet", found.join(", ")),
                "a solid needle in elastic or viscoelastic tissue",
                "write puncture.scheme = \"ring\"",
            );
        }
    }

    /// What does not act in a label map, or before bone, yet.
    pub(super) fn case_limits(&mut self, effects: &EffectSet, motion: &Motion, in_case: bool, regions: &[Region]) {
        if in_case && effects.cohesive.is_some() {
            self.problems.report(
                "effects",
                "the effect cohesive does not act in a label map yet",
                "not in the tissue of a patient",
                "leave it out: a needle on a straight or a free path serves",
            );
        }
        let is_free = effects.puncture.is_some_and(|p| p.always_free) || motion.is_free();
        if is_free && effects.puncture.is_some() && regions.len() > MOST_REGIONS {
            self.problems.report(
                "region",
                format!("{} regions, and the path of the needle is free", regions.len()),
                format!("a free path knows the tip forces of {MOST_REGIONS} regions"),
                "join regions: label = [\"fat\", 6]; or drop puncture.path = \"free\"",
            );
        }
        if motion.is_free() && regions.iter().any(|region| region.material.rigid) {
            self.problems.report(
                "motion",
                "the motion is free, and a region is rigid: nothing would stop the needle there",
                "a planned free path beside bone",
                "plan a straight path, or let a hand lead the needle in the window",
            );
        }
    }

    /// The scheme `opening` takes its numbers from the toughness of every material.
    pub(super) fn opening_toughness(
        &mut self,
        effects: &EffectSet,
        tool: Option<&Tool>,
        own: &TissueMaterial,
        regions: &[Region],
        file: &SceneFile,
    ) {
        let Some(Tool::Needle(needle)) = tool else { return };
        if !self.problems.is_empty() || effects.puncture.is_none_or(|p| p.scheme != SchemeWord::Opening) {
            return;
        }
        for (index, material) in all_materials(own, regions).filter(|(_, material)| !material.rigid) {
            let (at, table) = match index {
                None => ("material".into(), &file.material),
                Some(i) => (format!("region.{i}.material"), &file.region[i].material),
            };
            let whose = index.map_or("the tissue".into(), |i| format!("region `{}`", regions[i].name));
            if let Some(Ok(steady)) = material.steady(needle)
                && steady.wall_stretch() > MOST_OPENED
            {
                self.notices.push(format!(
                    "{whose}: its toughness would stretch the wall of the path {} times; the scheme opening carries {MOST_OPENED}, and the \
                     tip takes what the tissue within would hold. tear_stretch says where tissue tears.",
                    four_digits(steady.wall_stretch())
                ));
            }
            match material.opened(needle) {
                Some(Ok(steady)) => self.opened_fibres(effects, material, &at, steady.wall_stretch()),
                None => self.problems.report(
                    &at,
                    format!("the scheme opening takes its forces from the toughness, and {whose} has none"),
                    "no toughness_j_m2",
                    format!(
                        "write {at}.toughness_j_m2, e.g. 164 (bovine liver under needles), or puncture.scheme = \"ring\" for \
                         calibrated forces"
                    ),
                ),
                Some(Err(error)) => {
                    let key = if table.toughness_j_m2.is_some() { ".toughness_j_m2" } else { "" };
                    self.problems.report(
                        &format!("{at}{key}"),
                        format!("the toughness of {whose} gives the scheme opening no forces: {error}"),
                        "no answer",
                        "write a toughness_j_m2 in the range that is named, or puncture.scheme = \"ring\" for calibrated forces",
                    );
                }
            }
        }
    }

    /// Fibres at the wall of an opened path, which is stretched so many times, must not be beyond the exponential of their law: what continues
    /// it there would store more than the whole needle gives.
    fn opened_fibres(&mut self, effects: &EffectSet, material: &TissueMaterial, at: &str, stretch: f64) {
        let Some(WallFibres { strain, exponent, .. }) = WallFibres::of(effects, material, stretch) else { return };
        let most = LARGEST_EXPONENT;
        if exponent > most {
            let key = if material.fibres.is_some() { format!("{at}.fibres.k2") } else { "fibres.k2".into() };
            self.problems.report(
                &key,
                format!(
                    "the scheme opening would stretch these fibres {stretch:.1} times beside the path, where the exponent of their law is \
                     {exponent:.0}"
                ),
                format!("an exponent k2 e^2 of at most {most}"),
                format!(
                    "write {key} of at most {:.1e}, a tear_stretch of the material, or puncture.scheme = \"ring\"",
                    most / (strain * strain)
                ),
            );
        }
    }

    pub(super) fn cohesive(&mut self, t: &CohesiveTable, tissue: &TissueTable) -> effects::cohesive::Params {
        let at = |key: &str| format!("cohesive.{key}");
        if t.penalty_factor.is_some() && t.penalty_pa_m.is_some() {
            self.problems.report(
                &at("penalty_factor"),
                "the faces have two penalty stiffnesses",
                "`penalty_factor` and `penalty_pa_m`",
                "keep one of them",
            );
        }
        let mut params = self.table("cohesive", t);
        // Shear is as strong and as tough as opening unless written.
        if t.shear_strength_kpa.is_none() {
            params.shear_strength = params.strength;
        }
        if t.shear_energy_j_m2.is_none() {
            params.shear_energy = params.energy;
        }
        params.penalty = t.penalty_pa_m.map(|value| self.number(&at("penalty_pa_m"), value, Within::Positive(1e15)));
        let size = tissue.size_mm.unwrap_or([1000.0; 3]);
        params.planes = t
            .plane
            .iter()
            .enumerate()
            .filter_map(|(index, plane)| {
                let path = at(&format!("plane.{index}"));
                let Some(axis) = AXES.iter().position(|a| *a == plane.axis) else {
                    self.unknown_name(&format!("{path}.axis"), "axis", &plane.axis, &AXES);
                    return None;
                };
                let half = 0.5 * size[axis];
                let (low, high) = if axis == 2 { (-size[2], 0.0) } else { (-half, half) };
                let margin = 1e-3 * (high - low);
                let value =
                    self.number(&format!("{path}.at_mm"), plane.at_mm, Within::Between(low + margin, high - margin));
                Some(effects::cohesive::Plane { axis, at: value * MM, tip_driven: plane.tip_driven })
            })
            .collect();
        params
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

    pub(super) fn adhesion(&mut self, t: &AdhesionTable) -> effects::adhesion::Params {
        let params = self.table("adhesion", t);
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
}

/// What of a scene the scheme `opening` does not carry yet.
fn not_opened(effects: &EffectSet, tool: Option<&Tool>) -> Vec<&'static str> {
    let is_hollow = matches!(tool, Some(Tool::Needle(needle)) if needle.bore.is_some());
    let without = [
        (effects.cohesive.is_some(), "the effect cohesive"),
        (effects.plasticity.is_some(), "the effect plasticity"),
        (effects.damage.is_some(), "the effect damage"),
        (!effects.own.is_empty(), "effects of the program's own"),
        (is_hollow, "a hollow needle"),
    ];
    without.into_iter().filter(|(there, _)| *there).map(|(_, what)| what).collect()
}

/// True where a scene writes forces of the tip, or numbers of the scheme `ring`.
fn writes_ring(file: &SceneFile) -> bool {
    let in_puncture = file.puncture.as_ref().is_some_and(|t| {
        let forces = t.puncture_force_n.or(t.cutting_force_n);
        let radii = t.softened_radius_mm.or(t.ring_radius_mm);
        forces.or(radii).or(t.residual_stiffness).or(t.contact_stiffness_factor).is_some()
    });
    let beside = |table: &RegionTable| {
        table.puncture_force_n.is_some() || table.cutting_force_n.is_some() || table.cutting_energy_j_m2.is_some()
    };
    let tables = file.region.iter().map(|region| &region.material).chain([&file.material]);
    in_puncture
        || file.region.iter().any(beside)
        || tables.into_iter().any(|t| written_cutting(t) != CuttingTable::default())
}
