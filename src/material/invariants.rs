//! Laws of the invariants `I1bar`, `I2bar`: stress, tangent bound and closed forms follow from energy and slopes.

use glam::{DMat3, DVec3};

use super::kinematics::{
    J_CONTINUATION, Measure, cofactor, invariants, is_measure_continued, isochoric_measure, jacobian_minus_one,
};
use super::law::IsochoricLaw;
use super::regular::{Exponential, Polynomial};
use super::{Continuation, LARGEST_STRETCH, Mode, TangentBound, Verdict};

/// Degrees m of `J^-m I1` and `J^-m I2`.
const FIRST: f64 = 2.0 / 3.0;
const SECOND: f64 = 4.0 / 3.0;

/// Derivatives of W_iso by `I1bar` and `I2bar` [Pa]: `w1`, `w2`, and `w11 = d^2 W/dI1bar^2`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Slopes {
    pub w1: f64,
    pub w2: f64,
    pub w11: f64,
}

/// A law of `I1bar` and, linear in it, of `I2bar`.
pub trait InvariantLaw {
    /// W_iso for `I1bar - 3` and `I2bar - 3` [J/m^3].
    fn energy(&self, i1: f64, i2: f64) -> f64;
    /// Its derivatives for `I1bar - 3`.
    fn slopes(&self, i1: f64) -> Slopes;
    /// Its constants where it is a polynomial, for [`regular`](super::regular).
    fn polynomial(&self) -> Option<Polynomial> {
        None
    }
    /// Its constants where it is an exponential, for [`regular`](super::regular).
    fn exponential(&self) -> Option<Exponential<f64>> {
        None
    }
    /// Whether it depends on `I1bar`, and on `I2bar`.
    fn measures(&self) -> [bool; 2] {
        [true, false]
    }
    /// True where an exponential of it is continued, for `I1bar - 3`.
    fn is_capped(&self, _i1: impl FnOnce() -> f64) -> bool {
        false
    }
}

/// F, J and both measures of a state.
struct State {
    f: DMat3,
    j: f64,
    i1: f64,
    i2: f64,
    first: Measure,
    second: Measure,
}

impl State {
    // As a call it would go through memory, which costs 2 % of a run of the f64 engine.
    #[inline(always)]
    fn of(h: DMat3) -> Self {
        let f = DMat3::IDENTITY + h;
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(f);
        State { f, j, i1, i2, first: isochoric_measure(i1, j, FIRST), second: isochoric_measure(i2, j, SECOND) }
    }
}

impl<L: InvariantLaw> IsochoricLaw for L {
    fn isochoric_energy(&self, h: DMat3) -> f64 {
        let state = State::of(h);
        self.energy(state.first.value - 3.0, state.second.value - 3.0)
    }

    #[inline]
    fn isochoric_stress(&self, h: DMat3) -> DMat3 {
        let State { f, i1, first, second, .. } = State::of(h);
        let s = self.slopes(first.value - 3.0);
        let c = f.transpose() * f;
        f * (2.0 * s.w1 * first.by_s)
            + (f * i1 - f * c) * (2.0 * s.w2 * second.by_s)
            + cofactor(f) * (s.w1 * first.by_j + s.w2 * second.by_j)
    }

