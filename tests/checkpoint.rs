//! A run that is stopped and goes on gives what it would have given, bit for bit.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use stylet::gpu::Gpu;
use stylet::observables::FrameRecord;
use stylet::scene::Scene;
use stylet::simulation::checkpoint::Checkpoint;
use stylet::simulation::{EngineChoice, Simulation};

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn engines() -> Vec<EngineChoice> {
    let found = Gpu::open().is_ok();
    assert!(found || std::env::var_os("REQUIRE_GPU").is_none_or(|v| v != "1"), "REQUIRE_GPU=1 and no adapter");
    if found { vec![EngineChoice::Gpu, EngineChoice::Cpu] } else { vec![EngineChoice::Cpu] }
}

fn scene(name: &str, overrides: &[&str]) -> Scene {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    Scene::load(&repository().join("scenes").join(name), &overrides).unwrap_or_else(|e| panic!("{e}"))
}

/// Records of the frames from the present one to `end`.
fn advance(simulation: &mut Simulation, end: u64) -> Vec<FrameRecord> {
    let mut records = Vec::new();
    while records.last().is_none_or(|r: &FrameRecord| r.frame + 1 < end) {
        records.push(simulation.next_frame().unwrap().expect("the scene is long enough"));
    }
    records
}

/// The frames `middle..end` without a pause, and from a checkpoint that has been through a file, are the same.
fn assert_goes_on(name: &str, overrides: &[&str], engine: EngineChoice, middle: u64, end: u64) {
    let begin = Instant::now();
    let mut whole = Simulation::new(scene(name, overrides), engine).unwrap();
    let expected = advance(&mut whole, end);
    let mut first = Simulation::new(scene(name, overrides), engine).unwrap();
    first.stop_after(middle - 1);
    advance(&mut first, middle);
    let bytes = postcard::to_allocvec(&first.checkpoint().unwrap()).unwrap();
    drop(first);
    let checkpoint: Checkpoint = postcard::from_bytes(&bytes).unwrap();
    let mut second = Simulation::new(scene(name, overrides), engine).unwrap();
    second.resume(&checkpoint).unwrap();
    let found = advance(&mut second, end);
    assert_eq!(found.len() as u64, end - middle);
    for (found, expected) in found.iter().zip(&expected[middle as usize..]) {
        assert_eq!(found, expected, "{name} on {engine:?}, frame {}", found.frame);
    }
    // The frames say something.
    assert!(found.last().unwrap().energy != expected[middle as usize - 1].energy, "{name}");
    println!("{name} on {engine:?}: {} kB, {:.1} s", bytes.len() / 1000, begin.elapsed().as_secs_f64());
}

const COARSE: &str = "tissue.cell_size_mm=1.0";

#[test]
fn needle_scenes_go_on_bit_for_bit() {
    for engine in engines() {
        // 2 mm/s and 60 frames a second: the tip is in from frame 80 on, and on the opened path from 145 on.
        assert_goes_on("calibrated/muscle_biopsy.toml", &[COARSE], engine, 90, 100);
        assert_goes_on("muscle_biopsy.toml", &[COARSE], engine, 150, 156);
        let relaxing = r#"effects=["puncture", "friction", "viscoelastic", "mass_scaling"]"#;
        assert_goes_on("muscle_biopsy.toml", &[COARSE, relaxing], engine, 150, 154);
        // The image of the CPU engine is its whole state; that of the GPU engine is a list of buffers.
        if engine == EngineChoice::Cpu {
            continue;
        }
        assert_goes_on("slit.toml", &[COARSE], engine, 90, 100);
        assert_goes_on("lv2022/hollow.toml", &[COARSE], engine, 85, 92);
        assert_goes_on("effects/adhesion.toml", &[], engine, 40, 46);
    }
}

#[test]
fn free_hand_and_flexible_needles_go_on_bit_for_bit() {
    for engine in engines() {
        assert_goes_on("free_hand/change_of_direction.toml", &[COARSE], engine, 40, 48);
        assert_goes_on("effects/flexible_needle.toml", &[COARSE], engine, 20, 26);
    }
}

