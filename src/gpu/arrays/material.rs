//! Constants and history of the cells.

use bytemuck::Zeroable;
use glam::{DMat3, DVec3};

use super::super::structs::{
    DamageParams, FibreParams, Material, PlasticState, PointHistory, PronySeries, PronyTerm, ViscousLayout,
    ViscousStress,
};
use super::{Array, Place, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::effects::parameters::ShaderNumbers;
use crate::engine::elements::{Elements, HOURGLASS_MODULUS};
use crate::gpu::layout::Layout;
use crate::material_point::{Material as Constants, PointState};
use crate::model::{LARGEST_MATERIAL_COUNT, Model};

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("materials", |s| bytes_of(&per_material(s.model, |m| material(s.model, m)))),
    Array::constant("cell_material", |s| bytes_of(&cell_materials(s.model, s.layout))).at(Place::Sampled(1)),
    Array::constant("plasticity", |s| {
        bytes_of(&per_material(s.model, |m| m.plasticity.unwrap_or_default().packed()).concat())
    }),
    Array::state("plastic_state", |s| zeros(s.cells(), size_of::<PlasticState>())).exchanged(
        |bytes, _, state| {
            for (point, p) in state.points.iter_mut().zip(read_all::<PlasticState>(bytes)) {
                point.plastic.inverse_flow = DMat3::from_cols(vector(p.x), vector(p.y), vector(p.z));
                point.plastic.alpha = p.x[3].into();
            }
        },
        |_, state| {
            let column = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
            let plastic = state.points.iter().map(|p| {
                let g = p.plastic.inverse_flow;
                PlasticState {
                    x: column(g.x_axis, p.plastic.alpha),
                    y: column(g.y_axis, 0.0),
                    z: column(g.z_axis, 0.0),
                }
            });
            to_bytes(&plastic.collect::<Vec<_>>())
        },
    ),
    Array::constant("fibres", |s| {
        bytes_of(&per_material(s.model, |m| {
            let p = m.fibres.unwrap_or_default();
            FibreParams { direction: vec4(p.direction), k1: p.k1 as f32, k2: p.k2 as f32, ..Zeroable::zeroed() }
        }))
    }),
    Array::constant("prony", |s| bytes_of(&per_material(s.model, |m| prony_series(m, s.dt)))),
    Array::constant("viscous_layout", |s| {
        bytes_of(&[ViscousLayout {
            entries: s.model.prony_term_count() as u32 + 1,
            term_count: s.model.prony_term_count() as u32,
            ..Zeroable::zeroed()
        }])
    }),
    Array::state("viscous_state", |s| {
        bytes_of(&viscous_state(s.model, s.dt, &vec![PointState::default(); s.model.mesh.cell_count()]))
    })
    .exchanged(
        |bytes, model, state| {
            let all: Vec<ViscousStress> = read_all(bytes).collect();
            for (point, cell) in state.points.iter_mut().zip(all.chunks(model.prony_term_count() + 1)) {
                point.viscous = cell[1..].iter().map(symmetric).collect();
            }
        },
        |s, state| to_bytes(&viscous_state(s.model, s.dt, &state.points)),
    ),
    Array::constant("damage", |s| {
        bytes_of(&per_material(s.model, |m| {
            let p = m.damage.unwrap_or_default();
            DamageParams {
                onset: p.onset as f32,
                inverse_displacement: (1.0 / p.failure_displacement) as f32,
                largest: p.largest as f32,
                deletion: if p.deletion { 1.0 } else { 0.0 },
            }
        }))
    }),
    Array::state("point_history", |s| zeros(s.cells(), size_of::<PointHistory>())).exchanged(
        |bytes, _, state| {
            for (point, h) in state.points.iter_mut().zip(read_all::<PointHistory>(bytes)) {
                point.plastic_dissipation = h.flow.into();
                point.damage_dissipation = h.degradation.into();
                point.viscous_work = h.relaxation_work.into();
            }
        },
        |_, state| {
            let history = state
                .points
                .iter()
                .map(|p| PointHistory { relaxation_work: p.viscous_work as f32, ..Zeroable::zeroed() });
            to_bytes(&history.collect::<Vec<_>>())
        },
    ),
];

