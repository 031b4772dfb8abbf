//! Closed surfaces from files: what is read, what is refused, what is inside.
//!
//! The files of `tests/anatomy/files` were written by trimesh 5.2.0, meshio 5.3.5 and VTK 9.7.2, in millimetres.

mod vtk_by_hand;

use std::collections::HashMap;
use std::f64::consts::PI;
use std::fmt::Write;
use std::panic::catch_unwind;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use stylet::anatomy::surface::check::check;
use stylet::anatomy::surface::inside::Inside;
use stylet::anatomy::surface::voxels::label_map;
use stylet::anatomy::surface::{TriangleSurface, parse, read};

use self::vtk_by_hand::{legacy_vtk, vtp};

const MM: f64 = 1e-3;

fn files() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/anatomy/files")
}

/// Corners of the triangles of an icosahedron.
const ICOSAHEDRON: [u32; 60] = [
    0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4, 11, 10, 2, 10, 7, 6, 7, 1, 8, 3, 9, 4, 3, 4, 2,
    3, 2, 6, 3, 6, 8, 3, 8, 9, 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1,
];

/// An icosahedron whose triangles are split `times` into four, on a sphere.
fn icosphere(times: usize, radius: f64, middle: DVec3) -> TriangleSurface {
    let g = (1.0 + 5.0_f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(DVec3::new(a, b, 0.0));
    }
    for (a, b) in [(-1.0, g), (1.0, g), (-1.0, -g), (1.0, -g)] {
        points.push(DVec3::new(0.0, a, b));
    }
    for (a, b) in [(g, -1.0), (g, 1.0), (-g, -1.0), (-g, 1.0)] {
        points.push(DVec3::new(a, 0.0, b));
    }
    let mut triangles: Vec<[u32; 3]> = ICOSAHEDRON.as_chunks().0.to_vec();
    for _ in 0..times {
        let mut between = HashMap::new();
        let mut middle_of = |a: u32, b: u32| {
            *between.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push(0.5 * (points[a as usize] + points[b as usize]));
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (d, e, f) = (middle_of(a, b), middle_of(b, c), middle_of(c, a));
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            })
            .collect();
    }
    let points = points.into_iter().map(|x| middle + radius * x.normalize()).collect();
    TriangleSurface { name: "sphere".into(), points, triangles }
}

fn cube(edge: f64, low: DVec3) -> TriangleSurface {
    let points =
        (0..8).map(|n| low + edge * DVec3::new((n & 1) as f64, (n >> 1 & 1) as f64, (n >> 2) as f64)).collect();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    TriangleSurface { name: "cube".into(), points, triangles }
}

