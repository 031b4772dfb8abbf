//! Scenes whose tissue is a label map: where it lies, what its cells are made of, and what a needle meets in it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DMat3, DQuat, DVec3};
use stylet::cpu::CpuEngine;
use stylet::engine::Engine;
use stylet::engine::elements::{CellStates, Elements};
use stylet::mesh::Mesh;
use stylet::model::Model;
use stylet::observables::FrameRecord;
use stylet::simulation::{EngineChoice, Simulation};
use stylet::training::score::Score;
use stylet::training::scripted_samples;
use stylet::{Error, Scene};

use crate::common::{Random, gpu_engine, relative_difference};

/// Voxels of an edge [mm] whose axes are the columns of `axes`, RAS, around the origin: the label at their middle.
fn volume(name: &str, counts: [usize; 3], edge: f64, axes: DMat3, label: impl Fn(DVec3) -> u8) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-labels-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let steps = axes * edge;
    let half = DVec3::from(counts.map(|n| 0.5 * (n as f64 - 1.0)));
    let origin = -(steps * half);
    let list = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let mut bytes = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: {} {} {}\nspace directions: {} {} {}\n\
         encoding: raw\nspace origin: {}\n\n",
        counts[0],
        counts[1],
        counts[2],
        list(steps.x_axis),
        list(steps.y_axis),
        list(steps.z_axis),
        list(origin)
    )
    .into_bytes();
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                bytes.push(label(origin + steps * DVec3::new(i as f64, j as f64, k as f64)));
            }
        }
    }
    let path = folder.join(format!("{name}.nrrd"));
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Skin of 2 mm, fat of 4 mm and muscle below the plane z = 10 mm, RAS.
fn layers(x: DVec3) -> u8 {
    match 10.0 - x.z {
        depth if depth < 0.0 => 0,
        depth if depth < 2.0 => 1,
        depth if depth < 6.0 => 2,
        _ => 3,
    }
}

const UPRIGHT: DMat3 = DMat3::IDENTITY;

/// A needle through layers that are labels or shapes.
fn layered(tissue: &str, shapes: [&str; 2], motion: &str) -> String {
    format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
size_mm = [16, 16, 14]
cell_size_mm = 1.0
{tissue}
[material]
youngs_modulus_kpa = 60
poisson_ratio = 0.45
[[region]]
name = "skin"
{}
material = {{ youngs_modulus_kpa = 150, poisson_ratio = 0.45, puncture_force_n = 0.5, cutting_force_n = 0.4 }}
[[region]]
name = "fat"
{}
material = {{ youngs_modulus_kpa = 20, poisson_ratio = 0.45, puncture_force_n = 0.15, cutting_force_n = 0.1 }}
[needle]
gauge = "18G"
tip_length_mm = 3
[puncture]
puncture_force_n = 0.4
cutting_force_n = 0.3
[motion]
{motion}
[[motion.phase]]
kind = "insert"
speed_mm_s = 20
depth_mm = 9
"#,
        shapes[0], shapes[1]
    )
}

