//! Every scene of the repository loads, every wrong scene is refused with file, line and way out.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use stylet::Error;
use stylet::mesh::BlockMesh;
use stylet::scene::Scene;

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn main_scene() -> PathBuf {
    repository().join("scenes/muscle_biopsy.toml")
}

/// All scene files below `folder`.
fn scenes_below(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            scenes_below(&path, found);
        } else if path.extension().is_some_and(|e| e == "toml") {
            found.push(path);
        }
    }
}

/// The message of a load that must fail.
fn refusal(path: &Path, overrides: &[&str]) -> String {
    let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
    match Scene::load(path, &overrides) {
        Err(error @ Error::Scene(_)) => {
            assert_eq!(error.exit_code(), 2);
            error.to_string()
        }
        Err(other) => panic!("wrong kind of error: {other}"),
        Ok(_) => panic!("{} with {overrides:?} was accepted", path.display()),
    }
}

/// Changes `from` to `to` in the main scene (each must occur), loads it from a file called `bad.toml` and checks that
/// the message has file, line, way out and all `expected` texts. The line is that of `marker` in the changed text.
fn assert_refused(changes: &[(&str, &str)], marker: &str, expected: &[&str]) {
    let mut text = std::fs::read_to_string(main_scene()).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "`{from}` is not in the main scene");
        text = text.replacen(from, to, 1);
    }
    let line = 1 + text.lines().position(|l| l.contains(marker)).expect("marker is in the text");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    std::fs::write(&path, text).unwrap();
    let message = refusal(&path, &[]);
    assert!(message.contains(&format!("bad.toml:{line}:")), "no bad.toml:{line} in\n{message}");
    assert!(message.contains("= way out: "), "{message}");
    for text in expected {
        assert!(message.contains(text), "no `{text}` in\n{message}");
    }
}

#[test]
fn every_scene_loads_and_meshes() {
    let mut paths = Vec::new();
    scenes_below(&repository().join("scenes"), &mut paths);
    assert!(paths.len() >= 13, "{paths:?}");
    for path in paths {
        if path.ends_with("table1_as_printed.toml") {
            continue;
        }
        let scene = Scene::load(&path, &[]).unwrap_or_else(|e| panic!("{}\n{e}", path.display()));
        assert!(scene.notices.is_empty(), "{}: {:?}", path.display(), scene.notices);
        assert!(!scene.title.is_empty());
        let mesh = BlockMesh::for_scene(&scene);
        assert!((20..200_000).contains(&mesh.cell_count()), "{}", path.display());
    }
}

#[test]
fn the_main_scene_is_read_in_si() {
    let scene = Scene::load(&main_scene(), &[]).unwrap();
    assert_eq!(scene.name, "muscle_biopsy");
    assert_eq!(scene.effects.keys(), ["mass_scaling", "puncture", "friction"]);
    assert!((scene.tissue.cell_size - 0.6e-3).abs() < 1e-12);
    assert!((scene.material.law.c10 - 9520.0).abs() < 1e-9);
    assert!((scene.material.law.bulk_modulus - 5.0e5).abs() < 1e-6);
    assert!((scene.motion.deepest() - 12.0e-3).abs() < 1e-12);
    assert!((stylet::needle::Kinematics::new(&scene.motion).duration() - 12.5).abs() < 1e-9);
    assert_eq!(scene.outputs.pictures_at.len(), 4);
    assert_eq!(scene.faces[5].fixed, [false; 3]);
    assert_eq!(scene.faces[4].fixed, [true; 3]);
    let puncture = scene.effects.puncture.unwrap();
    assert!((puncture.tip_stiffness - 2000.0).abs() < 1e-9);
}

#[test]
fn the_printed_table_is_refused_with_all_three_defects() {
    let message = refusal(&repository().join("scenes/lv2022/table1_as_printed.toml"), &[]);
    for text in [
        "REFUSED material",
        "4.75",
        "-4.91",
        "-0.16 kPa",
        "-0.32 kPa",
        "0.4635 ms",
        "0.8 mm ripple",
        "0.0148 kg/m^3",
        "table1_as_printed.toml:13:",
        "way out: write preset = \"lv2022-refit\"",
        "20000",
        "youngs_modulus_kpa = 20",
        "REFUSED needle",
        "1.48e-8 g/mm^3",
        "14.8 g/cm^3",
        "table1_as_printed.toml:21:",
        "table1_as_printed.toml:16:",
    ] {
        assert!(message.contains(text), "no `{text}` in\n{message}");
    }
}

