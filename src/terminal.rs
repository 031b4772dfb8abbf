//! Words to standard output and standard error that cannot end the program.
//!
//! `println!` and `eprintln!` of the standard library panic where nobody reads any more: behind a closed pipe (`| head`), on a
//! terminal that is gone, on a full disk. A run must not be lost for a line of text, so both names mean the macros of this file
//! within the program. What was meant as a result and did not get out is told by [`output_is_lost`].

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// True once standard output has lost something that somebody wanted.
static OUTPUT_LOST: AtomicBool = AtomicBool::new(false);

/// One line to standard error; nothing happens where it cannot be written.
pub fn tell(text: Arguments) {
    // One write for the whole line, so that lines of two programs do not mix.
    let _ = std::io::stderr().lock().write_all(format!("{text}\n").as_bytes());
}

/// One line to standard output. Whoever closes the pipe has read enough (`head`); any other failure is told once.
pub fn print(text: Arguments) {
    let mut out = std::io::stdout().lock();
    let written = out.write_all(format!("{text}\n").as_bytes()).and_then(|()| out.flush());
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
