//! Puncture: the tip law and the swept path.
//!
//! Tip. `N = 19` material lines parallel to the path (one on the axis, 6 at R/2, 12 at R) carry a spring each between the
//! tip plane and the material point `x_k(a)` at the tip's material coordinate `a` [m]:
//! ```text
//! g_k = max(0, (p_tip - x_k(a)).t),  F = k_tip/N sum g_k                                  [m], [N]
//! F_c(a) = (F_cut + (F_pun - F_cut) max(0, 1 - (a - a_0)/l_p)) (max(v, v_0)/v_0)^n
//! where F > F_c:  a += min((F - F_c) / (p k_tip lambda), cap),  lambda = <dx_k/da . t> in 0.2..3
//! p: part of the springs with g_k > 0
//! dissipated: sum k_tip/N g_k (loss of g_k)                                               [J]
//! ```
//! `a_0`: where the tip entered the material that it is in. `cap`: 5 um in the first step, 22 um later (at least 5/4 of
//! the needle's travel), and four times the needle's travel. `a` never decreases. Springs end where the material ends: from `a_exit`, the bottom of the block, no
//! anchor carries a force, and over the last l_p before it F_c fades linearly to nothing. `v`: speed of the needle, which in steady cutting is the rate of `a`; the exponent n is 0 by default
//! (no rate). That toughness rises with the rate of cutting, and a power law as its description: brain and gels at 0.5 to
//! 50 mm/s [Terzano2021].
//!
//! Membrane: a layer that takes the energy W to puncture beyond that of cutting through it, over the length
//! `l = min(l_p, thickness of the layer along the path)`: `F_pun = F_cut + 2 W/l`, so that `int (F_c - F_cut) da = W`. From a toughness
//! G: `W = G 2R thickness`, a slit as wide as the needle.
//!
//! Path. A cell with the volume fraction `phi` within a0 of the axis keeps `1 - ramp(a) (1 - residual^phi)` of its
//! stiffness: between softened and intact part in parallel, which is too stiff, and in series, which is too soft. The energy
//! that it loses is dissipated. A node with rest distance a0 < r0 < r_r (ring radius) that the tip has passed (rest coordinate
//! s0 < a) is pushed out towards the radius at which no volume is lost,
//! ```text
//! r_e(s) = sqrt(r0^2 + rc(s)^2) - overlap fade(s),  rc = R min(1, s/Lc),  depth = r_e - r
//! normal = (e - m d)/sqrt(1 + m^2),  m = d r_e/ds,  f = k depth - 2 zeta sqrt(k m_node) v_n, never tensile
//! k = factor (K + 4/3 mu)/l^2 V w(r0),  w = S((r0 - a0)/a0) (1 - S((r0 - 3/4 r_r)/(r_r/4))),  S(x) = x^2 (3 - 2x)
//! ```
//! with the rest volume V of the node and l = 0.6 mm: the nodes are the integration points of a pressure over the ring, and
//! the smooth weight w makes the sum nearly independent of where they lie.
//! `s`: distance behind the tip, `d`: from tip to hub, `e`: radial. An overlap found when the tip passes fades over
//! `entry_fade` of travel, so that the needle does that work. A motion that leaves one straight line has a free path
//! (src/needle/free_path.rs). Source: this project; F_cut = G_c w with the toughness of liver under needles, 76 to 185 J/m^2 [Azar2008],
//! 164 J/m^2 [Gokgol2012].

use glam::DVec3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::parameter::Parameter;
use super::parameters::parameters;
use super::{Effect, Kind, Numbers};
use crate::needle::free_path::{SLACK, SLIP_CAP};
use crate::penetration::Steady;
use crate::units::{MILLIMETRE, MILLIMETRE_PER_SECOND, NEWTON, NEWTON_PER_MILLIMETRE, OF_CRITICAL, ONE};
use crate::within::Within::{Between, NotNegative, Positive};

