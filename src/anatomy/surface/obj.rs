//! Wavefront OBJ files: vertices and polygons; every object or group with polygons is a surface.
//!
//! Source: Wavefront, "Advanced Visualizer Manual", appendix B1 (1993). Materials, normals, texture, lines and points are stepped over.

use std::collections::HashMap;

use glam::DVec3;

use super::draft::{Draft, LONGEST_NAME};
use super::stl::{coordinate, too_many};
use crate::Result;
use crate::mesh::import::source::{Source, WRITE_AGAIN, excerpt};

/// Words that begin a line.
const KEYWORDS: [&[u8]; 16] = [
    b"v", b"vn", b"vt", b"vp", b"f", b"fo", b"o", b"g", b"s", b"l", b"p", b"mtllib", b"usemtl", b"usemap", b"maplib",
    b"mg",
];

/// Whether the first line that is no comment begins as one of this format.
pub(super) fn looks_like(text: &[u8]) -> bool {
    let mut lines = text.split(|b| *b == b'\n').map(|line| line.trim_ascii());
    let first = lines.find(|line| !line.is_empty() && !line.starts_with(b"#")).unwrap_or_default();
    let word = first.split(u8::is_ascii_whitespace).next().unwrap_or_default();
    KEYWORDS.contains(&word) && (word != b"v" || first.len() > 1)
}

/// Reads the bytes of a file.
pub(super) fn read(name: &str, bytes: &[u8]) -> Result<Draft> {
    let mut source = Source::new(name, bytes);
    source.refuse_zeros()?;
    let mut draft = Draft::default();
    let begin = source.at();
    // Faces may name vertices that stand below them: those first.
    while !source.rest().is_empty() {
        let (at, word) = first_word(&mut source);
        if word == b"v" {
            draft.next_point().ok_or_else(|| too_many(name))?;
            let mut point = [0.0; 3];
            for x in &mut point {
                let word = source.field("a coordinate")?;
                *x = coordinate(&source, word)?;
            }
            draft.points.push(DVec3::from_array(point));
        } else if word.starts_with(b"cs") || word == b"curv" || word == b"surf" {
            return Err(source.fail(
                at,
                format!("`{}`: free-form curves and surfaces are not read", excerpt(word)),
                "export the surface as polygons",
            ));
        }
        source.line();
    }
    source.seek(begin);
    let mut groups = Groups::default();
    let mut corners: Vec<u32> = Vec::new();
    let mut seen = 0;
    while !source.rest().is_empty() {
        let (_, word) = first_word(&mut source);
        match word {
            b"v" => seen += 1,
            b"o" | b"g" => {
                let title = source.line().unwrap_or_default().trim_ascii();
                let title = String::from_utf8_lossy(&title[..title.len().min(LONGEST_NAME)]).into_owned();
                groups.open(word == b"o", title);
                continue;
            }
            b"f" | b"fo" => {
                corners.clear();
                while let Some((at, word)) = field(&mut source) {
                    corners.push(corner(&source, at, word, seen, draft.points.len())?);
                }
                groups.select(&mut draft);
                let current = groups.current;
                add(&mut draft, current, &corners);
                continue;
            }
            _ => {}
        }
        source.line();
    }
    Ok(draft)
}

/// Adds a polygon to a part that need not be the last one.
fn add(draft: &mut Draft, part: usize, corners: &[u32]) {
    let last = draft.parts.len() - 1;
    draft.parts.swap(part, last);
    draft.add_polygon(corners);
    draft.parts.swap(part, last);
}

/// Objects and groups that were met.
#[derive(Default)]
struct Groups {
    object: String,
    group: String,
    /// Part by object and group.
    parts: HashMap<String, usize>,
    current: usize,
    /// Whether `current` is what `object` and `group` say.
    known: bool,
}

impl Groups {
    fn open(&mut self, object: bool, title: String) {
        if object {
            self.object = title;
            self.group.clear();
        } else {
            self.group = if title == "default" || title == "off" { String::new() } else { title };
        }
        self.known = false;
    }

    /// Makes `current` the part of a polygon that is met now.
    fn select(&mut self, draft: &mut Draft) {
        if self.known {
            return;
        }
        let name = match (self.object.is_empty(), self.group.is_empty()) {
            (false, false) => format!("{}/{}", self.object, self.group),
            (true, _) => self.group.clone(),
            (_, true) => self.object.clone(),
        };
        self.current = *self.parts.entry(name).or_insert_with_key(|name| {
            draft.parts.push((name.clone(), Vec::new()));
            draft.parts.len() - 1
        });
        self.known = true;
    }
}

/// The first word of the line that begins here; empty on an empty line.
fn first_word<'a>(source: &mut Source<'a>) -> (usize, &'a [u8]) {
    field(source).unwrap_or((source.at(), b""))
}

/// The next word of the line, which goes on behind a backslash at its end.
fn field<'a>(source: &mut Source<'a>) -> Option<(usize, &'a [u8])> {
    loop {
        let rest = source.rest();
        let blanks = rest.iter().position(|b| *b == b'\n' || !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let (at, rest) = (source.at() + blanks, &rest[blanks..]);
        source.seek(at);
        match rest {
            [b'\\', b'\n', ..] => source.seek(at + 2),
            [b'\\', b'\r', b'\n', ..] => source.seek(at + 3),
            [] | [b'\n', ..] => return None,
            [b'#', ..] => {
                source.seek(at + rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len()));
                return None;
            }
            _ => {
                let length = rest.iter().position(|b| b.is_ascii_whitespace() || *b == b'\\').unwrap_or(rest.len());
                // A backslash within a word is part of it.
                let length = if length == 0 { 1 } else { length };
                source.seek(at + length);
                return Some((at, &rest[..length]));
            }
        }
    }
}

/// Index of the vertex that `v`, `v/t`, `v//n` or `v/t/n` names; a negative one counts back from those `seen` so far.
fn corner(source: &Source, at: usize, word: &[u8], seen: usize, count: usize) -> Result<u32> {
    let number = word.split(|b| *b == b'/').next().unwrap_or_default();
    let index: i64 = source.parse((at, number), "a vertex of a face")?;
    let from_zero = if index > 0 { index.checked_sub(1) } else { index.checked_add(seen as i64).filter(|_| index < 0) };
    from_zero.and_then(|n| u32::try_from(n).ok()).filter(|n| (*n as usize) < count).ok_or_else(|| {
        source.fail(at, format!("a face names vertex {index}, but the file has {count} of them"), WRITE_AGAIN)
    })
}
