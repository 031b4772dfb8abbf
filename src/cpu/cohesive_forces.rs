//! Stage `cohesive_forces` in f64. Equations: src/effects/cohesive.rs.

use glam::DVec3;

use super::CpuEngine;
use crate::effects::cohesive::TORN_REACH;
use crate::needle::ToolPose;
use crate::separation::FacePair;

impl CpuEngine {
    /// Traction of every pair on its two copies, damage by opening, by the tip and by the shaft.
    pub(super) fn cohesive_forces(&mut self, pose: Option<&ToolPose>) {
        let model = self.model.clone();
        let Some(law) = model.cohesion else { return };
        let h = model.scene.tissue.cell_size;
        let place = |node: u32| model.mesh.rest_position(node as usize) + self.state.displacement[node as usize];
        let turned_back = model.has_bore() && pose.is_some_and(|p| p.velocity.dot(p.direction) < 0.0);
        let mut stored = 0.0;
        for (pair, damage) in model.separation.pairs.iter().zip(&mut self.state.pairs) {
            let [a, b] = pair.nodes.map(|n| n as usize);
            let opening = self.state.displacement[b] - self.state.displacement[a];
            let before = opening - (self.state.velocity[b] - self.state.velocity[a]) * self.dt;
            let n = normal(pair, place);
            let normal_opening = opening.dot(n);
            let shear = opening - n * normal_opening;
            let old = *damage;
            *damage = damage.max(law.damage(normal_opening, shear.length()));
            if let Some(s0) = pair.tip_driven {
                *damage = damage.max(((self.state.tip_coordinate - s0) / h).clamp(0.0, 1.0));
                // The core tears off as a whole when the needle turns back: no bond is left above its base.
                if turned_back && s0 < self.state.tip_coordinate {
                    *damage = 1.0;
                }
                // Where both copies lie on the full shaft the bond is gone.
                let on_shaft = |node: usize| {
                    let at = model.contact_nodes.binary_search_by_key(&(node as u32), |c| c.node);
                    at.is_ok_and(|c| self.state.contact[c].on_shaft)
                };
                if on_shaft(a) && on_shaft(b) {
                    *damage = 1.0;
                }
            }
            let k = law.penalty * pair.area;
            let closed = normal_opening < 0.0;
            // A closed face keeps its normal stiffness, so that damage takes from its shear only.
            let taken = opening.dot(before) - if closed { normal_opening * before.dot(n) } else { 0.0 };
            self.sums.energy.cohesive += 0.5 * k * (*damage - old) * taken;
            let touches =
                closed && (*damage < 1.0 || (-normal_opening < TORN_REACH * h && shear.length() < TORN_REACH * h));
            let kept = 1.0 - *damage;
            let contact = if touches { *damage * normal_opening } else { 0.0 };
            let force = opening * (k * kept) + n * (k * contact);
            stored += 0.5 * k * (kept * opening.length_squared() + contact * normal_opening);
            self.external[a] += force;
            self.external[b] -= force;
            self.added_bound[a] += 2.0 * k;
            self.added_bound[b] += 2.0 * k;
        }
        self.sums.energy.cohesive_stored = stored;
    }
}

/// Normal of the deformed surface, from a to b, out of the ways to the neighbours of `a`.
fn normal(pair: &FacePair, place: impl Fn(u32) -> DVec3) -> DVec3 {
    let [first, second] = pair.ring.map(|[before, after]| place(after) - place(before));
    first.cross(second).normalize_or_zero()
}
