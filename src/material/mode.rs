//! The ways in which a homogeneous sample is loaded.

use glam::{DMat3, DVec3};

/// How a sample is loaded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Mode {
    /// Tension or compression along one axis.
    Uniaxial,
    /// Equal stretch along two axes.
    Equibiaxial,
    /// Stretch along one axis, a second one held: pure shear.
    Planar,
    /// Simple shear.
    Shear,
}

impl Mode {
    pub const ALL: [Mode; 4] = [Mode::Uniaxial, Mode::Equibiaxial, Mode::Planar, Mode::Shear];

    pub fn key(self) -> &'static str {
        match self {
            Mode::Uniaxial => "uniaxial",
            Mode::Equibiaxial => "equibiaxial",
            Mode::Planar => "planar",
            Mode::Shear => "shear",
        }
    }

    /// Principal stretches of an incompressible sample at the stretch, or amount of shear, `x`.
    pub fn principal_stretches(self, x: f64) -> [f64; 3] {
        match self {
            Mode::Uniaxial => [x, x.powf(-0.5), x.powf(-0.5)],
            Mode::Equibiaxial => [x, x, x.powi(-2)],
            Mode::Planar => [x, 1.0, 1.0 / x],
            Mode::Shear => {
                let l = 0.5 * x + (1.0 + 0.25 * x * x).sqrt();
                [l, 1.0, 1.0 / l]
            }
        }
    }

    /// The value of `x` at rest.
    pub fn at_rest(self) -> f64 {
        if self == Mode::Shear { 0.0 } else { 1.0 }
    }

    /// Axes whose stretch is free.
    pub fn free_axes(self) -> &'static [usize] {
        match self {
            Mode::Uniaxial => &[1, 2],
            Mode::Equibiaxial | Mode::Planar => &[2],
            Mode::Shear => &[],
        }
    }

    /// H = F - I with free stretches of 1.
    pub fn displacement_gradient(self, control: f64) -> DMat3 {
        let e = control - self.at_rest();
        match self {
            Mode::Uniaxial | Mode::Planar => DMat3::from_diagonal(DVec3::new(e, 0.0, 0.0)),
            Mode::Equibiaxial => DMat3::from_diagonal(DVec3::new(e, e, 0.0)),
            Mode::Shear => DMat3::from_cols(DVec3::ZERO, DVec3::new(e, 0.0, 0.0), DVec3::ZERO),
        }
    }

    /// The component that the mode measures, of P or of the Cauchy stress: 11, or 12 in shear.
    pub fn component(self, stress: DMat3) -> f64 {
        if self == Mode::Shear { stress.y_axis.x } else { stress.x_axis.x }
    }
}
