//! Stage `needle_contact` in f64. Equations: src/effects/puncture.rs, src/needle/gap.rs.

use glam::DVec3;

use super::needle_touch::Needle;
use super::slit_contact::SlitContact;
use super::{ContactSums, CpuEngine};
use crate::effects::friction::stick_or_slide;
use crate::engine::{ContactState, State};
use crate::model::{ANCHOR_COUNT, ContactNode, ContactSurface, Model, PuncturePlan};
use crate::needle::gap::Profile;
use crate::needle::{ToolPose, swing};

/// In [`NearNodes::of_node`]: no contact node.
const NO_CONTACT: u32 = u32::MAX;

/// Which contact nodes are looked at in a step, where that is not all of them. Most nodes beside a free path are far away from the needle, and
/// nothing of theirs changes; those beside an opened path only carry the tip where it is.
pub(super) struct NearNodes {
    /// Contact node of every node.
    of_node: Vec<u32>,
    /// No node is kept out of the needle: what does not carry the tip has nothing to do with it.
    only_carry: bool,
    /// Numbers of those that the needle touches or has passed.
    busy: Vec<u32>,
    /// The state is one that somebody has written.
    pub is_stale: bool,
}

impl NearNodes {
    /// For a model with a free path, whose contact nodes are all nodes beside it, or with an opened one, where they are all that may carry the
    /// tip.
    pub fn of(model: &Model) -> Option<Self> {
        let is_free = model.puncture.as_ref()?.free.is_some();
        let carries = |c: &ContactNode| !c.pushed && c.surface == ContactSurface::OpenedPath;
        let only_carry = !is_free && model.contact_nodes.iter().all(carries);
        if !is_free && !only_carry {
            return None;
        }
        let mut of_node = vec![NO_CONTACT; model.mesh.node_count()];
        for (index, contact) in model.contact_nodes.iter().enumerate() {
            of_node[contact.node as usize] = index as u32;
        }
        Some(NearNodes { of_node, only_carry, busy: Vec::new(), is_stale: true })
    }

    /// Contact nodes that carry the tip.
    fn carriers(&self, tip_loads: &NodeLoads) -> impl Iterator<Item = u32> {
        tip_loads.nodes().map(|node| self.of_node[node]).filter(|index| *index != NO_CONTACT)
    }

    /// Keeps those of `looked_at` that must be looked at again wherever they are.
    fn keep(&mut self, looked_at: &[u32], memories: &[ContactState]) {
        self.busy.clear();
        let is_busy = |memory: &ContactState| memory.passed || memory.touching;
        self.busy.extend(looked_at.iter().filter(|index| is_busy(&memories[**index as usize])));
    }
}

/// From how many nodes on the threads share them.
const SHARED_NODES: usize = 256;

/// What the needle does to a contact node in a step.
struct NodeAtNeedle {
    index: usize,
    /// What it remembers from now on.
    memory: ContactState,
    sums: ContactSums,
    /// [N/m]
    bound: f64,
    /// Power of its forces on a needle that bends [W].
    bend_power: f64,
}

/// What the springs of the tip do to a node.
#[derive(Debug, Clone, Copy)]
struct NodeLoad {
    node: usize,
    /// [N], [N/m]
    force: DVec3,
    stiffness: f64,
}

/// Loads of the few nodes that carry the tip.
#[derive(Debug, Default)]
pub(super) struct NodeLoads {
    list: Vec<NodeLoad>,
    /// One more than the place in the list, of every node; 0 for none.
    places: Vec<u32>,
}

impl NodeLoads {
    /// Takes all loads away, of a mesh of so many nodes.
    fn clear(&mut self, nodes: usize) {
        self.places.resize(nodes, 0);
        for load in self.list.drain(..) {
            self.places[load.node] = 0;
        }
    }

    /// The load of a node, begun where there is none.
    fn at(&mut self, node: usize) -> &mut NodeLoad {
        if self.places[node] == 0 {
            self.list.push(NodeLoad { node, force: DVec3::ZERO, stiffness: 0.0 });
            self.places[node] = self.list.len() as u32;
        }
        &mut self.list[self.places[node] as usize - 1]
    }

    /// The load of a node that has one.
    fn of(&self, node: usize) -> Option<&NodeLoad> {
        self.list.get((self.places[node] as usize).wrapping_sub(1))
    }

    fn nodes(&self) -> impl Iterator<Item = usize> {
        self.list.iter().map(|load| load.node)
    }
}

