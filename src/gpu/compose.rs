//! The text composer of the shaders: `#import`, `#ifdef`, `#ifndef`, `#else`, `#endif`, `#for`, `#end`.
//!
//! A file is included once, where it is first imported. `#for law ... #end` repeats its lines for every elastic law whose key is
//! among the defines, in the order of [`LAWS`]: `$law` is its key, `$number` its place; `#for invariant law` and `#for stretch law`
//! are those of one [`Form`]. So the dispatch stands in WGSL, once for all laws. Unknown files, names and stray directives are
//! errors. Compiler messages are mapped back to file and line.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{PoisonError, RwLock};

use crate::error::{Error, Result};
use crate::material::law::Form;
use crate::material::{LAWS, Law};
use crate::reading;

/// Every shader file by its path under `shaders/`, without extension.
pub const SOURCES: &[(&str, &str)] = &[
    ("effects/adhesion", include_str!("../../shaders/effects/adhesion.wgsl")),
    ("effects/cohesive", include_str!("../../shaders/effects/cohesive.wgsl")),
    ("effects/damage", include_str!("../../shaders/effects/damage.wgsl")),
    ("effects/fibres", include_str!("../../shaders/effects/fibres.wgsl")),
    ("effects/flexible_needle", include_str!("../../shaders/effects/flexible_needle.wgsl")),
    ("effects/free_path", include_str!("../../shaders/effects/free_path.wgsl")),
    ("effects/friction", include_str!("../../shaders/effects/friction.wgsl")),
    ("effects/gravity", include_str!("../../shaders/effects/gravity.wgsl")),
    ("effects/indentation", include_str!("../../shaders/effects/indentation.wgsl")),
    ("effects/mass_scaling", include_str!("../../shaders/effects/mass_scaling.wgsl")),
    ("effects/plasticity", include_str!("../../shaders/effects/plasticity.wgsl")),
    ("effects/puncture", include_str!("../../shaders/effects/puncture.wgsl")),
    ("effects/viscoelastic", include_str!("../../shaders/effects/viscoelastic.wgsl")),
    ("materials/demiray", include_str!("../../shaders/materials/demiray.wgsl")),
    ("materials/mooney_rivlin", include_str!("../../shaders/materials/mooney_rivlin.wgsl")),
    ("materials/neo_hookean", include_str!("../../shaders/materials/neo_hookean.wgsl")),
    ("materials/ogden", include_str!("../../shaders/materials/ogden.wgsl")),
    ("materials/yeoh", include_str!("../../shaders/materials/yeoh.wgsl")),
    ("shared/averaged_dilatation", include_str!("../../shaders/shared/averaged_dilatation.wgsl")),
    ("shared/bent_column", include_str!("../../shaders/shared/bent_column.wgsl")),
    ("shared/capped_exponential", include_str!("../../shaders/shared/capped_exponential.wgsl")),
    ("shared/cell_edge", include_str!("../../shaders/shared/cell_edge.wgsl")),
    ("shared/cell_energy", include_str!("../../shaders/shared/cell_energy.wgsl")),
    ("shared/cell_sums", include_str!("../../shaders/shared/cell_sums.wgsl")),
    ("shared/contact_node", include_str!("../../shaders/shared/contact_node.wgsl")),
    ("shared/corner_force", include_str!("../../shaders/shared/corner_force.wgsl")),
    ("shared/displacement", include_str!("../../shaders/shared/displacement.wgsl")),
    ("shared/drawn_cell", include_str!("../../shaders/shared/drawn_cell.wgsl")),
    ("shared/drawn_hexahedron", include_str!("../../shaders/shared/drawn_hexahedron.wgsl")),
    ("shared/drawn_tetrahedron", include_str!("../../shaders/shared/drawn_tetrahedron.wgsl")),
    ("shared/driven_faces", include_str!("../../shaders/shared/driven_faces.wgsl")),
    ("shared/elastic", include_str!("../../shaders/shared/elastic.wgsl")),
    ("shared/gathered_force", include_str!("../../shaders/shared/gathered_force.wgsl")),
    ("shared/grid_lines", include_str!("../../shaders/shared/grid_lines.wgsl")),
    ("shared/hexahedron_energy", include_str!("../../shaders/shared/hexahedron_energy.wgsl")),
    ("shared/kinematics", include_str!("../../shaders/shared/kinematics.wgsl")),
    ("shared/material_point", include_str!("../../shaders/shared/material_point.wgsl")),
    ("shared/measured_hexahedron", include_str!("../../shaders/shared/measured_hexahedron.wgsl")),
    ("shared/measured_tetrahedron", include_str!("../../shaders/shared/measured_tetrahedron.wgsl")),
    ("shared/mesh_numbers", include_str!("../../shaders/shared/mesh_numbers.wgsl")),
    ("shared/mesh_node", include_str!("../../shaders/shared/mesh_node.wgsl")),
    ("shared/node_load", include_str!("../../shaders/shared/node_load.wgsl")),
    ("shared/node_place", include_str!("../../shaders/shared/node_place.wgsl")),
    ("shared/node_sums", include_str!("../../shaders/shared/node_sums.wgsl")),
    ("shared/face_points", include_str!("../../shaders/shared/face_points.wgsl")),
    ("shared/node_cures", include_str!("../../shaders/shared/node_cures.wgsl")),
    ("shared/node_work", include_str!("../../shaders/shared/node_work.wgsl")),
    ("shared/params", include_str!("../../shaders/shared/params.wgsl")),
    ("shared/point_energy", include_str!("../../shaders/shared/point_energy.wgsl")),
    ("shared/point_history", include_str!("../../shaders/shared/point_history.wgsl")),
    ("shared/point_stress", include_str!("../../shaders/shared/point_stress.wgsl")),
    ("shared/step_input", include_str!("../../shaders/shared/step_input.wgsl")),
    ("shared/straight_column", include_str!("../../shaders/shared/straight_column.wgsl")),
    ("shared/symmetric_eigen", include_str!("../../shaders/shared/symmetric_eigen.wgsl")),
    ("shared/tetrahedron", include_str!("../../shaders/shared/tetrahedron.wgsl")),
    ("shared/slit_contact", include_str!("../../shaders/shared/slit_contact.wgsl")),
    ("shared/tied_nodes", include_str!("../../shaders/shared/tied_nodes.wgsl")),
    ("shared/thread_index", include_str!("../../shaders/shared/thread_index.wgsl")),
    ("shared/tip_read", include_str!("../../shaders/shared/tip_read.wgsl")),
    ("shared/tip_written", include_str!("../../shaders/shared/tip_written.wgsl")),
    ("stages/advance_free_tip", include_str!("../../shaders/stages/advance_free_tip.wgsl")),
    ("stages/advance_tip", include_str!("../../shaders/stages/advance_tip.wgsl")),
    ("stages/average_pressure", include_str!("../../shaders/stages/average_pressure.wgsl")),
    ("stages/cell_fields", include_str!("../../shaders/stages/cell_fields.wgsl")),
    ("stages/cohesive_forces", include_str!("../../shaders/stages/cohesive_forces.wgsl")),
    ("stages/element_forces", include_str!("../../shaders/stages/element_forces.wgsl")),
    ("stages/indenter_contact", include_str!("../../shaders/stages/indenter_contact.wgsl")),
    ("stages/integrate_nodes", include_str!("../../shaders/stages/integrate_nodes.wgsl")),
    ("stages/measure_cells", include_str!("../../shaders/stages/measure_cells.wgsl")),
    ("stages/measure_contact", include_str!("../../shaders/stages/measure_contact.wgsl")),
    ("stages/measure_dilatation", include_str!("../../shaders/stages/measure_dilatation.wgsl")),
    ("stages/measure_faces", include_str!("../../shaders/stages/measure_faces.wgsl")),
    ("stages/measure_nodes", include_str!("../../shaders/stages/measure_nodes.wgsl")),
    ("stages/measure_separation", include_str!("../../shaders/stages/measure_separation.wgsl")),
    ("stages/needle_contact", include_str!("../../shaders/stages/needle_contact.wgsl")),
    ("stages/node_fields", include_str!("../../shaders/stages/node_fields.wgsl")),
    ("stages/soften_free_path", include_str!("../../shaders/stages/soften_free_path.wgsl")),
    ("stages/soften_path", include_str!("../../shaders/stages/soften_path.wgsl")),
    ("stages/tetrahedron_forces", include_str!("../../shaders/stages/tetrahedron_forces.wgsl")),
];

