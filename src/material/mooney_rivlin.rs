//! Compressible Mooney-Rivlin with an inversion-safe continuation.
//!
//! ```text
//! W  = c10 (a(J) I1 - 3) + c01 (b(J) I2 - 3) + kappa/2 (J - 1)^2      [J/m^3]
//! P  = 2 c10 a F + 2 c01 b (I1 F - F C) + (c10 a' I1 + c01 b' I2 + kappa (J - 1)) cof F
//! ```
//! `a = J^(-2/3)`, `b = J^(-4/3)` for J >= J_c = 0.3; below J_c their second-order Taylor polynomials at J_c, so that
//! W is twice differentiable and finite for every F, inverted ones included. `I1`, `I2`: invariants of C = F^T F;
//! `cof F = J F^-T` is formed without division. `mu0 = 2 (c10 + c01)`, `kappa = 2/D`.
//! Source: Rivlin 1948; split and penalty as in [Lv2022] Eq. 1 with N = 1; continuation: this project.

use glam::{DMat3, DVec3};

/// J below which the isochoric factors continue as polynomials.
pub const J_CONTINUATION: f64 = 0.3;

/// Constants of the law, SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MooneyRivlin {
    /// c10 [Pa].
    pub c10: f64,
    /// c01 [Pa].
    pub c01: f64,
    /// Bulk modulus kappa = 2/D [Pa].
    pub bulk_modulus: f64,
}

/// What the constants mean for stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Elliptic for every deformation: c10 >= 0, c01 >= 0, sum > 0.
    Stable,
    /// One constant is negative, the sum positive: elliptic while every principal stretch of an isochoric
    /// deformation stays below (c01 < 0) or above (c10 < 0) the limit.
    StableBelow(f64),
    StableAbove(f64),
    /// Ground-state shear modulus <= 0, or bulk modulus <= 0: unstable at rest.
    Unstable,
}

/// `J^p` above `J_CONTINUATION`, its second-order Taylor polynomial below: value, first derivative.
fn isochoric_factor(j: f64, p: f64) -> (f64, f64) {
    if j >= J_CONTINUATION {
        let value = j.powf(p);
        (value, p * value / j)
    } else {
        let jc = J_CONTINUATION;
        let f0 = jc.powf(p);
        let f1 = p * f0 / jc;
        let f2 = (p - 1.0) * f1 / jc;
        let d = j - jc;
        (f0 + d * (f1 + 0.5 * d * f2), f1 + d * f2)
    }
}

/// `J - 1` from the displacement gradient H without cancellation: tr H + (tr^2 H - tr H^2)/2 + det H.
pub fn jacobian_minus_one(h: DMat3) -> f64 {
    let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
    let hh = h * h;
    let trace_hh = hh.x_axis.x + hh.y_axis.y + hh.z_axis.z;
    trace + 0.5 * (trace * trace - trace_hh) + h.determinant()
}

/// cof F = J F^-T, by cross products of the columns.
pub fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

impl MooneyRivlin {
    /// Constants from ground-state moduli: `share` of the shear modulus goes to c10, the rest to c01.
    ///
    /// `shear_modulus` mu0 [Pa], `bulk_modulus` [Pa], `share` 0..1.
    pub fn from_moduli(shear_modulus: f64, bulk_modulus: f64, share: f64) -> Self {
        MooneyRivlin { c10: 0.5 * shear_modulus * share, c01: 0.5 * shear_modulus * (1.0 - share), bulk_modulus }
    }

    /// Ground-state shear modulus mu0 = 2 (c10 + c01) [Pa].
    pub fn shear_modulus(&self) -> f64 {
        2.0 * (self.c10 + self.c01)
    }

    /// Young's modulus at rest [Pa].
    pub fn youngs_modulus(&self) -> f64 {
        let (k, mu) = (self.bulk_modulus, self.shear_modulus());
        9.0 * k * mu / (3.0 * k + mu)
    }

    /// Poisson's ratio at rest.
    pub fn poisson_ratio(&self) -> f64 {
        let (k, mu) = (self.bulk_modulus, self.shear_modulus());
        (3.0 * k - 2.0 * mu) / (2.0 * (3.0 * k + mu))
    }

    /// P-wave modulus K + 4/3 mu [Pa].
    pub fn p_wave_modulus(&self) -> f64 {
        self.bulk_modulus + 4.0 / 3.0 * self.shear_modulus()
    }

    /// Stability of the constants over all deformations (physics of the acoustic tensor of an isochoric state:
    /// rho v^2 = 2 l_i^2 (c10 + c01 l_k^2)).
    pub fn verdict(&self) -> Verdict {
        let finite = self.c10.is_finite() && self.c01.is_finite() && self.bulk_modulus.is_finite();
        if !finite || self.c10 + self.c01 <= 0.0 || self.bulk_modulus <= 0.0 {
            Verdict::Unstable
        } else if self.c01 < 0.0 {
            Verdict::StableBelow((self.c10 / -self.c01).sqrt())
        } else if self.c10 < 0.0 {
            Verdict::StableAbove((-self.c10 / self.c01).sqrt())
        } else {
            Verdict::Stable
        }
    }

    /// Energy density W [J/m^3] for the displacement gradient H = F - I.
    pub fn energy_density(&self, h: DMat3) -> f64 {
        let f = DMat3::IDENTITY + h;
        let dj = jacobian_minus_one(h);
        let j = 1.0 + dj;
        let (a, _) = isochoric_factor(j, -2.0 / 3.0);
        let (b, _) = isochoric_factor(j, -4.0 / 3.0);
        let (i1, i2) = invariants(f);
        self.c10 * (a * i1 - 3.0) + self.c01 * (b * i2 - 3.0) + 0.5 * self.bulk_modulus * dj * dj
    }

    /// First Piola-Kirchhoff stress P [Pa] for the displacement gradient H = F - I.
    pub fn first_piola_kirchhoff(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        let dj = jacobian_minus_one(h);
        let j = 1.0 + dj;
        let (a, da) = isochoric_factor(j, -2.0 / 3.0);
        let (b, db) = isochoric_factor(j, -4.0 / 3.0);
        let (i1, i2) = invariants(f);
        let volumetric = self.c10 * da * i1 + self.c01 * db * i2 + self.bulk_modulus * dj;
        let c = f.transpose() * f;
        f * (2.0 * self.c10 * a) + (f * i1 - f * c) * (2.0 * self.c01 * b) + cofactor(f) * volumetric
    }

    /// Cauchy stress sigma = P F^T / J [Pa]; meaningful for J > 0 only.
    pub fn cauchy(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        self.first_piola_kirchhoff(h) * f.transpose() * (1.0 / f.determinant())
    }
}

/// First and second invariant of C = F^T F; `I2 = |cof F|^2`.
fn invariants(f: DMat3) -> (f64, f64) {
    let square = |m: DMat3| m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared();
    (square(f), square(cofactor(f)))
}

/// Von Mises equivalent of a symmetric stress [Pa].
pub fn von_mises(sigma: DMat3) -> f64 {
    let d = DVec3::new(sigma.x_axis.x, sigma.y_axis.y, sigma.z_axis.z);
    let shear = sigma.x_axis.y.powi(2) + sigma.y_axis.z.powi(2) + sigma.z_axis.x.powi(2);
    (0.5 * ((d.x - d.y).powi(2) + (d.y - d.z).powi(2) + (d.z - d.x).powi(2)) + 3.0 * shear).sqrt()
}
