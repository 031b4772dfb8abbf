//! The TOML form of a scene: what a person writes, units in the key names. Unknown keys are errors.
//!
//! The doc comments are the descriptions of the JSON schema. Ranges and relations between keys are checked in
//! `convert`, where a message can point at the line.

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Deserializer};

use super::words;
use crate::material::LawWord;

/// A Stylet scene.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneFile {
    /// One line for pictures and reports; default: the file name.
    pub title: Option<String>,
    /// Keys of the effects that are simulated, e.g. ["puncture", "friction", "mass_scaling"].
    #[serde(default)]
    #[schemars(schema_with = "words::effects")]
    pub effects: Vec<String>,
    pub tissue: TissueTable,
    pub material: MaterialTable,
    /// Parts of another material, at most 15; where two overlap, the later one counts.
    #[serde(default)]
    #[schemars(length(max = 15))]
    pub region: Vec<RegionTable>,
    /// What holds, moves or loads the six faces; default: sides and bottom fixed, top free; all free for a mesh.
    #[serde(default)]
    pub boundaries: BoundariesTable,
    /// Node sets of a mesh that are held.
    #[serde(default)]
    pub support: Vec<SupportTable>,
    /// A needle with a conical or bevelled tip, rigid without the effect `flexible_needle`. At most one tool per scene.
    pub needle: Option<NeedleTable>,
    /// A rigid sphere. At most one tool per scene.
    pub sphere: Option<SphereTable>,
    /// A rigid flat cylindrical punch. At most one tool per scene.
    pub flat_punch: Option<FlatPunchTable>,
    /// Motion of the tool; required with a tool.
    pub motion: Option<MotionTable>,
    pub puncture: Option<PunctureTable>,
    pub cohesive: Option<CohesiveTable>,
    pub adhesion: Option<AdhesionTable>,
    pub friction: Option<FrictionTable>,
    pub flexible_needle: Option<FlexibleNeedleTable>,
    pub indentation: Option<IndentationTable>,
    pub gravity: Option<GravityTable>,
    pub plasticity: Option<PlasticityTable>,
    pub fibres: Option<FibresTable>,
    pub viscoelastic: Option<ViscoelasticTable>,
    pub damage: Option<DamageTable>,
    #[serde(default)]
    pub solver: SolverTable,
    #[serde(default)]
    pub outputs: OutputsTable,
    /// Points of the tissue that the insertion wants to reach, at most 64; their motion is written to targets.csv.
    #[serde(default)]
    #[schemars(length(max = 64))]
    pub target: Vec<TargetTable>,
    /// What a trainee is asked to do; changes nothing in the simulation.
    pub task: Option<TaskTable>,
}

/// The tissue: a block (`size_mm`, `cell_size_mm`) or a mesh of tetrahedra (`mesh`, `unit`). The block spans
/// -size/2..size/2 in x and y and -size..0 in z; its top face is z = 0. A mesh keeps its own coordinates.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TissueTable {
    /// Edge lengths of the block in x, y, z [mm].
    pub size_mm: Option<[f64; 3]>,
    /// Cell edge around the planned path [mm].
    pub cell_size_mm: Option<f64>,
    /// Half width of the fine zone around the path [mm]; default 2.5.
    pub fine_radius_mm: Option<f64>,
    /// Wanted ratio of neighbouring cell edges outside the fine zone, 1 to 2; default 1.25.
    pub growth: Option<f64>,
    /// Where the entry point lies between two grid lines in x and y, as a fraction of the cell; default [0.23, 0.31].
    pub axis_offset_cells: Option<[f64; 2]>,
    /// A file of tetrahedra (.msh, .vtk, .vtu, .inp) instead of the block; relative to the scene file.
    pub mesh: Option<String>,
    /// Unit of length in the mesh file: m, cm, mm, um or inch.
    #[serde(default)]
    #[schemars(schema_with = "words::units")]
    pub unit: Option<String>,
    /// Accept a mesh smaller than 1 mm or larger than 1 m, which is otherwise taken for a wrong unit.
    pub accept_size: Option<bool>,
}

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
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
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
}
}

/// A part of the tissue with a material of its own: exactly one shape, in the coordinates of the scene.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
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

/// A node set of the mesh that is held.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SupportTable {
    /// Name of the set in the mesh file.
    pub set: String,
    /// Components held at zero.
    pub fixed: Vec<Axis>,
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

