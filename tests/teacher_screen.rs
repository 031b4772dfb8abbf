//! The teacher's screen without a window: pages, files that it writes, what is told.
#![cfg(feature = "window")]

use std::fs;
use std::path::Path;

use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use stylet::scene::Scene;
use stylet::training::history::History;
use stylet::training::score::{Row, Score};
use stylet::training::texts::Better;
use stylet::training::{Trust, notes, task::GoalResult};
use stylet::window::screens::Next;
use stylet::window::teacher::{Page, Teacher};
use stylet::words::say;

use crate::layout::{english, everywhere, in_a_window, wrong};

struct Screen {
    teacher: Teacher,
    next: Option<Next>,
}

fn score(passes: f64, met: bool) -> Score {
    let row = |key: &str, value: f64| Row {
        key: key.into(),
        label: key.into(),
        unit: "mm".into(),
        value: Some(value),
        reference: None,
        better: Better::Lower,
    };
    let goal = GoalResult {
        key: "avoid".into(),
        text: "keep off".into(),
        unit: "mm".into(),
        measured: Some(1.0),
        least: None,
        most: Some(2.0),
        met: Some(met),
        weight: 1.0,
    };
    Score {
        scene: "made_up".into(),
        task: Some("hit it".into()),
        rows: vec![row("passes", passes), row("overshoot", 0.5), row("elapsed_time", 10.0)],
        goals: vec![goal],
        trust: Trust::default(),
    }
}

fn school() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    let history = History::new(place.path());
    for (passes, met) in [(3.0, false), (2.0, false), (1.0, true)] {
        history.add("Ada", &score(passes, met)).unwrap();
    }
    history.add("Bob", &score(2.0, true)).unwrap();
    place
}

fn harness(root: &Path, page: Page, size: [f32; 2], text: f32) -> Harness<'static, Screen> {
    let mut teacher = Teacher::new(root);
    teacher.turn_to(page);
    let mut harness = Harness::builder().with_size(size).build_ui_state(
        move |ui, screen: &mut Screen| {
            // Larger text, as the settings make it.
            ui.style_mut().text_styles.values_mut().for_each(|font| font.size *= text);
            let next = screen.teacher.show(ui);
            screen.next = screen.next.take().or(next);
        },
        Screen { teacher, next: None },
    );
    harness.run_steps(3);
    harness
}

#[test]
fn the_class_is_shown_and_written() {
    let _english = english();
    let place = school();
    for text in [1.0, 1.5] {
        let mut harness = harness(place.path(), Page::Class, [1024.0, 640.0], text);
        for label in ["Ada", "Bob", "Trainee", "1/1"] {
            assert!(harness.query_all_by_label(label).count() > 0, "{label} is not shown");
        }
        // A trend of three attempts, in words.
        assert!(harness.query_by_label_contains("getting better").is_some());
        harness.get_by_label("Table (CSV)").click();
        harness.run_steps(3);
        assert!(fs::read_to_string(place.path().join("class.csv")).unwrap().contains("Ada,hit it,made_up,3,3,1,1,1,1"));
        harness.get_by_label("Statements (xAPI)").click();
        harness.run_steps(3);
        assert!(fs::read_to_string(place.path().join("class_xapi.json")).unwrap().contains("verbs/passed"));
        assert!(harness.query_by_label_contains("Written: ").is_some());
        // A page is that of somebody.
        harness.get_all_by_label("hit it").next().unwrap().click();
        harness.run_steps(3);
        harness.get_by_label("Page to print (HTML)").click();
        harness.run_steps(3);
        let page = fs::read_dir(place.path())
            .unwrap()
            .map(|e| e.unwrap().path())
            .find(|p| p.extension().is_some_and(|e| e == "html"));
        assert!(fs::read_to_string(page.expect("a page")).unwrap().contains("Progress of Ada"));
        harness.get_by_label("Start screen").click();
        harness.run_steps(2);
        assert_eq!(harness.state().next, Some(Next::Start));
    }
}

#[test]
fn an_empty_history_and_a_broken_file_are_told() {
    let _english = english();
    let place = tempfile::tempdir().unwrap();
    let none = harness(&place.path().join("none"), Page::Class, [1024.0, 640.0], 1.0);
    assert!(none.query_by_label_contains("There are no attempts in").is_some());
    fs::create_dir(place.path().join("x")).unwrap();
    fs::write(place.path().join("x/y_1.json"), "{").unwrap();
    let broken = harness(place.path(), Page::Class, [1024.0, 640.0], 1.0);
    assert!(broken.query_by_label_contains("y_1.json").is_some());
}

