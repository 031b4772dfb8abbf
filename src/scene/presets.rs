//! The library of tissue presets, needle gauges and needle materials, built into the program.

use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;

use super::convert::{library, parameters};
use super::file::{CuttingTable, DamageTable, FibresTable, PlasticityTable, ViscoelasticTable};
use crate::effects;
use crate::material::ElasticLaw;
use crate::material_point::Material;

/// A tissue material with its origin and range of validity.
#[derive(Debug, Clone)]
pub struct TissuePreset {
    pub name: String,
    /// One line: what it is.
    pub summary: String,
    /// Where the constants come from.
    pub source: String,
    /// Where they hold.
    pub range: Option<String>,
    pub law: ElasticLaw,
    /// Density [kg/m^3].
    pub density: f64,
    /// Parameters of its own for effects, as written: what a table leaves out comes from the scene.
    pub plasticity: Option<PlasticityTable>,
    pub fibres: Option<FibresTable>,
    pub viscoelastic: Option<ViscoelasticTable>,
    pub damage: Option<DamageTable>,
    /// Tip forces as written: a cutting energy becomes a force with the needle of the scene.
    pub cutting: Option<CuttingTable>,
}

impl TissuePreset {
    /// The preset as a material point of its own: what it states for effects, the rest by default; no effect that it
    /// does not mention.
    pub fn material(&self) -> Material {
        let plasticity = self.plasticity.as_ref().map(|t| parameters::plasticity_over(t, Default::default()));
        let flow: effects::plasticity::Params = plasticity.unwrap_or_default();
        Material {
            law: self.law,
            density: self.density,
            plasticity,
            fibres: self.fibres.as_ref().map(|t| parameters::fibres_over(t, Default::default())),
            viscoelastic: self.viscoelastic.as_ref().map(|t| parameters::viscoelastic_over(t, Default::default())),
            damage: self.damage.as_ref().map(|t| parameters::damage_over(t, Default::default(), flow)),
        }
    }
}

/// A needle size.
#[derive(Debug, Clone)]
pub struct NeedlePreset {
    /// Gauge, e.g. `16G`.
    pub gauge: String,
    /// Outer diameter [m].
    pub outer_diameter: f64,
    /// Bore of the regular wall [m].
    pub inner_diameter: f64,
    pub source: String,
    /// Tolerance of the maker.
    pub range: String,
}

/// A needle material; it decides how a flexible needle bends.
#[derive(Debug, Clone)]
pub struct NeedleMaterial {
    pub name: String,
    /// Young's modulus [Pa].
    pub youngs_modulus: f64,
    pub poisson_ratio: f64,
    /// Density [kg/m^3].
    pub density: f64,
    pub source: String,
    pub range: String,
}

/// All tissue presets.
pub fn tissues() -> &'static [TissuePreset] {
    static TISSUES: LazyLock<Vec<TissuePreset>> = LazyLock::new(read_tissues);
    &TISSUES
}

/// All needle gauges, thick to thin.
pub fn needles() -> &'static [NeedlePreset] {
    &NEEDLES.0
}

/// All needle materials.
pub fn needle_materials() -> &'static [NeedleMaterial] {
    &NEEDLES.1
}

/// The tissue preset called `name`.
pub fn tissue(name: &str) -> Option<&'static TissuePreset> {
    tissues().iter().find(|preset| preset.name == name)
}

/// The needle gauge called `gauge`.
pub fn needle(gauge: &str) -> Option<&'static NeedlePreset> {
    needles().iter().find(|preset| preset.gauge == gauge)
}

/// The needle material called `name`.
pub fn needle_material(name: &str) -> Option<&'static NeedleMaterial> {
    needle_materials().iter().find(|material| material.name == name)
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

static NEEDLES: LazyLock<(Vec<NeedlePreset>, Vec<NeedleMaterial>)> = LazyLock::new(read_needles);

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

fn read_needles() -> (Vec<NeedlePreset>, Vec<NeedleMaterial>) {
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Library {
        needle: Vec<Gauge>,
        material: Vec<Material>,
    }
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Gauge {
        gauge: String,
        outer_diameter_mm: f64,
        inner_diameter_mm: f64,
        source: String,
        range: String,
    }
    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Material {
        name: String,
        youngs_modulus_gpa: f64,
        poisson_ratio: f64,
        density_g_cm3: f64,
        source: String,
        range: String,
    }
    let library: Library = toml::from_str(include_str!("../../assets/needles.toml"))
        .expect("assets/needles.toml is part of the program and tested");
    let needles = library.needle.into_iter().map(|entry| NeedlePreset {
        gauge: entry.gauge,
        outer_diameter: entry.outer_diameter_mm * 1e-3,
        inner_diameter: entry.inner_diameter_mm * 1e-3,
        source: entry.source,
        range: entry.range,
    });
    let materials = library.material.into_iter().map(|entry| NeedleMaterial {
        name: entry.name,
        youngs_modulus: entry.youngs_modulus_gpa * 1e9,
        poisson_ratio: entry.poisson_ratio,
        density: entry.density_g_cm3 * 1e3,
        source: entry.source,
        range: entry.range,
    });
    (needles.collect(), materials.collect())
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

    #[test]
    fn gauges_are_sorted_and_needles_plausible() {
        assert_eq!(needles().len(), 12);
        assert!(needles().windows(2).all(|w| w[0].outer_diameter > w[1].outer_diameter));
        assert!(
            needles()
                .iter()
                .all(|n| n.inner_diameter > 0.4 * n.outer_diameter && n.inner_diameter < 0.8 * n.outer_diameter)
        );
        assert!(needle("16G").is_some() && needle_material("steel-304").is_some());
    }
}
