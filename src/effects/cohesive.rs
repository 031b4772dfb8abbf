//! Cohesive faces: bilinear traction-separation on surfaces chosen when the scene is built, opened by load or by the tip.
//!
//! Opening `g = x_b - x_a` of two copies of a node, `n` the normal of the surface, `delta_n = g.n`, `delta_s = |g - n delta_n|`:
//! ```text
//! lambda   = sqrt(<delta_n>^2 + delta_s^2),  B = delta_s^2/lambda^2 (share of shear)              [m], -
//! 1/lambda_0^2 = (1 - B)/d_n^2 + B/d_s^2,  d = strength/K                                         quadratic onset
//! G_c      = G_I + (G_II - G_I) B^eta,  lambda_f = 2 G_c/(K lambda_0)                              [J/m^2], [m]
//! D        = max(D, lambda_f (lambda - lambda_0)/(lambda (lambda_f - lambda_0)))                   0..1, irreversible
//! T        = (1 - D) K g open;  closed: the normal part keeps K delta_n                            [Pa]
//! ```
//! Source: Turon et al. 2006 (bilinear law, one penalty for all modes), Camanho & Davila 2002 (quadratic onset),
//! Benzeggagh & Kenane 1996 (mode mixity); answers in tests/references/04_cohesive.json. Nodal quadrature: each pair of
//! copies carries the area of the faces around it.
//!
//! Tip. A face that the needle cuts is driven by the tip, `D >= (a - s0)/h` with the material coordinate a of the tip and
//! that of the pair, s0: tissue stress alone opens no newton-sized path (the project's trials). The cutting force itself
//! is that of the tip law (effect `puncture`). Where both copies lie on the full shaft the bond is gone: D = 1. Torn faces
//! that close again touch while they overlap, and have slid, by less than L = 0.3 h; deeper ones have slid past each other. Their
//! contact fades with both, as a potential of the opening alone ([`TornContact`]): faces that met again as stiff as they had parted
//! created half of the work of a hollow needle that a hand moved to and fro, 0.7 mJ in 0.3 s.
//!
//! Energy: stored `K A ((1 - D) |g|^2/2 + D U)`; a step in which D grows takes `K A dD (g.g_before/2 - U)`, U of the products of both
//! times too: the trapezoidal rule of the leapfrog work. Range of validity: the process zone `E G_c/strength^2` spans a few faces; penalty K = factor E/h, and
//! `lambda_f >= 1.1 lambda_0`: a scene with less is refused.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;

use super::parameter::Parameter;
use super::parameters::parameters;
use super::{Effect, Kind};
use crate::units::{JOULE_PER_SQUARE_METRE, KILOPASCAL, ONE};
use crate::within::Within::{Between, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "cohesive",
    kind: Kind::Faces,
    needs: &[],
    define: "COHESIVE",
    summary: "faces that separate: bilinear cohesion on the slit or bore of a needle and on chosen planes",
    source: "Turon2006, Camanho2002, Benzeggagh1996",
    cost: "one dispatch per step; doubled nodes on the surface; 80 B per pair; shorter time step by the penalty",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `cohesive`: faces that separate. With a needle that cuts, its path opens on them: on a slit
    /// before a solid needle, on the ring of its cutting edge before a hollow one.
    pub struct CohesiveTable;
    /// Parameters in SI units.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Params;
    "cohesive": numbers => numbers.effects.cohesive.as_ref();

    /// Strength in opening [kPa].
    strength_kpa: KILOPASCAL, Positive(1e6) =>
    /// Strength in opening [Pa].
    strength = 200e3, slider("strength in opening", [0.1, 1000.0], "default of this project").logarithmic();

    /// Strength in shear [kPa]; default: that in opening.
    shear_strength_kpa: KILOPASCAL, Positive(1e6) =>
    /// Strength in shear [Pa].
    shear_strength = 200e3, slider("strength in shear", [0.1, 1000.0], "default of this project").logarithmic();

    /// Fracture energy in opening [J/m^2].
    energy_j_m2: JOULE_PER_SQUARE_METRE, Positive(1e6) =>
    /// Fracture energy in opening, G_I [J/m^2].
    energy = 20.0, slider("fracture energy in opening", [1.0, 10000.0], "default of this project").logarithmic();

    /// Fracture energy in shear [J/m^2]; default: that in opening.
    shear_energy_j_m2: JOULE_PER_SQUARE_METRE, Positive(1e6) =>
    /// Fracture energy in shear, G_II [J/m^2].
    shear_energy = 20.0, slider("fracture energy in shear", [1.0, 10000.0], "default of this project").logarithmic();

    /// Exponent of the mode mixity (Benzeggagh and Kenane).
    exponent: ONE, Between(0.1, 10.0) =>
    /// Exponent eta of the mode mixity.
    exponent = 1.45, slider("exponent of the mode mixity", [0.5, 5.0], "Benzeggagh1996");

    /// Penalty stiffness over E/h; or give `penalty_pa_m`.
    penalty_factor: ONE, Positive(1e6) =>
    /// Penalty stiffness over E/h, with the Young's modulus and cell edge of the tissue.
    penalty_factor = 20.0;
    // Only where it counts.
    slider Parameter::new("cohesive.penalty_factor", "penalty stiffness over E/h", "-", [1.0, 1000.0], "numerical", |numbers| {
        present(numbers).filter(|p| p.penalty.is_none()).map(|p| p.penalty_factor)
    })
    .logarithmic();

    /// Penalty stiffness [Pa/m].
    key penalty_pa_m: Option<f64>;
    /// Penalty stiffness K [Pa/m]; `None`: `penalty_factor` E/h.
    field penalty: Option<f64> = None;
    slider Parameter::new("cohesive.penalty_pa_m", "penalty stiffness", "Pa/m", [1e6, 1e12], "numerical", |numbers| {
        present(numbers).and_then(|p| p.penalty)
    })
    .logarithmic();

    /// Planes across the whole block that may separate.
    #[serde(default)]
    key plane: Vec<CohesivePlaneTable>;
    /// Planes across the whole block that may separate, beside the path of the needle.
    field planes: Vec<Plane> = Vec::new();
}

