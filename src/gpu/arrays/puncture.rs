//! The needle's way through the tissue, planned or found.

use bytemuck::Zeroable;
use glam::DVec3;

use super::super::structs::{
    FreeCell, FreeTip, LinePiece, PathCell, PunctureParams, TipAnchor, TipAnchorLoad, TipState,
};
use super::{Array, Life, Place, bytes_of, read_all, to_bytes, vec4, vector, zeros};
use crate::effects::adhesion::Bond;
use crate::engine::State;
use crate::mesh::{Mesh, TetLine};
use crate::model::{FreePlan, LARGEST_ANCHOR_COUNT, LARGEST_SEGMENT_COUNT, Model};
use crate::needle::free_path as needle;
use crate::needle::tip_contact::Touch;

pub(super) const ARRAYS: &[Array] = &[
    Array::constant("puncture", |s| bytes_of(&[puncture_params(s.model)])),
    Array::constant("tip_anchors", |s| bytes_of(&tip_anchors(s.model))).at(Place::Sampled(4)),
    Array::constant("line_pieces", |s| bytes_of(&line_pieces(s.model))).at(Place::Sampled(4)),
    Array::new("path_cells", Life::Told, |s| bytes_of(&path_cells(s.model))),
    Array::state("cell_stiffness", |s| bytes_of(&vec![1.0f32; s.model.mesh.cell_count()])).at(Place::Texels).exchanged(
        |bytes, _, state| state.stiffness = read_all::<f32>(bytes).map(f64::from).collect(),
        |_, state| to_bytes(&state.stiffness.iter().map(|s| *s as f32).collect::<Vec<_>>()),
    ),
    Array::state("tip_state", |_| zeros(1, size_of::<TipState>())).at(Place::Uniform(None)).exchanged(
        |bytes, _, state| {
            for tip in read_all::<TipState>(bytes) {
                state.tip_coordinate = tip.coordinate.into();
                state.bond = Bond { stretch: tip.bond_stretch.into(), slid: tip.bond_slid.into(), gap: tip.gap.into() };
                state.touch = Touch {
                    force: tip.touch_force.into(),
                    dimple: tip.dimple.into(),
                    stretch: tip.touch_stretch.into(),
                };
            }
        },
        |_, state| {
            to_bytes(&[TipState {
                coordinate: state.tip_coordinate as f32,
                bond_stretch: state.bond.stretch as f32,
                bond_slid: state.bond.slid as f32,
                gap: state.bond.gap as f32,
                dimple: state.touch.dimple as f32,
                touch_force: state.touch.force as f32,
                touch_stretch: state.touch.stretch as f32,
                ..TipState::zeroed()
            }])
        },
    ),
    Array::state("tip_anchor_loads", |_| zeros(LARGEST_ANCHOR_COUNT as u64, size_of::<TipAnchorLoad>()))
        .at(Place::Uniform(Some("ANCHOR_COUNT"))),
    Array::state("free_tip", |s| bytes_of(&[free_tip(&s.model.free_tip())]))
        .exchanged(read_free_tip, |_, state| to_bytes(&[free_tip(&state.tip)])),
    Array::state("free_cells", |s| bytes_of(&free_cells(s.model, &[]))).exchanged(
        |bytes, _, state| {
            let marked = |c: FreeCell| u64::from(c.marked_low) | u64::from(c.marked_high) << 32;
            state.cut_samples = read_all::<FreeCell>(bytes).map(marked).collect();
        },
        |s, state| to_bytes(&free_cells(s.model, &state.cut_samples)),
    ),
];

fn tip_anchors(model: &Model) -> Vec<TipAnchor> {
    let Some(plan) = &model.puncture else { return Vec::new() };
    if let Mesh::Block(block) = &model.mesh {
        let anchor = |a: &crate::model::TipAnchor| {
            let ([i, j, _], local) = block.locate(a.surface);
            TipAnchor { surface: vec4(a.surface), column: [i as u32, j as u32, 0, 0], local: vec4(local) }
        };
        return plan.anchors.iter().map(anchor).collect();
    }
    let mut first = 0;
    let anchor = |(anchor, line): (&crate::model::TipAnchor, &TetLine)| {
        let column = [first, first + line.pieces.len() as u32, 0, 0];
        first = column[1];
        TipAnchor { surface: vec4(anchor.surface), column, ..TipAnchor::zeroed() }
    };
    plan.anchors.iter().zip(&plan.lines).map(anchor).collect()
}

