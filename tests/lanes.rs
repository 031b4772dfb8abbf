//! Cells of a block in lanes of f32 beside the f64 engine: forces, bounds, whole runs, any number of threads, and what lanes do not know.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use stylet::cpu::{CpuEngine, unknown_to_lanes};
use stylet::effects::{TissueMaterial, cohesive};
use stylet::engine::{Engine, FramePlan, FrameSums, State, StepInput};
use stylet::error::Error;
use stylet::material::ElasticLaw;
use stylet::material::Isochoric;
use stylet::material::demiray::Demiray;
use stylet::material::neo_hookean::NeoHookean;
use stylet::material::ogden::Ogden;
use stylet::material::yeoh::Yeoh;
use stylet::mesh::{BlockMesh, Mesh};
use stylet::model::Model;
use stylet::scene::{Face, Region, RegionShape, Scene};
use stylet::simulation::{EngineChoice, Simulation};

use crate::common::{DENSITY, MATERIAL_A, Random, at_most, block, graded_mesh, held, relative_difference};

fn law(isochoric: Isochoric) -> TissueMaterial {
    TissueMaterial::new("lanes", "this test", ElasticLaw { isochoric, bulk_modulus: 5.0e5 }, DENSITY)
}

/// The law of the preset `nerve`.
const OGDEN: Ogden = Ogden { mu: 12.9e3, alpha: 6.5 };

fn demiray() -> Isochoric {
    Isochoric::Demiray(Demiray { mu: 6000.0, b: 4.0 })
}

/// Rows of cells of which one half is of Ogden's law or Demiray's, the other of a polynomial.
fn of_two_laws(cells: [usize; 3], exponential: bool) -> Arc<Model> {
    let mut scene = block([1.0; 3], 1.0);
    let ogden = Isochoric::Ogden(Ogden { mu: 3.0e4, alpha: 16.55 });
    scene.regions.push(Region {
        name: "half".into(),
        shape: RegionShape::Box { low: DVec3::splat(-1.0), high: DVec3::new(0.0, 1.0, 1.0) },
        material: law(if exponential { demiray() } else { ogden }),
    });
    let model = Model::new(scene, graded_mesh(cells));
    assert!(model.cell_material.contains(&0) && model.cell_material.contains(&1));
    Arc::new(model)
}

/// The grid around a hollow needle as a block of its own, its copies all tied: bent lines, doubled ones, one of them across.
fn around_a_bore(isochoric: Isochoric) -> Arc<Model> {
    let changes = ["tissue.cell_size_mm=1.0", "tissue.size_mm=[14, 12, 8]", "motion.phase.0.depth_mm=4"];
    let mut mesh = BlockMesh::for_scene(&self::scene("lv2022/hollow.toml", &changes));
    mesh.split(2, -3e-3);
    assert!(mesh.bore.is_some());
    let mut scene = block([1.0; 3], 1.0);
    scene.material = law(isochoric);
    // Copies are tied where nothing may part.
    scene.effects.cohesive = Some(cohesive::Params::default());
    let model = Model::new(scene, mesh);
    assert!(model.separation.pairs.is_empty() && model.separation.ties.iter().any(|tie| tie.len() == 8));
    Arc::new(model)
}

