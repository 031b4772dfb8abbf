//! Steps of a frame and frames of a run: both are kept in memory, so both have a bound.

use super::*;

/// Most memory that the records of a run may take [B].
const MOST_RECORD_BYTES: f64 = 1024.0 * 1024.0 * 1024.0;

/// Steps of `time_step` [s] that fill a frame at `frame_rate` [Hz].
fn steps_per_frame(time_step: f64, frame_rate: f64) -> f64 {
    (1.0 / frame_rate / time_step * (1.0 - 1e-9)).ceil().max(1.0)
}

/// Three digits rounded up, so that what a message offers is accepted.
fn rounded_up(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 2.0);
    four_digits((value / unit).ceil() * unit)
}

/// Three digits rounded down.
fn rounded_down(value: f64) -> f64 {
    let unit = 10f64.powf(value.log10().floor() - 2.0);
    four_digits((value / unit).floor() * unit)
}

impl Check<'_> {
    /// A frame has at most [`MOST_STEPS_PER_FRAME`] steps of the scene's own length. A computed step is known with the model only:
    /// `Simulation::new` looks at that.
    pub(super) fn steps(&mut self, solver: &SolverSettings) {
        let Some(time_step) = solver.time_step else { return };
        let steps = steps_per_frame(time_step, solver.frame_rate);
        if steps <= MOST_STEPS_PER_FRAME as f64 {
            return;
        }
        let (shortest, rate) = (
            rounded_up(1e6 / (solver.frame_rate * MOST_STEPS_PER_FRAME as f64)),
            rounded_up(1.0 / (time_step * MOST_STEPS_PER_FRAME as f64)),
        );
        let faster = match rate <= HIGHEST_FRAME_RATE {
            true => format!(", or a solver.frame_rate_hz of at least {rate}"),
            false => String::new(),
        };
        self.problems.report(
            "solver.time_step_us",
            format!(
                "a frame of {} s needs {steps:.3e} steps of {} us, at most {MOST_STEPS_PER_FRAME} are kept in memory",
                four_digits(1.0 / solver.frame_rate),
                four_digits(time_step * 1e6)
            ),
            "too short for this frame rate",
            format!(
                "leave time_step_us away, which takes the stable step, or write at least {shortest} at {} Hz{faster}",
                four_digits(solver.frame_rate)
            ),
        );
    }

    /// The records of all frames fit into [`MOST_RECORD_BYTES`].
    pub(super) fn frames(&mut self, solver: &SolverSettings, motion: &Motion, targets: usize) {
        let duration = solver.duration.unwrap_or_else(|| motion.legs().iter().map(|leg| leg.duration).sum());
        let frames = duration * solver.frame_rate;
        let bytes = frames * (RECORD_BYTES + RECORD_BYTES_PER_TARGET * targets) as f64;
        if bytes <= MOST_RECORD_BYTES {
            return;
        }
        let rate = rounded_down(solver.frame_rate * MOST_RECORD_BYTES / bytes);
        let slower = match rate >= LOWEST_FRAME_RATE {
            true => format!("write a solver.frame_rate_hz of at most {rate}, or "),
            false => String::new(),
        };
        let (at, shorter) = match solver.duration {
            Some(_) => ("solver.duration_s", "a shorter duration_s"),
            None => ("motion.phase", "faster or shorter phases"),
        };
        self.problems.report(
            at,
            format!(
                "the run of {} s has {frames:.3e} frames, whose records take {} GiB, at most {} are kept in memory",
                four_digits(duration),
                gib(bytes),
                gib(MOST_RECORD_BYTES)
            ),
            "too many frames",
            format!("{slower}{shorter}"),
        );
    }
}
