//! Targets: material points that move with the tissue, on both engines, and what a run tells about them.

use crate::common;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use common::*;
use glam::{DMat3, DVec3};
use stylet::commands::run::{RunArgs, RunOutcome, describe, run};
use stylet::mesh::{BlockMesh, Mesh, TissuePoint};
use stylet::model::Model;
use stylet::observables::quantity::columns;
use stylet::observables::{FrameRecord, TargetRecord};
use stylet::output::TargetFigures;
use stylet::output::folder::{SUMMARY, TARGET_TABLE};
use stylet::output::target;
use stylet::scene::{Scene, Target};
use stylet::simulation::{EngineChoice, Simulation};

/// A short and coarse insertion at 10 mm/s; 160 keeps the inertia of 4000 at 2 mm/s.
const SHORT: [&str; 4] = [
    "motion.phase=[{kind = \"insert\", speed_mm_s = 10, depth_mm = 4}]",
    "solver.mass_scaling=160",
    "tissue.cell_size_mm=1.2",
    "outputs.pictures_at_depth_mm=[]",
];

/// One on the path, one beside it.
const TARGETS: &str =
    "target=[{name = \"ahead\", position_mm = [0, 0, -6]}, {position_mm = [2.2, 0.4, -3], radius_mm = 0.5}]";

fn scene(name: &str, overrides: &[&str]) -> Scene {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    Scene::load(&path, &overrides).unwrap_or_else(|e| panic!("{e}"))
}

fn short(name: &str, more: &[&str]) -> Scene {
    scene(name, &[&SHORT[..], &[TARGETS], more].concat())
}

fn choices() -> Vec<EngineChoice> {
    if gpu().is_some() { vec![EngineChoice::Cpu, EngineChoice::Gpu] } else { vec![EngineChoice::Cpu] }
}

/// All records of a run. At its end the targets must be where the whole state has them.
fn records(scene: Scene, choice: EngineChoice) -> Vec<FrameRecord> {
    let mut simulation = Simulation::new(scene, choice).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap() {
        records.push(record);
    }
    let state = simulation.engine().read_state().unwrap();
    let model = &simulation.model;
    assert_eq!(records.last().unwrap().targets.len(), model.targets.len());
    for (target, point) in records.last().unwrap().targets.iter().zip(&model.targets) {
        assert_eq!(target.displacement, point.value(&state.displacement), "{choice:?}");
    }
    let snapshot = simulation.snapshot(records.last().unwrap()).unwrap();
    for ((place, target), found) in
        snapshot.targets.iter().zip(&simulation.model.scene.targets).zip(&records.last().unwrap().targets)
    {
        assert_eq!(*place, target.position + found.displacement);
    }
    records
}

/// Straight, doubled and bent grids with points anywhere inside.
#[test]
fn a_linear_field_is_exact_at_every_point() {
    let slit = BlockMesh::for_scene(&scene("slit.toml", &[]));
    let hollow = BlockMesh::for_scene(&scene("lv2022/hollow.toml", &[]));
    let bore = hollow.bore.expect("the grid is bent");
    let mut random = Random(7);
    for (name, block) in [("graded", graded_mesh([7, 5, 6])), ("slit", slit), ("hollow", hollow)] {
        let gradient = random.tensor() * 0.2;
        let shift = random.vector() * 1e-3;
        let u = |x: DVec3| gradient * x + shift;
        let field: Vec<DVec3> = (0..block.node_count()).map(|n| u(block.rest_position(n))).collect();
        let (low, high) = Mesh::Block(block.clone()).bounds();
        let mut points: Vec<DVec3> =
            (0..2000).map(|_| low + (high - low) * (0.5 * random.vector() + 0.5)).chain([low, high]).collect();
        // Nodes, also those on lines that occur twice, and points between the circle of a bore and its chords.
        points.extend((0..block.node_count()).step_by(37).map(|n| block.rest_position(n)));
        points.extend((0..360).map(|degree| {
            let ray = glam::DVec2::from_angle(f64::from(degree).to_radians() + 1e-3);
            (bore.centre + ray * bore.radius * (1.0 - 1e-3)).extend(-4.1e-3)
        }));
        let mut worst = (0.0, DVec3::ZERO);
        for x in points {
            let point = TissuePoint::new(&block, x);
            let miss = (point.value(&field) - u(x)).length();
            if miss > worst.0 {
                worst = (miss, x);
            }
            assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{name} {x}");
            assert!(point.weights.iter().all(|w| (0.0..=1.0).contains(w)), "{name} {x}");
            let corners = point.nodes.map(|n| block.rest_position(n as usize));
            let volume = DMat3::from_cols(corners[1] - corners[0], corners[2] - corners[0], corners[4] - corners[0]);
            assert!(volume.determinant() > 0.0, "{name} {x}: in a gap");
        }
        at_most(&format!("{name}: miss of a linear field, largest at {} [m]", worst.1), worst.0, 1e-12);
    }
}

