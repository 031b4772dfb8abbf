//! Tissue beside an opened path in lanes of f32: points that share a cell side by side, and cells around the path side by side.
//! Equations: src/needle/opening.rs. Lengths are in radii of the needle, displacements of a cell those of its corners less that of the
//! first one, both taken from f64; sums over lanes leave as f64.
//!
//! What a lane of these forms does not know (a cell out of the range of `material/regular.rs`) is left to the caller.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use super::number::Lanes;
use super::rows::HOURGLASS;
use super::shapes::SIGNS;
use super::{LaneMaterial, WIDEST};
use crate::cpu::team::Team;
use crate::material::number::{Number, Tensor};
use crate::material::regular::{Constants, Polynomial, Regular};
use crate::mesh::{BlockMesh, CORNERS, trilinear};
use crate::model::Model;
use crate::model::opening::{OpeningPlan, VOLUME_PLACE, is_volume_place};
use crate::needle::opening::{Beside, Derivatives, MapIn, Station, outer, squared_norm_bound};

/// Rows of a group of points: place in the cell, 0..1; volume [m^3]; what a stiffness makes of the bound of every corner [m].
const POINT: usize = 4 + SIGNS;
/// Rows of what a group of points gives: see [`PointSums`].
const POINT_SUMS: usize = 9;
/// Rows of a vector of cells: edges and place of what points do not carry [radii], volume [m^3], share of that, edge of the bound [radii],
/// `|b|^2` [1/m^2], then the law: c1, c2, c3, c01 and bulk modulus.
const CELL: usize = 15;
/// Rows of what a vector of cells gives: by the gradient, by the place, by rate, radius and its rate, energy, bound.
const CELL_SUMS: usize = 9 + 3 + 3 + 1 + 1 + 1 + 1;

/// Points of one cell, at most [`WIDEST`].
struct Cluster {
    count: usize,
    material: usize,
    /// Corners by the bits of their signs.
    nodes: [u32; SIGNS],
    /// Rest position of the first corner, and edges [m].
    origin: DVec3,
    edges: DVec3,
    stations: [u16; WIDEST],
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
    materials: Vec<Option<Polynomial>>,
    bulk: Vec<f64>,
    is_linear: bool,
    has_c01: bool,
    clusters: Vec<Cluster>,
    /// [`POINT`] rows per cluster.
    points: Vec<f32>,
    /// Of every station: where its points stand, cluster times [`WIDEST`] plus lane; in compressed rows.
    starts: Vec<u32>,
    of_station: Vec<u32>,
    /// First station and number of stations of cells.
    spans: Vec<(u16, u16)>,
    cells: Vec<Cell>,
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
    /// [`POINT_SUMS`] rows per cluster.
    points: Vec<f32>,
    /// Per cluster: force (as f_int) [N] and bound [N/m] of the corners.
    clusters: Vec<(Found, [(DVec3, f64); SIGNS])>,
    /// [`CELL_SUMS`] rows per vector of cells.
    cells: Vec<f32>,
    vectors: Vec<Found>,
}

/// Derivatives of the energy of points by what their station is.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::cpu) struct PointSums {
    pub place: DVec3,
    pub centre_rate: DVec3,
    pub radius: f64,
    pub radius_rate: f64,
    pub energy: f64,
}

impl PointSums {
    /// Of derivatives and an energy per volume.
    pub fn new(d: &Derivatives<f64>, energy: f64, volume: f64) -> Self {
        let (place, centre_rate) = (DVec3::from(d.place), DVec3::from(d.centre_rate));
        PointSums { place, centre_rate, radius: d.radius, radius_rate: d.radius_rate, energy }.times(volume)
    }

    /// All of it `by` times.
    pub fn times(&self, by: f64) -> Self {
        PointSums::of(self.rows().map(|value| value * by))
    }