/// A graded block of each law; with a free bottom, and held there; and the grid around a hollow needle.
fn models() -> Vec<(&'static str, Arc<Model>)> {
    let laws = [
        ("Mooney-Rivlin", MATERIAL_A.isochoric),
        ("neo-Hooke", Isochoric::NeoHookean(NeoHookean { c10: 3300.0 })),
        ("Yeoh", Isochoric::Yeoh(Yeoh { c10: 2500.0, c20: 900.0, c30: 300.0 })),
        ("Ogden", Isochoric::Ogden(OGDEN)),
        ("Ogden of areas", Isochoric::Ogden(Ogden { mu: 7.0e3, alpha: -4.0 })),
        ("Demiray", demiray()),
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
    let bored = laws.map(|(name, isochoric)| (name, around_a_bore(isochoric)));
    let sizes = [([5, 4, 9], false), ([35, 2, 3], false), ([35, 2, 3], true)];
    let mixed = sizes.map(|(cells, exponential)| ("two laws", of_two_laws(cells, exponential)));
    laws.into_iter().flat_map(one).chain(bored).chain(mixed).collect()
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

#[test]
fn a_wrong_circle_does_not_pass_the_comparison() {
    let right = around_a_bore(MATERIAL_A.isochoric);
    let mut mesh = right.mesh.block().clone();
    let bore = mesh.bore.as_mut().unwrap();
    bore.outer *= 1.001;
    let wrong = Arc::new(Model::new(right.scene.clone(), mesh));
    let forces = |model: Arc<Model>, lanes: bool| {
        let mut engine =
            if lanes { CpuEngine::in_lanes(model.clone(), 1e-6) } else { CpuEngine::new(model.clone(), 1e-6) };
        let mut state = engine.read_state().unwrap();
        shaken(&model, &mut state, 2e-5, 3);
        engine.write_state(&state).unwrap();
        engine.internal_forces().unwrap()
    };
    let difference = relative_difference(&forces(wrong, true), &forces(right, false));
    assert!(difference > 1e-5, "{difference:.1e} would pass");
}

#[test]
fn tied_copies_stay_together_to_the_last_bit() {
    let mut simulation = run(scene("lv2022/hollow.toml", &[COARSE, FAST]), EngineChoice::Cpu);
    for _ in 0..30 {
        simulation.next_frame().unwrap();
    }
    let model = simulation.model.clone();
    let state = simulation.engine().read_state().unwrap();
    let mut moved = 0.0f64;
    for tie in &model.separation.ties {
        let [first, others @ ..] = &tie[..] else { panic!("a tie of nothing") };
        let at = |node: u32| (state.displacement[node as usize], state.velocity[node as usize]);
        others.iter().for_each(|node| assert_eq!(at(*node), at(*first), "nodes {node} and {first}"));
        moved = moved.max(at(*first).0.length());
    }
    assert!(
        model.separation.ties.len() > 500 && moved > 1e-4,
        "{} ties, moved by {moved}",
        model.separation.ties.len()
    );
}

fn run(scene: Scene, choice: EngineChoice) -> Simulation {
    Simulation::new(scene, choice).unwrap()
}

fn scene(name: &str, changes: &[&str]) -> Scene {
    let changes: Vec<String> = changes.iter().map(|c| c.to_string()).collect();
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name), &changes).unwrap()
}

const COARSE: &str = "tissue.cell_size_mm=0.9";
const FAST: &str = "motion.phase.0.speed_mm_s=10.0";

/// Scenes with layers, friction, cohesive faces, opened paths, free paths, a hollow and a bent needle, an indenter and driven faces: short.
const SCENES: [(&str, &[&str]); 19] = [
    ("anatomy/neck_vein.toml", &["tissue.cell_size_mm=1.8"]),
    ("lv2022/hollow.toml", &[COARSE, FAST]),
    (
        "calibrated/muscle_biopsy.toml",
        &["tissue.cell_size_mm=1.6", "motion.phase.0.depth_mm=5.0", "motion.phase.0.speed_mm_s=10.0"],
    ),
    ("opening.toml", &["tissue.cell_size_mm=1.6", "motion.phase.0.depth_mm=7.0", "motion.phase.0.speed_mm_s=10.0"]),
    // A path across the cells.
    (
        "opening.toml",
        &[
            "tissue.cell_size_mm=1.3",
            "motion.phase.0.depth_mm=7.0",
            "motion.phase.0.speed_mm_s=10.0",
            "motion.angle_deg=25.0",
            "motion.azimuth_deg=40.0",
        ],
    ),
    // A law that the points know in f64 only.
    (
        "opening.toml",
        &[
            "tissue.cell_size_mm=1.6",
            "material.preset=nerve",
            "material.toughness_j_m2=164.0",
            "motion.phase.0.depth_mm=5.0",
            "motion.phase.0.speed_mm_s=10.0",
        ],
    ),
    ("layers.toml", &["tissue.cell_size_mm=1.6"]),
    // A layer of Ogden's law among polynomial ones.
    ("layers.toml", &["tissue.cell_size_mm=1.6", "region.1.material.preset=nerve"]),
    ("effects/cohesive.toml", &[]),
    ("effects/flexible_needle.toml", &["tissue.cell_size_mm=2.0"]),
    ("effects/indentation.toml", &[]),
    ("free_hand/two_tracks.toml", &["tissue.cell_size_mm=2.0"]),
    ("validation/twist.toml", &[]),
    ("effects/plasticity.toml", &[]),
    ("effects/viscoelastic.toml", &[]),
    ("effects/fibres.toml", &[]),
    ("calibrated/muscle_biopsy.toml", &["tissue.cell_size_mm=1.6", UNDER_GRAVITY, "motion.phase.0.depth_mm=5.0", FAST]),
    // Points that f64 carries, for the fibres.
    (
        "opening.toml",
        &[
            "tissue.cell_size_mm=1.6",
            WITH_FIBRES,
            "fibres.k2=0.0001",
            "fibres.k1_kpa=2",
            "motion.phase.0.depth_mm=5.0",
            FAST,
        ],
    ),
    (
        "calibrated/muscle_biopsy.toml",
        &["tissue.cell_size_mm=1.6", WITH_ALL, SLOW_FAILURE, "motion.phase.0.depth_mm=5.0", FAST],
    ),
];