/// Advance of the tip in its first step, and the largest one of a step beside what the needle travels [m]. The second is
/// as fast as the needle's speed times four with steps of 2.7 ms at 2 mm/s: with 13 um steps beyond 1.6 ms held the
/// puncture back (by 14 % of the peak force at 2.4 ms).
pub const FIRST_ADVANCE: f64 = 5e-6;
/// The most that it may advance in a step [m].
pub const LARGEST_ADVANCE: f64 = 22e-6;

/// The same in ways that the needle travels in the step: the tip may always go the first, and never more than the second.
pub const LEAST_TRAVELS: f64 = 1.25;
/// See [`LEAST_TRAVELS`].
pub const MOST_TRAVELS: f64 = 4.0;

/// Bounds of lambda, the stretch of the material lines at the tip: a tip in squeezed or torn cells neither leaps nor stands.
pub const LEAST_STRETCH: f64 = 0.2;
/// See [`LEAST_STRETCH`].
pub const MOST_STRETCH: f64 = 3.0;

/// J_c, below which single tetrahedra have a pressure of their own (src/engine/elements.rs) in a scene with a needle. Where averaging alone is
/// at work J swings down to 0.81 in tissue compressed by 30 %; under a tip, whose springs pull at single nodes, it fell to 0.09 in cells of a
/// third of the needle's diameter with the 0.3 of other scenes, and finer cells turned inside out.
pub const FLAT_UNDER_NEEDLE: f64 = 0.75;

/// The core of a hollow needle tears off at its base where the tip has gone back from it by so much, in radii of the bore: the neck of the
/// core, about a radius long, is then stretched by half, about what muscle bears. A choice of this project. A trembling hand goes back by
/// less; where any way back counted, a hand that trembled above the skin had torn a core off before it touched.
pub const CORE_TEARS: f64 = 0.5;

/// What the shaders have of this file.
pub const SHADER_CONSTANTS: [(&str, f64); 8] = [
    ("CORE_TEARS", CORE_TEARS),
    ("FIRST_ADVANCE", FIRST_ADVANCE),
    ("LARGEST_ADVANCE", LARGEST_ADVANCE),
    ("LEAST_TRAVELS", LEAST_TRAVELS),
    ("MOST_TRAVELS", MOST_TRAVELS),
    ("LEAST_STRETCH", LEAST_STRETCH),
    ("MOST_STRETCH", MOST_STRETCH),
    ("FLAT_UNDER_NEEDLE", FLAT_UNDER_NEEDLE),
];

/// How far the tip may advance in a step in which the needle travels `travel` [m]; `first`: it is still at the surface. At most four
/// times that way: a faster tip would leave nodes inside the needle. A stab travels more than [`LARGEST_ADVANCE`] in a step.
pub fn advance_limit(first: bool, travel: f64) -> f64 {
    let least = if first { FIRST_ADVANCE } else { LARGEST_ADVANCE };
    least.max(LEAST_TRAVELS * travel).min(MOST_TRAVELS * travel)
}

/// How far the tip advances in a step, da [m], under the force F and the threshold F_c [N]: as far as its springs are too long,
/// `(F - F_c)/(p k_tip lambda)`, at most `cap` [m]. `tip_stiffness`: p k_tip [N/m], p the part of the springs that are stretched: those
/// that are not have no force to lose. `stretch`: lambda, within its bounds. The force falls no faster than this as springs let go, so
/// that it never ends below the threshold.
pub fn tip_advance(force: f64, threshold: f64, tip_stiffness: f64, stretch: f64, cap: f64) -> f64 {
    ((force - threshold) / (tip_stiffness * stretch)).max(0.0).min(cap)
}

/// Stretch lambda of the material lines at the tip, as the tip law takes it.
pub fn bounded_stretch(stretch: f64) -> f64 {
    stretch.clamp(LEAST_STRETCH, MOST_STRETCH)
}

/// How far a tip on a free path may slip sideways or draw back in a step in which the needle travels `travel` [m]
/// (src/needle/free_path.rs).
pub fn slip_limit(travel: f64) -> f64 {
    MOST_TRAVELS * travel + SLIP_CAP
}

