//! Elastic laws, one file each, and the verdict on their constants.
//!
//! Every law is an isochoric energy and a volumetric penalty,
//! ```text
//! W = W_iso + kappa/2 (J - 1)^2,   P = P_iso + kappa (J - 1) cof F                     [J/m^3], [Pa]
//! P_iso = 2 w1 a F + 2 w2 b (I1 F - F C) + (w1 a' I1 + w2 b' I2) cof F
//! ```
//! with `w1 = dW_iso/dI1bar`, `w2 = dW_iso/dI2bar`, `I1bar = a I1`, `I2bar = b I2`, `a = J^(-2/3)`, `b = J^(-4/3)` for
//! J >= 0.3 and their second-order Taylor polynomials below, so that W is twice differentiable and finite for every F,
//! inverted ones included. Ogden's law alone needs the principal stretches; its form is in `ogden`.
//! Source: the split of Flory 1961; penalty as in [Lv2022] Eq. 1, kappa = 2/D; continuation: this project.

pub mod demiray;
pub mod fit;
pub mod kinematics;
pub mod mode;
pub mod mooney_rivlin;
pub mod neo_hookean;
pub mod ogden;
pub mod yeoh;

pub use demiray::Demiray;
pub use mode::Mode;
pub use mooney_rivlin::MooneyRivlin;
pub use neo_hookean::NeoHookean;
pub use ogden::Ogden;
pub use yeoh::Yeoh;

use glam::{DMat3, DVec3};
use kinematics::{cofactor, double_dot, invariants, isochoric_factor, isochoric_factor_curvature, jacobian_minus_one};

/// Largest stretch that a numerical verdict looks at.
pub const LARGEST_STRETCH: f64 = 6.0;

/// Derivatives of W_iso by `I1bar` and `I2bar` [Pa]: `w1`, `w2`, and `w11 = d^2 W/dI1bar^2`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slopes {
    pub w1: f64,
    pub w2: f64,
    pub w11: f64,
}

/// What the constants mean for stability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Elliptic for every deformation.
    Stable,
    /// Elliptic while every principal stretch of an isochoric deformation stays below the limit.
    StableBelow(f64),
    /// Elliptic while every principal stretch of an isochoric deformation stays above the limit.
    StableAbove(f64),
    /// Ground-state shear modulus <= 0, or bulk modulus <= 0: unstable at rest.
    Unstable,
}

/// The isochoric part of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Isochoric {
    NeoHookean(NeoHookean),
    MooneyRivlin(MooneyRivlin),
    Yeoh(Yeoh),
    Ogden(Ogden),
    Demiray(Demiray),
}

impl Isochoric {
    /// Name in scene files and outputs: the stem of its files.
    pub fn key(&self) -> &'static str {
        match self {
            Isochoric::NeoHookean(_) => "neo_hookean",
            Isochoric::MooneyRivlin(_) => "mooney_rivlin",
            Isochoric::Yeoh(_) => "yeoh",
            Isochoric::Ogden(_) => "ogden",
            Isochoric::Demiray(_) => "demiray",
        }
    }

    /// Constants with the keys and units of a scene file: stresses in kPa, exponents without a unit.
    pub fn constants(&self) -> Vec<(&'static str, f64)> {
        let kpa = 1e-3;
        match self {
            Isochoric::NeoHookean(l) => vec![("c10_kpa", l.c10 * kpa)],
            Isochoric::MooneyRivlin(l) => vec![("c10_kpa", l.c10 * kpa), ("c01_kpa", l.c01 * kpa)],
            Isochoric::Yeoh(l) => {
                vec![("c10_kpa", l.c10 * kpa), ("c20_kpa", l.c20 * kpa), ("c30_kpa", l.c30 * kpa)]
            }
            Isochoric::Ogden(l) => vec![("mu_kpa", l.mu * kpa), ("alpha", l.alpha)],
            Isochoric::Demiray(l) => vec![("mu_kpa", l.mu * kpa), ("b", l.b)],
        }
    }

    /// Ground-state shear modulus mu0 [Pa].
    pub fn shear_modulus(&self) -> f64 {
        match self {
            Isochoric::NeoHookean(l) => l.shear_modulus(),
            Isochoric::MooneyRivlin(l) => l.shear_modulus(),
            Isochoric::Yeoh(l) => l.shear_modulus(),
            Isochoric::Ogden(l) => l.shear_modulus(),
            Isochoric::Demiray(l) => l.shear_modulus(),
        }
    }

    /// Slopes for `I1bar - 3` and `I2bar - 3`; `None` for Ogden's law, which is no function of them.
    fn slopes(&self, i1: f64) -> Option<Slopes> {
        match self {
            Isochoric::NeoHookean(l) => Some(l.slopes()),
            Isochoric::MooneyRivlin(l) => Some(l.slopes()),
            Isochoric::Yeoh(l) => Some(l.slopes(i1)),
            Isochoric::Ogden(_) => None,
            Isochoric::Demiray(l) => Some(l.slopes(i1)),
        }
    }

    pub fn verdict(&self) -> Verdict {
        match self {
            Isochoric::NeoHookean(l) => l.verdict(),
            Isochoric::MooneyRivlin(l) => l.verdict(),
            Isochoric::Yeoh(l) => l.verdict(),
            Isochoric::Ogden(l) => l.verdict(),
            Isochoric::Demiray(l) => l.verdict(),
        }
    }
}

