//! `stylet study` and `stylet advise`: the arithmetic on data with known answers, and the program as a user calls it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use assert_cmd::cargo::CommandCargoExt;
use serde_json::Value;
use stylet::output::curve::interpolated;
use stylet::study::advice::{Candidate, sentences};
use stylet::study::metrics::{curve_error, field_error};
use stylet::study::order::{fit, richardson};
use stylet::study::pareto::front;
use stylet::study::plan::{Basis, Choice, Costs, Role, UnitCost, choose, shard};
use stylet::study::subject::Variant;
use stylet::study::{Axis, Engine, MeshSize, Settings};
use tempfile::TempDir;

/// A scene that runs in a fraction of a second on the CPU engine.
const TINY: &str = r#"title = "tiny"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
size_mm = [14.0, 14.0, 9.0]
cell_size_mm = 1.2
[material]
preset = "across-fibre"
[needle]
gauge = "16G"
tip_half_angle_deg = 18.0
[[motion.phase]]
kind = "insert"
speed_mm_s = 4.0
depth_mm = 3.0
[[motion.phase]]
kind = "withdraw"
speed_mm_s = 2.0
depth_mm = 0.0
[solver]
mass_scaling = 40000
"#;

/// Arguments of a study of seconds.
const SHORT: [&str; 4] = ["--engine", "cpu", "--budget", "0.2"];

fn base() -> Settings {
    Settings {
        cell_size_mm: 0.6,
        mass_scaling: 4000.0,
        safety: 0.8,
        engine: Engine::Gpu,
        effects: ["mass_scaling", "puncture", "friction"].map(String::from).to_vec(),
        repetition: 0,
    }
}

/// A graded block: cells grow with the inverse cube of their edge, steps fall with it.
fn size_of(edge: f64) -> Result<MeshSize, String> {
    if edge < 0.1 {
        return Err("too fine for the memory".into());
    }
    Ok(MeshSize { cells: (7000.0 * (0.6 / edge).powi(3)) as u64, unit_step_s: 8e-6 * edge / 0.6 })
}

fn variants() -> Vec<Variant> {
    let effects = ["mass_scaling", "puncture"].map(String::from).to_vec();
    vec![Variant { keys: vec!["friction".into()], added: false, effects }]
}

fn planned(axes: &[Axis], budget_s: f64) -> stylet::Result<Choice> {
    let (base, variants) = (base(), variants());
    let basis = Basis { base: &base, duration_s: 6.0, frame_rate: 60.0, has_block: true, variants: &variants };
    choose(&basis, axes, budget_s, &Costs::assumed(), &mut size_of)
}

#[test]
fn errors_of_curves_and_fields_are_known() {
    let curve = |scale: f64, step: f64| -> Vec<(f64, f64)> {
        (0..=(0.012 / step) as usize).map(|i| i as f64 * step).map(|d| (d, scale * (1.0 + 80.0 * d))).collect()
    };
    // Linear between its points, so another spacing changes nothing.
    for step in [1e-4, 3e-4] {
        let error = curve_error(&curve(1.03, step), &curve(1.0, 1e-4)).unwrap();
        assert!((error - 0.03).abs() < 1e-12, "{error}");
    }
    assert_eq!(curve_error(&curve(1.0, 1e-4), &curve(1.0, 1e-4)), Some(0.0));
    // A constant difference of 0.1 N on a curve that grows from 0 to 1: 0.1 sqrt(3).
    let ramp: Vec<(f64, f64)> = (0..=1000).map(|i| (f64::from(i), f64::from(i) / 1000.0)).collect();
    let shifted: Vec<(f64, f64)> = ramp.iter().map(|(d, f)| (*d, f + 0.1)).collect();
    let error = curve_error(&shifted, &ramp).unwrap();
    assert!((error - 0.1 * 3f64.sqrt()).abs() < 1e-6, "{error}");
    // Only depths that both hold count; without any there is no error to tell.
    assert_eq!(curve_error(&ramp[..500], &ramp), Some(0.0));
    assert_eq!(curve_error(&[], &ramp), None);
    assert_eq!(interpolated(&ramp, -1.0), None);
    assert_eq!(interpolated(&ramp, 250.5), Some(0.2505));

    let field = vec![[1.0, 2.0, 2.0], [0.0, 3.0, 4.0]];
    let double: Vec<[f64; 3]> = field.iter().map(|v| v.map(|x| 1.5 * x)).collect();
    assert!((field_error(&double, &field).unwrap() - 0.5).abs() < 1e-12);
    assert_eq!(field_error(&field[..1], &field), None);
    assert_eq!(field_error(&[[0.0; 3]], &[[0.0; 3]]), None);
}

