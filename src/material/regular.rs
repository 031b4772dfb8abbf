//! Laws of the invariants where a cell keeps most of its volume, for any [`Number`]: stress without cancellation and the bound of the
//! tangent. The same equations as `invariants`, written in H = F - I, so that f32 keeps its digits at small strain:
//! ```text
//! K = cof F - I = tr H I - H^T + cof H,  E = C - I = H + H^T + H^T H
//! e1 = I1 - 3 = tr E,  e2 = I2 - 3 = 2 e1 + tr cof E,  dj = J - 1 = tr H + tr cof H + det H
//! P_iso = 2 w1 J^(-2/3) (H - s1 K + (1 - s1) I),                          s1 = I1/(3 J)
//!       + 2 w2 J^(-4/3) (2 H + e1 F - F E - s2 K + (2 - s2) I),           s2 = 2 I2/(3 J)
//! I1bar - 3 = r^(-2) (d1 + (r - 1)^2 (2 r + 1)),                          r = J^(1/3),  d1 = e1 - 2 dj = |H|^2 - 2 tr cof H - 2 det H
//! I2bar - 3 = r^(-4) (2 d1 + tr cof E - (r - 1)^2 (3 r^2 + 2 r + 1))
//! ```

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use super::stretches::{Powers, Stretches};
use crate::number::{Number, Tensor};

/// J between which the forms of this file hold to the last digits of f32.
pub const LEAST_J: f64 = 0.4;
/// See [`LEAST_J`].
pub const LARGEST_J: f64 = 2.2;
/// Beyond this exponent an exponential law is continued as a polynomial, see [`super::demiray`].
pub(super) const LARGEST_EXPONENT: f64 = 10.0;

/// `W_iso = c1 e + c2 e^2 + c3 e^3 + c01 (I2bar - 3)` with `e = I1bar - 3` [Pa]: neo-Hooke, Mooney-Rivlin and Yeoh.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Polynomial {
    pub c1: f64,
    pub c2: f64,
    pub c3: f64,
    pub c01: f64,
}

/// The same in every lane, or another in each.
#[derive(Debug, Clone, Copy)]
pub struct Constants<N> {
    pub c1: N,
    pub c2: N,
    pub c3: N,
    pub c01: N,
    /// True where no lane has c2 or c3, and where one has c01.
    pub is_linear: bool,
    pub has_c01: bool,
}

impl Polynomial {
    /// In every lane of a number of the kind of `n`.
    #[inline(always)]
    pub fn in_lanes<N: Number>(&self, n: N) -> Constants<N> {
        Constants {
            c1: n.of(self.c1),
            c2: n.of(self.c2),
            c3: n.of(self.c3),
            c01: n.of(self.c01),
            is_linear: self.is_linear(),
            has_c01: self.c01 != 0.0,
        }
    }

    /// True where it has neither c2 nor c3.
    pub fn is_linear(&self) -> bool {
        self.c2 == 0.0 && self.c3 == 0.0
    }
}

impl<N: Number> Constants<N> {
    /// The constants of a law that is weakened to the part `left` of its stress.
    #[inline(always)]
    pub fn weakened(&self, left: N) -> Self {
        Constants { c1: self.c1 * left, c2: self.c2 * left, c3: self.c3 * left, c01: self.c01 * left, ..*self }
    }
}

/// `W_iso = mu/(2 b) (exp(b e) - 1)` with `e = I1bar - 3`: shear modulus [Pa] and exponent; a lane of another law has mu = 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exponential<N> {
    pub mu: N,
    pub b: N,
}

impl Exponential<f64> {
    /// In every lane of a number of the kind of `n`.
    #[inline(always)]
    pub fn in_lanes<N: Number>(&self, n: N) -> Exponential<N> {
        Exponential { mu: n.of(self.mu), b: n.of(self.b) }
    }
}

/// An elastic law: its polynomial part, and its exponential and its powers of the stretches, if any lane has such.
#[derive(Debug, Clone, Copy)]
pub struct LawInLanes<N> {
    pub polynomial: Constants<N>,
    pub exponential: Option<Exponential<N>>,
    pub powers: Option<Powers<N>>,
}

