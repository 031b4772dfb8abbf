//! What passes between a run and its engine in a frame: the input of every step, and sums.

#![warn(missing_docs)]

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::energy::FrameEnergies;
use crate::model::Model;
use crate::needle::centre_line::{CentreLine, ENTRY_COUNT};
use crate::needle::{Kinematics, ToolPose};
use crate::scene::Face;

/// Ratio `k dt^2 / (4 m)` from which on an engine tells it: raised masses have 0.81.
pub const WATCHED_STEP_RATIO: f64 = 0.85;

/// Largest component of a displacement that a run goes on with [m]: of the 31 mm that the fixed point of the GPU engine holds. The CPU
/// engine could go on, but then the engines would end apart; what moves so far is tissue that tore off and that nothing holds.
pub const LARGEST_DISPLACEMENT: f64 = 0.03;

/// What is given to one step from outside: the only place where user input enters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepInput {
    /// Tool pose at the beginning of the step, where forces are evaluated.
    pub pose: Option<ToolPose>,
    /// Part of the loads on faces that acts at the beginning of the step, 0 to 1.
    pub load_factor: f64,
    /// Motion of the driven faces during the step.
    pub drives: [DriveStep; 6],
    /// Number of the step since t = 0.
    pub step: u64,
}

/// Displacement increment of a driven face during one step: `du = translation + (R1 - R0)(X - c)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DriveStep {
    /// Translation increment [m].
    pub translation: DVec3,
    /// cos(theta1) - cos(theta0) and sin(theta1) - sin(theta0).
    pub cosine: f64,
    /// sin(theta1) - sin(theta0).
    pub sine: f64,
}

/// One display frame of steps.
#[derive(Debug, Clone)]
pub struct FramePlan {
    /// Frame number.
    pub frame: u64,
    /// Steps before this frame.
    pub first_step: u64,
    /// One entry per step.
    pub steps: Vec<StepInput>,
    /// How the needle is bent during the frame; `None`: straight.
    pub centre_line: Option<CentreLine>,
}

impl StepInput {
    /// Input of the step that begins at `time` [s] and lasts `dt` [s], with the motion of the scene.
    pub fn at(model: &Model, time: f64, dt: f64) -> Self {
        Self::with(model, model.kinematics.as_ref(), time, dt)
    }

    /// The same with another motion of the tool.
    pub fn with(model: &Model, kinematics: Option<&Kinematics>, time: f64, dt: f64) -> Self {
        let ramp = |t: f64, duration: f64| {
            if duration > 0.0 { (t / duration).clamp(0.0, 1.0) } else { 1.0 }
        };
        let mut drives = [DriveStep::default(); 6];
        for face in Face::ALL {
            let Some(drive) = model.faces()[face as usize].drive else { continue };
            let (s0, s1) = (drive.part(time), drive.part(time + dt));
            let (t0, t1) = (drive.rotation * s0, drive.rotation * s1);
            drives[face as usize] = DriveStep {
                translation: drive.displacement * (s1 - s0),
                cosine: t1.cos() - t0.cos(),
                sine: t1.sin() - t0.sin(),
            };
        }
        StepInput {
            pose: kinematics.map(|k| k.pose_of_step(time, dt)),
            load_factor: ramp(time, model.load_ramp),
            drives,
            step: (time / dt).round() as u64,
        }
    }
}

/// Signs of trouble within one frame.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Health {
    /// Smallest J at cell centres, and at cell corners.
    pub min_j: f64,
    /// Smallest J at cell corners.
    pub min_corner_j: f64,
    /// Cells with J <= 0 at the centre or a corner.
    pub inverted_cells: u32,
    /// Of these the ones with J > 0 at the centre: only a corner is folded over, and the law is evaluated at the centre.
    pub folded_cells: u32,
    /// Index of one of them.
    pub inverted_cell: Option<u32>,
    /// Largest damage d; cells deleted so far; cell steps whose return mapping did not meet the yield condition.
    pub largest_damage: f64,
    /// Cells that are deleted or severed at the end of the frame.
    pub deleted_cells: u32,
    /// Cell steps of the frame whose return mapping missed the yield condition.
    pub return_failures: u32,
    /// Area of the cohesive faces that have parted: damage times area [m^2].
    pub torn_area: f64,
    /// Nodes whose speed was clamped, summed over the steps of the frame.
    pub clamped_nodes: u32,
    /// Largest nodal speed [m/s].
    pub max_speed: f64,
    /// Steps times nodes on which the selective mass was above the scaled mass.
    pub raised_mass: u32,
    /// True where a displacement or velocity is not a finite number in range.
    pub not_finite: bool,
}

/// Sums over one frame as an engine delivers them. "Total" fields are values at the end of the frame, the others
/// sums over the steps of the frame. SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameSums {
    /// Frame number.
    pub frame: u64,
    /// How many were summed.
    pub steps: u32,
    /// Impulse on the tissue [N s] along the insertion direction: tip law in the bulk and in membranes, tissue that sticks to the
    /// tip, contact normals, friction.
    pub cutting_impulse: f64,
    /// Tip law in membranes [N s].
    pub membrane_impulse: f64,
    /// Tissue that sticks to the tip [N s].
    pub adhesion_impulse: f64,
    /// Contact normals [N s].
    pub spreading_impulse: f64,
    /// The part of `spreading_impulse` that acts on the shaft of a needle.
    pub shaft_impulse: f64,
    /// Friction [N s].
    pub friction_impulse: f64,
    /// Normal force of the tissue on the shaft, summed along it, times the time: in the scheme `opening` [N s].
    pub shaft_normal_impulse: f64,
    /// Whole impulse [N s] and angular impulse about the tip [N m s], world frame.
    pub impulse: DVec3,
    /// About the tip, world frame [N m s].
    pub angular_impulse: DVec3,
    /// Work done by the tool [J]; with a flexible needle that of its hub, once the run has booked the beam.
    pub tool_work: f64,
    /// Of the last step only, with the speed of the tool after its beginning [J].
    pub last_tool_work: f64,
    /// Impulse on the tissue, shared over the entries of the centre-line [N s]; zero without a flexible needle.
    pub needle_loads: [DVec3; ENTRY_COUNT],
    /// Where the work went, and what is stored at the end.
    pub energy: FrameEnergies,
    /// Largest `k dt^2 / (4 m)` of a node in a step, with the bound k of its stiffness and the mass m that it had; the step
    /// is unstable beyond 1. Zero where none was near it, see [`WATCHED_STEP_RATIO`].
    pub step_ratio: f64,
    /// What each face exerts on the tissue at the last step [N]; zero without driven faces.
    pub reactions: [DVec3; 6],
    /// Moment of the same about the axis along the normal of the face through the centre of the tissue at rest [N m].
    pub face_moments: [f64; 6],
    /// Total: material coordinate a of the tip [m].
    pub tip_coordinate: f64,
    /// Work of driven faces, tractions and gravity [J].
    pub load_work: f64,
    /// Of the state at the end of the frame.
    pub health: Health,
    /// Total: displacement of every target [m].
    pub targets: Vec<DVec3>,
}
