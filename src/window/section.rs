//! What a window draws of the tissue: its surface, cut open by a plane.
//!
//! The plane is fixed in the material, not in space: a corner of a triangle is a point on a mesh edge, `(1 - t) X_a + t X_b`, and
//! stays on that edge while the tissue deforms. So the triangles change only when the plane is moved, and every frame takes the
//! positions from the solver's own buffer.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use crate::mesh::Mesh;

/// A corner of a triangle: between two nodes, `part` of the way.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct TissueCorner {
    pub nodes: [u32; 2],
    /// 0 at the first node, 1 at the second.
    pub part: f32,
}

/// The tissue with `normal . X > offset` is taken away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestPlane {
    /// Unit vector.
    pub normal: DVec3,
    /// [m]
    pub offset: f64,
}

/// Faces of a hexahedron in VTK order and of a tetrahedron.
const HEXAHEDRON_FACES: [[usize; 4]; 6] =
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
const TETRAHEDRON_FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

/// Their edges.
const HEXAHEDRON_EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
const TETRAHEDRON_EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

/// The outer faces of a mesh, found once; where layers are seen through also those of what stays solid behind them.
pub struct Outline {
    /// Outer faces of the solid cells.
    solid: Vec<Vec<u32>>,
    /// Outer faces of the tissue that belong to cells that are seen through.
    veiled: Vec<Vec<u32>>,
    /// Whether a cell is seen through; empty where none is.
    through: Vec<bool>,
}

/// A face of one or two cells, as each of them sees it, and whether that cell is seen through.
type FaceOwners = Vec<(Vec<u32>, bool)>;

impl Outline {
    /// Faces that belong to one cell only. The flat cells between two copies of a grid line are no tissue, so the two sides of a cut
    /// are faces.
    ///
    /// A cell for which `through` says so is seen through. Where all cells are solid, give `|_| false`.
    pub fn of(mesh: &Mesh, through: impl Fn(usize) -> bool) -> Self {
        let mut owners: HashMap<Vec<u32>, FaceOwners> = HashMap::new();
        let through: Vec<bool> = (0..mesh.cell_count()).map(through).collect();
        for cell in (0..mesh.cell_count()).filter(|cell| mesh.is_tissue(*cell)) {
            let nodes = mesh.cell_nodes(cell);
            let mut add = |face: &[usize]| {
                let face: Vec<u32> = face.iter().map(|n| nodes[*n] as u32).collect();
                let mut key = face.clone();
                key.sort_unstable();
                owners.entry(key).or_default().push((face, through[cell]));
            };
            match nodes.len() {
                8 => HEXAHEDRON_FACES.iter().for_each(|face| add(face)),
                _ => TETRAHEDRON_FACES.iter().for_each(|face| add(face)),
            }
        }
        let (mut solid, mut veiled) = (Vec::new(), Vec::new());
        for owners in owners.into_values() {
            let mut of_solid = owners.iter().filter(|(_, through)| !through);
            match (of_solid.next(), of_solid.next()) {
                (Some((face, _)), None) => solid.push(face.clone()),
                // Between two layers that are both seen through there is nothing to see.
                (None, _) if owners.len() == 1 => veiled.push(owners[0].0.clone()),
                _ => {}
            }
        }
        // The order of a hash map changes from run to run.
        solid.sort_unstable();
        veiled.sort_unstable();
        let through = if through.contains(&true) { through } else { Vec::new() };
        Outline { solid, veiled, through }
    }

    pub fn face_count(&self) -> usize {
        self.solid.len() + self.veiled.len()
    }

    /// Triangles of the tissue that is left by a plane: its surface and the cut. Three corners each.
    pub fn cut(&self, mesh: &Mesh, plane: Option<RestPlane>) -> Cut {
        let distance = distances(mesh, plane);
        let mut corners = Vec::with_capacity(6 * self.face_count());
        let is_through = |cell: usize| self.through.get(cell).is_some_and(|through| *through);
        surface_into(&self.solid, &distance, &mut corners);
        let surface = corners.len();
        if let Some(plane) = plane {
            slice_into(mesh, plane, &distance, |cell| !is_through(cell), &mut corners);
        }
        let solid = corners.len();
        surface_into(&self.veiled, &distance, &mut corners);
        if let Some(plane) = plane {
            slice_into(mesh, plane, &distance, is_through, &mut corners);
        }
        Cut { corners, surface, solid }
    }
}

/// What a plane leaves of the tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Cut {
    /// Of the surface of solid tissue, of the cut through it, and of what is seen through.
    pub corners: Vec<TissueCorner>,
    /// So many of them belong to the surface of solid tissue,
    pub surface: usize,
    /// and so many to solid tissue in all.
    pub solid: usize,
}

/// Triangles of what lies on this side of the plane.
fn surface_into(faces: &[Vec<u32>], distance: &[f64], corners: &mut Vec<TissueCorner>) {
    let mut polygon = Vec::with_capacity(8);
    for face in faces {
        polygon.clear();
        for (n, a) in face.iter().enumerate() {
            let b = face[(n + 1) % face.len()];
            if distance[*a as usize] <= 0.0 {
                polygon.push(TissueCorner { nodes: [*a; 2], part: 0.0 });
            }
            polygon.extend(crossing(distance, *a, b));
        }
        fan(&polygon, corners);
    }
}

