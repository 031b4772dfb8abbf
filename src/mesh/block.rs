//! The structured block and its grid lines: uniform around the planned path, growing towards the faces.
//!
//! In x and y the fine zone is the bounding box of the planned straight path, widened by `fine_radius` and rounded
//! to whole cells of edge `h`; the entry point lies `axis_offset_cells` of a cell above a grid line. Outside it the
//! edges form a geometric series whose ratio is fitted so that the block face is met exactly. In z the cells are
//! uniform down to 4 mm below the deepest point and grow further below. Without a tool all cells are uniform.

use glam::DVec3;

use crate::scene::{Motion, Scene, Tissue};

/// A rectilinear block of hexahedral cells: three lists of grid lines.
///
/// Node `(i, j, k)` has the index `(k * (ny + 1) + j) * (nx + 1) + i`, cell `(i, j, k)` the index
/// `(k * ny + j) * nx + i`; k grows upwards, the top face (z = 0) is the last plane.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMesh {
    /// Grid lines per axis [m], ascending.
    pub lines: [Vec<f64>; 3],
}

impl BlockMesh {
    /// Cells per axis.
    pub fn cells(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lines[a].len() - 1)
    }

    /// Nodes per axis.
    pub fn nodes(&self) -> [usize; 3] {
        std::array::from_fn(|a| self.lines[a].len())
    }

    pub fn cell_count(&self) -> usize {
        self.cells().iter().product()
    }

    pub fn node_count(&self) -> usize {
        self.nodes().iter().product()
    }

    pub fn node_index(&self, i: usize, j: usize, k: usize) -> usize {
        let [nx, ny, _] = self.nodes();
        (k * ny + j) * nx + i
    }

    pub fn cell_index(&self, i: usize, j: usize, k: usize) -> usize {
        let [nx, ny, _] = self.cells();
        (k * ny + j) * nx + i
    }

    /// Grid coordinates of a node.
    pub fn node_coordinates(&self, node: usize) -> [usize; 3] {
        let [nx, ny, _] = self.nodes();
        [node % nx, node / nx % ny, node / (nx * ny)]
    }

    /// Grid coordinates of a cell.
    pub fn cell_coordinates(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells();
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Rest position X of a node [m].
    pub fn rest_position(&self, node: usize) -> DVec3 {
        let [i, j, k] = self.node_coordinates(node);
        DVec3::new(self.lines[0][i], self.lines[1][j], self.lines[2][k])
    }

    /// Edge lengths of a cell [m].
    pub fn cell_size(&self, cell: usize) -> DVec3 {
        let c = self.cell_coordinates(cell);
        let d = |a: usize| self.lines[a][c[a] + 1] - self.lines[a][c[a]];
        DVec3::new(d(0), d(1), d(2))
    }

    /// The eight nodes of a cell in VTK order (bottom ring, then top ring, both counter-clockwise).
    pub fn cell_nodes(&self, cell: usize) -> [usize; 8] {
        let [i, j, k] = self.cell_coordinates(cell);
        [
            self.node_index(i, j, k),
            self.node_index(i + 1, j, k),
            self.node_index(i + 1, j + 1, k),
            self.node_index(i, j + 1, k),
            self.node_index(i, j, k + 1),
            self.node_index(i + 1, j, k + 1),
            self.node_index(i + 1, j + 1, k + 1),
            self.node_index(i, j + 1, k + 1),
        ]
    }

    /// Tributary volume of a node, an eighth of every cell around it [m^3].
    pub fn node_volume(&self, node: usize) -> f64 {
        let c = self.node_coordinates(node);
        (0..3)
            .map(|a| {
                let l = &self.lines[a];
                let below = if c[a] > 0 { l[c[a]] - l[c[a] - 1] } else { 0.0 };
                let above = if c[a] + 1 < l.len() { l[c[a] + 1] - l[c[a]] } else { 0.0 };
                0.5 * (below + above)
            })
            .product()
    }
}

/// Largest fitted ratio over the wanted one. A ratio fitted upwards saves one layer of cells per side.
const FITTED_OVER_WANTED_GROWTH: f64 = 1.12;

/// Smallest edge of a graded cell over the fine edge; a smaller one would cut the stable time step.
const SMALLEST_EDGE: f64 = 0.7;

/// Uniform depth kept below the deepest point of the path [m].
const FINE_BELOW_PATH: f64 = 4.0e-3;

/// Fine lines that may be given up at one side to make room for a well-shaped series.
const LINES_TO_GIVE_UP: usize = 3;

impl BlockMesh {
    /// The grid of a scene; fine around the path of its tool, uniform without a tool.
    pub fn for_scene(scene: &Scene) -> BlockMesh {
        BlockMesh::for_tissue(&scene.tissue, scene.tool.as_ref().map(|_| &scene.motion))
    }