#[test]
fn a_known_order_is_found_and_none_is_not() {
    let edges = [0.3, 0.42, 0.6, 0.85, 1.2];
    let errors: Vec<(f64, f64)> = edges.iter().map(|h: &f64| (*h, 0.04 * h.powf(1.7))).collect();
    let found = fit(&errors).unwrap();
    assert!((found.order - 1.7).abs() < 1e-9 && (found.error_at_1mm - 0.04).abs() < 1e-9, "{found:?}");
    assert!(found.r2 > 0.999999 && found.points == 5 && found.converges());
    let wild = [(0.3, 0.03), (0.42, 0.01), (0.6, 0.05), (0.85, 0.02), (1.2, 0.03)];
    assert!(!fit(&wild).unwrap().converges());
    assert!(fit(&errors[..2]).is_none());

    // f = 1.3 + 0.2 h^p on meshes whose edges have no common ratio.
    for p in [0.7, 1.0, 2.0, 3.3] {
        let meshes = [0.31, 0.44, 0.71].map(|h: f64| (h, 1.3 + 0.2 * h.powf(p)));
        let found = richardson(meshes).unwrap();
        assert!((found.order - p).abs() < 1e-6 && (found.limit - 1.3).abs() < 1e-6, "{p}: {found:?}");
        assert!((found.error_of_finest - 0.2 * 0.31f64.powf(p) / 1.3).abs() < 1e-6);
    }
    assert!(richardson([(0.3, 1.2), (0.42, 1.3), (0.6, 1.25)]).is_none(), "not from one side");
    assert!(richardson([(0.3, 1.0), (0.42, 1.2), (0.6, 1.2)]).is_none(), "two equal values");
}

#[test]
fn the_front_is_what_nothing_beats() {
    let points = [(1.0, 5.0), (2.0, 3.0), (2.5, 3.0), (3.0, 4.0), (4.0, 1.0), (f64::NAN, 0.0), (4.0, 1.0)];
    assert_eq!(front(&points), [true, true, false, false, true, false, false]);
    assert!(front(&[]).is_empty());
}

#[test]
fn plans_keep_their_budget_and_have_a_better_reference() {
    let mut last = 0;
    for minutes in [2.0, 5.0, 20.0, 60.0] {
        let choice = planned(&Axis::ALL, 60.0 * minutes).unwrap();
        let total: f64 = choice.runs.iter().map(|run| run.predicted_s).sum();
        assert!(total <= 60.0 * minutes, "{total} s of {minutes} min");
        assert!(choice.runs.len() >= last, "more time, fewer runs");
        last = choice.runs.len();
        let reference = choice.runs.iter().find(|run| run.role == Role::Reference).unwrap();
        assert!(reference.settings.cell_size_mm <= 0.6 && reference.settings.mass_scaling < 4000.0, "{reference:?}");
        assert!(choice.runs.iter().all(|run| run.settings.cell_size_mm >= reference.settings.cell_size_mm));
        assert_eq!(choice.runs[0].settings, base());
        let mut ids: Vec<&str> = choice.runs.iter().map(|run| run.id.as_str()).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), choice.runs.len(), "a name per run");
        assert_eq!(planned(&Axis::ALL, 60.0 * minutes).unwrap(), choice, "the same every time");
    }
    let roles: Vec<Role> = planned(&Axis::ALL, 1e6).unwrap().runs.iter().map(|run| run.role).collect();
    for role in [Role::Mesh, Role::Mass, Role::Step, Role::Engine, Role::Effects, Role::Grid, Role::Again] {
        assert!(roles.contains(&role), "{role:?}");
    }
    // Axes without the mesh keep it.
    assert!(planned(&[Axis::Effects], 600.0).unwrap().runs.iter().all(|run| run.settings.cell_size_mm == 0.6));
    let mass = planned(&[Axis::Mass], 600.0).unwrap();
    assert!(mass.runs.iter().all(|run| run.settings.cell_size_mm == 0.6));
    let message = planned(&Axis::ALL, 10.0).unwrap_err().to_string();
    assert!(message.contains("no reference") && message.contains("--budget"), "{message}");
}

