//! Elastic laws, regions and all constitutive effects together: the kernels against the f64 engine.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use stylet::cpu::CpuEngine;
use stylet::effects::{TissueMaterial, damage, fibres, plasticity, viscoelastic};
use stylet::engine::Engine;
use stylet::material::{ElasticLaw, Isochoric, LAWS, Ogden};
use stylet::model::Model;
use stylet::scene::{Region, RegionShape, Scene};

use crate::common::*;

/// Every law of the table, and Ogden's of the areas.
fn all_laws() -> Vec<Isochoric> {
    let areas = Isochoric::Ogden(Ogden { mu: 6600.0, alpha: -5.0 });
    LAWS.iter().map(|law| (law.build)(law.example)).chain([areas]).collect()
}

fn elastic(isochoric: Isochoric) -> ElasticLaw {
    ElasticLaw { isochoric, bulk_modulus: 2.0e5 }
}

fn graded(scene: Scene) -> Arc<Model> {
    Arc::new(Model::new(scene, graded_mesh([4, 5, 6])))
}

/// Gives both engines the same random field, rounded to what the device holds.
fn shake(gpu: &mut dyn Engine, cpu: &mut dyn Engine, amplitude: f64, seed: u64) {
    let mut random = Random(seed);
    let mut state = gpu.read_state().unwrap();
    state.displacement.iter_mut().for_each(|u| *u = random.vector() * amplitude * 1e-3);
    gpu.write_state(&state).unwrap();
    let rounded = gpu.read_state().unwrap();
    cpu.write_state(&rounded).unwrap();
}

fn force_difference(gpu: &mut dyn Engine, cpu: &mut dyn Engine) -> f64 {
    relative_difference(&gpu.internal_forces().unwrap(), &cpu.internal_forces().unwrap())
}

#[test]
fn every_law_in_its_kernel() {
    for law in all_laws() {
        let mut scene = block([1.0; 3], 1.0);
        scene.material.law = elastic(law);
        let model = graded(scene.clone());
        let Some(mut gpu) = gpu_engine(&model, 1e-9, 1) else { return };
        let mut cpu = CpuEngine::new(model, 1e-9);
        for (amplitude, seed) in [(0.002, 1), (0.1, 2), (0.4, 3), (0.7, 4)] {
            shake(&mut gpu, &mut cpu, amplitude, seed);
            let difference = force_difference(&mut gpu, &mut cpu);
            at_most(&format!("{law:?}, amplitude {amplitude} mm"), difference, 3e-5);
            let (found, expected) = (
                advance(&mut gpu, &cpu_model(&scene), 1e-12, &mut 0, 1),
                advance(&mut cpu, &cpu_model(&scene), 1e-12, &mut 0, 1),
            );
            // Ogden's energy is a difference of powers near 1: strains of 0.2 % leave four digits of it.
            let allowed = if amplitude < 0.01 { 3e-4 } else { 3e-5 };
            close("elastic energy", found.energy.elastic, expected.energy.elastic, allowed);
        }
        // One wrong constant is seen.
        scene.material.law.bulk_modulus *= 1.001;
        let mut wrong = CpuEngine::new(graded(scene), 1e-9);
        shake(&mut gpu, &mut wrong, 0.4, 3);
        assert!(force_difference(&mut gpu, &mut wrong) > 3e-5, "{law:?}");
    }
}

/// Flat, squeezed as a whole, drawn to a thread, inside out: what the laws continue, on both engines.
#[test]
fn every_law_far_below_its_range() {
    let laws =
        all_laws().into_iter().chain([-1.0, -4.0, 0.6, 8.0].map(|alpha| Isochoric::Ogden(Ogden { mu: 6600.0, alpha })));
    for law in laws {
        let mut scene = block([1.0; 3], 1.0);
        scene.material.law = elastic(law);
        let model = graded(scene);
        let Some(mut gpu) = gpu_engine(&model, 1e-9, 1) else { return };
        let mut cpu = CpuEngine::new(model.clone(), 1e-9);
        let (mut random, mut worst) = (Random(31), 0.0_f64);
        for stretches in [
            [1.0, 1.0, 0.29],
            [1.1, 0.9, 0.05],
            [0.66, 0.67, 0.65],
            [0.3, 0.3, 0.3],
            [0.1, 0.1, 0.1],
            [0.2, 0.25, 1.2],
            [1.0, 1.1, 0.002],
            [0.7, 0.8, -0.1],
            [1.0, 0.9, -0.6],
        ] {
            let axis = random.vector().normalize();
            let turned = DMat3::from_axis_angle(axis, 0.7) * DMat3::from_diagonal(DVec3::from(stretches));
            displaced(&mut gpu, &model, |x| (turned - DMat3::IDENTITY) * x);
            let rounded = gpu.read_state().unwrap();
            cpu.write_state(&rounded).unwrap();
            let difference = force_difference(&mut gpu, &mut cpu);
            worst = worst.max(difference);
            assert!(difference < 5e-4, "{law:?} at {stretches:?}: {difference:.1e}");
        }
        println!("{law:?}: GPU against CPU below J = 0.3: {worst:.1e}");
    }
}

