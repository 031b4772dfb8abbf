//! What leads the needle: mouse and keyboard, or any other device behind the same trait.

use std::time::Instant;

use glam::DVec3;

use crate::scene::motion::HandPose;

/// A device that a hand holds: it says where the needle shall be, and is told what the needle feels.
pub trait InputDevice {
    /// For people.
    fn name(&self) -> &str;

    /// Where the needle shall be `duration` [s] after it was at `now`. Called once per simulated frame.
    fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose;

    /// When the oldest input came that no pose has had yet; forgets it.
    fn fresh_input(&mut self) -> Option<Instant> {
        None
    }

    /// Mean force of the tissue on the needle over the last frame [N]: along the axis, positive against an insertion, and aside.
    fn feel(&mut self, _axial: f64, _lateral: DVec3) {}
}

/// Mouse and keyboard: keys advance at a steady speed, the wheel and a drag set a depth that is gone to at that speed at most.
#[derive(Debug, Clone, PartialEq)]
pub struct Desk {
    /// Speed of a key that is held [m/s].
    pub speed: f64,
    advance: bool,
    withdraw: bool,
    /// Way that wheel and drags still ask for [m].
    asked: f64,
    /// Oldest input that no pose has had yet.
    fresh: Option<Instant>,
}

impl Desk {
    pub fn new(speed: f64) -> Self {
        Desk { speed, advance: false, withdraw: false, asked: 0.0, fresh: None }
    }

    pub fn hold_advance(&mut self, held: bool) {
        self.advance = held;
        self.touched();
    }

    pub fn hold_withdraw(&mut self, held: bool) {
        self.withdraw = held;
        self.touched();
    }

    /// Asks for a way along the needle [m].
    pub fn ask(&mut self, way: f64) {
        self.asked += way;
        if way != 0.0 {
            self.touched();
        }
    }

    fn touched(&mut self) {
        self.fresh.get_or_insert_with(Instant::now);
    }

    /// Lets go of everything: the window has lost the keyboard.
    pub fn let_go(&mut self) {
        (self.advance, self.withdraw, self.asked) = (false, false, 0.0);
    }
}

impl InputDevice for Desk {
    fn name(&self) -> &str {
        "mouse and keyboard"
    }

    fn fresh_input(&mut self) -> Option<Instant> {
        self.fresh.take()
    }

    fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose {
        let reach = self.speed * duration;
        let keys = f64::from(i8::from(self.advance) - i8::from(self.withdraw)) * reach;
        let asked = self.asked.clamp(-reach, reach);
        self.asked -= asked;
        HandPose { depth: now.depth + keys + asked, ..*now }
    }
}

/// Poses of a session, one per frame, and standstill after the last.
#[derive(Debug, Clone)]
pub struct Recording {
    poses: std::vec::IntoIter<HandPose>,
}

impl Recording {
    pub fn new(poses: Vec<HandPose>) -> Self {
        Recording { poses: poses.into_iter() }
    }
}

impl InputDevice for Recording {
    fn name(&self) -> &str {
        "recorded session"
    }

    fn pose(&mut self, now: &HandPose, _duration: f64) -> HandPose {
        self.poses.next().unwrap_or(*now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_move_steadily_and_the_wheel_is_walked_off() {
        let mut desk = Desk::new(6e-3);
        let start = HandPose { entry: DVec3::ZERO, direction: DVec3::NEG_Z, depth: 1e-3 };
        let frame = 1.0 / 60.0;
        assert_eq!(desk.pose(&start, frame).depth, start.depth);
        desk.hold_advance(true);
        let next = desk.pose(&start, frame);
        assert!((next.depth - start.depth - 1e-4).abs() < 1e-12);
        desk.hold_withdraw(true);
        assert_eq!(desk.pose(&next, frame).depth, next.depth);
        desk.let_go();
        desk.ask(2.5e-4);
        let mut now = start;
        let way: Vec<f64> = (0..4)
            .map(|_| {
                let before = now.depth;
                now = desk.pose(&now, frame);
                now.depth - before
            })
            .collect();
        assert!((way[0] - 1e-4).abs() < 1e-12 && (way[2] - 0.5e-4).abs() < 1e-12 && way[3].abs() < 1e-12, "{way:?}");
    }
}
