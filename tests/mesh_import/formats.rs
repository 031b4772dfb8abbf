//! Every format and variant that is read.

use super::*;

/// What the importers must agree on to the last bit; names and node sets are not known to every format.
fn geometry(mesh: &TetMesh) -> (Vec<[u64; 3]>, &[[u32; 4]], &[u32]) {
    (mesh.positions.iter().map(|x| x.to_array().map(f64::to_bits)).collect(), &mesh.tets, &mesh.tags)
}

#[test]
fn one_mesh_through_every_importer_is_one_mesh() {
    let files = samples();
    assert!(files.len() >= 20, "{} samples", files.len());
    let reference = read(&folder().join("cube_41_text.msh"), LengthUnit::Millimetre).unwrap().mesh;
    assert_eq!((reference.positions.len(), reference.tets.len(), reference.regions.len()), (93, 255, 2));
    assert!((total_volume(&reference) - 8e-6).abs() < 1e-18);
    for file in files {
        let imported = read(&file, LengthUnit::Millimetre).unwrap_or_else(|e| panic!("{e}"));
        assert!(geometry(&imported.mesh) == geometry(&reference), "{} differs", file.display());
        assert_eq!(imported.mesh.regions.len(), 2, "{}", file.display());
        let layers = [0, 1].map(|r| imported.mesh.region_volume(r));
        let lower = usize::from(layers[1] < layers[0]);
        assert!((layers[lower] - 3.2e-6).abs() < 1e-17, "{}: {layers:?}", file.display());
    }
}

#[test]
fn the_comparison_notices_a_moved_node() {
    let read = |text: &str| parse_text("cube.msh", text).unwrap().mesh;
    let text = std::fs::read_to_string(folder().join("cube_22_text.msh")).unwrap();
    let moved = text.replacen("\n1 -10 -10 -20\n", "\n1 -10 -10 -20.000000000000004\n", 1);
    assert_ne!(text, moved);
    assert!(geometry(&read(&text)) != geometry(&read(&moved)));
}

#[test]
fn formats_with_names_keep_them() {
    for file in ["cube_41_text.msh", "cube_41_binary.msh", "cube_22_text.msh", "cube_22_binary.msh", "cube_part.inp"] {
        let mesh = read(&folder().join(file), LengthUnit::Millimetre).unwrap().mesh;
        let mut regions = mesh.regions.clone();
        regions.sort_by_key(|r| r.to_lowercase());
        assert!(regions[0].eq_ignore_ascii_case("lower") && regions[1] == "upper", "{file}: {regions:?}");
        assert_eq!(mesh.node_sets.keys().collect::<Vec<_>>(), ["floor", "top"], "{file}");
        for (name, z) in [("floor", -0.02), ("top", 0.0)] {
            let expected: Vec<u32> =
                (0..).zip(&mesh.positions).filter(|(_, x)| x.z == z).map(|(index, _)| index).collect();
            assert_eq!(mesh.node_sets[name], expected, "{file}, {name}");
        }
    }
    let mesh = read(&folder().join("cube_51_binary.vtk"), LengthUnit::Millimetre).unwrap().mesh;
    let mut regions = mesh.regions;
    regions.sort();
    assert_eq!(regions, ["region-1", "region-2"]);
}

/// VTK's own programs write XML under .vtk, and others the reverse: the content says which it is.
#[test]
fn the_content_tells_the_format() {
    for (file, name) in [
        ("cube_text.vtu", "a.vtk"),
        ("cube_zlib.vtu", "a.inp"),
        ("cube_51_text.vtk", "a.msh"),
        ("cube_part.inp", "a.vtu"),
        ("cube_1_text.msh", "mesh"),
        ("cube_41_binary.msh", "a.stl"),
    ] {
        let bytes = std::fs::read(folder().join(file)).unwrap();
        let under = |name: &str| parse(name, &bytes, MILLIMETRES).unwrap_or_else(|e| panic!("{e}")).mesh;
        assert!(under(name) == under(file), "{file} as {name}");
        // From the disk only the head is looked at before the whole is read.
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join(name);
        std::fs::write(&path, &bytes).unwrap();
        let read = read_with(&path, MILLIMETRES).unwrap_or_else(|e| panic!("{e}")).mesh;
        assert!(read == under(file), "{file} as {name} on disk");
    }
}

