//! Every task of the repository: the reference attempt passes, and what a trainee can decide wrongly fails the goal that is about it.

use std::path::Path;

use glam::{DQuat, DVec3};
use stylet::HandPose;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::simulation::reach::{Reach, speed_limit};
use stylet::simulation::{Purpose, Simulation};
use stylet::training::kinematic::Sample;
use stylet::training::score::Score;

const MM: f64 = 1e-3;

/// One attempt: where the tip goes, one way after the other, each from outside along a line to a depth behind the skin.
struct Attempt {
    what: &'static str,
    ways: Vec<(DVec3, DVec3, f64)>,
    /// How many times slower than the scene the needle goes.
    slower: f64,
    /// Key of the goal that it fails, and, for goals on figures, words of its text; none: it passes.
    fails: Option<(&'static str, &'static str)>,
}

fn scene(name: &str, cell: f64) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("scenes/{name}.toml"));
    let overrides = [format!("tissue.cell_size_mm={cell}"), "outputs.pictures_at_depth_mm=[]".to_string()];
    Scene::load(&path, &overrides).unwrap_or_else(|error| panic!("{error}"))
}

/// Leads the needle through an attempt at the speed of the scene.
fn score(scene: &Scene, attempt: &Attempt) -> Score {
    let purpose = Purpose { led: true, drawn: false, lanes: true };
    let mut simulation = Simulation::for_purpose(scene.clone(), None, purpose).unwrap_or_else(|e| panic!("{e}"));
    let mut records: Vec<FrameRecord> = Vec::new();
    let mut samples: Vec<Sample> = Vec::new();
    let speed = scene.motion.largest_speed() / attempt.slower;
    let frame = simulation.steps_per_frame() as f64 * simulation.dt();
    let limit = speed_limit(&simulation.model);
    let mut go = |simulation: &mut Simulation, to: HandPose, speed: f64| {
        for _ in 0..4000 {
            let now = simulation.hand().unwrap();
            let way = to.depth - now.depth;
            let wanted = HandPose { depth: now.depth + way.clamp(-speed * frame, speed * frame), ..to };
            let pose = Reach::of(&simulation.model, limit).within(&now, &wanted, frame).0;
            simulation.lead(&pose);
            while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{}: {e}", attempt.what)) {
                let pose = simulation.tool_pose(record.time).unwrap();
                let tip = pose.tip - pose.direction * record.needle.retreat;
                samples.push(Sample { time: record.time, tip, direction: pose.direction });
                records.push(record);
            }
            // At its end, or where bone holds it.
            let next = simulation.hand().unwrap();
            if (next.depth - now.depth).abs() < 1e-9
                && (next.entry - now.entry).length() < 1e-9
                && next.direction == now.direction
            {
                break;
            }
        }
    };
    for (n, (entry, direction, depth)) in attempt.ways.iter().enumerate() {
        let skin = simulation.model.skin_at(*entry).map_or(*entry, |z| DVec3 { z, ..*entry });
        let at = |depth: f64| HandPose { entry: skin, direction: *direction, depth };
        let here = simulation.hand().unwrap();
        go(&mut simulation, HandPose { depth: -2.0 * MM, ..here }, speed);
        go(&mut simulation, at(-2.0 * MM), 4.0 * speed);
        go(&mut simulation, at(*depth), speed);
        if n + 1 < attempt.ways.len() {
            go(&mut simulation, at(-2.0 * MM), speed);
        }
    }
    Score::of(scene, &samples, &records, None).unwrap_or_else(|e| panic!("{e}"))
}

#[track_caller]
fn judged(scene: &Scene, attempts: Vec<Attempt>) {
    for attempt in attempts {
        let score = score(scene, &attempt);
        let goals: Vec<String> =
            score.goals.iter().map(|g| format!("{} {:?} {:?}", g.text, g.measured, g.met)).collect();
        println!("{}: {}: {goals:?}", scene.name, attempt.what);
        assert!(score.trust.is_good(), "{}: {}: {:?}", scene.name, attempt.what, score.trust.reasons);
        match attempt.fails {
            None => {
                assert_eq!(score.passed(), Some(true), "{}: {}: {goals:?}", scene.name, attempt.what);
                assert_eq!(score.share(), Some(1.0));
                // Every task has a limit of the force that its own way keeps, with a quarter of it to spare and of some use.
                let force = score.goals.iter().find(|g| g.key == "force_limit").expect("a limit of the force");
                let (peak, limit) = (force.measured.expect("a force"), force.most.expect("a limit"));
                assert!(peak < 0.75 * limit && limit < 5.0, "{}: {peak} N, limit {limit} N", scene.name);
            }
            Some((key, words)) => {
                assert_eq!(score.passed(), Some(false), "{}: {}: {goals:?}", scene.name, attempt.what);
                let failed = score.goals.iter().any(|g| g.key == key && g.met == Some(false) && g.text.contains(words));
                assert!(score.share().is_some_and(|share| share < 1.0));
                assert!(failed, "{}: {}: not for {key} {words}: {goals:?}", scene.name, attempt.what);
            }
        }
    }
}

/// The way of the scene's own motion, to another depth [mm].
fn planned(scene: &Scene, depth: f64) -> (DVec3, DVec3, f64) {
    (scene.motion.entry, scene.motion.direction, depth * MM)
}

/// From the planned entry, tilted by an angle about an axis.
fn tilted(scene: &Scene, axis: DVec3, degrees: f64, depth: f64) -> (DVec3, DVec3, f64) {
    (scene.motion.entry, DQuat::from_axis_angle(axis, degrees.to_radians()) * scene.motion.direction, depth * MM)
}

