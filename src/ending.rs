//! How a user or a scheduler ends the program: by signals, and by limits that the system answers with a signal.
//!
//! Ctrl-C, `kill`, a terminal that closes, the end of a job's time: each asks a run to stop. It then writes its results and a
//! checkpoint, says one sentence and ends with 128 + the number of the signal, as shells have it. A file that grows beyond its limit
//! is an error of the write (`EFBIG`), as a full disk is, and no end.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::time::{Duration, Instant};

/// True once somebody has asked for the end.
static ASKED: AtomicBool = AtomicBool::new(false);

/// True while the program ends itself when it is asked: it has something to write.
static BEGUN: AtomicBool = AtomicBool::new(false);

/// The first signal that came; 0: none.
static SIGNAL: AtomicI32 = AtomicI32::new(0);

/// Number of the signal of Ctrl-C.
const INTERRUPT: i32 = 2;

/// Time that the frame under way has before it is given up.
const PATIENCE: Duration = Duration::from_millis(700);

/// From here on signals ask for the end instead of ending the program at once; the flag becomes true. A second Ctrl-C ends the
/// program at once. Until [`begin`] there is nothing to keep, and the program ends with a sentence.
pub fn watch() -> &'static AtomicBool {
    system::watch();
    &ASKED
}

/// From here on there is something to keep: whoever works looks at the flag of [`watch`].
pub fn begin() {
    BEGUN.store(true, Ordering::Relaxed);
}

/// True once the end was asked for.
pub fn is_asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

/// True once the end was asked for long enough ago that a frame under way is to be given up.
pub fn is_overdue() -> bool {
    static SEEN: OnceLock<Instant> = OnceLock::new();
    is_asked() && SEEN.get_or_init(Instant::now).elapsed() > PATIENCE
}

/// Ends the program without waiting for a frame that was given up: drivers finish what they have begun before they let go.
pub fn leave_unfinished_work(code: u8) {
    if is_overdue() {
        system::exit(code);
    }
}

/// Exit code of a program that was asked to end: 128 + the number of the signal.
pub fn exit_code() -> u8 {
    let number = match SIGNAL.load(Ordering::Relaxed) {
        0 => INTERRUPT,
        number => number,
    };
    128 + number as u8
}

/// What asked for the end.
pub fn reason() -> &'static str {
    system::name(SIGNAL.load(Ordering::Relaxed))
}

#[cfg(unix)]
mod system {
    use std::sync::atomic::Ordering;

    use nix::libc;
    use nix::sys::signal::{SaFlags, SigAction, SigHandler, SigSet, Signal, sigaction};

    use super::{ASKED, BEGUN, INTERRUPT, SIGNAL};

    /// What users, terminals and schedulers send to end a job. Slurm, PBS and Grid Engine send USR1 or USR2 some time before the
    /// end where they are asked to, the kernel XCPU at the soft limit of processor time.
    const ENDS: [(Signal, &str); 6] = [
        (Signal::SIGINT, "Ctrl-C (SIGINT)"),
        (Signal::SIGTERM, "SIGTERM"),
        (Signal::SIGHUP, "SIGHUP"),
        (Signal::SIGXCPU, "SIGXCPU (limit of processor time)"),
        (Signal::SIGUSR1, "SIGUSR1"),
        (Signal::SIGUSR2, "SIGUSR2"),
    ];

    pub fn name(number: i32) -> &'static str {
        ENDS.iter().find(|(signal, _)| *signal as i32 == number).map_or("Ctrl-C", |(_, name)| name)
    }

    /// Runs between any two instructions: atomics, `write` and `_exit` only.
    extern "C" fn asked(number: libc::c_int) {
        if !BEGUN.load(Ordering::Relaxed) {
            for text in ["error: ended by ", name(number), " before anything was kept\n"] {
                // SAFETY: the bytes live as long as the program.
                unsafe { libc::write(2, text.as_ptr().cast(), text.len()) };
            }
            // SAFETY: ends the process; nothing is under way that must be finished.
            unsafe { libc::_exit(128 + number) };
        }
        if !ASKED.swap(true, Ordering::Relaxed) {
            SIGNAL.store(number, Ordering::Relaxed);
        } else if number == INTERRUPT {
            // SAFETY: as above; the user has asked twice. Schedulers that repeat their signal have not.
            unsafe { libc::_exit(128 + number) };
        }
    }

    pub fn watch() {
        let action = SigAction::new(SigHandler::Handler(asked), SaFlags::SA_RESTART, SigSet::empty());
        for (signal, name) in ENDS {
            // SAFETY: the handler does only what a handler may.
            match unsafe { sigaction(signal, &action) } {
                // `nohup` has decided that the end of the terminal is none of the program.
                Ok(before) if signal == Signal::SIGHUP && matches!(before.handler(), SigHandler::SigIgn) => {
                    // SAFETY: puts back what was there.
                    let _ = unsafe { sigaction(signal, &before) };
                }
                Ok(_) => {}
                Err(error) => log::warn!("{name} will end the program at once: {error}"),
            }
        }
    }

    pub fn exit(code: u8) {
        // SAFETY: ends the process; all files are written, and standard output is flushed with every line.
        unsafe { libc::_exit(code.into()) }
    }

    pub fn ignore_file_size_signal() {
        let action = SigAction::new(SigHandler::SigIgn, SaFlags::empty(), SigSet::empty());
        // SAFETY: no handler is called.
        if let Err(error) = unsafe { sigaction(Signal::SIGXFSZ, &action) } {
            log::warn!("a limit on the size of files will end the program without a word: {error}");
        }
    }
}

#[cfg(not(unix))]
mod system {
    use std::sync::atomic::Ordering;

    use super::{ASKED, INTERRUPT};

    pub fn name(_: i32) -> &'static str {
        "Ctrl-C"
    }

    pub fn watch() {
        let asked = || {
            if ASKED.swap(true, Ordering::Relaxed) {
                std::process::exit(128 + INTERRUPT);
            }
        };
        if let Err(error) = ctrlc::set_handler(asked) {
            log::warn!("Ctrl-C will end the program at once: {error}");
        }
    }

    pub fn exit(code: u8) {
        std::process::exit(code.into());
    }

    pub fn ignore_file_size_signal() {}
}

/// From here on a file beyond the limit on its size (`ulimit -f`) is an error of the write, no end of the program.
pub fn survive_file_size_limit() {
    system::ignore_file_size_signal();
}
