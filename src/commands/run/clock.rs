//! Time that a run takes.

use std::time::Instant;

use crate::process;

/// Wall and CPU time of the steps [s]; pictures, field files and checkpoints are no part of them.
pub struct Clock {
    begin: Instant,
    cpu_begin: Option<f64>,
    /// Spent on something else.
    aside: (f64, f64),
    /// Of the run before it was resumed.
    earlier: (f64, Option<f64>),
}

impl Clock {
    pub fn start(earlier: (f64, Option<f64>)) -> Self {
        Clock { begin: Instant::now(), cpu_begin: process::cpu_seconds(), aside: (0.0, 0.0), earlier }
    }

    /// Runs something that is no part of the steps.
    pub fn aside<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (wall, cpu) = (Instant::now(), process::cpu_seconds());
        let done = work();
        self.aside.0 += wall.elapsed().as_secs_f64();
        self.aside.1 += difference(process::cpu_seconds(), cpu).unwrap_or(0.0);
        done
    }

    /// Since the program began.
    pub fn here(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() - self.aside.0
    }

    pub fn wall(&self) -> f64 {
        self.earlier.0 + self.here()
    }

    pub fn cpu(&self) -> Option<f64> {
        Some(self.earlier.1? + difference(process::cpu_seconds(), self.cpu_begin)? - self.aside.1)
    }
}

fn difference(after: Option<f64>, before: Option<f64>) -> Option<f64> {
    Some(after? - before?)
}
