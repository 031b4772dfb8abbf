//! An unstructured mesh of four-node tetrahedra.

use std::collections::BTreeMap;

use glam::DVec3;

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

impl TetMesh {
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

    /// Rest volume of a region [m^3].
    pub fn region_volume(&self, region: usize) -> f64 {
        (0..self.tets.len()).filter(|&t| self.tags[t] as usize == region).map(|t| self.volume(t)).sum()
    }

    /// Lowest and highest corner of the bounding box [m].
    pub fn bounds(&self) -> (DVec3, DVec3) {
        self.positions.iter().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)))
    }
}
