//! Indentation: penalty contact of the surface with a rigid sphere or flat punch.
//!
//! Every face of the top carries 3 x 3 points, each for a ninth of its area A, which follow the bilinear face
//! (src/needle/slit.rs); a tool that met nodes alone would pass between them. With the penetration g of a point along the outward normal n of the tool
//! ```text
//! f = kappa A/9 (g - tau v_n) n, never tensile,   kappa = stiffness_factor (K + 4/3 mu)/h      [N], [Pa/m]
//! tau = 2 zeta sqrt(rho S h / (2 kappa))                                                       [s]
//! ```
//! with h the fine cell edge: a finer mesh penetrates less, and the ratio of contact to tissue in the stable step is the same
//! on every mesh. Friction sticks to the nodes, with the sum of the normal forces of their points.
//! In a label map the faces lie between the places where the skin passes the columns of the grid; each is carried by the nearest node of
//! its column that is at most a quarter of a cell outside.
//!
//! On tetrahedra the nodes of the triangles that face the tool touch themselves, each for a third of their areas A: f = kappa A/3 (g - tau v_n) n.
//! The tool should be wider than two edges, or it passes between them.
//!
//! A bonded punch keeps every node below it at the place of its first touch by a spring kappa A_node in all directions.

use glam::DVec3;

use super::parameters::parameters;
use super::{Effect, Kind};
use crate::needle::Tool;
use crate::units::{OF_CRITICAL, ONE};
use crate::within::Within::{NotNegative, Positive};

/// The entry of this effect in [`super::EFFECTS`].
pub const EFFECT: Effect = Effect {
    key: "indentation",
    kind: Kind::Contact,
    needs: &[],
    define: "INDENTATION",
    summary: "contact of the top face with a rigid sphere or flat punch",
    source: "Wriggers2006",
    cost: "one dispatch and 160 B per top-face node near the tool; 36 points per node",
    parameters: PARAMETERS,
};

parameters! {
    /// Parameters of the effect `indentation`.
    pub struct IndentationTable;
    /// Parameters in SI units.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Params;
    "indentation": numbers => numbers.effects.indentation.as_ref();

    /// Contact stiffness over (K + 4/3 mu) h.
    contact_stiffness_factor: ONE, Positive(100.0) =>
    /// Penalty stiffness factor (dimensionless).
    stiffness_factor = 2.35, slider("contact stiffness", [0.05, 5.0], "numerical").logarithmic();

    /// Fraction of critical damping in the contact normal, 0 to 1.
    contact_damping: OF_CRITICAL, NotNegative(1.0) =>
    /// Fraction of critical damping in the normal direction (dimensionless).
    contact_damping = 0.2, slider("contact damping", [0.0, 1.0], "numerical");
}

/// How deep a point lies in the tool [m], negative outside, and the outward normal of the tool there; `None` for a tool that is no
/// indenter. `lever`: from the tip of the tool, which moves along `direction`; `rest_radius`: distance of the point from the
/// axis at rest [m], which decides what lies under a flat punch.
pub fn penetration(tool: &Tool, lever: DVec3, direction: DVec3, rest_radius: f64) -> Option<(f64, DVec3)> {
    match *tool {
        Tool::Sphere { radius } => {
            let from_centre = lever + direction * radius;
            let distance = from_centre.length().max(1e-9);
            Some((radius - distance, from_centre / distance))
        }
        Tool::FlatPunch { radius, .. } => {
            let depth = if rest_radius <= radius { -lever.dot(direction) } else { -1.0 };
            Some((depth, direction))
        }
        Tool::Needle(_) => None,
    }
}

/// What the effect `indentation` prepares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Contact stiffness per area, kappa [Pa/m].
    pub face_stiffness: f64,
    /// Time constant of the damping: damping over stiffness, tau [s].
    pub face_damping: f64,
}

impl Plan {
    /// For a tissue with the modulus of pressure waves `p_wave_modulus` [Pa], its density with mass scaling [kg/m^3] and the
    /// fine cell edge `h` [m].
    pub fn new(params: &Params, p_wave_modulus: f64, scaled_density: f64, h: f64) -> Self {
        let face_stiffness = params.stiffness_factor * p_wave_modulus / h;
        let face_damping = 2.0 * params.contact_damping * (0.5 * scaled_density * h / face_stiffness).sqrt();
        Plan { face_stiffness, face_damping }
    }

    /// Bound of the stiffness that contact adds at a node with a share of `area` [m^2] of the faces around it [N/m], damping
    /// included. It counts touching or not, so that no mass and no step changes with the contact.
    pub fn stiffness_bound(&self, area: f64) -> f64 {
        2.0 * self.face_stiffness * area
    }
}
