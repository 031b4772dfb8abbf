//! A tissue material of a scene or a library: its forms, its stability and what is stated twice.

use super::super::file::MaterialTable;
use super::super::presets;
use super::super::tissue_preset::TissuePreset;
use super::{Check, KPA, MM, Within, library};
use crate::effects::TissueMaterial;
use crate::material::law::{constants, owners};
use crate::material::{ElasticLaw, Isochoric, LawWord, NeoHookean, Verdict, describe_verdict, ripple_growth_time};
use crate::reading;
use crate::units::four_digits;

/// Young's modulus above which a material is no soft tissue [Pa].
const LARGEST_TISSUE_MODULUS: f64 = 10.0e6;
/// Density of tissue unless the scene says otherwise [kg/m^3].
const TISSUE_DENSITY: f64 = 1060.0;
/// Share of the shear modulus that goes to c10 unless the scene says otherwise.
const C10_SHARE: f64 = 0.7;

/// Bulk modulus that is written directly [Pa].
fn direct_bulk(table: &MaterialTable) -> Option<f64> {
    table.bulk_modulus_kpa.map(|k| k * KPA).or(table.d_per_mpa.map(|d| 2.0e6 / d))
}

/// Bulk modulus of a law with the shear modulus `shear` [Pa]; a Poisson's ratio beside K or D is only compared.
fn bulk_modulus(table: &MaterialTable, shear: f64) -> Option<f64> {
    direct_bulk(table).or(table.poisson_ratio.map(|nu| presets::bulk_modulus_from_poisson(shear, nu)))
}

