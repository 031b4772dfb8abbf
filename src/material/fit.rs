//! Least-squares fit of the five elastic laws to measured curves.
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
//! Neo-Hookean, Mooney-Rivlin and Yeoh are linear in their constants: one orthogonal decomposition (SVD of nalgebra)
//! gives the exact answer, and trying all sets of constants kept at zero gives the exact non-negative one. Ogden and
//! Demiray are not: their exponent is sought by Levenberg-Marquardt from fixed starts, so that equal data give equal
//! constants. The optimiser is the crate `levenberg-marquardt`, a port of MINPACK with its scaling and its stopping rules
//! that is tested against the original; `argmin` offers Gauss-Newton and simplex methods, which need a tuned step or many
//! more evaluations for a sum of squares.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, Matrix, U2, Vector2};

use super::{Demiray, Isochoric, Mode, MooneyRivlin, NeoHookean, Ogden, Verdict, Yeoh};

/// Smallest exponent b of a stable Demiray fit: below it the law is neo-Hookean to 1e-3 at stretches that samples reach.
pub const LEAST_DEMIRAY_B: f64 = 1e-3;

/// Exponents from which the search starts. Between two of them the error has at most one valley in all cases tried.
const OGDEN_STARTS: [f64; 10] = [-30.0, -12.0, -5.0, -2.0, -0.5, 0.5, 2.0, 5.0, 12.0, 30.0];
const DEMIRAY_STARTS: [f64; 6] = [-1.0, 0.1, 1.0, 5.0, 20.0, 80.0];

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
    if let Isochoric::Ogden(Ogden { mu, alpha }) = *law {
        let l = if mode == Mode::Shear { mode.principal_stretches(x)[0] } else { x };
        let powers = match mode {
            Mode::Uniaxial => l.powf(alpha - 1.0) - l.powf(-0.5 * alpha - 1.0),
            Mode::Equibiaxial => l.powf(alpha - 1.0) - l.powf(-2.0 * alpha - 1.0),
            Mode::Planar => l.powf(alpha - 1.0) - l.powf(-alpha - 1.0),
            Mode::Shear => (l.powf(alpha) - l.powf(-alpha)) / (l + 1.0 / l),
        };
        return 2.0 * mu / alpha * powers;
    }
    let i1 = mode.principal_stretches(x).iter().map(|l| l * l).sum::<f64>() - 3.0;
    let s = law.slopes(i1).unwrap_or_default();
    match mode {
        Mode::Uniaxial => 2.0 * (s.w1 + s.w2 / x) * (x - x.powi(-2)),
        Mode::Equibiaxial => 2.0 * (s.w1 + s.w2 * x * x) * (x - x.powi(-5)),
        Mode::Planar => 2.0 * (s.w1 + s.w2) * (x - x.powi(-3)),
        Mode::Shear => 2.0 * (s.w1 + s.w2) * x,
    }
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

/// Keys of the laws that are fitted.
pub const LAWS: [&str; 5] = ["neo_hookean", "mooney_rivlin", "yeoh", "ogden", "demiray"];

/// Fits all five laws, in the order of `src/material`.
pub fn fit_all(points: &[Point]) -> Vec<LawFit> {
    LAWS.map(|key| fit_law(key, points)).into()
}

/// The stable fit to recommend: the smallest error, and of equally good laws the one with the fewest constants.
pub fn best_stable(fits: &[LawFit]) -> Option<&LawFit> {
    let error = |fit: &LawFit| fit.stable.map_or(f64::INFINITY, |f| f.relative);
    let least = fits.iter().map(error).fold(f64::INFINITY, f64::min);
    fits.iter()
        .filter(|fit| fit.stable.is_some() && error(fit) <= EQUALLY_GOOD * least + EXACT)
        .min_by_key(|fit| fit.stable.map_or(usize::MAX, |f| f.law.constants().len()))
}

fn fit_law(key: &'static str, points: &[Point]) -> LawFit {
    let (all, stable) = match key {
        "neo_hookean" => linear(points, 1, &|c| Isochoric::NeoHookean(NeoHookean { c10: c[0] })),
        "mooney_rivlin" => linear(points, 2, &|c| Isochoric::MooneyRivlin(MooneyRivlin { c10: c[0], c01: c[1] })),
        "yeoh" => linear(points, 3, &|c| Isochoric::Yeoh(Yeoh { c10: c[0], c20: c[1], c30: c[2] })),
        // |alpha| = 1 is the edge of the stable exponents.
        "ogden" => with_exponent(points, &OGDEN_STARTS, &[-1.0, 1.0], ogden),
        _ => with_exponent(points, &DEMIRAY_STARTS, &[LEAST_DEMIRAY_B], demiray),
    };
    let best = |laws: Vec<Isochoric>, keep: &dyn Fn(&Fit) -> bool| {
        let fits = laws.iter().map(|law| judge(law, points)).filter(|fit| fit.rms.is_finite() && keep(fit));
        fits.min_by(|a, b| a.rms.total_cmp(&b.rms))
    };
    let unconstrained = best(all.clone(), &|_| true);
    let candidates = all.into_iter().chain(stable).collect();
    LawFit { key, unconstrained, stable: best(candidates, &|fit| fit.verdict == Verdict::Stable) }
}

fn ogden(mu: f64, alpha: f64) -> Isochoric {
    Isochoric::Ogden(Ogden { mu, alpha })
}