fn cpu_model(scene: &Scene) -> Arc<Model> {
    graded(scene.clone())
}

/// A block of five laws in five regions, with everything that a material point can do.
fn everything() -> Scene {
    let mut scene = block([1.0; 3], 1.0);
    let [neo_hookean, mooney_rivlin, yeoh, ogden, demiray, ..] = all_laws()[..] else { panic!("five laws") };
    scene.material.law = elastic(mooney_rivlin);
    scene.effects.plasticity = Some(plasticity::Params { yield_stress: 900.0, hardening: 3.0e3 });
    scene.effects.fibres =
        Some(fibres::Params { direction: DVec3::new(1.0, 0.4, -0.3).normalize(), k1: 2.0e3, k2: 0.6 });
    let terms = [(0.3, 2e-5), (0.2, 4e-4)].map(|(ratio, time)| viscoelastic::Term { ratio, time });
    scene.effects.viscoelastic = Some(viscoelastic::Params { terms: terms.to_vec() });
    scene.effects.damage =
        Some(damage::Params { onset: 0.02, failure_displacement: 1e-3, largest: 0.9, deletion: false });
    let shapes = [
        RegionShape::Layer { top: 0.0, bottom: 1.5e-3 },
        RegionShape::Sphere { centre: DVec3::new(0.0, 0.0, -4e-3), radius: 1.6e-3 },
        RegionShape::Box { low: DVec3::new(-9e-3, -9e-3, -9e-3), high: DVec3::new(-1e-3, 9e-3, -4e-3) },
        RegionShape::Cylinder { from: DVec3::new(-9e-3, 1e-3, -5e-3), to: DVec3::new(9e-3, 1e-3, -5e-3), radius: 1e-3 },
    ];
    for (shape, law) in shapes.into_iter().zip([neo_hookean, ogden, demiray, yeoh]) {
        let mut material = TissueMaterial::new(elastic(law).isochoric.key(), "test", elastic(law), 900.0);
        material.plasticity = Some(plasticity::Params { yield_stress: 700.0, hardening: 1.0e3 });
        material.fibres = Some(fibres::Params { direction: DVec3::Y, k1: 500.0, k2: 1.0 });
        scene.regions.push(Region { name: material.name.clone(), shape, material });
    }
    scene
}

#[test]
fn regions_and_all_effects_together() {
    let scene = everything();
    let model = graded(scene.clone());
    let used: std::collections::BTreeSet<u8> = model.composition.main.iter().copied().collect();
    assert_eq!(used.len(), 5, "regions that fill most of no cell: {used:?}");
    let laws: std::collections::BTreeSet<&str> =
        (0..model.mesh.cell_count()).map(|cell| model.material(cell).law.isochoric.key()).collect();
    assert_eq!(laws.len(), 5, "laws in cells: {laws:?}");
    assert!(model.materials.len() > 5, "cells that a face cuts are mixtures");
    let dt = 2e-6;
    let mut lanes = CpuEngine::in_lanes(model.clone(), dt);
    assert!(lanes.info().adapter.contains("lanes of f32"), "{}", lanes.info().adapter);
    beside_f64("lanes", &mut lanes, &model, dt);
    let Some(mut gpu) = gpu_engine(&model, dt, 20) else { return };
    beside_f64("gpu", &mut gpu, &model, dt);
}

