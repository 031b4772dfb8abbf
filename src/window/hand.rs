//! What leads the needle: mouse and keyboard, or any other device behind the same trait.

use std::time::Instant;

use glam::{DQuat, DVec3};

use crate::needle::motion::HandPose;

/// A device that a hand holds: it says where the needle shall be, and is told what the needle feels.
pub trait InputDevice {
    /// For people.
    fn name(&self) -> &str;

    /// Where the needle shall be `duration` [s] after it was at `now`. Called once per simulated frame.
    fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose;

    /// True where a pose says where the tip is, whatever the skin; false where it says how far behind the skin, at its point of entry.
    fn places_the_tip(&self) -> bool {
        false
    }

    /// When the oldest input came that no pose has had yet; forgets it.
    fn fresh_input(&mut self) -> Option<Instant> {
        None
    }

    /// Mean force of the tissue on the needle over the last frame [N]: along the axis, positive against an insertion, and aside.
    fn feel(&mut self, _axial: f64, _lateral: DVec3) {}
}

/// A key that a hand holds down.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Key {
    Advance,
    Withdraw,
    /// Leans the hub to this side, as seen on the screen; with [`Desk::shifting`] moves the point of entry there.
    Left,
    Right,
    Away,
    Towards,
}

/// What a drag of the needle does where no key is held, so that one who has a mouse alone can do everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Drag {
    /// Moves it along its axis.
    #[default]
    Along,
    /// Tilts it about its point of entry.
    Tilt,
    /// Moves the point of entry.
    Shift,
}

impl Drag {
    /// All, with the keys of their names.
    pub const ALL: [(Drag, &'static str); 3] =
        [(Drag::Along, "drag-along"), (Drag::Tilt, "drag-tilt"), (Drag::Shift, "drag-shift")];
}

/// Speed of a tilt by keys, and the largest of one by the mouse [rad/s].
const TILT_SPEED: f64 = 0.35;

/// Mouse and keyboard: keys advance at a steady speed, the wheel and a drag set a depth that is gone to at that speed at most. In the
/// same way the needle is tilted about its point of entry, and the point of entry is moved outside the tissue; on a planned path both
/// come to nothing ([`crate::simulation::reach`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Desk {
    /// Speed of a key that is held [m/s].
    pub speed: f64,
    /// What a drag of the needle does.
    pub drag: Drag,
    /// To the right on the screen and away from the viewer, horizontal unit vectors.
    view: [DVec3; 2],
    held: [bool; 6],
    /// The arrow keys move the point of entry.
    shifting: bool,
    /// Way that wheel and drags still ask for [m].
    asked: f64,
    /// Tilt that drags still ask for: the horizontal way that the hub leans [rad].
    asked_tilt: DVec3,
    /// Way of the point of entry that drags still ask for [m].
    asked_shift: DVec3,
    /// Oldest input that no pose has had yet.
    fresh: Option<Instant>,
}

impl Desk {
    pub fn new(speed: f64) -> Self {
        Desk {
            speed,
            drag: Drag::default(),
            view: [DVec3::X, DVec3::Y],
            held: [false; 6],
            shifting: false,
            asked: 0.0,
            asked_tilt: DVec3::ZERO,
            asked_shift: DVec3::ZERO,
            fresh: None,
        }
    }

    pub fn hold(&mut self, key: Key, held: bool) {
        self.held[key as usize] = held;
        self.touched();
    }

    /// Whether the arrow keys move the point of entry instead of the needle.
    pub fn shifting(&mut self, shifting: bool) {
        self.shifting = shifting;
    }

    /// What right and away mean: horizontal unit vectors of the view.
    pub fn seen_from(&mut self, view: [DVec3; 2]) {
        self.view = view;
    }

    pub fn view(&self) -> [DVec3; 2] {
        self.view
    }

    /// Asks for a way along the needle [m].
    pub fn ask(&mut self, way: f64) {
        self.asked += way;
        if way != 0.0 {
            self.touched();
        }
    }

    /// Asks for a tilt: the hub leans to the right and away by these angles [rad].
    pub fn ask_tilt(&mut self, right: f64, away: f64) {
        self.asked_tilt += self.view[0] * right + self.view[1] * away;
        self.touched();
    }

    /// Asks for another point of entry [m].
    pub fn ask_shift(&mut self, way: DVec3) {
        self.asked_shift += way.with_z(0.0);
        self.touched();
    }

