//! What a wave finds: bound of the tangent for the stable step, verdicts against the acoustic tensor.

use glam::{DMat3, DVec3};
use stylet::material::kinematics::{cofactor, symmetric_eigen};
use stylet::material::{ElasticLaw, Isochoric, Verdict};

use super::*;

/// dP/dF by central differences: `[component of F, column-major]` gives dP.
fn tangent(stress: &dyn Fn(DMat3) -> DMat3, h: DMat3) -> [DMat3; 9] {
    let step = 1e-5;
    std::array::from_fn(|k| {
        let mut e = DMat3::ZERO;
        e.col_mut(k / 3)[k % 3] = step;
        (stress(h + e) - stress(h - e)) * (0.5 / step)
    })
}

/// Acoustic tensor `Q_ij = A_iajb N_a N_b` of a direction in the rest state.
fn acoustic_tensor(tangent: &[DMat3; 9], n: DVec3) -> DMat3 {
    let column = |j: usize| (0..3).map(|b| tangent[3 * b + j] * n * n[b]).sum::<DVec3>();
    DMat3::from_cols(column(0), column(1), column(2))
}

fn eigenvalues(q: DMat3) -> (f64, f64) {
    let (values, _) = symmetric_eigen((q + q.transpose()) * 0.5);
    (values.into_iter().fold(f64::INFINITY, f64::min), values.into_iter().fold(f64::NEG_INFINITY, f64::max))
}

/// Directions spread over a hemisphere, the coordinate axes among them.
fn directions() -> Vec<DVec3> {
    const COUNT: usize = 400;
    let spiral = (0..COUNT).map(|i| {
        let z = 1.0 - (i as f64 + 0.5) / COUNT as f64;
        let angle = i as f64 * 2.399_963_229_728_653;
        DVec3::new((1.0 - z * z).sqrt() * angle.cos(), (1.0 - z * z).sqrt() * angle.sin(), z)
    });
    spiral.chain([DVec3::X, DVec3::Y, DVec3::Z]).collect()
}

fn bulk_from_poisson(isochoric: Isochoric, nu: f64) -> f64 {
    2.0 * isochoric.shear_modulus() * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
}

/// Least, over random states and directions, of `bound / truth` for a law of this Poisson's ratio, where the truth is the
/// stiffest wave and the bound what the stable step takes: kappa |cof F N|^2 and the tangent bound.
fn bound_over_truth(isochoric: Isochoric, nu: f64) -> f64 {
    let mut random = Random::new(7);
    let law = ElasticLaw { isochoric, bulk_modulus: bulk_from_poisson(isochoric, nu) };
    let directions = directions();
    let mut least = f64::INFINITY;
    for _ in 0..150 {
        let stretches = random.stretches((0.8, 1.25));
        let h = random.with_stretches(stretches) - DMat3::IDENTITY;
        let a = tangent(&|h| law.first_piola_kirchhoff(h), h);
        let cof = cofactor(DMat3::IDENTITY + h);
        let bound = law.tangent_bound(h);
        let ratios = directions.iter().map(|n| {
            let truth = eigenvalues(acoustic_tensor(&a, *n)).1;
            ((law.bulk_modulus + bound.turned) * (cof * *n).length_squared() + bound.straight) / truth
        });
        least = ratios.fold(least, f64::min);
    }
    least
}

#[test]
fn the_stable_step_knows_the_stiffness_of_deformed_cells() {
    // At rest the ratio is 1 for every law; differences of the stress have an error of 1e-6.
    for (isochoric, nu) in [
        (neo_hookean(3300.0), 0.3),
        (neo_hookean(3300.0), 0.45),
        (mooney_rivlin(0.0, 3300.0), 0.45),
        (mooney_rivlin(2300.0, 1000.0), 0.3),
        (mooney_rivlin(2300.0, 1000.0), 0.49),
        (yeoh(2000.0, 900.0, 300.0), 0.45),
        (yeoh(2000.0, 900.0, 300.0), 0.49),
        (demiray(5000.0, 0.5), 0.45),
        (demiray(1170.0, 6.84), 0.49),
    ] {
        let least = bound_over_truth(isochoric, nu);
        println!("{isochoric:?}, nu {nu}: kappa and tangent bound over the stiffest wave: at least {least:.3}");
        assert!(least > 0.9999, "{isochoric:?}, nu {nu}: {least}");
    }
}

