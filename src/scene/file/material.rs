//! Materials as they are written: in a scene, in its regions and in a library.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

use super::super::words;
use crate::effects::damage::DamageTable;
use crate::effects::fibres::FibresTable;
use crate::effects::plasticity::PlasticityTable;
use crate::effects::viscoelastic::ViscoelasticTable;
use crate::material::LawWord;

/// A table with the constants of all laws between its other keys: each stands here once. The tests of `convert/material.rs` compare them
/// with `material::LAWS`.
macro_rules! with_law_constants {
    ($($table:tt)*) => {
        table_of_a_law! {
            [
                /// First constant c10 of neo_hookean, mooney_rivlin and yeoh [kPa].
                c10_kpa
                /// Second constant c01 of mooney_rivlin [kPa].
                c01_kpa
                /// Second constant c20 of yeoh [kPa].
                c20_kpa
                /// Third constant c30 of yeoh [kPa].
                c30_kpa
                /// Shear modulus at rest mu of ogden and demiray [kPa].
                mu_kpa
                /// Exponent alpha of ogden.
                alpha
                /// Exponent b of demiray.
                b
            ]
            $($table)*
        }
    };
}

/// The struct, with the constants where `..constants;` stands in it, and what is written of them.
macro_rules! table_of_a_law {
    (
        [$(#[$text:meta] $key:ident)+]
        $(#[$meta:meta])*
        pub struct $Table:ident { $($(#[$before_meta:meta])* pub $before:ident: $Before:ty,)+ ..constants; $($rest:tt)* }
    ) => {
        $(#[$meta])*
        pub struct $Table {
            $($(#[$before_meta])* pub $before: $Before,)+
            $(#[$text] pub $key: Option<f64>,)+
            $($rest)*
        }

        impl $Table {
            /// The constants of all laws with their keys, as written.
            pub fn constants(&self) -> Vec<(&'static str, Option<f64>)> {
                vec![$((stringify!($key), self.$key)),+]
            }

            /// This table with the constants of another one.
            pub fn with_constants(mut self, constants: &[(&'static str, Option<f64>)]) -> Self {
                for (key, value) in constants {
                    $(if *key == stringify!($key) {
                        self.$key = *value;
                    })+
                }
                self
            }
        }
    };
}

with_law_constants! {
/// A tissue material: a preset, or the constants of a law with one volumetric key, or E and nu with a share of c10.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = words::known_presets)]
pub struct MaterialTable {
    /// Name in the material library.
    pub preset: Option<String>,
    /// A library of your own, in the format of assets/materials.toml; relative to the scene file.
    pub library: Option<String>,
    /// Elastic law; default "mooney_rivlin".
    pub law: Option<LawWord>,
    ..constants;
    /// Bulk modulus K = 2/D [kPa].
    pub bulk_modulus_kpa: Option<f64>,
    /// D = 2/K [1/MPa].
    pub d_per_mpa: Option<f64>,
    /// Poisson's ratio at rest; beside K or D it is only compared.
    pub poisson_ratio: Option<f64>,
    /// Young's modulus at rest [kPa]; beside the constants of a law it is only compared.
    pub youngs_modulus_kpa: Option<f64>,
    /// Share of the shear modulus that goes to c10 when E and nu are given, 0 to 1; default 0.7; mooney_rivlin only.
    pub c10_share: Option<f64>,
    /// Density [kg/m^3]; default 1060, or the preset's.
    pub density_kg_m3: Option<f64>,
    /// Accept a law that is stable only within a stretch limit.
    #[serde(default)]
    pub allow_limited: bool,
    /// Tip force at which this material gives way [N]; default: that of [puncture].
    pub puncture_force_n: Option<f64>,
    /// Tip force of steady cutting in this material [N]; default: that of [puncture].
    pub cutting_force_n: Option<f64>,
    /// Cutting energy per area G_c instead of the cutting force, which is G_c times the needle diameter [J/m^2].
    pub cutting_energy_j_m2: Option<f64>,
    /// Toughness J_c of this material [J/m^2], counted over a slit of width 2a, not over the diameter of the needle.
    pub toughness_j_m2: Option<f64>,
    /// Stretch at which it tears, greater than 1: a slit is at least so wide that its wall stretches no more.
    pub tear_stretch: Option<f64>,
}
}

/// A part of the tissue with a material of its own: exactly one shape, in the coordinates of the scene.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = words::self_contained_tables)]
pub struct RegionTable {
    /// Name for messages and outputs, e.g. "skin".
    pub name: String,
    /// Depths of its top and bottom below z = 0 [mm].
    pub layer_mm: Option<[f64; 2]>,
    /// An axis-parallel box [mm].
    pub box_mm: Option<BoxTable>,
    /// A sphere [mm].
    pub sphere_mm: Option<SphereShapeTable>,
    /// A cylinder between two points of its axis [mm].
    pub cylinder_mm: Option<CylinderTable>,
    /// Name of a region of the mesh file.
    pub mesh_tag: Option<String>,
    /// Label of a label map, its name there, or a list of them.
    pub label: Option<LabelEntries>,
    /// Bone and other things that do not deform: the needle stops there. A rigid region needs no material.
    #[serde(default)]
    pub rigid: bool,
    #[serde(default)]
    pub material: MaterialTable,
    pub plasticity: Option<PlasticityTable>,
    pub fibres: Option<FibresTable>,
    pub viscoelastic: Option<ViscoelasticTable>,
    pub damage: Option<DamageTable>,
    /// As in `material`.
    pub puncture_force_n: Option<f64>,
    /// As in `material`.
    pub cutting_force_n: Option<f64>,
    /// As in `material`.
    pub cutting_energy_j_m2: Option<f64>,
    /// A tough layer with a puncture energy of its own, e.g. skin or a capsule; with `layer_mm` only.
    pub membrane: Option<MembraneTable>,
}

/// A label by its number or its name.
#[derive(Debug, Clone, PartialEq, Eq, JsonSchema)]
#[schemars(untagged)]
pub enum LabelEntry {
    Number(u64),
    Name(String),
}

/// One label or several.
#[derive(Debug, Clone, PartialEq, Eq, JsonSchema)]
#[schemars(untagged)]
pub enum LabelEntries {
    One(LabelEntry),
    Several(Vec<LabelEntry>),
}

impl LabelEntries {
    /// All of them.
    pub fn list(&self) -> &[LabelEntry] {
        match self {
            LabelEntries::One(entry) => std::slice::from_ref(entry),
            LabelEntries::Several(entries) => entries,
        }
    }
}

impl<'de> Deserialize<'de> for LabelEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match LabelEntries::deserialize(deserializer)? {
            LabelEntries::One(entry) => Ok(entry),
            LabelEntries::Several(_) => Err(serde::de::Error::custom("a list within a list of labels")),
        }
    }
}

impl<'de> Deserialize<'de> for LabelEntries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = LabelEntries;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a label such as 3 or \"skin\", or a list of labels")
            }

            fn visit_i64<E: serde::de::Error>(self, number: i64) -> Result<LabelEntries, E> {
                let number = u64::try_from(number).map_err(|_| E::custom("a label is no negative number"))?;
                Ok(LabelEntries::One(LabelEntry::Number(number)))
            }

            fn visit_u64<E>(self, number: u64) -> Result<LabelEntries, E> {
                Ok(LabelEntries::One(LabelEntry::Number(number)))
            }

            fn visit_str<E>(self, name: &str) -> Result<LabelEntries, E> {
                Ok(LabelEntries::One(LabelEntry::Name(name.into())))
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut list: A) -> Result<LabelEntries, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = list.next_element()? {
                    entries.push(entry);
                }
                Ok(LabelEntries::Several(entries))
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}

/// Energy that puncturing a layer takes beyond cutting through it: exactly one key.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MembraneTable {
    /// The energy itself [mJ].
    pub puncture_energy_mj: Option<f64>,
    /// Energy per area of a slit as wide as the needle through the thickness of the layer [J/m^2].
    pub toughness_j_m2: Option<f64>,
}

/// Lowest and highest corner.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    pub low: [f64; 3],
    pub high: [f64; 3],
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereShapeTable {
    pub centre: [f64; 3],
    pub radius: f64,
}

/// Both ends of the axis and the radius.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderTable {
    pub from: [f64; 3],
    pub to: [f64; 3],
    pub radius: f64,
}

/// A library of tissue materials, e.g. assets/materials.toml.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LibraryFile {
    #[serde(default)]
    pub material: Vec<LibraryMaterial>,
}

with_law_constants! {
/// One material of a library: constants as in [`MaterialTable`], and parameters of its own for effects.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LibraryMaterial {
    pub name: String,
    /// Further names that a scene may call it by; case does not count, and "-", "_" and a blank are the same.
    #[serde(default)]
    pub aliases: Vec<String>,
    /// One line: what it is.
    pub summary: Option<String>,
    /// Where the constants come from.
    pub source: String,
    /// Where they hold.
    pub range: Option<String>,
    pub law: Option<LawWord>,
    ..constants;
    pub bulk_modulus_kpa: Option<f64>,
    pub d_per_mpa: Option<f64>,
    pub poisson_ratio: Option<f64>,
    pub youngs_modulus_kpa: Option<f64>,
    pub c10_share: Option<f64>,
    pub density_kg_m3: Option<f64>,
    pub plasticity: Option<PlasticityTable>,
    pub fibres: Option<FibresTable>,
    pub viscoelastic: Option<ViscoelasticTable>,
    pub damage: Option<DamageTable>,
    pub cutting: Option<CuttingTable>,
    pub toughness_j_m2: Option<f64>,
    pub tear_stretch: Option<f64>,
}
}

/// Tip forces of a material; `cutting_force_n` or `cutting_energy_j_m2`. What is missing keeps the ratio of the two
/// forces in the scene's table [puncture].
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CuttingTable {
    pub puncture_force_n: Option<f64>,
    pub cutting_force_n: Option<f64>,
    pub cutting_energy_j_m2: Option<f64>,
}
