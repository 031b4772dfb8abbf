//! The text composer of the shaders: `#import`, `#ifdef`, `#ifndef`, `#else`, `#endif`, `#for`, `#end`, `#const`,
//! `#params`.
//!
//! A file is included once, where it is first imported. `#for law ... #end` repeats its lines for every elastic law whose key is
//! among the defines, in the order of [`LAWS`]: `$law` is its key, `$number` its place; `#for invariant law` and `#for stretch law`
//! are those of one [`Form`]. So the dispatch stands in WGSL, once for all laws. `#for own ... #end` does the same for the effects that
//! a program brings along ([`OwnEffect`]): `$own` is the key, `$count` how many there are, and `own/<key>` the file that the effect
//! holds. `#const NAME` declares a number of [`CONSTANTS`], which the laws in f64 have too. Unknown files, names and stray
//! directives are errors. Compiler messages are mapped back to file and line.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{PoisonError, RwLock};

use crate::effects;
use crate::effects::own::OwnEffect;
use crate::effects::parameters::ShaderNumbers;
use crate::engine::WATCHED_STEP_RATIO;
use crate::error::{Error, Result};
use crate::material::law::Form;
use crate::material::{LAWS, Law};
use crate::{needle, reading};

// Every shader file by its path under `shaders/`, without extension: `SOURCES: &[(&str, &str)]`, written by build.rs.
include!(concat!(env!("OUT_DIR"), "/shader_sources.rs"));

/// Numbers that stand in the Rust sources alone, by the files that own them: `#const NAME` is `const NAME: f32 = value;`.
pub const CONSTANTS: [&[(&str, f64)]; 4] = [
    &effects::puncture::SHADER_CONSTANTS,
    &needle::free_path::SHADER_CONSTANTS,
    &effects::mass_scaling::SHADER_CONSTANTS,
    &[("WATCHED_STEP_RATIO", WATCHED_STEP_RATIO)],
];

/// Structs of the numbers of effects whose table stands in Rust alone: `#params NAME` writes the struct, with what is missing to 16
/// bytes.
pub const PARAMS: [(&str, &[&str]); 3] = [
    ("PlasticityParams", effects::plasticity::Params::NAMES),
    ("AdhesionParams", effects::adhesion::Params::NAMES),
    ("FrictionParams", effects::friction::Params::NAMES),
];

/// Names that `#ifdef` may test beside those of the effects: features of the scene that are no effects.
pub const SCENE_DEFINES: [&str; 22] = [
    "WIDE",
    "TIED",
    "INNER_BOUND",
    "SLIT",
    "BORE",
    "FREE_PATH",
    "LAID",
    "TURNS",
    "OPENING",
    "STEP_INPUT",
    "LOADED_FACES",
    "DRIVEN_FACES",
    "NODE_WORK",
    "REGIONS",
    "EMPTY_CELLS",
    "TETRAHEDRA",
    "HISTORY",
    "VARYING_STIFFNESS",
    "EARLY_FLATNESS",
    "INVARIANT_LAWS",
    "SEVERAL_LAWS",
    "OWN",
];

/// What decides which lines a composed shader has.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Defines {
    /// Names that `#ifdef` finds, and keys of laws.
    pub names: BTreeSet<&'static str>,
    /// Effects that the program brings along.
    pub own: Vec<&'static OwnEffect>,
}

impl<const N: usize> From<[&'static str; N]> for Defines {
    fn from(names: [&'static str; N]) -> Self {
        Defines { names: BTreeSet::from(names), own: Vec::new() }
    }
}

impl Defines {
    pub fn contains(&self, name: &str) -> bool {
        self.names.contains(name)
    }

    /// The file `name`: its name in messages, and its text.
    fn file<'a>(&self, files: &[(&'static str, &'a str)], name: &str) -> Option<(&'static str, &'a str)> {
        match name.strip_prefix("own/") {
            None => files.iter().find(|(other, _)| *other == name).copied(),
            Some(key) => self.own.iter().find(|own| own.effect.key == key).map(|own| (own.effect.key, own.shader)),
        }
    }
}

