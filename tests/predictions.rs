//! Published experiments beside the theory: their file, the band, and `stylet report predictions` as a user calls it.

use std::f64::consts::{FRAC_PI_2, PI};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use assert_cmd::cargo::CommandCargoExt;
use stylet::output::report::predictions::{PAGE, TABLE};
use stylet::predictions::file::parse;
use stylet::predictions::{Experiment, Origin, Totals, built_in, rows};

/// A synthetic experiment; `{quantity}`, `{measured}` and `{tip}` are to be filled in.
const SYNTHETIC: &str = r#"[[experiment]]
id = "made-up"
authors = "Nobody"
year = 2025
title = "Synthetic experiment"
tissue = "neo-Hooke"
needle = "rod"
quantity = "{quantity}"
measured = { values = [{measured}], from = "source", source = "closed form" }
tip = "{tip}"
radius_mm = { values = [0.5, 0.5, 0.5], from = "source", source = "made up" }
depth_mm = { values = [20.0, 20.0, 20.0], from = "source", source = "made up" }
shear_modulus_kpa = { values = [10.0, 20.0, 40.0], from = "source", source = "made up" }
toughness_j_m2 = { values = [400.0, 400.0, 400.0], from = "source", source = "made up" }
friction = { values = [0.1, 0.2, 0.3], from = "source", source = "made up" }
"#;

fn synthetic(quantity: &str, measured: f64, tip: &str) -> String {
    let measured = format!("{measured}, {measured}, {measured}");
    SYNTHETIC.replace("{quantity}", quantity).replace("{measured}", &measured).replace("{tip}", tip)
}

