//! Tissue beside an opened path in lanes of f32: points side by side, those of a cell in a run of lanes, and cells around the path side by side.
//! Equations: src/needle/opening.rs. Lengths are in radii of the needle, displacements of a cell those of its corners less that of the
//! first one, both taken from f64. Sums of sections are f64, of [`CHUNK`] vectors each: no bit hangs on the number of threads.
//!
//! What a lane of these forms does not know (a cell out of the range of `material/regular.rs`) is left to the caller.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

mod cells;
mod gathered;
mod points;
mod sums;
mod tet_vectors;
mod tets;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;
use pulp::{Arch, Simd};

use self::cells::SomeCells;
use self::gathered::{Gathered, Section};
use self::points::SomePoints;
use self::sums::{Chunk, Rows, SomeSums};
pub(in crate::cpu) use self::sums::{OfSpan, PointSums};
pub(in crate::cpu) use self::tets::{TetOpening, TetsNow};
use super::corners::SIGNS;
use super::number::Lanes;
use super::{LaneMaterial, WIDEST};
use crate::cpu::team::Team;
use crate::material::regular::{Constants, Regular};
use crate::mesh::{BlockMesh, CORNERS, trilinear};
use crate::model::Model;
use crate::model::opening::OpeningPlan;
use crate::needle::opening::{Beside, Derivatives, MapIn, OpeningMap, Station};
use crate::number::{Number, Tensor};

/// Rows of a vector of points: place in the cell, 0..1; volume [m^3]; edges of the cell [radii]; c1, c2, c3, c01 and bulk modulus; what a
/// stiffness makes of the bound of every corner [m].
const POINT: usize = 4 + 3 + LAW + SIGNS;
/// Constants of a law.
const LAW: usize = 5;
/// Rows of what is summed up for a cell: forces by mode of the displacement and axis, then bounds of the corners.
const RUN_SUMS: usize = 4 * SIGNS;
/// f32 of a row in which vectors begin at any lane.
const ROOM: usize = 2 * WIDEST;
/// Distances of lanes that are added up, one after the other, for sums of runs of up to [`WIDEST`].
const STRIDES: [usize; 4] = [1, 2, 4, 8];
/// Rows of a vector of cells: edges and place of what points do not carry [radii], volume [m^3], share of that, edge of the bound [radii],
/// `|b|^2` [1/m^2], then the law: c1, c2, c3, c01 and bulk modulus; mean and variance of the growth [radii]; a quarter of one over the edges
/// [1/m].
const CELL: usize = 10 + LAW + 2 + 3;
/// Rows of what a vector of cells gives its nodes: forces (as f_int) [N] on its corners, corner by corner, and the bound [N/m] of each.
const CORNER_ROWS: usize = 3 * SIGNS + 1;
/// Vectors whose sums are added up before they are added to those of others.
const CHUNK: usize = 4;

/// Points side by side, at most [`WIDEST`].
struct Vector {
    count: usize,
    /// First of its runs in [`LaneOpening::runs`].
    first_run: usize,
    /// False where a law is none that these forms know.
    is_known: bool,
    stations: [u16; WIDEST],
    /// For every one of [`STRIDES`] that is shorter than its longest run: 1 where the lane so far behind is of the same run.
    same_run: Vec<[f32; WIDEST]>,
    /// Station of the plan and place of every point in it.
    points: Vec<(usize, usize)>,
}

impl Vector {
    /// Of points by cell, station and place in it.
    fn new(group: &[(u32, usize, usize)], first_run: usize, is_known: impl Fn(u32) -> bool) -> Self {
        let same_run = |stride: usize| {
            let is_same = |lane: usize| group.get(lane + stride).is_some_and(|other| other.0 == group[lane].0);
            std::array::from_fn(|lane| if is_same(lane) { 1.0 } else { 0.0 })
        };
        let shorter = |stride: &usize| group.windows(stride + 1).any(|run| run[0].0 == run[*stride].0);
        Vector {
            count: group.len(),
            first_run,
            is_known: group.iter().all(|(cell, ..)| is_known(*cell)),
            stations: std::array::from_fn(|lane| group.get(lane).map_or(0, |(_, station, _)| *station as u16)),
            same_run: STRIDES.into_iter().filter(shorter).map(same_run).collect(),
            points: group.iter().map(|(_, station, index)| (*station, *index)).collect(),
        }
    }
}

