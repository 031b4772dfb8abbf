//! Stress against energy, rotations, limits of the laws, closed forms.

use glam::{DMat3, DVec3};
use stylet::material::Mode;
use stylet::material::fit::nominal_stress;
use stylet::material::kinematics::J_CONTINUATION;
use stylet::material::{Continuation, ElasticLaw, Isochoric, Verdict};

use super::*;

/// P by central differences of the energy density.
fn stress_from_energy(law: &ElasticLaw, h: DMat3) -> DMat3 {
    // 1e-6 balances truncation (step^2) and cancellation (1e-16 W / step).
    let step = 1e-6;
    let mut p = DMat3::ZERO;
    for column in 0..3 {
        for row in 0..3 {
            let mut e = DMat3::ZERO;
            e.col_mut(column)[row] = step;
            p.col_mut(column)[row] = (law.energy_density(h + e) - law.energy_density(h - e)) / (2.0 * step);
        }
    }
    p
}

/// Relative error of P against the derivative of the energy of `reference`.
fn derivative_error(law: &ElasticLaw, reference: &ElasticLaw, h: DMat3) -> f64 {
    let expected = stress_from_energy(reference, h);
    largest_entry(law.first_piola_kirchhoff(h) - expected) / largest_entry(expected)
}

/// Stretches of random size with the given product, of either sign.
fn with_jacobian(random: &mut Random, j: f64) -> DMat3 {
    let (a, b) = (random.between(0.6, 1.6), random.between(0.6, 1.6));
    random.with_stretches([a, b, j / (a * b)])
}

fn law(isochoric: Isochoric) -> ElasticLaw {
    ElasticLaw { isochoric, bulk_modulus: 5.0e5 }
}

const JACOBIANS: [f64; 13] = [
    1.0,
    1.4,
    0.9,
    0.6,
    J_CONTINUATION + 1e-3,
    J_CONTINUATION,
    J_CONTINUATION - 1e-3,
    0.2,
    0.05,
    0.0,
    -0.1,
    -0.7,
    -1.5,
];

#[test]
fn the_stress_is_the_derivative_of_the_energy() {
    let mut random = Random::new(1);
    for isochoric in all_laws() {
        let law = law(isochoric);
        for j in JACOBIANS {
            for _ in 0..20 {
                let h = with_jacobian(&mut random, j) - DMat3::IDENTITY;
                let error = derivative_error(&law, &law, h);
                // The third derivative of an exponential law at the cap limits a central difference of 1e-6.
                assert!(error < 1e-6, "{isochoric:?} at J {j}: P differs from dW/dF by {error:.2e}, H {h}");
            }
        }
    }
}

#[test]
fn the_stress_of_extreme_states_is_the_derivative_of_the_energy() {
    // Beyond the cap of the exponential and below the smallest eigenvalue of Ogden's law.
    let mut random = Random::new(2);
    for isochoric in all_laws() {
        let law = law(isochoric);
        for stretches in [[3.0, 0.7, 0.5], [4.0, 4.0, 0.0625], [0.05, 1.2, 1.1], [1e-3, 0.8, 1.5], [-0.05, 2.0, 1.0]] {
            let h = random.with_stretches(stretches) - DMat3::IDENTITY;
            let error = derivative_error(&law, &law, h);
            assert!(error < 1e-5, "{isochoric:?} at {stretches:?}: {error:.2e}");
        }
    }
}

#[test]
fn a_wrong_coefficient_does_not_pass_the_derivative_test() {
    let pairs = [
        (neo_hookean(3300.0), neo_hookean(3303.0)),
        (mooney_rivlin(2300.0, 1000.0), mooney_rivlin(2300.0, 1003.0)),
        (yeoh(2000.0, 900.0, 300.0), yeoh(2000.0, 900.0, 303.0)),
        (ogden(6000.0, 4.0), ogden(6000.0, 4.01)),
        (demiray(1170.0, 6.84), demiray(1170.0, 6.86)),
    ];
    let h = Random::new(3).with_stretches([1.3, 0.9, 0.86]) - DMat3::IDENTITY;
    for (right, wrong) in pairs {
        let error = derivative_error(&law(wrong), &law(right), h);
        assert!(error > 1e-6, "{wrong:?} passes for {right:?}");
    }
}

