//! Guided mode: the steps of a task, which one is due, and hints where the trainee goes wrong. Everything follows from the task and the motion
//! of the scene, which is its reference attempt; tolerances are choices of this project.
//!
//! ```text
//! entry      the axis of the needle meets the top face within ENTRY of the planned point   (free paths only)
//! angle      the needle points within ANGLE of the planned direction                       (free paths only)
//! advance    until the target is reached ([`Aim`])
//! stop       the needle stands there for STANDS
//! withdraw   the tip is out again                                 (where the reference attempt withdraws)
//! finish     the attempt is handed in
//! ```

use std::collections::VecDeque;

use super::events::Watcher;
use super::kinematic::Sample;
use super::physical::{STANDSTILL, axis_of};
use super::scene_words;
use crate::needle::Phase;
use crate::observables::FrameRecord;
use crate::scene::{Goal, Scene};
use crate::units::short;
use crate::words::{say, say_with};

/// Distance from the planned entry that is near enough [m].
pub const ENTRY: f64 = 1.0e-3;
/// Angle to the planned direction that is near enough, and the one from which a hint is given [rad].
pub const ANGLE: f64 = 3.0 * std::f64::consts::PI / 180.0;
const OBLIQUE: f64 = 8.0 * std::f64::consts::PI / 180.0;
/// Time for which the needle must stand, behind that over which its speed is taken [s].
const STANDS: f64 = 0.25;
/// Time over which a speed is taken [s].
const SPEED_WINDOW: f64 = 0.2;
/// Part of the largest speed of the reference attempt from which on a hand is too fast.
const TOO_FAST: f64 = 1.75;
/// Distance from an obstacle within which a hint is given [m].
const NEAR: f64 = 2.0e-3;
/// How far ahead of the tip bone is looked for, and in which steps [m].
const AHEAD: f64 = 5.0e-3;
const AHEAD_STEP: f64 = 0.5e-3;

/// One step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    Entry,
    Angle,
    Advance,
    Stop,
    Withdraw,
    Finish,
}

impl Step {
    /// Its short name in the present language.
    pub fn title(self) -> &'static str {
        match self {
            Step::Entry => say("step-entry"),
            Step::Angle => say("step-angle"),
            Step::Advance => say("step-advance"),
            Step::Stop => say("step-stop"),
            Step::Withdraw => say("step-withdraw"),
            Step::Finish => say("step-finish"),
        }
    }

    /// What is to be done, in one sentence.
    pub fn text(self) -> &'static str {
        match self {
            Step::Entry => say("step-entry-text"),
            Step::Angle => say("step-angle-text"),
            Step::Advance => say("step-advance-text"),
            Step::Stop => say("step-stop-text"),
            Step::Withdraw => say("step-withdraw-text"),
            Step::Finish => say("step-finish-text"),
        }
    }
}

/// What the advance is for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// A target by its index, within a distance [m].
    Target { index: usize, tolerance: f64 },
    /// Depths of the cut below the top face [m].
    Layer { from: f64, to: f64 },
    /// The depth along the needle that the reference attempt has [m].
    Depth(f64),
}

/// Where the needle is, against the plan.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Place {
    /// Distance of its axis from the planned entry, in the top face [m].
    pub entry: f64,
    /// Angle between needle and plan [rad].
    pub angle: f64,
    /// Way from the tip to the target; to a layer, along the needle: 0 in it, negative behind it [m].
    pub to_target: Option<f64>,
    /// Of the tip along the needle [m].
    pub depth: f64,
    /// Of the tip, over the last moments [m/s].
    pub speed: f64,
}

/// Something that goes wrong.
#[derive(Debug, Clone, PartialEq)]
pub enum Hint {
    OnBone,
    Touching(String),
    Past,
    BoneAhead,
    /// Name and distance [m].
    Near(String, f64),
    OffEntry,
    Oblique,
    TooFast,
}

impl Hint {
    /// What to do about it, in the present language.
    pub fn text(&self) -> String {
        match self {
            Hint::OnBone => say("hint-bone").into(),
            Hint::Touching(name) => say_with("hint-touching", &[("name", scene_words::name(name).into())]),
            Hint::Past => say("hint-past").into(),
            Hint::BoneAhead => say("hint-bone-ahead").into(),
            Hint::Near(name, distance) => {
                let distance = format!("{:.1}", distance * 1e3);
                let places = [("name", scene_words::name(name).into()), ("distance", distance.into())];
                say_with("hint-near", &places)
            }
            Hint::OffEntry => say("hint-entry").into(),
            Hint::Oblique => say("hint-oblique").into(),
            Hint::TooFast => say("hint-fast").into(),
        }
    }
}

