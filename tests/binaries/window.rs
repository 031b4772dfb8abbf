//! The window, its panels and pictures, practice.

#[path = "../common/mod.rs"]
mod common;
#[path = "../debriefing.rs"]
mod debriefing;
#[path = "../layout.rs"]
mod layout;
#[path = "../panels.rs"]
mod panels;
#[path = "../pictures.rs"]
mod pictures;
#[path = "../pixels.rs"]
mod pixels;
#[path = "../practice.rs"]
mod practice;
#[path = "../teacher_screen.rs"]
mod teacher_screen;
#[path = "../ultrasound.rs"]
mod ultrasound;
#[path = "../window.rs"]
mod window;