#[test]
fn notices_say_what_was_changed() {
    let notices = |file: &str| read(&folder().join(file), LengthUnit::Millimetre).unwrap().notices.join("\n");
    assert_eq!(notices("cube_41_binary.msh"), "");
    assert_contains(
        &notices("cube_disordered.msh"),
        &["4 nodes of no tetrahedron dropped.", "90 nodes merged with another", "tetrahedra were inverted and turned."],
    );
    assert_contains(&notices("cube_gmsh_text.vtk"), &["52 triangles carry no tissue and are left out."]);
    assert_contains(
        &notices("cube_gmsh.inp"),
        &["255 elements are in several sets; the set listed last is their region.", "52 elements of type CPS3"],
    );
}

#[test]
fn the_block_of_the_references() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/references/block5_tet4.vtk");
    let Imported { mesh, notices } = read(&path, LengthUnit::Metre).unwrap();
    assert_eq!((mesh.positions.len(), mesh.tets.len()), (216, 750));
    assert!((total_volume(&mesh) - 8e-6).abs() < 1e-18);
    assert_eq!(mesh.regions, ["region-0"]);
    assert!((0..750).all(|t| mesh.volume(t) > 0.0));
    assert_eq!(notices, Vec::<String>::new());
}

#[test]
fn the_forearm() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/meshes/forearm.msh");
    let Imported { mesh, notices } = read(&path, LengthUnit::Millimetre).unwrap();
    assert_eq!(notices, Vec::<String>::new());
    let mut regions = mesh.regions.clone();
    regions.sort();
    assert_eq!(regions, ["fat", "muscle", "skin", "tumour", "vessel"]);
    assert_eq!(mesh.node_sets.keys().collect::<Vec<_>>(), ["bone", "ends", "skin_surface"]);
    // The needle enters at the highest point, straight down.
    let top = mesh.positions.iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap();
    assert!(top.length() < 1e-9, "{top}");
    let smallest = (0..mesh.tets.len()).map(|t| mesh.smallest_altitude(t)).fold(f64::INFINITY, f64::min);
    println!("forearm: {} nodes, {} tetrahedra, smallest altitude {smallest} m", mesh.positions.len(), mesh.tets.len());
    for (number, region) in mesh.regions.iter().enumerate() {
        println!("  {region}: {:.4e} m^3", mesh.region_volume(number));
    }
    for (name, nodes) in &mesh.node_sets {
        println!("  {name}: {} nodes", nodes.len());
    }
    assert!(smallest > 0.4e-3);
}

#[test]
fn vtk_attributes_around_the_region_are_stepped_over() {
    let text = "# vtk DataFile Version 5.1\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\n\
        FIELD FieldData 1\nTIME 1 1 double\n0.5\n\
        POINTS 5 float\n0 0 0 5 0 0 0 5 0\n0 0 5 5 5 5\n\
        METADATA\nINFORMATION 1\nNAME L2_NORM_RANGE LOCATION vtkDataArray\nDATA 2 0 8\n\n\
        CELLS 3 8\nOFFSETS vtktypeint64\n0 4 8\nCONNECTIVITY vtktypeint64\n0 1 2 3 1 2 3 4\n\
        CELL_TYPES 2\n10\n10\n\
        POINT_DATA 5\nSCALARS temperature double\nLOOKUP_TABLE default\n1 2 3 4 5\n\
        VECTORS flow float\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n\
        CELL_DATA 2\nFIELD FieldData 3\nweight 2 2 double\n1 2 3 4\nMETADATA\nINFORMATION 0\n\n\
        CellEntityIds 1 2 int\n1 2\nMaterial 1 2 double\n7 8\n";
    let Imported { mut mesh, notices } = parse_text("a.vtk", text).unwrap();
    assert_eq!(notices, ["Regions are taken from cell array `Material`; `CellEntityIds` is not used."]);
    mesh.regions.sort();
    assert_eq!(mesh.regions, ["region-7", "region-8"]);
}

#[test]
fn gmsh_without_groups_and_with_several() {
    let (nodes, tets) = TWO_TETS;
    let imported = parse_text("a.msh", &gmsh_text(&nodes, &tets).replace(" 2 1 1 ", " 2 0 9 ")).unwrap();
    assert_eq!(imported.mesh.regions, ["region-9"]);
    assert_contains(&imported.notices.join("\n"), &["No physical volumes"]);
    let text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n3 4 \"a\"\n3 5 \"b c\"\n$EndPhysicalNames\n\
        $Entities\n0 0 0 1\n6 0 0 0 5 5 5 2 4 5 0\n$EndEntities\n$Nodes\n1 4 1 4\n3 6 0 4\n1\n2\n3\n4\n\
        0 0 0\n5 0 0\n0 5 0\n0 0 5\n$EndNodes\n$Elements\n1 1 1 1\n3 6 4 1\n1 1 2 3 4\n$EndElements\n";
    let imported = parse_text("a.msh", text).unwrap();
    assert_eq!(imported.mesh.regions, ["b c"]);
    assert_eq!(imported.notices, ["Volume 6 is in several physical groups; the one listed last is its region."]);
}

