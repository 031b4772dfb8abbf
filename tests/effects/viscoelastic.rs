//! Prony terms through the whole step: shear relaxation, neutral share, mass scaling, energy.

use std::sync::Arc;

use glam::DMat3;
use stylet::effects::{mass_scaling, viscoelastic};
use stylet::engine::Engine;
use stylet::model::Model;
use stylet::scene::{Face, FaceCondition, FaceDrive};

use crate::common::*;

/// A block held on all faces, so that a homogeneous field stays where it is put.
fn held_block(terms: &[(f64, f64)], scaling: f64) -> Arc<Model> {
    let mut scene = block([2.0, 2.0, 2.0], 1.0);
    scene.faces.iter_mut().for_each(|f| f.fixed = [true; 3]);
    let terms = terms.iter().map(|(ratio, time)| viscoelastic::Term { ratio: *ratio, time: *time }).collect();
    scene.effects.viscoelastic = Some(viscoelastic::Params { terms });
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor: scaling });
    model(scene)
}

/// Shear stress P_xz [Pa] of the homogeneous state.
fn shear_stress(engine: &mut dyn Engine, model: &Model) -> f64 {
    let forces = engine.internal_forces().unwrap();
    let mut p = DMat3::ZERO;
    for (node, force) in forces.iter().enumerate() {
        p += outer(*force, model.mesh.rest_position(node));
    }
    p.z_axis.x / 8e-9
}

const SHEAR: f64 = 0.01;

/// Relaxation modulus over the instantaneous one at the times of the reference that are reached.
fn relaxation(engine: &mut dyn Engine, model: &Model, dt: f64, times: &[f64]) -> Vec<f64> {
    displaced(engine, model, |x| glam::DVec3::X * (SHEAR * x.z));
    let first = shear_stress(engine, model);
    let mut step = 0;
    let mut moduli = Vec::new();
    for time in times {
        let target = (time / dt).round() as u64;
        while step < target {
            let steps = (target - step).min(2000) as usize;
            advance(engine, model, dt, &mut step, steps);
        }
        moduli.push(shear_stress(engine, model) / first);
    }
    moduli
}

#[test]
fn shear_relaxes_as_the_prony_series_says() {
    let file = reference("10_prony_linear.json");
    let terms: Vec<(f64, f64)> =
        file["prony_g_tau_s"].as_array().unwrap().iter().map(|t| (number(&t[0]), number(&t[1]))).collect();
    let times: Vec<f64> = file["t_s"].as_array().unwrap().iter().map(number).filter(|t| *t <= 60.0).collect();
    let moduli: Vec<f64> = file["relaxation_modulus_Pa"].as_array().unwrap().iter().map(number).collect();
    let dt = 1e-3;
    // Physical time whatever the inertia: the factor must not matter.
    for scaling in [1.0, 4000.0] {
        let model = held_block(&terms, scaling);
        for (name, mut engine) in engines(&model, dt, 2000) {
            let found = relaxation(engine.as_mut(), &model, dt, &times);
            let mut worst: f64 = 0.0;
            for ((time, found), modulus) in times.iter().zip(found).zip(&moduli) {
                let expected = modulus / moduli[0];
                worst = worst.max((found / expected - 1.0).abs());
                assert!((found / expected - 1.0).abs() < 1e-3, "{name} at {time} s: {found} instead of {expected}");
            }
            println!("{name}, mass scaling {scaling}: relaxation up to 60 s off by {worst:.1e}");
        }
    }
}

#[test]
fn slow_terms_keep_their_digits() {
    // dt/tau = 1e-7: increments of every step would be lost in f32.
    let (dt, tau) = (1e-4, 1000.0);
    let model = held_block(&[(0.5, tau)], 1.0);
    let Some(mut gpu) = gpu_engine(&model, dt, 2000) else { return };
    let time = 20.0;
    let found = relaxation(&mut gpu, &model, dt, &[time])[0];
    let expected = 1.0 - 0.5 * (1.0 - (-time / tau).exp());
    // The terms move in stairs of tau/1000 to tau/500, of which a half may be missing; here the loss is of 20 such stairs.
    close("loss of modulus", 1.0 - found, 1.0 - expected, 3e-2);
    close("modulus", found, expected, 2e-4);
}

#[test]
fn a_wrong_relaxation_time_does_not_pass() {
    let dt = 1e-3;
    let model = held_block(&[(0.25, 0.52)], 1.0);
    let mut engine = stylet::cpu::CpuEngine::new(model.clone(), dt);
    let found = relaxation(&mut engine, &model, dt, &[0.5])[0];
    let expected = 0.75 + 0.25 * (-1.0f64).exp();
    assert!((found / expected - 1.0).abs() > 1e-3);
}

/// A pulled and held specimen with and without a Prony term.
fn pull_and_hold(ratio: Option<f64>) -> Arc<Model> {
    let mut scene = pulled([2.0, 2.0, 4.0], 1.0, 0.3, 0.1);
    scene.solver.mass_damping = 100.0;
    scene.effects.viscoelastic =
        ratio.map(|ratio| viscoelastic::Params { terms: vec![viscoelastic::Term { ratio, time: 0.05 }] });
    model(scene)
}

