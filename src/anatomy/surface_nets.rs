//! Smooth closed surfaces of the labels of a volume, for drawing.
//!
//! Surface nets (Gibson, "Constrained elastic surface nets", MICCAI 1998): between eight voxels of which some have the label and some have
//! not lies a point, and around every step from a voxel inside to one outside four of these points are a quadrilateral. Where several
//! sheets of the surface pass between the same eight voxels each gets a point of its own (dual marching cubes: Nielson, IEEE
//! Visualization 2004), so that every edge has two triangles; on a face with two corners of four inside, across from each other, these
//! are apart, but for the case that would let four triangles meet (Wenger, "Isosurfaces", CRC Press 2013, section 5.5). Points then move
//! towards the middle of their neighbours and back by the same share (Taubin, "A signal processing approach to fair surface design",
//! SIGGRAPH 1995), which takes the steps of voxels away but not the volume, and never leave the cube between their eight voxels.

#![warn(missing_docs)]

use glam::{DVec3, UVec3};
use rayon::prelude::*;

use super::label_map::LabelMap;
use super::surface::TriangleSurface;

/// Pairs of smoothing steps, and the shares of the way to the middle of the neighbours and back.
const ROUNDS: usize = 10;
const FORTH: f64 = 0.6;
const BACK: f64 = -0.64;

/// Most quadrilaterals of a surface; of more, blocks of twice the edge are taken.
const MOST_QUADS: usize = 4_000_000;

/// Most blocks of a layer: 32 B each.
const LARGEST_LAYER: usize = 1 << 24;

/// A closed surface of each wanted label that the map has, in their order, RAS [m], seen counterclockwise from outside.
///
/// A block of `cell`^3 voxels counts as one where at least half of it has the label, so that large volumes give few triangles; what is
/// thinner than half a block is lost. At the border of the volume the surface is closed. Points are RAS, the name is that of the label.
pub fn surfaces(map: &LabelMap, wanted: &[u16], cell: usize) -> Vec<TriangleSurface> {
    let [nx, ny, nz] = map.size;
    if nx.checked_mul(ny).and_then(|n| n.checked_mul(nz)) != Some(map.labels.len()) || map.labels.is_empty() {
        return Vec::new();
    }
    let boxes = boxes(map);
    let found: Vec<Option<TriangleSurface>> = wanted
        .par_iter()
        .map(|label| {
            let bounds = *boxes.get(usize::from(*label))?;
            let longest = nx.max(ny).max(nz);
            let mut cell = cell.clamp(1, longest);
            (bounds[0][0] <= bounds[1][0]).then_some(())?;
            loop {
                match Net::of(map, *label, bounds, cell) {
                    Some(net) => return net.surface(map, *label, cell),
                    None if cell > longest => return None,
                    None => cell *= 2,
                }
            }
        })
        .collect();
    found.into_iter().flatten().collect()
}

/// Lowest and highest voxel of every label along each axis.
type Box = [[usize; 3]; 2];

const NOTHING: Box = [[usize::MAX; 3], [0; 3]];

fn boxes(map: &LabelMap) -> Vec<Box> {
    let [nx, ny, _] = map.size;
    let most = map.labels.par_iter().copied().max().unwrap_or(0);
    let none = || vec![NOTHING; usize::from(most) + 1];
    let join = |mut all: Vec<Box>, other: Vec<Box>| {
        for (own, other) in all.iter_mut().zip(other) {
            for axis in 0..3 {
                own[0][axis] = own[0][axis].min(other[0][axis]);
                own[1][axis] = own[1][axis].max(other[1][axis]);
            }
        }
        all
    };
    let layers = map.labels.par_chunks(nx * ny).enumerate();
    let each = layers.fold(none, |mut boxes, (k, layer)| {
        for (j, row) in layer.chunks_exact(nx).enumerate() {
            // Runs of one label: their ends are enough.
            let mut i = 0;
            for run in row.chunk_by(|a, b| a == b) {
                let own = &mut boxes[usize::from(run[0])];
                for (axis, (from, to)) in [(i, i + run.len() - 1), (j, j), (k, k)].into_iter().enumerate() {
                    own[0][axis] = own[0][axis].min(from);
                    own[1][axis] = own[1][axis].max(to);
                }
                i += run.len();
            }
        }
        boxes
    });
    each.reduce(none, join)
}