/// Two tetrahedra with a node in the middle of each edge: their corners, and all ten nodes of each (ids from 1).
fn ten_node() -> (Vec<[f64; 3]>, Vec<Vec<usize>>) {
    let (corners, tets) = TWO_TETS;
    let mut nodes = corners.to_vec();
    let mut edges = std::collections::BTreeMap::new();
    let mut all = Vec::new();
    for tet in tets {
        let mut own = tet.to_vec();
        for (a, b) in [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)] {
            let key = (tet[a].min(tet[b]), tet[a].max(tet[b]));
            own.push(*edges.entry(key).or_insert_with(|| {
                let (x, y) = (corners[key.0 - 1], corners[key.1 - 1]);
                // A little off the middle: a curved edge.
                nodes.push(std::array::from_fn(|i| 0.5 * (x[i] + y[i]) + 0.1));
                nodes.len()
            }));
        }
        all.push(own);
    }
    (nodes, all)
}

fn joined(values: &[usize], less: usize, between: &str) -> String {
    values.iter().map(|v| (v - less).to_string()).collect::<Vec<_>>().join(between)
}

#[test]
fn ten_node_tetrahedra_are_taken_by_their_corners() {
    let (nodes, tets) = ten_node();
    let reference = parse_text("a.msh", &gmsh_text(&TWO_TETS.0, &TWO_TETS.1)).unwrap().mesh;
    let rows = |between: &str| nodes.iter().map(|x| x.map(|x| x.to_string()).join(between)).collect::<Vec<_>>();
    let numbered = |between: &str| -> String {
        rows(between).iter().enumerate().map(|(n, row)| format!("{}{between}{row}\n", n + 1)).collect()
    };
    let mut gmsh =
        format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n{}$EndNodes\n", nodes.len(), numbered(" "));
    // A triangle of second order that marks a node set, and the tetrahedra.
    gmsh += &format!("$Elements\n3\n1 9 2 7 1 1 2 3 {}\n", joined(&tets[0][4..7], 0, " "));
    for (n, tet) in tets.iter().enumerate() {
        gmsh += &format!("{} 11 2 1 1 {}\n", n + 2, joined(tet, 0, " "));
    }
    gmsh += "$EndElements\n";
    let mut gmsh_4 = format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 {0} 1 {0}\n3 1 0 {0}\n{1}{2}\n$EndNodes\n$Elements\n1 2 1 2\n3 1 11 2\n",
        nodes.len(),
        (1..=nodes.len()).map(|n| format!("{n}\n")).collect::<String>(),
        rows(" ").join("\n"),
    );
    for (n, tet) in tets.iter().enumerate() {
        gmsh_4 += &format!("{} {}\n", n + 1, joined(tet, 0, " "));
    }
    gmsh_4 += "$EndElements\n";
    let mut vtk = format!(
        "# vtk DataFile Version 3.0\ntitle\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n{}\nCELLS 2 22\n",
        nodes.len(),
        rows(" ").join("\n")
    );
    for tet in &tets {
        vtk += &format!("10 {}\n", joined(tet, 1, " "));
    }
    vtk += "CELL_TYPES 2\n24\n24\n";
    let vtu = format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid>\
         <Piece NumberOfPoints=\"{}\" NumberOfCells=\"2\"><Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\
         {}</DataArray></Points><Cells><DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">{}</DataArray>\
         <DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">10 20</DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">24 24</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>",
        nodes.len(),
        rows(" ").join(" "),
        tets.iter().map(|tet| joined(tet, 1, " ")).collect::<Vec<_>>().join(" "),
    );
    let mut inp = format!("*NODE\n{}*ELEMENT, TYPE=C3D10M, ELSET=all\n", numbered(", "));
    for (n, tet) in tets.iter().enumerate() {
        // A record goes on behind a comma.
        inp += &format!("{}, {},\n{}\n", n + 1, joined(&tet[..7], 0, ", "), joined(&tet[7..], 0, ", "));
    }
    for (name, text) in [("a.msh", &gmsh), ("b.msh", &gmsh_4), ("a.vtk", &vtk), ("a.vtu", &vtu), ("a.inp", &inp)] {
        let imported = parse_text(name, text).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert!(geometry(&imported.mesh) == geometry(&reference), "{name}");
        let told = "2 ten-node tetrahedra are taken by their four corners";
        assert!(imported.notices.iter().any(|notice| notice.contains(told)), "{name}: {:?}", imported.notices);
    }
    assert_eq!(parse_text("a.msh", &gmsh).unwrap().mesh.node_sets["surface-7"].len(), 3);
    let wrong = gmsh.replacen(&format!(" {}\n", tets[0][9]), " 99\n", 1);
    assert_contains(&refusal("a.msh", wrong.as_bytes()), &["names node 99, which is not in the file"]);
}

