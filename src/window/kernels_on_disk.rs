//! Kernels that another process compiles, so that the driver has them on disk when the window needs them.
//!
//! llvmpipe compiles a kernel when it is first used, in the queue that the frames go through: up to half a second in which no frame
//! comes. A second device in this program would share the locks of the driver and the priority of the window. Another process shares
//! nothing but the cache on disk.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};

use super::source::Source;
use crate::commands::prepare::READY;
use crate::effects::exactly;
use crate::scene::Scene;
use crate::simulation::Purpose;

/// A scene file, and an override that names its effects.
type Known = (PathBuf, String);

/// What is known to be on disk.
#[derive(Debug, Clone, Default)]
pub struct KernelsOnDisk(Arc<Mutex<BTreeSet<Known>>>);

/// A process that compiles; it ends with its owner.
pub struct Helper(Child);

impl Drop for Helper {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Helper {
    pub fn works(&mut self) -> bool {
        matches!(self.0.try_wait(), Ok(None))
    }
}

impl KernelsOnDisk {
    fn with<T>(&self, what: impl FnOnce(&mut BTreeSet<Known>) -> T) -> T {
        what(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn started(source: &Source, purpose: Purpose, how: &str) -> std::io::Result<Child> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("prepare").arg(&source.path).arg(how).arg(if purpose.led { "--hand" } else { "--script" });
        for change in &source.overrides {
            command.arg("--set").arg(change);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn()
    }

    /// Compiles everything that is one switch away from `source`, whose scene `scene` runs, with processor time that nobody else wants.
    ///
    /// # Errors
    /// Those of the start of a process.
    pub fn ahead(&self, source: &Source, scene: &Scene, purpose: Purpose) -> std::io::Result<Helper> {
        self.with(|known| known.insert((source.path.clone(), exactly(&scene.effects.keys()))));
        let mut child = Self::started(source, purpose, "--beside")?;
        if let Some(lines) = child.stdout.take() {
            let (kernels, path) = (self.clone(), source.path.clone());
            std::thread::spawn(move || {
                for line in BufReader::new(lines).lines().map_while(std::result::Result::ok) {
                    if let Some(effects) = line.strip_prefix(READY) {
                        kernels.with(|known| known.insert((path.clone(), effects.to_string())));
                    }
                }
            });
        }
        Ok(Helper(child))
    }

    /// Waits until the kernels of `source`, whose scene is `scene`, are on disk; at once where they are known to be. Where no process
    /// can be started the device compiles them itself, later.
    pub fn wait_for(&self, source: &Source, scene: &Scene, purpose: Purpose) {
        let wanted = (source.path.clone(), exactly(&scene.effects.keys()));
        if self.with(|known| known.contains(&wanted)) {
            return;
        }
        match Self::started(source, purpose, "--only").and_then(Child::wait_with_output) {
            Ok(output) if output.status.success() => _ = self.with(|known| known.insert(wanted)),
            Ok(output) => log::debug!("kernels were not compiled beside the window: {}", output.status),
            Err(error) => log::debug!("no process compiles beside the window: {error}"),
        }
    }
}