fn scene(text: &str) -> Scene {
    Scene::parse(&std::env::temp_dir().join("labels.toml"), text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn refusal(text: &str) -> String {
    match Scene::parse(&std::env::temp_dir().join("labels.toml"), text, &[]) {
        Ok(_) => panic!("should have been refused"),
        Err(Error::Scene(text)) => text,
        Err(other) => panic!("{other}"),
    }
}

fn run(scene: Scene, choice: EngineChoice) -> Vec<FrameRecord> {
    let mut simulation = Simulation::new(scene, choice).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap() {
        records.push(record);
    }
    let verdict = simulation.verdict();
    assert!(verdict.is_ok(), "{verdict:?}");
    records
}

/// Largest difference of the axial forces over the largest force.
fn difference(one: &[FrameRecord], other: &[FrameRecord]) -> f64 {
    assert_eq!(one.len(), other.len());
    let peak = one.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    one.iter().zip(other).map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max) / peak
}

fn labelled(name: &str, axes: DMat3) -> String {
    let path = volume(name, [60, 60, 60], 0.5, axes, layers);
    layered(
        &format!("labels = {:?}", path.display().to_string()),
        ["label = 1", "label = 2"],
        "entry_ras_mm = [0.3, -0.4, 12.0]\ntarget_ras_mm = [0.3, -0.4, 0.0]",
    )
}

#[test]
fn labels_and_shapes_of_the_same_layers_make_the_same_force() {
    let labels = run(scene(&labelled("upright", UPRIGHT)), EngineChoice::Cpu);
    let shapes = run(scene(&layered("", ["layer_mm = [0, 2]", "layer_mm = [2, 6]"], "")), EngineChoice::Cpu);
    let apart = difference(&labels, &shapes);
    assert!(apart < 1e-3, "{apart}");
}

#[test]
fn it_does_not_matter_how_the_volume_lies() {
    let upright = run(scene(&labelled("standing", UPRIGHT)), EngineChoice::Cpu);
    // Mirrored axes hold the same voxels in another order.
    let mirrored = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X);
    let other = run(scene(&labelled("mirrored", mirrored)), EngineChoice::Cpu);
    assert!(difference(&upright, &other) < 1e-6);
    // Oblique voxels have other steps at the layers.
    let oblique = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5));
    let fine = labelled("oblique", oblique).replace("oblique.nrrd", "fine.nrrd");
    volume("fine", [120, 120, 120], 0.25, oblique, layers);
    let other = run(scene(&fine), EngineChoice::Cpu);
    // A layer begins up to half a voxel elsewhere, and there the force falls at once: the mean tells more than the largest.
    let peak = upright.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    let apart = upright.iter().zip(&other).map(|(a, b)| (a.force.axial - b.force.axial).abs()).sum::<f64>();
    let apart = apart / peak / upright.len() as f64;
    assert!(apart < 0.01, "{apart}");
}

/// A ball of bone in a ball of tissue, both cut by cells.
fn ball(name: &str) -> Scene {
    let path = volume(name, [60, 60, 60], 0.5, UPRIGHT, |x| match x.length() {
        r if r < 4.0 => 2,
        r if r < 12.0 => 1,
        _ => 0,
    });
    scene(&format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
labels = {:?}
size_mm = [30, 30, 25]
cell_size_mm = 1.2
[material]
youngs_modulus_kpa = 30
poisson_ratio = 0.45
puncture_force_n = 0.2
cutting_force_n = 0.15
[[region]]
name = "bone"
label = 2
rigid = true
[needle]
gauge = "18G"
tip_length_mm = 3
[motion]
entry_ras_mm = [1, 2, 14]
target_ras_mm = [1, 2, 0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 10
[[motion.phase]]
kind = "withdraw"
speed_mm_s = 10
depth_mm = 3
"#,
        path.display().to_string()
    ))
}

#[test]
fn cut_cells_hold_the_mass_of_the_tissue() {
    let scene = ball("mass");
    let mesh = Mesh::of_scene(&scene);
    let model = Model::new(scene, mesh);
    let bone = 4.0 / 3.0 * std::f64::consts::PI * 4e-3f64.powi(3);
    let all = 4.0 / 3.0 * std::f64::consts::PI * 12e-3f64.powi(3);
    let volume: f64 =
        (0..model.mesh.cell_count()).map(|cell| model.composition.fill(cell) * model.mesh.cell_volume(cell)).sum();
    // Bone is a matter of whole cells.
    let apart = volume / (all - bone) - 1.0;
    assert!(apart.abs() < 0.02, "{apart}");
    assert!(model.composition.rigid.iter().any(|rigid| *rigid));
    assert!(model.materials.len() <= 256);
}

