//! What is told where the display goes down under an open window.
//!
//! Xlib ends the program itself then, by `exit` and without a way back into it: what is still to be said has to be said on the way
//! out. Files need no care here, they are written frame by frame.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// While a window is open: where its attempt is written to, if anywhere.
static OPEN: Mutex<Option<Option<PathBuf>>> = Mutex::new(None);

/// While it lives a window is open.
pub struct OpenWindow(());

impl OpenWindow {
    /// `folder`: where the attempt is written to.
    pub fn with(folder: Option<&Path>) -> Self {
        #[cfg(unix)]
        {
            static ONCE: std::sync::Once = std::sync::Once::new();
            // SAFETY: the function has the signature that is wanted, and lives as long as the program.
            ONCE.call_once(|| _ = unsafe { libc::atexit(tell) });
        }
        let window = OpenWindow(());
        window.writes_to(folder);
        window
    }

    /// The next attempt has a folder of its own.
    pub fn writes_to(&self, folder: Option<&Path>) {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) = Some(folder.map(Path::to_path_buf));
    }
}

impl Drop for OpenWindow {
    fn drop(&mut self) {
        *OPEN.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

/// Runs when the program ends; with a window still open nobody has closed it.
#[cfg(unix)]
extern "C" fn tell() {
    use std::io::Write;
    // Whoever holds the lock has been stopped in the middle.
    let Ok(open) = OPEN.try_lock() else { return };
    if let Some(folder) = &*open {
        // A panic must not leave this function.
        let _ = writeln!(std::io::stderr(), "{}", message(folder.as_deref()));
    }
}

#[cfg(any(unix, test))]
fn message(folder: Option<&Path>) -> String {
    let kept = match folder {
        Some(folder) => format!(
            "the attempt up to here is in {0}; its forces and scores: stylet replay {0} --out {0}_again",
            folder.display()
        ),
        None => "nothing of the attempt was kept; with --out FOLDER it is, frame by frame".into(),
    };
    format!("error: the display is gone, and the window with it\n  way out: {kept}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_message_says_where_the_attempt_is() {
        let told = message(Some(Path::new("attempts/ada_2")));
        assert!(told.contains("display is gone") && told.contains("stylet replay attempts/ada_2 --out"), "{told}");
        assert!(message(None).contains("--out FOLDER"));
    }
}
