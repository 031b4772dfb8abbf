//! Ogden's law with a positive exponent where a cell keeps most of its volume, for any [`Number`]: the same equations as `ogden`, written in
//! E = C - I and H = F - I, so that f32 keeps its digits at small strain. With `E = sum_i e_i N_i (x) N_i` and `p = alpha/2`:
//! ```text
//! g_i = p ((1 + e_i)^(p-1) - 1),  s = sum_i ((1 + e_i)^p - 1),  G = sum_i g_i N_i (x) N_i,  m = alpha/3
//! P_iso = 2 mu/alpha^2 J^-m (2 G + 2 H G + alpha (H - K/J + (J - 1)/J I) - m s/J (I + K)),    K = cof F - I
//! ```
//! The stretches are found by Jacobi's rotations of E: eigenvalues that lie close to one another cost no digits.

// Adapters of iterators are not inlined into functions for a vector unit: each operation becomes a call.
#![allow(clippy::needless_range_loop)]

use crate::number::{Number, Tensor};

/// Least eigenvalue of E for which these forms hold: `ogden` is continued below some.
const LEAST_STRAIN: f64 = -0.98;
/// Largest eigenvalue of E, and largest logarithm of a power: f32 loses as many units of its last digit.
const LARGEST_STRAIN: f64 = 50.0;
const LARGEST_LOGARITHM: f64 = 10.0;
/// Rounds of three rotations: the entries beside the diagonal are lost in rounding after three at most.
const ROUNDS: usize = 4;

/// `W_iso = 2 mu/alpha^2 (sum of isochoric stretches^alpha - 3)`: shear modulus [Pa] and exponent, the same in every lane, or another in each; a lane
/// of another law has mu = 0 and any exponent.
#[derive(Debug, Clone, Copy)]
pub struct Powers<N> {
    pub mu: N,
    pub alpha: N,
}

/// The stretches of a state.
#[derive(Debug, Clone, Copy)]
pub struct Stretches<N> {
    /// Eigenvalues of E, and their directions.
    strain: [N; 3],
    directions: Tensor<N>,
}

/// Eigenvalues and eigenvectors of a symmetric tensor: diagonal, then yz, zx, xy.
#[inline(always)]
fn eigen<N: Number>([xx, yy, zz, yz, zx, xy]: [N; 6]) -> ([N; 3], Tensor<N>) {
    let (zero, one, two) = (xx.of(0.0), xx.of(1.0), xx.of(2.0));
    // What is no rotation divides zero by this.
    let tiny = xx.of(1e-30);
    let mut a = [[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]];
    let mut n = [[one, zero, zero], [zero, one, zero], [zero, zero, one]];
    for _ in 0..ROUNDS {
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let twice = two * a[i][j];
            let difference = a[j][j] - a[i][i];
            let sign = difference.choose(zero, zero - one, one);
            let length = difference.mul_add(difference, twice * twice).root();
            // Tangent, cosine and sine of the smaller of both rotations.
            let t = (sign * twice).over(difference.size() + length + tiny);
            let c = one.over(t.mul_add(t, one).root());
            let s = t * c;
            let moved = t * a[i][j];
            a[i][i] = a[i][i] - moved;
            a[j][j] = a[j][j] + moved;
            a[i][j] = zero;
            a[j][i] = zero;
            let (ki, kj) = (a[k][i], a[k][j]);
            let (of_i, of_j) = (c * ki - s * kj, s.mul_add(ki, c * kj));
            (a[k][i], a[i][k], a[k][j], a[j][k]) = (of_i, of_i, of_j, of_j);
            for row in 0..3 {
                let (at_i, at_j) = (n[i][row], n[j][row]);
                n[i][row] = c * at_i - s * at_j;
                n[j][row] = s.mul_add(at_i, c * at_j);
            }
        }
    }
    ([a[0][0], a[1][1], a[2][2]], n)
}

impl Powers<f64> {
    /// In every lane of a number of the kind of `n`.
    #[inline(always)]
    pub fn in_lanes<N: Number>(&self, n: N) -> Powers<N> {
        Powers { mu: n.of(self.mu), alpha: n.of(self.alpha) }
    }
}

