//! Smooth surfaces of the parts of a scene, fixed in its cells: what is drawn in three dimensions.
//!
//! ```text
//! label map -> piece of it around the block -> surfaces (surface nets) -> scene -> clipped to the block -> corners in cells
//! ```
//! Without a label map the parts are sampled on a lattice first.
//! What fills the room between the other parts, fat and muscle, gets no surface of its own: it is seen where the block ends and on a cut.

use std::collections::BTreeMap;

use glam::DVec3;
use rayon::prelude::*;

use super::anatomy::{Anatomy, NOTHING, Part};
use super::contour::{self, Pieces, Place};
use crate::anatomy::colours::{self, Rgb};
use crate::anatomy::{Case, LabelMap, surface_nets};
use crate::mesh::{BlockMesh, CORNERS};
use crate::needle::lateral_axes;
use crate::scene::{RegionShape, Scene};

/// Edge of the blocks of voxels that count as one, of large parts [m]; of small ones every voxel counts.
const EDGE: f64 = 1.1e-3;
/// Voxels of a part that is small.
const SMALL: usize = 30_000;
/// How fine is drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detail {
    /// Triangles of all surfaces; of more, blocks of voxels are larger.
    pub most_triangles: usize,
    /// Distance between points at which a part is asked for on a cut, and where the block ends [m].
    pub step: f64,
    /// See `step`.
    pub border_step: f64,
    /// Least edge of what is drawn as one where the block ends beside the tissue [m]: far from the needle little moves there.
    pub border_edge: f64,
}

impl Detail {
    /// For adapters of hardware, and pictures that are drawn once.
    pub const FULL: Detail = Detail { most_triangles: 60_000, step: 0.7e-3, border_step: 1.1e-3, border_edge: 2.4e-3 };
    /// For software adapters, which pay for every corner on one thread: 0.3 ms of a picture for a thousand on llvmpipe.
    pub const LOW: Detail = Detail { most_triangles: 16_000, step: 1.0e-3, border_step: 1.6e-3, border_edge: 4.0e-3 };
}
/// What fills the room around the parts that are looked for.
const FILLERS: [&str; 4] = ["fat", "muscle", "skin", "tissue"];
/// What other parts lie in.
const ORGANS: [&str; 9] = ["liver", "kidney", "spleen", "lung", "heart", "brain", "thyroid", "breast", "bladder"];

/// How a surface is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// Bone, vessels and other parts.
    Solid,
    /// Organs, in which parts lie, and where the block ends.
    Organ,
    /// Where the tissue ends.
    Skin,
}

/// A corner of a triangle at rest in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// [m]
    pub place: DVec3,
    /// Unit vector outwards.
    pub normal: DVec3,
}

/// A triangle, counterclockwise from outside, in the colour of its part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangle {
    pub corners: [Corner; 3],
    pub colour: Rgb,
    pub layer: Layer,
}

