//! Teaching: a class as table, statements and pages, notes, tasks of one's own; synthetic trainees through the real simulator.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use serde_json::Value;
use stylet::commands::report::{ReportArgs, ReportOutcome, report};
use stylet::scene::{Goal, Obstacle, Scene, Task};
use stylet::simulation::{Purpose, Simulation};
use stylet::training::class::{Class, Trend, iso_8601, key_figures};
use stylet::training::history::{Attempt, History};
use stylet::training::notes::{self, Note};
use stylet::training::own_task::{Aim, Avoided, OwnTask, Way};
use stylet::training::report::{Side, of_attempt, of_trainee, of_two, pairs, two_as_text};
use stylet::training::score::{Row, Score};
use stylet::training::skill::{HABITS, Level};
use stylet::training::skill_evidence::{Finding, built_in};
use stylet::training::skill_run::attempt;
use stylet::training::task::GoalResult;
use stylet::training::texts::Better;
use stylet::training::{Trust, xapi};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn row(key: &str, unit: &str, value: f64, better: Better) -> Row {
    let label = format!("label of {key}");
    Row { key: key.into(), label, unit: unit.into(), value: Some(value), reference: None, better }
}

/// A score with two goals, of which `met` are met.
fn score(task: &str, met: usize, figures: [f64; 4]) -> Score {
    let goal = |n: usize| GoalResult {
        key: "avoid".into(),
        text: format!("goal {n}"),
        unit: "mm".into(),
        measured: Some(1.0),
        least: None,
        most: Some(2.0),
        met: Some(n < met),
        weight: 1.0,
    };
    let [distance, passes, smooth, time] = figures;
    Score {
        scene: "made_up".into(),
        task: Some(task.into()),
        rows: vec![
            row("target_distance.lesion", "mm", distance, Better::Lower),
            row("passes", "", passes, Better::Lower),
            row("motion_smoothness", "mm/s2.5", smooth, Better::Lower),
            row("elapsed_time", "s", time, Better::Lower),
            row("core_mass", "mg", 10.0 * passes, Better::Higher),
        ],
        goals: vec![goal(0), goal(1)],
        trust: Trust::default(),
    }
}

const TASK: &str = "reach <a> \"lesion\" & back";

/// Two trainees: Ada gets better and passes the third time, Bob is not scored once.
fn school() -> tempfile::TempDir {
    let place = tempfile::tempdir().unwrap();
    let history = History::new(place.path());
    for (met, figures) in [(0, [3.0, 2.0, 50.0, 12.5]), (1, [2.0, 1.0, 50.4, 9.25]), (2, [0.5, 1.0, 49.9, 8.0])] {
        history.add("Ada & <Co>", &score(TASK, met, figures)).unwrap();
    }
    let mut stopped = score("other", 2, [1.0, 1.0, 1.0, 3.0]);
    stopped.fail("the guard stopped it");
    history.add("Bob", &stopped).unwrap();
    place
}

