//! What a free path needs instead of a planned one: what the tip may reach, and where it begins.

use glam::DVec3;

use super::{ContactNode, Model, PathSegment, PuncturePlan};
use crate::effects::puncture::Cutting;
use crate::effects::{TissueMaterial, puncture};
use crate::needle::free_path::FreeTip;
use crate::needle::gap::Profile;
use crate::needle::motion::Placement;
use crate::needle::{NeedleShape, PlannedPath, lateral_axes};

/// Room around the planned motion for the nodes and cells of a free path: tissue moves before the tip comes [m].
const FREE_PATH_ROOM: f64 = 1.0e-3;

/// What a free path needs instead of a planned one.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePlan {
    /// Box of the cells that the tip may open: first cell and number of cells along each axis.
    pub low: [usize; 3],
    pub count: [usize; 3],
    /// Tip forces of each material.
    pub cuttings: Vec<Cutting>,
}

impl FreePlan {
    pub fn cell_count(&self) -> usize {
        self.count.iter().product()
    }

    /// Grid coordinates of the cell number `index` of the box.
    pub fn cell(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.count;
        let part = [index % nx, index / nx % ny, index / (nx * ny)];
        std::array::from_fn(|a| self.low[a] + part[a])
    }

    /// Number of a cell in the box; `None` outside it.
    pub fn index(&self, cell: [usize; 3]) -> Option<usize> {
        let inside = (0..3).all(|a| (self.low[a]..self.low[a] + self.count[a]).contains(&cell[a]));
        let [i, j, k]: [usize; 3] = std::array::from_fn(|a| cell[a].wrapping_sub(self.low[a]));
        inside.then(|| (k * self.count[1] + j) * self.count[0] + i)
    }
}

impl Model {
    /// Nodes and cells that the needle can reach on a free path, generously; all of them where a hand leads it.
    pub(super) fn plan_free_path(&mut self, params: puncture::Params, needle: NeedleShape) {
        let Some(mesh) = self.mesh.as_block() else { return };
        let motion = &self.scene.motion;
        // The needle's axis inside the block, again and again along the motion.
        let inside = |p: Placement| {
            let surface = p.tip - p.direction * p.depth;
            (surface, if p.depth > 0.0 { p.tip } else { surface })
        };
        let axes: Vec<(DVec3, DVec3)> =
            motion.samples(0.25e-3).into_iter().filter(|p| p.depth > -FREE_PATH_ROOM).map(inside).collect();
        let near =
            |x: DVec3, reach: f64| params.anywhere || axes.iter().any(|(a, b)| distance_to_segment(x, *a, *b) < reach);
        let h = self.scene.tissue.cell_size;
        let reach = params.ring_radius.max(needle.radius + 1.5 * h) + FREE_PATH_ROOM;
        self.contact_nodes = (0..mesh.node_count())
            .filter(|&node| near(mesh.rest_position(node), reach))
            .map(|node| ContactNode { pushed: true, ..ContactNode::carrier(node, 0.0, 0.0, mesh.node_volume(node)) })
            .collect();
        let opened = (0..mesh.cell_count()).filter(|&cell| {
            let size = mesh.cell_size(cell);
            let centre = mesh.rest_position(mesh.cell_nodes(cell)[0]) + 0.5 * size;
            near(centre, params.softened_radius + FREE_PATH_ROOM + 0.5 * size.length())
        });
        let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
        for cell in opened {
            let at = mesh.cell_coordinates(cell);
            for a in 0..3 {
                low[a] = low[a].min(at[a]);
                high[a] = high[a].max(at[a] + 1);
            }
        }
        let count = std::array::from_fn(|a| high[a].saturating_sub(low[a]));
        let own = Cutting { puncture_force: params.puncture_force, cutting_force: params.cutting_force };
        let cutting = |m: &TissueMaterial| {
            let cutting = m.cutting.unwrap_or(own);
            // How thick a layer is along the path is not known.
            m.membrane_energy.map_or(cutting, |energy| cutting.of_membrane(energy, params.transition_length))
        };
        let cuttings = std::iter::once(&self.scene.material).chain(self.scene.regions.iter().map(|r| &r.material));
        let path = PlannedPath::into_block(motion.entry, motion.direction);
        self.puncture = Some(PuncturePlan {
            opening: None,
            contact: None,
            free: Some(FreePlan { low, count, cuttings: cuttings.map(cutting).collect() }),
            segments: vec![PathSegment {
                start: 0.0,
                cutting: cutting(&self.scene.material),
                transition_length: params.transition_length,
                membrane: false,
                hole: 0.0,
            }],
            exit: f64::INFINITY,
            anchors: Vec::new(),
            lines: Vec::new(),
            cells: Vec::new(),
            contact_stiffness: self.contact_stiffness(params.contact_stiffness_factor),
            ring_stiffness_per_volume: self.ring_stiffness_per_volume(params.contact_stiffness_factor),
            face_damping: 0.0,
            profile: Profile::new(&needle, motion.direction),
            params,
            needle,
            path,
        });
    }

    /// The tip before the run, where the path is free.
    pub fn free_tip(&self) -> FreeTip {
        let motion = &self.scene.motion;
        match self.puncture.as_ref().filter(|p| p.free.is_some()) {
            Some(_) => FreeTip {
                place: motion.entry,
                along: motion.direction,
                across: lateral_axes(motion.direction).0,
                ..FreeTip::default()
            },
            None => FreeTip::default(),
        }
    }
}

fn distance_to_segment(x: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let square = along.length_squared();
    let part = if square > 0.0 { ((x - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    x.distance(a + along * part)
}
