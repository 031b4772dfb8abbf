//! The round hole of [`super::cavity`] in tissue that changes its volume: a shaft of radius R in a hole of rest radius `a`, plane strain,
//! infinite medium. Around a narrow hole the pressure is many times the shear modulus, and tissue of Poisson's ratio 0.47 gives way to it.
//!
//! `U = int 2 pi X W(dr/dX, r/X) dX` with the whole energy of the elastic law, made least by Newton's method over r(X), linear in elements
//! that are even in ln X and taken at their middles; beyond the last node the field `u = c/X` of small strain, `U = 2 pi mu u^2` (it keeps the
//! volume, so it is that of every Poisson's ratio). `N = dU/dR` is the force on the first node.

use glam::DMat3;
use std::f64::consts::PI;

use crate::material::ElasticLaw;
use crate::needle::opening::Growth;

/// Elements, and the outer end over R.
const ELEMENTS: usize = 300;
const OUTER: f64 = 100.0;

/// Where the growth of the tissue around the hole is taken as a whole, over R.
const FAR: f64 = 4.0;

/// Newton steps at most, and the residual that ends them, over (K + 4/3 mu) R: stresses are rounded with their largest part.
const STEPS: usize = 60;
const TOLERANCE: f64 = 3e-9;

/// The opened hole.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenedHole {
    /// Strain energy per length of shaft U [J/m].
    pub energy: f64,
    /// Normal force on the shaft per length N [N/m].
    pub normal_force: f64,
    /// By how much the tissue around it grows.
    pub growth: Growth,
}

/// Principal stresses (first Piola-Kirchhoff, radial and around) at the stretches `l` [Pa].
fn stress(law: &ElasticLaw, l: [f64; 2]) -> [f64; 2] {
    let p = law.first_piola_kirchhoff(strain(l));
    [p.x_axis.x, p.y_axis.y]
}

fn strain(l: [f64; 2]) -> DMat3 {
    DMat3::from_diagonal(glam::DVec3::new(l[0] - 1.0, l[1] - 1.0, 0.0))
}

/// Derivatives of the stresses by the stretches [Pa], by differences.
fn tangent(law: &ElasticLaw, l: [f64; 2]) -> [[f64; 2]; 2] {
    let by = |axis: usize| {
        let step = 1e-5 * l[axis];
        let at = |sign: f64| stress(law, std::array::from_fn(|i| l[i] + if i == axis { sign * step } else { 0.0 }));
        let (plus, minus) = (at(1.0), at(-1.0));
        [(plus[0] - minus[0]) / (2.0 * step), (plus[1] - minus[1]) / (2.0 * step)]
    };
    let (radial, around) = (by(0), by(1));
    let shear = 0.5 * (radial[1] + around[0]);
    [[radial[0], shear], [shear, around[1]]]
}

/// Rest radii of the nodes.
struct Radii(Vec<f64>);

impl Radii {
    fn middle(&self, element: usize) -> (f64, f64) {
        let (a, b) = (self.0[element], self.0[element + 1]);
        (0.5 * (a + b), b - a)
    }

    /// Stretches in an element, radial and around.
    fn stretches(&self, r: &[f64], element: usize) -> [f64; 2] {
        let (middle, long) = self.middle(element);
        [(r[element + 1] - r[element]) / long, 0.5 * (r[element] + r[element + 1]) / middle]
    }

    fn energy(&self, law: &ElasticLaw, r: &[f64]) -> f64 {
        let within: f64 = (0..ELEMENTS)
            .map(|e| {
                let (middle, long) = self.middle(e);
                2.0 * PI * middle * long * law.energy_density(strain(self.stretches(r, e)))
            })
            .sum();
        within + 2.0 * PI * law.shear_modulus() * (r[ELEMENTS] - self.0[ELEMENTS]).powi(2)
    }