#[test]
fn rotations_change_nothing() {
    let mut random = Random::new(4);
    for isochoric in all_laws() {
        let law = law(isochoric);
        for j in [1.0, 0.5, 0.1, -0.4] {
            let f = with_jacobian(&mut random, j);
            let (before, after) = (random.rotation(), random.rotation());
            let (w, p) = (law.energy_density(f - DMat3::IDENTITY), law.first_piola_kirchhoff(f - DMat3::IDENTITY));
            let turned = after * f * before - DMat3::IDENTITY;
            assert!((law.energy_density(turned) - w).abs() < 1e-9 * w.abs(), "{isochoric:?}: energy");
            let difference = law.first_piola_kirchhoff(turned) - after * p * before;
            assert!(largest_entry(difference) < 1e-9 * largest_entry(p), "{isochoric:?}: stress");
        }
        let rest = law.first_piola_kirchhoff(random.rotation() - DMat3::IDENTITY);
        assert!(largest_entry(rest) < 1e-9 * law.bulk_modulus, "{isochoric:?}: a rotation alone causes stress");
    }
}

#[test]
fn neutral_constants_give_the_neo_hookean_law() {
    let mut random = Random::new(5);
    let reference = law(neo_hookean(3300.0));
    let limits = [
        (yeoh(3300.0, 0.0, 0.0), 1e-12),
        (mooney_rivlin(3300.0, 0.0), 1e-12),
        (ogden(6600.0, 2.0), 1e-9),
        // The stress of the first order in b: b (I1bar - 3).
        (demiray(6600.0, 1e-9), 1e-6),
    ];
    for (isochoric, tolerance) in limits {
        let near = law(isochoric);
        for j in JACOBIANS {
            let h = with_jacobian(&mut random, j) - DMat3::IDENTITY;
            let (p, expected) = (near.first_piola_kirchhoff(h), reference.first_piola_kirchhoff(h));
            // Ogden's continuation below a stretch of 0.1 is another one than that of the invariants: the same law, as
            // phi(c) = c is its own Taylor polynomial.
            assert!(largest_entry(p - expected) <= tolerance * largest_entry(expected), "{isochoric:?} at J {j}");
        }
        let at_rest = |law: &ElasticLaw| {
            let bound = law.tangent_bound(DMat3::ZERO);
            bound.straight + bound.turned
        };
        assert!((at_rest(&near) / at_rest(&reference) - 1.0).abs() < 1e-6);
    }
}

#[test]
fn small_strains_see_the_shear_modulus() {
    for isochoric in all_laws() {
        let law = law(isochoric);
        let mu = law.shear_modulus();
        let strain = 1e-5;
        let mut shear = DMat3::ZERO;
        shear.y_axis.x = strain;
        let measured = law.first_piola_kirchhoff(shear).y_axis.x / strain;
        assert!((measured / mu - 1.0).abs() < 1e-6, "{isochoric:?}: {measured} against {mu}");
        let volume = law.first_piola_kirchhoff(DMat3::IDENTITY * strain).x_axis.x / (3.0 * strain);
        assert!((volume / law.bulk_modulus - 1.0).abs() < 1e-4, "{isochoric:?}: bulk {volume}");
        let at_rest = law.tangent_bound(DMat3::ZERO);
        let sum = at_rest.straight + at_rest.turned;
        assert!((sum / (4.0 / 3.0 * mu) - 1.0).abs() < 1e-12, "{isochoric:?}: bound at rest {at_rest:?}");
    }
}

