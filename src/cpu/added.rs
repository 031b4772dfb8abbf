//! Forces and stiffness bounds that contact, springs and separation add to those of the cells, at few of the nodes.

use std::ops::Range;

use glam::DVec3;

/// Nodes that are cleared and looked at together.
const BLOCK: usize = 16;

/// What is added at every node in a step. Blocks of nodes remember whether anything was: clearing all of them took an eighth of a step of
/// 20,000 cells, on one thread.
pub(super) struct Added {
    forces: Vec<DVec3>,
    bounds: Vec<f64>,
    touched: Vec<bool>,
}

impl Added {
    /// Nothing, at so many nodes.
    pub fn new(nodes: usize) -> Self {
        Added {
            forces: vec![DVec3::ZERO; nodes],
            bounds: vec![0.0; nodes],
            touched: vec![false; nodes.div_ceil(BLOCK)],
        }
    }

    /// Takes everything away.
    pub fn clear(&mut self) {
        let blocks = self.forces.chunks_mut(BLOCK).zip(self.bounds.chunks_mut(BLOCK)).zip(&mut self.touched);
        for ((forces, bounds), touched) in blocks.filter(|(_, touched)| **touched) {
            forces.fill(DVec3::ZERO);
            bounds.fill(0.0);
            *touched = false;
        }
    }

    /// Adds a force [N] and a stiffness bound [N/m] at a node.
    pub fn add(&mut self, node: usize, force: DVec3, bound: f64) {
        self.touched[node / BLOCK] = true;
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
        self.touched[blocks].contains(&true).then(|| (&self.forces[nodes.clone()], &self.bounds[nodes]))
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
}