/// A torus about z.
fn torus(count: u32, ring: f64, tube: f64) -> TriangleSurface {
    let mut surface = TriangleSurface { name: "torus".into(), ..Default::default() };
    for i in 0..count {
        for j in 0..count {
            let (u, v) = (2.0 * PI * f64::from(i) / f64::from(count), 2.0 * PI * f64::from(j) / f64::from(count));
            let reach = ring + tube * v.cos();
            surface.points.push(DVec3::new(reach * u.cos(), reach * u.sin(), tube * v.sin()));
            let at = |i: u32, j: u32| (i % count) * count + j % count;
            surface.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            surface.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    surface
}

fn stl_text(surfaces: &[&TriangleSurface]) -> Vec<u8> {
    let mut text = String::new();
    for surface in surfaces {
        writeln!(text, "solid {}", surface.name).unwrap();
        for t in 0..surface.triangles.len() {
            text += "facet normal 0 0 0\n  outer loop\n";
            for x in surface.corners(t) {
                writeln!(text, "    vertex {} {} {}", x.x, x.y, x.z).unwrap();
            }
            text += "  endloop\nendfacet\n";
        }
        writeln!(text, "endsolid {}", surface.name).unwrap();
    }
    text.into_bytes()
}

fn stl_binary(surface: &TriangleSurface) -> Vec<u8> {
    // A head that begins as that of a text file does.
    let mut bytes = format!("{:80}", "solid by a test").into_bytes();
    bytes.extend((surface.triangles.len() as u32).to_le_bytes());
    for t in 0..surface.triangles.len() {
        bytes.extend([0; 12]);
        for x in surface.corners(t).iter().flat_map(|x| x.to_array()) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn obj(surfaces: &[&TriangleSurface]) -> Vec<u8> {
    let (mut text, mut first) = (String::from("# by a test\nmtllib none.mtl\n"), 1);
    for surface in surfaces {
        writeln!(text, "o {}", surface.name).unwrap();
        for x in &surface.points {
            writeln!(text, "v {} {} {}", x.x, x.y, x.z).unwrap();
        }
        text += "vn 0 0 1\nvt 0 0\ns off\n";
        for [a, b, c] in surface.triangles.iter().map(|t| t.map(|n| n + first)) {
            writeln!(text, "f {a}/1/1 {b}//1 {c}").unwrap();
        }
        first += surface.points.len() as u32;
    }
    text.into_bytes()
}

fn ply(surface: &TriangleSurface, format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat {format} 1.0\ncomment by a test\nelement vertex {}\nproperty uchar red\nproperty double x\nproperty double y\n\
         property double z\nelement face {}\nproperty list uchar int vertex_indices\nproperty list uchar float more\nend_header\n",
        surface.points.len(),
        surface.triangles.len()
    )
    .into_bytes();
    let big = format == "binary_big_endian";
    for x in &surface.points {
        if format == "ascii" {
            bytes.extend(format!("7 {} {} {}\n", x.x, x.y, x.z).bytes());
            continue;
        }
        bytes.push(7);
        bytes.extend(x.to_array().iter().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }));
    }
    for t in &surface.triangles {
        if format == "ascii" {
            bytes.extend(format!("3 {} {} {} 2 0.5 0.5\n", t[0], t[1], t[2]).bytes());
            continue;
        }
        bytes.push(3);
        bytes.extend(t.iter().flat_map(|n| if big { n.to_be_bytes() } else { n.to_le_bytes() }));
        bytes.push(1);
        bytes.extend([0; 4]);
    }
    bytes
}

/// The surface in every format.
fn everywhere(surface: &TriangleSurface) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("text.stl", stl_text(&[surface])),
        ("binary.stl", stl_binary(surface)),
        ("text.obj", obj(&[surface])),
        ("text.ply", ply(surface, "ascii")),
        ("little.ply", ply(surface, "binary_little_endian")),
        ("big.ply", ply(surface, "binary_big_endian")),
        ("text.vtp", vtp(surface)),
        ("text.vtk", legacy_vtk(surface, false)),
        ("binary.vtk", legacy_vtk(surface, true)),
    ]
}

struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) % end.max(1) as u64) as usize
    }

    fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    /// Somewhere in a cube about a point.
    fn place(&mut self, middle: DVec3, half: f64) -> DVec3 {
        middle + half * (2.0 * DVec3::new(self.unit(), self.unit(), self.unit()) - 1.0)
    }
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    parse(name, bytes, MM).expect_err("it is refused").to_string()
}

#[test]
fn every_format_gives_the_same_surface() {
    for surface in
        [icosphere(2, 20.0, DVec3::new(10.0, -5.0, 30.0)), cube(15.0, DVec3::splat(-4.0)), torus(24, 30.0, 9.0)]
    {
        for (name, bytes) in everywhere(&surface) {
            let imported = parse(name, &bytes, MM).unwrap();
            let [found] = &imported.surfaces[..] else { panic!("{name}: {} surfaces", imported.surfaces.len()) };
            assert_eq!(imported.notices, Vec::<String>::new(), "{name}");
            assert_eq!(found.points.len(), surface.points.len(), "{name}: corners are one point");
            assert_eq!(found.triangles.len(), surface.triangles.len());
            for t in 0..surface.triangles.len() {
                let exact = surface.corners(t).map(|x| x / 1e3);
                let close = if name == "binary.stl" { 1e-8 } else { 0.0 };
                assert!(
                    found.corners(t).iter().zip(exact).all(|(a, b)| a.distance(b) <= close),
                    "{name}: triangle {t}"
                );
            }
            let named = name.ends_with("stl") && name.starts_with("text") || name.ends_with("obj");
            assert_eq!(found.name, if named { &surface.name } else { name.split('.').next().unwrap() });
            let mut turned = found.clone();
            let report = check(&mut turned);
            assert!(report.is_closed() && report.notices.is_empty(), "{name}: {report:?}");
            assert_eq!(&turned, found);
            assert!((report.volume / (1e-9 * surface.volume()) - 1.0).abs() < 1e-5);
        }
    }
}