/// A plane that may separate; the nearest grid line is moved there.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CohesivePlaneTable {
    /// Axis of its normal: "x", "y" or "z".
    #[schemars(schema_with = "axes")]
    pub axis: String,
    /// Coordinate [mm]; z is negative below the top face.
    pub at_mm: f64,
    /// True: where the needle passes the plane, its tip opens it; default false (tissue stress alone does).
    #[serde(default)]
    pub tip_driven: bool,
}

/// Words for the axis of a plane.
pub const AXES: [&str; 3] = ["x", "y", "z"];

fn axes(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "string", "enum": AXES })
}

/// Overlap and slip of torn faces, in cells, beyond which they do not touch any more.
pub const TORN_REACH: f64 = 0.3;

/// Contact of torn faces, per K A: with x = delta_n^2/L^2 of a closed face and y = delta_s^2/L^2, each at most 1,
/// ```text
/// U = L^2/6 (1 - (1 - x)^3) (1 - y)^2 -> delta_n^2/2 at small overlap                            [m^2]
/// dU/dg = n delta_n (1 - x)^2 (1 - y)^2 - s 2/3 (1 - (1 - x)^3) (1 - y)                          [m]
/// ```
/// This is of this project. What stood in pressed faces that slide on is given back along the slip: by 4 % of the pressure at most where
/// the overlap is a hundredth of L.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TornContact {
    /// 1 - (1 - x)^3 and (1 - x)^2.
    held: f64,
    pressed: f64,
    /// 1 - y.
    facing: f64,
    /// L [m].
    reach: f64,
}

impl TornContact {
    /// Of the squares of overlap and slip [m^2], or their products at two times; `reach`: L [m].
    pub fn new(overlap_square: f64, slip_square: f64, reach: f64) -> Self {
        let part = |square: f64| (square / (reach * reach)).clamp(0.0, 1.0);
        let left = 1.0 - part(overlap_square);
        TornContact { held: 1.0 - left.powi(3), pressed: left * left, facing: 1.0 - part(slip_square), reach }
    }

    /// U [m^2].
    pub fn stored(&self) -> f64 {
        self.reach * self.reach / 6.0 * self.held * self.facing * self.facing
    }

    /// dU/dg over the normal and over the shear opening (dimensionless).
    pub fn slopes(&self) -> (f64, f64) {
        (self.pressed * self.facing * self.facing, -2.0 / 3.0 * self.held * self.facing)
    }
}

/// A plane of the block that may separate: all points with coordinate `at` [m] on the axis 0, 1 or 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// 0, 1 or 2.
    pub axis: usize,
    /// Coordinate along the axis [m].
    pub at: f64,
    /// Where the needle passes it, the tip opens it: pairs within the radius of the needle lose their bond with it.
    pub tip_driven: bool,
}

/// Least opening at failure over that at onset, `lambda_f/lambda_0 = 2 K G_c/(K lambda_0)^2`, in every mixture of modes. Below 1 a
/// face fails before it begins to, whatever the law says in between: it was torn at the first touch, and the engines differed by 17 %
/// of the force (`scenes/slit.toml` in soft muscle). Measured on the plane of `scenes/effects/cohesive.toml`: at 1.001 the dissipation
/// of the two engines differs by 4 %, from 1.02 on by less than 0.5 %. Such faces are brittle: they part within a few steps, and
/// what they take is 4 to 22 % above G_c up to a ratio of 2, 4 % at 4.
pub const LEAST_OPENING_RATIO: f64 = 1.1;

