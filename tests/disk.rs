//! Disks that are full and folders that cannot be written to: the program says which file and what to do, ends with a code, and
//! leaves what is there whole.
#![cfg(unix)]

use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

/// A needle that goes 2 mm into coarse tissue: half a second on the CPU engine, tables of 20 to 40 kB.
const SCENE: &str = r#"title = "short"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
size_mm = [14.0, 14.0, 9.0]
cell_size_mm = 1.2
[material]
preset = "across-fibre"
[needle]
gauge = "16G"
tip_half_angle_deg = 18.0
[[motion.phase]]
kind = "insert"
speed_mm_s = 2.0
depth_mm = 3.0
[puncture]
scheme = "ring"
[solver]
mass_scaling = 10000
[outputs]
pictures_at_depth_mm = []
fields_at_depth_mm = []
"#;

/// A stone in a soft block, with a step that is too long for the stone.
const UNSTABLE: &str = r#"effects = []
[tissue]
size_mm = [8.0, 8.0, 8.0]
cell_size_mm = 1.0
[material]
preset = "across-fibre"
[[region]]
name = "stone"
sphere_mm = { centre = [2.0, 1.0, -5.0], radius = 1.2 }
material = { law = "neo_hookean", c10_kpa = 1000.0, poisson_ratio = 0.45 }
[boundaries]
z_max = { fixed = ["x", "y", "z"], displacement_mm = [0.0, 0.0, -0.4], duration_s = 0.02 }
[solver]
duration_s = 0.05
frame_rate_hz = 2000.0
time_step_us = 30.0
"#;

const TABLES: [&str; 2] = ["force.csv", "energy.csv"];

/// A folder in which the program is called, with both scenes.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Place(tempfile::tempdir().unwrap());
        std::fs::write(place.path("short.toml"), SCENE).unwrap();
        std::fs::write(place.path("unstable.toml"), UNSTABLE).unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The program, called directly.
    fn call(&self, arguments: &str) -> Output {
        self.shell(&format!("exec \"$STYLET\" {arguments}"))
    }

    /// The program under a limit on the size of a file [KiB], as a shell or a scheduler sets it: with the signal that ends programs.
    fn call_limited(&self, kib: u64, arguments: &str) -> Output {
        self.shell(&format!("trap - XFSZ; ulimit -f {kib}; exec \"$STYLET\" {arguments}"))
    }

    fn shell(&self, line: &str) -> Output {
        let mut command = Command::new("bash");
        command.args(["-c", line]).env("STYLET", env!("CARGO_BIN_EXE_stylet")).current_dir(self.0.path());
        command.output().unwrap()
    }

    /// Runs the short scene into `out`, kills it after its first checkpoint.
    fn killed_run(&self, out: &str) {
        let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
            .args(["run", "short.toml", "--engine", "cpu64", "--out", out, "--checkpoint", "0.05"])
            .current_dir(self.0.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begin = Instant::now();
        // The first one may be smaller than what a run must find to begin.
        let size = || std::fs::metadata(self.path(out).join("checkpoint.stylet")).map_or(0, |found| found.len());
        while size() < 21_000 {
            assert!(begin.elapsed() < Duration::from_secs(60), "no checkpoint came");
            assert!(child.try_wait().unwrap().is_none(), "the run ended before its first checkpoint");
            std::thread::sleep(Duration::from_millis(2));
        }
        child.kill().unwrap();
        child.wait().unwrap();
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// Names of unfinished files, anywhere in the folder.
    fn leftovers(&self, out: &str) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(self.path(out)).unwrap().map(|e| e.unwrap().path());
        entries.filter(|p| p.extension().is_some_and(|e| e == "part")).collect()
    }
}

