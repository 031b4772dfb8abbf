//! What happens in an attempt, found frame by frame: the same code while it goes on and when it is over.
//!
//! ```text
//! skin pierced         the tip has begun to cut (its material coordinate a > 0)
//! layer entered, left  another material at the end of the cut; on the way out at the tip
//! loss of resistance   a layer gave way by the tip law ([`super::physical`]) and the axial force fell by DROP of what it was within DROP_TIME
//! near, touched        outside of the needle nearer to an obstacle than its goal allows, or in it ([`super::clearance`])
//! bone                 bone pushes back
//! target               tip within the tolerance of the target as it lies now; cut within the layer to stop in; enough of a core
//! passed               the target lies behind the tip by more than the tolerance; the cut is below the layer
//! force limit          axial force above the limit of the task; without one above what a drive stops pushing at ([`crate::model::rigid::LARGEST_FORCE`])
//! withdrawn, pass      the tip is out again; it went in once more ([`super::kinematic::PASS_DEPTH`])
//! redirection          the needle turned inside the tissue by [`super::kinematic::REDIRECTION`]
//! ```

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::body::SceneBody;
use super::clearance::Clearance;
use super::kinematic::{Body, PASS_DEPTH, REDIRECTION, Sample};
use super::physical::{Track, axis_of, cut_end, layer_at};
use super::scene_words;
use crate::model::rigid::LARGEST_FORCE;
use crate::observables::FrameRecord;
use crate::scene::{Goal, Scene};
use crate::words::say_with;

/// Part of its force that a tip must lose for a loss of resistance that a hand feels, and the time that it has for it [s]. The smallest
/// change of a force that hands tell apart is about 7 % (Jones 2000, "Kinesthetic sensing").
const DROP: f64 = 0.1;
const DROP_TIME: f64 = 0.3;

/// Force below which a fall of it is not felt [N]: about the threshold of a finger.
const LEAST_FORCE: f64 = 0.05;

/// Way back from an obstacle, bone or limit before it is told again [m], and its part of a limit of force.
const BACK: f64 = 0.5e-3;
const BACK_PART: f64 = 0.8;

/// Way of the needle after which its distance from an obstacle is measured anew in any case [m]: it is shown while it is led.
const MEASURE_WAY: f64 = 0.25e-3;

/// Distance from an obstacle within which that is done [m].
const MEASURE_WITHIN: f64 = 5e-3;

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    SkinPierced,
    LayerEntered,
    LayerLeft,
    LossOfResistance,
    Near,
    Touched,
    BoneMet,
    TargetReached,
    TargetPassed,
    CoreTaken,
    ForceLimit,
    Withdrawn,
    AnotherPass,
    Redirection,
}

impl Kind {
    /// Key of its words, with a place for the name.
    pub fn word(self) -> &'static str {
        match self {
            Kind::SkinPierced => "event-skin",
            Kind::LayerEntered => "event-entered",
            Kind::LayerLeft => "event-left",
            Kind::LossOfResistance => "event-resistance",
            Kind::Near => "event-near",
            Kind::Touched => "event-touched",
            Kind::BoneMet => "event-bone",
            Kind::TargetReached => "event-target",
            Kind::TargetPassed => "event-passed",
            Kind::CoreTaken => "event-core",
            Kind::ForceLimit => "event-force",
            Kind::Withdrawn => "event-withdrawn",
            Kind::AnotherPass => "event-pass",
            Kind::Redirection => "event-redirection",
        }
    }

    /// What it means for the attempt.
    pub fn gravity(self) -> Gravity {
        match self {
            Kind::TargetReached | Kind::CoreTaken => Gravity::Good,
            Kind::Near | Kind::Touched | Kind::BoneMet | Kind::TargetPassed | Kind::ForceLimit => Gravity::Bad,
            _ => Gravity::Note,
        }
    }
}

/// What an event means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Gravity {
    Good,
    Note,
    Bad,
}

