//! A rest position in the deformed block: where it is, and how the tissue around it is deformed.

use glam::{DMat3, DVec3};

use super::{BlockMesh, trilinear};
use crate::material::kinematics::cofactor;

/// A material point in the deformed mesh.
pub struct MaterialPlace {
    pub nodes: [usize; 8],
    pub weights: [f64; 8],
    /// x(X) [m] and F there.
    pub position: DVec3,
    pub gradient: DMat3,
}

/// Cell and local coordinates of a rest position inside the block.
pub fn grid_place(mesh: &BlockMesh, x: DVec3) -> ([usize; 3], DVec3, DVec3) {
    let (mut cell, mut local, mut width) = ([0; 3], DVec3::ZERO, DVec3::ZERO);
    for a in 0..3 {
        let lines = &mesh.lines[a];
        let i = lines.partition_point(|l| *l <= x[a]).clamp(1, lines.len() - 1) - 1;
        cell[a] = i;
        width[a] = lines[i + 1] - lines[i];
        local[a] = ((x[a] - lines[i]) / width[a]).clamp(0.0, 1.0);
    }
    (cell, local, width)
}

/// The rest position itself or the nearest one in the block.
pub fn within_block(mesh: &BlockMesh, x: DVec3) -> DVec3 {
    let end = |a: usize| mesh.lines[a][mesh.lines[a].len() - 1];
    let first = |a: usize| mesh.lines[a][0];
    x.clamp(DVec3::new(first(0), first(1), first(2)), DVec3::new(end(0), end(1), end(2)))
}

/// Where the rest position `x` is in a block that is displaced by `u`.
pub fn material_place(mesh: &BlockMesh, u: &[DVec3], x: DVec3) -> MaterialPlace {
    let (cell, local, width) = grid_place(mesh, x);
    let nodes = mesh.cell_nodes(mesh.cell_index(cell[0], cell[1], cell[2]));
    let (weights, rates) = trilinear(local, width);
    let (mut position, mut gradient) = (x, DMat3::IDENTITY);
    for ((node, weight), rate) in nodes.iter().zip(weights).zip(rates) {
        let u = u[*node];
        position += u * weight;
        gradient += DMat3::from_cols(u * rate.x, u * rate.y, u * rate.z);
    }
    MaterialPlace { nodes, weights, position, gradient }
}

/// F^-1 v, and v itself where the material is turned inside out.
pub fn pulled_back(f: DMat3, v: DVec3) -> DVec3 {
    let cofactor = cofactor(f);
    let j = f.x_axis.dot(cofactor.x_axis);
    if j > 0.02 { cofactor.transpose() * v / j } else { v }
}

/// The rest position that is at the place `x` in a block that is displaced by `u`, found from a guess `near`. Outside of the tissue as its
/// surface goes on: `within` gives the nearest place in it.
pub fn rest_position_at(
    mesh: &BlockMesh,
    u: &[DVec3],
    x: DVec3,
    near: DVec3,
    within: impl Fn(DVec3) -> DVec3,
) -> DVec3 {
    const ROUNDS: usize = 12;
    let mut place = near;
    for _ in 0..ROUNDS {
        let inside = within(place);
        let at = material_place(mesh, u, inside);
        let away = x - at.position - (place - inside);
        place += pulled_back(at.gradient, away);
        if away.length() < 1e-9 {
            break;
        }
    }
    place
}
