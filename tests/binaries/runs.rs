//! Whole scenes, changes while they run, checkpoints, sessions and scores.

#[path = "../change.rs"]
mod change;
#[path = "../checkpoint.rs"]
mod checkpoint;
#[path = "../common/mod.rs"]
mod common;
#[path = "../error_bar.rs"]
mod error_bar;
#[path = "../lesson.rs"]
mod lesson;
#[path = "../mistakes.rs"]
mod mistakes;
#[path = "../scenes/main.rs"]
mod scenes;
#[path = "../session.rs"]
mod session;
#[path = "../teaching.rs"]
mod teaching;
#[path = "../training.rs"]
mod training;