/// Names that `#ifdef` may test beside those of the effects: features of the scene that are no effects.
pub const SCENE_DEFINES: [&str; 15] = [
    "TIED",
    "INNER_BOUND",
    "SLIT",
    "BORE",
    "FREE_PATH",
    "STEP_INPUT",
    "LOADED_FACES",
    "DRIVEN_FACES",
    "NODE_WORK",
    "REGIONS",
    "TETRAHEDRA",
    "HISTORY",
    "VARYING_STIFFNESS",
    "INVARIANT_LAWS",
    "SEVERAL_LAWS",
];

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
            Some((file, line)) => format!("shaders/{file}.wgsl:{line}"),
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
pub fn compose(root: &str, defines: &BTreeSet<&'static str>) -> Result<Composed> {
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
pub fn compose_without_effects(root: &str, defines: &BTreeSet<&'static str>) -> Result<Composed> {
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
fn repeated<'a>(
    text: &'a str,
    defines: &BTreeSet<&'static str>,
) -> std::result::Result<NumberedLines<'a>, (usize, String)> {
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
            other => return Err((number, format!("unknown list `{other}` in #for"))),
        };
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
        for (place, law) in LAWS.iter().enumerate().filter(|(_, law)| wanted(law)) {
            let filled = |line: &str| line.replace("$law", law.key).replace("$number", &format!("{place}u"));
            out.extend(body.iter().map(|(number, line)| (*number, filled(line).into())));
        }
    }
    Ok(out)
}

