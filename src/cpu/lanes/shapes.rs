//! Cells of a block at rest, a vector of them: boxes between straight lines, prisms between the bent lines around a hollow needle.
//!
//! A field has modes at the corners of a cell: sums of its values with the signs of xi, eta, zeta and of their products. With an eighth of
//! the gradients of xi, eta and zeta at the centre, `X_m` (`Hexahedron` in `engine/elements.rs`), and the sums `u_m`, `u_xy`:
//! ```text
//! H = sum_m u_m (x) X_m,  8 q_xy = u_xy - 8 taper.X_xi u_xi - 8 taper.X_eta u_eta
//! ```
//! A box has one component of each `X_m` and no taper.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use pulp::Simd;

use super::block::Grid;
use super::corners::SIGNS;
use super::number::Lanes;
use crate::engine::elements::PrismBase;
use crate::mesh::BlockMesh;
use crate::number::{Number, Tensor};

/// f32 per column of cells in [`BentColumns`]: x and y of `X_xi` and `X_eta`, 8 taper.X of both, area, its cube root and the inverse of
/// the square of that, 1 where the column is no gap; then, for the corners, x and y of the two edges along xi and the two along eta, and
/// 1 over the area that the two edges at each of the four span.
const COLUMN: usize = 22;

/// What a vector of cells is at rest.
pub(super) trait Shape<S: Simd> {
    /// Sums `u_m` of a vector field by component and signs, into H by columns.
    fn gradient(&self, modes: &[[Lanes<S>; SIGNS]; 3]) -> Tensor<Lanes<S>>;
    /// Takes out of the hourglass sums what a linear field has of them.
    fn take_linear(&self, modes: &mut [[Lanes<S>; SIGNS]; 3]);
    /// The transpose of that: what hourglass forces do to the linear sums of one component.
    fn add_linear(&self, modes: &mut [Lanes<S>; SIGNS]);
    /// The same with all gradients times a number.
    fn scaled(&self, by: Lanes<S>) -> Self;
    /// `t X_m` of every m, of a tensor by its columns.
    fn turned(&self, t: &Tensor<Lanes<S>>) -> Tensor<Lanes<S>>;
    /// Bounds of `|sum_m t_m X_m|^2`, over unit vectors t and over |t_m| <= 1 (`largest_square` in `engine/elements.rs`).
    fn squares(&self) -> [Lanes<S>; 2];
    /// V [m^3], V^(1/3) [m] and V^(-2/3) [1/m^2], zeros in a gap.
    fn sizes(&self) -> [Lanes<S>; 3];
    /// Least J of the corners, each from its three edges, of displacements of the corners [m] by axis; 1 in a gap.
    fn least_corner_jacobian(&self, u: &[[Lanes<S>; SIGNS]; 3]) -> Lanes<S>;
}

/// Of three vectors.
#[inline(always)]
fn determinant<S: Simd>(a: [Lanes<S>; 3], b: [Lanes<S>; 3], c: [Lanes<S>; 3]) -> Lanes<S> {
    let first = b[1] * c[2] - b[2] * c[1];
    let second = b[2] * c[0] - b[0] * c[2];
    let third = b[0] * c[1] - b[1] * c[0];
    a[0].mul_add(first, a[1].mul_add(second, a[2] * third))
}

/// Boxes.
pub(super) struct Boxes<S: Simd> {
    quarter: [Lanes<S>; 3],
    sizes: [Lanes<S>; 3],
}

impl<S: Simd> Boxes<S> {
    /// The cells from `i` on between two lines along y and two along z.
    #[inline(always)]
    pub fn new(simd: S, grid: &Grid, i: usize, edges: [usize; 2]) -> Self {
        let [y, z] = [grid.y[edges[0]], grid.z[edges[1]]];
        let x = &grid.x;
        Boxes {
            quarter: [Lanes::load(simd, &x.quarter, i), Lanes::splat(simd, y.quarter), Lanes::splat(simd, z.quarter)],
            sizes: [
                Lanes::load(simd, &x.length, i) * Lanes::splat(simd, y.length * z.length),
                Lanes::load(simd, &x.cube_root, i) * Lanes::splat(simd, y.cube_root * z.cube_root),
                Lanes::load(simd, &x.inverse_square, i) * Lanes::splat(simd, y.inverse_square * z.inverse_square),
            ],
        }
    }
}

