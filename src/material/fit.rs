//! Least-squares fit of the elastic laws to measured curves.
//!
//! Samples count as incompressible here: the nominal stresses then have the closed forms
//! ```text
//! uniaxial     P   = 2 (w1 + w2/l) (l - l^-2)           Ogden: 2 mu/alpha (l^(alpha-1) - l^(-alpha/2-1))       [Pa]
//! equibiaxial  P   = 2 (w1 + w2 l^2) (l - l^-5)                2 mu/alpha (l^(alpha-1) - l^(-2 alpha-1))
//! planar       P   = 2 (w1 + w2) (l - l^-3)                    2 mu/alpha (l^(alpha-1) - l^(-alpha-1))
//! shear        tau = 2 (w1 + w2) gamma                         2 mu/alpha (l^alpha - l^-alpha) / (l + 1/l)
//! ```
//! with the stretch l, the amount of shear gamma = l - 1/l, and w1, w2 at the invariants of that state. Sources:
//! Rivlin 1948 for the invariants, Ogden 1972 for the stretches. A simulated tissue of nu 0.49 departs from them by a few
//! per cent.
//!
//! Neo-Hookean, Mooney-Rivlin and Yeoh are linear in their constants: one orthogonal decomposition gives the exact answer, and
//! trying all sets of constants kept at zero gives the exact non-negative one. Ogden and Demiray are not: their exponent is sought
//! from fixed starts, so that equal data give equal constants. Both: [`least_squares`](super::least_squares).

use super::law::{Law, MOST_CONSTANTS, Search};
use super::least_squares::{self, Curve};
use super::{Isochoric, IsochoricLaw, LAWS, Mode, Verdict};

/// Laws are equally good, and the one with fewer constants is preferred, where the relative rms error is at most this
/// many times larger than the least one, plus a remainder. Half a per cent of an error tells nothing about a tissue.
const EQUALLY_GOOD: f64 = 1.005;
const EXACT: f64 = 1e-6;

/// One measured point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    pub mode: Mode,
    /// Stretch, in shear the amount of shear.
    pub x: f64,
    /// Nominal stress, in shear the shear stress [Pa].
    pub stress: f64,
    /// Weight of its squared error, > 0.
    pub weight: f64,
}

/// Nominal stress of an incompressible sample [Pa].
pub fn nominal_stress(law: &Isochoric, mode: Mode, x: f64) -> f64 {
    law.nominal_stress(mode, x)
}

/// A law with how well it meets the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fit {
    pub law: Isochoric,
    /// Weighted root mean square of the error [Pa].
    pub rms: f64,
    /// The same over the largest measured stress.
    pub relative: f64,
    /// Coefficient of determination.
    pub r2: f64,
    pub verdict: Verdict,
    /// True where the law is elliptic as far as the points reach.
    pub stable_within_data: bool,
}

/// The fits of one law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawFit {
    pub key: &'static str,
    /// Best constants of all; `None` where no finite ones are determined by the points.
    pub unconstrained: Option<Fit>,
    /// Best constants among those that are stable for every deformation.
    pub stable: Option<Fit>,
}

/// Fits all laws, in the order of [`LAWS`].
pub fn fit_all(points: &[Point]) -> Vec<LawFit> {
    LAWS.iter().map(|law| fit_law(law, points)).collect()
}

/// The stable fit to recommend: the smallest error, and of equally good laws the one with the fewest constants.
pub fn best_stable(fits: &[LawFit]) -> Option<&LawFit> {
    let error = |fit: &LawFit| fit.stable.map_or(f64::INFINITY, |f| f.relative);
    let least = fits.iter().map(error).fold(f64::INFINITY, f64::min);
    fits.iter()
        .filter(|fit| fit.stable.is_some() && error(fit) <= EQUALLY_GOOD * least + EXACT)
        .min_by_key(|fit| fit.stable.map_or(usize::MAX, |f| f.law.constants().len()))
}

fn fit_law(law: &Law, points: &[Point]) -> LawFit {
    let (all, stable) = match law.search {
        Search::Linear => linear(points, law),
        Search::Exponent { starts, edges } => with_exponent(points, starts, edges, law),
    };
    let best = |laws: Vec<Isochoric>, keep: &dyn Fn(&Fit) -> bool| {
        let fits = laws.iter().map(|law| judge(law, points)).filter(|fit| fit.rms.is_finite() && keep(fit));
        fits.min_by(|a, b| a.rms.total_cmp(&b.rms))
    };
    let unconstrained = best(all.clone(), &|_| true);
    let candidates = all.into_iter().chain(stable).collect();
    LawFit { key: law.key, unconstrained, stable: best(candidates, &|fit| fit.verdict == Verdict::Stable) }
}

