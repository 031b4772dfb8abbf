//! Stage `indenter_contact` in f64. Equations: src/effects/indentation.rs.

use super::{ContactSums, CpuEngine};
use crate::needle::ToolPose;
use crate::scene::Tool;
use crate::solver::engine::ContactState;

impl CpuEngine {
    /// Stage `indenter_contact`: penalty contact of the top face with a sphere or a flat punch.
    pub(super) fn indenter_contact(&mut self, pose: &ToolPose) {
        let model = self.model.clone();
        let (Some(params), Some(tool)) = (model.effects.indentation, &model.scene.tool) else { return };
        let k = model.tool_contact_stiffness();
        let mut stored = 0.0;
        for (contact, memory) in model.contact_nodes.iter().zip(&mut self.state.contact) {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + self.state.displacement[node];
            let (depth, n, bonded) = match *tool {
                Tool::Sphere { radius } => {
                    let centre = pose.tip - pose.direction * radius;
                    let to = x - centre;
                    let length = to.length();
                    (radius - length, to / length, false)
                }
                Tool::FlatPunch { radius, bonded } => {
                    let s = (pose.tip - x).dot(pose.direction);
                    let inside = contact.rest_radius <= radius;
                    (if inside { s } else { -1.0 }, pose.direction, bonded)
                }
                Tool::Needle(_) => return,
            };
            let v = self.state.velocity[node] - pose.velocity;
            let vn = v.dot(n);
            let damping = 2.0 * params.contact_damping * (k * model.node_mass[node]).sqrt();
            let mut sums = ContactSums::default();
            if bonded && (memory.touching || depth > 0.0) {
                memory.touching = true;
                memory.stick += (v - n * vn) * self.dt;
                sums.normal = n * (k * depth) - v * damping - memory.stick * k;
                sums.damping_power = damping * v.length_squared();
                sums.stored = 0.5 * k * (depth * depth + memory.stick.length_squared());
            } else if depth > 0.0 {
                memory.touching = true;
                let normal = (k * depth - damping * vn).max(0.0);
                sums.normal = n * normal;
                sums.damping_power = (k * depth - normal) * vn;
                sums.stored = 0.5 * k * depth * depth;
                if let Some(friction) = model.effects.friction {
                    let kt = friction.stiffness_ratio * k;
                    let trial = memory.stick + (v - n * vn) * self.dt;
                    let trial = trial - n * trial.dot(n);
                    let length = trial.length();
                    let allowed = friction.coefficient * normal / kt;
                    memory.stick = if length > allowed { trial * (allowed / length) } else { trial };
                    sums.friction = memory.stick * -kt;
                    sums.friction_work = kt * memory.stick.dot(trial - memory.stick);
                    sums.stored += 0.5 * kt * memory.stick.length_squared();
                }
            } else {
                *memory = ContactState::default();
            }
            let total = sums.normal + sums.friction;
            sums.torque = (x - pose.tip).cross(total);
            self.external[node] += total;
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
        }
        self.contact_energy = stored;
    }
}
