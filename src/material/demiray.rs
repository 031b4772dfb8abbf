//! Compressible Demiray law: exponential in I1bar, the J-shaped curve of soft tissue.
//!
//! ```text
//! W_iso = mu/(2 b) (exp(b e) - 1),  e = I1bar - 3                     [J/m^3]
//! ```
//! Beyond `b e = 10` the exponential continues as its second-order Taylor polynomial, so that energy and stress stay
//! finite for every F; at b = 7 that is a uniaxial stretch of 1.8, where the stress is 2e4 times the initial one.
//! `mu0 = mu`. Source: Demiray 1972; isochoric split: `src/material/mod.rs`; continuation: this project.

use super::law::{Constant, Constants, Form, Law, Search};
use super::regular::Exponential;
use super::{InvariantLaw, Isochoric, Slopes, Verdict};

pub const LAW: Law = Law {
    key: "demiray",
    name: "Demiray",
    energy: "mu/(2 b) (exp(b e) - 1)",
    source: "Demiray1972",
    form: Form::Invariants,
    constants: &[Constant::stress("mu_kpa", "shear modulus at rest"), Constant::number("b", "exponent", 100.0)],
    stable: "mu > 0, b > 0",
    way_out: "write mu_kpa > 0 and b > 0",
    build: |c| Isochoric::Demiray(Demiray { mu: c[0], b: c[1] }),
    example: [4000.0, 1.9, 0.0, 0.0],
    search: Search::Exponent { starts: &[-1.0, 0.1, 1.0, 5.0, 20.0, 80.0], edges: &[LEAST_FITTED_B] },
    colour: [0, 114, 178],
};

/// Smallest exponent b of a stable fit: below it the law is neo-Hookean to 1e-3 at stretches that samples reach.
const LEAST_FITTED_B: f64 = 1e-3;

/// Exponent at which exponential laws continue as polynomials.
pub const LARGEST_EXPONENT: f64 = super::regular::LARGEST_EXPONENT;

/// `exp(x) - 1` with its first and second derivative; second-order Taylor polynomial beyond `LARGEST_EXPONENT`.
pub fn capped_exponential(x: f64) -> (f64, f64, f64) {
    if x <= LARGEST_EXPONENT {
        let e = x.exp();
        (x.exp_m1(), e, e)
    } else {
        let (e, d) = (LARGEST_EXPONENT.exp(), x - LARGEST_EXPONENT);
        (e * (1.0 + d * (1.0 + 0.5 * d)) - 1.0, e * (1.0 + d), e)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demiray {
    /// Shear modulus at rest mu [Pa].
    pub mu: f64,
    /// Exponent b (dimensionless).
    pub b: f64,
}

impl Demiray {
    pub fn values(&self) -> Constants {
        [self.mu, self.b, 0.0, 0.0]
    }

    pub fn shear_modulus(&self) -> f64 {
        self.mu
    }

    /// W is convex and growing in I1bar for mu > 0, b > 0, hence polyconvex.
    pub fn verdict(&self) -> Verdict {
        if self.mu > 0.0 && self.b > 0.0 && self.mu.is_finite() && self.b.is_finite() {
            Verdict::Stable
        } else {
            Verdict::Unstable
        }
    }
}

impl InvariantLaw for Demiray {
    fn energy(&self, e: f64, _i2: f64) -> f64 {
        0.5 * self.mu / self.b * capped_exponential(self.b * e).0
    }

    fn slopes(&self, e: f64) -> Slopes {
        let (_, first, second) = capped_exponential(self.b * e);
        Slopes { w1: 0.5 * self.mu * first, w2: 0.0, w11: 0.5 * self.mu * self.b * second }
    }

    fn exponential(&self) -> Option<Exponential<f64>> {
        Some(Exponential { mu: self.mu, b: self.b })
    }

    fn is_capped(&self, e: impl FnOnce() -> f64) -> bool {
        self.b * e() > LARGEST_EXPONENT
    }
}