#[test]
fn a_class_is_a_table_and_what_is_broken_is_told() {
    let place = school();
    fs::write(History::new(place.path()).folder("Bob").unwrap().join("other_9.json"), "{").unwrap();
    fs::create_dir(place.path().join("nobody")).unwrap();
    fs::write(place.path().join("nobody/x_1.json"), "no attempt").unwrap();
    let class = Class::read(place.path()).unwrap();
    assert_eq!(class.broken.len(), 2, "{:?}", class.broken);
    let told = class.broken.iter().map(ToString::to_string).collect::<String>();
    assert!(told.contains("other_9.json") && told.contains("x_1.json") && told.contains("way out"), "{told}");
    let [ada, bob] = &class.standings[..] else { panic!("{:?}", class.standings) };
    assert_eq!((ada.attempts.len(), ada.passed(), ada.scored()), (3, 1, 3));
    assert_eq!((ada.best().unwrap().number, ada.last().unwrap().number), (3, 3));
    assert_eq!(key_figures(ada.last().unwrap()), ["target_distance.lesion", "passes", "motion_smoothness"]);
    assert_eq!(ada.trend("target_distance.lesion"), Trend::Better);
    assert_eq!(ada.trend("core_mass"), Trend::Worse, "less of what should be more");
    assert_eq!(ada.trend("motion_smoothness"), Trend::Same, "a fiftieth is no change");
    assert_eq!((bob.scored(), bob.best().is_none(), bob.trend("passes")), (0, true, Trend::Unknown));
    let text = class.text();
    assert!(text.contains("Ada & <Co>") && text.contains("2/2") && text.contains("passes 1 (better)"), "{text}");
    let table = class.csv().unwrap();
    let mut reader = csv::Reader::from_reader(&table[..]);
    let heads = reader.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    let cell = |n: usize, head: &str| rows[n][heads.iter().position(|h| h == head).unwrap()].to_string();
    assert_eq!(rows.len(), 2);
    assert_eq!((cell(0, "task"), cell(0, "passed"), cell(0, "best_goals_met")), (TASK.into(), "1".into(), "2".into()));
    assert_eq!(
        (cell(0, "figure_1"), cell(0, "last_1"), cell(0, "trend_1")),
        ("target_distance.lesion".into(), "0.5".into(), "better".into())
    );
    assert_eq!((cell(1, "scored"), cell(1, "best_goals_met")), ("0".into(), String::new()));
    assert!(Class::read(&place.path().join("elsewhere")).unwrap_err().to_string().contains("no such folder"));
    let error = class.of("Eve").unwrap_err().to_string();
    assert!(error.contains("Ada & <Co>, Bob"), "{error}");
}

/// No field of a statement may be null; what extensions hold is free.
fn no_nulls(value: &Value, path: &str) {
    match value {
        Value::Null => panic!("{path} is null"),
        Value::Object(map) => {
            map.iter().filter(|(k, _)| *k != "extensions").for_each(|(k, v)| no_nulls(v, &format!("{path}.{k}")))
        }
        Value::Array(list) => list.iter().for_each(|v| no_nulls(v, path)),
        _ => {}
    }
}

/// A statement by the data rules of xAPI 1.0.3, field by field.
fn check_statement(s: &Value, home: &str) {
    let keys = |v: &Value| v.as_object().unwrap().keys().cloned().collect::<BTreeSet<String>>();
    let set = |names: &[&str]| names.iter().map(|n| n.to_string()).collect::<BTreeSet<String>>();
    no_nulls(s, "statement");
    assert_eq!(keys(s), set(&["id", "actor", "verb", "object", "result", "context", "timestamp", "version"]));
    let id = s["id"].as_str().unwrap();
    let parts: Vec<&str> = id.split('-').collect();
    assert_eq!(parts.iter().map(|p| p.len()).collect::<Vec<_>>(), [8, 4, 4, 4, 12], "{id}");
    assert!(id.chars().all(|c| c == '-' || c.is_ascii_digit() || ('a'..='f').contains(&c)), "{id}");
    assert!(parts[2].starts_with('5') && "89ab".contains(&parts[3][..1]), "{id}");
    // One way to identify an agent, and no more.
    assert_eq!(keys(&s["actor"]), set(&["objectType", "name", "account"]));
    assert_eq!(s["actor"]["objectType"], "Agent");
    assert_eq!(keys(&s["actor"]["account"]), set(&["homePage", "name"]));
    assert_eq!(s["actor"]["account"]["homePage"], home);
    assert!(!s["actor"]["account"]["name"].as_str().unwrap().is_empty());
    let verb = s["verb"]["display"]["en-US"].as_str().unwrap();
    assert!(["passed", "failed", "attempted"].contains(&verb));
    assert_eq!(s["verb"]["id"], format!("http://adlnet.gov/expapi/verbs/{verb}"));
    assert_eq!(s["object"]["objectType"], "Activity");
    let activity = s["object"]["id"].as_str().unwrap();
    assert!(
        activity.starts_with(home) && !activity.contains(|c: char| c.is_whitespace() || "<>\"{}|\\^`".contains(c)),
        "{activity}"
    );
    assert_eq!(s["object"]["definition"]["type"], "http://adlnet.gov/expapi/activities/simulation");
    assert!(s["object"]["definition"]["name"]["en-US"].is_string());
    let result = &s["result"];
    assert!(result["completion"].is_boolean());
    for key in result["extensions"].as_object().unwrap().keys() {
        assert!(key.starts_with("https://"), "{key} is no IRI");
    }
    if let Some(score) = result.get("score") {
        assert_eq!(keys(score), set(&["scaled", "raw", "min", "max"]));
        let [scaled, raw, min, max] = ["scaled", "raw", "min", "max"].map(|k| score[k].as_f64().unwrap());
        assert!((-1.0..=1.0).contains(&scaled) && min < max && (min..=max).contains(&raw));
        assert!(result["success"].is_boolean());
    }
    let duration = result["duration"].as_str().unwrap();
    let seconds = duration.strip_prefix("PT").and_then(|rest| rest.strip_suffix('S')).unwrap();
    assert!(seconds.parse::<f64>().unwrap() >= 0.0 && seconds.split('.').nth(1).is_none_or(|part| part.len() <= 2));
    let time = s["timestamp"].as_str().unwrap();
    assert_eq!((time.len(), &time[10..11], &time[19..]), (20, "T", "Z"), "{time}");
    assert_eq!(s["version"], "1.0.3");
}

