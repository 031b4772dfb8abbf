//! Import of tetrahedral meshes: Gmsh (`.msh`), VTK legacy (`.vtk`), VTK XML (`.vtu`) and Abaqus (`.inp`).
//!
//! `bytes -> reader of the format -> RawMesh (what the file says) -> repair (checks, canonical order) -> TetMesh`
//!
//! The canonical order depends on the coordinates alone: the same mesh gives the same `TetMesh` bit for bit,
//! whatever the format and the order of nodes and elements in the file.

mod abaqus;
mod gmsh;
mod include;
mod raw;
mod repair;
pub(crate) mod source;
pub(crate) mod vtk;
pub(crate) mod vtu;

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use super::placement::Placement;
use super::tets::TetMesh;
use crate::reading::{self, Unread};
use crate::{Error, Result};

/// A mesh from a file and what is to be said about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    pub mesh: TetMesh,
    /// Plain sentences on what was found and changed; empty for a file that needed nothing.
    pub notices: Vec<String>,
}

/// How a file is to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImportOptions {
    /// Unit of the coordinates in the file; none of the formats states one.
    pub unit: LengthUnit,
    /// Accept a mesh outside 1 mm .. 1 m, which is otherwise taken for a wrong unit.
    pub accept_size: bool,
    /// Where the mesh is put, behind its unit.
    pub placement: Placement,
}

/// Unit of the coordinates of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum LengthUnit {
    Metre,
    Centimetre,
    Millimetre,
    Micrometre,
    Inch,
}

impl LengthUnit {
    pub const ALL: [LengthUnit; 5] =
        [LengthUnit::Metre, LengthUnit::Centimetre, LengthUnit::Millimetre, LengthUnit::Micrometre, LengthUnit::Inch];

    /// As written in a scene.
    pub fn symbol(self) -> &'static str {
        match self {
            LengthUnit::Metre => "m",
            LengthUnit::Centimetre => "cm",
            LengthUnit::Millimetre => "mm",
            LengthUnit::Micrometre => "um",
            LengthUnit::Inch => "inch",
        }
    }

    /// Length [m]. Powers of ten are divided by, so that 4 mm is the number nearest to 0.004, as if it had been
    /// written in metres.
    pub fn to_metres(self, length: f64) -> f64 {
        match self {
            LengthUnit::Metre => length,
            LengthUnit::Centimetre => length / 1e2,
            LengthUnit::Millimetre => length / 1e3,
            LengthUnit::Micrometre => length / 1e6,
            LengthUnit::Inch => length * 0.0254,
        }
    }
}

impl fmt::Display for LengthUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.symbol())
    }
}

impl FromStr for LengthUnit {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "m" | "metre" | "meter" => Ok(LengthUnit::Metre),
            "cm" | "centimetre" | "centimeter" => Ok(LengthUnit::Centimetre),
            "mm" | "millimetre" | "millimeter" => Ok(LengthUnit::Millimetre),
            "um" | "µm" | "μm" | "micrometre" | "micrometer" => Ok(LengthUnit::Micrometre),
            "in" | "inch" => Ok(LengthUnit::Inch),
            _ => Err(Error::input(
                format!("`{text}` is not a unit of length that is known here"),
                "write one of m, cm, mm, um, inch",
            )),
        }
    }
}

/// Reads a mesh file; a mesh outside 1 mm .. 1 m is refused.
pub fn read(path: &Path, unit: LengthUnit) -> Result<Imported> {
    read_with(path, ImportOptions { unit, accept_size: false, placement: Placement::NONE })
}

/// Reads a mesh file.
pub fn read_with(path: &Path, options: ImportOptions) -> Result<Imported> {
    let unread = |unread| match unread {
        // A name that no mesh has says more than that there is no such file.
        Unread::System(source) => Format::of_name(path).err().unwrap_or_else(|| Error::file(path, source)),
        refused => refused.of(path, ""),
    };
    let name = path.display().to_string();
    // A large file that is something else is not read as a whole.
    let head = reading::head(path, reading::most::MESH, HEAD).map_err(unread)?;
    let format = Format::of(&name, &head)?;
    let bytes = reading::bytes(path, reading::most::MESH).map_err(unread)?;
    if format != Format::Abaqus {
        return parse(&name, &bytes, options);
    }
    let beside = |other: &Path| {
        reading::bytes(&path.with_file_name(other), reading::most::MESH).map_err(|unread| unread.to_string())
    };
    let (text, pieces) = include::expanded(&name, &bytes, &beside, reading::most::MESH)?;
    repair::repair(abaqus::read(&name, &text, pieces)?, options)
}

