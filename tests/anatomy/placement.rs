//! `[tissue.transform]`: a file in odd units, or one that lies on its side, is the same tissue as the one written in that place.

use std::path::PathBuf;

use glam::{DMat3, DVec3};
use stylet::mesh::Placement;
use stylet::mesh::import::{ImportOptions, LengthUnit, parse};
use stylet::observables::FrameRecord;
use stylet::simulation::{EngineChoice, Simulation};
use stylet::{Error, Scene};

/// A folder of this test with one file in it.
fn written(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-placement-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn parsed(text: &str) -> Result<Scene, String> {
    Scene::parse(&std::env::temp_dir().join("placed.toml"), text, &[]).map_err(|error| match error {
        Error::Scene(text) => text,
        other => panic!("{other}"),
    })
}

fn axial(scene: Scene) -> Vec<f64> {
    let mut simulation = Simulation::new(scene, EngineChoice::Cpu).unwrap();
    let mut records: Vec<FrameRecord> = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap() {
        records.push(record);
    }
    assert!(simulation.verdict().is_ok());
    records.iter().map(|record| record.force.axial).collect()
}

/// 60 voxels along each axis with steps as columns [mm]: skin and muscle below z = 10 mm where `placed` puts them.
fn layers(name: &str, steps: DMat3, placed: impl Fn(DVec3) -> DVec3) -> PathBuf {
    let origin = steps * DVec3::splat(-29.5);
    let list = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let mut bytes = format!(
        "NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: 60 60 60\n\
         space directions: {} {} {}\nencoding: raw\nspace origin: {}\n\n",
        list(steps.x_axis),
        list(steps.y_axis),
        list(steps.z_axis),
        list(origin)
    )
    .into_bytes();
    for n in 0..60 * 60 * 60 {
        let at = DVec3::new((n % 60) as f64, (n / 60 % 60) as f64, (n / 3600) as f64);
        bytes.push(match 10.0 - placed(origin + steps * at).z {
            depth if depth < 0.0 => 0,
            depth if depth < 2.0 => 1,
            _ => 2,
        });
    }
    written(name, &bytes)
}

fn needle_in(labels: &std::path::Path, transform: &str) -> String {
    format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
labels = {:?}
size_mm = [16, 16, 14]
cell_size_mm = 1.0
{transform}
[material]
youngs_modulus_kpa = 60
poisson_ratio = 0.45
puncture_force_n = 0.4
cutting_force_n = 0.3
[[region]]
name = "skin"
label = 1
material = {{ youngs_modulus_kpa = 150, poisson_ratio = 0.45, puncture_force_n = 0.5, cutting_force_n = 0.4 }}
[needle]
gauge = "18G"
tip_length_mm = 3
[motion]
entry_ras_mm = [0.3, -0.4, 12.0]
target_ras_mm = [0.3, -0.4, 0.0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 20
depth_mm = 6
"#,
        labels.display().to_string()
    )
}

#[test]
fn a_label_map_in_tenths_of_a_millimetre_on_its_side_is_the_one_that_stands() {
    let upright = layers("upright.nrrd", DMat3::from_diagonal(DVec3::splat(0.5)), |x| x);
    // Its y runs to the feet and its z to the front; it is moved by whole voxels, so that voxels lie on voxels.
    let shift = DVec3::new(1.0, -0.5, 2.0);
    let placed = move |x: DVec3| DVec3::new(x.x, -x.z, x.y) * 0.1 + shift;
    let lying = layers("lying.nrrd", DMat3::from_diagonal(DVec3::splat(5.0)), placed);
    let transform = "transform = { scale = 0.1, axis = [2, 0, 0], angle_deg = 90, translation_mm = [1, -0.5, 2] }";
    let scene = parsed(&needle_in(&lying, transform)).unwrap_or_else(|text| panic!("{text}"));
    let told = scene.notices.join(" ");
    assert!(told.contains("scaled by 0.1, turned by 90 degrees about (1, 0, 0), moved by (1, -0.5, 2) mm"), "{told}");
    assert!(told.contains("(-14, -15.5, -13) to (16, 14.5, 10) mm"), "{told}");
    let [one, other] = [parsed(&needle_in(&upright, "")).unwrap(), scene].map(axial);
    let peak = one.iter().cloned().fold(0.0, f64::max);
    let apart = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / peak;
    println!("label map on its side: {apart:.1e} of the peak");
    assert!(one.len() == other.len() && apart < 1e-6, "{apart}");
    // In the wrong place there is nothing to puncture.
    assert!(parsed(&needle_in(&lying, "")).unwrap_err().contains("no skin on this line"));
}

#[test]
fn a_placed_mesh_is_the_mesh_written_in_that_place() {
    let text =
        std::fs::read_to_string(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/meshes/cube_22_text.msh"))
            .unwrap();
    let options = ImportOptions { unit: LengthUnit::Millimetre, accept_size: true, placement: Placement::NONE };
    let angle: f64 = 33.0;
    let axis = DVec3::new(1.0, -2.0, 0.5);
    let shift = DVec3::new(7.0, 0.0, -3.0);
    let turn = glam::DQuat::from_axis_angle(axis.normalize(), angle.to_radians());
    // The nodes of the text, moved one by one.
    let (mut lines, mut left) = (Vec::new(), None);
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        left = match (line, left) {
            ("$Nodes", _) => Some(1),
            ("$EndNodes", _) => None,
            (_, left) => left,
        };
        match words.as_slice() {
            [id, x, y, z] if left.is_some() => {
                let [x, y, z] = [x, y, z].map(|word| word.parse().unwrap());
                let moved = turn * (DVec3::new(x, y, z) * 0.25) + shift;
                lines.push(format!("{id} {} {} {}", moved.x, moved.y, moved.z));
            }
            _ => lines.push(line.to_string()),
        }
    }
    let there = parse("there.msh", lines.join("\n").as_bytes(), options).unwrap().mesh;
    let placement = Placement::new(0.25, Some(axis), Some(angle), shift * 1e-3).unwrap();
    let placed = parse("placed.msh", text.as_bytes(), ImportOptions { placement, ..options }).unwrap().mesh;
    let apart = there.positions.iter().zip(&placed.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    println!("placed mesh: {apart:.1e} m");
    assert!(there.positions.len() == placed.positions.len() && apart < 1e-15, "{apart}");
    assert_eq!((&there.tets, &there.tags, &there.node_sets), (&placed.tets, &placed.tags, &placed.node_sets));
    let volume: f64 = (0..placed.tets.len()).map(|tet| placed.volume(tet)).sum();
    assert!((volume / (8e-6 / 64.0) - 1.0).abs() < 1e-9, "{volume}");
    // A right angle about an axis of coordinates leaves every digit.
    let right = Placement::new(1.0, Some(DVec3::Z), Some(90.0), DVec3::ZERO).unwrap();
    let plain = parse("plain.msh", text.as_bytes(), options).unwrap().mesh;
    let turned = parse("turned.msh", text.as_bytes(), ImportOptions { placement: right, ..options }).unwrap().mesh;
    let mut one: Vec<[u64; 3]> =
        plain.positions.iter().map(|x| [0.0 - x.y, x.x + 0.0, x.z].map(f64::to_bits)).collect();
    let mut other: Vec<[u64; 3]> = turned.positions.iter().map(|x| x.to_array().map(f64::to_bits)).collect();
    one.sort_unstable();
    other.sort_unstable();
    assert_eq!(one, other);
}

/// A tetrahedron of 10 mm as a mesh and as a closed surface.
const MESH: &str =
    "*NODE\n1, 0, 0, 0\n2, 10, 0, 0\n3, 0, 10, 0\n4, 0, 0, 10\n*ELEMENT, TYPE=C3D4, ELSET=all\n1, 1, 2, 3, 4\n";
const SURFACE: &str = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

fn still(tissue: &str) -> String {
    format!("effects = []\n[tissue]\n{tissue}\n[material]\npreset = \"across-fibre\"\n[solver]\nduration_s = 0.1\n")
}

#[test]
fn a_scene_places_meshes_and_surfaces() {
    let mesh = written("one.inp", MESH.as_bytes());
    let surface = written("one.obj", SURFACE.as_bytes());
    let transform = "transform = { scale = 2, axis = [0, 0, 1], angle_deg = 90, translation_mm = [0, 0, 5] }";
    let of_mesh = still(&format!("mesh = {:?}\nunit = \"mm\"\n{transform}", mesh.display().to_string()));
    let scene = parsed(&of_mesh).unwrap_or_else(|text| panic!("{text}"));
    let (low, high) = scene.mesh.as_ref().unwrap().bounds();
    let is_near = |x: DVec3, mm: [f64; 3], within: f64| x.distance(DVec3::from(mm) * 1e-3) < within * 1e-3;
    assert!(is_near(low, [-20.0, 0.0, 5.0], 1e-9) && is_near(high, [0.0, 20.0, 25.0], 1e-9), "{low} {high}");
    let of_surface = still(&format!(
        "surfaces = [{:?}]\nunit = \"mm\"\ncell_size_mm = 2\n{transform}",
        surface.display().to_string()
    ));
    let scene = parsed(&of_surface).unwrap_or_else(|text| panic!("{text}"));
    let (low, high) = scene.case.as_ref().unwrap().map.bounds().unwrap();
    // Within a voxel or two of half a millimetre: its corners are sharp.
    assert!(is_near(low, [-20.0, 0.0, 5.0], 2.5) && is_near(high, [0.0, 20.0, 25.0], 2.5), "{low} {high}");
    assert!(low.x > -20.1e-3 && high.z < 25.1e-3, "{low} {high}");
}

#[test]
fn what_places_nothing_is_refused() {
    let mesh = written("refused.inp", MESH.as_bytes());
    let file = format!("mesh = {:?}\nunit = \"mm\"\n", mesh.display().to_string());
    let block = "size_mm = [10, 10, 10]\ncell_size_mm = 2\n";
    for (tissue, table, marker, parts) in [
        (file.as_str(), "scale = -1", "scale", &["a factor of -1 mirrors the tissue", "mirror it in the program"][..]),
        (&file, "scale = 0", "scale", &["a factor of 0 leaves no tissue", "scale = 0.1"]),
        (&file, "scale = nan", "scale", &["not a finite number"]),
        (&file, "axis = [0, 0, 0]\nangle_deg = 20", "axis", &["the axis has no direction", "axis = [0, 0, 1]"]),
        (&file, "axis = [0, 0, 1]", "axis", &["an axis to turn about and no angle", "add angle_deg"]),
        (&file, "angle_deg = 20", "angle_deg", &["an angle and no axis", "add axis"]),
        (&file, "scale = 1000", "mesh =", &["17.3 m across", "its scale 1000"]),
        (&file, "factor = 2", "factor", &["scale"]),
        (block, "scale = 2", "[tissue.transform]", &["the tissue is a block", "remove it, or name a file"]),
    ] {
        let text = still(tissue).replacen("[material]", &format!("[tissue.transform]\n{table}\n[material]"), 1);
        let line = 1 + text.lines().position(|l| l.contains(marker)).unwrap();
        let message = parsed(&text).expect_err(table);
        for part in [&[format!("placed.toml:{line}:").as_str(), "way out"], parts].concat() {
            assert!(message.contains(part), "no `{part}` for {table} in\n{message}");
        }
    }
}
