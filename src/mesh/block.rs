//! The structured block and its grid lines: uniform around the planned path, growing towards the faces.
//!
//! In x and y the fine zone is the bounding box of the planned straight path, widened by `fine_radius` and rounded
//! to whole cells of edge `h`; the entry point lies `axis_offset_cells` of a cell above a grid line. Outside it the
//! edges form a geometric series whose ratio is fitted so that the block face is met exactly. In z the cells are
//! uniform down to 4 mm below the deepest point and grow further below. Without a tool all cells are uniform. Faces of layers
//! lie on lines (`BlockMesh::lay_on_faces`), or layers would be as thick as whole cells happen to be.
//!
//! Surfaces that may separate are grid lines that occur twice: between the two lies a sheet of flat cells without volume
//! (`is_gap`), whose corners are the two copies of each node. Copies that may not part are tied (see `separation`). Around
//! the axis of a hollow needle the lines can be bent so that one ring of them is a circle (`Bore`).

use glam::{DVec2, DVec3};

use crate::needle::Motion;

/// Corner signs (xi, eta, zeta) in the node order of `BlockMesh::cell_nodes`.
pub const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

/// Weights of the corners at a place of a cell, 0..1 per axis, and their gradients [1/m]; `width`: edges of the cell [m].
pub fn trilinear(local: DVec3, width: DVec3) -> ([f64; 8], [DVec3; 8]) {
    let (mut weights, mut gradients) = ([0.0; 8], [DVec3::ZERO; 8]);
    for (c, signs) in CORNERS.iter().enumerate() {
        let n: [f64; 3] = std::array::from_fn(|a| 0.5 + signs[a] * (local[a] - 0.5));
        weights[c] = n[0] * n[1] * n[2];
        gradients[c] = DVec3::from(*signs) / width * DVec3::new(n[1] * n[2], n[2] * n[0], n[0] * n[1]);
    }
    (weights, gradients)
}

/// The tissue block: `-size.x/2..size.x/2`, `-size.y/2..size.y/2`, `-size.z..top` [m]; the needle enters at z = 0, which is the top face
/// but where tissue from a label map rises beside it.
#[derive(Debug, Clone, PartialEq)]
pub struct Tissue {
    /// Edge lengths of the block, in z those below the entry point [m].
    pub size: DVec3,
    /// Height of the block above the entry point, whole cells [m]; 0 for all tissue but that of a label map.
    pub top: f64,
    /// Cell edge in the fine zone around the planned path [m].
    pub cell_size: f64,
    /// Half width of the fine zone around the path [m].
    pub fine_radius: f64,
    /// Ratio of neighbouring cell edges outside the fine zone, >= 1.
    pub growth: f64,
    /// Where the entry point lies between two grid lines, as a fraction of the cell (x, y); [0.0, 0.0] puts the axis
    /// on grid lines, [0.5, 0.5] on cell centres.
    pub axis_offset_cells: [f64; 2],
}

/// A rectilinear block of hexahedral cells: three lists of grid lines.
///
/// Node `(i, j, k)` has the index `(k * (ny + 1) + j) * (nx + 1) + i`, cell `(i, j, k)` the index
/// `(k * ny + j) * nx + i`; k grows upwards, the top face (z = 0) is the last plane.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockMesh {
    /// Grid lines per axis [m], ascending; a line that occurs twice may separate.
    pub lines: [Vec<f64>; 3],
    /// Bends the lines into circles around a vertical axis.
    pub bore: Option<Bore>,
    /// Cells in which nothing is, or what does not deform; no entries: there are none.
    pub empty: Vec<bool>,
}

/// A map of the xy plane that turns the square ring of grid lines at the distance `radius` from `centre` into a circle:
/// with `c` the larger of the two distances from the axis,
/// ```text
/// X = centre + (x, y) ((1 - b) + b c/|(x, y)|),  b = c/radius inside, (outer - c)/(outer - radius) outside, 0 beyond outer
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bore {
    /// Axis [m].
    pub centre: DVec2,
    /// Radius of the circle [m].
    pub radius: f64,
    /// Distance from the axis beyond which lines are straight [m].
    pub outer: f64,
}