/// How far a tip on a free path draws back in its own track [m], `(-SLACK - <g_k>)/lambda`, at most `cap` [m]. `gap`: mean gap
/// <g_k> of the tip springs [m]; `stretch`: lambda, within its bounds.
pub fn retreat(gap: f64, stretch: f64, cap: f64) -> f64 {
    ((-SLACK - gap) / stretch).clamp(0.0, cap)
}

/// The part of the sway l [m] that is too long: the tissue holds the tip with min(F, F_c), so with `k_tip |l|` at most.
pub fn sway_beyond(sway: DVec3, force: f64, threshold: f64, tip_stiffness: f64) -> DVec3 {
    let (length, held) = (sway.length(), threshold.min(force) / tip_stiffness);
    if length > held { sway * (1.0 - held / length) } else { DVec3::ZERO }
}

/// Part of the threshold that is left at `ahead` [m] before the end of the material: over the last transition length it fades to
/// nothing, since a spring that ended at once would throw the tissue back.
pub fn left_before_exit(ahead: f64, transition_length: f64) -> f64 {
    (ahead / transition_length).clamp(0.0, 1.0)
}

impl Cutting {
    /// Threshold F_c [N] at `way` [m] behind the entry a_0 of the material: from F_pun down to F_cut over the transition length
    /// l_p [m]. Without the rate ([`Params::rate_factor`]) and the end of the material ([`left_before_exit`]).
    pub fn threshold(&self, way: f64, transition_length: f64) -> f64 {
        let entry = (1.0 - way / transition_length).max(0.0);
        self.cutting_force + (self.puncture_force - self.cutting_force) * entry
    }

    /// The same material as a membrane: F_pun [N] from the energy W [J] that its puncture takes beyond that of cutting,
    /// `F_cut + 2 W/l`, over the length l [m].
    pub fn of_membrane(self, energy: f64, length: f64) -> Self {
        Cutting { puncture_force: self.cutting_force + 2.0 * energy / length, ..self }
    }
}

/// Largest puncture force over the section of the needle that tissue bears, as part of Young's modulus E: a sharp needle enters at
/// `3 pi mu R^2 (1 + ln(1.27 J_c/(mu R)))` [Shergold2004, Fregonese2021], which is `1 + ln(1.27 J_c/(mu R))` of E = 3 mu over the section.
/// The toughest and softest pair of the data, 550 J/m^2 at 6.6 kPa under a 16G needle, has J_c/(mu R) = 101 and 5.9; 7 belongs to 316.
pub const MOST_PRESSURE_OVER_YOUNG: f64 = 7.0;

/// The same as part of the bulk modulus K: `K/2 (J - 1)^2` bears no pressure beyond K, and the dimple before the puncture spreads the
/// force over about three sections.
pub const MOST_PRESSURE_OVER_BULK: f64 = 3.0;