impl Check<'_> {
    /// The material at the path `at` and the preset that it comes from. `cell_size` [m] names the ripple in the refusal.
    pub(super) fn material(
        &mut self,
        at: &str,
        table: &MaterialTable,
        cell_size: f64,
    ) -> (TissueMaterial, Option<TissuePreset>) {
        let density = self.density(at, table.density_kg_m3);
        // Stands in after a reported problem, so that the other tables are still checked; it never leaves `scene`.
        let placeholder = TissueMaterial::new("refused", "", ElasticLaw::mooney_rivlin(1.0, 1.0, 1.0), density);
        self.material_ranges(at, table);
        // A volumetric part out of its range, such as a Poisson's ratio of 0.5, makes no law that a verdict could speak of.
        let in_range = table.poisson_ratio.is_none_or(|nu| (0.0..0.5).contains(&nu))
            && [table.bulk_modulus_kpa, table.d_per_mpa, table.youngs_modulus_kpa].iter().flatten().all(|x| *x > 0.0);
        let Some(name) = &table.preset else {
            if table.library.is_some() {
                self.notices.push(format!("`{at}.library` has no effect without a preset."));
            }
            let Some(law) = self.law(at, table) else { return (placeholder, None) };
            let written: Vec<&str> = table.constants().iter().filter_map(|(k, v)| v.map(|_| *k)).collect();
            let origin = if written.is_empty() { "E and nu".into() } else { written.join(", ").replace("_kpa", "") };
            let mut material = TissueMaterial::new("constants", format!("{origin} of the scene file"), law, density);
            (material.toughness, material.tear_stretch) = (table.toughness_j_m2, table.tear_stretch);
            if in_range {
                self.verdict(at, table, &material, cell_size);
            }
            return (material, None);
        };
        let constant = table.constants().iter().find_map(|(key, value)| value.map(|_| *key));
        let other = [
            ("law", table.law.is_some()),
            ("youngs_modulus_kpa", table.youngs_modulus_kpa.is_some()),
            ("c10_share", table.c10_share.is_some()),
        ];
        if let Some(key) = constant.or(other.iter().find_map(|(key, on)| on.then_some(*key))) {
            self.problems.report(
                &format!("{at}.preset"),
                "a preset and constants of the law exclude each other",
                format!("preset beside {key}"),
                "keep `preset` (with density_kg_m3 or one volumetric key at most), or the constants",
            );
            return (placeholder, None);
        }
        let Some(preset) = self.preset(at, name, table.library.as_deref()) else { return (placeholder, None) };
        let mut law = preset.law;
        if let Some(bulk) = bulk_modulus(table, law.shear_modulus()) {
            self.notices.push(format!(
                "The bulk modulus {} kPa of preset `{name}` is replaced by {} kPa.",
                four_digits(law.bulk_modulus / KPA),
                four_digits(bulk / KPA)
            ));
            law.bulk_modulus = bulk;
        }
        let range = preset.range.as_ref().map(|range| format!("; valid: {range}")).unwrap_or_default();
        let density = if table.density_kg_m3.is_some() { density } else { preset.density };
        let mut material = TissueMaterial::new(&preset.name, format!("{}{range}", preset.source), law, density);
        material.toughness = table.toughness_j_m2.or(preset.toughness);
        material.tear_stretch = table.tear_stretch.or(preset.tear_stretch);
        if in_range {
            self.verdict(at, table, &material, cell_size);
        }
        (material, Some(preset))
    }

    /// The preset called `name`, from the built-in library or from the file `library`.
    fn preset(&mut self, at: &str, name: &str, library: Option<&str>) -> Option<TissuePreset> {
        let Some(library) = library else {
            if let Some(preset) = presets::tissue(name) {
                return Some(preset.clone());
            }
            self.unknown_preset(&format!("{at}.preset"), "tissue preset", name, presets::tissues());
            return None;
        };
        let path = self.folder.join(library);
        let place = format!("{at}.library");
        let source = match reading::text(&path, reading::most::SCENE) {
            Ok(source) => source,
            Err(error) => {
                self.problems.report(
                    &place,
                    format!("cannot read the material library {}: {error}", path.display()),
                    "not readable",
                    error.way_out(
                        "write its path relative to the scene file, e.g. library = \"my_materials.toml\", \
                         or remove the key to use the built-in presets",
                    ),
                );
                return None;
            }
        };
        match library::read(&path, &source) {
            Err(text) => {
                self.problems.append(&place, text);
                None
            }
            Ok(presets) => {
                let found = presets::found(&presets, name);
                if found.is_none() {
                    let what = format!("material in {}", path.display());
                    self.unknown_preset(&format!("{at}.preset"), &what, name, &presets);
                }
                found.cloned()
            }
        }
    }

    /// Lists the names alone; the nearest one may be an alias.
    fn unknown_preset(&mut self, path: &str, what: &str, name: &str, presets: &[TissuePreset]) {
        let list = presets.iter().map(|preset| preset.name.as_str()).collect::<Vec<_>>().join(", ");
        let way_out = match presets::near_name(presets, name) {
            Some(near) => format!("did you mean \"{near}\"? There are: {list}"),
            None => format!("use one of: {list}"),
        };
        self.problems.report(path, format!("there is no {what} called \"{name}\""), "unknown name", way_out);
    }

    /// Density [kg/m^3].
    pub(super) fn density(&mut self, at: &str, written: Option<f64>) -> f64 {
        self.optional(&format!("{at}.density_kg_m3"), written, 1.0, TISSUE_DENSITY, Within::Between(100.0, 5000.0))
    }

    /// Ranges of all numbers of the law; the signs of its constants are the verdict's business.
    pub(super) fn material_ranges(&mut self, at: &str, table: &MaterialTable) {
        let path = |key: &str| format!("{at}.{key}");
        let known = constants();
        for (key, value) in table.constants() {
            let constant = known.iter().find(|constant| constant.key == key);
            if let (Some(value), Some(constant)) = (value, constant) {
                self.number(&path(key), value, Within::Between(-constant.largest, constant.largest));
            }
        }
        let largest = LARGEST_TISSUE_MODULUS / KPA;
        if let Some(value) = table.youngs_modulus_kpa {
            if value > largest {
                self.refuse_stiff_tissue(&path("youngs_modulus_kpa"), value * KPA);
            } else {
                self.number(&path("youngs_modulus_kpa"), value, Within::Positive(largest));
            }
        }
        if let Some(value) = table.bulk_modulus_kpa {
            self.number(&path("bulk_modulus_kpa"), value, Within::Positive(1e7));
        }
        if let Some(value) = table.d_per_mpa {
            self.number(&path("d_per_mpa"), value, Within::Between(2e-4, 2e6));
        }
        if let Some(value) = table.poisson_ratio {
            if value >= 0.5 {
                self.problems.report(
                    &path("poisson_ratio"),
                    format!("Poisson's ratio {value} means incompressible or worse"),
                    "must be below 0.5",
                    "write 0.45 to 0.495; explicit time steps shrink without limit towards 0.5",
                );
            } else {
                self.number(&path("poisson_ratio"), value, Within::Between(0.0, 0.4999));
            }
        }
        if let Some(value) = table.c10_share {
            self.number(&path("c10_share"), value, Within::Between(0.0, 1.0));
        }
        if let Some(value) = table.toughness_j_m2 {
            self.number(&path("toughness_j_m2"), value, Within::Positive(1e6));
        }
        if let Some(value) = table.tear_stretch {
            self.number(&path("tear_stretch"), value, Within::Between(1.01, 100.0));
        }
        if table.bulk_modulus_kpa.is_some() && table.d_per_mpa.is_some() {
            self.problems.report(
                &path("d_per_mpa"),
                "`bulk_modulus_kpa` and `d_per_mpa` say the same thing (K = 2/D)",
                "second of two",
                "keep one of them",
            );
        }
    }

    /// The law from its constants or from E and nu; `None` after a reported problem.
    pub(super) fn law(&mut self, at: &str, table: &MaterialTable) -> Option<ElasticLaw> {
        let word = table.law.unwrap_or(LawWord::MooneyRivlin);
        if self.reports_foreign_constants(at, table, word) {
            return None;
        }
        let written = table.constants();
        let value = |key: &str| written.iter().find(|(k, _)| *k == key).and_then(|(_, value)| *value);
        let keys = word.law().keys();
        let missing: Vec<&str> = keys.iter().copied().filter(|key| value(key).is_none()).collect();
        if missing.len() == keys.len() {
            return self.law_from_moduli(at, table, word);
        }
        if !missing.is_empty() {
            self.problems.report(
                at,
                format!("the law {} has no {}", word.law().key, missing.join(" and no ")),
                "incomplete",
                format!("add {} (0 is a value), or write preset = \"across-fibre\"", missing.join(" and ")),
            );
            return None;
        }
        let isochoric = word.law().with(|key| value(key).unwrap_or_default());
        let Some(bulk_modulus) = bulk_modulus(table, isochoric.shear_modulus()) else {
            self.problems.report(
                at,
                "the law needs its volumetric part",
                "no bulk modulus here",
                "add one of bulk_modulus_kpa, d_per_mpa, poisson_ratio, e.g. poisson_ratio = 0.45",
            );
            return None;
        };
        if table.c10_share.is_some() {
            self.notices.push(format!("`{at}.c10_share` has no effect: the constants are given."));
        }
        Some(ElasticLaw { isochoric, bulk_modulus })
    }

    /// Reports constants of other laws; true where there is one.
    fn reports_foreign_constants(&mut self, at: &str, table: &MaterialTable, word: LawWord) -> bool {
        let (name, keys) = (word.law().key, word.law().keys());
        let mut found = false;
        for (key, value) in table.constants() {
            if value.is_none() || keys.contains(&key) {
                continue;
            }
            found = true;
            let names: Vec<&str> = owners(key).map(|law| law.key).collect();
            let this = match table.law {
                Some(_) => format!("this material is {name}"),
                None => format!("without the key `law` a material is {name}"),
            };
            let laws: Vec<String> = names.iter().map(|name| format!("law = \"{name}\"")).collect();
            self.problems.report(
                &format!("{at}.{key}"),
                format!("`{key}` belongs to {}, and {this}", names.join(" and ")),
                "constant of another law",
                format!("write {}, or remove {key}; {name} has {}", laws.join(" or "), keys.join(", ")),
            );
        }
        found
    }

    /// Neo-Hookean or Mooney-Rivlin from E and nu.
    fn law_from_moduli(&mut self, at: &str, table: &MaterialTable, word: LawWord) -> Option<ElasticLaw> {
        let path = format!("{at}.youngs_modulus_kpa");
        let (law, keys) = (word.law(), word.law().keys().join(", "));
        let Some(young) = table.youngs_modulus_kpa.map(|e| e * KPA) else {
            let way_out = match (table.law, word) {
                (None, _) => "write preset = \"across-fibre\", or law with its constants and one volumetric key, or \
                     youngs_modulus_kpa and poisson_ratio"
                    .into(),
                (_, LawWord::NeoHookean | LawWord::MooneyRivlin) => {
                    format!("write {keys} and one volumetric key, or youngs_modulus_kpa and poisson_ratio")
                }
                _ => format!("write {keys} and one volumetric key, e.g. poisson_ratio = 0.45"),
            };
            self.problems.report(at, "the tissue has no complete law", "incomplete", way_out);
            return None;
        };
        if !matches!(word, LawWord::NeoHookean | LawWord::MooneyRivlin) {
            let shear = young / (2.0 * (1.0 + table.poisson_ratio.unwrap_or(0.45)));
            let first = law.constants[0];
            let start = format!("{} = {}", first.key, four_digits(shear / law.shear_of_first() / first.si));
            self.problems.report(
                &path,
                format!("E and nu do not fix the law {}: they say nothing about its stiffening", law.key),
                "for neo_hookean and mooney_rivlin only",
                format!("write its constants instead, {keys}; this E means {start} at rest; keep poisson_ratio"),
            );
            return None;
        }
        let Some(nu) = table.poisson_ratio else {
            self.problems.report(
                &path,
                "E alone does not fix the law",
                "no Poisson's ratio beside it",
                "add poisson_ratio, e.g. poisson_ratio = 0.45",
            );
            return None;
        };
        if direct_bulk(table).is_some() {
            self.problems.report(
                &path,
                "E, nu and a bulk modulus are one number too many",
                "over-determined",
                "remove bulk_modulus_kpa or d_per_mpa",
            );
        }
        if word == LawWord::MooneyRivlin {
            return Some(presets::law_from_youngs_modulus(young, nu, table.c10_share.unwrap_or(C10_SHARE)));
        }
        if table.c10_share.is_some() {
            self.notices.push(format!("`{at}.c10_share` has no effect: neo_hookean has no second constant."));
        }
        let c10 = presets::law_from_youngs_modulus(young, nu, 1.0);
        let isochoric = Isochoric::NeoHookean(NeoHookean { c10: 0.5 * c10.shear_modulus() });
        Some(ElasticLaw { isochoric, bulk_modulus: c10.bulk_modulus })
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
    fn verdict(&mut self, at: &str, table: &MaterialTable, material: &TissueMaterial, cell_size: f64) {
        let law = &material.law;
        let key = table.constants().iter().filter(|(_, value)| value.is_some()).map(|(key, _)| *key).next();
        let place = match key {
            Some(_) if table.c01_kpa.is_some() => format!("{at}.c01_kpa"),
            Some(key) => format!("{at}.{key}"),
            None if table.preset.is_some() => format!("{at}.preset"),
            None => at.to_string(),
        };
        match law.verdict() {
            Verdict::Unstable => return self.refuse_unstable(&place, material, cell_size),
            Verdict::StableBelow(_) | Verdict::StableAbove(_) if !table.allow_limited => {
                let (cause, way_out) = match law.isochoric {
                    Isochoric::MooneyRivlin(_) => (
                        "one constant is negative: ",
                        "write allow_limited = true to accept the limit, or constants that are both >= 0, or \
                         preset = \"lv2022-refit\""
                            .to_string(),
                    ),
                    _ => (
                        "",
                        format!(
                            "write allow_limited = true to accept the limit; without it {}",
                            law.isochoric.law().way_out
                        ),
                    ),
                };
                self.problems.report(
                    &place,
                    format!("REFUSED material: {cause}{}", describe_verdict(law)),
                    "limited stability",
                    way_out,
                );
                return;
            }
            Verdict::StableBelow(_) | Verdict::StableAbove(_) => {
                self.notices.push(format!("Limited material: {}.", describe_verdict(law)));
            }
            Verdict::Stable => {}
        }
        if table.youngs_modulus_kpa.is_none() && law.youngs_modulus() > LARGEST_TISSUE_MODULUS {
            self.refuse_stiff_tissue(&place, law.youngs_modulus());
        }
        if let (Some(stated), true) = (table.poisson_ratio, direct_bulk(table).is_some())
            && (stated - law.poisson_ratio()).abs() > 1e-3
        {
            self.notices.push(format!(
                "{at}.poisson_ratio {stated} disagrees with the law, whose constants and K give nu {}; the law counts.",
                four_digits(law.poisson_ratio())
            ));
        }
        if let (Some(stated), true) = (table.youngs_modulus_kpa, key.is_some())
            && (stated * KPA / law.youngs_modulus() - 1.0).abs() > 0.02
        {
            self.notices.push(format!(
                "{at}.youngs_modulus_kpa {stated} disagrees with the law, whose constants give E {} kPa; the law counts.",
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

    fn refuse_unstable(&mut self, place: &str, material: &TissueMaterial, cell_size: f64) {
        let law = &material.law;
        let growth = match ripple_growth_time(law, material.density, cell_size) {
            Some(time) => format!(
                "a {} mm ripple grows e-fold every {} ms; no time step helps",
                four_digits(cell_size / MM),
                four_digits(time * 1e3)
            ),
            None => "it does not resist shear".into(),
        };
        let Isochoric::MooneyRivlin(constants) = law.isochoric else {
            self.problems.report(
                place,
                format!("REFUSED material: {} ({growth})", describe_verdict(law)),
                "unstable at rest",
                law.isochoric.law().way_out,
            );
            return;
        };
        let (c10, c01) = (constants.c10 / KPA, constants.c01 / KPA);
        let shear = four_digits(law.shear_modulus() / KPA);
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scene_has_the_constants_of_the_table_of_laws() {
        let keys: Vec<&str> = constants().iter().map(|constant| constant.key).collect();
        let written: Vec<&str> = MaterialTable::default().constants().iter().map(|(key, _)| *key).collect();
        assert_eq!(written, keys, "src/scene/file/material.rs against the entries `LAW` in src/material");
        let all: Vec<(&str, Option<f64>)> = keys.iter().zip(1..).map(|(key, i)| (*key, Some(f64::from(i)))).collect();
        assert_eq!(MaterialTable::default().with_constants(&all).constants(), all);
    }
}