    /// Bound of the isochoric tangent modulus for the stable step: of what a wave finds, `m N : d2W_iso/dF2 : m N` for a unit vector
    /// m and any N, together with the bulk modulus, `(kappa + turned) |cof F N|^2 + straight |N|^2`. At rest `turned` is 4/3 mu0,
    /// and exact, as in every pure change of volume.
    ///
    /// Along a wave F + t m N has `dJ/dt = m.u`, u = cof F N; with y = m.F N the second derivative of `a I1` is
    /// `a'' I1 (m.u)^2 - 4 |a'| (m.u) y + 2 a`. F N has the part J/|u|^2 along u, which makes the first line, and across u at most
    /// `J (l1^2 - l3^2)/(2 l1 l3)` times |N|^2/|u| (Kantorovich's inequality). The same for `b I2`, whose terms have
    /// `q = I1 - |F N|^2`, and across u at most 0.58 times the largest `|li^2 - lj^2| lk^3`:
    /// ```text
    /// turned   = w1 (a'' I1 - c1/g) + w2 (b'' I2 - c2 (I1 - l1^2)/g),  g = (l1 l2)^2
    /// c1 = 4 |a'| J - 2 a,  c2 = 4 |b'| J - 2 b
    /// straight = |w1| |a'| (l1^2 - l3^2) l2 + 1.16 |w2| |b'| max |li^2 - lj^2| lk^3 + w11 |dI1bar/dF|^2
    ///            + (2 w1 a + 2 w2 b l1^2 - (kappa + turned) (J/l1)^2)+
    /// ```
    /// the last term for waves across their direction. The eigenvalues l1^2 of C and g of cof C are bounded by Gershgorin's circles. The
    /// same as in the kernel; below J = 0.3 `straight` is at least what turning inside out adds. Source: this project; the bound
    /// is compared with the acoustic tensor in `tests/material/waves.rs`. Strains below [`SMALL_STRAIN`] have a simpler bound, found by
    /// sampling and compared there, too.
    fn tangent_bound(&self, h: DMat3, bulk_modulus: f64) -> TangentBound {
        let State { f, j, i1, i2, first, second } = State::of(h);
        let s = self.slopes(first.value - 3.0);
        // |2 a F + dI1bar/dJ cof F|^2, with F : cof F = 3 J.
        let gradient_squared = 4.0 * first.by_s * (first.by_s * i1 + 3.0 * first.by_j * j) + first.by_j.powi(2) * i2;
        let stiffening = s.w11.max(0.0) * gradient_squared.max(0.0);
        let c = f.transpose() * f;
        let strain = largest_strain(c);
        if strain < SMALL_STRAIN {
            let w = s.w1.abs() + s.w2.abs();
            let turned = 8.0 / 3.0 * (s.w1 + s.w2 + 6.0 * strain * w);
            return TangentBound { straight: 3.2 * strain * w + stiffening, turned };
        }
        let cof = cofactor(f);
        let (largest, area) =
            (largest_eigenvalue_bound(c).min(i1), largest_eigenvalue_bound(cof.transpose() * cof).min(i2).max(1e-12));
        let least = (j * j / area).min(largest);
        let middle = (i1 - largest - least).clamp(least, largest);
        let (a, b) = (first.by_s, second.by_s);
        let (fall_a, fall_b) = (first.by_j.abs() / i1.max(1e-6), second.by_j.abs() / i2.max(1e-6));
        let (c1, c2) = (2.0 * a - 4.0 * fall_a * j.max(0.0), 2.0 * b - 4.0 * fall_b * j.max(0.0));
        let turned =
            s.w1 * (first.by_jj + c1.min(0.0) / area) + s.w2 * (second.by_jj + c2.min(0.0) * (i1 - largest) / area);
        let turned = turned.max(0.0);
        let [l1, l2, l3] = [largest, middle, least].map(f64::sqrt);
        let across =
            ((largest - least) * l2.powi(3)).max((middle - least) * l1.powi(3)).max((largest - middle) * l3.powi(3));
        let sideways = 2.0 * s.w1 * a + 2.0 * s.w2 * b * largest;
        let mut straight = s.w1.abs() * fall_a * (largest - least) * l2
            + 1.16 * s.w2.abs() * fall_b * across
            + s.w1 * c1.max(0.0)
            + s.w2 * c2.max(0.0) * (i1 - least)
            + (sideways - (bulk_modulus + turned) * j * j / largest.max(1e-12)).max(0.0);
        if j < J_CONTINUATION {
            // Inside out, both terms of a wave along its direction add.
            let inside_out = 4.0 * (-j).max(0.0);
            let of_first = 2.0 * a + inside_out * fall_a;
            let of_second = 2.0 * b + inside_out * fall_b;
            straight = straight.max(s.w1 * of_first + s.w2 * of_second * i1);
        }
        TangentBound { straight: straight.max(0.0) + stiffening, turned }
    }

