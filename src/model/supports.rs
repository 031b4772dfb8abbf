//! Skin that is held away from the path (`tissue.supports`): a hand that stretches it, a drape, the rest of the body.

use crate::mesh::{BlockMesh, Mesh};
use crate::scene::Scene;

use super::Composition;
use super::composition::LEAST_FILL;

/// Nodes of the skin that are farther from the path than the scene leaves free, ascending; none where it leaves all of it free.
///
/// Skin of a block is its top face, and what borders on cells of air that are reached from above without passing tissue; that of
/// a mesh see [`crate::mesh::TetMesh::skin`].
pub(super) fn held_skin(scene: &Scene, mesh: &Mesh, composition: &Composition) -> Vec<usize> {
    let Some(free) = scene.skin_free else { return Vec::new() };
    let mut skin: Vec<usize> = match mesh {
        Mesh::Block(block) => skin_of_block(block, composition),
        Mesh::Tets(tets) => tets.skin(scene.motion.entry).into_iter().map(|node| node as usize).collect(),
    };
    let distance = scene.motion.distance_from_path();
    skin.retain(|node| distance(mesh.rest_position(*node)) > free);
    skin
}

/// Nodes of the skin of a block that tissue moves.
fn skin_of_block(block: &BlockMesh, composition: &Composition) -> Vec<usize> {
    let [nx, ny, nz] = block.cells();
    // What fills a cell counts, not whether it is simulated: between bones cells with tissue stand still too.
    let is_air = |cell: usize| {
        composition.fill.get(cell).is_some_and(|fill| f64::from(*fill) < LEAST_FILL) && !composition.rigid[cell]
    };
    let mut reached = vec![false; block.cell_count()];
    let mut left: Vec<[usize; 3]> = (0..ny).flat_map(|j| (0..nx).map(move |i| [i, j, nz - 1])).collect();
    while let Some([i, j, k]) = left.pop() {
        let cell = block.cell_index(i, j, k);
        if reached[cell] || !is_air(cell) {
            continue;
        }
        reached[cell] = true;
        let (mut at, counts) = ([i, j, k], [nx, ny, nz]);
        for axis in 0..3 {
            let here = at[axis];
            for next in [here.checked_sub(1), Some(here + 1).filter(|n| *n < counts[axis])].into_iter().flatten() {
                at[axis] = next;
                left.push(at);
            }
            at[axis] = here;
        }
    }
    let mut is_skin = vec![false; block.node_count()];
    let top = block.node_index(0, 0, nz);
    is_skin[top..].fill(true);
    for cell in (0..reached.len()).filter(|cell| reached[*cell]) {
        block.cell_nodes(cell).into_iter().for_each(|node| is_skin[node] = true);
    }
    let stands = |node: usize| composition.held.get(node).is_some_and(|held| *held);
    (0..is_skin.len()).filter(|node| is_skin[*node] && !stands(*node)).collect()
}
