//! The code stands on the floors of `docs/architecture.md`: nothing imports from a floor above it, and no circle of imports is large.
//!
//! Imports are read off the sources: `use` declarations, and paths in the code that begin with `crate`, `stylet`, `super`, `self` or a
//! module below. Test modules, comments and texts do not count, nor does an import from a file to the `mod.rs` of a folder that it lies in:
//! a folder and its face are one room.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Most files that may import each other in a circle.
const LARGEST_CIRCLE: usize = 3;

/// Name of a source file, such as `src/needle/gap.rs`, and its text.
type Sources = BTreeMap<String, String>;

/// From which file to which.
type Arrows = BTreeSet<(String, String)>;

/// Words, `::` and single signs of a source; comments and texts are left out.
fn tokens(source: &str) -> Vec<String> {
    let text: Vec<char> = source.chars().collect();
    let at = |i: usize| text.get(i).copied().unwrap_or('\n');
    let word = |c: char| c.is_alphanumeric() || c == '_';
    let (mut all, mut i) = (Vec::new(), 0);
    while i < text.len() {
        match (at(i), at(i + 1)) {
            ('/', '/') => i += text[i..].iter().position(|c| *c == '\n').unwrap_or(text.len() - i),
            ('/', '*') => {
                i += 2;
                while i < text.len() && (at(i), at(i + 1)) != ('*', '/') {
                    i += 1;
                }
                i += 2;
            }
            ('r', '"' | '#') if i == 0 || !word(at(i - 1)) => {
                let hashes = text[i + 1..].iter().take_while(|c| **c == '#').count();
                let end: Vec<char> = format!("\"{}", "#".repeat(hashes)).chars().collect();
                i += 2 + hashes;
                while i < text.len() && !text[i..].starts_with(&end) {
                    i += 1;
                }
                i += end.len();
            }
            ('"', _) => {
                i += 1;
                while i < text.len() && at(i) != '"' {
                    i += if at(i) == '\\' { 2 } else { 1 };
                }
                i += 1;
            }
            // A character, not a lifetime.
            ('\'', '\\') => i += 4 + text[i + 3..].iter().position(|c| *c == '\'').unwrap_or(0),
            ('\'', _) if at(i + 2) == '\'' => i += 3,
            (':', ':') => {
                all.push("::".into());
                i += 2;
            }
            (c, _) if word(c) => {
                let end = text[i..].iter().position(|c| !word(*c)).map_or(text.len(), |n| i + n);
                all.push(text[i..end].iter().collect());
                i = end;
            }
            (c, _) => {
                if !c.is_whitespace() {
                    all.push(c.to_string());
                }
                i += 1;
            }
        }
    }
    all
}

/// The paths of a tree of a `use` declaration that begins at `i`, behind `before`; `i` then stands behind it.
fn leaves(tokens: &[String], i: &mut usize, before: &[String], paths: &mut Vec<Vec<String>>) {
    let mut path = before.to_vec();
    while *i < tokens.len() {
        match tokens[*i].as_str() {
            "::" => *i += 1,
            "{" => {
                while tokens[*i] != "}" {
                    *i += 1;
                    if tokens[*i] != "}" {
                        leaves(tokens, i, &path, paths);
                    }
                }
                *i += 1;
                return;
            }
            "as" => *i += 2,
            "," | ";" | "}" => break,
            name => {
                path.extend((name != "self" || path.is_empty()).then(|| name.to_string()));
                *i += 1;
            }
        }
    }
    paths.push(path);
}

/// Where the bracket that opens at `i` is closed.
fn closed(tokens: &[String], i: usize, open: &str, close: &str) -> usize {
    let mut depth = 0;
    for (n, token) in tokens.iter().enumerate().skip(i) {
        depth += i32::from(token == open) - i32::from(token == close);
        if depth == 0 {
            return n;
        }
    }
    tokens.len()
}