/// Pieces of the lines of the anchors in tetrahedra, one line after the other.
fn line_pieces(model: &Model) -> Vec<LinePiece> {
    let lines = model.puncture.as_ref().map_or(&[][..], |plan| &plan.lines);
    let of_line = |line: &TetLine| {
        let ends = line.pieces.iter().skip(1).map(|next| next.start).chain([line.end]).collect::<Vec<_>>();
        let piece = |(p, end): (&crate::mesh::tet_line::LinePiece, f64)| LinePiece {
            nodes: p.nodes,
            weights: p.weights.map(|w| w as f32),
            slopes: p.slopes.map(|s| s as f32),
            range: [p.start as f32, end as f32, 0.0, 0.0],
        };
        line.pieces.iter().zip(ends).map(piece).collect::<Vec<_>>()
    };
    let mut pieces: Vec<LinePiece> = lines.iter().flat_map(of_line).collect();
    pieces.resize(pieces.len().max(1), LinePiece::zeroed());
    pieces
}

fn path_cells(model: &Model) -> Vec<PathCell> {
    let mut cells: Vec<PathCell> = model
        .puncture
        .as_ref()
        .map_or(&[][..], |p| &p.cells)
        .iter()
        .map(|c| PathCell {
            cell: c.cell,
            left: c.left as f32,
            axial_start: c.axial_start as f32,
            axial_end: c.axial_end as f32,
            material: model.material_index(c.cell as usize) as u32,
            ..PathCell::zeroed()
        })
        .collect();
    cells.resize(cells.len().max(1), PathCell::zeroed());
    cells
}

fn read_free_tip(bytes: &[u8], _: &Model, state: &mut State) {
    for t in read_all::<FreeTip>(bytes) {
        state.tip_coordinate = t.coordinate.into();
        state.tip = needle::FreeTip {
            place: vector(t.place),
            along: vector(t.along),
            across: vector(t.across),
            coordinate: t.coordinate.into(),
            entry: t.entry.into(),
            advance: t.advance.into(),
            material: t.material as usize,
            inside: t.inside != 0.0,
        };
    }
}

/// Cells of the box of a free path; 1 without one.
pub fn free_cell_count(model: &Model) -> u32 {
    free_plan(model).map_or(1, |f| f.cell_count() as u32)
}

