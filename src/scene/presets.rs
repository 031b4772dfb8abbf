//! The library of tissue presets, built into the program.

use std::path::Path;
use std::sync::LazyLock;

use super::convert::{library, parameters};
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

/// The tissue preset called `name`.
pub fn tissue(name: &str) -> Option<&'static TissuePreset> {
    tissues().iter().find(|preset| preset.name == name)
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
