//! The attempts of trainees as local files: `<root>/<trainee>/<task>_<n>.json`.
//!
//! Names become names of files by [`file_name`], so that nobody reaches another folder by calling himself `../..`; no two names
//! share one. A file that cannot be read is told and left as it is.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

use super::score::Score;
use super::texts;
use crate::hash::fnv1a;
use crate::reading::{self, Unread};
use crate::whole_file;
use crate::{Error, Result};

/// Folder of the history where nothing else is said.
pub const FOLDER: &str = "history";

/// Form of the files. A reader takes this one and every older one.
const VERSION: u32 = 1;

/// Largest file that is read [byte]: a score takes some 10 kB.
const LARGEST_FILE: u64 = 1 << 20;

/// Longest part of a name that is kept [characters].
const LONGEST_NAME: usize = 40;

/// Longest name of a device that some systems keep for themselves [byte]: `com1`.
const LONGEST_DEVICE: usize = 4;

/// One attempt as it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Attempt {
    pub version: u32,
    /// The name as it was given.
    pub trainee: String,
    pub task: String,
    /// From 1, per trainee and task.
    pub number: u32,
    /// Seconds since 1970-01-01, UTC.
    pub finished: u64,
    pub score: Score,
}

/// What a folder holds.
#[derive(Debug, Default)]
pub struct Found {
    /// By task, then by number.
    pub attempts: Vec<Attempt>,
    /// One message with its way out per file that could not be read.
    pub broken: Vec<Error>,
}

/// A folder with one folder per trainee.
#[derive(Debug, Clone)]
pub struct History {
    root: PathBuf,
}

/// A name as a part of the name of a file: letters, digits and `-` within stay, everything else becomes `_`. A name that is not
/// all small plain letters and digits, or is short or long, gets a hash of the whole behind it: so no two names share a file,
/// whatever a file system folds or rewrites, and none is that of a device (`con`, `nul`, ...).
pub fn file_name(name: &str) -> String {
    let kept = name.chars().take(LONGEST_NAME).enumerate();
    let kept: String = kept.map(|(i, c)| if c.is_alphanumeric() || (c == '-' && i > 0) { c } else { '_' }).collect();
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    let safe = kept == name && kept.chars().all(plain) && kept.len() > LONGEST_DEVICE;
    if safe { kept } else { format!("{kept}_{}", &fnv1a(&[name])[..8]) }
}

impl History {
    /// A history in this folder, which need not exist yet.
    pub fn new(root: &Path) -> History {
        History { root: root.to_path_buf() }
    }

    /// Folder of a trainee.
    ///
    /// # Errors
    /// `Error::Input` for a name that is empty.
    pub fn folder(&self, trainee: &str) -> Result<PathBuf> {
        if trainee.trim().is_empty() {
            return Err(Error::input(texts::NO_TRAINEE, texts::NO_TRAINEE_WAY_OUT));
        }
        Ok(self.root.join(file_name(trainee)))
    }

    /// Keeps a score as the next attempt of a trainee at its task, and returns it with its file. No other attempt is ever replaced.
    ///
    /// # Errors
    /// `Error::Input` for an empty name or a score without a task, `Error::File` where the file cannot be written.
    pub fn add(&self, trainee: &str, score: &Score) -> Result<(Attempt, PathBuf)> {
        let folder = self.folder(trainee)?;
        let Some(task) = &score.task else { return Err(Error::input(texts::NO_TASK, texts::NO_TASK_WAY_OUT)) };
        fs::create_dir_all(&folder).map_err(|source| Error::file(&folder, source))?;
        let stem = file_name(task);
        // Broken files count, too: their numbers are taken.
        let taken = names(&folder)?.iter().filter_map(|name| number_of(name, &stem)).max().unwrap_or(0);
        let (number, path) = reserve(&folder, &stem, taken.saturating_add(1))?;
        let finished = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
        let attempt = Attempt {
            version: VERSION,
            trainee: trainee.into(),
            task: task.clone(),
            number,
            finished,
            score: score.clone(),
        };
        let text = serde_json::to_string_pretty(&attempt).map_err(|source| Error::file(&path, source.into()))?;
        whole_file::write(&path, (text + "\n").as_bytes()).inspect_err(|_| {
            // The first error is the one to report; an empty attempt is of no use.
            let _ = fs::remove_file(&path);
        })?;
        Ok((attempt, path))
    }

    /// The folders in it, one per trainee, by name.
    ///
    /// # Errors
    /// `Error::File` where it cannot be listed.
    pub fn folders(&self) -> Result<Vec<PathBuf>> {
        let all = names(&self.root)?.into_iter().map(|name| self.root.join(name));
        Ok(all.filter(|folder| folder.is_dir()).collect())
    }

