//! A straight line through tetrahedra: which of them holds its point at a coordinate, and where in it that point lies.

use glam::DVec3;

use super::TetMesh;

/// Pieces of a line that are shorter are left away, and gaps between two pieces that are shorter are none [m]: what rounding leaves
/// where a line runs along a face or through a corner.
const ROUNDING: f64 = 1e-8;

/// A stretch of a line in one tetrahedron.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinePiece {
    /// Coordinate along the line at which it begins [m].
    pub start: f64,
    pub cell: u32,
    pub nodes: [u32; 4],
    /// Barycentric coordinates at the beginning, and how they change along the line [1/m].
    pub weights: [f64; 4],
    pub slopes: [f64; 4],
}

/// A stretch of a line that lies in the mesh without a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct TetLine {
    /// One after the other; at least one.
    pub pieces: Vec<LinePiece>,
    /// Coordinate at which the line leaves the mesh [m].
    pub end: f64,
}

impl TetMesh {
    /// Tetrahedra that lie within `reach` [m] of a line, or partly so.
    pub fn near_line(&self, origin: DVec3, direction: DVec3, reach: f64) -> Vec<u32> {
        let is_near = |tet: &u32| {
            let corners = self.corners(*tet as usize);
            let centre = corners.iter().sum::<DVec3>() * 0.25;
            let size = corners.iter().map(|x| x.distance_squared(centre)).fold(0.0, f64::max).sqrt();
            let relative = centre - origin;
            (relative - direction * relative.dot(direction)).length() <= reach + size
        };
        (0..self.tets.len() as u32).filter(is_near).collect()
    }

    /// Barycentric coordinates of a point in a tetrahedron, or beside it.
    pub fn barycentric(&self, tet: usize, x: DVec3) -> [f64; 4] {
        let [_, b, c, d] = self.gradients(tet);
        let relative = x - self.positions[self.tets[tet][0] as usize];
        let [wb, wc, wd] = [b, c, d].map(|gradient| gradient.dot(relative));
        [1.0 - wb - wc - wd, wb, wc, wd]
    }

    /// The tetrahedron that holds a point, and its barycentric coordinates there; `None` for a point that none holds.
    pub fn locate(&self, x: DVec3) -> Option<(usize, [f64; 4])> {
        /// How far beyond a face rounding may carry a point that lies on it, in barycentric coordinates.
        const BESIDE: f64 = 1e-6;
        let least = |weights: &[f64; 4]| weights.iter().fold(f64::INFINITY, |least: f64, w| least.min(*w));
        let found = (0..self.tets.len()).filter_map(|tet| {
            let [a, b, c, d] = self.corners(tet);
            let (low, high) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
            let margin = DVec3::splat(BESIDE * (high - low).max_element());
            let within = x.cmpge(low - margin).all() && x.cmple(high + margin).all();
            let weights = within.then(|| self.barycentric(tet, x))?;
            (least(&weights) >= -BESIDE).then_some((tet, weights))
        });
        found.max_by(|a, b| least(&a.1).total_cmp(&least(&b.1)))
    }

    /// Where the line `origin + s direction` (a unit vector) lies in the mesh: its stretches without a gap, in order. `near`: the
    /// tetrahedra that it may pass.
    pub fn line(&self, near: &[u32], origin: DVec3, direction: DVec3) -> Vec<TetLine> {
        let mut passed: Vec<(f64, f64, LinePiece)> =
            near.iter().filter_map(|tet| self.passage(*tet, origin, direction)).collect();
        passed.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
        let mut lines = Vec::new();
        let mut next = 0;
        while next < passed.len() {
            let mut pieces = Vec::new();
            let mut at = passed[next].0;
            loop {
                // Of those that hold this point the one that the line stays in for longest.
                let mut best: Option<usize> = None;
                let (mut farthest, first) = (at, next);
                for (index, (low, high, _)) in passed.iter().enumerate().skip(first) {
                    if *low > at + ROUNDING {
                        break;
                    }
                    if *high > farthest {
                        (best, farthest) = (Some(index), *high);
                    }
                    next = index + 1;
                }
                let Some(best) = best else { break };
                let (low, _, piece) = passed[best];
                let weights = std::array::from_fn(|i| piece.weights[i] + piece.slopes[i] * (at - low));
                pieces.push(LinePiece { start: at, weights, ..piece });
                at = farthest;
            }
            if !pieces.is_empty() {
                lines.push(TetLine { pieces, end: at });
            }
        }
        lines
    }

    /// The coordinates at which a line enters and leaves a tetrahedron, and the piece between; `None` where it passes beside it.
    fn passage(&self, tet: u32, origin: DVec3, direction: DVec3) -> Option<(f64, f64, LinePiece)> {
        let weights = self.barycentric(tet as usize, origin);
        let slopes = self.gradients(tet as usize).map(|gradient| gradient.dot(direction));
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (w, slope) in weights.into_iter().zip(slopes) {
            if slope > 0.0 {
                low = low.max(-w / slope);
            } else if slope < 0.0 {
                high = high.min(-w / slope);
            } else if w < 0.0 {
                return None;
            }
        }
        let weights = std::array::from_fn(|i| weights[i] + slopes[i] * low);
        let piece = LinePiece { start: low, cell: tet, nodes: self.tets[tet as usize], weights, slopes };
        (high - low > ROUNDING * 1e-2).then_some((low, high, piece))
    }
}

