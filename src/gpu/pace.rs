//! How much work the device is given at a time. Nothing ends what has been submitted: whoever asks for the end waits for it. So it is
//! bounded in time, by what the submissions before have taken; in how many parts the steps of a frame go is all that it decides.

use std::collections::VecDeque;

/// Longest time of one submission, and of all that are under way [s]: with two or more of them the device does not wait for the host.
const SUBMITTED: f64 = 0.2;
const UNDER_WAY: f64 = 0.5;

/// Steps of the first submission, which nothing is known about, and most steps of any.
const FIRST: usize = 8;
const MOST: usize = 1024;

/// What is under way, and what a step takes.
#[derive(Debug)]
pub struct Pace<T> {
    under_way: VecDeque<Submission<T>>,
    /// Submissions so far.
    count: u64,
    /// Wall time of a step [s].
    per_step: Option<f64>,
    /// When the last one was seen to be finished [s].
    last_finished: f64,
}

#[derive(Debug)]
struct Submission<T> {
    number: u64,
    steps: usize,
    at: f64,
    token: T,
}

impl<T: Clone> Default for Pace<T> {
    fn default() -> Self {
        Pace { under_way: VecDeque::new(), count: 0, per_step: None, last_finished: 0.0 }
    }
}

impl<T: Clone> Pace<T> {
    /// Whether the next submission must wait for the first: until then nothing is known.
    pub fn must_learn(&self) -> bool {
        self.per_step.is_none() && !self.under_way.is_empty()
    }

    /// Steps of the next submission.
    pub fn steps(&self) -> usize {
        self.per_step.map_or(FIRST, |seconds| ((SUBMITTED / seconds) as usize).clamp(1, MOST))
    }

    /// Whether `steps` more may be submitted while the others are under way.
    pub fn has_room(&self, steps: usize) -> bool {
        let all = steps + self.under_way.iter().map(|s| s.steps).sum::<usize>();
        self.under_way.is_empty() || self.per_step.is_some_and(|seconds| all as f64 * seconds <= UNDER_WAY)
    }

    /// Takes note of a submission at time `now` [s]; its number.
    pub fn submitted(&mut self, steps: usize, token: T, now: f64) -> u64 {
        self.count += 1;
        self.under_way.push_back(Submission { number: self.count, steps: steps.max(1), at: now, token });
        self.count
    }

    /// The oldest submission under way.
    pub fn oldest(&self) -> Option<T> {
        self.under_way.front().map(|s| s.token.clone())
    }

    /// Whether this one may not be finished yet.
    pub fn is_under_way(&self, number: u64) -> bool {
        self.under_way.front().is_some_and(|s| s.number <= number)
    }

    /// The oldest one is seen to be finished; `awaited`: at this moment, otherwise some time ago.
    pub fn finished(&mut self, now: f64, awaited: bool) {
        let Some(done) = self.under_way.pop_front() else { return };
        // One waits for the other.
        let taken = (now - done.at.max(self.last_finished)).max(1e-9) / done.steps as f64;
        self.per_step = Some(match (self.per_step, awaited) {
            (None, _) => taken,
            (Some(known), true) => 0.5 * (known + taken),
            (Some(known), false) => known.min(taken),
        });
        self.last_finished = now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Submits `steps` steps as the engine does, on a device that takes `per_step(t)`; the longest submission, and the longest time
    /// that what is under way takes at any moment, of those after the first `learning` submissions.
    fn driven(frames: &[usize], per_step: impl Fn(u64) -> f64, learning: u64) -> (Pace<f64>, f64, f64, Vec<usize>) {
        let mut pace: Pace<f64> = Pace::default();
        let (mut now, mut device) = (0.0, 0.0);
        let (mut longest, mut most_ahead) = (0.0_f64, 0.0_f64);
        let mut parts = Vec::new();
        for &frame in frames {
            let mut left = frame;
            while left > 0 {
                let mut steps = pace.steps().min(left);
                while pace.must_learn() || !pace.has_room(steps) {
                    let end = pace.oldest().unwrap();
                    let awaited = end > now;
                    now = end.max(now);
                    pace.finished(now, awaited);
                    steps = pace.steps().min(left);
                }
                let taken = steps as f64 * per_step(pace.count);
                device = f64::max(device, now) + taken;
                pace.submitted(steps, device, now);
                if pace.count > learning {
                    longest = longest.max(taken);
                    most_ahead = most_ahead.max(device - now);
                }
                parts.push(steps);
                left -= steps;
            }
        }
        (pace, longest, most_ahead, parts)
    }

    #[test]
    fn submissions_are_bounded_in_time() {
        for per_step in [1e-3, 2.6e-3, 15e-3] {
            let (_, longest, ahead, parts) = driven(&[2300; 4], |_| per_step, 0);
            assert!(longest <= 0.21 && ahead <= 0.55, "{per_step}: {longest} s, {ahead} s ahead");
            assert_eq!(parts.iter().sum::<usize>(), 4 * 2300);
            // The device always has the next one.
            assert!(longest >= 0.19, "{per_step}: {longest}");
        }
        // A step that takes longer than a submission may: one at a time.
        let (_, _, _, parts) = driven(&[40], |_| 0.7, 1);
        assert!(parts[1..].iter().all(|steps| *steps == 1), "{parts:?}");
    }

    #[test]
    fn a_device_that_becomes_slower_is_followed() {
        // Eight times slower from the tenth submission on: two are under way by then.
        let slower = |number: u64| if number < 10 { 1e-3 } else { 8e-3 };
        let (pace, longest, _, _) = driven(&[9000], slower, 16);
        assert!(longest <= 0.25 && (20..30).contains(&pace.steps()), "{longest} s, {} steps", pace.steps());
    }

    #[test]
    fn short_frames_go_as_a_whole() {
        let (_, _, _, parts) = driven(&[8, 40, 40, 40, 40], |_| 0.2e-3, 0);
        assert_eq!(parts, [8, 40, 40, 40, 40]);
        // A host that looks late does not make the device seem slow.
        let mut pace: Pace<()> = Pace::default();
        for (at, seen, awaited) in [(0.0, 0.01, true), (1.0, 3.0, false), (4.0, 4.01, true)] {
            pace.submitted(10, (), at);
            pace.finished(seen, awaited);
        }
        assert_eq!(pace.steps(), 200);
    }
}
