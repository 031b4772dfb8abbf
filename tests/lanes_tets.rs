//! Tetrahedra in lanes of f32 beside the f64 engine: forces, bounds, runs with a moving face under gravity, collapsed cells, any number of
//! threads.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use stylet::cpu::{CpuEngine, unknown_to_lanes};
use stylet::effects::{TissueMaterial, fibres, gravity, plasticity, viscoelastic};
use stylet::engine::stable_dt::wave_speed_bound;
use stylet::engine::{Engine, State, StepInput};
use stylet::material::demiray::Demiray;
use stylet::material::ogden::Ogden;
use stylet::material::yeoh::Yeoh;
use stylet::material::{ElasticLaw, Isochoric};
use stylet::mesh::{Mesh, TetMesh};
use stylet::model::Model;
use stylet::scene::{Face, FaceDrive, Region, RegionShape, Scene};
use stylet::simulation::{EngineChoice, Simulation};

use crate::common::{DENSITY, Random, advance, at_most, block, graded_mesh, held, largest, relative_difference};

/// A graded block cut into tetrahedra, its inner nodes moved at random by up to 0.15 mm.
fn distorted(cells: [usize; 3]) -> TetMesh {
    let mut mesh = TetMesh::from_block(&graded_mesh(cells));
    let (low, high) = mesh.bounds();
    let mut random = Random(5);
    for x in &mut mesh.positions {
        let shift = random.vector() * 1.5e-4;
        for a in 0..3 {
            if x[a] > low[a] + 1e-9 && x[a] < high[a] - 1e-9 {
                x[a] += shift[a];
            }
        }
    }
    assert!((0..mesh.tets.len()).all(|t| mesh.volume(t) > 0.0));
    mesh
}

/// Tissue of material A with a stiffer layer of another law and bulk modulus in it.
fn layered() -> Scene {
    with_layer(Isochoric::Yeoh(Yeoh { c10: 4000.0, c20: 900.0, c30: 300.0 }))
}

fn with_layer(isochoric: Isochoric) -> Scene {
    let mut scene = block([1.0; 3], 1.0);
    let law = ElasticLaw { isochoric, bulk_modulus: 3.0e5 };
    scene.regions.push(Region {
        name: "layer".into(),
        shape: RegionShape::Box { low: DVec3::new(-1.0, -1.0, -4e-3), high: DVec3::new(1.0, 1.0, -2e-3) },
        material: TissueMaterial::new("layer", "this test", law, 1200.0),
    });
    scene
}

/// The layered block whose tissue flows, relaxes and has fibres, each material its own way.
fn with_effects() -> Scene {
    let mut scene = layered();
    scene.effects.plasticity = Some(plasticity::Params { yield_stress: 400.0, hardening: 3.0e3 });
    scene.effects.fibres =
        Some(fibres::Params { direction: DVec3::new(1.0, 0.4, -0.3).normalize(), k1: 2.0e3, k2: 0.6 });
    let terms = [(0.3, 2e-3), (0.2, 4e-2)].map(|(ratio, time)| viscoelastic::Term { ratio, time });
    scene.effects.viscoelastic = Some(viscoelastic::Params { terms: terms.to_vec() });
    let layer = &mut scene.regions[0].material;
    layer.plasticity = Some(plasticity::Params { yield_stress: 700.0, hardening: 1.0e3 });
    layer.fibres = Some(fibres::Params { direction: DVec3::Y, k1: 0.0, k2: 1.0 });
    scene
}

fn model(scene: Scene, mesh: TetMesh) -> Arc<Model> {
    Arc::new(Model::new(scene, Mesh::Tets(Arc::new(mesh))))
}

/// The same model in f64 and in lanes.
fn both(model: &Arc<Model>, dt: f64) -> [CpuEngine; 2] {
    let engines = [CpuEngine::new(model.clone(), dt), CpuEngine::in_lanes(model.clone(), dt)];
    assert!(engines[1].info().adapter.contains("lanes of f32"), "{}", engines[1].info().adapter);
    engines
}

/// Random displacements of `amplitude` [m], somewhere else than at rest.
fn shaken(state: &mut State, amplitude: f64, seed: u64) {
    let mut random = Random(seed);
    let rigid = random.vector() * 5e-3;
    state.displacement.iter_mut().for_each(|u| *u = rigid + random.vector() * amplitude);
}