/// Largest `(a N) : d2W_iso/dF2 : (a N)` over unit vectors, by turns between a and N from several starts.
fn stiffest_wave(law: &ElasticLaw, h: DMat3, random: &mut Random) -> f64 {
    let a = tangent(&|h| law.isochoric_stress(h), h);
    let vector = |q: DMat3| {
        let (values, directions) = symmetric_eigen((q + q.transpose()) * 0.5);
        let largest = if values[0] >= values[1].max(values[2]) { 0 } else { 1 + usize::from(values[2] > values[1]) };
        (directions.col(largest), values[largest])
    };
    // R_ab = A_iajb a_i a_j.
    let turned = |d: DVec3| {
        let entry = |i: usize, b: usize| (0..3).map(|j| d.dot(a[3 * b + j].col(i)) * d[j]).sum::<f64>();
        DMat3::from_cols_array(&std::array::from_fn(|k| entry(k % 3, k / 3)))
    };
    let mut best = f64::NEG_INFINITY;
    for _ in 0..6 {
        let mut n = random.direction();
        let mut value = f64::NEG_INFINITY;
        for _ in 0..60 {
            let (d, _) = vector(acoustic_tensor(&a, n));
            let (next, found) = vector(turned(d));
            n = next;
            if found - value < 1e-8 * found.abs() {
                break;
            }
            value = found;
        }
        best = best.max(value);
    }
    best
}

#[test]
fn the_tangent_bound_of_ogdens_law_is_one_and_no_larger_than_needed() {
    let mut random = Random::new(8);
    for alpha in [-8.0, -3.0, -1.0, 0.5, 1.0, 1.5, 2.0, 4.0, 8.0, 15.0] {
        let law = ElasticLaw { isochoric: ogden(6000.0, alpha), bulk_modulus: 5e5 };
        let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
        for _ in 0..60 {
            let stretches = random.stretches((0.8, 1.25));
            let h = random.with_stretches(stretches) - DMat3::IDENTITY;
            let ratio = law.tangent_bound(h).straight / stiffest_wave(&law, h, &mut random);
            least = least.min(ratio);
            largest = largest.max(ratio);
        }
        println!("alpha {alpha}: bound over the stiffest wave {least:.4}..{largest:.3}");
        // Central differences and the search for the direction are good to 1e-3.
        assert!(least > 0.999 && largest < 5.0, "alpha {alpha}: {least}..{largest}");
    }
}

/// Largest wave of a cell over directions, truth and bound: kappa and the tangent bound, of states with J in a range.
fn squeezed_bound_over_truth(isochoric: Isochoric, nu: f64, jacobians: &[f64]) -> f64 {
    let mut random = Random::new(17);
    let law = ElasticLaw { isochoric, bulk_modulus: bulk_from_poisson(isochoric, nu) };
    let directions = directions();
    let mut least = f64::INFINITY;
    for j in jacobians {
        for _ in 0..25 {
            let sides = [random.between(0.4, 1.8), random.between(0.4, 1.8)];
            let h = random.with_stretches([sides[0], sides[1], j / (sides[0] * sides[1])]) - DMat3::IDENTITY;
            let a = tangent(&|h| law.first_piola_kirchhoff(h), h);
            let cof = cofactor(DMat3::IDENTITY + h);
            let bound = law.tangent_bound(h);
            // As in the element stage: the largest of both parts apart.
            let turned = directions.iter().map(|n| (cof * *n).length_squared()).fold(0.0, f64::max);
            let bound = (law.bulk_modulus + bound.turned) * turned + bound.straight;
            let truth = directions.iter().map(|n| eigenvalues(acoustic_tensor(&a, *n)).1).fold(0.0, f64::max);
            least = least.min(bound / truth);
        }
    }
    least
}

