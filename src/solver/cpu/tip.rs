//! Stages `advance_tip` and `soften_path` in f64. Equations: src/effects/puncture.rs.

use glam::DVec3;

use super::CpuEngine;
use crate::mesh::BlockMesh;
use crate::model::PuncturePlan;
use crate::needle::ToolPose;
use crate::solver::elements::{CORNERS, CellStates};

impl CpuEngine {
    /// Trilinear position in the mesh: nodes, weights and derivative of the weights along `direction` (in a bent grid the
    /// direction of its axis).
    fn locate(mesh: &BlockMesh, x: DVec3, direction: DVec3) -> ([usize; 8], [f64; 8], [f64; 8]) {
        let ([i, j, k], xi) = mesh.locate(x);
        let cell = mesh.cell_index(i, j, k);
        let width = mesh.cell_size(cell);
        let (mut weight, mut slope) = ([0.0; 8], [0.0; 8]);
        for (i, signs) in CORNERS.iter().enumerate() {
            let n: [f64; 3] = std::array::from_fn(|a| 0.5 + signs[a] * (xi[a] - 0.5));
            let d: [f64; 3] = std::array::from_fn(|a| signs[a] * direction[a] / width[a]);
            weight[i] = n[0] * n[1] * n[2];
            slope[i] = d[0] * n[1] * n[2] + n[0] * d[1] * n[2] + n[0] * n[1] * d[2];
        }
        (mesh.cell_nodes(cell), weight, slope)
    }

    /// Stage `advance_tip`: each anchor k carries a spring between the tip plane and the material point at `a`.
    ///
    /// `g_k = max(0, (p_tip - x_k).t)`, `F = k_tip/N sum g_k`, threshold `F_c(a)` falls from F_pun to F_cut over l_p;
    /// where F > F_c: `a += min((F - F_c) / (k_tip lambda), cap)`, `lambda = <dx_k/da . t>` clamped to 0.2..3.
    pub(super) fn advance_tip(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let mesh = model.mesh.block();
        let u = &self.state.displacement;
        let t = pose.direction;
        let spring = plan.params.tip_stiffness / plan.anchors.len() as f64;
        let tip_axial = (pose.tip - plan.path.entry).dot(t);
        let gaps = |a: f64| -> Vec<(f64, f64, [usize; 8], [f64; 8])> {
            plan.anchors
                .iter()
                .map(|anchor| {
                    let x = anchor.surface + t * a;
                    let (nodes, weight, slope) = Self::locate(mesh, x, t);
                    let (mut du, mut stretch) = (0.0, 1.0);
                    for i in 0..8 {
                        let along = u[nodes[i]].dot(t);
                        du += weight[i] * along;
                        stretch += slope[i] * along;
                    }
                    ((tip_axial - a - du).max(0.0), stretch, nodes, weight)
                })
                .collect()
        };
        let a = self.state.tip_coordinate;
        let mut springs = gaps(a);
        let force: f64 = springs.iter().map(|s| spring * s.0).sum();
        let p = &plan.params;
        let threshold = plan.threshold(a);
        if force > threshold {
            let lambda = springs.iter().map(|s| s.1).sum::<f64>() / springs.len() as f64;
            let speed = pose.velocity.length();
            let cap = if a == 0.0 { 0.005e-3 } else { 0.013e-3 };
            // A stab travels more than that in one step.
            let cap = f64::min(f64::max(cap, 1.25 * speed * self.dt), 4.0 * speed * self.dt);
            let advance = ((force - threshold) / (p.tip_stiffness * lambda.clamp(0.2, 3.0))).min(cap);
            self.state.tip_coordinate = a + advance;
            let before = springs;
            springs = gaps(a + advance);
            // Force after the advance times the loss of stretch: with the force of the next step this closes the
            // trapezoidal rule of the leapfrog work; the loss of spring energy would count half a step twice.
            let lost = before.iter().zip(&springs).map(|(b, s)| spring * s.0 * (b.0 - s.0));
            self.sums.tip_dissipation += lost.sum::<f64>();
        }
        self.tip_energy = springs.iter().map(|s| 0.5 * spring * s.0 * s.0).sum();
        self.tip_forces = springs.into_iter().map(|s| (spring * s.0, s.2, s.3)).collect();
    }

    /// Stage `soften_path`: factor `max(residual, 1 - phi ramp(a))`; the energy that a cell loses is dissipated.
    pub(super) fn soften_path(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let a = self.state.tip_coordinate;
        for path_cell in &plan.cells {
            let cell = path_cell.cell as usize;
            let length = path_cell.axial_end - path_cell.axial_start;
            let ramp = ((a - path_cell.axial_start) / length.max(1e-9)).clamp(0.0, 1.0);
            let factor = match plan.needle.bore {
                // The core tears off where the tip stands when the needle begins to go back.
                Some(_) => {
                    let here = (path_cell.axial_start..path_cell.axial_end).contains(&a);
                    if here && pose.velocity.dot(pose.direction) < 0.0 { 0.0 } else { 1.0 }
                }
                None => (1.0 - path_cell.fraction * ramp).max(plan.params.residual_stiffness),
            };
            self.soften_cell(cell, factor);
        }
    }

    /// Leaves a cell the part `factor` of its stiffness, if that is less than it has, and books the energy that it loses.
    pub(super) fn soften_cell(&mut self, cell: usize, factor: f64) {
        let old = self.state.stiffness[cell];
        if factor >= old {
            return;
        }
        // Half a step back: the mean of the energies before and after the step, as the leapfrog work has it.
        let half = 0.5 * self.dt;
        let mut u = [DVec3::ZERO; 8];
        for (u, n) in u.iter_mut().zip(self.model.mesh.cell_nodes(cell).iter()) {
            *u = self.state.displacement[*n] - self.state.velocity[*n] * half;
        }
        let intact = CellStates { points: &self.state.points, stiffness: &[] };
        let m = self.elements.measure_corners(&self.model, cell, &u, None, intact);
        // What Prony terms hold is booked with their work, which the softening does not touch.
        self.sums.softening_dissipation += (old - factor) * (m.elastic - m.held + m.hourglass);
        self.state.stiffness[cell] = factor;
    }
}
