//! A structured block in lanes: cells side by side along x are one vector.
//!
//! Displacements stay f64. Each is split in two f32, `u = high + low`: high is a multiple of 2^-20 m and low of 2^-44 m, so that
//! differences of neighbours are exact, as they are in the fixed point of the GPU engine; and none is so small that its square is denormal, which costs
//! a processor a hundred times the time. What a row of cells does to its four lines of nodes is added up along the row;
//! a second pass adds the four rows around every line.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::nodes::{Moved, NODE, NodeLines};
use super::number::{HalfWide, half_wide};
use super::opening::{Carrier, LaneOpening, OpeningInLanes};
use super::points::Points;
use super::rows::{CellRows, gather_plane};
use super::shapes::BentColumns;
use super::{LaneMaterial, WIDEST, materials_of, threads_for};
use crate::cpu::integrate_nodes::{NodeStep, NodeSums};
use crate::cpu::team::Team;
use crate::engine::elements::{CellMeasure, CellStates, Elements};
use crate::material::regular::Exponential;
use crate::material::stretches::Powers;
use crate::material_point::PointState;
use crate::mesh::BlockMesh;
use crate::model::Model;

/// f32 per line of nodes in [`LaneBlock::places`]: high and low part of every axis.
pub(super) const PLACE: usize = 6;
/// f32 per row of cells in [`LaneBlock::lines`]: force of every axis on four lines of nodes, and the bound of all.
pub(super) const LINES: usize = 13;
/// Layers of cells that a part keeps: its first and its last, between which planes of nodes are added up with their neighbours, and one more.
const KEPT: usize = 3;

/// Which of the kept layers the layer `k` of a part is in, until the second after it comes.
fn kept(k: usize) -> usize {
    if k == 0 { 0 } else { 1 + (k - 1) % 2 }
}

/// f32 per row of cells in [`Grid::mixed`]: c1, c2, c3, c01, bulk modulus, hourglass modulus, 1 where a cell holds tissue, mu and b of an
/// exponential, mu and alpha of powers of the stretches.
pub(super) const MIXED: usize = 11;
/// What varies along x: an entry per cell, zeros behind the last and for gaps.
#[derive(Debug, Default)]
pub(super) struct EdgesX {
    /// [m], 1/(4 d) [1/m], d^(1/3), d^(-2/3).
    pub length: Vec<f32>,
    pub quarter: Vec<f32>,
    pub cube_root: Vec<f32>,
    pub inverse_square: Vec<f32>,
}

/// The same of one cell along y or z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    pub length: f32,
    pub quarter: f32,
    pub cube_root: f32,
    pub inverse_square: f32,
}

impl Edge {
    fn new(length: f64) -> Self {
        let exact = |x: f64| if length > 0.0 { x as f32 } else { 0.0 };
        Edge {
            length: length as f32,
            quarter: exact(0.25 / length),
            cube_root: length.cbrt() as f32,
            inverse_square: exact(length.powf(-2.0 / 3.0)),
        }
    }
}

/// What does not change.
pub(super) struct Grid {
    pub arch: Arch,
    /// Vectors half as wide as the widest.
    pub half: Option<HalfWide>,
    pub cells: [usize; 3],
    /// f32 of a row.
    pub stride: usize,
    pub x: EdgesX,
    pub y: Vec<Edge>,
    pub z: Vec<Edge>,
    /// Columns between bent lines; `None`: all lines are straight.
    pub bent: Option<BentColumns>,
    pub materials: Vec<LaneMaterial>,
    /// Constants of every cell, in rows of `stride`; empty where there is one material only.
    pub mixed: Vec<f32>,
    /// True where no material has c2 or c3, and where one has c01.
    pub is_linear: bool,
    pub has_c01: bool,
    /// True where one is an exponential, and where one has powers of the stretches.
    pub has_exponential: bool,
    pub has_powers: bool,
    pub quartic: f64,
    /// 1 for cells where open faces meet, in rows of `stride`; empty: none.
    pub on_edge: Vec<f32>,
}

/// A block in lanes.
pub struct LaneBlock {
    grid: Grid,
    team: Team,
    places: Vec<f32>,
    lines: Vec<f32>,
    nodes: NodeLines,
    opening: Option<Box<LaneOpening>>,
    /// Material points that do more than the elastic law, and what they remember, in rows.
    points: Option<Points>,
    histories: Vec<f32>,
}