fn compose_from(files: &[(&'static str, &str)], root: &str, defines: &BTreeSet<&'static str>) -> Result<Composed> {
    let mut out = Composed { source: String::new(), origin: Vec::new() };
    let mut included = BTreeSet::new();
    include(files, root, root, 0, defines, &mut included, &mut out)?;
    Ok(out)
}

fn include(
    files: &[(&'static str, &str)],
    name: &str,
    from: &str,
    from_line: usize,
    defines: &BTreeSet<&'static str>,
    included: &mut BTreeSet<&'static str>,
    out: &mut Composed,
) -> Result<()> {
    let fail = |file: &str, line: usize, message: String| {
        Err(Error::Shader { stage: format!("shaders/{file}.wgsl:{line}"), message })
    };
    let Some(&(file, text)) = files.iter().find(|(n, _)| *n == name) else {
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
        ("a", "#import b\n#import b\nlet a = 1;\n#ifdef PUNCTURE\nlet p = 1;\n#else\nlet q = 1;\n#endif\n"),
        ("b", "let b = 1;\n"),
        ("stray", "#endif\n"),
        ("open", "#ifdef PUNCTURE\n"),
        ("name", "#ifdef PUNCTUER\n#endif\n"),
        ("word", "#include b\n"),
        ("missing", "\n#import nowhere\n"),
        ("laws", "#for law\nlet $law = $number;\n#end\n#for stretch law\n#import b\n#end\n"),
        ("list", "#for effect\n#end\n"),
        ("endless", "\n#for law\n"),
        ("end", "#end\n"),
    ];

    #[test]
    fn imports_once_and_maps_lines() {
        let composed = compose_from(FILES, "a", &BTreeSet::new()).unwrap();
        assert_eq!(composed.source, "let b = 1;\nlet a = 1;\nlet q = 1;\n");
        assert_eq!(composed.place(1), "shaders/b.wgsl:1");
        assert_eq!(composed.place(3), "shaders/a.wgsl:7");
        let composed = compose_from(FILES, "a", &BTreeSet::from(["PUNCTURE"])).unwrap();
        assert!(composed.source.contains("let p") && !composed.source.contains("let q"));
    }

    #[test]
    fn lines_are_repeated_for_the_laws_of_the_scene() {
        let composed = compose_from(FILES, "laws", &BTreeSet::from(["yeoh", "mooney_rivlin"])).unwrap();
        assert_eq!(composed.source, "let mooney_rivlin = 1u;\nlet yeoh = 2u;\n");
        assert_eq!([composed.place(1), composed.place(2)], ["shaders/laws.wgsl:2", "shaders/laws.wgsl:2"]);
        let composed = compose_from(FILES, "laws", &BTreeSet::from(["ogden"])).unwrap();
        assert_eq!(composed.source, "let ogden = 3u;\nlet b = 1;\n");
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
        ] {
            let error = compose_from(FILES, root, &BTreeSet::new()).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