#[test]
fn wrong_material() {
    let preset = "preset = \"across-fibre\"";
    for (text, marker, expected) in [
        ("c10_kpa = 1\nc01_kpa = -2\npoisson_ratio = 0.45", "c01_kpa", "REFUSED"),
        ("c10_kpa = 0\nc01_kpa = 0\npoisson_ratio = 0.45", "c01_kpa", "REFUSED"),
        ("c10_kpa = 2\nc01_kpa = -1\npoisson_ratio = 0.45", "c01_kpa", "allow_limited = true"),
        ("c10_kpa = 2\nc01_kpa = 1\nbulk_modulus_kpa = -5", "bulk_modulus", "greater than 0"),
        ("c10_kpa = 2\nc01_kpa = 1\nd_per_mpa = 0", "d_per_mpa", "from"),
        ("c10_kpa = 2\nc01_kpa = 1", "[material]", "poisson_ratio = 0.45"),
        ("c10_kpa = nan\nc01_kpa = 1\npoisson_ratio = 0.45", "c10_kpa", "not a finite number"),
        ("c10_kpa = 2\nc01_kpa = inf\npoisson_ratio = 0.45", "c01_kpa", "not a finite number"),
        ("youngs_modulus_kpa = 0\npoisson_ratio = 0.45", "youngs_modulus", "greater than 0"),
        ("youngs_modulus_kpa = -60\npoisson_ratio = 0.45", "youngs_modulus", "greater than 0"),
        ("youngs_modulus_kpa = 60\npoisson_ratio = 0.5", "poisson_ratio", "0.495"),
        ("youngs_modulus_kpa = 60", "youngs_modulus", "add poisson_ratio"),
        ("youngs_modulus_kpa = 20e6\npoisson_ratio = 0.45", "youngs_modulus", "REFUSED material"),
        ("c10_kpa = 9000\nc01_kpa = 0\npoisson_ratio = 0.45", "c01_kpa", "REFUSED material"),
        ("preset = \"across-fiber\"", "preset =", "did you mean \"across-fibre\"?"),
        ("preset = \"across-fibre\"\nc10_kpa = 2", "preset =", "keep `preset`"),
        ("density_kg_m3 = 1000", "[material]", "across-fibre"),
    ] {
        assert_refused(&[(preset, text)], marker, &[expected]);
    }
}

#[test]
fn wrong_keys_kinds_and_text() {
    assert_refused(&[("cell_size_mm", "cellsize_mm")], "cellsize_mm", &["did you mean `cell_size_mm`?"]);
    assert_refused(&[("cell_size_mm = 0.6", "cell_size_mm = \"fine\"")], "cell_size_mm", &["invalid type"]);
    assert_refused(&[("cell_size_mm = 0.6", "")], "[tissue]", &["missing field `cell_size_mm`"]);
    assert_refused(&[("cell_size_mm = 0.6", "cell_size_mm = ")], "cell_size_mm", &["not TOML"]);
    assert_refused(&[("[20.0, 20.0, 16.0]", "[20.0, 20.0]")], "size_mm", &["invalid length"]);
    assert_refused(
        &[("\"friction\"", "\"frictoin\"")],
        "effects",
        &["did you mean \"friction\"?", "mass_scaling, gravity"],
    );
    assert_refused(&[("kind = \"hold\"", "kind = \"wait\"")], "\"wait\"", &["hold"]);
    assert_refused(&[("mass_scaling = 4000", "mass_scaling = \"much\"")], "\"much\"", &["auto"]);
    assert_refused(&[("[needle]", "[boundaries]\nx_min = \"glued\"\n\n[needle]")], "glued", &["roller"]);
    assert_refused(&[("[needle]", "[boundaries]\nx_min = {fixd = [\"x\"]}\n\n[needle]")], "fixd", &["fixed"]);
}

#[test]
fn wrong_boundaries() {
    for (text, expected) in [
        ("{fixed = [\"z\"], displacement_mm = [0, 0, 1]}", "duration_s = 0.5"),
        ("{fixed = [\"x\"], displacement_mm = [0, 0, 1], duration_s = 1}", "add \"z\""),
        ("{fixed = [\"x\"], rotation_deg = 9, duration_s = 1}", "add \"y\""),
        ("{fixed = [\"x\"], traction_kpa = [1, 0, 0]}", "remove \"x\""),
    ] {
        let tables = format!("[boundaries]\nz_max = {text}\n\n[needle]");
        assert_refused(&[("[needle]", &tables)], "z_max", &[expected]);
    }
}

