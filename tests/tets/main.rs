//! Tetrahedra with averaged nodal pressure: reference cells, patch, energy, both engines, known reactions, hard meshes.

mod loads;
mod needle;
mod opening;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use stylet::cpu::CpuEngine;
use stylet::effects::{TissueMaterial, damage, fibres, gravity, mass_scaling, plasticity, viscoelastic};
use stylet::engine::elements::{CellStates, Elements};
use stylet::engine::stable_dt::{power_iteration, wave_speed_bound};
use stylet::engine::{Engine, FrameSums, State};
use stylet::material::ElasticLaw;
use stylet::mesh::import::{LengthUnit, read};
use stylet::mesh::tets::TetMesh;
use stylet::mesh::{BlockMesh, Mesh};
use stylet::model::Model;
use stylet::observables::FrameRecord;
use stylet::output::Summary;
use stylet::scene::{Face, FaceDrive, Region, RegionShape, Scene, Support};
use stylet::simulation::{EngineChoice, Simulation};

use crate::common;
use common::*;

/// A grid of `cells` hexahedra of edge `edge` [m], each cut into six tetrahedra along its diagonal.
fn cut_grid(cells: [usize; 3], edge: f64) -> TetMesh {
    let lines = cells.map(|count| (0..=count).map(|i| i as f64 * edge).collect());
    let mesh = TetMesh::from_block(&BlockMesh::new(lines));
    let volume = edge.powi(3) / 6.0;
    assert!((0..mesh.tets.len()).all(|t| (mesh.volume(t) / volume - 1.0).abs() < 1e-9));
    mesh
}

/// The same with its inner nodes moved at random by up to `part` of an edge.
fn distorted_grid(cells: [usize; 3], edge: f64, part: f64) -> TetMesh {
    let mut mesh = cut_grid(cells, edge);
    let (low, high) = mesh.bounds();
    let mut random = Random(5);
    for x in &mut mesh.positions {
        let shift = random.vector() * (part * edge);
        for a in 0..3 {
            if x[a] > low[a] + 1e-9 && x[a] < high[a] - 1e-9 {
                x[a] += shift[a];
            }
        }
    }
    assert!((0..mesh.tets.len()).all(|t| mesh.volume(t) > 0.0));
    mesh
}

fn tet_model(scene: Scene, mesh: TetMesh) -> Arc<Model> {
    Arc::new(Model::new(scene, Mesh::Tets(Arc::new(mesh))))
}

/// A scene of material A without support.
fn tissue() -> Scene {
    block([1.0; 3], 1.0)
}

/// Two materials: above half of the height `height` [m] one with another bulk modulus and law.
fn two_materials(height: f64) -> Scene {
    let mut scene = tissue();
    scene.regions.push(Region {
        name: "stiff".into(),
        shape: RegionShape::Box { low: DVec3::splat(-1.0), high: DVec3::new(1.0, 1.0, 0.5 * height) },
        material: TissueMaterial::new("stiff", "test", ElasticLaw::mooney_rivlin(5.0e3, 2.0e3, 2.0e5), 1200.0),
    });
    scene
}

/// All constitutive effects; flow begins only where `yield_stress` [Pa] is met.
fn with_effects(mut scene: Scene, yield_stress: f64) -> Scene {
    scene.effects.plasticity = Some(plasticity::Params { yield_stress, hardening: 5e3 });
    scene.effects.fibres = Some(fibres::Params::default());
    scene.effects.viscoelastic = Some(viscoelastic::Params::default());
    scene.effects.damage =
        Some(damage::Params { onset: 0.01, failure_displacement: 1e-3, largest: 0.95, deletion: false });
    scene
}

/// Random displacement on a rigid shift; `smooth`: a wave.
fn shaken(engine: &mut dyn Engine, amplitude: f64, seed: u64, smooth: bool) -> State {
    let mut random = Random(seed);
    let mut state = engine.read_state().unwrap();
    let count = state.displacement.len();
    let rigid = random.vector() * 5e-3;
    for (n, u) in state.displacement.iter_mut().enumerate() {
        let wave = (n as f64 / count as f64 * 9.0).sin();
        let part = if smooth { DVec3::new(wave, -wave, 0.5 * wave) } else { random.vector() };
        *u = rigid + part * (amplitude * 1e-3);
    }
    engine.write_state(&state).unwrap();
    engine.read_state().unwrap()
}