/// Triangles of the tissue in a plane, three corners each.
pub fn slice(mesh: &Mesh, plane: RestPlane) -> Vec<TissueCorner> {
    let mut corners = Vec::new();
    slice_into(mesh, plane, &distances(mesh, Some(plane)), |_| true, &mut corners);
    corners
}

/// As [`slice`], of other cells than those that deform.
pub fn slice_of(mesh: &Mesh, plane: RestPlane, is_wanted: impl Fn(usize) -> bool) -> Vec<TissueCorner> {
    let mut corners = Vec::new();
    slice_cells(mesh, plane, &distances(mesh, Some(plane)), is_wanted, &mut corners);
    corners
}

/// How far every node lies beyond the plane [m]; all are inside without one.
fn distances(mesh: &Mesh, plane: Option<RestPlane>) -> Vec<f64> {
    let beyond = |node: usize| plane.map_or(-1.0, |p| p.normal.dot(mesh.rest_position(node)) - p.offset);
    (0..mesh.node_count()).map(beyond).collect()
}

fn slice_into(
    mesh: &Mesh,
    plane: RestPlane,
    distance: &[f64],
    is_wanted: impl Fn(usize) -> bool,
    corners: &mut Vec<TissueCorner>,
) {
    slice_cells(mesh, plane, distance, |cell| mesh.is_tissue(cell) && is_wanted(cell), corners);
}

fn slice_cells(
    mesh: &Mesh,
    plane: RestPlane,
    distance: &[f64],
    is_wanted: impl Fn(usize) -> bool,
    corners: &mut Vec<TissueCorner>,
) {
    let mut polygon = Vec::with_capacity(8);
    let (first, second) = crate::needle::lateral_axes(plane.normal);
    for cell in (0..mesh.cell_count()).filter(|cell| is_wanted(*cell)) {
        let nodes = mesh.cell_nodes(cell);
        let edges: &[[usize; 2]] = if nodes.len() == 8 { &HEXAHEDRON_EDGES } else { &TETRAHEDRON_EDGES };
        polygon.clear();
        polygon.extend(edges.iter().filter_map(|[a, b]| crossing(distance, nodes[*a] as u32, nodes[*b] as u32)));
        if polygon.len() < 3 {
            continue;
        }
        // A plane cuts a convex cell in a convex polygon: its corners in the order of their angle.
        let place = |corner: &TissueCorner| {
            let [a, b] = corner.nodes.map(|n| mesh.rest_position(n as usize));
            a.lerp(b, f64::from(corner.part))
        };
        let centre = polygon.iter().map(place).sum::<DVec3>() / polygon.len() as f64;
        let angle = |corner: &TissueCorner| {
            let arm = place(corner) - centre;
            arm.dot(second).atan2(arm.dot(first))
        };
        polygon.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        fan(&polygon, corners);
    }
}

/// Where an edge crosses the plane; the same corner from either end.
fn crossing(distance: &[f64], a: u32, b: u32) -> Option<TissueCorner> {
    let (a, b) = (a.min(b), a.max(b));
    let (from, to) = (distance[a as usize], distance[b as usize]);
    ((from <= 0.0) != (to <= 0.0))
        .then(|| TissueCorner { nodes: [a, b], part: (from / (from - to)).clamp(0.0, 1.0) as f32 })
}

/// Every corner once, and which of them the triangles have: a corner belongs to some six triangles, and is placed once.
pub fn indexed(corners: &[TissueCorner]) -> (Vec<TissueCorner>, Vec<u32>) {
    let mut known = HashMap::new();
    let mut single = Vec::new();
    let mut number = |corner: &TissueCorner| {
        *known.entry((corner.nodes, corner.part.to_bits())).or_insert_with(|| {
            single.push(*corner);
            single.len() as u32 - 1
        })
    };
    let numbers = corners.iter().map(&mut number).collect();
    (single, numbers)
}