#[test]
fn the_cost_of_a_step_is_a_line_through_two_meshes() {
    let cost = UnitCost::through((1000, 150e-6), (5000, 350e-6));
    assert!((cost.cell_step_s - 50e-9).abs() < 1e-15 && (cost.of_step(3000) - 250e-6).abs() < 1e-12);
    // Noise: the small mesh measured slower than the large one, or much too fast.
    for small in [500e-6, 1e-6] {
        let cost = UnitCost::through((1000, small), (5000, 350e-6));
        assert!(cost.step_s >= 0.0 && cost.cell_step_s > 0.0, "{cost:?}");
        assert!((cost.of_step(5000) - 350e-6).abs() < 1e-12);
    }
}

#[test]
fn parts_hold_every_run_once() {
    let choice = planned(&Axis::ALL, 1200.0).unwrap();
    let total: f64 = choice.runs.iter().map(|run| run.predicted_s).sum();
    for of in [1, 2, 3, 5, 40] {
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        let mut longest: f64 = 0.0;
        for part in 1..=of {
            let runs = shard(&choice.runs, part, of);
            longest = longest.max(runs.iter().map(|run| run.predicted_s).sum());
            let base = runs.iter().any(|run| run.role == Role::Base);
            assert_eq!(base, runs.iter().any(|run| run.role == Role::Again), "the base and its repetition are apart");
            runs.iter().for_each(|run| *seen.entry(&run.id).or_default() += 1);
        }
        assert_eq!(seen.len(), choice.runs.len());
        assert!(seen.values().all(|count| *count == 1), "{seen:?}");
        let single = choice.runs.iter().map(|run| run.predicted_s).fold(0.0, f64::max);
        assert!(longest <= total / of as f64 + single, "{longest} s of {total} s in {of} parts");
    }
}

#[test]
fn sentences_say_what_there_is() {
    let candidate = |cell_size_mm, real_time_factor, error| Candidate {
        settings: Settings { cell_size_mm, ..base() },
        real_time_factor,
        error,
        same_mesh: cell_size_mm == 0.3,
    };
    let all =
        [candidate(1.2, 6.0, 0.08), candidate(0.85, 1.4, 0.031), candidate(0.6, 0.5, 0.02), candidate(0.3, 0.1, 0.008)];
    let told = sentences("an adapter", &all);
    assert!(told[0].starts_with("For real time on an adapter choose cells of 0.85 mm"), "{told:?}");
    assert!(told[0].contains("3.10 %"), "{told:?}");
    // The mesh of the reference is no answer to how accurate a mesh is: its own error is not in the number.
    assert!(told.iter().all(|sentence| !sentence.contains("choose cells of 0.3 mm")), "{told:?}");
    assert!(told[1].contains("coarser than that of the reference comes within 1 %"), "{told:?}");
    assert!(told[1].contains("cells of 0.6 mm") && told[1].contains("2.00 %"), "{told:?}");
    assert!(told[2].contains("0.800 %") && told[2].contains("this study cannot say"), "{told:?}");
    let told = sentences("an adapter", &[candidate(0.6, 0.5, 0.004), candidate(0.3, 2.0, 0.0)]);
    assert!(
        told[0].starts_with("Real time on an adapter: cells of 0.3 mm") && told[0].contains("not known"),
        "{told:?}"
    );
    assert!(told[1].starts_with("For 1 % error choose cells of 0.6 mm") && told.len() == 2, "{told:?}");
    let told = sentences("an adapter", &[candidate(0.3, 0.5, 0.0)]);
    assert!(told[1].contains("has another mesh than the reference"), "{told:?}");
    let told = sentences("an adapter", &all[2..3]);
    assert!(
        told[0].starts_with("No setting of this study is real time") && told[0].contains("2.00 times slower"),
        "{told:?}"
    );
    assert!(told[1].starts_with("No setting of this study on a mesh coarser"), "{told:?}");
    assert!(sentences("an adapter", &[])[0].contains("can be compared"));
}

