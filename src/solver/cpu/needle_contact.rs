//! Stage `needle_contact` in f64. Equations: src/effects/puncture.rs, src/needle/gap.rs.

use glam::DVec3;

use super::{ContactSums, CpuEngine};
use crate::model::PuncturePlan;
use crate::needle::ToolPose;
use crate::needle::gap::Overlap;
use crate::solver::engine::ContactState;

impl CpuEngine {
    /// Stage `needle_contact`: nodes of the ring that the tip has passed stay outside the opened path (potential
    /// `1/2 k phi^2`, see `needle::gap`); friction on the shaft; tip springs.
    pub(super) fn needle_contact(&mut self, plan: &PuncturePlan, pose: &ToolPose) {
        let model = self.model.clone();
        let d = -pose.direction;
        let k = plan.contact_stiffness;
        let a = self.state.tip_coordinate;
        let profile = plan.profile;
        let cone = profile.tip_length;
        let mut stored = self.tip_energy;
        let mut tip_on_node: std::collections::HashMap<usize, f64> = Default::default();
        for (force, nodes, weights) in &self.tip_forces {
            for (n, w) in nodes.iter().zip(weights) {
                *tip_on_node.entry(*n).or_default() += force * w;
            }
        }
        for (contact, memory) in model.contact_nodes.iter().zip(&mut self.state.contact) {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + self.state.displacement[node];
            let mut sums = ContactSums::default();
            if let Some(f) = tip_on_node.get(&node) {
                sums.tip = pose.direction * *f;
            }
            let relative = x - pose.tip;
            let s = relative.dot(d);
            if !(contact.pushed && contact.rest_axial < a && s > 0.0) {
                *memory = ContactState::default();
            } else {
                let free = profile.opened_path(relative, d, contact.rest_radius, (0.0, 0.0));
                if !memory.touching {
                    memory.touching = true;
                    memory.overlap = free.value.max(0.0);
                    memory.axial_on = s;
                }
                let travel = (s - memory.axial_on) / plan.params.entry_fade;
                let fading = if travel > 0.0 && travel < 1.0 { -memory.overlap / plan.params.entry_fade } else { 0.0 };
                let less = (memory.overlap * (1.0 - travel).clamp(0.0, 1.0), fading);
                let Overlap { value: depth, gradient } = profile.opened_path(relative, d, contact.rest_radius, less);
                let steep = gradient.length();
                let n = -gradient / steep;
                let v = self.state.velocity[node] - pose.velocity;
                let vn = v.dot(n);
                let mass = model.node_mass[node];
                let damping = 2.0 * plan.params.contact_damping * (k * mass).sqrt();
                let elastic = k * depth * steep;
                let normal = if depth > 0.0 { (elastic - damping * vn).max(0.0) } else { 0.0 };
                sums.normal = n * normal;
                sums.on_shaft = s >= cone;
                if depth > 0.0 {
                    sums.stored = 0.5 * k * depth * depth;
                    sums.damping_power = (elastic - normal) * vn;
                }
                memory.stick = match model.effects.friction {
                    Some(friction) if normal > 0.0 => {
                        let kt = friction.stiffness_ratio * k;
                        let mu = friction.coefficient * ((s - cone) / friction.fade_length).clamp(0.0, 1.0);
                        let trial = memory.stick + (v - n * vn) * self.dt;
                        let trial = trial - n * trial.dot(n);
                        let length = trial.length();
                        let allowed = mu * normal / kt;
                        let stretch = if length > allowed { trial * (allowed / length) } else { trial };
                        sums.friction = stretch * -kt;
                        // Friction force times slip.
                        sums.friction_work = kt * stretch.dot(trial - stretch);
                        sums.stored += 0.5 * kt * stretch.length_squared();
                        stretch
                    }
                    _ => DVec3::ZERO,
                };
            }
            let total = sums.tip + sums.normal + sums.friction;
            sums.torque = relative.cross(total);
            self.external[node] += total;
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
        }
        self.contact_energy = stored;
    }
}
