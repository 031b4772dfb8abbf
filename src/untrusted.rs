//! Every reader of what others wrote, one function from bytes in memory each: what fuzzers call.
//!
//! A reader takes any bytes and gives a value or a message with the way out; it never panics, and never allocates more than
//! [`Reader::memory`] says. The targets in `fuzz/` and `tests/fuzz.rs` call [`Reader::survives`], nothing else.

use std::path::Path;

use crate::anatomy::{self, markups};
use crate::error::{Error, Result};
use crate::material::curves;
use crate::mesh::Placement;
use crate::mesh::import::{self, ImportOptions, LengthUnit};
use crate::output::checkpoint::RunCheckpoint;
use crate::output::report::Columns;
use crate::scene::{Scene, presets};
use crate::session::Session;
use crate::study::store;
use crate::training::{history, notes, trainees};

/// One kind of input.
#[derive(Debug, Clone, Copy)]
pub struct Reader {
    /// Name of the fuzz target.
    pub name: &'static str,
    read: fn(&[u8]) -> Result<()>,
    /// Most memory at once: fixed part [B], and part per byte of the input.
    memory: (usize, usize),
}

/// What any reader may take for messages and buffers [B].
const FEW: usize = 256 << 10;

/// The grid lines of the finest block along three axes of a metre, several times over [B].
const GRID_LINES: usize = 192 << 20;

/// Deflate makes at most 1032 bytes of one; the values in a message take at most four times its bytes, and a vector that grows is
/// there three times over.
const UNPACKED: usize = 1032 * 4 * 3;

/// A vector whose damaged length promises much is given up to 1 MiB before its values are read; a few are open at once [B].
const PROMISED: usize = 4 << 20;

/// The tables of a bzip2 decoder for the largest block, and what a stream is unpacked in [B].
const BZIP2: usize = 8 << 20;

/// Bzip2 is let make at most 65536 bytes of one; a label of two bytes comes of each. A bit says where layers overlap, and text is there
/// a few times over.
const VOLUME: usize = 65536 * 9 / 4;

/// All readers.
pub const READERS: &[Reader] = &[
    Reader { name: "scene", read: scene, memory: (GRID_LINES, 1024) },
    Reader { name: "overrides", read: overrides, memory: (GRID_LINES, 1024) },
    Reader { name: "materials", read: materials, memory: (FEW, 256) },
    Reader { name: "predictions", read: predictions, memory: (FEW, 256) },
    Reader { name: "gmsh", read: gmsh, memory: (FEW, 128) },
    // Arrays of XML may be compressed; what they unpack to must agree with the counts of the file. A .vtk file may hold XML, too.
    Reader { name: "vtk", read: vtk, memory: (FEW, UNPACKED) },
    Reader { name: "vtu", read: vtu, memory: (FEW, UNPACKED) },
    // A surface may be XML with such arrays.
    Reader { name: "surface", read: surface, memory: (FEW, UNPACKED) },
    Reader { name: "abaqus", read: abaqus, memory: (FEW, 128) },
    Reader { name: "checkpoint", read: checkpoint, memory: (PROMISED, UNPACKED) },
    Reader { name: "checkpoint_message", read: checkpoint_message, memory: (PROMISED, 32) },
    Reader { name: "curves", read: curves, memory: (FEW, 128) },
    Reader { name: "run_table", read: run_table, memory: (FEW, 128) },
    Reader { name: "study_plan", read: study_plan, memory: (FEW, 128) },
    Reader { name: "study_run", read: study_run, memory: (FEW, 128) },
    Reader { name: "attempt", read: attempt, memory: (FEW, 128) },
    Reader { name: "notes", read: notes_of_an_attempt, memory: (FEW, 128) },
    Reader { name: "trainee", read: trainee, memory: (FEW, 256) },
    Reader { name: "session", read: session, memory: (FEW, 128) },
    // Each tells its format from the content: a file for one of them may be NRRD, which alone may be compressed with bzip2.
    Reader { name: "nrrd", read: nrrd, memory: (FEW + BZIP2, VOLUME) },
    Reader { name: "nifti", read: nifti, memory: (FEW + BZIP2, VOLUME) },
    Reader { name: "metaimage", read: metaimage, memory: (FEW + BZIP2, VOLUME) },
    Reader { name: "markups", read: points, memory: (FEW, 256) },
    #[cfg(feature = "cli")]
    Reader { name: "label_names", read: label_names, memory: (FEW, 256) },
    // A body that is kept has at most 128 KiB, however much is promised; the others are skipped.
    #[cfg(feature = "link")]
    Reader { name: "link", read: link, memory: (FEW, 8) },
    #[cfg(feature = "link")]
    Reader { name: "link_message", read: link_message, memory: (FEW, 8) },
];