/// The guide through one attempt.
#[derive(Debug, Clone)]
pub struct Guide {
    steps: Vec<Step>,
    /// Steps of the list that are done, the ones before the present one.
    done: usize,
    aim: Aim,
    fastest: f64,
    place: Place,
    hints: Vec<Hint>,
    recent: VecDeque<Sample>,
    deepest_cut: f64,
    stands_since: Option<f64>,
    /// The tip is inside the tissue.
    inside: bool,
    /// The path may be chosen.
    free: bool,
}

impl Guide {
    /// For an attempt at a scene; `None` without a task or a needle.
    pub fn new(scene: &Scene) -> Option<Guide> {
        let task = scene.task.as_ref()?;
        scene.needle()?;
        let deepest = Aim::Depth(scene.motion.deepest());
        let aim = task.goals.iter().find_map(|goal| match goal {
            Goal::HitTarget { target, tolerance } => Some(Aim::Target { index: *target, tolerance: *tolerance }),
            Goal::StopInLayer { from, to, .. } => Some(Aim::Layer { from: *from, to: *to }),
            _ => None,
        });
        let free = scene.has_free_path();
        let back = scene.motion.phases.iter().any(|phase| matches!(phase, Phase::Withdraw { .. }));
        let chosen = if free { &[Step::Entry, Step::Angle][..] } else { &[] };
        let mut steps = [chosen, &[Step::Advance, Step::Stop]].concat();
        steps.extend(back.then_some(Step::Withdraw));
        steps.push(Step::Finish);
        Some(Guide {
            steps,
            done: 0,
            aim: aim.unwrap_or(deepest),
            fastest: TOO_FAST * scene.motion.largest_speed(),
            place: Place::default(),
            hints: Vec::new(),
            recent: VecDeque::new(),
            deepest_cut: 0.0,
            stands_since: None,
            inside: false,
            free,
        })
    }

    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Number of the step that is due.
    pub fn present(&self) -> usize {
        self.done.min(self.steps.len() - 1)
    }

    pub fn aim(&self) -> Aim {
        self.aim
    }

    pub fn place(&self) -> &Place {
        &self.place
    }

    /// What goes wrong now, the worst first.
    pub fn hints(&self) -> &[Hint] {
        &self.hints
    }

    /// True where entry and angle may be chosen.
    pub fn path_is_free(&self) -> bool {
        self.free
    }

    /// The planned depth along the needle [m], for a sentence.
    pub fn planned_depth(scene: &Scene) -> String {
        short(scene.motion.deepest() * 1e3)
    }

    /// Takes the next frame; `sample`: the needle at its end. The watcher has seen it already.
    pub fn look(&mut self, scene: &Scene, watcher: &Watcher, sample: &Sample, record: &FrameRecord) {
        self.deepest_cut = self.deepest_cut.max(record.tip_coordinate * -sample.direction.z);
        self.inside = watcher.is_inside(sample.tip);
        self.recent.push_back(*sample);
        while self.recent.len() > 2 && self.recent.get(1).is_some_and(|s| sample.time - s.time >= SPEED_WINDOW) {
            self.recent.pop_front();
        }
        self.place = self.place_of(scene, sample, record);
        let stands = self.place.speed < STANDSTILL;
        self.stands_since = stands.then(|| self.stands_since.unwrap_or(record.time));
        let (met, behind) = (self.is_met(record), self.is_behind());
        // A step that is missed for good does not hold the others up.
        if met || behind {
            self.done += 1;
        }
        self.hints = self.hints_of(scene, watcher, sample, record);
    }