impl LaneBlock {
    pub fn new(model: &Model, block: &BlockMesh, elements: &Elements) -> Result<Self, String> {
        let materials = materials_of(model, elements)?;
        let cells = block.cells();
        let [nx, ny, nz] = cells;
        let stride = (nx + 1 + WIDEST).next_multiple_of(WIDEST);
        let edges =
            |axis: usize| -> Vec<Edge> { block.lines[axis].windows(2).map(|w| Edge::new(w[1] - w[0])).collect() };
        let along_x = |value: fn(&Edge) -> f32| {
            let mut values: Vec<f32> = edges(0).iter().map(value).collect();
            values.resize(stride, 0.0);
            values
        };
        let mut on_edge = vec![0.0; ny * nz * stride];
        for cell in (0..block.cell_count()).filter(|c| elements.is_on_edge(model, *c)) {
            let [i, j, k] = block.cell_coordinates(cell);
            on_edge[(k * ny + j) * stride + i] = 1.0;
        }
        if on_edge.iter().all(|e| *e == 0.0) {
            on_edge.clear();
        }
        let mixed = mixed_rows(model, block, &materials, stride);
        let lines = (ny + 1) * (nz + 1) * stride;
        let nodes = NodeLines::new(model, nx + 1, stride);
        let team = Team::new(threads_for(block.cell_count()));
        let part = team.part(nz);
        let first_number = |node| nodes.first_number(node);
        let opening = |plan| Box::new(LaneOpening::new(model, block, plan, &materials, first_number));
        let points = Points::new(&model.materials, stride);
        Ok(LaneBlock {
            histories: vec![0.0; points.as_ref().map_or(0, Points::row_length) * ny * nz],
            points,
            opening: model.opening().map(opening),
            grid: Grid {
                arch: Arch::new(),
                half: half_wide(),
                cells,
                stride,
                x: EdgesX {
                    length: along_x(|e| e.length),
                    quarter: along_x(|e| e.quarter),
                    cube_root: along_x(|e| e.cube_root),
                    inverse_square: along_x(|e| e.inverse_square),
                },
                y: edges(1),
                z: edges(2),
                bent: BentColumns::new(block, stride),
                is_linear: materials.iter().all(|m| m.law.is_linear()),
                has_c01: materials.iter().any(|m| m.law.c01 != 0.0),
                has_exponential: materials.iter().any(|m| m.exponential.is_some()),
                has_powers: materials.iter().any(|m| m.powers.is_some()),
                mixed,
                materials,
                quartic: elements.quartic(),
                on_edge,
            },
            places: vec![0.0; lines * PLACE],
            lines: vec![0.0; nz.div_ceil(part) * KEPT.min(part) * ny * LINES * stride],
            team,
            nodes,
        })
    }

