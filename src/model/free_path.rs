//! What a free path needs instead of a planned one: what the tip may reach, and where it begins.

use glam::DVec3;
use rayon::prelude::*;

use super::{ContactNode, Model, PathSegment, PuncturePlan};
use crate::anatomy::Case;
use crate::effects::puncture::Cutting;
use crate::effects::{TissueMaterial, puncture};
use crate::mesh::BlockMesh;
use crate::mesh::material_place::within_block;
use crate::needle::free_path::{AS_BEFORE, FreeTip, NO_SKIN};
use crate::needle::gap::Profile;
use crate::needle::motion::Placement;
use crate::needle::opening::Growth;
use crate::needle::{NeedleShape, PlannedPath, lateral_axes};

/// Room around the planned motion for the nodes and cells of a free path: tissue moves before the tip comes [m].
const FREE_PATH_ROOM: f64 = 1.0e-3;

/// Box of cells below the skin.
#[derive(Debug, Clone, PartialEq)]
pub struct Skin {
    /// First cell and number of cells along each axis.
    pub low: [usize; 3],
    pub count: [usize; 3],
    /// Heights of the skin over the node columns of the box, rows of x [m]; [`NO_SKIN`] where there is no tissue. Empty: the top face, 0.
    pub heights: Vec<f64>,
}

/// What a free path needs instead of a planned one.
#[derive(Debug, Clone, PartialEq)]
pub struct FreePlan {
    /// Box of the cells that the tip may open.
    pub skin: Skin,
    /// Tip forces of each material of the scene, then of nothing, where cells hold nothing.
    pub cuttings: Vec<Cutting>,
    /// Which of them the tip finds in a cell of the box; [`AS_BEFORE`]: those that it had before.
    pub tissues: Vec<u8>,
}

impl FreePlan {
    pub fn cell_count(&self) -> usize {
        self.skin.count.iter().product()
    }

    /// Grid coordinates of the cell number `index` of the box.
    pub fn cell(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.skin.count;
        let part = [index % nx, index / nx % ny, index / (nx * ny)];
        std::array::from_fn(|a| self.skin.low[a] + part[a])
    }

    /// Number of a cell in the box; `None` outside it.
    pub fn index(&self, cell: [usize; 3]) -> Option<usize> {
        let Skin { low, count, .. } = &self.skin;
        let inside = (0..3).all(|a| (low[a]..low[a] + count[a]).contains(&cell[a]));
        let [i, j, k]: [usize; 3] = std::array::from_fn(|a| cell[a].wrapping_sub(low[a]));
        inside.then(|| (k * count[1] + j) * count[0] + i)
    }
}

impl Skin {
    /// Height of the skin at a rest position [m]: `None` where there is no tissue below.
    pub fn skin_at(&self, mesh: &BlockMesh, x: DVec3) -> Option<f64> {
        if self.heights.is_empty() {
            return Some(0.0);
        }
        let (mut at, mut part) = ([0; 2], [0.0; 2]);
        for a in 0..2 {
            let lines = &mesh.lines[a][self.low[a]..=self.low[a] + self.count[a]];
            if x[a] < lines[0] || x[a] > lines[lines.len() - 1] {
                return None;
            }
            at[a] = lines.partition_point(|l| *l <= x[a]).clamp(1, lines.len() - 1) - 1;
            part[a] = (x[a] - lines[at[a]]) / (lines[at[a] + 1] - lines[at[a]]);
        }
        let [h00, h10, h01, h11] = self.corner_heights(at);
        let (near, far) = (h00 + (h10 - h00) * part[0], h01 + (h11 - h01) * part[0]);
        let height = near + (far - near) * part[1];
        (height > 1e-2 * NO_SKIN).then_some(height)
    }

    /// The rest position itself or the nearest one in the tissue: in the block, and not above the skin.
    pub fn nearest(&self, mesh: &BlockMesh, x: DVec3) -> DVec3 {
        let x = within_block(mesh, x);
        match self.skin_at(mesh, x) {
            Some(skin) if !self.heights.is_empty() => DVec3 { z: x.z.min(skin), ..x },
            _ => x,
        }
    }

