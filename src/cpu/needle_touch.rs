//! How the needle meets one contact node in the stage `needle_contact`. Equations: src/effects/puncture.rs, src/needle/gap.rs,
//! src/needle/free_path.rs.

use glam::DVec3;

use super::slit_contact::SlitContact;
use crate::effects::friction::part_on_shaft;
use crate::engine::ContactState;
use crate::model::{ContactNode, ContactSurface, Model, PuncturePlan};
use crate::needle::ToolPose;
use crate::needle::centre_line::{Bend, CentreLine};
use crate::needle::free_path::{END_FADE, FreeTip, PASSED_MARGIN, WATCHED, faded_at_end};
use crate::needle::gap::{Overlap, Profile};

/// The needle of one step.
pub(super) struct Needle<'a> {
    pub model: &'a Model,
    pub plan: &'a PuncturePlan,
    pub pose: &'a ToolPose,
    /// Its outer surface, turned as it is.
    pub profile: Profile,
    /// From the tip to the hub (unit vector).
    pub d: DVec3,
    /// Material coordinate of the tip [m]; of a free path where the tip is in the material.
    pub coordinate: f64,
    pub tip: FreeTip,
    /// Centre-line of a flexible needle, and the time since its frame began [s].
    pub line: Option<(&'a CentreLine, f64)>,
}

/// Where a node is seen from the needle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// From the tip to the node [m], and how far behind the tip that is along the needle [m].
    pub lever: DVec3,
    pub s: f64,
    /// The bent needle there.
    pub bend: Bend,
    /// Velocity of the node [m/s].
    pub velocity: DVec3,
}

/// What presses on a node.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pressing {
    /// Normal force on the node, and its part on the shaft [N].
    pub normal: DVec3,
    pub on_shaft: DVec3,
    /// Unit normal of the surface, also where nothing presses; velocity of the node past the needle [m/s].
    pub n: DVec3,
    pub v: DVec3,
    /// The part of the contact damping in the force [N].
    pub damping: DVec3,
    /// Torque about the tip [N m], energy stored [J], power on the bending needle [W].
    pub torque: DVec3,
    pub stored: f64,
    pub bend_power: f64,
    /// Largest friction [N].
    pub limit: f64,
    /// Stiffness of the contact, and the bound of the stiffness that it adds at the node [N/m].
    pub stiffness: f64,
    pub bound: f64,
}

/// How a node meets the needle that it is to be kept out of.
struct Touch {
    /// Its r0 [m], and the weight of its contact stiffness.
    rest_radius: f64,
    weight: f64,
    /// Front end of what it touches, behind the tip [m].
    end: f64,
    /// Part of that stiffness that counts in the step: it grows steadily towards the shaft, for a mass that jumped at a
    /// distance would pump energy into a node that swings there.
    nearness: f64,
}

