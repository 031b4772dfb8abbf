//! An attempt without a window: what the buttons ask of it.
#![cfg(feature = "window")]

use std::path::Path;

use stylet::window::hand::Recording;
use stylet::window::practice::{Leader, Practice, State};
use stylet::window::tuning::Source;

#[path = "common/mod.rs"]
mod common;

fn script() -> Option<Practice> {
    let gpu = common::gpu()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let coarse = ["tissue.cell_size_mm=1.3", "tissue.size_mm=[14, 14, 12]"].map(String::from).to_vec();
    let (source, scene) = Source::read(path, coarse).unwrap_or_else(|e| panic!("{e}"));
    Some(Practice::new(scene, source, gpu, Leader::Script, None, false).unwrap_or_else(|e| panic!("{e}")))
}

fn run(practice: &mut Practice, frames: usize) {
    let mut nobody = Recording::new(Vec::new());
    practice.state = State::Running;
    while practice.records.len() < frames {
        practice.start(&mut nobody).unwrap_or_else(|e| panic!("{e}"));
        practice.finish(&mut nobody).unwrap_or_else(|e| panic!("{e}"));
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
