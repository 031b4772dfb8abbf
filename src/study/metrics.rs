//! Differences of a run from the reference.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::store::RunRecord;
use crate::output::curve::interpolated;

/// How far a run is from the reference; relative errors are fractions. `None` where one of the two does not hold the number.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Errors {
    /// Relative L2 norm over depth of the axial force on the way in.
    pub force_curve: Option<f64>,
    /// Force of the puncture peak, relative.
    pub puncture_force: Option<f64>,
    /// Depth of the puncture peak, relative.
    pub puncture_depth: Option<f64>,
    /// Force at the deepest point, relative.
    pub deepest_force: Option<f64>,
    /// Relative L2 norm of the displacement at the sample points at the deepest point.
    pub displacement: Option<f64>,
}

impl Errors {
    /// Of `run` against `reference`.
    pub fn of(run: &RunRecord, reference: &RunRecord) -> Self {
        let relative = |a: Option<f64>, b: Option<f64>| {
            let (a, b) = (a?, b?);
            (b != 0.0).then(|| ((a - b) / b).abs()).filter(|e| e.is_finite())
        };
        Errors {
            force_curve: curve_error(&run.curve(), &reference.curve()),
            puncture_force: relative(run.puncture_force_n, reference.puncture_force_n),
            puncture_depth: relative(run.puncture_depth_m, reference.puncture_depth_m),
            deepest_force: relative(run.force_at_max_depth_n, reference.force_at_max_depth_n),
            displacement: field_error(&run.displacement_m, &reference.displacement_m),
        }
    }
}

/// Relative L2 norm over depth of the difference of two curves (depth, force), depths ascending. `None` where they share fewer than two depths of
/// the reference.
pub fn curve_error(curve: &[(f64, f64)], reference: &[(f64, f64)]) -> Option<f64> {
    over_depth(curve, reference, |force| force * force).map(f64::sqrt)
}

/// Mean over depth of the difference of two such curves, over the mean force of the reference.
pub fn mean_error(curve: &[(f64, f64)], reference: &[(f64, f64)]) -> Option<f64> {
    over_depth(curve, reference, f64::abs)
}

/// Integral of `size` of the difference over that of the reference: the trapezoidal rule over the depths of the reference that both hold.
fn over_depth(curve: &[(f64, f64)], reference: &[(f64, f64)], size: impl Fn(f64) -> f64) -> Option<f64> {
    let shared: Vec<(f64, f64, f64)> =
        reference.iter().filter_map(|(depth, force)| Some((*depth, *force, interpolated(curve, *depth)?))).collect();
    let (mut difference, mut scale) = (0.0, 0.0);
    for pair in shared.windows(2) {
        let half = 0.5 * (pair[1].0 - pair[0].0);
        difference += half * pair.iter().map(|(_, r, f)| size(f - r)).sum::<f64>();
        scale += half * pair.iter().map(|(_, r, _)| size(*r)).sum::<f64>();
    }
    (scale > 0.0).then(|| difference / scale)
}

/// Relative L2 norm of the difference of two fields at the same points; `None` for other points, none, or a field at rest.
pub fn field_error(field: &[[f64; 3]], reference: &[[f64; 3]]) -> Option<f64> {
    if field.len() != reference.len() || field.is_empty() {
        return None;
    }
    let (mut difference, mut scale) = (0.0, 0.0);
    for (a, b) in field.iter().zip(reference) {
        difference += (DVec3::from(*a) - DVec3::from(*b)).length_squared();
        scale += DVec3::from(*b).length_squared();
    }
    (scale > 0.0).then(|| (difference / scale).sqrt())
}
