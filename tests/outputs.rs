//! What a run leaves behind: folders, tables, summary, fields, chart and pictures, on made-up data.
//!
//! Pictures and charts stay in cargo's folder for test files (`target/tmp`) to be looked at.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3};
use stylet::effects::{EffectSet, TissueMaterial};
use stylet::material::ElasticLaw;
use stylet::mesh::{BlockMesh, Mesh, Tissue};
use stylet::needle::{Motion, NeedleShape, Phase, Tool};
use stylet::observables::quantity::{ENERGY, FORCE, FORCE_ERROR, columns};
use stylet::observables::{EnergyAccount, FieldSnapshot, ForceParts, FrameRecord, Health};
use stylet::output::folder::{
    ENERGY_TABLE, FORCE_CHART, FORCE_PARTS_CHART, FORCE_TABLE, SAMPLE_CHART, SAMPLE_TABLE, SUMMARY,
};
use stylet::output::sample::{Motion as FaceMotion, SAMPLE};
use stylet::output::{
    CurveFigures, DrivenFace, FieldFiles, OutputFolder, PictureMoment, Status, Summary, Tables, write_force_chart,
    write_parts_chart, write_sample_chart,
};
use stylet::render::{self, Image, Picture, offscreen, raster};
use stylet::scene::{Face, FaceCondition, FaceDrive, Outputs, Scene, SolverSettings, Target};
use stylet::verdict::{Doubt, Quantity, Verdict};
use stylet::{Error, Result};

/// Shaft radius of a 16 G needle [m].
const RADIUS: f64 = 0.826e-3;

fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn is_input_error<T: std::fmt::Debug>(result: Result<T>, part: &str) {
    let error = result.expect_err("an error");
    assert_eq!(error.exit_code(), 2, "{error}");
    assert!(matches!(error, Error::Input { .. }), "{error:?}");
    assert!(error.to_string().contains(part), "{error}");
}

/// Insertion to 12 mm and back at 2 mm/s, 30 frames per second.
fn records() -> Vec<FrameRecord> {
    (0..=360)
        .map(|frame| {
            let time = frame as f64 / 30.0;
            let inward = time <= 6.0;
            let depth = 2e-3 * if inward { time } else { 12.0 - time };
            let cutting = match depth {
                _ if !inward => 0.0,
                d if d < 3e-3 => 0.9 * (d / 3e-3).powi(2),
                d => (0.9 - 2000.0 * (d - 3e-3)).max(0.25),
            };
            let spreading = if inward { 20.0 * depth } else { 2.0 * depth };
            let friction = if inward { 45.0 * depth } else { -50.0 * depth };
            FrameRecord {
                frame,
                step: 400 * (frame + 1),
                time,
                depth,
                phase: usize::from(!inward),
                force: ForceParts {
                    axial: cutting + spreading + friction,
                    cutting,
                    tip_spreading: 0.25 * spreading,
                    shaft_spreading: 0.75 * spreading,
                    friction,
                    lateral: DVec3::new(0.01, -0.02, 0.0),
                    torque: DVec3::new(1e-5, 0.0, 2e-6),
                    ..Default::default()
                },
                tip_coordinate: depth - 0.5e-3,
                energy: EnergyAccount {
                    external: 1e-3 * time,
                    elastic: 8e-4 * time,
                    kinetic: 1e-6,
                    hourglass: 2e-5 * time,
                    cutting: 1.7e-4 * time,
                    plastic: 3e-6,
                    viscous: 4e-6,
                    external_max: 1e-3 * time,
                    ..Default::default()
                },
                health: Health { return_failures: 2, ..Default::default() },
                ..Default::default()
            }
        })
        .collect()
}

/// Grid lines from `low` to `high`: fine cells within `fine` of 0, growing ones outside.
fn graded(low: f64, high: f64, cell: f64, fine: f64) -> Vec<f64> {
    let side = |end: f64| -> Vec<f64> {
        let mut lines = Vec::new();
        let (mut at, mut step) = (0.0, cell);
        while at < end.abs() - 0.6 * step {
            if at >= fine {
                step *= 1.25;
            }
            at = (at + step).min(end.abs());
            lines.push(at);
        }
        if let Some(last) = lines.last_mut() {
            *last = end.abs();
        }
        lines
    };
    let mut lines: Vec<f64> = side(low).into_iter().rev().map(|x| -x).collect();
    lines.push(0.0);
    lines.extend(side(high));
    lines
}

fn mesh(cell: f64) -> Mesh {
    Mesh::Block(BlockMesh::new([
        graded(-10e-3, 10e-3, cell, 3e-3),
        graded(-10e-3, 10e-3, cell, 3e-3),
        graded(-16e-3, 0.0, cell, 9e-3),
    ]))
}

fn scene(tool: Option<Tool>, direction: DVec3) -> Scene {
    Scene {
        name: "synthetic".into(),
        title: "16G needle in calf muscle (made-up field)".into(),
        path: PathBuf::from("scenes/synthetic.toml"),
        tissue: Tissue {
            top: 0.0,
            size: DVec3::new(20e-3, 20e-3, 16e-3),
            cell_size: 0.6e-3,
            fine_radius: 3e-3,
            growth: 1.25,
            axis_offset_cells: [0.0, 0.0],
        },
        material: TissueMaterial::new("test", "test", ElasticLaw::mooney_rivlin(2e3, 1e3, 1e5), 1060.0),
        regions: Vec::new(),
        mesh: None,
        case: None,
        supports: Vec::new(),
        loads: Vec::new(),
        skin_free: None,
        faces: std::array::from_fn(|_| FaceCondition::default()),
        tool,
        motion: Motion {
            entry: DVec3::ZERO,
            direction: direction.normalize(),
            phases: vec![Phase::Insert { speed: 2e-3, depth: 6e-3 }],
            vibration: None,
        },
        effects: EffectSet::default(),
        solver: SolverSettings {
            on_trouble: Default::default(),
            safety: 0.8,
            time_step: None,
            mass_damping: 10.0,
            hourglass_stiffness: 0.1,
            hourglass_quartic: 0.0,
            frame_rate: 30.0,
            duration: None,
        },
        outputs: Outputs { picture_width: 900, ..Default::default() },
        targets: Vec::new(),
        task: None,
        notices: Vec::new(),
    }
}

