//! Events, guided steps and debriefings of real runs: a script leads the needle, well and badly.

use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use stylet::observables::FrameRecord;
use stylet::scene::{Goal, Obstacle, Scene};
use stylet::simulation::{EngineChoice, Simulation};
use stylet::training::clearance::Clearance;
use stylet::training::debrief::{Circumstances, Debrief, Verdict, figure_name};
use stylet::training::events::{self, Event, Gravity, Kind, Watcher};
use stylet::training::guide::{Aim, Guide, Hint, Step};
use stylet::training::kinematic::Sample;
use stylet::training::score::Score;
use stylet::training::{key_figures, scripted_samples, texts};
use stylet::words::say_of;

const MM: f64 = 1e-3;

struct Run {
    scene: Scene,
    samples: Vec<Sample>,
    records: Vec<FrameRecord>,
}

fn place(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

fn load(name: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    Scene::load(&place(name), &overrides).unwrap_or_else(|e| panic!("{e}"))
}

/// A whole run on coarse cells.
fn run(name: &str, overrides: &[&str]) -> Run {
    let mut simulation = Simulation::new(load(name, overrides), EngineChoice::Cpu).unwrap_or_else(|e| panic!("{e}"));
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{e}")) {
        records.push(record);
    }
    let scene = simulation.model.scene.clone();
    let samples = match scene.regions.iter().any(|r| r.material.rigid) {
        // A tip that stands on bone is behind its motion.
        true => records
            .iter()
            .filter_map(|r| {
                simulation.tool_pose(r.time).map(|p| Sample { time: r.time, tip: p.tip, direction: p.direction })
            })
            .collect(),
        false => scripted_samples(&scene, &records),
    };
    Run { scene, samples, records }
}

fn kinds(events: &[Event]) -> Vec<(Kind, &str)> {
    events.iter().map(|e| (e.kind, e.name.as_str())).collect()
}

fn has(events: &[Event], kind: Kind, name: &str) -> bool {
    events.iter().any(|e| e.kind == kind && e.name == name)
}

const COARSE: [&str; 3] = ["tissue.cell_size_mm=1.3", "tissue.growth=1.8", "outputs.pictures_at_depth_mm=[]"];

/// Past the vessel as the scene does it, and straight through it.
#[test]
fn a_vessel_is_passed_or_touched() {
    let good = run("training/avoid_vessel.toml", &COARSE);
    let events = events::of_run(&good.scene, &good.samples, &good.records);
    println!("{:?}", kinds(&events));
    assert_eq!(events[0].kind, Kind::SkinPierced);
    assert!(has(&events, Kind::TargetReached, "lesion"));
    assert!(events.iter().all(|e| e.gravity() != Gravity::Bad), "{events:?}");
    let straight = [&COARSE[..], &["motion.entry_mm=[1.5, 0.0]", "motion.angle_deg=0.0"]].concat();
    let bad = run("training/avoid_vessel.toml", &straight);
    let events = events::of_run(&bad.scene, &bad.samples, &bad.records);
    println!("{:?}", kinds(&events));
    let touched = events.iter().find(|e| e.kind == Kind::Touched).expect("the vessel is touched");
    let near = events.iter().find(|e| e.kind == Kind::Near).expect("nearer than its clearance before");
    // The vessel begins 4 mm deep; half a millimetre must stay between.
    assert!((touched.depth - 4.0 * MM).abs() < 0.1 * MM, "{touched:?}");
    assert!((near.depth - 3.5 * MM).abs() < 0.1 * MM, "{near:?}");
    assert!(has(&events, Kind::LayerEntered, "vessel") && has(&events, Kind::LayerEntered, texts::OWN_MATERIAL));
    assert_eq!(events.iter().filter(|e| e.kind == Kind::Touched).count(), 1, "told once");
    assert!(touched.text().contains("vessel"));
}

