//! A camera that orbits around a point.

use glam::camera::rh;
use glam::{Mat4, Vec2, Vec3};

/// Opening angle, upright [rad].
const OPENING: f32 = 0.6;
/// Just below the poles, where "up" has no direction.
const STEEPEST: f32 = 1.55;

/// Looks at `centre` from `distance` [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    pub centre: Vec3,
    pub distance: f32,
    /// Around the z axis, 0: from -y [rad].
    pub azimuth: f32,
    /// Above the horizon [rad].
    pub elevation: f32,
    /// Radius of what is looked at [m]: sets the range of the depth and how near one may go.
    radius: f32,
}

impl Camera {
    /// Sees a ball around `centre` as a whole.
    pub fn around(centre: Vec3, radius: f32) -> Self {
        let distance = radius / (0.5 * OPENING).sin();
        Camera { centre, distance, azimuth: 0.35, elevation: 0.35, radius }
    }

    pub fn eye(&self) -> Vec3 {
        let (sin_a, cos_a) = self.azimuth.sin_cos();
        let (sin_e, cos_e) = self.elevation.sin_cos();
        self.centre + Vec3::new(sin_a * cos_e, -cos_a * cos_e, sin_e) * self.distance
    }

    /// From the world to clip space; `aspect`: width over height.
    pub fn view_projection(&self, aspect: f32) -> Mat4 {
        let near = (self.distance - 4.0 * self.radius).max(0.02 * self.distance);
        let view = rh::view::look_at_mat4(self.eye(), self.centre, Vec3::Z);
        // Depth from 0 to 1, y upwards.
        rh::proj::directx::perspective(OPENING, aspect, near, self.distance + 8.0 * self.radius) * view
    }

    /// Direction from the eye through a point of the screen, -1..1 each, y upwards (unit).
    pub fn ray(&self, aspect: f32, at: Vec2) -> Vec3 {
        let (right, up, away) = self.axes();
        let half = (0.5 * OPENING).tan();
        (away + right * (at.x * half * aspect) + up * (at.y * half)).normalize()
    }

    /// To the right on the screen and away from the viewer, horizontally (unit).
    pub fn level(&self) -> [Vec3; 2] {
        let (sin, cos) = self.azimuth.sin_cos();
        [Vec3::new(cos, sin, 0.0), Vec3::new(-sin, cos, 0.0)]
    }

    /// To the right and up on the screen, and away (unit).
    fn axes(&self) -> (Vec3, Vec3, Vec3) {
        let away = (self.centre - self.eye()).normalize();
        let right = away.cross(Vec3::Z).normalize();
        (right, right.cross(away), away)
    }

    /// Turns by a drag of the mouse, in parts of the height of the view.
    pub fn orbit(&mut self, drag: Vec2) {
        self.azimuth -= 3.0 * drag.x;
        self.elevation = (self.elevation + 3.0 * drag.y).clamp(-STEEPEST, STEEPEST);
    }

    /// Shifts what is looked at, in parts of the height of the view.
    pub fn pan(&mut self, drag: Vec2) {
        let (right, up, _) = self.axes();
        let height = 2.0 * self.distance * (0.5 * OPENING).tan();
        self.centre += (up * drag.y - right * drag.x) * height;
    }

    /// Goes nearer (positive) or farther.
    pub fn zoom(&mut self, notches: f32) {
        self.distance = (self.distance * 0.9f32.powf(notches)).clamp(0.3 * self.radius, 20.0 * self.radius);
    }

    /// Looks along an axis: from the front, the right or above.
    pub fn preset(&mut self, preset: Preset) {
        (self.azimuth, self.elevation) = match preset {
            Preset::Front => (0.0, 0.0),
            Preset::Side => (std::f32::consts::FRAC_PI_2, 0.0),
            Preset::Top => (0.0, STEEPEST),
            Preset::Oblique => (0.35, 0.35),
        };
    }
}

/// Views with a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Preset {
    Front,
    Side,
    Top,
    Oblique,
}

impl Preset {
    pub const ALL: [(Preset, &str); 4] =
        [(Preset::Front, "front"), (Preset::Side, "side"), (Preset::Top, "top"), (Preset::Oblique, "oblique")];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point on the screen, -1..1, and its depth, 0..1.
    fn seen(camera: &Camera, x: Vec3) -> Vec3 {
        camera.view_projection(1.5).project_point3(x)
    }

    #[test]
    fn up_is_up_and_the_centre_stays_in_the_middle() {
        let mut camera = Camera::around(Vec3::new(1e-3, 2e-3, -8e-3), 12e-3);
        for preset in Preset::ALL {
            camera.preset(preset.0);
            let middle = seen(&camera, camera.centre);
            assert!(middle.truncate().length() < 1e-4 && (0.0..1.0).contains(&middle.z));
        }
        camera.preset(Preset::Front);
        assert!(seen(&camera, camera.centre + Vec3::Z * 1e-3).y > 0.0);
        assert!(seen(&camera, camera.centre + Vec3::X * 1e-3).x > 0.0);
        // Nothing of the ball is outside.
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for x in [camera.centre + axis * 12e-3, camera.centre - axis * 12e-3] {
                let p = seen(&camera, x);
                assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0 && (0.0..1.0).contains(&p.z), "{p}");
            }
        }
    }

    #[test]
    fn a_ray_goes_through_what_is_seen_there() {
        let mut camera = Camera::around(Vec3::new(1e-3, 2e-3, -8e-3), 12e-3);
        camera.orbit(Vec2::new(0.2, -0.3));
        let place = Vec3::new(4e-3, -2e-3, -5e-3);
        let ray = camera.ray(1.5, seen(&camera, place).truncate());
        assert!(ray.angle_between(place - camera.eye()) < 1e-3);
        let [right, away] = camera.level();
        assert!(right.dot(away).abs() < 1e-6 && right.cross(away).z > 0.99);
        assert!(away.dot(camera.centre - camera.eye()) > 0.0);
    }

    #[test]
    fn a_pan_follows_the_mouse() {
        let mut camera = Camera::around(Vec3::ZERO, 10e-3);
        let before = seen(&camera, Vec3::ZERO);
        camera.pan(Vec2::new(0.1, -0.05));
        let moved = seen(&camera, Vec3::ZERO) - before;
        // A tenth of the height is a fifth of the range -1..1; on the screen y goes down.
        assert!((moved.x * 1.5 - 0.2).abs() < 0.02 && (moved.y - 0.1).abs() < 0.02, "{moved}");
        camera.zoom(1e4);
        assert!(camera.distance >= 2.9e-3);
    }
}
