//! Tissue with a label map or shapes of regions in a picture: parts end where those do, not at the edges of cells.

use glam::{DVec2, DVec3};

use super::super::anatomy::{Anatomy, NOTHING};
use super::super::contour::{self, Pieces, Place};
use super::super::slice::{self, EdgeKind, Plane, Slice, SliceTriangle};
use super::super::surfaces::Embedding;
use super::{Canvas, Colour, INK, Layout, OPENED, OPENED_FIELD_WEIGHT, StressScale, WHITE, cell_edge_alpha};
use crate::mesh::Mesh;
use crate::observables::FieldSnapshot;
use crate::scene::Scene;

/// Distance between the points at which a part is asked for, in a picture of the width of the design [px].
const STEP: f64 = 1.6;
/// Bone and other parts that do not deform, beside colours of stress.
const RIGID: Colour = Colour(232, 224, 200);
/// So far beside a place, in lengths of an edge, it is asked which part is there.
const BESIDE: f64 = 1e-3;
/// Layers of cells of air that go along with the tissue.
const LAYERS_OF_AIR: usize = 2;
/// A triangle is asked at so many steps whether anything lies in it.
const LOOK: usize = 6;

/// A line between two parts, or between one and air [px].
pub(super) struct Boundary {
    pub(super) parts: [usize; 2],
    pub(super) ends: [DVec2; 2],
}

/// The cut through a scene with labels or shapes; triangles in which nothing lies are left out.
pub(super) fn cut(anatomy: &Anatomy, mesh: &Mesh, snapshot: &FieldSnapshot, plane: &Plane, scene: &Scene) -> Slice {
    let snapshot = &FieldSnapshot { displacement: with_air(anatomy, mesh, &snapshot.displacement), ..snapshot.clone() };
    let mut slice = slice::cut_whole(mesh, snapshot, plane, scene.tissue.cell_size);
    slice.triangles.retain(|t| {
        let mut points = (0..=LOOK).flat_map(|i| (0..=LOOK - i).map(move |j| [i, j].map(|n| n as f64 / LOOK as f64)));
        points.any(|[a, b]| anatomy.part_at(mixed(t.rest, DVec3::new(1.0 - a - b, a, b))) != NOTHING)
    });
    slice
}

/// Displacement of every node; those in the air, which stand still, go along with the tissue beside them: the surface of the tissue often
/// lies a little beyond the cells that move.
fn with_air(anatomy: &Anatomy, mesh: &Mesh, displacement: &[DVec3]) -> Vec<DVec3> {
    let mut all = displacement.to_vec();
    let Mesh::Block(block) = mesh else { return all };
    let mut known = Embedding::new(block, anatomy).known().to_vec();
    let border: Vec<usize> = (0..mesh.cell_count())
        .filter(|cell| mesh.is_empty(*cell) && !mesh.is_gap(*cell))
        .filter(|cell| mesh.cell_nodes(*cell).iter().any(|node| !known[*node]))
        .collect();
    for _ in 0..LAYERS_OF_AIR {
        let mut sums = vec![(DVec3::ZERO, 0.0); all.len()];
        for cell in &border {
            let nodes = mesh.cell_nodes(*cell);
            let of_tissue = nodes.iter().filter(|node| known[**node] && **node < all.len());
            let (sum, count) = of_tissue.fold((DVec3::ZERO, 0.0), |(sum, n), node| (sum + all[*node], n + 1.0));
            if count > 0.0 {
                for node in nodes.iter().filter(|node| !known[**node] && **node < all.len()) {
                    sums[*node].0 += sum;
                    sums[*node].1 += count;
                }
            }
        }
        for (node, (sum, count)) in sums.into_iter().enumerate().filter(|(_, (_, count))| *count > 0.0) {
            all[node] = sum / count;
            known[node] = true;
        }
    }
    all
}

fn mixed<T>(corners: [T; 3], place: Place) -> T
where
    T: std::ops::Mul<f64, Output = T> + std::ops::Add<Output = T> + Copy,
{
    corners[0] * place.x + corners[1] * place.y + corners[2] * place.z
}

/// Takes the pieces of one triangle after the other.
struct Painter<'a, F> {
    layout: &'a Layout,
    triangle: &'a SliceTriangle,
    paint: F,
    boundaries: &'a mut Vec<Boundary>,
}