#[test]
fn files_of_other_programs() {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(files()).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    let mut count = 0;
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if !["stl", "obj", "ply", "vtp"].contains(&name.rsplit('.').next().unwrap()) {
            continue;
        }
        count += 1;
        let imported = read(&path, MM).unwrap_or_else(|error| panic!("{error}"));
        assert!(imported.notices.is_empty(), "{name}: {:?}", imported.notices);
        let names: Vec<&str> = imported.surfaces.iter().map(|s| s.name.as_str()).collect();
        if name == "trimesh_scene.obj" {
            assert_eq!(names, ["bone", "organ"]);
        } else {
            assert_eq!(names.len(), 1, "{name}: {names:?}");
        }
        for mut surface in imported.surfaces {
            let report = check(&mut surface);
            assert!(report.is_closed() && report.notices.is_empty(), "{name}: {:?}", report.notices);
            let (low, high) = surface.bounds().unwrap();
            let (middle, size) = (0.5 * (low + high), high - low);
            if name.contains("box") || surface.name == "bone" {
                assert!((report.volume / 6e-6 - 1.0).abs() < 1e-6, "{name}: {}", report.volume);
                assert!(size.distance(DVec3::new(0.01, 0.02, 0.03)) < 1e-8 && middle.length() < 1e-8);
            } else {
                assert!(middle.distance(DVec3::new(0.01, -0.005, 0.03)) < 1e-6, "{name}: {middle}");
                assert!(size.max_element() < 0.0401 && report.volume > 0.55 * 4.0 / 3.0 * PI * 8e-6, "{name}");
            }
        }
    }
    assert_eq!(count, 14);
}

#[test]
fn several_solids_and_groups() {
    let (one, mut two) = (cube(10.0, DVec3::ZERO), icosphere(1, 8.0, DVec3::splat(40.0)));
    let three = TriangleSurface { name: "cube".into(), ..cube(5.0, DVec3::splat(-20.0)) };
    two.name = "left kidney".into();
    let text = parse("a/b.stl", &stl_text(&[&one, &two, &three]), MM).unwrap();
    let names: Vec<&str> = text.surfaces.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["cube", "left kidney", "cube 2"]);
    // A group that is opened again goes on; one without faces is none; objects and groups have both names.
    let text = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\no body\ng skin\nf 1 3 2\ng\nf -4 -3 -1\ng bone\ng skin\nf 1 \\\n 4 3 # rest\nf 2 3 4\n";
    let found = parse("x.obj", text.as_bytes(), MM).unwrap();
    let parts: Vec<(&str, usize)> = found.surfaces.iter().map(|s| (s.name.as_str(), s.triangles.len())).collect();
    assert_eq!(parts, [("body/skin", 3), ("body", 1)]);
    // Polygons are cut, what is no area left out.
    let text = "v 0 0 0\nv 10 0 0\nv 10 10 0\nv 0 10 0\nv 0 0 0\nf 1 2 3 4\nf 1 2 5\nf 1 2\n";
    let found = parse("x.obj", text.as_bytes(), MM).unwrap();
    assert_eq!((found.surfaces[0].triangles.len(), found.surfaces[0].points.len()), (2, 4));
    assert_eq!(found.notices.len(), 3, "{:?}", found.notices);
    assert!(found.notices[0].starts_with("1 polygons") && found.notices[1].starts_with("1 faces"));
    assert!(found.notices[2].starts_with("1 triangles with two corners"));
}

