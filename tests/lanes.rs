//! Cells of a block in lanes of f32 beside the f64 engine: forces, bounds, whole runs, any number of threads, and what lanes do not know.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use stylet::cpu::{CpuEngine, unknown_to_lanes};
use stylet::effects::TissueMaterial;
use stylet::engine::{Engine, State, StepInput};
use stylet::error::Error;
use stylet::material::ElasticLaw;
use stylet::material::Isochoric;
use stylet::material::neo_hookean::NeoHookean;
use stylet::material::yeoh::Yeoh;
use stylet::mesh::{BlockMesh, Mesh};
use stylet::model::Model;
use stylet::scene::{Face, Scene};
use stylet::simulation::{EngineChoice, Simulation};

use crate::common::{DENSITY, MATERIAL_A, Random, at_most, block, graded_mesh, held, relative_difference};

fn law(isochoric: Isochoric) -> TissueMaterial {
    TissueMaterial::new("lanes", "this test", ElasticLaw { isochoric, bulk_modulus: 5.0e5 }, DENSITY)
}

/// A graded block of each law; with a free bottom, and held there.
fn models() -> Vec<(&'static str, Arc<Model>)> {
    let laws = [
        ("Mooney-Rivlin", MATERIAL_A.isochoric),
        ("neo-Hooke", Isochoric::NeoHookean(NeoHookean { c10: 3300.0 })),
        ("Yeoh", Isochoric::Yeoh(Yeoh { c10: 2500.0, c20: 900.0, c30: 300.0 })),
    ];
    let model = |cells: [usize; 3], isochoric: Isochoric, is_held: bool| {
        let mut scene = block([1.0; 3], 1.0);
        scene.material = law(isochoric);
        if is_held {
            scene.faces[Face::ZMin as usize] = held(true, true, true);
        }
        Arc::new(Model::new(scene, graded_mesh(cells)))
    };
    // Rows shorter and longer than a vector, and a number of cells that fills none.
    let cells = [[5, 4, 9], [16, 3, 2], [35, 2, 3], [1, 1, 1]];
    let one = |(name, isochoric): (&'static str, Isochoric)| cells.map(|c| (name, model(c, isochoric, c[0] == 16)));
    laws.into_iter().flat_map(one).collect()
}

/// Random displacements of `amplitude` [m] at every node, somewhere else than at rest.
fn shaken(model: &Model, state: &mut State, amplitude: f64, seed: u64) {
    let mut random = Random(seed);
    let rigid = random.vector() * 5e-3;
    for (node, u) in state.displacement.iter_mut().enumerate() {
        let still = model.fixed_components(node)[0];
        *u = if still { DVec3::ZERO } else { rigid + random.vector() * amplitude };
    }
}

#[test]
fn forces_and_bounds_are_those_of_the_f64_engine() {
    let (mut worst_force, mut worst_bound) = (0.0f64, 0.0f64);
    for (name, model) in models() {
        let mut exact = CpuEngine::new(model.clone(), 1e-6);
        let mut lanes = CpuEngine::in_lanes(model.clone(), 1e-6);
        assert!(lanes.info().adapter.contains("lanes of f32"), "{}", lanes.info().adapter);
        let input = StepInput::at(&model, 0.0, 1e-6);
        // The last two leave the range of the lanes in some cells: these are computed in f64.
        for (seed, amplitude) in [1e-6, 2e-5, 1e-4, 3e-4, 6e-4, 1.5e-3].into_iter().enumerate() {
            let mut state = exact.read_state().unwrap();
            shaken(&model, &mut state, amplitude, seed as u64 + 3);
            exact.write_state(&state).unwrap();
            lanes.write_state(&state).unwrap();
            let (force, bound) = exact.forces_and_bounds(&input);
            let (force_found, bound_found) = lanes.forces_and_bounds(&input);
            let difference = relative_difference(&force_found, &force);
            assert!(difference < 1e-5, "{name}, {amplitude}: forces {difference:.1e} apart");
            worst_force = worst_force.max(difference);
            for (node, (found, exact)) in bound_found.iter().zip(&bound).enumerate() {
                let difference = (found / exact - 1.0).abs();
                assert!(difference < 2e-5, "{name}, {amplitude}, node {node}: bounds {found} {exact}");
                worst_bound = worst_bound.max(difference);
            }
        }
    }
    println!("forces {worst_force:.1e}, bounds {worst_bound:.1e} apart");
}

#[test]
fn a_wrong_constant_does_not_pass_the_comparison() {
    for (name, wrong) in [
        ("c10", ElasticLaw::mooney_rivlin(2311.5, 1000.0, 5.0e5)),
        ("c01", ElasticLaw::mooney_rivlin(2300.0, 1005.0, 5.0e5)),
        ("bulk modulus", ElasticLaw::mooney_rivlin(2300.0, 1000.0, 5.0025e5)),
    ] {
        let engine = |law: ElasticLaw, lanes: bool| {
            let mut scene = block([1.0; 3], 1.0);
            scene.material.law = law;
            let model = Arc::new(Model::new(scene, graded_mesh([5, 4, 9])));
            let mut engine =
                if lanes { CpuEngine::in_lanes(model.clone(), 1e-6) } else { CpuEngine::new(model.clone(), 1e-6) };
            let mut state = engine.read_state().unwrap();
            shaken(&model, &mut state, 1e-4, 3);
            engine.write_state(&state).unwrap();
            engine.internal_forces().unwrap()
        };
        let difference = relative_difference(&engine(wrong, true), &engine(MATERIAL_A, false));
        assert!(difference > 1e-5, "{name}: {difference:.1e} would pass");
    }
}

fn run(scene: Scene, choice: EngineChoice) -> Simulation {
    Simulation::new(scene, choice).unwrap()
}

fn scene(name: &str, changes: &[&str]) -> Scene {
    let changes: Vec<String> = changes.iter().map(|c| c.to_string()).collect();
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name), &changes).unwrap()
}

