//! What a file says, before it becomes surfaces: points that coincide are made one, triangles without area are left out.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use glam::DVec3;

use super::{Imported, TriangleSurface};
use crate::{Error, Result};

/// Farthest coordinate [m]: its cube is still a number by which others can be divided.
const FARTHEST: f64 = 1e9;

/// Points of a file that has no indices are one within this part of the diagonal.
const WELD: f64 = 1e-6;

/// Longest name [byte].
pub(super) const LONGEST_NAME: usize = 100;

/// Most points of one small cell that a point is compared with: a file of nothing but almost equal points ends, too.
const MOST_COMPARED: usize = 32;

const NO_POINT: u32 = u32::MAX;

/// Points and triangles as they stand in a file.
#[derive(Default)]
pub(super) struct Draft {
    /// In the unit of the file, finite.
    pub points: Vec<DVec3>,
    /// Name (empty: none) and triangles.
    pub parts: Vec<(String, Vec<[u32; 3]>)>,
    /// Corners that are written out for every triangle may differ in their last digit.
    pub loose: bool,
    pub notices: Vec<String>,
    /// Polygons that were cut into triangles, and those with fewer than three corners.
    pub cut: usize,
    pub flat: usize,
    /// Lines that stand beside the polygons.
    pub lines: usize,
}

impl Draft {
    /// The index that the next point gets.
    pub fn next_point(&self) -> Option<u32> {
        u32::try_from(self.points.len()).ok().filter(|n| *n < NO_POINT)
    }

    /// Adds a polygon to the last part as a fan of triangles.
    pub fn add_polygon(&mut self, corners: &[u32]) {
        let Some((_, triangles)) = self.parts.last_mut() else { return };
        if corners.len() < 3 {
            self.flat += 1;
            return;
        }
        self.cut += usize::from(corners.len() > 3);
        triangles.extend(corners[1..].windows(2).map(|pair| [corners[0], pair[0], pair[1]]));
    }

    /// Adds a strip of triangles to the last part; every second one runs the other way round.
    pub fn add_strip(&mut self, corners: &[u32]) {
        for (n, corners) in corners.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            self.add_polygon(&if n % 2 == 0 { [a, b, c] } else { [b, a, c] });
        }
    }

    /// The surfaces in metres.
    pub fn finish(mut self, name: &str, unit_m: f64) -> Result<Imported> {
        // Powers of ten are divided by, so that 4 mm is the number nearest to 0.004.
        let inverse = (1.0 / unit_m).round();
        let exact = inverse >= 1.0 && (unit_m * inverse - 1.0).abs() < 1e-15;
        for (number, point) in self.points.iter_mut().enumerate() {
            // Adding zero turns -0 into 0, so that equal coordinates are equal bits.
            let metres = if exact { *point / inverse } else { *point * unit_m } + 0.0;
            if !metres.is_finite() || metres.abs().max_element() > FARTHEST {
                let DVec3 { x, y, z } = *point;
                return Err(Error::input(
                    format!("{name}: point {number} stands at ({x:e}, {y:e}, {z:e}), which is no place in a patient"),
                    "correct the coordinates or the unit",
                ));
            }
            *point = metres;
        }
        let mut first = welded(&self.points);
        if self.loose {
            weld_near(&self.points, &mut first);
        }
        let stem = Path::new(name).file_stem().map_or("surface".into(), |s| s.to_string_lossy());
        let mut names = Names::default();
        let mut surfaces = Vec::new();
        let mut local = vec![NO_POINT; self.points.len()];
        let mut degenerate = 0;
        for (own, triangles) in std::mem::take(&mut self.parts) {
            let before = triangles.len();
            let mut surface = TriangleSurface { triangles, ..Default::default() };
            surface.triangles.iter_mut().for_each(|t| *t = t.map(|n| first[n as usize]));
            surface.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
            degenerate += before - surface.triangles.len();
            if surface.triangles.is_empty() {
                continue;
            }
            let mut used = Vec::new();
            for corner in surface.triangles.iter_mut().flatten() {
                let at = &mut local[*corner as usize];
                if *at == NO_POINT {
                    *at = used.len() as u32;
                    used.push(*corner);
                }
                *corner = *at;
            }
            for point in &used {
                local[*point as usize] = NO_POINT;
            }
            surface.points = used.iter().map(|n| self.points[*n as usize]).collect();
            surface.triangles.shrink_to_fit();
            surface.name = names.unique(if own.trim().is_empty() { &stem } else { own.trim() });
            surfaces.push(surface);
        }
        if surfaces.is_empty() {
            let mut way_out = "export the surface again, as triangles";
            let message = match (degenerate, self.lines) {
                (0, 0) => format!("{name}: no triangle is in the file"),
                (0, lines) => {
                    way_out = "save the closed surface (in 3D Slicer: Segmentations, Representations, Closed surface) or a label map";
                    format!("{name}: {lines} lines and no triangle are in the file: contours are no surface")
                }
                (n, _) => format!("{name}: none of the {n} triangles has an area"),
            };
            return Err(Error::input(message, way_out));
        }
        let mut notices = self.notices;
        if self.cut > 0 {
            notices.push(format!("{} polygons with more than three corners were cut into triangles.", self.cut));
        }
        if self.flat > 0 {
            notices.push(format!("{} faces with fewer than three corners were left out.", self.flat));
        }
        if degenerate > 0 {
            notices.push(format!("{degenerate} triangles with two corners in the same place were left out."));
        }
        Ok(Imported { surfaces, notices })
    }
}