/// Part of the tip force that is above the threshold, where the cap on the advance holds it there: that part of what the tip
/// dissipates is no property of the tissue and has a name of its own in the account.
pub fn share_beyond(force: f64, threshold: f64) -> f64 {
    if force > threshold { 1.0 - threshold / force } else { 0.0 }
}

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "puncture",
    kind: Kind::Contact,
    needs: &[],
    define: "PUNCTURE",
    summary: "tip law (puncture, cutting) and contact with the opened path of the needle",
    source: "this project (docs/effects/puncture.md); toughness: Gokgol2012, Azar2008",
    cost: "three dispatches per step; 4 B per cell; 160 B per node near the path",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `puncture`.
    pub struct PunctureTable;
    /// Parameters in SI units. Those marked [calibration] set the force as much as the tissue does; they are the
    /// same in every scene that compares materials.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "puncture": numbers => numbers.effects.puncture.as_ref();

    /// Tip force at which the surface gives way [N] (calibration).
    puncture_force_n: NEWTON, Positive(100.0) =>
    /// Tip force at which the surface gives way, F_pun [N] [calibration].
    puncture_force = 0.6;
    slider Parameter::new(
        "puncture.puncture_force_n",
        "force at which a surface gives way",
        "N",
        [0.01, 5.0],
        "calibration with Lv2022",
        |numbers| of_the_scene(numbers).map(|p| p.puncture_force),
    )
    .logarithmic();

    /// Tip force of steady cutting [N] (calibration).
    cutting_force_n: NEWTON, Positive(100.0) =>
    /// Tip force of steady cutting, F_cut = G_c w [N] [calibration].
    cutting_force = 0.3;
    slider Parameter::new(
        "puncture.cutting_force_n",
        "force of steady cutting",
        "N",
        [0.01, 5.0],
        "calibration with Lv2022",
        |numbers| of_the_scene(numbers).map(|p| p.cutting_force),
    )
    .logarithmic();
    slider Parameter::new(
        "material.puncture_force_n",
        "force at which this material gives way",
        "N",
        [0.01, 5.0],
        "preset of the material",
        |numbers| present(numbers).and(numbers.material.cutting).map(|c| c.puncture_force),
    )
    .logarithmic();
    slider Parameter::new(
        "material.cutting_force_n",
        "force of steady cutting in this material",
        "N",
        [0.01, 5.0],
        "preset of the material",
        |numbers| present(numbers).and(numbers.material.cutting).map(|c| c.cutting_force),
    )
    .logarithmic();

    /// Length over which the threshold falls from the puncture to the cutting force [mm].
    transition_length_mm: MILLIMETRE, Positive(100.0) =>
    /// Length over which the threshold falls from F_pun to F_cut, l_p [m].
    transition_length = 0.5e-3,
    slider("travel from puncture to cutting", [0.05, 5.0], "calibration with Lv2022").logarithmic();

    /// Stiffness of all tip springs together [N/mm].
    tip_stiffness_n_mm: NEWTON_PER_MILLIMETRE, Positive(1e4) =>
    /// Stiffness of all tip springs together, k_tip [N/m].
    tip_stiffness = 2.0e3,
    slider("stiffness of the tip springs", [0.2, 20.0], "as stiff as the tissue around the tip").logarithmic();

    /// Radius of the softened path [mm] (calibration).
    softened_radius_mm: MILLIMETRE, Positive(100.0) =>
    /// Radius of the softened path, a0 [m] [calibration].
    softened_radius = 0.55e-3, slider("radius of the softened path", [0.1, 1.5], "calibration with Lv2022");

    /// Elastic stiffness left in a fully softened cell, 0 to 1.
    residual_stiffness: ONE, Between(1e-4, 1.0) =>
    /// Elastic stiffness left in a fully softened cell (fraction).
    residual_stiffness = 0.02,
    slider("stiffness left on the path", [0.001, 1.0], "keeps the cells of the path in shape").logarithmic();

    /// Outer radius of the ring of nodes that the shaft pushes [mm] (calibration); larger than `softened_radius_mm`.
    ring_radius_mm: MILLIMETRE, Positive(100.0) =>
    /// Outer radius r_r of the ring of nodes that the shaft pushes [m] [calibration].
    ring_radius = 2.0e-3, slider("radius of the ring that is pushed", [1.0, 4.0], "calibration with Lv2022");

    /// Factor of the contact stiffness (calibration): of (K + 4/3 mu)/l^2 per volume of the ring around the path, of
    /// (K + 4/3 mu) l^2/h per node of a separated face, l = 0.6 mm.
    contact_stiffness_factor: ONE, Positive(100.0) =>
    /// Contact stiffness factor: factor (K + 4/3 mu)/l^2 per volume of the ring, factor (K + 4/3 mu) l^2/h per node of a
    /// separated face, factor (K + 4/3 mu)/h per area of a slit, l = 0.6 mm [calibration].
    contact_stiffness_factor = 2.35, slider("contact stiffness", [0.05, 5.0], "calibration with Lv2022").logarithmic();

    /// Fraction of critical damping in the contact normal, 0 to 1.
    contact_damping: OF_CRITICAL, NotNegative(1.0) =>
    /// Fraction of critical damping in the contact normal.
    contact_damping = 0.2, slider("contact damping", [0.0, 1.0], "numerical");

    /// Travel over which an overlap found at activation fades out [mm].
    entry_fade_mm: MILLIMETRE, Positive(100.0) =>
    /// Travel over which an overlap found at activation fades out [m].
    entry_fade = 2.0e-3, slider("fade of an overlap", [0.05, 5.0], "numerical").logarithmic();

    /// "auto" (default): planned before the run for a straight motion, else free; "free": always found while the tip moves.
    key path: Option<PathWord>;
    /// Find the path while the tip moves even where it could be planned.
    field always_free: bool = false;
    /// The free path may lead anywhere in the block: a hand holds the needle.
    field anywhere: bool = false;

    /// "opening": the tissue beside the path is carried exactly, and forces follow from toughness and elastic constants; "ring": nodes around
    /// a softened path are pushed aside, with calibrated numbers. Default: "opening", unless the scene writes forces or numbers of the ring,
    /// lacks a toughness, or asks for what "opening" does not carry yet.
    key scheme: Option<SchemeWord>;
    /// How the tissue beside the path is carried.
    field scheme: SchemeWord = SchemeWord::Ring;
    /// The scene states a puncture force: calibrated, where the scheme `opening` would find its own.
    field puncture_stated: bool = false;
    /// The scene states a cutting force.
    field cutting_stated: bool = false;

    /// Exponent of the speed of the needle in the tip forces, 0 to 1; default 0: no rate.
    rate_exponent: ONE, NotNegative(1.0) =>
    /// Exponent n of the rate of cutting in the tip forces; 0: no rate.
    rate_exponent = 0.0, slider("exponent of the speed", [0.0, 1.0], "Terzano2021");

    /// Speed up to which the tip forces are the written ones [mm/s]; default 1.
    reference_speed_mm_s: MILLIMETRE_PER_SECOND, Between(1e-3, 1e3) =>
    /// Speed v_0 up to which the tip forces are those above [m/s].
    reference_speed = 1.0e-3, slider("speed of the written forces", [0.1, 100.0], "Terzano2021").logarithmic();
}