/// Skin, fat, muscle, ligament, space: each told by its name, and the ligament is felt to give way.
#[test]
fn layers_and_the_loss_of_resistance() {
    let run = run("training/lumbar_oblique.toml", &["tissue.cell_size_mm=1.2", "outputs.pictures_at_depth_mm=[]"]);
    let events = events::of_run(&run.scene, &run.samples, &run.records);
    println!("{:?}", kinds(&events));
    let entered: Vec<&str> = events
        .iter()
        .filter(|e| matches!(e.kind, Kind::SkinPierced | Kind::LayerEntered))
        .map(|e| e.name.as_str())
        .collect();
    assert_eq!(entered, ["skin", "fat", texts::OWN_MATERIAL, "ligament", "space"]);
    let loss = events.iter().find(|e| e.kind == Kind::LossOfResistance && e.name == "ligament");
    let into = events.iter().find(|e| e.kind == Kind::LayerEntered && e.name == "ligament").expect("entered");
    assert!(loss.is_some_and(|loss| loss.time >= into.time), "{loss:?}");
    assert!(has(&events, Kind::TargetReached, "the space"));
    assert!(!has(&events, Kind::TargetPassed, "the space"));
    // One and a half millimetres too far.
    let mut far = run;
    let last = far.records.last().cloned().expect("a frame");
    far.records.extend((1..=100).map(|n| {
        let mut record = last.clone();
        record.time += 0.01 * f64::from(n);
        record.tip_coordinate += 0.03 * MM * f64::from(n);
        record.depth += 0.03 * MM * f64::from(n);
        record
    }));
    let events = events::of_run(&far.scene, &far.samples, &far.records);
    assert!(has(&events, Kind::TargetPassed, "the space"), "{:?}", kinds(&events));
}

/// Some millimetres above the space between the vertebrae the needle meets bone.
#[test]
fn bone_is_met_beside_the_midline() {
    let overrides = [
        "tissue.cell_size_mm=2.5",
        "tissue.growth=2.0",
        "outputs.pictures_at_depth_mm=[]",
        "motion.entry_ras_mm=[0.0, 0.0, 12.0]",
        "motion.target_ras_mm=[0.0, 54.0, 12.0]",
        "motion.phase.0.speed_mm_s=20",
    ];
    let run = run("anatomy/lumbar_puncture.toml", &overrides);
    let events = events::of_run(&run.scene, &run.samples, &run.records);
    println!("{:?}", kinds(&events));
    assert!(has(&events, Kind::BoneMet, "") && has(&events, Kind::Touched, "vertebrae"), "{:?}", kinds(&events));
    assert!(!events.iter().any(|e| e.kind == Kind::TargetReached));
    let bone = events.iter().find(|e| e.kind == Kind::BoneMet).expect("bone");
    let touched = events.iter().find(|e| e.kind == Kind::Touched).expect("touched");
    assert!(touched.time <= bone.time + 0.05, "the place is known to a quarter of a millimetre");
    // The guide sees it coming, and says what to do on it.
    let hints = hints(&run);
    assert!(hints.contains(&Hint::OnBone) && hints.contains(&Hint::BoneAhead), "{hints:?}");
    let debrief = debrief(&run);
    assert_ne!(debrief.verdict, Verdict::Passed);
}

fn hints(run: &Run) -> Vec<Hint> {
    let (mut watcher, mut guide) = (Watcher::new(&run.scene), Guide::new(&run.scene).expect("a task"));
    let mut found = Vec::<Hint>::new();
    through(run, &mut watcher, &mut guide, |guide| {
        found.extend(guide.hints().iter().filter(|hint| !found.contains(hint)).cloned().collect::<Vec<_>>());
    });
    found
}

fn through(run: &Run, watcher: &mut Watcher, guide: &mut Guide, mut each: impl FnMut(&Guide)) {
    let mut events = Vec::new();
    for record in &run.records {
        let index = run.samples.partition_point(|s| s.time <= record.time).max(1) - 1;
        let sample = run.samples[index];
        watcher.look(&run.scene, &sample, record, &mut events);
        guide.look(&run.scene, watcher, &sample, record);
        each(guide);
    }
}

fn debrief(run: &Run) -> Debrief {
    let score = Score::of(&run.scene, &run.samples, &run.records, None).unwrap_or_else(|e| panic!("{e}"));
    let mut watcher = Watcher::new(&run.scene);
    let about = Circumstances { wall: 12.5, ..Default::default() };
    Debrief::of(&run.scene, &mut watcher, (run.samples.clone(), &run.records), score, about)
}