    // Without the measures themselves, as far as that goes: the f64 engine counts these cells.
    fn continuation(&self, h: DMat3) -> Option<Continuation> {
        let j = 1.0 + jacobian_minus_one(h);
        let (i1, i2) = invariants(DMat3::IDENTITY + h);
        let [first, second] = self.measures();
        if first && is_measure_continued(i1, j, FIRST) || second && is_measure_continued(i2, j, SECOND) {
            return Some(Continuation::Volume);
        }
        self.is_capped(|| isochoric_measure(i1, j, FIRST).value - 3.0).then_some(Continuation::Exponent)
    }

    fn polynomial(&self) -> Option<Polynomial> {
        InvariantLaw::polynomial(self)
    }

    fn exponential(&self) -> Option<Exponential<f64>> {
        InvariantLaw::exponential(self)
    }

    fn nominal_stress(&self, mode: Mode, x: f64) -> f64 {
        let i1 = mode.principal_stretches(x).iter().map(|l| l * l).sum::<f64>() - 3.0;
        let s = self.slopes(i1);
        match mode {
            Mode::Uniaxial => 2.0 * (s.w1 + s.w2 / x) * (x - x.powi(-2)),
            Mode::Equibiaxial => 2.0 * (s.w1 + s.w2 * x * x) * (x - x.powi(-5)),
            Mode::Planar => 2.0 * (s.w1 + s.w2) * (x - x.powi(-3)),
            Mode::Shear => 2.0 * (s.w1 + s.w2) * x,
        }
    }
}

/// Strain e up to which the tangent bound is `turned = 8/3 (w1 + w2) (1 + 6 e)`, `straight = 3.2 e (w1 + w2)`: most cells of a block, and
/// far fewer operations.
pub(super) const SMALL_STRAIN: f64 = 0.1;

/// Largest change of a diagonal entry of C, and twice the largest entry beside the diagonal.
fn largest_strain(c: DMat3) -> f64 {
    let along = DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z) - DVec3::ONE;
    let beside = DVec3::new(c.x_axis.y, c.y_axis.z, c.z_axis.x);
    along.abs().max_element() + 2.0 * beside.abs().max_element()
}

/// Bound of the largest eigenvalue of a symmetric matrix: the largest sum of absolute values of a row (Gershgorin).
fn largest_eigenvalue_bound(c: DMat3) -> f64 {
    [c.x_axis, c.y_axis, c.z_axis].map(|row| row.abs().element_sum()).into_iter().fold(0.0, f64::max)
}

/// Stretch up to which a law of I1bar alone is elliptic: `w1 > 0` and `w1 + 2 w11 (l_max - l_min)^2 > 0` in every
/// isochoric state whose largest stretch it is. (The largest square of `a.F N` over unit vectors with `a.F^-T N = 0` is
/// `(l_max - l_min)^2`.)
pub(super) fn stable_range(slopes: &dyn Fn(f64) -> Slopes) -> Verdict {
    const STEP: f64 = 1e-3;
    /// States between uniaxial tension (0) and equibiaxial tension (1) that are looked at.
    const STATES: i32 = 16;
    let elliptic = |l: f64, state: i32| {
        let middle = l.powf(-0.5 + 1.5 * f64::from(state) / f64::from(STATES));
        let least = 1.0 / (l * middle);
        let w = slopes(l * l + middle * middle + least * least - 3.0);
        w.w1 > 0.0 && w.w1 + 2.0 * w.w11 * (l - least).powi(2) > 0.0
    };
    let mut stretches = (1..).map(|i| 1.0 + f64::from(i) * STEP).take_while(|l| *l < LARGEST_STRETCH);
    let limit = stretches.find(|l| !(0..=STATES).all(|state| elliptic(*l, state)));
    limit.map_or(Verdict::Stable, Verdict::StableBelow)
}
