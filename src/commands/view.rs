//! `stylet view`: its arguments, and what frames the window (feature `window`).

use std::net::IpAddr;
use std::path::PathBuf;

use clap::Args;

use super::{SceneArgs, ended};
use crate::ending;
use crate::error::{Error, Result};

#[derive(Debug, Clone, Args)]
pub struct ViewArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
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
    #[arg(long, value_name = "FOLDER", default_value = "history")]
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
    Ok(ended("the window is closed, what it has recorded is kept"))
}

/// The refusal of a program that was built without its window.
pub fn no_window() -> Error {
    Error::input(
        "this stylet was built without its window",
        "build it with the window: cargo run --release --features window -- view",
    )
}