#[test]
fn histories_go_on_bit_for_bit() {
    for engine in engines() {
        let all = ["plasticity", "viscoelastic", "damage", "fibres", "cohesive", "gravity"];
        for name in &all[..if engine == EngineChoice::Cpu { 2 } else { all.len() }] {
            let mut short = Simulation::new(scene(&format!("effects/{name}.toml"), &[]), engine).unwrap();
            let frames = short.frame_count();
            assert!(frames >= 4, "{name}: {frames} frames");
            let middle = (frames / 2).min(20);
            short.stop_after(0);
            assert_goes_on(&format!("effects/{name}.toml"), &[], engine, middle, (middle + 6).min(frames));
        }
    }
}

#[test]
fn a_checkpoint_of_another_run_is_refused() {
    let mut simulation = Simulation::new(scene("effects/gravity.toml", &[]), EngineChoice::Cpu).unwrap();
    simulation.stop_after(1);
    advance(&mut simulation, 2);
    let checkpoint = simulation.checkpoint().unwrap();
    let mut other = Simulation::new(scene("effects/plasticity.toml", &[]), EngineChoice::Cpu).unwrap();
    let error = other.resume(&checkpoint).unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("another scene, mesh or version"), "{error}");
    if engines().contains(&EngineChoice::Gpu) {
        let mut other = Simulation::new(scene("effects/gravity.toml", &[]), EngineChoice::Gpu).unwrap();
        let error = other.resume(&checkpoint).unwrap_err().to_string();
        assert!(error.contains("engine `cpu`") && error.contains("--engine cpu"), "{error}");
    }
}

fn stylet(folder: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
    command.current_dir(folder);
    command
}

/// Killed without a chance to say good-bye, a run goes on from its last checkpoint to the same tables.
#[test]
fn a_killed_run_goes_on_to_the_same_tables() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository().join("scenes/muscle_biopsy.toml");
    let run = |out: &str, every: &str| {
        let mut command = stylet(folder.path());
        command.args(["run", path.to_str().unwrap(), "--engine", "auto", "--out", out, "--checkpoint", every]);
        command.args(["--set", COARSE, "--set", "motion.phase.0.depth_mm=4.0", "--set", "motion.phase.2.depth_mm=3.8"]);
        command.args(["--set", "outputs.pictures_at_depth_mm=[1.0]", "--set", "outputs.fields_at_depth_mm=[1.0, 3.9]"]);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    assert!(run("whole", "0").status().unwrap().success());
    let mut child = run("killed", "0.2").spawn().unwrap();
    let (checkpoint, begin) = (folder.path().join("killed/checkpoint.stylet"), Instant::now());
    while !checkpoint.exists() {
        assert!(begin.elapsed() < Duration::from_secs(120), "no checkpoint came");
        assert!(child.try_wait().unwrap().is_none(), "the run ended before its first checkpoint");
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!folder.path().join("killed/summary.json").exists());
    let output = stylet(folder.path()).args(["run", "--resume", "killed"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() && told.contains("going on at"), "{told}");
    for name in ["force.csv", "energy.csv", "frames.pvd"] {
        let text = |out: &str| std::fs::read_to_string(folder.path().join(out).join(name)).unwrap();
        assert!(text("whole") == text("killed"), "{name} differs");
    }
    assert!(!checkpoint.exists(), "a run that ended well keeps no checkpoint");
    // What is gone or changed is told.
    let again = stylet(folder.path()).args(["run", "--resume", "killed"]).output().unwrap();
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("has finished: nothing is left to go on with"));
    std::fs::write(&checkpoint, b"stylet checkpoint 6\nrubbish").unwrap();
    let damaged = stylet(folder.path()).args(["run", "--resume", "killed"]).output().unwrap();
    assert_eq!(damaged.status.code(), Some(2));
    let told = String::from_utf8_lossy(&damaged.stderr);
    assert!(told.contains("is no checkpoint") && told.contains("way out"), "{told}");
}