#[test]
fn axes_are_read_from_a_list() {
    assert_eq!(Axis::list("engine, mesh").unwrap(), [Axis::Mesh, Axis::Engine]);
    for wrong in ["meshes", "", "mesh,,speed"] {
        assert_eq!(Axis::list(wrong).unwrap_err().exit_code(), 2, "{wrong}");
    }
}

/// A folder with the tiny scene in which the program is called.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let place = Place { folder: tempfile::tempdir().unwrap() };
        std::fs::write(place.path("tiny.toml"), TINY).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::cargo_bin("stylet").unwrap();
        command.current_dir(self.folder.path()).args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    fn call(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn study(&self, out: &str, more: &[&str]) -> Output {
        self.call(&[&["study", "tiny.toml", "--out", out], &SHORT[..], more].concat())
    }

    /// Finished runs of a folder by name.
    fn runs(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let Ok(entries) = std::fs::read_dir(self.path(out).join("runs")) else { return BTreeMap::new() };
        let files =
            entries.flatten().map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|e| e == "json"));
        files.map(|path| (path.file_name().unwrap().to_string_lossy().into(), std::fs::read(path).unwrap())).collect()
    }
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn succeeded(output: &Output) -> String {
    assert!(output.status.success(), "{}", errors(output));
    String::from_utf8_lossy(&output.stdout).trim().to_string()
}

/// Well-formed, no script, no link out, charts with units at their axes.
fn check_page(path: &Path) -> String {
    let text = std::fs::read_to_string(path).unwrap();
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&text, options).unwrap();
    assert!(!text.contains("http") && !text.contains("url(") && !text.contains("@import") && !text.contains("NaN"));
    let mut charts = 0;
    for node in document.descendants().filter(roxmltree::Node::is_element) {
        assert!(!["script", "link", "iframe", "img"].contains(&node.tag_name().name()));
        for attribute in node.attributes() {
            assert!(!attribute.name().starts_with("on"), "{}", attribute.name());
            if attribute.name() == "href" {
                let id = attribute.value().strip_prefix('#').expect("a link within the page");
                assert!(document.descendants().any(|n| n.attribute("id") == Some(id)), "{id}");
            }
        }
        if node.attribute("role") == Some("img") {
            charts += 1;
            let texts: Vec<String> = node
                .descendants()
                .filter(|n| n.has_tag_name("text"))
                .map(|n| n.text().unwrap_or_default().trim().to_string())
                .collect();
            let units = texts.iter().filter(|t| t.contains('[') && t.ends_with(']')).count();
            let ticks = texts.iter().filter(|t| t.parse::<f64>().is_ok()).count();
            assert!(units == 2 && ticks >= 6, "{texts:?}");
        }
    }
    assert!(charts >= 8, "{charts} charts");
    text
}

