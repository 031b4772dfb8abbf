//! A class: what all trainees of a history did at all tasks, for those who teach.

use std::fs;
use std::path::{Path, PathBuf};

use super::history::{self, Attempt, History, file_name, progress};
use super::skill_evidence;
use super::statistics::slope;
use super::texts::{Better, short};
use crate::units::calendar;
use crate::{Error, Result};

/// Key figures where there is no evidence for a scene: what the literature has most often. One that ends in a dot stands for the first of
/// its kind.
const USUAL: [&str; 5] = ["target_distance.", "overshoot", "passes", "motion_smoothness", "translational_motions"];

/// Part of the present value by which a figure must change over the attempts to be called better or worse.
const NOTABLE: f64 = 0.1;

/// Fewest attempts that make a trend.
const FEWEST: usize = 3;

/// Widths of the columns of the text form [characters]: trainee, task.
const NAME: usize = 18;
const TASK: usize = 26;

/// Everything that a history folder holds.
#[derive(Debug, Default)]
pub struct Class {
    /// By trainee, then by task.
    pub standings: Vec<Standing>,
    /// One message with its way out per file that could not be read.
    pub broken: Vec<Error>,
}

/// One trainee at one task.
#[derive(Debug, Clone, PartialEq)]
pub struct Standing {
    pub trainee: String,
    pub task: String,
    /// In order.
    pub attempts: Vec<Attempt>,
}

/// Where a figure goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trend {
    Better,
    Worse,
    Same,
    /// Too few attempts, or a figure that is neither better nor worse.
    Unknown,
}

impl Trend {
    /// As in tables.
    pub fn word(self) -> &'static str {
        match self {
            Trend::Better => "better",
            Trend::Worse => "worse",
            Trend::Same => "same",
            Trend::Unknown => "-",
        }
    }
}

/// Goals of an attempt that were met, of all; `None` where it is not scored.
pub fn goals_met(attempt: &Attempt) -> Option<(usize, usize)> {
    let goals = &attempt.score.goals;
    attempt.score.passed()?;
    Some((goals.iter().filter(|goal| goal.met == Some(true)).count(), goals.len()))
}

/// The figures that are shown for a task, best first.
pub fn key_figures(attempt: &Attempt) -> Vec<String> {
    let found = skill_evidence::built_in().task.iter().find(|task| task.task == attempt.task);
    if let Some(evidence) = found.filter(|evidence| !evidence.key_figures.is_empty()) {
        return evidence.key_figures.clone();
    }
    let row = |key: &&str| {
        let rows = &attempt.score.rows;
        rows.iter().find(|row| if key.ends_with('.') { row.key.starts_with(*key) } else { row.key == *key })
    };
    let held = USUAL.iter().filter_map(row).filter(|row| row.value.is_some());
    held.map(|row| row.key.clone()).take(skill_evidence::KEY_FIGURES).collect()
}

impl Standing {
    pub fn passed(&self) -> usize {
        self.attempts.iter().filter(|a| a.score.passed() == Some(true)).count()
    }

    /// Attempts that are scored.
    pub fn scored(&self) -> usize {
        self.attempts.iter().filter(|a| a.score.passed().is_some()).count()
    }

    /// The attempt with the largest share of the goals met, the first of equal ones; `None` where none is scored.
    pub fn best(&self) -> Option<&Attempt> {
        let scored = self.attempts.iter().filter_map(|a| Some((a.score.share()?, a)));
        scored.rev().max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, attempt)| attempt)
    }

    pub fn last(&self) -> Option<&Attempt> {
        self.attempts.last()
    }

    /// Keys of the figures that are shown.
    pub fn key_figures(&self) -> Vec<String> {
        self.last().map(key_figures).unwrap_or_default()
    }

    /// Number of the attempt and value of a figure, where it has one.
    pub fn series(&self, key: &str) -> Vec<(f64, f64)> {
        progress(&self.attempts, &self.task, key).into_iter().map(|(n, _, value)| (f64::from(n), value)).collect()
    }

    /// Where a figure goes over the attempts.
    pub fn trend(&self, key: &str) -> Trend {
        let series = self.series(key);
        let better = self.last().and_then(|a| a.score.rows.iter().find(|row| row.key == key)).map(|row| row.better);
        let (Some(change), Some(better), true) = (slope(&series), better, series.len() >= FEWEST) else {
            return Trend::Unknown;
        };
        let reach = series.last().zip(series.first()).map_or(0.0, |(last, first)| last.0 - first.0);
        let size = series.iter().map(|p| p.1.abs()).fold(0.0, f64::max);
        let sign = match better {
            Better::Lower => -1.0,
            Better::Higher => 1.0,
            Better::None => return Trend::Unknown,
        };
        match change * reach * sign {
            x if x.abs() < NOTABLE * size || x == 0.0 => Trend::Same,
            x if x > 0.0 => Trend::Better,
            _ => Trend::Worse,
        }
    }
}

