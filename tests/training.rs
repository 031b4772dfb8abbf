//! Training: every figure against a number worked out by hand, tasks as they are read and judged, scores and their history.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use stylet::Error;
use stylet::mesh::Mesh;
use stylet::observables::{CoreSample, FrameRecord, Judge, Sizes, TargetRecord};
use stylet::output::Summary;
use stylet::scene::{Goal, Obstacle, RegionShape, Scene};
use stylet::simulation::{EngineChoice, Simulation};
use stylet::training::history::{self, History, file_name, progress};
use stylet::training::kinematic::{Block, Body, KinematicFigures, Plan, Sample, check, passes};
use stylet::training::physical::{MOST_CLAMPED, PhysicalFigures, Trust};
use stylet::training::score::{COLUMNS, Score, TEXT_WIDTH};
use stylet::training::task::clearance_of;
use stylet::training::{scripted_samples, texts};

const MM: f64 = 1e-3;

/// 20 x 20 x 20 mm below z = 0.
const BLOCK: Block = Block { low: DVec3::new(-10e-3, -10e-3, -20e-3), high: DVec3::new(10e-3, 10e-3, 0.0) };

const DOWN: DVec3 = DVec3::NEG_Z;

#[track_caller]
fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
}

/// A vertical needle whose tip stands at the heights `z_mm`, every `dt` seconds.
fn vertical(z_mm: impl IntoIterator<Item = f64>, dt: f64) -> Vec<Sample> {
    let at = |(i, z): (usize, f64)| Sample { time: i as f64 * dt, tip: DVec3::Z * z * MM, direction: DOWN };
    z_mm.into_iter().enumerate().map(at).collect()
}

/// Heights from one to the next in steps of 0.1 mm; no height lies on the surface.
fn ways(ends_mm: &[f64]) -> Vec<f64> {
    let mut all = vec![ends_mm[0]];
    for pair in ends_mm.windows(2) {
        let count = ((pair[1] - pair[0]).abs() / 0.1).round() as usize;
        all.extend((1..=count).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / count as f64));
    }
    all
}

