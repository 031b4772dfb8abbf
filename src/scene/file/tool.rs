//! The tool and its motion as they are written.

use schemars::JsonSchema;
use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Deserializer};

use super::super::words;
use super::text_or_table;

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
    /// Entry point on the surface of a mesh or near it, in the coordinates of the mesh [mm]; with `tissue.mesh`. The surface itself is
    /// found along the direction of the insertion, and depths count from there.
    pub entry_point_mm: Option<[f64; 3]>,
    /// Point of a mesh that the needle is led to [mm], instead of `direction` and `angle_deg`; with `tissue.mesh`. An insertion without
    /// `depth_mm` ends there.
    pub target_point_mm: Option<[f64; 3]>,
    /// Entry point on the skin of a patient, RAS [mm]; with `tissue.labels`. What lies on the line to the target counts: the skin
    /// itself is found there.
    pub entry_ras_mm: Option<[f64; 3]>,
    /// Point of the patient that the needle is led to, RAS [mm]; with `tissue.labels`.
    pub target_ras_mm: Option<[f64; 3]>,
    /// Entry and target as the first two points of a file of 3D Slicer (.mrk.json, .fcsv) instead; relative to the scene file.
    pub markups: Option<String>,
    /// Direction of the insertion, any length, z < 0 (into a mesh: any); default [0, 0, -1]. Or give `angle_deg`.
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

text_or_table!(NeedleMaterialEntry, "the name of a needle material or a table like {youngs_modulus_gpa = 193, ..}",
    text => |text| String::deserialize(text).map(NeedleMaterialEntry::Preset), table => NeedleMaterialEntry::Table);
