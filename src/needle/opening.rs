//! Opening map: how a path of no width in the mesh becomes the hole that a needle fills.
//!
//! Nodes carry the tissue as if the needle had no thickness, `y = X + u`, and the map Phi takes y to the outside of the needle, across the
//! path only:
//! ```text
//! eta = (y - c) - t t.(y - c),  s = |eta|^2
//! x = y + (g - 1) eta,  g^2 = 1 + rc^2 v(s),  v = w(sqrt(s)) / (s + s0)
//! w = 1 up to 2R, then a quintic to 0 at 4R
//! ```
//! With `w = 1` the map keeps every volume: a hole of no width becomes one of the radius rc. The path at the material coordinate Z has its
//! centre in c(Z) and its radius in rc(Z), so with `H = P F_h - c_Z t0^T` (P takes out the part along t, F_h = grad y)
//! ```text
//! F = grad x = F_h + (g - 1) H + 2 g' eta (H^T eta)^T + g_rc rc_Z eta t0^T,   g' = dg/ds,  g_rc = dg/drc
//! ```
//! For an energy per volume with `P = dW/dF` the derivatives of W follow: with respect to F_h, eta, c_Z, rc and rc_Z ([`Opening::pull_back`]).
//! `s0`: a few micrometres squared, since no direction leads away from the middle of the path. Source: this project (docs/opening.md).

use glam::{DMat3, DVec3};

/// Radius up to which the hole is exact, and radius beyond which nothing of it is left, in needle radii.
pub const EXACT: f64 = 2.0;
/// See [`EXACT`].
pub const FADED: f64 = 4.0;

/// The path at one material coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Station {
    /// Middle of the path [m], and its rate with the material coordinate, across the path.
    pub centre: DVec3,
    pub centre_rate: DVec3,
    /// Radius of the needle there [m], and its rate with the material coordinate.
    pub radius: f64,
    pub radius_rate: f64,
}

/// What does not change along a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpeningMap {
    /// Direction of the needle (unit vector), and of the path at rest.
    pub direction: DVec3,
    pub rest_direction: DVec3,
    /// Radius R of the shaft [m], by which the map fades.
    pub shaft: f64,
    /// s0 [m^2].
    pub least: f64,
}

/// v(s) with its first and second derivatives.
fn fade_over_area(map: &OpeningMap, s: f64) -> [f64; 3] {
    let rho = s.sqrt();
    let (from, width) = (EXACT * map.shaft, (FADED - EXACT) * map.shaft);
    let x = ((rho - from) / width).clamp(0.0, 1.0);
    let (mut w, mut w1, mut w2) = (1.0, 0.0, 0.0);
    if x > 0.0 {
        w = 1.0 - x * x * x * (10.0 - x * (15.0 - 6.0 * x));
        let slope = -30.0 * x * x * (1.0 - x) * (1.0 - x) / width;
        let curvature = -60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / (width * width);
        w1 = slope / (2.0 * rho);
        w2 = curvature / (4.0 * s) - slope / (4.0 * s * rho);
    }
    let a = 1.0 / (s + map.least);
    [w * a, (w1 - w * a) * a, (w2 - 2.0 * (w1 - w * a) * a) * a]
}

/// The map at one point: all that its gradient and the derivatives of an energy need.
#[derive(Debug, Clone, Copy)]
pub struct Opening {
    map: OpeningMap,
    /// rc_Z there.
    radius_rate: f64,
    eta: DVec3,
    /// g and its derivatives by s; g_rc and its derivatives by s and rc.
    g: f64,
    g1: f64,
    g2: f64,
    gr: f64,
    gr1: f64,
    grr: f64,
    /// H.
    lateral: DMat3,
    /// det grad x / det F_h, with its derivatives by s and rc, as long as it does not turn.
    pub dilation: f64,
    dilation_by_area: f64,
    dilation_by_radius: f64,
}

/// Derivatives of an energy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivatives {
    /// By F_h.
    pub gradient: DMat3,
    /// By y (and, with the other sign, by c), across the path.
    pub place: DVec3,
    /// By c_Z.
    pub centre_rate: DVec3,
    /// By rc at fixed rc_Z, and by rc_Z.
    pub radius: f64,
    pub radius_rate: f64,
}

impl Derivatives {
    /// None (glam's default matrix is the identity).
    pub const ZERO: Derivatives = Derivatives {
        gradient: DMat3::ZERO,
        place: DVec3::ZERO,
        centre_rate: DVec3::ZERO,
        radius: 0.0,
        radius_rate: 0.0,
    };

