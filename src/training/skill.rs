//! Synthetic trainees: what hands of three levels of skill do with a needle, drawn from a seed.
//!
//! A trainee holds the needle like any other device: once per frame it says where the needle shall be, the reach of a hand
//! ([`crate::simulation::reach`]) takes what the tissue can follow of it, and it is told what the needle felt. It means to do what the
//! motion of the scene does, the reference attempt, and misses it by its level:
//! ```text
//! entry, angle       the point and the direction that it takes are off by a normal error in each of two axes
//! approach           above the skin, then one insertion at a speed of its own that wanders (Ornstein-Uhlenbeck, 0.3 s)
//! corrections        a Poisson number of tilts under way, each with a new error of the angle, smaller than the last
//! stopping           at the wanted depth with a normal error, and a reaction time later; where a layer is to be found, a reaction time
//!                    after a resistance was lost as deep as it lies
//! tremor             three sines between 8 and 12 Hz per axis, along the needle and as a tilt about the entry
//! passes             with some probability it withdraws and tries again, with smaller errors
//! ```
//! Lengths of the sources are those of a body: they are taken times the way of the reference attempt over [`BODY_WAY`], so that a block of
//! 10 mm is missed by as much of its depth. The levels differ in every habit at once, and the errors are independent of each other:
//! what comes out shows which figures answer to such differences, not how people differ.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use crate::needle::motion::{HandPose, Motion, Phase};
use crate::observables::FrameRecord;
use crate::scene::{Goal, Scene};
use crate::stability::random::numbers::Numbers;
use crate::{Error, Result};

/// Length of the way in the body for which the lengths of the sources hold [m]: about that of a lumbar puncture; a choice of this project.
pub const BODY_WAY: f64 = 60e-3;

/// How skilled a trainee is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// No insertion before.
    Novice,
    /// In training.
    Intermediate,
    /// Years of practice.
    Expert,
}

impl Level {
    /// All, the least skilled first.
    pub const ALL: [Level; 3] = [Level::Novice, Level::Intermediate, Level::Expert];

    /// As in tables.
    pub fn key(self) -> &'static str {
        match self {
            Level::Novice => "novice",
            Level::Intermediate => "intermediate",
            Level::Expert => "expert",
        }
    }
}

/// One number in which the levels differ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Habit {
    /// Stays the same.
    pub key: &'static str,
    /// What it is.
    pub text: &'static str,
    /// Unit of `of`; empty for a pure number.
    pub unit: &'static str,
    /// Values in the order of [`Level::ALL`].
    pub of: [f64; 3],
    /// Where they come from.
    pub source: &'static str,
}

impl Habit {
    fn at(&self, level: Level) -> f64 {
        self.of[level as usize]
    }
}

/// Mean distance of the entry from the plan, in a body.
const ENTRY: Habit = Habit {
    key: "entry_error",
    text: "mean distance of the entry point from the plan, in a body",
    unit: "mm",
    of: [6.1, 3.1, 0.8],
    source: "freehand 6.1, with a guide 0.8 (doi 10.3348/kjr.2015.16.4.729); freehand of an experienced team 3.1 \
             (doi 10.1016/j.ejrad.2012.10.028). A hand that is as exact as with a guide is a choice of this project",
};

const ANGLE: Habit = Habit {
    key: "angle_error",
    text: "mean angle between needle and plan at the entry",
    unit: "deg",
    of: [6.5, 3.4, 1.3],
    source: "freehand 7.0 and 6.3 out of the plane (doi 10.1007/s00330-019-06477-1); freehand 3.4, with a guide 1.3 \
             (doi 10.3348/kjr.2015.16.4.729)",
};

const STOP: Habit = Habit {
    key: "stopping_error",
    text: "deviation of the depth at which it means to stop, in a body",
    unit: "mm",
    of: [3.5, 2.3, 1.5],
    source: "distance to the target 3.5 unguided, 1.5 guided (PMC5318157); between them the geometric mean",
};

const REACTION: Habit = Habit {
    key: "reaction_time",
    text: "time from what it sees or feels to the stop of the hand",
    unit: "ms",
    of: [384.0, 220.0, 160.0],
    source: "recognition 384, simple reaction 220 (Laming 1968), fastest simple reaction 160 (both in Kosinski's review of reaction \
             times); which level recognises and which expects is a choice of this project",
};

const TREMOR: Habit = Habit {
    key: "tremor",
    text: "root mean square of the tremor of the hand per axis, 8 to 12 Hz",
    unit: "um",
    of: [200.0, 100.0, 50.0],
    source: "50 to 200 at 8 to 12 Hz (PMC3989364); eye surgeons who hold an instrument still 49 (Riviere, Rader, Khosla 1997)",
};

