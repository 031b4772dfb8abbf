//! Viscoelasticity: linear answers at small strain, order of the update, energy.

use std::f64::consts::TAU;

use stylet::effects::viscoelastic::{Params, Term};
use stylet::material_test::Sample;

use super::*;

/// Shear small enough for the linear answers.
const SMALL: f64 = 1e-5;

fn series() -> Params {
    let file = reference("10_prony_linear.json");
    let term = |pair: &Value| Term { ratio: numbers(pair)[0], time: numbers(pair)[1] };
    Params { terms: file["prony_g_tau_s"].as_array().unwrap().iter().map(term).collect() }
}

fn viscous(params: Params) -> Material {
    Material { viscoelastic: Some(params), ..elastic(MATERIAL_A) }
}

/// Shear stress over mu0.
fn reduced(sample: &Sample) -> f64 {
    sample.stress.y_axis.x / MATERIAL_A.shear_modulus()
}

/// Steps of at most `dt` to the time `to`, with the shear as a function of time.
fn follow(sample: &mut Sample, to: f64, dt: f64, shear: &dyn Fn(f64) -> f64) {
    let from = sample.time;
    let steps = ((to - from) / dt).ceil() as usize;
    for i in 1..=steps {
        let t = from + (to - from) * i as f64 / steps as f64;
        sample.step(sheared(shear(t)), &[], (to - from) / steps as f64).unwrap();
    }
}

fn relaxation_error(params: &Params) -> f64 {
    let file = reference("10_prony_linear.json");
    let material = viscous(params.clone());
    let mut sample = Sample::new(&material, 1e-3);
    sample.step(sheared(SMALL), &[], 0.0).unwrap();
    let (times, moduli) = (numbers(&file["t_s"]), numbers(&file["relaxation_modulus_Pa"]));
    let mut worst: f64 = 0.0;
    for (t, modulus) in times.iter().zip(&moduli) {
        follow(&mut sample, *t, 0.05, &|_| SMALL);
        worst = worst.max((reduced(&sample) / SMALL / (modulus / moduli[0]) - 1.0).abs());
    }
    worst
}

#[test]
fn a_step_relaxes_like_the_series() {
    let error = relaxation_error(&series());
    let mut wrong = series();
    wrong.terms[1].time *= 1.05;
    println!("relaxation {error:.1e}, with tau_2 wrong by 5 %: {:.1e}", relaxation_error(&wrong));
    assert!(error < 1e-8 && relaxation_error(&wrong) > 1e-3);
}

#[test]
fn a_ramp_and_a_hold_follow_the_linear_answer() {
    let file = reference("10_prony_linear.json");
    let ramp = &file["ramp"];
    let (rate, end) = (number(ramp, "rate_per_s"), number(ramp, "t_ramp_s"));
    let scale = SMALL / (rate * end);
    let (times, stresses) = (numbers(&ramp["t_s"]), numbers(&ramp["stress_Pa"]));
    let error = |params: Params| {
        let material = viscous(params);
        let mut sample = Sample::new(&material, 1e-3);
        let mut worst: f64 = 0.0;
        for (t, expected) in times.iter().zip(&stresses).skip(1) {
            follow(&mut sample, *t, 0.01, &|t| scale * rate * t.min(end));
            worst = worst.max((reduced(&sample) / scale / (expected / 20e3) - 1.0).abs());
        }
        worst
    };
    let mut wrong = series();
    wrong.terms[0].ratio += 0.005;
    let (right, wrong) = (error(series()), error(wrong));
    println!("ramp and hold {right:.1e}, with g_1 wrong by 0.005: {wrong:.1e}");
    assert!(right < 1e-4 && wrong > 1e-3);
}

#[test]
fn the_engine_update_relaxes_like_the_series() {
    // As a run does it: a fixed small step, slow terms every n-th step.
    let file = reference("10_prony_linear.json");
    let dt = 1e-4;
    let material = viscous(series());
    let terms = &material.viscoelastic.as_ref().unwrap().terms;
    let intervals: Vec<u32> = terms.iter().map(|t| t.interval(dt)).collect();
    assert_eq!(intervals, [8, 64, 1024], "n dt <= tau/500");
    let (times, moduli) = (numbers(&file["t_s"]), numbers(&file["relaxation_modulus_Pa"]));
    let h = sheared(SMALL);
    let (mut state, mut worst) = (PointState::default(), 0.0f64);
    for step in 0..=100_000u64 {
        assert!(material.advance(h, 0.0, &around(dt, step), &mut state));
        if let Some(i) = times.iter().position(|t| ((step + 1) as f64 * dt - t).abs() < 1e-9) {
            let modulus = stress(&material, h, &state).y_axis.x / SMALL / MATERIAL_A.shear_modulus();
            worst = worst.max((modulus / (moduli[i] / moduli[0]) - 1.0).abs());
        }
    }
    println!("relaxation by engine steps {worst:.1e}");
    // Half an update, tau/1000, of the fastest change.
    assert!(worst < 1e-3);
}

/// Storage and loss modulus over the instantaneous modulus.
fn dynamic_modulus(params: Params, omega: f64) -> (f64, f64) {
    let material = viscous(params);
    let mut sample = Sample::new(&material, 1e-3);
    let period = TAU / omega;
    // The slowest term has settled to e^-9 after nine times.
    let periods = (9.0 * 60.0 / period).ceil().max(2.0);
    let dt = (period / 400.0).min(0.02);
    let shear = |t: f64| SMALL * (omega * t).sin();
    follow(&mut sample, periods * period, dt, &shear);
    let steps = (period / dt).ceil() as usize;
    let (mut storage, mut loss) = (0.0, 0.0);
    for i in 1..=steps {
        let t = periods * period + period * i as f64 / steps as f64;
        sample.step(sheared(shear(t)), &[], period / steps as f64).unwrap();
        storage += reduced(&sample) * (omega * t).sin() * 2.0 / steps as f64;
        loss += reduced(&sample) * (omega * t).cos() * 2.0 / steps as f64;
    }
    (storage / SMALL, loss / SMALL)
}