    /// Heights at the four corners of a column of cells of the box: x first [m].
    pub fn corner_heights(&self, [i, j]: [usize; 2]) -> [f64; 4] {
        let row = self.count[0] + 1;
        let at = |i: usize, j: usize| self.heights.get(j * row + i).copied().unwrap_or(0.0);
        [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]
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
        let volumes = self.node_volumes();
        // What stands still is not pushed aside, but it carries the tip.
        let stands = |node: usize| self.composition.held.get(node).is_some_and(|held| *held);
        let contact_nodes = (0..mesh.node_count())
            .filter(|&node| near(mesh.rest_position(node), reach))
            .map(|node| {
                let carrier = ContactNode::carrier(node, 0.0, 0.0, volumes[node]);
                ContactNode { pushed: !stands(node), ..carrier }
            })
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
        let mut free = FreePlan {
            skin: self.skin_over(low, count),
            cuttings: cuttings.map(cutting).collect(),
            tissues: Vec::new(),
        };
        let composition = &self.composition;
        let tissue = |cell: usize| match (composition.rigid.get(cell), composition.empty.get(cell)) {
            (Some(true), _) => AS_BEFORE,
            // Held all around by what is rigid, it is no less tissue.
            (_, Some(true)) if composition.fill(cell) == 0.0 && self.scene.case.is_some() => free.cuttings.len() as u8,
            _ => composition.main.get(cell).copied().unwrap_or(0),
        };
        let of_box = (0..free.cell_count()).map(|index| free.cell(index)).map(|[i, j, k]| mesh.cell_index(i, j, k));
        free.tissues = of_box.map(tissue).collect();
        free.cuttings.push(Cutting { puncture_force: 0.0, cutting_force: 0.0 });
        self.contact_nodes = contact_nodes;
        self.puncture = Some(PuncturePlan {
            opening: None,
            contact: None,
            free: Some(free),
            segments: vec![PathSegment {
                start: 0.0,
                cutting: cutting(&self.scene.material),
                transition_length: params.transition_length,
                membrane: false,
                hole: 0.0,
                growth: Growth::default(),
                shear_wave_speed: 0.0,
                moduli: None,
            }],
            exit: f64::INFINITY,
            anchors: Vec::new(),
            lines: Vec::new(),
            cells: Vec::new(),
            contact_stiffness: self.contact_stiffness(params.contact_stiffness_factor),
            ring_stiffness_per_volume: self.ring_stiffness_per_volume(params.contact_stiffness_factor),
            face_damping: 0.0,
            profile: Profile::new(&needle, motion.direction),
            reference: motion.direction,
            params,
            needle,
            path,
        });
        self.weigh_cut_carriers();
    }

    /// The skin over a box of cells of the block: first cell, and number of cells along each axis.
    pub(super) fn skin_over(&self, low: [usize; 3], count: [usize; 3]) -> Skin {
        let heights = match (self.scene.case.as_deref(), self.mesh.as_block()) {
            (Some(case), Some(mesh)) if !self.composition.empty.is_empty() => heights(case, mesh, low, count),
            _ => Vec::new(),
        };
        Skin { low, count, heights }
    }

    /// The skin, where the path is free.
    pub fn skin(&self) -> Option<&Skin> {
        let free = self.puncture.as_ref().and_then(|plan| plan.free.as_ref());
        free.map(|free| &free.skin).or(self.laid.as_ref().map(|laid| &laid.skin))
    }

    /// Height of the skin at a rest position [m], where the path is free: `None` where there is no tissue below.
    pub fn skin_at(&self, x: DVec3) -> Option<f64> {
        self.skin()?.skin_at(self.mesh.as_block()?, x)
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

/// Heights of the skin over the node columns of a box of cells [m].
fn heights(case: &Case, mesh: &BlockMesh, low: [usize; 3], count: [usize; 3]) -> Vec<f64> {
    let [x, y, z] = [0, 1, 2].map(|a| &mesh.lines[a][low[a]..=low[a] + count[a]]);
    let range = z[0]..=z[z.len() - 1];
    let columns: Vec<(f64, f64)> = y.iter().flat_map(|y| x.iter().map(move |x| (*x, *y))).collect();
    columns.into_par_iter().map(|(x, y)| case.skin_over(x, y, range.clone()).unwrap_or(NO_SKIN)).collect()
}

fn distance_to_segment(x: DVec3, a: DVec3, b: DVec3) -> f64 {
    let along = b - a;
    let square = along.length_squared();
    let part = if square > 0.0 { ((x - a).dot(along) / square).clamp(0.0, 1.0) } else { 0.0 };
    x.distance(a + along * part)
}
