//! Start screen, panels and help at the sizes of real windows, in every language: no text is cut off, none lies over another.
#![cfg(feature = "window")]

use std::path::Path;
use std::sync::{PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

use egui::accesskit::Role;
use egui::epaint::text::PlacedRow;
use egui::epaint::{ClippedShape, Shape, TextShape};
use egui_kittest::kittest::Queryable;
use egui_kittest::{Harness, HarnessBuilder};
use stylet::training::history::History;
use stylet::training::scene_words;
use stylet::training::trainees;
use stylet::window::camera::Camera;
use stylet::window::hand::{Desk, Recording};
use stylet::window::help::{self, Help};
use stylet::window::panels::{self, Choices, Wishes};
use stylet::window::practice::{Leader, Practice, State};
use stylet::window::scan::Scan;
use stylet::window::screens::Next;
use stylet::window::settings::{Fold, Settings, Theme};
use stylet::window::source::Source;
use stylet::window::start::StartScreen;
use stylet::window::theme;
use stylet::words::{self, say};

use crate::common;

/// Windows in pixels, and sizes of texts.
const WINDOWS: [[f32; 2]; 3] = [[1024.0, 640.0], [1280.0, 800.0], [3840.0, 2160.0]];
const TEXT_SIZES: [f32; 2] = [1.0, 1.5];

/// The language is that of the whole program.
static LANGUAGE: RwLock<()> = RwLock::new(());

/// Texts are English until this is dropped.
pub fn english() -> RwLockReadGuard<'static, ()> {
    LANGUAGE.read().unwrap_or_else(PoisonError::into_inner)
}