#[test]
fn the_stable_step_knows_the_stiffness_of_flat_and_inverted_cells() {
    let mut all = Vec::new();
    for isochoric in all_laws().into_iter().chain([-8.0, -4.0, -1.0, 1.0, 8.0].map(|alpha| ogden(6000.0, alpha))) {
        for nu in [0.3, 0.45] {
            let flat = squeezed_bound_over_truth(isochoric, nu, &[0.299, 0.25, 0.15, 0.08, 0.03, 0.01]);
            let inverted = squeezed_bound_over_truth(isochoric, nu, &[-0.01, -0.1, -0.5, -1.0]);
            println!("{isochoric:?}, nu {nu}: bound over the stiffest wave: flat {flat:.3}, inverted {inverted:.3}");
            all.push((isochoric, nu, flat.min(inverted)));
        }
    }
    for (isochoric, nu, least) in all {
        assert!(least > 0.7, "{isochoric:?}, nu {nu}: {least}");
    }
}

/// The stiffening term alone: what the bound of a law of I1bar has beyond that of its slope.
#[test]
fn the_stiffening_term_bounds_the_gradient_of_the_invariant() {
    let mut random = Random::new(9);
    // W = c20 (I1bar - 3)^2, so that w11 = 2 c20, at any J above the continuation.
    let c20 = 1000.0;
    let law = ElasticLaw { isochoric: yeoh(0.0, c20, 0.0), bulk_modulus: 1e5 };
    for _ in 0..200 {
        let stretches = random.stretches((0.4, 3.0));
        let h = random.with_stretches(stretches) - DMat3::IDENTITY;
        let l = DVec3::from(stretches);
        let (j, i1) = (l.x * l.y * l.z, l.length_squared());
        let e = j.powf(-2.0 / 3.0) * i1 - 3.0;
        // What a law with this slope and no stiffening has.
        let plain = ElasticLaw { isochoric: neo_hookean(2.0 * c20 * e), ..law };
        let stiffening = law.tangent_bound(h).straight - plain.tangent_bound(h).straight;
        // The bound adds the squares of all three, of which the largest is at least a third.
        // The gradient of I1bar by the stretches: 2 a (l_i - I1/(3 l_i)); the stiffest rank-one motion is along an axis.
        let gradient = stretches.map(|l| (2.0 * j.powf(-2.0 / 3.0) * (l - i1 / (3.0 * l))).powi(2));
        let truth = 2.0 * c20 * gradient.iter().cloned().fold(0.0, f64::max);
        assert!(stiffening >= truth * (1.0 - 1e-9), "{stretches:?}: {stiffening} below {truth}");
        assert!(stiffening <= 3.0 * truth + 1e-6, "{stretches:?}: {stiffening} far above {truth}");
    }
}

/// Least eigenvalue of the acoustic tensor over isochoric states whose stretches keep to the limit by `factor`, over mu0.
/// `from_below`: the limit is the largest stretch, else the smallest.
fn least_over_states(isochoric: Isochoric, limit: f64, factor: f64, from_below: bool) -> f64 {
    // Bulk over shear modulus 1e5: pressure waves out of the question, as in the incompressible solid of the verdict.
    let law = ElasticLaw { isochoric, bulk_modulus: 1e5 * isochoric.shear_modulus() };
    let directions = directions();
    let extreme = limit * factor;
    let mut least = f64::INFINITY;
    // Growing from rest, so that a law that recovers beyond its limit is caught, too.
    for part in [0.25, 0.5, 0.75, 0.9, 1.0] {
        let first = extreme.powf(part);
        for state in 0..=12 {
            let other = first.powf(-0.5 + 1.5 * f64::from(state) / 12.0);
            let stretches = [first, other, 1.0 / (first * other)];
            // In axes of the stretches; the directions cover the sphere.
            let h = DMat3::from_diagonal(DVec3::from(stretches)) - DMat3::IDENTITY;
            debug_assert!(from_below == (first > 1.0));
            let a = tangent(&|h| law.first_piola_kirchhoff(h), h);
            let weakest =
                directions.iter().map(|n| eigenvalues(acoustic_tensor(&a, *n)).0).fold(f64::INFINITY, f64::min);
            least = least.min(weakest);
        }
        // The weakest direction of a plane motion lies in the plane of the largest and the smallest stretch.
        let other = first;
        let h = DMat3::from_diagonal(DVec3::new(first, other, 1.0 / (first * other))) - DMat3::IDENTITY;
        let a = tangent(&|h| law.first_piola_kirchhoff(h), h);
        for i in 0..360 {
            let angle = f64::from(i) * std::f64::consts::PI / 360.0;
            let n = DVec3::new(angle.cos(), 0.0, angle.sin());
            least = least.min(eigenvalues(acoustic_tensor(&a, n)).0);
        }
    }
    least / isochoric.shear_modulus()
}