    fn rows(&self) -> [f64; POINT_SUMS] {
        let (p, r) = (self.place, self.centre_rate);
        [p.x, p.y, p.z, r.x, r.y, r.z, self.radius, self.radius_rate, self.energy]
    }

    fn of(rows: [f64; POINT_SUMS]) -> Self {
        let [px, py, pz, rx, ry, rz, radius, radius_rate, energy] = rows;
        PointSums { place: DVec3::new(px, py, pz), centre_rate: DVec3::new(rx, ry, rz), radius, radius_rate, energy }
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
        let shaft = plan.map.shaft;
        let by_bits = corner_of_bits();
        let nodes_of = |cell: usize| {
            let nodes = block.cell_nodes(cell);
            by_bits.map(|corner| nodes[corner] as u32)
        };
        let mut points = vec![0.0; plan.clusters.len() * POINT * WIDEST];
        let mut of_station = vec![Vec::new(); plan.stations.len()];
        let clusters: Vec<Cluster> = plan
            .clusters
            .iter()
            .zip(points.chunks_exact_mut(POINT * WIDEST))
            .enumerate()
            .map(|(number, (cluster, rows))| {
                let cell = cluster.cell as usize;
                let edges = block.cell_size(cell);
                let mut stations = [0; WIDEST];
                for (lane, (station, index)) in cluster.points.iter().enumerate() {
                    let point = &plan.stations[*station].points[*index];
                    stations[lane] = *station as u16;
                    of_station[*station].push((number * WIDEST + lane) as u32);
                    let sizes = trilinear(point.local, edges).1.map(|g| g.length());
                    let sum: f64 = sizes.iter().sum();
                    let [x, y, z] = point.local.to_array();
                    let corners = by_bits.map(|corner| point.volume * sum * sizes[corner]);
                    for (row, value) in [x, y, z, point.volume].into_iter().chain(corners).enumerate() {
                        rows[row * WIDEST + lane] = value as f32;
                    }
                }
                let nodes = nodes_of(cell);
                let origin = block.rest_position(nodes[0] as usize);
                let (count, material) = (cluster.points.len(), model.material_index(cell));
                Cluster { count, material, nodes, origin, edges, stations }
            })
            .collect();
        let mut spans: Vec<(u16, u16)> = Vec::new();
        let vectors = plan.cells.len().div_ceil(WIDEST);
        let mut constants = vec![0.0; vectors * CELL * WIDEST];
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
                let material = &materials[model.material_index(cell)];
                let law = material.polynomial().unwrap_or_default();
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
                    law.c1,
                    law.c2,
                    law.c3,
                    law.c01,
                    material.bulk_modulus,
                ];
                let rows = &mut constants[number / WIDEST * CELL * WIDEST..];
                for (row, value) in values.into_iter().enumerate() {
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
        let mut starts = vec![0];
        starts.extend(of_station.iter().scan(0, |sum, points: &Vec<u32>| {
            *sum += points.len() as u32;
            Some(*sum)
        }));
        LaneOpening {
            arch: Arch::new(),
            shaft,
            materials: materials.iter().map(LaneMaterial::polynomial).collect(),
            bulk: materials.iter().map(|m| m.bulk_modulus).collect(),
            is_linear: materials.iter().all(|m| m.law.is_linear()),
            has_c01: materials.iter().any(|m| m.law.c01 != 0.0),
            out: Out {
                points: vec![0.0; clusters.len() * POINT_SUMS * WIDEST],
                clusters: vec![(Found::Closed, [(DVec3::ZERO, 0.0); SIGNS]); clusters.len()],
                cells: vec![0.0; vectors * CELL_SUMS * WIDEST],
                vectors: vec![Found::Closed; vectors],
            },
            clusters,
            points,
            starts,
            of_station: of_station.concat(),
            spans,
            cells,
            constants,
        }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        4 * (self.points.len() + self.constants.len() + self.out.points.len() + self.out.cells.len())
            + size_of_val(self.clusters.as_slice())
            + size_of_val(self.out.clusters.as_slice())
            + size_of_val(self.cells.as_slice())
    }