    /// The grid of a block, fine around the path of `motion`; `None`: uniform cells.
    pub fn for_tissue(tissue: &Tissue, motion: Option<&Motion>) -> BlockMesh {
        let h = tissue.cell_size;
        let half = tissue.size * 0.5;
        let Some(motion) = motion else {
            return BlockMesh {
                lines: [
                    uniform_lines(-half.x, half.x, h),
                    uniform_lines(-half.y, half.y, h),
                    uniform_lines(-tissue.size.z, 0.0, h),
                ],
            };
        };
        let end = motion.deepest_point_in(tissue.size.z);
        let lateral = |axis: usize| {
            let entry = motion.entry[axis];
            let zone = [entry.min(end[axis]) - tissue.fine_radius, entry.max(end[axis]) + tissue.fine_radius];
            let anchor = entry - tissue.axis_offset_cells[axis] * h;
            graded_lines([-half[axis], half[axis]], zone, anchor, h, tissue.growth)
        };
        BlockMesh {
            lines: [lateral(0), lateral(1), depth_lines(tissue.size.z, -end.z + FINE_BELOW_PATH, h, tissue.growth)],
        }
    }
}

/// Uniform lines from `low` to `high` with an edge as close to `h` as whole cells allow.
fn uniform_lines(low: f64, high: f64, h: f64) -> Vec<f64> {
    let count = ((high - low) / h).round().max(1.0) as usize;
    let mut lines: Vec<f64> = (0..count).map(|k| low + (high - low) * k as f64 / count as f64).collect();
    lines.push(high);
    lines
}

/// Lines over `block` with edges `h` in `zone` on the raster `anchor + k h`, growing outside it.
fn graded_lines(block: [f64; 2], zone: [f64; 2], anchor: f64, h: f64, growth: f64) -> Vec<f64> {
    let inside = |x: f64| (x - anchor) / h;
    // A line may touch a face; the tolerance keeps one that misses it by rounding.
    let first = inside(zone[0]).round().max((inside(block[0]) - 1e-9).ceil());
    let last = inside(zone[1]).round().min((inside(block[1]) + 1e-9).floor());
    let below = series_to_face(|give_up| first + give_up - inside(block[0]), growth);
    let above = series_to_face(|give_up| inside(block[1]) - (last - give_up), growth);
    let (Some((first_up, below)), Some((last_down, above))) = (below, above) else {
        return uniform_lines(block[0], block[1], h);
    };
    let (first, last) = (first as i64 + first_up as i64, last as i64 - last_down as i64);
    if last <= first {
        return uniform_lines(block[0], block[1], h);
    }
    let mut lines = Vec::new();
    let mut x = anchor + first as f64 * h;
    for edge in &below {
        x -= edge * h;
        lines.push(x);
    }
    lines.reverse();
    lines.extend((first..=last).map(|k| anchor + k as f64 * h));
    let mut x = anchor + last as f64 * h;
    for edge in &above {
        x += edge * h;
        lines.push(x);
    }
    // The faces exactly, whatever rounding did.
    let end = lines.len() - 1;
    lines[0] = block[0];
    lines[end] = block[1];
    lines
}

/// Lines from `-size` to 0: uniform to `fine_depth` below the top, growing below it where the block is much deeper.
fn depth_lines(size: f64, fine_depth: f64, h: f64, growth: f64) -> Vec<f64> {
    let fine = (fine_depth / h).ceil();
    if size - fine * h < 2.0 * h {
        return uniform_lines(-size, 0.0, h);
    }
    let Some((give_up, edges)) = series_to_face(|give_up| size / h - (fine - give_up), growth) else {
        return uniform_lines(-size, 0.0, h);
    };
    let fine = fine as usize - give_up;
    let mut lines: Vec<f64> = (0..=fine).map(|k| -(k as f64) * h).collect();
    let mut z = -(fine as f64) * h;
    for edge in &edges {
        z -= edge * h;
        lines.push(z);
    }
    let end = lines.len() - 1;
    lines[end] = -size;
    lines[0] = 0.0;
    lines.reverse();
    lines
}

/// Edges (in units of the fine edge) of a geometric series that fills the distance to a face, and the number of fine
/// lines given up for it. `distance(n)`: distance in fine edges when n lines are given up.
fn series_to_face(distance: impl Fn(f64) -> f64, growth: f64) -> Option<(usize, Vec<f64>)> {
    (0..=LINES_TO_GIVE_UP)
        .find_map(|give_up| series_edges(distance(give_up as f64), growth).map(|edges| (give_up, edges)))
}