#[test]
fn forces_and_bounds_are_those_of_the_f64_engine() {
    let (mut worst_force, mut worst_bound) = (0.0f64, 0.0f64);
    // Numbers of cells that fill no group, of one material and of two; lines of nodes that are not full.
    let ogden = with_layer(Isochoric::Ogden(Ogden { mu: 12.9e3, alpha: 6.5 }));
    for (scene, cells) in [
        (layered(), [5, 4, 6]),
        (block([1.0; 3], 1.0), [3, 3, 3]),
        (layered(), [1, 1, 1]),
        (ogden.clone(), [5, 4, 6]),
        (ogden, [3, 3, 3]),
        (with_layer(Isochoric::Demiray(Demiray { mu: 6000.0, b: 4.0 })), [5, 4, 6]),
    ] {
        let model = model(scene, distorted(cells));
        let [mut exact, mut lanes] = both(&model, 1e-6);
        let input = StepInput::at(&model, 0.0, 1e-6);
        // The last two leave the range of the lanes in some cells, and turn some inside out.
        for (seed, amplitude) in [1e-6, 2e-5, 1e-4, 2e-4, 4e-4, 1.5e-3].into_iter().enumerate() {
            let mut state = exact.read_state().unwrap();
            shaken(&mut state, amplitude, seed as u64 + 3);
            exact.write_state(&state).unwrap();
            lanes.write_state(&state).unwrap();
            let (force, bound) = exact.forces_and_bounds(&input);
            let (force_found, bound_found) = lanes.forces_and_bounds(&input);
            let difference = relative_difference(&force_found, &force);
            assert!(difference < 1e-5, "{cells:?}, {amplitude}: forces {difference:.1e} apart");
            worst_force = worst_force.max(difference);
            for (node, (found, exact)) in bound_found.iter().zip(&bound).enumerate() {
                let difference = (found / exact - 1.0).abs();
                assert!(difference < 2e-5, "{cells:?}, {amplitude}, node {node}: bounds {found} {exact}");
                worst_bound = worst_bound.max(difference);
            }
        }
    }
    println!("forces {worst_force:.1e}, bounds {worst_bound:.1e} apart");
}

#[test]
fn a_wrong_bulk_modulus_does_not_pass_the_comparison() {
    let forces = |bulk_modulus: f64, lanes: bool| {
        let mut scene = layered();
        scene.material =
            TissueMaterial::new("A", "this test", ElasticLaw::mooney_rivlin(2300.0, 1000.0, bulk_modulus), DENSITY);
        let model = model(scene, distorted([5, 4, 6]));
        let make = if lanes { CpuEngine::in_lanes } else { CpuEngine::new };
        let mut engine = make(model, 1e-6);
        let mut state = engine.read_state().unwrap();
        shaken(&mut state, 1e-4, 3);
        engine.write_state(&state).unwrap();
        engine.internal_forces().unwrap()
    };
    let difference = |bulk| relative_difference(&forces(bulk, true), &forces(5.0e5, false));
    assert!(difference(5.0e5) < 1e-5);
    assert!(difference(5.0025e5) > 1e-5, "{:.1e} would pass", difference(5.0025e5));
}

/// A block under gravity, held below, its top face pressed down and turned.
fn pressed(mut scene: Scene, cells: [usize; 3]) -> Arc<Model> {
    scene.effects.gravity = Some(gravity::Params { acceleration: DVec3::new(0.0, 3.0, -9.81) });
    for face in [Face::ZMin, Face::ZMax] {
        scene.faces[face as usize] = held(true, true, true);
    }
    scene.faces[Face::ZMax as usize].drive =
        Some(FaceDrive { displacement: DVec3::new(3e-4, 0.0, -1e-3), rotation: 0.3, duration: 0.03, cycles: 0 });
    model(scene, distorted(cells))
}

#[test]
fn a_moving_face_under_gravity_does_what_it_does_in_f64() {
    for (what, scene) in [("elastic", layered()), ("with effects", with_effects())] {
        println!("{what}");
        does_what_it_does_in_f64(&pressed(scene, [6, 5, 7]), what == "with effects");
    }
}

