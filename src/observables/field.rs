//! Fields over the tissue: one table for VTU files, pictures and the window. A field that is a new array of [`FieldSnapshot`] is one line
//! here; one that the window draws also needs its lane on the device.

use glam::DVec3;

use super::FieldSnapshot;
use crate::scene::Scene;
use crate::units::{KILOPASCAL, METRE, MILLIMETRE, ONE, Unit};

/// A field that can be written or drawn.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Name in files, with its SI unit.
    pub key: &'static str,
    /// For people, with the unit of `unit`.
    pub label: &'static str,
    /// In which people see it; files are in SI.
    pub unit: Unit,
    pub range: Range,
    pub values: Values,
    pub lane: Lane,
}

/// Where its values are on the host.
#[derive(Debug, Clone, Copy)]
pub enum Values {
    /// A vector per node; empty where the scene has no such field.
    Nodes(fn(&FieldSnapshot) -> &[DVec3]),
    /// A number per cell; empty where the scene has no such field.
    Cells(fn(&FieldSnapshot) -> &[f64]),
    /// Nowhere: it is only drawn.
    Drawn,
}

/// What its numbers lie between, in SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// From 0 to as large as they come, at first to this.
    Positive(f64),
    /// On both sides of 0 alike, at first to this.
    Signed(f64),
    /// Always the same scale.
    Fixed(f64, f64),
}

/// Where a window finds it: the number that stands in `View.range.z` of the drawing shaders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lane {
    /// Not drawn.
    None,
    /// Lane of `drawn_cells` and `drawn_nodes`.
    Node(usize),
    /// Lane of the same; what is drawn is 1 minus the number there.
    OneMinus(usize),
    /// Beyond the lanes: the shader measures it, where faces may part.
    Opening(usize),
}

impl Range {
    /// Ends of the scale that a drawing begins with.
    pub const fn ends(self) -> (f64, f64) {
        match self {
            Range::Positive(most) => (0.0, most),
            Range::Signed(most) => (-most, most),
            Range::Fixed(low, high) => (low, high),
        }
    }
}

impl Lane {
    /// Its number; `None` where it is not drawn.
    pub const fn number(self) -> Option<usize> {
        match self {
            Lane::None => None,
            Lane::Node(lane) | Lane::OneMinus(lane) | Lane::Opening(lane) => Some(lane),
        }
    }
}

/// What pictures show, and windows first.
pub const VON_MISES: Field = Field {
    key: "von_mises_pa",
    label: "von Mises stress",
    unit: KILOPASCAL,
    range: Range::Positive(10e3),
    values: Values::Cells(|s| &s.von_mises),
    lane: Lane::Node(0),
};

const fn written(key: &'static str, label: &'static str, range: Range, of: fn(&FieldSnapshot) -> &[f64]) -> Field {
    Field { key, label, unit: ONE, range, values: Values::Cells(of), lane: Lane::None }
}

const fn drawn(key: &'static str, label: &'static str, unit: Unit, range: Range, lane: Lane) -> Field {
    Field { key, label, unit, range, values: Values::Drawn, lane }
}

/// All fields, in the order of the arrays of a file and of the list in a window.
pub static FIELDS: [Field; 12] = [
    Field {
        key: "displacement_m",
        label: "displacement",
        unit: METRE,
        range: Range::Positive(1e-3),
        values: Values::Nodes(|s| &s.displacement),
        lane: Lane::None,
    },
    Field {
        key: "opened_displacement_m",
        label: "displacement beside the open path",
        unit: METRE,
        range: Range::Positive(1e-3),
        values: Values::Nodes(|s| &s.opened_displacement),
        lane: Lane::None,
    },
    VON_MISES,
    written("jacobian", "Jacobian", Range::Positive(1.0), |s| &s.jacobian),
    Field {
        key: "pressure_pa",
        label: "pressure",
        unit: KILOPASCAL,
        range: Range::Signed(10e3),
        values: Values::Cells(|s| &s.pressure),
        lane: Lane::Node(1),
    },
    drawn("largest_stretch", "largest stretch", ONE, Range::Fixed(1.0, 1.5), Lane::Node(2)),
    written("stiffness", "stiffness that the needle's path has left", Range::Fixed(0.0, 1.0), |s| &s.stiffness),
    written("plastic_strain", "plastic strain", Range::Positive(1.0), |s| &s.plastic_strain),
    written("damage", "damage of the law", Range::Fixed(0.0, 1.0), |s| &s.damage),
    written("material", "material", Range::Positive(1.0), |s| &s.material),
    // Part of the stiffness that damage and the needle's path have taken; the device holds what is left.
    drawn("stiffness_taken", "damage", ONE, Range::Fixed(0.0, 1.0), Lane::OneMinus(3)),
    // How far faces that separate have parted.
    drawn("opening_m", "opening of torn faces", MILLIMETRE, Range::Fixed(0.0, 2e-3), Lane::Opening(4)),
];

/// Fields are told apart by their key.
impl PartialEq for Field {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Field {
    /// Its numbers per cell; none where it has none.
    pub fn cells(self, snapshot: &FieldSnapshot) -> &[f64] {
        if let Values::Cells(of) = self.values { of(snapshot) } else { &[] }
    }

    /// The fields that a window can draw of a scene.
    pub fn drawn_of(scene: &Scene) -> impl Iterator<Item = &'static Field> {
        let parts = scene.effects.cohesive.is_some();
        FIELDS.iter().filter(move |field| match field.lane {
            Lane::None => false,
            Lane::Opening(_) => parts,
            Lane::Node(_) | Lane::OneMinus(_) => true,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn keys_and_lanes_are_told_apart() {
        let keys: BTreeSet<&str> = FIELDS.iter().map(|field| field.key).collect();
        assert_eq!(keys.len(), FIELDS.len());
        let lanes: Vec<usize> = FIELDS.iter().filter_map(|field| field.lane.number()).collect();
        assert_eq!(lanes, [0, 1, 2, 3, 4], "the lanes of a node, then what the shader measures");
        for field in FIELDS.iter().filter(|field| !matches!(field.values, Values::Drawn)) {
            let unit = if field.key.ends_with("_m") { Some(METRE.si) } else { None };
            assert!(unit.is_none_or(|si| si == field.unit.si), "{}", field.key);
        }
    }

    #[test]
    fn lanes_are_those_of_the_shaders() {
        let tissue = include_str!("../../shaders/render/tissue.wgsl");
        let parted = include_str!("../../shaders/render/parted.wgsl");
        for field in &FIELDS {
            match field.lane {
                Lane::OneMinus(lane) => assert!(tissue.contains(&format!("1.0 - value, lane == {lane}u)"))),
                Lane::Opening(lane) => assert!(parted.contains(&format!("if (lane < {lane}u) {{"))),
                Lane::Node(lane) => assert!(lane < 4 && !tissue.contains(&format!("lane == {lane}u"))),
                Lane::None => {}
            }
        }
    }
}