    /// Computes all points and cells, for stations and a displacement; `measures`: with energies. Returns the clusters and the cells that
    /// the caller has to compute.
    pub fn compute(
        &mut self,
        team: &Team,
        plan: &OpeningPlan,
        stations: &[Station],
        u: &[DVec3],
        measures: bool,
    ) -> [Vec<usize>; 2] {
        let mut out = std::mem::take(&mut self.out);
        let spans: Vec<Station> = self
            .spans
            .iter()
            .map(|(first, count)| Station::mean(&stations[usize::from(*first)..][..usize::from(*count)]))
            .collect();
        let step = Step { all: self, plan, stations, spans: &spans, u, measures };
        let part = team.part(self.clusters.len());
        let clusters = out.clusters.chunks_mut(part).zip(out.points.chunks_mut(part * POINT_SUMS * WIDEST));
        team.map(clusters, |number, (corners, sums)| {
            self.arch.dispatch(SomeClusters { step, first: number * part, corners, sums });
        });
        let part = team.part(out.vectors.len());
        let cells = out.vectors.chunks_mut(part).zip(out.cells.chunks_mut(part * CELL_SUMS * WIDEST));
        team.map(cells, |number, (found, sums)| {
            self.arch.dispatch(SomeCells { step, first: number * part, found, sums });
        });
        let unknown = out.clusters.iter().enumerate().filter(|(_, c)| c.0 == Found::Unknown).map(|(i, _)| i).collect();
        let cells = out.vectors.iter().enumerate().filter(|(_, found)| **found == Found::Unknown);
        let cells = cells.flat_map(|(i, _)| i * WIDEST..((i + 1) * WIDEST).min(self.cells.len())).collect();
        self.out = out;
        [unknown, cells]
    }

    /// Takes what the caller has found for a point of a cluster.
    pub fn set_point(&mut self, cluster: usize, lane: usize, sums: &PointSums) {
        for (row, value) in sums.rows().into_iter().enumerate() {
            self.out.points[(cluster * POINT_SUMS + row) * WIDEST + lane] = value as f32;
        }
    }

    /// Sums of the points of a station.
    pub fn of_station(&self, station: usize) -> PointSums {
        let mut sums = [0.0; POINT_SUMS];
        for place in &self.of_station[self.starts[station] as usize..self.starts[station + 1] as usize] {
            let (cluster, lane) = (*place as usize / WIDEST, *place as usize % WIDEST);
            let rows = &self.out.points[cluster * POINT_SUMS * WIDEST + lane..];
            for row in 0..POINT_SUMS {
                sums[row] += f64::from(rows[row * WIDEST]);
            }
        }
        PointSums::of(sums)
    }

    /// Calls `add` with nodes, forces (as f_int) [N] and bounds [N/m] of the points of every cluster.
    pub fn at_corners(&self, mut add: impl FnMut(usize, DVec3, f64)) {
        let found = self.clusters.iter().zip(&self.out.clusters);
        for (cluster, (_, corners)) in found.filter(|(_, (found, _))| *found == Found::Known) {
            for (node, (force, bound)) in cluster.nodes.iter().zip(corners) {
                add(*node as usize, *force, *bound);
            }
        }
    }

