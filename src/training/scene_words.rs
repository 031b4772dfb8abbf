//! Texts of the program's own training scenes in the language of the window. English is what stands in the scene; every other language has
//! its words in `assets/words/<code>/tasks.ftl`: `title-<stem>` and `briefing-<stem>` by the name of the file, `name-<name>` for whatever
//! has a name in a scene (regions, targets, goals, parts of a patient). A text that is not one of these stays as it is, so that
//! scenes of others say what their authors wrote.

use std::collections::HashMap;
use std::path::Path;
use std::sync::OnceLock;

use serde::Deserialize;

use super::texts::OWN_MATERIAL;
use crate::reading;
use crate::scene::{Goal, Scene};
use crate::words::say_of;

/// Where the training scenes of the program are.
const FOLDERS: [&str; 2] = ["scenes/training/", "scenes/anatomy/"];

/// Of which scene a text is: its file's name as a part of a key.
#[derive(Default)]
struct Known {
    titles: HashMap<String, String>,
    briefings: HashMap<String, String>,
    tasks: HashMap<String, String>,
}

/// What a card or a word needs of a scene file: a patient takes seconds to load.
#[derive(Deserialize)]
pub struct Head {
    /// `title`, where the file has one.
    pub title: Option<String>,
    /// `[task]`, where the file has one.
    pub task: Option<TaskHead>,
}

/// The texts of a task.
#[derive(Deserialize)]
pub struct TaskHead {
    /// As on its card.
    pub name: String,
    /// What a trainee reads before the start.
    pub briefing: String,
}

/// A file's name as a part of a key.
pub fn stem_of(path: &Path) -> String {
    path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default().replace('_', "-")
}

fn known() -> &'static Known {
    static KNOWN: OnceLock<Known> = OnceLock::new();
    KNOWN.get_or_init(|| {
        let mut known = Known::default();
        let files = FOLDERS.into_iter().flat_map(reading::built_in_below).filter(|name| name.ends_with(".toml"));
        for path in files.map(Path::new) {
            // The built-in text, whatever lies on disk under its name.
            let text = reading::built_in(path).and_then(|(_, bytes)| std::str::from_utf8(bytes).ok());
            let head = text.and_then(|text| toml::from_str::<Head>(text).ok());
            let Some((title, task)) = head.and_then(|head| Some((head.title?, head.task?))) else { continue };
            let stem = stem_of(path);
            known.titles.insert(title, stem.clone());
            known.briefings.insert(task.briefing.trim().into(), stem.clone());
            known.tasks.insert(task.name, stem);
        }
        known
    })
}

/// The text `<kind>-<stem>` of the scene that has this one.
fn said<'a>(text: &'a str, of: &HashMap<String, String>, kind: &str) -> &'a str {
    of.get(text.trim()).and_then(|stem| say_of(&format!("{kind}-{stem}"))).unwrap_or(text)
}

/// Title of a scene.
pub fn title(text: &str) -> &str {
    said(text, &known().titles, "title")
}

/// What a trainee reads before the start.
pub fn briefing(text: &str) -> &str {
    said(text, &known().briefings, "briefing")
}

/// Name of a task, as on its card.
pub fn task(name: &str) -> &str {
    said(name, &known().tasks, "task")
}

/// The key of a name.
fn key_of(name: &str) -> String {
    let letter = |c: char| if c.is_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
    format!("name-{}", name.chars().map(letter).collect::<String>())
}

/// What has a name in a scene. A block is named by its material; names of the library that are none for people have one in English too.
pub fn name(name: &str) -> &str {
    say_of(&key_of(name)).unwrap_or(name)
}

/// All keys that a language needs to tell a training scene, with the texts that stand in it.
pub fn keys(scene: &Scene) -> Vec<(String, String)> {
    let stem = stem_of(&scene.path);
    let mut found = vec![(format!("title-{stem}"), scene.title.clone())];
    let mut names = vec![OWN_MATERIAL.to_string()];
    if let Some(task) = &scene.task {
        found.push((format!("briefing-{stem}"), task.briefing.clone()));
        found.push((format!("task-{stem}"), task.name.clone()));
        names.extend(task.goals.iter().filter_map(|goal| match goal {
            Goal::Avoid { name, .. } | Goal::StopInLayer { name, .. } => Some(name.clone()),
            _ => None,
        }));
    }
    names.extend(scene.regions.iter().map(|region| region.name.clone()));
    names.extend(scene.targets.iter().map(|target| target.name.clone()));
    if let Some(case) = &scene.case {
        names.extend(case.map.names.values().filter(|name| !name.is_empty()).cloned());
    }
    found.extend(names.into_iter().map(|name| (key_of(&name), name)));
    found
}
