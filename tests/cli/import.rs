//! `stylet import`: what it tells of a file, what it refuses, and a run from a line in a patient without any editing.

use stylet::anatomy;

use super::*;

/// A slab of skin on muscle, 24 x 24 x 12 voxels of 1 mm: z runs to the head, the skin is at the top.
fn slab() -> String {
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nspace: right-anterior-superior\nsizes: 24 24 12\n\
        space directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (-11.5,-11.5,-9.5)\nencoding: ascii\n\
        Segment0_Name:=skin\nSegment0_LabelValue:=1\nSegment1_Name:=muscle\nSegment1_LabelValue:=7\n\
        Segment2_Name:=rib\nSegment2_LabelValue:=4\n\n";
    let layers = ["4"; 2].into_iter().chain(["7"; 6]).chain(["1"; 2]).chain(["0"; 2]);
    header.to_string() + &layers.map(|label| format!("{label} ").repeat(24 * 24)).collect::<String>()
}

fn case(name: &str) -> String {
    repository().join("assets/cases").join(name).display().to_string()
}

#[test]
fn a_label_map_and_a_line_through_it() {
    let place = Place::new();
    std::fs::copy(case("lumbar.nrrd"), place.path("lumbar.nrrd")).unwrap();
    let line = ["import", "lumbar.nrrd", "--entry", "0,0,0", "--target", "0,52,0"];
    let answer = place.call(&line).ended(0);
    for part in [
        "lumbar.nrrd: label map (NRRD)",
        "132 x 160 x 128 voxels of 0.5 x 0.5 x 0.5 mm; i, j, k run to LPS",
        "(-33.0, -3.0, -32.0) to (33.0, 72.0, 32.0) mm RAS",
        " 9 bone L3                199891  25.0 bone, rigid",
        "     0.0   2.0 skin",
        "    42.0  47.0 epidural fat",
        "    48.0  52.0 cerebrospinal fluid",
    ] {
        assert!(answer.stdout.contains(part), "no `{part}` in\n{}", answer.all());
    }
    assert!(!answer.stdout.contains("warning"), "{}", answer.all());
    assert!(answer.stdout.lines().all(|line| line.chars().count() <= 100), "{}", answer.all());
    assert_eq!(place.files("."), ["lumbar.nrrd"]);
    // Ten millimetres higher is a spinous process.
    let answer = place.call(&["import", "lumbar.nrrd", "--entry", "0,0,10", "--target", "0,35,10"]).ended(0);
    assert!(answer.stdout.contains("warning: bone L3 is bone, 15.0 to 35.0 mm below the skin"), "{}", answer.all());
}

#[test]
fn a_scene_of_a_case_is_one_that_runs() {
    let place = Place::new();
    std::fs::copy(case("lumbar.nrrd"), place.path("lumbar.nrrd")).unwrap();
    let write =
        ["import", "lumbar.nrrd", "--entry", "0,0,0", "--target", "0,52,0", "--scene", "l.toml", "--picture", "p"];
    place.call(&write).ended(0);
    assert_eq!(place.files("."), ["l.toml", "lumbar.nrrd", "p/axial.png", "p/coronal.png", "p/sagittal.png"]);
    assert!(std::fs::read(place.path("p/axial.png")).unwrap().starts_with(b"\x89PNG"));
    let text = std::fs::read_to_string(place.path("l.toml")).unwrap();
    for part in [
        "labels = \"lumbar.nrrd\"",
        "label = [\"bone L3\", \"bone L4\"]\nrigid = true",
        "preset = \"ligamentum-flavum\"",
        "gauge = \"18G\"",
        "entry_ras_mm = [0, 0, 0]",
        "target_ras_mm = [0, 52, 0]",
        "speed_mm_s = 5",
    ] {
        assert!(text.contains(part), "no `{part}` in\n{text}");
    }
    let scene = stylet::scene::Scene::load(&place.path("l.toml"), &[]).unwrap_or_else(|error| panic!("{error}"));
    assert!(scene.case.is_some() && scene.regions.iter().any(|region| region.material.rigid));
    assert!((scene.motion.deepest() - 52e-3).abs() < 0.1e-3, "{}", scene.motion.deepest());
    // What is there stays, unless it shall not.
    place.call(&write).refused().says("l.toml exists").says("--force");
    place.call(&[&write[..], &["--force"]].concat()).ended(0);
}

