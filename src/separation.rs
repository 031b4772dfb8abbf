//! Faces that may separate: pairs of node copies with their areas, and the copies that stay tied.
//!
//! The mesh doubles a grid line where a surface lies. Of the edges between the two copies of its nodes those on the chosen
//! part of the surface become pairs; the others are ties: tied copies move as one node with the sum of their masses and
//! forces, at no cost in compliance or time step.

use glam::DVec3;

use crate::effects::cohesive::Plane;
use crate::mesh::BlockMesh;
use crate::needle::PlannedPath;

/// Two copies of a node that may part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FacePair {
    /// Nodes: `a` on the lower side of the doubled line, `b` on the upper one.
    pub nodes: [u32; 2],
    /// Axis of the doubled line.
    pub axis: usize,
    /// Rest area of the surface that the pair stands for [m^2].
    pub area: f64,
    /// Neighbours of `a` on the surface, along the next and the next but one axis: before and after; the normal is the cross
    /// product of the two ways, pointing from a to b.
    pub ring: [[u32; 2]; 2],
    /// It lies on a chosen plane.
    pub on_plane: bool,
    /// Where the tip drives it: rest coordinate s0 along the path [m].
    pub tip_driven: Option<f64>,
}

/// In [`Separation::tie_of`]: tied to nothing.
pub const NO_TIE: u32 = u32::MAX;

/// Which pairs exist, and what is tied.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Separation {
    pub pairs: Vec<FacePair>,
    /// Groups of tied copies, each ascending.
    pub ties: Vec<Vec<u32>>,
    /// Index into `ties` per node; [`NO_TIE`] for a node that is tied to nothing. Empty without doubled lines.
    pub tie_of: Vec<u32>,
}

/// What may separate around the path of a needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub path: PlannedPath,
    /// Copies within this distance of the path may part [m].
    pub reach: f64,
    /// Copies within this distance are driven by the tip [m].
    pub driven: f64,
    /// Material coordinate up to which copies may part [m].
    pub deepest: f64,
    /// The needle is hollow: the ring of the bore parts, not a slit.
    pub ring: bool,
    /// Distances from the path between which the needle opens planes that it passes [m].
    pub wall: [f64; 2],
}

impl Separation {
    /// Pairs and ties of a mesh. `planes` may separate everywhere; `cut`: the path.
    pub fn new(mesh: &BlockMesh, planes: &[Plane], cut: Option<&Cut>) -> Self {
        let gaps: Vec<Vec<usize>> = (0..3)
            .map(|a| (1..mesh.lines[a].len()).filter(|i| mesh.lines[a][*i] == mesh.lines[a][i - 1]).collect())
            .collect();
        if gaps.iter().all(|g| g.is_empty()) {
            return Separation::default();
        }
        let counts = mesh.nodes();
        let mut root: Vec<u32> = (0..mesh.node_count() as u32).collect();
        let mut pairs = Vec::new();
        for axis in 0..3 {
            let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
            for upper in &gaps[axis] {
                for (m, n) in (0..counts[c]).flat_map(|n| (0..counts[b]).map(move |m| (m, n))) {
                    let node = |i: usize, m: usize, n: usize| {
                        let mut at = [0; 3];
                        (at[axis], at[b], at[c]) = (i, m, n);
                        mesh.node_index(at[0], at[1], at[2]) as u32
                    };
                    let ends = [node(upper - 1, m, n), node(*upper, m, n)];
                    let place = mesh.rest_position(ends[0] as usize);
                    let plane = planes.iter().find(|p| p.axis == axis && mesh.lines[axis][*upper] == p.at);
                    let cut_here = cut.filter(|cut| cut.reaches(mesh, axis, ends, place));
                    let tip_driven = cut_here.and_then(|cut| {
                        let (r0, s0) = cut.path.material_coordinates(place);
                        (cut.ring || r0 < cut.driven).then_some(s0)
                    });
                    let passed = cut.filter(|_| plane.is_some_and(|p| p.tip_driven)).and_then(|cut| {
                        let (r0, s0) = cut.path.material_coordinates(place);
                        (cut.wall[0]..cut.wall[1]).contains(&r0).then_some(s0)
                    });
                    let tip_driven = tip_driven.or(passed);
                    if plane.is_none() && cut_here.is_none() {
                        join(&mut root, ends);
                        continue;
                    }
                    // The lower of the two copies of a circle lies outside on the low side of the axis.
                    let step = |i: usize, count: usize, line: &[f64]| {
                        let mut low = i.saturating_sub(1);
                        let mut high = (i + 1).min(count - 1);
                        // Over the gap of a crossing surface.
                        if line[low] == line[i] && low > 0 {
                            low -= 1;
                        }
                        if line[high] == line[i] && high + 1 < count {
                            high += 1;
                        }
                        [low, high]
                    };
                    let [m0, m1] = step(m, counts[b], &mesh.lines[b]);
                    let [n0, n1] = step(n, counts[c], &mesh.lines[c]);
                    let i = upper - 1;
                    pairs.push(FacePair {
                        nodes: ends,
                        axis,
                        area: tributary_area(mesh, axis, *upper, m, n),
                        ring: [[node(i, m0, n), node(i, m1, n)], [node(i, m, n0), node(i, m, n1)]],
                        on_plane: plane.is_some(),
                        tip_driven,
                    });
                }
            }
        }
        let (ties, tie_of) = groups(&mut root);
        Separation { pairs, ties, tie_of }
    }

