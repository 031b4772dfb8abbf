//! The same scene on every adapter of this machine and on the CPU engine.

use crate::common;

use std::path::Path;
use std::process::Command;

use serde_json::Value;
use stylet::gpu::Gpu;
use stylet::scene::Scene;
use stylet::simulation::Simulation;

/// `compare-adapters` of a scene of the repository with these variables of the environment; the table as JSON.
fn compared(scene: &str, overrides: &[&str], variables: &[(&str, &str)]) -> Value {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
    command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["compare-adapters", scene, "--json"]);
    command.envs(variables.iter().copied());
    for text in overrides {
        command.args(["--set", text]);
    }
    let output = command.output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    let table: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}\n{told}"));
    println!("{table:#}");
    assert!(output.status.success(), "{table:#}\n{told}");
    table
}

/// Checks the numbers against bounds of this test, tighter than those of the command; returns the adapters that were compared.
fn assert_alike(table: &Value, bounds: [(&str, f64); 3]) -> usize {
    let rows = table["rows"].as_array().unwrap();
    assert_eq!(rows[0]["verdict"], "reference");
    assert_eq!(rows[0]["backend"], "cpu");
    let mut found = 0;
    for row in rows.iter().filter(|row| row["differences"].is_object()) {
        assert_eq!(row["verdict"], "within", "{row}");
        for (quantity, bound) in bounds {
            let value = row["differences"][quantity].as_f64().unwrap_or_else(|| panic!("no {quantity}: {row}"));
            // An adapter in f32 that agrees to the last digit of f64 has computed nothing.
            assert!(value > 0.0 && value < bound, "{quantity} differs by {value} %: {row}");
        }
        assert!(row["wall_s"].as_f64().unwrap() > 0.0);
        found += 1;
    }
    let required = std::env::var("REQUIRE_GPU").is_ok_and(|v| v == "1");
    assert!(found > 0 || !required, "REQUIRE_GPU=1, and no adapter was compared: {table:#}");
    if found == 0 {
        println!("skipped: no adapter");
    }
    found
}

const SHALLOW: [&str; 3] = ["tissue.cell_size_mm=1.2", "motion.phase.0.depth_mm=4.0", "motion.phase.2.depth_mm=3.0"];

#[test]
fn a_needle_is_the_same_on_every_adapter() {
    // The dent of the opened path, whose crack runs a step earlier or later (9.5 % of the force in that frame), and the puncture of the ring.
    for scene in ["scenes/muscle_biopsy.toml", "scenes/calibrated/muscle_biopsy.toml"] {
        let table = compared(scene, &SHALLOW, &[]);
        assert_alike(&table, [("force", 0.005), ("displacement", 0.005), ("energy", 0.005)]);
    }
}

#[test]
fn a_sheared_block_with_histories_is_the_same_on_every_adapter() {
    let table = compared("scenes/effects/plasticity.toml", &[], &[]);
    assert_alike(&table, [("force", 0.05), ("displacement", 0.05), ("energy", 0.05)]);
}

/// SwiftShader, a Vulkan driver that shares no code with Mesa: another compiler, another width of its groups. Debian has it in the
/// package `chromium`; `REQUIRE_SWIFTSHADER=1` turns its absence into a failure.
#[test]
fn a_second_vulkan_driver_computes_the_same() {
    let manifest = std::env::var("SWIFTSHADER_ICD").unwrap_or("/usr/lib/chromium/vk_swiftshader_icd.json".into());
    if !std::path::Path::new(&manifest).is_file() {
        let required = std::env::var("REQUIRE_SWIFTSHADER").is_ok_and(|v| v == "1");
        assert!(!required, "REQUIRE_SWIFTSHADER=1, and there is no {manifest} (Debian: chromium)");
        println!("skipped: no SwiftShader");
        return;
    }
    let drivers = [("VK_ICD_FILENAMES", manifest.as_str()), ("WGPU_BACKEND", "vulkan")];
    for (scene, overrides, bound) in [
        ("scenes/muscle_biopsy.toml", &SHALLOW[..], 0.005),
        ("scenes/calibrated/muscle_biopsy.toml", &SHALLOW, 0.005),
        ("scenes/effects/cohesive.toml", &[], 0.05),
    ] {
        let table = compared(scene, overrides, &drivers);
        assert_eq!(assert_alike(&table, [("force", bound), ("displacement", bound), ("energy", bound)]), 1);
        assert!(table["rows"][1]["adapter"].as_str().unwrap().contains("SwiftShader"), "{table:#}");
    }
}

#[test]
fn wrong_scenes_are_refused() {
    let output = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["compare-adapters", "nowhere.toml"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty() && String::from_utf8_lossy(&output.stderr).contains("way out"));
}

