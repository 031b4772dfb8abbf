//! What cells in lanes count: corners of a hexahedron by the bits of their signs (bit 0 along x, bit 1 along y, bit 2 along z), entries of a gradient.

/// Corners of a cell, and products of their signs.
pub(in crate::cpu::lanes) const SIGNS: usize = 8;

/// Products of two and of three signs, by their bits.
pub(in crate::cpu::lanes) const HOURGLASS: [usize; 4] = [6, 5, 3, 7];

/// Entries of a displacement gradient.
pub(in crate::cpu::lanes) const GRADIENT: usize = 9;
