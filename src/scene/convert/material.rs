//! The tissue law of a scene: its forms, its stability and what is stated twice.

use super::super::file::MaterialTable;
use super::super::{TissueMaterial, presets};
use super::{Check, KPA, MM, Within};
use crate::material::{ElasticLaw, Isochoric, Verdict, describe_verdict, four_digits, ripple_growth_time};

/// Young's modulus above which a material is no soft tissue [Pa].
const LARGEST_TISSUE_MODULUS: f64 = 10.0e6;
/// Density of tissue unless the scene says otherwise [kg/m^3].
const TISSUE_DENSITY: f64 = 1060.0;
/// Share of the shear modulus that goes to c10 unless the scene says otherwise.
const C10_SHARE: f64 = 0.7;

impl Check<'_> {
    /// The tissue law and its verdict. `cell_size` [m] names the ripple in the refusal.
    pub(super) fn material(&mut self, table: &MaterialTable, cell_size: f64) -> TissueMaterial {
        let density = self.optional(
            "material.density_kg_m3",
            table.density_kg_m3,
            1.0,
            TISSUE_DENSITY,
            Within::Between(100.0, 5000.0),
        );
        // Stands in after a reported problem, so that the other tables are still checked; it never leaves `scene`.
        let placeholder = TissueMaterial::new("refused", "", ElasticLaw::mooney_rivlin(1.0, 1.0, 1.0), density);
        // Ranges first: signs of c10 and c01 are the verdict's business.
        for (key, value) in [("c10_kpa", table.c10_kpa), ("c01_kpa", table.c01_kpa)] {
            if let Some(value) = value {
                self.number(&format!("material.{key}"), value, Within::Between(-1e6, 1e6));
            }
        }
        let largest = LARGEST_TISSUE_MODULUS / KPA;
        if let Some(value) = table.youngs_modulus_kpa {
            if value > largest {
                self.refuse_stiff_tissue("material.youngs_modulus_kpa", value * KPA);
            } else {
                self.number("material.youngs_modulus_kpa", value, Within::Positive(largest));
            }
        }
        if let Some(value) = table.bulk_modulus_kpa {
            self.number("material.bulk_modulus_kpa", value, Within::Positive(1e7));
        }
        if let Some(value) = table.d_per_mpa {
            self.number("material.d_per_mpa", value, Within::Between(2e-4, 2e6));
        }
        if let Some(value) = table.poisson_ratio {
            if value >= 0.5 {
                self.problems.report(
                    "material.poisson_ratio",
                    format!("Poisson's ratio {value} means incompressible or worse"),
                    "must be below 0.5",
                    "write 0.45 to 0.495; explicit time steps shrink without limit towards 0.5",
                );
            } else {
                self.number("material.poisson_ratio", value, Within::Between(0.0, 0.4999));
            }
        }
        if let Some(value) = table.c10_share {
            self.number("material.c10_share", value, Within::Between(0.0, 1.0));
        }
        if table.bulk_modulus_kpa.is_some() && table.d_per_mpa.is_some() {
            self.problems.report(
                "material.d_per_mpa",
                "`bulk_modulus_kpa` and `d_per_mpa` say the same thing (K = 2/D)",
                "second of two",
                "keep one of them",
            );
        }
        // Bulk modulus written directly [Pa]; a Poisson's ratio beside it is only compared.
        let direct_bulk = table.bulk_modulus_kpa.map(|k| k * KPA).or(table.d_per_mpa.map(|d| 2.0e6 / d));
        let bulk = |shear: f64| match (direct_bulk, table.poisson_ratio) {
            (Some(bulk), _) => Some(bulk),
            (None, Some(nu)) => Some(presets::bulk_modulus_from_poisson(shear, nu)),
            (None, None) => None,
        };
        let material = match (&table.preset, table.c10_kpa, table.c01_kpa) {
            (Some(name), None, None) if table.youngs_modulus_kpa.is_none() && table.c10_share.is_none() => {
                let Some(preset) = presets::tissue(name) else {
                    let names: Vec<&str> = presets::tissues().iter().map(|p| p.name.as_str()).collect();
                    self.unknown_name("material.preset", "tissue preset", name, &names);
                    return placeholder;
                };
                let mut law = preset.law;
                if let Some(bulk) = bulk(law.shear_modulus()) {
                    self.notices.push(format!(
                        "The bulk modulus {} kPa of preset `{name}` is replaced by {} kPa.",
                        four_digits(law.bulk_modulus / KPA),
                        four_digits(bulk / KPA)
                    ));
                    law.bulk_modulus = bulk;
                }
                TissueMaterial {
                    name: preset.name.clone(),
                    source: format!("{}; valid: {}", preset.source, preset.range),
                    law,
                    density: if table.density_kg_m3.is_some() { density } else { preset.density },
                    ..placeholder
                }
            }
            (Some(_), _, _) => {
                self.problems.report(
                    "material.preset",
                    "a preset and constants of the law exclude each other",
                    "preset beside c10, c01, E or c10_share",
                    "keep `preset` (with density_kg_m3 or one volumetric key at most), or the constants",
                );
                return placeholder;
            }
            (None, Some(c10), Some(c01)) => {
                let shear = 2.0 * (c10 + c01) * KPA;
                let Some(bulk_modulus) = bulk(shear) else {
                    self.problems.report(
                        "material",
                        "the law needs its volumetric part",
                        "no bulk modulus here",
                        "add one of bulk_modulus_kpa, d_per_mpa, poisson_ratio, e.g. poisson_ratio = 0.45",
                    );
                    return placeholder;
                };
                TissueMaterial {
                    name: "constants".into(),
                    source: "c10, c01 of the scene file".into(),
                    law: ElasticLaw::mooney_rivlin(c10 * KPA, c01 * KPA, bulk_modulus),
                    ..placeholder
                }
            }
            (None, None, None) if table.youngs_modulus_kpa.is_some() => {
                let young = table.youngs_modulus_kpa.expect("checked by the guard") * KPA;
                let Some(nu) = table.poisson_ratio else {
                    self.problems.report(
                        "material.youngs_modulus_kpa",
                        "E alone does not fix the law",
                        "no Poisson's ratio beside it",
                        "add poisson_ratio, e.g. poisson_ratio = 0.45",
                    );
                    return placeholder;
                };
                if direct_bulk.is_some() {
                    self.problems.report(
                        "material.youngs_modulus_kpa",
                        "E, nu and a bulk modulus are one number too many",
                        "over-determined",
                        "remove bulk_modulus_kpa or d_per_mpa",
                    );
                }
                TissueMaterial {
                    name: "constants".into(),
                    source: "E and nu of the scene file".into(),
                    law: presets::law_from_youngs_modulus(young, nu, table.c10_share.unwrap_or(C10_SHARE)),
                    ..placeholder
                }
            }
            _ => {
                self.problems.report(
                    "material",
                    "the tissue has no complete law",
                    "incomplete",
                    "write preset = \"across-fibre\", or c10_kpa, c01_kpa and one volumetric key, or youngs_modulus_kpa and poisson_ratio",
                );
                return placeholder;
            }
        };
        self.verdict(table, &material, cell_size);
        material
    }

    fn refuse_stiff_tissue(&mut self, path: &str, modulus: f64) {
        self.problems.report(
            path,
            format!(
                "REFUSED material: Young's modulus {} MPa is not soft tissue (limit 10 MPa)",
                four_digits(modulus * 1e-6)
            ),
            "stiffer than any soft tissue",
            "give the modulus in kPa, muscle is 1 to 100 kPa; the printed 20 GPa of Lv et al. 2022 fits 20 kPa: \
             youngs_modulus_kpa = 20 or preset = \"lv2022-refit\"",
        );
    }

    /// Accepts, limits or refuses the law; compares values that are stated twice.
    fn verdict(&mut self, table: &MaterialTable, material: &TissueMaterial, cell_size: f64) {
        let law = &material.law;
        let place = if table.c01_kpa.is_some() { "material.c01_kpa" } else { "material" };
        match law.verdict() {
            Verdict::Unstable => {
                let (c10, c01) = match law.isochoric {
                    Isochoric::MooneyRivlin(l) => (l.c10 / KPA, l.c01 / KPA),
                    _ => (0.5 * law.shear_modulus() / KPA, 0.0),
                };
                let shear = four_digits(law.shear_modulus() / KPA);
                let growth = match ripple_growth_time(law, material.density, cell_size) {
                    Some(time) => format!(
                        "a {} mm ripple grows e-fold every {} ms; no time step helps",
                        four_digits(cell_size / MM),
                        four_digits(time * 1e3)
                    ),
                    None => "it does not resist shear".into(),
                };
                let lv2022 = if (c10 - 4.75).abs() < 1e-3 && (c01 + 4.91).abs() < 1e-3 {
                    " Printed Table 1 of Lv et al. 2022 has this defect."
                } else {
                    ""
                };
                self.problems.report(
                    place,
                    format!(
                        "REFUSED material: c10 {c10} kPa + c01 {c01} kPa = {} kPa -> ground-state shear modulus {shear} kPa, \
                         must be > 0. The undeformed tissue is unstable ({growth}).{lv2022}",
                        four_digits(c10 + c01)
                    ),
                    "unstable at rest",
                    "write preset = \"lv2022-refit\" (c10 2.3 kPa, c01 1.0 kPa, D 4e-6 1/Pa) instead of the constants, \
                     or constants with c10 + c01 > 0 (allow_limited = true if one of them is negative)",
                );
                return;
            }
            Verdict::StableBelow(_) | Verdict::StableAbove(_) if !table.allow_limited => {
                self.problems.report(
                    place,
                    format!("REFUSED material: one constant is negative: {}", describe_verdict(law)),
                    "limited stability",
                    "write allow_limited = true to accept the limit, or constants that are both >= 0, or preset = \"lv2022-refit\"",
                );
                return;
            }
            Verdict::StableBelow(_) | Verdict::StableAbove(_) => {
                self.notices.push(format!("Limited material: {}.", describe_verdict(law)));
            }
            Verdict::Stable => {}
        }
        if table.youngs_modulus_kpa.is_none() && law.youngs_modulus() > LARGEST_TISSUE_MODULUS {
            self.refuse_stiff_tissue(place, law.youngs_modulus());
        }
        if let (Some(stated), true) =
            (table.poisson_ratio, table.bulk_modulus_kpa.is_some() || table.d_per_mpa.is_some())
            && (stated - law.poisson_ratio()).abs() > 1e-3
        {
            self.notices.push(format!(
                "material.poisson_ratio {stated} disagrees with the law, whose c10, c01 and K give nu {}; the law counts.",
                four_digits(law.poisson_ratio())
            ));
        }
        if let (Some(stated), true) = (table.youngs_modulus_kpa, table.c10_kpa.is_some())
            && (stated * KPA / law.youngs_modulus() - 1.0).abs() > 0.02
        {
            self.notices.push(format!(
                "material.youngs_modulus_kpa {stated} disagrees with the law, whose constants give E {} kPa; the law counts.",
                four_digits(law.youngs_modulus() / KPA)
            ));
        }
        if law.poisson_ratio() > 0.4975 {
            self.notices.push(format!(
                "Poisson's ratio {:.4} is close to 0.5: the stable time step is short and one-point cells may feel too stiff.",
                law.poisson_ratio()
            ));
        }
    }
}
