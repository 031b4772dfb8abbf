//! A gamepad leads the needle: sticks to poses, dead zones, unplugging, rumble. Knows no library of gamepads: that is behind [`PadPort`].

use std::time::Instant;

use glam::{DVec2, DVec3};

use super::hand::{InputDevice, leant};
use crate::needle::motion::HandPose;

/// Part of the way of a stick that means nothing: worn sticks rest there.
const DEAD: f64 = 0.12;

/// Angular speed of a stick at its end [rad/s].
const TILT_SPEED: f64 = 0.5;

/// Axial force at which a pad rumbles with all it has [N].
const FULL_RUMBLE: f64 = 3.0;

/// Smallest change of the rumble that is worth a message to the pad.
const RUMBLE_STEP: f32 = 0.02;

/// What a pad tells.
#[derive(Debug, Clone, PartialEq)]
pub enum PadEvent {
    /// A pad is there, with its name.
    Here(String),
    /// The pad in use was unplugged, or its battery is empty.
    Gone,
    /// Left stick: to the right and up, -1..1.
    Left(DVec2),
    /// Right stick.
    Right(DVec2),
    /// The button that pauses and goes on was pressed.
    Pause,
}

/// Pads, as a library shows them.
pub trait PadPort {
    /// What has happened since the last call.
    fn poll(&mut self) -> Vec<PadEvent>;

    /// Rumbles with a strength from 0 to 1 until told otherwise. A pad without motors does nothing.
    fn rumble(&mut self, strength: f32);
}

impl PadPort for Box<dyn PadPort> {
    fn poll(&mut self) -> Vec<PadEvent> {
        (**self).poll()
    }

    fn rumble(&mut self, strength: f32) {
        (**self).rumble(strength);
    }
}

/// What the window has to do about a pad.
#[derive(Debug, Clone, PartialEq)]
pub enum PadNotice {
    Here(String),
    /// The run has to pause: nobody holds the needle.
    Gone,
    Pause,
}

/// A gamepad as something that a hand holds.
pub struct Gamepad<P> {
    port: P,
    /// Name of the pad in use.
    name: Option<String>,
    left: DVec2,
    right: DVec2,
    /// Speed of a stick at its end [m/s].
    pub speed: f64,
    /// To the right on the screen and away from the viewer, horizontal unit vectors.
    view: [DVec3; 2],
    rumble: f32,
    fresh: Option<Instant>,
}

/// A stick without its dead zone: from 0 at its edge to 1 at the end, in the same direction.
fn beyond_dead_zone(stick: DVec2) -> DVec2 {
    let length = stick.length();
    if !length.is_finite() || length <= DEAD {
        return DVec2::ZERO;
    }
    stick / length * ((length.min(1.0) - DEAD) / (1.0 - DEAD))
}

impl<P: PadPort> Gamepad<P> {
    pub fn new(port: P, speed: f64) -> Self {
        Gamepad {
            port,
            name: None,
            left: DVec2::ZERO,
            right: DVec2::ZERO,
            speed,
            view: [DVec3::X, DVec3::Y],
            rumble: 0.0,
            fresh: None,
        }
    }

    /// What right and away mean: horizontal unit vectors of the view.
    pub fn seen_from(&mut self, view: [DVec3; 2]) {
        self.view = view;
    }

    /// Takes what has happened; call it once per picture.
    pub fn poll(&mut self) -> Vec<PadNotice> {
        let mut notices = Vec::new();
        for event in self.port.poll() {
            match event {
                PadEvent::Here(name) => {
                    self.name = Some(name.clone());
                    notices.push(PadNotice::Here(name));
                }
                PadEvent::Gone => {
                    // A stick that was held when the cable went must not lead on.
                    (self.left, self.right, self.rumble) = (DVec2::ZERO, DVec2::ZERO, 0.0);
                    if self.name.take().is_some() {
                        notices.push(PadNotice::Gone);
                    }
                }
                PadEvent::Left(stick) => self.left = self.moved(self.left, stick),
                PadEvent::Right(stick) => self.right = self.moved(self.right, stick),
                PadEvent::Pause => notices.push(PadNotice::Pause),
            }
        }
        notices
    }

    /// True while a stick is pushed.
    pub fn asks(&self) -> bool {
        self.left != DVec2::ZERO || self.right != DVec2::ZERO
    }

    fn moved(&mut self, before: DVec2, after: DVec2) -> DVec2 {
        let after = beyond_dead_zone(after);
        if after != before {
            self.fresh.get_or_insert_with(Instant::now);
        }
        after
    }

    /// The hand feels nothing: the run is not on.
    pub fn be_still(&mut self) {
        self.shake(0.0);
    }

    fn shake(&mut self, strength: f32) {
        let ends = strength == 0.0 && self.rumble != 0.0;
        if self.name.is_some() && (ends || (strength - self.rumble).abs() >= RUMBLE_STEP) {
            self.rumble = strength;
            self.port.rumble(strength);
        }
    }
}

