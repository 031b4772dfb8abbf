//! A needle on a free path in a label map: the skin, bone, several passes, and the planned path beside it.

use std::path::Path;

use glam::DVec3;
use stylet::HandPose;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::simulation::{EngineChoice, Purpose, Simulation};

use crate::common::gpu;

const MM: f64 = 1e-3;

fn case(name: &str, overrides: &[&str]) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/anatomy/{name}.toml"));
    let overrides: Vec<String> = overrides.iter().map(|o| o.to_string()).collect();
    Scene::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"))
}

/// A simulation on the processor that a hand leads.
fn led(scene: Scene) -> Simulation {
    let purpose = Purpose { led: true, drawn: false, lanes: true };
    Simulation::for_purpose(scene, None, purpose).unwrap_or_else(|error| panic!("{error}"))
}

/// Leads the needle in a straight line to a pose at a speed of the tip [m/s].
fn go(simulation: &mut Simulation, to: HandPose, speed: f64, records: &mut Vec<FrameRecord>) {
    let from = simulation.hand().unwrap();
    let tip = |pose: &HandPose| pose.entry + pose.direction * pose.depth;
    let frame = 1.0 / 60.0;
    let frames = ((tip(&to) - tip(&from)).length() / (speed * frame)).ceil().max(1.0);
    for n in 1..=frames as usize {
        let part = n as f64 / frames;
        let direction = from.direction.lerp(to.direction, part).normalize();
        let entry = from.entry.lerp(to.entry, part);
        simulation.lead(&HandPose { entry, direction, depth: from.depth + (to.depth - from.depth) * part });
        while let Some(record) = simulation.next_frame().unwrap_or_else(|error| panic!("{error}")) {
            records.push(record);
        }
    }
}

/// The point of the skin over a point.
fn on_skin(simulation: &Simulation, x: f64, y: f64) -> DVec3 {
    let at = DVec3::new(x, y, 0.0);
    DVec3 { z: simulation.model.skin_at(at).expect("there is tissue below"), ..at }
}

#[track_caller]
fn sound(simulation: &Simulation, records: &[FrameRecord]) {
    let verdict = simulation.verdict();
    assert!(verdict.sentence().is_none(), "{:?}", verdict.sentence());
    let troubles = records.iter().map(|r| r.health.clamped_nodes + r.health.inverted_cells).sum::<u32>();
    assert_eq!(troubles, 0);
}

#[test]
fn the_free_path_of_a_straight_motion_is_the_planned_one_on_all_engines() {
    let free = case("neck_vein", &[]);
    let planned = case("neck_vein", &["puncture.path=\"auto\""]);
    assert!(free.has_free_path() && !planned.has_free_path());
    let forces = |scene: Scene, engine: EngineChoice| -> Vec<f64> {
        let mut run = Simulation::new(scene, engine).unwrap_or_else(|error| panic!("{error}"));
        let mut forces = Vec::new();
        while let Some(record) = run.next_frame().unwrap() {
            forces.push(record.force.axial);
        }
        assert!(run.verdict().sentence().is_none());
        forces
    };
    let reference = forces(free.clone(), EngineChoice::Cpu64);
    let peak = reference.iter().fold(0.0f64, |a, b| a.max(*b));
    let farthest = |other: &[f64]| {
        assert_eq!(other.len(), reference.len());
        reference.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / peak
    };
    // Layers give way a frame earlier or later.
    let lanes = farthest(&forces(free.clone(), EngineChoice::Cpu));
    assert!(lanes < 0.01, "{lanes}");
    if gpu().is_some() {
        let gpu = farthest(&forces(free, EngineChoice::Gpu));
        assert!(gpu < 0.05, "{gpu}");
    }
    let other = forces(planned, EngineChoice::Cpu);
    let end = reference.last().unwrap() / other.last().unwrap() - 1.0;
    let top = peak / other.iter().fold(0.0f64, |a, b| a.max(*b)) - 1.0;
    assert!(end.abs() < 0.05 && top.abs() < 0.02, "{end} {top}");
}

