//! Viscoelasticity: a Prony series on the isochoric stress.
//!
//! ```text
//! P = P_elastic - F sum_i q_i,   tau_i dq_i/dt = g_i S_iso - q_i                      [Pa]
//! q_i(t + n dt/2) = e^-x q_i(t - n dt/2) + (1 - e^-x) g_i S_iso(t),   x = n dt/tau_i
//! ```
//! `S_iso = F^-1 P_iso` of matrix and fibres is the instantaneous second Piola-Kirchhoff stress; at rest for long, the share
//! `1 - sum g_i` of it is left. The form is the convolution of Simo 1987 (`h_i = g_i S - q_i`); the midpoint rule is
//! of second order and needs no stress of the step before. A term is updated every n steps, a power of two with
//! `n dt <= tau_i/500`: in f32 the increments of a slow term would vanish otherwise. The stress at t takes the newest q_i,
//! which is off by half an update at most: tau_i/1000, or dt/2 where n = 1. `tau_i` are physical seconds: mass scaling
//! changes inertia, not time. Source: Simo 1987; [Taylor1970].
//!
//! Energy. With `E` the Green-Lagrange strain the viscous part of the work is `-q:E + sum E:dq` per volume; of this
//! `Xi = sum q_i:q_i/(4 mu0 g_i)` is stored and the rest, `sum E:dq - Xi`, dissipated.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::parameter::{Parameter, Value};
use super::{Effect, Kind, Numbers};
use crate::material::regular::Regular;
use crate::number::{Number, Tensor};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "viscoelastic",
    kind: Kind::Constitutive,
    needs: &[],
    define: "VISCOELASTIC",
    summary: "stress that relaxes with time: Prony series on the isochoric stress",
    source: "Simo1987, Taylor1970",
    cost: "32 B per cell and 32 B per cell and term",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 2] = [
    Parameter::new(
        "viscoelastic.g",
        "share of the stress that relaxes",
        "-",
        [0.001, 0.9],
        "assumption; total of 50 %: Van Loocke 2008",
        |_| None,
    )
    .holding(Value::List(shares, Some(("viscoelastic.tau_s", times)))),
    Parameter::new(
        "viscoelastic.tau_s",
        "relaxation time",
        "s",
        [0.001, 1000.0],
        "assumption; total of 50 %: Van Loocke 2008",
        |_| None,
    )
    .holding(Value::List(times, Some(("viscoelastic.g", shares))))
    .logarithmic(),
];

/// The series of the tissue's own material.
fn series<'a>(numbers: &Numbers<'a>) -> Option<&'a Params> {
    let common = numbers.effects.viscoelastic.as_ref()?;
    Some(numbers.material.viscoelastic.as_ref().unwrap_or(common))
}

fn shares(numbers: &Numbers) -> Option<Vec<f64>> {
    Some(series(numbers)?.terms.iter().map(|term| term.ratio).collect())
}

fn times(numbers: &Numbers) -> Option<Vec<f64>> {
    Some(series(numbers)?.terms.iter().map(|term| term.time).collect())
}

/// Most terms of a series.
pub const LARGEST_TERM_COUNT: usize = 8;

/// Steps over which an update of a term may stretch, as a part of its relaxation time.
const UPDATE_PART: f64 = 1.0 / 500.0;

/// Parameters of the effect `viscoelastic`: a Prony series of 1 to 8 terms.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViscoelasticTable {
    /// Shares of the isochoric stress that relax, each above 0, sum below 1; default [0.25, 0.15, 0.10].
    pub g: Option<Vec<f64>>,
    /// Relaxation times, one per share [s]; default [0.5, 5, 60].
    pub tau_s: Option<Vec<f64>>,
}

/// One term of the series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// Share g_i of the isochoric stress, 0..1.
    pub ratio: f64,
    /// Relaxation time tau_i [s].
    pub time: f64,
}