/// What the isochoric law adds to the modulus that a wave finds, `straight |N|^2 + turned |cof F N|^2` for its direction N
/// at rest; kappa stands beside `turned`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TangentBound {
    /// [Pa]
    pub straight: f64,
    /// [Pa]
    pub turned: f64,
}

/// Isochoric energy and bulk modulus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ElasticLaw {
    pub isochoric: Isochoric,
    /// Bulk modulus kappa = 2/D [Pa].
    pub bulk_modulus: f64,
}

impl ElasticLaw {
    /// c10, c01 and bulk modulus [Pa].
    pub const fn mooney_rivlin(c10: f64, c01: f64, bulk_modulus: f64) -> Self {
        ElasticLaw { isochoric: Isochoric::MooneyRivlin(MooneyRivlin { c10, c01 }), bulk_modulus }
    }

    /// Mooney-Rivlin constants from ground-state moduli: `share` of the shear modulus goes to c10, the rest to c01.
    ///
    /// `shear_modulus` mu0 [Pa], `bulk_modulus` [Pa], `share` 0..1.
    pub fn from_moduli(shear_modulus: f64, bulk_modulus: f64, share: f64) -> Self {
        Self::mooney_rivlin(0.5 * shear_modulus * share, 0.5 * shear_modulus * (1.0 - share), bulk_modulus)
    }

    /// Ground-state shear modulus mu0 [Pa].
    pub fn shear_modulus(&self) -> f64 {
        self.isochoric.shear_modulus()
    }

    /// Young's modulus at rest [Pa].
    pub fn youngs_modulus(&self) -> f64 {
        let (k, mu) = (self.bulk_modulus, self.shear_modulus());
        9.0 * k * mu / (3.0 * k + mu)
    }

    /// Poisson's ratio at rest.
    pub fn poisson_ratio(&self) -> f64 {
        let (k, mu) = (self.bulk_modulus, self.shear_modulus());
        (3.0 * k - 2.0 * mu) / (2.0 * (3.0 * k + mu))
    }

    /// P-wave modulus K + 4/3 mu [Pa].
    pub fn p_wave_modulus(&self) -> f64 {
        self.bulk_modulus + 4.0 / 3.0 * self.shear_modulus()
    }

    /// Stability of the constants over all deformations.
    pub fn verdict(&self) -> Verdict {
        if self.bulk_modulus > 0.0 && self.bulk_modulus.is_finite() {
            self.isochoric.verdict()
        } else {
            Verdict::Unstable
        }
    }

    /// Isochoric energy density for the displacement gradient H = F - I [J/m^3].
    pub fn isochoric_energy(&self, h: DMat3) -> f64 {
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(f);
        let i1 = isochoric_factor(j, -2.0 / 3.0).0 * i1 - 3.0;
        let i2 = isochoric_factor(j, -4.0 / 3.0).0 * i2 - 3.0;
        match &self.isochoric {
            Isochoric::NeoHookean(l) => l.energy(i1),
            Isochoric::MooneyRivlin(l) => l.energy(i1, i2),
            Isochoric::Yeoh(l) => l.energy(i1),
            Isochoric::Ogden(l) => l.energy(h),
            Isochoric::Demiray(l) => l.energy(i1),
        }
    }

    /// Isochoric first Piola-Kirchhoff stress P_iso for H = F - I [Pa].
    pub fn isochoric_stress(&self, h: DMat3) -> DMat3 {
        if let Isochoric::Ogden(l) = &self.isochoric {
            return l.isochoric_stress(h);
        }
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (a, da) = isochoric_factor(j, -2.0 / 3.0);
        let (b, db) = isochoric_factor(j, -4.0 / 3.0);
        let (i1, i2) = invariants(f);
        let s = self.isochoric.slopes(a * i1 - 3.0).unwrap_or_default();
        let c = f.transpose() * f;
        f * (2.0 * s.w1 * a) + (f * i1 - f * c) * (2.0 * s.w2 * b) + cofactor(f) * (s.w1 * da * i1 + s.w2 * db * i2)
    }

