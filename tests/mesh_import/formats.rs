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
fn either_vtk_format_is_read_under_either_extension() {
    for (file, name) in [("cube_text.vtu", "a.vtk"), ("cube_zlib.vtu", "a.vtk"), ("cube_51_text.vtk", "a.vtu")] {
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
