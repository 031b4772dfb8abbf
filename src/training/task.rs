//! Whether an attempt has met the goals of its task.
//!
//! ```text
//! hit target     distance from tip to target at the deepest point of the way in, both where they are then   [m]
//! avoid          least distance of the outside of the needle from the obstacle over all samples: of the tip, and of the shaft
//!                behind the tip's cone with its radius taken off; must be above 0 and at least the clearance   [m]
//! stop in layer  deepest point below the top face that the tip has cut to, in the material at rest             [m]
//! core           mass or rest volume in the bore at the end                                              [kg], [m^3]
//! figure         a figure of the score; at most its bound
//! force limit    largest axial force                                                                           [N]
//! time limit     elapsed time                                                                                  [s]
//! ```
//! The obstacle is a place, it does not move with the tissue; the shaft is straight. What the tip has cut to, not where it is, tells
//! whether a layer was left: before it gives way a layer is pushed ahead by millimetres.

use serde::{Deserialize, Serialize};

pub use crate::scene::{Goal, Obstacle, Task};

use super::clearance::Clearance;
use super::kinematic::{KinematicFigures, Sample};
use super::physical::PhysicalFigures;
use super::texts;
use crate::scene::Scene;
use crate::units::{CUBIC_MILLIMETRE, MILLIGRAM, MILLIMETRE, NEWTON, SECOND, Unit};

/// One goal and what was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GoalResult {
    /// Kind of the goal, as in the scene file, or `force_limit`, `time_limit`.
    pub key: String,
    /// What was to be done.
    pub text: String,
    /// Unit of the numbers.
    pub unit: String,
    /// Where the run does not hold it, `None`.
    pub measured: Option<f64>,
    /// Bounds, the bounds themselves allowed.
    pub least: Option<f64>,
    pub most: Option<f64>,
    /// `None` where the run is not scored.
    pub met: Option<bool>,
    /// Weight in the share of the score; 1 in attempts from before there were weights.
    #[serde(default = "one")]
    pub weight: f64,
}

fn one() -> f64 {
    1.0
}

impl GoalResult {
    /// A goal that is met where the measured figure lies within its bounds; a figure that is missing or no number meets none.
    fn of(
        key: &str,
        text: String,
        unit: Unit,
        measured: Option<f64>,
        least: Option<f64>,
        most: Option<f64>,
    ) -> GoalResult {
        let within = |x: f64| least.is_none_or(|l| x >= l) && most.is_none_or(|m| x <= m);
        GoalResult {
            key: key.into(),
            text,
            unit: unit.name.into(),
            measured: measured.filter(|x| x.is_finite()).map(|x| unit.show(x)),
            least: least.map(|x| unit.show(x)),
            most: most.map(|x| unit.show(x)),
            met: Some(measured.is_some_and(|x| x.is_finite() && within(x))),
            weight: 1.0,
        }
    }
}

/// The goals of a task in its order, behind them the limits of force and time.
pub fn judge(
    task: &Task,
    scene: &Scene,
    samples: &[Sample],
    kinematic: &KinematicFigures,
    physical: &PhysicalFigures,
    figures: &[(String, Option<f64>)],
) -> Vec<GoalResult> {
    let core = physical.core.map(|core| core.mass);
    let goals = task.goals.iter().map(|goal| match goal {
        Goal::HitTarget { target, tolerance } => {
            let name = scene.targets.get(*target).map_or("", |t| &t.name);
            let distance = physical.targets.iter().find(|t| t.name == name).and_then(|t| t.tip_distance_at_end_m);
            GoalResult::of("hit_target", texts::hit_target(name), MILLIMETRE, distance, None, Some(*tolerance))
        }
        Goal::Avoid { name, obstacle, clearance } => {
            let distance = clearance_of(scene, samples, obstacle);
            let mut result = GoalResult::of("avoid", texts::avoid(name), MILLIMETRE, distance, Some(*clearance), None);
            // To touch is not to stay away.
            result.met = result.met.map(|met| met && distance.is_some_and(|d| d > 0.0));
            result
        }
        Goal::StopInLayer { name, from, to } => {
            let depth = Some(physical.deepest_cut);
            GoalResult::of("stop_in_layer", texts::stop_in_layer(name), MILLIMETRE, depth, Some(*from), Some(*to))
        }
        Goal::CoreMass { least } => GoalResult::of("core", texts::CORE.into(), MILLIGRAM, core, Some(*least), None),
        Goal::Figure { figure, most } => {
            let found = figures.iter().find(|(key, _)| key == figure.key).and_then(|(_, value)| *value);
            let value = found.or(figure.none_is_zero.then_some(0.0));
            let label = texts::figure_of(figure.key).map_or(figure.key, |text| text.label);
            GoalResult::of("figure", texts::figure_bound(label), figure.unit, value, None, Some(*most))
        }
        Goal::CoreVolume { least } => {
            let volume = core.map(|mass| mass / scene.material.density);
            GoalResult::of("core", texts::CORE.into(), CUBIC_MILLIMETRE, volume, Some(*least), None)
        }
    });
    let goals = goals.zip(&task.weights).map(|(result, weight)| GoalResult { weight: *weight, ..result });
    let force = task.force_limit.map(|limit| {
        let (text, peak) = (texts::FORCE_LIMIT.into(), physical.peak_axial_force);
        GoalResult::of("force_limit", text, NEWTON, Some(peak), None, Some(limit))
    });
    let time = task.time_limit.map(|limit| {
        let text = texts::TIME_LIMIT.into();
        GoalResult::of("time_limit", text, SECOND, Some(kinematic.elapsed_time), None, Some(limit))
    });
    goals.chain(force).chain(time).collect()
}

/// Least distance of the outside of the needle from an obstacle [m], negative inside it; `None` without a needle or a sample.
pub fn clearance_of(scene: &Scene, samples: &[Sample], obstacle: &Obstacle) -> Option<f64> {
    Clearance::new(scene, obstacle)?.nearest(samples).map(|(_, distance)| distance)
}
