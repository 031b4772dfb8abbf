//! The file that a run goes on from: `checkpoint.stylet`, replaced whole as the run goes, gone when it has ended well.
//!
//! Format: the line `stylet checkpoint 6`, then zlib of a postcard message. The checksum of zlib finds a damaged file.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::io::{BufReader, Read, Write};
use std::path::{Path, PathBuf};

use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use serde::{Deserialize, Serialize};

use super::folder::{CHECKPOINT, SUMMARY};
use super::summary::{Status, Summary};
use crate::observables::FrameRecord;
use crate::reading::{self, Unread};
use crate::scene::Scene;
use crate::simulation::checkpoint::Checkpoint;
use crate::whole_file;
use crate::{Error, Result};

const MAGIC: &[u8] = b"stylet checkpoint 6\n";

/// Bytes of a message that are unpacked to see whose it is.
const FIRST: u64 = 4096;

/// Most bytes of a message [B]. The main scene has one or two MiB. The largest mesh that portable devices take has 0.8 million cells:
/// 128 MiB of corner forces, as much of Prony terms, and some 100 MiB of all else; a larger one is not written either.
const LARGEST_MESSAGE: u64 = 512 << 20;

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
    /// With a companion: the order that its band counts with, where one was observed.
    pub error_bar: Option<Option<f64>>,
    /// Time and path of the field files so far.
    pub fields: Vec<(f64, String)>,
    /// Wall and CPU time of the steps so far [s].
    pub wall: f64,
    pub cpu: Option<f64>,
    pub simulation: Checkpoint,
}

/// Raised by one wherever the same scene and hand give other forces than before: recordings of earlier builds are refused then, not
/// continued or scored by another model. 2: contact of torn faces, tearing of a core, begin of a free path in a block. 3: advance
/// of a tip some of whose springs are not stretched. 4: begin of plastic flow in 32 bits.
const MODEL_EDITION: u32 = 17;

/// A number that changes with anything that a scene says, its presets and meshes among it, and with the model, but not with its task or the
/// place of the file.
pub fn fingerprint(scene: &Scene) -> u64 {
    let mut hasher = DefaultHasher::new();
    // A task changes nothing in the simulation.
    let placeless = Scene { path: PathBuf::new(), task: None, notices: Vec::new(), ..scene.clone() };
    format!("{MODEL_EDITION} {placeless:?}").hash(&mut hasher);
    hasher.finish()
}

fn damaged(path: &Path, reason: impl std::fmt::Display) -> Error {
    Error::input(
        format!("{} is no checkpoint of this program: {reason}", path.display()),
        "start the run anew with --force",
    )
}

fn other_version(path: &Path, wrote: &str) -> Error {
    damaged(path, format!("version {wrote:.40} wrote it, this is {}", env!("CARGO_PKG_VERSION")))
}

impl RunCheckpoint {
    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// `Error::File` where it cannot be written; an older checkpoint is left as it was.
    pub fn write(&self, path: &Path) -> Result<()> {
        let message = postcard::to_allocvec(self).map_err(|e| Error::Device(format!("no checkpoint: {e}")))?;
        if message.len() as u64 > LARGEST_MESSAGE {
            let reason =
                format!("a checkpoint of {} MiB, at most {} are read back", message.len() >> 20, LARGEST_MESSAGE >> 20);
            return Err(Error::file(path, std::io::Error::new(std::io::ErrorKind::FileTooLarge, reason)));
        }
        let mut encoder = ZlibEncoder::new(MAGIC.to_vec(), flate2::Compression::fast());
        let bytes = encoder.write_all(&message).and_then(|()| encoder.finish());
        whole_file::write(path, &bytes.map_err(|source| Error::file(path, source))?)
    }