#[test]
fn almost_equal_corners_of_stl_are_one() {
    let surface = icosphere(2, 20.0, DVec3::new(400.0, -500.0, 300.0));
    let mut random = Random(5);
    let mut text = String::from("solid s\n");
    for t in 0..surface.triangles.len() {
        text += "facet normal nan nan nan\nouter loop\n";
        for x in surface.corners(t) {
            let x = random.place(x, 5e-6);
            writeln!(text, "vertex {} {} {}", x.x, x.y, x.z).unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    text += "endsolid";
    let mut found = parse("s.stl", text.as_bytes(), MM).unwrap().surfaces.remove(0);
    assert_eq!(found.points.len(), surface.points.len());
    assert!(check(&mut found).is_closed());
}

#[test]
fn holes_are_told_with_their_place() {
    let mut surface = icosphere(3, 20e-3, DVec3::ZERO);
    // A large hole at the top, a small one at the side.
    surface.triangles.retain(|t| {
        let middle = t.iter().map(|n| surface.points[*n as usize]).sum::<DVec3>() / 3.0;
        middle.z < 17e-3
    });
    let side = surface.triangles.iter().position(|t| surface.points[t[0] as usize].x > 19.5e-3).unwrap();
    surface.triangles.remove(side);
    let report = check(&mut surface);
    assert_eq!(report.holes, 2, "{report:?}");
    assert!(!report.is_closed() && report.open_edges > 10);
    let (place, length) = report.largest_hole.unwrap();
    assert!(place.distance(DVec3::new(0.0, 0.0, 17e-3)) < 2e-3 && length > 0.04, "{place} {length}");
    assert!(report.notices[0].contains("2 holes") && report.notices[0].contains("mm"), "{:?}", report.notices);
}

#[test]
fn orientation_is_mended_and_told() {
    let right = torus(20, 0.03, 0.01);
    let mut inverted = right.clone();
    inverted.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let report = check(&mut inverted);
    assert!(report.turned == 800 && report.volume > 0.0 && report.notices[0].contains("clockwise"), "{report:?}");
    assert!((inverted.volume() - right.volume()).abs() < 1e-12);
    let mut mixed = right.clone();
    for n in (0..800).step_by(3) {
        mixed.triangles[n].swap(0, 1);
    }
    let report = check(&mut mixed);
    assert!(report.turned == 267 && report.notices.len() == 1, "{report:?}");
    assert!((mixed.volume() - right.volume()).abs() < 1e-12);
    // A strip that is turned once has one side only.
    let mut strip = TriangleSurface { name: "strip".into(), ..Default::default() };
    for n in 0..20_u32 {
        let u = 2.0 * PI * f64::from(n) / 20.0;
        for w in [-0.01, 0.01] {
            let reach = 0.05 + w * (u / 2.0).cos();
            strip.points.push(DVec3::new(reach * u.cos(), reach * u.sin(), w * (u / 2.0).sin()));
        }
        let next = if n == 19 { [1, 0] } else { [2 * n + 2, 2 * n + 3] };
        strip.triangles.extend([[2 * n, next[0], 2 * n + 1], [2 * n + 1, next[0], next[1]]]);
    }
    let report = check(&mut strip);
    assert!(report.one_sided && report.holes == 1, "{report:?}");
    // Two cubes with an edge in common, and a likely wrong unit.
    let (mut pair, other) = (cube(1e-5, DVec3::ZERO), cube(1e-5, DVec3::new(1e-5, 1e-5, 0.0)));
    let known = [(3, 0), (7, 4)];
    for t in &other.triangles {
        pair.triangles.push(t.map(|n| known.iter().find(|(_, own)| *own == n).map_or(n + 8, |(own, _)| *own)));
    }
    pair.points.extend(other.points);
    let report = check(&mut pair);
    assert_eq!(report.crowded_edges, 1);
    assert!(report.notices[0].contains("unit") && report.notices[1].contains("1 edges"), "{:?}", report.notices);
}

#[test]
fn crossings_are_found() {
    let mut two = icosphere(3, 0.02, DVec3::ZERO);
    let other = icosphere(3, 0.02, DVec3::new(0.023, 0.0021, 0.0013));
    two.triangles.extend(other.triangles.iter().map(|t| t.map(|n| n + two.points.len() as u32)));
    two.points.extend(&other.points);
    let report = check(&mut two);
    assert!(report.is_closed() && report.tested == 1.0);
    assert!(report.crossings > 40, "{}", report.crossings);
    // On both spheres: near their plane in the middle.
    let place = report.first_crossing.unwrap();
    assert!((place.length() - 0.02).abs() < 5e-4, "{place}");
    assert!((place.distance(DVec3::new(0.023, 0.0021, 0.0013)) - 0.02).abs() < 5e-4);
    // Cubes side by side touch.
    let mut pair = cube(0.01, DVec3::ZERO);
    let other = cube(0.01, DVec3::new(0.01, 0.002, 0.003));
    pair.triangles.extend(other.triangles.iter().map(|t| t.map(|n| n + 8)));
    pair.points.extend(other.points);
    assert_eq!(check(&mut pair).crossings, 0);
}

#[test]
fn the_fast_winding_number_is_that_of_all_triangles() {
    let mut random = Random(11);
    for surface in [icosphere(3, 0.02, DVec3::new(0.3, -0.1, 0.2)), torus(40, 0.03, 0.012)] {
        let (fast, exact) = (Inside::new(&surface), Inside::with_accuracy(&surface, f64::INFINITY));
        let (low, high) = surface.bounds().unwrap();
        let mut worst = 0.0_f64;
        for _ in 0..2000 {
            let x = random.place(0.5 * (low + high), 0.7 * (high - low).max_element());
            worst = worst.max((fast.winding(x) - exact.winding(x)).abs());
            let w = exact.winding(x);
            assert!((w - w.round()).abs() < 1e-9, "{w}");
            assert_eq!(fast.contains(x), w > 0.5);
        }
        println!("{}: off by {worst:.1e}", surface.name);
        assert!(worst < 0.1, "{worst}");
    }
    let nothing = Inside::new(&TriangleSurface::default());
    assert_eq!(nothing.winding(DVec3::ZERO), 0.0);
    assert!(!nothing.contains(DVec3::NAN) && !Inside::new(&cube(1.0, DVec3::ZERO)).contains(DVec3::NAN));
}

#[test]
fn small_holes_do_no_harm() {
    let mut surface = icosphere(4, 0.02, DVec3::ZERO);
    let whole = label_map(&[surface.clone()], 0.7e-3, 1e-3).unwrap().map;
    surface.triangles.retain(|t| t[0] % 61 != 0);
    let inside = Inside::new(&surface);
    let mut random = Random(3);
    for _ in 0..2000 {
        let x = random.place(DVec3::ZERO, 0.025);
        if (x.length() - 0.02).abs() > 2e-3 {
            assert_eq!(inside.contains(x), x.length() < 0.02, "{x}");
        }
    }
    let holed = label_map(&[surface.clone()], 0.7e-3, 1e-3).unwrap().map;
    let count = |labels: &[u16]| labels.iter().filter(|l| **l == 1).count();
    let differ = whole.labels.iter().zip(&holed.labels).filter(|(a, b)| a != b).count();
    assert!(differ * 200 < count(&whole.labels), "{differ} of {}", count(&whole.labels));
    // A third of a sphere is gone: by winding number.
    let mut bowl = icosphere(4, 0.02, DVec3::ZERO);
    bowl.triangles.retain(|t| bowl.points[t[0] as usize].z < 0.008);
    let filled = label_map(&[bowl], 0.7e-3, 1e-3).unwrap().map;
    let part = count(&filled.labels) as f64 / count(&whole.labels) as f64;
    assert!((0.7..0.95).contains(&part), "{part}");
}

#[test]
fn voxels_are_those_whose_centre_is_inside() {
    for (mut surface, spacing) in [
        (icosphere(3, 0.02, DVec3::new(0.31, -0.17, 0.05)), 1e-3),
        (torus(40, 0.03, 0.012), 1.3e-3),
        // Faces, edges and corners on rows of voxels.
        (cube(0.016, DVec3::ZERO), 1e-3),
        (cube(0.016, DVec3::ZERO), 0.9e-3),
    ] {
        for inverted in [false, true] {
            if inverted {
                surface.triangles.iter_mut().for_each(|t| t.swap(0, 1));
            }
            let inside = Inside::new(&surface);
            let voxels = label_map(&[surface.clone()], spacing, 2.5e-3).unwrap();
            assert!(voxels.notices.is_empty() && voxels.overlapping == 0);
            let map = voxels.map;
            assert_eq!(map.names[&1], surface.name);
            let [nx, ny, nz] = map.size;
            assert_eq!(map.labels.len(), nx * ny * nz);
            for (n, label) in map.labels.iter().enumerate().step_by(3) {
                let index = DVec3::new((n % nx) as f64, (n / nx % ny) as f64, (n / nx / ny) as f64);
                let x = map.origin + map.steps * index;
                let w = inside.winding(x).abs();
                // On a face both are right.
                let near = 1e-9 * DVec3::new(1.0, 0.7, 1.3);
                if (w - w.round()).abs() < 0.1 && (inside.winding(x + near) - inside.winding(x - near)).abs() < 0.1 {
                    assert_eq!(*label == 1, w > 0.5, "{} at {index}: {w}", surface.name);
                }
            }
            let volume = map.labels.iter().filter(|l| **l == 1).count() as f64 * spacing.powi(3);
            assert!((volume / surface.volume().abs() - 1.0).abs() < 0.1, "{} {volume}", surface.name);
        }
    }
}

#[test]
fn later_surfaces_win_and_bounds_are_kept() {
    let surfaces = [
        icosphere(3, 0.02, DVec3::ZERO),
        TriangleSurface { name: "core".into(), ..icosphere(3, 0.01, DVec3::ZERO) },
        TriangleSurface { name: "speck".into(), ..icosphere(1, 1e-5, DVec3::new(3.3e-4, 3.3e-4, 1e-4)) },
    ];
    let voxels = label_map(&surfaces, 1e-3, 0.0).unwrap();
    let count = |label: u16| voxels.map.labels.iter().filter(|l| **l == label).count();
    assert!(voxels.overlapping == count(2) && count(3) == 0);
    assert!((count(2) as f64 / 4189.0 - 1.0).abs() < 0.03 && (count(1) as f64 / 29322.0 - 1.0).abs() < 0.03);
    assert_eq!(voxels.notices.len(), 2, "{:?}", voxels.notices);
    let error = label_map(&surfaces, 1e-5, 0.0).unwrap_err().to_string();
    assert!(error.contains("way out: take a spacing of 0.0"), "{error}");
    // The way out is one.
    let spacing: f64 = error.split("spacing of ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((4e-2 / (spacing * MM)).powi(3) < 3e8, "{spacing}");
    for (spacing, margin) in [(0.0, 0.0), (-1.0, 0.0), (f64::NAN, 0.0), (1e-3, f64::INFINITY), (1e-3, -1.0)] {
        assert!(label_map(&surfaces, spacing, margin).is_err());
    }
    assert!(label_map(&[], 1e-3, 0.0).is_err());
    assert_eq!(label_map(&surfaces[..1], 1e300, 0.0).unwrap().map.size, [1; 3]);
}

#[test]
fn a_hundred_thousand_triangles_are_quick() {
    let surface = icosphere(6, 0.1, DVec3::ZERO);
    let bytes = stl_binary(&surface);
    let begin = Instant::now();
    let mut surface = parse("large.stl", &bytes, 1.0).unwrap().surfaces.remove(0);
    let read = begin.elapsed();
    let report = check(&mut surface);
    let checked = begin.elapsed() - read;
    assert!(report.is_closed() && report.crossings == 0 && surface.triangles.len() == 81_920);
    let begin = Instant::now();
    let map = label_map(&[surface.clone()], 0.2 / 256.0, 0.0).unwrap().map;
    let filled = begin.elapsed();
    let volume = map.labels.iter().filter(|l| **l == 1).count() as f64 * (0.2_f64 / 256.0).powi(3);
    assert!((volume / surface.volume() - 1.0).abs() < 1e-3);
    let begin = Instant::now();
    let inside = Inside::new(&surface);
    let built = begin.elapsed();
    let mut random = Random(1);
    let begin = Instant::now();
    let sum: f64 = (0..10_000).map(|_| inside.winding(random.place(DVec3::ZERO, 0.1))).sum();
    let each = begin.elapsed() / 10_000;
    println!(
        "81920 triangles: read {read:.2?}, checked {checked:.2?}, {:?} voxels {filled:.2?}, tree {built:.2?}, {each:.1?} per point, {:.3}",
        map.size,
        sum / 10_000.0
    );
}

#[test]
fn refusals_name_the_place() {
    let surface = icosphere(1, 20.0, DVec3::ZERO);
    let stl = stl_binary(&surface);
    let text = String::from_utf8(stl_text(&[&surface])).unwrap();
    let obj = String::from_utf8(obj(&[&surface])).unwrap();
    let ply_text = String::from_utf8(ply(&surface, "ascii")).unwrap();
    let ply_binary = ply(&surface, "binary_little_endian");
    let mut many = stl.clone();
    many[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    many[0] = 0;
    let mut not_finite = stl.clone();
    not_finite[84 + 50 + 12..84 + 50 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
    let patch = |bytes: &[u8], from: &str, to: &str| {
        let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
        [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
    };
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        ("empty.stl", Vec::new(), "the file is empty"),
        ("blank.obj", b" \n\t ".to_vec(), "the file is empty"),
        ("garbage.stl", (0..500_u32).map(|n| (n * n % 251) as u8).collect(), "no surface of a kind that is read here"),
        ("text.txt", b"Dear reader,\nthis is a letter.\n".to_vec(), "no surface of a kind that is read here"),
        ("other.off", b"OFF\n8 6 12\n".to_vec(), "an OFF file"),
        ("cut.vtk", b"# vtk DataFile Version 3.0\n".to_vec(), "cut.vtk:2: "),
        (
            "grid.vtk",
            patch(&legacy_vtk(&surface, false), "POLYDATA", "UNSTRUCTURED_GRID"),
            "is not a surface but a mesh",
        ),
        ("index.vtk", patch(&legacy_vtk(&surface, false), "\n3 0 ", "\n3 99 "), "cell 0 names a point"),
        ("contours.vtk", patch(&legacy_vtk(&surface, false), "POLYGONS", "LINES"), "80 lines and no triangle"),
        ("contours.vtp", patch(&vtp(&surface), "NumberOfPolys", "NumberOfLines"), "80 lines and no triangle"),
        ("many.stl", many, "would promise 4294967295 triangles"),
        ("nan.stl", not_finite, "byte 146: corner 0 of triangle 1 stands at (NaN"),
        ("none.stl", b"solid a\nendsolid a\n".to_vec(), "no triangle is in the file"),
        ("word.stl", text.replacen("outer", "inner", 1).into_bytes(), "word.stl:3: `inner` where `outer` should be"),
        ("inf.stl", patch(text.as_bytes(), "vertex -", "vertex -inf "), "inf.stl:4: a coordinate: -inf is not finite"),
        ("number.stl", patch(text.as_bytes(), "vertex ", "vertex 1,5"), "number.stl:4: a coordinate: `1,5"),
        ("vertex.obj", obj.replacen("f ", "f 99999/", 1).into_bytes(), "names vertex 99999, but the file has 42"),
        ("zero.obj", b"v 0 0 0\nf 0 1 1\n".to_vec(), "zero.obj:2: a face names vertex 0"),
        ("back.obj", b"v 0 0 0\nf -2 1 1\n".to_vec(), "names vertex -2, but the file has 1"),
        ("short.obj", b"v 0 0\nf 1 1 1\n".to_vec(), "short.obj:1: the line ends where a coordinate should stand"),
        ("far.obj", b"v 0 0 1e300\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(), "no place in a patient"),
        ("flat.obj", b"v 0 0 0\nv 1 0 0\nf 1 2 1\n".to_vec(), "none of the 1 triangles has an area"),
        ("curve.obj", b"v 0 0 0\ncstype bezier\n".to_vec(), "free-form"),
        (
            "many.ply",
            patch(ply_text.as_bytes(), "vertex 42", "vertex 4200000000"),
            "many.ply:4: 4200000000 elements `vertex`",
        ),
        ("many_faces.ply", patch(&ply_binary, "face 80", "face 8000000"), "8000000 elements `face` are promised"),
        ("more.ply", patch(ply_text.as_bytes(), "vertex 42", "vertex 18446744073709551615"), "18446744073709551615"),
        (
            "kind.ply",
            patch(ply_text.as_bytes(), "uchar red", "colour red"),
            "kind.ply:5: `colour` is no kind of number",
        ),
        ("index.ply", patch(ply_text.as_bytes(), "\n3 ", "\n3 99 "), "index.ply:55: face 0 names vertex 99"),
        ("list.ply", patch(ply_text.as_bytes(), "\n3 ", "\n300000 "), "a list of 300000 numbers"),
        (
            "bare.ply",
            b"ply\nformat binary_little_endian 1.0\nelement x 4000000000\nend_header\n".to_vec(),
            "4000000000 elements",
        ),
        ("head.ply", b"ply\nformat ascii 1.0\n".to_vec(), "end_header"),
        (
            "count.vtp",
            patch(&vtp(&surface), "Points=\"42\"", "Points=\"4200000000\""),
            "NumberOfPoints promises more numbers",
        ),
        ("fewer.vtp", patch(&vtp(&surface), "Points=\"42\"", "Points=\"41\""), "holds 126 values where"),
        ("index.vtp", patch(&vtp(&surface), "format=\"ascii\">0 ", "format=\"ascii\">99 "), "index.vtp:"),
        ("grid.vtp", patch(&vtp(&surface), "type=\"PolyData\"", "type=\"ImageData\""), "is not a surface"),
    ];
    for (name, bytes, wanted) in cases {
        let text = refusal(name, &bytes);
        assert!(text.contains(wanted) && text.contains(name) && text.contains("way out"), "{name}: {text}");
    }
    for unit in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-300] {
        assert!(parse("x.stl", &stl, unit).is_err());
    }
    assert!(read(Path::new("no-such-folder/x.stl"), MM).is_err());
    // Something behind the triangles is told.
    let imported = parse("x.stl", &[&stl[..], &[0; 7]].concat(), MM).unwrap();
    assert!(imported.notices[0].contains("7 bytes"), "{:?}", imported.notices);
}

/// Reads the bytes and uses what they give; true where they give something.
fn survives(name: &str, bytes: &[u8]) -> bool {
    let outcome = catch_unwind(|| match parse(name, bytes, MM) {
        Err(error) => {
            assert!(error.to_string().contains("way out"), "{error}");
            false
        }
        Ok(imported) => {
            for mut surface in imported.surfaces {
                assert!(surface.triangles.iter().flatten().all(|n| (*n as usize) < surface.points.len()));
                assert!(surface.points.iter().all(|x| x.is_finite()));
                check(&mut surface);
                let (low, high) = surface.bounds().unwrap();
                Inside::new(&surface).winding(low);
                let spacing = (high - low).max_element() / 7.3;
                label_map(&[surface], spacing, 0.0).unwrap_or_default();
            }
            true
        }
    });
    outcome.unwrap_or_else(|_| panic!("{name}: panic for {}", String::from_utf8_lossy(bytes)))
}

fn samples() -> Vec<(String, Vec<u8>)> {
    let own = everywhere(&icosphere(0, 20.0, DVec3::ZERO)).into_iter().map(|(name, bytes)| (name.to_string(), bytes));
    let mut paths: Vec<PathBuf> = std::fs::read_dir(files()).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    let wanted = [
        "vtk_sphere_zlib.vtp",
        "vtk_sphere_appended.vtp",
        "vtk_strips.vtp",
        "trimesh_scene.obj",
        "meshio_box_binary.ply",
    ];
    let others = paths.into_iter().filter_map(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        wanted.contains(&name.as_str()).then(|| (name, std::fs::read(path).unwrap()))
    });
    own.chain(others).collect()
}

#[test]
fn files_that_were_cut_short() {
    for (name, bytes) in samples() {
        for length in (0..bytes.len()).step_by(7) {
            survives(&name, &bytes[..length]);
        }
        assert!(survives(&name, &bytes), "{name}");
    }
}

#[test]
fn files_that_were_damaged() {
    let samples = samples();
    let mut random = Random(2024);
    let mut taken = 0;
    for case in 0..4000 {
        let (name, whole) = &samples[case % samples.len()];
        let mut bytes = whole.clone();
        for _ in 0..1 + random.below(3) {
            let reach = if random.below(2) == 0 { bytes.len().min(400) } else { bytes.len() };
            let at = random.below(reach);
            match random.below(4) {
                0 => bytes[at] = random.below(256) as u8,
                1 => bytes[at] ^= 1 << random.below(8),
                2 => drop(bytes.drain(at..(at + 1 + random.below(20)).min(bytes.len()))),
                _ => {
                    let piece =
                        whole[random.below(whole.len())..].iter().take(random.below(60)).copied().collect::<Vec<u8>>();
                    bytes.splice(at..at, piece);
                }
            }
            if bytes.is_empty() {
                break;
            }
        }
        taken += usize::from(survives(name, &bytes));
    }
    assert!((200..3800).contains(&taken), "{taken}");
}
