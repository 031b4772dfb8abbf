//! Composed shaders, and what adapters make of them.

#[path = "../adapters.rs"]
mod adapters;
#[path = "../common/mod.rs"]
mod common;
#[path = "../shaders/main.rs"]
mod shaders;
