//! How long frames, pictures and inputs take while an insertion is practised.

/// Times of the last frames [s].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Timing {
    /// Simulated time of a frame.
    pub simulated: f64,
    /// Wall time from the start of a frame to its results, smoothed.
    pub physics: f64,
    /// Wall time from one drawn frame to the next, smoothed.
    pub between: f64,
    /// Wall time for which the run has been on, and what was simulated in it.
    pub running: f64,
    pub done: f64,
}

/// How long inputs took until the hand felt them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Latency {
    /// Inputs that were measured.
    pub count: u64,
    /// Frames of the tissue that ended between an input and its force, the frame that has it included; most of all.
    pub most_frames: u64,
    /// Wall time, mean and longest [s].
    pub mean: f64,
    pub longest: f64,
}

impl Latency {
    pub(super) fn add(&mut self, frames: u64, time: f64) {
        self.count += 1;
        self.most_frames = self.most_frames.max(frames);
        self.mean += (time - self.mean) / self.count as f64;
        self.longest = self.longest.max(time);
    }
}

impl Timing {
    /// Takes a wall time into a mean over about ten frames.
    pub(super) fn smooth(mean: &mut f64, value: f64) {
        *mean = if *mean == 0.0 { value } else { 0.9 * *mean + 0.1 * value };
    }

    /// Simulated over wall time while the run was on.
    pub fn achieved(&self) -> f64 {
        if self.running > 0.0 { self.done / self.running } else { 0.0 }
    }

    /// Simulated time over wall time that the physics alone would reach.
    pub fn real_time_factor(&self) -> f64 {
        if self.physics > 0.0 { self.simulated / self.physics } else { 0.0 }
    }

    pub fn frames_per_second(&self) -> f64 {
        if self.between > 0.0 { 1.0 / self.between } else { 0.0 }
    }
}
