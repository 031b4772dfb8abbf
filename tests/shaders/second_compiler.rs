//! Every shader by another WGSL compiler than the one that wgpu brings: Tint where `tint` is in PATH, and the program `naga`.

use std::path::Path;
use std::process::{Command, Stdio};

use rayon::prelude::*;

use super::{DRAWING, everything};

/// A compiler by its program and the arguments before the file.
const COMPILERS: [(&str, &[&str]); 2] = [("tint", &["--format", "wgsl"]), ("naga", &[])];

/// What the compiler says against a file; `None`: nothing.
fn refusal(program: &str, arguments: &[&str], file: &Path) -> Option<String> {
    let output = Command::new(program).args(arguments).arg(file).stdin(Stdio::null()).output();
    let output = output.unwrap_or_else(|e| panic!("{program}: {e}"));
    (!output.status.success()).then(|| String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Whether the program can be called; what `--help` ends with differs.
fn is_there(program: &str) -> bool {
    Command::new(program).arg("--help").stdin(Stdio::null()).output().is_ok()
}

#[test]
fn another_compiler_takes_every_shader() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = DRAWING.map(|(what, text)| (what, text.to_string()));
    let texts: Vec<(&str, &String)> = everything()
        .iter()
        .map(|(what, r)| (what.as_str(), &r.composed.source))
        .chain(pictures.iter().map(|(what, text)| (*what, text)))
        .collect();
    let files: Vec<_> = texts
        .iter()
        .enumerate()
        .map(|(n, (what, text))| {
            let path = folder.path().join(format!("{n}.wgsl"));
            std::fs::write(&path, text).unwrap();
            (what, path)
        })
        .collect();
    let broken = folder.path().join("broken.wgsl");
    std::fs::write(&broken, "@compute @workgroup_size(1) fn main() { let x: f32 = vec2(1.0, 2.0); }").unwrap();
    for (program, arguments) in COMPILERS {
        if !is_there(program) {
            println!("{program} is not in PATH: its opinion is not known");
            continue;
        }
        assert!(refusal(program, arguments, &broken).is_some(), "{program} takes a shader that is wrong");
        let refused: Vec<String> = files
            .par_iter()
            .filter_map(|(what, path)| Some(format!("{what}:\n{}", refusal(program, arguments, path)?)))
            .collect();
        let first = refused.iter().take(3).cloned().collect::<Vec<_>>().join("\n");
        assert!(refused.is_empty(), "{program} refuses {} of {} shaders:\n{first}", refused.len(), files.len());
        println!("{program} takes all {} shaders", files.len());
    }
}