impl CpuEngine {
    /// Stage `needle_contact`: nodes of the ring that the tip has passed stay outside the opened path (potential
    /// `1/2 k phi^2`, see `needle::gap`); friction on the shaft; tip springs.
    pub(super) fn needle_contact(&mut self, plan: &PuncturePlan, pose: &ToolPose, step: u64) {
        let model = self.model.clone();
        let mut tip_loads = std::mem::take(&mut self.tip_loads);
        self.load_tip(plan, pose, &mut tip_loads);
        let centre_line = self.centre_line;
        let line = centre_line.as_ref().map(|l| (l, (step - l.first_step) as f64 * self.dt));
        let turned = swing(plan.reference, pose.direction, plan.profile.shift);
        let profile = Profile { shift: turned, ..plan.profile };
        let (coordinate, tip) = (self.state.tip_coordinate, self.state.tip);
        let needle = Needle { model: &model, plan, pose, profile, d: -pose.direction, coordinate, tip, line };
        if self.near.as_ref().is_some_and(|near| near.only_carry) {
            self.carry_tip(&needle, &tip_loads);
            self.tip_loads = tip_loads;
            return;
        }
        let looked_at = self.nodes_at_needle(&needle, &tip_loads);
        let State { contact, displacement, velocity, .. } = &self.state;
        let slit = SlitContact { model: &model, plan, profile, pose, coordinate, line, displacement, velocity };
        let touch = |index: &u32| self.node_at_needle(*index, &contact[*index as usize], &needle, &slit, &tip_loads);
        let touched: Vec<NodeAtNeedle> = match looked_at.len() {
            few if few < SHARED_NODES => looked_at.iter().filter_map(touch).collect(),
            many => {
                let ranges = self
                    .in_ranges(many, |range| looked_at[range].iter().filter_map(touch).collect::<Vec<NodeAtNeedle>>());
                ranges.into_iter().flatten().collect()
            }
        };
        // In the order of the nodes: no bit hangs on the number of threads.
        let mut stored = self.tip_energy;
        for NodeAtNeedle { index, memory, sums, bound, bend_power } in touched {
            let node = model.contact_nodes[index].node as usize;
            let total = sums.tip + sums.normal + sums.friction;
            self.state.contact[index] = memory;
            self.added.add(node, total, bound);
            stored += sums.stored;
            self.sums.book(&sums, pose, self.dt);
            if line.is_some() {
                self.sums.tool_work += bend_power * self.dt;
                self.sums.last_tool_work += bend_power * self.dt;
                self.node_impulse[index] += total * self.dt;
            }
        }
        self.contact_energy = stored;
        self.tip_loads = tip_loads;
        if let Some(near) = &mut self.near {
            near.keep(&looked_at, &self.state.contact);
        }
    }

    /// The nodes that carry the tip of a planned, opened path, in the order of the contact nodes: nothing else of the contact acts there, and
    /// nothing is remembered.
    fn carry_tip(&mut self, needle: &Needle, tip_loads: &NodeLoads) {
        let Needle { pose, line, .. } = *needle;
        let mut carriers: Vec<u32> = self.near.iter().flat_map(|near| near.carriers(tip_loads)).collect();
        carriers.sort_unstable();
        self.contact_energy = self.tip_energy;
        for index in carriers.into_iter().map(|index| index as usize) {
            let node = needle.model.contact_nodes[index].node as usize;
            let Some(load) = tip_loads.of(node) else { continue };
            self.added.add(node, load.force, load.stiffness);
            let lever = self.rest[node] + self.state.displacement[node] - pose.tip;
            let sums = ContactSums { tip: load.force, torque: lever.cross(load.force), ..ContactSums::default() };
            self.sums.book(&sums, pose, self.dt);
            if line.is_some() {
                let bend_power = load.force.dot(needle.place(lever, DVec3::ZERO).bend.rate);
                self.sums.tool_work += bend_power * self.dt;
                self.sums.last_tool_work += bend_power * self.dt;
                self.node_impulse[index] += load.force * self.dt;
            }
        }
    }