/// Arrays in textures (src/gpu/texels.rs) are another place for the same numbers: not a bit of a force differs, whatever acts.
#[test]
fn arrays_in_textures_and_in_buffers_give_the_same_forces() {
    let Some(gpu) = common::gpu() else { return };
    for (file, overrides, frames) in [
        ("scenes/muscle_biopsy.toml", &["tissue.cell_size_mm=1.2", "motion.phase.0.speed_mm_s=10.0"][..], 40),
        ("scenes/calibrated/muscle_biopsy.toml", &["tissue.cell_size_mm=1.2", "motion.phase.0.speed_mm_s=10.0"], 40),
        ("scenes/lv2022/hollow.toml", &["motion.phase.0.speed_mm_s=10.0"], 10),
        ("scenes/slit.toml", &["motion.phase.0.speed_mm_s=10.0"], 10),
        ("scenes/free_hand/entry_45.toml", &[], 20),
        ("scenes/effects/indentation.toml", &[], 10),
        ("scenes/validation/compression_30.toml", &[], 10),
        ("scenes/layers.toml", &["motion.phase.0.speed_mm_s=10.0"], 20),
    ] {
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let run = |texels: bool| {
            let scene = Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join(file).as_path(), &overrides).unwrap();
            let mut simulation = Simulation::on(scene, Some(Gpu { texels, ..gpu.clone() })).unwrap();
            for _ in 0..frames {
                simulation.next_frame().unwrap().unwrap();
            }
            simulation.engine().read_state().unwrap()
        };
        let (buffers, textures) = (run(false), run(true));
        assert!(buffers.displacement.iter().any(|u| u.length() > 1e-6), "{file}: nothing moved");
        assert_eq!(buffers.displacement, textures.displacement, "{file}");
        assert_eq!(buffers.velocity, textures.velocity, "{file}");
        assert_eq!(buffers.stiffness, textures.stiffness, "{file}");
    }
}

/// Hardware gets more threads for short stages (`Grain`): other orders of the same sums. Run here on whatever adapter there is.
#[test]
fn many_threads_and_few_give_the_same_forces() {
    let Some(gpu) = common::gpu() else { return };
    for (file, overrides) in [
        ("scenes/opening.toml", &["motion.phase.0.speed_mm_s=10.0"][..]),
        (
            "scenes/opening.toml",
            &[
                "motion.phase.0.speed_mm_s=10.0",
                "tissue.cell_size_mm=0.9",
                "effects=[\"puncture\", \"friction\", \"mass_scaling\", \"flexible_needle\"]",
            ],
        ),
    ] {
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        let run = |wide: bool| {
            let scene = Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join(file).as_path(), &overrides).unwrap();
            let mut simulation = Simulation::on(scene, Some(Gpu { wide, ..gpu.clone() })).unwrap();
            let forces: Vec<f64> = (0..60).map(|_| simulation.next_frame().unwrap().unwrap().force.axial).collect();
            (forces, simulation.engine().read_state().unwrap())
        };
        let ((few, few_state), (many, many_state)) = (run(false), run(true));
        let peak = few.iter().copied().fold(0.0, f64::max);
        assert!(peak > 0.1, "{file}: {peak} N");
        for (a, b) in few.iter().zip(&many) {
            assert!((a - b).abs() < 1e-4 * peak, "{file}: {a} and {b} N");
        }
        let far = few_state
            .displacement
            .iter()
            .zip(&many_state.displacement)
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        assert!(far < 1e-7, "{file}: {far} m");
        assert_ne!(few, many, "{file}: the same stages ran");
    }
}

/// Linux leaves two workers on one processor for long; each is given its own (src/gpu/workers.rs).
#[test]
#[cfg(target_os = "linux")]
fn workers_of_llvmpipe_are_spread_over_the_processors() {
    let Some(gpu) = common::gpu().filter(|gpu| gpu.info.name.contains("llvmpipe")) else {
        println!("skipped: no llvmpipe");
        return;
    };
    let mut places: Vec<(String, bool)> = Vec::new();
    for thread in std::fs::read_dir("/proc/self/task").unwrap().flatten() {
        let read = |file: &str| std::fs::read_to_string(thread.path().join(file)).unwrap_or_default();
        let status = read("status");
        let allowed =
            status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap_or_default().trim();
        if allowed.parse::<u32>().is_ok() {
            places.push((allowed.to_owned(), read("comm").starts_with("llvmpipe-")));
        }
    }
    drop(gpu);
    places.sort();
    let processors = std::thread::available_parallelism().unwrap().get();
    // On each processor one that computes and one that paints.
    let painters: Vec<bool> = places.iter().map(|(_, paints)| *paints).collect();
    assert_eq!(painters, [false, true].repeat(processors), "{places:?}");
    let used: std::collections::BTreeSet<&String> = places.iter().map(|(processor, _)| processor).collect();
    assert_eq!(used.len(), processors, "{places:?}");
}