fn demiray(mu: f64, b: f64) -> Isochoric {
    Isochoric::Demiray(Demiray { mu, b })
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
fn weighted_stresses(points: &[Point]) -> DVector<f64> {
    DVector::from_iterator(points.len(), points.iter().map(|p| p.weight.sqrt() * p.stress))
}

/// A law that is linear in `count` constants: the exact answer, and the best ones without negative constants.
fn linear(points: &[Point], count: usize, law: &dyn Fn(&[f64]) -> Isochoric) -> (Vec<Isochoric>, Vec<Isochoric>) {
    let unit = |k: usize| {
        let mut constants = [0.0; 3];
        constants[k] = 1.0;
        law(&constants)
    };
    let columns: Vec<Isochoric> = (0..count).map(unit).collect();
    let design = DMatrix::from_fn(points.len(), count, |row, column| {
        let p = &points[row];
        p.weight.sqrt() * nominal_stress(&columns[column], p.mode, p.x)
    });
    let right = weighted_stresses(points);
    let mut non_negative = Vec::new();
    let mut all = Vec::new();
    for kept in 1..1_usize << count {
        let kept: Vec<usize> = (0..count).filter(|k| kept >> k & 1 == 1).collect();
        let Some(solution) = least_squares(&design.select_columns(&kept), &right) else { continue };
        let mut constants = [0.0; 3];
        for (k, value) in kept.iter().zip(solution.iter()) {
            constants[*k] = *value;
        }
        if kept.len() == count {
            all.push(law(&constants));
        }
        if constants.iter().all(|c| *c >= 0.0) {
            non_negative.push(law(&constants));
        }
    }
    (all, non_negative)
}

/// Least-squares solution; `None` where the points do not determine it.
fn least_squares(design: &DMatrix<f64>, right: &DVector<f64>) -> Option<DVector<f64>> {
    // Columns of unit length, so that the rank does not depend on the size of a constant.
    let lengths: Vec<f64> = design.column_iter().map(|c| c.norm()).collect();
    if lengths.iter().any(|l| !(l.is_finite() && *l > 0.0)) {
        return None;
    }
    let mut scaled = design.clone();
    for (mut column, length) in scaled.column_iter_mut().zip(&lengths) {
        column /= *length;
    }
    let decomposition = scaled.svd(true, true);
    // Columns that agree to 1e-9 leave constants to rounding.
    if decomposition.singular_values.min() < 1e-9 * decomposition.singular_values.max() {
        return None;
    }
    let solution = decomposition.solve(right, 0.0).ok()?;
    Some(DVector::from_iterator(lengths.len(), solution.iter().zip(&lengths).map(|(s, l)| s / l)))
}

/// A law `mu f(exponent)`: the valleys of the error from all starts, and the best ones at the edge of stability.
fn with_exponent(
    points: &[Point],
    starts: &[f64],
    edges: &[f64],
    law: fn(f64, f64) -> Isochoric,
) -> (Vec<Isochoric>, Vec<Isochoric>) {
    let right = weighted_stresses(points);
    let best_mu = |exponent: f64| {
        let column = weighted_model(points, &law(1.0, exponent));
        let solution = least_squares(&DMatrix::from_columns(&[column]), &right)?;
        Some(solution[0])
    };
    let scale = points.iter().map(|p| p.stress.abs()).fold(0.0, f64::max);
    let valleys = starts.iter().filter_map(|exponent| {
        // In units of the largest stress, so that both parameters are of order one to a hundred.
        let problem = Problem {
            points,
            right: &right / scale,
            scale,
            law,
            at: Vector2::new(best_mu(*exponent)? / scale, *exponent),
        };
        let (found, report) = LevenbergMarquardt::new().with_patience(200).minimize(problem);
        let at = found.at;
        (report.termination.was_successful() && at.iter().all(|v| v.is_finite())).then(|| law(at[0] * scale, at[1]))
    });
    let valleys = valleys.collect();
    let edge = edges.iter().filter_map(|exponent| Some(law(best_mu(*exponent)?, *exponent)));
    (valleys, edge.collect())
}

/// Stresses of a law at the points, times the roots of their weights.
fn weighted_model(points: &[Point], law: &Isochoric) -> DVector<f64> {
    DVector::from_iterator(points.len(), points.iter().map(|p| p.weight.sqrt() * nominal_stress(law, p.mode, p.x)))
}

/// Residuals over the largest stress, as a function of mu over the largest stress and of the exponent.
struct Problem<'a> {
    points: &'a [Point],
    right: DVector<f64>,
    scale: f64,
    law: fn(f64, f64) -> Isochoric,
    at: Vector2<f64>,
}

impl Problem<'_> {
    fn model(&self, mu: f64, exponent: f64) -> DVector<f64> {
        weighted_model(self.points, &(self.law)(mu * self.scale, exponent)) / self.scale
    }
}

impl LeastSquaresProblem<f64, Dyn, U2> for Problem<'_> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, U2>;
    type ParameterStorage = Owned<f64, U2>;

    fn set_params(&mut self, at: &Vector2<f64>) {
        self.at = *at;
    }

    fn params(&self) -> Vector2<f64> {
        self.at
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let residuals = self.model(self.at[0], self.at[1]) - &self.right;
        residuals.iter().all(|r| r.is_finite()).then_some(residuals)
    }

    fn jacobian(&self) -> Option<Matrix<f64, Dyn, U2, Self::JacobianStorage>> {
        let (mu, exponent) = (self.at[0], self.at[1]);
        // The closed forms are smooth: a central difference of 1e-5 has an error of 1e-10.
        let step = 1e-5 * exponent.abs().max(1.0);
        let by_exponent = (self.model(mu, exponent + step) - self.model(mu, exponent - step)) / (2.0 * step);
        let jacobian = Matrix::<f64, Dyn, U2, _>::from_columns(&[self.model(1.0, exponent), by_exponent]);
        jacobian.iter().all(|r| r.is_finite()).then_some(jacobian)
    }
}
