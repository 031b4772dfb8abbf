//! The folder of a study: the plan, one file per finished run, and what is written from them.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Settings;
use super::plan::Plan;
use crate::error::{Error, Result};
use crate::output::folder::safe_name;
use crate::reading;
use crate::whole_file;

pub const PLAN: &str = "plan.json";
/// Folder of the finished runs.
pub const RUNS: &str = "runs";
pub const PAGE: &str = "study.html";
pub const TABLE: &str = "study.csv";
pub const FIGURES: &str = "study.json";

/// One finished run. `None` stands for "the run does not hold this number".
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RunRecord {
    pub id: String,
    pub settings: Option<Settings>,
    /// What it was made from; see [`super::subject::Subject::hash`].
    pub hash: String,
    pub scene_hash: String,
    pub version: String,
    /// As the engine names it; threads on the engine `cpu`.
    pub adapter: String,
    pub driver: String,
    /// True for a software adapter and for the engine `cpu`: then processor time counts, not wall time.
    pub software: bool,
    /// `K/N` where it was run as a part of a study.
    pub part: Option<String>,
    /// Seconds since 1970-01-01, UTC.
    pub finished: u64,
    /// Why the run ended early.
    pub failure: Option<String>,
    /// Why its numbers are to be doubted, see [`crate::verdict`].
    #[serde(default)]
    pub doubt: Option<String>,

    pub cells: u64,
    pub nodes: u64,
    pub dt_s: f64,
    pub steps: u64,
    pub simulated_s: f64,
    /// Wall time of the steps after the first frame, and of everything before [s].
    pub wall_s: f64,
    pub setup_s: f64,
    /// Processor time of all threads during `wall_s` [s].
    pub cpu_s: Option<f64>,
    pub device_bytes: u64,

    pub puncture_force_n: Option<f64>,
    pub puncture_depth_m: Option<f64>,
    pub force_at_max_depth_n: Option<f64>,
    pub max_depth_m: Option<f64>,
    pub energy_imbalance: Option<f64>,
    pub kinetic_to_internal: Option<f64>,
    pub hourglass_to_internal: Option<f64>,
    pub clamped_nodes: u64,
    pub inverted_cells: u64,

    /// Axial force over depth on the way in.
    pub depth_m: Vec<f64>,
    pub force_n: Vec<f64>,
    /// Displacement at the sample points at the deepest point.
    pub displacement_m: Vec<[f64; 3]>,
}

impl RunRecord {
    /// (depth [m], axial force [N]) on the way in.
    pub fn curve(&self) -> Vec<(f64, f64)> {
        self.depth_m.iter().copied().zip(self.force_n.iter().copied()).collect()
    }

    /// Why its numbers mean nothing, where they do not: it ended early or is doubtful.
    pub fn unfit(&self) -> Option<String> {
        if let Some(why) = &self.failure {
            return Some(super::subject::first_line(why));
        }
        self.doubt.as_ref().map(|why| format!("doubtful: {why}"))
    }

    /// Simulated time over wall time.
    pub fn real_time_factor(&self) -> f64 {
        self.simulated_s / self.wall_s.max(1e-9)
    }

    /// Processor time per cell and step [ns]; `None` where it is not known, or less than a tick of 10 ms, by which it is counted.
    pub fn cpu_ns_per_cell_step(&self) -> Option<f64> {
        let cell_steps = self.cells as f64 * self.steps as f64;
        self.cpu_s.filter(|cpu| cell_steps > 0.0 && *cpu > 0.0).map(|cpu| cpu * 1e9 / cell_steps)
    }
}

/// Where the study of a scene of this name goes by itself.
pub fn default_folder(scene: &str) -> PathBuf {
    PathBuf::from(format!("out/study_{}", safe_name(scene)))
}

/// An open folder.
#[derive(Debug, Clone)]
pub struct Store {
    path: PathBuf,
}

