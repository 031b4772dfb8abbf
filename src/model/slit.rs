//! Surfaces that separate before a needle: faces that may part, and the faces around their nodes.

use std::collections::{HashMap, HashSet};

use glam::DVec3;

use super::{ContactSurface, Model};
use crate::effects::cohesive;
use crate::mesh::block::SLIT_HALF_WIDTH;
use crate::needle::PlannedPath;
use crate::needle::slit::NodeFaces;
use crate::separation::{Cut, FacePair, Separation};

/// How far beyond the needle's sides a slit may tear [m].
const SLIT_MARGIN: f64 = 1.0e-3;

/// A corner of faces of a slit.
struct SlitNode {
    node: u32,
    side: DVec3,
    /// Nodes around and faces that are there, as in [`NodeFaces`].
    ring: Vec<u32>,
    present: u32,
}

impl Model {
    pub(super) fn plan_separation(&mut self) {
        let (Some(params), Some(mesh)) = (&self.effects.cohesive, self.mesh.as_block()) else { return };
        let h = self.scene.tissue.cell_size;
        let cut = self.planned_path().zip(self.scene.needle()).map(|(path, needle)| Cut {
            path,
            reach: needle.radius + SLIT_MARGIN,
            // The ends of the slit hold, as far as they can.
            driven: 0.99 * SLIT_HALF_WIDTH * needle.radius,
            deepest: self.scene.motion.deepest() + 2.0 * h,
            ring: needle.bore.is_some(),
            wall: [needle.bore.map_or(0.0, |b| b.edge), needle.radius],
        });
        self.separation = Separation::new(mesh, &params.planes, cut.as_ref());
        self.cohesion = Some(cohesive::Law::new(params, self.scene.material.law.youngs_modulus(), h));
    }

    /// What part of the needle the copies of the path's surface face.
    pub(super) fn separated_surfaces(&self, path: &PlannedPath) -> HashMap<u32, ContactSurface> {
        let hollow = self.scene.has_bore();
        let driven = self.separation.pairs.iter().filter(|p| hollow && !p.on_plane && p.tip_driven.is_some());
        let axis_of = |pair: &FacePair| if pair.axis == 0 { DVec3::X } else { DVec3::Y };
        driven
            .flat_map(|pair| {
                let rest = self.mesh.rest_position(pair.nodes[0] as usize) - path.entry;
                // Of a ring pair the copy on the side of the axis belongs to the core.
                let core = usize::from(rest.dot(axis_of(pair)) < 0.0);
                [0, 1]
                    .map(|n| (pair.nodes[n], if n == core { ContactSurface::Bore } else { ContactSurface::OuterWall }))
            })
            .chain(self.slit_nodes().into_iter().map(|n| (n.node, ContactSurface::Slit { side: n.side })))
            .collect()
    }

    /// Corners of the faces on both sides of a slit that may part.
    fn slit_nodes(&self) -> Vec<SlitNode> {
        let (Some(axis), Some(mesh)) = (self.scene.slit_axis(), self.mesh.as_block()) else { return Vec::new() };
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let parts: HashSet<u32> =
            self.separation.pairs.iter().filter(|p| self.on_slit(p)).flat_map(|p| p.nodes).collect();
        let mut layers: Vec<(usize, f64)> = Vec::new();
        for pair in self.separation.pairs.iter().filter(|p| self.on_slit(p)) {
            for (node, sign) in pair.nodes.iter().zip([-1.0, 1.0]) {
                let layer = (mesh.node_coordinates(*node as usize)[axis], sign);
                if !layers.contains(&layer) {
                    layers.push(layer);
                }
            }
        }
        let counts = mesh.nodes();
        let mut nodes = Vec::new();
        for (layer, sign) in layers {
            let node = |m: usize, n: usize| {
                let mut at = [layer; 3];
                (at[b], at[c]) = (m, n);
                mesh.node_index(at[0], at[1], at[2]) as u32
            };
            let mut side = DVec3::ZERO;
            side[axis] = sign;
            for (m, n) in (0..counts[c]).flat_map(|n| (0..counts[b]).map(move |m| (m, n))) {
                let mut present = 0;
                // Neighbours, the node itself where there is none.
                let beside = |k: usize, step: usize, count: usize| match step {
                    0 => k.checked_sub(1),
                    1 => Some(k),
                    _ => Some(k + 1).filter(|k| *k < count),
                };
                let at = |i: usize, j: usize| Some(node(beside(m, i, counts[b])?, beside(n, j, counts[c])?));
                for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    let corners = [at(1, 1), at(2 * i, 1), at(1, 2 * j), at(2 * i, 2 * j)];
                    let whole: Option<Vec<u32>> = corners.into_iter().collect();
                    if whole.is_some_and(|face| face.iter().any(|node| parts.contains(node))) {
                        present |= 1 << (i + 2 * j);
                    }
                }
                if present != 0 {
                    let places = (0..9).filter(|p| *p != 4).map(|p| at(p % 3, p / 3).unwrap_or(node(m, n)));
                    nodes.push(SlitNode { node: node(m, n), side, ring: places.collect(), present });
                }
            }
        }
        nodes
    }

    /// Tells the contact nodes of a slit their faces.
    pub(super) fn join_slit_faces(&mut self) {
        let index: HashMap<u32, u32> = (0..).zip(&self.contact_nodes).map(|(i, c)| (c.node, i)).collect();
        for slit in self.slit_nodes() {
            let own = index[&slit.node];
            // Neighbours of faces that are not there may be no contact nodes.
            let ring = std::array::from_fn(|p| index.get(&slit.ring[p]).copied().unwrap_or(own));
            let faces = NodeFaces { ring, present: slit.present };
            let place = |contact: u32| self.mesh.rest_position(self.contact_nodes[contact as usize].node as usize);
            let areas = (0..4).filter(|q| slit.present & (1 << q) != 0).map(|q| {
                let [first, second, _] = faces.corners(q & 1, q >> 1).map(place);
                0.25 * (first - place(own)).cross(second - place(own)).length()
            });
            let area = areas.sum();
            let contact = &mut self.contact_nodes[own as usize];
            (contact.faces, contact.share) = (Some(faces), area);
        }
    }

    /// True for the pairs of the slit, driven or not.
    fn on_slit(&self, pair: &FacePair) -> bool {
        self.scene.slit_axis() == Some(pair.axis) && {
            let off = self.mesh.rest_position(pair.nodes[0] as usize) - self.scene.motion.entry;
            off[pair.axis].abs() < 1e-9
        }
    }
}