    /// Copies that are tied to a node, itself among them; `None` where it is tied to nothing.
    pub fn tied(&self, node: usize) -> Option<&[u32]> {
        let tie = *self.tie_of.get(node)?;
        self.ties.get(tie as usize).map(|t| &t[..])
    }
}

impl Cut {
    fn reaches(&self, mesh: &BlockMesh, axis: usize, ends: [u32; 2], place: DVec3) -> bool {
        let (r0, s0) = self.path.material_coordinates(place);
        if s0 > self.deepest {
            return false;
        }
        if !self.ring {
            // The slit is the doubled line that holds the path.
            let along = place[axis] - self.path.entry[axis];
            return axis < 2 && along.abs() < 1e-9 && r0 < self.reach;
        }
        let Some(bore) = mesh.bore else { return false };
        // On the circle: the copy on the side of the axis lies on or within the ring of both other lines.
        let other = 1 - axis.min(1);
        let inner = ends.map(|n| mesh.node_coordinates(n as usize)).into_iter().find(|at| {
            let line = mesh.lines[axis][at[axis]];
            let centre = bore.centre[axis.min(1)];
            // The inner copy is the upper one below the axis and the lower one above it.
            let is_upper = at[axis] > 0 && mesh.lines[axis][at[axis] - 1] == line;
            if line < centre { is_upper } else { !is_upper }
        });
        let Some(at) = inner.filter(|_| axis < 2) else { return false };
        let lines = &mesh.lines[other];
        let across = lines[at[other]] - bore.centre[other];
        if across.abs() > bore.radius + 1e-9 {
            return false;
        }
        // At the corners of the ring only the inner copy of the crossing line belongs to the core.
        let on_corner = (across.abs() - bore.radius).abs() < 1e-9;
        let is_upper = at[other] > 0 && lines[at[other] - 1] == lines[at[other]];
        !on_corner || if across < 0.0 { is_upper } else { !is_upper }
    }
}

/// Area of the surface around a node copy: a quarter of every face that joins two cells with volume [m^2].
fn tributary_area(mesh: &BlockMesh, axis: usize, upper: usize, m: usize, n: usize) -> f64 {
    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
    let counts = mesh.nodes();
    let corner = |m: usize, n: usize| {
        let mut at = [0; 3];
        (at[axis], at[b], at[c]) = (upper, m, n);
        mesh.rest_position(mesh.node_index(at[0], at[1], at[2]))
    };
    let mut area = 0.0;
    for (dm, dn) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (Some(m0), Some(n0)) = ((m + dm).checked_sub(1), (n + dn).checked_sub(1)) else { continue };
        if m0 + 1 < counts[b] && n0 + 1 < counts[c] {
            let diagonals = [corner(m0 + 1, n0 + 1) - corner(m0, n0), corner(m0, n0 + 1) - corner(m0 + 1, n0)];
            area += 0.25 * 0.5 * diagonals[0].cross(diagonals[1]).length();
        }
    }
    area
}

fn find(root: &mut [u32], mut node: u32) -> u32 {
    while root[node as usize] != node {
        root[node as usize] = root[root[node as usize] as usize];
        node = root[node as usize];
    }
    node
}

fn join(root: &mut [u32], [a, b]: [u32; 2]) {
    let (a, b) = (find(root, a), find(root, b));
    root[a.max(b) as usize] = a.min(b);
}

/// Groups with more than one member, and the group of every node.
fn groups(root: &mut [u32]) -> (Vec<Vec<u32>>, Vec<u32>) {
    let mut members: std::collections::BTreeMap<u32, Vec<u32>> = Default::default();
    for node in 0..root.len() as u32 {
        members.entry(find(root, node)).or_default().push(node);
    }
    let mut tie_of = vec![NO_TIE; root.len()];
    let ties: Vec<Vec<u32>> = members.into_values().filter(|m| m.len() > 1).collect();
    for (tie, members) in ties.iter().enumerate() {
        members.iter().for_each(|n| tie_of[*n as usize] = tie as u32);
    }
    (ties, tie_of)
}