fn needle() -> Option<Tool> {
    Some(Tool::Needle(NeedleShape::cone("16G", RADIUS, 3e-3)))
}

/// A dimple at the entry, tissue pushed aside by the shaft, stress falling with the distance from the tool.
fn snapshot(scene: &Scene, mesh: &Mesh, depth: f64) -> FieldSnapshot {
    let direction = scene.motion.direction;
    let tip = scene.motion.entry + depth * direction;
    // Vector from the axis, coordinate along it, distance from the tip.
    let place = |x: DVec3| {
        let along = (x - scene.motion.entry).dot(direction);
        let aside = x - scene.motion.entry - along * direction;
        (aside, along, x.distance(tip))
    };
    let displacement = (0..mesh.node_count())
        .map(|n| {
            let x = mesh.rest_position(n);
            let (aside, along, _) = place(x);
            let r = aside.length();
            let dimple = 0.9e-3 * (-(r / 3e-3).powi(2)).exp() * (-(x.z / 4e-3).powi(2)).exp();
            let wedge = ((depth - along) / 3e-3).clamp(0.0, 1.0);
            let pushed = (r * r + (RADIUS * wedge).powi(2)).sqrt() - r;
            let floor = 1.0 - (x.z / 16e-3).abs().powi(4);
            let push = pushed * (1.0 - (r / 14e-3).min(1.0));
            floor * (direction * dimple + aside.normalize_or_zero() * push)
        })
        .collect();
    let per_cell = |value: &dyn Fn(DVec3) -> f64| -> Vec<f64> {
        (0..mesh.cell_count()).map(|c| value(mesh.cell_centre(c))).collect()
    };
    FieldSnapshot {
        centre_line: None,
        cells_in_needle: None,
        targets: Vec::new(),
        frame: 90,
        time: 3.0,
        depth,
        axial_force: 0.74,
        tool_pose: Some((tip, direction)),
        displacement,
        von_mises: per_cell(&|x| {
            let (aside, along, from_tip) = place(x);
            let beside_shaft = if along < depth { (-aside.length() / 1.6e-3).exp() } else { 0.0 };
            5e3 * beside_shaft + 9e3 * (-from_tip / 1.4e-3).exp()
        }),
        jacobian: per_cell(&|_| 0.99),
        pressure: per_cell(&|x| 100.0 * x.z),
        plastic_strain: Vec::new(),
        damage: Vec::new(),
        material: Vec::new(),
        stiffness: per_cell(&|x| {
            let (aside, along, _) = place(x);
            if aside.length() < 0.7e-3 && along < depth { 0.02 } else { 1.0 }
        }),
        ..Default::default()
    }
}

// Folders

/// A scene without targets and effects.
fn bare() -> Scene {
    Scene::block(DVec3::splat(2e-3), 1e-3, TissueMaterial::preset("across-fibre").unwrap())
}

#[test]
fn a_named_folder_is_made_and_not_reused() {
    let base = tempfile::tempdir().unwrap();
    let path = base.path().join("a/b");
    let folder = OutputFolder::create(Some(&path), "scene", false).unwrap();
    assert_eq!(folder.path(), path);
    // Files of other origin are no obstacle and survive.
    fs::write(path.join("notes.txt"), "mine").unwrap();
    fs::create_dir(path.join("frames")).unwrap();
    fs::write(path.join("frames/mine.vtu"), "mine").unwrap();
    OutputFolder::create(Some(&path), "scene", false).unwrap();
    for result in [
        "force.csv",
        "energy.csv",
        "summary.json",
        "force.svg",
        "force_parts.svg",
        "core.csv",
        "targets.csv",
        "sample.csv",
        "sample.svg",
        "frames.pvd",
        "stress_06.00mm.png",
        "frames/frame_00001.vtu",
    ] {
        fs::write(path.join(result), "old").unwrap();
        is_input_error(OutputFolder::create(Some(&path), "scene", false), "--force");
        is_input_error(OutputFolder::create(Some(&path), "scene", false), result);
        assert!(path.join(result).exists(), "{result}");
        OutputFolder::create(Some(&path), "scene", true).unwrap();
        assert!(!path.join(result).exists(), "{result}");
        assert_eq!(fs::read_to_string(path.join("notes.txt")).unwrap(), "mine");
        assert!(path.join("frames/mine.vtu").exists());
    }
}

#[test]
fn force_removes_an_emptied_frames_folder() {
    let base = tempfile::tempdir().unwrap();
    fs::create_dir(base.path().join("frames")).unwrap();
    fs::write(base.path().join("frames/frame_00001.vtu"), "old").unwrap();
    OutputFolder::create(Some(base.path()), "scene", true).unwrap();
    assert_eq!(fs::read_dir(base.path()).unwrap().count(), 0);
}

#[test]
fn numbered_folders_go_up() {
    let base = tempfile::tempdir().unwrap();
    let next = || {
        let folder = OutputFolder::create_numbered(base.path(), "muscle").unwrap();
        folder.path().strip_prefix(base.path()).unwrap().to_path_buf()
    };
    assert_eq!(next(), Path::new("muscle/001"));
    assert_eq!(next(), Path::new("muscle/002"));
    fs::create_dir(base.path().join("muscle/017")).unwrap();
    fs::create_dir(base.path().join("muscle/best")).unwrap();
    assert_eq!(next(), Path::new("muscle/018"));
    // A gap is not filled: numbers stay in the order of time.
    fs::remove_dir(base.path().join("muscle/001")).unwrap();
    assert_eq!(next(), Path::new("muscle/019"));
}

#[test]
fn a_folder_that_cannot_be_written_to_is_an_input_error() {
    let base = tempfile::tempdir().unwrap();
    let file = base.path().join("file");
    fs::write(&file, "").unwrap();
    is_input_error(OutputFolder::create(Some(&file), "scene", false), "file");
    is_input_error(OutputFolder::create(Some(&file.join("below")), "scene", true), "--out");
    is_input_error(OutputFolder::create_numbered(&file, "scene"), "--out");
}

