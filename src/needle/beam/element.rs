//! One element of the beam.

use super::*;

/// Weights of position, tangent, position, tangent at the local coordinate 0..1 of an element of length `h` [m].
pub(super) fn cubic_shape(at: f64, h: f64) -> [f64; 4] {
    let (a, b) = (at * at, at * at * at);
    [1.0 - 3.0 * a + 2.0 * b, h * (at - 2.0 * a + b), 3.0 * a - 2.0 * b, h * (b - a)]
}

/// One element in the state that it has.
pub(super) struct Element {
    /// Rest length [m], length of the chord [m] and its direction.
    pub(super) h: f64,
    pub(super) l: f64,
    pub(super) e: DVec3,
    pub(super) t: [DVec3; 2],
    /// EA/h [N/m] and 2 EI/h [N m].
    pub(super) axial: f64,
    pub(super) bending: f64,
}

impl Element {
    /// Squares of the end slopes and their product: q11, q12, q22.
    pub(super) fn slopes(&self) -> [f64; 3] {
        let [w1, w2] = self.t.map(|t| self.e.cross(t));
        // 1 - c^2 = |w|^2 and 1 - c = |w|^2/(1 + c) keep the digits that a small slope would lose.
        let square = |w: DVec3, t: DVec3| w.length_squared() * (1.0 + 4.0 / (1.0 + self.e.dot(t))) / 3.0;
        [square(w1, self.t[0]), w1.dot(w2), square(w2, self.t[1])]
    }

    /// Lengthening of the centre-line, with what the deflection takes up [m].
    pub(super) fn lengthening(&self) -> f64 {
        let [q11, q12, q22] = self.slopes();
        self.l - self.h + self.h / 30.0 * (2.0 * q11 - q12 + 2.0 * q22)
    }

    pub(super) fn axial_force(&self) -> f64 {
        self.axial * self.lengthening()
    }

    /// Energy of bending and of stretching [J].
    pub(super) fn energy(&self) -> (f64, f64) {
        let [q11, q12, q22] = self.slopes();
        (self.bending * (q11 + q12 + q22), 0.5 * self.axial * self.lengthening().powi(2))
    }

    /// First and second derivatives of the energy by (d, t1, t2), with `q_12 = t1.t2 - c1 c2`.
    pub(super) fn derivatives(&self) -> ([f64; 9], [[f64; 9]; 9]) {
        let c = self.t.map(|t| self.e.dot(t));
        // Part of t_i across the chord.
        let p = [self.t[0] - self.e * c[0], self.t[1] - self.e * c[1]];
        let fill = |parts: [DVec3; 3]| {
            let mut out = [0.0; 9];
            for (k, part) in parts.iter().enumerate() {
                out[3 * k..3 * k + 3].copy_from_slice(&part.to_array());
            }
            out
        };
        let length = fill([self.e, DVec3::ZERO, DVec3::ZERO]);
        let cosines = [fill([p[0] / self.l, self.e, DVec3::ZERO]), fill([p[1] / self.l, DVec3::ZERO, self.e])];
        let product = fill([DVec3::ZERO, self.t[1], self.t[0]]);
        // d q_ii/d c_i; the second one is -2/3.
        let rate = c.map(|c| -(2.0 * c + 4.0) / 3.0);
        let squares: [f64; 9] = std::array::from_fn(|a| rate[0] * cosines[0][a] + rate[1] * cosines[1][a]);
        let mixed: [f64; 9] = std::array::from_fn(|a| product[a] - c[1] * cosines[0][a] - c[0] * cosines[1][a]);
        let force = self.axial_force();
        let arch = self.h / 30.0;
        let lengthening: [f64; 9] = std::array::from_fn(|a| length[a] + arch * (2.0 * squares[a] - mixed[a]));
        let alpha = self.bending + 2.0 * force * arch;
        let beta = self.bending - force * arch;
        let gradient = std::array::from_fn(|a| force * length[a] + alpha * squares[a] + beta * mixed[a]);
        let mut hessian = [[0.0; 9]; 9];
        for r in 0..9 {
            for s in 0..9 {
                let own = cosines[0][r] * cosines[0][s] + cosines[1][r] * cosines[1][s];
                let cross = cosines[0][r] * cosines[1][s] + cosines[1][r] * cosines[0][s];
                hessian[r][s] = self.axial * lengthening[r] * lengthening[s] - alpha * own * (2.0 / 3.0) - beta * cross;
            }
        }
        // Second derivatives of length, cosines and product.
        let weight = [alpha * rate[0] - beta * c[1], alpha * rate[1] - beta * c[0]];
        for r in 0..3 {
            for s in 0..3 {
                let across = f64::from(u8::from(r == s)) - self.e[r] * self.e[s];
                hessian[r][s] += force * across / self.l;
                for i in 0..2 {
                    let bend = p[i][r] * self.e[s] + self.e[r] * p[i][s] + c[i] * across;
                    hessian[r][s] -= weight[i] * bend / (self.l * self.l);
                    let column = 3 * (i + 1) + s;
                    hessian[r][column] += weight[i] * across / self.l;
                    hessian[column][r] += weight[i] * across / self.l;
                }
            }
            hessian[3 + r][6 + r] += beta;
            hessian[6 + r][3 + r] += beta;
        }
        (gradient, hessian)
    }
}