/// A composed shader.
#[derive(Debug, Clone)]
pub struct Composed {
    pub source: String,
    /// File and line (from 1) of every line of `source`.
    pub origin: Vec<(&'static str, usize)>,
}

impl Composed {
    /// `shaders/<file>.wgsl:<line>` of a line (from 1) of the composed source.
    pub fn place(&self, line: usize) -> String {
        match self.origin.get(line.wrapping_sub(1)) {
            Some((file, line)) if file.contains('/') => format!("shaders/{file}.wgsl:{line}"),
            Some((key, line)) => format!("WGSL of the effect {key}:{line}"),
            None => "end of the composed shader".into(),
        }
    }
}

/// Sources that stand in for the built-in ones, for somebody who works on them.
static EDITED: RwLock<Vec<(&'static str, String)>> = RwLock::new(Vec::new());

/// Takes the sources from a folder like `shaders/` from now on; a file that it lacks stays the built-in one.
///
/// # Errors
/// `Error::Input` for a folder that holds none of them.
pub fn read_sources(folder: &Path) -> Result<()> {
    let read = |name: &'static str| {
        Some((name, reading::text(&folder.join(name).with_extension("wgsl"), reading::most::SCENE).ok()?))
    };
    let found: Vec<(&'static str, String)> = SOURCES.iter().filter_map(|(name, _)| read(name)).collect();
    if found.is_empty() {
        return Err(Error::input(
            format!("{}: there is no shader of this program in it", folder.display()),
            "give the folder shaders/ of the sources, which holds stages/element_forces.wgsl",
        ));
    }
    *EDITED.write().unwrap_or_else(PoisonError::into_inner) = found;
    Ok(())
}

/// Composes the file `root` (path under `shaders/`, no extension) with the given defines.
pub fn compose(root: &str, defines: &Defines) -> Result<Composed> {
    let edited = EDITED.read().unwrap_or_else(PoisonError::into_inner);
    if edited.is_empty() {
        return compose_from(SOURCES, root, defines);
    }
    let text = |(name, text): &(&'static str, &'static str)| {
        let own = edited.iter().find(|(other, _)| other == name);
        (*name, own.map_or(*text, |(_, own)| own.as_str()).to_string())
    };
    let files: Vec<(&'static str, String)> = SOURCES.iter().map(text).collect();
    let files: Vec<(&'static str, &str)> = files.iter().map(|(name, text)| (*name, text.as_str())).collect();
    compose_from(&files, root, defines)
}

/// The same from sources in which no effect was ever written: their files and their `#ifdef` blocks are taken out
/// first. What a run without effects must be equal to.
pub fn compose_without_effects(root: &str, defines: &Defines) -> Result<Composed> {
    let stripped: Vec<(&'static str, String)> = SOURCES
        .iter()
        .filter(|(name, _)| !name.starts_with("effects/"))
        .map(|(name, text)| (*name, without_effect_blocks(text)))
        .collect();
    let files: Vec<(&'static str, &str)> = stripped.iter().map(|(name, text)| (*name, text.as_str())).collect();
    compose_from(&files, root, defines)
}

/// A source without the blocks of effects; the other branch of such a block stays.
fn without_effect_blocks(text: &str) -> String {
    // Per open block: is it one of an effect, and is its present branch kept?
    let mut open: Vec<(bool, bool)> = Vec::new();
    let mut out = String::new();
    for line in text.lines() {
        let kept = open.iter().all(|(effect, keep)| !effect || *keep);
        let word = line.trim();
        let is_effect =
            |name: &str| crate::effects::EFFECTS.iter().any(|e| e.define == name.trim()) || name == "HISTORY";
        if let Some(name) = word.strip_prefix("#ifdef ") {
            open.push((is_effect(name), false));
        } else if let Some(name) = word.strip_prefix("#ifndef ") {
            open.push((is_effect(name), true));
        } else if word == "#else"
            && let Some((true, keep)) = open.last_mut()
        {
            *keep = !*keep;
            continue;
        } else if word == "#endif"
            && let Some((true, _)) = open.last()
        {
            open.pop();
            continue;
        } else if word == "#endif" {
            open.pop();
        }
        let directive_of_effect = word.starts_with("#if") && open.last().is_some_and(|o| o.0);
        if kept && !directive_of_effect {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}

/// Lines of a text with their numbers.
type NumberedLines<'a> = Vec<(usize, Cow<'a, str>)>;

/// The lines of a text with their numbers (from 1), those between `#for` and `#end` once per law that is meant; or what is wrong in
/// which line.
fn repeated<'a>(text: &'a str, defines: &Defines) -> std::result::Result<NumberedLines<'a>, (usize, String)> {
    let mut out = Vec::new();
    let mut lines = text.lines().enumerate().map(|(n, line)| (n + 1, line));
    while let Some((number, line)) = lines.next() {
        let Some(meant) = line.trim().strip_prefix("#for ") else {
            out.push((number, line.into()));
            continue;
        };
        let form = match meant.trim() {
            "law" => None,
            "invariant law" => Some(Form::Invariants),
            "stretch law" => Some(Form::Stretches),
            "own" => None,
            other => return Err((number, format!("unknown list `{other}` in #for"))),
        };
        let of_effects = meant.trim() == "own";
        let mut ended = false;
        let mut body = Vec::new();
        for (number, line) in lines.by_ref() {
            ended = line.trim() == "#end";
            if ended {
                break;
            }
            body.push((number, line));
        }
        if !ended {
            return Err((number, "#for without #end".into()));
        }
        let wanted = |law: &Law| defines.contains(law.key) && form.is_none_or(|form| form == law.form);
        let laws = LAWS.iter().enumerate().filter(|(_, law)| !of_effects && wanted(law)).map(|(n, law)| (n, law.key));
        let own = defines.own.iter().enumerate().filter(|_| of_effects).map(|(n, own)| (n, own.effect.key));
        for (place, key) in laws.chain(own) {
            let count = defines.own.len();
            let filled = |line: &str| {
                let line = line.replace("$law", key).replace("$own", key).replace("_$number", &format!("_{place}"));
                line.replace("$number", &format!("{place}u")).replace("$count", &format!("{count}u"))
            };
            out.extend(body.iter().map(|(number, line)| (*number, filled(line).into())));
        }
    }
    Ok(out)
}

fn compose_from(files: &[(&'static str, &str)], root: &str, defines: &Defines) -> Result<Composed> {
    let mut out = Composed { source: String::new(), origin: Vec::new() };
    let mut included = BTreeSet::new();
    include(files, root, root, 0, defines, &mut included, &mut out)?;
    Ok(out)
}

/// What `#const` and `#params` stand for.
fn generated(word: &str, name: &str) -> std::result::Result<String, String> {
    if word == "const" {
        let found = CONSTANTS.iter().copied().flatten().find(|(other, _)| *other == name);
        // All digits of the f64: the compiler of WGSL rounds it as it would a number that stands there.
        let text = found.map(|(name, value)| format!("const {name}: f32 = {value:?};\n"));
        return text.ok_or_else(|| format!("unknown number `{name}` in #const"));
    }
    let found = PARAMS.iter().find(|(other, _)| *other == name);
    let (name, fields) = found.ok_or_else(|| format!("unknown struct `{name}` in #params"))?;
    let missing = (0..fields.len().next_multiple_of(4) - fields.len()).map(|n| format!("_pad{n}"));
    let lines = fields.iter().map(|f| f.to_string()).chain(missing).map(|field| format!("    {field}: f32,\n"));
    Ok(format!("struct {name} {{\n{}}}\n", lines.collect::<String>()))
}

fn include(
    files: &[(&'static str, &str)],
    name: &str,
    from: &str,
    from_line: usize,
    defines: &Defines,
    included: &mut BTreeSet<&'static str>,
    out: &mut Composed,
) -> Result<()> {
    let fail = |file: &str, line: usize, message: String| {
        Err(Error::Shader { stage: format!("shaders/{file}.wgsl:{line}"), message })
    };
    let Some((file, text)) = defines.file(files, name) else {
        let known: Vec<&str> = files.iter().map(|(n, _)| *n).collect();
        return fail(from, from_line, format!("unknown import `{name}`; there are {}", known.join(", ")));
    };
    if !included.insert(file) {
        return Ok(());
    }
    // One entry per open #ifdef: (active, seen #else, line).
    let mut open: Vec<(bool, bool, usize)> = Vec::new();
    let lines = match repeated(text, defines) {
        Ok(lines) => lines,
        Err((line, message)) => return fail(file, line, message),
    };
    for (number, line) in &lines {
        let (number, line) = (*number, &**line);
        let active = open.iter().all(|o| o.0);
        let Some(directive) = line.trim_start().strip_prefix('#') else {
            if active {
                out.source.push_str(line);
                out.source.push('\n');
                out.origin.push((file, number));
            }
            continue;
        };
        let (word, argument) = directive.split_once(' ').unwrap_or((directive, ""));
        let argument = argument.trim();
        match word.trim() {
            "import" if active => include(files, argument, file, number, defines, included, out)?,
            "import" => {}
            "ifdef" | "ifndef" => {
                let known =
                    SCENE_DEFINES.contains(&argument) || crate::effects::EFFECTS.iter().any(|e| e.define == argument);
                if !known {
                    return fail(file, number, format!("unknown name `{argument}` in #{word}"));
                }
                open.push((defines.contains(argument) == (word == "ifdef"), false, number));
            }
            "else" => match open.last_mut() {
                Some(o) if !o.1 => *o = (!o.0, true, o.2),
                _ => return fail(file, number, "stray #else".into()),
            },
            "endif" => {
                if open.pop().is_none() {
                    return fail(file, number, "stray #endif".into());
                }
            }
            "const" | "params" if active => match generated(word, argument) {
                Ok(text) => {
                    out.source.push_str(&text);
                    out.origin.extend(text.lines().map(|_| (file, number)));
                }
                Err(message) => return fail(file, number, message),
            },
            "const" | "params" => {}
            other => return fail(file, number, format!("unknown directive #{other}")),
        }
    }
    match open.pop() {
        Some((_, _, line)) => fail(file, line, "#ifdef without #endif".into()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILES: &[(&str, &str)] = &[
        ("x/a", "#import x/b\n#import x/b\nlet a = 1;\n#ifdef PUNCTURE\nlet p = 1;\n#else\nlet q = 1;\n#endif\n"),
        ("x/b", "let b = 1;\n"),
        ("stray", "#endif\n"),
        ("open", "#ifdef PUNCTURE\n"),
        ("name", "#ifdef PUNCTUER\n#endif\n"),
        ("word", "#include b\n"),
        ("missing", "\n#import nowhere\n"),
        ("x/laws", "#for law\nlet $law = $number;\n#end\n#for stretch law\n#import x/b\n#end\n"),
        ("list", "#for effect\n#end\n"),
        ("endless", "\n#for law\n"),
        ("end", "#end\n"),
        ("x/constant", "#const SLACK\n#ifdef PUNCTURE\n#const TURNING\n#endif\n"),
        ("number", "#const SLAK\n"),
        ("struct", "#params FictionParams\n"),
    ];

    #[test]
    fn imports_once_and_maps_lines() {
        let composed = compose_from(FILES, "x/a", &Defines::default()).unwrap();
        assert_eq!(composed.source, "let b = 1;\nlet a = 1;\nlet q = 1;\n");
        assert_eq!(composed.place(1), "shaders/x/b.wgsl:1");
        assert_eq!(composed.place(3), "shaders/x/a.wgsl:7");
        let composed = compose_from(FILES, "x/a", &Defines::from(["PUNCTURE"])).unwrap();
        assert!(composed.source.contains("let p") && !composed.source.contains("let q"));
    }

    #[test]
    fn lines_are_repeated_for_the_laws_of_the_scene() {
        let composed = compose_from(FILES, "x/laws", &Defines::from(["yeoh", "mooney_rivlin"])).unwrap();
        assert_eq!(composed.source, "let mooney_rivlin = 1u;\nlet yeoh = 2u;\n");
        assert_eq!([composed.place(1), composed.place(2)], ["shaders/x/laws.wgsl:2", "shaders/x/laws.wgsl:2"]);
        let composed = compose_from(FILES, "x/laws", &Defines::from(["ogden"])).unwrap();
        assert_eq!(composed.source, "let ogden = 3u;\nlet b = 1;\n");
    }

    #[test]
    fn numbers_come_from_the_rust_sources() {
        let composed = compose_from(FILES, "x/constant", &Defines::default()).unwrap();
        assert_eq!(composed.source, "const SLACK: f32 = 0.0002;\n");
        assert_eq!(composed.place(1), "shaders/x/constant.wgsl:1");
        let names: Vec<&str> = CONSTANTS.iter().copied().flatten().map(|(name, _)| *name).collect();
        assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "one name, one number: {names:?}");
        for name in names {
            let asked = SOURCES.iter().any(|(_, text)| text.lines().any(|l| l.trim() == format!("#const {name}")));
            assert!(asked, "no shader asks for {name}");
        }
    }

    #[test]
    fn mistakes_name_file_and_line() {
        for (root, expected) in [
            ("stray", "stray #endif"),
            ("open", "#ifdef without #endif"),
            ("name", "unknown name `PUNCTUER`"),
            ("word", "unknown directive #include"),
            ("missing", "missing.wgsl:2: unknown import `nowhere`"),
            ("list", "list.wgsl:1: unknown list `effect` in #for"),
            ("endless", "endless.wgsl:2: #for without #end"),
            ("end", "unknown directive #end"),
            ("number", "unknown number `SLAK` in #const"),
            ("struct", "unknown struct `FictionParams` in #params"),
        ] {
            let error = compose_from(FILES, root, &Defines::default()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
