//! The line of a path through the material: straight pieces, one after the other.
//!
//! A planned path has one. Where a hand leads the needle, or a motion turns it, the line is laid as the tip comes: along the needle where it
//! meets the skin, and anew ahead of the tip where the needle has turned. What is cut stays as it is.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A straight piece of a path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PathPiece {
    /// Material coordinate Z at which it begins [m]; the first one goes on before the surface.
    pub start: f64,
    /// Where its line has Z = 0, a rest position [m], and its direction (unit vector).
    pub origin: DVec3,
    pub direction: DVec3,
}

/// Pieces of a path, at least one, by ascending `start`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathLine {
    pieces: Vec<PathPiece>,
}

impl PathLine {
    /// A straight line that enters at a rest position [m], along a unit vector.
    pub fn straight(entry: DVec3, direction: DVec3) -> Self {
        PathLine { pieces: vec![PathPiece { start: 0.0, origin: entry, direction }] }
    }

    /// All of them.
    pub fn pieces(&self) -> &[PathPiece] {
        &self.pieces
    }

    /// The piece on which the material coordinate `z` [m] lies.
    pub fn piece(&self, z: f64) -> PathPiece {
        self.pieces[self.pieces.partition_point(|p| p.start <= z).max(1) - 1]
    }

    /// The last piece: what lies ahead of the tip.
    pub fn ahead(&self) -> PathPiece {
        self.pieces[self.pieces.len() - 1]
    }

    /// Rest position at the material coordinate `z` [m].
    pub fn point(&self, z: f64) -> DVec3 {
        let piece = self.piece(z);
        piece.origin + piece.direction * z
    }

    /// Distance of a rest position from the line, and material coordinate of the nearest place on it [m]; before its entry and behind its end
    /// the line goes on.
    pub fn coordinates(&self, x: DVec3) -> (f64, f64) {
        let ends = self.pieces.iter().skip(1).map(|p| p.start).chain([f64::INFINITY]);
        let of_piece = |(i, (piece, end)): (usize, (&PathPiece, f64))| {
            let relative = x - piece.origin;
            let begin = if i == 0 { f64::NEG_INFINITY } else { piece.start };
            let z = relative.dot(piece.direction).clamp(begin, end);
            ((relative - piece.direction * z).length(), z)
        };
        let all = self.pieces.iter().zip(ends).enumerate().map(of_piece);
        all.min_by(|a, b| a.0.total_cmp(&b.0)).expect("a line has a piece")
    }

    /// The line with another direction from the material coordinate `start` [m] on.
    pub fn turned(&self, start: f64, direction: DVec3) -> Self {
        let origin = self.point(start) - direction * start;
        let kept = self.pieces.iter().copied().take_while(|p| p.start < start);
        PathLine { pieces: kept.chain([PathPiece { start, origin, direction }]).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_line_is_continuous_and_knows_its_places() {
        let down = PathLine::straight(DVec3::new(1e-3, 0.0, 0.0), DVec3::NEG_Z);
        let aside = DVec3::new(0.6, 0.0, -0.8);
        let line = down.turned(4e-3, aside).turned(9e-3, DVec3::NEG_Z);
        assert_eq!(line.pieces().len(), 3);
        assert!(line.point(4e-3 + 1e-12).distance(DVec3::new(1e-3, 0.0, -4e-3)) < 1e-11);
        assert!(line.point(9e-3).distance(DVec3::new(4e-3, 0.0, -8e-3)) < 1e-12);
        assert_eq!(line.ahead().direction, DVec3::NEG_Z);
        for z in [-1e-3, 0.0, 2e-3, 5e-3, 8.9e-3, 12e-3] {
            let beside = line.point(z) + DVec3::new(0.0, 0.3e-3, 0.0);
            let (r, s) = line.coordinates(beside);
            assert!((r - 0.3e-3).abs() < 1e-12 && (s - z).abs() < 1e-12, "{z}: {r} {s}");
        }
        // What was ahead is forgotten where the line turns before it.
        assert_eq!(line.turned(3e-3, aside).pieces().len(), 2);
    }
}
