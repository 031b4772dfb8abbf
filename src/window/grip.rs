//! The mouse takes hold of the needle: what it points at, and how a drag moves it.

use glam::{DVec3, Vec2, Vec3};

use super::camera::Camera;
use super::hand::{Desk, Drag};

/// How near the pointer is to the needle when it takes hold of it [points].
const NEAR: f32 = 12.0;

/// Length of the needle behind its tip that can be taken hold of [m].
const LENGTH: f64 = 60e-3;

/// Square of the sine between needle and line of sight below which a drag upwards or downwards stands for one along the needle.
const END_ON: f32 = 0.02;

/// Tilt of a drag over the height of the view [rad].
const TILT: f64 = 1.5;

/// What a drag with the left button does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Grip {
    /// Turns the view.
    #[default]
    Camera,
    /// Moves the needle along its axis.
    Along,
    /// Tilts it about its point of entry.
    Tilt,
    /// Moves the point of entry.
    Shift,
}

/// Keys that are held while the mouse is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Modifiers {
    pub shift: bool,
    pub control: bool,
    pub alt: bool,
}

impl Grip {
    /// What a drag that begins now will do; `drag`: one of the needle without a key.
    pub fn begin(modifiers: Modifiers, on_needle: bool, drag: Drag) -> Grip {
        match modifiers {
            Modifiers { alt: true, .. } => Grip::Tilt,
            Modifiers { shift: true, control: true, .. } => Grip::Shift,
            Modifiers { shift: true, .. } => Grip::Along,
            Modifiers { control: true, .. } => Grip::Camera,
            _ if on_needle => match drag {
                Drag::Along => Grip::Along,
                Drag::Tilt => Grip::Tilt,
                Drag::Shift => Grip::Shift,
            },
            _ => Grip::Camera,
        }
    }
}

/// The view that the mouse is over.
#[derive(Debug, Clone, Copy)]
pub struct Sight<'a> {
    pub camera: &'a Camera,
    /// Its size [points].
    pub size: Vec2,
    /// Tip [m] and direction (unit) of the needle.
    pub needle: (DVec3, DVec3),
}