/// Nominal stress of the compressible law with free sides, by Newton steps on the side stretch; near incompressible.
fn stress_with_free_sides(isochoric: Isochoric, mode: Mode, x: f64) -> f64 {
    let law = ElasticLaw { isochoric, bulk_modulus: 1e8 * isochoric.shear_modulus() };
    let gradient = |side: f64| match mode {
        Mode::Uniaxial => DMat3::from_diagonal(DVec3::new(x, side, side)),
        Mode::Equibiaxial => DMat3::from_diagonal(DVec3::new(x, x, side)),
        Mode::Planar => DMat3::from_diagonal(DVec3::new(x, 1.0, side)),
        Mode::Shear => DMat3::from_cols(DVec3::X, DVec3::new(x, 1.0, 0.0), DVec3::Z * side),
    };
    let stress = |side: f64| law.first_piola_kirchhoff(gradient(side) - DMat3::IDENTITY);
    let mut side = match mode {
        Mode::Uniaxial => x.powf(-0.5),
        Mode::Equibiaxial => x.powi(-2),
        Mode::Planar => 1.0 / x,
        Mode::Shear => return stress(1.0).y_axis.x,
    };
    for _ in 0..20 {
        let step = 1e-6;
        let slope = (stress(side + step).z_axis.z - stress(side - step).z_axis.z) / (2.0 * step);
        side -= stress(side).z_axis.z / slope;
    }
    stress(side).x_axis.x
}

#[test]
fn closed_forms_of_incompressible_samples_hold() {
    for isochoric in all_laws() {
        for (mode, xs) in [
            (Mode::Uniaxial, vec![0.6, 0.9, 1.1, 1.5]),
            (Mode::Equibiaxial, vec![0.8, 1.1, 1.3]),
            (Mode::Planar, vec![0.7, 1.2, 1.6]),
            (Mode::Shear, vec![-0.3, 0.2, 0.8]),
        ] {
            for x in xs {
                let expected = nominal_stress(&isochoric, mode, x);
                let found = stress_with_free_sides(isochoric, mode, x);
                // The penalty gives way by stress over bulk modulus, 1e-6 at the largest stress of the exponential law, which
                // answers tenfold.
                let tolerance = 3e-4 * expected.abs().max(0.1 * isochoric.shear_modulus());
                assert!(
                    (found - expected).abs() < tolerance,
                    "{isochoric:?}, {mode:?} {x}: {found} against {expected}"
                );
            }
        }
    }
}

/// Textbook forms, apart from the code: Rivlin 1948 (Mooney-Rivlin), Yeoh 1993, Ogden 1972 for alpha = 2 and 4, Demiray 1972.
#[test]
fn closed_forms_agree_with_the_textbook() {
    let close = |a: f64, b: f64| (a - b).abs() < 1e-10 * b.abs();
    let l: f64 = 1.25;
    let (c10, c01) = (2300.0, 1000.0);
    let law = mooney_rivlin(c10, c01);
    assert!(close(nominal_stress(&law, Mode::Uniaxial, l), 2.0 * (1.0 - l.powi(-3)) * (l * c10 + c01)));
    assert!(close(nominal_stress(&law, Mode::Equibiaxial, l), 2.0 * (l - l.powi(-5)) * (c10 + l * l * c01)));
    assert!(close(nominal_stress(&law, Mode::Planar, l), 2.0 * (l - l.powi(-3)) * (c10 + c01)));
    assert!(close(nominal_stress(&law, Mode::Shear, 0.4), 2.0 * 0.4 * (c10 + c01)));
    let i = l * l + 2.0 / l - 3.0;
    let slope = 2000.0 + 2.0 * 900.0 * i + 3.0 * 300.0 * i * i;
    let found = nominal_stress(&yeoh(2000.0, 900.0, 300.0), Mode::Uniaxial, l);
    assert!(close(found, 2.0 * slope * (l - l.powi(-2))));
    let found = nominal_stress(&demiray(1170.0, 6.84), Mode::Uniaxial, l);
    assert!(close(found, 1170.0 * (6.84 * i).exp() * (l - l.powi(-2))));
    let found = nominal_stress(&ogden(6000.0, 4.0), Mode::Equibiaxial, l);
    assert!(close(found, 2.0 * 6000.0 / 4.0 * (l.powi(3) - l.powi(-9))));
    // In simple shear of amount g, l1^4 + l2^4 = (g^2 + 2)^2 - 2: tau = 2 mu/16 d/dg of it.
    let g: f64 = 0.6;
    let found = nominal_stress(&ogden(6000.0, 4.0), Mode::Shear, g);
    assert!(close(found, 2.0 * 6000.0 / 16.0 * 4.0 * g * (g * g + 2.0)));
}

