//! Points in lanes: what they do to the corners of their cells and to their stations.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::{Simd, WithSimd};

use super::sums::{ChunkSums, SUMS};
use super::{AtCorners, Found, Gathered, LAW, Lanes, Opened, POINT, ROOM, RUN_SUMS, STRIDES, Step, moment_of, opened};
use crate::cpu::lanes::WIDEST;
use crate::cpu::lanes::corners::{HOURGLASS, SIGNS};
use crate::needle::opening::{MapIn, squared_norm_bound};
use crate::number::Number;

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
        let mut scratch = Scratch {
            path: Gathered::new(),
            modes: [[[0.0; ROOM]; 3]; SIGNS],
            summed: [[0.0; ROOM]; RUN_SUMS],
            of_lanes: [[0.0; WIDEST]; SUMS],
        };
        if found.iter().any(|found| *found != Found::Closed) {
            sums.clear();
        }
        for i in 0..found.len() {
            let end =
                if first + i + 1 < all.vectors.len() { all.vectors[first + i + 1].first_run } else { all.runs.len() };
            let runs = &mut runs[all.vectors[first + i].first_run - first_run..end - first_run];
            found[i] = point_vector(simd, &step, &map, first + i, runs, &mut scratch);
            if found[i] == Found::Known {
                let vector = &all.vectors[first + i];
                for lane in 0..vector.count {
                    sums.add(usize::from(vector.stations[lane]), &scratch.of_lanes, lane);
                }
            }
        }
    }
}

/// Rows that vectors share one after the other: what a vector leaves in them behind its lanes is not read, or zero.
struct Scratch {
    path: Gathered,
    modes: [[[f32; ROOM]; 3]; SIGNS],
    summed: [[f32; ROOM]; RUN_SUMS],
    of_lanes: [[f32; WIDEST]; SUMS],
}