/// Paths that a source names, with the modules inside the file in which they stand.
fn paths(source: &str) -> Vec<(Vec<String>, Vec<String>)> {
    let tokens = tokens(source);
    let is = |i: usize, wanted: &str| tokens.get(i).is_some_and(|token| token == wanted);
    let (mut all, mut i, mut depth) = (Vec::new(), 0, 0);
    let (mut inside, mut of_tests): (Vec<(String, i32)>, bool) = (Vec::new(), false);
    while i < tokens.len() {
        let within = || inside.iter().map(|(name, _)| name.clone()).collect::<Vec<String>>();
        match tokens[i].as_str() {
            "#" if is(i + 1, "[") => {
                let end = closed(&tokens, i + 1, "[", "]");
                let has = |word: &str| tokens[i..end].iter().any(|token| token == word);
                of_tests |= has("cfg") && has("test") && !has("not");
                i = end;
            }
            "mod" if is(i + 2, "{") && of_tests => {
                i = closed(&tokens, i + 2, "{", "}");
                of_tests = false;
            }
            "mod" if is(i + 2, "{") => {
                inside.push((tokens[i + 1].clone(), depth));
                i += 1;
            }
            "use" => {
                i += 1;
                let mut found = Vec::new();
                leaves(&tokens, &mut i, &[], &mut found);
                all.extend(found.into_iter().map(|path| (within(), path)));
            }
            "{" => (depth, of_tests) = (depth + 1, false),
            ";" => of_tests = false,
            "}" => {
                depth -= 1;
                inside.pop_if(|(_, from)| *from == depth);
            }
            _ if is(i + 1, "::") && !is(i.wrapping_sub(1), "::") => {
                let mut path = vec![tokens[i].clone()];
                while is(i + 1, "::") && tokens.get(i + 2).is_some_and(|t| t.starts_with(char::is_alphabetic)) {
                    path.push(tokens[i + 2].clone());
                    i += 2;
                }
                all.push((within(), path));
            }
            _ => {}
        }
        i += 1;
    }
    all
}

/// `src/needle/gap.rs` is the module `needle::gap`.
fn module(file: &str) -> Vec<String> {
    let name = file.trim_start_matches("src/").trim_end_matches(".rs");
    let name = if name == "lib" { "" } else { name.strip_suffix("/mod").unwrap_or(name) };
    name.split('/').filter(|part| !part.is_empty()).map(String::from).collect()
}

/// Which file imports which.
fn arrows(sources: &Sources) -> Arrows {
    let modules: BTreeMap<Vec<String>, &String> = sources.keys().map(|file| (module(file), file)).collect();
    let absolute = |own: &[String], path: &[String]| -> Option<Vec<String>> {
        let ups = path.iter().take_while(|part| *part == "super").count();
        let mut whole = match path[0].as_str() {
            "crate" | "stylet" => return Some(path[1..].to_vec()),
            "super" => own[..own.len().checked_sub(ups)?].to_vec(),
            _ => own.to_vec(),
        };
        whole.extend(path[ups..].iter().filter(|part| *part != "self").cloned());
        // Anything else begins with another crate, or with a name that was imported before.
        let beside = ups == 0 && path[0] != "self";
        (!beside || modules.contains_key(&whole[..own.len() + 1])).then_some(whole)
    };
    let nothing = String::new();
    let root: BTreeMap<String, Vec<String>> = paths(sources.get("src/lib.rs").unwrap_or(&nothing))
        .into_iter()
        .filter_map(|(_, path)| Some((path.last()?.clone(), absolute(&[], &path)?)))
        .collect();
    let mut arrows = Arrows::new();
    for (file, source) in sources {
        let own = module(file);
        for (inside, path) in paths(source) {
            let Some(mut target) = absolute(&[&own[..], &inside[..]].concat(), &path) else { continue };
            // What the root hands on; it knows macros by name only.
            if let Some(handed) = target.first().and_then(|name| root.get(name)) {
                target = handed.clone();
            }
            let file_of = (1..=target.len()).rev().find_map(|n| modules.get(&target[..n]));
            arrows.extend(file_of.filter(|to| **to != file).map(|to| (file.clone(), to.to_string())));
        }
    }
    arrows
}

/// Files that import each other, a set for every circle; arrows from a file to the face of its folder do not count.
fn circles(arrows: &Arrows) -> Vec<BTreeSet<String>> {
    let to_its_face = |from: &str, to: &str| to.strip_suffix("mod.rs").is_some_and(|folder| from.starts_with(folder));
    let mut next: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (from, to) in arrows.iter().filter(|(from, to)| !to_its_face(from, to)) {
        next.entry(from).or_default().push(to);
    }
    let reached = |from: &str| {
        let (mut known, mut open) = (BTreeSet::new(), vec![from]);
        while let Some(file) = open.pop() {
            for to in next.get(file).into_iter().flatten() {
                if known.insert(to.to_string()) {
                    open.push(to);
                }
            }
        }
        known
    };
    let reach: BTreeMap<&str, BTreeSet<String>> = next.keys().map(|file| (*file, reached(file))).collect();
    let round = |file: &str| -> BTreeSet<String> {
        let back = |other: &&String| reach.get(other.as_str()).is_some_and(|of| of.contains(file));
        reach[file].iter().filter(back).cloned().collect()
    };
    let all: BTreeSet<BTreeSet<String>> = reach.keys().map(|file| round(file)).filter(|c| c.len() > 1).collect();
    all.into_iter().collect()
}

