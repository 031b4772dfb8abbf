//! A label map of a mesh of tetrahedra: which voxels have their centre in which region.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};

use crate::anatomy::LabelMap;
use crate::anatomy::label_map::MOST_VOXELS;
use crate::error::{Error, Result};
use crate::mesh::TetMesh;

/// Most voxels that are asked, all tetrahedra together: a minute.
const MOST_ASKED: f64 = 2e10;

/// Labels on cubes of edge `spacing` [m] along the axes: label n + 1 is region n. Coordinates are taken as RAS.
///
/// # Errors
/// Where there would be too many voxels.
pub fn of_mesh(mesh: &TetMesh, spacing: f64) -> Result<LabelMap> {
    let (low, high) = mesh.bounds();
    // A layer of nothing around everything, for the surface to lie in.
    let counts = ((high - low) / spacing).ceil() + 2.0;
    let asked: f64 = (0..mesh.tets.len()).map(|tet| (extent(mesh, tet).1 / spacing + 2.0).element_product()).sum();
    if !(counts.element_product() <= MOST_VOXELS as f64 && asked <= MOST_ASKED) {
        return Err(Error::input(
            format!("a mesh of this size has too many voxels of {} mm", spacing * 1e3),
            "take a larger edge, e.g. --voxel 2",
        ));
    }
    let size = counts.to_array().map(|n| n as usize);
    let origin = 0.5 * (low + high) - 0.5 * spacing * (counts - 1.0);
    let mut labels = vec![0_u16; size.iter().product()];
    for tet in 0..mesh.tets.len() {
        let label = u16::try_from(mesh.tags[tet] + 1).unwrap_or(u16::MAX);
        fill(&mut labels, size, mesh.corners(tet), (origin, spacing), label);
    }
    let names = (1..=u16::MAX).zip(mesh.regions.iter().cloned()).collect::<BTreeMap<_, _>>();
    Ok(LabelMap { size, steps: DMat3::from_diagonal(DVec3::splat(spacing)), origin, labels, names })
}

/// Lowest corner and extent of a tetrahedron.
fn extent(mesh: &TetMesh, tet: usize) -> (DVec3, DVec3) {
    let [a, b, c, d] = mesh.corners(tet);
    let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
    (low, high - low)
}

/// Labels the voxels whose centre is in a tetrahedron, its faces included: neighbours leave no gap, and the later one wins.
fn fill(labels: &mut [u16], size: [usize; 3], corners: [DVec3; 4], (origin, spacing): (DVec3, f64), label: u16) {
    let [a, b, c, d] = corners;
    let edges = DMat3::from_cols(b - a, c - a, d - a);
    if edges.determinant() == 0.0 {
        return;
    }
    let inverse = edges.inverse();
    let low = ((a.min(b).min(c).min(d) - origin) / spacing).floor().max(DVec3::ZERO);
    let high = ((a.max(b).max(c).max(d) - origin) / spacing).ceil();
    let range = |axis: usize| low[axis] as usize..(high[axis].max(0.0) as usize + 1).min(size[axis]);
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let x = origin + spacing * DVec3::new(i as f64, j as f64, k as f64);
                let share = inverse * (x - a);
                const ROUNDING: f64 = 1e-12;
                if share.min_element() >= -ROUNDING && share.element_sum() <= 1.0 + ROUNDING {
                    labels[(k * size[1] + j) * size[0] + i] = label;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::BlockMesh;

    #[test]
    fn a_block_of_tetrahedra_is_filled_without_gaps() {
        let lines = |n: usize| (0..=n).map(|i| i as f64 * 5e-3).collect::<Vec<f64>>();
        let mesh = TetMesh::from_block(&BlockMesh::new([lines(2), lines(3), lines(2)]));
        let map = of_mesh(&mesh, 1e-3).unwrap();
        assert_eq!(map.size, [12, 17, 12]);
        let volumes = map.volumes();
        assert_eq!(volumes.values().map(|(count, _)| count).sum::<usize>(), 10 * 15 * 10);
        // No hole within.
        assert_eq!(map.label_at(DVec3::new(5e-3, 7e-3, 5e-3)), 1);
        assert_eq!(map.label_at(DVec3::new(-1e-3, 7e-3, 5e-3)), 0);
        assert!(of_mesh(&mesh, 1e-6).unwrap_err().to_string().contains("--voxel"));
    }
}
