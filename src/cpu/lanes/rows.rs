//! One row of cells after the other: gradients, stress, hourglass forces and bounds, in vectors along x.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use std::ops::Range;

use glam::DVec3;
use pulp::{Simd, WithSimd};

use super::block::{Grid, LINES, MIXED, PLACE};
use super::corners::{HOURGLASS, SIGNS};
use super::nodes::NODE;
use super::number::Lanes;
use super::points::{Around, Points, VectorPoints};
use super::shapes::{Boxes, Prisms, Shape};
use super::{LaneMaterial, WIDEST};
use crate::engine::elements::{CellInput, Elements};
use crate::material::regular::{Constants, Exponential, LawInLanes, Regular, dot};
use crate::material::stretches::Powers;
use crate::mesh::CORNERS;
use crate::model::Model;
use crate::number::{Number, Tensor};

/// What all rows read.
pub(super) struct CellRows<'a> {
    pub grid: &'a Grid,
    pub places: &'a [f32],
    pub model: &'a Model,
    pub elements: &'a Elements,
    pub displacement: &'a [DVec3],
    /// Per cell; empty: all of it.
    pub stiffness: &'a [f64],
    /// What material points need beside the elastic law; `None`: nothing.
    pub points: Option<&'a Points>,
    /// Step [s] and number of the step that histories are brought forward to; `None`: they stay.
    pub advance: Option<(f64, u64)>,
}

/// Forces on the corners of a row of cells by corner and axis, then the bound; each with [`WIDEST`] zeros before it.
struct RowForces {
    width: usize,
    values: Vec<f32>,
}

impl RowForces {
    fn new(stride: usize) -> Self {
        let width = WIDEST + stride;
        RowForces { width, values: vec![0.0; (3 * SIGNS + 1) * width] }
    }

    fn place(&self, corner: usize, axis: usize, cell: usize) -> usize {
        (3 * corner + axis) * self.width + WIDEST + cell
    }

    fn bound(&self, cell: usize) -> usize {
        self.place(SIGNS, 0, cell)
    }
}

impl CellRows<'_> {
    /// Rows of cells from `first` on, into their lines; `histories`: what their points remember.
    pub fn compute(&self, first: usize, lines: &mut [f32], histories: &mut [f32]) {
        self.grid.arch.dispatch(SomeRows { rows: self, first, lines, histories });
    }
}

struct SomeRows<'a> {
    rows: &'a CellRows<'a>,
    first: usize,
    lines: &'a mut [f32],
    histories: &'a mut [f32],
}

impl WithSimd for SomeRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let SomeRows { rows, first, lines, histories } = self;
        let (stride, [nx, ny, _]) = (rows.grid.stride, rows.grid.cells);
        let mut forces = RowForces::new(stride);
        let mut intact = vec![1.0f32; stride];
        // What a row leaves of its last vector is less work in a vector half as wide.
        let left = nx % WIDEST;
        let half = rows.grid.half.filter(|_| S::F32_LANES == WIDEST && (1..=WIDEST / 2).contains(&left));
        let whole = if half.is_some() { nx - left } else { nx };
        for (i, lines) in lines.chunks_exact_mut(LINES * stride).enumerate() {
            let at = [(first + i) % ny, (first + i) / ny];
            let row = rows.row(at, &mut intact);
            match rows.points {
                None => {
                    cell_row(simd, rows, (&row, at, 0..whole), &mut forces, &intact);
                    if let Some(half) = half {
                        cell_row(half, rows, (&row, at, whole..nx), &mut forces, &intact);
                    }
                }
                Some(points) => {
                    let length = points.row_length();
                    let history = &mut histories[i * length..(i + 1) * length];
                    row_of_points(simd, rows, (points, &mut *history), (&row, at, 0..whole), &mut forces, &intact);
                    if let Some(half) = half {
                        row_of_points(half, rows, (points, history), (&row, at, whole..nx), &mut forces, &intact);
                    }
                }
            }
            add_up(simd, &forces, stride, nx + 1, lines);
        }
    }
}

/// One row of cells.
pub(super) struct Row<'a> {
    first_cell: usize,
    edges: [usize; 2],
    node_lines: [&'a [f32]; 4],
    on_edge: Option<&'a [f32]>,
}