/// One event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// End of the frame in which it was seen [s].
    pub time: f64,
    /// Of the tip along the needle [m].
    pub depth: f64,
    pub kind: Kind,
    /// Layer, obstacle or target; empty where the kind says all.
    pub name: String,
}

impl Event {
    pub fn gravity(&self) -> Gravity {
        self.kind.gravity()
    }

    /// In the present language.
    pub fn text(&self) -> String {
        say_with(self.kind.word(), &[("name", scene_words::name(&self.name).into())])
    }
}

/// An obstacle that is watched.
#[derive(Debug, Clone)]
struct Watched {
    name: String,
    /// The goal wants this much [m].
    least: f64,
    obstacle: Clearance,
    /// What was measured last, and the way of the needle since [m].
    known: f64,
    moved: f64,
    near: bool,
    touched: bool,
}

impl Watched {
    /// Measures where a status may have changed, or what is shown would be too old.
    fn look(&mut self, before: Option<&Sample>, sample: &Sample) {
        if let Some(before) = before {
            let turned = (sample.direction - before.direction).length() * self.obstacle.length();
            self.moved += sample.tip.distance(before.tip) + turned;
        }
        let bound = self.known - self.moved;
        let level = if self.known > self.least { self.least } else { 0.0 };
        let shown = self.known - self.moved < MEASURE_WITHIN && self.moved >= MEASURE_WAY;
        if self.known.is_nan() || bound <= level && self.moved > 0.0 || shown {
            self.known = self.obstacle.of(sample.tip, sample.direction);
            self.moved = 0.0;
        }
    }
}

/// A layer that gave way; whether the hand feels it is not known yet.
#[derive(Debug, Clone)]
struct Yielding {
    layer: String,
    time: f64,
    /// Largest force since, and over [`DROP_TIME`] before [N].
    force: f64,
}

/// What is looked at from frame to frame. It belongs to one attempt.
#[derive(Debug, Clone)]
pub struct Watcher {
    body: SceneBody,
    obstacles: Vec<Watched>,
    attempt: Attempt,
}

/// What is known of the attempt so far.
#[derive(Debug, Clone, Default)]
struct Attempt {
    track: Track,
    yielding: Option<Yielding>,
    /// Times [s] and forces [N] of the last [`DROP_TIME`].
    recent: Vec<(f64, f64)>,
    last: Option<Sample>,
    /// Layer at the end of the cut; none outside.
    layer: Option<String>,
    deepest_cut: f64,
    /// Direction that the next redirection is measured from.
    kept: Option<DVec3>,
    /// This entry is a pass.
    pass: bool,
    passes: u32,
    /// Depth at which bone was met last [m].
    bone: Option<f64>,
    /// The force is above its limit.
    over: bool,
    /// Per goal: reached, passed.
    goals: Vec<[bool; 2]>,
}

impl Watcher {
    /// For an attempt at a scene. Obstacles that are regions are looked for here, which takes a tenth of a second each.
    pub fn new(scene: &Scene) -> Watcher {
        let goals = scene.task.as_ref().map_or(&[][..], |task| &task.goals);
        let watched = |goal: &Goal| match goal {
            Goal::Avoid { name, obstacle, clearance } => Some(Watched {
                name: name.clone(),
                least: *clearance,
                obstacle: Clearance::new(scene, obstacle)?,
                known: f64::NAN,
                moved: 0.0,
                near: false,
                touched: false,
            }),
            _ => None,
        };
        Watcher {
            body: SceneBody::of(scene),
            obstacles: goals.iter().filter_map(watched).collect(),
            attempt: Attempt { goals: vec![[false; 2]; goals.len()], ..Attempt::default() },
        }
    }

    /// The same obstacles for another attempt at the same scene.
    pub fn again(&self) -> Watcher {
        let fresh = |o: &Watched| Watched { known: f64::NAN, moved: 0.0, near: false, touched: false, ..o.clone() };
        Watcher {
            body: self.body.clone(),
            obstacles: self.obstacles.iter().map(fresh).collect(),
            attempt: Attempt { goals: vec![[false; 2]; self.attempt.goals.len()], ..Attempt::default() },
        }
    }