    /// Adds the cells to the numbers of the nodes, which lie `stride` apart; derivatives of their energy by the path per pair of stations, and
    /// that energy [J]. What the caller has to compute is left out.
    pub fn cells_at_nodes(&self, numbers: &mut [f32], stride: usize) -> Vec<((u16, u16), PointSums)> {
        let mut spans: Vec<_> = self.spans.iter().map(|span| (*span, PointSums::default())).collect();
        let over_shaft = 1.0 / self.shaft;
        for (vector, cells) in self.cells.chunks(WIDEST).enumerate() {
            if self.out.vectors[vector] != Found::Known {
                continue;
            }
            let rows = &self.out.cells[vector * CELL_SUMS * WIDEST..][..CELL_SUMS * WIDEST];
            for (lane, cell) in cells.iter().enumerate() {
                let row = |row: usize| f64::from(rows[row * WIDEST + lane]);
                let vector = |first: usize| DVec3::new(row(first), row(first + 1), row(first + 2));
                let bound = rows[(CELL_SUMS - 1) * WIDEST + lane];
                let (place, sums) = (vector(9) * over_shaft, &mut spans[usize::from(cell.span)].1);
                if bound == 0.0 && row(15) == 0.0 {
                    continue;
                }
                sums.place += place;
                sums.centre_rate += vector(12);
                sums.radius += row(15) * over_shaft;
                sums.radius_rate += row(16);
                sums.energy += row(17);
                let by_axis = [vector(0) * cell.quarter.x, vector(3) * cell.quarter.y, vector(6) * cell.quarter.z];
                let middle = place * 0.125;
                for bits in 0..SIGNS {
                    let mut force = middle;
                    for axis in 0..3 {
                        force += if bits >> axis & 1 == 1 { by_axis[axis] } else { -by_axis[axis] };
                    }
                    let first = cell.numbers[bits] as usize;
                    for axis in 0..3 {
                        numbers[first + axis * stride] -= force[axis] as f32;
                    }
                    numbers[first + 3 * stride] += bound;
                }
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

/// What a step reads.
#[derive(Clone, Copy)]
struct Step<'a> {
    all: &'a LaneOpening,
    plan: &'a OpeningPlan,
    stations: &'a [Station],
    /// The path in cells.
    spans: &'a [Station],
    u: &'a [DVec3],
    measures: bool,
}

/// The path beside the lanes of a vector, entry by entry.
struct Gathered {
    offset: [[f32; WIDEST]; 3],
    rate: [[f32; WIDEST]; 3],
    radius: [f32; WIDEST],
    radius_rate: [f32; WIDEST],
    /// 1 where the path is open.
    open: [f32; WIDEST],
    is_any_open: bool,
}

impl Gathered {
    fn new() -> Self {
        let none = [0.0; WIDEST];
        Gathered { offset: [none; 3], rate: [none; 3], radius: none, radius_rate: none, open: none, is_any_open: false }
    }

    /// Takes in a station, seen from the place `at` [m].
    #[inline(always)]
    fn set(&mut self, lane: usize, station: &Station, at: DVec3, over_shaft: f64) {
        if station.radius == 0.0 {
            return;
        }
        let offset = (at - station.centre) * over_shaft;
        for axis in 0..3 {
            self.offset[axis][lane] = offset[axis] as f32;
            self.rate[axis][lane] = station.centre_rate[axis] as f32;
        }
        self.radius[lane] = (station.radius * over_shaft) as f32;
        self.radius_rate[lane] = station.radius_rate as f32;
        self.open[lane] = 1.0;
        self.is_any_open = true;
    }

    #[inline(always)]
    fn beside<S: Simd>(&self, simd: S, at: usize) -> Beside<Lanes<S>> {
        let vector = |rows: &[[f32; WIDEST]; 3]| {
            [Lanes::load(simd, &rows[0], at), Lanes::load(simd, &rows[1], at), Lanes::load(simd, &rows[2], at)]
        };
        Beside {
            offset: vector(&self.offset),
            centre_rate: vector(&self.rate),
            radius: Lanes::load(simd, &self.radius, at),
            radius_rate: Lanes::load(simd, &self.radius_rate, at),
        }
    }
}

struct SomeClusters<'a> {
    step: Step<'a>,
    first: usize,
    corners: &'a mut [(Found, [(DVec3, f64); SIGNS])],
    sums: &'a mut [f32],
}

impl WithSimd for SomeClusters<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomeClusters { step, first, corners, sums } = self;
        let map = step.plan.map.in_radii(Lanes::splat(simd, 0.0));
        for i in 0..corners.len() {
            let sums = &mut sums[i * POINT_SUMS * WIDEST..(i + 1) * POINT_SUMS * WIDEST];
            let (found, at_corners) = &mut corners[i];
            *found = cluster_forces(simd, &step, &map, first + i, (*found, sums), at_corners);
        }
    }
}

