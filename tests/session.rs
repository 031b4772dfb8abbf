//! Recorded sessions: what a hand did is enough to compute the same forces again, bit for bit.

use crate::common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::*;
use glam::{DQuat, DVec3};
use stylet::needle::motion::HandPose;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::session::{SceneChange, Session, SessionFile};
use stylet::simulation::{Purpose, Simulation};

/// A small insertion.
const OVERRIDES: [&str; 3] =
    ["tissue.cell_size_mm=1.2", "tissue.size_mm=[14.0, 14.0, 10.0]", "motion.phase.0.depth_mm=6.0"];

fn scene() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/calibrated/muscle_biopsy.toml");
    Scene::load(&file, &OVERRIDES.map(String::from)).unwrap()
}

/// Depth that a nervous hand wants at the end of a frame [m].
fn wanted(frame: usize) -> f64 {
    let t = frame as f64 / 60.0;
    2.2e-3 * t + 0.15e-3 * (9.0 * t).sin() - if t > 1.6 { 1.5e-3 * (t - 1.6) } else { 0.0 }
}

/// Leads the needle over `frames` frames; the session and the records.
fn practised(frames: usize, ahead: usize) -> (Session, Vec<FrameRecord>) {
    let scene = scene();
    let purpose = Purpose { led: true, drawn: ahead == 0 && gpu().is_some(), lanes: false };
    let mut simulation = Simulation::for_purpose(scene.clone(), gpu(), purpose).unwrap();
    let mut session = Session::new(&scene, &OVERRIDES.map(String::from), simulation.engine().info());
    let mut records = Vec::new();
    for frame in 0..frames + ahead {
        if frame < frames {
            let now = simulation.hand().unwrap();
            session.poses.push(HandPose { depth: wanted(frame), ..now });
            simulation.lead(session.poses.last().unwrap());
            simulation.start_frames().unwrap();
        }
        if frame >= ahead {
            records.push(simulation.next_frame().unwrap().unwrap());
        }
    }
    assert!(simulation.next_frame().unwrap().is_none(), "a frame that nobody has led");
    (session, records)
}

fn bits(records: &[FrameRecord]) -> Vec<[u64; 4]> {
    let of = |r: &FrameRecord| [r.force.axial, r.force.friction, r.energy.elastic, r.depth].map(f64::to_bits);
    records.iter().map(of).collect()
}

struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        Place(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn replay(&self, session: &Path, out: &str) -> Output {
        Command::new(env!("CARGO_BIN_EXE_stylet"))
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .args(["replay".as_ref(), session.as_os_str(), "--out".as_ref(), self.path(out).as_os_str()])
            .output()
            .unwrap()
    }
}