const CORRECTIONS: Habit = Habit {
    key: "corrections",
    text: "mean number of tilts in the tissue per pass",
    unit: "",
    of: [3.3, 1.6, 0.5],
    source: "needle corrections 3.28 conventional, 1.58 with a laser (doi 10.3390/diagnostics13020282); that of an expert is a choice of \
             this project",
};

const AGAIN: Habit = Habit {
    key: "second_pass",
    text: "probability of a further pass",
    unit: "",
    of: [0.60, 0.24, 0.11],
    source: "students without success 60 % (doi 10.1186/s12909-024-05505-z); not done on the first pass 23.6 % unguided, 11.1 % guided \
             (PMC5318157)",
};

const SPREAD: Habit = Habit {
    key: "speed_spread",
    text: "deviation of the logarithm of the mean speed from one attempt to the next",
    unit: "",
    of: [0.35, 0.20, 0.10],
    source: "choice of this project; mean speeds of one brachytherapist ranged from 4 to 174 mm/s around 48 (Sloboda group, \
             University of Alberta)",
};

const WANDER: Habit = Habit {
    key: "speed_irregularity",
    text: "deviation of the speed within an insertion, as a part of its mean",
    unit: "",
    of: [0.50, 0.25, 0.10],
    source: "choice of this project",
};

/// All habits, in the order of the page.
pub const HABITS: [&Habit; 9] = [&ENTRY, &ANGLE, &STOP, &REACTION, &TREMOR, &CORRECTIONS, &AGAIN, &SPREAD, &WANDER];

/// Mean of the length of a plane vector over the deviation of its two normal components.
fn plane_mean() -> f64 {
    FRAC_PI_2.sqrt()
}

/// Part of an error that is left after a correction or a further pass: one learns from what one sees. A choice of this project.
const LEARNT: f64 = 0.6;
/// Tremor in tissue over that in air: the tissue holds the shaft, and the hand has come to rest on the patient when the tip comes to the
/// skin. A choice of this project.
const HELD: f64 = 0.25;
/// Distance of the fingers from the skin [m]: tremor tilts the needle about its entry. A choice of this project.
const GRIP: f64 = 50e-3;
/// Band of the tremor [Hz].
const BAND: [f64; 2] = [8.0, 12.0];
/// Time over which the speed forgets what it was [s]. A choice of this project.
const MEMORY: f64 = 0.3;
/// Height above the skin at which the needle is aimed [m], and how long [s].
const ABOVE: f64 = 1.5e-3;
const AIMING: f64 = 0.4;
/// Standstill at the end of a pass [s].
const STANDING: f64 = 0.5;
/// Rate of a tilt [rad/s]: that of the keys of the window.
const TILT_RATE: f64 = 0.35;
/// Part of the largest force of the last [`FEELING`] s that must be lost for a layer to have given way.
const LOSS: f64 = 0.2;
const FEELING: f64 = 0.3;

/// The reference attempt that a trainee means to repeat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aim {
    /// Entry point on the top face [m].
    pub entry: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
    /// Of the tip at the end of the way in [m].
    pub depth: f64,
    /// Of the way in [m/s].
    pub speed: f64,
    /// The needle is taken out at the end.
    pub withdrawn: bool,
    /// The end of the way is told by a layer that gives way. No loss is a sign of it before the tip would be as deep as what lies behind
    /// the layer does at rest [m]: skin and ligaments give way too, and tissue that is pushed lies deeper.
    pub by_feel: Option<f64>,
}

impl Aim {
    /// What the motion of a scene does.
    ///
    /// # Errors
    /// `Error::Input` for a scene without a task, and for a motion that is not one straight insertion.
    pub fn of(scene: &Scene) -> Result<Aim> {
        let Some(task) = &scene.task else {
            return Err(Error::input(
                format!("{}: there is no task that a trainee could do", scene.path.display()),
                "take a scene with a [task], e.g. scenes/training/avoid_vessel.toml",
            ));
        };
        let Motion { entry, direction, .. } = scene.motion;
        let insert = scene.motion.phases.iter().find_map(|phase| match phase {
            Phase::Insert { speed, .. } => Some(*speed),
            _ => None,
        });
        let (Some(speed), false) = (insert, scene.motion.is_free()) else {
            return Err(Error::input(
                format!("{}: the motion is no straight insertion", scene.path.display()),
                "give the scene a motion of insert, hold and withdraw: a trainee repeats it with errors",
            ));
        };
        Ok(Aim {
            entry,
            direction,
            depth: scene.motion.deepest(),
            speed,
            withdrawn: matches!(scene.motion.phases.last(), Some(Phase::Withdraw { .. })),
            by_feel: task.goals.iter().find_map(|goal| match goal {
                Goal::StopInLayer { from, .. } => Some(*from),
                _ => None,
            }),
        })
    }

    /// Lengths here over those of a body.
    fn scale(&self) -> f64 {
        (self.depth / BODY_WAY).min(1.0)
    }

