//! `sample.csv`: a specimen between driven faces as a testing machine sees it, one row per display frame and face.
//!
//! Nominal values: displacements over the rest length between opposite faces, forces over the rest area of the face.
//! The faces of a tetrahedral mesh are the sides of its bounding box: the area that the tissue has there is not known, and
//! the stresses stay empty.

use glam::DVec3;

use crate::mesh::Mesh;
use crate::observables::FrameRecord;
use crate::observables::quantity::Fold::{Largest, Last};
use crate::observables::quantity::{Quantity, known, number, word};
use crate::scene::{Face, FaceCondition, FaceDrive};
use crate::units::{METRE, NEWTON, NEWTON_METRE, ONE, PASCAL, RADIAN, SECOND};

/// What a row of `sample.csv` is read off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleRow {
    pub face: Face,
    pub point: SamplePoint,
}

/// `sample.csv`. A stress is empty where the area, a shear stress also where the direction is not known.
pub const SAMPLE: [Quantity<SampleRow>; 13] = [
    number("time_s", SECOND, Last, "end of the frame", |r| r.point.time),
    word("face", "the driven face, e.g. `x_max`", |r| r.face.key()),
    number("displacement_x_m", METRE, Last, PRESCRIBED, |r| r.point.displacement.x),
    number("displacement_y_m", METRE, Last, PRESCRIBED, |r| r.point.displacement.y),
    number("displacement_z_m", METRE, Last, PRESCRIBED, |r| r.point.displacement.z),
    number("rotation_rad", RADIAN, Last, "prescribed rotation of the face about its axis", |r| r.point.rotation),
    number("reaction_x_n", NEWTON, Largest, REACTION, |r| r.point.reaction.x),
    number("reaction_y_n", NEWTON, Largest, REACTION, |r| r.point.reaction.y),
    number("reaction_z_n", NEWTON, Largest, REACTION, |r| r.point.reaction.z),
    number("stretch", ONE, Largest, "present over rest length between the face and the opposite one", |r| {
        r.point.stretch
    }),
    known(
        "nominal_stress_pa",
        PASCAL,
        Largest,
        "reaction along the normal over the rest area, tension positive",
        |r| r.point.nominal_stress,
    ),
    known("shear_stress_pa", PASCAL, Largest, "reaction along the drive over the rest area", |r| r.point.shear_stress),
    number("moment_n_m", NEWTON_METRE, Largest, "moment about the axis of the face", |r| r.point.moment),
];

const PRESCRIBED: &str = "prescribed motion of the face";
const REACTION: &str = "what the face exerts on the tissue";

/// A face that moves, and what turns its forces into stresses.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivenFace {
    pub face: Face,
    pub drive: FaceDrive,
    /// Motion of the opposite face, if it is driven too.
    opposite: Option<FaceDrive>,
    /// Rest length between the face and the opposite one [m].
    rest_length: f64,
    /// Rest area of the face [m^2]; `None` on a tetrahedral mesh.
    rest_area: Option<f64>,
}

/// A driven face at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SamplePoint {
    /// [s]
    pub time: f64,
    /// Prescribed translation of the face [m] and rotation about its normal [rad].
    pub displacement: DVec3,
    pub rotation: f64,
    /// What the face exerts on the tissue [N].
    pub reaction: DVec3,
    /// Moment of the same about the axis of the face through its present centre [N m], right-handed about the coordinate axis: what
    /// turns the face by `rotation`.
    pub moment: f64,
    /// Present over rest length between the face and the opposite one.
    pub stretch: f64,
    /// Tangential displacement along the drive over the rest length between the faces.
    pub shear: f64,
    /// Reaction along the outward normal over the rest area, tension positive [Pa].
    pub nominal_stress: Option<f64>,
    /// Tangential reaction along the drive over the rest area [Pa].
    pub shear_stress: Option<f64>,
}

/// How a face moves: that decides what its stress is drawn against.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    /// Mainly along its normal.
    Normal,
    /// Mainly in its plane.
    Tangential,
    /// It only turns.
    Rotation,
}

impl DrivenFace {
    /// The driven faces of a scene, in the order of [`Face`].
    pub fn of_scene(faces: &[FaceCondition; 6], mesh: &Mesh) -> Vec<DrivenFace> {
        let (low, high) = mesh.bounds();
        let size = high - low;
        let driven = |face: Face| faces[face as usize].drive;
        let describe = |face: Face| {
            let axis = face.axis();
            Some(DrivenFace {
                face,
                drive: driven(face)?,
                opposite: driven(Face::ALL[face as usize ^ 1]),
                rest_length: size[axis],
                rest_area: mesh.as_block().map(|_| size[(axis + 1) % 3] * size[(axis + 2) % 3]),
            })
        };
        Face::ALL.into_iter().filter_map(describe).collect()
    }

    fn outward(&self) -> DVec3 {
        let sign = if self.face.is_max() { 1.0 } else { -1.0 };
        DVec3::from(std::array::from_fn(|axis| if axis == self.face.axis() { sign } else { 0.0 }))
    }

    /// Unit vector of the drive in the plane of the face.
    fn tangent(&self) -> Option<DVec3> {
        self.drive.displacement.reject_from_normalized(self.outward()).try_normalize()
    }

    pub fn motion(&self) -> Motion {
        let normal = self.drive.displacement.dot(self.outward()).abs();
        let tangential = self.drive.displacement.reject_from_normalized(self.outward()).length();
        match normal.max(tangential) {
            0.0 => Motion::Rotation,
            _ if normal >= tangential => Motion::Normal,
            _ => Motion::Tangential,
        }
    }

    /// True where the face stands still for longer than it took to get there: a test of relaxation.
    pub fn is_held(&self, end: f64) -> bool {
        self.drive.cycles == 0 && end - self.drive.duration > self.drive.duration
    }

    pub fn point(&self, record: &FrameRecord) -> SamplePoint {
        let part = self.drive.part(record.time);
        let displacement = self.drive.displacement * part;
        let opposite = self.opposite.map_or(DVec3::ZERO, |drive| drive.displacement * drive.part(record.time));
        let apart = displacement - opposite;
        let reaction = record.reactions[self.face as usize];
        let outward = self.outward();
        let tangent = self.tangent();
        let axis = self.face.axis();
        SamplePoint {
            time: record.time,
            displacement,
            rotation: self.drive.rotation * part,
            reaction,
            // The axis goes with the face.
            moment: record.face_moments[self.face as usize] - displacement.cross(reaction)[axis],
            stretch: 1.0 + apart.dot(outward) / self.rest_length,
            shear: tangent.map_or(0.0, |t| apart.dot(t) / self.rest_length),
            nominal_stress: self.rest_area.map(|area| reaction.dot(outward) / area),
            shear_stress: self.rest_area.zip(tangent).map(|(area, t)| reaction.dot(t) / area),
        }
    }

    /// The point of the largest stress, tension or compression; `None` where no stress is known.
    pub fn peak(&self, records: &[FrameRecord]) -> Option<SamplePoint> {
        let stress = |p: &SamplePoint| p.nominal_stress.filter(|s| s.is_finite()).map(f64::abs);
        let points = records.iter().map(|r| self.point(r)).filter(|p| stress(p).is_some());
        points.reduce(|a, b| if stress(&b) > stress(&a) { b } else { a })
    }
}