#[test]
fn pictures_are_named_by_their_moment() {
    let base = tempfile::tempdir().unwrap();
    let folder = OutputFolder::create(Some(base.path()), "scene", false).unwrap();
    let first = folder.picture(PictureMoment::Depth(12e-3));
    assert_eq!(first.file_name().unwrap(), "stress_12.00mm.png");
    fs::write(&first, "").unwrap();
    let second = folder.picture(PictureMoment::Depth(12e-3));
    assert_eq!(second.file_name().unwrap(), "stress_12.00mm_2.png");
    let timed = folder.picture(PictureMoment::Time(0.25));
    assert_eq!(timed.file_name().unwrap(), "stress_0.2500s.png");
}

// Tables

#[test]
fn tables_grow_row_by_row_and_survive_without_being_closed() {
    let base = tempfile::tempdir().unwrap();
    let folder = OutputFolder::create(Some(base.path()), "scene", false).unwrap();
    let mut tables = Tables::create(&folder, &[], false, &bare()).unwrap();
    assert!(!folder.file(SAMPLE_TABLE).exists());
    let records = records();
    for (rows, record) in records.iter().take(5).enumerate() {
        tables.append(record).unwrap();
        // Read while the tables are open, as after a crash.
        let text = fs::read_to_string(folder.file(FORCE_TABLE)).unwrap();
        assert_eq!(text.lines().count(), rows + 2);
        assert!(text.ends_with('\n'));
    }
    std::mem::forget(tables);
    // That of the band is there with a companion run only.
    let without_band: Vec<&str> = columns(&FORCE).into_iter().filter(|column| *column != FORCE_ERROR).collect();
    for (name, columns) in [(FORCE_TABLE, without_band), (ENERGY_TABLE, columns(&ENERGY))] {
        let mut reader = csv::Reader::from_path(folder.file(name)).unwrap();
        assert_eq!(reader.headers().unwrap(), columns.as_slice());
        let rows: Vec<Vec<f64>> =
            reader.records().map(|row| row.unwrap().iter().map(|f| f.parse().unwrap()).collect()).collect();
        assert_eq!(rows.len(), 5);
        assert!((rows[4][0] - records[4].time).abs() < 1e-9);
        assert!((rows[4][1] - records[4].depth).abs() < 1e-12);
        let column = |key: &str| columns.iter().position(|c| *c == key).unwrap();
        if name == FORCE_TABLE {
            assert!((rows[4][column("axial_force_n")] - records[4].force.axial).abs() < 1e-9);
            assert_eq!(rows[4][column("lateral_y_n")], -0.02);
        } else {
            let ratio = rows[4][column("hourglass_to_internal")];
            assert!((ratio - 2.0 / 82.0).abs() < 1e-8, "{ratio}");
            let imbalance = rows[4][column("imbalance")];
            assert!((imbalance - records[4].energy.imbalance()).abs() < 1e-9);
            assert_eq!(rows[4][column("plastic_j")], 3e-6);
            assert_eq!(rows[4][column("viscous_j")], 4e-6);
            assert_eq!(rows[4][column("return_failures")], 2.0);
        }
    }
}

// Summary

#[test]
fn a_summary_is_written_whole_and_read_back() {
    let base = tempfile::tempdir().unwrap();
    let path = base.path().join(SUMMARY);
    let mut summary = Summary {
        scene: "muscle".into(),
        engine: "gpu".into(),
        effects: vec!["puncture".into(), "friction".into()],
        cells: 12_000,
        cpu_ns_per_cell_step: None,
        status: Status::Interrupted,
        ..Default::default()
    };
    let mut records = records();
    let doubt = Doubt {
        quantity: Quantity::EnergyImbalance,
        value: 0.04,
        bound: 0.02,
        frame: 3,
        time_s: 0.05,
        place: Some("node 7".into()),
    };
    let last = records.last_mut().unwrap();
    last.verdict = Verdict { doubts: vec![doubt.clone()], worst_imbalance: 0.04 };
    last.energy.advance_cap = 2e-5;
    summary.take_frames(&records);
    let near = |value: Option<f64>, expected: f64, tolerance: f64| {
        let value = value.unwrap();
        assert!((value - expected).abs() < tolerance, "{value}, {expected}");
    };
    near(summary.puncture_depth_m, 3e-3, 1e-4);
    near(summary.puncture_force_n, 0.9 + 65.0 * 3e-3, 2e-2);
    near(summary.slope_after_puncture_n_per_m, 65.0, 1e-6);
    near(summary.linear_fit_r2, 1.0, 1e-9);
    near(summary.force_at_max_depth_n, 0.25 + 65.0 * 11.9e-3, 1e-2);
    // The verdict is that of the last frame; a summary judges nothing itself.
    assert_eq!((summary.energy_imbalance, &summary.doubts), (0.04, &vec![doubt]));
    assert_eq!(summary.advance_cap_j, 2e-5);
    assert!((summary.hourglass_to_internal - 2.0 / 82.0).abs() < 1e-12);
    summary.write(&path).unwrap();
    assert_eq!(Summary::read(&path).unwrap(), summary);
    let text = fs::read_to_string(&path).unwrap();
    for key in "scene engine adapter driver effects cells nodes dt_s stable_dt_s mass_scaling steps simulated_s \
                wall_s real_time_factor cell_steps_per_s cpu_ns_per_cell_step first_step_ms host_peak_bytes \
                device_bytes peak_force_n puncture_force_n puncture_depth_m force_after_puncture_n \
                force_at_max_depth_n slope_after_puncture_n_per_m energy_imbalance kinetic_to_internal \
                hourglass_to_internal hourglass_to_internal_max clamped_nodes inverted_cells status linear_fit_r2 \
                return_failures face peak_nominal_stress_pa stretch_at_peak"
        .split_whitespace()
    {
        assert!(text.contains(&format!("\"{key}\":")), "{key}");
    }
    assert!(text.contains("\"status\": \"interrupted\""));

    // Written again it replaces the file; no temporary file stays.
    summary.energy_imbalance = f64::NAN;
    summary.write(&path).unwrap();
    assert!(Summary::read(&path).unwrap().energy_imbalance.is_nan());
    assert_eq!(fs::read_dir(base.path()).unwrap().count(), 1);
    // A failed write names the file.
    let nowhere = base.path().join("missing").join(SUMMARY);
    let error = summary.write(&nowhere).unwrap_err();
    assert!(error.to_string().contains(SUMMARY), "{error}");
    fs::write(&path, "{}").unwrap();
    is_input_error(Summary::read(&path), "no summary");
}