impl<S: Simd> Shape<S> for Boxes<S> {
    #[inline(always)]
    fn gradient(&self, modes: &[[Lanes<S>; SIGNS]; 3]) -> Tensor<Lanes<S>> {
        let mut h = [[self.quarter[0]; 3]; 3];
        for b in 0..3 {
            for axis in 0..3 {
                h[b][axis] = modes[axis][1 << b] * self.quarter[b];
            }
        }
        h
    }

    #[inline(always)]
    fn take_linear(&self, _: &mut [[Lanes<S>; SIGNS]; 3]) {}

    #[inline(always)]
    fn add_linear(&self, _: &mut [Lanes<S>; SIGNS]) {}

    #[inline(always)]
    fn scaled(&self, by: Lanes<S>) -> Self {
        let [x, y, z] = self.quarter;
        Boxes { quarter: [by * x, by * y, by * z], ..*self }
    }

    #[inline(always)]
    fn turned(&self, t: &Tensor<Lanes<S>>) -> Tensor<Lanes<S>> {
        let mut by_mode = *t;
        for b in 0..3 {
            for axis in 0..3 {
                by_mode[b][axis] = t[b][axis] * self.quarter[b];
            }
        }
        by_mode
    }

    #[inline(always)]
    fn squares(&self) -> [Lanes<S>; 2] {
        let [x, y, z] = self.quarter;
        let [x, y, z] = [x * x, y * y, z * z];
        [x.larger(y).larger(z), x + y + z]
    }

    #[inline(always)]
    fn sizes(&self) -> [Lanes<S>; 3] {
        self.sizes
    }

    #[inline(always)]
    fn least_corner_jacobian(&self, u: &[[Lanes<S>; SIGNS]; 3]) -> Lanes<S> {
        let one = self.quarter[0].of(1.0);
        let four = one.of(4.0);
        // 1/d of every axis.
        let inverse = [self.quarter[0] * four, self.quarter[1] * four, self.quarter[2] * four];
        let mut least = one.of(f64::from(f32::MAX));
        for corner in 0..SIGNS {
            let mut f = [[one; 3]; 3];
            for b in 0..3 {
                let (low, high) = (corner & !(1 << b), corner | 1 << b);
                for axis in 0..3 {
                    f[b][axis] = (u[axis][high] - u[axis][low]) * inverse[b];
                }
                f[b][b] = f[b][b] + one;
            }
            least = least.smaller(determinant(f[0], f[1], f[2]));
        }
        least
    }
}

/// Columns of cells between bent lines: the base of each, in rows along x.
pub(super) struct BentColumns {
    stride: usize,
    numbers: Vec<f32>,
}

