//! What a run tells about itself: one record per display frame, fields on request. [`quantity`] lists what stands in tables,
//! [`crate::engine::energy`] where the work goes, [`field`] what is written and drawn of the tissue.

#![warn(missing_docs)]

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::needle::centre_line::CentreLine;
use crate::verdict::Verdict;

/// Force that moves the tool, in parts [N]; positive along the insertion direction. Means over the frame. All parts but
/// bone and inertia act on the tissue.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ForceParts {
    /// What the hand feels along the insertion: sum of the parts [N].
    pub axial: f64,
    /// Tip law in the bulk: puncture and cutting [N].
    pub cutting: f64,
    /// Tip law while the tip is in a membrane [N].
    pub membrane: f64,
    /// Contact normal on the tip of a needle, s < tip length, or on an indenter [N].
    pub tip_spreading: f64,
    /// Contact normal on the shaft [N].
    pub shaft_spreading: f64,
    /// Friction [N].
    pub friction: f64,
    /// Tissue that sticks to the tip [N].
    pub adhesion: f64,
    /// Normal force of the tissue on the shaft, summed along it; it is no part of the axial force. Zero but in the scheme `opening` [N].
    #[serde(default)]
    pub shaft_normal: f64,
    /// Bone that the tip stands on [N]; it acts on no tissue.
    #[serde(default)]
    pub bone: f64,
    /// Mass of the needle times the acceleration of its prescribed motion, mean over the length of a frame [N].
    pub inertia: f64,
    /// Lateral force on the tissue, world frame with the axial part removed [N].
    pub lateral: DVec3,
    /// Torque on the tissue about the tip, world frame [N m].
    pub torque: DVec3,
}

/// One addend of the axial force, as tables, charts and reports show it.
#[derive(Debug, Clone, Copy)]
pub struct ForcePart {
    /// Name in legends.
    pub name: &'static str,
    /// Column of `force.csv`.
    pub column: &'static str,
    /// What it is, in words of a table.
    pub meaning: &'static str,
    /// Red, green, blue; people with colour-blindness tell the parts apart (Okabe and Ito 2008).
    pub colour: [u8; 3],
    /// Its share of the axial force [N].
    pub of: fn(&ForceParts) -> f64,
}

impl ForceParts {
    /// The parts that add up to `axial`, from the bottom of a stack to its top. A new part is one line here: columns,
    /// charts and reports follow this list.
    pub const PARTS: [ForcePart; 8] = [
        ForcePart {
            name: "cutting",
            column: "cutting_force_n",
            meaning: "tip law in the bulk: puncture and cutting (the force that was measured, not the key of that name in a scene)",
            colour: [204, 121, 167],
            of: |f| f.cutting,
        },
        ForcePart {
            name: "membrane",
            column: "membrane_force_n",
            meaning: "tip law while the tip is in a membrane",
            colour: [213, 94, 0],
            of: |f| f.membrane,
        },
        ForcePart {
            name: "spreading, tip",
            column: "tip_spreading_force_n",
            meaning: "contact normal on the tip of a needle, or on an indenter",
            colour: [0, 158, 115],
            of: |f| f.tip_spreading,
        },
        ForcePart {
            name: "spreading, shaft",
            column: "shaft_spreading_force_n",
            meaning: "contact normal on the shaft",
            colour: [86, 180, 233],
            of: |f| f.shaft_spreading,
        },
        ForcePart {
            name: "friction",
            column: "friction_force_n",
            meaning: "friction",
            colour: [230, 159, 0],
            of: |f| f.friction,
        },
        ForcePart {
            name: "adhesion",
            column: "adhesion_force_n",
            meaning: "tissue that sticks to the tip",
            colour: [240, 228, 66],
            of: |f| f.adhesion,
        },
        ForcePart {
            name: "bone",
            column: "bone_force_n",
            meaning: "bone, or another rigid part, that the tip stands on",
            colour: [0, 114, 178],
            of: |f| f.bone,
        },
        ForcePart {
            name: "inertia",
            column: "inertia_force_n",
            meaning: "mass of the needle times the acceleration of its prescribed motion",
            colour: [128, 128, 128],
            of: |f| f.inertia,
        },
    ];
}