/// Forces of the points of a cluster; `before`: what the last step found there.
#[inline(always)]
fn cluster_forces<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    number: usize,
    (before, out): (Found, &mut [f32]),
    at_corners: &mut [(DVec3, f64); SIGNS],
) -> Found {
    let all = step.all;
    let cluster = &all.clusters[number];
    let Some(law) = &all.materials[cluster.material] else { return Found::Unknown };
    let over_shaft = 1.0 / all.shaft;
    let first = step.u[cluster.nodes[0] as usize];
    let mut path = Gathered::new();
    for lane in 0..cluster.count {
        let station = &step.stations[usize::from(cluster.stations[lane])];
        path.set(lane, station, cluster.origin + first, over_shaft);
    }
    if !path.is_any_open {
        if before != Found::Closed {
            out.fill(0.0);
        }
        return Found::Closed;
    }
    // u = sum of modes times products of the place in the cell, by the bits of its factors; in radii.
    let mut modes = [DVec3::ZERO; SIGNS];
    for bits in 1..SIGNS {
        modes[bits] = (step.u[cluster.nodes[bits] as usize] - first) * over_shaft;
    }
    let mut bit = 1;
    while bit < SIGNS {
        for bits in 0..SIGNS {
            if bits & bit != 0 {
                let low = modes[bits ^ bit];
                modes[bits] -= low;
            }
        }
        bit *= 2;
    }
    let zero = Lanes::splat(simd, 0.0);
    let mut u = [[zero; SIGNS]; 3];
    let (mut edges, mut over_edges) = ([zero; 3], [zero; 3]);
    for axis in 0..3 {
        for bits in 1..SIGNS {
            u[axis][bits] = Lanes::splat(simd, modes[bits][axis] as f32);
        }
        edges[axis] = Lanes::splat(simd, (cluster.edges[axis] * over_shaft) as f32);
        over_edges[axis] = Lanes::splat(simd, (all.shaft / cluster.edges[axis]) as f32);
    }
    let law = law.in_lanes(zero);
    let bulk = Lanes::splat(simd, all.bulk[cluster.material] as f32);
    let points = &all.points[number * POINT * WIDEST..(number + 1) * POINT * WIDEST];
    let mut by_modes = [[zero; SIGNS]; 3];
    let mut bounds = [zero; SIGNS];
    let mut at = 0;
    while at < cluster.count {
        let row = |row: usize| Lanes::load(simd, points, row * WIDEST + at);
        let [x, y, z] = [row(0), row(1), row(2)];
        let open = Lanes::load(simd, &path.open, at);
        let volume = row(3) * open;
        let [yz, zx, xy] = [y * z, z * x, x * y];
        let mut beside = path.beside(simd, at);
        let mut h = [[zero; 3]; 3];
        for axis in 0..3 {
            let m = &u[axis];
            let [m_xy, m_zx, m_yz, m_xyz] = [m[HOURGLASS[2]], m[HOURGLASS[1]], m[HOURGLASS[0]], m[HOURGLASS[3]]];
            let by_x = m_xyz.mul_add(yz, m_zx.mul_add(z, m_xy.mul_add(y, m[1])));
            let by_y = m_xyz.mul_add(zx, m_yz.mul_add(z, m_xy.mul_add(x, m[2])));
            let by_z = m_xyz.mul_add(xy, m_yz.mul_add(y, m_zx.mul_add(x, m[4])));
            let along = [x, y, z][axis].mul_add(edges[axis], beside.offset[axis]);
            let straight = m[4].mul_add(z, m[2].mul_add(y, m[1].mul_add(x, along)));
            beside.offset[axis] = m_xyz.mul_add(xy * z, m_yz.mul_add(yz, m_zx.mul_add(zx, m_xy.mul_add(xy, straight))));
            h[0][axis] = by_x * over_edges[0];
            h[1][axis] = by_y * over_edges[1];
            h[2][axis] = by_z * over_edges[2];
        }
        let Some(point) = opened(map, &beside, &h, &law, bulk, step.measures) else { return Found::Unknown };
        let Opened { d, energy, closed, straight, turned, by_gradient, by_place, distance } = point;
        let grown = distance.mul_add(by_place, by_gradient);
        let stiffness = (straight * grown * grown + turned * squared_norm_bound(&closed.cofactor())) * open;
        for corner in 0..SIGNS {
            bounds[corner] = stiffness.mul_add(row(4 + corner), bounds[corner]);
        }
        let rate = [d.centre_rate[0] * volume, d.centre_rate[1] * volume, d.centre_rate[2] * volume];
        let place = [d.place[0] * volume, d.place[1] * volume, d.place[2] * volume];
        let numbers = [d.radius * volume, d.radius_rate * volume, energy * volume];
        for axis in 0..3 {
            let p = place[axis];
            let [gx, gy, gz] = [
                d.gradient[0][axis] * volume * over_edges[0],
                d.gradient[1][axis] * volume * over_edges[1],
                d.gradient[2][axis] * volume * over_edges[2],
            ];
            let sums = &mut by_modes[axis];
            sums[0] = sums[0] + p;
            sums[1] = sums[1] + p.mul_add(x, gx);
            sums[2] = sums[2] + p.mul_add(y, gy);
            sums[4] = sums[4] + p.mul_add(z, gz);
            sums[3] = sums[3] + p.mul_add(xy, gx.mul_add(y, gy * x));
            sums[5] = sums[5] + p.mul_add(zx, gx.mul_add(z, gz * x));
            sums[6] = sums[6] + p.mul_add(yz, gy.mul_add(z, gz * y));
            sums[7] = sums[7] + (p * xy).mul_add(z, gx.mul_add(yz, gy.mul_add(zx, gz * xy)));
            (p * Lanes::splat(simd, over_shaft as f32)).store(out, axis * WIDEST + at);
            rate[axis].store(out, (3 + axis) * WIDEST + at);
        }
        (numbers[0] * Lanes::splat(simd, over_shaft as f32)).store(out, 6 * WIDEST + at);
        numbers[1].store(out, 7 * WIDEST + at);
        numbers[2].store(out, 8 * WIDEST + at);
        at += Lanes::<S>::COUNT;
    }
    // Back to the corners.
    let mut forces = [DVec3::ZERO; SIGNS];
    for bits in 0..SIGNS {
        for axis in 0..3 {
            forces[bits][axis] = f64::from(by_modes[axis][bits].sum()) * over_shaft;
        }
    }
    let mut bit = 1;
    while bit < SIGNS {
        for bits in 0..SIGNS {
            if bits & bit != 0 {
                let high = forces[bits];
                forces[bits ^ bit] -= high;
            }
        }
        bit *= 2;
    }
    for bits in 0..SIGNS {
        at_corners[bits] = (forces[bits], f64::from(bounds[bits].sum()));
    }
    Found::Known
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

struct SomeCells<'a> {
    step: Step<'a>,
    first: usize,
    found: &'a mut [Found],
    sums: &'a mut [f32],
}

