//! The window: an insertion is practised by hand, or watched, while the device solves the tissue and draws it.
//!
//! [`practice`] holds one attempt: simulation, who leads, records; [`tuning`] what is changed while it goes on. [`hand`] is what a hand
//! holds, [`grip`] how the mouse takes hold of the needle, [`reach`] what the tissue follows of it, [`devices`] what else is connected.
//! [`section`], [`tool_shape`], [`marks`] and [`camera`] say what is drawn, [`scene_view`] draws it from the solver's own buffers as
//! [`appearance`] chooses, [`panels`] stand around it, [`app`] is the window itself. [`probe`] says where an ultrasound slice stands,
//! [`ultrasound`] draws it and [`scan`] shows it; [`lost_display`] has the last word where the display goes down. The window owns no
//! physics: it sends poses and reads records.

pub mod accuracy;
pub mod anatomy_view;
pub mod app;
pub mod appearance;
mod band;
pub mod camera;
pub mod devices;
pub mod effects_panel;
pub mod foresight;
pub mod gamepad;
pub mod grip;
pub mod hand;
pub mod kernels_on_disk;
#[cfg(feature = "link")]
pub mod link_device;
pub mod lost_display;
pub mod marks;
#[cfg(feature = "gamepad")]
pub mod pads;
pub mod panels;
pub mod parts;
pub mod practice;
pub mod probe;
pub mod reach;
pub mod scan;
pub mod scene_view;
pub mod section;
pub mod source;
pub mod texts;
pub mod tool_shape;
pub mod tuning;
pub mod ultrasound;
pub mod watch;

pub use app::view;

/// Simulated time over wall time that may be aimed at: from slow motion to as fast as this machine can.
pub const PACES: std::ops::RangeInclusive<f64> = 0.1..=10.0;
