//! What a trainee is asked to do. Whether it was done is judged in `training`.

use glam::DVec3;

use crate::units::{self, Unit};

/// Force at which a hand or a drive stops pushing [N]: choice of this project, and the largest limit of a task.
pub const LARGEST_FORCE_LIMIT: f64 = 10.0;

/// A task with its goals.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Short name; attempts are kept under it.
    pub name: String,
    /// What the trainee reads before the start.
    pub briefing: String,
    /// The attempt must not take longer than this [s].
    pub time_limit: Option<f64>,
    /// The axial force must not exceed this [N]; `None`: it is no goal.
    pub force_limit: Option<f64>,
    /// At least one.
    pub goals: Vec<Goal>,
    /// Weight of each goal in the share of the score, more than 0; time and force limit weigh 1.
    pub weights: Vec<f64>,
}

/// One thing that must be done, or must not happen.
#[derive(Debug, Clone, PartialEq)]
pub enum Goal {
    /// The tip ends the way in no farther from the target, which the tissue takes along, than `tolerance` [m].
    HitTarget {
        /// Index into the targets of the scene.
        target: usize,
        tolerance: f64,
    },
    /// The outside of the needle never comes closer to the obstacle than `clearance` [m], 0 or more.
    Avoid { name: String, obstacle: Obstacle, clearance: f64 },
    /// The deepest point in the material that the tip has cut to lies between two depths below the top face [m].
    StopInLayer { name: String, from: f64, to: f64 },
    /// The bore holds at least this mass [kg] at the end.
    CoreMass { least: f64 },
    /// The same as a volume at rest [m^3].
    CoreVolume { least: f64 },
    /// A figure of the score is no larger than this [SI].
    Figure { figure: &'static TaskFigure, most: f64 },
}

/// A figure of the score that a goal may bound from above.
#[derive(Debug, PartialEq)]
pub struct TaskFigure {
    /// Its key in the score.
    pub key: &'static str,
    /// Unit in which the bound is written.
    pub unit: Unit,
    /// True where a run that does not hold it has none of it: no bone met, no layer overshot.
    pub none_is_zero: bool,
}

/// Figures that a goal may bound: what a trainer calls a mistake.
pub static TASK_FIGURES: [TaskFigure; 11] = [
    figure("passes", units::ONE, true),
    figure("redirections", units::ONE, true),
    figure("entry_error", units::MILLIMETRE, false),
    figure("entry_angle_error", units::DEGREE, false),
    figure("overshoot", units::MILLIMETRE, true),
    figure("peak_axial_force", units::NEWTON, true),
    figure("peak_lateral_force", units::NEWTON, true),
    figure("peak_bone_force", units::NEWTON, true),
    figure("path_in_tissue", units::MILLIMETRE, true),
    figure("swept_area", units::SQUARE_MILLIMETRE, true),
    figure("injury_energy", units::MILLIJOULE, true),
];

const fn figure(key: &'static str, unit: Unit, none_is_zero: bool) -> TaskFigure {
    TaskFigure { key, unit, none_is_zero }
}

/// What a needle has to stay away from: a fixed place in the coordinates of the scene [m], which the tissue does not take
/// along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Obstacle {
    Sphere {
        centre: DVec3,
        radius: f64,
    },
    /// All of a region, by its index: what has a label in a patient, or a shape.
    Region(usize),
    /// A cylinder between two points of its axis, with round ends.
    Cylinder {
        from: DVec3,
        to: DVec3,
        radius: f64,
    },
}
