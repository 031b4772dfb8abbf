//! Fibres through the whole step: along, across, squeezed; kernel against the law; energy.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use stylet::effects::fibres;
use stylet::engine::Engine;
use stylet::model::Model;

use crate::common::*;

fn fibrous(direction: DVec3, strain: f64) -> Arc<Model> {
    let mut scene = pulled([2.0, 2.0, 4.0], 2.0, strain, 0.5);
    scene.effects.fibres = Some(fibres::Params { direction, k1: 1.0e3, k2: 0.5 });
    scene.solver.mass_damping = 300.0;
    model(scene)
}

#[test]
fn along_and_across() {
    let (dt, steps) = (1e-5, 1000);
    for (engine, _) in engines(&fibrous(DVec3::Z, 0.4), dt, steps).iter().map(|e| (e.0, ())) {
        let stress = |direction: DVec3, strain: f64| {
            let model = fibrous(direction, strain);
            let mut engines = engines(&model, dt, steps);
            let (_, e) = engines.iter_mut().find(|e| e.0 == engine).unwrap();
            let last = pull(e.as_mut(), &model, dt, 60, steps).pop().unwrap();
            // The law itself at the same stretches: sides are free and the nominal stress is the reaction.
            let h = DMat3::from_diagonal(DVec3::new(last.lateral[0], last.lateral[1], last.stretch)) - DMat3::IDENTITY;
            let p = model.materials[0].law.first_piola_kirchhoff(h)
                + model.materials[0].fibres.unwrap().first_piola_kirchhoff(h);
            close(&format!("{engine} {direction} at {:.2}", last.stretch), last.nominal, p.z_axis.z, 2e-3);
            assert!(p.x_axis.x.abs() < 2e-3 * p.z_axis.z.abs() && p.y_axis.y.abs() < 2e-3 * p.z_axis.z.abs());
            last
        };
        let along = stress(DVec3::Z, 0.4);
        let across = stress(DVec3::X, 0.4);
        let squeezed = stress(DVec3::Z, -0.3);
        // Incompressible limit: matrix 2 (l - l^-2)(c10 + c01/l), fibres 2 l k1 e exp(k2 e^2), e = l^2 - 1.
        let l: f64 = 1.4;
        let matrix = |l: f64| 2.0 * (l - l.powi(-2)) * (2300.0 + 1000.0 / l);
        let e = l * l - 1.0;
        close("along, incompressible", along.nominal, matrix(l) + 2.0 * l * 1.0e3 * e * (0.5 * e * e).exp(), 2e-2);
        close("across, incompressible", across.nominal, matrix(l), 2e-2);
        // Pulled across, the fibres are squeezed and bear nothing; squeezed along, too.
        close("squeezed", squeezed.nominal, matrix(0.7), 2e-2);
    }
}

#[test]
fn kernel_against_law_on_random_fields() {
    let mut scene = block([1.0; 3], 1.0);
    let direction = DVec3::new(0.6, -0.3, 0.74).normalize();
    scene.effects.fibres = Some(fibres::Params { direction, k1: 1.0e3, k2: 0.5 });
    let with = Arc::new(Model::new(scene.clone(), graded_mesh([4, 5, 6])));
    let Some(mut gpu) = gpu_engine(&with, 1e-6, 1) else { return };
    let mut cpu = stylet::cpu::CpuEngine::new(with.clone(), 1e-6);
    for (amplitude, seed) in [(0.02, 1), (0.2, 2), (0.5, 3)] {
        let mut random = Random(seed);
        let mut state = cpu.read_state().unwrap();
        state.displacement.iter_mut().for_each(|u| *u = random.vector() * amplitude * 1e-3);
        // What the fixed point can hold.
        gpu.write_state(&state).unwrap();
        cpu.write_state(&gpu.read_state().unwrap()).unwrap();
        let difference = relative_difference(&gpu.internal_forces().unwrap(), &cpu.internal_forces().unwrap());
        at_most(&format!("fibres, amplitude {amplitude}"), difference, 2e-5);
        let mut wrong = scene.clone();
        wrong.effects.fibres = Some(fibres::Params { direction, k1: 1.02e3, k2: 0.5 });
        let mut wrong = stylet::cpu::CpuEngine::new(Arc::new(Model::new(wrong, graded_mesh([4, 5, 6]))), 1e-6);
        wrong.write_state(&gpu.read_state().unwrap()).unwrap();
        let difference = relative_difference(&gpu.internal_forces().unwrap(), &wrong.internal_forces().unwrap());
        assert!(amplitude < 0.1 || difference > 2e-5, "2 % of k1 would pass: {difference:e}");
    }
}

#[test]
fn no_stiffness_is_no_fibre_and_the_account_closes() {
    let dt = 1e-5;
    let mut scene = pulled([2.0, 2.0, 4.0], 1.0, 0.4, 0.05);
    scene.solver.mass_damping = 100.0;
    let bare = model(scene.clone());
    scene.effects.fibres = Some(fibres::Params { direction: DVec3::Z, k1: 0.0, k2: 1.0 });
    let neutral = model(scene.clone());
    scene.effects.fibres = Some(fibres::Params { direction: DVec3::Z, k1: 1.0e3, k2: 0.5 });
    let fibrous = model(scene);
    for (((name, mut a), (_, mut b)), (_, mut c)) in
        engines(&bare, dt, 500).into_iter().zip(engines(&neutral, dt, 500)).zip(engines(&fibrous, dt, 500))
    {
        let a = pull(a.as_mut(), &bare, dt, 10, 500).pop().unwrap();
        let b = pull(b.as_mut(), &neutral, dt, 10, 500).pop().unwrap();
        let c = pull(c.as_mut(), &fibrous, dt, 10, 500).pop().unwrap();
        close(name, b.nominal, a.nominal, crate::common::neutral(name, 1e-6));
        let s = &c.sums;
        let accounted = s.energy.elastic + s.energy.hourglass + s.energy.kinetic + s.energy.half_step + c.damping;
        at_most(&format!("{name}: imbalance"), (c.work - accounted).abs() / c.work, 2e-3);
    }
}
