//! Fields for ParaView: `frames/frame_00012.vtu` and the collection `frames.pvd` that puts them on a time axis.
//!
//! Format: VTK XML UnstructuredGrid, version 1.0, hexahedra (type 12), inline base64 of little-endian arrays, each
//! preceded by its length in bytes (UInt64). Points stand at rest; the point vector `displacement_m` moves them
//! (ParaView: filter "Warp By Vector").

use std::path::PathBuf;

use super::folder::{FIELD_COLLECTION, FIELD_FOLDER, OutputFolder};
use crate::mesh::Mesh;
use crate::observables::FieldSnapshot;
use crate::observables::field::{FIELDS, Field, VON_MISES, Values};
use crate::whole_file;
use crate::{Error, Result};

/// VTK cell types of a tetrahedron with four and a hexahedron with eight nodes.
const VTK_TETRAHEDRON: u8 = 10;
const VTK_HEXAHEDRON: u8 = 12;

/// The VTU files of one run and their collection.
#[derive(Debug)]
pub struct FieldFiles {
    folder: OutputFolder,
    /// Names of the materials that the array `material` counts; none: the files do not say them.
    materials: Vec<String>,
    /// Time [s] and relative path of every file so far.
    written: Vec<(f64, String)>,
}

impl FieldFiles {
    /// Nothing is written before the first frame.
    pub fn new(folder: &OutputFolder) -> Self {
        Self { folder: folder.clone(), materials: Vec::new(), written: Vec::new() }
    }

    /// Goes on after the files of a run that was stopped: time [s] and relative path of each.
    pub fn resumed(folder: &OutputFolder, written: Vec<(f64, String)>) -> Self {
        Self { folder: folder.clone(), materials: Vec::new(), written }
    }

    /// The same with the names of the materials, that of the tissue itself first.
    pub fn naming(self, materials: Vec<String>) -> Self {
        Self { materials, ..self }
    }

    /// Time [s] and relative path of every file so far.
    pub fn written(&self) -> &[(f64, String)] {
        &self.written
    }

    /// Writes one frame, then the collection with it; returns the path of the frame.
    pub fn write(&mut self, mesh: &Mesh, snapshot: &FieldSnapshot) -> Result<PathBuf> {
        let fields = self.folder.file(FIELD_FOLDER);
        std::fs::create_dir_all(&fields).map_err(|source| Error::file(&fields, source))?;
        let name = OutputFolder::field_name(snapshot.frame);
        let path = self.folder.file(&name);
        whole_file::write(&path, vtu(mesh, snapshot, &self.materials).as_bytes())?;
        self.written.retain(|(_, other)| *other != name);
        self.written.push((snapshot.time, name));
        whole_file::write(&self.folder.file(FIELD_COLLECTION), collection(&self.written).as_bytes())?;
        Ok(path)
    }
}

/// Text of one VTU file. Empty fields are left out. `materials` are names for the numbers of the array `material`.
pub fn vtu(mesh: &Mesh, snapshot: &FieldSnapshot, materials: &[String]) -> String {
    let nodes = mesh.node_count();
    // Flat cells between the copies of a line are no tissue.
    let shown: Vec<usize> = (0..mesh.cell_count()).filter(|c| mesh.is_tissue(*c)).collect();
    let cells = shown.len();
    assert_eq!(snapshot.displacement.len(), nodes, "a snapshot holds one displacement per node");
    let points = (0..nodes).flat_map(|n| mesh.rest_position(n).to_array());
    let connectivity = shown.iter().flat_map(|c| mesh.cell_nodes(*c).to_vec());
    let (corners, kind) = match mesh {
        Mesh::Block(_) => (8, VTK_HEXAHEDRON),
        Mesh::Tets(_) => (4, VTK_TETRAHEDRON),
    };
    let offsets = (1..=cells).map(|c| corners * c);

    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <UnstructuredGrid>\n",
    );
    if !snapshot.material.is_empty() && !materials.is_empty() {
        text += &names(materials);
    }
    text += &format!("<Piece NumberOfPoints=\"{nodes}\" NumberOfCells=\"{cells}\">\n<Points>\n");
    text += &array("Points", "Float32", 3, floats(points));
    text += "</Points>\n<Cells>\n";
    text += &array("connectivity", "Int32", 1, integers(connectivity));
    text += &array("offsets", "Int32", 1, integers(offsets));
    text += &array("types", "UInt8", 1, vec![kind; cells]);
    text += "</Cells>\n<PointData Vectors=\"displacement_m\">\n";
    for field in &FIELDS {
        let Values::Nodes(of) = field.values else { continue };
        if !of(snapshot).is_empty() {
            text += &array(field.key, "Float32", 3, floats(of(snapshot).iter().flat_map(|u| u.to_array())));
        }
    }
    text += &format!("</PointData>\n<CellData Scalars=\"{}\">\n", VON_MISES.key);
    for Field { key, values, .. } in &FIELDS {
        let Values::Cells(of) = values else { continue };
        let field = of(snapshot);
        if !field.is_empty() {
            assert_eq!(field.len(), mesh.cell_count(), "a snapshot holds one {key} per cell");
            text += &array(key, "Float32", 1, floats(shown.iter().map(|c| field[*c])));
        }
    }
    text += "</CellData>\n</Piece>\n</UnstructuredGrid>\n</VTKFile>\n";
    text
}

/// Text of the collection.
fn collection(frames: &[(f64, String)]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n\
         <Collection>\n",
    );
    for (time, file) in frames {
        text += &format!("<DataSet timestep=\"{time}\" part=\"0\" file=\"{file}\"/>\n");
    }
    text += "</Collection>\n</VTKFile>\n";
    text
}

fn floats(values: impl Iterator<Item = f64>) -> Vec<u8> {
    values.flat_map(|v| (v as f32).to_le_bytes()).collect()
}

fn integers(values: impl Iterator<Item = usize>) -> Vec<u8> {
    values
        .flat_map(|v| i32::try_from(v).expect("a mesh that fits into memory has fewer than 2^31 corners").to_le_bytes())
        .collect()
}

/// One array element; length and data are encoded together.
fn array(name: &str, kind: &str, components: usize, data: Vec<u8>) -> String {
    let mut bytes = (data.len() as u64).to_le_bytes().to_vec();
    bytes.extend(data);
    format!(
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{}</DataArray>\n",
        base64(&bytes)
    )
}

/// Names of the numbers of the array `material` as a comment: texts in field data are refused by meshio.
fn names(materials: &[String]) -> String {
    // Nothing that ends a comment or begins a tag.
    let plain = |name: &str| -> String {
        name.chars().map(|c| if c.is_alphanumeric() || " _.,()%".contains(c) { c } else { '_' }).collect()
    };
    let all: Vec<String> = materials.iter().enumerate().map(|(n, name)| format!("{n} {}", plain(name))).collect();
    format!("<!-- material: {} -->\n", all.join("; "))
}

/// Base64 with padding (RFC 4648, section 4).
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let word = chunk.iter().fold(0u32, |word, &b| word << 8 | u32::from(b)) << (8 * (3 - chunk.len()));
        for digit in 0..4 {
            if digit <= chunk.len() {
                text.push(ALPHABET[(word >> (18 - 6 * digit) & 63) as usize] as char);
            } else {
                text.push('=');
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_end_their_comment() {
        let text = names(&["across-fibre".into(), "a --><b>".into()]);
        assert_eq!(text, "<!-- material: 0 across_fibre; 1 a ____b_ -->\n");
    }

    #[test]
    fn base64_of_the_standard() {
        // RFC 4648, section 10.
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }
}