#[test]
fn abaqus_files_in_several_parts() {
    let place = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(place.path().join(name), text).unwrap();
    std::fs::create_dir(place.path().join("parts")).unwrap();
    let whole = std::fs::read_to_string(folder().join("cube_gmsh.inp")).unwrap();
    // The data of the nodes, and of the first elements, in files of their own.
    let begin = whole.to_uppercase().find("*NODE").unwrap();
    let first = begin + whole[begin..].find('\n').unwrap() + 1;
    let end = first + whole[first..].find("\n*").unwrap() + 1;
    write("nodes.inp", &whole[first..end]);
    write("parts/more.inp", "*Include, input=\"parts/rest.inp\"\n");
    write("parts/rest.inp", &whole[end..]);
    write("main.inp", &format!("{}*INCLUDE, INPUT=nodes.inp\n*INCLUDE, INPUT=parts/more.inp\n", &whole[..first]));
    let read_main = || read(&place.path().join("main.inp"), LengthUnit::Millimetre);
    let reference = read(&folder().join("cube_gmsh.inp"), LengthUnit::Millimetre).unwrap().mesh;
    assert!(read_main().unwrap_or_else(|e| panic!("{e}")).mesh == reference);
    // Messages name the file that the line stands in.
    write("nodes.inp", &whole[first..end].replacen(", ", ", x", 1));
    assert_contains(&read_main().unwrap_err().to_string(), &["nodes.inp:1: ", "is not a number"]);
    write("nodes.inp", "*INCLUDE, INPUT=../nodes.inp\n");
    assert_contains(&read_main().unwrap_err().to_string(), &["nodes.inp:1: ", "not in the folder of the file"]);
    std::fs::remove_file(place.path().join("nodes.inp")).unwrap();
    assert_contains(&read_main().unwrap_err().to_string(), &["main.inp:", "INPUT=nodes.inp: cannot be read"]);
}

/// A surface is the set of the nodes of its sides; what the writing program made for it is no region.
#[test]
fn abaqus_surfaces_are_sets() {
    let text = |surfaces: &str| {
        format!(
            "*NODE\n1, 0, 0, 0\n2, 10, 0, 0\n3, 0, 10, 0\n4, 0, 0, 10\n5, 10, 10, 10\n*ELEMENT, TYPE=C3D4, ELSET=all\n1, 1, 2, 3, 4\n\
             2, 2, 3, 4, 5\n*NSET, NSET=bone\n1, 2\n*ELSET, ELSET=_top_S1, INTERNAL\n1\n{surfaces}"
        )
    };
    let read = parse_text(
        "a.inp",
        &text(
            "*SURFACE, TYPE=ELEMENT, NAME=top\n_top_S1, S1\n*SURFACE, NAME=\"back\"\npart-1.2, s3\n*SURFACE, TYPE=NODE, NAME=pins\nbone,\n\
             5, 1.0\n*SURFACE, TYPE=CUTTING SURFACE, NAME=cut\n1, 0, 0\n",
        ),
    )
    .unwrap_or_else(|error| panic!("{error}"));
    let nodes_of = |set: &str| {
        let mut found: Vec<[i64; 3]> = read.mesh.node_sets[set]
            .iter()
            .map(|n| read.mesh.positions[*n as usize].to_array().map(|x| (x * 1e3).round() as i64))
            .collect();
        found.sort_unstable();
        found
    };
    assert_eq!(nodes_of("top"), [[0, 0, 0], [0, 10, 0], [10, 0, 0]]);
    assert_eq!(nodes_of("back"), [[0, 0, 10], [0, 10, 0], [10, 10, 10]]);
    assert_eq!(nodes_of("pins"), [[0, 0, 0], [10, 0, 0], [10, 10, 10]]);
    assert_eq!(read.mesh.regions, ["all"]);
    assert_eq!(read.mesh.surface_of(Some("top")).unwrap().len(), 1);
    assert!(read.notices.iter().any(|notice| notice.contains("Surface `cut` names no sides")), "{:?}", read.notices);
    assert_contains(
        &refusal("b.inp", text("*SURFACE, NAME=top\nnone, S1\n").as_bytes()),
        &["b.inp:", "surface top names a set or element that is not in the file", "correct the surface"],
    );
}
