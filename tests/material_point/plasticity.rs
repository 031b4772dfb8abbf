//! Plasticity: the closed form of uniaxial loading, shear, hard cases, energy.

use stylet::effects::plasticity::{Params, State, elastic_gradient, return_mapping};
use stylet::material::{deviator, equivalent};
use stylet::material_test::Sample;

use super::*;

fn plastic(law: ElasticLaw, yield_stress: f64, hardening: f64) -> Material {
    Material { plasticity: Some(Params { yield_stress, hardening }), ..elastic(law) }
}

/// Goes to a stretch in equal logarithmic steps, sides free.
fn pull(sample: &mut Sample, stretch: f64, steps: usize) {
    let start = 1.0 + sample.displacement_gradient.x_axis.x;
    for i in 1..=steps {
        let l = start * (stretch / start).powf(i as f64 / steps as f64);
        sample.step(stretched(l), &LATERAL, 0.0).unwrap();
    }
}

/// Kirchhoff stress along x [Pa].
fn tau(sample: &Sample) -> f64 {
    sample.cauchy().x_axis.x * sample.jacobian()
}

/// Equivalent Kirchhoff stress of a point.
fn kirchhoff_equivalent(sample: &Sample) -> f64 {
    let p = sample.stress * (DMat3::IDENTITY + sample.displacement_gradient).transpose();
    equivalent(deviator(p))
}

/// Largest relative errors against the reference: of alpha (absolute), tau, P, lateral stretch, and of the unloaded
/// state: stress over yield stress, lateral stretch.
fn uniaxial_errors(leg: &str, hardening: f64) -> [f64; 6] {
    let case = &reference("06_plastic_uniaxial.json")["cases"]["hard"];
    let material = plastic(MATERIAL_A, number(case, "sigma_y_Pa"), hardening);
    let mut sample = Sample::new(&material, 1e-3);
    let mut worst = [0.0f64; 6];
    let rows = case[leg].as_array().unwrap();
    assert!(rows.len() > 10);
    for row in rows {
        let value = |key| number(row, key);
        pull(&mut sample, value("lam"), 20);
        let mut unloaded = sample.clone();
        pull(&mut unloaded, value("lam_after_unload"), 10);
        let lateral = 1.0 + sample.displacement_gradient.y_axis.y;
        let errors = [
            sample.state.plastic.alpha - value("alpha"),
            tau(&sample) / value("tau11_Pa") - 1.0,
            sample.stress.x_axis.x / value("P11_Pa") - 1.0,
            lateral / value("lam_lateral") - 1.0,
            unloaded.stress.x_axis.x / number(case, "sigma_y_Pa"),
            // Without stress there is no elastic strain: the volume is that at rest.
            unloaded.jacobian() - 1.0,
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error.abs());
        }
    }
    worst
}

#[test]
fn uniaxial_loading_meets_the_closed_form() {
    let hardening = number(&reference("06_plastic_uniaxial.json")["cases"]["hard"], "H_Pa");
    for leg in ["tension", "compression"] {
        let worst = uniaxial_errors(leg, hardening);
        println!("{leg}: alpha, tau, P, lateral, unloaded stress, unloaded J: {worst:?}");
        // The file has twelve digits; the elastic slope turns its last digit of a stretch into 1e-10 of stress.
        assert!(worst.iter().all(|w| *w < 1e-9), "{worst:?}");
        let wrong = uniaxial_errors(leg, 1.001 * hardening);
        assert!(wrong[0] > 1e-5 && wrong[1] > 1e-5, "{wrong:?}");
    }
}

