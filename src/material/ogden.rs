//! Compressible one-term Ogden law.
//!
//! ```text
//! W_iso = 2 mu/alpha^2 (M - 3)                                        [J/m^3]
//! M = J^(-alpha/3) S,     S = sum_i phi(c_i),      phi(x) = x^(alpha/2)         alpha > 0
//! M = J^(-2|alpha|/3) S,  S = sum_i phi(c_j c_k),  phi(x) = x^(|alpha|/2)       alpha < 0
//! P_iso = 2 mu/alpha^2 (2 dM/dS F sum_i dS/dc_i N_i (x) N_i + dM/dJ cof F)
//! ```
//! `c_i`, `N_i`: eigenvalues and eigenvectors of C. M is the sum of the isochoric stretches to the power alpha. Both lines are
//! one function, since `c_i = J^2/(c_j c_k)`; with the second one, of the stretched areas, a cell that is squeezed flat makes
//! no term large (alpha = -2 is the Mooney-Rivlin law of c01, as 2 is that of c10). M continues below J = 0.3 as
//! `kinematics::isochoric_measure`. Where |alpha| < 2, phi continues as its second-order Taylor polynomial, which is the
//! larger one, below `c = 0.01` (a stretch of 0.1) and `c_j c_k = 1e-4`: finite for every F. `mu0 = mu`.
//! Source: Ogden 1972 in the normalisation of Abaqus; continuation: this project.

use glam::{DMat3, DVec3};

use super::kinematics::{
    J_CONTINUATION, cofactor, is_measure_continued, isochoric_measure, jacobian_minus_one, symmetric_eigen,
};
use super::law::{Constant, Constants, Form, IsochoricLaw, Law, Search};
use super::stretches::Powers;
use super::{Continuation, Isochoric, Mode, TangentBound, Verdict};

pub const LAW: Law = Law {
    key: "ogden",
    name: "Ogden",
    energy: "2 mu/alpha^2 (sum of isochoric stretches^alpha - 3)",
    source: "Ogden1972",
    form: Form::Stretches,
    constants: &[Constant::stress("mu_kpa", "shear modulus at rest"), Constant::number("alpha", "exponent", 50.0)],
    stable: "mu > 0, abs(alpha) >= 1; else up to a limit",
    way_out: "write mu_kpa > 0 and an alpha other than 0; |alpha| >= 1 is stable everywhere",
    build: |c| Isochoric::Ogden(Ogden { mu: c[0], alpha: c[1] }),
    example: [6600.0, 3.7, 0.0, 0.0],
    search: Search::Exponent {
        starts: &[-30.0, -12.0, -5.0, -2.0, -0.5, 0.5, 2.0, 5.0, 12.0, 30.0],
        // |alpha| = 1 is the edge of the stable exponents.
        edges: &[-1.0, 1.0],
    },
    colour: [204, 121, 167],
};

/// Eigenvalue of C, and product of two of them, below which phi continues as a polynomial where |alpha| < 2.
pub const SMALLEST_EIGENVALUE: f64 = 0.01;
const SMALLEST_PRODUCT: f64 = 1e-4;
/// What counts as zero for other exponents: only against division by it.
const ZERO: f64 = 1e-12;

/// Sum S of a state.
struct Sum {
    value: f64,
    /// dS/dc_i.
    by_c: [f64; 3],
    /// d2S/dl_i^2 by the principal stretches.
    by_stretch: [f64; 3],
    c: [f64; 3],
    directions: DMat3,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ogden {
    /// Shear modulus at rest mu [Pa].
    pub mu: f64,
    /// Exponent alpha (dimensionless, not zero).
    pub alpha: f64,
}

impl Ogden {
    pub fn values(&self) -> Constants {
        [self.mu, self.alpha, 0.0, 0.0]
    }

    pub fn shear_modulus(&self) -> f64 {
        self.mu
    }

    /// phi, its first and its second derivative; continued below `low` where |alpha| < 2.
    fn phi(&self, x: f64, low: f64) -> (f64, f64, f64) {
        let p = 0.5 * self.alpha.abs();
        let x = x.max(ZERO);
        let low = if p < 1.0 { low } else { ZERO };
        let at = x.max(low);
        let value = at.powf(p);
        let (first, second) = (p * value / at, p * (p - 1.0) * value / (at * at));
        let d = (x - low).min(0.0);
        (value + d * (first + 0.5 * d * second), first + d * second, second)
    }

    /// Exponent m of `M = J^-m S`.
    fn degree(&self) -> f64 {
        if self.alpha > 0.0 { self.alpha / 3.0 } else { -2.0 * self.alpha / 3.0 }
    }

