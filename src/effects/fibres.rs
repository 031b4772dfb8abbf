//! Fibres: one family, exponential in the isochoric square of the fibre stretch, in tension only.
//!
//! ```text
//! W_f = k1/(2 k2) (exp(k2 <e>^2) - 1),  e = I4bar - 1,  I4bar = a(J) |F n|^2        [J/m^3]
//! P_f = k1 <e> exp(k2 <e>^2) (2 a F n (x) n + a' |F n|^2 cof F)                      [Pa]
//! ```
//! `n`: unit vector along the fibres at rest; `<x> = max(x, 0)`; `a = J^(-2/3)` as in `src/material/mod.rs`. Beyond
//! `k2 e^2 = 10` the exponential continues as its second-order Taylor polynomial. Stiffness along the fibres at rest
//! grows from 0: 4 k1 is the slope of W_f' at the onset. Source: Holzapfel, Gasser & Ogden 2000 with one family.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use glam::{DMat3, DVec3};

use super::parameter::{Parameter, Value};
use super::parameters::parameters;
use super::{Effect, Kind};
use crate::material::demiray::{LARGEST_EXPONENT, capped_exponential};
use crate::material::kinematics::{cofactor, isochoric_factor, jacobian_minus_one};
use crate::material::regular::{Regular, dot};
use crate::number::{Number, Tensor};
use crate::units::{KILOPASCAL, ONE};
use crate::within::Within::{NotNegative, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "fibres",
    kind: Kind::Constitutive,
    needs: &[],
    define: "FIBRES",
    summary: "one family of fibres that stiffen exponentially in tension",
    source: "Holzapfel2000",
    cost: "no state; about 40 operations per cell",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `fibres`.
    pub struct FibresTable;
    /// Parameters in SI units. With the default, the law `across-fibre` and the defaults of plasticity and damage, a cell of 1 mm that
    /// is pulled along the fibres carries at most 85.0 kPa (nominal, at a stretch of 1.72), across them 26.0 kPa (at 1.68).
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "fibres": numbers => {
        numbers.effects.fibres.as_ref().map(|common| numbers.material.fibres.as_ref().unwrap_or(common))
    };

    /// Direction of the fibres at rest, any length; default [1, 0, 0].
    key direction: Option<[f64; 3]>;
    /// Unit vector along the fibres at rest, n.
    field direction: DVec3 = DVec3::X;
    slider Parameter::new("fibres.direction", "direction x, y, z", "-", [-1.0, 1.0], "anatomy", |_| None)
        .holding(Value::List(|numbers| present(numbers).map(|p| p.direction.to_array().to_vec()), None));

    /// Stiffness k1 [kPa]; default 8.78; 0: no fibres in this material.
    k1_kpa: KILOPASCAL, NotNegative(1e5) =>
    /// Stiffness k1 [Pa].
    k1 = 8.78e3, slider("stiffness k1", [0.0, 200.0], "Lv2022, tension tests");

    /// Exponent k2; default 0.05.
    k2: ONE, Positive(1e3) =>
    /// Exponent k2 (dimensionless), greater than 0.
    k2 = 0.05, slider("exponent k2", [0.001, 10.0], "Lv2022, tension tests").logarithmic();
}

impl Params {
    /// `<I4bar - 1>`, a, a' and |F n|^2.
    fn strain(&self, h: DMat3) -> (f64, f64, f64, f64) {
        let stretched = self.direction + h * self.direction;
        let square = stretched.length_squared();
        let (a, da) = isochoric_factor(1.0 + jacobian_minus_one(h), -2.0 / 3.0);
        ((a * square - 1.0).max(0.0), a, da, square)
    }

    /// True where the exponential is continued as a polynomial.
    pub fn is_capped(&self, h: DMat3) -> bool {
        self.k2 * self.strain(h).0.powi(2) > LARGEST_EXPONENT
    }