/// A blow, and what the histories make of it in 80 steps, on this engine and in f64.
fn beside_f64(engine: &str, other: &mut dyn Engine, model: &Model, dt: f64) {
    let mut cpu = CpuEngine::new(Arc::new(Model::clone(model)), dt);
    shake(other, &mut cpu, 0.15, 7);
    let (mut a, mut b) = (0, 0);
    let mut totals = [[0.0; 3]; 2];
    for _ in 0..4 {
        let found = advance(other, model, dt, &mut a, 20);
        let expected = advance(&mut cpu, model, dt, &mut b, 20);
        for (total, s) in totals.iter_mut().zip([&found, &expected]) {
            total[0] += s.energy.plastic;
            total[1] += s.energy.damage;
            total[2] = s.energy.viscous;
        }
        close(&format!("{engine}: elastic energy"), found.energy.elastic, expected.energy.elastic, 1e-3);
        assert_eq!((found.health.return_failures, expected.health.return_failures), (0, 0), "{engine}");
        let apart = (found.health.largest_damage - expected.health.largest_damage).abs();
        at_most(&format!("{engine}: damage"), apart, 1e-3);
    }
    for (name, i) in [("plastic", 0), ("damage", 1), ("viscous", 2)] {
        assert!(totals[1][i] > 0.0, "{name}: nothing happened");
        close(&format!("{engine}: {name} dissipation"), totals[0][i], totals[1][i], 5e-3);
    }
    let (found, expected) = (other.read_state().unwrap(), cpu.read_state().unwrap());
    let apart = relative_difference(&found.displacement, &expected.displacement);
    at_most(&format!("{engine}: displacement"), apart, 1e-4);
    let alpha = |s: &stylet::engine::State| s.points.iter().map(|p| p.plastic.alpha).fold(0.0, f64::max);
    close(&format!("{engine}: largest plastic strain"), alpha(&found), alpha(&expected), 1e-3);
    at_most(&format!("{engine}: internal forces of the states"), force_difference(other, &mut cpu), 1e-3);
}

/// In 32 bits as well, what must cancel at F = I cancels to the last bit, for every law and with all effects.
#[test]
fn tissue_at_rest_does_not_move_by_one_bit() {
    let laws = all_laws().into_iter().map(|law| {
        let mut scene = block([1.0; 3], 1.0);
        scene.material.law = elastic(law);
        scene
    });
    for scene in laws.into_iter().chain([everything()]) {
        let (model, dt) = (graded(scene), 1e-5);
        for (name, mut engine) in engines(&model, dt, 100) {
            let mut step = 0;
            // In fixed point a rigid translation is rest, too.
            if name == "gpu" {
                displaced(engine.as_mut(), &model, |_| DVec3::new(0.3e-3, -0.7e-3, 0.1e-3));
            }
            let before = engine.read_state().unwrap();
            for _ in 0..5 {
                advance(engine.as_mut(), &model, dt, &mut step, 100);
            }
            let state = engine.read_state().unwrap();
            let what = format!("{} on {name}", model.materials[0].law.isochoric.key());
            assert!(state.velocity.iter().all(|v| *v == DVec3::ZERO), "{what}");
            assert_eq!(state.displacement, before.displacement, "{what}");
        }
    }
}

#[test]
fn reading_forces_changes_no_history() {
    let model = graded(everything());
    let dt = 2e-6;
    for (name, mut engine) in engines(&model, dt, 20) {
        let mut random = Random(9);
        let mut state = engine.read_state().unwrap();
        state.displacement.iter_mut().for_each(|u| *u = random.vector() * 1e-4);
        engine.write_state(&state).unwrap();
        advance(engine.as_mut(), &model, dt, &mut 0, 5);
        let before = engine.read_state().unwrap();
        let first = engine.internal_forces().unwrap();
        let second = engine.internal_forces().unwrap();
        // The sum of the Prony terms is formed anew when the state is put back.
        at_most(name, relative_difference(&first, &second), 1e-6);
        let after = engine.read_state().unwrap();
        assert_eq!(before.points.len(), after.points.len());
        for (a, b) in before.points.iter().zip(&after.points) {
            assert_eq!(a.plastic, b.plastic, "{name}");
            let difference = a.viscous.iter().zip(&b.viscous).map(|(a, b)| largest_entry(*a - *b)).fold(0.0, f64::max);
            assert!(difference <= 1e-6 * a.viscous.iter().map(|q| largest_entry(*q)).fold(1e-6, f64::max), "{name}");
        }
    }
}
