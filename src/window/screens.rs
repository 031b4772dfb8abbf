//! What a screen of the window asks for next: the one list of ways from screen to screen.

use std::path::PathBuf;

/// Where to go from here. A panel that wants to leave its screen hands this up; the window does it between two pictures.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// Tasks, trainees, recent files.
    Start,
    /// A scene file, or the path of a built-in one, led by hand from its beginning.
    Scene(PathBuf),
    /// A file that was dropped on the window: a scene, or something a scene can be made of.
    Bring(PathBuf),
    /// The same scene from its beginning, led by the same.
    Again,
    /// The task behind this one in the list of the start screen; the start screen behind the last.
    NextTask,
    /// Class, own tasks, notes, reports.
    Teacher,
    /// The window is closed.
    Close,
}
