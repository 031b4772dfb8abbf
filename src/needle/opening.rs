//! Opening map: how a path of no width in the mesh becomes the hole that a needle fills.
//!
//! Nodes carry the tissue as if the needle had no thickness, `y = X + u`, and the map Phi takes y to the outside of the needle, across the
//! path only:
//! ```text
//! eta = (y - c) - t t.(y - c),  s = |eta|^2
//! x = y + (g - 1) eta,  g^2 = 1 + rc^2 v(s),  v = w(sqrt(s)) m(s) / (s + s0)
//! w = 1 up to 2R, then a quintic to 0 at 4R
//! m = 1 + b - f/(s + q)
//! ```
//! With `w m = 1` the map keeps every volume: a hole of no width becomes one of the radius rc. The growth m is what tissue that changes
//! its volume does around such a hole ([`Growth`]), on a scale that no cell resolves; it is 1 where the hole begins. The path at the material coordinate Z has its
//! centre in c(Z) and its radius in rc(Z), so with `H = P F_h - c_Z t0^T` (P takes out the part along t, F_h = grad y)
//! ```text
//! F = grad x = F_h + (g - 1) H + 2 g' eta (H^T eta)^T + g_rc rc_Z eta t0^T,   g' = dg/ds,  g_rc = dg/drc
//! ```
//! For an energy per volume with `P = dW/dF` the derivatives of W follow: with respect to F_h, eta, c_Z, rc and rc_Z ([`Opening::pull_back`]).
//! `s0`: a few micrometres squared, since no direction leads away from the middle of the path. Source: this project (docs/opening.md).

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::{DMat3, DVec3};

use crate::number::{Number, Tensor};

/// Radius up to which the hole is exact, and radius beyond which nothing of it is left, in needle radii.
pub const EXACT: f64 = 2.0;
/// See [`EXACT`].
pub const FADED: f64 = 4.0;

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

/// The path at one material coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Station {
    /// Middle of the path [m], and its rate with the material coordinate, across the path.
    pub centre: DVec3,
    pub centre_rate: DVec3,
    /// Radius of the needle there [m], and its rate with the material coordinate.
    pub radius: f64,
    pub radius_rate: f64,
    /// Direction of the path at rest t0 (unit vector): gradient of the material coordinate.
    pub rest_direction: DVec3,
    pub growth: Growth,
    /// Part of the stress beside it that has relaxed.
    pub relaxed: f64,
}

impl Station {
    /// Part of the stress beside it that is left.
    pub fn left(&self) -> f64 {
        1.0 - self.relaxed
    }

    /// The mean of some.
    pub fn mean(stations: &[Station]) -> Station {
        let mut mean = Station { growth: Growth { gain: 0.0, fall: 0.0, reach: 0.0 }, ..Station::default() };
        let by = 1.0 / stations.len() as f64;
        for station in stations {
            mean.centre += station.centre * by;
            mean.centre_rate += station.centre_rate * by;
            mean.radius += station.radius * by;
            mean.radius_rate += station.radius_rate * by;
            mean.rest_direction += station.rest_direction * by;
            mean.growth.gain += station.growth.gain * by;
            mean.growth.fall += station.growth.fall * by;
            mean.growth.reach += station.growth.reach * by;
            mean.relaxed += station.relaxed * by;
        }
        mean
    }
}

/// What is the same along a whole path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpeningMap {
    /// Direction of the needle (unit vector).
    pub direction: DVec3,
    /// Radius R of the shaft [m], by which the map fades.
    pub shaft: f64,
    /// s0 [m^2].
    pub least: f64,
}

/// The same in the numbers that it is computed with.
#[derive(Debug, Clone, Copy)]
pub struct MapIn<N> {
    direction: [N; 3],
    /// Where it begins to fade [m], and one over the length on which it does [1/m].
    from: N,
    over_width: N,
    least: N,
}

