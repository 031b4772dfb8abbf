//! Every law against its reference, every kernel against the f64 engine and against known answers.

#[path = "../common/mod.rs"]
mod common;

mod element;
mod mooney_rivlin;
