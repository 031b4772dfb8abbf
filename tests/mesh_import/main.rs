//! Import of tetrahedral meshes: the same mesh in every format, wrong files, damaged files.

use std::path::{Path, PathBuf};

use stylet::mesh::Placement;
use stylet::mesh::import::{ImportOptions, Imported, LengthUnit, parse, read, read_with};
use stylet::mesh::tets::TetMesh;

mod damage;
mod formats;
mod refusals;
mod repairs;

const MILLIMETRES: ImportOptions =
    ImportOptions { unit: LengthUnit::Millimetre, accept_size: false, placement: Placement::NONE };

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes")
}

/// All files of the sample cube.
fn samples() -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder())
        .expect("the folder of samples is part of the repository")
        .map(|entry| entry.expect("the folder of samples can be listed").path())
        .filter(|path| path.extension().is_some_and(|e| ["msh", "vtk", "vtu", "inp"].iter().any(|known| e == *known)))
        .collect();
    files.sort();
    files
}

/// Reads a text in millimetres as if it were a file.
fn parse_text(name: &str, text: &str) -> stylet::Result<Imported> {
    parse(name, text.as_bytes(), MILLIMETRES)
}

/// The message of a file that must be refused.
#[track_caller]
fn refusal(name: &str, bytes: &[u8]) -> String {
    match parse(name, bytes, MILLIMETRES) {
        Ok(_) => panic!("{name} should have been refused"),
        Err(error) => {
            assert_eq!(error.exit_code(), 2, "a wrong file is the user's to mend: {error}");
            let message = error.to_string();
            assert!(message.contains("way out: "), "{message}");
            message
        }
    }
}

#[track_caller]
fn assert_contains(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

/// A Gmsh file with the given nodes (ids from 1) and tetrahedra.
fn gmsh_text(nodes: &[[f64; 3]], tets: &[[usize; 4]]) -> String {
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.len());
    for (id, [x, y, z]) in (1..).zip(nodes) {
        text += &format!("{id} {x} {y} {z}\n");
    }
    text += &format!("$EndNodes\n$Elements\n{}\n", tets.len());
    for (id, [a, b, c, d]) in (1..).zip(tets) {
        text += &format!("{id} 4 2 1 1 {a} {b} {c} {d}\n");
    }
    text + "$EndElements\n"
}

/// Two tetrahedra with a common face, in mm.
const TWO_TETS: ([[f64; 3]; 5], [[usize; 4]; 2]) = (
    [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 5.0], [5.0, 5.0, 5.0]],
    [[1, 2, 3, 4], [2, 3, 4, 5]],
);

fn total_volume(mesh: &TetMesh) -> f64 {
    (0..mesh.tets.len()).map(|t| mesh.volume(t)).sum()
}