#[test]
fn nodal_forces_of_the_reference_tetrahedra() {
    let file = reference("09_element_forces.json");
    let cases: Vec<_> = file["cases"].as_array().unwrap().iter().filter(|c| c["element"] == "tet4").collect();
    assert!(cases.len() >= 5);
    for case in cases {
        let list = |key: &str| -> [DVec3; 4] { std::array::from_fn(|i| vector(&case[key][i])) };
        let (corners, u, expected) = (list("X_m"), list("u_m"), list("f_N"));
        let mesh = TetMesh {
            positions: corners.to_vec(),
            tets: vec![[0, 1, 2, 3]],
            tags: vec![0],
            regions: vec!["tissue".into()],
            ..Default::default()
        };
        let volume = mesh.volume(0);
        let model = tet_model(tissue(), mesh);
        for (name, mut engine) in engines(&model, 1e-6, 1) {
            let mut state = engine.read_state().unwrap();
            state.displacement = u.to_vec();
            engine.write_state(&state).unwrap();
            let forces = engine.internal_forces().unwrap();
            // Rigid cases are judged against c10 h^2, the others against their own force.
            let scale = largest(&expected).max(2300.0 * volume.powf(2.0 / 3.0));
            let difference = forces.iter().zip(expected).map(|(a, b)| (*a - b).length()).fold(0.0, f64::max);
            let tolerance = if name != "cpu" { 1e-4 } else { 1e-9 };
            at_most(&format!("{name}, {}", case["case"]), difference / scale, tolerance);
        }
        let elements = Elements::new(&model);
        let averaged = elements.averaged_volumetrics(&model, &u, CellStates::default(), &[]).unwrap();
        let energy = elements.measure(&model, 0, &u, Some(averaged[0]), CellStates::default()).elastic;
        let expected = number(&case["energy_J"]);
        assert!((energy - expected).abs() <= 1e-9 * expected.abs() + 1e-18, "{}: {energy} {expected}", case["case"]);
    }
}

#[test]
fn a_turn_by_two_radians_causes_no_force() {
    let model = tet_model(tissue(), distorted_grid([3, 3, 3], 1e-3, 0.2));
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 2.0);
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        displaced(engine.as_mut(), &model, |x| turn * x - x);
        let forces = engine.internal_forces().unwrap();
        // J - 1 is formed in f32 from entries of order 1, so up to 3e-7 times kappa remain as pressure.
        let allowed = if name != "cpu" { 1e-4 } else { 1e-11 };
        at_most(&format!("{name}, force after a turn over c10 h^2"), largest(&forces) / (2300.0 * 1e-6), allowed);
    }
}

#[test]
fn patch_test_on_a_distorted_mesh() {
    let mesh = distorted_grid([4, 5, 6], 1e-3, 0.25);
    let model = tet_model(tissue(), mesh);
    let gradient =
        DMat3::from_cols(DVec3::new(0.12, 0.05, -0.04), DVec3::new(-0.03, -0.08, 0.06), DVec3::new(0.07, 0.02, -0.1));
    for (name, mut engine) in engines(&model, 1e-6, 1) {
        displaced(engine.as_mut(), &model, |x| gradient * x + DVec3::new(1e-4, -2e-4, 3e-4));
        let forces = engine.internal_forces().unwrap();
        let (mut inside, mut outside): (f64, f64) = (0.0, 0.0);
        for (node, f) in forces.iter().enumerate() {
            let part = if model.node_flags[node] >> 3 == 0 { &mut inside } else { &mut outside };
            *part = part.max(f.length());
        }
        let allowed = if name != "cpu" { 5e-6 } else { 1e-12 };
        at_most(&format!("{name}, inner force over border force"), inside / outside, allowed);
    }
}

