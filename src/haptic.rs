//! Forces for a device that holds a hand: 1000 a second, from tissue that is solved 20 to 100 times a second.
//!
//! A loop of its own outside the tissue step, as published for 1 kHz haptics over tissue at 20 to 100 Hz [Courtecuisse2015]; theirs also
//! carries a compliance of the tissue into the fast loop, this one carries forces only. Those who hold the needle feel a state one frame
//! after it was solved:
//! ```text
//! solved states a, b (arrived at t_a, t_b)     f(t) = f_a + (f_b - f_a) min(1, (t - t_b)/(t_b - t_a))      never beyond f_b
//! magnitude                                    |f| <= LARGEST, axial and lateral part together
//! no state for SILENCE                         f -> 0 within FADE: a run that stalls must not hold a hand
//! paused                                       f -> 0
//! whatever of these is asked                   |df/dt| <= FASTEST
//! ```
//! [Courtecuisse2015] H. Courtecuisse, Y. Adagolodjo, H. Delingette, C. Duriez, "Haptic Rendering of Hyperelastic Models with Friction",
//! IEEE/RSJ IROS 2015, pp. 591-596, HAL hal-01184113.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use glam::{DVec3, DVec4};

use crate::error::{Error, Result};

/// Time between two outputs [s].
pub const PERIOD: f64 = 1e-3;
/// Largest force [N]: what desktop devices of this kind hold for a moment.
pub const LARGEST: f64 = 20.0;
/// Largest rate of change [N/s]: a puncture lets go of 1 N within 2 ms.
pub const FASTEST: f64 = 500.0;
/// Age of the newest state from which on the force fades [s], and how long that takes [s].
pub const SILENCE: f64 = 0.1;
pub const FADE: f64 = 0.05;

/// Part of a period that the loop watches the clock for, as a sleep may end so much late [s].
const WATCHED: f64 = 0.1e-3;
/// Outputs so late are left out instead of caught up with [s].
const LOST: f64 = 20e-3;

/// The force of a solved state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolvedForce {
    /// Time of the simulation [s].
    pub simulated: f64,
    /// When it came [s], on the clock of [`ForceFeed::at`].
    pub arrived: f64,
    /// Along the needle, positive against an insertion [N], and aside [N].
    pub axial: f64,
    pub lateral: DVec3,
}

impl SolvedForce {
    fn vector(&self) -> DVec4 {
        self.lateral.extend(self.axial)
    }
}

/// A force for a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceSample {
    /// Clock of the loop [s].
    pub time: f64,
    /// As in [`SolvedForce`] [N].
    pub axial: f64,
    pub lateral: DVec3,
    /// Since the newest state came [s]; infinite before the first.
    pub age: f64,
}

/// Turns solved states into outputs, on any clock.
#[derive(Debug, Clone, PartialEq)]
pub struct ForceFeed {
    before: Option<SolvedForce>,
    newest: Option<SolvedForce>,
    paused: bool,
    output: DVec4,
    /// Time of the last output [s].
    last: Option<f64>,
    /// States with numbers that are not finite, which were left out.
    pub refused: u64,
}

impl Default for ForceFeed {
    fn default() -> Self {
        ForceFeed { before: None, newest: None, paused: false, output: DVec4::ZERO, last: None, refused: 0 }
    }
}

impl ForceFeed {
    /// Takes a solved state.
    pub fn solved(&mut self, state: SolvedForce) {
        if !(state.vector().is_finite() && state.arrived.is_finite()) {
            self.refused += 1;
            return;
        }
        // After a stall or a restart there is nothing to come from: the force begins at zero.
        let follows = |b: &SolvedForce| state.simulated > b.simulated && state.arrived - b.arrived <= SILENCE;
        self.before = self.newest.filter(follows);
        self.newest = Some(state);
    }

    /// Silent from now on, or no more. What was before a pause is not felt after it.
    pub fn pause(&mut self, paused: bool) {
        if paused && !self.paused {
            (self.before, self.newest) = (None, None);
        }
        self.paused = paused;
    }

