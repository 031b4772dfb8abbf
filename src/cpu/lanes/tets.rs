//! Tetrahedra in lanes: F and J of every cell, averaged pressure of every node, forces of every cell, sums at the nodes. Equations:
//! `engine/elements.rs`.
//!
//! Nodes keep their displacement as a multiple of 2^-44 m in f64, so that differences along the edges of a cell are exact and, as in the
//! block, none is so small that its square is denormal in f32. Cells are sorted by material, in the order of the mesh within each: a vector
//! holds cells of one material, and the last group of each is filled up with cells that have no volume. Every node adds up what the cells
//! around it hold, in the order of the mesh.

use glam::DVec3;
use pulp::Arch;

use super::corners::GRADIENT;
use super::nodes::{Moved, NodeLines};
use super::opening::{Carrier, OpeningInLanes, TetOpening, TetsNow};
use super::points::Points;
use super::tet_vectors::{Deformed, Forces};
use super::{LaneMaterial, Opened, WIDEST, materials_of, threads_for};
use crate::cpu::integrate_nodes::{NodeStep, NodeSums};
use crate::cpu::team::Team;
use crate::engine::elements::{Elements, cells_of_nodes};
use crate::material_point::PointState;
use crate::mesh::TetMesh;
use crate::model::Model;

/// f32 per cell in [`TetShapes::constants`]: `B_i` of the last three corners, length of all four, volume.
pub(super) const SHAPE: usize = 14;
/// Nodes of a line, which one call moves.
const LINE: usize = 64;
/// In [`TetShapes::cells`]: no cell.
pub(super) const NO_CELL: u32 = u32::MAX;

/// Displacement of a node [m] as cells read it.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
pub(super) struct Place(pub [f64; 4]);

impl Place {
    fn new(u: DVec3) -> Self {
        // Adding what has digits of 2^-44 m rounds to them.
        const FINE: f64 = 384.0;
        Place([(u.x + FINE) - FINE, (u.y + FINE) - FINE, (u.z + FINE) - FINE, 0.0])
    }
}

/// What does not change: slots of cells in groups of [`WIDEST`].
pub(super) struct TetShapes {
    pub arch: Arch,
    /// Cell of every slot.
    pub cells: Vec<u32>,
    /// Nodes of every slot.
    pub corners: Vec<[u32; 4]>,
    /// By group, then by number, then by slot.
    pub constants: Vec<f32>,
    /// Material of every group.
    pub group_material: Vec<u32>,
    pub materials: Vec<LaneMaterial>,
    /// Corners around every node in compressed rows: offsets, and four times the slot with the corner added.
    offsets: Vec<u32>,
    around: Vec<u32>,
    /// `K_a/V_a` of every node [Pa/m^3].
    stiffness: Vec<f32>,
    /// Part of its stiffness that a path has left, of every slot, and whether it has taken any.
    pub remaining: Vec<f32>,
    pub weakened: bool,
    /// Slot of every cell.
    slots: Vec<u32>,
}

