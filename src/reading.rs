//! The one way in for files that others wrote: looked at before they are read, never waited for, never larger than their kind may be.
//!
//! A pipe or a device may never begin or never end, a file may have more bytes than the machine has memory: both are refused at once.
//! The program's own scenes, meshes and curves are built in and found where no file of their name is on disk.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

use crate::Error;

/// Most bytes of the kinds of files.
pub mod most {
    /// A scene or a library of materials: a thousand times more than a person writes; parsed it takes 80 times as much.
    pub const SCENE: u64 = 1 << 20;
    /// Measured curves.
    pub const CURVE: u64 = 16 << 20;
    /// A mesh: some two million tetrahedra as text.
    pub const MESH: u64 = 384 << 20;
    /// A volume of labels, or its data file: some three whole bodies at 1 mm, uncompressed.
    pub const VOLUME: u64 = 1 << 30;
    /// A table of a run.
    pub const TABLE: u64 = 256 << 20;
    /// A checkpoint, compressed: that of the main scene has a megabyte.
    pub const CHECKPOINT: u64 = 256 << 20;
    /// What the program wrote for itself: summaries, plans, ledgers.
    pub const OWN: u64 = 64 << 20;
}

/// Why there are no bytes.
#[derive(Debug, thiserror::Error)]
pub enum Unread {
    #[error("{0}")]
    System(#[from] io::Error),
    /// It is no file that can be taken.
    #[error("{reason}")]
    Refused { reason: String, way_out: &'static str },
}

impl Unread {
    /// Whether there is nothing of that name.
    pub fn is_missing(&self) -> bool {
        matches!(self, Unread::System(error) if error.kind() == io::ErrorKind::NotFound)
    }

    /// The wrong input that it is, with the file in front; `otherwise` is the way out where the system says why.
    pub fn of(&self, path: &Path, otherwise: &str) -> Error {
        Error::input(format!("{}: cannot be read: {self}", path.display()), self.way_out(otherwise))
    }

    /// What to do about it; `otherwise` where the system says why.
    pub fn way_out(&self, otherwise: &str) -> String {
        match self {
            Unread::System(_) => otherwise.into(),
            Unread::Refused { way_out, .. } => (*way_out).into(),
        }
    }
}

/// The bytes of a file of at most `most` bytes.
///
/// # Errors
/// At once where it is no file but a pipe, a device or a folder, or where it is larger.
pub fn bytes(path: &Path, most: u64) -> Result<Vec<u8>, Unread> {
    head(path, most, most)
}

/// The first `count` bytes of such a file, or all where it has fewer: enough to see what it is.
///
/// # Errors
/// As [`bytes`].
pub fn head(path: &Path, most: u64, count: u64) -> Result<Vec<u8>, Unread> {
    match on_disk(path, most, count) {
        Err(error) if error.is_missing() => match built_in(path) {
            Some((_, bytes)) => Ok(bytes[..bytes.len().min(usize::try_from(count).unwrap_or(usize::MAX))].to_vec()),
            None => Err(error),
        },
        read => read,
    }
}

/// The same as text.
///
/// # Errors
/// As [`bytes`], and where it is no UTF-8.
pub fn text(path: &Path, most: u64) -> Result<String, Unread> {
    String::from_utf8(bytes(path, most)?).map_err(|error| Unread::Refused {
        reason: format!("it is no text: byte {} is no UTF-8", error.utf8_error().valid_up_to()),
        way_out: "save the file as plain text in UTF-8",
    })
}

/// The same piece by piece, for a reader that may have enough before the end.
///
/// # Errors
/// As [`bytes`]; a built-in file is none of those that are read so.
pub fn stream(path: &Path, most: u64) -> Result<impl Read, Unread> {
    Ok(opened(path, most)?.0.take(most))
}

/// The file and its length.
fn opened(path: &Path, most: u64) -> Result<(File, u64), Unread> {
    // Opening a device may do something, opening a pipe may wait: a look first.
    is_file(&std::fs::metadata(path)?)?;
    let file = open(path)?;
    let found = file.metadata()?;
    is_file(&found)?;
    if found.len() > most {
        return Err(too_large(found.len(), most));
    }
    if holes::are_most_of(&file, &found) {
        return Err(Unread::Refused {
            reason: "most of it is a hole: it has a length, but nothing was written there".into(),
            way_out: "copy or write the file again; it was cut short on its way",
        });
    }
    Ok((file, found.len()))
}

fn on_disk(path: &Path, most: u64, count: u64) -> Result<Vec<u8>, Unread> {
    let (file, length) = opened(path, most)?;
    let mut bytes = Vec::with_capacity(length.min(count) as usize);
    // It may grow meanwhile, and some files of the system do not tell their size.
    file.take(if count < most { count } else { most + 1 }).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(too_large(bytes.len() as u64, most)),
        false => Ok(bytes),
    }
}

#[cfg(unix)]
fn open(path: &Path) -> io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;
    // A pipe that has taken the place of the file since the look does not hold the program up.
    File::options().read(true).custom_flags(nix::libc::O_NONBLOCK).open(path)
}

