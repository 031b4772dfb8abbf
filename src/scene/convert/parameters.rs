//! Parameters of the effects that a material may have of its own: plasticity, fibres, viscoelastic, damage, and the tip
//! forces. What a table leaves out comes from below: region over preset over scene over default.

use glam::DVec3;

use super::super::Region;
use super::super::file::*;
use super::super::tissue_preset::TissuePreset;
use super::{Check, KPA, MM, Within};
use crate::effects::parameters::Table;
use crate::effects::puncture::Cutting;
use crate::effects::{self, EffectSet, TissueMaterial, damage, fibres, plasticity, viscoelastic};
use crate::units::four_digits;

/// The plastic displacement that Lv et al. 2022 print without a unit, read as mm [m].
const PRINTED_FAILURE_DISPLACEMENT: f64 = 4e-9;

pub fn fibres_over(table: &FibresTable, base: fibres::Params) -> fibres::Params {
    let written = table.direction.map(|d| DVec3::from(d).normalize_or_zero());
    fibres::Params { direction: written.unwrap_or(base.direction), ..table.over(base) }
}

pub fn viscoelastic_over(table: &ViscoelasticTable, base: viscoelastic::Params) -> viscoelastic::Params {
    let (Some(g), Some(tau)) = (&table.g, &table.tau_s) else { return base };
    let term = |(ratio, time): (&f64, &f64)| viscoelastic::Term { ratio: *ratio, time: *time };
    viscoelastic::Params { terms: g.iter().zip(tau).map(term).collect() }
}

/// A fracture energy becomes a displacement with the flow stress at onset: `u_f = 2 G_f/sigma`.
pub fn damage_over(table: &DamageTable, base: damage::Params, flow: plasticity::Params) -> damage::Params {
    let mut params = table.over(base);
    if let (None, Some(energy)) = (table.failure_displacement_mm, table.fracture_energy_j_m2) {
        params.failure_displacement = 2.0 * energy / flow_stress(flow, params.onset);
    }
    params.deletion = table.deletion.unwrap_or(base.deletion);
    params
}

/// Flow stress at the plastic strain `alpha` [Pa].
fn flow_stress(flow: plasticity::Params, alpha: f64) -> f64 {
    flow.yield_stress + flow.hardening * alpha
}

/// The tables that one place may write: the scene, a region or a preset.
#[derive(Clone, Copy, Default)]
pub struct OwnTables<'a> {
    pub plasticity: Option<&'a PlasticityTable>,
    pub fibres: Option<&'a FibresTable>,
    pub viscoelastic: Option<&'a ViscoelasticTable>,
    pub damage: Option<&'a DamageTable>,
}

macro_rules! own_tables_of {
    ($($place:ty),*) => {$(
        impl $place {
            pub(super) fn own_tables(&self) -> OwnTables<'_> {
                OwnTables {
                    plasticity: self.plasticity.as_ref(),
                    fibres: self.fibres.as_ref(),
                    viscoelastic: self.viscoelastic.as_ref(),
                    damage: self.damage.as_ref(),
                }
            }
        }
    )*};
}

own_tables_of!(SceneFile, RegionTable, LibraryMaterial, TissuePreset);

/// The tables of a preset, if there is one.
pub fn of_preset(preset: Option<&TissuePreset>) -> OwnTables<'_> {
    preset.map(TissuePreset::own_tables).unwrap_or_default()
}

