//! What a law is computed with: one f64, or several values of the lanes of a processor at once.

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