fn figures(samples: &[Sample]) -> KinematicFigures {
    let plan = Plan { entry: DVec3::ZERO, direction: DOWN };
    KinematicFigures::of(samples, &BLOCK, Some(&plan)).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn the_block_knows_inside_and_the_way_out() {
    near(BLOCK.depth(DVec3::new(0.0, 0.0, -3e-3)), 3e-3, 1e-15);
    near(BLOCK.depth(DVec3::new(9e-3, 0.0, -5e-3)), 1e-3, 1e-15);
    near(BLOCK.depth(DVec3::new(0.0, 0.0, 2e-3)), -2e-3, 1e-15);
    // Beyond an edge: 3-4-5.
    near(BLOCK.depth(DVec3::new(13e-3, 0.0, 4e-3)), -5e-3, 1e-15);
    assert!(!BLOCK.contains(DVec3::ZERO), "the surface is outside");
    near(BLOCK.way_out(DVec3::new(0.0, 0.0, -3e-3), DVec3::Z), 3e-3, 1e-15);
    // Up at 45 degrees from 8 mm beside the middle, the side comes first.
    let up = DVec3::new(1.0, 0.0, 1.0).normalize();
    near(BLOCK.way_out(DVec3::new(8e-3, 0.0, -5e-3), up), 2e-3 * 2f64.sqrt(), 1e-15);
}

#[test]
fn a_straight_insertion() {
    // From 5.05 mm above to 14.95 mm deep at 10 mm/s: 200 intervals, the last 150 of them end inside.
    let f = figures(&vertical(ways(&[5.05, -14.95]), 0.01));
    near(f.elapsed_time, 2.0, 1e-12);
    near(f.path_length, 20e-3, 1e-12);
    near(f.path_in_tissue, 15e-3, 1e-12);
    near(f.time_in_tissue, 1.5, 1e-12);
    near(f.depth_perception, 20e-3, 1e-12);
    near(f.path_inefficiency.unwrap(), 0.0, 1e-12);
    near(f.swept_area, 0.0, 1e-12);
    near(f.motion_smoothness, 0.0, 1e-6);
    near(f.entry_error.unwrap(), 0.0, 1e-12);
    near(f.entry_angle_error.unwrap(), 0.0, 1e-12);
    assert_eq!((f.punctures, f.passes, f.redirections), (1, 1, 0));
    assert_eq!((f.translational_motions, f.rotational_actions), (0, 0));
}

#[test]
fn there_and_back() {
    // 10 mm in, back to where it began: no straight way. Half of it back: 15 mm for 5 mm.
    assert_eq!(figures(&vertical(ways(&[0.05, -9.95, 0.05]), 0.01)).path_inefficiency, None);
    let f = figures(&vertical(ways(&[0.05, -9.95, -4.95]), 0.01));
    near(f.path_inefficiency.unwrap(), 2.0, 1e-9);
    near(f.depth_perception, 15e-3, 1e-12);
    // Sideways travel is no travel along the needle.
    let sideways: Vec<Sample> =
        (0..5).map(|i| Sample { time: f64::from(i), tip: DVec3::X * f64::from(i) * MM, direction: DOWN }).collect();
    near(figures(&sideways).depth_perception, 0.0, 1e-15);
}

#[test]
fn punctures_are_armed_again_outside_only() {
    let count = |ends: &[f64]| {
        let f = figures(&vertical(ways(ends), 0.01));
        (f.punctures, f.passes)
    };
    // Not deep enough for the point 5 mm behind.
    assert_eq!(count(&[5.05, -4.95]), (0, 1));
    assert_eq!(count(&[5.05, -5.25]), (1, 1));
    // Deep enough that the point ahead leaves at the bottom, and back: still one.
    assert_eq!(count(&[5.05, -17.05, -10.05, -17.05]), (1, 1));
    // Out by 3 mm only, the point ahead stays inside: one puncture, two passes.
    assert_eq!(count(&[5.05, -8.05, 3.05, -8.05]), (1, 2));
    assert_eq!(count(&[5.05, -8.05, 6.05, -8.05]), (2, 2));
    // A tip that trembles on the skin makes no pass, and a deep one that comes up to 0.05 mm below it stays the same pass.
    assert_eq!(count(&[0.25, -0.25, 0.25, -0.25]), (0, 0));
    assert_eq!(count(&[0.25, -3.05, -0.05, -3.05]), (0, 1));
}

#[test]
fn the_swept_area_of_a_pivot_and_of_a_push() {
    // A needle 10 mm deep that turns about its entry point by 20 degrees in 40 steps: 40 triangles with two sides of 10 mm.
    let turn = 20f64.to_radians();
    let pivot: Vec<Sample> = (0..=40)
        .map(|i| {
            let direction = DQuat::from_rotation_y(turn * (f64::from(i) / 40.0 - 0.5)) * DOWN;
            Sample { time: 0.1 * f64::from(i), tip: direction * 10e-3, direction }
        })
        .collect();
    let expected = 40.0 * 0.5 * 100e-6 * (turn / 40.0).sin();
    near(figures(&pivot).swept_area, expected, 1e-5 * expected);
    assert!((expected - 0.5 * 100e-6 * turn).abs() < 1e-4 * expected, "the sector");
    // Pushed sideways by 3 mm at 10 mm depth: a rectangle, also as two triangles.
    let push = |depth: f64, body: &dyn Body| {
        let at =
            |i: i32| Sample { time: f64::from(i), tip: DVec3::new(f64::from(i) * MM, 0.0, -depth), direction: DOWN };
        let samples: Vec<Sample> = (0..=3).map(at).collect();
        KinematicFigures::of(&samples, body, None).unwrap().swept_area
    };
    near(push(10e-3, &BLOCK), 30e-6, 1e-10);
    // A tip outside sweeps nothing; in a body of a metre the shaft ends after 300 mm.
    assert_eq!(push(-1e-3, &BLOCK), 0.0);
    let metre = Block { low: DVec3::splat(-1.0), high: DVec3::new(1.0, 1.0, 0.0) };
    near(push(0.5, &metre), 300e-3 * 3e-3, 1e-8);
}

#[test]
fn smoothness_is_the_jerk() {
    // x = c t^3 has the third backward difference 6 c, exactly; 21 samples hold 18 of them.
    let (c, dt) = (0.01, 0.05);
    let cubic: Vec<Sample> = (0..21)
        .map(|i| {
            let time = dt * f64::from(i);
            Sample { time, tip: DVec3::X * c * time.powi(3), direction: DOWN }
        })
        .collect();
    let expected = 6.0 * c * (18.0 * dt).sqrt();
    near(figures(&cubic).motion_smoothness, expected, 1e-9);
    // A sample that comes twice changes nothing.
    let mut twice = cubic.clone();
    twice.insert(7, cubic[7]);
    near(figures(&twice).motion_smoothness, expected, 1e-9);
    // Uneven times: v = 1, -1/2, 2; a = -3/4, 5/2; one jerk of 13/4 over 1 s.
    let uneven = [(0.0, 0.0), (1.0, 1.0), (3.0, 0.0), (4.0, 2.0)];
    let uneven = uneven.map(|(time, x)| Sample { time, tip: DVec3::X * x, direction: DOWN });
    near(figures(&uneven).motion_smoothness, 3.25, 1e-12);
    // Backward, not central: of a fourth power the last difference belongs to t - 3/2 dt, d3/dt3 t^4 = 24 t there.
    let fourth: Vec<Sample> =
        (0..4).map(|i| Sample { time: f64::from(i), tip: DVec3::X * f64::from(i).powi(4), direction: DOWN }).collect();
    near(figures(&fourth).motion_smoothness, 24.0 * 1.5, 1e-9);
}

#[test]
fn movements_are_counted() {
    // Speeds in mm/s; counted where they differ by more than 7.5 from the last counted one: 13, 5, 12.6.
    let mut x = 0.0;
    let mut samples = vec![Sample { time: 0.0, tip: DVec3::ZERO, direction: DOWN }];
    for (i, speed) in [5.0, 5.0, 10.0, 13.0, 13.0, 5.0, 12.4, 12.6, 12.6].into_iter().enumerate() {
        x += speed * MM;
        samples.push(Sample { time: (i + 1) as f64, tip: DVec3::X * x, direction: DOWN });
    }
    assert_eq!(figures(&samples).translational_motions, 3);
    assert_eq!(figures(&samples).rotational_actions, 0);

    // (speed of turning [deg/s], duration [s])
    let turns = |parts: &[(f64, f64)]| {
        let (mut angle, mut time) = (0.0f64, 0.0);
        let mut samples = vec![Sample { time, tip: DVec3::Z, direction: DVec3::X }];
        for (rate, duration) in parts {
            for _ in 0..(duration / 0.01f64).round() as usize {
                (angle, time) = (angle + rate * 0.01, time + 0.01);
                let direction = DQuat::from_rotation_z(angle.to_radians()) * DVec3::X;
                samples.push(Sample { time, tip: DVec3::Z, direction });
            }
        }
        figures(&samples).rotational_actions
    };
    assert_eq!(turns(&[(0.0, 0.5), (45.0, 1.0)]), 0, "too slow");
    assert_eq!(turns(&[(0.0, 0.5), (60.0, 0.15), (0.0, 0.5)]), 0, "too short");
    assert_eq!(turns(&[(0.0, 0.5), (60.0, 0.5), (0.0, 0.5)]), 1);
    assert_eq!(turns(&[(0.0, 0.5), (60.0, 0.5), (0.0, 0.1), (60.0, 0.5)]), 1, "too short a rest");
    assert_eq!(turns(&[(0.0, 0.5), (60.0, 0.5), (0.0, 0.5), (-60.0, 0.5)]), 2);
}

#[test]
fn entries_and_redirections() {
    // At 10 degrees to the plan through a point 1 mm and 2 mm beside it; samples every 0.3 mm, none on the surface.
    let direction = DQuat::from_rotation_y(10f64.to_radians()) * DOWN;
    let entry = DVec3::new(1e-3, 2e-3, 0.0);
    let samples: Vec<Sample> = (0..40)
        .map(|i| Sample { time: f64::from(i), tip: entry + direction * (0.3 * f64::from(i) - 2.0) * MM, direction })
        .collect();
    let f = figures(&samples);
    near(f.entry_error.unwrap(), 5f64.sqrt() * MM, 1e-9);
    near(f.entry_angle_error.unwrap(), 10f64.to_radians(), 1e-12);
    let [pass] = passes(&samples, &BLOCK)[..] else { panic!("one pass") };
    near(pass.time, 7.0, 0.0);
    near(pass.point.distance(entry), 0.0, 1e-12);
    // A recording that begins inside has its entry where the shaft comes out.
    let late = figures(&samples[20..]);
    near(late.entry_error.unwrap(), 5f64.sqrt() * MM, 1e-9);
    assert_eq!(figures(&samples[..5]).entry_error, None);

    // Turned by 13 degrees in single ones, counted at 6 and at 12; the same in the air is none.
    let turned = |height: f64| {
        let at = |i: i32| {
            let direction = DQuat::from_rotation_x(f64::from(i).to_radians()) * DOWN;
            Sample { time: f64::from(i), tip: DVec3::Z * height, direction }
        };
        figures(&(0..=13).map(at).collect::<Vec<_>>()).redirections
    };
    assert_eq!((turned(-8e-3), turned(8e-3)), (2, 0));
}

#[test]
fn wrong_samples_are_refused_by_number() {
    let good = vertical([1.0, 0.0, -1.0], 0.1);
    check(&good).unwrap();
    let broken = |change: fn(&mut Sample)| {
        let mut samples = good.clone();
        change(&mut samples[2]);
        match KinematicFigures::of(&samples, &BLOCK, None) {
            Err(error @ Error::Input { .. }) => error.to_string(),
            other => panic!("{other:?}"),
        }
    };
    for (change, expected) in [
        ((|s: &mut Sample| s.tip.y = f64::NAN) as fn(&mut Sample), texts::NOT_FINITE),
        (|s| s.time = f64::INFINITY, texts::NOT_FINITE),
        (|s| s.time = 0.05, texts::TIME_GOES_BACK),
        (|s| s.direction *= 2.0, texts::NO_UNIT_VECTOR),
    ] {
        let message = broken(change);
        assert!(message.contains("sample 2 ") && message.contains(expected), "{message}");
        assert!(message.contains("way out"), "{message}");
    }
    assert_eq!(figures(&[]), KinematicFigures::default());
}

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes/training")
}

