//! An effect that no file of the program knows runs on both engines: its key, table, law, memory and energy stand in this folder.

use crate::common;
mod swelling;

use std::path::Path;

use common::*;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::simulation::{EngineChoice, Simulation};
use swelling::SWELLING;

const TEXT: &str = include_str!("swelling.toml");
const BULK: f64 = 100e3;
const SHEAR: f64 = 10e3;
const SIDE: f64 = 4e-3;

fn scene(overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
    Scene::parse_with(Path::new("swelling.toml"), TEXT, &overrides, &[&SWELLING]).unwrap_or_else(|e| panic!("{e}"))
}

/// Both engines with their names; the CPU engine alone where there is no adapter.
fn engines() -> Vec<EngineChoice> {
    if gpu().is_some() { vec![EngineChoice::Cpu, EngineChoice::Gpu] } else { vec![EngineChoice::Cpu] }
}

/// Runs the scene; the last record, and the simulation.
fn run(scene: Scene, engine: EngineChoice) -> (FrameRecord, Simulation) {
    let mut simulation = Simulation::new(scene, engine).unwrap();
    let mut last = None;
    while let Some(record) = simulation.next_frame().unwrap() {
        last = Some(record);
    }
    (last.unwrap(), simulation)
}

/// Energy of the account that nobody explains, over what the effect supplied.
fn unexplained(record: &FrameRecord) -> f64 {
    (record.energy.external - record.energy.accounted()) / record.energy.own[0].abs()
}

#[test]
fn a_free_block_takes_the_volume_that_it_is_given() {
    for engine in engines() {
        let (record, mut simulation) = run(scene(&[]), engine);
        let theta = 0.2 * record.time;
        let state = simulation.engine().read_state().unwrap();
        let corner = state.displacement.last().unwrap();
        // F = (1 + theta)^(1/3) I has no stress at all.
        let expected = SIDE * ((1.0 + theta).cbrt() - 1.0);
        for axis in 0..3 {
            close(&format!("{engine:?}: growth along {axis}"), corner[axis], expected, 2e-3);
        }
        let memory = state.points.first().map_or(f64::NAN, |p| p.own[0].memory[0]);
        close(&format!("{engine:?}: memory"), memory, theta, 1e-5);
    }
}

#[test]
fn a_block_that_cannot_grow_presses_and_holds_the_energy() {
    let held: Vec<String> = ["x_min", "x_max", "y_min", "y_max", "z_min"]
        .iter()
        .map(|face| format!("boundaries.{face}=\"roller\""))
        .collect();
    let mut overrides: Vec<&str> = held.iter().map(String::as_str).collect();
    // A face that is driven nowhere tells its reaction.
    overrides.push(
        "boundaries.z_max={ fixed = [\"x\", \"y\", \"z\"], displacement_mm = [0.0, 0.0, 0.0], duration_s = 1.0 }",
    );
    for engine in engines() {
        let (record, _) = run(scene(&overrides), engine);
        let theta = 0.2 * record.time;
        let volume = SIDE.powi(3);
        // J = 1: the pressure is K theta, the energy K/2 theta^2 per volume.
        // The account belongs to the middle of the last step, half a step later than the memory: one part in the 1320 steps.
        close(&format!("{engine:?}: supplied"), record.energy.own[0], 0.5 * BULK * theta * theta * volume, 2e-3);
        close(&format!("{engine:?}: stored"), record.energy.elastic, 0.5 * BULK * theta * theta * volume, 1e-3);
        let reaction = record.reactions[stylet::scene::Face::ZMax as usize];
        close(&format!("{engine:?}: reaction"), reaction.z, -BULK * theta * SIDE * SIDE, 1e-3);
        at_most(&format!("{engine:?}: unexplained energy"), unexplained(&record).abs(), 2e-3);
    }
}

