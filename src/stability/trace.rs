//! What a run left behind, and how it ended.

use super::Balance;
use crate::observables::FrameRecord;

/// What a run left behind.
#[derive(Debug, Clone, Default)]
pub struct Trace {
    pub records: Vec<FrameRecord>,
    /// Energy of the state that was written before the first step [J].
    pub start_energy: f64,
}

impl Trace {
    /// Largest part of the energy that was lost or created; 0 where nothing happened.
    pub(super) fn imbalance(&self, balance: Balance) -> f64 {
        match balance {
            Balance::Frames => self.largest_residual(),
            Balance::Means => self.drift(),
        }
    }

    fn largest_residual(&self) -> f64 {
        let residual = |r: &FrameRecord| (r.energy.external + self.start_energy - r.energy.accounted()).abs();
        let work = self.records.last().map_or(0.0, |r| r.energy.external_max);
        // `f64::max` would drop what is no number.
        let larger = |a: f64, b: f64| if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) };
        let largest = self.records.iter().map(residual).fold(0.0, larger);
        if largest == 0.0 { 0.0 } else { largest / work.max(self.start_energy) }
    }

    fn drift(&self) -> f64 {
        let tenth = (self.records.len() / 10).max(1);
        let stored = |r: &FrameRecord| r.energy.elastic + r.energy.hourglass + r.energy.kinetic + r.energy.half_step;
        let sum = |records: &[FrameRecord]| records.iter().map(stored).sum::<f64>();
        (sum(&self.records[self.records.len().saturating_sub(tenth)..])
            / sum(&self.records[..tenth.min(self.records.len())])
            - 1.0)
            .abs()
    }
}

/// How a run ended, with the message of whoever ended it.
pub(super) enum End {
    Survived,
    Stopped(String),
    Refused(String),
}
