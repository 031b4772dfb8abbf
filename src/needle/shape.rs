//! Shape of the tool: a needle, solid or hollow, or an indenter.

#![warn(missing_docs)]

/// A rigid tool.
#[derive(Debug, Clone, PartialEq)]
pub enum Tool {
    /// Solid or hollow, with a cone or a bevel.
    Needle(NeedleShape),
    /// Sphere of the given radius [m].
    Sphere {
        /// Of the ball [m].
        radius: f64,
    },
    /// Flat cylindrical punch of the given radius [m]; `bonded` sticks to the tissue where it touches first.
    FlatPunch {
        /// Of the flat face [m].
        radius: f64,
        /// A node that was touched once is held where it was touched.
        bonded: bool,
    },
}

/// A needle, solid to the tissue: a cylinder with a straight or oblique conical tip.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedleShape {
    /// What the user calls it, e.g. `16G`.
    pub name: String,
    /// Shaft radius R [m].
    pub radius: f64,
    /// Length of the tip, Lc of the cone, 2R/tan(beta) of a bevel [m].
    pub tip_length: f64,
    /// Shape of the tip.
    pub tip: TipShape,
    /// What makes it hollow.
    pub bore: Option<BoreShape>,
    /// Name of the needle material.
    pub material: String,
    /// Young's modulus [Pa] and density [kg/m^3] of the material, and diameter of the bore [m] (0: solid): how a flexible
    /// needle bends.
    pub youngs_modulus: f64,
    /// Of the material [kg/m^3].
    pub density: f64,
    /// Of the bore [m]; 0: solid.
    pub inner_diameter: f64,
    /// Length from the tip to the hub [m]; with the density it gives the mass.
    pub length: f64,
}

/// The inside of a hollow needle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoreShape {
    /// Radius of the bore [m].
    pub radius: f64,
    /// Radius of the cutting edge, between bore and outer radius [m].
    pub edge: f64,
    /// Friction coefficient of the bore (dimensionless).
    pub friction: f64,
}

/// Shape of the tip of a needle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum TipShape {
    /// Circular cone, apex on the axis.
    #[default]
    Cone,
    /// Bevel: an oblique circular cone with its apex on the rim, so that one side runs on along the shaft and the other
    /// stands at the bevel angle to it.
    Bevel {
        /// Heading of the apex seen from the axis [rad], from the first lateral axis of the direction to the second
        /// ([`super::lateral_axes`]); for a vertical needle 0 is +x.
        heading: f64,
    },
}

impl NeedleShape {
    /// Growth of the section's radius per length of the tip; half of that of the flank of a bevel.
    pub fn tip_slope(&self) -> f64 {
        self.radius / self.tip_length
    }

    /// Mass of a solid cylinder [kg]; the missing part of the tip does not count.
    pub fn mass(&self) -> f64 {
        std::f64::consts::PI * self.radius.powi(2) * self.length * self.density
    }

    /// A needle with a conical tip, of steel, 100 mm long. Lengths in m.
    pub fn cone(name: &str, radius: f64, tip_length: f64) -> Self {
        NeedleShape {
            name: name.into(),
            radius,
            tip_length,
            tip: TipShape::Cone,
            bore: None,
            material: "steel-304".into(),
            youngs_modulus: 193e9,
            density: 7900.0,
            inner_diameter: 0.0,
            length: 0.1,
        }
    }
}