fn text_of(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).unwrap()
}

/// A training scene, with changes to its text.
fn changed(name: &str, changes: &[(&str, &str)]) -> Result<Scene, String> {
    let mut text = text_of(name);
    for (from, to) in changes {
        assert!(text.contains(from), "no `{from}` in {name}");
        text = text.replacen(from, to, 1);
    }
    Scene::parse(Path::new("scene.toml"), &text, &[]).map_err(|e| e.to_string())
}

fn scene(name: &str) -> Scene {
    changed(name, &[]).unwrap_or_else(|m| panic!("{m}"))
}

/// A frame whose energies balance: half of the work is stored, half has cut.
fn frame(number: u64, time: f64, depth: f64, a: f64) -> FrameRecord {
    let mut record = FrameRecord { frame: number, time, depth, tip_coordinate: a, ..Default::default() };
    let work = 1e-3 * (1.0 + number as f64);
    record.energy.external = work;
    record.energy.external_max = work;
    record.energy.elastic = 0.5 * work;
    record.energy.cutting = 0.5 * work;
    record
}

/// Frames and trajectory of a vertical needle, every 0.1 s: (depth, material coordinate) in mm.
fn run(places: &[(f64, f64)]) -> (Vec<Sample>, Vec<FrameRecord>) {
    let frames = places.iter().enumerate();
    frames
        .map(|(i, (depth, a))| {
            let time = 0.1 * (i + 1) as f64;
            let sample = Sample { time, tip: DVec3::Z * -depth * MM, direction: DOWN };
            (sample, frame(i as u64, time, depth * MM, a * MM))
        })
        .unzip()
}

/// The same records with the verdict that a run of a thousand nodes would have had.
fn judged(mut records: Vec<FrameRecord>) -> Vec<FrameRecord> {
    let mut judge = Judge::new(Sizes { nodes: 1000, cells: 1000, floor: 1e-12, mass_scaling: 1.0 });
    for record in &mut records {
        judge.check(record, 1_000_000);
        record.verdict = judge.verdict().clone();
    }
    records
}

#[test]
fn forces() {
    let scene = scene("hit_target.toml");
    let (samples, mut records) = run(&[(1.0, 0.0), (2.0, 0.0), (3.0, 1.0), (4.0, 2.0), (5.0, 3.0)]);
    for (record, force) in records.iter_mut().zip([1.0, 2.0, -1.0, 4.0, 0.0]) {
        record.force.axial = force;
    }
    records[3].force.lateral = DVec3::new(3.0, -4.0, 0.0);
    let p = PhysicalFigures::of(&scene, &samples, &records);
    near(p.peak_axial_force, 4.0, 0.0);
    near(p.impulse, 0.8, 1e-12);
    near(p.mean_axial_force.unwrap(), 1.2, 1e-12);
    // From -1 N to 4 N in 0.1 s; the fall of 4 N after it is no rise.
    near(p.largest_force_rate.unwrap(), 50.0, 1e-9);
    near(p.peak_lateral_force, 5.0, 1e-12);
    // In frames of 0.05 s a jump by 5 N counts over the window, not over the frame.
    records.iter_mut().for_each(|r| r.time *= 0.5);
    near(PhysicalFigures::of(&scene, &samples, &records).largest_force_rate.unwrap(), 20.0, 1e-9);
    // Above the surface no mean.
    let (samples, mut records) = run(&[(-2.0, 0.0), (-1.0, 0.0)]);
    records[1].force.axial = 1.0;
    assert_eq!(PhysicalFigures::of(&scene, &samples, &records).mean_axial_force, None);
    assert_eq!(p.separated_area, None);
    assert_eq!(p.core, None);
}

#[test]
fn overshoot_begins_where_the_tip_law_lets_go() {
    // Skin 0-1 mm, tissue, upper capsule 4-5 mm, thin layer 5-7 mm; the threshold has fallen 0.5 mm behind each top.
    let scene = scene("thin_layer_stop.toml");
    let places = [
        (1.0, 0.0),
        (2.0, 0.0),
        (3.0, 0.4),
        (3.2, 0.6), // the skin lets go
        (4.0, 3.0), // the tissue behind it did on the way
        (5.3, 4.3),
        (6.0, 4.6), // the upper capsule
        (6.5, 5.8), // the thin layer
        (7.0, 6.2),
        (7.0, 6.2),
        (7.0, 6.2),
    ];
    let (samples, records) = run(&places);
    let p = PhysicalFigures::of(&scene, &samples, &records);
    let found: Vec<(&str, f64)> = p.punctures.iter().map(|p| (p.layer.as_str(), (p.time * 10.0).round())).collect();
    assert_eq!(found, [("skin", 4.0), ("tissue", 5.0), ("upper capsule", 7.0), ("thin layer", 8.0)]);
    // Up to the last frame before the needle stands.
    for (puncture, overshoot, top) in [(0, 3.8, 0.0), (2, 1.0, 4.0), (3, 0.5, 5.0)] {
        near(p.punctures[puncture].overshoot, overshoot * MM, 1e-9);
        near(p.punctures[puncture].top, top * MM, 2.1e-5);
        near(p.punctures[puncture].beyond, (6.2 - top) * MM, 2.1e-5);
    }
    near(p.overshoot().unwrap(), 0.5 * MM, 1e-9);
    near(p.deepest_cut, 6.2 * MM, 1e-12);
    // Through the surface only: how far the needle goes then is the insertion itself.
    let (samples, records) = run(&[(1.0, 0.0), (2.0, 0.6), (3.0, 0.9)]);
    assert_eq!(PhysicalFigures::of(&scene, &samples, &records).overshoot(), None);
    // A pause ends the overshoot, and so does turning back.
    for then in [(6.0, 4.6), (5.5, 4.6)] {
        let (samples, records) = run(&[&places[..7], &[then], &places[7..]].concat());
        let p = PhysicalFigures::of(&scene, &samples, &records);
        near(p.punctures[2].overshoot, 0.0, 1e-9);
        near(p.punctures[3].overshoot, 0.5 * MM, 1e-9);
    }
    // Withdrawn and inserted again with a coordinate that stays: nothing gives way twice.
    let (samples, records) = run(&[&places[..], &[(2.0, 6.2), (6.9, 6.2)]].concat());
    assert_eq!(PhysicalFigures::of(&scene, &samples, &records).punctures.len(), 4);
    // Oblique: the same layers lie farther along the needle.
    let direction = DQuat::from_rotation_y(60f64.to_radians()) * DOWN;
    let (mut samples, records) = run(&[(3.0, 1.0), (9.0, 8.2)]);
    samples.iter_mut().zip(&records).for_each(|(s, r)| (s.tip, s.direction) = (direction * r.depth, direction));
    let oblique = PhysicalFigures::of(&scene, &samples, &records);
    let names: Vec<&str> = oblique.punctures.iter().map(|p| p.layer.as_str()).collect();
    assert_eq!(names, ["skin", "tissue"]);
    near(oblique.punctures[1].top, 2.0 * MM, 2.1e-5);
    near(oblique.deepest_cut, 4.1 * MM, 1e-9);
}

