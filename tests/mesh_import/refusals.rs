//! Files that are wrong: the message names the place, what is wrong and the way out.

use super::*;

/// The text with one replacement, which must have been there.
#[track_caller]
fn with(text: &str, from: &str, to: &str) -> Vec<u8> {
    assert!(text.contains(from), "`{from}` is not in the sample");
    text.replacen(from, to, 1).into_bytes()
}

fn two_tets() -> String {
    gmsh_text(&TWO_TETS.0, &TWO_TETS.1)
}

const VTK: &str = "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\n\
    POINTS 5 double\n0 0 0\n5 0 0\n0 5 0\n0 0 5\n5 5 5\n\
    CELLS 2 10\n4 0 1 2 3\n4 1 2 3 4\nCELL_TYPES 2\n10\n10\n\
    CELL_DATA 2\nSCALARS region int 1\nLOOKUP_TABLE default\n1\n2\n";

const INP: &str = "*NODE\n1, 0., 0., 0.\n2, 5., 0., 0.\n3, 0., 5., 0.\n4, 0., 0., 5.\n5, 5., 5., 5.D0\n\
    *ELEMENT, TYPE=C3D4, ELSET=all\n1, 1, 2, 3, 4\n2, 2, 3, 4, 5\n*NSET, NSET=held, GENERATE\n1, 3, 2\n";

#[test]
fn the_samples_of_this_file_are_right() {
    for (name, text) in [("a.msh", two_tets().as_str()), ("a.vtk", VTK), ("a.inp", INP)] {
        assert_eq!(parse_text(name, text).unwrap().mesh.tets.len(), 2, "{name}");
    }
    assert_eq!(parse_text("a.inp", INP).unwrap().mesh.node_sets["held"].len(), 2);
}

#[test]
fn what_is_no_mesh() {
    assert_contains(&refusal("mesh", b"x"), &["mesh: a file without extension"]);
    assert_contains(&refusal("a.stl", b"solid"), &["hold a surface, not a volume"]);
    assert_contains(&refusal("a.med", b"x"), &[".med is not a mesh format", ".msh (1, 2.2, 4.1)"]);
    assert_contains(&refusal("a.msh", b"(0 \"fluent\")"), &["starts with $MeshFormat, or $NOD"]);
    assert_contains(&refusal("a.inp", b" \n"), &["the file is empty"]);
    assert!(read(Path::new("/nowhere/a.msh"), LengthUnit::Metre).unwrap_err().to_string().contains("/nowhere/a.msh"));
}

#[test]
fn gmsh() {
    let text = two_tets();
    let refused =
        |from: &str, to: &str, parts: &[&str]| assert_contains(&refusal("a.msh", &with(&text, from, to)), parts);
    refused("2.2 0 8", "1.0 0 8", &["a.msh:2: MSH version 1.0", "Mesh.MshFileVersion = 4.1"]);
    refused("2.2 0 8", "2.2 7 8", &["a.msh:2: file type 7"]);
    refused("2 5 0 0", "2 5 zero 0", &["a.msh:7: coordinate y: `zero` is not a number"]);
    refused("2 5 0 0", "2 5 nan 0", &["a.msh:7: node 2 stands at (5, NaN, 0), which is not finite"]);
    refused("2 5 0 0", "2 5 0", &["a.msh:7: the line ends where coordinate z should stand"]);
    refused("2 5 0 0", "2 5 0 0 0", &["a.msh:7: `0` is more than this line should hold"]);
    refused("2 5 0 0", "1 5 0 0", &["a.msh:7: node 1 stands in the file twice"]);
    refused("$Nodes\n5", "$Nodes\n6", &["a.msh:11: the section ends where a node should stand: its count is larger"]);
    refused("$Nodes\n5", "$Nodes\n4", &["a.msh:10: `5 5 5 5` stands where $EndNodes should stand"]);
    refused("1 1 2 3 4 5", "1 1 2 3 4 8", &["a.msh:15: element 2 names node 8, which is not in the file"]);
    refused("2 4 2", "2 77 2", &["a.msh:15: element type 77"]);
    refused("$EndElements\n", "", &["a.msh:16: the file ends where $EndElements should stand"]);
    refused(
        "$EndNodes\n$Elements",
        "$EndNodes\n$PartitionedEntities\n$Elements",
        &["a.msh:12: the mesh is cut into partitions"],
    );
    assert_contains(&refusal("a.msh", &text.as_bytes()[..140]), &["a.msh:1"]);

    let binary = std::fs::read(folder().join("cube_41_binary.msh")).unwrap();
    assert_contains(&refusal("a.msh", &binary[..3000]), &["a.msh: byte ", "the file ends after"]);
    let nodes = binary.windows(6).position(|w| w == b"$Nodes").unwrap();
    assert_contains(&refusal("a.msh", &binary[..nodes]), &["the file ends without $Nodes"]);
}

