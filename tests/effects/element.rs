//! The one-point hexahedron: reference cells, patch, rotation, energy, both engines on random fields.

use std::sync::Arc;

use glam::{DMat3, DVec3};
use stylet::cpu::CpuEngine;
use stylet::effects::puncture;
use stylet::engine::elements::{CellStates, Elements};
use stylet::engine::{Engine, State};
use stylet::material::ElasticLaw;
use stylet::model::Model;
use stylet::needle::{NeedleShape, Phase, Tool};
use stylet::scene::Scene;

use crate::common::*;

/// Signs of the local coordinates in VTK order.
const SIGNS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// One-point volume and gradients of a hexahedron with any corners: `B = dN/dxi J0^-1`, `V = 8 det J0`.
fn one_point(corners: &[DVec3; 8]) -> (f64, [DVec3; 8]) {
    let local: [DVec3; 8] = SIGNS.map(|s| DVec3::from(s) / 8.0);
    let jacobian = corners.iter().zip(local).fold(DMat3::ZERO, |j, (x, d)| j + outer(*x, d));
    let inverse = jacobian.inverse().transpose();
    (8.0 * jacobian.determinant(), local.map(|d| inverse * d))
}

/// Stress of a homogeneous block with the deformation gradient F.
fn stress_of_a_block(engine: &mut dyn Engine, model: &Model, f: DMat3) -> DMat3 {
    displaced(engine, model, |x| (f - DMat3::IDENTITY) * x);
    let volume: f64 = (0..model.mesh.node_count()).map(|n| model.mesh.block().node_volume(n)).sum();
    let forces = engine.internal_forces().unwrap();
    let p = forces.iter().enumerate().map(|(n, f)| outer(*f, model.mesh.rest_position(n)));
    p.fold(DMat3::ZERO, |a, b| a + b) * (1.0 / volume)
}

#[test]
fn nodal_forces_of_the_reference_cells() {
    let model = model(block([2.0, 2.0, 2.0], 1.0));
    let file = reference("09_element_forces.json");
    let cases: Vec<_> = file["cases"].as_array().unwrap().iter().filter(|c| c["element"] == "hex8_1pt").collect();
    assert_eq!(cases.len(), 6);
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        let tolerance = if name == "cpu" { 1e-9 } else { 1e-4 };
        for case in &cases {
            let list = |key: &str| -> [DVec3; 8] { std::array::from_fn(|i| vector(&case[key][i])) };
            let (corners, expected) = (list("X_m"), list("f_N"));
            let f = tensor(&case["F"][0]);
            let (volume, gradients) = one_point(&corners);
            let p = stress_of_a_block(engine.as_mut(), &model, f);
            let forces = gradients.map(|b| p * b * volume);
            // Rigid cases are judged against c10 h^2, the others against their own force.
            let scale = largest(&expected).max(2300.0 * volume.powf(2.0 / 3.0));
            let difference = forces.iter().zip(expected).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
            at_most(&format!("{name}, reference cell {}", case["case"]), difference / scale, tolerance);
            let energy = volume * MATERIAL_A.energy_density(f - DMat3::IDENTITY);
            let reference_energy = number(&case["energy_J"]);
            assert!((energy - reference_energy).abs() <= 1e-9 * reference_energy + 1e-18, "{}", case["case"]);
        }
    }
}

/// A graded block, cells in several strips and with several edge lengths.
fn graded_model(scene: Scene, cells: [usize; 3]) -> Arc<Model> {
    let mut scene = scene;
    let mesh = graded_mesh(cells);
    let extent = |a: usize| mesh.lines[a][cells[a]] - mesh.lines[a][0];
    scene.tissue.size = DVec3::new(extent(0), extent(1), extent(2));
    Arc::new(Model::new(scene, mesh))
}

#[test]
fn patch_test_on_a_graded_block() {
    let model = graded_model(block([1.0; 3], 1.0), [4, 5, 11]);
    let gradient =
        DMat3::from_cols(DVec3::new(0.12, 0.05, -0.04), DVec3::new(-0.03, -0.08, 0.06), DVec3::new(0.07, 0.02, -0.1));
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        displaced(engine.as_mut(), &model, |x| gradient * x + DVec3::new(1e-4, -2e-4, 3e-4));
        let forces = engine.internal_forces().unwrap();
        let n = model.mesh.block().nodes();
        let (mut inside, mut outside): (f64, f64) = (0.0, 0.0);
        for (node, f) in forces.iter().enumerate() {
            let c = model.mesh.block().node_coordinates(node);
            let inner = (0..3).all(|a| c[a] > 0 && c[a] + 1 < n[a]);
            let part = if inner { &mut inside } else { &mut outside };
            *part = part.max(f.length());
        }
        // The f32 sums of eight corner forces cancel to rounding; 14.6 pm of fixed point in u add 1e-8 of strain.
        at_most(
            &format!("{name}, inner force over border force"),
            inside / outside,
            if name == "cpu" { 1e-12 } else { 3e-6 },
        );
    }
}

