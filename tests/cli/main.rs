//! The program as a user calls it: right calls, wrong calls, wrong files.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use assert_cmd::cargo::CommandCargoExt;
use serde_json::Value;
use tempfile::TempDir;

mod import;
mod refusals;
mod runs;

/// A scene that runs in a fraction of a second on either engine.
const TINY: &str = r#"# A coarse block, scaled mass.
title = "tiny"
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

[solver]
mass_scaling = 40000

[outputs]
pictures_at_depth_mm = [2.0, 3.0]
fields_at_depth_mm = [3.0]
"#;

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// All scene files of the repository, sorted.
fn scene_files() -> Vec<PathBuf> {
    fn below(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                below(&path, found);
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    below(&repository().join("scenes"), &mut found);
    found.sort();
    assert!(found.len() >= 13, "{found:?}");
    found
}

/// A folder of its own in which the program is called.
struct Place {
    folder: TempDir,
}

/// What a call left on the terminal.
struct Answer {
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

impl From<Output> for Answer {
    fn from(output: Output) -> Self {
        Answer {
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        }
    }
}

impl Answer {
    fn all(&self) -> String {
        format!("code {:?}\n--- stdout\n{}\n--- stderr\n{}", self.code, self.stdout, self.stderr)
    }

    /// Ended with `code`, without a panic.
    fn ended(self, code: i32) -> Self {
        assert!(!self.stderr.contains("panicked"), "{}", self.all());
        assert_eq!(self.code, Some(code), "{}", self.all());
        self
    }

    /// Standard error holds the text.
    fn says(self, text: &str) -> Self {
        assert!(self.stderr.contains(text), "no `{text}` in\n{}", self.all());
        self
    }

    /// One message with a way out: `error: ` once per problem, nothing on standard output.
    fn refused(self) -> Self {
        let answer = self.ended(2).says("error: ").says("way out: ");
        assert!(!answer.stderr.contains("error: error:"), "{}", answer.all());
        assert_eq!(answer.stdout, "", "{}", answer.all());
        answer
    }
}

impl Place {
    fn new() -> Self {
        Place { folder: tempfile::tempdir().unwrap() }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    /// The tiny scene with changes; every text to be replaced must occur.
    fn tiny(&self, changes: &[(&str, &str)]) -> PathBuf {
        let mut text = TINY.to_string();
        for (from, to) in changes {
            assert!(text.contains(from), "`{from}` is not in the tiny scene");
            text = text.replacen(from, to, 1);
        }
        self.write("tiny.toml", &text)
    }

    /// The program, called in this folder and free of the caller's choice of an adapter.
    fn program(&self, args: &[&str]) -> std::process::Command {
        let mut command = std::process::Command::cargo_bin("stylet").unwrap();
        command.current_dir(self.folder.path()).args(args).stdin(Stdio::null());
        for name in ["WGPU_ADAPTER_NAME", "WGPU_BACKEND", "RUST_LOG"] {
            command.env_remove(name);
        }
        command
    }

    fn call(&self, args: &[&str]) -> Answer {
        self.call_with(args, &[])
    }

    fn call_with(&self, args: &[&str], variables: &[(&str, &str)]) -> Answer {
        self.program(args).envs(variables.iter().copied()).output().unwrap().into()
    }

    /// Files below the folder, relative, sorted.
    fn files(&self, below: &str) -> Vec<String> {
        fn walk(folder: &Path, base: &Path, found: &mut Vec<String>) {
            for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
                let path = entry.path();
                if path.is_dir() {
                    walk(&path, base, found);
                } else {
                    found.push(path.strip_prefix(base).unwrap().display().to_string());
                }
            }
        }
        let base = self.path(below);
        let mut found = Vec::new();
        walk(&base, &base, &mut found);
        found.sort();
        found
    }

    fn summary(&self, folder: &str) -> Value {
        let text = std::fs::read_to_string(self.path(folder).join("summary.json")).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    /// Header and rows of a table; every line is complete.
    fn table(&self, folder: &str, name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
        let text = std::fs::read_to_string(self.path(folder).join(name)).unwrap();
        assert!(text.ends_with('\n'), "{name} ends in the middle of a line");
        let mut lines = text.lines();
        let header: Vec<String> = lines.next().unwrap().split(',').map(str::to_string).collect();
        let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
        for row in &rows {
            assert_eq!(row.len(), header.len(), "{name}: {row:?}");
        }
        (header, rows)
    }

    /// True where a GPU adapter is found; says so where not, and fails under `REQUIRE_GPU=1`.
    fn has_adapter(&self) -> bool {
        let found = !self.call(&["adapters"]).ended(0).stdout.starts_with("no adapter found");
        if !found {
            assert!(std::env::var_os("REQUIRE_GPU").is_none_or(|v| v != "1"), "REQUIRE_GPU=1 and no adapter");
            eprintln!("skipped: no GPU adapter");
        }
        found
    }
}
