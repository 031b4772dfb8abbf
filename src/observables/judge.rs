//! Looks at every frame and judges the run by the table of [`crate::verdict`].

use serde::{Deserialize, Serialize};

use super::FrameRecord;
use crate::verdict::{BOUNDS, Bound, CREATED_PART, Doubt, FLOOR_STEPS, PATIENCE, Quantity, USELESS_PART, Verdict};

/// What stops a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trouble {
    pub quantity: Quantity,
    pub value: f64,
    /// Bound that it left, and for how many frames.
    pub bound: f64,
    pub frames: u32,
    /// Energy that is missing (negative: that was created) and the work that it is measured by [J]; of an imbalance only.
    pub energy: Option<(f64, f64)>,
}

/// What a run is measured against.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Sizes {
    pub nodes: usize,
    pub cells: usize,
    /// Floor of the imbalance [J].
    pub floor: f64,
    /// Uniform mass scaling S.
    pub mass_scaling: f64,
}

/// What the judge remembers from frame to frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Judge {
    sizes: Sizes,
    /// What was stored before the first frame [J].
    stored: Option<f64>,
    /// What had been put in at the end of the last frame [J].
    last: f64,
    /// Sums over the frames so far: internal, hourglass and added kinetic energy [J].
    internal: f64,
    hourglass: f64,
    added_kinetic: f64,
    clamped: u64,
    raised: u64,
    clipped: u64,
    unbalanced: u64,
    frames: u64,
    inverted: u32,
    creating: u32,
    /// Frames on end beyond the second bound, per row of the table.
    beyond: [u32; BOUNDS.len()],
    verdict: Verdict,
}

impl Judge {
    /// For a tissue of these sizes.
    pub fn new(sizes: Sizes) -> Self {
        Judge { sizes, ..Judge::default() }
    }

    /// The sizes after a change of the scene.
    pub fn change(&mut self, sizes: Sizes) {
        self.sizes = sizes;
    }

    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Tells where a doubt that began with the last frame is.
    pub fn place(&mut self, frame: u64, place: &str) {
        self.verdict.doubts.iter_mut().filter(|d| d.frame == frame).for_each(|d| {
            d.place.get_or_insert_with(|| place.to_string());
        });
    }

