//! Stages `advance_tip` and `soften_path` in f64. Equations: src/effects/puncture.rs.

use glam::DVec3;

use super::CpuEngine;
use crate::effects::adhesion::{self, Bond};
use crate::effects::puncture::{self, advance_limit, bounded_stretch, tip_advance};
use crate::engine::elements::CellStates;
use crate::mesh::{BlockMesh, CORNERS};
use crate::model::PuncturePlan;
use crate::needle::ToolPose;

/// An anchor at the material coordinate of the tip.
struct PlacedAnchor {
    /// Distance of the tip plane beyond it along the insertion, and its positive part inside the material [m].
    distance: f64,
    gap: f64,
    /// d(x.t)/da.
    stretch: f64,
    nodes: [usize; 8],
    weights: [f64; 8],
}

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
    /// where F > F_c: `a += min((F - F_c) / (k_tip lambda), cap)`, `lambda = <dx_k/da . t>` clamped to 0.2..3. No spring from
    /// `a = a_exit` on.
    pub(super) fn advance_tip(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let mesh = model.mesh.block();
        let t = pose.direction;
        let count = plan.anchors.len() as f64;
        let spring = plan.params.tip_stiffness / count;
        let tip_axial = (pose.tip - plan.path.entry).dot(t);
        let place = |u: &[DVec3], a: f64| -> Vec<PlacedAnchor> {
            plan.anchors
                .iter()
                .map(|anchor| {
                    let x = anchor.surface + t * a;
                    let (nodes, weights, slope) = Self::locate(mesh, x, t);
                    let (mut du, mut stretch) = (0.0, 1.0);
                    for i in 0..8 {
                        let along = u[nodes[i]].dot(t);
                        du += weights[i] * along;
                        stretch += slope[i] * along;
                    }
                    let distance = tip_axial - a - du;
                    let gap = if a < plan.exit { distance.max(0.0) } else { 0.0 };
                    PlacedAnchor { distance, gap, stretch, nodes, weights }
                })
                .collect()
        };
        let mean_distance = |anchors: &[PlacedAnchor]| anchors.iter().map(|p| p.distance).sum::<f64>() / count;
        let a = self.state.tip_coordinate;
        let mut anchors = place(&self.state.displacement, a);
        let bond_force = match model.effects.adhesion {
            Some(adhesion) => self.advance_bond(&adhesion, mean_distance(&anchors), a > 0.0 && a < plan.exit),
            None => 0.0,
        };
        let force: f64 = anchors.iter().map(|p| spring * p.gap).sum();
        let p = &plan.params;
        let speed = pose.velocity.length();
        // The tissue that the tip opens as it advances is strained at once.
        let resistance = self.state.opening_resistance;
        let threshold = plan.threshold(a) * p.rate_factor(speed) + resistance;
        if force > threshold {
            let lambda = anchors.iter().map(|p| p.stretch).sum::<f64>() / count;
            let cap = match &plan.opening {
                Some(opening) => opening.advance_limit(speed * self.dt, self.dt),
                None => advance_limit(a == 0.0, speed * self.dt),
            };
            let advance = tip_advance(force, threshold, p.tip_stiffness, bounded_stretch(lambda), cap);
            self.state.tip_coordinate = a + advance;
            let before = anchors;
            anchors = place(&self.state.displacement, a + advance);
            // Force after the advance times the loss of stretch: with the force of the next step this closes the
            // trapezoidal rule of the leapfrog work; the loss of spring energy would count half a step twice.
            let lost: f64 = before.iter().zip(&anchors).map(|(b, p)| spring * p.gap * (b.gap - p.gap)).sum();
            let force = anchors.iter().map(|p| spring * p.gap).sum();
            let beyond = if advance == cap { puncture::share_beyond(force, threshold) } else { 0.0 };
            self.sums.energy.tip += lost * (1.0 - beyond) - resistance * advance;
            self.sums.energy.advance_cap += lost * beyond;
        }
        self.state.bond.gap = mean_distance(&anchors);
        let bond_energy = model.effects.adhesion.map_or(0.0, |p| 0.5 * p.stiffness * self.state.bond.stretch.powi(2));
        self.tip_energy = anchors.iter().map(|p| 0.5 * spring * p.gap * p.gap).sum::<f64>() + bond_energy;
        // Contact books the whole force of the anchors as cutting; what is not comes off here.
        let membrane = match plan.segment(self.state.tip_coordinate).membrane {
            true => anchors.iter().map(|p| spring * p.gap).sum::<f64>() * self.dt,
            false => 0.0,
        };
        self.sums.membrane_impulse += membrane;
        self.sums.adhesion_impulse += bond_force * self.dt;
        self.sums.cutting_impulse -= membrane + bond_force * self.dt;
        self.tip_forces =
            anchors.into_iter().map(|p| (spring * p.gap + bond_force / count, p.nodes, p.weights)).collect();
    }

    /// Moves the bond between tip and tissue by what the tip has moved against its anchors, `distance` on average; returns
    /// its force [N]. A tip outside the material, or drawn back by more than D, has no bond.
    fn advance_bond(&mut self, p: &adhesion::Params, distance: f64, inside: bool) -> f64 {
        let old = self.state.bond;
        let motion = distance - old.gap;
        let (stretch, slid) = match inside && distance > -p.sliding_distance {
            true => p.advance(old.stretch, old.slid, motion),
            false => (0.0, 0.0),
        };
        self.state.bond = Bond { stretch, slid, gap: old.gap };
        // Mean force of both steps times the slip; nothing slips where there was and is no bond.
        let slip = old.stretch + motion - stretch;
        self.sums.energy.adhesion += 0.5 * p.stiffness * (old.stretch + stretch) * slip;
        p.stiffness * stretch
    }

    /// Stage `soften_path`: factor `1 - ramp(a) (1 - left)`; the energy that a cell loses is dissipated.
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
                None => 1.0 - ramp * (1.0 - path_cell.left),
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
        self.sums.energy.softening += (old - factor) * (m.elastic - m.held + m.hourglass);
        self.state.stiffness[cell] = factor;
    }
}