/// The law with its penalty stiffness.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    /// Largest traction in opening [Pa].
    pub strength: f64,
    /// Largest traction in sliding [Pa].
    pub shear_strength: f64,
    /// Fracture energy of opening G_Ic [J/m^2].
    pub energy: f64,
    /// Fracture energy of sliding G_IIc [J/m^2].
    pub shear_energy: f64,
    /// Exponent of the mixture of modes (dimensionless).
    pub exponent: f64,
    /// K [Pa/m].
    pub penalty: f64,
}

impl Law {
    /// The law of `params` for a tissue of Young's modulus `modulus` [Pa] and cells of edge `h` [m].
    pub fn new(params: &Params, modulus: f64, h: f64) -> Self {
        Law {
            strength: params.strength,
            shear_strength: params.shear_strength,
            energy: params.energy,
            shear_energy: params.shear_energy,
            exponent: params.exponent,
            penalty: params.penalty.unwrap_or(params.penalty_factor * modulus / h),
        }
    }

    /// Fracture energy G_c at the share of shear B [J/m^2].
    pub fn fracture_energy(&self, shear_share: f64) -> f64 {
        self.energy + (self.shear_energy - self.energy) * shear_share.powf(self.exponent)
    }

    /// Openings at which damage begins and ends, lambda_0 and lambda_f [m].
    pub fn openings(&self, shear_share: f64) -> (f64, f64) {
        let (n, s) = (self.strength / self.penalty, self.shear_strength / self.penalty);
        let onset = 1.0 / ((1.0 - shear_share) / (n * n) + shear_share / (s * s)).sqrt();
        (onset, 2.0 * self.fracture_energy(shear_share) / (self.penalty * onset))
    }

    /// The smallest `lambda_f / lambda_0` of all shares of shear, and the share that has it.
    pub fn least_opening_ratio(&self) -> (f64, f64) {
        // The ratio is a smooth function of one variable that may have its minimum inside; a hundredth is near enough.
        let ratios = (0..=100).map(|i| {
            let share = f64::from(i) / 100.0;
            let (onset, end) = self.openings(share);
            (end / onset, share)
        });
        ratios.min_by(|a, b| a.0.total_cmp(&b.0)).expect("101 shares")
    }

    /// Damage that a monotonic opening reaches; `normal` and `shear` [m].
    pub fn damage(&self, normal: f64, shear: f64) -> f64 {
        let open = normal.max(0.0);
        let lambda = open.hypot(shear);
        if lambda == 0.0 {
            return 0.0;
        }
        let (onset, end) = self.openings(shear * shear / (lambda * lambda));
        (end * (lambda - onset) / (lambda * (end - onset))).clamp(0.0, 1.0)
    }

    /// Traction (normal, shear) [Pa] at damage `d`; a closed face keeps its normal stiffness.
    pub fn traction(&self, normal: f64, shear: f64, d: f64) -> (f64, f64) {
        let kept = if normal < 0.0 { 1.0 } else { 1.0 - d };
        (kept * self.penalty * normal, (1.0 - d) * self.penalty * shear)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The force of torn faces is the derivative of what they store, so that no way to and fro creates energy.
    #[test]
    fn torn_faces_give_back_what_they_took() {
        let reach = 0.2e-3;
        let contact = |n: f64, s: f64| TornContact::new(n * n, s * s, reach);
        let step = 1e-9;
        for i in 0..30 {
            for j in 0..30 {
                let (n, s) = (-1e-5 * f64::from(i), 1e-5 * f64::from(j));
                let (normal, slip) = contact(n, s).slopes();
                let along = (contact(n + step, s).stored() - contact(n - step, s).stored()) / (2.0 * step);
                // The shear opening has a length only.
                let across = (contact(n, s + step).stored() - contact(n, s - step).stored()) / (2.0 * step);
                assert!((along - normal * n).abs() < 1e-9, "{n} {s}: {along} {}", normal * n);
                assert!((across - slip * s).abs() < 1e-9, "{n} {s}: {across} {}", slip * s);
            }
        }
        // Lightly pressed faces are as stiff as whole ones; beyond the reach there is nothing.
        assert!((contact(-1e-6, 0.0).stored() / 0.5e-12 - 1.0).abs() < 1e-3);
        assert_eq!(contact(-1e-4, 0.2e-3).stored(), 0.0);
    }
}