/// Parameters in SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct Params {
    /// Prony terms of the relaxation.
    pub terms: Vec<Term>,
}

impl Default for Params {
    /// An assumption with the total of porcine muscle, 50 % (Van Loocke 2008).
    fn default() -> Self {
        let term = |ratio, time| Term { ratio, time };
        Params { terms: vec![term(0.25, 0.5), term(0.15, 5.0), term(0.10, 60.0)] }
    }
}

impl Term {
    /// Steps of `dt` [s] between two updates: a power of two.
    pub fn interval(&self, dt: f64) -> u32 {
        let steps = (self.time * UPDATE_PART / dt).clamp(1.0, 2f64.powi(20));
        1 << steps.log2().floor() as u32
    }

    /// `1 - e^-x` of one update.
    pub fn decay(&self, dt: f64) -> f64 {
        -(-f64::from(self.interval(dt)) * dt / self.time).exp_m1()
    }

    /// True where step `step` updates this term: in the middle of its interval.
    pub fn is_due(&self, step: u64, dt: f64) -> bool {
        let n = u64::from(self.interval(dt));
        step % n == n / 2
    }
}

/// How far the stress beside one section of an opened path has relaxed.
///
/// What strains the tissue there is how far the path is open: its instantaneous stress keeps its directions and grows with the radius rc of the
/// hole, since the energy is of second degree in lengths. For such a stress the series is one of numbers,
/// ```text
/// P = k P_elastic,   k = 1 - sum g_i r_i/rc,   tau_i dr_i/dt = rc - r_i
/// r_i(t + h/2) = r_i(t - h/2) + (1 - e^(-h/tau_i)) (rc(t) - r_i(t - h/2))
/// ```
/// k changes at the ends of frames, of the length h, so that the work `W dk` is known and dissipated. `r_i <= rc`: tissue that closes holds on to
/// nothing, and a path that has closed begins anew, where the series would remember it for some `tau_i`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SectionRelaxation {
    /// `r_i` [m].
    pub opened: [f64; LARGEST_TERM_COUNT],
    /// k.
    pub left: f64,
    /// Dissipated since t = 0 [J].
    pub dissipated: f64,
}

impl Default for SectionRelaxation {
    fn default() -> Self {
        SectionRelaxation { opened: [0.0; LARGEST_TERM_COUNT], left: 1.0, dissipated: 0.0 }
    }
}

impl SectionRelaxation {
    /// At the end of a frame of `time` [s]: the hole has the radius `radius` [m], and the tissue would hold `energy` [J] without relaxation.
    pub fn advance(&mut self, terms: &[Term], radius: f64, energy: f64, time: f64) {
        let mut relaxed = 0.0;
        for (opened, term) in self.opened.iter_mut().zip(terms) {
            *opened = (*opened - (-time / term.time).exp_m1() * (radius - *opened)).min(radius);
            relaxed += term.ratio * *opened;
        }
        let left = if radius > 0.0 { 1.0 - relaxed / radius } else { 1.0 };
        self.dissipated += energy * (self.left - left);
        self.left = left;
    }
}

/// A symmetric tensor for any [`Number`]: diagonal, then yz, zx, xy.
pub type Symmetric<N> = [N; 6];

/// `F^-1 P_iso` [Pa] in the range of [`Regular`].
#[inline(always)]
pub fn second_piola_kirchhoff<N: Number>(state: &Regular<N>, cof: &Tensor<N>, p: &Tensor<N>) -> Symmetric<N> {
    let n = state.dj;
    let root = state.root();
    // 1/(2 J)
    let by = n.of(0.5) * root * root * root;
    let at = |row: usize, column: usize| {
        cof[row][0].mul_add(p[column][0], cof[row][1].mul_add(p[column][1], cof[row][2] * p[column][2]))
    };
    [
        at(0, 0) * (by + by),
        at(1, 1) * (by + by),
        at(2, 2) * (by + by),
        (at(1, 2) + at(2, 1)) * by,
        (at(2, 0) + at(0, 2)) * by,
        (at(0, 1) + at(1, 0)) * by,
    ]
}