    /// Energy density W for H = F - I [J/m^3].
    pub fn energy_density(&self, h: DMat3) -> f64 {
        let dj = jacobian_minus_one(h);
        self.isochoric_energy(h) + 0.5 * self.bulk_modulus * dj * dj
    }

    /// First Piola-Kirchhoff stress P for H = F - I [Pa].
    pub fn first_piola_kirchhoff(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        self.isochoric_stress(h) + cofactor(f) * (self.bulk_modulus * jacobian_minus_one(h))
    }

    /// Cauchy stress sigma = P F^T / J [Pa]; meaningful for J > 0 only.
    pub fn cauchy(&self, h: DMat3) -> DMat3 {
        let f = DMat3::IDENTITY + h;
        self.first_piola_kirchhoff(h) * f.transpose() * (1.0 / f.determinant())
    }

    /// Estimate of the isochoric tangent modulus for the stable step: what a wave finds, `(a N) : d2W_iso/dF2 :
    /// (a N)` for unit vectors a and N. At rest it is 4/3 mu0, and exact.
    ///
    /// ```text
    /// straight = 4/3 2 (w1 + w2) max(1, I1/3) + 4 w11 a^2 I1 (I1 I2/(9 J^2) - 1)
    /// turned   = w1 (a'' I1 - 10/3) + w2 (b'' I2 - 28/3),   a = J^(-2/3), b = J^(-4/3)
    /// ```
    /// the same as in the kernel. The second term of `straight` is the square of the gradient of I1bar and bounds the
    /// stiffening for every J >= 0.3; `turned` is what the curvatures of a and b have beyond rest. It is an estimate: with
    /// stretches 0.4..2.5 and J 0.8..1.25, kappa and this together reach at least 0.77 of the true modulus at nu 0.45,
    /// 0.8 at 0.49 (an exponential law; Mooney-Rivlin 0.96), and 0.68 at 0.3 (`tests/material/waves.rs`). Ogden's law has
    /// its own form, which is a bound.
    pub fn tangent_bound(&self, h: DMat3) -> TangentBound {
        if let Isochoric::Ogden(l) = &self.isochoric {
            return TangentBound { straight: l.tangent_bound(h), turned: 0.0 };
        }
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (a, _) = isochoric_factor(j, -2.0 / 3.0);
        let (i1, i2) = invariants(f);
        let s = self.isochoric.slopes(a * i1 - 3.0).unwrap_or_default();
        let gradient_squared = a * a * i1 * (a * a * a * i1 * i2 / 9.0 - 1.0);
        let curvature = |p: f64, invariant: f64| {
            isochoric_factor_curvature(j, p) * invariant - isochoric_factor_curvature(1.0, p) * 3.0
        };
        TangentBound {
            straight: 8.0 / 3.0 * (s.w1 + s.w2) * (i1 / 3.0).max(1.0)
                + 4.0 * s.w11.max(0.0) * gradient_squared.max(0.0),
            turned: (s.w1 * curvature(-2.0 / 3.0, i1) + s.w2 * curvature(-4.0 / 3.0, i2)).max(0.0),
        }
    }
}

/// Stretch up to which a law of I1bar alone is elliptic: `w1 > 0` and `w1 + 2 w11 (l_max - l_min)^2 > 0` in every
/// isochoric state whose largest stretch it is. (The largest square of `a.F N` over unit vectors with `a.F^-T N = 0` is
/// `(l_max - l_min)^2`.)
fn stable_range(slopes: &dyn Fn(f64) -> Slopes) -> Verdict {
    const STEP: f64 = 1e-3;
    /// States between uniaxial tension (0) and equibiaxial tension (1) that are looked at.
    const STATES: i32 = 16;
    let elliptic = |l: f64, state: i32| {
        let middle = l.powf(-0.5 + 1.5 * f64::from(state) / f64::from(STATES));
        let least = 1.0 / (l * middle);
        let w = slopes(l * l + middle * middle + least * least - 3.0);
        w.w1 > 0.0 && w.w1 + 2.0 * w.w11 * (l - least).powi(2) > 0.0
    };
    let mut stretches = (1..).map(|i| 1.0 + f64::from(i) * STEP).take_while(|l| *l < LARGEST_STRETCH);
    let limit = stretches.find(|l| !(0..=STATES).all(|state| elliptic(*l, state)));
    limit.map_or(Verdict::Stable, Verdict::StableBelow)
}