/// The two tables of the page: modules of every floor from the ground up, and imports that may run up.
struct Page {
    floors: Vec<Vec<String>>,
    exceptions: BTreeSet<(String, String)>,
}

impl Page {
    fn read(text: &str) -> Page {
        let names = |cell: &str| -> Vec<String> {
            cell.split('`').skip(1).step_by(2).filter(|name| name.starts_with("src/")).map(String::from).collect()
        };
        let rows = |heading: &str| -> Vec<Vec<String>> {
            let part = text.split_once(&format!("{heading}\n")).map_or("", |(_, rest)| rest);
            let part = part.split("\n#").next().unwrap_or_default();
            let rows = part.lines().filter(|line| line.starts_with('|'));
            rows.map(|row| row.split('|').map(String::from).collect()).collect()
        };
        let floors = rows("## Floors").iter().map(|row| names(&row[2])).filter(|floor| !floor.is_empty()).collect();
        let exceptions = rows("### Imports that run up").into_iter().filter_map(|row| {
            let reason = row.get(3).is_some_and(|cell| !cell.trim().is_empty());
            Some((names(&row[1]).pop()?, names(&row[2]).pop()?)).filter(|_| reason)
        });
        Page { floors, exceptions: exceptions.collect() }
    }

    /// Floor and module of a file.
    fn place(&self, file: &str) -> Option<(usize, &str)> {
        let holds =
            |module: &str| file == module || file.strip_prefix(module).is_some_and(|rest| rest.starts_with('/'));
        let floors = self.floors.iter().enumerate();
        floors.flat_map(|(n, floor)| floor.iter().map(move |m| (n, m.as_str()))).find(|(_, module)| holds(module))
    }