/// Conditions on the six faces of a block, or of the bounding box of a mesh.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoundariesTable {
    /// Face x = -size/2; default "fixed", of a mesh "free".
    pub x_min: Option<FaceEntry>,
    /// Face x = +size/2; default "fixed", of a mesh "free".
    pub x_max: Option<FaceEntry>,
    /// Face y = -size/2; default "fixed", of a mesh "free".
    pub y_min: Option<FaceEntry>,
    /// Face y = +size/2; default "fixed", of a mesh "free".
    pub y_max: Option<FaceEntry>,
    /// Bottom; default "fixed", of a mesh "free".
    pub z_min: Option<FaceEntry>,
    /// Top; default "free".
    pub z_max: Option<FaceEntry>,
}

/// One face: "free", "fixed", "roller" (normal component fixed: a plane of symmetry) or a table.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum FaceEntry {
    Kind(FaceKind),
    Table(FaceTable),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FaceKind {
    Free,
    Fixed,
    Roller,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Axis {
    X,
    Y,
    Z,
}

/// What holds, moves or loads one face.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FaceTable {
    /// Components that are held, or moved by `displacement_mm` and `rotation_deg`.
    #[serde(default)]
    pub fixed: Vec<Axis>,
    /// Final displacement of the fixed components [mm].
    pub displacement_mm: Option<[f64; 3]>,
    /// Final rotation about the coordinate axis of the face normal [deg], right-handed about the positive axis.
    pub rotation_deg: Option<f64>,
    /// Time over which displacement and rotation grow linearly [s].
    pub duration_s: Option<f64>,
    /// Speed of the displacement instead of `duration_s` [mm/min].
    pub speed_mm_min: Option<f64>,
    /// Cycles from zero to the full motion and back, each half lasting as long as the ramp; default: ramp and hold.
    pub cycles: Option<u32>,
    /// Dead load per rest area [kPa].
    pub traction_kpa: Option<[f64; 3]>,
    /// Time over which the load grows linearly [s]; default 0: at once.
    pub traction_ramp_s: Option<f64>,
}

/// A needle: cylinder and tip.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeedleTable {
    /// Gauge in the needle library, e.g. "16G"; or give `outer_diameter_mm`.
    #[serde(default, deserialize_with = "words::gauge")]
    #[schemars(schema_with = "words::gauges")]
    pub gauge: Option<String>,
    /// Outer diameter [mm].
    pub outer_diameter_mm: Option<f64>,
    /// Length of the cone [mm]; or give `tip_half_angle_deg`.
    pub tip_length_mm: Option<f64>,
    /// Half of the opening angle of the cone [deg].
    pub tip_half_angle_deg: Option<f64>,
    /// Angle between the bevel and the shaft [deg], instead of a cone.
    pub bevel_angle_deg: Option<f64>,
    /// Heading of the apex of a bevel seen from the axis [deg]; for a vertical needle from +x towards +y; default 0.
    pub bevel_heading_deg: Option<f64>,
    /// Diameter of the bore of a hollow needle that takes a core [mm]; needs the effects `puncture` and `cohesive`.
    pub bore_diameter_mm: Option<f64>,
    /// Where the cutting edge of a hollow needle lies in its wall: 0 at the bore, 1 at the outer diameter.
    pub cutting_edge: Option<f64>,
    /// Friction coefficient of the bore.
    pub bore_friction: Option<f64>,
    /// Length from the tip to the hub [mm]; default 100. With the density it gives the mass, whose inertia the hand feels.
    pub length_mm: Option<f64>,
    /// Needle material: a name in the library or a table; default "steel-304". It decides how the needle bends with the
    /// effect `flexible_needle`.
    pub material: Option<NeedleMaterialEntry>,
}

/// A name in the library or a table of constants.
#[derive(Debug, Clone, JsonSchema)]
#[schemars(untagged)]
pub enum NeedleMaterialEntry {
    Preset(#[schemars(schema_with = "words::needle_materials")] String),
    Table(NeedleMaterialTable),
}

/// Constants of a needle material; exactly one density key.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NeedleMaterialTable {
    /// Young's modulus [GPa].
    pub youngs_modulus_gpa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density [g/cm^3].
    pub density_g_cm3: Option<f64>,
    /// Density [g/mm^3], for tables that print it so.
    pub density_g_mm3: Option<f64>,
}

