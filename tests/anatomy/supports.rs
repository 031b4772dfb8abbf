//! `tissue.supports`: each word holds what it says, and a tissue that is held more is stiffer.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use stylet::mesh::Mesh;
use stylet::model::Model;
use stylet::scene::Face;
use stylet::simulation::{EngineChoice, Simulation};
use stylet::{Error, Scene};

/// A volume of 60 voxels of half a millimetre along each axis, around the origin.
fn volume(name: &str, label: impl Fn(DVec3) -> u8) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("stylet-supports-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let mut bytes = b"NRRD0004\ntype: unsigned char\ndimension: 3\nspace: right-anterior-superior\nsizes: 60 60 60\n\
        space directions: (0.5,0,0) (0,0.5,0) (0,0,0.5)\nencoding: raw\nspace origin: (-14.75,-14.75,-14.75)\n\n"
        .to_vec();
    for n in 0..60 * 60 * 60 {
        let at = DVec3::new((n % 60) as f64, (n / 60 % 60) as f64, (n / 3600) as f64);
        bytes.push(label(at * 0.5 - 14.75));
    }
    let path = folder.join(format!("{name}.nrrd"));
    std::fs::write(&path, bytes).unwrap();
    path
}

fn parsed(text: &str) -> Result<Scene, String> {
    Scene::parse(&std::env::temp_dir().join("supports.toml"), text, &[]).map_err(|error| match error {
        Error::Scene(text) => text,
        other => panic!("{other}"),
    })
}

fn scene(text: &str) -> Scene {
    parsed(text).unwrap_or_else(|text| panic!("{text}"))
}

fn model(text: &str) -> Model {
    let scene = scene(text);
    let mesh = Mesh::of_scene(&scene);
    Model::new(scene, mesh)
}

/// Needle into a ball of 12 mm with a ball of bone in it; `supports`: a line of the tissue.
fn ball(name: &str, supports: &str) -> String {
    let path = volume(name, |x| match x.length() {
        r if r < 4.0 => 2,
        r if r < 12.0 => 1,
        _ => 0,
    });
    format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
labels = {:?}
size_mm = [20, 20, 20]
cell_size_mm = 1.2
{supports}
[material]
youngs_modulus_kpa = 30
poisson_ratio = 0.45
puncture_force_n = 2
cutting_force_n = 1
[[region]]
name = "bone"
label = 2
rigid = true
[needle]
gauge = "18G"
tip_length_mm = 3
[motion]
entry_ras_mm = [0, 0, 14]
target_ras_mm = [0, 0, 6]
[[motion.phase]]
kind = "insert"
speed_mm_s = 20
depth_mm = 2
"#,
        path.display().to_string()
    )
}

/// Needle into a slab: a block that fills labels or stands by itself.
fn block(supports: &str) -> String {
    format!(
        r#"
effects = ["puncture", "friction", "mass_scaling"]
[tissue]
size_mm = [24, 24, 14]
cell_size_mm = 1.2
{supports}
[material]
youngs_modulus_kpa = 30
poisson_ratio = 0.45
puncture_force_n = 2
cutting_force_n = 1
[needle]
gauge = "18G"
tip_length_mm = 3
[motion]
[[motion.phase]]
kind = "insert"
speed_mm_s = 20
depth_mm = 2.5
"#
    )
}

/// Axial force at the end of the way in, before anything gives way [N].
fn force(text: &str, choice: EngineChoice) -> f64 {
    let mut simulation = Simulation::new(scene(text), choice).unwrap();
    let mut last = 0.0;
    while let Some(record) = simulation.next_frame().unwrap() {
        last = record.force.axial;
    }
    assert!(simulation.verdict().is_ok(), "{:?}", simulation.verdict());
    last
}

fn on_sides(model: &Model, node: usize) -> bool {
    [Face::XMin, Face::XMax, Face::YMin, Face::YMax].iter().any(|face| model.lies_on(node, *face))
}

