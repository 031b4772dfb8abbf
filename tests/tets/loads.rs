//! `[[load]]`: tractions and pressures on named sets.

use stylet::scene::{LoadKind, SetLoad};
use stylet::{Error, model::loads::resultant};

use super::*;

fn choices() -> Vec<EngineChoice> {
    let mut choices = vec![EngineChoice::Cpu, EngineChoice::Cpu64];
    choices.extend(gpu().map(|_| EngineChoice::Gpu));
    choices
}

/// Nodes of a mesh at a place.
fn set(mesh: &TetMesh, is_in: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..mesh.positions.len() as u32).filter(|node| is_in(mesh.positions[*node as usize])).collect()
}

fn settled(load: SetLoad) -> Scene {
    let mut scene = tissue();
    scene.loads = vec![load];
    scene.solver.mass_damping = 300.0;
    scene.solver.duration = Some(0.15);
    scene
}

#[test]
fn a_bar_pulled_at_a_set_has_the_stress_of_the_traction() {
    let mut mesh = distorted_grid([8, 3, 3], 1e-3, 0.2);
    let end = set(&mesh, |x| x.x > 7.999e-3);
    mesh.node_sets.insert("end".into(), end);
    let traction = 60.0;
    let load =
        SetLoad { set: Some("end".into()), kind: LoadKind::Traction(DVec3::new(traction, 0.0, 0.0)), ramp: 0.02 };
    let (area, force) = resultant(&mesh, &load);
    assert!((area - 9e-6).abs() < 1e-15 && (force - DVec3::X * traction * 9e-6).length() < 1e-15, "{area} {force}");
    let mut scene = settled(load);
    scene.faces[Face::XMin as usize] = held(true, false, false);
    scene.faces[Face::YMin as usize] = held(false, true, false);
    scene.faces[Face::ZMin as usize] = held(false, false, true);
    for choice in choices() {
        let (mut simulation, records, summary) = run(&format!("bar, {choice:?}"), scene.clone(), mesh.clone(), choice);
        assert!(summary.energy_imbalance < 0.01, "{}", summary.energy_imbalance);
        let fields = simulation.snapshot(records.last().unwrap()).unwrap();
        let wide = |axis: usize| {
            let node = (0..mesh.positions.len()).find(|n| mesh.positions[*n].min_element() > 2.999e-3).unwrap();
            1.0 + fields.displacement[node][axis] / mesh.positions[node][axis]
        };
        // Alone along the bar, the true stress is that of von Mises; the traction counts per area at rest.
        let nominal = |stress: f64| stress * wide(1) * wide(2);
        for stress in &fields.von_mises {
            close(&format!("{choice:?}, stress over traction"), nominal(*stress) / traction, 1.0, 5e-3);
        }
        assert!(wide(0) > 1.001, "it stretches: {}", wide(0));
    }
}

/// An eighth of a ball: those cells of a grid whose middle lies in it, with the nodes that they need.
fn ball_of_cells(cells: usize, edge: f64) -> TetMesh {
    let mut mesh = cut_grid([cells; 3], edge);
    let radius = cells as f64 * edge;
    let centre = |tet: usize| mesh.corners(tet).iter().sum::<DVec3>() / 4.0;
    let kept: Vec<[u32; 4]> = (0..mesh.tets.len())
        .filter(|tet| ((centre(*tet) / edge).floor() * edge + 0.5 * edge).length() < radius)
        .map(|tet| mesh.tets[tet])
        .collect();
    let mut index = vec![u32::MAX; mesh.positions.len()];
    let mut positions = Vec::new();
    for node in kept.iter().flatten() {
        if index[*node as usize] == u32::MAX {
            index[*node as usize] = positions.len() as u32;
            positions.push(mesh.positions[*node as usize]);
        }
    }
    mesh.tets = kept.into_iter().map(|tet| tet.map(|node| index[node as usize])).collect();
    mesh.tags = vec![0; mesh.tets.len()];
    mesh.positions = positions;
    mesh
}

#[test]
fn a_pressure_from_all_sides_is_the_pressure_inside() {
    let pressure = 500.0;
    for (what, mesh) in [("cube", distorted_grid([4; 3], 1e-3, 0.2)), ("ball", ball_of_cells(4, 1e-3))] {
        let load = SetLoad { set: None, kind: LoadKind::Pressure(pressure), ramp: 0.02 };
        let (_, force) = resultant(&mesh, &load);
        assert!(force.length() < 1e-15, "a closed surface is in balance: {force}");
        let mut scene = settled(load);
        // Planes of symmetry: under a dead pressure a body that is free turns over until it is pulled.
        for axis in 0..3 {
            scene.faces[2 * axis].fixed[axis] = true;
        }
        for choice in choices() {
            let (mut simulation, records, _) = run(&format!("{what}, {choice:?}"), scene.clone(), mesh.clone(), choice);
            let fields = simulation.snapshot(records.last().unwrap()).unwrap();
            for (inside, j) in fields.pressure.iter().zip(&fields.jacobian) {
                // Per area at rest.
                close(&format!("{what}, {choice:?}, pressure"), inside * j.powf(2.0 / 3.0) / pressure, 1.0, 0.01);
            }
        }
    }
}