#[test]
fn an_affine_border_makes_an_affine_interior() {
    // All faces driven to an affine stretch; inner nodes relax to it.
    let mut scene = tissue();
    scene.solver.mass_damping = 3000.0;
    let stretch = 0.1;
    for face in Face::ALL {
        scene.faces[face as usize] = held(true, true, true);
    }
    let edge = 1e-3;
    let mesh = distorted_grid([4, 4, 4], edge, 0.25);
    let mut model = Model::new(scene, Mesh::Tets(Arc::new(mesh)));
    // Border nodes are put in place at once and held there.
    model.scene.solver.duration = Some(0.01);
    let model = Arc::new(model);
    let dt = 0.8 * wave_speed_bound(&model);
    let field = |x: DVec3| DVec3::new(stretch * x.x, -0.5 * stretch * x.y, 0.3 * stretch * x.x);
    for (name, mut engine) in engines(&model, dt, 200) {
        let mut state = engine.read_state().unwrap();
        for node in 0..model.mesh.node_count() {
            if model.node_flags[node] >> 3 != 0 {
                state.displacement[node] = field(model.mesh.rest_position(node));
            }
        }
        engine.write_state(&state).unwrap();
        let mut step = 0;
        for _ in 0..30 {
            advance(engine.as_mut(), &model, dt, &mut step, 200);
        }
        let u = engine.read_state().unwrap().displacement;
        let worst = (0..u.len()).map(|n| (u[n] - field(model.mesh.rest_position(n))).length()).fold(0.0, f64::max);
        at_most(&format!("{name}, deviation from the affine field over the edge"), worst / edge, 2e-4);
    }
}