    /// Looks at a frame of `steps` steps. The trouble that stops the run, if any.
    pub fn check(&mut self, record: &FrameRecord, steps: u32) -> Option<Trouble> {
        let (health, energy) = (&record.health, &record.energy);
        self.frames += 1;
        let node_steps = f64::from(steps.max(1)) * self.sizes.nodes as f64;
        let all_node_steps = (record.step.max(1) * self.sizes.nodes as u64) as f64;
        let all_cell_steps = (record.step.max(1) * self.sizes.cells as u64) as f64;
        self.clamped += u64::from(health.clamped_nodes);
        self.raised += u64::from(health.raised_mass);
        self.clipped += u64::from(health.return_failures);
        self.unbalanced += u64::from(record.needle.unbalanced);
        let missing = energy.external - energy.accounted();
        // A state that was given to the run holds energy that nobody put in during it.
        let given = -missing > 2.0 * energy.external_max && -missing > self.sizes.floor;
        let stored = *self.stored.get_or_insert(if given { -missing } else { 0.0 });
        let missing = missing + stored;
        let per_step = (energy.put_in() - self.last).abs() / f64::from(steps.max(1));
        self.last = energy.put_in();
        // What was put in bounds what can move: energy that a step creates is no reason to look away.
        let put_in = energy.external_max.max(stored).max(self.sizes.floor).max(f64::MIN_POSITIVE);
        let scale = put_in.max(FLOOR_STEPS * per_step);
        // `f64::max` would drop NaN.
        let (worst, now) = (self.verdict.worst_imbalance, (missing / scale).abs());
        self.verdict.worst_imbalance = if now.is_nan() { now } else { worst.max(now) };
        self.internal += energy.internal();
        self.hourglass += energy.hourglass;
        self.added_kinetic += (1.0 - 1.0 / self.sizes.mass_scaling.max(1.0)) * energy.kinetic;
        let whole = self.internal.max(self.frames as f64 * self.sizes.floor).max(f64::MIN_POSITIVE);
        let fewer = health.inverted_cells < self.inverted;
        self.inverted = health.inverted_cells;
        let of_all = |cells: u32| f64::from(cells) / self.sizes.cells.max(1) as f64;
        let inverted = of_all(health.inverted_cells.saturating_sub(health.folded_cells));
        let folded = of_all(health.folded_cells);
        // Value beside the first bound, and beside the second one.
        let both = |value: f64| (value, value);
        let values = BOUNDS.map(|bound| match bound.quantity {
            Quantity::NotFinite => both(if health.not_finite { 1.0 } else { 0.0 }),
            Quantity::EnergyImbalance => ((missing / scale).abs(), (missing / put_in).abs()),
            Quantity::CuredEnergy => both((energy.raised_mass.abs() + energy.speed_limit.abs()) / scale),
            Quantity::ClampedShare => both(f64::from(health.clamped_nodes) / node_steps),
            Quantity::RaisedShare => both(self.raised as f64 / all_node_steps),
            Quantity::InvertedCells => (inverted, if fewer { 0.0 } else { inverted }),
            Quantity::FoldedCells => (folded, if fewer { 0.0 } else { folded }),
            Quantity::HourglassShare => both(self.hourglass / whole),
            Quantity::InertiaShare => both(self.added_kinetic / whole),
            Quantity::ClippedReturns => both(self.clipped as f64 / all_cell_steps),
            Quantity::UnbalancedNeedle => both(self.unbalanced as f64 / self.frames as f64),
        });
        for (bound, (value, _)) in BOUNDS.iter().zip(values) {
            // Cells may recover, and what is a share of the whole run is judged by the whole run.
            if bound.quantity.is_of_the_end() && value <= bound.ok {
                self.verdict.doubts.retain(|d| d.quantity != bound.quantity);
            }
            self.note(record, bound, value);
        }
        let trouble = |bound: &Bound, value: f64, limit: f64, frames: u32| Trouble {
            quantity: bound.quantity,
            value,
            bound: limit,
            frames,
            energy: (bound.quantity == Quantity::EnergyImbalance).then_some((missing, put_in)),
        };
        if (missing / put_in).abs() > USELESS_PART {
            return Some(trouble(Quantity::EnergyImbalance.bound(), (missing / put_in).abs(), USELESS_PART, 1));
        }
        let created = -missing / put_in;
        self.creating = if created > CREATED_PART { self.creating + 1 } else { 0 };
        if self.creating >= PATIENCE {
            return Some(trouble(Quantity::EnergyImbalance.bound(), created, CREATED_PART, PATIENCE));
        }
        for ((bound, beyond), (_, value)) in BOUNDS.iter().zip(&mut self.beyond).zip(values) {
            let Some((limit, frames)) = bound.stop else { continue };
            // Nothing is beyond a bound before the frames of a whole one: the first frame is a single step.
            let is_beyond = value > limit || value.is_nan();
            *beyond = if is_beyond { *beyond + 1 } else { 0 };
            if *beyond >= frames && (bound.quantity != Quantity::ClippedReturns || self.frames > 1) {
                return Some(trouble(bound, value, limit, frames));
            }
        }
        None
    }

