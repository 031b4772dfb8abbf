//! The curve of a wedged planar crack for one law, by continuation in the shaft radius R at fixed slit length: energy, normal force, tip
//! force and toughness against x = a/R, and the crack that a given toughness makes (Shergold and Fleck 2004, sharp punch).
//!
//! U(a, R) is homogeneous of degree two, in the discrete problem too (the mesh scales with a). Hence one run at fixed a gives the whole of
//! `U = R^2 f(x)`, and the contact force `N = dU/dR` gives `f'`: `x f' = 2 f - N/R`. Nothing is differentiated by differences:
//! `J_c = -f' R/2 = (N R - 2 U)/(2 a)`, `F_tip = U + 2 a J_c = N R - U`.

use super::law::PlaneStrainLaw;
use super::slit_mesh::MeshSize;
use super::wedged_crack::{NewtonFailure, WedgeState, WedgedCrack};

/// First circle over a, halved while it does not converge.
const FIRST_RADIUS: f64 = 0.08;
/// Ratio of the radii of the run-up to the first point of the curve.
const RUN_UP_RATIO: f64 = 1.35;
/// Largest growth of ln J_c from point to point aimed at.
const TOUGHNESS_STEP: f64 = 0.6;
/// Halvings of one step in ln R.
const HALVINGS: usize = 6;

/// What to compute.
#[derive(Clone, Copy, Debug)]
pub struct WedgeOptions {
    /// Mesh of the quarter plane.
    pub mesh: MeshSize,
    /// Largest x = a/R.
    pub size_max: f64,
    /// Smallest x = a/R.
    pub size_min: f64,
    /// Number of points from `size_max` to `size_min`, equal steps in ln x; steep laws get more on the same way.
    pub points: usize,
    /// The curve ends early where J_c/(mu R) passes this.
    pub toughness_max: f64,
    /// Newton steps for the whole curve at most.
    pub newton_budget: usize,
}

impl Default for WedgeOptions {
    fn default() -> Self {
        Self {
            mesh: MeshSize { radial: 9, along: 12, far_radius: 200.0, radial_grading: 14.0, along_grading: 4.0 },
            size_max: 4.0,
            size_min: 0.0125,
            points: 42,
            toughness_max: 120.0,
            newton_budget: 500,
        }
    }
}

/// Why the curve ends where it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveEnd {
    /// `size_min` reached.
    SizeReached,
    /// `toughness_max` reached.
    ToughnessReached,
    /// No equilibrium found for a smaller crack: the law stiffens too much or loses stability.
    Failed(NewtonFailure),
    /// `newton_budget` spent.
    BudgetSpent,
}

/// One wedged crack, for R = 1. With R in m and stresses in Pa: energy and tip force times R^2 [N], normal force and toughness times R [N/m].
#[derive(Clone, Copy, Debug)]
pub struct WedgePoint {
    /// Half length of the crack at rest over R: x = a/R.
    pub size: f64,
    /// Strain energy per length of shaft f = U/R^2 [stress].
    pub energy: f64,
    /// Normal force per length of shaft N/R [stress].
    pub normal_force: f64,
}

impl WedgePoint {
    /// Steady force of the tip, F_tip/R^2 = N/R - U/R^2, of the toughness that makes this crack [stress].
    pub fn tip_force(&self) -> f64 {
        self.normal_force - self.energy
    }

    /// The toughness that makes this crack, J_c/R = -f'/2 [stress].
    pub fn toughness(&self) -> f64 {
        (self.normal_force - 2.0 * self.energy) / (2.0 * self.size)
    }

    /// Slope of the energy d ln f/d ln x.
    fn slope(&self) -> f64 {
        2.0 - self.normal_force / self.energy
    }
}

/// The curve of one law.
#[derive(Clone, Debug)]
pub struct WedgeCurve {
    /// Points by falling size.
    pub points: Vec<WedgePoint>,
    /// Why there are no more.
    pub end: CurveEnd,
    /// Shear modulus of the law [stress].
    pub mu: f64,
    /// Newton steps taken.
    pub iterations: usize,
}

/// The question lies beyond an end of the curve, whose point is given.
#[derive(Clone, Copy, Debug)]
pub enum OutOfCurve {
    /// Crack larger than the largest computed (brittle).
    AboveLargest(WedgePoint),
    /// Crack smaller than the smallest computed (tough).
    BelowSmallest(WedgePoint),
}