/// What a law answers to a state.
#[derive(Debug, Clone, Copy)]
pub struct LawAnswer<N> {
    pub state: Regular<N>,
    /// P_iso [Pa].
    pub stress: Tensor<N>,
    /// The polynomial that its slopes are those of, for the bound of the tangent.
    pub slopes: Constants<N>,
    /// Part of the straight bound of the tangent that powers of the stretches have [Pa].
    pub of_powers: N,
}

impl<N: Number> LawInLanes<N> {
    /// P_iso of H; `None` where a lane has left the range.
    #[inline(always)]
    pub fn answer(&self, h: &Tensor<N>) -> Option<LawAnswer<N>> {
        let state = Regular::new(*h)?;
        let none = state.dj.of(0.0);
        let slopes = self.slopes_at(&state)?;
        let mut stress = state.stress(&slopes, none);
        let mut of_powers = none;
        if let Some(powers) = &self.powers {
            let (added, bound) = state.stress_and_bound_of_powers(powers)?;
            of_powers = bound;
            for a in 0..3 {
                for b in 0..3 {
                    stress[a][b] = stress[a][b] + added[a][b];
                }
            }
        }
        Some(LawAnswer { state, stress, slopes, of_powers })
    }

    /// The polynomial with the slopes w1 and w11 of an exponential in this state; `None` where a lane has left the exponential for what
    /// continues it.
    #[inline(always)]
    pub fn slopes_at(&self, state: &Regular<N>) -> Option<Constants<N>> {
        let Some(Exponential { mu, b }) = self.exponential else { return Some(self.polynomial) };
        let n = state.dj;
        let e = state.first_less_three();
        let x = b * e;
        if !x.is_within(-1.0, LARGEST_EXPONENT) {
            return None;
        }
        // w1 of it and w11/2.
        let w1 = n.of(0.5) * mu * (x.exponential() + n.of(1.0));
        let half = n.of(0.5) * b * w1;
        let polynomial = self.polynomial;
        Some(Constants {
            c1: polynomial.c1 + (w1 - n.of(2.0) * half * e),
            c2: polynomial.c2 + half,
            is_linear: false,
            ..polynomial
        })
    }

    /// W_iso + 1/2 kappa (J - 1)^2 [J/m^3]; `None` where a lane has left the range of the law.
    #[inline(always)]
    pub fn energy(&self, state: &Regular<N>, bulk_modulus: N) -> Option<N> {
        let n = state.dj;
        let mut energy = state.energy(&self.polynomial, bulk_modulus);
        if let Some(Exponential { mu, b }) = self.exponential {
            let x = b * state.first_to_all_digits();
            if !x.is_within(-1.0, LARGEST_EXPONENT) {
                return None;
            }
            energy = (n.of(0.5) * mu.over(b)).mul_add(x.exponential(), energy);
        }
        if let Some(powers) = &self.powers {
            energy = energy + state.energy_of_powers(powers)?;
        }
        Some(energy)
    }
}

/// A state and what its stress and its bound share.
#[derive(Debug, Clone, Copy)]
pub struct Regular<N> {
    h: Tensor<N>,
    /// E: diagonal, then yz, zx, xy.
    strain: [N; 6],
    /// cof F - I.
    cofactor_less_one: Tensor<N>,
    /// J - 1, J, J^(-1/3).
    pub dj: N,
    j: N,
    root: N,
    e1: N,
    e2: N,
    /// dj - tr H, and e2 - 2 e1.
    dj_second: N,
    e2_second: N,
}

