//! Start screen, panels, help and debriefing beside the pictures of them in `tests/pictures`: colours, signs and places, which the texts
//! alone do not tell.
//!
//! What a machine, its adapter or the hour decides is made up here: forces, times, attempts, names of files.
#![cfg(feature = "window")]

use std::path::PathBuf;
use std::time::Duration;

use egui::{Color32, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use glam::DVec3;
use stylet::observables::{FrameRecord, TargetRecord};
use stylet::training::debrief::{Circumstances, Debrief};
use stylet::training::events::Watcher;
use stylet::training::history::History;
use stylet::training::texts::Better;
use stylet::training::{GoalResult, Row, Score, Trust, scripted_samples, trainees};
use stylet::window::debriefing::Debriefing;
use stylet::window::help::{self, Help};
use stylet::window::practice::Timing;
use stylet::window::settings::{Settings, Theme};
use stylet::window::start::StartScreen;
use stylet::window::theme;
use stylet::words::{self, say};

use crate::common;
use crate::debriefing::through_the_vessel;
use crate::layout::{AnyLanguage, bench, english, panels, set_up};
use crate::pixels::{Pixels, Textures, compare, compare_files};

/// A window in pixels, the size of its texts, and how much smaller its picture is kept.
#[derive(Clone, Copy)]
struct Window {
    name: &'static str,
    size: [usize; 2],
    text: f32,
    downsampling: usize,
}

const SMALL: Window = Window { name: "1024x640", size: [1024, 640], text: 1.5, downsampling: 1 };
const MIDDLE: Window = Window { name: "1280x800", size: [1280, 800], text: 1.0, downsampling: 1 };
const LARGE: Window = Window { name: "3840x2160", size: [3840, 2160], text: 1.5, downsampling: 4 };

/// Draws until nothing moves, does something, and looks.
fn picture<S>(
    window: Window,
    state: S,
    draw: impl FnMut(&mut egui::Ui, &mut S) + 'static,
    act: impl FnOnce(&mut Harness<'static, S>),
) -> Pixels {
    let textures = Textures::default();
    let points = window.size.map(|pixels| pixels as f32 / window.text);
    let builder = Harness::builder().with_size(points).with_pixels_per_point(window.text).renderer(textures.clone());
    let mut harness = set_up(builder, state, draw);
    act(&mut harness);
    harness.run_steps(4);
    Pixels::of(&harness, &textures, window.size).downsampled(window.downsampling)
}

/// Compares all before it fails: one run tells everything.
fn all_as_kept(pictures: &[(String, Pixels)]) {
    let wrong: Vec<String> = pictures.iter().filter_map(|(name, found)| compare(name, found).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// An attempt at a task that took so long [s].
fn attempt(task: &str, met: bool, time: f64) -> Score {
    let row = Row {
        key: "elapsed_time".into(),
        label: String::new(),
        unit: "s".into(),
        value: Some(time),
        reference: None,
        better: Better::Lower,
    };
    let goal = GoalResult {
        key: "avoid".into(),
        text: String::new(),
        unit: "mm".into(),
        measured: None,
        least: None,
        most: None,
        met: Some(met),
        weight: 1.0,
    };
    Score { scene: "s".into(), task: Some(task.into()), rows: vec![row], goals: vec![goal], trust: Trust::default() }
}

/// The start screen of somebody who has practised two tasks.
fn start(window: Window, theme: Theme, trainee: &str) -> Pixels {
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(folder.path());
    trainees::create(&history, trainee).unwrap();
    for (task, met, time) in
        [("core biopsy", false, 9.0), ("core biopsy", true, 14.5), ("hit a lesion at depth", false, 8.0)]
    {
        history.add(trainee, &attempt(task, met, time)).unwrap();
    }
    let settings = Settings {
        theme,
        trainee: Some(trainee.into()),
        recent: vec![PathBuf::from("/patients/liver/liver.nrrd")],
        ..Settings::default()
    };
    picture(
        window,
        (StartScreen::new(folder.path()), settings),
        |ui, (start, settings)| {
            theme::apply(ui.ctx(), settings);
            start.show(ui, settings);
        },
        |_| (),
    )
}

#[test]
fn the_start_screen_looks_as_it_is_kept() {
    let mut all = Vec::new();
    let english = english();
    for (window, theme, name) in
        [(SMALL, Theme::Dark, "dark"), (MIDDLE, Theme::Dark, "dark"), (MIDDLE, Theme::Light, "light")]
    {
        all.push((format!("start_{name}_{}", window.name), start(window, theme, "Ada")));
    }
    drop(english);
    let any = AnyLanguage::begin();
    assert!(words::choose("de"));
    all.push((format!("start_german_{}", SMALL.name), start(SMALL, Theme::Light, "Ada")));
    drop(any);
    all_as_kept(&all);
}

/// Frames of a made-up insertion to a depth [m]: no force outside, more and more to the puncture, then friction.
fn records(frames: usize, time_step: f64, deepest: f64, entry: DVec3, target: DVec3) -> Vec<FrameRecord> {
    let record = |n: usize| {
        let time = (n + 1) as f64 * time_step;
        let depth = (2e-3 * time).min(deepest);
        let axial = if depth < 2e-3 { 300.0 * depth } else { 0.25 + 50.0 * depth };
        let mut record = FrameRecord { frame: n as u64, time, depth, tip_coordinate: depth, ..Default::default() };
        (record.force.axial, record.force.friction) = (axial, 50.0 * depth);
        record.energy.external = 0.3 * depth;
        let from_tip = Some(target - entry + DVec3::Z * depth);
        record.targets = vec![TargetRecord { from_tip, ..Default::default() }];
        record
    };
    (0..frames).map(record).collect()
}

#[test]
fn the_panels_of_a_run_look_as_they_are_kept() {
    let Some(gpu) = common::gpu() else { return };
    let _english = english();
    let mut all = Vec::new();
    for window in [SMALL, MIDDLE, LARGE] {
        let mut bench = bench("scenes/training/hit_target.toml", &gpu);
        let practice = &mut bench.practice;
        practice.records = records(200, 1.0 / 60.0, 6e-3, DVec3::ZERO, DVec3::Z * -9e-3);
        practice.timing = Timing { simulated: 1.0 / 60.0, physics: 8e-3, between: 0.02, running: 5.0, done: 4.0 };
        (practice.latency, practice.speed_limit) = (Default::default(), 0.05);
        let found = picture(window, bench, panels, |harness| {
            // There is room for what an engineer looks at.
            for fold in ["engineer", "figures"].map(say).into_iter().filter(|_| window.downsampling > 1) {
                harness.get_by_label(fold).click();
                harness.run_steps(4);
            }
        });
        all.push((format!("run_{}", window.name), found));
    }
    all_as_kept(&all);
}

#[test]
fn the_keys_look_as_they_are_kept() {
    let _english = english();
    let draw = |ui: &mut egui::Ui, help: &mut Help| {
        help.show(ui.ctx(), &[help::RUN, help::NEEDLE, help::VIEW, help::START, help::EVERYWHERE]);
    };
    let all = [SMALL, MIDDLE]
        .map(|window| (format!("help_{}", window.name), picture(window, Help { open: true }, draw, |_| ())));
    all_as_kept(&all);
}

/// The debriefing of a made-up attempt straight through the vessel; the two before it took longer.
fn debriefing() -> Debriefing {
    let scene = through_the_vessel();
    let (entry, target) = (DVec3::new(1.5e-3, 0.0, 0.0), scene.targets[0].position);
    let mut records = records(300, 0.02, 10.5e-3, entry, target);
    for record in &mut records {
        // Behind the middle of the vessel the needle drifts aside: else its shaft is about as near from then on, and small differences
        // decide when it was nearest.
        let aside = DVec3::X * (0.02 * (record.depth - 5e-3).max(0.0));
        record.needle.tip_offset = aside;
        record.targets[0].from_tip = record.targets[0].from_tip.map(|way| way - aside);
    }
    let samples = scripted_samples(&scene, &records);
    let mut score = Score::of(&scene, &samples, &records, None).unwrap_or_else(|e| panic!("{e}"));
    // A trend shows what it has at full height, if that is the rounding of a zero.
    score.rows.iter_mut().for_each(|row| row.value = row.value.map(|value| (value * 1e6).round() / 1e6));
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(folder.path());
    for part in [1.5, 1.2, 1.0] {
        let mut before = score.clone();
        before.rows.iter_mut().for_each(|row| row.value = row.value.map(|value| value * part));
        history.add("ada", &before).unwrap_or_else(|e| panic!("{e}"));
    }
    let attempts = history.attempts("ada").unwrap_or_else(|e| panic!("{e}")).attempts;
    let mut watcher = Watcher::new(&scene);
    let about = Circumstances { wall: 14.2, attempts: &attempts, ..Default::default() };
    let debrief = Debrief::of(&scene, &mut watcher, (samples, &records), score, about);
    Debriefing::new(debrief, &scene, &watcher, true)
}

#[test]
fn the_debriefing_looks_as_it_is_kept() {
    let _english = english();
    let draw = |ui: &mut egui::Ui, debriefing: &mut Debriefing| _ = debriefing.show(ui);
    let ready = |harness: &mut Harness<'static, Debriefing>| {
        // The slice is found beside the window.
        let begin = std::time::Instant::now();
        while harness.state().moves() {
            assert!(begin.elapsed().as_secs() < 60, "the slice never came");
            std::thread::sleep(Duration::from_millis(10));
            harness.run_steps(1);
        }
    };
    let all = [SMALL, MIDDLE]
        .map(|window| (format!("debriefing_{}", window.name), picture(window, debriefing(), draw, ready)));
    all_as_kept(&all);
}

/// A panel with a word, a button and a sign.
#[derive(Clone, Copy)]
struct Sample {
    word: &'static str,
    button: Color32,
    sign: bool,
    left: f32,
}

const SAMPLE: Sample = Sample { word: "Depth 3.25 mm", button: Color32::from_rgb(60, 60, 60), sign: true, left: 0.0 };

fn sample(window: Window, sample: Sample) -> Pixels {
    let draw = |ui: &mut egui::Ui, sample: &mut Sample| {
        ui.horizontal(|ui| {
            ui.add_space(20.0 + sample.left);
            ui.label(sample.word);
            ui.add(egui::Button::new("Finish").fill(sample.button));
            let (rect, _) = ui.allocate_exact_size(vec2(10.0, 10.0), egui::Sense::hover());
            if sample.sign {
                ui.painter().circle_filled(rect.center(), 4.0, Color32::from_rgb(86, 180, 233));
            }
        });
    };
    picture(window, sample, draw, |_| ())
}

#[test]
fn a_small_change_is_found() {
    let _english = english();
    for window in [SMALL, MIDDLE, LARGE] {
        let before = sample(window, SAMPLE);
        assert!(before.different_pixels(&sample(window, SAMPLE)).is_empty(), "the same is drawn the same");
        for (what, changed) in [
            ("a digit", Sample { word: "Depth 3.26 mm", ..SAMPLE }),
            ("a word", Sample { word: "Force 3.25 mm", ..SAMPLE }),
            ("the colour of a button", Sample { button: Color32::from_rgb(60, 60, 90), ..SAMPLE }),
            ("no sign", Sample { sign: false, ..SAMPLE }),
            ("a pixel to the right", Sample { left: 1.0, ..SAMPLE }),
        ] {
            let after = sample(window, changed);
            println!("{}: {what}: {} pixels", window.name, before.different_pixels(&after).len());
            assert!(before.differs(&after), "{}: {what}", window.name);
        }
    }
    // On a real screen, by the comparison that the tests make.
    let folder = tempfile::tempdir().unwrap();
    let (kept, new) = (folder.path().join("start.png"), folder.path().join("new"));
    let before = start(MIDDLE, Theme::Dark, "Ada");
    before.write(&kept);
    assert_eq!(compare_files(&kept, &new, &before), Ok(()));
    assert!(!new.exists());
    let told = compare_files(&kept, &new, &start(MIDDLE, Theme::Dark, "Ida")).expect_err("another name");
    println!("{told}");
    assert!(told.contains("UPDATE_PICTURES=1 cargo test"), "{told}");
    assert!(new.join("start.png").exists() && new.join("start.difference.png").exists());
    assert!(compare_files(&folder.path().join("none.png"), &new, &before).is_err(), "a picture that is missing");
}

#[test]
fn triangles_fill_the_pixels_that_they_cover() {
    const RED: Color32 = Color32::from_rgb(200, 0, 0);
    let draw = |ui: &mut egui::Ui, _: &mut ()| {
        let place = |x: f32, y: f32| egui::pos2(x, y);
        // Two triangles, half as opaque, with a common edge that runs through centres of pixels.
        let half = RED.linear_multiply(0.5);
        let mut mesh = egui::Mesh::default();
        for corner in [place(10.0, 10.0), place(30.0, 10.0), place(30.0, 30.0), place(10.0, 30.0)] {
            mesh.colored_vertex(corner, half);
        }
        mesh.add_triangle(0, 1, 2);
        mesh.add_triangle(2, 3, 0);
        ui.painter().rect_filled(egui::Rect::EVERYTHING, 0.0, Color32::BLACK);
        ui.painter().add(mesh);
    };
    let window = Window { name: "", size: [64, 48], text: 1.0, downsampling: 1 };
    let found = picture(window, (), draw, |_| ());
    let half = RED.linear_multiply(0.5);
    for (n, pixel) in found.rgb.iter().enumerate() {
        let inside = |x: usize| (10..30).contains(&x);
        let expected = if inside(n % 64) && inside(n / 64) { [half.r(), half.g(), half.b()] } else { [0; 3] };
        assert_eq!(*pixel, expected, "column {}, row {}", n % 64, n / 64);
    }
}