/// Corner n of a cube is at its bits: 1 for x, 2 for y, 4 for z. Edges by their axis, from the corner that they begin at.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Edge between two corners.
fn edge_between(a: usize, b: usize) -> usize {
    let (low, axis) = (a & b, a ^ b);
    match axis {
        1 => (low & 2) / 2 + (low & 4) / 2,
        2 => 4 + (low & 1) + (low & 4) / 2,
        _ => 8 + (low & 3),
    }
}

/// Corners around face `2 * axis + side`.
fn face(number: usize) -> [usize; 4] {
    let (axis, side) = (number / 2, number % 2);
    let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
    let base = side << axis;
    [base, base | u, base | u | v, base | v]
}

/// Whether corners across from each other are the only ones inside on a face.
fn is_ambiguous(corners: u8, number: usize) -> bool {
    let [a, b, c, d] = face(number).map(|n| corners >> n & 1);
    a == c && b == d && a != b
}

/// The sheet to which each crossed edge of a cube belongs, from 0, and how many there are. `joined`: bits of the faces on which the
/// two corners inside are not apart.
fn sheets(corners: u8, joined: u8) -> ([u8; 12], usize) {
    let mut sheet: [u8; 12] = std::array::from_fn(|n| n as u8);
    let mut join = |a: usize, b: usize| {
        let (a, b) = (sheet[a].min(sheet[b]), sheet[a].max(sheet[b]));
        sheet.iter_mut().filter(|s| **s == b).for_each(|s| *s = a);
    };
    for number in 0..6 {
        let around = face(number);
        let inside = around.map(|n| corners >> n & 1 == 1);
        let edge = |n: usize| edge_between(around[n % 4], around[(n + 1) % 4]);
        if is_ambiguous(corners, number) {
            // Both edges at a corner are one piece: at the corners inside, or at those outside.
            let first = usize::from(inside[0] == (joined >> number & 1 == 1));
            join(edge(first + 3), edge(first));
            join(edge(first + 1), edge(first + 2));
        } else {
            let mut crossed = (0..4).filter(|n| inside[*n] != inside[(*n + 1) % 4]);
            if let (Some(a), Some(b)) = (crossed.next(), crossed.next()) {
                join(edge(a), edge(b));
            }
        }
    }
    let mut names = [u8::MAX; 12];
    let mut count = 0;
    for (n, [a, b]) in EDGES.iter().enumerate() {
        if (corners >> a ^ corners >> b) & 1 == 1 && names[sheet[n] as usize] == u8::MAX {
            names[sheet[n] as usize] = count;
            count += 1;
        }
    }
    (sheet.map(|s| names[s as usize]), usize::from(count))
}

/// Whether the two pieces of the surface on an ambiguous face belong to one sheet of the cube.
fn is_one_sheet(corners: u8, number: usize) -> bool {
    let (sheet, around) = (sheets(corners, 0).0, face(number));
    let of = |n: usize| sheet[edge_between(around[n % 4], around[(n + 1) % 4])];
    (0..4).all(|n| of(n) == of(0))
}

/// Points in blocks from `first`, with the lowest corner of the cube that each stays in, and quadrilaterals.
#[derive(Default)]
struct Net {
    /// The block at 0 [blocks from that of the first voxel].
    first: DVec3,
    points: Vec<DVec3>,
    cubes: Vec<UVec3>,
    quads: Vec<[u32; 4]>,
}

/// Blocks of a map, with one of nothing around them.
struct Blocks {
    /// First block and how many, with the border.
    first: [usize; 3],
    size: [usize; 3],
    /// Layer by layer, whether a block has the label.
    layers: Vec<Vec<bool>>,
}

