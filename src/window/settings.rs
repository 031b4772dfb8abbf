//! What a person has chosen for good: language, light or dark, size of texts, panels, trainee, recent files. A TOML file in the folder for
//! settings of the user's system.
//!
//! A file that cannot be read is told, renamed to `*.broken`, and the defaults stand in: no window stays shut for it.

use std::path::{Path, PathBuf};

use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Deserialize, Serialize};

use crate::error::brief;
use crate::reading::{self, most};
use crate::words::{self, say_with};
use crate::{Error, Result, whole_file};

/// Names another file of settings, where no option does.
pub const VARIABLE: &str = "STYLET_SETTINGS";

/// Form of the file. A reader takes this one and every older one.
const VERSION: u32 = 1;

/// Most files that are remembered.
const RECENT: usize = 12;

/// Sizes of texts that can be chosen, against that of the monitor.
pub const TEXT_SIZES: std::ops::RangeInclusive<f32> = 0.6..=2.5;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Theme {
    #[default]
    System,
    Dark,
    Light,
}

/// Parts of the window that fold away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fold {
    /// Controls on the left.
    Left,
    /// Readings on the right.
    Right,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Form of the file.
    pub version: u32,
    /// Code of the language; that of the system where it is not chosen.
    pub language: Option<String>,
    pub theme: Theme,
    /// Size of texts against what the scale of the monitor says; where it is not chosen, the window looks at the monitor.
    pub text_size: Option<f32>,
    pub sound: bool,
    /// Steps and hints are shown.
    pub guided: bool,
    pub folded: Vec<Fold>,
    pub trainee: Option<String>,
    /// Scenes and volumes that were opened, the last one first.
    pub recent: Vec<PathBuf>,
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            version: VERSION,
            language: None,
            theme: Theme::System,
            text_size: None,
            sound: true,
            guided: true,
            folded: Vec::new(),
            trainee: None,
            recent: Vec::new(),
        }
    }
}

impl Settings {
    pub fn is_folded(&self, part: Fold) -> bool {
        self.folded.contains(&part)
    }

    pub fn fold(&mut self, part: Fold, folded: bool) {
        self.folded.retain(|other| *other != part);
        if folded {
            self.folded.push(part);
        }
    }

    /// Puts a file to the front of those that were opened.
    pub fn opened(&mut self, path: &Path) {
        let path = reading::from_everywhere(path);
        self.recent.retain(|other| *other != path);
        self.recent.insert(0, path);
        self.recent.truncate(RECENT);
    }

    /// What is written by hand may be beyond all bounds.
    fn checked(self) -> Result<Self> {
        if !(1..=VERSION).contains(&self.version) {
            return Err(Error::input(
                format!("version {} is not known; this program knows 1 to {VERSION}", self.version),
                "take a newer stylet, or delete the file",
            ));
        }
        if let Some(size) = self.text_size.filter(|size| !TEXT_SIZES.contains(size)) {
            return Err(Error::input(
                format!("text_size {size} is none"),
                format!("write {} to {}", TEXT_SIZES.start(), TEXT_SIZES.end()),
            ));
        }
        Ok(Settings { version: VERSION, ..self })
    }

    /// # Errors
    /// `Error::Input` for text that holds no settings.
    pub fn parse(text: &str) -> Result<Self> {
        let read: Settings = toml::from_str(text)
            .map_err(|e| Error::input(brief(e.to_string().trim_end()), "correct the file, or delete it"))?;
        read.checked()
    }

    /// Takes the language that was chosen, else that of the system.
    pub fn speak(&self) {
        let chosen = self.language.as_deref().is_some_and(words::choose);
        if !chosen {
            let system = ["LC_ALL", "LC_MESSAGES", "LANG"].into_iter().find_map(|name| std::env::var(name).ok());
            words::choose(system.as_deref().unwrap_or("en"));
        }
    }
}

/// Settings with their file.
#[derive(Debug, Default)]
pub struct Keeper {
    pub settings: Settings,
    /// As they stand in the file.
    written: Settings,
    /// `None`: there is no place for settings; they last as long as the window.
    path: Option<PathBuf>,
    /// What went wrong with the file, for people.
    pub notice: Option<String>,
}

impl Keeper {
    /// Reads the settings of `file`, else of the file that [`VARIABLE`] names, else of the user.
    pub fn open(file: Option<&Path>) -> Self {
        let named = file.map(Path::to_path_buf).or_else(|| std::env::var_os(VARIABLE).map(PathBuf::from));
        let path = named.or_else(|| {
            let base = choose_base_strategy().ok()?;
            Some(base.config_dir().join("stylet").join("settings.toml"))
        });
        let mut keeper = Keeper { path, ..Keeper::default() };
        if let Some(path) = keeper.path.clone() {
            match reading::text(&path, most::SCENE) {
                Ok(text) => match Settings::parse(&text) {
                    Ok(settings) => keeper.settings = settings,
                    Err(error) => keeper.set_aside(&path, &error),
                },
                Err(unread) if unread.is_missing() => {}
                // It may be there again tomorrow: nothing is written over it.
                Err(unread) => {
                    keeper.notice = Some(unread.of(&path, "make the file readable").to_string());
                    keeper.path = None;
                }
            }
        }
        keeper.written = keeper.settings.clone();
        keeper
    }

