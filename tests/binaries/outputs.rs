//! Tables, pictures, field files and reports.

#[path = "../common/mod.rs"]
mod common;
#[path = "../outputs.rs"]
mod outputs;
#[path = "../predictions.rs"]
mod predictions;
#[path = "../report.rs"]
mod report;
#[path = "../target.rs"]
mod target;