#[test]
fn reverse_yield_begins_at_the_hardened_stress() {
    let material = plastic(MATERIAL_A, 6000.0, 8000.0);
    let mut sample = Sample::new(&material, 1e-3);
    pull(&mut sample, 2.0, 50);
    let alpha = sample.state.plastic.alpha;
    pull(&mut sample, alpha.exp(), 10);
    assert_eq!(sample.state.plastic.alpha, alpha);
    // Bisection for the stretch at which flow begins again.
    let (mut flows, mut rests) = (0.5 * alpha.exp(), alpha.exp());
    for _ in 0..50 {
        let middle = 0.5 * (flows + rests);
        let mut trial = sample.clone();
        pull(&mut trial, middle, 1);
        *if trial.state.plastic.alpha > alpha { &mut flows } else { &mut rests } = middle;
    }
    pull(&mut sample, rests, 1);
    let expected = -(6000.0 + 8000.0 * alpha);
    assert!((tau(&sample) / expected - 1.0).abs() < 1e-9, "{} {expected}", tau(&sample));
    // Kinematic hardening would flow at tau - 2 sigma_y.
    assert!((tau(&sample) / (8000.0 * alpha - 6000.0) - 1.0).abs() > 0.1);
}

#[test]
fn perfect_plasticity_and_very_low_yield_hold_their_stress() {
    for (yield_stress, hardening) in [(6000.0, 0.0), (1.0, 0.0), (1e-3, 0.0), (1.0, 1000.0), (1e-3, 1e5)] {
        for stretch in [3.0, 0.4] {
            let material = plastic(MATERIAL_A, yield_stress, hardening);
            let mut sample = Sample::new(&material, 1e-3);
            pull(&mut sample, stretch, 200);
            let alpha = sample.state.plastic.alpha;
            let expected = (yield_stress + hardening * alpha).copysign(stretch - 1.0);
            let error = (tau(&sample) / expected - 1.0).abs();
            println!("yield {yield_stress} Pa, H {hardening} Pa, stretch {stretch}: {error:.1e}");
            // tau of a free sample contains the lateral residual, 1e-13 of the bulk modulus: 1e-4 of a yield stress of 1 mPa.
            assert!(error < 1e-9 + 1e-6 / yield_stress, "{error}");
            if yield_stress <= 1.0 && hardening == 0.0 {
                // Nothing is elastic: all strain is plastic.
                assert!((alpha / stretch.ln().abs() - 1.0).abs() < 1e-3);
            }
        }
    }
}

#[test]
fn one_step_and_a_thousand_end_alike() {
    for stretch in [3.0, 1.5, 0.4] {
        let material = plastic(MATERIAL_A, 6000.0, 8000.0);
        let (mut one, mut many) = (Sample::new(&material, 1e-3), Sample::new(&material, 1e-3));
        pull(&mut one, stretch, 1);
        pull(&mut many, stretch, 1000);
        let error = (one.stress.x_axis.x / many.stress.x_axis.x - 1.0).abs();
        let strain = (one.state.plastic.alpha - many.state.plastic.alpha).abs();
        println!("stretch {stretch}: stress {error:.1e}, plastic strain {strain:.1e}");
        assert!(error < 1e-8 && strain < 1e-9);
    }
}

