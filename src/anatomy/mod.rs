//! What lies where in a patient: label maps (segmentations) and points as medical programs save them, and how one lies in a scene ([`case`]).
//!
//! `bytes -> format by content -> LabelMap in RAS [m]`: NRRD and 3D Slicer segmentations, NIfTI, MetaImage. [`markups`] has points.

pub mod case;
pub mod colours;
pub mod label_map;
mod layers;
pub mod markups;
mod metaimage;
mod nifti;
mod nifti_names;
mod nrrd;
pub mod surface;
pub mod surface_nets;
mod voxels;
pub mod write_nrrd;

use std::path::Path;

pub use self::case::{Case, Frame};
pub use self::label_map::LabelMap;
use self::voxels::Beside;
use crate::reading::{self, most};
use crate::{Error, Result};

/// A label map from a file and what is to be said about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Labelled {
    /// Labels and where they lie.
    pub map: LabelMap,
    /// Plain sentences on what was found and assumed; empty for a file that needed nothing.
    pub notices: Vec<String>,
}

/// Bytes that tell the format of a file.
const HEAD: u64 = 4096;

const READ_HERE: &str = "save the segmentation as NRRD (.nrrd, .seg.nrrd), NIfTI (.nii, .nii.gz) or MetaImage (.mha, .mhd), e.g. with 3D Slicer";

/// Reads a label map; its content tells the format, not its name. Data in a file beside it is read too.
///
/// # Errors
/// Where the file cannot be read, is of another format, is damaged, or holds no labels.
pub fn read(path: &Path) -> Result<Labelled> {
    let otherwise = "check the name, and that you may read the file";
    let name = path.display().to_string();
    // A large file that is something else is not read as a whole.
    let head = reading::head(path, most::VOLUME, HEAD).map_err(|unread| unread.of(path, otherwise))?;
    Format::of(&name, &head)?;
    let bytes = reading::bytes(path, most::VOLUME).map_err(|unread| unread.of(path, otherwise))?;
    let beside = |other: &str| {
        let path = path.with_file_name(other);
        match reading::bytes(&path, most::VOLUME) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(unread) if unread.is_missing() => Ok(None),
            Err(unread) => Err(unread.of(&path, otherwise)),
        }
    };
    parse_with(&name, &bytes, &beside)
}

/// Reads a label map from memory; `name` stands for the file in messages. A header whose data is in another file is refused.
///
/// # Errors
/// As [`read`].
pub fn parse(name: &str, bytes: &[u8]) -> Result<Labelled> {
    let beside = |other: &str| {
        let message = format!("{name}: the data is in another file, `{}`, which is not at hand", voxels::shown(other));
        Err(Error::input(message, "save header and data as one file (.nrrd, .nii.gz, .mha)"))
    };
    parse_with(name, bytes, &beside)
}

fn parse_with(name: &str, bytes: &[u8], beside: Beside) -> Result<Labelled> {
    let mut labelled = match Format::of(name, &bytes[..bytes.len().min(HEAD as usize)])? {
        Format::Nrrd => nrrd::read(name, bytes, beside),
        Format::Nifti => nifti::read(name, bytes, beside),
        Format::MetaImage => metaimage::read(name, bytes, beside),
    }?;
    if labelled.map.labels.iter().all(|label| *label == 0) {
        labelled.notices.push("No voxel has a label other than 0.".into());
    }
    Ok(labelled)
}

/// The formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Nrrd,
    Nifti,
    MetaImage,
}

impl Format {
    /// The format of a file that begins so.
    fn of(name: &str, head: &[u8]) -> Result<Format> {
        if nrrd::looks_like(head) {
            return Ok(Format::Nrrd);
        }
        if nifti::looks_like(head) {
            return Ok(Format::Nifti);
        }
        if metaimage::looks_like(head) {
            return Ok(Format::MetaImage);
        }
        let fail = |what: &str, way_out: &str| Err(Error::input(format!("{name}: {what}"), way_out));
        let lower = name.to_ascii_lowercase();
        match head {
            [] => fail("the file is empty", "save the segmentation again"),
            [0x1f, 0x8b, ..] => fail(
                "what is compressed here is no NIfTI volume",
                "unpack the file first (gunzip), and name what comes out",
            ),
            head if head.get(128..132) == Some(b"DICM") => fail(
                "this is a DICOM file, which is not read here",
                "load it into 3D Slicer, and export the segmentation as a label map (.nrrd or .nii.gz)",
            ),
            head if head.trim_ascii_start().starts_with(b"{") || head.starts_with(b"# Markups") => {
                fail("these look like points, not a label map", READ_HERE)
            }
            _ if [".img", ".img.gz", ".raw", ".zraw"].iter().any(|end| lower.ends_with(end)) => {
                fail("this is data without its header", "name the header (.hdr, .nhdr or .mhd) that belongs to it")
            }
            _ => fail("this is no volume of a format that is read here", READ_HERE),
        }
    }
}