impl Reader {
    /// The reader of this name.
    pub fn named(name: &str) -> Option<&'static Reader> {
        READERS.iter().find(|reader| reader.name == name)
    }

    /// Most memory that reading `length` bytes may take at once [B].
    pub fn memory(&self, length: usize) -> usize {
        self.memory.0 + self.memory.1 * length
    }

    /// Reads the bytes; true where they mean something.
    ///
    /// # Panics
    /// Where a refusal is not one that helps: wrong input without a way out, or a message longer than it is read.
    pub fn survives(&self, bytes: &[u8]) -> bool {
        match (self.read)(bytes) {
            Ok(()) => true,
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("way out"), "{}: no way out in: {text}", self.name);
                assert!(text.len() < 8_000, "{}: {} bytes of message", self.name, text.len());
                assert!(
                    matches!(error, Error::Scene(_) | Error::Input { .. }),
                    "{}: not told as wrong input: {text}",
                    self.name
                );
                false
            }
        }
    }
}

/// The folder of files that others wrote does not exist: what a scene names beside itself is not there.
fn place(name: &str) -> std::path::PathBuf {
    Path::new("no-such-folder").join(name)
}

fn text(bytes: &[u8]) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|reason| Error::input(format!("no text: {reason}"), "save the file as UTF-8"))
}

fn scene(bytes: &[u8]) -> Result<()> {
    Scene::parse(&place("scene.toml"), text(bytes)?, &[]).map(drop)
}

/// One `--set` per line, for a scene with a needle.
fn overrides(bytes: &[u8]) -> Result<()> {
    const SCENE: &str = include_str!("../scenes/muscle_biopsy.toml");
    let overrides: Vec<String> = text(bytes)?.lines().map(str::to_string).collect();
    Scene::parse(&place("scene.toml"), SCENE, &overrides).map(drop)
}

fn predictions(bytes: &[u8]) -> Result<()> {
    crate::predictions::file::parse(&place("predictions.toml"), text(bytes)?).map(drop).map_err(Error::Scene)
}

#[cfg(feature = "cli")]
fn label_names(bytes: &[u8]) -> Result<()> {
    crate::commands::import::names::parse("names.txt", text(bytes)?).map(drop)
}

fn materials(bytes: &[u8]) -> Result<()> {
    presets::parse_library(&place("materials.toml"), text(bytes)?).map(drop)
}

fn mesh(name: &str, bytes: &[u8]) -> Result<()> {
    let options = ImportOptions { unit: LengthUnit::Millimetre, accept_size: false, placement: Placement::NONE };
    let mesh = import::parse(name, bytes, options)?.mesh;
    let nodes = mesh.positions.len();
    assert!(mesh.tets.iter().flatten().all(|n| (*n as usize) < nodes), "a corner is no node");
    assert!(mesh.tags.iter().all(|t| (*t as usize) < mesh.regions.len()), "a tag is no region");
    assert!((0..mesh.tets.len()).all(|t| mesh.volume(t) > 0.0), "a tetrahedron has no volume");
    Ok(())
}

fn gmsh(bytes: &[u8]) -> Result<()> {
    mesh("mesh.msh", bytes)
}

fn vtk(bytes: &[u8]) -> Result<()> {
    mesh("mesh.vtk", bytes)
}

fn vtu(bytes: &[u8]) -> Result<()> {
    mesh("mesh.vtu", bytes)
}