fn read(text: &str) -> Vec<Experiment> {
    parse(Path::new("made_up.toml"), text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// F_tip [N] and N [N/m] of neo-Hooke where J_c/(mu R) is large, in closed form.
fn tough(mu: f64, toughness: f64, radius: f64) -> (f64, f64) {
    let l = (4.0 * toughness / (mu * radius) / PI).ln();
    (PI * mu * radius * radius * (1.0 + l), PI * mu * radius * (1.0 + 2.0 * l))
}

#[test]
fn the_file_of_the_repository_is_sound() {
    let rows = rows(built_in());
    assert!(rows.len() >= 8, "{} experiments", rows.len());
    for row in &rows {
        let e = row.experiment;
        let band = row.prediction.unwrap_or_else(|reason| panic!("{}: {reason}", e.id));
        let numbers = e.written().flat_map(|(_, input)| input.values).chain(e.measured.values);
        assert!(numbers.chain([band.low, band.best, band.high]).all(|v| v.is_finite() && v >= 0.0), "{}", e.id);
        assert!(0.0 < band.low && band.low <= band.best && band.best <= band.high, "{}: {band:?}", e.id);
        assert!(!e.note.is_empty() && e.measured.origin != Origin::Borrowed, "{}", e.id);
        assert!(!e.uncovered.is_empty(), "{}: the theory covers nothing wholly", e.id);
    }
    let totals = Totals::of(&rows);
    assert_eq!(totals.counted.of + totals.left_out, rows.len());
    assert!(totals.sourced.of <= totals.counted.of && totals.telling.of <= totals.counted.of);
}

#[test]
fn an_experiment_made_from_the_theory_lies_on_the_line() {
    let (radius, toughness, depth) = (0.5e-3, 400.0, 20e-3);
    let force = |mu: f64, friction: f64| {
        let (tip, normal) = tough(mu, toughness, radius);
        tip + friction * normal * depth
    };
    let best = force(20e3, 0.2);
    for (quantity, expected) in [
        ("force_at_depth", best),
        ("tip_force", tough(20e3, toughness, radius).0),
        ("puncture_force", 3.0 * tough(20e3, toughness, radius).0),
        ("slope", 0.2 * tough(20e3, toughness, radius).1 * 1e-3),
        ("wall_pressure", tough(20e3, toughness, radius).1 / (2.0 * PI * radius) * 1e-3),
        ("section_pressure", tough(20e3, toughness, radius).0 / (PI * radius * radius) * 1e-3),
        ("slit_length", PI * 20e3 * radius * radius / toughness * 1e3),
        ("double_insertion", FRAC_PI_2 * 20e3 * radius),
    ] {
        let experiments = read(&synthetic(quantity, expected, "cone"));
        let rows = rows(&experiments);
        let ratio = rows[0].ratio().unwrap();
        assert!((ratio - 1.0).abs() < 2e-3, "{quantity}: {ratio}");
        assert_eq!(rows[0].is_inside(), Some(true), "{quantity}");
    }
    // The band ends at the corners: both modulus and friction low, or both high.
    let experiments = read(&synthetic("force_at_depth", best, "cone"));
    let band = rows(&experiments)[0].prediction.unwrap();
    assert_eq!(band.corners, 4);
    for (found, expected) in [(band.low, force(10e3, 0.1)), (band.high, force(40e3, 0.3))] {
        assert!((found / expected - 1.0).abs() < 2e-3, "{found} {expected}");
    }
}

#[test]
fn a_blunt_needle_cuts_a_ring() {
    // J^ = [x ln(1/x^2) + (1 - x^2)/x]/2 with the core radius x = c/R; the crack is 2 pi c long.
    let x: f64 = 0.05;
    let relative = 0.5 * (x * (1.0 / (x * x)).ln() + (1.0 - x * x) / x);
    let mu = 400.0 / (relative * 0.5e-3) * 1e-3;
    let text = synthetic("slit_length", 2.0 * PI * x * 0.5, "blunt")
        .replace("[10.0, 20.0, 40.0]", &format!("[{mu}, {mu}, {mu}]"));
    let ratio = rows(&read(&text))[0].ratio().unwrap();
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
}

#[test]
fn a_measurement_outside_is_told_with_its_distance() {
    let experiments = read(&synthetic("tip_force", 100.0, "cone"));
    let row = &rows(&experiments)[0];
    assert_eq!(row.is_inside(), Some(false));
    let high = row.prediction.unwrap().high;
    assert!((row.prediction.unwrap().miss([100.0; 3]) * high / 100.0 - 1.0).abs() < 1e-12);
    assert!(row.verdict().starts_with("above the band by a factor of "), "{}", row.verdict());
}

#[test]
fn what_nobody_has_read_does_not_count() {
    let text = synthetic("tip_force", 0.1, "cone");
    let unverified = text.replacen("from = \"source\"", "from = \"unverified\"", 1);
    let assumed = text.replacen("[0.5, 0.5, 0.5], from = \"source\"", "[0.5, 0.5, 0.5], from = \"assumed\"", 1);
    let totals = |text: &str| Totals::of(&rows(&read(text)));
    let (all, without, apart) = (totals(&text), totals(&unverified), totals(&assumed));
    assert_eq!((all.counted.of, all.sourced.of, all.left_out), (1, 1, 0));
    assert_eq!((without.counted.of, without.left_out), (0, 1));
    assert_eq!((apart.counted.of, apart.sourced.of), (1, 0));
}

/// A piece of the synthetic file, what stands there instead, and what the message must name.
const DAMAGES: [(&str, &str, &str); 16] = [
    ("[10.0, 20.0, 40.0]", "[10.0, 20.0]", "values"),
    ("[10.0, 20.0, 40.0]", "[40.0, 20.0, 10.0]", "shear_modulus_kpa"),
    ("[10.0, 20.0, 40.0]", "[10.0, nan, 40.0]", "shear_modulus_kpa"),
    ("[400.0, 400.0, 400.0]", "[-1.0, 400.0, 400.0]", "toughness_j_m2"),
    ("[0.1, 0.2, 0.3]", "[0.1, 0.2, 300.0]", "friction"),
    ("[0.5, 0.5, 0.5]", "\"thick\"", "values"),
    ("year = 2025", "year = 25", "year"),
    ("year = 2025", "year = \"2025\"", "year"),
    ("id = \"made-up\"", "id = \"Made up\"", "id"),
    ("title = \"Synthetic experiment\"", "titel = \"Synthetic experiment\"", "titel"),
    ("title = \"Synthetic experiment\"\n", "", "doi"),
    ("quantity = \"force_at_depth\"", "quantity = \"weight\"", "weight"),
    ("depth_mm = ", "youngs_modulus_kpa = ", "modulus"),
    ("[20.0, 20.0, 20.0], from = \"source\"", "[20.0, 20.0, 20.0], from = \"memory\"", "memory"),
    ("source = \"closed form\" }", "source = \"closed form\", over = \"2R\" }", "over"),
    ("from = \"source\", source = \"closed form\"", "from = \"assumed\", source = \"closed form\"", "measured"),
];

#[test]
fn damaged_files_are_refused_with_line_and_key() {
    let whole = synthetic("force_at_depth", 1.0, "cone");
    for (piece, instead, named) in DAMAGES {
        assert!(whole.contains(piece), "{piece}");
        let problems = parse(Path::new("damaged.toml"), &whole.replacen(piece, instead, 1)).unwrap_err();
        let texts = ["damaged.toml:", "way out: ", named];
        assert!(texts.iter().all(|text| problems.contains(text)), "{piece} -> {instead}:\n{problems}");
    }
    let twice = format!("{whole}{whole}");
    assert!(parse(Path::new("damaged.toml"), &twice).unwrap_err().contains("is taken"));
    assert!(parse(Path::new("damaged.toml"), "").unwrap_err().contains("no experiment"));
}

fn call(arguments: &[&str]) -> Output {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let mut command = Command::cargo_bin("stylet").unwrap();
    command.current_dir(folder).args(["report", "predictions"]).args(arguments).output().unwrap()
}

#[test]
fn the_command_writes_a_page_and_a_table() {
    let base = tempfile::tempdir().unwrap();
    let out = base.path().join("new/folder");
    let output = call(&["--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).trim(), out.join(PAGE).display().to_string());

    let page = std::fs::read_to_string(out.join(PAGE)).unwrap();
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    let document = roxmltree::Document::parse_with_options(&page, options).unwrap();
    assert!(document.descendants().any(|n| n.has_tag_name("svg") && n.attribute("role") == Some("img")));
    assert!(!page.contains("http") && !page.contains("NaN") && !page.contains("url("));
    let rows = rows(built_in());
    for sentence in Totals::of(&rows).sentences() {
        assert!(page.contains(&sentence), "{sentence}");
    }

    let table = std::fs::read(out.join(TABLE)).unwrap();
    let mut table = csv::Reader::from_reader(table.as_slice());
    let columns = table.headers().unwrap().clone();
    let records: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    assert_eq!(records.len(), rows.len());
    for (record, row) in records.iter().zip(&rows) {
        let cell = |name: &str| &record[columns.iter().position(|c| c == name).unwrap()];
        assert_eq!(cell("id"), row.experiment.id);
        assert!(page.contains(&row.experiment.id), "{}", row.experiment.id);
        let best: f64 = cell("predicted").parse().unwrap();
        assert!((best / row.prediction.unwrap().best - 1.0).abs() < 1e-5);
        assert_eq!(cell("inside"), row.is_inside().unwrap().to_string());
    }
}

#[test]
fn wrong_calls_write_nothing() {
    let base = tempfile::tempdir().unwrap();
    let (out, data) = (base.path().join("out"), base.path().join("damaged.toml"));
    std::fs::write(&data, synthetic("tip_force", -1.0, "cone")).unwrap();
    let (out_text, data) = (out.to_str().unwrap(), data.to_str().unwrap());
    for (arguments, named) in [
        (vec!["--data", data], "damaged.toml:9"),
        (vec!["--data", "no-such-file.toml"], "no-such-file.toml"),
        (vec!["--quick"], "--quick"),
        (vec!["--set", "a.b=1"], "--set"),
        (vec!["--engine", "cpu"], "--engine"),
    ] {
        let output = call(&[&["--out", out_text], arguments.as_slice()].concat());
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(named) && message.contains("way out"), "{arguments:?}: {message}");
        assert!(output.stdout.is_empty() && !out.exists());
    }
}
