//! What is told where the display goes down under an open window.
//!
//! Xlib ends the program itself then, by `exit` and without a way back into it, after it has called a handler: that is where something
//! can still be said. (`atexit` is too late: destructors of drivers, which run before, were seen to end the program.) Files need no
//! care here, they are written frame by frame. On Wayland the event loop ends with an error, as any program does.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Once a window is open: where its attempt is written to, if anywhere. It stays so to the end: a driver may see first that the display
/// is gone, and Xlib when the window is closed for that reason.
static OPEN: Mutex<Option<Option<PathBuf>>> = Mutex::new(None);

/// A window has been opened.
pub struct OpenWindow(());

impl OpenWindow {
    /// `folder`: where the attempt is written to.
    pub fn with(folder: Option<&Path>) -> Self {
        // Where there is no Xlib, no display of it goes down.
        #[cfg(target_os = "linux")]
        if let Ok(xlib) = x11_dl::xlib::Xlib::open() {
            // SAFETY: the function has the signature that is wanted, and lives as long as the program.
            unsafe { (xlib.XSetIOErrorHandler)(Some(tell)) };
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

/// Called by Xlib before it ends the program.
#[cfg(target_os = "linux")]
unsafe extern "C" fn tell(_: *mut x11_dl::xlib::Display) -> std::os::raw::c_int {
    use std::io::Write;
    // Whoever holds the lock has been stopped in the middle.
    let Ok(open) = OPEN.try_lock() else { return 0 };
    if let Some(folder) = &*open {
        // A panic must not leave this function.
        let _ = writeln!(std::io::stderr(), "{}", message(folder.as_deref()));
    }
    0
}

#[cfg(any(target_os = "linux", test))]
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