impl Blocks {
    /// Whether blocks of layer k, from the border on, have the label.
    fn layer(&self, map: &LabelMap, label: u16, cell: usize, k: usize) -> Vec<bool> {
        let [bx, by, bz] = self.size;
        let mut filled = vec![0_usize; bx * by];
        let span = |n: usize, axis: usize| {
            let begin = (self.first[axis] + n - 1) * cell;
            begin.min(map.size[axis])..(begin + cell).min(map.size[axis])
        };
        if k == 0 || k + 1 == bz {
            return vec![false; bx * by];
        }
        let [nx, ny, _] = map.size;
        let along = span(1, 0).start..span(bx - 2, 0).end;
        for z in span(k, 2) {
            for j in 1..by - 1 {
                for y in span(j, 1) {
                    let row = &map.labels[(z * ny + y) * nx..][along.clone()];
                    for (block, counted) in row.chunks(cell).zip(&mut filled[j * bx + 1..]) {
                        *counted += block.iter().filter(|l| **l == label).count();
                    }
                }
            }
        }
        let deep = span(k, 2).len();
        let enough = |(n, filled): (usize, usize)| {
            let (i, j) = (n % bx, n / bx);
            if i == 0 || j == 0 || i + 1 == bx || j + 1 == by {
                return false;
            }
            filled > 0 && 2 * filled >= span(i, 0).len() * span(j, 1).len() * deep
        };
        filled.into_iter().enumerate().map(enough).collect()
    }

    /// Corners of the cube that begins at block (i, j, k), of which layers k - 1 .. k + 2 are there.
    fn corners(&self, i: usize, j: usize, k: usize) -> u8 {
        let bx = self.size[0];
        (0..8).fold(0, |bits, n| {
            let at = (j + (n >> 1 & 1)) * bx + i + (n & 1);
            bits | u8::from(self.layers[k + (n >> 2)][at]) << n
        })
    }
}

impl Net {
    /// The net of a label; `None` where it has too many quadrilaterals.
    fn of(map: &LabelMap, label: u16, bounds: Box, cell: usize) -> Option<Net> {
        let first = bounds[0].map(|n| n / cell);
        let size: [usize; 3] = std::array::from_fn(|axis| bounds[1][axis] / cell - first[axis] + 3);
        let mut blocks = Blocks { first, size, layers: Vec::new() };
        let [bx, by, bz] = size;
        if bx * by > LARGEST_LAYER {
            return None;
        }
        let first = DVec3::from_array(first.map(|n| n as f64)) - 1.0;
        let mut net = Net { first, ..Net::default() };
        // First point and sheets of the edges of every cube, of the layer before and of this one.
        let none = (u32::MAX, [u8::MAX; 12]);
        let mut before = vec![none; bx * by];
        // Layers of blocks are made as they are needed, and given up behind.
        for k in 0..bz {
            while blocks.layers.len() < (k + 3).min(bz) {
                let next = blocks.layer(map, label, cell, blocks.layers.len());
                blocks.layers.push(next);
            }
            if k >= 2 {
                blocks.layers[k - 2] = Vec::new();
            }
            let mut here = vec![none; bx * by];
            if k + 1 < bz {
                for j in 0..by - 1 {
                    if net.is_too_large() {
                        return None;
                    }
                    for i in 0..bx - 1 {
                        let corners = blocks.corners(i, j, k);
                        if corners != 0 && corners != u8::MAX {
                            here[j * bx + i] = net.add_points(&blocks, [i, j, k], corners);
                        }
                    }
                }
            }
            net.add_quads(&blocks, k, &before, &here);
            if net.is_too_large() {
                return None;
            }
            before = here;
        }
        Some(net)
    }

    fn is_too_large(&self) -> bool {
        self.quads.len() > MOST_QUADS || self.points.len() > 2 * MOST_QUADS
    }

    /// The points of a cube.
    fn add_points(&mut self, blocks: &Blocks, at: [usize; 3], corners: u8) -> (u32, [u8; 12]) {
        let mut joined = 0;
        for number in (0..6).filter(|n| is_ambiguous(corners, *n)) {
            // An ambiguous face is never on the border of nothing, so that there is a cube behind it.
            let mut other = at;
            other[number / 2] = (other[number / 2] + number % 2 * 2).saturating_sub(1);
            let behind = blocks.corners(other[0], other[1], other[2]);
            let both = is_one_sheet(corners, number) && is_one_sheet(behind, number ^ 1);
            joined |= u8::from(both) << number;
        }
        let (sheet, count) = sheets(corners, joined);
        let first = self.points.len() as u32;
        let cube = UVec3::from_array(at.map(|n| n as u32));
        for own in 0..count {
            let (mut sum, mut edges) = (DVec3::ZERO, 0.0);
            for (n, [a, b]) in EDGES.iter().enumerate() {
                if usize::from(sheet[n]) == own {
                    let corner = |n: usize| DVec3::new((n & 1) as f64, (n >> 1 & 1) as f64, (n >> 2) as f64);
                    sum += 0.5 * (corner(*a) + corner(*b));
                    edges += 1.0;
                }
            }
            self.points.push(cube.as_dvec3() + sum / edges);
            self.cubes.push(cube);
        }
        (first, sheet)
    }

