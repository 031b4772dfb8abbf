//! How many threads share the work of a stage.

use crate::model::Model;

/// How finely work is cut. Hardware waits for memory, and needs many threads to do something else meanwhile; a software adapter walks
/// through all of them in turn, and pays for what they have in common once per thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grain {
    /// Many threads for few cells.
    pub wide: bool,
    /// Threads of the measuring stages: enough to fill a device.
    pub measure_threads: u32,
}

impl Grain {
    /// `wide`: as on hardware.
    pub fn of(model: &Model, wide: bool) -> Self {
        let cells = model.mesh.cell_count() as u32;
        let threads = if wide { cells.min(65_536) } else { (cells / 16).min(8192) };
        Grain { wide, measure_threads: threads.max(64).next_multiple_of(64) }
    }

    /// Sums that these tell: hardware adds those of a workgroup, so that the read-back is short.
    pub fn measured_sums(self) -> u32 {
        if self.wide { self.measure_threads / 64 } else { self.measure_threads }
    }

    /// Threads for each cluster of points beside an opened path and for each node there: PIECES in their stages.
    pub fn pieces(self) -> usize {
        if self.wide { 8 } else { 1 }
    }
}
