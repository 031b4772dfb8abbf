//! The flexible needle of a run: the beam between the frames. Scheme: src/effects/flexible_needle.rs.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::Simulation;
use crate::effects::flexible_needle::Params;
use crate::engine::{FramePlan, FrameSums};
use crate::material_point::Material;
use crate::model::Model;
use crate::needle::beam::{Beam, HubPose, Loads, NodeSpring, TimeRule};
use crate::needle::centre_line::{CentreLine, ENTRY_COUNT};
use crate::needle::{Kinematics, ToolPose};
use crate::observables::{FrameRecord, NeedleRecord};

/// How far the table reaches beyond the deepest point [m].
const BEYOND: f64 = 5e-3;

/// Buckled: compressed beyond this part of the load at which the needle with a free tip buckles, and further from the axis
/// than this part of its length.
const BUCKLING_LOAD_PART: f64 = 0.9;
const BUCKLING_OFFSET_PART: f64 = 0.01;

/// The needle at one moment.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Shape {
    /// Lateral offsets of the centre-line [m] and the arc positions from the hub [m] that have them.
    offset: [DVec3; ENTRY_COUNT],
    arc: [f64; ENTRY_COUNT],
    /// How far the tip stays behind the tip of a straight needle [m].
    retreat: f64,
    nodes: Vec<DVec3>,
}

/// What a step of the beam took from the loads that it was given.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Taken {
    /// Work of the loads, with what the Robin springs foresee at the end, on the motion relative to the hub [J].
    relative_work: f64,
    /// Gain of stored and kinetic energy, and what the time rule damped [J].
    gained: f64,
    damped: f64,
}

/// The beam of a run. It is one frame ahead: `end` is where the frame that is started next will leave the needle.
pub struct FlexibleNeedle {
    params: Params,
    beam: Beam,
    /// Distance between the entries of the table [m].
    spacing: f64,
    /// What the tissue is taken to oppose to a lateral move of the needle.
    tissue: LateralTissue,
    /// Estimate of what it opposes to a move of the tip along the axis [N/m].
    tip_stiffness: f64,
    start: Shape,
    end: Shape,
    taken: Taken,
    buckled: bool,
    converged: bool,
    /// Offsets at the end of the frame that was answered last [m].
    answered: [DVec3; ENTRY_COUNT],
    /// Stored since t = 0 and damped since t = 0 [J].
    energy: f64,
}

/// The beam between two frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct NeedleImage {
    beam: Beam,
    start: Shape,
    end: Shape,
    taken: Taken,
    buckled: bool,
    converged: bool,
    answered: [DVec3; ENTRY_COUNT],
    energy: f64,
}

impl FlexibleNeedle {
    /// Everything that changes during a run.
    pub fn save(&self) -> NeedleImage {
        NeedleImage {
            beam: self.beam.clone(),
            start: self.start.clone(),
            end: self.end.clone(),
            taken: self.taken,
            buckled: self.buckled,
            converged: self.converged,
            answered: self.answered,
            energy: self.energy,
        }
    }

    /// Goes back to an image of the same needle.
    pub fn restore(&mut self, image: &NeedleImage) {
        let NeedleImage { beam, start, end, taken, buckled, converged, answered, energy } = image.clone();
        (self.beam, self.start, self.end, self.taken) = (beam, start, end, taken);
        (self.buckled, self.converged, self.answered, self.energy) = (buckled, converged, answered, energy);
    }

