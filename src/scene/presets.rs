//! The library of tissue presets, built into the program.

use std::path::Path;
use std::sync::LazyLock;

use super::convert::{library, parameters};
use super::document::closest;
use super::tissue_preset::TissuePreset;
use crate::effects;
use crate::effects::TissueMaterial;
use crate::effects::parameters::Table;
use crate::material::ElasticLaw;
use crate::material_point::Material;

impl TissuePreset {
    /// The preset as a material point of its own: what it states for effects, the rest by default; no effect that it
    /// does not mention.
    pub fn material(&self) -> Material {
        let plasticity = self.plasticity.as_ref().map(|t| t.over(Default::default()));
        let flow: effects::plasticity::Params = plasticity.unwrap_or_default();
        Material {
            plasticity,
            fibres: self.fibres.as_ref().map(|t| parameters::fibres_over(t, Default::default())),
            viscoelastic: self.viscoelastic.as_ref().map(|t| parameters::viscoelastic_over(t, Default::default())),
            damage: self.damage.as_ref().map(|t| parameters::damage_over(t, Default::default(), flow)),
            ..Material::elastic(self.law, self.density)
        }
    }
}

impl TissueMaterial {
    /// The tissue preset called `name`, with what it states for effects; `None`: there is none. [`tissues`] has all of them.
    pub fn preset(name: &str) -> Option<Self> {
        let preset = tissue(name)?;
        let point = preset.material();
        Some(TissueMaterial {
            plasticity: point.plasticity,
            fibres: point.fibres,
            viscoelastic: point.viscoelastic,
            damage: point.damage,
            toughness: preset.toughness,
            tear_stretch: preset.tear_stretch,
            ..TissueMaterial::new(&preset.name, &preset.source, preset.law, preset.density)
        })
    }
}

/// All tissue presets.
pub fn tissues() -> &'static [TissuePreset] {
    static TISSUES: LazyLock<Vec<TissuePreset>> = LazyLock::new(read_tissues);
    &TISSUES
}

/// The tissue preset that `name` leads to.
pub fn tissue(name: &str) -> Option<&'static TissuePreset> {
    found(tissues(), name)
}

/// The preset that `name` leads to: its name as it stands, then in [`folded`] form, then one of its aliases.
pub fn found<'a>(presets: &'a [TissuePreset], name: &str) -> Option<&'a TissuePreset> {
    let word = folded(name);
    let exact = presets.iter().find(|preset| preset.name == name);
    exact
        .or_else(|| presets.iter().find(|preset| folded(&preset.name) == word))
        .or_else(|| presets.iter().find(|preset| preset.aliases.iter().any(|alias| folded(alias) == word)))
}

/// A name as names are compared: case does not count, and "-", "_" and a blank are the same.
pub fn folded(name: &str) -> String {
    name.to_lowercase().replace(['-', '_'], " ")
}

/// What to say of a name that leads to no preset: the nearest of names and aliases, if it is a slip of the keys.
pub fn near_name<'a>(presets: &'a [TissuePreset], name: &str) -> Option<&'a str> {
    let known = |preset: &'a TissuePreset| std::iter::once(&preset.name).chain(&preset.aliases).map(String::as_str);
    let all: Vec<(String, &str)> = presets.iter().flat_map(known).map(|known| (folded(known), known)).collect();
    let near = closest(&folded(name), all.iter().map(|(word, _)| word.as_str()))?;
    all.iter().find(|(word, _)| word == near).map(|(_, known)| *known)
}

/// Bulk modulus from Poisson's ratio and the shear modulus [Pa]: K = 2 mu (1 + nu) / (3 (1 - 2 nu)).
pub fn bulk_modulus_from_poisson(shear_modulus: f64, poisson_ratio: f64) -> f64 {
    2.0 * shear_modulus * (1.0 + poisson_ratio) / (3.0 * (1.0 - 2.0 * poisson_ratio))
}

/// Law from E [Pa], nu and the share of c10: mu = E / (2 (1 + nu)).
pub fn law_from_youngs_modulus(youngs_modulus: f64, poisson_ratio: f64, share: f64) -> ElasticLaw {
    let shear = youngs_modulus / (2.0 * (1.0 + poisson_ratio));
    ElasticLaw::from_moduli(shear, bulk_modulus_from_poisson(shear, poisson_ratio), share)
}

/// Materials of a library; `path` stands for its file in messages.
///
/// # Errors
/// `Error::Scene` with all problems.
pub fn parse_library(path: &Path, source: &str) -> crate::Result<Vec<TissuePreset>> {
    library::read(path, source).map_err(crate::Error::Scene)
}