impl TetShapes {
    fn new(model: &Model, mesh: &TetMesh, materials: Vec<LaneMaterial>) -> Self {
        let mut cells: Vec<u32> = Vec::new();
        let mut group_material = Vec::new();
        for material in 0..materials.len() {
            cells.extend((0..mesh.tets.len() as u32).filter(|c| model.material_index(*c as usize) == material));
            cells.resize(cells.len().next_multiple_of(WIDEST), NO_CELL);
            group_material.resize(cells.len() / WIDEST, material as u32);
        }
        let mut slots = vec![0u32; mesh.tets.len()];
        let mut corners = vec![[0u32; 4]; cells.len()];
        let mut constants = vec![0.0f32; cells.len() * SHAPE];
        for (slot, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != NO_CELL) {
            let cell = *cell as usize;
            (slots[cell], corners[slot]) = (slot as u32, mesh.tets[cell]);
            let gradients = mesh.gradients(cell);
            let of_corners = gradients[1..].iter().flat_map(|b| b.to_array());
            let numbers = of_corners.chain(gradients.iter().map(|b| b.length())).chain([mesh.volume(cell)]);
            let group = &mut constants[slot / WIDEST * SHAPE * WIDEST..];
            for (number, value) in numbers.enumerate() {
                group[number * WIDEST + slot % WIDEST] = value as f32;
            }
        }
        let (offsets, cells_around) = cells_of_nodes(mesh);
        let mut around = Vec::with_capacity(cells_around.len());
        for (node, range) in offsets.windows(2).enumerate() {
            for cell in cells_around[range[0]..range[1]].iter().map(|c| *c as usize) {
                let corner = mesh.tets[cell].iter().position(|n| *n as usize == node).unwrap_or(0);
                around.push(4 * slots[cell] + corner as u32);
            }
        }
        let mut shapes = TetShapes {
            arch: Arch::new(),
            remaining: vec![1.0; cells.len()],
            weakened: false,
            slots,
            cells,
            corners,
            constants,
            group_material,
            materials,
            offsets: offsets.into_iter().map(|o| o as u32).collect(),
            around,
            stiffness: Vec::new(),
        };
        shapes.stiffness = (0..mesh.positions.len()).map(|node| shapes.node_stiffness(model, mesh, node)).collect();
        shapes
    }

    /// `K_a/V_a` of a node [Pa/m^3].
    fn node_stiffness(&self, model: &Model, mesh: &TetMesh, node: usize) -> f32 {
        let (mut volume, mut weighted) = (0.0, 0.0);
        for slot in self.around(node).iter().map(|corner| *corner as usize / 4) {
            let cell = self.cells[slot] as usize;
            let share = 0.25 * mesh.volume(cell);
            volume += share;
            weighted += share * (model.material(cell).law.bulk_modulus * f64::from(self.remaining[slot]));
        }
        if volume > 0.0 { (weighted / (volume * volume)) as f32 } else { 0.0 }
    }

    /// Takes in the stiffness that a path has left.
    fn weaken(&mut self, model: &Model, stiffness: &[f64]) {
        let (Some(plan), Some(mesh)) = (&model.puncture, model.mesh.as_tets()) else { return };
        for cell in plan.cells.iter().map(|path| path.cell as usize).filter(|cell| *cell < stiffness.len()) {
            let (slot, left) = (self.slots[cell] as usize, stiffness[cell] as f32);
            if self.remaining[slot] != left {
                self.remaining[slot] = left;
                self.weakened = true;
                for node in mesh.tets[cell].map(|n| n as usize) {
                    self.stiffness[node] = self.node_stiffness(model, mesh, node);
                }
            }
        }
    }

    fn around(&self, node: usize) -> &[u32] {
        &self.around[self.offsets[node] as usize..self.offsets[node + 1] as usize]
    }

    /// Pressure of the nodes from `first` on [Pa]: `K_a (Jbar_a - 1)`, from the volume changes `V_e/4 (J_e - 1)` of all slots.
    fn average(&self, changes: &[f32], first: usize, pressures: &mut [f32]) {
        for (i, pressure) in pressures.iter_mut().enumerate() {
            let mut sum = 0.0;
            for corner in self.around(first + i) {
                sum += changes[*corner as usize / 4];
            }
            *pressure = sum * self.stiffness[first + i];
        }
    }

    /// Adds up what the cells around every node do to it, for the lines of nodes from `first` on: -f_int, and the bound.
    fn gather(&self, forces: &[[f32; 4]], first: usize, numbers: &mut [f32]) {
        let nodes = self.stiffness.len();
        for (line, numbers) in numbers.chunks_exact_mut(super::nodes::NODE * LINE).enumerate() {
            let first = (first + line) * LINE;
            for i in 0..LINE.min(nodes - first) {
                let mut sum = [0.0f32; 4];
                for corner in self.around(first + i) {
                    let force = forces[*corner as usize];
                    for number in 0..4 {
                        sum[number] += force[number];
                    }
                }
                for axis in 0..3 {
                    numbers[axis * LINE + i] = -sum[axis];
                }
                numbers[3 * LINE + i] = sum[3];
            }
        }
    }
}