/// What an engine reports after a frame is the field that was put into it.
#[test]
fn both_engines_report_the_field_that_they_hold() {
    let mut scene = block([6.0, 6.0, 6.0], 1.0);
    scene.faces = std::array::from_fn(|_| held(true, true, true));
    let at = [DVec3::new(0.3e-3, -1.7e-3, -2.2e-3), DVec3::new(3e-3, 3e-3, 0.0), DVec3::new(-2.2e-3, 0.0, -6e-3)];
    scene.targets = (1..).zip(at).map(|(n, position)| Target { name: n.to_string(), position, radius: 1e-3 }).collect();
    let model = model(scene);
    let dt = 1e-9;
    for (name, mut engine) in engines(&model, dt, 1) {
        let gradient = DMat3::from_cols(DVec3::new(0.02, 0.01, 0.0), DVec3::new(0.0, -0.01, 0.03), DVec3::Z * 0.01);
        displaced(engine.as_mut(), &model, |x| gradient * x);
        let sums = advance(engine.as_mut(), &model, dt, &mut 0, 1);
        let worst = sums.targets.iter().zip(at).map(|(u, x)| (*u - gradient * x).length()).fold(0.0, f64::max);
        // A unit of the fixed-point displacement is 14.6 pm; a step this short moves nothing by more.
        at_most(&format!("{name}: miss at the targets [m]"), worst, if name == "cpu" { 1e-12 } else { 3e-11 });
    }
}

#[test]
fn without_targets_nothing_is_stored_or_read_back() {
    let bytes = |scene: Scene| {
        let model = model(scene);
        let engine = gpu_engine(&model, 1e-5, 4)?;
        Some((engine.buffer_sizes(), stylet::engine::Engine::info(&engine).device_bytes))
    };
    let plain = block([6.0, 6.0, 6.0], 1.0);
    let mut aimed = plain.clone();
    aimed.targets = vec![Target { name: "a".into(), position: DVec3::NEG_Z * 1e-3, radius: 1e-3 }];
    let (Some((sizes, without)), Some((same_sizes, with))) = (bytes(plain), bytes(aimed)) else { return };
    assert_eq!(sizes, same_sizes);
    // Eight corners of 16 bytes in each of three staging buffers.
    assert_eq!(with - without, 3 * 8 * 16);
}

#[test]
fn the_tissue_carries_a_target_ahead_and_the_engines_agree() {
    let runs: Vec<Vec<FrameRecord>> = choices().into_iter().map(|c| records(short("target.toml", &[]), c)).collect();
    for (choice, run) in choices().iter().zip(&runs) {
        let ahead = |r: &FrameRecord| r.targets[0].axial.unwrap();
        let last = run.last().unwrap();
        println!("{choice:?}: ahead {:?}, beside {:?}", last.targets[0], last.targets[1]);
        // The tip is still on its way to the target, which the force has pushed ahead along the needle.
        let left = last.targets[0].from_tip.unwrap();
        assert!(left.z < -1e-3, "{left}");
        let pushed = run.iter().map(ahead).fold(0.0, f64::max);
        assert!(pushed > 0.1e-3, "{pushed}");
        let forced = run.iter().max_by(|a, b| ahead(a).total_cmp(&ahead(b))).unwrap();
        assert!(forced.force.axial > 0.3, "{} N", forced.force.axial);
        assert!(forced.targets[0].displacement.truncate().length() < 0.2 * pushed);
        // No force, no motion.
        assert!(ahead(&run[0]).abs() < 1e-6);
        // Beside the shaft it is pushed away from it.
        assert!(last.targets[1].displacement.x > 0.02e-3, "{}", last.targets[1].displacement);
        // The tip has come 4 mm of the 6 mm, and the target has gone on.
        let expected = 6e-3 - (10e-3 * last.time).min(4e-3) + ahead(last);
        assert!((left.length() - expected).abs() < 1e-5, "{left} {expected}");
    }
    let [cpu, gpu] = &runs[..] else { return };
    let moved =
        |run: &[FrameRecord]| -> Vec<DVec3> { run.iter().flat_map(|r| &r.targets).map(|t| t.displacement).collect() };
    at_most("GPU against CPU, part of the largest displacement", relative_difference(&moved(gpu), &moved(cpu)), 1e-4);
}