impl Store {
    /// Opens or makes the folder. One that holds something else is refused unless `force`, and so is the study of another scene;
    /// with `force` what an earlier study wrote there is removed, and nothing else.
    pub fn open(path: &Path, scene: &str, force: bool) -> Result<Self> {
        let store = Store { path: path.to_path_buf() };
        let unusable = |reason: std::io::Error| {
            Error::input(
                format!("cannot write the study to {}: {reason}", path.display()),
                "give a folder that you may write to with --out",
            )
        };
        fs::create_dir_all(path).map_err(unusable)?;
        if force {
            store.clear().map_err(unusable)?;
        } else {
            match store.plan() {
                Ok(Some(plan)) if plan.scene != scene => {
                    return Err(Error::input(
                        format!("folder {} holds the study of another scene, {}", path.display(), plan.scene),
                        "give another folder with --out, or replace that study with --force",
                    ));
                }
                Ok(Some(_)) => {}
                Ok(None) => {
                    let mut entries = fs::read_dir(path).map_err(unusable)?;
                    if entries.next().is_some() {
                        return Err(Error::input(
                            format!("folder {} is not empty and holds no study", path.display()),
                            "give another folder with --out, or write into this one with --force; nothing of what it holds \
                             is removed",
                        ));
                    }
                }
                Err(error) => return Err(error),
            }
        }
        // Permission bits alone do not tell whether a file system can be written to.
        let probe = path.join(format!(".write_test_{}{}", std::process::id(), whole_file::UNFINISHED));
        fs::write(&probe, b"").and_then(|()| fs::remove_file(&probe)).map_err(unusable)?;
        Ok(store)
    }

    /// A folder that must hold a study.
    ///
    /// # Errors
    /// `Error::Input` where it holds none.
    pub fn existing(path: &Path) -> Result<(Self, Plan)> {
        let store = Store { path: path.to_path_buf() };
        match store.plan()? {
            Some(plan) => Ok((store, plan)),
            None => Err(Error::input(
                format!("{} holds no study: there is no {PLAN}", path.display()),
                "give the folder that `stylet study` wrote with --out",
            )),
        }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The plan; `None` where there is none.
    ///
    /// # Errors
    /// `Error::Input` where the file is no plan of this version.
    pub fn plan(&self) -> Result<Option<Plan>> {
        let path = self.file(PLAN);
        match reading::text(&path, reading::most::OWN) {
            Ok(text) => parse_plan(&path, &text).map(Some),
            Err(unread) if unread.is_missing() => Ok(None),
            Err(unread) => Err(unread.of(&path, "name the folder of a study, which you may read")),
        }
    }

    pub fn write_plan(&self, plan: &Plan) -> Result<()> {
        write_json(&self.file(PLAN), plan)
    }

    fn run_file(&self, id: &str) -> PathBuf {
        self.path.join(RUNS).join(format!("{id}.json"))
    }

    /// A finished run; `None` where it is missing or broken, which a new run mends.
    pub fn run(&self, id: &str) -> Option<RunRecord> {
        let path = self.run_file(id);
        parse_run(&path, &reading::text(&path, reading::most::OWN).ok()?).ok()
    }

    pub fn write_run(&self, run: &RunRecord) -> Result<()> {
        let folder = self.path.join(RUNS);
        fs::create_dir_all(&folder).map_err(|reason| Error::file(folder, reason))?;
        write_json(&self.run_file(&run.id), run)
    }

    /// Removes what studies write.
    fn clear(&self) -> std::io::Result<()> {
        for name in [PLAN, PAGE, TABLE, FIGURES] {
            let path = self.file(name);
            if path.is_file() {
                fs::remove_file(path)?;
            }
        }
        let Ok(entries) = fs::read_dir(self.path.join(RUNS)) else { return Ok(()) };
        for entry in entries {
            let path = entry?.path();
            let ours = path.extension().is_some_and(|e| e == "json")
                && reading::text(&path, reading::most::OWN)
                    .is_ok_and(|text| serde_json::from_str::<RunRecord>(&text).is_ok());
            if ours {
                fs::remove_file(path)?;
            }
        }
        Ok(())
    }
}

/// The plan in a text; `path` stands for its file in messages.
///
/// # Errors
/// `Error::Input` where it is no plan of this version.
pub fn parse_plan(path: &Path, text: &str) -> Result<Plan> {
    serde_json::from_str(text).map_err(|reason| {
        Error::input(
            format!("{} is no plan of a study of this version: {reason}", path.display()),
            "give another folder with --out, or start anew with --force",
        )
    })
}

/// A finished run in a text; `path` stands for its file in messages.
///
/// # Errors
/// `Error::Input` where it is no run of this version.
pub fn parse_run(path: &Path, text: &str) -> Result<RunRecord> {
    serde_json::from_str(text).map_err(|reason| {
        Error::input(format!("{} is no run of a study of this version: {reason}", path.display()), "remove the file")
    })
}

/// Writes a value as JSON, whole or not at all.
pub(super) fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(|e| Error::file(path, std::io::Error::other(e)))?;
    whole_file::write(path, (text + "\n").as_bytes())
}