#[test]
fn a_study_is_one_page_and_a_rerun_computes_nothing() {
    let place = Place::new();
    let output = place.study("out", &[]);
    assert_eq!(succeeded(&output), "out/study.html", "{}", errors(&output));
    assert!(errors(&output).contains("real time"), "{}", errors(&output));
    let text = check_page(&place.path("out/study.html"));
    for said in ["Only the way in to 3 mm", "reference", "friction", "The base was run twice", "real-time factor"] {
        assert!(text.contains(said), "{said}");
    }

    let runs = place.runs("out");
    let mut table = csv::Reader::from_path(place.path("out/study.csv")).unwrap();
    let heads: Vec<String> = table.headers().unwrap().iter().map(String::from).collect();
    let rows: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), runs.len());
    let column = |name: &str| heads.iter().position(|head| head == name).unwrap();
    let reference = rows.iter().find(|row| &row[column("role")] == "reference").unwrap();
    assert_eq!(&reference[column("force_curve_error")], "0");
    let again = rows.iter().find(|row| &row[column("role")] == "base again").unwrap();
    assert_eq!(&again[column("force_curve_change_from_base")], "0", "the engine repeats itself bit for bit");
    let figures: Value = serde_json::from_slice(&std::fs::read(place.path("out/study.json")).unwrap()).unwrap();
    assert_eq!(figures["runs"].as_array().unwrap().len(), runs.len());
    assert!(figures["sentences"][0].as_str().unwrap().contains("real time"));
    assert!(figures["runs"].as_array().unwrap().iter().any(|run| run["on_front"] == true));

    // The same call runs nothing; a broken and a missing run are made again, and nothing else.
    let page = std::fs::read(place.path("out/study.html")).unwrap();
    let output = place.study("out", &[]);
    succeeded(&output);
    let finished = format!("{0} of ", runs.len());
    let told = errors(&output);
    assert!(told.contains(&finished) && told.contains("finished already"), "{told}");
    assert_eq!(place.runs("out"), runs);
    assert_eq!(std::fs::read(place.path("out/study.html")).unwrap(), page);
    let names: Vec<&String> = runs.keys().collect();
    std::fs::remove_file(place.path("out/runs").join(names[0])).unwrap();
    std::fs::write(place.path("out/runs").join(names[1]), "{").unwrap();
    let output = place.study("out", &[]);
    succeeded(&output);
    let after = place.runs("out");
    for (name, bytes) in &runs {
        // On a machine that has become slower the budget may have no room for a run any more; that is told.
        let id = name.trim_end_matches(".json");
        let is_left_out = errors(&output).contains(&format!("{id}: left out, the budget"));
        let is_broken = names[..2].contains(&name);
        match after.get(name).filter(|after| *after != b"{") {
            Some(again) => assert!(is_broken || again == bytes, "{name} was made again"),
            None => assert!(is_broken && is_left_out, "{name} is missing: {}", errors(&output)),
        }
    }

    // A changed scene makes all of them again.
    std::fs::write(place.path("tiny.toml"), TINY.replace("depth_mm = 3.0", "depth_mm = 2.5")).unwrap();
    let output = place.study("out", &["--axes", "mass"]);
    succeeded(&output);
    assert!(
        errors(&output).contains("have changed") && !errors(&output).contains("finished already"),
        "{}",
        errors(&output)
    );

    // What the study has found is what advise goes by, as long as the scene is the same.
    let advice = place.call(&["advise", "tiny.toml", "--real-time", "--engine", "cpu", "--study", "out"]);
    let advice = succeeded(&advice);
    for said in [
        "proposal",
        "% of the force over depth",
        "that of the mesh is not known",
        "mass scaling",
        "assumes",
        "stylet run tiny.toml",
    ] {
        assert!(advice.contains(said), "{said}: {advice}");
    }
    std::fs::write(place.path("tiny.toml"), TINY).unwrap();
    let advice = place.call(&["advise", "tiny.toml", "--real-time", "--engine", "cpu", "--study", "out"]);
    assert!(succeeded(&advice).contains("of another text of this scene"));
}

#[cfg(unix)]
#[test]
fn a_killed_study_goes_on_from_its_finished_runs() {
    for (signal, code) in [("-KILL", None), ("-INT", Some(130))] {
        let place = Place::new();
        let arguments = ["study", "tiny.toml", "--out", "out", "--engine", "cpu", "--budget", "0.3"];
        let mut child = place.command(&arguments).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        let begin = std::time::Instant::now();
        while place.runs("out").len() < 2 {
            assert!(begin.elapsed().as_secs() < 60, "no run in a minute");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), code);
        assert!(!place.path("out/study.html").exists());
        let before = place.runs("out");
        let output = place.call(&arguments);
        succeeded(&output);
        assert!(errors(&output).contains("finished already"), "{}", errors(&output));
        let after = place.runs("out");
        assert!(before.iter().all(|(name, bytes)| after[name] == *bytes), "a finished run was made again");
        assert!(place.path("out/study.html").exists());
    }
}

/// Whether `parallel` is GNU parallel; moreutils has another program of that name.
///
/// Panics with `REQUIRE_PARALLEL=1` where it is not.
fn has_parallel() -> bool {
    let version = Command::new("parallel").arg("--version").stdin(Stdio::null()).output();
    let found = version.is_ok_and(|v| String::from_utf8_lossy(&v.stdout).contains("GNU parallel"));
    let required = std::env::var("REQUIRE_PARALLEL").is_ok_and(|v| v == "1");
    assert!(found || !required, "REQUIRE_PARALLEL=1, but GNU parallel is not installed (scripts/setup.sh parallel)");
    found
}

