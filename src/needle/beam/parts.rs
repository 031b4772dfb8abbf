//! What a beam is made of and what acts on it: section, numbers, hub, springs, loads, energies.

use super::*;

/// Cross section of a round needle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Section {
    /// Outer diameter [m].
    pub outer_diameter: f64,
    /// Inner diameter [m]; zero: solid.
    pub inner_diameter: f64,
}

impl Section {
    /// Area of the material A [m^2].
    pub fn area(&self) -> f64 {
        0.25 * std::f64::consts::PI * (self.outer_diameter.powi(2) - self.inner_diameter.powi(2))
    }

    /// Second moment of area I [m^4].
    pub fn second_moment(&self) -> f64 {
        std::f64::consts::PI / 64.0 * (self.outer_diameter.powi(4) - self.inner_diameter.powi(4))
    }
}

/// What a needle is made of and how finely it is divided.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BeamParams {
    /// Free length from hub to tip [m].
    pub length: f64,
    /// Number of elements.
    pub elements: usize,
    pub section: Section,
    /// Young's modulus E [Pa].
    pub youngs_modulus: f64,
    /// Density [kg/m^3].
    pub density: f64,
}

impl BeamParams {
    /// Bending stiffness EI [N m^2].
    pub fn bending_stiffness(&self) -> f64 {
        self.youngs_modulus * self.section.second_moment()
    }

    /// Axial stiffness EA [N].
    pub fn axial_stiffness(&self) -> f64 {
        self.youngs_modulus * self.section.area()
    }

    /// Mass per length [kg/m].
    pub fn line_mass(&self) -> f64 {
        self.density * self.section.area()
    }
}

/// Where the clamped end is held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HubPose {
    /// Position of the clamped end [m].
    pub position: DVec3,
    /// Unit vector from hub to tip at the clamp.
    pub direction: DVec3,
    /// Velocity of the clamped end [m/s]; counts in the kinetic energy and the reaction.
    pub velocity: DVec3,
}

/// A spring between a node and a fixed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeSpring {
    /// Stiffness, symmetric [N/m].
    pub stiffness: DMat3,
    /// Where the spring is at rest [m].
    pub anchor: DVec3,
}

impl NodeSpring {
    /// The same stiffness `k` [N/m] in all directions.
    pub fn isotropic(k: f64, anchor: DVec3) -> Self {
        NodeSpring { stiffness: DMat3::from_diagonal(DVec3::splat(k)), anchor }
    }

    /// Stiffness `k` [N/m] across the unit vector `axis`, free along it.
    pub fn lateral(k: f64, axis: DVec3, anchor: DVec3) -> Self {
        let along = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        NodeSpring { stiffness: (DMat3::IDENTITY - along) * k, anchor }
    }

    /// Force on a node at `x` [N].
    pub fn force(&self, x: DVec3) -> DVec3 {
        self.stiffness * (self.anchor - x)
    }

    pub(super) fn energy(&self, x: DVec3) -> f64 {
        -0.5 * self.force(x).dot(x - self.anchor)
    }
}

/// Dead loads and springs on a needle.
#[derive(Debug, Clone, PartialEq)]
pub struct Loads {
    /// Force on each node [N].
    pub force: Vec<DVec3>,
    /// Conjugate to each tangent [N m]: does the work `slope_force . dt`.
    pub slope_force: Vec<DVec3>,
    pub springs: Vec<Option<NodeSpring>>,
    /// Acceleration of free fall on the needle's own mass [m/s^2].
    pub gravity: DVec3,
}

/// Energy held by a needle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeamEnergy {
    /// Bending [J].
    pub bending: f64,
    /// Stretching along the axis [J].
    pub stretching: f64,
    /// Motion [J].
    pub kinetic: f64,
}

impl BeamEnergy {
    pub fn total(&self) -> f64 {
        self.bending + self.stretching + self.kinetic
    }
}

/// How the motion is continued in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeRule {
    /// First order, damps what the step does not resolve.
    BackwardEuler,
    /// Second order, keeps the energy of small motion.
    Trapezoidal,
}

/// What one solution did.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeamStep {
    pub iterations: usize,
    /// Whether the forces balance to 1e-9 of the largest.
    pub converged: bool,
    /// The straight way was unstable: the needle was pushed out of it along its softest mode.
    pub buckled: bool,
    /// Force and moment about the clamp by which the hub holds the needle at the end [N], [N m].
    pub hub_force: DVec3,
    pub hub_moment: DVec3,
    /// Work of the hub, of forces and moments, of gravity on the needle [J].
    pub hub_work: f64,
    pub load_work: f64,
    pub gravity_work: f64,
    /// What the springs took up [J].
    pub spring_energy: f64,
    /// Work that is neither stored nor moved on: the damping of the time rule, and what a sudden load or a snap sets free [J].
    pub dissipated: f64,
}
