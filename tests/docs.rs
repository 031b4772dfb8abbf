//! The documentation says what the program is: generated parts, links, names of files, the first scene, the size of README.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use stylet::docs::{Part, all_columns, marks, renewed};
use stylet::effects::EFFECTS;
use stylet::scene::Scene;

/// Most lines of README.
const MOST_LINES: usize = 200;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    out_of_date();
    text(name)
}

fn text(name: &str) -> String {
    let path = root().join(name);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// What is wrong with the generated parts of the pages, one line per part; before anything else is read, `UPDATE_DOCS=1` writes them anew.
fn out_of_date() -> &'static [String] {
    static WRONG: OnceLock<Vec<String>> = OnceLock::new();
    WRONG.get_or_init(|| {
        let write = std::env::var("UPDATE_DOCS").is_ok_and(|v| v == "1");
        let mut wrong = Vec::new();
        for part in parts() {
            let name = format!("docs/{}", part.page);
            let page = text(&name);
            match renewed(&page, part.name, &part.text) {
                None => {
                    let (begin, end) = marks(part.name);
                    wrong.push(format!("{name}: write `{begin}` and `{end}` where the part shall stand"));
                }
                Some(new) if new != page && write => fs::write(root().join(&name), new).unwrap(),
                Some(new) if new != page => {
                    wrong.push(format!("{name}: the part {} is not that of the program", part.name))
                }
                Some(_) => {}
            }
        }
        wrong
    })
}

fn parts() -> Vec<Part> {
    stylet::docs::parts(root()).unwrap_or_else(|error| panic!("{error}"))
}

/// Names of all pages below `docs/`, with `/` between folder and file.
fn pages() -> Vec<String> {
    let folder = root().join("docs");
    let mut pages = Vec::new();
    let mut folders = vec![folder.clone()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|kind| kind == "md") {
                let parts = path.strip_prefix(&folder).unwrap().components();
                let parts: Vec<String> = parts.map(|part| part.as_os_str().to_string_lossy().into_owned()).collect();
                pages.push(parts.join("/"));
            }
        }
    }
    pages.sort();
    pages
}

/// Everything that a person reads, relative to the root.
fn texts() -> Vec<String> {
    let own = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(String::from);
    own.into_iter().chain(pages().into_iter().map(|page| format!("docs/{page}"))).collect()
}

#[test]
fn generated_parts_are_those_of_the_program() {
    let wrong = out_of_date();
    let way_out = "write them anew with: UPDATE_DOCS=1 cargo test --test files docs";
    assert!(wrong.is_empty(), "{}\n{way_out}", wrong.join("\n"));
}

#[test]
fn a_part_that_is_out_of_date_is_found() {
    for part in parts() {
        let page = read(&format!("docs/{}", part.page));
        let changed = part.text.replacen("| ", "| x", 1) + "x";
        assert_ne!(renewed(&page, part.name, &changed).unwrap(), page, "{} of docs/{}", part.name, part.page);
    }
}

#[test]
fn every_mark_of_a_page_belongs_to_a_part() {
    let known: BTreeSet<(String, &str)> = parts().into_iter().map(|part| (part.page, part.name)).collect();
    for page in pages() {
        for mark in prose(&read(&format!("docs/{page}"))).split("<!-- generated: ").skip(1) {
            let name = mark.split(" -->").next().unwrap_or_default();
            assert!(known.contains(&(page.clone(), name)), "docs/{page}: nothing renders the part {name:?}");
        }
    }
}

#[test]
fn every_effect_has_its_page() {
    for effect in EFFECTS {
        let page = read(&format!("docs/effects/{}.md", effect.key));
        let by_hand = outside_parts(&page);
        assert!(by_hand.lines().count() > 8, "docs/effects/{}.md: nothing is written by hand", effect.key);
    }
}

/// A page without its generated parts.
fn outside_parts(page: &str) -> String {
    let mut text = String::new();
    for (index, piece) in page.split("<!-- generated: ").enumerate() {
        let by_hand = if index == 0 { piece } else { piece.split_once("<!-- end: ").map_or("", |(_, rest)| rest) };
        text += by_hand;
    }
    text
}

#[test]
fn every_column_of_the_tables_is_explained() {
    let text = read("docs/files.md");
    for column in all_columns() {
        assert!(text.contains(&format!("\n| `{column}` | ")), "docs/files.md does not explain the column {column}");
    }
}

#[test]
fn the_readme_is_short() {
    let lines = read("README.md").lines().count();
    assert!(lines <= MOST_LINES, "README has {lines} lines, at most {MOST_LINES} are wanted: move the rest into docs/");
}