#[test]
fn two_attempts_stand_side_by_side() {
    let _english = english();
    let place = school();
    let mut harness = harness(place.path(), Page::Comparison, [1280.0, 800.0], 1.0);
    assert!(harness.query_by_label("Choose two attempts.").is_some());
    for (list, attempt) in [("First attempt", "Ada, attempt 1"), ("Second attempt", "Ada, attempt 3")] {
        harness.get_all_by_label(list).last().unwrap().click();
        harness.run_steps(4);
        harness.get_all_by_label_contains(attempt).last().unwrap().click();
        harness.run_steps(4);
    }
    assert!(harness.query_by_label_contains("Ada, attempt 1: Not passed. Missed: keep off.").is_some());
    assert!(harness.query_by_label_contains("Ada, attempt 3: Passed").is_some());
    harness.get_by_label("Page to print (HTML)").click();
    harness.run_steps(3);
    assert!(harness.query_by_label_contains("Written: ").is_some());
}

#[test]
fn notes_are_kept_beside_the_attempt() {
    let _english = english();
    let place = school();
    let mut harness = harness(place.path(), Page::Notes, [1024.0, 640.0], 1.0);
    harness.get_all_by_label("Attempt to comment").last().unwrap().click();
    harness.run_steps(4);
    harness.get_all_by_label_contains("Bob, attempt 1").last().unwrap().click();
    harness.run_steps(4);
    let field = harness.get_all_by_label("Note").last().unwrap();
    field.focus();
    field.type_text("hold still here");
    harness.run_steps(3);
    harness.get_by_label("Add note").click();
    harness.run_steps(3);
    let attempts = History::new(place.path()).attempts("Bob").unwrap().attempts;
    let kept = notes::read(place.path(), &attempts[0]).unwrap();
    assert_eq!(kept.len(), 1);
    assert_eq!((kept[0].text.as_str(), kept[0].time), ("hold still here", 0.0));
    harness.get_by_label("remove").click();
    harness.run_steps(3);
    assert_eq!(notes::read(place.path(), &attempts[0]).unwrap(), []);
}

#[test]
fn a_task_of_ones_own_is_saved_and_tried() {
    let _english = english();
    let place = school();
    let mut harness = harness(place.path(), Page::Task, [1280.0, 1400.0], 1.0);
    let base = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/training/avoid_vessel.toml");
    let field = harness.get_all_by_label("Scene to begin with").last().unwrap();
    field.focus();
    field.type_text(base.to_str().unwrap());
    harness.run_steps(3);
    harness.get_by_label("Take").click();
    harness.run_steps(3);
    assert!(harness.query_by_label("Passes through the surface: at most 2").is_some());
    assert!(harness.query_by_label("Stay away from vessel, as the scene draws it").is_some());
    harness.get_by_label("Stay away from vessel").click();
    harness.run_steps(3);
    harness.get_by_label("Check and save").click();
    harness.run_steps(3);
    let file = place.path().join("tasks/my_task.toml");
    let scene = Scene::load(&file, &[]).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.task.unwrap().goals.len(), 4, "the lesion, the vessel as a region, what the scene had beside");
    harness.get_by_label("Try it").click();
    harness.run_steps(2);
    assert_eq!(harness.state().next, Some(Next::Scene(file)));
}

/// Every page with attempts, and the form with a task in a block and one in a patient.
#[test]
fn every_text_of_the_pages_is_read() {
    let place = school();
    let mut all = Vec::new();
    everywhere(|size, where_| {
        for page in [Page::Class, Page::Comparison, Page::Notes, Page::Task] {
            let mut teacher = Teacher::new(place.path());
            teacher.turn_to(page);
            let mut harness = in_a_window(size, teacher, |ui, teacher| _ = teacher.show(ui));
            let mut look = |harness: &Harness<Teacher>, about: &str| {
                let found = wrong(&harness.output().shapes, &[]);
                all.extend(found.into_iter().map(|found| format!("{page:?} {about}, {where_}: {found}")));
            };
            look(&harness, "");
            if page != Page::Task {
                continue;
            }
            for scene in ["scenes/training/avoid_vessel.toml", "scenes/anatomy/neck_vein.toml"] {
                let field = harness.get_all_by_label(say("own-base")).last().unwrap();
                field.focus();
                harness.run_steps(2);
                harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
                harness.run_steps(2);
                harness.event(egui::Event::Text(scene.into()));
                harness.run_steps(2);
                harness.get_by_label(say("own-take")).click();
                harness.run_steps(4);
                assert!(harness.query_by_label(say("own-save")).is_some(), "{where_}: {scene} is not taken");
                look(&harness, scene);
            }
        }
    });
    assert!(all.is_empty(), "{}", all.join("\n"));
}