impl<N: Number> Stretches<N> {
    /// Those of E: diagonal, then yz, zx, xy; `None` where a lane has left the range of this file.
    #[inline(always)]
    pub fn new(strain: [N; 6], powers: &Powers<N>) -> Option<Self> {
        let (strain, directions) = eigen(strain);
        for i in 0..3 {
            let e = strain[i];
            if !e.is_within(LEAST_STRAIN, LARGEST_STRAIN)
                || !(powers.alpha * e.logarithm()).is_within(-2.0 * LARGEST_LOGARITHM, 2.0 * LARGEST_LOGARITHM)
            {
                return None;
            }
        }
        Some(Stretches { strain, directions })
    }

    /// P_iso [Pa] of H with K and J - 1, and the largest second derivative of W_iso by one stretch [Pa], which bounds the tangent.
    #[inline(always)]
    pub fn stress_and_bound(&self, powers: &Powers<N>, h: &Tensor<N>, k: &Tensor<N>, dj: N) -> (Tensor<N>, N) {
        let n = dj;
        let (zero, one, two, four) = (n.of(0.0), n.of(1.0), n.of(2.0), n.of(4.0));
        let Powers { mu, alpha } = *powers;
        let p = alpha * n.of(0.5);
        let m = alpha * n.of(1.0 / 3.0);
        let logarithms = [self.strain[0].logarithm(), self.strain[1].logarithm(), self.strain[2].logarithm()];
        let mut g = [zero; 3];
        let mut s = zero;
        for i in 0..3 {
            s = s + (p * logarithms[i]).exponential();
            g[i] = p * ((p - one) * logarithms[i]).exponential();
        }
        let over_j = one.over(dj + one);
        let by_s = one + (zero - m * dj.logarithm()).exponential();
        let factor = two * mu.over(alpha * alpha) * by_s;
        // G, and 2 G + 2 H G.
        let mut of_g = [[zero; 3]; 3];
        for a in 0..3 {
            for b in 0..=a {
                let mut sum = zero;
                for i in 0..3 {
                    sum = (g[i] * self.directions[i][a]).mul_add(self.directions[i][b], sum);
                }
                of_g[a][b] = sum;
                of_g[b][a] = sum;
            }
        }
        let by_k = m * s * over_j;
        let by_one = alpha * dj * over_j - by_k;
        let by_k = by_k + alpha * over_j;
        let mut stress = [[zero; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                let hg =
                    h[0][b].mul_add(of_g[a][0], h[1][b].mul_add(of_g[a][1], h[2][b].mul_add(of_g[a][2], of_g[a][b])));
                stress[a][b] = two.mul_add(hg, alpha * h[a][b] - by_k * k[a][b]);
            }
            stress[a][a] = stress[a][a] + by_one;
            for b in 0..3 {
                stress[a][b] = factor * stress[a][b];
            }
        }
        // 2 phi' + 4 c phi'' - 4 m phi' + m (m + 1) S/c.
        let of_slope = two + four * (p - one) - four * m;
        let of_sum = m * (m + one) * (n.of(3.0) + s);
        let mut largest = zero;
        for i in 0..3 {
            let along = (p + g[i]).mul_add(of_slope, of_sum.over(one + self.strain[i]));
            largest = largest.larger(along);
        }
        (stress, factor * largest)
    }
}

impl<N: Number> Stretches<N> {
    /// W_iso [J/m^3] with J - 1, to the digits of its own size however small the strain: with the logarithms x_i of the eigenvalues of C, whose
    /// sum is 2 ln J,
    /// ```text
    /// M - 3 = alpha ln J (J^-m - 1) + J^-m sum_i psi(alpha x_i/2) + 3 psi(-m ln J),   psi(x) = exp(x) - 1 - x
    /// ```
    #[inline(always)]
    pub fn energy(&self, powers: &Powers<N>, dj: N) -> N {
        let n = dj;
        let Powers { mu, alpha } = *powers;
        let p = alpha * n.of(0.5);
        let of_j = dj.logarithm();
        let falling = n.of(-1.0 / 3.0) * alpha * of_j;
        let by_s_less_one = falling.exponential();
        let mut sum = n.of(0.0);
        for i in 0..3 {
            sum = sum + beyond_linear(p * self.strain[i].logarithm());
        }
        let volume = (alpha * of_j).mul_add(by_s_less_one, n.of(3.0) * beyond_linear(falling));
        n.of(2.0) * mu.over(alpha * alpha) * (by_s_less_one + n.of(1.0)).mul_add(sum, volume)
    }
}