    /// What the states ask for at `time` [s], within the bounds of magnitude and age alone.
    fn asked(&self, time: f64) -> DVec4 {
        let (Some(a), Some(b)) = (self.before, self.newest) else { return DVec4::ZERO };
        if self.paused {
            return DVec4::ZERO;
        }
        let part = ((time - b.arrived) / (b.arrived - a.arrived).max(PERIOD)).clamp(0.0, 1.0);
        let left = 1.0 - ((time - b.arrived - SILENCE) / FADE).clamp(0.0, 1.0);
        (a.vector().lerp(b.vector(), part) * left).clamp_length_max(LARGEST)
    }

    /// The output at `time` [s], which does not go back.
    pub fn at(&mut self, time: f64) -> ForceSample {
        let passed = self.last.map_or(0.0, |last| (time - last).max(0.0));
        self.last = Some(time);
        // Of an output that comes late no more is made than of one in time.
        let step = FASTEST * passed.min(2.0 * PERIOD);
        self.output += (self.asked(time) - self.output).clamp_length_max(step);
        let age = self.newest.map_or(f64::INFINITY, |b| time - b.arrived);
        ForceSample { time, axial: self.output.w, lateral: self.output.truncate(), age }
    }
}

/// What takes the forces: a device, or a file. Called once per period on the thread of the loop; it must not wait.
pub trait ForceSink: Send {
    fn push(&mut self, force: ForceSample);

    /// After the last force.
    ///
    /// # Errors
    /// What went wrong on the way.
    fn finish(&mut self) -> Result<()> {
        Ok(())
    }
}

/// A table of the forces for engineers.
pub struct ForceTable {
    path: PathBuf,
    file: BufWriter<File>,
    failure: Option<std::io::Error>,
}

impl ForceTable {
    /// # Errors
    /// `Error::File` where the file cannot be written.
    pub fn create(path: &Path) -> Result<Self> {
        let file = File::create(path).map_err(|source| Error::file(path, source))?;
        let mut file = BufWriter::with_capacity(256 << 10, file);
        writeln!(file, "time_s,axial_n,lateral_x_n,lateral_y_n,lateral_z_n,age_ms")
            .map_err(|source| Error::file(path, source))?;
        Ok(ForceTable { path: path.to_path_buf(), file, failure: None })
    }
}

impl ForceSink for ForceTable {
    fn push(&mut self, force: ForceSample) {
        if self.failure.is_some() {
            return;
        }
        let DVec3 { x, y, z } = force.lateral;
        let age = force.age * 1e3;
        let row = writeln!(self.file, "{:.6},{:.6},{x:.6},{y:.6},{z:.6},{age:.3}", force.time, force.axial);
        self.failure = row.err();
    }

    fn finish(&mut self) -> Result<()> {
        let failure = self.failure.take().or_else(|| self.file.flush().err());
        failure.map_or(Ok(()), |source| Err(Error::file(&self.path, source)))
    }
}

/// How well the loop kept its time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LoopTiming {
    pub outputs: u64,
    /// From the first to the last output [s].
    pub duration: f64,
    /// Longest time between two outputs [s], and how many were more than half a period late.
    pub longest_gap: f64,
    pub late: u64,
    /// Mean distance of an output from its due time [s].
    pub jitter: f64,
    /// From a solved state to the first output that had it, mean and longest [s], and how many states.
    pub states: u64,
    pub latency: f64,
    pub longest_latency: f64,
}

impl LoopTiming {
    /// Outputs per second.
    pub fn rate(&self) -> f64 {
        if self.duration > 0.0 { (self.outputs.max(1) - 1) as f64 / self.duration } else { 0.0 }
    }

    fn output(&mut self, due: f64, time: f64, last: Option<f64>) {
        self.outputs += 1;
        self.jitter += ((time - due).abs() - self.jitter) / self.outputs as f64;
        let Some(last) = last else { return };
        self.duration += time - last;
        self.longest_gap = self.longest_gap.max(time - last);
        self.late += u64::from(time - due > 0.5 * PERIOD);
    }

