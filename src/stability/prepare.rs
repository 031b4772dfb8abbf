//! Meshes, steps and states that no scene file can state.

use std::sync::Arc;

use glam::DVec3;

use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::model::Model;
use crate::scene::Scene;
use crate::solver::engine::State;
use crate::solver::stable_dt::power_iteration;

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

/// A smooth bend of a third of a millimetre at most, on a block of some millimetres that is held at its bottom.
pub fn bent(model: &Model, state: &mut State) {
    let (low, high) = model.mesh.bounds();
    displace(model, state, |x| {
        let z = x.z / (high.z - low.z);
        DVec3::new(2e-4 * z * z, -1e-4 * z, 1.5e-4 * (2e2 * (x.x + low.x) * z).sin())
    });
}

/// Three times as long, with the lateral contraction of a body that keeps its volume.
pub fn stretched(model: &Model, state: &mut State) {
    let lateral = 3.0_f64.powf(-0.5) - 1.0;
    displace(model, state, |x| DVec3::new(lateral * x.x, lateral * x.y, 2.0 * x.z));
}

/// Part of a cell edge by which the nodes of turned cells are moved at random.
const SCATTER: f64 = 0.3;

/// Every cell turned inside out: the block is mirrored at its bottom and half as high, every node moved at random.
pub fn mirrored(model: &Model, state: &mut State) {
    let (edge, mut random) = (model.scene.tissue.cell_size, Random(1));
    displace(model, state, |x| {
        // The nodes of the bottom are held.
        let free = (x.z / edge).min(1.0);
        DVec3::NEG_Z * (1.5 * x.z) + random.vector() * (SCATTER * edge * free)
    });
}

/// Every node somewhere in the block.
pub fn scrambled(model: &Model, state: &mut State) {
    let ((low, high), mut random) = (model.mesh.bounds(), Random(2));
    displace(model, state, |x| (high - low) * (random.vector() + DVec3::ONE) * 0.5 - x);
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

/// Sets the step to `part` of the limit at rest, unless the scene has one of its own.
fn step(scene: &mut Scene, mesh: &Mesh, part: f64) {
    let limit = power_iteration(&Model::new(scene.clone(), mesh.clone()));
    scene.solver.time_step.get_or_insert(part * limit);
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