    /// Two horizontal axes across the needle, unit vectors.
    fn across(direction: DVec3) -> [DVec3; 2] {
        let first = direction.any_orthonormal_vector();
        [first, direction.cross(first)]
    }
}

/// Tremor of one axis.
#[derive(Debug, Clone)]
struct Tremor([(f64, f64); 3]);

impl Tremor {
    fn new(numbers: &mut Numbers) -> Self {
        Tremor(std::array::from_fn(|_| (numbers.between(BAND[0], BAND[1]), numbers.between(0.0, TAU))))
    }

    /// With a mean square of 1.
    fn at(&self, time: f64) -> f64 {
        let sum: f64 = self.0.iter().map(|(frequency, phase)| (TAU * frequency * time + phase).sin()).sum();
        sum * (2.0f64 / 3.0).sqrt()
    }
}

/// What a trainee is doing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Doing {
    /// Above the skin until a time [s].
    Aiming {
        until: f64,
    },
    /// On the way in.
    Advancing,
    /// Has seen or felt the end; the hand stops at a time [s].
    Stopping {
        at: f64,
    },
    /// Stands until a time [s].
    Standing {
        until: f64,
    },
    /// On the way out, to try again or to end.
    Withdrawing {
        again: bool,
    },
    Done,
}

/// One trainee at one attempt.
#[derive(Debug, Clone)]
pub struct Trainee {
    aim: Aim,
    /// The scene lets it choose entry and angle.
    free: bool,
    numbers: Numbers,
    level: Level,
    /// RMS of the tremor [m] and its axes: along the needle and two across.
    tremor: f64,
    axes: [Tremor; 3],
    time: f64,
    doing: Doing,
    /// Where it means to go in, and which way.
    entry: DVec3,
    direction: DVec3,
    /// Errors of entry [m] and angle [rad] in the two axes across the reference.
    entry_error: [f64; 2],
    angle_error: [f64; 2],
    /// Depth at which it means to stop [m].
    stop: f64,
    /// Depths of the corrections that are still to come in this pass [m], the first last.
    corrections: Vec<f64>,
    passes_left: u32,
    /// Of this attempt [m/s], and its wandering part.
    speed: f64,
    wander: f64,
    /// Depth that the hand means, without tremor [m].
    depth: f64,
    /// Axial forces of the last moments: time [s] and force [N].
    felt: Vec<(f64, f64)>,
}

impl Trainee {
    /// The trainee number `index` of a level and a seed; `free`: the scene lets a hand choose entry and angle.
    pub fn new(aim: Aim, free: bool, level: Level, seed: u64, index: u64) -> Self {
        let mut numbers = Numbers::of(seed, 3 * index + level as u64);
        let plane = |numbers: &mut Numbers, mean: f64| [0; 2].map(|_| numbers.normal() * mean / plane_mean());
        let entry_error = plane(&mut numbers, ENTRY.at(level) * 1e-3 * aim.scale());
        let angle_error = plane(&mut numbers, ANGLE.at(level).to_radians());
        let passes_left = u32::from(numbers.chance(AGAIN.at(level)));
        let speed = aim.speed * (SPREAD.at(level) * numbers.normal()).exp();
        let axes = std::array::from_fn(|_| Tremor::new(&mut numbers));
        let mut trainee = Trainee {
            aim,
            free,
            numbers,
            level,
            tremor: TREMOR.at(level) * 1e-6,
            axes,
            time: 0.0,
            doing: Doing::Aiming { until: 0.0 },
            entry: aim.entry,
            direction: aim.direction,
            entry_error,
            angle_error,
            stop: aim.depth,
            corrections: Vec::new(),
            passes_left,
            speed,
            wander: 0.0,
            depth: 0.0,
            felt: Vec::new(),
        };
        trainee.begin_pass();
        trainee
    }

    /// True once the attempt is over.
    pub fn is_done(&self) -> bool {
        self.doing == Doing::Done
    }

    /// Aims anew from above the skin.
    fn begin_pass(&mut self) {
        let [x, y] = Aim::across(self.aim.direction);
        let aside = x * self.entry_error[0] + y * self.entry_error[1];
        // Along the needle down to the skin.
        let aside = aside - self.aim.direction * (aside.z / self.aim.direction.z);
        self.entry = self.aim.entry + aside;
        self.direction = self.tilted();
        self.stop = self.aim.depth + STOP.at(self.level) * 1e-3 * self.aim.scale() * self.numbers.normal();
        // Poisson, by the products of Knuth.
        let (limit, mut product, mut count) = ((-CORRECTIONS.at(self.level)).exp(), self.numbers.unit(), 0);
        while product > limit && count < 10 {
            (product, count) = (product * self.numbers.unit(), count + 1);
        }
        self.corrections = (0..count).map(|_| self.numbers.between(0.2, 0.8) * self.aim.depth).collect();
        self.corrections.sort_by(|a, b| b.total_cmp(a));
        self.doing = Doing::Aiming { until: self.time + AIMING };
        self.felt.clear();
    }