#[test]
fn wrong_motion() {
    assert_refused(
        &[("entry_mm = [0.0, 0.0]", "entry_mm = [11.0, 0.0]")],
        "entry_mm",
        &["outside the top face", "11.000"],
    );
    assert_refused(&[("entry_mm = [0.0, 0.0]", "entry_mm = [9.5, 0.0]")], "entry_mm", &["9.500"]);
    assert_refused(
        &[("[0.0, 0.0, -1.0]", "[1.0, 0.0, -1.0]"), ("entry_mm = [0.0, 0.0]", "entry_mm = [3.0, 0.0]")],
        "[[motion.phase]]",
        &["sideways", "11.485"],
    );
    assert_refused(&[("depth_mm = 12.0", "depth_mm = 15.5")], "depth_mm = 15.5", &["bottom", "at most 15.000"]);
    assert_refused(&[("[0.0, 0.0, -1.0]", "[0.0, 0.0, 1.0]")], "direction", &["negative z"]);
    assert_refused(&[("[0.0, 0.0, -1.0]", "[0.0, 0.0, 0.0]")], "direction", &["negative z"]);
    assert_refused(&[("speed_mm_s = 2.0", "speed_mm_s = 0")], "speed_mm_s = 0", &["greater than 0"]);
    assert_refused(&[("speed_mm_s = 2.0", "speed_mm_s = -2")], "speed_mm_s = -2", &["greater than 0"]);
    assert_refused(&[("depth_mm = 0.0", "depth_mm = 13.0")], "depth_mm = 13.0", &["does not go back", "below 12"]);
    assert_refused(&[("kind = \"withdraw\"", "kind = \"insert\"")], "depth_mm = 0.0", &["does not go deeper"]);
    assert_refused(
        &[("kind = \"insert\"", "kind = \"withdraw\"")],
        "kind = \"withdraw\"",
        &["withdraws before it inserts"],
    );
    assert_refused(&[("duration_s = 0.5", "duration_s = 0")], "duration_s = 0", &["greater than 0"]);
    assert_refused(&[("duration_s = 0.5", "depth_mm = 3")], "depth_mm = 3", &["remove this key"]);
}

#[test]
fn a_tool_without_phases_and_phases_without_a_tool() {
    let text = std::fs::read_to_string(main_scene()).unwrap();
    let (head, _) = text.split_once("[[motion.phase]]").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.toml");
    std::fs::write(&path, head).unwrap();
    let message = refusal(&path, &[]);
    assert!(
        message.contains("has no phase")
            && message.contains("bad.toml:")
            && message.contains("way out: add [[motion.phase]]")
    );
    std::fs::write(&path, head.split_once("[motion]").unwrap().0).unwrap();
    assert!(refusal(&path, &[]).contains("a tool but no motion"));
    let (start, rest) = text.split_once("[needle]").unwrap();
    std::fs::write(&path, format!("{start}[motion]{}", rest.split_once("[motion]").unwrap().1)).unwrap();
    let message = refusal(&path, &[]);
    assert!(message.contains("a motion but no tool") && message.contains("`puncture` needs a needle"), "{message}");
    assert!(message.contains("`friction` needs a tool"), "{message}");
}

#[test]
fn wrong_tools_and_parameters() {
    assert_refused(&[("gauge = \"16G\"", "gauge = \"16\"")], "gauge", &["did you mean \"16G\"?"]);
    assert_refused(&[("gauge = \"16G\"", "outer_diameter_mm = 0")], "outer_diameter_mm", &["from 0.05"]);
    assert_refused(&[("tip_half_angle_deg = 18.0", "")], "[needle]", &["tip_half_angle_deg = 18"]);
    assert_refused(&[("\"steel-304\"", "\"steel\"")], "material = \"steel\"", &["steel-304"]);
    assert_refused(
        &[("\"steel-304\"", "{youngs_modulus_gpa = 640, poisson_ratio = 0.22, density_g_cm3 = 1.48e-5}")],
        "density_g_cm3",
        &["REFUSED needle", "0.0148 kg/m^3", "14.8 g/cm^3 (tungsten carbide)"],
    );
    assert_refused(&[("[needle]", "[sphere]\nradius_mm = 5\n\n[needle]")], "[sphere]", &["keep one"]);
    assert_refused(
        &[("softened_radius_mm = 0.72", "softened_radius_mm = 2.0")],
        "softened_radius_mm",
        &["ring_radius_mm = 2.0"],
    );
    assert_refused(&[("coefficient = 0.3", "coefficient = -0.3")], "coefficient", &["from 0 to 2"]);
    assert_refused(&[("mass_scaling = 4000", "mass_scaling = 0.5")], "mass_scaling = 0.5", &["from 1"]);
    assert_refused(
        &[("pictures_at_depth_mm", "pictures_at_s")],
        "pictures_at_s",
        &["write pictures_at_depth_mm instead"],
    );
    assert_refused(&[("\"friction\"", "\"indentation\"")], "effects", &["sphere or a flat punch"]);
}