    /// Adds those of another energy, `by` times.
    pub fn add(&mut self, other: &Derivatives, by: f64) {
        self.gradient += other.gradient * by;
        self.place += other.place * by;
        self.centre_rate += other.centre_rate * by;
        self.radius += other.radius * by;
        self.radius_rate += other.radius_rate * by;
    }
}

impl OpeningMap {
    /// A vector without its part along the needle.
    fn across(&self, v: DVec3) -> DVec3 {
        v - self.direction * v.dot(self.direction)
    }

    /// The map at the place y [m] with the gradient F_h of y.
    pub fn at(&self, station: &Station, y: DVec3, gradient: DMat3) -> Opening {
        let eta = self.across(y - station.centre);
        let s = eta.length_squared();
        let [v, v1, v2] = fade_over_area(self, s);
        let rc = station.radius;
        let g = (1.0 + rc * rc * v).sqrt();
        let g1 = rc * rc * v1 / (2.0 * g);
        let gr = rc * v / g;
        let columns = [gradient.x_axis, gradient.y_axis, gradient.z_axis];
        let along = [self.rest_direction.x, self.rest_direction.y, self.rest_direction.z];
        let h: [DVec3; 3] = std::array::from_fn(|a| self.across(columns[a]) - station.centre_rate * along[a]);
        Opening {
            map: *self,
            radius_rate: station.radius_rate,
            eta,
            g,
            g1,
            g2: rc * rc * v2 / (2.0 * g) - g1 * g1 / g,
            gr,
            gr1: rc * v1 / g - gr * g1 / g,
            grr: v / g - gr * gr / g,
            lateral: DMat3::from_cols(h[0], h[1], h[2]),
            dilation: 1.0 + rc * rc * (v + s * v1),
            dilation_by_area: rc * rc * (2.0 * v1 + s * v2),
            dilation_by_radius: 2.0 * rc * (v + s * v1),
        }
    }

    /// Where a place y [m] is seen, x [m].
    pub fn place(&self, station: &Station, y: DVec3) -> DVec3 {
        let eta = self.across(y - station.centre);
        let [v, ..] = fade_over_area(self, eta.length_squared());
        y + eta * ((1.0 + station.radius.powi(2) * v).sqrt() - 1.0)
    }
}

/// a b^T.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

impl Opening {
    /// Where the place lies from the middle of the path [m], across it.
    pub fn eta(&self) -> DVec3 {
        self.eta
    }

    /// F = grad x, from the gradient F_h that the map was made with.
    pub fn gradient(&self, gradient: DMat3) -> DMat3 {
        let ht_eta = self.lateral.transpose() * self.eta;
        gradient
            + self.lateral * (self.g - 1.0)
            + outer(self.eta, ht_eta * (2.0 * self.g1) + self.map.rest_direction * (self.gr * self.radius_rate))
    }

    /// Derivatives of an energy per volume, from its derivative P by F.
    pub fn pull_back(&self, p: DMat3) -> Derivatives {
        let Opening { eta, g, g1, g2, gr, gr1, grr, lateral: h, radius_rate: rcz, map, .. } = *self;
        let ht_eta = h.transpose() * eta;
        let pt_eta = p.transpose() * eta;
        let h_p = h.x_axis.dot(p.x_axis) + h.y_axis.dot(p.y_axis) + h.z_axis.dot(p.z_axis);
        let stretched = pt_eta.dot(ht_eta);
        let sheared = pt_eta.dot(map.rest_direction);
        let by_h = p * (g - 1.0) + outer(eta, pt_eta * (2.0 * g1));
        let by_h = DMat3::from_cols(map.across(by_h.x_axis), map.across(by_h.y_axis), map.across(by_h.z_axis));
        let place = eta * (2.0 * g1 * h_p + 4.0 * g2 * stretched + 2.0 * gr1 * rcz * sheared)
            + (p * ht_eta + h * pt_eta) * (2.0 * g1)
            + p * map.rest_direction * (gr * rcz);
        Derivatives {
            gradient: p + by_h,
            place: map.across(place),
            centre_rate: -(by_h * map.rest_direction),
            radius: gr * h_p + 2.0 * gr1 * stretched + grr * rcz * sheared,
            radius_rate: gr * sheared,
        }
    }

    /// Derivatives of an energy of the volume, from its derivative by the dilation of the map; that by F_h is not in it.
    pub fn pull_back_dilation(&self, by_dilation: f64) -> Derivatives {
        Derivatives {
            place: self.eta * (2.0 * self.dilation_by_area * by_dilation),
            radius: self.dilation_by_radius * by_dilation,
            ..Derivatives::ZERO
        }
    }

