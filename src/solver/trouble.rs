//! What a run that stops says: where, what, and the way out.

use glam::DVec3;

use super::guard::{CREATED_PART, INVERTED_PART, LONG_PATIENCE, PATIENCE, Trouble};
use super::simulation::{RETURN_FAILURE_PART, Simulation};
use crate::error::Error;
use crate::observables::FrameRecord;

impl Simulation {
    /// The error of a run that the guard has stopped after the frame of `record`.
    pub(super) fn stopped(&mut self, record: &FrameRecord, trouble: Trouble) -> Error {
        match trouble {
            Trouble::NotFinite => self.broken(record),
            Trouble::Speed(part) => self.runaway(record, part),
            Trouble::Energy { created, put_in } => {
                let (place, way_out) = (self.fastest(), self.smaller_step());
                self.error(record, format!(
                    "{:.3e} J of energy were created since t = 0, {:.0} % of the {put_in:.3e} J that were put in (at most {:.0} % in \
                     {PATIENCE} frames on end); {}\n  way out: {}",
                    created,
                    100.0 * created / put_in,
                    100.0 * CREATED_PART,
                    place,
                    way_out
                ))
            }
            Trouble::Inversion(cells) => {
                let place = record.health.inverted_cell.map_or(String::new(), |cell| {
                    let x = self.model.mesh.cell_centre(cell as usize) * 1e3;
                    format!("; one is cell {cell} at ({:.2}, {:.2}, {:.2}) mm", x.x, x.y, x.z)
                });
                self.error(
                    record,
                    format!(
                        "{cells} cells are inside out and do not get fewer in {LONG_PATIENCE} frames (at most {:.0} % of all \
                         may){place}\n  way out: load the tissue less or more slowly, refine the cells, or raise \
                         solver.hourglass_stiffness",
                        100.0 * INVERTED_PART
                    ),
                )
            }
        }
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

    fn smaller_step(&self) -> String {
        if self.clock.dt > self.stable_dt {
            return format!(
                "the time step {:.3} us is above the stable step {:.3} us: drop time_step_us",
                self.clock.dt * 1e6,
                self.stable_dt * 1e6
            );
        }
        "lower solver.safety or the speed of the tool, or write solver.on_trouble = \"halve_step\"".into()
    }

    /// Where and how the state broke.
    fn broken(&mut self, record: &FrameRecord) -> Error {
        let place = match self.engine.read_state() {
            Ok(state) => {
                let broken = |v: &DVec3| !v.is_finite() || v.abs().max_element() > 0.03;
                let velocity = state.velocity.iter().position(|v| !v.is_finite());
                match state.displacement.iter().position(broken).or(velocity) {
                    Some(n) => {
                        let x = self.model.mesh.rest_position(n) * 1e3;
                        format!(
                            "stage integrate_nodes: displacement or velocity of node {n} (rest position {:.2}, {:.2}, \
                             {:.2} mm) is out of range (u = {:?} m)",
                            x.x, x.y, x.z, state.displacement[n]
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
        let (place, way_out) = (self.fastest(), self.smaller_step());
        Error::Diverged {
            frame: record.frame,
            step: record.step,
            time_s: record.time,
            message: format!(
                "stage integrate_nodes: {:.0} % of the nodes would move faster than the limit of {limit:.4} m/s (a \
                 tenth of a cell edge per step); {place}\n  way out: {way_out}",
                100.0 * part
            ),
        }
    }

    /// Where the plastic flow is largest in a run whose return mapping fails.
    pub(super) fn flow_lost(&mut self, record: &FrameRecord, part: f64) -> Error {
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
                 all cell steps (at most {:.1} %); {place}\n  way out: lower solver.safety or the speed of what moves, raise \
                 yield_stress_kpa or hardening_kpa, or raise solver.hourglass_stiffness where cells fold",
                100.0 * part,
                100.0 * RETURN_FAILURE_PART
            ),
        }
    }
}