#[test]
fn a_mesh_that_is_too_fine_says_how_much_it_needs() {
    assert_refused(
        &[("cell_size_mm = 0.6", "cell_size_mm = 0.02")],
        "cell_size_mm",
        &["GiB", "write a cell_size_mm of"],
    );
    assert_refused(&[("cell_size_mm = 0.6", "cell_size_mm = 12")], "cell_size_mm", &["write at most 8"]);
}

#[test]
fn the_cell_size_that_a_refusal_offers_is_accepted() {
    let message = refusal(&main_scene(), &["tissue.cell_size_mm=0.02"]);
    let offered = message.split("cell_size_mm of ").nth(1).unwrap().split_whitespace().next().unwrap();
    Scene::load(&main_scene(), &[format!("tissue.cell_size_mm={offered}")]).unwrap();
}

#[test]
fn several_problems_come_in_the_order_of_the_file() {
    let message = refusal(&main_scene(), &["tissue.growth=9"]);
    assert_eq!(message.matches("error:").count(), 1);
    assert_refused(
        &[("cell_size_mm = 0.6", "cell_size_mm = -1"), ("coefficient = 0.3", "coefficient = 9")],
        "coefficient",
        &["`tissue.cell_size_mm` is -1", "`friction.coefficient` is 9"],
    );
}

#[test]
fn a_missing_file_names_its_neighbours() {
    let message = refusal(&repository().join("scenes/muscle_biopsi.toml"), &[]);
    assert!(
        message.contains("muscle_biopsi.toml")
            && message.contains("did you mean")
            && message.contains("muscle_biopsy.toml")
    );
}

#[test]
fn overrides_replace_values_and_are_named_when_wrong() {
    let load = |text: &str| Scene::load(&main_scene(), &[text.to_string()]);
    assert_eq!(load("material.preset=lv2022-refit").unwrap().material.name, "lv2022-refit");
    let scene = load("motion.phase.0.speed_mm_s = 5").unwrap();
    assert!((scene.motion.largest_speed() - 5e-3).abs() < 1e-12);
    assert_eq!(load("effects=[\"puncture\"]").unwrap().effects.keys(), ["puncture"]);
    assert!(load("boundaries.z_min={fixed=[\"z\"]}").unwrap().faces[4].fixed == [false, false, true]);
    assert_eq!(load("needle.gauge=18G").unwrap().tool, load("needle.gauge=\"18G\"").unwrap().tool);
    assert_eq!(load("motion.phase.2={kind=\"hold\",duration_s=1}").unwrap().motion.phases.len(), 3);
    for (text, expected) in [
        ("motion.phase.0.speed_mm_s=-5", "greater than 0"),
        ("motion.phase.9.speed_mm_s=5", "no index of a list of 3"),
        ("tissue.cellsize_mm=1", "did you mean `cell_size_mm`"),
        ("tissue.cell_size_mm", "there is no `=`"),
        ("tissue.cell_size_mm=", "no value"),
        ("tissue.cell_size_mm=nan", "finite"),
        ("tissue.cell_size_mm=[1", "not TOML"),
        ("tissue.cell_size_mm.x=1", "inside a"),
        ("=1", "incomplete"),
        ("motion.phase.3={kind=\"insert\",speed_mm_s=1}", "depth_mm = 12"),
    ] {
        let message = refusal(&main_scene(), &[text]);
        assert!(message.contains(&format!("--set {text}:")), "{message}");
        assert!(message.contains(expected) && message.contains("= way out: "), "{message}");
        assert!(!message.contains("muscle_biopsy.toml:"), "{message}");
    }
    // A problem of the file itself keeps its line while another key is overridden.
    let message = refusal(&repository().join("scenes/lv2022/table1_as_printed.toml"), &["tissue.cell_size_mm=0.9"]);
    assert!(message.contains("table1_as_printed.toml:13:"), "{message}");
}