/// Errors and verdict of a law.
pub fn judge(law: &Isochoric, points: &[Point]) -> Fit {
    let weights: f64 = points.iter().map(|p| p.weight).sum();
    let mean = points.iter().map(|p| p.weight * p.stress).sum::<f64>() / weights;
    let squares: f64 = points.iter().map(|p| p.weight * (nominal_stress(law, p.mode, p.x) - p.stress).powi(2)).sum();
    let spread: f64 = points.iter().map(|p| p.weight * (p.stress - mean).powi(2)).sum();
    let largest = points.iter().map(|p| p.stress.abs()).fold(0.0, f64::max);
    let rms = (squares / weights).sqrt();
    let verdict = law.verdict();
    let stretches = || points.iter().flat_map(|p| p.mode.principal_stretches(p.x));
    let stable_within_data = match verdict {
        Verdict::Stable => true,
        Verdict::StableBelow(limit) => stretches().all(|l| l < limit),
        Verdict::StableAbove(limit) => stretches().all(|l| l > limit),
        Verdict::Unstable => false,
    };
    Fit { law: *law, rms, relative: rms / largest, r2: 1.0 - squares / spread, verdict, stable_within_data }
}

/// Root of the weight, and stress, of every point: the right side of a least-squares problem.
fn weighted_stresses(points: &[Point]) -> Vec<f64> {
    points.iter().map(|p| p.weight.sqrt() * p.stress).collect()
}

/// Stresses of a law at the points, times the roots of their weights.
fn weighted_model(points: &[Point], law: &Isochoric) -> Vec<f64> {
    points.iter().map(|p| p.weight.sqrt() * nominal_stress(law, p.mode, p.x)).collect()
}

/// A law that is linear in its constants: the exact answer, and the best ones without negative constants.
fn linear(points: &[Point], law: &Law) -> (Vec<Isochoric>, Vec<Isochoric>) {
    let count = law.constants.len();
    let unit = |k: usize| {
        let mut constants = [0.0; MOST_CONSTANTS];
        constants[k] = 1.0;
        weighted_model(points, &(law.build)(constants))
    };
    let design: Vec<Vec<f64>> = (0..count).map(unit).collect();
    let right = weighted_stresses(points);
    let mut non_negative = Vec::new();
    let mut all = Vec::new();
    for kept in 1..1_usize << count {
        let kept: Vec<usize> = (0..count).filter(|k| kept >> k & 1 == 1).collect();
        let columns: Vec<&[f64]> = kept.iter().map(|k| design[*k].as_slice()).collect();
        let Some(solution) = least_squares::linear(&columns, &right) else { continue };
        let mut constants = [0.0; MOST_CONSTANTS];
        for (k, value) in kept.iter().zip(solution) {
            constants[*k] = value;
        }
        if kept.len() == count {
            all.push((law.build)(constants));
        }
        if constants.iter().all(|c| *c >= 0.0) {
            non_negative.push((law.build)(constants));
        }
    }
    (all, non_negative)
}

/// A law `mu f(exponent)`: the valleys of the error from all starts, and the best ones at the edge of stability.
fn with_exponent(points: &[Point], starts: &[f64], edges: &[f64], law: &Law) -> (Vec<Isochoric>, Vec<Isochoric>) {
    let right = weighted_stresses(points);
    let of = |mu: f64, exponent: f64| (law.build)([mu, exponent, 0.0, 0.0]);
    let best_mu = |exponent: f64| {
        let column = weighted_model(points, &of(1.0, exponent));
        Some(least_squares::linear(&[&column], &right)?[0])
    };
    // In units of the largest stress, so that both parameters are of order one to a hundred.
    let scale = points.iter().map(|p| p.stress.abs()).fold(0.0, f64::max);
    let valleys = starts.iter().filter_map(|exponent| {
        let curve = ScaledCurve { points, right: &right, scale, of };
        let [mu, exponent] = least_squares::search(&curve, [best_mu(*exponent)? / scale, *exponent])?;
        Some(of(mu * scale, exponent))
    });
    let valleys = valleys.collect();
    let edge = edges.iter().filter_map(|exponent| Some(of(best_mu(*exponent)?, *exponent)));
    (valleys, edge.collect())
}

/// Residuals over the largest stress, as a function of mu over the largest stress and of the exponent.
struct ScaledCurve<'a, F> {
    points: &'a [Point],
    right: &'a [f64],
    scale: f64,
    of: F,
}

impl<F: Fn(f64, f64) -> Isochoric> ScaledCurve<'_, F> {
    fn model(&self, mu: f64, exponent: f64) -> Vec<f64> {
        let model = weighted_model(self.points, &(self.of)(mu * self.scale, exponent));
        model.into_iter().map(|stress| stress / self.scale).collect()
    }
}

impl<F: Fn(f64, f64) -> Isochoric> Curve<2> for ScaledCurve<'_, F> {
    fn residuals(&self, [mu, exponent]: [f64; 2]) -> Vec<f64> {
        self.model(mu, exponent).iter().zip(self.right).map(|(model, right)| model - right / self.scale).collect()
    }

    fn jacobian(&self, [mu, exponent]: [f64; 2]) -> [Vec<f64>; 2] {
        // The closed forms are smooth: a central difference of 1e-5 has an error of 1e-10.
        let step = 1e-5 * exponent.abs().max(1.0);
        let (above, below) = (self.model(mu, exponent + step), self.model(mu, exponent - step));
        let by_exponent = above.iter().zip(&below).map(|(above, below)| (above - below) / (2.0 * step)).collect();
        [self.model(1.0, exponent), by_exponent]
    }
}
