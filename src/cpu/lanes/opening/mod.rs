//! Tissue beside an opened path in lanes of f32: points side by side, those of a cell in a run of lanes, and cells around the path side by side.
//! Equations: src/needle/opening.rs. Lengths are in radii of the needle, displacements of a cell those of its corners less that of the
//! first one, both taken from f64; sums over lanes leave as f64.
//!
//! What a lane of these forms does not know (a cell out of the range of `material/regular.rs`) is left to the caller.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

mod cells;
mod gathered;
mod points;

use std::collections::BTreeMap;
use std::ops::Range;

use glam::DVec3;
use pulp::{Arch, Simd};

use self::cells::SomeCells;
use self::gathered::Gathered;
use self::points::SomePoints;
use super::corners::SIGNS;
use super::number::Lanes;
use super::{LaneMaterial, WIDEST};
use crate::cpu::added::Added;
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
/// Rows of what a vector of points gives: see [`PointSums`].
const POINT_SUMS: usize = 12;
/// Rows of what is summed up for a cell: forces by mode of the displacement and axis, then bounds of the corners.
const RUN_SUMS: usize = 4 * SIGNS;
/// f32 of a row in which vectors begin at any lane.
const ROOM: usize = 2 * WIDEST;
/// Distances of lanes that are added up, one after the other, for sums of runs of up to [`WIDEST`].
const STRIDES: [usize; 4] = [1, 2, 4, 8];
/// Rows of a vector of cells: edges and place of what points do not carry [radii], volume [m^3], share of that, edge of the bound [radii],
/// `|b|^2` [1/m^2], then the law: c1, c2, c3, c01 and bulk modulus; mean and variance of the growth [radii].
const CELL: usize = 10 + LAW + 2;
/// Rows of what a vector of cells gives: forces (as f_int) [N] on its corners, corner by corner, by the place [N], rate, radius [N] and its
/// rate, energy, moment, energy of the shape without relaxation, bound.
const CELL_SUMS: usize = CORNER_FORCES + 3 + 3 + 1 + 1 + 1 + 3 + 1 + 1;
/// Rows of the forces on corners.
const CORNER_FORCES: usize = 3 * SIGNS;

/// Points side by side, at most [`WIDEST`].
struct Vector {
    count: usize,
    /// First of its runs in [`LaneOpening::runs`].
    first_run: usize,
    /// False where a law is none that these forms know.
    is_known: bool,
    stations: [u16; WIDEST],
    /// For every one of [`STRIDES`]: 1 where the lane so far behind is of the same run.
    same_run: [[f32; WIDEST]; STRIDES.len()],
    /// Station of the plan and place of every point in it.
    points: Vec<(usize, usize)>,
}

/// Points of a vector that share a cell.
struct Run {
    lanes: Range<usize>,
    /// Corners by the bits of their signs.
    nodes: [u32; SIGNS],
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
    /// Middle at rest [m], and a quarter of one over its edges [1/m].
    middle: DVec3,
    quarter: DVec3,
}

/// What does not change.
pub(in crate::cpu) struct LaneOpening {
    arch: Arch,
    shaft: f64,
    is_linear: bool,
    has_c01: bool,
    /// The needle may turn: moments are wanted.
    turns: bool,
    vectors: Vec<Vector>,
    runs: Vec<Run>,
    /// [`POINT`] rows per vector of points.
    points: Vec<f32>,
    /// Of every station: where its points stand, vector times [`WIDEST`] plus lane; in compressed rows.
    starts: Vec<u32>,
    of_station: Vec<u32>,
    /// First station and number of stations of cells.
    spans: Vec<(u16, u16)>,
    cells: Vec<Cell>,
    /// Their numbers, layer by layer of the block, and numbers of the nodes of a layer.
    layers: Vec<Vec<u32>>,
    layer: usize,
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
    /// [`POINT_SUMS`] rows per vector of points.
    points: Vec<f32>,
    vectors: Vec<Found>,
    /// Per run: force (as f_int) [N] and bound [N/m] of the corners.
    runs: Vec<AtCorners>,
    /// [`CELL_SUMS`] rows per vector of cells.
    cells: Vec<f32>,
    cell_vectors: Vec<Found>,
}