#[test]
fn a_load_pushes_a_set_and_not_its_neighbours() {
    let mut mesh = cut_grid([3, 3, 2], 1e-3);
    let patch = set(&mesh, |x| x.z > 1.999e-3 && x.x < 1.001e-3);
    mesh.node_sets.insert("patch".into(), patch.clone());
    let load = |kind| SetLoad { set: Some("patch".into()), kind, ramp: 0.0 };
    let mut scene = tissue();
    scene.loads = vec![load(LoadKind::Pressure(100.0))];
    let pressed = tet_model(scene.clone(), mesh.clone());
    scene.loads = vec![load(LoadKind::Traction(DVec3::new(0.0, 0.0, -100.0)))];
    let pushed = tet_model(scene, mesh.clone());
    // 1 x 3 mm of the top: a pressure there is a traction downwards.
    let sum: DVec3 = pressed.node_load.iter().sum();
    assert!((sum - DVec3::new(0.0, 0.0, -100.0 * 3e-6)).length() < 1e-15, "{sum}");
    for (node, (a, b)) in pressed.node_load.iter().zip(&pushed.node_load).enumerate() {
        assert!((*a - *b).length() < 1e-16, "{a} {b}");
        assert_eq!(*a != DVec3::ZERO, patch.binary_search(&(node as u32)).is_ok(), "node {node}");
    }
}

/// Two tetrahedra with sets, in mm.
const MESH: &str = "*NODE\n1, 0, 0, 0\n2, 10, 0, 0\n3, 0, 10, 0\n4, 0, 0, 10\n5, 10, 10, 10\n*ELEMENT, TYPE=C3D4, ELSET=all\n\
    1, 1, 2, 3, 4\n2, 2, 3, 4, 5\n*NSET, NSET=bone\n1, 2, 3\n*NSET, NSET=inner\n2, 3, 4\n*NSET, NSET=side\n1, 3, 4\n";

fn parsed(load: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("part.inp"), MESH).unwrap();
    let text = format!(
        "effects = []\n[tissue]\nmesh = \"part.inp\"\nunit = \"mm\"\n[material]\npreset = \"across-fibre\"\n[[support]]\nset = \"bone\"\n\
         fixed = [\"x\", \"y\", \"z\"]\n[solver]\nduration_s = 0.1\n{load}"
    );
    Scene::parse(&folder.path().join("loads.toml"), &text, &[]).map_err(|error| match error {
        Error::Scene(text) => text,
        other => panic!("{other}"),
    })
}

#[test]
fn loads_are_read_in_si() {
    let scene =
        parsed("[[load]]\nset = \"side\"\ntraction_kpa = [0, 1, -2]\nramp_s = 0.5\n[[load]]\npressure_kpa = -3\nramp_s = 0.5\n")
            .unwrap_or_else(|text| panic!("{text}"));
    let expected = [
        SetLoad { set: Some("side".into()), kind: LoadKind::Traction(DVec3::new(0.0, 1e3, -2e3)), ramp: 0.5 },
        SetLoad { set: None, kind: LoadKind::Pressure(-3e3), ramp: 0.5 },
    ];
    assert_eq!(scene.loads, expected);
}

#[test]
fn wrong_loads() {
    let other = "[[load]]\nset = \"side\"\npressure_kpa = 1\nramp_s = 1\n";
    for (load, marker, parts) in [
        (
            "[[load]]\nset = \"skin\"\npressure_kpa = 1\n",
            "set = \"skin\"",
            &["no set called \"skin\"", "\"bone\" (3 nodes)"][..],
        ),
        (
            "[[load]]\nset = \"inner\"\npressure_kpa = 1\n",
            "set = \"inner\"",
            &["no triangle of the surface", "needs an area"],
        ),
        ("[[load]]\nset = \"bone\"\npressure_kpa = 1\n", "set = \"bone\"", &["are held by a [[support]]"]),
        ("[[load]]\nset = \"side\"\n", "[[load]]", &["the load has no size", "pressure_kpa = 1"]),
        (
            "[[load]]\nset = \"side\"\npressure_kpa = 1\ntraction_kpa = [1, 0, 0]\n",
            "[[load]]",
            &["a traction and a pressure"],
        ),
        ("[[load]]\nset = \"side\"\npressure_kpa = 1e9\n", "pressure_kpa", &["from -10000 to 10000"]),
        ("[[load]]\nset = \"side\"\npressure_kpa = 1\nramp_s = -1\n", "ramp_s", &["from 0 to 3600"]),
        (
            &format!("{other}[[load]]\npressure_kpa = 1\nramp_s = 0.5\n"),
            "ramp_s = 0.5",
            &["grows over 0.5 s", "write ramp_s = 1 here"],
        ),
        (
            &format!("{other}[boundaries]\nx_max = {{ fixed = [], traction_kpa = [1, 0, 0] }}\n"),
            "ramp_s = 1",
            &["grow together"],
        ),
    ] {
        let message = parsed(load).expect_err(load);
        // The marker may stand in the head of the scene too: the last one is meant.
        let text = format!("\n\n\n\n\n\n\n\n\n\n\n{load}");
        let line = 1 + text.lines().collect::<Vec<_>>().iter().rposition(|l| l.starts_with(marker)).unwrap();
        for part in [&[format!("loads.toml:{line}:").as_str(), "way out"], parts].concat() {
            assert!(message.contains(part), "no `{part}` for {load} in\n{message}");
        }
    }
    let block = "effects = []\n[tissue]\nsize_mm = [8, 8, 8]\ncell_size_mm = 2\n[material]\npreset = \"across-fibre\"\n[solver]\n\
                 duration_s = 0.1\n[[load]]\npressure_kpa = 1\n";
    let Err(Error::Scene(message)) = Scene::parse(Path::new("block.toml"), block, &[]) else { panic!("a block") };
    assert!(message.contains("the tissue is a block") && message.contains("traction_kpa"), "{message}");
}
