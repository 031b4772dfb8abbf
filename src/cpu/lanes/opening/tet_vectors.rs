//! Points in tetrahedra and tetrahedra around an opened path, vector by vector.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::{Simd, WithSimd};

use super::cells::add_at;
use super::sums::{ChunkSums, SUMS};
use super::tets::{AtCorners, CELL, CORNER_ROWS, POINT, RUN_SUMS, Step, Tet};
use super::{Found, Gathered, Lanes, ROOM, STRIDES, opened};
use crate::cpu::lanes::WIDEST;
use crate::cpu::lanes::corners::GRADIENT;
use crate::needle::opening::{Beside, Derivatives, MapIn, squared_norm_bound};
use crate::number::{Number, Tensor};

/// First rows of the law, of the growth, of the places of the volume and of the gradients of a tetrahedron.
const LAW: usize = 6;
const GROWTH: usize = 11;
const PLACES: usize = 13;
const GRADIENTS: usize = 25;

/// Rows that vectors share one after the other: what a vector leaves in them behind its lanes is not read, or zero.
struct Scratch {
    path: Gathered,
    /// Displacement gradient, and averaged pressure [Pa].
    h: [[f32; ROOM]; GRADIENT],
    pressure: [f32; WIDEST],
    summed: [[f32; ROOM]; RUN_SUMS],
    of_lanes: [[f32; WIDEST]; SUMS],
}

impl Scratch {
    fn new() -> Self {
        Scratch {
            path: Gathered::new(),
            h: [[0.0; ROOM]; GRADIENT],
            pressure: [0.0; WIDEST],
            summed: [[0.0; ROOM]; RUN_SUMS],
            of_lanes: [[0.0; WIDEST]; SUMS],
        }
    }
}

/// Where the middle of a tetrahedron is [m].
#[inline(always)]
fn middle_of(step: &Step, tet: &Tet) -> glam::DVec3 {
    let [a, b, c, d] = tet.nodes.map(|node| step.u[node as usize]);
    tet.middle + ((a + b) + (c + d)) * 0.25
}

/// H of a vector.
#[inline(always)]
fn gradient_at<S: Simd>(simd: S, h: &[[f32; ROOM]; GRADIENT], at: usize) -> Tensor<Lanes<S>> {
    let row = |row: usize| Lanes::load(simd, &h[row], at);
    [[row(0), row(1), row(2)], [row(3), row(4), row(5)], [row(6), row(7), row(8)]]
}

/// `offset + (I + h) place`.
#[inline(always)]
fn seen<N: Number>(h: &Tensor<N>, place: [N; 3], offset: [N; 3]) -> [N; 3] {
    let mut seen = offset;
    for a in 0..3 {
        let moved = h[2][a].mul_add(place[2], h[1][a].mul_add(place[1], h[0][a].mul_add(place[0], seen[a])));
        seen[a] = place[a] + moved;
    }
    seen
}

pub(super) struct SomePoints<'a> {
    pub step: Step<'a>,
    /// Number of the first vector.
    pub first: usize,
    pub found: &'a mut [Found],
    /// Of the runs of these vectors.
    pub runs: &'a mut [AtCorners],
    pub sums: ChunkSums<'a>,
}

impl WithSimd for SomePoints<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomePoints { step, first, found, runs, mut sums } = self;
        let map = step.map.in_radii(Lanes::splat(simd, 0.0));
        let all = step.all;
        let first_run = all.vectors[first].first_run;
        let mut scratch = Scratch::new();
        if found.iter().any(|found| *found != Found::Closed) {
            sums.clear();
        }
        for i in 0..found.len() {
            let vector = &all.vectors[first + i];
            let end =
                if first + i + 1 < all.vectors.len() { all.vectors[first + i + 1].first_run } else { all.runs.len() };
            let runs = &mut runs[vector.first_run - first_run..end - first_run];
            let was_known = found[i] == Found::Known;
            found[i] = point_vector(simd, &step, &map, first + i, runs, &mut scratch);
            if found[i] == Found::Known {
                for lane in 0..vector.count {
                    sums.add(usize::from(vector.stations[lane]), &scratch.of_lanes, lane);
                }
            } else if was_known {
                // Nodes add up all runs.
                runs.fill(AtCorners::default());
            }
        }
    }
}

