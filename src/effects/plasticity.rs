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

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::material::kinematics::{double_dot, symmetric_eigen};
use crate::material::{ElasticLaw, deviator, equivalent};
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
