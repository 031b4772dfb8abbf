//! What the cells of a block tell about themselves, in lanes: energies and Jacobians. Equations: `Elements::measure_corners`.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::{Simd, WithSimd};

use super::block::Grid;
use super::corners::{HOURGLASS, SIGNS};
use super::number::Lanes;
use super::rows::{CellRows, MaterialLanes, Vector, differences, hadamard};
use super::shapes::{Boxes, Prisms, Shape};
use crate::engine::elements::{CellMeasure, CellStates};
use crate::material::regular::Regular;
use crate::number::Number;

/// Jacobian at a corner below which a vector is measured in f64: whether a cell has turned inside out is not left to f32.
const LEAST_CORNER_J: f64 = 0.02;

/// f32 of a row in [`RowMeasures`]: elastic and hourglass energy, J, and the least J of the corners.
const NUMBERS: usize = 4;

impl CellRows<'_> {
    /// Measures of the cells of the rows from `first` on.
    pub fn measure(&self, first: usize, measures: &mut [CellMeasure]) {
        self.grid.arch.dispatch(MeasuredRows { rows: self, first, measures });
    }
}

struct MeasuredRows<'a> {
    rows: &'a CellRows<'a>,
    first: usize,
    measures: &'a mut [CellMeasure],
}

impl WithSimd for MeasuredRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let MeasuredRows { rows, first, measures } = self;
        let (stride, [nx, ny, _]) = (rows.grid.stride, rows.grid.cells);
        let mut intact = vec![1.0f32; stride];
        let mut numbers = vec![0.0f32; NUMBERS * stride];
        for (number, measures) in measures.chunks_exact_mut(nx).enumerate() {
            let at = [(first + number) % ny, (first + number) / ny];
            let row = rows.row(at, &mut intact);
            for i in (0..nx).step_by(Lanes::<S>::COUNT) {
                let (vector, material) = rows.vector(simd, &row, i, &intact);
                let cells = i..(i + Lanes::<S>::COUNT).min(nx);
                let Some(material) = material else {
                    measures[cells].fill(CellMeasure::of_nothing());
                    continue;
                };
                let grid = rows.grid;
                let is_known = match &grid.bent {
                    None => {
                        let boxes = Boxes::new(simd, grid, i, at);
                        lane_measure(simd, grid, &boxes, &material, &vector, &mut numbers)
                    }
                    Some(columns) => {
                        let prisms = Prisms::new(simd, grid, columns, i, at);
                        lane_measure(simd, grid, &prisms, &material, &vector, &mut numbers)
                    }
                };
                if is_known {
                    for cell in cells {
                        let value = |number: usize| f64::from(numbers[number * stride + cell]);
                        measures[cell] = CellMeasure {
                            elastic: value(0),
                            hourglass: value(1),
                            jacobian: value(2),
                            corner_jacobian: value(3),
                            ..CellMeasure::default()
                        };
                    }
                } else {
                    one_by_one(rows, row.first_cell(), cells, measures);
                }
            }
        }
    }
}

/// The same in f64.
#[cold]
fn one_by_one(rows: &CellRows, first_cell: usize, cells: std::ops::Range<usize>, measures: &mut [CellMeasure]) {
    let states = CellStates { points: &[], stiffness: rows.stiffness };
    for i in cells {
        measures[i] = rows.elements.measure(rows.model, first_cell + i, rows.displacement, None, states);
    }
}

/// Measures of a vector; false where a cell has left the range of these forms.
#[inline(always)]
fn lane_measure<S: Simd>(
    simd: S,
    grid: &Grid,
    cells: &impl Shape<S>,
    material: &MaterialLanes<S>,
    at: &Vector,
    numbers: &mut [f32],
) -> bool {
    let stride = grid.stride;
    // Energies of powers of the stretches are left to f64.
    if let Some(powers) = &material.law.powers
        && !powers.mu.is_within(0.0, 0.0)
    {
        return false;
    }
    let zero = Lanes::splat(simd, 0.0);
    let one = Lanes::splat(simd, 1.0);
    let holds = match material.holds {
        Some(holds) => holds,
        None => one,
    };
    let mut u = differences(simd, stride, at);
    let mut modes = [[zero; SIGNS]; 3];
    for axis in 0..3 {
        modes[axis] = hadamard(u[axis]);
    }
    // An empty cell may be as crooked as it likes.
    let mut h = cells.gradient(&modes);
    for b in 0..3 {
        for axis in 0..3 {
            h[b][axis] = h[b][axis] * holds;
        }
    }
    cells.take_linear(&mut modes);
    let mut q2 = zero;
    for mode in &modes {
        for bits in HOURGLASS {
            q2 = mode[bits].mul_add(mode[bits], q2);
        }
    }
    let Some(state) = Regular::new(h) else { return false };
    for axis in 0..3 {
        for corner in 0..SIGNS {
            u[axis][corner] = u[axis][corner] * holds;
        }
    }
    let least = cells.least_corner_jacobian(&u);
    if !least.is_within(LEAST_CORNER_J, f64::from(f32::MAX)) {
        return false;
    }
    let intact = Lanes::load(simd, at.intact, at.i) * holds;
    let [volume, edge, inverse_square] = cells.sizes();
    let q2 = q2 * Lanes::splat(simd, 1.0 / 64.0);
    let folding = Lanes::splat(simd, 0.5 * grid.quartic as f32) * q2 * inverse_square;
    let elastic = intact * volume * state.energy(&material.law.polynomial, material.bulk);
    let hourglass = intact * Lanes::splat(simd, 0.5) * material.hourglass * edge * q2 * (one + folding);
    elastic.store(numbers, at.i);
    hourglass.store(numbers, stride + at.i);
    (state.dj + one).store(numbers, 2 * stride + at.i);
    least.store(numbers, 3 * stride + at.i);
    true
}
