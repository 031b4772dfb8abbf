//! `stylet view`: its arguments, and what frames the window (feature `window`).

use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

use super::{DEFAULT_SCENE, ended};
use crate::ending;
use crate::error::{Error, Result};
use crate::training::history;

#[derive(Debug, Clone, Default, Args)]
pub struct ViewArgs {
    /// Scene file [default: the start screen, with tasks and trainees]
    #[arg(id = "scene", value_name = "SCENE")]
    pub scene: Option<PathBuf>,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// The motion of the scene leads the needle, from the start on
    #[arg(long)]
    pub script: bool,
    /// A recorded session leads the needle; scene and overrides are those of the session
    #[arg(long, value_name = "FILE", conflicts_with_all = ["script", "overrides"])]
    pub session: Option<PathBuf>,
    /// Folder of force.csv, energy.csv and session.json [default: nothing is written]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Replace the results that the folder holds
    #[arg(long)]
    pub force: bool,
    /// Folder of a run whose force curve lies behind the live one
    #[arg(long, value_name = "FOLDER")]
    pub reference: Option<PathBuf>,
    /// Keep the scores of this trainee's attempts, and show the progress
    #[arg(long, value_name = "NAME")]
    pub trainee: Option<String>,
    /// Folder of the trainees' attempts
    #[arg(long, value_name = "FOLDER", default_value = history::FOLDER)]
    pub history: PathBuf,
    /// Take the shaders from this folder, and again whenever they change
    #[arg(long, value_name = "FOLDER")]
    pub shaders: Option<PathBuf>,
    /// Size of the window in points
    #[arg(long, value_names = ["WIDTH", "HEIGHT"], num_args = 2)]
    pub size: Option<Vec<u32>>,
    /// Put a band around the force from the start on, by a companion with twice the cell edge
    #[arg(long)]
    pub error_bar: bool,
    /// Show an ultrasound-like slice from the start on
    #[arg(long)]
    pub ultrasound: bool,
    /// Simulated time over wall time that is aimed at: less than 1 is slow motion
    #[arg(long = "speed-factor", alias = "pace", value_name = "FACTOR", default_value_t = 1.0)]
    pub pace: f64,
    /// Start at once and close after so many pictures
    #[arg(long)]
    pub frames: Option<u64>,
    /// Write the last picture to this PNG file
    #[arg(long, value_name = "FILE")]
    pub screenshot: Option<PathBuf>,
    /// Write the view of the last picture, without the panels, to this PNG file
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// File of the settings of the window [default: STYLET_SETTINGS, else in the user's folder for settings]
    #[arg(long, value_name = "FILE")]
    pub settings: Option<PathBuf>,
    #[command(flatten)]
    pub link: LinkArgs,
    /// Write the forces that a haptic device would get, 1000 a second, to this CSV file
    #[arg(long, value_name = "FILE")]
    pub haptic_log: Option<PathBuf>,
}

#[derive(Debug, Clone, Default, Args)]
pub struct LinkArgs {
    /// Show needle and forces to other programs over OpenIGTLink, on this machine at port 18944
    #[arg(long = "link", id = "link")]
    pub on: bool,
    /// Another port; 0: a free one, which is printed
    #[arg(long = "link-port", id = "link_port", value_name = "PORT", requires = "link")]
    pub port: Option<u16>,
    /// Listen at this address; every other than 127.0.0.1 opens the simulation to the network
    #[arg(long = "link-address", id = "link_address", value_name = "ADDRESS", requires = "link")]
    pub address: Option<IpAddr>,
    /// Programs over OpenIGTLink may lead the needle
    #[arg(long, requires = "link")]
    pub allow_control: bool,
}

impl ViewArgs {
    /// The window as it is opened without any word.
    pub fn start_screen() -> Self {
        ViewArgs { pace: 1.0, history: history::FOLDER.into(), ..ViewArgs::default() }
    }

    /// The scene that is asked for; `None`: the start screen. Who changes or watches one without naming it means the first.
    pub fn scene_file(&self) -> Option<PathBuf> {
        let first = || (self.script || !self.overrides.is_empty()).then(|| DEFAULT_SCENE.into());
        self.scene.clone().or_else(first)
    }

    /// Whether the call names what is shown first.
    pub fn names_a_scene(&self) -> bool {
        self.session.is_some() || self.scene_file().is_some()
    }

    /// Width and height of the window in points, where they were given.
    pub fn size(&self) -> Option<[u32; 2]> {
        self.size.as_ref().and_then(|size| Some([*size.first()?, *size.get(1)?]))
    }
}

/// The command: has the window opened, and prints how it went once it is closed. The window stands above the commands, so who calls
/// hands in `open`, which returns that text.
///
/// # Errors
/// Those of `open`.
pub fn execute(args: &ViewArgs, open: impl FnOnce(&ViewArgs) -> Result<String>) -> Result<u8> {
    ending::watch();
    println!("{}", open(args)?);
    Ok(window_ended())
}

/// Exit code of a window that was closed; where a user or a scheduler has closed it, that is said.
pub fn window_ended() -> u8 {
    ended("the window is closed, what it has recorded is kept")
}

/// The refusal of a program that was built without its window.
pub fn no_window() -> Error {
    Error::input(
        "this stylet was built without its window",
        "build it with the window: cargo run --release --features window -- view",
    )
}
