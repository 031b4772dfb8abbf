//! Plasticity through the whole step: closed form of the uniaxial test, neutral parameters, energy.

use stylet::effects::plasticity;
use stylet::scene::Face;

use crate::common::*;

const FRAMES: usize = 120;

/// Pulls a single cell with the constants of the reference file; returns one run per engine.
fn runs(strain: f64, params: plasticity::Params) -> Vec<(&'static str, Vec<Sample>)> {
    let mut scene = pulled([2.0, 2.0, 2.0], 2.0, strain, 1.0);
    scene.effects.plasticity = Some(params);
    // The specimen must not ring: damping of the order of its first frequency.
    scene.solver.mass_damping = 300.0;
    let model = model(scene);
    let (dt, steps) = (2.0e-5, 420);
    let mut engines = engines(&model, dt, steps);
    let runs = engines.iter_mut().map(|(name, engine)| (*name, pull(engine.as_mut(), &model, dt, FRAMES, steps)));
    runs.collect()
}

#[test]
fn uniaxial_closed_form_with_hardening() {
    let file = &reference("06_plastic_uniaxial.json")["cases"]["hard"];
    let params = plasticity::Params { yield_stress: number(&file["sigma_y_Pa"]), hardening: number(&file["H_Pa"]) };
    for (leg, strain) in [("tension", 2.0), ("compression", -0.7)] {
        for (name, samples) in runs(strain, params) {
            let mut worst: f64 = 0.0;
            let rows = file[leg].as_array().unwrap();
            // The first row is the yield point itself, where alpha says nothing of the time.
            for row in &rows[1..] {
                let alpha = number(&row["alpha"]);
                if samples.last().unwrap().alpha < alpha {
                    continue;
                }
                let at = |of: fn(&Sample) -> f64| interpolated(&samples, |s| s.alpha, alpha, of);
                for (found, key) in
                    [(at(|s| s.stretch), "lam"), (at(|s| s.lateral[0]), "lam_lateral"), (at(|s| s.nominal), "P11_Pa")]
                {
                    let error = (found / number(&row[key]) - 1.0).abs();
                    worst = worst.max(error);
                    assert!(error < 1e-3, "{name} {leg} alpha {alpha}: {key} {found} instead of {}", row[key]);
                }
            }
            println!("{name} {leg}: off by {worst:.1e} up to alpha {:.2}", samples.last().unwrap().alpha);
            assert!(samples.last().unwrap().alpha > 0.5);
            let yield_stretch = number(&file[&format!("yield_stretch_{leg}")]);
            let begin = samples.windows(2).find(|w| w[1].alpha > 0.0).unwrap();
            let (low, high) = (begin[0].stretch.min(begin[1].stretch), begin[0].stretch.max(begin[1].stretch));
            assert!((low..=high).contains(&yield_stretch), "{name}: yields in {low}..{high}, not at {yield_stretch}");
        }
    }
}

#[test]
fn a_wrong_hardening_does_not_pass() {
    let file = &reference("06_plastic_uniaxial.json")["cases"]["hard"];
    let params = plasticity::Params { yield_stress: 6.0e3, hardening: 8.1e3 };
    let (_, samples) = &runs(2.0, params)[0];
    let row = &file["tension"].as_array().unwrap()[10];
    let found = interpolated(samples, |s| s.alpha, number(&row["alpha"]), |s| s.nominal);
    assert!((found / number(&row["P11_Pa"]) - 1.0).abs() > 1e-3);
}

#[test]
fn the_energy_of_flow_is_accounted_for() {
    for (name, samples) in runs(1.5, plasticity::Params { yield_stress: 6.0e3, hardening: 8.0e3 }) {
        let last = samples.last().unwrap();
        let s = &last.sums;
        let accounted =
            s.energy.elastic + s.energy.hourglass + s.energy.kinetic + s.energy.half_step + last.plastic + last.damping;
        println!("{name}: work {:.4e} J, of it plastic {:.4e} J", last.work, last.plastic);
        assert!(last.plastic > 0.3 * last.work);
        at_most(&format!("{name}: imbalance"), (last.work - accounted).abs() / last.work, 2e-3);
        assert!(samples.windows(2).all(|w| w[1].plastic >= w[0].plastic), "{name}: flow gave energy back");
        assert_eq!(samples.iter().map(|s| s.sums.health.return_failures).sum::<u32>(), 0);
    }
}

#[test]
fn a_yield_stress_out_of_reach_changes_nothing() {
    let scene = |yield_stress: Option<f64>| {
        let mut scene = pulled([2.0, 2.0, 4.0], 1.0, 0.3, 0.05);
        scene.effects.plasticity = yield_stress.map(|y| plasticity::Params { yield_stress: y, hardening: 1e3 });
        model(scene)
    };
    let (with, without) = (scene(Some(1e9)), scene(None));
    let dt = 1e-5;
    for ((name, mut a), (_, mut b)) in engines(&with, dt, 600).into_iter().zip(engines(&without, dt, 600)) {
        let a = pull(a.as_mut(), &with, dt, 8, 600).pop().unwrap();
        let b = pull(b.as_mut(), &without, dt, 8, 600).pop().unwrap();
        let force = |s: &Sample| s.sums.reactions[Face::ZMax as usize].z;
        // Not to the last bit: P goes through G^T = I in one case.
        close(name, force(&a), force(&b), neutral(name, 1e-5));
    }
}
