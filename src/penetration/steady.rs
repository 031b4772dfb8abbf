//! The steady penetration of one material by one needle.
//!
//! ```text
//! J^ = J_c/(mu R),  F_tip = U + 2 a J_c,  N R = 2 U - a dU/da
//! a = max(a_J, pi R/(2 lambda_u)):  a_J makes F_tip least; at lambda_u the tissue tears       [m]
//! F_cut = F_tip - U_hole(a_eq, R),  F_pun = (n + 1) F_tip
//! ```
//! A face of the slit of half perimeter 2a becomes half the circumference pi R, so its mean stretch is pi R/(2a): tissue that tears at
//! lambda_u has no smaller slit. `a_eq` is the rest radius of the round hole with the same N. Neo-Hooke at J^ > 4:
//! `a_J = pi R/(2 J^)`, `a_eq = a/2`, `F_tip = pi mu R^2 (1 + ln(4 J^/pi))`, `N = pi mu R (1 + 2 ln(4 J^/pi))`, F_cut = 2 a J_c.
//!
//! F_pun: an indented surface with a force that grows like `d^n` gives way where its energy `F d/(n + 1)` is that of the penetrated
//! state, `F_tip d` [Fregonese2021].

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use super::cavity;
use super::compressible;
use super::law::{EnergyJet, PlaneStrainLaw};
use super::neo_hooke_curve;
use super::wedge_curve::{CurveEnd, OutOfCurve, WedgeCurve, WedgeOptions, WedgePoint};
use crate::material::{ElasticLaw, Isochoric};
use crate::needle::TipShape;
use crate::needle::opening::Growth;
use crate::units::four_digits;

/// Curves that are kept at most.
const MOST_CURVES: usize = 64;

/// How the force of an indented surface grows before it gives way, `F ~ d^n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Indenter {
    /// A cone or a bevel: n = 2.
    Pointed,
    /// A ball (Hertz): n = 3/2.
    Round,
    /// A flat end: n = 1.
    Flat,
}

impl Indenter {
    /// Puncture force over the steady force of the tip, n + 1.
    pub fn puncture_over_steady(self) -> f64 {
        match self {
            Indenter::Pointed => 3.0,
            Indenter::Round => 2.5,
            Indenter::Flat => 2.0,
        }
    }
}

impl From<TipShape> for Indenter {
    fn from(tip: TipShape) -> Self {
        match tip {
            TipShape::Cone | TipShape::Bevel { .. } => Indenter::Pointed,
        }
    }
}

/// Most that the scheme `opening` stretches the wall of a hole. Beyond 200 times the points beside it made steps unstable that cells carry: a
/// 22G needle in liver (toughness 264 mu R, stretch 330) created its own work twice. The normal force changes little with it: 0.0140, 0.0145 and
/// 0.0149 N/mm at 60, 100 and 205 there.
pub const MOST_OPENED: f64 = 100.0;

/// What resists the crack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resistance {
    /// J_c [J/m^2], for a slit of width 2a.
    pub toughness: f64,
    /// Stretch lambda_u at which the tissue tears, > 1; `None`: it holds any.
    pub tear_stretch: Option<f64>,
}

/// Why there is no answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsolved {
    /// A number is not positive and finite.
    Numbers,
    /// The crack would be larger than any that was computed; smallest J^ of the curve.
    TooBrittle {
        /// J^ asked for.
        relative: f64,
        /// Smallest that has an answer.
        least: f64,
    },
    /// The crack would be smaller than any that was computed, or than any that this law has; largest J^ of the curve.
    TooTough {
        /// J^ asked for.
        relative: f64,
        /// Largest that has an answer.
        most: f64,
        /// True where the law has no equilibrium for a smaller crack.
        law_ends: bool,
    },
    /// Not even a wide crack has a stable equilibrium with this law.
    Law,
}