fn abaqus(bytes: &[u8]) -> Result<()> {
    mesh("mesh.inp", bytes)
}

fn surface(bytes: &[u8]) -> Result<()> {
    for surface in crate::anatomy::surface::parse("surface", bytes, 1e-3)?.surfaces {
        let points = surface.points.len();
        assert!(surface.triangles.iter().flatten().all(|n| (*n as usize) < points), "a corner is no point");
        assert!(surface.triangles.iter().all(|[a, b, c]| a != b && b != c && c != a), "a triangle has two corners");
        assert!(surface.points.iter().all(|x| x.is_finite()), "a point is nowhere");
    }
    Ok(())
}

fn checkpoint(bytes: &[u8]) -> Result<()> {
    RunCheckpoint::from_bytes(&place("checkpoint.stylet"), bytes).map(drop)
}

/// What a checkpoint holds once it is unpacked: its checksum keeps damage from getting here.
fn checkpoint_message(bytes: &[u8]) -> Result<()> {
    RunCheckpoint::from_message(&place("checkpoint.stylet"), bytes).map(drop)
}

fn curves(bytes: &[u8]) -> Result<()> {
    curves::parse_curves(&place("curve.csv"), bytes.to_vec()).map(drop)
}

fn run_table(bytes: &[u8]) -> Result<()> {
    let table = Columns::parse(&place("force.csv"), bytes)?;
    let way_in = table.curve("axial_force_n");
    assert!(way_in.is_sorted_by(|a, b| a.0 < b.0), "the way in goes back");
    Ok(())
}

fn study_plan(bytes: &[u8]) -> Result<()> {
    store::parse_plan(&place("plan.json"), text(bytes)?).map(drop)
}

fn study_run(bytes: &[u8]) -> Result<()> {
    let run = store::parse_run(&place("run.json"), text(bytes)?)?;
    run.unfit();
    run.cpu_ns_per_cell_step();
    run.curve();
    Ok(())
}

fn notes_of_an_attempt(bytes: &[u8]) -> Result<()> {
    notes::parse(&place("attempt.notes"), bytes).map(drop)
}

fn trainee(bytes: &[u8]) -> Result<()> {
    trainees::parse(&place("trainee.toml"), text(bytes)?).map(drop)
}

fn attempt(bytes: &[u8]) -> Result<()> {
    let attempt = history::parse(&place("attempt.json"), bytes)?;
    attempt.score.text();
    attempt.score.csv();
    Ok(())
}

fn session(bytes: &[u8]) -> Result<()> {
    Session::from_bytes(&place("session.json"), bytes)?;
    Ok(())
}

fn volume(name: &str, bytes: &[u8]) -> Result<()> {
    let map = anatomy::parse(name, bytes)?.map;
    assert!(map.labels.len() == map.size.iter().product::<usize>(), "a voxel has no label");
    assert!(map.steps.determinant().abs() > 0.0 && map.origin.is_finite(), "a voxel has no volume or no place");
    assert!(map.position(0, 0, 0).is_finite() && map.spacing().min_element() > 0.0, "voxels are nowhere");
    Ok(())
}

fn nrrd(bytes: &[u8]) -> Result<()> {
    volume("volume.nrrd", bytes)
}

fn nifti(bytes: &[u8]) -> Result<()> {
    volume("volume.nii.gz", bytes)
}

fn metaimage(bytes: &[u8]) -> Result<()> {
    volume("volume.mha", bytes)
}

fn points(bytes: &[u8]) -> Result<()> {
    let points = markups::parse("points.mrk.json", bytes)?;
    assert!(points.iter().all(|point| point.position.is_finite()), "a point is nowhere");
    Ok(())
}

/// What a client of the OpenIGTLink server may send: messages until the bytes end.
#[cfg(feature = "link")]
fn link(bytes: &[u8]) -> Result<()> {
    crate::link::read::all(bytes, true).map(drop)
}

/// What such messages hold: their checksums keep damage from getting here.
#[cfg(feature = "link")]
fn link_message(bytes: &[u8]) -> Result<()> {
    crate::link::read::all(bytes, false).map(drop)
}