/// Shapes in a block on cells of 1 mm, twice as dense as what is around them: by whole cells the cylinder would lack 15 % of its volume, and the
/// thin box none of it.
#[test]
fn shapes_have_their_part_of_the_cells_that_they_cut() {
    let shapes = [
        ("sphere_mm = { centre = [0.3, 0.2, -5.1], radius = 2.1 }", 4.0 / 3.0 * std::f64::consts::PI * 2.1f64.powi(3)),
        (
            "cylinder_mm = { from = [-3.2, 0.3, -5.2], to = [4.1, 0.3, -5.2], radius = 1.2 }",
            7.3 * 1.44 * std::f64::consts::PI,
        ),
        ("box_mm = { low = [-3.0, -3.0, -4.84], high = [3.0, 3.0, -4.505] }", 36.0 * 0.335),
    ];
    for (shape, volume) in shapes {
        let scene = scene(&format!(
            r#"
effects = []
[tissue]
size_mm = [12, 12, 10]
cell_size_mm = 1.0
growth = 1.0
[material]
density_kg_m3 = 1000
youngs_modulus_kpa = 30
poisson_ratio = 0.45
[[region]]
name = "shape"
{shape}
material = {{ density_kg_m3 = 2000, youngs_modulus_kpa = 90, poisson_ratio = 0.45 }}
[solver]
duration_s = 0.01
"#
        ));
        let mesh = Mesh::of_scene(&scene);
        let model = Model::new(scene, mesh);
        let mass = |cell: usize| model.materials[model.material_index(cell)].density * model.mesh.cell_volume(cell);
        let cells = 0..model.mesh.cell_count();
        let total: f64 = cells.clone().map(mass).sum();
        let whole: f64 = cells.map(|cell| 1000.0 * model.mesh.cell_volume(cell)).sum();
        let found = (total - whole) / 1000.0 * 1e9;
        println!("{shape}: {found:.3} of {volume:.3} mm^3");
        assert!((found / volume - 1.0).abs() < 0.03, "{shape}: {found} of {volume} mm^3");
        assert!(model.composition.empty.is_empty() && model.composition.fill.is_empty());
    }
}

/// Displacements that leave all nodes that are held where they are.
fn shaken(model: &Model, seed: u64) -> Vec<DVec3> {
    let mut random = Random(seed);
    (0..model.mesh.node_count())
        .map(|node| if model.fixed_components(node)[0] { DVec3::ZERO } else { random.vector() * 5e-5 })
        .collect()
}

#[test]
fn all_engines_have_the_same_forces_in_cut_cells() {
    let scene = ball("forces");
    let mesh = Mesh::of_scene(&scene);
    let model = Arc::new(Model::new(scene, mesh));
    let u = shaken(&model, 3);
    let exact = Elements::new(&model).internal_forces(&model, &u, CellStates::default());
    let mut engines: Vec<(&str, Box<dyn Engine>)> = vec![("lanes", Box::new(CpuEngine::in_lanes(model.clone(), 1e-5)))];
    if let Some(gpu) = gpu_engine(&model, 1e-5, 1) {
        engines.push(("gpu", Box::new(gpu)));
    }
    for (name, mut engine) in engines {
        let mut state = engine.read_state().unwrap();
        state.displacement.clone_from(&u);
        engine.write_state(&state).unwrap();
        let found = engine.internal_forces().unwrap();
        let apart = relative_difference(&found, &exact);
        assert!(apart < 2e-5, "{name}: {apart}");
    }
}

#[test]
fn a_needle_stops_at_bone() {
    let mut forces = Vec::new();
    for choice in [EngineChoice::Cpu, EngineChoice::Cpu64, EngineChoice::Gpu] {
        if choice == EngineChoice::Gpu && crate::common::gpu().is_none() {
            continue;
        }
        let records = run(ball("bone"), choice);
        let deepest = records.iter().map(|r| r.depth).fold(0.0, f64::max);
        // The skin is at z = sqrt(12^2 - 5) mm, the bone at sqrt(4^2 - 5) mm.
        let bone = (139.0f64.sqrt() - 11.0f64.sqrt()) * 1e-3;
        assert!((deepest - bone).abs() < 0.4e-3, "{deepest} instead of {bone}");
        let most = records.iter().map(|r| r.force.bone).fold(0.0, f64::max);
        assert!((most - 10.0).abs() < 1e-3, "{most} N");
        assert!(records.iter().all(|r| r.health.inverted_cells == 0));
        let last = records.last().unwrap();
        assert!(last.energy.imbalance().abs() < 0.02, "{}", last.energy.imbalance());
        assert_eq!(last.force.bone, 0.0, "withdrawn");
        forces.push(records);
    }
    for other in &forces[1..] {
        assert!(difference(&forces[0], other) < 1e-3);
    }
}

