//! Lists the files that are built into the program: scenes, meshes and curves (`src/reading.rs`), and shaders (`src/gpu/compose.rs`).

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let built_in = files(&["scenes", "assets/cases", "assets/curves", "assets/meshes", "assets/thumbnails"])?;
    list(
        "built_in.rs",
        "/// Relative path and bytes of every built-in file, sorted.\npub const BUILT_IN: &[(&str, &[u8])]",
        built_in,
        |path, name| format!("({name:?}, include_bytes!({path}))"),
    )?;
    // Those that draw are not composed.
    let shaders = files(&["shaders/effects", "shaders/materials", "shaders/shared", "shaders/stages"])?;
    list("shader_sources.rs", "pub const SOURCES: &[(&str, &str)]", shaders, |path, name| {
        let name = name.trim_start_matches("shaders/").trim_end_matches(".wgsl");
        format!("({name:?}, include_str!({path}))")
    })
}

/// Relative paths of all files below these folders, sorted.
fn files(folders: &[&str]) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for folder in folders {
        println!("cargo::rerun-if-changed={folder}");
        collect(&root().join(folder), folder, &mut names)?;
    }
    names.sort();
    Ok(names)
}

/// Writes the constant `head` with an entry for every file, made from an expression for its path and its name.
fn list(file: &str, head: &str, names: Vec<String>, entry: impl Fn(&str, &str) -> String) -> io::Result<()> {
    let mut text = format!("{head} = &[\n");
    for name in names {
        // The folder is asked for when the list is compiled: a checkout that was moved with its `target` finds its files.
        let path = format!("concat!(env!(\"CARGO_MANIFEST_DIR\"), {:?})", format!("/{name}"));
        writeln!(text, "    {},", entry(&path, &name)).map_err(io::Error::other)?;
    }
    fs::write(PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join(file), text + "];\n")
}

fn root() -> PathBuf {
    PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default())
}

fn collect(folder: &Path, name: &str, names: &mut Vec<String>) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{name}/{}", entry.file_name().to_string_lossy());
        if entry.file_type()?.is_dir() {
            collect(&entry.path(), &name, names)?;
        } else {
            names.push(name);
        }
    }
    Ok(())
}