/// Reads a mesh from memory; `name` stands for the file in messages, its content tells the format. Files that it includes are refused.
pub fn parse(name: &str, bytes: &[u8], options: ImportOptions) -> Result<Imported> {
    let raw = match Format::of(name, bytes)? {
        Format::Gmsh => gmsh::read(name, bytes)?,
        Format::VtkLegacy => vtk::read(name, bytes)?,
        Format::VtkXml => vtu::read(name, bytes)?,
        Format::Abaqus => abaqus::read(name, bytes, Vec::new())?,
    };
    repair::repair(raw, options)
}

/// Bytes that tell the format of a file.
const HEAD: u64 = 4096;

/// The formats that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Gmsh,
    VtkLegacy,
    VtkXml,
    Abaqus,
}

impl Format {
    const ALL: [Format; 4] = [Format::Gmsh, Format::VtkLegacy, Format::VtkXml, Format::Abaqus];

    fn extension(self) -> &'static str {
        match self {
            Format::Gmsh => "msh",
            Format::VtkLegacy => "vtk",
            Format::VtkXml => "vtu",
            Format::Abaqus => "inp",
        }
    }

    fn title(self) -> &'static str {
        match self {
            Format::Gmsh => "a Gmsh mesh",
            Format::VtkLegacy => "a VTK legacy file",
            Format::VtkXml => "a VTK XML file",
            Format::Abaqus => "an Abaqus input file",
        }
    }

    /// The format of a file that begins so. Content decides, not the extension, which tells what is missing where nothing is recognised.
    fn of(name: &str, bytes: &[u8]) -> Result<Format> {
        match Format::ALL.into_iter().find(|format| format.looks_like(bytes)) {
            Some(format) => Ok(format),
            None => Err(Format::of_name(Path::new(name))?.not_found(name, bytes)),
        }
    }

    /// The format that the extension promises.
    fn of_name(path: &Path) -> Result<Format> {
        const READ_HERE: &str =
            "meshes are read from Gmsh .msh (1, 2.2, 4.1), VTK .vtk and .vtu, and Abaqus .inp files";
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
        if let Some(format) = Format::ALL.into_iter().find(|f| f.extension() == extension) {
            return Ok(format);
        }
        let name = path.display();
        Err(match extension.as_str() {
            "" => Error::input(format!("{name}: a file without extension does not tell its format"), READ_HERE),
            "stl" | "obj" | "ply" | "off" | "3mf" => Error::input(
                format!("{name}: .{extension} files hold a surface, not a volume"),
                format!("fill the surface with tetrahedra in a mesh generator; {READ_HERE}"),
            ),
            _ => Error::input(
                format!("{name}: .{extension} is not a mesh format that is read here"),
                format!("convert the file; {READ_HERE}"),
            ),
        })
    }

    /// Whether the first bytes look like this format.
    fn looks_like(self, bytes: &[u8]) -> bool {
        let head = &bytes[..bytes.len().min(HEAD as usize)];
        let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
        let holds = |word: &[u8]| head.windows(word.len()).any(|w| w == word);
        match self {
            Format::Gmsh => head.starts_with(b"$"),
            Format::VtkLegacy => head.len() >= 5 && head[..5].eq_ignore_ascii_case(b"# vtk"),
            Format::VtkXml => head.starts_with(b"<") && holds(b"<VTKFile"),
            Format::Abaqus => head.starts_with(b"*"),
        }
    }

    /// The refusal of a file that is none of the formats, by what its extension promises.
    fn not_found(self, name: &str, bytes: &[u8]) -> Error {
        if bytes.trim_ascii().is_empty() {
            return Error::input(format!("{name}: the file is empty"), "write the mesh again");
        }
        Error::input(
            format!("{name}: this is not {}, which .{} promises", self.title(), self.extension()),
            match self {
                Format::Gmsh => {
                    "a Gmsh mesh starts with $MeshFormat, or $NOD in version 1; .msh files of other programs must be converted"
                }
                Format::VtkLegacy => "a VTK legacy file starts with `# vtk DataFile Version`; write the file again",
                Format::VtkXml => "a .vtu file starts with <VTKFile type=\"UnstructuredGrid\">; write the file again",
                Format::Abaqus => "an Abaqus input file starts with a keyword such as *HEADING or *NODE",
            },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_read_and_converted() {
        for unit in LengthUnit::ALL {
            assert_eq!(unit.symbol().parse::<LengthUnit>().unwrap(), unit);
        }
        assert_eq!(LengthUnit::Millimetre.to_metres(4.0), 0.004);
        assert_eq!(LengthUnit::Inch.to_metres(1.0), 0.0254);
        assert!("km".parse::<LengthUnit>().unwrap_err().to_string().contains("m, cm, mm, um, inch"));
    }
}
