//! Cut of the deformed hexahedral mesh with a plane.
//!
//! Every hexahedron is split into the six tetrahedra around its diagonal 0-6 (Kuhn subdivision): neighbours of a
//! structured block then share the diagonals of their common face, and the cut has no cracks.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::needle::Tool;
use crate::observables::field::VON_MISES;
use crate::observables::{FieldSnapshot, OpenedPath};
use crate::scene::Scene;

/// Remaining stiffness below which a cell counts as opened by the tip.
pub const OPENED_BELOW: f64 = 0.5;

/// The plane stands this fraction of the fine cell size beside the axis: exactly on grid lines, a cut would follow
/// cell faces, and rounding would decide cell by cell which side is drawn.
const BESIDE_GRID_LINES: f64 = 0.02;

/// Nodes that moved farther than this many block sizes are not drawn.
const FARTHEST_MOVE: f64 = 2.0;

/// Edges of triangles beside an opened path, in needle radii, and how often one is halved at most.
const SHORTEST: f64 = 0.15;
const MOST_HALVINGS: usize = 14;

/// The tetrahedra of a hexahedron, corners in VTK order.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 2, 6], [0, 1, 5, 6], [0, 3, 2, 6], [0, 3, 7, 6], [0, 4, 5, 6], [0, 4, 7, 6]];

/// The faces of a hexahedron as pairs of triangles on the same diagonals: axis, at the larger coordinate, triangles.
const FACES: [(usize, bool, [[usize; 3]; 2]); 6] = [
    (0, false, [[0, 3, 7], [0, 7, 4]]),
    (0, true, [[1, 2, 6], [1, 6, 5]]),
    (1, false, [[0, 1, 5], [0, 5, 4]]),
    (1, true, [[3, 2, 6], [3, 6, 7]]),
    (2, false, [[0, 1, 2], [0, 2, 3]]),
    (2, true, [[4, 5, 6], [4, 6, 7]]),
];

/// A plane with two axes in it. All vectors are unit vectors of the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of the tool's axis [m].
    pub origin: DVec3,
    /// To the right in the picture.
    pub right: DVec3,
    /// Upwards in the picture.
    pub up: DVec3,
    /// Towards the viewer.
    pub normal: DVec3,
}

impl Plane {
    /// For a needle the plane through its axis and world x; otherwise, and where both coincide, the plane
    /// y = entry.y. Where that passes beside the mesh it is moved to the cell nearest to the first target, or to the middle of the
    /// mesh.
    pub fn of_scene(scene: &Scene, mesh: &Mesh, snapshot: &FieldSnapshot) -> Self {
        let plane = Self::of_tool(scene, snapshot);
        if plane.meets(mesh, scene.tissue.cell_size) {
            return plane;
        }
        let (low, high) = mesh.bounds();
        let wanted = plane.height(scene.targets.first().map_or(0.5 * (low + high), |target| target.position));
        let middle = |cell: usize| {
            let nodes = mesh.cell_nodes(cell);
            nodes.iter().map(|n| mesh.rest_position(*n)).sum::<DVec3>() / nodes.len() as f64
        };
        let near = (0..mesh.cell_count())
            .filter(|cell| mesh.is_tissue(*cell))
            .map(|cell| plane.height(middle(cell)))
            .min_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()));
        Self { origin: plane.origin + plane.normal * near.unwrap_or(0.0), ..plane }
    }

    /// True where a cell at rest lies on both sides of the cut.
    fn meets(&self, mesh: &Mesh, cell_size: f64) -> bool {
        let plane = self.beside_grid_lines(cell_size);
        (0..mesh.cell_count()).filter(|cell| mesh.is_tissue(*cell)).any(|cell| {
            let nodes = mesh.cell_nodes(cell);
            let above = |node: &usize| plane.height(mesh.rest_position(*node)) >= 0.0;
            nodes.iter().any(above) && !nodes.iter().all(above)
        })
    }

    /// Where the mesh is cut.
    fn beside_grid_lines(&self, cell_size: f64) -> Self {
        Self { origin: self.origin - self.normal * (BESIDE_GRID_LINES * cell_size), ..*self }
    }

    fn of_tool(scene: &Scene, snapshot: &FieldSnapshot) -> Self {
        let upright = Self { origin: scene.motion.entry, right: DVec3::X, up: DVec3::Z, normal: DVec3::NEG_Y };
        let Some(Tool::Needle(_)) = scene.tool else {
            return upright;
        };
        let (origin, direction) = snapshot.tool_pose.unwrap_or((scene.motion.entry, scene.motion.direction));
        // World x lies in the plane, so it serves as the axis to the right.
        let up = -direction.reject_from(DVec3::X);
        match up.try_normalize() {
            Some(up) if origin.is_finite() => Self { origin, right: DVec3::X, up, normal: DVec3::X.cross(up) },
            _ => upright,
        }
    }

    /// Coordinates of a point in the plane [m].
    pub fn project(&self, point: DVec3) -> DVec2 {
        let p = point - self.origin;
        DVec2::new(p.dot(self.right), p.dot(self.up))
    }

    fn height(&self, point: DVec3) -> f64 {
        (point - self.origin).dot(self.normal)
    }
}