/// All points by cell, station and place in it: cell by cell in the order in which they are cut, so that what is open stands together.
fn in_order_of_cells(plan: &OpeningPlan) -> Vec<(u32, usize, usize)> {
    let mut ordered: Vec<(u32, usize, usize)> = Vec::new();
    for (station, points) in plan.stations.iter().enumerate() {
        ordered.extend(points.points.iter().enumerate().map(|(index, point)| (point.cell, station, index)));
    }
    let mut first_station: BTreeMap<u32, usize> = BTreeMap::new();
    for (cell, station, _) in &ordered {
        first_station.entry(*cell).or_insert(*station);
    }
    ordered.sort_by_key(|(cell, station, index)| (first_station[cell], *cell, *station, *index));
    ordered
}

/// Stations of some vectors.
fn stations_of(vectors: &[Vector]) -> Vec<usize> {
    let stations = vectors.iter().flat_map(|v| &v.stations[..v.count]);
    stations.map(|station| usize::from(*station)).collect()
}

/// Vectors of points, and cells, that lanes did not know.
fn unknown(points: &[Found], cells: &[Found], count: usize) -> [Vec<usize>; 2] {
    let of = |found: &[Found]| -> Vec<usize> {
        found.iter().enumerate().filter(|(_, found)| **found == Found::Unknown).map(|(i, _)| i).collect()
    };
    let in_vector = |i: &usize| i * WIDEST..((i + 1) * WIDEST).min(count);
    [of(points), of(cells).iter().flat_map(in_vector).collect()]
}

/// Sums of stations, chunk by chunk.
fn station_sums(chunks: &[Chunk], rows: &[Rows], stations: &[Station]) -> Vec<PointSums> {
    let mut points = vec![PointSums::default(); stations.len()];
    Chunk::add(chunks, rows, |station, rows| points[station].add_rows(rows));
    for (sums, station) in points.iter_mut().zip(stations).filter(|(_, station)| station.radius > 0.0) {
        sums.shape = sums.energy / station.left();
    }
    points
}

/// Sums of spans, chunk by chunk.
fn span_sums(spans: &[(u16, u16)], chunks: &[Chunk], rows: &[Rows]) -> Vec<OfSpan> {
    let mut spans: Vec<OfSpan> = spans.iter().map(|span| (*span, PointSums::default())).collect();
    Chunk::add(chunks, rows, |span, rows| spans[span].1.add_rows(rows));
    spans
}

/// Points of a vector that share a cell.
struct Run {
    lanes: Range<usize>,
    /// Corners by the bits of their signs.
    nodes: [u32; SIGNS],
    /// Where the numbers of its corners stand among those of the nodes.
    numbers: [u32; SIGNS],
    /// Rest position of the first corner [m].
    origin: DVec3,
}

/// A cell that the map reaches.
struct Cell {
    /// Stations in it: which pair of [`LaneOpening::spans`].
    span: u16,
    nodes: [u32; SIGNS],
    /// Where the numbers of its corners stand among those of the nodes.
    numbers: [u32; SIGNS],
    /// Middle at rest [m].
    middle: DVec3,
}

/// What adds to the nodes of a layer of cells of the block.
#[derive(Default)]
struct Layer {
    /// Numbers of its cells.
    cells: Vec<u32>,
    /// Runs of points in it, each with its vector.
    runs: Vec<(u32, u32)>,
}

impl Layer {
    fn is_empty(&self) -> bool {
        self.cells.is_empty() && self.runs.is_empty()
    }
}

/// What does not change.
pub(in crate::cpu) struct LaneOpening {
    arch: Arch,
    shaft: f64,
    laws: Laws,
    /// The needle may turn: moments are wanted.
    turns: bool,
    vectors: Vec<Vector>,
    runs: Vec<Run>,
    /// [`POINT`] rows per vector of points.
    points: Vec<f32>,
    /// Of every [`CHUNK`] vectors of points: the stations that they lie at.
    point_chunks: Vec<Chunk>,
    /// First station and number of stations of cells.
    spans: Vec<(u16, u16)>,
    cells: Vec<Cell>,
    /// Of every [`CHUNK`] vectors of cells: their spans.
    cell_chunks: Vec<Chunk>,
    /// Layers of cells of the block, and numbers of a plane of nodes.
    layers: Vec<Layer>,
    plane: usize,
    /// False for vectors of cells in which a law is none that these forms know.
    is_known: Vec<bool>,
    /// [`CELL`] rows per vector of cells.
    constants: Vec<f32>,
    out: Out,
}