/// A rigid sphere; depth is counted from the first touch of the top face.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereTable {
    /// Radius [mm].
    pub radius_mm: f64,
}

/// A rigid flat cylindrical punch.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatPunchTable {
    /// Radius [mm].
    pub radius_mm: f64,
    /// Stick to the tissue where it is touched first; default false.
    #[serde(default)]
    pub bonded: bool,
}

/// Motion of the tool. Depth is counted along the needle from the point where its axis meets z = 0.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionTable {
    /// Entry point on the top face, x and y [mm]; default [0, 0].
    pub entry_mm: Option<[f64; 2]>,
    /// Direction of the insertion, any length, z < 0; default [0, 0, -1]. Or give `angle_deg`.
    pub direction: Option<[f64; 3]>,
    /// Angle between the needle and the downward vertical [deg], 0 to 80.
    pub angle_deg: Option<f64>,
    /// Heading of an inclined needle in the xy plane, from +x towards +y [deg]; default 0.
    pub azimuth_deg: Option<f64>,
    /// The phases, in order.
    #[serde(default)]
    pub phase: Vec<PhaseTable>,
    /// Vibration of the hub on top of the phases.
    pub vibration: Option<VibrationTable>,
}

/// A sinusoidal motion of the hub, from the start of the run on.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VibrationTable {
    /// Amplitude [mm].
    pub amplitude_mm: f64,
    /// Frequency [Hz].
    pub frequency_hz: f64,
    /// Direction of the motion, any length; default: along the insertion.
    pub direction: Option<[f64; 3]>,
}

/// One phase of the motion.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PhaseTable {
    /// What the tool does. With move, turn or reposition the path is not planned but found while the tip moves.
    pub kind: PhaseKind,
    /// Speed of the tip [mm/s]; for insert, withdraw and move.
    pub speed_mm_s: Option<f64>,
    /// Depth at the end of the phase [mm]; for insert and withdraw.
    pub depth_mm: Option<f64>,
    /// Duration [s]; for hold.
    pub duration_s: Option<f64>,
    /// Where the tip goes on a straight line, in the coordinates of the block [mm]; for move.
    pub to_mm: Option<[f64; 3]>,
    /// Direction of the needle at the end, any length; for move (default: as before), turn and reposition.
    pub direction: Option<[f64; 3]>,
    /// The same as an angle to the downward vertical, 0 to 80 [deg].
    pub angle_deg: Option<f64>,
    /// Heading that belongs to `angle_deg` [deg]; default 0.
    pub azimuth_deg: Option<f64>,
    /// How fast the needle turns [deg/s]; for turn.
    pub rate_deg_s: Option<f64>,
    /// Point fixed in space about which it turns [mm]; for turn; default: the tip.
    pub pivot_mm: Option<[f64; 3]>,
    /// New entry point on the top face, x and y [mm]; for reposition, outside the tissue.
    pub entry_mm: Option<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PhaseKind {
    Insert,
    Hold,
    Withdraw,
    Move,
    Turn,
    Reposition,
}

/// How the path of the needle is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PathWord {
    Auto,
    Free,
}

/// Parameters of the effect `puncture`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PunctureTable {
    /// Tip force at which the surface gives way [N] (calibration).
    pub puncture_force_n: Option<f64>,
    /// Tip force of steady cutting [N] (calibration).
    pub cutting_force_n: Option<f64>,
    /// Length over which the threshold falls from the puncture to the cutting force [mm].
    pub transition_length_mm: Option<f64>,
    /// Stiffness of all tip springs together [N/mm].
    pub tip_stiffness_n_mm: Option<f64>,
    /// Radius of the softened path [mm] (calibration).
    pub softened_radius_mm: Option<f64>,
    /// Elastic stiffness left in a fully softened cell, 0 to 1.
    pub residual_stiffness: Option<f64>,
    /// Outer radius of the ring of nodes that the shaft pushes [mm] (calibration); larger than `softened_radius_mm`.
    pub ring_radius_mm: Option<f64>,
    /// Factor of the contact stiffness (calibration): of (K + 4/3 mu)/l^2 per volume of the ring around the path, of
    /// (K + 4/3 mu) l^2/h per node of a separated face, l = 0.6 mm.
    pub contact_stiffness_factor: Option<f64>,
    /// Fraction of critical damping in the contact normal, 0 to 1.
    pub contact_damping: Option<f64>,
    /// Travel over which an overlap found at activation fades out [mm].
    pub entry_fade_mm: Option<f64>,
    /// "auto" (default): planned before the run for a straight motion, else free; "free": always found while the tip moves.
    pub path: Option<PathWord>,
    /// Exponent of the speed of the needle in the tip forces, 0 to 1; default 0: no rate.
    pub rate_exponent: Option<f64>,
    /// Speed up to which the tip forces are the written ones [mm/s]; default 1.
    pub reference_speed_mm_s: Option<f64>,
}

