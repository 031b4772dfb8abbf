//! Stage `needle_contact` in f64. Equations: src/effects/puncture.rs, src/needle/gap.rs.

use glam::DVec3;

use super::{ContactSums, CpuEngine};
use crate::model::{ContactSurface, PuncturePlan};
use crate::needle::centre_line::Bend;
use crate::needle::free_path::{END_FADE, FreeTip, PASSED_MARGIN, WATCHED, faded_at_end};
use crate::needle::gap::{Overlap, Profile};
use crate::needle::{ToolPose, swing};
use crate::solver::engine::ContactState;

impl CpuEngine {
    /// Stage `needle_contact`: nodes of the ring that the tip has passed stay outside the opened path (potential
    /// `1/2 k phi^2`, see `needle::gap`); friction on the shaft; tip springs.
    pub(super) fn needle_contact(&mut self, plan: &PuncturePlan, pose: &ToolPose, step: u64) {
        let model = self.model.clone();
        let d = -pose.direction;
        let k = plan.contact_stiffness;
        let a = self.state.tip_coordinate;
        let turned = swing(plan.path.direction, pose.direction, plan.profile.shift);
        let profile = Profile { shift: turned, ..plan.profile };
        let tip = self.state.tip;
        let cone = profile.tip_length;
        let mut stored = self.tip_energy;
        let line = self.centre_line;
        let mut tip_on_node: std::collections::HashMap<usize, DVec3> = Default::default();
        for (force, nodes, weights) in &self.tip_forces {
            for (n, w) in nodes.iter().zip(weights) {
                *tip_on_node.entry(*n).or_default() += (pose.direction * *force + self.tip_sway) * *w;
            }
        }
        for (index, (contact, memory)) in model.contact_nodes.iter().zip(&mut self.state.contact).enumerate() {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + self.state.displacement[node];
            let mut sums = ContactSums::default();
            if let Some(f) = tip_on_node.get(&node) {
                sums.tip = *f;
            }
            let relative = x - pose.tip;
            let s = relative.dot(d);
            let bend = line.map_or(Bend::default(), |l| l.at(s, (step - l.first_step) as f64 * self.dt));
            let from_axis = relative - bend.offset;
            let (touches, rest_radius, end) = match &plan.free {
                None => (contact.pushed && contact.rest_axial < a && s > 0.0, contact.rest_radius, 0.0),
                Some(_) => free_contact(plan, &tip, model.mesh.rest_position(node), memory, from_axis, s, d),
            };
            if !touches {
                *memory =
                    ContactState { rest_radius: memory.rest_radius, passed: memory.passed, ..ContactState::default() };
            } else {
                let overlap = |less: (f64, f64)| match contact.surface {
                    ContactSurface::OpenedPath => profile.opened_path(from_axis, d, rest_radius, less),
                    ContactSurface::Slit { side } => profile.slit_face(from_axis, d, side, less),
                    ContactSurface::OuterWall => profile.tube_wall(from_axis, d, false, less),
                    ContactSurface::Bore => profile.tube_wall(from_axis, d, true, less),
                };
                let free = overlap((0.0, 0.0));
                if !memory.touching {
                    memory.touching = true;
                    memory.overlap = free.value.max(0.0);
                    memory.axial_on = s;
                }
                let travel = (s - memory.axial_on) / plan.params.entry_fade;
                let fading = if travel > 0.0 && travel < 1.0 { -memory.overlap / plan.params.entry_fade } else { 0.0 };
                let less = (memory.overlap * (1.0 - travel).clamp(0.0, 1.0), fading);
                let mut overlap = overlap(less);
                if plan.free.is_some() {
                    overlap = faded_at_end(overlap, d, s, end, END_FADE * cone);
                }
                let Overlap { value: depth, gradient } = overlap;
                let gradient = gradient - d * gradient.dot(bend.slope);
                let steep = gradient.length();
                let n = -gradient / steep;
                let v = self.state.velocity[node] - pose.velocity - pose.angular_velocity.cross(relative) - bend.rate;
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
                if depth > 0.0 && contact.surface != ContactSurface::OpenedPath {
                    // A separated face has half the mass of other nodes.
                    self.added_bound[node] += 2.0 * k * steep * steep;
                }
                memory.on_shaft = depth > 0.0 && s >= cone;
                memory.stick = match model.effects.friction {
                    Some(friction) if normal > 0.0 => {
                        let kt = friction.stiffness_ratio * k;
                        let coefficient = match (contact.surface, plan.needle.bore) {
                            (ContactSurface::Bore, Some(bore)) => bore.friction,
                            _ => friction.coefficient,
                        };
                        let mu = coefficient * ((s - cone) / friction.fade_length).clamp(0.0, 1.0);
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
            if line.is_some() {
                self.sums.tool_work += total.dot(bend.rate) * self.dt;
                self.node_impulse[index] += total * self.dt;
            }
        }
        self.contact_energy = stored;
    }

    /// Shares the impulses of the frame over the entries of the centre-line, by where the nodes are at its end.
    pub(super) fn share_needle_loads(&mut self, pose: &ToolPose) {
        let Some(line) = self.centre_line else { return };
        for (contact, impulse) in self.model.contact_nodes.iter().zip(&mut self.node_impulse) {
            let node = contact.node as usize;
            let x = self.model.mesh.rest_position(node) + self.state.displacement[node];
            line.share(&mut self.sums.needle_loads, (pose.tip - x).dot(pose.direction), std::mem::take(impulse));
        }
    }
}

/// On a free path: brings what the node knows of the tip to this step, and tells whether it is to be kept out of the
/// needle, with which r0 [m], and the front end [m] of what it touches. `lever` from the tip, `s` behind it along `d`.
fn free_contact(
    plan: &PuncturePlan,
    tip: &FreeTip,
    rest: DVec3,
    memory: &mut ContactState,
    lever: DVec3,
    s: f64,
    d: DVec3,
) -> (bool, f64, f64) {
    let ring = plan.params.ring_radius;
    let relative = rest - tip.place;
    let ahead = relative.dot(tip.along);
    let radius = (relative - tip.along * ahead).length();
    // The dimple before the puncture is no opened path.
    let passes = tip.coordinate > 0.0 && ahead <= 0.0 && ahead > -ring && radius < ring;
    let passed = tip.inside && s > -PASSED_MARGIN && (memory.passed || passes);
    if passed != memory.passed {
        *memory = ContactState { passed, rest_radius: if passed { radius } else { 0.0 }, ..ContactState::default() };
    }
    let needle = plan.profile;
    // The shaft alone: a node just before the tip is not passed yet, and is no obstacle to the cone.
    let reach = WATCHED * needle.radius;
    let met = tip.inside && !passed && s > needle.tip_length && (lever - d * s).length_squared() < reach * reach;
    let in_ring = passed && s > 0.0 && memory.rest_radius > plan.params.softened_radius;
    (met || in_ring, memory.rest_radius, if met { needle.tip_length } else { 0.0 })
}
