//! Compressible Mooney-Rivlin law.
//!
//! ```text
//! W_iso = c10 (I1bar - 3) + c01 (I2bar - 3)                           [J/m^3]
//! ```
//! `mu0 = 2 (c10 + c01)`. Source: Rivlin 1948; [Lv2022] Eq. 1 with N = 1; isochoric split: `src/material/mod.rs`.

use super::law::{Constant, Constants, Form, Law, Search};
use super::regular::Polynomial;
use super::{InvariantLaw, Isochoric, Slopes, Verdict};

pub const LAW: Law = Law {
    key: "mooney_rivlin",
    name: "Mooney-Rivlin",
    energy: "c10 e + c01 (I2bar - 3)",
    source: "Rivlin1948",
    form: Form::Invariants,
    constants: &[Constant::stress("c10_kpa", ""), Constant::stress("c01_kpa", "")],
    stable: "neither negative, c10 + c01 > 0; with one negative: up to a stretch limit",
    way_out: "write c10_kpa and c01_kpa that are >= 0 with a sum > 0",
    build: |c| Isochoric::MooneyRivlin(MooneyRivlin { c10: c[0], c01: c[1] }),
    example: [2300.0, 1000.0, 0.0, 0.0],
    search: Search::Linear,
    colour: [213, 94, 0],
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MooneyRivlin {
    /// c10 [Pa].
    pub c10: f64,
    /// c01 [Pa].
    pub c01: f64,
}

impl MooneyRivlin {
    pub fn values(&self) -> Constants {
        [self.c10, self.c01, 0.0, 0.0]
    }

    pub fn shear_modulus(&self) -> f64 {
        2.0 * (self.c10 + self.c01)
    }

    /// Waves in an isochoric state obey rho v^2 = 2 l_i^2 (c10 + c01 l_k^2).
    pub fn verdict(&self) -> Verdict {
        // `!(x > 0)` refuses what is not a number, too.
        if !(self.c10 + self.c01 > 0.0 && self.c10.is_finite() && self.c01.is_finite()) {
            Verdict::Unstable
        } else if self.c01 < 0.0 {
            Verdict::StableBelow((self.c10 / -self.c01).sqrt())
        } else if self.c10 < 0.0 {
            Verdict::StableAbove((-self.c10 / self.c01).sqrt())
        } else {
            Verdict::Stable
        }
    }
}

impl InvariantLaw for MooneyRivlin {
    fn polynomial(&self) -> Option<Polynomial> {
        Some(Polynomial { c1: self.c10, c01: self.c01, ..Polynomial::default() })
    }

    fn energy(&self, i1: f64, i2: f64) -> f64 {
        self.c10 * i1 + self.c01 * i2
    }

    fn slopes(&self, _i1: f64) -> Slopes {
        Slopes { w1: self.c10, w2: self.c01, ..Slopes::default() }
    }

    fn measures(&self) -> [bool; 2] {
        [self.c10 != 0.0, self.c01 != 0.0]
    }
}