impl WedgeCurve {
    /// Computes the curve. `Err` if not even its first point was found.
    pub fn compute(law: &dyn PlaneStrainLaw, options: &WedgeOptions) -> Result<Self, NewtonFailure> {
        let mut walk =
            Walk { crack: WedgedCrack::new(law, &options.mesh), past: Vec::new(), budget: options.newton_budget };
        let mu = law.shear_modulus();
        walk.start(1.0 / options.size_max)?;
        let mut points: Vec<WedgePoint> = Vec::with_capacity(options.points);
        let size_min = options.size_min.min(options.size_max);
        let longest = (options.size_max / size_min).ln() / (options.points.max(2) - 1) as f64;
        let (mut size, mut step) = (options.size_max, longest);
        let end = loop {
            if let Err(e) = walk.go_to(1.0 / size) {
                break e;
            }
            let point = walk.point();
            if let Some(last) = points.last() {
                // steep laws: no more than TOUGHNESS_STEP in ln J from point to point
                let rise = (point.toughness() / last.toughness()).ln();
                if rise.is_finite() && rise > 0.0 {
                    step = (step * TOUGHNESS_STEP / rise).min(1.2 * step).clamp(0.1 * longest, longest);
                }
            }
            points.push(point);
            if point.toughness() > options.toughness_max * mu {
                break CurveEnd::ToughnessReached;
            }
            if size <= size_min * (1.0 + 1e-9) {
                break CurveEnd::SizeReached;
            }
            size = (size * (-step).exp()).max(size_min);
        };
        if points.is_empty() {
            return Err(NewtonFailure::NotConverged);
        }
        Ok(Self { points, end, mu, iterations: walk.crack.iterations })
    }

    /// The wedged crack of size x = a/R (cubic Hermite interpolation of ln f in ln x; N by its slope, so that N R = F + U holds).
    pub fn at_size(&self, size: f64) -> Result<WedgePoint, OutOfCurve> {
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        if size > first.size * (1.0 + 1e-9) {
            return Err(OutOfCurve::AboveLargest(first));
        }
        if size.is_nan() || size < last.size * (1.0 - 1e-9) {
            return Err(OutOfCurve::BelowSmallest(last));
        }
        let k = self.points.partition_point(|p| p.size >= size).min(self.points.len() - 1);
        let (p, q) = (self.points[k.max(1) - 1], self.points[k]);
        Ok(interpolate(&p, &q, size))
    }

    /// The crack that toughness J_c makes: `min_a [U + 2 a J_c]`, `toughness` = J_c / R [stress]. The tip force of the answer is
    /// `U + 2 a J_c`, its normal force N presses the shaft.
    pub fn at_toughness(&self, toughness: f64) -> Result<WedgePoint, OutOfCurve> {
        let (first, last) = (self.points[0], self.points[self.points.len() - 1]);
        // from the tough end, where the curve is steepest and its noise least
        let Some(k) = (1..self.points.len())
            .rev()
            .find(|&k| self.points[k - 1].toughness() <= toughness && toughness <= self.points[k].toughness())
        else {
            return Err(if toughness < first.toughness() {
                OutOfCurve::AboveLargest(first)
            } else {
                OutOfCurve::BelowSmallest(last)
            });
        };
        let (p, q) = (self.points[k - 1], self.points[k]);
        let (mut tough, mut brittle) = (q.size.ln(), p.size.ln());
        for _ in 0..60 {
            let mid = 0.5 * (tough + brittle);
            if interpolate(&p, &q, mid.exp()).toughness() > toughness {
                tough = mid;
            } else {
                brittle = mid;
            }
        }
        Ok(interpolate(&p, &q, (0.5 * (tough + brittle)).exp()))
    }
}