impl Row<'_> {
    /// Number of its first cell.
    pub fn first_cell(&self) -> usize {
        self.first_cell
    }
}

impl<'a> CellRows<'a> {
    /// The row at `[j, k]`; `intact`: gets the stiffness that a path left of its cells.
    pub(super) fn row(&self, [j, k]: [usize; 2], intact: &mut [f32]) -> Row<'a> {
        let CellRows { grid, places, stiffness, .. } = *self;
        let (stride, [nx, ny, _]) = (grid.stride, grid.cells);
        let first_cell = (k * ny + j) * nx;
        if !stiffness.is_empty() {
            for (to, from) in intact.iter_mut().zip(&stiffness[first_cell..first_cell + nx]) {
                *to = *from as f32;
            }
        }
        let line = |j: usize, k: usize| &places[(k * (ny + 1) + j) * PLACE * stride..][..PLACE * stride];
        Row {
            first_cell,
            edges: [j, k],
            node_lines: [line(j, k), line(j + 1, k), line(j, k + 1), line(j + 1, k + 1)],
            on_edge: grid.on_edge.get((k * ny + j) * stride..(k * ny + j + 1) * stride),
        }
    }

    /// The vector of a row whose first cell is `i`, and what its cells are made of; `None`: no cell of it holds tissue.
    #[inline(always)]
    pub(super) fn vector<'b, S: Simd>(
        &self,
        simd: S,
        row: &Row<'b>,
        i: usize,
        intact: &'b [f32],
    ) -> (Vector<'b>, Option<MaterialLanes<S>>) {
        let CellRows { grid, model, .. } = *self;
        let (first_cell, edges) = (row.first_cell, row.edges);
        let last = (i + Lanes::<S>::COUNT).min(grid.cells[0]);
        let kind = |i: usize| model.material_index(first_cell + i);
        let first = kind(i);
        let is_uniform = model.cell_material.is_empty() || (i..last).all(|i| kind(i) == first);
        let vector = Vector { i, node_lines: row.node_lines, on_edge: row.on_edge, intact };
        let empty = model.mesh.block().empty.as_slice();
        if !empty.is_empty() && (i..last).all(|i| empty[first_cell + i]) {
            return (vector, None);
        }
        let material = match is_uniform {
            true => MaterialLanes::uniform(simd, &grid.materials[first]),
            false => {
                let row = edges[1] * grid.cells[1] + edges[0];
                MaterialLanes::mixed(simd, grid, &grid.mixed[row * MIXED * grid.stride..], i)
            }
        };
        (vector, Some(material))
    }
}

/// Forces and bounds of some cells of the row at `at`.
#[inline(always)]
fn cell_row<S: Simd>(
    simd: S,
    rows: &CellRows,
    (row, at, cells): (&Row, [usize; 2], Range<usize>),
    forces: &mut RowForces,
    intact: &[f32],
) {
    let end = cells.end;
    for i in cells.step_by(Lanes::<S>::COUNT) {
        let (vector, material) = rows.vector(simd, row, i, intact);
        let Some(material) = material else {
            nothing(simd, &vector, forces);
            continue;
        };
        let answers = Elastic { slopes: material.law.polynomial, of_powers: Lanes::splat(simd, 0.0) };
        if !shaped_forces(simd, rows.grid, at, &material, answers, &vector, forces) {
            cells_one_by_one(rows, row.first_cell, i..(i + Lanes::<S>::COUNT).min(end), None, forces);
        }
    }
}

/// The same where material points do more than the elastic law.
#[inline(always)]
fn row_of_points<S: Simd>(
    simd: S,
    rows: &CellRows,
    (points, history): (&Points, &mut [f32]),
    (row, at, cells): (&Row, [usize; 2], Range<usize>),
    forces: &mut RowForces,
    intact: &[f32],
) {
    let (nx, end) = (rows.grid.cells[0], cells.end);
    let kind = |i: usize| rows.model.material_index(row.first_cell + i);
    for i in cells.step_by(Lanes::<S>::COUNT) {
        let (vector, material) = rows.vector(simd, row, i, intact);
        let Some(material) = material else {
            nothing(simd, &vector, forces);
            continue;
        };
        let is_uniform = material.holds.is_none();
        let answers = Remembering {
            points: VectorPoints::new(simd, points, history, (i, nx), is_uniform, kind),
            tangent: [Lanes::splat(simd, 0.0); 2],
        };
        if !shaped_forces(simd, rows.grid, at, &material, answers, &vector, forces) {
            let cells = i..(i + Lanes::<S>::COUNT).min(end);
            cells_one_by_one(rows, row.first_cell, cells, Some((points, history)), forces);
        }
    }
}