    /// How the area within each node changes: its gain is that at four radii of the shaft, half of which lies within `half`.
    fn growth(&self, now: &[f64]) -> Growth {
        let (a, r) = (self.0[0], now[0]);
        let gain = |i: usize| (now[i].powi(2) - self.0[i].powi(2)) / (r * r - a * a) - 1.0;
        let far = self.0.partition_point(|x| *x < FAR * r).min(ELEMENTS);
        let half = (0..far).find(|i| gain(*i) / gain(far) >= 0.5).unwrap_or(far);
        Growth::new(gain(far), a, self.0[half])
    }

    /// Derivatives of the energy by the radii.
    fn forces(&self, law: &ElasticLaw, r: &[f64]) -> Vec<f64> {
        let mut forces = vec![0.0; ELEMENTS + 1];
        for e in 0..ELEMENTS {
            let (middle, long) = self.middle(e);
            let [radial, around] = stress(law, self.stretches(r, e));
            forces[e] += 2.0 * PI * (0.5 * around * long - radial * middle);
            forces[e + 1] += 2.0 * PI * (0.5 * around * long + radial * middle);
        }
        forces[ELEMENTS] += 4.0 * PI * law.shear_modulus() * (r[ELEMENTS] - self.0[ELEMENTS]);
        forces
    }

    /// Newton's step of all radii but the first, which is held; `None` where the energy has no minimum there.
    fn step(&self, law: &ElasticLaw, r: &[f64], forces: &[f64]) -> Option<Vec<f64>> {
        let mut diagonal = vec![0.0; ELEMENTS + 1];
        let mut beside = vec![0.0; ELEMENTS];
        for e in 0..ELEMENTS {
            let (middle, long) = self.middle(e);
            let [[rr, rt], [_, tt]] = tangent(law, self.stretches(r, e));
            let weight = 2.0 * PI * middle * long;
            let (by_r, by_t) = (1.0 / long, 0.5 / middle);
            diagonal[e] += weight * (rr * by_r * by_r - 2.0 * rt * by_r * by_t + tt * by_t * by_t);
            diagonal[e + 1] += weight * (rr * by_r * by_r + 2.0 * rt * by_r * by_t + tt * by_t * by_t);
            beside[e] = weight * (tt * by_t * by_t - rr * by_r * by_r);
        }
        diagonal[ELEMENTS] += 4.0 * PI * law.shear_modulus();
        let mut change: Vec<f64> = forces.iter().map(|f| -f).collect();
        change[0] = 0.0;
        for i in 2..=ELEMENTS {
            let factor = beside[i - 1] / diagonal[i - 1];
            diagonal[i] -= factor * beside[i - 1];
            change[i] -= factor * change[i - 1];
        }
        if diagonal[1..].iter().any(|d| d.is_nan() || *d <= 0.0) {
            return None;
        }
        change[ELEMENTS] /= diagonal[ELEMENTS];
        for i in (1..ELEMENTS).rev() {
            change[i] = (change[i] - beside[i] * change[i + 1]) / diagonal[i];
        }
        Some(change)
    }
}

