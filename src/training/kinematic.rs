//! How the needle moved: the metrics of Perk Tutor by their definitions, and entries through the surface.
//!
//! For samples i of time t [s], tip x [m] and direction d (unit, from hub to tip), "inside" meaning the tip below the surface
//! of the body at rest:
//! ```text
//! elapsed time            t_n - t_0                                                              [s]
//! path length             sum |x_i - x_(i-1)|                                                    [m]
//! path, time in tissue    the same sums over the intervals at whose end the tip is inside        [m], [s]
//! swept area              sum of two triangles (x_(i-1), x_i, e_i) and (x_(i-1), e_i, e_(i-1)) where the tip is inside at
//!                         both ends, e the point where the shaft, 300 mm long, leaves the body; areas by Heron       [m^2]
//! tissue punctures        +1 when x, x + 5 mm d and x - 5 mm d are all inside; armed again when all are outside
//! path inefficiency       path length / |x_n - x_0| - 1                                          (fraction)
//! motion smoothness       sqrt(sum |j_i|^2 dt_i), j the third backward difference; large = jerky [m/s^2.5]
//! translational motions   +1 when the velocity differs by more than 7.5 mm/s from that of the last counted one, at first
//!                         from the first velocity
//! rotational actions      +1 when the needle turns faster than 50 deg/s for more than 0.2 s after more than 0.2 s without
//! depth perception        sum |(x_i - x_(i-1)).d_i|: travel along the needle                     [m]
//! ```
//! Source: PerkTutor/PythonMetrics (TissueDamage, TissuePunctures, MotionSmoothness, ... .py). Differences: the velocity is
//! that of the tip, not that of the origin of the change of the pose; a sample holds no roll, so a turn about the needle's own
//! axis is none; the first 0.2 s are counted from the first sample instead of t = 0; a shaft that does not reach out of the
//! body ends at its hub.
//!
//! Of this project: a pass is an entry that gets deeper than [`PASS_DEPTH`]; the next begins after the tip was outside. A
//! redirection is a turn of the needle by more than [`REDIRECTION`] since the entry or the last one while the tip is inside.
//! Entry errors are those of the first pass: distance of its entry point from the planned one, and angle between directions.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::texts;
use crate::mesh::Tissue;
use crate::needle::Motion;
use crate::{Error, Result};

/// Length of the needle for the swept area [m], whatever the scene says: the figure is comparable with Perk Tutor's.
pub const SHAFT_LENGTH: f64 = 0.3;

/// Distance of the points before and behind the tip that a puncture looks at [m].
pub const PUNCTURE_REACH: f64 = 5e-3;

/// Change of velocity that makes a motion [m/s].
pub const MOTION_SPEED: f64 = 7.5e-3;

/// Angular speed [rad/s] of an action, and how long it, or its end, must last [s].
pub const ACTION_RATE: f64 = 50.0 * std::f64::consts::PI / 180.0;
pub const ACTION_TIME: f64 = 0.2;

/// Depth below the surface that makes an entry a pass [m]: a tip that trembles on the skin makes none.
pub const PASS_DEPTH: f64 = 0.5e-3;

/// Turn inside tissue that counts as a redirection [rad]. No coded definition was found; a hand holds a needle within a few
/// degrees.
pub const REDIRECTION: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// Where the needle is at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// [s]
    pub time: f64,
    /// Tip [m], in the coordinates of the scene.
    pub tip: DVec3,
    /// Unit vector of the insertion, from hub to tip.
    pub direction: DVec3,
}

/// A closed piece of tissue at rest.
pub trait Body {
    /// Distance of a point from the surface [m]; positive inside, zero on the surface, negative outside.
    fn depth(&self, x: DVec3) -> f64;

    /// Way from a point inside along a unit vector to the surface [m].
    fn way_out(&self, from: DVec3, direction: DVec3) -> f64;

    fn contains(&self, x: DVec3) -> bool {
        self.depth(x) > 0.0
    }
}

/// The block of a scene: lowest and highest corner [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    pub low: DVec3,
    pub high: DVec3,
}

impl Block {
    pub fn of(tissue: &Tissue) -> Block {
        let half = tissue.size * 0.5;
        Block { low: DVec3::new(-half.x, -half.y, -tissue.size.z), high: DVec3::new(half.x, half.y, 0.0) }
    }
}

impl Body for Block {
    fn depth(&self, x: DVec3) -> f64 {
        let within = (x - self.low).min(self.high - x);
        if within.min_element() >= 0.0 { within.min_element() } else { -within.min(DVec3::ZERO).length() }
    }

    fn way_out(&self, from: DVec3, direction: DVec3) -> f64 {
        (0..3).fold(f64::INFINITY, |way, axis| {
            let d = direction[axis];
            let face = if d > 0.0 { self.high[axis] } else { self.low[axis] };
            if d == 0.0 { way } else { way.min((face - from[axis]) / d) }
        })
    }
}

