//! The planned straight path of a needle through a mesh of tetrahedra: its lines, its cells, the nodes that it touches.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use super::puncture::Way;
use super::{ContactNode, Model, PathCell, PuncturePlan, TipAnchor};
use crate::effects::puncture::{self, SchemeWord};
use crate::mesh::tets::lattice;
use crate::mesh::{Mesh, TetLine, TetMesh, TetPath};
use crate::needle::path_line::PathLine;
use crate::needle::{NeedleShape, PlannedPath, disc_lines, tip_lines};

/// Points per edge of the cube that is folded into a tetrahedron to ask where the path passes; 816 of them differ.
const SAMPLES: usize = 16;

/// How far the tip may be ahead of the needle, since tissue moves towards it, in cells.
const CELLS_AHEAD: f64 = 2.0;

impl Model {
    /// Plans the path in a mesh from the entry point of the scene, a point of its surface. Where the needle does not meet the mesh, which
    /// scene files are refused for, it has no effect.
    pub(super) fn plan_puncture_of_tets(&mut self, params: puncture::Params, needle: NeedleShape) {
        let Mesh::Tets(mesh) = &self.mesh else { return };
        let motion = &self.scene.motion;
        let opening = params.scheme == SchemeWord::Opening;
        let offsets: Vec<DVec3> = match params.scheme {
            SchemeWord::Opening => disc_lines(motion.direction, needle.radius).collect(),
            SchemeWord::Ring => tip_lines(motion.direction, needle.radius, 0.0, true),
        };
        let Ok(way) = TetPath::new(mesh, motion.entry, motion.direction, &offsets) else {
            // The needle passes by, and touches nothing.
            let effects = &mut self.effects;
            (effects.puncture, effects.friction, effects.adhesion) = (None, None, None);
            return;
        };
        let (path, deepest) = (PlannedPath { entry: motion.entry, ..way.path }, motion.deepest());
        let exit = way.axis.end;
        let last = deepest + CELLS_AHEAD * self.scene.tissue.cell_size;
        let carriers: HashSet<u32> = reached(&way.lines, last).flat_map(|piece| piece.nodes).collect();
        let volumes = self.node_volumes();
        let touched = |node: usize| {
            let (r0, s0) = path.material_coordinates(mesh.positions[node]);
            // What lies before the surface is another part of the body, which the needle has passed by.
            let beside = s0 > -2.0 * params.ring_radius && s0 < deepest;
            let pushed = beside && params.ring_weight(r0) > 0.0;
            // Before the puncture the tip has passed no node, also none that stands out of the plane of the surface.
            let carrier = ContactNode::carrier(node, r0, s0.max(0.0), volumes[node]);
            let stands = self.composition.held.get(node).is_some_and(|held| *held);
            let takes_part = !stands && (pushed || carriers.contains(&(node as u32)));
            takes_part.then_some(ContactNode { pushed, ..carrier })
        };
        let contact_nodes = (0..mesh.positions.len()).filter_map(touched).collect();
        let region_at = |depth: f64| {
            let tag = &mesh.regions[mesh.tags[way.axis.piece(depth).cell as usize] as usize];
            self.scene.region_in(path.entry + path.direction * depth, Some(tag))
        };
        let segments = self.path_segments(&params, &needle, exit, region_at);
        let anchor = |(offset, axial_offset): (&DVec3, &f64)| TipAnchor {
            surface: path.entry + *offset + path.direction * *axial_offset,
            axial_offset: *axial_offset,
        };
        let anchors = offsets.iter().zip(&way.offsets).map(anchor).collect();
        let cells = path_cells(mesh, &path, &params, deepest);
        let plan = self.puncture_plan(params, needle, path, Way { segments, anchors, lines: way.lines, exit, cells });
        self.contact_nodes = contact_nodes;
        self.puncture = Some(plan);
        if opening {
            let into = -path.direction.dot(path.normal);
            let tilt = (path.normal + path.direction * into).length() / into;
            let line = PathLine::straight(path.entry, path.direction);
            self.plan_opening(&line, deepest.min(exit), tilt);
        }
    }
}

/// Pieces of the lines that begin before the coordinate `last` [m].
fn reached(lines: &[TetLine], last: f64) -> impl Iterator<Item = &crate::mesh::tet_line::LinePiece> {
    lines.iter().flat_map(move |line| line.pieces.iter().take_while(move |piece| piece.start < last))
}

impl PuncturePlan {
    /// Largest difference between the coordinate of the tip in a mesh of tetrahedra and that of a node that carries an anchor [m].
    pub fn anchor_reach(&self, mesh: &TetMesh) -> f64 {
        let mut reach: f64 = 0.0;
        for line in &self.lines {
            let ends = line.pieces.iter().skip(1).map(|piece| piece.start).chain([line.end]);
            for (piece, end) in line.pieces.iter().zip(ends) {
                for node in piece.nodes {
                    let s0 = self.path.material_coordinates(mesh.positions[node as usize]).1.max(0.0);
                    reach = reach.max((s0 - piece.start).abs()).max((s0 - end).abs());
                }
            }
        }
        reach
    }
}

/// Largest part of the tip springs that one node carries while the anchors are in the first cells of the path, of the edge `h` [m].
pub(super) fn largest_spring_share(plan: &PuncturePlan, h: f64) -> f64 {
    let mut largest: f64 = 0.0;
    for part in 0..8 {
        let mut shares: HashMap<u32, f64> = HashMap::new();
        for line in &plan.lines {
            let (nodes, weights, _) = line.weights(h * f64::from(part) / 4.0);
            for (node, weight) in nodes.into_iter().zip(weights) {
                *shares.entry(node).or_default() += weight / plan.lines.len() as f64;
            }
        }
        largest = shares.values().fold(largest, |a, b| a.max(*b));
    }
    largest
}

/// Tetrahedra that lie partly within a0 of the path, with the volume fraction found from sample points.
fn path_cells(mesh: &TetMesh, path: &PlannedPath, params: &puncture::Params, deepest: f64) -> Vec<PathCell> {
    let radius = params.softened_radius;
    let lattice = lattice(SAMPLES);
    let near = mesh.near_line(path.entry, path.direction, radius);
    let passed = near.into_iter().filter_map(|cell| {
        let corners = mesh.corners(cell as usize);
        let (mut inside, mut start, mut end) = (0.0, f64::INFINITY, f64::NEG_INFINITY);
        for (weights, part) in &lattice {
            let x: DVec3 = corners.iter().zip(weights).map(|(x, w)| *x * *w).sum();
            let (r0, s0) = path.material_coordinates(x);
            if r0 < radius && s0 > -params.ring_radius {
                inside += part;
                start = start.min(s0);
                end = end.max(s0);
            }
        }
        (inside > 0.0 && start < deepest).then(|| PathCell {
            cell,
            left: params.stiffness_left(inside),
            axial_start: start,
            axial_end: end,
        })
    });
    passed.collect()
}
