//! Splits a triangle of a cut where one part of the anatomy ends and another begins, finer than cells.
//!
//! The triangle is asked at a lattice of points. Where all give one part it stays whole; else it is quartered until they do, and each small
//! triangle between the points is split at the boundary, which bisection finds along its edges. The pieces fill the triangle exactly, and
//! the boundary is drawn as its line.

use glam::DVec3;

/// A point of a triangle as the weights of its corners.
pub type Place = DVec3;

/// Triangles are drawn so much larger than they are: where corners of one lie on the edge of another, rounding leaves pinholes.
const OVERLAP: f64 = 1.002;

/// The corners of a triangle that is one piece.
const WHOLE: [Place; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// Where a place of a triangle is drawn, a little farther from its middle.
pub fn overlapping(place: Place) -> Place {
    let middle = DVec3::splat(1.0 / 3.0);
    middle + (place - middle) * OVERLAP
}

/// Most steps along an edge: more are finer than pixels of any picture.
const MOST_STEPS: usize = 96;
/// Halvings of an edge between two lattice points.
const HALVINGS: usize = 6;

/// Takes what a triangle is split into.
pub trait Pieces {
    /// A triangle of one part.
    fn piece(&mut self, part: usize, corners: [Place; 3]);
    /// A line between two parts.
    fn boundary(&mut self, parts: [usize; 2], ends: [Place; 2]);
}

/// Splits a triangle; `part_at` tells the part at a place of it, `steps` how many small triangles lie along an edge at least.
pub fn split(steps: usize, part_at: impl Fn(Place) -> usize, pieces: &mut impl Pieces) {
    let n = steps.clamp(1, MOST_STEPS);
    // What is to be quartered needs halves of halves.
    let n = if n > 2 { n.next_multiple_of(4) } else { n };
    // Row by row: j along the third corner, i along the second.
    let mut parts = Vec::with_capacity((n + 1) * (n + 2) / 2);
    for j in 0..=n {
        parts.extend((0..=n - j).map(|i| part_at(Lattice::corner(n, i, j))));
    }
    if parts.iter().all(|part| *part == parts[0]) {
        pieces.piece(parts[0], WHOLE);
        return;
    }
    let lattice = Lattice { n, parts };
    let side = 1 << n.trailing_zeros();
    for j in (0..n).step_by(side) {
        for i in (0..n - j).step_by(side) {
            lattice.quarter([i, j], side, true, &part_at, pieces);
            if i + side < n - j {
                lattice.quarter([i, j], side, false, &part_at, pieces);
            }
        }
    }
}

/// Parts at the points of a triangle, `n` steps along its edges.
struct Lattice {
    n: usize,
    parts: Vec<usize>,
}

impl Lattice {
    fn corner(n: usize, i: usize, j: usize) -> Place {
        let (a, b) = (i as f64 / n as f64, j as f64 / n as f64);
        DVec3::new(1.0 - a - b, a, b)
    }

    fn at(&self, i: usize, j: usize) -> (Place, usize) {
        let row_start = j * (self.n + 1) - j * j.saturating_sub(1) / 2;
        (Self::corner(self.n, i, j), self.parts[row_start + i])
    }

    /// The triangle of `side` steps with its right angle at `[i, j]`, or the other half of that square (not `near`).
    fn quarter(
        &self,
        [i, j]: [usize; 2],
        side: usize,
        near: bool,
        part_at: &impl Fn(Place) -> usize,
        pieces: &mut impl Pieces,
    ) {
        let (right, far, above) = (self.at(i + side, j), (i + side, j + side), self.at(i, j + side));
        let corners = if near { [self.at(i, j), right, above] } else { [right, self.at(far.0, far.1), above] };
        if side == 1 {
            small(corners, part_at, pieces);
            return;
        }
        let first = corners[0].1;
        let within = |a: usize, b: usize| if near { a + b <= side } else { a + b >= side };
        let is_one = (0..=side).all(|b| (0..=side).filter(|a| within(*a, b)).all(|a| self.at(i + a, j + b).1 == first));
        if is_one {
            pieces.piece(first, corners.map(|corner| corner.0));
            return;
        }
        let half = side / 2;
        let (own, middle) = match near {
            true => ([[i, j], [i + half, j], [i, j + half]], [i, j]),
            false => ([[i + half, j], [i, j + half], [i + half, j + half]], [i + half, j + half]),
        };
        for at in own {
            self.quarter(at, half, near, part_at, pieces);
        }
        self.quarter(middle, half, !near, part_at, pieces);
    }
}

/// A small triangle with the parts at its corners.
fn small(corners: [(Place, usize); 3], part_at: &impl Fn(Place) -> usize, pieces: &mut impl Pieces) {
    let [a, b, c] = corners;
    let crossing = |p: (Place, usize), q: (Place, usize)| {
        let (mut low, mut high) = (p.0, q.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if part_at(middle) == p.1 {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    };
    // One corner apart from two of one part, or three parts that meet in the middle.
    let mut one = |apart: (Place, usize), q: (Place, usize), r: (Place, usize)| {
        // From the smaller number: the neighbour finds the same place on the edge that both have.
        let between = |q: (Place, usize)| if apart.1 < q.1 { crossing(apart, q) } else { crossing(q, apart) };
        let (to_q, to_r) = (between(q), between(r));
        pieces.piece(apart.1, [apart.0, to_q, to_r]);
        pieces.piece(q.1, [to_q, q.0, r.0]);
        pieces.piece(q.1, [to_q, r.0, to_r]);
        pieces.boundary([apart.1, q.1], [to_q, to_r]);
    };
    match (a.1 == b.1, b.1 == c.1, c.1 == a.1) {
        (true, true, _) => pieces.piece(a.1, [a.0, b.0, c.0]),
        (true, ..) => one(c, a, b),
        (_, true, _) => one(a, b, c),
        (.., true) => one(b, c, a),
        _ => {
            let middle = (a.0 + b.0 + c.0) / 3.0;
            let between =
                |p: (Place, usize), q: (Place, usize)| if p.1 < q.1 { crossing(p, q) } else { crossing(q, p) };
            let edges = [between(a, b), between(b, c), between(c, a)];
            for (n, corner) in [a, b, c].into_iter().enumerate() {
                let (after, before) = (edges[n], edges[(n + 2) % 3]);
                pieces.piece(corner.1, [corner.0, after, middle]);
                pieces.piece(corner.1, [corner.0, middle, before]);
                let other = [a, b, c][(n + 1) % 3];
                pieces.boundary([corner.1, other.1], [after, middle]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Sums {
        area: [f64; 4],
        length: f64,
        pieces: usize,
    }

    impl Pieces for Sums {
        fn piece(&mut self, part: usize, [a, b, c]: [Place; 3]) {
            let flat = |p: Place| glam::DVec2::new(p.y, p.z);
            self.pieces += 1;
            self.area[part] += 0.5 * (flat(b) - flat(a)).perp_dot(flat(c) - flat(a)).abs();
        }

        fn boundary(&mut self, _: [usize; 2], [a, b]: [Place; 2]) {
            self.length += glam::DVec2::new(a.y - b.y, a.z - b.z).length();
        }
    }

    #[test]
    fn pieces_fill_the_triangle_and_follow_a_circle() {
        // A quarter of a circle around the first corner, with a second one in it.
        let part_at = |p: Place| match glam::DVec2::new(p.y, p.z).length() {
            r if r < 0.3 => 2,
            r if r < 0.5 => 3,
            _ => 1,
        };
        let mut sums = Sums::default();
        split(40, part_at, &mut sums);
        let quarter = 0.25 * std::f64::consts::PI;
        assert!((sums.area.iter().sum::<f64>() - 0.5).abs() < 1e-12, "{:?}", sums.area);
        assert!((sums.area[2] - quarter * 0.09).abs() < 2e-4, "{:?}", sums.area);
        assert!((sums.area[3] - quarter * 0.16).abs() < 4e-4, "{:?}", sums.area);
        assert!((sums.length - 2.0 * quarter * 0.8).abs() < 0.01, "{}", sums.length);
        // Some three per step along the two arcs and what is quartered beside them, not all of the 1600 between the points.
        assert!(sums.pieces < 700, "{} pieces", sums.pieces);
    }

    #[test]
    fn what_is_one_part_stays_whole_and_three_may_meet() {
        let mut sums = Sums::default();
        split(10, |_| 1, &mut sums);
        assert_eq!(sums.pieces, 1);
        assert!((sums.area[1] - 0.5).abs() < 1e-12 && sums.length == 0.0, "{:?}, {}", sums.area, sums.length);
        let mut sums = Sums::default();
        let largest = |p: Place| {
            if p.x >= p.y && p.x >= p.z {
                1
            } else if p.y >= p.z {
                2
            } else {
                3
            }
        };
        split(1, largest, &mut sums);
        for part in 1..4 {
            assert!((sums.area[part] - 0.5 / 3.0).abs() < 0.01, "{:?}", sums.area);
        }
    }
}