    /// True where a tip is in the tissue at rest.
    pub fn is_inside(&self, tip: DVec3) -> bool {
        self.body.contains(tip)
    }

    /// Name of each obstacle and how far it is [m], as measured last.
    pub fn clearances(&self) -> impl Iterator<Item = (&str, f64)> {
        self.obstacles.iter().map(|o| (o.name.as_str(), o.known))
    }

    /// The obstacles themselves, with their names.
    pub fn obstacles(&self) -> impl Iterator<Item = (&str, &Clearance)> {
        self.obstacles.iter().map(|o| (o.name.as_str(), &o.obstacle))
    }

    /// Takes the next frame; `sample`: the needle at its end. What happened in it is put behind `found`.
    pub fn look(&mut self, scene: &Scene, sample: &Sample, record: &FrameRecord, found: &mut Vec<Event>) {
        let mut tell = |kind: Kind, name: &str| {
            found.push(Event { time: record.time, depth: record.depth, kind, name: name.into() });
        };
        self.through_layers(scene, sample, record, &mut tell);
        self.past_obstacles(sample, &mut tell);
        self.in_and_out(sample, &mut tell);
        let limit = scene.task.as_ref().and_then(|task| task.force_limit).unwrap_or(LARGEST_FORCE);
        self.against_limits(record, limit, &mut tell);
        self.at_goals(scene, sample, record, &mut tell);
        self.attempt.last = Some(*sample);
    }

    fn through_layers(
        &mut self,
        scene: &Scene,
        sample: &Sample,
        record: &FrameRecord,
        tell: &mut impl FnMut(Kind, &str),
    ) {
        let axis = axis_of(sample.tip, sample.direction);
        let force = record.force.axial;
        // A crack that runs has taken the force down before it is through.
        self.attempt.recent.retain(|(time, _)| record.time - time <= DROP_TIME);
        self.attempt.recent.push((record.time, force));
        let force_before = self.attempt.recent.iter().fold(force, |most, (_, force)| most.max(*force));
        let yielding = &mut self.attempt.yielding;
        self.attempt.track.advance(scene, (axis.0, axis.1), record, |layer, top| {
            // The surface itself is told as such.
            if top > 0.0 {
                *yielding = Some(Yielding { layer: layer.into(), time: record.time, force: force_before });
            }
        });
        if let Some(one) = &mut self.attempt.yielding {
            one.force = one.force.max(force);
            if one.force > LEAST_FORCE && force < (1.0 - DROP) * one.force {
                tell(Kind::LossOfResistance, &one.layer);
                self.attempt.yielding = None;
            } else if record.time - one.time > DROP_TIME {
                self.attempt.yielding = None;
            }
        }
        let within = (record.tip_coordinate > 0.0).then(|| layer_at(scene, cut_end(axis, record)));
        if self.attempt.layer.as_deref() == within {
            return;
        }
        let inwards = record.depth >= record.tip_coordinate;
        match (self.attempt.layer.as_deref(), within) {
            (None, Some(name)) => tell(Kind::SkinPierced, name),
            (Some(_), Some(name)) if inwards => tell(Kind::LayerEntered, name),
            (Some(name), _) => tell(Kind::LayerLeft, name),
            (None, None) => {}
        }
        self.attempt.layer = within.map(str::to_string);
    }

    fn past_obstacles(&mut self, sample: &Sample, tell: &mut impl FnMut(Kind, &str)) {
        for obstacle in &mut self.obstacles {
            obstacle.look(self.attempt.last.as_ref(), sample);
            let distance = obstacle.known;
            if distance <= 0.0 && !obstacle.touched {
                obstacle.touched = true;
                tell(Kind::Touched, &obstacle.name);
            } else if distance < obstacle.least && !obstacle.near && !obstacle.touched {
                obstacle.near = true;
                tell(Kind::Near, &obstacle.name);
            }
            obstacle.touched &= distance < BACK;
            obstacle.near &= distance < obstacle.least + BACK;
        }
    }

