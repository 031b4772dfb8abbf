//! Round hole of rest radius `a` opened to radius `R` in an infinite incompressible medium in plane strain, and the ring crack that a
//! blunt or hollow needle cuts (Shergold and Fleck 2004). Lengths in any unit, stresses in the unit of the law.
//!
//! Conservation of area: `r^2 = X^2 + R^2 - a^2`, stretch `lambda = r / X`. With `t = ln lambda` the integrals below are smooth at rest.

use super::law::PlaneStrainLaw;
use super::quadrature::integrate;
use std::f64::consts::PI;

/// Largest ln(R/a) that the solvers look at.
const LOG_STRETCH_MAX: f64 = 12.0;
/// Halvings of the bracket in the solvers.
const BISECTIONS: usize = 200;

fn invariant(t: f64) -> f64 {
    let s = t.sinh();
    3.0 + 4.0 * s * s
}

/// Pressure that opens a round hole by the factor `stretch = R/a >= 1`, `p = int 2 w'(I) (lambda^2 + 1)/lambda^3 d lambda` from 1 to R/a.
pub fn pressure(law: &dyn PlaneStrainLaw, stretch: f64) -> f64 {
    integrate(&|t| 2.0 * law.jet(invariant(t)).dw * (1.0 + (-2.0 * t).exp()), 0.0, stretch.ln())
}

/// Strain energy per unit length of the hole opened from `a` to `r >= a`, `U = 2 pi (R^2 - a^2) int w/(I-3) d ln lambda`.
pub fn energy(law: &dyn PlaneStrainLaw, a: f64, r: f64) -> f64 {
    let ratio = |t: f64| {
        let s = invariant(t) - 3.0;
        // w/(I-3) is 0/0 at rest
        if s < 1e-12 { law.jet(3.0).dw } else { law.jet(3.0 + s).w / s }
    };
    2.0 * PI * (r * r - a * a) * integrate(&ratio, 0.0, (r / a).ln())
}

/// Total normal force on unit length of the shaft, `N = dU/dR = 2 pi R p`.
pub fn normal_force(law: &dyn PlaneStrainLaw, a: f64, r: f64) -> f64 {
    2.0 * PI * r * pressure(law, r / a)
}

/// The root of the increasing function `g` of ln(R/a) by bisection; `None` if there is none up to `LOG_STRETCH_MAX`.
/// Not finite counts as too large (a law with a limiting stretch).
fn solve_increasing(g: &dyn Fn(f64) -> f64) -> Option<f64> {
    let above = |t: f64| {
        let v = g(t);
        !v.is_finite() || v > 0.0
    };
    let (mut lo, mut hi) = (0.0, 0.25);
    while !above(hi) {
        lo = hi;
        hi *= 2.0;
        if lo >= LOG_STRETCH_MAX {
            return None;
        }
    }
    for _ in 0..BISECTIONS {
        let mid = 0.5 * (lo + hi);
        if mid <= lo || mid >= hi {
            break;
        }
        if above(mid) {
            hi = mid;
        } else {
            lo = mid;
        }
    }
    // the lower end: finite for every law
    Some(lo)
}

/// Rest radius of the round hole that presses a shaft of radius `r` with the total normal force `normal` [force/length]: `N_hole(a, R) = N`.
/// `None` if `normal` is negative or out of reach (R/a above e^12).
pub fn equivalent_radius(law: &dyn PlaneStrainLaw, normal: f64, r: f64) -> Option<f64> {
    if !(normal >= 0.0 && normal.is_finite() && r > 0.0) {
        return None;
    }
    solve_increasing(&|t| 2.0 * PI * r * pressure(law, t.exp()) - normal).map(|t| r * (-t).exp())
}

/// The ring crack of the least force.
#[derive(Clone, Copy, Debug)]
pub struct RingCrack {
    /// Rest radius `c` of the core, in units of R.
    pub core_over_r: f64,
    /// Strain energy per unit length `U_hole(c, R)` / R^2 [stress].
    pub energy: f64,
    /// Force `min_c [2 pi c J + U_hole(c, R)]` / R^2 [stress].
    pub force: f64,
    /// Normal force `N` / R [stress].
    pub normal_force: f64,
}

/// Ring crack of a blunt or hollow needle: `min_c [2 pi c J_c + U_hole(c, R)]` with `toughness` = J_c / R [stress].
/// At the optimum `2 pi c J_c = R N - 2 U` (homogeneity of degree two), solved by bisection. `None` if out of reach.
pub fn ring_crack(law: &dyn PlaneStrainLaw, toughness: f64) -> Option<RingCrack> {
    if !(toughness > 0.0 && toughness.is_finite()) {
        return None;
    }
    let release = |t: f64| {
        let x = (-t).exp();
        (normal_force(law, x, 1.0) - 2.0 * energy(law, x, 1.0)) / (2.0 * PI * x)
    };
    let x = solve_increasing(&|t| release(t) - toughness).map(|t| (-t).exp())?;
    let u = energy(law, x, 1.0);
    Some(RingCrack {
        core_over_r: x,
        energy: u,
        force: u + 2.0 * PI * x * toughness,
        normal_force: normal_force(law, x, 1.0),
    })
}