/// A number for a message: four significant digits, no trailing zeros.
pub fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// The constants of a law with names and units.
pub fn describe_constants(law: &ElasticLaw) -> String {
    let constant = |(key, value): (&str, f64)| match key.strip_suffix("_kpa") {
        Some(name) => format!("{name} {} kPa", four_digits(value)),
        None => format!("{key} {}", four_digits(value)),
    };
    law.isochoric.constants().into_iter().map(constant).collect::<Vec<_>>().join(", ")
}

/// The verdict on a tissue law in one or two sentences, with the moduli at rest.
pub fn describe_verdict(law: &ElasticLaw) -> String {
    let kpa = |value: f64| four_digits(value * 1e-3);
    let constants = describe_constants(law);
    let moduli = format!(
        "E {} kPa, nu {}, K {} kPa at rest",
        kpa(law.youngs_modulus()),
        four_digits(law.poisson_ratio()),
        kpa(law.bulk_modulus)
    );
    let limited = |side: &str, limit: f64| {
        format!("stable only while every principal stretch stays {side} {} ({constants}; {moduli})", four_digits(limit))
    };
    match law.verdict() {
        Verdict::Stable => format!("stable for every deformation ({constants}; {moduli})"),
        Verdict::StableBelow(limit) => limited("below", limit),
        Verdict::StableAbove(limit) => limited("above", limit),
        Verdict::Unstable if law.bulk_modulus <= 0.0 => {
            format!("unstable at rest: bulk modulus {} kPa is not positive ({constants})", kpa(law.bulk_modulus))
        }
        Verdict::Unstable => match &law.isochoric {
            Isochoric::MooneyRivlin(l) => format!(
                "unstable at rest: c10 + c01 = {} kPa, shear modulus {} kPa is not positive ({constants})",
                kpa(l.c10 + l.c01),
                kpa(law.shear_modulus())
            ),
            _ => format!(
                "unstable at rest: shear modulus {} kPa is not positive, or a constant is out of range ({constants})",
                kpa(law.shear_modulus())
            ),
        },
    }
}

/// Time in which a ripple of half wavelength `length` [m] grows by the factor e in an unstable tissue at rest [s]:
/// `length/pi * sqrt(rho / |mu0|)`; `None` where the shear modulus is not negative.
pub fn ripple_growth_time(law: &ElasticLaw, density: f64, length: f64) -> Option<f64> {
    let shear = law.shear_modulus();
    (shear < 0.0).then(|| length / std::f64::consts::PI * (density / -shear).sqrt())
}

/// Von Mises equivalent of a symmetric stress [Pa].
pub fn von_mises(sigma: DMat3) -> f64 {
    let d = DVec3::new(sigma.x_axis.x, sigma.y_axis.y, sigma.z_axis.z);
    let shear = sigma.x_axis.y.powi(2) + sigma.y_axis.z.powi(2) + sigma.z_axis.x.powi(2);
    (0.5 * ((d.x - d.y).powi(2) + (d.y - d.z).powi(2) + (d.z - d.x).powi(2)) + 3.0 * shear).sqrt()
}

/// Deviator of a second-order tensor.
pub fn deviator(a: DMat3) -> DMat3 {
    a - DMat3::IDENTITY * (kinematics::trace(a) / 3.0)
}

/// `sqrt(3/2 A : A)` of a deviator.
pub fn equivalent(deviator: DMat3) -> f64 {
    (1.5 * double_dot(deviator, deviator)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(c10: f64, c01: f64) -> ElasticLaw {
        ElasticLaw::mooney_rivlin(c10 * 1e3, c01 * 1e3, 5.0e5)
    }

    #[test]
    fn the_verdict_names_constants_and_limit() {
        assert!(describe_verdict(&law(2.3, 1.0)).starts_with("stable for every deformation (c10 2.3 kPa"));
        assert!(describe_verdict(&law(2.0, -1.0)).contains("below 1.414 "));
        assert!(describe_verdict(&law(-1.0, 4.0)).contains("above 0.5 "));
        assert!(describe_verdict(&law(4.75, -4.91)).contains("c10 + c01 = -0.16 kPa, shear modulus -0.32 kPa"));
    }

    #[test]
    fn the_printed_constants_grow_in_half_a_millisecond() {
        // An independent computation gives 0.46 ms for 0.8 mm, 1060 kg/m^3.
        let time = ripple_growth_time(&law(4.75, -4.91), 1060.0, 0.8e-3).unwrap();
        assert!((time - 0.46e-3).abs() < 0.01e-3);
        assert_eq!(ripple_growth_time(&law(2.3, 1.0), 1060.0, 0.8e-3), None);
    }
}