fn told(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The message names `file`, the reason and a way out, and the program ended with `code`.
fn assert_told(output: &Output, code: i32, file: &str, reason: &str) -> String {
    let text = told(output);
    assert_eq!(output.status.code(), Some(code), "{text}");
    let line = text.lines().find(|l| l.starts_with("error: ")).unwrap_or_else(|| panic!("{text}"));
    assert!(line.contains(file) && line.contains(reason), "{file}, {reason}:\n{text}");
    assert!(text.contains("way out: "), "{text}");
    text
}

/// Every table ends with a whole row, all with that of the same frame; returns the number of rows.
fn assert_whole_tables(folder: &Path) -> usize {
    let rows = TABLES.map(|name| {
        let text = std::fs::read_to_string(folder.join(name)).unwrap();
        assert!(text.ends_with('\n'), "{name} ends within a row: {:?}", text.lines().last());
        let columns = text.lines().next().unwrap().split(',').count();
        assert!(text.lines().all(|line| line.split(',').count() == columns), "{name} has a row of another length");
        text.lines().count() - 1
    });
    assert_eq!(rows[0], rows[1], "the tables end with different frames");
    rows[0]
}

#[test]
fn a_disk_that_fills_up_within_a_run_leaves_whole_rows_and_a_checkpoint() {
    let place = Place::new();
    let output = place.call("run short.toml --engine cpu64 --out whole --checkpoint 0");
    assert!(output.status.success(), "{}", told(&output));
    place.killed_run("out");
    let (checkpoint, at_kill) = (place.bytes("out/checkpoint.stylet"), assert_whole_tables(&place.path("out")));
    let whole = TABLES.map(|name| place.bytes(&format!("whole/{name}")));
    let size = whole.iter().map(Vec::len).max().unwrap() as u64;
    let begun = TABLES.map(|name| place.bytes(&format!("out/{name}")).len() as u64).into_iter().max().unwrap();
    assert!(begun + 2048 < size, "{begun} B of {size} B are there when the run is killed: nothing is left to fail");

    // No room for what is there already: nothing is touched.
    let before = TABLES.map(|name| place.bytes(&format!("out/{name}")));
    let output = place.call_limited(4, "run --resume out --checkpoint 0");
    assert_told(&output, 2, "no room for results in out", "File too large");
    assert_eq!(TABLES.map(|name| place.bytes(&format!("out/{name}"))), before);
    assert_eq!(place.bytes("out/checkpoint.stylet"), checkpoint);

    // Room for a part of the rows: they end with a whole one, and the checkpoint stays.
    let limit = ((begun + size) / 2).div_ceil(1024).max(18);
    assert!(limit * 1024 < size, "a limit of {limit} KiB lets {size} B pass");
    let output = place.call_limited(limit, "run --resume out --checkpoint 0");
    let text = assert_told(&output, 1, ".csv", "File too large");
    assert!(text.contains("ulimit -f") && text.contains("go on with: stylet run --resume out"), "{text}");
    let rows = assert_whole_tables(&place.path("out"));
    assert!(rows >= at_kill, "{rows} rows, {at_kill} before");
    assert_eq!(place.bytes("out/checkpoint.stylet"), checkpoint);
    assert!(place.leftovers("out").is_empty(), "{:?}", place.leftovers("out"));
    let summary: serde_json::Value = serde_json::from_slice(&place.bytes("out/summary.json")).unwrap();
    assert!(summary["status"].to_string().contains(".csv"), "{summary}");
    println!("stopped after {rows} rows at {limit} KiB, {at_kill} rows when killed");

    // What a program that was killed had begun to write is cleared away.
    std::fs::write(place.path("out/checkpoint.stylet.part"), "half").unwrap();
    // With room again the run goes on to what it would have been.
    let output = place.call("run --resume out");
    assert!(output.status.success(), "{}", told(&output));
    assert_eq!(TABLES.map(|name| place.bytes(&format!("out/{name}"))), whole);
    assert!(!place.path("out/checkpoint.stylet").exists());
    assert!(place.leftovers("out").is_empty(), "{:?}", place.leftovers("out"));
}

#[test]
fn a_checkpoint_that_cannot_be_written_leaves_the_one_before() {
    let place = Place::new();
    place.killed_run("out");
    let checkpoint = place.bytes("out/checkpoint.stylet");
    // Less than the checkpoint, which comes before the tables have grown so long; more than what a run must find to begin.
    let limit = checkpoint.len() as u64 / 1024 - 2;
    assert!(limit > 17, "a checkpoint of {} B", checkpoint.len());
    let output = place.call_limited(limit, "run --resume out --checkpoint 0.02");
    // The run goes on without, until its other files do not fit either.
    let text = assert_told(&output, 1, "out/", "File too large");
    let note = "out/checkpoint.stylet: File too large (os error 27); the one before is kept, the run goes on without";
    assert_eq!(text.matches(note).count(), 1, "{text}");
    assert!(text.contains("go on with: stylet run --resume out"), "{text}");
    assert_eq!(place.bytes("out/checkpoint.stylet"), checkpoint);
    assert_whole_tables(&place.path("out"));
    assert!(place.leftovers("out").is_empty(), "{:?}", place.leftovers("out"));
    let output = place.call("run --resume out");
    assert!(output.status.success(), "{}", self::told(&output));
}

/// A run whose tables fit is not ended by a checkpoint that does not; and whoever could go on from nothing is told so.
#[test]
fn a_run_without_room_for_a_checkpoint() {
    let place = Place::new();
    let fine = SCENE.replace("cell_size_mm = 1.2", "cell_size_mm = 0.7").replace("depth_mm = 3.0", "depth_mm = 0.5");
    std::fs::write(place.path("fine.toml"), fine).unwrap();
    let output = place.call_limited(64, "run fine.toml --engine cpu64 --out out --checkpoint 0.05");
    let text = told(&output);
    assert!(output.status.success(), "{text}");
    let note = "out/checkpoint.stylet: File too large (os error 27); there is none, the run goes on without";
    assert_eq!(text.matches(note).count(), 1, "{text}");
    assert_whole_tables(&place.path("out"));
    assert!(place.leftovers("out").is_empty() && !place.path("out/checkpoint.stylet").exists());

    // Neither the tables nor a checkpoint fit.
    let output = place.call_limited(18, "run short.toml --engine cpu64 --out bare --checkpoint 0");
    let text = assert_told(&output, 1, ".csv", "File too large");
    assert!(text.contains("note: no checkpoint could be written either, so the run cannot go on from here"), "{text}");
    assert!(text.contains("bare/checkpoint.stylet: File too large") && !text.contains("go on with"), "{text}");
}

/// A disk of its own, as small as the test wants it, in a name space where the user may mount one.
#[test]
fn a_disk_that_is_really_full() {
    let place = Place::new();
    std::fs::create_dir(place.path("kept")).unwrap();
    let output = place.shell("unshare --user --map-root-user --mount true");
    if !output.status.success() {
        println!("skipped: no disk can be mounted here: {}", told(&output).trim());
        return;
    }
    let on_disk = |kib: u64, line: &str| {
        place.shell(&format!(
            "unshare --user --map-root-user --mount bash -c 'mkdir -p disk && mount -t tmpfs -o size={kib}k tmpfs disk && \
             {{ {line}; code=$?; cp -r disk/. kept/; exit $code; }}'"
        ))
    };
    // Room to begin, not to end.
    let output = on_disk(40, "\"$STYLET\" run short.toml --engine cpu64 --out disk/out --checkpoint 0");
    let text = told(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(text.contains("No space left on device") && text.contains("disk/out/"), "{text}");
    assert!(
        text.contains("way out: free space") && text.contains("results up to the failure are in disk/out"),
        "{text}"
    );
    let rows = assert_whole_tables(&place.path("kept/out"));
    assert!(rows > 3, "{rows} rows");
    // No room to begin: results of a run before are not removed, though --force allows it.
    std::fs::remove_dir_all(place.path("kept")).unwrap();
    std::fs::create_dir(place.path("kept")).unwrap();
    let line = "mkdir disk/out && printf old >disk/out/force.csv && head -c 999999 /dev/zero >disk/filling 2>/dev/null; \
                \"$STYLET\" run short.toml --engine cpu64 --out disk/out --force";
    let output = on_disk(64, line);
    assert_told(&output, 2, "no room for results in disk/out", "No space left on device");
    assert_eq!(place.bytes("kept/out/force.csv"), b"old");
    assert!(place.leftovers("kept/out").is_empty());
}

/// The program as somebody whom permissions bind: this user, or for root the user `nobody`. `None` where nobody cannot call it.
fn bound_call(place: &Place, arguments: &[&str]) -> Option<Output> {
    let command = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
        command.args(arguments).current_dir(place.0.path());
        command
    };
    // Root can write to a folder that forbids it.
    let probe = place.path("probe");
    std::fs::create_dir_all(&probe).unwrap();
    std::fs::set_permissions(&probe, PermissionsExt::from_mode(0o555)).unwrap();
    let is_bound = std::fs::write(probe.join("file"), "").is_err();
    if is_bound {
        return Some(command(arguments).output().unwrap());
    }
    const NOBODY: u32 = 65534;
    let can_call = command(&["--version"]).uid(NOBODY).gid(NOBODY).output().is_ok_and(|o| o.status.success());
    can_call.then(|| command(arguments).uid(NOBODY).gid(NOBODY).output().unwrap())
}

#[test]
fn a_read_only_folder_keeps_its_results() {
    let place = Place::new();
    place.killed_run("out");
    let names = ["out/force.csv", "out/energy.csv", "out/checkpoint.stylet"];
    let before = names.map(|name| place.bytes(name));
    std::fs::set_permissions(place.0.path(), PermissionsExt::from_mode(0o755)).unwrap();
    std::fs::set_permissions(place.path("out"), PermissionsExt::from_mode(0o555)).unwrap();
    let mut bound = 0;
    for arguments in [
        &["run", "--resume", "out"][..],
        &["run", "short.toml", "--engine", "cpu64", "--out", "out", "--force"],
        &["run", "short.toml", "--engine", "cpu64", "--out", "out/inner"],
    ] {
        let Some(output) = bound_call(&place, arguments) else { continue };
        assert_told(&output, 2, "cannot write results to out", "Permission denied");
        bound += 1;
    }
    if bound == 0 {
        println!("skipped: permissions do not bind this user, and `nobody` cannot call the program");
    }
    std::fs::set_permissions(place.path("out"), PermissionsExt::from_mode(0o755)).unwrap();
    assert_eq!(names.map(|name| place.bytes(name)), before);
    // A file where the folder should be stops everybody.
    for out in ["short.toml", "short.toml/inner"] {
        let output = place.call(&format!("run unstable.toml --engine cpu64 --out {out}"));
        assert_told(&output, 2, &format!("cannot write results to {out}"), "os error");
    }
    assert_eq!(place.bytes("short.toml"), SCENE.as_bytes());
    let output = place.call("run --resume out");
    assert!(output.status.success(), "{}", told(&output));
}

#[test]
fn a_failure_is_told_where_forensics_cannot_be_written() {
    let place = Place::new();
    // A file in the place of the folder.
    std::fs::create_dir(place.path("out")).unwrap();
    std::fs::write(place.path("out/forensics"), "mine").unwrap();
    let output = place.call("run unstable.toml --engine cpu64 --out out");
    let text = assert_told(&output, 3, "run stopped in frame", "");
    assert!(text.contains("no forensics: out/forensics: ") && text.contains("way out: a file stands"), "{text}");
    assert!(place.bytes("out/forensics") == b"mine" && place.path("out/summary.json").exists());
    let rows = assert_whole_tables(&place.path("out"));
    assert!(rows > 0);

    // Files that are too large: those that fit are there, the others are named.
    let whole = place.call("run unstable.toml --engine cpu64 --out whole");
    assert_eq!(whole.status.code(), Some(3), "{}", told(&whole));
    let size = |name: &str| std::fs::metadata(place.path("whole/forensics").join(name)).unwrap().len();
    let limit = 40;
    let (too_large, fit): (Vec<&str>, Vec<&str>) =
        ["report.txt", "finding.json", "steps.csv", "last_energies.csv", "place.png", "checkpoint.stylet"]
            .into_iter()
            .partition(|name| size(name) > limit * 1024);
    assert!(!too_large.is_empty() && fit.contains(&"report.txt"), "{too_large:?} {fit:?}");
    let output = place.call_limited(limit, "run unstable.toml --engine cpu64 --out less");
    let text = assert_told(&output, 3, "run stopped in frame", "");
    assert!(text.contains("the forensics in less/forensics are not complete"), "{text}");
    for name in too_large {
        assert!(text.contains(&format!("less/forensics/{name}: File too large")), "{name}\n{text}");
        assert!(!place.path("less/forensics").join(name).exists(), "{name}");
    }
    for name in fit {
        assert!(place.path("less/forensics").join(name).exists(), "{name}\n{text}");
    }
    assert_eq!(assert_whole_tables(&place.path("less")), rows);
    assert!(place.leftovers("less/forensics").is_empty());
}

/// What goes to standard output is a result too.
#[test]
fn standard_output_that_is_full_is_a_failure() {
    if !Path::new("/dev/full").exists() {
        println!("skipped: no /dev/full");
        return;
    }
    let place = Place::new();
    let output = place.shell("\"$STYLET\" check short.toml >/dev/full");
    assert_told(&output, 1, "standard output", "No space left on device");
    for arguments in ["--help", "run --help", "--version"] {
        let output = place.shell(&format!("\"$STYLET\" {arguments} >/dev/full"));
        assert_told(&output, 1, "standard output", "No space left on device");
    }
    // A reader that has enough is none.
    let output = place.shell("set -o pipefail; \"$STYLET\" schema | head -n 1");
    assert!(output.status.success(), "{}", told(&output));
}
