//! The centre-line of a bent needle as the tissue sees it, and what the tissue does to it.

use glam::DVec3;

/// Entries of the table, and of the loads that come back.
pub const ENTRY_COUNT: usize = 32;

/// Lateral offsets of the centre-line from the straight axis, piecewise linear in the distance s behind the tip and linear in
/// the time of one display frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CentreLine {
    /// Distance between entries [m]; the first one is the tip.
    pub spacing: f64,
    /// Step at which the frame begins.
    pub first_step: u64,
    /// Offset at the beginning of the frame [m], across the axis.
    pub offset: [DVec3; ENTRY_COUNT],
    /// Rate during the frame [m/s].
    pub rate: [DVec3; ENTRY_COUNT],
}

/// The centre-line at one place and time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bend {
    /// Offset [m], its derivative by s, and its rate [m/s].
    pub offset: DVec3,
    pub slope: DVec3,
    pub rate: DVec3,
}

impl CentreLine {
    /// Entry below `s` and the share of the next one.
    fn place(&self, s: f64) -> (usize, f64) {
        let at = (s / self.spacing).clamp(0.0, (ENTRY_COUNT - 1) as f64);
        let entry = (at as usize).min(ENTRY_COUNT - 2);
        (entry, at - entry as f64)
    }

    /// The line at `s` behind the tip, `time` [s] after the beginning of the frame.
    pub fn at(&self, s: f64, time: f64) -> Bend {
        let (i, part) = self.place(s);
        let now = |i: usize| self.offset[i] + self.rate[i] * time;
        Bend {
            offset: now(i).lerp(now(i + 1), part),
            slope: (now(i + 1) - now(i)) / self.spacing,
            rate: self.rate[i].lerp(self.rate[i + 1], part),
        }
    }

    /// Shares a force at `s` over the entries, as the offset is interpolated.
    pub fn share(&self, loads: &mut [DVec3; ENTRY_COUNT], s: f64, force: DVec3) {
        let (i, part) = self.place(s);
        loads[i] += force * (1.0 - part);
        loads[i + 1] += force * part;
    }
}
