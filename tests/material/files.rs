//! Wrong and unusual files: what is wrong, where, and the way out.

use std::path::PathBuf;

use stylet::commands::fit::{FitOptions, Volumetric, fit};
use stylet::material::Mode;
use stylet::material::curves::read_curves;
use stylet::material::fit::Point;

use super::*;

fn file(folder: &tempfile::TempDir, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn points(text: impl AsRef<[u8]>) -> Vec<Point> {
    let folder = tempfile::tempdir().unwrap();
    read_curves(&[file(&folder, "curve.csv", text)]).unwrap_or_else(|error| panic!("{error}")).points
}

#[test]
fn wrong_files_are_refused_with_place_and_way_out() {
    let rows = "1.1,1\n1.2,2\n1.3,3\n";
    for (text, expected) in [
        (String::new(), vec!["curve.csv: holds no table", "header"]),
        ("# only a comment\n\n".into(), vec!["holds no table"]),
        (rows.into(), vec!["curve.csv:1", "no names of columns"]),
        (format!("time_s,force_n\n{rows}"), vec!["curve.csv:1", "no column of the deformation", "stretch"]),
        (format!("stretch,force_n\n{rows}"), vec!["no column of the stress", "nominal_stress_kpa"]),
        (format!("stretch,stress\n{rows}"), vec!["column `stress` names no unit", "stress_kpa"]),
        (format!("stretch,stress_psi\n{rows}"), vec!["names no unit of stress"]),
        (format!("stretch,second_stress_kpa\n{rows}"), vec!["no stress known here", "cauchy_stress"]),
        ("time,stretch,stress_kpa\n".into(), vec!["points away from rest"]),
        (format!("stretch_x,stress_kpa\n{rows}"), vec!["unknown column `stretch_x`"]),
        (
            "stretch,stress_kpa,stress_pa\n1.1,1,1000\n".into(),
            vec!["`stress_kpa` and `stress_pa` say the same", "two files"],
        ),
        ("stretch,strain,stress_kpa\n1.1,0.1,1\n".into(), vec!["`stretch` and `strain` say the same"]),
        ("mode,mode,stretch,stress_kpa\n".into(), vec!["`mode` and `mode` say the same"]),
        ("stretch,stress_kpa\n".into(), vec!["0 points away from rest"]),
        ("stretch,stress_kpa\n1.1,1\n".into(), vec!["1 point away from rest", "at least 3"]),
        ("stretch,stress_kpa\n1,0\n1,0\n1,0\n1.1,1\n".into(), vec!["1 point away from rest"]),
        ("stretch,stress_kpa\n1.1,0\n1.2,0\n1.3,0\n".into(), vec!["every stress is zero"]),
        ("stretch,stress_kpa\n1.1,1\n1.2,NaN\n".into(), vec!["curve.csv:3", "`stress_kpa`", "`NaN` is not finite"]),
        ("stretch,stress_kpa\ninf,1\n".into(), vec!["curve.csv:2", "`stretch`", "not finite"]),
        (
            "# a\nstretch,stress_kpa\n\n1.1,1\n1.2,2 kPa\n".into(),
            vec!["curve.csv:5", "`2 kPa` is not a number", "header"],
        ),
        ("stretch,stress_kpa\n1.1,\n".into(), vec!["curve.csv:2", "column `stress_kpa` is empty"]),
        ("stretch,stress_kpa\n1.1\n".into(), vec!["curve.csv:2", "1 value, but the header has 2"]),
        ("stretch,stress_kpa\n1,1,1,5\n".into(), vec!["4 values", "decimals take a point"]),
        ("mode,stretch,stress_kpa\npulled,1.1,1\n".into(), vec!["curve.csv:2", "`pulled` is no mode", "equibiaxial"]),
        ("mode,stretch,stress_kpa\nshear,1.1,1\n".into(), vec!["needs the amount of shear"]),
        ("mode,shear,stress_kpa\nplanar,0.1,1\n".into(), vec!["a row in planar needs its stretch"]),
        ("stretch,stress_kpa\n0.019,1\n".into(), vec!["curve.csv:2", "stretch 0.019 cannot be", "strain"]),
        ("strain,stress_kpa\n30,1\n".into(), vec!["stretch 31 cannot be", "strain_percent"]),
        ("mode,strain,stress_kpa\ncompression,1.2,1\n".into(), vec!["curve.csv:2", "whole length"]),
        ("stretch,stress_kpa,weight\n1.1,1,0\n".into(), vec!["`weight`: 0 is not positive"]),
        ("stretch,stress_kpa,weight\n1.1,1,-2\n".into(), vec!["-2 is not positive"]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let message = refusal(read_curves(&[file(&folder, "curve.csv", &text)]));
        for part in expected {
            assert!(message.contains(part), "{text:?}\n  gives: {message}\n  not: {part}");
        }
        assert!(message.contains("way out"), "{message}");
    }
}

#[test]
fn files_that_are_no_text_or_not_there_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    assert!(refusal(read_curves(&[file(&folder, "a.csv", [0xff, 0xfe, 0x00, 0x41])])).contains("UTF-8"));
    assert!(refusal(read_curves(&[folder.path().join("none.csv")])).contains("cannot be read"));
    assert!(refusal(read_curves(&[folder.path().into()])).contains("cannot be read"));
    assert!(refusal(fit(&FitOptions::default())).contains("no file"));
}

#[test]
fn wrong_options_are_refused() {
    let files = vec![super::curves::path("synthetic_tension.csv")];
    let with = |change: &dyn Fn(&mut FitOptions)| {
        let mut options = FitOptions { files: files.clone(), ..FitOptions::default() };
        change(&mut options);
        refusal(fit(&options))
    };
    assert!(with(&|o| o.volumetric = Volumetric::PoissonRatio(0.5)).contains("Poisson's ratio 0.5"));
    assert!(with(&|o| o.volumetric = Volumetric::PoissonRatio(f64::NAN)).contains("Poisson's ratio NaN"));
    assert!(with(&|o| o.volumetric = Volumetric::BulkModulus(-1.0)).contains("not positive"));
    assert!(with(&|o| o.density = 0.0).contains("density"));
    assert!(with(&|o| o.preset = Some("a/b".into())).contains("cannot be the name"));
    assert!(
        with(&|o| {
            o.preset = Some("a".into());
            o.law = Some("hookean".into());
        })
        .contains("use one of neo_hookean")
    );
}

#[test]
fn separators_units_and_spellings_are_understood() {
    let expected = points("stretch,nominal_stress_kpa\n1.1,1.5\n1.2,2.5\n1.3,4\n");
    assert_eq!(expected[1], Point { mode: Mode::Uniaxial, x: 1.2, stress: 2500.0, weight: 1.0 });
    for text in [
        "\u{feff}stretch,nominal_stress_kpa\n1.1,1.5\n1.2,2.5\n1.3,4\n",
        "# origin\n#\nStretch ; Nominal stress (kPa)\r\n1,1;1,5\r\n1,2;2,5\r\n1,3;4\r\n",
        "stretch\tstress_pa\n1.1\t1500\n1.2\t2.5e3\n1.3\t4000\n\n",
        "strain [%], stress [MPa]\n10, 0.0015\n20, 0.0025\n30, 0.004\n",
        "mode,strain,engineering_stress_kpa\ntension,0.1,1.5\nUniaxial,0.2,2.5\nTENSION,0.3,4\n",
        "sample,stretch,stress_kpa,weight\nA,1.1,1.5,1\nA,1.2,2.5,1\nB,1.3,4,1\n",
        "stretch,cauchy_stress_kpa\n1.1,1.65\n1.2,3\n1.3,5.2\n",
    ] {
        let found = points(text);
        assert_eq!(found.len(), 3, "{text}");
        for (a, b) in found.iter().zip(&expected) {
            let close = (a.x - b.x).abs() < 1e-12 && (a.stress - b.stress).abs() < 1e-9;
            assert!(close && a.mode == b.mode && a.weight == b.weight, "{text}\n{a:?}");
        }
    }
}

#[test]
fn compression_may_be_given_as_magnitudes() {
    let expected = points("stretch,stress_kpa\n0.9,-1\n0.8,-2\n0.7,-4\n");
    for text in [
        "mode,stretch,stress_kpa\ncompression,0.9,-1\ncompression,0.8,-2\ncompression,0.7,-4\n",
        "mode,stretch,stress_kpa\ncompression,0.9,1\ncompression,0.8,2\ncompression,0.7,4\n",
        "mode,strain,stress_kpa\ncompression,0.1,1\ncompression,0.2,2\ncompression,0.3,4\n",
        "mode,strain,stress_kpa\ncompression,-0.1,-1\ncompression,-0.2,-2\ncompression,-0.3,-4\n",
        "mode,strain,stress_kpa\ncompression,-0.1,1\ncompression,-0.2,2\ncompression,-0.3,4\n",
    ] {
        for (a, b) in points(text).iter().zip(&expected) {
            assert!((a.x - b.x).abs() < 1e-12 && a.stress == b.stress, "{text}\n{a:?}");
        }
    }
    // Outside of the mode nothing is turned, but a pull that shortens is told.
    let folder = tempfile::tempdir().unwrap();
    let curves = read_curves(&[file(&folder, "c.csv", "stretch,stress_kpa\n0.9,1\n0.8,2\n0.7,4\n")]).unwrap();
    assert!(curves.points.iter().all(|p| p.stress > 0.0));
    assert!(curves.notes[0].contains("3 rows with a stretch below 1 and a pulling stress"), "{:?}", curves.notes);
}

#[test]
fn shear_has_its_own_column_or_the_strain() {
    for text in [
        "mode,shear,shear_stress_kpa\nshear,0.1,1\nshear,0.2,2\nshear,-0.3,-3\n",
        "shear,stress_kpa\n0.1,1\n0.2,2\n-0.3,-3\n",
        "mode,strain_percent,cauchy_stress_kpa\nshear,10,1\nshear,20,2\nshear,-30,-3\n",
        "mode,stretch,shear,stress_kpa\nshear,,0.1,1\nshear,,0.2,2\nshear,,-0.3,-3\n",
    ] {
        let found = points(text);
        assert!(
            found.iter().all(|p| p.mode == Mode::Shear && (p.stress - 1e4 * p.x).abs() < 1e-9),
            "{text}\n{found:?}"
        );
    }
}
