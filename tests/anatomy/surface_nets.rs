//! Smooth surfaces of labels: closed, outwards, where they should be.

use std::collections::{BTreeMap, HashMap};

use glam::{DMat3, DVec3, Vec3Swizzles};
use stylet::anatomy::label_map::LabelMap;
use stylet::anatomy::surface::TriangleSurface;
use stylet::anatomy::surface_nets::surfaces;

/// A map of voxels of 1 m with the label that `label` gives for their index.
fn map(size: [usize; 3], label: impl Fn(DVec3) -> u16) -> LabelMap {
    let [nx, ny, nz] = size;
    let mut labels = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                labels.push(label(DVec3::new(i as f64, j as f64, k as f64)));
            }
        }
    }
    LabelMap { size, steps: DMat3::IDENTITY, origin: DVec3::ZERO, labels, names: BTreeMap::new() }
}

/// Every edge has exactly two triangles, which go along it in opposite directions.
fn assert_closed(surface: &TriangleSurface) {
    let mut edges = HashMap::<(u32, u32), u32>::new();
    for t in &surface.triangles {
        for n in 0..3 {
            *edges.entry((t[n], t[(n + 1) % 3])).or_default() += 1;
        }
    }
    for ((a, b), count) in &edges {
        assert_eq!(*count, 1, "{}: edge {a} {b} is there {count} times", surface.name);
        assert!(edges.contains_key(&(*b, *a)), "{}: edge {a} {b} is open", surface.name);
    }
    assert!(surface.volume() > 0.0, "{}: {}", surface.name, surface.volume());
    assert!(surface.triangles.iter().flatten().all(|n| (*n as usize) < surface.points.len()));
}

fn only(map: &LabelMap, cell: usize) -> TriangleSurface {
    let mut found = surfaces(map, &[1], cell);
    assert_eq!(found.len(), 1);
    assert_closed(&found[0]);
    found.remove(0)
}

/// Root mean square and largest distance of the points to a sphere.
fn off_sphere(surface: &TriangleSurface, middle: DVec3, radius: f64) -> (f64, f64) {
    let off: Vec<f64> = surface.points.iter().map(|x| (x.distance(middle) - radius).abs()).collect();
    let mean = off.iter().map(|d| d * d).sum::<f64>() / off.len() as f64;
    (mean.sqrt(), off.iter().copied().fold(0.0, f64::max))
}

/// Mean angle between the normals of neighbours [degree]: what steps of voxels make large.
fn roughness(surface: &TriangleSurface) -> f64 {
    let normal = |t: usize| {
        let [a, b, c] = surface.corners(t);
        (b - a).cross(c - a).normalize_or_zero()
    };
    let mut edges = HashMap::new();
    for (t, corners) in surface.triangles.iter().enumerate() {
        for n in 0..3 {
            edges.insert((corners[n], corners[(n + 1) % 3]), t);
        }
    }
    let angles: Vec<f64> =
        edges.iter().map(|((a, b), t)| normal(*t).angle_between(normal(edges[&(*b, *a)])).to_degrees()).collect();
    angles.iter().sum::<f64>() / angles.len() as f64
}

#[test]
fn a_sphere_keeps_its_place_and_its_volume() {
    for (middle, radius) in [(DVec3::splat(15.0), 10.0), (DVec3::new(14.3, 15.1, 14.8), 10.0), (DVec3::splat(9.5), 5.0)]
    {
        let volume = map([31; 3], |x| u16::from(x.distance(middle) <= radius));
        let surface = only(&volume, 1);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3);
        let voxels = volume.labels.iter().filter(|l| **l == 1).count() as f64;
        let (rms, most) = off_sphere(&surface, middle, radius);
        let rough = roughness(&surface);
        println!(
            "radius {radius}: volume {:.4} of the sphere, {:.4} of its voxels; off by {rms:.3} rms, {most:.3}; {rough:.1} degree",
            surface.volume() / exact,
            surface.volume() / voxels
        );
        assert!((surface.volume() / exact - 1.0).abs() < if radius < 10.0 { 0.06 } else { 0.02 });
        assert!(rms < 0.35 && most < 0.9, "{rms} {most}");
        assert!(rough < 12.0 * 10.0 / radius, "{rough}");
    }
}

#[test]
fn a_cube_keeps_its_faces() {
    let inside = |x: DVec3| x.min_element() >= 5.0 && x.max_element() <= 14.0;
    let surface = only(&map([20; 3], |x| u16::from(inside(x))), 1);
    assert!((surface.volume() / 1000.0 - 1.0).abs() < 0.04, "{}", surface.volume());
    // The middles of faces stay where they are.
    let flat = surface.points.iter().filter(|x| (x.x - 4.5).abs() < 0.05).count();
    assert!(flat > 16, "{flat}");
}