#[cfg(not(unix))]
fn open(path: &Path) -> io::Result<File> {
    File::open(path)
}

/// Files that take little room on the disk because there is nothing in them: a download or a copy that was given up leaves one. They
/// read as zeros without end.
#[cfg(any(target_os = "linux", target_os = "macos", target_os = "freebsd"))]
mod holes {
    use std::fs::{File, Metadata};
    use std::os::fd::AsRawFd;
    use std::os::unix::fs::MetadataExt;

    use nix::libc;

    /// Shorter files are read whatever they hold [B].
    const SHORT: u64 = 4 << 20;

    /// Whether more than half of the file is holes. Few blocks alone do not tell: a file system may compress what it keeps.
    pub fn are_most_of(file: &File, found: &Metadata) -> bool {
        found.len() > SHORT && found.blocks() * 512 < found.len() / 2 && data(file, found.len()) < found.len() / 2
    }

    /// Bytes that are no holes; all where the file system does not tell. The place in the file is at its beginning afterwards.
    fn data(file: &File, length: u64) -> u64 {
        // SAFETY: the descriptor is open as long as the file lives; the call does nothing but look, and move the place in it.
        let seek = |at: u64, whence| u64::try_from(unsafe { libc::lseek(file.as_raw_fd(), at as libc::off_t, whence) });
        let (mut data, mut at) = (0, 0);
        while at < length {
            // No data behind this place.
            let Ok(begin) = seek(at, libc::SEEK_DATA) else { break };
            let end = seek(begin, libc::SEEK_HOLE).unwrap_or(length);
            data += end.saturating_sub(begin);
            at = end.max(begin + 1);
        }
        match seek(0, libc::SEEK_SET) {
            Ok(0) => data,
            _ => length,
        }
    }
}

#[cfg(not(any(target_os = "linux", target_os = "macos", target_os = "freebsd")))]
mod holes {
    pub fn are_most_of(_: &std::fs::File, _: &std::fs::Metadata) -> bool {
        false
    }
}

fn is_file(found: &std::fs::Metadata) -> Result<(), Unread> {
    if found.is_file() {
        return Ok(());
    }
    if found.is_dir() {
        return Err(io::Error::from(io::ErrorKind::IsADirectory).into());
    }
    Err(Unread::Refused {
        reason: "it is a pipe or a device, which may never end, and no file".into(),
        way_out: "write it to a file first, and name that file",
    })
}

fn too_large(found: u64, most: u64) -> Unread {
    let mb = |bytes: u64| bytes.div_ceil(1 << 20);
    Unread::Refused {
        reason: format!("it has {} MiB, more than the {} MiB that such a file may have", mb(found), mb(most)),
        way_out: "check that this is the file you mean, and make it smaller",
    }
}

include!(concat!(env!("OUT_DIR"), "/built_in.rs"));

/// The relative path as the names of built-in files have it.
fn plain_name(path: &Path) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.components() {
        match part {
            Component::Normal(part) => parts.push(part.to_str()?),
            Component::CurDir => {}
            Component::ParentDir => drop(parts.pop()?),
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(parts.join("/"))
}

/// Name and bytes of the file that is built into the program under this relative path.
pub fn built_in(path: &Path) -> Option<(&'static str, &'static [u8])> {
    let name = plain_name(path)?;
    let at = BUILT_IN.binary_search_by(|(other, _)| (*other).cmp(&name)).ok()?;
    Some(BUILT_IN[at])
}

/// Whether there is no file of that name and the built-in one is taken.
pub fn is_built_in(path: &Path) -> bool {
    built_in(path).is_some() && !path.exists()
}

/// The folder of built-in files under this relative path, with a slash at its end.
pub fn built_in_folder(path: &Path) -> Option<String> {
    let folder = plain_name(path).filter(|name| !name.is_empty())? + "/";
    BUILT_IN.iter().any(|(name, _)| name.starts_with(&folder)).then_some(folder)
}

/// Names of the built-in files in a folder and below it.
pub fn built_in_below(folder: &str) -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name).filter(move |name| name.starts_with(folder))
}

/// The path by which the file is found from another folder too.
pub fn from_everywhere(path: &Path) -> PathBuf {
    match is_built_in(path) {
        true => path.to_path_buf(),
        false => std::path::absolute(path).unwrap_or_else(|_| path.to_path_buf()),
    }
}