/// Parameters of the effect `adhesion`, which needs `puncture`: a model of the hypothesis that tissue sticks to the tip.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AdhesionTable {
    /// Force at which the tissue lets go [N]; default 0.25.
    pub static_force_n: Option<f64>,
    /// Force at the end of a slip [N]; default 0.05.
    pub kinetic_force_n: Option<f64>,
    /// Stiffness of the bond [N/mm]; default 1.
    pub stiffness_n_mm: Option<f64>,
    /// Distance slid until it sticks anew [mm]: the spacing of the drops; default 1.
    pub sliding_distance_mm: Option<f64>,
}

/// Parameters of the effect `friction`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionTable {
    /// Friction coefficient mu.
    pub coefficient: Option<f64>,
    /// Tangential over normal contact stiffness.
    pub stiffness_ratio: Option<f64>,
    /// Length over which mu grows along the shaft behind the cone [mm].
    pub fade_length_mm: Option<f64>,
}

/// Parameters of the effect `flexible_needle`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlexibleNeedleTable {
    /// Length from hub to tip [mm]; default 100.
    pub free_length_mm: Option<f64>,
    /// Number of elements, 4 to 200; default 40.
    pub elements: Option<u32>,
    /// Diameter of the bore [mm], 0: solid; default: the gauge's, solid for a needle without gauge.
    pub inner_diameter_mm: Option<f64>,
    /// Acceleration of free fall on the needle [m/s^2]; default: that of the effect `gravity` if it is on, else none.
    pub gravity_m_s2: Option<[f64; 3]>,
}

/// Parameters of the effect `cohesive`: faces that separate. With a needle that cuts, its path opens on them: on a slit
/// before a solid needle, on the ring of its cutting edge before a hollow one.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CohesiveTable {
    /// Strength in opening [kPa].
    pub strength_kpa: Option<f64>,
    /// Strength in shear [kPa]; default: that in opening.
    pub shear_strength_kpa: Option<f64>,
    /// Fracture energy in opening [J/m^2].
    pub energy_j_m2: Option<f64>,
    /// Fracture energy in shear [J/m^2]; default: that in opening.
    pub shear_energy_j_m2: Option<f64>,
    /// Exponent of the mode mixity (Benzeggagh and Kenane).
    pub exponent: Option<f64>,
    /// Penalty stiffness over E/h; or give `penalty_pa_m`.
    pub penalty_factor: Option<f64>,
    /// Penalty stiffness [Pa/m].
    pub penalty_pa_m: Option<f64>,
    /// Planes across the whole block that may separate.
    #[serde(default)]
    pub plane: Vec<CohesivePlaneTable>,
}

/// A plane that may separate; the nearest grid line is moved there.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CohesivePlaneTable {
    /// Axis of its normal: "x", "y" or "z".
    #[schemars(schema_with = "words::axes")]
    pub axis: String,
    /// Coordinate [mm]; z is negative below the top face.
    pub at_mm: f64,
    /// True: where the needle passes the plane, its tip opens it; default false (tissue stress alone does).
    #[serde(default)]
    pub tip_driven: bool,
}

/// Parameters of the effect `indentation`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IndentationTable {
    /// Contact stiffness over (K + 4/3 mu) h.
    pub contact_stiffness_factor: Option<f64>,
    /// Fraction of critical damping in the contact normal, 0 to 1.
    pub contact_damping: Option<f64>,
}

/// Parameters of the effect `gravity`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityTable {
    /// Acceleration of free fall [m/s^2]; default [0, 0, -9.81].
    pub acceleration_m_s2: Option<[f64; 3]>,
}

impl GravityTable {
    /// Nothing weighs anything.
    pub fn none() -> Self {
        GravityTable { acceleration_m_s2: Some([0.0; 3]) }
    }
}

