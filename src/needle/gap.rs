//! Gap functions of the needle: how deep a point of the tissue lies inside the needle, and the gradient.
//!
//! Every contact of the needle is a potential in the needle's frame,
//! ```text
//! U = 1/2 k phi^2 where phi > 0,  f = -dU/dx = -k phi grad phi                            [J], [N]
//! ```
//! with the exact gradient, so that a contact that is made at phi = 0 gives back what it took: it creates no energy.
//! A force along another normal than grad phi does not (a bevel with radial normals created half of the needle's work in
//! the project's trials). Only the direction `grad phi/|grad phi|` is used for damping and friction.

use glam::DVec3;

use super::{NeedleShape, TipShape, lateral_axes};

/// Overlap phi [m] (positive inside the needle) and its gradient with respect to the position of the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    pub value: f64,
    pub gradient: DVec3,
}

/// The outer surface of a needle in its own frame: `s` runs from the tip to the hub.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Radius R of the shaft and length Lc of the tip [m].
    pub radius: f64,
    pub tip_length: f64,
    /// Shift of the section's centre per radius: zero for a cone; for a bevel the unit vector from the apex to the axis, so
    /// that all sections touch the line through the apex parallel to the axis.
    pub shift: DVec3,
    /// The bore of a hollow needle.
    pub bore: Option<BoreProfile>,
}

/// Radii of a hollow needle inside its shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoreProfile {
    /// Radius of the cutting edge [m].
    pub edge: f64,
    /// Radius of the bore [m].
    pub radius: f64,
}

/// Half width of the section, in shaft radii, below which the push to the own side of a slit fades.
const SLIT_FADE: f64 = 0.2;

impl Profile {
    /// The profile of a needle that points along `direction`.
    pub fn new(needle: &NeedleShape, direction: DVec3) -> Self {
        let shift = match needle.tip {
            TipShape::Cone => DVec3::ZERO,
            TipShape::Bevel { heading } => {
                let (e1, e2) = lateral_axes(direction);
                -(e1 * heading.cos() + e2 * heading.sin())
            }
        };
        let bore = needle.bore.map(|b| BoreProfile { edge: b.edge, radius: b.radius });
        Profile { radius: needle.radius, tip_length: needle.tip_length, shift, bore }
    }

    /// Radius of the section at `s` behind the tip, and its slope d rc/ds.
    pub fn section(&self, s: f64) -> (f64, f64) {
        if s < self.tip_length {
            (self.radius * s / self.tip_length, self.radius / self.tip_length)
        } else {
            (self.radius, 0.0)
        }
    }

    /// Overlap of one face of a slit with the section, pushed towards its own side `side` (unit, lateral):
    /// ```text
    /// p = rho.side,  q = rho - side p,  w^2 = rc^2 - q^2,  phi = (w^2 - p W)/rc - less
    /// W = w where p >= 0,  w^2/sqrt(w^2 + b^2) where p < 0,  b = R/5
    /// ```
    /// with the lateral vector `rho` from the section's centre: the way out to the face's own side times its cosine w/rc. At
    /// the surface, p = w, the gradient is the normal of the circle. A radial normal everywhere would push both faces to one side.
    /// Beyond the own side W keeps the gradient bounded where the circle ends.
    pub fn slit_face(&self, lever: DVec3, d: DVec3, side: DVec3, less: (f64, f64)) -> Overlap {
        let s = lever.dot(d);
        let (rc, slope) = self.section(s);
        let rho = lever - d * s - self.shift * rc;
        let p = rho.dot(side);
        let q = rho - side * p;
        let square = rc * rc - q.length_squared();
        if square <= 0.0 {
            return Overlap { value: -1.0, gradient: -side };
        }
        let w = square.sqrt();
        // W, and p dW/dw^2; outside of the circle, p > w, the gradient has no meaning but stays finite.
        let (reach, rate) = if p < 0.0 {
            let wide = (square + (SLIT_FADE * self.radius).powi(2)).sqrt();
            (square / wide, p * (1.0 / wide - 0.5 * square / wide.powi(3)))
        } else {
            (w, 0.5 * (p / w).min(1.0))
        };
        let value = (square - p * reach) / rc;
        let lateral = (side * -reach - q * (2.0 * (1.0 - rate))) / rc;
        let along = (2.0 * (1.0 - rate) - value / rc - lateral.dot(self.shift)) * slope - less.1;
        Overlap { value: value - less.0, gradient: lateral + d * along }
    }

    /// Overlap of the tissue around a hollow needle with its outer wall (`inside` false) or of the core with its bore; both
    /// surfaces leave the cutting edge with a rounded flank over the length of the tip.
    pub fn tube_wall(&self, lever: DVec3, d: DVec3, inside: bool, less: (f64, f64)) -> Overlap {
        let Some(bore) = self.bore else { return Overlap { value: -1.0, gradient: -d } };
        let s = lever.dot(d);
        let rho = lever - d * s;
        let r = rho.length();
        let e = if r > 1e-9 { rho / r } else { DVec3::ZERO };
        let end = if inside { bore.radius } else { self.radius };
        let t = (s / self.tip_length).clamp(0.0, 1.0);
        let wall = bore.edge + (end - bore.edge) * t * t * (3.0 - 2.0 * t);
        let slope = (end - bore.edge) * 6.0 * t * (1.0 - t) / self.tip_length;
        let sign = if inside { -1.0 } else { 1.0 };
        Overlap { value: sign * (wall - r) - less.0, gradient: (d * slope - e) * sign - d * less.1 }
    }

