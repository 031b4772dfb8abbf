//! Contact of a solid needle with the faces of a slit, at points on the faces.
//!
//! Every rest face of the slit carries 3 x 3 points, each for a ninth of its area A; a point follows the bilinear face:
//! ```text
//! x_p = sum_i w_i x_i,  U = sum_p 1/2 kappa A/9 phi(x_p)^2,  f_i = -sum_p w_i kappa A/9 phi grad phi   [m], [J], [N]
//! ```
//! with the overlap phi of [`super::gap::Profile::slit_face`] and the stiffness kappa [Pa/m] of the tool contact. Contact at
//! nodes instead leaves the needle free to pass between them: a node in front of the tip stands on a ridge, slides off to
//! one side along the slit, and the face behind it lies in the needle (10 % of the work created, the force doubled; measured).

/// Points of a face along each of its edges.
pub const POINTS: usize = 3;

/// Reference length of the stiffness kappa = k/l^2 [m]: what the contact stiffness k of a node is for an area of l^2.
pub const REFERENCE_EDGE: f64 = 0.6e-3;

/// The faces around a node of a surface that a tool touches at points: a slit, on the node's own side, or the top face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NodeFaces {
    /// Contact nodes around, as indices into `Model::contact_nodes`, row by row from the low corner without the node itself;
    /// those of absent faces name the node itself.
    pub ring: [u32; 8],
    /// Bit `i + 2 j` is set where the face towards higher (1) or lower (0) places along the first (i) and second (j) way exists.
    pub present: u32,
}

impl NodeFaces {
    /// Contact nodes at the other corners of face `i + 2 j`: along the first way, along the second, and the far one.
    pub fn corners(&self, i: usize, j: usize) -> [u32; 3] {
        // Places in the 3 x 3 block around the node (place 4), which `ring` leaves out.
        let at = |column: usize, row: usize| {
            let place = column + 3 * row;
            self.ring[if place > 4 { place - 1 } else { place }]
        };
        [at(2 * i, 1), at(1, 2 * j), at(2 * i, 2 * j)]
    }
}

/// Bilinear weights of the point (a, b) of a face, as seen from one corner: of this corner, of the one along the first way, along the
/// second, and of the far one.
pub fn weights(a: usize, b: usize) -> [f64; 4] {
    let place = |k: usize| (k as f64 + 0.5) / POINTS as f64;
    let (t, u) = (place(a), place(b));
    [(1.0 - t) * (1.0 - u), t * (1.0 - u), (1.0 - t) * u, t * u]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_corners_share_every_point_wholly() {
        for (a, b) in (0..POINTS).flat_map(|a| (0..POINTS).map(move |b| (a, b))) {
            assert!((weights(a, b).iter().sum::<f64>() - 1.0).abs() < 1e-15);
            // The same point from the far corner.
            let far = weights(POINTS - 1 - a, POINTS - 1 - b);
            assert!((weights(a, b)[0] - far[3]).abs() < 1e-15);
        }
    }

    #[test]
    fn corners_are_those_of_the_quadrant() {
        // The ring of node 4 of the block 0..9.
        let faces = NodeFaces { ring: [0, 1, 2, 3, 5, 6, 7, 8], present: 15 };
        assert_eq!(faces.corners(0, 0), [3, 1, 0]);
        assert_eq!(faces.corners(1, 0), [5, 1, 2]);
        assert_eq!(faces.corners(0, 1), [3, 7, 6]);
        assert_eq!(faces.corners(1, 1), [5, 7, 8]);
    }
}