#[test]
fn from_a_file_and_a_line_to_a_run() {
    let place = Place::new();
    place.write("slab.nrrd", &slab());
    let line = ["import", "slab.nrrd", "--entry", "0.3,0.2,6", "--target", "0.3,0.2,-4", "--gauge", "16G"];
    let answer = place.call(&[&line[..], &["--run", "--out", "runs/first", "--engine", "cpu"]].concat()).ended(0);
    assert!(answer.stdout.contains("the skin is met 6.0 mm behind the entry"), "{}", answer.all());
    assert!(answer.stdout.trim_end().ends_with("runs/first"), "{}", answer.all());
    let summary = place.summary("runs/first");
    assert!(summary["peak_force_n"].as_f64().unwrap() > 0.1, "{summary}");
    assert!(place.path("runs/first.toml").exists() && place.path("runs/first/force.csv").exists());
}

/// Displacement field, labels and needle as files that are read back.
#[test]
fn volumes_of_a_run_are_those_of_the_patient() {
    let place = Place::new();
    place.write("slab.nrrd", &slab());
    let line = ["import", "slab.nrrd", "--entry", "0.3,0.2,6", "--target", "0.3,0.2,-4", "--scene", "slab.toml"];
    place.call(&line).ended(0);
    let depths = "outputs.volumes_at_depth_mm=[3.0]";
    place.call(&["run", "slab.toml", "--engine", "cpu", "--out", "r", "--set", depths]).ended(0);
    let labels = anatomy::read(&place.path("r/labels_03.00mm.nrrd")).unwrap().map;
    let before = anatomy::read(&place.path("slab.nrrd")).unwrap().map;
    assert_eq!(labels.names, before.names);
    // Away from the needle nothing has moved, the needle has moved something.
    let (mut same, mut other) = (0, 0);
    let [ni, nj, nk] = labels.size;
    for (i, j, k) in (0..nk).flat_map(|k| (0..nj).flat_map(move |j| (0..ni).map(move |i| (i, j, k)))) {
        let x = labels.position(i, j, k);
        let is_far = x.truncate().length() > 9e-3 || x.z < -7e-3;
        match labels.label_at(x) == before.label_at(x) {
            true => same += 1,
            false if is_far => panic!("label at {x}"),
            false => other += 1,
        }
    }
    assert!(same > 1000 && other > 0, "{same} {other}");
    let field = std::fs::read(place.path("r/displacement_03.00mm.nrrd")).unwrap();
    let header = String::from_utf8_lossy(&field[..field.windows(2).position(|w| w == b"\n\n").unwrap()]).into_owned();
    assert!(
        header.contains("kinds: vector domain domain domain") && header.contains("fixed-point iteration"),
        "{header}"
    );
    let needle = anatomy::markups::read(&place.path("r/needle_03.00mm.mrk.json")).unwrap();
    assert_eq!((needle[0].label.as_str(), needle[1].label.as_str()), ("entry", "tip"));
    assert!(needle[0].position.z.abs() < 1e-5, "{needle:?}");
    // The tip may stay behind by what a step advances.
    assert!((needle[1].position.z + 3.0e-3).abs() < 0.1e-3, "{needle:?}");
    // They are results: another run does not mix with them.
    place.call(&["run", "slab.toml", "--engine", "cpu", "--out", "r"]).refused().says("holds results");
}

#[test]
fn volumes_need_a_patient() {
    let place = Place::new();
    place.tiny(&[("fields_at_depth_mm = [3.0]", "volumes_at_depth_mm = [3.0]")]);
    place
        .call(&["check", "tiny.toml"])
        .refused()
        .says("volumes_at_depth_mm")
        .says("no label map")
        .says("fields_at_depth_mm");
}

