//! An attempt without a window: what the buttons ask of it.
#![cfg(feature = "window")]

use std::path::Path;

use stylet::needle::motion::HandPose;
use stylet::window::hand::{Desk, InputDevice, Key, Recording};
use stylet::window::practice::{Leader, Practice, State};
use stylet::window::source::Source;

use crate::common;

fn script() -> Option<Practice> {
    led_by(Leader::Script)
}

fn led_by(leader: Leader) -> Option<Practice> {
    let gpu = common::gpu()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let coarse = ["tissue.cell_size_mm=1.3", "tissue.size_mm=[14, 14, 12]"].map(String::from).to_vec();
    let (source, scene) = Source::read(path, coarse).unwrap_or_else(|e| panic!("{e}"));
    Some(Practice::new(scene, source, gpu, leader, None, false).unwrap_or_else(|e| panic!("{e}")))
}

fn run(practice: &mut Practice, frames: usize) {
    run_by(practice, &mut Recording::new(Vec::new()), frames);
}

fn run_by(practice: &mut Practice, hand: &mut dyn InputDevice, frames: usize) {
    practice.state = State::Running;
    while practice.records.len() < frames {
        practice.start(hand).unwrap_or_else(|e| panic!("{e}"));
        practice.finish(hand).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(practice.state, State::Running);
    }
}

/// Back to a moment of the script: the way from there is the same again.
#[test]
fn a_script_goes_back_and_comes_again() {
    let Some(mut practice) = script() else { return };
    assert!(!practice.may_go_back(), "nothing has happened yet");
    run(&mut practice, 100);
    let first = practice.records.clone();
    practice.go_back(1.1).unwrap_or_else(|e| panic!("{e}"));
    let back = practice.records.len();
    assert!((31..=66).contains(&back), "{back} frames are left");
    assert!(practice.records.last().is_some_and(|r| r.time <= 1.1));
    run(&mut practice, 100);
    assert_eq!(practice.records, first);
    // Before the first mark there is nothing to go back to.
    practice.go_back(-1.0).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(practice.records.len(), 100);
}

/// Whoever holds the key as the attempt begins, or throws the needle: the first frame is a single step, and no blow.
#[test]
fn a_key_held_from_the_start_creates_no_energy() {
    for thrown in [false, true] {
        let Some(mut practice) = led_by(Leader::Hand) else { return };
        let mut desk = Desk::new(2e-3);
        desk.hold(Key::Advance, true);
        let mut far = Thrown;
        let hand: &mut dyn InputDevice = if thrown { &mut far } else { &mut desk };
        run_by(&mut practice, hand, 12);
        assert!(practice.records[0].depth < practice.records[1].depth);
        for record in &practice.records[1..] {
            let energy = &record.energy;
            let created = energy.accounted() - energy.external;
            assert!(energy.external > 0.0, "nothing was touched");
            assert!(
                created < 0.25 * energy.external,
                "thrown {thrown}, frame {}: {created} of {}",
                record.frame,
                energy.external
            );
        }
    }
}

/// A device that asks for the bottom at once.
struct Thrown;

impl InputDevice for Thrown {
    fn name(&self) -> &str {
        "thrown"
    }

    fn pose(&mut self, now: &HandPose, _duration: f64) -> HandPose {
        HandPose { depth: 8e-3, ..*now }
    }
}

/// A folder without room: the run waits and says why, nothing in memory is lost, and with room again everything is written.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_costs_nothing() {
    let Some(gpu) = common::gpu() else { return };
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let coarse = ["tissue.cell_size_mm=1.3", "tissue.size_mm=[14, 14, 12]"].map(String::from).to_vec();
    let (source, scene) = Source::read(path, coarse).unwrap_or_else(|e| panic!("{e}"));
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("attempt");
    let mut practice =
        Practice::new(scene, source, gpu, Leader::Script, Some(&out), false).unwrap_or_else(|e| panic!("{e}"));
    run(&mut practice, 10);
    // A disk that is always full stands in for the table.
    let whole = out.join("force.csv");
    practice.hold_back(stylet::Error::file(&whole, std::io::Error::from_raw_os_error(28)));
    assert_eq!(practice.state, State::Paused, "the user is asked");
    assert!(practice.unwritten.as_deref().is_some_and(|text| text.contains("way out")), "{:?}", practice.unwritten);
    run(&mut practice, 25);
    let rows = || std::fs::read_to_string(&whole).unwrap().lines().count() - 1;
    assert_eq!(rows(), 10, "nothing more was tried");
    let score = practice.debrief(None).unwrap_or_else(|e| panic!("{e}"));
    assert!(!score.goals.is_empty());
    practice.write_again().unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((rows(), practice.unwritten.is_none()), (25, true));
    run(&mut practice, 26);
    assert_eq!(rows(), 26);
}
