//! The curves in `assets/curves`: how they were made, and that the files are what these functions give.
//!
//! `cargo test --test physics write_the_curves -- --ignored` writes them anew.

use std::path::PathBuf;

use stylet::material::Isochoric;
use stylet::material::Mode;
use stylet::material::fit::nominal_stress;

use super::*;

/// The laws behind the two noisy curves [Pa].
pub fn tension_law() -> Isochoric {
    ogden(12_000.0, 9.0)
}

pub fn modes_law() -> Isochoric {
    yeoh(4000.0, 1500.0, 600.0)
}

/// Standard deviation of the noise over the stress.
const NOISE: f64 = 0.01;

pub fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("assets/curves").join(name)
}

/// Compression curve with the slopes of Lv et al. 2022: 1140 Pa up to a strain of 1.9 %, then a slope that grows linearly
/// with the strain to 20,000 Pa at 19.0 %; 100 points, evenly spaced.
fn lv2022_compression() -> String {
    const ROWS: usize = 100;
    let (toe, end, first, last) = (0.019, 0.19, 1140.0, 20_000.0);
    let mut text = String::from(
        "# Compression curve of the shape that Lv et al. 2022 (doi 10.1186/s10033-022-00719-y) print: slope 1140 Pa up to\n\
         # 1.9 % strain, then growing linearly with the strain to 20000 Pa at 19.0 %. Made by tests/material/curves.rs, not\n\
         # measured; magnitudes, strain over rest length, stress over rest area.\n\
         mode,strain_percent,nominal_stress_pa\n",
    );
    for i in 0..ROWS {
        let strain = end * i as f64 / (ROWS - 1) as f64;
        let beyond = f64::max(strain - toe, 0.0);
        let stress = first * strain + 0.5 * (last - first) / (end - toe) * beyond * beyond;
        text += &format!("compression,{:.4},{stress:.3}\n", strain * 100.0);
    }
    text
}

/// Tension to a stretch of 1.4 of an Ogden law, 1 % noise.
fn synthetic_tension() -> String {
    let mut random = Random::new(2022);
    let mut text = String::from(
        "# Tension of an incompressible Ogden law, mu 12 kPa, alpha 9, with normal noise of 1 % of the stress.\n\
         # Made by tests/material/curves.rs, not measured.\n\
         stretch,nominal_stress_kpa\n",
    );
    for i in 1..=40 {
        let stretch = 1.0 + 0.01 * f64::from(i);
        let stress = nominal_stress(&tension_law(), Mode::Uniaxial, stretch) * (1.0 + NOISE * random.normal());
        text += &format!("{stretch:.2},{:.5}\n", stress * 1e-3);
    }
    text
}

/// Four modes of a Yeoh law, 1 % noise.
fn synthetic_modes() -> String {
    let mut random = Random::new(1993);
    let mut text = String::from(
        "# Four modes of an incompressible Yeoh law, c10 4 kPa, c20 1.5 kPa, c30 0.6 kPa, with normal noise of 1 % of the\n\
         # stress. Made by tests/material/curves.rs, not measured.\n\
         mode,stretch,shear,nominal_stress_kpa\n",
    );
    let mut row = |name: &str, mode: Mode, x: f64| {
        let stress = nominal_stress(&modes_law(), mode, x) * (1.0 + NOISE * random.normal()) * 1e-3;
        text += &match mode {
            Mode::Shear => format!("{name},,{x:.3},{stress:.5}\n"),
            _ => format!("{name},{x:.3},,{stress:.5}\n"),
        };
    };
    for i in 1..=20 {
        row("tension", Mode::Uniaxial, 1.0 + 0.04 * f64::from(i));
    }
    for i in 1..=10 {
        row("compression", Mode::Uniaxial, 1.0 - 0.04 * f64::from(i));
    }
    for i in 1..=16 {
        row("equibiaxial", Mode::Equibiaxial, 1.0 + 0.03 * f64::from(i));
    }
    for i in 1..=16 {
        row("planar", Mode::Planar, 1.0 + 0.05 * f64::from(i));
    }
    for i in 1..=16 {
        row("shear", Mode::Shear, 0.07 * f64::from(i));
    }
    text
}

fn all() -> [(&'static str, String); 3] {
    [
        ("lv2022_compression.csv", lv2022_compression()),
        ("synthetic_tension.csv", synthetic_tension()),
        ("synthetic_modes.csv", synthetic_modes()),
    ]
}

#[test]
fn the_curves_are_what_their_functions_give() {
    for (name, text) in all() {
        let file = std::fs::read_to_string(path(name)).unwrap_or_else(|reason| panic!("{name}: {reason}"));
        for (n, (found, made)) in file.lines().zip(text.lines()).enumerate() {
            assert_eq!(found, made, "{name}:{}", n + 1);
        }
        assert_eq!(file.lines().count(), text.lines().count(), "{name}");
    }
}

#[test]
#[ignore = "writes the files that the test beside it compares"]
fn write_the_curves() {
    for (name, text) in all() {
        std::fs::write(path(name), text).unwrap();
    }
}