/// The hole of rest radius `a` opened to the radius `r` of the shaft [m]; `None` where no equilibrium is found.
pub fn opened_hole(law: &ElasticLaw, a: f64, r: f64) -> Option<OpenedHole> {
    if !(a > 0.0 && r > a && r.is_finite()) {
        return None;
    }
    let ratio = (OUTER * r / a).ln() / ELEMENTS as f64;
    let rest = Radii((0..=ELEMENTS).map(|i| a * (ratio * i as f64).exp()).collect());
    // Where it would be without change of volume.
    let mut now: Vec<f64> = rest.0.iter().map(|x| (x * x + r * r - a * a).sqrt()).collect();
    let mut energy = rest.energy(law, &now);
    for _ in 0..STEPS {
        let forces = rest.forces(law, &now);
        let residual = forces[1..].iter().fold(0.0f64, |m, f| m.max(f.abs()));
        if residual < TOLERANCE * law.p_wave_modulus() * r {
            return Some(OpenedHole { energy, normal_force: forces[0], growth: rest.growth(&now) });
        }
        let change = rest.step(law, &now, &forces)?;
        let descent: f64 = change.iter().zip(&forces).skip(1).map(|(c, f)| c * f).sum();
        let (next, value) = (0..40).map(|k| 0.5f64.powi(k)).find_map(|part| {
            let next: Vec<f64> = now.iter().zip(&change).map(|(x, c)| x + part * c).collect();
            let value = rest.energy(law, &next);
            let in_order = next.windows(2).all(|pair| pair[1] > pair[0]);
            // The last steps change the energy by less than it is rounded.
            let falls = value <= energy + 1e-4 * part * descent + 1e-11 * energy;
            (in_order && falls).then_some((next, value))
        })?;
        (now, energy) = (next, value);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::penetration::cavity;

    fn law(mu: f64, nu: f64) -> ElasticLaw {
        ElasticLaw::from_moduli(mu, 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)), 0.7)
    }

    #[test]
    fn without_change_of_volume_it_is_the_closed_answer() {
        let law = law(27e3, 0.499_99);
        let hole = opened_hole(&law, 0.1e-3, 0.8e-3).unwrap();
        let energy = cavity::energy(&law.isochoric, 0.1e-3, 0.8e-3);
        let normal = cavity::normal_force(&law.isochoric, 0.1e-3, 0.8e-3);
        assert!((hole.energy / energy - 1.0).abs() < 2e-3, "{} {energy}", hole.energy);
        assert!((hole.normal_force / normal - 1.0).abs() < 2e-3, "{} {normal}", hole.normal_force);
    }

    #[test]
    fn the_normal_force_is_the_derivative_of_the_energy() {
        let law = law(27e3, 0.47);
        let at = |r: f64| opened_hole(&law, 0.05e-3, r).unwrap();
        let difference = (at(0.801e-3).energy - at(0.799e-3).energy) / 2e-6;
        assert!((at(0.8e-3).normal_force / difference - 1.0).abs() < 1e-4);
        // Of second degree in all lengths, so that N R = 2 U - a dU/da.
        let doubled = opened_hole(&law, 0.1e-3, 1.6e-3).unwrap();
        assert!((doubled.energy / at(0.8e-3).energy - 4.0).abs() < 1e-9);
    }

    #[test]
    fn tissue_around_a_narrow_hole_grows() {
        // Area gained from the hole to four radii, over the hole, and its part within 0.3 R: neo-Hooke, from a program of its own.
        for (nu, gain, near) in [(0.45, 0.076, 0.51), (0.473, 0.048, 0.56), (0.493, 0.016, 0.63)] {
            let bulk = law(27.3e3, nu).bulk_modulus;
            let hole = opened_hole(&ElasticLaw::from_moduli(27.3e3, bulk, 1.0), 0.05, 1.0).unwrap();
            let Growth { gain: found, fall, reach } = hole.growth;
            assert!((found / gain - 1.0).abs() < 0.04, "{nu}: {found} for {gain}");
            let within = 1.0 - fall / (0.09 + reach) / found;
            assert!((within - near).abs() < 0.04, "{nu}: {within} for {near}");
        }
    }

    #[test]
    fn tissue_that_gives_way_presses_less() {
        // A hole of a twentieth of the needle; the answers are those of a collocation of the same equations in another language.
        for (nu, less) in [(0.45, 0.2050), (0.473, 0.1678), (0.493, 0.0949)] {
            let law = law(27.3e3, nu);
            let incompressible = cavity::normal_force(&law.isochoric, 0.05, 1.0);
            let found = 1.0 - opened_hole(&law, 0.05, 1.0).unwrap().normal_force / incompressible;
            assert!((found - less).abs() < 0.002, "{nu}: {found} for {less}");
        }
    }
}
