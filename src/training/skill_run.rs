//! One attempt of a synthetic trainee through the simulator, as `stylet view` runs the attempt of a hand, without a window.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::kinematic::Sample;
use super::score::Score;
use super::skill::{Aim, Level, Trainee};
use crate::observables::FrameRecord;
use crate::scene::Scene;
use crate::session::Session;
use crate::simulation::reach::{Reach, speed_limit};
use crate::simulation::{Purpose, Simulation};
use crate::{Error, Result};

/// Longest attempt [s]; a trainee that is not done by then has lost its way.
const LONGEST: f64 = 180.0;

/// How one attempt ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// Of the trainee.
    pub level: Level,
    /// From 0, within its level.
    pub index: u64,
    /// All goals met; `None` where the attempt is not scored.
    pub passed: Option<bool>,
    /// Why the guard stopped the run.
    pub stopped: Option<String>,
    /// Why it is not scored, one sentence each.
    pub reasons: Vec<String>,
    /// Frames in which the hand was faster than the tissue follows, of all.
    pub limited_frames: u64,
    pub frames: u64,
    /// Simulated and wall time [s].
    pub simulated: f64,
    pub wall: f64,
    /// Figures by key, in the unit of their rows; those that the attempt does not hold are left out.
    pub figures: Vec<(String, f64)>,
}

impl Outcome {
    /// The value of a figure.
    pub fn value(&self, key: &str) -> Option<f64> {
        self.figures.iter().find(|(name, _)| name == key).map(|(_, value)| *value)
    }

    /// True where neither guard nor verdict has refused it.
    pub fn is_scored(&self) -> bool {
        self.stopped.is_none() && self.reasons.is_empty()
    }
}

/// Runs one attempt; its session is what a window would have recorded. `None` where the end was asked for.
///
/// # Errors
/// Those of [`Aim::of`] and of the simulation; a run that the guard stops is an outcome, no error.
pub fn attempt(
    scene: &Scene,
    overrides: &[String],
    who: (Level, u64, u64),
    asked: &AtomicBool,
) -> Result<Option<(Outcome, Session)>> {
    let (level, seed, index) = who;
    let begin = std::time::Instant::now();
    let aim = Aim::of(scene)?;
    let purpose = Purpose { led: true, drawn: false, lanes: true };
    let mut simulation = Simulation::for_purpose(scene.clone(), None, purpose)?;
    let fastest = speed_limit(&simulation.model);
    let is_free = Reach::of(&simulation.model, fastest).free.is_some();
    let mut trainee = Trainee::new(aim, is_free, level, seed, index);
    let mut session = Session::new(scene, overrides, simulation.engine().info());
    let mut records: Vec<FrameRecord> = Vec::new();
    let (mut limited_frames, mut stopped) = (0, None);
    let frame = simulation.steps_per_frame() as f64 * simulation.dt();
    while !trainee.is_done() && records.last().is_none_or(|r| r.time < LONGEST) {
        if asked.load(Ordering::Relaxed) {
            return Ok(None);
        }
        let Some(now) = simulation.hand() else { break };
        // As a window does: the first frame is a single step.
        let duration = if session.poses.is_empty() { simulation.end_of(0) } else { frame };
        let reach = Reach::of(&simulation.model, fastest);
        let (pose, limited) = reach.within(&now, &trainee.pose(&now, duration), duration);
        limited_frames += u64::from(limited);
        session.poses.push(pose);
        simulation.lead(&pose);
        match simulation.next_frame() {
            Ok(Some(record)) => {
                trainee.feel(&record);
                records.push(record);
            }
            Ok(None) | Err(Error::Ended(_)) => return Ok(None),
            Err(error @ Error::Diverged { .. }) => {
                stopped = Some(error.to_string());
                break;
            }
            Err(error) => return Err(error),
        }
    }
    let sample = |record: &FrameRecord| {
        let pose = simulation.tool_pose(record.time)?;
        Some(Sample { time: record.time, tip: pose.tip, direction: pose.direction })
    };
    let samples: Vec<Sample> = records.iter().filter_map(sample).collect();
    let mut score = Score::of(scene, &samples, &records, None)?;
    if let Some(reason) = &stopped {
        score.fail(reason.clone());
    }
    let outcome = Outcome {
        level,
        index,
        passed: score.passed(),
        reasons: if stopped.is_some() { Vec::new() } else { score.trust.reasons.clone() },
        stopped,
        limited_frames,
        frames: records.len() as u64,
        simulated: records.last().map_or(0.0, |r| r.time),
        wall: begin.elapsed().as_secs_f64(),
        figures: score.rows.iter().filter_map(|row| Some((row.key.clone(), row.value?))).collect(),
    };
    Ok(Some((outcome, session)))
}