/// Forces of a vector of points.
#[inline(always)]
fn point_vector<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    number: usize,
    at_corners: &mut [AtCorners],
    scratch: &mut Scratch,
) -> Found {
    let all = step.all;
    let vector = &all.vectors[number];
    let runs = &all.runs[vector.first_run..vector.first_run + at_corners.len()];
    let over_shaft = 1.0 / all.shaft;
    let mut is_open = false;
    for lane in 0..vector.count {
        is_open |= step.stations[usize::from(vector.stations[lane])].is_open;
    }
    if !is_open {
        return Found::Closed;
    }
    if !vector.is_known {
        return Found::Unknown;
    }
    for lane in vector.count..WIDEST {
        scratch.path.close(lane);
    }
    for run in runs {
        let middle = middle_of(step, &run.tet);
        for lane in run.lanes.start..run.lanes.end {
            scratch.path.set(lane, &step.stations[usize::from(vector.stations[lane])], middle, over_shaft);
        }
        // The lanes behind the run are those of the next ones, which come later.
        for entry in 0..GRADIENT {
            let value = step.tets.gradients[run.tet.gradient as usize + entry * WIDEST];
            scratch.h[entry][run.lanes.start..run.lanes.start + WIDEST].copy_from_slice(&[value; WIDEST]);
        }
    }
    let points = &all.points[number * POINT * WIDEST..(number + 1) * POINT * WIDEST];
    let mut at = 0;
    while at < vector.count {
        if !point_lanes(simd, step, map, points, at, scratch) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    // The first lane of a run gets its sum: of lanes side by side, of pairs, of fours and of eights.
    for (stride, same_run) in STRIDES.into_iter().zip(&vector.same_run) {
        for row in scratch.summed.iter_mut() {
            let mut sums = [0.0f32; WIDEST];
            for lane in 0..WIDEST {
                sums[lane] = row[lane + stride].mul_add(same_run[lane], row[lane]);
            }
            row[..WIDEST].copy_from_slice(&sums);
        }
    }
    let quarter = 0.25 * over_shaft as f32;
    for (run, at_corners) in runs.iter().zip(at_corners) {
        let value = |row: usize| scratch.summed[row][run.lanes.start];
        let lengths = run.lengths[0] + run.lengths[1] + (run.lengths[2] + run.lengths[3]);
        for corner in 0..4 {
            let [bx, by, bz] = run.gradients[corner];
            for axis in 0..3 {
                let by_gradient = value(3 + axis) * bx + value(6 + axis) * by + value(9 + axis) * bz;
                at_corners[corner][axis] = value(axis).mul_add(quarter, by_gradient);
            }
            at_corners[corner][3] = value(12) * run.lengths[corner] * lengths;
        }
    }
    Found::Known
}

/// One vector of points; false where one has left the range of these forms.
#[inline(always)]
fn point_lanes<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    points: &[f32],
    at: usize,
    Scratch { path, h, summed, of_lanes, .. }: &mut Scratch,
) -> bool {
    let all = step.all;
    let over_shaft = Lanes::splat(simd, (1.0 / all.shaft) as f32);
    let row = |row: usize| Lanes::load(simd, points, row * WIDEST + at);
    let place = [row(0), row(1), row(2)];
    let law = all.laws.in_lanes(simd, points, 4, at);
    let h = gradient_at(simd, h, at);
    let mut beside = path.beside(simd, at);
    beside.offset = seen(&h, place, beside.offset);
    let Some(point) = opened(map, &beside, &h, &law, row(8), step.measures) else { return false };
    let grown = point.distance.mul_add(point.by_place, point.by_gradient);
    let turned = point.turned * squared_norm_bound(&point.closed.cofactor());
    let stiffness = (point.straight * grown * grown + turned) * row(3) * path.open(simd, at);
    stiffness.store(&mut summed[12], at);
    let volume = row(3) * path.left(simd, at);
    let d = &point.d;
    for axis in 0..3 {
        let p = d.place[axis] * volume;
        p.store(&mut summed[axis], at);
        for a in 0..3 {
            p.mul_add(place[a], d.gradient[a][axis] * volume).store(&mut summed[3 + 3 * a + axis], at);
        }
        (p * over_shaft).store(&mut of_lanes[axis], at);
        (d.centre_rate[axis] * volume).store(&mut of_lanes[3 + axis], at);
    }
    (d.radius * volume * over_shaft).store(&mut of_lanes[6], at);
    (d.radius_rate * volume).store(&mut of_lanes[7], at);
    (point.energy * volume).store(&mut of_lanes[8], at);
    true
}