#[test]
fn labels_that_touch_are_closed_each_by_itself() {
    let volume = map([24, 16, 16], |x| match (x - DVec3::splat(7.5)).yz().length() < 5.0 {
        true if x.x < 11.5 => 1,
        true => 7,
        false => 0,
    });
    let mut named = volume.clone();
    named.names.insert(7, "vein".into());
    let found = surfaces(&named, &[7, 3, 1], 1);
    assert_eq!(found.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["vein", "label 1"]);
    for surface in &found {
        assert_closed(surface);
        let voxels = 12.0 * 16.0 * 16.0 * 0.31;
        assert!((surface.volume() / voxels - 1.0).abs() < 0.1, "{} {voxels}", surface.volume());
        // Closed at the border of the volume, half a voxel beyond its last centre.
        let (low, high) = surface.bounds().unwrap();
        assert!(low.x > -0.7 && high.x < 23.7 && (low.x < -0.3 || high.x > 23.3), "{low} {high}");
    }
}

#[test]
fn a_thin_layer_stays_in_one_piece() {
    // A bowl of two voxels.
    let middle = DVec3::new(20.0, 20.0, 30.0);
    let volume = map([41, 41, 30], |x| u16::from((18.0..20.0).contains(&x.distance(middle)) && x.z < 25.0));
    let surface = only(&volume, 1);
    let voxels = volume.labels.iter().filter(|l| **l == 1).count() as f64;
    assert!((surface.volume() / voxels - 1.0).abs() < 0.05, "{} of {voxels}", surface.volume());
    // In one piece: every point is reached from the first one.
    let mut reached = vec![false; surface.points.len()];
    reached[surface.triangles[0][0] as usize] = true;
    loop {
        let before = reached.iter().filter(|r| **r).count();
        for t in &surface.triangles {
            if t.iter().any(|n| reached[*n as usize]) {
                t.iter().for_each(|n| reached[*n as usize] = true);
            }
        }
        if reached.iter().filter(|r| **r).count() == before {
            break;
        }
    }
    assert!(reached.iter().all(|r| *r));
}

#[test]
fn noise_has_two_triangles_at_every_edge() {
    // All ambiguous cases, and voxels that only touch at edges and corners.
    let mut state = 88_172_645_463_325_252_u64;
    for percent in [20, 50, 80] {
        let mut volume = map([14, 13, 12], |_| 0);
        for label in &mut volume.labels {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            *label = u16::from(state % 100 < percent);
        }
        let surface = only(&volume, 1);
        assert_eq!(surface, only(&volume, 1));
    }
}

#[test]
fn coarse_blocks_and_mirrored_steps() {
    let middle = DVec3::new(31.0, 29.5, 30.0);
    let mut volume = map([61, 62, 63], |x| u16::from(x.distance(middle) <= 24.0));
    let fine = only(&volume, 1);
    for cell in [2, 3, 4] {
        let coarse = only(&volume, cell);
        assert!((coarse.volume() / fine.volume() - 1.0).abs() < 0.04, "{cell}: {}", coarse.volume() / fine.volume());
        assert!(coarse.triangles.len() * cell < fine.triangles.len());
        assert!(off_sphere(&coarse, middle, 24.0).0 < 0.35 * cell as f64);
    }
    // Steps as of a volume that runs to the left and to the back, turned and with thick slices.
    let turn = DMat3::from_rotation_y(0.3);
    volume.steps = turn * DMat3::from_diagonal(DVec3::new(-0.5e-3, -0.5e-3, -1.5e-3));
    volume.origin = DVec3::new(0.1, 0.2, -0.3);
    let placed = only(&volume, 1);
    let ratio = placed.volume() / (fine.volume() * 0.375e-9);
    assert!((ratio - 1.0).abs() < 1e-3, "{ratio}");
    let (a, b) = (placed.points[0], volume.origin + volume.steps * fine.points[0]);
    assert!(a.distance(b) < 1e-12);
}

#[test]
fn nothing_gives_nothing() {
    let empty = map([4; 3], |_| 0);
    assert!(surfaces(&empty, &[1, 2], 1).is_empty());
    assert!(surfaces(&empty, &[], 1).is_empty());
    assert!(surfaces(&LabelMap::default(), &[0, 1], 1).is_empty());
    // A map whose size is not that of its labels.
    let broken = LabelMap { size: [3, 3, usize::MAX], ..empty.clone() };
    assert!(surfaces(&broken, &[0], 1).is_empty());
    // A full one is a box, whose corners are round; a block larger than the map takes it as a whole, zero as single voxels.
    let full = map([4; 3], |_| 1);
    for cell in [0, 1, 2, 100, usize::MAX] {
        let surface = only(&full, cell);
        assert!(
            surface.volume() > if cell < 2 { 30.0 } else { 0.0 } && surface.volume() < 65.0,
            "{cell}: {}",
            surface.volume()
        );
    }
}
