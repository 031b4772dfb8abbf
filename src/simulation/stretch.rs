//! The guard of materials that are stable within a range of stretches only.

use glam::DMat3;

use super::Simulation;
use super::fields::displacement_gradients;
use crate::error::{Error, Result};
use crate::material::Verdict;
use crate::model::Model;
use crate::observables::FrameRecord;

/// True where a material is stable within a range of stretches only; what has no stiffness at all is not watched.
pub(super) fn must_watch(model: &Model) -> bool {
    model.materials.iter().any(|m| matches!(m.law.verdict(), Verdict::StableBelow(_) | Verdict::StableAbove(_)))
}

impl Simulation {
    /// Stops when an element leaves the stretch range in which the material is stable.
    pub(super) fn check_stretch(&mut self, record: &FrameRecord) -> Result<()> {
        let verdicts: Vec<Verdict> = self.model.materials.iter().map(|m| m.law.verdict()).collect();
        let state = self.engine.read_state()?;
        for (cell, h) in displacement_gradients(&self.model.mesh, &state).into_iter().enumerate() {
            let (low, high) = principal_stretch_range(DMat3::IDENTITY + h);
            let (broken, limit, value) = match verdicts[self.model.material_index(cell)] {
                Verdict::StableBelow(limit) => (high > limit, limit, high),
                Verdict::StableAbove(limit) => (low < limit, limit, low),
                _ => (false, 0.0, 0.0),
            };
            if broken {
                let x = self.model.mesh.rest_position(self.model.mesh.cell_nodes(cell)[0]) * 1e3;
                return Err(Error::Diverged {
                    frame: record.frame,
                    step: record.step,
                    time_s: record.time,
                    message: format!(
                        "stage element_forces: cell {cell} at ({:.2}, {:.2}, {:.2}) mm has the principal stretch {value:.4}, \
                         beyond the limit {limit:.4} up to which these constants are stable",
                        x.x, x.y, x.z
                    ),
                });
            }
        }
        Ok(())
    }
}

/// Smallest and largest principal stretch of F: roots of the eigenvalues of C, by the trigonometric solution of the
/// characteristic cubic.
fn principal_stretch_range(f: DMat3) -> (f64, f64) {
    let c = f.transpose() * f;
    let mean = (c.x_axis.x + c.y_axis.y + c.z_axis.z) / 3.0;
    let d = c - DMat3::IDENTITY * mean;
    let square = d.x_axis.length_squared() + d.y_axis.length_squared() + d.z_axis.length_squared();
    let p = (square / 6.0).sqrt();
    if p < 1e-15 {
        return (mean.sqrt(), mean.sqrt());
    }
    let angle = (d.determinant() / (2.0 * p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    let largest = mean + 2.0 * p * angle.cos();
    let smallest = mean + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos();
    (smallest.max(0.0).sqrt(), largest.max(0.0).sqrt())
}