#[test]
fn forces_are_the_gradient_of_the_energy() {
    let grid = distorted_grid([3, 2, 4], 1e-3, 0.2);
    for (what, scene) in [("one material", tissue()), ("two materials", two_materials(4e-3))] {
        let model = tet_model(scene, grid.clone());
        assert_eq!(what == "two materials", !model.cell_material.is_empty());
        let mut cpu = CpuEngine::new(model.clone(), 1e-6);
        let elements = Elements::new(&model);
        let energy = |u: &[DVec3]| -> f64 {
            let averaged = elements.averaged_volumetrics(&model, u, CellStates::default(), &[]).unwrap();
            let cells = 0..model.mesh.cell_count();
            cells.map(|c| elements.measure(&model, c, u, Some(averaged[c]), CellStates::default()).elastic).sum()
        };
        let mut worst: f64 = 0.0;
        for (amplitude, seed) in [(0.02, 20), (0.1, 21), (0.3, 22)] {
            let state = shaken(&mut cpu, amplitude, seed, false);
            let forces = cpu.internal_forces().unwrap();
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
        at_most(&format!("force against energy gradient, {what}"), worst, 1e-6);
    }
}

/// Largest difference of the internal forces of GPU and CPU over several fields, each over its largest force.
fn force_difference(gpu: &mut dyn Engine, cpu: &mut dyn Engine) -> f64 {
    let fields = [(0.02, false), (0.1, false), (0.25, false), (0.5, true), (3.0, true)];
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
    // The GPU brings the history to the present step when it gives forces; a step this short leaves the Prony terms.
    let dt = 1e-9;
    for (what, scene) in [
        ("one material", tissue()),
        ("two materials", two_materials(5e-3)),
        ("all effects", with_effects(two_materials(5e-3), 1e9)),
    ] {
        let model = tet_model(scene, distorted_grid([4, 3, 5], 1e-3, 0.2));
        let Some(mut gpu) = gpu_engine(&model, dt, 1) else {
            return;
        };
        let mut cpu = CpuEngine::new(model.clone(), dt);
        at_most(&format!("internal forces, {what}"), force_difference(&mut gpu, &mut cpu), 2e-5);
    }
}

#[test]
fn a_wrong_coefficient_does_not_pass_the_comparison() {
    let grid = distorted_grid([4, 3, 5], 1e-3, 0.2);
    let right = tet_model(tissue(), grid.clone());
    let Some(mut gpu) = gpu_engine(&right, 1e-6, 1) else {
        return;
    };
    for (what, law) in [
        ("c01", ElasticLaw::mooney_rivlin(2300.0, 1010.0, 5.0e5)),
        ("bulk modulus", ElasticLaw::mooney_rivlin(2300.0, 1000.0, 5.005e5)),
    ] {
        let mut scene = tissue();
        scene.material.law = law;
        let mut wrong = CpuEngine::new(tet_model(scene, grid.clone()), 1e-6);
        let difference = force_difference(&mut gpu, &mut wrong);
        println!("{what} changed: {difference:.1e}");
        assert!(difference > 2e-5, "{what}: {difference:e} would pass");
    }
}

#[test]
fn both_engines_take_the_same_steps() {
    for (what, scene) in [
        ("elastic", tissue()),
        ("two materials", two_materials(4e-3)),
        ("all effects", with_effects(two_materials(4e-3), 1.0e3)),
    ] {
        let mut scene = scene;
        scene.faces[Face::ZMin as usize] = held(true, true, true);
        scene.effects.gravity = Some(gravity::Params { acceleration: DVec3::new(0.0, 3.0, -9.81) });
        let model = tet_model(scene, distorted_grid([3, 3, 4], 1e-3, 0.2));
        let dt = 0.6 * wave_speed_bound(&model);
        let Some(mut gpu) = gpu_engine(&model, dt, 40) else {
            return;
        };
        let mut cpu = CpuEngine::new(model.clone(), dt);
        let field = |x: DVec3| DVec3::new(0.1 * x.z, 0.05 * x.x * x.z / 4e-3, 0.08 * x.z * (1.0 + x.y / 4e-3));
        let mut last = [FrameSums::default(), FrameSums::default()];
        let mut states = Vec::new();
        let engines: [&mut dyn Engine; 2] = [&mut gpu, &mut cpu];
        for (engine, sums) in engines.into_iter().zip(&mut last) {
            displaced(engine, &model, field);
            *sums = advance(engine, &model, dt, &mut 0, 40);
            states.push(engine.read_state().unwrap());
        }
        let [found, expected] = last;
        println!("{what}: gpu {found:?}");
        let difference = relative_difference(&states[0].displacement, &states[1].displacement);
        at_most(&format!("{what}, displacement after 40 steps"), difference, 2e-5);
        at_most(
            &format!("{what}, velocity after 40 steps"),
            relative_difference(&states[0].velocity, &states[1].velocity),
            1e-3,
        );
        close(&format!("{what}, elastic energy"), found.energy.elastic, expected.energy.elastic, 1e-3);
        close(&format!("{what}, kinetic energy"), found.energy.kinetic, expected.energy.kinetic, 1e-3);
        at_most(&format!("{what}, J"), (found.health.min_j - expected.health.min_j).abs(), 1e-4);
        assert_eq!(found.health.inverted_cells, expected.health.inverted_cells);
        if what == "all effects" {
            close("plastic dissipation", found.energy.plastic, expected.energy.plastic, 0.01);
            close("damage dissipation", found.energy.damage, expected.energy.damage, 0.01);
            close("viscous dissipation", found.energy.viscous, expected.energy.viscous, 0.01);
            close("largest damage", found.health.largest_damage, expected.health.largest_damage, 0.01);
        }
    }
}

/// Runs a scene on a mesh to its end; prints what a run is judged by.
fn run(what: &str, scene: Scene, mesh: TetMesh, choice: EngineChoice) -> (Simulation, Vec<FrameRecord>, Summary) {
    let begin = std::time::Instant::now();
    let mut simulation = Simulation::with_mesh(scene, Mesh::Tets(Arc::new(mesh)), choice).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{what}: {e}")) {
        records.push(record);
    }
    let mut summary = Summary::default();
    summary.take_frames(&records);
    let smallest = records.iter().map(|r| r.health.min_j).fold(1.0, f64::min);
    println!(
        "{what}: {} tets, {} steps of {:.1} us, {:.1} s wall; imbalance {:.3} %, smallest J {smallest:.3}, clamped {}",
        simulation.model.mesh.cell_count(),
        simulation.total_steps(),
        simulation.dt() * 1e6,
        begin.elapsed().as_secs_f64(),
        100.0 * summary.energy_imbalance,
        summary.clamped_nodes
    );
    (simulation, records, summary)
}

/// The GPU where there is one.
fn best_engine() -> EngineChoice {
    if gpu().is_some() { EngineChoice::Gpu } else { EngineChoice::Cpu }
}

/// The cube of the reference trial: ends bonded, compressed by 30 %.
fn compression(factor: f64) -> Scene {
    let mut scene = tissue();
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize].drive =
        Some(FaceDrive { displacement: DVec3::new(0.0, 0.0, -6e-3), rotation: 0.0, duration: 0.5, cycles: 0 });
    scene.solver.mass_damping = 100.0;
    scene.solver.duration = Some(0.8);
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    scene
}