/// Parameters of the effect `plasticity`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlasticityTable {
    /// Yield stress, a Kirchhoff stress [kPa]; default 23.4.
    pub yield_stress_kpa: Option<f64>,
    /// Hardening modulus: slope of the Kirchhoff stress over the plastic strain [kPa]; default 314.
    pub hardening_kpa: Option<f64>,
}

/// Parameters of the effect `fibres`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FibresTable {
    /// Direction of the fibres at rest, any length; default [1, 0, 0].
    pub direction: Option<[f64; 3]>,
    /// Stiffness k1 [kPa]; default 8.78; 0: no fibres in this material.
    pub k1_kpa: Option<f64>,
    /// Exponent k2; default 0.05.
    pub k2: Option<f64>,
}

/// Parameters of the effect `viscoelastic`: a Prony series of 1 to 8 terms.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViscoelasticTable {
    /// Shares of the isochoric stress that relax, each above 0, sum below 1; default [0.25, 0.15, 0.10].
    pub g: Option<Vec<f64>>,
    /// Relaxation times, one per share [s]; default [0.5, 5, 60].
    pub tau_s: Option<Vec<f64>>,
}

/// Parameters of the effect `damage`, which needs `plasticity`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DamageTable {
    /// Equivalent plastic strain at which damage begins; default 0.0652.
    pub onset: Option<f64>,
    /// Plastic displacement at which nothing would be left [mm]; default 0.07, for cells of 1 mm.
    pub failure_displacement_mm: Option<f64>,
    /// Energy per area from onset to failure, instead of the displacement [J/m^2].
    pub fracture_energy_j_m2: Option<f64>,
    /// Largest damage, below 1; default 0.95.
    pub d_max: Option<f64>,
    /// Delete a cell that has reached d_max; default false.
    pub deletion: Option<bool>,
    /// Accept cells that are too large for the failure displacement: their softening branch snaps back, the break is
    /// dynamic. Default false: such a scene is refused. Read from the scene and from regions, not from presets.
    pub allow_brittle: Option<bool>,
}

/// Numbers of the time integration.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SolverTable {
    /// Mass-scaling factor, 1 or more, or "auto"; acts with the effect `mass_scaling` only. Default "auto".
    pub mass_scaling: Option<MassScalingEntry>,
    /// Fraction of the stable step that is used, 0 to 1; default 0.8.
    pub safety: Option<f64>,
    /// The scene's own time step [us]; default: computed.
    pub time_step_us: Option<f64>,
    /// Mass-proportional damping [1/s]; default 10.
    pub mass_damping_per_s: Option<f64>,
    /// Hourglass stiffness; default 0.1.
    pub hourglass_stiffness: Option<f64>,
    /// Quartic hourglass factor; default 15000 with the effect `puncture`, more below cells of 0.4 mm (like h^-4), else 1000.
    pub hourglass_quartic: Option<f64>,
    /// Display frames per simulated second [Hz]; default 60.
    pub frame_rate_hz: Option<f64>,
    /// Length of a run without a tool [s]; with a tool the phases decide.
    pub duration_s: Option<f64>,
    /// What to do when the guard finds trouble: "stop" (default), or "halve_step": go back a little and on with half the
    /// time step, counted and told, at most four times.
    pub on_trouble: Option<OnTrouble>,
}

/// What to do when the guard finds trouble.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnTrouble {
    #[default]
    Stop,
    HalveStep,
}

/// A number or "auto".
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema)]
#[schemars(untagged)]
pub enum MassScalingEntry {
    Factor(f64),
    Word(AutoWord),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AutoWord {
    Auto,
}

/// What is written, and when.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct OutputsTable {
    /// Depths on the way in at which a picture is drawn [mm]; scenes with a tool.
    pub pictures_at_depth_mm: Option<Vec<f64>>,
    /// Depths on the way in at which a VTU file is written [mm]; scenes with a tool.
    pub fields_at_depth_mm: Option<Vec<f64>>,
    /// Times at which a picture is drawn [s]; scenes without a tool or with a free motion.
    pub pictures_at_s: Option<Vec<f64>>,
    /// Times at which a VTU file is written [s]; scenes without a tool or with a free motion.
    pub fields_at_s: Option<Vec<f64>>,
    /// Width of a picture in pixels, 64 to 8192; default 900.
    pub picture_width_px: Option<u32>,
    /// Upper end of the colour bar [kPa]; default: the largest stress in the picture.
    pub stress_scale_kpa: Option<f64>,
}

