//! Training: what a trainee did with the needle, in figures, against the task of the scene.
//!
//! Reading order, which is also the line that an attempt takes: [`kinematic`] (how the needle moved) and [`physical`] (what the
//! tissue felt) -> [`task`] (goals met or not) -> [`score`] (rows, goals, trust; CSV, TSV, JSON, text) -> [`history`] (attempts
//! of a trainee as files), [`trainees`] (who they are). Beside it, from frame to frame: [`events`] (what happens, [`clearance`] from what is to be avoided) and [`guide`]
//! (which step is due, hints). When it is over: [`debrief`] (verdict, why, when), with the [`key_figures`] of the task. [`texts`] holds the
//! labels of tables, which are English; what a trainee reads in the window comes from [`crate::words`], the texts of the
//! program's own scenes through [`scene_words`]. Pure functions; no window, no engine.

pub mod body;
pub mod class;
pub mod clearance;
pub mod debrief;
pub mod events;
pub mod guide;
pub mod history;
pub mod key_figures;
pub mod kinematic;
pub mod notes;
pub mod own_task;
pub mod physical;
pub mod report;
pub mod scene_words;
pub mod score;
pub mod skill;
pub mod skill_evidence;
pub mod skill_page;
pub mod skill_run;
pub mod statistics;
pub mod task;
pub mod texts;
pub mod trainees;
pub mod xapi;

pub use debrief::Debrief;
pub use events::{Event, Watcher};
pub use guide::Guide;
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