#[test]
fn energy_belongs_to_the_layer_of_the_tip() {
    let scene = scene("thin_layer_stop.toml");
    // Skin, tissue, capsule; then back up to the skin with the coordinate where it was.
    let (samples, mut records) = run(&[(1.5, 0.5), (3.0, 2.0), (6.0, 4.5), (0.5, 4.5)]);
    for (record, (cutting, friction, damping)) in
        records.iter_mut().zip([(1.0, 0.0, 0.0), (4.0, 1.0, 0.0), (9.0, 1.0, 0.5), (9.0, 4.0, 0.5)])
    {
        record.energy.cutting = cutting;
        record.energy.friction = friction;
        record.energy.damping = damping;
        record.force.axial = cutting;
    }
    let p = PhysicalFigures::of(&scene, &samples, &records);
    let layers: Vec<(&str, f64, f64, f64)> =
        p.layers.iter().map(|l| (l.layer.as_str(), l.injury, l.dissipated, l.peak_force)).collect();
    assert_eq!(
        layers,
        [("skin", 1.0, 4.0, 9.0), ("tissue", 3.0, 4.0, 4.0), ("upper capsule", 5.0, 5.5, 9.0)],
        "the way out drags along the skin"
    );
    near(p.injury, 9.0, 1e-12);
    near(p.dissipated, 13.5, 1e-12);
    near(p.layers.iter().map(|l| l.dissipated).sum(), p.dissipated, 1e-12);
}

const LOST_OR_CREATED: &str = "energy lost or created without a cause";

#[test]
fn every_gate_of_trust_shuts() {
    let (_, records) = run(&[(1.0, 0.0), (2.0, 0.5), (3.0, 1.5)]);
    assert_eq!(Trust::of(&records).reasons, Vec::<String>::new());
    let reasons = |change: &dyn Fn(&mut FrameRecord)| {
        let mut records = records.clone();
        records.iter_mut().for_each(change);
        Trust::of(&judged(records)).reasons
    };
    // 1.9 % pass, 2.1 % do not.
    assert!(reasons(&|r| r.energy.elastic -= 0.019 * r.energy.external).is_empty());
    for (change, expected) in [
        (&(|r: &mut FrameRecord| r.energy.elastic -= 0.021 * r.energy.external) as &dyn Fn(&mut FrameRecord), "2.1 %"),
        // Energy out of nothing, too.
        (&|r| r.energy.elastic += 0.03 * r.energy.external, LOST_OR_CREATED),
        (
            &|r| {
                let part = 0.06 * r.energy.elastic;
                (r.energy.kinetic, r.energy.cutting) = (part, r.energy.cutting - part);
            },
            texts::KINETIC_TO_INTERNAL,
        ),
        (
            &|r| {
                let part = 0.2 * r.energy.elastic;
                (r.energy.hourglass, r.energy.elastic) = (part, r.energy.elastic - part);
            },
            texts::HOURGLASS_TO_INTERNAL,
        ),
        (&|r| r.health.clamped_nodes = MOST_CLAMPED as u32 / 3 + 1, texts::CLAMPED_NODES),
        (&|r| r.force.axial = f64::NAN, texts::NOT_A_NUMBER),
        (&|r| r.energy.friction = f64::NAN, LOST_OR_CREATED),
    ] {
        let found = reasons(change);
        assert!(found.iter().any(|r| r.contains(expected)), "no `{expected}` in {found:?}");
    }
    assert!(reasons(&|r| r.health.clamped_nodes = MOST_CLAMPED as u32 / 3).is_empty());
    assert_eq!(Trust::of(&[]).reasons, [texts::NO_FRAMES]);
    // What is missing in a touch of the skin is much of its work, and nothing of that of the attempt.
    let whole = records.last().unwrap().energy.external_max;
    let touch = |part: f64| {
        let mut records = records.clone();
        records[0].energy.elastic -= part * whole;
        let records = judged(records);
        assert!(!records.last().unwrap().verdict.doubts.is_empty(), "the run is doubtful");
        Trust::of(&records).reasons
    };
    assert!(0.019 * whole > 0.02 * records[0].energy.external_max);
    assert!(touch(0.019).is_empty());
    assert!(touch(0.021)[0].contains(LOST_OR_CREATED));
}

/// What became of the goals of a scene.
fn met(score: &Score) -> Vec<Option<bool>> {
    score.goals.iter().map(|goal| goal.met).collect()
}

#[test]
fn a_target_is_hit_at_the_end_of_the_way_in() {
    let scene = scene("hit_target.toml");
    let judged = |distances_mm: &[f64]| {
        let places: Vec<(f64, f64)> = (1..=distances_mm.len()).map(|i| (i as f64, 0.5 * i as f64)).collect();
        let (samples, mut records) = run(&places);
        for (record, distance) in records.iter_mut().zip(distances_mm) {
            let from_tip = Some(DVec3::Z * -distance * MM);
            record.targets = vec![TargetRecord { displacement: DOWN * 0.3e-3, axial: None, from_tip }];
        }
        Score::of(&scene, &samples, &records, None).unwrap()
    };
    let hit = judged(&[5.0, 3.0, 0.74]);
    assert_eq!((met(&hit), hit.passed()), (vec![Some(true); 4], Some(true)));
    near(hit.goals[0].measured.unwrap(), 0.74, 1e-9);
    near(hit.value("target_distance.lesion").unwrap(), 0.74, 1e-9);
    near(hit.value("target_displacement.lesion").unwrap(), 0.3, 1e-9);
    let missed = judged(&[5.0, 3.0, 0.76]);
    assert_eq!((met(&missed), missed.passed()), (vec![Some(false), Some(true), Some(true), Some(true)], Some(false)));
    // Through the target and out behind it is no hit.
    assert_eq!(judged(&[5.0, 0.1, 2.0]).passed(), Some(false));
}

#[test]
fn the_time_limit_is_a_goal() {
    let judged = |limit: &str| {
        let scene = changed("thin_layer_stop.toml", &[("time_limit_s = 30.0", limit)]).unwrap();
        let (samples, records) = run(&[(1.0, 0.0), (6.5, 6.0), (6.5, 6.0)]);
        Score::of(&scene, &samples, &records, None).unwrap()
    };
    // From the first sample at 0.1 s to the last at 0.3 s.
    assert_eq!(met(&judged("time_limit_s = 0.21")), [Some(true); 4]);
    let late = judged("time_limit_s = 0.19");
    assert_eq!(met(&late), [Some(true), Some(true), Some(true), Some(false)]);
    near(late.goals[3].measured.unwrap(), 0.2, 1e-9);
    assert_eq!(met(&judged("")).len(), 3);
}

/// Told once while it is over the limit, and judged by its largest value.
#[test]
fn the_force_limit_is_a_goal_and_an_event() {
    let scene = scene("thin_layer_stop.toml");
    let judged = |forces: [f64; 3]| {
        let (samples, mut records) = run(&[(1.0, 0.0), (6.5, 6.0), (6.5, 6.0)]);
        records.iter_mut().zip(forces).for_each(|(record, force)| record.force.axial = force);
        let events = stylet::training::events::of_run(&scene, &samples, &records);
        let told = events.iter().filter(|e| e.kind == stylet::training::events::Kind::ForceLimit).count();
        let score = Score::of(&scene, &samples, &records, None).unwrap();
        let goal = score.goals.iter().find(|goal| goal.key == "force_limit").unwrap().clone();
        (goal.measured.unwrap(), goal.met, told)
    };
    assert_eq!(judged([0.5, 1.5, 1.0]), (1.5, Some(true), 0));
    assert_eq!(judged([0.5, 1.51, 1.6]), (1.6, Some(false), 1));
}

