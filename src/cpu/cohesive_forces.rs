//! Stage `cohesive_forces` in f64. Equations: src/effects/cohesive.rs.

use glam::DVec3;

use super::CpuEngine;
use crate::effects::cohesive::{Law, TORN_REACH, TornContact};
use crate::separation::FacePair;

/// Pairs from which on another thread joins before they are done.
const SHARED_PAIRS: usize = 200;

/// What a pair does in one step.
struct Torn {
    damage: f64,
    /// Dissipated and stored [J].
    dissipated: f64,
    stored: f64,
    /// On the lower copy [N]; the upper one has its opposite.
    force: DVec3,
}

impl CpuEngine {
    /// Traction of every pair on its two copies, damage by opening, by the tip and by the shaft.
    pub(super) fn cohesive_forces(&mut self) {
        let model = self.model.clone();
        let Some(law) = model.cohesion else { return };
        let turned_back = model.puncture.as_ref().is_some_and(|plan| self.core_tears(plan));
        let pairs = &model.separation.pairs;
        // Every pair by itself, on all threads where they are many; sums in the order of the pairs.
        let tear = |i: usize| self.tear(&law, &pairs[i], self.state.pairs[i], turned_back);
        let torn: Vec<Torn> = match pairs.len() {
            few if few < SHARED_PAIRS => (0..few).map(tear).collect(),
            many => self.each(many, tear),
        };
        let mut stored = 0.0;
        for ((pair, damage), torn) in pairs.iter().zip(&mut self.state.pairs).zip(torn) {
            let [a, b] = pair.nodes.map(|n| n as usize);
            let k = law.penalty * pair.area;
            *damage = torn.damage;
            self.sums.energy.cohesive += torn.dissipated;
            stored += torn.stored;
            self.added.add(a, torn.force, 2.0 * k);
            self.added.add(b, -torn.force, 2.0 * k);
        }
        self.sums.energy.cohesive_stored = stored;
    }

    /// One pair with the damage `old`; `turned_back`: a hollow needle has gone back so far that its core tears.
    fn tear(&self, law: &Law, pair: &FacePair, old: f64, turned_back: bool) -> Torn {
        let (model, state) = (&self.model, &self.state);
        let h = model.scene.tissue.cell_size;
        let place = |node: u32| self.rest[node as usize] + state.displacement[node as usize];
        let [a, b] = pair.nodes.map(|n| n as usize);
        let opening = state.displacement[b] - state.displacement[a];
        let before = opening - (state.velocity[b] - state.velocity[a]) * self.dt;
        let n = normal(pair, place);
        let normal_opening = opening.dot(n);
        let shear = opening - n * normal_opening;
        let mut damage = old;
        // What is torn tears no further.
        if old < 1.0 {
            damage = damage.max(law.damage(normal_opening, shear.length()));
            if let Some(s0) = pair.tip_driven {
                damage = damage.max(((state.tip_coordinate - s0) / h).clamp(0.0, 1.0));
                // The core tears off as a whole: no bond is left above its base.
                if turned_back && s0 < state.tip_coordinate {
                    damage = 1.0;
                }
                // Where both copies lie on the full shaft the bond is gone.
                let on_shaft = |node: usize| {
                    let at = model.contact_nodes.binary_search_by_key(&(node as u32), |c| c.node);
                    at.is_ok_and(|c| state.contact[c].on_shaft)
                };
                if on_shaft(a) && on_shaft(b) {
                    damage = 1.0;
                }
            }
        }
        let k = law.penalty * pair.area;
        let (kept, grown) = (1.0 - damage, damage - old);
        // A closed face keeps the normal stiffness that damage takes, as far as the faces still meet.
        let (mut taken, mut stored, mut pull) =
            (0.5 * opening.dot(before), 0.5 * opening.length_squared(), DVec3::ZERO);
        stored *= kept;
        if normal_opening < 0.0 && damage > 0.0 {
            let reach = TORN_REACH * h;
            let normal_before = before.dot(n);
            let across = normal_opening * normal_before;
            taken -= TornContact::new(across, opening.dot(before) - across, reach).stored();
            let contact = TornContact::new(normal_opening * normal_opening, shear.length_squared(), reach);
            stored += damage * contact.stored();
            let (normal, slip) = contact.slopes();
            pull = (n * (normal_opening * normal) + shear * slip) * damage;
        }
        Torn { damage, dissipated: k * grown * taken, stored: k * stored, force: (opening * kept + pull) * k }
    }
}

/// Normal of the deformed surface, from a to b, out of the ways to the neighbours of `a`.
fn normal(pair: &FacePair, place: impl Fn(u32) -> DVec3) -> DVec3 {
    let [first, second] = pair.ring.map(|[before, after]| place(after) - place(before));
    first.cross(second).normalize_or_zero()
}