/// [`lane_forces`] of a vector of the row at `at`.
#[inline(always)]
fn shaped_forces<S: Simd>(
    simd: S,
    grid: &Grid,
    at: [usize; 2],
    material: &MaterialLanes<S>,
    answers: impl Answer<S>,
    vector: &Vector,
    forces: &mut RowForces,
) -> bool {
    match &grid.bent {
        None => lane_forces(simd, grid, &Boxes::new(simd, grid, vector.i, at), material, answers, vector, forces),
        Some(columns) => {
            let prisms = Prisms::new(simd, grid, columns, vector.i, at);
            lane_forces(simd, grid, &prisms, material, answers, vector, forces)
        }
    }
}

/// What the material of a vector answers to its state.
trait Answer<S: Simd> {
    /// Stress with its pressure [Pa], and the part of the stiffness that is left; `None` where a lane has left the range of these forms.
    fn stress(
        &mut self,
        simd: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<(Tensor<Lanes<S>>, Lanes<S>)>;
    /// Bounds of the tangent, straight and turned [Pa].
    fn tangent(&self, material: &MaterialLanes<S>, state: &Regular<Lanes<S>>) -> [Lanes<S>; 2];
}

/// The elastic law alone.
struct Elastic<S: Simd> {
    slopes: Constants<Lanes<S>>,
    of_powers: Lanes<S>,
}

impl<S: Simd> Answer<S> for Elastic<S> {
    #[inline(always)]
    fn stress(
        &mut self,
        _: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<(Tensor<Lanes<S>>, Lanes<S>)> {
        self.slopes = material.law.slopes_at(state)?;
        let mut p = state.stress(&self.slopes, material.bulk * state.dj);
        if let Some(powers) = &material.law.powers {
            let (added, bound) = state.stress_and_bound_of_powers(powers)?;
            self.of_powers = bound;
            for b in 0..3 {
                for axis in 0..3 {
                    p[b][axis] = p[b][axis] + added[b][axis];
                }
            }
        }
        Some((p, around.kept))
    }

    #[inline(always)]
    fn tangent(&self, material: &MaterialLanes<S>, state: &Regular<Lanes<S>>) -> [Lanes<S>; 2] {
        let [straight, turned] = state.tangent_bound(&self.slopes, material.bulk);
        [straight + self.of_powers, turned]
    }
}

/// Material points with their histories.
struct Remembering<'a, 'b, S: Simd> {
    points: VectorPoints<'a, 'b, S>,
    tangent: [Lanes<S>; 2],
}

impl<S: Simd> Answer<S> for Remembering<'_, '_, S> {
    #[inline(always)]
    fn stress(
        &mut self,
        simd: S,
        material: &MaterialLanes<S>,
        state: &Regular<Lanes<S>>,
        around: &Around<S>,
    ) -> Option<(Tensor<Lanes<S>>, Lanes<S>)> {
        let answer = self.points.answer(simd, &material.law, state, around)?;
        self.tangent = answer.tangent;
        let pressure = material.bulk * state.dj;
        let cof = state.cofactor();
        let mut p = answer.stress;
        for b in 0..3 {
            for axis in 0..3 {
                p[b][axis] = cof[b][axis].mul_add(pressure, p[b][axis]);
            }
        }
        Some((p, answer.intact))
    }