/// Parts by GNU parallel where it is installed, else one after the other.
fn run_parts(place: &Place, of: usize) {
    let numbers: Vec<String> = (1..=of).map(|k| k.to_string()).collect();
    if has_parallel() {
        // The way of docs/study.md: one word after another, which parallel puts together to a line for the shell.
        let program = Command::cargo_bin("stylet").unwrap().get_program().to_owned();
        let output = Command::new("parallel")
            .current_dir(place.folder.path())
            .args(["--quote", "--joblog", "jobs.tsv", "-j", "2"])
            .arg(program)
            .args(["study", "tiny.toml"])
            .args(SHORT)
            .args(["--shard", &format!("{{}}/{of}"), "--out", "part_{}", ":::"])
            .args(&numbers)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        succeeded(&output);
        // Every part was a job of its own that ended well: column 7 is the exit code.
        let log = std::fs::read_to_string(place.path("jobs.tsv")).unwrap();
        let codes: Vec<&str> = log.lines().skip(1).filter_map(|line| line.split('\t').nth(6)).collect();
        assert_eq!(codes, vec!["0"; of], "{log}");
    } else {
        println!("GNU parallel is not installed: the parts run one after the other");
        for k in &numbers {
            succeeded(&place.study(&format!("part_{k}"), &["--shard", &format!("{k}/{of}")]));
        }
    }
}

