//! Pictures of a scene with a label map: what is drawn where, in which colour, and under which name.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use stylet::anatomy::colours::of_kind;
use stylet::mesh::Mesh;
use stylet::model::Model;
use stylet::observables::FieldSnapshot;
use stylet::render::anatomy::Anatomy;
use stylet::render::surfaces::{self, Embedding, Layer};
use stylet::render::{self, AnatomyPicture, Image, body};
use stylet::scene::Scene;

/// The lumbar puncture of `assets/cases`, in coarse cells.
const LUMBAR: &str = r#"
title = "Lumbar puncture"
[tissue]
labels = "lumbar.nrrd"
cell_size_mm = 1.5
[material]
youngs_modulus_kpa = 20
poisson_ratio = 0.45
[[region]]
name = "vertebrae"
label = ["bone L3", "bone L4"]
rigid = true
[[target]]
name = "fluid"
position_ras_mm = [0, 50, 0]
radius_mm = 1
[needle]
gauge = "18G"
tip_length_mm = 4
[motion]
entry_ras_mm = [0, 0, 0]
target_ras_mm = [0, 52, 0]
[[motion.phase]]
kind = "insert"
speed_mm_s = 20
"#;

fn model(text: &str) -> Arc<Model> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/cases/scene.toml");
    let scene = Scene::parse(&path, text, &[]).unwrap();
    let mesh = Mesh::of_scene(&scene);
    Arc::new(Model::new(scene, mesh))
}

/// All that deforms is pushed aside around a needle of the given depth [m].
fn snapshot(model: &Model, depth: f64) -> FieldSnapshot {
    let Mesh::Block(_) = &model.mesh else { panic!("labels lie in a block") };
    let held = &model.composition.held;
    let displacement = |n: usize| {
        let x = model.mesh.rest_position(n);
        let near = (-(x.truncate().length() / 8e-3).powi(2)).exp();
        if held.get(n).copied().unwrap_or(false) { DVec3::ZERO } else { DVec3::new(0.0, 0.0, -2e-3 * near) }
    };
    FieldSnapshot {
        displacement: (0..model.mesh.node_count()).map(displacement).collect(),
        von_mises: (0..model.mesh.cell_count())
            .map(|cell| 3e4 * (-(model.mesh.cell_centre(cell) + DVec3::Z * depth).length() / 4e-3).exp())
            .collect(),
        stiffness: vec![1.0; model.mesh.cell_count()],
        tool_pose: Some((DVec3::new(0.0, 0.0, -depth), DVec3::NEG_Z)),
        depth,
        targets: model.scene.targets.iter().map(|target| target.position).collect(),
        ..Default::default()
    }
}

fn kept(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Part of the pixels that are within some steps of a colour.
fn share(image: &Image, colour: [u8; 3]) -> f64 {
    let near = |p: &&[u8]| p.iter().zip(colour).all(|(a, b)| a.abs_diff(b) <= 3);
    image.rgba.chunks(4).filter(near).count() as f64 / f64::from(image.width * image.height)
}

#[test]
fn bone_is_drawn_and_all_names_stand_beside() {
    let model = model(LUMBAR);
    let snapshot = snapshot(&model, 30e-3);
    let scene = &model.scene;
    let anatomy = render::draw_anatomy(scene, &model.mesh, &snapshot, None).unwrap().unwrap();
    anatomy.write_png(&kept("anatomy_lumbar.png")).unwrap();
    let stress = render::draw(scene, &model.mesh, &snapshot, None).unwrap();
    stress.write_png(&kept("stress_lumbar.png")).unwrap();
    assert!(share(&anatomy, of_kind("bone").unwrap()) > 0.02);
    for kind in ["skin", "fat", "muscle", "csf"] {
        assert!(share(&anatomy, of_kind(kind).unwrap()) > 0.002, "{kind}");
    }
    let names = AnatomyPicture::compose(scene, &model.mesh, &snapshot).unwrap().names;
    for name in ["skin", "fat", "interspinous ligament", "ligamentum flavum", "dura", "cerebrospinal fluid", "muscle"] {
        assert!(names.iter().any(|n| n == name), "{name}: {names:?}");
    }
    assert!(names.iter().any(|n| n.starts_with("bone")), "{names:?}");
}

/// What is embedded in cells goes with them: a shift shifts it, a stretch stretches it.
#[test]
fn surfaces_move_with_their_cells() {
    let model = model(LUMBAR);
    let Mesh::Block(block) = &model.mesh else { panic!("labels lie in a block") };
    let anatomy = Anatomy::of_scene(&model.scene).unwrap();
    let triangles = surfaces::surfaces(&model.scene, block, &anatomy, &surfaces::Detail::FULL);
    let of_bone = triangles.iter().filter(|t| t.layer == Layer::Solid).count();
    assert!(of_bone > 1000 && triangles.len() < 100_000, "{of_bone} of {}", triangles.len());
    let embedding = Embedding::new(block, &anatomy);
    let affine = |x: DVec3| DVec3::new(1e-3 + 0.1 * x.x, -2e-3 + 0.05 * x.z, 0.02 * x.y);
    let displacement: Vec<DVec3> = (0..block.node_count()).map(|n| affine(block.rest_position(n))).collect();
    let mut inside = 0;
    for corner in triangles.iter().flat_map(|t| t.corners) {
        // Trilinear weights hold what is linear, but beside air, where they are those of the tissue alone.
        let (_, weights) = embedding.of(corner.place);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12 || weights == [0.0; 8]);
        let miss = embedding.moved(corner.place, &displacement).distance(corner.place + affine(corner.place));
        inside += usize::from(miss < 1e-9);
        assert!(miss < 2e-3 + 1.2 * corner.place.length() * f64::from(u8::from(weights == [0.0; 8])), "{miss}");
    }
    assert!(inside as f64 > 0.9 * 3.0 * triangles.len() as f64, "{inside} of {}", 3 * triangles.len());
}

#[test]
fn the_body_is_drawn_with_bone_behind_the_cut() {
    let model = model(LUMBAR);
    let snapshot = snapshot(&model, 30e-3);
    let image = body::draw(&model.scene, &model.mesh, &snapshot).unwrap();
    image.write_png(&kept("body_lumbar.png")).unwrap();
    let mut colours: Vec<[u8; 4]> = image.rgba.chunks(4).map(|p| p.try_into().unwrap()).collect();
    colours.sort_unstable();
    colours.dedup();
    assert!(colours.len() > 1000, "{}", colours.len());
}