#[test]
fn limits_of_stability_are_those_of_the_acoustic_tensor() {
    for isochoric in [
        mooney_rivlin(2000.0, -1000.0),
        mooney_rivlin(-1000.0, 4000.0),
        yeoh(1000.0, -50.0, 0.0),
        yeoh(1000.0, -300.0, 40.0),
        yeoh(1000.0, 200.0, -20.0),
        yeoh(1000.0, 0.0, -5.0),
        ogden(6000.0, 0.2),
        ogden(6000.0, 0.5),
        ogden(6000.0, 0.8),
        ogden(6000.0, -0.5),
        ogden(6000.0, -0.8),
    ] {
        let (limit, inside, outside, below) = match isochoric.verdict() {
            Verdict::StableBelow(limit) => (limit, 0.98, 1.05, true),
            Verdict::StableAbove(limit) => (limit, 1.02, 0.95, false),
            verdict => panic!("{isochoric:?}: {verdict:?}"),
        };
        let (stable, unstable) =
            (least_over_states(isochoric, limit, inside, below), least_over_states(isochoric, limit, outside, below));
        println!("{isochoric:?}: limit {limit:.4}, weakest wave over mu0 {stable:.2e} inside, {unstable:.2e} outside");
        assert!(stable > 0.0, "{isochoric:?}: unstable 2 % inside the limit {limit}: {stable}");
        assert!(unstable < 0.0, "{isochoric:?}: stable 5 % outside the limit {limit}: {unstable}");
    }
}

#[test]
fn stable_laws_have_real_waves_in_random_states() {
    let mut random = Random::new(10);
    let directions = directions();
    for isochoric in [
        neo_hookean(3300.0),
        mooney_rivlin(2300.0, 1000.0),
        yeoh(2000.0, 900.0, 300.0),
        yeoh(2000.0, -100.0, 100.0),
        ogden(6000.0, 1.0),
        ogden(6000.0, -1.0),
        ogden(6000.0, 9.0),
        ogden(6000.0, -9.0),
        demiray(1170.0, 6.84),
    ] {
        assert_eq!(isochoric.verdict(), Verdict::Stable, "{isochoric:?}");
        let law = ElasticLaw { isochoric, bulk_modulus: 1e4 * isochoric.shear_modulus() };
        for _ in 0..40 {
            let stretches = random.stretches((1.0, 1.0));
            let h = random.with_stretches(stretches) - DMat3::IDENTITY;
            let a = tangent(&|h| law.first_piola_kirchhoff(h), h);
            for n in &directions {
                let weakest = eigenvalues(acoustic_tensor(&a, *n)).0;
                assert!(weakest > 0.0, "{isochoric:?} at {stretches:?}, direction {n}: {weakest}");
            }
        }
    }
}

#[test]
fn constants_that_are_no_law_are_unstable() {
    for isochoric in [
        neo_hookean(0.0),
        neo_hookean(-1.0),
        neo_hookean(f64::INFINITY),
        mooney_rivlin(4750.0, -4910.0),
        mooney_rivlin(f64::NAN, 1.0),
        yeoh(-1.0, 10.0, 10.0),
        yeoh(0.0, 10.0, 10.0),
        ogden(0.0, 2.0),
        ogden(1000.0, 0.0),
        ogden(-1000.0, -2.0),
        demiray(1000.0, 0.0),
        demiray(1000.0, f64::INFINITY),
    ] {
        assert_eq!(isochoric.verdict(), Verdict::Unstable, "{isochoric:?}");
    }
    let law = ElasticLaw { isochoric: neo_hookean(1000.0), bulk_modulus: -1.0 };
    assert_eq!(law.verdict(), Verdict::Unstable);
}