#[test]
fn a_failed_write_keeps_the_old_file() {
    let base = tempfile::tempdir().unwrap();
    let path = base.path().join("held.json");
    fs::write(&path, "old").unwrap();
    // A folder of the temporary name stands in the way.
    fs::create_dir(base.path().join("held.json.part")).unwrap();
    assert!(stylet::whole_file::write(&path, b"new").is_err());
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
}

// Fields

/// Decodes base64, independent of the writer.
fn decode(text: &str) -> Vec<u8> {
    let digit = |b: u8| match b {
        b'A'..=b'Z' => b - b'A',
        b'a'..=b'z' => b - b'a' + 26,
        b'0'..=b'9' => b - b'0' + 52,
        b'+' => 62,
        b'/' => 63,
        other => panic!("{other} is no base64 digit"),
    };
    let mut bytes = Vec::new();
    let (mut word, mut bits) = (0u32, 0);
    for b in text.trim_end_matches('=').bytes() {
        word = word << 6 | u32::from(digit(b));
        bits += 6;
        if bits >= 8 {
            bits -= 8;
            bytes.push((word >> bits) as u8);
            word &= (1 << bits) - 1;
        }
    }
    bytes
}

/// Start tag and decoded data (without the length) of the named array.
fn vtu_array(text: &str, name: &str) -> (String, Vec<u8>) {
    let at = text.find(&format!("Name=\"{name}\"")).unwrap_or_else(|| panic!("no array {name}"));
    let start = text[..at].rfind('<').unwrap();
    let open = at + text[at..].find('>').unwrap();
    let close = open + text[open..].find('<').unwrap();
    let bytes = decode(&text[open + 1..close]);
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    assert_eq!(length, bytes.len() - 8, "length of {name}");
    (text[start..open].to_string(), bytes[8..].to_vec())
}

fn as_floats(bytes: &[u8]) -> Vec<f32> {
    let (words, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    words.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

fn as_integers(bytes: &[u8]) -> Vec<i32> {
    let (words, rest) = bytes.as_chunks::<4>();
    assert!(rest.is_empty());
    words.iter().map(|b| i32::from_le_bytes(*b)).collect()
}

/// Every start tag has its end tag; attributes are quoted.
fn assert_well_formed(xml: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = xml;
    while let Some(at) = rest.find('<') {
        assert!(!rest[..at].contains('>'), "stray > before {}", &rest[at..]);
        let end = at + rest[at..].find('>').expect("an end of the tag");
        let tag = &rest[at + 1..end];
        rest = &rest[end + 1..];
        if tag.starts_with(['?', '!']) || tag.ends_with('/') {
            continue;
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name.trim()));
        } else {
            assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
            open.push(tag.split_whitespace().next().unwrap());
        }
    }
    assert!(open.is_empty(), "{open:?}");
}

#[test]
fn fields_hold_the_mesh_and_the_collection_its_frames() {
    let base = kept("fields");
    let folder = OutputFolder::create(Some(&base), "scene", true).unwrap();
    let mut files = FieldFiles::new(&folder);
    let scene = scene(needle(), DVec3::NEG_Z);
    let mesh = mesh(1.2e-3);
    let mut snapshot = snapshot(&scene, &mesh, 6e-3);
    let path = files.write(&mesh, &snapshot).unwrap();
    assert_eq!(path, base.join("frames/frame_00090.vtu"));

    let text = fs::read_to_string(&path).unwrap();
    assert_well_formed(&text);
    let (nodes, cells) = (mesh.node_count(), mesh.cell_count());
    assert!(text.contains(&format!("NumberOfPoints=\"{nodes}\" NumberOfCells=\"{cells}\"")));
    let points = as_floats(&vtu_array(&text, "Points").1);
    assert_eq!(points.len(), 3 * nodes);
    assert_eq!(points[3 * (nodes - 1)], 10e-3);
    assert_eq!(points[3 * (nodes - 1) + 2], 0.0);
    let connectivity = as_integers(&vtu_array(&text, "connectivity").1);
    assert_eq!(connectivity.len(), 8 * cells);
    assert!(connectivity.iter().all(|&n| (0..nodes as i32).contains(&n)));
    let offsets = as_integers(&vtu_array(&text, "offsets").1);
    let expected: Vec<i32> = (1..=cells as i32).map(|c| 8 * c).collect();
    assert_eq!(offsets, expected);
    assert_eq!(vtu_array(&text, "types").1, vec![12; cells]);
    let displacement = as_floats(&vtu_array(&text, "displacement_m").1);
    assert_eq!(displacement.len(), 3 * nodes);
    assert!(displacement.iter().all(|v| v.is_finite()));
    assert_eq!(displacement[4], snapshot.displacement[1].y as f32);
    for (name, field) in [
        ("von_mises_pa", &snapshot.von_mises),
        ("jacobian", &snapshot.jacobian),
        ("pressure_pa", &snapshot.pressure),
        ("stiffness", &snapshot.stiffness),
    ] {
        let (tag, bytes) = vtu_array(&text, name);
        assert!(tag.contains("type=\"Float32\""), "{tag}");
        let expected: Vec<f32> = field.iter().map(|&v| v as f32).collect();
        assert_eq!(as_floats(&bytes), expected, "{name}");
    }
    // A hexahedron in VTK order has a positive volume.
    let corner = |n: usize| {
        let at = 3 * connectivity[n] as usize;
        DVec3::from_array([at, at + 1, at + 2].map(|i| f64::from(points[i])))
    };
    let edges = [1, 3, 4].map(|n| corner(n) - corner(0));
    assert!(edges[0].cross(edges[1]).dot(edges[2]) > 0.0);

    snapshot.frame = 120;
    snapshot.time = 4.0;
    snapshot.stiffness.clear();
    let second = files.write(&mesh, &snapshot).unwrap();
    assert!(!fs::read_to_string(second).unwrap().contains("stiffness"));
    let collection = fs::read_to_string(base.join("frames.pvd")).unwrap();
    assert_well_formed(&collection);
    assert!(collection.contains("timestep=\"3\" part=\"0\" file=\"frames/frame_00090.vtu\""));
    assert!(collection.contains("timestep=\"4\" part=\"0\" file=\"frames/frame_00120.vtu\""));
}

