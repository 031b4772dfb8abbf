//! The path beside the lanes of a vector.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::DVec3;
use pulp::Simd;

use super::super::WIDEST;
use super::super::number::Lanes;
use crate::needle::opening::{Beside, GrowthIn, Station};

/// Rows of a lane: offset, rate of the middle, direction at rest, [`GrowthIn`], radius and its rate, part of the stress that is left, and 1
/// where the path is open.
const ROWS: usize = OPEN + 1;
const RATE: usize = 3;
const REST_DIRECTION: usize = 6;
const GROWTH: usize = 9;
const RADIUS: usize = 12;
const LEFT: usize = 14;
const OPEN: usize = 15;

/// What lanes take of a section of the path, converted once for all of them; lengths in radii of the needle.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// [m]
    centre: DVec3,
    rows: [f32; ROWS - RATE],
    pub is_open: bool,
}

impl Section {
    pub fn new(station: &Station, over_shaft: f64) -> Self {
        let Station { centre, centre_rate: rate, radius, radius_rate, rest_direction: rest, growth, .. } = *station;
        let area = over_shaft * over_shaft;
        let is_open = radius != 0.0;
        let all = [
            [rate.x, rate.y, rate.z],
            [rest.x, rest.y, rest.z],
            [1.0 + growth.gain, growth.fall * area, growth.reach * area],
            [radius * over_shaft, radius_rate, station.left()],
        ];
        let mut rows = [0.0; ROWS - RATE];
        if is_open {
            for (row, value) in rows.iter_mut().zip(all.into_iter().flatten().chain([1.0])) {
                *row = value as f32;
            }
        } else {
            // Nothing is divided by zero there.
            rows[GROWTH + 2 - RATE] = 1.0;
        }
        Section { centre, rows, is_open }
    }
}

/// The path beside the lanes of a vector, entry by entry.
pub struct Gathered {
    rows: [[f32; WIDEST]; ROWS],
}

impl Gathered {
    /// Closed everywhere.
    pub fn new() -> Self {
        let mut rows = [[0.0; WIDEST]; ROWS];
        rows[GROWTH + 2] = [1.0; WIDEST];
        Gathered { rows }
    }

    /// Takes in a section, seen from the place `at` [m].
    #[inline(always)]
    pub fn set(&mut self, lane: usize, section: &Section, at: DVec3, over_shaft: f64) {
        let offset = (at - section.centre) * over_shaft;
        for axis in 0..3 {
            self.rows[axis][lane] = if section.is_open { offset[axis] as f32 } else { 0.0 };
        }
        for row in RATE..ROWS {
            self.rows[row][lane] = section.rows[row - RATE];
        }
    }

    /// No open path beside a lane.
    #[inline(always)]
    pub fn close(&mut self, lane: usize) {
        for row in 0..ROWS {
            self.rows[row][lane] = 0.0;
        }
        self.rows[GROWTH + 2][lane] = 1.0;
    }

    #[inline(always)]
    fn vector<S: Simd>(&self, simd: S, first: usize, at: usize) -> [Lanes<S>; 3] {
        let row = |row: usize| Lanes::load(simd, &self.rows[row], at);
        [row(first), row(first + 1), row(first + 2)]
    }

    /// 1 where the path is open.
    #[inline(always)]
    pub fn open<S: Simd>(&self, simd: S, at: usize) -> Lanes<S> {
        Lanes::load(simd, &self.rows[OPEN], at)
    }

    /// Part of the stress that is left, 0 where the path is closed.
    #[inline(always)]
    pub fn left<S: Simd>(&self, simd: S, at: usize) -> Lanes<S> {
        Lanes::load(simd, &self.rows[LEFT], at)
    }

    #[inline(always)]
    pub fn beside<S: Simd>(&self, simd: S, at: usize) -> Beside<Lanes<S>> {
        let [most, fall, reach] = self.vector(simd, GROWTH, at);
        Beside {
            offset: self.vector(simd, 0, at),
            centre_rate: self.vector(simd, RATE, at),
            radius: Lanes::load(simd, &self.rows[RADIUS], at),
            radius_rate: Lanes::load(simd, &self.rows[RADIUS + 1], at),
            rest_direction: self.vector(simd, REST_DIRECTION, at),
            growth: GrowthIn { most, fall, reach },
        }
    }
}
