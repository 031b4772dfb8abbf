//! `stylet material` as a user calls it.

use std::process::{Command, Output};

use assert_cmd::cargo::CommandCargoExt;
use serde_json::Value;

fn call(arguments: &str) -> Output {
    Command::cargo_bin("stylet").unwrap().arg("material").args(arguments.split_whitespace()).output().unwrap()
}

fn stdout(arguments: &str) -> String {
    let output = call(arguments);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn rows(arguments: &str) -> Vec<Value> {
    serde_json::from_str(&stdout(&format!("{arguments} --json"))).unwrap()
}

#[test]
fn json_starts_with_the_promised_keys() {
    let text = stdout("lv2022-refit --points 3 --json");
    let order = |keys: &[&str]| {
        let places: Vec<usize> = keys.iter().map(|k| text.find(&format!("\"{k}\"")).expect(k)).collect();
        assert!(places.windows(2).all(|w| w[0] < w[1]), "{keys:?}");
    };
    order(&["mode", "stretch", "nominal_stress_pa", "cauchy_stress_pa", "leg"]);
    let rows = rows("lv2022-refit --points 3");
    // Four modes, three rows of loading and two of unloading.
    assert_eq!(rows.len(), 20);
    for row in &rows {
        let is_shear = row["mode"] == "shear";
        assert_eq!((row.get("shear").is_some(), row.get("stretch").is_some()), (is_shear, !is_shear));
        assert!(row["nominal_stress_pa"].is_f64() && row["cauchy_stress_pa"].is_f64());
    }
}

#[test]
fn stresses_are_those_of_the_reference() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/01_mr_homogeneous.json");
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let states = file["materials"]["A"]["rows"].as_array().unwrap();
    let constants = "--c10-kpa 2.3 --c01-kpa 1 --bulk-modulus-kpa 500 --points 2 --no-unload";
    for (mode, name, column) in [
        ("uniaxial", "uniaxial", 0),
        ("equibiaxial", "equibiaxial", 0),
        ("planar", "planar", 0),
        ("simple_shear", "shear", 1),
    ] {
        let state = states.iter().rfind(|s| s["mode"] == mode).unwrap();
        let found = rows(&format!("{constants} --mode {name} --to {}", state["param"])).pop().unwrap();
        for (key, tensor) in [("nominal_stress_pa", "P_Pa"), ("cauchy_stress_pa", "cauchy_Pa")] {
            let (found, expected) = (found[key].as_f64().unwrap(), state[tensor][0][column].as_f64().unwrap());
            assert!((found / expected - 1.0).abs() < 1e-8, "{name} {key}: {found} {expected}");
        }
    }
}

#[test]
fn the_table_fits_a_narrow_terminal() {
    for arguments in [
        "across-fibre",
        "across-fibre --effects plasticity,fibres,viscoelastic,damage --fibre 30 --to 2 --hold 5",
        "--law ogden --mu-kpa 5 --alpha 8 --poisson-ratio 0.49",
    ] {
        let text = stdout(arguments);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        assert!(text.contains("verdict") && text.contains("nominal") && text.contains("uniaxial"));
    }
}

#[test]
fn the_defaults_of_the_effects_reach_the_published_strengths() {
    for (fibre, strength) in [("x", 85.0e3), ("y", 26.0e3)] {
        let effects = "--effects plasticity,fibres,damage --to 2 --points 201 --no-unload";
        let rows = rows(&format!("across-fibre --mode uniaxial {effects} --fibre {fibre}"));
        let largest = rows.iter().map(|r| r["nominal_stress_pa"].as_f64().unwrap()).fold(0.0, f64::max);
        assert!((largest / strength - 1.0).abs() < 0.01, "{fibre}: {largest}");
        assert!(rows.last().unwrap()["nominal_stress_pa"].as_f64().unwrap() < 0.8 * largest);
    }
}

#[test]
fn csv_and_figure_hold_what_the_test_gave() {
    let folder = tempfile::tempdir().unwrap();
    let figure = folder.path().join("material.svg");
    let text = stdout(&format!("lv2022-refit --effects viscoelastic --hold 5 --csv --svg {}", figure.display()));
    assert!(text.starts_with("mode,stretch,shear,nominal_stress_pa,"));
    let columns = text.lines().next().unwrap().split(',').count();
    assert!(text.lines().all(|line| line.split(',').count() == columns));
    // Four modes with 11 rows of loading, 10 of holding, 10 of unloading, and the header.
    assert_eq!(text.lines().count(), 1 + 4 * 31);
    let svg = std::fs::read_to_string(figure).unwrap();
    assert!(svg.starts_with("<svg") && svg.contains("equibiaxial") && svg.contains("time [s]"));
}

#[test]
fn unstable_constants_are_refused_unless_asked_for() {
    let paper = "--c10-kpa 4.75 --c01-kpa -4.91 --bulk-modulus-kpa 500 --mode uniaxial --points 2";
    let output = call(paper);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2));
    assert!(message.contains("c10 + c01 = -0.16 kPa") && message.contains("--allow-unstable"), "{message}");
    assert!(stdout(&format!("{paper} --allow-unstable")).contains("WARNING"));
    // Incompressible: 2 (l - l^-2)(c10 + c01/l); K = 500 kPa moves it by less than a percent.
    let row = rows(&format!("{paper} --allow-unstable --to 0.7 --no-unload")).pop().unwrap();
    let expected = 2.0e3 * (0.7 - 1.0 / 0.49) * (4.75 - 4.91 / 0.7);
    assert!((row["nominal_stress_pa"].as_f64().unwrap() / expected - 1.0).abs() < 0.02);
}

