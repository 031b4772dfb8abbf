//! Stage `integrate_nodes` in f64: the step of every node, and what keeps it stable. Equations: src/effects/mass_scaling.rs.

use glam::DVec3;
use rayon::prelude::*;

use super::CpuEngine;
use super::added::Added;
use crate::effects::mass_scaling::{change_of_mass, stable_mass};
use crate::engine::{StepInput, WATCHED_STEP_RATIO};
use crate::model::Model;
use crate::scene::Face;

/// Sums of one node over one step: energies [J], counts and the ratio of [`FrameSums::step_ratio`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NodeSums {
    pub damping: f64,
    pub work: f64,
    pub raised_energy: f64,
    pub clamped_energy: f64,
    pub clamped: u32,
    pub raised: u32,
    pub step_ratio: f64,
}

/// What acts on a node, summed over its tied copies.
#[derive(Debug, Clone, Copy, Default)]
struct Acting {
    /// Force with the load in it, and the load alone [N].
    force: DVec3,
    load: DVec3,
    /// Bound of the stiffness at the node [N/m].
    bound: f64,
    /// Mass with its uniform factor [kg], and the part of it that is this copy's.
    mass: f64,
    share: f64,
}

impl NodeSums {
    pub fn add(&mut self, other: &NodeSums) {
        self.damping += other.damping;
        self.work += other.work;
        self.raised_energy += other.raised_energy;
        self.clamped_energy += other.clamped_energy;
        self.clamped += other.clamped;
        self.raised += other.raised;
        self.step_ratio = self.step_ratio.max(other.step_ratio);
    }
}

/// What every node of a step is told.
pub(super) struct NodeStep<'a> {
    pub model: &'a Model,
    pub input: &'a StepInput,
    pub dt: f64,
    /// Largest speed [m/s].
    pub limit: f64,
    /// Of the faces at rest [m].
    pub face_centres: &'a [DVec3; 6],
    pub gravity: DVec3,
    /// Forces and bounds beside those of the cells.
    pub added: &'a Added,
}

impl CpuEngine {
    /// Stage `integrate_nodes`: `v+ = ((1 - alpha dt/2) v + dt f/m) / (1 + alpha dt/2)`, `u+ = u + dt v+`.
    pub(super) fn integrate_nodes(&mut self, input: &StepInput) {
        let CpuEngine { model, state, elements, cells, lanes, .. } = self;
        let step = NodeStep {
            model,
            input,
            dt: self.dt,
            limit: self.speed_limit,
            face_centres: &self.face_centres,
            gravity: model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration / model.mass_scaling()),
            added: &self.added,
        };
        let nodes: Vec<NodeSums> = match lanes {
            Some(lanes) => lanes.integrate(&step, (&mut state.displacement, &mut state.velocity, &mut state.inertia)),
            None => {
                let gather = |node: usize| elements.gather(&model.mesh, cells, node);
                state
                    .displacement
                    .par_iter_mut()
                    .zip(state.velocity.par_iter_mut())
                    .zip(state.inertia.par_iter_mut())
                    .enumerate()
                    .with_min_len(256)
                    .map(|(node, ((u, v), inertia))| step.advance(node, gather, (u, v, inertia)))
                    .collect()
            }
        };
        // In the order of the nodes: sums of threads that come as they come would differ in their last bits from run to run.
        let mut all = NodeSums::default();
        for node in &nodes {
            all.add(node);
        }
        let sums = &mut self.sums;
        sums.energy.damping += all.damping;
        sums.load_work += all.work;
        sums.energy.raised_mass += all.raised_energy;
        sums.energy.speed_limit += all.clamped_energy;
        sums.health.clamped_nodes += all.clamped;
        sums.health.raised_mass += all.raised;
        sums.step_ratio = sums.step_ratio.max(all.step_ratio);
    }
}

impl NodeStep<'_> {
    /// Moves a node: displacement and velocity [m, m/s], mass over that at rest; `gather`: force of the cells on it and their bound.
    pub fn advance(
        &self,
        node: usize,
        gather: impl Fn(usize) -> (DVec3, f64),
        moved: (&mut DVec3, &mut DVec3, &mut f32),
    ) -> NodeSums {
        advance_node(self, node, &self.acting(node, gather), moved)
    }

    /// What acts on a node.
    fn acting(&self, node: usize, gather: impl Fn(usize) -> (DVec3, f64)) -> Acting {
        let NodeStep { model, input, gravity, added, .. } = *self;
        let own = [node as u32];
        // Tied copies move as one node: every copy sums over all of them and books its share of the mass.
        let copies = model.separation.tied(node).unwrap_or(&own);
        let mut sum = Acting::default();
        for copy in copies.iter().map(|n| *n as usize) {
            let ((f, k), added) = (gather(copy), added.at(copy));
            sum.force += f + added.0;
            sum.bound += k + added.1;
            sum.mass += model.node_mass[copy];
            sum.load += gravity * model.node_mass[copy];
            sum.load += model.node_load.get(copy).map_or(DVec3::ZERO, |f| *f * input.load_factor);
        }
        sum.force += sum.load;
        sum.share = if copies.len() > 1 { model.node_mass[node] / sum.mass } else { 1.0 };
        sum
    }
}