/// Stretch of an oedometer, sides held, top free, in equilibrium with the growth `theta`: P_zz = 0 with
/// `W = mu/2 (J^-2/3 I1 - 3) + K/2 (J - 1 - theta)^2`, F = diag(1, 1, s).
fn oedometer(theta: f64) -> f64 {
    let stress = |s: f64| {
        let i1 = 2.0 + s * s;
        SHEAR * s.powf(-2.0 / 3.0) * (s - i1 / (3.0 * s)) + BULK * (s - 1.0 - theta)
    };
    let (mut low, mut high) = (1.0, 1.0 + 2.0 * theta);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if stress(middle) > 0.0 { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

#[test]
fn between_both_the_law_of_the_material_and_the_growth_balance() {
    let overrides = ["boundaries.x_max=\"roller\"", "boundaries.y_max=\"roller\""];
    for engine in engines() {
        let (record, mut simulation) = run(scene(&overrides), engine);
        let theta = 0.2 * record.time;
        let state = simulation.engine().read_state().unwrap();
        let top = state.displacement.last().unwrap().z;
        close(&format!("{engine:?}: height"), top, SIDE * (oedometer(theta) - 1.0), 2e-3);
        at_most(&format!("{engine:?}: unexplained energy"), unexplained(&record).abs(), 5e-3);
    }
}

#[test]
fn the_effect_is_absent_where_it_is_not_listed() {
    let text = TEXT.replace("\"swelling\"]", "]");
    let scene = Scene::parse_with(Path::new("swelling.toml"), &text, &[], &[&SWELLING]).unwrap();
    assert!(scene.notices.iter().any(|n| n.contains("Table [swelling] has no effect")), "{:?}", scene.notices);
    for engine in engines() {
        let (record, mut simulation) = run(scene.clone(), engine);
        assert_eq!(record.energy.own, [0.0; 4]);
        assert!(simulation.engine().read_state().unwrap().points.is_empty());
    }
}

#[test]
fn a_region_has_numbers_of_its_own() {
    let region = "[[region]]\nname = \"core\"\nlayer_mm = [0, 2]\n\
                  material = { law = \"neo_hookean\", c10_kpa = 5, bulk_modulus_kpa = 100 }\nswelling = { rate_per_s = 0.05 }\n";
    let text = format!("{TEXT}\n{region}");
    let scene = |overrides: &[String]| Scene::parse_with(Path::new("swelling.toml"), &text, overrides, &[&SWELLING]);
    for engine in engines() {
        let (record, mut simulation) = run(scene(&[]).unwrap(), engine);
        let state = simulation.engine().read_state().unwrap();
        let model = simulation.model.clone();
        let mut seen = [0; 2];
        for (cell, point) in state.points.iter().enumerate() {
            let material = model.material_index(cell);
            let rate = [0.2, 0.05][material];
            close(&format!("{engine:?}: memory of cell {cell}"), point.own[0].memory[0], rate * record.time, 1e-5);
            seen[material] += 1;
        }
        assert_eq!(seen[0], seen[1], "half of the cells are in the region");
        at_most(&format!("{engine:?}: unexplained energy"), unexplained(&record).abs(), 5e-3);
    }
    let refused = scene(&["region.0.swelling.rate_per_s=3".into()]).unwrap_err().to_string();
    assert!(refused.contains("`region.0.swelling.rate_per_s` is 3") && refused.contains("from -1 to 1"), "{refused}");
    let absent = text.replace("\"swelling\"]", "]");
    let absent = Scene::parse_with(Path::new("swelling.toml"), &absent, &[], &[&SWELLING]).unwrap();
    assert!(
        absent.notices.iter().any(|n| n.contains("Table `region.0.swelling` has no effect")),
        "{:?}",
        absent.notices
    );
}

#[test]
fn wrong_tables_are_refused_with_line_and_way_out() {
    let refused = |overrides: &[&str], words: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let error =
            Scene::parse_with(Path::new("swelling.toml"), TEXT, &overrides, &[&SWELLING]).unwrap_err().to_string();
        words.iter().for_each(|word| assert!(error.contains(word), "{word:?} in {error}"));
    };
    refused(&["swelling.rate_per_s=3"], &["`swelling.rate_per_s` is 3", "from -1 to 1"]);
    refused(&["swelling.rate_per_s=\"fast\""], &["is no number"]);
    refused(&["swelling.rat_per_s=0.1"], &["there is no number of this effect called \"rat_per_s\"", "did you mean"]);
    // Who does not bring the effect does not know it.
    let error = Scene::parse(Path::new("swelling.toml"), TEXT, &[]).unwrap_err().to_string();
    assert!(error.contains("swelling") && error.contains("swelling.toml:"), "{error}");
}
