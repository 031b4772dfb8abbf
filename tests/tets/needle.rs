//! A needle in tetrahedra: against the block, on all engines, its energy, targets, loads on faces, and what is refused.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use stylet::effects::{TissueMaterial, friction, mass_scaling, puncture};
use stylet::mesh::tets::TetMesh;
use stylet::mesh::{BlockMesh, Mesh};
use stylet::model::Model;
use stylet::needle::{NeedleShape, Phase, Tool};
use stylet::observables::FrameRecord;
use stylet::output::Summary;
use stylet::scene::{Face, Region, RegionShape, Scene, Target};
use stylet::simulation::{EngineChoice, Simulation};

use super::common::*;
use super::cut_grid;

const DEPTH: f64 = 6e-3;

/// The muscle of the scenes and a 16G needle with friction that goes 6 mm deep, in cells of the edge `edge` [m].
fn insertion(edge: f64, direction: DVec3) -> Scene {
    let material = TissueMaterial::preset("across-fibre").unwrap();
    let needle = Tool::Needle(NeedleShape::cone("16G", 0.825e-3, 2.54e-3));
    let speed = 4e-3;
    let mut scene = Scene::block([14e-3, 14e-3, 10e-3], edge, material).with_tool(
        needle,
        DVec3::ZERO,
        direction,
        vec![Phase::Insert { speed, depth: DEPTH }],
    );
    let wave = (scene.material.law.shear_modulus() / scene.material.density).sqrt();
    let factor = mass_scaling::Loading { tool_speed: speed, slowness: None }.auto_factor(wave).unwrap();
    scene.effects.mass_scaling = Some(mass_scaling::Params { factor });
    scene.effects.friction = Some(friction::Params { coefficient: 0.3, ..Default::default() });
    scene.solver.mass_damping = 30.0;
    scene
}

/// The block of a scene, cut into tetrahedra.
fn cut_block(scene: &Scene) -> TetMesh {
    TetMesh::from_block(&BlockMesh::for_scene(scene))
}

/// A run that is judged: its records, after what no usual scene shows has been looked for.
fn run(what: &str, scene: Scene, mesh: impl Into<Mesh>, choice: EngineChoice) -> (Simulation, Vec<FrameRecord>) {
    let mut simulation = Simulation::with_mesh(scene, mesh, choice).unwrap();
    let mut records = Vec::new();
    while let Some(record) = simulation.next_frame().unwrap_or_else(|e| panic!("{what}: {e}")) {
        records.push(record);
    }
    let mut summary = Summary::default();
    summary.take_frames(&records);
    let smallest = records.iter().map(|r| r.health.min_j).fold(1.0, f64::min);
    println!(
        "{what}: {} cells, {} steps of {:.1} us; imbalance {:.3} %, smallest J {smallest:.3}, clamped {}, peak {:.4} N",
        simulation.model.mesh.cell_count(),
        simulation.total_steps(),
        simulation.dt() * 1e6,
        100.0 * summary.energy_imbalance,
        summary.clamped_nodes,
        peak(&records)
    );
    assert_eq!(summary.inverted_cells, 0, "{what}");
    at_most(&format!("{what}, energy imbalance"), summary.energy_imbalance, 0.02);
    assert!(records.last().unwrap().verdict.is_ok(), "{what}: {:?}", records.last().unwrap().verdict);
    (simulation, records)
}

fn peak(records: &[FrameRecord]) -> f64 {
    records.iter().map(|r| r.force.axial).fold(0.0, f64::max)
}

/// Mean of the axial force between two depths [m].
fn mean_between(records: &[FrameRecord], from: f64, to: f64) -> f64 {
    let within: Vec<f64> = records.iter().filter(|r| (from..to).contains(&r.depth)).map(|r| r.force.axial).collect();
    within.iter().sum::<f64>() / within.len() as f64
}

