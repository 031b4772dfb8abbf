//! What both engines offer, and what passes between them and the run.

use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::checkpoint::EngineImage;
use crate::effects::adhesion::Bond;
use crate::error::Result;
use crate::gpu::GpuEngine;
use crate::material_point::PointState;
use crate::model::Model;
use crate::needle::centre_line::{CentreLine, ENTRY_COUNT};
use crate::needle::free_path::FreeTip;
use crate::needle::{Kinematics, ToolPose};
use crate::observables::{FrameEnergies, Health};
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

/// The state that both engines can give and take, in f64 and SI, node order of the mesh.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct State {
    /// Displacement u [m].
    pub displacement: Vec<DVec3>,
    /// Velocity v at the last half step [m/s].
    pub velocity: Vec<DVec3>,
    /// Remaining stiffness per cell; empty without `puncture`.
    pub stiffness: Vec<f64>,
    /// Material coordinate of the tip [m].
    pub tip_coordinate: f64,
    /// Tip on a free path; at rest on a planned one.
    pub tip: FreeTip,
    /// Marked sample points per cell of the box of a free path, bit = x + 4 y + 16 z; empty on a planned one.
    pub cut_samples: Vec<u64>,
    /// Tissue that sticks to the tip.
    pub bond: Bond,
    /// Memory per contact node: stretch of the stick spring [m], overlap at activation [m], axial position at
    /// activation [m]; `touching` tells whether the last two are set.
    pub contact: Vec<ContactState>,
    /// Damage D of every pair of copies that may separate.
    pub pairs: Vec<f64>,
    /// History per cell; empty without `plasticity` and `viscoelastic`.
    pub points: Vec<PointState>,
}

impl State {
    /// True where both are states of one model.
    pub fn fits(&self, other: &State) -> bool {
        let sizes = |s: &State| {
            [
                s.displacement.len(),
                s.velocity.len(),
                s.stiffness.len(),
                s.cut_samples.len(),
                s.contact.len(),
                s.pairs.len(),
                s.points.len(),
            ]
        };
        sizes(self) == sizes(other)
    }
}

/// Memory of one contact node.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ContactState {
    pub stick: DVec3,
    pub overlap: f64,
    pub axial_on: f64,
    pub touching: bool,
    /// True while it is pressed by the full shaft.
    pub on_shaft: bool,
    /// On a free path: distance r0 from the axis where the tip passed [m], and whether it has.
    pub rest_radius: f64,
    pub passed: bool,
    /// Held by its springs at the last step [J].
    pub stored: f64,
    /// Force of the contact damping at the last step [N].
    pub damping: DVec3,
}

impl ContactState {
    /// Takes the damping force of a step; dissipated in the last step of `dt` [J], in which the node moved with `v` past the tool: its
    /// mean force times the way. Forces belong to the beginnings of steps, velocities to their middles.
    pub fn damped(&mut self, force: DVec3, v: DVec3, dt: f64) -> f64 {
        let before = std::mem::replace(&mut self.damping, force);
        -0.5 * dt * (before + force).dot(v)
    }
}

/// What an engine tells about itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EngineInfo {
    /// `gpu` or `cpu`.
    pub engine: String,
    pub adapter: String,
    pub driver: String,
    /// Bytes of all buffers on the device (or of the arrays of the CPU engine).
    pub device_bytes: u64,
    /// True for a software adapter.
    pub software: bool,
}

/// A solver that can advance a model. Frames are started in order; results come in the same order, possibly a
/// frame or two later.
pub trait Engine: Send {
    fn info(&self) -> &EngineInfo;
    /// The engine on a device, for those who draw from its buffers.
    fn on_device(&self) -> Option<&GpuEngine> {
        None
    }
    /// Starts one frame. Returns as soon as the work is submitted.
    fn start_frame(&mut self, plan: &FramePlan) -> Result<()>;
    /// The next finished frame. With `wait`, blocks until one is there; `None` when none is under way (or
    /// finished, without `wait`).
    fn collect(&mut self, wait: bool) -> Result<Option<FrameSums>>;
    /// Takes the constants of `model`, which has the mesh and the effects of the present one, and steps of `dt` [s], `steps` of them in
    /// a frame; the state stays. Call it between frames. False where other buffers or kernels would be needed; nothing has changed then.
    fn retune(&mut self, model: Arc<Model>, dt: f64, steps: usize) -> Result<bool>;
    /// The present state (waits for all frames under way).
    fn read_state(&mut self) -> Result<State>;
    /// Replaces the state, for tests, resumed runs and bisecting.
    fn write_state(&mut self, state: &State) -> Result<()>;
    /// Everything between two frames, exactly (waits for all frames under way).
    fn save(&mut self) -> Result<EngineImage>;
    /// Goes back to an image of the same model and time step.
    ///
    /// # Errors
    /// `Error::Input` where the image is that of another engine or model.
    fn restore(&mut self, image: &EngineImage) -> Result<()>;
    /// Loses the device, as when a driver resets it, to see what follows: every later call fails with `Error::Device`. Nothing on
    /// an engine without one.
    fn lose_device(&mut self) {}
    /// Internal nodal forces of the present displacement, `f_int` [N] (the tissue pushes the node with -f_int).
    fn internal_forces(&mut self) -> Result<Vec<DVec3>>;
}
