//! The window, its panels and pictures, practice.

#[path = "../common/mod.rs"]
mod common;
#[path = "../panels.rs"]
mod panels;
#[path = "../practice.rs"]
mod practice;
#[path = "../ultrasound.rs"]
mod ultrasound;
#[path = "../window.rs"]
mod window;
