//! What the effect `indentation` prepares: contact of the top face with an indenter.

use std::collections::HashMap;

use super::{ContactNode, Model};
use crate::effects::indentation;
use crate::needle::Tool;
use crate::needle::slit::NodeFaces;

impl Model {
    pub(super) fn plan_indentation(&mut self) {
        let (radius, params) = match (self.effects.indentation, &self.scene.tool) {
            (Some(params), Some(Tool::Sphere { radius } | Tool::FlatPunch { radius, .. })) => (*radius, params),
            _ => return,
        };
        let Some(mesh) = self.mesh.as_block() else { return };
        let h = self.scene.tissue.cell_size;
        let modulus = self.scene.material.law.p_wave_modulus();
        self.indentation = Some(indentation::Plan::new(&params, modulus, self.scaled_density(), h));
        let entry = self.scene.motion.entry;
        // Tissue is drawn in from the sides as the tool goes down.
        let reach = 1.5 * radius + 0.5 * self.scene.motion.deepest().max(0.0) + h;
        let [nx, ny, nz] = mesh.nodes();
        let near = |i: usize, j: usize| {
            let lateral = mesh.rest_position(mesh.node_index(i, j, nz - 1)) - entry;
            Some(lateral.truncate().length()).filter(|r0| *r0 < reach)
        };
        let mut nodes = Vec::new();
        let mut index = HashMap::new();
        for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
            if let Some(r0) = near(i, j) {
                index.insert((i, j), nodes.len() as u32);
                nodes.push((i, j, r0));
            }
        }
        self.contact_nodes = nodes
            .iter()
            .map(|&(i, j, r0)| {
                let own = index[&(i, j)];
                let at = |p: usize, q: usize| index.get(&((i + p).checked_sub(1)?, (j + q).checked_sub(1)?)).copied();
                let places = (0..9).filter(|p| *p != 4).map(|p| at(p % 3, p / 3).unwrap_or(own));
                let mut faces = NodeFaces { ring: [own; 8], present: 0 };
                faces.ring.iter_mut().zip(places).for_each(|(ring, place)| *ring = place);
                let width = |lines: &[f64], n: usize, side: usize| lines[n + side] - lines[n + side - 1];
                let mut area = 0.0;
                for (p, q) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    if [at(2 * p, 1), at(1, 2 * q), at(2 * p, 2 * q)].iter().all(Option::is_some) {
                        faces.present |= 1 << (p + 2 * q);
                        area += 0.25 * width(&mesh.lines[0], i, p) * width(&mesh.lines[1], j, q);
                    }
                }
                let node = mesh.node_index(i, j, nz - 1);
                ContactNode { pushed: true, faces: Some(faces), ..ContactNode::carrier(node, r0, 0.0, area) }
            })
            .collect();
    }
}