#[test]
fn a_turn_by_two_radians_causes_no_force() {
    let model = model(block([2.0, 2.0, 2.0], 1.0));
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.0);
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        displaced(engine.as_mut(), &model, |x| turn * x - x);
        let forces = engine.internal_forces().unwrap();
        // J - 1 is formed in f32 from entries of order 1, so up to 3e-7 times kappa remain as pressure.
        let allowed = if name == "cpu" { 1e-11 } else { 1e-4 };
        at_most(&format!("{name}, force after a turn over c10 h^2"), largest(&forces) / (2300.0 * 1e-6), allowed);
    }
}

/// A scene with a needle, so that cells carry a remaining stiffness.
fn softened_scene() -> Scene {
    let mut scene = block([1.0; 3], 1.0);
    scene.solver.hourglass_quartic = HOURGLASS_PUNCTURE.1;
    scene.effects.puncture = Some(puncture::Params::default());
    with_tool(
        &mut scene,
        Tool::Needle(NeedleShape::cone("18G", 0.635e-3, 2e-3)),
        DVec3::NEG_Z,
        vec![Phase::Insert { speed: 10e-3, depth: 3e-3 }],
    );
    scene
}

/// Random displacement, `amplitude` times 1 mm at every node.
fn shaken(engine: &mut dyn Engine, amplitude: f64, seed: u64, smooth: bool) -> State {
    let mut random = Random(seed);
    let mut state = engine.read_state().unwrap();
    let count = state.displacement.len();
    let rigid = random.vector() * 5e-3;
    for (n, u) in state.displacement.iter_mut().enumerate() {
        let wave = (n as f64 / count as f64 * 9.0).sin();
        *u = rigid
            + if smooth {
                DVec3::new(wave, -wave, 0.5 * wave) * amplitude * 1e-3
            } else {
                random.vector() * amplitude * 1e-3
            };
    }
    for s in &mut state.stiffness {
        *s = 0.51 + 0.49 * random.signed();
    }
    engine.write_state(&state).unwrap();
    engine.read_state().unwrap()
}

/// Largest difference of the internal forces of GPU and CPU over several fields, each over its largest force.
fn force_difference(gpu: &mut dyn Engine, cpu: &mut dyn Engine) -> f64 {
    let fields = [(0.02, false), (0.1, false), (0.3, false), (0.6, false), (0.5, true), (3.0, true)];
    let mut worst: f64 = 0.0;
    for (seed, (amplitude, smooth)) in fields.into_iter().enumerate() {
        let state = shaken(gpu, amplitude, seed as u64 + 10, smooth);
        cpu.write_state(&state).unwrap();
        let (found, expected) = (gpu.internal_forces().unwrap(), cpu.internal_forces().unwrap());
        worst = worst.max(relative_difference(&found, &expected));
    }
    worst
}

#[test]
fn both_engines_agree_on_random_fields() {
    for (what, scene, cells) in [
        ("intact", block([1.0; 3], 1.0), [5, 4, 9]),
        ("softened", softened_scene(), [6, 7, 17]),
        ("one cell", block([1.0; 3], 1.0), [1, 1, 1]),
        ("one layer", block([1.0; 3], 1.0), [3, 1, 8]),
    ] {
        let model = graded_model(scene, cells);
        let Some(mut gpu) = gpu_engine(&model, 1e-6, 1) else {
            return;
        };
        let mut cpu = CpuEngine::new(model.clone(), 1e-6);
        at_most(&format!("internal forces, {what}"), force_difference(&mut gpu, &mut cpu), 2e-5);
    }
}

