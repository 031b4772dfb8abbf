//! Turns the sums of a frame into a record: totals since t = 0, means over the frame.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{EnergyAccount, ForceParts, FrameRecord, Health};
use crate::engine::FrameSums;
use crate::engine::clock::Clock;
use crate::model::Model;
use crate::needle::{Kinematics, Tool};

/// Adds up what the frames deliver, in f64.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Recorder {
    totals: EnergyAccount,
    contact_dissipation: f64,
    cohesive_dissipation: f64,
}

impl Recorder {
    /// Books what the state at the end of the last frame stores more after a change of constants; both sums are those of frames without
    /// a step. Springs of contact are not seen there: what they hold more shows in the balance.
    pub fn book_change(&mut self, before: &FrameSums, after: &FrameSums) {
        let stored = |s: &FrameSums| s.elastic + s.kinetic + s.hourglass + s.viscous_dissipation + s.cohesive_energy;
        self.totals.changes += stored(after) - stored(before);
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
        e.external += sums.tool_work + sums.load_work;
        e.external_max = e.external_max.max(e.external.abs());
        e.elastic = sums.elastic;
        e.kinetic = sums.kinetic;
        e.half_step = sums.half_step;
        e.hourglass = sums.hourglass;
        e.damping += sums.damping_dissipation;
        e.friction += sums.friction_dissipation;
        e.cutting += sums.tip_dissipation + sums.softening_dissipation;
        e.advance_cap += sums.cap_dissipation;
        e.raised_mass += sums.raised_mass_energy;
        e.speed_limit += sums.speed_limit_energy;
        self.cohesive_dissipation += sums.cohesive_dissipation;
        e.cohesive = sums.cohesive_energy + self.cohesive_dissipation;
        e.adhesion += sums.adhesion_dissipation;
        e.plastic += sums.plastic_dissipation;
        e.damage += sums.damage_dissipation;
        e.viscous = sums.viscous_dissipation;
        self.contact_dissipation += sums.contact_dissipation;
        e.needle = sums.needle_energy;
        e.contact = sums.contact_energy + self.contact_dissipation;
        let mean_pose = kinematics.map(|k| k.pose(0.5 * (begin + end)));
        let direction = mean_pose.map_or(DVec3::ZERO, |p| p.direction);
        let force = sums.impulse / duration;
        let mut parts = ForceParts {
            cutting: sums.cutting_impulse / duration,
            membrane: sums.membrane_impulse / duration,
            tip_spreading: (sums.spreading_impulse - sums.shaft_impulse) / duration,
            shaft_spreading: sums.shaft_impulse / duration,
            friction: sums.friction_impulse / duration,
            adhesion: sums.adhesion_impulse / duration,
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
            tip_coordinate: sums.tip_coordinate,
            reactions: sums.reactions,
            face_moments: sums.face_moments,
            energy: *e,
            verdict: Default::default(),
            needle: Default::default(),
            core: None,
            targets: Vec::new(),
            health: Health {
                min_j: sums.min_j,
                min_corner_j: sums.min_corner_j,
                inverted_cells: sums.inverted_cells,
                folded_cells: sums.folded_cells,
                inverted_cell: sums.inverted_cell,
                largest_damage: sums.largest_damage,
                deleted_cells: sums.deleted_cells,
                return_failures: sums.return_failures,
                torn_area: sums.torn_area,
                clamped_nodes: sums.clamped_nodes,
                max_speed: sums.max_speed,
                raised_mass: sums.raised_mass,
                not_finite: sums.not_finite,
            },
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