fn read_tissues() -> Vec<TissuePreset> {
    library::read(Path::new("assets/materials.toml"), include_str!("../../assets/materials.toml"))
        .unwrap_or_else(|text| panic!("assets/materials.toml is part of the program and tested:\n{text}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::Verdict;

    #[test]
    fn every_tissue_preset_is_stable_and_has_an_origin() {
        for preset in tissues() {
            assert_eq!(preset.law.verdict(), Verdict::Stable, "{}", preset.name);
            assert!(!preset.source.is_empty() && preset.range.is_some() && !preset.summary.is_empty());
        }
    }

    #[test]
    fn a_preset_is_found_by_its_aliases() {
        let name = |word: &str| tissue(word).map(|preset| preset.name.as_str());
        for preset in tissues() {
            assert_eq!(name(&preset.name), Some(preset.name.as_str()));
            for alias in &preset.aliases {
                assert_eq!(name(&alias.to_uppercase().replace(['_', ' '], "-")), Some(preset.name.as_str()), "{alias}");
            }
        }
        assert_eq!(name("skeletal_muscle"), Some("across-fibre"));
        assert_eq!(name("Subcutaneous Fat"), Some("subcutaneous-fat"));
        assert_eq!(name("vertebrae_L3"), Some("bone"));
        assert_eq!(name("no such tissue"), None);
        assert_eq!(near_name(tissues(), "skeletal muscl"), Some("skeletal muscle"));
        assert_eq!(near_name(tissues(), "Across_fiber"), Some("across-fibre"));
        assert_eq!(near_name(tissues(), "something else altogether"), None);
    }

    #[test]
    fn an_alias_leads_to_one_material() {
        let library = |first: &str, second: &str| {
            let entry = |name: &str, aliases: &str| {
                let constants = "source = \"own\"\nlaw = \"neo_hookean\"\nc10_kpa = 1\npoisson_ratio = 0.45";
                format!("[[material]]\nname = \"{name}\"\naliases = [{aliases}]\n{constants}\n")
            };
            library::read(Path::new("mine.toml"), &(entry("soft gel", first) + &entry("hard gel", second)))
        };
        let presets = library("\"Jelly\", \"soft-gel\"", "\"rubber\"").unwrap();
        assert_eq!(found(&presets, "jelly").unwrap().name, "soft gel");
        assert_eq!(found(&presets, "HARD_GEL").unwrap().name, "hard gel");
        for (second, line) in [("\"JELLY\"", "mine.toml:10:"), ("\"rubber\", \"soft_gel\"", "mine.toml:10:")] {
            let message = library("\"jelly\"", second).unwrap_err();
            assert!(message.contains("\"hard gel\" leads to \"soft gel\" as well"), "{message}");
            assert!(message.contains(line), "{message}");
        }
        let message = library("\"Hard Gel\"", "\"rubber\"").unwrap_err();
        assert!(message.contains("the alias \"Hard Gel\" of \"soft gel\" leads to \"hard gel\""), "{message}");
        assert!(library("\" \"", "").unwrap_err().contains("an alias is empty"));
    }

    /// The presets with a source keep its modulus at rest, and E of the ratios of yield stress and hardening is theirs.
    #[test]
    fn the_presets_have_the_moduli_of_their_sources() {
        let law = |name: &str| tissue(name).unwrap().law;
        for (name, kpa) in [("liver", 5.1), ("kidney", 5.0), ("prostate", 42.3), ("dermis", 1180.0), ("tendon", 310.0)]
        {
            assert!((law(name).youngs_modulus() / (kpa * 1e3) - 1.0).abs() < 1e-9, "{name}");
        }
        for (name, kpa) in [("gelatine-5", 4.18), ("cartilage", 170.0), ("brain", 0.885), ("dura-mater", 450.0)] {
            assert!((law(name).shear_modulus() / (kpa * 1e3) - 1.0).abs() < 1e-9, "{name}");
        }
        let new = tissues().iter().skip_while(|preset| preset.name != "muscle-relaxed");
        for preset in new {
            let flow = preset.plasticity.as_ref().unwrap();
            let young = preset.law.youngs_modulus();
            assert!((flow.yield_stress_kpa.unwrap() * 1e3 / (0.29 * young) - 1.0).abs() < 0.02, "{}", preset.name);
            assert!((flow.hardening_kpa.unwrap() * 1e3 / (3.9 * young) - 1.0).abs() < 0.02, "{}", preset.name);
            assert!(preset.law.poisson_ratio() < 0.491 && preset.law.youngs_modulus() < 1e7, "{}", preset.name);
        }
    }

    #[test]
    fn the_refit_has_the_moduli_of_the_references() {
        let law = tissue("lv2022-refit").unwrap().law;
        // mu0, K0, E0, nu0 of an independent computation.
        assert!((law.shear_modulus() - 6600.0).abs() < 1e-6);
        assert!((law.bulk_modulus - 5.0e5).abs() < 1e-6);
        assert!((law.youngs_modulus() - 19713.26).abs() < 0.01);
        assert!((law.poisson_ratio() - 0.493429).abs() < 1e-6);
        let muscle = tissue("muscle-60kpa").unwrap().law;
        assert!((muscle.youngs_modulus() - 60.0e3).abs() < 1e-6 && (muscle.poisson_ratio() - 0.45).abs() < 1e-9);
    }
}
