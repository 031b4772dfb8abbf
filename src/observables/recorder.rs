//! Turns the sums of a frame into a record: totals since t = 0, means over the frame.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{ForceParts, FrameRecord};
use crate::engine::clock::Clock;
use crate::engine::{EnergyAccount, FrameEnergies, FrameSums};
use crate::model::{Model, rigid};
use crate::needle::{Kinematics, Tool};

/// Adds up what the frames deliver, in f64.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Recorder {
    totals: EnergyAccount,
    /// What was taken so far of parts that hold something, too.
    taken: FrameEnergies,
}

impl Recorder {
    /// Books what the state at the end of the last frame stores more after a change of constants; both sums are those of frames without
    /// a step. Springs of contact are not seen there: what they hold more shows in the balance.
    pub fn book_change(&mut self, before: &FrameSums, after: &FrameSums) {
        let stored = |e: &FrameEnergies| e.elastic + e.kinetic + e.hourglass + e.viscous + e.cohesive_stored;
        self.totals.changes += stored(&after.energy) - stored(&before.energy);
    }

    /// Books what the springs of the tip hold more after its path was laid anew [J].
    pub fn book_laying(&mut self, work: f64) {
        self.totals.changes += work;
    }

    /// Books the frame whose steps begin with number `first` and returns its record.
    pub fn record(
        &mut self,
        model: &Model,
        kinematics: Option<&Kinematics>,
        (clock, first): (&Clock, u64),
        sums: &FrameSums,
    ) -> FrameRecord {
        let duration = f64::from(sums.steps) * clock.dt;
        let begin = clock.time_of(first);
        let step = first + u64::from(sums.steps);
        let end = clock.time_of(step);
        let e = &mut self.totals;
        // The spring between the tip and bone.
        let in_bone = |time: f64| {
            let pose = kinematics.map(|k| k.pose(time));
            pose.map_or(0.0, |pose| model.depth_in_bone(pose.tip, pose.direction))
        };
        let [before, after] = [begin, end].map(in_bone);
        let held = |depth: f64| 0.5 * rigid::STIFFNESS * depth * depth;
        let energies = FrameEnergies { contact_stored: sums.energy.contact_stored + held(after), ..sums.energy };
        e.external += sums.tool_work + sums.load_work + held(after) - held(before);
        e.book(&mut self.taken, &energies);
        e.external_max = e.external_max.max(e.put_in().abs());
        let mean_pose = kinematics.map(|k| k.pose(0.5 * (begin + end)));
        let direction = mean_pose.map_or(DVec3::ZERO, |p| p.direction);
        let force = sums.impulse / duration;
        let mut parts = ForceParts {
            cutting: sums.cutting_impulse / duration,
            membrane: sums.membrane_impulse / duration,
            tip_spreading: (sums.spreading_impulse - sums.shaft_impulse) / duration,
            shaft_spreading: sums.shaft_impulse / duration,
            friction: sums.friction_impulse / duration,
            shaft_normal: sums.shaft_normal_impulse / duration,
            adhesion: sums.adhesion_impulse / duration,
            bone: 0.5 * rigid::STIFFNESS * (before + after),
            inertia: inertia(model, kinematics, end),
            lateral: force - direction * force.dot(direction),
            torque: sums.angular_impulse / duration,
            ..Default::default()
        };
        // The parts were summed along the direction of each step, which on a free path turns within a frame.
        parts.axial = ForceParts::PARTS.iter().map(|part| (part.of)(&parts)).sum();
        FrameRecord {
            frame: sums.frame,
            step,
            time: end,
            depth: mean_pose.map_or(0.0, |p| p.depth),
            phase: mean_pose.map_or(0, |p| p.phase),
            force: parts,
            force_error: None,
            tip_coordinate: sums.tip_coordinate,
            reactions: sums.reactions,
            face_moments: sums.face_moments,
            energy: *e,
            verdict: Default::default(),
            needle: Default::default(),
            core: None,
            targets: Vec::new(),
            health: sums.health,
        }
    }
}

/// Mass of the needle times the acceleration of its prescribed motion along the insertion, mean over the display frame
/// before `end` [N]. The motion changes its speed at once; the mean makes a pulse of it that is one frame long. The tool
/// stood still before t = 0.
fn inertia(model: &Model, kinematics: Option<&Kinematics>, end: f64) -> f64 {
    let (Some(kinematics), Some(Tool::Needle(needle))) = (kinematics, &model.scene.tool) else {
        return 0.0;
    };
    let frame = 1.0 / model.scene.solver.frame_rate;
    let speed = |time: f64| {
        let pose = kinematics.pose(time);
        if time < 0.0 { 0.0 } else { pose.velocity.dot(pose.direction) }
    };
    // A frame ends on the millionth of itself where a phase does. What a hand does after the frame is not known yet.
    let beside = if kinematics.is_led() { -1e-6 } else { 1e-6 };
    let moment = |time: f64| time + beside * frame;
    needle.mass() * (speed(moment(end)) - speed(moment(end - frame))) / frame
}
