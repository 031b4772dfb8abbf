//! Compressible neo-Hookean law.
//!
//! ```text
//! W_iso = c10 (I1bar - 3)                                             [J/m^3]
//! ```
//! `mu0 = 2 c10`. Elliptic for every deformation where c10 > 0. Source: Rivlin 1948; isochoric split: `src/material/mod.rs`.

use super::{Slopes, Verdict};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeoHookean {
    /// c10 [Pa].
    pub c10: f64,
}

impl NeoHookean {
    pub fn shear_modulus(&self) -> f64 {
        2.0 * self.c10
    }

    pub fn energy(&self, i1: f64) -> f64 {
        self.c10 * i1
    }

    pub fn slopes(&self) -> Slopes {
        Slopes { w1: self.c10, ..Slopes::default() }
    }

    pub fn verdict(&self) -> Verdict {
        if self.c10 > 0.0 && self.c10.is_finite() { Verdict::Stable } else { Verdict::Unstable }
    }
}
