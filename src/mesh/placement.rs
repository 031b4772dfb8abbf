//! Where the coordinates of a file are put: scaled about their origin, turned about it, then moved.
//!
//! ```text
//! x = R(axis, angle) (scale X) + shift
//! ```

use glam::{DMat3, DVec3};

use crate::units::four_digits;

/// Smallest and largest factor: a file in nanometres taken for one in metres, and the other way round.
const SCALES: (f64, f64) = (1e-9, 1e9);

/// How a file is placed. The default leaves it where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Factor on all coordinates, above 0.
    pub scale: f64,
    /// Axis through the origin of the file that it is turned about, of length 1.
    pub axis: DVec3,
    /// Angle about it, right-handed [deg].
    pub angle_deg: f64,
    /// Way that it is moved at last [m].
    pub shift: DVec3,
    turn: DMat3,
}

/// What is wrong with the numbers of a placement: the key that is to blame, what it says, and the way out.
#[derive(Debug, Clone, PartialEq)]
pub struct Misplaced {
    /// `scale`, `axis` or `angle_deg`.
    pub key: &'static str,
    /// What is wrong.
    pub message: String,
    /// How to get out of it.
    pub way_out: &'static str,
}

impl Default for Placement {
    fn default() -> Self {
        Self::NONE
    }
}

impl Placement {
    /// Leaves everything where it is.
    pub const NONE: Placement =
        Placement { scale: 1.0, axis: DVec3::Z, angle_deg: 0.0, shift: DVec3::ZERO, turn: DMat3::IDENTITY };

    /// A placement from numbers that people write: axis and angle belong together, `shift` is in metres.
    ///
    /// # Errors
    /// Where a factor is no size, the axis has no direction, or one of axis and angle is missing.
    pub fn new(scale: f64, axis: Option<DVec3>, angle_deg: Option<f64>, shift: DVec3) -> Result<Self, Misplaced> {
        let wrong = |key, message: String, way_out| Err(Misplaced { key, message, way_out });
        if scale < 0.0 {
            return wrong(
                "scale",
                format!("a factor of {scale} mirrors the tissue: left becomes right"),
                "write the factor without its sign; where the file is mirrored, mirror it in the program that wrote it, and where only \
                 two of its axes point the other way, turn it by 180 degrees",
            );
        }
        // Negated, so that what is no number is refused too.
        if !(SCALES.0..=SCALES.1).contains(&scale) {
            return wrong(
                "scale",
                format!("a factor of {scale} leaves no tissue of any size"),
                "write what one step of the file is in its unit, e.g. scale = 0.1; 1 leaves it as it is",
            );
        }
        let (axis, angle_deg) = match (axis, angle_deg) {
            (None, None) => (DVec3::Z, 0.0),
            (Some(_), None) => {
                return wrong(
                    "axis",
                    "there is an axis to turn about and no angle".into(),
                    "add angle_deg = 90, right-handed about the axis, or remove the axis",
                );
            }
            (None, Some(_)) => {
                return wrong(
                    "angle_deg",
                    "there is an angle and no axis to turn about".into(),
                    "add axis = [0, 0, 1], of any length, or remove the angle",
                );
            }
            (Some(axis), Some(angle)) => (axis, angle),
        };
        let Some(axis) = axis.try_normalize() else {
            return wrong(
                "axis",
                "the axis has no direction".into(),
                "write a vector that is not zero, e.g. axis = [0, 0, 1]",
            );
        };
        if !angle_deg.is_finite() {
            return wrong(
                "angle_deg",
                format!("an angle of {angle_deg} is none"),
                "write degrees, e.g. angle_deg = 90",
            );
        }
        Ok(Placement { scale, axis, angle_deg, shift, turn: turn(axis, angle_deg) })
    }

    /// True where nothing moves.
    pub fn is_none(&self) -> bool {
        self.scale == 1.0 && self.turn == DMat3::IDENTITY && self.shift == DVec3::ZERO
    }

    /// Where a point of the file comes to lie [m].
    pub fn point(&self, x: DVec3) -> DVec3 {
        if self.is_none() { x } else { self.turn * (self.scale * x) + self.shift }
    }

    /// What steps along the axes of the file become, as columns [m].
    pub fn steps(&self, steps: DMat3) -> DMat3 {
        if self.is_none() { steps } else { self.turn * (self.scale * steps) }
    }

    /// In words: `scaled by 0.1, turned by 90 degrees about (0, 0, 1), moved by (1, 2, 3) mm`.
    pub fn text(&self) -> String {
        let list = |v: DVec3| v.to_array().map(|x| (four_digits(x) + 0.0).to_string()).join(", ");
        let parts = [
            (self.scale != 1.0).then(|| format!("scaled by {}", four_digits(self.scale))),
            (self.turn != DMat3::IDENTITY)
                .then(|| format!("turned by {} degrees about ({})", four_digits(self.angle_deg), list(self.axis))),
            (self.shift != DVec3::ZERO).then(|| format!("moved by ({}) mm", list(self.shift * 1e3))),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        if parts.is_empty() { "left where it is".into() } else { parts.join(", ") }
    }
}

/// The rotation about a unit vector. By a multiple of a right angle about an axis of coordinates it is exact: a file that lies on its
/// side has then the same digits as one that stands.
fn turn(axis: DVec3, angle_deg: f64) -> DMat3 {
    let (sine, cosine) = match angle_deg.rem_euclid(360.0) {
        0.0 => (0.0, 1.0),
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        angle => angle.to_radians().sin_cos(),
    };
    let along = |e: DVec3| e * cosine + axis.cross(e) * sine + axis * (axis.dot(e) * (1.0 - cosine));
    DMat3::from_cols(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_scales_then_turns_then_moves() {
        let placed = Placement::new(2.0, Some(DVec3::Z * 3.0), Some(90.0), DVec3::new(1.0, 0.0, 0.0)).unwrap();
        assert_eq!(placed.point(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(-3.0, 2.0, 6.0));
        assert_eq!(placed.steps(DMat3::IDENTITY).x_axis, DVec3::new(0.0, 2.0, 0.0));
        assert_eq!(placed.text(), "scaled by 2, turned by 90 degrees about (0, 0, 1), moved by (1000, 0, 0) mm");
        let oblique = Placement::new(1.0, Some(DVec3::ONE), Some(120.0), DVec3::ZERO).unwrap();
        assert!(oblique.point(DVec3::X).distance(DVec3::Y) < 1e-15);
    }

    #[test]
    fn what_mirrors_or_has_no_size_is_refused() {
        let of = |scale, axis, angle| Placement::new(scale, axis, angle, DVec3::ZERO);
        let key = |placed: Result<Placement, Misplaced>| placed.unwrap_err().key;
        for scale in [-1.0, 0.0, f64::NAN, f64::INFINITY] {
            assert_eq!(key(of(scale, None, None)), "scale");
        }
        assert!(of(-1.0, None, None).unwrap_err().message.contains("mirrors"));
        assert_eq!(key(of(1.0, Some(DVec3::ZERO), Some(3.0))), "axis");
        assert_eq!(key(of(1.0, Some(DVec3::X), None)), "axis");
        assert_eq!(key(of(1.0, None, Some(3.0))), "angle_deg");
        assert_eq!(key(of(1.0, Some(DVec3::X), Some(f64::NAN))), "angle_deg");
        assert!(of(1.0, Some(DVec3::X), Some(-720.0)).unwrap().is_none());
    }
}