impl<P: PadPort> InputDevice for Gamepad<P> {
    fn name(&self) -> &str {
        self.name.as_deref().unwrap_or("no gamepad")
    }

    fn fresh_input(&mut self) -> Option<Instant> {
        self.fresh.take()
    }

    /// Stick towards the hand withdraws: the needle follows the thumb away from the body.
    fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose {
        let turn = TILT_SPEED * duration;
        let tilt = (self.view[0] * self.right.x + self.view[1] * self.right.y) * turn;
        HandPose {
            depth: now.depth + self.left.y * self.speed * duration,
            direction: leant(now.direction, tilt),
            ..*now
        }
    }

    fn feel(&mut self, axial: f64, _lateral: DVec3) {
        let strength = (axial.abs() / FULL_RUMBLE).clamp(0.0, 1.0);
        self.shake(if strength.is_finite() { strength as f32 } else { 0.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pad made of a list.
    #[derive(Default)]
    struct Scripted {
        coming: Vec<PadEvent>,
        rumbles: Vec<f32>,
    }

    impl PadPort for Scripted {
        fn poll(&mut self) -> Vec<PadEvent> {
            std::mem::take(&mut self.coming)
        }

        fn rumble(&mut self, strength: f32) {
            self.rumbles.push(strength);
        }
    }

    fn pad(events: Vec<PadEvent>) -> Gamepad<Scripted> {
        let mut pad = Gamepad::new(Scripted::default(), 10e-3);
        pad.port.coming = vec![PadEvent::Here("test pad".into())];
        pad.port.coming.extend(events);
        pad
    }

    const NOW: HandPose = HandPose { entry: DVec3::ZERO, direction: DVec3::NEG_Z, depth: 2e-3 };

    #[test]
    fn the_left_stick_leads_in_proportion_beyond_its_dead_zone() {
        let way = |y: f64| {
            let mut pad = pad(vec![PadEvent::Left(DVec2::new(0.05, y))]);
            pad.poll();
            pad.pose(&NOW, 0.1).depth - NOW.depth
        };
        assert_eq!((way(0.0), way(0.1), way(-0.1)), (0.0, 0.0, 0.0));
        assert!((way(1.0) - 1e-3).abs() < 2e-6 && (way(-1.0) + 1e-3).abs() < 2e-6);
        assert!((way(0.56) - 0.5e-3).abs() < 5e-6, "half-way beyond the dead zone: {}", way(0.56));
        assert!(way(0.13) > 0.0 && way(0.13) < 0.05e-3, "no step at its edge");
        assert_eq!(way(f64::NAN), 0.0);
        assert!(way(7.0) <= 1e-3 + 1e-12);
    }

    #[test]
    fn the_right_stick_tilts_as_it_is_seen() {
        let mut pad = pad(vec![PadEvent::Right(DVec2::new(1.0, 0.0))]);
        pad.seen_from([DVec3::Y, DVec3::NEG_X]);
        pad.poll();
        let pose = pad.pose(&NOW, 0.1);
        assert_eq!((pose.entry, pose.depth), (NOW.entry, NOW.depth));
        assert!((pose.direction.angle_between(NOW.direction) - 0.1 * TILT_SPEED).abs() < 1e-9);
        assert!(pose.direction.y < 0.0 && pose.direction.x.abs() < 1e-12);
        assert!(pad.fresh_input().is_some() && pad.fresh_input().is_none());
    }

    #[test]
    fn an_unplugged_pad_stands_still_and_is_told_once() {
        let mut pad = pad(vec![PadEvent::Left(DVec2::Y), PadEvent::Pause]);
        assert_eq!(pad.poll(), [PadNotice::Here("test pad".into()), PadNotice::Pause]);
        assert_eq!(pad.name(), "test pad");
        assert!(pad.pose(&NOW, 0.1).depth > NOW.depth);
        pad.port.coming = vec![PadEvent::Gone, PadEvent::Gone];
        assert_eq!(pad.poll(), [PadNotice::Gone]);
        assert_eq!(pad.pose(&NOW, 0.1), NOW);
        pad.port.coming = vec![PadEvent::Here("another".into()), PadEvent::Left(DVec2::NEG_Y)];
        assert_eq!(pad.poll(), [PadNotice::Here("another".into())]);
        assert!(pad.pose(&NOW, 0.1).depth < NOW.depth);
    }

    #[test]
    fn the_rumble_follows_the_force_and_ends() {
        let mut pad = pad(Vec::new());
        pad.feel(1.0, DVec3::ZERO);
        assert!(pad.port.rumbles.is_empty(), "there is no pad yet");
        pad.poll();
        for force in [0.3, 0.31, 1.5, -1.5, 100.0, f64::NAN] {
            pad.feel(force, DVec3::ZERO);
        }
        assert_eq!(pad.port.rumbles, [0.1, 0.5, 1.0, 0.0]);
        pad.feel(1.5, DVec3::ZERO);
        pad.be_still();
        pad.be_still();
        assert_eq!(pad.port.rumbles[4..], [0.5, 0.0]);
    }
}
