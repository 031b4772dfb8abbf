//! Whether an attempt has met the goals of its task.
//!
//! ```text
//! hit target     distance from tip to target at the deepest point of the way in, both where they are then   [m]
//! avoid          least distance of the outside of the needle from the obstacle over all samples: of the tip, and of the shaft
//!                behind the tip's cone with its radius taken off; must be above 0 and at least the clearance   [m]
//! stop in layer  deepest point below the top face that the tip has cut to, in the material at rest             [m]
//!                a region of a label map is known to a quarter of a millimetre
//! core           mass or rest volume in the bore at the end                                              [kg], [m^3]
//! time limit     elapsed time                                                                                  [s]
//! ```
//! The obstacle is a place, it does not move with the tissue; the shaft is straight. What the tip has cut to, not where it is, tells
//! whether a layer was left: before it gives way a layer is pushed ahead by millimetres.

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use crate::scene::{Goal, Obstacle, Task};

use super::kinematic::{KinematicFigures, Sample};
use super::physical::PhysicalFigures;
use super::texts;
use crate::scene::Scene;
use crate::units::{CUBIC_MILLIMETRE, MILLIGRAM, MILLIMETRE, SECOND, Unit};

/// One goal and what was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GoalResult {
    /// Kind of the goal, as in the scene file, or `time_limit`.
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
        }
    }
}

/// The goals of a task in its order, the time limit behind them.
pub fn judge(
    task: &Task,
    scene: &Scene,
    samples: &[Sample],
    kinematic: &KinematicFigures,
    physical: &PhysicalFigures,
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
        Goal::CoreVolume { least } => {
            let volume = core.map(|mass| mass / scene.material.density);
            GoalResult::of("core", texts::CORE.into(), CUBIC_MILLIMETRE, volume, Some(*least), None)
        }
    });
    let limit = task.time_limit.map(|limit| {
        let text = texts::TIME_LIMIT.into();
        GoalResult::of("time_limit", text, SECOND, Some(kinematic.elapsed_time), None, Some(limit))
    });
    goals.chain(limit).collect()
}

/// Least distance of the outside of the needle from an obstacle [m], negative inside it; `None` without a needle or a sample.
pub fn clearance_of(scene: &Scene, samples: &[Sample], obstacle: &Obstacle) -> Option<f64> {
    let (axes, radius) = match *obstacle {
        Obstacle::Sphere { centre, radius } => (vec![[centre, centre]], radius),
        Obstacle::Cylinder { from, to, radius } => (vec![[from, to]], radius),
        Obstacle::Region(index) => {
            (points_of_region(scene, index).into_iter().map(|x| [x, x]).collect(), 0.5 * POINT_STEP)
        }
    };
    let needle = scene.needle()?;
    let distance = |sample: &Sample, axis: [DVec3; 2]| {
        let behind = |s: f64| sample.tip - sample.direction * s;
        let tip = segment_distance([sample.tip; 2], axis);
        let shaft = segment_distance([behind(needle.tip_length), behind(needle.length.max(needle.tip_length))], axis);
        tip.min(shaft - needle.radius) - radius
    };
    let nearest = |sample: &Sample| axes.iter().map(|axis| distance(sample, *axis)).reduce(f64::min);
    // A needle that stands adds nothing.
    let mut last: Option<&Sample> = None;
    let moved = samples.iter().filter(|sample| {
        let stands = last.is_some_and(|l| l.tip.distance(sample.tip) < STANDING && l.direction == sample.direction);
        if !stands {
            last = Some(sample);
        }
        !stands
    });
    moved.filter_map(nearest).reduce(f64::min)
}

/// Distance of the points that stand for a region [m].
const POINT_STEP: f64 = 0.5e-3;
/// Way of a tip that is not looked at again [m].
const STANDING: f64 = 1e-6;

