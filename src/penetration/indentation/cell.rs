//! Linearisation of one cell for [`super`]: neo-Hooke `mu/2 (I1 J^(-2/3) - 3)` with mu = 1 and pressure
//! modes `p (J - 1) - p^2/(2 K)`, axisymmetric. Deformation gradients are stored as rr, rz, zr, zz, hoop.

use super::mesh::{Cell, GaussPoint};
use crate::penetration::mixed_cell::{CELL_DOFS, CellSystem};

/// Deformation gradient at an integration point: rr, rz, zr, zz, hoop.
pub fn deformation(cell: &Cell, point: &GaussPoint, displacement: &[[f64; 2]]) -> [f64; 5] {
    let mut f = [1.0, 0.0, 0.0, 1.0, 1.0];
    for (&node, n) in cell.nodes.iter().zip(&point.gradient) {
        let u = displacement[node];
        f[0] += u[0] * n[0];
        f[1] += u[0] * n[1];
        f[2] += u[1] * n[0];
        f[3] += u[1] * n[1];
        f[4] += u[0] * n[2];
    }
    f
}

/// Current over rest volume.
pub fn volume_ratio(f: &[f64; 5]) -> f64 {
    (f[0] * f[3] - f[1] * f[2]) * f[4]
}

/// Linearisation of one cell at the displacement of all nodes [R] and its pressure modes [mu]; `None` if it is turned
/// inside out.
pub fn cell_system(cell: &Cell, displacement: &[[f64; 2]], p: &[f64; 3], bulk: f64) -> Option<CellSystem> {
    let mut system = CellSystem {
        tangent: [[0.0; CELL_DOFS]; CELL_DOFS],
        force: [0.0; CELL_DOFS],
        coupling: [[0.0; CELL_DOFS]; 3],
        volume: [0.0; 3],
    };
    for point in &cell.points {
        let f = deformation(cell, point, displacement);
        let j = volume_ratio(&f);
        let plane = f[0] * f[3] - f[1] * f[2];
        if !(j > 0.0 && plane > 0.0 && j.is_finite()) {
            return None;
        }
        let w = point.weight;
        let pressure = p[0] * point.mode[0] + p[1] * point.mode[1] + p[2] * point.mode[2];
        let first: f64 = f.iter().map(|x| x * x).sum();
        let scale = j.powf(-2.0 / 3.0);
        // derivative of J
        let c = [f[3] * f[4], -f[2] * f[4], -f[1] * f[4], f[0] * f[4], plane];
        // derivatives of W = scale I1 / 2
        let slope = pressure - scale * first / (3.0 * j);
        let (cross, square) = (-2.0 / 3.0 * scale / j, 5.0 / 9.0 * scale * first / (j * j));
        let stress: [f64; 5] = std::array::from_fn(|a| w * (scale * f[a] + slope * c[a]));
        let mut a: [[f64; 5]; 5] = std::array::from_fn(|m| {
            std::array::from_fn(|n| cross * (f[m] * c[n] + c[m] * f[n]) + square * c[m] * c[n])
        });
        for (m, row) in a.iter_mut().enumerate() {
            row[m] += scale;
        }
        for (m, n, v) in [(0, 3, f[4]), (1, 2, -f[4]), (0, 4, f[3]), (3, 4, f[0]), (1, 4, -f[2]), (2, 4, -f[1])] {
            a[m][n] += slope * v;
            a[n][m] += slope * v;
        }
        let dilation = j - 1.0 - pressure / bulk;
        for (g, mode) in system.volume.iter_mut().zip(point.mode) {
            *g += w * mode * dilation;
        }
        for (m, n) in point.gradient.iter().enumerate() {
            let by = [c[0] * n[0] + c[1] * n[1] + c[4] * n[2], c[2] * n[0] + c[3] * n[1]];
            system.force[2 * m] += stress[0] * n[0] + stress[1] * n[1] + stress[4] * n[2];
            system.force[2 * m + 1] += stress[2] * n[0] + stress[3] * n[1];
            for (row, mode) in system.coupling.iter_mut().zip(point.mode) {
                row[2 * m] += w * mode * by[0];
                row[2 * m + 1] += w * mode * by[1];
            }
            // rows of B^T A of this node
            let by_r: [f64; 5] = std::array::from_fn(|k| w * (n[0] * a[0][k] + n[1] * a[1][k] + n[2] * a[4][k]));
            let by_z: [f64; 5] = std::array::from_fn(|k| w * (n[0] * a[2][k] + n[1] * a[3][k]));
            for (l, o) in point.gradient[..=m].iter().enumerate() {
                system.tangent[2 * m][2 * l] += by_r[0] * o[0] + by_r[1] * o[1] + by_r[4] * o[2];
                system.tangent[2 * m + 1][2 * l] += by_z[0] * o[0] + by_z[1] * o[1] + by_z[4] * o[2];
                system.tangent[2 * m + 1][2 * l + 1] += by_z[2] * o[0] + by_z[3] * o[1];
                if l < m {
                    system.tangent[2 * m][2 * l + 1] += by_r[2] * o[0] + by_r[3] * o[1];
                }
            }
        }
    }
    Some(system)
}
