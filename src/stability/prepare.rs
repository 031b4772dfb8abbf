//! Meshes, steps and states that no scene file can state.

use std::sync::Arc;

use glam::DVec3;

use crate::engine::State;
use crate::engine::elements::{CellStates, Elements};
use crate::engine::stable_dt::power_iteration;
use crate::material_point::Volumetric;
use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::model::Model;
use crate::scene::Scene;

/// Repeatable random numbers (splitmix64).
struct Random(u64);

impl Random {
    /// Uniform in -1..1.
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in the cube of half edge 1.
    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }
}

/// Writes the displacement `u(X - low)` [m] into the free components, with `low` the lowest corner of the block.
fn displace(model: &Model, state: &mut State, mut u: impl FnMut(DVec3) -> DVec3) {
    let (low, _) = model.mesh.bounds();
    for (node, value) in state.displacement.iter_mut().enumerate() {
        let (wanted, fixed) = (u(model.mesh.rest_position(node) - low), model.fixed_components(node));
        for a in (0..3).filter(|a| !fixed[*a]) {
            value[a] = wanted[a];
        }
    }
}

/// A smooth bend of `part` of a third of a millimetre, on a block of some millimetres that is held at its bottom.
fn bend(model: &Model, state: &mut State, part: f64) {
    let (low, high) = model.mesh.bounds();
    displace(model, state, |x| {
        let z = x.z / (high.z - low.z);
        DVec3::new(2e-4 * z * z, -1e-4 * z, 1.5e-4 * (2e2 * (x.x + low.x) * z).sin()) * part
    });
}

pub fn bent(model: &Model, state: &mut State) {
    bend(model, state, 1.0);
}

/// So little that the speed limit, which is low with a large step, is far away.
pub fn slightly_bent(model: &Model, state: &mut State) {
    bend(model, state, 0.05);
}

/// Three times as long, with the lateral contraction of a body that keeps its volume.
pub fn stretched(model: &Model, state: &mut State) {
    let lateral = 3.0_f64.powf(-0.5) - 1.0;
    displace(model, state, |x| DVec3::new(lateral * x.x, lateral * x.y, 2.0 * x.z));
}

/// Every cell turned inside out: the block is mirrored at its bottom and half as high, every node moved at random by up to a
/// tenth of an edge.
pub fn mirrored(model: &Model, state: &mut State) {
    let (edge, mut random) = (model.scene.tissue.cell_size, Random(1));
    displace(model, state, |x| DVec3::NEG_Z * (1.5 * x.z) + random.vector() * (0.1 * edge));
    assert!(first_upright(model, state).is_none(), "the mirrored cells are inverted for this seed");
}

/// Every node moved at random by up to an edge; the corners of a cell that is not inverted, at its centre or at a corner, are
/// moved anew until there is none.
pub fn scattered(model: &Model, state: &mut State) {
    let (edge, mut random) = (model.scene.tissue.cell_size, Random(2));
    displace(model, state, |_| random.vector() * edge);
    for _ in 0..100_000 {
        let Some(cell) = first_upright(model, state) else { return };
        for node in model.mesh.cell_nodes(cell).iter().copied() {
            let fixed = model.fixed_components(node);
            let wanted = random.vector() * edge;
            for a in (0..3).filter(|a| !fixed[*a]) {
                state.displacement[node][a] = wanted[a];
            }
        }
    }
    unreachable!("the cells of this block are inverted after some hundred draws");
}

/// First cell that is inverted neither at its centre nor at a corner.
fn first_upright(model: &Model, state: &State) -> Option<usize> {
    let elements = Elements::new(model);
    let none = Some(Volumetric { stress: 0.0, energy: 0.0 });
    (0..model.mesh.cell_count()).find(|cell| {
        let measure = elements.measure(model, *cell, &state.displacement, none, CellStates::default());
        measure.jacobian > 0.0 && measure.corner_jacobian > 0.0
    })
}

/// Every cell at the plastic strain at which its damage is as large as it can be.
pub fn damaged(model: &Model, state: &mut State) {
    for (cell, point) in state.points.iter_mut().enumerate() {
        let edge = model.mesh.cell_volume(cell).cbrt();
        if let Some(damage) = model.material(cell).damage {
            point.plastic.alpha = damage.onset + 1.001 * damage.largest * damage.failure_displacement / edge;
        }
    }
}

/// Sets the step to `part` of the limit at rest, unless the scene has one of its own; 30 of them fill a frame, so that none
/// is shortened.
fn step(scene: &mut Scene, mesh: &Mesh, part: f64) {
    let limit = power_iteration(&Model::new(scene.clone(), mesh.clone()));
    let step = *scene.solver.time_step.get_or_insert(part * limit);
    scene.solver.frame_rate = 1.0 / (30.0 * step);
}

pub fn step_below(scene: &mut Scene, mesh: &Mesh) {
    step(scene, mesh, 0.9);
}

pub fn step_above(scene: &mut Scene, mesh: &Mesh) {
    step(scene, mesh, 1.1);
}

/// The block of the scene, each cell cut into six tetrahedra.
pub fn tetrahedra(scene: &Scene) -> Mesh {
    Mesh::Tets(Arc::new(TetMesh::from_block(&BlockMesh::for_scene(scene))))
}

/// Smallest altitude that [`slivers`] leaves, in cell edges.
const SLIVER: f64 = 0.02;

/// The same with every inner node moved in some direction until a tetrahedron around it is nearly flat.
pub fn slivers(scene: &Scene) -> Mesh {
    let (edge, mut random) = (scene.tissue.cell_size, Random(3));
    let mut mesh = TetMesh::from_block(&BlockMesh::for_scene(scene));
    let (low, high) = mesh.bounds();
    let inside = |x: DVec3| x.cmpgt(low + 0.5 * edge).all() && x.cmplt(high - 0.5 * edge).all();
    for node in 0..mesh.positions.len() {
        let start = mesh.positions[node];
        if !inside(start) {
            continue;
        }
        let around: Vec<usize> = (0..mesh.tets.len()).filter(|t| mesh.tets[*t].contains(&(node as u32))).collect();
        let direction = random.vector().normalize();
        let mut reached = start;
        for i in 1..200 {
            mesh.positions[node] = start + direction * (0.01 * f64::from(i) * edge);
            let flat = |t: &usize| mesh.volume(*t) <= 0.0 || mesh.smallest_altitude(*t) < SLIVER * edge;
            if around.iter().any(flat) {
                break;
            }
            reached = mesh.positions[node];
        }
        mesh.positions[node] = reached;
    }
    Mesh::Tets(Arc::new(mesh))
}

/// Layers that [`long_cells`] makes one of.
const MERGED: usize = 16;

/// The block of the scene with every 16 layers of cells merged into one.
pub fn long_cells(scene: &Scene) -> Mesh {
    let mut mesh = BlockMesh::for_scene(scene);
    let last = mesh.lines[2].len() - 1;
    mesh.lines[2] =
        mesh.lines[2].iter().enumerate().filter(|(k, _)| k % MERGED == 0 || *k == last).map(|(_, z)| *z).collect();
    Mesh::Block(mesh)
}