impl fmt::Display for Unsolved {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            Unsolved::Numbers => write!(f, "toughness, radius and shear modulus must be positive"),
            Unsolved::TooBrittle { relative, least } => write!(
                f,
                "J_c/(mu R) is {}, and the theory of the wedged crack is computed from {} on",
                four_digits(relative),
                four_digits(least)
            ),
            Unsolved::TooTough { relative, most, law_ends } => write!(
                f,
                "J_c/(mu R) is {}, and the theory of the wedged crack is computed up to {}{}",
                four_digits(relative),
                four_digits(most),
                if law_ends { ": this law holds no smaller crack" } else { "" }
            ),
            Unsolved::Law => write!(f, "this law has no stable equilibrium around a wedged crack"),
        }
    }
}

/// Steady penetration by a sharp needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// Radius of the shaft R [m].
    pub radius: f64,
    /// Shear modulus at rest mu [Pa].
    pub shear_modulus: f64,
    /// What resists the crack.
    pub resistance: Resistance,
    /// Half length of the slit at rest, a [m].
    pub crack_half_length: f64,
    /// Rest radius a_eq of the round hole that presses the shaft with the same normal force [m].
    pub hole_radius: f64,
    /// Strain energy per length of shaft U [J/m].
    pub strain_energy: f64,
    /// Steady force of the tip F_tip [N].
    pub tip_force: f64,
    /// What a tip spring carries where the tissue around the path is opened from the hole a_eq: the steady force then is F_tip in all,
    /// and the work of opening the hole is in the tissue, `F_tip - U_hole(a_eq, R)` [N]. It is 2 a J_c where hole and slit store the same.
    pub cutting_force: f64,
    /// Normal force of the tissue per length of shaft N [N/m].
    pub normal_force: f64,
    /// Force at which a surface gives way [N].
    pub puncture_force: f64,
    /// True where the tear stretch, not the toughness, sets the slit.
    pub torn: bool,
    /// Mean stretch of the wall of the slit that the toughness alone would make, pi R/(2 a_J); `None`: too tough for the curve.
    pub slit_stretch: Option<f64>,
}

impl Steady {
    /// What follows for a law, a shaft of `radius` [m] and a tip.
    ///
    /// # Errors
    /// [`Unsolved`], with the range that has an answer.
    pub fn new(law: &Isochoric, resistance: Resistance, radius: f64, tip: Indenter) -> Result<Self, Unsolved> {
        let mu = law.shear_modulus();
        let relative = relative_toughness(mu, resistance.toughness, radius)?;
        let tear = match resistance.tear_stretch {
            Some(stretch) if !(stretch > 1.0 && stretch.is_finite()) => return Err(Unsolved::Numbers),
            Some(stretch) => FRAC_PI_2 / stretch,
            None => 0.0,
        };
        let curve = UnitCurve::of(law)?;
        let optimum = curve.at_toughness(relative);
        let point = match optimum {
            Ok(point) if point.size >= tear => point,
            Ok(_) => curve.at_size(tear).ok_or(Unsolved::Law)?,
            // A tear may make a crack that is wide enough for the curve.
            Err(error @ Unsolved::TooTough { .. }) if tear > 0.0 => curve.at_size(tear).ok_or(error)?,
            Err(error) => return Err(error),
        };
        let torn = optimum.is_err() || optimum.is_ok_and(|best| best.size < tear);
        let unit = curve.unit_law();
        let hole = cavity::equivalent_radius(&unit, point.normal_force, 1.0).ok_or(Unsolved::Law)?;
        let tip_force = point.energy + 2.0 * point.size * relative;
        let cutting = tip_force - cavity::energy(&unit, hole, 1.0);
        let force = mu * radius * radius;
        Ok(Steady {
            radius,
            shear_modulus: mu,
            resistance,
            crack_half_length: point.size * radius,
            hole_radius: hole * radius,
            strain_energy: point.energy * force,
            tip_force: tip_force * force,
            cutting_force: cutting * force,
            normal_force: point.normal_force * mu * radius,
            puncture_force: tip.puncture_over_steady() * tip_force * force,
            torn,
            slit_stretch: optimum.ok().map(|best| FRAC_PI_2 / best.size),
        })
    }