/// Scenes with layers, friction, cohesive faces, opened paths, free paths, a bent needle, an indenter and driven faces: short.
const SCENES: [(&str, &[&str]); 8] = [
    (
        "muscle_biopsy.toml",
        &["tissue.cell_size_mm=1.6", "motion.phase.0.depth_mm=5.0", "motion.phase.0.speed_mm_s=10.0"],
    ),
    ("opening.toml", &["tissue.cell_size_mm=1.6", "motion.phase.0.depth_mm=7.0", "motion.phase.0.speed_mm_s=10.0"]),
    ("layers.toml", &["tissue.cell_size_mm=1.6"]),
    ("effects/cohesive.toml", &[]),
    ("effects/flexible_needle.toml", &["tissue.cell_size_mm=2.0"]),
    ("effects/indentation.toml", &[]),
    ("free_hand/two_tracks.toml", &["tissue.cell_size_mm=2.0"]),
    ("validation/twist.toml", &[]),
];

#[test]
fn runs_have_the_forces_and_the_account_of_the_f64_engine() {
    const FRAMES: usize = 90;
    for (name, changes) in SCENES {
        let (mut exact, mut lanes) =
            (run(scene(name, changes), EngineChoice::Cpu64), run(scene(name, changes), EngineChoice::Cpu));
        assert!(lanes.engine().info().adapter.contains("lanes of f32"), "{name}: {}", lanes.engine().info().adapter);
        assert_eq!([exact.engine().info().engine.as_str(), lanes.engine().info().engine.as_str()], ["cpu64", "cpu"]);
        let (mut peak, mut apart, mut imbalance) = (0.0f64, 0.0f64, 0.0f64);
        for _ in 0..FRAMES {
            let (Some(a), Some(b)) = (exact.next_frame().unwrap(), lanes.next_frame().unwrap()) else { break };
            let forces = |r: &stylet::observables::FrameRecord| {
                let reactions = r.reactions.map(|f| f.z);
                [r.force.axial, reactions[4], reactions[5]]
            };
            for (a, b) in forces(&a).into_iter().zip(forces(&b)) {
                peak = peak.max(a.abs());
                apart = apart.max((a - b).abs());
            }
            imbalance = imbalance.max((a.energy.imbalance() - b.energy.imbalance()).abs());
        }
        println!("{name}: peak {peak:.4e} N, {:.1e} of it apart, imbalance {imbalance:.1e} J apart", apart / peak);
        assert!(peak > 1e-3, "{name}: nothing happens");
        at_most(&format!("{name}: forces apart, of the peak"), apart / peak, 1e-4);
    }
}

#[test]
fn no_bit_hangs_on_the_number_of_threads() {
    let state = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            // Cells enough for seven threads.
            let mut simulation = run(scene("muscle_biopsy.toml", &["tissue.cell_size_mm=0.65"]), EngineChoice::Cpu);
            assert!(simulation.model.mesh.cell_count() > 7 * 800);
            let records: Vec<_> = (0..8).map(|_| simulation.next_frame().unwrap()).collect();
            (simulation.engine().read_state().unwrap(), records)
        })
    };
    let alone = state(1);
    for threads in [2, 3, 7] {
        assert!(state(threads) == alone, "{threads} threads");
    }
}

#[test]
fn a_checkpoint_of_lanes_goes_on_in_lanes_only() {
    let small = || scene("muscle_biopsy.toml", &["tissue.cell_size_mm=2.0"]);
    let mut lanes = run(small(), EngineChoice::Cpu);
    for _ in 0..4 {
        lanes.next_frame().unwrap();
    }
    let image = lanes.engine().save().unwrap();
    assert_eq!(image.engine(), "cpu");
    let after: Vec<_> = (0..3).map(|_| lanes.next_frame().unwrap()).collect();
    lanes.engine().restore(&image).unwrap();
    assert_eq!(lanes.engine().save().unwrap(), image);
    assert_eq!(after.len(), 3);
    let Err(Error::Input { message, .. }) = run(small(), EngineChoice::Cpu64).engine().restore(&image) else {
        panic!("taken by the f64 engine");
    };
    assert!(message.contains("engine `cpu`, this is `cpu64`"), "{message}");
}

#[test]
fn what_lanes_do_not_know_is_told_and_computed_in_f64() {
    for (name, word) in [
        ("effects/plasticity.toml", "plasticity"),
        ("effects/viscoelastic.toml", "viscoelasticity"),
        ("effects/fibres.toml", "fibres"),
        ("effects/damage.toml", "plasticity"),
        ("lv2022/hollow.toml", "hollow needle"),
    ] {
        let scene = scene(name, &[]);
        let mesh = Mesh::of_scene(&scene);
        let unknown = unknown_to_lanes(&scene, &mesh).unwrap_or_else(|| panic!("{name}: known"));
        assert!(unknown.contains(word), "{name}: {unknown}");
        let engine = CpuEngine::in_lanes(Arc::new(Model::new(scene, mesh)), 1e-7);
        let told = &engine.info().adapter;
        assert!(told.contains("f64: lanes do not know") && told.contains(word), "{name}: {told}");
    }
    let mut ogden = block([4.0; 3], 1.0);
    let known = stylet::material::LawWord::Ogden.law();
    ogden.material = law((known.build)(known.example));
    let mesh = Mesh::Block(BlockMesh::for_scene(&ogden));
    assert_eq!(unknown_to_lanes(&ogden, &mesh).as_deref(), Some("the law ogden"));
}
