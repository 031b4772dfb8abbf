//! Tetrahedra around an opened path in lanes of f32: points side by side, those of a tetrahedron in a run of lanes, and tetrahedra side by side.
//! Each has one displacement gradient, which the stage of the tetrahedra has found. Equations: src/needle/opening.rs; near_cell_forces in
//! src/cpu/opening.rs.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use std::collections::BTreeMap;

use glam::DVec3;
use pulp::Arch;

use super::gathered::Section;
use super::sums::{Chunk, OfSpan, PointSums, Rows, SomeSums};
use super::tet_vectors::{SomeCells, SomeDilations, SomePoints};
use super::{CHUNK, Found, Laws, Vector, span_sums, station_sums, unknown};
use crate::cpu::lanes::corners::GRADIENT;
use crate::cpu::lanes::{LaneMaterial, WIDEST};
use crate::cpu::team::Team;
use crate::mesh::TetMesh;
use crate::model::Model;
use crate::model::opening::OpeningPlan;
use crate::needle::opening::{OpeningMap, Station};

/// Rows of a vector of points: place from the middle of the tetrahedron [radii], volume [m^3], c1, c2, c3, c01 and bulk modulus.
pub(super) const POINT: usize = 4 + 5;
/// Rows of what is summed up for a tetrahedron: by the place, by the gradient, bound.
pub(super) const RUN_SUMS: usize = 3 + 9 + 1;
/// Rows of a vector of tetrahedra: place of what points do not carry [radii], volume [m^3], share of that, edge of the bound [radii], the law as
/// above, mean and variance of the growth [radii], four places at which its volume is taken [radii], gradients of the last three corners [1/m].
pub(super) const CELL: usize = 6 + 5 + 2 + 12 + 9;
/// Rows of what a vector of tetrahedra gives its nodes: force (as f_int) [N] and bound [N/m], corner by corner.
pub(super) const CORNER_ROWS: usize = 4 * 4;
/// Lines of nodes that one thread adds up.
const LINES: usize = 2;

/// Force (as f_int) [N] and bound [N/m] of the corners of a tetrahedron.
pub(super) type AtCorners = [[f32; 4]; 4];

/// A tetrahedron at rest.
#[derive(Clone, Copy)]
pub(super) struct Tet {
    /// Where its gradient begins; the entries follow [`WIDEST`] later each.
    pub gradient: u32,
    pub nodes: [u32; 4],
    /// [m]
    pub middle: DVec3,
}

/// Points of a vector that share a tetrahedron.
pub(super) struct Run {
    pub lanes: std::ops::Range<usize>,
    pub tet: Tet,
    /// Gradients B of its corners, and their lengths [1/m].
    pub gradients: [[f32; 3]; 4],
    pub lengths: [f32; 4],
}

/// A tetrahedron that the map reaches.
pub(super) struct Cell {
    /// Stations in it: which pair of [`TetOpening::spans`].
    pub span: u16,
    pub tet: Tet,
    /// Its slot.
    pub slot: u32,
}

/// What does not change.
pub(in crate::cpu) struct TetOpening {
    arch: Arch,
    pub(super) shaft: f64,
    pub(super) laws: Laws,
    pub(super) vectors: Vec<Vector>,
    pub(super) runs: Vec<Run>,
    /// [`POINT`] rows per vector of points.
    pub(super) points: Vec<f32>,
    point_chunks: Vec<Chunk>,
    spans: Vec<(u16, u16)>,
    pub(super) cells: Vec<Cell>,
    cell_chunks: Vec<Chunk>,
    /// False for vectors of tetrahedra in which a law is none that these forms know.
    pub(super) is_known: Vec<bool>,
    /// [`CELL`] rows per vector of tetrahedra.
    pub(super) constants: Vec<f32>,
    /// Nodes that any of them acts on: where their numbers stand, and where their corners begin and end.
    nodes: Vec<Node>,
    /// Four times the tetrahedron with the corner added; behind the tetrahedra are the runs.
    corners: Vec<u32>,
    /// First of `nodes` in every [`LINES`] lines, and f32 of that many lines.
    line_starts: Vec<usize>,
    part: usize,
    out: Out,
}

/// A node beside the path.
struct Node {
    number: u32,
    corners: std::ops::Range<u32>,
}

/// What a step has found.
#[derive(Default)]
struct Out {
    vectors: Vec<Found>,
    runs: Vec<AtCorners>,
    /// Per chunk of points and station in it, and per chunk of tetrahedra and span in it.
    of_stations: Vec<Rows>,
    of_spans: Vec<Rows>,
    /// [`CORNER_ROWS`] rows per vector of tetrahedra.
    cells: Vec<f32>,
    cell_vectors: Vec<Found>,
}