/// Entries elsewhere than planned, oblique, twice: there is a force where the skin is and none before, and energy is in balance.
#[test]
fn a_hand_enters_where_it_wants_and_again() {
    let mut simulation = led(case("forearm_vein", &[]));
    let mut records = Vec::new();
    for (x, y, part) in [(4.0 * MM, 3.0 * MM, 1.0), (-3.0 * MM, -2.0 * MM, 0.5)] {
        let skin = on_skin(&simulation, x, y);
        // Steeper to the skin than planned, which runs flat under it.
        let slope = |axis: DVec3| {
            let [a, b] = [-MM, MM].map(|way| on_skin(&simulation, x + axis.x * way, y + axis.y * way).z);
            (b - a) / (2.0 * MM)
        };
        let normal = DVec3::new(-slope(DVec3::X), -slope(DVec3::Y), 1.0).normalize();
        let direction = (DVec3::NEG_Z - normal * part).normalize();
        let at = |depth: f64| HandPose { entry: skin, direction, depth };
        // Up first: the needle begins on the skin, which rises 6 mm over 3 mm beside it.
        let here = simulation.hand().unwrap();
        go(&mut simulation, HandPose { depth: -14.0 * MM, ..here }, 20.0 * MM, &mut records);
        let before = records.len();
        go(&mut simulation, at(-14.0 * MM), 20.0 * MM, &mut records);
        go(&mut simulation, at(-3.0 * MM), 20.0 * MM, &mut records);
        go(&mut simulation, at(-MM), 5.0 * MM, &mut records);
        // The needle has a mass: a hand that turns it feels that.
        let felt_of_tissue = |r: &FrameRecord| (r.force.axial - r.force.inertia).abs();
        let outside = records[before..].iter().map(felt_of_tissue).fold(0.0, f64::max);
        assert!(outside < 1e-6, "{outside} N before the skin at {skin}");
        let skin_at = records.len();
        go(&mut simulation, at(6.0 * MM), 5.0 * MM, &mut records);
        // The skin gives way by some of it, a force is felt: that of a cone grows with the square of its depth.
        let felt = records[skin_at..].iter().map(|r| r.force.axial).fold(0.0, f64::max);
        assert!(felt > 0.05, "{felt} N behind the skin at {skin}");
        let inside = records.last().unwrap();
        assert!(inside.tip_coordinate > 3.0 * MM, "{}", inside.tip_coordinate);
        go(&mut simulation, at(-3.0 * MM), 5.0 * MM, &mut records);
        let out = records.last().unwrap();
        assert!(felt_of_tissue(out) < 1e-6 && out.tip_coordinate == 0.0, "{:?} {}", out.force, out.tip_coordinate);
    }
    sound(&simulation, &records);
}

/// A needle that is turned within the tissue towards bone stops at its true surface, and comes away again.
#[test]
fn a_hand_meets_bone_from_the_side_and_comes_away() {
    let scene = case("lumbar_puncture", &[]);
    // 10 mm higher the spinous process lies before the needle.
    let up = scene.case.as_ref().unwrap().frame.axes.transpose() * DVec3::Z;
    let mut simulation = led(scene);
    let shift = up * (10.0 * MM);
    let skin = on_skin(&simulation, shift.x, shift.y);
    let mut records = Vec::new();
    let at = |depth: f64| HandPose { entry: skin, direction: DVec3::NEG_Z, depth };
    let here = simulation.hand().unwrap();
    go(&mut simulation, HandPose { depth: -2.0 * MM, ..here }, 20.0 * MM, &mut records);
    go(&mut simulation, at(-2.0 * MM), 20.0 * MM, &mut records);
    go(&mut simulation, at(17.0 * MM), 5.0 * MM, &mut records);
    let stopped = simulation.hand().unwrap();
    let bone = records.last().unwrap().force.bone;
    assert!(stopped.depth < 16.5 * MM, "{}", stopped.depth);
    // The hand is led in steps of 0.02 mm there, 1 N each.
    assert!(bone > 8.9 && bone < 10.1, "{bone} N");
    go(&mut simulation, at(-2.0 * MM), 5.0 * MM, &mut records);
    let out = records.last().unwrap().force;
    assert!((out.axial - out.inertia).abs() < 1e-6);
    sound(&simulation, &records);
}