/// Version 1: no header, `$NOD` and `$ELM`, the number of nodes in every element.
#[test]
fn gmsh_1() {
    let text = std::fs::read_to_string(folder().join("cube_1_text.msh")).unwrap();
    let refused =
        |from: &str, to: &str, parts: &[&str]| assert_contains(&refusal("a.msh", &with(&text, from, to)), parts);
    refused("$NOD\n", "$NOD\n9", &["the section ends where a node should stand: its count is larger"]);
    refused("$ENDNOD", "$EndNodes", &["`$EndNodes` stands where $ENDNOD should stand"]);
    refused("$ELM", "$Elements", &["$Elements stands in a file of version 1, which has $NOD and $ELM alone"]);
    refused(" 4 2 2 4 ", " 4 2 2 5 ", &["has 5 nodes; tetrahedra of its type have 4"]);
    refused(" 4 2 2 4 ", " 4 2 2 4 7", &["names node 7", "which is not in the file"]);
    assert_contains(&refusal("a.msh", &text.as_bytes()[..text.find("$ELM").unwrap()]), &["the file ends without $ELM"]);
    assert_contains(&refusal("a.msh", b"$NOD\n0\n$ENDNOD\n$ELM\n0\n$ENDELM\n"), &["no tetrahedra"]);
}

#[test]
fn gmsh_elements_that_are_no_four_node_tetrahedra() {
    let third_order = two_tets().replace("1 4 2 1 1 1 2 3 4", &format!("1 29 2 1 1{}", " 1 2 3 4".repeat(5)));
    assert_contains(
        &refusal("a.msh", third_order.as_bytes()),
        &[
            "the file holds 1 tetrahedra of higher order; only tetrahedra with four or ten nodes",
            "Mesh.ElementOrder = 1",
        ],
    );
    let mixed = two_tets().replace("1 4 2 1 1 1 2 3 4", "1 5 2 1 1 1 2 3 4 1 2 3 4");
    assert_contains(
        &refusal("a.msh", mixed.as_bytes()),
        &["mixes 1 tetrahedra with 1 hexahedra, which would leave holes"],
    );
    let surface =
        two_tets().replace("1 4 2 1 1 1 2 3 4", "1 2 2 1 1 1 2 3").replace("2 4 2 1 1 2 3 4 5", "2 2 2 0 1 1 2 3");
    assert_contains(&refusal("a.msh", surface.as_bytes()), &["no tetrahedra, only 1 triangles", "fill the body"]);
}

