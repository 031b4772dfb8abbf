//! The folder that a run writes to, settled before anything is simulated.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::whole_file::UNFINISHED;
use crate::{Error, Result};

/// Names of the single files of a run.
pub const FORCE_TABLE: &str = "force.csv";
pub const ENERGY_TABLE: &str = "energy.csv";
pub const SUMMARY: &str = "summary.json";
pub const FORCE_CHART: &str = "force.svg";
/// Written where there is a tool.
pub const FORCE_PARTS_CHART: &str = "force_parts.svg";
/// Written where faces are driven.
pub const SAMPLE_TABLE: &str = "sample.csv";
/// What the bore of a hollow needle holds, per frame.
pub const CORE_TABLE: &str = "core.csv";
/// Where the targets are, per frame and target; written where the scene has any.
pub const TARGET_TABLE: &str = "targets.csv";
/// What a stopped run goes on from.
pub const CHECKPOINT: &str = "checkpoint.stylet";
pub const SAMPLE_CHART: &str = "sample.svg";
pub const FIELD_COLLECTION: &str = "frames.pvd";
/// Folder of the VTU files `frame_00012.vtu`.
pub const FIELD_FOLDER: &str = "frames";

/// What names of pictures begin with: of stress, and of what lies where in the cut and in three dimensions.
const STRESS: &str = "stress_";
const ANATOMY: &str = "anatomy_";
const BODY: &str = "body_";

const SINGLE_FILES: [&str; 11] = [
    CHECKPOINT,
    FORCE_TABLE,
    ENERGY_TABLE,
    SUMMARY,
    FORCE_CHART,
    FORCE_PARTS_CHART,
    SAMPLE_TABLE,
    CORE_TABLE,
    TARGET_TABLE,
    SAMPLE_CHART,
    FIELD_COLLECTION,
];

/// Where numbered folders go when the user names none.
const DEFAULT_BASE: &str = "out";

/// An existing, writable folder without results of another run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputFolder {
    path: PathBuf,
}

/// The moment that gives a picture its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PictureMoment {
    /// Depth of the tool [m].
    Depth(f64),
    /// Time [s], in a scene without a tool or with a free motion.
    Time(f64),
}

impl PictureMoment {
    /// Name of its first picture, without the ending.
    pub fn picture_stem(self) -> String {
        format!("{STRESS}{}", self.tag())
    }

    /// The moment in the names of files: `12.00mm`, `0.5000s`.
    pub fn tag(self) -> String {
        match self {
            PictureMoment::Depth(depth) => format!("{:05.2}mm", depth * 1e3),
            PictureMoment::Time(time) => format!("{time:.4}s"),
        }
    }
}

impl OutputFolder {
    /// The folder `out`, or without it the next numbered folder `out/<scene>/001`.
    ///
    /// A named folder that holds results is refused unless `force`; then exactly the files that a run writes are
    /// removed, and nothing else.
    pub fn create(out: Option<&Path>, scene_name: &str, force: bool) -> Result<Self> {
        match out {
            Some(path) => Self::create_named(path, force),
            None => Self::create_numbered(Path::new(DEFAULT_BASE), scene_name),
        }
    }

    /// The folder of a run that goes on.
    ///
    /// # Errors
    /// `Error::Input` where it cannot be written to.
    pub fn reopen(path: &Path) -> Result<Self> {
        probe_writable(path)?;
        // What a program that was killed had begun to write is of no use to anybody.
        for folder in [path.to_path_buf(), path.join(FIELD_FOLDER)] {
            for file in files_that(&folder, is_unfinished_file).unwrap_or_default() {
                fs::remove_file(&file).map_err(|reason| not_usable(&file, &reason))?;
            }
        }
        Ok(Self { path: path.to_path_buf() })
    }

    fn create_named(path: &Path, force: bool) -> Result<Self> {
        fs::create_dir_all(path).map_err(|reason| not_usable(path, &reason))?;
        let results = existing_results(path).map_err(|reason| not_usable(path, &reason))?;
        if !results.is_empty() && !force {
            return Err(Error::input(
                format!("folder {} holds results of another run: {}", path.display(), listing(path, &results)),
                "give another folder with --out, leave --out away for a new numbered one, or replace the results with --force",
            ));
        }
        // Before anything is removed: a folder that cannot be written to keeps its results.
        probe_writable(path)?;
        for file in &results {
            fs::remove_file(file).map_err(|reason| not_usable(file, &reason))?;
        }
        let fields = path.join(FIELD_FOLDER);
        if !results.is_empty() && is_empty_folder(&fields) {
            fs::remove_dir(&fields).map_err(|reason| not_usable(&fields, &reason))?;
        }
        Ok(Self { path: path.to_path_buf() })
    }