pub(super) struct SomeCells<'a> {
    pub step: Step<'a>,
    /// Number of the first vector.
    pub first: usize,
    pub found: &'a mut [Found],
    /// [`CORNER_ROWS`] rows of every vector.
    pub corners: &'a mut [f32],
    pub sums: ChunkSums<'a>,
}

impl WithSimd for SomeCells<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomeCells { step, first, found, corners, mut sums } = self;
        let map = step.map.in_radii(Lanes::splat(simd, 0.0));
        let all = step.all;
        let mut scratch = Scratch::new();
        if found.iter().any(|found| *found != Found::Closed) {
            sums.clear();
        }
        for i in 0..found.len() {
            let corners = &mut corners[i * CORNER_ROWS * WIDEST..(i + 1) * CORNER_ROWS * WIDEST];
            found[i] = cell_vector(simd, &step, &map, first + i, corners, &mut scratch);
            if found[i] == Found::Known {
                let cells = &all.cells[(first + i) * WIDEST..((first + i + 1) * WIDEST).min(all.cells.len())];
                for lane in 0..cells.len() {
                    sums.add(usize::from(cells[lane].span), &scratch.of_lanes, lane);
                }
            }
        }
    }
}

/// Gathers what the tetrahedra from `number` times [`WIDEST`] on are; false where none of them is open.
#[inline(always)]
fn gather_cells(step: &Step, number: usize, scratch: &mut Scratch) -> bool {
    let all = step.all;
    let cells = &all.cells[number * WIDEST..((number + 1) * WIDEST).min(all.cells.len())];
    let mut is_any_open = false;
    for lane in 0..cells.len() {
        is_any_open |= step.spans[usize::from(cells[lane].span)].is_open;
    }
    if !is_any_open {
        return false;
    }
    let over_shaft = 1.0 / all.shaft;
    for lane in 0..cells.len() {
        let cell = &cells[lane];
        scratch.path.set(lane, &step.spans[usize::from(cell.span)], middle_of(step, &cell.tet), over_shaft);
        for entry in 0..GRADIENT {
            scratch.h[entry][lane] = step.tets.gradients[cell.tet.gradient as usize + entry * WIDEST];
        }
    }
    for lane in cells.len()..WIDEST {
        scratch.path.close(lane);
        for entry in 0..GRADIENT {
            scratch.h[entry][lane] = 0.0;
        }
    }
    true
}