// Chart

#[test]
fn charts_are_well_formed() {
    let base = kept("charts");
    fs::create_dir_all(&base).unwrap();
    let all = records();
    let still: Vec<FrameRecord> = all.iter().map(|r| FrameRecord { depth: 0.0, ..r.clone() }).collect();
    let mut broken = all.clone();
    broken[50].force.axial = f64::NAN;
    for (name, title, records) in [
        (FORCE_CHART, "Biopsy of calf muscle, 16G, 2 mm/s", &all[..]),
        ("inward.svg", "Insertion <only> & no return", &all[..150]),
        ("over_time.svg", "No insertion", &still[..]),
        ("empty.svg", "", &[]),
        ("one.svg", &"long title ".repeat(30), &all[..1]),
        ("broken.svg", "A frame without a number", &broken[..]),
    ] {
        let path = base.join(name);
        let figures = CurveFigures::from_records(records);
        write_force_chart(&path, title, records, &figures).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("<svg"), "{name}");
        assert_well_formed(&text);
        assert!(!text.contains("NaN"), "{name}");
        if name == FORCE_CHART {
            assert!(text.contains("depth of the tip [mm]"));
            let label = format!("puncture {:.2} N at", figures.puncture_force.unwrap());
            assert!(text.contains(&label));
        }
    }
}

#[test]
fn parts_of_the_force_add_up_in_tables_and_charts() {
    let base = kept("charts");
    fs::create_dir_all(&base).unwrap();
    let all = records();
    for record in &all {
        let sum: f64 = ForceParts::PARTS.iter().map(|part| (part.of)(&record.force)).sum();
        assert!((sum - record.force.axial).abs() < 1e-12);
    }
    for part in ForceParts::PARTS {
        assert!(columns(&FORCE).contains(&part.column), "{}", part.column);
    }
    let mut broken = all.clone();
    broken[50].force.friction = f64::NAN;
    for (name, records, abscissa) in [
        (FORCE_PARTS_CHART, &all[..], "time [s]"),
        ("parts_inward.svg", &all[..150], "depth of the tip [mm]"),
        ("parts_broken.svg", &broken[..], "time [s]"),
        ("parts_empty.svg", &[], "time [s]"),
    ] {
        write_parts_chart(&base.join(name), "Parts <of> the force", records).unwrap();
        let text = fs::read_to_string(base.join(name)).unwrap();
        assert_well_formed(&text);
        assert!(!text.contains("NaN") && text.contains(abscissa), "{name}");
        for part in ForceParts::PARTS {
            // What does not act has no area and no entry in the legend.
            let acts = records.iter().any(|r| (part.of)(&r.force) != 0.0);
            assert_eq!(text.contains(part.name), acts, "{name}: {}", part.name);
        }
    }
}

// Sample

/// The block of the tests with a face that is driven.
fn driven(face: Face, displacement_mm: [f64; 3], duration: f64) -> [FaceCondition; 6] {
    let mut faces: [FaceCondition; 6] = Default::default();
    let drive = FaceDrive { displacement: DVec3::from(displacement_mm) * 1e-3, rotation: 0.0, duration, cycles: 0 };
    faces[face as usize] = FaceCondition { fixed: [true; 3], drive: Some(drive), ..Default::default() };
    faces
}

/// A pull over 2 s whose reaction (along the displacement) rises to `largest` [N] at 1.5 s and falls to half of it.
fn pulled(face: Face, along: DVec3, largest: f64) -> Vec<FrameRecord> {
    (0..=60)
        .map(|frame| {
            let time = frame as f64 / 30.0;
            let force = largest * if time <= 1.5 { time / 1.5 } else { 1.0 - (time - 1.5) };
            let mut record = FrameRecord { frame, time, ..Default::default() };
            record.reactions[face as usize] = along * force;
            record
        })
        .collect()
}

#[test]
fn a_sample_is_written_per_driven_face() {
    let base = tempfile::tempdir().unwrap();
    let folder = OutputFolder::create(Some(base.path()), "scene", false).unwrap();
    let mesh = mesh(2e-3);
    // 16 mm between the faces, 20 x 20 mm: pulled to a stretch of 1.5, 40 N are 100 kPa.
    let faces = DrivenFace::of_scene(&driven(Face::ZMax, [0.0, 0.0, 8.0], 2.0), &mesh);
    let records = pulled(Face::ZMax, DVec3::Z, 40.0);
    let mut tables = Tables::create(&folder, &faces, false, &bare()).unwrap();
    for (rows, record) in records.iter().enumerate() {
        tables.append(record).unwrap();
        let text = fs::read_to_string(folder.file(SAMPLE_TABLE)).unwrap();
        assert_eq!((text.lines().count(), text.ends_with('\n')), (rows + 2, true));
    }
    let mut reader = csv::Reader::from_path(folder.file(SAMPLE_TABLE)).unwrap();
    assert_eq!(reader.headers().unwrap(), columns(&SAMPLE).as_slice());
    let row = reader.records().nth(45).unwrap().unwrap();
    assert_eq!(
        row.iter().collect::<Vec<_>>(),
        ["1.5", "z_max", "0", "0", "0.006", "0", "0", "0", "40", "1.375", "100000", "", "0"]
    );

    let mut summary = Summary::default();
    summary.take_sample(&faces, &records);
    assert_eq!(summary.face.as_deref(), Some("z_max"));
    assert!((summary.peak_nominal_stress_pa.unwrap() - 1e5).abs() < 1e-6);
    assert!((summary.stretch_at_peak.unwrap() - 1.375).abs() < 1e-12);
    summary.take_sample(&[], &records);
    assert_eq!((summary.face, summary.peak_nominal_stress_pa, summary.stretch_at_peak), (None, None, None));
}