impl TetLine {
    /// Coordinate at which the line enters the mesh [m].
    pub fn start(&self) -> f64 {
        self.pieces[0].start
    }

    /// The piece at a coordinate, before the first and behind the last these.
    pub fn piece(&self, at: f64) -> &LinePiece {
        &self.pieces[self.pieces.partition_point(|piece| piece.start <= at).max(1) - 1]
    }

    /// Nodes around the point at a coordinate [m], their weights, and how these change along the line [1/m]. Beyond an end of the line
    /// the weights are those of the end.
    pub fn weights(&self, at: f64) -> ([u32; 4], [f64; 4], [f64; 4]) {
        let piece = self.piece(at);
        let way = at.clamp(self.start(), self.end) - piece.start;
        (piece.nodes, std::array::from_fn(|i| piece.weights[i] + piece.slopes[i] * way), piece.slopes)
    }

    /// The same line with its coordinate counted from `origin` [m].
    #[must_use]
    pub fn counted_from(mut self, origin: f64) -> Self {
        self.pieces.iter_mut().for_each(|piece| piece.start -= origin);
        self.end -= origin;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::BlockMesh;

    fn grid() -> TetMesh {
        let lines = [4, 3, 5].map(|count| (0..=count).map(|i| i as f64 * 1e-3).collect());
        TetMesh::from_block(&BlockMesh::new(lines))
    }

    /// Lines inside cells, along faces of cells and along their edges are all covered from end to end, and the weights give the point.
    #[test]
    fn a_line_is_covered_from_end_to_end() {
        let mesh = grid();
        let oblique = DVec3::new(0.2, 0.1, -1.0).normalize();
        for (x, direction, length) in [
            (DVec3::new(1.3e-3, 1.7e-3, 6e-3), DVec3::NEG_Z, 5e-3),
            (DVec3::new(1e-3, 1.7e-3, 6e-3), DVec3::NEG_Z, 5e-3),
            (DVec3::new(1e-3, 2e-3, 6e-3), DVec3::NEG_Z, 5e-3),
            (DVec3::new(1.5e-3, 1.5e-3, 6e-3), DVec3::NEG_Z, 5e-3),
            (DVec3::new(1.2e-3, 1.1e-3, 6e-3), oblique, 5e-3 / -oblique.z),
        ] {
            let lines = mesh.line(&mesh.near_line(x, direction, 0.0), x, direction);
            assert_eq!(lines.len(), 1, "{x} {direction}");
            let line = &lines[0];
            assert!((line.end - line.start() - length).abs() < 1e-12, "{} to {}", line.start(), line.end);
            for i in 0..=100 {
                let s = line.start() + length * f64::from(i) / 100.0;
                let (nodes, weights, slopes) = line.weights(s);
                let place: DVec3 = nodes.iter().zip(weights).map(|(n, w)| mesh.positions[*n as usize] * w).sum();
                let rate: DVec3 = nodes.iter().zip(slopes).map(|(n, w)| mesh.positions[*n as usize] * w).sum();
                assert!(place.distance(x + direction * s) < 1e-14, "{s}: {place}");
                assert!(rate.distance(direction) < 1e-12);
                assert!(weights.iter().all(|w| *w > -1e-9));
            }
        }
    }

    #[test]
    fn a_gap_parts_a_line() {
        let mut mesh = grid();
        let centre = |t: &[u32; 4], mesh: &TetMesh| t.iter().map(|n| mesh.positions[*n as usize].z).sum::<f64>() / 4.0;
        let all = mesh.clone();
        mesh.tets.retain(|t| !(2e-3..3e-3).contains(&centre(t, &all)));
        mesh.tags.truncate(mesh.tets.len());
        let x = DVec3::new(1.3e-3, 1.7e-3, 0.0);
        let lines = mesh.line(&mesh.near_line(x, DVec3::Z, 0.0), x, DVec3::Z);
        let ends: Vec<[f64; 2]> = lines.iter().map(|l| [l.start(), l.end]).collect();
        let expected = [[0.0, 2e-3], [3e-3, 5e-3]];
        assert_eq!(ends.len(), 2);
        assert!(ends.iter().flatten().zip(expected.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12), "{ends:?}");
    }

    #[test]
    fn points_are_found_in_their_tetrahedra() {
        let mesh = grid();
        for x in [DVec3::new(1.3e-3, 0.4e-3, 4.9e-3), DVec3::ZERO, DVec3::new(4e-3, 3e-3, 5e-3)] {
            let (tet, weights) = mesh.locate(x).unwrap();
            let place: DVec3 = mesh.corners(tet).iter().zip(weights).map(|(c, w)| *c * w).sum();
            assert!(place.distance(x) < 1e-15);
        }
        assert_eq!(mesh.locate(DVec3::new(4.1e-3, 1e-3, 1e-3)), None);
    }
}
