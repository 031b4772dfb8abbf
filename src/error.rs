//! The one error type. A message tells what is wrong, where it stands and the way out.

#![warn(missing_docs)]

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::terminal::plain;

/// Result of every fallible call of the library.
pub type Result<T> = std::result::Result<T, Error>;

/// Everything that can go wrong, grouped by who can mend it.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The scene file or a command-line value is wrong; the text is complete (file, line, excerpt,
    /// way out) and already rendered.
    #[error("{0}")]
    Scene(String),
    /// Another input (file, folder, option) is wrong.
    #[error("{message}\n  way out: {way_out}")]
    Input {
        /// What is wrong, and where.
        message: String,
        /// What to do about it.
        way_out: String,
    },
    /// No adapter, wrong adapter name, or a device that could not be opened.
    #[error("{message}\n  way out: {way_out}")]
    Adapter {
        /// What is not to be had.
        message: String,
        /// What to install, to name or to take instead.
        way_out: String,
    },
    /// A shader does not compose or does not validate: a broken internal promise.
    #[error("shader {stage}: {message}")]
    Shader {
        /// Stage of a step, or file and line of the source.
        stage: String,
        /// Why it is refused.
        message: String,
    },
    /// The device reported an error or was lost.
    #[error("device: {0}")]
    Device(String),
    /// The simulation left the range in which its numbers mean something.
    #[error("run stopped in frame {frame} (step {step}, t = {time_s:.6} s): {message}")]
    Diverged {
        /// Frame after which the run was stopped, from 0.
        frame: u64,
        /// Steps from t = 0 to its end.
        step: u64,
        /// Simulated time at its end [s].
        time_s: f64,
        /// What left its bound, and where.
        message: String,
    },
    /// The end was asked for, and the frame under way was given up.
    #[error("ended by {0} within a frame")]
    Ended(&'static str),
    /// A file could not be written or read.
    #[error("{}: {source}\n  way out: {}", named(path), way_out_of(source))]
    File {
        /// Where it stands or should stand.
        path: PathBuf,
        /// What the system answered.
        source: std::io::Error,
    },
}

/// A path in a message.
fn named(path: &Path) -> String {
    brief(&path.display().to_string())
}

/// What to do about a file that cannot be written or read.
fn way_out_of(source: &std::io::Error) -> &'static str {
    use std::io::ErrorKind::*;
    match source.kind() {
        StorageFull | QuotaExceeded => "free space on that disk, or write to another one with --out",
        FileTooLarge => "raise the limit on the size of files (`ulimit -f`), or write to another disk with --out",
        PermissionDenied | ReadOnlyFilesystem => "give yourself the right to it, or take another folder with --out",
        AlreadyExists | NotADirectory | IsADirectory => {
            "a file stands where a folder should be, or a folder where a file should be: move it away, or take another folder"
        }
        NotFound => "check the name; a folder that was there may have been removed",
        _ => "check the disk and the path, then call again",
    }
}

/// A text for a message, which somebody else may have written: long words are cut, then the text, both in their middle, so that the
/// reason at the end stays; what steers a terminal is written out.
pub fn brief(text: &str) -> String {
    /// Longest word [byte]; a path may have more of them.
    const WORD: usize = 120;
    const PATH: usize = 1000;
    /// Longest text [byte].
    const TEXT: usize = 2000;
    let mut short = String::new();
    for piece in text.split_inclusive(char::is_whitespace) {
        let most = if piece.contains(std::path::MAIN_SEPARATOR) { PATH } else { WORD };
        short += &shortened(piece, most);
    }
    // What is written out is up to eight times as long as it was.
    shortened(&plain(&shortened(&short, TEXT)), TEXT).into_owned()
}

/// A text of more than `most` bytes without its middle.
fn shortened(text: &str, most: usize) -> Cow<'_, str> {
    if text.len() <= most {
        return text.into();
    }
    let head = &text[..text.floor_char_boundary(most / 2)];
    let tail = &text[text.ceil_char_boundary(text.len() - most / 4)..];
    format!("{head}...{tail}").into()
}

impl Error {
    /// A wrong input with its way out.
    pub fn input(message: impl Into<String>, way_out: impl Into<String>) -> Self {
        Error::Input { message: brief(&message.into()), way_out: brief(&way_out.into()) }
    }

    /// A file error with the path that it concerns.
    pub fn file(path: impl Into<PathBuf>, source: std::io::Error) -> Self {
        Error::File { path: path.into(), source }
    }

    /// Exit code of the program: 2 where the user's input is wrong, 1 otherwise.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Scene(_) | Error::Input { .. } | Error::Adapter { .. } => 2,
            Error::Ended(_) => crate::ending::exit_code(),
            _ => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reason_stays_whatever_is_long_before_it() {
        let long = "a".repeat(100_000);
        let words = "a b ".repeat(25_000);
        let folders = "a/".repeat(50_000);
        for text in [&long, &words, &folders] {
            let short = brief(&format!("`{text}` stands where a number is expected"));
            assert!(short.starts_with("`a") && short.ends_with("` stands where a number is expected"), "{short}");
            assert!(short.len() < 2000, "{} bytes", short.len());
        }
        let path = format!("{}/scene.toml", "folder/".repeat(60));
        assert_eq!(brief(&path), path);
        assert_eq!(brief("\u{e4}".repeat(100).as_str()).matches("...").count(), 1);
    }

    #[test]
    fn what_is_written_out_stays_short_too() {
        // Found by libFuzzer: 2 kB of control characters made 8 kB of message.
        let short = brief(&format!("column `{}` is unknown", "\u{b} ".repeat(3000)));
        assert!(short.len() <= 2000 && short.ends_with("` is unknown"), "{} bytes: {short}", short.len());
    }

    #[test]
    fn nothing_steers_a_terminal() {
        assert_eq!(
            brief("\x1b[31mred\x07\n\tnext \u{9b}1m \u{202e}"),
            "\\u{1b}[31mred\\u{7}\n\tnext \\u{9b}1m \\u{202e}"
        );
    }
}