    /// The next numbered folder `<base>/<scene>/001`, `002`, ... after the highest number that is there.
    pub fn create_numbered(base: &Path, scene_name: &str) -> Result<Self> {
        let parent = base.join(safe_name(scene_name));
        fs::create_dir_all(&parent).map_err(|reason| not_usable(&parent, &reason))?;
        let highest = fs::read_dir(&parent)
            .map_err(|reason| not_usable(&parent, &reason))?
            .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse::<u32>().ok())
            .max()
            .unwrap_or(0);
        for number in highest.saturating_add(1).. {
            let path = parent.join(format!("{number:03}"));
            match fs::create_dir(&path) {
                Ok(()) => {
                    probe_writable(&path)?;
                    return Ok(Self { path });
                }
                // Another run took the number between the look and the call.
                Err(reason) if reason.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(reason) => return Err(not_usable(&path, &reason)),
            }
        }
        Err(Error::input(
            format!("no free number is left in {}", parent.display()),
            "remove old runs, or give a folder with --out",
        ))
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Path of one of the single files.
    pub fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Path of a picture: `stress_12.00mm.png` or `stress_0.5000s.png`; a second picture of the same moment is
    /// `stress_12.00mm_2.png`.
    pub fn picture(&self, moment: PictureMoment) -> PathBuf {
        let stem = moment.picture_stem();
        let mut path = self.path.join(format!("{stem}.png"));
        let mut number = 2;
        while path.exists() {
            path = self.path.join(format!("{stem}_{number}.png"));
            number += 1;
        }
        path
    }

    /// Paths of the pictures of what lies where that belong to a picture of stress: `anatomy_12.00mm.png` and, in three dimensions,
    /// `body_12.00mm.png` to `stress_12.00mm.png`.
    pub fn anatomy_beside(picture: &Path) -> [PathBuf; 2] {
        let name = picture.file_name().map_or_else(Default::default, |name| name.to_string_lossy());
        let moment = name.strip_prefix(STRESS).unwrap_or(&name);
        [ANATOMY, BODY].map(|kind| picture.with_file_name(format!("{kind}{moment}")))
    }

    /// Path of a VTU file relative to the folder, as the collection names it.
    pub fn field_name(frame: u64) -> String {
        format!("{FIELD_FOLDER}/frame_{frame:05}.vtu")
    }
}

fn not_usable(path: &Path, reason: &io::Error) -> Error {
    Error::input(
        format!("cannot write results to {}: {reason}", path.display()),
        "give a folder that you may write to with --out",
    )
}

/// Beginning of the name of a file that only shows that one can be written.
const WRITE_TEST: &str = ".write_test_";

/// What must fit on the disk before a run begins [B]: less than the tables and charts of the shortest run.
const LEAST_SPACE: usize = 16 << 10;

/// Writes and removes a small file: permission bits alone do not tell whether a file system can be written to, nor an empty file
/// whether it is full.
pub(crate) fn probe(path: &Path) -> io::Result<()> {
    let probe = path.join(format!("{WRITE_TEST}{}{UNFINISHED}", std::process::id()));
    let written = fs::write(&probe, [0; LEAST_SPACE]);
    let removed = if probe.exists() { fs::remove_file(&probe) } else { Ok(()) };
    written.and(removed)
}

fn probe_writable(path: &Path) -> Result<()> {
    probe(path).map_err(|reason| match reason.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => Error::input(
            format!("no room for results in {}: {reason}", path.display()),
            "free space on that disk, raise the limit (`ulimit -f`), or give a folder on another disk with --out",
        ),
        _ => not_usable(path, &reason),
    })
}

fn is_empty_folder(path: &Path) -> bool {
    fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

/// Files in the folder that a run writes, sorted.
fn existing_results(path: &Path) -> io::Result<Vec<PathBuf>> {
    let mut results = files_that(path, is_result_file)?;
    let fields = path.join(FIELD_FOLDER);
    if fields.is_dir() {
        results.extend(files_that(&fields, is_field_file)?);
    }
    results.sort();
    Ok(results)
}

fn files_that(path: &Path, wanted: fn(&str) -> bool) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            continue;
        }
        if entry.file_name().to_str().is_some_and(wanted) {
            found.push(entry.path());
        }
    }
    Ok(found)
}

/// A file of a run that was still being written.
fn is_unfinished_file(name: &str) -> bool {
    let ours = |name: &str| is_result_file(name) || is_field_file(name) || name.starts_with(WRITE_TEST);
    name.strip_suffix(UNFINISHED).is_some_and(ours)
}

fn is_result_file(name: &str) -> bool {
    let name = name.strip_suffix(UNFINISHED).unwrap_or(name);
    SINGLE_FILES.contains(&name) || is_picture_file(name) || is_volume_file(name)
}

/// Names of the files that a run writes for a patient, before and behind the moment.
const VOLUME_FILES: [(&str, &str); 4] =
    [("displacement_", ".nrrd"), ("labels_", ".nrrd"), ("needle_", ".mrk.json"), ("targets_", ".mrk.json")];

