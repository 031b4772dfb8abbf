//! Which steps a frame has, and when they happen.

use serde::{Deserialize, Serialize};

/// Steps of one length from a moment on; where the length changes the count of frames and steps goes on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Length of a step [s].
    pub dt: f64,
    pub steps_per_frame: u64,
    /// Steps of the first frame.
    first: u64,
    /// Frame, step and time [s] from which on steps have this length.
    frame: u64,
    step: u64,
    time: f64,
}

impl Clock {
    /// From t = 0 on. The first frame is a single step, so that the time to the first step can be told.
    pub fn new(dt: f64, steps_per_frame: u64) -> Self {
        Clock { dt, steps_per_frame, first: 1, frame: 0, step: 0, time: 0.0 }
    }

    /// The same until `frame` begins, then steps of another length.
    pub fn changed(&self, frame: u64, dt: f64, steps_per_frame: u64) -> Self {
        let step = self.first_step(frame);
        Clock { dt, steps_per_frame, first: 1, frame, step, time: self.time_of(step) }
    }

    /// Steps of half the length, of which there were as many from the beginning: frames stay where they were.
    pub fn halved(&self) -> Self {
        Clock {
            dt: 0.5 * self.dt,
            steps_per_frame: 2 * self.steps_per_frame,
            first: 2 * self.first,
            step: 2 * self.step,
            ..*self
        }
    }

    /// Steps before a frame, from the last change on.
    pub fn first_step(&self, frame: u64) -> u64 {
        match (frame, self.frame) {
            (0, _) => 0,
            (_, 0) => self.first + (frame - 1) * self.steps_per_frame,
            (_, begin) => self.step + (frame - begin) * self.steps_per_frame,
        }
    }

    /// When a step begins [s].
    pub fn time_of(&self, step: u64) -> f64 {
        self.time + (step as f64 - self.step as f64) * self.dt
    }

    /// Steps after which `time` [s] is reached.
    pub fn steps_until(&self, time: f64) -> u64 {
        self.step + (((time - self.time) / self.dt) * (1.0 - 1e-9)).ceil().max(0.0) as u64
    }

    /// The frame that ends with `steps` steps done, or in which they are.
    pub fn frame_of(&self, steps: u64) -> u64 {
        match self.frame {
            0 => steps.saturating_sub(self.first).div_ceil(self.steps_per_frame),
            begin => (begin + steps.saturating_sub(self.step).div_ceil(self.steps_per_frame)).saturating_sub(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_follow_each_other_before_and_after_a_change() {
        let before = Clock::new(1e-3, 16);
        assert_eq!([0, 1, 2, 3].map(|f| before.first_step(f)), [0, 1, 17, 33]);
        assert_eq!((before.steps_until(0.017), before.frame_of(17), before.frame_of(18)), (17, 1, 2));
        let after = before.changed(3, 2e-3, 8);
        assert_eq!([3, 4, 5].map(|f| after.first_step(f)), [33, 41, 49]);
        assert!((after.time_of(33) - 0.033).abs() < 1e-15 && (after.time_of(41) - 0.049).abs() < 1e-15);
        assert_eq!((after.steps_until(0.049), after.frame_of(41)), (41, 3));
        assert_eq!((after.steps_until(0.050), after.frame_of(42)), (42, 4));
        let halved = after.halved();
        assert_eq!([3, 4, 5].map(|f| halved.first_step(f)), [66, 82, 98]);
        assert_eq!([0, 1, 2].map(|f| before.halved().first_step(f)), [0, 2, 34]);
        assert!((halved.time_of(98) - after.time_of(49)).abs() < 1e-15);
    }
}
