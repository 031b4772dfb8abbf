//! The tissue of a scene as a body that a tip is in or not: the block, or a patient below the skin.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::kinematic::{Block, Body};
use crate::anatomy::Case;
use crate::mesh::Tissue;
use crate::scene::Scene;

/// Distance of the places at which the height of the skin is known [m].
const STEP: f64 = 0.5e-3;
/// Step of the way out along a needle [m].
const WAY_STEP: f64 = 0.25e-3;
/// A needle that is not out after this never is [m].
const LONGEST_WAY: f64 = 0.4;

/// The tissue of a scene.
#[derive(Debug, Clone)]
pub enum SceneBody {
    /// Its top face is the surface.
    Block(Block),
    /// Its skin is the surface; what lies below another side counts as tissue.
    Patient(Arc<Skin>),
}

impl SceneBody {
    /// Of a scene.
    pub fn of(scene: &Scene) -> SceneBody {
        match &scene.case {
            Some(case) => SceneBody::Patient(Arc::new(Skin::of(case, &scene.tissue))),
            None => SceneBody::Block(Block::of(&scene.tissue)),
        }
    }
}

impl Body for SceneBody {
    fn depth(&self, x: DVec3) -> f64 {
        match self {
            SceneBody::Block(block) => block.depth(x),
            SceneBody::Patient(skin) => skin.depth(x),
        }
    }

    fn way_out(&self, from: DVec3, direction: DVec3) -> f64 {
        match self {
            SceneBody::Block(block) => block.way_out(from, direction),
            SceneBody::Patient(skin) => skin.way_out(from, direction),
        }
    }
}

/// The skin of a patient over the block of a scene: heights on a lattice.
#[derive(Debug, Clone)]
pub struct Skin {
    low: [f64; 2],
    counts: [usize; 2],
    /// Rows of x; NaN where there is no tissue [m].
    heights: Vec<f64>,
}

impl Skin {
    fn of(case: &Case, tissue: &Tissue) -> Skin {
        let half = [0.5 * tissue.size.x, 0.5 * tissue.size.y];
        let counts = half.map(|half| (2.0 * half / STEP).ceil() as usize + 1);
        let range = -tissue.size.z..=tissue.top;
        let low = half.map(|half| -half);
        let height = |n: usize| {
            let at = [n % counts[0], n / counts[0]];
            let [x, y] = [0, 1].map(|a| (low[a] + at[a] as f64 * STEP).min(half[a]));
            case.skin_over(x, y, range.clone()).unwrap_or(f64::NAN)
        };
        let heights = (0..counts[0] * counts[1]).into_par_iter().map(height).collect();
        Skin { low, counts, heights }
    }

    /// Height of the skin over a point, and how fast it rises along both axes; `None` beside the tissue.
    fn at(&self, x: DVec3) -> Option<(f64, [f64; 2])> {
        let (mut cell, mut part) = ([0; 2], [0.0; 2]);
        for a in 0..2 {
            let at = (x[a] - self.low[a]) / STEP;
            if !(0.0..=(self.counts[a] - 1) as f64).contains(&at) {
                return None;
            }
            cell[a] = (at as usize).min(self.counts[a] - 2);
            part[a] = at - cell[a] as f64;
        }
        let h = |i: usize, j: usize| self.heights[(cell[1] + j) * self.counts[0] + cell[0] + i];
        let [near, far] = [0, 1].map(|j| h(0, j) + (h(1, j) - h(0, j)) * part[0]);
        let along_x = (h(1, 0) - h(0, 0)) * (1.0 - part[1]) + (h(1, 1) - h(0, 1)) * part[1];
        let height = near + (far - near) * part[1];
        height.is_finite().then_some((height, [along_x / STEP, (far - near) / STEP]))
    }

    fn depth(&self, x: DVec3) -> f64 {
        match self.at(x) {
            // The distance from the plane that the skin is nearby.
            Some((height, [a, b])) => (height - x.z) / (1.0 + a * a + b * b).sqrt(),
            None => -STEP,
        }
    }

    fn way_out(&self, from: DVec3, direction: DVec3) -> f64 {
        let is_out = |way: f64| self.depth(from + direction * way) <= 0.0;
        let steps = (LONGEST_WAY / WAY_STEP) as usize;
        let Some(first) = (0..=steps).map(|n| n as f64 * WAY_STEP).find(|way| is_out(*way)) else { return LONGEST_WAY };
        let (mut inside, mut outside) = ((first - WAY_STEP).max(0.0), first);
        for _ in 0..20 {
            let middle = 0.5 * (inside + outside);
            if is_out(middle) {
                outside = middle;
            } else {
                inside = middle;
            }
        }
        outside
    }
}
