//! One entry of a library of tissue materials.

use super::file::{CuttingTable, DamageTable, FibresTable, PlasticityTable, ViscoelasticTable};
use crate::material::ElasticLaw;

/// A tissue material with its origin and range of validity.
#[derive(Debug, Clone)]
pub struct TissuePreset {
    pub name: String,
    /// Further names that it is found by.
    pub aliases: Vec<String>,
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
    /// Toughness J_c [J/m^2], counted over a slit of width 2a.
    pub toughness: Option<f64>,
    /// Stretch at which it tears.
    pub tear_stretch: Option<f64>,
}
