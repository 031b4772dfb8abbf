//! The lesson beside the view, the debriefing behind an attempt, and the attempt seen again; without a window.
#![cfg(feature = "window")]

use std::path::Path;
use std::time::Duration;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use stylet::scene::Scene;
use stylet::simulation::{EngineChoice, Simulation};
use stylet::training::debrief::{Circumstances, Debrief};
use stylet::training::events::Watcher;
use stylet::training::history::History;
use stylet::training::score::Score;
use stylet::training::scripted_samples;
use stylet::window::debriefing::{Answer, Debriefing};
use stylet::window::hand::{Desk, InputDevice, Key, Recording};
use stylet::window::lesson::Lesson;
use stylet::window::practice::{Leader, Practice, Renewed, State};
use stylet::window::source::Source;
use stylet::words::say;

use crate::common;
use crate::layout::{MARGIN, WITH_MARGIN, english, everywhere, wrong};

const COARSE: [&str; 2] = ["tissue.cell_size_mm=1.3", "tissue.size_mm=[14, 14, 12]"];

fn by_hand() -> Option<Practice> {
    let gpu = common::gpu()?;
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/hit_target.toml");
    let (source, scene) = Source::read(path, COARSE.map(String::from).to_vec()).unwrap_or_else(|e| panic!("{e}"));
    Some(Practice::new(scene, source, gpu, Leader::Hand, None, false).unwrap_or_else(|e| panic!("{e}")))
}

fn frame(practice: &mut Practice, hand: &mut dyn InputDevice) {
    practice.start(hand).unwrap_or_else(|e| panic!("{e}"));
    practice.finish(hand).unwrap_or_else(|e| panic!("{e}"));
}

/// An attempt by hand is computed again, gone back in and computed from there: every number of every frame is that of the attempt.
/// Begins anew, and waits until that is ready.
fn again(practice: &mut Practice, leader: Leader) {
    practice.again(leader);
    while practice.take_changes().unwrap_or_else(|e| panic!("{e}")) != Renewed::Attempt {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}

#[test]
fn an_attempt_is_seen_again_bit_for_bit() {
    let Some(mut practice) = by_hand() else { return };
    let mut desk = Desk::new(4e-3);
    desk.hold(Key::Advance, true);
    practice.state = State::Running;
    for n in 0..150 {
        if n == 90 {
            desk.hold(Key::Advance, false);
            desk.ask(-0.7e-3);
        }
        frame(&mut practice, &mut desk);
    }
    assert!(practice.may_see_again());
    let attempt = practice.records.clone();
    let samples = practice.samples();
    assert!(attempt.iter().any(|r| r.force.axial > 0.05), "the tissue was felt");
    practice.see_again().unwrap_or_else(|e| panic!("{e}"));
    assert!(practice.is_replay() && practice.records.is_empty());
    assert_eq!(practice.replay_frames(), attempt.len());
    // Straight to a moment: what lies before it is computed.
    let to = |practice: &mut Practice, time: f64| {
        practice.go_to(time).unwrap_or_else(|e| panic!("{e}"));
        while practice.is_heading() {
            practice.catch_up(Duration::from_millis(20)).unwrap_or_else(|e| panic!("{e}"));
        }
    };
    to(&mut practice, 1.2);
    let there = practice.records.len();
    assert!(practice.records.last().is_some_and(|r| r.time <= 1.2 + 1e-9 && r.time > 1.15), "{there} frames");
    assert_eq!(practice.records, attempt[..there]);
    // Back, at once: no more than half a second lies between two moments that are kept.
    practice.go_back(0.9).unwrap_or_else(|e| panic!("{e}"));
    assert!(practice.records.last().is_some_and(|r| r.time <= 0.9 && r.time > 0.35), "{:?}", practice.records.len());
    to(&mut practice, 0.9);
    assert_eq!(practice.records, attempt[..practice.records.len()]);
    // Another hand leads nothing; the attempt goes on to its end, and there it is.
    let mut other = Desk::new(4e-3);
    other.hold(Key::Withdraw, true);
    practice.state = State::Running;
    while practice.state == State::Running {
        frame(&mut practice, &mut other);
    }
    assert_eq!(practice.state, State::Ended);
    assert_eq!(practice.records, attempt);
    assert_eq!(practice.samples(), samples);
    // It can be seen once more, and the next attempt is one by hand again.
    to(&mut practice, 0.2);
    assert_eq!(practice.records, attempt[..practice.records.len()]);
    again(&mut practice, Leader::Hand);
    assert!(!practice.is_replay() && practice.records.is_empty());
    // A script is no attempt by hand.
    again(&mut practice, Leader::Script);
    practice.state = State::Running;
    frame(&mut practice, &mut Recording::new(Vec::new()));
    assert!(practice.see_again().is_err());
}

/// A debriefing of a real run through the vessel, with two attempts before it.
fn debriefing(scene: &Scene) -> Debriefing {
    let mut simulation = Simulation::new(scene.clone(), EngineChoice::Cpu).unwrap_or_else(|e| panic!("{e}"));
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{e}")) {
        records.push(record);
    }
    let samples = scripted_samples(scene, &records);
    let score = Score::of(scene, &samples, &records, None).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(folder.path());
    for _ in 0..3 {
        history.add("ada", &score).unwrap_or_else(|e| panic!("{e}"));
    }
    let attempts = history.attempts("ada").unwrap_or_else(|e| panic!("{e}")).attempts;
    let mut watcher = Watcher::new(scene);
    let about = Circumstances { wall: 14.2, attempts: &attempts, ..Default::default() };
    let debrief = Debrief::of(scene, &mut watcher, (samples, &records), score, about);
    assert!(debrief.figures.iter().all(|f| f.trend.len() == 3), "{:?}", debrief.figures);
    Debriefing::new(debrief, scene, &watcher, true)
}

