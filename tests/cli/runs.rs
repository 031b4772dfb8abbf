//! Right calls: what a run writes, where, and how it ends.

use super::*;

/// Keys that scripts may rely on.
const SUMMARY_KEYS: [&str; 31] = [
    "scene",
    "engine",
    "adapter",
    "driver",
    "effects",
    "cells",
    "nodes",
    "dt_s",
    "stable_dt_s",
    "mass_scaling",
    "steps",
    "simulated_s",
    "wall_s",
    "real_time_factor",
    "cell_steps_per_s",
    "cpu_ns_per_cell_step",
    "first_step_ms",
    "host_peak_bytes",
    "device_bytes",
    "peak_force_n",
    "puncture_force_n",
    "puncture_depth_m",
    "force_after_puncture_n",
    "force_at_max_depth_n",
    "slope_after_puncture_n_per_m",
    "energy_imbalance",
    "kinetic_to_internal",
    "hourglass_to_internal",
    "clamped_nodes",
    "inverted_cells",
    "status",
];

const RESULTS: [&str; 9] = [
    "energy.csv",
    "force.csv",
    "force.svg",
    "force_parts.svg",
    "frames.pvd",
    "frames/frame_*.vtu",
    "stress_02.00mm.png",
    "stress_03.00mm.png",
    "summary.json",
];

/// Frame numbers depend on nothing but the frame rate; their count is what matters here.
fn assert_all_results(place: &Place, folder: &str) {
    let files: Vec<String> = place
        .files(folder)
        .into_iter()
        .map(|f| if f.starts_with("frames/frame_") { "frames/frame_*.vtu".into() } else { f })
        .collect();
    assert_eq!(files, RESULTS, "{folder}");
    let read = |name: &str| std::fs::read(place.path(folder).join(name)).unwrap();
    assert!(read("stress_03.00mm.png").starts_with(b"\x89PNG\r\n\x1a\n"));
    assert!(String::from_utf8(read("force.svg")).unwrap().contains("</svg>"));
    assert!(String::from_utf8(read("frames.pvd")).unwrap().contains("frames/frame_"));
}

/// An engine that is there.
fn engines(place: &Place) -> Vec<&'static str> {
    if place.has_adapter() { vec!["gpu", "cpu"] } else { vec!["cpu"] }
}

#[test]
fn a_run_writes_everything() {
    let place = Place::new();
    place.tiny(&[]);
    for engine in engines(&place) {
        let answer = place.call(&["run", "tiny.toml", "--engine", engine, "--out", engine]).ended(0);
        assert_eq!(answer.stdout.lines().last(), Some(engine), "{}", answer.all());
        assert_all_results(&place, engine);
        let summary = place.summary(engine);
        for key in SUMMARY_KEYS {
            assert!(summary.get(key).is_some(), "{engine}: no `{key}` in {summary:#}");
        }
        assert_eq!(summary["status"], "ok");
        assert_eq!(summary["scene"], "tiny");
        assert_eq!(summary["engine"], engine);
        assert_eq!(summary["effects"].as_array().unwrap().len(), 3);
        assert_eq!(summary["clamped_nodes"], 0);
        assert_eq!(summary["inverted_cells"], 0);
        let number = |key: &str| summary[key].as_f64().unwrap_or_else(|| panic!("{key} in {summary:#}"));
        for key in ["dt_s", "steps", "wall_s", "real_time_factor", "cell_steps_per_s", "peak_force_n"] {
            assert!(number(key) > 0.0, "{key}: {}", number(key));
        }
        // 3 mm at 2 mm/s.
        assert!((number("simulated_s") - 1.5).abs() < 2.0 * number("dt_s"), "{summary:#}");
        assert!(number("dt_s") <= number("stable_dt_s"));
        assert!(number("energy_imbalance") <= 0.02, "{summary:#}");

        let (header, force) = place.table(engine, "force.csv");
        assert_eq!(&header[..4], ["time_s", "depth_m", "phase", "axial_force_n"]);
        let (_, energy) = place.table(engine, "energy.csv");
        // One row per frame: 1.5 s at 60 per second and the first single step.
        assert_eq!(force.len(), 91);
        assert_eq!(energy.len(), force.len());
        let largest = force.iter().map(|r| r[3]).fold(0.0, f64::max);
        assert!((largest - number("peak_force_n")).abs() < 1e-6, "{largest} {summary:#}");
        assert!(force.iter().flatten().chain(energy.iter().flatten()).all(|v| v.is_finite()));
    }
}

