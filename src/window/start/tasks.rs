//! What can be opened: the tasks in the order in which they are learned, and all other scenes of the program.

use std::path::{Path, PathBuf};

use crate::reading;
use crate::training::scene_words::Head;
use crate::words::say_of;

/// Tasks of the program from easy to hard, with their difficulty from 1 to 3.
const COURSE: [(&str, u8); 9] = [
    ("scenes/training/core_biopsy.toml", 1),
    ("scenes/training/hit_target.toml", 1),
    ("scenes/training/thin_layer_stop.toml", 2),
    ("scenes/training/avoid_vessel.toml", 2),
    ("scenes/anatomy/forearm_vein.toml", 2),
    ("scenes/anatomy/lumbar_puncture.toml", 2),
    ("scenes/training/lumbar_oblique.toml", 3),
    ("scenes/anatomy/neck_vein.toml", 3),
    ("scenes/anatomy/liver_lesion.toml", 3),
];

/// A task as its card shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    pub path: PathBuf,
    /// Name in the scene file; attempts are kept under it.
    pub key: String,
    /// Part of the keys of its texts: the name of its file.
    stem: String,
    briefing: String,
    pub difficulty: u8,
}

/// A scene of the program.
#[derive(Debug, Clone, PartialEq)]
pub struct BuiltIn {
    pub path: PathBuf,
    pub title: String,
}

fn head(path: &Path) -> Option<Head> {
    let text = reading::text(path, reading::most::SCENE).ok()?;
    toml::from_str(&text).ok()
}

impl Task {
    fn of(path: &str, difficulty: u8) -> Option<Task> {
        let path = PathBuf::from(path);
        let task = head(&path)?.task?;
        let stem = path.file_stem()?.to_str()?.replace('_', "-");
        Some(Task { path, key: task.name, stem, briefing: task.briefing, difficulty })
    }

    /// Its name in the language of the window; as in its file where no language has one.
    pub fn name(&self) -> &str {
        say_of(&format!("task-{}", self.stem)).unwrap_or(&self.key)
    }

    /// What it trains, in one line.
    pub fn line(&self) -> &str {
        let first = self.briefing.split_inclusive('.').next().unwrap_or_default();
        say_of(&format!("task-line-{}", self.stem)).unwrap_or(first.trim())
    }

    /// The picture on its card, as the program has drawn it: the bytes of a PNG.
    pub fn picture(&self) -> Option<&'static [u8]> {
        let name = self.path.file_stem()?.to_str()?;
        reading::built_in(Path::new(&format!("assets/thumbnails/{name}.png"))).map(|(_, bytes)| bytes)
    }
}

/// All tasks of the program, in the order of the course.
pub fn tasks() -> Vec<Task> {
    COURSE.iter().filter_map(|(path, difficulty)| Task::of(path, *difficulty)).collect()
}

/// The scenes of the program that have a needle to lead, with their titles, without the tasks.
pub fn built_in() -> Vec<BuiltIn> {
    let names = reading::built_in_below("scenes/").filter(|name| name.ends_with(".toml"));
    let others = names.filter(|name| COURSE.iter().all(|(task, _)| task != name));
    let with_title = others.filter_map(|name| {
        let path = PathBuf::from(name);
        let title = head(&path)?.title.unwrap_or_else(|| name.to_string());
        Some(BuiltIn { path, title })
    });
    with_title.collect()
}

/// The task behind that of this file.
pub fn behind(path: &Path) -> Option<PathBuf> {
    let at = COURSE.iter().position(|(task, _)| path.ends_with(task))?;
    COURSE.get(at + 1).map(|(task, _)| PathBuf::from(task))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_with_a_task_has_its_card() {
        let tasks = tasks();
        assert_eq!(tasks.len(), COURSE.len());
        for other in built_in() {
            let stray = head(&other.path).is_some_and(|head| head.task.is_some());
            assert!(!stray, "{} has a task and no card", other.path.display());
        }
        for task in &tasks {
            assert!(say_of(&format!("task-{}", task.stem)).is_some(), "{} has no name", task.stem);
            assert!(say_of(&format!("task-line-{}", task.stem)).is_some(), "{} has no line", task.stem);
            assert!((1..=3).contains(&task.difficulty));
        }
        assert_eq!(behind(&tasks[0].path).as_deref(), Some(&*tasks[1].path));
        assert_eq!(behind(Path::new("/somewhere/scenes/training/core_biopsy.toml")).as_deref(), Some(&*tasks[1].path));
        assert_eq!(behind(&tasks[8].path), None);
    }
}
