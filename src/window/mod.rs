//! The window: an insertion is practised by hand, or watched, while the device solves the tissue and draws it.
//!
//! [`practice`] holds one attempt: simulation, who leads, records; [`tuning`] what is changed while it goes on. [`hand`] is what a hand
//! holds, [`grip`] how the mouse takes hold of the needle, [`reach`] what the tissue follows of it, [`devices`] what else is connected.
//! [`section`], [`tool_shape`], [`marks`] and [`camera`] say what is drawn, [`scene_view`] draws it from the solver's own buffers as
//! [`appearance`] chooses, [`panels`] stand around it, [`app`] is the window itself. [`probe`] says where an ultrasound slice stands,
//! [`ultrasound`] draws it and [`scan`] shows it; [`lost_display`] has the last word where the display goes down. The window owns no
//! physics: it sends poses and reads records.

pub mod accuracy;
pub mod app;
pub mod appearance;
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

use std::net::IpAddr;
use std::path::PathBuf;

pub use app::view;

/// How the needle is shown to other programs (feature `link`).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LinkChoice {
    /// `None`: this machine only.
    pub address: Option<IpAddr>,
    /// `None`: the usual one; 0: a free one.
    pub port: Option<u16>,
    /// Whether they may lead it.
    pub allow_control: bool,
}

/// Simulated time over wall time that may be aimed at: from slow motion to as fast as this machine can.
pub const PACES: std::ops::RangeInclusive<f64> = 0.1..=10.0;

/// What the command line asks for.
#[derive(Debug, Clone)]
pub struct ViewOptions {
    pub scene: PathBuf,
    pub overrides: Vec<String>,
    /// The motion of the scene leads, from the start on.
    pub script: bool,
    /// A recorded session leads.
    pub session: Option<PathBuf>,
    /// Folder of the tables and the session.
    pub out: Option<PathBuf>,
    pub force: bool,
    /// The ultrasound slice is shown from the start on.
    pub ultrasound: bool,
    /// Simulated time over wall time that is aimed at, one of [`PACES`].
    pub pace: f64,
    /// Close after so many pictures.
    pub frames: Option<u64>,
    /// Write the last picture to this file.
    pub screenshot: Option<PathBuf>,
    /// A run whose force curve lies behind the live one: its folder.
    pub reference: Option<PathBuf>,
    /// Whose attempts are kept, in which folder.
    pub trainee: Option<String>,
    pub history: PathBuf,
    /// Size of the window in points.
    pub size: Option<[u32; 2]>,
    /// Folder whose shaders stand in for the built-in ones, and are read anew when they change.
    pub shaders: Option<PathBuf>,
    /// OpenIGTLink beside the window.
    pub link: Option<LinkChoice>,
    /// File of the forces at 1 kHz.
    pub haptic_log: Option<PathBuf>,
}
