//! Numbers and memory of effects that are complete by themselves, and what they supply.

use super::super::structs::OwnState;
use super::material::per_material;
use super::{Array, bytes_of, read_all, to_bytes, zeros};
use crate::effects::own::{self, LARGEST_COUNT, LARGEST_NUMBER_COUNT};

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("own_numbers", |s| {
        bytes_of(&per_material(s.model, |material| {
            let mut numbers = [0.0f32; LARGEST_COUNT * LARGEST_NUMBER_COUNT];
            for (places, chosen) in numbers.chunks_exact_mut(LARGEST_NUMBER_COUNT).zip(&material.own) {
                places.iter_mut().zip(&chosen.numbers).for_each(|(place, number)| *place = *number as f32);
            }
            numbers
        }))
    }),
    // One entry per cell and effect, and behind them the sums of the measuring threads: a stage binds few arrays.
    Array {
        add: Some(|bytes, out| {
            for sums in read_all::<OwnState>(bytes) {
                out.sums.energy.own.iter_mut().zip(sums.memory).for_each(|(sum, part)| *sum += f64::from(part));
            }
        }),
        told_from: |s| s.cells() * s.model.effects.own.len() as u64 * size_of::<OwnState>() as u64,
        ..STATES
    },
];

const STATES: Array = Array::state("own_states", |s| {
    zeros(s.cells() * s.model.effects.own.len() as u64 + u64::from(s.grain.measure_threads), size_of::<OwnState>())
})
.exchanged(
    |bytes, model, state| {
        let all: Vec<OwnState> = read_all(bytes).collect();
        for (point, cell) in state.points.iter_mut().zip(all.chunks(model.effects.own.len().max(1))) {
            let entry = |o: &OwnState| own::State { memory: o.memory.map(f64::from), supplied: o.supplied.into() };
            point.own = cell.iter().map(entry).collect();
        }
    },
    |s, state| {
        let count = s.model.effects.own.len();
        let entries = state.points.iter().flat_map(|point| {
            (0..count).map(|place| {
                let own = point.own.get(place).copied().unwrap_or_default();
                OwnState { memory: own.memory.map(|x| x as f32), supplied: own.supplied as f32, ..OwnState::default() }
            })
        });
        to_bytes(&entries.collect::<Vec<_>>())
    },
);