    fn felt(&mut self, latency: f64) {
        self.states += 1;
        self.latency += (latency - self.latency) / self.states as f64;
        self.longest_latency = self.longest_latency.max(latency);
    }

    /// For people.
    pub fn text(&self) -> String {
        format!(
            "{:.1} forces/s, {:.3} ms off in the mean, longest gap {:.2} ms, {} of {} late; a solved state is in a force after {:.2} ms \
             in the mean, {:.2} ms at most",
            self.rate(),
            self.jitter * 1e3,
            self.longest_gap * 1e3,
            self.late,
            self.outputs,
            self.latency * 1e3,
            self.longest_latency * 1e3
        )
    }
}

/// What the loop and its owner share. Locked for some hundred nanoseconds.
#[derive(Default)]
struct Shared {
    feed: ForceFeed,
    timing: LoopTiming,
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A running loop. Dropped, it ends with the last force that it gave: [`ForceLoop::finish`] ends it at zero.
pub struct ForceLoop {
    shared: Arc<Mutex<Shared>>,
    begin: Instant,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<Result<()>>>,
}

impl ForceLoop {
    /// Gives forces to a sink from now on.
    ///
    /// # Errors
    /// `Error::Device` where there is no thread.
    pub fn start(mut sink: Box<dyn ForceSink>) -> Result<Self> {
        let (shared, stop) = (Arc::new(Mutex::new(Shared::default())), Arc::new(AtomicBool::new(false)));
        let begin = Instant::now();
        let (known, told) = (shared.clone(), stop.clone());
        let thread = thread::Builder::new().name("force loop".into()).spawn(move || {
            run(&known, &told, begin, sink.as_mut());
            sink.finish()
        });
        let thread = thread.map_err(|reason| Error::Device(format!("no thread for the forces: {reason}")))?;
        Ok(ForceLoop { shared, begin, stop, thread: Some(thread) })
    }

    /// Takes the force of a state that has just been solved.
    pub fn solved(&self, simulated: f64, axial: f64, lateral: DVec3) {
        let mut shared = lock(&self.shared);
        shared.feed.solved(SolvedForce { simulated, arrived: self.begin.elapsed().as_secs_f64(), axial, lateral });
    }

    pub fn pause(&self, paused: bool) {
        lock(&self.shared).feed.pause(paused);
    }

    pub fn timing(&self) -> LoopTiming {
        lock(&self.shared).timing
    }