/// A law with constants of any size that are stable for every deformation, and Ogden's with |alpha| below 1, too.
fn random_law(random: &mut Random, kind: usize) -> ElasticLaw {
    let size = 10f64.powf(random.between(2.0, 5.0));
    let part = random.between(0.0, 1.0);
    let sign = if random.between(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
    let isochoric = match kind {
        0 => neo_hookean(size),
        1 => mooney_rivlin(size * part, size * (1.0 - part)),
        2 => yeoh(size, size * random.between(0.0, 2.0), size * part),
        3 => ogden(size, sign * random.between(1.0, 12.0)),
        4 => ogden(size, sign * random.between(0.05, 1.0)),
        _ => demiray(size, 10f64.powf(random.between(-2.0, 1.0))),
    };
    let nu = random.between(0.05, 0.495);
    let bulk_modulus = 2.0 * isochoric.shear_modulus() * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu));
    let law = ElasticLaw { isochoric, bulk_modulus };
    assert!(kind == 4 || law.verdict() == Verdict::Stable, "{law:?}");
    law
}

const KINDS: usize = 6;

/// Stretches down to `least`, some of them equal, some inside out.
fn squeezed(random: &mut Random, least: f64) -> DMat3 {
    let mut stretch = || random.between(least.ln(), 3.0_f64.ln()).exp();
    let [a, b, c] = [stretch(), stretch(), stretch()];
    let mut l = match random.between(0.0, 4.0) as usize {
        0 => [a, a, a],
        1 => [a, a, b],
        _ => [a, b, c],
    };
    if random.between(0.0, 1.0) < 0.3 {
        l[0] = -l[0];
    }
    random.with_stretches(l)
}

#[test]
fn no_state_has_less_energy_than_rest() {
    let mut random = Random::new(21);
    for kind in 0..KINDS {
        for _ in 0..3000 {
            let law = random_law(&mut random, kind);
            let h = squeezed(&mut random, 1e-4) - DMat3::IDENTITY;
            let (iso, all) = (law.isochoric_energy(h), law.energy_density(h));
            // Rounding of a sum of powers near 3.
            let rounding =
                -1e-9 * law.shear_modulus() * law.shear_modulus().max(law.bulk_modulus) / law.shear_modulus();
            assert!(iso >= rounding && iso.is_finite(), "{law:?}: W_iso {iso} at {h}");
            assert!(all >= rounding && all.is_finite(), "{law:?}: W {all} at {h}");
        }
    }
}

#[test]
fn the_stress_of_squeezed_states_is_the_derivative_of_the_energy() {
    let mut random = Random::new(22);
    let mut worst = [0.0_f64; KINDS];
    for (kind, worst) in worst.iter_mut().enumerate() {
        for _ in 0..1000 {
            let law = random_law(&mut random, kind);
            let h = squeezed(&mut random, 0.02) - DMat3::IDENTITY;
            let expected = stress_from_energy(&law, h);
            let found = law.first_piola_kirchhoff(h);
            // What a difference of energies over 2e-6 does not know.
            let noise = 1e-9 * (law.energy_density(h) + law.shear_modulus());
            let error = (largest_entry(found - expected) - noise).max(0.0) / largest_entry(expected);
            assert!(error < 1e-4, "{law:?}: {error:.1e} at {h}");
            *worst = worst.max(error);
        }
    }
    println!("P against dW/dF of squeezed states: {:.1e}", worst.iter().fold(0.0, |a: f64, b| a.max(*b)));
}