/// Free path, slit and hollow needle: grids and paths of every kind.
#[test]
fn every_kind_of_needle_moves_the_targets() {
    let choice = *choices().last().unwrap();
    let shallow = "motion.phase=[{kind = \"insert\", speed_mm_s = 10, depth_mm = 2}]";
    for (what, scene) in [
        ("free path", short("target.toml", &["puncture.path=free", shallow])),
        (
            "free hand",
            short("target.toml", &["motion.phase=[{kind = \"move\", to_mm = [0.2, 0, -2], speed_mm_s = 10}]"]),
        ),
        ("slit", short("slit.toml", &[shallow])),
        ("hollow", short("lv2022/hollow.toml", &[shallow, "tissue.cell_size_mm=0.8"])),
    ] {
        let run = records(scene, choice);
        let pushed = run.iter().map(|r| r.targets[0].axial.unwrap()).fold(0.0, f64::max);
        println!("{what}: target 4 mm below the tip pushed by {:.3} mm", pushed * 1e3);
        assert!(pushed > 0.02e-3, "{what}: {pushed}");
        let beside = run.last().unwrap().targets[1];
        assert!(beside.displacement.is_finite() && beside.displacement.length() > 1e-6, "{what}: {beside:?}");
    }
}

/// Distances are those from the tip of the bent needle.
#[test]
fn a_flexible_needle_has_its_tip_where_it_bends_to() {
    let shallow = "motion.phase=[{kind = \"insert\", speed_mm_s = 10, depth_mm = 3}]";
    let scene = short("effects/flexible_needle.toml", &[shallow]);
    let targets = scene.targets.clone();
    let run = records(scene, *choices().last().unwrap());
    let last = run.last().unwrap();
    let bent = last.needle.tip_offset;
    println!("tip {:.1} um beside and {:.1} um behind", bent.length() * 1e6, last.needle.retreat * 1e6);
    assert!(bent.length() > 1e-6);
    for (target, found) in targets.iter().zip(&last.targets) {
        let tip = target.position + found.displacement - found.from_tip.unwrap();
        let straight = DVec3::NEG_Z * (10e-3 * last.time).min(3e-3);
        assert!((tip - straight - bent - DVec3::Z * last.needle.retreat).length() < 1e-9, "{tip} {straight}");
    }
}

#[test]
fn a_target_without_a_tool_has_no_distance() {
    let mut scene = pulled([4.0, 4.0, 4.0], 1.0, 0.02, 0.01);
    scene.solver.duration = Some(0.05);
    scene.targets = vec![Target { name: "a".into(), position: DVec3::new(0.1e-3, 0.2e-3, -1.1e-3), radius: 1e-3 }];
    let targets = scene.targets.clone();
    let run = records(scene, EngineChoice::Cpu);
    let last = run.last().unwrap();
    assert_eq!((last.targets[0].axial, last.targets[0].from_tip), (None, None));
    assert!(last.targets[0].displacement.z > 1e-6);
    let figures = &TargetFigures::of_run(&targets, &run)[0];
    assert!(figures.largest_displacement_m >= last.targets[0].displacement.length());
    assert_eq!((figures.smallest_tip_distance_m, figures.tip_distance_at_end_m, figures.hit), (None, None, None));
}

/// Frames with depth [mm], displacement [mm] along the needle, and the way from the tip to the target [mm].
fn made_up(frames: &[(f64, f64, DVec3)]) -> Vec<FrameRecord> {
    (0..)
        .zip(frames)
        .map(|(frame, (depth, moved, way))| FrameRecord {
            frame,
            depth: depth * 1e-3,
            targets: vec![TargetRecord {
                displacement: DVec3::NEG_Z * *moved * 1e-3,
                axial: Some(moved * 1e-3),
                from_tip: Some(*way * 1e-3),
            }],
            ..Default::default()
        })
        .collect()
}

#[test]
fn figures_count_the_way_in() {
    let target = |radius: f64| Target { name: "a".into(), position: DVec3::ZERO, radius: radius * 1e-3 };
    let way = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    // 4 mm per frame past a target 0.3 mm aside, then back: the way back moves it more and does not count.
    let run = made_up(&[
        (0.0, 0.0, way(0.3, -10.0)),
        (4.0, 0.2, way(0.3, -6.0)),
        (8.0, 0.5, way(0.3, -2.0)),
        (12.0, 0.4, way(0.3, 2.0)),
        (8.0, 0.9, way(0.1, 0.0)),
    ]);
    let figures = |radius: f64| TargetFigures::of_run(&[target(radius)], &run).remove(0);
    let found = figures(0.5);
    let near = |value: f64, expected: f64| assert!((value - expected * 1e-3).abs() < 1e-12, "{value}, {expected} mm");
    near(found.largest_displacement_m, 0.5);
    near(found.largest_displacement_depth_m, 8.0);
    near(found.smallest_tip_distance_m.unwrap(), 0.3);
    near(found.smallest_tip_distance_depth_m.unwrap(), 10.0);
    near(found.tip_distance_at_end_m.unwrap(), way(0.3, 2.0).length());
    assert_eq!((found.hit, figures(0.3).hit, figures(0.29).hit), (Some(true), Some(true), Some(false)));
    assert_eq!(TargetFigures::of_run(&[target(1.0)], &[]), []);
}