/// Tetrahedra in lanes.
pub struct LaneTets {
    shapes: TetShapes,
    team: Team,
    places: Vec<Place>,
    /// H by group, then by entry (column by column), then by slot.
    gradients: Vec<f32>,
    /// `V_e/4 (J_e - 1)` of every slot [m^3].
    changes: Vec<f32>,
    /// Of every node [Pa].
    pressures: Vec<f32>,
    /// Force (with the sign of f_int) and bound of the four corners of every slot.
    forces: Vec<[f32; 4]>,
    nodes: NodeLines,
    /// Material points that do more than the elastic law, and what they remember, in a row per group.
    points: Option<Points>,
    histories: Vec<f32>,
    opening: Option<Box<TetOpening>>,
}

impl LaneTets {
    pub fn new(model: &Model, mesh: &TetMesh, elements: &Elements) -> Result<Self, String> {
        let shapes = TetShapes::new(model, mesh, materials_of(model, elements)?);
        let (slots, nodes) = (shapes.cells.len(), mesh.positions.len());
        let points = Points::new(&model.materials, WIDEST);
        let node_lines = NodeLines::new(model, LINE, LINE);
        let opening = model.opening().map(|plan| {
            let (slot_of, first) = (|cell: usize| shapes.slots[cell] as usize, |node| node_lines.first_number(node));
            let line = super::nodes::NODE * LINE;
            Box::new(TetOpening::new(model, mesh, plan, &shapes.materials, slot_of, (first, line)))
        });
        Ok(LaneTets {
            opening,
            histories: vec![0.0; points.as_ref().map_or(0, Points::row_length) * slots / WIDEST],
            points,
            team: Team::new(threads_for(mesh.tets.len())),
            places: vec![Place::default(); nodes],
            gradients: vec![0.0; slots * GRADIENT],
            changes: vec![0.0; slots],
            pressures: vec![0.0; nodes],
            forces: vec![[0.0; 4]; 4 * slots],
            nodes: node_lines,
            shapes,
        })
    }

    /// The threads that its stages share.
    pub fn team(&self) -> &Team {
        &self.team
    }