#[test]
fn harmless_contradictions_become_notices() {
    let notices = |overrides: &[&str]| {
        let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
        Scene::load(&main_scene(), &overrides).unwrap().notices.join(" ")
    };
    assert!(notices(&["effects=[\"puncture\",\"mass_scaling\"]"]).contains("[friction] has no effect"));
    assert!(notices(&["effects=[\"puncture\",\"friction\"]"]).contains("solver.mass_scaling"));
    assert!(notices(&["effects=[\"mass_scaling\"]"]).contains("The needle has no effect"));
    assert!(notices(&["material={c10_kpa=2.3,c01_kpa=1,d_per_mpa=4,poisson_ratio=0.45}"]).contains("nu 0.4934"));
    assert!(
        notices(&["material={c10_kpa=2,c01_kpa=-1,poisson_ratio=0.45,allow_limited=true}"]).contains("below 1.414")
    );
    assert!(notices(&["outputs.pictures_at_depth_mm=[20]"]).contains("never reaches"));
}

#[test]
fn the_schema_describes_every_table() {
    let schema = Scene::schema();
    let text = schema.to_string();
    for key in [
        "tissue",
        "material",
        "motion",
        "outputs",
        "cell_size_mm",
        "allow_limited",
        "Cell edge around the planned path [mm]",
    ] {
        assert!(text.contains(key), "no {key}");
    }
}

/// Dotted paths of all numbers in the main scene.
const NUMBERS: [&str; 24] = [
    "tissue.size_mm.0",
    "tissue.size_mm.2",
    "tissue.cell_size_mm",
    "tissue.fine_radius_mm",
    "tissue.growth",
    "tissue.axis_offset_cells.1",
    "material.density_kg_m3",
    "material.poisson_ratio",
    "material.d_per_mpa",
    "needle.tip_half_angle_deg",
    "motion.entry_mm.0",
    "motion.direction.2",
    "motion.direction.0",
    "motion.phase.0.speed_mm_s",
    "motion.phase.0.depth_mm",
    "motion.phase.1.duration_s",
    "motion.phase.2.depth_mm",
    "puncture.softened_radius_mm",
    "friction.coefficient",
    "solver.mass_scaling",
    "solver.time_step_us",
    "outputs.pictures_at_depth_mm.0",
    "outputs.picture_width_px",
    "tissue.size_mm",
];

const VALUES: [&str; 16] = [
    "nan",
    "-nan",
    "inf",
    "-inf",
    "0",
    "-0.0",
    "-1",
    "1e300",
    "-1e300",
    "1e-300",
    "1e999",
    "9223372036854775807",
    "",
    "[]",
    "\"\"",
    "{}",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_number_gives_a_scene_or_a_message(
        first in 0..NUMBERS.len(), second in 0..NUMBERS.len(), a in 0..VALUES.len(), b in 0..VALUES.len(), random in any::<f64>(),
    ) {
        let overrides = [
            format!("{}={}", NUMBERS[first], VALUES[a]),
            format!("{}={}", NUMBERS[second], if b % 3 == 0 { format!("{random:e}") } else { VALUES[b].to_string() }),
        ];
        match Scene::load(&main_scene(), &overrides) {
            Ok(scene) => { BlockMesh::for_scene(&scene); }
            Err(Error::Scene(message)) => prop_assert!(message.contains("= way out: "), "{}", message),
            Err(other) => prop_assert!(false, "wrong kind of error: {}", other),
        }
    }

    #[test]
    fn any_damage_to_the_text_gives_a_scene_or_a_message(at in 0.0..1.0f64, length in 0..40usize, text in "[\\[\\]{}=\"a-z0-9.\n ]{0,8}") {
        let mut bytes = std::fs::read(main_scene()).unwrap();
        let from = (at * bytes.len() as f64) as usize;
        let to = (from + length).min(bytes.len());
        bytes.splice(from..to, text.bytes());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("damaged.toml");
        std::fs::write(&path, &bytes).unwrap();
        match Scene::load(&path, &[]) {
            Ok(_) => {}
            Err(Error::Scene(message)) => prop_assert!(message.contains("= way out: "), "{}", message),
            Err(other) => prop_assert!(false, "wrong kind of error: {}", other),
        }
    }
}
