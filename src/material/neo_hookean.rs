//! Compressible neo-Hookean law.
//!
//! ```text
//! W_iso = c10 (I1bar - 3)                                             [J/m^3]
//! ```
//! `mu0 = 2 c10`. Elliptic for every deformation where c10 > 0. Source: Rivlin 1948; isochoric split: `src/material/mod.rs`.

use super::law::{Constant, Constants, Form, Law, Search};
use super::regular::Polynomial;
use super::{InvariantLaw, Isochoric, Slopes, Verdict};

pub const LAW: Law = Law {
    key: "neo_hookean",
    name: "neo-Hookean",
    energy: "c10 e",
    source: "Rivlin1948",
    form: Form::Invariants,
    constants: &[Constant::stress("c10_kpa", "")],
    stable: "c10 > 0",
    way_out: "write c10_kpa > 0",
    build: |c| Isochoric::NeoHookean(NeoHookean { c10: c[0] }),
    example: [3300.0, 0.0, 0.0, 0.0],
    search: Search::Linear,
    colour: [86, 180, 233],
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeoHookean {
    /// c10 [Pa].
    pub c10: f64,
}

impl NeoHookean {
    pub fn values(&self) -> Constants {
        [self.c10, 0.0, 0.0, 0.0]
    }

    pub fn shear_modulus(&self) -> f64 {
        2.0 * self.c10
    }

    pub fn verdict(&self) -> Verdict {
        if self.c10 > 0.0 && self.c10.is_finite() { Verdict::Stable } else { Verdict::Unstable }
    }
}

impl InvariantLaw for NeoHookean {
    fn polynomial(&self) -> Option<Polynomial> {
        Some(Polynomial { c1: self.c10, ..Polynomial::default() })
    }

    fn energy(&self, i1: f64, _i2: f64) -> f64 {
        self.c10 * i1
    }

    fn slopes(&self, _i1: f64) -> Slopes {
        Slopes { w1: self.c10, ..Slopes::default() }
    }
}