#[test]
fn a_bar_cut_by_its_cells_pulls_like_a_whole_one() {
    // 4.3 mm thick in cells of 1 mm: by whole cells it would be 7 % too thin.
    let path = volume("bar", [80, 20, 43], 0.1, UPRIGHT, |_| 1);
    let text = format!(
        r#"
effects = ["mass_scaling"]
[tissue]
labels = {:?}
size_mm = [8, 2, 5]
cell_size_mm = 1.0
[material]
youngs_modulus_kpa = 60
poisson_ratio = 0.3
[boundaries]
x_min = {{ fixed = ["x"] }}
x_max = {{ fixed = ["x"], displacement_mm = [0.008, 0, 0], duration_s = 0.2 }}
y_min = {{ fixed = ["y"] }}
y_max = "free"
z_min = "free"
z_max = {{ fixed = ["z"] }}
[solver]
duration_s = 0.4
mass_scaling = 100
mass_damping_per_s = 200
"#,
        path.display().to_string()
    );
    let records = run(scene(&text), EngineChoice::Cpu64);
    let force = records.last().unwrap().reactions[1].x;
    let exact = 60e3 * 0.001 * 2e-3 * 4.3e-3;
    let apart = force / exact - 1.0;
    assert!(apart.abs() < 0.012, "{force} N instead of {exact}: {apart}");
}

#[test]
fn what_is_wrong_is_told_with_the_way_out() {
    let good = labelled("wrong", UPRIGHT);
    for (from, to, parts) in [
        ("entry_ras_mm = [0.3, -0.4, 12.0]", "entry_ras_mm = [90, -0.4, 12.0]", ["no skin on this line", "RAS"]),
        ("target_ras_mm = [0.3, -0.4, 0.0]", "target_ras_mm = [0.3, -0.4, 11.5]", ["target", "way out"]),
        ("label = 2", "label = 9", ["has no label 9", "it has 1, 2, 3"]),
        ("label = 2", "label = \"fat\"", ["called \"fat\"", "it has 1, 2, 3"]),
        ("entry_ras_mm", "entry_mm = [0, 0]\nentry_ras_mm", ["one of a block", "two paths"]),
        (".nrrd\"", ".nii\"", ["cannot be read", "way out"]),
        ("labels =", "mesh = \"a.msh\"\nlabels =", ["`mesh`", "remove mesh"]),
    ] {
        let message = refusal(&good.replacen(from, to, 1));
        for part in parts {
            assert!(message.contains(part), "{from} -> {to}: {message}");
        }
    }
    let message = refusal(&layered("", ["label = 1", "layer_mm = [2, 6]"], ""));
    assert!(message.contains("no tissue.labels"), "{message}");
}

fn task(name: &str, overrides: &[&str]) -> Score {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/anatomy").join(name);
    let overrides: Vec<String> = overrides.iter().map(|o| o.to_string()).collect();
    let scene = Scene::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"));
    let records = run(scene.clone(), EngineChoice::Cpu);
    Score::of(&scene, &scripted_samples(&scene, &records), &records, None).unwrap()
}

#[test]
fn reference_attempts_of_the_cases_pass_and_wrong_ones_do_not() {
    let score = task("forearm_vein.toml", &[]);
    assert_eq!(score.passed(), Some(true), "{}", score.text());
    let score = task("neck_vein.toml", &[]);
    assert_eq!(score.passed(), Some(true), "{}", score.text());
    let score = task("lumbar_puncture.toml", &[]);
    assert_eq!(score.passed(), Some(true), "{}", score.text());
    // 14 mm too medial is the carotid artery.
    let artery = ["motion.entry_ras_mm=[31.0,49.5,0.0]", "motion.target_ras_mm=[21.4,30.3,0.0]"];
    let outputs = "outputs.pictures_at_depth_mm=[]";
    // The target of the vein would lie outside that block.
    let wide = "tissue.size_mm=[44.0,44.0,36.0]";
    let score = task("neck_vein.toml", &[artery[0], artery[1], outputs, wide]);
    assert_eq!(score.passed(), Some(false), "{}", score.text());
    assert!(score.text().contains("carotid artery"), "{}", score.text());
    // 10 mm higher is the spinous process of L3.
    let bone = ["motion.entry_ras_mm=[0.0,0.0,10.0]", "motion.target_ras_mm=[0.0,35.0,10.0]", outputs];
    let score = task("lumbar_puncture.toml", &bone);
    assert_eq!(score.passed(), Some(false), "{}", score.text());
    assert!(score.value("peak_bone_force").is_some_and(|force| force > 9.9), "{}", score.text());
}