#[test]
fn signs_of_a_sample_are_those_of_the_outward_normal() {
    let mesh = mesh(2e-3);
    let one = |face, mm, reaction| {
        let faces = DrivenFace::of_scene(&driven(face, mm, 1.0), &mesh);
        let mut record = FrameRecord { time: 1.0, ..Default::default() };
        record.reactions[face as usize] = reaction;
        (faces[0].motion(), faces[0].point(&record))
    };
    // Pushed in at x_min: the reaction points inwards, 16 x 20 mm.
    let (motion, squeezed) = one(Face::XMin, [2.0, 0.0, 0.0], DVec3::new(3.2, 0.0, 0.0));
    assert_eq!(motion, FaceMotion::Normal);
    assert!((squeezed.stretch - 0.9).abs() < 1e-12 && (squeezed.nominal_stress.unwrap() + 1e4).abs() < 1e-6);
    // Sheared along -y at z_max, 20 x 20 mm: the stress counts along the drive.
    let (motion, sheared) = one(Face::ZMax, [0.0, -4.0, 0.0], DVec3::new(0.0, -4.0, 2.0));
    assert_eq!(motion, FaceMotion::Tangential);
    assert!((sheared.shear - 0.25).abs() < 1e-12 && (sheared.shear_stress.unwrap() - 1e4).abs() < 1e-6);
    assert!((sheared.nominal_stress.unwrap() - 5e3).abs() < 1e-6 && sheared.stretch == 1.0);
    // Moved by 2 mm along x, held back by 5 N along y: the axis goes with the face, and the force through it turns nothing.
    let faces = DrivenFace::of_scene(&driven(Face::ZMax, [2.0, 0.0, 0.0], 1.0), &mesh);
    let mut record = FrameRecord { time: 1.0, ..Default::default() };
    record.reactions[Face::ZMax as usize] = DVec3::new(0.0, -5.0, 0.0);
    record.face_moments[Face::ZMax as usize] = -0.01 + 0.003;
    assert!((faces[0].point(&record).moment - 0.003).abs() < 1e-15);
    // Both ends driven apart: the stretch counts what lies between them.
    let mut both = driven(Face::ZMax, [0.0, 0.0, 4.0], 1.0);
    both[Face::ZMin as usize] = driven(Face::ZMin, [0.0, 0.0, -4.0], 1.0)[Face::ZMin as usize].clone();
    let faces = DrivenFace::of_scene(&both, &mesh);
    let record = FrameRecord { time: 2.0, ..Default::default() };
    assert_eq!(faces.iter().map(|f| f.point(&record).stretch).collect::<Vec<_>>(), [1.5, 1.5]);
}

#[test]
fn a_tetrahedral_face_has_a_stretch_and_no_stress() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|x| x * 1e-2);
    let tets = stylet::mesh::TetMesh { positions: corners.to_vec(), tets: vec![[0, 1, 2, 3]], ..Default::default() };
    let mesh = Mesh::Tets(std::sync::Arc::new(tets));
    let faces = DrivenFace::of_scene(&driven(Face::ZMax, [0.0, 0.0, 1.0], 2.0), &mesh);
    let records = pulled(Face::ZMax, DVec3::Z, 1.0);
    let point = faces[0].point(records.last().unwrap());
    assert!((point.stretch - 1.1).abs() < 1e-12);
    assert_eq!((point.nominal_stress, point.shear_stress), (None, None));
    let mut summary = Summary::default();
    summary.take_sample(&faces, &records);
    assert_eq!((summary.face.as_deref(), summary.peak_nominal_stress_pa), (Some("z_max"), None));
}

/// A body away from the plane y = 0, in two pieces with a gap between them at its middle: the cut goes through tissue, the first
/// target's where there is one.
#[test]
fn the_cut_goes_where_the_mesh_is() {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let piece = |y: f64| corners.map(|x| x * 1e-2 + DVec3::Y * y);
    let positions: Vec<DVec3> = piece(2e-3).into_iter().chain(piece(42e-3)).collect();
    let tets = stylet::mesh::TetMesh { positions, tets: vec![[0, 1, 2, 3], [4, 5, 6, 7]], ..Default::default() };
    let mesh = Mesh::Tets(std::sync::Arc::new(tets));
    let mut scene = scene(None, DVec3::NEG_Z);
    let snapshot = FieldSnapshot {
        displacement: vec![DVec3::ZERO; 8],
        von_mises: vec![1e3; 2],
        jacobian: vec![1.0; 2],
        ..Default::default()
    };
    let cut = render::slice::Plane::of_scene(&scene, &mesh, &snapshot);
    let shown = render::slice::cut(&mesh, &snapshot, &cut, scene.tissue.cell_size);
    assert!(!shown.triangles.is_empty(), "the cut at {} meets nothing", cut.origin);
    // The picture of a cut that meets nothing, here of a body that has flown away, says so with more strokes.
    let strokes = |snapshot: &FieldSnapshot| {
        let ink = |v: &&stylet::render::picture::Vertex| v.field_weight == 0.0;
        Picture::compose(&scene, &mesh, snapshot).vertices.iter().filter(ink).count()
    };
    let flown = FieldSnapshot { displacement: vec![DVec3::Y * 50e-3; 8], ..snapshot.clone() };
    assert!(strokes(&flown) > strokes(&snapshot), "an empty picture says nothing");
    let plane = |scene: &Scene| render::slice::Plane::of_scene(scene, &mesh, &snapshot).origin.y;
    let first = plane(&scene);
    assert!((2e-3..12e-3).contains(&first) || (42e-3..52e-3).contains(&first), "{first}");
    for (at, [low, high]) in [(43e-3, [42e-3, 52e-3]), (5e-3, [2e-3, 12e-3])] {
        scene.targets = vec![stylet::scene::Target { name: "t".into(), position: DVec3::Y * at, radius: 1e-3 }];
        assert!((low..high).contains(&plane(&scene)), "{at}");
    }
    // A mesh that the usual plane meets is cut there.
    scene.motion.entry.y = 4e-3;
    assert_eq!(plane(&scene), 4e-3);
}

