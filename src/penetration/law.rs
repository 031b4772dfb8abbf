//! Isotropic incompressible laws in plane strain, as functions of the one invariant that is left there.
//!
//! With `l` the larger stretch in the plane, `I = l^2 + l^-2 + 1` is the first and the second invariant, so every law is
//! `w(I)`, `I >= 3`, and the shear modulus at rest is `mu = 2 w'(3)`. The elastic laws of the program are such laws here as they
//! are elsewhere: energy and slopes are theirs, with the continuation of exponentials beyond their range. Fibres and flow are
//! not in it.

use crate::material::{InvariantLaw, Isochoric};

/// Strain energy density and its first two derivatives by `I` [all Pa, or in units of mu].
#[derive(Clone, Copy, Debug)]
pub struct EnergyJet {
    /// Strain energy per unit rest volume, zero at `I = 3`.
    pub w: f64,
    /// dw/dI
    pub dw: f64,
    /// d2w/dI2
    pub d2w: f64,
}

/// An isotropic incompressible law in plane strain. Any closure `Fn(f64) -> EnergyJet` is one.
pub trait PlaneStrainLaw {
    /// Energy and derivatives at `i1 >= 3`. A law with a limiting stretch returns numbers that are not finite beyond it.
    fn jet(&self, i1: f64) -> EnergyJet;

    /// Shear modulus at rest, `2 w'(3)`.
    fn shear_modulus(&self) -> f64 {
        2.0 * self.jet(3.0).dw
    }
}

impl<F: Fn(f64) -> EnergyJet> PlaneStrainLaw for F {
    fn jet(&self, i1: f64) -> EnergyJet {
        self(i1)
    }
}

impl PlaneStrainLaw for Isochoric {
    fn jet(&self, i1: f64) -> EnergyJet {
        match self {
            Isochoric::NeoHookean(law) => of_invariants(law, i1),
            Isochoric::MooneyRivlin(law) => of_invariants(law, i1),
            Isochoric::Yeoh(law) => of_invariants(law, i1),
            Isochoric::Demiray(law) => of_invariants(law, i1),
            Isochoric::Ogden(law) => ogden(law.mu, law.alpha, i1),
        }
    }
}

/// A law of `I1` and, linear in it, of `I2`, which are one here.
fn of_invariants(law: &impl InvariantLaw, i1: f64) -> EnergyJet {
    let slopes = law.slopes(i1 - 3.0);
    EnergyJet { w: law.energy(i1 - 3.0, i1 - 3.0), dw: slopes.w1 + slopes.w2, d2w: slopes.w11 }
}

/// Ogden's law with one term, `w = 2 mu/alpha^2 (l^alpha + l^-alpha - 2)`; the third stretch is one.
fn ogden(mu: f64, alpha: f64, i1: f64) -> EnergyJet {
    // I - 3 = 4 sinh^2 t with t = ln l.
    let t = (0.5 * (i1 - 3.0).max(0.0).sqrt()).asinh();
    let (sh2, ch2) = ((2.0 * t).sinh(), (2.0 * t).cosh());
    let al = alpha.abs();
    let half = (0.5 * al * t).sinh();
    let w = 8.0 * mu / (al * al) * half * half;
    if t * al.max(2.0) < 0.05 {
        // sinh(al t)/sinh(2 t) by series: both derivatives are 0/0 at rest.
        let c1 = (al * al - 4.0) / 6.0;
        let c2 = al.powi(4) / 120.0 - al * al / 9.0 + 14.0 / 45.0;
        let t2 = t * t;
        let two_t_over_sh2 = 1.0 - 2.0 * t2 / 3.0 + 14.0 * t2 * t2 / 45.0;
        return EnergyJet {
            w,
            dw: 0.5 * mu * (1.0 + c1 * t2 + c2 * t2 * t2),
            d2w: mu / 8.0 * (c1 + 2.0 * c2 * t2) * two_t_over_sh2,
        };
    }
    let (sh, ch) = ((al * t).sinh(), (al * t).cosh());
    EnergyJet { w, dw: mu / al * sh / sh2, d2w: mu / al * (al * ch * sh2 - 2.0 * sh * ch2) / (4.0 * sh2.powi(3)) }
}