impl Sight<'_> {
    fn aspect(&self) -> f32 {
        self.size.x / self.size.y.max(1.0)
    }

    /// From points, y downwards from the upper left corner, to -1..1, y upwards.
    fn on_screen(&self, at: Vec2) -> Vec2 {
        Vec2::new(2.0 * at.x / self.size.x - 1.0, 1.0 - 2.0 * at.y / self.size.y)
    }

    fn seen(&self, place: DVec3) -> Vec2 {
        let seen = self.camera.view_projection(self.aspect()).project_point3(place.as_vec3());
        Vec2::new(0.5 * (seen.x + 1.0), 0.5 * (1.0 - seen.y)) * self.size
    }

    /// True where `at` [points] is near the needle.
    pub fn is_on_needle(&self, at: Vec2) -> bool {
        let (tip, direction) = self.needle;
        let (eye, away) = (self.camera.eye(), (self.camera.centre - self.camera.eye()).normalize());
        let depth = |x: DVec3| (x.as_vec3() - eye).dot(away);
        // The part before the eye alone has a place on the screen.
        let (near, far) = (depth(tip), depth(tip - direction * LENGTH));
        let least = 0.05 * self.camera.distance;
        if near < least {
            return false;
        }
        let part = if far < least { (near - least) / (near - far) } else { 1.0 };
        let (a, b) = (self.seen(tip), self.seen(tip - direction * (LENGTH * f64::from(part))));
        let along = b - a;
        let t = ((at - a).dot(along) / along.length_squared().max(1e-6)).clamp(0.0, 1.0);
        (a + along * t - at).length() < NEAR
    }

    /// Way along the needle between two places of the pointer [m]: from the point of the axis nearest to the one line of sight to that
    /// of the other.
    pub fn way(&self, from: Vec2, to: Vec2) -> f64 {
        let (tip, direction) = self.needle;
        let (tip, d) = (tip.as_vec3(), direction.as_vec3());
        let eye = self.camera.eye();
        let nearest = |at: Vec2| {
            let ray = self.camera.ray(self.aspect(), self.on_screen(at));
            let (between, cosine) = (tip - eye, ray.dot(d));
            let sine = 1.0 - cosine * cosine;
            (sine > END_ON).then(|| (cosine * between.dot(ray) - between.dot(d)) / sine)
        };
        match (nearest(from), nearest(to)) {
            (Some(a), Some(b)) => f64::from(b - a),
            // Seen from its end: as far as on the screen, downwards is onwards.
            _ => f64::from((to.y - from.y) * self.point()),
        }
    }

    /// Way on the surface between two places of the pointer [m].
    pub fn way_on_surface(&self, from: Vec2, to: Vec2) -> DVec3 {
        let eye = self.camera.eye();
        let pierced = |at: Vec2| {
            let ray = self.camera.ray(self.aspect(), self.on_screen(at));
            // A flat sight would throw the point of entry to the horizon.
            (ray.z < -0.1).then(|| eye - ray * (eye.z / ray.z))
        };
        match (pierced(from), pierced(to)) {
            (Some(a), Some(b)) => (b - a).as_dvec3().with_z(0.0),
            _ => {
                let [right, away] = self.camera.level();
                let way: Vec3 = (right * (to.x - from.x) - away * (to.y - from.y)) * self.point();
                way.as_dvec3()
            }
        }
    }

    /// Size of a point of the screen at the middle of the view [m].
    fn point(&self) -> f32 {
        let centre = self.camera.centre.as_dvec3();
        let [right, _] = self.camera.level();
        let seen = self.seen(centre + right.as_dvec3() * 1e-3) - self.seen(centre);
        1e-3 / seen.length().max(1e-3)
    }

    /// Asks the hand for what a drag from one place of the pointer to another means; false where it is for the camera.
    pub fn drag(&self, grip: Grip, from: Vec2, to: Vec2, desk: &mut Desk) -> bool {
        let part = (to - from).as_dvec2() / f64::from(self.size.y.max(1.0));
        match grip {
            Grip::Camera => return false,
            Grip::Along => desk.ask(self.way(from, to)),
            Grip::Tilt => desk.ask_tilt(TILT * part.x, -TILT * part.y),
            Grip::Shift => desk.ask_shift(self.way_on_surface(from, to)),
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::needle::motion::HandPose;
    use crate::window::camera::Preset;
    use crate::window::hand::InputDevice;

    const SIZE: Vec2 = Vec2::new(600.0, 400.0);

    fn camera() -> Camera {
        let mut camera = Camera::around(Vec3::new(0.0, 0.0, -6e-3), 15e-3);
        camera.orbit(Vec2::new(0.1, 0.05));
        camera
    }

    fn oblique() -> (DVec3, DVec3) {
        (DVec3::new(1e-3, 0.5e-3, -4e-3), DVec3::new(0.3, 0.1, -0.9).normalize())
    }

    #[test]
    fn the_needle_is_found_where_it_is_seen() {
        let camera = camera();
        let sight = Sight { camera: &camera, size: SIZE, needle: oblique() };
        let (tip, direction) = oblique();
        for s in [0.0, 3e-3, 10e-3] {
            let place = sight.seen(tip - direction * s);
            assert!(sight.is_on_needle(place), "{place}");
            assert!(sight.is_on_needle(place + Vec2::X * 8.0));
            assert!(!sight.is_on_needle(place + Vec2::X * 30.0));
        }
        // Beyond the tip there is tissue only.
        assert!(!sight.is_on_needle(sight.seen(tip + direction * 4e-3)));
    }

    #[test]
    fn a_drag_along_the_needle_moves_it_under_the_pointer() {
        let camera = camera();
        let sight = Sight { camera: &camera, size: SIZE, needle: oblique() };
        let (tip, direction) = oblique();
        let at = |s: f64| sight.seen(tip + direction * s);
        for (from, to) in [(-5e-3, -2e-3), (-2e-3, -8e-3), (0.0, 1.5e-3)] {
            let way = sight.way(at(from), at(to));
            assert!((way - (to - from)).abs() < 2e-5, "{way} for {}", to - from);
        }
        // Across it, hardly anything.
        let across = (at(0.0) - at(-3e-3)).perp();
        assert!(sight.way(at(-3e-3), at(-3e-3) + across).abs() < 1e-3);
    }

    #[test]
    fn a_needle_seen_from_its_end_still_follows() {
        let mut camera = camera();
        camera.preset(Preset::Top);
        let sight = Sight { camera: &camera, size: SIZE, needle: (DVec3::new(0.0, 0.0, -4e-3), DVec3::NEG_Z) };
        let middle = SIZE * 0.5;
        let way = sight.way(middle, middle + Vec2::Y * 40.0);
        assert!(way > 1e-3 && way < 10e-3, "{way}");
    }

    #[test]
    fn the_point_of_entry_follows_on_the_surface() {
        let mut camera = camera();
        camera.elevation = 0.8;
        let sight = Sight { camera: &camera, size: SIZE, needle: oblique() };
        let (a, b) = (DVec3::new(1e-3, -2e-3, 0.0), DVec3::new(4e-3, 1e-3, 0.0));
        assert!((sight.way_on_surface(sight.seen(a), sight.seen(b)) - (b - a)).length() < 2e-5);
        camera.preset(Preset::Front);
        let sight = Sight { camera: &camera, size: SIZE, needle: oblique() };
        let way = sight.way_on_surface(SIZE * 0.5, SIZE * 0.5 + Vec2::X * 20.0);
        assert!(way.x > 0.0 && way.y.abs() < 1e-9 && way.length() < 10e-3, "{way}");
    }

    #[test]
    fn keys_say_what_a_drag_does() {
        let none = Modifiers::default();
        let begin = |held, on_needle| Grip::begin(held, on_needle, Drag::Along);
        assert_eq!(begin(none, false), Grip::Camera);
        assert_eq!(begin(none, true), Grip::Along);
        assert_eq!(begin(Modifiers { shift: true, ..none }, false), Grip::Along);
        assert_eq!(begin(Modifiers { alt: true, ..none }, true), Grip::Tilt);
        assert_eq!(begin(Modifiers { shift: true, control: true, ..none }, false), Grip::Shift);
        // What is chosen holds for the needle alone, and a key goes before it.
        assert_eq!(Grip::begin(none, true, Drag::Tilt), Grip::Tilt);
        assert_eq!(Grip::begin(none, true, Drag::Shift), Grip::Shift);
        assert_eq!(Grip::begin(none, false, Drag::Tilt), Grip::Camera);
        assert_eq!(Grip::begin(Modifiers { shift: true, ..none }, true, Drag::Tilt), Grip::Along);
        let camera = camera();
        let sight = Sight { camera: &camera, size: SIZE, needle: (DVec3::ZERO, DVec3::NEG_Z) };
        let mut desk = Desk::new(1.0);
        let [right, away] = camera.level();
        desk.seen_from([right.as_dvec3(), away.as_dvec3()]);
        assert!(!sight.drag(Grip::Camera, SIZE * 0.5, SIZE * 0.6, &mut desk));
        let now = HandPose { entry: DVec3::ZERO, direction: DVec3::NEG_Z, depth: 1e-3 };
        assert_eq!(desk.pose(&now, 1.0), now);
        assert!(sight.drag(Grip::Tilt, SIZE * 0.5, SIZE * 0.5 + Vec2::X * 40.0, &mut desk));
        // The hub goes with the pointer, the tip against it.
        assert!(desk.pose(&now, 1.0).direction.dot(right.as_dvec3()) < -0.1);
    }
}
