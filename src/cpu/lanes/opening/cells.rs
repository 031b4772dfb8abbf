//! Cells around an opened path in lanes.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::{Simd, WithSimd};

use super::sums::{ChunkSums, SUMS};
use super::{CELL, CORNER_ROWS, Found, Gathered, Lanes, Step, moment_of, opened};
use crate::cpu::lanes::WIDEST;
use crate::cpu::lanes::corners::SIGNS;
use crate::mesh::CORNERS;
use crate::model::opening::{VOLUME_PLACE, is_volume_place};
use crate::needle::opening::{Beside, Derivatives, MapIn, outer, squared_norm_bound};
use crate::number::Number;

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
        let mut scratch =
            Scratch { path: Gathered::new(), from_first: [[[0.0; WIDEST]; 3]; SIGNS], of_lanes: [[0.0; WIDEST]; SUMS] };
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

/// Rows that vectors share one after the other.
struct Scratch {
    path: Gathered,
    /// Displacements of the corners less that of the first [m].
    from_first: [[[f32; WIDEST]; 3]; SIGNS],
    of_lanes: [[f32; WIDEST]; SUMS],
}

/// Cells from `number` times [`WIDEST`] on.
#[inline(always)]
fn cell_vector<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    number: usize,
    corners: &mut [f32],
    Scratch { path, from_first, of_lanes }: &mut Scratch,
) -> Found {
    let all = step.all;
    let cells = &all.cells[number * WIDEST..((number + 1) * WIDEST).min(all.cells.len())];
    let mut is_any_open = false;
    for lane in 0..cells.len() {
        is_any_open |= step.spans[usize::from(cells[lane].span)].is_open;
    }
    if !is_any_open {
        return Found::Closed;
    }
    if !all.is_known[number] {
        return Found::Unknown;
    }
    let over_shaft = 1.0 / all.shaft;
    for lane in 0..cells.len() {
        let cell = &cells[lane];
        let first = step.u[cell.nodes[0] as usize];
        path.set(lane, &step.spans[usize::from(cell.span)], cell.middle + first, over_shaft);
        for bits in 1..SIGNS {
            let other = step.u[cell.nodes[bits] as usize];
            from_first[bits][0][lane] = (other.x - first.x) as f32;
            from_first[bits][1][lane] = (other.y - first.y) as f32;
            from_first[bits][2][lane] = (other.z - first.z) as f32;
        }
    }
    for lane in cells.len()..WIDEST {
        path.close(lane);
        for bits in 1..SIGNS {
            for axis in 0..3 {
                from_first[bits][axis][lane] = 0.0;
            }
        }
    }
    let constants = &all.constants[number * CELL * WIDEST..(number + 1) * CELL * WIDEST];
    let mut at = 0;
    while at < cells.len() {
        if !cell_lanes(simd, step, map, (constants, path, from_first), at, (corners, of_lanes)) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    Found::Known
}

/// Adds what acts at the place `offset` from the middle of a cell.
#[inline(always)]
pub(super) fn add_at<N: Number>(sum: &mut Derivatives<N>, place: [N; 3], offset: [N; 3]) {
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
    (constants, path, from_first): (&[f32], &Gathered, &[[[f32; WIDEST]; 3]; SIGNS]),
    at: usize,
    (corners, of_lanes): (&mut [f32], &mut [[f32; WIDEST]; SUMS]),
) -> bool {
    let all = step.all;
    let row = |row: usize| Lanes::load(simd, constants, row * WIDEST + at);
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let open_lanes = path.open(simd, at);
    let [width, place] = [[row(0), row(1), row(2)], [row(3), row(4), row(5)]];
    let (volume, share, edge, b_squared) = (row(6) * open_lanes, row(7), row(8), row(9));
    let law = all.laws.in_lanes(simd, constants, 10, at);
    let bulk = row(14);
    let quarters = [row(17), row(18), row(19)];
    let (over_shaft, eighth) = (Lanes::splat(simd, (1.0 / all.shaft) as f32), Lanes::splat(simd, 0.125));
    let mut h = [[zero; 3]; 3];
    let mut middle = path.beside(simd, at);
    for axis in 0..3 {
        let d = |bits: usize| Lanes::load(simd, &from_first[bits][axis], at);
        let [d1, d2, d3, d4, d5, d6, d7] = [d(1), d(2), d(3), d(4), d(5), d(6), d(7)];
        // Differences and sums of the four edges along x.
        let (x0, x1, x2, x3) = (d1, d3 - d2, d5 - d4, d7 - d6);
        let (e0, e1, e2, e3) = (d1, d2 + d3, d4 + d5, d6 + d7);
        h[0][axis] = ((x0 + x1) + (x2 + x3)) * quarters[0];
        h[1][axis] = ((e1 - e0) + (e3 - e2)) * quarters[1];
        h[2][axis] = ((e2 - e0) + (e3 - e1)) * quarters[2];
        let mean = ((e0 + e1) + (e2 + e3)) * eighth;
        middle.offset[axis] = mean.mul_add(over_shaft, middle.offset[axis]);
    }
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
    let shared = volume * share * path.left(simd, at);
    sum.add(&Derivatives { place: [zero; 3], ..shape.d }, shared);
    let by_place = [shape.d.place[0] * shared, shape.d.place[1] * shared, shape.d.place[2] * shared];
    add_at(&mut sum, by_place, place);
    let (mut energy, intact) = (shape.energy * shared, shape.energy * (volume * share));
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
    let mut dilations = [map.dilation(middle.offset, zero, &middle.growth); 4];
    let mut less = zero;
    for i in 0..4 {
        let o = offsets[i];
        let mut seen = middle.offset;
        for a in 0..3 {
            seen[a] = o[a] + h[2][a].mul_add(o[2], h[1][a].mul_add(o[1], h[0][a].mul_add(o[0], seen[a])));
        }
        dilations[i] = map.dilation(seen, middle.radius, &middle.growth);
        less = less + dilations[i].less_one;
    }
    let quarter = Lanes::splat(simd, 0.25);
    let (rc, grows, varies) = (middle.radius, row(15), row(16));
    let uneven = rc * rc * rc * rc * varies;
    less = less.mul_add(quarter, rc * rc * grows);
    let dj = closed.dj;
    let j = one + dj;
    let open = dj + less.mul_add(dj, less);
    energy = (volume * quarter * (bulk + bulk)).mul_add((j * j).mul_add(uneven, (open - dj) * (open + dj)), energy);
    let cofactor = closed.cofactor();
    let by_cofactor = bulk * less.mul_add(j + open, j * uneven) * volume;
    sum.radius = (bulk + bulk).mul_add(volume * rc * j * open.mul_add(grows, j * rc * rc * varies), sum.radius);
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
    let with = (bulk + turned) * cof_b * widened.mul_add(widened, uneven) + straight * grown * grown * b_squared;
    let without = (bulk + closed_turned) * cof_b + closed_straight * b_squared;
    let bound = Lanes::splat(simd, 8.0) * volume * (with - without).larger(zero);
    // Forces on the corners: the gradient of y is that of the middle of the cell.
    for axis in 0..3 {
        let middle = sum.place[axis] * over_shaft * eighth;
        let by = |a: usize| sum.gradient[a][axis] * quarters[a];
        let [by_x, by_y, by_z] = [by(0), by(1), by(2)];
        let along_x = [middle - by_x, middle + by_x];
        for bits in 0..SIGNS {
            let mut force = along_x[bits & 1];
            force = if bits & 2 == 0 { force - by_y } else { force + by_y };
            force = if bits & 4 == 0 { force - by_z } else { force + by_z };
            force.store(corners, (3 * bits + axis) * WIDEST + at);
        }
    }
    bound.store(corners, (CORNER_ROWS - 1) * WIDEST + at);
    let mut put = |value: Lanes<S>, row: usize| value.store(&mut of_lanes[row], at);
    for a in 0..3 {
        put(sum.place[a] * over_shaft, a);
        put(sum.centre_rate[a], 3 + a);
    }
    put(sum.radius * over_shaft, 6);
    put(sum.radius_rate, 7);
    put(energy, 8);
    put(intact, 12);
    if all.turns {
        let moment = moment_of(&h, middle.offset, &sum.gradient, sum.place);
        for a in 0..3 {
            put(moment[a], 9 + a);
        }
    }
    true
}
