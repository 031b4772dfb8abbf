//! Wrong calls and wrong files: exit code 2, one message with place and way out, nothing written.

use super::*;

/// Runs the tiny scene with changes; the program must refuse it at the line of `marker` and write nothing.
fn assert_refused(changes: &[(&str, &str)], marker: &str, expected: &[&str]) {
    let place = Place::new();
    let path = place.tiny(changes);
    let text = std::fs::read_to_string(&path).unwrap();
    let line = 1 + text.lines().position(|l| l.contains(marker)).expect("marker is in the scene");
    for command in ["run", "check"] {
        let mut args = vec![command, "tiny.toml"];
        if command == "run" {
            args.extend(["--out", "results"]);
        }
        let mut answer = place.call(&args).refused().says(&format!("tiny.toml:{line}:"));
        for text in expected {
            answer = answer.says(text);
        }
        assert!(!place.path("results").exists(), "{}", answer.all());
        assert!(!place.path("out").exists(), "{}", answer.all());
    }
    // The same without --out: no numbered folder either.
    place.call(&["run", "tiny.toml"]).refused();
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn unknown_key() {
    assert_refused(&[("gauge = ", "guage = ")], "guage", &["guage", "gauge"]);
}

#[test]
fn unknown_preset_names_the_near_one() {
    assert_refused(&[("across-fibre", "across-fiber")], "across-fiber", &["across-fibre"]);
}

#[test]
fn negative_modulus() {
    assert_refused(
        &[("preset = \"across-fibre\"", "youngs_modulus_kpa = -60.0\npoisson_ratio = 0.45")],
        "youngs_modulus_kpa",
        &["-60"],
    );
}

#[test]
fn unstable_constants() {
    assert_refused(
        &[("preset = \"across-fibre\"", "c10_kpa = 4.75\nc01_kpa = -4.91\nd_per_mpa = 4.0")],
        "c01_kpa",
        &["REFUSED", "shear modulus", "lv2022-refit"],
    );
}

#[test]
fn mesh_too_fine_for_the_memory() {
    assert_refused(
        &[("cell_size_mm = 1.2", "cell_size_mm = 0.002")],
        "cell_size_mm",
        &["too fine", "GiB", "write a cell_size_mm of"],
    );
}

#[test]
fn needle_outside_the_block() {
    assert_refused(
        &[("[[motion.phase]]", "[motion]\nentry_mm = [9.0, 0.0]\n[[motion.phase]]")],
        "entry_mm",
        &["outside"],
    );
    assert_refused(&[("depth_mm = 3.0", "depth_mm = 30.0")], "depth_mm = 30.0", &["too deep", "at most"]);
}

#[test]
fn numbers_that_are_none() {
    for (from, to) in [
        ("cell_size_mm = 1.2", "cell_size_mm = nan"),
        ("speed_mm_s = 2.0", "speed_mm_s = inf"),
        ("depth_mm = 3.0", "depth_mm = -inf"),
        ("size_mm = [14.0, 14.0, 9.0]", "size_mm = [14.0, nan, 9.0]"),
        ("mass_scaling = 40000", "mass_scaling = 1e999"),
    ] {
        assert_refused(&[(from, to)], to, &["not a finite number"]);
    }
}

#[test]
fn numbers_out_of_range() {
    for (from, to) in [
        ("speed_mm_s = 2.0", "speed_mm_s = 0.0"),
        ("speed_mm_s = 2.0", "speed_mm_s = -2.0"),
        ("cell_size_mm = 1.2", "cell_size_mm = 0.0"),
        ("tip_half_angle_deg = 18.0", "tip_half_angle_deg = 95.0"),
        ("mass_scaling = 40000", "mass_scaling = 0.5"),
    ] {
        assert_refused(&[(from, to)], to, &["write"]);
    }
}

#[test]
fn empty_motion() {
    let phase = "[[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 2.0\ndepth_mm = 3.0\n";
    assert_refused(&[(phase, "[motion]\nphase = []\n")], "[motion]", &["phase"]);
    let place = Place::new();
    place.tiny(&[(phase, "")]);
    place.call(&["run", "tiny.toml"]).refused().says("tiny.toml:").says("motion");
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn not_toml() {
    assert_refused(&[("title = \"tiny\"", "title = tiny'")], "title", &["not TOML"]);
}

#[test]
fn missing_file() {
    let place = Place::new();
    place.tiny(&[]);
    place.call(&["run", "tinny.toml", "--out", "results"]).refused().says("tinny.toml").says("did you mean");
    // A folder is no scene; it names those that it holds.
    place.call(&["run", ".", "--out", "results"]).refused().says(". is a folder").says("./tiny.toml");
    // An ending that all scenes share is no likeness.
    let answer = place.call(&["check", "nosuch.toml"]).refused();
    assert!(!answer.stderr.contains("did you mean"), "{}", answer.all());
    // A built-in scene of another folder is none of this one, but may be meant.
    let answer = place.call(&["run", "training/hit_target.toml"]).refused().says("scene file training/hit_target.toml");
    answer.says("did you mean scenes/training/hit_target.toml (built in)?");
    for (wrong, meant) in [
        ("scenes/muscle_biopsi.toml", "did you mean scenes/muscle_biopsy.toml (built in)?"),
        ("forearm.toml", "did you mean scenes/forearm.toml (built in)?"),
        ("scenes/training", "scenes/training/avoid_vessel.toml, scenes/training/core_biopsy.toml, "),
        ("./scenes/training/", "./scenes/training/ is a folder, not a scene file"),
    ] {
        place.call(&["check", wrong]).refused().says(meant);
    }
    assert_eq!(place.files("."), ["tiny.toml"]);
}

/// Names and values of any length and with any letters are shown, not repeated; the reason stays.
#[cfg(unix)]
#[test]
fn refusals_stay_short_and_plain() {
    let place = Place::new();
    place.tiny(&[]);
    let (long, words) = ("a".repeat(100_000), "a b ".repeat(25_000));
    let folders = "a/".repeat(50_000);
    let calls: [(&[&str], &str); 9] = [
        (&["run", &long], "File name too long"),
        (&["run", &folders], "File name too long"),
        (&["run", &words], "File name too long"),
        (&["check", "tiny.toml", "--engine", &long], "auto, gpu, cpu or cpu64"),
        (&["check", "tiny.toml", "--engine", &words], "auto, gpu, cpu or cpu64"),
        (&["fit", &long], "File name too long"),
        (&["run", "tiny.toml", "--out", &long], "File name too long"),
        (&["check", "\x1b[31mred.toml"], "\\u{1b}[31mred.toml"),
        (&["check", "tiny.toml", "--engine", "\x1b[31mred"], "auto, gpu, cpu or cpu64"),
    ];
    for (args, reason) in calls {
        let answer = place.call(args).ended(2).says("error: ").says(reason);
        assert!(answer.stderr.len() < 8_000, "{} bytes", answer.stderr.len());
        assert!(!answer.stderr.contains('\x1b'), "{}", answer.all());
    }
    // Nor does the title of a scene steer the terminal.
    place.tiny(&[("title = \"tiny\"", "title = \"\\u001b[31mred\"")]);
    let answer = place.call(&["check", "tiny.toml", "--engine", "cpu"]).ended(0);
    assert!(answer.stdout.contains("\\u{1b}[31mred") && !answer.stdout.contains('\x1b'), "{}", answer.all());
}

/// What a fit needs is looked at before the fit.
#[test]
fn a_fit_is_refused_before_it_begins() {
    let place = Place::new();
    place.write("curve.csv", "stretch,stress_kpa\n1,0\n1.1,1\n1.2,2\n1.3,3\n1.4,4.4\n");
    place.write("file", "");
    place
        .call(&["fit", "curve.csv", "--preset", "a", "--law", "nonsense"])
        .refused()
        .says("`nonsense` is no law")
        .says("yeoh");
    place.call(&["fit", "curve.csv", "--out", "file"]).refused().says("file: cannot be used as a folder");
    place.call(&["fit", "curve.csv", "--out", "fitted", "--preset", "a"]).ended(0);
    place.call(&["fit", "curve.csv", "--out", "fitted", "--preset", "b"]).refused().says("fit.svg is already there");
    place
        .call(&["material", "muscle-60kpa", "--effects", "plasticity,plasticity"])
        .refused()
        .says("`plasticity` is listed twice");
}

/// What never ends, or is larger than anything a person means, is refused before it is read.
#[cfg(unix)]
#[test]
fn endless_and_huge_sources_are_refused_at_once() {
    let place = Place::new();
    let made = std::process::Command::new("mkfifo").arg(place.path("pipe")).status().unwrap();
    assert!(made.success());
    std::fs::create_dir_all(place.path("pipes/runs")).unwrap();
    for name in ["checkpoint.stylet", "session.json", "plan.json"] {
        std::os::unix::fs::symlink(place.path("pipe"), place.path("pipes").join(name)).unwrap();
    }
    for name in ["huge.toml", "huge.msh", "huge.csv", "huge.json"] {
        std::fs::File::create(place.path(name)).unwrap().set_len(2 << 30).unwrap();
    }
    // Within the bounds, but there is nothing in them behind their heads.
    std::fs::create_dir(place.path("hollow")).unwrap();
    for (name, head, length) in [
        ("hole.vtk", "# vtk DataFile Version 3.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 30000000 float\n", 380),
        ("hole.inp", "*NODE\n", 380),
        ("hollow/checkpoint.stylet", "stylet checkpoint 1\n", 250),
        ("hole.csv", "stretch,stress_kpa\n", 16),
    ] {
        std::fs::write(place.path(name), head).unwrap();
        std::fs::File::options().append(true).open(place.path(name)).unwrap().set_len(length << 20).unwrap();
    }
    for name in ["pipe.msh", "zero.msh"] {
        std::os::unix::fs::symlink(if name == "pipe.msh" { "pipe" } else { "/dev/zero" }, place.path(name)).unwrap();
    }
    place.tiny(&[]);
    let mesh = |name: &str| {
        format!(
            "[tissue]\nmesh = \"{name}\"\nunit = \"mm\"\n[material]\npreset = \"fat\"\n[solver]\nduration_s = 0.1\n\
             [boundaries]\nz_min = \"fixed\"\n"
        )
    };
    for name in ["pipe.msh", "zero.msh", "huge.msh", "hole.vtk", "hole.inp"] {
        place.write(&format!("of_{name}.toml"), &mesh(name));
    }
    let library = |name: &str| TINY.replace("preset =", &format!("library = \"{name}\"\npreset ="));
    for name in ["pipe", "huge.toml"] {
        place.write(&format!("library_{name}.toml"), &library(name));
    }
    let calls: &[&[&str]] = &[
        &["run", "pipe"],
        &["check", "/dev/zero"],
        &["check", "/dev/stdin"],
        &["check", "huge.toml"],
        &["check", "of_pipe.msh.toml"],
        &["check", "of_zero.msh.toml"],
        &["check", "of_huge.msh.toml"],
        &["check", "library_pipe.toml"],
        &["check", "library_huge.toml.toml"],
        &["check", "of_hole.vtk.toml"],
        &["check", "of_hole.inp.toml"],
        &["run", "--resume", "hollow"],
        &["fit", "hole.csv"],
        &["fit", "pipe"],
        &["fit", "/dev/zero"],
        &["fit", "huge.csv"],
        &["replay", "pipe"],
        &["replay", "/dev/zero"],
        &["replay", "huge.json"],
        &["replay", "pipes"],
        &["run", "--resume", "pipes"],
        &["study", "--merge", "pipes", "--out", "whole"],
        &["study", "--merge", "tiny.toml", "--out", "whole"],
    ];
    for args in calls {
        let begin = std::time::Instant::now();
        let answer = place.call(args).refused();
        let took = begin.elapsed().as_secs_f64();
        assert!(took < 5.0, "{args:?} took {took} s\n{}", answer.all());
        assert_eq!(answer.stderr.matches("error: ").count(), 1, "{}", answer.all());
        let hollow = args.iter().any(|arg| arg.contains("hole.") || *arg == "hollow");
        assert!(!hollow || !cfg!(target_os = "linux") || answer.stderr.contains("a hole"), "{}", answer.all());
    }
}

/// `--resume` says why there is nothing to go on with.
#[test]
fn a_run_that_cannot_go_on_says_why() {
    let place = Place::new();
    place.tiny(&[("depth_mm = 3.0", "depth_mm = 0.1")]);
    place.call(&["run", "tiny.toml", "--engine", "cpu", "--out", "out"]).ended(0);
    place.call(&["run", "--resume", "out"]).refused().says("the run in out has finished");
    std::fs::create_dir(place.path("empty")).unwrap();
    place.call(&["run", "--resume", "empty"]).refused().says("no run was stopped there");
    // What became of the run cannot be seen.
    place.write("empty/summary.json", "{ \"status\": ");
    place.call(&["run", "--resume", "empty"]).refused().says("empty/summary.json").says("cannot be read");
    place.call(&["run", "--resume", "none"]).refused().says("there is no checkpoint none");
}

#[test]
fn a_file_that_is_not_text() {
    let place = Place::new();
    std::fs::write(place.path("tiny.toml"), [0xff, 0xfe, 0x00, 0x80]).unwrap();
    place.call(&["run", "tiny.toml"]).refused().says("tiny.toml");
}

#[test]
fn output_folder_that_cannot_be_written_to() {
    let place = Place::new();
    place.tiny(&[]);
    place.write("file", "");
    for out in ["file", "file/below"] {
        place.call(&["run", "tiny.toml", "--out", out]).refused().says(out).says("--out");
    }
    assert_eq!(place.files("."), ["file", "tiny.toml"]);
}

/// Permission bits do not stop an administrator, a file system that holds no files does.
#[cfg(target_os = "linux")]
#[test]
fn output_folder_on_a_read_only_file_system() {
    let place = Place::new();
    place.tiny(&[]);
    place.call(&["run", "tiny.toml", "--out", "/proc/results"]).refused().says("/proc/results");
}

#[cfg(unix)]
#[test]
fn output_folder_without_write_permission() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new();
    place.tiny(&[]);
    std::fs::create_dir(place.path("locked")).unwrap();
    let set = |mode| {
        std::fs::set_permissions(place.path("locked"), std::fs::Permissions::from_mode(mode)).unwrap();
    };
    set(0o555);
    // An administrator may write all the same: then there is nothing to see here.
    let may_write = std::fs::write(place.path("locked/probe"), "").is_ok();
    let answer = place.call(&["run", "tiny.toml", "--out", "locked"]);
    set(0o755);
    if may_write {
        eprintln!("skipped: this user may write to every folder");
    } else {
        answer.refused().says("locked");
        assert!(place.files("locked").is_empty());
    }
}

#[test]
fn wrong_commands_and_options() {
    let place = Place::new();
    place.tiny(&[]);
    let calls: [(&[&str], &str); 10] = [
        (&["run", "tiny.toml", "--frob"], "--frob"),
        (&["frobnicate", "tiny.toml"], "no subcommand and no scene file called frobnicate"),
        (&["chek", "tiny.toml"], "did you mean stylet check?"),
        (&["chek"], "did you mean stylet check?"),
        (&["chek", "--engine", "cpu"], "did you mean stylet check?"),
        (&["run", "tiny.toml", "--engine", "tpu"], "auto, gpu, cpu or cpu64"),
        (&["run", "tiny.toml", "--out"], "--out"),
        (&["bench", "--max-cells", "many"], "many"),
        (&["bench", "--stages", "--engine", "cpu"], "--engine gpu"),
        (&["schema", "tiny.toml"], "tiny.toml"),
    ];
    for (args, text) in calls {
        let answer = place.call(args).ended(2).says("error: ").says(text);
        assert!(!answer.stderr.contains("error: error:"), "{}", answer.all());
    }
    // A word that is no command is taken as a scene file; the message says so.
    place.call(&["frobnicate"]).refused().says("frobnicate").says("scene file");
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn wrong_overrides() {
    let place = Place::new();
    place.tiny(&[]);
    for (text, expected) in [
        ("tissue.cell_size_mm", "there is no `=`"),
        ("tissue.cellsize_mm=1", "unknown field"),
        ("tissue.cell_size_mm=", "no value"),
        ("tissue.cell_size_mm=-1", "-1"),
        ("tissue.cell_size_mm=nan", "not a finite number"),
        ("motion.phase.7.depth_mm=2", "no index"),
        ("tissue=3", "--set tissue=3"),
        ("tissue.size_mm=[14, 14, 9, 4]", "`tissue.size_mm` has 4 entries, 3 are wanted"),
        (&format!("tissue{}=1", ".a".repeat(50_000)), "the key has more than"),
        (&format!("tissue.{}=1", "a".repeat(50_000)), "aaa...aaa"),
    ] {
        place.call(&["run", "tiny.toml", "--set", text, "--out", "results"]).refused().says("--set").says(expected);
    }
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn printed_table_of_the_paper() {
    let place = Place::new();
    let scene = repository().join("scenes/lv2022/table1_as_printed.toml");
    for command in ["check", "run"] {
        let answer = place.call(&[command, scene.to_str().unwrap()]).refused();
        assert_eq!(answer.stderr.matches("REFUSED").count(), 3, "{}", answer.all());
        assert_eq!(answer.stderr.matches("way out: ").count(), 3, "{}", answer.all());
        answer.says("table1_as_printed.toml:").says("lv2022-refit");
    }
    assert!(place.files(".").is_empty());
}

#[test]
fn wrong_adapter_name_lists_the_right_ones() {
    let place = Place::new();
    if !place.has_adapter() {
        return;
    }
    place.tiny(&[]);
    let listed = place.call(&["adapters"]).ended(0).stdout;
    let first = listed.lines().next().unwrap().trim_start_matches("* ").to_string();
    for engine in ["auto", "gpu"] {
        for args in [
            vec!["run", "tiny.toml", "--out", "results", "--engine", engine],
            vec!["check", "tiny.toml", "--engine", engine],
        ] {
            place
                .call_with(&args, &[("WGPU_ADAPTER_NAME", "no such adapter")])
                .refused()
                .says("WGPU_ADAPTER_NAME=no such adapter")
                .says(&first);
        }
    }
    assert_eq!(place.files("."), ["tiny.toml"]);
}

#[test]
fn wrong_backend_name() {
    let place = Place::new();
    place.tiny(&[]);
    for engine in ["auto", "gpu"] {
        place
            .call_with(
                &["run", "tiny.toml", "--out", "results", "--engine", engine],
                &[("WGPU_BACKEND", "vulkan,direct3d")],
            )
            .refused()
            .says("direct3d")
            .says("vulkan, metal, dx12, gl");
    }
    place.call_with(&["adapters"], &[("WGPU_BACKEND", "direct3d")]).refused();
    assert_eq!(place.files("."), ["tiny.toml"]);
}

/// Drivers that are not there: neither Vulkan nor EGL finds one.
#[cfg(target_os = "linux")]
const NO_DRIVERS: [(&str, &str); 3] = [
    ("VK_ICD_FILENAMES", "/nonexistent.json"),
    ("VK_DRIVER_FILES", "/nonexistent.json"),
    ("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent.json"),
];

#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter() {
    let place = Place::new();
    place.tiny(&[]);
    let answer = place.call_with(&["adapters"], &NO_DRIVERS).ended(0);
    if answer.stdout.starts_with("no adapter found") {
        assert!(answer.stdout.contains("way out: "), "{}", answer.all());
        // auto: a notice and the CPU engine.
        let answer = place.call_with(&["run", "tiny.toml", "--out", "results"], &NO_DRIVERS).ended(0);
        let answer = answer.says("note: running on the CPU engine").says("no GPU adapter found");
        assert_eq!(place.summary("results")["engine"], "cpu", "{}", answer.all());
        assert!(place.files("results").iter().any(|f| f == "stress_03.00mm.png"));
        // gpu: an error.
        let answer = place.call_with(&["run", "tiny.toml", "--out", "other", "--engine", "gpu"], &NO_DRIVERS);
        answer.refused().says("no GPU adapter found");
        assert!(!place.path("other").exists());
    } else {
        eprintln!("skipped: an adapter is found without drivers\n{}", answer.stdout);
    }
    // A backend that this system does not have was asked for by name: an error even with auto.
    for engine in ["auto", "gpu"] {
        place
            .call_with(&["run", "tiny.toml", "--out", "other", "--engine", engine], &[("WGPU_BACKEND", "dx12")])
            .refused()
            .says("no GPU adapter found");
        assert!(!place.path("other").exists());
    }
}