/// Nobody else chooses a language until this is dropped, and then it is English again, however the test ends.
pub struct AnyLanguage(#[expect(dead_code, reason = "kept locked")] RwLockWriteGuard<'static, ()>);

impl AnyLanguage {
    pub fn begin() -> Self {
        AnyLanguage(LANGUAGE.write().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for AnyLanguage {
    fn drop(&mut self) {
        words::choose("en");
    }
}

/// Does something in every language, window and size of texts: size in points, and words for messages.
pub fn everywhere(mut draw: impl FnMut([f32; 2], &str)) {
    let _alone = AnyLanguage::begin();
    for language in &words::LANGUAGES {
        assert!(words::choose(language.code));
        for [width, height] in WINDOWS {
            for zoom in TEXT_SIZES {
                draw([width / zoom, height / zoom], &format!("{} {width} x {height}, text {zoom}", language.code));
            }
        }
    }
}

fn texts(shapes: &[ClippedShape]) -> Vec<(egui::Rect, TextShape)> {
    fn walk(clip: egui::Rect, shape: &Shape, found: &mut Vec<(egui::Rect, TextShape)>) {
        match shape {
            Shape::Vec(all) => all.iter().for_each(|shape| walk(clip, shape, found)),
            Shape::Text(text) => found.push((clip, text.clone())),
            _ => {}
        }
    }
    let mut found = Vec::new();
    shapes.iter().for_each(|shape| walk(shape.clip_rect, &shape.shape, &mut found));
    found
}

/// What is wrong with the texts of a picture. `may_end_early`: texts that are shortened with dots where there is no room.
pub fn wrong(shapes: &[ClippedShape], may_end_early: &[&str]) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut seen: Vec<(egui::Rect, String)> = Vec::new();
    for (clip, text) in texts(shapes) {
        let said = text.galley.text().to_string();
        if text.galley.elided && !may_end_early.iter().any(|start| said.starts_with(start)) {
            wrong.push(format!("`{said}` ends early"));
        }
        // Row by row: a text that goes on in the next line has its first row behind something else.
        let row = |row: &PlacedRow| row.rect_without_leading_space().translate(text.pos.to_vec2());
        let rows: Vec<egui::Rect> = match text.angle == 0.0 {
            true => text.galley.rows.iter().map(row).collect(),
            false => vec![Shape::Text(text.clone()).visual_bounding_rect()],
        };
        for rect in rows {
            let visible = rect.intersect(clip);
            if said.trim().is_empty() || visible.width() <= 0.0 || visible.height() <= 2.0 {
                continue;
            }
            if rect.left() < clip.left() - 1.0 || rect.right() > clip.right() + 1.0 {
                wrong.push(format!("`{said}` is cut off: {rect} in {clip}"));
            }
            for (other, theirs) in &seen {
                let both = visible.intersect(*other);
                if both.width() > 1.5 && both.height() > 1.5 {
                    wrong.push(format!("`{said}` lies over `{theirs}`"));
                }
            }
            seen.push((visible, said.clone()));
        }
    }
    assert!(seen.len() > 3, "texts are drawn: {seen:?}");
    wrong
}

#[test]
fn the_check_finds_what_is_wrong() {
    let faulty = |draw: fn(&mut egui::Ui)| {
        let mut harness = Harness::builder().with_size([200.0, 200.0]).build_ui(move |ui| {
            for n in 0..4 {
                ui.label(n.to_string());
            }
            draw(ui);
        });
        harness.run_steps(3);
        wrong(&harness.output().shapes, &[])
    };
    assert_eq!(faulty(|ui| _ = ui.label("short")), Vec::<String>::new());
    const LONG: &str = "a text that is far too long for this";
    assert!(faulty(|ui| _ = ui.add(egui::Label::new(LONG).truncate())).iter().any(|w| w.contains("ends early")));
    let cut = faulty(|ui| {
        ui.set_clip_rect(egui::Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(60.0, 200.0)));
        ui.label("cut off here");
    });
    assert!(cut.iter().any(|w| w.contains("is cut off")), "{cut:?}");
    let over = faulty(|ui| {
        for text in ["one", "two"] {
            ui.painter().text(
                egui::pos2(50.0, 150.0),
                egui::Align2::LEFT_TOP,
                text,
                Default::default(),
                egui::Color32::RED,
            );
        }
    });
    assert!(over.iter().any(|w| w.contains("lies over")), "{over:?}");
}

pub fn in_a_window<S>(
    size: [f32; 2],
    state: S,
    draw: impl FnMut(&mut egui::Ui, &mut S) + 'static,
) -> Harness<'static, S> {
    set_up(Harness::builder().with_size(size), state, draw)
}

/// Draws with the looks of the program, until nothing moves.
pub fn set_up<S>(
    window: HarnessBuilder<S>,
    state: S,
    mut draw: impl FnMut(&mut egui::Ui, &mut S) + 'static,
) -> Harness<'static, S> {
    let mut first = true;
    let mut harness = window.build_ui_state(
        move |ui, state: &mut S| {
            if std::mem::take(&mut first) {
                theme::set_up(ui.ctx());
            }
            draw(ui, state);
        },
        state,
    );
    harness.run_steps(4);
    harness
}

#[test]
fn every_text_of_the_start_screen_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let history = History::new(folder.path());
    trainees::create(&history, "Maximiliane Musterfrau-Beispiel").unwrap();
    everywhere(|size, place| {
        let mut settings = Settings { trainee: Some("Maximiliane Musterfrau-Beispiel".into()), ..Settings::default() };
        settings.opened(Path::new("/a/long/way/down/many/folders/of/somebody/scenes/with_a_long_name_too.toml"));
        let mut start = StartScreen::new(folder.path());
        start.tell("scenes/none.toml: cannot read the scene file\n  way out: give the path of a scene file".into());
        let state = (start, settings, None::<Next>);
        let mut harness = in_a_window(size, state, |ui, (start, settings, next)| *next = start.show(ui, settings));
        for opened in ["start-progress", "start-scenes"] {
            let label = words::say_of(opened).unwrap();
            harness.get_by_label(label).click();
            harness.run_steps(8);
            let wrong = wrong(&harness.output().shapes, &[]);
            assert!(wrong.is_empty(), "{place}: {}", wrong.join("\n"));
        }
    });
}