#[test]
fn surfaces_and_meshes_become_label_maps() {
    let place = Place::new();
    let cube = repository().join("tests/meshes/cube_41_text.msh");
    // The content tells what it is.
    std::fs::copy(cube, place.path("cube.stl")).unwrap();
    let answer = place.call(&["import", "cube.stl"]).ended(0);
    for part in [
        "tetrahedral mesh (Gmsh)",
        "255 tetrahedra, 93 nodes, 20 x 20 x 20 mm",
        "node sets (nodes)",
        "altitude over longest edge",
    ] {
        assert!(answer.stdout.contains(part), "no `{part}` in\n{}", answer.all());
    }
    let line =
        ["import", "cube.stl", "--entry", "0,0,2", "--target", "1,2,-15", "--scene", "cube.toml", "--voxel", "0.5"];
    place.call(&line).ended(0);
    assert_eq!(place.files("."), ["cube.stl", "cube.toml", "cube_labels.nrrd"]);
    let map = anatomy::read(&place.path("cube_labels.nrrd")).unwrap().map;
    let volume: f64 = map.volumes().values().map(|(_, volume)| volume).sum();
    assert!((volume / 8e-6 - 1.0).abs() < 0.02, "{volume}");
    place.call(&["check", "cube.toml"]).ended(0);

    // A box of skin as 3D Slicer writes it: x and y are turned. It has the name of the solid.
    let mut stl = String::from("solid skin SPACE=LPS\n");
    let corner = |n: usize| [10.0 + 20.0 * (n & 1) as f64, 5.0 + 20.0 * (n >> 1 & 1) as f64, 30.0 * (n >> 2) as f64];
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        for three in [[a, b, c], [a, c, d]] {
            let vertices = three.map(|n| corner(n).map(|x| x.to_string()).join(" "));
            stl +=
                &format!("facet normal 0 0 0\nouter loop\nvertex {}\nendloop\nendfacet\n", vertices.join("\nvertex "));
        }
    }
    place.write("box.obj", &(stl + "endsolid\n"));
    let answer = place.call(&["import", "box.obj", "--entry", "-20,-15,40", "--target", "-20,-15,10"]).ended(0);
    for part in [
        "surface (STL)",
        "12 yes",
        "20 x 20 x 30",
        "12.0",
        "(-30.0, -25.0, 0.0) to (-10.0, -5.0, 30.0)",
        "10.0 mm behind the entry",
    ] {
        assert!(answer.stdout.contains(part), "no `{part}` in\n{}", answer.all());
    }
}

#[test]
fn a_surface_whose_name_says_nothing_is_called_as_its_file() {
    let place = Place::new();
    let tetrahedron = "o Mesh1\nv 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    place.write("liver2.obj", tetrahedron);
    let answer = place.call(&["import", "liver2.obj"]).ended(0);
    for part in [
        "liver2          4 yes    4 x 4 x 4 1.067e-2 liver",
        "`Mesh1`, is called `liver2` as the file is",
        "It is 6.928 mm across. If that is too small",
    ] {
        assert!(answer.stdout.contains(part), "no `{part}` in\n{}", answer.all());
    }
    // A name that says something stays, and so does one whose file says no more.
    for (file, name, shown) in [("liver.obj", "skin", "skin "), ("thing.obj", "Mesh1", "Mesh1 ")] {
        place.write(file, &tetrahedron.replace("Mesh1", name));
        let answer = place.call(&["import", file, "--unit", "cm"]).ended(0);
        assert!(answer.stdout.contains(shown) && !answer.stdout.contains("as the file is"), "{}", answer.all());
        assert!(!answer.stdout.contains("across"), "{}", answer.all());
    }
}

#[test]
fn a_file_in_odd_units_is_placed() {
    let place = Place::new();
    // In inches, and its front to the head.
    let inches = slab().replace(
        "(1,0,0) (0,1,0) (0,0,1)",
        "(0.03937007874015748,0,0) (0,0,-0.03937007874015748) (0,0.03937007874015748,0)",
    );
    place.write(
        "slab.nrrd",
        &inches.replace("(-11.5,-11.5,-9.5)", "(-0.452755905511811,-0.3740157480314961,0.452755905511811)"),
    );
    let placed = ["--scale", "25.4", "--axis", "1,0,0", "--angle", "90", "--translation", "0,0,0.5"];
    let line = ["import", "slab.nrrd", "--entry", "0.3,0.2,6", "--target", "0.3,0.2,-4", "--scene", "slab.toml"];
    let answer = place.call(&[&line[..], &placed].concat()).ended(0);
    assert!(answer.stdout.contains("(-12.0, -12.0, -9.5) to (12.0, 12.0, 0.5) mm RAS"), "{}", answer.all());
    let text = std::fs::read_to_string(place.path("slab.toml")).unwrap();
    let table = "transform = { scale = 25.4, axis = [1, 0, 0], angle_deg = 90, translation_mm = [0, 0, 0.5] }";
    assert!(text.contains(table), "{text}");
    place.call(&["check", "slab.toml"]).ended(0);
    let mirrored = ["import", "slab.nrrd", "--scale=-1"];
    place.call(&mirrored).refused().says("--scale: a factor of -1 mirrors the tissue").says("turn it by 180 degrees");
    place.call(&["import", "slab.nrrd", "--angle", "5"]).refused().says("no axis");
    place.call(&["import", "slab.nrrd", "--axis", "1,2", "--angle", "5"]).refused().says("three numbers");
}

