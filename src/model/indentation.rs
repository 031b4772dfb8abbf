//! What the effect `indentation` prepares: contact of the surface with an indenter.
//!
//! The surface of a block is its top face, in a label map the skin over the columns of its grid; that of tetrahedra are the triangles that
//! face the tool.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;

use super::{ContactNode, Model};
use crate::anatomy::Case;
use crate::effects::indentation;
use crate::mesh::{BlockMesh, Mesh, TetMesh};
use crate::needle::Tool;
use crate::needle::slit::NodeFaces;

/// How far outside of the skin a node may lie that carries it, in parts of its cell: that cell is filled to three quarters. Nodes of
/// cells that are filled less are too light to be pressed.
const OUTSIDE: f64 = 0.25;

impl Model {
    pub(super) fn plan_indentation(&mut self) {
        let (radius, params) = match (self.effects.indentation, &self.scene.tool) {
            (Some(params), Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. })) => (*radius, params),
            _ => return,
        };
        let h = self.scene.tissue.cell_size;
        let modulus = self.scene.material.law.p_wave_modulus();
        self.indentation = Some(indentation::Plan::new(&params, modulus, self.scaled_density(), h));
        // Tissue is drawn in from the sides as the tool goes down.
        let reach = 1.5 * radius + 0.5 * self.scene.motion.deepest().max(0.0) + h;
        self.contact_nodes = match &self.mesh {
            Mesh::Block(block) => self.under_the_tool(block, reach),
            Mesh::Tets(tets) => self.facing_the_tool(tets, reach),
        };
    }

    /// Contact nodes of the top of a block, with the faces between them, nearer to the axis of the tool than `reach` [m].
    fn under_the_tool(&self, mesh: &BlockMesh, reach: f64) -> Vec<ContactNode> {
        let entry = self.scene.motion.entry;
        let [nx, ny, nz] = mesh.nodes();
        let near = |i: usize, j: usize| {
            let lateral = mesh.rest_position(mesh.node_index(i, j, nz - 1)) - entry;
            Some(lateral.truncate().length()).filter(|r0| *r0 < reach)
        };
        let carried = |i: usize, j: usize| match &self.scene.case {
            Some(case) => self.skin_in_column(mesh, case, i, j),
            None => Some((mesh.node_index(i, j, nz - 1), DVec3::ZERO)),
        };
        let columns = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
        let mut nodes: Vec<_> = columns
            .filter_map(|(i, j)| {
                let r0 = near(i, j)?;
                let (node, offset) = carried(i, j)?;
                Some((node, (i, j), r0, offset))
            })
            .collect();
        nodes.sort_by_key(|(node, ..)| *node);
        let index: HashMap<(usize, usize), u32> = (0..).zip(&nodes).map(|(n, (_, column, ..))| (*column, n)).collect();
        let place = |n: u32| {
            let (node, _, _, offset) = nodes[n as usize];
            mesh.rest_position(node) + offset
        };
        let width = |lines: &[f64], n: usize, side: usize| lines[n + side] - lines[n + side - 1];
        nodes
            .iter()
            .map(|&(node, (i, j), r0, offset)| {
                let own = index[&(i, j)];
                let at = |p: usize, q: usize| index.get(&((i + p).checked_sub(1)?, (j + q).checked_sub(1)?)).copied();
                let places = (0..9).filter(|p| *p != 4).map(|p| at(p % 3, p / 3).unwrap_or(own));
                let mut faces = NodeFaces { ring: [own; 8], present: 0 };
                faces.ring.iter_mut().zip(places).for_each(|(ring, place)| *ring = place);
                let mut area = 0.0;
                for (p, q) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let (Some(first), Some(second), Some(_)) = (at(2 * p, 1), at(1, 2 * q), at(2 * p, 2 * q)) else {
                        continue;
                    };
                    faces.present |= 1 << (p + 2 * q);
                    area += 0.25
                        * match self.scene.case {
                            Some(_) => (place(first) - place(own)).cross(place(second) - place(own)).length(),
                            None => width(&mesh.lines[0], i, p) * width(&mesh.lines[1], j, q),
                        };
                }
                ContactNode { pushed: true, faces: Some(faces), offset, ..ContactNode::carrier(node, r0, 0.0, area) }
            })
            .collect()
    }

    /// The node that carries the skin over a column of the grid, and the way from there to the skin [m]: the highest one that tissue moves and
    /// that lies hardly outside.
    fn skin_in_column(&self, mesh: &BlockMesh, case: &Case, i: usize, j: usize) -> Option<(usize, DVec3)> {
        let lines = &mesh.lines[2];
        let foot = mesh.rest_position(mesh.node_index(i, j, 0));
        let skin = case.skin_over(foot.x, foot.y, lines[0]..=lines[lines.len() - 1])?;
        let (cell, _) = mesh.along(2, skin);
        let highest = skin + OUTSIDE * (lines[cell + 1] - lines[cell]);
        let below = lines.partition_point(|z| *z <= highest);
        let moves = |k: &usize| self.composition.held.get(mesh.node_index(i, j, *k)).is_none_or(|held| !*held);
        let k = (below.saturating_sub(2)..below).rev().find(moves)?;
        Some((mesh.node_index(i, j, k), DVec3::Z * (skin - lines[k])))
    }

    /// Contact nodes of the triangles that face the tool, nearer to its axis than `reach` [m].
    fn facing_the_tool(&self, mesh: &TetMesh, reach: f64) -> Vec<ContactNode> {
        /// Cosine to the axis beyond which a triangle is a side.
        const SIDE: f64 = 1e-3;
        let (entry, direction) = (self.scene.motion.entry, self.scene.motion.direction);
        let mut areas: BTreeMap<u32, f64> = BTreeMap::new();
        for triangle in mesh.surface() {
            let area = mesh.area_vector(triangle);
            if area.dot(direction) < -SIDE * area.length() {
                triangle.iter().for_each(|node| *areas.entry(*node).or_default() += area.length() / 3.0);
            }
        }
        let contact = |(node, area): (u32, f64)| {
            let lever = mesh.positions[node as usize] - entry;
            let s0 = lever.dot(direction);
            let r0 = (lever - direction * s0).length();
            let carrier = ContactNode::carrier(node as usize, r0, s0, area);
            (r0 < reach).then_some(ContactNode { pushed: true, ..carrier })
        };
        areas.into_iter().filter_map(contact).collect()
    }
}