/// What a place needs of the path: where it lies from the middle [m], the rate of the middle, the radius and its rate, the direction at rest.
#[derive(Debug, Clone, Copy)]
pub struct Beside<N> {
    pub offset: [N; 3],
    pub centre_rate: [N; 3],
    pub radius: N,
    pub radius_rate: N,
    pub rest_direction: [N; 3],
    pub growth: GrowthIn<N>,
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
    fn times(&self, s: N, [w, w1, w2]: [N; 3]) -> [N; 3] {
        let q = s.of(1.0).over(s + self.reach);
        let fall = self.fall * q;
        let (m, m1) = (self.most - fall, fall * q);
        let two = s.of(2.0);
        [w * m, w1.mul_add(m, w * m1), w2.mul_add(m, two * m1 * (w1 - w * q))]
    }

    /// w' m with its derivative by s, of w with its derivatives: what w m' does to a volume is known before.
    #[inline(always)]
    fn fading(&self, s: N, [_, w1, w2]: [N; 3]) -> [N; 2] {
        let q = s.of(1.0).over(s + self.reach);
        let fall = self.fall * q;
        let m = self.most - fall;
        [w1 * m, w2.mul_add(m, w1 * (fall * q))]
    }
}

/// The map at one point: all that its gradient and the derivatives of an energy need.
#[derive(Debug, Clone, Copy)]
pub struct Opening<N> {
    map: MapIn<N>,
    /// rc_Z and t0 there.
    radius_rate: N,
    rest_direction: [N; 3],
    eta: [N; 3],
    square: N,
    /// g - 1, g and its derivatives by s; g_rc and its derivatives by s and rc.
    g_less: N,
    g: N,
    g1: N,
    g2: N,
    gr: N,
    gr1: N,
    grr: N,
    /// H.
    lateral: Tensor<N>,
}

/// What the map does to a volume at one point by fading: what it does by growing near the path is known before, cell by cell.
#[derive(Debug, Clone, Copy)]
pub struct Dilation<N> {
    eta: [N; 3],
    /// det grad x / det F_h less one, with its derivatives by s and rc, as long as it does not turn. With `s0 = 0`, where it is `rc^2 w'` and
    /// has no pole: with another a volume within some hundredths of a millimetre of the path grew by `rc^2/s0`, a millionfold.
    pub less_one: N,
    by_area: N,
    by_radius: N,
}

/// Derivatives of an energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivatives<N> {
    /// By F_h.
    pub gradient: Tensor<N>,
    /// By y (and, with the other sign, by c), across the path.
    pub place: [N; 3],
    /// By c_Z.
    pub centre_rate: [N; 3],
    /// By rc at fixed rc_Z, and by rc_Z.
    pub radius: N,
    pub radius_rate: N,
}

impl<N: Number> Derivatives<N> {
    /// None, in the kind of number of `n`.
    #[inline(always)]
    pub fn none(n: N) -> Self {
        let zero = n.of(0.0);
        Derivatives {
            gradient: [[zero; 3]; 3],
            place: [zero; 3],
            centre_rate: [zero; 3],
            radius: zero,
            radius_rate: zero,
        }
    }

    /// Adds those of another energy, `by` times.
    #[inline(always)]
    pub fn add(&mut self, other: &Self, by: N) {
        for a in 0..3 {
            for b in 0..3 {
                self.gradient[a][b] = other.gradient[a][b].mul_add(by, self.gradient[a][b]);
            }
            self.place[a] = other.place[a].mul_add(by, self.place[a]);
            self.centre_rate[a] = other.centre_rate[a].mul_add(by, self.centre_rate[a]);
        }
        self.radius = other.radius.mul_add(by, self.radius);
        self.radius_rate = other.radius_rate.mul_add(by, self.radius_rate);
    }
}

