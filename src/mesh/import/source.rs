//! A cursor over the bytes of a mesh file that knows where it stands: the line of a text, the byte of a binary file.

use std::fmt::Display;
use std::str::FromStr;
use std::sync::Arc;

use crate::{Error, Result};

/// Way out of a file that breaks its own format.
pub(crate) const WRITE_AGAIN: &str =
    "write the file again with the program that made it; it was cut short, damaged or edited by hand";

/// Where a piece of a text that was put together of several files comes from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Piece {
    /// Its first byte in the text.
    pub start: usize,
    /// The file in messages.
    pub name: String,
    /// Line of that file that begins there.
    pub line: usize,
}

/// Bytes of one file and a position in them.
#[derive(Debug, Clone)]
pub(crate) struct Source<'a> {
    name: String,
    /// Where the text comes from; empty: all of it from the file of this name.
    pieces: Arc<Vec<Piece>>,
    bytes: &'a [u8],
    at: usize,
    /// Whether messages name bytes instead of lines.
    pub binary: bool,
}

/// Numbers that stand in a file as text.
pub(crate) trait Number: FromStr {
    const KIND: &'static str;
}

impl Number for f64 {
    const KIND: &'static str = "a number";
}
impl Number for i64 {
    const KIND: &'static str = "a whole number";
}
impl Number for u64 {
    const KIND: &'static str = "a whole number without sign";
}

impl<'a> Source<'a> {
    pub fn new(name: &str, bytes: &'a [u8]) -> Self {
        let at = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
        Source { name: name.to_string(), pieces: Arc::default(), bytes, at, binary: false }
    }

    /// A text of several files; messages name theirs.
    pub fn of_pieces(name: &str, bytes: &'a [u8], pieces: Vec<Piece>) -> Self {
        Source { pieces: Arc::new(pieces), ..Source::new(name, bytes) }
    }

    pub fn at(&self) -> usize {
        self.at
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes from the cursor to the end.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    pub fn seek(&mut self, at: usize) {
        self.at = at.min(self.bytes.len());
    }

    /// A wrong input at a place: `file:line: ...`, or `file: byte n: ...` in a binary file.
    pub fn fail(&self, at: usize, message: impl Display, way_out: &str) -> Error {
        if self.binary {
            return Error::input(format!("{}: byte {at}: {message}", self.name), way_out);
        }
        let at = at.min(self.bytes.len());
        let piece = self.pieces.iter().rfind(|piece| piece.start <= at);
        let (name, start, first) = piece.map_or((&self.name, 0, 1), |piece| (&piece.name, piece.start, piece.line));
        let line = first + self.bytes[start..at].iter().filter(|b| **b == b'\n').count();
        Error::input(format!("{name}:{line}: {message}"), way_out)
    }

    /// A place where the format is broken.
    pub fn broken(&self, at: usize, message: impl Display) -> Error {
        self.fail(at, message, WRITE_AGAIN)
    }

    /// Refuses what no text has: a file that was cut short on its way often goes on as zeros, which would be one endless word.
    pub fn refuse_zeros(&self) -> Result<()> {
        match self.rest().iter().position(|byte| *byte == 0) {
            Some(place) => Err(self.broken(self.at + place, "a byte of value 0 stands here, which no text has")),
            None => Ok(()),
        }
    }

    /// Steps over spaces, tabs and line ends.
    pub fn skip_space(&mut self) {
        let rest = self.rest();
        self.at += rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
    }

    /// Steps over spaces and tabs.
    fn skip_blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.iter().position(|b| *b == b'\n' || !b.is_ascii_whitespace()).unwrap_or(rest.len());
    }

    /// Whether only space is left.
    pub fn is_done(&mut self) -> bool {
        self.skip_space();
        self.rest().is_empty()
    }

    /// The rest of this line without its end; the cursor moves to the next line. `None` at the end of the file.
    pub fn line(&mut self) -> Option<&'a [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let length = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        self.seek(self.at + length + 1);
        Some(rest[..length].strip_suffix(b"\r").unwrap_or(&rest[..length]))
    }

    /// The next word on this or a later line, and its place.
    pub fn word(&mut self, what: &str) -> Result<(usize, &'a [u8])> {
        self.skip_space();
        if self.rest().is_empty() {
            return Err(self.broken(self.at, format!("the file ends where {what} should stand")));
        }
        Ok(self.take_word())
    }

    /// The next word without moving on; empty at the end of the file.
    pub fn peek_word(&mut self) -> &'a [u8] {
        self.skip_space();
        let (at, word) = self.take_word();
        self.at = at;
        word
    }

    /// The next word on this line, and its place.
    pub fn field(&mut self, what: &str) -> Result<(usize, &'a [u8])> {
        self.skip_blanks();
        match self.rest().first() {
            None => Err(self.broken(self.at, format!("the file ends where {what} should stand"))),
            Some(b'\n') => Err(self.broken(self.at, format!("the line ends where {what} should stand"))),
            Some(_) => Ok(self.take_word()),
        }
    }

    fn take_word(&mut self) -> (usize, &'a [u8]) {
        let (at, rest) = (self.at, self.rest());
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        (at, &rest[..length])
    }

    /// Ends a line on which nothing may follow, and the empty lines behind it.
    pub fn end_line(&mut self) -> Result<()> {
        self.skip_blanks();
        if !matches!(self.rest().first(), None | Some(b'\n')) {
            let (at, word) = self.take_word();
            return Err(self.broken(at, format!("`{}` is more than this line should hold", excerpt(word))));
        }
        self.skip_space();
        Ok(())
    }

    /// A number in text.
    pub fn parse<T: Number>(&self, (at, word): (usize, &[u8]), what: &str) -> Result<T> {
        std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse().ok())
            .ok_or_else(|| self.broken(at, format!("{what}: `{}` is not {}", excerpt(word), T::KIND)))
    }

    /// The number that is the next word of the file.
    pub fn number<T: Number>(&mut self, what: &str) -> Result<T> {
        let word = self.word(what)?;
        self.parse(word, what)
    }

    /// The number that is the next word of the line.
    pub fn number_in_line<T: Number>(&mut self, what: &str) -> Result<T> {
        let word = self.field(what)?;
        self.parse(word, what)
    }

    /// The next `count` bytes of a binary section.
    pub fn take(&mut self, count: u64, what: &str) -> Result<&'a [u8]> {
        let rest = self.rest();
        match usize::try_from(count) {
            Ok(count) if count <= rest.len() => {
                self.at += count;
                Ok(&rest[..count])
            }
            _ => Err(self.broken(
                self.at,
                format!("{what}: {count} bytes should stand here, but the file ends after {}", rest.len()),
            )),
        }
    }

    /// Place of word `index`, counted from 0, of the words that start at `from`.
    pub fn place_of_word(&self, from: usize, index: usize) -> usize {
        let mut source = self.clone();
        source.seek(from);
        for _ in 0..index {
            source.skip_space();
            source.take_word();
        }
        source.skip_space();
        source.at
    }
}

/// A word of the file that can stand in a message.
pub(crate) fn excerpt(word: &[u8]) -> String {
    const LONGEST: usize = 40;
    let text: String = String::from_utf8_lossy(&word[..word.len().min(LONGEST)])
        .chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect();
    if word.len() > LONGEST { format!("{text}...") } else { text }
}
