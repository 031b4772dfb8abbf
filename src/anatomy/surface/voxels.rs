//! Surfaces to a label map: which voxels have their centre inside.
//!
//! A line along x through the centres of a row of voxels meets the triangles at some places, each with a sign; inside is where the signs
//! met so far add up to a turn. Every triangle is asked how often its outline, seen along x, goes round the line: the outlines
//! of a closed surface cancel edge by edge, whatever the rounding, so that no row of voxels is ever filled by mistake (the crossing rule
//! of polygons, half open at their ends: Sunday, "Inclusion of a Point in a Polygon", 2001). Small holes are closed by a fan of
//! triangles from the middle of their rim, which is where the winding number of [`super::inside`] would close them, too; where the fans
//! would be a large part of the surface, every voxel is asked for that number.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::TriangleSurface;
use super::draft::root;
use super::inside::Inside;
use crate::anatomy::label_map::{LabelMap, MOST_VOXELS};
use crate::{Error, Result};

/// Largest share of the area that fans over holes may have.
const MOST_FANS: f64 = 0.05;

/// Most rows that triangles may be asked for, all together: minutes.
const MOST_ROWS: u64 = 20_000_000_000;

/// Most rows of one layer that triangles may be asked for: 256 MB.
const MOST_IN_LAYER: u64 = 16_000_000;

/// Most boxes and triangles that may be looked at where every voxel asks for its winding number: a minute or two.
const MOST_WORK: u64 = 5_000_000_000;

/// Voxels that tell how many that will be.
const SAMPLES: usize = 64;

/// A label map made of surfaces, and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Voxels {
    /// Label n + 1 is surface n.
    pub map: LabelMap,
    /// Voxels inside more than one surface, once for each surface that took them from another one.
    pub overlapping: usize,
    /// Plain sentences; empty where nothing is to be said.
    pub notices: Vec<String>,
}

/// Labels on a grid of cubes of edge `spacing` [m] with axes x, y, z, around all surfaces and `margin` [m] more. The coordinates
/// are taken as RAS; label n + 1 is surface n, and the later surface wins where some overlap.
///
/// # Errors
/// Where the grid would have too many voxels, or the surfaces too many folds.
pub fn label_map(surfaces: &[TriangleSurface], spacing: f64, margin: f64) -> Result<Voxels> {
    if !(spacing.is_normal() && spacing > 0.0 && margin.is_finite() && margin >= 0.0) {
        return Err(Error::input(
            format!("voxels of {spacing:e} m with a margin of {margin:e} m make no grid"),
            "give a spacing above zero, such as 0.001 m, and a margin of zero or more",
        ));
    }
    if surfaces.len() >= usize::from(u16::MAX) {
        return Err(Error::input(
            format!("{} surfaces are more than the {} labels of a map", surfaces.len(), u16::MAX),
            "take fewer surfaces, or join those of one tissue",
        ));
    }
    let bounds = surfaces.iter().filter_map(TriangleSurface::bounds);
    let Some((low, high)) = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) else {
        return Err(Error::input("no surface has any point", "take surfaces with triangles"));
    };
    let extent = high - low + 2.0 * margin;
    let counts = (extent / spacing).ceil().max(DVec3::ONE);
    if counts.is_nan() || counts.element_product() > MOST_VOXELS as f64 {
        // Three digits, rounded up.
        let needed = (extent.max(DVec3::splat(spacing)).element_product() / MOST_VOXELS as f64).cbrt();
        let digit = 10.0_f64.powf(needed.log10().floor() - 2.0);
        return Err(Error::input(
            format!(
                "{:.2e} voxels of {:.4} mm are more than the {MOST_VOXELS:.1e} that a volume may have",
                counts.element_product(),
                1e3 * spacing
            ),
            format!("take a spacing of {:.4} mm or more", 1e3 * (1.02 * needed / digit).ceil() * digit),
        ));
    }
    let size = counts.to_array().map(|n| n as usize);
    let origin = 0.5 * (low + high) - 0.5 * spacing * (counts - 1.0);
    let mut voxels = Voxels {
        map: LabelMap {
            size,
            steps: DMat3::from_diagonal(DVec3::splat(spacing)),
            origin,
            labels: vec![0; size.iter().product()],
            names: BTreeMap::new(),
        },
        ..Voxels::default()
    };
    for (number, surface) in surfaces.iter().enumerate() {
        let label = number as u16 + 1;
        voxels.map.names.insert(label, surface.name.clone());
        let (filled, taken) = fill(&mut voxels.map, surface, label)?;
        voxels.overlapping += taken;
        let name = &surface.name;
        if taken > 0 {
            voxels
                .notices
                .push(format!("{taken} voxels of {name} are in surfaces before it, too, and count as {name}."));
        }
        if filled == 0 {
            voxels.notices.push(format!("no voxel of {:.3} mm has its centre in {name}.", 1e3 * spacing));
        }
    }
    Ok(voxels)
}