/// Moves a node by one step, no faster than the limit: displacement and velocity [m, m/s], mass over that at rest.
fn advance_node(
    step: &NodeStep,
    node: usize,
    acting: &Acting,
    (u, v, inertia): (&mut DVec3, &mut DVec3, &mut f32),
) -> NodeSums {
    let NodeStep { model, dt, limit, .. } = *step;
    let Acting { force, load, bound, mass: scaled, share } = *acting;
    let alpha = model.scene.solver.mass_damping;
    let mass = if model.effects.mass_scaling.is_some() { stable_mass(scaled, bound, dt) } else { scaled };
    let ratio = bound * dt * dt / (4.0 * mass);
    // A held component moves as prescribed, whatever its load: the limit concerns the free ones.
    let fixed = model.fixed_components(node);
    let came = *v;
    let slowed = change_of_mass(inertia, mass / scaled);
    let old = DVec3::from(std::array::from_fn(|a| if fixed[a] { came[a] } else { came[a] * slowed }));
    let mut new = (old * (1.0 - 0.5 * alpha * dt) + force * (dt / mass)) / (1.0 + 0.5 * alpha * dt);
    for a in 0..3 {
        if fixed[a] {
            new[a] = 0.0;
        }
    }
    let speed = new.length();
    let mut stopped = DVec3::ZERO;
    if speed > limit {
        stopped = new * (1.0 - limit / speed);
        new -= stopped;
    }
    let mut free_mid = 0.5 * (old + new);
    let mut work = 0.0;
    if fixed.contains(&true) {
        let prescribed = prescribed_velocity(step, node);
        for a in 0..3 {
            if fixed[a] {
                // Reaction: what the support must add to move the node as prescribed.
                let mid = 0.5 * (old[a] + prescribed[a]);
                let reaction = mass * (prescribed[a] - old[a]) / dt - force[a];
                work += reaction * mid * dt;
                new[a] = prescribed[a];
                free_mid[a] = 0.0;
            }
        }
    }
    let mid = 0.5 * (old + new);
    work += load.dot(mid) * dt;
    *v = new;
    *u += new * dt;
    NodeSums {
        damping: share * alpha * mass * free_mid.length_squared() * dt,
        work: share * work,
        // The kinetic energy is told with the mass at rest: what the rest of the mass gained in this step is not in it, nor what that
        // lost of its own, nor what the force did on the way that went.
        raised_energy: share
            * (0.5 * (mass - scaled) * (new.length_squared() - old.length_squared())
                + 0.5 * scaled * (came.length_squared() - old.length_squared())
                + 0.5 * dt * force.dot(came - old)),
        // Work of the force that holds the node back, `m (1 + alpha dt/2) / dt` times what it took of the velocity.
        clamped_energy: share * mass * (1.0 + 0.5 * alpha * dt) * stopped.dot(free_mid),
        clamped: u32::from(speed > limit),
        raised: u32::from(mass > scaled),
        step_ratio: if ratio > WATCHED_STEP_RATIO { ratio } else { 0.0 },
    }
}

/// Velocity that the driven faces prescribe at a node (zero where a face only holds) [m/s].
fn prescribed_velocity(step: &NodeStep, node: usize) -> DVec3 {
    let NodeStep { model, input, dt, face_centres, .. } = *step;
    let mut velocity = DVec3::ZERO;
    for face in Face::ALL {
        if !model.lies_on(node, face) || model.faces()[face as usize].drive.is_none() {
            continue;
        }
        let axis = face.axis();
        let drive = input.drives[face as usize];
        let arm = model.mesh.rest_position(node) - face_centres[face as usize];
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut du = drive.translation;
        du[b] += drive.cosine * arm[b] - drive.sine * arm[c];
        du[c] += drive.sine * arm[b] + drive.cosine * arm[c];
        velocity += du / dt;
    }
    velocity
}