    #[inline(always)]
    fn tangent(&self, _: &MaterialLanes<S>, _: &Regular<Lanes<S>>) -> [Lanes<S>; 2] {
        self.tangent
    }
}

/// No forces of a vector in which no cell holds tissue.
#[inline(always)]
fn nothing<S: Simd>(simd: S, at: &Vector, forces: &mut RowForces) {
    let zero = Lanes::splat(simd, 0.0);
    for corner in 0..SIGNS {
        for axis in 0..3 {
            let place = forces.place(corner, axis, at.i);
            zero.store(&mut forces.values, place);
        }
    }
    let place = forces.bound(at.i);
    zero.store(&mut forces.values, place);
}

/// Constants of the materials of a vector.
pub(super) struct MaterialLanes<S: Simd> {
    pub law: LawInLanes<Lanes<S>>,
    pub bulk: Lanes<S>,
    pub hourglass: Lanes<S>,
    /// 1 where a cell holds tissue, 0 where it is empty; `None`: all do.
    pub holds: Option<Lanes<S>>,
}

impl<S: Simd> MaterialLanes<S> {
    /// One material.
    #[inline(always)]
    fn uniform(simd: S, material: &LaneMaterial) -> Self {
        let zero = Lanes::splat(simd, 0.0);
        let (mut exponential, mut powers) = (None, None);
        if let Some(of_material) = &material.exponential {
            exponential = Some(of_material.in_lanes(zero));
        }
        if let Some(of_material) = &material.powers {
            powers = Some(of_material.in_lanes(zero));
        }
        MaterialLanes {
            law: LawInLanes { polynomial: material.law.in_lanes(zero), exponential, powers },
            bulk: Lanes::splat(simd, material.bulk_modulus as f32),
            hourglass: Lanes::splat(simd, material.hourglass as f32),
            holds: None,
        }
    }