#[test]
fn sample_charts_are_well_formed() {
    let base = kept("charts");
    fs::create_dir_all(&base).unwrap();
    let mesh = mesh(2e-3);
    let pull = pulled(Face::ZMax, DVec3::Z, 40.0);
    let squeeze = pulled(Face::ZMax, DVec3::NEG_Z, 40.0);
    let shear = pulled(Face::ZMax, DVec3::X, 40.0);
    let mut broken = pull.clone();
    broken[20].reactions[Face::ZMax as usize].z = f64::NAN;
    let mut twist = driven(Face::ZMax, [0.0; 3], 2.0);
    twist[Face::ZMax as usize].drive.as_mut().unwrap().rotation = 0.5;
    for (name, faces, records, expected) in [
        (SAMPLE_CHART, driven(Face::ZMax, [0.0, 0.0, 8.0], 2.0), &pull[..], "100.00 kPa at 1.375"),
        ("sample_squeezed.svg", driven(Face::ZMax, [0.0, 0.0, -4.0], 2.0), &squeeze[..], "-100.00 kPa at 0.812"),
        ("sample_sheared.svg", driven(Face::ZMax, [4.0, 0.0, 0.0], 2.0), &shear[..], "amount of shear"),
        ("sample_twisted.svg", twist, &squeeze[..], "rotation [deg]"),
        ("sample_held.svg", driven(Face::ZMax, [0.0, 0.0, 8.0], 0.5), &pull[..], "time [s]"),
        ("sample_broken.svg", driven(Face::ZMax, [0.0, 0.0, 8.0], 2.0), &broken[..], "100.00 kPa"),
        ("sample_empty.svg", driven(Face::ZMax, [0.0, 0.0, 8.0], 2.0), &[], "stretch"),
        ("sample_one.svg", driven(Face::ZMax, [0.0, 0.0, 8.0], 2.0), &pull[..1], "stretch"),
    ] {
        let path = base.join(name);
        write_sample_chart(&path, "A <specimen> & its curve", &DrivenFace::of_scene(&faces, &mesh), records).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert_well_formed(&text);
        assert!(!text.contains("NaN"), "{name}");
        assert!(text.contains(expected), "{name}: {expected}");
    }
}

// Pictures

fn device() -> Option<(wgpu::Device, wgpu::Queue)> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()));
    let Ok(adapter) = adapter else {
        assert!(std::env::var("REQUIRE_GPU").as_deref() != Ok("1"), "REQUIRE_GPU=1, but there is no adapter");
        eprintln!("skipped: no adapter");
        return None;
    };
    let info = adapter.get_info();
    eprintln!("adapter {}, driver {} {}", info.name, info.driver, info.driver_info);
    // Exactly the limits that every adapter offers.
    let descriptor = wgpu::DeviceDescriptor { required_limits: wgpu::Limits::default(), ..Default::default() };
    Some(pollster::block_on(adapter.request_device(&descriptor)).expect("a device"))
}

fn distinct_colours(image: &Image) -> usize {
    let colours: std::collections::HashSet<&[u8]> = image.rgba.chunks(4).collect();
    colours.len()
}

/// Mean difference of two pictures in steps of 1/255, and the share of bytes that differ by more than 8.
fn difference(a: &[u8], b: &[u8]) -> (f64, f64) {
    assert_eq!(a.len(), b.len());
    let steps: Vec<u8> = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).collect();
    let count = steps.len() as f64;
    (steps.iter().map(|&d| f64::from(d)).sum::<f64>() / count, steps.iter().filter(|&&d| d > 8).count() as f64 / count)
}

fn is_grey(pixel: &[u8]) -> bool {
    let [r, g, b] = [pixel[0], pixel[1], pixel[2]];
    r.max(g).max(b) - r.min(g).min(b) <= 14
}

/// Pixel of a point of the upright cut through the 20 mm x 16 mm block at a width of 900 pixels, from the numbers of
/// the layout: margins 16 and 126 pixels, foot 48 pixels, room of 2 % on both sides and below.
fn pixel_of(image: &Image, point: DVec2) -> [u8; 4] {
    let scale = (900.0 - 16.0 - 126.0) / (20e-3 * 1.04);
    let x = 16.0 + 0.5 * (900.0 - 142.0) + point.x * scale;
    let y = f64::from(image.height) - 48.0 - (point.y + 16e-3 + 0.02 * 20e-3) * scale;
    image.pixel(x as u32, y as u32)
}

#[test]
fn a_needle_in_tissue_is_drawn() {
    let scene = scene(needle(), DVec3::NEG_Z);
    let mesh = mesh(0.6e-3);
    let snapshot = snapshot(&scene, &mesh, 6e-3);
    let image = render::draw(&scene, &mesh, &snapshot, None).unwrap();
    image.write_png(&kept("stress_upright.png")).unwrap();
    assert_eq!(image.width, 900);
    let colours = distinct_colours(&image);
    assert!(colours > 400, "{colours}");
    // The lit part of the shaft is light grey above the surface and within the tissue.
    for z in [2e-3, 0.0, -2e-3] {
        let pixel = pixel_of(&image, DVec2::new(-0.3 * RADIUS, z));
        assert!(is_grey(&pixel) && pixel[0] > 150, "{z}: {pixel:?}");
    }
    // The field is hot below the tip and cold far away.
    let hot = pixel_of(&image, DVec2::new(0.2e-3, -6.5e-3));
    assert!(!is_grey(&hot) && hot[0] > 150, "{hot:?}");
    let cold = pixel_of(&image, DVec2::new(9.1e-3, -14e-3));
    assert!(cold[0] < 90 && cold[1] < 90, "{cold:?}");
    // Air above the tissue.
    let air = pixel_of(&image, DVec2::new(8e-3, 2e-3));
    assert!(air[0] > 200, "{air:?}");
}

#[test]
fn tilted_needles_and_other_tools_are_drawn() {
    let mesh = mesh(0.6e-3);
    let sphere = Some(Tool::Sphere { radius: 4e-3 });
    let punch = Some(Tool::FlatPunch { radius: 3e-3, bonded: false });
    for (name, tool, direction, depth) in [
        ("stress_tilted.png", needle(), DVec3::new(1.0, 0.0, -1.0), 6e-3),
        ("stress_oblique.png", needle(), DVec3::new(0.5, 0.5, -1.0), 6e-3),
        ("stress_sphere.png", sphere, DVec3::NEG_Z, 1e-3),
        ("stress_punch.png", punch, DVec3::NEG_Z, 1e-3),
    ] {
        let scene = scene(tool, direction);
        let mut snapshot = snapshot(&scene, &mesh, depth);
        if depth < 2e-3 {
            snapshot.stiffness.clear();
        }
        let image = render::draw(&scene, &mesh, &snapshot, None).unwrap();
        image.write_png(&kept(name)).unwrap();
        assert!(distinct_colours(&image) > 300, "{name}");
        let greys = image.rgba.chunks(4).filter(|p| (150..215).contains(&p[0]) && is_grey(p)).count();
        assert!(greys > 2000, "{name}: {greys} grey pixels");
    }
}

