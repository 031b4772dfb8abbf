//! Swelling: the volume at rest grows with a constant rate, as of tissue that takes up water.
//!
//! ```text
//! U(J) = K/2 (J - 1 - theta)^2 = K/2 (J - 1)^2 + W_own,   W_own = K theta (theta/2 - (J - 1))    [J/m^3]
//! P_own = -K theta cof F                                                                         [Pa]
//! d theta/dt = rate;   work supplied in a step  A = K d theta (theta + d theta/2 - (J - 1))      [J/m^3]
//! ```
//! The tangent gains nothing: the part of `cof F` that a plane wave moves along its direction is zero.
//! Source: the volumetric form of thermal expansion, e.g. Holzapfel 2000, section 7.8.

use glam::DMat3;
use stylet::effects::own::{Law, Memory, Number, OwnEffect, Point};
use stylet::effects::{Effect, Kind};
use stylet::material::kinematics::{cofactor, jacobian_minus_one};

pub static SWELLING: OwnEffect = OwnEffect {
    effect: Effect {
        key: "swelling",
        kind: Kind::Constitutive,
        needs: &[],
        define: "SWELLING",
        summary: "growth of the volume at rest with a constant rate",
        source: "Holzapfel2000, section 7.8",
        cost: "32 B per cell",
        parameters: &[],
    },
    column: "swelling_j",
    numbers: &[Number {
        key: "rate_per_s",
        unit: 1.0,
        default: 0.1,
        range: [-1.0, 1.0],
        text: "growth of the volume per second",
    }],
    law: Law { advance, stress, energy, tangent: |_, _| 0.0 },
    shader: include_str!("swelling.wgsl"),
};

fn advance(point: &Point, memory: &mut Memory) -> f64 {
    let growth = point.numbers[0] * point.dt;
    let work = point.bulk_modulus * growth * (memory[0] + 0.5 * growth - jacobian_minus_one(point.h));
    memory[0] += growth;
    work
}

fn stress(point: &Point, memory: &Memory) -> DMat3 {
    cofactor(DMat3::IDENTITY + point.h) * (-point.bulk_modulus * memory[0])
}

fn energy(point: &Point, memory: &Memory) -> f64 {
    point.bulk_modulus * memory[0] * (0.5 * memory[0] - jacobian_minus_one(point.h))
}