/// Force of the hand at depth on the block and on the same block in tetrahedra, and how far they are apart.
fn apart(edge: f64) -> f64 {
    let scene = insertion(edge, DVec3::NEG_Z);
    let tets = Arc::new(cut_block(&scene));
    let block = BlockMesh::for_scene(&scene);
    let (_, of_block) = run(&format!("block, {} mm", edge * 1e3), scene.clone(), block, EngineChoice::Cpu);
    let (_, of_tets) = run(&format!("tetrahedra, {} mm", edge * 1e3), scene, tets, EngineChoice::Cpu);
    let mut worst: f64 = 0.0;
    // Behind the puncture, whose depth is another thing: what folds less under the tip gives way earlier.
    for (from, to) in [(4e-3, 5e-3), (5e-3, 6e-3)] {
        let (a, b) = (mean_between(&of_block, from, to), mean_between(&of_tets, from, to));
        println!(
            "  {:.0} to {:.0} mm: block {a:.4} N, tetrahedra {b:.4} N, {:+.2} %",
            from * 1e3,
            to * 1e3,
            100.0 * (b / a - 1.0)
        );
        worst = worst.max((b / a - 1.0).abs());
    }
    worst
}

#[test]
fn a_block_in_tetrahedra_has_the_force_of_the_block() {
    for edge in [1.0e-3, 0.8e-3, 0.6e-3] {
        at_most(&format!("force of tetrahedra against the block, cells of {} mm", edge * 1e3), apart(edge), 0.1);
    }
}

#[test]
fn the_engines_agree_on_a_needle_in_tetrahedra() {
    let scene = insertion(0.8e-3, DVec3::new(0.3, 0.0, -1.0));
    let mesh = Arc::new(cut_block(&scene));
    let (_, reference) = run("f64", scene.clone(), mesh.clone(), EngineChoice::Cpu64);
    let mut choices = vec![("lanes", EngineChoice::Cpu)];
    choices.extend(gpu().map(|_| ("gpu", EngineChoice::Gpu)));
    for (name, choice) in choices {
        let (_, records) = run(name, scene.clone(), mesh.clone(), choice);
        let largest = peak(&reference);
        let difference =
            reference.iter().zip(&records).map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max);
        at_most(&format!("{name}: difference of the force over its peak"), difference / largest, 1e-3);
    }
}

/// Entry and exit, plane of the surface, materials on the way and nodes that a block and its tetrahedra have in common.
#[test]
fn the_plan_of_a_path_is_that_of_the_block() {
    for direction in [DVec3::NEG_Z, DVec3::new(0.4, 0.2, -1.0)] {
        let mut scene = insertion(0.8e-3, direction);
        let mut material = scene.material.clone();
        material.cutting = Some(puncture::Cutting { puncture_force: 0.9, cutting_force: 0.4 });
        let shape = RegionShape::Layer { top: 3e-3, bottom: 5e-3 };
        scene.regions.push(Region { name: "layer".into(), shape, material });
        let block = Model::new(scene.clone(), BlockMesh::for_scene(&scene));
        let tets = Model::new(scene.clone(), Arc::new(cut_block(&scene)));
        let (a, b) = (block.puncture.as_ref().unwrap(), tets.puncture.as_ref().unwrap());
        close("exit [m]", b.exit, a.exit, 1e-9);
        assert_eq!(b.lines.len(), a.anchors.len());
        for (one, other) in a.anchors.iter().zip(&b.anchors) {
            assert!((one.surface - other.surface).length() < 1e-12);
        }
        let starts =
            |plan: &stylet::model::PuncturePlan| -> Vec<f64> { plan.segments.iter().map(|s| s.start).collect() };
        assert_eq!(starts(a), starts(b));
        let pushed = |model: &Model| -> Vec<(u32, f64, f64)> {
            let nodes = model.contact_nodes.iter().filter(|c| c.pushed);
            nodes.map(|c| (c.node, c.rest_radius, c.share)).collect()
        };
        let (of_block, of_tets) = (pushed(&block), pushed(&tets));
        assert_eq!(of_block.len(), of_tets.len());
        let sum = |nodes: &[(u32, f64, f64)]| nodes.iter().map(|n| n.2).sum::<f64>();
        assert!(of_block.iter().zip(&of_tets).all(|(a, b)| a.0 == b.0 && (a.1 - b.1).abs() < 1e-12));
        close("volume of the nodes of the ring", sum(&of_tets), sum(&of_block), 0.01);
        // What the path softens, by volume, in the hexahedra that it passes whole: `residual^phi` of a cell and of its six parts
        // differ, the fraction within a0 does not.
        let passed: Vec<u32> = a.cells.iter().filter(|c| c.axial_end < DEPTH - 2e-3).map(|c| c.cell).collect();
        let softened = |model: &Model, parts: u32| -> f64 {
            let plan = model.puncture.as_ref().unwrap();
            let phi = |left: f64| left.ln() / plan.params.residual_stiffness.ln();
            let cells = plan.cells.iter().filter(|c| passed.contains(&(c.cell / parts)));
            cells.map(|c| phi(c.left) * model.mesh.cell_volume(c.cell as usize)).sum()
        };
        close("softened volume [m^3]", softened(&tets, 6), softened(&block, 1), 0.03);
    }
}

