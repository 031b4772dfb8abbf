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
//! and at least `0.5 c/T` and `m/T^2`, T the frame, about a line that goes on with its drift. Scaled mass counts more
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

use super::parameter::{COUNT, Parameter, Value};
use super::parameters::parameters;
use super::{Effect, Kind};
use crate::needle::beam::{BeamParams, Section};
use crate::units::MILLIMETRE;
use crate::within::Within::{Between, NotNegative};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "flexible_needle",
    kind: Kind::Tool,
    needs: &["puncture"],
    define: "FLEXIBLE_NEEDLE",
    summary: "the needle is a beam clamped in its hub: it bends, and buckles where it is too thin",
    source: "Crisfield1991; Berger1977; coupling: this project",
    cost: "1.5 KiB; one beam solution per display frame, which waits for the frame before",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `flexible_needle`.
    pub struct FlexibleNeedleTable;
    /// Parameters in SI units. The default is an 18G tube of steel with 100 mm of free length.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "flexible_needle": numbers => numbers.effects.flexible_needle.as_ref();

    /// Free length, elements, section and material.
    field beam: BeamParams = BeamParams {
        length: 100e-3,
        elements: 40,
        section: Section { outer_diameter: 1.27e-3, inner_diameter: 0.838e-3 },
        youngs_modulus: 193e9,
        density: 7900.0,
    };

    /// Length from hub to tip [mm]; default 100.
    free_length_mm: MILLIMETRE, Between(5.0, 500.0) =>
    in params: params.beam.length, slider("length from hub to tip", [20.0, 300.0], "needle");

    /// Number of elements, 4 to 200; default 40.
    key elements: Option<u32>;
    slider Parameter::new(
        "flexible_needle.elements",
        "elements of the beam",
        COUNT,
        [4.0, 200.0],
        "converged from 40 on",
        |numbers| present(numbers).map(|p| p.beam.elements as f64),
    );

    /// Diameter of the bore [mm], 0: solid; default: the gauge's, solid for a needle without gauge.
    inner_diameter_mm: MILLIMETRE, NotNegative(20.0) =>
    in params: params.beam.section.inner_diameter, slider("bore of the tube", [0.0, 2.0], "the gauge of the needle");

    /// Acceleration of free fall on the needle [m/s^2]; default: that of the effect `gravity` if it is on, else none.
    key gravity_m_s2: Option<[f64; 3]>;
    /// Acceleration of free fall on the needle [m/s^2]; zero: weightless.
    field gravity: DVec3 = DVec3::ZERO;
    slider Parameter::new(
        "flexible_needle.gravity_m_s2",
        "free fall x, y, z",
        "m/s^2",
        [-20.0, 20.0],
        "9.81 m/s^2 on earth",
        |_| None,
    )
    .holding(Value::List(|numbers| present(numbers).map(|p| p.gravity.to_array().to_vec()), None));
}
