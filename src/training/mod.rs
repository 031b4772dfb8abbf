//! Training: what a trainee did with the needle, in figures, against the task of the scene.
//!
//! Reading order, which is also the line that an attempt takes: [`kinematic`] (how the needle moved) and [`physical`] (what the
//! tissue felt) -> [`task`] (goals met or not) -> [`score`] (rows, goals, trust; CSV, TSV, JSON, text) -> [`history`] (attempts
//! of a trainee as files). [`texts`] holds every word that a trainee reads. Pure functions; no window, no engine.

pub mod history;
pub mod kinematic;
pub mod physical;
pub mod score;
pub mod task;
pub mod texts;

pub use history::{Attempt, History};
pub use kinematic::{KinematicFigures, Sample};
pub use physical::{PhysicalFigures, Trust};
pub use score::{Row, Score};
pub use task::GoalResult;

use crate::needle::Kinematics;
use crate::observables::FrameRecord;
use crate::scene::Scene;

/// The trajectory of the scene's own motion at the moments of its records, the start before them: the reference attempt. The
/// tip is that of the needle as it is bent; empty without a tool.
pub fn scripted_samples(scene: &Scene, records: &[FrameRecord]) -> Vec<Sample> {
    if scene.tool.is_none() {
        return Vec::new();
    }
    let kinematics = Kinematics::new(&scene.motion);
    let start = kinematics.pose(0.0);
    let first = Sample { time: 0.0, tip: start.tip, direction: start.direction };
    let later = records.iter().map(|record| {
        let pose = kinematics.pose(record.time);
        let tip = pose.tip + record.needle.tip_offset - pose.direction * record.needle.retreat;
        Sample { time: record.time, tip, direction: pose.direction }
    });
    std::iter::once(first).chain(later).collect()
}