impl<F: FnMut(&SliceTriangle, usize, [Place; 3], [DVec2; 3])> Painter<'_, F> {
    fn place(&self, place: Place) -> DVec2 {
        self.layout.place(mixed(self.triangle.points, contour::overlapping(place)))
    }
}

impl<F: FnMut(&SliceTriangle, usize, [Place; 3], [DVec2; 3])> Pieces for Painter<'_, F> {
    fn piece(&mut self, part: usize, corners: [Place; 3]) {
        if part != NOTHING {
            let at = corners.map(|corner| self.place(corner));
            (self.paint)(self.triangle, part, corners, at);
        }
    }

    fn boundary(&mut self, parts: [usize; 2], ends: [Place; 2]) {
        let ends = ends.map(|end| self.place(end));
        self.boundaries.push(Boundary { parts, ends });
    }
}

/// Calls `paint` with every piece: its triangle of the cut, its part, its corners in that triangle and in the picture [px]. Returns the lines
/// between parts, those on edges of cells, too.
pub(super) fn paint_parts(
    layout: &Layout,
    (slice, plane): (&Slice, &Plane),
    anatomy: &Anatomy,
    paint: &mut impl FnMut(&SliceTriangle, usize, [Place; 3], [DVec2; 3]),
) -> Vec<Boundary> {
    let mut boundaries = Vec::new();
    for triangle in &slice.triangles {
        let corners = triangle.points.map(|p| layout.place(p));
        let longest = (0..3).map(|n| corners[n].distance(corners[(n + 1) % 3])).fold(0.0, f64::max);
        let steps = (longest / (STEP * layout.unit)).ceil() as usize;
        // A little towards its middle: faces of layers are faces of cells, and rounding would decide on which side a corner lies.
        let part_at = |place: Place| anatomy.part_at(mixed(triangle.rest, place.lerp(Place::splat(1.0 / 3.0), BESIDE)));
        let mut painter = Painter { layout, triangle, paint: &mut *paint, boundaries: &mut boundaries };
        contour::split(steps, part_at, &mut painter);
    }
    for line in slice.lines.iter().filter(|line| line.kind == EdgeKind::Materials) {
        let ends = line.points.map(|p| layout.place(p));
        let steps = (ends[0].distance(ends[1]) / (2.0 * STEP * layout.unit)).ceil().clamp(1.0, 400.0) as usize;
        let aside = plane.normal.cross(line.rest[1] - line.rest[0]) * BESIDE;
        for n in 0..steps {
            let middle = line.rest[0].lerp(line.rest[1], (n as f64 + 0.5) / steps as f64);
            let parts = [middle + aside, middle - aside].map(|at| anatomy.part_at(at));
            if parts[0] != parts[1] {
                boundaries
                    .push(Boundary { parts, ends: [n, n + 1].map(|n| ends[0].lerp(ends[1], n as f64 / steps as f64)) });
            }
        }
    }
    boundaries
}

/// Stress of what deforms, and what does not, with the boundaries between materials.
pub(super) fn draw_stress(
    canvas: &mut Canvas,
    layout: &Layout,
    (slice, plane): (&Slice, &Plane),
    anatomy: &Anatomy,
    (scale, cell_size): (&StressScale, f64),
) {
    let parts = anatomy.parts();
    let mut paint = |t: &SliceTriangle, part: usize, corners: [Place; 3], at: [DVec2; 3]| {
        let (colour, weight) = match (parts[part].rigid, t.opened) {
            (true, _) => (RIGID, 0.0),
            (_, true) => (OPENED, OPENED_FIELD_WEIGHT),
            _ => (WHITE, 1.0),
        };
        for (corner, at) in corners.into_iter().zip(at) {
            let stress = (mixed(t.von_mises, corner) / scale.top).clamp(0.0, 1.0) as f32;
            canvas.vertex(at, colour.linear(1.0), stress, weight);
        }
    };
    let boundaries = paint_parts(layout, (slice, plane), anatomy, &mut paint);
    draw_edges(canvas, layout, slice, anatomy, WHITE.linear(cell_edge_alpha(layout, cell_size)));
    for boundary in &boundaries {
        let [a, b] = boundary.parts.map(|part| &parts[part]);
        let (width, colour) = if boundary.parts.contains(&NOTHING) {
            (2.0, INK.linear(1.0))
        } else if a.rigid != b.rigid {
            (1.5, INK.linear(1.0))
        } else if a.material != b.material {
            (1.5, WHITE.linear(0.6))
        } else {
            continue;
        };
        canvas.line(boundary.ends, width * layout.unit, colour);
    }
}