/// A triangle of the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceTriangle {
    /// Corners in the plane [m].
    pub points: [DVec2; 3],
    /// The same points of the tissue at rest [m].
    pub rest: [DVec3; 3],
    /// Von Mises stress at the corners [Pa].
    pub von_mises: [f64; 3],
    /// True in a cell that the tip has opened.
    pub opened: bool,
}

impl SliceTriangle {
    /// Its area [m^2].
    pub fn area(&self) -> f64 {
        let [a, b, c] = self.points;
        0.5 * (b - a).perp_dot(c - a).abs()
    }
}

/// What an edge in the cut separates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EdgeKind {
    /// Two cells of one material.
    Cells,
    /// Two materials.
    Materials,
    /// Tissue and air.
    Surface,
}

/// A piece of a cell edge in the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceLine {
    /// Ends in the plane [m].
    pub points: [DVec2; 2],
    /// The same points of the tissue at rest [m].
    pub rest: [DVec3; 2],
    pub kind: EdgeKind,
}

/// What the plane shows of the tissue.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Slice {
    pub triangles: Vec<SliceTriangle>,
    pub lines: Vec<SliceLine>,
    /// Cells that are not drawn because a node is not a finite number or far outside.
    pub cells_left_out: usize,
    /// True where the tissue beside an opened path is drawn where the needle has pushed it.
    pub is_opened: bool,
}