impl Class {
    /// Reads a history folder. A file that cannot be read is told and left as it is.
    ///
    /// # Errors
    /// `Error::Input` where there is no such folder, `Error::File` where it cannot be listed.
    pub fn read(root: &Path) -> Result<Class> {
        if !root.is_dir() {
            return Err(Error::input(
                format!("{}: there is no such folder", root.display()),
                format!(
                    "name the folder of the attempts; the window keeps them in `{}` unless told otherwise",
                    history::FOLDER
                ),
            ));
        }
        let history = History::new(root);
        let trainees = history.trainees()?;
        let mut class = Class::default();
        for trainee in &trainees {
            let found = history.attempts(trainee)?;
            class.broken.extend(found.broken);
            for attempt in found.attempts {
                match class.standings.last_mut().filter(|s| s.trainee == *trainee && s.task == attempt.task) {
                    Some(standing) => standing.attempts.push(attempt),
                    None => class.standings.push(Standing {
                        trainee: trainee.clone(),
                        task: attempt.task.clone(),
                        attempts: vec![attempt],
                    }),
                }
            }
        }
        let known: Vec<String> = trainees.iter().map(|name| file_name(name)).collect();
        for folder in sorted(root)?.into_iter().filter(|path| path.is_dir()) {
            let name = folder.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if known.contains(&name) {
                continue;
            }
            // Nobody is known by a file in it.
            let files = sorted(&folder)?.into_iter().filter(|path| path.extension().is_some_and(|e| e == "json"));
            class.broken.extend(files.filter_map(|path| history::read(&path).err()));
        }
        Ok(class)
    }

    /// All attempts, by trainee and task.
    pub fn attempts(&self) -> impl Iterator<Item = &Attempt> {
        self.standings.iter().flat_map(|standing| &standing.attempts)
    }

    /// Standings of a trainee.
    ///
    /// # Errors
    /// `Error::Input` for a name that nobody has.
    pub fn of(&self, trainee: &str) -> Result<Vec<&Standing>> {
        let found: Vec<&Standing> = self.standings.iter().filter(|s| s.trainee == trainee).collect();
        if found.is_empty() {
            let mut names: Vec<&str> = self.standings.iter().map(|s| s.trainee.as_str()).collect();
            names.dedup();
            return Err(Error::input(
                format!("there is no attempt of `{trainee}`"),
                format!("name one of: {}", names.join(", ")),
            ));
        }
        Ok(found)
    }

    /// The table for the terminal.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{:<NAME$} {:<TASK$} {:>8} {:>6} {:>5} {:>5}  {:<10}  trend of the key figures\n",
            "trainee", "task", "attempts", "passed", "best", "last", "last on"
        );
        for s in &self.standings {
            let met = |attempt: Option<&Attempt>| {
                attempt.and_then(goals_met).map_or("-".to_string(), |(met, of)| format!("{met}/{of}"))
            };
            let trends: Vec<String> = s.key_figures().iter().map(|key| s.in_words(key)).collect();
            let day = s.last().map(|a| iso_8601(a.finished)[..10].to_string()).unwrap_or_default();
            text += &format!(
                "{:<NAME$} {:<TASK$} {:>8} {:>6} {:>5} {:>5}  {day}  {}\n",
                cut(&s.trainee, NAME),
                cut(&s.task, TASK),
                s.attempts.len(),
                s.passed(),
                met(s.best()),
                met(s.last()),
                trends.join("; ")
            );
        }
        text
    }

    /// One row per trainee and task; key figures with the last value and the trend.
    ///
    /// # Errors
    /// `Error::Input` where the table cannot be written, which is a defect.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        let defect = |reason: csv::Error| Error::input(reason.to_string(), "report this as a defect");
        let mut head: Vec<String> = [
            "trainee",
            "task",
            "scene",
            "attempts",
            "scored",
            "passed",
            "best_goals_met",
            "last_goals_met",
            "goals",
            "first_finished",
            "last_finished",
        ]
        .map(String::from)
        .to_vec();
        for n in 1..=skill_evidence::KEY_FIGURES {
            head.extend(["figure", "unit", "last", "trend"].map(|name| format!("{name}_{n}")));
        }
        writer.write_record(&head).map_err(defect)?;
        for s in &self.standings {
            let (Some(first), Some(last)) = (s.attempts.first(), s.last()) else { continue };
            let met =
                |attempt: Option<&Attempt>| attempt.and_then(goals_met).map_or(String::new(), |m| m.0.to_string());
            let mut row = vec![
                s.trainee.clone(),
                s.task.clone(),
                last.score.scene.clone(),
                s.attempts.len().to_string(),
                s.scored().to_string(),
                s.passed().to_string(),
                met(s.best()),
                met(Some(last)),
                last.score.goals.len().to_string(),
                iso_8601(first.finished),
                iso_8601(last.finished),
            ];
            let keys = s.key_figures();
            for n in 0..skill_evidence::KEY_FIGURES {
                let figure = keys.get(n).and_then(|key| last.score.rows.iter().find(|row| row.key == *key));
                row.extend(match figure {
                    Some(figure) => [
                        figure.key.clone(),
                        figure.unit.clone(),
                        figure.value.map_or(String::new(), |value| value.to_string()),
                        s.trend(&figure.key).word().to_string(),
                    ],
                    None => [const { String::new() }; 4],
                });
            }
            writer.write_record(&row).map_err(defect)?;
        }
        writer.into_inner().map_err(|reason| Error::input(reason.to_string(), "report this as a defect"))
    }
}

impl Standing {
    /// `passes 1 (better)`.
    fn in_words(&self, key: &str) -> String {
        let value = self.last().and_then(|a| a.score.value(key)).map_or("-".into(), short);
        format!("{key} {value} ({})", self.trend(key).word())
    }
}

/// Entries of a folder, sorted.
fn sorted(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).map_err(|source| Error::file(folder, source))?;
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(|source| Error::file(folder, source))?.path());
    }
    paths.sort();
    Ok(paths)
}

/// At most `width` characters of a text; a tilde stands for the rest.
fn cut(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.into();
    }
    text.chars().take(width - 1).chain(['~']).collect()
}

/// `2022-03-01T14:05:00Z` from seconds since 1970.
pub fn iso_8601(seconds: u64) -> String {
    let [year, month, day, hour, minute, second] = calendar(seconds);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}