const SLOW_FAILURE: &str = "damage={failure_displacement_mm=2.0}";
const UNDER_GRAVITY: &str = "effects=[\"puncture\", \"friction\", \"mass_scaling\", \"gravity\"]";
const WITH_FIBRES: &str = "effects=[\"puncture\", \"friction\", \"mass_scaling\", \"fibres\"]";
const WITH_ALL: &str =
    "effects=[\"puncture\", \"friction\", \"mass_scaling\", \"fibres\", \"plasticity\", \"damage\", \"viscoelastic\"]";

#[test]
fn runs_have_the_forces_and_the_account_of_the_f64_engine() {
    const FRAMES: usize = 90;
    for (name, changes) in SCENES {
        let (mut exact, mut lanes) =
            (run(scene(name, changes), EngineChoice::Cpu64), run(scene(name, changes), EngineChoice::Cpu));
        assert!(lanes.engine().info().adapter.contains("lanes of f32"), "{name}: {}", lanes.engine().info().adapter);
        assert_eq!([exact.engine().info().engine.as_str(), lanes.engine().info().engine.as_str()], ["cpu64", "cpu"]);
        let (mut peak, mut apart, mut imbalance) = (0.0f64, 0.0f64, 0.0f64);
        let (mut largest, mut energy) = (0.0f64, 0.0f64);
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
            let stored = |r: &stylet::observables::FrameRecord| [r.energy.elastic, r.energy.hourglass];
            largest = largest.max(stored(&a)[0]);
            for (a, b) in stored(&a).into_iter().zip(stored(&b)) {
                energy = energy.max((a - b).abs());
            }
        }
        println!("{name}: peak {peak:.4e} N, {:.1e} of it apart, imbalance {imbalance:.1e} J apart", apart / peak);
        assert!(peak > 1e-3, "{name}: nothing happens");
        at_most(&format!("{name}: forces apart, of the peak"), apart / peak, 1e-4);
        at_most(&format!("{name}: stored energies apart, of the largest"), energy / largest, 2e-4);
    }
}

#[test]
fn cells_are_measured_as_by_the_f64_engine() {
    let still = FramePlan { frame: 0, first_step: 0, steps: Vec::new(), centre_line: None };
    let mut upside_down = 0;
    for (name, model) in models() {
        let mut exact = CpuEngine::new(model.clone(), 1e-6);
        let mut lanes = CpuEngine::in_lanes(model.clone(), 1e-6);
        // The smallest strains are below the digits of f32, the largest turn cells inside out.
        for (seed, amplitude) in [1e-8, 1e-7, 1e-5, 1e-4, 3e-4, 6e-4, 1.5e-3].into_iter().enumerate() {
            let mut state = exact.read_state().unwrap();
            shaken(&model, &mut state, amplitude, seed as u64 + 3);
            let measured = |engine: &mut CpuEngine| {
                engine.write_state(&state).unwrap();
                engine.start_frame(&still).unwrap();
                engine.collect(true).unwrap().unwrap()
            };
            let (a, b) = (measured(&mut exact), measured(&mut lanes));
            let apart = |a: f64, b: f64| (a - b).abs() / a.abs();
            // Displacements are kept on a grid of 2^-44 m, which is 6e-6 of the smallest ones, and more of what a mode has of them.
            let allowed = if amplitude < 5e-8 { 5e-3 } else { 2e-5 };
            for (what, a, b) in [
                ("elastic energy", a.energy.elastic, b.energy.elastic),
                ("hourglass energy", a.energy.hourglass, b.energy.hourglass),
                ("least J", a.health.min_j, b.health.min_j),
                ("least J of a corner", a.health.min_corner_j, b.health.min_corner_j),
            ] {
                at_most(&format!("{name}, {amplitude:e}: {what} {a:e} {b:e}"), apart(a, b), allowed);
            }
            let counts = |s: &FrameSums| (s.health.inverted_cells, s.health.folded_cells, s.health.inverted_cell);
            assert_eq!(counts(&a), counts(&b), "{name}, {amplitude:e}");
            upside_down += a.health.inverted_cells;
        }
    }
    assert!(upside_down > 10, "{upside_down}");
}