    /// J^ = J_c/(mu R).
    pub fn relative_toughness(&self) -> f64 {
        self.resistance.toughness / (self.shear_modulus * self.radius)
    }

    /// The same slit in tissue that changes its volume: `F_tip` [N] and N [N/m], with the energy of the hole a_eq in the whole law. `None`
    /// where the law has no equilibrium.
    pub fn with_change_of_volume(&self, law: &ElasticLaw) -> Option<(f64, f64)> {
        let hole = compressible::opened_hole(law, self.hole_radius, self.radius)?;
        Some((self.cutting_force + hole.energy, hole.normal_force))
    }

    /// How tissue of this law grows around the hole a_eq. `None` where the law has no equilibrium.
    pub fn growth(&self, law: &ElasticLaw) -> Option<Growth> {
        compressible::opened_hole(law, self.hole_radius, self.radius).map(|hole| hole.growth)
    }

    /// The same as the scheme `opening` carries it: the wall of its hole is stretched [`MOST_OPENED`] times at most, so the hole is wider where
    /// more is asked. What the tissue within would hold is left to the tip, and F_tip stays.
    ///
    /// # Errors
    /// [`Unsolved::Law`] where the law has no curve.
    pub fn carried(&self, law: &Isochoric) -> Result<Steady, Unsolved> {
        if self.wall_stretch() <= MOST_OPENED {
            return Ok(*self);
        }
        let curve = UnitCurve::of(law)?;
        let held =
            cavity::energy(&curve.unit_law(), MOST_OPENED.recip(), 1.0) * self.shear_modulus * self.radius.powi(2);
        Ok(Steady { hole_radius: self.radius / MOST_OPENED, cutting_force: self.tip_force - held, ..*self })
    }

    /// Stretch of the wall of the hole, R/a_eq.
    pub fn wall_stretch(&self) -> f64 {
        self.radius / self.hole_radius
    }

    /// Force at a depth of the tip [N] with the friction coefficient `friction` on the shaft and none on the tip of `tip_length` [m]:
    /// `F_tip + mu_f N (depth - tip length)`.
    pub fn force_at(&self, depth: f64, tip_length: f64, friction: f64) -> f64 {
        self.tip_force + friction * self.normal_force * (depth - tip_length).max(0.0)
    }
}

/// The ring crack of the least force that a blunt or hollow needle cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ring {
    /// Rest radius of the core c [m].
    pub core_radius: f64,
    /// Strain energy per length of shaft [J/m].
    pub strain_energy: f64,
    /// Steady force `min_c [2 pi c J_c + U_hole(c, R)]` [N].
    pub tip_force: f64,
    /// Normal force of the tissue outside per length of shaft [N/m].
    pub normal_force: f64,
}

impl Ring {
    /// The ring for a law, a toughness J_c [J/m^2] and a shaft of `radius` [m].
    ///
    /// # Errors
    /// [`Unsolved`].
    pub fn new(law: &Isochoric, toughness: f64, radius: f64) -> Result<Self, Unsolved> {
        let mu = law.shear_modulus();
        let relative = relative_toughness(mu, toughness, radius)?;
        let unit = |i1: f64| scaled(law.jet(i1), 1.0 / mu);
        let ring = cavity::ring_crack(&unit, relative).ok_or(Unsolved::Law)?;
        let force = mu * radius * radius;
        Ok(Ring {
            core_radius: ring.core_over_r * radius,
            strain_energy: ring.energy * force,
            tip_force: ring.force * force,
            normal_force: ring.normal_force * mu * radius,
        })
    }
}

fn relative_toughness(mu: f64, toughness: f64, radius: f64) -> Result<f64, Unsolved> {
    let relative = toughness / (mu * radius);
    let positive = [mu, toughness, radius, relative].iter().all(|x| *x > 0.0 && x.is_finite());
    if positive { Ok(relative) } else { Err(Unsolved::Numbers) }
}

fn scaled(jet: EnergyJet, factor: f64) -> EnergyJet {
    EnergyJet { w: jet.w * factor, dw: jet.dw * factor, d2w: jet.d2w * factor }
}

