//! `stylet report` as a user calls it, and the scenes that it runs.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use assert_cmd::cargo::CommandCargoExt;
use serde_json::Value;

/// Runs of a second each on either engine.
const SHORT: [&str; 4] = ["--quick", "--set", "motion.phase.0.depth_mm=5", "--engine=cpu"];
const CASES: [&str; 3] = ["speed_2", "speed_5", "speed_10"];

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn call(arguments: &[&str]) -> Output {
    Command::cargo_bin("stylet").unwrap().current_dir(repository()).arg("report").args(arguments).output().unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The short report into a folder, with further arguments.
fn short(out: &Path, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let arguments: Vec<&str> =
        ["lv2022", "--out", out.as_str()].into_iter().chain(SHORT).chain(more.to_vec()).collect();
    call(&arguments)
}

fn page(out: &Path) -> String {
    std::fs::read_to_string(out.join("lv2022.html")).unwrap()
}

/// Every number and text of a JSON value as it is written.
fn leaves(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::Null => {}
        Value::String(text) => found.push(text.clone()),
        Value::Array(items) => items.iter().for_each(|item| leaves(item, found)),
        Value::Object(map) => map.values().for_each(|item| leaves(item, found)),
        other => found.push(other.to_string()),
    }
}

#[test]
fn one_page_holds_everything_and_finished_runs_are_reused() {
    let base = tempfile::tempdir().unwrap();
    let out = base.path().join("report");
    let output = short(&out, &[]);
    assert!(output.status.success(), "{}", errors(&output));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), out.join("lv2022.html").display().to_string());
    let text = page(&out);

    // Well-formed, and in need of nothing: no link but to its own sections, pictures inside.
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&text, options).unwrap();
    assert!(!text.contains("http") && !text.contains("url(") && !text.contains("@import"));
    let mut pictures = 0;
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        for attribute in node.attributes() {
            assert!(!attribute.name().starts_with("on"), "{}", attribute.name());
            match attribute.name() {
                "href" => {
                    let id = attribute.value().strip_prefix('#').expect("a link within the page");
                    assert!(document.descendants().any(|n| n.attribute("id") == Some(id)), "{id}");
                }
                "src" => {
                    assert!(attribute.value().starts_with("data:image/png;base64,iVBORw0KGgo"));
                    pictures += 1;
                }
                _ => {}
            }
        }
        assert!(!["script", "link", "iframe"].contains(&node.tag_name().name()));
    }
    // Fig. 9: 0.5, 3, 5 mm; Fig. 11: 3 mm at three speeds. 6, 9 and 12 mm are not reached here.
    assert_eq!(pictures, 6);
    assert!(text.contains("12 mm: not reached by this run"));
    assert!(text.contains("A quick look on coarse cells") && text.contains("motion.phase.0.depth_mm=5"));
    // No comparison with the paper, so no verdict, good or bad.
    assert!(text.contains("not judged") && text.contains("Not judged: these are not the scenes as they are"));
    assert!(!text.contains("of the measured</span>") && !text.contains("of the measured force."));
    // The text of a picture may hold these letters by chance.
    let without_pictures: String =
        text.split("data:image/png;base64,").map(|part| &part[part.find('"').unwrap_or(0)..]).collect();
    assert!(!without_pictures.contains("NaN"));

    // Every figure of every run, as its file has it, and the numbers of the paper.
    for case in CASES {
        let summary = std::fs::read_to_string(out.join(case).join("summary.json")).unwrap();
        let summary: Value = serde_json::from_str(&summary).unwrap();
        let mut found = Vec::new();
        leaves(&summary, &mut found);
        assert!(found.len() > 30, "{found:?}");
        for value in found {
            assert!(text.contains(&value), "{case}: {value}");
        }
        for key in summary.as_object().unwrap().keys() {
            assert!(text.contains(&format!("<td>{key}</td>")), "{key}");
        }
        assert!(out.join(case).join("force_parts.svg").exists());
    }
    for number in ["1.28", "1.21", "1.36", "1.35", "1.33"] {
        assert!(text.contains(&format!("<td class=\"number\">{number}</td>")), "{number}");
    }

    // The same call computes nothing; what has changed or is broken is computed again, and nothing else.
    let before = std::fs::read(out.join("speed_2/summary.json")).unwrap();
    let output = short(&out, &[]);
    assert!(output.status.success());
    assert_eq!(errors(&output).matches("reused").count(), 3, "{}", errors(&output));
    std::fs::remove_file(out.join("speed_5/summary.json")).unwrap();
    std::fs::remove_file(out.join("lv2022.html")).unwrap();
    let output = short(&out, &[]);
    assert!(output.status.success());
    assert_eq!(errors(&output).matches("reused").count(), 2, "{}", errors(&output));
    assert_eq!(std::fs::read(out.join("speed_2/summary.json")).unwrap(), before);
    page(&out);
    let output = short(&out, &["--set", "motion.phase.0.depth_mm=2"]);
    assert!(output.status.success());
    assert_eq!(errors(&output).matches("have changed").count(), 3, "{}", errors(&output));
    assert_ne!(std::fs::read(out.join("speed_2/summary.json")).unwrap(), before);
}

