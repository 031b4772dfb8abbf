//! What is sent about the needle, and what is asked of it.

use std::time::Instant;

use glam::{DMat3, DQuat, DVec3};

use super::message::{Content, Kind, MILLIMETRE, NEWTON, Sensor, Status, Transform, cut};

/// Names of devices.
pub const NEEDLE: &str = "Needle";
pub const NEEDLE_POSITION: &str = "NeedlePosition";
pub const NEEDLE_FORCE: &str = "NeedleForce";
pub const NEEDLE_DEPTH: &str = "NeedleDepth";
pub const NEEDLE_STATE: &str = "NeedleState";
pub const NEEDLE_CONTROL: &str = "NeedleControl";
pub const STYLET: &str = "Stylet";

/// Longest text of a state that is sent [byte].
const LONGEST_TEXT: usize = 1000;

/// Farthest coordinate of a pose that a client may ask for [m]: that of a needle over the tissue.
const FARTHEST: f64 = 1.0;

/// Largest entry of R^T R - 1 of what is taken for a rotation: peers compute in f32 and chain transforms.
const ROUNDING: f64 = 1e-3;

/// What the simulation does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunState {
    Running,
    Paused,
    /// Ended or failed; nothing moves any more.
    Stopped,
}

impl RunState {
    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            RunState::Running => "running",
            RunState::Paused => "paused",
            RunState::Stopped => "stopped",
        }
    }
}

/// Where a needle is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Tip [m].
    pub tip: DVec3,
    /// Right-handed orthonormal basis, as columns; the third is the direction of the insertion.
    pub rotation: DMat3,
}

/// A right-handed orthonormal basis whose third column is `direction`, which has length 1. A needle is round: the other two
/// columns mean nothing, but follow small turns with small ones while the needle points down.
pub fn basis_along(direction: DVec3) -> DMat3 {
    let (x, y) = direction.any_orthonormal_pair();
    let basis = DMat3::from_cols(x, y, direction);
    if basis.determinant() > 0.0 { basis } else { DMat3::from_cols(y, x, direction) }
}

impl Pose {
    /// Direction of the insertion, length 1.
    pub fn direction(&self) -> DVec3 {
        self.rotation.z_axis
    }

    pub(super) fn transform(&self) -> Transform {
        Transform { rotation: self.rotation, translation: self.tip * 1e3 }
    }

    /// The pose of a TRANSFORM; what rounding has left out of the rotation is mended, so that the direction has length 1.
    ///
    /// # Errors
    /// What is wrong with it: numbers that are not finite, no rotation, a place too far away.
    pub fn of(transform: &Transform) -> Result<Pose, &'static str> {
        let Transform { rotation, translation } = *transform;
        if !rotation.is_finite() || !translation.is_finite() {
            return Err("its numbers are not finite");
        }
        let excess = rotation.transpose() * rotation - DMat3::IDENTITY;
        if excess.to_cols_array().iter().any(|e| e.abs() > ROUNDING) || rotation.determinant() < 0.0 {
            return Err("its matrix is no rotation");
        }
        let tip = translation * 1e-3;
        if tip.abs().max_element() >= FARTHEST {
            return Err("it is 1000 mm away or more");
        }
        let z = rotation.z_axis.normalize();
        let x = (rotation.x_axis - z * z.dot(rotation.x_axis)).normalize();
        Ok(Pose { tip, rotation: DMat3::from_cols(x, z.cross(x), z) })
    }
}

/// What the simulation tells about a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkState {
    /// Time of the simulation [s].
    pub time: f64,
    pub pose: Pose,
    /// Force that moves the needle along its direction [N], positive along the insertion: what the hand feels.
    pub axial_force: f64,
    /// Size of the force across the needle [N].
    pub lateral_force: f64,
    /// Distance of the tip behind the surface along the needle [m]; negative outside.
    pub depth: f64,
    pub run: RunState,
    /// For people: why the simulation is in this state. At most 1000 bytes are sent.
    pub text: String,
}

impl LinkState {
    /// True where every number is finite.
    pub fn is_finite(&self) -> bool {
        let numbers = [self.time, self.axial_force, self.lateral_force, self.depth];
        self.pose.tip.is_finite() && self.pose.rotation.is_finite() && numbers.iter().all(|n| n.is_finite())
    }

    pub(super) fn status(&self) -> Content {
        // A pose that no longer follows anything is not OK.
        let code = if self.run == RunState::Stopped { Status::DISABLED } else { Status::OK };
        let text = cut(&self.text, LONGEST_TEXT).to_string();
        Content::Status(Status { code, subcode: 0, name: self.run.name().into(), text })
    }