/// Surfaces of the parts of a scene, as far as they lie in the block.
pub fn surfaces(scene: &Scene, block: &BlockMesh, anatomy: &Anatomy, detail: &Detail) -> Vec<Triangle> {
    let (low, high) = bounds(block);
    let case = scene.case.as_deref();
    if case.is_none() && scene.regions.is_empty() {
        return Vec::new();
    }
    let near = case.map_or_else(|| sampled(anatomy, low, high), |case| piece_around(case, low, high));
    // Sampled labels are numbers of parts.
    let part_of = |label: u16| if case.is_some() { anatomy.part_of_label(label) } else { usize::from(label) };
    let skin = near.labels.iter().map(|label| u16::from(*label != 0)).collect();
    let skin = LabelMap { labels: skin, names: BTreeMap::new(), ..near.clone() };
    let inverse = near.steps.inverse();
    let mut coarser = 1;
    loop {
        let mut found = Vec::new();
        let edge = (EDGE / near.spacing().min_element()).round().max(1.0) as usize * coarser;
        let mut add = |map: &LabelMap, label: u16, cell: usize, colour: Rgb, layer: Layer| {
            for surface in surface_nets::surfaces(map, &[label], cell) {
                let to_scene = |x: &DVec3| case.map_or(*x, |case| case.frame.to_scene(*x));
                let places: Vec<DVec3> = surface.points.iter().map(to_scene).collect();
                let normals = normals(&places, &surface.triangles);
                let corner = |n: u32| Corner { place: places[n as usize], normal: normals[n as usize] };
                // Where the volume ends, surfaces are closed, and there is none.
                let ends = |triangle: &[u32; 3]| {
                    let at = triangle.map(|n| inverse * (surface.points[n as usize] - map.origin));
                    let half = 0.5 * cell as f64 + 1e-6;
                    (0..3).any(|axis| {
                        let last = map.size[axis] as f64 - 0.5 - half;
                        at.iter().all(|x| x[axis] <= half - 0.5) || at.iter().all(|x| x[axis] >= last)
                    })
                };
                for triangle in surface.triangles.iter().filter(|triangle| !ends(triangle)) {
                    clip_to_box(&Triangle { corners: triangle.map(corner), colour, layer }, low, high, &mut found);
                }
            }
        };
        for (label, (count, _)) in near.volumes() {
            let part = &anatomy.parts()[part_of(label)];
            // The borders and the cut show layers as far as they go.
            let region = part.material.checked_sub(1).and_then(|region| scene.regions.get(region));
            let is_layer = region.is_some_and(|region| matches!(region.shape, RegionShape::Layer { .. }));
            if !is_of(part, &FILLERS) && !is_layer {
                let layer = if is_of(part, &ORGANS) { Layer::Organ } else { Layer::Solid };
                let cell = if count < SMALL { coarser } else { edge };
                add(&near, label, cell, part.colour, layer);
            }
        }
        let of_skin = (1..anatomy.parts().len())
            .find(|n| colours::of_kind(&anatomy.parts()[*n].name) == colours::of_kind("skin"));
        let colour = of_skin.map_or(colours::of_kind("skin").unwrap_or([228, 172, 140]), |n| anatomy.parts()[n].colour);
        // Without a label map the skin is the top face.
        if case.is_some() {
            add(&skin, 1, edge, colour, Layer::Skin);
        }
        if found.len() <= detail.most_triangles || coarser >= 8 {
            return found;
        }
        coarser *= 2;
    }
}

/// Parts of a block at points of a lattice, as a label map in the axes of the scene.
fn sampled(anatomy: &Anatomy, low: DVec3, high: DVec3) -> LabelMap {
    /// Distance of the points [m], and how many they may be.
    const SAMPLE: f64 = 0.35e-3;
    const MOST: f64 = 2.0e6;
    let volume = (high - low).element_product();
    let step = SAMPLE.max((volume / MOST).cbrt());
    let size = ((high - low) / step).ceil().to_array().map(|n| n.max(1.0) as usize);
    let origin = low + DVec3::splat(0.5 * step);
    let steps = glam::DMat3::from_diagonal(DVec3::splat(step));
    let mut map = LabelMap { size, steps, origin, labels: Vec::new(), names: BTreeMap::new() };
    let [nx, ny, nz] = size;
    map.labels = (0..nx * ny * nz)
        .into_par_iter()
        .map(|n| anatomy.part_at(map.position(n % nx, n / nx % ny, n / (nx * ny))) as u16)
        .collect();
    map
}

fn is_of(part: &Part, kinds: &[&str]) -> bool {
    let kind = colours::of_kind(&part.name);
    kind.is_some() && kinds.iter().any(|name| colours::of_kind(name) == kind)
}

fn bounds(block: &BlockMesh) -> (DVec3, DVec3) {
    let end = |last: bool| {
        DVec3::from_array(std::array::from_fn(|a| block.lines[a][if last { block.lines[a].len() - 1 } else { 0 }]))
    };
    (end(false), end(true))
}

/// The voxels in a box of the scene, and some around it.
fn piece_around(case: &Case, low: DVec3, high: DVec3) -> LabelMap {
    const AROUND: f64 = 4.0;
    let map = &case.map;
    let inverse = map.steps.inverse();
    let (mut least, mut most) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for corner in CORNERS {
        let x = case.frame.to_patient(DVec3::select(DVec3::from(corner).cmpgt(DVec3::ZERO), high, low));
        let at = inverse * (x - map.origin);
        (least, most) = (least.min(at), most.max(at));
    }
    let last = DVec3::from(map.size.map(|n| n as f64 - 1.0));
    let whole = |x: DVec3| x.clamp(DVec3::ZERO, last).to_array().map(|x| x as usize);
    let (from, to) = (whole((least - AROUND).floor()), whole((most + AROUND).ceil()));
    let size: [usize; 3] = std::array::from_fn(|a| to[a] - from[a] + 1);
    let mut labels = Vec::with_capacity(size.iter().product());
    for k in from[2]..=to[2] {
        for j in from[1]..=to[1] {
            let row = (k * map.size[1] + j) * map.size[0];
            labels.extend_from_slice(&map.labels[row + from[0]..=row + to[0]]);
        }
    }
    let origin = map.position(from[0], from[1], from[2]);
    LabelMap { size, steps: map.steps, origin, labels, names: map.names.clone() }
}