#[test]
fn the_first_scene_of_the_readme_is_one() {
    let readme = read("README.md");
    let scene = readme.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
    let scene = scene.expect("README has a scene between ```toml and ```");
    let scene = Scene::parse(&root().join("first.toml"), scene, &[]).unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.notices.is_empty(), "{:?}", scene.notices);
    assert!(!scene.effects.keys().is_empty());
}

/// The text of a page without blocks of code.
fn without_blocks(text: &str) -> String {
    let mut inside = false;
    let mut kept = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            inside = !inside;
        } else if !inside {
            kept.push(line);
        }
    }
    kept.join("\n")
}

/// The same without code between single backticks.
fn prose(text: &str) -> String {
    let text = without_blocks(text);
    let paragraphs = text.split("\n\n");
    paragraphs.map(|p| p.split('`').step_by(2).collect::<String>()).collect::<Vec<_>>().join("\n\n")
}

/// Targets of the links and pictures of a page.
fn targets(text: &str) -> Vec<String> {
    let text = prose(text);
    text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target.to_string()).collect()
}

/// The anchor of a heading, as GitHub and MkDocs make it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept: String = kept.chars().filter(|c| c.is_alphanumeric() || "-_ ".contains(*c)).collect();
    kept.trim().split(' ').filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
}

fn anchors(text: &str) -> BTreeSet<String> {
    let text = without_blocks(text);
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| anchor(line.trim_start_matches('#'))).collect()
}

/// What is wrong with the link `target` of the file `from`.
fn broken(from: &Path, target: &str) -> Option<String> {
    if target.starts_with("https://") || target.starts_with("http://") {
        return None;
    }
    let (file, part) = target.split_once('#').map_or((target, None), |(file, part)| (file, Some(part)));
    let path: PathBuf = if file.is_empty() { from.into() } else { from.parent().unwrap_or(from).join(file) };
    if !path.exists() {
        return Some(format!("{}: no file for the link {target}", from.display()));
    }
    let part = part?;
    let known = anchors(&fs::read_to_string(&path).unwrap_or_default());
    (!known.contains(part)).then(|| format!("{}: no heading for the link {target}", from.display()))
}

#[test]
fn every_link_leads_somewhere() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for name in texts() {
        for target in targets(&read(&name)) {
            count += 1;
            wrong.extend(broken(&root().join(&name), &target));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 100, "only {count} links were found");
}

#[test]
fn a_broken_link_is_found() {
    let page = root().join("README.md");
    let text = "[a](docs/no_page.md) `[b](docs/neither.md)` ![c](docs/pictures/window.png)\n\n[d](#no-heading)\n";
    assert_eq!(targets(text), ["docs/no_page.md", "docs/pictures/window.png", "#no-heading"]);
    let wrong: Vec<bool> = targets(text).iter().map(|target| broken(&page, target).is_some()).collect();
    assert_eq!(wrong, [true, false, true]);
    assert_eq!(anchor("When something goes wrong: `NaN`"), "when-something-goes-wrong-nan");
}

/// Folders of the repository whose files the documentation names.
const FOLDERS: [&str; 9] = ["scenes/", "src/", "shaders/", "tests/", "scripts/", "assets/", "docs/", "fuzz/", ".ci/"];

/// Names of files and folders of the repository in a text that are not there.
fn missing_files(text: &str) -> BTreeSet<String> {
    let words = text.split(|c: char| !(c.is_alphanumeric() || "._-/".contains(c)));
    let named = words.filter(|word| FOLDERS.iter().any(|folder| word.starts_with(folder)));
    named
        .map(|word| word.trim_end_matches(['.', '/']))
        .filter(|word| !root().join(word).exists())
        .map(String::from)
        .collect()
}

#[test]
fn every_file_that_is_named_exists() {
    for name in texts().iter().filter(|name| *name != "CHANGELOG.md") {
        let missing = missing_files(&read(name));
        assert!(missing.is_empty(), "{name} names what is not there: {missing:?}");
    }
    let missing = missing_files("`scenes/no_scene.toml`, `src/docs.rs:12` and `src/material/<law>.rs`.");
    assert_eq!(missing.into_iter().collect::<Vec<_>>(), ["scenes/no_scene.toml"]);
}

#[test]
fn every_page_is_in_the_contents_of_the_site() {
    let settings = read("mkdocs.yml");
    let listed: BTreeSet<String> = settings
        .lines()
        .filter_map(|line| line.split_whitespace().last())
        .filter(|word| word.ends_with(".md"))
        .map(String::from)
        .collect();
    let pages: BTreeSet<String> = pages().into_iter().collect();
    assert_eq!(listed, pages, "pages in the nav of mkdocs.yml, and files in docs/");
}