/// The scene's parameters where its tip forces are those of the tissue's own material.
fn of_the_scene<'a>(numbers: &Numbers<'a>) -> Option<&'a Params> {
    present(numbers).filter(|_| numbers.material.cutting.is_none())
}

/// How the path of the needle is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
// Texts of the words would split their list in the schema.
#[allow(missing_docs)]
pub enum PathWord {
    Auto,
    Free,
}

/// How the tissue beside the path of the needle is carried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
// As above.
#[allow(missing_docs)]
pub enum SchemeWord {
    Ring,
    Opening,
}

/// Tip forces of one material [N].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cutting {
    /// Force at which the tip enters the material, F_pun.
    pub puncture_force: f64,
    /// Force of steady cutting, F_cut = G_c w.
    pub cutting_force: f64,
}

/// Smooth step from 0 at x <= 0 to 1 at x >= 1.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl Params {
    /// Weight w of a node of the ring with the rest distance `r0` [m] from the path, 0 to 1.
    pub fn ring_weight(&self, r0: f64) -> f64 {
        let (inner, outer) = (self.softened_radius, self.ring_radius);
        smooth_step((r0 - inner) / inner) * (1.0 - smooth_step((r0 - 0.75 * outer) / (0.25 * outer)))
    }

    /// Tip forces of a material in the scheme `opening`, where `own` are those that it states: what nobody states follows from its
    /// toughness.
    pub fn opening_cutting(&self, own: Option<Cutting>, steady: &Steady) -> Cutting {
        own.unwrap_or(Cutting {
            puncture_force: if self.puncture_stated { self.puncture_force } else { steady.puncture_force },
            cutting_force: if self.cutting_stated { self.cutting_force } else { steady.cutting_force },
        })
    }

    /// Part of its stiffness that a cell with the fraction `inside` of its volume within a0 of the path keeps.
    pub fn stiffness_left(&self, inside: f64) -> f64 {
        self.residual_stiffness.powf(inside)
    }

    /// Factor on the tip forces at a speed of the needle [m/s].
    pub fn rate_factor(&self, speed: f64) -> f64 {
        (speed.max(self.reference_speed) / self.reference_speed).powf(self.rate_exponent)
    }
}
