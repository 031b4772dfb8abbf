//! `*INCLUDE, INPUT=file` of Abaqus: the text of other files in the place of the line, so that the reader sees one text.
//!
//! Source: Abaqus Keywords Reference, *INCLUDE. A name leads to the folder of the first file or below it, never out of it.

use std::path::{Component, Path};

use super::source::{Piece, excerpt};
use crate::{Error, Result};

/// Most files that are included, and how deep they may lie in each other.
const MOST_FILES: usize = 64;
const MOST_DEPTH: usize = 8;

/// The bytes of a file in the folder of the first one, by its name there; `Err` tells why there are none.
pub(crate) type Beside<'a> = &'a dyn Fn(&Path) -> std::result::Result<Vec<u8>, String>;

/// The text with all included files in it, and where each piece of it comes from. A text without the keyword is given back as it is.
///
/// # Errors
/// Where a file cannot be read, leads out of the folder, includes itself, or there are too many; `most` bounds all bytes together.
pub(super) fn expanded(name: &str, bytes: &[u8], beside: Beside, most: u64) -> Result<(Vec<u8>, Vec<Piece>)> {
    let mut text = Text { bytes: Vec::new(), pieces: Vec::new(), files: 0, most, beside };
    text.add(name, bytes, &mut Vec::new())?;
    Ok((text.bytes, text.pieces))
}

struct Text<'a> {
    bytes: Vec<u8>,
    pieces: Vec<Piece>,
    /// Included so far.
    files: usize,
    most: u64,
    beside: Beside<'a>,
}

impl Text<'_> {
    /// Adds a file; `open` are the files that it is included from, by their names in messages.
    fn add(&mut self, name: &str, bytes: &[u8], open: &mut Vec<String>) -> Result<()> {
        open.push(name.to_string());
        self.piece(name, 1);
        for (number, line) in bytes.split_inclusive(|byte| *byte == b'\n').enumerate() {
            let Some(file) = included(line) else {
                self.push(name, line)?;
                continue;
            };
            let fail = |what: &str, way_out: &str| {
                Err(Error::input(
                    format!("{name}:{}: *INCLUDE, INPUT={}: {what}", number + 1, excerpt(file.as_bytes())),
                    way_out,
                ))
            };
            const IN_PLACE: &str = "put the text of that file in place of this line";
            let path = Path::new(&file);
            let is_below = !file.is_empty()
                && !file.contains(['\\', ':', '\0'])
                && path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
            if !is_below {
                return fail(
                    "it is not in the folder of the file",
                    "put it into that folder, and name it without `..`",
                );
            }
            if open.len() > MOST_DEPTH {
                return fail(&format!("files lie in each other more than {MOST_DEPTH} deep"), IN_PLACE);
            }
            self.files += 1;
            if self.files > MOST_FILES {
                return fail(&format!("more than {MOST_FILES} files are included"), IN_PLACE);
            }
            let full = Path::new(&open[0]).with_file_name(path).display().to_string();
            if open.contains(&full) {
                return fail("the file includes itself", "remove this line");
            }
            match (self.beside)(path) {
                Ok(bytes) => self.add(&full, &bytes, open)?,
                Err(why) => return fail(&format!("cannot be read: {why}"), "write the name of a file beside this one"),
            }
            self.push(name, b"\n")?;
            self.piece(name, number + 2);
        }
        open.pop();
        Ok(())
    }

    fn piece(&mut self, name: &str, line: usize) {
        self.pieces.push(Piece { start: self.bytes.len(), name: name.into(), line });
    }

    fn push(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        if self.bytes.len() as u64 + bytes.len() as u64 > self.most {
            return Err(Error::input(
                format!("{name}: with the files that it includes it has more than {} bytes", self.most),
                "write a coarser mesh, and no more of it than the needle meets",
            ));
        }
        self.bytes.extend_from_slice(bytes);
        Ok(())
    }
}

/// The file that a line includes; `None` for any other line.
fn included(line: &[u8]) -> Option<String> {
    const KEYWORD: &[u8] = b"*INCLUDE";
    let line = line.trim_ascii();
    let rest = line.split_at_checked(KEYWORD.len()).filter(|(word, _)| word.eq_ignore_ascii_case(KEYWORD))?.1;
    let text = String::from_utf8_lossy(rest).into_owned();
    let parameter = text.trim_start().strip_prefix(',')?.split_once('=')?;
    parameter.0.trim().eq_ignore_ascii_case("INPUT").then(|| parameter.1.trim().trim_matches('"').trim().to_string())
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    fn expand(files: &[(&str, &str)]) -> Result<(String, Vec<Piece>)> {
        let all: BTreeMap<&str, &str> = files.iter().copied().collect();
        let beside = |path: &Path| {
            let found = path.to_str().and_then(|name| all.get(name));
            found.map(|text| text.as_bytes().to_vec()).ok_or_else(|| "not there".to_string())
        };
        let (bytes, pieces) = expanded("main.inp", files[0].1.as_bytes(), &beside, 10_000)?;
        Ok((String::from_utf8(bytes).unwrap(), pieces))
    }

    #[test]
    fn files_stand_in_the_place_of_their_lines() {
        let (text, pieces) = expand(&[
            ("main.inp", "*NODE\n*Include, input=a.inp\n*END\n"),
            ("a.inp", "1, 2\n*INCLUDE,INPUT=\"b/c.inp\"\n"),
            ("b/c.inp", "3"),
        ])
        .unwrap();
        assert_eq!(text, "*NODE\n1, 2\n3\n\n*END\n");
        let at: Vec<(&str, usize, usize)> = pieces.iter().map(|p| (&*p.name, p.start, p.line)).collect();
        assert_eq!(
            at,
            [("main.inp", 0, 1), ("a.inp", 6, 1), ("b/c.inp", 11, 1), ("a.inp", 13, 3), ("main.inp", 14, 3)]
        );
        assert_eq!(expand(&[("main.inp", "*NODE\n** *INCLUDE, INPUT=x\n")]).unwrap().1.len(), 1);
    }

    #[test]
    fn what_is_outside_endless_or_missing_is_refused() {
        for (line, part) in [
            ("../a.inp", "not in the folder"),
            ("/etc/passwd", "not in the folder"),
            ("b/../../a.inp", "not in the folder"),
            ("c:a.inp", "not in the folder"),
            ("", "not in the folder"),
            ("none.inp", "main.inp:2: *INCLUDE, INPUT=none.inp: cannot be read: not there"),
            ("main.inp", "includes itself"),
        ] {
            let text = format!("*NODE\n*INCLUDE, INPUT={line}\n");
            let message = expand(&[("main.inp", &text)]).unwrap_err().to_string();
            assert!(message.contains(part) && message.contains("way out"), "{line}: {message}");
        }
        let circle =
            expand(&[("main.inp", "*INCLUDE, INPUT=a"), ("a", "*INCLUDE, INPUT=b"), ("b", "*INCLUDE, INPUT=a")]);
        assert!(circle.unwrap_err().to_string().contains("b:1: *INCLUDE, INPUT=a: the file includes itself"));
        let twice = "*INCLUDE, INPUT=a\n".repeat(65);
        assert!(expand(&[("main.inp", &twice), ("a", "x")]).unwrap_err().to_string().contains("more than 64 files"));
        let long = "x".repeat(6000);
        let twice = "*INCLUDE, INPUT=a\n".repeat(2);
        assert!(
            expand(&[("main.inp", &twice), ("a", &long)]).unwrap_err().to_string().contains("more than 10000 bytes")
        );
    }
}