impl BentColumns {
    /// The columns of a block whose lines are bent; `None` where they are straight.
    pub fn new(block: &BlockMesh, stride: usize) -> Option<Self> {
        block.bore?;
        let [nx, ny, _] = block.cells();
        let mut numbers = vec![0.0; ny * COLUMN * stride];
        for (j, row) in numbers.chunks_exact_mut(COLUMN * stride).enumerate() {
            for i in 0..nx {
                let is_gap = |axis: usize, at: usize| block.lines[axis][at + 1] == block.lines[axis][at];
                if is_gap(0, i) || is_gap(1, j) {
                    continue;
                }
                // Gradients of a flat layer are zero, whatever its base: take another.
                let layer = (0..block.cells()[2]).find(|k| !is_gap(2, *k)).unwrap_or(0);
                let base = PrismBase::new(block, block.cell_index(i, j, layer));
                let [xi, eta] = base.gradients;
                let tapers = base.gradients.map(|x| 8.0 * base.taper.dot(x));
                let (cube_root, inverse_square) = (base.area.cbrt(), base.area.powf(-2.0 / 3.0));
                let values =
                    [xi.x, xi.y, eta.x, eta.y, tapers[0], tapers[1], base.area, cube_root, inverse_square, 1.0];
                // By bits: bit 0 along x, bit 1 along y.
                let nodes = block.cell_nodes(block.cell_index(i, j, layer));
                let corner = [0, 1, 3, 2].map(|n| block.rest_position(nodes[n]).truncate());
                let edges =
                    [corner[1] - corner[0], corner[3] - corner[2], corner[2] - corner[0], corner[3] - corner[1]];
                let spanned = [0, 1, 2, 3].map(|n: usize| 1.0 / edges[n >> 1].perp_dot(edges[2 + (n & 1)]));
                let of_corners = edges.into_iter().flat_map(|edge| [edge.x, edge.y]).chain(spanned);
                for (number, value) in values.into_iter().chain(of_corners).enumerate() {
                    row[number * stride + i] = value as f32;
                }
            }
        }
        Some(BentColumns { stride, numbers })
    }

    /// Bytes of its numbers.
    pub fn bytes(&self) -> usize {
        size_of_val(self.numbers.as_slice())
    }
}

/// Prisms between two planes z = const.
pub(super) struct Prisms<S: Simd> {
    xi: [Lanes<S>; 2],
    eta: [Lanes<S>; 2],
    zeta: Lanes<S>,
    tapers: [Lanes<S>; 2],
    sizes: [Lanes<S>; 3],
    /// x and y of the edges along xi and along eta, by the sign of the other [m].
    edges: [[Lanes<S>; 2]; 4],
    /// 1 over the area between the two edges at every corner of the base [1/m^2].
    spanned: [Lanes<S>; 4],
}

impl<S: Simd> Prisms<S> {
    /// The cells from `i` on of a row of columns, between two lines along z.
    #[inline(always)]
    pub fn new(simd: S, grid: &Grid, columns: &BentColumns, i: usize, edges: [usize; 2]) -> Self {
        let stride = columns.stride;
        let row = &columns.numbers[edges[0] * COLUMN * stride..][..COLUMN * stride];
        let z = grid.z[edges[1]];
        let at = |number: usize| number * stride + i;
        Prisms {
            xi: [Lanes::load(simd, row, at(0)), Lanes::load(simd, row, at(1))],
            eta: [Lanes::load(simd, row, at(2)), Lanes::load(simd, row, at(3))],
            // Nothing of a gap is strained, however far its copies part.
            zeta: Lanes::load(simd, row, at(9)) * Lanes::splat(simd, z.quarter),
            tapers: [Lanes::load(simd, row, at(4)), Lanes::load(simd, row, at(5))],
            sizes: [
                Lanes::load(simd, row, at(6)) * Lanes::splat(simd, z.length),
                Lanes::load(simd, row, at(7)) * Lanes::splat(simd, z.cube_root),
                Lanes::load(simd, row, at(8)) * Lanes::splat(simd, z.inverse_square),
            ],
            edges: [
                [Lanes::load(simd, row, at(10)), Lanes::load(simd, row, at(11))],
                [Lanes::load(simd, row, at(12)), Lanes::load(simd, row, at(13))],
                [Lanes::load(simd, row, at(14)), Lanes::load(simd, row, at(15))],
                [Lanes::load(simd, row, at(16)), Lanes::load(simd, row, at(17))],
            ],
            spanned: [
                Lanes::load(simd, row, at(18)),
                Lanes::load(simd, row, at(19)),
                Lanes::load(simd, row, at(20)),
                Lanes::load(simd, row, at(21)),
            ],
        }
    }
}

