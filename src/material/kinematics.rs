//! Kinematics that all laws share: J without cancellation, cofactor, isochoric measures that survive inversion.

use glam::DMat3;

/// J below which isochoric factors and measures continue.
pub const J_CONTINUATION: f64 = 0.3;

/// `J^p` above `J_CONTINUATION`, its second-order Taylor polynomial below: value, first derivative.
pub fn isochoric_factor(j: f64, p: f64) -> (f64, f64) {
    if j >= J_CONTINUATION {
        let value = j.powf(p);
        (value, p * value / j)
    } else {
        let jc = J_CONTINUATION;
        let f0 = jc.powf(p);
        let f1 = p * f0 / jc;
        let f2 = (p - 1.0) * f1 / jc;
        let d = j - jc;
        (f0 + d * (f1 + 0.5 * d * f2), f1 + d * f2)
    }
}

/// Second derivative of `isochoric_factor`.
pub fn isochoric_factor_curvature(j: f64, p: f64) -> f64 {
    p * (p - 1.0) * j.max(J_CONTINUATION).powf(p - 2.0)
}

/// Scale `k^3 = u^(3/8)`, `u = 1 + SCALE_GAIN / (v^(8/3) + SCALE_FLOOR)`, of a cell below `J_CONTINUATION` from the volume
/// `v = (S/3)^(1/m)` that its lengths (or areas) would have in a cube: 1.02 at v = 1; a small cell is measured at v near
/// 0.35; the floor ends that near a stretch of 0.45, so that stiffness stays finite where F vanishes. The power of v is
/// the 8th of lengths and the 4th of areas: smooth for every F.
const SCALE_GAIN: f64 = 0.06;
const SCALE_FLOOR: f64 = 0.002;

/// An isochoric measure with its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measure {
    /// M, at least 3.
    pub value: f64,
    /// dM/dS at constant J.
    pub by_s: f64,
    /// dM/dJ and d2M/dJ2 at constant S. The first is negative for every J up to 1: what is squeezed flat pushes back.
    pub by_j: f64,
    pub by_jj: f64,
}

/// v^(8/3) and u.
fn scale(s: f64, m: f64) -> (f64, f64) {
    let volume = (s / 3.0).powf(8.0 / (3.0 * m));
    (volume, 1.0 + SCALE_GAIN / (volume + SCALE_FLOOR))
}

/// True where `isochoric_measure` is no longer `J^-m S`: q below 0.3.
pub fn is_measure_continued(s: f64, j: f64, m: f64) -> bool {
    j < J_CONTINUATION && j * scale(s, m).1.powf(0.375) < J_CONTINUATION
}

/// The measure `M = J^-m S` of a sum S of stretches of degree 3m that is never below `3 |J|^m` (arithmetic and geometric
/// mean): `I1bar` for m = 2/3, `I2bar` for m = 4/3. Below J = 0.3 it continues, twice differentiable, finite for every F and
/// never below 3, the value of pure changes of volume:
/// ```text
/// M = a(q) g(k^3m S),  q = k^3 J,  k^3 = (1 + 0.06/(v^(8/3) + 0.002))^(3/8),  v = (S/3)^(1/m)
/// a(q) = q^-m for q >= 0.3, its second-order Taylor polynomial below
/// g(s) = s  for s >= s0 = 3 0.3^m,  3/a(0.3 r(s/s0)) below
/// r(x) = x^(1/m), for m > 1 its second-order Taylor polynomial at 1, which is larger
/// ```
/// The first line measures the shape at another size, which changes nothing where q >= 0.3: what is squeezed from all
/// sides obeys the law itself far below J = 0.3, and only what is flat or inside out for its size leaves it. The third
/// holds M >= 3, since a falls with q and `0.3 r >= q`.
#[inline]
pub fn isochoric_measure(s: f64, j: f64, m: f64) -> Measure {
    debug_assert!(m > 0.0, "degree {m}");
    if j >= J_CONTINUATION {
        let a = j.powf(-m);
        let slope = -m * a / j;
        return Measure { value: a * s, by_s: a, by_j: slope * s, by_jj: (-m - 1.0) * slope / j * s };
    }
    continued_measure(s, j, m)
}