/// Normals at points, the mean of the triangles around weighted with their areas.
fn normals(places: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; places.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|n| places[n as usize]);
        let normal = (b - a).cross(c - a);
        triangle.iter().for_each(|n| sums[*n as usize] += normal);
    }
    sums.into_iter().map(|sum| sum.normalize_or(DVec3::Z)).collect()
}

fn clip_to_box(triangle: &Triangle, low: DVec3, high: DVec3, out: &mut Vec<Triangle>) {
    let is_inside = |c: &Corner| c.place.cmpge(low).all() && c.place.cmple(high).all();
    if triangle.corners.iter().all(is_inside) {
        out.push(*triangle);
        return;
    }
    let mut polygon = triangle.corners.to_vec();
    for axis in DVec3::AXES {
        clip(&mut polygon, axis, axis.dot(high));
        clip(&mut polygon, -axis, -axis.dot(low));
    }
    fan(triangle, &polygon, out);
}

/// Takes away what of a convex polygon lies beyond `normal . x = offset`.
fn clip(polygon: &mut Vec<Corner>, normal: DVec3, offset: f64) {
    let beyond = |corner: &Corner| normal.dot(corner.place) - offset;
    if polygon.iter().all(|corner| beyond(corner) <= 0.0) {
        return;
    }
    let before = std::mem::take(polygon);
    for (n, a) in before.iter().enumerate() {
        let b = &before[(n + 1) % before.len()];
        let (from, to) = (beyond(a), beyond(b));
        if from <= 0.0 {
            polygon.push(*a);
        }
        if (from <= 0.0) != (to <= 0.0) {
            let t = from / (from - to);
            let normal = a.normal.lerp(b.normal, t).normalize_or(a.normal);
            polygon.push(Corner { place: a.place.lerp(b.place, t), normal });
        }
    }
}

fn fan(of: &Triangle, polygon: &[Corner], out: &mut Vec<Triangle>) {
    for n in 2..polygon.len() {
        out.push(Triangle { corners: [polygon[0], polygon[n - 1], polygon[n]], ..*of });
    }
}

/// What is left of triangles on the near side of a plane, `normal . x <= offset` at rest.
pub fn cut(triangles: &[Triangle], normal: DVec3, offset: f64) -> Vec<Triangle> {
    let mut left = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let mut polygon = triangle.corners.to_vec();
        clip(&mut polygon, normal, offset);
        fan(triangle, &polygon, &mut left);
    }
    left
}

/// Splits flat triangles where parts end.
struct Flat<'a> {
    corners: [DVec3; 3],
    normal: DVec3,
    layer: Layer,
    /// What fills the room between other parts is seen through.
    is_glassy: bool,
    anatomy: &'a Anatomy<'a>,
    out: &'a mut Vec<Triangle>,
}

impl Pieces for Flat<'_> {
    fn piece(&mut self, part: usize, corners: [Place; 3]) {
        if part != NOTHING {
            let [a, b, c] = self.corners;
            let corner = |p: Place| Corner { place: a * p.x + b * p.y + c * p.z, normal: self.normal };
            let part = &self.anatomy.parts()[part];
            let layer = if self.is_glassy && is_of(part, &FILLERS) { Layer::Organ } else { self.layer };
            self.out.push(Triangle {
                corners: corners.map(contour::overlapping).map(corner),
                colour: part.colour,
                layer,
            });
        }
    }

    fn boundary(&mut self, _: [usize; 2], _: [Place; 2]) {}
}

/// A flat triangle at rest in the colours of its parts, asked for at points `step` apart [m].
fn flat(
    corners: [DVec3; 3],
    normal: DVec3,
    layer: (Layer, bool),
    step: f64,
    anatomy: &Anatomy,
    out: &mut Vec<Triangle>,
) {
    let longest = (0..3).map(|n| corners[n].distance(corners[(n + 1) % 3])).fold(0.0, f64::max);
    let [a, b, c] = corners;
    let part_at = |p: Place| anatomy.part_at(a * p.x + b * p.y + c * p.z);
    let (layer, is_glassy) = layer;
    let mut flat = Flat { corners, normal, layer, is_glassy, anatomy, out };
    contour::split((longest / step).ceil() as usize, part_at, &mut flat);
}