#[test]
fn names_from_elsewhere_are_numbers_in_the_scene() {
    let place = Place::new();
    let without: String =
        slab().lines().filter(|line| !line.starts_with("Segment")).map(|line| format!("{line}\n")).collect();
    place.write("slab.nrrd", &without);
    let answer = place.call(&["import", "slab.nrrd"]).ended(0);
    assert!(answer.stdout.contains("no names") && answer.stdout.contains("--names FILE"), "{}", answer.all());
    place.write("names.txt", "1 skin 255 200 180 255\n4 \"rib left 4\"\n7 muscle\n");
    let line = [
        "import",
        "slab.nrrd",
        "--names",
        "names.txt",
        "--entry",
        "0,0,6",
        "--target",
        "0,0,-6.5",
        "--scene",
        "s.toml",
    ];
    let answer = place.call(&line).ended(0);
    assert!(answer.stdout.contains("rib left 4   1152 1.152 bone, rigid"), "{}", answer.all());
    let text = std::fs::read_to_string(place.path("s.toml")).unwrap();
    assert!(text.contains("label = 4\n# rib left 4\nrigid = true"), "{text}");
    place.call(&["check", "s.toml"]).ended(0);
}

#[test]
fn wrong_calls_and_wrong_files() {
    let place = Place::new();
    place.write("slab.nrrd", &slab());
    place.write("points.mrk.json", "{\"markups\": [{\"controlPoints\": [{\"position\": [0, 0, 6]}]}]}");
    place.write("other.txt", "nothing that is known\n");
    let ends = ["--entry", "0,0,6", "--target", "0,0,-4"];
    let refused = |args: &[&str], parts: &[&str]| {
        let mut answer = place.call(&[&["import"], args].concat()).refused();
        for part in parts {
            answer = answer.says(part);
        }
    };
    refused(&["missing.nrrd"], &["missing.nrrd"]);
    refused(&["other.txt"], &["other.txt", "no surface of a kind that is read here"]);
    refused(&["points.mrk.json"], &["these look like points"]);
    refused(&["slab.nrrd", "--gauge", "18"], &["`18`", "18G"]);
    refused(&["slab.nrrd", "--unit", "km"], &["`km`", "m, cm, mm, um, inch"]);
    refused(&["slab.nrrd", "--entry", "1,2", "--target", "0,0,1"], &["--entry 1,2: this is no point"]);
    refused(&["slab.nrrd", "--scene", "s.toml"], &["needs the line", "--entry"]);
    refused(&[&["slab.nrrd", "--scene", "s.txt"], &ends[..]].concat(), &["a scene is a .toml file"]);
    refused(&["slab.nrrd", "--markups", "points.mrk.json"], &["1 points, a line needs two"]);
    place.call(&["import", "slab.nrrd", "--entry", "0,0,6"]).ended(2).says("--target");
    // A line that misses the patient is told after what the file holds.
    let answer = place.call(&["import", "slab.nrrd", "--entry", "90,0,6", "--target", "90,0,-4"]).ended(2);
    let answer = answer.says("meets nothing within 60 mm").says("labels lie within (-12.0, -12.0, -10.0)");
    assert!(answer.stdout.contains("24 x 24 x 12 voxels"), "{}", answer.all());
    assert_eq!(place.files("."), ["other.txt", "points.mrk.json", "slab.nrrd"]);
}