/// Labels what is inside; returns the voxels that are, and those of them that had another label.
fn fill(map: &mut LabelMap, surface: &TriangleSurface, label: u16) -> Result<(usize, usize)> {
    let (filled, taken) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let set = |voxel: &mut u16| {
        taken.fetch_add(usize::from(*voxel != 0), Ordering::Relaxed);
        *voxel = label;
    };
    let [nx, ny, nz] = map.size;
    let (origin, spacing) = (map.origin, map.steps.x_axis.x);
    let centre = |i: usize, j: usize, k: usize| origin + spacing * DVec3::new(i as f64, j as f64, k as f64);
    let outwards = if surface.volume() < 0.0 { -1 } else { 1 };
    let layers = map.labels.par_chunks_mut(nx * ny).enumerate();
    let Some(closed) = Closed::of(surface) else {
        let inside = Inside::new(surface);
        // Triangles that lie all about cannot be taken together: a few voxels tell how much work that makes.
        let all = nx * ny * nz;
        let tried = all.min(SAMPLES);
        let work = |n: usize| {
            let n = n * (all / tried) + all / tried / 2;
            inside.winding_and_work(centre(n % nx, n / nx % ny, n / nx / ny)).1
        };
        let each = (0..tried).into_par_iter().map(work).sum::<u64>() / tried as u64;
        if each.saturating_mul(all as u64) > MOST_WORK {
            return Err(Error::input(
                format!("{}: it has holes so large that to tell what is inside would take too long", surface.name),
                "close the holes in the program that made the surface, or take a larger spacing",
            ));
        }
        layers.for_each(|(k, layer)| {
            for (n, voxel) in layer.iter_mut().enumerate() {
                if f64::from(outwards) * inside.winding(centre(n % nx, n / nx, k)) > 0.5 {
                    filled.fetch_add(1, Ordering::Relaxed);
                    set(voxel);
                }
            }
        });
        return Ok((filled.into_inner(), taken.into_inner()));
    };
    // Rows j or layers k that a triangle may meet; one more on either side costs nothing.
    let reach = |from: f64, to: f64, origin: f64, count: usize| {
        let first = ((from - origin) / spacing).floor().max(0.0) as usize;
        let end = (((to - origin) / spacing).ceil().max(0.0) as usize + 1).min(count);
        first.min(end)..end
    };
    let rows = |t: &[DVec3; 3]| reach(t[0].y.min(t[1].y).min(t[2].y), t[0].y.max(t[1].y).max(t[2].y), origin.y, ny);
    let slabs = |t: &[DVec3; 3]| reach(t[0].z.min(t[1].z).min(t[2].z), t[0].z.max(t[1].z).max(t[2].z), origin.z, nz);
    // Rows begun and ended per layer give the rows of every layer.
    let mut change = vec![0_i64; nz + 1];
    let mut order: Vec<(u32, u32)> = Vec::with_capacity(closed.triangles.len());
    for (n, corners) in closed.triangles.iter().enumerate() {
        let (rows, slabs) = (rows(corners).len() as i64, slabs(corners));
        change[slabs.start] += rows;
        change[slabs.end] -= rows;
        order.push((slabs.start as u32, n as u32));
    }
    let per_layer: Vec<u64> = change
        .iter()
        .scan(0_i64, |sum, change| {
            *sum += change;
            Some(*sum as u64)
        })
        .collect();
    let most = per_layer.iter().max().copied().unwrap_or(0);
    let all = per_layer.iter().sum::<u64>() + nz as u64 * order.len() as u64;
    if most > MOST_IN_LAYER || all > MOST_ROWS {
        return Err(Error::input(
            format!(
                "{}: {} triangles on {nz} layers of {ny} rows of voxels would take too long: {most} rows to look at in one layer",
                surface.name,
                surface.triangles.len()
            ),
            "take a larger spacing, or make the surface coarser",
        ));
    }
    order.sort_unstable();
    layers.for_each(|(k, layer)| {
        let z = centre(0, 0, k).z;
        let mut met: Vec<(u32, f64, i32)> = Vec::new();
        let begun = order.partition_point(|(first, _)| *first as usize <= k);
        for (_, n) in &order[..begun] {
            let corners = &closed.triangles[*n as usize];
            if corners.iter().all(|x| x.z < z) {
                continue;
            }
            for j in rows(corners) {
                let y = centre(0, j, 0).y;
                let turns = turns(corners, y, z);
                if turns != 0 {
                    met.push((j as u32, crossing(corners, y, z), turns * outwards));
                }
            }
        }
        met.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut count = 0;
        for row in met.chunk_by(|a, b| a.0 == b.0) {
            let mut level = 0;
            let place = |x: f64| ((x - origin.x) / spacing).ceil().clamp(0.0, nx as f64) as usize;
            for pair in row.windows(2) {
                level += pair[0].2;
                if level > 0 {
                    let begin = row[0].0 as usize * nx;
                    let (from, to) = (place(pair[0].1), place(pair[1].1));
                    layer[begin + from..begin + to.max(from)].iter_mut().for_each(set);
                    count += to.saturating_sub(from);
                }
            }
        }
        filled.fetch_add(count, Ordering::Relaxed);
    });
    Ok((filled.into_inner(), taken.into_inner()))
}

