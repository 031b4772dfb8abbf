//! What is said of a scene file that cannot be read: which one may have been meant.

use std::path::Path;

use super::super::document::closest;
use crate::error::brief;
use crate::reading;

/// Folder of the program's own scenes.
const OWN: &str = "scenes";

/// The text of a refusal.
pub(super) fn refusal(message: &str, way_out: &str) -> String {
    format!("error: {}\n  = way out: {}\n", brief(message), brief(way_out))
}

/// Names of the TOML files in a folder, sorted.
fn toml_files(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    names.sort();
    names
}

/// The scenes that are built into the program, in this folder and below it.
fn own_scenes(folder: &str) -> impl Iterator<Item = &'static str> {
    reading::built_in_below(folder).filter(|name| name.ends_with(".toml"))
}

fn stem(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or_default().trim_end_matches(".toml")
}

/// The text for a file that cannot be read.
pub(super) fn unreadable(path: &Path, error: &std::io::Error) -> String {
    let name = path.display();
    let within = reading::built_in_folder(path);
    let own: Vec<&str> = within.iter().flat_map(|folder| own_scenes(folder)).collect();
    let is_folder = path.is_dir();
    if is_folder || !own.is_empty() {
        let scenes = toml_files(path);
        let beside = |scene: &String| path.join(scene).display().to_string();
        let way_out = match (scenes.first().map(beside), own.first()) {
            (Some(first), _) => format!("give one of its scenes, e.g. {first}; there are: {}", scenes.join(", ")),
            (None, Some(first)) if !is_folder => {
                format!("give one of the built-in scenes there, e.g. {first}; there are: {}", own.join(", "))
            }
            _ => "give the path of a scene file (.toml); this folder holds none".into(),
        };
        return refusal(&format!("{name} is a folder, not a scene file"), &way_out);
    }
    let named = path.parent().filter(|p| !p.as_os_str().is_empty());
    let meant = path.file_stem().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    // Beside the file first; a name may also mean one of the program's own scenes. The ending that all share is no likeness.
    let folders = [named.unwrap_or(Path::new(".")), Path::new(OWN)];
    let near = folders.iter().find_map(|folder| {
        let scenes = toml_files(folder);
        let near = closest(&meant, scenes.iter().map(|name| stem(name)))?;
        let near = folder.join(format!("{near}.toml"));
        Some(near.strip_prefix(".").unwrap_or(&near).display().to_string())
    });
    let near = near.or_else(|| {
        let near = closest(&meant, own_scenes(OWN).map(stem))?;
        // Of those with the same name the one in the uppermost folder.
        let named_so = own_scenes(OWN).filter(|scene| stem(scene) == near);
        named_so.min_by_key(|scene| scene.matches('/').count()).map(|scene| format!("{scene} (built in)"))
    });
    let listed = named.unwrap_or(Path::new(OWN));
    let scenes = toml_files(listed);
    let way_out = match near {
        Some(near) => format!("did you mean {near}?"),
        None if scenes.is_empty() => {
            "give the path of a scene file (.toml); of the program's own the first is scenes/muscle_biopsy.toml".into()
        }
        None => format!("scenes in {}: {}", listed.display(), scenes.join(", ")),
    };
    refusal(&format!("cannot read the scene file {name}: {error}"), &way_out)
}
