//! Where in a picture there is room for a number in each area of one part.

use std::collections::VecDeque;

use glam::DVec2;

use super::super::anatomy::NOTHING;
use super::{Layout, Rectangle};

/// Edge of the squares that the plot is divided into, in a picture of the width of the design [px].
const SQUARE: f64 = 3.0;

/// What lies in each square of the plot.
pub(super) struct Areas {
    plot: Rectangle,
    square: f64,
    columns: usize,
    rows: usize,
    parts: Vec<u16>,
    /// What the tool hides has room for nothing.
    covered: Vec<bool>,
}

impl Areas {
    pub(super) fn new(layout: &Layout) -> Self {
        let (plot, square) = (layout.plot, SQUARE * layout.unit);
        let count = |length: f64| (length / square).ceil().max(1.0) as usize;
        let (columns, rows) = (count(plot.right - plot.left), count(plot.bottom - plot.top));
        let parts = vec![NOTHING as u16; columns * rows];
        Areas { plot, square, columns, rows, covered: vec![false; parts.len()], parts }
    }

    fn middle(&self, at: usize) -> DVec2 {
        let (column, row) = (at % self.columns, at / self.columns);
        DVec2::new(self.plot.left, self.plot.top) + self.square * DVec2::new(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// A triangle of a part [px].
    pub(super) fn fill(&mut self, part: usize, corners: [DVec2; 3]) {
        let origin = DVec2::new(self.plot.left, self.plot.top);
        let [a, b, c] = corners.map(|p| (p - origin) / self.square - 0.5);
        let whole = (b - a).perp_dot(c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let range = |low: f64, high: f64, count: usize| {
            let last = high.floor().min(count as f64 - 1.0);
            (low.ceil().max(0.0) as usize)..(last + 1.0).max(0.0) as usize
        };
        for row in range(low.y, high.y, self.rows) {
            for column in range(low.x, high.x, self.columns) {
                let p = DVec2::new(column as f64, row as f64);
                let sides = [(b - a).perp_dot(p - a), (c - b).perp_dot(p - b), (a - c).perp_dot(p - c)];
                if sides.iter().all(|side| side * whole >= 0.0) {
                    self.parts[row * self.columns + column] = part as u16;
                }
            }
        }
    }

    /// Takes out what is hidden; `is_covered` is asked at points of the picture [px].
    pub(super) fn cover(&mut self, is_covered: impl Fn(DVec2) -> bool) {
        for at in 0..self.parts.len() {
            self.covered[at] = is_covered(self.middle(at));
        }
    }

    /// Whether a part is seen anywhere.
    pub(super) fn holds(&self, part: usize) -> bool {
        self.parts.iter().zip(&self.covered).any(|(p, covered)| usize::from(*p) == part && !covered)
    }

    /// For every area of a part the place with the most room, and how far it is from there to what is not of it [px].
    pub(super) fn middles(&self, part: usize) -> Vec<(DVec2, f64)> {
        let room = self.room(part);
        let mut known = vec![false; room.len()];
        let mut found = Vec::new();
        for start in 0..room.len() {
            if known[start] || room[start] == 0 {
                continue;
            }
            let (mut area, mut next) = (Vec::new(), vec![start]);
            known[start] = true;
            while let Some(at) = next.pop() {
                area.push(at);
                for beside in self.beside(at) {
                    if room[beside] > 0 && !known[beside] {
                        known[beside] = true;
                        next.push(beside);
                    }
                }
            }
            let most = area.iter().map(|at| room[*at]).max().unwrap_or(0);
            let centre = area.iter().map(|at| self.middle(*at)).sum::<DVec2>() / area.len() as f64;
            // A band has as much room all along: its number stands in the middle.
            let good = area.iter().filter(|at| 10 * room[**at] >= 9 * most).map(|at| self.middle(*at));
            let best = good.min_by(|a, b| a.distance(centre).total_cmp(&b.distance(centre)));
            found.extend(best.map(|at| (at, (f64::from(most) - 0.5) * self.square)));
        }
        found
    }

    /// Squares to the next one that is not of the part; 0: is not of it.
    fn room(&self, part: usize) -> Vec<u32> {
        let is_of = |at: usize| usize::from(self.parts[at]) == part && !self.covered[at];
        let begin = |at: usize| match (is_of(at), self.beside(at).count()) {
            (false, _) => 0,
            (true, 4) => u32::MAX,
            // The plot ends beside it.
            (true, _) => 1,
        };
        let mut room: Vec<u32> = (0..self.parts.len()).map(begin).collect();
        let mut next: VecDeque<usize> = (0..room.len()).filter(|at| room[*at] < u32::MAX).collect();
        while let Some(at) = next.pop_front() {
            for beside in self.beside(at) {
                if room[beside] > room[at] + 1 {
                    room[beside] = room[at] + 1;
                    next.push_back(beside);
                }
            }
        }
        room
    }

    fn beside(&self, at: usize) -> impl Iterator<Item = usize> + use<> {
        let (column, row) = (at % self.columns, at / self.columns);
        let left = (column > 0).then(|| at - 1);
        let right = (column + 1 < self.columns).then_some(at + 1);
        let above = (row > 0).then(|| at - self.columns);
        let below = (row + 1 < self.rows).then_some(at + self.columns);
        [left, right, above, below].into_iter().flatten()
    }
}
