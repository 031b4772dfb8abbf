//! Where rest positions lie in the cells of a mesh, and how cells lie beside a path: what the plan of an opened path asks of blocks and of
//! tetrahedra alike.

use glam::DVec3;

use crate::mesh::tets::lattice;
use crate::mesh::{BlockMesh, CORNERS, Mesh, TetMesh, trilinear};
use crate::needle::path_line::PathLine;

use super::opening::{VOLUME_PLACE, is_volume_place};

/// Places per edge of a hexahedron at which it is asked what part of it lies near the path.
const SAMPLES: usize = 12;

/// Points per edge of the cube that is folded into a tetrahedron to ask the same; 816 of them differ.
const TET_SAMPLES: usize = 16;

/// Places of Gauss' rule in a tetrahedron lie on the way from its middle to its corners, this part of it: 1/sqrt 5.
const TETRAHEDRON_PLACE: f64 = 0.447_213_595_499_957_9;

/// A rest position in the mesh: cell, corners, weights and gradients [1/m]. A tetrahedron has four corners; its first one fills the rest, with no
/// weight.
pub(super) struct Place {
    pub cell: usize,
    pub corners: [usize; 8],
    pub weights: [f64; 8],
    pub gradients: [DVec3; 8],
    /// In a hexahedron, 0..1.
    pub local: DVec3,
    pub inside: bool,
}

/// Tetrahedra near a path, with their bounding boxes [m].
#[derive(Debug, Clone)]
pub struct NearTets(Vec<(u32, DVec3, DVec3)>);

impl NearTets {
    /// Those within `reach` of the straight line [m].
    pub fn new(mesh: &TetMesh, line: &PathLine, reach: f64) -> Self {
        let piece = line.piece(0.0);
        let with_box = |cell: u32| {
            let [a, b, c, d] = mesh.corners(cell as usize);
            (cell, a.min(b).min(c.min(d)), a.max(b).max(c.max(d)))
        };
        NearTets(mesh.near_line(piece.origin, piece.direction, reach).into_iter().map(with_box).collect())
    }

    /// Their numbers.
    pub fn cells(&self) -> impl Iterator<Item = usize> {
        self.0.iter().map(|(cell, ..)| *cell as usize)
    }

    /// The tetrahedron that holds a rest position, its barycentric coordinates there, and true where it holds it; of a place in none of them the
    /// nearest. `None`: there are no tetrahedra.
    pub fn find(&self, mesh: &TetMesh, x: DVec3) -> Option<(usize, [f64; 4], bool)> {
        /// How far beyond a face rounding may carry a point that lies on it, in barycentric coordinates.
        const BESIDE: f64 = 1e-9;
        let least = |weights: &[f64; 4]| weights.iter().fold(f64::INFINITY, |least: f64, w| least.min(*w));
        let with_weights = |cell: u32| (cell as usize, mesh.barycentric(cell as usize, x));
        let held = self.0.iter().filter(|(_, low, high)| x.cmpge(*low).all() && x.cmple(*high).all());
        let mut held = held.map(|(cell, ..)| with_weights(*cell));
        if let Some((cell, weights)) = held.find(|(_, weights)| least(weights) >= -BESIDE) {
            return Some((cell, weights, true));
        }
        // How far it lies beside the box of a tetrahedron says which is the nearest.
        let beside = |low: &DVec3, high: &DVec3| (x - x.clamp(*low, *high)).length_squared();
        let nearest = self.0.iter().map(|(_, low, high)| beside(low, high)).fold(f64::INFINITY, f64::min);
        let candidates = self.0.iter().filter(|(_, low, high)| beside(low, high) <= nearest);
        let with_least = candidates.map(|(cell, ..)| with_weights(*cell)).map(|(cell, w)| (cell, w, least(&w)));
        with_least.max_by(|a, b| a.2.total_cmp(&b.2)).map(|(cell, weights, _)| (cell, weights, false))
    }
}

