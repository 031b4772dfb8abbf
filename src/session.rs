//! A recorded session: what a hand did, frame by frame, and nothing else. The run is computed again from it.
//!
//! Replayed by the same program on the same adapter it gives the same forces bit for bit; elsewhere within what adapters differ
//! (`stylet compare-adapters`).
//!
//! In the file the head stands in the first line, and every pose and every change in a line of its own behind it: they are appended
//! while the hand moves, so that a window that goes down in the middle takes nothing with it.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::engine::EngineInfo;
use crate::error::{Error, Result};
use crate::needle::motion::HandPose;
use crate::output::checkpoint::fingerprint;
use crate::reading;
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::whole_file;

/// File of a session in its folder.
pub const SESSION: &str = "session.json";

/// Version of the format.
const FORMAT: u32 = 3;
/// Oldest format that is read: one value that holds all poses; sessions of it have no changes.
const OLDEST_FORMAT: u32 = 1;
/// Largest file that is read: an hour at 60 frames/s takes 40 MB.
const LARGEST_FILE: u64 = 64 << 20;

/// The inputs of one session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    pub format: u32,
    /// Program version, engine, adapter and driver that recorded it.
    pub version: String,
    pub engine: String,
    pub adapter: String,
    pub driver: String,
    /// Scene file, its overrides, and the fingerprint of both.
    pub scene: PathBuf,
    pub overrides: Vec<String>,
    pub fingerprint: u64,
    /// Where the hand wanted the needle at the end of every frame; SI.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub poses: Vec<HandPose>,
    /// What was changed while it ran, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changes: Vec<SceneChange>,
}

/// A line behind the head.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Pose(HandPose),
    Change(SceneChange),
}

/// Other values of the scene from a frame on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneChange {
    /// Frames that were led before.
    pub frame: u64,
    /// All overrides that hold from there on.
    pub overrides: Vec<String>,
}

impl Session {
    /// An empty session of a scene on an engine.
    pub fn new(scene: &Scene, overrides: &[String], engine: &EngineInfo) -> Self {
        Session {
            format: FORMAT,
            version: env!("CARGO_PKG_VERSION").into(),
            engine: engine.engine.clone(),
            adapter: engine.adapter.clone(),
            driver: engine.driver.clone(),
            scene: scene.path.clone(),
            overrides: overrides.to_vec(),
            fingerprint: fingerprint(scene),
            poses: Vec::new(),
            changes: Vec::new(),
        }
    }