#[test]
fn no_bit_hangs_on_the_number_of_threads() {
    // Cells enough for seven threads.
    for (name, changes) in [
        ("calibrated/muscle_biopsy.toml", &["tissue.cell_size_mm=0.65", FAST][..]),
        ("calibrated/muscle_biopsy.toml", &["tissue.cell_size_mm=0.65", FAST, WITH_ALL, SLOW_FAILURE]),
        ("lv2022/hollow.toml", &["tissue.cell_size_mm=0.7", FAST]),
        ("opening.toml", &["tissue.cell_size_mm=0.52", FAST]),
    ] {
        let state = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut simulation = run(scene(name, changes), EngineChoice::Cpu);
                assert!(simulation.model.mesh.cell_count() > 7 * 800);
                let records: Vec<_> = (0..8).map(|_| simulation.next_frame().unwrap()).collect();
                (simulation.engine().read_state().unwrap(), records)
            })
        };
        let alone = state(1);
        for threads in [2, 3, 7] {
            assert!(state(threads) == alone, "{name}, {threads} threads");
        }
    }
}

#[test]
fn a_checkpoint_of_lanes_goes_on_in_lanes_only() {
    for changes in [&["tissue.cell_size_mm=2.0"][..], &["tissue.cell_size_mm=2.0", WITH_ALL, SLOW_FAILURE, FAST]] {
        goes_on_in_lanes_only(&|| scene("calibrated/muscle_biopsy.toml", changes));
    }
}

fn goes_on_in_lanes_only(small: &dyn Fn() -> Scene) {
    let mut lanes = run(small(), EngineChoice::Cpu);
    for _ in 0..30 {
        lanes.next_frame().unwrap();
    }
    let image = lanes.engine().save().unwrap();
    assert_eq!(image.engine(), "cpu");
    lanes.next_frame().unwrap();
    let model = lanes.model.clone();
    let dt = 1e-5;
    let mut steps = |image: &stylet::engine::EngineImage| {
        lanes.engine().restore(image).unwrap();
        crate::common::advance(lanes.engine(), &model, dt, &mut 2000, 10);
        lanes.engine().save().unwrap()
    };
    let (once, again) = (steps(&image), steps(&image));
    assert!(once == again && once != image, "a restored run goes on otherwise");
    lanes.engine().restore(&image).unwrap();
    assert_eq!(lanes.engine().save().unwrap(), image);
    let Err(Error::Input { message, .. }) = run(small(), EngineChoice::Cpu64).engine().restore(&image) else {
        panic!("taken by the f64 engine");
    };
    assert!(message.contains("engine `cpu`, this is `cpu64`"), "{message}");
}

#[test]
fn what_lanes_do_not_know_is_told_and_computed_in_f64() {
    let tears = "effects=[\"mass_scaling\", \"gravity\", \"plasticity\", \"damage\"]";
    let slowly = "damage={failure_displacement_mm=20.0}";
    let torn = scene("forearm.toml", &[tears, slowly]);
    assert_eq!(unknown_to_lanes(&torn).as_deref(), Some("damage in tetrahedra"));
    let mesh = Mesh::of_scene(&torn);
    let engine = CpuEngine::in_lanes(Arc::new(Model::new(torn, mesh)), 1e-7);
    let told = &engine.info().adapter;
    assert!(told.contains("f64: lanes do not know damage in tetrahedra"), "{told}");
    // Every law of the table is known.
    let mut other = block([4.0; 3], 1.0);
    for entry in &stylet::material::LAWS {
        other.material = law((entry.build)(entry.example));
        assert_eq!(unknown_to_lanes(&other), None, "{}", entry.key);
    }
}
