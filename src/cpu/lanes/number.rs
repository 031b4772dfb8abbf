//! Lanes of f32 of the processor's vectors as a [`Number`].

use std::ops::{Add, Mul, Sub};

use pulp::Simd;

use crate::number::Number;

/// Vectors of 8 f32, where this processor has them.
#[cfg(target_arch = "x86_64")]
pub type HalfWide = pulp::x86::V3;
/// See above; no other processor has wider ones to halve.
#[cfg(not(target_arch = "x86_64"))]
pub type HalfWide = pulp::Scalar;

/// Their token.
#[cfg(target_arch = "x86_64")]
pub fn half_wide() -> Option<HalfWide> {
    HalfWide::try_new()
}

/// Their token.
#[cfg(not(target_arch = "x86_64"))]
pub fn half_wide() -> Option<HalfWide> {
    None
}

/// One vector of f32.
#[derive(Debug, Clone, Copy)]
pub struct Lanes<S: Simd> {
    simd: S,
    value: S::f32s,
}

impl<S: Simd> Lanes<S> {
    /// Values per vector.
    pub const COUNT: usize = S::F32_LANES;

    /// The same value in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f32) -> Self {
        Lanes { simd, value: simd.splat_f32s(value) }
    }

    /// The values from `at` on.
    #[inline(always)]
    pub fn load(simd: S, values: &[f32], at: usize) -> Self {
        Lanes { simd, value: bytemuck::pod_read_unaligned(bytemuck::cast_slice(&values[at..at + Self::COUNT])) }
    }

    /// Writes the lanes from `at` on.
    #[inline(always)]
    pub fn store(self, values: &mut [f32], at: usize) {
        values[at..at + Self::COUNT].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&self.value)));
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Lanes { value: self.simd.add_f32s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Lanes { value: self.simd.sub_f32s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Lanes { value: self.simd.mul_f32s(self.value, other.value), ..self }
    }
}

impl<S: Simd> Number for Lanes<S> {
    #[inline(always)]
    fn of(self, value: f64) -> Self {
        Lanes { value: self.simd.splat_f32s(value as f32), ..self }
    }

    #[inline(always)]
    fn mul_add(self, by: Self, plus: Self) -> Self {
        Lanes { value: self.simd.mul_add_e_f32s(self.value, by.value, plus.value), ..self }
    }

    #[inline(always)]
    fn over(self, by: Self) -> Self {
        Lanes { value: self.simd.div_f32s(self.value, by.value), ..self }
    }

    #[inline(always)]
    fn root(self) -> Self {
        Lanes { value: self.simd.sqrt_f32s(self.value), ..self }
    }

    // Newton's method from the tangent at 1: off by 2e-7 at 2.2 at most.
    #[inline(always)]
    fn inverse_cube_root(self) -> Self {
        let third = self.of(1.0 / 3.0);
        let mut root = (self.of(4.0) - self) * third;
        for _ in 0..4 {
            root = root * (self.of(4.0) - self * root * root * root) * third;
        }
        root
    }

    // ln(1 + x) = 8 ln(1 + y) after three roots of 1 + x, by the series of y/(2 + y): digits of a small x are kept.
    #[inline(always)]
    fn logarithm(self) -> Self {
        let one = self.of(1.0);
        let mut y = self;
        for _ in 0..3 {
            y = y.over(one + (one + y).root());
        }
        let z = y.over(y + self.of(2.0));
        let square = z * z;
        let mut sum = self.of(1.0 / 11.0);
        let mut degree = 9;
        while degree > 0 {
            sum = square.mul_add(sum, self.of(1.0 / f64::from(degree)));
            degree -= 2;
        }
        self.of(16.0) * z * sum
    }

    // The series of x/32, then 1 + z squared five times.
    #[inline(always)]
    fn exponential(self) -> Self {
        let one = self.of(1.0);
        let x = self * self.of(1.0 / 32.0);
        let mut sum = x.mul_add(self.of(1.0 / 8.0), one);
        let mut degree = 7;
        while degree > 1 {
            sum = (x * self.of(1.0 / f64::from(degree))).mul_add(sum, one);
            degree -= 1;
        }
        let mut z = x * sum;
        for _ in 0..5 {
            z = z.mul_add(z, z + z);
        }
        z
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Lanes { value: self.simd.max_f32s(self.value, other.value), ..self }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Lanes { value: self.simd.min_f32s(self.value, other.value), ..self }
    }

    // `abs_f32s` is not inlined into functions for a vector unit: it was a call through memory, 11 % of a run.
    #[inline(always)]
    fn size(self) -> Self {
        self.larger(self.of(0.0) - self)
    }

    #[inline(always)]
    fn choose(self, limit: Self, low: Self, high: Self) -> Self {
        let below = self.simd.less_than_f32s(self.value, limit.value);
        Lanes { value: self.simd.select_f32s(below, low.value, high.value), ..self }
    }

    #[inline(always)]
    fn is_within(self, low: f64, high: f64) -> bool {
        let simd = self.simd;
        let above = simd.less_than_or_equal_f32s(simd.splat_f32s(low as f32), self.value);
        let below = simd.less_than_or_equal_f32s(self.value, simd.splat_f32s(high as f32));
        simd.first_true_m32s(simd.not_m32s(simd.and_m32s(above, below))) == Self::COUNT
    }
}