/// A label map that was dropped: what it holds, and the form that makes a scene of it; then the refusal of a line that misses it.
#[test]
fn every_text_of_a_file_that_was_brought_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cases/liver.nrrd");
    everywhere(|size, place| {
        let mut start = StartScreen::new(folder.path());
        assert_eq!(start.bring(file.clone()), None);
        let mut harness = in_a_window(size, (start, Settings::default()), |ui, (start, settings)| {
            start.show(ui, settings);
        });
        let make = say("bring-make");
        let begin = std::time::Instant::now();
        while harness.query_by_label(make).is_none() {
            assert!(begin.elapsed().as_secs() < 60, "{place}: the file is not read");
            std::thread::sleep(std::time::Duration::from_millis(20));
            harness.run_steps(1);
        }
        harness.run_steps(4);
        let found = wrong(&harness.output().shapes, &[]);
        assert!(found.is_empty(), "{place}: {}", found.join("\n"));
    });
}

/// What a card is called for those who do not see it.
const CARD: &str = "Hit a lesion: Stop the tip in a lesion 9 mm deep. easy";

#[test]
fn a_task_is_chosen_by_mouse_and_by_keys() {
    let _english = english();
    let folder = tempfile::tempdir().unwrap();
    let state = || (StartScreen::new(folder.path()), Settings::default(), None::<Next>);
    let draw = |ui: &mut egui::Ui, (start, settings, next): &mut (StartScreen, Settings, Option<Next>)| {
        let wanted = start.show(ui, settings);
        *next = next.take().or(wanted);
    };
    let expected = Some(Next::Scene("scenes/training/hit_target.toml".into()));
    let mut harness = in_a_window([1280.0, 800.0], state(), draw);
    harness.get_by_role_and_label(Role::Button, CARD).click();
    harness.run_steps(3);
    assert_eq!(harness.state().2, expected);
    let mut harness = in_a_window([1280.0, 800.0], state(), draw);
    harness.key_press(egui::Key::Num2);
    harness.run_steps(3);
    assert_eq!(harness.state().2, expected);
    // Tab goes to every card; Enter opens the one that has the keyboard.
    let mut harness = in_a_window([1280.0, 800.0], state(), draw);
    for _ in 0..30 {
        harness.key_press(egui::Key::Tab);
        harness.run_steps(2);
        if harness.get_by_role_and_label(Role::Button, CARD).is_focused() {
            break;
        }
    }
    assert!(harness.get_by_role_and_label(Role::Button, CARD).is_focused());
    harness.key_press(egui::Key::Enter);
    harness.run_steps(3);
    assert_eq!(harness.state().2, expected);
}

#[test]
fn a_trainee_is_made_with_the_keyboard() {
    let _english = english();
    let folder = tempfile::tempdir().unwrap();
    let state = (StartScreen::new(folder.path()), Settings::default());
    let mut harness = in_a_window([1280.0, 800.0], state, |ui, (start, settings)| _ = start.show(ui, settings));
    harness.get_by_label(say("start-new-trainee")).focus();
    harness.run_steps(2);
    harness.key_press(egui::Key::Enter);
    harness.run_steps(4);
    // Digits are a part of the name here, not the number of a task.
    harness.event(egui::Event::Text("Ada 2".into()));
    harness.run_steps(2);
    harness.key_press(egui::Key::Enter);
    harness.run_steps(4);
    assert_eq!(harness.state().1.trainee.as_deref(), Some("Ada 2"));
    assert_eq!(trainees::list(&History::new(folder.path())).unwrap().0[0].name, "Ada 2");
}

#[test]
fn the_keys_are_read_everywhere() {
    everywhere(|size, place| {
        let harness = in_a_window(size, Help { open: true }, |ui, help| {
            help.show(ui.ctx(), &[help::RUN, help::NEEDLE, help::VIEW, help::START, help::EVERYWHERE]);
        });
        let wrong = wrong(&harness.output().shapes, &[]);
        assert!(wrong.is_empty(), "{place}: {}", wrong.join("\n"));
    });
    let _english = english();
    let mut harness = in_a_window([800.0, 600.0], Help::default(), |ui, help| help.show(ui.ctx(), &[help::RUN]));
    for (key, open) in
        [(egui::Key::F1, true), (egui::Key::F1, false), (egui::Key::F1, true), (egui::Key::Escape, false)]
    {
        harness.key_press(key);
        harness.run_steps(3);
        assert_eq!(harness.state().open, open, "{key:?}");
    }
}

