//! The TOML form of a scene: what a person writes, units in the key names. Unknown keys are errors.
//!
//! The doc comments are the descriptions of the JSON schema. Ranges and relations between keys are checked in
//! `convert`, where a message can point at the line.

mod material;
mod task;
mod tool;

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Deserializer};

pub use material::{
    BoxTable, CuttingTable, CylinderTable, LabelEntries, LabelEntry, LibraryFile, LibraryMaterial, MaterialTable,
    MembraneTable, RegionTable, SphereShapeTable,
};
pub use task::{GoalKind, GoalTable, TaskTable};
pub use tool::{
    FlatPunchTable, MotionTable, NeedleMaterialEntry, NeedleMaterialTable, NeedleTable, PhaseKind, PhaseTable,
    SphereTable, VibrationTable,
};

use super::words;
pub use crate::effects::adhesion::AdhesionTable;
pub use crate::effects::cohesive::CohesiveTable;
pub use crate::effects::damage::DamageTable;
pub use crate::effects::fibres::FibresTable;
pub use crate::effects::flexible_needle::FlexibleNeedleTable;
pub use crate::effects::friction::FrictionTable;
pub use crate::effects::gravity::GravityTable;
pub use crate::effects::indentation::IndentationTable;
pub use crate::effects::plasticity::PlasticityTable;
pub use crate::effects::puncture::PunctureTable;
pub use crate::effects::viscoelastic::ViscoelasticTable;

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
use text_or_table;

/// A Stylet scene.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(transform = words::self_contained_tables)]
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
    /// What holds, moves or loads the six faces; default: what `tissue.supports` holds, else sides and bottom fixed, top free; all free for a
    /// mesh.
    #[serde(default)]
    pub boundaries: BoundariesTable,
    /// Node sets of a mesh that are held.
    #[serde(default)]
    pub support: Vec<SupportTable>,
    /// Tractions and pressures on sets of a mesh, at most 64.
    #[serde(default)]
    #[schemars(length(max = 64))]
    pub load: Vec<LoadTable>,
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
    /// A label map of a patient (.nrrd, .nii, .nii.gz, .mha, .mhd) in which the block lies; relative to the scene file. The block then
    /// follows the needle from `motion.entry_ras_mm` to `motion.target_ras_mm`; `size_mm` is its width in x and y and its depth below
    /// the skin; default: 40 mm wide and half as deep again as the path.
    pub labels: Option<String>,
    /// Labels that are no tissue, by number or name, e.g. air in the trachea.
    pub outside: Option<LabelEntries>,
    /// Closed surfaces (.stl, .obj, .ply, .vtp) instead of a label map, in the same coordinates; each is a label, called like its file or
    /// like the surface in it, and where two overlap the later one counts. `unit` is that of the files.
    #[serde(default)]
    pub surfaces: Vec<String>,
    /// Where mesh, label map or surfaces are put, for a file in odd units or one that lies on its side; a table, or inline:
    /// `transform = { scale = 0.1, axis = [1, 0, 0], angle_deg = 90 }`.
    pub transform: Option<TransformTable>,
    /// What holds the tissue: "sides" (the four side faces of the block, or of the box around a mesh), "back" (the face that the needle
    /// points at; of a block the bottom), "bones" (what is `rigid`), "skin" (skin farther than `skin_free_mm` from the path). A face that
    /// `[boundaries]` names is as it says there. Default: sides, back and bones; of a mesh nothing.
    #[schemars(extend("uniqueItems" = true))]
    pub supports: Option<Vec<SupportWord>>,
    /// Distance from the path, from entry to deepest point, within which skin is free where `supports` lists "skin" [mm]; default 10.
    pub skin_free_mm: Option<f64>,
}

/// What may hold the tissue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SupportWord {
    Sides,
    Back,
    Bones,
    Skin,
}

impl SupportWord {
    /// As a scene writes it.
    pub fn key(self) -> &'static str {
        ["sides", "back", "bones", "skin"][self as usize]
    }
}

/// Where a file of tissue is put: scaled about the origin of its coordinates (of a label map: of the patient, RAS), then turned about an
/// axis through it, then moved. All other coordinates of the scene are places behind that.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TransformTable {
    /// Factor on all coordinates, beside `unit`, greater than 0; default 1.
    pub scale: Option<f64>,
    /// Axis that the file is turned about, any length; with `angle_deg`.
    pub axis: Option<[f64; 3]>,
    /// Angle of the turn, right-handed about `axis` [deg].
    pub angle_deg: Option<f64>,
    /// Way that the file is moved at last [mm]; default [0, 0, 0].
    pub translation_mm: Option<[f64; 3]>,
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

/// A load on the surface of a mesh: exactly one of traction and pressure. Loads are dead: they act on rest areas and keep their direction.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LoadTable {
    /// Name of a node or surface set in the mesh file: the triangles of the surface with all nodes in it; default: the whole surface.
    pub set: Option<String>,
    /// Force per rest area along x, y, z of the mesh [kPa].
    pub traction_kpa: Option<[f64; 3]>,
    /// Pressure against the surface at rest, negative for suction [kPa].
    pub pressure_kpa: Option<f64>,
    /// Time over which the load grows linearly [s], the same for all loads of the scene; default 0: at once.
    pub ramp_s: Option<f64>,
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
    /// Time over which the load grows linearly [s], the same for all loaded faces; default 0: at once.
    pub traction_ramp_s: Option<f64>,
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
    /// Depths on the way in at which displacement field, deformed label map, needle and targets are written for 3D Slicer [mm]; scenes
    /// with `tissue.labels` and a tool.
    pub volumes_at_depth_mm: Option<Vec<f64>>,
    /// Times of the same [s]; scenes with `tissue.labels`, without a tool or with a free motion.
    pub volumes_at_s: Option<Vec<f64>>,
    /// Every how many voxels of the label map these volumes have one, along each axis, 1 to 16; default 1.
    pub volume_stride: Option<u32>,
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
    pub position_mm: Option<[f64; 3]>,
    /// The same in the patient, RAS [mm]; with `tissue.labels`.
    pub position_ras_mm: Option<[f64; 3]>,
    /// The tip hits it when it comes no farther away than this [mm]; default 1.
    pub radius_mm: Option<f64>,
}

text_or_table!(FaceEntry, "\"free\", \"fixed\", \"roller\" or a table like {fixed = [\"x\"]}",
    text => |text| FaceKind::deserialize(text).map(FaceEntry::Kind), table => FaceEntry::Table);

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