#[test]
fn no_share_is_no_relaxation() {
    let dt = 1e-5;
    let (with, without) = (pull_and_hold(Some(1e-30)), pull_and_hold(None));
    for ((name, mut a), (_, mut b)) in engines(&with, dt, 1000).into_iter().zip(engines(&without, dt, 1000)) {
        let a = pull(a.as_mut(), &with, dt, 5, 1000).pop().unwrap();
        let b = pull(b.as_mut(), &without, dt, 5, 1000).pop().unwrap();
        close(name, a.nominal, b.nominal, neutral(name, 1e-6));
    }
}

#[test]
fn relaxation_dissipates_and_the_account_closes() {
    let dt = 1e-5;
    let model = pull_and_hold(Some(0.5));
    for (name, mut engine) in engines(&model, dt, 500) {
        let samples = pull(engine.as_mut(), &model, dt, 60, 500);
        let largest = samples.iter().map(|s| s.work).fold(0.0, f64::max);
        let mut worst: f64 = 0.0;
        for s in &samples[1..] {
            let sums = &s.sums;
            let accounted = sums.energy.elastic
                + sums.energy.hourglass
                + sums.energy.kinetic
                + sums.energy.half_step
                + sums.energy.viscous
                + s.damping;
            worst = worst.max((s.work - accounted).abs() / largest);
        }
        at_most(&format!("{name}: imbalance"), worst, 2e-3);
        let viscous: Vec<f64> = samples.iter().map(|s| s.sums.energy.viscous).collect();
        assert!(viscous.windows(2).all(|w| w[1] >= w[0] - 1e-4 * largest), "{name}: energy came back: {viscous:?}");
        assert!(viscous.last().unwrap() > &(0.1 * largest), "{name}: {:?} of {largest}", viscous.last());
        // Held at the end: about half of the stress is left.
        let peak = samples.iter().map(|s| s.nominal).fold(0.0, f64::max);
        assert!(samples.last().unwrap().nominal < 0.75 * peak);
    }
}

#[test]
fn a_sheared_column_follows_ramp_and_hold() {
    let file = reference("10_prony_linear.json");
    let terms: Vec<viscoelastic::Term> = file["prony_g_tau_s"]
        .as_array()
        .unwrap()
        .iter()
        .map(|t| viscoelastic::Term { ratio: number(&t[0]), time: number(&t[1]) })
        .collect();
    let (ramp, modulus) = (&file["ramp"], number(&file["E0_Pa"]));
    // The file strains a bar of modulus E0; a column that can only slip has the same kernel with mu0. A tenth of the strain
    // keeps the shear small.
    let part = 0.1;
    let slip = part * number(&ramp["rate_per_s"]) * number(&ramp["t_ramp_s"]);
    let mut scene = block([2.0, 2.0, 4.0], 2.0);
    for face in [Face::XMin, Face::XMax, Face::YMin, Face::YMax] {
        scene.faces[face as usize] = held(false, true, true);
    }
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize] = FaceCondition {
        drive: Some(FaceDrive {
            displacement: glam::DVec3::X * (slip * 4e-3),
            rotation: 0.0,
            duration: number(&ramp["t_ramp_s"]),
            cycles: 0,
        }),
        ..held(true, true, true)
    };
    scene.solver.mass_damping = 60.0;
    scene.effects.viscoelastic = Some(viscoelastic::Params { terms });
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor: 40.0 });
    let model = model(scene);
    let dt = 2e-4;
    assert!(dt < stylet::engine::stable_dt::wave_speed_bound(&model));
    let times: Vec<f64> =
        ramp["t_s"].as_array().unwrap().iter().map(number).filter(|t| (0.4..11.0).contains(t)).collect();
    let stress = |t: f64| {
        let at = ramp["t_s"].as_array().unwrap().iter().position(|x| number(x) == t).unwrap();
        number(&ramp["stress_Pa"][at]) / modulus
    };
    for (name, mut engine) in engines(&model, dt, 1000) {
        let (mut step, mut worst) = (0, 0.0f64);
        for t in &times {
            let target = (t / dt).round() as u64;
            let mut sums = Default::default();
            while step < target {
                let steps = (target - step).min(1000) as usize;
                sums = advance(engine.as_mut(), &model, dt, &mut step, steps);
            }
            let sums: stylet::engine::FrameSums = sums;
            let found = sums.reactions[Face::ZMax as usize].x / 4e-6 / (model.materials[0].law.shear_modulus() * part);
            worst = worst.max((found / stress(*t) - 1.0).abs());
        }
        // Mass damping drags at the column while the face moves: 1.6e-3 of the stress.
        at_most(&format!("{name}: ramp and hold up to {} s", times[times.len() - 1]), worst, 2e-3);
    }
}
