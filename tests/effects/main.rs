//! Every law against its reference, every kernel against the f64 engine and against known answers.

#[path = "../common/mod.rs"]
mod common;

mod element;
mod friction;
mod gravity;
mod indentation;
mod mass_scaling;
mod mooney_rivlin;
mod puncture;
