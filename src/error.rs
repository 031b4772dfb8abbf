//! The one error type. A message tells what is wrong, where it stands and the way out.

use std::path::PathBuf;

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
    Input { message: String, way_out: String },
    /// No adapter, wrong adapter name, or a device that could not be opened.
    #[error("{message}\n  way out: {way_out}")]
    Adapter { message: String, way_out: String },
    /// A shader does not compose or does not validate: a broken internal promise.
    #[error("shader {stage}: {message}")]
    Shader { stage: String, message: String },
    /// The device reported an error or was lost.
    #[error("device: {0}")]
    Device(String),
    /// The simulation left the range in which its numbers mean something.
    #[error("run stopped in frame {frame} (step {step}, t = {time_s:.6} s): {message}")]
    Diverged { frame: u64, step: u64, time_s: f64, message: String },
    /// The end was asked for, and the frame under way was given up.
    #[error("ended by {0} within a frame")]
    Ended(&'static str),
    /// A file could not be written or read.
    #[error("{path}: {source}\n  way out: {}", way_out_of(source))]
    File { path: PathBuf, source: std::io::Error },
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

/// A text for a message: a word or a text of unreasonable length, which somebody else wrote, is cut.
pub fn brief(text: &str) -> String {
    /// Longest word [character]; a path may have more of them.
    const WORD: usize = 120;
    const PATH: usize = 4096;
    /// Longest text [byte].
    const TEXT: usize = 8192;
    // Only what is kept is looked at word by word.
    let (kept, cut) = match text.len() > TEXT {
        true => (&text[..text.floor_char_boundary(TEXT)], true),
        false => (text, false),
    };
    let mut short = String::with_capacity(kept.len());
    for piece in kept.split_inclusive(char::is_whitespace) {
        let most = if piece.contains(std::path::MAIN_SEPARATOR) { PATH } else { WORD };
        match piece.char_indices().nth(most) {
            Some((end, _)) => {
                short += &piece[..piece.floor_char_boundary(end.min(WORD / 2))];
                short += "... ";
            }
            None => short += piece,
        }
    }
    if cut {
        short += "...";
    }
    short
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
