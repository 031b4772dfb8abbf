//! Files that appear whole or not at all.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Ending of a file that is still being written.
pub const UNFINISHED: &str = ".part";

/// Writes the bytes under a temporary name in the same folder and renames it; a file of that name is replaced in one
/// step, so a reader or a crash never meets half a file.
pub fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let unfinished = unfinished_name(path);
    let written = fs::File::create(&unfinished).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.and_then(|()| fs::rename(&unfinished, path)).map_err(|source| {
        // The first error is the one to report; what is left of the temporary file is of no use.
        let _ = fs::remove_file(&unfinished);
        Error::file(path, source)
    })
}

/// `force.svg` -> `force.svg.part`.
fn unfinished_name(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(UNFINISHED);
    PathBuf::from(name)
}