/// Of two vectors.
#[inline(always)]
fn dot<N: Number>(a: [N; 3], b: [N; 3]) -> N {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// `m v`, of a tensor by its columns.
#[inline(always)]
fn times<N: Number>(m: &Tensor<N>, v: [N; 3]) -> [N; 3] {
    let mut product = [v[0]; 3];
    for b in 0..3 {
        product[b] = m[2][b].mul_add(v[2], m[1][b].mul_add(v[1], m[0][b] * v[0]));
    }
    product
}

/// `m^T v`.
#[inline(always)]
fn transposed_times<N: Number>(m: &Tensor<N>, v: [N; 3]) -> [N; 3] {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// v less its part along a unit vector.
#[inline(always)]
fn across<N: Number>(direction: [N; 3], v: [N; 3]) -> [N; 3] {
    let along = dot(direction, v);
    [v[0] - direction[0] * along, v[1] - direction[1] * along, v[2] - direction[2] * along]
}

impl OpeningMap {
    /// A vector without its part along the needle.
    fn across(&self, v: DVec3) -> DVec3 {
        v - self.direction * v.dot(self.direction)
    }

    /// In numbers of the kind of `n` and lengths in metres.
    #[inline(always)]
    pub fn in_numbers<N: Number>(&self, n: N) -> MapIn<N> {
        self.in_lengths(n, 1.0)
    }

    /// In numbers of the kind of `n` and lengths in radii of the needle: in metres powers of a short one leave the range of f32.
    #[inline(always)]
    pub fn in_radii<N: Number>(&self, n: N) -> MapIn<N> {
        self.in_lengths(n, self.shaft)
    }

    #[inline(always)]
    fn in_lengths<N: Number>(&self, n: N, unit: f64) -> MapIn<N> {
        MapIn {
            direction: self.direction.to_array().map(|x| n.of(x)),
            from: n.of(EXACT * self.shaft / unit),
            over_width: n.of(unit / ((FADED - EXACT) * self.shaft)),
            least: n.of(self.least / (unit * unit)),
        }
    }

    /// The map at the place y [m] with the gradient of the displacement `y - X` there.
    pub fn at(&self, station: &Station, y: DVec3, h: DMat3) -> Opening<f64> {
        let beside = Beside {
            offset: (y - station.centre).to_array(),
            centre_rate: station.centre_rate.to_array(),
            radius: station.radius,
            radius_rate: station.radius_rate,
            rest_direction: station.rest_direction.to_array(),
            growth: station.growth.in_lengths(0.0, 1.0),
        };
        self.in_numbers(0.0).at(&beside, &h.to_cols_array_2d())
    }

    /// What the map does to a volume at the place y [m].
    pub fn dilation(&self, station: &Station, y: DVec3) -> Dilation<f64> {
        let growth = station.growth.in_lengths(0.0, 1.0);
        self.in_numbers(0.0).dilation((y - station.centre).to_array(), station.radius, &growth)
    }

    /// Where a place y [m] is seen, x [m].
    pub fn place(&self, station: &Station, y: DVec3) -> DVec3 {
        let eta = self.across(y - station.centre);
        let map = self.in_numbers(0.0);
        let [v, ..] = map.fade_over_area(eta.length_squared(), &station.growth.in_lengths(0.0, 1.0));
        y + eta * ((1.0 + station.radius.powi(2) * v).sqrt() - 1.0)
    }
}

impl<N: Number> MapIn<N> {
    /// w by s, with its first and second derivatives.
    #[inline(always)]
    fn fade(&self, s: N) -> [N; 3] {
        let MapIn { from, over_width, .. } = *self;
        let (none, one, two) = (s.of(0.0), s.of(1.0), s.of(2.0));
        let rho = s.root();
        let x = ((rho - from) * over_width).larger(none).smaller(one);
        let left = one - x;
        let w = one - x * x * x * (s.of(10.0) - x * (s.of(15.0) - s.of(6.0) * x));
        let slope = s.of(-30.0) * x * x * left * left * over_width;
        let curvature = s.of(-60.0) * x * left * (one - two * x) * over_width * over_width;
        // Nothing fades before `from`, and nothing is divided by zero on the path.
        let over_rho = one.over(rho.larger(from));
        let w1 = s.of(0.5) * slope * over_rho;
        let w2 = s.of(0.25) * over_rho * over_rho * (curvature - slope * over_rho);
        [w, w1, w2]
    }

    /// v(s) with its first and second derivatives.
    #[inline(always)]
    fn fade_over_area(&self, s: N, growth: &GrowthIn<N>) -> [N; 3] {
        let [w, w1, w2] = growth.times(s, self.fade(s));
        let a = s.of(1.0).over(s + self.least);
        let fall = w1 - w * a;
        [w * a, fall * a, (w2 - s.of(2.0) * fall * a) * a]
    }

    /// What the map does to a volume, at a place that lies `offset` [m] from the middle of the path of the radius `rc` [m].
    #[inline(always)]
    pub fn dilation(&self, offset: [N; 3], rc: N, growth: &GrowthIn<N>) -> Dilation<N> {
        let eta = across(self.direction, offset);
        let s = dot(eta, eta);
        let [w1, w2] = growth.fading(s, self.fade(s));
        Dilation { eta, less_one: rc * rc * w1, by_area: rc * rc * w2, by_radius: rc.of(2.0) * rc * w1 }
    }

    /// The map at a place beside the path, with the gradient of the displacement there.
    #[inline(always)]
    pub fn at(&self, beside: &Beside<N>, h: &Tensor<N>) -> Opening<N> {
        let rc = beside.radius;
        let one = rc.of(1.0);
        let eta = across(self.direction, beside.offset);
        let s = dot(eta, eta);
        let [v, v1, v2] = self.fade_over_area(s, &beside.growth);
        let area = rc * rc;
        let g = (one + area * v).root();
        let over_g = one.over(g);
        let g1 = rc.of(0.5) * area * v1 * over_g;
        let gr = rc * v * over_g;
        let mut lateral = *h;
        for a in 0..3 {
            let mut column = h[a];
            column[a] = column[a] + one;
            column = across(self.direction, column);
            for b in 0..3 {
                column[b] = column[b] - beside.centre_rate[b] * beside.rest_direction[a];
            }
            lateral[a] = column;
        }
        Opening {
            map: *self,
            radius_rate: beside.radius_rate,
            rest_direction: beside.rest_direction,
            eta,
            square: s,
            g_less: (area * v).over(g + one),
            g,
            g1,
            g2: rc.of(0.5) * area * v2 * over_g - g1 * g1 * over_g,
            gr,
            gr1: (rc * v1 - gr * g1) * over_g,
            grr: (v - gr * gr) * over_g,
            lateral,
        }
    }
}

impl<N: Number> Dilation<N> {
    /// Derivatives of an energy of the volume by y and by rc, from its derivative by the dilation of the map; that by F_h is not in it.
    #[inline(always)]
    pub fn pull_back(&self, by_dilation: N) -> ([N; 3], N) {
        let by = by_dilation.of(2.0) * self.by_area * by_dilation;
        ([self.eta[0] * by, self.eta[1] * by, self.eta[2] * by], self.by_radius * by_dilation)
    }
}

/// a b^T.
#[inline(always)]
pub fn outer<N: Number>(a: [N; 3], b: [N; 3]) -> Tensor<N> {
    [
        [a[0] * b[0], a[1] * b[0], a[2] * b[0]],
        [a[0] * b[1], a[1] * b[1], a[2] * b[1]],
        [a[0] * b[2], a[1] * b[2], a[2] * b[2]],
    ]
}

impl<N: Number> Opening<N> {
    /// Distance of the place from the middle of the path [m], across it.
    #[inline(always)]
    pub fn distance(&self) -> N {
        self.square.root()
    }

    /// F - I, of F = grad x, from the gradient of the displacement that the map was made with.
    #[inline(always)]
    pub fn gradient(&self, h: &Tensor<N>) -> Tensor<N> {
        let Opening { eta, g_less, g1, gr, lateral, rest_direction, .. } = *self;
        let ht_eta = transposed_times(&lateral, eta);
        let (twice, widening) = (self.g.of(2.0) * g1, gr * self.radius_rate);
        let mut f = *h;
        for a in 0..3 {
            let by_eta = ht_eta[a].mul_add(twice, rest_direction[a] * widening);
            for b in 0..3 {
                f[a][b] = eta[b].mul_add(by_eta, lateral[a][b].mul_add(g_less, f[a][b]));
            }
        }
        f
    }

    /// Derivatives of an energy per volume, from its derivative P by F.
    #[inline(always)]
    pub fn pull_back(&self, p: &Tensor<N>) -> Derivatives<N> {
        let Opening {
            eta, g_less, g1, g2, gr, gr1, grr, lateral: h, radius_rate: rcz, rest_direction: t0, map, ..
        } = *self;
        let two = g1.of(2.0);
        let twice = two * g1;
        let (ht_eta, pt_eta) = (transposed_times(&h, eta), transposed_times(p, eta));
        let h_p = dot(h[2], p[2]) + (dot(h[1], p[1]) + dot(h[0], p[0]));
        let (stretched, sheared) = (dot(pt_eta, ht_eta), dot(pt_eta, t0));
        let mut by_h = *p;
        for a in 0..3 {
            let by_eta = pt_eta[a] * twice;
            let column = [
                eta[0].mul_add(by_eta, p[a][0] * g_less),
                eta[1].mul_add(by_eta, p[a][1] * g_less),
                eta[2].mul_add(by_eta, p[a][2] * g_less),
            ];
            by_h[a] = across(map.direction, column);
        }
        let along_eta = twice * h_p + g1.of(4.0) * g2 * stretched + two * gr1 * rcz * sheared;
        let (p_ht_eta, h_pt_eta, p_t0) = (times(p, ht_eta), times(&h, pt_eta), times(p, t0));
        let widening = gr * rcz;
        let mut place = eta;
        for b in 0..3 {
            place[b] = p_t0[b].mul_add(widening, (p_ht_eta[b] + h_pt_eta[b]).mul_add(twice, eta[b] * along_eta));
        }
        let rate = times(&by_h, t0);
        let none = g1.of(0.0);
        let mut gradient = by_h;
        for a in 0..3 {
            for b in 0..3 {
                gradient[a][b] = p[a][b] + by_h[a][b];
            }
        }
        Derivatives {
            gradient,
            place: across(map.direction, place),
            centre_rate: [none - rate[0], none - rate[1], none - rate[2]],
            radius: gr * h_p + two * gr1 * stretched + grr * rcz * sheared,
            radius_rate: gr * sheared,
        }
    }

    /// By how much a change of F_h grows in F at most, and by how much one of eta does [1/m]. Along and across eta the third derivative of
    /// the map has the entries `6 g' |eta| + 4 g'' |eta|^3` (three times along) and `2 g' |eta|` (once along); the first vanishes near the path.
    #[inline(always)]
    pub fn amplification(&self) -> (N, N) {
        let Opening { g, g1, g2, square, .. } = *self;
        let (one, two) = (g.of(1.0), g.of(2.0));
        let eta = self.distance();
        let along = g + two * g1 * square;
        let third = (g.of(6.0) * g1 * eta + g.of(4.0) * g2 * square * eta).size().larger(two * g1.size() * eta);
        let by_place = squared_norm_bound(&self.lateral).root() * third
            + self.radius_rate.size() * (self.gr + two * self.gr1.size() * square);
        (g.larger(along.size()).larger(one), by_place)
    }
}

/// Bound of the square of the spectral norm: largest sum of a column times that of a row.
#[inline(always)]
pub fn squared_norm_bound<N: Number>(m: &Tensor<N>) -> N {
    let (mut columns, mut rows) = (m[0], m[0]);
    for a in 0..3 {
        columns[a] = m[a][0].size() + m[a][1].size() + m[a][2].size();
        rows[a] = m[0][a].size() + m[1][a].size() + m[2][a].size();
    }
    columns[0].larger(columns[1]).larger(columns[2]) * rows[0].larger(rows[1]).larger(rows[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> OpeningMap {
        let direction = DVec3::new(0.2, -0.3, -1.0).normalize();
        OpeningMap { direction, shaft: 0.8e-3, least: 4e-10 }
    }

    fn station() -> Station {
        let across = |v: DVec3| map().across(v);
        Station {
            centre: DVec3::new(1e-4, -2e-4, 3e-4),
            centre_rate: across(DVec3::new(0.05, 0.02, 0.0)),
            radius: 0.5e-3,
            radius_rate: -0.3,
            rest_direction: DVec3::new(0.25, -0.2, -1.0).normalize(),
            growth: Growth::new(0.07, 0.1e-3, 0.3e-3),
            relaxed: 0.0,
        }
    }

    const GRADIENT: DMat3 =
        DMat3::from_cols(DVec3::new(1.1, 0.05, -0.02), DVec3::new(-0.1, 0.95, 0.04), DVec3::new(0.03, -0.06, 0.97));

    /// F - I, and back.
    fn less(f: DMat3) -> Tensor<f64> {
        (f - DMat3::IDENTITY).to_cols_array_2d()
    }

    fn full(less: Tensor<f64>) -> DMat3 {
        DMat3::from_cols_array_2d(&less) + DMat3::IDENTITY
    }

    /// Any smooth function of F stands for an energy.
    fn energy(f: DMat3) -> (f64, DMat3) {
        let m = DMat3::from_cols(DVec3::new(1.0, 2.0, 0.5), DVec3::new(-0.7, 1.5, 0.3), DVec3::new(0.2, -0.4, 0.9));
        let c = m.x_axis.dot(f.x_axis) + m.y_axis.dot(f.y_axis) + m.z_axis.dot(f.z_axis);
        let n = f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared();
        (0.5 * c * c + 0.25 * n * n, m * c + f * n)
    }

    /// Values near and far: exact part, faded part, beyond.
    fn places() -> [DVec3; 4] {
        [
            DVec3::new(2e-4, -1e-4, -1e-4),
            DVec3::new(1.1e-3, 0.3e-3, 0.0),
            DVec3::new(-2.2e-3, 1.5e-3, 1e-3),
            DVec3::new(0.0, 6e-3, 0.0),
        ]
    }

    #[test]
    fn the_gradient_is_that_of_the_map() {
        // x(X) for fields y, c and rc that are linear near one material point.
        let (map, station) = (map(), station());
        for y in places() {
            let opening = map.at(&station, y, GRADIENT - DMat3::IDENTITY);
            let f = full(opening.gradient(&less(GRADIENT)));
            for (axis, column) in [(DVec3::X, f.x_axis), (DVec3::Y, f.y_axis), (DVec3::Z, f.z_axis)] {
                let step = 1e-8;
                let at = |h: f64| {
                    let along = h * axis.dot(station.rest_direction);
                    let moved = Station {
                        centre: station.centre + station.centre_rate * along,
                        radius: station.radius + station.radius_rate * along,
                        ..station
                    };
                    map.place(&moved, y + GRADIENT * axis * h)
                };
                let difference = (at(step) - at(-step)) / (2.0 * step);
                assert!((difference - column).length() < 1e-6, "{difference} {column}");
            }
        }
    }

    #[test]
    fn derivatives_of_an_energy_are_those_of_differences() {
        let (map, station) = (map(), station());
        for y in places() {
            let seen = |s: &Station, y: DVec3, g: DMat3| {
                let opening = map.at(s, y, g - DMat3::IDENTITY);
                (opening, full(opening.gradient(&less(g))))
            };
            let value = |s: &Station, y: DVec3, g: DMat3| energy(seen(s, y, g).1).0;
            let (opening, f) = seen(&station, y, GRADIENT);
            let (w, p) = energy(f);
            let got = opening.pull_back(&p.to_cols_array_2d());
            let close = |plus: f64, minus: f64, step: f64, exact: f64, what: &str| {
                let difference = (plus - minus) / (2.0 * step);
                let bound = 1e-6
                    * exact.abs().max(w / 1e-3 * if what == "gradient" || what.contains("rate") { 1e-3 } else { 1.0 });
                assert!((difference - exact).abs() < bound, "{what} at {y}: {difference} {exact}");
            };
            for a in 0..3 {
                let e = DVec3::AXES[a];
                let h = 1e-9;
                close(
                    value(&station, y + e * h, GRADIENT),
                    value(&station, y - e * h, GRADIENT),
                    h,
                    got.place[a],
                    "place",
                );
                let lateral = map.across(e);
                let rate = |h: f64| Station { centre_rate: station.centre_rate + lateral * h, ..station };
                let h = 1e-6;
                close(
                    value(&rate(h), y, GRADIENT),
                    value(&rate(-h), y, GRADIENT),
                    h,
                    DVec3::from(got.centre_rate).dot(lateral),
                    "centre rate",
                );
                for b in 0..3 {
                    let mut change = DMat3::ZERO;
                    change.col_mut(a)[b] = h;
                    close(
                        value(&station, y, GRADIENT + change),
                        value(&station, y, GRADIENT - change),
                        h,
                        got.gradient[a][b],
                        "gradient",
                    );
                }
            }
            let h = 1e-9;
            let radius = |h: f64| Station { radius: station.radius + h, ..station };
            close(value(&radius(h), y, GRADIENT), value(&radius(-h), y, GRADIENT), h, got.radius, "radius");
            let h = 1e-6;
            let rate = |h: f64| Station { radius_rate: station.radius_rate + h, ..station };
            close(value(&rate(h), y, GRADIENT), value(&rate(-h), y, GRADIENT), h, got.radius_rate, "radius rate");
            // The volume.
            let dilation = |s: &Station, y: DVec3| 1.0 + map.dilation(s, y).less_one;
            let (by_place, by_radius) = map.dilation(&station, y).pull_back(1.0);
            let h = 1e-9;
            for a in 0..3 {
                let e = DVec3::AXES[a] * h;
                let difference = (dilation(&station, y + e) - dilation(&station, y - e)) / (2.0 * h);
                assert!((difference - by_place[a]).abs() < 1e-3, "{difference} {}", by_place[a]);
            }
            let difference = (dilation(&radius(h), y) - dilation(&radius(-h), y)) / (2.0 * h);
            assert!((difference - by_radius).abs() < 1e-3, "{difference} {by_radius}");
        }
    }

    #[test]
    fn a_line_becomes_a_hole_and_volume_is_kept() {
        let map = OpeningMap { least: 0.0, ..map() };
        let straight = Station { radius: 0.8e-3, rest_direction: map.direction, ..Station::default() };
        let grown = Station { growth: Growth::new(0.07, 0.1e-3, 0.3e-3), ..straight };
        let side = map.across(DVec3::X).normalize();
        let x = map.place(&straight, side * 1e-7);
        assert!((x.dot(side) - 0.8e-3).abs() < 1e-9);
        assert_eq!(map.place(&straight, side * 4.9e-3), side * 4.9e-3);
        for rho in [1e-5, 1e-4, 1e-3, 1.5e-3] {
            let opening = map.at(&straight, side * rho, DMat3::ZERO);
            assert!((full(opening.gradient(&less(DMat3::IDENTITY))).determinant() - 1.0).abs() < 1e-9);
            assert!(map.dilation(&straight, side * rho).less_one.abs() < 1e-12);
        }
        let opening = map.at(&straight, side * 3e-3, DMat3::ZERO);
        let det = full(opening.gradient(&less(DMat3::IDENTITY))).determinant();
        let dilation = 1.0 + map.dilation(&straight, side * 3e-3).less_one;
        assert!((dilation - det).abs() < 1e-9, "{dilation} {det}");
        // Where the hole begins a growth changes nothing, and half of it lies where it says.
        let area = |rho: f64| (map.place(&grown, side * rho).length_squared() - rho * rho) / 0.8e-3f64.powi(2);
        assert!((area(0.1e-3) - 1.0).abs() < 1e-9 && (area(0.3e-3) - 1.035).abs() < 1e-9);
        for rho in [1e-4, 3e-4, 1.5e-3, 3e-3] {
            let det = full(map.at(&grown, side * rho, DMat3::ZERO).gradient(&less(DMat3::IDENTITY))).determinant();
            let [w, ..] = map.in_numbers(0.0).fade(rho * rho);
            let growing = 0.8e-3f64.powi(2) * w * grown.growth.rate(rho * rho);
            let dilation = 1.0 + map.dilation(&grown, side * rho).less_one + growing;
            assert!((dilation - det).abs() < 1e-9, "{rho}: {dilation} {det}");
        }
    }
}
