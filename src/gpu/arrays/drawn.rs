//! What a window draws.

use super::super::structs::DrawnNeedle;
use super::{Array, Life, zeros};

pub(super) const ARRAYS: &[Array] = &[
    Array::new("drawn_cells", Life::Drawn, |s| zeros(s.cells() + 1, 16)),
    Array::new("drawn_needle", Life::Drawn, |_| zeros(1, size_of::<DrawnNeedle>())),
    Array::new("drawn_nodes", Life::Drawn, |s| zeros(s.nodes(), 16)),
];
