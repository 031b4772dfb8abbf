//! The program as a user calls it.

#[path = "../cli/main.rs"]
mod cli;
#[path = "../disk.rs"]
mod disk;