fn does_what_it_does_in_f64(model: &Arc<Model>, flows: bool) {
    let dt = 0.5 * wave_speed_bound(model);
    let mut engines = both(model, dt);
    let mut dissipated = [[0.0; 2]; 2];
    let (mut peak, mut apart, mut imbalance) = (0.0f64, 0.0f64, 0.0f64);
    let (mut step, frames) = (0, 30);
    let steps = (0.03 / dt / frames as f64).ceil() as usize;
    for _ in 0..frames {
        let begin = step;
        let [exact, found] = engines.each_mut().map(|engine| {
            step = begin;
            advance(engine, model, dt, &mut step, steps)
        });
        for (total, sums) in dissipated.iter_mut().zip([&exact, &found]) {
            *total = [total[0] + sums.energy.plastic, sums.energy.viscous];
            assert_eq!(sums.health.return_failures, 0);
        }
        for face in [Face::ZMin, Face::ZMax] {
            peak = peak.max(exact.reactions[face as usize].length());
            apart = apart.max((exact.reactions[face as usize] - found.reactions[face as usize]).length());
        }
        imbalance = imbalance.max((exact.energy.elastic - found.energy.elastic).abs() / exact.energy.elastic);
        // Flow ends in f32 where the overstress is worth 2e-6 of strain.
        let allowed = if flows { 1e-4 } else { 1e-5 };
        at_most("least J apart", (exact.health.min_j - found.health.min_j).abs(), allowed);
        assert_eq!(exact.health.inverted_cells, found.health.inverted_cells);
    }
    assert!(peak > 0.02, "nothing happens: {peak} N");
    for (name, i) in [("flow", 0), ("relaxation", 1)] {
        let [exact, found] = dissipated.map(|of| of[i]);
        assert_eq!(exact > 0.0, flows, "{name}: {exact} J");
        at_most(&format!("dissipated by {name}, apart"), (found - exact).abs() / exact.max(1e-30), 1e-3);
    }
    // Flow begins in f32 where the stress is a thousandth beyond the yield stress: both forces lag by as much where it comes and goes.
    let allowed = if flows { 2e-3 } else { 1e-4 };
    at_most("reactions apart, of the peak", apart / peak, allowed);
    at_most("elastic energy apart", imbalance, allowed);
    let [exact, found] = engines.map(|mut engine| engine.read_state().unwrap().displacement);
    println!("peak {peak:.3} N, displacement up to {:.2e} m", largest(&exact));
    at_most("displacement apart, of the largest", relative_difference(&found, &exact), 1e-4);
}

#[test]
fn no_bit_hangs_on_the_number_of_threads() {
    // Cells enough for as many threads.
    for scene in [layered(), with_effects()] {
        hangs_on_no_number_of_threads(&pressed(scene, [8, 8, 8]));
    }
}

fn hangs_on_no_number_of_threads(model: &Arc<Model>) {
    let dt = 0.5 * wave_speed_bound(model);
    let state = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let [_, mut engine] = both(model, dt);
            let mut step = 0;
            let sums: Vec<_> = (0..4).map(|_| advance(&mut engine, model, dt, &mut step, 25)).collect();
            (engine.read_state().unwrap(), sums)
        })
    };
    let alone = state(1);
    assert!(largest(&alone.0.displacement) > 1e-5);
    for threads in [2, 3] {
        assert!(state(threads) == alone, "{threads} threads");
    }
}

#[test]
fn a_collapsed_cell_is_caught_as_in_f64() {
    let model = pressed(layered(), [5, 4, 6]);
    let dt = 0.2 * wave_speed_bound(&model);
    let mut engines = both(&model, dt);
    // An inner node goes through the face across from it.
    let node = model.mesh.cell_nodes(model.mesh.cell_count() / 2 + 30)[0];
    let sums = engines.each_mut().map(|engine| {
        let mut state = engine.read_state().unwrap();
        state.displacement[node] = DVec3::new(1.2e-3, 0.9e-3, 1.1e-3);
        engine.write_state(&state).unwrap();
        advance(engine, &model, dt, &mut 0, 1)
    });
    let [exact, found] = sums.map(|sums| sums.health);
    assert!(exact.inverted_cells > 0 && exact.min_j < 0.0, "{exact:?}");
    assert_eq!((found.inverted_cells, found.inverted_cell), (exact.inverted_cells, exact.inverted_cell));
    assert!((found.min_j - exact.min_j).abs() < 1e-5);
    let [exact, found] = engines.each_mut().map(|engine| engine.internal_forces().unwrap());
    at_most("forces beside it apart", relative_difference(&found, &exact), 1e-5);
    // A displacement that is no number spreads to the cells around the node, and is told.
    for engine in &mut engines {
        let mut state = engine.read_state().unwrap();
        state.displacement[node].x = f64::NAN;
        engine.write_state(&state).unwrap();
    }
    let [exact, found] = engines.each_mut().map(|engine| engine.internal_forces().unwrap());
    let finite = |forces: &[DVec3]| forces.iter().map(|f| f.is_finite()).collect::<Vec<bool>>();
    assert_eq!(finite(&found), finite(&exact));
    assert!(!found[node].is_finite());
}

#[test]
fn an_imported_mesh_runs_in_lanes_and_says_so() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/forearm.toml");
    let scene = Scene::load(&path, &[]).unwrap();
    assert_eq!(unknown_to_lanes(&scene), None);
    let first = |choice: EngineChoice| {
        let mut simulation = Simulation::new(scene.clone(), choice).unwrap();
        simulation.next_frame().unwrap().unwrap();
        (simulation.engine().info().adapter.clone(), simulation.engine().read_state().unwrap().displacement)
    };
    let ((told, found), (_, exact)) = (first(EngineChoice::Cpu), first(EngineChoice::Cpu64));
    assert!(told.contains("lanes of f32"), "{told}");
    at_most("displacement of the imported mesh apart", relative_difference(&found, &exact), 1e-4);
}
