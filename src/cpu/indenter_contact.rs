//! Stage `indenter_contact` in f64. Equations: src/effects/indentation.rs.

use glam::DVec3;

use super::{ContactSums, CpuEngine};
use crate::effects::friction::stick_or_slide;
use crate::effects::indentation::{Plan, penetration};
use crate::engine::State;
use crate::model::{ContactNode, Model};
use crate::needle::slit::{POINTS, weights};
use crate::needle::{Tool, ToolPose};

impl CpuEngine {
    /// Stage `indenter_contact`: penalty contact of the surface with a sphere or a flat punch.
    pub(super) fn indenter_contact(&mut self, pose: &ToolPose) {
        let model = self.model.clone();
        let (Some(plan), Some(tool)) = (&model.indentation, &model.scene.tool) else { return };
        let bonded = matches!(tool, Tool::FlatPunch { bonded: true, .. });
        let dt = self.dt;
        let mut stored = 0.0;
        let State { contact: memories, displacement, velocity, .. } = &mut self.state;
        for (contact, memory) in model.contact_nodes.iter().zip(memories) {
            let node = contact.node as usize;
            let x = contact.place(&model.mesh) + displacement[node];
            let v = velocity[node] - pose.velocity_behind();
            let k = plan.face_stiffness * contact.share;
            self.added.add(node, DVec3::ZERO, plan.stiffness_bound(contact.share));
            let mut sums = ContactSums::default();
            if bonded {
                let Some((depth, n)) = penetration(tool, x - pose.tip, pose.direction, contact.rest_radius) else {
                    return;
                };
                memory.touching |= depth > 0.0;
                if memory.touching {
                    let damping = v * (-plan.face_damping * k);
                    memory.stick += (v - n * v.dot(n)) * dt;
                    sums.normal = n * (k * depth) + damping - memory.stick * k;
                    sums.damping = memory.damped(damping, v, dt);
                    sums.stored = 0.5 * k * (depth * depth + memory.stick.length_squared());
                }
                sums.torque = (x - pose.tip).cross(sums.normal);
            } else {
                let nodes = (displacement.as_slice(), velocity.as_slice());
                let points = pressed_points(&model, plan, tool, pose, contact, nodes);
                sums.normal = points.normal;
                sums.torque = points.torque;
                sums.stored = points.stored;
                sums.damping = memory.damped(points.damping, v, dt);
                memory.touching = points.pressing > 0.0;
                if let Some(friction) = model.effects.friction {
                    let n = sums.normal.normalize_or_zero();
                    let kt = friction.stiffness_ratio * k;
                    let motion = (v - n * v.dot(n)) * dt;
                    let stick = stick_or_slide(memory.stick, motion, n, kt, friction.coefficient * points.pressing);
                    memory.stick = stick.stretch;
                    sums.friction = stick.force;
                    sums.friction_work = stick.dissipated;
                    sums.stored += stick.stored;
                }
                sums.torque += (x - pose.tip).cross(sums.friction);
            }
            memory.stored = sums.stored;
            self.added.add(node, sums.normal + sums.friction, 0.0);
            stored += sums.stored;
            self.sums.book(&sums, pose, dt);
        }
        self.contact_energy = stored;
    }
}

/// What the points of all faces around a node do to the node.
#[derive(Debug, Clone, Copy, Default)]
struct PointForce {
    /// Normal force [N], the part of the damping in it, and its torque about the tip [N m].
    normal: DVec3,
    damping: DVec3,
    torque: DVec3,
    /// Sum of the normal forces of the points [N], each with its weight; stored [J].
    pressing: f64,
    stored: f64,
}

/// `displacement` [m] and `velocity` [m/s] of all nodes.
fn pressed_points(
    model: &Model,
    plan: &Plan,
    tool: &Tool,
    pose: &ToolPose,
    contact: &ContactNode,
    (displacement, velocity): (&[DVec3], &[DVec3]),
) -> PointForce {
    let mut sum = PointForce::default();
    let Some(faces) = &contact.faces else {
        return pressed_node(model, plan, tool, pose, contact, (displacement, velocity));
    };
    for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        if faces.present & (1 << (i + 2 * j)) == 0 {
            continue;
        }
        let others = faces.corners(i, j).map(|c| &model.contact_nodes[c as usize]);
        let corners = [contact, others[0], others[1], others[2]];
        let nodes = corners.map(|c| c.node as usize);
        let rest = corners.map(|c| c.place(&model.mesh));
        let area = (rest[1] - rest[0]).cross(rest[2] - rest[0]).length();
        let k = plan.face_stiffness * area / (POINTS * POINTS) as f64;
        for (a, b) in (0..POINTS).flat_map(|a| (0..POINTS).map(move |b| (a, b))) {
            let w = weights(a, b);
            let at = |values: [DVec3; 4]| (0..4).map(|c| values[c] * w[c]).sum::<DVec3>();
            let lever = at(std::array::from_fn(|c| rest[c] + displacement[nodes[c]] - pose.tip));
            let rest_radius = (at(rest) - model.scene.motion.entry).truncate().length();
            let Some((depth, n)) = penetration(tool, lever, pose.direction, rest_radius).filter(|p| p.0 > 0.0) else {
                continue;
            };
            let vn = (at(nodes.map(|n| velocity[n])) - pose.velocity_behind()).dot(n);
            let elastic = k * depth;
            let normal = (elastic - plan.face_damping * k * vn).max(0.0);
            let force = n * (w[0] * normal);
            sum.pressing += w[0] * normal;
            sum.normal += force;
            sum.torque += lever.cross(force);
            sum.stored += w[0] * 0.5 * k * depth * depth;
            sum.damping += n * (w[0] * (normal - elastic));
        }
    }
    sum
}

/// The same where there are no faces: the node itself touches, for its share of the triangles around it.
fn pressed_node(
    model: &Model,
    plan: &Plan,
    tool: &Tool,
    pose: &ToolPose,
    contact: &ContactNode,
    (displacement, velocity): (&[DVec3], &[DVec3]),
) -> PointForce {
    let node = contact.node as usize;
    let lever = contact.place(&model.mesh) + displacement[node] - pose.tip;
    let found = penetration(tool, lever, pose.direction, contact.rest_radius).filter(|p| p.0 > 0.0);
    let Some((depth, n)) = found else { return PointForce::default() };
    let k = plan.face_stiffness * contact.share;
    let elastic = k * depth;
    let normal = (elastic - plan.face_damping * k * (velocity[node] - pose.velocity_behind()).dot(n)).max(0.0);
    PointForce {
        normal: n * normal,
        damping: n * (normal - elastic),
        torque: lever.cross(n * normal),
        pressing: normal,
        stored: 0.5 * k * depth * depth,
    }
}
