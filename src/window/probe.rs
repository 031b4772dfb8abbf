//! Where an ultrasound probe stands on the tissue, and how much of a needle lies in the slice that it shows.

use glam::{DVec2, DVec3};

use super::section::RestPlane;
use crate::needle::motion::Motion;

/// How far the slice stands beside the entry point, as a part of a fine cell: exactly on grid lines a section would run along cell
/// faces.
const BESIDE_GRID_LINES: f64 = 0.02;

/// Which way the probe is turned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Orientation {
    /// The slice holds the axis of the needle.
    Along,
    /// The slice stands square to the one that holds the axis.
    Across,
}

/// What the user sets at the probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    pub on: bool,
    pub orientation: Orientation,
    /// How far the slice is moved along its normal, from the entry point [m].
    pub offset: f64,
    /// Width of the beam across the slice at half its amplitude [m].
    pub beam_width: f64,
    /// [dB]
    pub gain: f64,
    /// What is given back for attenuation, both ways together [dB/m].
    pub time_gain: f64,
}

impl Default for Probe {
    fn default() -> Self {
        Probe {
            on: false,
            orientation: Orientation::Along,
            offset: 0.0,
            beam_width: 1.5e-3,
            gain: 0.0,
            time_gain: ATTENUATION,
        }
    }
}

/// What soft tissue takes, both ways together [dB/m]: 0.5 dB/(cm MHz), a usual round number, at 7.5 MHz.
pub const ATTENUATION: f64 = 750.0;

/// The slice: fixed in the material, and a picture of it in space. All vectors are unit vectors of the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbePlane {
    /// Middle of the probe's face, on the top face at rest [m].
    pub origin: DVec3,
    /// To the right in the picture.
    pub lateral: DVec3,
    /// Down in the picture, into the tissue.
    pub depth: DVec3,
    /// Out of the slice; with an offset the slice moves along it.
    pub normal: DVec3,
}

impl ProbePlane {
    /// The probe stands upright: its slice holds the vertical and, [`Orientation::Along`], the direction of the insertion. A
    /// vertical needle has no heading: that of x counts.
    pub fn new(motion: &Motion, probe: &Probe, cell_size: f64) -> Self {
        let level = DVec3::new(motion.direction.x, motion.direction.y, 0.0);
        let heading = if level.length() > 1e-6 { level.normalize() } else { DVec3::X };
        let depth = DVec3::NEG_Z;
        let lateral = match probe.orientation {
            Orientation::Along => heading,
            Orientation::Across => DVec3::Z.cross(heading),
        };
        let normal = depth.cross(lateral);
        let offset = probe.offset + BESIDE_GRID_LINES * cell_size;
        ProbePlane { origin: motion.entry + normal * offset, lateral, depth, normal }
    }

    /// Place in the picture (lateral, depth) and distance from the slice along its normal [m].
    pub fn project(&self, x: DVec3) -> (DVec2, f64) {
        let way = x - self.origin;
        (DVec2::new(way.dot(self.lateral), way.dot(self.depth)), way.dot(self.normal))
    }

    /// Direction of a vector in the picture; along the depth where it stands square to the picture.
    pub fn direction(&self, v: DVec3) -> DVec2 {
        DVec2::new(v.dot(self.lateral), v.dot(self.depth)).try_normalize().unwrap_or(DVec2::Y)
    }

    /// The slice as a plane of the material.
    pub fn rest_plane(&self) -> RestPlane {
        RestPlane { normal: self.normal, offset: self.normal.dot(self.origin) }
    }
}

/// How much of what ends `radius` from its axis the beam meets, 0..1, where the axis is `distance` from the slice [m]: all where
/// the slice cuts it, half of the amplitude where it begins half a beam width beside the slice.
pub fn in_slice(distance: f64, radius: f64, beam_width: f64) -> f64 {
    let gap = (distance.abs() - radius).max(0.0) / (0.5 * beam_width);
    (-std::f64::consts::LN_2 * gap * gap).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(direction: DVec3) -> Motion {
        Motion { entry: DVec3::new(2e-3, -1e-3, 0.0), direction: direction.normalize(), ..Default::default() }
    }

    #[test]
    fn the_slice_holds_the_axis_or_stands_across_it() {
        for direction in [DVec3::NEG_Z, DVec3::new(0.5, 0.0, -1.0), DVec3::new(-0.3, 0.4, -0.8)] {
            let motion = motion(direction);
            for orientation in [Orientation::Along, Orientation::Across] {
                let plane = ProbePlane::new(&motion, &Probe { orientation, ..Default::default() }, 0.0);
                // Right-handed axes of unit length, depth downwards.
                assert!((plane.lateral.cross(plane.normal) - plane.depth).length() < 1e-12);
                assert_eq!(plane.depth, DVec3::NEG_Z);
                let (place, distance) = plane.project(motion.entry + motion.direction * 5e-3);
                let level = motion.direction.truncate().length();
                match orientation {
                    Orientation::Along => {
                        assert!(distance.abs() < 1e-15);
                        assert!((place.x - 5e-3 * level).abs() < 1e-12, "the needle heads to the right");
                    }
                    Orientation::Across => {
                        assert!((distance.abs() - 5e-3 * level).abs() < 1e-12);
                        assert!(place.x.abs() < 1e-12);
                    }
                }
                assert!((place.y + 5e-3 * motion.direction.z).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn an_offset_moves_the_slice_along_its_normal() {
        let motion = motion(DVec3::new(0.5, 0.0, -1.0));
        let probe = Probe { offset: 2e-3, ..Default::default() };
        let plane = ProbePlane::new(&motion, &probe, 1e-3);
        let (_, distance) = plane.project(motion.entry);
        assert!((distance + 2.02e-3).abs() < 1e-12);
        // The material plane holds the origin of the picture.
        let rest = plane.rest_plane();
        assert!(
            (rest.normal.dot(plane.origin + plane.lateral * 3e-3 + plane.depth * 7e-3) - rest.offset).abs() < 1e-12
        );
    }

    #[test]
    fn what_lies_beside_the_slice_fades() {
        let (radius, beam) = (0.8e-3, 1.5e-3);
        assert_eq!(in_slice(0.0, radius, beam), 1.0);
        assert_eq!(in_slice(-0.8e-3, radius, beam), 1.0);
        assert!((in_slice(radius + 0.5 * beam, radius, beam) - 0.5).abs() < 1e-12);
        assert!(in_slice(radius + 1.5 * beam, radius, beam) < 0.01);
        let seen: Vec<f64> = (0..40).map(|n| in_slice(1e-4 * f64::from(n), radius, beam)).collect();
        assert!(seen.windows(2).all(|w| w[1] <= w[0]));
    }
}