/// Sliders and effects that were changed on the way are part of the session: the replay has them in the same frames.
#[test]
fn changes_are_replayed_in_their_frames() {
    let mut simulation =
        Simulation::for_purpose(scene(), gpu(), Purpose { led: true, drawn: gpu().is_some(), lanes: false }).unwrap();
    let overrides: Vec<String> = OVERRIDES.map(String::from).to_vec();
    let mut session = Session::new(&scene(), &overrides, simulation.engine().info());
    // Absolute, so that the replay finds it from everywhere.
    let steps = [
        (12, vec!["friction.coefficient=0.7"]),
        (25, vec!["friction.coefficient=0.7", "solver.mass_scaling=1500"]),
        (40, vec![r#"effects=["mass_scaling", "viscoelastic", "puncture", "friction"]"#, "solver.mass_scaling=1500"]),
        (55, vec![r#"effects=["mass_scaling", "puncture"]"#]),
    ];
    let mut records = Vec::new();
    for frame in 0..70 {
        if let Some((_, more)) = steps.iter().find(|(at, _)| *at == frame) {
            let all: Vec<String> = overrides.iter().cloned().chain(more.iter().map(|s| s.to_string())).collect();
            session.changes.push(stylet::session::SceneChange { frame: frame as u64, overrides: all });
            session.change(&mut simulation, frame as u64).unwrap();
        }
        let now = simulation.hand().unwrap();
        session.poses.push(stylet::needle::motion::HandPose { depth: wanted(frame), ..now });
        simulation.lead(session.poses.last().unwrap());
        records.push(simulation.next_frame().unwrap().unwrap());
    }
    let place = Place::new();
    let file = place.path("session.json");
    session.write(&file).unwrap();
    assert_eq!(Session::read(&file).unwrap(), session);
    let output = place.replay(&file, "again");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(place.path("again").join("force.csv")).unwrap();
    let forces: Vec<f64> = table.lines().skip(1).map(|row| row.split(',').nth(3).unwrap().parse().unwrap()).collect();
    assert_eq!(forces.len(), records.len());
    for (force, record) in forces.iter().zip(&records) {
        // The table has nine digits.
        assert!(
            (force - record.force.axial).abs() <= 1e-8 * record.force.axial.abs().max(1e-3),
            "{force} {}",
            record.force.axial
        );
    }
    let last = records.last().unwrap();
    assert_eq!(last.force.friction, 0.0, "friction was switched off");
    assert!(last.energy.imbalance().abs() < 0.05, "{}", last.energy.imbalance());
    // Changes out of order, or after the end, are no session.
    session.changes[0].frame = 99;
    session.write(&file).unwrap();
    assert!(Session::read(&file).is_err());
}

#[test]
fn a_hand_that_goes_as_the_script_does_feels_the_same() {
    let mut scene = scene();
    // As deep as a hand may go: both get the same mesh.
    scene.motion.phases = vec![stylet::needle::Phase::Insert { speed: 2e-3, depth: 8.5e-3 }];
    let mut scripted = Simulation::on(scene.clone(), gpu()).unwrap();
    let mut led = Simulation::for_purpose(scene, gpu(), Purpose { led: true, drawn: false, lanes: false }).unwrap();
    let mut frames = 0;
    while let Some(record) = scripted.next_frame().unwrap() {
        let pose = scripted.tool_pose(scripted.end_of(record.frame)).unwrap();
        let now = led.hand().unwrap();
        // The last frame of a script may be shorter.
        if record.frame + 1 == scripted.frame_count() {
            break;
        }
        led.lead(&HandPose { depth: pose.depth, ..now });
        let same = led.next_frame().unwrap().unwrap();
        assert_eq!((same.frame, same.step), (record.frame, record.step));
        at_most("depth", (same.depth - record.depth).abs(), 1e-12);
        // Poses differ in their last bits; the change of speed at the start is booked a frame later.
        let (felt, expected) = (same.force.axial - same.force.inertia, record.force.axial - record.force.inertia);
        at_most("force", (felt - expected).abs(), 1e-3);
        frames += 1;
    }
    assert!(frames > 100);
}

#[test]
fn a_session_gives_its_forces_again_bit_for_bit() {
    let (session, records) = practised(150, 0);
    let (_, again) = practised(150, 1);
    assert_eq!(bits(&records), bits(&again), "drawn and in step, or not drawn and a frame ahead");
    let largest = records.iter().map(|r| r.force.axial).fold(0.0, f64::max);
    assert!(largest > 0.3, "{largest}: the needle has not reached anything");
    assert!(records.last().unwrap().energy.imbalance().abs() < 0.02);
    let place = Place::new();
    let file = place.path("session.json");
    session.write(&file).unwrap();
    assert_eq!(Session::read(&file).unwrap(), session);
    for out in ["first", "second"] {
        let output = place.replay(&file, out);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(String::from_utf8_lossy(&output.stdout).contains("bit for bit"), "{output:?}");
    }
    let table = |out: &str| std::fs::read_to_string(place.path(out).join("force.csv")).unwrap();
    assert_eq!(table("first"), table("second"));
    // The table has nine digits.
    let header: Vec<String> = table("first").lines().next().unwrap().split(',').map(String::from).collect();
    let column = header.iter().position(|h| h == "axial_force_n").unwrap();
    for (row, record) in table("first").lines().skip(1).zip(&records) {
        let force: f64 = row.split(',').nth(column).unwrap().parse().unwrap();
        at_most("force", (force - record.force.axial).abs(), 1e-8);
    }
}

/// A small block with a free path: in, tilted about the point of entry while it goes on, out, to another entry, and in again.
const FREE: [&str; 3] = ["tissue.cell_size_mm=1.3", "tissue.size_mm=[14.0, 12.0, 10.0]", "solver.frame_rate_hz=30"];

fn free_scene() -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/free_hand/change_of_direction.toml");
    Scene::load(&file, &FREE.map(String::from)).unwrap()
}

/// What a hand wants after `now` in a frame, by phases of 12 frames of 1/30 s.
fn wanted_free(now: &HandPose, frame: usize) -> HandPose {
    let turned = |angle: f64| DQuat::from_rotation_y(angle) * DQuat::from_rotation_x(0.4 * angle) * now.direction;
    let way = 10e-3 / 30.0;
    match frame / 12 {
        0 => HandPose { depth: now.depth + way, ..*now },
        1 => HandPose { depth: now.depth + 0.3 * way, direction: turned(0.02).normalize(), ..*now },
        2 => HandPose { depth: now.depth - 2.0 * way, ..*now },
        3 => HandPose {
            entry: now.entry + DVec3::new(-0.25e-3, 0.1e-3, 0.0),
            direction: turned(-0.03).normalize(),
            ..*now
        },
        _ => HandPose { depth: now.depth + way, ..*now },
    }
}

/// Records of a run that these poses lead.
fn led_by(poses: impl Iterator<Item = HandPose>, device: Option<stylet::gpu::Gpu>) -> Vec<FrameRecord> {
    let mut simulation =
        Simulation::for_purpose(free_scene(), device, Purpose { led: true, drawn: false, lanes: false }).unwrap();
    let step = |pose| {
        simulation.lead(&pose);
        simulation.next_frame().unwrap().unwrap()
    };
    poses.map(step).collect()
}

#[test]
fn tilts_and_another_entry_come_again_bit_for_bit() {
    for device in [None, gpu()] {
        let (drawn, mut frames) = (device.is_some(), 0);
        let purpose = Purpose { led: true, drawn, lanes: false };
        let scene = free_scene();
        let mut simulation = Simulation::for_purpose(scene.clone(), device.clone(), purpose).unwrap();
        let mut session = Session::new(&scene, &FREE.map(String::from), simulation.engine().info());
        let mut records = Vec::new();
        while frames < 66 {
            let pose = wanted_free(&simulation.hand().unwrap(), frames);
            session.poses.push(pose);
            simulation.lead(&pose);
            records.push(simulation.next_frame().unwrap().unwrap());
            frames += 1;
        }
        let turned = session.poses.iter().map(|p| p.direction.angle_between(DVec3::NEG_Z)).fold(0.0, f64::max);
        let aside = records.iter().map(|r| r.force.lateral.length()).fold(0.0, f64::max);
        let axial = |from: usize, to: usize| records[from..to].iter().map(|r| r.force.axial).fold(0.0, f64::max);
        println!("drawn {drawn}: {turned:.2} rad, {aside:.3} N aside, {:.3} N, {:.3} N", axial(0, 24), axial(48, 66));
        assert!(turned > 0.2 && aside > 0.02, "{turned} rad, {aside} N");
        // The second way in is through new tissue, away from the planned motion.
        assert!(axial(0, 24) > 0.2 && axial(48, 66) > 0.2);
        assert!(records.last().unwrap().energy.imbalance().abs() < 0.05, "{:?}", records.last().unwrap().energy);
        let place = Place::new();
        let file = place.path("session.json");
        session.write(&file).unwrap();
        let again = led_by(Session::read(&file).unwrap().poses.into_iter(), device);
        assert_eq!(bits(&records), bits(&again));
        let lateral = |r: &FrameRecord| r.force.lateral.to_array().map(f64::to_bits);
        assert!(records.iter().map(lateral).eq(again.iter().map(lateral)));
    }
}

/// While a hand moves its file grows; what is cut off in the middle of a line costs that line.
#[test]
fn a_session_grows_line_by_line() {
    let scene = scene();
    let mut engine =
        Simulation::for_purpose(scene.clone(), None, Purpose { led: true, drawn: false, lanes: false }).unwrap();
    let mut session = Session::new(&scene, &OVERRIDES.map(String::from), engine.engine().info());
    let pose = engine.hand().unwrap();
    let place = Place::new();
    let path = place.path("session.json");
    let mut file = SessionFile::create(&path, &session).unwrap();
    for frame in 0..5u64 {
        if frame == 3 {
            let overrides = vec!["friction.coefficient=0.1".into()];
            session.changes.push(SceneChange { frame, overrides });
        }
        session.poses.push(HandPose { depth: 1e-3 * frame as f64 / 3.0, ..pose });
        file.append(&session).unwrap();
        assert_eq!(Session::read(&path).unwrap(), session);
    }
    let grown = std::fs::read(&path).unwrap();
    session.write(&path).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), grown, "written in one go or line by line");
    // Head, three poses, the change, two poses.
    let ends: Vec<usize> = (0..grown.len()).filter(|n| grown[*n] == b'\n').collect();
    assert_eq!(ends.len(), 7);
    let left = |bytes: &[u8]| Session::from_bytes(&path, bytes).map(|s| (s.poses.len(), s.changes.len()));
    for (lines, frames) in ends.iter().zip([(0, 0), (1, 0), (2, 0), (3, 0), (3, 1), (4, 1)]) {
        for part in [1, 2, 20] {
            assert_eq!(left(&grown[..lines + part]).unwrap(), frames);
        }
    }
    assert!(left(&grown[..ends[0] - 5]).is_err(), "without its head it is none");
    // Of the second format: one value.
    session.format = 2;
    assert_eq!(Session::from_bytes(&path, &serde_json::to_vec(&session).unwrap()).unwrap(), session);
}

#[test]
fn a_session_of_another_scene_is_refused() {
    let (mut session, _) = practised(3, 0);
    let place = Place::new();
    let refused = |session: &Session, what: &str| {
        let file = place.path("wrong.json");
        session.write(&file).unwrap();
        let output = place.replay(&file, "never");
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{told}");
        assert!(told.contains(what) && told.contains("way out"), "{told}");
        assert!(!place.path("never").exists());
    };
    session.poses[1].depth = 7.0;
    refused(&session, "frame 1");
    session.poses[1].depth = f64::NAN;
    refused(&session, "no session");
    session.poses[1].depth = 0.0;
    session.overrides[0] = "tissue.cell_size_mm=1.1".into();
    refused(&session, "has changed");
    session.format = 9;
    refused(&session, "format");
    std::fs::write(place.path("text.json"), "{ \"format\": 1").unwrap();
    assert_eq!(place.replay(&place.path("text.json"), "never").status.code(), Some(2));
    assert_eq!(place.replay(&place.path("nowhere.json"), "never").status.code(), Some(2));
}