/// What a window asks of a process at its side: a line for all that is ready, each set of effects once per leader.
#[test]
fn kernels_are_prepared() {
    let place = Place::new();
    place.tiny(&[]);
    if engines(&place).len() < 2 {
        place.call(&["prepare", "tiny.toml"]).ended(2).says("no GPU adapter found");
        return;
    }
    let ready = |answer: &Answer| -> Vec<String> {
        answer.stdout.lines().filter_map(|l| l.strip_prefix("ready: ")).map(str::to_string).collect()
    };
    let own = r#"effects=["mass_scaling", "puncture", "friction"]"#.to_string();
    let switched = r#"effects=["mass_scaling", "gravity", "puncture", "friction"]"#.to_string();
    let only = place.call(&["prepare", "tiny.toml", "--only", "--script"]).ended(0);
    assert_eq!(ready(&only), std::slice::from_ref(&own), "{}", only.all());
    let beside = place.call(&["prepare", "tiny.toml", "--beside", "--hand"]).ended(0);
    let sets = ready(&beside);
    assert!(sets.contains(&switched) && !sets.contains(&own), "{}", beside.all());
    // Every one of them can be asked for.
    for set in &sets {
        place.call(&["check", "tiny.toml", "--set", set]).ended(0);
    }
    let all = place.call(&["prepare", "tiny.toml"]).ended(0);
    assert_eq!(ready(&all).len(), 2 * (1 + sets.len()), "{}", all.all());
    assert!(all.stdout.contains("begin the run anew"), "{}", all.all());
    place.call(&["prepare", "tiny.toml", "--set", "effects=[\"glue\"]"]).refused().says("glue");
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn standard_error_is_plain_where_it_is_no_terminal() {
    let place = Place::new();
    place.tiny(&[]);
    let answer = place.call(&["run", "tiny.toml", "--engine", "cpu"]).ended(0);
    assert!(!answer.stderr.contains('\r') && !answer.stderr.contains('\u{1b}'), "{:?}", answer.stderr);
    assert!(!answer.stderr.contains("left"), "{}", answer.all());
}

#[test]
fn numbered_folders_and_the_short_call() {
    let place = Place::new();
    place.tiny(&[]);
    // Without `run`: the same.
    for (args, folder) in [
        (&["run", "tiny.toml", "--engine", "cpu"][..], "out/tiny/001"),
        (&["tiny.toml", "--engine", "cpu"][..], "out/tiny/002"),
    ] {
        let answer = place.call(args).ended(0);
        assert_eq!(answer.stdout.lines().last(), Some(folder), "{}", answer.all());
        assert_all_results(&place, folder);
    }
}

#[test]
fn a_folder_with_results_is_kept_unless_forced() {
    let place = Place::new();
    place.tiny(&[]);
    let run = ["run", "tiny.toml", "--engine", "cpu", "--out", "results"];
    place.call(&run).ended(0);
    place.write("results/mine.txt", "keep me");
    let before = std::fs::read(place.path("results/summary.json")).unwrap();
    place.call(&run).refused().says("results").says("--force");
    assert_eq!(std::fs::read(place.path("results/summary.json")).unwrap(), before);
    let forced: Vec<&str> = run.iter().copied().chain(["--force", "--set", "outputs.fields_at_depth_mm=[]"]).collect();
    place.call(&forced).ended(0);
    assert_ne!(std::fs::read(place.path("results/summary.json")).unwrap(), before);
    let files = place.files("results");
    assert!(files.contains(&"mine.txt".into()), "{files:?}");
    // Nothing of the run before is left.
    assert!(!files.iter().any(|f| f.contains("vtu")), "{files:?}");
}

#[test]
fn a_needle_without_puncture_runs_with_a_notice() {
    let place = Place::new();
    place.tiny(&[("[\"puncture\", \"friction\", \"mass_scaling\"]", "[]"), ("depth_mm = 3.0", "depth_mm = 0.05")]);
    for engine in engines(&place) {
        let answer = place.call(&["run", "tiny.toml", "--engine", engine, "--out", engine]).ended(0);
        answer.says("note: ").says("does not touch the tissue").says("add \"puncture\"").says("solver.mass_scaling");
        let summary = place.summary(engine);
        assert_eq!(summary["effects"].as_array().unwrap().len(), 0);
        // The hand feels the inertia of the needle at its start, and nothing else.
        assert!(summary["peak_force_n"].as_f64().unwrap() < 0.05, "{}", summary["peak_force_n"]);
        assert_eq!(summary["mass_scaling"], 1.0);
    }
}

/// A step 32 times above the stable one, without mass scaling to save it.
#[test]
fn a_diverging_run_fails_and_keeps_its_results() {
    let place = Place::new();
    place.tiny(&[("[\"puncture\", \"friction\", \"mass_scaling\"]", "[\"puncture\", \"friction\"]")]);
    for engine in engines(&place) {
        let args = ["run", "tiny.toml", "--engine", engine, "--out", engine, "--set", "solver.time_step_us=1000"];
        let answer = place.call(&args).ended(3);
        assert_eq!(answer.stdout, "", "{}", answer.all());
        // The first frame of whole steps moves more energy than was put in ten times over.
        let answer = answer.says("is above the stable step").says("run stopped in frame 1 ").says("of energy were ");
        let answer = answer.says("rest position").says("(step ").says(&format!("are in {engine}"));
        let summary = place.summary(engine);
        let status = summary["status"].as_str().unwrap();
        assert!(status.starts_with("stopped: run stopped in frame"), "{}", answer.all());
        // As many rows as the frames before the failure, all complete.
        let (_, force) = place.table(engine, "force.csv");
        let (_, energy) = place.table(engine, "energy.csv");
        assert!(!force.is_empty() && force.len() < 91, "{}", force.len());
        assert_eq!(force.len(), energy.len());
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_the_run_with_complete_results() {
    let place = Place::new();
    // At true mass this takes minutes.
    place.tiny(&[("\"mass_scaling\"]", "]"), ("speed_mm_s = 2.0", "speed_mm_s = 0.1")]);
    for engine in engines(&place) {
        let mut child = place
            .program(&["run", "tiny.toml", "--engine", engine, "--out", engine])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let table = place.path(engine).join("force.csv");
        let begin = std::time::Instant::now();
        let rows = || std::fs::read_to_string(&table).map_or(0, |t| t.lines().count());
        while rows() < 4 {
            assert!(begin.elapsed().as_secs() < 120, "no frame in two minutes");
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let sent = std::process::Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        assert!(sent.success());
        let (mut stdout, mut stderr) = (String::new(), String::new());
        child.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        let code = child.wait().unwrap().code();
        let answer = Answer { code, stdout, stderr }.ended(130);
        assert_eq!(answer.stdout.lines().last(), Some(engine), "{}", answer.all());
        let summary = place.summary(engine);
        assert_eq!(summary["status"], "interrupted");
        let (_, force) = place.table(engine, "force.csv");
        let (_, energy) = place.table(engine, "energy.csv");
        assert_eq!(force.len(), energy.len());
        assert!(force.len() >= 3);
        let last = force.last().unwrap()[0];
        assert!((summary["simulated_s"].as_f64().unwrap() - last).abs() < 1e-9, "{summary:#}");
        assert!(place.path(engine).join("force.svg").exists());
    }
}

/// Waits for rows of a run's table, more than were there, sends it a signal, waits for its end; the answer and how long it took
/// after the signal.
#[cfg(unix)]
fn signalled(place: &Place, args: &[&str], folder: &str, signal: &str) -> (Answer, std::time::Duration) {
    let table = place.path(folder).join("force.csv");
    let rows = || std::fs::read_to_string(&table).map_or(1, |t| t.lines().count());
    let before = rows();
    let mut child = place.program(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let begin = std::time::Instant::now();
    while rows() <= before {
        assert!(begin.elapsed().as_secs() < 120, "no frame in two minutes");
        if child.try_wait().unwrap().is_some() {
            panic!("ended before the signal: {}", Answer::from(child.wait_with_output().unwrap()).all());
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    let sent = std::time::Instant::now();
    assert!(std::process::Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
    while child.try_wait().unwrap().is_none() {
        if sent.elapsed().as_secs() > 60 {
            child.kill().unwrap();
            panic!("{signal} did not end the run within a minute; a test that runs under nohup ignores HUP");
        }
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let took = sent.elapsed();
    (Answer::from(child.wait_with_output().unwrap()), took)
}

/// What a scheduler sends ends a run as Ctrl-C does: with results, a checkpoint, a sentence, and the exit code of the signal. No
/// checkpoint need have been asked for.
#[cfg(unix)]
#[test]
fn every_signal_that_ends_a_job_leaves_results_and_a_checkpoint() {
    let place = Place::new();
    place.tiny(&[("\"mass_scaling\"]", "]"), ("speed_mm_s = 2.0", "speed_mm_s = 0.1")]);
    for (signal, code) in [("-TERM", 143), ("-HUP", 129), ("-XCPU", 152), ("-USR1", 138), ("-INT", 130)] {
        let out = &signal[1..];
        let args = ["run", "tiny.toml", "--engine", "cpu", "--out", out, "--checkpoint", "0"];
        let (answer, took) = signalled(&place, &args, out, signal);
        let answer =
            answer.ended(code).says("stopped by ").says("SIG").says(&format!("results and a checkpoint are in {out}"));
        assert_eq!(answer.stderr.lines().filter(|l| l.contains("stopped by")).count(), 1, "{}", answer.all());
        assert!(took.as_secs_f64() < 4.0, "{signal}: {took:?}");
        assert_eq!(place.summary(out)["status"], "interrupted");
        assert!(place.path(out).join("checkpoint.stylet").exists(), "{signal}");
        assert_eq!(place.table(out, "force.csv").1.len(), place.table(out, "energy.csv").1.len());
    }
    // And it goes on from there.
    let (answer, _) = signalled(&place, &["run", "--resume", "HUP"], "HUP", "-TERM");
    answer.ended(143).says("going on at");
}

/// Commands that keep nothing before their end say so, and end with the code of the signal.
#[cfg(unix)]
#[test]
fn a_signal_ends_any_command_with_a_sentence() {
    let place = Place::new();
    let args = ["bench", "--engine", "cpu"];
    let mut child = place.program(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    std::thread::sleep(std::time::Duration::from_secs(2));
    if child.try_wait().unwrap().is_some() {
        panic!("ended before the signal: {}", Answer::from(child.wait_with_output().unwrap()).all());
    }
    let sent = std::time::Instant::now();
    assert!(std::process::Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let answer = Answer::from(child.wait_with_output().unwrap()).ended(143);
    answer.says("error: ended by SIGTERM before anything was kept");
    assert!(sent.elapsed().as_secs() < 4, "{:?}", sent.elapsed());
}

/// A frame of many thousand steps is given up; the run is kept as it was before.
#[cfg(unix)]
#[test]
fn a_long_frame_is_not_waited_for() {
    let place = Place::new();
    place.tiny(&[
        ("\"mass_scaling\"]", "]"),
        ("mass_scaling = 40000", "frame_rate_hz = 2.0"),
        ("speed_mm_s = 2.0", "speed_mm_s = 0.1"),
    ]);
    for engine in engines(&place) {
        let (answer, took) =
            signalled(&place, &["run", "tiny.toml", "--engine", engine, "--out", engine], engine, "-TERM");
        answer.ended(143).says("stopped by SIGTERM").says("go on with");
        assert!(took.as_secs_f64() < 4.0, "{engine}: {took:?}");
        assert!(place.path(engine).join("checkpoint.stylet").exists());
    }
}

/// `nohup`: the end of the terminal is none of the program.
#[cfg(unix)]
#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let place = Place::new();
    place.tiny(&[]);
    let line =
        "trap '' HUP; \"$0\" run tiny.toml --engine cpu --out out & run=$!; sleep 0.3; kill -HUP $run; wait $run";
    let stylet = place.program(&[]).get_program().to_owned();
    let mut shell = std::process::Command::new("bash");
    shell.args(["-c", line]).arg(stylet).current_dir(place.path("."));
    Answer::from(shell.output().unwrap()).ended(0);
    assert_ne!(place.summary("out")["status"], "interrupted");
}

/// Nobody reads what a run says: it goes on and keeps its results.
#[test]
fn a_run_outlives_who_listens_to_it() {
    let place = Place::new();
    place.tiny(&[]);
    // A message before the first step, and one at the end.
    let args = ["run", "tiny.toml", "--engine", "cpu", "--out", "out"];
    let mut child = place.program(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_ne!(place.summary("out")["status"], "interrupted");
    assert!(place.path("out/force.svg").exists());
    // A refusal that nobody hears is one all the same.
    let mut child = place.program(&["check", "none.toml"]).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(2));
}

/// The scenes of the repository, and the files that they name, are there wherever the program is called.
#[test]
fn built_in_scenes_are_found_from_everywhere() {
    let place = Place::new();
    for scene in ["scenes/muscle_biopsy.toml", "./scenes/forearm.toml", "scenes/../scenes/target.toml"] {
        let answer = place.call(&["check", scene, "--engine", "cpu"]).ended(0);
        assert!(answer.stdout.contains("the scene that is built into the program is used"), "{}", answer.all());
    }
    let few =
        ["--set", "tissue.cell_size_mm=2.4", "--set", "motion.phase=[{kind=\"insert\", speed_mm_s=10, depth_mm=1}]"];
    let args = [&["--engine", "cpu", "--out", "out"], &few[..]].concat();
    place.call(&args).ended(0).says("built into the program");
    assert_eq!(place.summary("out")["scene"], "muscle_biopsy");
    // A file of that name wins.
    std::fs::create_dir(place.path("scenes")).unwrap();
    place.write("scenes/muscle_biopsy.toml", TINY);
    let answer = place.call(&["check", "--engine", "cpu"]).ended(0);
    assert!(answer.stdout.contains("tiny") && !answer.stdout.contains("built into"), "{}", answer.all());
    place.call(&["stability", "--only", "step_1_1", "--short", "--engine", "cpu"]).ended(0);
    place.call(&["fit", "assets/curves/synthetic_tension.csv"]).ended(0);
}

#[test]
fn a_closed_pipe_is_no_failure() {
    let place = Place::new();
    place.tiny(&[]);
    let calls: [&[&str]; 4] = [&["schema"], &["adapters"], &["check", "tiny.toml"], &["run", "tiny.toml"]];
    for args in calls {
        let mut child = place.program(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut stderr = String::new();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        let code = child.wait().unwrap().code();
        Answer { code, stdout: String::new(), stderr }.ended(0);
    }
    // And one that is closed after the first line.
    let mut child = place.program(&["schema"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let answer: Answer = child.wait_with_output().unwrap().into();
    answer.ended(0);
    assert_eq!(line.trim(), "{");
}

#[test]
fn every_scene_is_checked() {
    let place = Place::new();
    for path in scene_files() {
        if path.ends_with("table1_as_printed.toml") {
            continue;
        }
        let answer = place.call(&["check", path.to_str().unwrap()]).ended(0);
        for word in
            ["stability", "stable step", "steps", "shear modulus", "effects", "mass scaling", "prediction", "ok"]
        {
            assert!(answer.stdout.contains(word), "no `{word}` for {}\n{}", path.display(), answer.all());
        }
    }
    assert!(place.files(".").is_empty(), "check writes nothing");
}

/// A scene whose frames last longer than the trial of the prediction is not "shorter than the trial".
#[test]
fn long_frames_are_predicted_too() {
    let place = Place::new();
    place.tiny(&[("\"mass_scaling\"]", "]"), ("mass_scaling = 40000", "frame_rate_hz = 6.0")]);
    let answer = place.call(&["check", "tiny.toml", "--engine", "cpu"]).ended(0);
    assert!(answer.stdout.contains("s of wall time on this adapter"), "{}", answer.all());
}

#[test]
fn the_schema_describes_the_keys() {
    let text = Place::new().call(&["schema"]).ended(0).stdout;
    let schema: Value = serde_json::from_str(&text).unwrap();
    for key in ["tissue", "material", "boundaries", "needle", "sphere", "motion", "puncture", "friction", "solver"] {
        assert!(schema["properties"].get(key).is_some(), "no `{key}`");
    }
    for (table, key) in [
        ("TissueTable", "cell_size_mm"),
        ("MaterialTable", "c10_kpa"),
        ("PhaseTable", "speed_mm_s"),
        ("PunctureTable", "puncture_force_n"),
        ("SolverTable", "mass_scaling"),
        ("OutputsTable", "pictures_at_depth_mm"),
    ] {
        let described = schema["$defs"][table]["properties"][key]["description"].as_str();
        assert!(described.is_some_and(|d| d.len() > 10), "{table}.{key}: {described:?}");
    }
}

#[test]
fn adapters_are_listed() {
    let place = Place::new();
    let answer = place.call(&["adapters"]).ended(0);
    let found = !answer.stdout.starts_with("no adapter found");
    assert!(found || answer.stdout.contains("way out: "), "{}", answer.all());
    if found {
        assert!(answer.stdout.starts_with("* "), "{}", answer.all());
        assert!(answer.stdout.contains("driver: "), "{}", answer.all());
    }
}

#[test]
fn help_and_version() {
    let place = Place::new();
    let help = place.call(&["--help"]).ended(0).stdout;
    for word in ["run", "check", "bench", "adapters", "schema"] {
        assert!(help.contains(word), "{help}");
    }
    assert!(place.call(&["--version"]).ended(0).stdout.contains(env!("CARGO_PKG_VERSION")));
}
