//! Fits of exact, noisy and mixed curves, and of the curve of Lv et al. 2022.

use stylet::commands::fit::{FitOptions, fit};
use stylet::material::Mode;
use stylet::material::curves::read_curves;
use stylet::material::fit::{Fit, LawFit, Point, best_stable, fit_all, nominal_stress};
use stylet::material::{Isochoric, LAWS, Verdict};

use super::curves::{modes_law, path, tension_law};
use super::*;

fn curve(law: &Isochoric, mode: Mode, xs: impl IntoIterator<Item = f64>) -> Vec<Point> {
    xs.into_iter().map(|x| Point { mode, x, stress: nominal_stress(law, mode, x), weight: 1.0 }).collect()
}

fn steps(from: f64, to: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| from + (to - from) * i as f64 / (count - 1) as f64).collect()
}

fn of<'a>(fits: &'a [LawFit], key: &str) -> &'a LawFit {
    fits.iter().find(|f| f.key == key).unwrap()
}

/// Largest relative difference of the constants; of those that are zero, over the largest.
fn difference(fit: &Fit, law: &Isochoric) -> f64 {
    let largest = law.constants().iter().map(|(_, v)| v.abs()).fold(0.0, f64::max);
    let pairs = fit.law.constants().into_iter().zip(law.constants());
    pairs
        .map(|((key, found), (same, value))| {
            assert_eq!(key, same);
            (found - value).abs() / if value == 0.0 { largest } else { value.abs() }
        })
        .fold(0.0, f64::max)
}

#[test]
fn exact_curves_return_their_constants() {
    for law in [
        neo_hookean(3300.0),
        mooney_rivlin(2300.0, 1000.0),
        yeoh(2000.0, 900.0, 300.0),
        ogden(6000.0, 4.0),
        ogden(6000.0, -3.0),
        ogden(800.0, 25.0),
        ogden(6000.0, 1.2),
        demiray(1170.0, 6.84),
        demiray(20_000.0, 0.3),
        demiray(100.0, 60.0),
    ] {
        for (mode, xs) in [
            (Mode::Uniaxial, steps(1.0, 1.3, 30)),
            (Mode::Uniaxial, steps(0.7, 1.2, 30)),
            (Mode::Equibiaxial, steps(1.0, 1.2, 20)),
        ] {
            let fits = fit_all(&curve(&law, mode, xs));
            let found = of(&fits, law.key());
            for fit in [found.unconstrained, found.stable] {
                let fit = fit.unwrap_or_else(|| panic!("{law:?}: no fit"));
                let error = difference(&fit, &law);
                assert!(error < 1e-4, "{law:?} in {mode:?}: {:?}, off by {error:.1e}", fit.law);
                assert!(fit.relative < 1e-6 && fit.r2 > 1.0 - 1e-9);
            }
            assert_eq!(best_stable(&fits).unwrap().key, law.key(), "{law:?} in {mode:?}");
        }
    }
}

#[test]
fn unstable_constants_are_found_and_replaced_by_stable_ones() {
    let law = mooney_rivlin(-1000.0, 4000.0);
    let fits = fit_all(&curve(&law, Mode::Uniaxial, steps(0.8, 1.3, 30)));
    let found = of(&fits, "mooney_rivlin");
    let free = found.unconstrained.unwrap();
    assert!(difference(&free, &law) < 1e-6);
    let Verdict::StableAbove(limit) = free.verdict else { panic!("{:?}", free.verdict) };
    assert!((limit - 0.5).abs() < 1e-6);
    assert!(free.stable_within_data);
    let stable = found.stable.unwrap();
    assert_eq!(stable.verdict, Verdict::Stable);
    // The best non-negative pair has no c10 left, and the error of the others is no smaller.
    assert_eq!(stable.law.constants()[0].1, 0.0);
    for c01 in [0.98, 1.02].map(|f| f * 1e3 * stable.law.constants()[1].1) {
        assert!(stylet::material::fit::judge(&mooney_rivlin(0.0, c01), &points_of(&law)).rms > stable.rms);
    }
    // The other way round: data inside and outside of the limit.
    let law = ogden(6000.0, 0.5);
    let Verdict::StableBelow(limit) = law.verdict() else { panic!("{law:?}") };
    for (end, inside) in [(limit - 0.1, true), (limit + 0.1, false)] {
        let fits = fit_all(&curve(&law, Mode::Uniaxial, steps(1.0, end, 30)));
        let found = of(&fits, "ogden");
        assert!(difference(&found.unconstrained.unwrap(), &law) < 1e-4);
        assert_eq!(found.unconstrained.unwrap().stable_within_data, inside);
        let stable = found.stable.unwrap();
        assert!(stable.law.constants()[1].1.abs() >= 1.0 && stable.rms > 1.0, "{:?}", stable.law);
    }
}

