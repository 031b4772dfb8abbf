//! Elastic laws, one file each, and the verdict on their constants.
//!
//! Every law is an isochoric energy and a volumetric penalty,
//! ```text
//! W = W_iso + kappa/2 (J - 1)^2,   P = P_iso + kappa (J - 1) cof F                     [J/m^3], [Pa]
//! P_iso = 2 w1 a F + 2 w2 b (I1 F - F C) + (w1 dI1bar/dJ + w2 dI2bar/dJ) cof F
//! ```
//! with `w1 = dW_iso/dI1bar`, `w2 = dW_iso/dI2bar`, `a = dI1bar/dI1`, `b = dI2bar/dI2`. For J >= 0.3 `I1bar = J^(-2/3) I1` and
//! `I2bar = J^(-4/3) I2`; below they continue as `kinematics::isochoric_measure` (`invariants`). Ogden's law alone needs the
//! principal stretches; its form is in `ogden`. What else the program knows about a law stands in its entry `LAW` (`law`).
//!
//! What the continuation holds, for every law and all constants that are stable for every deformation: W is twice
//! differentiable and finite for every F, inverted ones included; W >= 0, and W_iso >= 0 with its least value at a pure
//! change of volume; a pure squeeze (F = s R) meets a pressure for every s < 1, for Ogden's law with |alpha| < 2 down to
//! s = 0.1; a squeeze along one direction meets a pressure on its faces where J goes to 0. A sheet that is flat but not
//! small pulls its edges inwards: no finite energy can do without that. Constants with a limited range keep W >= 0 within it.
//! Source: the split of Flory 1961; penalty as in [Lv2022] Eq. 1, kappa = 2/D; continuation: this project.

#[macro_use]
pub mod law;

pub mod curves;
pub mod demiray;
pub mod fit;
pub mod invariants;
pub mod kinematics;
pub mod least_squares;
pub mod mode;
pub mod mooney_rivlin;
pub mod neo_hookean;
pub mod ogden;
pub mod regular;
pub mod stretches;
pub mod yeoh;

pub use invariants::{InvariantLaw, Slopes};
pub use law::{Constants, IsochoricLaw, Law};
pub use mode::Mode;

use glam::{DMat3, DVec3};
use kinematics::{cofactor, double_dot, jacobian_minus_one};
use regular::{Exponential, Polynomial};
use stretches::Powers;

use crate::units::four_digits;

laws! {
    neo_hookean::NeoHookean,
    mooney_rivlin::MooneyRivlin,
    yeoh::Yeoh,
    ogden::Ogden,
    demiray::Demiray,
}

/// Largest stretch that a numerical verdict looks at.
pub const LARGEST_STRETCH: f64 = 6.0;

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

impl Isochoric {
    /// What the program knows about the law.
    pub fn law(&self) -> &'static Law {
        self.word().law()
    }

    /// Name in scene files and outputs: the stem of its files.
    pub fn key(&self) -> &'static str {
        self.law().key
    }

    /// Constants with the keys and units of a scene file: stresses in kPa, exponents without a unit.
    pub fn constants(&self) -> Vec<(&'static str, f64)> {
        self.law().constants.iter().zip(self.values()).map(|(c, value)| (c.key, c.shown(value))).collect()
    }
}

impl LawWord {
    /// What the program knows about the law.
    pub fn law(self) -> &'static Law {
        &LAWS[self as usize]
    }
}

/// The side on which a state has left its law and follows the continuation that keeps every state finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Continuation {
    /// Squeezed flat, or inside out: J below 0.3, for its size too.
    Volume,
    /// The exponent of an exponential law is beyond 10.
    Exponent,
    /// A stretch below 0.1, or an area below 0.01, of an Ogden law with |alpha| < 2.
    Stretch,
}

impl Continuation {
    /// The word in tables and files.
    pub fn key(self) -> &'static str {
        match self {
            Continuation::Volume => "volume",
            Continuation::Exponent => "exponent",
            Continuation::Stretch => "stretch",
        }
    }

    /// One line on it.
    pub fn describe(self) -> &'static str {
        match self {
            Continuation::Volume => "so flat for its size that the law is continued (below J = 0.3)",
            Continuation::Exponent => "exponent beyond 10: the exponential is continued as a polynomial",
            Continuation::Stretch => "a stretch so small that the power is continued as a polynomial",
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
        self.isochoric.isochoric_energy(h)
    }

    /// Isochoric first Piola-Kirchhoff stress P_iso for H = F - I [Pa].
    pub fn isochoric_stress(&self, h: DMat3) -> DMat3 {
        self.isochoric.isochoric_stress(h)
    }

    /// Where the isochoric law is no longer the one that its name says, for H = F - I; `None` where it is.
    pub fn continuation(&self, h: DMat3) -> Option<Continuation> {
        self.isochoric.continuation(h)
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

    /// Bound of the isochoric tangent modulus for the stable step: of what a wave finds, `m N : d2W_iso/dF2 : m N` for a unit vector
    /// m and any N, together with the bulk modulus, `(kappa + turned) |cof F N|^2 + straight |N|^2`.
    pub fn tangent_bound(&self, h: DMat3) -> TangentBound {
        self.isochoric.tangent_bound(h, self.bulk_modulus)
    }
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
