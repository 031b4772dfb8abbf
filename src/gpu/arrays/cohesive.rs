//! Faces that separate.

use bytemuck::Zeroable;

use super::super::structs::{CohesiveParams, FacePair, PairState};
use super::{Array, bytes_of, read_all, to_bytes, zeros};
use crate::effects::cohesive::TORN_REACH;
use crate::gpu::layout::Layout;
use crate::model::Model;

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("cohesive", |s| bytes_of(&[cohesive_params(s.model)])),
    Array::constant("face_pairs", |s| bytes_of(&face_pairs(s.model, s.layout))),
    Array::state("pair_states", |s| zeros(s.model.separation.pairs.len().max(1) as u64, size_of::<PairState>()))
        .exchanged(
            |bytes, model, state| {
                let count = model.separation.pairs.len();
                state.pairs = read_all::<PairState>(bytes).map(|p| p.damage.into()).take(count).collect();
            },
            |_, state| {
                let pairs = state.pairs.iter().map(|d| PairState { damage: *d as f32, ..Zeroable::zeroed() });
                to_bytes(&pairs.collect::<Vec<_>>())
            },
        ),
];

fn cohesive_params(model: &Model) -> CohesiveParams {
    let Some(law) = model.cohesion else { return CohesiveParams::zeroed() };
    let h = model.scene.tissue.cell_size;
    CohesiveParams {
        onset: (law.strength / law.penalty) as f32,
        shear_onset: (law.shear_strength / law.penalty) as f32,
        energy: (2.0 * law.energy / law.penalty) as f32,
        shear_energy: (2.0 * law.shear_energy / law.penalty) as f32,
        exponent: law.exponent as f32,
        penalty: law.penalty as f32,
        inverse_ramp: (1.0 / h) as f32,
        torn_reach: (TORN_REACH * h) as f32,
        pair_count: model.separation.pairs.len() as u32,
        ..Zeroable::zeroed()
    }
}

fn face_pairs(model: &Model, layout: &Layout) -> Vec<FacePair> {
    // Farther than any path [m].
    const NEVER: f64 = 1e6;
    let Some(block) = model.mesh.as_block() else { return Vec::new() };
    let contact_of = |node: u32| model.contact_nodes.binary_search_by_key(&node, |c| c.node).ok();
    let untouched = model.contact_nodes.iter().position(|c| !c.pushed).unwrap_or(0);
    let mut pairs: Vec<FacePair> = model
        .separation
        .pairs
        .iter()
        .map(|pair| {
            let [a, b] = pair.nodes;
            let slot = |n: u32| {
                let at = block.node_coordinates(n as usize);
                layout.strips().pair_slot(at, block.cells(), pair.axis)
            };
            let way = |[from, to]: [u32; 2], w: f64| {
                let d = block.rest_position(to as usize) - block.rest_position(from as usize);
                [d.x as f32, d.y as f32, d.z as f32, w as f32]
            };
            let [first, second] = pair.ring;
            let touched = contact_of(a).zip(contact_of(b)).filter(|_| pair.tip_driven.is_some());
            let (ca, cb) = touched.unwrap_or((untouched, untouched));
            FacePair {
                nodes: [a, b, slot(a), slot(b)],
                ring: [first[0], first[1], second[0], second[1]],
                first_way_and_area: way(first, pair.area),
                second_way_and_start: way(second, pair.tip_driven.unwrap_or(NEVER)),
                contacts: [ca as u32, cb as u32, 0, 0],
            }
        })
        .collect();
    pairs.resize(pairs.len().max(1), FacePair::zeroed());
    pairs
}
