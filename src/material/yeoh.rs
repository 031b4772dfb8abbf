//! Compressible Yeoh law.
//!
//! ```text
//! W_iso = c10 e + c20 e^2 + c30 e^3,  e = I1bar - 3                   [J/m^3]
//! ```
//! `mu0 = 2 c10`. Source: Yeoh 1993; isochoric split: `src/material/mod.rs`.

use super::invariants::stable_range;
use super::law::{Constant, Constants, Form, Law, Search};
use super::regular::Polynomial;
use super::{InvariantLaw, Isochoric, Slopes, Verdict};

pub const LAW: Law = Law {
    key: "yeoh",
    name: "Yeoh",
    energy: "c10 e + c20 e^2 + c30 e^3",
    source: "Yeoh1993",
    form: Form::Invariants,
    constants: &[
        Constant::stress("c10_kpa", ""),
        Constant::stress("c20_kpa", "").or_zero(),
        Constant::stress("c30_kpa", "").or_zero(),
    ],
    stable: "c10 > 0, none negative; else up to a limit, found from the acoustic tensor",
    way_out: "write c10_kpa > 0; c20_kpa and c30_kpa >= 0 are stable everywhere, negative ones need allow_limited = true",
    build: |c| Isochoric::Yeoh(Yeoh { c10: c[0], c20: c[1], c30: c[2] }),
    example: [2500.0, 900.0, 300.0, 0.0],
    search: Search::Linear,
    colour: [0, 158, 115],
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Yeoh {
    /// c10, c20, c30 [Pa].
    pub c10: f64,
    pub c20: f64,
    pub c30: f64,
}

impl Yeoh {
    pub fn values(&self) -> Constants {
        [self.c10, self.c20, self.c30, 0.0]
    }

    pub fn shear_modulus(&self) -> f64 {
        2.0 * self.c10
    }

    /// Stable for every deformation where no constant is negative (W convex and growing in I1bar: polyconvex), else
    /// as far as the acoustic tensor of isochoric states stays positive.
    pub fn verdict(&self) -> Verdict {
        let all = [self.c10, self.c20, self.c30];
        if !(self.c10 > 0.0 && all.iter().all(|c| c.is_finite())) {
            Verdict::Unstable
        } else if all.iter().all(|c| *c >= 0.0) {
            Verdict::Stable
        } else {
            stable_range(&|e| self.slopes(e))
        }
    }
}

impl InvariantLaw for Yeoh {
    fn polynomial(&self) -> Option<Polynomial> {
        Some(Polynomial { c1: self.c10, c2: self.c20, c3: self.c30, c01: 0.0 })
    }

    fn energy(&self, e: f64, _i2: f64) -> f64 {
        e * (self.c10 + e * (self.c20 + e * self.c30))
    }

    fn slopes(&self, e: f64) -> Slopes {
        Slopes {
            w1: self.c10 + e * (2.0 * self.c20 + 3.0 * e * self.c30),
            w2: 0.0,
            w11: 2.0 * self.c20 + 6.0 * e * self.c30,
        }
    }
}