pub fn through_the_vessel() -> Scene {
    let overrides = [
        "tissue.cell_size_mm=1.4",
        "tissue.growth=1.8",
        "motion.entry_mm=[1.5, 0.0]",
        "motion.angle_deg=0.0",
        "outputs.pictures_at_depth_mm=[]",
    ];
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/avoid_vessel.toml");
    Scene::load(&path, &overrides.map(String::from)).unwrap_or_else(|e| panic!("{e}"))
}

/// Where the way to the next task lies in a window of 1280 x 800 [points]; texts are English.
pub fn place_of_next_task() -> egui::Pos2 {
    let harness = harness(debriefing(&through_the_vessel()), WITH_MARGIN);
    let place = harness.get_by_label(say("debrief-next")).rect().center();
    place - egui::vec2(MARGIN, MARGIN)
}

struct Shown {
    debriefing: Debriefing,
    answer: Option<Answer>,
}

fn harness(debriefing: Debriefing, size: [f32; 2]) -> Harness<'static, Shown> {
    Harness::builder().with_size(size).build_ui_state(
        |ui, shown: &mut Shown| {
            if let Some(answer) = shown.debriefing.show(ui) {
                shown.answer = Some(answer);
            }
        },
        Shown { debriefing, answer: None },
    )
}

#[test]
fn a_debriefing_fits_its_window_in_every_language() {
    let mut debriefing = Some(debriefing(&through_the_vessel()));
    everywhere(|size, place| {
        let mut harness = harness(debriefing.take().expect("the one of before"), size);
        harness.run_steps(4);
        let found = wrong(&harness.output().shapes, &[]);
        assert!(found.is_empty(), "{place}: {found:#?}");
        // All figures, too.
        let fold = stylet::words::say("debrief-all-figures");
        harness.get_by_label(fold).click();
        harness.run_steps(12);
        harness.get_by_label(fold).scroll_to_me();
        harness.run_steps(12);
        let found = wrong(&harness.output().shapes, &[]);
        assert!(found.is_empty(), "{place}, all figures: {found:#?}");
        debriefing = Some(harness.into_state().debriefing);
    });
}

#[test]
fn a_debriefing_says_its_verdict_first_and_goes_where_it_is_asked() {
    let _english = english();
    let mut harness = harness(debriefing(&through_the_vessel()), [1280.0, 800.0]);
    harness.run_steps(4);
    let verdict = harness.get_by_label_contains("Not passed").rect();
    let touched = harness.get_by_label_contains("The needle touched vessel.").rect();
    assert!(verdict.bottom() <= touched.top(), "the verdict stands above the reasons");
    let end = harness.state().debriefing.debrief().simulated;
    assert!((harness.state().debriefing.time() - end).abs() < 1e-9);
    // A button for each goal, in the order of the task; the second is the vessel, which was met on the way.
    let moment = harness.state().debriefing.debrief().findings[1].moment.expect("a moment");
    harness.get_all_by_label_contains("show ").nth(1).expect("a button").click();
    harness.run_steps(3);
    assert_eq!(harness.state().debriefing.time(), moment);
    harness.get_by_label("Play").click();
    harness.run_steps(3);
    assert!(harness.state().debriefing.time() > moment, "time goes on");
    harness.get_by_label("Pause").click();
    harness.run_steps(2);
    for (text, answer) in
        [("Try again", Answer::Again), ("Next task", Answer::NextTask), ("Start screen", Answer::Start)]
    {
        harness.get_by_label(text).click();
        harness.run_steps(2);
        assert_eq!(harness.state().answer, Some(answer), "{text}");
    }
    harness.get_by_label("See it again in the tissue").click();
    harness.run_steps(2);
    let time = harness.state().debriefing.time();
    assert_eq!(harness.state().answer, Some(Answer::InTissue(time)));
}

/// The lesson of an attempt under way, in a panel as wide as the window gives it.
#[test]
fn the_lesson_fits_its_panel_and_follows_the_attempt() {
    let Some(mut practice) = by_hand() else { return };
    let mut lesson = Lesson::new(&practice);
    let mut desk = Desk::new(4e-3);
    desk.hold(Key::Advance, true);
    practice.state = State::Running;
    for _ in 0..100 {
        frame(&mut practice, &mut desk);
        lesson.tend(&practice);
    }
    assert!(!lesson.events().is_empty(), "the skin was pierced");
    let mut lesson = Some(lesson);
    everywhere(|[width, height], place| {
        let [_, right] = stylet::window::panels::widths(width);
        let mut harness = Harness::builder().with_size([width, height]).build_ui_state(
            move |ui, lesson: &mut Lesson| {
                egui::Panel::right("readings").exact_size(right).show(ui, |ui| {
                    egui::ScrollArea::vertical().show(ui, |ui| lesson.panel(ui, &mut true, &mut false));
                });
                egui::Panel::top("strip").show(ui, |ui| lesson.strip(ui));
            },
            lesson.take().expect("the one of before"),
        );
        harness.run_steps(4);
        let found = wrong(&harness.output().shapes, &[]);
        assert!(found.is_empty(), "{place}: {found:#?}");
        lesson = Some(harness.into_state());
    });
    // The same attempt from its beginning: what happened is gone.
    let mut lesson = lesson.expect("the last one");
    again(&mut practice, Leader::Hand);
    lesson.tend(&practice);
    assert!(lesson.events().is_empty());
}