/// Names that were given.
#[derive(Default)]
struct Names {
    taken: HashSet<String>,
    /// Next number behind a name that is taken.
    next: HashMap<String, u64>,
}

impl Names {
    /// A name that no other surface has.
    fn unique(&mut self, wanted: &str) -> String {
        let wanted = &wanted[..wanted.floor_char_boundary(LONGEST_NAME)];
        if self.taken.insert(wanted.to_string()) {
            return wanted.to_string();
        }
        let next = self.next.entry(wanted.to_string()).or_insert(2);
        loop {
            let name = format!("{wanted} {next}");
            *next += 1;
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }
}

/// For every point the first one with the same bits.
fn welded(points: &[DVec3]) -> Vec<u32> {
    let key = |n: u32| points[n as usize].to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by_key(|n| (key(*n), *n));
    let mut first: Vec<u32> = vec![0; points.len()];
    let mut head = 0;
    for (at, n) in order.iter().enumerate() {
        if at == 0 || key(*n) != key(head) {
            head = *n;
        }
        first[*n as usize] = head;
    }
    first
}

/// Joins points that stand closer than [`WELD`] of the diagonal, too.
fn weld_near(points: &[DVec3], first: &mut [u32]) {
    let Some(begin) = points.first() else { return };
    let (low, high) = points.iter().fold((*begin, *begin), |(low, high), x| (low.min(*x), high.max(*x)));
    let near = WELD * (high - low).length();
    // So wide that most points have no cell beside theirs within reach.
    let width = 16.0 * near;
    if !(near > 0.0 && width.is_normal()) {
        return;
    }
    let cell = |x: DVec3| ((x - low) / width).floor().to_array().map(|v| v as u32);
    let mut cells: Vec<([u32; 3], u32)> =
        (0..points.len() as u32).filter(|n| first[*n as usize] == *n).map(|n| (cell(points[n as usize]), n)).collect();
    cells.sort_unstable();
    let mut moved = false;
    for (_, n) in &cells {
        let x = points[*n as usize];
        let (from, to) = (cell((x - near).max(low)), cell(x + near));
        for i in from[0]..=to[0] {
            for j in from[1]..=to[1] {
                for k in from[2]..=to[2] {
                    let begin = cells.partition_point(|(c, _)| *c < [i, j, k]);
                    let same = cells[begin..].iter().take_while(|(c, _)| *c == [i, j, k]).take(MOST_COMPARED);
                    for (_, other) in same {
                        if other < n && points[*other as usize].distance_squared(x) <= near * near {
                            let (a, b) = (root(first, *n), root(first, *other));
                            first[a.max(b) as usize] = a.min(b);
                            moved = true;
                        }
                    }
                }
            }
        }
    }
    if moved {
        for n in 0..first.len() as u32 {
            first[n as usize] = root(first, n);
        }
    }
}

/// The first of the points that are joined with this one.
pub(super) fn root(first: &mut [u32], mut n: u32) -> u32 {
    while first[n as usize] != n {
        let above = first[first[n as usize] as usize];
        first[n as usize] = above;
        n = above;
    }
    n
}