#[test]
fn targets_in_a_mesh_move_with_the_tissue() {
    let mut scene = insertion(0.8e-3, DVec3::NEG_Z);
    let at = [DVec3::new(0.0, 0.0, -7e-3), DVec3::new(1.9e-3, 0.4e-3, -6.1e-3)];
    scene.targets =
        at.iter().enumerate().map(|(n, x)| Target { name: n.to_string(), position: *x, radius: 0.5e-3 }).collect();
    let mesh = Arc::new(cut_block(&scene));
    let mut choices = vec![EngineChoice::Cpu];
    choices.extend(gpu().map(|_| EngineChoice::Gpu));
    for choice in choices {
        let (mut simulation, records) = run(&format!("targets, {choice:?}"), scene.clone(), mesh.clone(), choice);
        let state = simulation.engine().read_state().unwrap();
        let last = records.last().unwrap();
        for (index, target) in last.targets.iter().enumerate() {
            // The four nodes of the tetrahedron that holds it.
            let (tet, weights) = mesh.locate(at[index]).unwrap();
            let u: DVec3 = mesh.tets[tet].iter().zip(weights).map(|(n, w)| state.displacement[*n as usize] * w).sum();
            assert!((u - target.displacement).length() < 1e-9, "{choice:?}: {u} {}", target.displacement);
            println!("target {index}: moved by {:.4} mm", u.length() * 1e3);
        }
        assert!(last.targets[0].displacement.z < -0.1e-3, "the lesion ahead is pushed ahead");
    }
}

#[test]
fn the_forearm_is_punctured_on_all_engines() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/forearm_needle.toml");
    // Faster than the scene, and written forces of the tip: the opened path of the same mesh is in tests/tets/opening.rs.
    let overrides = ["puncture.scheme=ring", "motion.phase.0.speed_mm_s=5.0"].map(String::from);
    let scene = Scene::load(&path, &overrides).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(scene.notices, Vec::<String>::new());
    assert!((scene.motion.deepest() - 14e-3).abs() < 1e-9);
    let mut choices = vec![EngineChoice::Cpu64, EngineChoice::Cpu];
    choices.extend(gpu().map(|_| EngineChoice::Gpu));
    let mut runs: Vec<Vec<FrameRecord>> = Vec::new();
    for choice in choices {
        let mesh = scene.mesh.clone().unwrap();
        let (simulation, records) = run(&format!("forearm, {choice:?}"), scene.clone(), mesh, choice);
        if runs.is_empty() {
            let plan = simulation.model.puncture.as_ref().unwrap();
            let named =
                |at: f64| simulation.model.scene.region_at(DVec3::NEG_Z * at).map(|r| scene.regions[r].name.as_str());
            let starts: Vec<(f64, Option<&str>)> =
                plan.segments.iter().map(|s| (s.start, named(s.start + 1e-5))).collect();
            println!("on the way: {starts:.4?}");
            let names: Vec<Option<&str>> = starts.iter().map(|s| s.1).collect();
            assert_eq!(names[..4], [Some("skin"), Some("fat"), None, Some("tumour")]);
            assert!((starts[1].0 - 2e-3).abs() < 0.1e-3 && (starts[2].0 - 6e-3).abs() < 0.1e-3);
        }
        let last = records.last().unwrap();
        assert!(last.tip_coordinate > 12e-3, "the tip stands at {} m", last.tip_coordinate);
        runs.push(records);
    }
    for records in &runs[1..] {
        let difference =
            runs[0].iter().zip(records).map(|(a, b)| (a.force.axial - b.force.axial).abs()).fold(0.0, f64::max);
        at_most("difference of the force over its peak", difference / peak(&runs[0]), 1e-3);
    }
}