/// Settles what `material` has of its own: `layers`, lowest first, key by key over `base`. A material whose parameters
/// are those of the scene keeps `None`.
pub fn settle(material: &mut TissueMaterial, layers: &[OwnTables], base: &EffectSet, scene: &EffectSet) {
    let mut flow = base.plasticity.unwrap_or_default();
    for table in layers.iter().filter_map(|t| t.plasticity) {
        flow = table.over(flow);
    }
    let mut fibres = base.fibres.unwrap_or_default();
    for table in layers.iter().filter_map(|t| t.fibres) {
        fibres = fibres_over(table, fibres);
    }
    let mut viscoelastic = base.viscoelastic.clone().unwrap_or_default();
    for table in layers.iter().filter_map(|t| t.viscoelastic) {
        viscoelastic = viscoelastic_over(table, viscoelastic);
    }
    let mut damage = base.damage.unwrap_or_default();
    for table in layers.iter().filter_map(|t| t.damage) {
        damage = damage_over(table, damage, flow);
    }
    material.plasticity = (flow != scene.plasticity.unwrap_or_default()).then_some(flow);
    material.fibres = (fibres != scene.fibres.unwrap_or_default()).then_some(fibres);
    material.viscoelastic = (viscoelastic != scene.viscoelastic.clone().unwrap_or_default()).then_some(viscoelastic);
    material.damage = (damage != scene.damage.unwrap_or_default()).then_some(damage);
}