/// The cells around a path.
pub(super) enum Places<'a> {
    Block(&'a BlockMesh),
    Tets { mesh: &'a TetMesh, near: NearTets, samples: Vec<([f64; 4], f64)> },
}

impl<'a> Places<'a> {
    /// Those of a mesh; of tetrahedra those within `reach` of the line [m].
    pub fn new(mesh: &'a Mesh, line: &PathLine, reach: f64) -> Self {
        let tets = match mesh {
            Mesh::Block(block) => return Places::Block(block),
            Mesh::Tets(tets) => tets,
        };
        Places::Tets { mesh: tets, near: NearTets::new(tets, line, reach), samples: lattice(TET_SAMPLES) }
    }

    /// Where a rest position lies; outside of the tissue as the nearest cell goes on.
    pub fn place(&self, x: DVec3) -> Place {
        match self {
            Places::Block(mesh) => {
                let ([i, j, k], at) = mesh.locate(x);
                let (corners, cell) = (mesh.cell_nodes(mesh.cell_index(i, j, k)), mesh.cell_index(i, j, k));
                let width = mesh.cell_size(cell);
                let exact = (x - mesh.rest_position(corners[0])) / width;
                let inside = (exact - at).abs().max_element() < 1e-9;
                let (weights, gradients) = trilinear(exact, width);
                Place { cell, corners, weights, gradients, local: exact, inside }
            }
            Places::Tets { mesh, near, .. } => {
                let (cell, w, inside) = near.find(mesh, x).expect("a path lies in the mesh");
                let (nodes, b) = (mesh.tets[cell].map(|n| n as usize), mesh.gradients(cell));
                let corner = |i: usize| nodes[if i < 4 { i } else { 0 }];
                Place {
                    cell,
                    corners: std::array::from_fn(corner),
                    weights: std::array::from_fn(|i| w.get(i).copied().unwrap_or(0.0)),
                    gradients: std::array::from_fn(|i| b.get(i).copied().unwrap_or(DVec3::ZERO)),
                    local: DVec3::ZERO,
                    inside,
                }
            }
        }
    }

    /// Cells that may lie near the path.
    pub fn cells(&self) -> Vec<usize> {
        match self {
            Places::Block(mesh) => (0..mesh.cell_count()).collect(),
            Places::Tets { near, .. } => near.cells().collect(),
        }
    }

    /// Edge of the cells around the path [m]: that of cubes with their mean volume.
    pub fn edge(&self, cell_size: f64) -> f64 {
        match self {
            Places::Block(_) => cell_size,
            Places::Tets { mesh, near, .. } => {
                let (volume, count) = near.cells().fold((0.0, 0), |(v, n), cell| (v + mesh.volume(cell), n + 1));
                (volume / f64::from(count.max(1))).cbrt()
            }
        }
    }

    /// Middle of a cell, and the largest distance of a corner from it [m].
    pub fn middle(&self, cell: usize) -> (DVec3, f64) {
        match self {
            Places::Block(mesh) => {
                let size = mesh.cell_size(cell);
                (mesh.rest_position(mesh.cell_nodes(cell)[0]) + 0.5 * size, 0.5 * size.length())
            }
            Places::Tets { mesh, .. } => {
                let corners = mesh.corners(cell);
                let middle = corners.iter().sum::<DVec3>() / 4.0;
                (middle, corners.iter().map(|x| x.distance(middle)).fold(0.0, f64::max))
            }
        }
    }

    /// The part of a cell for which `holds` is true of the rest position, and the middle of that part from the middle of the cell [m].
    pub fn part(&self, cell: usize, holds: impl Fn(DVec3) -> bool) -> (f64, DVec3) {
        let (middle, _) = self.middle(cell);
        let (mut part, mut sum) = (0.0, DVec3::ZERO);
        let mut look = |offset: DVec3, weight: f64| {
            if holds(middle + offset) {
                (part, sum) = (part + weight, sum + offset * weight);
            }
        };
        match self {
            Places::Block(mesh) => {
                let (size, count) = (mesh.cell_size(cell), SAMPLES.pow(3));
                let at = |i: usize| (i as f64 + 0.5) / SAMPLES as f64 - 0.5;
                for n in 0..count {
                    let place = DVec3::new(at(n % SAMPLES), at(n / SAMPLES % SAMPLES), at(n / SAMPLES.pow(2)));
                    look(place * size, 1.0 / count as f64);
                }
            }
            Places::Tets { mesh, samples, .. } => {
                let corners = mesh.corners(cell).map(|x| x - middle);
                for (weights, part) in samples {
                    look(corners.iter().zip(weights).map(|(x, w)| *x * *w).sum(), *part);
                }
            }
        }
        (part, if part > 0.0 { sum / part } else { DVec3::ZERO })
    }

    /// Half of the extent of a cell along the unit vector t [m], of a sphere where that is oblique: sqrt 3 times the deviation of its places.
    pub fn half_along(&self, cell: usize, t: DVec3) -> f64 {
        match self {
            Places::Block(mesh) => {
                let t = t.abs();
                0.5 * mesh.cell_size(cell).dot(t * t)
            }
            Places::Tets { mesh, .. } => {
                let (middle, _) = self.middle(cell);
                let square: f64 = mesh.corners(cell).iter().map(|x| (*x - middle).dot(t).powi(2)).sum();
                (3.0 * square / 20.0).sqrt()
            }
        }
    }
}

impl Mesh {
    /// Four places that give the volume of a cell around an opened path to second order, from its middle [m].
    pub fn volume_places(&self, cell: usize) -> [DVec3; 4] {
        let mut places = [DVec3::ZERO; 4];
        match self {
            Mesh::Block(block) => {
                let width = block.cell_size(cell);
                let corners = (0..8).filter(|corner| is_volume_place(*corner));
                for (place, corner) in places.iter_mut().zip(corners) {
                    *place = DVec3::from(CORNERS[corner]) * (0.5 * VOLUME_PLACE) * width;
                }
            }
            Mesh::Tets(tets) => {
                let middle = self.cell_centre(cell);
                for (place, corner) in places.iter_mut().zip(tets.corners(cell)) {
                    *place = (corner - middle) * TETRAHEDRON_PLACE;
                }
            }
        }
        places
    }
}
