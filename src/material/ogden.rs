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

use super::kinematics::{cofactor, isochoric_factor, jacobian_minus_one, symmetric_eigen};
use super::{LARGEST_STRETCH, Verdict};

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

    /// phi and its derivative.
    fn phi(&self, c: f64) -> (f64, f64) {
        let p = 0.5 * self.alpha;
        let c0 = SMALLEST_EIGENVALUE;
        if c >= c0 {
            let value = c.powf(p);
            (value, p * value / c)
        } else {
            let f0 = c0.powf(p);
            let f1 = p * f0 / c0;
            let f2 = (p - 1.0) * f1 / c0;
            let d = c - c0;
            (f0 + d * (f1 + 0.5 * d * f2), f1 + d * f2)
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

    /// Bound of the isochoric tangent modulus [Pa]: second derivatives by the stretches and by J.
    pub fn tangent_bound(&self, h: DMat3) -> f64 {
        let f = DMat3::IDENTITY + h;
        let (c, _) = symmetric_eigen(f.transpose() * f);
        let (a, _) = isochoric_factor((1.0 + jacobian_minus_one(h)).max(0.3), -self.alpha / 3.0);
        let size = self.alpha.abs();
        let factor = (2.0 * (size + 1.0) / size).max(1.0);
        let mut mean: f64 = 0.0;
        let mut steepest: f64 = 1.0;
        for c in c {
            let phi = c.max(SMALLEST_EIGENVALUE).powf(0.5 * self.alpha);
            mean += a * phi / 3.0;
            steepest = steepest.max(a * phi / c.max(SMALLEST_EIGENVALUE));
        }
        4.0 / 3.0 * self.mu * (factor * 0.5 * size.max(1.0)).max(1.0) * steepest.max(mean)
    }

    /// Nominal stress over 2 mu/alpha of an incompressible sample: uniaxial and equibiaxial.
    fn reduced_stresses(&self, l: f64) -> [f64; 2] {
        let a = self.alpha;
        [l.powf(a - 1.0) - l.powf(-0.5 * a - 1.0), l.powf(a - 1.0) - l.powf(-2.0 * a - 1.0)].map(|p| p * a.signum())
    }

    /// Polyconvex for mu > 0 and |alpha| >= 1; else as far as the nominal stress grows with the stretch.
    pub fn verdict(&self) -> Verdict {
        if !(self.mu > 0.0 && self.mu.is_finite() && self.alpha.is_finite() && self.alpha != 0.0) {
            return Verdict::Unstable;
        }
        if self.alpha.abs() >= 1.0 {
            return Verdict::Stable;
        }
        const STEP: f64 = 1e-3;
        let grows = |l: f64| {
            let (below, above) = (self.reduced_stresses(l - STEP), self.reduced_stresses(l + STEP));
            above.iter().zip(below).all(|(a, b)| *a > b)
        };
        let limit = (1..).map(|i| 1.0 + f64::from(i) * STEP).take_while(|l| *l < LARGEST_STRETCH).find(|l| !grows(*l));
        limit.map_or(Verdict::Stable, Verdict::StableBelow)
    }
}