    /// W_f for H = F - I [J/m^3].
    pub fn energy_density(&self, h: DMat3) -> f64 {
        let (e, ..) = self.strain(h);
        0.5 * self.k1 / self.k2 * capped_exponential(self.k2 * e * e).0
    }

    /// P_f for H = F - I [Pa].
    pub fn first_piola_kirchhoff(&self, h: DMat3) -> DMat3 {
        let (e, a, da, square) = self.strain(h);
        let slope = self.k1 * e * capped_exponential(self.k2 * e * e).1;
        let f = DMat3::IDENTITY + h;
        let n = self.direction;
        let fn_ = f * n;
        let along = DMat3::from_cols(fn_ * n.x, fn_ * n.y, fn_ * n.z);
        (along * (2.0 * a) + cofactor(f) * (da * square)) * slope
    }

    /// Bound of the tangent modulus [Pa]: `4 a^2 |F n|^2 d^2W/de^2 + 2 a dW/de`.
    pub fn tangent_bound(&self, h: DMat3) -> f64 {
        let (e, a, _, square) = self.strain(h);
        let (_, first, second) = capped_exponential(self.k2 * e * e);
        let curvature = self.k1 * (first + 2.0 * self.k2 * e * e * second);
        4.0 * a * a * square * curvature + 2.0 * a * self.k1 * e * first
    }
}

/// Constants per lane, for any [`Number`]; a lane without fibres has k1 = 0 and k2 > 0.
#[derive(Debug, Clone, Copy)]
pub struct FibresInLanes<N> {
    /// Unit vector along the fibres at rest.
    pub direction: [N; 3],
    /// Stiffness [Pa].
    pub k1: N,
    /// Exponent.
    pub k2: N,
}

impl<N: Number> FibresInLanes<N> {
    /// Adds P_f to a stress; the bound of the tangent modulus [Pa] and W_f [J/m^3]. `None` where a lane has left the exponential for its
    /// polynomial.
    #[inline(always)]
    pub fn add(&self, state: &Regular<N>, cof: &Tensor<N>, p: &mut Tensor<N>) -> Option<[N; 2]> {
        let n = state.dj;
        let (zero, one, two) = (n.of(0.0), n.of(1.0), n.of(2.0));
        let (h, _) = state.strain();
        let along = self.direction;
        let mut longer = [zero; 3];
        let mut stretched = [zero; 3];
        for row in 0..3 {
            longer[row] = h[0][row].mul_add(along[0], h[1][row].mul_add(along[1], h[2][row] * along[2]));
            stretched[row] = along[row] + longer[row];
        }
        let root = state.root();
        let a = root * root;
        let square = dot(stretched, stretched);
        // a |F n|^2 - 1 without cancellation: a = 1/r^2 with r = J^(1/3), and r - 1 of r^3 - 1.
        let r = (state.dj + one) * a;
        let less = state.dj.over(r.mul_add(r, r) + one);
        let square_1 = two.mul_add(dot(along, longer), dot(longer, longer));
        let e = a.mul_add(square_1, zero - less * (r + one) * a).larger(zero);
        let x = self.k2 * e * e;
        if !x.is_within(0.0, LARGEST_EXPONENT) {
            return None;
        }
        let minus_one = x.exponential();
        let exp = minus_one + one;
        let slope = self.k1 * e * exp;
        let by_along = two * a * slope;
        let by_cof = n.of(-2.0 / 3.0) * a * a * root * square * slope;
        for column in 0..3 {
            for row in 0..3 {
                let added = cof[column][row].mul_add(by_cof, by_along * stretched[row] * along[column]);
                p[column][row] = p[column][row] + added;
            }
        }
        let curvature = self.k1 * exp * two.mul_add(x, one);
        let tangent = n.of(4.0) * a * a * square * curvature + by_along;
        Some([tangent, n.of(0.5) * self.k1.over(self.k2) * minus_one])
    }
}
