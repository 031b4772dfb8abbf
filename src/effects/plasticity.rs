//! Plasticity: finite strain, von Mises yield on the Kirchhoff stress, linear isotropic hardening.
//!
//! ```text
//! F = Fe Fp,  det Fp = 1,  G = Fp^-1,  Fe = F G,  P = P_law(Fe) G^T
//! f = sqrt(3/2) |dev tau| - (sigma_y + H alpha),  tau = P F^T                       [Pa]
//! flow where f > 0:  Fe <- Fe exp(-dgamma 3/2 dev Sigma / q),  alpha += dgamma
//! ```
//! `Sigma = Fe^T P_law` (Mandel stress; its deviator has the invariants of dev tau for an isotropic law), `q` its
//! equivalent stress. The return mapping repeats the flow with a secant slope until f = 0 (cutting plane): the direction
//! follows the stress, one iteration is usual, a step that would reverse the stress is shortened, and a state that does
//! not come back is counted and reported.
//! Dissipated: `q dgamma` [J/m^3] (trapezoidal in the step). Fibres bear load past the matrix: they see F, not Fe.
//! Range of validity: metal-like flow without change of volume; sigma_y > 0, since a zero yield stress leaves no elastic
//! stage. Source: multiplicative split Lee 1969, [Lv2022] Eq. 8; return mapping Simo & Ortiz 1985.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::material::kinematics::{double_dot, symmetric_eigen};
use crate::material::regular::{LawAnswer, LawInLanes};
use crate::material::{ElasticLaw, deviator, equivalent};
use crate::number::{self, Number, Tensor, blend, product};
use crate::units::KILOPASCAL;
use crate::within::Within::{NotNegative, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "plasticity",
    kind: Kind::Constitutive,
    needs: &[],
    define: "PLASTICITY",
    summary: "permanent flow above a yield stress, linear hardening (F = Fe Fp)",
    source: "Lee 1969, Simo & Ortiz 1985; Lv2022 Eq. 8",
    cost: "48 B per cell",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `plasticity`.
    pub struct PlasticityTable;
    /// Parameters in SI units. The default is across-fibre muscle, with the law `across-fibre`: nominal yield stress 17.9 kPa at a
    /// stretch of 1.31, 25.5 kPa at 1.65; the effect damage ends it at 26.0 kPa.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "plasticity": numbers => {
        numbers.effects.plasticity.as_ref().map(|common| numbers.material.plasticity.as_ref().unwrap_or(common))
    };

    /// Yield stress, a Kirchhoff stress [kPa]; default 23.4.
    yield_stress_kpa: KILOPASCAL, Positive(1e5) =>
    /// Yield stress sigma_y, a Kirchhoff stress [Pa]; greater than 0.
    yield_stress = 23.4e3, slider("yield stress", [1.0, 200.0], "Lv2022, tension tests").logarithmic();

    /// Hardening modulus: slope of the Kirchhoff stress over the plastic strain [kPa]; default 314.
    hardening_kpa: KILOPASCAL, NotNegative(1e6) =>
    /// Hardening modulus H [Pa]; not negative.
    hardening = 314.0e3, slider("hardening modulus", [0.0, 2000.0], "Lv2022, tension tests");
}

/// State of one material point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// G - I with G = Fp^-1.
    pub inverse_flow: DMat3,
    /// Equivalent plastic strain alpha.
    pub alpha: f64,
}

impl Default for State {
    /// No flow yet: G = I. (The default of a matrix is the identity, which would be G = 2 I here.)
    fn default() -> Self {
        State { inverse_flow: DMat3::ZERO, alpha: 0.0 }
    }
}

/// What one return mapping did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flow {
    /// Growth of alpha.
    pub increment: f64,
    /// Dissipated energy per rest volume [J/m^3].
    pub dissipation: f64,
    /// True where the yield condition could not be met.
    pub failed: bool,
}

/// Iterations after which a return mapping counts as failed.
pub const ITERATIONS: usize = 60;
/// Largest plastic strain of one iteration.
pub const LARGEST_INCREMENT: f64 = 0.05;

/// He = Fe - I for H = F - I.
pub fn elastic_gradient(h: DMat3, state: &State) -> DMat3 {
    h + state.inverse_flow + h * state.inverse_flow
}

/// Deviatoric Mandel stress and its equivalent.
fn mandel(law: &ElasticLaw, he: DMat3) -> (DMat3, f64) {
    let sigma = (DMat3::IDENTITY + he).transpose() * law.isochoric_stress(he);
    let deviator = deviator((sigma + sigma.transpose()) * 0.5);
    (deviator, equivalent(deviator))
}