/// The reference attempt goes through the steps in their order; the present one is never one that is done.
#[test]
fn a_good_attempt_goes_through_the_steps() {
    let run = run("training/hit_target.toml", &["tissue.cell_size_mm=1.3", "outputs.pictures_at_depth_mm=[]"]);
    let (mut watcher, mut guide) = (Watcher::new(&run.scene), Guide::new(&run.scene).expect("a task"));
    assert!(matches!(guide.aim(), Aim::Target { index: 0, tolerance } if (tolerance - 0.75 * MM).abs() < 1e-12));
    let (mut seen, mut farthest) = (vec![guide.steps()[0]], f64::INFINITY);
    through(&run, &mut watcher, &mut guide, |guide| {
        let step = guide.steps()[guide.present()];
        if seen.last() != Some(&step) {
            seen.push(step);
        }
        farthest = farthest.min(guide.place().to_target.unwrap_or(f64::INFINITY));
        assert!(guide.hints().iter().all(|hint| *hint != Hint::TooFast), "{:?}", guide.hints());
    });
    let chosen: Vec<Step> = seen.iter().copied().filter(|s| !matches!(s, Step::Entry | Step::Angle)).collect();
    assert_eq!(chosen, [Step::Advance, Step::Stop, Step::Finish]);
    let target = run.records.last().and_then(|r| r.targets[0].from_tip).expect("a way").length();
    assert!(farthest <= target + 1e-9 && farthest < 0.75 * MM, "{farthest}");
    // A planned path has nothing to choose; a core is brought out.
    let core = Guide::new(&load("training/core_biopsy.toml", &[])).expect("a task");
    let chosen: Vec<Step> = core.steps().iter().copied().filter(|s| !matches!(s, Step::Entry | Step::Angle)).collect();
    assert_eq!(chosen, [Step::Advance, Step::Stop, Step::Withdraw, Step::Finish]);
    assert!(matches!(core.aim(), Aim::Depth(depth) if (depth - 8.0 * MM).abs() < 1e-9));
}