    /// All attempts of a trainee; none where there is no folder yet.
    ///
    /// # Errors
    /// `Error::Input` for an empty name, `Error::File` where the folder cannot be listed.
    pub fn attempts(&self, trainee: &str) -> Result<Found> {
        let folder = self.folder(trainee)?;
        let mut found = Found::default();
        for name in names(&folder)? {
            if !name.ends_with(".json") {
                continue;
            }
            match read(&folder.join(&name)) {
                Ok(attempt) if attempt.trainee != trainee => found.broken.push(Error::input(
                    texts::no_attempt(
                        &folder.join(&name).display().to_string(),
                        &texts::other_trainee(&attempt.trainee),
                    ),
                    texts::BROKEN_WAY_OUT,
                )),
                Ok(attempt) => found.attempts.push(attempt),
                Err(error) => found.broken.push(error),
            }
        }
        found.attempts.sort_by(|a, b| (&a.task, a.number).cmp(&(&b.task, b.number)));
        Ok(found)
    }

    /// Names of the trainees, as they were given, sorted: those of whom a file can be read.
    ///
    /// # Errors
    /// `Error::File` where the folder cannot be listed.
    pub fn trainees(&self) -> Result<Vec<String>> {
        let mut trainees = Vec::new();
        for name in names(&self.root)? {
            let folder = self.root.join(&name);
            if !folder.is_dir() {
                continue;
            }
            let attempts = names(&folder)?.into_iter().filter_map(|file| read(&folder.join(file)).ok());
            trainees.extend(attempts.map(|a| a.trainee).find(|trainee| file_name(trainee) == name));
        }
        trainees.sort();
        Ok(trainees)
    }
}

/// One figure over the attempts at a task: (number of the attempt, seconds since 1970, value); attempts without the figure are
/// left out. For a plot of progress.
pub fn progress(attempts: &[Attempt], task: &str, key: &str) -> Vec<(u32, u64, f64)> {
    let mut series: Vec<(u32, u64, f64)> = attempts
        .iter()
        .filter(|a| a.task == task)
        .filter_map(|a| Some((a.number, a.finished, a.score.value(key)?)))
        .collect();
    series.sort_by_key(|point| point.0);
    series
}

/// Names in a folder, sorted; none where it does not exist.
fn names(folder: &Path) -> Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(source) => return Err(Error::file(folder, source)),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|source| Error::file(folder, source))?;
        // A name that is no text is none of ours.
        names.extend(entry.file_name().into_string());
    }
    names.sort();
    Ok(names)
}

/// `hit-it_12.json` of the stem `hit-it` -> 12; also while it is being written.
fn number_of(name: &str, stem: &str) -> Option<u32> {
    let rest = name.strip_prefix(stem)?.strip_prefix('_')?;
    rest.strip_suffix(whole_file::UNFINISHED).unwrap_or(rest).strip_suffix(".json")?.parse().ok()
}

/// Makes the file of the first free number from `number` on, so that a second program does not take it, too.
fn reserve(folder: &Path, stem: &str, mut number: u32) -> Result<(u32, PathBuf)> {
    loop {
        let path = folder.join(format!("{stem}_{number}.json"));
        match fs::File::create_new(&path) {
            Ok(_) => return Ok((number, path)),
            Err(source) if source.kind() == std::io::ErrorKind::AlreadyExists && number < u32::MAX => number += 1,
            Err(source) => return Err(Error::file(path, source)),
        }
    }
}

/// Reads one file.
///
/// # Errors
/// `Error::Input` where it is no attempt, `Error::File` where it cannot be read.
pub fn read(path: &Path) -> Result<Attempt> {
    let bytes = reading::bytes(path, LARGEST_FILE).map_err(|unread| match unread {
        Unread::System(source) => Error::file(path, source),
        Unread::Refused { reason, .. } => {
            Error::input(texts::no_attempt(&path.display().to_string(), &reason), texts::BROKEN_WAY_OUT)
        }
    })?;
    parse(path, &bytes)
}

/// The same with the bytes in memory.
///
/// # Errors
/// `Error::Input` where they are no attempt.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Attempt> {
    let wrong =
        |reason: &str| Error::input(texts::no_attempt(&path.display().to_string(), reason), texts::BROKEN_WAY_OUT);
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(wrong(&texts::too_large(bytes.len() as u64, LARGEST_FILE)));
    }
    let attempt: Attempt = serde_json::from_slice(bytes).map_err(|reason| wrong(&reason.to_string()))?;
    match attempt.version {
        1..=VERSION => Ok(attempt),
        version => Err(wrong(&texts::newer(version, VERSION))),
    }
}