#[test]
fn a_hollow_needle_has_a_section_where_its_scene_exists() {
    let base = tempfile::tempdir().unwrap();
    let scenes = base.path().join("scenes");
    std::fs::create_dir(&scenes).unwrap();
    // As coarse as a quick look, which leaves the hollow needle out.
    for case in CASES.into_iter().chain(["hollow"]) {
        let from = if case == "hollow" { "speed_10" } else { case };
        let text = std::fs::read_to_string(repository().join(format!("scenes/lv2022/{from}.toml"))).unwrap();
        std::fs::write(scenes.join(format!("{case}.toml")), text).unwrap();
    }
    let out = base.path().join("out");
    let (folder, scenes) = (out.display().to_string(), scenes.display().to_string());
    let arguments = ["lv2022", "--out", &folder, "--scenes", &scenes, "--engine=cpu"];
    let sets = ["--set", "tissue.cell_size_mm=1.2", "--set", "motion.phase.0.depth_mm=3"];
    let output = call(&[&arguments[..], &sets].concat());
    assert!(output.status.success(), "{}", errors(&output));
    assert!(page(&out).contains("The run tells nothing about a core."));

    // What a run of a hollow needle adds to its files.
    let summary = out.join("hollow/summary.json");
    let text = std::fs::read_to_string(&summary).unwrap();
    std::fs::write(&summary, text.replace("\"core_length_m\": null", "\"core_length_m\": 0.00425")).unwrap();
    std::fs::write(
        out.join("hollow/core.csv"),
        "time_s,depth_m,tip_coordinate_m,length_m,rest_length_m,strain,mass_kg,severed\n\
         0.1,0.001,0.001,0,0,0,0,0\n0.2,0.002,0.002,0.001,0.0011,-0.09,1e-6,0\n",
    )
    .unwrap();
    let output = call(&[&arguments[..], &sets].concat());
    assert_eq!(errors(&output).matches("reused").count(), 4, "{}", errors(&output));
    let text = page(&out);
    assert!(text.contains("<td>length in the bore, mm</td><td class=\"number\">4.25</td>"));
    assert!(text.contains("length of the core [mm]") && !text.contains("all its needles are solid"));
}

#[test]
fn a_failed_run_stops_neither_the_others_nor_the_page() {
    let base = tempfile::tempdir().unwrap();
    // A step far above the stable one, without mass scaling to save it.
    let sets = ["motion.phase.0.depth_mm=2", "solver.time_step_us=1000", "effects=[\"puncture\", \"friction\"]"];
    let sets: Vec<&str> = sets.into_iter().flat_map(|set| ["--set", set]).collect();
    let output = short(base.path(), &sets);
    assert_eq!(output.status.code(), Some(3), "{}", errors(&output));
    let text = page(base.path());
    assert!(text.contains("Not all runs came to their end") && text.contains("the run ended early"));
}