/// The bins change nothing: every distance is that of all points.
#[test]
fn clearances_are_those_of_all_points() {
    let scene = load("anatomy/lumbar_puncture.toml", &[]);
    let Some(Goal::Avoid { obstacle, .. }) = scene.task.as_ref().and_then(|t| t.goals.get(1)) else {
        panic!("the second goal is to stay off bone")
    };
    assert!(matches!(obstacle, Obstacle::Region(_)));
    let clearance = Clearance::new(&scene, obstacle).expect("a needle");
    let points = clearance.points(usize::MAX);
    assert!(points.len() > 1000, "{}", points.len());
    let needle = scene.needle().expect("a needle");
    let segment = |a: DVec3, b: DVec3, x: DVec3| {
        let part = ((x - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        x.distance(a + (b - a) * part)
    };
    let begin = Instant::now();
    let (mut looked, mut met) = (0, 0);
    for n in 0..40 {
        let lean = 0.01 * f64::from(n % 7) - 0.03;
        let direction = DVec3::new(lean, 0.5 * lean, -1.0).normalize();
        let tip = DVec3::new(0.2 * MM * f64::from(n % 11), 0.9 * MM * f64::from(n % 17), -1.3 * MM * f64::from(n));
        let ends = [tip - direction * needle.tip_length, tip - direction * needle.length];
        let all = points.iter().map(|x| tip.distance(*x).min(segment(ends[0], ends[1], *x) - needle.radius));
        let expected = all.fold(f64::INFINITY, f64::min) - 0.25 * MM;
        let found = clearance.of(tip, direction);
        looked += 1;
        // A tip in the bone touches it, wherever the points are.
        let in_bone = scene.material_at(tip).rigid;
        met += u32::from(in_bone);
        let expected = if in_bone { expected.min(0.0) } else { expected };
        assert!((found - expected).abs() < 1e-12, "{found} instead of {expected}");
    }
    assert!(met > 3, "{met} of {looked} tips in the bone");
    println!("{looked} poses, {} points, {:?}", points.len(), begin.elapsed());
}

/// What a frame costs: the watcher and the guide together, on the case with the most points.
#[test]
fn a_frame_is_looked_at_in_microseconds() {
    let scene = load("anatomy/lumbar_puncture.toml", &[]);
    let begin = Instant::now();
    let mut watcher = Watcher::new(&scene);
    let prepared = begin.elapsed();
    let mut guide = Guide::new(&scene).expect("a task");
    let (mut events, begin) = (Vec::new(), Instant::now());
    let frames = 3000;
    for n in 0..frames {
        let depth = 54.0 * MM * f64::from(n) / f64::from(frames);
        let (time, tip) = (f64::from(n) / 60.0, scene.motion.entry + scene.motion.direction * depth);
        let record = FrameRecord { time, depth, tip_coordinate: depth, ..Default::default() };
        let sample = Sample { time, tip, direction: scene.motion.direction };
        watcher.look(&scene, &sample, &record, &mut events);
        guide.look(&scene, &watcher, &sample, &record);
    }
    let each = begin.elapsed().as_secs_f64() / f64::from(frames);
    println!("prepared in {prepared:?}, {:.1} us a frame", each * 1e6);
    assert!(has(&events, Kind::TargetReached, "the fluid behind the dura"), "{:?}", kinds(&events));
    // A hundredth of a frame at 60 a second; measured: a tenth of that.
    assert!(each < 170e-6, "{each}");
}

/// Verdict first, then a sentence per goal with its moment; key figures; both times.
#[test]
fn a_debriefing_says_why_and_when() {
    let straight = [&COARSE[..], &["motion.entry_mm=[1.5, 0.0]", "motion.angle_deg=0.0"]].concat();
    let run = run("training/avoid_vessel.toml", &straight);
    let debrief = debrief(&run);
    println!("{}", debrief.score.text());
    assert_eq!(debrief.verdict, Verdict::Failed);
    assert_eq!(debrief.reasons().count(), 0);
    let avoid = debrief.findings.iter().find(|f| f.goal.key == "avoid").expect("the vessel");
    assert_eq!(avoid.text(), "The needle touched vessel.");
    // The tip meets the wall 4 mm deep at 2 mm/s: shown is the touch, not the deepest moment behind it.
    assert!(avoid.moment.is_some_and(|t| (t - 2.0).abs() < 0.1), "{:?}", avoid.moment);
    let hit = debrief.findings.iter().find(|f| f.goal.key == "hit_target").expect("the lesion");
    assert!(hit.text().contains("from lesion") && hit.moment.is_some());
    let time = debrief.findings.last().expect("the time limit");
    assert!(time.text().starts_with("In time"), "{}", time.text());
    assert_eq!(debrief.figures.len(), 3);
    assert!(debrief.figures.iter().any(|figure| figure.row.key == "target_distance.lesion"));
    assert_eq!(debrief.wall, 12.5);
    assert!((debrief.simulated - run.records.last().expect("a frame").time).abs() < 1e-12);
    let (moment, sample) = debrief.at(2.0).expect("a moment");
    assert!((moment.time - 2.0).abs() < 0.02 && (sample.time - moment.time).abs() < 1e-9);
    // The way there is drawn beside that of the scene.
    assert!(debrief.reference.len() > 40);
    // A run whose numbers cannot be trusted says so in plain words.
    let mut wrong = run.records.clone();
    wrong.truncate(60);
    let mut score = Score::of(&run.scene, &run.samples, &wrong, None).unwrap_or_else(|e| panic!("{e}"));
    score.fail("the guard has stopped the run");
    let about = Circumstances { stopped: true, ..Default::default() };
    let samples: Vec<Sample> = run.samples.iter().take(61).copied().collect();
    let stopped = Debrief::of(&run.scene, &mut Watcher::new(&run.scene), (samples, &wrong), score, about);
    assert_eq!(stopped.verdict, Verdict::NotScored);
    assert!(stopped.reasons().next().is_some_and(|text| text.starts_with("The run was stopped")));
    assert!(stopped.findings.iter().all(|f| f.text() == "A goal was not judged."));
}

/// Every figure has its name in words, and every key of the table is that of a figure.
#[test]
fn figures_have_names_and_the_table_names_figures() {
    for figure in &texts::FIGURES {
        let key = format!("figure-{}", figure.key.trim_end_matches('.'));
        assert!(say_of(&key).is_some(), "{key}");
    }
    // Behind a dot stands the name of a target or a layer.
    let is_figure = |key: &str| {
        let whole = key.split_once('.').map_or(key.to_string(), |(kind, _)| format!("{kind}."));
        texts::figure_of(&whole).is_some()
    };
    for key in key_figures::all() {
        assert!(is_figure(key), "{key} of assets/training/key_figures.toml is no figure");
    }
    for name in ["hit_target", "avoid_vessel", "thin_layer_stop", "lumbar_oblique", "core_biopsy"] {
        let scene = load(&format!("training/{name}.toml"), &[]);
        let keys = key_figures::of_task(scene.task.as_ref().expect("a task"));
        assert!(keys.iter().all(|key| is_figure(key)), "{name}: {keys:?}");
    }
    let run = run("training/hit_target.toml", &["tissue.cell_size_mm=1.6", "motion.phase.0.depth_mm=2"]);
    let score = Score::of(&run.scene, &run.samples, &run.records, None).unwrap_or_else(|e| panic!("{e}"));
    let row = score.rows.iter().find(|r| r.key == "target_distance.lesion").expect("a row");
    assert_eq!(figure_name(row), "Tip to target: lesion");
}
