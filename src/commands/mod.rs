//! What the command line does, one file per command. Each owns its arguments: what clap reads is what it works with.

pub mod advise;
pub mod bench;
pub mod bench_effects;
pub mod bench_roofline;
pub mod bench_stages;
pub mod check;
pub mod check_penetration;
pub mod class;
pub mod compare_adapters;
pub mod fit;
pub mod fit_args;
pub mod import;
pub mod material;
pub mod prepare;
pub mod replay;
pub mod report;
pub mod report_predictions;
pub mod report_skills;
pub mod run;
pub mod stability;
pub mod study;
pub mod view;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::ending;
use crate::error::{Error, Result};
use crate::scene::Scene;

/// Scene of the main job.
pub const DEFAULT_SCENE: &str = "scenes/muscle_biopsy.toml";

// No text on the structs of arguments: clap would take it for that of the command.

#[derive(Debug, Clone, Default, Args)]
pub struct SceneArgs {
    /// Scene file
    #[arg(id = "scene", value_name = "SCENE", default_value = DEFAULT_SCENE)]
    pub file: PathBuf,
    /// Override a key of the scene, e.g. --set tissue.cell_size_mm=0.8
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
}

impl SceneArgs {
    /// Reads the scene.
    ///
    /// # Errors
    /// Those of [`Scene::load`].
    pub fn load(&self) -> Result<Scene> {
        Scene::load(&self.file, &self.overrides)
    }
}

/// Becomes true when a user or a scheduler asks for the end; what is finished by then stays.
pub fn until_ended() -> &'static AtomicBool {
    let asked = ending::watch();
    ending::begin();
    asked
}

/// Exit code of what was done; where a user or a scheduler has ended it, `kept` is said.
fn ended(kept: &str) -> u8 {
    if !ending::is_asked() {
        return 0;
    }
    eprintln!("ended by {}: {kept}", ending::reason());
    ending::exit_code()
}

/// Tells that a row of runs was ended, and how it goes on; the exit code.
fn ended_between_runs(done: usize, of: usize) -> u8 {
    eprintln!(
        "ended by {}: {done} of {of} runs are finished and stay; the same command goes on from there",
        ending::reason()
    );
    ending::exit_code()
}

/// `stylet schema`: the JSON schema of scene files.
pub fn schema() -> Result<String> {
    let text = serde_json::to_string_pretty(&Scene::schema());
    text.map_err(|e| Error::input(e.to_string(), "report this as a defect"))
}

/// `stylet adapters`: what wgpu finds here, and which one a run would take.
pub fn adapters() -> Result<String> {
    let found = crate::gpu::device::adapters()?;
    if found.is_empty() {
        return Ok("no adapter found; runs use the CPU engine (--engine cpu)\n\
             way out: install a Vulkan driver (Debian/Ubuntu: libvulkan1 mesa-vulkan-drivers), unset WGPU_BACKEND\n"
            .into());
    }
    let mut text = String::new();
    for (n, adapter) in found.iter().enumerate() {
        let info = adapter.get_info();
        text += &format!(
            "{} {}\n    driver: {} {}\n",
            if n == 0 { "*" } else { " " },
            crate::gpu::device::describe(&info),
            info.driver,
            info.driver_info
        );
    }
    text += "* is taken unless WGPU_ADAPTER_NAME (a part of the name) or WGPU_BACKEND says otherwise\n";
    Ok(text)
}