fn is_volume_file(name: &str) -> bool {
    VOLUME_FILES
        .iter()
        .any(|(begin, end)| name.strip_prefix(begin).and_then(|rest| rest.strip_suffix(end)).is_some_and(is_moment))
}

/// Whether it is `<number>mm` or `<number>s`.
fn is_moment(text: &str) -> bool {
    let number = text.strip_suffix("mm").or_else(|| text.strip_suffix('s'));
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    number.is_some_and(|n| {
        let n = n.strip_prefix('-').unwrap_or(n);
        n.split_once('.').is_some_and(|(whole, part)| digits(whole) && digits(part))
    })
}

/// `stress_<number>mm.png`, `stress_<number>s.png`, with `_<number>` before the ending where a moment repeats; `anatomy_` and `body_`
/// likewise.
fn is_picture_file(name: &str) -> bool {
    let of_run = [STRESS, ANATOMY, BODY].into_iter().find_map(|kind| name.strip_prefix(kind));
    let Some(middle) = of_run.and_then(|rest| rest.strip_suffix(".png")) else {
        return false;
    };
    let (moment, repeat) = match middle.split_once('_') {
        Some((moment, repeat)) => (moment, Some(repeat)),
        None => (middle, None),
    };
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    is_moment(moment) && repeat.is_none_or(digits)
}

fn is_field_file(name: &str) -> bool {
    name.strip_suffix(UNFINISHED)
        .unwrap_or(name)
        .strip_prefix("frame_")
        .and_then(|rest| rest.strip_suffix(".vtu"))
        .is_some_and(|number| number.len() >= 5 && number.bytes().all(|b| b.is_ascii_digit()))
}

/// The first few names for a message.
fn listing(path: &Path, files: &[PathBuf]) -> String {
    const SHOWN: usize = 4;
    let names: Vec<String> =
        files.iter().take(SHOWN).map(|file| file.strip_prefix(path).unwrap_or(file).display().to_string()).collect();
    let more = files.len().saturating_sub(SHOWN);
    if more > 0 { format!("{} and {more} more", names.join(", ")) } else { names.join(", ") }
}

/// A scene name as one folder name: letters, digits, `-`, `_` and inner dots stay, everything else becomes `_`.
pub(crate) fn safe_name(scene_name: &str) -> String {
    let name: String =
        scene_name.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' }).collect();
    match name.trim_matches('.') {
        "" => "scene".to_string(),
        trimmed => trimmed.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_names_are_results() {
        for ours in [
            "force.csv",
            "energy.csv",
            "summary.json",
            "summary.json.part",
            "force.svg",
            "force_parts.svg",
            "core.csv",
            "targets.csv",
            "sample.csv",
            "sample.svg",
            "frames.pvd",
            "stress_06.00mm.png",
            "stress_12.50mm_2.png",
            "stress_-1.00mm.png",
            "stress_0.5000s.png",
            "displacement_12.00mm.nrrd",
            "labels_0.5000s.nrrd",
            "needle_06.00mm.mrk.json",
            "targets_06.00mm.mrk.json.part",
        ] {
            assert!(is_result_file(ours), "{ours}");
        }
        for theirs in [
            "force.csv.bak",
            "my_force.csv",
            "stress_notes.png",
            "anatomy_notes.png",
            "stress_mm.png",
            "labels.nrrd",
            "labels_patient.nrrd",
            "needle_best.mrk.json",
            "stress_6.0mm_final.png",
            "notes.txt",
            "scene.toml",
        ] {
            assert!(!is_result_file(theirs), "{theirs}");
        }
        assert!(is_field_file("frame_00012.vtu"));
        assert!(!is_field_file("frame_best.vtu"));
    }

    #[test]
    fn picture_names_are_recognised_as_results() {
        let folder = OutputFolder { path: PathBuf::from("nowhere") };
        for moment in [
            PictureMoment::Depth(0.006),
            PictureMoment::Depth(-0.00125),
            PictureMoment::Depth(0.12),
            PictureMoment::Time(0.5),
        ] {
            let path = folder.picture(moment);
            let name = path.file_name().unwrap().to_str().unwrap();
            assert!(is_result_file(name), "{name}");
            for (beside, kind) in OutputFolder::anatomy_beside(&path).iter().zip(["anatomy_", "body_"]) {
                let name = beside.file_name().unwrap().to_str().unwrap();
                assert!(name.starts_with(kind) && is_result_file(name), "{name}");
            }
        }
    }

    #[test]
    fn a_scene_name_cannot_leave_the_base_folder() {
        assert_eq!(safe_name("muscle_biopsy"), "muscle_biopsy");
        assert_eq!(safe_name("../../etc"), "_.._etc");
        assert_eq!(safe_name(".."), "scene");
        assert_eq!(safe_name("a b/c"), "a_b_c");
    }
}
