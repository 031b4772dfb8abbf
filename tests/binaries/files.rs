//! Scene files and their refusals; the pages and the order of the modules.

#[path = "../architecture.rs"]
mod architecture;
#[path = "../docs.rs"]
mod docs;
#[path = "../material_command.rs"]
mod material_command;
#[path = "../scene_files.rs"]
mod scene_files;
#[path = "../words.rs"]
mod words;
