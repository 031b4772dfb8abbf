//! The file that a run goes on from: `checkpoint.stylet`, replaced whole as the run goes, gone when it has ended well.
//!
//! Format: the line `stylet checkpoint 1`, then zlib of a postcard message. The checksum of zlib finds a damaged file.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use serde::{Deserialize, Serialize};

use super::whole_file;
use crate::observables::FrameRecord;
use crate::scene::Scene;
use crate::solver::checkpoint::Checkpoint;
use crate::{Error, Result};

const MAGIC: &[u8] = b"stylet checkpoint 1\n";

/// A run that goes on later.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RunCheckpoint {
    /// Version of the program.
    pub version: String,
    /// Scene file (absolute) and overrides, and what they meant.
    pub scene: PathBuf,
    pub overrides: Vec<String>,
    pub fingerprint: u64,
    pub adapter: String,
    /// All records so far: tables and charts of the run are made of them.
    pub records: Vec<FrameRecord>,
    pub cells_in_needle: Option<u64>,
    /// Time and path of the field files so far.
    pub fields: Vec<(f64, String)>,
    /// Wall and CPU time of the steps so far [s].
    pub wall: f64,
    pub cpu: Option<f64>,
    pub simulation: Checkpoint,
}

/// A number that changes with anything that a scene says, its presets and meshes among it, but not with its task or the place of
/// the file.
pub fn fingerprint(scene: &Scene) -> u64 {
    let mut hasher = DefaultHasher::new();
    // A task changes nothing in the simulation.
    let placeless = Scene { path: PathBuf::new(), task: None, notices: Vec::new(), ..scene.clone() };
    format!("{placeless:?}").hash(&mut hasher);
    hasher.finish()
}

fn damaged(path: &Path, reason: impl std::fmt::Display) -> Error {
    Error::input(
        format!("{} is no checkpoint of this program: {reason}", path.display()),
        "start the run anew with --force",
    )
}

impl RunCheckpoint {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// `Error::File` where it cannot be written; an older checkpoint is left as it was.
    pub fn write(&self, path: &Path) -> Result<()> {
        let message = postcard::to_allocvec(self).map_err(|e| Error::Device(format!("no checkpoint: {e}")))?;
        let mut encoder = ZlibEncoder::new(MAGIC.to_vec(), flate2::Compression::fast());
        let bytes = encoder.write_all(&message).and_then(|()| encoder.finish());
        whole_file::write(path, &bytes.map_err(|source| Error::file(path, source))?)
    }

    /// Reads a file back.
    ///
    /// # Errors
    /// `Error::Input` for a file that is missing, damaged or of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = std::fs::read(path).map_err(|reason| {
            Error::input(
                format!("there is no checkpoint {}: {reason}", path.display()),
                "name the folder of a run that was stopped; a run that has ended keeps none",
            )
        })?;
        Self::from_bytes(path, &bytes)
    }

    /// The same from the bytes of a file; `path` stands for it in messages.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        let Some(packed) = bytes.strip_prefix(MAGIC) else {
            return Err(damaged(path, "it does not begin like one"));
        };
        let mut message = Vec::new();
        ZlibDecoder::new(packed).read_to_end(&mut message).map_err(|e| damaged(path, e))?;
        Self::from_message(path, &message)
    }

    /// The same from the unpacked message.
    pub fn from_message(path: &Path, message: &[u8]) -> Result<Self> {
        let (found, rest) = postcard::take_from_bytes::<Self>(message).map_err(|e| damaged(path, e))?;
        if found.version != env!("CARGO_PKG_VERSION") {
            let (wrote, this) = (&found.version, env!("CARGO_PKG_VERSION"));
            return Err(damaged(path, format!("version {wrote:.40} wrote it, this is {this}")));
        }
        if !rest.is_empty() || found.records.len() as u64 != found.simulation.frames {
            return Err(damaged(path, "its parts do not fit together"));
        }
        Ok(found)
    }

    /// The scene that the run was made from.
    ///
    /// # Errors
    /// `Error::Scene` where it cannot be read any more, `Error::Input` where it says something else now.
    pub fn load_scene(&self) -> Result<Scene> {
        let scene = Scene::load(&self.scene, &self.overrides)?;
        if fingerprint(&scene) != self.fingerprint {
            return Err(Error::input(
                format!("{} says something else than when the checkpoint was written", self.scene.display()),
                "put the scene back as it was, or start the run anew with --force",
            ));
        }
        Ok(scene)
    }
}