    /// # Errors
    /// `Error::File` where the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let head = Session { poses: Vec::new(), changes: Vec::new(), ..self.clone() };
        let text = line(path, &head)? + &self.lines(path, 0, 0)?;
        whole_file::write(path, text.as_bytes())
    }

    /// Lines of the poses and changes behind the first so many, each change before the pose that it was made for.
    fn lines(&self, path: &Path, poses: usize, changes: usize) -> Result<String> {
        let mut text = String::new();
        let mut changes = self.changes[changes..].iter().peekable();
        for (frame, pose) in (0..).zip(&self.poses).skip(poses) {
            while let Some(change) = changes.next_if(|change| change.frame <= frame) {
                text += &line(path, &Line::Change(change.clone()))?;
            }
            text += &line(path, &Line::Pose(*pose))?;
        }
        for change in changes {
            text += &line(path, &Line::Change(change.clone()))?;
        }
        Ok(text)
    }

    /// # Errors
    /// `Error::Input` for what is no session, is too large, or holds numbers that no hand can mean.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = reading::bytes(path, LARGEST_FILE).map_err(|e| wrong(path, e.to_string()))?;
        Self::from_bytes(path, &bytes)
    }

    /// The same with the bytes in memory.
    ///
    /// # Errors
    /// As [`Session::read`].
    pub fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self> {
        let mut values = serde_json::Deserializer::from_slice(bytes);
        let mut session = Session::deserialize(&mut values).map_err(|e| wrong(path, e.to_string()))?;
        for value in values.into_iter::<Line>() {
            match value {
                Ok(Line::Pose(pose)) => session.poses.push(pose),
                Ok(Line::Change(change)) => session.changes.push(change),
                // What was being written when the program or the machine went down.
                Err(error) if error.is_eof() => {
                    log::warn!("{}: the last line is cut off; {} frames are left", path.display(), session.poses.len());
                    break;
                }
                Err(error) => return Err(wrong(path, error.to_string())),
            }
        }
        if !(OLDEST_FORMAT..=FORMAT).contains(&session.format) {
            return Err(wrong(
                path,
                format!("its format is {}, this program knows {OLDEST_FORMAT} to {FORMAT}", session.format),
            ));
        }
        let sane = |pose: &HandPose| {
            pose.entry.is_finite()
                && pose.entry.abs().max_element() < 1.0
                && pose.depth.abs() < 1.0
                && (pose.direction.length() - 1.0).abs() < 1e-6
                && pose.direction.z < 0.0
        };
        if let Some(frame) = session.poses.iter().position(|pose| !sane(pose)) {
            return Err(wrong(path, format!("the pose of frame {frame} is not that of a needle over the tissue")));
        }
        let frames = session.poses.len() as u64;
        let orderly = session.changes.is_sorted_by_key(|change| change.frame);
        if !orderly || session.changes.last().is_some_and(|change| change.frame > frames) {
            return Err(wrong(path, format!("its changes are not in the order of its {frames} frames")));
        }
        Ok(session)
    }

    /// Brings a simulation to the changes that were made before its next frame is led.
    ///
    /// # Errors
    /// Those of the scene; `Error::Input` for a change that begins a run anew, which no session holds.
    pub fn change(&self, simulation: &mut Simulation, frame: u64) -> Result<()> {
        for change in self.changes.iter().filter(|change| change.frame == frame) {
            if !simulation.change(Scene::load(&self.scene, &change.overrides)?)? {
                return Err(Error::input(
                    format!("{}: a change before frame {frame} begins the run anew", self.scene.display()),
                    "record the session anew",
                ));
            }
        }
        Ok(())
    }

    /// The scene as it was recorded.
    ///
    /// # Errors
    /// As [`Scene::load`], and `Error::Input` where the scene is no longer the same.
    pub fn scene(&self) -> Result<Scene> {
        let scene = Scene::load(&self.scene, &self.overrides)?;
        if fingerprint(&scene) != self.fingerprint {
            return Err(Error::input(
                format!(
                    "{}: the scene, or the model of this program, has changed since the session was recorded",
                    self.scene.display()
                ),
                "bring the file back to what it was, take the program that recorded it, or record the session anew",
            ));
        }
        Ok(scene)
    }
}

/// One value in one line.
fn line(path: &Path, value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string(value).map_err(|e| Error::file(path, std::io::Error::other(e)))?;
    Ok(text + "\n")
}

/// The file of a session that grows while it is recorded.
pub struct SessionFile {
    path: PathBuf,
    file: File,
    /// What of the session stands in it.
    poses: usize,
    changes: usize,
    /// A part of a line may stand at its end.
    torn: bool,
}

impl SessionFile {
    /// Begins the file with what the session holds already; a file of that name is replaced.
    ///
    /// # Errors
    /// `Error::File` where it cannot be written.
    pub fn create(path: &Path, session: &Session) -> Result<Self> {
        session.write(path)?;
        let file = File::options().append(true).open(path).map_err(|e| Error::file(path, e))?;
        let (poses, changes) = (session.poses.len(), session.changes.len());
        Ok(SessionFile { path: path.to_path_buf(), file, poses, changes, torn: false })
    }

    /// Appends what has come to the session since the last time.
    ///
    /// # Errors
    /// `Error::File`. The next time the file is written anew, because a part of a line may stand in it.
    pub fn append(&mut self, session: &Session) -> Result<()> {
        if self.torn {
            *self = SessionFile::create(&self.path, session)?;
            return Ok(());
        }
        let text = session.lines(&self.path, self.poses, self.changes)?;
        self.file.write_all(text.as_bytes()).map_err(|e| {
            self.torn = true;
            Error::file(&self.path, e)
        })?;
        (self.poses, self.changes) = (session.poses.len(), session.changes.len());
        Ok(())
    }
}

fn wrong(path: &Path, reason: String) -> Error {
    Error::input(
        format!("{}: no session: {reason}", path.display()),
        "give a session.json that `stylet view` has written",
    )
}