#[test]
fn vtk() {
    let refused =
        |from: &str, to: &str, parts: &[&str]| assert_contains(&refusal("a.vtk", &with(VTK, from, to)), parts);
    refused("ASCII", "TEXT", &["a.vtk:3: `TEXT` stands where ASCII or BINARY should"]);
    refused("UNSTRUCTURED_GRID", "POLYDATA", &["a.vtk:4: `DATASET POLYDATA` is not an unstructured grid"]);
    refused("0 5 0\n", "0 five 0\n", &["a.vtk:8: a coordinate: `five` is not a number"]);
    refused("0 5 0\n", "0 inf 0\n", &["a.vtk:8: point 2 stands at (0, inf, 0), which is not finite"]);
    refused("POINTS 5", "POINTS 4", &["a.vtk:10: `5` is not a section"]);
    refused("POINTS 5", "POINTS 6", &["a.vtk:11: a coordinate: `CELLS` is not a number"]);
    refused("POINTS 5", "POINTS 99999999999999999999", &["a.vtk:5: the number of points"]);
    refused("POINTS 5", "POINTS 18446744073709551615", &["a.vtk:5: 18446744073709551615 points; at most"]);
    refused("4 1 2 3 4", "4 1 2 3 5", &["cell 1 names point 5, which is not in the file: points are 0 to 4"]);
    refused("4 1 2 3 4", "3 1 2 3 4", &["a.vtk:11: CELLS promises 10 values, but 2 cells take 9"]);
    refused("CELL_TYPES 2\n10\n10", "CELL_TYPES 1\n10", &["a.vtk:15: 2 cells, but 1 cell types"]);
    refused("10\n10\n", "10\n12\n", &["mixes 1 tetrahedra with 1 hexahedra"]);
    refused("10\n10\n", "24\n24\n", &["cell 0 is a tetrahedron with 4 points instead of 10"]);
    refused("10\n10\n", "71\n71\n", &["2 tetrahedra of higher order"]);
    refused("10\n10\n", "12\n12\n", &["no tetrahedra, but 2 hexahedra", "a structured block is made by [tissue]"]);
}

#[test]
fn vtk_regions_are_whole_numbers() {
    let text = VTK.replace("region int", "region double");
    assert_eq!(parse_text("a.vtk", &text).unwrap().mesh.regions.len(), 2);
    let text = text.replace("default\n1\n2", "default\n1\n2.5");
    assert_contains(
        &refusal("a.vtk", text.as_bytes()),
        &["a.vtk:21: region `region` of cell 1 is 2.5, which is no whole number"],
    );
}

#[test]
fn vtu() {
    let text = std::fs::read_to_string(folder().join("cube_text.vtu")).unwrap();
    let refused =
        |from: &str, to: &str, parts: &[&str]| assert_contains(&refusal("a.vtu", &with(&text, from, to)), parts);
    refused("</Points>", "</Point>", &["a.vtu:", "not well-formed XML"]);
    refused(
        "type=\"UnstructuredGrid\"",
        "type=\"PolyData\"",
        &["a.vtu:2: <VTKFile type=\"PolyData\"> is not an unstructured grid"],
    );
    refused(
        "NumberOfPoints=\"93\"",
        "NumberOfPoints=\"92\"",
        &["holds 279 values where 276 are expected from NumberOfPoints"],
    );
    refused("NumberOfCells=\"255\"", "NumberOfCells=\"many\"", &["NumberOfCells=\"many\" is not a whole number"]);
    refused("NumberOfCells=\"255\"", "NumberOfCells=\"18446744073709551615\"", &["values cannot be in a file"]);
    refused("Name=\"types\"", "Name=\"kinds\"", &["<Cells> holds no array `types`"]);
    refused(
        "version=\"0.1\"",
        "compressor=\"vtkLZ4DataCompressor\"",
        &["compression with vtkLZ4DataCompressor is not read here"],
    );
    let packed = std::fs::read_to_string(folder().join("cube_zlib.vtu")).unwrap();
    assert_contains(
        &refusal("a.vtu", &with(&packed, "AQAAAACAAAC4CAAA", "AQAAAACAAAC5CAAA")),
        &["array `Points`: its head tells 1 blocks"],
    );
    let appended = std::fs::read(folder().join("cube_appended_raw.vtu")).unwrap();
    assert_contains(&refusal("a.vtu", &appended[..6000]), &["a.vtu:", "array `"]);
}

