//! The library of needle gauges and needle materials, built into the program.

use std::sync::LazyLock;

use serde::Deserialize;

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

/// All needle gauges, thick to thin.
pub fn needles() -> &'static [NeedlePreset] {
    &NEEDLES.0
}

/// All needle materials.
pub fn needle_materials() -> &'static [NeedleMaterial] {
    &NEEDLES.1
}

/// The needle gauge called `gauge`.
pub fn needle(gauge: &str) -> Option<&'static NeedlePreset> {
    needles().iter().find(|preset| preset.gauge == gauge)
}

/// The needle material called `name`.
pub fn needle_material(name: &str) -> Option<&'static NeedleMaterial> {
    needle_materials().iter().find(|material| material.name == name)
}

static NEEDLES: LazyLock<(Vec<NeedlePreset>, Vec<NeedleMaterial>)> = LazyLock::new(read_needles);

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

    #[test]
    fn gauges_are_sorted_and_needles_plausible() {
        assert_eq!(needles().len(), 21);
        assert!(needles().windows(2).all(|w| w[0].outer_diameter > w[1].outer_diameter));
        assert!(
            needles()
                .iter()
                .all(|n| n.inner_diameter > 0.4 * n.outer_diameter && n.inner_diameter < 0.8 * n.outer_diameter)
        );
        assert!(needle("16G").is_some() && needle_material("steel-304").is_some());
    }
}