/// Reactions on the top face of the compressed cube; J of the last frame is printed.
fn compressed(what: &str, mesh: TetMesh, factor: f64, choice: EngineChoice) -> f64 {
    let (mut simulation, records, summary) = run(what, compression(factor), mesh, choice);
    let last = records.last().unwrap();
    let (top, bottom) = (last.reactions[Face::ZMax as usize], last.reactions[Face::ZMin as usize]);
    let state = simulation.engine().read_state().unwrap();
    let model = simulation.model.clone();
    let elements = Elements::new(&model);
    let j = (0..model.mesh.cell_count())
        .map(|c| elements.measure(&model, c, &state.displacement, None, CellStates::default()).jacobian)
        .fold((f64::INFINITY, 0.0f64), |r, j| (r.0.min(j), r.1.max(j)));
    println!("{what}: top {top:.4?} N, bottom {bottom:.4?} N, J {:.3} .. {:.3}", j.0, j.1);
    assert!((top + bottom).length() < 0.005 * top.length(), "the block is at rest");
    assert!(summary.energy_imbalance <= 0.01, "imbalance {}", summary.energy_imbalance);
    assert_eq!((summary.clamped_nodes, summary.inverted_cells), (0, 0));
    // Against the forces of the final displacement.
    let force = simulation.engine().internal_forces().unwrap();
    let sum: DVec3 = (0..force.len()).filter(|n| model.lies_on(*n, Face::ZMax)).map(|n| force[n]).sum();
    close(&format!("{what}, reaction against internal forces"), top.z, sum.z, 1e-3);
    -top.z
}

#[test]
fn compression_of_a_bonded_cube() {
    let choice = best_engine();
    let five = compressed("5 per side", cut_grid([5; 3], 4e-3), 4.0, choice);
    close("reaction with 5 per side [N]", five, 6.11, 0.02);
    let ten = compressed("10 per side", cut_grid([10; 3], 2e-3), 10.0, choice);
    close("reaction with 10 per side [N]", ten, 5.35, 0.02);
    close("converged reaction [N]", ten, 4.65, 0.2);
}

#[test]
fn compression_of_the_imported_cube() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/block5_tet4.vtk");
    let mesh = read(&path, LengthUnit::Metre).unwrap().mesh;
    assert_eq!((mesh.positions.len(), mesh.tets.len()), (216, 750));
    let gpu = compressed("imported", mesh.clone(), 10.0, best_engine());
    close("reaction of the imported cube [N]", gpu, 6.11, 0.02);
    let cpu = compressed("imported, f64", mesh, 10.0, EngineChoice::Cpu64);
    close("reaction on both engines [N]", gpu, cpu, 1e-3);
}

#[test]
fn the_energy_of_a_free_vibration_stays() {
    let mut scene = tissue();
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    let model = tet_model(scene, distorted_grid([4, 4, 6], 1e-3, 0.2));
    let dt = 0.8 * wave_speed_bound(&model);
    for (name, mut engine) in engines(&model, dt, 500) {
        displaced(engine.as_mut(), &model, |x| DVec3::new(5.0 * x.z * x.z, 0.0, 0.0));
        let mut step = 0;
        let energy = |sums: &FrameSums| {
            assert_eq!(sums.health.clamped_nodes, 0);
            sums.energy.elastic + sums.energy.kinetic + sums.energy.half_step
        };
        // Of the second step: nothing moves yet in the first.
        let sums = advance(engine.as_mut(), &model, dt, &mut step, 2);
        let first = energy(&sums);
        let (mut worst, mut least_kinetic, mut most_kinetic): (f64, f64, f64) = (0.0, 1.0, 0.0);
        for _ in 0..20 {
            let sums = advance(engine.as_mut(), &model, dt, &mut step, 500);
            worst = worst.max((energy(&sums) / first - 1.0).abs());
            least_kinetic = least_kinetic.min(sums.energy.kinetic / first);
            most_kinetic = most_kinetic.max(sums.energy.kinetic / first);
        }
        println!("{name}: {step} steps of {:.2} us, kinetic share {least_kinetic:.2} to {most_kinetic:.2}", dt * 1e6);
        at_most(&format!("{name}, drift of the energy"), worst, 0.01);
    }
}

