//! Label maps and surfaces of patients: readers, and what a scene makes of them.

#[path = "../common/mod.rs"]
mod common;
#[path = "../anatomy/free_path.rs"]
mod free_path;
#[path = "../anatomy/indentation.rs"]
mod indentation;
#[path = "../anatomy/labels.rs"]
mod labels;
#[path = "../anatomy/pictures.rs"]
mod pictures;
#[path = "../anatomy/placement.rs"]
mod placement;
#[path = "../anatomy/readers.rs"]
mod readers;
#[path = "../anatomy/supports.rs"]
mod supports;
#[path = "../anatomy/surface_nets.rs"]
mod surface_nets;
#[path = "../anatomy/surfaces.rs"]
mod surfaces;