/// The curve of a law of shear modulus one.
enum UnitCurve {
    /// Of neo-Hooke and Mooney-Rivlin, which are one law in plane strain: from the table, and beyond it the exact limit.
    NeoHooke(&'static WedgeCurve),
    Computed(Isochoric, Arc<WedgeCurve>),
}

impl UnitCurve {
    fn of(law: &Isochoric) -> Result<Self, Unsolved> {
        if matches!(law, Isochoric::NeoHookean(_) | Isochoric::MooneyRivlin(_)) {
            return Ok(UnitCurve::NeoHooke(neo_hooke_curve::curve()));
        }
        let unit = of_modulus_one(law);
        Ok(UnitCurve::Computed(unit, curve_of(&unit)?))
    }

    fn unit_law(&self) -> impl PlaneStrainLaw {
        let law = match self {
            UnitCurve::NeoHooke(_) => None,
            UnitCurve::Computed(law, _) => Some(*law),
        };
        move |i1: f64| match &law {
            None => EnergyJet { w: 0.5 * (i1 - 3.0), dw: 0.5, d2w: 0.0 },
            Some(law) => law.jet(i1),
        }
    }

    fn at_toughness(&self, relative: f64) -> Result<WedgePoint, Unsolved> {
        let curve = match self {
            UnitCurve::NeoHooke(curve) => *curve,
            UnitCurve::Computed(_, curve) => curve.as_ref(),
        };
        curve.at_toughness(relative).or_else(|out| match (out, self) {
            (OutOfCurve::AboveLargest(first), _) => Err(Unsolved::TooBrittle { relative, least: first.toughness() }),
            (OutOfCurve::BelowSmallest(_), UnitCurve::NeoHooke(_)) => Ok(deep(FRAC_PI_2 / relative)),
            (OutOfCurve::BelowSmallest(last), _) => Err(Unsolved::TooTough {
                relative,
                most: last.toughness(),
                law_ends: matches!(curve.end, CurveEnd::Failed(_)),
            }),
        })
    }

    fn at_size(&self, size: f64) -> Option<WedgePoint> {
        match self {
            UnitCurve::NeoHooke(curve) => match curve.at_size(size) {
                Ok(point) => Some(point),
                Err(OutOfCurve::BelowSmallest(_)) => Some(deep(size)),
                Err(OutOfCurve::AboveLargest(_)) => None,
            },
            UnitCurve::Computed(_, curve) => curve.at_size(size).ok(),
        }
    }
}

/// The slit of neo-Hooke of modulus one, far shorter than the needle is thick: the hole of rest radius a/2.
fn deep(size: f64) -> WedgePoint {
    let l = (2.0 / size).ln();
    WedgePoint { size, energy: PI * l, normal_force: PI * (1.0 + 2.0 * l) }
}

/// The same law with the shear modulus one. Constants are rounded to f32, so that laws which differ in their modulus alone are one key.
fn of_modulus_one(law: &Isochoric) -> Isochoric {
    let (entry, mu) = (law.law(), law.shear_modulus());
    let mut values = law.values();
    for (value, constant) in values.iter_mut().zip(entry.constants) {
        if constant.is_stress() {
            *value = f64::from((*value / mu) as f32);
        }
    }
    (entry.build)(values)
}

/// The curve of a law, computed once.
fn curve_of(law: &Isochoric) -> Result<Arc<WedgeCurve>, Unsolved> {
    type Known = Vec<(Isochoric, Result<Arc<WedgeCurve>, Unsolved>)>;
    static CURVES: Mutex<Known> = Mutex::new(Vec::new());
    // Held while it computes: who else asks for the same law waits for it.
    let mut curves = CURVES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, curve)) = curves.iter().find(|(known, _)| known == law) {
        return curve.clone();
    }
    let curve = WedgeCurve::compute(law, &WedgeOptions::default()).map(Arc::new).map_err(|_| Unsolved::Law);
    if curves.len() >= MOST_CURVES {
        curves.drain(..1);
    }
    curves.push((*law, curve.clone()));
    curve
}