    /// What the needle does to the contact node number `index` with its `memory`; `None`: nothing, and nothing of it changes.
    fn node_at_needle(
        &self,
        index: u32,
        memory: &ContactState,
        needle: &Needle,
        slit: &SlitContact,
        tip_loads: &NodeLoads,
    ) -> Option<NodeAtNeedle> {
        let Needle { model, plan, pose, .. } = *needle;
        let index = index as usize;
        let contact = &model.contact_nodes[index];
        let node = contact.node as usize;
        let (mut sums, mut memory, mut bound) = (ContactSums::default(), *memory, 0.0);
        match tip_loads.of(node) {
            Some(load) => {
                sums.tip = load.force;
                bound += load.stiffness;
            }
            // What only carries the tip of a planned path, and carries nothing.
            None if !contact.pushed && plan.free.is_none() && contact.surface == ContactSurface::OpenedPath => {
                return None;
            }
            None => {}
        }
        let rest = self.rest[node];
        let lever = rest + self.state.displacement[node] - pose.tip;
        // Most nodes of a free path, all of them where a hand leads: nothing of theirs would change.
        let carries = sums.tip != DVec3::ZERO;
        let is_idle = !carries && !memory.passed && !memory.touching && needle.is_far_from(rest, lever);
        if is_idle {
            return (bound > 0.0).then_some(NodeAtNeedle { index, memory, sums, bound, bend_power: 0.0 });
        }
        let at = needle.place(lever, self.state.velocity[node]);
        let mut bend_power = sums.tip.dot(at.bend.rate);
        match needle.pressing(slit, contact, &mut memory, &at) {
            None => {
                // What the springs of a contact held goes with it.
                sums.released = memory.stored;
                let (rest_radius, passed) = (memory.rest_radius, memory.passed);
                memory = ContactState { rest_radius, passed, ..ContactState::default() };
            }
            Some(now) => {
                sums.normal = now.normal;
                sums.on_shaft = now.on_shaft;
                sums.torque = now.torque;
                sums.stored = now.stored;
                sums.damping = memory.damped(now.damping, now.v, self.dt);
                bound += now.bound;
                bend_power += now.bend_power;
                if let Some(friction) = model.effects.friction {
                    let kt = friction.stiffness_ratio * now.stiffness;
                    let motion = (now.v - now.n * now.v.dot(now.n)) * self.dt;
                    let stick = stick_or_slide(memory.stick, motion, now.n, kt, now.limit);
                    memory.stick = stick.stretch;
                    sums.friction = stick.force;
                    sums.friction_work = stick.dissipated;
                    sums.stored += stick.stored;
                }
            }
        }
        memory.stored = sums.stored;
        sums.torque += lever.cross(sums.tip + sums.friction);
        bend_power += sums.friction.dot(at.bend.rate);
        Some(NodeAtNeedle { index, memory, sums, bound, bend_power })
    }

    /// Numbers of the contact nodes that the needle may have to do with, in their order: all of them on a planned path; on a free one, where every
    /// node is a contact node, what is not far from the needle, what it has touched or passed, and what carries the tip.
    fn nodes_at_needle(&mut self, needle: &Needle, tip_loads: &NodeLoads) -> Vec<u32> {
        let count = needle.model.contact_nodes.len();
        let all = || (0..count as u32).collect::<Vec<u32>>();
        // A needle that bends is near to nothing along a straight line.
        if needle.line.is_some() {
            self.look_at_all();
            return all();
        }
        let Some(mut near) = self.near.take() else { return all() };
        if std::mem::take(&mut near.is_stale) {
            near.keep(&all(), &self.state.contact);
        }
        let displacement = &self.state.displacement;
        let is_near = |index: &usize| {
            let node = needle.model.contact_nodes[*index].node as usize;
            let rest = self.rest[node];
            !needle.is_far_from(rest, rest + displacement[node] - needle.pose.tip)
        };
        let found =
            self.in_ranges(count, |range| range.filter(is_near).map(|index| index as u32).collect::<Vec<u32>>());
        let mut all: Vec<u32> = found.into_iter().flatten().collect();
        all.extend(&near.busy);
        all.extend(near.carriers(tip_loads));
        all.sort_unstable();
        all.dedup();
        self.near = Some(near);
        all
    }

    /// Finds force and stiffness of the tip springs at the nodes that they act on.
    fn load_tip(&self, plan: &PuncturePlan, pose: &ToolPose, loads: &mut NodeLoads) {
        let count = if plan.anchors.is_empty() { ANCHOR_COUNT } else { plan.anchors.len() };
        let spring = plan.params.tip_stiffness / count as f64;
        loads.clear(self.rest.len());
        for (force, nodes, weights) in &self.tip_forces {
            let acts = if plan.free.is_some() { self.state.tip.inside } else { *force != 0.0 };
            for (n, w) in nodes.iter().zip(weights) {
                let load = loads.at(*n);
                load.force += (pose.direction * *force + self.tip_sway) * *w;
                // Of how many springs, first.
                load.stiffness += if acts { *w } else { 0.0 };
            }
        }
        loads.list.iter_mut().for_each(|load| load.stiffness *= spring);
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
