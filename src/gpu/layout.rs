//! Where the forces of the cells on their corners lie in the buffer `corner_force`, for both meshes.

use glam::DVec3;

use crate::engine::elements::cells_of_nodes;
use crate::mesh::tets::TetMesh;
use crate::mesh::{BlockMesh, Mesh};

/// Layout of the mesh at hand.
#[derive(Debug, Clone)]
pub enum Layout {
    Strips(Strips),
    Fours(Fours),
}

impl Layout {
    /// `layers`: cells per strip of a block.
    pub fn new(mesh: &Mesh, layers: u32) -> Self {
        match mesh {
            Mesh::Block(block) => Layout::Strips(Strips::new(block, layers)),
            Mesh::Tets(tets) => Layout::Fours(Fours::new(tets)),
        }
    }

    /// The strips of a block, where the caller knows that it is one.
    pub fn strips(&self) -> &Strips {
        match self {
            Layout::Strips(strips) => strips,
            Layout::Fours(_) => panic!("tetrahedra have no strips"),
        }
    }

    /// The fours of a tetrahedral mesh, where the caller knows that it is one.
    pub fn fours(&self) -> &Fours {
        match self {
            Layout::Fours(fours) => fours,
            Layout::Strips(_) => panic!("a block has no fours"),
        }
    }

    /// Length of `corner_force`.
    pub fn slot_count(&self) -> u64 {
        match self {
            Layout::Strips(strips) => strips.slots(),
            Layout::Fours(fours) => 4 * fours.cells.len() as u64,
        }
    }

    /// f_int of all nodes [N] from the forces on the corners.
    pub fn internal_forces(&self, mesh: &Mesh, slots: &[[f32; 4]]) -> Vec<DVec3> {
        let vector = |f: &[f32; 4]| DVec3::new(f[0].into(), f[1].into(), f[2].into());
        match self {
            Layout::Strips(strips) => {
                let block = mesh.block();
                let mut force = vec![DVec3::ZERO; block.node_count()];
                strips.for_each_slot(block, |node, slot| force[node] -= vector(&slots[slot]));
                force
            }
            Layout::Fours(fours) => fours
                .first
                .windows(2)
                .map(|w| -slots[4 * w[0] as usize..4 * w[1] as usize].iter().map(vector).sum::<DVec3>())
                .collect(),
        }
    }
}

/// Cells per strip of a block of so many cells. Software adapters pay per buffer access: long strips share most planes. Hardware wants some
/// 25,000 threads first (H100: 20 k cells take 17.0 us per step with single cells, 17.5 with two, 21.5 with eight; 500 k cells 91, 77, 63),
/// but no strip is a single cell, which takes a fifth more memory.
pub fn strip_layers(cells: usize, software: bool) -> u32 {
    const THREADS: usize = 25_000;
    if software { 8 } else { (cells / THREADS).clamp(2, 8) as u32 }
}

/// Layout of strips and columns of a block (see shaders/shared/corner_force.wgsl).
#[derive(Debug, Clone)]
pub struct Strips {
    pub layers: u32,
    pub count: u32,
    pub columns: u32,
    pub padded_columns: u32,
    cells_x: u32,
    /// Strips that hold tissue, ascending: strip times the number of columns, and the column; no entries: all.
    busy: Vec<u32>,
}

impl Strips {
    fn new(block: &BlockMesh, layers: u32) -> Self {
        let [x, y, z] = block.cells().map(|c| c as u32);
        let layers = layers.clamp(1, z);
        let count = z.div_ceil(layers);
        let mut busy = Vec::new();
        if !block.empty.is_empty() {
            let holds = |strip: u32, column: u32| {
                let layers = strip * layers..((strip + 1) * layers).min(z);
                layers.into_iter().any(|k| !block.empty[(k * x * y + column) as usize])
            };
            let strips = (0..count).flat_map(|strip| (0..x * y).map(move |column| (strip, column)));
            busy = strips.filter(|(strip, column)| holds(*strip, *column)).map(|(s, c)| s * x * y + c).collect();
        }
        Strips { layers, count, columns: x * y, padded_columns: (x + 2) * (y + 2), cells_x: x, busy }
    }

    /// Strips that hold tissue; no entries: all.
    pub fn busy(&self) -> &[u32] {
        &self.busy
    }

    /// How many strips hold tissue.
    pub fn busy_count(&self) -> u32 {
        if self.busy.is_empty() { self.columns * self.count } else { self.busy.len() as u32 }
    }

    fn is_busy(&self, strip: u32, column: u32) -> bool {
        self.busy.is_empty() || self.busy.binary_search(&(strip * self.columns + column)).is_ok()
    }