/// Where the needle was meant to go in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Entry point on the surface [m].
    pub entry: DVec3,
    /// Unit vector of the insertion.
    pub direction: DVec3,
}

impl Plan {
    /// The entry of a scene's own motion.
    pub fn of(motion: &Motion) -> Plan {
        Plan { entry: motion.entry, direction: motion.direction }
    }
}

/// One entry through the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pass {
    /// When the tip was first seen inside [s].
    pub time: f64,
    /// Where it went through the surface [m].
    pub point: DVec3,
    /// Direction of the needle then (unit).
    pub direction: DVec3,
}

/// The figures of one trajectory; see the head of this file for their definitions.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct KinematicFigures {
    /// [s]
    pub elapsed_time: f64,
    /// [m]
    pub path_length: f64,
    /// [m]
    pub path_in_tissue: f64,
    /// [s]
    pub time_in_tissue: f64,
    /// [m^2]
    pub swept_area: f64,
    pub punctures: u32,
    /// Fraction; `None` where start and end are one point.
    pub path_inefficiency: Option<f64>,
    /// [m/s^2.5]
    pub motion_smoothness: f64,
    pub translational_motions: u32,
    pub rotational_actions: u32,
    /// [m]
    pub depth_perception: f64,
    pub passes: u32,
    pub redirections: u32,
    /// [m], [rad]; `None` without a pass or a plan.
    pub entry_error: Option<f64>,
    pub entry_angle_error: Option<f64>,
}

/// Looks at the samples: finite, times that do not go back, directions of length 1.
///
/// # Errors
/// `Error::Input` with the number of the first wrong sample.
pub fn check(samples: &[Sample]) -> Result<()> {
    let mut last = f64::NEG_INFINITY;
    for (index, sample) in samples.iter().enumerate() {
        let wrong = if !(sample.time.is_finite() && sample.tip.is_finite() && sample.direction.is_finite()) {
            texts::NOT_FINITE
        } else if sample.time < last {
            texts::TIME_GOES_BACK
        } else if (sample.direction.length() - 1.0).abs() > 1e-6 {
            texts::NO_UNIT_VECTOR
        } else {
            last = sample.time;
            continue;
        };
        return Err(Error::input(texts::wrong_sample(index, sample.time, wrong), texts::WRONG_SAMPLE_WAY_OUT));
    }
    Ok(())
}

impl KinematicFigures {
    /// The figures of a trajectory.
    ///
    /// # Errors
    /// Those of [`check`].
    pub fn of(samples: &[Sample], body: &dyn Body, plan: Option<&Plan>) -> Result<KinematicFigures> {
        check(samples)?;
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            return Ok(KinematicFigures::default());
        };
        let passes = passes(samples, body);
        let mut figures = KinematicFigures {
            elapsed_time: last.time - first.time,
            swept_area: swept_area(samples, body),
            punctures: punctures(samples, body),
            motion_smoothness: motion_smoothness(samples),
            translational_motions: translational_motions(samples),
            rotational_actions: rotational_actions(samples),
            passes: passes.len() as u32,
            redirections: redirections(samples, body),
            ..Default::default()
        };
        for (a, b) in pairs(samples) {
            let step = b.tip - a.tip;
            figures.path_length += step.length();
            figures.depth_perception += step.dot(b.direction).abs();
            if body.contains(b.tip) {
                figures.path_in_tissue += step.length();
                figures.time_in_tissue += b.time - a.time;
            }
        }
        let straight = first.tip.distance(last.tip);
        // Below a nanometre the ends are one point up to rounding.
        figures.path_inefficiency = (straight > 1e-9).then(|| figures.path_length / straight - 1.0);
        if let (Some(pass), Some(plan)) = (passes.first(), plan) {
            figures.entry_error = Some(pass.point.distance(plan.entry));
            figures.entry_angle_error = Some(angle(pass.direction, plan.direction));
        }
        Ok(figures)
    }
}

/// Neighbouring samples.
fn pairs(samples: &[Sample]) -> impl Iterator<Item = (&Sample, &Sample)> {
    samples.iter().zip(samples.iter().skip(1))
}

/// Samples without those that stand at the time of the one before: a rate needs an interval.
fn distinct(samples: &[Sample]) -> Vec<Sample> {
    let mut kept: Vec<Sample> = Vec::with_capacity(samples.len());
    kept.extend(samples.iter().take(1));
    for sample in samples {
        if kept.last().is_some_and(|last| sample.time > last.time) {
            kept.push(*sample);
        }
    }
    kept
}

/// Angle between two vectors [rad], also near 0 and pi.
fn angle(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b))
}