    /// The needle of a scene, bent by its weight; `first_frame`: length of the first frame [s]. `None` without the effect.
    pub fn new(model: &Model, kinematics: Option<&Kinematics>, first_frame: f64) -> Option<Self> {
        let (params, kinematics) = (model.effects.flexible_needle?, kinematics?);
        let plan = model.puncture.as_ref()?;
        let pose = kinematics.pose(0.0);
        let mut beam = Beam::straight(params.beam, hub(&params, &pose));
        let mut loads = beam.loads();
        loads.gravity = params.gravity;
        beam.settle(hub(&params, &pose), &loads);
        let reach = (model.scene.motion.deepest() + BEYOND).min(params.beam.length);
        let width = 0.5 * model.scene.tissue.size.x.min(model.scene.tissue.size.y);
        let stiffest = model.materials.iter().map(|m| m.law.shear_modulus()).fold(0.0, f64::max);
        let mut needle = FlexibleNeedle {
            params,
            spacing: reach / (ENTRY_COUNT - 1) as f64,
            tissue: LateralTissue::new(model, plan.needle.radius, plan.params.ring_radius, width),
            tip_stiffness: 1.0 / (1.0 / plan.params.tip_stiffness + 1.0 / (16.0 * stiffest * plan.needle.radius)),
            start: Shape {
                offset: [DVec3::ZERO; ENTRY_COUNT],
                arc: [0.0; ENTRY_COUNT],
                retreat: 0.0,
                nodes: Vec::new(),
            },
            end: Shape { offset: [DVec3::ZERO; ENTRY_COUNT], arc: [0.0; ENTRY_COUNT], retreat: 0.0, nodes: Vec::new() },
            taken: Taken::default(),
            buckled: false,
            converged: true,
            answered: [DVec3::ZERO; ENTRY_COUNT],
            energy: 0.0,
            beam,
        };
        needle.end = needle.shape(&pose);
        needle.step(kinematics, loads, DVec3::ZERO, first_frame, first_frame);
        Some(needle)
    }

    /// Present shape of the beam; `pose`: of the straight needle.
    fn shape(&self, pose: &ToolPose) -> Shape {
        let along = |x: DVec3| (x - pose.tip).dot(pose.direction);
        let retreat = -along(self.beam.tip());
        let arc: [f64; ENTRY_COUNT] = std::array::from_fn(|i| {
            let wanted = -retreat - self.spacing * i as f64;
            // Bisection: the centre-line advances along the axis as long as it does not turn back.
            let (mut low, mut high) = (0.0, self.params.beam.length);
            for _ in 0..44 {
                let middle = 0.5 * (low + high);
                if along(self.beam.position_at(middle)) < wanted { low = middle } else { high = middle }
            }
            0.5 * (low + high)
        });
        let offset = arc.map(|s| {
            let x = self.beam.position_at(s) - pose.tip;
            x - pose.direction * x.dot(pose.direction)
        });
        Shape { offset, arc, retreat, nodes: self.beam.position.clone() }
    }

    /// Moves the beam over the next frame, which lasts `duration` and ends at `time` [s]. `transmitted`: sum of the forces in
    /// `loads`, which the hub feels as they are [N].
    fn step(&mut self, kinematics: &Kinematics, loads: Loads, transmitted: DVec3, time: f64, duration: f64) {
        let pose = kinematics.pose(time);
        let before = (self.beam.energy().total(), self.beam.hub().position, self.beam.position.clone());
        let done = self.beam.advance(hub(&self.params, &pose), &loads, duration, TimeRule::BackwardEuler);
        let travel = self.beam.hub().position - before.1;
        let (mut spring_work, mut relative_work) = (0.0, done.load_work - transmitted.dot(travel));
        for (n, spring) in loads.springs.iter().enumerate().filter_map(|(n, s)| s.map(|s| (n, s))) {
            let (force, moved) = (spring.force(self.beam.position[n]), self.beam.position[n] - before.2[n]);
            spring_work += force.dot(moved);
            relative_work += force.dot(moved - travel);
        }
        self.taken = Taken {
            relative_work,
            gained: self.beam.energy().total() - before.0,
            // What the springs gave by the trapezoidal rule, against their force at the end, is damping too.
            damped: done.dissipated + done.spring_energy + spring_work,
        };
        self.buckled |= done.buckled;
        self.converged = done.converged;
        let next = self.shape(&pose);
        self.start = std::mem::replace(&mut self.end, next);
    }

    /// Bends the needle of the frame that is started next: its table, and tips that stay behind.
    pub fn bend(&self, plan: &mut FramePlan, dt: f64) {
        let duration = plan.steps.len() as f64 * dt;
        let retreat_rate = (self.end.retreat - self.start.retreat) / duration;
        for (n, input) in plan.steps.iter_mut().enumerate() {
            let Some(pose) = &mut input.pose else { continue };
            let retreat = self.start.retreat + retreat_rate * dt * n as f64;
            pose.tip -= pose.direction * retreat;
            pose.velocity -= pose.direction * retreat_rate;
            pose.depth -= retreat;
        }
        plan.centre_line = Some(CentreLine {
            spacing: self.spacing,
            first_step: plan.first_step,
            offset: self.start.offset,
            rate: std::array::from_fn(|i| (self.end.offset[i] - self.start.offset[i]) / duration),
        });
    }