#[test]
fn a_sinusoid_meets_storage_and_loss_modulus() {
    let file = reference("10_prony_linear.json");
    let (storage, loss) = (numbers(&file["storage_Pa"]), numbers(&file["loss_Pa"]));
    for (i, omega) in numbers(&file["omega_rad_s"]).into_iter().enumerate().filter(|(_, o)| (0.005..50.0).contains(o)) {
        let (s, l) = dynamic_modulus(series(), omega);
        let errors = [s / (storage[i] / 20e3) - 1.0, l / (loss[i] / 20e3) - 1.0];
        println!("omega {omega} rad/s: storage {:.1e}, loss {:.1e}", errors[0], errors[1]);
        assert!(errors.iter().all(|e| e.abs() < 1e-3), "{errors:?}");
    }
    let mut wrong = series();
    wrong.terms[0].time *= 1.02;
    let l = dynamic_modulus(wrong, 1.0).1;
    assert!((l / (loss[3] / 20e3) - 1.0).abs() > 1e-3);
}

#[test]
fn the_midpoint_update_is_of_second_order() {
    let (g, tau, omega) = (0.25, 0.5, 3.0);
    let material = viscous(Params { terms: vec![Term { ratio: g, time: tau }] });
    // q(t + dt/2) against the solution of tau dq/dt = g mu gamma - q.
    let error = |dt: f64| {
        assert_eq!(material.viscoelastic.as_ref().unwrap().terms[0].interval(dt), 1);
        let mut state = PointState::default();
        let mut worst: f64 = 0.0;
        for step in 0..(2.0 / dt).round() as u64 {
            let t = step as f64 * dt;
            material.advance(sheared(SMALL * (omega * t).sin()), 0.0, &around(dt, step), &mut state);
            let (t, x) = (t + 0.5 * dt, omega * tau);
            let exact = ((omega * t).sin() - x * (omega * t).cos() + x * (-t / tau).exp()) / (1.0 + x * x);
            let q = state.viscous[0].y_axis.x / (g * MATERIAL_A.shear_modulus() * SMALL);
            worst = worst.max((q - exact).abs());
        }
        worst
    };
    let errors = [0.04, 0.02, 0.01, 0.005].map(error);
    println!("errors {errors:?}");
    for pair in errors.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((3.8..4.2).contains(&ratio), "{ratio}");
    }
}

#[test]
fn steps_of_changing_size_are_of_second_order() {
    let material = viscous(series());
    let run = |refine: usize| {
        let mut sample = Sample::new(&material, 1e-3);
        let mut step = 0;
        while sample.time < 2.0 - 1e-12 {
            // A pattern of steps 1 : 3 : 2, refined evenly.
            let dt = [0.01, 0.03, 0.02][step / refine % 3] / refine as f64;
            let t = sample.time + dt.min(2.0 - sample.time);
            sample.step(sheared(SMALL * (3.0 * t).sin()), &[], t - sample.time).unwrap();
            step += 1;
        }
        reduced(&sample) / SMALL
    };
    let (a, b, c) = (run(1), run(2), run(4));
    let ratio = (a - b) / (b - c);
    println!("ratio {ratio:.2}");
    assert!((3.5..4.5).contains(&ratio), "{ratio}");
}

#[test]
fn work_is_stored_or_dissipated() {
    let material = viscous(series());
    for (amplitude, duration) in [(1e-4, 4.0), (0.5, 4.0)] {
        let mut sample = Sample::new(&material, 1e-3);
        let steps = 20_000;
        let mut dissipated = 0.0;
        let mut gross = 0.0f64;
        for i in 1..=steps {
            let t = duration * f64::from(i) / f64::from(steps);
            sample.step(sheared(amplitude * (3.0 * t).sin()), &[], duration / f64::from(steps)).unwrap();
            gross = gross.max(sample.work.abs());
            // The split into stored and dissipated is that of the linear theory: its sign is a promise at small strain.
            if amplitude < 1e-3 {
                assert!(sample.dissipated() >= dissipated - 1e-9 * gross);
            }
            dissipated = sample.dissipated();
        }
        let balance = (sample.work - sample.energy().stored - sample.dissipated()) / gross;
        println!(
            "amplitude {amplitude}: balance {balance:.1e}, dissipated {:.3} of the work",
            dissipated / sample.work
        );
        assert!(balance.abs() < 1e-6 && dissipated > 0.1 * sample.work);
    }
}

#[test]
fn without_shares_the_effect_is_neutral() {
    let plain = elastic(MATERIAL_A);
    let neutral = viscous(Params { terms: vec![Term { ratio: 0.0, time: 1.0 }] });
    let (mut a, mut b) = (Sample::new(&plain, 1e-3), Sample::new(&neutral, 1e-3));
    for i in 1..=20 {
        for sample in [&mut a, &mut b] {
            sample.step(stretched(1.0 + 0.05 * f64::from(i)), &LATERAL, 0.1).unwrap();
        }
        assert_eq!(a.stress, b.stress);
    }
    assert_eq!(b.dissipated(), 0.0);
}