/// How often the outline of a triangle, seen along x, goes round the line at (y, z): +1 where the line enters from outside.
fn turns(corners: &[DVec3; 3], y: f64, z: f64) -> i32 {
    let [a, b, c] = *corners;
    turn(a, b, y, z) + turn(b, c, y, z) + turn(c, a, y, z)
}

/// Part of an edge in that: whether it crosses the ray from (y, z) towards larger y. The edge back gives exactly the opposite.
fn turn(a: DVec3, b: DVec3, y: f64, z: f64) -> i32 {
    if (a.z <= z) == (b.z <= z) {
        return 0;
    }
    let (sign, low, high) = if a.z <= z { (-1, a, b) } else { (1, b, a) };
    let left = (high.y - low.y) * (z - low.z) - (y - low.y) * (high.z - low.z);
    if left > 0.0 { sign } else { 0 }
}

/// Where the line at (y, z) meets the plane of a triangle, within the triangle.
fn crossing(corners: &[DVec3; 3], y: f64, z: f64) -> f64 {
    let [a, b, c] = *corners;
    let normal = (b - a).cross(c - a);
    let (low, high) = (a.x.min(b.x).min(c.x), a.x.max(b.x).max(c.x));
    let x = a.x - (normal.y * (y - a.y) + normal.z * (z - a.z)) / normal.x;
    if x.is_nan() { 0.5 * (low + high) } else { x.clamp(low, high) }
}

/// The corners of a surface whose holes are closed by fans.
struct Closed {
    triangles: Vec<[DVec3; 3]>,
}

impl Closed {
    /// `None` where the fans would be a large part of it.
    fn of(surface: &TriangleSurface) -> Option<Closed> {
        let mut triangles: Vec<[DVec3; 3]> = (0..surface.triangles.len()).map(|t| surface.corners(t)).collect();
        let mut halves: Vec<(u32, u32, bool)> = surface
            .triangles
            .iter()
            .flat_map(|t| (0..3).map(|n| (t[n], t[(n + 1) % 3])))
            .map(|(a, b)| (a.min(b), a.max(b), a < b))
            .collect();
        halves.par_sort_unstable();
        // Edges that do not cancel, as often as they do not.
        let mut open: Vec<(u32, u32)> = Vec::new();
        for group in halves.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let (a, b, _) = group[0];
            let up = group.iter().filter(|(_, _, up)| *up).count();
            let down = group.len() - up;
            open.extend((down..up).map(|_| (a, b)).chain((up..down).map(|_| (b, a))));
        }
        if open.is_empty() {
            return Some(Closed { triangles });
        }
        let mut rim: Vec<u32> = (0..surface.points.len() as u32).collect();
        for (a, b) in &open {
            let (a, b) = (root(&mut rim, *a), root(&mut rim, *b));
            rim[a.max(b) as usize] = a.min(b);
        }
        let mut middles = BTreeMap::<u32, (f64, DVec3)>::new();
        let ends = |(a, b): (u32, u32)| (surface.points[a as usize], surface.points[b as usize]);
        for edge in &open {
            let (x, y) = ends(*edge);
            let sum = middles.entry(root(&mut rim, edge.0)).or_default();
            *sum = (sum.0 + x.distance(y), sum.1 + x.distance(y) * 0.5 * (x + y));
        }
        let mut fans = 0.0;
        for edge in open {
            let (x, y) = ends(edge);
            let (length, sum) = middles[&root(&mut rim, edge.0)];
            // A rim without length has no area either.
            let middle = if length > 0.0 { sum / length } else { x };
            fans += 0.5 * (x - middle).cross(y - middle).length();
            triangles.push([y, x, middle]);
        }
        (fans <= MOST_FANS * surface.area()).then_some(Closed { triangles })
    }
}