    /// The messages of a kind: their devices and contents.
    pub(super) fn contents(&self, kind: Kind) -> Vec<(&'static str, Content)> {
        match kind {
            Kind::Transform => vec![(NEEDLE, Content::Transform(self.pose.transform()))],
            Kind::Position => {
                let Transform { rotation, translation } = self.pose.transform();
                vec![(NEEDLE_POSITION, Content::Position(translation, DQuat::from_mat3(&rotation)))]
            }
            Kind::Sensor => {
                let force = Sensor { unit: NEWTON, values: vec![self.axial_force, self.lateral_force] };
                let depth = Sensor { unit: MILLIMETRE, values: vec![self.depth * 1e3] };
                vec![(NEEDLE_FORCE, Content::Sensor(force)), (NEEDLE_DEPTH, Content::Sensor(depth))]
            }
            Kind::Text => {
                let text = serde_json::json!({
                    "time_s": self.time,
                    "state": self.run.name(),
                    "axial_force_n": self.axial_force,
                    "lateral_force_n": self.lateral_force,
                    "depth_mm": self.depth * 1e3,
                });
                vec![(NEEDLE_STATE, Content::Text(text.to_string()))]
            }
            Kind::Status => vec![(STYLET, self.status())],
        }
    }
}

/// Where a client wants the needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WantedPose {
    pub pose: Pose,
    /// Counts the poses since the server was started, from 1: another number, another pose.
    pub number: u64,
    /// When it came.
    pub received: Instant,
    /// Whether the client that sent it is still there.
    pub connected: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tilted() -> Pose {
        let direction = DVec3::new(0.2, -0.1, -1.0).normalize();
        Pose { tip: DVec3::new(0.001, 0.002, -0.03), rotation: basis_along(direction) }
    }

    #[test]
    fn a_basis_is_a_rotation_with_the_direction_last() {
        for direction in [DVec3::NEG_Z, DVec3::Z, DVec3::X, DVec3::NEG_Y, tilted().direction()] {
            let basis = basis_along(direction);
            assert_eq!(basis.z_axis, direction);
            assert!((basis.determinant() - 1.0).abs() < 1e-12, "{direction}");
            assert!((basis.transpose() * basis - DMat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-12));
        }
    }

    #[test]
    fn poses_come_back_through_a_transform() {
        let pose = tilted();
        let bytes = Content::Transform(pose.transform()).encode(NEEDLE, 0);
        let Ok(Some(Content::Transform(transform))) = Content::decode("TRANSFORM", &bytes[58..]) else { panic!() };
        let found = Pose::of(&transform).unwrap();
        // 24 bits of a coordinate of 30 mm.
        assert!((found.tip - pose.tip).length() < 4e-9);
        assert!((found.direction() - pose.direction()).length() < 2e-7);
        assert!((found.direction().length() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_is_no_pose_is_refused() {
        let good = tilted().transform();
        let with = |change: fn(&mut Transform)| {
            let mut transform = good;
            change(&mut transform);
            Pose::of(&transform)
        };
        assert!(with(|_| ()).is_ok());
        assert!(with(|t| t.rotation.x_axis += 1e-4).is_ok());
        assert!(with(|t| t.translation.y = f64::NAN).unwrap_err().contains("finite"));
        assert!(with(|t| t.rotation.y_axis.z = f64::INFINITY).unwrap_err().contains("finite"));
        assert!(with(|t| t.rotation *= 1.01).unwrap_err().contains("rotation"));
        assert!(with(|t| t.rotation = DMat3::ZERO).unwrap_err().contains("rotation"));
        assert!(with(|t| t.rotation.x_axis = -t.rotation.x_axis).unwrap_err().contains("rotation"));
        assert!(with(|t| t.translation.x = -1000.0).unwrap_err().contains("1000 mm"));
        assert!(with(|t| t.translation.x = 3e38).unwrap_err().contains("1000 mm"));
    }

    #[test]
    fn texts_are_cut_and_numbers_are_exact() {
        let state = LinkState {
            time: 1.5,
            pose: tilted(),
            axial_force: 0.1,
            lateral_force: 0.02,
            depth: 0.03,
            run: RunState::Stopped,
            text: "µ".repeat(4000),
        };
        let Content::Status(status) = state.status() else { panic!() };
        assert_eq!((status.code, status.text.len()), (Status::DISABLED, 1000));
        let [(_, Content::Text(text))] = &state.contents(Kind::Text)[..] else { panic!() };
        let json: serde_json::Value = serde_json::from_str(text).unwrap();
        assert_eq!((json["axial_force_n"].as_f64(), json["state"].as_str()), (Some(0.1), Some("stopped")));
        let largest = Kind::ALL.map(|kind| state.contents(kind)).concat();
        let bytes: usize = largest.iter().map(|(device, content)| content.encode(device, 0).len()).sum();
        assert!(bytes < 4096, "{bytes}");
    }
}