#[test]
fn the_default_is_sides_back_and_bones() {
    for (without, with) in [
        (ball("default", ""), ball("default", r#"supports = ["bones", "back", "sides"]"#)),
        (block(""), block(r#"supports = ["sides", "back"]"#)),
    ] {
        let [without, with] = [without, with].map(|text| model(&text));
        assert_eq!(without.node_flags, with.node_flags);
        assert_eq!(without.scene.faces, with.scene.faces);
        assert_eq!(without.scene.notices, with.scene.notices);
    }
}

#[test]
fn each_word_holds_what_it_says() {
    let held = |model: &Model, node: usize| model.fixed_components(node) == [true; 3];
    for back_only in [model(&block(r#"supports = ["back"]"#)), model(&ball("back", r#"supports = ["back", "bones"]"#))]
    {
        for node in 0..back_only.mesh.node_count() {
            let stands = back_only.composition.held.get(node).is_some_and(|held| *held);
            assert_eq!(held(&back_only, node), stands || back_only.lies_on(node, Face::ZMin));
        }
    }
    let sides = model(&block(r#"supports = ["sides"]"#));
    assert!((0..sides.mesh.node_count()).all(|node| held(&sides, node) == on_sides(&sides, node)));
    // A face that [boundaries] names is as it says there.
    let opened =
        model(&block(r#"supports = ["sides"]"#).replace("[material]", "[boundaries]\nx_max = \"free\"\n[material]"));
    assert!(opened.scene.faces[Face::XMax as usize].fixed == [false; 3] && opened.scene.faces[0].fixed == [true; 3]);
}

#[test]
fn skin_is_held_away_from_the_path_and_nowhere_else() {
    let top = model(&block("supports = [\"sides\", \"back\", \"skin\"]\nskin_free_mm = 6"));
    for node in 0..top.mesh.node_count() {
        let x = top.mesh.rest_position(node);
        let skin = top.lies_on(node, Face::ZMax) && x.truncate().length() > 6e-3;
        let held = skin || on_sides(&top, node) || top.lies_on(node, Face::ZMin);
        assert_eq!(top.fixed_components(node) == [true; 3], held, "{x}");
    }
    // On the ball: the nodes outside of it that tissue moves, and none deep in it.
    let round = model(&ball("skin", "supports = [\"bones\", \"skin\"]\nskin_free_mm = 5"));
    let distance = round.scene.motion.distance_from_path();
    let skin = &round.composition.skin;
    let (mut outside, mut inside) = (0, 0);
    for node in 0..round.mesh.node_count() {
        let x = round.mesh.rest_position(node);
        // The origin is where the path meets the skin, 12 mm above the middle of the ball.
        let r = (x + DVec3::Z * 12e-3).length();
        let is_held = skin.binary_search(&node).is_ok();
        let moves = !round.composition.held[node] || is_held;
        assert_eq!(round.fixed_components(node) == [true; 3], is_held || !moves);
        let reached = x.z > -18e-3 && x.x.abs() < 9e-3 && x.y.abs() < 9e-3;
        if moves && reached && r > 12e-3 {
            assert_eq!(is_held, distance(x) > 5e-3, "{x} {r}");
            outside += usize::from(is_held);
        } else if moves && r < 11.4e-3 && !round.lies_on(node, Face::ZMax) {
            assert!(!is_held, "{x} {r}");
            inside += 1;
        }
    }
    println!("skin of the ball: {outside} nodes held, {inside} inside free, {} in all", skin.len());
    assert!(outside > 50 && inside > 500, "{outside} {inside}");
}

#[test]
fn what_is_held_more_is_stiffer() {
    for (what, of) in [("block", block as fn(&str) -> String), ("ball", |supports: &str| ball("forces", supports))] {
        let bones = if what == "ball" { "\"bones\", " } else { "" };
        let words = ["\"back\"", "\"sides\", \"back\"", "\"sides\", \"back\", \"skin\""];
        let forces = words
            .map(|words| force(&of(&format!("supports = [{bones}{words}]\nskin_free_mm = 4")), EngineChoice::Cpu64));
        println!("{what}: back {:.4} N, sides and back {:.4} N, with skin {:.4} N", forces[0], forces[1], forces[2]);
        assert!(forces[0] < forces[1] && forces[1] < forces[2], "{what}: {forces:?}");
    }
}

#[test]
fn all_engines_hold_the_skin_alike() {
    for text in [
        ball("engines", "supports = [\"bones\", \"skin\"]\nskin_free_mm = 4"),
        block("supports = [\"back\", \"skin\"]\nskin_free_mm = 4"),
    ] {
        let exact = force(&text, EngineChoice::Cpu64);
        let mut others = vec![EngineChoice::Cpu];
        if crate::common::gpu().is_some() {
            others.push(EngineChoice::Gpu);
        }
        for choice in others {
            let apart = force(&text, choice) / exact - 1.0;
            println!("{choice:?}: {apart:.1e}");
            assert!(apart.abs() < 1e-3, "{choice:?}: {apart}");
        }
    }
}

/// A block of 6 x 4 x 4 mm as tetrahedra in the text of Abaqus.
fn bar() -> String {
    let lines = [6, 4, 4].map(|n| (0..=n).map(f64::from).collect());
    let mesh = stylet::mesh::TetMesh::from_block(&stylet::mesh::BlockMesh::new(lines));
    let mut text = String::from("*NODE\n");
    for (id, x) in (1..).zip(&mesh.positions) {
        text += &format!("{id}, {}, {}, {}\n", x.x, x.y, x.z);
    }
    text += "*ELEMENT, TYPE=C3D4, ELSET=all\n";
    for (id, tet) in (1..).zip(&mesh.tets) {
        text += &format!("{id}, {}\n", tet.map(|n| (n + 1).to_string()).join(", "));
    }
    text
}

#[test]
fn a_mesh_is_held_by_words_where_the_needle_points() {
    let folder = std::env::temp_dir().join(format!("stylet-supports-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("bar.inp");
    std::fs::write(&path, bar()).unwrap();
    let text = |supports: &str, motion: &str| {
        format!(
            "effects = [{}]\n[tissue]\nmesh = {:?}\nunit = \"mm\"\n{supports}\n[material]\npreset = \"across-fibre\"\n{motion}",
            if motion.contains("needle") { "\"puncture\"" } else { "" },
            path.display().to_string()
        )
    };
    let still = "[solver]\nduration_s = 0.1\n";
    let needle = "[needle]\ngauge = \"22G\"\ntip_half_angle_deg = 18\n[motion]\nentry_point_mm = [6, 2.2, 2.1]\ndirection = [-1, 0, 0]\n\
                  [[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 20\ndepth_mm = 2\n";
    // Without a needle the back is the bottom.
    let of = model(&text("supports = [\"back\"]", still));
    assert!((0..of.mesh.node_count()).all(|n| (of.fixed_components(n) == [true; 3]) == of.lies_on(n, Face::ZMin)));
    let of = model(&text("supports = [\"sides\", \"back\", \"skin\"]\nskin_free_mm = 1.3", needle));
    for node in 0..of.mesh.node_count() {
        let x = of.mesh.rest_position(node);
        let skin = of.lies_on(node, Face::XMax) && (x.y - 2.2e-3).hypot(x.z - 2.1e-3) > 1.3e-3;
        let sides = [Face::YMin, Face::YMax, Face::ZMin, Face::ZMax].iter().any(|face| of.lies_on(node, *face));
        let held = skin || sides || of.lies_on(node, Face::XMin);
        assert_eq!(of.fixed_components(node) == [true; 3], held, "{x}");
    }
    let floats = scene(&text("supports = []", still)).notices.join(" ");
    assert!(floats.contains("it floats"), "{floats}");
}

#[test]
fn words_that_hold_nothing_are_refused_and_what_floats_is_told() {
    let no_tool = "effects = []\n[tissue]\nsize_mm = [8, 8, 8]\ncell_size_mm = 2\nsupports = [\"skin\"]\n[material]\n\
                   preset = \"across-fibre\"\n[solver]\nduration_s = 0.1\n";
    for (text, marker, parts) in [
        (
            block("supports = [\"bones\"]"),
            "supports",
            &["\"bones\" holds nothing: no region is rigid", "rigid = true"][..],
        ),
        (block("supports = [\"back\", \"back\"]"), "supports", &["\"back\" is listed twice"]),
        (block("supports = [\"bottom\"]"), "supports", &["bottom", "sides"]),
        (
            block("supports = [\"back\", \"skin\"]\nskin_free_mm = 40"),
            "supports",
            &["no skin is farther than 40 mm from the path", "write skin_free_mm below 16.97"],
        ),
        (block("supports = [\"back\", \"skin\"]\nskin_free_mm = 0"), "skin_free_mm", &["greater than 0"]),
        (ball("boneless", "supports = [\"back\"]"), "supports", &["region `bone` is rigid", "add \"bones\""]),
        (no_tool.to_string(), "supports", &["no path that skin could be away from", "add a tool"]),
    ] {
        let line = 1 + text.lines().position(|l| l.starts_with(marker)).unwrap();
        let message = parsed(&text).expect_err(parts[0]);
        for part in [&[format!("supports.toml:{line}:").as_str(), "way out"], parts].concat() {
            assert!(message.contains(part), "no `{part}` in\n{message}");
        }
    }
    let told = |text: &str| scene(text).notices.join(" ");
    assert!(told(&block("supports = []")).contains("the tool pushes it away"));
    assert!(told(&no_tool.replace("[\"skin\"]", "[]")).contains("it floats"));
    assert!(told(&block("skin_free_mm = 5")).contains("no effect without \"skin\""));
    let held = Arc::new(model(&ball("held", "supports = [\"bones\"]")));
    assert!(!held.scene.notices.join(" ").contains("pushes it away"), "{:?}", held.scene.notices);
}