fn points_of(law: &Isochoric) -> Vec<Point> {
    curve(law, Mode::Uniaxial, steps(0.8, 1.3, 30))
}

#[test]
fn weights_decide_between_contradictions() {
    let mut points = curve(&neo_hookean(1000.0), Mode::Planar, steps(1.05, 1.3, 10));
    let other = curve(&neo_hookean(3000.0), Mode::Planar, steps(1.05, 1.3, 10));
    points.extend(other.into_iter().map(|p| Point { weight: 3.0, ..p }));
    let fits = fit_all(&points);
    let fit = of(&fits, "neo_hookean").unconstrained.unwrap();
    assert!((fit.law.constants()[0].1 - 2.5).abs() < 1e-9, "{:?}", fit.law);
}

#[test]
fn constants_that_the_points_do_not_tell_are_not_made_up() {
    // In shear alone c10 and c01 are one constant.
    let fits = fit_all(&curve(&mooney_rivlin(2300.0, 1000.0), Mode::Shear, steps(0.0, 0.8, 20)));
    assert_eq!(of(&fits, "mooney_rivlin").unconstrained, None);
    let stable = of(&fits, "mooney_rivlin").stable.unwrap();
    assert!(stable.relative < 1e-9 && (stable.law.shear_modulus() - 6600.0).abs() < 1e-6);
    assert_eq!(best_stable(&fits).unwrap().key, "neo_hookean");
    // A stress that falls with the stretch belongs to no stable law.
    let fits = fit_all(&curve(&neo_hookean(-1000.0), Mode::Uniaxial, steps(1.0, 1.3, 20)));
    assert_eq!(best_stable(&fits), None);
}

#[test]
fn noisy_curves_return_their_constants() {
    let tension = read_curves(&[path("synthetic_tension.csv")]).unwrap();
    let fits = fit_all(&tension.points);
    let found = of(&fits, "ogden").stable.unwrap();
    // Noise of 1 % on 40 points.
    assert!(difference(&found, &tension_law()) < 0.03, "{:?}", found.law);
    assert!(found.r2 > 0.999);
    let modes = read_curves(&[path("synthetic_modes.csv")]).unwrap();
    assert_eq!(modes.points.len(), 78);
    let fits = fit_all(&modes.points);
    let best = best_stable(&fits).unwrap();
    assert_eq!(best.key, "yeoh");
    assert!(difference(&best.stable.unwrap(), &modes_law()) < 0.05, "{:?}", best.stable.unwrap().law);
}

#[test]
fn several_files_are_fitted_together() {
    let both = read_curves(&[path("synthetic_tension.csv"), path("synthetic_modes.csv")]).unwrap();
    assert_eq!(both.points.len(), 40 + 78);
    let rest = &both.points[40..];
    assert_eq!(rest.iter().filter(|p| p.mode == Mode::Shear).count(), 16);
    assert!(rest.iter().all(|p| p.mode != Mode::Uniaxial || (p.x < 1.0) == (p.stress < 0.0)));
}

/// The defect of the printed constants: `C10 = 4.75, C01 = -4.91` without unit or sign.
#[test]
fn the_compression_curve_of_lv2022_gives_the_printed_constants_and_they_are_refused() {
    let signed = read_curves(&[path("lv2022_compression.csv")]).unwrap();
    assert!(signed.points.iter().all(|p| p.x <= 1.0 && p.stress <= 0.0), "compression has the signs of compression");
    let fits = fit_all(&signed.points);
    let mooney = of(&fits, "mooney_rivlin");
    let free = mooney.unconstrained.unwrap();
    let near = |fit: &Fit, c10: f64, c01: f64| {
        let c = fit.law.constants();
        (c[0].1 / c10 - 1.0).abs() < 0.01 && (c[1].1 / c01 - 1.0).abs() < 0.01
    };
    assert!(near(&free, -4.750, 4.910), "{:?}", free.law);
    // Stable only above a stretch of 0.984: 1.6 % of compression, a twelfth of the data.
    let Verdict::StableAbove(limit) = free.verdict else { panic!("{:?}", free.verdict) };
    assert!((limit - 0.9836).abs() < 1e-3, "{limit}");
    assert!(!free.stable_within_data);
    // Stresses as positive numbers beside stretches below 1: exactly the set that was printed, unstable at rest.
    let lost_sign: Vec<Point> = signed.points.iter().map(|p| Point { stress: -p.stress, ..*p }).collect();
    let printed = of(&fit_all(&lost_sign), "mooney_rivlin").unconstrained.unwrap();
    assert!(near(&printed, 4.750, -4.910), "{:?}", printed.law);
    assert_eq!(printed.verdict, Verdict::Unstable);
    assert_eq!(best_stable(&fit_all(&lost_sign)), None);
    // No stable Mooney-Rivlin comes near; the three laws that stiffen do.
    assert!(mooney.stable.unwrap().relative > 0.05);
    for (key, rms) in [("yeoh", 41.0), ("ogden", 46.0), ("demiray", 58.0)] {
        let stable = of(&fits, key).stable.unwrap();
        assert!((stable.rms - rms).abs() < 1.0, "{key}: rms {} Pa", stable.rms);
    }
    let best = best_stable(&fits).unwrap();
    assert_eq!(best.key, "yeoh");
    let Isochoric::Yeoh(c) = best.stable.unwrap().law else { panic!("{best:?}") };
    assert!((c.c10 - 483.4).abs() < 1.0 && (c.c20 - 3444.0).abs() < 5.0 && c.c30 == 0.0, "{c:?}");
    let c = of(&fits, "demiray").stable.unwrap().law.constants();
    assert!((c[0].1 - 1.189).abs() < 0.002 && (c[1].1 - 6.653).abs() < 0.01, "{c:?}");
}