/// The window of 1280 x 800 with the margin that the harness puts around its contents.
pub const WITH_MARGIN: [f32; 2] = [1280.0 + 2.0 * MARGIN, 800.0 + 2.0 * MARGIN];
pub const MARGIN: f32 = 8.0;

/// Where things of the start screen lie in a window of 1280 x 800 [points]; texts are English.
pub struct StartPlaces {
    pub new_trainee: egui::Pos2,
    /// The button beside the name of a new trainee.
    pub create: egui::Pos2,
    pub hit_a_lesion: egui::Pos2,
}

impl StartPlaces {
    pub fn of(history: &Path) -> StartPlaces {
        let state = (StartScreen::new(history), Settings::default());
        let mut harness = in_a_window([1280.0, 800.0], state, |ui, (start, settings)| _ = start.show(ui, settings));
        let new_trainee = harness.get_by_label(say("start-new-trainee"));
        let (place, hit_a_lesion) = (new_trainee.rect().center(), harness.get_by_role_and_label(Role::Button, CARD));
        let hit_a_lesion = hit_a_lesion.rect().center();
        new_trainee.click();
        harness.run_steps(4);
        let create = harness.get_by_label(say("start-create")).rect().center();
        StartPlaces { new_trainee: place, create, hit_a_lesion }
    }
}

/// What a drag of the needle does: where that is chosen.
pub struct DragPlaces {
    pub pushes: egui::Pos2,
    pub tilts: egui::Pos2,
}

/// Where `Finish`, and what a drag does, lie beside the view of a task in a window of 1280 x 800 [points].
pub fn places_of_a_task(scene: &str, gpu: &stylet::gpu::Gpu) -> (egui::Pos2, DragPlaces) {
    let harness = in_a_window(WITH_MARGIN, bench(scene, gpu), panels);
    let place = |key: &str| {
        let label = words::say_of(key).unwrap();
        harness.get_by_label(label).rect().center() - egui::vec2(MARGIN, MARGIN)
    };
    (place("finish"), DragPlaces { pushes: place("drag-along"), tilts: place("drag-tilt") })
}

/// An attempt with some frames, and what its panels need.
pub struct Bench {
    pub practice: Practice,
    choices: Choices,
    camera: Camera,
    desk: Desk,
    settings: Settings,
    wishes: Wishes,
    help: bool,
    scan: Scan,
}

pub fn bench(scene: &str, gpu: &stylet::gpu::Gpu) -> Bench {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(scene);
    let coarse = vec!["tissue.cell_size_mm=1.6".to_string()];
    let (source, scene) = Source::read(path, coarse).unwrap_or_else(|e| panic!("{e}"));
    let mut practice = Practice::new(scene, source, gpu.clone(), Leader::Hand, None, false).unwrap();
    let mut poses = Vec::new();
    if let Some(mut pose) = practice.simulation.hand() {
        for _ in 0..20 {
            pose.depth += 2e-5;
            poses.push(pose);
        }
    }
    let mut recording = Recording::new(poses);
    for _ in 0..20 {
        practice.start(&mut recording).unwrap();
        practice.finish(&mut recording).unwrap();
    }
    Bench {
        practice,
        choices: Choices::new(Some((1, 0.5)), 1.0),
        camera: Camera::around(glam::Vec3::ZERO, 0.02),
        desk: Desk::new(2e-3),
        settings: Settings { theme: Theme::Light, ..Settings::default() },
        wishes: Wishes::default(),
        help: false,
        scan: Scan::default(),
    }
}

pub fn panels(ui: &mut egui::Ui, bench: &mut Bench) {
    let Bench { practice, choices, camera, desk, settings, wishes, help, scan } = bench;
    theme::apply(ui.ctx(), settings);
    egui::Panel::top("bar").show(ui, |ui| panels::bar(ui, &practice.scene().title, settings, wishes, help));
    let [left, right] = panels::widths(ui.available_width());
    if !settings.is_folded(Fold::Left) {
        egui::Panel::left("controls").exact_size(left).resizable(false).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                let asked = panels::controls(ui, practice, choices, camera, desk);
                wishes.restart = wishes.restart.or(asked.restart);
                wishes.debrief |= asked.debrief;
            });
        });
    }
    if !settings.is_folded(Fold::Right) {
        egui::Panel::right("readings").exact_size(right).resizable(false).show(ui, |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                panels::readings(ui, practice, choices, &[], None);
            });
        });
    }
    if choices.look.probe.on {
        let height = (0.34 * ui.available_height()).clamp(130.0, 270.0);
        egui::Panel::bottom("ultrasound").default_size(height).show(ui, |ui| {
            scan.panel(ui, &mut choices.look.probe, practice.scene(), &practice.simulation.model.mesh);
        });
    }
    egui::CentralPanel::no_frame().show(ui, |ui| _ = ui.available_rect_before_wrap());
}