    fn slots(&self) -> u64 {
        u64::from(self.count) * u64::from(self.layers + 1) * 4 * u64::from(self.padded_columns)
    }

    /// Slot of corner `corner` of the column (i, j) on the node plane k, in the strip `strip`.
    fn slot(&self, strip: u32, k: u32, corner: u32, i: u32, j: u32) -> u32 {
        let column = (j + 1) * (self.cells_x + 2) + i + 1;
        ((strip * (self.layers + 1) + k - strip * self.layers) * 4 + corner) * self.padded_columns + column
    }

    /// A slot of node (i, j, k) that the element stage writes in every step.
    pub fn owned_slot(&self, [i, j, k]: [usize; 3], cells: [usize; 3]) -> u32 {
        let upper = ((k as u32) / self.layers).min(self.count - 1);
        let lower = if k > 0 { (k as u32 - 1) / self.layers } else { upper };
        let sides = |at: usize, count: usize| (at.saturating_sub(1)..=at.min(count - 1)).rev();
        let [i, j, k] = [i as u32, j as u32, k as u32];
        let places = [upper, lower].into_iter().flat_map(|strip| {
            sides(j as usize, cells[1])
                .flat_map(move |b| sides(i as usize, cells[0]).map(move |a| (strip, a as u32, b as u32)))
        });
        let first = (upper, i.min(cells[0] as u32 - 1), j.min(cells[1] as u32 - 1));
        let busy = |&(strip, a, b): &(u32, u32, u32)| self.is_busy(strip, b * self.cells_x + a);
        let (strip, a, b) = places.into_iter().find(busy).unwrap_or(first);
        self.slot(strip, k, (i - a) + 2 * (j - b), a, b)
    }

    /// A slot of node (i, j, k) for a pair across the given axis. Stages that work on pairs of different axes at one node
    /// find different slots: the other column along x for axis y, along y for axis z.
    pub fn pair_slot(&self, [i, j, k]: [usize; 3], cells: [usize; 3], axis: usize) -> u32 {
        let strip = ((k as u32) / self.layers).min(self.count - 1);
        let inside = |at: usize, count: usize| at > 0 && at < count;
        let right = u32::from(i == cells[0] || (axis == 1 && inside(i, cells[0])));
        let back = u32::from(j == cells[1] || (axis == 2 && inside(j, cells[1])));
        self.slot(strip, k as u32, right + 2 * back, i as u32 - right, j as u32 - back)
    }

    /// Calls `visit` with node and slot of every corner of every column.
    fn for_each_slot(&self, block: &BlockMesh, mut visit: impl FnMut(usize, usize)) {
        let [nx, ny, nz] = block.cells();
        for strip in 0..self.count {
            let first = strip * self.layers;
            for k in first..=(first + self.layers).min(nz as u32) {
                for (j, i, corner) in (0..ny).flat_map(|j| (0..nx).flat_map(move |i| (0..4).map(move |c| (j, i, c)))) {
                    let node = block.node_index(i + (corner & 1) as usize, j + (corner >> 1) as usize, k as usize);
                    visit(node, self.slot(strip, k, corner, i as u32, j as u32) as usize);
                }
            }
        }
    }
}

/// Layout of a tetrahedral mesh: the corners of one node lie side by side, filled up to fours.
#[derive(Debug, Clone)]
pub struct Fours {
    /// First four of every node, and the end of the last.
    pub first: Vec<u32>,
    /// Cells around the nodes, four at a time; the last four of a node are filled up with the number of cells.
    pub cells: Vec<[u32; 4]>,
    /// Slots of the corners of every tetrahedron.
    pub slots: Vec<[u32; 4]>,
}

impl Fours {
    fn new(mesh: &TetMesh) -> Self {
        let (offsets, around) = cells_of_nodes(mesh);
        let mut first = vec![0];
        let mut cells = Vec::new();
        let mut slots = vec![[0; 4]; mesh.tets.len()];
        for (node, range) in offsets.windows(2).enumerate() {
            for four in around[range[0]..range[1]].chunks(4) {
                let mut filled = [mesh.tets.len() as u32; 4];
                filled[..four.len()].copy_from_slice(four);
                for (place, cell) in (4 * cells.len() as u32..).zip(four) {
                    let tet = &mesh.tets[*cell as usize];
                    for (slot, _) in slots[*cell as usize].iter_mut().zip(tet).filter(|(_, n)| **n as usize == node) {
                        *slot = place;
                    }
                }
                cells.push(filled);
            }
            first.push(cells.len() as u32);
        }
        Fours { first, cells, slots }
    }
}
