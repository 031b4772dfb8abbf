//! Dead loads on faces and named sets as forces of nodes.
//!
//! A traction t on a triangle of rest area A gives each of its nodes t A/3, and a pressure p the same with t = -p N, N the outward
//! normal at rest: size and direction stay those of the rest shape however the tissue moves (dead loads, no followers).

use glam::DVec3;

use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::scene::{Face, LoadKind, Scene, SetLoad};

/// Nodal forces of all loads at full ramp [N], and the ramp time [s]; no forces without loads.
pub(super) fn nodal_loads(scene: &Scene, mesh: &Mesh) -> (Vec<DVec3>, f64) {
    let loaded: Vec<Face> = Face::ALL.into_iter().filter(|&f| scene.faces[f as usize].traction.is_some()).collect();
    if loaded.is_empty() && scene.loads.is_empty() {
        return (Vec::new(), 0.0);
    }
    let mut load = vec![DVec3::ZERO; mesh.node_count()];
    let mut ramp: f64 = 0.0;
    for face in loaded {
        let condition = &scene.faces[face as usize];
        let traction = condition.traction.unwrap_or_default();
        ramp = ramp.max(condition.traction_ramp);
        match mesh {
            Mesh::Block(block) => load_block(block, face, traction, &mut load),
            Mesh::Tets(tets) => {
                add(tets, tets.surface_on_side(face.axis(), face.is_max()), |_| traction, &mut load);
            }
        }
    }
    for SetLoad { set, kind, ramp: own } in &scene.loads {
        ramp = ramp.max(*own);
        let Mesh::Tets(tets) = mesh else { continue };
        let triangles = tets.surface_of(set.as_deref()).unwrap_or_default();
        match *kind {
            LoadKind::Traction(traction) => add(tets, triangles, |_| traction, &mut load),
            LoadKind::Pressure(pressure) => add(tets, triangles, |normal| normal * -pressure, &mut load),
        }
    }
    (load, ramp)
}

/// Area of the triangles that a load acts on [m^2], and their resultant at full ramp [N].
pub fn resultant(mesh: &TetMesh, load: &SetLoad) -> (f64, DVec3) {
    let triangles = mesh.surface_of(load.set.as_deref()).unwrap_or_default();
    triangles.into_iter().fold((0.0, DVec3::ZERO), |(area, force), triangle| {
        let vector = mesh.area_vector(triangle);
        let own = match load.kind {
            LoadKind::Traction(traction) => traction * vector.length(),
            LoadKind::Pressure(pressure) => vector * -pressure,
        };
        (area + vector.length(), force + own)
    })
}

/// Adds the nodal forces [N] of a traction on a face of the block [Pa].
fn load_block(mesh: &BlockMesh, face: Face, traction: DVec3, load: &mut [DVec3]) {
    let axis = face.axis();
    let plane = if face.is_max() { mesh.nodes()[axis] - 1 } else { 0 };
    let lines = &mesh.lines[axis];
    let half = 0.5 * if face.is_max() { lines[lines.len() - 1] - lines[lines.len() - 2] } else { lines[1] - lines[0] };
    for (node, force) in load.iter_mut().enumerate() {
        if mesh.node_coordinates(node)[axis] == plane {
            *force += traction * (mesh.node_volume(node) / half);
        }
    }
}

/// Adds those of triangles [N], each under the traction [Pa] that `of` gives for its outward normal: a third of its force on each node.
fn add(mesh: &TetMesh, triangles: Vec<[u32; 3]>, of: impl Fn(DVec3) -> DVec3, load: &mut [DVec3]) {
    for triangle in triangles {
        let vector = mesh.area_vector(triangle);
        let share = of(vector.normalize_or_zero()) * (vector.length() / 3.0);
        triangle.iter().for_each(|node| load[*node as usize] += share);
    }
}
