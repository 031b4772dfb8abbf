//! Forces and stiffness bounds that contact, springs and separation add to those of the cells, at few of the nodes.

use std::ops::Range;

use glam::DVec3;

/// Nodes that are cleared and looked at together.
const BLOCK: usize = 8;

/// What is added at every node in a step. Blocks of nodes remember whether anything was: clearing all of them took an eighth of a step of
/// 20,000 cells, on one thread.
pub(super) struct Added {
    forces: Vec<DVec3>,
    bounds: Vec<f64>,
    touched: Vec<bool>,
    /// Those that were.
    list: Vec<u32>,
    /// Bounds that are there in every step [N/m], and the blocks that have any.
    constant: Vec<f64>,
    has_constant: Vec<bool>,
}

impl Added {
    /// Nothing, at so many nodes.
    pub fn new(nodes: usize) -> Self {
        Added {
            forces: vec![DVec3::ZERO; nodes],
            bounds: vec![0.0; nodes],
            touched: vec![false; nodes.div_ceil(BLOCK)],
            list: Vec::new(),
            constant: Vec::new(),
            has_constant: vec![false; nodes.div_ceil(BLOCK)],
        }
    }

    /// With bounds [N/m] that are there in every step, beside those of before.
    pub fn with_constant(mut self, bounds: impl Iterator<Item = (usize, f64)>) -> Self {
        for (node, bound) in bounds {
            self.constant.resize(self.bounds.len(), 0.0);
            self.constant[node] += bound;
            self.bounds[node] += bound;
            self.has_constant[node / BLOCK] = true;
        }
        self
    }

    /// Takes everything away.
    pub fn clear(&mut self) {
        for number in self.list.drain(..).map(|number| number as usize) {
            let nodes = number * BLOCK..((number + 1) * BLOCK).min(self.bounds.len());
            self.forces[nodes.clone()].fill(DVec3::ZERO);
            match self.has_constant[number] {
                true => self.bounds[nodes.clone()].copy_from_slice(&self.constant[nodes]),
                false => self.bounds[nodes].fill(0.0),
            }
            self.touched[number] = false;
        }
    }

    /// Adds a force [N] and a stiffness bound [N/m] at a node.
    pub fn add(&mut self, node: usize, force: DVec3, bound: f64) {
        let block = node / BLOCK;
        if !self.touched[block] {
            self.touched[block] = true;
            self.list.push(block as u32);
        }
        self.forces[node] += force;
        self.bounds[node] += bound;
    }

    /// Force [N] and bound [N/m] at a node.
    pub fn at(&self, node: usize) -> (DVec3, f64) {
        (self.forces[node], self.bounds[node])
    }

    /// Forces and bounds at some nodes; `None` where nothing was added at any of them.
    pub fn within(&self, nodes: Range<usize>) -> Option<(&[DVec3], &[f64])> {
        let blocks = nodes.start / BLOCK..nodes.end.div_ceil(BLOCK);
        let is_any = self.touched[blocks.clone()].contains(&true) || self.has_constant[blocks].contains(&true);
        is_any.then(|| (&self.forces[nodes.clone()], &self.bounds[nodes]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_added_is_found_until_it_is_cleared() {
        let mut added = Added::new(200);
        assert!(added.within(0..200).is_none());
        added.add(130, DVec3::X, 2.0);
        added.add(130, DVec3::Y, 3.0);
        assert_eq!(added.at(130), (DVec3::new(1.0, 1.0, 0.0), 5.0));
        assert!(added.within(0..128).is_none());
        let (forces, bounds) = added.within(100..140).unwrap();
        assert_eq!((forces[30].x, bounds[30], bounds[29]), (1.0, 5.0, 0.0));
        added.clear();
        assert!(added.within(0..200).is_none());
        assert_eq!(added.at(130), (DVec3::ZERO, 0.0));
    }

    #[test]
    fn a_constant_bound_is_there_in_every_step() {
        let mut added = Added::new(70).with_constant([(65, 4.0), (65, 1.0), (3, 2.0)].into_iter());
        for _ in 0..2 {
            assert_eq!((added.at(65).1, added.at(3).1, added.at(64).1), (5.0, 2.0, 0.0));
            assert!(added.within(16..64).is_none());
            assert_eq!(added.within(64..70).unwrap().1, [0.0, 5.0, 0.0, 0.0, 0.0, 0.0]);
            added.add(65, DVec3::X, 1.0);
            added.add(20, DVec3::X, 1.0);
            assert_eq!((added.at(65).1, added.at(20).1), (6.0, 1.0));
            added.clear();
        }
    }
}