#[test]
fn a_layer_is_judged_by_what_the_tip_has_cut() {
    let scene = scene("thin_layer_stop.toml");
    let judged = |a: f64| {
        let (samples, records) = run(&[(1.0, 0.0), (7.5, a), (7.5, a)]);
        let score = Score::of(&scene, &samples, &records, None).unwrap();
        near(score.goals[0].measured.unwrap(), a, 1e-9);
        score.goals[0].met.unwrap()
    };
    // The needle stands 7.5 mm deep each time.
    assert_eq!([4.9, 5.1, 6.9, 7.1].map(judged), [false, true, true, false]);
}

#[test]
fn an_obstacle_is_avoided_by_tip_and_shaft() {
    let scene = scene("avoid_vessel.toml");
    let (radius, tip) = (scene.needle().unwrap().radius, scene.needle().unwrap().tip_length);
    // Along y at x = 1.5 mm, 5 mm deep, radius 1 mm.
    let Some(Goal::Avoid { obstacle, clearance, .. }) = scene.task.as_ref().map(|t| t.goals[1].clone()) else {
        panic!("the second goal")
    };
    let region = scene.regions.iter().find(|r| r.name == "vessel").unwrap();
    let RegionShape::Cylinder { from, to, radius: vessel } = region.shape else { panic!("a cylinder") };
    assert_eq!(obstacle, Obstacle::Cylinder { from, to, radius: vessel }, "the goal is where the vessel is");
    near(clearance, 0.5e-3, 1e-15);
    let least = |x_mm: f64, depth_mm: f64| {
        let sample = Sample { time: 0.0, tip: DVec3::new(x_mm, 0.0, -depth_mm) * MM, direction: DOWN };
        clearance_of(&scene, &[sample], &obstacle).unwrap()
    };
    // A tip right above, and a shaft that goes by at 4 mm beside the axis of the vessel.
    near(least(1.5, 2.0), 2e-3, 1e-12);
    near(least(-2.5, 12.0), 3e-3 - radius, 1e-12);
    // As far down as the cone reaches up: the shaft begins at the height of the vessel.
    near(least(-2.5, 5.0 + tip / MM), 3e-3 - radius, 1e-12);
    assert!(least(1.5, 9.0) < 0.0, "straight through it");
    // The score takes the worst sample, also one between two good ones.
    let judged = |x_mm: f64| {
        let (mut samples, records) = run(&[(1.0, 0.5), (12.0, 11.0), (12.5, 11.5)]);
        samples[1].tip.x = x_mm * MM;
        samples[0].tip.x = -8.0 * MM;
        samples[2].tip.x = -8.0 * MM;
        Score::of(&scene, &samples, &records, None).unwrap().goals[1].clone()
    };
    let side = 1.5 - 1.0 - 0.5 - radius / MM;
    let (near_miss, touch) = (judged(side - 0.8), judged(side + 0.2));
    assert_eq!((near_miss.met, touch.met), (Some(true), Some(false)));
    assert!(touch.measured.unwrap() > 0.0 && touch.measured.unwrap() < 0.5, "{touch:?}");
    let sphere = Obstacle::Sphere { centre: DVec3::new(0.0, 3e-3, -4e-3), radius: 1e-3 };
    let above = Sample { time: 0.0, tip: DVec3::ZERO, direction: DOWN };
    near(clearance_of(&scene, &[above], &sphere).unwrap(), 4e-3, 1e-12);
    assert_eq!(clearance_of(&scene, &[], &sphere), None);
}

#[test]
fn a_core_is_weighed() {
    let judged = |goal: &str, core: Option<f64>| {
        let scene = changed("core_biopsy.toml", &[("mass_mg = 6.0", goal)]).unwrap();
        let (samples, mut records) = run(&[(1.0, 0.5), (6.0, 5.5)]);
        records[1].core = core.map(|mg| CoreSample { rest_length: 5e-3, mass: mg * 1e-6, ..Default::default() });
        Score::of(&scene, &samples, &records, None).unwrap()
    };
    assert_eq!(judged("mass_mg = 6.0", Some(6.1)).goals[0].met, Some(true));
    assert_eq!(judged("mass_mg = 6.0", Some(5.9)).goals[0].met, Some(false));
    assert_eq!(judged("mass_mg = 6.0", None).goals[0].met, Some(false));
    // 1060 kg/m3: 6 mm3 weigh 6.36 mg.
    assert_eq!(judged("volume_mm3 = 6.0", Some(6.37)).goals[0].met, Some(true));
    let little = judged("volume_mm3 = 6.0", Some(6.35));
    assert_eq!(little.goals[0].met, Some(false));
    near(little.goals[0].measured.unwrap(), 6.35 / 1.06, 1e-9);
    near(little.value("core_mass").unwrap(), 6.35, 1e-9);
    near(little.value("core_length").unwrap(), 5.0, 1e-9);
}

#[test]
fn a_run_outside_its_gates_is_not_scored() {
    let scene = scene("thin_layer_stop.toml");
    let (samples, mut records) = run(&[(1.0, 0.0), (6.5, 6.0), (6.5, 6.0)]);
    let good = Score::of(&scene, &samples, &records, None).unwrap();
    assert_eq!(good.passed(), Some(true));
    records[1].energy.elastic *= 1.1;
    let records = judged(records);
    let bad = Score::of(&scene, &samples, &records, Some(&good)).unwrap();
    assert_eq!(bad.passed(), None);
    assert!(met(&bad).iter().all(Option::is_none), "{:?}", met(&bad));
    assert_eq!(bad.goals[0].measured, None);
    assert_eq!((bad.value("peak_axial_force"), bad.value("dissipated_energy")), (None, None));
    // How the needle moved does not depend on the tissue.
    assert_eq!(bad.value("path_length"), good.value("path_length"));
    assert!(bad.text().contains("Not scored: energy lost or created"), "{}", bad.text());
    let row = bad.rows.iter().find(|r| r.key == "dissipated_energy").unwrap();
    assert_eq!(row.reference, good.value("dissipated_energy"));
    assert!(Score::of(&scene, &[], &records, None).is_err(), "no trajectory");
    // A run that stopped early is told by its caller.
    let mut stopped = good.clone();
    stopped.fail("run stopped in frame 2");
    assert_eq!((stopped.passed(), stopped.value("peak_axial_force")), (None, None));
    assert_eq!(stopped.value("path_length"), good.value("path_length"));
    assert!(stopped.text().contains("Not scored: run stopped in frame 2"));
}

