//! Shapes of elements by their numbers.

use super::*;

/// What a type number of Gmsh stands for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    pub(super) nodes: u32,
    /// Nodes that are kept, the first of its list: the corners of a simplex of first or second order; of others none.
    pub(super) corners: u32,
    pub(super) dimension: i64,
    /// `None` for tetrahedra of four and ten nodes.
    pub(super) class: Option<ElementClass>,
    pub(super) kind: &'static str,
}

impl Shape {
    /// Whether the nodes are needed: tetrahedra, and the simplices that mark node sets.
    pub(super) fn kept(&self) -> bool {
        self.corners > 0
    }

    /// Table of element types of the Gmsh reference manual.
    pub(super) fn of_number(number: i64) -> Option<Shape> {
        let (nodes, dimension, kind) = match number {
            1 => (2, 1, "lines"),
            2 => (3, 2, "triangles"),
            3 => (4, 2, "quadrangles"),
            4 => (4, 3, "tetrahedra"),
            5 => (8, 3, "hexahedra"),
            6 => (6, 3, "prisms"),
            7 => (5, 3, "pyramids"),
            8 => (3, 1, "lines of second order"),
            9 => (6, 2, "triangles of second order"),
            10 => (9, 2, "quadrangles of second order"),
            11 => (10, 3, "ten-node tetrahedra (type 11)"),
            12 => (27, 3, "hexahedra of second order"),
            13 => (18, 3, "prisms of second order"),
            14 => (14, 3, "pyramids of second order"),
            15 => (1, 0, "points"),
            16 => (8, 2, "quadrangles of second order"),
            17 => (20, 3, "hexahedra of second order"),
            18 => (15, 3, "prisms of second order"),
            19 => (13, 3, "pyramids of second order"),
            20 => (9, 2, "triangles of higher order"),
            21 => (10, 2, "triangles of higher order"),
            22 => (12, 2, "triangles of higher order"),
            23 | 24 => (15, 2, "triangles of higher order"),
            25 => (21, 2, "triangles of higher order"),
            26 => (4, 1, "lines of higher order"),
            27 => (5, 1, "lines of higher order"),
            28 => (6, 1, "lines of higher order"),
            29 => (20, 3, "tetrahedra of higher order"),
            30 => (35, 3, "tetrahedra of higher order"),
            31 => (56, 3, "tetrahedra of higher order"),
            92 => (64, 3, "hexahedra of higher order"),
            93 => (125, 3, "hexahedra of higher order"),
            _ => return None,
        };
        let class = match number {
            4 | 11 => None,
            29..=31 => Some(ElementClass::HighOrderTet),
            _ if dimension == 3 => Some(ElementClass::Volume),
            _ => Some(ElementClass::Lower),
        };
        let corners = match number {
            1 | 2 | 4 | 8 | 9 | 11 | 15 => dimension as u32 + 1,
            _ => 0,
        };
        Some(Shape { nodes, corners, dimension, class, kind })
    }
}
