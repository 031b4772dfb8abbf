//! Closed surfaces of triangles from other programs: STL, OBJ, PLY, VTK legacy (`.vtk`) and VTK XML (`.vtp`), told apart by their content.
//!
//! `bytes -> reader of the format -> Draft (what the file says) -> welded surfaces`, which [`check`] looks over, [`inside`] asks for
//! points and [`voxels`] makes a label map of.
//!
//! The formats are read here and not by crates: stl_io 0.11 reads one solid in single precision, and tobj 4.0 and ply-rs-bw 4.0 keep
//! numbers in single precision or a map per vertex, follow the counts of a header instead of the size of the file, and do not tell the
//! line of a number that is none.

#![warn(missing_docs)]

pub mod check;
pub mod inside;
pub mod voxels;

mod draft;
mod obj;
mod ply;
mod stl;
mod tree;
mod vtk;
mod vtp;

use std::path::Path;

use glam::DVec3;

use crate::reading::{self, Unread};
use crate::{Error, Result};
use draft::Draft;

/// A surface of triangles; those of a closed one run counterclockwise when seen from outside.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TriangleSurface {
    /// As the file calls it, or the file itself.
    pub name: String,
    /// Corners [m].
    pub points: Vec<DVec3>,
    /// Indices of three different points each.
    pub triangles: Vec<[u32; 3]>,
}

/// Surfaces from a file and what is to be said about them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Imported {
    /// One per solid, object or group that has triangles, in the order of the file.
    pub surfaces: Vec<TriangleSurface>,
    /// Plain sentences on what was found and changed; empty for a file that needed nothing.
    pub notices: Vec<String>,
}

impl TriangleSurface {
    /// The corners of a triangle [m].
    pub fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|n| self.points[n as usize])
    }

    /// Volume inside [m^3]; negative where the triangles run clockwise. It means something for a closed surface.
    pub fn volume(&self) -> f64 {
        // Tetrahedra from a point close by: from far away they would cancel.
        let middle = self.bounds().map_or(DVec3::ZERO, |(low, high)| 0.5 * (low + high));
        let six = |t| {
            let [a, b, c] = self.corners(t).map(|x| x - middle);
            a.dot(b.cross(c))
        };
        (0..self.triangles.len()).map(six).sum::<f64>() / 6.0
    }

    /// Area [m^2].
    pub fn area(&self) -> f64 {
        let twice = |t| {
            let [a, b, c] = self.corners(t);
            (b - a).cross(c - a).length()
        };
        0.5 * (0..self.triangles.len()).map(twice).sum::<f64>()
    }

    /// Lowest and highest coordinates [m]; `None` without points.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let first = *self.points.first()?;
        Some(self.points.iter().fold((first, first), |(low, high), x| (low.min(*x), high.max(*x))))
    }
}

/// Reads a file whose coordinates are in a unit of `unit_m` metres.
///
/// # Errors
/// As [`parse`], and where there is no file that can be read.
pub fn read(path: &Path, unit_m: f64) -> Result<Imported> {
    let bytes = reading::bytes(path, reading::most::MESH).map_err(|unread| match unread {
        Unread::System(source) => Error::file(path, source),
        refused => refused.of(path, ""),
    })?;
    parse(&path.display().to_string(), &bytes, unit_m)
}

/// Reads a file from memory; `name` stands for it in messages and names a surface that has no name.
///
/// # Errors
/// Where it is none of the formats, breaks its own, or holds coordinates that are no places.
pub fn parse(name: &str, bytes: &[u8], unit_m: f64) -> Result<Imported> {
    if !(1e-9..=1e3).contains(&unit_m) {
        return Err(Error::input(
            format!("{name}: a unit of {unit_m:e} m is none"),
            "give the length of a unit of the file in metres, such as 0.001 for millimetres",
        ));
    }
    let draft: Draft = match Format::of(name, bytes)? {
        Format::BinaryStl => stl::binary(name, bytes)?,
        Format::TextStl => stl::text(name, bytes)?,
        Format::Obj => obj::read(name, bytes)?,
        Format::Ply => ply::read(name, bytes)?,
        Format::Vtk => vtk::read(name, bytes)?,
        Format::Vtp => vtp::read(name, bytes)?,
    };
    draft.finish(name, unit_m)
}

/// The formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    BinaryStl,
    TextStl,
    Obj,
    Ply,
    Vtk,
    Vtp,
}

const READ_HERE: &str = "export the surface as STL, OBJ, PLY or VTK (.vtk, .vtp)";

impl Format {
    /// The format of the content: extensions lie, and a binary STL file may begin as one in text.
    fn of(name: &str, bytes: &[u8]) -> Result<Format> {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
        let begins = |word: &[u8]| text.len() >= word.len() && text[..word.len()].eq_ignore_ascii_case(word);
        if text.is_empty() {
            return Err(Error::input(format!("{name}: the file is empty"), "write the surface again"));
        }
        let promised = stl::promised(bytes);
        if promised == Some(bytes.len() as u64) {
            return Ok(Format::BinaryStl);
        }
        let head = &text[..text.len().min(4096)];
        if begins(b"ply\n") || begins(b"ply\r") {
            return Ok(Format::Ply);
        }
        if begins(b"# vtk") {
            return Ok(Format::Vtk);
        }
        if begins(b"<") && head.windows(8).any(|w| w == b"<VTKFile") {
            return Ok(Format::Vtp);
        }
        let known = [
            (&b"OFF"[..], "an OFF file"),
            (b"PK\x03\x04", "an archive, such as 3MF"),
            (b"glTF", "a glTF file"),
            (b"NRRD", "a volume"),
            (b"$MeshFormat", "a Gmsh mesh"),
        ];
        if let Some((_, title)) = known.iter().find(|(begin, _)| begins(begin)) {
            return Err(Error::input(
                format!("{name}: this is {title}, not a surface of a kind that is read here"),
                READ_HERE,
            ));
        }
        if !head.contains(&0) {
            if begins(b"solid") {
                return Ok(Format::TextStl);
            }
            if obj::looks_like(text) {
                return Ok(Format::Obj);
            }
        }
        // Some writers leave something behind the triangles.
        if promised.is_some_and(|length| length > stl::HEAD && length < bytes.len() as u64) {
            return Ok(Format::BinaryStl);
        }
        let as_stl = promised.map_or(String::new(), |length| {
            let triangles = (length - stl::HEAD) / stl::TRIANGLE;
            format!(
                "; as a binary STL file it would promise {triangles} triangles in {length} bytes, but it has {} bytes",
                bytes.len()
            )
        });
        Err(Error::input(
            format!("{name}: this is no surface of a kind that is read here{as_stl}"),
            format!("{READ_HERE}; if it is one of them, write it again: it was cut short or damaged"),
        ))
    }
}
