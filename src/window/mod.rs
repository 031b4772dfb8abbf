//! The window: an insertion is practised by hand, or watched, while the device solves the tissue and draws it.
//!
//! [`practice`] holds one attempt: simulation, who leads, records; [`tuning`] what is changed while it goes on. [`hand`] is what a hand
//! holds, [`grip`] how the mouse takes hold of the needle, [`devices`] what else is connected;
//! [`crate::simulation::reach`] says what the tissue follows of it.
//! [`lesson`] stands beside an attempt, [`debriefing`] behind it, [`sound`] is what both may be heard by.
//! [`section`], [`tool_shape`], [`marks`] and [`camera`] say what is drawn, [`scene_view`] draws it from the solver's own buffers as
//! [`appearance`] chooses, [`panels`] stand around it, [`app`] is the window itself. [`probe`] says where an ultrasound slice stands,
//! [`ultrasound`] draws it and [`scan`] shows it; [`lost_display`] has the last word where the display goes down.
//!
//! Before and behind an attempt stands [`start`]; [`screens`] says how one screen asks for another. [`settings`] is what a person has chosen
//! for good, [`preferences`] its menu, [`theme`] the colours, [`help`] the keys. The window owns no physics: it sends poses and reads
//! records.

pub mod accuracy;
pub mod anatomy_view;
pub mod app;
pub mod appearance;
mod band;
pub mod camera;
pub mod debriefing;
pub mod devices;
pub mod effects_panel;
pub mod foresight;
pub mod gamepad;
pub mod grip;
pub mod hand;
pub mod help;
pub mod kernels_on_disk;
pub mod lesson;
#[cfg(feature = "link")]
pub mod link_device;
pub mod lost_display;
pub mod marks;
pub mod overlay;
#[cfg(feature = "gamepad")]
pub mod pads;
pub mod panels;
pub mod parts;
pub mod practice;
pub mod preferences;
pub mod probe;
pub mod scan;
pub mod scene_view;
pub mod screens;
pub mod section;
pub mod settings;
pub mod slider;
pub mod sound;
pub mod source;
pub mod start;
pub mod teacher;
pub mod theme;
pub mod times;
pub mod tool_shape;
pub mod tuning;
pub mod ultrasound;
pub mod watch;
mod written;

pub use app::{view, view_where_possible};

/// Simulated time over wall time that may be aimed at: from slow motion to as fast as this machine can.
pub const PACES: std::ops::RangeInclusive<f64> = 0.1..=10.0;