/// A material point of the tissue that the insertion wants to reach; it moves with the tissue.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetTable {
    /// Name in the outputs, e.g. "lesion"; default "target 1", "target 2", ...
    pub name: Option<String>,
    /// Where it lies at rest, in the coordinates of the block [mm].
    pub position_mm: [f64; 3],
    /// The tip hits it when it comes no farther away than this [mm]; default 1.
    pub radius_mm: Option<f64>,
}

/// What a trainee is asked to do with the needle of the scene. The motion of the scene is the reference attempt.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TaskTable {
    /// Short name, e.g. "hit a lesion"; attempts are kept under it.
    pub name: String,
    /// What the trainee reads before the start.
    pub briefing: String,
    /// The attempt must not take longer than this [s]; default: no limit.
    pub time_limit_s: Option<f64>,
    /// What must be reached, at least one, at most 16.
    #[serde(default)]
    pub goal: Vec<GoalTable>,
}

/// One goal: its kind, and the keys of that kind.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoalTable {
    pub kind: GoalKind,
    /// Name for messages; for avoid and stop_in_layer; default: that of the kind or the region.
    pub name: Option<String>,
    /// Name of a [[target]]; for hit_target; default: the first.
    pub target: Option<String>,
    /// Largest distance from tip to target at the end of the way in [mm]; for hit_target; default: its radius_mm.
    pub tolerance_mm: Option<f64>,
    /// A sphere that the needle stays away from [mm]; for avoid.
    pub sphere_mm: Option<SphereShapeTable>,
    /// A cylinder that the needle stays away from [mm]; for avoid.
    pub cylinder_mm: Option<CylinderTable>,
    /// Least distance between the outside of the needle and that of the obstacle [mm]; for avoid; default 0.
    pub clearance_mm: Option<f64>,
    /// Name of a [[region]] with `layer_mm` in which the tip stops; for stop_in_layer.
    pub region: Option<String>,
    /// The same as depths of its top and bottom below z = 0 [mm].
    pub depth_mm: Option<[f64; 2]>,
    /// Least mass of the core in the bore at the end [mg]; for core.
    pub mass_mg: Option<f64>,
    /// The same as a volume at rest [mm^3].
    pub volume_mm3: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GoalKind {
    HitTarget,
    Avoid,
    StopInLayer,
    Core,
}

/// Reads a text as one kind of entry and a table as another. `#[serde(untagged)]` would lose the line and say only
/// that nothing matched.
macro_rules! text_or_table {
    ($entry:ident, $expecting:literal, text => $from_text:expr, table => $from_table:expr) => {
        impl<'de> Deserialize<'de> for $entry {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Visitor;
                impl<'de> serde::de::Visitor<'de> for Visitor {
                    type Value = $entry;

                    fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                        f.write_str($expecting)
                    }

                    fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<$entry, E> {
                        let from_text: fn(StrDeserializer<E>) -> Result<$entry, E> = $from_text;
                        from_text(StrDeserializer::new(text))
                    }

                    fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<$entry, A::Error> {
                        Deserialize::deserialize(MapAccessDeserializer::new(map)).map($from_table)
                    }
                }
                deserializer.deserialize_any(Visitor)
            }
        }
    };
}

text_or_table!(FaceEntry, "\"free\", \"fixed\", \"roller\" or a table like {fixed = [\"x\"]}",
    text => |text| FaceKind::deserialize(text).map(FaceEntry::Kind), table => FaceEntry::Table);
text_or_table!(NeedleMaterialEntry, "the name of a needle material or a table like {youngs_modulus_gpa = 193, ..}",
    text => |text| String::deserialize(text).map(NeedleMaterialEntry::Preset), table => NeedleMaterialEntry::Table);

impl<'de> Deserialize<'de> for MassScalingEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl serde::de::Visitor<'_> for Visitor {
            type Value = MassScalingEntry;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a number of 1 or more, or \"auto\"")
            }

            fn visit_i64<E>(self, number: i64) -> Result<MassScalingEntry, E> {
                Ok(MassScalingEntry::Factor(number as f64))
            }

            fn visit_f64<E>(self, number: f64) -> Result<MassScalingEntry, E> {
                Ok(MassScalingEntry::Factor(number))
            }

            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<MassScalingEntry, E> {
                AutoWord::deserialize(StrDeserializer::new(text)).map(MassScalingEntry::Word)
            }
        }
        deserializer.deserialize_any(Visitor)
    }
}