/// A flexible needle at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct NeedleRecord {
    /// Where the tip is off the straight axis [m].
    pub tip_offset: DVec3,
    /// How far the tip stays behind that of a straight needle [m].
    pub retreat: f64,
    /// Largest distance of the centre-line from the axis [m].
    pub largest_offset: f64,
    /// Largest axial compression [N].
    pub compression: f64,
    /// Energy of bending [J].
    pub bending_energy: f64,
    /// True once the needle has buckled.
    pub buckled: bool,
    /// True where the beam did not find its balance.
    pub unbalanced: bool,
}

/// One display frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Frame number, from 0; the record describes the state at its end.
    pub frame: u64,
    /// Steps since t = 0.
    pub step: u64,
    /// Time at the end of the frame [s].
    pub time: f64,
    /// Depth of the tool tip along the insertion direction, mean over the frame [m] (negative: outside).
    pub depth: f64,
    /// Index of the motion phase.
    pub phase: usize,
    /// Means over the frame.
    pub force: ForceParts,
    /// Half-width of the band of the axial force, see [`error_bar`]; with a companion run only [N].
    #[serde(default)]
    pub force_error: Option<f64>,
    /// Material coordinate of the tip along its path, a [m].
    pub tip_coordinate: f64,
    /// What each face exerts on the tissue at the end of the frame, indexed by `Face` [N]; zero without driven faces.
    pub reactions: [DVec3; 6],
    /// Moment of the same about the axis along the normal of the face through the centre of the tissue at rest, right-handed about the
    /// coordinate axis [N m].
    pub face_moments: [f64; 6],
    /// Where the work since t = 0 went.
    pub energy: EnergyAccount,
    /// On the run up to this frame.
    pub verdict: Verdict,
    /// Zero without a flexible needle.
    pub needle: NeedleRecord,
    /// Signs of trouble within the frame.
    pub health: Health,
    /// What the bore of a hollow needle holds.
    pub core: Option<CoreSample>,
    /// The targets of the scene, in its order.
    pub targets: Vec<TargetRecord>,
}

/// Fields of one moment, for VTU files and pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FieldSnapshot {
    /// Frame at whose end it was taken.
    pub frame: u64,
    /// Time [s].
    pub time: f64,
    /// Depth of the tool [m].
    pub depth: f64,
    /// Axial force of the frame [N].
    pub axial_force: f64,
    /// Tip position of the tool and its direction of insertion (unit), if there is a tool.
    pub tool_pose: Option<(DVec3, DVec3)>,
    /// Centre-line of a needle that bends, from that tip on.
    pub centre_line: Option<CentreLine>,
    /// Cells whose centre lies in the wall of the needle; `None` without a needle that cuts.
    pub cells_in_needle: Option<usize>,
    /// Where the targets of the scene are now [m].
    pub targets: Vec<DVec3>,
    /// Displacement per node [m], node order of the mesh.
    pub displacement: Vec<DVec3>,
    /// Von Mises stress per cell [Pa].
    pub von_mises: Vec<f64>,
    /// Jacobian J per cell.
    pub jacobian: Vec<f64>,
    /// Pressure, -trace(Cauchy)/3, per cell [Pa].
    pub pressure: Vec<f64>,
    /// Remaining stiffness per cell, 1 = intact; empty without the effect `puncture`.
    pub stiffness: Vec<f64>,
    /// Equivalent plastic strain alpha and damage d per cell; empty without `plasticity`, `damage`.
    pub plastic_strain: Vec<f64>,
    /// Damage d per cell, 0..1; empty without `damage`.
    pub damage: Vec<f64>,
    /// Index of the material per cell, 0 outside all regions; empty without regions.
    pub material: Vec<f64>,
    /// The path, where it is open and cells do not show it.
    pub opened: Option<OpenedPath>,
    /// Displacement to where the tissue is seen beside that path, per node [m]; empty without such a path.
    pub opened_displacement: Vec<DVec3>,
}

mod core_sample;
pub mod error_bar;
#[allow(missing_docs)]
pub mod field;
#[allow(missing_docs)]
mod judge;
mod needle_volume;
mod opened_path;
#[allow(missing_docs)]
pub mod quantity;
mod recorder;
#[allow(missing_docs)]
mod target;

pub use crate::engine::{EnergyAccount, EnergyPart, FrameEnergies, Health};
pub use core_sample::CoreSample;
pub use judge::{Judge, Sizes, Trouble};
pub use needle_volume::cells_in_needle;
pub use opened_path::{OpenedCell, OpenedPath, OpenedPlace};
pub use recorder::Recorder;
pub use target::TargetRecord;
