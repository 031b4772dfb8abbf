//! Elastic laws, one file each, and the verdict on their constants.
//!
//! Every law is an isochoric energy and a volumetric penalty,
//! ```text
//! W = W_iso + kappa/2 (J - 1)^2,   P = P_iso + kappa (J - 1) cof F                     [J/m^3], [Pa]
//! P_iso = 2 w1 a F + 2 w2 b (I1 F - F C) + (w1 dI1bar/dJ + w2 dI2bar/dJ) cof F
//! ```
//! with `w1 = dW_iso/dI1bar`, `w2 = dW_iso/dI2bar`, `a = dI1bar/dI1`, `b = dI2bar/dI2`. For J >= 0.3 `I1bar = J^(-2/3) I1` and
//! `I2bar = J^(-4/3) I2`; below they continue as `kinematics::isochoric_measure`. Ogden's law alone needs the principal
//! stretches; its form is in `ogden`.
//!
//! What the continuation holds, for every law and all constants that are stable for every deformation: W is twice
//! differentiable and finite for every F, inverted ones included; W >= 0, and W_iso >= 0 with its least value at a pure
//! change of volume; a pure squeeze (F = s R) meets a pressure for every s < 1, for Ogden's law with |alpha| < 2 down to
//! s = 0.1; a squeeze along one direction meets a pressure on its faces where J goes to 0. A sheet that is flat but not
//! small pulls its edges inwards: no finite energy can do without that. Constants with a limited range keep W >= 0 within it.
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

pub use crate::units::four_digits;

use glam::{DMat3, DVec3};
use kinematics::{
    J_CONTINUATION, cofactor, double_dot, invariants, is_measure_continued, isochoric_measure, jacobian_minus_one,
};

/// Largest stretch that a numerical verdict looks at.
pub const LARGEST_STRETCH: f64 = 6.0;