impl Slice {
    /// Moves what lies beside an opened path to where it is seen, and takes the stress that it has there. The plane holds the axis of the
    /// needle, from which the map leads away: what is in the plane stays in it.
    fn open(&mut self, opened: &OpenedPath, plane: &Plane) {
        self.is_opened = true;
        let in_space = |p: DVec2, rest: DVec3| {
            let place = plane.origin + plane.right * p.x + plane.up * p.y;
            opened.level_with_middle(rest, place, plane.normal)
        };
        let moved = |p: DVec2, rest: DVec3| opened.at(rest, in_space(p, rest)).map(|at| (plane.project(at.place), at));
        // Edges beside the path are so short, in needle radii: shorter where the map bends them more.
        let longest = |ends: [(DVec2, DVec3); 2]| {
            let near = |(p, rest): (DVec2, DVec3)| opened.distance(rest, in_space(p, rest));
            let middle = (0.5 * (ends[0].0 + ends[1].0), ends[0].1.lerp(ends[1].1, 0.5));
            let nearest = [ends[0], middle, ends[1]].into_iter().filter_map(near).fold(f64::INFINITY, f64::min);
            opened.shaft() * if nearest < 0.5 { SHORTEST } else { SHORTEST.max(0.5 * SHORTEST * nearest.powi(2)) }
        };
        let mut triangles = Vec::with_capacity(self.triangles.len());
        for triangle in std::mem::take(&mut self.triangles) {
            let mut open = vec![(triangle, 0)];
            while let Some((t, depth)) = open.pop() {
                // Every edge by itself, so that triangles on both sides of it halve it alike.
                let edge = |n: usize| {
                    let ends = [n, (n + 1) % 3].map(|n| (t.points[n], t.rest[n]));
                    (ends[0].0.distance(ends[1].0) / longest(ends), n)
                };
                let (too_long, n) = (0..3).map(edge).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
                let m = (n + 1) % 3;
                if depth < MOST_HALVINGS && too_long > 1.0 {
                    let middle = 0.5 * (t.points[n] + t.points[m]);
                    let (rest, stress) = (t.rest[n].lerp(t.rest[m], 0.5), 0.5 * (t.von_mises[n] + t.von_mises[m]));
                    for end in [n, m] {
                        let mut half = t;
                        (half.points[end], half.rest[end], half.von_mises[end]) = (middle, rest, stress);
                        open.push((half, depth + 1));
                    }
                    continue;
                }
                // What spans the path would be drawn across the needle.
                let sides = [0, 1, 2].map(|n| opened.offset_at(t.rest[n], in_space(t.points[n], t.rest[n])));
                let spans = |a: usize| match (sides[a], sides[(a + 1) % 3]) {
                    (Some(a), Some(b)) => a.dot(b) < 0.0,
                    _ => false,
                };
                if (0..3).any(spans) {
                    continue;
                }
                let mut seen = t;
                for corner in 0..3 {
                    if let Some((place, at)) = moved(t.points[corner], t.rest[corner]) {
                        seen.points[corner] = place;
                        seen.von_mises[corner] += at.weight * (at.von_mises - t.von_mises[corner]);
                    }
                }
                triangles.push(seen);
            }
        }
        self.triangles = triangles;
        let mut lines = Vec::with_capacity(self.lines.len());
        for line in std::mem::take(&mut self.lines) {
            let ends = [0, 1].map(|n| (line.points[n], line.rest[n]));
            let parts = (ends[0].0.distance(ends[1].0) / longest(ends)).ceil().clamp(1.0, 64.0) as usize;
            let at = |n: usize| {
                let t = n as f64 / parts as f64;
                let (p, rest) = (ends[0].0.lerp(ends[1].0, t), ends[0].1.lerp(ends[1].1, t));
                (moved(p, rest).map_or(p, |m| m.0), rest)
            };
            for n in 0..parts {
                let (a, b) = (at(n), at(n + 1));
                lines.push(SliceLine { points: [a.0, b.0], rest: [a.1, b.1], kind: line.kind });
            }
        }
        self.lines = lines;
    }
}

/// Cuts the deformed tissue.
pub fn cut(mesh: &Mesh, snapshot: &FieldSnapshot, plane: &Plane, cell_size: f64) -> Slice {
    cut_cells(mesh, snapshot, plane, cell_size, |cell| mesh.is_tissue(cell))
}

/// As [`cut`], but with the cells in which nothing is, or what does not deform: what lies in them is told by the label map. Of such cells
/// only edges at the border of the block are drawn.
pub fn cut_whole(mesh: &Mesh, snapshot: &FieldSnapshot, plane: &Plane, cell_size: f64) -> Slice {
    cut_cells(mesh, snapshot, plane, cell_size, |cell| !mesh.is_gap(cell))
}