    /// By how much a change of F_h grows in F at most, and by how much one of eta does [1/m]. Along and across eta the third derivative of
    /// the map has the entries `6 g' |eta| + 4 g'' |eta|^3` (three times along) and `2 g' |eta|` (once along); the first vanishes near the path.
    pub fn amplification(&self) -> (f64, f64) {
        let eta = self.eta.length();
        let along = self.g + 2.0 * self.g1 * eta * eta;
        let third = (6.0 * self.g1 * eta + 4.0 * self.g2 * eta.powi(3)).abs().max(2.0 * self.g1.abs() * eta);
        let by_place = squared_norm_bound(self.lateral).sqrt() * third
            + self.radius_rate.abs() * (self.gr + 2.0 * self.gr1.abs() * eta * eta);
        (self.g.max(along.abs()).max(1.0), by_place)
    }
}

/// Bound of the square of the spectral norm: largest sum of a column times that of a row.
pub fn squared_norm_bound(m: DMat3) -> f64 {
    let sums = |m: DMat3| {
        let column = |c: DVec3| c.abs().element_sum();
        column(m.x_axis).max(column(m.y_axis)).max(column(m.z_axis))
    };
    sums(m) * sums(m.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> OpeningMap {
        let direction = DVec3::new(0.2, -0.3, -1.0).normalize();
        OpeningMap { direction, rest_direction: DVec3::new(0.25, -0.2, -1.0).normalize(), shaft: 0.8e-3, least: 4e-10 }
    }

    fn station() -> Station {
        let across = |v: DVec3| map().across(v);
        Station {
            centre: DVec3::new(1e-4, -2e-4, 3e-4),
            centre_rate: across(DVec3::new(0.05, 0.02, 0.0)),
            radius: 0.5e-3,
            radius_rate: -0.3,
        }
    }

    const GRADIENT: DMat3 =
        DMat3::from_cols(DVec3::new(1.1, 0.05, -0.02), DVec3::new(-0.1, 0.95, 0.04), DVec3::new(0.03, -0.06, 0.97));

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
            let f = map.at(&station, y, GRADIENT).gradient(GRADIENT);
            for (axis, column) in [(DVec3::X, f.x_axis), (DVec3::Y, f.y_axis), (DVec3::Z, f.z_axis)] {
                let step = 1e-8;
                let at = |h: f64| {
                    let along = h * axis.dot(map.rest_direction);
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
            let value = |s: &Station, y: DVec3, g: DMat3| energy(map.at(s, y, g).gradient(g)).0;
            let opening = map.at(&station, y, GRADIENT);
            let (w, p) = energy(opening.gradient(GRADIENT));
            let got = opening.pull_back(p);
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
                    got.centre_rate.dot(lateral),
                    "centre rate",
                );
                for b in 0..3 {
                    let mut change = DMat3::ZERO;
                    change.col_mut(a)[b] = h;
                    close(
                        value(&station, y, GRADIENT + change),
                        value(&station, y, GRADIENT - change),
                        h,
                        got.gradient.col(a)[b],
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
            let dilation = |s: &Station, y: DVec3| map.at(s, y, GRADIENT).dilation;
            let got = opening.pull_back_dilation(1.0);
            let h = 1e-9;
            for a in 0..3 {
                let e = DVec3::AXES[a] * h;
                let difference = (dilation(&station, y + e) - dilation(&station, y - e)) / (2.0 * h);
                assert!((difference - got.place[a]).abs() < 1e-3, "{difference} {}", got.place[a]);
            }
            let difference = (dilation(&radius(h), y) - dilation(&radius(-h), y)) / (2.0 * h);
            assert!((difference - got.radius).abs() < 1e-3, "{difference} {}", got.radius);
        }
    }

    #[test]
    fn a_line_becomes_a_hole_and_volume_is_kept() {
        let map = OpeningMap { least: 0.0, ..map() };
        let straight = Station { radius: 0.8e-3, ..Station::default() };
        let side = map.across(DVec3::X).normalize();
        let x = map.place(&straight, side * 1e-7);
        assert!((x.dot(side) - 0.8e-3).abs() < 1e-9);
        assert_eq!(map.place(&straight, side * 4.9e-3), side * 4.9e-3);
        for rho in [1e-5, 1e-4, 1e-3, 1.5e-3] {
            let opening = map.at(&straight, side * rho, DMat3::IDENTITY);
            assert!((opening.gradient(DMat3::IDENTITY).determinant() - 1.0).abs() < 1e-9);
            assert!((opening.dilation - 1.0).abs() < 1e-12);
        }
        let opening = map.at(&straight, side * 3e-3, DMat3::IDENTITY);
        let det = opening.gradient(DMat3::IDENTITY).determinant();
        assert!((opening.dilation - det).abs() < 1e-9, "{} {det}", opening.dilation);
    }
}