#[test]
fn what_is_squeezed_pushes_back() {
    let mut random = Random::new(23);
    for kind in 0..KINDS {
        for _ in 0..300 {
            let law = random_law(&mut random, kind);
            let r = random.rotation();
            // Powers below 2 are continued below a stretch of 0.1, where a point-like cell holds nothing.
            let ends = matches!(law.isochoric, Isochoric::Ogden(l) if l.alpha.abs() < 2.0);
            for s in [0.95, 0.7, 0.5, 0.3, 0.1, 0.03, 0.01, 1e-3].into_iter().filter(|s| !ends || *s >= 0.1) {
                let p = law.first_piola_kirchhoff(r * s - DMat3::IDENTITY);
                let mean = (0..3).map(|i| p.col(i).dot(r.col(i))).sum::<f64>();
                assert!(mean < 0.0, "{law:?} squeezed from all sides to {s}: {mean} Pa");
            }
            // Flat: the traction on the faces that come together.
            let sides = [random.between(0.3, 3.0), random.between(0.3, 3.0)];
            let (q, s) = (random.rotation(), 1e-3);
            let f = r * DMat3::from_diagonal(DVec3::new(sides[0], sides[1], s)) * q;
            let normal = q.transpose() * DVec3::Z;
            let traction = (law.first_piola_kirchhoff(f - DMat3::IDENTITY) * normal).dot(r * DVec3::Z);
            assert!(traction < 0.0, "{law:?} squeezed flat, sides {sides:?}: {traction} Pa");
        }
    }
}

#[test]
fn what_is_small_but_not_flat_obeys_the_law_itself() {
    let mut random = Random::new(24);
    for kind in 0..KINDS {
        for _ in 0..200 {
            let law = random_law(&mut random, kind);
            // The same shape at J = 1 and at J = 0.17.
            let l = [random.between(0.9, 1.1), random.between(0.9, 1.1)];
            let f = random.with_stretches([l[0], l[1], 1.0 / (l[0] * l[1])]);
            let small = law.isochoric_energy(f * 0.17_f64.cbrt() - DMat3::IDENTITY);
            let large = law.isochoric_energy(f - DMat3::IDENTITY);
            assert_eq!(law.continuation(f * 0.17_f64.cbrt() - DMat3::IDENTITY), None);
            assert!((small - large).abs() < 1e-9 * law.shear_modulus(), "{law:?}: {small} {large}");
        }
        let law = random_law(&mut random, kind);
        let flat = DMat3::from_diagonal(DVec3::new(1.0, 1.0, 0.1)) - DMat3::IDENTITY;
        assert!(law.continuation(flat).is_some(), "{law:?}");
    }
    let stretched = DMat3::from_diagonal(DVec3::new(3.0, 0.6, 0.6)) - DMat3::IDENTITY;
    assert_eq!(law(demiray(1000.0, 7.0)).continuation(stretched), Some(Continuation::Exponent));
    assert_eq!(law(neo_hookean(1000.0)).continuation(stretched), None);
}

#[test]
fn ogdens_law_of_minus_two_is_that_of_areas() {
    let mut random = Random::new(25);
    let (near, reference) = (law(ogden(6600.0, -2.0)), law(mooney_rivlin(0.0, 3300.0)));
    for j in JACOBIANS {
        let h = with_jacobian(&mut random, j) - DMat3::IDENTITY;
        let (p, expected) = (near.first_piola_kirchhoff(h), reference.first_piola_kirchhoff(h));
        assert!(largest_entry(p - expected) < 1e-9 * largest_entry(expected), "J {j}: {p} {expected}");
    }
}