/// Forces of a vector of points.
#[inline(always)]
fn point_vector<S: Simd>(
    simd: S,
    step: &Step,
    map: &MapIn<Lanes<S>>,
    number: usize,
    at_corners: &mut [AtCorners],
    Scratch { path, modes, summed, of_lanes }: &mut Scratch,
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
        path.close(lane);
    }
    for run in runs {
        let first = step.u[run.nodes[0] as usize];
        for lane in run.lanes.start..run.lanes.end {
            let station = &step.stations[usize::from(vector.stations[lane])];
            path.set(lane, station, run.origin + first, over_shaft);
        }
        // The lanes behind the run are those of the next ones, which come later.
        for bits in 1..SIGNS {
            let from_first = (step.u[run.nodes[bits] as usize] - first) * over_shaft;
            for axis in 0..3 {
                modes[bits][axis][run.lanes.start..run.lanes.start + WIDEST]
                    .copy_from_slice(&[from_first[axis] as f32; WIDEST]);
            }
        }
    }
    // u = sum of modes times products of the place in the cell, by the bits of its factors; in radii. That of the first corner is none.
    for bit in [1, 2, 4] {
        for bits in 1..SIGNS {
            if bits & bit != 0 && bits != bit {
                for axis in 0..3 {
                    let low = modes[bits ^ bit][axis];
                    for lane in 0..WIDEST {
                        modes[bits][axis][lane] -= low[lane];
                    }
                }
            }
        }
    }
    let points = &all.points[number * POINT * WIDEST..(number + 1) * POINT * WIDEST];
    let mut at = 0;
    while at < vector.count {
        if !point_lanes(simd, step, map, (points, path, modes), at, (of_lanes, summed)) {
            return Found::Unknown;
        }
        at += Lanes::<S>::COUNT;
    }
    // The first lane of a run gets its sum: of lanes side by side, of pairs, of fours and of eights.
    for (stride, same_run) in STRIDES.into_iter().zip(&vector.same_run) {
        for row in summed.iter_mut() {
            let mut sums = [0.0f32; WIDEST];
            for lane in 0..WIDEST {
                sums[lane] = row[lane + stride].mul_add(same_run[lane], row[lane]);
            }
            row[..WIDEST].copy_from_slice(&sums);
        }
    }
    // Back to the corners.
    for bit in [1, 2, 4] {
        for bits in 0..SIGNS {
            if bits & bit != 0 {
                for axis in 0..3 {
                    let high = summed[3 * bits + axis];
                    for lane in 0..WIDEST {
                        summed[3 * (bits ^ bit) + axis][lane] -= high[lane];
                    }
                }
            }
        }
    }
    let over_shaft = over_shaft as f32;
    for i in 0..runs.len() {
        let (first, at_corners) = (runs[i].lanes.start, &mut at_corners[i]);
        for bits in 0..SIGNS {
            for axis in 0..3 {
                at_corners[axis][bits] = summed[3 * bits + axis][first] * over_shaft;
            }
            at_corners[3][bits] = summed[3 * SIGNS + bits][first];
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
    (points, path, modes): (&[f32], &Gathered, &[[[f32; ROOM]; 3]; SIGNS]),
    at: usize,
    (of_lanes, summed): (&mut [[f32; WIDEST]; SUMS], &mut [[f32; ROOM]; RUN_SUMS]),
) -> bool {
    let all = step.all;
    let zero = Lanes::splat(simd, 0.0);
    let over_shaft = Lanes::splat(simd, (1.0 / all.shaft) as f32);
    let row = |row: usize| Lanes::load(simd, points, row * WIDEST + at);
    let [x, y, z] = [row(0), row(1), row(2)];
    let open = path.open(simd, at);
    let volume = row(3) * path.left(simd, at);
    let edges = [row(4), row(5), row(6)];
    let one = Lanes::splat(simd, 1.0);
    let over_edges = [one.over(edges[0]), one.over(edges[1]), one.over(edges[2])];
    let law = all.laws.in_lanes(simd, points, 7, at);
    let bulk = row(11);
    let [yz, zx, xy] = [y * z, z * x, x * y];
    let mut beside = path.beside(simd, at);
    let mut h = [[zero; 3]; 3];
    for axis in 0..3 {
        let mode = |bits: usize| Lanes::load(simd, &modes[bits][axis], at);
        let [m_x, m_y, m_z] = [mode(1), mode(2), mode(4)];
        let [m_xy, m_zx, m_yz, m_xyz] =
            [mode(HOURGLASS[2]), mode(HOURGLASS[1]), mode(HOURGLASS[0]), mode(HOURGLASS[3])];
        let by_x = m_xyz.mul_add(yz, m_zx.mul_add(z, m_xy.mul_add(y, m_x)));
        let by_y = m_xyz.mul_add(zx, m_yz.mul_add(z, m_xy.mul_add(x, m_y)));
        let by_z = m_xyz.mul_add(xy, m_yz.mul_add(y, m_zx.mul_add(x, m_z)));
        let along = [x, y, z][axis].mul_add(edges[axis], beside.offset[axis]);
        let straight = m_z.mul_add(z, m_y.mul_add(y, m_x.mul_add(x, along)));
        beside.offset[axis] = m_xyz.mul_add(xy * z, m_yz.mul_add(yz, m_zx.mul_add(zx, m_xy.mul_add(xy, straight))));
        h[0][axis] = by_x * over_edges[0];
        h[1][axis] = by_y * over_edges[1];
        h[2][axis] = by_z * over_edges[2];
    }
    let Some(point) = opened(map, &beside, &h, &law, bulk, step.measures) else { return false };
    let Opened { d, energy, closed, straight, turned, by_gradient, by_place, distance } = point;
    let grown = distance.mul_add(by_place, by_gradient);
    let stiffness = (straight * grown * grown + turned * squared_norm_bound(&closed.cofactor())) * open;
    for corner in 0..SIGNS {
        (stiffness * row(7 + LAW + corner)).store(&mut summed[3 * SIGNS + corner], at);
    }
    for axis in 0..3 {
        let p = d.place[axis] * volume;
        let [gx, gy, gz] = [
            d.gradient[0][axis] * volume * over_edges[0],
            d.gradient[1][axis] * volume * over_edges[1],
            d.gradient[2][axis] * volume * over_edges[2],
        ];
        p.store(&mut summed[axis], at);
        p.mul_add(x, gx).store(&mut summed[3 + axis], at);
        p.mul_add(y, gy).store(&mut summed[2 * 3 + axis], at);
        p.mul_add(z, gz).store(&mut summed[4 * 3 + axis], at);
        p.mul_add(xy, gx.mul_add(y, gy * x)).store(&mut summed[3 * 3 + axis], at);
        p.mul_add(zx, gx.mul_add(z, gz * x)).store(&mut summed[5 * 3 + axis], at);
        p.mul_add(yz, gy.mul_add(z, gz * y)).store(&mut summed[6 * 3 + axis], at);
        (p * xy).mul_add(z, gx.mul_add(yz, gy.mul_add(zx, gz * xy))).store(&mut summed[7 * 3 + axis], at);
        (p * over_shaft).store(&mut of_lanes[axis], at);
        (d.centre_rate[axis] * volume).store(&mut of_lanes[3 + axis], at);
    }
    (d.radius * volume * over_shaft).store(&mut of_lanes[6], at);
    (d.radius_rate * volume).store(&mut of_lanes[7], at);
    (energy * volume).store(&mut of_lanes[8], at);
    if all.turns {
        let moment = moment_of(&h, beside.offset, &d.gradient, d.place);
        for axis in 0..3 {
            (moment[axis] * volume).store(&mut of_lanes[9 + axis], at);
        }
    }
    true
}