    /// Quadrilaterals around the steps that begin at blocks of layer k.
    fn add_quads(&mut self, blocks: &Blocks, k: usize, before: &[(u32, [u8; 12])], here: &[(u32, [u8; 12])]) {
        let [bx, by, bz] = blocks.size;
        let layer = &blocks.layers[k];
        for j in 0..by {
            if self.is_too_large() {
                return;
            }
            for i in 0..bx {
                let inside = layer[j * bx + i];
                for axis in 0..3 {
                    let end = [i + usize::from(axis == 0), j + usize::from(axis == 1), k + usize::from(axis == 2)];
                    if end[0] == bx || end[1] == by || end[2] == bz {
                        continue;
                    }
                    if blocks.layers[end[2]][end[1] * bx + end[0]] == inside {
                        continue;
                    }
                    // The four cubes around the step, counterclockwise seen from its end; a step is never at the border of all.
                    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                    let mut quad = [(1, 1), (0, 1), (0, 0), (1, 0)].map(|(back_u, back_v)| {
                        let mut back = [0; 3];
                        (back[u], back[v]) = (back_u, back_v);
                        let cubes = if back[2] == 1 { before } else { here };
                        let (first, sheet) = &cubes[(j - back[1]) * bx + i - back[0]];
                        let from = back[0] | back[1] << 1 | back[2] << 2;
                        first + u32::from(sheet[edge_between(from, from | 1 << axis)])
                    });
                    if !inside {
                        quad.reverse();
                    }
                    self.quads.push(quad);
                }
            }
        }
    }

    /// Takes the steps of voxels away.
    fn smooth(&mut self) {
        let mut sums = vec![(DVec3::ZERO, 0.0); self.points.len()];
        for round in 0..2 * ROUNDS {
            sums.fill((DVec3::ZERO, 0.0));
            // Both quadrilaterals at an edge count it, in opposite directions: each end once.
            for quad in &self.quads {
                for n in 0..4 {
                    let sum = &mut sums[quad[n] as usize];
                    *sum = (sum.0 + self.points[quad[(n + 1) % 4] as usize], sum.1 + 1.0);
                }
            }
            let share = if round % 2 == 0 { FORTH } else { BACK };
            for ((point, cube), (sum, count)) in self.points.iter_mut().zip(&self.cubes).zip(&sums) {
                if *count > 0.0 {
                    let moved = point.lerp(*sum / *count, share);
                    *point = moved.clamp(cube.as_dvec3(), cube.as_dvec3() + 1.0);
                }
            }
        }
    }

    /// The surface in RAS; `None` without triangles.
    fn surface(mut self, map: &LabelMap, label: u16, cell: usize) -> Option<TriangleSurface> {
        if self.quads.is_empty() {
            return None;
        }
        self.smooth();
        let edge = cell as f64;
        let voxel = |block: DVec3| (self.first + block) * edge + 0.5 * (edge - 1.0);
        let points: Vec<DVec3> = self.points.iter().map(|x| map.origin + map.steps * voxel(*x)).collect();
        let mirrored = map.steps.determinant() < 0.0;
        let mut triangles = Vec::with_capacity(2 * self.quads.len());
        for quad in &self.quads {
            let [a, b, c, d] = if mirrored { [quad[3], quad[2], quad[1], quad[0]] } else { *quad };
            let length = |a: u32, b: u32| points[a as usize].distance_squared(points[b as usize]);
            // The shorter diagonal bends the less.
            if length(a, c) <= length(b, d) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
        let name = map.names.get(&label).cloned().unwrap_or_else(|| format!("label {label}"));
        Some(TriangleSurface { name, points, triangles })
    }
}
