//! What the cells of a block tell about themselves, in lanes: energies and Jacobians. Equations: `Elements::measure_corners`.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::{Simd, WithSimd};

use super::block::Grid;
use super::corners::{HOURGLASS, SIGNS};
use super::number::Lanes;
use super::points::{Around, PointEnergy, Points, VectorPoints};
use super::rows::{CellRows, MaterialLanes, Row, Vector, differences, hadamard};
use super::shapes::{Boxes, Prisms, Shape};
use crate::engine::elements::{CellMeasure, CellStates};
use crate::material::regular::Regular;
use crate::material_point::PointState;
use crate::number::Number;

/// Jacobian at a corner below which a vector is measured in f64: whether a cell has turned inside out is not left to f32.
const LEAST_CORNER_J: f64 = 0.02;

/// f32 per cell: elastic and hourglass energy, J, the least J of the corners, energy that Prony terms hold, damage.
const NUMBERS: usize = 6;

impl CellRows<'_> {
    /// Measures of the cells of the rows from `first` on; `histories`: what their points remember; `states`: the same of all cells.
    pub fn measure(&self, first: usize, measures: &mut [CellMeasure], histories: &mut [f32], states: &[PointState]) {
        self.grid.arch.dispatch(MeasuredRows { rows: self, first, measures, histories, states });
    }
}

struct MeasuredRows<'a> {
    rows: &'a CellRows<'a>,
    first: usize,
    measures: &'a mut [CellMeasure],
    histories: &'a mut [f32],
    states: &'a [PointState],
}

impl WithSimd for MeasuredRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let MeasuredRows { rows, first, measures, histories, states } = self;
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
                let is_known = match rows.points {
                    None => shaped_measure(simd, rows, (i, at), &material, &Elastic, &vector, &mut numbers),
                    Some(points) => {
                        let length = points.row_length();
                        let history = &mut histories[number * length..(number + 1) * length];
                        let of_vector = points_of(simd, rows, (points, history), &row, i, &material);
                        shaped_measure(simd, rows, (i, at), &material, &of_vector, &vector, &mut numbers)
                    }
                };
                if !is_known {
                    one_by_one(rows, row.first_cell(), cells, measures, states);
                    continue;
                }
                for cell in cells {
                    let value = |number: usize| f64::from(numbers[number * stride + cell]);
                    let held = value(4);
                    measures[cell] = CellMeasure {
                        elastic: value(0),
                        hourglass: value(1),
                        viscous: states.get(row.first_cell() + cell).map_or(0.0, |point| {
                            rows.model.mesh.cell_volume(row.first_cell() + cell) * point.viscous_work - held
                        }),
                        held,
                        jacobian: value(2),
                        corner_jacobian: value(3),
                        damage: value(5),
                    };
                }
            }
        }
    }
}

/// The points of a vector that is measured.
#[inline(always)]
fn points_of<'a, 'b, S: Simd>(
    simd: S,
    rows: &CellRows,
    (points, history): (&'a Points, &'b mut [f32]),
    row: &Row,
    i: usize,
    material: &MaterialLanes<S>,
) -> VectorPoints<'a, 'b, S> {
    let kind = |i: usize| rows.model.material_index(row.first_cell() + i);
    VectorPoints::new(simd, points, history, (i, rows.grid.cells[0]), material.holds.is_none(), kind)
}

/// What the material of a vector stores.
trait Stores<S: Simd> {
    /// `None` where a lane has left the range of these forms.
    fn energy(
        &self,
        simd: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<PointEnergy<S>>;
}

/// The elastic law alone.
struct Elastic;

impl<S: Simd> Stores<S> for Elastic {
    #[inline(always)]
    fn energy(
        &self,
        simd: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<PointEnergy<S>> {
        let zero = Lanes::splat(simd, 0.0);
        let stored = material.law.energy(state, material.bulk)?;
        Some(PointEnergy { stored: around.kept * stored, held: zero, damage: zero, intact: around.kept })
    }
}

impl<S: Simd> Stores<S> for VectorPoints<'_, '_, S> {
    #[inline(always)]
    fn energy(
        &self,
        simd: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<PointEnergy<S>> {
        VectorPoints::energy(self, simd, &material.law, state, around)
    }
}

/// [`lane_measure`] of the cells from `i` on of the row at `at`.
#[inline(always)]
fn shaped_measure<S: Simd>(
    simd: S,
    rows: &CellRows,
    (i, at): (usize, [usize; 2]),
    material: &MaterialLanes<S>,
    stores: &impl Stores<S>,
    vector: &Vector,
    numbers: &mut [f32],
) -> bool {
    let grid = rows.grid;
    match &grid.bent {
        None => lane_measure(simd, grid, &Boxes::new(simd, grid, i, at), material, stores, vector, numbers),
        Some(columns) => {
            let prisms = Prisms::new(simd, grid, columns, i, at);
            lane_measure(simd, grid, &prisms, material, stores, vector, numbers)
        }
    }
}

/// The same in f64.
#[cold]
fn one_by_one(
    rows: &CellRows,
    first_cell: usize,
    cells: std::ops::Range<usize>,
    measures: &mut [CellMeasure],
    points: &[PointState],
) {
    let states = CellStates { points, stiffness: rows.stiffness };
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
    stores: &impl Stores<S>,
    at: &Vector,
    numbers: &mut [f32],
) -> bool {
    let stride = grid.stride;
    let zero = Lanes::splat(simd, 0.0);
    let one = Lanes::splat(simd, 1.0);
    let [volume, edge, inverse_square] = cells.sizes();
    // A gap between two copies of a line is no tissue either.
    let is_tissue = (volume * Lanes::splat(simd, 1e30)).smaller(one);
    let holds = match material.holds {
        Some(holds) => holds * is_tissue,
        None => is_tissue,
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
    let around = Around {
        length: edge,
        kept: Lanes::load(simd, at.intact, at.i) * holds,
        other_energy: zero,
        bulk_modulus: material.bulk,
    };
    let Some(PointEnergy { stored, held, damage, intact }) = stores.energy(simd, material, &state, &around) else {
        return false;
    };
    let q2 = q2 * Lanes::splat(simd, 1.0 / 64.0);
    let folding = Lanes::splat(simd, 0.5 * grid.quartic as f32) * q2 * inverse_square;
    let hourglass = intact * Lanes::splat(simd, 0.5) * material.hourglass * edge * q2 * (one + folding);
    (volume * stored).store(numbers, at.i);
    hourglass.store(numbers, stride + at.i);
    (state.dj + one).store(numbers, 2 * stride + at.i);
    least.store(numbers, 3 * stride + at.i);
    (volume * held).store(numbers, 4 * stride + at.i);
    damage.store(numbers, 5 * stride + at.i);
    true
}