impl WithSimd for SomeCells<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomeCells { step, first, found, sums } = self;
        let map = step.plan.map.in_radii(Lanes::splat(simd, 0.0));
        for i in 0..found.len() {
            let sums = &mut sums[i * CELL_SUMS * WIDEST..(i + 1) * CELL_SUMS * WIDEST];
            found[i] = cell_vector(simd, &step, &map, first + i, sums);
        }
    }
}

/// Cells from `number` times [`WIDEST`] on.
#[inline(always)]
fn cell_vector<S: Simd>(simd: S, step: &Step, map: &MapIn<Lanes<S>>, number: usize, out: &mut [f32]) -> Found {
    let all = step.all;
    let cells = &all.cells[number * WIDEST..((number + 1) * WIDEST).min(all.cells.len())];
    let over_shaft = 1.0 / all.shaft;
    let mut path = Gathered::new();
    let mut gradients = [[[0.0f32; WIDEST]; 3]; 3];
    for lane in 0..cells.len() {
        let cell = &cells[lane];
        let span = &step.spans[usize::from(cell.span)];
        if span.radius == 0.0 {
            continue;
        }
        let mut u = [DVec3::ZERO; SIGNS];
        for bits in 0..SIGNS {
            u[bits] = step.u[cell.nodes[bits] as usize];
        }
        let (e0, e1, e2, e3) = (u[0] + u[1], u[2] + u[3], u[4] + u[5], u[6] + u[7]);
        let by_x = ((u[1] - u[0]) + (u[3] - u[2])) + ((u[5] - u[4]) + (u[7] - u[6]));
        let (by_y, by_z) = ((e1 - e0) + (e3 - e2), (e2 - e0) + (e3 - e1));
        let columns = [by_x * cell.quarter.x, by_y * cell.quarter.y, by_z * cell.quarter.z];
        for a in 0..3 {
            for b in 0..3 {
                gradients[a][b][lane] = columns[a][b] as f32;
            }
        }
        path.set(lane, span, cell.middle + ((e0 + e1) + (e2 + e3)) * 0.125, over_shaft);
    }
    if !path.is_any_open {
        return Found::Closed;
    }
    let constants = &all.constants[number * CELL * WIDEST..(number + 1) * CELL * WIDEST];
    let mut at = 0;
    while at < cells.len() {
        if !cell_lanes(simd, step, map, (constants, &path, &gradients), at, out) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    Found::Known
}

/// Adds what acts at the place `offset` from the middle of a cell.
#[inline(always)]
fn add_at<N: Number>(sum: &mut Derivatives<N>, place: [N; 3], offset: [N; 3]) {
    let by_offset = outer(place, offset);
    for a in 0..3 {
        sum.place[a] = sum.place[a] + place[a];
        for b in 0..3 {
            sum.gradient[a][b] = sum.gradient[a][b] + by_offset[a][b];
        }
    }
}

/// One vector of cells; false where one has left the range of these forms.
#[inline(always)]
fn cell_lanes<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    (constants, path, gradients): (&[f32], &Gathered, &[[[f32; WIDEST]; 3]; 3]),
    at: usize,
    out: &mut [f32],
) -> bool {
    let all = step.all;
    let row = |row: usize| Lanes::load(simd, constants, row * WIDEST + at);
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let open_lanes = Lanes::load(simd, &path.open, at);
    let [width, place] = [[row(0), row(1), row(2)], [row(3), row(4), row(5)]];
    let (volume, share, edge, b_squared) = (row(6) * open_lanes, row(7), row(8), row(9));
    let law = Constants {
        c1: row(10),
        c2: row(11),
        c3: row(12),
        c01: row(13),
        is_linear: all.is_linear,
        has_c01: all.has_c01,
    };
    let bulk = row(14);
    let mut h = [[zero; 3]; 3];
    for a in 0..3 {
        for b in 0..3 {
            h[a][b] = Lanes::load(simd, &gradients[a][b], at);
        }
    }
    let middle = path.beside(simd, at);
    // (I + h) applied to a place in the cell.
    let mut sum = Derivatives::none(zero);
    let mut offset = [zero; 3];
    for a in 0..3 {
        offset[a] = place[a]
            + h[2][a].mul_add(place[2], h[1][a].mul_add(place[1], h[0][a].mul_add(place[0], middle.offset[a])));
    }
    let Some(shape) = opened(map, &Beside { offset, ..middle }, &h, &law, bulk, step.measures) else { return false };
    let closed = &shape.closed;
    let [closed_straight, closed_turned] = closed.tangent_bound(&law, bulk);
    let shared = volume * share;
    sum.add(&Derivatives { place: [zero; 3], ..shape.d }, shared);
    let by_place = [shape.d.place[0] * shared, shape.d.place[1] * shared, shape.d.place[2] * shared];
    add_at(&mut sum, by_place, place);
    let mut energy = shape.energy * shared;
    // Where points carry all of the shape nothing grows.
    let little = Lanes::splat(simd, 1e-9);
    let grown = share.choose(little, one, edge.mul_add(shape.by_place, shape.by_gradient).larger(one));
    let straight = share.choose(little, closed_straight, closed_straight.larger(shape.straight));
    let turned = share.choose(little, closed_turned, closed_turned.larger(shape.turned));
    // The volume is the cell's, at four places.
    let mut offsets = [[zero; 3]; 4];
    let mut found = 0;
    for corner in 0..SIGNS {
        if is_volume_place(corner) {
            for axis in 0..3 {
                offsets[found][axis] =
                    width[axis] * Lanes::splat(simd, (0.5 * VOLUME_PLACE * CORNERS[corner][axis]) as f32);
            }
            found += 1;
        }
    }
    let mut dilations = [map.dilation(middle.offset, zero); 4];
    let mut less = zero;
    for i in 0..4 {
        let o = offsets[i];
        let mut seen = middle.offset;
        for a in 0..3 {
            seen[a] = o[a] + h[2][a].mul_add(o[2], h[1][a].mul_add(o[1], h[0][a].mul_add(o[0], seen[a])));
        }
        dilations[i] = map.dilation(seen, middle.radius);
        less = less + dilations[i].less_one;
    }
    let quarter = Lanes::splat(simd, 0.25);
    less = less * quarter;
    let dj = closed.dj;
    let j = one + dj;
    let open = dj + less.mul_add(dj, less);
    energy = (volume * quarter * (bulk + bulk)).mul_add((open - dj) * (open + dj), energy);
    let cofactor = closed.cofactor();
    let by_cofactor = bulk * less * (j + open) * volume;
    for a in 0..3 {
        for b in 0..3 {
            sum.gradient[a][b] = cofactor[a][b].mul_add(by_cofactor, sum.gradient[a][b]);
        }
    }
    let pressure = bulk * open * j * volume * quarter;
    for i in 0..4 {
        let (place, radius) = dilations[i].pull_back(pressure);
        add_at(&mut sum, place, offsets[i]);
        sum.radius = sum.radius + radius;
    }
    let cof_b = squared_norm_bound(&cofactor) * b_squared;
    let widened = (one + less).larger(one);
    let with = (bulk + turned) * cof_b * widened * widened + straight * grown * grown * b_squared;
    let without = (bulk + closed_turned) * cof_b + closed_straight * b_squared;
    let bound = Lanes::splat(simd, 8.0) * volume * (with - without).larger(zero);
    for a in 0..3 {
        for b in 0..3 {
            sum.gradient[a][b].store(out, (3 * a + b) * WIDEST + at);
        }
        sum.place[a].store(out, (9 + a) * WIDEST + at);
        sum.centre_rate[a].store(out, (12 + a) * WIDEST + at);
    }
    sum.radius.store(out, 15 * WIDEST + at);
    sum.radius_rate.store(out, 16 * WIDEST + at);
    energy.store(out, 17 * WIDEST + at);
    bound.store(out, 18 * WIDEST + at);
    true
}
