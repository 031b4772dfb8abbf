//! The debriefing of an attempt: verdict, why, and when; in words of the trade ([`crate::words`]). What is drawn of it is the window's.

use super::events::{self, Event, Kind, Watcher};
use super::history::{Attempt, progress};
use super::key_figures;
use super::kinematic::Sample;
use super::scene_words;
use super::score::{Row, Score};
use super::task::GoalResult;
use super::texts::Better;
use crate::observables::FrameRecord;
use crate::output::curve::frames_on_the_way_in;
use crate::scene::{Goal, Scene};
use crate::verdict::Quantity;
use crate::words::{Value, say, say_of, say_with};

/// Way between two points of the reference path [m].
const REFERENCE_STEP: f64 = 0.2e-3;

/// What the attempt has come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    Passed,
    Failed,
    /// Its numbers cannot be trusted.
    NotScored,
    /// The scene has no task.
    NoTask,
}

impl Verdict {
    pub fn of(score: &Score) -> Verdict {
        match score.passed() {
            Some(true) => Verdict::Passed,
            Some(false) => Verdict::Failed,
            None if !score.trust.is_good() => Verdict::NotScored,
            None => Verdict::NoTask,
        }
    }

    pub fn text(self) -> &'static str {
        match self {
            Verdict::Passed => say("verdict-passed"),
            Verdict::Failed => say("verdict-failed"),
            Verdict::NotScored => say("verdict-not-scored"),
            Verdict::NoTask => say("verdict-no-task"),
        }
    }
}

/// One goal, how it went and when that was decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    pub goal: GoalResult,
    /// Target, layer or obstacle; empty where there is none.
    pub name: String,
    /// [s]; `None` where the run does not tell.
    pub moment: Option<f64>,
}

impl Finding {
    /// In one sentence.
    pub fn text(&self) -> String {
        let number = |value: Option<f64>| Value::from(value.map_or_else(|| "-".to_string(), spoken));
        let goal = &self.goal;
        let key = match (goal.key.as_str(), goal.met, goal.measured) {
            (_, None, _) | (_, _, None) => "goal-unjudged",
            ("hit_target", Some(true), _) => "goal-hit-met",
            ("hit_target", ..) => "goal-hit-missed",
            ("avoid", Some(true), _) => "goal-avoid-met",
            ("avoid", _, Some(distance)) if distance > 0.0 => "goal-avoid-near",
            ("avoid", ..) => "goal-avoid-touched",
            ("stop_in_layer", Some(true), _) => "goal-stop-met",
            ("stop_in_layer", _, Some(depth)) if goal.least.is_some_and(|least| depth < least) => "goal-stop-short",
            ("stop_in_layer", ..) => "goal-stop-past",
            ("core", Some(true), _) => "goal-core-met",
            ("core", ..) => "goal-core-missed",
            ("figure", Some(true), _) => "goal-figure-met",
            ("figure", ..) => "goal-figure-missed",
            ("force_limit", Some(true), _) => "goal-force-met",
            ("force_limit", ..) => "goal-force-missed",
            (_, Some(true), _) => "goal-time-met",
            _ => "goal-time-missed",
        };
        let name = match goal.key.as_str() {
            "figure" => say_of(&format!("figure-{}", self.name)).unwrap_or(&self.name),
            _ => scene_words::name(&self.name),
        };
        // A count has none.
        let unit = if goal.unit.is_empty() { String::new() } else { format!(" {}", goal.unit) };
        let places = [
            ("name", name.into()),
            ("measured", number(goal.measured)),
            ("least", number(goal.least)),
            ("most", number(goal.most)),
            ("unit", unit.into()),
        ];
        say_with(key, &places)
    }
}

/// One of the figures that matter, with those of the attempts before.
#[derive(Debug, Clone, PartialEq)]
pub struct KeyFigure {
    pub row: Row,
    /// Number of the attempt and value, in the unit of the row.
    pub trend: Vec<(u32, f64)>,
}

/// Force and depth at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// [s]
    pub time: f64,
    /// Axial [N].
    pub force: f64,
    /// Of the tip along the needle [m].
    pub depth: f64,
}

/// Everything that a debriefing shows.
#[derive(Debug, Clone)]
pub struct Debrief {
    pub score: Score,
    pub verdict: Verdict,
    /// Keys of the reasons why the run is not scored.
    reasons: Vec<&'static str>,
    pub findings: Vec<Finding>,
    pub events: Vec<Event>,
    pub figures: Vec<KeyFigure>,
    pub moments: Vec<Moment>,
    pub path: Vec<Sample>,
    /// The motion of the scene: tip and direction along it; its times mean nothing.
    pub reference: Vec<Sample>,
    /// Simulated time, and that of the clock on the wall while the run was on [s].
    pub simulated: f64,
    pub wall: f64,
}

