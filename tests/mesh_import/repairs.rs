//! What is repaired, and what is refused because a repair would change the tissue.

use super::*;

fn two() -> (Vec<[f64; 3]>, Vec<[usize; 4]>) {
    (TWO_TETS.0.to_vec(), TWO_TETS.1.to_vec())
}

#[test]
fn inverted_tetrahedra_are_turned() {
    let (nodes, mut tets) = two();
    tets[0].swap(0, 1);
    let turned = parse_text("a.msh", &gmsh_text(&nodes, &tets)).unwrap();
    // One of the two is inverted as written above, too.
    assert_contains(&turned.notices.join("\n"), &["inverted and turned."]);
    assert_eq!(turned.mesh, parse_text("a.msh", &gmsh_text(&nodes, &TWO_TETS.1)).unwrap().mesh);
    assert!((0..2).all(|t| turned.mesh.volume(t) > 0.0));
}

#[test]
fn flat_tetrahedra_are_refused_by_name() {
    let (mut nodes, mut tets) = two();
    nodes.push([2.5, 2.5, 0.0]);
    tets.push([1, 2, 3, 6]);
    assert_contains(
        &refusal("a.msh", gmsh_text(&nodes, &tets).as_bytes()),
        &["a.msh: element 3 (nodes 1, 2, 3, 6) has no volume", "Optimize 3D"],
    );
}

#[test]
fn nodes_at_one_place_are_merged() {
    let (mut nodes, mut tets) = two();
    nodes.push([5.0, 0.0, 1e-9]);
    tets[1][0] = 6;
    let imported = parse_text("a.msh", &gmsh_text(&nodes, &tets)).unwrap();
    assert_eq!(imported.mesh.positions.len(), 5);
    assert_contains(&imported.notices.join("\n"), &["1 node merged with another at the same place"]);
    // Ten thousand times further apart they are two nodes.
    nodes[5][2] = 1e-5;
    assert_eq!(parse_text("a.msh", &gmsh_text(&nodes, &tets)).unwrap().mesh.positions.len(), 6);
    // Within one tetrahedron a merger would take its volume.
    nodes[5] = nodes[2];
    tets[1][0] = 2;
    tets.push([1, 3, 6, 4]);
    assert_contains(
        &refusal("a.msh", gmsh_text(&nodes, &tets).as_bytes()),
        &["element 3 (nodes 1, 3, 6, 4) collapses"],
    );
}

#[test]
fn repeated_elements_and_overlaps_are_refused() {
    let (mut nodes, mut tets) = two();
    tets.push([4, 3, 2, 1]);
    assert_contains(
        &refusal("a.msh", gmsh_text(&nodes, &tets).as_bytes()),
        &["element 3 (nodes ", "is the same tetrahedron as element 1", "several physical groups"],
    );
    nodes.push([4.0, 4.0, 3.0]);
    tets[2] = [2, 3, 4, 6];
    assert_contains(&refusal("a.msh", gmsh_text(&nodes, &tets).as_bytes()), &["elements 1, 2, 3 share one face"]);
    tets[2] = [1, 2, 2, 6];
    assert_contains(&refusal("a.msh", gmsh_text(&nodes, &tets).as_bytes()), &["names a node twice"]);
}

#[test]
fn slivers_and_loose_pieces_are_noticed() {
    let (mut nodes, mut tets) = two();
    nodes.extend([[20.0, 0.0, 0.0], [25.0, 0.0, 0.0], [20.0, 5.0, 0.0], [21.0, 1.0, 0.05]]);
    tets.push([6, 7, 8, 9]);
    let notices = parse_text("a.msh", &gmsh_text(&nodes, &tets)).unwrap().notices.join("\n");
    assert_contains(
        &notices,
        &["1 of 3 tetrahedra are slivers", "altitude of 5.00e-2 mm bounds the time step", "falls into 2 pieces"],
    );
    // Joined by a single node.
    tets[2] = [5, 7, 8, 9];
    let notices = parse_text("a.msh", &gmsh_text(&nodes, &tets)).unwrap().notices.join("\n");
    assert_contains(&notices, &["2 parts of the mesh hang together by single nodes or edges only"]);
    assert!(!notices.contains("falls into"));
}

#[test]
fn a_wrong_unit_is_guessed() {
    let path = folder().join("cube_zlib.vtu");
    let message = |unit| read(&path, unit).unwrap_err().to_string();
    assert_contains(
        &message(LengthUnit::Metre),
        &[
            "cube_zlib.vtu: the mesh is 34.6 m across when its unit is m",
            "1000 times too large: did you mean unit = \"mm\"?",
        ],
    );
    assert_contains(
        &message(LengthUnit::Micrometre),
        &["1000 times too small: did you mean unit = \"mm\"?", "accept_size = true"],
    );
    let accepted =
        read_with(&path, ImportOptions { unit: LengthUnit::Metre, accept_size: true, ..MILLIMETRES }).unwrap();
    assert!((total_volume(&accepted.mesh) - 8e3).abs() < 1e-6);
    // A cube of 1e-7 m^3 is small, but tissue.
    let (nodes, tets) = two();
    let mut small = nodes.clone();
    small.iter_mut().flatten().for_each(|x| *x *= 0.928);
    assert!(parse_text("a.msh", &gmsh_text(&small, &tets)).is_ok());
}
