//! Nodes that a tool may touch.

use glam::DVec3;

use crate::mesh::Mesh;
use crate::needle::slit::NodeFaces;

/// A node that the tool may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactNode {
    pub node: u32,
    /// Rest distance r0 from the planned axis [m].
    pub rest_radius: f64,
    /// Rest coordinate s0 along the path, measured from the surface [m].
    pub rest_axial: f64,
    /// True for nodes that the needle pushes: the ring a0 < r0 < ring radius, or the copies of a surface that separates; the
    /// others only carry tip springs.
    pub pushed: bool,
    pub surface: ContactSurface,
    /// On a slit or under an indenter: the faces around the node, at whose points the tool touches.
    pub faces: Option<NodeFaces>,
    /// What the node stands for in contact: a quarter of the areas of those faces, on tetrahedra under an indenter a third of those of its
    /// triangles [m^2]; else its rest volume [m^3].
    pub share: f64,
    /// From the node at rest to the point of the surface that it carries: the skin of a label map lies between nodes [m].
    pub offset: DVec3,
}

impl ContactNode {
    /// A node that carries tip springs and no more.
    pub(super) fn carrier(node: usize, rest_radius: f64, rest_axial: f64, share: f64) -> Self {
        ContactNode {
            node: node as u32,
            rest_radius,
            rest_axial,
            pushed: false,
            surface: ContactSurface::OpenedPath,
            faces: None,
            share,
            offset: DVec3::ZERO,
        }
    }

    /// The point of the surface at rest [m].
    pub fn place(&self, mesh: &Mesh) -> DVec3 {
        mesh.rest_position(self.node as usize) + self.offset
    }
}

/// Against what part of the needle a node is held.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ContactSurface {
    /// The volume-preserving wall of the opened path.
    OpenedPath,
    /// The face of a slit, pushed to its own side (unit vector across the slit).
    Slit {
        side: DVec3,
    },
    /// The outer wall of a hollow needle, and its bore.
    OuterWall,
    Bore,
}