/// What a run was beside its records.
#[derive(Debug, Clone, Copy, Default)]
pub struct Circumstances<'a> {
    /// Wall time while the run was on [s].
    pub wall: f64,
    /// The guard or the device has stopped it.
    pub stopped: bool,
    /// The trainee's attempts, this one included; empty where nobody has given a name.
    pub attempts: &'a [Attempt],
}

impl Debrief {
    /// The debriefing of a run that was scored. `watcher`: one of the scene, at its beginning ([`Watcher::again`]).
    pub fn of(
        scene: &Scene,
        watcher: &mut Watcher,
        (samples, records): (Vec<Sample>, &[FrameRecord]),
        score: Score,
        about: Circumstances<'_>,
    ) -> Debrief {
        let events = events::of_run_by(watcher, scene, &samples, records);
        let verdict = Verdict::of(&score);
        let findings = findings(scene, watcher, &samples, (records, &events), &score);
        let keys = scene.task.as_ref().map(key_figures::of_task);
        let figures = keys.into_iter().flatten().filter_map(|key| {
            let row = key_figures::row(&score, key)?.clone();
            let task = score.task.as_deref().unwrap_or_default();
            let trend = progress(about.attempts, task, &row.key).into_iter().map(|(n, _, value)| (n, value)).collect();
            Some(KeyFigure { row, trend })
        });
        let placements = scene.motion.samples(REFERENCE_STEP).into_iter().enumerate();
        let reference =
            placements.map(|(n, p)| Sample { time: n as f64, tip: p.tip, direction: p.direction }).collect();
        Debrief {
            verdict,
            reasons: reasons(&score, records, about.stopped),
            findings,
            events,
            figures: figures.collect(),
            moments: records.iter().map(|r| Moment { time: r.time, force: r.force.axial, depth: r.depth }).collect(),
            path: samples,
            reference,
            simulated: records.last().map_or(0.0, |r| r.time),
            wall: about.wall,
            score,
        }
    }

    /// Why the run is not scored, in plain words with the way out; empty where it is.
    pub fn reasons(&self) -> impl Iterator<Item = &'static str> {
        self.reasons.iter().filter_map(|key| say_of(key))
    }

    /// The moment at or before `time` [s], and the needle then.
    pub fn at(&self, time: f64) -> Option<(Moment, Sample)> {
        let last = |count: usize| count.max(1) - 1;
        let moment = self.moments.get(last(self.moments.partition_point(|m| m.time <= time)))?;
        let sample = self.path.get(last(self.path.partition_point(|s| s.time <= time)))?;
        Some((*moment, *sample))
    }
}