    /// True while something is asked of the needle.
    pub fn asks(&self) -> bool {
        let drags = self.asked_tilt != DVec3::ZERO || self.asked_shift != DVec3::ZERO;
        self.asked != 0.0 || drags || self.held.contains(&true)
    }

    fn touched(&mut self) {
        self.fresh.get_or_insert_with(Instant::now);
    }

    /// Lets go of everything: the window has lost the keyboard.
    pub fn let_go(&mut self) {
        *self = Desk { drag: self.drag, view: self.view, fresh: self.fresh, ..Desk::new(self.speed) };
    }

    /// What two opposite keys ask for, -1 to 1.
    fn pair(&self, forwards: Key, backwards: Key) -> f64 {
        f64::from(i8::from(self.held[forwards as usize]) - i8::from(self.held[backwards as usize]))
    }
}

/// The part of `asked` that is at most `reach` long; the rest stays.
fn part_of(asked: &mut DVec3, reach: f64) -> DVec3 {
    let part = asked.clamp_length_max(reach);
    *asked -= part;
    part
}

/// The direction after the hub has leant by the horizontal vector `tilt` [rad].
pub fn leant(direction: DVec3, tilt: DVec3) -> DVec3 {
    if tilt == DVec3::ZERO {
        return direction;
    }
    (DQuat::from_scaled_axis(DVec3::Z.cross(tilt)) * direction).normalize()
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
        let turn = TILT_SPEED * duration;
        let aside = self.view[0] * self.pair(Key::Right, Key::Left) + self.view[1] * self.pair(Key::Away, Key::Towards);
        // With the modifier the keys of the way are arrow keys too: up is away.
        let along = self.pair(Key::Advance, Key::Withdraw);
        let (keys, tilt, shift) = match self.shifting {
            true => (0.0, DVec3::ZERO, aside - self.view[1] * along),
            false => (along * reach, aside * turn, DVec3::ZERO),
        };
        let asked = self.asked.clamp(-reach, reach);
        self.asked -= asked;
        let tilt = tilt + part_of(&mut self.asked_tilt, turn);
        let shift = shift * reach + part_of(&mut self.asked_shift, reach);
        // A needle in the tissue is not dragged sideways by mistake.
        let shift = if now.depth < 0.0 { shift } else { DVec3::ZERO };
        HandPose { entry: now.entry + shift, direction: leant(now.direction, tilt), depth: now.depth + keys + asked }
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
        desk.hold(Key::Advance, true);
        let next = desk.pose(&start, frame);
        assert!((next.depth - start.depth - 1e-4).abs() < 1e-12);
        desk.hold(Key::Withdraw, true);
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

    #[test]
    fn a_tilt_turns_about_the_entry_and_the_entry_moves_outside_only() {
        let mut desk = Desk::new(6e-3);
        desk.seen_from([DVec3::Y, DVec3::NEG_X]);
        let start = HandPose { entry: DVec3::new(1e-3, 0.0, 0.0), direction: DVec3::NEG_Z, depth: 5e-3 };
        let second = |desk: &mut Desk, mut now: HandPose| {
            for _ in 0..60 {
                now = desk.pose(&now, 1.0 / 60.0);
            }
            now
        };
        desk.hold(Key::Right, true);
        let leant = second(&mut desk, start);
        assert_eq!((leant.entry, leant.depth), (start.entry, start.depth));
        assert!((leant.direction.angle_between(start.direction) - TILT_SPEED).abs() < 1e-9);
        // The hub goes to the right, which is +y here, the tip the other way.
        assert!(leant.direction.y < -0.3 && leant.direction.x.abs() < 1e-12);
        desk.let_go();
        desk.ask_tilt(-0.2, 0.1);
        let asked = second(&mut desk, start);
        assert!(asked.direction.y > 0.19 && asked.direction.x > 0.09, "{}", asked.direction);
        desk.hold(Key::Left, true);
        desk.shifting(true);
        desk.ask_shift(DVec3::new(2e-3, 0.0, 1.0));
        assert_eq!(second(&mut desk, start), start, "in the tissue");
        desk.ask_shift(DVec3::new(2e-3, 0.0, 1.0));
        let shifted = second(&mut desk, HandPose { depth: -1e-3, ..start });
        assert!((shifted.entry - DVec3::new(3e-3, -6e-3, 0.0)).length() < 1e-9, "{}", shifted.entry);
        assert_eq!(shifted.direction, start.direction);
    }
}