/// Cubic Hermite interpolation of ln f in ln x between two points: exact for the power laws that f tends to for stiffening laws.
fn interpolate(p: &WedgePoint, q: &WedgePoint, size: f64) -> WedgePoint {
    let h = (q.size / p.size).ln();
    if h == 0.0 {
        return *p;
    }
    let t = (size / p.size).ln() / h;
    let (fp, fq, sp, sq) = (p.energy.ln(), q.energy.ln(), h * p.slope(), h * q.slope());
    let (c2, c3) = (3.0 * (fq - fp) - 2.0 * sp - sq, 2.0 * (fp - fq) + sp + sq);
    let energy = (fp + t * (sp + t * (c2 + t * c3))).exp();
    let slope = (sp + t * (2.0 * c2 + 3.0 * t * c3)) / h;
    WedgePoint { size, energy, normal_force: energy * (2.0 - slope) }
}

/// Continuation in R.
struct Walk<'a> {
    crack: WedgedCrack<'a>,
    /// The last three equilibria, newest last.
    past: Vec<WedgeState>,
    budget: usize,
}

impl Walk<'_> {
    /// Finds a first equilibrium and walks near the radius `target`.
    fn start(&mut self, target: f64) -> Result<(), NewtonFailure> {
        let mut radius = FIRST_RADIUS.min(target);
        let mut failure = NewtonFailure::NotConverged;
        for _ in 0..HALVINGS {
            let mut state = self.crack.initial_state(radius);
            match self.crack.solve(&mut state, None) {
                Ok(()) => {
                    self.past.push(state);
                    while radius * RUN_UP_RATIO < target {
                        radius *= RUN_UP_RATIO;
                        self.go_to(radius).map_err(|_| NewtonFailure::NotConverged)?;
                    }
                    return Ok(());
                }
                Err(e) => failure = e,
            }
            radius *= 0.5;
        }
        Err(failure)
    }

    /// The newest equilibrium as a point of the curve.
    fn point(&self) -> WedgePoint {
        let state = &self.past[self.past.len() - 1];
        let r = state.radius;
        WedgePoint {
            size: 1.0 / r,
            energy: self.crack.energy(state) / (r * r),
            normal_force: self.crack.normal_force(state) / r,
        }
    }

    /// Walks to the radius `target`, in smaller steps where one does not converge.
    fn go_to(&mut self, target: f64) -> Result<(), CurveEnd> {
        let mut step = 1.0;
        loop {
            let now = self.past[self.past.len() - 1].radius;
            let left = (target / now).ln();
            if left.abs() < 1e-12 {
                return Ok(());
            }
            let whole = left.abs() <= step;
            let radius = if whole { target } else { now * (step * left.signum()).exp() };
            let mut state = self.predict(radius);
            match self.crack.solve(&mut state, self.past.last()) {
                Ok(()) => {
                    if self.past.len() == 3 {
                        self.past.remove(0);
                    }
                    self.past.push(state);
                }
                Err(e) => {
                    step = 0.5 * left.abs().min(step);
                    if step < 0.2 * 0.5_f64.powi(HALVINGS as i32) {
                        return Err(CurveEnd::Failed(e));
                    }
                }
            }
            if self.crack.iterations >= self.budget {
                return Err(CurveEnd::BudgetSpent);
            }
        }
    }

    /// Guess at the radius by Lagrange extrapolation in ln R through the past equilibria.
    fn predict(&self, radius: f64) -> WedgeState {
        let newest = &self.past[self.past.len() - 1];
        let mut state = newest.clone();
        state.radius = radius;
        let logs: Vec<f64> = self.past.iter().map(|s| (s.radius / radius).ln()).collect();
        let weight =
            |k: usize| -> f64 { (0..logs.len()).filter(|&m| m != k).map(|m| logs[m] / (logs[m] - logs[k])).product() };
        let weights: Vec<f64> = (0..logs.len()).map(weight).collect();
        for (i, u) in state.u.iter_mut().enumerate() {
            *u = [0, 1].map(|d| self.past.iter().zip(&weights).map(|(s, w)| w * s.u[i][d]).sum());
        }
        for (i, p) in state.p.iter_mut().enumerate() {
            *p = [0, 1, 2].map(|d| self.past.iter().zip(&weights).map(|(s, w)| w * s.p[i][d]).sum());
        }
        for (i, f) in state.contact.iter_mut().enumerate() {
            // the set of the newest state; new nodes are found by their position
            if *f > 0.0 {
                let guess: f64 = self.past.iter().zip(&weights).map(|(s, w)| w * s.contact[i]).sum();
                *f = guess.max(1e-3 * *f);
            }
        }
        state
    }
}
