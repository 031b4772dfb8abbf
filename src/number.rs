//! What a law is computed with: one f64, or several values of the lanes of a processor at once.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use std::ops::{Add, Mul, Sub};

/// A second-order tensor by its columns.
pub type Tensor<N> = [[N; 3]; 3];

/// A real number, or one per lane.
pub trait Number: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The same constant in every lane.
    fn of(self, value: f64) -> Self;
    /// `self * by + plus`, rounded once where the processor can.
    fn mul_add(self, by: Self, plus: Self) -> Self;
    /// `self / by`.
    fn over(self, by: Self) -> Self;
    /// Square root.
    fn root(self) -> Self;
    /// `x^(-1/3)` of a value between 0.4 and 2.2.
    fn inverse_cube_root(self) -> Self;
    /// `ln(1 + x)` of a value above -1.
    fn logarithm(self) -> Self;
    /// `exp(x) - 1` of a value between -20 and 20.
    fn exponential(self) -> Self;
    /// The larger one.
    fn larger(self, other: Self) -> Self;
    /// The smaller one.
    fn smaller(self, other: Self) -> Self;
    /// Without its sign.
    fn size(self) -> Self;
    /// `low` where this is below `limit`, `high` elsewhere.
    fn choose(self, limit: Self, low: Self, high: Self) -> Self;
    /// True where every lane lies within `low..=high`; NaN does not.
    fn is_within(self, low: f64, high: f64) -> bool;
}

/// `mask` is 0 or 1 in a lane: `a` where it is 0, `b` where it is 1.
#[inline(always)]
pub fn blend<N: Number>(mask: N, a: N, b: N) -> N {
    mask.choose(mask.of(0.5), a, b)
}

/// `A B`.
#[inline(always)]
pub fn product<N: Number>(a: &Tensor<N>, b: &Tensor<N>) -> Tensor<N> {
    let mut out = *a;
    for column in 0..3 {
        for row in 0..3 {
            out[column][row] =
                a[0][row].mul_add(b[column][0], a[1][row].mul_add(b[column][1], a[2][row] * b[column][2]));
        }
    }
    out
}

/// `A:B`.
#[inline(always)]
pub fn double_dot<N: Number>(a: &Tensor<N>, b: &Tensor<N>) -> N {
    let mut sum = a[0][0] * b[0][0];
    for column in 0..3 {
        for row in 0..3 {
            if column + row > 0 {
                sum = a[column][row].mul_add(b[column][row], sum);
            }
        }
    }
    sum
}

/// `J - 1` of H, without cancellation.
#[inline(always)]
pub fn jacobian_less_one<N: Number>(h: &Tensor<N>) -> N {
    let minors = h[0][0] * h[1][1] - h[1][0] * h[0][1] + h[1][1] * h[2][2] - h[2][1] * h[1][2] + h[0][0] * h[2][2]
        - h[2][0] * h[0][2];
    let cofactor = [
        h[1][1] * h[2][2] - h[1][2] * h[2][1],
        h[1][2] * h[2][0] - h[1][0] * h[2][2],
        h[1][0] * h[2][1] - h[1][1] * h[2][0],
    ];
    let determinant = h[0][0].mul_add(cofactor[0], h[0][1].mul_add(cofactor[1], h[0][2] * cofactor[2]));
    h[0][0] + h[1][1] + h[2][2] + minors + determinant
}

impl Number for f64 {
    #[inline(always)]
    fn of(self, value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        self * by + plus
    }

    #[inline(always)]
    fn over(self, by: Self) -> Self {
        self / by
    }

    #[inline(always)]
    fn root(self) -> Self {
        self.sqrt()
    }

    #[inline(always)]
    fn inverse_cube_root(self) -> Self {
        1.0 / self.cbrt()
    }

    #[inline(always)]
    fn logarithm(self) -> Self {
        self.ln_1p()
    }

    #[inline(always)]
    fn exponential(self) -> Self {
        self.exp_m1()
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        self.min(other)
    }

    #[inline(always)]
    fn size(self) -> Self {
        self.abs()
    }

    #[inline(always)]
    fn choose(self, limit: Self, low: Self, high: Self) -> Self {
        if self < limit { low } else { high }
    }

    #[inline(always)]
    fn is_within(self, low: f64, high: f64) -> bool {
        (low..=high).contains(&self)
    }
}