impl Check<'_> {
    /// Ranges of all tables of one place; `at` is empty or ends in a dot.
    pub(super) fn own_tables(&mut self, at: &str, tables: OwnTables) {
        if let Some(t) = tables.plasticity {
            self.plasticity_table(&format!("{at}plasticity"), t);
        }
        if let Some(t) = tables.fibres {
            self.fibres_table(&format!("{at}fibres"), t);
        }
        if let Some(t) = tables.viscoelastic {
            self.viscoelastic_table(&format!("{at}viscoelastic"), t);
        }
        if let Some(t) = tables.damage {
            self.damage_table(&format!("{at}damage"), t);
        }
    }

    pub(super) fn plasticity_table(&mut self, at: &str, table: &PlasticityTable) {
        if table.yield_stress_kpa == Some(0.0) {
            self.problems.report(
                &format!("{at}.yield_stress_kpa"),
                "a zero yield stress leaves no elastic stage; the paper sets it to zero",
                "must be greater than 0",
                "write the end of the second stage, the stress at which the curve bends: 23.4 across the fibres, \
                 75 along them",
            );
            // Zero has words of its own.
            return self.ranges(at, &PlasticityTable { yield_stress_kpa: None, ..table.clone() });
        }
        self.ranges(at, table);
    }

    pub(super) fn fibres_table(&mut self, at: &str, table: &FibresTable) {
        if let Some(direction) = table.direction {
            let direction = self.vector(&format!("{at}.direction"), direction, 1e6);
            if direction.normalize_or_zero() == DVec3::ZERO {
                self.problems.report(
                    &format!("{at}.direction"),
                    "the fibres have no direction: the vector is zero",
                    "must not be zero",
                    "write a vector of any length, e.g. direction = [1, 0, 0]",
                );
            }
        }
        self.ranges(at, table);
    }

    pub(super) fn viscoelastic_table(&mut self, at: &str, table: &ViscoelasticTable) {
        const LARGEST: usize = viscoelastic::LARGEST_TERM_COUNT;
        let (g, tau) = match (&table.g, &table.tau_s) {
            (Some(g), Some(tau)) => (g, tau),
            (None, None) => return,
            (g, _) => {
                let (present, absent) = if g.is_some() { ("g", "tau_s") } else { ("tau_s", "g") };
                self.problems.report(
                    &format!("{at}.{present}"),
                    format!("the series has `{present}` and no `{absent}`"),
                    "one list of two",
                    "write both lists, e.g. g = [0.25, 0.15] and tau_s = [0.5, 5.0], or none",
                );
                return;
            }
        };
        if g.len() != tau.len() || g.is_empty() || g.len() > LARGEST {
            self.problems.report(
                &format!("{at}.tau_s"),
                format!("the series has {} shares and {} times", g.len(), tau.len()),
                format!("as many times as shares, 1 to {LARGEST}"),
                "write one relaxation time per share, e.g. g = [0.25, 0.15] and tau_s = [0.5, 5.0]",
            );
        }
        for (index, value) in g.iter().enumerate() {
            self.number(&format!("{at}.g.{index}"), *value, Within::Positive(1.0));
        }
        for (index, value) in tau.iter().enumerate() {
            self.number(&format!("{at}.tau_s.{index}"), *value, Within::Between(1e-4, 1e6));
        }
        let sum: f64 = g.iter().sum();
        if sum >= 1.0 {
            self.problems.report(
                &format!("{at}.g"),
                format!("the shares add up to {}: at rest nothing would be left of the stress", four_digits(sum)),
                "the sum must be below 1",
                "write smaller shares, e.g. g = [0.25, 0.15, 0.10]: half of the stress stays",
            );
        }
    }

    pub(super) fn damage_table(&mut self, at: &str, table: &DamageTable) {
        // The largest damage lies inside its range, not at its ends.
        self.ranges(at, &DamageTable { d_max: None, ..table.clone() });
        if let Some(value) = table.fracture_energy_j_m2 {
            self.number(&format!("{at}.fracture_energy_j_m2"), value, Within::Positive(1e6));
        }
        if table.failure_displacement_mm.is_some() && table.fracture_energy_j_m2.is_some() {
            self.problems.report(
                &format!("{at}.fracture_energy_j_m2"),
                "`failure_displacement_mm` and `fracture_energy_j_m2` say the same thing (u_f = 2 G_f/sigma)",
                "second of two",
                "keep one of them",
            );
        }
        if let Some(value) = table.d_max
            && !(value > 0.0 && value < 1.0)
        {
            self.problems.report(
                &format!("{at}.d_max"),
                format!("`{at}.d_max` is {value}"),
                "must be greater than 0 and below 1",
                "write the part of the stress that a cell can lose, e.g. d_max = 0.95; deletion = true removes the rest",
            );
        }
    }

    /// The flow of `material` after onset is resolved by cells of edge `cell_size` [m]: `L_e < E u_f/sigma`.
    pub(super) fn snap_back(
        &mut self,
        file: &SceneFile,
        index: Option<usize>,
        material: &TissueMaterial,
        cell: f64,
        effects: &EffectSet,
    ) {
        let (Some(flow), Some(damage)) = (effects.plasticity, effects.damage) else { return };
        let flow = material.plasticity.unwrap_or(flow);
        let damage = material.damage.unwrap_or(damage);
        let sigma = flow_stress(flow, damage.onset);
        let limit = damage_limit(material, effects);
        if cell < limit {
            return;
        }
        let place = match index {
            Some(i) if file.region[i].damage.is_some() => format!("region.{i}.damage"),
            _ if file.damage.is_some() => "damage".into(),
            _ => format!("effects.{}", file.effects.iter().position(|key| key == "damage").unwrap_or(0)),
        };
        let table = index.and_then(|i| file.region[i].damage.as_ref()).or(file.damage.as_ref());
        let own_word = index.and_then(|i| file.region[i].damage.as_ref()).and_then(|t| t.allow_brittle);
        let whose = index.map(|i| format!(" in region `{}`", file.region[i].name)).unwrap_or_default();
        let u_f = damage.failure_displacement;
        if own_word.or(file.damage.as_ref().and_then(|t| t.allow_brittle)) == Some(true) {
            self.notices.push(format!(
                "Damage{whose} breaks brittly: with {} mm cells and a failure displacement of {} mm (limit {:.2e} m) the \
                 softening branch snaps back, the break is dynamic and its dissipation is what the kinetic energy and \
                 damping take.",
                four_digits(cell / MM),
                four_digits(u_f / MM),
                limit
            ));
            return;
        }
        let by_energy = table.is_some_and(|t| t.fracture_energy_j_m2.is_some());
        let key = if by_energy { "fracture_energy_j_m2" } else { "failure_displacement_mm" };
        let enough = 1.05 * sigma * cell / material.law.youngs_modulus();
        let value = if by_energy { 0.5 * sigma * enough } else { enough / MM };
        let printed = if (u_f / PRINTED_FAILURE_DISPLACEMENT - 1.0).abs() < 0.01 {
            " Lv et al. 2022 print 4e-6 without a unit."
        } else {
            ""
        };
        // Nobody meshes below a tenth of a millimetre to keep a displacement that is too small.
        let finer = match four_digits(limit / MM) {
            limit if limit < 0.1 => String::new(),
            limit => format!(", or a cell_size_mm below {limit}"),
        };
        self.problems.report(
            &format!("{place}.{key}"),
            format!(
                "REFUSED damage{whose}: failure displacement {} mm dissipates {:.2e} J/m^2 at {} kPa; with {} mm cells the \
                 softening branch snaps back (limit {:.2e} m).{printed}",
                four_digits(u_f / MM),
                0.5 * sigma * u_f,
                four_digits(sigma / KPA),
                four_digits(cell / MM),
                limit
            ),
            "a cell must be smaller than E u_f/sigma",
            format!(
                "write {key} of at least {}{finer}, or allow_brittle = true for a dynamic break",
                four_digits(value)
            ),
        );
    }

    /// Ranges of the tip forces.
    pub(super) fn cutting_table(&mut self, at: &str, table: &CuttingTable) {
        for (key, value, most) in [
            ("puncture_force_n", table.puncture_force_n, 100.0),
            ("cutting_force_n", table.cutting_force_n, 100.0),
            ("cutting_energy_j_m2", table.cutting_energy_j_m2, 1e5),
        ] {
            if let Some(value) = value {
                self.number(&format!("{at}.{key}"), value, Within::Positive(most));
            }
        }
        if table.cutting_force_n.is_some() && table.cutting_energy_j_m2.is_some() {
            self.problems.report(
                &format!("{at}.cutting_energy_j_m2"),
                "`cutting_force_n` and `cutting_energy_j_m2` say the same thing (F_cut = G_c times the needle diameter)",
                "second of two",
                "keep one of them",
            );
        }
    }
}