/// `exp(x) - 1 - x`, by its series where x is small.
#[inline(always)]
fn beyond_linear<N: Number>(x: N) -> N {
    let mut sum = x.of(1.0 / 10.0);
    let mut degree = 9;
    while degree > 1 {
        // 1/degree (1 + x ...)
        sum = (x * sum + x.of(1.0)) * x.of(1.0 / f64::from(degree));
        degree -= 1;
    }
    x.size().choose(x.of(0.5), x * x * sum, x.exponential() - x)
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DVec3};

    use super::*;
    use crate::material::kinematics::jacobian_minus_one;
    use crate::material::law::IsochoricLaw;
    use crate::material::ogden::Ogden;
    use crate::material::regular::{LARGEST_J, LEAST_J, Polynomial, Regular};

    /// Displacement gradients of any size: of all kinds, with two and three equal stretches, and of rank one.
    fn gradients() -> Vec<DMat3> {
        let mut seed = 0x9e37_79b9_7f4a_7c15u64;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        };
        let mut vector = move || DVec3::new(random(), random(), random());
        let mut all = vec![DMat3::ZERO];
        for size in [1e-7, 1e-4, 1e-2, 0.05, 0.2, 0.4] {
            for _ in 0..20 {
                let (a, b, c) = (vector() * size, vector(), vector() * size);
                all.push(DMat3::from_cols(a, b * size, c));
                all.push(DMat3::from_diagonal(DVec3::new(a.x, a.x, a.x * (1.0 + 1e-9))));
                all.push(DMat3::from_cols(a * b.x, a * b.y, a * b.z));
            }
        }
        let within = |h: &DMat3| (LEAST_J - 1.0..LARGEST_J - 1.0).contains(&jacobian_minus_one(*h));
        all.retain(within);
        all
    }

    fn entries(m: DMat3) -> f64 {
        m.to_cols_array().iter().fold(0.0, |most: f64, x| most.max(x.abs()))
    }

    #[test]
    fn stress_and_bound_are_those_of_ogden() {
        const MU: f64 = 6600.0;
        let mut compared = 0;
        for alpha in [0.6, 1.0, 2.0, 3.7, 6.5, 16.55, -0.6, -1.0, -2.0, -5.0, -12.0] {
            let law = Ogden { mu: MU, alpha };
            let powers = IsochoricLaw::powers(&law).unwrap();
            for h in gradients() {
                let state = Regular::new(h.to_cols_array_2d()).unwrap();
                let Some((found, bound_found)) = state.stress_and_bound_of_powers(&powers) else { continue };
                compared += 1;
                let (exact, bound) = (law.isochoric_stress(h), law.tangent_bound(h, 0.0));
                let found = DMat3::from_cols_array_2d(&found);
                // The law itself loses digits of the modulus to cancellation, and more where its stretches lie close.
                let allowed = 1e-10 * entries(exact) + 1e-11 * MU;
                assert!(entries(found - exact) < allowed, "alpha {alpha} at {h}: {found} {exact}");
                assert!(
                    (bound_found / bound.straight - 1.0).abs() < 1e-9,
                    "alpha {alpha} at {h}: {bound_found} {bound:?}"
                );
                assert_eq!(bound.turned, 0.0);
                let energy = law.isochoric_energy(h);
                let found = state.energy_of_powers(&powers).unwrap();
                // The series ends where f32 does, and what volume alone makes of its terms cancels.
                let allowed = 1e-10 * energy + 1e-11 * MU;
                assert!((found - energy).abs() < allowed, "alpha {alpha} at {h}: energy {found} {energy}");
            }
        }
        assert!(compared > 1500, "{compared} states");
    }

    #[test]
    fn what_polynomials_leave_out_is_nothing_and_the_rest_is_refused() {
        let h = DMat3::from_diagonal(DVec3::new(0.4, -0.1, 0.1));
        let state = Regular::new(h.to_cols_array_2d()).unwrap();
        // A lane of another law.
        let none = Powers { mu: 0.0, alpha: 2.0 };
        assert_eq!(state.stress_and_bound_of_powers(&none), Some(([[0.0; 3]; 3], 0.0)));
        assert_eq!(state.tangent_bound(&Polynomial::default().in_lanes(0.0), 5e5), [0.0; 2]);
        // 1.96^15 is beyond e^10.
        assert!(state.stress_and_bound_of_powers(&Powers { mu: 1.0, alpha: 31.0 }).is_none());
        assert_eq!(state.energy_of_powers(&none), Some(0.0));
    }
}