    /// Those of the cells from `i` on of a row.
    #[inline(always)]
    fn mixed(simd: S, grid: &Grid, row: &[f32], i: usize) -> Self {
        let stride = grid.stride;
        let number = |number: usize| number * stride + i;
        let polynomial = Constants {
            c1: Lanes::load(simd, row, number(0)),
            c2: Lanes::load(simd, row, number(1)),
            c3: Lanes::load(simd, row, number(2)),
            c01: Lanes::load(simd, row, number(3)),
            is_linear: grid.is_linear,
            has_c01: grid.has_c01,
        };
        let exponential = match grid.has_exponential {
            true => Some(Exponential { mu: Lanes::load(simd, row, number(7)), b: Lanes::load(simd, row, number(8)) }),
            false => None,
        };
        let powers = match grid.has_powers {
            true => Some(Powers { mu: Lanes::load(simd, row, number(9)), alpha: Lanes::load(simd, row, number(10)) }),
            false => None,
        };
        MaterialLanes {
            law: LawInLanes { polynomial, exponential, powers },
            bulk: Lanes::load(simd, row, number(4)),
            hourglass: Lanes::load(simd, row, number(5)),
            holds: Some(Lanes::load(simd, row, number(6))),
        }
    }
}

/// One vector of cells of a row.
pub(super) struct Vector<'a> {
    /// The first of its cells.
    pub i: usize,
    node_lines: [&'a [f32]; 4],
    on_edge: Option<&'a [f32]>,
    pub intact: &'a [f32],
}

/// Sums and differences of the values at the corners: what a field has of every product of signs (`xi`, `eta`, `xi eta` ... by their
/// bits), and back.
#[inline(always)]
pub(super) fn hadamard<N: Number>(mut v: [N; SIGNS]) -> [N; SIGNS] {
    let mut bit = 1;
    while bit < SIGNS {
        let mut low = 0;
        while low < SIGNS {
            if low & bit == 0 {
                let (a, b) = (v[low], v[low | bit]);
                (v[low], v[low | bit]) = (a + b, b - a);
            }
            low += 1;
        }
        bit *= 2;
    }
    v
}

/// The transpose of [`hadamard`].
#[inline(always)]
fn spread<N: Number>(mut v: [N; SIGNS]) -> [N; SIGNS] {
    let mut bit = 1;
    while bit < SIGNS {
        let mut low = 0;
        while low < SIGNS {
            if low & bit == 0 {
                let (sum, difference) = (v[low], v[low | bit]);
                (v[low], v[low | bit]) = (sum - difference, sum + difference);
            }
            low += 1;
        }
        bit *= 2;
    }
    v
}

/// Displacement of every corner less that of the first one [m], by axis.
#[inline(always)]
pub(super) fn differences<S: Simd>(simd: S, stride: usize, at: &Vector) -> [[Lanes<S>; SIGNS]; 3] {
    let mut all = [[Lanes::splat(simd, 0.0); SIGNS]; 3];
    for axis in 0..3 {
        let (high, low) = (2 * axis * stride + at.i, (2 * axis + 1) * stride + at.i);
        let first = [Lanes::load(simd, at.node_lines[0], high), Lanes::load(simd, at.node_lines[0], low)];
        for corner in 1..SIGNS {
            let (line, beside) = (at.node_lines[corner / 2], corner % 2);
            all[axis][corner] = (Lanes::load(simd, line, high + beside) - first[0])
                + (Lanes::load(simd, line, low + beside) - first[1]);
        }
    }
    all
}

/// Forces and bounds of a vector; false where a cell has left the range of these forms.
#[inline(always)]
fn lane_forces<S: Simd>(
    simd: S,
    grid: &Grid,
    shape: &impl Shape<S>,
    material: &MaterialLanes<S>,
    mut answers: impl Answer<S>,
    at: &Vector,
    forces: &mut RowForces,
) -> bool {
    let stride = grid.stride;
    // No closures and no adapters of iterators from here on: what is not inlined falls back to calls per operation.
    let zero = Lanes::splat(simd, 0.0);
    let one = Lanes::splat(simd, 1.0);
    let differences = differences(simd, stride, at);
    let mut modes = [[zero; SIGNS]; 3];
    for axis in 0..3 {
        modes[axis] = hadamard(differences[axis]);
    }
    let mut h = shape.gradient(&modes);
    if let Some(holds) = material.holds {
        // An empty cell may be as crooked as it likes.
        for b in 0..3 {
            for axis in 0..3 {
                h[b][axis] = h[b][axis] * holds;
            }
        }
    }
    let Some(state) = Regular::new(h) else { return false };
    let bulk = material.bulk;
    let [volume, edge, inverse_square] = shape.sizes();
    shape.take_linear(&mut modes);
    // Hourglass modes: products of two and of three signs; an eighth of the sums.
    let mut q2 = zero;
    for mode in &modes {
        for bits in HOURGLASS {
            q2 = mode[bits].mul_add(mode[bits], q2);
        }
    }
    let q2 = q2 * Lanes::splat(simd, 1.0 / 64.0);
    let folding = Lanes::splat(simd, grid.quartic as f32) * q2 * inverse_square;
    let hourglass = material.hourglass * edge;
    let half = Lanes::splat(simd, 0.5);
    let around = Around {
        length: edge,
        kept: Lanes::load(simd, at.intact, at.i),
        other_energy: (half * hourglass * q2 * half.mul_add(folding, one))
            .over(volume.larger(Lanes::splat(simd, 1e-30))),
        bulk_modulus: bulk,
    };
    let Some((p, intact)) = answers.stress(simd, material, &state, &around) else { return false };
    let kh = intact * hourglass * (one + folding) * Lanes::splat(simd, 1.0 / 64.0);
    let by_mode = shape.scaled(intact * volume).turned(&p);
    for axis in 0..3 {
        let mut v = [zero; SIGNS];
        for b in 0..3 {
            v[1 << b] = by_mode[b][axis];
        }
        for bits in HOURGLASS {
            v[bits] = modes[axis][bits] * kh;
        }
        shape.add_linear(&mut v);
        let v = spread(v);
        for corner in 0..SIGNS {
            let place = forces.place(corner, axis, at.i);
            v[corner].store(&mut forces.values, place);
        }
    }
    let [straight, turned] = answers.tangent(material, &state);
    let cof = shape.turned(&state.cofactor());
    let (xx, yy, zz) = (dot(cof[0], cof[0]), dot(cof[1], cof[1]), dot(cof[2], cof[2]));
    let (xy, yz, zx) = (dot(cof[0], cof[1]).size(), dot(cof[1], cof[2]).size(), dot(cof[2], cof[0]).size());
    let mut turning = (xx + xy + zx).larger(yy + xy + yz).larger(zz + yz + zx);
    let [mut shearing, all_shearing] = shape.squares();
    if let Some(on_edge) = at.on_edge {
        let on_edge = Lanes::load(simd, on_edge, at.i);
        let all = xx + yy + zz + Lanes::splat(simd, 2.0) * (xy + yz + zx);
        turning = on_edge.mul_add(all - turning, turning);
        shearing = on_edge.mul_add(all_shearing - shearing, shearing);
    }
    let of_modes = hourglass * (one + Lanes::splat(simd, 3.0) * folding) * Lanes::splat(simd, 0.125);
    let stiff = (bulk + turned) * turning + straight * shearing;
    let bound = intact * (Lanes::splat(simd, 8.0) * volume).mul_add(stiff, of_modes);
    let place = forces.bound(at.i);
    bound.store(&mut forces.values, place);
    true
}

/// The same in f64.
#[cold]
fn cells_one_by_one(
    rows: &CellRows,
    first_cell: usize,
    cells: std::ops::Range<usize>,
    mut remembered: Option<(&Points, &mut [f32])>,
    forces: &mut RowForces,
) {
    // Corner of `CORNERS` by its bits.
    let numbers = CORNERS.map(|c| (0..3).map(|a| usize::from(c[a] > 0.0) << a).sum::<usize>());
    for i in cells {
        let cell = first_cell + i;
        let remaining = rows.stiffness.get(cell).copied().unwrap_or(1.0);
        let mut point = remembered.as_ref().map(|(points, history)| points.point(history, i));
        let input = CellInput { averaged: None, remaining, point: point.as_mut(), advance: rows.advance };
        let (of_cell, met) = rows.elements.corner_forces(rows.model, cell, rows.displacement, input);
        if let (Some((points, history)), Some(point)) = (&mut remembered, &point)
            && rows.advance.is_some()
        {
            points.put_back(point, met, i, history);
        }
        for (corner, force) in numbers.into_iter().zip(of_cell.force) {
            for axis in 0..3 {
                let place = forces.place(corner, axis, i);
                forces.values[place] = force[axis] as f32;
            }
        }
        let place = forces.bound(i);
        forces.values[place] = of_cell.bound[0] as f32;
    }
}

/// Adds up along x: the near corner of a cell and the far one of the cell before it meet in a node.
#[inline(always)]
fn add_up<S: Simd>(simd: S, forces: &RowForces, stride: usize, nodes: usize, lines: &mut [f32]) {
    for line in 0..4 {
        for axis in 0..3 {
            let (near, far) = (forces.place(2 * line, axis, 0), forces.place(2 * line + 1, axis, 0));
            for i in (0..nodes).step_by(Lanes::<S>::COUNT) {
                let sum = Lanes::load(simd, &forces.values, near + i) + Lanes::load(simd, &forces.values, far + i - 1);
                sum.store(lines, (3 * line + axis) * stride + i);
            }
        }
    }
    let bound = forces.bound(0);
    for i in (0..nodes).step_by(Lanes::<S>::COUNT) {
        let sum = Lanes::load(simd, &forces.values, bound + i) + Lanes::load(simd, &forces.values, bound + i - 1);
        sum.store(lines, 12 * stride + i);
    }
}

/// Adds up what the layers of cells below and above a plane of nodes do to it: -f_int, and the bound.
pub(super) fn gather_plane(grid: &Grid, below: Option<&[f32]>, above: Option<&[f32]>, nodes: &mut [f32]) {
    grid.arch.dispatch(Gathered { grid, layers: [above, below], nodes });
}

struct Gathered<'a> {
    grid: &'a Grid,
    /// Rows of the layers on either side: the one that follows along z first.
    layers: [Option<&'a [f32]>; 2],
    nodes: &'a mut [f32],
}

impl WithSimd for Gathered<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Gathered { grid, layers, nodes } = self;
        let (stride, [nx, ny, _]) = (grid.stride, grid.cells);
        for (j, node) in nodes.chunks_exact_mut(NODE * stride).enumerate() {
            // Rows of cells beside this line, and which of their four lines it is.
            let mut around: [Option<(&[f32], usize)>; 4] = [None; 4];
            for (number, around) in around.iter_mut().enumerate() {
                if let (Some(j), Some(lines)) = (j.checked_sub(number & 1), layers[number >> 1])
                    && j < ny
                {
                    *around = Some((&lines[j * LINES * stride..][..LINES * stride], number));
                }
            }
            for number in 0..NODE {
                for i in (0..=nx).step_by(Lanes::<S>::COUNT) {
                    let mut sum = Lanes::splat(simd, 0.0);
                    for (row, line) in around.iter().flatten() {
                        let which = if number == 3 { 12 } else { 3 * line + number };
                        let value = Lanes::load(simd, row, which * stride + i);
                        sum = if number == 3 { sum + value } else { sum - value };
                    }
                    sum.store(node, number * stride + i);
                }
            }
        }
    }
}