    /// Lets the force go to zero and ends the loop.
    ///
    /// # Errors
    /// Those of the sink.
    pub fn finish(mut self) -> Result<LoopTiming> {
        self.pause(true);
        thread::sleep(Duration::from_secs_f64(LARGEST / FASTEST + 2.0 * PERIOD));
        self.stop.store(true, Ordering::Release);
        let ended = self.thread.take().map(JoinHandle::join);
        match ended {
            Some(Ok(result)) => result.map(|()| self.timing()),
            _ => Err(Error::Device("the loop of the forces has broken down".into())),
        }
    }
}

impl Drop for ForceLoop {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The loop: sleeps almost until an output is due, and watches the clock for the rest. Due times are absolute, so that what one output is
/// late is not added to the next.
fn run(shared: &Mutex<Shared>, stop: &AtomicBool, begin: Instant, sink: &mut dyn ForceSink) {
    let now = || begin.elapsed().as_secs_f64();
    let (mut due, mut last, mut felt) = (now() + PERIOD, None, None);
    while !stop.load(Ordering::Acquire) {
        let left = due - now();
        if left > WATCHED {
            thread::sleep(Duration::from_secs_f64(left - WATCHED));
        }
        while now() < due {
            std::hint::spin_loop();
        }
        let time = now();
        let mut known = lock(shared);
        let force = known.feed.at(time);
        let newest = known.feed.newest.map(|b| b.arrived);
        known.timing.output(due, time, last);
        if newest.is_some() && newest != felt {
            known.timing.felt(force.age);
            felt = newest;
        }
        drop(known);
        sink.push(force);
        last = Some(time);
        due += PERIOD;
        if time - due > LOST {
            due = time + PERIOD;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(simulated: f64, arrived: f64, axial: f64) -> SolvedForce {
        SolvedForce { simulated, arrived, axial, lateral: DVec3::ZERO }
    }

    /// Outputs of a clock that ticks once per period, with states on the way: time of arrival and axial force.
    fn outputs(states: &[(f64, f64)], until: f64) -> Vec<ForceSample> {
        let mut feed = ForceFeed::default();
        let mut coming = states.iter().peekable();
        (0..)
            .map(|n| f64::from(n) * PERIOD)
            .take_while(|t| *t < until)
            .map(|time| {
                while let Some((arrived, axial)) = coming.next_if(|s| s.0 <= time) {
                    feed.solved(state(*arrived, *arrived, *axial));
                }
                feed.at(time)
            })
            .collect()
    }

    fn at(outputs: &[ForceSample], time: f64) -> f64 {
        outputs[(time / PERIOD).round() as usize].axial
    }

    #[test]
    fn a_force_is_between_the_last_two_states_one_frame_late() {
        // 60 Hz, a ramp of 30 N/s.
        let frame = 1.0 / 60.0;
        let states: Vec<(f64, f64)> = (1..30).map(|n| (f64::from(n) * frame, 30.0 * f64::from(n) * frame)).collect();
        let outputs = outputs(&states, 0.48);
        for time in [0.1, 0.2, 0.3, 0.4] {
            // The state that came at t is reached a frame later.
            assert!((at(&outputs, time) - 30.0 * (time - frame)).abs() < 0.05, "{}", at(&outputs, time));
        }
        // Never beyond what was solved.
        for sample in &outputs {
            let newest = states.iter().rfind(|s| s.0 <= sample.time).map_or(0.0, |s| s.1);
            assert!(sample.axial <= newest + 1e-12);
        }
        // A single state is no two.
        assert_eq!(at(&outputs, 0.030), 0.0);
    }

    #[test]
    fn a_jump_is_a_ramp_and_too_much_is_cut() {
        let states: Vec<(f64, f64)> = (1..40).map(|n| (0.005 * f64::from(n), if n < 10 { 0.0 } else { 1e3 })).collect();
        let outputs = outputs(&states, 0.19);
        for pair in outputs.windows(2) {
            assert!((pair[1].axial - pair[0].axial).abs() <= FASTEST * PERIOD + 1e-9);
        }
        assert!((outputs.last().unwrap().axial - LARGEST).abs() < 1e-9);
        let mut feed = ForceFeed::default();
        for (n, age) in [(1.0, 0.0), (2.0, 0.01)] {
            feed.solved(SolvedForce { simulated: n, arrived: age, axial: -30.0, lateral: DVec3::new(30.0, 0.0, 0.0) });
        }
        let last = (0..100).map(|n| feed.at(0.01 + f64::from(n) * PERIOD)).last().unwrap();
        assert!((last.axial.hypot(last.lateral.length()) - LARGEST).abs() < 1e-9);
        assert!((last.axial + last.lateral.x).abs() < 1e-9, "the direction stays");
    }

    #[test]
    fn a_stalled_run_lets_go() {
        let states: Vec<(f64, f64)> = (1..=20).map(|n| (0.02 * f64::from(n), 5.0)).collect();
        let outputs = outputs(&states, 0.8);
        assert_eq!(at(&outputs, 0.45), 5.0);
        assert!((at(&outputs, 0.525) - 2.5).abs() < 0.5);
        assert!(outputs.iter().filter(|s| s.time > 0.4 + SILENCE + FADE + 2.0 * PERIOD).all(|s| s.axial == 0.0));
        // A state after the stall is no end of a long ramp from the old one.
        let mut feed = ForceFeed::default();
        feed.solved(state(0.0, 0.0, 5.0));
        feed.solved(state(0.1, 5.0, 9.0));
        assert_eq!(feed.at(5.001).axial, 0.0);
    }

    #[test]
    fn a_pause_and_a_restart_are_silent() {
        let mut feed = ForceFeed::default();
        let mut time = 0.0;
        let mut tick = |feed: &mut ForceFeed, count: u32| {
            (0..count).fold(0.0, |_, _| {
                time += PERIOD;
                feed.at(time).axial
            })
        };
        feed.solved(state(0.0, 0.0, 3.0));
        feed.solved(state(0.01, 0.01, 3.0));
        assert_eq!(tick(&mut feed, 50), 3.0);
        feed.pause(true);
        feed.pause(true);
        let first = tick(&mut feed, 1);
        let lowest = 3.0 - FASTEST * PERIOD - 1e-9;
        assert!((lowest..3.0).contains(&first), "no jump: {first}");
        assert_eq!(tick(&mut feed, 20), 0.0);
        feed.solved(state(0.02, 0.06, 3.0));
        assert_eq!(tick(&mut feed, 5), 0.0);
        feed.pause(false);
        feed.solved(state(0.03, 0.08, 2.0));
        assert!(tick(&mut feed, 40) > 1.0);
        // The simulation began anew.
        feed.solved(state(0.0, 0.12, 7.0));
        assert_eq!(tick(&mut feed, 40), 0.0);
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        let mut feed = ForceFeed::default();
        feed.solved(state(0.0, 0.0, f64::NAN));
        feed.solved(SolvedForce { lateral: DVec3::splat(f64::INFINITY), ..state(0.01, 0.01, 1.0) });
        assert_eq!((feed.refused, feed.newest), (2, None));
        assert_eq!(feed.at(0.02).axial, 0.0);
    }

    /// A sink that keeps everything.
    struct Kept(Arc<Mutex<Vec<ForceSample>>>);

    impl ForceSink for Kept {
        fn push(&mut self, force: ForceSample) {
            self.0.lock().unwrap().push(force);
        }
    }

    #[test]
    fn the_loop_runs_at_its_rate_on_a_real_clock() {
        let kept = Arc::new(Mutex::new(Vec::new()));
        let forces = ForceLoop::start(Box::new(Kept(kept.clone()))).unwrap();
        for n in 0..60 {
            forces.solved(f64::from(n) * 0.016, 2.0, DVec3::new(0.0, 0.5, 0.0));
            thread::sleep(Duration::from_millis(16));
        }
        let timing = forces.finish().unwrap();
        println!("{}", timing.text());
        let kept = kept.lock().unwrap();
        // A machine that is busy with other things loses some.
        assert!(timing.rate() > 500.0 && timing.rate() < 1010.0, "{timing:?}");
        assert_eq!(kept.len() as u64, timing.outputs);
        assert!(timing.states > 20 && timing.latency < 0.05, "{timing:?}");
        assert!(kept.windows(2).all(|pair| pair[1].time > pair[0].time));
        assert!(kept.iter().any(|s| (s.axial - 2.0).abs() < 1e-9));
        assert!(kept.last().unwrap().axial.abs() < 0.5, "ends at zero: {:?}", kept.last());
    }

    #[test]
    fn a_table_of_forces_is_a_table() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("forces.csv");
        let forces = ForceLoop::start(Box::new(ForceTable::create(&path).unwrap())).unwrap();
        thread::sleep(Duration::from_millis(50));
        let timing = forces.finish().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().next(), Some("time_s,axial_n,lateral_x_n,lateral_y_n,lateral_z_n,age_ms"));
        assert_eq!(text.lines().count() as u64, 1 + timing.outputs);
        assert!(text.lines().skip(1).all(|row| row.split(',').count() == 6 && row.ends_with("inf")));
        assert!(ForceTable::create(&place.path().join("nowhere/forces.csv")).is_err());
    }
}