    /// The threads that its stages share.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// What carries tissue beside an opened path.
    pub fn opening(&mut self) -> Option<OpeningInLanes<'_>> {
        let LaneBlock { opening, team, nodes, .. } = self;
        opening.as_mut().map(|opening| OpeningInLanes {
            opening: Carrier::Block(opening),
            team,
            stride: nodes.stride(),
            numbers: &mut nodes.numbers,
        })
    }

    /// Numbers of the nodes.
    pub(super) fn nodes(&self) -> &NodeLines {
        &self.nodes
    }

    /// The same, to be changed.
    pub(super) fn nodes_mut(&mut self) -> &mut NodeLines {
        &mut self.nodes
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        4 * (self.places.len() + self.lines.len() + self.grid.on_edge.len() + self.grid.mixed.len())
            + self.grid.bent.as_ref().map_or(0, BentColumns::bytes)
            + self.nodes.bytes()
            + 4 * self.histories.len()
            + self.opening.as_ref().map_or(0, |opening| opening.bytes())
    }

    /// Forces and bounds of all cells at the nodes, for this displacement and the stiffness that a path left (empty: all of it). `advance`:
    /// step [s] and number of the step that histories are brought forward to.
    pub fn compute(
        &mut self,
        model: &Model,
        elements: &Elements,
        displacement: &[DVec3],
        stiffness: &[f64],
        advance: Option<(f64, u64)>,
    ) {
        let LaneBlock { grid, team, places, lines, nodes, points, histories, .. } = self;
        let (stride, [_, ny, nz]) = (grid.stride, grid.cells);
        let stiffness = left_by_a_path(stiffness);
        if let Some(points) = points {
            points.prepare(&model.materials, advance);
        }
        let points = points.as_ref();
        let rows = CellRows { grid, places, model, elements, displacement, stiffness, points, advance };
        let (layer, plane) = (ny * LINES * stride, (ny + 1) * NODE * stride);
        // Planes between two layers of a part are added up while both are in the cache.
        let part = team.part(nz);
        let work = |i: usize, ((lines, nodes), histories): ((&mut [f32], &mut [f32]), &mut [f32])| {
            let length = histories.len() / part.min(nz - i * part);
            for k in 0..part.min(nz - i * part) {
                let histories = &mut histories[k * length..(k + 1) * length];
                rows.compute((i * part + k) * ny, &mut lines[kept(k) * layer..][..layer], histories);
                if k > 0 {
                    let [below, above] = [k - 1, k].map(|k| Some(&lines[kept(k) * layer..][..layer]));
                    gather_plane(grid, below, above, &mut nodes[k * plane..(k + 1) * plane]);
                }
            }
        };
        let parts = lines.chunks_mut(KEPT.min(part) * layer).zip(nodes.numbers.chunks_mut(part * plane));
        match points.map_or(0, Points::row_length) {
            0 => team.map(parts.map(|part| (part, &mut [][..])), work),
            length => team.map(parts.zip(histories.chunks_mut(part * ny * length)), work),
        };
        // Those between two parts, and the outermost.
        let lines = lines.as_slice();
        let kept_of = |k: usize| &lines[((k / part) * KEPT.min(part) + kept(k % part)) * layer..][..layer];
        let between = nodes.numbers.chunks_mut(plane).enumerate().filter(|(k, _)| k % part == 0 || *k == nz);
        team.map(between, |_, (k, nodes)| {
            let below = k.checked_sub(1).map(kept_of);
            gather_plane(grid, below, (k < nz).then(|| kept_of(k)), nodes);
        });
    }

    /// Takes in what the points remember.
    pub fn take_points(&mut self, states: &[PointState]) {
        let LaneBlock { grid, team, points, histories, .. } = self;
        if let Some((points, length)) = remembering(points) {
            let rows = histories.chunks_mut(length).zip(states.chunks(grid.cells[0]));
            team.map(rows, |_, (row, states)| points.take(states, row));
        }
    }

    /// Gives the points what they have become and booked since; how many returns failed.
    pub fn give_points(&mut self, states: &mut [PointState]) -> u32 {
        let LaneBlock { grid, team, points, histories, .. } = self;
        let Some((points, length)) = remembering(points) else { return 0 };
        let rows = histories.chunks_mut(length).zip(states.chunks_mut(grid.cells[0]));
        team.map(rows, |_, (row, states)| points.give(row, states)).into_iter().sum()
    }

    /// Energies and Jacobians of all cells, whose points have given the states what they have become.
    pub fn measure(
        &mut self,
        model: &Model,
        elements: &Elements,
        displacement: &[DVec3],
        states: CellStates,
    ) -> Vec<CellMeasure> {
        let LaneBlock { grid, team, places, points, histories, .. } = self;
        let [nx, ny, nz] = grid.cells;
        let (stiffness, points) = (left_by_a_path(states.stiffness), points.as_ref());
        let rows = CellRows { grid, places, model, elements, displacement, stiffness, points, advance: None };
        let part = team.part(ny * nz);
        let mut measures = vec![CellMeasure::default(); nx * ny * nz];
        let work = |i: usize, (measures, histories): (&mut [CellMeasure], &mut [f32])| {
            rows.measure(i * part, measures, histories, states.points);
        };
        let measured = measures.chunks_mut(part * nx);
        match points.map_or(0, Points::row_length) {
            0 => team.map(measured.map(|measures| (measures, &mut [][..])), work),
            length => team.map(measured.zip(histories.chunks_mut(part * length)), work),
        };
        measures
    }

    /// Takes in a displacement that the last step did not make.
    pub fn take(&mut self, displacement: &[DVec3]) {
        let (stride, width) = (self.grid.stride, self.grid.cells[0] + 1);
        for (places, u) in self.places.chunks_exact_mut(PLACE * stride).zip(displacement.chunks(width)) {
            set_places(self.grid.arch, stride, places, u);
        }
    }

    /// Moves all nodes.
    pub fn integrate(&mut self, step: &NodeStep, moved: Moved) -> Vec<NodeSums> {
        let stride = self.grid.stride;
        let places = self.places.chunks_exact_mut(PLACE * stride);
        let arch = self.grid.arch;
        let keep = |places: &mut [f32], u: &[DVec3]| set_places(arch, stride, places, u);
        self.nodes.integrate(arch, &self.team, step, moved, (places.collect(), keep))
    }
}

