//! What a run that stops says: where, what, and the way out.

use glam::DVec3;

use super::Simulation;
use crate::engine::LARGEST_DISPLACEMENT;
use crate::error::Error;
use crate::observables::{FrameRecord, Trouble};
use crate::verdict::Quantity;

impl Simulation {
    /// The error of a run that is stopped after the frame of `record`. It names no cure: nobody has tried one yet.
    pub(super) fn stopped(&mut self, record: &FrameRecord, trouble: Trouble) -> Error {
        match (trouble.quantity, trouble.energy) {
            (Quantity::NotFinite, _) => self.broken(record),
            (Quantity::ClampedShare, _) => self.runaway(record, trouble.value),
            (Quantity::ClippedReturns, _) => self.flow_lost(record, &trouble),
            (Quantity::EnergyImbalance, Some((missing, scale))) => {
                let (place, step) = (self.fastest(), self.step_above_the_stable_one());
                let word = if missing < 0.0 { "created" } else { "lost" };
                let when = match trouble.frames {
                    1 => "at any time".to_string(),
                    frames => format!("in {frames} frames on end"),
                };
                self.error(
                    record,
                    format!(
                        "{:.3e} J of energy were {word} since t = 0, {:.0} % of the {scale:.3e} J that were put in (at most {:.0} % \
                         {when}); {place}{step}",
                        missing.abs(),
                        100.0 * missing.abs() / scale,
                        100.0 * trouble.bound,
                    ),
                )
            }
            (Quantity::InvertedCells | Quantity::FoldedCells, _) => {
                let cells = record.health.inverted_cells;
                let place = self.inverted_place(record).map_or(String::new(), |place| format!("; {place}"));
                self.error(
                    record,
                    format!(
                        "{cells} cells are inside out and do not get fewer in {} frames (at most {:.0} % of all may){place}",
                        trouble.frames,
                        100.0 * trouble.bound
                    ),
                )
            }
            _ => {
                let row = trouble.quantity.bound();
                let place = self.fastest();
                self.error(
                    record,
                    format!(
                        "{}: {} (at most {} in {} frames on end); {place}",
                        row.text,
                        row.show(trouble.value),
                        row.show(trouble.bound),
                        trouble.frames
                    ),
                )
            }
        }
    }

    /// Where a doubt is that began with this frame: the inverted cell, else the fastest node.
    pub(super) fn place_of_doubt(&mut self, record: &FrameRecord) -> String {
        self.inverted_place(record).unwrap_or_else(|| self.fastest())
    }

    fn inverted_place(&self, record: &FrameRecord) -> Option<String> {
        let cell = record.health.inverted_cell?;
        let x = self.model.mesh.cell_centre(cell as usize) * 1e3;
        Some(format!("one is cell {cell} at ({:.2}, {:.2}, {:.2}) mm", x.x, x.y, x.z))
    }

    fn error(&self, record: &FrameRecord, message: String) -> Error {
        Error::Diverged { frame: record.frame, step: record.step, time_s: record.time, message }
    }

    /// The fastest node, in words.
    fn fastest(&mut self) -> String {
        match self.engine.read_state() {
            Ok(state) => {
                let speeds = state.velocity.iter().map(|v| v.length()).enumerate();
                let (n, speed) = speeds.fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
                let x = self.model.mesh.rest_position(n) * 1e3;
                format!(
                    "the fastest is node {n} (rest position {:.2}, {:.2}, {:.2} mm) with {speed:.4} m/s",
                    x.x, x.y, x.z
                )
            }
            Err(error) => error.to_string(),
        }
    }

    /// A fact that explains much, where it is one.
    fn step_above_the_stable_one(&self) -> String {
        if self.clock.dt <= self.stable_dt {
            return String::new();
        }
        format!("; the time step {:.3} us is above the stable step {:.3} us", self.clock.dt * 1e6, self.stable_dt * 1e6)
    }

    /// Where and how the state broke.
    fn broken(&mut self, record: &FrameRecord) -> Error {
        let place = match self.engine.read_state() {
            Ok(state) => {
                let broken = |v: &DVec3| !v.is_finite() || v.abs().max_element() > LARGEST_DISPLACEMENT;
                let velocity = state.velocity.iter().position(|v| !v.is_finite());
                match state.displacement.iter().position(broken).or(velocity) {
                    Some(n) => {
                        let x = self.model.mesh.rest_position(n) * 1e3;
                        format!(
                            "stage integrate_nodes: displacement or velocity of node {n} (rest position {:.2}, {:.2}, \
                             {:.2} mm) is out of range (u = {:?} m){}",
                            x.x,
                            x.y,
                            x.z,
                            state.displacement[n],
                            if state.displacement[n].is_finite() {
                                ": it has moved by more than 30 mm, as tissue that tore off and that nothing holds does"
                            } else {
                                ""
                            }
                        )
                    }
                    None => "a displacement, a velocity or the stretch of a cell (corners moved apart by more than 7.8 mm, in \
                             tetrahedra 15.6 mm) was out of range"
                        .into(),
                }
            }
            Err(error) => error.to_string(),
        };
        Error::Diverged { frame: record.frame, step: record.step, time_s: record.time, message: place }
    }

    /// Where the tissue moves fastest in a run whose speeds are clamped all over.
    fn runaway(&mut self, record: &FrameRecord, part: f64) -> Error {
        let limit = self.model.speed_limit(self.clock.dt);
        let (place, step) = (self.fastest(), self.step_above_the_stable_one());
        Error::Diverged {
            frame: record.frame,
            step: record.step,
            time_s: record.time,
            message: format!(
                "stage integrate_nodes: {:.0} % of the nodes would move faster than the limit of {limit:.4} m/s (a \
                 tenth of a cell edge per step); {place}{step}",
                100.0 * part
            ),
        }
    }

    /// Where the plastic flow is largest in a run whose return mapping fails.
    fn flow_lost(&mut self, record: &FrameRecord, trouble: &Trouble) -> Error {
        let place = match self.engine.read_state() {
            Ok(state) => {
                let strains = state.points.iter().map(|p| p.plastic.alpha).enumerate();
                let (cell, alpha) = strains.fold((0, 0.0), |a, b| if b.1 > a.1 { b } else { a });
                let x = self.model.mesh.cell_centre(cell) * 1e3;
                format!(
                    "the largest plastic strain is {alpha:.3} in cell {cell} at ({:.2}, {:.2}, {:.2}) mm",
                    x.x, x.y, x.z
                )
            }
            Err(error) => error.to_string(),
        };
        Error::Diverged {
            frame: record.frame,
            step: record.step,
            time_s: record.time,
            message: format!(
                "stage element_forces: the return mapping of the effect plasticity missed the yield condition in {:.2} % of \
                 all cell steps (at most {:.1} %); {place}",
                100.0 * trouble.value,
                100.0 * trouble.bound
            ),
        }
    }
}