#[test]
fn a_wrong_coefficient_does_not_pass_the_comparison() {
    let right = graded_model(block([1.0; 3], 1.0), [5, 4, 9]);
    let Some(mut gpu) = gpu_engine(&right, 1e-6, 1) else {
        return;
    };
    for (what, change) in [
        ("c01", (|s: &mut Scene| s.material.law = ElasticLaw::mooney_rivlin(2300.0, 1010.0, 5.0e5)) as fn(&mut Scene)),
        ("c10", |s: &mut Scene| s.material.law = ElasticLaw::mooney_rivlin(2323.0, 1000.0, 5.0e5)),
        ("bulk modulus", |s: &mut Scene| s.material.law.bulk_modulus *= 1.001),
        ("hourglass stiffness", |s: &mut Scene| s.solver.hourglass_stiffness *= 1.01),
        ("quartic factor", |s: &mut Scene| s.solver.hourglass_quartic *= 1.01),
    ] {
        let mut scene = block([1.0; 3], 1.0);
        change(&mut scene);
        let mut wrong = CpuEngine::new(graded_model(scene, [5, 4, 9]), 1e-6);
        let difference = force_difference(&mut gpu, &mut wrong);
        println!("{what} changed: {difference:.1e}");
        assert!(difference > 2e-5, "{what}: {difference:e} would pass");
    }
}

#[test]
fn forces_are_the_gradient_of_the_energy() {
    let model = graded_model(block([1.0; 3], 1.0), [3, 2, 4]);
    let mut cpu = CpuEngine::new(model.clone(), 1e-6);
    let elements = Elements::new(&model);
    let mut worst: f64 = 0.0;
    for (amplitude, seed) in [(0.02, 20), (0.2, 21), (0.5, 22)] {
        let state = shaken(&mut cpu, amplitude, seed, false);
        let forces = cpu.internal_forces().unwrap();
        let energy = |u: &[DVec3]| -> f64 {
            let parts = (0..model.mesh.cell_count()).map(|cell| {
                let m = elements.measure(&model, cell, u, None, CellStates::default());
                m.elastic + m.hourglass
            });
            parts.sum()
        };
        let step = 1e-9;
        for node in (0..model.mesh.node_count()).step_by(3) {
            for axis in 0..3 {
                let mut u = state.displacement.clone();
                u[node][axis] += step;
                let more = energy(&u);
                u[node][axis] -= 2.0 * step;
                let slope = (more - energy(&u)) / (2.0 * step);
                worst = worst.max((slope - forces[node][axis]).abs() / largest(&forces));
            }
        }
    }
    at_most("force against energy gradient", worst, 1e-6);
}

#[test]
fn cell_measures_of_both_engines_agree() {
    let model = graded_model(softened_scene(), [6, 7, 17]);
    let dt = 1e-12;
    let Some(mut gpu) = gpu_engine(&model, dt, 1) else {
        return;
    };
    let mut cpu = CpuEngine::new(model.clone(), dt);
    for (amplitude, seed) in [(0.001, 30), (0.05, 31), (0.3, 32), (0.8, 33)] {
        let state = shaken(&mut gpu, amplitude, seed, false);
        cpu.write_state(&state).unwrap();
        let found = advance(&mut gpu, &model, dt, &mut 0, 1);
        let expected = advance(&mut cpu, &model, dt, &mut 0, 1);
        close("elastic energy", found.energy.elastic, expected.energy.elastic, 1e-5);
        close("hourglass energy", found.energy.hourglass, expected.energy.hourglass, 1e-5);
        at_most("J", (found.health.min_j - expected.health.min_j).abs(), 1e-5);
        at_most("corner J", (found.health.min_corner_j - expected.health.min_corner_j).abs(), 1e-5);
        assert_eq!(found.health.inverted_cells, expected.health.inverted_cells);
        assert_eq!(found.health.inverted_cell.is_some(), expected.health.inverted_cell.is_some());
        if amplitude > 0.7 {
            assert!(found.health.inverted_cells > 0);
        }
    }
}

#[test]
fn a_state_written_is_the_state_read() {
    let model = graded_model(softened_scene(), [6, 7, 17]);
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        let mut state = shaken(engine.as_mut(), 0.3, 40, false);
        let mut random = Random(41);
        state.velocity.iter_mut().for_each(|v| *v = random.vector() * 1e-2);
        state.tip_coordinate = 1.25e-3;
        engine.write_state(&state).unwrap();
        let back = engine.read_state().unwrap();
        assert!(relative_difference(&back.velocity, &state.velocity) < 1e-7, "{name}");
        assert!(relative_difference(&back.displacement, &state.displacement) < 1e-8, "{name}");
        assert!((back.tip_coordinate - 1.25e-3).abs() < 1e-9, "{name}");
        let pairs = back.stiffness.iter().zip(&state.stiffness);
        assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-7, "{name}");
    }
}
