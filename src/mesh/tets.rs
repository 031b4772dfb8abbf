//! An unstructured mesh of four-node tetrahedra.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::BlockMesh;

/// A node lies on a side of the bounding box when it is no farther from it, in parts of the diagonal of the box.
pub const SIDE_TOLERANCE: f64 = 1e-6;

/// Tetrahedra with positive volume, sorted so that neighbours in space are neighbours in memory.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TetMesh {
    /// Rest position X per node [m].
    pub positions: Vec<DVec3>,
    /// Node indices per tetrahedron, right-handed: `(b - a) x (c - a) . (d - a) > 0`.
    pub tets: Vec<[u32; 4]>,
    /// Index into `regions` per tetrahedron.
    pub tags: Vec<u32>,
    /// Names of the regions: physical groups, element sets or `region-<tag>`; never empty.
    pub regions: Vec<String>,
    /// Named node sets (physical groups of surfaces, node sets), ascending node indices.
    pub node_sets: BTreeMap<String, Vec<u32>>,
}

/// Paths along the edges of a hexahedron from its low to its high corner, as axes; each is the edge of one tetrahedron
/// that is right-handed as it stands, or after a swap.
const PATHS: [([usize; 3], bool); 6] = [
    ([0, 1, 2], false),
    ([1, 2, 0], false),
    ([2, 0, 1], false),
    ([0, 2, 1], true),
    ([2, 1, 0], true),
    ([1, 0, 2], true),
];

impl TetMesh {
    /// The block with every hexahedron cut into six tetrahedra around the diagonal from its low to its high corner.
    pub fn from_block(block: &BlockMesh) -> TetMesh {
        let tet = |cell: usize, (path, swapped): ([usize; 3], bool)| {
            let mut corner = block.cell_coordinates(cell);
            let index = |c: [usize; 3]| block.node_index(c[0], c[1], c[2]) as u32;
            let mut tet = [index(corner); 4];
            for (node, axis) in tet[1..].iter_mut().zip(path) {
                corner[axis] += 1;
                *node = index(corner);
            }
            if swapped {
                tet.swap(1, 2);
            }
            tet
        };
        let tets: Vec<[u32; 4]> = (0..block.cell_count()).flat_map(|cell| PATHS.map(|path| tet(cell, path))).collect();
        TetMesh {
            positions: (0..block.node_count()).map(|node| block.rest_position(node)).collect(),
            tags: vec![0; tets.len()],
            tets,
            regions: vec!["tissue".into()],
            node_sets: BTreeMap::new(),
        }
    }

    /// Rest volume of a tetrahedron [m^3].
    pub fn volume(&self, tet: usize) -> f64 {
        let [a, b, c, d] = self.corners(tet);
        (b - a).cross(c - a).dot(d - a) / 6.0
    }

    /// Rest positions of the corners [m].
    pub fn corners(&self, tet: usize) -> [DVec3; 4] {
        self.tets[tet].map(|n| self.positions[n as usize])
    }

    /// Gradients `B_i` of the four shape functions [1/m]: `H = sum_i u_i (x) B_i`.
    pub fn gradients(&self, tet: usize) -> [DVec3; 4] {
        let [a, b, c, d] = self.corners(tet);
        let (x, y, z) = (b - a, c - a, d - a);
        let determinant = x.cross(y).dot(z);
        let [gb, gc, gd] = [y.cross(z) / determinant, z.cross(x) / determinant, x.cross(y) / determinant];
        [-(gb + gc + gd), gb, gc, gd]
    }

    /// Smallest altitude of a tetrahedron [m]: one over the largest gradient.
    pub fn smallest_altitude(&self, tet: usize) -> f64 {
        1.0 / self.gradients(tet).iter().map(|g| g.length()).fold(0.0, f64::max)
    }

    /// Longest edge of a tetrahedron [m].
    pub fn longest_edge(&self, tet: usize) -> f64 {
        let [a, b, c, d] = self.corners(tet);
        [b - a, c - a, d - a, c - b, d - b, d - c].iter().map(|e| e.length()).fold(0.0, f64::max)
    }

    /// Rest volumes of the tissue around the nodes, a quarter of every tetrahedron [m^3].
    pub fn node_volumes(&self) -> Vec<f64> {
        let mut volumes = vec![0.0; self.positions.len()];
        for (tet, nodes) in self.tets.iter().enumerate() {
            let share = 0.25 * self.volume(tet);
            nodes.iter().for_each(|node| volumes[*node as usize] += share);
        }
        volumes
    }

    /// Triangles of the surface, which belong to one tetrahedron only, in the order of the mesh; counter-clockwise seen from outside.
    pub fn surface(&self) -> Vec<[u32; 3]> {
        let faces = |&[a, b, c, d]: &[u32; 4]| [[b, c, d], [a, d, c], [a, b, d], [a, c, b]];
        let key = |mut face: [u32; 3]| {
            face.sort_unstable();
            face
        };
        let mut count: HashMap<[u32; 3], u32> = HashMap::new();
        for face in self.tets.iter().flat_map(faces) {
            *count.entry(key(face)).or_default() += 1;
        }
        self.tets.iter().flat_map(faces).filter(|face| count[&key(*face)] == 1).collect()
    }