/// Edges of a cell, in the order of its nodes.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];

/// What lies in the plane `normal . x = offset` at rest, cell by cell, in the colours of its parts; `is_glassy`: what fills the room
/// between other parts is seen through as organs are.
pub fn face(
    block: &BlockMesh,
    (normal, offset): (DVec3, f64),
    (is_glassy, detail): (bool, &Detail),
    anatomy: &Anatomy,
    out: &mut Vec<Triangle>,
) {
    let (first, second) = lateral_axes(normal);
    let beyond: Vec<f64> = (0..block.node_count()).map(|n| normal.dot(block.rest_position(n)) - offset).collect();
    for cell in (0..block.cell_count()).filter(|cell| !block.is_gap(*cell)) {
        let nodes = block.cell_nodes(cell);
        let crossing = |[a, b]: [usize; 2]| {
            let (from, to) = (beyond[nodes[a]], beyond[nodes[b]]);
            ((from <= 0.0) != (to <= 0.0))
                .then(|| block.rest_position(nodes[a]).lerp(block.rest_position(nodes[b]), from / (from - to)))
        };
        let mut polygon: Vec<DVec3> = EDGES.into_iter().filter_map(crossing).collect();
        if polygon.len() < 3 {
            continue;
        }
        // A plane cuts a convex cell in a convex polygon: its corners in the order of their angle.
        let centre = polygon.iter().sum::<DVec3>() / polygon.len() as f64;
        let angle = |x: &DVec3| (*x - centre).dot(second).atan2((*x - centre).dot(first));
        polygon.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
        for n in 2..polygon.len() {
            flat(
                [polygon[0], polygon[n - 1], polygon[n]],
                normal,
                (Layer::Solid, is_glassy),
                detail.step,
                anatomy,
                out,
            );
        }
    }
}

/// Grid lines at least `edge` apart [m], the first and the last among them.
fn thinned(lines: &[f64], edge: f64) -> Vec<f64> {
    let (first, last) = (lines[0], lines[lines.len() - 1]);
    let mut kept = vec![first];
    for line in lines {
        if *line - kept[kept.len() - 1] >= edge && last - *line >= edge {
            kept.push(*line);
        }
    }
    kept.push(last);
    kept
}

/// What is seen where the block ends and not the tissue.
/// Without a label map (`is_whole`) the top face is the skin.
pub fn border(block: &BlockMesh, anatomy: &Anatomy, is_whole: bool, detail: &Detail) -> Vec<Triangle> {
    let mut out = Vec::new();
    // Just inside: on the face itself rounding decides.
    let (low, high) = bounds(block);
    let inside = 1e-6 * (high - low);
    let (low, high) = (low + inside, high - inside);
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (at, sign) in [(low[axis], -1.0), (high[axis], 1.0)] {
            let layer = if is_whole && axis == 2 && sign > 0.0 { Layer::Skin } else { Layer::Organ };
            let lines = |a: usize| {
                if layer == Layer::Skin { block.lines[a].clone() } else { thinned(&block.lines[a], detail.border_edge) }
            };
            let (across, along) = (lines(u), lines(v));
            for i in across.windows(2).filter(|w| w[1] > w[0]) {
                for j in along.windows(2).filter(|w| w[1] > w[0]) {
                    let corner = |a: f64, b: f64| {
                        let mut x = DVec3::ZERO;
                        (x[axis], x[u], x[v]) = (at, a.clamp(low[u], high[u]), b.clamp(low[v], high[v]));
                        x
                    };
                    let mut quad = [corner(i[0], j[0]), corner(i[1], j[0]), corner(i[1], j[1]), corner(i[0], j[1])];
                    if sign < 0.0 {
                        quad.reverse();
                    }
                    let normal = DVec3::AXES[axis] * sign;
                    flat([quad[0], quad[1], quad[2]], normal, (layer, false), detail.border_step, anatomy, &mut out);
                    flat([quad[0], quad[2], quad[3]], normal, (layer, false), detail.border_step, anatomy, &mut out);
                }
            }
        }
    }
    out
}

/// Where points of the tissue at rest lie in its cells.
pub struct Embedding<'a> {
    block: &'a BlockMesh,
    /// Nodes of tissue, and of what does not deform; those of air stand still beside it.
    known: Vec<bool>,
}

