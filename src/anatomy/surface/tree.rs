//! A tree of boxes over triangles.

use std::ops::Range;

use glam::DVec3;

use super::TriangleSurface;

/// Most triangles of a leaf.
const LEAF: usize = 8;

/// Triangles in a box, and how the box is split.
#[derive(Debug, Clone)]
pub(super) struct Branch {
    pub low: DVec3,
    pub high: DVec3,
    /// Place in [`Tree::order`].
    pub triangles: Range<u32>,
    /// The second half; the first one follows its branch. 0: a leaf.
    pub second: u32,
}

/// Boxes, each before the two that it holds.
#[derive(Debug, Clone, Default)]
pub(super) struct Tree {
    pub branches: Vec<Branch>,
    /// Triangles, those of a branch beside each other.
    pub order: Vec<u32>,
}

impl Tree {
    /// Halves the triangles along the longest side of their middles again and again.
    pub fn new(surface: &TriangleSurface) -> Tree {
        let count = surface.triangles.len();
        let middles: Vec<DVec3> = (0..count).map(|t| surface.corners(t).iter().sum::<DVec3>() / 3.0).collect();
        let mut tree = Tree { branches: Vec::new(), order: (0..count as u32).collect() };
        // Range of `order`, and the branch whose second half it is.
        let mut open = vec![(0..count, None)];
        while let Some((range, above)) = open.pop() {
            let own = tree.branches.len() as u32;
            if let Some(above) = above {
                tree.branches[above as usize].second = own;
            }
            let triangles = &mut tree.order[range.clone()];
            let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
            let mut inner = bounds;
            for t in triangles.iter() {
                for x in surface.corners(*t as usize) {
                    bounds = [bounds[0].min(x), bounds[1].max(x)];
                }
                let middle = middles[*t as usize];
                inner = [inner[0].min(middle), inner[1].max(middle)];
            }
            let all = range.start as u32..range.end as u32;
            tree.branches.push(Branch { low: bounds[0], high: bounds[1], triangles: all, second: 0 });
            if range.len() > LEAF {
                let axis = (inner[1] - inner[0]).max_position();
                let half = range.len() / 2;
                triangles.select_nth_unstable_by(half, |a, b| {
                    middles[*a as usize][axis].total_cmp(&middles[*b as usize][axis]).then(a.cmp(b))
                });
                open.push((range.start + half..range.end, Some(own)));
                open.push((range.start..range.start + half, None));
            }
        }
        tree
    }
}