    fn place_of(&self, scene: &Scene, sample: &Sample, record: &FrameRecord) -> Place {
        let (entry, direction, depth) = axis_of(sample.tip, sample.direction);
        let plan = (scene.motion.entry, scene.motion.direction);
        let to_target = match self.aim {
            Aim::Target { index, .. } => record.targets.get(index).and_then(|t| t.from_tip).map(|way| way.length()),
            Aim::Layer { from, to } => {
                let slope = (-direction.z).max(1e-6);
                let cut = record.tip_coordinate.max(0.0) * slope;
                Some(((from - cut).max(0.0) + (to - cut.max(self.deepest_cut)).min(0.0)) / slope)
            }
            Aim::Depth(deepest) => Some((deepest - depth).max(0.0)),
        };
        let speed = self
            .recent
            .front()
            .filter(|first| first.time < sample.time)
            .map_or(0.0, |first| first.tip.distance(sample.tip) / (sample.time - first.time));
        let angle = direction.cross(plan.1).length().atan2(direction.dot(plan.1));
        Place { entry: entry.distance(plan.0), angle, to_target, depth: record.depth, speed }
    }

    /// The tip is where the aim wants it.
    fn on_aim(&self) -> bool {
        match (self.aim, self.place.to_target) {
            (Aim::Target { tolerance, .. }, Some(way)) => way <= tolerance,
            (Aim::Layer { from, .. }, Some(way)) => way == 0.0 && self.deepest_cut >= from,
            // To a tenth of a millimetre.
            (Aim::Depth(_), Some(way)) => way < 1e-4,
            (_, None) => false,
        }
    }

    /// The present step is met now.
    pub fn is_met(&self, record: &FrameRecord) -> bool {
        match self.steps[self.present()] {
            Step::Entry => self.place.entry <= ENTRY,
            Step::Angle => self.place.angle <= ANGLE,
            Step::Advance => self.on_aim(),
            Step::Stop => self.on_aim() && self.stands_since.is_some_and(|since| record.time - since >= STANDS),
            Step::Withdraw => !self.inside,
            Step::Finish => false,
        }
    }

    /// The present step can no longer be met in this pass.
    fn is_behind(&self) -> bool {
        match self.steps[self.present()] {
            Step::Entry | Step::Angle => self.inside && self.place.depth > ENTRY,
            Step::Stop if self.steps.contains(&Step::Withdraw) => self.place.to_target.is_some_and(|way| way > ENTRY),
            _ => false,
        }
    }

    fn hints_of(&self, scene: &Scene, watcher: &Watcher, sample: &Sample, record: &FrameRecord) -> Vec<Hint> {
        let mut hints = Vec::new();
        let on_bone = record.force.bone > 0.0;
        if on_bone {
            hints.push(Hint::OnBone);
        }
        for (name, distance) in watcher.clearances().filter(|_| self.inside) {
            if distance <= 0.0 {
                hints.push(Hint::Touching(name.into()));
            }
        }
        let past = match self.aim {
            Aim::Target { index, tolerance } => {
                let way = record.targets.get(index).and_then(|t| t.from_tip);
                way.is_some_and(|way| way.dot(sample.direction) < -tolerance)
            }
            Aim::Layer { .. } => self.place.to_target.is_some_and(|way| way < 0.0),
            Aim::Depth(_) => false,
        };
        if past {
            hints.push(Hint::Past);
        }
        if !on_bone && self.inside && self.bone_ahead(scene, sample) {
            hints.push(Hint::BoneAhead);
        }
        for (name, distance) in watcher.clearances().filter(|_| self.inside) {
            if distance > 0.0 && distance < NEAR {
                hints.push(Hint::Near(name.into(), distance));
            }
        }
        if self.free && !self.inside && self.place.entry > ENTRY {
            hints.push(Hint::OffEntry);
        }
        if self.free && self.place.angle > OBLIQUE {
            hints.push(Hint::Oblique);
        }
        if self.inside && self.place.speed > self.fastest {
            hints.push(Hint::TooFast);
        }
        hints
    }

    /// Bone lies on the way of the tip, nearer than the target.
    fn bone_ahead(&self, scene: &Scene, sample: &Sample) -> bool {
        if !scene.regions.iter().any(|region| region.material.rigid) {
            return false;
        }
        let reach = self.place.to_target.map_or(AHEAD, |way| way.clamp(0.0, AHEAD));
        let steps = (reach / AHEAD_STEP).floor() as usize;
        (1..=steps).any(|i| scene.material_at(sample.tip + sample.direction * (AHEAD_STEP * i as f64)).rigid)
    }
}