#[test]
fn every_text_around_the_view_is_read_and_panels_keep_their_width() {
    let Some(gpu) = common::gpu() else { return };
    let mut all = Vec::new();
    for scene in ["scenes/training/hit_target.toml", "scenes/layers.toml"] {
        everywhere(|size, place| {
            let mut harness = in_a_window(size, bench(scene, &gpu), panels);
            let title = harness.state().practice.scene().title.clone();
            for fold in ["engineer", "figures"] {
                let label = words::say_of(fold).unwrap();
                if harness.state().practice.scene().task.is_some() {
                    harness.get_by_label(label).click();
                    harness.run_steps(10);
                }
                let wrong = wrong(&harness.output().shapes, &[scene_words::title(&title)]);
                all.extend(wrong.into_iter().map(|wrong| format!("{scene}, {place}: {wrong}")));
            }
        });
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// The slice of the ultrasound below the view, with its settings, and the panels beside it.
#[test]
fn every_text_beside_the_ultrasound_is_read() {
    let Some(gpu) = common::gpu() else { return };
    let mut all = Vec::new();
    for scene in ["scenes/training/avoid_vessel.toml", "scenes/layers.toml"] {
        everywhere(|size, place| {
            let mut bench = bench(scene, &gpu);
            bench.choices.look.probe.on = true;
            let title = bench.practice.scene().title.clone();
            let harness = in_a_window(size, bench, panels);
            assert!(
                harness.query_by_role_and_label(Role::RadioButton, say("along")).is_some(),
                "{place}: no ultrasound"
            );
            let found = wrong(&harness.output().shapes, &[scene_words::title(&title)]);
            all.extend(found.into_iter().map(|found| format!("{scene}, {place}: {found}")));
        });
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

#[test]
fn panels_fold_by_their_keys_and_the_run_obeys_its_own() {
    let Some(gpu) = common::gpu() else { return };
    let _english = english();
    let mut harness = in_a_window([1280.0, 800.0], bench("scenes/training/hit_target.toml", &gpu), panels);
    assert!(harness.query_by_label(say("restart")).is_some());
    for (key, part) in [(egui::Key::F2, Fold::Left), (egui::Key::F3, Fold::Right)] {
        harness.key_press(key);
        harness.run_steps(2);
        assert!(harness.state().settings.is_folded(part), "{key:?}");
    }
    assert!(harness.query_by_label(say("restart")).is_none());
    harness.key_press(egui::Key::F2);
    harness.run_steps(2);
    assert!(harness.query_by_label(say("restart")).is_some());
    for (key, wanted) in [
        (egui::Key::F5, Wishes { restart: Some(Leader::Hand), ..Wishes::default() }),
        (egui::Key::F6, Wishes { debrief: true, ..Wishes::default() }),
    ] {
        harness.state_mut().wishes = Wishes::default();
        harness.key_press(key);
        harness.run_steps(2);
        assert_eq!(harness.state().wishes, wanted, "{key:?}");
    }
    harness.key_press(egui::Key::F8);
    harness.run_steps(2);
    assert_eq!(harness.state().wishes.next, Some(Next::Start));
    // Engineers' controls are behind their fold in a task, and a scene without one shows them.
    assert!(harness.query_by_label(say("effects")).is_none());
    assert_eq!(harness.state().practice.state, State::Paused);
    let harness = in_a_window([1280.0, 2000.0], bench("scenes/layers.toml", &gpu), panels);
    assert!(harness.query_by_label(say("effects")).is_some());
}