impl<S: Simd> Shape<S> for Prisms<S> {
    #[inline(always)]
    fn gradient(&self, modes: &[[Lanes<S>; SIGNS]; 3]) -> Tensor<Lanes<S>> {
        let mut h = [[self.zeta; 3]; 3];
        for axis in 0..3 {
            for b in 0..2 {
                h[b][axis] = modes[axis][1].mul_add(self.xi[b], modes[axis][2] * self.eta[b]);
            }
            h[2][axis] = modes[axis][4] * self.zeta;
        }
        h
    }

    #[inline(always)]
    fn take_linear(&self, modes: &mut [[Lanes<S>; SIGNS]; 3]) {
        let [along_xi, along_eta] = self.tapers;
        for axis in 0..3 {
            let linear = modes[axis][1].mul_add(along_xi, modes[axis][2] * along_eta);
            modes[axis][3] = modes[axis][3] - linear;
        }
    }

    #[inline(always)]
    fn add_linear(&self, modes: &mut [Lanes<S>; SIGNS]) {
        let [along_xi, along_eta] = self.tapers;
        modes[1] = modes[1] - modes[3] * along_xi;
        modes[2] = modes[2] - modes[3] * along_eta;
    }

    #[inline(always)]
    fn scaled(&self, by: Lanes<S>) -> Self {
        let ([a, b], [c, d]) = (self.xi, self.eta);
        Prisms { xi: [by * a, by * b], eta: [by * c, by * d], zeta: by * self.zeta, ..*self }
    }

    #[inline(always)]
    fn turned(&self, t: &Tensor<Lanes<S>>) -> Tensor<Lanes<S>> {
        let mut by_mode = *t;
        for axis in 0..3 {
            by_mode[0][axis] = t[0][axis].mul_add(self.xi[0], t[1][axis] * self.xi[1]);
            by_mode[1][axis] = t[0][axis].mul_add(self.eta[0], t[1][axis] * self.eta[1]);
            by_mode[2][axis] = t[2][axis] * self.zeta;
        }
        by_mode
    }

    #[inline(always)]
    fn squares(&self) -> [Lanes<S>; 2] {
        let ([a, b], [c, d]) = (self.xi, self.eta);
        let xx = a.mul_add(a, b * b);
        let yy = c.mul_add(c, d * d);
        let zz = self.zeta * self.zeta;
        let xy = a.mul_add(c, b * d).size();
        [(xx + xy).larger(yy + xy).larger(zz), xx + yy + zz + (xy + xy)]
    }

    #[inline(always)]
    fn sizes(&self) -> [Lanes<S>; 3] {
        self.sizes
    }

    #[inline(always)]
    fn least_corner_jacobian(&self, u: &[[Lanes<S>; SIGNS]; 3]) -> Lanes<S> {
        let one = self.zeta.of(1.0);
        let mut least = one.of(f64::from(f32::MAX));
        // 1/d along z.
        let inverse = self.zeta * one.of(4.0);
        for corner in 0..SIGNS {
            let (base, [xi, eta]) = (corner & 3, [corner >> 1 & 1, 2 + (corner & 1)]);
            let mut f = [[one; 3]; 3];
            for b in 0..3 {
                let (low, high) = (corner & !(1 << b), corner | 1 << b);
                for axis in 0..3 {
                    f[b][axis] = u[axis][high] - u[axis][low];
                }
            }
            for axis in 0..2 {
                f[0][axis] = f[0][axis] + self.edges[xi][axis];
                f[1][axis] = f[1][axis] + self.edges[eta][axis];
            }
            for axis in 0..3 {
                f[2][axis] = f[2][axis] * inverse;
            }
            f[2][2] = f[2][2] + one;
            least = least.smaller(determinant(f[0], f[1], f[2]) * self.spanned[base]);
        }
        // What has no height has no corners either.
        self.zeta.choose(one.of(1e-12), one, least)
    }
}
