//! The state of a run in the terms of another model on the same mesh.

use crate::cpu::CpuEngine;
use crate::engine::{ContactState, State};
use crate::material_point::PointState;
use crate::model::Model;

/// The state of a model in the terms of another one on the same mesh.
pub(super) fn carried(state: &State, from: &Model, to: &Model) -> State {
    let mut next = CpuEngine::new_state(to);
    next.displacement = state.displacement.clone();
    next.velocity = state.velocity.clone();
    next.inertia = state.inertia.clone();
    (next.tip_coordinate, next.tip, next.bond) = (state.tip_coordinate, state.tip, state.bond);
    let fitting = |old: &Vec<f64>, new: &mut Vec<f64>| {
        if old.len() == new.len() {
            new.clone_from(old);
        }
    };
    fitting(&state.stiffness, &mut next.stiffness);
    fitting(&state.pairs, &mut next.pairs);
    if from.laid.as_ref().map(|laid| &laid.line) == to.laid.as_ref().map(|laid| &laid.line) {
        on_the_same_path(state, &mut next);
    }
    if state.cut_samples.len() == next.cut_samples.len() {
        next.cut_samples.clone_from(&state.cut_samples);
    }
    // Contact is remembered by node; a node that is new in the ring begins anew. A node may have several surfaces.
    let place = |model: &Model, n: usize| (model.contact_nodes[n].node, discriminant(model, n));
    let known: std::collections::HashMap<_, ContactState> =
        state.contact.iter().enumerate().map(|(n, memory)| (place(from, n), *memory)).collect();
    for (n, memory) in next.contact.iter_mut().enumerate() {
        if let Some(old) = known.get(&place(to, n)) {
            *memory = *old;
        }
    }
    let terms = to.prony_term_count();
    for (new, old) in next.points.iter_mut().zip(&state.points) {
        *new = PointState { ..old.clone() };
        if to.effects.viscoelastic.is_none() || new.viscous.len() != terms {
            new.viscous.clear();
        }
    }
    next
}

/// What the scheme `opening` remembers of a path, as far as the other one begins alike.
pub(super) fn on_the_same_path(state: &State, next: &mut State) {
    for (new, old) in next.stations.iter_mut().zip(&state.stations) {
        *new = *old;
    }
    for (new, old) in next.relaxation.iter_mut().zip(&state.relaxation) {
        *new = *old;
    }
    (next.opening_resistance, next.opening_spreading) = (state.opening_resistance, state.opening_spreading);
    next.opening_stiffness = state.opening_stiffness;
    next.touch = state.touch;
}

/// Which of its surfaces a contact node stands for.
fn discriminant(model: &Model, n: usize) -> std::mem::Discriminant<crate::model::ContactSurface> {
    std::mem::discriminant(&model.contact_nodes[n].surface)
}
