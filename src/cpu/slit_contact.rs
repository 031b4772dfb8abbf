//! Part of the stage `needle_contact` in f64: contact at the points of the faces of a slit. Equations: src/needle/slit.rs.

use glam::DVec3;

use crate::effects::friction::part_on_shaft;
use crate::model::{ContactNode, Model, PuncturePlan};
use crate::needle::ToolPose;
use crate::needle::centre_line::{Bend, CentreLine};
use crate::needle::gap::Profile;
use crate::needle::slit::{POINTS, weights};

/// What the points do to one corner of their faces.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SlitForce {
    /// Normal force on the node, and its part on the shaft [N].
    pub normal: DVec3,
    pub on_shaft: DVec3,
    /// Sum of the normal forces where the shaft rubs, each times the part of the friction that is there [N].
    pub rubbing: f64,
    /// Force of the contact damping in it [N].
    pub damping: DVec3,
    /// Stored energy [J] and power of the bending needle [W].
    pub stored: f64,
    pub bend_power: f64,
    /// Torque about the tip [N m].
    pub torque: DVec3,
    /// Bound of the stiffness at the node [N/m].
    pub bound: f64,
}

/// The needle of one step.
pub(super) struct SlitContact<'a> {
    pub model: &'a Model,
    pub plan: &'a PuncturePlan,
    pub profile: Profile,
    pub pose: &'a ToolPose,
    /// Material coordinate of the tip [m].
    pub coordinate: f64,
    /// Centre-line of a flexible needle, and the time since its frame began [s].
    pub line: Option<(&'a CentreLine, f64)>,
    /// Displacements [m] and velocities [m/s] of all nodes.
    pub displacement: &'a [DVec3],
    pub velocity: &'a [DVec3],
}

impl SlitContact<'_> {
    /// Force of the points of all faces around the node, as far as it falls on this node.
    pub fn at(&self, contact: &ContactNode, side: DVec3) -> SlitForce {
        let mut sum = SlitForce::default();
        let Some(faces) = &contact.faces else { return sum };
        let d = -self.pose.direction;
        let fade = self.model.effects.friction.map_or(1.0, |f| f.fade_length);
        for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            if faces.present & (1 << (i + 2 * j)) == 0 {
                continue;
            }
            let others = faces.corners(i, j).map(|c| &self.model.contact_nodes[c as usize]);
            let corners = [contact, others[0], others[1], others[2]];
            let rest = corners.map(|c| self.model.mesh.rest_position(c.node as usize));
            let places: [DVec3; 4] =
                std::array::from_fn(|c| rest[c] + self.displacement[corners[c].node as usize] - self.pose.tip);
            let area = (rest[1] - rest[0]).cross(rest[2] - rest[0]).length();
            let k = self.plan.face_stiffness() * area / (POINTS * POINTS) as f64;
            for (a, b) in (0..POINTS).flat_map(|a| (0..POINTS).map(move |b| (a, b))) {
                let w = weights(a, b);
                let at = |values: [DVec3; 4]| (0..4).map(|c| values[c] * w[c]).sum::<DVec3>();
                let relative = at(places);
                let s = relative.dot(d);
                let rest_axial: f64 = (0..4).map(|c| corners[c].rest_axial * w[c]).sum();
                if rest_axial >= self.coordinate || s <= 0.0 {
                    continue;
                }
                let bend = self.line.map_or(Bend::default(), |(line, time)| line.at(s, time));
                let overlap = self.profile.slit_face(relative - bend.offset, d, side, (0.0, 0.0));
                if overlap.value <= 0.0 {
                    continue;
                }
                let gradient = overlap.gradient - d * overlap.gradient.dot(bend.slope);
                let steep = gradient.length();
                let n = -gradient / steep;
                let v = at(corners.map(|c| self.velocity[c.node as usize])) - self.pose.velocity_behind() - bend.rate;
                let vn = v.dot(n);
                let elastic = k * overlap.value * steep;
                let normal = (elastic - self.plan.face_damping * k * vn).max(0.0);
                let force = n * (w[0] * normal);
                sum.normal += force;
                if s >= self.profile.tip_length {
                    sum.on_shaft += force;
                }
                sum.rubbing += w[0] * normal * part_on_shaft(s, self.profile.tip_length, fade);
                sum.stored += w[0] * 0.5 * k * overlap.value * overlap.value;
                sum.damping += n * (w[0] * (normal - elastic));
                sum.bend_power += force.dot(bend.rate);
                sum.torque += relative.cross(force);
                sum.bound += 2.0 * w[0] * k * steep * steep;
            }
        }
        sum
    }
}