#[test]
fn statements_keep_the_rules_of_xapi() {
    let place = school();
    let class = Class::read(place.path()).unwrap();
    let home = "https://school.example/stylet";
    let text = xapi::statements(class.attempts(), &format!("{home}/")).unwrap();
    let list: Vec<Value> = serde_json::from_str(&text).unwrap();
    list.iter().for_each(|s| check_statement(s, home));
    let verbs: Vec<&str> = list.iter().map(|s| s["verb"]["display"]["en-US"].as_str().unwrap()).collect();
    assert_eq!(verbs, ["failed", "failed", "passed", "attempted"]);
    assert_eq!(list[1]["result"]["score"], serde_json::json!({ "scaled": 0.5, "raw": 1.0, "min": 0, "max": 2.0 }));
    assert_eq!((&list[1]["result"]["duration"], &list[1]["result"]["success"]), (&"PT9.25S".into(), &false.into()));
    assert_eq!(list[3]["result"]["response"], "the guard stopped it");
    assert!(list[3]["result"].get("success").is_none() && list[3]["result"]["completion"] == false);
    let ids: BTreeSet<&str> = list.iter().map(|s| s["id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), list.len());
    assert_eq!(text, xapi::statements(class.attempts(), home).unwrap(), "the same attempts have the same identifiers");
    for wrong in ["", "school.example", "https://", "https://a b", "ftp://x"] {
        let error = xapi::statements(class.attempts(), wrong).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{wrong}");
    }
    assert_eq!(iso_8601(951_782_400 + 3661), "2000-02-29T01:01:01Z");
}

fn parsed(page: &str) -> String {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(page, options).unwrap_or_else(|e| panic!("{e}\n{page}"));
    assert!(!document.descendants().any(|n| n.has_tag_name("script") || n.has_tag_name("link")));
    // Nothing is fetched: an `xmlns` is a name, no address.
    assert!(!page.contains("src=\"http") && !page.contains("url(http"));
    document.descendants().filter_map(|n| n.text()).collect::<Vec<_>>().join(" ")
}

#[test]
fn pages_to_print_need_nothing_but_themselves() {
    let place = school();
    let class = Class::read(place.path()).unwrap();
    let standings = class.of("Ada & <Co>").unwrap();
    let attempts: Vec<&Attempt> = class.attempts().collect();
    let page = of_trainee("Ada & <Co>", &standings).unwrap();
    let text = parsed(&page);
    assert!(
        text.contains("Progress of Ada & <Co>") && text.contains(TASK) && text.contains("getting better"),
        "{text}"
    );
    assert_eq!(page.matches("<svg").count(), 3, "a chart per key figure");
    let note = Note { time: 1.25, author: "T".into(), text: "too <fast>".into() };
    let text = parsed(&of_attempt(attempts[1], &[note]));
    assert!(text.contains("Missed: goal 1") && text.contains("too <fast>") && text.contains("1.2 s"), "{text}");
    assert!(parsed(&of_attempt(attempts[3], &[])).contains("Not scored: the guard stopped it"));
    let text = parsed(&of_two(attempts[0], attempts[3]));
    assert!(text.contains("Different tasks"), "{text}");
    let pair = |key: &str| pairs(&attempts[0].score, &attempts[2].score).into_iter().find(|p| p.key == key).unwrap();
    assert_eq!(pair("passes").better, Side::Second);
    assert_eq!(pair("core_mass").better, Side::First);
    assert_eq!(pairs(&attempts[0].score, &attempts[0].score)[0].better, Side::Neither);
    let text = two_as_text(attempts[0], attempts[2]);
    assert!(
        text.lines().any(|l| l.contains("verdict") && l.contains("not passed") && l.trim_end().ends_with("passed")),
        "{text}"
    );
}

#[test]
fn notes_stay_with_their_attempt() {
    let place = school();
    let class = Class::read(place.path()).unwrap();
    let attempt = class.attempts().next().unwrap();
    assert_eq!(notes::read(place.path(), attempt).unwrap(), []);
    let note = |time: f64, text: &str| Note { time, author: "Teacher".into(), text: text.into() };
    let path = notes::write(place.path(), attempt, &[note(3.0, "late"), note(0.5, "early")]).unwrap();
    assert_eq!(notes::read(place.path(), attempt).unwrap(), [note(0.5, "early"), note(3.0, "late")]);
    assert!(Class::read(place.path()).unwrap().broken.is_empty(), "notes are no broken attempts");
    for wrong in [note(-1.0, "x"), note(f64::NAN, "x"), note(1.0, &"x".repeat(5000))] {
        assert!(notes::write(place.path(), attempt, &[wrong]).is_err());
    }
    assert_eq!(notes::read(place.path(), attempt).unwrap().len(), 2, "what is refused replaces nothing");
    fs::write(&path, "{\"version\": 7, \"notes\": []}").unwrap();
    let error = notes::read(place.path(), attempt).unwrap_err().to_string();
    assert!(error.contains("version 7") && error.contains("way out"), "{error}");
}

#[test]
fn a_task_of_ones_own_is_a_scene_that_loads() {
    let place = tempfile::tempdir().unwrap();
    for (n, base) in ["training/avoid_vessel", "training/lumbar_oblique", "anatomy/neck_vein"].into_iter().enumerate() {
        let base = root().join(format!("scenes/{base}.toml"));
        let mut task = OwnTask::from_scene(&base).unwrap();
        // As it was: the same way.
        let as_it_was = place.path().join(format!("same_{n}.toml"));
        task.save(&as_it_was).unwrap_or_else(|e| panic!("{}: {e}", base.display()));
        let (before, after) = (Scene::load(&base, &[]).unwrap(), Scene::load(&as_it_was, &[]).unwrap());
        assert!((before.motion.deepest() - after.motion.deepest()).abs() < 1e-6);
        assert!(before.motion.direction.angle_between(after.motion.direction) < 1e-5, "{}", base.display());
        let [had, has] = [&before, &after].map(|scene| scene.task.clone().unwrap());
        assert_eq!(
            (had.time_limit, had.force_limit, had.goals.len()),
            (has.time_limit, has.force_limit, has.goals.len())
        );
        let region = task.regions.first().unwrap().clone();
        task.name = "my \"own\" task".into();
        task.time_limit = Some(33.0);
        let avoided = |region: &str, clearance| vec![Avoided { region: region.into(), clearance, weight: 2.5 }];
        task.avoid = avoided(&region, 0.75);
        if let Way::Block { entry, angle, heading, depth } = &mut task.way {
            (*entry, *angle, *heading, *depth) = ([1.0, -2.0], 10.0, 90.0, 6.0);
            task.aim = Aim::Target { name: "spot".into(), at: [1.0, -0.5, -6.0], tolerance: 0.8 };
        }
        let file = place.path().join("new").join(format!("own_{n}.toml"));
        task.save(&file).unwrap_or_else(|e| panic!("{}: {e}", base.display()));
        let scene = Scene::load(&file, &[]).unwrap();
        let made = scene.task.as_ref().unwrap();
        assert_eq!((made.name.as_str(), made.time_limit), ("my \"own\" task", Some(33.0)));
        let at = |wanted: &dyn Fn(&Goal) -> bool| made.goals.iter().position(wanted);
        let avoids = |g: &Goal| matches!(g, Goal::Avoid { clearance, .. } if (clearance - 0.75e-3).abs() < 1e-12);
        let region_at = at(&avoids).expect("the region to stay away from");
        assert_eq!(made.weights[region_at], 2.5);
        // What the form does not change is there: bounds of figures, shapes, the limit of the force.
        let kept =
            |g: &&Goal| matches!(g, Goal::Figure { .. } | Goal::Avoid { obstacle: Obstacle::Cylinder { .. }, .. });
        let all = |task: &Task| task.goals.iter().filter(kept).cloned().collect::<Vec<_>>();
        let had = before.task.as_ref().unwrap();
        assert!(!all(had).is_empty() && all(made) == all(had), "{:?} instead of {:?}", all(made), all(had));
        assert!(made.force_limit.is_some() && made.force_limit == had.force_limit);
        if matches!(task.way, Way::Block { .. }) {
            assert!((scene.motion.deepest() - 6e-3).abs() < 1e-12 && (scene.motion.entry.x - 1e-3).abs() < 1e-12);
            assert!((scene.motion.direction.y - 10f64.to_radians().sin()).abs() < 1e-9);
            assert!((scene.targets[0].position.z + 6e-3).abs() < 1e-12);
        }
        assert_eq!(OwnTask::from_scene(&file).unwrap().way, task.way, "the form reads what it wrote");
        let error = task.save(&file).unwrap_err().to_string();
        assert!(error.contains("there already"), "{error}");
        task.avoid = avoided("no such region", 1.0);
        let refused = place.path().join(format!("refused_{n}.toml"));
        assert!(task.save(&refused).is_err() && !refused.exists());
    }
}

/// What is not kept is switched off; a second target, a core and weights come over as they are written.
#[test]
fn a_task_of_ones_own_keeps_what_it_is_told_to_keep() {
    let place = tempfile::tempdir().unwrap();
    let text = fs::read_to_string(root().join("scenes/training/hit_target.toml")).unwrap();
    let more = "\n[[target]]\nname = \"second\"\nposition_mm = [2.0, 0.0, -5.0]\nradius_mm = 1.0\n\n[[task.goal]]\nkind = \"hit_target\"\n\
                target = \"second\"\nweight = 0.5\n";
    let base = place.path().join("base.toml");
    fs::write(&base, text.replacen("tolerance_mm = 0.75", "tolerance_mm = 0.75\nweight = 3", 1) + more).unwrap();
    let mut task = OwnTask::from_scene(&base).unwrap();
    assert_eq!((task.weight, task.kept.len()), (3.0, 2));
    task.aim = Aim::Target { name: "spot".into(), at: [0.0, 0.0, -7.0], tolerance: 0.8 };
    let figure = task.kept.iter_mut().find(|kept| matches!(kept.goal, Goal::Figure { .. })).unwrap();
    figure.on = false;
    let file = place.path().join("own.toml");
    task.save(&file).unwrap_or_else(|e| panic!("{e}"));
    let scene = Scene::load(&file, &[]).unwrap();
    let names: Vec<&str> = scene.targets.iter().map(|target| target.name.as_str()).collect();
    assert_eq!(names, ["spot", "second"]);
    let made = scene.task.unwrap();
    assert_eq!((made.goals.len(), made.weights.as_slice()), (2, &[3.0, 0.5][..]));
    assert!(matches!(made.goals[1], Goal::HitTarget { target: 1, .. }));
    for wrong in ["0", "-1", "nan", "1e9"] {
        fs::write(&base, text.replacen("tolerance_mm = 0.75", &format!("tolerance_mm = 0.75\nweight = {wrong}"), 1))
            .unwrap();
        let error = Scene::load(&base, &[]).unwrap_err().to_string();
        assert!(error.contains("task.goal.0.weight") || error.contains("weight"), "{error}");
        assert!(error.contains("base.toml"), "{error}");
    }
}

/// The share is that of the weights; passed is who has met all, whatever they weigh.
#[test]
fn a_share_is_weighted_and_a_verdict_is_not() {
    let mut some = score("t", 1, [1.0; 4]);
    assert_eq!((some.share(), some.passed()), (Some(0.5), Some(false)));
    some.goals[0].weight = 3.0;
    assert_eq!((some.share(), some.passed()), (Some(0.75), Some(false)));
    let mut all = score("t", 2, [1.0; 4]);
    all.goals[1].weight = 0.25;
    assert_eq!((all.share(), all.passed()), (Some(1.0), Some(true)));
    all.fail("stopped");
    assert_eq!(all.share(), None);
    // An attempt from before there were weights has those of 1.
    let json = some.json().replace("\"weight\": 3.0", "\"old\": 0").replace("\"weight\": 1.0", "\"old\": 0");
    assert!(!json.contains("weight"));
    let read: Score = serde_json::from_str(&json).unwrap();
    assert_eq!(read.share(), Some(0.5));
}

#[test]
fn every_habit_gets_better_with_skill_and_has_a_source() {
    for habit in HABITS {
        assert!(habit.of.is_sorted_by(|a, b| a > b), "{}", habit.key);
        assert!(habit.source.len() > 20, "{}", habit.key);
    }
    let keys: BTreeSet<&str> = HABITS.iter().map(|h| h.key).collect();
    assert_eq!(keys.len(), HABITS.len());
}

/// A small scene that an attempt goes through in a second or two.
const SMALL: [&str; 4] = [
    "tissue.cell_size_mm=1.1",
    "tissue.size_mm=[16.0, 16.0, 14.0]",
    "motion.phase.0.depth_mm=5.0",
    "puncture.path=\"free\"",
];

fn small() -> (PathBuf, Vec<String>, Scene) {
    let path = root().join("scenes/training/hit_target.toml");
    let mut overrides = SMALL.map(String::from).to_vec();
    overrides.push("target.0.position_mm=[0.0, 0.0, -5.0]".into());
    let scene = Scene::load(&path, &overrides).unwrap_or_else(|e| panic!("{e}"));
    (path, overrides, scene)
}

#[test]
fn an_attempt_is_that_of_its_seed_and_its_session_is_the_same_run() {
    let (_, overrides, scene) = small();
    let asked = AtomicBool::new(false);
    let run = |level, index| attempt(&scene, &overrides, (level, 5, index), &asked).unwrap().unwrap();
    let ((first, session), (again, _)) = (run(Level::Expert, 0), run(Level::Expert, 0));
    assert_eq!(first.figures, again.figures, "the same seed");
    let (other, _) = run(Level::Expert, 1);
    assert_ne!(first.figures, other.figures, "another trainee");
    assert!(first.frames > 100 && first.value("deepest_cut").is_some_and(|cut| cut > 3.0), "{first:?}");
    assert!(first.value("entry_error").is_some_and(|e| e > 0.0), "a free path may be missed");
    // A window that replays the session has the same forces.
    let purpose = Purpose { led: true, drawn: false, lanes: true };
    let mut simulation = Simulation::for_purpose(session.scene().unwrap(), None, purpose).unwrap();
    let mut largest = 0f64;
    for pose in &session.poses {
        simulation.lead(pose);
        largest = largest.max(simulation.next_frame().unwrap().unwrap().force.axial);
    }
    assert_eq!(first.value("peak_axial_force").map(f64::to_bits), Some(largest.to_bits()));
}

/// A hand that trembles above the skin and in the tissue, with the hollow needle: its core is in the bore, and no energy is created where torn
/// faces meet again. The first such attempts created half of their work, and none had a core.
#[test]
fn a_trembling_hand_brings_out_a_core() {
    let path = root().join("scenes/training/core_biopsy.toml");
    let scene = Scene::load(&path, &[]).unwrap_or_else(|e| panic!("{e}"));
    let (outcome, _) = attempt(&scene, &[], (Level::Novice, 1, 1), &AtomicBool::new(false)).unwrap().unwrap();
    assert_eq!((outcome.stopped.as_deref(), &outcome.reasons[..]), (None, &[][..]));
    assert!(outcome.value("core_mass").is_some_and(|mass| mass > 6.0), "{outcome:?}");
}

#[test]
fn the_report_goes_on_where_it_was_and_keeps_its_evidence() {
    let (path, overrides, _) = small();
    let place = tempfile::tempdir().unwrap();
    let (out, kept) = (place.path().join("out"), place.path().join("kept"));
    fs::create_dir(&kept).unwrap();
    fs::write(
        kept.join("key_figures.toml"),
        "# of hand\n[kind]\navoid = [\"a\", \"b\", \"c\"]\n\n[task]\nother = [\"x\", \"y\", \"z\"]\n",
    )
    .unwrap();
    let args = |attempts: u64| ReportArgs {
        name: "skills".into(),
        scene: Some(path.clone()),
        overrides: overrides.clone(),
        attempts: Some(attempts),
        seed: 3,
        out: Some(out.clone()),
        evidence: Some(kept.clone()),
        ..ReportArgs::default()
    };
    let none = AtomicBool::new(false);
    // Two a level: no interval without two.
    assert!(matches!(report(&args(6), &none).unwrap(), ReportOutcome::Page { failed: 0, .. }));
    let rows = fs::read_to_string(out.join("attempts.jsonl")).unwrap();
    assert_eq!(rows.lines().count(), 6);
    let table = fs::read_to_string(out.join("skills.csv")).unwrap();
    // A line that was cut off is run again, and comes out the same.
    fs::write(out.join("attempts.jsonl"), &rows[..rows.len() - 40]).unwrap();
    report(&args(6), &none).unwrap();
    let again = fs::read_to_string(out.join("skills.csv")).unwrap();
    let without_wall = |table: &str| -> Vec<Vec<String>> {
        let cells = |line: &str| line.split(',').enumerate().filter(|(n, _)| *n != 6).map(|(_, c)| c.into()).collect();
        table.lines().map(cells).collect()
    };
    assert_eq!(without_wall(&table), without_wall(&again));
    parsed(&fs::read_to_string(out.join("skills.html")).unwrap());
    let evidence = fs::read_to_string(kept.join("evidence.toml")).unwrap();
    assert!(evidence.contains("scene = \"hit_target\"") && evidence.contains("attempts = [2, 2, 2]"), "{evidence}");
    let figures = fs::read_to_string(kept.join("key_figures.toml")).unwrap();
    assert!(figures.starts_with("# of hand") && figures.contains("other = [\"x\", \"y\", \"z\"]"), "{figures}");
    // Another seed does not mix with these rows.
    let error = report(&ReportArgs { seed: 4, ..args(6) }, &none).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("--force"), "{error}");
    let error = report(&ReportArgs { quick: true, ..args(6) }, &none).unwrap_err();
    assert!(error.to_string().contains("--quick"), "{error}");
    let error = report(&ReportArgs { name: "lv2022".into(), ..args(6) }, &none).unwrap_err();
    assert!(error.to_string().contains("--scene"), "{error}");
    let asked = AtomicBool::new(true);
    assert!(matches!(report(&args(9), &asked).unwrap(), ReportOutcome::Interrupted { done: 6, of: 9 }));
}

/// What the repository says about its figures was made from whole attempts, and its key figures tell levels apart.
#[test]
fn the_evidence_of_the_repository_holds_together() {
    let evidence = built_in();
    assert!(!evidence.task.is_empty());
    for task in &evidence.task {
        for n in 0..3 {
            assert!(task.attempts[n] > 0 && task.passed[n] + task.stopped[n] + task.refused[n] <= task.attempts[n]);
        }
        for f in &task.figure {
            for auc in [f.novice_expert, f.novice_intermediate, f.intermediate_expert] {
                assert!(
                    0.0 <= auc.low && auc.low <= auc.value && auc.value <= auc.high && auc.high <= 1.0,
                    "{}",
                    f.key
                );
            }
        }
        for key in &task.key_figures {
            let figure = task.figure.iter().find(|f| f.key == *key).unwrap_or_else(|| panic!("{key}"));
            assert_eq!(Finding::of(&figure.novice_expert), Finding::TellsApart, "{key}");
        }
    }
}