/// What the stages of the tetrahedra have found in a step.
#[derive(Clone, Copy)]
pub(in crate::cpu) struct TetsNow<'a> {
    /// H by group, then by entry, then by slot.
    pub gradients: &'a [f32],
    /// Averaged pressure of every node [Pa].
    pub pressures: &'a [f32],
}

/// What a step reads.
#[derive(Clone, Copy)]
pub(super) struct Step<'a> {
    pub all: &'a TetOpening,
    pub map: &'a OpeningMap,
    pub stations: &'a [Section],
    pub spans: &'a [Section],
    pub u: &'a [DVec3],
    pub tets: TetsNow<'a>,
    pub measures: bool,
}

impl TetOpening {
    /// `slot_of`: slot of a tetrahedron; `first_number`: where the numbers of a node stand, which are `line` in a line of nodes.
    pub(in crate::cpu::lanes) fn new(
        model: &Model,
        mesh: &TetMesh,
        plan: &OpeningPlan,
        materials: &[LaneMaterial],
        slot_of: impl Fn(usize) -> usize,
        (first_number, line): (impl Fn(usize) -> usize, usize),
    ) -> Self {
        let shaft = plan.shaft;
        let tet_of = |cell: usize| {
            let slot = slot_of(cell);
            let gradient = (slot / WIDEST * GRADIENT * WIDEST + slot % WIDEST) as u32;
            Tet { gradient, nodes: mesh.tets[cell], middle: model.mesh.cell_centre(cell) }
        };
        let law_of = |cell: usize| {
            let material = &materials[model.material_index(cell)];
            let law = material.polynomial().unwrap_or_default();
            [law.c1, law.c2, law.c3, law.c01, material.bulk_modulus]
        };
        let is_polynomial = |cell: u32| materials[model.material_index(cell as usize)].polynomial().is_some();
        let put = |rows: &mut [f32], lane: usize, values: &mut dyn Iterator<Item = f64>| {
            for (row, value) in values.enumerate() {
                rows[row * WIDEST + lane] = value as f32;
            }
        };
        let ordered = super::in_order_of_cells(plan);
        let mut points = vec![0.0; ordered.len().div_ceil(WIDEST) * POINT * WIDEST];
        let (mut vectors, mut runs) = (Vec::new(), Vec::<Run>::new());
        for (group, rows) in ordered.chunks(WIDEST).zip(points.chunks_exact_mut(POINT * WIDEST)) {
            let vector = Vector::new(group, runs.len(), is_polynomial);
            for (lane, (cell, station, index)) in group.iter().enumerate() {
                let (number, point) = (*cell as usize, &plan.stations[*station].points[*index]);
                let is_next = lane > 0 && group[lane - 1].0 == *cell;
                match runs.last_mut().filter(|_| is_next) {
                    Some(run) => run.lanes.end = lane + 1,
                    None => {
                        let gradients = mesh.gradients(number);
                        runs.push(Run {
                            lanes: lane..lane + 1,
                            tet: tet_of(number),
                            gradients: gradients.map(|b| b.to_array().map(|x| x as f32)),
                            lengths: gradients.map(|b| b.length() as f32),
                        });
                    }
                }
                let place = (point.place - model.mesh.cell_centre(number)) / shaft;
                let values = place.to_array().into_iter().chain([point.volume]).chain(law_of(number));
                put(rows, lane, &mut values.into_iter());
            }
            vectors.push(vector);
        }
        let mut spans: Vec<(u16, u16)> = Vec::new();
        let cell_vectors = plan.cells.len().div_ceil(WIDEST);
        let mut constants = vec![0.0; cell_vectors * CELL * WIDEST];
        let mut cells = Vec::with_capacity(plan.cells.len());
        for (number, near) in plan.cells.iter().enumerate() {
            // Those of the same stations lie side by side.
            if spans.last() != Some(&(near.first, near.count)) {
                spans.push((near.first, near.count));
            }
            let cell = near.cell as usize;
            let (volume, area) = (mesh.volume(cell), shaft * shaft);
            let places = model.mesh.volume_places(cell).map(|place| (place / shaft).to_array());
            let [_, b, c, d] = mesh.gradients(cell).map(|b| b.to_array());
            let values = (near.place / shaft)
                .to_array()
                .into_iter()
                .chain([volume, near.share, volume.cbrt() / shaft])
                .chain(law_of(cell))
                .chain([near.growth[0] * area, near.growth[1] * area * area])
                .chain(places.into_iter().flatten())
                .chain([b, c, d].into_iter().flatten());
            put(&mut constants[number / WIDEST * CELL * WIDEST..], number % WIDEST, &mut values.into_iter());
            let (span, slot) = ((spans.len() - 1) as u16, slot_of(cell) as u32);
            cells.push(Cell { span, tet: tet_of(cell), slot });
        }
        let mut around: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        let of_cells = cells.iter().map(|cell: &Cell| cell.tet.nodes);
        for (number, nodes) in of_cells.chain(runs.iter().map(|run| run.tet.nodes)).enumerate() {
            for (corner, node) in nodes.into_iter().enumerate() {
                around.entry(node).or_default().push((4 * number + corner) as u32);
            }
        }
        let (part, mut corners) = (LINES * line, Vec::new());
        let mut nodes = Vec::with_capacity(around.len());
        for (node, own) in around {
            let first = corners.len() as u32;
            corners.extend(own);
            nodes.push(Node { number: first_number(node as usize) as u32, corners: first..corners.len() as u32 });
        }
        // Nodes are in the order of their lines.
        let parts = nodes.last().map_or(0, |node: &Node| node.number as usize / part + 1);
        let line_starts = (0..=parts).map(|i| nodes.partition_point(|n| (n.number as usize) < i * part)).collect();
        let point_chunks = Chunk::all(vectors.chunks(CHUNK).map(super::stations_of));
        let spans_of = |cells: &[Cell]| cells.iter().map(|cell| usize::from(cell.span)).collect::<Vec<_>>();
        let cell_chunks = Chunk::all(cells.chunks(CHUNK * WIDEST).map(spans_of));
        TetOpening {
            arch: Arch::new(),
            shaft,
            laws: Laws::of(materials),
            out: Out {
                vectors: vec![Found::Closed; vectors.len()],
                runs: vec![AtCorners::default(); runs.len()],
                of_stations: Chunk::rows(&point_chunks),
                of_spans: Chunk::rows(&cell_chunks),
                cells: vec![0.0; cell_vectors * CORNER_ROWS * WIDEST],
                cell_vectors: vec![Found::Closed; cell_vectors],
            },
            vectors,
            runs,
            points,
            point_chunks,
            spans,
            cell_chunks,
            is_known: plan.cells.chunks(WIDEST).map(|c| c.iter().all(|near| is_polynomial(near.cell))).collect(),
            cells,
            constants,
            nodes,
            corners,
            line_starts,
            part,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        4 * (self.points.len() + self.constants.len() + self.out.cells.len() + self.corners.len())
            + size_of_val(self.out.of_stations.as_slice())
            + size_of_val(self.out.of_spans.as_slice())
            + size_of_val(self.vectors.as_slice())
            + size_of_val(self.runs.as_slice())
            + size_of_val(self.out.runs.as_slice())
            + size_of_val(self.cells.as_slice())
            + size_of_val(self.nodes.as_slice())
    }

    fn sections(&self, stations: &[Station]) -> [Vec<Section>; 2] {
        let of_span =
            |(first, count): &(u16, u16)| Station::mean(&stations[usize::from(*first)..][..usize::from(*count)]);
        let section = |station: &Station| Section::new(station, 1.0 / self.shaft);
        [stations.iter().map(section).collect(), self.spans.iter().map(|span| section(&of_span(span))).collect()]
    }

    /// By what part of their volume the tetrahedra around the path grow, to their changes of volume `V/4 (J - 1)` [m^3] by slot.
    pub fn grow(
        &self,
        team: &Team,
        (map, stations): (&OpeningMap, &[Station]),
        u: &[DVec3],
        gradients: &[f32],
        changes: &mut [f32],
    ) {
        let [_, spans] = self.sections(stations);
        let tets = TetsNow { gradients, pressures: &[] };
        let step = Step { all: self, map, stations: &[], spans: &spans, u, tets, measures: false };
        let firsts = (0..self.is_known.len()).step_by(CHUNK);
        let found = team.map(firsts, |_, first| {
            let count = CHUNK.min(self.is_known.len() - first);
            self.arch.dispatch(SomeDilations { step, first, count })
        });
        for (cells, by) in self.cells.chunks(CHUNK * WIDEST).zip(&found) {
            for (cell, [by, share]) in cells.iter().zip(by.as_flattened()).filter(|(_, [by, _])| *by != 0.0) {
                let change = &mut changes[cell.slot as usize];
                *change += by * (share + *change);
            }
        }
    }

    /// As `LaneOpening::compute`.
    pub fn compute(
        &mut self,
        team: &Team,
        (map, stations): (&OpeningMap, &[Station]),
        u: &[DVec3],
        tets: TetsNow,
        measures: bool,
    ) -> [Vec<usize>; 2] {
        let mut out = std::mem::take(&mut self.out);
        let [stations, spans] = self.sections(stations);
        let step = Step { all: self, map, stations: &stations, spans: &spans, u, tets, measures };
        let mut runs = out.runs.as_mut_slice();
        let mut sums = SomeSums::of(&self.point_chunks, &mut out.of_stations);
        let points = out.vectors.chunks_mut(CHUNK).enumerate().map(|(number, found)| {
            let end = |vector: usize| self.vectors.get(vector).map_or(self.runs.len(), |v| v.first_run);
            let first = number * CHUNK;
            let count = end(first + found.len()) - end(first);
            let own;
            (own, runs) = std::mem::take(&mut runs).split_at_mut(count);
            Part::Points(SomePoints { step, first, found, runs: own, sums: sums.next_chunk() })
        });
        let cells = out.cell_vectors.chunks_mut(CHUNK).zip(out.cells.chunks_mut(CHUNK * CORNER_ROWS * WIDEST));
        let mut sums = SomeSums::of(&self.cell_chunks, &mut out.of_spans);
        let cells = cells.enumerate().map(|(number, (found, corners))| {
            Part::Cells(SomeCells { step, first: number * CHUNK, found, corners, sums: sums.next_chunk() })
        });
        team.map(points.chain(cells), |_, part| match part {
            Part::Points(points) => self.arch.dispatch(points),
            Part::Cells(cells) => self.arch.dispatch(cells),
        });
        let found = unknown(&out.vectors, &out.cell_vectors, self.cells.len());
        self.out = out;
        found
    }

    /// As `LaneOpening::gather`: nodes side by side, each with all that acts on it in one order.
    pub fn gather(
        &self,
        team: &Team,
        stations: &[Station],
        (numbers, stride): (&mut [f32], usize),
    ) -> (Vec<PointSums>, Vec<OfSpan>) {
        let parts = numbers.chunks_mut(self.part).zip(self.line_starts.windows(2)).enumerate();
        let parts = parts.filter(|(_, (_, own))| own[0] < own[1]);
        let parts = parts.map(|(i, (numbers, own))| Some((i * self.part, numbers, own[0]..own[1])));
        let found = team.map([None].into_iter().chain(parts), |_, part| match part {
            None => Some((
                station_sums(&self.point_chunks, &self.out.of_stations, stations),
                span_sums(&self.spans, &self.cell_chunks, &self.out.of_spans),
            )),
            Some((first, numbers, own)) => {
                for node in &self.nodes[own] {
                    let sum = self.at_node(node);
                    let numbers = &mut numbers[node.number as usize - first..];
                    for axis in 0..3 {
                        numbers[axis * stride] -= sum[axis];
                    }
                    numbers[3 * stride] += sum[3];
                }
                None
            }
        });
        found.into_iter().next().flatten().unwrap_or_default()
    }

    /// What tetrahedra and points exert on a node (as f_int), and their bounds.
    fn at_node(&self, node: &Node) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for corner in &self.corners[node.corners.start as usize..node.corners.end as usize] {
            let (number, corner) = (*corner as usize / 4, *corner as usize % 4);
            match number.checked_sub(self.cells.len()) {
                None => {
                    let (vector, lane) = (number / WIDEST, number % WIDEST);
                    if self.out.cell_vectors[vector] == Found::Known {
                        let rows = &self.out.cells[(vector * CORNER_ROWS + 4 * corner) * WIDEST + lane..];
                        for i in 0..4 {
                            sum[i] += rows[i * WIDEST];
                        }
                    }
                }
                Some(run) => {
                    let at = &self.out.runs[run][corner];
                    for i in 0..4 {
                        sum[i] += at[i];
                    }
                }
            }
        }
        sum
    }

    /// Stations of the plan, and places in them, of the points of a vector.
    pub fn points_of(&self, vector: usize) -> &[(usize, usize)] {
        &self.vectors[vector].points
    }
}

/// Part of a stage.
enum Part<'a> {
    Points(SomePoints<'a>),
    Cells(SomeCells<'a>),
}