#[test]
fn abaqus() {
    let refused =
        |from: &str, to: &str, parts: &[&str]| assert_contains(&refusal("a.inp", &with(INP, from, to)), parts);
    refused("2, 5., 0., 0.", "2, 5., 0.", &["a.inp:3: node 2 has 2 coordinates instead of 3"]);
    refused("2, 5., 0., 0.", "2, 5., x, 0.", &["a.inp:3: a coordinate of node 2: `x` is not a number"]);
    refused("2, 5., 0., 0.", "2, 5., inf, 0.", &["a.inp:3: a coordinate of node 2: inf is not finite"]);
    refused("2, 5., 0., 0.", "1, 5., 0., 0.", &["a.inp:3: node 1 stands in the file twice"]);
    refused("2, 2, 3, 4, 5", "2, 2, 3, 4", &["a.inp:9: element 2 of type C3D4 has 3 nodes instead of 4"]);
    refused("2, 2, 3, 4, 5", "2, 2, 3, 4, 6", &["a.inp:9: element 2 names node 6, which is not in the file"]);
    refused("1, 3, 2\n", "1, 9, 2\n", &["a.inp:11: set held names node 7, which is not in the file"]);
    refused("1, 3, 2\n", "1, 18446744073709551615, 1\n", &["a.inp:11: set held names node 6"]);
    refused("1, 3, 2\n", "1, 3, 0\n", &["a.inp:11: a generated set"]);
    refused(
        "*NSET",
        "*INCLUDE, INPUT=more.inp\n*NSET",
        &["a.inp:10: *INCLUDE, INPUT=more.inp: other files are not read"],
    );
    refused("*NODE", "*NODE, SYSTEM=C", &["a.inp:1: *NODE with cylindrical"]);
    refused("*NODE", "*PART, NAME=a\n*END PART\n*PART, NAME=b\n*NODE", &["a.inp:3: a second part"]);
    refused("*NSET", "*INSTANCE, NAME=i, PART=p\n0., 0., 3.\n*NSET", &["a.inp:11: the instance is shifted"]);
    refused("TYPE=C3D4", "TYPE=C3D10", &["a.inp:8: element 1 of type C3D10 has 4 nodes instead of 10"]);
    refused("TYPE=C3D4", "TYPE=C3D40", &["no tetrahedra, but 2 elements of type C3D40"]);
    refused("TYPE=C3D4", "TYPE=C3D8R", &["no tetrahedra, but 2 elements of type C3D8R"]);
    refused("TYPE=C3D4", "TYPE=S3", &["no tetrahedra, only 2 elements of type S3"]);
}

/// A file that was cut short on its way often goes on as zeros, which would be one endless word.
#[test]
fn zeros_in_a_text() {
    let zeros = "\0".repeat(1 << 20);
    for (name, text) in
        [("a.inp", "*NODE\n".to_string()), ("a.inp", INP.into()), ("a.msh", two_tets()), ("a.vtk", VTK.into())]
    {
        let begin = std::time::Instant::now();
        let message = refusal(name, format!("{text}{zeros}").as_bytes());
        let line = text.lines().count() + 1;
        assert_contains(&message, &[&format!("{name}:{line}: a byte of value 0 stands here")]);
        assert!(begin.elapsed().as_secs() < 2 && message.len() < 500, "{message}");
    }
}

/// Numbers that no engine takes are refused before anything is made of them.
#[test]
fn more_points_than_anybody_computes() {
    let head = "# vtk DataFile Version 3.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\n";
    let message = refusal("a.vtk", format!("{head}POINTS 30000000 float\n").as_bytes());
    assert_contains(&message, &["30000000 points; at most 4194304 are read", "coarser mesh"]);
    let message = refusal("a.vtk", format!("{head}CELLS 30000000 150000000\n").as_bytes());
    assert_contains(&message, &["30000000 cells; at most 4194304 are read"]);
}