/// Points on a lattice that lie at the border of a region, within the block of the scene [m].
fn points_of_region(scene: &Scene, index: usize) -> Vec<DVec3> {
    let size = scene.tissue.size;
    let low = DVec3::new(-0.5 * size.x, -0.5 * size.y, -size.z);
    let counts = ((size + DVec3::Z * scene.tissue.top) / POINT_STEP).floor();
    let [nx, ny, nz] = counts.to_array().map(|n| n.max(1.0) as usize);
    let inside: Vec<bool> =
        (0..nx * ny * nz).into_par_iter().map(|n| scene.region_at(low + lattice(n, nx, ny)) == Some(index)).collect();
    let at = |i: usize, j: usize, k: usize| inside[(k * ny + j) * nx + i];
    (0..inside.len())
        .filter(|n| inside[*n])
        .filter(|n| {
            let (i, j, k) = (n % nx, n / nx % ny, n / (nx * ny));
            let border = i == 0 || j == 0 || k == 0 || i + 1 == nx || j + 1 == ny || k + 1 == nz;
            border
                || !(at(i - 1, j, k) && at(i + 1, j, k) && at(i, j - 1, k) && at(i, j + 1, k))
                || !(at(i, j, k - 1) && at(i, j, k + 1))
        })
        .map(|n| low + lattice(n, nx, ny))
        .collect()
}

/// Middle of a cube of the lattice.
fn lattice(n: usize, nx: usize, ny: usize) -> DVec3 {
    DVec3::new((n % nx) as f64 + 0.5, (n / nx % ny) as f64 + 0.5, (n / (nx * ny)) as f64 + 0.5) * POINT_STEP
}

/// Least distance of two straight lines between points [m]; a line may be a point.
fn segment_distance([p, p_end]: [DVec3; 2], [q, q_end]: [DVec3; 2]) -> f64 {
    let (d, e, r) = (p_end - p, q_end - q, p - q);
    let (a, b, c) = (d.length_squared(), d.dot(e), e.length_squared());
    let (f, g) = (d.dot(r), e.dot(r));
    let determinant = a * c - b * b;
    let part = |numerator: f64, denominator: f64| {
        if denominator > 0.0 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    // Along the first where the lines are closest, any place where they are parallel; then the foot on the second, and back.
    let s = if determinant > 1e-12 * a * c { part(b * g - c * f, determinant) } else { 0.0 };
    let t = part(b * s + g, c);
    let s = part(b * t - f, a);
    (p + d * s).distance(q + e * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_of_segments() {
        let v = DVec3::new;
        for (first, second, expected) in [
            // Crossing at a height of 2.
            ([v(-1.0, 0.0, 2.0), v(1.0, 0.0, 2.0)], [v(0.0, -1.0, 0.0), v(0.0, 1.0, 0.0)], 2.0),
            // End to end, 3-4-5.
            ([v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0)], [v(4.0, 4.0, 0.0), v(9.0, 9.0, 0.0)], 5.0),
            // Parallel beside each other, and behind each other.
            ([v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], [v(1.0, 3.0, 0.0), v(9.0, 3.0, 0.0)], 3.0),
            ([v(0.0, 0.0, 0.0), v(4.0, 0.0, 0.0)], [v(9.0, 0.0, 0.0), v(6.0, 0.0, 0.0)], 2.0),
            // Points.
            ([v(1.0, 1.0, 0.0); 2], [v(-5.0, 0.0, 0.0), v(5.0, 0.0, 0.0)], 1.0),
            ([v(-5.0, 0.0, 0.0), v(5.0, 0.0, 0.0)], [v(8.0, 4.0, 0.0); 2], 5.0),
            ([v(1.0, 0.0, 0.0); 2], [v(1.0, 0.0, 7.0); 2], 7.0),
            // The foot on the second line lies beyond its end.
            ([v(0.0, 0.0, 0.0), v(10.0, 0.0, 0.0)], [v(5.0, 5.0, 0.0), v(5.0, 2.0, 0.0)], 2.0),
        ] {
            for pair in [[first, second], [second, first], [[first[1], first[0]], second]] {
                let found = segment_distance(pair[0], pair[1]);
                assert!((found - expected).abs() < 1e-12, "{pair:?}: {found} instead of {expected}");
            }
        }
    }
}