#[test]
fn joined_parts_are_the_whole() {
    let place = Place::new();
    run_parts(&place, 3);
    succeeded(&place.study("whole", &["--shard", "1/1"]));
    let parts: Vec<_> = (1..=3).map(|k| place.runs(&format!("part_{k}"))).collect();
    let whole = place.runs("whole");
    assert_eq!(parts.iter().map(BTreeMap::len).sum::<usize>(), whole.len());
    assert!(parts.iter().all(|part| !part.is_empty()), "a part without runs");
    // Without the reference there is no page; with it a page that says what is missing.
    let lacks = |k: usize, role: &str| !parts[k].keys().any(|name| parts_role(&place, k + 1, name) == role);
    let without = (0..3).find(|k| lacks(*k, "reference")).unwrap();
    let output = place.call(&["study", "--merge", &format!("part_{}", without + 1), "--out", "lacking"]);
    assert_eq!(output.status.code(), Some(2), "{}", errors(&output));
    assert!(errors(&output).contains("is missing"), "{}", errors(&output));

    succeeded(&place.call(&["study", "--merge", "part_1", "part_2", "part_3", "--out", "joined"]));
    succeeded(&place.call(&["study", "--merge", "whole", "--out", "whole_joined"]));
    check_page(&place.path("joined/study.html"));
    assert!(std::fs::read_to_string(place.path("joined/study.html")).unwrap().contains("1/3, 2/3, 3/3"));
    assert_eq!(place.runs("joined").keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    // All but the times.
    let results = |out: &str| -> Vec<Vec<String>> {
        let mut table = csv::Reader::from_path(place.path(out).join("study.csv")).unwrap();
        let heads: Vec<String> = table.headers().unwrap().iter().map(String::from).collect();
        let timeless = |head: &String| {
            !["wall_s", "setup_s", "real_time_factor", "cpu_ns_per_cell_step", "on_front"].contains(&head.as_str())
        };
        let kept: Vec<usize> = (0..heads.len()).filter(|i| timeless(&heads[*i])).collect();
        table.records().map(|row| row.unwrap()).map(|row| kept.iter().map(|i| row[*i].to_string()).collect()).collect()
    };
    assert_eq!(results("joined"), results("whole_joined"));

    // Parts of something else are refused.
    let refused = |folders: &[&str], said: &str| {
        let output = place.call(&[&["study", "--merge"], folders, &["--out", "no"]].concat());
        assert_eq!(output.status.code(), Some(2), "{}", errors(&output));
        assert!(errors(&output).contains(said) && errors(&output).contains("way out"), "{}", errors(&output));
        assert!(!place.path("no").exists());
    };
    succeeded(&place.study("other", &["--shard", "1/1", "--axes", "mass"]));
    refused(&["part_1", "other"], "axes, budgets or engines differ");
    succeeded(&place.study("deeper", &["--shard", "1/1", "--axes", "mass", "--set", "motion.phase.0.depth_mm=2"]));
    refused(&["part_1", "deeper"], "scenes or overrides differ");
    let plan = std::fs::read_to_string(place.path("part_2/plan.json")).unwrap();
    let version = format!("\"version\": \"{}\"", env!("CARGO_PKG_VERSION"));
    assert!(plan.contains(&version));
    std::fs::write(place.path("part_2/plan.json"), plan.replace(&version, "\"version\": \"0.0.1\"")).unwrap();
    refused(&["part_1", "part_2"], "different versions");
    refused(&["nowhere"], "holds no study");
    std::fs::remove_dir_all(place.path("part_3/runs")).unwrap();
    refused(&["part_3"], "finished run");
}

/// Role of a run of a part by its file name.
fn parts_role(place: &Place, part: usize, file: &str) -> String {
    let plan: Value =
        serde_json::from_slice(&std::fs::read(place.path(&format!("part_{part}/plan.json"))).unwrap()).unwrap();
    let runs = plan["runs"].as_array().unwrap();
    let run = runs.iter().find(|run| file == format!("{}.json", run["id"].as_str().unwrap())).unwrap();
    run["role"].as_str().unwrap().to_string()
}

#[test]
fn advise_without_a_study_says_so() {
    let place = Place::new();
    let advice = succeeded(&place.call(&["advise", "tiny.toml", "--real-time", "--engine", "cpu", "--rate", "30"]));
    for said in [
        "none of this scene in out/study_tiny",
        "stylet study tiny.toml --engine cpu",
        "not known",
        "cells of",
        "assumes",
    ] {
        assert!(advice.contains(said), "{said}: {advice}");
    }
    assert!(!place.path("out").exists());
}

#[test]
fn wrong_calls_end_with_2_and_a_way_out() {
    let place = Place::new();
    std::fs::create_dir(place.path("full")).unwrap();
    std::fs::write(place.path("full/notes.txt"), "mine").unwrap();
    std::fs::write(
        place.path("block.toml"),
        TINY.split("[needle]").next().unwrap().replace("\"puncture\", \"friction\", ", ""),
    )
    .unwrap();
    for (arguments, said) in [
        (&["study", "tiny.toml", "--axes", "mesh,speed", "--out", "out"][..], "there is no axis `speed`"),
        (&["study", "tiny.toml", "--shard", "3/2", "--out", "out"], "--shard 3/2 names no part"),
        (&["study", "tiny.toml", "--shard", "0/2", "--out", "out"], "--shard 0/2 names no part"),
        (&["study", "tiny.toml", "--shard", "two", "--out", "out"], "--shard two names no part"),
        (&["study", "tiny.toml", "--shard", "1/99999999999", "--out", "out"], "names no part"),
        (&["study", "tiny.toml", "--budget", "0", "--out", "out"], "a budget of 0 minutes"),
        (&["study", "tiny.toml", "--engine", "cpu", "--out", "full"], "full is not empty and holds no study"),
        (&["study", "nowhere.toml", "--out", "out"], "nowhere.toml"),
        (&["study", "block.toml", "--set", "solver.duration_s=1", "--out", "out"], "has no tool"),
        (&["study", "--merge", "full"], "--out"),
        (&["study", "--merge", "full", "--out", "out"], "holds no study"),
        (&["advise", "tiny.toml"], "--real-time"),
        (&["advise", "tiny.toml", "--real-time", "--rate", "0"], "a rate of 0"),
        (&["advise", "tiny.toml", "--real-time", "--study", "full"], "holds no study"),
    ] {
        let output = place.call(arguments);
        let message = errors(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(said) && message.contains("way out: "), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty() && !place.path("out").exists(), "{arguments:?}");
    }
    assert_eq!(std::fs::read(place.path("full/notes.txt")).unwrap(), b"mine");
    // A folder with something else is written to with --force, and what is there stays.
    succeeded(&place.study("full", &["--axes", "mass", "--force"]));
    assert_eq!(std::fs::read(place.path("full/notes.txt")).unwrap(), b"mine");
    // The study of another scene is not overwritten.
    std::fs::write(place.path("small.toml"), TINY).unwrap();
    let output = place.call(&[&["study", "small.toml", "--out", "full"], &SHORT[..]].concat());
    assert_eq!(output.status.code(), Some(2));
    assert!(errors(&output).contains("study of another scene, tiny"), "{}", errors(&output));
}
