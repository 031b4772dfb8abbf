//! Flexible needle: the shaft bends between hub and tissue, and the tissue bends it.
//!
//! The needle is a beam clamped in its hub (`needle::beam`), solved implicitly once per display frame on the CPU; the tissue
//! sees its centre-line `c(s)`, `s` behind the tip, as a table of 32 lateral offsets and rates,
//! ```text
//! contact: radial = lever - d s - c(s),  grad phi -> grad phi - d (grad phi . c'(s)),  v_needle = v_hub + dc/dt
//! beam:    loads of the last frame, one per entry, shared by the same hats, so that sum f_i . dc_i is their work
//! ```
//! Staggered coupling: frame n moves the centre-line linearly from x_n to x_(n+1); its mean loads f_n, which belong to the mean
//! line (x_n + x_(n+1))/2, and the springs `k_r` about that line (a Robin condition: the tissue's answer to a further move;
//! along the axis the line goes on with the hub, and the tip adds its springs in series with the tissue around a disc, `16 mu R`)
//! give x_(n+2). With a tissue of stiffness k, damping c and mass m per length, force -(k x + c x' + m x''), and a needle that
//! is soft against it, the roots of the recursion lie in the unit circle where the spring is at least `k/2` about the mean line,
//! and at least `0.8 c/T` and `1.6 m/T^2`, T the frame, about a line that goes on with half its drift. Scaled mass counts more
//! than stiffness. So
//! ```text
//! k_r = k + 2 c/T + 3 m/T^2                                                                [N/m^2]
//! k   = 4 pi mu / (ln(b/R) - (b^2 - R^2)/(b^2 + R^2))         a rigid circle in an incompressible ring
//! c   = 4 R rho (v_P + v_S)                                   waves from its front, back and sides [Berger1977]
//! m   = pi r_r^2 rho                                          the ring that the path holds
//! ```
//! with the stiffest and densest tissue, the scaled density rho, and b half the smaller width of the block; softened path and
//! contact springs make the true k smaller. Source: this project; beam [Crisfield1991].
//! Assumptions: the path is cut along the planned line of the material, so that needle and tissue bend together, and no curved
//! path is cut. Range of validity: the centre-line leaves the axis by less than the free length permits small slopes in the
//! tissue (0.3 rad).

use glam::DVec3;

use super::parameter::{Parameter, Value};
use super::{Effect, Kind};
use crate::needle::beam::{BeamParams, Section};

pub const EFFECT: Effect = Effect {
    key: "flexible_needle",
    kind: Kind::Tool,
    needs: &["puncture"],
    define: "FLEXIBLE_NEEDLE",
    summary: "the needle is a beam clamped in its hub: it bends, and buckles where it is too thin",
    source: "Crisfield1991; Berger1977; coupling: this project",
    cost: "1.5 KiB; one beam solution per display frame, which waits for the frame before",
    parameters: &PARAMETERS,
};

/// What may be changed while a run goes on.
const PARAMETERS: [Parameter; 4] = [
    Parameter::new("flexible_needle.free_length_mm", "length from hub to tip", "mm", [20.0, 300.0], "needle", |s| {
        s.effects.flexible_needle.as_ref().map(|p| p.beam.length / 1e-3)
    }),
    Parameter::new(
        "flexible_needle.elements",
        "elements of the beam",
        "count",
        [4.0, 200.0],
        "converged from 40 on",
        |s| s.effects.flexible_needle.as_ref().map(|p| p.beam.elements as f64),
    ),
    Parameter::new(
        "flexible_needle.inner_diameter_mm",
        "bore of the tube",
        "mm",
        [0.0, 2.0],
        "the gauge of the needle",
        |s| s.effects.flexible_needle.as_ref().map(|p| p.beam.section.inner_diameter / 1e-3),
    ),
    Parameter::new(
        "flexible_needle.gravity_m_s2",
        "free fall x, y, z",
        "m/s^2",
        [-20.0, 20.0],
        "9.81 m/s^2 on earth",
        |_| None,
    )
    .holding(Value::List(|s| s.effects.flexible_needle.map(|p| p.gravity.to_array().to_vec()), None)),
];

/// Parameters in SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Params {
    /// Free length, elements, section and material.
    pub beam: BeamParams,
    /// Acceleration of free fall on the needle [m/s^2]; zero: weightless.
    pub gravity: DVec3,
}

impl Default for Params {
    /// An 18G tube of steel with 100 mm of free length.
    fn default() -> Self {
        Params {
            beam: BeamParams {
                length: 100e-3,
                elements: 40,
                section: Section { outer_diameter: 1.27e-3, inner_diameter: 0.838e-3 },
                youngs_modulus: 193e9,
                density: 7900.0,
            },
            gravity: DVec3::ZERO,
        }
    }
}
