//! What passes between a run and its engine in a frame: the input of every step, and sums.

use glam::DVec3;

use crate::model::Model;
use crate::needle::centre_line::{CentreLine, ENTRY_COUNT};
use crate::needle::{Kinematics, ToolPose};
use crate::scene::Face;

/// Ratio `k dt^2 / (4 m)` from which on an engine tells it: raised masses have 0.81.
pub const WATCHED_STEP_RATIO: f64 = 0.85;

/// What is given to one step from outside: the only place where user input enters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepInput {
    /// Tool pose at the beginning of the step, where forces are evaluated.
    pub pose: Option<ToolPose>,
    /// Increment of the ramped loads' factor: value at the beginning of the step, 0..1.
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

/// Sums over one frame as an engine delivers them. "Total" fields are values at the end of the frame, the others
/// sums over the steps of the frame. SI.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FrameSums {
    pub frame: u64,
    pub steps: u32,
    /// Impulse on the tissue [N s] along the insertion direction: tip law in the bulk and in membranes, tissue that sticks to the
    /// tip, contact normals, friction.
    pub cutting_impulse: f64,
    pub membrane_impulse: f64,
    pub adhesion_impulse: f64,
    pub spreading_impulse: f64,
    /// The part of `spreading_impulse` that acts on the shaft of a needle.
    pub shaft_impulse: f64,
    pub friction_impulse: f64,
    /// Whole impulse [N s] and angular impulse about the tip [N m s], world frame.
    pub impulse: DVec3,
    pub angular_impulse: DVec3,
    /// Work done by the tool [J]; with a flexible needle that of its hub, once the run has booked the beam.
    pub tool_work: f64,
    /// Of the last step only, with the speed of the tool after its beginning [J].
    pub last_tool_work: f64,
    /// Impulse on the tissue, shared over the entries of the centre-line [N s]; zero without a flexible needle.
    pub needle_loads: [DVec3; ENTRY_COUNT],
    /// Total: gained and damped by a flexible needle [J].
    pub needle_energy: f64,
    /// Dissipated by friction, by contact damping, by the tip law, by softening [J].
    pub friction_dissipation: f64,
    pub contact_dissipation: f64,
    pub tip_dissipation: f64,
    pub softening_dissipation: f64,
    /// Dissipated by the tip law beyond the threshold, where the cap on the advance held the force above it [J].
    pub cap_dissipation: f64,
    /// Taken by nodes whose mass was raised, and by the speed limit [J].
    pub raised_mass_energy: f64,
    pub speed_limit_energy: f64,
    /// Largest `k dt^2 / (4 m)` of a node in a step, with the bound k of its stiffness and the mass m that it had; the step
    /// is unstable beyond 1. Zero where none was near it, see [`WATCHED_STEP_RATIO`].
    pub step_ratio: f64,
    /// Dissipated by tissue that slips on the tip [J].
    pub adhesion_dissipation: f64,
    /// Dissipated by plastic flow and by damage [J].
    pub plastic_dissipation: f64,
    pub damage_dissipation: f64,
    /// Total: dissipated by the Prony terms [J].
    pub viscous_dissipation: f64,
    /// Dissipated by cohesive faces [J]; total: stored in them [J].
    pub cohesive_dissipation: f64,
    pub cohesive_energy: f64,
    /// Total: torn area, damage times area over all pairs [m^2].
    pub torn_area: f64,
    /// What each face exerts on the tissue at the last step [N]; zero without driven faces.
    pub reactions: [DVec3; 6],
    /// Moment of the same about the axis along the normal of the face through the centre of the tissue at rest [N m].
    pub face_moments: [f64; 6],
    /// Total: stored in contact, stick, tip and bond springs [J].
    pub contact_energy: f64,
    /// Total: material coordinate a of the tip [m].
    pub tip_coordinate: f64,
    /// Total: elastic and hourglass energy at the beginning of the last step [J], where its forces belong.
    pub elastic: f64,
    pub hourglass: f64,
    /// Total: kinetic energy [J], of the velocities in the middle of the last step.
    pub kinetic: f64,
    /// Total: what stored energies gained from the beginning to the middle of the last step, `-dt/2 sum f v`, and half of the tool's work in it [J]; zero without a step.
    pub half_step: f64,
    /// Dissipated by mass damping [J].
    pub damping_dissipation: f64,
    /// Work of driven faces, tractions and gravity [J].
    pub load_work: f64,
    /// Health of the state at the end of the frame.
    pub min_j: f64,
    pub min_corner_j: f64,
    pub inverted_cells: u32,
    /// Of these the ones with J > 0 at the centre, where the law is evaluated.
    pub folded_cells: u32,
    pub inverted_cell: Option<u32>,
    /// Largest d; cells that were deleted; cell steps whose return mapping did not meet the yield condition.
    pub largest_damage: f64,
    pub deleted_cells: u32,
    pub return_failures: u32,
    pub clamped_nodes: u32,
    pub raised_mass: u32,
    pub max_speed: f64,
    pub not_finite: bool,
    /// Total: displacement of every target [m].
    pub targets: Vec<DVec3>,
}
