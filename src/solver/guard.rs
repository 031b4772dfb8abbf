//! The guard: looks at every frame, and stops a run before its state is useless.
//!
//! | sign | trouble when |
//! |---|---|
//! | not finite | a displacement or velocity is no number, or out of the range of the engine |
//! | speed | more than a twentieth of the node steps of a frame ran into the speed limit |
//! | energy | more than half of what was put in has been created, in [`PATIENCE`] frames on end |
//! | inversion | more than a twentieth of the cells are inside out and do not get fewer in [`LONG_PATIENCE`] frames |
//!
//! A single clamped node or inverted cell is counted and reported, and stops nothing: tissue recovers from it. An unstable
//! step clamps nearly all nodes and would go on for ever without a number being out of range.

use serde::{Deserialize, Serialize};

use crate::observables::FrameRecord;

/// Part of the node steps of a frame that may run into the speed limit.
const CLAMPED_PART: f64 = 0.05;

/// Part of what was put in that may be created.
pub(super) const CREATED_PART: f64 = 0.5;

/// Part of the cells that may stay inside out.
pub(super) const INVERTED_PART: f64 = 0.05;

/// Frames on end in which a sign must show that may pass.
pub const PATIENCE: u32 = 3;
pub const LONG_PATIENCE: u32 = 10;

/// Strain whose energy in the whole tissue is rounding.
const ROUNDING_STRAIN: f64 = 3e-5;

/// What the guard found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Trouble {
    NotFinite,
    /// Part of the node steps of the frame that were clamped.
    Speed(f64),
    /// Energy created since t = 0, and the most that was put in [J].
    Energy {
        created: f64,
        put_in: f64,
    },
    /// Cells inside out.
    Inversion(u32),
}

/// What the guard remembers from frame to frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Guard {
    nodes: f64,
    cells: f64,
    /// Energy that is rounding [J].
    rounding: f64,
    /// What was stored before the first frame [J].
    stored: Option<f64>,
    creating: u32,
    inverted: u32,
    inverting: u32,
}

impl Guard {
    /// For `nodes` and `cells` of a tissue with the stiffness `shear_modulus` [Pa] and the volume `volume` [m^3].
    pub fn new(nodes: usize, cells: usize, shear_modulus: f64, volume: f64) -> Self {
        Guard {
            nodes: nodes as f64,
            cells: cells as f64,
            rounding: shear_modulus * volume * ROUNDING_STRAIN * ROUNDING_STRAIN,
            stored: None,
            creating: 0,
            inverted: 0,
            inverting: 0,
        }
    }

    /// Looks at a frame of `steps` steps.
    pub fn check(&mut self, record: &FrameRecord, steps: u32) -> Option<Trouble> {
        let (health, energy) = (&record.health, &record.energy);
        if health.not_finite {
            return Some(Trouble::NotFinite);
        }
        let clamped = f64::from(health.clamped_nodes) / (f64::from(steps) * self.nodes);
        if clamped > CLAMPED_PART {
            return Some(Trouble::Speed(clamped));
        }
        let gain = energy.accounted() - energy.external;
        let stored = *self.stored.get_or_insert(gain);
        let (created, put_in) = (gain - stored, energy.external_max.max(stored) + self.rounding);
        self.creating = if created > CREATED_PART * put_in { self.creating + 1 } else { 0 };
        if self.creating >= PATIENCE {
            return Some(Trouble::Energy { created, put_in });
        }
        let many = f64::from(health.inverted_cells) > INVERTED_PART * self.cells;
        let fewer = health.inverted_cells < self.inverted;
        self.inverting = if many && !fewer { self.inverting + 1 } else { 0 };
        self.inverted = health.inverted_cells;
        (self.inverting >= LONG_PATIENCE).then_some(Trouble::Inversion(health.inverted_cells))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard() -> Guard {
        Guard::new(1000, 800, 2e4, 1e-6)
    }

    fn frame(external: f64, elastic: f64) -> FrameRecord {
        let mut record = FrameRecord::default();
        record.energy.external = external;
        record.energy.external_max = external;
        record.energy.elastic = elastic;
        record
    }

    #[test]
    fn energy_out_of_nothing_is_trouble_after_three_frames() {
        let mut guard = guard();
        assert_eq!(guard.check(&frame(0.0, 0.0), 1), None);
        for n in 1..4 {
            assert_eq!(guard.check(&frame(1e-3 * f64::from(n), 1e-3 * f64::from(n)), 30), None);
        }
        let found: Vec<bool> = (0..3).map(|_| guard.check(&frame(4e-3, 7e-3), 30).is_some()).collect();
        assert_eq!(found, [false, false, true]);
    }

    #[test]
    fn what_was_stored_before_the_run_is_not_created() {
        let mut guard = guard();
        for _ in 0..20 {
            assert_eq!(guard.check(&frame(0.0, 5e-3), 30), None);
        }
        // Rounding at rest.
        let mut still = self::guard();
        assert!((0..20).all(|n| still.check(&frame(0.0, 1e-13 * f64::from(n)), 30).is_none()));
    }

    #[test]
    fn inverted_cells_may_recover() {
        let inverted = |count: u32| {
            let mut record = frame(1e-3, 1e-3);
            record.health.inverted_cells = count;
            record
        };
        let mut falling = guard();
        assert!((0..70).all(|n| falling.check(&inverted(800 - 10 * n), 30).is_none()));
        let mut staying = guard();
        let first = (0..20).position(|_| staying.check(&inverted(60), 30).is_some());
        assert_eq!(first, Some(9));
        let mut few = guard();
        assert!((0..50).all(|_| few.check(&inverted(20), 30).is_none()));
    }

    #[test]
    fn clamped_nodes_are_counted_against_the_steps_of_the_frame() {
        let mut record = frame(1e-3, 1e-3);
        record.health.clamped_nodes = 1600;
        assert_eq!(guard().check(&record, 100), None);
        assert!(matches!(guard().check(&record, 30), Some(Trouble::Speed(part)) if part > 0.05));
    }
}
