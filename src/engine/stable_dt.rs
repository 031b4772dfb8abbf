//! The stable time step, computed before the run.

use glam::DVec3;
use rayon::prelude::*;

use super::elements::{CellStates, Elements};
use crate::mesh::Mesh;
use crate::model::{ContactSurface, Model};

/// Most by which mass scaling may raise the mass of a node that contact makes stiff. In tissue that is soft beside its tip springs
/// masses raised tenfold took half of the first work. Tip springs that are stiffer than the tissue count in full: the tip strikes tissue that
/// bounces, and with raised masses up to 5.6 % of the first work was created where they are 10 to 46 times stiffer (1.1 % so).
const RAISED_AT_REST: f64 = 4.0;

/// Wave-speed bound of the undamped central difference at rest [s]: the shortest `2 sqrt(m / k)` of all nodes with the
/// bound `k` of their stiffness ([`Elements::stiffness_bound`]): for cells of one size the edge over the speed of
/// pressure waves.
///
/// A run takes this one times the safety factor. With mass scaling the mass of nodes in contact and around squeezed cells
/// is raised for as long as they are stiffer, by contact alone at most four times; without, contact counts here in full, and
/// the step follows the cells ([`crate::simulation::stiffening`]).
pub fn wave_speed_bound(model: &Model) -> f64 {
    let rest = vec![DVec3::ZERO; model.mesh.node_count()];
    let mut bound = stiffness_bounds(model, &rest);
    let mut mass = model.node_mass.clone();
    for tie in &model.separation.ties {
        let sum = |values: &[f64]| tie.iter().map(|n| values[*n as usize]).sum::<f64>();
        let (k, m) = (sum(&bound), sum(&mass));
        tie.iter().for_each(|n| (bound[*n as usize], mass[*n as usize]) = (k, m));
    }
    // A pair adds its stiffness once on the diagonal and once beside it.
    if let Some(law) = model.cohesion {
        for pair in &model.separation.pairs {
            for node in pair.nodes {
                bound[node as usize] += 2.0 * law.penalty * pair.area;
            }
        }
    }
    // Contact and tip springs: with mass scaling the mass follows them, but may not be raised by much before anything is
    // squeezed; without, the step has room for all of them from the start.
    let raised = if model.effects.mass_scaling.is_some() { RAISED_AT_REST } else { 1.0 };
    let springs = model.puncture.as_ref().map_or(0.0, |plan| plan.params.tip_stiffness * model.largest_spring_share());
    bound.iter_mut().zip(contact_bounds(model)).filter(|(_, contact)| *contact > 0.0).for_each(|(k, contact)| {
        *k = k.max((*k + contact) / raised).max(springs);
    });
    let steps = bound.iter().zip(&mass).map(|(k, m)| 2.0 * (m / k).sqrt());
    steps.fold(f64::INFINITY, f64::min)
}

/// Bound of the stiffness that tool and tip springs can add at every node while the tissue is at rest [N/m], damping of contact
/// included.
pub fn contact_bounds(model: &Model) -> Vec<f64> {
    let mut bound = vec![0.0; model.mesh.node_count()];
    if let Some(plan) = &model.indentation {
        for contact in &model.contact_nodes {
            bound[contact.node as usize] += plan.stiffness_bound(contact.share);
        }
    }
    let Some(plan) = &model.puncture else { return bound };
    let springs = model.largest_spring_share();
    // The wall of a cone is steeper than that of the shaft.
    let steep = 1.0 + (plan.needle.radius / plan.profile.tip_length).powi(2);
    for contact in &model.contact_nodes {
        let k = match contact.surface {
            _ if !contact.pushed => 0.0,
            ContactSurface::OpenedPath if plan.free.is_some() => plan.ring_stiffness(contact, 1.0),
            ContactSurface::OpenedPath => plan.ring_stiffness(contact, plan.params.ring_weight(contact.rest_radius)),
            ContactSurface::Slit { .. } => plan.face_stiffness() * contact.share,
            ContactSurface::OuterWall | ContactSurface::Bore => plan.contact_stiffness,
        };
        let node = contact.node as usize;
        bound[node] = bound[node].max(2.0 * k * steep + plan.params.tip_stiffness * springs);
    }
    bound
}