/// Forces (as f_int) [N] and bounds [N/m] of the corners of a cell, by the bits of their signs.
type AtCorners = [(DVec3, f64); SIGNS];

/// Derivatives of the energy of points by what their station is.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::cpu) struct PointSums {
    pub place: DVec3,
    pub centre_rate: DVec3,
    pub radius: f64,
    pub radius_rate: f64,
    /// Moment of the forces on nodes about the path.
    pub moment: DVec3,
    pub energy: f64,
    /// Energy of the shape without relaxation [J].
    pub shape: f64,
}

/// First station and number of stations in a cell, and what is derived of their mean.
pub(in crate::cpu) type OfSpan = ((u16, u16), PointSums);

impl PointSums {
    /// Of derivatives and an energy per volume.
    pub fn new(d: &Derivatives<f64>, moment: DVec3, energy: f64, volume: f64) -> Self {
        let (place, centre_rate) = (DVec3::from(d.place), DVec3::from(d.centre_rate));
        let (radius, radius_rate) = (d.radius, d.radius_rate);
        PointSums { place, centre_rate, radius, radius_rate, moment, energy, shape: 0.0 }.times(volume)
    }

    fn add(&mut self, other: &Self) {
        self.place += other.place;
        self.centre_rate += other.centre_rate;
        self.radius += other.radius;
        self.radius_rate += other.radius_rate;
        self.moment += other.moment;
        self.energy += other.energy;
        self.shape += other.shape;
    }

    /// All of it `by` times.
    pub fn times(&self, by: f64) -> Self {
        PointSums { shape: self.shape * by, ..PointSums::of(self.rows().map(|value| value * by)) }
    }

    fn rows(&self) -> [f64; POINT_SUMS] {
        let (p, r, m) = (self.place, self.centre_rate, self.moment);
        [p.x, p.y, p.z, r.x, r.y, r.z, self.radius, self.radius_rate, self.energy, m.x, m.y, m.z]
    }