/// The same below J = 0.3.
fn continued_measure(s: f64, j: f64, m: f64) -> Measure {
    let (volume, u) = scale(s, m);
    let k3 = u.powf(0.375);
    let k3m = u.powf(0.375 * m);
    // d ln k^3 / d ln v, between -1 and 0; what is huge has the scale 1.
    let floored = volume + SCALE_FLOOR;
    let fall = -SCALE_GAIN * (volume / floored).min(1.0) / (floored + SCALE_GAIN);
    let (a, da) = isochoric_factor(k3 * j, -m);
    let dda = isochoric_factor_curvature(k3 * j, -m);
    let least = 3.0 * J_CONTINUATION.powf(m);
    let scaled = k3m * s;
    let (g, dg) = if scaled >= least {
        (scaled, 1.0)
    } else {
        let (x, p) = (scaled / least, 1.0 / m);
        let d = x - 1.0;
        let (r, dr) = if m <= 1.0 {
            (x.powf(p), p * x.powf(p - 1.0))
        } else {
            (1.0 + p * d * (1.0 + 0.5 * (p - 1.0) * d), p * (1.0 + (p - 1.0) * d))
        };
        let (b, db) = isochoric_factor(J_CONTINUATION * r, -m);
        (3.0 / b, -3.0 * db / (b * b) * J_CONTINUATION * dr / least)
    };
    // fall/S -> 0 with S.
    let fall_by_s = fall / (m * s.max(f64::MIN_POSITIVE));
    Measure {
        value: a * g,
        by_s: da * k3 * j * fall_by_s * g + a * dg * k3m * (1.0 + fall),
        by_j: da * k3 * g,
        by_jj: dda * k3 * k3 * g,
    }
}

/// `J - 1` from the displacement gradient H without cancellation: tr H + (tr^2 H - tr H^2)/2 + det H.
pub fn jacobian_minus_one(h: DMat3) -> f64 {
    let trace = h.x_axis.x + h.y_axis.y + h.z_axis.z;
    let hh = h * h;
    let trace_hh = hh.x_axis.x + hh.y_axis.y + hh.z_axis.z;
    trace + 0.5 * (trace * trace - trace_hh) + h.determinant()
}

/// cof F = J F^-T, by cross products of the columns.
pub fn cofactor(f: DMat3) -> DMat3 {
    DMat3::from_cols(f.y_axis.cross(f.z_axis), f.z_axis.cross(f.x_axis), f.x_axis.cross(f.y_axis))
}

/// `A : A`.
pub fn norm_squared(a: DMat3) -> f64 {
    a.x_axis.length_squared() + a.y_axis.length_squared() + a.z_axis.length_squared()
}

/// `A : B`.
pub fn double_dot(a: DMat3, b: DMat3) -> f64 {
    a.x_axis.dot(b.x_axis) + a.y_axis.dot(b.y_axis) + a.z_axis.dot(b.z_axis)
}

pub fn trace(a: DMat3) -> f64 {
    a.x_axis.x + a.y_axis.y + a.z_axis.z
}

/// First and second invariant of C = F^T F; `I2 = |cof F|^2`.
pub fn invariants(f: DMat3) -> (f64, f64) {
    (norm_squared(f), norm_squared(cofactor(f)))
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by cyclic Jacobi rotations.
pub fn symmetric_eigen(a: DMat3) -> ([f64; 3], DMat3) {
    const SWEEPS: usize = 12;
    let mut a = a.to_cols_array_2d();
    let mut v = DMat3::IDENTITY.to_cols_array_2d();
    for _ in 0..SWEEPS {
        let off = a[0][1].powi(2) + a[0][2].powi(2) + a[1][2].powi(2);
        if off == 0.0 {
            break;
        }
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for row in &mut a {
                let (x, y) = (row[p], row[q]);
                row[p] = c * x - s * y;
                row[q] = s * x + c * y;
            }
            for k in 0..3 {
                let (x, y) = (a[p][k], a[q][k]);
                a[p][k] = c * x - s * y;
                a[q][k] = s * x + c * y;
                let (x, y) = (v[p][k], v[q][k]);
                v[p][k] = c * x - s * y;
                v[q][k] = s * x + c * y;
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], DMat3::from_cols_array_2d(&v))
}
