//! Compressible one-term Ogden law.
//!
//! ```text
//! W_iso = 2 mu/alpha^2 (a(J) sum_i phi(c_i) - 3)                      [J/m^3]
//! P_iso = 2 mu/alpha^2 (2 a F sum_i phi'(c_i) N_i (x) N_i + a' sum_i phi(c_i) cof F)
//! ```
//! `c_i`, `N_i`: eigenvalues and eigenvectors of C; `a = J^(-alpha/3)`, `phi(c) = c^(alpha/2)`, so that `a phi` is the
//! isochoric stretch to the power alpha. Below `c = 0.01` (a stretch of 0.1) phi continues as its second-order Taylor
//! polynomial and a as in `kinematics`: finite for every F. `mu0 = mu`.
//! Source: Ogden 1972 in the normalisation of Abaqus; continuation: this project.

use glam::DMat3;

use super::Verdict;
use super::kinematics::{cofactor, isochoric_factor, isochoric_factor_curvature, jacobian_minus_one, symmetric_eigen};

/// Eigenvalue of C below which phi continues as a polynomial.
pub const SMALLEST_EIGENVALUE: f64 = 0.01;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ogden {
    /// Shear modulus at rest mu [Pa].
    pub mu: f64,
    /// Exponent alpha (dimensionless, not zero).
    pub alpha: f64,
}

impl Ogden {
    pub fn shear_modulus(&self) -> f64 {
        self.mu
    }

    /// phi, its first and its second derivative.
    fn phi(&self, c: f64) -> (f64, f64, f64) {
        let p = 0.5 * self.alpha;
        let c0 = SMALLEST_EIGENVALUE;
        if c >= c0 {
            let value = c.powf(p);
            (value, p * value / c, p * (p - 1.0) * value / (c * c))
        } else {
            let f0 = c0.powf(p);
            let f1 = p * f0 / c0;
            let f2 = (p - 1.0) * f1 / c0;
            let d = c - c0;
            (f0 + d * (f1 + 0.5 * d * f2), f1 + d * f2, f2)
        }
    }

    /// W_iso for H = F - I [J/m^3].
    pub fn energy(&self, h: DMat3) -> f64 {
        let f = DMat3::IDENTITY + h;
        let (c, _) = symmetric_eigen(f.transpose() * f);
        let (a, _) = isochoric_factor(1.0 + jacobian_minus_one(h), -self.alpha / 3.0);
        let sum: f64 = c.iter().map(|c| self.phi(*c).0).sum();
        2.0 * self.mu / self.alpha.powi(2) * (a * sum - 3.0)
    }

    /// P_iso for H = F - I [Pa].
    pub fn isochoric_stress(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        let (c, n) = symmetric_eigen(f.transpose() * f);
        let (a, da) = isochoric_factor(1.0 + jacobian_minus_one(h), -self.alpha / 3.0);
        let phi = c.map(|c| self.phi(c));
        let slope = n * DMat3::from_diagonal(glam::DVec3::new(phi[0].1, phi[1].1, phi[2].1)) * n.transpose();
        let sum: f64 = phi.iter().map(|p| p.0).sum();
        (f * slope * (2.0 * a) + cofactor(f) * (da * sum)) * (2.0 * self.mu / self.alpha.powi(2))
    }

    /// Bound of the isochoric tangent modulus [Pa]: the largest second derivative of W_iso by one principal stretch,
    /// ```text
    /// 2 mu/alpha^2 (a (2 phi'_i + 4 c_i phi''_i) + 4 a' J phi'_i + a'' c_j c_k sum phi)
    /// ```
    /// A scan over rank-one directions finds no stiffer one while J stays near 1. At rest it is 4/3 mu0.
    pub fn tangent_bound(&self, h: DMat3) -> f64 {
        let f = DMat3::IDENTITY + h;
        let (c, _) = symmetric_eigen(f.transpose() * f);
        let j = 1.0 + jacobian_minus_one(h);
        let (a, da) = isochoric_factor(j, -self.alpha / 3.0);
        let dda = isochoric_factor_curvature(j, -self.alpha / 3.0);
        let phi = c.map(|c| self.phi(c));
        let sum: f64 = phi.iter().map(|p| p.0).sum();
        let along = |i: usize| {
            let (_, first, second) = phi[i];
            let others = c[(i + 1) % 3] * c[(i + 2) % 3];
            a * (2.0 * first + 4.0 * c[i] * second) + 4.0 * da * j * first + dda * others * sum
        };
        let largest = along(0).max(along(1)).max(along(2)).max(0.0);
        2.0 * self.mu / self.alpha.powi(2) * largest
    }

    /// Elliptic for every deformation where mu > 0 and |alpha| >= 1; else while
    /// ```text
    /// tanh(|alpha| s/2) tanh(s/2) < |alpha|,   s = ln(l_max / l_min)
    /// ```
    /// That is `beta > -sqrt(alpha gamma)` for incompressible plane motions (Dowaikh and Ogden 1990), written out for
    /// this law by this project. For one largest stretch l, s is largest in equibiaxial tension: s = 3 ln l.
    pub fn verdict(&self) -> Verdict {
        if !(self.mu > 0.0 && self.mu.is_finite() && self.alpha.is_finite() && self.alpha != 0.0) {
            return Verdict::Unstable;
        }
        let size = self.alpha.abs();
        if size >= 1.0 {
            return Verdict::Stable;
        }
        // The left side grows from 0 to 1 with s: bisection. s = 100 lies beyond the limit of every |alpha| < 1.
        let (mut low, mut high) = (0.0, 100.0);
        for _ in 0..80 {
            let s: f64 = 0.5 * (low + high);
            if (0.5 * size * s).tanh() * (0.5 * s).tanh() < size {
                low = s;
            } else {
                high = s;
            }
        }
        Verdict::StableBelow((low / 3.0).exp())
    }
}