    /// Takes the loads of the frame that was bent last and lasted `duration` [s], turns the tool's work into that of the
    /// hub, and bends the needle for the next frame, `next`: its end and length [s].
    pub fn answer(
        &mut self,
        kinematics: &Kinematics,
        sums: &mut FrameSums,
        duration: f64,
        next: Option<(f64, f64)>,
    ) -> NeedleRecord {
        let axis = self.beam.hub().direction;
        let retreat_rate = (self.end.retreat - self.start.retreat) / duration;
        let on_tissue: f64 = (0..ENTRY_COUNT)
            .map(|i| {
                let rate = (self.end.offset[i] - self.start.offset[i]) / duration - axis * retreat_rate;
                sums.needle_loads[i].dot(rate)
            })
            .sum();
        // The hub moves the needle as a whole; bending is paid from the loads. What the beam got by the loads that it
        // expected and what the tissue did in the end differ by the error of the coupling, which stays in the balance.
        sums.tool_work += self.taken.gained + self.taken.damped - self.taken.relative_work - on_tissue;
        self.energy += self.taken.gained + self.taken.damped;
        sums.energy.needle = self.energy;
        let record = self.record();
        let Some((time, length)) = next else { return record };
        let mut loads = self.beam.loads();
        loads.gravity = self.params.gravity;
        let mut transmitted = DVec3::ZERO;
        for (impulse, arc) in sums.needle_loads.iter().zip(self.end.arc) {
            let force = -*impulse / duration;
            transmitted += force;
            self.beam.add_force(&mut loads, arc, force);
        }
        let h = self.beam.element_length();
        let dynamic = self.tissue.dynamic_stiffness(length);
        let stiffness = self.tissue.stiffness + dynamic;
        let count = self.beam.node_count();
        // The loads belong to the middle of the frame. A needle that keeps its shape goes on with the hub and finds the same
        // loads there (cutting goes on); one whose tip stays behind finds less. Of a tip that already stays behind, half of
        // that motion is expected to go on: all of it would make the coupling unstable.
        let middle = 0.5 * (self.start.nodes[0] + self.end.nodes[0]);
        let straight_on = kinematics.pose(time).tip - axis * self.params.beam.length - middle;
        let ahead = straight_on.dot(axis) - 0.5 * 1.5 * (self.end.retreat - self.start.retreat);
        for n in 1..count {
            let mean = 0.5 * (self.start.nodes[n] + self.end.nodes[n]);
            // The top face of the tissue is z = 0.
            if mean.z >= 0.0 {
                continue;
            }
            let last = n == count - 1;
            // What goes on as it went meets no inertia: with half of it 2.1 % of the work were missing beside a bevel that drifts, with all 1.6 %.
            let aside = (self.end.nodes[n] - self.start.nodes[n]).reject_from_normalized(axis);
            let drift = aside * (1.5 * dynamic / stiffness);
            let k = stiffness * if last { 0.5 * h } else { h };
            let mut spring = NodeSpring::lateral(k, axis, mean + axis * ahead + drift);
            if last {
                spring.stiffness += DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z) * self.tip_stiffness;
            }
            loads.springs[n] = Some(spring);
        }
        self.step(kinematics, loads, transmitted, time, length);
        record
    }

    /// The centre-line at the end of the frame that was answered last, at rest.
    pub fn centre_line(&self) -> CentreLine {
        CentreLine { spacing: self.spacing, first_step: 0, offset: self.answered, rate: [DVec3::ZERO; ENTRY_COUNT] }
    }

    /// The needle at the end of the frame that was bent last.
    fn record(&mut self) -> NeedleRecord {
        self.answered = self.end.offset;
        let compression = self.beam.axial_forces().into_iter().fold(0.0, |most: f64, n| most.max(-n));
        let p = self.params.beam;
        let critical = std::f64::consts::PI.powi(2) * p.bending_stiffness() / (4.0 * p.length * p.length);
        let hub = self.beam.hub();
        let aside = self
            .beam
            .position
            .iter()
            .map(|x| (*x - hub.position).reject_from_normalized(hub.direction).length())
            .fold(0.0, f64::max);
        self.buckled |= compression > BUCKLING_LOAD_PART * critical && aside > BUCKLING_OFFSET_PART * p.length;
        NeedleRecord {
            tip_offset: self.end.offset[0],
            retreat: self.end.retreat,
            largest_offset: aside,
            compression,
            bending_energy: self.beam.energy().bending,
            buckled: self.buckled,
            unbalanced: !self.converged,
        }
    }
}