/// From the planned entry to the point of a region that lies next to the planned line, and 1.5 mm on.
fn into_region(scene: &Scene, name: &str) -> (DVec3, DVec3, f64) {
    let index = scene.regions.iter().position(|r| r.name == name).expect("a region of that name");
    let (entry, along) = (scene.motion.entry, scene.motion.direction);
    let half = scene.tissue.size * 0.5;
    let step = 0.5 * MM;
    let counts = ((scene.tissue.size / step).floor() - 8.0).to_array().map(|n| n as usize);
    let mut nearest = (f64::INFINITY, DVec3::ZERO);
    for k in 4..counts[2] {
        for j in 4..counts[1] {
            for i in 4..counts[0] {
                let x = DVec3::new(i as f64 * step - half.x, j as f64 * step - half.y, -(k as f64) * step);
                let way = x - entry;
                let aside = (way - along * way.dot(along)).length();
                if aside < nearest.0 && way.dot(along) > 4.0 * MM && scene.region_at(x) == Some(index) {
                    nearest = (aside, x);
                }
            }
        }
    }
    let way = nearest.1 - entry;
    (entry, way.normalize(), way.length() + 1.5 * MM)
}

fn passes(what: &'static str, ways: Vec<(DVec3, DVec3, f64)>) -> Attempt {
    Attempt { what, ways, slower: 1.0, fails: None }
}

fn fails(what: &'static str, key: &'static str, words: &'static str, ways: Vec<(DVec3, DVec3, f64)>) -> Attempt {
    Attempt { what, ways, slower: 1.0, fails: Some((key, words)) }
}

#[test]
fn a_lesion_is_missed_by_depth_by_angle_and_by_trying_too_often() {
    let scene = scene("training/hit_target", 0.9);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 9.3)]),
            fails("overshoot", "hit_target", "", vec![planned(&scene, 12.0)]),
            fails("wrong angle", "hit_target", "", vec![tilted(&scene, DVec3::Y, 20.0, 9.3)]),
            fails(
                "too many passes",
                "figure",
                "Passes",
                vec![planned(&scene, 2.8), planned(&scene, 2.8), planned(&scene, 9.3)],
            ),
        ],
    );
}

#[test]
fn a_vessel_is_hit_from_straight_above() {
    let scene = scene("training/avoid_vessel", 0.9);
    let straight = (DVec3::ZERO, DVec3::NEG_Z, 9.7 * MM);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 10.2)]),
            fails("straight down", "avoid", "vessel", vec![straight]),
            fails("overshoot", "hit_target", "", vec![planned(&scene, 13.0)]),
        ],
    );
}

#[test]
fn a_layer_is_run_through_or_holed_twice() {
    let scene = scene("training/thin_layer_stop", 0.8);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, scene.motion.deepest() / MM)]),
            fails("run on", "stop_in_layer", "", vec![planned(&scene, 9.5)]),
            fails(
                "two holes",
                "figure",
                "Passes",
                vec![planned(&scene, 3.0), planned(&scene, scene.motion.deepest() / MM)],
            ),
        ],
    );
}

#[test]
fn an_oblique_approach_fails_by_angle_and_by_depth() {
    let scene = scene("training/lumbar_oblique", 0.9);
    let upright = (scene.motion.entry, DVec3::NEG_Z, 9.0 * MM);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, scene.motion.deepest() / MM)]),
            fails("upright", "figure", "angle", vec![upright]),
            fails("too deep", "stop_in_layer", "", vec![planned(&scene, 12.5)]),
        ],
    );
}

#[test]
fn a_core_is_too_small_or_takes_too_long() {
    let scene = scene("training/core_biopsy", 0.7);
    judged(
        &scene,
        vec![
            fails("too short", "core", "", vec![planned(&scene, 5.5)]),
            Attempt { slower: 8.0, ..fails("too slow", "time_limit", "", vec![planned(&scene, 8.0)]) },
        ],
    );
}

#[test]
fn a_vein_of_the_neck_is_missed_for_the_carotid_artery() {
    let scene = scene("anatomy/neck_vein", 1.0);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 17.4)]),
            fails("into the carotid artery", "avoid", "carotid", vec![into_region(&scene, "carotid artery")]),
            fails("through the vein", "hit_target", "", vec![planned(&scene, 23.0)]),
        ],
    );
}

#[test]
fn a_vein_of_the_forearm_is_missed_for_an_artery_and_by_depth() {
    let scene = scene("anatomy/forearm_vein", 0.9);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 7.3)]),
            fails("into an artery", "avoid", "arter", vec![into_region(&scene, "arteries")]),
            fails("through the vein", "hit_target", "", vec![planned(&scene, 11.0)]),
        ],
    );
}

#[test]
fn a_lumbar_puncture_meets_bone_or_stops_before_the_dura() {
    let scene = scene("anatomy/lumbar_puncture", 1.0);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 54.0)]),
            fails("onto bone", "avoid", "vertebrae", vec![into_region(&scene, "vertebrae")]),
            fails("pressed onto bone", "force_limit", "", vec![into_region(&scene, "vertebrae")]),
            fails("before the ligament", "stop_in_layer", "", vec![planned(&scene, 30.0)]),
        ],
    );
}

#[test]
fn a_lesion_of_the_liver_is_missed_for_a_vein_or_a_rib() {
    let scene = scene("anatomy/liver_lesion", 1.0);
    judged(
        &scene,
        vec![
            passes("as planned", vec![planned(&scene, 42.4)]),
            fails("through the hepatic vein", "avoid", "hepatic vein", vec![into_region(&scene, "hepatic vein")]),
            fails("onto a rib", "avoid", "ribs", vec![into_region(&scene, "ribs")]),
        ],
    );
}