/// `q:E` of two symmetric tensors, the second as C - I = 2 E.
#[inline(always)]
pub fn held_by_strain<N: Number>(q: &Symmetric<N>, twice_e: &Symmetric<N>) -> N {
    let half = q[0].of(0.5);
    let mut normal = q[0] * twice_e[0];
    let mut shear = q[3] * twice_e[3];
    for i in 1..3 {
        normal = q[i].mul_add(twice_e[i], normal);
        shear = q[3 + i].mul_add(twice_e[3 + i], shear);
    }
    normal.mul_add(half, shear)
}

/// Takes `F q` out of a stress.
#[inline(always)]
pub fn take_out<N: Number>(q: &Symmetric<N>, h: &Tensor<N>, p: &mut Tensor<N>) {
    let [xx, yy, zz, yz, zx, xy] = *q;
    let q = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
    for column in 0..3 {
        for row in 0..3 {
            let turned = h[0][row].mul_add(
                q[column][0],
                h[1][row].mul_add(q[column][1], h[2][row].mul_add(q[column][2], q[column][row])),
            );
            p[column][row] = p[column][row] - turned;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TERMS: [Term; 2] = [Term { ratio: 0.3, time: 0.2 }, Term { ratio: 0.2, time: 3.0 }];

    /// Part that is left `time` after a step.
    fn series(time: f64) -> f64 {
        1.0 - TERMS.iter().map(|t| t.ratio * (1.0 - (-time / t.time).exp())).sum::<f64>()
    }

    #[test]
    fn a_section_that_opens_at_once_relaxes_as_the_series_whatever_the_frames() {
        for frame in [0.001, 0.01, 0.1] {
            let mut section = SectionRelaxation::default();
            let (radius, energy) = (0.8e-3, 2e-4);
            let frames = (1.0_f64 / frame).round() as u32;
            for _ in 0..frames {
                section.advance(&TERMS, radius, energy, frame);
            }
            // Of a hole that opened half of a frame before the first one ended.
            let expected = series(1.0);
            assert!((section.left - expected).abs() < 1e-12, "{} instead of {expected}", section.left);
            assert!((section.dissipated - energy * (1.0 - expected)).abs() < 1e-15);
        }
    }

    #[test]
    fn a_section_that_opens_slowly_follows_the_ramp_to_second_order() {
        let (rate, time): (f64, f64) = (0.5e-3, 1.2);
        // r = v (t - tau (1 - e^(-t/tau))) at the middle of the next frame.
        let exact = |t: f64, term: &Term| rate * (t + term.time * (-t / term.time).exp_m1());
        let mut errors = Vec::new();
        for frame in [0.02, 0.01] {
            let mut section = SectionRelaxation::default();
            for i in 1..=(time / frame).round() as u32 {
                section.advance(&TERMS, rate * frame * f64::from(i), 0.0, frame);
            }
            let expected = exact(time + 0.5 * frame, &TERMS[0]);
            errors.push((section.opened[0] / expected - 1.0).abs());
        }
        assert!(errors[0] < 2e-3 && errors[1] < 0.3 * errors[0], "{errors:?}");
    }

    #[test]
    fn a_section_that_closes_holds_on_to_nothing_and_begins_anew() {
        let mut section = SectionRelaxation::default();
        for _ in 0..100 {
            section.advance(&TERMS, 0.8e-3, 1e-4, 0.1);
        }
        assert!(section.left < 0.56);
        section.advance(&TERMS, 0.1e-3, 1e-6, 0.1);
        assert!((section.left - 0.5).abs() < 1e-12, "all of the share has relaxed: {}", section.left);
        section.advance(&TERMS, 0.0, 0.0, 0.1);
        assert_eq!((section.left, section.opened), (1.0, [0.0; LARGEST_TERM_COUNT]));
    }
}