/// A cube that hangs on its top and is pulled at its bottom, as a block and in tetrahedra: the load is `traction x area`.
#[test]
fn a_traction_pulls_at_the_triangles_of_a_side() {
    let edge = 1e-3;
    let mut scene = block([1.0; 3], 1.0);
    scene.faces[Face::ZMax as usize] = held(true, true, true);
    scene.faces[Face::ZMin as usize].traction = Some(DVec3::new(20.0, -10.0, -100.0));
    scene.solver.mass_damping = 300.0;
    scene.solver.duration = Some(0.1);
    let mesh = cut_grid([4, 4, 4], edge);
    let model = Model::new(scene.clone(), Arc::new(mesh.clone()));
    let sum: DVec3 = model.node_load.iter().sum();
    assert!((sum - DVec3::new(20.0, -10.0, -100.0) * 16e-6).length() < 1e-15, "{sum}");
    let bottom = (0..mesh.positions.len()).filter(|n| mesh.positions[*n].z == 0.0).count();
    assert_eq!(model.node_load.iter().filter(|f| **f != DVec3::ZERO).count(), bottom);
    let mut engines = vec![EngineChoice::Cpu];
    engines.extend(gpu().map(|_| EngineChoice::Gpu));
    for choice in engines {
        let (mut simulation, _) = run(&format!("pulled, {choice:?}"), scene.clone(), Arc::new(mesh.clone()), choice);
        let state = simulation.engine().read_state().unwrap();
        // 100 Pa on a column of 4 mm whose E is 19.7 kPa: 20.3 um, less by the held top.
        let at_bottom = (0..mesh.positions.len()).filter(|n| mesh.positions[*n].z == 0.0);
        let mean = at_bottom.map(|n| -state.displacement[n].z).sum::<f64>() / bottom as f64;
        println!("{choice:?}: the bottom sinks by {:.2} um", mean * 1e6);
        assert!((15e-6..20.3e-6).contains(&mean), "{choice:?}: {mean}");
    }
}

/// A scene of a mesh of 10 mm, written beside its file.
fn refused(motion: &str, more: &str) -> String {
    parsed(motion, more).expect_err("refused")
}

fn parsed(motion: &str, more: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    let mesh = cut_grid([5, 5, 5], 2e-3);
    let mut text = String::from("*NODE\n");
    for (n, x) in mesh.positions.iter().enumerate() {
        text += &format!("{}, {}, {}, {}\n", n + 1, x.x * 1e3, x.y * 1e3, x.z * 1e3);
    }
    text += "*ELEMENT, TYPE=C3D4, ELSET=muscle\n";
    for (n, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|n| n + 1);
        text += &format!("{}, {a}, {b}, {c}, {d}\n", n + 1);
    }
    std::fs::write(folder.path().join("cube.inp"), text).unwrap();
    let scene = format!(
        "effects = [\"puncture\"]\n[tissue]\nmesh = \"cube.inp\"\nunit = \"mm\"\n[material]\npreset = \"across-fibre\"\n\
         [boundaries]\nz_min = \"fixed\"\n[needle]\ngauge = \"16G\"\ntip_half_angle_deg = 18\n{motion}\n{more}\n"
    );
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, &scene).unwrap();
    Scene::load(&path, &[]).map_err(|e| e.to_string())
}