    /// The reference direction with the error of the angle.
    fn tilted(&self) -> DVec3 {
        let [x, y] = Aim::across(self.aim.direction);
        let turn = DQuat::from_scaled_axis(x * self.angle_error[0] + y * self.angle_error[1]);
        (turn * self.aim.direction).normalize()
    }

    /// Where the needle shall be `duration` [s] after it was at `now`. Called once per simulated frame.
    pub fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose {
        self.time += duration;
        let forget = (-duration / MEMORY).exp();
        self.wander = self.wander * forget + (1.0 - forget * forget).sqrt() * self.numbers.normal();
        // Nobody goes backwards or leaps because a speed wanders.
        let pace = (1.0 + WANDER.at(self.level) * self.wander).clamp(0.2, 2.5);
        let forwards = self.speed * pace * duration;
        let (mut entry, mut towards) = (now.entry, self.direction);
        match self.doing {
            Doing::Aiming { until } => {
                self.depth = -ABOVE;
                (entry, towards) = (self.entry, self.direction);
                let aimed = now.direction.angle_between(self.direction) < TILT_RATE * duration;
                let there = !self.free || (aimed && (now.entry - self.entry).length() < 0.2e-3);
                if self.time >= until && there && now.depth < 0.0 {
                    self.doing = Doing::Advancing;
                }
            }
            Doing::Advancing => {
                self.depth += forwards;
                if self.corrections.last().is_some_and(|depth| self.depth > *depth) {
                    self.corrections.pop();
                    self.angle_error = self
                        .angle_error
                        .map(|_| ANGLE.at(self.level).to_radians() * LEARNT / plane_mean() * self.numbers.normal());
                    self.direction = self.tilted();
                }
                if self.depth >= self.stop || self.gave_way() {
                    self.doing = Doing::Stopping { at: self.time + REACTION.at(self.level) * 1e-3 };
                }
            }
            Doing::Stopping { at } => {
                self.depth += forwards;
                if self.time >= at {
                    self.doing = Doing::Standing { until: self.time + STANDING };
                }
            }
            Doing::Standing { until } => {
                if self.time >= until {
                    self.doing = match self.passes_left {
                        0 if self.aim.withdrawn => Doing::Withdrawing { again: false },
                        0 => Doing::Done,
                        _ => Doing::Withdrawing { again: true },
                    };
                }
            }
            Doing::Withdrawing { again } => {
                self.depth -= 2.0 * forwards;
                if self.depth < -ABOVE && now.depth < 0.0 {
                    match again {
                        true => {
                            self.passes_left -= 1;
                            self.entry_error = self.entry_error.map(|error| LEARNT * error);
                            self.angle_error = self.angle_error.map(|error| LEARNT * error);
                            self.begin_pass();
                        }
                        false => self.doing = Doing::Done,
                    }
                }
            }
            Doing::Done => {}
        }
        self.trembling(now, entry, towards, duration)
    }

    /// What the hand means, with its tremor; a tilt in the tissue goes on at the rate of a hand.
    fn trembling(&mut self, now: &HandPose, entry: DVec3, towards: DVec3, duration: f64) -> HandPose {
        let held = HELD + (1.0 - HELD) * (-now.depth / ABOVE).clamp(0.0, 1.0);
        let [along, x, y] = [0, 1, 2].map(|axis| held * self.tremor * self.axes[axis].at(self.time));
        let depth = self.depth + along;
        if !self.free {
            return HandPose { depth, ..*now };
        }
        let angle = now.direction.angle_between(towards);
        let part = (TILT_RATE * duration / angle).min(1.0);
        let steady = if part < 1.0 { now.direction.lerp(towards, part).normalize() } else { towards };
        let across = Aim::across(self.aim.direction);
        let shake = DQuat::from_scaled_axis((across[0] * x + across[1] * y) / GRIP);
        HandPose { entry, direction: (shake * steady).normalize(), depth }
    }

    /// A layer has given way under the needle just now.
    fn gave_way(&self) -> bool {
        let largest = self.felt.iter().map(|(_, force)| *force).fold(0.0, f64::max);
        self.felt.last().is_some_and(|(_, force)| *force < (1.0 - LOSS) * largest)
    }

    /// Is told what the needle felt in the last frame.
    pub fn feel(&mut self, record: &FrameRecord) {
        self.felt.push((record.time, record.force.axial));
        let listens = self.aim.by_feel.is_some_and(|from| self.depth > from);
        self.felt.retain(|(time, _)| listens && *time > record.time - FEELING);
    }
}