/// Edges of cells in what deforms, and where the block ends; as far as there is something.
pub(super) fn draw_edges(canvas: &mut Canvas, layout: &Layout, slice: &Slice, anatomy: &Anatomy, of_cells: [f32; 4]) {
    for pass in [false, true] {
        for line in slice.lines.iter().filter(|line| (line.kind == EdgeKind::Surface) == pass) {
            if !pass && of_cells[3] <= 0.0 {
                continue;
            }
            let ends = line.points.map(|p| layout.place(p));
            let steps = (ends[0].distance(ends[1]) / (2.0 * STEP * layout.unit)).ceil().clamp(1.0, 400.0) as usize;
            let is_drawn = |n: usize| {
                let part = anatomy.part_at(line.rest[0].lerp(line.rest[1], (n as f64 + 0.5) / steps as f64));
                part != NOTHING && (pass || !anatomy.parts()[part].rigid)
            };
            let mut from = None;
            for n in 0..=steps {
                match (n < steps && is_drawn(n), from) {
                    (true, None) => from = Some(n),
                    (false, Some(begin)) => {
                        let at = |n: usize| ends[0].lerp(ends[1], n as f64 / steps as f64);
                        let (width, colour) = if pass { (2.0, INK.linear(1.0)) } else { (1.0, of_cells) };
                        canvas.line([at(begin), at(n)], width * layout.unit, colour);
                        from = None;
                    }
                    _ => {}
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Picture;
    use super::*;
    use crate::mesh::BlockMesh;
    use crate::model::Model;

    const BALL: &str = "effects = [\"puncture\"]\n\
        [tissue]\nsize_mm = [20.0, 20.0, 16.0]\ncell_size_mm = 1.0\n\
        [material]\npreset = \"fat\"\n\
        [[region]]\nname = \"ball\"\nsphere_mm = { centre = [5.0, 0.0, -8.0], radius = 3.0 }\n\
        material = { preset = \"muscle-60kpa\" }\n\
        [needle]\ngauge = \"18G\"\ntip_half_angle_deg = 18.0\n\
        [[motion.phase]]\nkind = \"insert\"\nspeed_mm_s = 5.0\ndepth_mm = 6.0\n";

    /// What parts materials in a picture, all of it, lies on the circle that the plane cuts out of the ball, 3 mm in radius.
    /// As edges of cells it was a staircase of 24 mm.
    #[test]
    fn a_ball_in_a_block_of_cells_is_a_circle() {
        let scene = Scene::parse("ball.toml".as_ref(), BALL, &[]).unwrap();
        let mesh = BlockMesh::for_scene(&scene);
        let model = Model::new(scene, mesh);
        let material = (0..model.mesh.cell_count()).map(|cell| model.region_index(cell) as f64);
        let snapshot = FieldSnapshot {
            displacement: vec![DVec3::ZERO; model.mesh.node_count()],
            von_mises: vec![0.0; model.mesh.cell_count()],
            material: material.collect(),
            ..Default::default()
        };
        let picture = Picture::compose(&model.scene, &model.mesh, &snapshot);
        let between = WHITE.linear(0.6);
        let quads: Vec<DVec2> = picture
            .vertices
            .iter()
            .filter(|v| v.colour == between)
            .map(|v| DVec2::new(f64::from(v.position[0]), f64::from(v.position[1])))
            .collect();
        let [low, high] = [DVec2::min, DVec2::max].map(|bound| quads.iter().copied().reduce(bound).unwrap());
        let middle = 0.5 * (low + high);
        let radii: Vec<f64> = quads.iter().map(|q| q.distance(middle)).collect();
        let radius = radii.iter().sum::<f64>() / radii.len() as f64;
        let off = radii.iter().map(|r| (r / radius - 1.0).abs()).fold(0.0, f64::max);
        assert!(quads.len() > 300 && off < 0.03, "{} corners, {off} off a circle of {radius} px", quads.len());
    }
}
