//! Which way the material coordinate of a path is seen to grow. Equations: src/needle/opening.rs.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use super::opening::{dot, times};
use crate::number::{Number, Tensor};

/// Square of the cosine between path and needle from which on sections hang on where tissue is along the needle, and up to which they do not. A
/// choice: with 0.5 and 0.25, and with all of it, soft tissue that was turned by 25 and 60 degrees lost 3.5 % of the work, or had twice as much of it in
/// raised masses where it snapped back.
const ALONG: f64 = 0.99;
/// See [`ALONG`].
const ACROSS: f64 = 0.9;
/// Least stretch of the path along the needle that is divided by.
const LEAST_ALONG: f64 = 0.05;

/// Which way Z is seen to grow, n, and what its derivative by F_h needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenGradient<N> {
    pub n: [N; 3],
    /// n - t0 for k = 1.
    pub tilt: [N; 3],
    pub part: N,
    pub over_stretch: N,
    /// dk by t.dF t0, and by d.dF t0, with d = F_h t0.
    pub d: [N; 3],
    pub by_stretch: N,
    pub by_length: N,
}

impl<N: Number> SeenGradient<N> {
    /// From `F_h^T t`, F_h and t0.
    #[inline(always)]
    pub fn new(along: [N; 3], gradient: &Tensor<N>, rest_direction: [N; 3]) -> Self {
        let stretch = dot(along, rest_direction);
        let (none, one, two) = (stretch.of(0.0), stretch.of(1.0), stretch.of(2.0));
        let d = times(gradient, rest_direction);
        let over_square = one.over(dot(d, d).larger(one.of(1e-6)));
        let square = stretch * stretch.size() * over_square;
        let over_width = one.of(1.0 / (ALONG - ACROSS));
        let x = ((square - one.of(ACROSS)) * over_width).larger(none).smaller(one);
        let slope = one.of(6.0) * x * (one - x) * over_width;
        let part = x * x * (one.of(3.0) - two * x);
        let over_stretch = one.over(stretch.larger(one.of(LEAST_ALONG)));
        let (mut n, mut tilt) = (rest_direction, along);
        for a in 0..3 {
            tilt[a] = along[a].mul_add(over_stretch, none - rest_direction[a]);
            n[a] = tilt[a].mul_add(part, rest_direction[a]);
        }
        let by_stretch = two * slope * stretch.size() * over_square;
        SeenGradient { n, tilt, part, over_stretch, d, by_stretch, by_length: two * slope * square * over_square }
    }
}
