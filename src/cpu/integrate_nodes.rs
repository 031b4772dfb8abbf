//! Stage `integrate_nodes` in f64: the step of every node, and what keeps it stable. Equations: src/effects/mass_scaling.rs.

use glam::DVec3;
use rayon::prelude::*;

use super::CpuEngine;
use crate::effects::mass_scaling::stable_mass;
use crate::engine::{StepInput, WATCHED_STEP_RATIO};
use crate::model::Model;
use crate::scene::Face;

/// Sums of one node over one step: energies [J], counts and the ratio of [`FrameSums::step_ratio`].
#[derive(Debug, Clone, Copy, Default)]
struct NodeSums {
    damping: f64,
    work: f64,
    raised_energy: f64,
    clamped_energy: f64,
    clamped: u32,
    raised: u32,
    step_ratio: f64,
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

impl CpuEngine {
    /// Stage `integrate_nodes`: `v+ = ((1 - alpha dt/2) v + dt f/m) / (1 + alpha dt/2)`, `u+ = u + dt v+`.
    pub(super) fn integrate_nodes(&mut self, input: &StepInput) {
        let model = self.model.clone();
        let dt = self.dt;
        let limit = model.speed_limit(dt);
        let gravity = model.effects.gravity.map_or(DVec3::ZERO, |g| g.acceleration / model.mass_scaling());
        let (cells, elements) = (&self.cells, &self.elements);
        let (external, added_bound) = (&self.external, &self.added_bound);
        let acting = |node: usize| {
            let own = [node as u32];
            // Tied copies move as one node: every copy sums over all of them and books its share of the mass.
            let copies = model.separation.tied(node).unwrap_or(&own);
            let mut sum = Acting::default();
            for copy in copies.iter().map(|n| *n as usize) {
                let (f, k) = elements.gather(&model.mesh, cells, copy);
                sum.force += f + external[copy];
                sum.bound += k + added_bound[copy];
                sum.mass += model.node_mass[copy];
                sum.load += gravity * model.node_mass[copy];
                sum.load += model.node_load.get(copy).map_or(DVec3::ZERO, |f| *f * input.load_factor);
            }
            sum.force += sum.load;
            sum.share = if copies.len() > 1 { model.node_mass[node] / sum.mass } else { 1.0 };
            sum
        };
        let nodes: Vec<NodeSums> = self
            .state
            .displacement
            .par_iter_mut()
            .zip(self.state.velocity.par_iter_mut())
            .enumerate()
            .with_min_len(256)
            .map(|(node, (u, v))| advance_node(&model, input, dt, limit, node, &acting(node), (u, v)))
            .collect();
        // In the order of the nodes: sums of threads that come as they come would differ in their last bits from run to run.
        let sums = &mut self.sums;
        for node in &nodes {
            sums.energy.damping += node.damping;
            sums.load_work += node.work;
            sums.energy.raised_mass += node.raised_energy;
            sums.energy.speed_limit += node.clamped_energy;
            sums.health.clamped_nodes += node.clamped;
            sums.health.raised_mass += node.raised;
            sums.step_ratio = sums.step_ratio.max(node.step_ratio);
        }
    }
}

/// Moves a node by one step of `dt` [s], no faster than `limit` [m/s]; displacement and velocity [m, m/s].
fn advance_node(
    model: &Model,
    input: &StepInput,
    dt: f64,
    limit: f64,
    node: usize,
    acting: &Acting,
    (u, v): (&mut DVec3, &mut DVec3),
) -> NodeSums {
    let Acting { force, load, bound, mass: scaled, share } = *acting;
    let alpha = model.scene.solver.mass_damping;
    let mass = if model.effects.mass_scaling.is_some() { stable_mass(scaled, bound, dt) } else { scaled };
    let ratio = bound * dt * dt / (4.0 * mass);
    let old = *v;
    let mut new = (old * (1.0 - 0.5 * alpha * dt) + force * (dt / mass)) / (1.0 + 0.5 * alpha * dt);
    // A held component moves as prescribed, whatever its load: the limit concerns the free ones.
    let fixed = model.fixed_components(node);
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
        let prescribed = prescribed_velocity(model, node, input, dt);
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
        // The kinetic energy is told with the mass at rest: what the rest of the mass gained in this step is gone.
        raised_energy: share * 0.5 * (mass - scaled) * (new.length_squared() - old.length_squared()),
        // Work of the force that holds the node back, `m (1 + alpha dt/2) / dt` times what it took of the velocity.
        clamped_energy: share * mass * (1.0 + 0.5 * alpha * dt) * stopped.dot(free_mid),
        clamped: u32::from(speed > limit),
        raised: u32::from(mass > scaled),
        step_ratio: if ratio > WATCHED_STEP_RATIO { ratio } else { 0.0 },
    }
}

/// Velocity that the driven faces prescribe at a node (zero where a face only holds) [m/s].
fn prescribed_velocity(model: &Model, node: usize, input: &StepInput, dt: f64) -> DVec3 {
    let mut velocity = DVec3::ZERO;
    for face in Face::ALL {
        if !model.lies_on(node, face) || model.faces()[face as usize].drive.is_none() {
            continue;
        }
        let axis = face.axis();
        let drive = input.drives[face as usize];
        let arm = model.mesh.rest_position(node) - model.face_centre(face);
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let mut du = drive.translation;
        du[b] += drive.cosine * arm[b] - drive.sine * arm[c];
        du[c] += drive.sine * arm[b] + drive.cosine * arm[c];
        velocity += du / dt;
    }
    velocity
}
