//! Runs that go wrong on purpose: the guard stops them, finds the place, and the failure can be seen again.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use stylet::engine::stable_dt::power_iteration;
use stylet::gpu::Gpu;
use stylet::mesh::BlockMesh;
use stylet::model::Model;
use stylet::scene::Scene;

/// A soft block with a stiff stone in it, pressed from above. The stone bounds the step.
const SCENE: &str = r#"
title = "a step that is too long for the stone"
effects = []

[tissue]
size_mm = [8.0, 8.0, 8.0]
cell_size_mm = 1.0

[material]
preset = "across-fibre"

[[region]]
name = "stone"
sphere_mm = { centre = [2.0, 1.0, -5.0], radius = 1.2 }
material = { law = "neo_hookean", c10_kpa = 1000.0, poisson_ratio = 0.45 }

[boundaries]
z_min = { fixed = ["x", "y", "z"] }
z_max = { fixed = ["x", "y", "z"], displacement_mm = [0.0, 0.0, -0.4], duration_s = 0.02 }

[solver]
duration_s = 0.02
frame_rate_hz = 2000.0
"#;

fn engines() -> &'static [&'static str] {
    let found = Gpu::open().is_ok();
    assert!(found || std::env::var_os("REQUIRE_GPU").is_none_or(|v| v != "1"), "REQUIRE_GPU=1 and no adapter");
    if found { &["gpu", "cpu"] } else { &["cpu"] }
}

/// Writes the scene with a step of `part` of the longest stable one; returns its path.
fn scene_with_step(folder: &Path, part: f64, more: &str) -> PathBuf {
    let path = folder.join("stone.toml");
    std::fs::write(&path, SCENE).unwrap();
    let scene = Scene::load(&path, &[]).unwrap();
    let mesh = BlockMesh::for_scene(&scene);
    let limit = power_iteration(&Model::new(scene, mesh));
    std::fs::write(&path, format!("{SCENE}time_step_us = {:.6}\n{more}", part * limit * 1e6)).unwrap();
    path
}

fn stylet(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_stylet")).current_dir(folder).args(arguments).output().unwrap()
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// `run stopped in frame 7 (step 123, ...`: frame and step.
fn stopped_at(text: &str) -> (u64, u64) {
    let from = text.find("run stopped in frame ").unwrap_or_else(|| panic!("{text}"));
    let numbers: Vec<u64> = text[from..]
        .split(|c: char| !c.is_ascii_digit())
        .filter(|t| !t.is_empty())
        .map(|t| t.parse().unwrap())
        .collect();
    (numbers[0], numbers[1])
}

#[test]
fn a_step_that_is_too_long_is_caught_where_it_is_too_long() {
    for engine in engines() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene_with_step(folder.path(), 1.1, "");
        let arguments = ["run", path.to_str().unwrap(), "--engine", engine, "--out", "out"];
        let output = stylet(folder.path(), &arguments);
        let text = told(&output);
        assert_eq!(output.status.code(), Some(3), "{text}");
        let (frame, step) = stopped_at(&text);
        let forensics = folder.path().join("out/forensics");
        for file in ["report.txt", "steps.csv", "last_energies.csv", "place.png", "checkpoint.stylet"] {
            assert!(forensics.join(file).metadata().is_ok_and(|m| m.len() > 40), "{file}\n{text}");
        }
        let finding: serde_json::Value =
            serde_json::from_slice(&std::fs::read(forensics.join("finding.json")).unwrap()).unwrap();
        println!("{engine}: stopped in frame {frame}, step {step}; {finding:#}");
        // The first sign comes before the stop, by ten frames at most (17 steps each at least).
        let first = finding["step"].as_u64().unwrap();
        let per_frame = step / frame.max(1) + 1;
        assert!(first <= step && step - first <= 10 * per_frame, "first sign in step {first}, stop in {step}");
        // It began at the stone.
        let place: Vec<f64> = finding["place_m"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        let distance = ((place[0] - 2e-3).powi(2) + (place[1] - 1e-3).powi(2) + (place[2] + 5e-3).powi(2)).sqrt();
        assert!(distance < 1.2e-3, "cell at {place:?}, {distance} m from the middle of the stone");
        assert!(finding["acting"][0].as_str().unwrap().contains("\"stone\""), "{finding}");
        // What was written before is whole.
        let rows = std::fs::read_to_string(folder.path().join("out/force.csv")).unwrap();
        assert!(rows.lines().count() as u64 >= frame, "{} rows", rows.lines().count());
        assert!(folder.path().join("out/summary.json").exists());
        // It can be seen again, in the same step, as often as wanted.
        for _ in 0..2 {
            let again = stylet(folder.path(), &["run", "--resume", "out/forensics"]);
            assert_eq!(again.status.code(), Some(3), "{}", told(&again));
            assert_eq!(stopped_at(&told(&again)), (frame, step), "{}", told(&again));
        }
    }
}

#[test]
fn a_scene_may_ask_for_half_the_step() {
    for engine in engines() {
        let folder = tempfile::tempdir().unwrap();
        let path = scene_with_step(folder.path(), 1.1, "on_trouble = \"halve_step\"\n");
        let output = stylet(folder.path(), &["run", path.to_str().unwrap(), "--engine", engine, "--out", "halved"]);
        let text = told(&output);
        assert!(output.status.success(), "{text}");
        assert!(text.contains("halve_step") && text.contains("(1 of 4)"), "{text}");
        let summary = |name: &str| -> serde_json::Value {
            serde_json::from_slice(&std::fs::read(folder.path().join(name).join("summary.json")).unwrap()).unwrap()
        };
        let halved = summary("halved");
        assert_eq!(halved["halvings"], 1, "{halved}");
        // The same end as a run with the short step from the beginning.
        let path = scene_with_step(folder.path(), 0.55, "");
        let output = stylet(folder.path(), &["run", path.to_str().unwrap(), "--engine", engine, "--out", "short"]);
        assert!(output.status.success(), "{}", told(&output));
        let short = summary("short");
        let dt = |s: &serde_json::Value| s["dt_s"].as_f64().unwrap();
        assert!((dt(&halved) / dt(&short) - 1.0).abs() < 0.05, "whole numbers of steps per frame");
        let last = |name: &str| -> Vec<f64> {
            let text = std::fs::read_to_string(folder.path().join(name).join("sample.csv")).unwrap();
            text.lines().last().unwrap().split(',').filter_map(|v| v.parse().ok()).collect()
        };
        let (a, b) = (last("halved"), last("short"));
        println!("{engine}: {a:?} against {b:?}");
        assert!(a.len() == b.len() && a.len() > 5);
        let largest = b.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() < 0.1 * largest, "{a} against {b}");
        }
    }
}