    fn of(rows: [f64; POINT_SUMS]) -> Self {
        let [px, py, pz, rx, ry, rz, radius, radius_rate, energy, mx, my, mz] = rows;
        PointSums {
            place: DVec3::new(px, py, pz),
            centre_rate: DVec3::new(rx, ry, rz),
            radius,
            radius_rate,
            moment: DVec3::new(mx, my, mz),
            energy,
            shape: 0.0,
        }
    }
}

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
        // Cell by cell in the order in which they are cut, so that what is open stands together.
        let mut ordered: Vec<(u32, usize, usize)> = Vec::new();
        for (station, points) in plan.stations.iter().enumerate() {
            ordered.extend(points.points.iter().enumerate().map(|(index, point)| (point.cell, station, index)));
        }
        let mut first_station: BTreeMap<u32, usize> = BTreeMap::new();
        for (cell, station, _) in &ordered {
            first_station.entry(*cell).or_insert(*station);
        }
        ordered.sort_by_key(|(cell, station, index)| (first_station[cell], *cell, *station, *index));
        let vector_count = ordered.len().div_ceil(WIDEST);
        let mut points = vec![0.0; vector_count * POINT * WIDEST];
        let mut of_station = vec![Vec::new(); plan.stations.len()];
        let (mut vectors, mut runs) = (Vec::with_capacity(vector_count), Vec::<Run>::new());
        for (number, (group, rows)) in ordered.chunks(WIDEST).zip(points.chunks_exact_mut(POINT * WIDEST)).enumerate() {
            let mut vector = Vector {
                count: group.len(),
                first_run: runs.len(),
                is_known: true,
                stations: [0; WIDEST],
                same_run: STRIDES.map(|stride| {
                    let is_same = |lane: usize| group.get(lane + stride).is_some_and(|other| other.0 == group[lane].0);
                    std::array::from_fn(|lane| if is_same(lane) { 1.0 } else { 0.0 })
                }),
                points: group.iter().map(|(_, station, index)| (*station, *index)).collect(),
            };
            for (lane, (cell, station, index)) in group.iter().enumerate() {
                let (cell, point) = (*cell as usize, &plan.stations[*station].points[*index]);
                vector.is_known &= is_polynomial(cell as u32);
                vector.stations[lane] = *station as u16;
                of_station[*station].push((number * WIDEST + lane) as u32);
                let is_next = lane > 0 && group[lane - 1].0 as usize == cell;
                match runs.last_mut().filter(|_| is_next) {
                    Some(run) => run.lanes.end = lane + 1,
                    None => {
                        let nodes = nodes_of(cell);
                        let origin = block.rest_position(nodes[0] as usize);
                        runs.push(Run { lanes: lane..lane + 1, nodes, origin });
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
                let [width, place] = [edges / shaft, near.place * edges / shaft];
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
                for (row, value) in values.into_iter().chain(law_of(cell)).chain(growth).enumerate() {
                    rows[row * WIDEST + number % WIDEST] = value as f32;
                }
                Cell {
                    span: (spans.len() - 1) as u16,
                    nodes,
                    numbers: nodes.map(|n| first_number(n as usize) as u32),
                    middle: block.rest_position(nodes[0] as usize) + 0.5 * edges,
                    quarter,
                }
            })
            .collect();
        let mut layers = vec![Vec::new(); block.cells()[2]];
        for (number, near) in plan.cells.iter().enumerate() {
            layers[block.cell_coordinates(near.cell as usize)[2]].push(number as u32);
        }
        let mut starts = vec![0];
        starts.extend(of_station.iter().scan(0, |sum, points: &Vec<u32>| {
            *sum += points.len() as u32;
            Some(*sum)
        }));
        LaneOpening {
            arch: Arch::new(),
            shaft,
            is_linear: materials.iter().all(|m| m.law.is_linear()),
            has_c01: materials.iter().any(|m| m.law.c01 != 0.0),
            turns: model.laid.is_some(),
            out: Out {
                points: vec![0.0; vectors.len() * POINT_SUMS * WIDEST],
                vectors: vec![Found::Closed; vectors.len()],
                runs: vec![[(DVec3::ZERO, 0.0); SIGNS]; runs.len()],
                cells: vec![0.0; cell_vectors * CELL_SUMS * WIDEST],
                cell_vectors: vec![Found::Closed; cell_vectors],
            },
            vectors,
            runs,
            points,
            starts,
            of_station: of_station.concat(),
            spans,
            layers,
            layer: first_number(block.node_index(0, 0, 1)) - first_number(block.node_index(0, 0, 0)),
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
        4 * (self.points.len() + self.constants.len() + self.out.points.len() + self.out.cells.len())
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
        let spans: Vec<Station> = self.spans.iter().map(of_span).collect();
        let step = Step { all: self, map, stations, spans: &spans, u, measures };
        let part = team.part(self.vectors.len());
        let mut runs = out.runs.as_mut_slice();
        let vectors = out.vectors.chunks_mut(part).zip(out.points.chunks_mut(part * POINT_SUMS * WIDEST));
        let points = vectors.enumerate().map(|(number, (found, sums))| {
            let end = |vector: usize| self.vectors.get(vector).map_or(self.runs.len(), |v| v.first_run);
            let first = number * part;
            let count = end(first + found.len()) - end(first);
            let own;
            (own, runs) = std::mem::take(&mut runs).split_at_mut(count);
            Part::Points(SomePoints { step, first, found, runs: own, sums })
        });
        let part = team.part(out.cell_vectors.len());
        let cells = out.cell_vectors.chunks_mut(part).zip(out.cells.chunks_mut(part * CELL_SUMS * WIDEST));
        let cells = cells
            .enumerate()
            .map(|(number, (found, sums))| Part::Cells(SomeCells { step, first: number * part, found, sums }));
        team.map(points.chain(cells), |_, part| match part {
            Part::Points(points) => self.arch.dispatch(points),
            Part::Cells(cells) => self.arch.dispatch(cells),
        });
        let unknown = |found: &[Found]| -> Vec<usize> {
            found.iter().enumerate().filter(|(_, found)| **found == Found::Unknown).map(|(i, _)| i).collect()
        };
        let (points, cells) = (unknown(&out.vectors), unknown(&out.cell_vectors));
        let cells = cells.iter().flat_map(|i| i * WIDEST..((i + 1) * WIDEST).min(self.cells.len())).collect();
        self.out = out;
        [points, cells]
    }

    /// Stations of the plan, and places in them, of the points of a vector.
    pub fn points_of(&self, vector: usize) -> &[(usize, usize)] {
        &self.vectors[vector].points
    }

    /// Takes what the caller has found for a point of a vector.
    pub fn set_point(&mut self, vector: usize, lane: usize, sums: &PointSums) {
        for (row, value) in sums.rows().into_iter().enumerate() {
            self.out.points[(vector * POINT_SUMS + row) * WIDEST + lane] = value as f32;
        }
    }

    /// Sums of the points of a station.
    fn of_station(&self, station: usize) -> PointSums {
        let mut sums = [0.0; POINT_SUMS];
        for place in &self.of_station[self.starts[station] as usize..self.starts[station + 1] as usize] {
            let (vector, lane) = (*place as usize / WIDEST, *place as usize % WIDEST);
            let rows = &self.out.points[vector * POINT_SUMS * WIDEST + lane..];
            for row in 0..POINT_SUMS {
                sums[row] += f64::from(rows[row * WIDEST]);
            }
        }
        PointSums::of(sums)
    }

    /// Adds forces and bounds of the points.
    fn points_at_nodes(&self, added: &mut Added) {
        for (number, vector) in self.vectors.iter().enumerate() {
            if self.out.vectors[number] != Found::Known {
                continue;
            }
            let end = self.vectors.get(number + 1).map_or(self.runs.len(), |v| v.first_run);
            for run in vector.first_run..end {
                for (node, (force, bound)) in self.runs[run].nodes.iter().zip(&self.out.runs[run]) {
                    added.add(*node as usize, -*force, *bound);
                }
            }
        }
    }

    /// Sums of the points of every station that is open, with energies, then of the cells per pair of stations; the cells are added to the
    /// numbers of the nodes, the points to what is added there. What the caller has to compute is left out of these.
    ///
    /// Layers of cells that share no node side by side, first the even ones: no bit hangs on the number of threads.
    pub fn gather(
        &self,
        team: &Team,
        stations: &[Station],
        (numbers, stride): (&mut [f32], usize),
        added: &mut Added,
    ) -> (Vec<PointSums>, Vec<OfSpan>) {
        let mut added = Some(added);
        let mut sums = vec![PointSums::default(); stations.len()];
        let mut spans: Vec<_> = self.spans.iter().map(|span| (*span, PointSums::default())).collect();
        for parity in 0..2 {
            let first = parity * self.layer;
            let numbers = numbers[first..].chunks_mut(2 * self.layer);
            let layers = numbers.zip(self.layers.iter().skip(parity).step_by(2)).enumerate();
            let layers = layers
                .filter(|(_, (_, cells))| !cells.is_empty())
                .map(|(i, (numbers, cells))| Gather::Layer { cells, numbers, first: first + 2 * i * self.layer });
            let part = team.part(stations.len());
            let of_points = sums.chunks_mut(part).enumerate().filter(|_| parity == 0);
            let of_points = of_points.map(|(i, sums)| Gather::Stations { first: i * part, sums });
            // The longest part first.
            let points = added.take().map(Gather::Points).into_iter();
            let found = team.map(points.chain(layers).chain(of_points), |_, part| match part {
                Gather::Points(added) => {
                    self.points_at_nodes(added);
                    Vec::new()
                }
                Gather::Layer { cells, numbers, first } => self.layer_at_nodes(cells, numbers, (first, stride)),
                Gather::Stations { first, sums } => {
                    for (i, sums) in (first..).zip(sums).filter(|(i, _)| stations[*i].radius > 0.0) {
                        *sums = self.of_station(i);
                        sums.shape = sums.energy / stations[i].left();
                    }
                    Vec::new()
                }
            });
            for (span, sums) in found.into_iter().flatten() {
                spans[usize::from(span)].1.add(&sums);
            }
        }
        (sums, spans)
    }

    /// Cells of a layer, to numbers of nodes from `first` on, which lie `stride` apart.
    fn layer_at_nodes(
        &self,
        cells: &[u32],
        numbers: &mut [f32],
        (first, stride): (usize, usize),
    ) -> Vec<(u16, PointSums)> {
        let mut spans: Vec<(u16, PointSums)> = Vec::new();
        for number in cells {
            let (vector, lane) = (*number as usize / WIDEST, *number as usize % WIDEST);
            if self.out.cell_vectors[vector] != Found::Known {
                continue;
            }
            let cell = &self.cells[*number as usize];
            let rows = &self.out.cells[vector * CELL_SUMS * WIDEST..][..CELL_SUMS * WIDEST];
            let value = |row: usize| rows[row * WIDEST + lane];
            let row = |row: usize| f64::from(value(CORNER_FORCES + row));
            let vector = |first: usize| DVec3::new(row(first), row(first + 1), row(first + 2));
            let bound = value(CELL_SUMS - 1);
            if bound == 0.0 && row(6) == 0.0 {
                continue;
            }
            if spans.last().is_none_or(|(span, _)| *span != cell.span) {
                spans.push((cell.span, PointSums::default()));
            }
            let over_shaft = 1.0 / self.shaft;
            if let Some((_, sums)) = spans.last_mut() {
                sums.add(&PointSums {
                    place: vector(0) * over_shaft,
                    centre_rate: vector(3),
                    radius: row(6) * over_shaft,
                    radius_rate: row(7),
                    energy: row(8),
                    moment: vector(9),
                    shape: row(12),
                });
            }
            for bits in 0..SIGNS {
                let at = cell.numbers[bits] as usize - first;
                let own = &mut numbers[at..=at + 3 * stride];
                for axis in 0..3 {
                    own[axis * stride] -= value(3 * bits + axis);
                }
                own[3 * stride] += bound;
            }
        }
        spans
    }
}

/// Tissue beside an opened path, and what its cells add to.
pub(in crate::cpu) struct OpeningInLanes<'a> {
    pub opening: &'a mut LaneOpening,
    pub team: &'a Team,
    /// Numbers of the nodes, and f32 of a row of them.
    pub numbers: &'a mut [f32],
    pub stride: usize,
}

/// Part of what is added up.
enum Gather<'a> {
    Points(&'a mut Added),
    Layer {
        cells: &'a [u32],
        numbers: &'a mut [f32],
        /// The first of these numbers among all.
        first: usize,
    },
    Stations {
        first: usize,
        sums: &'a mut [PointSums],
    },
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
    stations: &'a [Station],
    /// The path in cells.
    spans: &'a [Station],
    u: &'a [DVec3],
    measures: bool,
}

/// Constants of the laws of a vector, from their first row on.
#[inline(always)]
fn law_in_lanes<S: Simd>(simd: S, all: &LaneOpening, rows: &[f32], first: usize, at: usize) -> Constants<Lanes<S>> {
    Constants {
        c1: Lanes::load(simd, rows, first * WIDEST + at),
        c2: Lanes::load(simd, rows, (first + 1) * WIDEST + at),
        c3: Lanes::load(simd, rows, (first + 2) * WIDEST + at),
        c01: Lanes::load(simd, rows, (first + 3) * WIDEST + at),
        is_linear: all.is_linear,
        has_c01: all.has_c01,
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