/// Bound of the stiffness that the cells add at every node where the displacement is `u` [N/m]; no history, intact cells.
pub fn stiffness_bounds(model: &Model, u: &[DVec3]) -> Vec<f64> {
    let elements = Elements::new(model);
    let mut bound = vec![0.0; model.mesh.node_count()];
    for cell in 0..model.mesh.cell_count() {
        let k = elements.stiffness_bound_at(model, cell, u);
        for (node, k) in model.mesh.cell_nodes(cell).iter().zip(k) {
            bound[*node] += k;
        }
    }
    bound
}

/// Limit of the undamped central difference at rest [s], `2 / omega_max` with the largest eigenfrequency of the
/// linearised block by power iteration on M^-1 K. Converges from above.
pub fn power_iteration(model: &Model) -> f64 {
    2.0 / largest_frequency(model, &vec![DVec3::ZERO; model.mesh.node_count()], &model.node_mass)
}

/// Largest frequency [rad/s] of small motions about the displacement `base`, with these nodal masses [kg], of the cells alone, without
/// history: power iteration on M^-1 K. Converges from below.
pub fn largest_frequency(model: &Model, base: &[DVec3], mass: &[f64]) -> f64 {
    let elements = Elements::new(model);
    largest_frequency_of(model, base, mass, &mut |u| {
        elements.internal_forces(model, u, CellStates::default()).into_iter().map(|f| -f).collect()
    })
}

/// The same of any forces on the nodes [N] as a function of their displacement [m]. Copies that are tied move as one where
/// forces and masses are those of all of them.
pub fn largest_frequency_of(
    model: &Model,
    base: &[DVec3],
    mass: &[f64],
    forces: &mut dyn FnMut(&[DVec3]) -> Vec<DVec3>,
) -> f64 {
    let at_base = forces(base);
    const ITERATIONS: usize = 60;
    let count = model.mesh.node_count();
    let smallest = model.mesh.smallest_edge();
    // A checkerboard start is close to the highest mode; the perturbation breaks its symmetry.
    let mut mode: Vec<DVec3> = (0..count)
        .map(|n| {
            let parity = match &model.mesh {
                Mesh::Block(block) => block.node_coordinates(n).iter().sum(),
                Mesh::Tets(_) => n,
            };
            let sign = if parity % 2 == 0 { 1.0 } else { -1.0 };
            let ripple = ((n * 2654435761) % 1000) as f64 * 1e-3;
            DVec3::new(sign, sign * (0.5 + 0.3 * ripple), 0.7 * sign - 0.2 * ripple)
        })
        .collect();
    for tie in &model.separation.ties {
        tie.iter().for_each(|n| mode[*n as usize] = mode[tie[0] as usize]);
    }
    let mut omega_squared = 0.0;
    for _ in 0..ITERATIONS {
        for (node, value) in mode.iter_mut().enumerate() {
            let fixed = model.fixed_components(node);
            for a in 0..3 {
                if fixed[a] {
                    value[a] = 0.0;
                }
            }
        }
        let largest = mode.iter().map(|v| v.length()).fold(0.0, f64::max);
        if largest == 0.0 {
            return 0.0;
        }
        let scale = 1e-5 * smallest / largest;
        let u: Vec<DVec3> = base.iter().zip(&mode).map(|(u, v)| *u + *v * scale).collect();
        let force = forces(&u);
        let fall = force.par_iter().zip(&at_base).map(|(f, f0)| *f0 - *f);
        let next: Vec<DVec3> = fall.zip(mass).map(|(f, m)| f / (*m * scale)).collect();
        // Rayleigh quotient with the mass matrix.
        let (mut top, mut bottom) = (0.0, 0.0);
        for ((v, a), m) in mode.iter().zip(&next).zip(mass) {
            top += m * v.dot(*a);
            bottom += m * v.length_squared();
        }
        omega_squared = top / bottom;
        let largest = next.iter().map(|v| v.length()).fold(0.0, f64::max);
        mode = next.into_iter().map(|v| v / largest).collect();
    }
    omega_squared.max(0.0).sqrt()
}