#[test]
fn a_score_in_all_its_forms() {
    let scene = scene("thin_layer_stop.toml");
    let (samples, records) = run(&[(1.0, 0.0), (4.0, 3.0), (6.5, 6.0), (6.5, 6.0)]);
    let first = Score::of(&scene, &samples, &records, None).unwrap();
    let score = Score::of(&scene, &samples[..3], &records[..3], Some(&first)).unwrap();
    assert_eq!(serde_json::from_str::<Score>(&score.json()).unwrap().csv(), score.csv());
    for (text, delimiter) in [(score.csv(), b','), (score.tsv(), b'\t')] {
        let mut reader = csv::ReaderBuilder::new().delimiter(delimiter).from_reader(text.as_bytes());
        assert_eq!(reader.headers().unwrap(), COLUMNS.as_slice());
        let lines: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(lines.len(), score.rows.len() + score.goals.len() + 5);
        let elapsed = lines.iter().find(|l| &l[1] == "elapsed_time").unwrap();
        assert_eq!(
            (&elapsed[0], &elapsed[3], &elapsed[4], &elapsed[5], &elapsed[6]),
            ("figure", "s", "0.2", "0.3", "lower")
        );
        let goal = lines.iter().find(|l| &l[1] == "stop_in_layer").unwrap();
        assert_eq!((&goal[0], &goal[4], &goal[7], &goal[8], &goal[9]), ("goal", "6", "5", "7", "1"));
        let scored = lines.iter().find(|l| &l[1] == "scored").unwrap();
        assert_eq!((&scored[0], &scored[9]), ("trust", "1"));
    }
    let text = score.text();
    println!("{text}");
    for line in text.lines() {
        assert!(line.chars().count() <= TEXT_WIDTH, "{} characters: {line}", line.chars().count());
    }
    for expected in
        ["Passed", "met        stop in thin layer: measured 6 mm, 5 to 7 mm", "Injury energy: skin", texts::TRUST]
    {
        assert!(text.contains(expected), "no `{expected}` in\n{text}");
    }
    // Every key has a text, and no two figures share one.
    let keys: BTreeSet<&str> = texts::FIGURES.iter().map(|f| f.key).collect();
    assert_eq!(keys.len(), texts::FIGURES.len());
    let rows: BTreeSet<&str> = score.rows.iter().map(|r| r.key.as_str()).collect();
    assert_eq!(rows.len(), score.rows.len());
    for text in texts::FIGURES.iter().filter(|f| !f.key.ends_with('.')) {
        assert_eq!(rows.contains(text.key), !text.optional, "{}", text.key);
    }
}

/// A short and coarse insertion into the first training scene, on the CPU engine.
#[test]
fn a_headless_run_is_scored() {
    let overrides = [
        "motion.phase=[{kind = \"insert\", speed_mm_s = 10, depth_mm = 6}]",
        "solver.mass_scaling=160",
        "tissue.cell_size_mm=1.2",
        "outputs.pictures_at_depth_mm=[]",
        "target=[{name = \"lesion\", position_mm = [0, 0, -5.5]}]",
    ]
    .map(String::from);
    let scene = Scene::load(&folder().join("hit_target.toml"), &overrides).unwrap_or_else(|e| panic!("{e}"));
    let mut simulation = Simulation::new(scene, EngineChoice::Cpu).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap() {
        records.push(record);
    }
    let scene = &simulation.model.scene;
    let samples = scripted_samples(scene, &records);
    assert_eq!(samples.len(), records.len() + 1);
    let score = Score::of(scene, &samples, &records, None).unwrap();
    println!("{}", score.text());
    assert_eq!(score.trust.reasons, Vec::<String>::new());
    let value = |key: &str| score.value(key).unwrap_or_else(|| panic!("no {key}"));
    near(value("elapsed_time"), 0.6, 2e-3);
    near(value("path_length"), 6.0, 1e-6);
    near(value("path_in_tissue"), 6.0, 1e-6);
    near(value("swept_area"), 0.0, 1e-6);
    near(value("entry_error"), 0.0, 1e-6);
    assert_eq!((value("passes"), value("redirections")), (1.0, 0.0));
    // The same run by its summary and by its records.
    let mut summary = Summary::default();
    summary.take_frames(&records);
    near(value("peak_axial_force"), summary.peak_force_n.unwrap(), 1e-9);
    near(value("deepest_cut"), records.last().unwrap().tip_coordinate / MM, 1e-9);
    assert!(value("deepest_cut") > 3.0 && value("deepest_cut") < 6.0);
    let energy = &records.last().unwrap().energy;
    near(value("injury_energy"), energy.cutting * 1e3, 1e-9);
    assert!(value("injury_energy") > 0.1, "the path has been cut");
    let gap = records.last().unwrap().targets[0].from_tip.unwrap().length() / MM;
    near(score.goals[0].measured.unwrap(), gap, 1e-9);
    assert_eq!(score.goals[0].met, Some(gap <= 0.75));
    // The motion leaves no doubt: against itself every figure has its own value as reference.
    let again = Score::of(scene, &samples, &records, Some(&score)).unwrap();
    assert!(again.rows.iter().all(|row| row.reference == row.value));
    // One wrong frame, and the run is not scored.
    records[20].energy.external *= 1.5;
    assert_eq!(Score::of(scene, &samples, &judged(records), None).unwrap().passed(), None);
}

