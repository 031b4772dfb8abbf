//! The path beside the lanes of a vector.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::DVec3;
use pulp::Simd;

use super::super::WIDEST;
use super::super::number::Lanes;
use crate::needle::opening::{Beside, GrowthIn, Station};

/// The path beside the lanes of a vector, entry by entry.
pub struct Gathered {
    pub offset: [[f32; WIDEST]; 3],
    pub rate: [[f32; WIDEST]; 3],
    pub radius: [f32; WIDEST],
    pub radius_rate: [f32; WIDEST],
    pub rest_direction: [[f32; WIDEST]; 3],
    /// [`GrowthIn`].
    pub growth: [[f32; WIDEST]; 3],
    /// Part of the stress that is left, 0 where the path is closed.
    pub left: [f32; WIDEST],
    /// 1 where the path is open.
    pub open: [f32; WIDEST],
    pub is_any_open: bool,
}

impl Gathered {
    pub fn new() -> Self {
        let none = [0.0; WIDEST];
        Gathered {
            offset: [none; 3],
            rate: [none; 3],
            radius: none,
            radius_rate: none,
            rest_direction: [none; 3],
            growth: [none, none, [1.0; WIDEST]],
            left: none,
            open: none,
            is_any_open: false,
        }
    }

    /// Takes in a station, seen from the place `at` [m].
    #[inline(always)]
    pub fn set(&mut self, lane: usize, station: &Station, at: DVec3, over_shaft: f64) {
        if station.radius == 0.0 {
            self.close(lane);
            return;
        }
        let offset = (at - station.centre) * over_shaft;
        for axis in 0..3 {
            self.offset[axis][lane] = offset[axis] as f32;
            self.rate[axis][lane] = station.centre_rate[axis] as f32;
            self.rest_direction[axis][lane] = station.rest_direction[axis] as f32;
        }
        let area = over_shaft * over_shaft;
        self.growth[0][lane] = (1.0 + station.growth.gain) as f32;
        self.growth[1][lane] = (station.growth.fall * area) as f32;
        self.growth[2][lane] = (station.growth.reach * area) as f32;
        self.radius[lane] = (station.radius * over_shaft) as f32;
        self.radius_rate[lane] = station.radius_rate as f32;
        self.left[lane] = station.left() as f32;
        self.open[lane] = 1.0;
        self.is_any_open = true;
    }

    /// No open path beside a lane.
    #[inline(always)]
    pub fn close(&mut self, lane: usize) {
        for axis in 0..3 {
            (self.offset[axis][lane], self.rate[axis][lane]) = (0.0, 0.0);
        }
        (self.radius[lane], self.radius_rate[lane]) = (0.0, 0.0);
        (self.left[lane], self.open[lane]) = (0.0, 0.0);
    }

    #[inline(always)]
    pub fn beside<S: Simd>(&self, simd: S, at: usize) -> Beside<Lanes<S>> {
        let vector = |rows: &[[f32; WIDEST]; 3]| {
            [Lanes::load(simd, &rows[0], at), Lanes::load(simd, &rows[1], at), Lanes::load(simd, &rows[2], at)]
        };
        Beside {
            offset: vector(&self.offset),
            centre_rate: vector(&self.rate),
            radius: Lanes::load(simd, &self.radius, at),
            radius_rate: Lanes::load(simd, &self.radius_rate, at),
            rest_direction: vector(&self.rest_direction),
            growth: GrowthIn {
                most: Lanes::load(simd, &self.growth[0], at),
                fall: Lanes::load(simd, &self.growth[1], at),
                reach: Lanes::load(simd, &self.growth[2], at),
            },
        }
    }
}