/// Brings the state of one point back to the yield surface.
pub fn return_mapping(law: &ElasticLaw, params: &Params, h: DMat3, state: &mut State) -> Flow {
    let mut flow = Flow::default();
    let (mut direction, mut q) = mandel(law, elastic_gradient(h, state));
    let mut f = q - (params.yield_stress + params.hardening * state.alpha);
    // Below this the stress is on the surface.
    let tolerance = 1e-11 * params.yield_stress;
    if f <= tolerance {
        return flow;
    }
    let mut slope = 3.0 * law.shear_modulus() + params.hardening;
    for _ in 0..ITERATIONS {
        let step = (f / slope).clamp(-LARGEST_INCREMENT, LARGEST_INCREMENT);
        let (n, v) = symmetric_eigen(direction * (1.5 / q));
        let exp = n.map(|n| (-step * n).exp_m1());
        let m = v * DMat3::from_diagonal(DVec3::from(exp)) * v.transpose();
        let next = State { inverse_flow: state.inverse_flow + m + state.inverse_flow * m, alpha: state.alpha + step };
        let (next_direction, next_q) = mandel(law, elastic_gradient(h, &next));
        // A step through zero stress would end on the far side of the yield surface: its stress counts as negative, the
        // slope that follows shortens the step, and the step is taken again.
        let reversed = double_dot(next_direction, direction) < 0.0;
        let signed_q = if reversed { -next_q } else { next_q };
        let next_f = signed_q - (params.yield_stress + params.hardening * next.alpha);
        let secant = (f - next_f) / step;
        if secant > 0.1 * slope {
            slope = secant;
        }
        if reversed {
            continue;
        }
        flow.increment += step;
        flow.dissipation += 0.5 * (q + next_q) * step;
        *state = next;
        (direction, q, f) = (next_direction, next_q, next_f);
        if f.abs() <= tolerance {
            return flow;
        }
    }
    flow.failed = f.is_nan() || f.abs() > 1e-6 * params.yield_stress;
    flow
}

/// The same for any [`Number`], with the tolerances that f32 allows (shaders/effects/plasticity.wgsl).
pub mod in_lanes {
    use super::*;

    /// Flow begins where the overstress is worth a thousandth of the strain at yield within these limits, and ends where it is worth a
    /// tenth of that: smaller increments would vanish in the last digits of G and alpha.
    const SMALLEST_FLOW: f64 = 1e-6;
    const WORTHWHILE_FLOW: f64 = 2e-6;
    const ITERATIONS: usize = 40;
    /// Nothing is divided by less.
    const TINY: f64 = 1e-30;

    /// Constants of the materials [Pa]; a lane without plasticity has a yield stress beyond all stresses.
    #[derive(Debug, Clone, Copy)]
    pub struct Yield<N> {
        /// sigma_y.
        pub stress: N,
        /// H.
        pub hardening: N,
        /// mu0.
        pub shear_modulus: N,
    }

    /// State, and what a step did with it.
    #[derive(Debug, Clone, Copy)]
    pub struct Flowing<N> {
        /// G - I.
        pub inverse_flow: Tensor<N>,
        /// Equivalent plastic strain.
        pub alpha: N,
        /// Dissipated in this step [J/m^3].
        pub dissipation: N,
        /// 1 where the yield condition could not be met, else 0.
        pub failed: N,
    }

    struct Mandel<N> {
        deviator: Tensor<N>,
        equivalent: N,
    }

    /// `A + B + A B`: the product of `I + A` and `I + B`, less I. He of H and G - I.
    #[inline(always)]
    pub fn composed<N: Number>(a: &Tensor<N>, b: &Tensor<N>) -> Tensor<N> {
        let mut out = product(a, b);
        for column in 0..3 {
            for row in 0..3 {
                out[column][row] = out[column][row] + (a[column][row] + b[column][row]);
            }
        }
        out
    }

    #[inline(always)]
    fn mandel<N: Number>(he: &Tensor<N>, p: &Tensor<N>) -> Mandel<N> {
        let half = p[0][0].of(0.5);
        let mut s = *p;
        for a in 0..3 {
            for b in 0..3 {
                // (Fe^T P) by row a and column b.
                s[b][a] = he[a][0].mul_add(p[b][0], he[a][1].mul_add(p[b][1], he[a][2].mul_add(p[b][2], p[b][a])));
            }
        }
        for a in 0..3 {
            for b in 0..a {
                let mean = (s[a][b] + s[b][a]) * half;
                (s[a][b], s[b][a]) = (mean, mean);
            }
        }
        let mean = (s[0][0] + s[1][1] + s[2][2]) * half.of(1.0 / 3.0);
        for a in 0..3 {
            s[a][a] = s[a][a] - mean;
        }
        let equivalent = (half.of(1.5) * number::double_dot(&s, &s)).root();
        Mandel { deviator: s, equivalent }
    }

