//! What a run leaves behind: tables, a summary, a force chart, fields for ParaView, and the line on the terminal.
//!
//! [`folder`] decides where, before anything is simulated. [`tables`] are appended and flushed frame by frame under
//! their final names, so an interrupted run keeps every row; all other files appear whole or not at all
//! ([`crate::whole_file`]). [`curve`] reads figures off the force curve, [`summary`] writes them down.

pub mod chart;
pub mod checkpoint;
pub mod curve;
pub mod fit_chart;
pub mod folder;
pub mod forensics;
pub(crate) mod log_plot;
pub mod material_chart;
pub mod page;
pub mod parts_chart;
pub(crate) mod plot;
#[cfg(feature = "cli")]
pub mod progress;
pub mod report;
pub mod sample;
pub mod sample_chart;
pub mod summary;
pub mod tables;
pub mod target;
pub mod volumes;
pub mod vtu;

pub use chart::write_force_chart;
pub use curve::{CurveFigures, MajorDrop, major_drops};
pub use folder::{OutputFolder, PictureMoment};
pub use parts_chart::write_parts_chart;
#[cfg(feature = "cli")]
pub use progress::Progress;
pub use sample::DrivenFace;
pub use sample_chart::write_sample_chart;
pub use summary::{Band, Status, Summary};
pub use tables::Tables;
pub use target::TargetFigures;
pub use vtu::FieldFiles;