fn puncture_params(model: &Model) -> PunctureParams {
    model.puncture.as_ref().map_or(PunctureParams::zeroed(), |plan| {
        let p = plan.params;
        // s0 depends on z alone, and an anchor acts on the two node planes around it.
        let mut segments = [[0.0; 4]; LARGEST_SEGMENT_COUNT];
        let mut membranes = 0;
        let last = plan.segments.len() - 1;
        for (i, out) in segments.iter_mut().enumerate() {
            let s = plan.segments[i.min(last)];
            let c = s.cutting;
            *out = [s.start, c.puncture_force, c.cutting_force, s.transition_length].map(|x| x as f32);
            membranes |= u32::from(s.membrane) << i;
        }
        let mut anchor_reach = match &model.mesh {
            Mesh::Block(block) => {
                // An anchor acts on the corners of its cell.
                let edges = |a: usize| block.lines[a].windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
                let largest = plan.path.length_of(DVec3::new(edges(0), edges(1), edges(2)));
                1.001 * (largest + plan.path.front_of(&plan.anchors))
            }
            Mesh::Tets(mesh) => 1.001 * plan.anchor_reach(mesh),
        };
        let (mut free_low, mut free_count, mut path_cell_count) = ([0; 4], [0; 4], plan.cells.len());
        if let Some(free) = &plan.free {
            let mesh = model.mesh.block();
            let diagonal = |index: usize| {
                let [i, j, k] = free.cell(index);
                mesh.cell_size(mesh.cell_index(i, j, k)).length()
            };
            // An anchor acts on the corners of its cell.
            anchor_reach = 1.001 * (plan.needle.radius + (0..free.cell_count()).map(diagonal).fold(0.0, f64::max));
            for (out, value) in free_low.iter_mut().zip(free.skin.low).chain(free_count.iter_mut().zip(free.skin.count))
            {
                *out = value as u32;
            }
            for (out, i) in segments.iter_mut().zip(0..) {
                let c = free.cuttings.get(i).unwrap_or(&free.cuttings[0]);
                *out = [0.0, c.puncture_force, c.cutting_force, p.transition_length].map(|x| x as f32);
            }
            path_cell_count = free.cell_count();
        }
        PunctureParams {
            exit: plan.exit as f32,
            tip_stiffness: p.tip_stiffness as f32,
            residual_stiffness: p.residual_stiffness as f32,
            contact_stiffness: plan.contact_stiffness as f32,
            contact_damping: p.contact_damping as f32,
            entry_fade: p.entry_fade as f32,
            needle_radius: plan.needle.radius as f32,
            tip_length: plan.needle.tip_length as f32,
            anchor_reach: anchor_reach as f32,
            path_cell_count: path_cell_count as u32,
            softened_radius: p.softened_radius as f32,
            ring_radius: p.ring_radius as f32,
            membranes,
            rate_exponent: p.rate_exponent as f32,
            reference_speed: p.reference_speed as f32,
            transition_length: p.transition_length as f32,
            shift: vec4(plan.profile.shift),
            edge_radius: plan.profile.bore.map_or(0.0, |b| b.edge as f32),
            bore_radius: plan.profile.bore.map_or(0.0, |b| b.radius as f32),
            bore_grip: plan.needle.bore.map_or(0.0, |b| b.friction as f32),
            face_stiffness: plan.face_stiffness() as f32,
            face_damping: plan.face_damping as f32,
            ring_stiffness: plan.ring_stiffness_per_volume as f32,
            reference: vec4(plan.reference),
            free_low,
            free_count,
            segments,
            ..Zeroable::zeroed()
        }
    })
}

fn free_plan(model: &Model) -> Option<&FreePlan> {
    model.puncture.as_ref().and_then(|p| p.free.as_ref())
}

fn free_tip(tip: &needle::FreeTip) -> FreeTip {
    FreeTip {
        place: vec4(tip.place),
        along: vec4(tip.along),
        across: vec4(tip.across),
        coordinate: tip.coordinate as f32,
        entry: tip.entry as f32,
        advance: tip.advance as f32,
        inside: if tip.inside { 1.0 } else { 0.0 },
        material: tip.material as u32,
        ..Zeroable::zeroed()
    }
}

/// The cells of the box of a free path with their marked samples; without any where `samples` is empty.
fn free_cells(model: &Model, samples: &[u64]) -> Vec<FreeCell> {
    let (Some(free), Some(mesh)) = (free_plan(model), model.mesh.as_block()) else { return Vec::new() };
    (0..free.cell_count())
        .map(|index| {
            let [i, j, k] = free.cell(index);
            let cell = mesh.cell_index(i, j, k);
            let marked = samples.get(index).copied().unwrap_or(0);
            let heights = free.skin.corner_heights([i - free.skin.low[0], j - free.skin.low[1]]).map(|h| h as f32);
            let with = |v: DVec3, w: f32| [v.x as f32, v.y as f32, v.z as f32, w];
            FreeCell {
                low: with(DVec3::new(mesh.lines[0][i], mesh.lines[1][j], mesh.lines[2][k]), heights[0]),
                size: with(mesh.cell_size(cell), heights[1]),
                height_01: heights[2],
                height_11: heights[3],
                tissue: u32::from(free.tissues[index]),
                cell: cell as u32,
                material: model.material_index(cell) as u32,
                marked_low: marked as u32,
                marked_high: (marked >> 32) as u32,
                ..Zeroable::zeroed()
            }
        })
        .collect()
}