    /// Keeps the largest value of what is beyond its first bound.
    fn note(&mut self, record: &FrameRecord, bound: &Bound, value: f64) {
        if !(value > bound.ok || value.is_nan()) {
            return;
        }
        match self.verdict.doubts.iter_mut().find(|d| d.quantity == bound.quantity) {
            Some(doubt) if bound.quantity.is_of_the_end() => doubt.value = value,
            Some(doubt) => doubt.value = if value.is_nan() { value } else { doubt.value.max(value) },
            None => {
                self.verdict.doubts.push(Doubt {
                    quantity: bound.quantity,
                    value,
                    bound: bound.ok,
                    frame: record.frame,
                    time_s: record.time,
                    place: None,
                });
                let order = |d: &Doubt| BOUNDS.iter().position(|b| b.quantity == d.quantity);
                self.verdict.doubts.sort_by_key(order);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judge() -> Judge {
        Judge::new(Sizes { nodes: 1000, cells: 800, floor: 1e-9, mass_scaling: 100.0 })
    }

    fn frame(number: u64, external: f64, elastic: f64) -> FrameRecord {
        let mut record = FrameRecord { frame: number, step: 100_000 * number + 1, ..FrameRecord::default() };
        record.energy.external = external;
        record.energy.external_max = external.abs();
        record.energy.elastic = elastic;
        record
    }

    #[test]
    fn energy_out_of_nothing_is_trouble_after_three_frames() {
        let mut judge = judge();
        assert_eq!(judge.check(&frame(0, 0.0, 0.0), 1), None);
        for n in 1..4 {
            assert_eq!(judge.check(&frame(n, 1e-3 * n as f64, 1e-3 * n as f64), 100_000), None);
        }
        let found: Vec<bool> = (4..7).map(|n| judge.check(&frame(n, 4e-3, 7e-3), 100_000).is_some()).collect();
        assert_eq!(found, [false, false, true]);
    }

    #[test]
    fn ten_times_the_work_out_of_nothing_stops_at_once() {
        let mut judge = judge();
        assert_eq!(judge.check(&frame(0, 0.0, 0.0), 1), None);
        assert_eq!(judge.check(&frame(1, 1e-3, 1e-3), 100_000), None);
        assert_eq!(judge.check(&frame(2, 1e-3, 8e-3), 100_000), None);
        let found = judge.check(&frame(3, 1e-3, 13e-3), 100_000).unwrap();
        assert_eq!((found.quantity, found.bound, found.frames), (Quantity::EnergyImbalance, USELESS_PART, 1));
    }

    #[test]
    fn a_loss_is_a_doubt_with_its_frame_and_stops_after_ten_frames() {
        let mut judge = judge();
        judge.check(&frame(0, 0.0, 0.0), 1);
        assert_eq!(judge.check(&frame(1, 1e-3, 0.985e-3), 100_000), None);
        assert!(judge.verdict().is_ok());
        judge.check(&frame(2, 1e-3, 0.97e-3), 100_000);
        judge.check(&frame(3, 1e-3, 0.95e-3), 100_000);
        judge.check(&frame(4, 1e-3, 0.99e-3), 100_000);
        let doubt = &judge.verdict().doubts[0];
        assert_eq!((doubt.quantity, doubt.frame), (Quantity::EnergyImbalance, 2));
        assert!((doubt.value - 0.05).abs() < 1e-9, "{doubt:?}");
        let stops: Vec<bool> = (5..16).map(|n| judge.check(&frame(n, 1e-3, 0.7e-3), 100_000).is_some()).collect();
        assert_eq!(stops.iter().position(|s| *s), Some(9));
    }

    #[test]
    fn the_work_so_far_is_the_scale_not_that_of_the_whole_run() {
        let mut judge = judge();
        judge.check(&frame(0, 0.0, 0.0), 1);
        // A loss of 5 % early on, of 0.05 % in the end.
        judge.check(&frame(1, 1e-5, 0.95e-5), 100_000);
        judge.check(&frame(2, 1e-3, 0.9995e-3), 100_000);
        assert_eq!(judge.verdict().doubts.len(), 1);
        // Below the floor nothing is said.
        let mut still = self::judge();
        assert!((0..20).all(|n| still.check(&frame(n, 1e-13 * n as f64, 0.0), 100_000).is_none()));
        assert!(still.verdict().is_ok());
    }

    #[test]
    fn what_was_stored_before_the_run_is_not_created() {
        let mut judge = judge();
        assert!((0..20).all(|n| judge.check(&frame(n, 0.0, 5e-3), 100_000).is_none()));
        assert!(judge.verdict().is_ok());
    }

    #[test]
    fn inverted_cells_may_recover() {
        let inverted = |n: u64, count: u32| {
            let mut record = frame(n, 1e-3, 1e-3);
            record.health.inverted_cells = count;
            record
        };
        let mut falling = judge();
        assert!((0..81).all(|n| falling.check(&inverted(n, 800 - 10 * n as u32), 30).is_none()));
        assert!(falling.verdict().is_ok());
        let mut staying = judge();
        let first = (0..20).position(|n| staying.check(&inverted(n, 60), 30).is_some());
        assert_eq!(first, Some(9));
        let mut few = judge();
        assert!((0..50).all(|n| few.check(&inverted(n, 20), 30).is_none()));
        assert_eq!(few.verdict().doubts[0].quantity, Quantity::InvertedCells);
        let mut single = self::judge();
        assert!((0..50).all(|n| single.check(&inverted(n, 1), 30).is_none()));
        assert_eq!(single.verdict().doubts[0].quantity, Quantity::InvertedCells);
    }

    #[test]
    fn clamped_nodes_are_counted_against_the_steps_of_the_frame() {
        let mut record = frame(1, 1e-3, 1e-3);
        record.health.clamped_nodes = 1600;
        assert_eq!(judge().check(&record, 100), None);
        let trouble = judge().check(&record, 30);
        assert!(trouble.is_some_and(|t| t.quantity == Quantity::ClampedShare && t.value > 0.05));
    }
}