/// Index of the material of every cell. Where cells are empty, 256 is added where open sides of the tissue meet, and behind the cells stand
/// the strips that hold tissue.
fn cell_materials(model: &Model, layout: &Layout) -> Vec<u32> {
    let mut words: Vec<u32> = model.cell_material.iter().map(|m| u32::from(*m)).collect();
    if model.mesh.as_block().is_some_and(|block| !block.empty.is_empty()) {
        let elements = Elements::new(model);
        for (cell, word) in words.iter_mut().enumerate() {
            *word += if elements.is_on_edge(model, cell) { 256 } else { 0 };
        }
        words.extend(layout.strips().busy());
    }
    words
}

/// One entry per material of a model; the rest of the 256 repeats the first.
pub(super) fn per_material<T: Clone>(model: &Model, entry: impl Fn(&Constants) -> T) -> Vec<T> {
    let mut entries: Vec<T> = model.materials.iter().map(&entry).collect();
    entries.resize(LARGEST_MATERIAL_COUNT, entries[0].clone());
    entries
}

fn material(model: &Model, m: &Constants) -> Material {
    let law = &m.law;
    Material {
        constants: law.isochoric.values().map(|constant| constant as f32),
        bulk_modulus: law.bulk_modulus as f32,
        shear_modulus: law.shear_modulus() as f32,
        hourglass: (model.scene.solver.hourglass_stiffness * HOURGLASS_MODULUS * law.shear_modulus()) as f32,
        law: law.isochoric.word() as u32,
    }
}

fn prony_series(m: &Constants, dt: f64) -> PronySeries {
    let mut series = PronySeries::zeroed();
    let terms = m.viscoelastic.as_ref().map_or(&[][..], |v| &v.terms);
    for (out, term) in series.terms.iter_mut().zip(terms) {
        *out = PronyTerm {
            ratio: term.ratio as f32,
            decay: term.decay(dt) as f32,
            compliance: (1.0 / (4.0 * m.law.shear_modulus() * term.ratio.max(1e-12))) as f32,
            _pad: 0.0,
        };
    }
    series
}

/// Per cell the sum of the terms and the terms.
fn viscous_state(model: &Model, dt: f64, points: &[PointState]) -> Vec<ViscousStress> {
    let count = model.prony_term_count();
    // Binary logarithms of the intervals, one byte each; a term that a material lacks never changes.
    let intervals: Vec<[u32; 2]> = model
        .materials
        .iter()
        .map(|m| {
            let mut bytes = [0u8; 8];
            for (byte, term) in bytes.iter_mut().zip(m.viscoelastic.iter().flat_map(|v| &v.terms)) {
                *byte = term.interval(dt).ilog2() as u8;
            }
            [0, 4].map(|i| u32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]))
        })
        .collect();
    let bits = |x: f64, y: f64, z: f64, w: u32| [(x as f32).to_bits(), (y as f32).to_bits(), (z as f32).to_bits(), w];
    let entries = |q: DMat3, [first, last]: [u32; 2]| ViscousStress {
        normal: bits(q.x_axis.x, q.y_axis.y, q.z_axis.z, first),
        shear: bits(q.y_axis.x, q.z_axis.y, q.x_axis.z, last),
    };
    let mut state = Vec::with_capacity(points.len() * (count + 1));
    for (cell, point) in points.iter().enumerate() {
        let intervals = intervals[model.material_index(cell)];
        let q = |i: usize| point.viscous.get(i).copied().unwrap_or(DMat3::ZERO);
        state.push(entries((0..count).map(q).fold(DMat3::ZERO, |sum, q| sum + q), intervals));
        state.extend((0..count).map(q).map(|q| entries(q, intervals)));
    }
    state
}

/// The tensor of an entry.
fn symmetric(q: &ViscousStress) -> DMat3 {
    let number = |bits: u32| f64::from(f32::from_bits(bits));
    let ([xx, yy, zz, _], [xy, yz, zx, _]) = (q.normal.map(number), q.shear.map(number));
    DMat3::from_cols(DVec3::new(xx, xy, zx), DVec3::new(xy, yy, yz), DVec3::new(zx, yz, zz))
}
