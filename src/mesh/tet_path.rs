//! The planned straight path of a needle through tetrahedra: where it enters, how the surface lies there, which tetrahedra the lines
//! beside its axis pass.

use glam::DVec3;

use super::{TetLine, TetMesh};
use crate::needle::PlannedPath;

/// How far from the plane of the surface at the entry point a line beside the axis may enter [m].
pub const SKIN_REACH: f64 = 3.0e-3;

/// A planned path in a mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct TetPath {
    pub path: PlannedPath,
    /// The axis, its coordinate counted from the surface.
    pub axis: TetLine,
    /// Lines beside the axis, each counted from where it enters the surface itself.
    pub lines: Vec<TetLine>,
    /// Where they do so: its coordinate along the axis, from the entry point [m].
    pub offsets: Vec<f64>,
}

/// Why there is no path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoPath {
    /// The line of the axis meets no tissue.
    Missed,
    /// A line beside the axis, as far from it as the needle is thick, meets no tissue near the entry point.
    AtTheRim,
}

impl TetPath {
    /// The path along the line through `near` (a point on or near the surface) in the unit direction `direction`; `beside`: vectors
    /// across it from the axis to lines beside it [m], as many on every side.
    ///
    /// # Errors
    /// Where there is no tissue on the line, or not all around it.
    pub fn new(mesh: &TetMesh, near: DVec3, direction: DVec3, beside: &[DVec3]) -> Result<TetPath, NoPath> {
        let reach = beside.iter().map(|b| b.length()).fold(0.0, f64::max);
        let tets = mesh.near_line(near, direction, reach * (1.0 + 1e-9));
        let entered = |line: &TetLine, at: f64| (line.start() - at).abs();
        let nearest = |x: DVec3, at: f64| {
            let lines = mesh.line(&tets, x, direction).into_iter();
            lines.min_by(|a, b| entered(a, at).total_cmp(&entered(b, at)))
        };
        let axis = nearest(near, 0.0).ok_or(NoPath::Missed)?;
        let start = axis.start();
        let entry = near + direction * start;
        let mut lines = Vec::with_capacity(beside.len());
        for offset in beside {
            lines.push(nearest(entry + *offset, 0.0).ok_or(NoPath::AtTheRim)?);
        }
        let offsets: Vec<f64> = lines.iter().map(TetLine::start).collect();
        if offsets.iter().any(|offset| offset.abs() > SKIN_REACH) {
            return Err(NoPath::AtTheRim);
        }
        let path = PlannedPath { entry, direction, normal: normal(direction, beside, &offsets) };
        let lines = lines.into_iter().zip(&offsets).map(|(line, offset)| line.counted_from(*offset)).collect();
        Ok(TetPath { path, axis: axis.counted_from(start), lines, offsets })
    }

    /// Coordinate at which the first of axis and lines leaves the tissue [m].
    pub fn end(&self) -> f64 {
        self.lines.iter().map(|line| line.end).fold(self.axis.end, f64::min)
    }
}

/// Normal of the plane `s = g.x` that fits the places where the lines enter, out of the tissue: a surface of facets has no other at a
/// point. With the offsets x_k of lines as many on every side, `g = 2 sum x_k s_k / sum |x_k|^2`.
fn normal(direction: DVec3, beside: &[DVec3], entered: &[f64]) -> DVec3 {
    let squares: f64 = beside.iter().map(|b| b.length_squared()).sum();
    let mean = entered.iter().sum::<f64>() / entered.len().max(1) as f64;
    let sum: DVec3 = beside.iter().zip(entered).map(|(b, s)| *b * (s - mean)).sum();
    if squares > 0.0 { sum * (2.0 / squares) - direction } else { -direction }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::BlockMesh;
    use crate::needle::ring_around;

    fn grid() -> TetMesh {
        let lines = [8, 8, 5].map(|count| (0..=count).map(|i| i as f64 * 1e-3).collect());
        TetMesh::from_block(&BlockMesh::new(lines))
    }

    /// On a flat surface the coordinates are those of the block, also at oblique entry.
    #[test]
    fn coordinates_are_those_of_the_block() {
        let mesh = grid();
        let direction = DVec3::new(0.4, 0.2, -1.0).normalize();
        let beside: Vec<DVec3> = ring_around(direction, 12, 0.8e-3, 0.0).collect();
        let entry = DVec3::new(3.1e-3, 3.3e-3, 5e-3);
        let path = TetPath::new(&mesh, entry - direction * 2e-3, direction, &beside).unwrap();
        assert!(path.path.entry.distance(entry) < 1e-14);
        let (_, s0) = path.path.material_coordinates(DVec3::new(4e-3, 2e-3, 2e-3));
        assert!((s0 - 3e-3 / -direction.z).abs() < 1e-13, "{s0}");
        for (line, (offset, b)) in path.lines.iter().zip(path.offsets.iter().zip(&beside)) {
            assert!((offset - b.z / -direction.z).abs() < 1e-13 && line.start().abs() < 1e-15);
        }
        assert!((path.end() - 5e-3 / -direction.z).abs() < 1e-12);
    }

    #[test]
    fn a_line_beside_the_mesh_is_none() {
        let mesh = grid();
        let beside: Vec<DVec3> = ring_around(DVec3::NEG_Z, 12, 0.8e-3, 0.0).collect();
        let at = |x: f64| TetPath::new(&mesh, DVec3::new(x, 4e-3, 5e-3), DVec3::NEG_Z, &beside).map(drop);
        assert_eq!((at(4e-3), at(0.5e-3), at(-1e-3)), (Ok(()), Err(NoPath::AtTheRim), Err(NoPath::Missed)));
    }
}