fn cut_cells(
    mesh: &Mesh,
    snapshot: &FieldSnapshot,
    plane: &Plane,
    cell_size: f64,
    is_wanted: impl Fn(usize) -> bool,
) -> Slice {
    let plane = plane.beside_grid_lines(cell_size);
    // Beside an opened path the stress is taken where it is, not over whole cells.
    let of_cells = snapshot.opened.as_ref().map_or_else(|| VON_MISES.cells(snapshot), OpenedPath::coarse);
    let von_mises = smoothed_to_nodes(mesh, of_cells, &snapshot.stiffness);
    let (low, high) = mesh.bounds();
    let farthest = FARTHEST_MOVE * (high - low).max_element();
    let kinds = match mesh {
        Mesh::Block(_) => HashMap::new(),
        Mesh::Tets(tets) => face_kinds(tets, &snapshot.material),
    };
    let mut slice = Slice::default();
    for cell in 0..mesh.cell_count() {
        if !is_wanted(cell) {
            continue;
        }
        let nodes = mesh.cell_nodes(cell);
        let displacement: Vec<DVec3> =
            nodes.iter().map(|n| snapshot.displacement.get(*n).copied().unwrap_or_default()).collect();
        // Written so that NaN counts as too far.
        let drawable = displacement.iter().all(|u| u.length() <= farthest);
        let rest: Vec<DVec3> = nodes.iter().map(|n| mesh.rest_position(*n)).collect();
        let corner: Vec<DVec3> = rest.iter().zip(&displacement).map(|(rest, u)| *rest + *u).collect();
        if !drawable {
            slice.cells_left_out += 1;
            continue;
        }
        let height: Vec<f64> = corner.iter().map(|p| plane.height(*p)).collect();
        if height.iter().all(|&h| h >= 0.0) || height.iter().all(|&h| h < 0.0) {
            continue;
        }
        let opened = snapshot.stiffness.get(cell).is_some_and(|&s| s < OPENED_BELOW);
        let crossing = |a: usize, b: usize| {
            let t = height[a] / (height[a] - height[b]);
            (
                plane.project(corner[a].lerp(corner[b], t)),
                von_mises[nodes[a]] + t * (von_mises[nodes[b]] - von_mises[nodes[a]]),
                rest[a].lerp(rest[b], t),
            )
        };
        let parts: &[[usize; 4]] = if nodes.len() == 8 { &TETRAHEDRA } else { &[[0, 1, 2, 3]] };
        for tetrahedron in parts.iter().copied() {
            let (above, below): (Vec<usize>, Vec<usize>) = tetrahedron.into_iter().partition(|&c| height[c] >= 0.0);
            let mut push = |corners: [(DVec2, f64, DVec3); 3]| {
                slice.triangles.push(SliceTriangle {
                    points: corners.map(|c| c.0),
                    rest: corners.map(|c| c.2),
                    von_mises: corners.map(|c| c.1),
                    opened,
                });
            };
            match (above.as_slice(), below.as_slice()) {
                (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => {
                    push([crossing(a, b), crossing(a, c), crossing(a, d)]);
                }
                (&[a, b], &[c, d]) => {
                    let quad = [crossing(a, c), crossing(a, d), crossing(b, d), crossing(b, c)];
                    push([quad[0], quad[1], quad[2]]);
                    push([quad[0], quad[2], quad[3]]);
                }
                _ => {}
            }
        }
        let mut edge = |triangle: [usize; 3], kind: EdgeKind| {
            let ends: Vec<(DVec2, DVec3)> = (0..3)
                .map(|e| (triangle[e], triangle[(e + 1) % 3]))
                .filter(|&(a, b)| (height[a] >= 0.0) != (height[b] >= 0.0))
                .map(|(a, b)| crossing(a, b))
                .map(|(point, _, rest)| (point, rest))
                .collect();
            if let &[a, b] = ends.as_slice() {
                slice.lines.push(SliceLine { points: [a.0, b.0], rest: [a.1, b.1], kind });
            }
        };
        match mesh {
            Mesh::Block(block) => {
                let (at, cells) = (block.cell_coordinates(cell), block.cells());
                for (axis, at_max, triangles) in FACES {
                    let last = at[axis] + 1 == cells[axis];
                    // A shared face is drawn once, by the cell above it; that of an open gap by both cells.
                    let mut above = at;
                    above[axis] += 1;
                    let opened_above = at_max && !last && {
                        let other = block.cell_index(above[0], above[1], above[2]);
                        block.is_gap(other) && is_open(block, snapshot, other)
                    };
                    if at_max && !last && !opened_above {
                        continue;
                    }
                    let kind = if at_max || at[axis] == 0 {
                        EdgeKind::Surface
                    } else {
                        let mut below = at;
                        below[axis] -= 1;
                        let other = block.cell_index(below[0], below[1], below[2]);
                        match block.is_gap(other) && is_open(block, snapshot, other) {
                            true => EdgeKind::Surface,
                            false => between(&snapshot.material, cell, other),
                        }
                    };
                    if !block.is_empty(cell) || (kind == EdgeKind::Surface && (at[axis] == 0 || last)) {
                        triangles.into_iter().for_each(|triangle| edge(triangle, kind));
                    }
                }
            }
            Mesh::Tets(_) => {
                for triangle in TETRAHEDRON_FACES {
                    let face = sorted(triangle.map(|c| nodes[c] as u32));
                    edge(triangle, kinds.get(&face).map_or(EdgeKind::Cells, |k| k.0));
                }
            }
        }
    }
    if let Some(opened) = &snapshot.opened {
        slice.open(opened, &plane);
    }
    slice
}

/// True where copies of a node in a gap cell have parted by more than can be seen.
fn is_open(block: &BlockMesh, snapshot: &FieldSnapshot, gap: usize) -> bool {
    const VISIBLE: f64 = 5e-6;
    let nodes = block.cell_nodes(gap);
    let u = |n: usize| snapshot.displacement.get(n).copied().unwrap_or_default();
    (0..8).any(|i| {
        (i + 1..8).any(|j| {
            let (a, b) = (nodes[i], nodes[j]);
            block.rest_position(a) == block.rest_position(b) && u(a).distance(u(b)) > VISIBLE
        })
    })
}

/// Corners of the four faces of a tetrahedron.
const TETRAHEDRON_FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

fn sorted(mut face: [u32; 3]) -> [u32; 3] {
    face.sort_unstable();
    face
}

/// What lies between two cells; `material` per cell, empty where there is one only.
fn between(material: &[f64], cell: usize, other: usize) -> EdgeKind {
    if material.get(cell) == material.get(other) { EdgeKind::Cells } else { EdgeKind::Materials }
}

/// What every face of the mesh separates, and the tetrahedron that showed it first.
fn face_kinds(mesh: &TetMesh, material: &[f64]) -> HashMap<[u32; 3], (EdgeKind, usize)> {
    let mut kinds = HashMap::new();
    for (cell, tet) in mesh.tets.iter().enumerate() {
        for face in TETRAHEDRON_FACES.map(|f| sorted(f.map(|c| tet[c]))) {
            // A face is on the surface until a second tetrahedron shows it.
            kinds
                .entry(face)
                .and_modify(|kind: &mut (EdgeKind, usize)| kind.0 = between(material, cell, kind.1))
                .or_insert((EdgeKind::Surface, cell));
        }
    }
    kinds
}

/// Cell values at the nodes, the mean of the cells around weighted with their rest volumes. Opened cells and values
/// that are not finite do not count where there is another cell.
fn smoothed_to_nodes(mesh: &Mesh, values: &[f64], stiffness: &[f64]) -> Vec<f64> {
    let mut intact = vec![(0.0, 0.0); mesh.node_count()];
    let mut opened = intact.clone();
    for (cell, &value) in values.iter().enumerate() {
        // Cells that do not deform know no stress, and shall not pale what lies beside them.
        if !value.is_finite() || mesh.is_empty(cell) {
            continue;
        }
        let volume = mesh.cell_volume(cell);
        let is_opened = stiffness.get(cell).is_some_and(|&s| s < OPENED_BELOW);
        let sums = if is_opened { &mut opened } else { &mut intact };
        for node in mesh.cell_nodes(cell).iter() {
            sums[*node].0 += volume * value;
            sums[*node].1 += volume;
        }
    }
    intact
        .into_iter()
        .zip(opened)
        .map(|(intact, opened)| {
            let (sum, volume) = if intact.1 > 0.0 { intact } else { opened };
            if volume > 0.0 { sum / volume } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::BlockMesh;

    fn mesh() -> Mesh {
        let lines = |low: f64, high: f64, n: usize| (0..=n).map(|i| low + (high - low) * i as f64 / n as f64).collect();
        Mesh::Block(BlockMesh::new([lines(-0.01, 0.01, 5), lines(-0.01, 0.01, 4), lines(-0.016, 0.0, 4)]))
    }

    fn plane(up: DVec3) -> Plane {
        let up = up.normalize();
        Plane { origin: DVec3::ZERO, right: DVec3::X, up, normal: DVec3::X.cross(up) }
    }

    fn area(slice: &Slice) -> f64 {
        slice.triangles.iter().map(SliceTriangle::area).sum()
    }

    fn snapshot(mesh: &Mesh, displacement: impl Fn(DVec3) -> DVec3) -> FieldSnapshot {
        FieldSnapshot {
            displacement: (0..mesh.node_count()).map(|n| displacement(mesh.rest_position(n))).collect(),
            von_mises: vec![7.0; mesh.cell_count()],
            ..Default::default()
        }
    }

    #[test]
    fn an_upright_cut_has_the_area_of_the_block() {
        let mesh = mesh();
        let slice = cut(&mesh, &snapshot(&mesh, |_| DVec3::ZERO), &plane(DVec3::Z), 4e-3);
        assert!((area(&slice) - 0.02 * 0.016).abs() < 1e-12, "{}", area(&slice));
        for t in &slice.triangles {
            for value in t.von_mises {
                assert!((value - 7.0).abs() < 1e-9);
            }
        }
        let length = |kind: EdgeKind| -> f64 {
            slice.lines.iter().filter(|l| l.kind == kind).map(|l| l.points[0].distance(l.points[1])).sum()
        };
        assert!((length(EdgeKind::Surface) - 2.0 * 0.036).abs() < 1e-9);
        // Four inner grid lines upright, three lying.
        assert!((length(EdgeKind::Cells) - (4.0 * 0.016 + 3.0 * 0.02)).abs() < 1e-9);
    }

    #[test]
    fn a_tilted_cut_and_a_sheared_block() {
        let mesh = mesh();
        // The plane through the x axis, 30 degrees from the upright, meets the floor at y = 16 mm * tan(30) = 9.2 mm.
        let up = DVec3::new(0.0, -0.5, 0.75f64.sqrt());
        let slice = cut(&mesh, &snapshot(&mesh, |_| DVec3::ZERO), &plane(up), 4e-3);
        let expected = 0.02 * 0.016 / 0.75f64.sqrt();
        // The plane is shifted by 0.08 mm and may lose that much at one end.
        assert!((area(&slice) - expected).abs() < 2e-6, "{}", area(&slice));
        // A shear along x leaves the area of the upright cut.
        let sheared = snapshot(&mesh, |x| DVec3::new(0.3 * x.z, 0.0, 0.0));
        let slice = cut(&mesh, &sheared, &plane(DVec3::Z), 4e-3);
        assert!((area(&slice) - 0.02 * 0.016).abs() < 1e-12);
    }

    #[test]
    fn broken_nodes_are_left_out_and_counted() {
        let mesh = mesh();
        let mut snapshot = snapshot(&mesh, |_| DVec3::ZERO);
        snapshot.displacement[0] = DVec3::new(f64::NAN, 0.0, 0.0);
        let last = mesh.node_count() - 1;
        snapshot.displacement[last] = DVec3::splat(1e30);
        let slice = cut(&mesh, &snapshot, &plane(DVec3::Z), 4e-3);
        assert_eq!(slice.cells_left_out, 2);
        assert!(slice.triangles.iter().all(|t| t.points.iter().all(|p| p.is_finite())));
    }

    #[test]
    fn borders_of_materials_are_told_from_edges_of_cells() {
        // The block is 20 mm wide and 16 mm deep in four layers; the upper two are another material.
        let mesh = mesh();
        let mut fields = snapshot(&mesh, |_| DVec3::ZERO);
        fields.material =
            (0..mesh.cell_count()).map(|c| if mesh.cell_centre(c).z > -0.008 { 1.0 } else { 0.0 }).collect();
        let plane = Plane { origin: DVec3::ZERO, right: DVec3::X, up: DVec3::Z, normal: DVec3::NEG_Y };
        let length = |mesh: &Mesh, fields: &FieldSnapshot| -> f64 {
            let slice = cut(mesh, fields, &plane, 0.004);
            let borders = slice.lines.iter().filter(|l| l.kind == EdgeKind::Materials);
            borders.map(|l| l.points[0].distance(l.points[1])).sum()
        };
        assert!((length(&mesh, &fields) - 0.02).abs() < 1e-9);
        // The same block cut into tetrahedra: both neighbours of a face draw it.
        let tets = Mesh::Tets(std::sync::Arc::new(TetMesh::from_block(mesh.block())));
        let mut fields = snapshot(&tets, |_| DVec3::ZERO);
        fields.material =
            (0..tets.cell_count()).map(|c| if tets.cell_centre(c).z > -0.008 { 1.0 } else { 0.0 }).collect();
        assert!((length(&tets, &fields) - 0.04).abs() < 1e-9);
        fields.material.clear();
        assert_eq!(length(&tets, &fields), 0.0);
    }
}