#[test]
fn reactions_of_driven_faces_and_their_work() {
    let mut scene = tissue();
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize] = held(true, true, true);
    scene.faces[Face::ZMax as usize].drive =
        Some(FaceDrive { displacement: DVec3::new(2e-4, -1e-4, 4e-4), rotation: 0.3, duration: 0.02, cycles: 0 });
    scene.solver.mass_damping = 500.0;
    let model = tet_model(scene, distorted_grid([4, 4, 4], 1e-3, 0.2));
    let dt = 0.8 * wave_speed_bound(&model);
    let frames = (0.02 / dt / 20.0) as usize;
    let mut results = Vec::new();
    for (name, mut engine) in engines(&model, dt, 20) {
        let (mut step, mut work, mut damped) = (0, 0.0, 0.0);
        let mut impulse = [DVec3::ZERO; 6];
        let mut last = FrameSums::default();
        for _ in 0..frames {
            last = advance(engine.as_mut(), &model, dt, &mut step, 20);
            work += last.load_work;
            damped += last.energy.damping;
            for (sum, r) in impulse.iter_mut().zip(last.reactions) {
                *sum += r;
            }
        }
        let stored = last.energy.elastic + last.energy.kinetic + last.energy.half_step + damped;
        println!("{name}: work {work:.6e} J, found again {stored:.6e} J, reactions {:?}", last.reactions);
        close(&format!("{name}, work of the face against energy"), stored, work, 0.01);
        let state = engine.read_state().unwrap();
        results.push((work, last.reactions, state.displacement));
    }
    if let [cpu, gpu] = &results[..] {
        close("work of both engines", gpu.0, cpu.0, 1e-3);
        at_most("displacement of both engines", relative_difference(&gpu.2, &cpu.2), 1e-4);
        at_most("reactions of both engines", relative_difference(&gpu.1, &cpu.1), 1e-3);
    }
}

#[test]
fn nearly_incompressible_tissue_runs() {
    for nu in [0.45, 0.48, 0.49, 0.495, 0.499] {
        let mut scene = compression(10.0);
        let mu = 6600.0;
        scene.material.law = ElasticLaw::from_moduli(mu, 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu)), 0.7);
        scene.faces[Face::ZMax as usize].drive =
            Some(FaceDrive { displacement: DVec3::new(0.0, 0.0, -2e-3), rotation: 0.0, duration: 0.1, cycles: 0 });
        scene.solver.duration = Some(0.1);
        let (_, records, summary) = run(&format!("nu {nu}"), scene, cut_grid([4; 3], 5e-3), best_engine());
        assert!(summary.energy_imbalance <= 0.01, "nu {nu}: imbalance {}", summary.energy_imbalance);
        assert_eq!((summary.clamped_nodes, summary.inverted_cells), (0, 0), "nu {nu}");
        assert!(records.last().unwrap().reactions[Face::ZMax as usize].z < 0.0);
    }
}

#[test]
fn slivers_run_with_a_short_step() {
    let mut mesh = cut_grid([4; 3], 1e-3);
    let whole = wave_speed_bound(&tet_model(tissue(), mesh.clone()));
    // One node is moved until a tetrahedron around it has a hundredth of its height left.
    let node = mesh.tets[6 * 21][1] as usize;
    let start = mesh.positions[node];
    let mut smallest = |part: f64| {
        mesh.positions[node] = start + DVec3::new(0.6e-3, 0.9e-3, 1.1e-3) * part;
        (0..mesh.tets.len()).map(|t| mesh.volume(t)).fold(f64::INFINITY, f64::min)
    };
    let wanted = 1e-2 * smallest(0.0);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if smallest(middle) > wanted { low = middle } else { high = middle }
    }
    assert!(smallest(low) < 1.1 * wanted && smallest(low) > 0.0);
    let mut scene = tissue();
    scene.faces[Face::ZMin as usize] = held(true, true, true);
    let model = tet_model(scene, mesh);
    let dt = 0.8 * wave_speed_bound(&model);
    println!("step with a sliver {:.3} us, without {:.3} us", dt * 1e6, 0.8 * whole * 1e6);
    assert!(dt < 0.6 * 0.8 * whole);
    for (name, mut engine) in engines(&model, dt, 500) {
        displaced(engine.as_mut(), &model, |x| DVec3::new(5.0 * x.z * x.z, 0.0, 0.0));
        let mut step = 0;
        let first = advance(engine.as_mut(), &model, dt, &mut step, 1);
        let mut last = first.clone();
        for _ in 0..4 {
            last = advance(engine.as_mut(), &model, dt, &mut step, 500);
        }
        assert_eq!(last.health.clamped_nodes, 0);
        let energy = |s: &FrameSums| s.energy.elastic + s.energy.kinetic + s.energy.half_step;
        close(&format!("{name}, energy"), energy(&last), energy(&first), 0.01);
    }
}

