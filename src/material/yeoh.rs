//! Compressible Yeoh law.
//!
//! ```text
//! W_iso = c10 e + c20 e^2 + c30 e^3,  e = I1bar - 3                   [J/m^3]
//! ```
//! `mu0 = 2 c10`. Source: Yeoh 1993; isochoric split: `src/material/mod.rs`.

use super::{Slopes, Verdict, stable_range};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Yeoh {
    /// c10, c20, c30 [Pa].
    pub c10: f64,
    pub c20: f64,
    pub c30: f64,
}

impl Yeoh {
    pub fn shear_modulus(&self) -> f64 {
        2.0 * self.c10
    }

    pub fn energy(&self, e: f64) -> f64 {
        e * (self.c10 + e * (self.c20 + e * self.c30))
    }

    pub fn slopes(&self, e: f64) -> Slopes {
        Slopes {
            w1: self.c10 + e * (2.0 * self.c20 + 3.0 * e * self.c30),
            w2: 0.0,
            w11: 2.0 * self.c20 + 6.0 * e * self.c30,
        }
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