impl Needle<'_> {
    /// Where a node `lever` from the tip is.
    pub fn place(&self, lever: DVec3, velocity: DVec3) -> Place {
        let s = lever.dot(self.d);
        let bend = self.line.map_or(Bend::default(), |(line, time)| line.at(s, time));
        Place { lever, s, bend, velocity }
    }

    /// True where the needle on a free path has nothing to do with a node that the tip has not passed, `lever` from the tip.
    pub fn is_far_from(&self, rest: DVec3, lever: DVec3) -> bool {
        let Needle { plan, tip, profile, .. } = self;
        if plan.free.is_none() || self.line.is_some() {
            return false;
        }
        let s = lever.dot(self.d);
        let reach = WATCHED * profile.radius;
        let beside = s <= profile.tip_length || lever.length_squared() - s * s > reach * reach;
        let (ring, relative) = (plan.params.ring_radius, rest - tip.place);
        // Within a cylinder of that radius and length behind the tip.
        beside && (!tip.inside || relative.length_squared() > 2.0 * ring * ring)
    }

    /// What presses on a node; `None` where the needle has nothing to do with it.
    pub fn pressing(
        &self,
        slit: &SlitContact,
        contact: &ContactNode,
        memory: &mut ContactState,
        at: &Place,
    ) -> Option<Pressing> {
        match contact.surface {
            ContactSurface::Slit { side } => Some(self.slit_pressing(slit, contact, side, memory, at)),
            _ => {
                let touch = match &self.plan.free {
                    None => self.planned_touch(contact, at),
                    Some(_) if !contact.pushed => None,
                    Some(_) => self.free_touch(self.model.mesh.rest_position(contact.node as usize), memory, at),
                };
                touch.map(|touch| self.surface_pressing(contact, &touch, memory, at))
            }
        }
    }

    /// Coefficient of friction on the shaft or in the bore.
    fn coefficient(&self, contact: &ContactNode) -> f64 {
        match (contact.surface, self.plan.needle.bore, self.model.effects.friction) {
            (ContactSurface::Bore, Some(bore), Some(_)) => bore.friction,
            (_, _, Some(friction)) => friction.coefficient,
            _ => 0.0,
        }
    }

    /// The points of the faces of a slit.
    fn slit_pressing(
        &self,
        slit: &SlitContact,
        contact: &ContactNode,
        side: DVec3,
        memory: &mut ContactState,
        at: &Place,
    ) -> Pressing {
        let force = slit.at(contact, side);
        memory.touching = force.normal != DVec3::ZERO;
        memory.on_shaft = force.on_shaft != DVec3::ZERO && at.s >= self.profile.tip_length;
        Pressing {
            normal: force.normal,
            on_shaft: force.on_shaft,
            n: force.normal.normalize_or_zero(),
            v: at.velocity - self.pose.velocity_behind() - at.bend.rate,
            damping: force.damping,
            torque: force.torque,
            stored: force.stored,
            bend_power: force.bend_power,
            limit: self.coefficient(contact) * force.rubbing,
            stiffness: self.plan.face_stiffness() * contact.share,
            bound: force.bound,
        }
    }

    /// The opened path or a wall of a tube: potential `1/2 k phi^2` with its damping.
    fn surface_pressing(
        &self,
        contact: &ContactNode,
        touch: &Touch,
        memory: &mut ContactState,
        at: &Place,
    ) -> Pressing {
        let Needle { model, plan, profile, d, .. } = self;
        let (d, s, cone) = (*d, at.s, profile.tip_length);
        let from_axis = at.lever - at.bend.offset;
        let overlap = |less: (f64, f64)| match contact.surface {
            ContactSurface::OpenedPath | ContactSurface::Slit { .. } => {
                profile.opened_path(from_axis, d, touch.rest_radius, less)
            }
            ContactSurface::OuterWall => profile.tube_wall(from_axis, d, false, less),
            ContactSurface::Bore => profile.tube_wall(from_axis, d, true, less),
        };
        if !memory.touching {
            memory.touching = true;
            memory.overlap = overlap((0.0, 0.0)).value.max(0.0);
            memory.axial_on = s;
        }
        let travel = (s - memory.axial_on) / plan.params.entry_fade;
        let fading = if travel > 0.0 && travel < 1.0 { -memory.overlap / plan.params.entry_fade } else { 0.0 };
        let mut overlap = overlap((memory.overlap * (1.0 - travel).clamp(0.0, 1.0), fading));
        if plan.free.is_some() {
            overlap = faded_at_end(overlap, d, s, touch.end, END_FADE * cone);
        }
        let Overlap { value: depth, gradient } = overlap;
        let gradient = gradient - d * gradient.dot(at.bend.slope);
        let steep = gradient.length();
        let n = -gradient / steep;
        let turning = self.pose.angular_velocity_behind().cross(at.lever);
        let v = at.velocity - self.pose.velocity_behind() - turning - at.bend.rate;
        let k = match contact.surface {
            ContactSurface::OpenedPath => plan.ring_stiffness(contact, touch.weight),
            _ => plan.contact_stiffness,
        };
        let mass = model.node_mass[contact.node as usize];
        let damping = 2.0 * plan.params.contact_damping * (k * mass).sqrt();
        let elastic = k * depth * steep;
        let touches = depth > 0.0;
        let pressure = if touches { (elastic - damping * v.dot(n)).max(0.0) } else { 0.0 };
        let normal = n * pressure;
        memory.on_shaft = touches && s >= cone;
        let fade = model.effects.friction.map_or(1.0, |f| f.fade_length);
        Pressing {
            normal,
            on_shaft: if s >= cone { normal } else { DVec3::ZERO },
            n,
            v,
            damping: if touches { n * (pressure - elastic) } else { DVec3::ZERO },
            torque: at.lever.cross(normal),
            stored: if touches { 0.5 * k * depth * depth } else { 0.0 },
            bend_power: normal.dot(at.bend.rate),
            limit: self.coefficient(contact) * part_on_shaft(s, cone, fade) * pressure,
            stiffness: k,
            // On a fine mesh, and where a separated face has half the mass of other nodes, contact limits the step. This
            // counts whether the node touches or not: a mass that came and went with the contact would make it chatter,
            // heavy on its way in and light on its way out.
            bound: 2.0 * k * steep * steep * touch.nearness,
        }
    }

    /// On a planned path: nodes of the ring that the tip has passed.
    fn planned_touch(&self, contact: &ContactNode, at: &Place) -> Option<Touch> {
        (contact.pushed && contact.rest_axial < self.coordinate && at.s > 0.0).then(|| Touch {
            rest_radius: contact.rest_radius,
            weight: self.plan.params.ring_weight(contact.rest_radius),
            end: 0.0,
            nearness: 1.0,
        })
    }

    /// On a free path: brings what the node with the rest position `rest` knows of the tip to this step, and tells how it meets
    /// the needle.
    fn free_touch(&self, rest: DVec3, memory: &mut ContactState, at: &Place) -> Option<Touch> {
        let Needle { plan, tip, .. } = self;
        let s = at.s;
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
        let distance = (at.lever - at.bend.offset - self.d * s).length();
        let met = tip.inside && !passed && s > needle.tip_length && distance < reach;
        let beside = ((reach - distance) / (reach - needle.radius)).clamp(0.0, 1.0);
        let behind = ((s - needle.tip_length) / (END_FADE * needle.tip_length)).clamp(0.0, 1.0);
        let in_ring = passed && s > 0.0 && memory.rest_radius > plan.params.softened_radius;
        (met || in_ring).then(|| Touch {
            rest_radius: memory.rest_radius,
            weight: if met { 1.0 } else { plan.params.ring_weight(memory.rest_radius) },
            end: if met { needle.tip_length } else { 0.0 },
            nearness: if met { beside * behind } else { 1.0 },
        })
    }
}