    /// exp(A) - I of a small symmetric A.
    #[inline(always)]
    fn exponential<N: Number>(a: &Tensor<N>) -> Tensor<N> {
        let n = a[0][0];
        let second = product(a, a);
        let (third, fourth) = (product(&second, a), product(&second, &second));
        let mut out = *a;
        for i in 0..3 {
            for j in 0..3 {
                let high = n.of(1.0 / 24.0).mul_add(fourth[i][j], n.of(1.0 / 6.0) * third[i][j]);
                out[i][j] = a[i][j] + n.of(0.5).mul_add(second[i][j], high);
            }
        }
        out
    }

    /// Answer of the law to Fe with `P = P_law G^T`; with `advances`, flow until the yield condition holds. `None` where a lane has left the
    /// range of the law: then nothing has changed.
    #[inline(always)]
    pub fn return_mapping<N: Number>(
        law: &LawInLanes<N>,
        by: &Yield<N>,
        h: &Tensor<N>,
        state: &mut Flowing<N>,
        advances: bool,
    ) -> Option<LawAnswer<N>> {
        let n = h[0][0];
        let (zero, one, half) = (n.of(0.0), n.of(1.0), n.of(0.5));
        let mut g = state.inverse_flow;
        let mut alpha = state.alpha;
        let mut he = composed(h, &g);
        let mut answer = law.answer(&he)?;
        let mut now = mandel(&he, &answer.stress);
        let mut over = now.equivalent - by.hardening.mul_add(alpha, by.stress);
        let mut slope = n.of(3.0).mul_add(by.shear_modulus, by.hardening);
        let threshold = (n.of(1e-3) * by.stress).larger(n.of(SMALLEST_FLOW) * slope);
        let threshold = threshold.smaller(n.of(WORTHWHILE_FLOW) * slope);
        let tolerance = n.of(0.1) * threshold;
        let mut going = over.choose(threshold, zero, one);
        let mut dissipation = zero;
        let flows = advances && !going.is_within(0.0, 0.0);
        if flows {
            let largest = n.of(LARGEST_INCREMENT);
            for _ in 0..ITERATIONS {
                let wanted = over.over(slope.larger(n.of(TINY))).smaller(largest).larger(zero - largest);
                let step = blend(going, zero, wanted);
                let by_deviator = (n.of(-1.5) * step).over(now.equivalent.larger(n.of(TINY)));
                let mut m = now.deviator;
                for a in 0..3 {
                    for b in 0..3 {
                        m[a][b] = m[a][b] * by_deviator;
                    }
                }
                let mut next_g = composed(&g, &exponential(&m));
                // det G = 1.
                let third = number::jacobian_less_one(&next_g) * n.of(1.0 / 3.0);
                for a in 0..3 {
                    for b in 0..3 {
                        next_g[a][b] = next_g[a][b] - third * next_g[a][b];
                    }
                    next_g[a][a] = next_g[a][a] - third;
                }
                let next_he = composed(h, &next_g);
                let next = mandel(&next_he, &law.answer(&next_he)?.stress);
                // A step through zero stress would end on the far side of the yield surface: its stress counts as negative, the slope that
                // follows shortens the step, and the step is taken again.
                let reversed = number::double_dot(&next.deviator, &now.deviator).choose(zero, one, zero);
                let signed = blend(reversed, next.equivalent, zero - next.equivalent);
                let left = signed - by.hardening.mul_add(alpha + step, by.stress);
                let secant = (over - left).over(blend(going, one, step));
                let steeper = secant.choose(n.of(0.1) * slope, slope, secant);
                slope = blend(going, slope, steeper);
                let taken = blend(reversed, going, zero);
                for a in 0..3 {
                    for b in 0..3 {
                        g[a][b] = blend(taken, g[a][b], next_g[a][b]);
                        he[a][b] = blend(taken, he[a][b], next_he[a][b]);
                        now.deviator[a][b] = blend(taken, now.deviator[a][b], next.deviator[a][b]);
                    }
                }
                alpha = alpha + blend(taken, zero, step);
                dissipation = dissipation + blend(taken, zero, half * (now.equivalent + next.equivalent) * step);
                now.equivalent = blend(taken, now.equivalent, next.equivalent);
                over = blend(taken, over, left);
                let met = left.size().choose(tolerance, one, zero);
                going = blend(taken, going, blend(met, going, zero));
                if going.is_within(0.0, 0.0) {
                    break;
                }
            }
            answer = law.answer(&he)?;
            *state = Flowing { inverse_flow: g, alpha, dissipation, failed: going };
        }
        // P_law (I + G)^T.
        let mut p = answer.stress;
        for b in 0..3 {
            for a in 0..3 {
                let turned = answer.stress[0][a].mul_add(g[0][b], answer.stress[1][a] * g[1][b]);
                p[b][a] = p[b][a] + answer.stress[2][a].mul_add(g[2][b], turned);
            }
        }
        answer.stress = p;
        Some(answer)
    }
}