/// Triangles of a convex polygon.
fn fan(polygon: &[TissueCorner], corners: &mut Vec<TissueCorner>) {
    for n in 2..polygon.len() {
        corners.extend([polygon[0], polygon[n - 1], polygon[n]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{BlockMesh, TetMesh};
    use std::sync::Arc;

    fn block() -> BlockMesh {
        let line = |n: usize| (0..=n).map(|i| i as f64 * 1e-3).collect::<Vec<_>>();
        BlockMesh::new([line(4), line(3), line(2)])
    }

    fn area(mesh: &Mesh, corners: &[TissueCorner]) -> f64 {
        let place = |c: &TissueCorner| {
            mesh.rest_position(c.nodes[0] as usize).lerp(mesh.rest_position(c.nodes[1] as usize), f64::from(c.part))
        };
        corners
            .chunks_exact(3)
            .map(|t| 0.5 * (place(&t[1]) - place(&t[0])).cross(place(&t[2]) - place(&t[0])).length())
            .sum()
    }

    /// The surface of a cut block is the surface of the smaller block, whatever the plane and the cells.
    #[test]
    fn a_cut_block_is_closed() {
        let tets = Mesh::Tets(Arc::new(TetMesh::from_block(&block())));
        for mesh in [Mesh::Block(block()), tets] {
            let outline = Outline::of(&mesh, |_| false);
            let whole = 2.0 * (4.0 * 3.0 + 3.0 * 2.0 + 2.0 * 4.0) * 1e-6;
            assert!((area(&mesh, &outline.cut(&mesh, None).corners) / whole - 1.0).abs() < 1e-12);
            for part in [0.3, 1.0, 2.5] {
                let plane = RestPlane { normal: DVec3::X, offset: part * 1e-3 };
                let left = 2.0 * (part * 3.0 + 3.0 * 2.0 + 2.0 * part) * 1e-6;
                let cut = outline.cut(&mesh, Some(plane));
                let found = area(&mesh, &cut.corners);
                assert!((found / left - 1.0).abs() < 1e-6, "{part}: {found} against {left}");
                // The slice alone is what the cut adds to the surface.
                assert_eq!(cut.corners[cut.surface..], slice(&mesh, plane));
                assert_eq!(cut.solid, cut.corners.len());
                assert!((area(&mesh, &cut.corners[cut.surface..]) / 6e-6 - 1.0).abs() < 1e-6);
            }
        }
        // A plane at a slope cuts a triangle off a corner.
        let mesh = Mesh::Block(block());
        let plane = RestPlane { normal: DVec3::ONE.normalize(), offset: 1e-3 / 3f64.sqrt() };
        let corners = Outline::of(&mesh, |_| false).cut(&mesh, Some(plane)).corners;
        let expected = (3f64.sqrt() / 2.0 + 1.5) * 1e-6;
        assert!((area(&mesh, &corners) / expected - 1.0).abs() < 1e-6);
    }

    /// Above 1 mm the tissue is seen through: what stays solid is the smaller block, closed, the rest is the outside of the layer.
    #[test]
    fn behind_a_layer_that_is_seen_through_the_tissue_is_closed() {
        let tets = Mesh::Tets(Arc::new(TetMesh::from_block(&block())));
        for mesh in [Mesh::Block(block()), tets] {
            let upper = |cell: usize| mesh.cell_centre(cell).z > 1e-3;
            let outline = Outline::of(&mesh, upper);
            let whole = outline.cut(&mesh, None);
            let (solid, veiled) = whole.corners.split_at(whole.solid);
            assert_eq!(whole.surface, whole.solid);
            // 4 x 3 x 1 mm below; above the top and the four sides.
            assert!((area(&mesh, solid) / (2.0 * (12.0 + 3.0 + 4.0) * 1e-6) - 1.0).abs() < 1e-12);
            assert!((area(&mesh, veiled) / ((12.0 + 2.0 * (3.0 + 4.0)) * 1e-6) - 1.0).abs() < 1e-12);
            // A cut at x = 1.5 mm leaves 3 x 1 mm of each.
            let cut = outline.cut(&mesh, Some(RestPlane { normal: DVec3::X, offset: 1.5e-3 }));
            assert!((area(&mesh, &cut.corners[cut.surface..cut.solid]) / 3e-6 - 1.0).abs() < 1e-6);
            let veiled = area(&mesh, &cut.corners[cut.solid..]) * 1e6;
            // Top, two sides, the far end and the cut.
            assert!((veiled / (4.5 + 2.0 * 1.5 + 3.0 + 3.0) - 1.0).abs() < 1e-6, "{veiled}");
            // All of it seen through: nothing solid is left.
            let nothing = Outline::of(&mesh, |_| true).cut(&mesh, None);
            assert_eq!(nothing.solid, 0);
            assert_eq!(nothing.corners, Outline::of(&mesh, |_| false).cut(&mesh, None).corners);
        }
    }

    #[test]
    fn every_corner_is_placed_once() {
        let mesh = Mesh::Block(block());
        let whole = Outline::of(&mesh, |_| false).cut(&mesh, None).corners;
        let (single, numbers) = indexed(&whole);
        // 5 x 4 x 3 nodes, of which 3 x 2 x 1 lie inside.
        assert_eq!(single.len(), 60 - 6);
        let back: Vec<TissueCorner> = numbers.iter().map(|n| single[*n as usize]).collect();
        assert_eq!(back, whole);
        // Between the nodes: 5 x 4 edges cross a plane between two layers.
        let plane = RestPlane { normal: DVec3::Z, offset: 0.3e-3 };
        assert_eq!(indexed(&slice(&mesh, plane)).0.len(), 20);
    }

    #[test]
    fn nothing_is_left_beyond_the_block() {
        let mesh = Mesh::Block(block());
        assert!(
            Outline::of(&mesh, |_| false)
                .cut(&mesh, Some(RestPlane { normal: DVec3::X, offset: -1e-3 }))
                .corners
                .is_empty()
        );
    }
}