#[test]
fn a_huge_step_converges_or_is_flagged() {
    let mut random = Random(7);
    let (mut converged, mut flagged) = (0, 0);
    for i in 0..2000 {
        let law = [MATERIAL_A, ACROSS_FIBRE][i % 2];
        let params = Params { yield_stress: 10f64.powf(1.0 + 4.0 * random.signed()), hardening: 8000.0 };
        let h = random.tensor() * (3.0 * random.signed().abs()).exp();
        let mut state = State::default();
        let flow = return_mapping(&law, &params, h, &mut state);
        let he = elastic_gradient(h, &state);
        let mandel = (DMat3::IDENTITY + he).transpose() * law.isochoric_stress(he);
        let q = equivalent(deviator((mandel + mandel.transpose()) * 0.5));
        let f = q - params.yield_stress - params.hardening * state.alpha;
        if flow.failed {
            flagged += 1;
        } else {
            converged += 1;
            assert!(f < 1.1e-6 * params.yield_stress, "f {f} of {params:?} for {h}");
            assert!(flow.increment >= 0.0 && flow.dissipation >= 0.0);
        }
    }
    println!("converged {converged}, flagged {flagged}");
    assert!(converged > 1000);
    // Within the range of tissue no step at once fails: stretches from 0.3 to 3, rotated, with any change of volume.
    for i in 0..2000 {
        let law = [MATERIAL_A, ACROSS_FIBRE][i % 2];
        let params = Params { yield_stress: 10f64.powf(3.0 + 2.0 * random.signed()), hardening: 8000.0 };
        let stretches = DVec3::from([(); 3].map(|()| 3f64.powf(random.signed())));
        let f = random.rotation() * DMat3::from_diagonal(stretches) * random.rotation();
        let flow = return_mapping(&law, &params, f - DMat3::IDENTITY, &mut State::default());
        assert!(!flow.failed, "{params:?} at the stretches {stretches}");
    }
    // The everyday huge step is no failure: a stretch of 3 at once.
    let mut state = State::default();
    let h = DMat3::from_diagonal(DVec3::new(3.0, 3f64.powf(-0.5), 3f64.powf(-0.5))) - DMat3::IDENTITY;
    assert!(!return_mapping(&MATERIAL_A, &Params { yield_stress: 6000.0, hardening: 8000.0 }, h, &mut state).failed);
}

#[test]
fn shear_with_reversal_stays_on_the_yield_surface() {
    let (yield_stress, hardening) = (6000.0, 8000.0);
    let material = plastic(MATERIAL_A, yield_stress, hardening);
    let mut sample = Sample::new(&material, 1e-3);
    let mut shears: Vec<f64> = (1..=2000).map(|i| 1e-3 * f64::from(i)).collect();
    shears.extend((0..4000).map(|i| 2.0 - 1e-3 * f64::from(i + 1)));
    let (mut dissipated, mut flowed, mut worst) = (0.0, 0, 0.0f64);
    for shear in shears {
        let alpha = sample.state.plastic.alpha;
        sample.step(sheared(shear), &[], 0.0).unwrap();
        let limit = yield_stress + hardening * sample.state.plastic.alpha;
        let q = kirchhoff_equivalent(&sample);
        assert!(q < limit * (1.0 + 1e-9));
        if sample.state.plastic.alpha > alpha {
            worst = worst.max((q / limit - 1.0).abs());
            flowed += 1;
        }
        let determinant = (DMat3::IDENTITY + sample.state.plastic.inverse_flow).determinant();
        assert!((determinant - 1.0).abs() < 1e-11, "{determinant}");
        assert!(sample.state.plastic_dissipation >= dissipated);
        dissipated = sample.state.plastic_dissipation;
    }
    let balance = (sample.work - sample.energy().stored - sample.dissipated()) / sample.work;
    println!("flowed in {flowed} of 6000 steps, yield condition {worst:.1e}, energy {balance:.1e}");
    assert!(worst < 1e-9 && flowed > 3000 && balance.abs() < 1e-3);
}

#[test]
fn work_is_stored_or_dissipated() {
    let material = plastic(MATERIAL_A, 6000.0, 8000.0);
    let balance = |steps: usize| {
        let mut sample = Sample::new(&material, 1e-3);
        for stretch in [1.8, 1.2, 0.6, 1.0] {
            pull(&mut sample, stretch, steps);
        }
        let dissipated = sample.state.plastic_dissipation;
        // sigma_y alpha + H alpha^2/2 is the integral of the yield stress.
        let alpha = sample.state.plastic.alpha;
        let closed = 6000.0 * alpha + 4000.0 * alpha * alpha;
        let error = (sample.work - sample.energy().stored - dissipated) / sample.work;
        println!("{steps} steps a leg: balance {error:.1e}, dissipation {:.1e}", dissipated / closed - 1.0);
        (error.abs(), (dissipated / closed - 1.0).abs())
    };
    let (coarse, fine) = (balance(500), balance(4000));
    assert!(fine.0 < 1e-3 && fine.1 < 1e-3 && fine.0 < coarse.0);
}