#[test]
fn wrong_calls_say_what_is_wrong_and_the_way_out() {
    for (arguments, texts) in [
        ("", ["no material is named", "across-fibre"]),
        ("acros-fibre", ["no tissue preset `acros-fibre`", "did you mean `across-fibre`?"]),
        ("across-fibre --c10-kpa 1", ["--c10-kpa beside a preset", "remove"]),
        ("--law ogden --mu-kpa 1 --poisson-ratio 0.4", ["needs --alpha", "--mu-kpa, --alpha"]),
        ("--law ogden --mu-kpa 1 --b 3 --poisson-ratio 0.4", ["--b is no constant", "ogden"]),
        ("--c10-kpa 1 --c01-kpa 1", ["volumetric part", "--poisson-ratio"]),
        ("--c10-kpa NaN --c01-kpa 1 --poisson-ratio 0.4", ["--c10-kpa is NaN", "a number from"]),
        ("--c10-kpa 1 --c01-kpa 1 --poisson-ratio 0.5", ["--poisson-ratio is 0.5", "incompressible"]),
        ("lv2022-refit --mode uniaxil", ["uniaxil", "'uniaxial'"]),
        ("lv2022-refit --effects plastic", ["plastic", "'plasticity'"]),
        ("lv2022-refit --effects damage", ["needs `plasticity`", "--effects plasticity,damage"]),
        ("lv2022-refit --yield-kpa 3", ["--yield-kpa has no meaning", "--effects plasticity"]),
        ("lv2022-refit --effects plasticity --yield-kpa 0", ["--yield-kpa is 0", "a number from"]),
        ("lv2022-refit --effects viscoelastic --prony 0.5", ["`0.5` is no share", "0.25:0.5"]),
        ("lv2022-refit --effects viscoelastic --prony 0.5:1,0.5:2", ["total share 1", "--prony"]),
        ("lv2022-refit --effects fibres --fibre up", ["`up` is neither", "--fibre 30"]),
        ("lv2022-refit --to 0", ["a stretch of 0 is outside", "1.5"]),
        ("lv2022-refit --to 1 --mode planar", ["both 1", "different"]),
        ("lv2022-refit --rate 0", ["--rate is 0", "a number from"]),
        ("lv2022-refit --points 1", ["--points is 1", "a number from"]),
        ("--scene scenes/muscle_biops.toml", ["cannot read the scene file", "muscle_biopsy.toml"]),
        ("--scene scenes/muscle_biopsy.toml --region skn", ["no region `skn`", "Its regions"]),
    ] {
        let output = call(arguments);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments}: {message}");
        assert!(texts.iter().all(|t| message.contains(t)), "{arguments}: {message}");
        assert!(output.stdout.is_empty());
    }
}

#[test]
fn a_scene_gives_its_material_and_its_effects() {
    let text = stdout("--scene scenes/muscle_biopsy.toml --points 2 --mode planar");
    assert!(text.contains("material") && text.contains("effects"));
}

#[test]
fn a_sample_that_is_squeezed_pushes_back_and_continued_rows_are_marked() {
    let constants = "--c10-kpa 2.3 --c01-kpa 1 --bulk-modulus-kpa 22 --mode equibiaxial";
    // The law solved by hand: F = diag(l, l, b), P33 = 0.
    for (stretch, expected) in [(0.7, -11448.0), (0.6, -12667.0), (0.5, -9535.0)] {
        let last = rows(&format!("{constants} --to {stretch} --points 2 --no-unload")).pop().unwrap();
        let found = last["nominal_stress_pa"].as_f64().unwrap();
        assert!((found / expected - 1.0).abs() < 1e-3, "stretch {stretch}: {found} Pa");
        assert!(last["continuation"].is_null(), "{last}");
    }
    for row in rows(&format!("{constants} --to 0.2 --points 9 --no-unload")).iter().skip(1) {
        let stress = row["nominal_stress_pa"].as_f64().unwrap();
        assert!(stress < 0.0, "{row}");
        assert_eq!(row["continuation"] == "volume", row["stretch"].as_f64().unwrap() < 0.45, "{row}");
    }
    let text = stdout(&format!("{constants} --to 0.2 --points 9"));
    let marked = text.lines().filter(|line| line.get(9..10) == Some("*")).count();
    assert!(marked >= 2 && text.contains("* so flat for its size that the law is continued"), "{text}");
    let csv = stdout(&format!("{constants} --to 0.2 --points 3 --csv"));
    assert!(csv.lines().next().unwrap().ends_with(",continuation") && csv.contains(",volume\n"), "{csv}");
    assert!(!stdout("--c10-kpa 2.3 --c01-kpa 1 --bulk-modulus-kpa 500 --mode uniaxial").contains('*'));
    let capped = stdout("--law demiray --mu-kpa 5 --b 9 --poisson-ratio 0.49 --mode shear --to 2");
    assert!(capped.contains("* exponent beyond 10"), "{capped}");
}