    fn in_and_out(&mut self, sample: &Sample, tell: &mut impl FnMut(Kind, &str)) {
        let depth = self.body.depth(sample.tip);
        if depth <= 0.0 {
            if self.attempt.pass {
                tell(Kind::Withdrawn, "");
            }
            (self.attempt.pass, self.attempt.kept) = (false, None);
            return;
        }
        if !self.attempt.pass && depth > PASS_DEPTH {
            (self.attempt.pass, self.attempt.passes) = (true, self.attempt.passes + 1);
            if self.attempt.passes > 1 {
                tell(Kind::AnotherPass, "");
            }
        }
        let kept = *self.attempt.kept.get_or_insert(sample.direction);
        if kept.cross(sample.direction).length().atan2(kept.dot(sample.direction)) > REDIRECTION {
            tell(Kind::Redirection, "");
            self.attempt.kept = Some(sample.direction);
        }
    }

    /// `limit`: of the axial force [N].
    fn against_limits(&mut self, record: &FrameRecord, limit: f64, tell: &mut impl FnMut(Kind, &str)) {
        if record.force.bone > 0.0 {
            if self.attempt.bone.is_none() {
                tell(Kind::BoneMet, "");
            }
            self.attempt.bone = Some(record.depth);
        } else if self.attempt.bone.is_some_and(|depth| depth - record.depth > BACK) {
            self.attempt.bone = None;
        }
        if record.force.axial > limit && !self.attempt.over {
            self.attempt.over = true;
            tell(Kind::ForceLimit, "");
        }
        self.attempt.over &= record.force.axial > BACK_PART * limit;
    }

    fn at_goals(&mut self, scene: &Scene, sample: &Sample, record: &FrameRecord, tell: &mut impl FnMut(Kind, &str)) {
        let Some(task) = &scene.task else { return };
        self.attempt.deepest_cut = self.attempt.deepest_cut.max(record.tip_coordinate * -sample.direction.z);
        for (goal, known) in task.goals.iter().zip(&mut self.attempt.goals) {
            let (name, reached, passed) = match goal {
                Goal::HitTarget { target, tolerance } => {
                    let name = scene.targets.get(*target).map_or("", |t| t.name.as_str());
                    let Some(way) = record.targets.get(*target).and_then(|t| t.from_tip) else { continue };
                    (name, way.length() <= *tolerance, way.dot(sample.direction) < -tolerance)
                }
                Goal::StopInLayer { name, from, to } => {
                    let cut = self.attempt.deepest_cut;
                    (name.as_str(), (*from..=*to).contains(&cut), cut > *to)
                }
                Goal::CoreMass { least } => ("", record.core.is_some_and(|core| core.mass >= *least), false),
                Goal::CoreVolume { least } => {
                    let mass = least * scene.material.density;
                    ("", record.core.is_some_and(|core| core.mass >= mass), false)
                }
                Goal::Avoid { .. } | Goal::Figure { .. } => continue,
            };
            if reached && !known[0] {
                known[0] = true;
                // A core has no place, and no name.
                let is_core = matches!(goal, Goal::CoreMass { .. } | Goal::CoreVolume { .. });
                tell(if is_core { Kind::CoreTaken } else { Kind::TargetReached }, name);
            }
            if passed && !known[1] {
                known[1] = true;
                tell(Kind::TargetPassed, name);
            }
        }
    }
}

/// All events of a run; `samples` must cover the time of the records.
pub fn of_run(scene: &Scene, samples: &[Sample], records: &[FrameRecord]) -> Vec<Event> {
    of_run_by(&mut Watcher::new(scene), scene, samples, records)
}

/// The same with a watcher at its beginning.
pub fn of_run_by(watcher: &mut Watcher, scene: &Scene, samples: &[Sample], records: &[FrameRecord]) -> Vec<Event> {
    let mut found = Vec::new();
    for record in records {
        let index = samples.partition_point(|s| s.time <= record.time).max(1) - 1;
        if let Some(sample) = samples.get(index) {
            watcher.look(scene, sample, record, &mut found);
        }
    }
    found
}