/// The clamp of a straight needle whose tip is at `pose`.
fn hub(params: &Params, pose: &ToolPose) -> HubPose {
    HubPose {
        position: pose.tip - pose.direction * params.beam.length,
        direction: pose.direction,
        velocity: pose.velocity,
    }
}

/// Estimate of what the tissue opposes to a needle that moves aside, per length of the needle.
#[derive(Debug, Clone, Copy)]
struct LateralTissue {
    /// At rest [N/m^2].
    stiffness: f64,
    /// To its speed, by waves that are sent away [N s/m^2].
    damping: f64,
    /// To its acceleration, by the tissue that it takes along [kg/m].
    mass: f64,
}

/// Parts of damping and mass in the Robin stiffness; below 0.8 and 1.6 the coupling would be unstable.
const DAMPING_FACTOR: f64 = 2.0;
const MASS_FACTOR: f64 = 3.0;

impl LateralTissue {
    /// For a needle of `radius` that holds the tissue within `ring_radius`, in a block of the half width `width` [m]; the largest
    /// of all materials.
    fn new(model: &Model, radius: f64, ring_radius: f64, width: f64) -> Self {
        let largest = |of: &dyn Fn(&Material) -> f64| model.materials.iter().map(of).fold(0.0, f64::max);
        let density = |m: &Material| m.density * model.mass_scaling();
        let impedance = |m: &Material, modulus: f64| (density(m) * modulus).sqrt();
        LateralTissue {
            stiffness: ring_stiffness(largest(&|m| m.law.shear_modulus()), radius, width),
            damping: 4.0
                * radius
                * largest(&|m| impedance(m, m.law.p_wave_modulus()) + impedance(m, m.law.shear_modulus())),
            mass: std::f64::consts::PI * ring_radius.max(radius).powi(2) * largest(&density),
        }
    }

    /// What damping and mass oppose to a move within a frame that lasts `duration` [s]; in N/m^2.
    fn dynamic_stiffness(&self, duration: f64) -> f64 {
        (DAMPING_FACTOR * self.damping + MASS_FACTOR * self.mass / duration) / duration
    }
}

/// Stiffness per length of a rigid circle of radius R in an incompressible ring of outer radius b [N/m^2].
fn ring_stiffness(shear_modulus: f64, radius: f64, outer: f64) -> f64 {
    let ratio = (outer / radius).max(2.0);
    let square = ratio * ratio;
    4.0 * std::f64::consts::PI * shear_modulus / (ratio.ln() - (square - 1.0) / (square + 1.0))
}

impl Simulation {
    /// The beam's answer to the loads of the frame that was collected last.
    pub(super) fn answer_of_the_needle(&mut self, sums: &mut FrameSums) -> NeedleRecord {
        let (clock, dt, last) = (&self.clock, self.clock.dt, self.total_steps.max(1));
        let end = |frame: u64| clock.time_of(clock.first_step(frame + 1).min(last));
        let next = (self.collected < self.frames)
            .then(|| (end(self.collected), end(self.collected) - clock.time_of(clock.first_step(self.collected))));
        let broken = sums.health.not_finite || !sums.needle_loads.iter().all(|l| l.is_finite());
        match (&mut self.needle, &self.kinematics) {
            // Loads of a broken state mean nothing; the run stops right after.
            (Some(needle), Some(tool)) if !broken => needle.answer(tool, sums, f64::from(sums.steps) * dt, next),
            _ => NeedleRecord::default(),
        }
    }

    /// Notices about a needle that has buckled or whose beam was not in balance.
    pub(super) fn tell_of_the_needle(&mut self, record: &FrameRecord) {
        let bent = &record.needle;
        if bent.buckled && !self.buckling_told {
            self.buckling_told = true;
            self.notices.push(format!(
                "the needle buckles at a depth of {:.2} mm: {:.3} N of compression, {:.2} mm from its axis, its tip {:.2} mm behind; take a thicker or stiffer needle or a shorter flexible_needle.free_length_mm",
                record.depth * 1e3,
                bent.compression,
                bent.largest_offset * 1e3,
                bent.retreat * 1e3
            ));
        }
        if bent.unbalanced {
            self.unbalanced_frames += 1;
            if self.unbalanced_frames == 1 {
                self.notices.push(format!(
                    "the flexible needle did not find its balance at {:.4} s; its shape there is the best one found",
                    record.time
                ));
            }
        }
    }
}