    /// What is wrong with these imports, one line each.
    fn wrong(&self, sources: &Sources, arrows: &Arrows) -> Vec<String> {
        let homeless = sources.keys().filter(|file| self.place(file).is_none());
        let mut wrong: Vec<String> = homeless.map(|file| format!("{file} is on no floor")).collect();
        let mut needed = BTreeSet::new();
        for (from, to) in arrows {
            let (Some((low, own)), Some((high, other))) = (self.place(from), self.place(to)) else { continue };
            if own == other || low > high {
                continue;
            }
            let pair = (own.to_string(), other.to_string());
            if !self.exceptions.contains(&pair) {
                wrong.push(format!("{from} imports {to}, which is not below it"));
            }
            needed.insert(pair);
        }
        let stale = self.exceptions.difference(&needed);
        wrong.extend(stale.map(|(from, to)| format!("{from} -> {to} is an exception that nobody needs")));
        wrong
    }
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sources() -> Sources {
    let (mut all, mut folders) = (Sources::new(), vec!["src".to_string()]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(root().join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{folder}/{}", entry.file_name().to_string_lossy());
            if entry.file_type().unwrap().is_dir() {
                folders.push(name);
            } else if name.ends_with(".rs") {
                all.insert(name, fs::read_to_string(entry.path()).unwrap());
            }
        }
    }
    all
}

fn page() -> Page {
    Page::read(&fs::read_to_string(root().join("docs/architecture.md")).unwrap())
}

fn large(circles: Vec<BTreeSet<String>>) -> Vec<BTreeSet<String>> {
    circles.into_iter().filter(|circle| circle.len() > LARGEST_CIRCLE).collect()
}

#[test]
fn imports_run_down_the_floors() {
    let (page, sources) = (page(), sources());
    let arrows = arrows(&sources);
    assert!(arrows.len() > 800, "only {} imports were found", arrows.len());
    let wrong = page.wrong(&sources, &arrows);
    let way_out = "move what is imported down, or name the exception with its reason in docs/architecture.md";
    assert!(wrong.is_empty(), "{}\n{way_out}", wrong.join("\n"));
    for module in page.floors.iter().flatten() {
        assert!(root().join(module).exists(), "docs/architecture.md names {module}, which is not there");
    }
}

#[test]
fn no_circle_of_imports_is_large() {
    let large = large(circles(&arrows(&sources())));
    assert!(large.is_empty(), "files that import each other in a circle: {large:#?}");
}

fn made_up(files: &[(&str, &str)]) -> Sources {
    files.iter().map(|(name, text)| (name.to_string(), text.to_string())).collect()
}

const MADE_UP_PAGE: &str = "## Floors\n\n| floor | modules |\n|---|---|\n| low | `src/low`, `src/beside.rs` |\n| high | `src/high.rs` |\n\n\
    ### Imports that run up\n\n| from | to | why |\n|---|---|---|\n";

#[test]
fn a_made_up_arrow_that_runs_up_is_found() {
    let sources = made_up(&[
        ("src/low/mod.rs", "pub mod deep;"),
        ("src/low/deep.rs", "fn f() { crate::high::g(); }"),
        ("src/beside.rs", "use super::low::{deep::{self, f as h}};"),
        ("src/high.rs", "use crate::low::deep::f;"),
        ("src/stray.rs", ""),
    ]);
    let wrong = Page::read(MADE_UP_PAGE).wrong(&sources, &arrows(&sources));
    let up = "src/low/deep.rs imports src/high.rs, which is not below it";
    let beside = "src/beside.rs imports src/low/deep.rs, which is not below it";
    assert_eq!(wrong, ["src/stray.rs is on no floor", beside, up]);
    let allowed =
        format!("{MADE_UP_PAGE}| `src/low` | `src/high.rs` | a reason |\n| `src/beside.rs` | `src/low` | |\n");
    assert_eq!(Page::read(&allowed).wrong(&sources, &arrows(&sources)), ["src/stray.rs is on no floor", beside]);
    let stale = format!("{MADE_UP_PAGE}| `src/high.rs` | `src/low` | a reason |\n");
    assert_eq!(Page::read(&stale).wrong(&sources, &arrows(&sources)).len(), 4);
}

#[test]
fn a_made_up_circle_is_found() {
    let mut sources = made_up(&[
        ("src/a.rs", "use crate::b::B;"),
        ("src/b.rs", "use crate::c;"),
        ("src/c.rs", "fn f(_: stylet::d::D) {}"),
        ("src/d.rs", "use crate::e::*;"),
    ]);
    assert_eq!(circles(&arrows(&sources)), []);
    sources.insert("src/d.rs".into(), "use crate::{a::A};".into());
    let found = large(circles(&arrows(&sources)));
    assert_eq!(found.len(), 1);
    assert_eq!(Vec::from_iter(&found[0]), ["src/a.rs", "src/b.rs", "src/c.rs", "src/d.rs"]);
}

#[test]
fn only_imports_of_the_program_are_read() {
    let text = r##"
        //! [`crate::a::A`]
        use std::fs;
        pub(super) use super::b::{c::C, d};
        /// crate::e::E
        fn f<'a>(x: &'a str) -> crate::f::F { let _ = ("crate::g", r#"crate::"h""#, '"', 'x'); m::k(x) }
        mod inner { use super::i; use super::super::b::J; }
        /* crate::l */
        #[cfg(feature = "window")]
        use self::n::N;
        #[cfg(test)]
        mod tests { use crate::p; fn f() { {} } }
        #[cfg(not(test))]
        mod real { use crate::q; }
        use crate::{Error, eprintln};
    "##;
    let mut sources =
        made_up(&[("src/own/mod.rs", text), ("src/lib.rs", "mod error; pub use error::{Error, Result};")]);
    for name in ["a", "b", "b/c", "b/d", "e", "f", "g", "i", "l", "p", "q", "error"] {
        sources.insert(format!("src/{name}.rs"), String::new());
    }
    for name in ["i", "k", "m", "n"] {
        sources.insert(format!("src/own/{name}.rs"), String::new());
    }
    let arrows = arrows(&sources);
    let found: Vec<&str> = arrows.iter().filter(|(from, _)| from == "src/own/mod.rs").map(|(_, to)| &to[4..]).collect();
    let wanted = ["b/c.rs", "b/d.rs", "b.rs", "error.rs", "f.rs", "own/i.rs", "own/m.rs", "own/n.rs", "q.rs"];
    assert_eq!(BTreeSet::from_iter(found), BTreeSet::from(wanted));
}
