//! A tip on a surface that it has not entered: how deep it is, and how much of that depth coarse cells do not resolve.
//!
//! ```text
//! F = c(alpha) 2/pi E/(1 - nu^2) d^2 tan(alpha)                                            [N]
//! ```
//! is Sneddon's answer [Sneddon1965] for a frictionless cone of the half angle alpha, with a factor c for large strain: the depth d over the
//! force has no length of its own, so F stays a square of d, and c is one number per angle. c and the sinking of a disc under an even load
//! ([Love1939] at small strain) were computed once with the axisymmetric solution of `indentation`, for neo-Hooke.
//!
//! What is not known: with friction the skin around the tip cannot slide, and c is larger (1.16 instead of 0.95 at 18 degrees: a tenth less
//! depth). Where the tissue reaches the shoulder of the cone (d = 3.9 R at 18 degrees) it slides over it if nothing holds it, and the force
//! grows more slowly; the square is kept there, which lies between both. A blunt tip (45 degrees) then would sink less than the disc from
//! F = 28 mu R^2 on: it is taken to go with the disc. A layer thinner than the dimple is not seen as one.

use std::f64::consts::PI;

use crate::material::ElasticLaw;
use crate::needle::NeedleShape;
use crate::needle::tip_contact::DISC;

/// Half angles of cones in degrees, ascending, and c for each: neo-Hooke, K = 18 mu, no friction.
const CONES: [(f64, f64); 8] = [
    (10.0, 1.21),
    (14.0, 1.013),
    (18.0, 0.946),
    (22.5, 0.929),
    (30.0, 0.933),
    (45.0, 0.959),
    (80.0, 0.986),
    (90.0, 1.0),
];

/// c of a cone of the half angle `alpha` [rad].
fn large_strain(alpha: f64) -> f64 {
    let degrees = alpha.to_degrees().clamp(CONES[0].0, 90.0);
    let above = CONES.iter().position(|c| c.0 >= degrees).unwrap_or(CONES.len() - 1).max(1);
    let ((from, low), (to, high)) = (CONES[above - 1], CONES[above]);
    low + (high - low) * (degrees - from) / (to - from)
}

/// Mean sinking of a disc under the even load F, over `F/(mu r)` with its radius r, in rows of even `sqrt(F/mu)/r`; neo-Hooke, K = 18 mu.
const DISC_COMPLIANCES: [f64; 21] = [
    0.1425, 0.1421, 0.1424, 0.1426, 0.1428, 0.1431, 0.1435, 0.1441, 0.1448, 0.1457, 0.1469, 0.1483, 0.1502, 0.1525,
    0.1557, 0.1606, 0.1693, 0.181, 0.1908, 0.1989, 0.2054,
];
/// Distance of the rows.
const DISC_STEP: f64 = 0.125;
/// `E/(1 - nu^2)` over mu of that tissue.
const DISC_MODULUS: f64 = 4.0 * 55.0 / 58.0;

/// A half space under a cone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Shear modulus and bulk modulus at rest [Pa].
    pub shear_modulus: f64,
    /// See `shear_modulus`.
    pub bulk_modulus: f64,
    /// Radius of the shaft [m].
    pub radius: f64,
    /// Half angle of the cone [rad].
    pub half_angle: f64,
}

impl Surface {
    /// The surface of a tissue under a cone.
    pub fn new(law: &ElasticLaw, needle: &NeedleShape) -> Self {
        Surface {
            shear_modulus: law.shear_modulus(),
            bulk_modulus: law.bulk_modulus,
            radius: needle.radius,
            half_angle: (needle.radius / needle.tip_length).atan(),
        }
    }

    /// `E/(1 - nu^2)` [Pa].
    fn plane_modulus(&self) -> f64 {
        let (k, g) = (self.bulk_modulus, self.shear_modulus);
        4.0 * g * (3.0 * k + g) / (3.0 * k + 4.0 * g)
    }

    /// Largest force of the table [N].
    pub fn most_force(&self) -> f64 {
        40.0 * self.shear_modulus * self.radius * self.radius
    }

    /// Depth of the tip below the surface at rest under the force `force` [N], in m.
    pub fn depth(&self, force: f64) -> f64 {
        (0.5 * PI * force / (large_strain(self.half_angle) * self.plane_modulus() * self.half_angle.tan())).sqrt()
    }

    /// Mean sinking of the disc of rest radius [`DISC`] R under an even load [N], in m.
    pub fn disc_depth(&self, force: f64) -> f64 {
        let radius = DISC * self.radius;
        let relative = force / (self.plane_modulus() / DISC_MODULUS) / (radius * radius);
        let at = relative.sqrt() / DISC_STEP;
        let row = (at as usize).min(DISC_COMPLIANCES.len() - 2);
        let part = (at - row as f64).min(1.0);
        radius * relative * (DISC_COMPLIANCES[row] * (1.0 - part) + DISC_COMPLIANCES[row + 1] * part)
    }

    /// What of the depth cells do not resolve [m].
    pub fn unresolved(&self, force: f64) -> f64 {
        self.depth(force) - self.disc_depth(force)
    }
}