    /// What carries tissue beside an opened path.
    pub fn opening(&mut self) -> Option<OpeningInLanes<'_>> {
        let LaneTets { opening, team, nodes, gradients, pressures, .. } = self;
        opening.as_mut().map(|opening| OpeningInLanes {
            opening: Carrier::Tets(opening, TetsNow { gradients, pressures }),
            team,
            stride: nodes.stride(),
            numbers: &mut nodes.numbers,
        })
    }

    /// Numbers of the nodes.
    pub(super) fn nodes(&self) -> &NodeLines {
        &self.nodes
    }

    /// The same, to be changed.
    pub(super) fn nodes_mut(&mut self) -> &mut NodeLines {
        &mut self.nodes
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let TetShapes { cells, corners, constants, group_material, offsets, around, stiffness, slots, .. } =
            &self.shapes;
        let words =
            2 * cells.len() + slots.len() + 4 * corners.len() + constants.len() + group_material.len() + offsets.len();
        let changing = self.gradients.len() + self.changes.len() + self.pressures.len() + 4 * self.forces.len();
        4 * (words + around.len() + stiffness.len() + changing + self.histories.len())
            + size_of_val(self.places.as_slice())
            + self.opening.as_ref().map_or(0, |opening| opening.bytes())
            + self.nodes.bytes()
    }

    /// Forces and bounds of all cells at the nodes, for this displacement and the stiffness that a path left (empty: all of it). `advance`:
    /// step [s] and number of the step that histories are brought forward to.
    pub fn compute(
        &mut self,
        model: &Model,
        elements: &Elements,
        (displacement, opened): (&[DVec3], Option<Opened>),
        stiffness: &[f64],
        advance: Option<(f64, u64)>,
    ) {
        self.shapes.weaken(model, stiffness);
        let LaneTets { shapes, team, places, gradients, changes, pressures, forces, nodes, points, histories, opening } =
            self;
        if let Some(points) = points {
            points.prepare(&model.materials, advance);
        }
        let points = points.as_ref();
        let part = team.part(shapes.group_material.len());
        let parts = gradients.chunks_mut(part * WIDEST * GRADIENT).zip(changes.chunks_mut(part * WIDEST));
        let deformed = Deformed { shapes, places, displacement, mesh: &model.mesh };
        team.map(parts.collect::<Vec<_>>(), |i, (gradients, changes)| deformed.compute(i * part, gradients, changes));
        if let (Some(opening), Some(opened)) = (opening, opened) {
            opening.grow(team, opened, displacement, gradients, changes);
        }
        let of_nodes = team.part(pressures.len());
        team.map(pressures.chunks_mut(of_nodes), |i, p| shapes.average(changes, i * of_nodes, p));
        let of_cells = Forces { shapes, gradients, pressures, model, elements, displacement, points, advance };
        let parts = forces.chunks_mut(part * WIDEST * 4);
        let work = |i: usize, (forces, histories): (&mut [[f32; 4]], &mut [f32])| {
            of_cells.compute(i * part, forces, histories);
        };
        match points.map_or(0, Points::row_length) {
            0 => team.map(parts.map(|forces| (forces, &mut [][..])), work),
            length => team.map(parts.zip(histories.chunks_mut(part * length)), work),
        };
        let forces = forces.as_slice();
        let line = super::nodes::NODE * LINE;
        let part = team.part(nodes.numbers.len() / line);
        team.map(nodes.numbers.chunks_mut(part * line), |i, numbers| shapes.gather(forces, i * part, numbers));
    }

    /// Mean pressure of the nodes of a tetrahedron in the last forces [Pa].
    pub fn averaged_pressure(&self, nodes: &[usize]) -> f64 {
        nodes.iter().map(|node| 0.25 * f64::from(self.pressures[*node])).sum()
    }

    /// Takes in what the points remember.
    pub fn take_points(&mut self, states: &[PointState]) {
        let LaneTets { shapes, points, histories, .. } = self;
        let Some(points) = points.as_ref().filter(|points| points.row_length() > 0) else { return };
        for (row, cells) in histories.chunks_mut(points.row_length()).zip(shapes.cells.chunks(WIDEST)) {
            row.fill(0.0);
            for (i, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != NO_CELL) {
                points.set(&states[*cell as usize], i, row);
            }
        }
    }

    /// Gives the points what they have become and booked since; how many returns failed.
    pub fn give_points(&mut self, states: &mut [PointState]) -> u32 {
        let LaneTets { shapes, points, histories, .. } = self;
        let Some(points) = points.as_ref().filter(|points| points.row_length() > 0) else { return 0 };
        let mut failed = 0;
        for (row, cells) in histories.chunks_mut(points.row_length()).zip(shapes.cells.chunks(WIDEST)) {
            for (i, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell != NO_CELL) {
                failed += points.give_one(row, i, &mut states[*cell as usize]);
            }
        }
        failed
    }

    /// Takes in a displacement that the last step did not make.
    pub fn take(&mut self, displacement: &[DVec3]) {
        set_places(&mut self.places, displacement);
    }

    /// Moves all nodes.
    pub fn integrate(&mut self, step: &NodeStep, moved: Moved) -> Vec<NodeSums> {
        let places = self.places.chunks_mut(LINE).collect();
        self.nodes.integrate(self.shapes.arch, &self.team, step, moved, (places, set_places))
    }
}

fn set_places(places: &mut [Place], displacement: &[DVec3]) {
    for (place, u) in places.iter_mut().zip(displacement) {
        *place = Place::new(*u);
    }
}
