//! Lists the scenes, meshes and curves of the repository, which are built into the program (`src/reading.rs`).

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let mut names = Vec::new();
    for folder in ["scenes", "assets/curves", "assets/meshes"] {
        println!("cargo::rerun-if-changed={folder}");
        collect(&root.join(folder), folder, &mut names)?;
    }
    names.sort();
    let mut text = String::from("/// Relative path and bytes of every built-in file, sorted.\n");
    text += "pub const BUILT_IN: &[(&str, &[u8])] = &[\n";
    for name in names {
        writeln!(text, "    ({name:?}, include_bytes!({:?})),", root.join(&name)).map_err(io::Error::other)?;
    }
    fs::write(PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join("built_in.rs"), text + "];\n")
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
