//! Stylet: a needle goes into soft tissue, and a person sees and feels what happens.
//!
//! A program that embeds it begins with [`Scene`] (from a file, or [`Scene::block`]), makes a [`Simulation`] of it and takes
//! [`FrameRecord`]s from [`Simulation::next_frame`]; a hand leads the needle by [`Simulation::lead`] and a [`HandPose`]; an
//! [`OwnEffect`] acts in the cells beside those built in; a [`Gpu`] may be the host's own. `examples/` has each of them. Without the
//! feature `cli` only what a library needs is built.
//!
//! Reading order, which is also the straight line that data takes:
//! [`scene`] -> [`mesh`], [`effects`], [`separation`] -> [`model`] -> [`engine`] (the contract) -> [`cpu`] and [`gpu`], which do not know
//! each other -> [`observables`] -> [`simulation`] (a run) -> [`output`] and [`render`]. Below stand [`material`] and [`needle`], laws and the
//! tool, and [`penetration`], what follows from both. [`stability`] runs that line on the hard cases, [`study`] many times over, [`training`] scores what a trainee did, [`haptic`]
//! gives the forces to a device at 1 kHz. [`untrusted`] lists the readers of files, [`docs`] renders the parts of `docs/` that follow from
//! tables. `docs/architecture.md` has the floors that these modules stand on; `tests/architecture.rs` holds them.
//! The modules of the facade carry `#![warn(missing_docs)]`.

#[macro_use]
pub mod terminal;

pub mod anatomy;
#[cfg(feature = "cli")]
pub mod commands;
pub mod cpu;
pub mod docs;
pub mod effects;
pub mod ending;
pub mod engine;
pub mod error;
pub mod gpu;
pub mod haptic;
pub mod hash;
#[cfg(feature = "link")]
pub mod link;
pub mod material;
pub mod material_point;
pub mod material_test;
pub mod mesh;
pub mod model;
pub mod needle;
pub mod number;
pub mod observables;
pub mod output;
pub mod penetration;
pub mod predictions;
pub mod process;
pub mod reading;
pub mod render;
pub mod scene;
pub mod separation;
pub mod session;
pub mod simulation;
pub mod stability;
pub mod study;
pub mod training;
pub mod units;
pub mod untrusted;
pub mod verdict;
pub mod whole_file;
#[cfg(feature = "window")]
pub mod window;
pub mod within;
pub mod words;

// What a program that embeds the library needs first.
pub use effects::TissueMaterial;
pub use effects::own::OwnEffect;
pub use error::{Error, Result};
pub use gpu::Gpu;
pub use needle::motion::HandPose;
pub use observables::FrameRecord;
pub use scene::Scene;
pub use simulation::{EngineChoice, Simulation};