#[test]
fn the_training_scenes_are_tasks() {
    let mut names: Vec<String> =
        std::fs::read_dir(folder()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    assert_eq!(
        names,
        ["avoid_vessel.toml", "core_biopsy.toml", "hit_target.toml", "lumbar_oblique.toml", "thin_layer_stop.toml"]
    );
    let mut tasks = BTreeSet::new();
    for name in &names {
        let scene = Scene::load(&folder().join(name), &[]).unwrap_or_else(|e| panic!("{e}"));
        assert!(scene.notices.is_empty(), "{name}: {:?}", scene.notices);
        let cells = Mesh::of_scene(&scene).cell_count();
        println!("{name}: {cells} cells");
        assert!((5000..=7500).contains(&cells), "{name}: {cells} cells");
        let task = scene.task.unwrap_or_else(|| panic!("{name} has no task"));
        assert!(!task.briefing.contains('\n'), "{name}: the briefing is folded where it is shown");
        assert!(tasks.insert(task.name));
    }
    let goals = scene("thin_layer_stop.toml").task.unwrap().goals;
    assert_eq!(goals[0], Goal::StopInLayer { name: "thin layer".into(), from: 5.0 * MM, to: 7.0 * MM });
    assert!(matches!(goals[1], Goal::Figure { figure, most } if figure.key == "passes" && most == 1.0));
    let goals = scene("hit_target.toml").task.unwrap().goals;
    assert_eq!(goals[0], Goal::HitTarget { target: 0, tolerance: 0.75 * MM });
    // A task changes nothing else.
    let plain = Scene::load(&folder().join("../muscle_biopsy.toml"), &[]).unwrap();
    assert_eq!(plain.task, None);
    let text = text_of("hit_target.toml");
    let without = Scene::parse(Path::new("scene.toml"), text.split("[task]").next().unwrap(), &[]).unwrap();
    let with = Scene { task: None, ..scene("hit_target.toml") };
    assert_eq!(format!("{without:?}"), format!("{with:?}"));
}

#[test]
fn defaults_of_goals() {
    let goals = |name: &str, from: &str, to: &str| changed(name, &[(from, to)]).unwrap().task.unwrap().goals;
    let target = goals("hit_target.toml", "target = \"lesion\"\ntolerance_mm = 0.75", "");
    assert_eq!(target[0], Goal::HitTarget { target: 0, tolerance: 0.75 * MM }, "first target, its radius");
    let Goal::Avoid { clearance, name, .. } = &goals(
        "avoid_vessel.toml",
        "name = \"vessel\"\ncylinder_mm = { from = [1.5, -10.0, -5.0], to = [1.5, 10.0, -5.0], radius = 1.0 }\nclearance_mm = 0.5",
        "sphere_mm = { centre = [1, 2, -3], radius = 1 }",
    )[1] else {
        panic!("an obstacle")
    };
    assert_eq!((*clearance, name.as_str()), (0.0, "obstacle 2"));
    let layer = goals("thin_layer_stop.toml", "region = \"thin layer\"", "depth_mm = [1, 2]");
    assert_eq!(layer[0], Goal::StopInLayer { name: "layer 1".into(), from: 1.0 * MM, to: 2.0 * MM });
    let core = goals("core_biopsy.toml", "mass_mg = 6.0", "volume_mm3 = 5");
    let [Goal::CoreVolume { least }] = core[..] else { panic!("{core:?}") };
    near(least, 5e-9, 1e-20);
}

#[test]
fn wrong_tasks_are_refused_at_their_line() {
    let (hit, avoid, thin, core) = ("hit_target.toml", "avoid_vessel.toml", "thin_layer_stop.toml", "core_biopsy.toml");
    let goal = "kind = \"hit_target\"\ntarget = \"lesion\"\ntolerance_mm = 0.75";
    let text = text_of(hit);
    let all_goals = text[text.find("[[task.goal]]").expect("a goal")..].to_string();
    for (name, from, to, marker, expected) in [
        (hit, "name = \"hit a lesion at depth\"\n", "", "[task]", "missing field `name`"),
        (hit, "name = \"hit a lesion at depth\"", "name = \" \"", "name = \" \"", "is empty or holds"),
        (hit, "name = \"hit a lesion at depth\"", "name = \"a\\nb\"", "name = \"a", "is empty or holds"),
        (hit, "time_limit_s = 30.0", "time_limit_s = 0", "time_limit_s = 0", "greater than 0"),
        (hit, "time_limit_s = 30.0", "time_limit = 30", "time_limit = 30", "did you mean `time_limit_s`?"),
        (hit, "force_limit_n = 2.0", "force_limit_n = 0", "force_limit_n = 0", "greater than 0"),
        (hit, "force_limit_n = 2.0", "force_limit_n = 11", "force_limit_n = 11", "10"),
        (hit, "force_limit_n = 2.0", "force_limit_mn = 2", "force_limit_mn = 2", "did you mean `force_limit_n`?"),
        (hit, "tolerance_mm = 0.75", "weight = -1", "weight = -1", "greater than 0"),
        (hit, "tolerance_mm = 0.75", "weight = inf", "weight = inf", "not a finite number"),
        (hit, all_goals.as_str(), "", "[task]", "has no goal"),
        (hit, goal, "kind = \"hit\"", "kind = \"hit\"", "use one of: hit_target, avoid"),
        (hit, goal, "target = \"lesion\"", "[[task.goal]]", "missing field `kind`"),
        (hit, "target = \"lesion\"", "target = \"lesoin\"", "target = \"lesoin\"", "did you mean \"lesion\"?"),
        (hit, "tolerance_mm = 0.75", "tolerance_mm = -1", "tolerance_mm = -1", "greater than 0"),
        (hit, "tolerance_mm = 0.75", "tolerance_mm = nan", "tolerance_mm = nan", "not a finite number"),
        (hit, "tolerance_mm = 0.75", "mass_mg = 3", "mass_mg = 3", "use one of: target, tolerance_mm"),
        (hit, "tolerance_mm = 0.75", "tolerance = 3", "tolerance = 3", "did you mean `tolerance_mm`?"),
        (hit, goal, "kind = \"core\"\nmass_mg = 3", "kind = \"core\"", "only a hollow needle takes a core"),
        (hit, goal, "kind = \"stop_in_layer\"\nregion = \"fat\"", "region = ", "no region with layer_mm"),
        (avoid, "clearance_mm = 0.5", "clearance_mm = -0.5", "clearance_mm = -0.5", "from 0 to"),
        (
            avoid,
            "clearance_mm = 0.5",
            "sphere_mm = {centre = [0, 0, 0], radius = 1}",
            "cylinder_mm = { from = [1.5, -10.0, -5.0], to = [1.5, 10.0, -5.0], radius = 1.0 }\n# b",
            "two shapes",
        ),
        (thin, "region = \"thin layer\"", "region = \"thin\"", "region = \"thin\"", "no layer called \"thin\""),
        (thin, "region = \"thin layer\"", "depth_mm = [3, 2]", "depth_mm = [3, 2]", "the smaller one"),
        (thin, "region = \"thin layer\"", "depth_mm = [17, 18]", "depth_mm = [17, 18]", "below the bottom"),
        (
            thin,
            "region = \"thin layer\"",
            "region = \"skin\"\ndepth_mm = [1, 2]",
            "depth_mm = [1, 2]",
            "both say where",
        ),
        (thin, "region = \"thin layer\"", "", "[[task.goal]]", "does not say where"),
        (core, "mass_mg = 6.0", "mass_mg = 6.0\nvolume_mm3 = 5", "volume_mm3 = 5", "both say how much"),
        (core, "mass_mg = 6.0", "", "[[task.goal]]", "does not say how much"),
        (core, "mass_mg = 6.0", "mass_mg = 0", "mass_mg = 0", "greater than 0"),
    ] {
        let message = changed(name, &[(from, to)]).map(drop).expect_err(to);
        let text = text_of(name).replacen(from, to, 1);
        // The obstacle with two shapes is found at its second occurrence: the first is the vessel itself.
        let line = match marker.strip_suffix("\n# b") {
            Some(first) => 1 + text.lines().enumerate().filter(|(_, l)| l.contains(first)).nth(1).unwrap().0,
            None => 1 + text.lines().position(|l| l.contains(marker)).unwrap_or_else(|| panic!("no {marker}")),
        };
        assert!(message.contains(expected), "{name}, {to}: no `{expected}` in\n{message}");
        assert!(message.contains(&format!("scene.toml:{line}:")), "{name}, {to}: no line {line} in\n{message}");
        assert!(message.contains("= way out: "), "{message}");
    }
    let no_target =
        changed(hit, &[("[[target]]\nname = \"lesion\"\nposition_mm = [0.0, 0.0, -9.0]\nradius_mm = 0.75\n", "")]);
    assert!(no_target.unwrap_err().contains("the scene has no target"));
    let many = "[[task.goal]]\nkind = \"hit_target\"\n".repeat(17);
    let many = changed(hit, &[(&format!("[[task.goal]]\n{goal}"), &many)]).unwrap_err();
    assert!(many.contains("the task has 18 goals"), "{many}");
    let needleless = "effects = []\n[tissue]\nsize_mm = [10, 10, 10]\ncell_size_mm = 2\n[material]\npreset = \"across-fibre\"\n\
                      [solver]\nduration_s = 1\n[task]\nname = \"a\"\nbriefing = \"b\"\n[[task.goal]]\nkind = \"stop_in_layer\"\n\
                      depth_mm = [1, 2]\n";
    let message = Scene::parse(Path::new("scene.toml"), needleless, &[]).unwrap_err().to_string();
    assert!(message.contains("done with a needle"), "{message}");
}

/// A score of a task, with a path of this length [mm].
fn some_score(length: f64) -> Score {
    let scene = scene("thin_layer_stop.toml");
    let (samples, records) = run(&[(0.0, 0.0), (length, 0.5 * length)]);
    Score::of(&scene, &samples, &records, None).unwrap()
}

#[test]
fn attempts_are_kept_and_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(&folder.path().join("history"));
    assert!(history.attempts("anna").unwrap().attempts.is_empty());
    assert!(history.trainees().unwrap().is_empty());
    for (index, length) in [9.0, 7.0, 6.5].into_iter().enumerate() {
        let (attempt, path) = history.add("anna", &some_score(length)).unwrap();
        assert_eq!(attempt.number as usize, index + 1);
        assert!(path.is_file() && path.starts_with(folder.path().join("history")));
    }
    history.add("Berta Müller", &some_score(4.0)).unwrap();
    let found = history.attempts("anna").unwrap();
    assert!(found.broken.is_empty());
    let series = progress(&found.attempts, "stop in a thin layer", "path_length");
    let values: Vec<(u32, f64)> = series.iter().map(|(n, _, v)| (*n, (v * 1e6).round() / 1e6)).collect();
    assert_eq!(values, [(1, 9.0), (2, 7.0), (3, 6.5)]);
    assert!(series.iter().all(|point| point.1 > 1_700_000_000), "seconds since 1970");
    assert!(progress(&found.attempts, "another task", "path_length").is_empty());
    assert!(progress(&found.attempts, "stop in a thin layer", "core_mass").is_empty());
    // JSON may lose the last bit of a number.
    assert_eq!(found.attempts[1].score.csv(), some_score(7.0).csv());
    assert_eq!(history.trainees().unwrap(), ["Berta Müller", "anna"]);
    let taskless = Score { task: None, ..some_score(1.0) };
    assert!(history.add("anna", &taskless).unwrap_err().to_string().contains("way out"));
}