    /// Overlap of a point whose material lay `rest_radius` from the line of the tip, with the opened path:
    /// ```text
    /// phi = sqrt(r0^2 + rc^2) - less(s) - r,  r = |x - tip - s d - c(s)|,  c = shift rc(s)
    /// grad phi = m d - e,  m = rc rc'/sqrt(r0^2 + rc^2) - less'(s) + rc' e.shift,  e: radial unit vector
    /// ```
    /// `lever`: from the tip to the point [m]; `d`: unit vector from the tip to the hub; `less`: value [m] and slope of what
    /// is taken off the radius.
    pub fn opened_path(&self, lever: DVec3, d: DVec3, rest_radius: f64, less: (f64, f64)) -> Overlap {
        let s = lever.dot(d);
        let (rc, slope) = self.section(s);
        let radial = lever - d * s - self.shift * rc;
        let r = radial.length();
        let e = if r > 1e-9 { radial / r } else { DVec3::ZERO };
        let open = rest_radius.hypot(rc);
        let m = rc * slope / open - less.1 + slope * e.dot(self.shift);
        Overlap { value: open - less.0 - r, gradient: d * m - e }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needle::BoreShape;

    /// The gradient is the derivative of the value, for cone and bevel, on tip and shaft.
    #[test]
    fn gradients_are_derivatives() {
        let direction = DVec3::new(0.3, -0.2, -0.9).normalize();
        let d = -direction;
        for tip in [TipShape::Cone, TipShape::Bevel { heading: 0.7 }] {
            let needle = NeedleShape { tip, ..NeedleShape::cone("test", 0.8e-3, 2.5e-3) };
            let profile = Profile::new(&needle, direction);
            for i in 0..40 {
                let t = f64::from(i);
                let lever = d * (0.1e-3 + 0.1e-3 * t) + DVec3::new(t.sin(), (1.3 * t).cos(), (2.1 * t).sin()) * 0.6e-3;
                // The overlap at activation fades with s.
                let phi = |x: DVec3| profile.opened_path(x, d, 0.9e-3, (0.1e-3 - 0.02 * x.dot(d), -0.02));
                let h = 1e-9;
                for axis in DVec3::AXES {
                    let rate = (phi(lever + axis * h).value - phi(lever - axis * h).value) / (2.0 * h);
                    let exact = phi(lever).gradient.dot(axis);
                    assert!((rate - exact).abs() < 1e-5, "{tip:?}, point {i}: {rate} against {exact}");
                }
            }
        }
    }

    /// The same for the faces of a slit and both walls of a tube.
    #[test]
    fn gradients_of_separated_faces_are_derivatives() {
        let direction = DVec3::new(0.3, -0.2, -0.9).normalize();
        let (d, side) = (-direction, lateral_axes(direction).0);
        let other = d.cross(side);
        for tip in [TipShape::Cone, TipShape::Bevel { heading: 0.7 }] {
            let bore = BoreShape { radius: 0.6e-3, edge: 0.65e-3, friction: 0.0 };
            let needle = NeedleShape { tip, bore: Some(bore), ..NeedleShape::cone("test", 0.8e-3, 2.5e-3) };
            let profile = Profile::new(&needle, direction);
            let less = |x: DVec3| (0.1e-3 - 0.02 * x.dot(d), -0.02);
            let laws: [&dyn Fn(DVec3) -> Overlap; 3] =
                [&|x| profile.slit_face(x, d, side, less(x)), &|x| profile.tube_wall(x, d, false, less(x)), &|x| {
                    profile.tube_wall(x, d, true, less(x))
                }];
            for (law, phi) in laws.iter().enumerate() {
                let mut seen = 0;
                for i in 0..100 {
                    let t = f64::from(i);
                    let lever =
                        d * (0.25e-3 + 0.04e-3 * t) + side * 0.2e-3 * t.sin() + other * 0.2e-3 * (1.3 * t).cos();
                    // Outside of the section the gradient of a slit has no meaning.
                    if law == 0 && phi(lever).value + less(lever).0 <= 0.0 {
                        continue;
                    }
                    seen += 1;
                    let h = 1e-9;
                    for axis in DVec3::AXES {
                        let rate = (phi(lever + axis * h).value - phi(lever - axis * h).value) / (2.0 * h);
                        let exact = phi(lever).gradient.dot(axis);
                        assert!((rate - exact).abs() < 1e-4, "law {law}, {tip:?}, point {i}: {rate} against {exact}");
                    }
                }
                assert!(seen > 20);
            }
        }
    }

    /// Behind the tip a bevel is the shaft itself, one radius beside the line of its apex.
    #[test]
    fn a_bevel_runs_on_along_its_apex() {
        let needle = NeedleShape { tip: TipShape::Bevel { heading: 0.0 }, ..NeedleShape::cone("test", 1e-3, 3e-3) };
        let profile = Profile::new(&needle, DVec3::NEG_Z);
        let overlap = |x: f64, s: f64| profile.opened_path(DVec3::new(x, 0.0, s), DVec3::Z, 0.0, (0.0, 0.0)).value;
        for s in [0.5e-3, 1.5e-3, 2.9e-3, 5e-3] {
            // Apex side: flush with the line of the tip; other side: the slope of the bevel.
            assert!(overlap(0.0, s).abs() < 1e-15, "{}", overlap(0.0, s));
            let width = 2e-3 * (s / 3e-3).min(1.0);
            assert!(overlap(-width, s).abs() < 1e-15);
            assert!(overlap(-0.5 * width, s) > 0.0 && overlap(1e-5, s) < 0.0);
        }
    }
}