/// Area of a triangle by Heron's formula [m^2].
fn heron(p: DVec3, q: DVec3, r: DVec3) -> f64 {
    let (a, b, c) = (p.distance(q), q.distance(r), r.distance(p));
    let s = 0.5 * (a + b + c);
    // Rounding may make the product of a flat triangle negative.
    (s * (s - a) * (s - b) * (s - c)).max(0.0).sqrt()
}

fn swept_area(samples: &[Sample], body: &dyn Body) -> f64 {
    let end = |s: &Sample| s.tip - s.direction * body.way_out(s.tip, -s.direction).min(SHAFT_LENGTH);
    pairs(samples)
        .filter(|(a, b)| body.contains(a.tip) && body.contains(b.tip))
        .map(|(a, b)| heron(a.tip, b.tip, end(b)) + heron(a.tip, end(b), end(a)))
        .sum()
}

fn punctures(samples: &[Sample], body: &dyn Body) -> u32 {
    let (mut count, mut armed) = (0, true);
    for sample in samples {
        let reach = sample.direction * PUNCTURE_REACH;
        let inside = [sample.tip, sample.tip + reach, sample.tip - reach].map(|x| body.contains(x));
        if armed && inside == [true; 3] {
            count += 1;
            armed = false;
        } else if inside == [false; 3] {
            armed = true;
        }
    }
    count
}

fn motion_smoothness(samples: &[Sample]) -> f64 {
    let samples = distinct(samples);
    let squares: f64 = samples
        .windows(4)
        .map(|w| {
            let dt = |i: usize| w[i].time - w[i - 1].time;
            let velocity = |i: usize| (w[i].tip - w[i - 1].tip) / dt(i);
            let acceleration = |i: usize| (velocity(i) - velocity(i - 1)) / dt(i);
            ((acceleration(3) - acceleration(2)) / dt(3)).length_squared() * dt(3)
        })
        .sum();
    squares.sqrt()
}

fn translational_motions(samples: &[Sample]) -> u32 {
    let samples = distinct(samples);
    let mut counted: Option<DVec3> = None;
    let mut count = 0;
    for (a, b) in pairs(&samples) {
        let velocity = (b.tip - a.tip) / (b.time - a.time);
        match counted {
            None => counted = Some(velocity),
            Some(last) if velocity.distance(last) > MOTION_SPEED => {
                count += 1;
                counted = Some(velocity);
            }
            Some(_) => {}
        }
    }
    count
}

fn rotational_actions(samples: &[Sample]) -> u32 {
    let samples = distinct(samples);
    let Some(first) = samples.first() else { return 0 };
    let (mut count, mut acting, mut settled) = (0, false, first.time);
    for (a, b) in pairs(&samples) {
        let fast = angle(a.direction, b.direction) / (b.time - a.time) > ACTION_RATE;
        if fast == acting {
            settled = b.time;
        } else if b.time - settled > ACTION_TIME {
            (acting, settled) = (fast, b.time);
            count += u32::from(fast);
        }
    }
    count
}

/// The entries through the surface, in order.
pub fn passes(samples: &[Sample], body: &dyn Body) -> Vec<Pass> {
    let mut found = Vec::new();
    let mut entered: Option<Pass> = None;
    let mut counted = false;
    for (index, sample) in samples.iter().enumerate() {
        let depth = body.depth(sample.tip);
        if depth <= 0.0 {
            (entered, counted) = (None, false);
            continue;
        }
        let pass = *entered.get_or_insert_with(|| Pass {
            time: sample.time,
            point: match index.checked_sub(1) {
                Some(before) => crossing(samples[before].tip, sample.tip, body),
                // It began inside: where the shaft comes out.
                None => sample.tip - sample.direction * body.way_out(sample.tip, -sample.direction),
            },
            direction: sample.direction,
        });
        if !counted && depth > PASS_DEPTH {
            counted = true;
            found.push(pass);
        }
    }
    found
}

/// Where the way from a point outside to one inside goes through the surface [m].
fn crossing(outside: DVec3, inside: DVec3, body: &dyn Body) -> DVec3 {
    let (mut low, mut high) = (0.0, 1.0);
    // Halves down to the last bit.
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if body.contains(outside.lerp(inside, middle)) { high = middle } else { low = middle }
    }
    outside.lerp(inside, high)
}

fn redirections(samples: &[Sample], body: &dyn Body) -> u32 {
    let (mut count, mut kept) = (0, None);
    for sample in samples {
        if !body.contains(sample.tip) {
            kept = None;
            continue;
        }
        let last = *kept.get_or_insert(sample.direction);
        if angle(last, sample.direction) > REDIRECTION {
            count += 1;
            kept = Some(sample.direction);
        }
    }
    count
}