/// Tetrahedra from `number` times [`WIDEST`] on.
#[inline(always)]
fn cell_vector<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    number: usize,
    corners: &mut [f32],
    scratch: &mut Scratch,
) -> Found {
    let all = step.all;
    if !gather_cells(step, number, scratch) {
        return Found::Closed;
    }
    if !all.is_known[number] {
        return Found::Unknown;
    }
    let cells = &all.cells[number * WIDEST..((number + 1) * WIDEST).min(all.cells.len())];
    for lane in 0..cells.len() {
        let [a, b, c, d] = cells[lane].tet.nodes.map(|node| step.tets.pressures[node as usize]);
        scratch.pressure[lane] = ((a + b) + (c + d)) * 0.25;
    }
    let constants = &all.constants[number * CELL * WIDEST..(number + 1) * CELL * WIDEST];
    let mut at = 0;
    while at < cells.len() {
        if !cell_lanes(simd, step, map, constants, at, (corners, scratch)) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    Found::Known
}

/// Gradients of the corners of a vector of tetrahedra [1/m].
#[inline(always)]
fn corner_gradients<S: Simd>(simd: S, constants: &[f32], at: usize) -> [[Lanes<S>; 3]; 4] {
    let row = |row: usize| Lanes::load(simd, constants, (GRADIENTS + row) * WIDEST + at);
    let zero = Lanes::splat(simd, 0.0);
    let [b, c, d] = [[row(0), row(1), row(2)], [row(3), row(4), row(5)], [row(6), row(7), row(8)]];
    let mut a = [zero; 3];
    for axis in 0..3 {
        a[axis] = zero - (b[axis] + c[axis] + d[axis]);
    }
    [a, b, c, d]
}

/// One vector of tetrahedra; false where one has left the range of these forms.
#[inline(always)]
fn cell_lanes<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    constants: &[f32],
    at: usize,
    (corners, Scratch { path, h, pressure, of_lanes, .. }): (&mut [f32], &mut Scratch),
) -> bool {
    let all = step.all;
    let row = |row: usize| Lanes::load(simd, constants, row * WIDEST + at);
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let open_lanes = path.open(simd, at);
    let place = [row(0), row(1), row(2)];
    let (volume, share, edge) = (row(3) * open_lanes, row(4), row(5));
    let law = all.laws.in_lanes(simd, constants, LAW, at);
    let bulk = row(LAW + 4);
    let (over_shaft, quarter) = (Lanes::splat(simd, (1.0 / all.shaft) as f32), Lanes::splat(simd, 0.25));
    let h = gradient_at(simd, h, at);
    let middle = path.beside(simd, at);
    let offset = seen(&h, place, middle.offset);
    let Some(shape) = opened(map, &Beside { offset, ..middle }, &h, &law, bulk, step.measures) else { return false };
    let closed = &shape.closed;
    let [closed_straight, closed_turned] = closed.tangent_bound(&law, bulk);
    let shared = volume * share * path.left(simd, at);
    let mut sum = Derivatives::none(zero);
    sum.add(&Derivatives { place: [zero; 3], ..shape.d }, shared);
    let by_place = [shape.d.place[0] * shared, shape.d.place[1] * shared, shape.d.place[2] * shared];
    add_at(&mut sum, by_place, place);
    let (mut energy, intact) = (shape.energy * shared, shape.energy * (volume * share));
    // Where points carry all of the shape nothing grows.
    let little = Lanes::splat(simd, 1e-9);
    let grown = share.choose(little, one, edge.mul_add(shape.by_place, shape.by_gradient).larger(one));
    let straight = share.choose(little, closed_straight, closed_straight.larger(shape.straight));
    let turned = share.choose(little, closed_turned, closed_turned.larger(shape.turned));
    // The volume is that of the nodes around it, with what opening adds at four places.
    let (rc, grows, varies) = (middle.radius, row(GROWTH), row(GROWTH + 1));
    let mut less = rc * rc * grows;
    let mut dilations = [map.dilation(middle.offset, zero, &middle.growth); 4];
    for i in 0..4 {
        let o = [row(PLACES + 3 * i), row(PLACES + 3 * i + 1), row(PLACES + 3 * i + 2)];
        dilations[i] = map.dilation(seen(&h, o, middle.offset), rc, &middle.growth);
        less = less + dilations[i].less_one * quarter;
    }
    let uneven = rc * rc * rc * rc * varies;
    let j = one + closed.dj;
    let beyond = bulk * j * uneven;
    energy = (volume * j * Lanes::splat(simd, 0.5)).mul_add(beyond, energy);
    let cofactor = closed.cofactor();
    let pressure = Lanes::load(simd, pressure, at);
    let by_cofactor = pressure.mul_add(less, beyond) * volume;
    let by_radius = pressure.mul_add(grows, bulk * j * rc * rc * varies);
    sum.radius = ((rc + rc) * volume * j).mul_add(by_radius, sum.radius);
    for a in 0..3 {
        for b in 0..3 {
            sum.gradient[a][b] = cofactor[a][b].mul_add(by_cofactor, sum.gradient[a][b]);
        }
    }
    let by_dilation = pressure * j * volume * quarter;
    for i in 0..4 {
        let o = [row(PLACES + 3 * i), row(PLACES + 3 * i + 1), row(PLACES + 3 * i + 2)];
        let (place, radius) = dilations[i].pull_back(by_dilation);
        add_at(&mut sum, place, o);
        sum.radius = sum.radius + radius;
    }
    // Forces and bounds on the corners: rows of the stiffness of its own.
    let b = corner_gradients(simd, constants, at);
    let (mut lengths, mut turned_lengths) = ([zero; 4], [zero; 4]);
    let (mut all_lengths, mut all_turned) = (zero, zero);
    for corner in 0..4 {
        let b = b[corner];
        let mut square = zero;
        for axis in 0..3 {
            let of_axis = cofactor[0][axis].mul_add(b[0], cofactor[1][axis].mul_add(b[1], cofactor[2][axis] * b[2]));
            square = of_axis.mul_add(of_axis, square);
        }
        lengths[corner] = b[0].mul_add(b[0], b[1].mul_add(b[1], b[2] * b[2])).root();
        turned_lengths[corner] = square.root();
        all_lengths = all_lengths + lengths[corner];
        all_turned = all_turned + turned_lengths[corner];
    }
    let widened = (one + less).larger(one);
    let widened = widened.mul_add(widened, uneven);
    let of_turned = (bulk + turned) * widened - (bulk + closed_turned);
    let of_straight = straight * grown * grown - closed_straight;
    for corner in 0..4 {
        for axis in 0..3 {
            let mut force = sum.place[axis] * over_shaft * quarter;
            for a in 0..3 {
                force = sum.gradient[a][axis].mul_add(b[corner][a], force);
            }
            force.store(corners, (4 * corner + axis) * WIDEST + at);
        }
        let more =
            (of_turned * turned_lengths[corner]).mul_add(all_turned, of_straight * lengths[corner] * all_lengths);
        (volume * more.larger(zero)).store(corners, (4 * corner + 3) * WIDEST + at);
    }
    let mut put = |value: Lanes<S>, row: usize| value.store(&mut of_lanes[row], at);
    for a in 0..3 {
        put(sum.place[a] * over_shaft, a);
        put(sum.centre_rate[a], 3 + a);
    }
    put(sum.radius * over_shaft, 6);
    put(sum.radius_rate, 7);
    put(energy, 8);
    put(intact, 12);
    true
}