#[test]
fn odd_pictures_are_drawn_too() {
    let mesh = mesh(1.2e-3);
    let with_needle = scene(needle(), DVec3::NEG_Z);
    let good = snapshot(&with_needle, &mesh, 6e-3);
    // After withdrawal: the path stays, the tool is outside.
    let mut withdrawn = good.clone();
    withdrawn.tool_pose = Some((DVec3::new(0.0, 0.0, 1e-3), DVec3::NEG_Z));
    // Without a tool, with a scale of the scene's own and a long title.
    let mut plain = scene(None, DVec3::NEG_Z);
    plain.outputs.stress_scale = Some(4e3);
    plain.outputs.picture_width = 1400;
    plain.title = "A very long title (µ = 0.3, 20 °C) ".repeat(4);
    let mut without = good.clone();
    without.tool_pose = None;
    without.stiffness.clear();
    // Broken numbers.
    let mut broken = good.clone();
    for n in 0..mesh.node_count() / 3 {
        broken.displacement[n] = DVec3::splat(if n % 2 == 0 { f64::NAN } else { 1e20 });
    }
    broken.von_mises[0] = f64::INFINITY;
    broken.tool_pose = Some((DVec3::splat(f64::NAN), DVec3::NEG_Z));
    // Nothing at all.
    let nothing = FieldSnapshot { displacement: vec![DVec3::ZERO; mesh.node_count()], ..Default::default() };
    let mut small = with_needle.clone();
    small.outputs.picture_width = 400;
    for (name, scene, snapshot) in [
        ("stress_withdrawn.png", &with_needle, &withdrawn),
        ("stress_no_tool.png", &plain, &without),
        ("stress_broken.png", &with_needle, &broken),
        ("stress_nothing.png", &with_needle, &nothing),
        ("stress_small.png", &small, &good),
    ] {
        let image = render::draw(scene, &mesh, snapshot, None).unwrap();
        image.write_png(&kept(name)).unwrap();
        assert!(distinct_colours(&image) > 20, "{name}");
    }
}

#[test]
fn device_and_processor_draw_the_same_picture() {
    let Some((device, queue)) = device() else {
        return;
    };
    for (name, direction, width) in [
        ("stress_device_upright.png", DVec3::NEG_Z, 900),
        // A width whose rows need padding.
        ("stress_device_tilted.png", DVec3::new(1.0, 0.0, -1.0), 701),
    ] {
        let mut scene = scene(needle(), direction);
        scene.outputs.picture_width = width;
        let mesh = mesh(0.6e-3);
        let snapshot = snapshot(&scene, &mesh, 6e-3);
        let image = render::draw(&scene, &mesh, &snapshot, Some((&device, &queue))).unwrap();
        image.write_png(&kept(name)).unwrap();
        let picture = Picture::compose(&scene, &mesh, &snapshot);
        let processor = raster::render_on_processor(&picture);
        let (mean, share) = difference(&image.rgba, &processor);
        eprintln!("{name}: mean difference {mean:.3}/255, {:.3} % above 8", 100.0 * share);
        // Adapters round and place samples on edges differently: few bytes differ visibly, the mean stays small.
        assert!(mean < 0.3 && share < 0.01, "{name}: {mean}, {share}");

        // The comparison notices a wrong colour table.
        let mut wrong = picture;
        wrong.colour_table.reverse();
        let wrong = offscreen::render_on_device(&device, &queue, &wrong).unwrap();
        assert!(difference(&wrong, &processor).0 > 5.0);
    }
}

#[test]
fn a_picture_larger_than_the_device_draws_is_refused() {
    let Some((device, queue)) = device() else {
        return;
    };
    let mesh = mesh(1.2e-3);
    let scene = scene(None, DVec3::NEG_Z);
    let snapshot = FieldSnapshot { displacement: vec![DVec3::ZERO; mesh.node_count()], ..Default::default() };
    let mut picture = Picture::compose(&scene, &mesh, &snapshot);
    picture.height = device.limits().max_texture_dimension_2d + 1;
    is_input_error(offscreen::render_on_device(&device, &queue, &picture), "larger");
}

#[test]
fn targets_are_drawn_where_they_are() {
    let mesh = mesh(1.2e-3);
    let mut scene = scene(needle(), DVec3::NEG_Z);
    let mut fields = snapshot(&scene, &mesh, 5e-3);
    let mut drawn = |place: DVec3| {
        scene.targets = vec![Target { name: "lesion".into(), position: DVec3::ZERO, radius: 1e-3 }];
        fields.targets = vec![place];
        let image = render::draw(&scene, &mesh, &fields, None).unwrap();
        let marked = |&(x, y): &(u32, u32)| {
            let [r, g, b, _] = image.pixel(x, y);
            r < 20 && g > 200 && b > 160
        };
        let all = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
        all.filter(marked).collect::<Vec<_>>()
    };
    let middle = |pixels: &[(u32, u32)]| {
        let sum = pixels.iter().fold(DVec2::ZERO, |sum, (x, y)| sum + DVec2::new(f64::from(*x), f64::from(*y)));
        sum / pixels.len() as f64
    };
    let (here, right, beside) = (
        drawn(DVec3::new(3e-3, 0.0, -8e-3)),
        drawn(DVec3::new(5e-3, 0.0, -8e-3)),
        drawn(DVec3::new(3e-3, 2e-3, -8e-3)),
    );
    // 2 mm to the right of 20 mm across the plot; out of the plane the cross is left.
    let moved = middle(&right) - middle(&here);
    assert!((55.0..80.0).contains(&moved.x) && moved.y.abs() < 1.0, "{moved}");
    assert!(!beside.is_empty() && 3 * beside.len() < here.len(), "{} {}", beside.len(), here.len());
    assert!((middle(&beside) - middle(&here)).length() < 1.5);
    assert_eq!(drawn(DVec3::NAN), []);
}
