//! How tissue around an opened path changes its volume. Equations: src/needle/opening.rs.

use crate::number::Number;

/// How the tissue around the hole changes its volume: within s lies `m = 1 + b - f/(s + q)` times `rc^2` more area than at rest. Around a narrow
/// hole tissue is stretched so far that it grows: by 5 % of the hole at Poisson's ratio 0.47, most of it within a third of a radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Growth {
    /// b: far from the path.
    pub gain: f64,
    /// f and q [m^2].
    pub fall: f64,
    pub reach: f64,
}

impl Default for Growth {
    fn default() -> Self {
        Growth { gain: 0.0, fall: 0.0, reach: 1.0 }
    }
}

impl Growth {
    /// Around a hole of the rest radius `hole` [m], half of the gain within the distance `half` [m].
    pub fn new(gain: f64, hole: f64, half: f64) -> Self {
        let root = hole * hole;
        let reach = (half * half - 2.0 * root).max(0.1 * root);
        Growth { gain, fall: gain * (root + reach), reach }
    }

    /// dm/ds at the square s of the distance [1/m^2].
    pub fn rate(&self, s: f64) -> f64 {
        self.fall / (s + self.reach).powi(2)
    }
}

/// [`Growth`] in the numbers that it is computed with.
#[derive(Debug, Clone, Copy)]
pub struct GrowthIn<N> {
    pub most: N,
    pub fall: N,
    pub reach: N,
}

impl Growth {
    /// In numbers of the kind of `n` and lengths of `unit` [m].
    #[inline(always)]
    pub fn in_lengths<N: Number>(&self, n: N, unit: f64) -> GrowthIn<N> {
        let area = unit * unit;
        GrowthIn { most: n.of(1.0 + self.gain), fall: n.of(self.fall / area), reach: n.of(self.reach / area) }
    }
}

impl<N: Number> GrowthIn<N> {
    /// w m with its derivatives by s, of w with these.
    #[inline(always)]
    pub(super) fn times(&self, s: N, [w, w1, w2]: [N; 3]) -> [N; 3] {
        let q = s.of(1.0).over(s + self.reach);
        let fall = self.fall * q;
        let (m, m1) = (self.most - fall, fall * q);
        let two = s.of(2.0);
        [w * m, w1.mul_add(m, w * m1), w2.mul_add(m, two * m1 * (w1 - w * q))]
    }

    /// w' m with its derivative by s, of w with its derivatives: what w m' does to a volume is known before.
    #[inline(always)]
    pub(super) fn fading(&self, s: N, [_, w1, w2]: [N; 3]) -> [N; 2] {
        let q = s.of(1.0).over(s + self.reach);
        let fall = self.fall * q;
        let m = self.most - fall;
        [w1 * m, w2.mul_add(m, w1 * (fall * q))]
    }
}