/// Of two vectors.
#[inline(always)]
pub fn dot<N: Number>(a: [N; 3], b: [N; 3]) -> N {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

#[inline(always)]
fn cross<N: Number>(a: [N; 3], b: [N; 3]) -> [N; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline(always)]
fn largest_of<N: Number>(a: N, b: N, c: N) -> N {
    a.larger(b).larger(c)
}

/// Largest sum of absolute values of a row.
#[inline(always)]
fn largest_row<N: Number>(m: Tensor<N>) -> N {
    largest_of(
        m[0][0].size() + m[0][1].size() + m[0][2].size(),
        m[1][0].size() + m[1][1].size() + m[1][2].size(),
        m[2][0].size() + m[2][1].size() + m[2][2].size(),
    )
}

impl<N: Number> Regular<N> {
    /// The state of H; `None` where a lane has left the range of this file.
    #[inline(always)]
    pub fn new(h: Tensor<N>) -> Option<Self> {
        let cof_h = [cross(h[1], h[2]), cross(h[2], h[0]), cross(h[0], h[1])];
        let trace = h[0][0] + h[1][1] + h[2][2];
        let (cof_trace, determinant) = (cof_h[0][0] + cof_h[1][1] + cof_h[2][2], dot(h[0], cof_h[0]));
        let dj = trace + cof_trace + determinant;
        if !dj.is_within(LEAST_J - 1.0, LARGEST_J - 1.0) {
            return None;
        }
        let one = dj.of(1.0);
        let j = dj + one;
        let two = dj.of(2.0);
        let strain = [
            two.mul_add(h[0][0], dot(h[0], h[0])),
            two.mul_add(h[1][1], dot(h[1], h[1])),
            two.mul_add(h[2][2], dot(h[2], h[2])),
            h[1][2] + h[2][1] + dot(h[1], h[2]),
            h[2][0] + h[0][2] + dot(h[2], h[0]),
            h[0][1] + h[1][0] + dot(h[0], h[1]),
        ];
        let [xx, yy, zz, yz, zx, xy] = strain;
        let e1 = xx + yy + zz;
        let e2_second = (yy * zz - yz * yz) + (zz * xx - zx * zx) + (xx * yy - xy * xy);
        let e2 = two.mul_add(e1, e2_second);
        let mut k = cof_h;
        for a in 0..3 {
            for b in 0..3 {
                k[a][b] = k[a][b] - h[b][a];
            }
            k[a][a] = k[a][a] + trace;
        }
        let (root, dj_second) = (j.inverse_cube_root(), cof_trace + determinant);
        Some(Regular { h, strain, cofactor_less_one: k, dj, j, root, e1, e2, dj_second, e2_second })
    }

    /// J^(-1/3).
    #[inline(always)]
    pub fn root(&self) -> N {
        self.root
    }

    /// H, and E = C - I by diagonal, then yz, zx, xy.
    #[inline(always)]
    pub fn strain(&self) -> (&Tensor<N>, &[N; 6]) {
        (&self.h, &self.strain)
    }

    /// I1bar - 3 = J^(-2/3) (e1 + 3 - 3 J^(2/3)): the strain of a law in which it is no factor of the stress is not small where it matters.
    #[inline(always)]
    fn first_less_three(&self) -> N {
        let n = self.dj;
        self.root * self.root * (self.e1 + n.of(3.0)) - n.of(3.0)
    }

    /// The same to the digits of its own size.
    #[inline(always)]
    fn first_to_all_digits(&self) -> N {
        let (one, two) = (self.dj.of(1.0), self.dj.of(2.0));
        let [d1, less, r2, r] = self.of_shape();
        r2 * (less * less).mul_add(two * r + one, d1)
    }

    /// d1, r - 1, J^(-2/3) and r = J^(1/3).
    #[inline(always)]
    fn of_shape(&self) -> [N; 4] {
        let Regular { h, dj, j, root, .. } = *self;
        let (one, two) = (dj.of(1.0), dj.of(2.0));
        let d1 = dot(h[0], h[0]) + dot(h[1], h[1]) + dot(h[2], h[2]) - two * self.dj_second;
        let r2 = root * root;
        let r = j * r2;
        // r - 1, of r^3 - 1.
        let less = dj.over(r.mul_add(r, r) + one);
        [d1, less, r2, r]
    }

    /// Slopes w1, w2 and w11 of the law.
    #[inline(always)]
    fn slopes(&self, law: &Constants<N>) -> [N; 3] {
        let n = self.dj;
        if law.is_linear {
            return [law.c1, law.c01, n.of(0.0)];
        }
        let e = self.first_less_three();
        let (twice, thrice) = (n.of(2.0) * law.c2, n.of(3.0) * law.c3);
        let w1 = e.mul_add(e.mul_add(thrice, twice), law.c1);
        [w1, law.c01, e.mul_add(n.of(2.0) * thrice, twice)]
    }

    /// cof F.
    #[inline(always)]
    pub fn cofactor(&self) -> Tensor<N> {
        let mut cof = self.cofactor_less_one;
        let one = self.dj.of(1.0);
        for a in 0..3 {
            cof[a][a] = cof[a][a] + one;
        }
        cof
    }

    /// P_iso + p cof F [Pa].
    #[inline(always)]
    pub fn stress(&self, law: &Constants<N>, pressure: N) -> Tensor<N> {
        let Regular { h, cofactor_less_one: k, dj, root, e1, e2, .. } = *self;
        let n = dj;
        let [w1, w2, _] = self.slopes(law);
        let r2 = root * root;
        // 1/(3 J)
        let third = r2 * root * n.of(1.0 / 3.0);
        let first = n.of(2.0) * w1 * r2;
        let s1 = (e1 + n.of(3.0)) * third;
        let one_less = (n.of(3.0) * dj - e1) * third;
        let mut by_h = first;
        let mut by_k = pressure - first * s1;
        let mut by_one = first.mul_add(one_less, pressure);
        let mut p = [[n.of(0.0); 3]; 3];
        if law.has_c01 {
            let second = n.of(2.0) * w2 * r2 * r2;
            let s2 = (e2 + n.of(3.0)) * third * n.of(2.0);
            let two_less = n.of(2.0) * (n.of(3.0) * dj - e2) * third;
            by_h = second.mul_add(n.of(2.0) + e1, by_h);
            by_k = by_k - second * s2;
            by_one = second.mul_add(two_less + e1, by_one);
            // F E = E + H E.
            let [xx, yy, zz, yz, zx, xy] = self.strain;
            let e = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
            for a in 0..3 {
                for b in 0..3 {
                    let he = h[0][b].mul_add(e[a][0], h[1][b].mul_add(e[a][1], h[2][b].mul_add(e[a][2], e[a][b])));
                    p[a][b] = n.of(0.0) - second * he;
                }
            }
        }
        for a in 0..3 {
            for b in 0..3 {
                p[a][b] = h[a][b].mul_add(by_h, k[a][b].mul_add(by_k, p[a][b]));
            }
            p[a][a] = p[a][a] + by_one;
        }
        p
    }

    /// W_iso + 1/2 kappa (J - 1)^2 [J/m^3], to the digits of its own size however small the strain.
    #[inline(always)]
    pub fn energy(&self, law: &Constants<N>, bulk_modulus: N) -> N {
        let Regular { dj, .. } = *self;
        let n = dj;
        let (one, two) = (n.of(1.0), n.of(2.0));
        let [d1, less, r2, r] = self.of_shape();
        let squared = less * less;
        let e = r2 * squared.mul_add(two * r + one, d1);
        let mut w = e * law.c1;
        if !law.is_linear {
            w = e * e.mul_add(e.mul_add(law.c3, law.c2), law.c1);
        }
        if law.has_c01 {
            let e2 = two.mul_add(d1, self.e2_second) - squared * (r * n.of(3.0)).mul_add(r, two * r + one);
            w = (r2 * r2 * e2).mul_add(law.c01, w);
        }
        (n.of(0.5) * bulk_modulus * dj).mul_add(dj, w)
    }

    /// P_iso of powers of the stretches, and its part of the straight bound of the tangent [Pa]; `None` where a lane has left their range.
    #[inline(always)]
    pub fn stress_and_bound_of_powers(&self, powers: &Powers<N>) -> Option<(Tensor<N>, N)> {
        let stretches = Stretches::new(self.strain, powers)?;
        Some(stretches.stress_and_bound(powers, &self.h, &self.cofactor_less_one, self.dj))
    }

    /// W_iso of powers of the stretches [J/m^3]; `None` where a lane has left their range.
    #[inline(always)]
    pub fn energy_of_powers(&self, powers: &Powers<N>) -> Option<N> {
        Some(Stretches::new(self.strain, powers)?.energy(powers, self.dj))
    }

    /// Bound of the isochoric tangent, straight and turned, of `InvariantLaw::tangent_bound` [Pa].
    #[inline(always)]
    pub fn tangent_bound(&self, law: &Constants<N>, bulk_modulus: N) -> [N; 2] {
        let Regular { j, root, dj, .. } = *self;
        let n = dj;
        let [xx, yy, zz, yz, zx, xy] = self.strain;
        let [w1, w2, w11] = self.slopes(law);
        let (i1, i2) = (self.e1 + n.of(3.0), self.e2 + n.of(3.0));
        let r2 = root * root;
        let (a, b, over_j) = (r2, r2 * r2, r2 * root);
        let stiffening = if law.is_linear {
            n.of(0.0)
        } else {
            let by_j = n.of(-2.0 / 3.0) * a * i1 * over_j;
            let squared = n.of(4.0) * a * (a * i1 + n.of(3.0) * by_j * j) + by_j * by_j * i2;
            w11.larger(n.of(0.0)) * squared.larger(n.of(0.0))
        };
        let strain =
            largest_of(xx.size(), yy.size(), zz.size()) + n.of(2.0) * largest_of(yz.size(), zx.size(), xy.size());
        let w = w1.size() + w2.size();
        let small_turned = n.of(8.0 / 3.0) * (w1 + w2 + n.of(6.0) * strain * w);
        let small_straight = n.of(3.2) * strain * w;
        if strain.is_within(0.0, super::invariants::SMALL_STRAIN) {
            return [small_straight + stiffening, small_turned];
        }
        let one = n.of(1.0);
        let c = [[xx + one, xy, zx], [xy, yy + one, yz], [zx, yz, zz + one]];
        let cof = self.cofactor();
        let (gyz, gzx, gxy) = (dot(cof[1], cof[2]), dot(cof[2], cof[0]), dot(cof[0], cof[1]));
        let gram = [[dot(cof[0], cof[0]), gxy, gzx], [gxy, dot(cof[1], cof[1]), gyz], [gzx, gyz, dot(cof[2], cof[2])]];
        let most = largest_row(c).smaller(i1);
        let area = largest_row(gram).smaller(i2).larger(n.of(1e-12));
        let least = (j * j).over(area).smaller(most);
        let middle = (i1 - most - least).larger(least).smaller(most);
        let (fall_a, fall_b) = (n.of(2.0 / 3.0) * a * over_j, n.of(4.0 / 3.0) * b * over_j);
        let c1 = n.of(2.0) * a - n.of(4.0) * fall_a * j;
        let c2 = n.of(2.0) * b - n.of(4.0) * fall_b * j;
        let (by_jj1, by_jj2) = (n.of(5.0 / 3.0) * fall_a * over_j * i1, n.of(7.0 / 3.0) * fall_b * over_j * i2);
        let over_area = one.over(area);
        let none = n.of(0.0);
        let turned =
            w1 * (by_jj1 + c1.smaller(none) * over_area) + w2 * (by_jj2 + c2.smaller(none) * (i1 - most) * over_area);
        let turned = turned.larger(none);
        let [l1, l2, l3] = [most.root(), middle.root(), least.root()];
        let across = largest_of(
            (most - least) * (l2 * l2 * l2),
            (middle - least) * (l1 * l1 * l1),
            (most - middle) * (l3 * l3 * l3),
        );
        let sideways = n.of(2.0) * w1 * a + n.of(2.0) * w2 * b * most;
        let straight = w1.size() * fall_a * (most - least) * l2
            + n.of(1.16) * w2.size() * fall_b * across
            + w1 * c1.larger(none)
            + w2 * c2.larger(none) * (i1 - least)
            + (sideways - (bulk_modulus + turned) * (j * j).over(most.larger(n.of(1e-12)))).larger(none);
        let limit = n.of(super::invariants::SMALL_STRAIN);
        [
            strain.choose(limit, small_straight, straight.larger(none)) + stiffening,
            strain.choose(limit, small_turned, turned),
        ]
    }
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::material::kinematics::{cofactor, jacobian_minus_one};
    use crate::material::law::IsochoricLaw;
    use crate::material::{LAWS, LawWord};

    /// Displacement gradients from tiny to large, all of them in the range.
    fn gradients() -> Vec<DMat3> {
        let mut seed = 0x9e37_79b9_7f4a_7c15u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut vector = move || DVec3::new(random(), random(), random());
        let sizes = [1e-7, 1e-4, 1e-2, 0.05, 0.2, 0.4];
        let all = sizes
            .into_iter()
            .flat_map(|size| [size; 40])
            .map(|size| DMat3::from_cols(vector(), vector(), vector()) * size);
        let within = |h: &DMat3| (LEAST_J - 1.0..LARGEST_J - 1.0).contains(&jacobian_minus_one(*h));
        all.filter(within).collect()
    }

    fn entries(m: DMat3) -> f64 {
        m.to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()))
    }

    #[test]
    fn stress_and_bound_are_those_of_the_laws() {
        const BULK: f64 = 5.0e5;
        let mut known = 0;
        for word in LawWord::ALL {
            let law = (word.law().build)(LAWS[word as usize].example);
            let Some(polynomial) = law.polynomial() else { continue };
            known += 1;
            for h in gradients() {
                let state = Regular::new(h.to_cols_array_2d()).unwrap();
                let p = BULK * jacobian_minus_one(h);
                let exact = law.isochoric_stress(h) + cofactor(DMat3::IDENTITY + h) * p;
                let found = DMat3::from_cols_array_2d(&state.stress(&polynomial.in_lanes(p), p));
                // The laws themselves lose 1e-16 of the modulus to cancellation.
                let allowed = 1e-12 * entries(exact) + 1e-15 * law.shear_modulus() * 10.0;
                assert!(entries(found - exact) < allowed, "{word:?} at {h}: {found} {exact}");
                let energy = law.isochoric_energy(h) + 0.5 * BULK * jacobian_minus_one(h).powi(2);
                let found = state.energy(&polynomial.in_lanes(BULK), BULK);
                // The law itself has its invariants to 1e-15 or so.
                let allowed = 1e-11 * energy + 2e-15 * law.shear_modulus();
                assert!((found - energy).abs() < allowed, "{word:?} at {h}: {found} {energy}");
                // And the derivative of the energy is the stress, at any size of strain.
                let (size, along) = (h.to_cols_array().iter().fold(0.0f64, |a, x| a.max(x.abs())), h);
                let at = |t: f64| {
                    let state = Regular::new((h + along * t).to_cols_array_2d()).unwrap();
                    state.energy(&polynomial.in_lanes(BULK), BULK)
                };
                let slope = (at(1e-4) - at(-1e-4)) / 2e-4;
                let power: f64 = exact.to_cols_array().iter().zip(along.to_cols_array()).map(|(p, h)| p * h).sum();
                assert!((slope - power).abs() < 1e-5 * (power.abs() + energy), "{word:?} {size:e}: {slope} {power}");
                let bound = law.tangent_bound(h, BULK);
                let [straight, turned] = state.tangent_bound(&polynomial.in_lanes(BULK), BULK);
                let close = |a: f64, b: f64| (a - b).abs() <= 1e-11 * (BULK + b.abs());
                assert!(close(straight, bound.straight) && close(turned, bound.turned), "{word:?} at {h}");
            }
        }
        assert_eq!(known, 3);
    }

    #[test]
    fn what_has_left_the_range_is_refused() {
        for stretch in [0.7, -1.0, 1.4, f64::NAN] {
            let h = DMat3::from_diagonal(DVec3::splat(stretch - 1.0));
            assert!(Regular::new(h.to_cols_array_2d()).is_none(), "{stretch}");
        }
    }
}