/// Largest edge of a cell whose softening branch does not snap back, `E u_f/sigma` [m].
pub fn damage_limit(material: &TissueMaterial, effects: &EffectSet) -> f64 {
    let flow = material.plasticity.or(effects.plasticity).unwrap_or_default();
    let damage = material.damage.or(effects.damage).unwrap_or_default();
    material.law.youngs_modulus() * damage.failure_displacement / flow_stress(flow, damage.onset)
}

/// Tip forces from what is written; `None` where that says nothing. `diameter` [m]: of the needle. The force that is
/// missing keeps the ratio of the scene's two.
pub fn cutting(table: &CuttingTable, diameter: Option<f64>, scene: &effects::puncture::Params) -> Option<Cutting> {
    let ratio = scene.puncture_force / scene.cutting_force;
    let by_energy = table.cutting_energy_j_m2.zip(diameter).map(|(energy, diameter)| energy * diameter);
    match (table.puncture_force_n, table.cutting_force_n.or(by_energy)) {
        (None, None) => None,
        (Some(puncture_force), Some(cutting_force)) => Some(Cutting { puncture_force, cutting_force }),
        (Some(puncture_force), None) => Some(Cutting { puncture_force, cutting_force: puncture_force / ratio }),
        (None, Some(cutting_force)) => Some(Cutting { puncture_force: cutting_force * ratio, cutting_force }),
    }
}

/// What a material table or a region writes about the tip forces.
pub fn written_cutting(material: &MaterialTable) -> CuttingTable {
    CuttingTable {
        puncture_force_n: material.puncture_force_n,
        cutting_force_n: material.cutting_force_n,
        cutting_energy_j_m2: material.cutting_energy_j_m2,
    }
}

/// The tip forces of a preset.
pub fn preset_cutting(preset: Option<&TissuePreset>) -> CuttingTable {
    preset.and_then(|preset| preset.cutting).unwrap_or_default()
}

/// All materials of a scene with the index of their region.
pub fn all_materials<'a>(
    own: &'a TissueMaterial,
    regions: &'a [Region],
) -> impl Iterator<Item = (Option<usize>, &'a TissueMaterial)> {
    std::iter::once((None, own)).chain(regions.iter().enumerate().map(|(i, r)| (Some(i), &r.material)))
}