#[test]
fn the_stable_step_is_a_lower_bound() {
    for (what, mesh) in [("cut grid", cut_grid([4; 3], 1e-3)), ("distorted", distorted_grid([4; 3], 1e-3, 0.25))] {
        let model = tet_model(tissue(), mesh);
        let (bound, limit) = (wave_speed_bound(&model), power_iteration(&model));
        println!(
            "{what}: bound {:.3} us, power iteration {:.3} us, ratio {:.2}",
            bound * 1e6,
            limit * 1e6,
            limit / bound
        );
        assert!(bound < limit && limit < 4.0 * bound);
    }
}

#[test]
fn the_forearm_stays_stable_under_gravity() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/meshes/forearm.msh");
    let imported = read(&path, LengthUnit::Millimetre).unwrap();
    println!("{:?}", imported.notices);
    let mesh = imported.mesh;
    println!("{} nodes, {} tets, sets {:?}", mesh.positions.len(), mesh.tets.len(), mesh.node_sets.keys());
    let mut scene = tissue();
    scene.supports.push(Support { set: "bone".into(), fixed: [true; 3] });
    scene.effects.gravity = Some(gravity::Params { acceleration: DVec3::new(0.0, -9.81, 0.0) });
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor: 100.0 });
    scene.solver.mass_damping = 20.0;
    scene.solver.duration = Some(0.1);
    scene.material.law = ElasticLaw::from_moduli(6600.0, 6600.0 * 2.9 / 0.3, 0.7);
    for (tag, mu) in [("fat", 3.0e3), ("skin", 2.0e4), ("tumour", 3.0e4)] {
        scene.regions.push(Region {
            name: tag.into(),
            shape: RegionShape::MeshTag(tag.into()),
            material: TissueMaterial::new(tag, "test", ElasticLaw::from_moduli(mu, mu * 2.9 / 0.3, 0.7), 1000.0),
        });
    }
    let mut deepest = Vec::new();
    let mut choices = vec![EngineChoice::Cpu];
    choices.extend(gpu().map(|_| EngineChoice::Gpu));
    for choice in choices {
        let (mut simulation, _, summary) = run(&format!("forearm {choice:?}"), scene.clone(), mesh.clone(), choice);
        assert_eq!((summary.clamped_nodes, summary.inverted_cells), (0, 0));
        assert!(summary.energy_imbalance <= 0.01, "imbalance {}", summary.energy_imbalance);
        let state = simulation.engine().read_state().unwrap();
        let sag = state.displacement.iter().map(|u| -u.y).fold(0.0, f64::max);
        println!("sag {:.4} mm", sag * 1e3);
        deepest.push(sag);
    }
    assert!(deepest[0] > 1e-6);
    if let [cpu, gpu] = deepest[..] {
        close("sag on both engines [m]", gpu, cpu, 0.01);
    }
}

/// Prints what the stages cost: `cargo test --release --test physics -- --ignored --nocapture cost`.
#[test]
#[ignore = "a measurement, not a test"]
fn cost_of_the_stages() {
    let mut scene = tissue();
    for face in &mut scene.faces[..5] {
        *face = held(true, true, true);
    }
    if std::env::var_os("MASS_SCALING").is_some() {
        scene.effects.mass_scaling = Some(mass_scaling::Params { factor: 1000.0 });
    }
    let model = tet_model(scene, cut_grid([15; 3], 0.8e-3));
    let dt = 0.8 * wave_speed_bound(&model);
    let count = model.mesh.cell_count() as f64;
    let Some(mut gpu) = gpu_engine(&model, dt, 100) else { return };
    let mut best: BTreeMap<&str, f64> = BTreeMap::new();
    for _ in 0..8 {
        for (stage, wall, cpu) in gpu.time_stages(200).unwrap() {
            let cost = cpu.unwrap_or(wall) * 1e9 / count;
            let least = best.entry(stage.name()).or_insert(cost);
            *least = least.min(cost);
        }
    }
    let step: f64 =
        best.iter().filter(|b| !b.0.starts_with("measure_") || *b.0 == "measure_dilatation").map(|b| b.1).sum();
    println!("cpu-ns per tet: {best:.1?}; a step {step:.1}");
}
