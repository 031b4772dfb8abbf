//! Load curves of [`super`]: lengths in units of the radius R of the needle, forces in units of mu R^2.

/// One equilibrium.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct IndentationPoint {
    /// Depth of the tip below the rest surface, or mean displacement under the load over the rest disc [R].
    pub depth: f64,
    /// Axial force [mu R^2].
    pub force: f64,
    /// Stored energy [mu R^3].
    pub energy: f64,
    /// Distance of the outermost touching node from the axis [R].
    pub contact_radius: f64,
    /// The same of that node at rest [R].
    pub contact_rest_radius: f64,
    /// Depth of the outermost touching node below the rest surface [R].
    pub contact_edge_depth: f64,
}

/// Why no equilibrium was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IndentationFailure {
    /// A cell turned inside out.
    Inverted,
    /// The tangent is singular.
    Singular,
    /// The equilibrium found is a saddle of the energy.
    Unstable,
    /// Too many iterations or a step out of bounds.
    NotConverged,
}

/// A load curve, as far as it could be followed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndentationCurve {
    /// Equilibria from rest on.
    pub points: Vec<IndentationPoint>,
    /// Why the curve ends before the limit, if it does.
    pub failure: Option<IndentationFailure>,
}

impl IndentationCurve {
    /// Depth at a force [R]; `None` beyond the ends.
    pub fn depth_at(&self, force: f64) -> Option<f64> {
        self.interpolated(|p| p.force.max(0.0).sqrt(), |p| p.depth, force.max(0.0).sqrt())
    }

    /// Force at a depth [mu R^2]; `None` beyond the ends.
    pub fn force_at(&self, depth: f64) -> Option<f64> {
        self.interpolated(|p| p.depth, |p| p.force, depth)
    }

    /// Stored energy at a depth [mu R^3], for a tip the work of the force; `None` beyond the ends.
    pub fn energy_at(&self, depth: f64) -> Option<f64> {
        self.interpolated(|p| p.depth, |p| p.energy, depth)
    }

    /// Cubic interpolation of `y` over the four points around `x = at`.
    fn interpolated(
        &self,
        x: impl Fn(&IndentationPoint) -> f64,
        y: impl Fn(&IndentationPoint) -> f64,
        at: f64,
    ) -> Option<f64> {
        let span = self.points.windows(2).position(|w| x(&w[0]) <= at && at <= x(&w[1]))?;
        let from = span.saturating_sub(1).min(self.points.len().saturating_sub(4));
        let near = &self.points[from..self.points.len().min(from + 4)];
        let term = |(i, p): (usize, &IndentationPoint)| {
            let others = near.iter().enumerate().filter(|&(j, _)| j != i);
            others.map(|(_, o)| (at - x(o)) / (x(p) - x(o))).product::<f64>() * y(p)
        };
        Some(near.iter().enumerate().map(term).sum())
    }
}

/// Where a curve ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveLimit {
    /// Largest depth [R] (tip only).
    pub depth: f64,
    /// Largest force [mu R^2].
    pub force: f64,
}