#[cfg(unix)]
#[test]
fn an_interrupted_report_goes_on_from_the_finished_runs() {
    let base = tempfile::tempdir().unwrap();
    let out = base.path().join("report");
    let output = short(&out, &["--set", "motion.phase.0.depth_mm=2"]);
    assert!(output.status.success(), "{}", errors(&output));
    let mut child = Command::cargo_bin("stylet")
        .unwrap()
        .current_dir(repository())
        .args(["report", "lv2022", "--out", &out.display().to_string()])
        .args(SHORT)
        .args(["--set", "motion.phase.0.depth_mm=2", "--set", "solver.frame_rate_hz=5000"])
        .stderr(std::process::Stdio::piped())
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let table = out.join("speed_2/force.csv");
    let begin = std::time::Instant::now();
    let rows = || std::fs::read_to_string(&table).map_or(0, |t| t.lines().count());
    // The old table has 61 rows.
    while !(3..40).contains(&rows()) && rows() < 70 {
        assert!(begin.elapsed().as_secs() < 60, "no frame in a minute");
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    // The first run was stopped; the other two are still those of the first call.
    let output = short(&out, &["--set", "motion.phase.0.depth_mm=2"]);
    assert!(output.status.success(), "{}", errors(&output));
    assert_eq!(errors(&output).matches("reused").count(), 2, "{}", errors(&output));
}

#[test]
fn wrong_calls_end_with_2_and_a_way_out() {
    let base = tempfile::tempdir().unwrap();
    let foreign = base.path().join("foreign");
    std::fs::create_dir_all(foreign.join("speed_2")).unwrap();
    let foreign = foreign.display().to_string();
    let nowhere = base.path().join("nowhere").display().to_string();
    let out = base.path().join("out").display().to_string();
    for (arguments, texts) in [
        (&["lv2021"][..], &["there is no report `lv2021`", "lv2022"][..]),
        (&["lv2022", "--out", &foreign], &["foreign", "--force"]),
        (&["lv2022", "--scenes", &nowhere, "--out", &out], &["speed_2.toml", "--scenes"]),
        (&["lv2022", "--set", "tissue.cell=1", "--out", &out], &["tissue.cell", "cell_size_mm"]),
    ] {
        let output = call(arguments);
        let message = errors(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains("error: ") && message.contains("way out: "), "{message}");
        assert!(texts.iter().all(|text| message.contains(text)), "{message}");
        assert!(output.stdout.is_empty() && !Path::new(&out).exists());
    }
}

#[test]
fn the_scenes_differ_in_speed_and_outputs_only() {
    let read = |name: &str| -> toml::Table {
        let path = repository().join("scenes").join(name);
        std::fs::read_to_string(&path).unwrap().parse().unwrap()
    };
    let main_job = read("muscle_biopsy.toml");
    for (case, speed) in CASES.into_iter().zip([2.0, 5.0, 10.0]) {
        let mut scene = read(&format!("lv2022/{case}.toml"));
        for table in ["effects", "tissue", "material", "needle", "puncture", "friction"] {
            assert_eq!(scene.get(table), main_job.get(table), "{case}: {table}");
        }
        let motion = scene["motion"].as_table().unwrap();
        for key in ["entry_mm", "direction"] {
            assert_eq!(motion[key], main_job["motion"][key], "{case}: {key}");
        }
        let phases = motion["phase"].as_array().unwrap();
        assert_eq!(phases.len(), 1);
        assert_eq!(phases[0]["kind"].as_str(), Some("insert"));
        assert_eq!(phases[0]["speed_mm_s"].as_float(), Some(speed));
        assert_eq!(phases[0]["depth_mm"].as_float(), Some(12.0));
        // The step follows from the speed by one rule, and a frame is the same travel at every speed.
        let solver = scene["solver"].as_table().unwrap();
        assert_eq!(solver["mass_scaling"].as_str(), Some("auto"));
        assert_eq!(solver["frame_rate_hz"].as_float(), Some(30.0 * speed));
        assert_eq!(solver.len(), 2);
        for table in ["title", "effects", "tissue", "material", "needle", "puncture", "friction"] {
            scene.remove(table);
        }
        let rest: Vec<&str> = scene.keys().map(String::as_str).collect();
        assert_eq!(rest, ["motion", "outputs", "solver"], "{case}");
        let outputs = scene["outputs"].as_table().unwrap();
        assert_eq!(outputs["stress_scale_kpa"].as_float(), Some(40.0), "one colour bar for all");
    }
}
