//! Words to standard output and standard error that cannot end the program.
//!
//! `println!` and `eprintln!` of the standard library panic where nobody reads any more: behind a closed pipe (`| head`), on a
//! terminal that is gone, on a full disk. A run must not be lost for a line of text, so both names mean the macros of this file
//! within the program. What was meant as a result and did not get out is told by [`output_is_lost`].

use std::borrow::Cow;
use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// True once standard output has lost something that somebody wanted.
static OUTPUT_LOST: AtomicBool = AtomicBool::new(false);

/// The text with what steers a terminal written out (`\u{1b}`): a scene or the name of a file must not colour it, move its cursor or
/// turn the order of its letters. Line ends and tabs stay.
pub fn plain(text: &str) -> Cow<'_, str> {
    let steers = |c: char| match c {
        '\n' | '\t' => false,
        '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => true,
        c => c.is_control(),
    };
    if !text.contains(steers) {
        return text.into();
    }
    let mut plain = String::with_capacity(text.len());
    for c in text.chars() {
        match steers(c) {
            true => plain.extend(c.escape_unicode()),
            false => plain.push(c),
        }
    }
    plain.into()
}

/// One line to standard error; nothing happens where it cannot be written.
pub fn tell(text: Arguments) {
    // One write for the whole line, so that lines of two programs do not mix.
    let _ = std::io::stderr().lock().write_all(plain(&format!("{text}\n")).as_bytes());
}

/// One line to standard output. Whoever closes the pipe has read enough (`head`); any other failure is told once.
pub fn print(text: Arguments) {
    let mut out = std::io::stdout().lock();
    tell_of_lost(out.write_all(plain(&format!("{text}\n")).as_bytes()).and_then(|()| out.flush()));
}

/// Tells once where a result did not get out.
pub fn tell_of_lost(written: std::io::Result<()>) {
    if let Err(reason) = written
        && reason.kind() != ErrorKind::BrokenPipe
        && !OUTPUT_LOST.swap(true, Ordering::Relaxed)
    {
        tell(format_args!(
            "error: standard output: {reason}\n  way out: write to another disk, or free space on this one"
        ));
    }
}

/// Whether standard output has lost a result, other than to a closed pipe.
pub fn output_is_lost() -> bool {
    OUTPUT_LOST.load(Ordering::Relaxed)
}

/// As [`std::eprintln!`], without its panic.
#[macro_export]
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::terminal::tell(format_args!($($text)*)) };
}

/// As [`std::println!`], without its panic.
#[macro_export]
macro_rules! println {
    ($($text:tt)*) => { $crate::terminal::print(format_args!($($text)*)) };
}