    /// Reads the checkpoint of the run in a folder.
    ///
    /// # Errors
    /// As [`RunCheckpoint::read`]; a run that has none says why.
    pub fn of_run(folder: &Path) -> Result<Self> {
        let path = folder.join(CHECKPOINT);
        if path.exists() || !folder.is_dir() {
            return Self::read(&path);
        }
        let folder = folder.display();
        let summary = path.with_file_name(SUMMARY);
        let status = Summary::read(&summary).map(|summary| summary.status);
        let (message, way_out) = match status {
            Ok(Status::Ok | Status::Doubtful(_)) => (
                format!("the run in {folder} has finished: nothing is left to go on with"),
                "its results are in that folder; for a run anew give --force and --out instead of --resume",
            ),
            Ok(Status::Failed(why)) => (
                format!(
                    "the run in {folder} has failed and keeps no checkpoint: {}",
                    why.lines().next().unwrap_or_default()
                ),
                "mend what made it fail, then start it anew with --force",
            ),
            Ok(Status::Interrupted) => (
                format!("the run in {folder} was stopped, and its checkpoint is not there any more"),
                "put checkpoint.stylet back, or start the run anew with --force",
            ),
            Err(error) if summary.exists() => {
                return Err(Error::input(
                    format!("there is no checkpoint in {folder}, and what became of its run cannot be read: {error}"),
                    "start the run anew with --force",
                ));
            }
            Err(_) => (
                format!(
                    "there is no checkpoint in {folder}: no run was stopped there, or it was killed before its first one"
                ),
                "name the folder of a run that was stopped; a run that has ended keeps none",
            ),
        };
        Err(Error::input(message, way_out))
    }

    /// Reads a file back.
    ///
    /// # Errors
    /// `Error::Input` for a file that is missing, damaged or of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let unread = |reason: Unread| {
            Error::input(
                format!("there is no checkpoint {}: {reason}", path.display()),
                reason.way_out("name the folder of a run that was stopped; a run that has ended keeps none"),
            )
        };
        let mut file = reading::stream(path, reading::most::CHECKPOINT).map_err(unread)?;
        let mut head = Vec::new();
        file.by_ref().take(MAGIC.len() as u64).read_to_end(&mut head).map_err(|e| unread(e.into()))?;
        if head != MAGIC {
            return Err(damaged(path, "it does not begin like one"));
        }
        Self::unpack(path, BufReader::new(file))
    }

    /// The same from the bytes of a file; `path` stands for it in messages.
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        match bytes.strip_prefix(MAGIC) {
            Some(packed) => Self::unpack(path, packed),
            None => Err(damaged(path, "it does not begin like one")),
        }
    }

    /// What comes behind the first line.
    fn unpack(path: &Path, packed: impl Read) -> Result<Self> {
        let mut decoder = ZlibDecoder::new(packed);
        let mut message = Vec::new();
        // A few bytes may unpack to a thousand times as many: the first of them tell whether the others are wanted.
        decoder.by_ref().take(FIRST).read_to_end(&mut message).map_err(|e| damaged(path, e))?;
        let (version, _) = postcard::take_from_bytes::<&str>(&message).map_err(|e| damaged(path, e))?;
        if version != env!("CARGO_PKG_VERSION") {
            return Err(other_version(path, version));
        }
        decoder.by_ref().take(LARGEST_MESSAGE).read_to_end(&mut message).map_err(|e| damaged(path, e))?;
        if message.len() as u64 > LARGEST_MESSAGE {
            return Err(damaged(path, format!("more than {LARGEST_MESSAGE} bytes are packed into it")));
        }
        Self::from_message(path, &message)
    }

    /// The same from the unpacked message.
    pub fn from_message(path: &Path, message: &[u8]) -> Result<Self> {
        let (found, rest) = postcard::take_from_bytes::<Self>(message).map_err(|e| damaged(path, e))?;
        if found.version != env!("CARGO_PKG_VERSION") {
            return Err(other_version(path, &found.version));
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
                format!(
                    "{}: the scene, or the model of this program, is another one than when the checkpoint was written",
                    self.scene.display()
                ),
                "put the scene back as it was, take the program that wrote it, or start the run anew with --force",
            ));
        }
        Ok(scene)
    }
}