#[test]
fn broken_attempts_are_told_and_left() {
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(folder.path());
    let (_, first) = history.add("anna", &some_score(5.0)).unwrap();
    let (_, second) = history.add("anna", &some_score(5.0)).unwrap();
    let whole = std::fs::read_to_string(&first).unwrap();
    let stem = first.file_name().unwrap().to_str().unwrap().replace("_1.json", "");
    let file = |number: u32| first.with_file_name(format!("{stem}_{number}.json"));
    let damages = [
        (7, whole[..whole.len() / 2].to_string(), "EOF"),
        (8, "no JSON at all".into(), "expected"),
        (9, whole.replace("\"version\": 1", "\"version\": 99"), "version 99"),
        (10, whole.replace("\"trainee\": \"anna\"", "\"trainee\": \"berta\""), "belongs to `berta`"),
        (11, String::new(), "EOF"),
        (12, " ".repeat((1 << 20) + 1), "more than the 1 MiB"),
    ];
    for (number, text, _) in &damages {
        std::fs::write(file(*number), text).unwrap();
    }
    std::fs::create_dir(first.with_file_name("a folder.json")).unwrap();
    std::fs::write(first.with_file_name("notes.txt"), "mine").unwrap();
    let found = history.attempts("anna").unwrap();
    assert_eq!(found.attempts.len(), 2);
    assert_eq!(found.broken.len(), damages.len() + 1, "{:?}", found.broken);
    for (number, text, expected) in &damages {
        let name = file(*number).display().to_string();
        let told = found.broken.iter().map(|e| e.to_string()).find(|m| m.contains(&name)).unwrap();
        assert!(told.contains(expected) && told.contains("way out"), "no `{expected}` in {told}");
        assert_eq!(&std::fs::read_to_string(file(*number)).unwrap(), text, "changed");
    }
    // The next attempt takes no number that a broken file has, and replaces nothing.
    let (next, path) = history.add("anna", &some_score(5.0)).unwrap();
    assert_eq!((next.number, path), (13, file(13)));
    assert_eq!(std::fs::read_to_string(&first).unwrap(), whole);
    assert!(second.is_file());
    assert_eq!(history.trainees().unwrap(), ["anna"]);
    assert!(history::read(&file(99)).is_err());
}

#[test]
fn no_name_leads_out_of_the_history() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().join("inner/history");
    let history = History::new(&root);
    let long = "x".repeat(5000);
    let wide = "\u{1f489}".repeat(300);
    let evil = [
        "..",
        ".",
        "../..",
        "../../escape",
        "/etc/passwd",
        "a/b",
        "a\\b",
        "a_b",
        "a b",
        "C:\\x",
        "con",
        "nul.json",
        "a\0b",
        "-rf",
        "Anna",
        "anna",
        "ANNA",
        "Ärztin",
        "李",
        "\u{202e}abc",
        "a\nb",
        "~root",
        "$HOME",
        "%2e%2e",
        ".hidden",
        &long,
        &wide,
    ];
    let mut folders = BTreeSet::new();
    for name in evil {
        let (attempt, path) = history.add(name, &some_score(3.0)).unwrap_or_else(|e| panic!("{name:?}: {e}"));
        assert_eq!(attempt.trainee, name);
        // Exactly one folder below the root, by its real place.
        let real = path.canonicalize().unwrap();
        assert_eq!(real.parent().unwrap().parent().unwrap(), root.canonicalize().unwrap(), "{name:?}");
        assert!(folders.insert(real.parent().unwrap().to_string_lossy().to_lowercase()), "{name:?} shares a folder");
        assert_eq!(history.attempts(name).unwrap().attempts.len(), 1, "{name:?}");
        assert!(!file_name(name).starts_with(['.', '-']), "{name:?}");
    }
    assert_eq!(history.trainees().unwrap().len(), evil.len());
    for empty in ["", " ", "\t\n"] {
        assert!(history.add(empty, &some_score(3.0)).unwrap_err().to_string().contains("way out"));
    }
    // The name of a task is no way out, either.
    let score = Score { task: Some("../../../task".into()), ..some_score(3.0) };
    let (_, path) = history.add("anna", &score).unwrap();
    assert_eq!(path.canonicalize().unwrap().parent().unwrap(), history.folder("anna").unwrap().canonicalize().unwrap());
    // Nothing was made beside the history.
    let outside: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(outside, ["inner"]);
    assert_eq!(std::fs::read_dir(folder.path().join("inner")).unwrap().count(), 1);
}

/// Runs all five scenes as they are; minutes on a software adapter.
#[test]
#[ignore = "minutes on a software adapter: cargo test --release --test runs training -- --ignored --nocapture"]
fn every_reference_attempt_passes() {
    for name in
        ["hit_target.toml", "avoid_vessel.toml", "thin_layer_stop.toml", "lumbar_oblique.toml", "core_biopsy.toml"]
    {
        let begin = std::time::Instant::now();
        let scene = Scene::load(&folder().join(name), &[]).unwrap_or_else(|e| panic!("{e}"));
        let mut simulation = Simulation::new(scene, EngineChoice::Auto).unwrap();
        let mut records = Vec::new();
        while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{name}: {e}")) {
            records.push(record);
        }
        let scene = &simulation.model.scene;
        let score = Score::of(scene, &scripted_samples(scene, &records), &records, None).unwrap();
        println!("{}{:.1} s of wall time\n", score.text(), begin.elapsed().as_secs_f64());
        assert_eq!(score.passed(), Some(true), "{name}");
    }
}
