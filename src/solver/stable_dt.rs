//! The stable time step, computed before the run.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::elements::{CellStates, Elements};
use crate::material_point::PointState;
use crate::mesh::Mesh;
use crate::model::Model;

/// Wave-speed bound of the undamped central difference at rest [s]: `2 sqrt(m / k)` with the Gershgorin bound `k` of
/// the nodal stiffness, a lower bound of the stable step.
///
/// A run takes this one times the safety factor. The true limit at rest ([`power_iteration`]) is about 1.8 times
/// larger, but squeezed cells and contact use that margin up: with 0.8 of it the default scene clamps thousands of
/// nodes and creates a third of the work as energy (measured), with 0.8 of this bound none.
pub fn wave_speed_bound(model: &Model) -> f64 {
    let elements = Elements::new(model);
    let mut bound = vec![0.0; model.mesh.node_count()];
    for cell in 0..model.mesh.cell_count() {
        let tangent = model.material(cell).tangent_bound(DMat3::ZERO, &PointState::default());
        let k = elements.stiffness_bound(model, cell, DMat3::IDENTITY, tangent, 0.0);
        for (node, k) in model.mesh.cell_nodes(cell).iter().zip(k) {
            bound[*node] += k;
        }
    }
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
    let steps = bound.iter().zip(&mass).map(|(k, m)| 2.0 * (m / k).sqrt());
    steps.fold(f64::INFINITY, f64::min)
}

/// Limit of the undamped central difference at rest [s], `2 / omega_max` with the largest eigenfrequency of the
/// linearised block by power iteration on M^-1 K. Converges from above.
pub fn power_iteration(model: &Model) -> f64 {
    let elements = Elements::new(model);
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
            return f64::INFINITY;
        }
        let scale = 1e-5 * smallest / largest;
        let u: Vec<DVec3> = mode.iter().map(|v| *v * scale).collect();
        let force = elements.internal_forces(model, &u, CellStates::default());
        let next: Vec<DVec3> = force.par_iter().zip(&model.node_mass).map(|(f, m)| *f / (*m * scale)).collect();
        // Rayleigh quotient with the mass matrix.
        let (mut top, mut bottom) = (0.0, 0.0);
        for ((v, a), m) in mode.iter().zip(&next).zip(&model.node_mass) {
            top += m * v.dot(*a);
            bottom += m * v.length_squared();
        }
        omega_squared = top / bottom;
        let largest = next.iter().map(|v| v.length()).fold(0.0, f64::max);
        mode = next.into_iter().map(|v| v / largest).collect();
    }
    2.0 / omega_squared.sqrt()
}