impl<'a> Embedding<'a> {
    /// For the cells of a scene.
    pub fn new(block: &'a BlockMesh, anatomy: &Anatomy) -> Self {
        let mut known = vec![false; block.node_count()];
        for cell in (0..block.cell_count()).filter(|cell| !block.is_gap(*cell)) {
            let nodes = block.cell_nodes(cell);
            let middle = || 0.125 * nodes.iter().map(|node| block.rest_position(*node)).sum::<DVec3>();
            if !block.is_empty(cell) || anatomy.parts()[anatomy.part_at(middle())].rigid {
                nodes.iter().for_each(|node| known[*node] = true);
            }
        }
        Embedding { block, known }
    }

    /// Nodes of tissue, and of what does not deform.
    pub fn known(&self) -> &[bool] {
        &self.known
    }

    /// The eight nodes whose displacements move a point of the scene at rest [m], with their weights, of sum 1 or all 0. Nodes of air do
    /// not count.
    pub fn of(&self, x: DVec3) -> ([usize; 8], [f64; 8]) {
        let ([i, j, k], local) = self.block.locate(x);
        let nodes = self.block.cell_nodes(self.block.cell_index(i, j, k));
        let all: [f64; 8] = std::array::from_fn(|n| {
            let part = |a: usize| 0.5 + CORNERS[n][a] * (local[a] - 0.5);
            if self.known[nodes[n]] { part(0) * part(1) * part(2) } else { 0.0 }
        });
        let sum: f64 = all.iter().sum();
        (nodes, if sum > 1e-9 { all.map(|weight| weight / sum) } else { [0.0; 8] })
    }

    /// Where a point of the tissue is [m], which lies at `x` at rest.
    pub fn moved(&self, x: DVec3, displacement: &[DVec3]) -> DVec3 {
        let (nodes, weights) = self.of(x);
        let own = |node: usize| displacement.get(node).copied().unwrap_or_default();
        x + nodes.into_iter().zip(weights).map(|(node, weight)| own(node) * weight).sum::<DVec3>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_counterclockwise_from_outside() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/anatomy/neck_vein.toml");
        let scene = Scene::load(&file, &[]).unwrap();
        let crate::mesh::Mesh::Block(block) = crate::mesh::Mesh::of_scene(&scene) else { panic!("no block") };
        let anatomy = Anatomy::of_any(&scene).unwrap();
        let mut count = usize::MAX;
        for detail in [&Detail::FULL, &Detail::LOW] {
            let drawn = are_outwards(&scene, &block, &anatomy, detail);
            assert!(drawn < count / 3 * 2, "{drawn} of {count}");
            count = drawn;
        }
    }

    /// Triangles of the whole.
    fn are_outwards(scene: &Scene, block: &BlockMesh, anatomy: &Anatomy, detail: &Detail) -> usize {
        let mut all = surfaces(scene, block, anatomy, detail);
        all.extend(border(block, anatomy, false, detail));
        let whole = all.len();
        for normal in DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            let mut drawn = cut(&all, normal, -1e-3);
            face(block, (normal, -1e-3), (false, detail), anatomy, &mut drawn);
            assert!(drawn.len() > whole / 8, "{} of {whole}", drawn.len());
            // Slivers have no side; a smoothed normal may turn away from a small triangle in a fold.
            let side = |t: &Triangle| {
                let [a, b, c] = t.corners.map(|c| c.place);
                let area = 0.5 * (b - a).cross(c - a);
                area.dot(t.corners.iter().map(|c| c.normal).sum())
            };
            let (right, wrong): (Vec<f64>, Vec<f64>) = drawn.iter().map(side).partition(|side| *side > 0.0);
            let sum = |sides: &[f64]| sides.iter().map(|side| side.abs()).sum::<f64>();
            assert!(sum(&wrong) < 1e-3 * sum(&right), "{normal}: {} of {}", sum(&wrong), sum(&right));
        }
        whole
    }

    #[test]
    fn thinned_lines_keep_both_ends_and_their_distance() {
        let lines: Vec<f64> = (0..40).map(|n| 1e-3 * f64::from(n)).collect();
        let edge = Detail::FULL.border_edge;
        let kept = thinned(&lines, edge);
        assert_eq!((kept[0], kept[kept.len() - 1]), (0.0, lines[39]));
        assert!(kept.windows(2).all(|w| w[1] - w[0] >= edge && lines.contains(&w[0])), "{kept:?}");
        // A block smaller than that has its two ends.
        assert_eq!(thinned(&lines[..2], edge), [0.0, 1e-3]);
    }
}
