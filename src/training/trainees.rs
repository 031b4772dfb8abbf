//! The trainees of a history: a file `trainee.toml` in the folder of each holds the name, and whether it is hidden from the list. Whoever
//! has attempts and no such file is a trainee too. Nothing is ever deleted: a hidden trainee keeps all attempts, and can be shown again.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::history::History;
use super::texts;
use crate::error::brief;
use crate::reading::{self, most};
use crate::{Error, Result, whole_file};

const FILE: &str = "trainee.toml";

/// Form of the file. A reader takes this one and every older one.
const VERSION: u32 = 1;

/// Longest name [characters].
const LONGEST: usize = 80;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Trainee {
    /// As it was given.
    pub name: String,
    pub hidden: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    version: u32,
    name: String,
    #[serde(default)]
    hidden: bool,
}

fn wrong(path: &Path, reason: &str) -> Error {
    Error::input(texts::no_trainee_file(&path.display().to_string(), reason.trim_end()), texts::BROKEN_WAY_OUT)
}

/// The trainee that the text of a file tells.
///
/// # Errors
/// `Error::Input` where it tells none.
pub fn parse(path: &Path, text: &str) -> Result<Trainee> {
    let kept: Kept = toml::from_str(text).map_err(|e| wrong(path, &brief(&e.to_string())))?;
    match kept.version {
        1..=VERSION => Ok(Trainee { name: kept.name, hidden: kept.hidden }),
        version => Err(wrong(path, &texts::newer(version, VERSION))),
    }
}

/// All trainees by name, and one message for every file that cannot be read.
///
/// # Errors
/// `Error::File` where the folder cannot be listed.
pub fn list(history: &History) -> Result<(Vec<Trainee>, Vec<Error>)> {
    let (mut trainees, mut broken) = (Vec::new(), Vec::new());
    for folder in history.folders()? {
        let path = folder.join(FILE);
        match reading::text(&path, most::SCENE) {
            Ok(text) => match parse(&path, &text) {
                Ok(trainee) => trainees.push(trainee),
                Err(error) => broken.push(error),
            },
            Err(unread) if unread.is_missing() => {}
            Err(unread) => broken.push(wrong(&path, &unread.to_string())),
        }
    }
    for name in history.trainees()? {
        if trainees.iter().all(|trainee| trainee.name != name) {
            trainees.push(Trainee { name, hidden: false });
        }
    }
    trainees.sort();
    Ok((trainees, broken))
}

/// Makes a trainee; one who is there already, or hidden, is shown again. The name without blanks at its ends.
///
/// # Errors
/// `Error::Input` for a name that is empty or too long, `Error::File` where the file cannot be written.
pub fn create(history: &History, name: &str) -> Result<String> {
    let name = name.trim();
    if name.chars().count() > LONGEST {
        return Err(Error::input(texts::long_trainee(LONGEST), texts::LONG_TRAINEE_WAY_OUT));
    }
    hide(history, name, false)?;
    Ok(name.to_string())
}

/// Hides a trainee from the list, or shows it again.
///
/// # Errors
/// As [`create`].
pub fn hide(history: &History, name: &str, hidden: bool) -> Result<()> {
    let folder = history.folder(name)?;
    std::fs::create_dir_all(&folder).map_err(|source| Error::file(&folder, source))?;
    let kept = Kept { version: VERSION, name: name.into(), hidden };
    let path = folder.join(FILE);
    let text = toml::to_string(&kept).map_err(|e| Error::file(&path, std::io::Error::other(e)))?;
    whole_file::write(&path, text.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trainee_is_made_hidden_and_shown_again() {
        let folder = tempfile::tempdir().unwrap();
        let history = History::new(&folder.path().join("history"));
        assert_eq!(list(&history).unwrap().0, []);
        assert_eq!(create(&history, "  Zoe ").unwrap(), "Zoe");
        create(&history, "../Ada").unwrap();
        let names = |history: &History| -> Vec<(String, bool)> {
            list(history).unwrap().0.into_iter().map(|t| (t.name, t.hidden)).collect()
        };
        assert_eq!(names(&history), [("../Ada".into(), false), ("Zoe".into(), false)]);
        hide(&history, "Zoe", true).unwrap();
        assert_eq!(names(&history), [("../Ada".into(), false), ("Zoe".into(), true)]);
        assert!(history.attempts("Zoe").unwrap().broken.is_empty(), "the file of the name is no attempt");
        create(&history, "Zoe").unwrap();
        assert_eq!(names(&history)[1], ("Zoe".into(), false));
        assert!(create(&history, "  ").is_err() && create(&history, &"x".repeat(81)).is_err());
        std::fs::write(history.folder("Zoe").unwrap().join(FILE), "name = 3").unwrap();
        let (left, broken) = list(&history).unwrap();
        assert_eq!((left.len(), broken.len()), (1, 1));
        assert!(broken[0].to_string().contains(FILE), "{}", broken[0]);
    }
}
