//! Cells around an opened path in lanes.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::{CELL, CELL_SUMS, CORNER_FORCES, Cell, Found, Gathered, Lanes, Step, law_in_lanes, moment_of, opened};
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
    pub sums: &'a mut [f32],
}

impl WithSimd for SomeCells<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomeCells { step, first, found, sums } = self;
        let map = step.map.in_radii(Lanes::splat(simd, 0.0));
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
    if !all.is_known[number] {
        return Found::Unknown;
    }
    let constants = &all.constants[number * CELL * WIDEST..(number + 1) * CELL * WIDEST];
    let mut by_gradient = [[0.0f32; WIDEST]; 9];
    let mut at = 0;
    while at < cells.len() {
        if !cell_lanes(simd, step, map, (constants, &path, &gradients), at, (&mut by_gradient, out)) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    on_corners(cells, over_shaft, &by_gradient, out);
    Found::Known
}

/// Forces on the corners, from those by gradient and place: the gradient of y is that of the middle of the cell.
#[inline(always)]
fn on_corners(cells: &[Cell], over_shaft: f64, by_gradient: &[[f32; WIDEST]; 9], out: &mut [f32]) {
    let mut quarters = [[0.0f64; WIDEST]; 3];
    for (lane, cell) in cells.iter().enumerate() {
        for axis in 0..3 {
            quarters[axis][lane] = cell.quarter[axis];
        }
    }
    let (forces, by_place) = out.split_at_mut(CORNER_FORCES * WIDEST);
    for axis in 0..3 {
        let (mut middle, mut by_axis) = ([0.0f64; WIDEST], [[0.0f64; WIDEST]; 3]);
        for lane in 0..WIDEST {
            middle[lane] = f64::from(by_place[axis * WIDEST + lane]) * over_shaft * 0.125;
        }
        for a in 0..3 {
            for lane in 0..WIDEST {
                by_axis[a][lane] = f64::from(by_gradient[3 * a + axis][lane]) * quarters[a][lane];
            }
        }
        for bits in 0..SIGNS {
            let row = &mut forces[(3 * bits + axis) * WIDEST..][..WIDEST];
            let sign = |a: usize| if bits >> a & 1 == 1 { 1.0 } else { -1.0 };
            let signs = [sign(0), sign(1), sign(2)];
            for lane in 0..WIDEST {
                let mut force = middle[lane];
                for a in 0..3 {
                    force += signs[a] * by_axis[a][lane];
                }
                row[lane] = force as f32;
            }
        }
    }
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
    (by_gradient, out): (&mut [[f32; WIDEST]; 9], &mut [f32]),
) -> bool {
    let all = step.all;
    let row = |row: usize| Lanes::load(simd, constants, row * WIDEST + at);
    let (zero, one) = (Lanes::splat(simd, 0.0), Lanes::splat(simd, 1.0));
    let open_lanes = Lanes::load(simd, &path.open, at);
    let [width, place] = [[row(0), row(1), row(2)], [row(3), row(4), row(5)]];
    let (volume, share, edge, b_squared) = (row(6) * open_lanes, row(7), row(8), row(9));
    let law = law_in_lanes(simd, all, constants, 10, at);
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
    let shared = volume * share * Lanes::load(simd, &path.left, at);
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
    for a in 0..3 {
        for b in 0..3 {
            sum.gradient[a][b].store(&mut by_gradient[3 * a + b], at);
        }
    }
    let mut put = |value: Lanes<S>, row: usize| value.store(out, (CORNER_FORCES + row) * WIDEST + at);
    for a in 0..3 {
        put(sum.place[a], a);
        put(sum.centre_rate[a], 3 + a);
    }
    put(sum.radius, 6);
    put(sum.radius_rate, 7);
    put(energy, 8);
    put(intact, 12);
    if all.turns {
        let moment = moment_of(&h, middle.offset, &sum.gradient, sum.place);
        for a in 0..3 {
            put(moment[a], 9 + a);
        }
    }
    bound.store(out, (CELL_SUMS - 1) * WIDEST + at);
    true
}
