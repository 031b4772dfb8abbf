//! A sphere on the skin of a label map.

use std::path::PathBuf;

use glam::DVec3;
use stylet::Scene;
use stylet::simulation::{EngineChoice, Simulation};

/// A volume of 80 voxels of half a millimetre along each axis, around the origin.
fn volume(name: &str, label: impl Fn(DVec3) -> u8) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-pressed-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut bytes = b"NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: 80 80 80\n\
        space directions: (0.5,0,0) (0,0.5,0) (0,0,0.5)\nencoding: raw\nspace origin: (-19.75,-19.75,-19.75)\n\n"
        .to_vec();
    for n in 0..80 * 80 * 80 {
        let at = DVec3::new((n % 80) as f64, (n / 80 % 80) as f64, (n / 6400) as f64);
        bytes.push(label(at * 0.5 - 19.75));
    }
    let path = folder.join(format!("{name}.nrrd"));
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A sphere pressed 1.5 mm into a tissue.
fn pressed(tissue: &str, motion: &str) -> Scene {
    let text = format!(
        r#"
effects = ["indentation", "friction", "mass_scaling"]
[tissue]
{tissue}
[material]
youngs_modulus_kpa = 20
poisson_ratio = 0.45
[sphere]
radius_mm = 6
[motion]
{motion}
[[motion.phase]]
kind = "insert"
speed_mm_s = 10
depth_mm = 1.5
[solver]
mass_damping_per_s = 100
"#
    );
    Scene::parse(&std::env::temp_dir().join("pressed.toml"), &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

fn in_labels(path: &std::path::Path, top: f64, cell: f64) -> Scene {
    let tissue = format!("labels = {:?}\nsize_mm = [24, 24, 12]\ncell_size_mm = {cell}", path.display().to_string());
    pressed(&tissue, &format!("entry_ras_mm = [0, 0, {top}]\ntarget_ras_mm = [0, 0, {}]", top - 8.0))
}

/// Axial forces of the frames [N]; the energy of the run is accounted for.
fn forces(scene: Scene, choice: EngineChoice) -> Vec<f64> {
    let mut simulation = Simulation::new(scene, choice).unwrap();
    let (mut all, mut imbalance) = (Vec::new(), 0.0f64);
    while let Some(record) = simulation.next_frame().unwrap() {
        all.push(record.force.axial);
        imbalance = record.energy.imbalance();
        assert_eq!(record.health.inverted_cells, 0);
    }
    assert!(simulation.verdict().is_ok(), "{:?}", simulation.verdict());
    assert!(imbalance.abs() < 0.02, "imbalance {imbalance}");
    all
}

#[test]
fn level_skin_is_pressed_like_a_block() {
    let path = volume("level", |x| u8::from(x.z < 10.0));
    let block = forces(pressed("size_mm = [24, 24, 12]\ncell_size_mm = 1", ""), EngineChoice::Cpu64);
    let labels = forces(in_labels(&path, 10.0, 1.0), EngineChoice::Cpu64);
    let peak = block.iter().cloned().fold(0.0, f64::max);
    let apart = block.iter().zip(&labels).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / peak;
    println!("level skin: {peak:.4} N, labels apart by {:.2e} of it", apart);
    assert!(block.len() == labels.len() && apart < 1e-3, "{apart}");
}

#[test]
fn round_skin_is_pressed_alike_on_all_engines_and_cells() {
    let path = volume("round", |x| u8::from(x.length() < 15.0));
    let coarse = forces(in_labels(&path, 15.0, 1.5), EngineChoice::Cpu64);
    let fine = forces(in_labels(&path, 15.0, 1.0), EngineChoice::Cpu64);
    let [a, b] = [&coarse, &fine].map(|forces| *forces.last().unwrap());
    println!("ball of 15 mm: {a:.4} N in cells of 1.5 mm, {b:.4} N of 1 mm");
    assert!((a / b - 1.0).abs() < 0.1, "{a} {b}");
    let mut choices = vec![EngineChoice::Cpu];
    if crate::common::gpu().is_some() {
        choices.push(EngineChoice::Gpu);
    }
    for choice in choices {
        let other = *forces(in_labels(&path, 15.0, 1.5), choice).last().unwrap();
        println!("{choice:?}: {:.1e}", other / a - 1.0);
        assert!((other / a - 1.0).abs() < 1e-3, "{choice:?}: {other} {a}");
    }
}

#[test]
fn a_mesh_is_pressed_like_the_block_that_it_fills() {
    let lines = [[-8, 8], [-8, 8], [-8, 0]].map(|[from, to]| (from..=to).map(f64::from).collect());
    let mesh = stylet::mesh::TetMesh::from_block(&stylet::mesh::BlockMesh::new(lines));
    let mut text = String::from("*NODE\n");
    for (id, x) in (1..).zip(&mesh.positions) {
        text += &format!("{id}, {}, {}, {}\n", x.x, x.y, x.z);
    }
    text += "*ELEMENT, TYPE=C3D4, ELSET=all\n";
    for (id, tet) in (1..).zip(&mesh.tets) {
        text += &format!("{id}, {}\n", tet.map(|n| (n + 1).to_string()).join(", "));
    }
    let folder = std::env::temp_dir().join(format!("stylet-pressed-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("slab.inp");
    std::fs::write(&path, text).unwrap();
    let block = pressed("size_mm = [16, 16, 8]\ncell_size_mm = 1\nfine_radius_mm = 8", "");
    let tissue = format!("mesh = {:?}\nunit = \"mm\"\nsupports = [\"sides\", \"back\"]", path.display().to_string());
    let mesh = pressed(&tissue, "entry_point_mm = [0, 0, 1]\ndirection = [0, 0, -1]");
    assert!(mesh.notices.iter().any(|n| n.contains("meets the surface 1 mm behind")), "{:?}", mesh.notices);
    let expected = *forces(block, EngineChoice::Cpu64).last().unwrap();
    let mut choices = vec![EngineChoice::Cpu, EngineChoice::Cpu64];
    if crate::common::gpu().is_some() {
        choices.push(EngineChoice::Gpu);
    }
    for choice in choices {
        let found = *forces(mesh.clone(), choice).last().unwrap();
        println!("{choice:?}: {found:.4} N in tetrahedra, {expected:.4} N in the block");
        assert!((found / expected - 1.0).abs() < 0.1, "{choice:?}: {found} {expected}");
    }
}