/// The set (1.17 kPa, 6.84), rms 0.04 kPa, is a Demiray fit to the curve of the Mooney-Rivlin fit, not to the points.
#[test]
fn the_demiray_set_of_lv2022_follows_from_the_mooney_rivlin_curve() {
    let points = curve(&mooney_rivlin(-4750.0, 4910.0), Mode::Uniaxial, steps(0.81, 1.0, 100));
    let found = of(&fit_all(&points), "demiray").stable.unwrap();
    let c = found.law.constants();
    assert!((c[0].1 / 1.17 - 1.0).abs() < 0.01 && (c[1].1 / 6.84 - 1.0).abs() < 0.01, "{c:?}");
    assert!((found.rms - 42.7).abs() < 1.0, "rms {} Pa", found.rms);
}

#[test]
fn the_report_holds_table_chart_and_preset() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new/fit");
    let options = FitOptions {
        files: vec![path("synthetic_modes.csv")],
        preset: Some("test-muscle".into()),
        out: Some(out.clone()),
        ..FitOptions::default()
    };
    let report = fit(&options).unwrap();
    let text = report.text();
    assert!(text.contains("best stable law: yeoh"), "{text}");
    assert_eq!(report.written.len(), 3);
    let chart = std::fs::read_to_string(out.join("fit.svg")).unwrap();
    for word in ["stretch, uniaxial", "stretch, equibiaxial", "stretch, planar", "amount of shear", "Yeoh, rms"] {
        assert!(chart.contains(word), "{word}");
    }
    let table = std::fs::read_to_string(out.join("fit.csv")).unwrap();
    assert_eq!(table.lines().count(), 79);
    let columns = table.lines().next().unwrap().split(',').count();
    assert!(table.lines().all(|line| line.split(',').count() == columns));
    // The preset is a table of a library, with the keys of a scene.
    let library: toml::Table = std::fs::read_to_string(out.join("test-muscle.toml")).unwrap().parse().unwrap();
    let entry = library["material"][0].as_table().unwrap();
    let keys: Vec<&str> = entry.keys().map(String::as_str).collect();
    let expected = [
        "c10_kpa",
        "c20_kpa",
        "c30_kpa",
        "density_kg_m3",
        "law",
        "name",
        "poisson_ratio",
        "range",
        "source",
        "summary",
    ];
    let mut sorted = keys.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, expected);
    assert_eq!(entry["law"].as_str(), Some("yeoh"));
    assert!((entry["c10_kpa"].as_float().unwrap() - 4.0).abs() < 0.2);
    // JSON holds the same.
    let json: serde_json::Value = serde_json::from_str(&report.json()).unwrap();
    assert_eq!(json["best_stable"], "yeoh");
    assert_eq!(json["laws"].as_array().unwrap().len(), LAWS.len());
    assert!(json["laws"][2]["stable"]["constants"]["c10_kpa"].is_f64());
    // A second call does not overwrite unasked.
    assert!(refusal(fit(&options)).contains("--force"));
    assert!(fit(&FitOptions { force: true, ..options.clone() }).is_ok());
    // Another law, and a bulk modulus.
    let other = FitOptions {
        law: Some("demiray".into()),
        volumetric: stylet::commands::fit::Volumetric::BulkModulus(5e5),
        out: None,
        ..options
    };
    let preset = fit(&other).unwrap().preset.unwrap();
    assert!(preset.contains("law = \"demiray\"") && preset.contains("bulk_modulus_kpa = 500.0"), "{preset}");
}
