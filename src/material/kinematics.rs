//! Kinematics that all laws share: J without cancellation, cofactor, isochoric factors that survive inversion.

use glam::DMat3;

/// J below which the isochoric factors continue as polynomials.
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