    fn set_aside(&mut self, path: &Path, error: &Error) {
        let mut aside = path.as_os_str().to_owned();
        aside.push(".broken");
        let aside = PathBuf::from(aside);
        let file = path.display().to_string();
        let told = error.to_string();
        self.notice = Some(match std::fs::rename(path, &aside) {
            Ok(()) => say_with(
                "settings-broken",
                &[("file", file.into()), ("reason", told.into()), ("aside", aside.display().to_string().into())],
            ),
            Err(_) => {
                self.path = None;
                format!("{file}: {told}")
            }
        });
    }

    /// Writes what has changed. Where that cannot be, the settings last as long as the window, which is told once.
    pub fn keep(&mut self) {
        if self.settings == self.written {
            return;
        }
        self.written = self.settings.clone();
        let Some(path) = &self.path else { return };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let made = folder.map_or(Ok(()), std::fs::create_dir_all).map_err(|source| Error::file(path, source));
        let text = toml::to_string(&self.settings).map_err(|e| Error::input(e.to_string(), "report this as a defect"));
        if let Err(error) = made.and(text).and_then(|text| whole_file::write(path, text.as_bytes())) {
            self.notice = Some(error.to_string());
            self.path = None;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_kept_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/settings.toml");
        let mut keeper = Keeper::open(Some(&path));
        assert!(keeper.notice.is_none() && keeper.settings == Settings::default());
        keeper.keep();
        assert!(!path.exists(), "nothing was chosen");
        keeper.settings.language = Some("de".into());
        keeper.settings.theme = Theme::Light;
        keeper.settings.text_size = Some(1.5);
        keeper.settings.fold(Fold::Right, true);
        keeper.settings.trainee = Some("Ada \"the first\"".into());
        for n in 0..20 {
            keeper.settings.opened(Path::new(&format!("/scenes/{n}.toml")));
        }
        keeper.settings.opened(Path::new("/scenes/15.toml"));
        keeper.keep();
        let again = Keeper::open(Some(&path));
        assert_eq!(again.settings, keeper.settings);
        assert_eq!(again.settings.recent.len(), RECENT);
        assert_eq!(again.settings.recent[0], Path::new("/scenes/15.toml"));
    }

    #[test]
    fn a_broken_file_is_told_and_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("settings.toml");
        for broken in ["language = [", "colour = 3", "version = 9", "text_size = 100.0", "theme = \"pink\""] {
            std::fs::write(&path, broken).unwrap();
            let keeper = Keeper::open(Some(&path));
            let notice = keeper.notice.expect("it is told");
            assert!(notice.contains("settings.toml.broken"), "{notice}");
            assert_eq!(keeper.settings, Settings::default());
            assert_eq!(std::fs::read_to_string(folder.path().join("settings.toml.broken")).unwrap(), broken);
            assert!(!path.exists());
        }
    }

    /// Whatever a disk or an editor does to the file: it is taken, or refused in few words with a way out.
    #[test]
    fn damaged_settings_are_taken_or_refused() {
        let whole = "version = 1\nlanguage = \"de\"\ntheme = \"light\"\ntext_size = 1.5\nfolded = [\"left\"]\nrecent = [\"a.toml\"]\n";
        assert!(Settings::parse(whole).is_ok());
        let mut refused = 0;
        for at in 0..whole.len() {
            for put in ["", "\u{0}", "[", "\"", "9", &"x".repeat(100_000)] {
                let damaged = format!("{}{put}{}", &whole[..at], &whole[at + 1..]);
                if let Err(error) = Settings::parse(&damaged) {
                    let told = error.to_string();
                    assert!(told.contains("way out") && told.len() < 4_000, "{} bytes: {told:.300}", told.len());
                    refused += 1;
                }
            }
        }
        assert!(refused > 100, "{refused}");
    }

    /// A folder in the place of the file: the window opens, and nothing is written.
    #[test]
    fn no_place_for_settings_is_no_hindrance() {
        let folder = tempfile::tempdir().unwrap();
        let mut keeper = Keeper::open(Some(folder.path()));
        assert!(keeper.notice.is_some());
        keeper.settings.sound = false;
        keeper.keep();
        assert!(folder.path().is_dir());
    }
}