/// How far lanes have come with a group.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Found {
    /// The path is not open there: nothing acts.
    Closed,
    Known,
    /// A state that these forms do not know.
    Unknown,
}

/// What a step has found.
#[derive(Default)]
struct Out {
    vectors: Vec<Found>,
    /// Per run: forces (as f_int) [N] and bounds [N/m] of the corners.
    runs: Vec<AtCorners>,
    /// Per chunk of points and station in it, and per chunk of cells and span in it.
    of_stations: Vec<Rows>,
    of_spans: Vec<Rows>,
    /// [`CORNER_ROWS`] rows per vector of cells.
    cells: Vec<f32>,
    cell_vectors: Vec<Found>,
}

/// Forces (as f_int) [N] of the corners of a cell, by axis and the bits of their signs, then their bounds [N/m].
type AtCorners = [[f32; SIGNS]; 4];

/// Corner of a cell with these bits, as meshes count them.
fn corner_of_bits() -> [usize; SIGNS] {
    std::array::from_fn(|bits| {
        let signs = [0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { 1.0 } else { -1.0 });
        CORNERS.iter().position(|c| *c == signs).unwrap_or_default()
    })
}

impl LaneOpening {
    /// `first_number`: where the numbers of a node stand.
    pub(super) fn new(
        model: &Model,
        block: &BlockMesh,
        plan: &OpeningPlan,
        materials: &[LaneMaterial],
        first_number: impl Fn(usize) -> usize,
    ) -> Self {
        let shaft = plan.shaft;
        let by_bits = corner_of_bits();
        let nodes_of = |cell: usize| {
            let nodes = block.cell_nodes(cell);
            by_bits.map(|corner| nodes[corner] as u32)
        };
        let law_of = |cell: usize| {
            let material = &materials[model.material_index(cell)];
            let law = material.polynomial().unwrap_or_default();
            [law.c1, law.c2, law.c3, law.c01, material.bulk_modulus]
        };
        let is_polynomial = |cell: u32| materials[model.material_index(cell as usize)].polynomial().is_some();
        let ordered = in_order_of_cells(plan);
        let vector_count = ordered.len().div_ceil(WIDEST);
        let mut points = vec![0.0; vector_count * POINT * WIDEST];
        let numbers_of = |nodes: [u32; SIGNS]| nodes.map(|n| first_number(n as usize) as u32);
        let mut layers: Vec<Layer> = (0..block.cells()[2]).map(|_| Layer::default()).collect();
        let layer_of = |cell: usize| block.cell_coordinates(cell)[2];
        let (mut vectors, mut runs) = (Vec::with_capacity(vector_count), Vec::<Run>::new());
        for (number, (group, rows)) in ordered.chunks(WIDEST).zip(points.chunks_exact_mut(POINT * WIDEST)).enumerate() {
            let vector = Vector::new(group, runs.len(), is_polynomial);
            for (lane, (cell, station, index)) in group.iter().enumerate() {
                let (cell, point) = (*cell as usize, &plan.stations[*station].points[*index]);
                let is_next = lane > 0 && group[lane - 1].0 as usize == cell;
                match runs.last_mut().filter(|_| is_next) {
                    Some(run) => run.lanes.end = lane + 1,
                    None => {
                        let nodes = nodes_of(cell);
                        let origin = block.rest_position(nodes[0] as usize);
                        layers[layer_of(cell)].runs.push((runs.len() as u32, number as u32));
                        runs.push(Run { lanes: lane..lane + 1, nodes, numbers: numbers_of(nodes), origin });
                    }
                }
                let edges = block.cell_size(cell);
                let sizes = trilinear(point.local, edges).1.map(|g| g.length());
                let sum: f64 = sizes.iter().sum();
                let place = point.local.to_array().into_iter().chain([point.volume]);
                let constants = (edges / shaft).to_array().into_iter().chain(law_of(cell));
                let corners = by_bits.map(|corner| point.volume * sum * sizes[corner]);
                for (row, value) in place.chain(constants).chain(corners).enumerate() {
                    rows[row * WIDEST + lane] = value as f32;
                }
            }
            // No lane behind the last divides by zero.
            for lane in group.len()..WIDEST {
                for row in 4..7 {
                    rows[row * WIDEST + lane] = 1.0;
                }
            }
            vectors.push(vector);
        }
        let mut spans: Vec<(u16, u16)> = Vec::new();
        let cell_vectors = plan.cells.len().div_ceil(WIDEST);
        let mut constants = vec![0.0; cell_vectors * CELL * WIDEST];
        let cells: Vec<Cell> = plan
            .cells
            .iter()
            .enumerate()
            .map(|(number, near)| {
                // Those of the same stations lie side by side.
                if spans.last() != Some(&(near.first, near.count)) {
                    spans.push((near.first, near.count));
                }
                let cell = near.cell as usize;
                let (edges, nodes) = (block.cell_size(cell), nodes_of(cell));
                let quarter = 0.25 / edges;
                layers[layer_of(cell)].cells.push(number as u32);
                let [width, place] = [edges / shaft, near.place / shaft];
                let values = [
                    width.x,
                    width.y,
                    width.z,
                    place.x,
                    place.y,
                    place.z,
                    model.mesh.cell_volume(cell),
                    near.share,
                    model.mesh.cell_volume(cell).cbrt() / shaft,
                    quarter.length_squared(),
                ];
                let rows = &mut constants[number / WIDEST * CELL * WIDEST..];
                let area = shaft * shaft;
                let growth = [near.growth[0] * area, near.growth[1] * area * area];
                let rest = law_of(cell).into_iter().chain(growth).chain(quarter.to_array());
                for (row, value) in values.into_iter().chain(rest).enumerate() {
                    rows[row * WIDEST + number % WIDEST] = value as f32;
                }
                Cell {
                    span: (spans.len() - 1) as u16,
                    nodes,
                    numbers: numbers_of(nodes),
                    middle: block.rest_position(nodes[0] as usize) + 0.5 * edges,
                }
            })
            .collect();
        let point_chunks = Chunk::all(vectors.chunks(CHUNK).map(stations_of));
        let spans_of = |cells: &[Cell]| cells.iter().map(|cell| usize::from(cell.span)).collect::<Vec<_>>();
        let cell_chunks = Chunk::all(cells.chunks(CHUNK * WIDEST).map(spans_of));
        LaneOpening {
            arch: Arch::new(),
            shaft,
            laws: Laws::of(materials),
            turns: model.laid.is_some(),
            out: Out {
                vectors: vec![Found::Closed; vectors.len()],
                runs: vec![[[0.0; SIGNS]; 4]; runs.len()],
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
            layers,
            plane: first_number(block.node_index(0, 0, 1)) - first_number(block.node_index(0, 0, 0)),
            is_known: plan
                .cells
                .chunks(WIDEST)
                .map(|cells| cells.iter().all(|near| is_polynomial(near.cell)))
                .collect(),
            cells,
            constants,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        4 * (self.points.len() + self.constants.len() + self.out.cells.len())
            + size_of_val(self.out.of_stations.as_slice())
            + size_of_val(self.out.of_spans.as_slice())
            + size_of_val(self.vectors.as_slice())
            + size_of_val(self.runs.as_slice())
            + size_of_val(self.out.runs.as_slice())
            + size_of_val(self.cells.as_slice())
    }

    /// Computes all points and cells, for a map, stations and a displacement; `measures`: with energies. Returns the vectors of points and the cells
    /// that the caller has to compute.
    pub fn compute(
        &mut self,
        team: &Team,
        map: &OpeningMap,
        stations: &[Station],
        u: &[DVec3],
        measures: bool,
    ) -> [Vec<usize>; 2] {
        let mut out = std::mem::take(&mut self.out);
        let of_span =
            |(first, count): &(u16, u16)| Station::mean(&stations[usize::from(*first)..][..usize::from(*count)]);
        let section = |station: &Station| Section::new(station, 1.0 / self.shaft);
        let spans: Vec<Section> = self.spans.iter().map(|span| section(&of_span(span))).collect();
        let stations: Vec<Section> = stations.iter().map(section).collect();
        let step = Step { all: self, map, stations: &stations, spans: &spans, u, measures };
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

    /// Stations of the plan, and places in them, of the points of a vector.
    pub fn points_of(&self, vector: usize) -> &[(usize, usize)] {
        &self.vectors[vector].points
    }

    /// Adds forces and bounds to the numbers of the nodes; sums of the points of every station that is open, with energies, and of the cells
    /// per pair of stations. What the caller has to compute is left out of these.
    ///
    /// Planes of nodes side by side, each from the layers of cells on both sides: no bit hangs on the number of threads.
    pub fn gather(
        &self,
        team: &Team,
        stations: &[Station],
        (numbers, stride): (&mut [f32], usize),
    ) -> (Vec<PointSums>, Vec<OfSpan>) {
        let planes = numbers.chunks_mut(self.plane).enumerate();
        let planes = planes.filter(|(k, _)| self.layers_at(*k).any(|(layer, _)| !layer.is_empty()));
        let planes = planes.map(|(k, numbers)| Gather::Plane { k, numbers });
        let found = team.map([Gather::Sums].into_iter().chain(planes), |_, part| match part {
            Gather::Sums => Some((
                station_sums(&self.point_chunks, &self.out.of_stations, stations),
                span_sums(&self.spans, &self.cell_chunks, &self.out.of_spans),
            )),
            Gather::Plane { k, numbers } => {
                for (layer, corners) in self.layers_at(k) {
                    self.runs_at_nodes(&layer.runs, corners.clone(), numbers, (k * self.plane, stride));
                    self.cells_at_nodes(&layer.cells, corners, numbers, (k * self.plane, stride));
                }
                None
            }
        });
        found.into_iter().next().flatten().unwrap_or_default()
    }

    /// Layers of cells at a plane of nodes, each with the corners (by the bits of their signs) that lie in the plane.
    fn layers_at(&self, k: usize) -> impl Iterator<Item = (&Layer, Range<usize>)> {
        let below = k.checked_sub(1).and_then(|below| self.layers.get(below));
        let above = self.layers.get(k);
        below.map(|layer| (layer, SIGNS / 2..SIGNS)).into_iter().chain(above.map(|layer| (layer, 0..SIGNS / 2)))
    }

    /// Runs of a layer, to numbers of nodes from `first` on, which lie `stride` apart.
    fn runs_at_nodes(
        &self,
        runs: &[(u32, u32)],
        corners: Range<usize>,
        numbers: &mut [f32],
        (first, stride): (usize, usize),
    ) {
        for (number, vector) in runs {
            if self.out.vectors[*vector as usize] != Found::Known {
                continue;
            }
            let (run, found) = (&self.runs[*number as usize], &self.out.runs[*number as usize]);
            for bits in corners.clone() {
                let at = run.numbers[bits] as usize - first;
                let own = &mut numbers[at..=at + 3 * stride];
                for axis in 0..3 {
                    own[axis * stride] -= found[axis][bits];
                }
                own[3 * stride] += found[3][bits];
            }
        }
    }

    /// Cells of a layer, to the same.
    fn cells_at_nodes(
        &self,
        cells: &[u32],
        corners: Range<usize>,
        numbers: &mut [f32],
        (first, stride): (usize, usize),
    ) {
        for number in cells {
            let (vector, lane) = (*number as usize / WIDEST, *number as usize % WIDEST);
            if self.out.cell_vectors[vector] != Found::Known {
                continue;
            }
            let cell = &self.cells[*number as usize];
            let rows = &self.out.cells[vector * CORNER_ROWS * WIDEST..][..CORNER_ROWS * WIDEST];
            let value = |row: usize| rows[row * WIDEST + lane];
            let bound = value(CORNER_ROWS - 1);
            for bits in corners.clone() {
                let at = cell.numbers[bits] as usize - first;
                let own = &mut numbers[at..=at + 3 * stride];
                for axis in 0..3 {
                    own[axis * stride] -= value(3 * bits + axis);
                }
                own[3 * stride] += bound;
            }
        }
    }
}

/// What carries tissue beside an opened path.
pub(in crate::cpu) enum Carrier<'a> {
    Block(&'a mut LaneOpening),
    Tets(&'a mut TetOpening, TetsNow<'a>),
}

/// Tissue beside an opened path, and what its cells add to.
pub(in crate::cpu) struct OpeningInLanes<'a> {
    pub opening: Carrier<'a>,
    pub team: &'a Team,
    /// Numbers of the nodes, and f32 of a row of them.
    pub numbers: &'a mut [f32],
    pub stride: usize,
}

impl OpeningInLanes<'_> {
    /// Computes all points and cells, for a map, stations and a displacement; `measures`: with energies. Returns the vectors of points and the cells
    /// that the caller has to compute.
    pub fn compute(&mut self, map: &OpeningMap, stations: &[Station], u: &[DVec3], measures: bool) -> [Vec<usize>; 2] {
        match &mut self.opening {
            Carrier::Block(opening) => opening.compute(self.team, map, stations, u, measures),
            Carrier::Tets(opening, tets) => opening.compute(self.team, (map, stations), u, *tets, measures),
        }
    }

    /// Adds forces and bounds to the numbers of the nodes; sums of the points of every station that is open, with energies, and of the cells
    /// per pair of stations. What the caller has to compute is left out of these.
    pub fn gather(&mut self, stations: &[Station]) -> (Vec<PointSums>, Vec<OfSpan>) {
        let numbers = (&mut *self.numbers, self.stride);
        match &self.opening {
            Carrier::Block(opening) => opening.gather(self.team, stations, numbers),
            Carrier::Tets(opening, _) => opening.gather(self.team, stations, numbers),
        }
    }

    /// Stations of the plan, and places in them, of the points of a vector.
    pub fn points_of(&self, vector: usize) -> &[(usize, usize)] {
        match &self.opening {
            Carrier::Block(opening) => opening.points_of(vector),
            Carrier::Tets(opening, _) => opening.points_of(vector),
        }
    }
}

/// Part of what is added up.
enum Gather<'a> {
    /// Those of stations and spans.
    Sums,
    /// A plane of nodes.
    Plane { k: usize, numbers: &'a mut [f32] },
}

/// Part of a stage.
enum Part<'a> {
    Points(SomePoints<'a>),
    Cells(SomeCells<'a>),
}

/// What a step reads.
#[derive(Clone, Copy)]
struct Step<'a> {
    all: &'a LaneOpening,
    map: &'a OpeningMap,
    stations: &'a [Section],
    /// The path in cells.
    spans: &'a [Section],
    u: &'a [DVec3],
    measures: bool,
}

/// What all laws have in common.
#[derive(Clone, Copy)]
struct Laws {
    is_linear: bool,
    has_c01: bool,
}

impl Laws {
    fn of(materials: &[LaneMaterial]) -> Self {
        Laws {
            is_linear: materials.iter().all(|m| m.law.is_linear()),
            has_c01: materials.iter().any(|m| m.law.c01 != 0.0),
        }
    }

