//! Stage `needle_contact` in f64. Equations: src/effects/puncture.rs, src/needle/gap.rs.

use glam::DVec3;

use super::slit_contact::SlitContact;
use super::{ContactSums, CpuEngine};
use crate::effects::friction::{part_on_shaft, stick_or_slide};
use crate::engine::{ContactState, State};
use crate::model::{ANCHOR_COUNT, ContactSurface, PuncturePlan};
use crate::needle::centre_line::Bend;
use crate::needle::free_path::{END_FADE, FreeTip, PASSED_MARGIN, WATCHED, faded_at_end};
use crate::needle::gap::{Overlap, Profile};
use crate::needle::{ToolPose, swing};

impl CpuEngine {
    /// Stage `needle_contact`: nodes of the ring that the tip has passed stay outside the opened path (potential
    /// `1/2 k phi^2`, see `needle::gap`); friction on the shaft; tip springs.
    pub(super) fn needle_contact(&mut self, plan: &PuncturePlan, pose: &ToolPose, step: u64) {
        let model = self.model.clone();
        let d = -pose.direction;
        let a = self.state.tip_coordinate;
        let turned = swing(plan.path.direction, pose.direction, plan.profile.shift);
        let profile = Profile { shift: turned, ..plan.profile };
        let tip = self.state.tip;
        let cone = profile.tip_length;
        let mut stored = self.tip_energy;
        let line = self.centre_line;
        // Force of the tip springs, and of how many of them.
        let mut tip_on_node: std::collections::HashMap<usize, (DVec3, f64)> = Default::default();
        for (force, nodes, weights) in &self.tip_forces {
            let acts = if plan.free.is_some() { tip.inside } else { *force != 0.0 };
            for (n, w) in nodes.iter().zip(weights) {
                let share = tip_on_node.entry(*n).or_default();
                share.0 += (pose.direction * *force + self.tip_sway) * *w;
                share.1 += if acts { *w } else { 0.0 };
            }
        }
        let count = if plan.anchors.is_empty() { ANCHOR_COUNT } else { plan.anchors.len() };
        let spring = plan.params.tip_stiffness / count as f64;
        let State { contact: memories, displacement, velocity, .. } = &mut self.state;
        let slit = SlitContact {
            model: &model,
            plan,
            profile,
            pose,
            coordinate: a,
            line: line.as_ref().map(|l| (l, (step - l.first_step) as f64 * self.dt)),
            displacement,
            velocity,
        };
        for (index, (contact, memory)) in model.contact_nodes.iter().zip(memories).enumerate() {
            let node = contact.node as usize;
            let x = model.mesh.rest_position(node) + displacement[node];
            let mut sums = ContactSums::default();
            if let Some((force, springs)) = tip_on_node.get(&node) {
                sums.tip = *force;
                self.added_bound[node] += springs * spring;
            }
            let relative = x - pose.tip;
            let s = relative.dot(d);
            let bend = line.map_or(Bend::default(), |l| l.at(s, (step - l.first_step) as f64 * self.dt));
            let from_axis = relative - bend.offset;
            let Touch { touches, rest_radius, weight, end, nearness } = match &plan.free {
                None => Touch {
                    touches: contact.pushed && contact.rest_axial < a && s > 0.0,
                    rest_radius: contact.rest_radius,
                    weight: plan.params.ring_weight(contact.rest_radius),
                    end: 0.0,
                    nearness: 1.0,
                },
                Some(_) => free_contact(plan, &tip, model.mesh.rest_position(node), memory, from_axis, s, d),
            };
            let k = match contact.surface {
                ContactSurface::OpenedPath => plan.ring_stiffness(contact, weight),
                _ => plan.contact_stiffness,
            };
            let mut bend_power = sums.tip.dot(bend.rate);
            // Where it rubs: normal, velocity past the needle [m/s], largest friction [N] and stiffness [N/m].
            let mut grip = None;
            let coefficient = match (contact.surface, plan.needle.bore, model.effects.friction) {
                (ContactSurface::Bore, Some(bore), Some(_)) => bore.friction,
                (_, _, Some(friction)) => friction.coefficient,
                _ => 0.0,
            };
            if let ContactSurface::Slit { side } = contact.surface {
                let force = slit.at(contact, side);
                sums.normal = force.normal;
                sums.on_shaft = force.on_shaft;
                sums.stored = force.stored;
                let v = velocity[node] - pose.velocity - bend.rate;
                sums.damping = memory.damped(force.damping, v, self.dt);
                sums.torque = force.torque;
                bend_power += force.bend_power;
                self.added_bound[node] += force.bound;
                memory.touching = force.normal != DVec3::ZERO;
                memory.on_shaft = force.on_shaft != DVec3::ZERO && s >= cone;
                let n = force.normal.normalize_or_zero();
                grip = Some((n, v, coefficient * force.rubbing, plan.face_stiffness() * contact.share));
            } else if !touches {
                // What the springs of a contact held goes with it.
                sums.released = memory.stored;
                *memory =
                    ContactState { rest_radius: memory.rest_radius, passed: memory.passed, ..ContactState::default() };
            } else {
                let overlap = |less: (f64, f64)| match contact.surface {
                    ContactSurface::OpenedPath | ContactSurface::Slit { .. } => {
                        profile.opened_path(from_axis, d, rest_radius, less)
                    }
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
                let v = velocity[node] - pose.velocity - pose.angular_velocity.cross(relative) - bend.rate;
                let vn = v.dot(n);
                let mass = model.node_mass[node];
                let damping = 2.0 * plan.params.contact_damping * (k * mass).sqrt();
                let elastic = k * depth * steep;
                let normal = if depth > 0.0 { (elastic - damping * vn).max(0.0) } else { 0.0 };
                sums.normal = n * normal;
                if s >= cone {
                    sums.on_shaft = sums.normal;
                }
                let mut damping_force = DVec3::ZERO;
                if depth > 0.0 {
                    sums.stored = 0.5 * k * depth * depth;
                    damping_force = n * (normal - elastic);
                }
                sums.damping = memory.damped(damping_force, v, self.dt);
                // On a fine mesh, and where a separated face has half the mass of other nodes, contact limits the step. This
                // counts whether the node touches or not: a mass that came and went with the contact would make it chatter,
                // heavy on its way in and light on its way out.
                self.added_bound[node] += 2.0 * k * steep * steep * nearness;
                memory.on_shaft = depth > 0.0 && s >= cone;
                let fade = model.effects.friction.map_or(1.0, |f| f.fade_length);
                let rubs = part_on_shaft(s, cone, fade);
                sums.torque = relative.cross(sums.normal);
                bend_power += sums.normal.dot(bend.rate);
                grip = Some((n, v, coefficient * rubs * normal, k));
            }
            if let (Some((n, v, limit, k)), Some(friction)) = (grip, model.effects.friction) {
                let kt = friction.stiffness_ratio * k;
                let stick = stick_or_slide(memory.stick, (v - n * v.dot(n)) * self.dt, n, kt, limit);
                memory.stick = stick.stretch;
                sums.friction = stick.force;
                sums.friction_work = stick.dissipated;
                sums.stored += stick.stored;
            }
            memory.stored = sums.stored;
            let total = sums.tip + sums.normal + sums.friction;
            sums.torque += relative.cross(sums.tip + sums.friction);
            bend_power += sums.friction.dot(bend.rate);
            self.external[node] += total;
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
            if line.is_some() {
                self.sums.tool_work += bend_power * self.dt;
                self.sums.last_tool_work += bend_power * self.dt;
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

/// How a node meets the needle.
struct Touch {
    /// Whether it is to be kept out.
    touches: bool,
    /// Its r0 [m], and the weight of its contact stiffness.
    rest_radius: f64,
    weight: f64,
    /// Front end of what it touches, behind the tip [m].
    end: f64,
    /// Part of that stiffness that counts in the step: it grows steadily towards the shaft, for a mass that jumped at a
    /// distance would pump energy into a node that swings there.
    nearness: f64,
}

/// On a free path: brings what the node knows of the tip to this step, and tells how it meets the needle. `lever` from the
/// tip, `s` behind it along `d`.
fn free_contact(
    plan: &PuncturePlan,
    tip: &FreeTip,
    rest: DVec3,
    memory: &mut ContactState,
    lever: DVec3,
    s: f64,
    d: DVec3,
) -> Touch {
    let ring = plan.params.ring_radius;
    let relative = rest - tip.place;
    let ahead = relative.dot(tip.along);
    let radius = (relative - tip.along * ahead).length();
    // The dimple before the puncture is no opened path.
    let passes = tip.coordinate > 0.0 && ahead <= 0.0 && ahead > -ring && radius < ring;
    let passed = tip.inside && s > -PASSED_MARGIN && (memory.passed || passes);
    if passed != memory.passed {
        let rest_radius = if passed { radius } else { 0.0 };
        *memory = ContactState { passed, rest_radius, stored: memory.stored, ..ContactState::default() };
    }
    let needle = plan.profile;
    // The shaft alone: a node just before the tip is not passed yet, and is no obstacle to the cone.
    let reach = WATCHED * needle.radius;
    let distance = (lever - d * s).length();
    let met = tip.inside && !passed && s > needle.tip_length && distance < reach;
    let beside = ((reach - distance) / (reach - needle.radius)).clamp(0.0, 1.0);
    let behind = ((s - needle.tip_length) / (END_FADE * needle.tip_length)).clamp(0.0, 1.0);
    let in_ring = passed && s > 0.0 && memory.rest_radius > plan.params.softened_radius;
    Touch {
        touches: met || in_ring,
        rest_radius: memory.rest_radius,
        weight: if met { 1.0 } else { plan.params.ring_weight(memory.rest_radius) },
        end: if met { needle.tip_length } else { 0.0 },
        nearness: if met { beside * behind } else { 1.0 },
    }
}