/// A run of the command into a folder.
fn run_into(scene: Scene, choice: EngineChoice, out: &Path) -> RunOutcome {
    let args = RunArgs { engine: choice, out: Some(out.to_path_buf()), ..RunArgs::default() };
    run(scene, &args, None, Instant::now(), &AtomicBool::new(false)).unwrap()
}

#[test]
fn a_run_writes_its_targets_and_only_where_there_are_any() {
    let base = tempfile::tempdir().unwrap();
    let choice = *choices().last().unwrap();
    let shallow = "motion.phase=[{kind = \"insert\", speed_mm_s = 10, depth_mm = 2}]";
    let read = |folder: &str, name: &str| std::fs::read_to_string(base.path().join(folder).join(name)).unwrap();
    let with_picture = [shallow, "outputs.pictures_at_depth_mm=[2]"];
    let outcome = run_into(short("target.toml", &with_picture), choice, &base.path().join("a"));
    let table = read("a", TARGET_TABLE);
    let mut reader = csv::Reader::from_reader(table.as_bytes());
    assert_eq!(reader.headers().unwrap(), columns(&target::TARGETS).as_slice());
    let rows: Vec<csv::StringRecord> = reader.records().map(|r| r.unwrap()).collect();
    let frames = read("a", "force.csv").lines().count() - 1;
    assert_eq!(rows.len(), 2 * frames);
    assert_eq!((&rows[0][2], &rows[1][2]), ("ahead", "target 2"));
    // Time and depth are those of force.csv.
    let force = read("a", "force.csv");
    for (line, pair) in force.lines().skip(1).zip(rows.chunks(2)) {
        assert!(line.starts_with(&format!("{},{},", &pair[0][0], &pair[0][1])), "{line} {pair:?}");
    }
    let number = |row: &csv::StringRecord, i: usize| row[i].parse::<f64>().unwrap();
    let last = &rows[rows.len() - 2];
    let u = DVec3::new(number(last, 3), number(last, 4), number(last, 5));
    assert!((u.length() - number(last, 6)).abs() < 1e-11 && (number(last, 7) + u.z).abs() < 1e-11, "{last:?}");
    assert!((number(last, 8) - 4e-3 - number(last, 7)).abs() < 1e-5, "{last:?}");

    let targets = &outcome.summary.targets;
    assert_eq!(targets.iter().map(|t| t.name.as_str()).collect::<Vec<_>>(), ["ahead", "target 2"]);
    assert_eq!((targets[0].radius_m, targets[1].radius_m), (1e-3, 0.5e-3));
    assert_eq!(targets[0].hit, Some(false));
    let largest = rows.iter().step_by(2).map(|r| number(r, 6)).fold(0.0, f64::max);
    assert!((targets[0].largest_displacement_m - largest).abs() < 1e-9);
    let summary: serde_json::Value = serde_json::from_str(&read("a", SUMMARY)).unwrap();
    assert_eq!(summary["targets"][0]["name"], "ahead");
    assert_eq!(stylet::output::Summary::read(&base.path().join("a").join(SUMMARY)).unwrap().targets, *targets);
    let text = describe(&outcome.summary);
    assert!(text.contains("target ahead: moves by ") && text.contains("missed"), "{text}");

    // The same byte for byte on the same adapter.
    run_into(short("target.toml", &[shallow]), choice, &base.path().join("b"));
    assert_eq!(read("b", TARGET_TABLE), table);

    let plain =
        run_into(scene("target.toml", &[&SHORT[..], &[shallow, "target=[]"]].concat()), choice, &base.path().join("c"));
    assert!(!base.path().join("c").join(TARGET_TABLE).exists());
    assert!(!read("c", SUMMARY).contains("\"targets\""));
    assert!(!describe(&plain.summary).contains("target"));
    // Nothing else changes.
    assert_eq!(read("c", "force.csv"), force);
}

/// The target of a hollow needle's model lies in the core where the scene puts it there.
#[test]
fn a_target_in_the_core_of_a_hollow_needle_lies_within_the_ring() {
    let scene = scene("lv2022/hollow.toml", &["target=[{position_mm = [0.2, 0, -3]}]"]);
    let mesh = BlockMesh::for_scene(&scene);
    let bore = mesh.bore.unwrap();
    let model = Arc::new(Model::new(scene, mesh));
    let ring = model.targets[0].nodes.map(|n| model.mesh.rest_position(n as usize).truncate().distance(bore.centre));
    assert!(ring.iter().all(|r| *r <= bore.radius * (1.0 + 1e-9)), "{ring:?}");
}