/// A number as one says it: at most two decimals, three digits where there are more.
pub fn spoken(value: f64) -> String {
    let decimals = match value.abs() {
        size if size < 10.0 => 2,
        size if size < 100.0 => 1,
        _ => 0,
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// The name of a figure in the present language, with that of its layer or target.
pub fn figure_name(row: &Row) -> String {
    let (key, name) = row.key.split_once('.').unwrap_or((&row.key, ""));
    let said = say_of(&format!("figure-{key}")).unwrap_or(&row.label);
    if name.is_empty() { said.to_string() } else { format!("{said}: {}", scene_words::name(name)) }
}

/// Which way a figure gets better, in the present language.
pub fn better(better: Better) -> &'static str {
    match better {
        Better::Lower => say("better-lower"),
        Better::Higher => say("better-higher"),
        Better::None => "",
    }
}

fn findings(
    scene: &Scene,
    watcher: &Watcher,
    samples: &[Sample],
    (records, events): (&[FrameRecord], &[Event]),
    score: &Score,
) -> Vec<Finding> {
    let goals = scene.task.as_ref().map_or(&[][..], |task| &task.goals);
    let mut obstacles = watcher.obstacles();
    let mut found = Vec::with_capacity(score.goals.len());
    for (n, result) in score.goals.iter().enumerate() {
        let (name, moment) = match goals.get(n) {
            Some(Goal::HitTarget { target, .. }) => {
                let deepest = frames_on_the_way_in(records).last().or(records.last());
                (scene.targets.get(*target).map_or("", |t| t.name.as_str()), deepest.map(|r| r.time))
            }
            Some(Goal::Avoid { name, .. }) => {
                // A touch is when it began; the needle may be deeper in later.
                let first = |kind: Kind| events.iter().find(|e| e.kind == kind && e.name == *name).map(|e| e.time);
                let nearest = obstacles.next().and_then(|(_, obstacle)| obstacle.nearest(samples));
                let nearest = nearest.map(|(index, _)| samples[index].time);
                (name.as_str(), first(Kind::Touched).or_else(|| first(Kind::Near)).or(nearest))
            }
            Some(Goal::StopInLayer { name, .. }) => (name.as_str(), deepest_cut(samples, records)),
            // Named by its key, which has a word in every language.
            Some(Goal::Figure { figure, .. }) => (figure.key, moment_of(figure.key, events, records)),
            Some(Goal::CoreMass { .. } | Goal::CoreVolume { .. }) => ("", records.last().map(|r| r.time)),
            None if result.key == "force_limit" => ("", moment_of("peak_axial_force", events, records)),
            // The time limit: when it was over.
            None => {
                let limit = scene.task.as_ref().and_then(|task| task.time_limit);
                let last = records.last().map(|r| r.time);
                ("", last.zip(limit).map(|(last, limit)| last.min(limit)))
            }
        };
        found.push(Finding { goal: result.clone(), name: name.to_string(), moment });
    }
    found
}

/// When a figure got the value that it has at the end, where one moment did that [s].
fn moment_of(key: &str, events: &[Event], records: &[FrameRecord]) -> Option<f64> {
    let last = |kind: Kind| events.iter().rfind(|e| e.kind == kind).map(|e| e.time);
    let largest = |of: &dyn Fn(&FrameRecord) -> f64| {
        let reached = records.iter().map(|r| (of(r), r.time)).reduce(|a, b| if b.0 > a.0 { b } else { a });
        reached.filter(|(value, _)| *value > 0.0).map(|(_, time)| time)
    };
    match key {
        "passes" => last(Kind::AnotherPass),
        "redirections" => last(Kind::Redirection),
        "entry_error" | "entry_angle_error" => events.iter().find(|e| e.kind == Kind::SkinPierced).map(|e| e.time),
        "overshoot" => last(Kind::LossOfResistance),
        "peak_axial_force" => largest(&|r| r.force.axial),
        "peak_lateral_force" => largest(&|r| r.force.lateral.length()),
        "peak_bone_force" => largest(&|r| r.force.bone),
        // Sums over the whole attempt.
        _ => None,
    }
}

/// When the cut was as deep as it ever got [s].
fn deepest_cut(samples: &[Sample], records: &[FrameRecord]) -> Option<f64> {
    let slope = |time: f64| {
        let index = samples.partition_point(|s| s.time <= time).max(1) - 1;
        samples.get(index).map_or(0.0, |s| -s.direction.z)
    };
    let cuts = records.iter().map(|r| (r.time, r.tip_coordinate * slope(r.time)));
    cuts.reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(time, _)| time)
}

/// Keys of the plain reasons why a run is not scored, each once.
fn reasons(score: &Score, records: &[FrameRecord], stopped: bool) -> Vec<&'static str> {
    if score.trust.is_good() {
        return Vec::new();
    }
    let trust = &score.trust;
    let mut keys = Vec::new();
    if records.is_empty() {
        keys.push("reason-empty");
    }
    if stopped {
        keys.push("reason-stopped");
    }
    let doubts = records.last().map_or(&[][..], |r| &r.verdict.doubts);
    keys.extend(doubts.iter().map(|doubt| match doubt.quantity {
        Quantity::EnergyImbalance => "reason-energy",
        Quantity::CuredEnergy | Quantity::RaisedShare | Quantity::InertiaShare => "reason-inertia",
        Quantity::UnbalancedNeedle => "reason-needle",
        _ => "reason-deformed",
    }));
    let beyond = |value: Option<f64>, bound: f64| value.is_none_or(|value| value > bound);
    if beyond(trust.kinetic_to_internal, super::physical::LARGEST_KINETIC) {
        keys.push("reason-inertia");
    }
    if beyond(trust.hourglass_to_internal, super::physical::LARGEST_HOURGLASS)
        || trust.clamped_nodes > super::physical::MOST_CLAMPED
    {
        keys.push("reason-deformed");
    }
    if keys.is_empty() {
        keys.push("reason-other");
    }
    let mut once: Vec<&'static str> = Vec::new();
    for key in keys {
        if !once.contains(&key) {
            once.push(key);
        }
    }
    once
}