    fn sum(&self, f: DMat3) -> Sum {
        let (c, directions) = symmetric_eigen(f.transpose() * f);
        let c = c.map(|c| c.max(0.0));
        if self.alpha > 0.0 {
            let phi = c.map(|c| self.phi(c, SMALLEST_EIGENVALUE));
            let by_stretch = |i: usize| 2.0 * phi[i].1 + 4.0 * c[i] * phi[i].2;
            return Sum {
                value: phi.iter().map(|p| p.0).sum(),
                by_c: phi.map(|p| p.1),
                by_stretch: std::array::from_fn(by_stretch),
                c,
                directions,
            };
        }
        let others = |i: usize| ((i + 1) % 3, (i + 2) % 3);
        let phi: [_; 3] = std::array::from_fn(|i| {
            let (j, k) = others(i);
            self.phi(c[j] * c[k], SMALLEST_PRODUCT)
        });
        // c_i stands in the products j and k.
        let by_c = |i: usize| {
            let (j, k) = others(i);
            phi[j].1 * c[k] + phi[k].1 * c[j]
        };
        let by_stretch = |i: usize| {
            let (j, k) = others(i);
            2.0 * by_c(i) + 4.0 * c[i] * (phi[j].2 * c[k] * c[k] + phi[k].2 * c[j] * c[j])
        };
        Sum {
            value: phi.iter().map(|p| p.0).sum(),
            by_c: std::array::from_fn(by_c),
            by_stretch: std::array::from_fn(by_stretch),
            c,
            directions,
        }
    }

    /// True where M is continued.
    fn is_flat(&self, h: DMat3) -> bool {
        let sum = self.sum(DMat3::IDENTITY + h);
        is_measure_continued(sum.value, 1.0 + jacobian_minus_one(h), self.degree())
    }

    /// True where phi is continued.
    fn is_thin(&self, h: DMat3) -> bool {
        let [x, y, z] = self.sum(DMat3::IDENTITY + h).c;
        let (least, low) = if self.alpha > 0.0 {
            (x.min(y).min(z), SMALLEST_EIGENVALUE)
        } else {
            ((x * y).min(y * z).min(z * x), SMALLEST_PRODUCT)
        };
        self.alpha.abs() < 2.0 && least < low
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

impl IsochoricLaw for Ogden {
    fn isochoric_energy(&self, h: DMat3) -> f64 {
        let sum = self.sum(DMat3::IDENTITY + h);
        let measure = isochoric_measure(sum.value, 1.0 + jacobian_minus_one(h), self.degree());
        2.0 * self.mu / self.alpha.powi(2) * (measure.value - 3.0)
    }

    fn isochoric_stress(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        let sum = self.sum(f);
        let measure = isochoric_measure(sum.value, 1.0 + jacobian_minus_one(h), self.degree());
        let n = sum.directions;
        let slope = n * DMat3::from_diagonal(DVec3::from(sum.by_c)) * n.transpose();
        (f * slope * (2.0 * measure.by_s) + cofactor(f) * measure.by_j) * (2.0 * self.mu / self.alpha.powi(2))
    }

    /// Bound of the isochoric tangent modulus [Pa]: the largest second derivative of W_iso by one principal stretch,
    /// ```text
    /// 2 mu/alpha^2 (dM/dS d2S/dl_i^2 + 4 d2M/dSdJ J dS/dc_i + d2M/dJ2 c_j c_k)
    /// ```
    /// A scan over rank-one directions finds no stiffer one while J stays near 1. At rest it is 4/3 mu0. Below J = 0.3 the
    /// second term counts only where it is positive, inside out, and shear of small stretches, `2 dM/dS dS/dc_i`, counts, too;
    /// with kappa it is at least 0.7 of the stiffest wave there (`tests/material/waves.rs`).
    fn tangent_bound(&self, h: DMat3, _bulk_modulus: f64) -> TangentBound {
        let sum = self.sum(DMat3::IDENTITY + h);
        let j = 1.0 + jacobian_minus_one(h);
        let measure = isochoric_measure(sum.value, j, self.degree());
        let is_below = j < J_CONTINUATION;
        // J d2M/dSdJ.
        let mixed = if is_below { (j * measure.by_j / sum.value).max(0.0) } else { -self.degree() * measure.by_s };
        let along = |i: usize| {
            let others = sum.c[(i + 1) % 3] * sum.c[(i + 2) % 3];
            let straight = if is_below { sum.by_stretch[i].max(2.0 * sum.by_c[i]) } else { sum.by_stretch[i] };
            measure.by_s * straight + 4.0 * mixed * sum.by_c[i] + measure.by_jj * others
        };
        let largest = along(0).max(along(1)).max(along(2)).max(0.0);
        TangentBound { straight: 2.0 * self.mu / self.alpha.powi(2) * largest, turned: 0.0 }
    }

    fn continuation(&self, h: DMat3) -> Option<Continuation> {
        if self.is_flat(h) { Some(Continuation::Volume) } else { self.is_thin(h).then_some(Continuation::Stretch) }
    }

    fn powers(&self) -> Option<Powers<f64>> {
        (self.alpha != 0.0).then_some(Powers { mu: self.mu, alpha: self.alpha })
    }

    /// The closed forms in the stretches; those in the invariants are at [`crate::material::fit`], too.
    fn nominal_stress(&self, mode: Mode, x: f64) -> f64 {
        let (mu, alpha) = (self.mu, self.alpha);
        let l = if mode == Mode::Shear { mode.principal_stretches(x)[0] } else { x };
        let powers = match mode {
            Mode::Uniaxial => l.powf(alpha - 1.0) - l.powf(-0.5 * alpha - 1.0),
            Mode::Equibiaxial => l.powf(alpha - 1.0) - l.powf(-2.0 * alpha - 1.0),
            Mode::Planar => l.powf(alpha - 1.0) - l.powf(-alpha - 1.0),
            Mode::Shear => (l.powf(alpha) - l.powf(-alpha)) / (l + 1.0 / l),
        };
        2.0 * mu / alpha * powers
    }
}
