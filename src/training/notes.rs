//! Notes of a teacher at moments of an attempt: a file beside that of the attempt, `<task>_<n>.notes`.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::history::{Attempt, History, file_name};
use crate::reading::{self, Unread};
use crate::whole_file;
use crate::{Error, Result};

/// Ending of the files; not `.json`, which is that of attempts.
pub const ENDING: &str = "notes";

/// Form of the files.
const VERSION: u32 = 1;
/// Most notes of an attempt, and longest text [characters].
const MOST: usize = 1000;
const LONGEST: usize = 4000;

/// One note.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Note {
    /// Simulated time of the attempt that it is about [s].
    pub time: f64,
    pub author: String,
    pub text: String,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    notes: Vec<Note>,
}

/// Where the notes about an attempt are.
///
/// # Errors
/// `Error::Input` for an attempt of nobody.
pub fn path(root: &Path, attempt: &Attempt) -> Result<PathBuf> {
    let folder = History::new(root).folder(&attempt.trainee)?;
    Ok(folder.join(format!("{}_{}.{ENDING}", file_name(&attempt.task), attempt.number)))
}

/// The notes about an attempt, by time; none where there is no file.
///
/// # Errors
/// `Error::Input` for a file that holds no notes; it is left as it is.
pub fn read(root: &Path, attempt: &Attempt) -> Result<Vec<Note>> {
    read_file(&path(root, attempt)?)
}

/// The same of a file.
///
/// # Errors
/// As [`read`].
pub fn read_file(path: &Path) -> Result<Vec<Note>> {
    match reading::bytes(path, reading::most::TABLE) {
        Ok(bytes) => parse(path, &bytes),
        Err(unread) if unread.is_missing() => Ok(Vec::new()),
        Err(Unread::System(source)) => Err(Error::file(path, source)),
        Err(Unread::Refused { reason, .. }) => Err(wrong(path, &reason)),
    }
}

/// The same with the bytes in memory.
///
/// # Errors
/// As [`read`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Note>> {
    let file: File = serde_json::from_slice(bytes).map_err(|reason| wrong(path, &reason.to_string()))?;
    if file.version != VERSION {
        return Err(wrong(path, &format!("it has version {}, this program knows {VERSION}", file.version)));
    }
    check(&file.notes).map_err(|reason| wrong(path, &reason))?;
    Ok(file.notes)
}

fn check(notes: &[Note]) -> std::result::Result<(), String> {
    if notes.len() > MOST {
        return Err(format!("{} notes, at most {MOST} belong to an attempt", notes.len()));
    }
    let wrong = |note: &Note| !note.time.is_finite() || note.time < 0.0 || note.text.chars().count() > LONGEST;
    match notes.iter().position(wrong) {
        Some(n) => {
            Err(format!("note {n}: its time is no time of an attempt, or its text has more than {LONGEST} characters"))
        }
        None => Ok(()),
    }
}

/// Keeps the notes about an attempt, sorted by time, in the place of those before.
///
/// # Errors
/// `Error::Input` for notes that could not be read again, `Error::File` where the file cannot be written.
pub fn write(root: &Path, attempt: &Attempt, notes: &[Note]) -> Result<PathBuf> {
    let path = path(root, attempt)?;
    let mut notes = notes.to_vec();
    notes.sort_by(|a, b| a.time.total_cmp(&b.time));
    check(&notes).map_err(|reason| Error::input(reason, "shorten the note, or put it at a moment of the attempt"))?;
    let file = File { version: VERSION, notes };
    let text = serde_json::to_string_pretty(&file).map_err(|source| Error::file(&path, source.into()))?;
    whole_file::write(&path, (text + "\n").as_bytes())?;
    Ok(path)
}

fn wrong(path: &Path, reason: &str) -> Error {
    Error::input(
        format!("{} holds no notes of this program: {reason}", path.display()),
        "the file was left as it is; move it away, or restore it from a copy",
    )
}
