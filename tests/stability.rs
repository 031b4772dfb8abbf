//! The stability suite in its short form on both engines, the cases without their cure, and the command as a user calls it.

use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::atomic::AtomicBool;

use assert_cmd::cargo::CommandCargoExt;
use serde_json::Value;
use stylet::effects::puncture::SchemeWord;
use stylet::gpu::Gpu;
use stylet::mesh::Mesh;
use stylet::model::Model;
use stylet::simulation::EngineChoice;
use stylet::stability::random::{self, RandomOptions, RandomScene};
use stylet::stability::{CASES, EngineReport, Options, Suite, run};

fn options(without_cure: bool) -> Options {
    Options {
        only: Vec::new(),
        short: true,
        without_cure,
        scenes: Some(PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes")),
    }
}

/// True where an adapter can be opened; `REQUIRE_GPU=1` turns its absence into a failure.
fn has_gpu() -> bool {
    match Gpu::open() {
        Ok(gpu) => {
            println!("adapter: {} ({} {})", gpu.info.name, gpu.info.driver, gpu.info.driver_info);
            true
        }
        Err(error) if std::env::var("REQUIRE_GPU").is_ok_and(|v| v == "1") => panic!("REQUIRE_GPU=1, but {error}"),
        Err(error) => {
            println!("skipped: no adapter ({error})");
            false
        }
    }
}

/// The short form; its table must fit a terminal.
fn short_form(engine: EngineChoice, without_cure: bool) -> EngineReport {
    let report = run(&options(without_cure), engine, &mut |_| (), &AtomicBool::new(false)).unwrap();
    println!("{}", report.table());
    for line in report.table().lines() {
        assert!(line.chars().count() <= 80, "{line:?}");
    }
    report
}

fn every_case_comes_out_as_it_must(engine: EngineChoice) {
    let report = short_form(engine, false);
    assert_eq!(report.cases.len(), CASES.len());
    assert_eq!(report.surprises(), [""; 0]);
}

#[test]
fn the_suite_holds_in_f64() {
    every_case_comes_out_as_it_must(EngineChoice::Cpu);
}

#[test]
fn the_suite_holds_on_the_gpu() {
    if has_gpu() {
        every_case_comes_out_as_it_must(EngineChoice::Gpu);
    }
}

/// What a bound is worth: without the cure the same bound is missed.
#[test]
fn no_case_holds_without_its_cure() {
    let engine = if has_gpu() { EngineChoice::Gpu } else { EngineChoice::Cpu };
    let report = short_form(engine, true);
    assert!(report.cases.len() >= 10, "{}", report.cases.len());
    assert!(report.surprises().is_empty(), "{:?}", report.surprises());
    assert!(report.cases.iter().all(|case| !case.problems.is_empty()));
}

#[test]
fn a_case_that_fails_is_told_with_its_reason() {
    let options = Options { only: vec!["plastic_100".into()], ..options(true) };
    let report = run(&options, EngineChoice::Cpu, &mut |_| (), &AtomicBool::new(false)).unwrap();
    let table = report.table();
    assert!(table.contains("FAILS") && table.contains("plastic_100: "), "{table}");
    assert!(Suite::new(&options, vec![report]).as_expected);
}

#[test]
fn a_stopped_suite_keeps_what_is_done() {
    let report = run(&options(false), EngineChoice::Cpu, &mut |_| (), &AtomicBool::new(true)).unwrap();
    assert!(report.interrupted && report.cases.is_empty());
    assert!(report.table().ends_with("interrupted"), "{}", report.table());
}

/// `stylet stability` in the repository.
fn stability(args: &[&str]) -> Output {
    let mut command = Command::cargo_bin("stylet").unwrap();
    command.current_dir(env!("CARGO_MANIFEST_DIR")).arg("stability").args(args);
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn the_command_prints_json_and_writes_both_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("results");
    let arguments = ["--short", "--json", "--engine", "cpu", "--only", "table1", "--only", "negative_c01", "--out"];
    let output = stability(&[&arguments[..], &[out.to_str().unwrap()]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((json["short"].as_str(), json["as_expected"].as_bool()), (Some("short"), Some(true)));
    let cases = json["engines"][0]["cases"].as_array().unwrap();
    assert_eq!(cases.len(), 2);
    // In the order of the table, whatever the order of the names.
    assert_eq!((&cases[0]["name"], &cases[0]["verdict"]), (&"negative_c01".into(), &"holds".into()));
    assert_eq!((&cases[1]["name"], &cases[1]["verdict"]), (&"table1".into(), &"refused".into()));
    assert!(cases[1]["imbalance"].is_null());
    let caught = &cases[0]["runs"][1];
    assert_eq!(caught["verdict"], "caught");
    assert!(caught["message"].as_str().unwrap().contains("principal stretch"));
    let table = std::fs::read_to_string(out.join("stability.txt")).unwrap();
    assert!(table.contains("negative_c01") && table.contains("1 refused"), "{table}");
    let written: Value = serde_json::from_slice(&std::fs::read(out.join("stability.json")).unwrap()).unwrap();
    assert_eq!(written, json);
}

#[test]
fn the_list_names_every_case() {
    let output = stability(&["--list"]);
    assert_eq!(output.status.code(), Some(0));
    let list = text(&output.stdout);
    assert!(list.lines().all(|line| line.chars().count() <= 80), "{list}");
    assert!(CASES.iter().all(|case| list.contains(case.name)));
}

#[test]
fn wrong_calls_are_refused() {
    for (args, expected) in [
        (&["--only", "twist"][..], &["no stability case `twist`", "twist_270"][..]),
        (&["--engine", "fast"], &["auto, gpu, cpu, cpu64 or both"]),
        (&["--scenes", "assets", "--only", "rest"], &["no scene", "--scenes"]),
        (&["--list", "--json"], &["cannot be used with"]),
    ] {
        let output = stability(args);
        let error = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {error}");
        assert!(expected.iter().all(|e| error.contains(e)), "{args:?}: {error}");
    }
}

/// Random scenes of this seed, made in a folder of their own.
fn random_scenes(seed: u64, indices: std::ops::Range<u64>) -> (tempfile::TempDir, Vec<RandomScene>) {
    let folder = tempfile::tempdir().unwrap();
    let scenes = indices.map(|index| RandomScene::make(seed, index, folder.path()).unwrap()).collect();
    (folder, scenes)
}

#[test]
fn a_seed_gives_the_same_random_scenes() {
    let ((_a, first), (_b, second)) = (random_scenes(11, 0..25), random_scenes(11, 0..25));
    for (a, b) in first.iter().zip(&second) {
        assert_eq!(a.text, b.text);
        assert_eq!((&a.mesh, a.mistake), (&b.mesh, b.mistake));
    }
    // One alone is the same as in its row, and another seed has others.
    assert_eq!(random_scenes(11, 17..18).1[0].text, first[17].text);
    let body = |scene: &RandomScene| scene.text.lines().skip(1).collect::<Vec<_>>().join("\n");
    let other = random_scenes(12, 0..25).1;
    assert!(first.iter().zip(&other).all(|(a, b)| body(a) != body(b)));
}

/// Needles that can open their path do so in a part of the scenes, with a toughness of every material.
#[test]
fn some_random_needles_open_their_path() {
    let (folder, scenes) = random_scenes(1, 0..80);
    let mut opened = [0; 2];
    for scene in scenes.iter().filter(|scene| scene.mistake.is_none()) {
        let Ok(read) = scene.scene(folder.path()) else { continue };
        if read.effects.puncture.is_some_and(|p| p.scheme == SchemeWord::Opening) {
            let model = Model::new(read.clone(), Mesh::of_scene(&read));
            assert!(model.opening().is_some_and(|plan| !plan.cells.is_empty()), "{}", scene.text);
            opened[usize::from(!read.regions.is_empty())] += 1;
        }
    }
    println!("{opened:?} of 80 scenes open their path, in one material and in several");
    assert!(opened[0] >= 4 && opened[1] >= 2, "{opened:?}");
}

/// 200 seeds, one scene of each: read, or refused with a way out; a mistake is refused for what it is. All effects, laws, tools and kinds of
/// phase come up.
#[test]
fn random_scenes_are_read_or_refused_with_a_way_out() {
    let folder = tempfile::tempdir().unwrap();
    let (mut read, mut text, mut mistakes) = (0, String::new(), 0);
    for seed in 0..200 {
        let scene = RandomScene::make(seed, seed % 7, folder.path()).unwrap();
        match scene.scene(folder.path()) {
            Ok(_) => {
                assert_eq!(scene.mistake, None, "seed {seed}: nobody saw the mistake\n{}", scene.text);
                read += 1;
            }
            Err(error) => {
                let told = error.to_string();
                assert_eq!(error.exit_code(), 2);
                assert!(told.contains("way out: "), "seed {seed}: {told}");
                if let Some(expected) = scene.mistake {
                    assert!(told.contains(expected), "seed {seed}: `{expected}` is missing in\n{told}");
                    mistakes += 1;
                }
            }
        }
        text += &scene.text;
    }
    assert!(read >= 160 && mistakes >= 3, "{read} of 200 were read, {mistakes} mistakes refused");
    let wanted = stylet::effects::EFFECTS.iter().map(|effect| format!("\"{}\"", effect.key));
    let laws = ["neo_hookean", "mooney_rivlin", "yeoh", "ogden", "demiray"].map(|law| format!("law = \"{law}\""));
    let words = [
        "bevel_angle_deg",
        "bore_diameter_mm",
        "[sphere]",
        "[flat_punch]",
        "mesh = ",
        "traction_kpa",
        "rotation_deg",
        "layer_mm",
        "sphere_mm",
        "cylinder_mm",
        "membrane",
        "[[cohesive.plane]]",
        "\"withdraw\"",
        "\"hold\"",
        "\"move\"",
        "\"turn\"",
        "\"reposition\"",
        "path = \"free\"",
        "[motion.vibration]",
        "time_step_us",
        "mass_scaling = \"auto\"",
        "axis_offset_cells",
        "[[target]]",
        "preset = ",
        "poisson_ratio",
        "bulk_modulus_kpa",
        "d_per_mpa",
        "youngs_modulus_kpa",
    ];
    for word in wanted.chain(laws).chain(words.map(String::from)) {
        assert!(text.contains(&word), "no scene of 200 has {word}");
    }
}

#[test]
fn a_few_random_scenes_end_as_they_may() {
    let mut engines = vec![EngineChoice::Cpu];
    if has_gpu() {
        engines.insert(0, EngineChoice::Gpu);
    }
    let keep = tempfile::tempdir().unwrap();
    let options = RandomOptions { count: 6, seed: 3, only: Vec::new(), engines, keep: Some(keep.path().to_path_buf()) };
    let mut lines = Vec::new();
    let report = random::run(&options, &mut |_| (), &mut |scene| lines.push(scene.line()), &AtomicBool::new(false));
    let report = report.unwrap();
    println!("{}\n{}", lines.join("\n"), report.table());
    assert_eq!(report.scenes.len(), 6);
    assert_eq!(report.problems(), [""; 0]);
    // What ended other than ok lies there with its head, and is the same scene.
    for scene in report.scenes.iter().filter(|scene| !scene.is_plain()) {
        let path = keep.path().join(format!("random_3_{}.toml", scene.index));
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.starts_with(&format!("# random scene, seed 3, index {}; reasonable: ", scene.index)), "{text}");
    }
}