/// Edges `r, r^2, .., r^n` that sum to `distance`; `None` where every such series has a bad shape.
fn series_edges(distance: f64, growth: f64) -> Option<Vec<f64>> {
    if distance.abs() < 1e-6 {
        return Some(Vec::new());
    }
    let largest_ratio = FITTED_OVER_WANTED_GROWTH * growth;
    let sum = |ratio: f64, count: i32| (1..=count).map(|i| ratio.powi(i)).sum::<f64>();
    let count = (1..).find(|&count| sum(largest_ratio, count) >= distance)?;
    let (mut low, mut high) = (0.0, largest_ratio);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if sum(middle, count) < distance {
            low = middle;
        } else {
            high = middle;
        }
    }
    let ratio = 0.5 * (low + high);
    let smallest = ratio.min(ratio.powi(count));
    // The factor 1.3 over the wanted growth also bounds a step down in size.
    let good = smallest >= SMALLEST_EDGE && ratio >= 1.0 / (1.3 * growth);
    good.then(|| (1..=count).map(|i| ratio.powi(i)).collect())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::Phase;

    fn tissue(size: [f64; 3], cell: f64, growth: f64) -> Tissue {
        Tissue {
            size: DVec3::from(size) * 1e-3,
            cell_size: cell * 1e-3,
            fine_radius: 2.5e-3,
            growth,
            axis_offset_cells: [0.23, 0.31],
        }
    }

    fn motion(entry: [f64; 2], direction: DVec3, depth: f64) -> Motion {
        Motion {
            entry: DVec3::new(entry[0] * 1e-3, entry[1] * 1e-3, 0.0),
            direction: direction.normalize(),
            phases: vec![Phase::Insert { speed: 2e-3, depth: depth * 1e-3 }],
        }
    }

    fn edges(lines: &[f64]) -> Vec<f64> {
        lines.windows(2).map(|w| w[1] - w[0]).collect()
    }

    /// Exact faces, ascending lines, no small cell, bounded ratio.
    fn assert_shape(mesh: &BlockMesh, tissue: &Tissue) {
        let low = [-0.5 * tissue.size.x, -0.5 * tissue.size.y, -tissue.size.z];
        let high = [0.5 * tissue.size.x, 0.5 * tissue.size.y, 0.0];
        for axis in 0..3 {
            let lines = &mesh.lines[axis];
            assert_eq!((lines[0], *lines.last().unwrap()), (low[axis], high[axis]));
            let edges = edges(lines);
            for pair in edges.windows(2) {
                let ratio = (pair[1] / pair[0]).max(pair[0] / pair[1]);
                assert!(ratio <= tissue.growth * 1.3 + 1e-9, "axis {axis}: ratio {ratio} in {edges:?}");
            }
            let smallest = edges.iter().cloned().fold(f64::INFINITY, f64::min);
            assert!(smallest >= 0.7 * tissue.cell_size - 1e-12, "axis {axis}: {edges:?}");
        }
    }

    #[test]
    fn the_block_of_the_trials_has_their_cell_count() {
        let tissue = tissue([20.0, 20.0, 16.0], 0.8, 1.25);
        let mesh = BlockMesh::for_tissue(&tissue, Some(&motion([0.0, 0.0], DVec3::NEG_Z, 12.0)));
        assert_shape(&mesh, &tissue);
        // 14 x 14 x 20 in the puncture trials.
        assert_eq!(mesh.cells(), [14, 14, 20]);
    }

    #[test]
    fn the_axis_lies_between_grid_lines_and_the_fine_zone_is_uniform() {
        let tissue = tissue([20.0, 20.0, 16.0], 0.6, 1.25);
        let mesh = BlockMesh::for_tissue(&tissue, Some(&motion([0.7, -0.4], DVec3::NEG_Z, 12.0)));
        for (axis, entry) in [(0, 0.7e-3), (1, -0.4e-3)] {
            let lines = &mesh.lines[axis];
            let below = lines.iter().rposition(|x| *x <= entry).unwrap();
            let offset = (entry - lines[below]) / (lines[below + 1] - lines[below]);
            assert!((offset - tissue.axis_offset_cells[axis]).abs() < 1e-6);
            for pair in lines.windows(2) {
                let middle = 0.5 * (pair[0] + pair[1]);
                if (middle - entry).abs() < tissue.fine_radius - 0.5 * tissue.cell_size {
                    assert!(((pair[1] - pair[0]) / tissue.cell_size - 1.0).abs() < 0.1);
                }
            }
        }
    }

    #[test]
    fn every_position_growth_and_size_gives_a_good_shape() {
        for growth in [1.0, 1.1, 1.25, 1.5] {
            for step in 0..60 {
                let x = -9.0 + 0.3 * step as f64;
                for cell in [0.4, 0.6, 0.83] {
                    let tissue = tissue([20.0, 23.7, 30.0 + 0.37 * step as f64], cell, growth);
                    let slanted = DVec3::new(if x > 0.0 { -0.4 } else { 0.4 }, 0.3, -1.0);
                    let mesh = BlockMesh::for_tissue(&tissue, Some(&motion([x, 0.0], slanted, 8.0)));
                    assert_shape(&mesh, &tissue);
                }
            }
        }
    }

    #[test]
    fn a_deep_block_grows_below_the_path() {
        let tissue = tissue([20.0, 20.0, 40.0], 0.6, 1.25);
        let mesh = BlockMesh::for_tissue(&tissue, Some(&motion([0.0, 0.0], DVec3::NEG_Z, 10.0)));
        assert_shape(&mesh, &tissue);
        assert!(mesh.cells()[2] < 40);
    }

    #[test]
    fn without_a_tool_all_cells_are_equal() {
        let tissue = tissue([20.0, 10.0, 20.0], 2.0, 1.25);
        assert_eq!(BlockMesh::for_tissue(&tissue, None).cells(), [10, 5, 10]);
    }
}