impl Bore {
    /// Where a point of the square grid goes [m].
    pub fn map(&self, point: DVec2) -> DVec2 {
        let p = point - self.centre;
        let c = p.abs().max_element();
        let roundness = if c <= self.radius { c / self.radius } else { (self.outer - c) / (self.outer - self.radius) };
        let b = roundness.clamp(0.0, 1.0);
        let length = p.length();
        if length == 0.0 { point } else { self.centre + p * ((1.0 - b) + b * c / length) }
    }
}

impl BlockMesh {
    /// A rectilinear block.
    pub fn new(lines: [Vec<f64>; 3]) -> Self {
        BlockMesh { lines, bore: None, empty: Vec::new() }
    }

    /// True where the cell holds tissue that deforms: no gap, and not empty.
    pub fn is_tissue(&self, cell: usize) -> bool {
        !self.is_gap(cell) && !self.is_empty(cell)
    }

    /// True where nothing is in the cell, or what does not deform.
    pub fn is_empty(&self, cell: usize) -> bool {
        self.empty.get(cell).is_some_and(|empty| *empty)
    }

    /// True for a flat cell between the two copies of a line.
    pub fn is_gap(&self, cell: usize) -> bool {
        let c = self.cell_coordinates(cell);
        (0..3).any(|a| self.lines[a][c[a] + 1] == self.lines[a][c[a]])
    }

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
        let square = DVec2::new(self.lines[0][i], self.lines[1][j]);
        self.bore.map_or(square, |bore| bore.map(square)).extend(self.lines[2][k])
    }

    /// Longest edges around a node, along each axis [m].
    pub fn edges_around(&self, node: usize) -> DVec3 {
        let c = self.node_coordinates(node);
        DVec3::from_array(std::array::from_fn(|a| {
            let lines = &self.lines[a][c[a].saturating_sub(1)..(c[a] + 2).min(self.lines[a].len())];
            lines.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max)
        }))
    }

    /// Edge lengths of a cell between its grid lines [m].
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

    /// The cell that holds a point of the block (or the nearest one) and the place in it, 0..1 per axis. Never a gap: a
    /// point on a doubled line belongs to the cell above it.
    pub fn locate(&self, x: DVec3) -> ([usize; 3], DVec3) {
        let (([i, j], local), (k, zeta)) = (self.column(x.truncate()), self.along(2, x.z));
        ([i, j, k], local.extend(zeta))
    }

    /// The cells between two lines of an axis that hold the coordinate `x` [m], and the place between the lines, 0..1.
    pub fn along(&self, axis: usize, x: f64) -> (usize, f64) {
        let lines = &self.lines[axis];
        let i = lines.partition_point(|l| *l <= x).clamp(1, lines.len() - 1) - 1;
        (i, ((x - lines[i]) / (lines[i + 1] - lines[i])).clamp(0.0, 1.0))
    }

    /// The column of cells that holds a point of the plane, as [`BlockMesh::locate`] finds it, and the place in it, 0..1 per axis.
    pub fn column(&self, x: DVec2) -> ([usize; 2], DVec2) {
        let Some(bore) = self.bore else {
            let ((i, xi), (j, eta)) = (self.along(0, x.x), self.along(1, x.y));
            return ([i, j], DVec2::new(xi, eta));
        };
        // The map keeps directions: bisect the distance along the ray from the axis.
        let p = x - bore.centre;
        let reach = p.length();
        let ray = if reach > 0.0 { p / reach } else { DVec2::X };
        let (mut low, mut high) = (0.0, 2.0 * reach);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if (bore.map(bore.centre + ray * middle) - bore.centre).length() < reach {
                low = middle;
            } else {
                high = middle;
            }
        }
        let square = bore.centre + ray * (0.5 * (low + high));
        let ((i, xi), (j, eta)) = (self.along(0, square.x), self.along(1, square.y));
        // The cell is bilinear between its corners, the map is not.
        let local = self.place_in_column([i, j], x, DVec2::new(xi, eta));
        ([i, j], local.clamp(DVec2::ZERO, DVec2::ONE))
    }

    /// As [`BlockMesh::locate`], but where the grid is bent the cell whose straight sides hold the point: between a circle and
    /// its chord that is the neighbour.
    pub fn locate_exactly(&self, x: DVec3) -> ([usize; 3], DVec3) {
        let ([i, j, k], local) = self.locate(x);
        if self.bore.is_none() {
            return ([i, j, k], local);
        }
        let flat = x.truncate();
        // Two columns to either side: one of them may be a gap.
        let near = |a: usize, at: usize| at.saturating_sub(2)..(at + 3).min(self.cells()[a]);
        let columns = near(1, j).flat_map(|j| near(0, i).map(move |i| [i, j]));
        let neighbours = columns.filter(|[i, j]| !self.is_gap(self.cell_index(*i, *j, k))).map(|column| {
            let place = self.place_in_column(column, flat, DVec2::splat(0.5));
            (column, place.clamp(DVec2::ZERO, DVec2::ONE))
        });
        let miss = |column: [usize; 2], place: DVec2| bilinear(self.column_corners(column), place).distance(flat);
        let places = std::iter::once(([i, j], local.truncate())).chain(neighbours);
        let best =
            places.map(|(column, place)| (miss(column, place), column, place)).min_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(([i, j, k], local), |(_, [i, j], place)| ([i, j, k], place.extend(local.z)))
    }

    /// Corners of a column of cells, counter-clockwise [m].
    fn column_corners(&self, [i, j]: [usize; 2]) -> [DVec2; 4] {
        let corner = |di: usize, dj: usize| self.rest_position(self.node_index(i + di, j + dj, 0)).truncate();
        [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
    }

    /// Where a point lies between the corners of a column of cells, 0..1 per axis inside it: Newton's iteration from `start`.
    fn place_in_column(&self, column: [usize; 2], x: DVec2, start: DVec2) -> DVec2 {
        let [a, b, c, d] = self.column_corners(column);
        let mut local = start;
        for _ in 0..20 {
            let (u, v) = (local.x, local.y);
            let along_u = (b - a) * (1.0 - v) + (c - d) * v;
            let along_v = (d - a) * (1.0 - u) + (c - b) * u;
            let miss = x - bilinear([a, b, c, d], local);
            let det = along_u.perp_dot(along_v);
            local += DVec2::new(miss.perp_dot(along_v), along_u.perp_dot(miss)) / det;
        }
        local
    }

    /// Tributary volume of a node, an eighth of every cell around it, where all lines are straight [m^3].
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

/// The point at the place `local`, 0..1 per axis, between four corners.
fn bilinear([a, b, c, d]: [DVec2; 4], local: DVec2) -> DVec2 {
    let (u, v) = (local.x, local.y);
    a * ((1.0 - u) * (1.0 - v)) + b * (u * (1.0 - v)) + c * (u * v) + d * ((1.0 - u) * v)
}

/// Largest fitted ratio over the wanted one. A ratio fitted upwards saves one layer of cells per side.
const FITTED_OVER_WANTED_GROWTH: f64 = 1.12;

/// Smallest edge of a graded cell over the fine edge; a smaller one would cut the stable time step.
const SMALLEST_EDGE: f64 = 0.7;

/// What passes for a place on a line, in edges.
const ON_LINE: f64 = 1e-6;

/// Uniform depth kept below the deepest point of the path [m].
const FINE_BELOW_PATH: f64 = 4.0e-3;

/// Uniform height kept above the entry point, where tissue rises beside it [m].
const FINE_ABOVE_ENTRY: f64 = 3.0e-3;

/// Half width of the slit before a solid needle, in needle radii. A slit as wide as the needle has to stretch by half of its
/// length to lie around it.
pub const SLIT_HALF_WIDTH: f64 = 1.2;

/// Fine lines that may be given up at one side to make room for a well-shaped series.
const LINES_TO_GIVE_UP: usize = 3;

impl BlockMesh {
    /// Moves the nearest inner line of an axis to `at` [m] and doubles it.
    pub fn split(&mut self, axis: usize, at: f64) {
        let lines = &mut self.lines[axis];
        let inner = 1..lines.len() - 1;
        let nearest = inner.min_by(|a, b| (lines[*a] - at).abs().total_cmp(&(lines[*b] - at).abs()));
        if let Some(i) = nearest {
            lines[i] = at;
            lines.insert(i, at);
        }
    }

    /// Lays a line of an axis on each of the planes `faces` [m] but where that leaves an edge below 0.7 of those around it, of two faces
    /// the one that is written first; the lines between two faces keep their number and their grading.
    pub fn lay_on_faces(&mut self, axis: usize, faces: &[f64]) {
        let old = &self.lines[axis];
        let last = old.len() - 1;
        // A place among the lines, whole on a line.
        let index = |x: f64| {
            let i = old.partition_point(|line| *line <= x).clamp(1, last) - 1;
            let i = i as f64 + (x - old[i]) / (old[i + 1] - old[i]);
            if (i - i.round()).abs() < ON_LINE { i.round() } else { i }
        };
        let mut held: Vec<(f64, f64)> = vec![(0.0, old[0]), (last as f64, old[last])];
        for face in faces.iter().filter(|face| **face > old[0] && **face < old[last]) {
            let at = index(*face);
            if held.iter().all(|(other, _)| (at - other).abs() >= SMALLEST_EDGE) {
                held.push((at, if at.fract() == 0.0 { old[at as usize] } else { *face }));
            }
        }
        held.sort_by(|a, b| a.0.total_cmp(&b.0));
        let between = |i: f64| {
            let line = (i as usize).min(last - 1);
            if i.fract() == 0.0 { old[i as usize] } else { old[line] + i.fract() * (old[line + 1] - old[line]) }
        };
        let mut lines = Vec::with_capacity(old.len());
        for pair in held.windows(2) {
            let [(from, x), (to, _)] = [pair[0], pair[1]];
            let count = (to - from).round().max(1.0);
            lines.push(x);
            lines.extend((1..count as usize).map(|k| between(from + (to - from) * k as f64 / count)));
        }
        lines.push(old[last]);
        self.lines[axis] = lines;
    }

    /// Whether a plane across an axis lies on a line, or outside the block.
    pub fn has_line(&self, axis: usize, at: f64) -> bool {
        let lines = &self.lines[axis];
        let near = |line: &f64| (line - at).abs() <= ON_LINE * self.smallest_edge_along(axis);
        at < lines[0] || at > lines[lines.len() - 1] || lines.iter().any(near)
    }

    fn smallest_edge_along(&self, axis: usize) -> f64 {
        self.lines[axis]
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .filter(|edge| *edge > 0.0)
            .fold(f64::INFINITY, f64::min)
    }

    /// The grid of a block, fine around the path of `motion`; `None`: uniform cells.
    pub fn for_tissue(tissue: &Tissue, motion: Option<&Motion>) -> BlockMesh {
        let h = tissue.cell_size;
        let half = tissue.size * 0.5;
        let Some(motion) = motion else {
            return BlockMesh::new([
                uniform_lines(-half.x, half.x, h),
                uniform_lines(-half.y, half.y, h),
                with_top(uniform_lines(-tissue.size.z, 0.0, h), tissue),
            ]);
        };
        let (low, high) = motion.reach(tissue.size.z);
        let lateral = |axis: usize| {
            let entry = motion.entry[axis];
            let zone = [low[axis] - tissue.fine_radius, high[axis] + tissue.fine_radius];
            let anchor = entry - tissue.axis_offset_cells[axis] * h;
            graded_lines([-half[axis], half[axis]], zone, anchor, h, tissue.growth)
        };
        let down = depth_lines(tissue.size.z, -low.z + FINE_BELOW_PATH, h, tissue.growth);
        BlockMesh::new([lateral(0), lateral(1), with_top(down, tissue)])
    }
}

/// The lines of the depth and those above the entry point.
fn with_top(mut lines: Vec<f64>, tissue: &Tissue) -> Vec<f64> {
    let h = tissue.cell_size;
    let above = (tissue.top / h).round();
    let fine = (FINE_ABOVE_ENTRY / h).ceil().min(above);
    let (give_up, edges) = series_to_face(|give_up| above - (fine - give_up), tissue.growth)
        .filter(|(give_up, _)| *give_up as f64 <= fine)
        .unwrap_or_else(|| (0, vec![1.0; (above - fine) as usize]));
    let fine = fine as usize - give_up;
    lines.extend((1..=fine).map(|k| k as f64 * h));
    let mut z = fine as f64 * h;
    lines.extend(edges.iter().map(|edge| {
        z += edge * h;
        z
    }));
    if let (true, Some(last)) = (above > 0.0, lines.last_mut()) {
        *last = above * h;
    }
    lines
}

/// Lines of a whole axis around `centre`, one of them there and two at the distance `radius` from it.
pub fn lines_around(centre: f64, radius: f64, tissue: &Tissue, axis: usize, least: usize) -> Vec<f64> {
    let half = 0.5 * tissue.size[axis];
    let side = |face: f64| side_lines(face, radius, tissue, least);
    let mut lines: Vec<f64> = side(half + centre).iter().rev().map(|d| centre - d).collect();
    lines.push(centre);
    lines.extend(side(half - centre).iter().map(|d| centre + d));
    let end = lines.len() - 1;
    (lines[0], lines[end]) = (-half, half);
    lines
}

/// Distances of grid lines from the axis of a bore up to a face: whole cells within the radius, edges `h` to the end of
/// the fine zone, growing beyond.
fn side_lines(face: f64, radius: f64, tissue: &Tissue, least: usize) -> Vec<f64> {
    let (fine_radius, h, growth) = (tissue.fine_radius, tissue.cell_size, tissue.growth);
    let inner = ((radius / h).round() as usize).max(least);
    let mut lines: Vec<f64> = (1..=inner).map(|k| radius * k as f64 / inner as f64).collect();
    let left = (face - radius) / h;
    let fine = ((fine_radius - radius) / h).round().clamp(1.0, left.floor().max(1.0));
    match series_to_face(|give_up| left - (fine - give_up), growth) {
        Some((give_up, edges)) => {
            let fine = fine as usize - give_up.min(fine as usize);
            lines.extend((1..=fine).map(|k| radius + k as f64 * h));
            let mut at = radius + fine as f64 * h;
            for edge in edges {
                at += edge * h;
                lines.push(at);
            }
        }
        None => {
            let count = left.round().max(1.0) as usize;
            lines.extend((1..=count).map(|k| radius + (face - radius) * k as f64 / count as f64));
        }
    }
    lines
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
    use super::*;
    use crate::needle::Phase;

    fn tissue(size: [f64; 3], cell: f64, growth: f64) -> Tissue {
        Tissue {
            size: DVec3::from(size) * 1e-3,
            cell_size: cell * 1e-3,
            top: 0.0,
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
            vibration: None,
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
    fn faces_of_layers_lie_on_lines() {
        let tissue = tissue([20.0, 20.0, 16.0], 0.65, 1.45);
        let plain = BlockMesh::for_tissue(&tissue, Some(&motion([0.0, 0.0], DVec3::NEG_Z, 6.3)));
        let mut mesh = plain.clone();
        let faces = [0.0, -1.0, -4.0, -5.0, -7.0, -8.0].map(|z| z * 1e-3);
        mesh.lay_on_faces(2, &faces);
        assert!(faces.iter().all(|face| mesh.has_line(2, *face)));
        assert!(!plain.has_line(2, faces[1]));
        for edges in mesh.lines[2].windows(3).map(|w| [w[1] - w[0], w[2] - w[1]]) {
            assert!(edges.iter().all(|e| *e > 0.7 * 0.65e-3), "{edges:?}");
            assert!(edges[0] / edges[1] < 2.0 && edges[1] / edges[0] < 2.0, "{edges:?}");
        }
        // Cells below the last face grow as before.
        assert_eq!(mesh.lines[2][0], -16e-3);
        assert!((mesh.lines[2][1] - plain.lines[2][1]).abs() < 0.5e-3);
        // Lines that are there already stay, to the last bit.
        let mut same = plain.clone();
        same.lay_on_faces(2, &[plain.lines[2][10], plain.lines[2][12]]);
        assert_eq!(same, plain);
        // A face too close to one before it has no line.
        let mut thin = plain.clone();
        thin.lay_on_faces(2, &[-2e-3, -2.3e-3, -0.2e-3, -15.9e-3, -20e-3]);
        assert_eq!(
            [-2e-3, -2.3e-3, -0.2e-3, -15.9e-3, -20e-3].map(|z| thin.has_line(2, z)),
            [true, false, false, false, true]
        );
        assert_eq!(thin.cells()[2], plain.cells()[2]);
    }

    #[test]
    fn without_a_tool_all_cells_are_equal() {
        let tissue = tissue([20.0, 10.0, 20.0], 2.0, 1.25);
        assert_eq!(BlockMesh::for_tissue(&tissue, None).cells(), [10, 5, 10]);
    }
}