/// By what part of their volume tetrahedra grow, and a quarter of their volume [m^3].
pub(super) struct SomeDilations<'a> {
    pub step: Step<'a>,
    /// Number of the first vector, and how many.
    pub first: usize,
    pub count: usize,
}

impl WithSimd for SomeDilations<'_> {
    type Output = [[[f32; 2]; WIDEST]; super::CHUNK];

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let SomeDilations { step, first, count } = self;
        let map = step.map.in_radii(Lanes::splat(simd, 0.0));
        let mut scratch = Scratch::new();
        let mut found = [[[0.0; 2]; WIDEST]; super::CHUNK];
        let quarter = Lanes::splat(simd, 0.25);
        for i in 0..count {
            if !gather_cells(&step, first + i, &mut scratch) {
                continue;
            }
            let constants = &step.all.constants[(first + i) * CELL * WIDEST..(first + i + 1) * CELL * WIDEST];
            let mut at = 0;
            while at < WIDEST {
                let row = |row: usize| Lanes::load(simd, constants, row * WIDEST + at);
                let h = gradient_at(simd, &scratch.h, at);
                let middle = scratch.path.beside(simd, at);
                let mut less = middle.radius * middle.radius * row(GROWTH);
                for i in 0..4 {
                    let o = [row(PLACES + 3 * i), row(PLACES + 3 * i + 1), row(PLACES + 3 * i + 2)];
                    let dilation = map.dilation(seen(&h, o, middle.offset), middle.radius, &middle.growth);
                    less = less + dilation.less_one * quarter;
                }
                let mut rows = [[0.0f32; WIDEST]; 2];
                (less * scratch.path.open(simd, at)).store(&mut rows[0], 0);
                (row(3) * quarter).store(&mut rows[1], 0);
                for lane in 0..Lanes::<S>::COUNT {
                    found[i][at + lane] = [rows[0][lane], rows[1][lane]];
                }
                at += Lanes::<S>::COUNT;
            }
        }
        found
    }
}