    /// Those of its triangles that lie on a side of the bounding box, as far as a millionth of its diagonal tells; `axis` 0..2, at the
    /// larger coordinate or the smaller one.
    pub fn surface_on_side(&self, axis: usize, is_max: bool) -> Vec<[u32; 3]> {
        let (low, high) = self.bounds();
        let (plane, near) = (if is_max { high } else { low }[axis], SIDE_TOLERANCE * (high - low).length());
        let on_side = |face: &[u32; 3]| face.iter().all(|n| (self.positions[*n as usize][axis] - plane).abs() <= near);
        self.surface().into_iter().filter(on_side).collect()
    }

    /// Nodes of the skin, ascending: those of the surface but of its cuts, the sides of the bounding box that are flat. The side on which
    /// `entry` lies is skin too.
    pub fn skin(&self, entry: DVec3) -> Vec<u32> {
        let (low, high) = self.bounds();
        let near = SIDE_TOLERANCE * (high - low).length();
        let cuts: Vec<(usize, f64)> = (0..3)
            .flat_map(|axis| [(axis, low[axis]), (axis, high[axis])])
            .filter(|(axis, plane)| (entry[*axis] - plane).abs() > near)
            .collect();
        let is_cut = |face: &[u32; 3]| {
            cuts.iter().any(|(a, plane)| face.iter().all(|n| (self.positions[*n as usize][*a] - plane).abs() <= near))
        };
        let mut nodes: Vec<u32> = self.surface().into_iter().filter(|face| !is_cut(face)).flatten().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Triangles of the surface with all nodes in the node set of this name, all of them without a name; `None`: there is no such set.
    pub fn surface_of(&self, set: Option<&str>) -> Option<Vec<[u32; 3]>> {
        let Some(name) = set else { return Some(self.surface()) };
        let nodes = self.node_sets.get(name)?;
        let holds = |face: &[u32; 3]| face.iter().all(|node| nodes.binary_search(node).is_ok());
        Some(self.surface().into_iter().filter(holds).collect())
    }

    /// Area of a triangle of nodes [m^2].
    pub fn area(&self, face: [u32; 3]) -> f64 {
        self.area_vector(face).length()
    }

    /// The same along its normal, which is the outward one of a triangle of [`TetMesh::surface`] [m^2].
    pub fn area_vector(&self, face: [u32; 3]) -> DVec3 {
        let [a, b, c] = face.map(|n| self.positions[n as usize]);
        0.5 * (b - a).cross(c - a)
    }

    /// Rest volume of a region [m^3].
    pub fn region_volume(&self, region: usize) -> f64 {
        (0..self.tets.len()).filter(|&t| self.tags[t] as usize == region).map(|t| self.volume(t)).sum()
    }

    /// Lowest and highest corner of the bounding box [m].
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
    }
}

/// Barycentric coordinates of points all over a tetrahedron, and the part of its volume that each stands for: the midpoints of small cubes,
/// `samples` per edge, with `u >= v >= w`, which is one of the six tetrahedra that a cube falls into; points on its faces belong to several of
/// them.
pub fn lattice(samples: usize) -> Vec<([f64; 4], f64)> {
    let mut points = Vec::new();
    for i in 0..samples {
        for j in 0..=i {
            for k in 0..=j {
                let [u, v, w] = [i, j, k].map(|n| (n as f64 + 0.5) / samples as f64);
                let orders = match (i == j, j == k) {
                    (false, false) => 6,
                    (true, true) => 1,
                    _ => 3,
                };
                points.push(([1.0 - u, u - v, v - w, w], f64::from(orders) / samples.pow(3) as f64));
            }
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_fills_a_tetrahedron_evenly() {
        let lattice = lattice(16);
        assert_eq!(lattice.len(), 816);
        assert!((lattice.iter().map(|p| p.1).sum::<f64>() - 1.0).abs() < 1e-12);
        for corner in 0..4 {
            let mean: f64 = lattice.iter().map(|(w, part)| w[corner] * part).sum();
            assert!((mean - 0.25).abs() < 2e-3, "{mean}");
            // Half of the way to the opposite face an eighth of the volume is cut off; points on the cut are half beyond it.
            let beyond = |weight: f64| 0.5 * (f64::from(weight > 0.5 + 1e-9) + f64::from(weight > 0.5 - 1e-9));
            let part: f64 = lattice.iter().map(|(w, part)| beyond(w[corner]) * part).sum();
            assert!((part - 0.125).abs() < 0.02, "{part}");
        }
        assert!(
            lattice.iter().all(|(w, _)| (w.iter().sum::<f64>() - 1.0).abs() < 1e-12 && w.iter().all(|w| *w >= 0.0))
        );
    }
}