const INSERT: &str = "[[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 2\ndepth_mm = 5\n";

#[test]
fn entries_into_a_mesh() {
    // From the side, with the entry point before the surface, which is told; the depth to the target point.
    let to_target = INSERT.replace("depth_mm = 5\n", "");
    let scene = parsed("[motion]\nentry_point_mm = [-3, 5, 5]\ntarget_point_mm = [6, 5, 5]\n", &to_target)
        .unwrap_or_else(|e| panic!("{e}"));
    assert!((scene.motion.entry - DVec3::new(0.0, 5e-3, 5e-3)).length() < 1e-9, "{}", scene.motion.entry);
    assert!((scene.motion.direction - DVec3::X).length() < 1e-12);
    assert!((scene.motion.deepest() - 6e-3).abs() < 1e-9);
    assert!(scene.notices.iter().any(|n| n.contains("3 mm behind the entry point")), "{:?}", scene.notices);
    // Up from below.
    let scene = parsed("[motion]\nentry_point_mm = [5, 5, 0]\ndirection = [0, 0, 2]\n", INSERT).unwrap();
    assert_eq!((scene.motion.direction, scene.motion.entry), (DVec3::Z, DVec3::new(5e-3, 5e-3, 0.0)));
    let model = Model::new(scene.clone(), Mesh::of_scene(&scene));
    close("exit [m]", model.puncture.as_ref().unwrap().exit, 10e-3, 1e-9);
}

#[test]
fn what_a_mesh_refuses_of_a_needle() {
    let entry = "[motion]\nentry_point_mm = [5, 5, 10]\n";
    for (motion, more, expected) in [
        ("", INSERT.to_string(), &["no entry point", "entry_point_mm", "(10.000, 10.000, 10.000) mm"][..]),
        ("[motion]\nentry_mm = [5, 5]\n", INSERT.into(), &["top face of a block", "entry_point_mm = [x, y, z]"]),
        ("[motion]\nentry_point_mm = [50, 5, 10]\n", INSERT.into(), &["meets no tissue", "beside the mesh"]),
        ("[motion]\nentry_point_mm = [0.4, 5, 10]\n", INSERT.into(), &["narrower or more bent than the needle"]),
        (entry, INSERT.replace("= 5", "= 9.5"), &["leaves the tissue 10.000 mm below", "depth_mm of at most 9"]),
        (
            "[motion]\nentry_point_mm = [1, 5, 10]\ndirection = [1, 0, -0.1]\n",
            INSERT.into(),
            &["or the needle grazes it", "another entry point"],
        ),
        (
            "[motion]\nentry_point_mm = [5, 5, 10]\ntarget_point_mm = [5, 5, 2]\nangle_deg = 10\n",
            INSERT.into(),
            &["two directions", "remove angle_deg or target_point_mm"],
        ),
        (
            entry,
            format!("{INSERT}[[motion.phase]]\nkind = \"turn\"\nrate_deg_s = 10\nangle_deg = 20\n"),
            &["a motion that leaves one straight line acts on the block only"],
        ),
        (
            entry,
            format!("{INSERT}[puncture]\npath = \"free\"\n"),
            &["found while the tip moves acts on the block only"],
        ),
        (
            "[motion]\nentry_point_mm = [1.5, 5, 10]\n",
            format!("{INSERT}[puncture]\nscheme = \"opening\"\n"),
            &["presses on the surface within 2.477 mm", "(1.500, 5.000, 10.000) mm", "puncture.scheme = \"ring\""],
        ),
        (
            entry,
            format!("{INSERT}[[target]]\nposition_mm = [5, 5, 11]\n"),
            &["lies in no tetrahedron", "it may have holes"],
        ),
    ] {
        let message = refused(motion, &more);
        assert!(message.contains("way out: "), "{message}");
        for text in expected {
            assert!(message.contains(text), "no `{text}` in\n{message}");
        }
    }
}