/// Points that remember something, and f32 of a row of them.
fn remembering(points: &Option<Points>) -> Option<(&Points, usize)> {
    let points = points.as_ref()?;
    Some((points, points.row_length())).filter(|(_, length)| *length > 0)
}

/// The stiffness that a path left of every cell; empty where it left all of it.
fn left_by_a_path(stiffness: &[f64]) -> &[f64] {
    // Without a branch per cell, which would be as long as a stage.
    let any = |part: &[f64]| part.iter().fold(false, |any, s| any | (*s != 1.0));
    if stiffness.chunks(512).any(any) { stiffness } else { &[] }
}

/// Constants of every cell, row by row.
fn mixed_rows(model: &Model, block: &BlockMesh, materials: &[LaneMaterial], stride: usize) -> Vec<f32> {
    if model.cell_material.is_empty() {
        return Vec::new();
    }
    let [nx, ny, nz] = block.cells();
    let mut mixed = vec![0.0; ny * nz * MIXED * stride];
    for (row, values) in mixed.chunks_exact_mut(MIXED * stride).enumerate() {
        // Nothing is divided by an exponent of zero, behind the last cell and where another law is.
        values[(MIXED - 1) * stride..].fill(2.0);
        values[(MIXED - 3) * stride..(MIXED - 2) * stride].fill(1.0);
        for i in 0..nx {
            let cell = row * nx + i;
            let m = &materials[model.material_index(cell)];
            let holds = if block.is_empty(cell) { 0.0 } else { 1.0 };
            let of_law = [m.law.c1, m.law.c2, m.law.c3, m.law.c01, m.bulk_modulus, m.hourglass, holds];
            let Exponential { mu, b } = m.exponential.unwrap_or(Exponential { mu: 0.0, b: 1.0 });
            let powers = m.powers.unwrap_or(Powers { mu: 0.0, alpha: 2.0 });
            let others = [mu, b, powers.mu, powers.alpha];
            for (number, value) in of_law.into_iter().chain(others).enumerate() {
                values[number * stride + i] = value as f32;
            }
        }
    }
    mixed
}

/// Keeps the displacement of a line of nodes as `u = high + low`.
fn set_places(arch: Arch, stride: usize, places: &mut [f32], displacement: &[DVec3]) {
    arch.dispatch(SetPlaces { stride, places, displacement });
}

struct SetPlaces<'a> {
    stride: usize,
    places: &'a mut [f32],
    displacement: &'a [DVec3],
}

impl WithSimd for SetPlaces<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        // Adding what has digits of 2^-20 m, and of 2^-44 m, rounds to them.
        const ROUNDED: f32 = 12.0;
        const FINE: f32 = 1.5 / (1 << 21) as f32;
        let SetPlaces { stride, places, displacement } = self;
        let count = displacement.len();
        let (x, rest) = places.split_at_mut(2 * stride);
        let (y, z) = rest.split_at_mut(2 * stride);
        let ((hx, lx), (hy, ly), (hz, lz)) = (x.split_at_mut(stride), y.split_at_mut(stride), z.split_at_mut(stride));
        let (hx, hy, hz) = (&mut hx[..count], &mut hy[..count], &mut hz[..count]);
        let (lx, ly, lz) = (&mut lx[..count], &mut ly[..count], &mut lz[..count]);
        for i in 0..count {
            let u = displacement[i];
            hx[i] = (u.x as f32 + ROUNDED) - ROUNDED;
            hy[i] = (u.y as f32 + ROUNDED) - ROUNDED;
            hz[i] = (u.z as f32 + ROUNDED) - ROUNDED;
            lx[i] = ((u.x - f64::from(hx[i])) as f32 + FINE) - FINE;
            ly[i] = ((u.y - f64::from(hy[i])) as f32 + FINE) - FINE;
            lz[i] = ((u.z - f64::from(hz[i])) as f32 + FINE) - FINE;
        }
    }
}