    /// Constants of the laws of a vector, from their first row on.
    #[inline(always)]
    fn in_lanes<S: Simd>(&self, simd: S, rows: &[f32], first: usize, at: usize) -> Constants<Lanes<S>> {
        Constants {
            c1: Lanes::load(simd, rows, first * WIDEST + at),
            c2: Lanes::load(simd, rows, (first + 1) * WIDEST + at),
            c3: Lanes::load(simd, rows, (first + 2) * WIDEST + at),
            c01: Lanes::load(simd, rows, (first + 3) * WIDEST + at),
            is_linear: self.is_linear,
            has_c01: self.has_c01,
        }
    }
}

/// Moment about the path of forces on nodes that have these derivatives of an energy by `I + h` and by the place at `offset`.
#[inline(always)]
fn moment_of<N: Number>(h: &Tensor<N>, offset: [N; 3], by_gradient: &Tensor<N>, by_place: [N; 3]) -> [N; 3] {
    let cross =
        |a: [N; 3], b: [N; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let mut moment = cross(offset, by_place);
    for a in 0..3 {
        let mut column = h[a];
        column[a] = column[a] + column[a].of(1.0);
        let of_column = cross(column, by_gradient[a]);
        for b in 0..3 {
            moment[b] = moment[b] + of_column[b];
        }
    }
    moment
}

/// What opening adds at places, per volume, and what bounds of the stiffness need.
struct Opened<N> {
    d: Derivatives<N>,
    /// W(F) - W(F_h); 0 where nobody asks.
    energy: N,
    /// The closed path.
    closed: Regular<N>,
    straight: N,
    turned: N,
    by_gradient: N,
    by_place: N,
    distance: N,
}

/// Opens the path beside places; `None` where one has left the range of these forms.
#[inline(always)]
fn opened<N: Number>(
    map: &MapIn<N>,
    beside: &Beside<N>,
    h: &Tensor<N>,
    law: &Constants<N>,
    bulk: N,
    measures: bool,
) -> Option<Opened<N>> {
    let none = bulk.of(0.0);
    let at = map.at(beside, h);
    let closed = Regular::new(*h)?;
    let open = Regular::new(at.gradient(h))?;
    let mut d = at.pull_back(&open.stress(law, none));
    let before = closed.stress(law, none);
    for a in 0..3 {
        for b in 0..3 {
            d.gradient[a][b] = d.gradient[a][b] - before[a][b];
        }
    }
    let mut energy = none;
    if measures {
        energy = open.energy(law, none) - closed.energy(law, none);
    }
    let [straight, turned] = open.tangent_bound(law, bulk);
    let (by_gradient, by_place) = at.amplification();
    Some(Opened { d, energy, closed, straight, turned, by_gradient, by_place, distance: at.distance() })
}