/// Degrees m of `J^-m I1` and `J^-m I2`.
const FIRST: f64 = 2.0 / 3.0;
const SECOND: f64 = 4.0 / 3.0;

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
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(f);
        let i1 = isochoric_measure(i1, j, FIRST).value - 3.0;
        let i2 = isochoric_measure(i2, j, SECOND).value - 3.0;
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
        let (i1, i2) = invariants(f);
        let (first, second) = (isochoric_measure(i1, j, FIRST), isochoric_measure(i2, j, SECOND));
        let s = self.isochoric.slopes(first.value - 3.0).unwrap_or_default();
        let c = f.transpose() * f;
        f * (2.0 * s.w1 * first.by_s)
            + (f * i1 - f * c) * (2.0 * s.w2 * second.by_s)
            + cofactor(f) * (s.w1 * first.by_j + s.w2 * second.by_j)
    }

    /// Where the isochoric law is no longer the one that its name says, for H = F - I; `None` where it is.
    pub fn continuation(&self, h: DMat3) -> Option<Continuation> {
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(DMat3::IDENTITY + h);
        let first = is_measure_continued(i1, j, FIRST);
        let is_flat = match &self.isochoric {
            Isochoric::MooneyRivlin(l) => l.c10 != 0.0 && first || l.c01 != 0.0 && is_measure_continued(i2, j, SECOND),
            Isochoric::Ogden(l) => l.is_flat(h),
            _ => first,
        };
        match &self.isochoric {
            _ if is_flat => Some(Continuation::Volume),
            Isochoric::Ogden(l) if l.is_thin(h) => Some(Continuation::Stretch),
            Isochoric::Demiray(l) if l.is_capped(isochoric_measure(i1, j, FIRST).value - 3.0) => {
                Some(Continuation::Exponent)
            }
            _ => None,
        }
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
    /// m and any N, together with the bulk modulus, `(kappa + turned) |cof F N|^2 + straight |N|^2`. At rest `turned` is 4/3 mu0,
    /// and exact, as in every pure change of volume.
    ///
    /// Along a wave F + t m N has `dJ/dt = m.u`, u = cof F N; with y = m.F N the second derivative of `a I1` is
    /// `a'' I1 (m.u)^2 - 4 |a'| (m.u) y + 2 a`. F N has the part J/|u|^2 along u, which makes the first line, and across u at most
    /// `J (l1^2 - l3^2)/(2 l1 l3)` times |N|^2/|u| (Kantorovich's inequality). The same for `b I2`, whose terms have
    /// `q = I1 - |F N|^2`, and across u at most 0.58 times the largest `|li^2 - lj^2| lk^3`:
    /// ```text
    /// turned   = w1 (a'' I1 - c1/g) + w2 (b'' I2 - c2 (I1 - l1^2)/g),  g = (l1 l2)^2
    /// c1 = 4 |a'| J - 2 a,  c2 = 4 |b'| J - 2 b
    /// straight = |w1| |a'| (l1^2 - l3^2) l2 + 1.16 |w2| |b'| max |li^2 - lj^2| lk^3 + w11 |dI1bar/dF|^2
    ///            + (2 w1 a + 2 w2 b l1^2 - (kappa + turned) (J/l1)^2)+
    /// ```
    /// the last term for waves across their direction. The eigenvalues l1^2 of C and g of cof C are bounded by Gershgorin's circles. The
    /// same as in the kernel; below J = 0.3 `straight` is at least what turning inside out adds. Source: this project; the bound
    /// is compared with the acoustic tensor in `tests/material/waves.rs`. Strains below [`SMALL_STRAIN`] have a simpler bound, found by
    /// sampling and compared there, too. Ogden's law has its own form.
    pub fn tangent_bound(&self, h: DMat3) -> TangentBound {
        if let Isochoric::Ogden(l) = &self.isochoric {
            return TangentBound { straight: l.tangent_bound(h), turned: 0.0 };
        }
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(f);
        let (first, second) = (isochoric_measure(i1, j, FIRST), isochoric_measure(i2, j, SECOND));
        let s = self.isochoric.slopes(first.value - 3.0).unwrap_or_default();
        // |2 a F + dI1bar/dJ cof F|^2, with F : cof F = 3 J.
        let gradient_squared = 4.0 * first.by_s * (first.by_s * i1 + 3.0 * first.by_j * j) + first.by_j.powi(2) * i2;
        let stiffening = s.w11.max(0.0) * gradient_squared.max(0.0);
        let c = f.transpose() * f;
        let strain = largest_strain(c);
        if strain < SMALL_STRAIN {
            let w = s.w1.abs() + s.w2.abs();
            let turned = 8.0 / 3.0 * (s.w1 + s.w2 + 6.0 * strain * w);
            return TangentBound { straight: 3.2 * strain * w + stiffening, turned };
        }
        let cof = cofactor(f);
        let (largest, area) =
            (largest_eigenvalue_bound(c).min(i1), largest_eigenvalue_bound(cof.transpose() * cof).min(i2).max(1e-12));
        let least = (j * j / area).min(largest);
        let middle = (i1 - largest - least).clamp(least, largest);
        let (a, b) = (first.by_s, second.by_s);
        let (fall_a, fall_b) = (first.by_j.abs() / i1.max(1e-6), second.by_j.abs() / i2.max(1e-6));
        let (c1, c2) = (2.0 * a - 4.0 * fall_a * j.max(0.0), 2.0 * b - 4.0 * fall_b * j.max(0.0));
        let turned =
            s.w1 * (first.by_jj + c1.min(0.0) / area) + s.w2 * (second.by_jj + c2.min(0.0) * (i1 - largest) / area);
        let turned = turned.max(0.0);
        let [l1, l2, l3] = [largest, middle, least].map(f64::sqrt);
        let across =
            ((largest - least) * l2.powi(3)).max((middle - least) * l1.powi(3)).max((largest - middle) * l3.powi(3));
        let sideways = 2.0 * s.w1 * a + 2.0 * s.w2 * b * largest;
        let mut straight = s.w1.abs() * fall_a * (largest - least) * l2
            + 1.16 * s.w2.abs() * fall_b * across
            + s.w1 * c1.max(0.0)
            + s.w2 * c2.max(0.0) * (i1 - least)
            + (sideways - (self.bulk_modulus + turned) * j * j / largest.max(1e-12)).max(0.0);
        if j < J_CONTINUATION {
            // Inside out, both terms of a wave along its direction add.
            let inside_out = 4.0 * (-j).max(0.0);
            let of_first = 2.0 * a + inside_out * fall_a;
            let of_second = 2.0 * b + inside_out * fall_b;
            straight = straight.max(s.w1 * of_first + s.w2 * of_second * i1);
        }
        TangentBound { straight: straight.max(0.0) + stiffening, turned }
    }
}

/// Strain e up to which the tangent bound is `turned = 8/3 (w1 + w2) (1 + 6 e)`, `straight = 3.2 e (w1 + w2)`: most cells of a block, and
/// far fewer operations.
const SMALL_STRAIN: f64 = 0.1;

/// Largest change of a diagonal entry of C, and twice the largest entry beside the diagonal.
fn largest_strain(c: DMat3) -> f64 {
    let along = DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z) - DVec3::ONE;
    let beside = DVec3::new(c.x_axis.y, c.y_axis.z, c.z_axis.x);
    along.abs().max_element() + 2.0 * beside.abs().max_element()
}

/// Bound of the largest eigenvalue of a symmetric matrix: the largest sum of absolute values of a row (Gershgorin).
fn largest_eigenvalue_bound(c: DMat3) -> f64 {
    [c.x_axis, c.y_axis, c.z_axis].map(|row| row.abs().element_sum()).into_iter().fold(0.0, f64::max)
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
